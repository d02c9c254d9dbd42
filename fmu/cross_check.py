"""The closed-form unit against the simulation of the same scenario: one figure, one table of differences.

Five ways of giving the unit its force are compared with the simulation:

`paper`
    lambda as the paper prints it for fixed and sliding barriers; tau, which the paper does not print, as assumed in
    `analytic.scene`.
`variant calibrated`
    lambda, tau and the vertical load ratio of the scene, from the fit to a sweep of simulations (`analytic.fitted`);
    it knows nothing of the simulation that it is compared with. Left out where the fit has no answer.
`calibrated`
    s1max and tau from the simulated force, by the paper's rule: its peak and the time of its peak.
`with vertical load`
    As calibrated, and the base friction raised by the flow's weight on the barrier: kappa is the ratio of the simulated
    vertical to the horizontal impulse. The paper's model leaves it out.
`simulated force`
    The simulated force and vertical load as inputs of the unit. What is left is the barrier's own motion, so this tells
    a fault in the unit from a limit of the closed form.
"""

from __future__ import annotations

import contextlib
import itertools
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analytic.calibration import bounded_from_below, calibrate, measure, measured_vertical_load_ratio, warnings
from analytic.fitted import CALIBRATED
from analytic.force_record import cumulative_impulse, moving_mean
from analytic.scene import Scene, scene_of
from warp_mpm.quantities import figures

from .instance import instance
from .start_values import PAPER, force_parameters, scene_parameters

if TYPE_CHECKING:
    from warp_mpm import Scenario

Array = NDArray[np.float64]

FIGURES = {
    name: (figure.short or figure.symbol or figure.words, figure.shown_unit, figure.factor)
    for name, figure in figures.FIGURES.items()
    if name in ("peak_force", "peak_force_time", "impulse", "barrier_velocity_max", "barrier_displacement_final")
}
"""Key figures by name: label, unit shown, and its factor from SI."""

CURVES = {"force": "F", "barrier_velocity": "v2", "barrier_displacement": "Δx"}
"""Curves by name, with their symbols."""


@dataclass(frozen=True)
class Trajectory:
    """Force [N/m], barrier velocity [m/s] and displacement [m] over time [s], each an array [samples]."""

    time: Array
    force: Array
    barrier_velocity: Array
    barrier_displacement: Array
    vertical_load: Array | None = None
    """Downward force of the flow on the barrier [N/m], where it is known."""


@dataclass(frozen=True)
class Comparison:
    """One way of running the unit, beside the simulation."""

    name: str
    parameters: dict[str, Any]
    trajectory: Trajectory
    figures: dict[str, float]
    """Key figures of the unit, SI."""
    errors: dict[str, float | None]
    """Their relative differences from the simulation; None where its figure is nil or in `CrossCheck.at_least`."""
    root_mean_squares: dict[str, float | None]
    """Of the differences of the curves, over the largest simulated value; None for a curve that is nil."""


@dataclass(frozen=True)
class CrossCheck:
    """All comparisons of one scenario."""

    title: str
    scene: Scene
    simulated: Trajectory
    figures: dict[str, float]
    filter_rule: str
    comparisons: tuple[Comparison, ...]
    at_least: tuple[str, ...]
    """Names of the simulation's figures that its record only bounds from below, because it ends too early."""
    notes: tuple[str, ...]
    """What the closed form does not see, and what was not over when the simulation ended."""

    def as_dict(self) -> dict[str, Any]:
        """What a program wants to know, without the curves."""
        return {
            "title": self.title,
            "simulation": self.figures,
            "at_least": self.at_least,
            "filter": self.filter_rule,
            "notes": self.notes,
            "units": [
                {key: value for key, value in asdict(comparison).items() if key != "trajectory"}
                for comparison in self.comparisons
            ],
        }


def cross_check(
    scenario: Scenario, unit: Path, *, device: str = "cpu", on_progress: Callable[[float], None] | None = None
) -> CrossCheck:
    """Simulate a scenario, calibrate the closed form on it, and run the unit through fmpy in its five ways.

    Args:
        scenario: with a fixed or a sliding barrier.
        unit: archive of `BarrierSliding`, or of its C twin.
        device: of the simulation.
        on_progress: called with the simulated time [s] now and then.

    Raises:
        SceneError: the closed form has no answer to the scenario.
        CalibrationError: the flow does not hit the barrier within the run.
    """
    scene = scene_of(scenario, scenario.title)
    scene.impact()  # what the closed form has no answer to is refused before it is simulated
    simulated = simulate(scenario, device=device, on_progress=on_progress)
    fit = calibrate(simulated.time, simulated.force, scene)
    common = {"arrival_time": fit.measured.arrival_time, **scene_parameters(scene)}
    calibrated = {"s1max": fit.impact.geometry_change_length, "rise_ratio": fit.impact.rise_ratio}
    ways: dict[str, dict[str, Any]] = {"paper": force_parameters(scene, PAPER)}
    with contextlib.suppress(ValueError):  # of a face whose angle the fit does not know
        ways["variant calibrated"] = force_parameters(scene, CALIBRATED)
    ways["calibrated"] = calibrated
    if not scene.fixed:
        assert simulated.vertical_load is not None
        kappa = measured_vertical_load_ratio(
            simulated.time, simulated.force, simulated.vertical_load, weight=0.0, measured=fit.measured
        )
        ways["with vertical load"] = calibrated | {"vertical_load_ratio": max(kappa, 0.0)}
    ways["simulated force"] = {"impact_force_source": 2}
    figures = key_figures(simulated)
    moved = {"barrier_velocity": simulated.barrier_velocity}
    at_least = tuple(name for name in bounded_from_below(moved, fit.measured) if name in FIGURES)
    comparisons = []
    for name, own in ways.items():
        parameters = common | own
        trajectory = run_unit(unit, parameters, simulated)
        found = key_figures(trajectory, filtered=name == "simulated force")
        comparisons.append(
            Comparison(
                name,
                parameters,
                trajectory,
                found,
                {key: None if key in at_least else _relative(found[key], figures[key]) for key in FIGURES},
                {key: _root_mean_square(getattr(trajectory, key), getattr(simulated, key)) for key in CURVES},
            )
        )
    over = warnings(moved, fit.measured)
    return CrossCheck(
        scenario.title,
        scene,
        simulated,
        figures,
        fit.measured.filter_rule,
        tuple(comparisons),
        at_least,
        (*scene.notes, *(f"≥: {warning}." for warning in over)),
    )


def simulate(
    scenario: Scenario, *, device: str = "cpu", on_progress: Callable[[float], None] | None = None
) -> Trajectory:
    """The simulation's force on the barrier and its motion, at the interval of the scenario's time series."""
    from warp_mpm import Simulation
    from warp_mpm.recording import Schedule, SeriesInMemory, record_until

    recorder, steps = SeriesInMemory(Schedule(scenario.output.time_series_interval_s)), itertools.count(1)

    def told(simulation: Any) -> None:
        if on_progress is not None and next(steps) % 20 == 0:
            on_progress(simulation.time)

    record_until(Simulation(scenario, device=device), [recorder], scenario.output.end_time_s, on_step=told)
    series = recorder.series()
    return Trajectory(
        series["time"],
        series["impact_force_x"] + series["top_force"] + series["back_force_x"],
        series["barrier_velocity"],
        series["barrier_displacement"],
        -(series["impact_force_y"] + series["top_force_y"] + series["back_force_y"]),
    )


def run_unit(unit: Path, parameters: dict[str, Any], simulated: Trajectory) -> Trajectory:
    """The unit's trajectory at the simulation's times, through fmpy, with the simulated loads as inputs if asked."""
    outputs = ("impact_force", "barrier_velocity", "barrier_displacement")
    with (
        tempfile.TemporaryDirectory(prefix="fmu_check_", ignore_cleanup_errors=True) as folder,
        instance(unit, Path(folder)) as fmu,
    ):
        fmu.initialize(float(simulated.time[0]), **parameters)
        rows = [fmu.reals(outputs)]
        for index in range(1, len(simulated.time)):
            if parameters.get("impact_force_source") == 2:
                assert simulated.vertical_load is not None
                # The simulation's forces are means over the interval that ends at their time.
                fmu["impact_force_input"] = float(simulated.force[index])
                fmu["vertical_load"] = float(simulated.vertical_load[index])
            fmu.step(float(simulated.time[index]) - fmu.time)
            rows.append(fmu.reals(outputs))
        fmu.fmu.terminate()
    return Trajectory(simulated.time, *np.array(rows).T)


def key_figures(trajectory: Trajectory, *, filtered: bool = True) -> dict[str, float]:
    """Key figures of a trajectory, SI.

    `filtered` is for forces of the simulation: their peak is that of the moving mean over 50 ms. The impulse is that
    from arrival to the end of the impact, as `analytic.calibration.measure` tells them.
    """
    measured = measure(trajectory.time, trajectory.force)
    force = moving_mean(trajectory.time, trajectory.force, measured.filter_window) if filtered else trajectory.force
    peak = int(np.argmax(force))
    impulse = cumulative_impulse(trajectory.time, trajectory.force)
    return {
        "peak_force": float(force[peak]),
        "peak_force_time": float(trajectory.time[peak]),
        "impulse": measured.impulse if filtered else float(impulse[-1]),
        "barrier_velocity_max": float(trajectory.barrier_velocity.max()),
        "barrier_displacement_final": float(trajectory.barrier_displacement[-1]),
    }


def _relative(value: float, reference: float) -> float | None:
    return value / reference - 1 if reference else None


def _root_mean_square(values: Array, reference: Array) -> float | None:
    scale = float(np.abs(reference).max())
    return float(np.sqrt(np.mean((values - reference) ** 2))) / scale if scale > 0 else None
