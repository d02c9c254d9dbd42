"""The folder of a run: which files it holds, and how it is made without harming what is there."""

from __future__ import annotations

import contextlib
import json
import math
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Self

try:
    import fcntl
except ImportError:  # no such lock on Windows
    fcntl = None  # type: ignore[assignment]

FORMAT = 1
"""Version of the layout, which a run's record states."""

SCENARIO = "scenario.json"
RECORD = "run.json"
TIME_SERIES = "timeseries.csv"
SNAPSHOTS = "snapshots.vtkhdf"
SURFACES = "surfaces.vtkhdf"
"""Barrier and ground; there unless the scene has neither."""
SUMMARY = "summary.json"
FORCE_PLOT = "force_and_displacement.png"
PRESSURE_PLOT = "pore_pressure.png"
CHECKPOINT = "checkpoint.bin"
"""There only until the run has ended."""
REPORT = "report.html"
LOADS = "loads.h5"
"""Both there only where they were asked for."""

OWN_FILES = (SCENARIO, RECORD, TIME_SERIES, SNAPSHOTS, SURFACES, SUMMARY, FORCE_PLOT, PRESSURE_PLOT)
"""All that a finished run leaves."""

ASIDE = ".new"
"""Ending of a file that is still being written."""


class RunFolderError(OSError):
    """The run folder cannot be used; the message says why and what to do."""


class RunFolder:
    """A folder that a run may write to. A context manager, which sets the folder free for other runs at its end."""

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._lock: int | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def lock(self) -> None:
        """Keep other runs out until `release`, or until the process ends, however it ends.

        Raises:
            RunFolderError: another run is writing there.
        """
        if fcntl is None or self._lock is not None:
            return
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise RunFolderError(f"Another run is writing to {self.path}; choose another folder with --out.") from None
        except OSError:  # a file system without locks
            os.close(descriptor)
            return
        self._lock = descriptor

    def release(self) -> None:
        """Let other runs in."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @staticmethod
    def check(path: str | Path, *, force: bool = False) -> None:
        """Refuse a folder that a run must not write to, without touching it.

        Raises:
            RunFolderError: it holds a run and `force` is not set, it holds something else, or it is a file.
        """
        path = Path(path)
        try:
            if path.is_symlink() and not path.exists():
                raise RunFolderError(
                    f"{path} is a link to {os.readlink(path)}, which is not there; choose another folder with --out."
                )
            if not path.exists():
                return
            if not path.is_dir():
                raise RunFolderError(f"{path} is a file; the results need a folder. Choose another with --out.")
            names = {item.name for item in path.iterdir()}
        except RunFolderError:
            raise
        except OSError as error:
            reason = error.strerror or str(error)
            raise RunFolderError(f"{path} cannot be used: {reason}; choose another folder with --out.") from None
        if not names:
            return
        if RECORD not in names:
            raise RunFolderError(f"{path} holds files that no run has written; choose another folder with --out.")
        if not force:
            unfinished = f", or go on with it: run --resume {path}" if (path / CHECKPOINT).exists() else ""
            raise RunFolderError(
                f"{path} holds a run already; choose another folder with --out, or add --force{unfinished}."
            )
        with RunFolder(path) as folder:
            folder.lock()

    @classmethod
    def create(
        cls, path: str | Path, scenario: dict[str, Any], record: dict[str, Any], *, force: bool = False
    ) -> RunFolder:
        """Make the folder, locked, with the resolved scenario and the run's record; remove an older run's own files on
        `force`.

        Raises:
            RunFolderError: see `check`, or the folder cannot be written to.
        """
        cls.check(path, force=force)
        folder = cls(path)
        path = folder.path
        try:
            try:
                path.mkdir(parents=True, exist_ok=True)
            except FileExistsError as error:  # a file, or a link that leads nowhere, in the place of a folder
                raise RunFolderError(f"Cannot write to {path}: {error.filename} is no folder.") from None
            folder.lock()
            if force:
                # The record goes last: as long as it is there, the folder is known as a run's.
                own = (*(name for name in (*OWN_FILES, CHECKPOINT, REPORT, LOADS) if name != RECORD), RECORD)
                for name in own:
                    (path / (name + ASIDE)).unlink(missing_ok=True)
                    (path / name).unlink(missing_ok=True)
            # Of two runs that start at once into one folder, only one can create the record.
            with (path / RECORD).open("xb") as file:
                file.write(_bytes(record))
            folder.write(SCENARIO, scenario)
        except FileExistsError:
            folder.release()
            raise RunFolderError(f"Another run has just begun to write to {path}; choose another folder.") from None
        except RunFolderError:
            raise
        except OSError as error:
            folder.release()
            raise RunFolderError(f"Cannot write to {path}: {error.strerror or error}.") from None
        return folder

    def write(self, name: str, content: dict[str, Any]) -> None:
        """Write a JSON file whole or not at all. A number that is none (NaN) or has no end is written as null."""
        self.write_bytes(name, _bytes(content))

    def write_bytes(self, name: str, *content: bytes) -> None:
        """Write a file, given in pieces, whole or not at all.

        Raises:
            OSError: it could not be written; what was there before is there still.
        """
        target = self.path / name
        aside = target.with_name(name + ASIDE)
        try:
            with aside.open("wb") as file:
                file.writelines(content)
                file.flush()
                os.fsync(file.fileno())
            aside.replace(target)
        except OSError:
            with contextlib.suppress(OSError):
                aside.unlink()
            raise


def finite(value: Any) -> Any:
    """The same with every float that JSON does not know, at any depth, replaced by None."""
    if isinstance(value, dict):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _bytes(content: dict[str, Any]) -> bytes:
    text = json.dumps(finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode(errors="backslashreplace")  # half a character, of a file's name, becomes what JSON calls it
