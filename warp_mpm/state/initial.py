"""An initial state that a caller gives, in place of the scene's own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..kernels import layout as at
from .on_device import OnDevice

Points = Mapping[str, NDArray[np.float64]]


def check_given(state: Points, now: Points) -> None:
    """
    Raises:
        ValueError: a field is none that can be given, of another shape or not finite.
    """
    allowed = {"solid_velocity", "liquid_velocity", "effective_stress", "pore_pressure"} & set(now)
    for name, values in state.items():
        if name not in allowed:
            raise ValueError(f"set_points knows no {name} in this scene; it can set {', '.join(sorted(allowed))}")
        if np.shape(values) != now[name].shape or not np.isfinite(values).all():
            raise ValueError(f"set_points needs finite {name} of shape {now[name].shape}, not {np.shape(values)}")


def set_points(
    held: OnDevice,
    now: Points,
    *,
    moved: bool,
    liquid_stiffness: NDArray[np.float64],
    gravity: tuple[float, float],
) -> list[float]:
    """Give all points a state, and tell their momentum along the axes [N s/m].

    Args:
        held: where to.
        now: as in `Simulation.points`, of all points.
        moved: their velocities are others than before.
        liquid_stiffness: as in `points.stiffness_of_liquid`.
        gravity: [m/s2].
    """
    effects, clock = held.effects, held.clock["clock"]
    velocity, solid, liquid = now["solid_velocity"], now["solid_mass"], now["liquid_mass"]
    momentum = (solid + liquid) @ velocity
    if effects.two_phase:
        momentum = solid @ velocity + liquid @ now["liquid_velocity"]
        velocity = np.concatenate([velocity, now["liquid_velocity"]], axis=1)
    held.points["velocity"].assign(velocity)
    if moved:
        fit_velocities(held, now["position"], solid + liquid, velocity, len(velocity))
    held.points["stress"].assign(now["effective_stress"])
    if effects.liquid:
        held.points["liquid_strain"].assign(-now["pore_pressure"] / liquid_stiffness)
    entries = clock.numpy()
    entries[at.SPEED_MAX] = (velocity.reshape(-1, effects.dimensions) ** 2).sum(axis=1).max()
    clock.assign(entries)
    if effects.two_phase:
        balance = held.clock["balance"].numpy()
        slip = liquid @ (now["liquid_velocity"] - now["solid_velocity"])
        balance[at.SEEPAGE_POWER_BEFORE] = slip[:2] @ np.array(gravity)
        held.clock["balance"].assign(balance)
    initial_momentum: list[float] = momentum.tolist()
    return initial_momentum


def fit_velocities(
    held: OnDevice,
    position: NDArray[np.float64],
    mass: NDArray[np.float64],
    velocity: NDArray[np.float64],
    there: int,
) -> None:
    """Begin the transfer scheme's own point fields with the velocities [N, ...] of the points [N, 2], of which the
    first `there` are there."""
    parameters, spacing = held.of_materials[0], held.grid.spacing
    places = (position[:there] - [parameters.left, parameters.bottom]) / spacing
    phases = held.types.components // velocity.shape[1]
    given = np.tile(velocity[:there], (1, phases))
    for name, values in held.effects.scheme.fitted(places, spacing, mass[:there], given).items():
        rest = np.zeros((len(velocity) - there, values.shape[1]))
        held.points[name].assign(np.concatenate([values, rest]))
