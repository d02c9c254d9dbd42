"""One run of a study: its key figures, its curves, and where its time went."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from analytic.force_record import cumulative_impulse, moving_mean
from warp_mpm import mechanism
from warp_mpm.recording import Schedule, SeriesInMemory, record_until
from warp_mpm.scenario import Scenario
from warp_mpm.snapshot import snapshot_of
from warp_mpm.summary import impact_figures

SERIES_INTERVAL = 0.01
"""Interval of the forces [s]: a peak force is the greatest mean over it, however densely a run is recorded."""

CURVES = ("impact_force_x", "flow_kinetic_energy", "barrier_displacement")
"""Columns of the time series that are kept."""

GREATEST = {
    "pressure_patch_max": "pressure_patch",
    "pore_pressure_patch_max": "pore_pressure_patch",
    "pore_pressure_max": "pore_pressure_max",
}
"""Figures that are the greatest value of a column, where the scene has it."""

PROFILED_TIME, STRETCHES = 0.02, 5
"""Simulated time [s] over which the kernels are timed one by one, after the run, and its parts."""

PACES = 100
"""Stretches of a run, at most, of which speed and cost of a step are kept."""


def measure(
    scenario: Scenario, *, profile: bool = False, device: str = "cpu", limit: float = math.inf
) -> dict[str, Any]:
    """Run a scenario without writing anything.

    Times are CPU times of this process, which a machine that is busy with other things does not stretch. Figures and
    curves are those of records every `SERIES_INTERVAL` where the scenario's are denser.

    Args:
        scenario: what to run.
        device: on which; the times are told by the CPU's clock only where it is the CPU.
        profile: time the kernels too, over a short stretch after the end.
        limit: time [s] of stepping and recording after which the run is given up.

    Returns:
        Plain JSON values: `status` (finished, diverged or given up), `problem`, `figures`, `curves`, `cpu_time` (of
        stepping) and its companions [s], `end_time` that was reached [s], `steps`, `material_points`, `paces` (of each
        stretch its begin [s], greatest speed of the flow [m/s], time of a step [s]), `kernel_times` (shares of a step).
    """
    from warp_mpm.simulation import Simulation, SimulationDiverged

    preparing = time.process_time()
    simulation = Simulation(scenario, device=device)
    _ = simulation.launched_kernels  # compiles them
    found: dict[str, Any] = {
        "status": "finished",
        "problem": None,
        "preparation_time": time.process_time() - preparing,
        "material_points": simulation.material_points,
    }
    recorder = _Timed(Schedule(scenario.output.time_series_interval_s))
    wall = time.perf_counter()
    try:
        if not record_until(
            simulation,
            [recorder],
            scenario.output.end_time_s,
            stop=lambda: recorder.stepping + recorder.recording > limit,
        ):
            found |= {"status": "given up", "problem": f"given up at t = {simulation.time:.3g} s"}
    except SimulationDiverged as error:
        found |= {"status": "diverged", "problem": str(error)}
    found |= {
        "cpu_time": recorder.stepping,
        "recording_time": recorder.recording,
        "wall_time": time.perf_counter() - wall,
        "end_time": simulation.time,
        "steps": simulation.steps,
        "samples": len(recorder.samples),
        "paces": _thinned(recorder.paces),
        "figures": {},
        "curves": {},
        "kernel_times": {},
    }
    if found["status"] == "finished":
        series = recorder.series()
        judged = judged_series(series)
        found["figures"] = _figures(scenario, simulation, series, judged)
        found["curves"] = {
            name: [float(f"{value:.7g}") for value in judged[name]] for name in ("time", *CURVES) if name in judged
        }
        if profile:
            found["kernel_times"] = _kernel_times(simulation)
    return found


class _Timed(SeriesInMemory):
    """Keeps the samples and what they cost: CPU times of stepping and of recording [s]."""

    def __init__(self, schedule: Schedule):
        super().__init__(schedule)
        self.stepping = self.recording = 0.0
        self.paces: list[tuple[float, float, float, int]] = []
        """Of each stretch its begin [s], greatest speed [m/s], CPU time [s] and steps."""
        self._before: tuple[float, int, float] | None = None

    def record(self, simulation: Any) -> None:
        half = time.process_time()
        super().record(simulation)
        now = time.process_time()
        if self._before is not None:
            begin, steps, start = self._before
            self.stepping, self.recording = self.stepping + half - start, self.recording + now - half
            self.paces.append((begin, self.latest["speed_max"], half - start, simulation.steps - steps))
        self._before = simulation.time, simulation.steps, time.process_time()


def judged_series(series: dict[str, Any]) -> dict[str, Any]:
    """A time series at the end of each `SERIES_INTERVAL`, forces as means over it; the series itself where it is no
    denser. So runs that are recorded more densely have the same figures and curves, but for what recording changes."""
    time = series["time"]
    together = round(SERIES_INTERVAL / float(time[1] - time[0])) if len(time) > 1 else 1
    if together <= 1:
        return series
    ends = np.unique([*range(0, len(time), together), len(time) - 1])
    judged = {name: values[ends] for name, values in series.items()}
    if "impact_force_x" in series:
        impulse = cumulative_impulse(time, series["impact_force_x"])[ends]
        judged["impact_force_x"] = np.append(series["impact_force_x"][0], np.diff(impulse) / np.diff(time[ends]))
    return judged


def _figures(
    scenario: Scenario, simulation: Any, series: dict[str, Any], judged: dict[str, Any]
) -> dict[str, float | None]:
    figures = dict(impact_figures(judged["time"], judged.get("impact_force_x")))
    figures["kinetic_energy_lost"] = float(series["flow_kinetic_energy"][0] - series["flow_kinetic_energy"][-1])
    figures |= {name: float(series[column].max()) for name, column in GREATEST.items() if column in series}
    moves = scenario.barrier is not None and scenario.barrier.motion.kind == "sliding"
    figures["barrier_velocity_max"] = float(series["barrier_velocity"].max()) if moves else None
    figures["barrier_displacement_final"] = float(series["barrier_displacement"][-1]) if moves else None
    return figures | mechanism.deposit(scenario, snapshot_of(simulation))


def _thinned(paces: list[tuple[float, float, float, int]]) -> list[list[float]]:
    """Begin [s], greatest speed [m/s] and mean time of a step [s] of at most `PACES` stretches."""
    together, found = max(1, math.ceil(len(paces) / PACES)), []
    for first in range(0, len(paces), together):
        begins, speeds, times, steps = zip(*paces[first : first + together], strict=True)
        found.append([begins[0], max(speeds), sum(times) / max(sum(steps), 1)])
    return found


def _kernel_times(simulation: Any) -> dict[str, float]:
    """Share of each kernel in the time of a step: the median over stretches, since some share the core with others."""
    simulation.kernel_times(simulation.time + 0.05 * PROFILED_TIME)  # what a first launch sets up is no part of a step
    stretches = [simulation.kernel_times(simulation.time + PROFILED_TIME / STRETCHES) for _ in range(STRETCHES)]
    spent = {name: float(np.median([one[name] for one in stretches])) for name in stretches[0]}
    whole = sum(spent.values())
    return {name: value / whole for name, value in sorted(spent.items(), key=lambda item: -item[1])}


def smoothed_force(curves: dict[str, Any]) -> Any:
    """Moving mean of the impact force [N/m] of a run's curves."""
    return moving_mean(np.array(curves["time"]), np.array(curves["impact_force_x"]))
