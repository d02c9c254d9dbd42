"""Runs a scene and measures what the criteria ask for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.hard_cases.bounds import impact_speed, pressure_bound, speed_bound
from warp_mpm.hard_cases.criteria import CRITERIA, Criterion
from warp_mpm.recording import Recorder, Schedule, SeriesInMemory, Watcher, record_until
from warp_mpm.scenario import STANDARD_GRAVITY, Scenario, Skeleton, UndrainedMaterial
from warp_mpm.simulation import Simulation, SimulationDiverged
from warp_mpm.simulator.bodies.of_scene import BARRIER, barrier_bodies, ground_body
from warp_mpm.simulator.laws import LAWS
from warp_mpm.snapshot import Snapshot, snapshot_of
from warp_mpm.summary import impact_figures, momentum_error
from warp_mpm.time_step import step_limits

Array = NDArray[np.float64]


@dataclass
class Measured:
    """A hard case after its run."""

    figures: dict[str, float]
    """By the names in `CRITERIA`, and some more that say how the run went."""
    problem: str | None = None
    """What `SimulationDiverged` said."""
    last: Snapshot | None = field(default=None, repr=False)
    peak: Snapshot | None = field(default=None, repr=False)
    """At the greatest pore pressure (speed, if dry)."""

    def failures(self, scenario: Scenario) -> list[tuple[Criterion, float]]:
        """Criteria that were not met, with their figures."""
        return [
            (criterion, self.figures[criterion.figure])
            for criterion in CRITERIA
            # Not "greater": a figure that is no number has failed.
            if criterion.figure in self.figures and not self.figures[criterion.figure] <= criterion.limit_for(scenario)
        ]


def measure(
    scenario: Scenario, *, halve: bool = False, make_simulation: Callable[[Scenario], Any] = Simulation
) -> Measured:
    """Run `scenario` and take its figures; with `halve` once more at half the time step."""
    measured = _run(scenario, make_simulation)
    if halve and measured.problem is None and scenario.barrier is not None:
        halved = scenario.replaced({"numerics.courant_number": 0.5 * scenario.numerics.courant_number})
        other = _run(halved, make_simulation)
        scale = 0.1 * scenario.flow.material.density * scenario.flow.speed**2 * scenario.flow.depth
        for figure, name, least in (
            ("halving_peak_force", "peak_force_filtered", scale),
            ("halving_displacement", "barrier_displacement_final", scenario.numerics.spacing_m),
        ):
            ours, theirs = measured.figures.get(name), other.figures.get(name)
            if other.problem is not None:
                theirs = math.nan  # what does not bear half the time step fails
            if ours is not None and theirs is not None:
                measured.figures[figure] = abs(ours - theirs) / np.max([abs(ours), abs(theirs), least])
    return measured


def _run(scenario: Scenario, make_simulation: Callable[[Scenario], Any]) -> Measured:
    started = time.perf_counter()
    simulation = make_simulation(scenario)
    output = scenario.output
    noise: list[float] = []
    extremes = dict.fromkeys(("penetration", "porosity_high", "yield_excess", "stress_max"), 0.0) | {
        "porosity_low": -1.0
    }
    measured = Measured({"diverged": 0.0})
    begin = snapshot_of(simulation)
    undecided_energy = sum(
        LAWS.named(material.law).undecided_energy(material, begin["volume"][own], begin["effective_stress"][own])
        for material, own in _by_material(scenario, begin)
    )
    undecided_energy += energy_within_cells(simulation, begin)

    def look(simulation: Any) -> None:
        snapshot = snapshot_of(simulation)
        if len(snapshot.position) > 0:
            _widen(extremes, scenario, snapshot)
            noise.extend(_pressure_noise(scenario, snapshot))
            if measured.peak is None or _violence(snapshot) > _violence(measured.peak):
                measured.peak = snapshot
        measured.last = snapshot

    series = SeriesInMemory(Schedule(output.time_series_interval_s))
    recorders: list[Recorder] = [series, Watcher(Schedule(output.snapshot_interval_s), look)]
    try:
        record_until(simulation, recorders, output.end_time_s)
    except SimulationDiverged as error:
        measured.figures["diverged"], measured.problem = 1.0, str(error)
    if not series.samples:
        return measured
    record, points, steps = simulation.record, simulation.material_points, max(simulation.steps, 1)
    columns = series.series()
    measured.figures |= (
        extremes
        | _of_the_series(scenario, columns, undecided_energy)
        | {
            "points": float(points),
            "steps": float(steps),
            "left_share": record["points_left"] / points,
            "pushed_share": record["points_pushed_out"] / (points * steps),
            "gaps_bounded_share": record["gaps_bounded"] / (points * steps),
            "voids_closed_share": record["voids_closed"] / (points * steps),
            "unconverged_share": record["barrier_unconverged"] / steps,
            "wall_time": time.perf_counter() - started,
        }
    )
    strength = max(LAWS.named(material.law).strength(material) for material in scenario.flow.materials)
    if math.isfinite(strength):
        # A skeleton is stopped in free fall, between two samples of the speed.
        fastest = max(measured.figures["speed_max"], impact_speed(scenario))
        bound = pressure_bound(scenario, fastest) + 2.0 * strength
        measured.figures["stress_ratio"] = measured.figures["stress_max"] / max(bound, 1.0)
    measured.figures["yield_excess"] /= max(measured.figures["stress_max"], _trial_stress(scenario), 1.0)
    if noise:
        measured.figures["pressure_noise"] = float(np.median(noise))
    return measured


def _violence(snapshot: Snapshot) -> float:
    if "pore_pressure" in snapshot:
        return float(snapshot["pore_pressure"].max())
    return float(np.abs(snapshot["solid_velocity"]).max())


def energy_within_cells(simulation: Any, begin: Snapshot) -> float:
    """Kinetic energy [J/m] of what an affine scheme's points know of velocities about them, at the start: m |C|² d² / 8
    with C the gradient, d² / 4 the second moment of the splines. The record holds that of the points' own velocities
    alone, and takes the rest up as they part."""
    if len(begin.position) == 0:
        return 0.0
    grid, solid, liquid = simulation.grid, begin["solid_mass"], begin["liquid_mass"]
    phases = {"solid_velocity": solid + liquid}
    if "liquid_velocity" in begin:
        phases = {"solid_velocity": solid, "liquid_velocity": liquid}
    places = (begin.position - [grid.left, grid.bottom]) / grid.spacing
    total = 0.0
    for velocity, mass in phases.items():
        for gradient in simulation.effects.scheme.fitted(places, grid.spacing, solid, begin[velocity]).values():
            total += float(mass @ (gradient**2).sum(axis=1)) * grid.spacing**2 / 8.0
    return total


def _energy_error(columns: dict[str, Array], undecided: float) -> float:
    """Greatest energy beyond what was there or put in, over that."""
    parts = [columns[f"flow_{kind}_energy"] for kind in ("kinetic", "gravitational", "elastic")]
    work = columns.get("barrier_work", np.zeros(1))
    arrived = columns.get("inflow_energy", np.zeros(1))
    total = sum(parts) + columns["left_energy"] + work - columns.get("seepage_work", 0.0) - arrived
    # A driven barrier puts energy in by its work, and gravity on a slope by the fall.
    # Of numpy's, since max takes the other where it is offered no number.
    gained = sum(np.maximum(np.max(part), 0.0) for part in (-work, parts[1][0] - parts[1], arrived))
    put_in = sum(abs(float(part[0])) for part in parts) + undecided + gained
    return float(np.maximum(np.max(total - total[0]) - undecided, 0.0) / np.maximum(put_in, 1e-9))


def _of_the_series(scenario: Scenario, columns: dict[str, Array], undecided_energy: float) -> dict[str, float]:
    figures: dict[str, float] = {}
    inside = columns["solid_mass"] + columns.get("liquid_mass", 0.0)
    known = inside[0] + columns.get("inflow_mass", 0.0)
    figures["mass_error"] = float(np.abs(inside + columns["left_mass"] - known).max() / np.max(known))
    closed = momentum_error(columns, scenario.gravity.acceleration_m_per_s2)
    if closed is not None:
        figures["momentum_error"] = closed
    figures["energy_error"] = _energy_error(columns, undecided_energy)
    fastest, bound = float(columns["speed_max"].max()), speed_bound(scenario)
    figures |= {"speed_max": fastest, "speed_ratio": fastest if bound == 0.0 else fastest / bound}
    if "pore_pressure_max_anywhere" in columns:
        greatest = float(columns["pore_pressure_max_anywhere"].max())
        figures |= {
            "pore_pressure_max": greatest,
            "pressure_ratio": greatest / max(pressure_bound(scenario, fastest), 1.0),
        }
    impact = impact_figures(columns["time"], columns.get("impact_force_x"))
    if impact["peak_force_filtered"] is not None:
        figures["peak_force_filtered"] = impact["peak_force_filtered"]
    if "barrier_displacement" in columns:
        figures["barrier_displacement_final"] = float(columns["barrier_displacement"][-1])
    return figures


def _widen(extremes: dict[str, float], scenario: Scenario, snapshot: Snapshot) -> None:
    # Of the volumes: the porosity that a scene holds constant would tell nothing.
    grains = np.zeros(len(snapshot.position))
    for material, own in _by_material(scenario, snapshot):
        grains[own] = snapshot["solid_mass"][own] / material.grain_density_kg_per_m3
    porosity = 1.0 - grains / snapshot["volume"]
    found = {
        "penetration": _penetration(scenario, snapshot),
        "porosity_low": -float(porosity.min()),
        "porosity_high": float(porosity.max()),
    }
    for material, own in _by_material(scenario, snapshot):
        excess, greatest = _yield_excess(material, snapshot["effective_stress"][own])
        found["stress_max"] = np.maximum(found.get("stress_max", 0.0), greatest)
        if excess is not None:
            found["yield_excess"] = np.maximum(found.get("yield_excess", 0.0), excess)
    for name, value in found.items():
        extremes[name] = float(np.maximum(extremes[name], value))  # which keeps NaN


def _penetration(scenario: Scenario, snapshot: Snapshot) -> float:
    """Depth [cells] of the deepest point inside a solid."""
    x, y = snapshot.position.T
    depth = np.zeros(len(x))
    if scenario.ground is not None:
        depth = np.maximum(depth, -ground_body(scenario.ground).outline.distance(snapshot.position))
    domain = scenario.domain
    if domain.left_edge == "wall" and domain.left_m is not None:
        depth = np.maximum(depth, domain.left_m - x)
    if domain.right_edge == "wall" and domain.right_m is not None:
        depth = np.maximum(depth, x - domain.right_m)
    if domain.top_edge == "wall" and domain.top_m is not None:
        depth = np.maximum(depth, y - domain.top_m)
    for body in barrier_bodies(scenario):
        if body.name == BARRIER or not body.moves:  # how far others have moved is not in a snapshot
            moved = snapshot.barrier_displacement or 0.0 if body.name == BARRIER else 0.0
            depth = np.maximum(depth, -body.outline.distance(snapshot.position - [moved, 0.0]))
    return float(depth.max() / scenario.numerics.spacing_m)


def _by_material(scenario: Scenario, snapshot: Snapshot) -> Iterator[tuple[Skeleton, NDArray[np.bool_]]]:
    """Each material of the scene of which there are points, and which these are [N]."""
    materials = scenario.flow.materials
    place = snapshot["material"] if len(materials) > 1 else np.zeros(len(snapshot.position))
    for number, material in enumerate(materials):
        own = place == number
        if own.any():
            yield material, own


def _yield_excess(material: Skeleton, stress: Array) -> tuple[float | None, float]:
    """Greatest distance outside of what the law allows, None where it allows all, and greatest stress [Pa]."""
    law = LAWS.named(material.law)
    xx, yy, zz, xy = stress.T
    mean, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    principal = np.abs([mean + radius, mean - radius, zz])
    excess, strength = law.yield_excess(material, stress), law.strength(material)
    greatest = float(np.maximum(principal.max(), strength if math.isfinite(strength) else 0.0))
    return None if excess is None else float(np.maximum(excess.max(), 0.0)), greatest


def _trial_stress(scenario: Scenario) -> float:
    """Stress [Pa] before it is brought back to the yield surface, at the strain u / c of an impact; its rounding in
    single precision is what is left of a far smaller stress. Double precision is held to the stress itself."""
    if scenario.numerics.precision == "float64":
        return 0.0
    sound = step_limits(scenario).sound_speed
    return scenario.flow.material.oedometric_modulus * impact_speed(scenario) / sound


def _pressure_noise(scenario: Scenario, snapshot: Snapshot) -> list[float]:
    """One figure, or none where no cell holds three points."""
    if "pore_pressure" not in snapshot or len(snapshot.position) < 3:
        return []
    pressure = snapshot["pore_pressure"]
    cells = np.floor(snapshot.position / scenario.numerics.spacing_m).astype(np.int64)
    _, cell, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.ravel()
    full = count[cell] >= 3
    if not full.any():
        return []
    material = scenario.flow.wettest
    assert isinstance(material, UndrainedMaterial)
    # Over the pressure of the liquid at rest, whose gradient is no noise.
    excess = pressure - material.liquid_density_kg_per_m3 * (snapshot.position @ scenario.gravity.vector)
    mean = np.bincount(cell, excess) / count
    still = material.density * STANDARD_GRAVITY * scenario.flow.depth
    scale = max(float(np.sqrt(np.mean(pressure[full] ** 2))), still)
    return [float(np.sqrt(np.mean((excess - mean[cell])[full] ** 2)) / scale)]
