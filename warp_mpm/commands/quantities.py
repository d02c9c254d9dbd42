"""`python -m warp_mpm quantities`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.command_line import refusals


def quantities(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            metavar="SCENARIO", help="Scenario file: only the columns that its time series has.", show_default=False
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the table as JSON.")] = False,
) -> None:
    """List what a run records and sums up: name, unit, meaning.

    The columns of timeseries.csv, the arrays of the snapshots, and the key figures of summary.json.
    """
    with refusals():
        from warp_mpm.quantities import NAMED, TIME_SERIES, further_quantities, recorded_quantities
        from warp_mpm.quantities.figures import FIGURES
        from warp_mpm.quantities.points import POINT_FIELDS
        from warp_mpm.scenario import Scenario

        columns = list(NAMED.values())
        if scenario is not None:
            scene = Scenario.load(scenario)
            known = {**TIME_SERIES, **further_quantities(scene)}
            columns = [known[key] for key in recorded_quantities(scene)]
        files: dict[str, list[Any]] = {
            "timeseries.csv": columns,
            "snapshots.vtkhdf": list(POINT_FIELDS.values()),
            "summary.json": list(FIGURES.values()),
        }
    rows = [
        {"file": file, "name": one.name, "unit": one.unit, "meaning": one.meaning}
        for file, listed in files.items()
        for one in listed
    ]
    if as_json:
        typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    width = max(len(one.heading) for listed in files.values() for one in listed)
    for file, listed in files.items():
        typer.echo(f"{file}\n" + "\n".join(f"  {one.heading:{width}}  {one.meaning}" for one in listed) + "\n")
