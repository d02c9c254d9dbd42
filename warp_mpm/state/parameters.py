"""The numbers of a scene that its kernels read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from ..effects import Effects
from ..grid import GridLayout
from ..kernels import layout as at
from ..scenario import STANDARD_GRAVITY, Scenario, Trapezoid
from ..scenario.material import formulation_of
from ..simulator.bodies import Body
from ..simulator.bodies.of_scene import BARRIER
from ..simulator.bodies.outline import ENDLESS
from ..simulator.laws import LAWS, dilatancy
from ..time_step import StepLimits, moving_density


def kernel_parameters(
    scenario: Scenario,
    effects: Effects,
    types: SimpleNamespace,
    *,
    bodies: Sequence[Body],
    grid: GridLayout,
    limits: StepLimits,
    workers: int,
    liquid_density: float = 0.0,
) -> Any:
    """The kernels' `Parameters`; those of an effect that is absent have no field there.

    Args:
        scenario: the scene, as of one of its materials (`Scenario.of_material`).
        effects: its effects.
        types: of the kernels, from `layout`.
        bodies: all that the flow meets.
        grid: from `fit_grid`.
        limits: on the time step.
        workers: threads that share the blocks of the grid in use.
        liquid_density: of the liquid [kg/m³] whose pressure at rest the filter of the pressure leaves alone: one number
            for all of the scene's materials, as their pressures are averaged together.
    """
    values = _grid_and_clock(scenario, effects, grid, limits, workers) | _skeleton(scenario, effects, limits)
    if effects.liquid:
        values |= _liquid(scenario, effects, limits) | {"true_liquid_density": liquid_density}
    if effects.liquid and effects.bodies:
        values |= _crest(scenario, bodies)
    parameters = types.Parameters()
    for name, value in values.items():
        setattr(parameters, name, types.X(*value) if isinstance(value, tuple) else value)
    return parameters


def tell_nodes(of_materials: Sequence[Any], types: SimpleNamespace) -> None:
    """Set what a point of each material tells the nodes, per mass of its solid: by how much it differs from the first.

    A drag that changes with the porosity is told whole, by the kernels themselves.
    """
    if not types.told:
        return
    names = {"liquid": "liquid_ratio", "filling": "filling_ratio"}
    if not types.effects.porosity_update:
        names |= {"drag": "drag_per_mass", "drag_beyond": "inertial_drag_per_mass"}
    for own in of_materials:
        excess = [
            float(getattr(own, names[name])) - float(getattr(of_materials[0], names[name])) if name in names else 0.0
            for name in types.told
        ]
        own.excess, own.tells = types.M(*excess), int(any(excess))
        if types.effects.two_phase:
            own.solid_share = 1.0 / (1.0 + float(own.liquid_ratio))


def _grid_and_clock(
    scenario: Scenario, effects: Effects, grid: GridLayout, limits: StepLimits, workers: int
) -> dict[str, Any]:
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
        "gravity": (*scenario.gravity.vector, 0.0)[: effects.dimensions],
        "wave_speed": limits.wave_speed,
        "courant_number": numerics.courant_number,
        "largest_stable_step": limits.largest_step,
        "largest_stable_step_counter": at.LIMIT_LAW if limits.law_step < limits.drag_step else at.LIMIT_DRAG,
        **({"front": grid.front, "layers": grid.layers, "layer": grid.columns * grid.rows} if grid.layers > 1 else {}),
    } | effects.scheme.numbers(numerics, sound_speed=limits.sound_speed, flow_speed=scenario.flow.greatest_speed)


def _skeleton(scenario: Scenario, effects: Effects, limits: StepLimits) -> dict[str, Any]:
    material, numerics = scenario.flow.material, scenario.numerics
    values: dict[str, Any] = {
        "solid_density": moving_density(scenario),
        "lame": material.lame_modulus,
        "shear_modulus": material.shear_modulus,
        "bulk_modulus": material.bulk_modulus,
        "grain_share": 1.0 - material.porosity,
    }
    law = LAWS.named(material.law)
    values |= law.numbers(material)
    if material.dilatancy is not None:
        values |= dilatancy.numbers(material, law)
    if effects.density_correction:
        values["density_correction"] = numerics.density_correction
    if effects.bulk_viscosity:
        values["bulk_viscosity"] = numerics.bulk_viscosity * material.density * limits.sound_speed * numerics.spacing_m
    return values


def _liquid(scenario: Scenario, effects: Effects, limits: StepLimits) -> dict[str, Any]:
    material: Any = scenario.flow.material
    if formulation_of(material) == "dry":
        return {}  # dry in a scene that is wet elsewhere: kernels over its points read none of these
    numerics = scenario.numerics
    values = {
        "porosity": material.porosity,
        "filling_ratio": material.liquid_density_kg_per_m3 / moving_density(scenario),
        "liquid_bulk_modulus": material.liquid_bulk_modulus_Pa,
        "cavitation_pressure": material.cavitation_pressure_Pa,
        "relaxation_rate": numerics.pressure_relaxation * (limits.sound_speed / numerics.spacing_m),
    }
    if effects.two_phase:
        n, solid, liquid = material.porosity, material.solid_partial_density, material.liquid_partial_density
        coefficient = n**2 * material.liquid_density_kg_per_m3 * STANDARD_GRAVITY / material.hydraulic_conductivity
        values |= {
            "liquid_density": liquid,
            "liquid_ratio": liquid / solid,
            "drag_per_mass": coefficient / solid,
            "drag_rate": coefficient * (1.0 / solid + 1.0 / liquid),
        }
        if effects.conductivity == "exponential":
            values["conductivity_scale"] = material.conductivity_scale
        if effects.inertial_drag:
            per_volume = n**3 * material.liquid_density_kg_per_m3 * material.inertial_drag_coefficient
            per_volume /= math.sqrt(material.intrinsic_permeability)
            if effects.materials:
                values["inertial_drag_per_mass"] = per_volume / solid
            values["inertial_drag_rate"] = per_volume * (1.0 / solid + 1.0 / liquid)
    return values


def _crest(scenario: Scenario, bodies: Sequence[Body]) -> dict[str, Any]:
    """Where the pore pressure counts as loading the barrier: upstream of its crest's end."""
    names = [body.name for body in bodies]
    barrier = scenario.barrier
    if barrier is None:
        return {"crest_end": ENDLESS, "crest_body": 0}
    end = barrier.shape.polygon[2, 0] if isinstance(barrier.shape, Trapezoid) else 0.0
    return {"crest_end": end, "crest_body": names.index(BARRIER)}
