"""The numbers of a scene that its kernels read."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

from ..effects import Effects
from ..grid import GridLayout, barrier_planes
from ..kernels import layout as at
from ..kernels.mohr_coulomb import yield_constants
from ..scenario import STANDARD_GRAVITY, Scenario, Sliding, Trapezoid
from ..time_step import StepLimits


def kernel_parameters(
    scenario: Scenario, effects: Effects, types: SimpleNamespace, *, grid: GridLayout, limits: StepLimits, workers: int
) -> Any:
    """The kernels' `Parameters`; those of an effect that is absent have no field there.

    Args:
        scenario: the scene.
        effects: its effects.
        types: of the kernels, from `layout`.
        grid: from `fit_grid`.
        limits: on the time step.
        workers: threads that share the blocks of the grid in use.
    """
    values = _grid_and_clock(scenario, grid, limits, workers) | _skeleton(scenario, effects, limits)
    if effects.liquid:
        values |= _liquid(scenario, effects, limits)
    values |= _edges(scenario, effects, grid)
    if scenario.barrier is not None:
        values |= _barrier(scenario, effects)
    parameters = types.Parameters()
    for name, value in values.items():
        setattr(parameters, name, types.V2(*value) if isinstance(value, tuple) else value)
    return parameters


def _grid_and_clock(scenario: Scenario, grid: GridLayout, limits: StepLimits, workers: int) -> dict[str, Any]:
    numerics = scenario.numerics
    return {
        "spacing": numerics.spacing_m,
        "inverse_spacing": 1.0 / numerics.spacing_m,
        "left": grid.left,
        "bottom": grid.bottom,
        "columns": grid.columns,
        "rows": grid.rows,
        "block_rows": grid.rows // at.BLOCK,
        "workers": workers,
        "gravity": scenario.gravity.vector,
        "wave_speed": limits.wave_speed,
        "courant_number": numerics.courant_number,
        "largest_stable_step": limits.drag_step,
        "pic_rate": numerics.pic_share * (limits.sound_speed / numerics.spacing_m),
    }


def _skeleton(scenario: Scenario, effects: Effects, limits: StepLimits) -> dict[str, Any]:
    material, numerics = scenario.flow.material, scenario.numerics
    young, nu = material.young_modulus_Pa, material.poisson_ratio
    shear = young / (2.0 * (1.0 + nu))
    lame = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    values: dict[str, Any] = {
        "solid_density": material.density if effects.formulation == "undrained" else material.solid_partial_density,
        "lame": lame,
        "shear_modulus": shear,
        "bulk_modulus": lame + 2.0 / 3.0 * shear,
        "grain_share": 1.0 - material.porosity,
    }
    if effects.plasticity:
        values |= yield_constants(
            lame=lame,
            shear_modulus=shear,
            friction_angle=math.radians(material.friction_angle_deg),
            dilatancy_angle=math.radians(material.dilatancy_angle_deg),
            cohesion=material.cohesion_Pa,
            tension_cutoff=material.tension_cutoff_Pa,
        )
    if effects.density_correction:
        values["density_correction"] = numerics.density_correction
    if effects.bulk_viscosity:
        values["bulk_viscosity"] = numerics.bulk_viscosity * material.density * limits.sound_speed * numerics.spacing_m
    return values


def _liquid(scenario: Scenario, effects: Effects, limits: StepLimits) -> dict[str, Any]:
    material: Any = scenario.flow.material
    numerics = scenario.numerics
    values = {
        "porosity": material.porosity,
        "true_liquid_density": material.liquid_density_kg_per_m3,
        "liquid_bulk_modulus": material.liquid_bulk_modulus_Pa,
        "cavitation_pressure": material.cavitation_pressure_Pa,
        "relaxation_rate": numerics.pressure_relaxation * (limits.sound_speed / numerics.spacing_m),
    }
    if effects.two_phase:
        n, solid, liquid = material.porosity, material.solid_partial_density, material.liquid_partial_density
        coefficient = n**2 * material.liquid_density_kg_per_m3 * STANDARD_GRAVITY / material.hydraulic_conductivity
        values |= {
            "liquid_density": liquid,
            "drag_coefficient": coefficient,
            "drag_rate": coefficient * (1.0 / solid + 1.0 / liquid),
        }
    return values


def _edges(scenario: Scenario, effects: Effects, grid: GridLayout) -> dict[str, Any]:
    domain = scenario.domain
    values: dict[str, Any] = {}
    if scenario.ground is not None:
        values["ground_row"] = grid.ground_row
        if effects.ground == "frictional":
            values["ground_friction"] = scenario.ground.friction
    if effects.ceiling:
        above = grid.rows - 4 if domain.top_m is None else round((domain.top_m - grid.bottom) / grid.spacing)
        values["ceiling_row"] = above - 1
    if effects.side_walls:
        far = 1e6 * grid.spacing * grid.columns
        x_right = grid.left + grid.columns * grid.spacing
        left = domain.left_m if domain.left_m is not None else grid.left + 4 * grid.spacing
        right = domain.right_m if domain.right_m is not None else x_right - 4 * grid.spacing
        values["left_wall"] = left if domain.left_edge == "wall" else -far
        values["right_wall"] = right if domain.right_edge == "wall" else far
    return values


def _barrier(scenario: Scenario, effects: Effects) -> dict[str, Any]:
    barrier = scenario.barrier
    assert barrier is not None
    planes = {surface: (normal, offset) for surface, normal, offset in barrier_planes(barrier)}
    nowhere = ((0.0, 1.0), 1e30)
    values: dict[str, Any] = {
        "face_normal": planes[at.FACE][0],
        "crest_height": planes.get(at.TOP, nowhere)[1],
        "back_normal": planes.get(at.BACK, nowhere)[0],
        "back_offset": planes.get(at.BACK, nowhere)[1],
    }
    if effects.liquid:
        values["crest_end"] = barrier.shape.polygon[2, 0] if isinstance(barrier.shape, Trapezoid) else 0.0
    if effects.barrier == "sliding":
        mass = barrier.mass
        assert mass is not None
        assert isinstance(barrier.motion, Sliding)
        values |= {
            "barrier_mass": mass,
            "barrier_weight": -mass * scenario.gravity.vector[1],
            "barrier_pull": mass * scenario.gravity.vector[0],
            "base_friction": barrier.motion.base_friction_coefficient,
        }
    return values
