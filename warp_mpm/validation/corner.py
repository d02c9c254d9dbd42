"""Where a flow is turned at the foot of a wall: what the corner holds, and the pressure in it."""

from __future__ import annotations

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, compared, reference, within
from warp_mpm.validation.paper_runs import paper_scene

SIDE = 0.5
"""Of the squares: in the corner, beside it on the ground and above it at the wall [m]."""

SQUARES = ((-SIDE, 0.0), (-2.0 * SIDE, 0.0), (-SIDE, SIDE))
"""Their lower left corners; the wall is at x = 0 [m]."""

LATE = 1.2, 1.4
"""Time over which means are taken [s]: the flow presses on the wall all over, and nothing has fallen back."""

CROWDS = (
    "points sense the flow's divergence where they are: drawn out into rows, they see what spreads these and nothing "
    "of the gaps between, and so count more room than there is; the density correction comes late, and goes on too long"
)


def corner_squares(spacing: float, points_per_cell: int, times: Array) -> tuple[Array, Array]:
    """Case 5: filling [times, 3], mass over what the square would hold at the flow's density, and mean pore pressure
    [times, 3] [Pa] of the squares in the corner, beside it and above it."""
    scenario = paper_scene("case_5", spacing, numerics__points_per_cell=points_per_cell)
    density = scenario.flow.material.density
    simulation = Simulation(scenario)
    filling, pressure = [], []
    for time in times:
        simulation.advance(float(time))
        points = simulation.points(["position", "solid_mass", "liquid_mass", "pore_pressure"])
        mass = points["solid_mass"] + points["liquid_mass"]
        held = []
        for left, bottom in SQUARES:
            place = points["position"] - (left, bottom)
            held.append(mass * ((place > 0.0) & (place < SIDE)).all(axis=1))
        filling.append([one.sum() / (density * SIDE**2) for one in held])
        pressure.append([one @ points["pore_pressure"] / max(one.sum(), 1e-12) for one in held])
    return np.array(filling), np.array(pressure)


def corner(quick: bool) -> Outcome:
    times = np.linspace(0.0, LATE[1], 71)[1:]
    late = times > LATE[0]
    checks: list[Check] = []
    filled: list[Curve] = [reference(LATE, [1.0, 1.0], "full")]
    pressed: list[Curve] = [reference(LATE, [1.0, 1.0], "as beside it")]
    for spacing, number in ((0.25, 4),) if quick else ((0.25, 4), (0.25, 9), (0.25, 16), (0.125, 4)):
        filling, pressure = corner_squares(spacing, number, times)
        label = f"{spacing:g} m, {number} points a cell"
        mean, load = filling[late].mean(axis=0), pressure[late].mean(axis=0)
        ratio = float(load[0] / load[1:].mean())
        checks += [
            within(f"{label}: filling of the corner", "-", float(mean[0]), 0.9, 1.1, remark=CROWDS),
            compared(f"{label}: pressure in the corner, over that beside it", "-", ratio, 1.0, 0.10, remark=CROWDS),
        ]
        filled.append(Curve(times, filling[:, 0], label))
        arrived = pressure.min(axis=1) > 0.0
        pressed.append(Curve(times[arrived], pressure[arrived, 0] / pressure[arrived, 1:].mean(axis=1), label))
    return Outcome(
        checks=checks,
        panels=[
            Panel("filling of the corner", "time [s]", "mass over room", filled),
            Panel("pressure in the corner", "time [s]", "over that beside it", pressed),
        ],
    )


CASES = (
    Case(
        name="corner",
        title="The corner at the foot of a wall",
        tests="Case 5 from 1.2 to 1.4 s: what a half-metre square in the corner of ground and wall holds, and its pore "
        "pressure over the mean of the squares beside and above it.",
        source="a square holds what there is room for; where the flow stagnates its pressure is smooth",
        limit="filling 0.9 to 1.1, pressure within 10 %",
        run=corner,
    ),
)
