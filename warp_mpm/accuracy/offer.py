"""What is offered for an accuracy or a time: the law of the error behind it, the choice, and what came of it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analytic.force_record import cumulative_impulse
from warp_mpm.accuracy.errors import KEY_QUANTITIES, QUANTITIES, SAFETY, Array
from warp_mpm.accuracy.measure import SERIES_INTERVAL
from warp_mpm.results import Results

LEAST_RUNGS = 3
"""Runs that a ladder needs."""

CLEAR = 0.25
"""A ladder follows a law where its scatter about it is less than this share of what varies."""

LEAST, MOST = 0.001, 0.5
"""Range of the accuracies that can be asked for."""


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


def choose(
    rungs: Sequence[Rung],
    sold: Sequence[float],
    time: Callable[[float], float],
    *,
    shared: Mapping[str, float],
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
        shared: relative part of each key quantity's error that no spacing takes away: what the time step, the filters
            and the points do to it.
        accuracy: greatest error.
        budget: greatest time [s].
        around: what of a time is to start and to finish [s].
        source: what the ladder rests on.
    """
    law = _Law(rungs, shared)
    if accuracy is not None:
        kept = [s for s in sold if law.error(s) <= accuracy]
        if not kept:
            least = min(law.error(s) for s in sold)
            best = max(s for s in sold if law.error(s) <= least * (1.0 + 1e-9))
            errors = law.errors(best)
            worst = max(errors, key=lambda name: errors[name])
            why = "varies by so much from one spacing to the next, and finer ones are not known to do better"
            if shared.get(worst, 0.0) > math.sqrt(0.5) * least:  # more than half of the square
                why = (
                    f"changes by {_text(shared[worst])} when the time step, the filters and the points are refined, "
                    "which no spacing takes away"
                )
            granted = f"ask for --accuracy {_text(least, up=True)}, or choose" if least <= MOST else "choose"
            raise PurchaseError(
                f"--accuracy {_text(accuracy)} cannot be promised for this scene: the best on offer is "
                f"{_text(least, up=True)} at a spacing of {best:.4g} m, in {duration(time(best))}. It is the "
                f"{QUANTITIES[worst].label} that {why}; {granted} by --spacing or --budget."
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


class _Law:
    """Error against the spacing, from a ladder.

    Where the ladder follows a first-order law f = f0 + a h, the error is 1.25 |a h| plus the scatter about the line.
    Mostly it does not: the figures scatter by a per cent or more as the flow meets the grid in another way. The error
    of a spacing is then what was seen, the greatest deviation of it and the finer ones from the finest, and no less
    than the spread of the three finest: that finer spacings do better was not seen, so it is not promised.

    What the settings do that all spacings share is added as the root of the squares, as in the budget of a study.
    """

    def __init__(self, rungs: Sequence[Rung], shared: Mapping[str, float]):
        self._shared = shared
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
            found[name] = math.hypot(error / max(abs(value), 1e-300), self._shared.get(name, 0.0))
        return found

    def error(self, spacing: float) -> float:
        return max(self.errors(spacing).values())


def duration(seconds: float) -> str:
    """A time in words: `12 s`, `34 min`, `2.5 h`."""
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


def _text(share: float, *, up: bool = False) -> str:
    """A percentage of two digits, rounded up where a promise must hold."""
    percent = 100.0 * share
    if up and percent > 0.0:
        unit = 10.0 ** (math.floor(math.log10(percent)) - 1)
        percent = math.ceil(percent / unit - 1e-9) * unit
    return f"{percent:.2g}%"
