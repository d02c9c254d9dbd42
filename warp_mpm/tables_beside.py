"""Tables that a scenario file names: they lie beside it, and are seen from its folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

FIELDS = (("ground", "profile_csv"), ("flow", "inflow", "hydrograph_csv"))
"""Where a scenario names one."""


def tables_beside(data: Any, folder: Path) -> list[Path]:
    """The tables that a scenario's content names, of a scenario file in `folder`."""
    return [folder / group[name] for group, name in _named(data)]


def with_tables_beside(data: Any, folder: Path) -> Any:
    """A scenario's content in which its tables, named relative to its `folder`, are found from everywhere."""
    for path in FIELDS:
        data = _found(data, path, folder)
    return data


def _found(data: Any, path: tuple[str, ...], folder: Path) -> Any:
    name, *rest = path
    if not isinstance(data, dict) or name not in data:
        return data
    if rest:
        return data | {name: _found(data[name], tuple(rest), folder)}
    return data | {name: str(folder / data[name])} if isinstance(data[name], str) else data


def _named(data: Any) -> Iterator[tuple[dict[str, Any], str]]:
    """Group and name of each field that names a table."""
    for *groups, name in FIELDS:
        group = data
        for part in groups:
            group = group.get(part) if isinstance(group, dict) else None
        if isinstance(group, dict) and isinstance(group.get(name), str):
            yield group, name
