"""The two phases alone: how their difference in velocity decays, and how a skeleton settles in its liquid."""

from __future__ import annotations

import math

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Case, Curve, Outcome, Panel, compared, reference, reported
from warp_mpm.validation.scenes import CONDUCTIVITY, GRAIN_DENSITY, LIQUID_DENSITY, POROSITY, box, column, layers, scene

G = 9.81
SOLID, LIQUID = (1.0 - POROSITY) * GRAIN_DENSITY, POROSITY * LIQUID_DENSITY
REAL_WATER = 2.2e9


def relaxation_rate(conductivity: float) -> float:
    """Rate [1/s] at which v_L - v_S decays: Q (1/(n_S ρ_S) + 1/(n ρ_L)) with Q = n² ρ_L g / k_sat."""
    return POROSITY**2 * LIQUID_DENSITY * G / conductivity * (1.0 / SOLID + 1.0 / LIQUID)


def drag_relaxation(quick: bool) -> Outcome:
    del quick  # it takes no time
    checks, curves = [], []
    conductivity = 0.1
    rate = relaxation_rate(conductivity)
    times = np.linspace(0.0, 3.0 / rate, 31)
    for drag, name in (("semi_implicit", "semi-implicit"), ("explicit", "explicit")):
        body = scene(
            "a body of mixture in free space",
            box(0.0, 1.0, 1.0, bottom=1.0),
            "two_phase",
            end_time=float(times[-1]),
            gravity=0.0,
            stress="zero",
            ground=None,
            soil={"hydraulic_conductivity_m_per_s": conductivity},
            domain={"bottom_m": 0.0, "top_m": 3.0, "left_m": -1.0, "right_m": 2.0},
            spacing_m=0.125,
            courant_number=0.15,
            drag=drag,
        )
        simulation = Simulation(body)
        number = simulation.material_points
        simulation.set_points(
            solid_velocity=np.tile([-LIQUID / (SOLID + LIQUID), 0.0], (number, 1)),
            liquid_velocity=np.tile([SOLID / (SOLID + LIQUID), 0.0], (number, 1)),
        )
        slip = [1.0]
        for time in times[1:]:
            simulation.advance(float(time))
            points = simulation.points()
            slip.append(float((points["liquid_velocity"] - points["solid_velocity"])[:, 0].mean()))
        measured = -np.polyfit(times, np.log(slip), 1)[0]
        checks.append(compared(f"rate of decay, {name} drag", "1/s", float(measured), rate, 0.01))
        curves.append(Curve(1e3 * times, slip, name, "." if drag == "explicit" else "x"))
    exact = reference(1e3 * times, np.exp(-rate * times), "exp(−λ t)")
    return Outcome(
        checks=checks, panels=[Panel("difference of the velocities", "time [ms]", "v_L − v_S [m/s]", [exact, *curves])]
    )


def settling(quick: bool) -> Outcome:
    cells = 20 if quick else 40
    solid_speed = CONDUCTIVITY * (1.0 - POROSITY) * (GRAIN_DENSITY / LIQUID_DENSITY - 1.0)
    liquid_speed = solid_speed * (1.0 - POROSITY) / POROSITY
    # Elastic: it never comes near yield.
    soil = {"cohesion_Pa": 1e9, "tension_cutoff_Pa": 1e9, "liquid_bulk_modulus_Pa": REAL_WATER}
    simulation = Simulation(column("two_phase", cells=cells, end_time=0.3, soil=soil))
    points = simulation.points()
    density = SOLID + LIQUID
    simulation.set_points(
        effective_stress=np.zeros_like(points["effective_stress"]),
        pore_pressure=density * G * (1.0 - points["position"][:, 1]),
    )
    # Means over many sound crossings: the settling starts at once and sends weak waves through the column.
    sums = np.zeros((2, 2 * cells))
    times = np.linspace(0.1, 0.3, 401)
    for time in times:
        simulation.advance(float(time))
        points = simulation.points()
        sums += [layers(points[f"{phase}_velocity"], 2 * cells)[:, 1] for phase in ("solid", "liquid")]
    solid, liquid = sums / len(times)
    height = layers(points["position"], 2 * cells)[:, 1]
    middle = (height > 0.4) & (height < 0.6)
    checks = [
        compared("settling of the solid at mid-height", "m/s", -float(solid[middle].mean()), solid_speed, 0.01),
        compared("rise of the liquid at mid-height", "m/s", float(liquid[middle].mean()), liquid_speed, 0.01),
    ]
    consolidation = CONDUCTIVITY / (LIQUID_DENSITY * G * (1.0 / 2.4e6 + POROSITY / REAL_WATER))
    # Far from the top the skeleton is a half-space that settles onto a closed base: the flux near it is an erf.
    exact = solid_speed * np.vectorize(math.erf)(height / np.sqrt(4.0 * consolidation * 0.2))
    panel = Panel(
        "velocities, mean over t = 0.1 … 0.3 s",
        "velocity [m/s]",
        "height / H",
        [
            reference(-exact, height, "solid, erf(z/√(4 c_v t)) at 0.2 s"),
            Curve(solid, height, "solid", "."),
            Curve(liquid, height, "liquid", "."),
        ],
    )
    return Outcome(checks=checks, panels=[panel])


def inertial_settling(quick: bool) -> Outcome:
    """As above in coarse material, where Darcy's law alone would let it settle almost twice as fast."""
    cells, conductivity, coefficient = 20 if quick else 40, 0.02, 1.75 / math.sqrt(150.0 * POROSITY**3)
    permeability = conductivity * 1e-3 / (LIQUID_DENSITY * G)
    # (1 - n)(ρ_S - ρ_L) g = (ρ_L g / k) q + (ρ_L C_F / √κ) q², and v_S = -q.
    push = (1.0 - POROSITY) * (GRAIN_DENSITY - LIQUID_DENSITY) * G
    linear, square = LIQUID_DENSITY * G / conductivity, LIQUID_DENSITY * coefficient / math.sqrt(permeability)
    exact = 2.0 * push / (linear + math.sqrt(linear**2 + 4.0 * square * push))
    darcy = push / linear
    end = 0.25
    scenario = column(
        "two_phase",
        cells=cells,
        end_time=end,
        soil={
            "law": "elastic",
            # So soft that consolidation from the base does not come as far as the middle.
            "young_modulus_Pa": 2e4,
            "hydraulic_conductivity_m_per_s": conductivity,
            "liquid_bulk_modulus_Pa": 3e8,
            "inertial_drag_coefficient": coefficient,
        },
    )
    simulation = Simulation(scenario)
    points = simulation.points()
    simulation.set_points(
        effective_stress=np.zeros_like(points["effective_stress"]),
        pore_pressure=(SOLID + LIQUID) * G * (1.0 - points["position"][:, 1]),
    )
    times = np.linspace(0.0, end, 401)[1:]
    speeds = []
    for time in times:
        simulation.advance(float(time))
        height, speed = simulation.points()["position"][:, 1], simulation.points()["solid_velocity"][:, 1]
        speeds.append(-float(speed[(height > 0.5) & (height < 0.7)].mean()))
    settled = float(np.array(speeds)[times > 0.4 * end].mean())
    return Outcome(
        checks=[
            compared("settling of the solid", "m/s", settled, exact, 0.02),
            reported("by Darcy's law alone it would be", "m/s", darcy, reference=exact),
        ],
        panels=[
            Panel(
                "settling at mid-height",
                "time [s]",
                "velocity [m/s]",
                [reference([0.0, end], [exact, exact], "Forchheimer"), Curve(times, speeds, f"{cells} cells")],
            )
        ],
    )


CASES = (
    Case(
        name="drag-relaxation",
        title="Drag relaxation",
        tests="A body of mixture in free space whose phases move apart uniformly; nothing but drag acts.",
        source="exp(−λ t), λ = Q (1/(n_S ρ_S) + 1/(n ρ_L)), Q = n² ρ_L g/k: action and reaction between the phases",
        limit="1 % of the rate",
        run=drag_relaxation,
    ),
    Case(
        name="free-settling",
        title="Free settling of a skeleton",
        tests="A column whose whole weight rests on its pore pressure at first; the skeleton settles through the "
        "liquid, which has the stiffness of real water (with K_L = 30 MPa the liquid's own expansion takes 4 % off).",
        source="v_S = k (1 − n)(ρ_S/ρ_L − 1) = 8.0e-5 m/s, v_L = v_S (1 − n)/n, until consolidation arrives "
        "from the base",
        limit="1 %",
        run=settling,
    ),
    Case(
        name="inertial-settling",
        title="Settling of coarse material",
        tests="The same in coarse material (k = 2 cm/s) with Ergun's inertial drag, C_F = 1.75/√(150 n³).",
        source="(1 − n)(ρ_S − ρ_L) g = (ρ_L g/k) q + (ρ_L C_F/√κ) q², v_S = −q",
        limit="2 %",
        run=inertial_settling,
    ),
)
