"""A flow at rest against a face of any angle: nothing may happen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, at_most, holds, reference, reported
from warp_mpm.validation.scenes import INVISCID, LIQUID_DENSITY, box, fixed, sampled, scene

G = 9.81
DEPTH, LENGTH = 3.0, 9.0
"""Of the pool, in front of the face's toe [m]."""

SPEED_UNIT = math.sqrt(G * DEPTH)


def pool(angle: float, spacing: float, end_time: float, formulation: str, soil: dict[str, Any]) -> Scenario:
    """A pool at rest between a wall and a smooth fixed face of `angle` [degrees]."""
    if angle == 90.0:
        shape: dict[str, Any] = {"kind": "wall"}
        outline = box(-LENGTH, 0.0, DEPTH)
    else:
        shape = {"kind": "trapezoid", "height_m": 2.0 * DEPTH, "crest_width_m": 2.0, "face_angle_deg": angle}
        outline = [[-LENGTH, 0.0], [0.0, 0.0], [_overhang(angle), DEPTH], [-LENGTH, DEPTH]]
    return scene(
        f"pool at rest against {angle:g}°",
        outline,
        formulation,
        end_time=end_time,
        soil=soil,
        barrier=fixed(shape),
        spacing_m=spacing,
        domain={"left_edge": "wall", "left_m": -LENGTH, "top_m": 3.0 * DEPTH},
    )


def _overhang(angle: float) -> float:
    """Horizontal length of the wetted face [m]."""
    return DEPTH / math.tan(math.radians(angle)) if angle < 90.0 else 0.0


@dataclass(frozen=True)
class Rest:
    """What a pool did that should have done nothing."""

    times: Array
    speed: Array
    """Of the fastest point over √(g h)."""
    gain: float
    """Greatest rise of the total energy over any state before, over weight times depth."""
    thrust: Array
    """Error of the mean thrust of each interval in x and y, over the horizontal one [times, 2]."""
    pressure: Array
    """Greatest pore pressure over ρ_L g h."""


def rest(angle: float, spacing: float, end_time: float, formulation: str, soil: dict[str, Any]) -> Rest:
    """The pool of `pool`, sampled four times a second."""
    scenario = pool(angle, spacing, end_time, formulation, soil)
    simulation = Simulation(scenario)
    points = simulation.points()
    weight = G * float(sum(points[name].sum() for name in ("solid_mass", "liquid_mass")))
    start = simulation.sample()
    times = 0.25 * np.arange(1.0, round(4.0 * end_time) + 1.0, dtype=np.float64)
    series = sampled(simulation, times)
    parts = ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy", "left_energy")
    energy = np.concatenate([[sum(start[part] for part in parts)], sum(series[part] for part in parts)])
    exact = 0.5 * scenario.flow.material.density * G * DEPTH**2
    return Rest(
        times=times,
        speed=series["speed_max"] / SPEED_UNIT,
        gain=float((energy - np.minimum.accumulate(energy)).max()) / (weight * DEPTH),
        thrust=np.stack(
            [series["impact_force_x"] / exact - 1.0, series["impact_force_y"] / exact + _overhang(angle) / DEPTH],
            axis=1,
        ),
        pressure=series["pore_pressure_max"] / (LIQUID_DENSITY * G * DEPTH),
    )


# -- reserve against sliding -------------------------------------------------------------------------------------


def creep(spacing: float, end_time: float, reserve: float = 1.1) -> float:
    """Displacement [m] of a barrier with a face of 60° whose base can bear `reserve` times what the pool of the paper's
    soil, at rest before it, asks of it.

    The barrier is held first, to take the mean thrust of 0.2 s.
    """
    held = pool(60.0, spacing, end_time, "two_phase", {})
    thrusts = sampled(Simulation(held), np.arange(1, 21) * 0.01)
    thrust, load = float(thrusts["impact_force_x"].mean()), -float(thrusts["impact_force_y"].mean())
    friction = 0.5
    fields = held.resolved()
    fields["barrier"]["motion"] = {
        "kind": "sliding",
        "mass_kg_per_m": (reserve * thrust / friction - load) / G,
        "base_friction": friction,
    }
    simulation = Simulation(Scenario.model_validate(fields))
    simulation.advance(end_time)
    return float(simulation.barrier_displacement or 0.0)


# -- the case ----------------------------------------------------------------------------------------------------

MOVED_ON = (
    "the start is in balance, but points that have moved integrate the stress of cut cells no longer exactly, and what "
    "they miss moves them on: from next to nothing the speed along the face grows e-fold in 1.5 s at 0.125 m"
)

NO_EQUILIBRIUM = (
    "the lateral stress at rest with which the scene begins is no equilibrium at a smooth inclined face; the water "
    "takes up what the skeleton must give up, and drains. With a lateral stress coefficient of one it is 1.01"
)


def at_rest(quick: bool) -> Outcome:
    angles = (45.0,) if quick else (30.0, 45.0, 60.0, 75.0, 90.0)
    spacing = 0.5 if quick else 0.25
    end = 2.0 if quick else 6.0
    checks: list[Check] = []
    speeds: list[Curve] = []
    for angle in angles:
        found = rest(angle, spacing, end, "undrained", INVISCID)
        name = f"fluid, {angle:g}°, {spacing:g} m"
        checks += [
            at_most(f"{name}: greatest speed", "of √(g h)", float(found.speed.max()), 0.01),
            at_most(f"{name}: greatest rise of the total energy", "of weight times depth", found.gain, 5e-5),
            at_most(
                f"{name}: thrust in x, greatest error", "-", float(np.abs(found.thrust[:, 0]).max()), 0.01, percent=True
            ),
        ]
        if angle < 90.0:
            checks.append(
                at_most(
                    f"{name}: thrust in y, greatest error over that in x",
                    "-",
                    float(np.abs(found.thrust[:, 1]).max()),
                    0.01,
                    percent=True,
                )
            )
        speeds.append(Curve(found.times, 100.0 * found.speed, f"{angle:g}°"))
    if not quick:
        ladder = (0.5, 0.25, 0.125)
        fastest = [float(rest(45.0, step, end, "undrained", INVISCID).speed.max()) for step in ladder]
        checks.append(
            holds(
                "fluid, 45°: greatest speed falls with the spacing, 0.5 to 0.125 m",
                "of √(g h)",
                fastest[-1],
                fastest[-1] < fastest[0],
                reference=" → ".join(f"{value:.2g}" for value in fastest),
                remark=MOVED_ON,
            )
        )
    soil_end = 2.0 if quick else 10.0
    pressures: list[Curve] = []
    for step in (0.4,) if quick else (0.4, 0.2):
        found = rest(60.0, step, soil_end, "two_phase", {})
        name = f"soil, 60°, {step:g} m"
        checks += [
            at_most(
                f"{name}: p_L,max over ρ_L g h, after {soil_end:g} s",
                "-",
                float(found.pressure[-1]),
                1.1,
                reference="1",
            ),
            reported(
                f"{name}: p_L,max over ρ_L g h, greatest",
                "-",
                float(found.pressure.max()),
                remark=NO_EQUILIBRIUM,
            ),
            at_most(f"{name}: greatest rise of the total energy", "of weight times depth", found.gain, 5e-5),
            reported(f"{name}: greatest speed", "of √(g h)", float(found.speed.max())),
        ]
        pressures.append(Curve(found.times, found.pressure, f"{step:g} m"))
        if not quick:
            slid = creep(step, soil_end)
            checks.append(at_most(f"barrier with a reserve of 10 %, soil, 60°, {step:g} m: slides", "m", slid, 0.0))
    return Outcome(
        checks=checks,
        panels=[
            Panel(f"perfect fluid at rest, {spacing:g} m: fastest point", "time [s]", "speed / √(g h) [%]", speeds),
            Panel(
                "the paper's soil at rest against 60°",
                "time [s]",
                "p_L,max / (ρ_L g h)",
                [reference([0.0, soil_end], [1.0, 1.0], "hydrostatic"), *pressures],
            ),
        ],
    )


CASES = (
    Case(
        name="at-rest",
        title="Flow at rest against a face",
        tests="A pool, 3 m deep, lies at rest between a wall and a smooth face of 30° to 90°: a perfect fluid for 6 s, "
        "the paper's two-phase soil for 10 s; and the soil before a barrier whose base can bear 10 % more "
        "than it must.",
        source="nothing happens: no motion, no energy, thrust ½ ρ g h² in x and ½ ρ g h²/tan θ in y, p_L = ρ_L g h at "
        "the base",
        limit="speed 1 % of √(g h), falling with the spacing; rise of energy 5e-5 of weight times depth (that of this "
        "speed); thrust 1 %; p_L,max 1.1; the barrier sticks",
        run=at_rest,
    ),
)
