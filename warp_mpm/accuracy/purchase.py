"""Buying accuracy: what is probed of a scene, kept of it and asked before, until a spacing can be offered."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from warp_mpm.accuracy.errors import KEY_QUANTITIES
from warp_mpm.accuracy.kept import Kept
from warp_mpm.accuracy.keys import scene_key
from warp_mpm.accuracy.offer import LEAST_RUNGS, Offer, PurchaseError, Rung, choose, duration
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
from warp_mpm.accuracy.shipped import rung_of, shipped_scenes
from warp_mpm.accuracy.spacings import aligned, sold_spacings
from warp_mpm.accuracy.study import ladder, refined_everything
from warp_mpm.scenario import Scenario

PROBE_CELLS = (6.0, 8.0, 11.0, 15.0)
"""Spacings of the probes: cells in the flow's depth. The finest costs a few per cent of a run of 40 cells."""

LADDERS = ((PROBE_CELLS, 1 / 3), (PROBE_CELLS[:3], 1 / 2), ((4.0, *PROBE_CELLS[:2]), 1.0))
"""Probes that a budget allows, the best first, and the greatest share of it that they may take."""

TIMED = 0.5
"""Least time of a shipped rung [s] that is worth running to learn how fast a machine is."""

DEARER = 2.5
"""Power of the number of cells with which the time of coarse runs grows; of fine ones it is 3."""

LONG = 300.0
"""Time [s] of a run, or of its probes, that nobody set and that is not begun before somebody agrees."""

HELD = ("problem", "cpu_time", "recording_time", "preparation_time", "steps", "samples", "paces")
"""What is kept of a probe beside its status and its key figures."""


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
    by three or four coarse runs, and one more in which all settings are refined that these share. What was probed and
    chosen is kept: the same question gets the same answer.

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
        found = probes.shipped() or probes.own()
        sold = sold_spacings(scenario, max(rung.spacing for rung in found.rungs))
        probes.check_room(sold[-1], found.time(sold[-1]))
        offer = probes.keep(
            choose(
                found.rungs,
                sold,
                found.time,
                shared=found.shared,
                accuracy=accuracy,
                budget=probes.left,
                around=bench.around,
                source=found.source,
            )
        )
    else:
        on_probe("This was asked before; the choice was kept.")
    if budget is None and offer.time > LONG:
        probes.ask(f"a run of about {duration(offer.time)}, at a spacing of {offer.spacing:.4g} m")
    return offer


@dataclass(frozen=True)
class _Found:
    """What is known of a scene when a spacing is chosen."""

    rungs: Sequence[Rung]
    shared: Mapping[str, float]
    """Relative change of each key quantity with all refined that the rungs share."""
    time: Callable[[float], float]
    """Expected time of a run [s] at a spacing [m]."""
    source: str


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

    def shipped(self) -> _Found | None:
        """What is known where this scene was measured before it was shipped."""
        shipped = shipped_scenes().get(scene_key(self._scenario))
        default = type(self._scenario.numerics)()
        own = self._scenario.numerics.model_copy(update={"spacing_m": default.spacing_m})
        if shipped is None or own != default:
            return None
        rungs = shipped.rungs
        timed = max((rung.spacing for rung in rungs if rung.time > TIMED), default=rungs[-1].spacing)
        self._announced = f"This scene was measured before; a run at {timed:g} m tells how fast this machine is."
        result = self._probe(timed)
        if result["status"] != "finished":
            raise PurchaseError(f"The probe at {timed:.4g} m failed: {result['problem']}")
        time = self._time(pace_of([(self._at(timed), result)]))
        return _Found(rungs, shipped.shared, time, "from shipped measurements of this scene")

    def own(self) -> _Found:
        """What coarse runs tell; fewer where a budget is short."""
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
        rungs = [rung_of(scene.numerics.spacing_m, result) for scene, result in runs]
        shared = self._shared(rungs[0])
        timed = None
        scene = timing_scene(runs, lambda spacing: max(aligned(self._scenario, spacing), self._finest))
        if scene is not None:
            timed = (scene, *self._timed(scene))
        return _Found(rungs, shared, self._time(pace_of(runs, timed)), "from a probe of coarse runs")

    def _shared(self, rung: Rung) -> dict[str, float]:
        """Relative change of each key quantity at a rung with all refined that the rungs share."""
        result = self._probe(rung.spacing, refined=True)
        if result["status"] == "given up":
            raise self._short(f"probing took {duration(self.spent)}")
        if result["status"] != "finished":
            raise PurchaseError(
                f"The probe at {rung.spacing:.4g} m with all settings refined failed: {result['problem']}; how far "
                "the settings are to be trusted in this scene is not known, choose by --spacing."
            )
        return {
            name: abs(result["figures"][name] - value) / abs(value)
            for name, value in rung.figures.items()
            if value and result["figures"].get(name) is not None
        }

    def _ladder(self) -> list[float]:
        """Spacings of the probes [m], coarse first, that the budget allows, or that are agreed to."""
        first = self._spacings(PROBE_CELLS[:1])[0]
        if self._budget is None:
            every = self._spacings(PROBE_CELLS)
            self._announced = f"Probing this scene at spacings of {', '.join(f'{one:.4g}' for one in every)} m."
            least = self._expected(self._least(first), 0.0, every)
            if least > LONG:
                self.ask(f"probes of {duration(least)} at least")
            result = self._probe(first)
            expected = self._expected(_stepping(result), result["preparation_time"], every)
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
            expected = self._expected(_stepping(result), result["preparation_time"], spacings)
            if self.spent + expected <= share * room:
                return spacings
        raise self._short(f"the probes that it takes to choose a spacing take {duration(self.spent + expected)}")

    def _short(self, why: str) -> PurchaseError:
        return PurchaseError(
            f"{self._asked} is too short for this scene: {why}, and about {self._bench.around:.2g} s go to start and "
            "finish; ask for more, or choose by --spacing."
        )

    def _expected(self, stepping: float, setup: float, spacings: Sequence[float]) -> float:
        """Time [s] of the probes of these spacings, coarse first, that are missing, from that of the coarsest.

        The one with all settings refined is as much dearer as it has more steps and more points.
        """
        first = self._spacings(PROBE_CELLS[:1])[0]
        plain, fine = self._scenario.numerics, self._refined(first).numerics
        points = fine.points_per_cell / plain.points_per_cell
        times = [
            stepping * (first / spacing) ** DEARER + setup * first / spacing
            for spacing in spacings
            if self._known(spacing) is None
        ]
        coarsest = spacings[0]
        if self._known(coarsest, refined=True) is None:
            steps = plain.courant_number / fine.courant_number
            times.append(points * (steps * stepping * (first / coarsest) ** DEARER + setup * first / coarsest))
        return sum(times)

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

    def _refined(self, spacing: float) -> Scenario:
        return refined_everything(self._scenario, spacing).scenario

    def _time(self, pace: Pace) -> Callable[[float], float]:
        return lambda spacing: pace.time(self._at(spacing)) + self._bench.around

    def _known(self, spacing: float, *, refined: bool = False) -> Result | None:
        found: Result | None = self._kept.content().get("probes", {}).get(_probe_name(spacing, refined))
        return found

    def _probe(self, spacing: float, *, refined: bool = False) -> Result:
        """A whole run at a spacing [m], its other settings refined or as they are, kept or run now."""
        known = self._known(spacing, refined=refined)
        if known is not None:
            return known
        scenario = self._refined(spacing) if refined else ladder(self._scenario, [spacing])[0].scenario
        self._prepare(scenario)
        limit = math.inf
        if self._budget is not None:
            limit = self._budget - self._bench.around - self.spent
        elif not self._agreed:
            limit = LONG
        result = self._bench.measure(scenario, limit)
        if result["status"] == "given up":
            if self._budget is not None:
                return result
            whole = _stepping(result) * self._scenario.output.end_time_s / max(result["end_time"], 1e-12)
            self.ask(f"probes that take more than {duration(whole)}")
            result = self._bench.measure(scenario, math.inf)
        figures = {name: result["figures"].get(name) for name in KEY_QUANTITIES}
        held = {"status": result["status"], "figures": figures} | {name: result[name] for name in HELD}
        name = _probe_name(spacing, refined)
        found: Result = self._kept.add({"probes": {name: held}})["probes"][name]
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


def _probe_name(spacing: float, refined: bool) -> str:
    return f"{spacing:.12g}{', refined' if refined else ''}"


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
