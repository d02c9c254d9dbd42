"""`python -m warp_mpm plot`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.command_line import refusals
from warp_mpm.commands.options import DEFAULT_TIMES, times_of, times_within


class Kind(StrEnum):
    """What can be drawn."""

    SCENE = "scene"
    HISTORY = "history"
    COMPARISON = "comparison"
    FIELD = "field"
    MECHANISM = "mechanism"
    LOADS = "loads"


SEVERAL = (Kind.COMPARISON, Kind.FIELD, Kind.MECHANISM)
"""Kinds that take more than one run."""


def plot(
    kind: Annotated[
        Kind,
        typer.Argument(
            help="scene: flow and barrier with their measures, also of a scenario file; history: forces, displacement "
            "and energies of a run; comparison: the same of several; field: the flow at several times; mechanism: what "
            "was seen over Fr and H/h; loads: pressure on the face over height and time.",
            show_default=False,
        ),
    ],
    runs: Annotated[list[Path], typer.Argument(metavar="RUN_DIR", help="Run folders.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A png, pdf or svg file.", show_default="KIND.png here")
    ] = None,
    times: Annotated[
        str | None,
        typer.Option(help="Of field: times [s], with commas between.", show_default=DEFAULT_TIMES),
    ] = None,
    field: Annotated[
        str,
        typer.Option(
            help="Of field: pore_pressure, speed, slip, volumetric_strain, mean_effective_stress or deviatoric_strain."
        ),
    ] = "pore_pressure",
) -> None:
    """Draw one figure of a run, or of several."""
    with refusals():
        target = out if out is not None else Path(f"{kind.value}.png")
        wanted = times_of(times)
        from warp_mpm import plotting

        plotting.check_path(target)
        if kind not in SEVERAL and len(runs) > 1:
            raise ValueError(f"plot {kind.value} draws one run, {len(runs)} were given.")
        plotting.save(_figure(kind, runs, wanted, field), target)
        typer.echo(str(target))


def _figure(kind: Kind, paths: list[Path], times: tuple[float, ...] | None, field: str) -> Any:
    from warp_mpm import plotting
    from warp_mpm.results import Results
    from warp_mpm.scenario import Scenario

    if kind is Kind.SCENE:
        return plotting.scene(Results.open(paths[0]).scenario if paths[0].is_dir() else Scenario.load(paths[0]))
    runs = [Results.open(path) for path in paths]
    if kind is Kind.HISTORY:
        return plotting.force_and_displacement(runs[0])
    if kind is Kind.LOADS:
        return plotting.loads_by_height(runs[0])
    if kind is Kind.COMPARISON:
        return plotting.comparison(runs)
    if kind is Kind.MECHANISM:
        return plotting.mechanism_diagram(runs)
    return plotting.field_panels(runs, field, times_within(runs, times))
