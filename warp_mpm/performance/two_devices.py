"""A GPU against the CPU: the same answers, and how much faster, in one go of some minutes.

Two runs on a GPU differ in the order of their sums, and an impact makes rounding grow. How far two right answers may
lie apart is therefore measured: a twin on the CPU whose velocities differ in the last digit. The device must stay
within `ROOM` times what the twin shows, or within `LEAST` where the twin shows next to nothing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from analytic.force_record import moving_mean
from warp_mpm.effect_rules import without_liquid
from warp_mpm.performance.probe import Stepper, in_turns
from warp_mpm.performance.table import Progress, Table
from warp_mpm.recording import Schedule, SeriesInMemory, record_until
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.summary import energy_error, mass_error, momentum_error

ROOM = 20.0
"""Times by which a device may differ from the CPU more than the CPU from its twin: theirs is one rounding, its many."""

LEAST = {"float64": 1e-9, "float32": 1e-4}
"""Relative difference that needs no reason, by precision: some hundred roundings of a record's sums."""

LAST_DIGIT = {"float64": 2.0**-50, "float32": 2.0**-21}
"""Relative change of the twin's velocities: a few of the last digit's units."""

LEDGER = {"float64": 1e-9, "float32": 1e-3}
"""Error of the ledger [-] that the roundings of a thousand steps may leave: the CPU's are a thousand times less."""

COMPARED: dict[str, Any] = {"numerics.spacing_m": 0.4, "output.end_time_s": 1.0, "output.time_series_interval_s": 0.005}
"""Settings of the scenes that are compared."""

SIZES = (100_000, 1_000_000, 10_000_000)
"""Numbers of material points that are timed on a GPU."""

DRY_RUN_SIZES = (1_000, 3_000)
"""The same on the CPU, where this is rehearsed."""

FIGURES = ("force", "impulse", "displacement", "kinetic energy")


def scenes(base: Scenario) -> dict[str, Scenario]:
    """Seven scenes that between them launch every kernel: formulations, motions, friction, transfers, precisions.

    Args:
        base: a two-phase scene with a barrier that slides.
    """
    assert base.barrier is not None
    coarse = base.replaced(COMPARED)
    undrained = coarse.replaced(without_liquid(coarse))
    driven = {"kind": "prescribed", "times_s": [0.0, 1.0], "velocities_m_per_s": [-1.0, 1.0]}
    return {
        "two-phase, sliding": coarse,
        "two-phase, single precision": coarse.replaced({"numerics.precision": "float32"}),
        "undrained, fixed": undrained.replaced({"barrier.motion": {"kind": "fixed"}}),
        "dry, rough ground": undrained.replaced(without_liquid(undrained)).replaced({"ground.friction": 0.3}),
        "two-phase, APIC": coarse.replaced({"numerics.transfer": "apic"}),
        "two-phase, driven, FLIP": coarse.replaced({"barrier.motion": driven, "numerics.transfer": "flip"}),
        "porosity, walls, ceiling": coarse.replaced(
            {
                "flow.material.porosity_update": True,
                "domain.left_edge": "wall",
                "domain.right_edge": "wall",
                "domain.top_edge": "wall",
            }
        ),
    }


def agreement(base: Scenario, *, device: str, progress: Progress) -> tuple[Table, bool]:
    """What a device answers against the CPU, scene by scene, and whether all of it is as it must be.

    Args:
        base: see `scenes`.
        device: a Warp device; "cpu" rehearses.
        progress: called with what is being run.
    """
    rows, agree = [], True
    for name, scene in scenes(base).items():
        progress(f"{name}, on the CPU and on {device}")
        precision = scene.numerics.precision
        reference = _run(scene, "cpu")
        twin = _run(scene, "cpu", nudge=LAST_DIGIT[precision])
        there = _run(scene, device)
        own, doubt = differences(there, reference), differences(twin, reference)
        allowed = {figure: max(ROOM * doubt[figure], LEAST[precision]) for figure in FIGURES}
        ledger = max(_ledger(scene, there))
        kept = all(own[figure] <= allowed[figure] for figure in FIGURES) and ledger <= LEDGER[precision]
        agree &= kept
        rows.append(
            (
                name,
                *(f"{own[figure]:.1e} ({allowed[figure]:.1e})" for figure in FIGURES),
                f"{ledger:.1e}",
                "agrees" if kept else "DIFFERS",
            )
        )
    title = f"{device} against the CPU: relative difference, and in brackets what rounding allows"
    return Table("agreement", title, ("scene", *FIGURES, "ledger", ""), rows), agree


def throughput(base: Scenario, *, device: str, progress: Progress) -> Table:
    """Cost of a step on a device by number of points and precision, against one core of the CPU.

    Args:
        base: a two-phase scene.
        device: a Warp device; "cpu" rehearses with few points.
        progress: called with what is being measured.
    """
    sizes: Sequence[int] = SIZES if device != "cpu" else DRY_RUN_SIZES
    cpu = _stepper(base, sizes[0], "float64", "cpu")
    (one_core,) = in_turns([cpu], rounds=3, seconds=0.5)
    del cpu
    rows = []
    for precision in ("float64", "float32"):
        for size in sizes:
            progress(f"{size:,} points in {precision} on {device}")
            stepper = _stepper(base, size, precision, device)
            (cost,) = in_turns([stepper], rounds=5, seconds=0.5)
            points = stepper.simulation.material_points
            held = sum(stepper.simulation.arrays.values())
            rows.append(
                (
                    precision,
                    f"{points:,}",
                    f"{cost:.3f}",
                    f"{1e-6 * cost * points:.2f}",
                    f"{one_core / cost:.1f}",
                    f"{held / 2**20:,.0f}",
                )
            )
            del stepper
    columns = (
        "precision", "points", "ns per point and step", "ms per step", "times as fast as one core", "memory [MiB]"
    )  # fmt: skip
    title = f"Steps on {device}; one core of the CPU takes {one_core:.1f} ns at {sizes[0]:,} points"
    return Table("devices", title, columns, rows)


def differences(run: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Relative differences of two runs of a scene: force (root mean square of the filtered one, over the peak),
    impulse, displacement, kinetic energy (root mean square over the greatest). Where the reference is nil the
    difference itself; infinite where it is no number."""

    def relative(difference: float, scale: float) -> float:
        share = difference / scale if scale > 0.0 else difference
        return share if math.isfinite(share) else math.inf

    found = {}
    a, b = _filtered(run), _filtered(reference)
    found["force"] = relative(float(np.sqrt(np.mean((a - b) ** 2))), float(np.abs(b).max()))
    impulse, expected = _impulse(run), _impulse(reference)
    found["impulse"] = relative(abs(impulse - expected), abs(expected))
    shift, right = run["barrier_displacement"][-1], reference["barrier_displacement"][-1]
    found["displacement"] = relative(abs(shift - right), abs(right))
    energy, kept = run["flow_kinetic_energy"], reference["flow_kinetic_energy"]
    found["kinetic energy"] = relative(float(np.sqrt(np.mean((energy - kept) ** 2))), float(kept.max()))
    return found


def _filtered(run: dict[str, Any]) -> Any:
    return moving_mean(run["time"], run["impact_force_x"])


def _impulse(run: dict[str, Any]) -> float:
    return float(np.sum(np.diff(run["time"]) * run["impact_force_x"][1:]))


def _run(scene: Scenario, device: str, *, nudge: float = 0.0) -> dict[str, Any]:
    simulation = Simulation(scene, device=device)
    if nudge:
        velocity = simulation.points(["solid_velocity"])["solid_velocity"]
        simulation.set_points(solid_velocity=velocity * (1.0 + nudge))
    recorder = SeriesInMemory(Schedule(scene.output.time_series_interval_s))
    record_until(simulation, [recorder], scene.output.end_time_s)
    return recorder.series()


def _ledger(scene: Scenario, run: dict[str, Any]) -> list[float]:
    found = [mass_error(run), momentum_error(run, scene.gravity.acceleration_m_per_s2)]
    if scene.barrier is not None and scene.barrier.motion.kind != "prescribed":
        found.append(energy_error(run))
    return [math.inf if not math.isfinite(error) else error for error in found if error is not None]


def _stepper(base: Scenario, points: int, precision: str, device: str) -> Stepper:
    spacing = math.sqrt(base.flow.volume * base.numerics.points_per_cell / points)
    # As long as some ten thousand steps last, on a domain that fits them: memory is for points, not for an empty grid.
    steps = 2e4 * spacing / 500.0
    changes = {
        "numerics.spacing_m": spacing,
        "numerics.precision": precision,
        "output.end_time_s": steps,
        "output.time_series_interval_s": steps,
        "output.snapshot_interval_s": steps,
    }
    clock = time.process_time if device == "cpu" else time.perf_counter
    return Stepper(base.replaced(changes), device=device, clock=clock)
