"""Errors of runs against the answer toward which the spacing leads, and how sure that answer is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.accuracy.budget import Budget
from warp_mpm.accuracy.measure import smoothed_force
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import DEFAULT, EVERYTHING, Setting
from warp_mpm.quantities import Quantity
from warp_mpm.quantities.figures import FIGURES
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Judged:
    """A figure or a curve whose error is measured."""

    name: str
    quantity: Quantity
    note: str = ""
    """What is special about it here."""
    scale: str = "itself"
    """What an error is relative to: `itself`, the name of another figure, or `volume` of the flow."""
    curve: str | None = None
    """Column of a curve; its error is the root mean square over the run, relative to the curve's greatest value."""
    converges: bool = True
    """Whether finer grids lead anywhere: the greatest value at any point and any sample grows with their number."""

    @property
    def label(self) -> str:
        """Words and symbol, and what is special."""
        symbol = "" if self.curve else self.quantity.symbol
        return f"{self.quantity.words} {symbol}".strip() + self.note

    @property
    def unit(self) -> str:
        """In which it is shown."""
        return self.quantity.shown_unit

    @property
    def factor(self) -> float:
        """From SI to `unit`."""
        return self.quantity.factor


def _figure(name: str, note: str = "", scale: str = "itself", *, converges: bool = True) -> Judged:
    return Judged(name, FIGURES[name], note, scale, converges=converges)


def _over_time(name: str, column: str, note: str = " over time") -> Judged:
    return Judged(name, NAMED[column], note, curve=column)


QUANTITIES: Mapping[str, Judged] = {
    judged.name: judged
    for judged in (
        _figure("peak_force", ", 10 ms mean"),
        _figure("peak_force_time", " (of T₂)", scale="impact_duration"),
        _figure("impulse"),
        _figure("impact_impulse"),
        _figure("impact_duration"),
        _figure("barrier_displacement_final"),
        _figure("barrier_velocity_max"),
        *(_figure(name) for name in ("pressure_patch_max", "pore_pressure_patch_max") if name in FIGURES),
        _figure("pore_pressure_max", " (does not converge)", converges=False),
        _figure("overtopped_volume", " (of the flow's)", scale="volume"),
        _over_time("force_curve", "impact_force_x", " over time, 50 ms mean"),
        _over_time("energy_curve", "flow_kinetic_energy"),
        _over_time("displacement_curve", "barrier_displacement"),
    )
}

KEY_QUANTITIES = ("peak_force", "impulse", "barrier_displacement_final")
"""What a design needs; their greatest error is the error of a setting as a whole."""

TOLD = tuple(name for name in (*KEY_QUANTITIES, "pressure_patch_max") if name in QUANTITIES)
"""Quantities of which a study tells what they cost, and what makes up their uncertainty."""

SAFETY = 1.25
"""Factor on an extrapolation whose order of convergence was observed (Roache's grid convergence index)."""

DRIFT = 2.0
"""Factor on the spread of the three finest runs where they still drift one way: what is left of an order of 0.6 over
spacings that halve."""

ORDERS = (0.5, 2.0)
"""Orders of convergence that are believed when observed (Eça and Hoekstra 2014)."""


@dataclass(frozen=True)
class Reference:
    """The value toward which a ladder leads."""

    value: float
    uncertainty: float
    """Half the width of the interval in which the value is thought to lie."""
    order: float | None
    """Observed order of convergence; None where the ladder shows none."""


def extrapolate(spacings: Sequence[float], values: Sequence[float]) -> Reference:
    """Richardson's extrapolation by least squares, f = f0 + a h^p, over a ladder in any order.

    Where the observed p lies in `ORDERS`, f0 is the answer, and its uncertainty 1.25 times the distance to the finest
    run, plus the scatter about the fit. Where it does not, the finest run itself is the answer, with the spread of the
    last three values as its uncertainty, twice that where they still drift one way: a ladder without order gives no
    reason to go beyond it. (Eça and Hoekstra, J. Comput. Phys. 262, 2014, simplified.)

    Raises:
        ValueError: fewer than three values.
    """
    if len(values) < 3:
        raise ValueError("an extrapolation needs at least three spacings")
    order = np.argsort(spacings)
    h, f = np.asarray(spacings, dtype=float)[order], np.asarray(values, dtype=float)[order]
    spread = float(np.ptp(f[:3]))
    if spread <= 1e-12 * float(np.abs(f).max()):
        return Reference(float(f[0]), spread, None)
    weights = 1.0 / h  # fine runs count more

    def fit(p: float) -> tuple[float, float, float]:
        basis = np.stack([np.ones_like(h), (h / h[0]) ** p], axis=1)
        (f0, a), *_ = np.linalg.lstsq(basis * weights[:, None], f * weights, rcond=None)
        residual = f - basis @ (f0, a)
        return float(f0), float(a), float(np.sqrt((residual**2 * weights).sum() / weights.sum()))

    from scipy.optimize import minimize_scalar

    best = float(minimize_scalar(lambda p: fit(p)[2], bounds=(0.1, 4.0), method="bounded").x)
    f0, change, scatter = fit(best)
    # A fit that explains less than half of what varies has not seen an order.
    if ORDERS[0] <= best <= ORDERS[1] and scatter < 0.25 * float(np.ptp(f)) and abs(change) > scatter:
        return Reference(f0, SAFETY * abs(f[0] - f0) + scatter, best)
    drifting = (f[1] - f[0]) * (f[2] - f[1]) > 0.0
    return Reference(float(f[0]), DRIFT * spread if drifting else spread, None)


@dataclass(frozen=True)
class References:
    """What errors of one scene are measured against."""

    scalars: dict[str, Reference]
    curves: dict[str, Array]
    """Curves of the finest run, by the quantity's name."""
    scales: dict[str, float]
    """What an error of each quantity is relative to [SI]."""
    finest: Result
    """The run that is itself the reference where no order was observed."""
    budget: Budget
    """What makes up the uncertainty; the spacing's part of a curve is the distance of the two finest runs'."""

    def uncertainty(self, name: str) -> float:
        """Relative uncertainty of a quantity's reference, of the spacing and of all that the ladder shares."""
        return self.budget.total(name)

    @property
    def names(self) -> list[str]:
        """Quantities that the scene has, in the order of `QUANTITIES`."""
        return [name for name in QUANTITIES if name in self.scalars or name in self.curves]

    @property
    def key_names(self) -> list[str]:
        """Those of `KEY_QUANTITIES` that the scene has."""
        return [name for name in KEY_QUANTITIES if name in self.scalars]

    @property
    def told_names(self) -> list[str]:
        """Those of `TOLD` that the scene has."""
        return [name for name in TOLD if name in self.scalars]


def references(
    scenario: Scenario, ladder: Sequence[Setting], results: Mapping[str, Result], refined: Sequence[Setting] = ()
) -> References:
    """References from the ladder of a scene's own settings.

    Args:
        scenario: the scene.
        ladder: settings that differ in spacing only; those that diverged are left out.
        results: by the settings' keys.
        refined: settings of which one, or all, are finer than the ladder's at one of its spacings.

    Raises:
        ValueError: fewer than three runs of the ladder came to their end.
    """
    runs = sorted((s for s in ladder if results[s.key]["status"] == "finished"), key=lambda s: s.spacing)
    if len(runs) < 3:
        raise ValueError("Fewer than three spacings came to their end; a reference needs at least three.")
    found = [results[setting.key] for setting in runs]
    spacings = [setting.spacing for setting in runs]
    scalars, scales = {}, {}
    for name, quantity in QUANTITIES.items():
        values = [result["figures"].get(name) for result in found]
        if quantity.curve is None and all(value is not None for value in values):
            scalars[name] = extrapolate(spacings, values)
    for name, reference in scalars.items():
        scale = QUANTITIES[name].scale
        size = reference.value
        if scale == "volume":
            size = scenario.flow.volume
        elif scale in scalars:
            size = scalars[scale].value
        elif scale != "itself":
            size = scenario.output.end_time_s
        scales[name] = abs(size) or 1.0
    finest, second = found[0], found[1]
    curves, doubt = {}, {}
    for name, quantity in QUANTITIES.items():
        if quantity.curve is not None and quantity.curve in finest["curves"]:
            curve = _curve(finest, quantity)
            # A barrier that does not move has a displacement, but no curve of one.
            if np.abs(curve).max() > 0.0:
                curves[name], scales[name] = curve, float(np.abs(curve).max())
                doubt[name] = _distance(_curve(second, quantity), curve)
    doubt |= {name: reference.uncertainty / scales[name] for name, reference in scalars.items()}
    budget = _budget(doubt, scales, ladder, refined, results)
    return References(scalars, curves, scales, finest, budget)


def _budget(
    spacing: Mapping[str, float],
    scales: Mapping[str, float],
    ladder: Sequence[Setting],
    refined: Sequence[Setting],
    results: Mapping[str, Result],
) -> Budget:
    rungs = {setting.spacing: results[setting.key] for setting in ladder}
    alone: dict[str, dict[str, float]] = {}
    together: dict[float, dict[str, float]] = {}
    lost = []
    for setting in refined:
        result, rung = results[setting.key], rungs[setting.spacing]
        if rung["status"] != "finished":
            continue
        if result["status"] != "finished":
            lost.append(setting.knob)
        elif setting.knob == EVERYTHING:
            together[setting.spacing] = _changes(result, rung, scales)
        else:
            alone[setting.knob] = _changes(result, rung, scales)
    at = min((setting.spacing for setting in refined), default=None)
    return Budget(spacing, alone, together, at, tuple(dict.fromkeys(lost)))


def _changes(result: Result, other: Result, scales: Mapping[str, float]) -> dict[str, float]:
    """What a run has otherwise than another, relative to the scales; of curves the root mean square."""
    found = {}
    for name, scale in scales.items():
        quantity = QUANTITIES[name]
        if quantity.curve is not None:
            squares = (_curve(result, quantity) - _curve(other, quantity)) ** 2
            found[name] = float(np.sqrt(np.mean(squares))) / scale
        elif result["figures"].get(name) is not None and other["figures"].get(name) is not None:
            found[name] = (result["figures"][name] - other["figures"][name]) / scale
    return found


def errors(result: Result, references: References) -> dict[str, float]:
    """Relative errors of a run that came to its end, by quantity; signed for scalars.

    A run that is itself the reference is off by what the reference is not known to.
    """
    found = {}
    for name in references.names:
        quantity = QUANTITIES[name]
        extrapolated = name in references.scalars and references.scalars[name].order is not None
        if result is references.finest and not extrapolated:
            found[name] = references.uncertainty(name)
        elif name in references.curves:
            if quantity.curve in result["curves"]:
                found[name] = _distance(_curve(result, quantity), references.curves[name])
        elif result["figures"].get(name) is not None:
            found[name] = (result["figures"][name] - references.scalars[name].value) / references.scales[name]
    return found


def overall(found: Mapping[str, float], references: References) -> float:
    """Greatest error of the key quantities; infinite where one is missing."""
    return max((abs(found.get(name, np.inf)) for name in references.key_names), default=np.inf)


def ladder_of(settings: Sequence[Setting], knob: str = DEFAULT, level: Any = None) -> list[Setting]:
    """The settings that share a knob's level, fine first."""
    return sorted((s for s in settings if s.knob == knob and s.level == level), key=lambda s: s.spacing)


def _curve(result: Result, quantity: Judged) -> Array:
    if quantity.curve == "impact_force_x":
        return np.asarray(smoothed_force(result["curves"]))
    return np.asarray(result["curves"][quantity.curve], dtype=float)


def _distance(curve: Array, reference: Array) -> float:
    return float(np.sqrt(np.mean((curve - reference) ** 2)) / np.abs(reference).max())
