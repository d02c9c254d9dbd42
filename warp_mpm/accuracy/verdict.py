"""What a study says: the cheapest choices, what each percent costs, and what each setting and each effect is worth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warp_mpm.accuracy.budget import LABELS, TOGETHER
from warp_mpm.accuracy.errors import QUANTITIES, References, errors, ladder_of, overall, references
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import DEFAULT, Setting, level_text
from warp_mpm.scenario import Scenario

TARGETS = (0.10, 0.05, 0.02, 0.01)
"""Errors whose price is told."""

DEFAULT_TARGET = 0.05
"""Error of the key quantities that a default spacing should keep."""


LADDER = 3
"""Least number of spacings from which a setting's error is believed."""

NEGLIGIBLE = 0.003
"""Change of the error that is none."""

UNEXPLAINED = 0.25
"""Share of what the errors' logarithms vary that a straight line may leave, if it is to tell how the errors fall."""


@dataclass(frozen=True)
class Row:
    """A setting and what came of it."""

    setting: Setting
    result: Result
    errors: dict[str, float]
    """Relative errors by quantity; empty where the run diverged."""
    overall: float
    """Greatest error of the key quantities."""

    @property
    def time(self) -> float:
        """CPU time of stepping [s]."""
        return float(self.result["cpu_time"])


@dataclass(frozen=True)
class Effect:
    """What leaving an effect out does to the answer and to the time."""

    name: str
    changes: dict[str, float]
    """Relative change of each quantity from the whole scene at the same spacing."""
    time_ratio: float
    """CPU time over that of the whole scene."""


@dataclass(frozen=True)
class Knob:
    """One setting turned alone."""

    name: str
    level: Any
    time_ratio: float
    """CPU time over that of the default at the same spacing."""
    overall: float
    """Greatest error of the key quantities, like that of..."""
    default_overall: float
    """...the default at the same spacing."""
    doubt: float
    """Greatest relative uncertainty of the key quantities' references."""

    @property
    def verdict(self) -> str:
        """In words."""
        if not math.isfinite(self.overall):
            return "diverges"
        # Times of short runs scatter by a tenth.
        time = "dearer" if self.time_ratio > 1.25 else "cheaper" if self.time_ratio < 0.8 else "no dearer"
        worse = self.overall - self.default_overall
        if abs(worse) <= NEGLIGIBLE:
            return "buys nothing" if time == "dearer" else f"no difference, {time}"
        if abs(worse) <= self.doubt:
            what = (
                "buys nothing that could be told" if time == "dearer" else f"no difference that could be told, {time}"
            )
            return f"{what} (doubt {self.doubt:.1%})"
        if worse > 0.0:
            return f"less accurate, {time}"
        return f"more accurate, {time}"


@dataclass(frozen=True)
class Slope:
    """How an error falls along the ladder of the scenario's own settings, above the spacing's part of the doubt.

    What the settings do that all spacings share is the same mistake in the runs and in the reference, so it hides no
    order of the spacing.
    """

    cost: float | None
    """x in error ~ cost^-x; None where it does not fall like that."""
    spacing: float | None
    """p in error ~ spacing^p; None where it does not fall like that."""

    def __str__(self) -> str:
        parts = []
        if self.cost is not None:
            parts.append(f"error ~ cost^-{self.cost:.2g}")
        if self.spacing is not None:
            parts.append(f"{'' if parts else 'error '}~ spacing^{self.spacing:.2g}")
        return ", ".join(parts) or "no order seen"


@dataclass(frozen=True)
class Study:
    """The whole of a study, evaluated."""

    scenario: Scenario
    references: References
    rows: list[Row]
    """Without the runs that left an effect out, and without those that were refined for the reference's sake."""
    refined: list[Row]
    """Runs that tell what the settings do that the ladder shares."""
    effects: list[Effect]
    knobs: list[Knob]
    fronts: dict[str, list[Row]] = field(repr=False)
    """By quantity and for `overall`: the cheapest choices, cheap first."""
    slopes: dict[str, Slope] = field(repr=False)
    """How the error falls with cost and spacing, by the same names."""

    def price(self, name: str, target: float) -> Row | None:
        """The cheapest setting that keeps an error; None where none does.

        A setting counts by the greatest of its own error and those of the finer ones of its ladder: that two errors
        cancel at one spacing is no accuracy. No setting keeps less than what the reference is known to.
        """
        if self.doubt(name) > target or (name in QUANTITIES and not QUANTITIES[name].converges):
            return None
        kept = [row for row in self.rows if self._lasting(row, name) <= target]
        return min(kept, key=lambda row: row.time, default=None)

    def doubt(self, name: str) -> float:
        """Relative uncertainty of a quantity's reference; for `overall` the greatest of the key quantities'."""
        return self.references.uncertainty(self.worst if name == "overall" else name)

    def spacing_doubt(self, name: str) -> float:
        """The spacing's part of that uncertainty; for `overall` the greatest of the key quantities'."""
        names = self.references.key_names if name == "overall" else [name]
        return max(self.references.budget.spacing[key] for key in names)

    @property
    def worst(self) -> str:
        """The key quantity whose reference is known least."""
        return max(self.references.key_names, key=self.references.uncertainty)

    @property
    def recommended_spacing(self) -> float | None:
        """Coarsest spacing of the scenario's own settings that keeps `DEFAULT_TARGET`, as all finer do [m]; or None, as
        where the reference is not known that well."""
        if self.doubt("overall") > DEFAULT_TARGET:
            return None
        ladder = [row for row in self.rows if row.setting.knob == DEFAULT]
        kept = [row.setting.spacing for row in ladder if self._lasting(row, "overall") <= DEFAULT_TARGET]
        return max(kept, default=None)

    @property
    def default_beaten_by(self) -> Row | None:
        """A setting that is cheaper than the scenario's own and more accurate beyond doubt; None: it is on the front.

        CPU times scatter by a few per cent, so a setting must be 10 % cheaper to count.
        """
        default = next((row for row in self.rows if _is_own(row, self.scenario) and row.errors), None)
        if default is None:
            return None
        margin = max(self.doubt("overall"), 0.002)
        better = []
        for row in self.rows:
            # The default's ladder goes on to finer spacings, which must not count against it alone.
            finest = min(peer.setting.spacing for peer in self._ladder(row))
            lasting = self._lasting(default, "overall", finest=min(finest, default.setting.spacing))
            if row.time < 0.9 * default.time and self._lasting(row, "overall") < lasting - margin:
                better.append(row)
        return min(better, key=lambda row: row.overall, default=None)

    def _ladder(self, row: Row) -> list[Row]:
        """The runs that differ from a row in nothing but the spacing, and itself."""
        setting = row.setting
        return [
            other for other in self.rows if (other.setting.knob, other.setting.level) == (setting.knob, setting.level)
        ]

    def _lasting(self, row: Row, name: str, *, finest: float = 0.0) -> float:
        """Greatest error of a setting and of the finer ones of its ladder, down to the spacing `finest` [m]; infinite
        where it has no ladder."""
        ladder = self._ladder(row)
        if not row.errors or len(ladder) < LADDER:
            return math.inf
        return max(error_of(other, name) for other in ladder if finest <= other.setting.spacing <= row.setting.spacing)


def error_of(row: Row, name: str) -> float:
    """Magnitude of a row's error of a quantity or `overall`; infinite where there is none."""
    return row.overall if name == "overall" else abs(row.errors.get(name, math.inf))


def evaluate(scenario: Scenario, settings: Sequence[Setting], results: Mapping[str, Result]) -> Study:
    """Errors, fronts and prices of a study whose runs are done.

    Raises:
        ValueError: fewer than three spacings of the scenario's own settings came to their end.
    """
    shared = [setting for setting in settings if setting.refined]
    found = references(scenario, ladder_of(settings), results, shared)
    rows = []
    for setting in settings:
        result = results[setting.key]
        wrong = errors(result, found) if result["status"] == "finished" else {}
        rows.append(Row(setting, result, wrong, overall(wrong, found)))
    numeric = [row for row in rows if not row.setting.physics and not row.setting.refined]
    default = {row.setting.spacing: row for row in numeric if row.setting.knob == DEFAULT}
    effects = [
        Effect(row.setting.knob, _changes(row, default[row.setting.spacing], found), _ratio(row, default))
        for row in rows
        if row.setting.physics and row.setting.spacing in default and row.errors
    ]
    doubt = max((found.uncertainty(name) for name in found.key_names), default=0.0)
    alone = _turned_alone(numeric)
    knobs = [
        Knob(
            row.setting.knob,
            row.setting.level,
            _ratio(row, default),
            row.overall,
            default[row.setting.spacing].overall,
            doubt,
        )
        for row in alone
    ]
    fronts = {name: front(numeric, name, found.uncertainty(name)) for name in found.names}
    fronts["overall"] = front(numeric, "overall", doubt)
    refined = [row for row in rows if row.setting.refined]
    study = Study(scenario, found, numeric, refined, effects, knobs, fronts, {})
    for name in fronts:
        above = sloping(study, name)
        cost = _falling([(1.0 / row.time, error_of(row, name)) for row in above if row.time > 0.0])
        study.slopes[name] = Slope(cost, _falling([(row.setting.spacing, error_of(row, name)) for row in above]))
    return study


def sloping(study: Study, name: str) -> list[Row]:
    """The runs of the ladder of the scenario's own settings from whose errors it is told how these fall: those above
    the spacing's part of the doubt, without a run that is itself the reference."""
    known = study.references
    names = known.key_names if name == "overall" else [name]
    extrapolated = all(key in known.scalars and known.scalars[key].order is not None for key in names)
    return [
        row
        for row in study.rows
        if row.setting.knob == DEFAULT
        and (extrapolated or row.result is not known.finest)
        and study.spacing_doubt(name) < error_of(row, name) < math.inf
    ]


def _falling(points: Sequence[tuple[float, float]]) -> float | None:
    """Power with which the second of each pair falls with the first; None where they are too few, or it does not."""
    if len(points) < LADDER:
        return None
    size, error = np.log(np.array(points)).T
    slope, offset = np.polyfit(size, error, 1)
    rest = float(np.sum((error - slope * size - offset) ** 2))
    straight = rest <= UNEXPLAINED * float(np.sum((error - error.mean()) ** 2))
    return float(slope) if slope > 0.0 and straight else None


def front(rows: Sequence[Row], name: str, doubt: float = 0.0) -> list[Row]:
    """The Pareto front of error against time: no other row is both cheaper and more accurate.

    Errors below the relative `doubt` of the reference are all alike, so the front ends with the first of them.
    """
    kept: list[Row] = []
    for row in sorted(rows, key=lambda row: row.time):
        error = max(error_of(row, name), doubt)
        if math.isfinite(error) and (not kept or error < max(error_of(kept[-1], name), doubt)):
            kept.append(row)
    return kept


def sentences(study: Study) -> list[str]:
    """What a person wants to read off."""
    said = []
    for name in ["overall", *study.references.told_names]:
        label = "the key figures" if name == "overall" else QUANTITIES[name].label
        cheapest = {}
        for target in TARGETS:  # of a setting that keeps several, the tightest is told
            row = study.price(name, target)
            if row is not None:
                cheapest[row.setting.name] = f"{target:.0%} costs {row.time:.2g} s ({row.setting.name})"
        prices = list(cheapest.values())
        best = min((error_of(row, name) for row in study.rows), default=math.inf)
        doubt = study.doubt(name)
        if doubt > TARGETS[0]:
            said.append(f"{label}: the reference is known to {doubt:.1%} only, so no setting is known to keep less.")
            continue
        answer = "; ".join(prices) if prices else f"no run keeps {TARGETS[0]:.0%}, the best is off by {best:.1%}"
        said.append(f"{label}: {answer}; the reference is known to {doubt:.1%}.")
    said += _known_to(study)
    said.append(
        f"As the spacing falls, down to its own part of the uncertainty of the key figures, "
        f"{study.spacing_doubt('overall'):.1%}: {study.slopes['overall']}."
    )
    for knob in study.knobs:
        said.append(
            f"{knob.name} {level_text(knob.level)}: {knob.verdict}: {knob.time_ratio:.2g} times the time, error "
            f"{_percent(knob.overall)} where the default has {_percent(knob.default_overall)}."
        )
    said.append(_place_of_default(study))
    spacing = study.recommended_spacing
    said.append(
        f"No spacing of this study is known to keep {DEFAULT_TARGET:.0%} on the key figures."
        if spacing is None
        else f"Recommended spacing: {spacing:g} m, the coarsest that keeps {DEFAULT_TARGET:.0%} on the key figures, as "
        "all finer ones do."
    )
    return said


def _known_to(study: Study) -> list[str]:
    """What limits the reference, in words."""
    budget = study.references.budget
    if budget.at is None:
        return ["What the settings do that all runs share was not looked at: the uncertainty is the spacing's alone."]
    name = study.worst
    twice = ", whose effect is the same at two spacings and so counts twice" if budget.stays(name) else ""
    said = [
        f"The {QUANTITIES[name].label} is known least, to {budget.total(name):.1%}: {budget.spacing[name]:.1%} from "
        f"the spacing, {budget.shared(name):.1%} from the settings that all spacings share{twice}; "
        f"{budget.greatest(name)} contributes most."
    ]
    said += [
        f"With the {LABELS.get(setting, TOGETHER)} refined the run diverged, so the uncertainty lacks that part."
        for setting in budget.lost
    ]
    return said


def _place_of_default(study: Study) -> str:
    """Whether the scenario's own settings are on the front, and of what."""
    subject = f"The scenario's own settings (spacing {study.scenario.numerics.spacing_m:g} m)"
    beaten = study.default_beaten_by
    if beaten is not None:
        return f"{subject} are beaten by {beaten.setting.name}, in the key figures and beyond doubt."
    own = [
        QUANTITIES[name].label if name in QUANTITIES else "the key figures together"
        for name, rows in study.fronts.items()
        if any(_is_own(row, study.scenario) for row in rows)
    ]
    places = f"; they are on the front of {', '.join(own)}" if own else ""
    return f"{subject} are beaten by none beyond the doubt of {study.doubt('overall'):.1%}{places}."


def _is_own(row: Row, scenario: Scenario) -> bool:
    return row.setting.knob == DEFAULT and row.setting.spacing == scenario.numerics.spacing_m


def _turned_alone(rows: Sequence[Row]) -> list[Row]:
    """The rows of knobs turned at one spacing; of a knob that has a ladder, the row at that spacing."""
    at = {row.setting.spacing for row in rows if row.setting.knob == "courant_number"}
    single = [row.setting for row in rows if row.setting.knob == "drag"]
    return [row for row in rows if row.setting.knob != DEFAULT and (row.setting.spacing in at or row.setting in single)]


def _percent(value: float) -> str:
    return f"{value:.1%}" if math.isfinite(value) else "none"


def _ratio(row: Row, default: Mapping[float, Row]) -> float:
    return row.time / max(default[row.setting.spacing].time, 1e-9)


def _changes(row: Row, whole: Row, found: References) -> dict[str, float]:
    return {
        name: row.errors[name] - whole.errors[name]
        for name in found.scalars
        if name in row.errors and name in whole.errors
    }
