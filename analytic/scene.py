"""What the closed form needs to know of a flow and a barrier, as numbers or read from a scenario of the simulator.

Standard library only, so that ``predict`` starts at once.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from analytic.impact import STANDARD_GRAVITY, Impact

PAPER_GEOMETRY_CHANGE = {"fixed": 0.72, "sliding": 0.41}
"""The paper's constants lambda = s1max / L_1,0 [-] (section 3.2)."""

ASSUMED_RISE_RATIO = 0.35
"""tau [-] assumed where none is given: the paper names no value, only that the rise is much shorter than the decay."""

BASE_STRENGTH_RATIO = 0.8
"""Share of the base soil's tan(phi) that resists sliding (paper, section 2.2)."""


class SceneError(ValueError):
    """A scene that the closed form cannot use; the message is one sentence that names the file and the field."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A flow and a barrier, SI units per metre of width. ``None``: not known, or not there."""

    flow_mass: float
    """m1 [kg/m]."""
    flow_length: float
    """L_1,0 [m], length of the box of the flow's volume and depth."""
    flow_height: float
    """h [m]."""
    speed: float
    """v_1,0 [m/s]."""
    barrier_mass: float | None = None
    """m2 [kg/m]; ``None`` for a fixed barrier."""
    base_friction: float | None = None
    """tan(delta_b) [-] of a barrier that may slide."""
    gravity: float = STANDARD_GRAVITY
    """[m/s^2]."""
    slope: float = 0.0
    """theta [degrees], by which the ground falls in the direction of the flow."""
    porosity: float | None = None
    """n [-]."""
    face_angle: float | None = None
    """beta, angle of the impacted face with the base [degrees]."""
    barrier_height: float | None = None
    """H [m]; infinite for a wall without end."""
    barrier_density: float | None = None
    """[kg/m^3]."""
    distance: float = 0.0
    """From the flow's front to the toe of the barrier [m]."""
    title: str = ""
    remarks: tuple[str, ...] = ()
    """What of the file the scene does not hold."""

    @property
    def fixed(self) -> bool:
        """Whether the barrier is fixed."""
        return self.barrier_mass is None

    @property
    def density(self) -> float:
        """rho_m [kg/m^3]."""
        return self.flow_mass / (self.flow_length * self.flow_height)

    @property
    def froude_number(self) -> float:
        """Fr = v / sqrt(g h) [-]."""
        return self.speed / math.sqrt(self.gravity * self.flow_height)

    @property
    def weight_on_base(self) -> float:
        """m2 g cos(theta) [N/m], with which a barrier that may slide presses on its base; 0 for a fixed one."""
        return (self.barrier_mass or 0.0) * self.gravity * math.cos(math.radians(self.slope))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the closed form does not see, in sentences."""
        if self.slope == 0:
            return self.remarks
        pull = self.flow_mass * self.gravity * math.sin(math.radians(self.slope))
        seen = "" if self.fixed else "the barrier's weight along it is counted, "
        effect = "pushes on: forces and displacements come out too small" if pull > 0 else "holds the flow back"
        size = f"{abs(pull) / 1e3:.3g} kN/m"
        return (
            *self.remarks,
            f"Slope of {self.slope:g} degrees: {seen}the flow's is left out, {size}, which {effect}.",
        )

    @property
    def paper_geometry_change(self) -> float:
        """The paper's lambda for this kind of barrier [-]."""
        return PAPER_GEOMETRY_CHANGE["fixed" if self.fixed else "sliding"]

    def impact(self, **model: Any) -> Impact:
        """The impact, with what is given in ``model``: geometry change, rise ratio, variant, ... (see ``Impact``)."""
        if "geometry_change" not in model and "s1max" not in model:
            model["geometry_change"] = self.paper_geometry_change
        scene = {
            "flow_mass": self.flow_mass,
            "barrier_mass": self.barrier_mass,
            "flow_length": self.flow_length,
            "flow_height": self.flow_height,
            "speed": self.speed,
            "base_friction": self.base_friction,
            "gravity": self.gravity,
            "slope": self.slope,
        }
        return Impact(**(scene | {"rise_ratio": ASSUMED_RISE_RATIO} | model))


def read_scene(path: str | Path) -> Scene:
    """Read a scenario file of the simulator, or the scenario of a run folder.

    Raises
    ------
    SceneError: the file cannot be read, lacks a field, or shows something that the closed form has no answer to.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "scenario.json"
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror or error}.") from None
    except ValueError as error:
        raise SceneError(f"{path} is no valid JSON: {error}.") from None
    return scene_of(content, str(path))


def scene_of(content: Any, name: str = "The scenario") -> Scene:
    """The scene in the content of a scenario file (layout: ``python -m warp_mpm schema``); ``name`` is for messages.

    Raises
    ------
    SceneError: as ``read_scene``.
    """
    get = _Reader(content, name)
    flow_density, porosity = _density_and_porosity(get)
    volume, height, distance = _outline(get)
    velocity_x, velocity_y = get.numbers("flow.velocity_m_per_s", 2)
    if velocity_x <= 0:
        raise SceneError(f"{name}: flow.velocity_m_per_s[0] is {velocity_x:g}, the flow must move towards the barrier.")
    remarks = []
    if velocity_y != 0:
        remarks.append(f"The flow's vertical velocity of {velocity_y:g} m/s is left out.")
    if get.number("ground.friction", 0.0) != 0:
        remarks.append("The friction between flow and ground is left out.")
    if get.text("barrier.shape.kind") == "wall":
        area, face_angle, barrier_height = math.nan, 90.0, math.inf
    else:
        area, face_angle, barrier_height = _trapezoid(get)
    motion = get.text("barrier.motion.kind")
    mass = friction = density = None
    if motion == "sliding":
        mass = get.number("barrier.motion.mass_kg_per_m", None)
        if mass is None:
            density = get.number("barrier.motion.density_kg_per_m3")
            mass = area * density
        elif math.isfinite(area):
            density = mass / area
        friction = get.number("barrier.motion.base_friction", None)
        if friction is None:
            angle = get.number("barrier.motion.base_soil_friction_angle_deg")
            friction = BASE_STRENGTH_RATIO * math.tan(math.radians(angle))
    elif motion != "fixed":
        raise SceneError(f"{name}: barrier.motion.kind is {motion!r}, the closed form knows fixed and sliding.")
    return Scene(
        title=str(get.value("title", "")),
        flow_mass=volume * flow_density,
        flow_length=volume / height,
        flow_height=height,
        speed=velocity_x,
        barrier_mass=mass,
        base_friction=friction,
        gravity=get.number("gravity.acceleration_m_per_s2", STANDARD_GRAVITY),
        slope=get.number("gravity.tilt_deg", 0.0),
        porosity=porosity,
        face_angle=face_angle,
        barrier_height=barrier_height,
        barrier_density=density,
        distance=distance,
        remarks=tuple(remarks),
    )


_REQUIRED = object()


@dataclass(frozen=True)
class _Reader:
    content: Any
    name: str

    def value(self, path: str, default: Any = _REQUIRED) -> Any:
        at = self.content
        for part in path.split("."):
            at = at.get(part) if isinstance(at, Mapping) else None
        if at is None and default is _REQUIRED:
            raise SceneError(f"{self.name}: {path} is missing.")
        return default if at is None else at

    def number(self, path: str, default: Any = _REQUIRED) -> Any:
        found = self.value(path, default)
        if found is default:
            return found
        if not isinstance(found, int | float) or isinstance(found, bool) or not math.isfinite(found):
            raise SceneError(f"{self.name}: {path} is {found!r}, it must be a finite number.")
        return float(found)

    def text(self, path: str) -> str:
        return str(self.value(path))

    def numbers(self, path: str, count: int) -> list[float]:
        found = self.value(path)
        if not isinstance(found, Sequence) or len(found) != count or not all(_finite(item) for item in found):
            raise SceneError(f"{self.name}: {path} is {found!r}, it must be a list of {count} finite numbers.")
        return [float(item) for item in found]


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _density_and_porosity(get: _Reader) -> tuple[float, float]:
    """rho_m = (1 - n) rho_grain + n rho_L [kg/m^3], the liquid only where the flow has one; n [-]."""
    porosity = get.number("flow.material.porosity")
    solid = (1 - porosity) * get.number("flow.material.grain_density_kg_per_m3")
    dry = get.text("flow.formulation") == "dry"
    return solid + (0.0 if dry else porosity * get.number("flow.material.liquid_density_kg_per_m3")), porosity


def _outline(get: _Reader) -> tuple[float, float, float]:
    """Volume [m^3/m], depth [m] and distance from the barrier's toe [m] of the flow."""
    kind = get.text("flow.shape.kind")
    if kind == "front_and_tail":
        depth = get.number("flow.shape.depth_m")
        return (2 + get.number("flow.shape.squares")) * depth**2, depth, get.number("flow.shape.distance_m")
    if kind != "polygon":
        raise SceneError(f"{get.name}: flow.shape.kind is {kind!r}, it must be front_and_tail or polygon.")
    corners = get.value("flow.shape.vertices_m")
    if not isinstance(corners, Sequence) or len(corners) < 3:
        raise SceneError(f"{get.name}: flow.shape.vertices_m must be a list of at least three corners [x, y].")
    for corner in corners:
        if not isinstance(corner, Sequence) or len(corner) != 2 or not all(_finite(item) for item in corner):
            raise SceneError(f"{get.name}: flow.shape.vertices_m holds {corner!r}, it must be a pair of numbers.")
    return _area(corners), _greatest_depth(corners), -max(x for x, _ in corners)


def _sides(corners: Sequence[Sequence[float]]) -> list[tuple[Sequence[float], Sequence[float]]]:
    return list(pairwise([*corners, corners[0]]))


def _area(corners: Sequence[Sequence[float]]) -> float:
    return abs(math.fsum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in _sides(corners))) / 2


def _greatest_depth(corners: Sequence[Sequence[float]]) -> float:
    """Greatest vertical thickness, which a polygon has beside one of its corners."""
    xs = sorted({x for x, _ in corners})
    nudge = 1e-9 * (xs[-1] - xs[0])
    deepest = 0.0
    for line in (x + side for x in xs for side in (-nudge, nudge)):
        heights = sorted(
            y0 + (line - x0) * (y1 - y0) / (x1 - x0)
            for (x0, y0), (x1, y1) in _sides(corners)
            if (x0 > line) != (x1 > line)
        )
        deepest = max([deepest, *(high - low for low, high in zip(heights[::2], heights[1::2], strict=True))])
    return deepest


def _trapezoid(get: _Reader) -> tuple[float, float, float]:
    """Area [m^2], face angle [degrees] and height [m] of the barrier; any three of its four measures fix it."""
    names = ("base_width_m", "crest_width_m", "height_m", "face_angle_deg")
    base, crest, height, angle = (get.number(f"barrier.shape.{name}", None) for name in names)
    if [base, crest, height, angle].count(None) > 1:
        raise SceneError(f"{get.name}: barrier.shape needs three of {', '.join(names)}.")
    if None not in (base, crest, height):
        angle = math.degrees(math.atan2(height, (base - crest) / 2))
    else:
        run = 1 / math.tan(math.radians(angle))
        if base is None:
            base = crest + 2 * height * run
        elif crest is None:
            crest = base - 2 * height * run
        else:
            height = (base - crest) / (2 * run)
    return (base + crest) / 2 * height, angle, height
