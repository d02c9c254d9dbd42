"""What "stable" means: every demand on a hard case, with its limit and its reason, in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warp_mpm.scenario import Prescribed, Scenario
from warp_mpm.time_step import step_limits


@dataclass(frozen=True)
class Criterion:
    """One figure that a hard case must keep below a limit."""

    figure: str
    """Key in `Measured.figures`."""
    limit: float
    single_precision_limit: float
    meaning: str
    """What the figure is, and where its limit comes from."""

    def limit_for(self, scenario: Scenario) -> float:
        """Limit for the precision in which `scenario` is computed."""
        return self.limit if scenario.numerics.precision == "float64" else self.single_precision_limit


CRITERIA = (
    Criterion(
        "diverged", 0.0, 0.0, "1 where the run ended early because a quantity was no longer a number or in range"
    ),
    Criterion(
        "mass_error",
        1e-12,
        1e-6,
        "greatest change of each phase's mass, inside and departed together, over its start; rounding of the sum",
    ),
    Criterion(
        "momentum_error",
        1e-9,
        1e-3,
        "greatest momentum that no recorded impulse explains, over the greatest of the flow's momentum and the impulse "
        "of its weight; rounding summed over all steps",
    ),
    Criterion(
        "energy_error",
        0.01,
        0.01,
        "greatest energy above what was put in (start, gravity, a driven barrier), over the energy put in; plastic "
        "flow, drag, friction and the transfer only take energy away",
    ),
    Criterion(
        "speed_ratio",
        1.0,
        1.0,
        "greatest speed over sqrt(3 u² + 2 c u): energy gives a point u = sqrt(v0² + 2 g H) + v_b at most (H the "
        "height it can fall, v_b the speed of a driven barrier), wave theory the pressure rho (c + u) u when it is "
        "stopped, and Bernoulli the jet that this pressure drives",
    ),
    Criterion(
        "pressure_ratio",
        1.0,
        1.0,
        "greatest pore pressure over rho c v + rho v² + rho g h: water hammer (c with the phases moving together) and "
        "stagnation of the fastest point, and rest",
    ),
    Criterion(
        "penetration",
        0.5,
        0.5,
        "deepest material point inside the barrier, the ground or a wall, in cells; the grid resolves a surface to "
        "half a cell",
    ),
    Criterion("porosity_low", 0.0, 0.0, "least porosity, below zero: -min(n), so 0 at most"),
    Criterion("porosity_high", 1.0, 1.0, "greatest porosity of any material point"),
    Criterion(
        "yield_excess",
        1e-9,
        1e-4,
        "greatest distance of a stress outside Mohr-Coulomb and the cut-off, over the greatest stress; rounding",
    ),
    Criterion(
        "pressure_noise",
        0.5,
        0.5,
        "median over the snapshots of the rms difference between a point's pressure and the mean of its cell, over the "
        "rms pressure or rho g h, whichever is greater; at half the signal, the noise would hide it",
    ),
    Criterion(
        "halving_peak_force",
        0.05,
        0.05,
        "change of the filtered peak force when the time step is halved, over that force or a tenth of rho v² h",
    ),
    Criterion(
        "halving_displacement",
        0.05,
        0.05,
        "change of the barrier's final displacement when the time step is halved, over that or a cell",
    ),
)
"""All demands. One that does not apply to a scene (no barrier, dry) has no figure and is passed over."""


def speed_bound(scenario: Scenario) -> float:
    """Greatest speed [m/s] that energy and wave theory allow a material point: see `CRITERIA`."""
    outline = scenario.flow.polygon
    gx, gy = scenario.gravity.vector
    lowest = 0.0 if scenario.ground is not None else scenario.domain.bottom_m
    span = outline[:, 1].max() - (lowest if lowest is not None else outline[:, 1].min())
    time = scenario.output.end_time_s
    downhill = abs(gx) * (scenario.flow.speed * time + 0.5 * abs(gx) * time**2)
    speed = math.sqrt(scenario.flow.speed**2 + 2.0 * (abs(gy) * span + downhill))
    if scenario.barrier is not None and isinstance(scenario.barrier.motion, Prescribed):
        speed += max(abs(velocity) for velocity in scenario.barrier.motion.velocities_m_per_s)
    return math.sqrt(3.0 * speed**2 + 2.0 * step_limits(scenario).sound_speed * speed)
