"""The lightest barrier that keeps limits, by coarse runs, held against finer ones."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from analytic.design import displacement
from analytic.fitted import coefficients
from analytic.scene import SceneError, scene_of
from warp_mpm import geometry
from warp_mpm.accuracy.errors import extrapolate
from warp_mpm.by_simulation.fields import Range, number_at, with_values
from warp_mpm.by_simulation.lightest import Box, Point, Search, Tried
from warp_mpm.by_simulation.limits import DESIGN_FIELDS, DISPLACEMENTS, Limit, excess
from warp_mpm.by_simulation.runs import Run, coarse, untouched
from warp_mpm.quantities.quantity import of_width
from warp_mpm.scenario import Fixed, Scenario, Sliding, Trapezoid
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.site import notes_still_true

FINER = (math.sqrt(2.0), 2.0)
"""How much finer the runs are that confirm an answer: with the coarse one three spacings, as an extrapolation needs."""

CONFIRMATIONS = 3
"""Most answers that are confirmed, each after the limits of the coarse runs were put right by the one before."""

CLOSE = 0.04
"""Excess below a limit, as a logarithm, within which the finer run leaves no lighter barrier worth looking for."""

INSIDE = 0.01
"""By what a limit that is put right is drawn in besides, so that the next answer keeps it."""

Trials = Callable[[Sequence[Scenario]], list[Run]]


@dataclass(frozen=True)
class Objective:
    """What is made least: known of a scenario without running it."""

    name: str
    words: str
    unit: str
    shown: tuple[str, float]
    """Unit in which people read it, and the factor to it."""
    of: Callable[[Scenario], float]

    def text(self, value: float) -> str:
        """A value as people read it."""
        unit, factor = self.shown
        return f"{value * factor:,.4g} {unit}".removesuffix(" -")


def objective_of(scenario: Scenario, name: str) -> Objective:
    """The objective of a name: `mass`, `area`, or a field of the scenario.

    Raises:
        ValueError: the scenario has no such field, or the barrier no mass.
    """
    barrier = scenario.barrier
    if name in ("mass", "area"):
        if barrier is None or not isinstance(barrier.shape, Trapezoid):
            raise ValueError(f"--minimize {name} needs a barrier of the kind trapezoid, which alone has an end.")
        if name == "area":
            return Objective("area", "cross-section of the barrier", "m2", ("m²", 1.0), area)
        density = scenario.design.density_kg_per_m3 if scenario.design is not None else None
        if not isinstance(barrier.motion, Sliding) and density is None:
            raise ValueError(
                "--minimize mass: a barrier that is fixed or driven has no mass; give design.density_kg_per_m3, or "
                "--minimize area."
            )
        return Objective("mass", "mass of the barrier", of_width("kg"), (of_width("t"), 1e-3), mass)
    if number_at(scenario, name, option="--minimize") is None:
        raise ValueError(f"--minimize {name}: the scenario leaves it out.")
    return Objective(name, name, "", ("-", 1.0), lambda scene: float(number_at(scene, name) or 0.0))


def area(scenario: Scenario) -> float:
    """Section of the barrier [m²]."""
    assert scenario.barrier is not None
    assert isinstance(scenario.barrier.shape, Trapezoid)
    return geometry.area(scenario.barrier.shape.outline)


def mass(scenario: Scenario) -> float:
    """Mass of the barrier [kg/m]; of one that is fixed, by `design.density_kg_per_m3`."""
    assert scenario.barrier is not None
    own = scenario.barrier.mass
    if own is not None:
        return own
    assert scenario.design is not None
    return float(scenario.design.density_kg_per_m3 or 0.0) * area(scenario)


@dataclass(frozen=True)
class Question:
    """What is asked."""

    scenario: Scenario
    """With what follows left to follow (`fields.freed`)."""
    ranges: tuple[Range, ...]
    """One or two."""
    limits: tuple[Limit, ...]
    objective: Objective
    spacing: float
    """Of the coarse runs, about [m]."""
    fine: float | None
    """Of the finest run that confirms, about [m]; None: nothing is confirmed."""
    tolerance: float = 0.02
    samples: int = 8

    @property
    def corners(self) -> list[Point]:
        """Of the ranges."""
        return list(itertools.product(*((one.low, one.high) for one in self.ranges)))

    def weigh(self, point: Point) -> float:
        """The objective at a point; infinite where no scene is possible."""
        try:
            return self.objective.of(with_values(self.scenario, self.values(point)))
        except ScenarioError:
            return math.inf

    def values(self, point: Point) -> dict[str, float]:
        """Values by the fields' paths."""
        return {one.path: value for one, value in zip(self.ranges, point, strict=True)}

    def scene(self, point: Point, spacing: float | None = None) -> Scenario:
        """The trial at a point, at the coarse spacing or at another [m]."""
        return coarse(with_values(self.scenario, self.values(point)), spacing or self.spacing)


@dataclass(frozen=True)
class Rung:
    """The answer at one spacing."""

    spacing: float
    figures: Mapping[str, Any] | None
    wall_time: float


@dataclass(frozen=True)
class Known:
    """How well a limited figure of the answer is known."""

    limit: Limit
    values: tuple[float, ...]
    """At the spacings, coarse first."""
    value: float
    """That to which they lead; the finest where they show no order."""
    uncertainty: float
    """Half a width: of the spacing alone, by `accuracy`'s rule for three spacings."""

    @property
    def sure(self) -> bool:
        """Whether the limit is kept with all that the spacing leaves open."""
        reach = self.value - self.uncertainty if self.limit.least else self.value + self.uncertainty
        return reach >= self.limit.bound if self.limit.least else reach <= self.limit.bound


@dataclass
class Answer:
    """What the search found."""

    question: Question
    best: Tried | None
    """By coarse runs, or by the finest run where that confirmed; None: no barrier within the ranges holds."""
    tried: list[tuple[Tried, Run]]
    """All coarse trials, in the order in which they were made."""
    rungs: list[Rung] = field(default_factory=list)
    """The answer at each spacing, coarse first; one where nothing was confirmed."""
    confirmed: bool | None = None
    """Whether the finest run keeps all limits; None: not asked."""
    known: list[Known] = field(default_factory=list)
    objective_uncertainty: float | None = None
    """What the uncertainty of the figures makes of the objective, either way."""
    closed_form: dict[str, float] = field(default_factory=dict)
    """`displacement` [m] of the answer by the calibrated closed form, `objective` of its own on the same line."""
    sampled: list[Tried] = field(default_factory=list)
    """Lighter barriers that were tried against the assumption of the search."""
    contradictions: int = 0
    """Pairs of trials that speak against it."""
    remarks: list[str] = field(default_factory=list)


def check_ranges(question: Question) -> None:
    """See that all corners of the ranges are possible scenes, at the finest spacing too, and that they differ.

    Raises:
        ScenarioError: one is not possible; the sentence names its values.
        ValueError: what is to be least is the same at all of them.
    """
    for corner in question.corners:
        question.scene(corner)
        question.scene(corner, question.fine)
    weights = [question.weigh(corner) for corner in question.corners]
    if max(weights) - min(weights) <= 1e-9 * abs(max(weights)):
        paths = " and ".join(one.path for one in question.ranges)
        raise ValueError(
            f"--vary {paths} does not change the {question.objective.words}, which is to be least; vary a measure of "
            "the barrier, or choose something else with --minimize."
        )


def lightest(question: Question, runs: Trials, *, say: Callable[[str], None] = lambda sentence: None) -> Answer:
    """The lightest barrier that keeps the limits.

    Args:
        question: what is asked, its ranges checked.
        runs: makes runs.
        say: told what is being done.
    """
    made: dict[Point, Run] = {}
    guess = _guess(question)
    search = _search(question, question.limits, runs, made, guess)
    say("searching")
    best = search.run()
    answer = Answer(question, best, [])
    if best is not None:
        say("looking for lighter ones, against the assumption that what is heavier is safer")
        lighter = search.lighter(question.samples)
        # With the finer runs at once, so that no core waits.
        runs([*(question.scene(point) for point in lighter), *_finer_scenes(question, best.point)])
        answer.sampled, best = search.sampled(lighter), search.best
    answer.best, answer.contradictions = best, len(search.contradictions())
    kept: tuple[Tried, list[Rung]] | None = None
    least = min(map(question.weigh, question.corners))
    for _ in range(CONFIRMATIONS):
        if best is None or question.fine is None:
            break
        say(f"confirming {question.objective.text(best.objective)} at finer spacings")
        rungs, figures = _confirmed(question, best.point, runs, made)
        if figures is None:
            answer.remarks.append("The finer run of the answer failed, so that nothing is confirmed.")
            answer.best, answer.rungs, answer.confirmed = best, rungs, False
            break
        over = excess(question.limits, figures)
        if over <= 0.0 and (kept is None or best.objective < kept[0].objective):
            kept = best, rungs
        if kept is None:
            answer.best, answer.rungs, answer.confirmed = best, rungs, False
        if over <= 0.0 and (over > -CLOSE or best.objective <= least * (1.0 + 1e-9)):
            break
        say("searching again, with the limits put right by the finer run")
        corrected = _search(question, _put_right(question.limits, rungs), runs, made, guess)
        best = corrected.again(list(made))
    if kept is not None:
        answer.best, answer.rungs, answer.confirmed = kept[0], kept[1], True
    elif answer.best is not None and question.fine is None:
        run = made[answer.best.point]
        answer.rungs = [Rung(run.scenario.numerics.spacing_m, run.figures, run.wall_time)]
    answer.tried = [
        (Tried(point, question.objective.of(run.scenario), _excess(question.limits, run)), run)
        for point, run in made.items()
    ]
    if answer.best is not None:  # found under limits that were put right, perhaps
        answer.best = next(one for one, _ in answer.tried if one.point == answer.best.point)
    _know(answer)
    _compare_with_closed_form(answer)
    _remark(answer)
    return answer


def _search(
    question: Question,
    limits: Sequence[Limit],
    runs: Trials,
    made: dict[Point, Run],
    guess: Callable[..., float | None],
) -> Search:
    def evaluate(points: Sequence[Point]) -> list[float]:
        new = [point for point in points if point not in made]
        for point, run in zip(new, runs([question.scene(point) for point in new]), strict=True):
            made[point] = run
        return [_excess(limits, made[point]) for point in points]

    box = Box(tuple(one.low for one in question.ranges), tuple(one.high for one in question.ranges))
    return Search(box, question.weigh, evaluate, guess=guess, tolerance=question.tolerance)


def _excess(limits: Sequence[Limit], run: Run) -> float:
    return excess(limits, run.figures) if run.figures is not None else excess(limits, {})


def closed_form_displacement(scenario: Scenario) -> float | None:
    """Sliding distance [m] by the calibrated closed form; None where it has no answer."""
    try:
        scene = scene_of(scenario)
        if scene.barrier_mass is None:
            return None
        found = float(displacement(scene, scene.barrier_mass, coefficients(scene)))
    except (SceneError, ValueError):
        return None
    return found if math.isfinite(found) else None


def _guess(question: Question) -> Callable[[float | None], float | None]:
    """Where on a line the closed form sees the limit of the displacement; None without such a limit."""
    limit = next((one for one in question.limits if one.name in DISPLACEMENTS), None)

    def moved(point: Point) -> float | None:
        return closed_form_displacement(with_values(question.scenario, question.values(point)))

    def guess(second: float | None) -> float | None:
        if limit is None:
            return None
        rest = () if second is None else (second,)
        first = question.ranges[0]
        ends = [moved((value, *rest)) for value in (first.low, first.high)]
        if None in ends or (ends[0] > limit.bound) == (ends[1] > limit.bound):  # type: ignore[operator]
            return None
        falls = ends[0] > ends[1]  # type: ignore[operator]
        low, high = first.low, first.high
        for _ in range(20):
            middle = 0.5 * (low + high)
            there = moved((middle, *rest))
            if there is None:
                return None
            low, high = (middle, high) if (there > limit.bound) == falls else (low, middle)
        return 0.5 * (low + high)

    return guess


def _finer_scenes(question: Question, point: Point) -> list[Scenario]:
    """A point at the finest spacing and at one between, none where nothing is to be confirmed."""
    if question.fine is None:
        return []
    between = math.sqrt(question.spacing * question.fine)
    return [question.scene(point, spacing) for spacing in (between, question.fine)]


def _confirmed(
    question: Question, point: Point, runs: Trials, made: Mapping[Point, Run]
) -> tuple[list[Rung], Mapping[str, Any] | None]:
    """The answer at three spacings, and the figures of the finest."""
    finer = runs(_finer_scenes(question, point))
    rungs = [Rung(run.scenario.numerics.spacing_m, run.figures, run.wall_time) for run in (made[point], *finer)]
    return rungs, rungs[-1].figures


def _put_right(limits: Sequence[Limit], rungs: Sequence[Rung]) -> tuple[Limit, ...]:
    """Limits for the coarse runs: drawn in, or let out, by what the finest run has otherwise."""
    coarsest, finest = rungs[0].figures or {}, rungs[-1].figures or {}
    found = []
    for limit in limits:
        here, there = coarsest.get(limit.name), finest.get(limit.name)
        bound = limit.bound
        if bound > 0.0 and here is not None and there is not None and min(here, there) > 1e-9 * bound:
            bound *= here / there * (1.0 + INSIDE if limit.least else 1.0 - INSIDE)
        found.append(replace(limit, bound=bound))
    return tuple(found)


def _know(answer: Answer) -> None:
    """What three spacings say of the limited figures, and that of the objective."""
    rungs = [rung for rung in answer.rungs if rung.figures is not None]
    best = answer.best
    if best is None or len(rungs) < 3 or len({rung.spacing for rung in rungs}) < 3:
        return
    for limit in answer.question.limits:
        values = [(rung.figures or {}).get(limit.name) for rung in rungs]
        if any(value is None for value in values):
            continue
        known = [float(value) for value in values if value is not None]
        reference = extrapolate([rung.spacing for rung in rungs], known)
        answer.known.append(Known(limit, tuple(known), float(reference.value), float(reference.uncertainty)))
    slopes = [
        _slope(answer, known.limit) * known.uncertainty / abs(known.limit.bound)
        for known in answer.known
        if known.limit.bound and known.limit.excess({known.limit.name: known.values[-1]}) > -0.5
    ]
    if slopes:
        answer.objective_uncertainty = best.objective * max(slopes)


def _slope(answer: Answer, limit: Limit) -> float:
    """Relative change of the objective for a relative change of a figure, by the trials on the answer's line; 0 where
    too few are near."""
    best = answer.best
    assert best is not None
    near = [
        (limit.excess(run.figures), math.log(one.objective / best.objective))
        for one, run in answer.tried
        if one.point[1:] == best.point[1:] and run.figures is not None and one.objective > 0.0
    ]
    near = [(over, heavier) for over, heavier in near if abs(over) < 1.0]
    if len(near) < 2 or float(np.ptp([over for over, _ in near])) < 1e-6:
        return 0.0
    overs, heaviers = np.array(near).T
    return abs(float(np.polyfit(overs, heaviers, 1)[0]))


def _compare_with_closed_form(answer: Answer) -> None:
    question, best = answer.question, answer.best
    if best is None:
        return
    scene = with_values(question.scenario, question.values(best.point))
    moved = closed_form_displacement(scene)
    if moved is not None:
        answer.closed_form["displacement"] = moved
    own = _guess(question)(best.point[1] if len(best.point) > 1 else None)
    if own is not None:
        point = (own, *best.point[1:])
        answer.closed_form["objective"] = question.objective.of(with_values(question.scenario, question.values(point)))


def _remark(answer: Answer) -> None:
    """What a reader must know before he trusts the answer."""
    question, remarks = answer.question, answer.remarks
    failed = [run for _, run in answer.tried if run.figures is None]
    if failed:
        remarks.append(f"{len(failed)} of {len(answer.tried)} trials failed and count as broken: {failed[0].problem}")
    moving = [run for _, run in answer.tried if run.figures is not None and run.figures.get("barrier_at_rest") is False]
    if moving and any(limit.name in DISPLACEMENTS for limit in question.limits):
        remarks.append(
            f"In {len(moving)} of {len(answer.tried)} trials the barrier still slid at the end, "
            f"{question.scenario.output.end_time_s:g} s; their displacement counts as broken. With a later "
            "output.end_time_s they may hold."
        )
    if answer.tried and all(untouched(run) for _, run in answer.tried):
        remarks.append(
            f"The flow pushed on no barrier by t = {question.scenario.output.end_time_s:g} s: what kept the limits was "
            "not tried by it."
        )
    barrier = question.scenario.barrier
    if (
        barrier is not None
        and isinstance(barrier.motion, Fixed)
        and any(one.name in DISPLACEMENTS for one in question.limits)
    ):
        remarks.append("The barrier is fixed and does not move: the limit on its displacement asks for nothing.")
    if answer.best is not None:
        for one, value in zip(question.ranges, answer.best.point, strict=True):
            for end, name in ((one.low, "least"), (one.high, "greatest")):
                if abs(value - end) <= 1e-9 * (one.high - one.low):
                    remarks.append(
                        f"{one.path} = {value:.4g} is the {name} that was allowed: the range rules, no limit."
                    )
    lighter = [one for one in answer.sampled if one.holds]
    if lighter:
        remarks.append(
            f"{len(lighter)} of {len(answer.sampled)} lighter barriers that were sampled kept the limits, against the "
            "assumption of the search; it went on from the lightest of them."
        )
    if answer.contradictions:
        remarks.append(
            f"{answer.contradictions} pairs of trials speak against the assumption that what is heavier or higher is "
            "safer: between them the answer may not be the lightest."
        )
    for known in answer.known:
        if answer.confirmed and not known.sure:
            remarks.append(
                f"{known.limit.text} is kept by the finest run, {known.limit.shown(known.values[-1])}, but not by all "
                f"that its spacing leaves open: {known.limit.shown(known.value)} ± "
                f"{known.limit.shown(known.uncertainty)}."
            )


def answer_scenario(answer: Answer) -> Scenario:
    """The answer as a scenario of its own, with the limits that its `design` group has a field for."""
    question, best = answer.question, answer.best
    assert best is not None
    scene = with_values(question.scenario, question.values(best.point))
    fields = {DESIGN_FIELDS[one.name]: one.bound for one in question.limits if one.name in DESIGN_FIELDS}
    limits = " and ".join(limit.text for limit in question.limits)
    changes: dict[str, Any] = {
        "title": f"{question.scenario.title}: lightest with {limits}"[:200],
        "numerics.spacing_m": answer.rungs[-1].spacing if answer.rungs else question.spacing,
    }
    found = ", ".join(f"{path} = {value:.6g}" for path, value in question.values(best.point).items())
    kept = notes_still_true(question.scenario.notes, [*question.values(best.point), "numerics.spacing_m"])
    changes["notes"] = [*kept, f"found by simulation as the lightest that keeps the limits: {found}"]
    if fields:
        design = scene.design.model_dump(mode="json") if scene.design is not None else {}
        changes["design"] = design | fields
    return scene.replaced(changes)
