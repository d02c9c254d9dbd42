"""How the communication step rules a co-simulation: its error, its stability and its cost.

    python -m fmu build
    python docs/cosimulation/step_study.py

Runs flow and barrier as two units, with communication steps from 0.2 s to 2 ms and both coupling schemes of coupled.py,
for the barrier of Set IIb and for one of a ninth of its mass, and compares them with the monolithic simulation.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from coupled import run_coupled
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from warp_mpm import Scenario, Simulation
from warp_mpm_fmu.system import scenario_in

SCENARIO = Path(__file__).parents[2] / "scenarios" / "set_iib.json"
STEPS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
SCHEMES = ("gauss-seidel", "jacobi")
BARRIERS = {90000.0: ("90 t/m, Set IIb", 6.0), 10000.0: ("10 t/m", 2.0)}
"""By mass [kg/m]: label, and end of the run [s]; the light one is swept away soon."""

BASE_FRICTION = 0.29
REPEATS = 3
"""Runs whose wall time is taken; of each step the shortest counts, so that other work on the machine drops out."""


@dataclass
class Outcome:
    """One co-simulation beside the monolithic run."""

    barrier_mass: float
    scheme: str
    step: float
    displacement: float
    error: float
    """Of the final displacement, relative."""
    sawtooth: float
    """Largest second difference of the barrier's velocity from step to step [m/s]: how far it swings."""
    wall_time: float | None
    """Of all steps [s], without the start of the units; not taken for Jacobi, which costs the same."""


def monolithic(barrier_mass: float, spacing: float, end: float) -> tuple[float, float]:
    """Final displacement [m] of the simulation that moves its barrier itself, and its wall time [s]."""
    motion = {"kind": "sliding", "mass_kg_per_m": barrier_mass, "base_friction": BASE_FRICTION}
    scenario = Scenario.load(SCENARIO).replaced({"numerics.spacing_m": spacing, "barrier.motion": motion})
    simulation = Simulation(scenario)
    simulation.advance(until=1e-9)  # compiles
    beginning, walls = simulation.save_state(), []
    for _ in range(REPEATS):
        simulation.restore_state(beginning)
        clock = [time.perf_counter()]
        for step in range(1, round(end / 0.01) + 1):
            simulation.advance(until=step * 0.01)
            simulation.sample()
            clock.append(time.perf_counter())
        walls.append(np.diff(clock))
    return simulation.barrier_displacement, float(np.min(walls, axis=0).sum())


def study(archives: Path, spacing: float) -> tuple[list[Outcome], dict[float, tuple[float, float]]]:
    """All co-simulations, and by barrier mass the monolithic displacement [m] and wall time [s]."""
    references = {mass: monolithic(mass, spacing, end) for mass, (_, end) in BARRIERS.items()}
    outcomes = []
    for mass, (_, end) in BARRIERS.items():
        reference = references[mass][0]
        for scheme in SCHEMES:
            for step in STEPS:
                walls = []
                for _ in range(REPEATS if scheme == "gauss-seidel" else 1):
                    rows = run_coupled(archives, step=step, end=end, spacing=spacing, scheme=scheme, barrier_mass=mass)
                    walls.append(np.diff([row.wall_time for row in rows]))
                wall = float(np.min(walls, axis=0).sum()) if len(walls) > 1 else None
                velocity = [row.barrier_velocity for row in rows]
                swings = [abs(c - 2 * b + a) for a, b, c in zip(velocity, velocity[1:], velocity[2:], strict=False)]
                displacement = rows[-1].barrier_displacement
                outcomes.append(
                    Outcome(mass, scheme, step, displacement, displacement / reference - 1, max(swings), wall)
                )
    return outcomes, references


def draw(outcomes: list[Outcome], references: dict[float, tuple[float, float]]) -> Figure:
    """Error over step for both barriers and schemes, and what a smaller step costs."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    colors = dict(zip(BARRIERS, ("#0072B2", "#D55E00"), strict=True))
    for mass, (label, _) in BARRIERS.items():
        for scheme in SCHEMES:
            chosen = [o for o in outcomes if o.barrier_mass == mass and o.scheme == scheme]
            line, marker = ("-", "o") if scheme == "gauss-seidel" else ("--", "s")
            left.loglog(
                [1e3 * o.step for o in chosen],
                [100 * max(abs(o.error), 1e-5) for o in chosen],
                color=colors[mass],
                linestyle=line,
                marker=marker,
                label=f"{label}, {scheme}",
            )
    heavy = next(iter(BARRIERS))  # the run with the light barrier is too short to be timed well
    chosen = [o for o in outcomes if o.barrier_mass == heavy and o.wall_time is not None]
    costs = [(o.wall_time or 0.0) / references[heavy][1] for o in chosen]
    right.semilogx([1e3 * o.step for o in chosen], costs, color=colors[heavy], marker="o", label=BARRIERS[heavy][0])
    left.axhline(2.0, color="#6E6E6E", linewidth=1)
    left.text(2.0, 2.2, "2 %", color="#6E6E6E")
    left.set_xlabel("communication step [ms]")
    left.set_ylabel("error of the final displacement [%]")
    left.legend(frameon=False, fontsize=8)
    right.axhline(1.0, color="#6E6E6E", linewidth=1)
    right.set_xlabel("communication step [ms]")
    right.set_ylabel("wall time over the monolithic run's")
    right.set_ylim(bottom=0)
    right.legend(frameon=False)
    for axis in (left, right):
        axis.grid(alpha=0.3, which="both")
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--spacing", type=float, default=0.4, help="grid spacing [m]")
    parser.add_argument("--figure", type=Path, default=Path("build/step_study.png"), help="picture to write")
    given = parser.parse_args()
    if scenario_in(given.archives / "DebrisFlowC.fmu") != Scenario.load(SCENARIO):
        parser.error(f"--archives: DebrisFlow.fmu in {given.archives} must hold Set IIb")
    outcomes, references = study(given.archives, given.spacing)
    for mass, (displacement, wall) in references.items():
        print(f"\n{BARRIERS[mass][0]}, {BARRIERS[mass][1]:g} s: monolithic {displacement:.3f} m in {wall:.2f} s")
        print(f"{'scheme':>13} {'step [ms]':>10} {'dx_f [m]':>9} {'error':>8} {'swing [m/s]':>12} {'wall':>6}")
        for o in outcomes:
            if o.barrier_mass == mass:
                cost = "" if o.wall_time is None else f"{o.wall_time / wall:5.2f}x"
                print(
                    f"{o.scheme:>13} {1e3 * o.step:10.0f} {o.displacement:9.3f} {o.error:+8.2%} {o.sawtooth:12.2f} "
                    f"{cost}"
                )
    given.figure.parent.mkdir(parents=True, exist_ok=True)
    draw(outcomes, references).savefig(given.figure, dpi=130)
    print(f"\nFigure: {given.figure}")


if __name__ == "__main__":
    main()
