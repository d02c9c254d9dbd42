"""The barrier: its shape, how it moves, and its friction against the flow."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from warp_mpm import geometry
from warp_mpm.schema import Coordinate, Density, Friction, Length, Model, Point, Positive, Series, Velocity

BASE_STRENGTH_RATIO = 0.8
"""Share of the base soil's tan φ that resists sliding at the barrier's base (paper, §2.2)."""


class Trapezoid(Model):
    """Symmetric embankment. Three of its four measures fix it; the fourth follows.

    Given all four, the two widths and the height build it and the stated angle must agree to 1°, because tables of
    such barriers are rounded: the paper's case 1 states 60° where its widths and height make 59.7°.
    """

    kind: Literal["trapezoid"]
    base_width_m: Length | None = None
    """Greater base B, on the ground."""
    crest_width_m: Annotated[float, Field(ge=0.0, le=1e6)] | None = None
    """Smaller base b, at the top."""
    height_m: Length | None = None
    """Height H."""
    face_angle_deg: Annotated[float, Field(gt=0.0, le=90.0)] | None = None
    """Angle β between the impacted face and the base."""

    @model_validator(mode="after")
    def _closed(self) -> Self:
        measures = (self.base_width_m, self.crest_width_m, self.height_m, self.face_angle_deg)
        if sum(measure is None for measure in measures) > 1:
            raise ValueError("needs at least three of base_width_m, crest_width_m, height_m and face_angle_deg")
        base, crest, height = self.base_crest_height
        if not (0.0 <= crest <= base and base > 0.0 and height > 0.0):
            raise ValueError(
                f"base_width_m = {base:g}, crest_width_m = {crest:g} and height_m = {height:g} make no barrier; "
                "the crest must be from 0 to as wide as the base, base and height greater than 0"
            )
        if self.face_angle_deg is not None and abs(self.built_face_angle_deg - self.face_angle_deg) > 1.0:
            raise ValueError(
                f"face_angle_deg = {self.face_angle_deg:g} must agree to 1° with the angle that base_width_m, "
                f"crest_width_m and height_m make, {self.built_face_angle_deg:.2f}; or leave one of the four out"
            )
        return self

    @property
    def crest_end(self) -> float:
        """Way from the toe to the downstream end of the crest [m]."""
        return float(self.polygon[2, 0])

    @property
    def base_crest_height(self) -> tuple[float, float, float]:
        """B, b, H [m], the missing one from B - b = 2 H / tan β."""
        base, crest, height = self.base_width_m, self.crest_width_m, self.height_m
        if base is not None and crest is not None and height is not None:
            return base, crest, height
        assert self.face_angle_deg is not None
        # At 90° the cotangent is 0, not the 6e-17 of the floating-point tangent.
        cotangent = 0.0 if self.face_angle_deg == 90.0 else 1.0 / math.tan(math.radians(self.face_angle_deg))
        if height is None:
            assert base is not None
            assert crest is not None
            return base, crest, (base - crest) / (2.0 * cotangent) if cotangent > 0.0 else 0.0
        if base is None:
            assert crest is not None
            return crest + 2.0 * height * cotangent, crest, height
        return base, base - 2.0 * height * cotangent, height

    @property
    def built_face_angle_deg(self) -> float:
        """Angle β [°] of the face as built from B, b and H."""
        base, crest, height = self.base_crest_height
        return math.degrees(math.atan2(height, 0.5 * (base - crest)))

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [4, 2] in metres at t = 0: toe, upstream crest, downstream crest, heel."""
        return geometry.trapezoid(*self.base_crest_height)

    @property
    def outline(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres from the toe over the crest to the heel."""
        return self.polygon

    @property
    def crest_corners(self) -> tuple[int, int]:
        """Where in the outline the crest begins and ends."""
        return 1, 2


class OutlineShape(Trapezoid):
    """Any outline: unsymmetric, stepped, curved, with a lip at its crest. Its base joins the heel to the toe; what is
    hollow beneath counts as filled.

    The crest is what lies between the first and the last of the highest vertices; the face comes before, the back after
    it. Heights are measured above the toe. To whoever asks for toe, crest and heel alone it is a trapezoid.
    """

    kind: Literal["outline"]  # type: ignore[assignment]
    base_width_m: ClassVar[None] = None  # type: ignore[misc]
    crest_width_m: ClassVar[None] = None  # type: ignore[misc]
    height_m: ClassVar[None] = None  # type: ignore[misc]
    face_angle_deg: ClassVar[None] = None  # type: ignore[misc]
    vertices_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=3, max_length=500)]
    """Corners [x, y] from the toe, [0, 0], over the crest to the heel, which lies on the ground or below it."""

    @model_validator(mode="after")
    def _closed(self) -> Self:
        corners = self.outline
        if corners[0].any():
            raise ValueError(
                f"vertices_m begin at [{corners[0, 0]:g}, {corners[0, 1]:g}]; they must begin at the toe, [0, 0]"
            )
        crossing = geometry.crossing_edges(corners)
        if crossing is not None:
            raise ValueError(
                f"vertices_m must not cross or touch themselves; the side after corner {crossing[0] + 1} meets "
                f"the side after corner {crossing[1] + 1}"
            )
        base, _, height = self.base_crest_height
        if not (geometry.signed_area(corners) < 0.0 and base > 0.0 and height > 0.0):
            raise ValueError("vertices_m must go from the toe over the crest to a heel downstream and enclose an area")
        return self

    @property
    def outline(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres from the toe over the crest to the heel."""
        return np.array(self.vertices_m)

    @property
    def crest_corners(self) -> tuple[int, int]:
        """Where in the outline the crest begins and ends; the same vertex where it has no width."""
        y = self.outline[:, 1]
        highest = np.flatnonzero(y >= y.max() * (1.0 - 1e-9))
        return int(highest[0]), int(highest[-1])

    @property
    def polygon(self) -> geometry.Polygon:
        """Toe, upstream crest, downstream crest, heel [4, 2] in metres, as of a trapezoid; what lies between is in
        `outline`."""
        first, last = self.crest_corners
        return self.outline[[0, first, last, -1]]

    @property
    def base_crest_height(self) -> tuple[float, float, float]:
        """Widths of base and crest, and height of the crest above the toe [m]."""
        _, first, last, heel = self.polygon
        return float(heel[0]), float(last[0] - first[0]), float(first[1])

    @property
    def built_face_angle_deg(self) -> float:
        """Angle [°] of the straight line from the toe to the upstream end of the crest."""
        return math.degrees(math.atan2(self.polygon[1, 1], self.polygon[1, 0]))


class Wall(Model):
    """A vertical wall without end: the face is x = 0 at all heights above the ground, or at all where there is no
    ground; all of x > 0 is solid."""

    kind: Literal["wall"]


class Fixed(Model):
    """The barrier does not move."""

    kind: Literal["fixed"]


class Sliding(Model):
    """The barrier slides on its base with Coulomb friction, to either side, and sticks when it comes to rest. On level
    ground the flow pushes it downstream; on a slope its own weight pulls too, upstream where the ground falls that
    way."""

    kind: Literal["sliding"]
    density_kg_per_m3: Density | None = None
    """Density of the barrier; or give its mass."""
    mass_kg_per_m: Positive | None = None
    """Mass m_2 per metre of width; or give its density."""
    base_friction: Friction | None = None
    """Friction coefficient tan δ_b at the base; or give the base soil's friction angle."""
    base_soil_friction_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] | None = None
    """Friction angle of the soil under the barrier, of whose tangent 80 % resist (paper, §2.2)."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if (self.density_kg_per_m3 is None) == (self.mass_kg_per_m is None):
            raise ValueError("needs exactly one of density_kg_per_m3 and mass_kg_per_m")
        if (self.base_friction is None) == (self.base_soil_friction_angle_deg is None):
            raise ValueError("needs exactly one of base_friction and base_soil_friction_angle_deg")
        return self

    @property
    def base_friction_coefficient(self) -> float:
        """tan δ_b [-]."""
        if self.base_friction is not None:
            return self.base_friction
        assert self.base_soil_friction_angle_deg is not None
        return BASE_STRENGTH_RATIO * math.tan(math.radians(self.base_soil_friction_angle_deg))


class Prescribed(Model):
    """The barrier follows a given velocity, whatever the flow does to it."""

    kind: Literal["prescribed"]
    times_s: Series
    """Increasing times, the first at or after 0."""
    velocities_m_per_s: Annotated[tuple[Velocity, ...], Field(strict=False, min_length=1, max_length=100_000)]
    """Velocity along x at these times; linear in between, constant before the first and after the last."""

    @model_validator(mode="after")
    def _series(self) -> Self:
        if len(self.times_s) != len(self.velocities_m_per_s):
            raise ValueError(
                f"times_s has {len(self.times_s)} entries and velocities_m_per_s has "
                f"{len(self.velocities_m_per_s)}; they must be as many"
            )
        if self.times_s[0] < 0.0 or any(b <= a for a, b in zip(self.times_s, self.times_s[1:], strict=False)):
            raise ValueError("times_s must start at or after 0 and increase")
        return self


class SurfaceFriction(Model):
    """Friction coefficient tan δ between the flow's solid and each surface of the barrier."""

    face: Friction
    """Impacted side."""
    top: Friction
    """Crest."""
    back: Friction
    """Downstream side."""


def _or_one_friction(schema: dict[str, Any]) -> None:
    schema["anyOf"] = [{"$ref": schema.pop("$ref")}, {"type": "number", "minimum": 0, "maximum": 10}]


class Barrier(Model):
    """A rigid, impermeable barrier on the ground."""

    shape: Annotated[Trapezoid | OutlineShape | Wall, Field(discriminator="kind")]
    motion: Annotated[Fixed | Sliding | Prescribed, Field(discriminator="kind")]
    friction: Annotated[SurfaceFriction, Field(json_schema_extra=_or_one_friction)]
    """Friction coefficient tan δ against the flow; one number holds for all surfaces."""

    @field_validator("friction", mode="before")
    @classmethod
    def _one_number(cls, value: Any) -> Any:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return {"face": value, "top": value, "back": value}
        if not isinstance(value, (dict, SurfaceFriction)):
            raise ValueError(
                f"{json.dumps(value, default=repr)[:80]} is not allowed; it must be a number at least 0 "
                "and at most 10, or a group of the fields face, top, back"
            )
        return value

    @model_validator(mode="after")
    def _mass_of_wall(self) -> Self:
        if isinstance(self.shape, Wall) and isinstance(self.motion, Sliding) and self.motion.mass_kg_per_m is None:
            raise ValueError("motion needs mass_kg_per_m: a wall without end has no mass of its own")
        return self

    @property
    def mass(self) -> float | None:
        """Mass m_2 [kg/m] of a sliding barrier; None where the motion does not depend on it."""
        if not isinstance(self.motion, Sliding):
            return None
        if self.motion.mass_kg_per_m is not None:
            return self.motion.mass_kg_per_m
        assert not isinstance(self.shape, Wall)
        assert self.motion.density_kg_per_m3 is not None
        return self.motion.density_kg_per_m3 * geometry.area(self.shape.outline)

    @property
    def density(self) -> float | None:
        """Density [kg/m³] of a sliding barrier; None where the motion does not depend on it, or it has no end."""
        if not isinstance(self.motion, Sliding) or isinstance(self.shape, Wall):
            return None
        if self.motion.density_kg_per_m3 is not None:
            return self.motion.density_kg_per_m3
        assert self.motion.mass_kg_per_m is not None
        return self.motion.mass_kg_per_m / geometry.area(self.shape.outline)


RESERVED = (
    *("barrier", "ground", "impact", "top", "back", "left_wall", "right_wall", "ceiling"),
    *("base", "flow", "left", "inflow"),
)
"""Names that columns and bodies have already."""


class FurtherBarrier(Barrier):
    """A barrier beside the scene's first one, with forces and motion of its own."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=30)]
    """In the columns of the time series, NAME_force_x and its like: small letters, digits and _."""
    x_m: Coordinate
    """x of its toe, or of a wall's face; it stands on the ground there."""

    @field_validator("name")
    @classmethod
    def _own_name(cls, name: str) -> str:
        if name in RESERVED or name.endswith(("_face", "_top", "_back", "_force")):
            raise ValueError(
                f"{json.dumps(name)} is not allowed; it must be none of {', '.join(RESERVED)} and not end in _face, "
                "_top, _back or _force"
            )
        return name
