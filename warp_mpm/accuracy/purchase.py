"""Buying accuracy: the spacing that keeps an error, or that fits into a time, from a ladder of runs of the scene."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from analytic.force_record import cumulative_impulse
from analytic.whole_file import write_whole
from warp_mpm.accuracy.errors import KEY_QUANTITIES, QUANTITIES, Array
from warp_mpm.accuracy.kept import Kept
from warp_mpm.accuracy.keys import DATA, rules_digest, scenario_fields, scene_key
from warp_mpm.accuracy.pace import (
    LONG_ENOUGH,
    Bench,
    Machine,
    Pace,
    pace_of,
    steps_and_points,
    timing_scene,
)
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import SERIES_INTERVAL, Setting, ladder
from warp_mpm.results import Results
from warp_mpm.scenario import Scenario, Trapezoid

PROBE_CELLS = (6.0, 8.0, 11.0, 15.0)
"""Spacings of the probes: cells in the flow's depth. The finest costs a few per cent of a run of 40 cells."""

LADDERS = ((PROBE_CELLS, 1 / 3), (PROBE_CELLS[:3], 1 / 2), ((4.0, *PROBE_CELLS[:2]), 1.0))
"""Probes that a budget allows, the best first, and the greatest share of it that they may take."""

FINEST_CELLS = 120.0
"""Most cells in the flow's depth that are sold: errors were measured far coarser."""

SAFETY = 1.25
"""Factor on an error that follows a law (Roache's grid convergence index)."""

LEAST_RUNGS = 3
"""Runs that a ladder needs."""

CLEAR = 0.25
"""A ladder follows a law where its scatter about it is less than this share of what varies."""

LEAST, MOST = 0.001, 0.5
"""Range of the accuracies that can be asked for."""

TIMED = 0.5
"""Least time of a shipped rung [s] that is worth running to learn how fast a machine is."""

DEARER = 2.5
"""Power of the number of cells with which the time of coarse runs grows; of fine ones it is 3."""

LONG = 300.0
"""Time [s] of a run, or of its probes, that nobody set and that is not begun before somebody agrees."""

HELD = ("problem", "cpu_time", "recording_time", "preparation_time", "steps", "samples", "paces")
"""What is kept of a probe beside its status and its key figures."""


class PurchaseError(ValueError):
    """An accuracy or a budget that cannot be had; one sentence."""


@dataclass(frozen=True)
class Rung:
    """One run of a ladder."""

    spacing: float
    """[m]."""
    time: float
    """CPU time of stepping and recording [s]."""
    figures: dict[str, float]
    """Key quantities, SI."""


@dataclass(frozen=True)
class Offer:
    """What is chosen, and what is expected of it."""

    spacing: float
    """[m]."""
    time: float
    """Expected time of the run on this machine [s], from its start to its last figure."""
    around: float
    """What of it is not for steps and records but to start and to finish [s]."""
    errors: dict[str, float]
    """Expected relative errors of the key quantities."""
    values: dict[str, float]
    """Values of the key quantities on the finest grids, SI: extrapolated, or of the finest run."""
    source: str
    """What it rests on."""
    probing: float = 0.0
    """Time that probing took [s]: nothing where the probes were kept."""
    compiling: float = 0.0
    """Time that compiling took before [s], once for each kind of scene; no part of what is promised."""

    @property
    def error(self) -> float:
        """Greatest of the expected errors."""
        return max(self.errors.values())

    def described(self) -> str:
        """In words."""
        parts = ", ".join(f"{QUANTITIES[name].label} {error:.1%}" for name, error in self.errors.items())
        probing = f"; with the {self.probing:.2g} s of probing {self.time + self.probing:.3g} s in all"
        compiling = f" Compiling the kernels took {self.compiling:.2g} s, once, and is not counted."
        return (
            f"Chosen: spacing {self.spacing:.4g} m ({self.source}). Expected, on a free core: "
            f"{self.time - self.around:.2g} s for the steps and their records and about {self.around:.2g} s to "
            f"start and to finish{probing if self.probing else ''}; errors of at most {self.error:.1%} ({parts})."
            f"{compiling if self.compiling else ''}"
        )

    def settled(self, run: Path, cpu_time: float) -> str:
        """What was got, in words.

        Args:
            run: the folder of the run, which has ended.
            cpu_time: what it took of the processor [s], from its start and without probing; on a free core that is
                the wall time.
        """
        figures = figures_of(run)
        off = {
            name: abs(figures[name] - value) / abs(value)
            for name, value in self.values.items()
            if figures.get(name) is not None and value
        }
        parts = ", ".join(f"{QUANTITIES[name].label} {error:.1%}" for name, error in off.items())
        beyond = [QUANTITIES[name].label for name, error in off.items() if error > 2.0 * self.errors[name]]
        warning = (
            f" That is more than twice what was expected of {', '.join(beyond)}: the coarse runs led elsewhere, and "
            "only a finer run can tell how far off this one is."
        )
        total = f"{cpu_time:.3g} s of the processor in all"
        if self.probing:
            total = f"{cpu_time:.3g} s of the processor and with probing {cpu_time + self.probing:.3g} s in all"
        return (
            f"Got: {figures['wall_time']:.2g} s for the steps and their records, {total}, "
            f"{(cpu_time + self.probing) / (self.time + self.probing):.2g} times what was expected; away from the "
            f"values expected on the finest grids: {parts}.{warning if beyond else ''}"
        )


def figures_of(run: Path) -> dict[str, Any]:
    """Figures of a run's folder, the peak force as a study has it."""
    results = Results.open(run)
    series = results.time_series
    if "impact_force_x" not in series:  # left out by output.quantities
        return dict(results.summary)
    peak = peak_mean(series["time"], series["impact_force_x"], SERIES_INTERVAL)
    return dict(results.summary) | {"peak_force": peak}


def peak_mean(time: Array, force: Array, interval: float) -> float:
    """Greatest mean of a force over the intervals [s] that follow each other from the start."""
    ends = np.arange(0.0, time[-1] + 0.5 * interval, interval)
    return float(np.diff(np.interp(ends, time, cumulative_impulse(time, force))).max() / interval)


def percent(text: str) -> float:
    """An accuracy from `5%`.

    Raises:
        PurchaseError: it is none from 0.1% to 50%.
    """
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]*)?|\.[0-9]+)\s*%\s*", text)
    value = float(found[1]) / 100.0 if found else math.nan
    if not LEAST <= value <= MOST:
        raise PurchaseError(f"--accuracy {text} must be a percentage from 0.1% to 50%, for instance 5%.")
    return value


def seconds(text: str) -> float:
    """A budget from `60s`, `10min` or `2h`.

    Raises:
        PurchaseError: it is no time from 1 s to 1000 h.
    """
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]*)?|\.[0-9]+)\s*(s|min|h)\s*", text)
    value = float(found[1]) * {"s": 1.0, "min": 60.0, "h": 3600.0}[found[2]] if found else math.nan
    if not 1.0 <= value <= 3.6e6:
        raise PurchaseError(f"--budget {text} must be a time from 1s to 1000h, for instance 60s or 10min.")
    return value


def buy(
    scenario: Scenario,
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    bench: Bench | None = None,
    kept: Kept | None = None,
    agree: Callable[[str], bool] = lambda sentence: True,
    on_probe: Callable[[str], None] = lambda sentence: None,
) -> Offer:
    """Choose the spacing that keeps an error, or the best one within a time.

    A scene of which a ladder is shipped needs one coarse run, which tells how fast this machine is; any other is probed
    by three or four coarse runs. What was probed and chosen is kept: the same question gets the same answer.

    Args:
        scenario: what will be run; its other settings stay.
        accuracy: greatest relative error of the key quantities.
        budget: time [s] from now until the run's last figure, probing included.
        bench: what the probes are run on; this machine's CPU where none is given.
        kept: what was kept of this scene, and keeps what is found; nothing is kept where none is given.
        agree: asked before what takes more than `LONG` seconds that nobody set.
        on_probe: told what is being probed.

    Raises:
        PurchaseError: it cannot be had; the sentence tells what can.
    """
    assert (accuracy is None) != (budget is None)
    if scenario.barrier is None:
        raise PurchaseError("This scene has no barrier, so it has no figures whose accuracy could be bought.")
    asked = f"--accuracy {100.0 * accuracy:g}%" if accuracy is not None else f"--budget {budget:g}s"
    bench = bench or Machine()
    if budget is not None and budget <= bench.around:
        raise PurchaseError(
            f"{asked} is too short for any scene: to start and to finish, a run takes about {bench.around:.2g} s."
        )
    probes = _Probes(scenario, asked, budget, bench, kept or Kept(None), agree, on_probe)
    offer = probes.chosen_before()
    if offer is None:
        rungs, time, source = probes.shipped() or probes.own()
        sold = sold_spacings(scenario, max(rung.spacing for rung in rungs))
        probes.check_room(sold[-1], time(sold[-1]))
        offer = probes.keep(
            choose(rungs, sold, time, accuracy=accuracy, budget=probes.left, around=bench.around, source=source)
        )
    else:
        on_probe("This was asked before; the choice was kept.")
    if budget is None and offer.time > LONG:
        probes.ask(f"a run of about {duration(offer.time)}, at a spacing of {offer.spacing:.4g} m")
    return offer


def choose(
    rungs: Sequence[Rung],
    sold: Sequence[float],
    time: Callable[[float], float],
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    around: float = 0.0,
    source: str = "",
) -> Offer:
    """The offer that a ladder allows; see `buy`.

    Args:
        rungs: at least three spacings.
        sold: spacings to choose from [m], fine first.
        time: expected time of a run [s] at a spacing.
        accuracy: greatest error.
        budget: greatest time [s].
        around: what of a time is to start and to finish [s].
        source: what the ladder rests on.
    """
    law = _Law(rungs)
    if accuracy is not None:
        kept = [s for s in sold if law.error(s) <= accuracy]
        if not kept:
            least = min(law.error(s) for s in sold)
            best = max(s for s in sold if law.error(s) <= least * (1.0 + 1e-9))
            errors = law.errors(best)
            scattered = QUANTITIES[max(errors, key=lambda name: errors[name])].label
            granted = f"ask for --accuracy {_text(least, up=True)}, or choose" if least <= MOST else "choose"
            raise PurchaseError(
                f"--accuracy {_text(accuracy)} cannot be promised for this scene: the best on offer is "
                f"{_text(least, up=True)} at a spacing of {best:.4g} m, in {duration(time(best))}. It is the "
                f"{scattered} that varies by so much from one spacing to the next, and finer ones are not known to do "
                f"better; {granted} by --spacing or --budget."
            )
        spacing = max(kept)
    else:
        assert budget is not None
        coarse, fine = len(sold) - 1, -1  # time grows as the spacing falls: the border lies between the two
        if time(sold[coarse]) > budget:
            raise PurchaseError(
                f"{duration(budget)} are too short for this scene: the coarsest spacing sold, {sold[-1]:.4g} m, takes "
                f"{duration(time(sold[-1]))}."
            )
        while coarse - fine > 1:
            middle = (coarse + fine) // 2
            coarse, fine = (middle, fine) if time(sold[middle]) <= budget else (coarse, middle)
        spacing = sold[coarse]
    return Offer(spacing, time(spacing), around, law.errors(spacing), law.values, source)


class _Probes:
    """The probes of a scene: what was kept, what is run, and what that takes of a budget."""

    def __init__(
        self,
        scenario: Scenario,
        asked: str,
        budget: float | None,
        bench: Bench,
        kept: Kept,
        agree: Callable[[str], bool],
        say: Callable[[str], None],
    ):
        self._scenario, self._asked, self._budget = scenario, asked, budget
        self._bench, self._kept, self._agree, self._say = bench, kept, agree, say
        self._begun, self._compiling, self._agreed, self._prepared = bench.clock(), 0.0, False, False
        self._announced = "Timing this scene."
        if not _sound(kept.content()):
            kept.replace({})

    @property
    def spent(self) -> float:
        """Time of probing [s] until now, without compiling."""
        return self._bench.clock() - self._begun - self._compiling if self._prepared else 0.0

    @property
    def left(self) -> float | None:
        """What the budget leaves [s] for the run, its start and finish included; None without a budget."""
        return None if self._budget is None else self._budget - self.spent

    def chosen_before(self) -> Offer | None:
        """The offer that the same question got before."""
        choice = self._kept.content().get("choices", {}).get(self._asked)
        return None if choice is None else Offer(**choice)

    def keep(self, offer: Offer) -> Offer:
        """Keep the choice; where another process has kept one meanwhile, that holds."""
        choice = {name: getattr(offer, name) for name in ("spacing", "time", "around", "errors", "values", "source")}
        content = self._kept.add({"choices": {self._asked: choice}})
        return replace(Offer(**content["choices"][self._asked]), probing=self.spent, compiling=self._compiling)

    def check_room(self, coarsest: float, time: float) -> None:
        """Raises: PurchaseError: the budget does not leave the time [s] of a run at the coarsest spacing [m]."""
        if self._budget is None or self.left is None or time <= self.left:
            return
        again = "; the probes are kept, and the same command has time enough now"
        raise PurchaseError(
            f"{self._asked} is too short for this scene: a run at the coarsest spacing sold, {coarsest:.4g} m, takes "
            f"{duration(time)} with start and finish, beside {duration(self.spent)} of probing"
            f"{again if time <= self._budget and self._kept.lasting else ''}."
        )

    def ask(self, what: str) -> None:
        """Raises: PurchaseError: nobody agrees to that."""
        if not self._agreed and not self._agree(f"{self._asked} needs {what}"):
            raise PurchaseError(f"{self._asked} needs {what}; that is not begun without --yes.")
        self._agreed = True

    def shipped(self) -> tuple[Sequence[Rung], Callable[[float], float], str] | None:
        """Ladder, time of a run and source, where this scene was measured before it was shipped."""
        shipped = shipped_ladders().get(scene_key(self._scenario))
        default = type(self._scenario.numerics)()
        own = self._scenario.numerics.model_copy(update={"spacing_m": default.spacing_m})
        if shipped is None or own != default:
            return None
        timed = max((rung.spacing for rung in shipped if rung.time > TIMED), default=shipped[-1].spacing)
        self._announced = f"This scene was measured before; a run at {timed:g} m tells how fast this machine is."
        result = self._probe(timed)
        if result["status"] != "finished":
            raise PurchaseError(f"The probe at {timed:.4g} m failed: {result['problem']}")
        return shipped, self._time(pace_of([(self._at(timed), result)])), "from shipped measurements of this scene"

    def own(self) -> tuple[Sequence[Rung], Callable[[float], float], str]:
        """Ladder, time of a run and source, from coarse runs; fewer where a budget is short."""
        spacings = self._ladder()
        if len(spacings) < LEAST_RUNGS:
            raise PurchaseError(
                f"This scene allows fewer than {LEAST_RUNGS} spacings of {PROBE_CELLS[0]:g} cells or more in the "
                "flow's depth, which is too few to learn anything from; choose by --spacing."
            )
        results = {spacing: self._probe(spacing) for spacing in spacings}
        if any(result["status"] == "given up" for result in results.values()):
            raise self._short(f"probing took {duration(self.spent)}")
        runs = [(self._at(spacing), result) for spacing, result in results.items() if result["status"] == "finished"]
        if len(runs) < LEAST_RUNGS:
            spacing, result = next(item for item in results.items() if item[1]["status"] != "finished")
            raise PurchaseError(f"The probe at {spacing:.4g} m failed: {result['problem']}")
        rungs = [_rung_of(scene.numerics.spacing_m, result) for scene, result in runs]
        timed = None
        scene = timing_scene(runs, lambda spacing: max(aligned(self._scenario, spacing), self._finest))
        if scene is not None:
            timed = (scene, *self._timed(scene))
        return rungs, self._time(pace_of(runs, timed)), "from a probe of coarse runs"

    def _ladder(self) -> list[float]:
        """Spacings of the probes [m], coarse first, that the budget allows, or that are agreed to."""
        first = self._spacings(PROBE_CELLS[:1])[0]
        if self._budget is None:
            every = self._spacings(PROBE_CELLS)
            self._announced = f"Probing this scene at spacings of {', '.join(f'{one:.4g}' for one in every)} m."
            least = self._expected(self._least(first), 0.0, [s for s in every if self._known(s) is None])
            if least > LONG:
                self.ask(f"probes of {duration(least)} at least")
            result = self._probe(first)
            missing = [spacing for spacing in every if self._known(spacing) is None]
            expected = self._expected(_stepping(result), result["preparation_time"], missing)
            if expected > LONG:
                self.ask(f"probes of about {duration(expected)}")
            return every
        room = self._budget - self._bench.around
        if self._least(first) > room:
            raise self._short(
                f"a run at {first:.4g} m, the coarsest probe, takes {duration(self._least(first))} at least"
            )
        self._announced = f"Probing this scene, as part of the budget, from a spacing of {first:.4g} m on."
        result = self._probe(first)
        if result["status"] == "given up":
            whole = _stepping(result) * self._scenario.output.end_time_s / max(result["end_time"], 1e-12)
            raise self._short(f"a run at {first:.4g} m, the coarsest probe, takes about {duration(whole)}")
        for cells, share in LADDERS:
            spacings = self._spacings(cells)
            missing = [spacing for spacing in spacings if self._known(spacing) is None]
            expected = self._expected(_stepping(result), result["preparation_time"], missing)
            if self.spent + expected <= share * room:
                return spacings
        raise self._short(f"the probes that it takes to choose a spacing take {duration(self.spent + expected)}")

    def _short(self, why: str) -> PurchaseError:
        return PurchaseError(
            f"{self._asked} is too short for this scene: {why}, and about {self._bench.around:.2g} s go to start and "
            "finish; ask for more, or choose by --spacing."
        )

    def _expected(self, stepping: float, setup: float, spacings: Sequence[float]) -> float:
        """Time [s] of probes at these spacings, from that of the coarsest."""
        first = self._spacings(PROBE_CELLS[:1])[0]
        return sum(stepping * (first / spacing) ** DEARER + setup * first / spacing for spacing in spacings)

    def _spacings(self, cells: Sequence[float]) -> list[float]:
        depth = self._scenario.flow.depth
        return list(dict.fromkeys(max(aligned(self._scenario, depth / n), self._finest) for n in cells))

    def _least(self, spacing: float) -> float:
        return self._bench.least_cost * steps_and_points(self._at(spacing))

    @cached_property
    def _finest(self) -> float:
        return sold_spacings(self._scenario, self._scenario.flow.depth)[0]

    def _at(self, spacing: float) -> Scenario:
        return self._scenario.replaced({"numerics.spacing_m": spacing})

    def _time(self, pace: Pace) -> Callable[[float], float]:
        return lambda spacing: pace.time(self._at(spacing)) + self._bench.around

    def _known(self, spacing: float) -> Result | None:
        found: Result | None = self._kept.content().get("probes", {}).get(f"{spacing:.12g}")
        return found

    def _probe(self, spacing: float) -> Result:
        """A whole run at a spacing [m], kept or run now."""
        known = self._known(spacing)
        if known is not None:
            return known
        (setting,) = ladder(self._scenario, [spacing])
        self._prepare(setting.scenario)
        limit = math.inf
        if self._budget is not None:
            limit = self._budget - self._bench.around - self.spent
        elif not self._agreed:
            limit = LONG
        result = self._bench.measure(setting.scenario, limit)
        if result["status"] == "given up":
            if self._budget is not None:
                return result
            whole = _stepping(result) * self._scenario.output.end_time_s / max(result["end_time"], 1e-12)
            self.ask(f"probes that take more than {duration(whole)}")
            result = self._bench.measure(setting.scenario, math.inf)
        figures = {name: result["figures"].get(name) for name in KEY_QUANTITIES}
        held = {"status": result["status"], "figures": figures} | {name: result[name] for name in HELD}
        content = self._kept.add({"probes": {f"{spacing:.12g}": held}})
        found: Result = content["probes"][f"{spacing:.12g}"]
        return found

    def _timed(self, scene: Scenario) -> tuple[float, float]:
        name = f"{scene.numerics.spacing_m:.12g}"
        content = self._kept.content()
        if name not in content.get("timed", {}):
            self._prepare(scene)
            content = self._kept.add({"timed": {name: list(self._bench.step_cost(scene, LONG_ENOUGH))}})
        cost, until = content["timed"][name]
        return cost, until

    def _prepare(self, scene: Scenario) -> None:
        """Compile before the first probe, which then is as fast as the others."""
        if not self._prepared:
            self._say(self._announced)
            self._begun, self._prepared = self._bench.clock(), True
            self._compiling = self._bench.prepare(scene)


def duration(seconds: float) -> str:
    """A time in words: `12 s`, `34 min`, `2.5 h`."""
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


def _stepping(result: Result) -> float:
    return float(result["cpu_time"] + result["recording_time"])


def _sound(content: Mapping[str, Any]) -> bool:
    """Whether what was kept can be used: a file may be damaged, or of somebody else."""
    try:
        for probe in content.get("probes", {}).values():
            figures = [value for value in probe["figures"].values() if value is not None]
            times = [probe[name] for name in ("cpu_time", "recording_time", "preparation_time", "steps", "samples")]
            stretches = [value for stretch in probe["paces"] for value in stretch]
            if probe["status"] not in ("finished", "diverged") or not _numbers(figures + times + stretches):
                return False
            if set(probe["figures"]) != set(KEY_QUANTITIES) or min(times) < 0.0:
                return False
            if probe["status"] == "finished" and not probe["paces"]:
                return False
            if any(len(stretch) != len(("begin", "speed", "cost")) for stretch in probe["paces"]):
                return False
        for cost, until in content.get("timed", {}).values():
            if not _numbers([cost, until]) or cost <= 0.0:
                return False
        for choice in content.get("choices", {}).values():
            offer = Offer(**choice)
            if not _numbers([offer.spacing, offer.time, offer.around, *offer.errors.values(), *offer.values.values()]):
                return False
            if not offer.errors or offer.spacing <= 0.0 or not set(offer.errors) <= set(KEY_QUANTITIES):
                return False
    except (AttributeError, KeyError, TypeError, ValueError):
        return False
    return True


def _numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and math.isfinite(value) for value in values)


def aligned(scenario: Scenario, spacing: float) -> float:
    """The nearest spacing that puts the barrier's crest on a grid line, or the flow's surface where that is higher.

    A crest between two grid lines is off by up to half a cell, at every spacing by another part of it.
    """
    length = _aligned_length(scenario)
    return length / max(round(length / spacing), 1)


def sold_spacings(scenario: Scenario, coarsest: float) -> list[float]:
    """Spacings that `aligned` gives, from the finest sold to the coarsest that was measured [m].

    Those that a scenario does not allow, for their number of points say, are not sold.
    """
    length = _aligned_length(scenario)
    first, last = math.ceil(length / coarsest - 1e-9), math.floor(FINEST_CELLS * length / scenario.flow.depth)
    rows = range(first, max(last, first) + 1)
    allowed, beyond = 0, len(rows)  # finer ones are not allowed where a coarser one is not
    while beyond - allowed > 1:
        middle = (allowed + beyond) // 2
        allowed, beyond = (middle, beyond) if _allowed(scenario, length / rows[middle]) else (allowed, middle)
    return [length / number for number in reversed(rows[: allowed + 1])]


def _allowed(scenario: Scenario, spacing: float) -> bool:
    try:
        scenario.replaced({"numerics.spacing_m": spacing})
    except ValueError:
        return False
    return True


def _aligned_length(scenario: Scenario) -> float:
    barrier = scenario.barrier
    depth = scenario.flow.depth
    # The rows of a crest below the surface would be too few to choose from.
    if barrier is not None and isinstance(barrier.shape, Trapezoid) and barrier.shape.base_crest_height[2] >= depth:
        return barrier.shape.base_crest_height[2]
    return depth


def _text(share: float, *, up: bool = False) -> str:
    """A percentage of two digits, rounded up where a promise must hold."""
    percent = 100.0 * share
    if up and percent > 0.0:
        unit = 10.0 ** (math.floor(math.log10(percent)) - 1)
        percent = math.ceil(percent / unit - 1e-9) * unit
    return f"{percent:.2g}%"


class _Law:
    """Error against the spacing, from a ladder.

    Where the ladder follows a first-order law f = f0 + a h, the error is 1.25 |a h| plus the scatter about the line.
    Mostly it does not: the figures scatter by a per cent or more as the flow meets the grid in another way. The error
    of a spacing is then what was seen, the greatest deviation of it and the finer ones from the finest, and no less
    than the spread of the three finest: that finer spacings do better was not seen, so it is not promised.
    """

    def __init__(self, rungs: Sequence[Rung]):
        rungs = sorted(rungs, key=lambda rung: rung.spacing)
        h = np.array([rung.spacing for rung in rungs])
        self._spacings = h
        self._laws: dict[str, tuple[float, float]] = {}
        self._seen: dict[str, Array] = {}
        self.values: dict[str, float] = {}
        for name in KEY_QUANTITIES:
            if not all(name in rung.figures for rung in rungs):
                continue
            f = np.array([rung.figures[name] for rung in rungs])
            if not f.any():  # a barrier that could slide but does not
                continue
            basis = np.stack([np.ones_like(h), h], axis=1)
            (f0, a), *_ = np.linalg.lstsq(basis / h[:, None], f / h, rcond=None)
            scatter = float(np.sqrt(((f - basis @ (f0, a)) ** 2).sum() / max(len(h) - 2, 1)))
            # Three points lie on a line by accident.
            if len(h) > LEAST_RUNGS and scatter < CLEAR * float(np.ptp(f)):
                self.values[name], self._laws[name] = float(f0), (float(a), scatter)
            else:
                self.values[name] = float(f[0])
                self._seen[name] = np.maximum(np.maximum.accumulate(np.abs(f - f[0])), np.ptp(f[:3]))
        if not self.values:
            raise PurchaseError(
                "In none of the probes did the flow reach a barrier, so there are no figures whose accuracy could be "
                "bought; look at barrier, flow.velocity_m_per_s, the flow's distance and output.end_time_s."
            )

    def errors(self, spacing: float) -> dict[str, float]:
        found = {}
        for name, value in self.values.items():
            if name in self._laws:
                slope, scatter = self._laws[name]
                error = SAFETY * abs(slope) * spacing + scatter
            else:  # between two rungs, as at the coarser one
                place = int(np.searchsorted(self._spacings, spacing * (1.0 - 1e-9)))
                error = float(self._seen[name][min(place, len(self._spacings) - 1)])
            found[name] = error / max(abs(value), 1e-300)
        return found

    def error(self, spacing: float) -> float:
        return max(self.errors(spacing).values())


def shipped_ladders() -> dict[str, list[Rung]]:
    """Ladders of the paper's scenes by the scene's key; none where other rules made their figures."""
    if _data().get("rules") != rules_digest():
        return {}
    return {key: [Rung(**rung) for rung in one["rungs"]] for key, one in _data()["scenes"].items()}


@cache
def _data() -> dict[str, Any]:
    file = resources.files("warp_mpm.accuracy") / DATA
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {"scenes": {}}
    return content


def write_data(path: Path, scenes: Sequence[tuple[Scenario, Sequence[Setting]]], results: Mapping[str, Result]) -> None:
    """Write the ladders of scenes, as `shipped_ladders` reads them."""
    fields = sorted({path for scene, _ in scenes for path in scenario_fields(scene)})
    content = {
        "about": "Written by `python -m warp_mpm accuracy SCENARIO... --data FILE`; times are CPU times [s].",
        "rules": rules_digest(),
        "fields": fields,
    }
    found: dict[str, Any] = {}
    for scene, settings in scenes:
        rungs = [
            _rung_of(setting.spacing, results[setting.key])
            for setting in settings
            if setting.knob == "default" and results[setting.key]["status"] == "finished"
        ]
        if len(rungs) >= 3 and rungs[0].figures:
            found[scene_key(scene, frozenset(fields))] = {
                "title": scene.title,
                "rungs": [rung.__dict__ for rung in rungs],
            }
    write_whole(path, json.dumps(content | {"scenes": found}, indent=1, ensure_ascii=False) + "\n")


def _rung_of(spacing: float, result: Result) -> Rung:
    figures = {name: result["figures"].get(name) for name in KEY_QUANTITIES}
    known = {name: float(f"{value:.7g}") for name, value in figures.items() if value is not None}
    return Rung(spacing, float(f"{result['cpu_time'] + result['recording_time']:.4g}"), known)
