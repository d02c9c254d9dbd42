"""A scenario from what an engineer knows of a site: depth, length, bulk density, speed, slope, barrier."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warp_mpm.scenario.settings import STANDARD_GRAVITY

KILONEWTON = 1000.0 / STANDARD_GRAVITY
"""Mass [kg] that weighs 1 kN."""

UNITS: Mapping[str, Mapping[str, float]] = {
    "length": {"m": 1.0, "cm": 0.01},
    "volume": {"m3/m": 1.0, "m2": 1.0},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6},
    "density": {"kg/m3": 1.0, "t/m3": 1000.0, "g/cm3": 1000.0, "kN/m3": KILONEWTON},
    "mass": {"kg/m": 1.0, "t/m": 1000.0, "kN/m": KILONEWTON, "kg": 1.0, "t": 1000.0, "kN": KILONEWTON},
    "angle": {"deg": 1.0},
    "share": {"": 1.0, "%": 0.01},
    "coefficient": {"": 1.0},
    "conductivity": {"m/s": 1.0, "cm/s": 0.01},
    "time": {"s": 1.0},
}
"""Units by kind, with the factor to the scenario's; the first is that of a number without one."""

POROSITY = 0.45
"""Assumed where neither a density, nor a water content, nor a porosity is given."""

CELLS = 6.0
"""Cells in the flow's depth of the spacing that is chosen: above what `check` asks for."""


@dataclass(frozen=True)
class Question:
    """A number that describes a site."""

    name: str
    """Of the option, without its hyphens."""
    words: str
    kind: str
    """Of `UNITS`."""
    low: float
    high: float
    default: float | None = None
    """In the scenario's unit; None: it must be given, or follows from others."""

    @property
    def option(self) -> str:
        """As it is typed."""
        return "--" + self.name.replace("_", "-")

    @property
    def unit(self) -> str:
        """Of a number without one."""
        return next(iter(UNITS[self.kind]))

    def value(self, text: str) -> float:
        """The value of a text, in the scenario's unit.

        Raises:
            ValueError: it is no number with a unit of this kind, or out of range; one sentence.
        """
        found = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*)?", text)
        unit = (found[2] or "").strip().replace("³", "3").replace("²", "2").replace("°", "deg") if found else ""
        units = UNITS[self.kind]
        try:
            # As many digits as anybody types: 43.2 km/h are 12 m/s.
            value = float(f"{float(found[1]) * (units[unit] if unit else 1.0):.12g}") if found else math.nan
        except (KeyError, ValueError):
            value = math.nan
        if math.isnan(value):
            named = [one for one in units if one]
            also = f" in {', '.join(named)}" if named else ""
            raise ValueError(f"{self.option} = {text} is not allowed; it must be a number{also}.")
        if not self.low <= value <= self.high:
            unit_shown = f" {self.unit}" if self.unit else ""
            meant = [
                f"; {text} {other} was probably meant"
                for other, factor in units.items()
                if not unit and factor > 1.0 and self.low <= factor * value <= self.high
            ]
            raise ValueError(
                f"{self.option} = {text} is not allowed; it must be at least {self.low:g} and at most "
                f"{self.high:g}{unit_shown}{meant[0] if meant else ''}."
            )
        return value


QUESTIONS: Mapping[str, Question] = {
    question.name: question
    for question in (
        Question("depth", "depth of the flow", "length", 0.05, 100.0),
        Question("length", "length of the flow, of the box of its volume and depth", "length", 0.1, 10_000.0),
        Question("volume", "volume of the flow per metre of width", "volume", 0.01, 100_000.0),
        Question("speed", "speed of the flow at the barrier", "speed", 0.0, 60.0),
        Question("slope", "slope of the ground, falling with the flow", "angle", -45.0, 45.0, 0.0),
        Question("bulk_density", "bulk density of the flow", "density", 500.0, 5000.0),
        Question("water_content", "mass of water over mass of grains", "share", 0.0, 10.0),
        Question("porosity", "porosity of the flow", "share", 0.05, 0.95),
        Question("grain_density", "density of the grains", "density", 1000.0, 6000.0, 2650.0),
        Question("liquid_density", "density of the liquid", "density", 500.0, 2000.0, 1000.0),
        Question("friction_angle", "friction angle of the grains", "angle", 0.0, 60.0, 30.0),
        Question("conductivity", "hydraulic conductivity of the flow", "conductivity", 1e-12, 10.0, 1e-3),
        Question("ground_friction", "friction coefficient of the ground", "coefficient", 0.0, 10.0, 0.3),
        Question("height", "height of the barrier", "length", 0.05, 200.0),
        Question("crest", "width of the barrier's crest", "length", 0.0, 500.0, 1.0),
        Question("face_angle", "angle of the barrier's faces with the ground", "angle", 5.0, 90.0, 75.0),
        Question("mass", "mass of the barrier", "mass", 1.0, 1e8),
        Question("barrier_density", "density of the barrier", "density", 50.0, 10_000.0, 2000.0),
        Question("base_friction", "friction coefficient under the barrier", "coefficient", 0.0, 10.0, 0.5),
        Question("face_friction", "friction coefficient of the flow on the barrier", "coefficient", 0.0, 10.0, 0.3),
        Question("distance", "distance of the front from the barrier at the start", "length", 0.0, 1000.0),
        Question("spacing", "spacing of the grid", "length", 1e-3, 100.0),
        Question("until", "simulated time", "time", 0.01, 10_000.0),
    )
}

ONE_OF = (("length", "volume"), ("bulk_density", "water_content", "porosity"), ("mass", "barrier_density"))
"""Of each of these only one may be given."""

NEEDED = (("depth",), ("length", "volume"), ("speed",), ("height",))
"""Of each of these one must be."""

ASKED = (
    *("depth", "length", "speed", "slope", "bulk_density", "height", "crest", "face_angle", "barrier_density"),
    "base_friction",
)
"""What is asked for on a terminal where neither it nor what stands in its place is given."""


@dataclass(frozen=True)
class Decided:
    """One line of what a new scenario rests on."""

    words: str
    value: str
    origin: str
    """given, assumed, or how it was computed."""


FOLLOWS = ("computed", "its mass over its section")
"""Origins of what the scenario itself tells at any time, which no note says, lest the one change without the other."""

NOTED = {
    "numerics.spacing_m": "spacing",
    "output.end_time_s": "until",
    "flow.shape.depth_m": "depth",
    "flow.shape.distance_m": "distance",
    "flow.velocity_m_per_s.0": "speed",
    "gravity.tilt_deg": "slope",
    "flow.material.porosity": "porosity",
    "flow.material.grain_density_kg_per_m3": "grain_density",
    "flow.material.liquid_density_kg_per_m3": "liquid_density",
    "flow.material.friction_angle_deg": "friction_angle",
    "flow.material.hydraulic_conductivity_m_per_s": "conductivity",
    "ground.friction": "ground_friction",
    "barrier.shape.height_m": "height",
    "barrier.shape.crest_width_m": "crest",
    "barrier.shape.face_angle_deg": "face_angle",
    "barrier.motion.density_kg_per_m3": "barrier_density",
    "barrier.motion.base_friction": "base_friction",
    "barrier.friction": "face_friction",
}
"""Fields of a scenario and the questions that ask for them."""


def notes_still_true(notes: Sequence[str], changed: Collection[str]) -> list[str]:
    """Notes of a scenario that was made here, without those on fields that were changed since."""
    gone = tuple(f"{QUESTIONS[NOTED[path]].words}: " for path in changed if path in NOTED)
    return [note for note in notes if not note.startswith(gone)]


def missing(given: Mapping[str, Any]) -> list[str]:
    """One sentence for each thing that must be given and is not."""
    found = []
    for names in NEEDED:
        if all(given.get(name) is None for name in names):
            options = " or ".join(QUESTIONS[name].option for name in names)
            question = QUESTIONS[names[0]]
            found.append(f"{options} is missing; it must be given: {question.words}, a number in {question.unit}.")
    return found


def conflicts(given: Mapping[str, Any]) -> list[str]:
    """One sentence for each pair of which only one may be given."""
    found = []
    for names in ONE_OF:
        there = [QUESTIONS[name].option for name in names if given.get(name) is not None]
        if len(there) > 1:
            found.append(f"{' and '.join(there)} are both given; give only one.")
    return found


def open_questions(given: Mapping[str, Any], *, sliding: bool = True) -> list[Question]:
    """What is to be asked for, where somebody can be asked."""
    answered = {name for name, value in given.items() if value is not None}
    for names in ONE_OF:
        if answered & set(names):
            answered |= set(names)
    skipped = set() if sliding else {"base_friction", "barrier_density"}
    return [QUESTIONS[name] for name in ASKED if name not in answered | skipped]


def new_scenario(
    given: Mapping[str, str | None],
    *,
    title: str | None = None,
    sliding: bool = True,
    dry: bool = False,
    limits: Mapping[str, float] | None = None,
) -> tuple[dict[str, Any], list[Decided]]:
    """A scenario file's content, and what it rests on.

    Args:
        given: texts by the names of `QUESTIONS`, each a number with or without a unit; None: not given.
        title: of the scenario; None: made of its figures.
        sliding: whether the barrier slides on its base; a fixed one gets its weight for the verdict alone.
        dry: no liquid.
        limits: fields of the scenario's `design` group.

    Raises:
        ValueError: one sentence for each value that is missing, not allowed, or at odds with another.
    """
    problems = conflicts(given) + missing(given)
    values: dict[str, float] = {}
    for name, text in given.items():
        if text is not None:
            try:
                values[name] = QUESTIONS[name].value(text)
            except ValueError as error:
                problems.append(str(error))
    if problems:
        raise ValueError("\n".join(problems))
    site = _Site(values)
    content = site.content(sliding=sliding, dry=dry)
    content["design"] = content.get("design", {}) | dict(limits or {})
    site.told += [Decided(f"limit {name}", f"{value:g}", "given") for name, value in (limits or {}).items()]
    made = f"{'Dry flow' if dry else 'Flow'} of {values['depth']:g} m at {values['speed']:g} m/s"
    height, slope = values["height"], values.get("slope", 0.0)
    where = f" on {slope:g}°" if slope else ""
    kind = "sliding" if sliding else "fixed"
    head = {
        "title": title or f"{made}{where} against a {kind} barrier of {height:g} m",
        "source": "Made by warp-mpm init.",
        "notes": [
            f"{one.words}: {one.value} ({one.origin})" for one in site.told if one.origin not in ("given", *FOLLOWS)
        ],
    }
    return head | content, site.told


class _Site:
    """The values that were given, and what is decided on their ground, in the order in which it is told."""

    def __init__(self, values: Mapping[str, float]):
        self.values = values
        self.told: list[Decided] = []

    def content(self, *, sliding: bool, dry: bool) -> dict[str, Any]:
        depth = self.value("depth")
        length = self.length(depth)
        speed, slope = self.value("speed"), self.value("slope")
        distance = self.chosen("distance", round(0.5 * depth, 6), "half of the flow's depth")
        material = self.material(dry=dry)
        ground = self.value("ground_friction")
        barrier, design = self.barrier(sliding=sliding)
        density = material["grain_density_kg_per_m3"] * (1.0 - material["porosity"])
        density += 0.0 if dry else material["liquid_density_kg_per_m3"] * material["porosity"]
        self.tell("mass of the flow", _mass(density * depth * length), "computed")
        height = self.values["height"]
        spacing = depth / CELLS
        spacing = self.chosen(
            "spacing",
            round(height / max(round(height / spacing), 1), 6),
            "some six cells in the depth, crest on a line",
        )
        # Twice the time in which all of the flow passes, and a second in which the barrier comes to rest.
        passing = 2.0 * (distance + length + 2.0 * depth) / max(speed, math.sqrt(STANDARD_GRAVITY * depth))
        until = self.chosen("until", math.ceil(2.0 * (1.0 + passing)) / 2.0, "twice the flow's passing, and a second")
        return {
            "gravity": {"tilt_deg": slope},
            "flow": {
                "formulation": "dry" if dry else "two_phase",
                "shape": {"kind": "front_and_tail", "depth_m": depth, "length_m": length, "distance_m": distance},
                "velocity_m_per_s": [speed, 0.0],
                "material": material,
            },
            "ground": {"friction": ground},
            "barrier": barrier,
            "numerics": {"spacing_m": spacing},
            "output": {"end_time_s": until},
            "design": design,
        }

    def length(self, depth: float) -> float:
        """L [m], at least the 2 h of front and tail."""
        if "volume" in self.values:
            volume = self.value("volume")
            length = self.computed("length", round(volume / depth, 9), "volume over depth")
            what, least = "volume", 2.0 * depth**2
            given = volume
        else:
            length = given = self.value("length")
            what, least = "length", 2.0 * depth
        if given < least * (1.0 - 1e-9):
            question = QUESTIONS[what]
            raise ValueError(
                f"{question.option} = {given:g} is not allowed; it must be at least {least:g} {question.unit}: front "
                "and tail of the flow alone have as much."
            )
        return length

    def material(self, *, dry: bool) -> dict[str, Any]:
        """The flow's material, with the porosity from what was given of it."""
        grains = self.value("grain_density")
        liquid = 0.0 if dry else self.value("liquid_density")
        porosity = self.porosity(grains, liquid, dry=dry)
        found = {"grain_density_kg_per_m3": grains, "porosity": porosity}
        if not dry:
            found |= {
                "liquid_density_kg_per_m3": liquid,
                "liquid_bulk_modulus_Pa": 3e7,
                "hydraulic_conductivity_m_per_s": self.value("conductivity"),
            }
            self.tell("bulk modulus of the liquid", "30 MPa", "assumed, softened for the time step")
        self.tell("Young's modulus of the skeleton", "2 MPa", "assumed")
        return found | {
            "young_modulus_Pa": 2e6,
            "poisson_ratio": 0.25,
            "friction_angle_deg": self.value("friction_angle"),
        }

    def porosity(self, grains: float, liquid: float, *, dry: bool) -> float:
        """n [-]; of a saturated flow from ρ = (1 - n) ρ_s + n ρ_L, or from w = n ρ_L / ((1 - n) ρ_s)."""
        if "bulk_density" in self.values:
            bulk = self.value("bulk_density")
            if not liquid < bulk < grains:
                least = f"above that of the liquid, {liquid:g}, and " if liquid else ""
                raise ValueError(
                    f"--bulk-density = {bulk:g} is not allowed; it must be {least}below that of the grains, {grains:g} "
                    "kg/m3."
                )
            porosity, origin = (grains - bulk) / (grains - liquid), "from the bulk density"
        elif "water_content" in self.values:
            water = self.value("water_content")
            if dry or water == 0.0:
                raise ValueError("--water-content is for a flow with a liquid and above 0; a dry one has --dry.")
            porosity, origin = water * grains / (liquid + water * grains), "from the water content"
        elif "porosity" in self.values:
            porosity = self.value("porosity")
            self.tell("bulk density", _density((1.0 - porosity) * grains + porosity * liquid), "computed")
            return porosity
        else:
            porosity, origin = POROSITY, "assumed"
        porosity = self.computed("porosity", round(porosity, 9), origin)
        if not 0.0 < porosity < 1.0:
            raise ValueError(f"The porosity would be {porosity:g}; it must be above 0 and below 1.")
        if "bulk_density" not in self.values:
            self.tell("bulk density", _density((1.0 - porosity) * grains + porosity * liquid), "computed")
        return porosity

    def barrier(self, *, sliding: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        """The barrier, and what of it stands in the `design` group."""
        height, crest, angle = self.value("height"), self.value("crest"), self.value("face_angle")
        cotangent = 0.0 if angle == 90.0 else 1.0 / math.tan(math.radians(angle))
        base = crest + 2.0 * height * cotangent
        if base <= 0.0:
            raise ValueError("--crest = 0 with --face-angle = 90 makes no barrier; one of them must change.")
        area = 0.5 * (base + crest) * height
        self.tell("base width of the barrier", f"{base:.4g} m", "computed")
        if "mass" in self.values:
            density = self.value("mass") / area
            self.tell("density of the barrier", _density(density), "its mass over its section")
        else:
            density = self.value("barrier_density")
            self.tell("mass of the barrier", _mass(density * area), "computed")
        friction = self.value("base_friction")
        barrier: dict[str, Any] = {
            "shape": {"kind": "trapezoid", "crest_width_m": crest, "height_m": height, "face_angle_deg": angle},
            "motion": {"kind": "fixed"},
            "friction": self.value("face_friction"),
        }
        if not sliding:
            return barrier, {"density_kg_per_m3": density, "base_friction": friction}
        weight = {"mass_kg_per_m": self.values["mass"]} if "mass" in self.values else {"density_kg_per_m3": density}
        barrier["motion"] = {"kind": "sliding", **weight, "base_friction": friction}
        return barrier, {}

    def value(self, name: str) -> float:
        """The given value, or the default."""
        question = QUESTIONS[name]
        if name in self.values:
            self.tell(question.words, _shown(question, self.values[name]), "given")
            return self.values[name]
        assert question.default is not None
        self.tell(question.words, _shown(question, question.default), "assumed")
        return question.default

    def chosen(self, name: str, value: float, origin: str) -> float:
        """The given value, or the one that was chosen for it."""
        return self.value(name) if name in self.values else self.computed(name, value, origin)

    def computed(self, name: str, value: float, origin: str) -> float:
        self.tell(QUESTIONS[name].words, _shown(QUESTIONS[name], value), origin)
        return value

    def tell(self, words: str, value: str, origin: str) -> None:
        self.told.append(Decided(words, value, origin))


def _shown(question: Question, value: float) -> str:
    if question.kind == "density":
        return _density(value)
    if question.kind == "mass":
        return _mass(value)
    return f"{value:.6g} {question.unit}".rstrip()


def _density(value: float) -> str:
    return f"{value:,.6g} kg/m3 = {value / 1000.0:.4g} t/m3 = {value / KILONEWTON:.4g} kN/m3"


def _mass(value: float) -> str:
    return f"{value:,.8g} kg/m = {value / 1000.0:.4g} t/m = {value / KILONEWTON:,.4g} kN/m"


def asked(
    given: Mapping[str, str | None],
    *,
    sliding: bool,
    prompt: Callable[[str, str], str],
    complain: Callable[[str], None],
) -> dict[str, str | None]:
    """What was given, with answers to what is missing.

    Args:
        given: as in `new_scenario`.
        sliding: as there.
        prompt: asks a question, with the answer that is taken where none is given ("": there is none).
        complain: tells why an answer is not taken.
    """
    answers = dict(given)
    for question in open_questions(given, sliding=sliding):
        default = question.default
        if question.name == "bulk_density":
            default = 2650.0 - POROSITY * 1650.0
        text = "" if default is None else f"{default:g}"
        while True:
            answer = prompt(f"{question.words} [{question.unit or '-'}]", text).strip()
            try:
                question.value(answer)
            except ValueError as error:
                complain(str(error))
                continue
            break
        if answer != text or question.name == "bulk_density":
            answers[question.name] = answer
    return answers
