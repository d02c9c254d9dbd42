"""The scenes that come with the program: the folder `scenarios/` of a checkout, its copy in an installed wheel."""

from __future__ import annotations

import difflib
from pathlib import Path

_PACKAGE = Path(__file__).parent
_PACKED = _PACKAGE / "scenarios"

SCENARIOS = _PACKED if _PACKED.is_dir() else _PACKAGE.parent / "scenarios"
"""Folder of the paper's scenes; `hard/` and `sweeps/` in it hold the hard cases and the sweeps."""


def scenario_files() -> dict[str, Path]:
    """The files by their names, as commands are given them under `scenarios/`: `case_1`, `hard/speed_50`, ..."""
    files = [*sorted(SCENARIOS.glob("*.json")), *sorted(SCENARIOS.glob("*/*.json"))]
    return {file.relative_to(SCENARIOS).with_suffix("").as_posix(): file for file in files}


def where_to_get(missing: Path) -> str:
    """A sentence on how to come by a file that is missing: one of that name or nearly lies near, or comes with the
    program; or nothing."""
    if missing.exists():
        return ""
    near = [*missing.parent.glob("*.json"), *(missing.parent / "scenarios").glob("*.json")]
    # Of a name without its ending, in other letters, or mistyped.
    stem = missing.name.removesuffix(".json").lower()
    for files, answer in ((near, _MEANT), (scenario_files().values(), _SHIPPED)):
        names = {file.stem.lower(): file for file in files}
        for close in difflib.get_close_matches(stem, names, n=1, cutoff=0.8):
            return answer.format(name=names[close].name, path=names[close])
    return ""


_MEANT = " Did you mean {path}?"
_SHIPPED = " {name} comes with the program: python -m warp_mpm scenarios --out scenarios copies it here."
