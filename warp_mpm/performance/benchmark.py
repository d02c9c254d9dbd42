"""Speed of the simulator on this machine, as ratios to the barest possible step in the same run."""

from __future__ import annotations

import platform
import time
from typing import Any

from warp_mpm.effect_rules import with_law, without_liquid
from warp_mpm.performance.arrival import arrival_cost
from warp_mpm.performance.machine import processor
from warp_mpm.performance.plan import OWN_FIELDS
from warp_mpm.performance.probe import Measured, Stepper, clock_of, in_turns
from warp_mpm.performance.table import Progress, Table
from warp_mpm.performance.whole_runs import first_run, recording, several_at_once
from warp_mpm.performance.yardstick import Yardstick
from warp_mpm.scenario import Scenario
from warp_mpm.shipped import SCENARIOS
from warp_mpm.simulation import Simulation

SHORT: dict[str, Any] = {"numerics.spacing_m": 0.125, "output.end_time_s": 0.5}
"""The scene of the ratios: the paper's case 1 with some 11,500 points, on a grid fitted to half a second."""

ROUNDS, TURN = 11, 0.1
"""Turns that each measurement has, and their length [s]."""


def speed_tables(base: Scenario, *, device: str, full: bool, progress: Progress) -> list[Table]:
    """All tables of `benchmark speed`.

    Args:
        base: a two-phase scene with everything on.
        device: a Warp device.
        full: also a million points, which takes some minutes and 2 GB.
        progress: called with what is being measured.
    """
    scene = base.replaced(SHORT)
    tables = [_ratios(scene, device, progress), _kernels(scene, device, progress)]
    tables += [_sizes(base, device, full, progress), _domains(scene, device, progress), _drag(base, device, progress)]
    tables += [_larger_steps(base, device, progress)]
    tables += [arrival_cost(base, device=device, progress=progress), recording(base, device, progress)]
    if device == "cpu":
        tables += [first_run(CASE, progress), several_at_once(base.replaced({"output.end_time_s": 4.0}), progress)]
    return tables


def effect_costs(base: Scenario, *, device: str, progress: Progress) -> list[tuple[str, float, float]]:
    """Name, ratio to the yardstick and cost [ns] per point and step, with effects added one at a time."""
    clock = clock_of(device)
    named = _ladder(base.replaced(SHORT))
    steppers = []
    for name, scene in named:
        progress(name)
        steppers.append(Stepper(scene, device=device, clock=clock))
    yardstick = Yardstick(steppers[0].simulation.material_points, device=device, clock=clock)
    measured: list[Measured] = [yardstick, *steppers]
    costs = in_turns(measured, rounds=ROUNDS, seconds=0.5 * TURN)
    return [(name, cost / costs[0], cost) for (name, _), cost in zip(named, costs[1:], strict=True)]


def law_costs(base: Scenario, *, device: str, progress: Progress) -> Table:
    """What each law costs in place of Mohr-Coulomb, and inertial drag beside it, with everything else on."""
    scene = base.replaced(SHORT)
    named = {law: scene.replaced(with_law(scene, law, **own)) for law, own in OWN_FIELDS.items()}
    named["mohr_coulomb, dilatancy"] = scene.replaced({"flow.material.dilatancy": {"critical_solid_fraction": 0.56}})
    named["mu_i, dilatancy"] = named["mu_i"].replaced({"flow.material.dilatancy": {"critical_solid_fraction": 0.56}})
    named["mohr_coulomb, inertial drag"] = scene.replaced({"flow.material.inertial_drag_coefficient": 0.4})
    clock, steppers = clock_of(device), []
    for name, each in named.items():
        progress(name)
        steppers.append(Stepper(each, device=device, clock=clock))
    yardstick = Yardstick(steppers[0].simulation.material_points, device=device, clock=clock)
    costs = in_turns([yardstick, *steppers], rounds=ROUNDS, seconds=0.5 * TURN)
    rows = [
        (name, f"{cost / costs[0]:.2f}", f"{(cost - costs[1]) / costs[0]:+.2f}")
        for name, cost in zip(named, costs[1:], strict=True)
    ]
    return Table("laws", "Cost of each law, two-phase, all on", ("law", "yardsticks", "against mohr_coulomb"), rows)


def _ladder(full: Scenario) -> list[tuple[str, Scenario]]:
    """Scenes from a dry elastic flow on smooth ground up to everything, one effect more each."""
    undrained = full.replaced(without_liquid(full))
    dry = undrained.replaced(without_liquid(undrained))
    assert full.barrier is not None
    barrier = full.resolved()["barrier"]
    fixed = barrier | {"motion": {"kind": "fixed"}, "friction": 0.0}
    nothing: dict[str, Any] = {
        "barrier": None, "numerics.volumetric_smoothing": False, "numerics.density_correction": 0.0,
        "numerics.bulk_viscosity": 0.0,
    }  # fmt: skip
    steps: list[tuple[str, dict[str, Any]]] = [
        ("dry, elastic, smooth ground", {}),
        ("plasticity", {"flow": dry.resolved()["flow"]}),
        ("volumetric smoothing", {"numerics.volumetric_smoothing": True}),
        ("density correction", {"numerics.density_correction": full.numerics.density_correction or 1.0}),
        ("bulk viscosity", {"numerics.bulk_viscosity": full.numerics.bulk_viscosity or 0.2}),
        ("fixed barrier", {"barrier": fixed}),
        ("barrier friction", {"barrier": fixed | {"friction": barrier["friction"]}}),
        ("sliding barrier", {"barrier": barrier}),
    ]
    scenes, scene = [], dry.replaced(nothing | with_law(dry, "elastic"))
    for name, changes in steps:
        scene = scene.replaced(changes)
        scenes.append((name, scene))
    wet = {"numerics.pressure_relaxation": 0.0}
    scenes.append(("liquid, undrained", undrained.replaced(wet)))
    scenes.append(("pressure relaxation", undrained))
    scenes.append(("second phase, drag", full))
    scene = full
    steps = [
        ("porosity update", {"flow.material.porosity_update": True}),
        ("ground friction", {"ground.friction": 0.3}),
        ("side walls", {"domain.left_edge": "wall", "domain.right_edge": "wall"}),
        ("ceiling", {"domain.top_edge": "wall"}),
    ]
    for name, changes in steps:
        scene = scene.replaced(changes)
        scenes.append((name, scene))
    return scenes


def _ratios(scene: Scenario, device: str, progress: Progress) -> Table:
    progress("ratio to the yardstick")
    clock = clock_of(device)
    undrained = scene.replaced(without_liquid(scene))
    dry = undrained.replaced(without_liquid(undrained))
    scenes = {
        "two-phase, all on": scene,
        "undrained": undrained,
        "dry": dry,
        "two-phase, fixed barrier": scene.replaced({"barrier.motion": {"kind": "fixed"}}),
        "two-phase, FLIP": scene.replaced({"numerics.transfer": "flip"}),
        "two-phase, float32": scene.replaced({"numerics.precision": "float32"}),
    }
    steppers = [Stepper(each, device=device, clock=clock) for each in scenes.values()]
    points = steppers[0].simulation.material_points
    costs = in_turns([Yardstick(points, device=device, clock=clock), *steppers], rounds=ROUNDS, seconds=TURN)
    rows = [("yardstick", f"{costs[0]:.1f}", "1.0", "")]
    for name, cost, stepper in zip(scenes, costs[1:], steppers, strict=True):
        held = sum(size for array, size in stepper.simulation.arrays.items() if array.startswith("points."))
        rows.append((name, f"{cost:.1f}", f"{cost / costs[0]:.2f}", f"{held / points:.0f}"))
    title = f"Cost of a step, {points:,} points"
    return Table("ratios", title, ("scene", "ns per point and step", "yardsticks", "bytes per point"), rows)


def _kernels(scene: Scenario, device: str, progress: Progress) -> Table:
    progress("kernels of a step")
    simulation = Simulation(scene, device=device)
    simulation.advance(1e-3)
    spent = simulation.kernel_times(0.2)
    idle = min(spent.values())
    whole = sum(each - idle for each in spent.values())
    rows = [(name, f"{(spent[name] - idle) / whole:.1%}") for name in simulation.launched_kernels]
    return Table("kernels", "Where the time of a two-phase step goes", ("kernel", "share"), rows)


def _sizes(base: Scenario, device: str, full: bool, progress: Progress) -> Table:
    progress("number of points")
    clock = clock_of(device)
    spacings = [0.25, 0.125, 0.0625, *([0.03125, 0.0133] if full else [])]
    rows, first = [], 0.0
    for spacing in spacings:
        scene = base.replaced({"numerics.spacing_m": spacing, "output.end_time_s": 0.2})
        stepper = Stepper(scene, device=device, clock=clock)
        points = stepper.simulation.material_points
        small = Yardstick(11_472, device=device, clock=clock)
        yard, cost = in_turns([small, stepper], rounds=7, seconds=TURN)
        first = first or cost / yard
        held = sum(stepper.simulation.arrays.values()) / points
        costs = (f"{cost:.1f}", f"{cost / yard:.2f}", f"{cost / yard / first - 1.0:+.0%}")
        rows.append((f"{points:,}", *costs, f"{held:.0f}"))
    columns = ("points", "ns per point and step", "yardsticks", "against the first", "bytes per point, grid included")
    return Table("sizes", "Cost against the number of points (yardstick of 11,472)", columns, rows)


def _domains(scene: Scenario, device: str, progress: Progress) -> Table:
    progress("size of the domain")
    clock = clock_of(device)
    steppers = []
    for scale in (1.0, 10.0):
        edges = {"domain.left_m": -30.0 * scale, "domain.right_m": 30.0 * scale, "domain.top_m": 15.0}
        steppers.append(Stepper(scene.replaced(edges), device=device, clock=clock))
    costs = in_turns(steppers, rounds=ROUNDS, seconds=TURN)
    rows = [
        (name, f"{cost:.1f}", f"{cost / costs[0] - 1.0:+.1%}")
        for name, cost in zip(("60 m", "600 m"), costs, strict=True)
    ]
    return Table(
        "domains", "Cost against the length of the domain", ("domain", "ns per point and step", "difference"), rows
    )


def _drag(base: Scenario, device: str, progress: Progress) -> Table:
    progress("drag, explicit and semi-implicit")
    rows, displacements = [], []
    for drag in ("semi_implicit", "explicit"):
        changes = {"numerics.spacing_m": 0.4, "numerics.drag": drag, "output.end_time_s": 1.2}
        simulation = Simulation(base.replaced(changes), device=device)
        simulation.advance(1.2)
        displacements.append(simulation.sample()["barrier_displacement"])
        share = displacements[-1] / displacements[0] - 1.0
        record = simulation.record
        row = (drag.replace("_", "-"), f"{record['steps']:,}", f"{record['time_step_max']:.2e}")
        rows.append((*row, f"{displacements[-1]:.4f} ({share:+.1%})"))
    columns = ("drag", "steps to t = 1.2 s", "greatest step [s]", "barrier displacement [m]")
    return Table("drag", "What semi-implicit drag saves, at 0.4 m", columns, rows)


def _larger_steps(base: Scenario, device: str, progress: Progress) -> Table:
    """What a larger step would be worth at best: that of a softer liquid, and what coarser cells give instead."""
    progress("larger and smaller steps")
    modulus = base.resolved()["flow"]["material"]["liquid_bulk_modulus_Pa"]
    named: list[tuple[str, dict[str, Any]]] = [("as it is", {})]
    named += [(f"Courant number {c:g}", {"numerics.courant_number": c}) for c in (0.5, 0.25)]
    named += [
        (f"liquid's bulk modulus / {f}", {"flow.material.liquid_bulk_modulus_Pa": modulus / f}) for f in (4, 16, 64)
    ]
    named += [(f"spacing {spacing:g} m", {"numerics.spacing_m": spacing}) for spacing in (0.3, 0.4)]
    clock, rows, spent = clock_of(device), [], []
    for name, changes in named:
        simulation = Simulation(base.replaced({"output.end_time_s": 4.0} | changes), device=device)
        simulation.advance(1e-6)
        begin, peak = clock(), 0.0
        for record in range(1, 401):
            simulation.advance(0.01 * record)
            peak = max(peak, simulation.sample()["impact_force_x"])
        spent.append(clock() - begin)
        figures = (f"{simulation.steps:,}", f"{simulation.record['time_step_max']:.2e}", f"{spent[-1] / spent[0]:.2f}")
        rows.append((name, *figures, f"{simulation.barrier_displacement:.3f}", f"{peak / 1e3:.0f}"))
    columns = (
        "case 1", "steps to t = 4 s", "greatest step [s]", "time", "barrier displacement [m]", "peak force [kN/m]"
    )  # fmt: skip
    return Table("steps", "Larger and smaller steps", columns, rows)


CASE = SCENARIOS / "case_1.json"


def machine() -> dict[str, str]:
    """What the figures were taken on."""
    import warp

    return {"processor": processor(), "warp": warp.__version__, "python": platform.python_version(), "taken": _today()}


def _today() -> str:
    return time.strftime("%Y-%m-%d", time.gmtime())
