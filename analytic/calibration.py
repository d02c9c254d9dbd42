"""The closed form's two numbers, s1max (or lambda) and tau, from the force history of an impact.

Plain arrays in, so that the history may come from the simulator, a flume or the field. Two rules:

`peak`
    The paper's (section 3.2): s1max from the peak force by Eqs. (5) and (7), tau = T1 / T2 from its time.
`least_squares`
    The triangle that is nearest to F(t), in the mean square from arrival to the end of the impact.

A peak is a matter of filtering, and so are lambda and tau. Here the force is smoothed by a moving mean whose length is
part of the result.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.arrays import trajectory
from analytic.force_record import (
    FILTER_WINDOW,
    START_SHARE,
    cumulative_impulse,
    filtered_peak,
    impact_end,
    moving_mean,
    still_rises,
)
from analytic.impact import Impact
from analytic.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

RULES = ("peak", "least_squares")


class CalibrationError(ValueError):
    """A history from which nothing can be calibrated; one sentence that says why."""


class NoImpactError(CalibrationError):
    """A history in which there is no impact, or none yet."""


@dataclass(frozen=True)
class Measured:
    """What a force history says about an impact. Times count from the start of the record, SI units."""

    arrival_time: float
    """Start of the first interval in which the force exceeds 1 % of its peak [s]."""
    peak_force: float
    """Largest value of the filtered force [N/m]; where it still rises, that so far."""
    peak_time: float
    """Its time [s]."""
    rises: bool
    """Whether the filtered force is largest where the record ends: peak, times and impulse are then bounds from
    below."""
    end_time: float
    """Time after which the filtered force stays within 10 % of the peak above the residual force [s]."""
    over: bool
    """Whether the impact ends within the record, by the rule of the simulator's summary: `end_time` lies before its
    last tenth, and by then the force has settled. It has not where the residual force is above 5 % of the peak and, at
    the rate of its last change, would change by more than 10 % of the peak in as long as the impact has lasted. Then a
    longer record shows a later end, and `duration` and `impulse` are bounds from below."""
    impulse: float
    """Integral of the force from arrival to end [N s/m]."""
    residual_force: float
    """Mean force over the last tenth of the record, mostly the thrust of what has come to rest [N/m]."""
    filter_window: float
    """Length of the moving mean [s]."""

    @property
    def rise_time(self) -> float:
        """T1 [s]."""
        return self.peak_time - self.arrival_time

    @property
    def duration(self) -> float:
        """T2 [s]."""
        return self.end_time - self.arrival_time

    @property
    def warning(self) -> str | None:
        """One sentence where the impact is not over at the end of the record, else `None`."""
        if self.rises:
            return "the force still rises at the end of the record"
        if self.over:
            return None
        share = self.residual_force / self.peak_force
        return f"the impact is not over at the end of the record, the force is {share:.0%} of its peak and changing"

    @property
    def at_least(self) -> tuple[str, ...]:
        """Names of the figures that the record only bounds from below."""
        if self.rises:
            return ("peak_force", "rise_time", "duration", "impulse")
        return () if self.over else ("duration", "impulse")

    @property
    def filter_rule(self) -> str:
        """How the peak was filtered, in words."""
        return f"peak of the moving mean over {self.filter_window:g} s, time from the first force above 1 % of the peak"


def measure(time: Array, force: Array, filter_window: float = FILTER_WINDOW) -> Measured:
    """Peak, times and impulse of a force history, which may end at any moment of the impact.

    Args:
        time: ends of the sampling intervals [s], increasing; the first is the start of the record.
        force: mean force over the interval that ends then [N/m].
        filter_window: length of the moving mean [s] >= 0; 0 leaves the force as it is.

    Raises:
        NoImpactError: the force is never above nil.
        CalibrationError: the arrays do not fit together, hold no number, or fewer than three samples.
    """
    time, force = np.asarray(time, dtype=float), np.asarray(force, dtype=float)
    if time.ndim != 1 or time.shape != force.shape:
        raise CalibrationError(f"time and force have the shapes {time.shape} and {force.shape}, they must be alike.")
    if len(time) < 3:
        raise CalibrationError(f"The record has {len(time)} samples, it must have three at least.")
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(force)) and np.all(np.diff(time) > 0)):
        raise CalibrationError("time and force must be finite, and time must increase.")
    if not (math.isfinite(filter_window) and filter_window >= 0):
        raise CalibrationError(f"filter_window is {filter_window:g}, it must be a number in [0, inf).")
    length = max(FILTER_WINDOW, float(time[-1] - time[0]))
    if filter_window > length:
        raise CalibrationError(
            f"filter_window is {filter_window:g}, it must be at most {length:g} s, the record's length."
        )
    filtered = moving_mean(time, force, filter_window)
    peak = filtered_peak(filtered)
    if not (force.max() > 0 and filtered[peak] > 0):
        raise NoImpactError("The force is never above nil, there is no impact to calibrate on.")
    first = int(np.argmax(force > START_SHARE * force.max()))
    arrival = float(time[max(first - 1, 0)])
    impulse = cumulative_impulse(time, force)
    end = impact_end(time, force, filtered, arrival)
    return Measured(
        arrival_time=arrival,
        peak_force=float(filtered[peak]),
        peak_time=float(time[peak]),
        rises=still_rises(filtered),
        end_time=end.time,
        over=end.over,
        impulse=float(np.interp(end.time, time, impulse) - np.interp(arrival, time, impulse)),
        residual_force=max(end.residual_force, 0.0),
        filter_window=filter_window,
    )


# --- the two rules ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Calibration:
    """A closed form fitted to a force history."""

    rule: str
    """One of `RULES`."""
    s1max: float
    """[m], as the rule gives it."""
    geometry_change: float
    """lambda = s1max / L_1,0 [-], as the rule gives it."""
    rise_ratio: float
    """tau = T1 / T2 [-], as the rule gives it."""
    within_range: bool
    """Whether s1max <= L_1,0 and tau <= 1; if not, `impact` uses the nearest values that are."""
    vertical_load_ratio: float
    """kappa [-] of `impact`."""
    impact: Impact
    """The closed form on the clock of the record."""
    measured: Measured


def calibrate(
    time: Array,
    force: Array,
    scene: Scene,
    *,
    rule: str = RULES[0],
    filter_window: float = FILTER_WINDOW,
    vertical_load_ratio: float = 0.0,
) -> Calibration:
    """Fit s1max and tau of the variant `stick_slip` to a force history.

    Args:
        time, force, filter_window: as in `measure`.
        scene: masses, length and speed of the flow, and the barrier.
        rule: one of `RULES`.
        vertical_load_ratio: kappa of the closed form; it moves the barrier, not the force.

    Raises:
        CalibrationError: the history holds no impact, or ends before its peak, or the rule is unknown.
    """
    if rule not in RULES:
        raise CalibrationError(f"rule is {rule!r}, it must be one of {', '.join(RULES)}.")
    time, force = np.asarray(time, dtype=float), np.asarray(force, dtype=float)
    measured = measure(time, force, filter_window)
    if measured.rises:
        raise CalibrationError("The force still rises when the record ends, there is no peak to calibrate on.")
    if not measured.rise_time > 0:
        raise CalibrationError("The force falls from where the record begins, there is no rise to calibrate on.")
    s1max, rise_ratio = _by_peak(measured, scene)
    if rule == "least_squares":
        s1max, rise_ratio = _by_least_squares(time, force, measured, scene, start=(s1max, rise_ratio))
    # A fit that ends on a bound is as little within the range as a peak that lies beyond it.
    within = s1max < scene.flow_length * (1 - 1e-6) and rise_ratio < 1 - 1e-6
    impact = scene.impact(
        s1max=min(s1max, scene.flow_length),
        rise_ratio=min(rise_ratio, 1.0),
        arrival_time=measured.arrival_time,
        vertical_load_ratio=0.0 if scene.fixed else vertical_load_ratio,
    )
    return Calibration(
        rule=rule,
        s1max=s1max,
        geometry_change=s1max / scene.flow_length,
        rise_ratio=rise_ratio,
        within_range=within,
        vertical_load_ratio=impact.vertical_load_ratio,
        impact=impact,
        measured=measured,
    )


WIDEST_WINDOW = 0.5
"""Longest moving mean [s] that is looked at for a given lambda."""


@dataclass(frozen=True)
class WindowOf:
    """The moving mean that a given lambda would need by the rule of the peak."""

    geometry_change: float
    """lambda [-]."""
    peak_force: float
    """That belongs to it [N/m]."""
    window: float | None
    """Length of the longest moving mean whose peak is as great [s]; `None` where none is, nor a single record."""
    largest_force: float
    """Greatest record of the history [N/m]."""

    @property
    def words(self) -> str:
        """One sentence without capital and stop."""
        asked = f"λ = {self.geometry_change:g} needs a peak of {self.peak_force / 1e3:.3g} kN/m"
        if self.window is None:
            return (
                f"{asked}, and no moving mean reaches that: the greatest single record is "
                f"{self.largest_force / 1e3:.3g} kN/m"
            )
        if self.window == 0.0:
            return f"{asked}, which single records alone reach, and no moving mean"
        longest = "or more " if self.window >= WIDEST_WINDOW else ""
        return f"{asked}, which is that of a moving mean over {self.window:.2g} s {longest}".rstrip()


def window_of(geometry_change: float, time: Array, force: Array, scene: Scene) -> WindowOf:
    """The moving mean whose peak gives a lambda [-] by Eqs. (5) and (7).

    The peak of the mean falls as it gets longer, so that each lambda has one window, or none.

    Args:
        geometry_change: lambda.
        time, force: as in `measure`.
        scene: masses, length and speed of the flow, and the barrier.
    """
    time, force = np.asarray(time, dtype=float), np.asarray(force, dtype=float)
    needed = 0.75 * _reduced_mass(scene) * scene.speed**2 / (geometry_change * scene.flow_length)
    largest = float(force.max())
    shortest = float(np.diff(time).min())
    window: float | None = None if largest < needed else 0.0
    for length in np.geomspace(shortest, max(WIDEST_WINDOW, shortest), 200):
        if float(moving_mean(time, force, float(length)).max()) >= needed:
            window = float(length)
    return WindowOf(geometry_change, needed, window, largest)


def _reduced_mass(scene: Scene) -> float:
    return (
        scene.flow_mass if scene.barrier_mass is None else scene.flow_mass / (1 + scene.flow_mass / scene.barrier_mass)
    )


def _by_peak(measured: Measured, scene: Scene) -> tuple[float, float]:
    """s1max = (3/4) mu v^2 / F_peak, from Eqs. (5) and (7), and tau = T1 / T2 with T2 of Eq. (8)."""
    s1max = 0.75 * _reduced_mass(scene) * scene.speed**2 / measured.peak_force
    return s1max, measured.rise_time / (8 * s1max / (3 * scene.speed))


def _by_least_squares(
    time: Array, force: Array, measured: Measured, scene: Scene, start: tuple[float, float]
) -> tuple[float, float]:
    from scipy.optimize import least_squares

    inside = (time > measured.arrival_time) & (time <= measured.end_time)
    widths = np.diff(time, prepend=time[0])[inside]
    ends, starts = time[inside], time[inside] - widths
    scale = np.sqrt(widths) / (measured.peak_force * math.sqrt(widths.sum()))

    def residuals(parameters: Array) -> Array:
        impact = scene.impact(
            s1max=parameters[0] * scene.flow_length, rise_ratio=parameters[1], arrival_time=measured.arrival_time
        )
        # The history holds means over intervals, hence the impulse over each and not the force at its end.
        mean = (trajectory(impact, ends).impulse - trajectory(impact, starts).impulse) / widths
        return (mean - force[inside]) * scale

    low, high = np.array([1e-3, 1e-3]), np.array([1.0, 1.0])
    first = np.clip([start[0] / scene.flow_length, start[1]], 1.01 * low, 0.99 * high)
    # A triangle has kinks; two starts keep the fit out of the poorer of two valleys.
    fits = [least_squares(residuals, x0, bounds=(low, high), xtol=1e-12) for x0 in (first, np.array([0.5, 0.3]))]
    best = min(fits, key=lambda fit: fit.cost)
    return float(best.x[0] * scene.flow_length), float(best.x[1])


def measured_vertical_load_ratio(
    time: Array, force: Array, base_normal_force: Array, weight: float, measured: Measured
) -> float:
    """kappa [-]: vertical load of the flow on the barrier over its horizontal force, as impulses over the impact.

    Args:
        time [s], force [N/m]: as in `measure`.
        base_normal_force: force with which the barrier presses on its base, mean over the interval [N/m].
        weight: with which the barrier alone presses on its base [N/m].

    Raises:
        CalibrationError: the force pulls more than it pushes.
    """
    inside = (time > measured.arrival_time) & (time <= measured.end_time)
    widths = np.diff(time, prepend=time[0])[inside]
    impulse = float(force[inside] @ widths)
    if not impulse > 0:
        raise CalibrationError(f"The impulse of the impact is {impulse:g} N s/m, it must be greater than 0.")
    return float((base_normal_force[inside] - weight) @ widths) / impulse


# --- misfits ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Misfit:
    """How far a closed form is from a record, as root mean squares; `None` where the record is silent."""

    force: float
    """Root mean square over the measured impact, over the measured peak force [-]."""
    flow_kinetic_energy: float | None
    """Over the measured impact, over the largest energy since arrival [-]."""
    barrier_velocity: float | None
    """From arrival to the end of the record, over the largest measured velocity [-]."""
    barrier_displacement: float | None
    """From arrival to the end of the record, over the largest measured displacement [-]."""


def misfit(impact: Impact, series: Mapping[str, Array], measured: Measured) -> Misfit:
    """Distance of `impact` from a record (columns as in `analytic.time_series`)."""
    time = series["time"]
    curves = trajectory(impact, time)
    since_arrival = time > measured.arrival_time
    during_impact = since_arrival & (time <= measured.end_time)

    def distance(name: str, computed: Array, where: Mask) -> float | None:
        if name not in series:
            return None
        scale = float(np.abs(series[name][since_arrival]).max())
        return _root_mean_square((computed - series[name])[where]) / scale if scale > 0 else None

    return Misfit(
        force=_root_mean_square((curves.force - series["impact_force_x"])[during_impact]) / measured.peak_force,
        flow_kinetic_energy=distance("flow_kinetic_energy", curves.flow_kinetic_energy, during_impact),
        barrier_velocity=distance("barrier_velocity", curves.barrier_velocity, since_arrival),
        barrier_displacement=distance("barrier_displacement", curves.barrier_displacement, since_arrival),
    )


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class KeyFigures:
    """The quantities of the paper's Figs. 13 and 14, SI units per metre of width; `None`: not recorded."""

    peak_force: float
    rise_time: float | None
    duration: float | None
    impulse: float
    flow_kinetic_energy_at_peak: float | None
    barrier_kinetic_energy_max: float | None
    barrier_velocity_max: float | None
    barrier_displacement_final: float | None
    at_least: tuple[str, ...] = ()
    """Names of the figures that a record only bounds from below, because it ends too early."""


def key_figures(impact: Impact) -> KeyFigures:
    """Key figures of a closed form."""
    return KeyFigures(
        peak_force=impact.peak_force,
        rise_time=impact.peak_time - impact.arrival_time,
        duration=impact.duration,
        impulse=impact.impulse,
        flow_kinetic_energy_at_peak=impact.flow_kinetic_energy(impact.peak_time),
        barrier_kinetic_energy_max=impact.barrier_kinetic_energy_max,
        barrier_velocity_max=impact.barrier_velocity_max,
        barrier_displacement_final=impact.barrier_displacement_final,
    )


def measured_key_figures(series: Mapping[str, Array], measured: Measured | None) -> KeyFigures:
    """Key figures of a record (columns as in `analytic.time_series`); `measured` is None where there is no impact
    in it."""

    def largest(name: str) -> float | None:
        return float(series[name].max()) if name in series else None

    energy = series.get("flow_kinetic_energy")
    return KeyFigures(
        peak_force=0.0 if measured is None else measured.peak_force,
        rise_time=None if measured is None else measured.rise_time,
        duration=None if measured is None else measured.duration,
        impulse=0.0 if measured is None else measured.impulse,
        flow_kinetic_energy_at_peak=(
            None
            if energy is None or measured is None or measured.rises
            else float(np.interp(measured.peak_time, series["time"], energy))
        ),
        barrier_kinetic_energy_max=largest("barrier_kinetic_energy"),
        barrier_velocity_max=largest("barrier_velocity"),
        barrier_displacement_final=float(series["barrier_displacement"][-1])
        if "barrier_displacement" in series
        else None,
        at_least=bounded_from_below(series, measured),
    )


def bounded_from_below(series: Mapping[str, Array], measured: Measured | None) -> tuple[str, ...]:
    """Names of the key figures that a record only bounds from below, because impact or sliding outlast it."""
    found = ["peak_force", "impulse"] if measured is None else list(measured.at_least)
    to_come = measured is None or measured.rises
    if "barrier_velocity" in series and (to_come or not at_rest(series)):
        found.append("barrier_displacement_final")
        if to_come or series["barrier_velocity"][-1] == series["barrier_velocity"].max():
            found += ["barrier_velocity_max", "barrier_kinetic_energy_max"]
    return tuple(found)


def at_rest(series: Mapping[str, Array]) -> bool:
    """Whether the barrier is at rest at the end of a record; true where its velocity is not recorded."""
    return "barrier_velocity" not in series or float(series["barrier_velocity"][-1]) == 0.0


def warnings(series: Mapping[str, Array], measured: Measured | None) -> list[str]:
    """What is not over at the end of a record, in sentences without capital and stop."""
    told = "the force is never above nil, there is no impact in the record" if measured is None else measured.warning
    found = [] if told is None else [told]
    if not at_rest(series):
        speed = float(series["barrier_velocity"][-1])
        found.append(f"the barrier still moves at {speed:.3g} m/s at the end of the record")
    return found
