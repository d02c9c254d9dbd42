"""`python -m warp_mpm check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analytic.command_line import BAD_INPUT, complain

if TYPE_CHECKING:
    from warp_mpm.scenario import Barrier, Scenario


def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Scenario files.", show_default=False)],
) -> None:
    """Check scenario files and tell what they describe; nothing is run or written."""
    from warp_mpm.caveats import scene_caveats
    from warp_mpm.scenario import Scenario
    from warp_mpm.scenario_errors import ScenarioError

    failed = False
    for file in files:
        try:
            scenario = Scenario.load(file)
            first, *others = described(scenario)
            notes = [f"Note: {sentence}" for sentence in scene_caveats(scenario)]
            typer.echo("\n  ".join([f"{file}: {first}", *others, *notes]))
        except ScenarioError as error:
            failed = True
            complain(str(error))
    if failed:
        raise typer.Exit(BAD_INPUT)


def described(scenario: Scenario) -> list[str]:
    """A scene in three lines: title; flow and ground; barrier and run."""
    flow, numerics, ground, tilt = scenario.flow, scenario.numerics, scenario.ground, scenario.gravity.tilt_deg
    speed = f"v = {flow.speed:.4g} m/s"
    if scenario.gravity.acceleration_m_per_s2 > 0.0:
        speed += f" (Fr {flow.speed / (scenario.gravity.acceleration_m_per_s2 * flow.depth) ** 0.5:.2f})"
    slope = "no ground" if ground is None else f"slope {tilt:g}°, ground friction {ground.friction:g}"
    material = flow.formulation.replace("_", "-")
    points = flow.volume / numerics.spacing_m**2 * numerics.points_per_cell
    return [
        scenario.title,
        f"{material} flow of {flow.volume:g} m³/m, {flow.volume * flow.material.density:,.0f} kg/m, "
        f"{flow.depth:g} m deep, {speed}; {slope}",
        f"{_barrier(scenario.barrier)}; ends at {scenario.output.end_time_s:g} s; about {points:,.0f} points on a "
        f"{numerics.spacing_m:g} m grid, {numerics.precision}",
    ]


def _barrier(barrier: Barrier | None) -> str:
    from warp_mpm.scenario import Prescribed, Sliding, Trapezoid

    if barrier is None:
        return "no barrier"
    words = "barrier: wall without end"
    if isinstance(barrier.shape, Trapezoid):
        _, _, height = barrier.shape.base_crest_height
        words = f"barrier H = {height:.4g} m, β = {barrier.shape.built_face_angle_deg:.3g}°"
    if isinstance(barrier.motion, Sliding):
        return (
            f"{words}, {barrier.mass:,.0f} kg/m, sliding with tan δ_b = {barrier.motion.base_friction_coefficient:.3g}"
        )
    return f"{words}, {'driven' if isinstance(barrier.motion, Prescribed) else 'fixed'}"
