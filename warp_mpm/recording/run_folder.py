"""The folder of a run: which files it holds, and how it is made without harming what is there."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

SCENARIO = "scenario.json"
RECORD = "run.json"
TIME_SERIES = "timeseries.csv"
SNAPSHOTS = "snapshots.vtkhdf"
SUMMARY = "summary.json"
FORCE_PLOT = "force_and_displacement.png"
PRESSURE_PLOT = "pore_pressure.png"

OWN_FILES = (SCENARIO, RECORD, TIME_SERIES, SNAPSHOTS, SUMMARY, FORCE_PLOT, PRESSURE_PLOT)
"""All that a run writes, and all that `force` may remove."""


class RunFolderError(OSError):
    """The run folder cannot be used; the message says why and what to do."""


class RunFolder:
    """A folder that a run may write to."""

    def __init__(self, path: Path):
        self.path = path

    @staticmethod
    def check(path: Path, *, force: bool = False) -> None:
        """Refuse a folder that a run must not write to, without touching it.

        Raises:
            RunFolderError: it holds a run and `force` is not set, it holds something else, or it is a file.
        """
        if not path.exists():
            return
        if not path.is_dir():
            raise RunFolderError(f"{path} is a file; the results need a folder. Choose another with --out.")
        names = {item.name for item in path.iterdir()}
        if not names:
            return
        if RECORD not in names:
            raise RunFolderError(f"{path} holds files that no run has written; choose another folder with --out.")
        if not force:
            raise RunFolderError(f"{path} holds a run already; choose another folder with --out, or add --force.")

    @classmethod
    def create(cls, path: Path, scenario: dict[str, Any], record: dict[str, Any], *, force: bool = False) -> RunFolder:
        """Make the folder with the resolved scenario and the run's record; remove an older run's own files on `force`.

        Raises:
            RunFolderError: see `check`, or the folder cannot be written to.
        """
        cls.check(path, force=force)
        folder = cls(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
            if force:
                # The record goes last: as long as it is there, the folder is known as a run's.
                for name in sorted(OWN_FILES, key=lambda name: name == RECORD):
                    (path / name).unlink(missing_ok=True)
            # Of two runs that start at once into one folder, only one can create the record.
            with (path / RECORD).open("x", encoding="utf-8") as file:
                file.write(_text(record))
            folder.write(SCENARIO, scenario)
        except FileExistsError:
            raise RunFolderError(f"Another run has just begun to write to {path}; choose another folder.") from None
        except OSError as error:
            raise RunFolderError(f"Cannot write to {path}: {error.strerror or error}.") from None
        return folder

    def write(self, name: str, content: dict[str, Any]) -> None:
        """Write a JSON file whole or not at all. A number that is none (NaN) or has no end is written as null."""
        target = self.path / name
        aside = target.with_name(name + ".new")
        with aside.open("w", encoding="utf-8") as file:
            file.write(_text(content))
            file.flush()
            os.fsync(file.fileno())
        aside.replace(target)


def finite(value: Any) -> Any:
    """The same with every float that JSON does not know, at any depth, replaced by None."""
    if isinstance(value, dict):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _text(content: dict[str, Any]) -> str:
    return json.dumps(finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
