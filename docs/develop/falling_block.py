"""Three dimensions: a cube of soil falls onto rough ground, and the ground comes to bear its weight.

A scenario describes the section, a channel draws it along z.

Run it: python docs/develop/falling_block.py
"""

from warp_mpm import Scenario, Simulation
from warp_mpm.channel import Channel

SCENE = {
    "title": "A cube falls",
    "flow": {
        "formulation": "dry",
        "shape": {"kind": "polygon", "vertices_m": [[-1.0, 0.5], [0.0, 0.5], [0.0, 1.5], [-1.0, 1.5]]},
        "velocity_m_per_s": [0.0, 0.0],
        "initial_stress": "zero",
        "material": {
            "grain_density_kg_per_m3": 2650.0,
            "porosity": 0.4,
            "young_modulus_Pa": 1e6,
            "poisson_ratio": 0.3,
            "friction_angle_deg": 30.0,
            "cohesion_Pa": 2e4,
            "tension_cutoff_Pa": 2e4,
        },
    },
    "ground": {"friction": 0.5},
    "domain": {"left_m": -2.5, "right_m": 1.5, "top_m": 3.0},
    "numerics": {"spacing_m": 0.25, "bulk_viscosity": 0.5},
    "output": {"end_time_s": 3.0},
}


def falling() -> Simulation:
    """The cube of 1 m, half a metre above the ground, in the middle of a channel of 3 m."""
    return Simulation(Scenario.model_validate(SCENE), channel=Channel(width=3.0, flow=(1.0, 2.0)))


if __name__ == "__main__":
    simulation = falling()
    weight = 9.81 * simulation.points()["solid_mass"].sum()
    print(f"weight {weight:.0f} {simulation.units['ground_force_y']}")
    for second in (1.0, 2.0, 3.0):
        mark = simulation.window()
        simulation.advance(until=second)
        force = simulation.sample(since=mark)["ground_force_y"]
        print(f"force on the ground until {second:g} s, mean over the second: {-force:.0f}")
