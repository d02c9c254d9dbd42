"""What a sample of the time series tells, from the sums that the kernels keep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..effects import Effects
from ..kernels import layout as at
from ..simulator.bodies import Body, Sliding

OF_THE_LEDGER = frozenset(
    ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy", "speed_max",
     "solid_mass", "liquid_mass", "pore_pressure_max", "pore_pressure_max_anywhere", "momentum_x", "momentum_y",
     "momentum_residual_x", "momentum_residual_y")
)  # fmt: skip
"""Quantities that need sums over all material points."""


@dataclass(frozen=True)
class Window:
    """Sums since t = 0 at some time: forces since then are differences to them."""

    time: float
    """[s]."""
    reactions: list[float]
    """Impulse of the flow on each surface along x and y, one after the other [N s/m]."""
    base_impulse: float = 0.0
    """Of friction at the barrier's base [N s/m]."""


@dataclass(frozen=True)
class Constants:
    """What samples need to know of a scene."""

    effects: Effects
    bodies: Sequence[Body]
    barrier: int | None
    """Number of the barrier among the bodies."""
    gravity: tuple[float, float]
    """[m/s2]."""


@dataclass(frozen=True)
class BarrierNow:
    """The barrier's motion at the time of a sample."""

    displacement: float = 0.0
    """[m]."""
    velocity: float = 0.0
    """[m/s]."""
    work: float = 0.0
    """Of the flow on it since t = 0 [J/m]."""
    base_work: float = 0.0
    """That friction at its base has taken [J/m]."""


def sample(
    constants: Constants,
    now: Window,
    since: Window,
    *,
    barrier: BarrierNow,
    balance: Sequence[float],
    clock: Sequence[float],
    sums: Sequence[float],
    left: Sequence[float],
    initial_momentum: Sequence[float],
) -> dict[str, float]:
    """Quantities now, and forces as means over a stretch of time (impulse over its length).

    Args:
        constants: of the scene.
        now, since: totals now and at the beginning of that stretch.
        barrier: its motion; of no matter where there is none.
        balance: what gravity gave to the flow.
        clock: for the time step.
        sums: of the ledger.
        left: what has left the domain.
        initial_momentum: of the flow along x and y [N s/m].
    """
    effects, reactions = constants.effects, now.reactions
    elapsed = now.time - since.time
    rate = 1.0 / elapsed if elapsed > 0.0 else 0.0
    forces = [(after - before) * rate for after, before in zip(reactions, since.reactions, strict=True)]
    values = {"time": now.time}
    momentum_x, momentum_y = sums[at.LEDGER_MOMENTUM_X], sums[at.LEDGER_MOMENTUM_Y]
    residual_x = momentum_x - initial_momentum[0] - balance[at.GRAVITY_IMPULSE_X] + left[at.LEFT_MOMENTUM_X]
    residual_y = momentum_y - initial_momentum[1] - balance[at.GRAVITY_IMPULSE_Y] + left[at.LEFT_MOMENTUM_Y]
    residual_x += sum(reactions[0::2])
    residual_y += sum(reactions[1::2])
    number = 0
    for body in constants.bodies:
        for surface in body.surfaces:
            if not body.edge:
                values[f"{surface.name}_force_x"] = forces[2 * number]
                values[f"{surface.name}_force_y"] = forces[2 * number + 1]
            number += 1
    if constants.barrier is not None:
        values |= {
            "barrier_velocity": barrier.velocity,
            "barrier_displacement": barrier.displacement,
            "barrier_work": barrier.work,
        }
        body = constants.bodies[constants.barrier]
        if isinstance(body.motion, Sliding):
            vertical = sum(values[f"{surface.name}_force_y"] for surface in body.surfaces)
            weight = -body.motion.mass * constants.gravity[1]
            values |= {
                "base_force": -(now.base_impulse - since.base_impulse) * rate,
                "base_normal_force": max(weight - vertical, 0.0),
                "base_friction_work": barrier.base_work,
                "barrier_kinetic_energy": 0.5 * body.motion.mass * barrier.velocity**2,
            }
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
        values["seepage_work"] = balance[at.SEEPAGE_WORK]
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
