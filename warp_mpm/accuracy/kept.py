"""What was probed and chosen before: a file for each scene in the user's cache folder, which may vanish at any time."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import sys
import tempfile
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from warp_mpm.scenario import Scenario

FOLDER = "WARP_MPM_CACHE_DIR"
"""Environment variable that names another folder."""

PARTS = ("probes", "timed", "choices")
"""Parts of a file that grow by name; what another process has written under a name stays."""


def cache_folder() -> Path:
    """The user's folder for what can be computed again.

    Raises:
        RuntimeError: the user has no home.
    """
    given = os.environ.get(FOLDER)
    if given:
        return Path(given)
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA")
        return (Path(local) if local else Path.home() / "AppData" / "Local") / "warp-mpm" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "warp-mpm"
    xdg = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(xdg) if Path(xdg).is_absolute() else Path.home() / ".cache") / "warp-mpm"


class Kept:
    """What is kept of one scene, on one machine, for one state of the program.

    A file that is missing, damaged or not readable is an empty one; a folder that cannot be written keeps nothing.
    Several processes may keep at the same time: files are replaced whole, and what is there is not replaced by what
    another process found meanwhile.
    """

    def __init__(self, path: Path | None):
        """Args: path: of the file; None: nothing is kept beyond this object."""
        self._path = path
        self._content: dict[str, Any] = {}

    @classmethod
    def of(cls, scenario: Scenario, device: str, folder: Path | None = None) -> Kept:
        """Of a scene, whatever its spacing.

        Args:
            scenario: all of it counts but title, source, notes and spacing.
            device: on which it is run.
            folder: in place of the user's.
        """
        if folder is None:
            try:
                folder = cache_folder() / "purchases"
            except RuntimeError:
                return cls(None)
        content = {name: value for name, value in scenario.resolved().items() if name not in _WORDS}
        content["numerics"] = {name: v for name, v in content["numerics"].items() if name != "spacing_m"}
        text = json.dumps([content, device, _machine(), _program()], sort_keys=True)
        return cls(folder / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.json")

    @property
    def lasting(self) -> bool:
        """Whether the next process finds what is kept."""
        return self._path is not None and bool(self._content) and self._read() == self._content

    def content(self) -> dict[str, Any]:
        """What is kept now; its parts are not checked."""
        found = self._read()
        self._content = _merged(found, self._content) if found else self._content
        return self._content

    def add(self, content: dict[str, Any]) -> dict[str, Any]:
        """Keep more; return what is kept then, in which what was there before has precedence."""
        self._content = _merged(self.content(), content)
        self._write()
        return self._content

    def replace(self, content: dict[str, Any]) -> None:
        """Keep this in place of what is there, which was found to be of no use."""
        self._content = content
        self._write()

    def _read(self) -> dict[str, Any]:
        if self._path is None:
            return {}
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return {}
        return content if isinstance(content, dict) else {}

    def _write(self) -> None:
        if self._path is None:
            return
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=self._path.parent, prefix=self._path.stem, suffix=".new")
            try:
                with os.fdopen(handle, "w", encoding="utf-8") as file:
                    json.dump(self._content, file)
                Path(name).replace(self._path)
            finally:
                Path(name).unlink(missing_ok=True)


_WORDS = ("title", "source", "notes")
"""Parts of a scenario that decide nothing."""


def _merged(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    whole = second | first
    for part in PARTS:
        if isinstance(first.get(part), dict) and isinstance(second.get(part), dict):
            whole[part] = second[part] | first[part]
    return whole


def _machine() -> list[Any]:
    return [platform.node(), platform.machine(), platform.processor(), os.cpu_count()]


@cache
def _program() -> list[str]:
    """The whole program and the versions of what it computes with: what either changes may change a choice."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    versions = []
    for package in ("warp-lang", "numpy"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions.append(metadata.version(package))
    return [digest.hexdigest(), platform.python_version(), *versions]
