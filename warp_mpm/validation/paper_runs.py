"""The paper's cases as runs, and what is read from each of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from analytic.force_record import cumulative_impulse, moving_mean
from warp_mpm.effect_rules import with_law
from warp_mpm.recording import Schedule, SeriesInMemory, record_until
from warp_mpm.results import Results
from warp_mpm.run import run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.shipped import SCENARIOS
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array

TITLES = {
    "case_1": "case 1",
    "case_1_fixed": "case 1, fixed",
    "case_2": "case 2, 20 m/s",
    "case_3": "case 3, 80°",
    "case_4": "case 4, H/h = 2.5",
    "case_5": "case 5, wall",
    "case_6": "case 6, h = 1 m",
    "case_1_dry": "case 1, dry",
    "case_1_undrained": "case 1, undrained",
}
"""The paper's scenes, by the name of their file."""


@dataclass(frozen=True)
class PaperRun:
    """One of the paper's scenes, simulated. Forces in N/m, pressures in Pa."""

    name: str
    results: Results

    @property
    def title(self) -> str:
        return TITLES[self.name]

    @property
    def scenario(self) -> Scenario:
        return self.results.scenario

    @property
    def series(self) -> Mapping[str, Array]:
        return self.results.time_series

    @property
    def summary(self) -> Mapping[str, Any]:
        return self.results.summary

    def smooth(self, quantity: str, window: float = 0.05) -> Array:
        """A force of the series, as its moving mean over `window` [s]."""
        return moving_mean(self.series["time"], self.series[quantity], window)

    def mean(self, quantity: str, begin: float, end: float) -> float:
        """Mean of a force over a stretch of time [s]."""
        time = self.series["time"]
        impulse = cumulative_impulse(time, self.series[quantity])
        return float((np.interp(end, time, impulse) - np.interp(begin, time, impulse)) / (end - begin))

    def at(self, quantity: str, time: float) -> float:
        """Value of a quantity of the series at a time [s]."""
        return float(np.interp(time, self.series["time"], self.series[quantity]))

    def energy_share(self, time: float) -> float:
        """Kinetic energy of the flow at a time [s] over that at the start."""
        return self.at("flow_kinetic_energy", time) / float(self.series["flow_kinetic_energy"][0])

    @property
    def overtopped(self) -> float:
        """Greatest share of the flow that was beyond the crest at one time."""
        return float(self.summary["mechanism_measures"]["overtopped_share"])

    @property
    def retained(self) -> float:
        """Volume upstream of the crest at the end [m³/m]."""
        return float(self.summary["retained_volume"])

    @property
    def displacement(self) -> float:
        """Final displacement of the barrier [m]."""
        return float(self.summary["barrier_displacement_final"] or 0.0)

    @property
    def pressure(self) -> float:
        """Greatest pore pressure at t = 1 s [Pa], upstream of the crest, less the points' noise."""
        return self.at("pore_pressure_max", 1.0)


def paper_scene(name: str, spacing: float, law: str | None = None, **changes: Any) -> Scenario:
    """One of the paper's scenes at a spacing [m], with another law or fields changed: `barrier__friction=0`."""
    fields = {path.replace("__", "."): value for path, value in changes.items()}
    scenario = Scenario.load(SCENARIOS / f"{name}.json").replaced({"numerics.spacing_m": spacing, **fields})
    return scenario if law is None else scenario.replaced(with_law(scenario, law))


@contextmanager
def paper_runs(names: Mapping[str, float]) -> Iterator[dict[str, PaperRun]]:
    """Run scenes, each at its spacing [m]; what they write is gone at the end."""
    with TemporaryDirectory(prefix="warp-mpm-paper-") as folder:
        runs: dict[str, PaperRun] = {}
        try:
            for name, spacing in names.items():
                out = Path(folder) / name
                run_scenario(paper_scene(name, spacing), out, make_simulation=Simulation, pictures=False)
                runs[name] = PaperRun(name, Results.open(out))
            yield runs
        finally:
            for run in runs.values():
                run.results.snapshots.close()


def force_history(scenario: Scenario, interval: float) -> tuple[dict[str, Array], Simulation]:
    """Samples of a scene every `interval` [s] until its end, and the simulation at the end."""
    simulation, recorder = Simulation(scenario), SeriesInMemory(Schedule(interval))
    record_until(simulation, [recorder], scenario.output.end_time_s)
    return recorder.series(), simulation
