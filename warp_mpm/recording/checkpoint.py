"""Checkpoints: the state of a run and of its records, from which it goes on as if it had never been interrupted.

A checkpoint is one file: a line of JSON (what it is, of which scene, where the records stood, a check sum) and the
simulation's state. It is written aside, brought to the disk and renamed, so that at any moment the folder holds a whole
one. Only the first records at or after its time trigger it: the time steps are the same with and without checkpoints.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol

from warp_mpm.recording.run_folder import CHECKPOINT, RunFolder, RunFolderError
from warp_mpm.recording.schedule import Schedule

FORMAT = 1
"""Version of the checkpoint's layout."""

WALL_INTERVAL = 30.0
"""Wall time [s] between checkpoints where the scenario gives no interval; longer where writing takes over 1 % of it."""

LONGEST_HEADER = 100_000
"""Most bytes of the first line that are read."""


class Marked(Protocol):
    """A recorder that can tell where it stands."""

    def mark(self) -> dict[str, Any]:
        """Bring everything to the disk and tell where the records stand."""


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint that has been read and checked."""

    time: float
    """Simulated time [s]."""
    wall_time: float
    """Wall time of the run up to there [s]."""
    marks: dict[str, dict[str, Any]]
    """Where each recorder stood."""
    state: bytes
    """Of `Simulation.save_state`."""


class Checkpointer:
    """Writes the checkpoints of a run into its folder."""

    def __init__(
        self,
        folder: RunFolder,
        scenario: dict[str, Any],
        recorders: Mapping[str, Marked],
        interval: float | None,
        *,
        wall_before: float = 0.0,
        asked: Callable[[], bool] = lambda: False,
    ):
        """Args: interval: simulated time between checkpoints [s], None: by wall time; wall_before: time spent [s];
        asked: whether somebody wants one now."""
        self._folder, self._scene, self._recorders = folder, fingerprint(scenario), recorders
        self._schedule = Schedule(interval) if interval is not None else None
        self._start, self._asked = time.perf_counter() - wall_before, asked
        self._next_wall = -float("inf")

    def after_records(self, simulation: Any, *, stopping: bool) -> None:
        """Write a checkpoint if one is due; always when the run is about to stop.

        Raises:
            OSError: the disk does not take it; the checkpoint before is kept.
        """
        now = time.perf_counter()
        due = self._schedule.passed(simulation.time) if self._schedule is not None else now >= self._next_wall
        if not (self._asked() or due or stopping):
            return
        state: bytes = simulation.save_state()
        header = {
            "format": FORMAT,
            "versions": versions(),
            "scene": self._scene,
            "time": simulation.time,
            "wall_time": now - self._start,
            "marks": {name: recorder.mark() for name, recorder in self._recorders.items()},
            "state_bytes": len(state),
        }
        line = json.dumps(header | {"sha256": _check_sum(header, state)})
        self._folder.write_bytes(CHECKPOINT, line.encode(), b"\n", state)
        done = time.perf_counter()
        self._next_wall = done + max(WALL_INTERVAL, 100.0 * (done - now))


def read_checkpoint(path: Path, scenario: dict[str, Any]) -> Checkpoint:
    """Read and check the checkpoint of a run of `scenario`.

    Raises:
        RunFolderError: it cannot be read, is damaged, or is of another scene or version; nothing was touched.
    """
    again = f"Start the run again: python -m warp_mpm run {path.parent / 'scenario.json'} --out OTHER_FOLDER"
    try:
        with path.open("rb") as file:
            line = file.readline(LONGEST_HEADER)
            header = json.loads(line)
            if not isinstance(header, dict):
                raise ValueError("its first line is no group of fields")
            size = header.get("state_bytes")
            if not isinstance(size, int) or size < 0 or path.stat().st_size != len(line) + size:
                raise ValueError("it is not as long as it says")
            state = file.read(size)
    except OSError as error:
        raise RunFolderError(f"{path} cannot be read: {error.strerror or error}.") from None
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{path} is damaged or no checkpoint ({error}). {again}") from None
    check = header.pop("sha256", None)
    if check != _check_sum(header, state):
        raise RunFolderError(f"{path} is damaged: its check sum is wrong. {again}")
    if header.get("format") != FORMAT or header.get("versions") != versions():
        written = ", ".join(f"{name} {version}" for name, version in (header.get("versions") or {}).items())
        here = ", ".join(f"{name} {version}" for name, version in versions().items())
        raise RunFolderError(
            f"{path} was written by another version ({written}; here is {here}), with which the run can go on. {again}"
        )
    if header.get("scene") != fingerprint(scenario):
        raise RunFolderError(f"{path} belongs to another scene than the scenario.json beside it. {again}")
    return Checkpoint(header["time"], header["wall_time"], header["marks"], state)


def _check_sum(header: dict[str, Any], state: bytes) -> str:
    """Of the first line without it, and of the state; one after the other, since a state may fill half the memory."""
    check = hashlib.sha256(json.dumps(header).encode())
    check.update(state)
    return check.hexdigest()


def fingerprint(scenario: dict[str, Any]) -> str:
    """Check sum of a resolved scenario."""
    return hashlib.sha256(json.dumps(scenario, sort_keys=True).encode()).hexdigest()


def versions() -> dict[str, str]:
    """Versions on which the numbers of a run depend."""
    found = {}
    for package in ("warp-mpm-impact", "warp-lang"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "of the source tree"
    return found
