"""What a sample of the time series tells, from the sums that the kernels keep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..effects import Effects
from ..kernels import layout as at

OF_THE_LEDGER = frozenset(
    ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy", "seepage_work", "speed_max",
     "solid_mass", "liquid_mass", "pore_pressure_max", "pore_pressure_max_anywhere", "momentum_x", "momentum_y",
     "momentum_residual_x", "momentum_residual_y")
)  # fmt: skip
"""Quantities that need sums over all material points."""


@dataclass(frozen=True)
class Totals:
    """Sums since t = 0, of which forces are the differences; entries as in `kernels.layout`."""

    clock: list[float]
    reactions: list[float]
    seepage_power: float = 0.0
    """Rate at which gravity works on liquid that moves relative to the skeleton, at this time [W/m]."""
    seepage_work: float = 0.0
    """That work since t = 0, by the trapezoidal rule over the samples [J/m]."""


@dataclass(frozen=True)
class Constants:
    """What samples need to know of a scene."""

    effects: Effects
    barrier_mass: float | None
    """[kg/m]; None unless the barrier slides."""
    barrier_weight: float | None
    """[N/m]; None unless the barrier slides."""


def sample(
    constants: Constants,
    now: Totals,
    last: Totals,
    *,
    sums: Sequence[float],
    left: Sequence[float],
    initial_momentum: Sequence[float],
) -> dict[str, float]:
    """Quantities now, and forces as means over the time since the last sample (impulse over interval).

    Args:
        constants: of the scene.
        now, last: totals now and at the last sample.
        sums: of the ledger.
        left: what has left the domain.
        initial_momentum: of the flow along x and y [N s/m].
    """
    effects, clock, reactions = constants.effects, now.clock, now.reactions
    elapsed = clock[at.TIME] - last.clock[at.TIME]
    rate = 1.0 / elapsed if elapsed > 0.0 else 0.0
    forces = [(after - before) * rate for after, before in zip(reactions, last.reactions, strict=True)]
    values = {"time": clock[at.TIME]}
    momentum_x, momentum_y = sums[at.LEDGER_MOMENTUM_X], sums[at.LEDGER_MOMENTUM_Y]
    residual_x = momentum_x - initial_momentum[0] - clock[at.GRAVITY_IMPULSE_X] + left[at.LEFT_MOMENTUM_X]
    residual_y = momentum_y - initial_momentum[1] - clock[at.GRAVITY_IMPULSE_Y] + left[at.LEFT_MOMENTUM_Y]
    residual_x += sum(reactions[0::2])
    residual_y += sum(reactions[1::2])
    if effects.barrier != "none":
        values |= {
            "impact_force_x": forces[2 * at.FACE],
            "impact_force_y": forces[2 * at.FACE + 1],
            "top_force_x": forces[2 * at.TOP],
            "top_force_y": forces[2 * at.TOP + 1],
            "back_force_x": forces[2 * at.BACK],
            "back_force_y": forces[2 * at.BACK + 1],
            "barrier_velocity": clock[at.BARRIER_VELOCITY],
            "barrier_displacement": clock[at.GRID_SHIFT],
            "barrier_work": clock[at.BARRIER_WORK],
        }
    if constants.barrier_mass is not None and constants.barrier_weight is not None:
        friction = clock[at.BASE_FRICTION_IMPULSE] - last.clock[at.BASE_FRICTION_IMPULSE]
        vertical = sum(forces[2 * surface + 1] for surface in (at.FACE, at.TOP, at.BACK))
        values |= {
            "base_force": -friction * rate,
            "base_normal_force": max(constants.barrier_weight - vertical, 0.0),
            "base_friction_work": clock[at.BASE_FRICTION_WORK],
            "barrier_kinetic_energy": 0.5 * constants.barrier_mass * clock[at.BARRIER_VELOCITY] ** 2,
        }
    if effects.ground != "none":
        values |= {"ground_force_x": forces[2 * at.GROUND], "ground_force_y": forces[2 * at.GROUND + 1]}
    values |= {
        "flow_kinetic_energy": sums[at.LEDGER_KINETIC],
        "flow_gravitational_energy": sums[at.LEDGER_GRAVITATIONAL],
        "flow_elastic_energy": sums[at.LEDGER_ELASTIC],
        "speed_max": math.sqrt(sums[at.LEDGER_SPEED_MAX]),
        "solid_mass": sums[at.LEDGER_SOLID_MASS],
    }
    if effects.liquid:
        values["pore_pressure_max_anywhere"] = sums[at.LEDGER_PRESSURE_MAX]
        # What loads the barrier: upstream of the crest's end and meant over a cell. Where a jet lands behind it, single
        # points meet the ground at water-hammer pressure.
        values["pore_pressure_max"] = sums[at.LEDGER_PRESSURE_MEAN]
    if effects.two_phase:
        # Liquid is carried at the skeleton's points, so that its own fall through the voids is in no potential energy.
        values["seepage_work"] = last.seepage_work + 0.5 * elapsed * (last.seepage_power + sums[at.LEDGER_SEEPAGE])
        values["liquid_mass"] = sums[at.LEDGER_LIQUID_MASS]
    values |= {
        "momentum_x": momentum_x,
        "momentum_y": momentum_y,
        "momentum_residual_x": residual_x,
        "momentum_residual_y": residual_y,
        "left_mass": left[at.LEFT_SOLID_MASS] + left[at.LEFT_LIQUID_MASS],
        "left_momentum_x": left[at.LEFT_MOMENTUM_X],
        "left_momentum_y": left[at.LEFT_MOMENTUM_Y],
        "left_energy": left[at.LEFT_ENERGY],
        "time_step": clock[at.TIME_STEP],
    }
    return values
