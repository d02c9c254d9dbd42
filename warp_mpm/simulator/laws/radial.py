"""What laws with a bound on the shear stress share: mean and shear apart, and a way back along the shear stress."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from .law import Array

TINY = 1e-30
"""Stress [Pa] or rate [1/s] that is none: keeps 0 / 0 away, in single precision too."""


def make_radial(types: SimpleNamespace) -> SimpleNamespace:
    """Build the functions `parted(stress)`, the mean [Pa, tension positive] and the shear stress τ = √(s : s / 2) [Pa],
    and `joined(stress, old_mean, mean, share)`, a stress of another mean and a share of the shear."""
    import warp as wp

    F, V4 = types.scalar, types.V4

    @wp.func
    def parted(stress: V4):
        mean = (stress[0] + stress[1] + stress[2]) * F(wp.static(1.0 / 3.0))
        xx = stress[0] - mean
        yy = stress[1] - mean
        zz = stress[2] - mean
        return mean, wp.sqrt(F(0.5) * (xx * xx + yy * yy + zz * zz) + stress[3] * stress[3])

    @wp.func
    def joined(stress: V4, old_mean: F, mean: F, share: F) -> V4:
        return V4(
            mean + share * (stress[0] - old_mean),
            mean + share * (stress[1] - old_mean),
            mean + share * (stress[2] - old_mean),
            share * stress[3],
        )

    return SimpleNamespace(parted=parted, joined=joined)


def mean_and_shear(stress: Array) -> tuple[Array, Array]:
    """The same of stresses [N, 4] (xx, yy, zz, xy), in NumPy."""
    xx, yy, zz, xy = stress.T
    mean = (xx + yy + zz) / 3.0
    return mean, np.sqrt(0.5 * ((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2) + xy**2)


def lateral_range(vertical: float, strength: float, friction: float) -> tuple[float, float]:
    """Least and greatest horizontal over vertical effective stress at rest where τ ≤ strength + friction p.

    Both horizontal stresses are alike, so that p = (1 + 2 K) σ_v / 3 and τ = |1 - K| σ_v / √3.

    Args:
        vertical: σ_v, compression positive, at least 0 [Pa].
        strength: shear stress that is borne without pressure [Pa].
        friction: shear stress over mean pressure [-].
    """
    if vertical == 0.0:
        return 0.0, float("inf")
    borne, root = strength / vertical, 1.0 / np.sqrt(3.0)
    least = (root - borne - friction / 3.0) / (root + 2.0 / 3.0 * friction)
    room = root - 2.0 / 3.0 * friction
    most = (root + borne + friction / 3.0) / room if room > 0.0 else float("inf")
    return max(float(least), 0.0), float(most)


def slow_stress(viscosity: float, material: Any, name: str) -> list[str]:
    """A remark where the viscous stress takes longer to build up than an impact to pass."""
    delay = viscosity / material.shear_modulus
    if delay <= LONGEST_DELAY:
        return []
    return [
        f"flow.material.{name} = {viscosity:g}: the viscous stress takes {delay:.2g} s to build up, that over the "
        f"shear modulus of {material.shear_modulus:.3g} Pa; below it the flow is elastic."
    ]


LONGEST_DELAY = 0.1
"""Time [s] that a viscous stress may take to build up: a fraction of an impact's."""
