"""Contact and the rigid barrier: friction on the ground, sliding under a given force, collisions."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from analytic.impact import Impact
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, at_most, compared, reference
from warp_mpm.validation.scenes import box, sampled, scene

G = 9.81
STIFF = {"young_modulus_Pa": 1e9, "poisson_ratio": 0.0, "law": "elastic"}


# -- block on an incline -----------------------------------------------------------------------------------------


def _block(slope: float, friction: float, spacing: float, times: Array, speed: float = 0.0) -> Array:
    """Displacement [times] of a stiff dry block of 2 m x 0.4 m on a slope [degrees]."""
    simulation = Simulation(
        scene(
            "block on a slope",
            box(-2.0, 0.0, 0.4),
            "dry",
            end_time=float(times[-1]),
            velocity=(speed, 0.0),
            tilt=slope,
            lateral=0.0,
            soil=STIFF,
            ground=friction,
            spacing_m=spacing,
            domain={"left_m": -4.0, "right_m": 6.0, "top_m": 1.0},
        )
    )
    start = simulation.points()["position"][:, 0].mean()
    moved = []
    for time in times:
        simulation.advance(float(time))
        moved.append(float(simulation.points()["position"][:, 0].mean() - start))
    return np.array(moved)


def incline(quick: bool) -> Outcome:
    spacing = 0.2 if quick else 0.1
    times = np.linspace(0.0, 1.0, 21)[1:]
    checks: list[Check] = []
    curves: list[Curve] = []
    for slope, friction, style in ((30.0, 0.1, "o"), (30.0, 0.3, "x"), (30.0, 0.5, "+")):
        angle = math.radians(slope)
        exact = 0.5 * G * (math.sin(angle) - friction * math.cos(angle)) * times**2
        ours = _block(slope, friction, spacing, times)
        checks.append(
            compared(f"slides: slope {slope:g}°, tan φ_b = {friction:g}, after 1 s", "m", ours[-1], exact[-1], 0.01)
        )
        curves += [
            reference(times, exact, "½ g (sin θ − μ cos θ) t²" if not curves else ""),
            Curve(times, ours, f"{slope:g}°, μ = {friction:g}", style),
        ]
    friction, speed = 0.3, 2.0
    stop = speed / (friction * G)
    exact = speed * np.minimum(times, stop) - 0.5 * friction * G * np.minimum(times, stop) ** 2
    ours = _block(0.0, friction, spacing, times, speed)
    checks.append(
        compared("is braked from 2 m/s to rest on level ground, tan φ_b = 0.3", "m", ours[-1], exact[-1], 0.01)
    )
    curves += [reference(times, exact, ""), Curve(times, ours, "braked from 2 m/s", "s")]
    fall = 0.5 * G * math.sin(math.radians(10.0))
    held = _block(10.0, 0.3, spacing, times)
    checks.append(
        at_most(
            "sticks: slope 10°, tan φ_b = 0.3, of the way of a smooth block in 1 s",
            "-",
            float(np.abs(held).max()) / fall,
            0.01,
            percent=True,
        )
    )
    curves.append(Curve(times, held, "10°, μ = 0.3: sticks", "."))
    return Outcome(checks=checks, panels=[Panel("displacement of the block", "time [s]", "displacement [m]", curves)])


# -- barrier under a force history -------------------------------------------------------------------------------


def _bystander(mass: float, friction: float, end_time: float) -> Simulation:
    """A sliding barrier, and a handful of material points far from it, which a simulation needs."""
    return Simulation(
        scene(
            "barrier alone",
            box(-200.0, -196.0, 4.0),
            "dry",
            end_time=end_time,
            lateral=1.0,
            soil={"cohesion_Pa": 1e6},  # it stays what it is, by the kernels of the collisions
            barrier={
                "shape": {"kind": "trapezoid", "base_width_m": 11.0, "crest_width_m": 4.0, "height_m": 6.0},
                "motion": {"kind": "sliding", "mass_kg_per_m": mass, "base_friction": friction},
                "friction": 0.0,
            },
            domain={"left_m": -210.0, "right_m": 30.0, "top_m": 10.0},
            spacing_m=2.0,
        )
    )


def force_history(quick: bool) -> Outcome:
    pieces = 500 if quick else 2000
    checks: list[Check] = []
    velocity: list[Curve] = []
    displacement: list[Curve] = []
    # The audit's examples: the barrier moves on after T2, and stops before it.
    for change, ratio, style in ((0.41, 0.35, "o"), (0.72, 0.20, "x")):
        impact = Impact(
            flow_mass=81e3,
            barrier_mass=81e3,
            flow_length=15.0,
            flow_height=3.0,
            speed=10.0,
            base_friction=0.29,
            geometry_change=change,
            rise_ratio=ratio,
        )
        end = 1.2 * impact.stop_time
        simulation = _bystander(81e3, 0.29, end)
        times = np.linspace(0.0, end, pieces + 1)
        speed, moved = [0.0], [0.0]
        for begin, until in pairwise(times):
            impulse = impact.impulse_until(float(until)) - impact.impulse_until(float(begin))
            simulation.set_external_force(impulse / (until - begin))
            simulation.advance(float(until))
            speed.append(simulation.barrier_velocity or 0.0)
            moved.append(simulation.barrier_displacement or 0.0)
        exact_speed = np.array([impact.barrier_velocity(float(t)) for t in times])
        exact_moved = np.array([impact.barrier_displacement(float(t)) for t in times])
        name = f"λ = {change:g}, τ = {ratio:g}"
        for quantity, ours, exact in (
            ("velocity", np.array(speed), exact_speed),
            ("displacement", np.array(moved), exact_moved),
        ):
            checks.append(
                at_most(
                    f"{quantity}, largest difference over its largest value, {name}",
                    "-",
                    float(np.abs(ours - exact).max() / exact.max()),
                    1e-4,
                )
            )
        checks.append(compared(f"final displacement, {name}", "m", moved[-1], float(exact_moved[-1]), 1e-4))
        step = max(1, pieces // 40)
        velocity += [
            reference(times, exact_speed, "closed form" if not velocity else ""),
            Curve(times[::step], speed[::step], name, style),
        ]
        displacement += [
            reference(times, exact_moved, "closed form" if not displacement else ""),
            Curve(times[::step], moved[::step], name, style),
        ]
    return Outcome(
        checks=checks,
        panels=[
            Panel("barrier velocity", "time [s]", "v_2 [m/s]", velocity),
            Panel("barrier displacement", "time [s]", "Δx [m]", displacement),
        ],
    )


# -- collisions --------------------------------------------------------------------------------------------------


def _collision(side: float, points_per_cell: int) -> tuple[dict[str, Array], float, float]:
    """A body of dust moves at 1 m/s onto a free barrier of 500 kg/m; samples and both masses."""
    barrier_mass = 500.0
    simulation = Simulation(
        scene(
            "collision",
            box(-side - 0.75, -0.75, side),
            "dry",
            end_time=4.0,
            velocity=(1.0, 0.0),
            gravity=0.0,
            stress="zero",
            soil={"young_modulus_Pa": 1e-9, "friction_angle_deg": 0.0},
            barrier={
                "shape": {"kind": "wall"},
                "friction": 0.0,
                "motion": {"kind": "sliding", "mass_kg_per_m": barrier_mass, "base_friction": 0.0},
            },
            domain={"left_m": -12.0, "right_m": 10.0, "top_m": 3.0},
            spacing_m=0.25,
            points_per_cell=points_per_cell,
        )
    )
    mass = simulation.sample()["momentum_x"]
    return sampled(simulation, np.linspace(0.0, 4.0, 81)[1:]), mass, barrier_mass


def collisions(quick: bool) -> Outcome:
    del quick
    checks, panels = [], []
    for name, side, points_per_cell in (("one point", 0.25, 1), ("slab", 1.25, 4)):
        series, mass, barrier_mass = _collision(side, points_per_cell)
        total = series["momentum_x"] + barrier_mass * series["barrier_velocity"]
        checks.append(
            at_most(
                f"{name}: momentum of flow and barrier, largest change",
                "of the momentum",
                float(np.abs(total / mass - 1.0).max()),
                1e-10,
            )
        )
        energy = series["flow_kinetic_energy"] + 0.5 * barrier_mass * series["barrier_velocity"] ** 2
        inelastic = 0.5 * mass * barrier_mass / (mass + barrier_mass)
        checks.append(compared(f"{name}: kinetic energy lost", "J/m", 0.5 * mass - float(energy[-1]), inelastic, 0.02))
        common = mass / (mass + barrier_mass)
        panels.append(
            Panel(
                f"{name}: velocities",
                "time [s]",
                "velocity [m/s]",
                [
                    reference(series["time"], np.full(80, common), "m_1 v/(m_1 + m_2)"),
                    Curve(series["time"], series["momentum_x"] / mass, "flow, mean"),
                    Curve(series["time"], series["barrier_velocity"], "barrier"),
                ],
            )
        )
    return Outcome(checks=checks, panels=panels)


CASES = (
    Case(
        name="incline",
        title="Block on an incline",
        tests="A stiff dry block on frictional ground: slides, sticks, is braked; gravity is tilted, not the grid.",
        source="a = g (sin θ − μ cos θ) where tan θ > μ, else rest",
        limit="1 % of the displacement",
        run=incline,
    ),
    Case(
        name="force-history",
        title="Rigid barrier under a given force",
        tests="The simulator's sliding barrier under the triangular force of the closed form, without a flow: sticks, "
        "slides, stops. The force is given piece by piece as its mean.",
        source="closed form of the impact model, stick and slip (analytic/impact.py, checked there by direct "
        "integration)",
        limit="1e-4",
        run=force_history,
    ),
    Case(
        name="collision",
        title="Collision with a free barrier",
        tests="One point, then a slab, of dust (no strength, hardly any stiffness) strike a barrier that is free.",
        source="momentum is conserved; a perfectly inelastic collision takes ½ m_1 m_2/(m_1 + m_2) v²",
        limit="momentum 1e-10, energy 2 %",
        run=collisions,
    ),
)
