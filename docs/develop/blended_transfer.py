"""A transfer scheme of one's own, in a script: affine-augmented FLIP whose affine field is the nodes', as published.

The package's `aflip` lets a point's affine field gain what the nodes gain, and draws it to theirs at a rate. Fei et al.
(2021) take the nodes' own in every step. A block that spins freely shows what each costs.

Run it: python docs/develop/blended_transfer.py
"""

from typing import Annotated

import numpy as np
import warp as wp
from pydantic import Field

from warp_mpm import Scenario, Simulation
from warp_mpm.schemes import Aflip, Flip, Model, register


class Settings(Model):
    blend_rate: Annotated[float, Field(ge=0.0, le=10.0)] = 0.2
    """With blend: rate β at which a point's velocity is drawn to the grid's, per sound crossing of a cell."""


class Blend(Aflip):
    """Affine-augmented FLIP that takes the nodes' affine field as it is."""

    name = "blend"
    title = "affine-augmented FLIP as published, its velocities' loss a rate"
    settings = Settings

    def numbers(self, numerics, *, sound_speed, flow_speed):
        return {"pic_rate": numerics.blend_rate * sound_speed / numerics.spacing_m}

    def functions(self, types, tools):
        F, V3, V = types.scalar, types.V3, types.V
        Points, Grid, Parameters = types.Points, types.Grid, types.Parameters
        write = tools.write
        flip_collect = Flip.functions(self, types, tools)["collect"]

        @wp.func
        def collect(
            points: Points,
            p: wp.int32,
            grid: Grid,
            first: wp.int32,
            wx: V3,
            wy: V3,
            smooth: V,
            lean_x: V,
            lean_y: V,
            time_step: F,
            parameters: Parameters,
        ) -> V:
            write(points.affine_x, p, lean_x * (F(4.0) * parameters.inverse_spacing))
            write(points.affine_y, p, lean_y * (F(4.0) * parameters.inverse_spacing))
            return flip_collect(points, p, grid, first, wx, wy, smooth, lean_x, lean_y, time_step, parameters)

        return super().functions(types, tools) | {"collect": collect}


SPIN, TURN = 2.0, 1.0
SCENE = {
    "title": "A block that spins freely",
    "gravity": {"acceleration_m_per_s2": 0.0},
    "flow": {
        "formulation": "dry",
        "shape": {"kind": "polygon", "vertices_m": [[-6.0, 4.0], [-4.0, 4.0], [-4.0, 6.0], [-6.0, 6.0]]},
        "velocity_m_per_s": [0.0, 0.0],
        "initial_stress": "zero",
        "material": {
            "grain_density_kg_per_m3": 2000.0,
            "porosity": 0.5,
            "young_modulus_Pa": 1e6,
            "poisson_ratio": 0.3,
            "law": "elastic",
        },
    },
    "domain": {"left_m": -8.0, "right_m": 0.0, "top_m": 8.0},
    "numerics": {"spacing_m": 0.2, "bulk_viscosity": 0.0},
    "output": {"end_time_s": 1.0},
}


def energy_kept(transfer: str, courant_number: float) -> float:
    """Share of its energy that the block has left after a time [-]."""
    scenario = Scenario.model_validate(SCENE)
    scenario = scenario.replaced({"numerics.transfer": transfer, "numerics.courant_number": courant_number})
    simulation = Simulation(scenario)
    x, y = (simulation.points()["position"] - [-5.0, 5.0]).T
    simulation.set_points(solid_velocity=SPIN * np.stack([-y, x], axis=1))

    def energy() -> float:
        sample = simulation.sample()
        return sample["flow_kinetic_energy"] + sample["flow_elastic_energy"]

    before = energy()
    simulation.advance(until=TURN)
    return energy() / before


if __name__ == "__main__":
    register(Blend())
    for transfer in ("apic", "flip", "aflip", "blend"):
        kept = [energy_kept(transfer, courant) for courant in (0.9, 0.1)]
        print(f"{transfer}: energy kept {kept[0]:.4f} at a Courant number of 0.9, {kept[1]:.4f} at 0.1")
