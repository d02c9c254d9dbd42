"""Outlines of a flow and of deposits, and where they lie on the ground."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from warp_mpm import geometry
from warp_mpm.scenario.ground import Ground
from warp_mpm.scenario.other_material import OtherMaterial
from warp_mpm.schema import AsWhole, Coordinate, Length, Model, Point

NARROWEST = 1e-6
"""Least width and height [m] of a flow's outline, those of the finest grid's cell."""

THINNEST = 1e-12
"""Least area of a flow's outline over the square of its extent; below it rounding decides where inside is."""


class FrontAndTail(Model):
    """The paper's flow: a front at 45°, `squares` squares of the flow's depth, a tail of three depths.

    Its length may be given in metres in place of a whole number of squares; exactly one of the two is given.
    """

    kind: Literal["front_and_tail"]
    depth_m: Length
    """Flow depth h."""
    squares: Annotated[int, Field(ge=0, le=100_000), AsWhole] | None = None
    """Number i of squares between front and tail. Volume (2 + i) h² per metre of width."""
    length_m: Length | None = None
    """Length L of the box of the flow's volume and depth, at least 2 h, in place of `squares`. Volume L h."""
    distance_m: Annotated[float, Field(ge=0.0, le=1e6)]
    """Distance d from the front's toe to the barrier's toe."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if (self.squares is None) == (self.length_m is None):
            raise ValueError("needs exactly one of squares and length_m")
        if self.length_m is not None and self.length_m < 2.0 * self.depth_m * (1.0 - 1e-9):
            raise ValueError(
                f"length_m = {self.length_m:g} must be at least twice depth_m, {2.0 * self.depth_m:g}: "
                "front and tail alone have as much"
            )
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres."""
        if self.squares is not None:
            return geometry.front_and_tail(self.depth_m, self.squares, self.distance_m)
        assert self.length_m is not None
        between = self.length_m / self.depth_m - 2.0
        return geometry.front_and_tail(self.depth_m, between if between > 1e-9 else 0, self.distance_m)


class FlowPolygon(Model):
    """A flow of any outline."""

    kind: Literal["polygon"]
    vertices_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=3, max_length=2000)]
    """Corners [x, y], in order around the outline, the last joining the first."""

    @model_validator(mode="after")
    def _simple(self) -> Self:
        crossing = geometry.crossing_edges(self.polygon)
        if crossing is not None:
            first, second = crossing
            raise ValueError(
                f"vertices_m must not cross or touch themselves; the side after corner {first + 1} meets "
                f"the side after corner {second + 1}"
            )
        if not geometry.area(self.polygon) > 0.0:
            raise ValueError("vertices_m must enclose an area greater than 0")
        width, height = np.ptp(self.polygon, axis=0)
        share = geometry.area(self.polygon) / (width**2 + height**2)
        if min(width, height) < NARROWEST or share < THINNEST:
            raise ValueError(
                f"vertices_m enclose {geometry.area(self.polygon):.3g} m² in a box of {width:.3g} m by {height:.3g} m; "
                f"the box must be at least {NARROWEST:g} m wide and high, and the area at least {THINNEST:g} of its "
                "diagonal squared"
            )
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres."""
        return np.array(self.vertices_m)


class FlowOnGround(Model):
    """What lies on the ground, whatever its profile: made into a polygon when the scenario is read."""

    kind: Literal["on_ground"]
    from_m: Coordinate
    """x of its tail."""
    to_m: Coordinate
    """x of its front."""
    depth_m: Length
    """Upright depth between tail and front."""
    tail_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Length over which the depth grows from nothing at the tail; 0: an upright end."""
    front_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Length over which the depth goes down to nothing at the front."""

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        if not self.to_m - self.from_m >= max(self.tail_m + self.front_m, NARROWEST):
            raise ValueError(
                f"to_m = {self.to_m:g} must be at least {max(self.tail_m + self.front_m, NARROWEST):g} m, tail_m and "
                f"front_m, beyond from_m = {self.from_m:g}"
            )
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres on level ground."""
        return self.over(Ground()).polygon

    def over(self, ground: Ground) -> FlowPolygon:
        """Its outline over `ground`, anticlockwise from the tail."""
        x = ground.profile[:, 0]
        ends = [[place, float(ground.height(place))] for place in (self.from_m, self.to_m)]
        lower = np.concatenate([ends[:1], ground.profile[(x > self.from_m) & (x < self.to_m)], ends[1:]])
        top = np.unique([*lower[:, 0], self.from_m + self.tail_m, self.to_m - self.front_m])
        depth = np.full(len(top), self.depth_m)
        if self.tail_m:
            depth *= np.clip((top - self.from_m) / self.tail_m, 0.0, 1.0)
        if self.front_m:
            depth *= np.clip((self.to_m - top) / self.front_m, 0.0, 1.0)
        upper = np.stack([top, ground.height(top) + depth], axis=1)
        outline = np.concatenate([lower, upper[depth > 0.0][::-1]])
        return FlowPolygon(kind="polygon", vertices_m=outline.tolist())


class Deposit(OtherMaterial):
    """What lies there at the start: the deposit of an earlier surge."""

    shape: Annotated[FlowPolygon | FlowOnGround, Field(discriminator="kind")]
    """Its outline."""

    def laid_on(self, ground: Ground) -> Self:
        """The same deposit as a polygon over `ground`, where it is of the kind on_ground."""
        if not isinstance(self.shape, FlowOnGround):
            return self
        return self.model_copy(update={"shape": self.shape.over(ground)})
