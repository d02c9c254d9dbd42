"""Limits on key figures, as they are typed: `displacement <= 0.5`, `overtopped <= 20 %`, `peak_force <= 300 kN/m`."""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warp_mpm.design_checks import CHECKS, Check
from warp_mpm.quantities import Quantity
from warp_mpm.quantities.figures import NUMBERS
from warp_mpm.scenario import Design, Scenario
from warp_mpm.scenario_errors import ScenarioError

SYNONYMS = {"overtopped": "overtopped_share", "peak": "peak_force_filtered", "run_up": "run_up_max"}
"""Shorter words for figures."""

FIGURES_OF_LIMITS: Mapping[str, Quantity] = {
    name: quantity
    for name, quantity in {**NUMBERS, **CHECKS}.items()
    if name not in ("barrier_at_rest", "barriers", "force_still_rises", "wall_time")
}
"""What a limit may be on: the numbers of `summary.json` and of its verdict, whose words come first."""

DESIGN_FIELDS = {
    "displacement": "displacement_m",
    "sliding_factor": "sliding_factor",
    "overturning_factor": "overturning_factor",
    "eccentricity_of_base": "eccentricity_of_base",
    "base_pressure": "bearing_resistance_Pa",
    "overtopped_share": "overtopped_share",
    "overtopped_volume": "overtopped_volume_m3_per_m",
    "freeboard": "freeboard_m",
}
"""Fields of a scenario's `design` group by the figures that they limit."""

MORE_UNITS = {"m": {"cm": 1e-2, "mm": 1e-3}, "Pa": {"MPa": 1e6}, "N/m": {"MN/m": 1e6}}
"""Units that a limit may have beside that of the files and that which people are shown, with the factors to SI."""

FORM = re.compile(r"\s*(\w+)\s*(<=|>=|<|>|≤|≥)\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*)?\s*")

DISPLACEMENTS = ("displacement", "barrier_displacement_final")

FARTHEST = 3.0
"""Greatest distance from a limit that counts, as a logarithm: beyond it only the side matters."""


@dataclass(frozen=True)
class Limit:
    """A bound on a figure."""

    name: str
    """Of `FIGURES_OF_LIMITS`."""
    bound: float
    """SI."""
    least: bool
    """Whether it is the least allowed; the greatest otherwise."""

    @property
    def quantity(self) -> Quantity:
        return FIGURES_OF_LIMITS[self.name]

    @property
    def text(self) -> str:
        """As people read it: `displacement ≤ 0.5 m`."""
        return f"{self.quantity.words} {'≥' if self.least else '≤'} {self.shown(self.bound)}"

    def shown(self, value: float | None) -> str:
        """A value of the figure with its unit."""
        return "–" if value is None else self.quantity.text(value).removesuffix(" -")

    def excess(self, figures: Mapping[str, Any]) -> float:
        """How far the figure is beyond the limit: above 0 it is broken, at most 0 it is kept; between -3 and 3.

        The logarithm of their ratio, which is nearly straight over the mass of a barrier; of a limit of 0 or less,
        the difference over the flow's own scale of 1. A displacement that is not final has no other excess than above
        0. A factor of safety that there is no load for keeps any limit; any other figure that is not known breaks it.
        """
        value = figures.get(self.name)
        if value is None:
            unloaded = self.least and isinstance(self.quantity, Check) and self.name in figures
            return -FARTHEST if unloaded else FARTHEST
        if self.name in DISPLACEMENTS and figures.get("barrier_at_rest") is False and value <= self.bound:
            return 0.1
        if self.bound > 0.0:
            ratio = math.log(max(value, 1e-30) / self.bound)
            found = -ratio if self.least else ratio
        else:
            found = (self.bound - value) if self.least else (value - self.bound)
        return min(max(found, -FARTHEST), FARTHEST)


def read_limits(texts: Iterable[str]) -> tuple[Limit, ...]:
    """Limits as they were typed.

    Raises:
        ValueError: one sentence for each that cannot be read, with names that are near where the name is unknown.
    """
    found, problems = [], []
    for text in texts:
        try:
            found.append(_limit(text))
        except ValueError as error:
            problems.append(str(error))
    names = [limit.name for limit in found]
    problems += [
        f"--limit on {name} is given twice; give one." for name in dict.fromkeys(names) if names.count(name) > 1
    ]
    if problems:
        raise ValueError("\n".join(problems))
    return tuple(found)


def _limit(text: str) -> Limit:
    parts = FORM.fullmatch(text)
    if parts is None:
        raise ValueError(
            f"--limit {json.dumps(text, ensure_ascii=False)} is not allowed; it must read FIGURE <= NUMBER or "
            'FIGURE >= NUMBER, with a unit if need be: "displacement <= 0.5 m".'
        )
    word, sign, number, unit = parts.groups()
    name = SYNONYMS.get(word, word)
    if name not in FIGURES_OF_LIMITS:
        raise ValueError(f"--limit {word}: there is no such figure; {near(word)}")
    quantity, least = FIGURES_OF_LIMITS[name], sign[0] in ">≥"
    if isinstance(quantity, Check) and quantity.least is not least:
        right = ">=" if quantity.least else "<="
        raise ValueError(
            f"--limit {word} {sign} {number} is not allowed; it must be {word} {right} NUMBER: "
            f"{quantity.meaning} has a {'least' if quantity.least else 'greatest'} value."
        )
    value = float(number)
    if not math.isfinite(value):
        raise ValueError(f"--limit {word}: {number} must be a finite number.")
    bound = value * _factor(quantity, unit, word)
    refused = _beyond_range(name, bound)
    if refused is not None:
        percent = quantity.unit == "-" and unit is None and bound > 0.0 and _beyond_range(name, 0.01 * bound) is None
        meant = f"; {number} % was probably meant" if percent else ""
        typed = f"{word} {sign} {number}" if unit is None else f"{word} {sign} {number} {unit.strip()}"
        raise ValueError(f"--limit {typed} is not allowed; {refused}{meant}.")
    return Limit(name, bound, least)


def _beyond_range(name: str, bound: float) -> str | None:
    """What a limit must be that the `design` group has a field for and that this is not [SI]; None where it is."""
    field = DESIGN_FIELDS.get("displacement" if name in DISPLACEMENTS else name)
    if field is None:
        return None
    try:
        Design.model_validate({field: bound})
    except ScenarioError as error:
        return error.problems[0].partition("not allowed; ")[2].rstrip(".")
    return None


def _factor(quantity: Quantity, unit: str | None, word: str) -> float:
    """From the unit that was typed to SI."""
    units = {quantity.unit: 1.0, quantity.shown_unit: 1.0 / quantity.factor} | MORE_UNITS.get(quantity.unit, {})
    if quantity.unit == "-":
        units = {"": 1.0, "-": 1.0, "%": 0.01}
    if unit is None:
        return 1.0
    plain = {name.replace("³", "3"): factor for name, factor in units.items()}
    wanted = unit.strip().replace("³", "3")
    if wanted not in plain:
        raise ValueError(
            f"--limit {word}: {unit} is no unit of it; it must be one of {', '.join(filter(None, plain))}."
        )
    return plain[wanted]


def near(word: str) -> str:
    """A sentence's end with the names that are like a word."""
    known = [*FIGURES_OF_LIMITS, *SYNONYMS]
    close = difflib.get_close_matches(word, known, n=4, cutoff=0.5)
    close += [name for name in known if word.lower() in name and name not in close][:4]
    named = close or ["displacement", "overtopped", "sliding_factor", "peak_force_filtered"]
    return f"near it are {', '.join(named)}; python -m warp_mpm quantities lists the figures."


def limits_of(scenario: Scenario) -> tuple[Limit, ...]:
    """The limits of a scenario's `design` group."""
    design = scenario.design
    if design is None:
        return ()
    found = []
    for name, field in DESIGN_FIELDS.items():
        bound = getattr(design, field)
        if bound is not None:
            factor = design.bearing_factor if name == "base_pressure" else 1.0
            found.append(Limit(name, bound / factor, CHECKS[name].least))
    return tuple(found)


def design_fields(limits: Sequence[Limit]) -> dict[str, float]:
    """Limits as fields of a scenario's `design` group.

    Raises:
        ValueError: one is on a figure that the group has no field for.
    """
    names = {"barrier_displacement_final": "displacement"}
    found = {}
    for limit in limits:
        name = names.get(limit.name, limit.name)
        if name not in DESIGN_FIELDS:
            raise ValueError(
                f"--limit {limit.name}: the design group of a scenario has no limit on it; it has "
                f"{', '.join(DESIGN_FIELDS)}."
            )
        found[DESIGN_FIELDS[name]] = limit.bound
    return found


def without_limits(scenario: Scenario) -> Scenario:
    """The scenario with a `design` group that judges nothing, so that the verdict's figures are told."""
    design = scenario.design or Design()
    return scenario.replaced({"design": design.model_dump(mode="json") | dict.fromkeys(DESIGN_FIELDS.values())})


def figures_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of a summary and of its verdict, by the names that limits have."""
    checks = (summary.get("verdict") or {}).get("checks", [])
    return {**summary, **{check["name"]: check["value"] for check in checks}}


def excess(limits: Sequence[Limit], figures: Mapping[str, Any]) -> float:
    """The greatest excess over all limits; at most 0 where all are kept."""
    return max(limit.excess(figures) for limit in limits)
