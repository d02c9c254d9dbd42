"""How the velocity of a flow varies over its depth."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from warp_mpm.schema import Model, Point

Array = NDArray[np.float64]


class VelocityProfile(Model):
    """The fields of a velocity that is not the same at all heights; its mean over the depth is as stated elsewhere."""

    base_velocity_share: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    """Velocity at the flow's underside over the mean over the depth; 1: the same at all heights, 0: it sticks."""
    velocity_exponent: Annotated[float, Field(ge=0.1, le=10.0)] = 1.0
    """m of the velocity s + (1 - s)(1 + m)(y / h)^m over the mean, with that share s at the underside; 1: linear."""
    velocity_profile: Annotated[tuple[Point, ...], Field(strict=False, min_length=2, max_length=1000)] | None = None
    """Heights over the depth, from 0 to 1, and velocities there, linear between, in place of share and exponent. Only
    what the velocities are to one another counts: they are divided by their mean over the depth."""

    @model_validator(mode="after")
    def _profile(self) -> Self:
        if self.velocity_profile is None:
            return self
        if (self.base_velocity_share, self.velocity_exponent) != (1.0, 1.0):
            raise ValueError(
                "velocity_profile is not allowed with base_velocity_share or velocity_exponent; give the one or the "
                "others"
            )
        heights, velocities = np.array(self.velocity_profile).T
        if heights[0] != 0.0 or heights[-1] != 1.0 or not (np.diff(heights) > 0.0).all():
            raise ValueError(
                f"velocity_profile has the heights {', '.join(f'{height:g}' for height in heights[:6])}"
                f"{', ...' if len(heights) > 6 else ''}; they must increase from 0 to 1"
            )
        if velocities.min() < 0.0 or not velocities.max() > 0.0:
            wrong = int(np.argmin(velocities))
            raise ValueError(
                f"velocity_profile[{wrong}] has the velocity {velocities[wrong]:g}; velocities must be at least 0, and "
                "not all 0"
            )
        return self

    @property
    def sheared(self) -> bool:
        """Whether the velocity varies over the depth."""
        return self.velocity_profile is not None or self.base_velocity_share != 1.0

    def paces(self, height: Array) -> Array:
        """Velocity over its mean over the depth, at heights [N] over the depth."""
        if self.velocity_profile is not None:
            heights, velocities = np.array(self.velocity_profile).T
            return np.interp(height, heights, velocities / np.trapezoid(velocities, heights))
        s, m = self.base_velocity_share, self.velocity_exponent
        return s + (1.0 - s) * (1.0 + m) * height**m

    @property
    def greatest_pace(self) -> float:
        """The greatest of them."""
        if self.velocity_profile is not None:
            return float(self.paces(np.array(self.velocity_profile)[:, 0]).max())
        return float(self.paces(np.array([1.0]))[0])
