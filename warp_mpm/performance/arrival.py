"""What it costs that a flow arrives at a section during the run, against the same flow that is there at the start."""

from __future__ import annotations

from typing import Any

from warp_mpm.performance.probe import clock_of
from warp_mpm.performance.table import Progress, Table
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation

DEPTH, LENGTH, SPEED, SECTION = 10.0, 25.0, 20.0, -60.0
"""Of a flow of upright ends [m, m, m/s], and x of the section [m], too far from the barrier to reach it."""

SLICES = 20
"""Parts of the time, in each of which both have their turn."""


def arrival_cost(base: Scenario, *, device: str, progress: Progress, points: int = 100_000) -> Table:
    """Cost of a point and step while about that many points arrive one after the other, and with all of them there.

    What is counted are points in the flow: those that have yet to come must cost nothing. Capturing the steps anew as
    their number grows, and holding points before the section, are part of it.
    """
    progress("a flow that arrives")
    there, arriving = scenes(base, points)
    clock = clock_of(device)
    simulations = {
        "there at the start": Simulation(there, device=device),
        "arriving": Simulation(arriving, device=device),
    }
    end = LENGTH / SPEED
    spent, work = dict.fromkeys(simulations, 0.0), dict.fromkeys(simulations, 0.0)
    for simulation in simulations.values():
        simulation.advance(1e-6 * end)
    for part in range(1, SLICES + 1):
        for name, simulation in simulations.items():
            steps, inside, begin = simulation.steps, _inside(simulation), clock()
            simulation.advance(part / SLICES * end)
            spent[name] += clock() - begin
            work[name] += (simulation.steps - steps) * 0.5 * (inside + _inside(simulation))
    costs = {name: spent[name] / work[name] for name in simulations}
    first = costs["there at the start"]
    rows = [
        (name, f"{simulation.material_points:,}", f"{1e9 * costs[name]:.1f}", f"{costs[name] / first - 1.0:+.1%}")
        for name, simulation in simulations.items()
    ]
    title = f"Cost of a flow that arrives within {end:g} s, two-phase"
    return Table(
        "arrival", title, ("flow", "points at the end", "ns per point in the flow and step", "difference"), rows
    )


def scenes(base: Scenario, points: int) -> tuple[Scenario, Scenario]:
    """The same block of about that many points, there at the start and arriving at the section where it would end."""
    content = base.resolved()
    spacing = (DEPTH * LENGTH * base.numerics.points_per_cell / points) ** 0.5
    content["numerics"]["spacing_m"] = DEPTH / max(round(DEPTH / spacing), 1)
    content["output"]["end_time_s"] = LENGTH / SPEED
    material = {name: content["flow"][name] for name in ("formulation", "material")}
    corners = [[SECTION - LENGTH, 0.0], [SECTION, 0.0], [SECTION, DEPTH], [SECTION - LENGTH, DEPTH]]
    block: dict[str, Any] = {
        "shape": {"kind": "polygon", "vertices_m": corners},
        "velocity_m_per_s": [SPEED, 0.0],
    }
    table: dict[str, Any] = {
        "x_m": SECTION,
        "times_s": [0.0, LENGTH / SPEED],
        "depths_m": [DEPTH, DEPTH],
        "velocity_m_per_s": SPEED,
    }
    flows: list[dict[str, Any]] = [material | block, material | {"inflow": table}]
    there, arriving = (Scenario.model_validate(content | {"flow": flow}) for flow in flows)
    return there, arriving


def _inside(simulation: Simulation) -> int:
    return len(simulation.points(("volume",))["volume"])
