"""Buying accuracy: the spacing that keeps an error, or that fits into a time, from a ladder of runs of the scene."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from analytic.force_record import cumulative_impulse
from analytic.whole_file import write_whole
from warp_mpm.accuracy.errors import KEY_QUANTITIES, QUANTITIES, Array
from warp_mpm.accuracy.keys import DATA, rules_digest, scenario_fields, scene_key
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import SERIES_INTERVAL, Setting, ladder
from warp_mpm.results import Results
from warp_mpm.scenario import Scenario, Trapezoid

PROBE_CELLS = (6.0, 8.0, 11.0, 15.0)
"""Spacings of a probe: cells in the flow's depth. The finest costs a few per cent of a run of 40 cells."""

FINEST_CELLS = 120.0
"""Most cells in the flow's depth that are sold: errors were measured far coarser."""

SAFETY = 1.25
"""Factor on an error that follows a law (Roache's grid convergence index)."""

CLEAR = 0.25
"""A ladder follows a law where its scatter about it is less than this share of what varies."""

TIMED = 0.5
"""Least time of a shipped rung [s] that is worth running to learn how fast a machine is."""

OVERHEAD = 2.3
"""Time of a command [s] beside the stepping: imports, compiled kernels, files, figures; measured."""


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
    """Expected time of the run on this machine [s]."""
    errors: dict[str, float]
    """Expected relative errors of the key quantities."""
    values: dict[str, float]
    """Values of the key quantities on the finest grids, SI: extrapolated, or of the finest run."""
    source: str
    """What it rests on."""

    @property
    def error(self) -> float:
        """Greatest of the expected errors."""
        return max(self.errors.values())

    def described(self) -> str:
        """In words."""
        parts = ", ".join(f"{QUANTITIES[name].label} {error:.1%}" for name, error in self.errors.items())
        return (
            f"Chosen: spacing {self.spacing:.4g} m ({self.source}). Expected, on a free core: "
            f"{self.time - OVERHEAD:.2g} s for the steps and their records and about {OVERHEAD:g} s to start and to "
            f"finish; errors of at most {self.error:.1%} ({parts})."
        )

    def settled(self, run: Path, cpu_time: float) -> str:
        """What was got, in words.

        Args:
            run: the folder of the run, which has ended.
            cpu_time: what it took of the processor [s]; on a free core that is the wall time.
        """
        figures = figures_of(run)
        parts = ", ".join(
            f"{QUANTITIES[name].label} {abs(figures[name] - value) / abs(value):.1%}"
            for name, value in self.values.items()
            if figures.get(name) is not None and value
        )
        return (
            f"Got: {figures['wall_time']:.2g} s for the steps and their records, {cpu_time:.3g} s of the processor in "
            f"all, {cpu_time / self.time:.2g} times what was expected; away from the values expected on the finest "
            f"grids: {parts}."
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
    if not 0.001 <= value <= 0.5:
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
    device: str = "cpu",
    measure: Callable[[Scenario], Result] | None = None,
    on_probe: Callable[[str], None] = lambda sentence: None,
) -> Offer:
    """Choose the spacing that keeps an error, or the best one within a time.

    A scene of which a ladder is shipped needs one coarse run, which tells how fast this machine is; any other is probed
    by four coarse runs.

    Args:
        scenario: what will be run; its other settings stay.
        accuracy: greatest relative error of the key quantities.
        budget: time of the run [s].
        device: of the probes and the run.
        measure: runs a scenario; `warp_mpm.accuracy.measure.measure` but for tests.
        on_probe: told what is being probed.

    Raises:
        PurchaseError: it cannot be had; the sentence tells what can.
    """
    if measure is None:
        from warp_mpm.accuracy.measure import measure as measured

        measure = partial(measured, device=device)
    assert (accuracy is None) != (budget is None)
    shipped = shipped_ladders().get(scene_key(scenario))
    default = type(scenario.numerics)()
    own = scenario.numerics.model_copy(update={"spacing_m": default.spacing_m})
    if shipped is not None and own == default:
        timed = max((rung.spacing for rung in shipped if rung.time > TIMED), default=shipped[-1].spacing)
        on_probe(f"This scene was measured before; a run at {timed:g} m tells how fast this machine is.")
        there = next(rung for rung in shipped if rung.spacing == timed)
        rungs, speed = shipped, _rung(scenario, timed, measure).time / there.time
        source = "from shipped measurements of this scene"
    else:
        spacings = [aligned(scenario, scenario.flow.depth / cells) for cells in PROBE_CELLS]
        on_probe(f"Probing this scene at spacings of {', '.join(f'{spacing:.4g}' for spacing in spacings)} m.")
        rungs, speed = [_rung(scenario, spacing, measure) for spacing in spacings], 1.0
        source = "from a probe of coarse runs"
    sold = sold_spacings(scenario, max(rung.spacing for rung in rungs))
    return choose(rungs, sold, accuracy=accuracy, budget=budget, speed=speed, source=source)


def choose(
    rungs: Sequence[Rung],
    sold: Sequence[float],
    *,
    accuracy: float | None = None,
    budget: float | None = None,
    speed: float = 1.0,
    source: str = "",
) -> Offer:
    """The offer that a ladder allows; see `buy`.

    Args:
        rungs: at least three spacings.
        sold: spacings to choose from [m], fine first.
        speed: time on this machine over that of the ladder.
    """
    law = _Law(rungs, speed)
    if accuracy is not None:
        kept = [s for s in sold if law.error(s) <= accuracy]
        if not kept:
            least = min(law.error(s) for s in sold)
            best = max(s for s in sold if law.error(s) <= least * (1.0 + 1e-9))
            errors = law.errors(best)
            scattered = QUANTITIES[max(errors, key=lambda name: errors[name])].label
            raise PurchaseError(
                f"--accuracy {_text(accuracy)} cannot be promised for this scene: the best on offer is "
                f"{_text(least, up=True)} at a spacing of {best:.4g} m, in {law.time(best):.3g} s. It is the "
                f"{scattered} that varies by so much from one spacing to the next, and finer ones are not known to do "
                f"better; ask for --accuracy {_text(least, up=True)}, or choose by --spacing or --budget."
            )
        spacing = max(kept)
    else:
        assert budget is not None
        kept = [s for s in sold if law.time(s) <= budget]
        if not kept:
            raise PurchaseError(
                f"--budget {budget:g}s is too short for this scene: the coarsest spacing sold, {sold[-1]:.4g} m, "
                f"takes {law.time(sold[-1]):.3g} s."
            )
        spacing = min(kept)
    return Offer(spacing, law.time(spacing), law.errors(spacing), law.values, source)


def aligned(scenario: Scenario, spacing: float) -> float:
    """The nearest spacing that puts the barrier's crest on a grid line, or the flow's surface where that is higher.

    A crest between two grid lines is off by up to half a cell, at every spacing by another part of it.
    """
    length = _aligned_length(scenario)
    return length / max(round(length / spacing), 1)


def sold_spacings(scenario: Scenario, coarsest: float) -> list[float]:
    """Spacings that `aligned` gives, from the finest sold to the coarsest that was measured [m]."""
    length = _aligned_length(scenario)
    first, last = math.ceil(length / coarsest - 1e-9), math.floor(FINEST_CELLS * length / scenario.flow.depth)
    return [length / rows for rows in range(max(last, first), first - 1, -1)]


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
    """Time and error against the spacing, from a ladder.

    Where the ladder follows a first-order law f = f0 + a h, the error is 1.25 |a h| plus the scatter about the line.
    Mostly it does not: the figures scatter by a per cent or more as the flow meets the grid in another way. The error
    of a spacing is then what was seen, the greatest deviation of it and the finer ones from the finest, and no less
    than the spread of the three finest: that finer spacings do better was not seen, so it is not promised.
    """

    def __init__(self, rungs: Sequence[Rung], speed: float):
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
            if scatter < CLEAR * float(np.ptp(f)):
                self.values[name], self._laws[name] = float(f0), (float(a), scatter)
            else:
                self.values[name] = float(f[0])
                self._seen[name] = np.maximum(np.maximum.accumulate(np.abs(f - f[0])), np.ptp(f[:3]))
        if not self.values:
            raise PurchaseError(
                "In none of the probes did the flow reach a barrier, so there are no figures whose accuracy could be "
                "bought; look at barrier, flow.velocity_m_per_s, the flow's distance and output.end_time_s."
            )
        # Fine runs tell more of finer ones.
        exponent, self._constant = np.polyfit(np.log(h), np.log([rung.time * speed for rung in rungs]), 1, w=1.0 / h)
        self._exponent = float(exponent)

    def time(self, spacing: float) -> float:
        return float(np.exp(self._constant + self._exponent * np.log(spacing))) + OVERHEAD

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


def _rung(scenario: Scenario, spacing: float, measure: Callable[[Scenario], Result]) -> Rung:
    (setting,) = ladder(scenario, [spacing])
    result = measure(setting.scenario)
    if result["status"] != "finished":
        raise PurchaseError(f"The probe at {spacing:.4g} m failed: {result['problem']}")
    return _rung_of(spacing, result)


def _rung_of(spacing: float, result: Result) -> Rung:
    figures = {name: result["figures"].get(name) for name in KEY_QUANTITIES}
    known = {name: float(f"{value:.7g}") for name, value in figures.items() if value is not None}
    return Rung(spacing, float(f"{result['cpu_time'] + result['recording_time']:.4g}"), known)
