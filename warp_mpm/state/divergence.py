"""A run that left the range of sense, and the sentence that says so."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..effects import Effects
from ..kernels import layout as at
from ..scenario import Numerics, Scenario

NAMES = {
    "velocity": "the velocity",
    "stress": "the effective stress",
    "liquid_strain": "the pore pressure",
    "volume": "the volume",
    "position": "the position",
}
"""Arrays of the material points in which a divergence shows, by what they are called in a sentence."""


class SimulationDiverged(RuntimeError):  # noqa: N818 - a state of the run, not a mistake of the caller
    """The run left the range of sense; the message says when and what to try."""


def diverging(effects: Effects) -> dict[str, str]:
    """Arrays of the material points in which a divergence shows, those of the law and of the scheme last."""
    return NAMES | {name: field.meaning for name, field in effects.point_fields.items() if field.meaning}


def what_is_no_number(name: str, value: float, *, time: float, steps: int, scenario: Scenario) -> str:
    """When, which quantity of a sample, and what to look at.

    Args:
        name: of the quantity, as in the time series.
        value: infinite or no number.
        time: simulated time [s].
        steps: time steps so far.
        scenario: what is run.
    """
    moduli = ["young_modulus_Pa", "liquid_bulk_modulus_Pa"]
    material = scenario.flow.material
    stiffness = " and ".join(
        f"flow.material.{field} = {getattr(material, field):g}" for field in moduli if hasattr(material, field)
    )
    return (
        f"The run diverged at t = {time:.6g} s (step {steps}): {name} is {value:g}. Look at {stiffness}, beside the "
        "pressures that the flow's weight and speed make."
    )


def what_diverged(
    arrays: Mapping[str, NDArray[np.floating]],
    names: Mapping[str, str],
    *,
    time: float,
    steps: int,
    barrier_velocity: float,
    numerics: Numerics,
) -> str:
    """When, which quantity, where, and what to try.

    Args:
        arrays: those of the material points in `names` that the scene has, N rows each.
        names: what they are called in a sentence, from `diverging`.
        time: simulated time [s].
        steps: time steps so far.
        barrier_velocity: [m/s].
        numerics: the settings that could be changed.
    """
    found, place = "", None
    for name, values in arrays.items():
        bad = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        if bad.any():
            known = arrays["position"][bad & np.isfinite(arrays["position"]).all(axis=1)]
            found = f"{names[name]} of {bad.sum()} of {len(values)} material points is not a finite number"
            place = known[0] if len(known) else None
            break
    if not found:
        speed = np.abs(arrays["velocity"]).max(axis=1)
        fastest = int(speed.argmax())
        found = f"the speed of a material point passed {at.FASTEST:g} m/s"
        place = arrays["position"][fastest]
        if speed[fastest] < 0.1 * at.FASTEST:
            found, place = f"the barrier's velocity is {barrier_velocity:g} m/s", None
    where = "" if place is None else f", near x = {place[0]:.3g} m, y = {place[1]:.3g} m"
    return (
        f"The run diverged at t = {time:.6g} s (step {steps}): {found}{where}. Try a smaller "
        f"numerics.courant_number (now {numerics.courant_number:g}) or a finer numerics.spacing_m "
        f"(now {numerics.spacing_m:g})."
    )
