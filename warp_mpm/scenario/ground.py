"""The ground: level, or a profile given point by point, and the friction of its stretches."""

from __future__ import annotations

import csv
import json
import math
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from warp_mpm.schema import Coordinate, Friction, Model, Point, Text

Array = NDArray[np.float64]

MOST_POINTS = 10_000
"""Points of a profile at most."""

LARGEST_FILE = 16 * 1024 * 1024
"""Bytes of a profile's file at most."""

FARTHEST = 1e6
"""Greatest coordinate [m], as of every other one in a scenario."""


Turbulence = Annotated[float, Field(ge=1.0, le=1e6)]


class Stretch(Model):
    """Ground from a place on, with its own friction."""

    from_m: Coordinate
    """x in the profile from which on the friction holds, up to where the next stretch begins."""
    friction: Friction
    """Friction coefficient tan φ_b between the flow's solid and the ground."""
    turbulence_m_per_s2: Turbulence | None = None
    """Voellmy's ξ there; null: that of the ground."""


class Ground(Model):
    """Rigid, impermeable ground: level at y = 0, or a profile."""

    friction: Friction = 0.0
    """Friction coefficient tan φ_b between the flow's solid and the ground; 0 is smooth, as in the paper."""
    turbulence_m_per_s2: Turbulence | None = None
    """Voellmy's ξ: the ground rubs on the flow with ρ g v²/ξ besides, ρ the flow's density at the start; null: with
    friction alone."""
    profile_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=2, max_length=MOST_POINTS)] | None = None
    """Points [x, y] of the ground's surface, x not decreasing: two of one x are an upright step. Beyond its ends the
    ground goes on straight, and a fitted domain ends there. null: level, y = 0."""
    profile_csv: Text | None = None
    """File beside the scenario with the profile's points, in place of profile_m: two columns x, y, or a GeoJSON
    LineString. Its points stand in profile_m of the scenario that a run keeps."""
    origin_m: Coordinate | None = None
    """x in the profile of the point of the ground that is the scene's origin, where the barrier's toe stands:
    everything else in the scenario is measured from there. null: the profile's own origin, which lies on the ground
    where there is a barrier."""
    stretches: Annotated[tuple[Stretch, ...], Field(strict=False, max_length=100)] = ()
    """Where the friction changes, in order of from_m; before the first one `friction` holds."""

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("profile_csv"), str):
            if data.get("profile_m") is not None:
                raise ValueError("needs at most one of profile_m and profile_csv")
            points = read_profile(Path(data["profile_csv"]))
            return {name: value for name, value in data.items() if name != "profile_csv"} | {"profile_m": points}
        return data

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.profile_m is None:
            if self.origin_m is not None:
                raise ValueError(f"origin_m = {self.origin_m:g} is a place in a profile; without one it must be null")
        else:
            self._check_profile(np.array(self.profile_m))
        places = [stretch.from_m for stretch in self.stretches]
        for before, after in pairwise(places):
            if not after > before:
                raise ValueError(f"stretches: from_m = {after:g} follows {before:g}; from_m must increase")
        return self

    def _check_profile(self, given: Array) -> None:
        x, y = given.T
        for k in range(1, len(x)):
            if x[k] < x[k - 1]:
                raise ValueError(
                    f"profile_m: point {k + 1} at x = {x[k]:g} lies before the one at x = {x[k - 1]:g}; x must not "
                    "decrease (an overhang is a barrier of the kind outline)"
                )
            if x[k] == x[k - 1] and y[k] == y[k - 1]:
                raise ValueError(f"profile_m: points {k} and {k + 1} are both [{x[k]:g}, {y[k]:g}]; one must go")
            if k > 1 and x[k] == x[k - 2]:
                raise ValueError(
                    f"profile_m: points {k - 1} to {k + 1} all have x = {x[k]:g}; at most two may, of an upright step"
                )
        if x[1] == x[0] or x[-1] == x[-2]:
            raise ValueError(
                "profile_m begins or ends with an upright step; its first and last piece must lead along x"
            )
        if self.origin_m is None:
            return
        if not x[0] <= self.origin_m <= x[-1]:
            raise ValueError(
                f"origin_m = {self.origin_m:g} lies outside of the profile; it must be from {x[0]:g} to {x[-1]:g}"
            )
        if (x == self.origin_m).sum() > 1:
            raise ValueError(
                f"origin_m = {self.origin_m:g} lies on an upright step of the profile; it must lie beside it"
            )

    def __eq__(self, other: object) -> bool:
        # What is kept beside the fields, in arrays, is no part of it.
        fields = type(self).model_fields
        return isinstance(other, Ground) and all(getattr(self, name) == getattr(other, name) for name in fields)

    @property
    def level(self) -> bool:
        """Whether it is the plane y = 0 of one friction, without end."""
        return self.profile_m is None and not self.stretches

    @cached_property
    def _origin(self) -> Array:
        """[2] the scene's origin in the profile's coordinates."""
        if self.profile_m is None or self.origin_m is None:
            return np.zeros(2)
        x, y = np.array(self.profile_m).T
        return np.array([self.origin_m, np.interp(self.origin_m, x, y)])

    @cached_property
    def profile(self) -> Array:
        """Points [V, 2] of its surface [m], x not decreasing, measured from the scene's origin; the surface goes on
        straight beyond them."""
        if self.profile_m is None:
            return np.array([[-1.0, 0.0], [1.0, 0.0]])
        return np.array(self.profile_m) - self._origin

    @property
    def ends(self) -> tuple[float, float]:
        """x [m] between which the ground is known; a level one is known everywhere."""
        if self.profile_m is None:
            return -math.inf, math.inf
        return float(self.profile[0, 0]), float(self.profile[-1, 0])

    @property
    def frictions(self) -> list[tuple[float, float]]:
        """Where each stretch begins [m], from the scene's origin, the first one at -inf, and its friction."""
        begin = float(self._origin[0])
        return [(-math.inf, self.friction)] + [(stretch.from_m - begin, stretch.friction) for stretch in self.stretches]

    @property
    def drags(self) -> list[float]:
        """1 / ξ [s²/m] of each of `frictions`; 0 where the friction does not grow with the speed."""
        given = [self.turbulence_m_per_s2]
        given += [stretch.turbulence_m_per_s2 or self.turbulence_m_per_s2 for stretch in self.stretches]
        return [0.0 if one is None else 1.0 / one for one in given]

    @property
    def roughest(self) -> float:
        """Greatest friction coefficient."""
        return max(friction for _, friction in self.frictions)

    def height(self, x: Any, *, lower: bool = False) -> Array:
        """y [...] of the surface at `x` [...] [m]; of an upright step its upper edge, or its lower one."""
        px, py = self.profile.T
        at = np.asarray(x, dtype=np.float64)
        right = np.interp(at, px, py)  # at a step the value after it
        left = np.interp(-at, -px[::-1], py[::-1])
        first, last = (py[1] - py[0]) / (px[1] - px[0]), (py[-1] - py[-2]) / (px[-1] - px[-2])
        beyond = first * np.minimum(at - px[0], 0.0) + last * np.maximum(at - px[-1], 0.0)
        return np.where(lower, np.minimum(left, right), np.maximum(left, right)) + beyond

    def slope(self, x: Any) -> Array:
        """dy/dx [...] of the surface at `x` [...]; infinite on a step is left out, the piece after it counts."""
        px, py = self.profile.T
        piece = np.clip(np.searchsorted(px, np.asarray(x), side="right") - 1, 0, len(px) - 2)
        run = px[piece + 1] - px[piece]
        return np.where(run > 0.0, (py[piece + 1] - py[piece]) / np.where(run > 0.0, run, 1.0), 0.0)

    def before(self, x: float) -> tuple[float, float]:
        """y [m] and dy/dx of the surface just before `x` [m]: of the piece that leads there from upstream."""
        px, py = self.profile.T
        piece = int(np.clip(np.searchsorted(px, x, side="left") - 1, 0, len(px) - 2))
        slope = float((py[piece + 1] - py[piece]) / (px[piece + 1] - px[piece]))
        return float(py[piece] + slope * (x - px[piece])), slope

    def range(self, left: float, right: float) -> tuple[float, float]:
        """Lowest and highest y [m] of the surface between two x."""
        px, py = self.profile.T
        inside = py[(px >= left) & (px <= right)]
        heights = np.concatenate([inside, np.ravel(self.height([left, right]))])
        return float(heights.min()), float(heights.max())


def read_profile(path: Path) -> list[list[float]]:
    """Points [x, y] of a profile from a table of two columns, or a GeoJSON LineString.

    A table's columns are parted by commas, semicolons, tabs or blanks; a first line of names and lines that begin with
    # are passed over, and so are further columns. A LineString of [x, y] is taken as it is; one of [easting, northing,
    height] becomes the way along it and the height.

    Raises:
        ValueError: the file cannot be read, or a line is none of two numbers; the sentence names file and line.
    """
    name = f"profile_csv = {json.dumps(str(path), ensure_ascii=False)}"
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{name} is larger than {LARGEST_FILE // 1024**2} MB; this is no profile")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ValueError(f"{name} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{name} is no text; it must be a table of two columns x, y or a GeoJSON LineString") from None
    if text.lstrip().startswith("{"):
        return _of_geojson(text, name)
    points: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        mark = next((mark for mark in (";", "\t", ",") if mark in line), None)
        words = [word.strip() for word in (next(csv.reader([line], delimiter=mark)) if mark else line.split())]
        try:
            point = [float(word) for word in words[:2]]
        except ValueError:
            if not points and number == _first_line(text):
                continue  # names of the columns
            raise ValueError(f"{name}, line {number}: {line[:60]!r} must begin with two numbers x, y") from None
        if len(point) < 2 or not all(math.isfinite(value) and abs(value) <= FARTHEST for value in point):
            raise ValueError(
                f"{name}, line {number}: {line[:60]!r} must begin with two finite numbers x, y from {-FARTHEST:g} to "
                f"{FARTHEST:g}"
            )
        points.append(point)
    return points


def _first_line(text: str) -> int:
    """Number of the first line that is neither empty nor a remark."""
    lines = enumerate(text.splitlines(), start=1)
    return next((number for number, line in lines if line.strip() and not line.strip().startswith("#")), 0)


def _of_geojson(text: str, name: str) -> list[list[float]]:
    wrong = f"{name} must hold one GeoJSON LineString of two or more [x, y] or [easting, northing, height]"
    try:
        content = json.loads(text)
        if content.get("type") == "FeatureCollection":
            (content,) = content["features"]
        if content.get("type") == "Feature":
            content = content["geometry"]
        if content["type"] != "LineString":
            raise ValueError(wrong)
        points = np.array(content["coordinates"], dtype=np.float64)
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ValueError(wrong) from None
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
        raise ValueError(wrong)
    if points.shape[1] == 3:
        steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
        points = np.column_stack([np.concatenate([[0.0], np.cumsum(steps)]), points[:, 2]])
    return [[float(x), float(y)] for x, y in points]
