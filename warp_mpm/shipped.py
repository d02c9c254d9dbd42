"""The scenes that come with the program: the folder `scenarios/` of a checkout, its copy in an installed wheel."""

from __future__ import annotations

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
    """A sentence on how to come by a file that is missing, if one of that name comes with the program; or nothing."""
    names = {file.name for file in scenario_files().values()}
    if missing.name not in names:
        return ""
    return " A file of that name comes with the program: python -m warp_mpm scenarios --out scenarios copies it here."
