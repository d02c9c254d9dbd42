"""Fields of a scenario that vary: how they are typed, and what has to follow them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from warp_mpm import geometry
from warp_mpm.scenario import Scenario, Sliding, Trapezoid
from warp_mpm.scenario_errors import ScenarioError, bounds
from warp_mpm.sweep.design import changed

SHAPE = "barrier.shape."
MEASURES = ("base_width_m", "face_angle_deg", "crest_width_m", "height_m")
"""Of a trapezoid; the first that does not vary follows from the others, so that faces keep their angle."""

ONE_OF = (
    ("barrier.motion.density_kg_per_m3", "barrier.motion.mass_kg_per_m"),
    ("barrier.motion.base_friction", "barrier.motion.base_soil_friction_angle_deg"),
    ("flow.material.hydraulic_conductivity_m_per_s", "flow.material.intrinsic_permeability_m2"),
    ("flow.shape.squares", "flow.shape.length_m"),
)
"""Fields of which a scenario gives exactly one: the one that varies takes the other's place."""


@dataclass(frozen=True)
class Range:
    """A field and the values between which it may lie."""

    path: str
    low: float
    high: float

    @property
    def label(self) -> str:
        """Words and unit for pictures and tables: `crest width [m]`."""
        return words(self.path)


def words(path: str) -> str:
    """A field's last name as words with its unit: `crest width [m]`, `velocity x [m/s]`."""
    *_, name = path.split(".")
    if name.isdecimal():
        name = path.split(".")[-2]
        axis = " " + "xy"[int(path.rpartition(".")[2])] if int(path.rpartition(".")[2]) < 2 else ""
    else:
        axis = ""
    for tail, unit in UNITS.items():
        if name.endswith(tail):
            return f"{name.removesuffix(tail).replace('_', ' ')}{axis} [{unit}]"
    return f"{name.replace('_', ' ')}{axis} [-]"


UNITS = {
    "_kg_per_m3": "kg/m³",
    "_kg_per_m": "kg/m",
    "_m_per_s2": "m/s²",
    "_m_per_s": "m/s",
    "_Pa_s": "Pa s",
    "_Pa": "Pa",
    "_deg": "°",
    "_m2": "m²",
    "_m": "m",
    "_s": "s",
}
"""Units by the ends of fields' names."""


def typed(text: str) -> tuple[str, str]:
    """Path and what follows its `=` ("" where nothing does)."""
    path, _, rest = text.partition("=")
    return path.strip(), rest.strip()


def read_range(text: str, scenario: Scenario) -> Range:
    """A range as it was typed, `FIELD=LOW:HIGH`; of a field alone a quarter to twice its value.

    Raises:
        ValueError: it cannot be read, the field is no number of the scenario, or the values do not increase.
    """
    path, rest = typed(text)
    value = number_at(scenario, path)
    if not rest:
        if value is None or not value > 0.0:
            raise ValueError(f"--vary {path} needs a range, {path}=LOW:HIGH: the scenario's value gives none.")
        return Range(path, 0.25 * value, 2.0 * value)
    try:
        low, high = (float(part) for part in rest.split(":"))
    except ValueError:
        raise ValueError(
            f"--vary {text} is not allowed; it must read FIELD=LOW:HIGH with two numbers: {SHAPE}crest_width_m=0.5:4."
        ) from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"--vary {path}={rest} is not allowed; LOW must be less than HIGH, and both finite.")
    return Range(path, low, high)


def number_at(scenario: Scenario, path: str, *, option: str = "--vary") -> float | None:
    """The number that a path leads to; None where the scenario leaves it out.

    Raises:
        ValueError: it leads to no number.
    """
    holder, name = _holder(scenario, path, option)
    value = holder[int(name)] if isinstance(holder, tuple) else getattr(holder, name)
    if isinstance(value, bool) or not (value is None or isinstance(value, int | float)):
        raise ValueError(f"{option} {path} is no number of the scenario.")
    return None if value is None else float(value)


def allowed(scenario: Scenario, path: str) -> tuple[float, float]:
    """Least and greatest value that a field takes by itself, whatever the others are."""
    holder, name = _holder(scenario, path)
    return (-math.inf, math.inf) if isinstance(holder, tuple) else bounds(type(holder), name)


def _holder(scenario: Scenario, path: str, option: str = "--vary") -> tuple[Any, str]:
    """What holds the last part of a path, a model or a list, and that part."""
    *parents, name = path.split(".")
    place: Any = scenario
    for depth, parent in enumerate([*parents, name]):
        known = type(place).model_fields if isinstance(place, BaseModel) else ()
        listed = isinstance(place, tuple) and parent.isdecimal() and int(parent) < len(place)
        if parent not in known and not listed:
            where = ".".join(path.split(".")[:depth]) or "the scenario"
            if isinstance(place, BaseModel):
                has = f"{where} has {', '.join(known)}"
            else:
                has = f"{where} has entries 0 to {len(place) - 1}" if isinstance(place, tuple) else f"{where} has none"
            raise ValueError(f"{option} {path} leads nowhere: there is no {parent}; {has}.")
        if depth == len(parents):
            return place, name
        place = place[int(parent)] if listed else getattr(place, parent)
        if listed and isinstance(place, BaseModel):
            where = ".".join(path.split(".")[:depth])
            raise ValueError(f"{option} {path} leads into the list {where}, whose entries do not vary.")
    raise AssertionError(path)


def freed(scenario: Scenario, paths: Iterable[str]) -> tuple[Scenario, list[str]]:
    """The scenario with what must follow when these fields vary left to follow, and sentences on what that is.

    A barrier keeps its faces' angle and its density when its shape varies.

    Raises:
        ValueError: a path leads to no number, or the barrier has no such shape.
    """
    paths = list(paths)
    changes: dict[str, Any] = {}
    told: list[str] = []
    for path in paths:
        number_at(scenario, path)
        for one, other in ONE_OF:
            for here, there in ((one, other), (other, one)):
                if path == here and number_at(scenario, there) is not None:
                    # A value for the one that varies, until a trial has its own.
                    changes |= {there: None, here: _in_place_of(scenario, here)}
    varied = [path.removeprefix(SHAPE) for path in paths if path.startswith(SHAPE)]
    barrier = scenario.barrier
    if varied and barrier is not None and isinstance(barrier.shape, Trapezoid):
        base, crest, height = barrier.shape.base_crest_height
        whole = {
            "base_width_m": base,
            "crest_width_m": crest,
            "height_m": height,
            "face_angle_deg": barrier.shape.face_angle_deg or barrier.shape.built_face_angle_deg,
        }
        follows = next(name for name in MEASURES if name not in varied)
        changes |= {SHAPE + name: None if name == follows else value for name, value in whole.items()}
        told.append(f"{SHAPE}{follows} follows from the other measures of the barrier.")
        motion, weighed = barrier.motion, "barrier.motion.mass_kg_per_m" in paths
        if isinstance(motion, Sliding) and motion.mass_kg_per_m is not None and not weighed:
            density = motion.mass_kg_per_m / geometry.area(barrier.shape.outline)
            changes |= {"barrier.motion.mass_kg_per_m": None, "barrier.motion.density_kg_per_m3": density}
            told.append(f"The barrier keeps its density of {density:.4g} kg/m³; its mass follows from its shape.")
    return scenario.replaced(changes), told


def _in_place_of(scenario: Scenario, path: str) -> float:
    """A value that says the same of the scene as the other one of a pair."""
    barrier, flow = scenario.barrier, scenario.flow
    if path == "barrier.motion.mass_kg_per_m" and barrier is not None and barrier.mass is not None:
        return barrier.mass
    if path == "barrier.motion.density_kg_per_m3" and barrier is not None and barrier.density is not None:
        return barrier.density
    if path == "flow.shape.length_m":
        return flow.equivalent_length
    if path == "flow.shape.squares":
        return max(round(flow.equivalent_length / flow.depth) - 2, 0)
    if path.startswith("barrier.motion.base"):
        assert barrier is not None
        motion: Any = barrier.motion
        friction = motion.base_friction_coefficient
        return friction if path.endswith("base_friction") else math.degrees(math.atan(friction / 0.8))
    material: Any = flow.material
    return float(material.hydraulic_conductivity if path.endswith("_m_per_s") else material.intrinsic_permeability)


def with_values(scenario: Scenario, values: Mapping[str, float]) -> Scenario:
    """The scenario with these values of its fields.

    Raises:
        ScenarioError: a value is not allowed; the sentence names all of them.
    """
    try:
        return changed(scenario, values)
    except ScenarioError as error:
        told = ", ".join(f"{path} = {value:.6g}" for path, value in values.items())
        raise ScenarioError([f"{told}: {problem}" for problem in error.problems]) from None


def check_once(texts: Sequence[str]) -> None:
    """Refuse a field that is varied twice, and the spacing, which is that of all trials.

    Raises:
        ValueError: one sentence.
    """
    paths = [typed(text)[0] for text in texts]
    for path in paths:
        if paths.count(path) > 1:
            raise ValueError(f"--vary {path} is given twice; give it once.")
        if path == "numerics.spacing_m":
            raise ValueError(f"--vary {path} is not allowed: all trials have the spacing of --spacing.")
