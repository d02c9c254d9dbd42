"""What a barrier is checked against: limits and partial factors of the user. Only what is given is judged."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from warp_mpm.schema import Density, Friction, Length, Model, NonNegative, Positive, Velocity

Factor = Annotated[float, Field(ge=0.1, le=10.0)]


class Boulder(Model):
    """A boulder that hits the face, by the formula of the Hong Kong guideline; it is not simulated."""

    radius_m: Annotated[float, Field(gt=0.0, le=10.0)]
    speed_m_per_s: Velocity | None = None
    """null: the flow's speed at the start."""
    load_factor: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    """K_c, which takes from Hertz's elastic force what yields and breaks."""
    height_m: Length | None = None
    """Of the hit above the base; null: the flow's depth at the start, at most the crest."""
    width_m: Length
    """Length of barrier that bears the hit together: as a load per metre the force is divided by it."""


class Design(Model):
    """Limits and partial factors of a design; a figure without a limit is told and not judged."""

    displacement_m: NonNegative | None = None
    """Greatest sliding distance allowed."""
    sliding_factor: Factor | None = None
    """Least factor of safety against sliding, at any time."""
    overturning_factor: Factor | None = None
    """Least factor of safety against overturning about the heel, at any time."""
    eccentricity_of_base: Annotated[float, Field(gt=0.0, lt=0.5)] | None = None
    """Greatest eccentricity of the base's reaction over the base width; 1/6 keeps the whole base pressed (the kern)."""
    bearing_resistance_Pa: Positive | None = None
    """Greatest pressure on the base that the soil bears."""
    overtopped_share: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    """Greatest share of the flow's volume allowed beyond the crest at the end."""
    overtopped_volume_m3_per_m: NonNegative | None = None
    """The same as a volume."""
    freeboard_m: NonNegative | None = None
    """Least height of the crest above the greatest run-up."""
    load_factor: Factor = 1.0
    """Partial factor on all that the flow does, its weight on the face included (one source), and a boulder."""
    base_friction_factor: Factor = 1.0
    """Partial factor by which tan δ_b is divided."""
    bearing_factor: Factor = 1.0
    """Partial factor by which the bearing resistance is divided."""
    density_kg_per_m3: Density | None = None
    """Of a barrier that is fixed or driven, for its weight; one that slides has its own."""
    base_friction: Friction | None = None
    """tan δ_b of a barrier that is fixed or driven."""
    boulder: Boulder | None = None
    guidelines: Annotated[
        tuple[Literal["hong_kong", "switzerland_fine", "switzerland_granular", "japan", "china"], ...],
        Field(strict=False),
    ] = ()
    """Thrusts by guidelines to set beside the simulation, whose factors are recalled and not read: see
    docs/how_to/design_checks.md."""

    @field_validator("guidelines")
    @classmethod
    def _once(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{name!r} is there twice; each must be there once")
        return names
