"""A law of one's own, in a script: a viscous mud that flows however small the stress, and how well it does so.

The vortex of Taylor and Green in a box with smooth walls decays at the rate 2 ν k², k = π / L; that of a Maxwell fluid,
whose shear stress takes the time η / G to build up, at the r of (η / G) r² - r + 2 ν k² = 0.

Run it: python docs/develop/viscous_law.py
"""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

import math
from typing import Annotated

import numpy as np
import warp as wp
from pydantic import Field

from warp_mpm import Scenario, Simulation
from warp_mpm.laws import Law, Model, register


class Settings(Model):
    viscosity_Pa_s: Annotated[float, Field(gt=0.0, le=1e9)]
    """Dynamic viscosity η."""


class Mud(Law):
    """Viscous in shear, elastic in compression. Implicit, so that no viscosity bounds the time step."""

    name = "mud"
    title = "linear viscous in shear, elastic in compression"
    Settings = Settings
    constants = ("viscosity",)

    def numbers(self, material):
        return {"viscosity": material.viscosity_Pa_s}

    def lateral_stress_ratio(self, material):
        return 1.0  # a fluid at rest

    def functions(self, types, tools):
        F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters

        @wp.func
        def back(
            points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters
        ):
            # ds/dt = 2 G (e - s / 2 η), with the s at the end of the step.
            mean = (stress[0] + stress[1] + stress[2]) / F(3.0)
            keep = parameters.viscosity / (parameters.viscosity + parameters.shear_modulus * time_step)
            shear = stress - V4(mean, mean, mean, F(0.0))
            return keep * shear + V4(mean, mean, mean, F(0.0)), F(0.0)

        return {"back": back}


DENSITY, VISCOSITY, SIDE, SPEED, END = 1000.0, 200.0, 1.0, 0.2, 0.25
SCENE = {
    "title": "Vortex of mud in a box",
    "gravity": {"acceleration_m_per_s2": 0.0},
    "flow": {
        "formulation": "dry",
        "shape": {"kind": "polygon", "vertices_m": [[-1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [-1.0, 1.0]]},
        "velocity_m_per_s": [0.0, 0.0],
        "initial_stress": "zero",
        "material": {
            "grain_density_kg_per_m3": 2.0 * DENSITY,
            "porosity": 0.5,
            "young_modulus_Pa": 1e5,
            "poisson_ratio": 0.45,
            "law": "mud",
            "viscosity_Pa_s": VISCOSITY,
        },
    },
    "domain": {
        "left_edge": "wall", "right_edge": "wall", "top_edge": "wall", "left_m": -1.0, "right_m": 0.0, "top_m": 1.0
    },
    "numerics": {"spacing_m": 1.0 / 16.0},
    "output": {"end_time_s": END},
}  # fmt: skip


def decay_rate(scenario: Scenario) -> float:
    """Rate [1/s] at which the velocity of the vortex decays here."""
    simulation = Simulation(scenario)
    x, y = math.pi * simulation.points()["position"].T / SIDE
    simulation.set_points(solid_velocity=SPEED * np.stack([np.sin(x) * np.cos(y), -np.cos(x) * np.sin(y)], axis=1))
    energy = []
    for time in (0.4 * END, END):  # the stress has built up by the first
        simulation.advance(until=time)
        energy.append(simulation.sample()["flow_kinetic_energy"])
    return 0.5 * math.log(energy[0] / energy[1]) / (0.6 * END)


NEWTONIAN_RATE = 2.0 * VISCOSITY / DENSITY * (math.pi / SIDE) ** 2
"""Of a fluid whose stress follows the rate of strain at once [1/s]."""


def exact_rate(shear_modulus: float) -> float:
    """The same where it takes its time [1/s]."""
    delay = VISCOSITY / shear_modulus
    return (1.0 - math.sqrt(1.0 - 4.0 * delay * NEWTONIAN_RATE)) / (2.0 * delay)


if __name__ == "__main__":
    register(Mud())
    scenario = Scenario.model_validate(SCENE)
    exact = exact_rate(scenario.flow.material.shear_modulus)
    print(f"the vortex decays at {decay_rate(scenario):.3f} 1/s; exact: {exact:.3f} 1/s")
