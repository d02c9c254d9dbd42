"""What came of validation cases, kept in a file so that a validation of hours can go on where it stopped."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from analytic.whole_file import write_whole
from warp_mpm.accuracy.keys import code_digest, imported_by
from warp_mpm.shipped import scenario_files
from warp_mpm.validation.case import Case, Check, Outcome, Point, Table
from warp_mpm.validation.page import Result


@dataclass(frozen=True)
class _One:
    """A case's result as it stands in the file: all but its curves, which are in its pictures."""

    key: str
    seconds: float
    checks: Sequence[Check]
    points: Sequence[Point]
    tables: Sequence[Table]
    remarks: Sequence[str]
    pictures: Sequence[tuple[str, str]]


_FILE = TypeAdapter(dict[str, _One])


class Kept:
    """Results of the cases that have been run, in a file that is written whole after each.

    Args:
        path: of the file; an earlier run's cases stay in it if this one goes on with it.
        pictures: folder of the cases' pictures.
        asked: what was asked for and what computes it, in words: results of anything else are not taken over.
        goes_on: find what the same program has found before.

    Raises:
        ValueError: the file is there and cannot be read.
    """

    def __init__(self, path: Path, pictures: Path, *, asked: str, goes_on: bool) -> None:
        self._path, self._pictures, self._goes_on = path, pictures, goes_on
        self._cases: dict[str, _One] = {}
        self._asked = hashlib.sha256(asked.encode())
        for name, file in scenario_files().items():
            self._asked.update(name.encode() + file.read_bytes())
        if goes_on and path.exists():
            try:
                self._cases = _FILE.validate_json(path.read_bytes())
            except ValidationError as error:
                problem = error.errors()[0]["msg"]
                raise ValueError(f"{path} cannot be read: {problem}; without --resume it is replaced.") from None

    def found(self, case: Case) -> Result | None:
        """What came of a case before, without its curves; None where it must be run."""
        one = self._cases.get(case.name) if self._goes_on else None
        if one is None or one.key != self._key(case):
            return None
        if not all((self._pictures / file).exists() for _, file in one.pictures):
            return None
        outcome = Outcome(checks=one.checks, points=one.points, tables=one.tables, remarks=one.remarks)
        return Result(case, outcome, one.seconds, one.pictures)

    def keep(self, result: Result) -> None:
        """Add a case to the file.

        Raises:
            UnwrittenError: the file cannot be written.
        """
        outcome = result.outcome
        self._cases[result.case.name] = _One(
            self._key(result.case),
            result.seconds,
            outcome.checks,
            outcome.points,
            outcome.tables,
            outcome.remarks,
            result.pictures,
        )
        plain = {name: dataclasses.asdict(one) for name, one in self._cases.items()}
        write_whole(self._path, json.dumps(plain, indent=1, default=float) + "\n")

    def _key(self, case: Case) -> str:
        key = self._asked.copy()
        modules = imported_by(case.module or case.run.__module__)
        key.update(code_digest(sorted(name for name in modules if name.startswith(("warp_mpm", "analytic")))).encode())
        return key.hexdigest()[:16]
