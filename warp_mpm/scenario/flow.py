"""The flow: what is there, what arrives, of which materials, and its formulation."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, Literal, Self, Union

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from warp_mpm import geometry
from warp_mpm.scenario.arriving import Arriving, parts_of, pieces_of, surges_of
from warp_mpm.scenario.flow_outline import Deposit, FlowOnGround, FlowPolygon, FrontAndTail
from warp_mpm.scenario.ground import Ground
from warp_mpm.scenario.inflow import Inflow
from warp_mpm.scenario.material import Skeleton, TwoPhaseMaterial, UndrainedMaterial, formulation_of, with_law
from warp_mpm.scenario.other_material import OtherMaterial
from warp_mpm.scenario.velocity_profile import VelocityProfile
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.schema import Point, Velocity, set_fields
from warp_mpm.simulator.laws import DEFAULT, LAWS

COMMON = ("porosity_update", "conductivity_law")
"""Fields in which wet materials of one scene do not differ."""


class _FlowBase(VelocityProfile):
    shape: Annotated[FrontAndTail | FlowPolygon | FlowOnGround, Field(discriminator="kind")] | None = None
    """Outline at t = 0; null of a flow that only arrives (`inflow`)."""
    velocity_m_per_s: Annotated[tuple[Velocity, Velocity], Field(strict=False)] = (0.0, 0.0)
    """Velocity [x, y] at t = 0, of both phases, meant over the depth; it must be given with a shape."""
    inflow: Inflow | None = None
    """What arrives at a section during the run; null: nothing does."""
    deposits: Annotated[tuple[Deposit, ...], Field(strict=False, max_length=100)] = ()
    """What lies still at the start."""
    initial_stress: Literal["geostatic", "zero"] = "geostatic"
    """geostatic: liquid pressure hydrostatic and effective stress from the weight, along each vertical; zero: none."""
    lateral_stress_coefficient: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    """K0, horizontal over vertical effective stress at t = 0; null: that of the law, as Jaky's 1 - sin φ'."""

    initial_pore_pressure_ratio: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    """λ_p, pore pressure over total vertical stress at t = 0, of a geostatic start with a liquid: 1 where the flow is
    liquefied; null: hydrostatic."""
    initial_pore_pressure_ratios: (
        Annotated[tuple[Point, ...], Field(strict=False, min_length=2, max_length=2000)] | None
    ) = None
    """The same along the flow, [x, λ_p], x increasing: linear between, as the last beyond. null: one ratio for all."""

    material: Skeleton

    @model_validator(mode="before")
    @classmethod
    def _default_law(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("material"), dict):
            return data | {"material": {"law": DEFAULT} | data["material"]}
        return data

    @model_validator(mode="after")
    def _something_flows(self) -> Self:
        if self.shape is None and self.inflow is None:
            raise ValueError("shape is missing; it must be given, unless there is an inflow")
        if self.shape is not None and "velocity_m_per_s" not in self.model_fields_set:
            raise ValueError("velocity_m_per_s is missing; it must be given with a shape, as a list of 2 numbers")
        if self.shape is None and self.velocity_m_per_s != (0.0, 0.0):
            raise ValueError(
                f"velocity_m_per_s = {list(self.velocity_m_per_s)} is that of a shape, which is not given; the "
                "velocities of what arrives stand in inflow"
            )
        if self.shape is None and (self.sheared or self.velocity_exponent != 1.0):
            raise ValueError(
                "a velocity that varies over the depth is that of a shape, which is not given; that of what arrives "
                "stands in inflow"
            )
        return self

    @model_validator(mode="after")
    def _ratios(self) -> Self:
        if self.initial_pore_pressure_ratios is None:
            return self
        if self.initial_pore_pressure_ratio is not None:
            raise ValueError("needs at most one of initial_pore_pressure_ratio and initial_pore_pressure_ratios")
        before = -math.inf
        for place, (x, ratio) in enumerate(self.initial_pore_pressure_ratios):
            name = f"initial_pore_pressure_ratios[{place}]"
            if not 0.0 <= ratio <= 1.0:
                raise ValueError(f"{name} has the ratio {ratio:g}; it must be from 0 to 1")
            if not x > before:
                raise ValueError(f"{name} is at x = {x:g}, after {before:g}; x must increase")
            before = x
        return self

    def pore_pressure_ratio(self, x: NDArray[np.float64]) -> float | NDArray[np.float64] | None:
        """λ_p at t = 0 at places x [N] [m], one for all or [N]; None: hydrostatic."""
        if self.initial_pore_pressure_ratios is None:
            return self.initial_pore_pressure_ratio
        return np.interp(x, *np.array(self.initial_pore_pressure_ratios).T)

    @property
    def pore_pressure_ratio_range(self) -> tuple[float, float] | None:
        """Least and greatest λ_p at t = 0 that is given; None: hydrostatic."""
        if self.initial_pore_pressure_ratios is not None:
            ratios = [ratio for _, ratio in self.initial_pore_pressure_ratios]
            return min(ratios), max(ratios)
        ratio = self.initial_pore_pressure_ratio
        return None if ratio is None else (ratio, ratio)

    def laid_on(self, ground: Ground) -> Self:
        """The same flow over `ground`: what lies on it as a polygon, and the section of what arrives at its height."""
        changes: dict[str, Any] = {}
        if isinstance(self.shape, FlowOnGround):
            changes["shape"] = self.shape.over(ground)
        if any(isinstance(deposit.shape, FlowOnGround) for deposit in self.deposits):
            changes["deposits"] = tuple(deposit.laid_on(ground) for deposit in self.deposits)
        if self.inflow is not None:
            changes["inflow"] = self.inflow.laid_on(ground)
        return self.model_copy(update=changes) if changes else self

    @property
    def bodies(self) -> list[tuple[str, geometry.Polygon]]:
        """Field and outline [V, 2] [m] of everything that is there at t = 0."""
        found = [("flow.shape", self.shape.polygon)] if self.shape is not None else []
        return found + [(f"flow.deposits[{k}]", deposit.shape.polygon) for k, deposit in enumerate(self.deposits)]

    @model_validator(mode="after")
    def _other_materials(self) -> Self:
        wet = [] if formulation_of(self.material) == "dry" else [self.material]
        for body, one in self.others:
            name = f"{body}.material"
            try:
                own = self.material_of(one)
            except ScenarioError as error:
                raise ValueError(f"{name}: {error.problems[0].rstrip('.')}") from None
            except ValueError as error:
                raise ValueError(f"{name}.{error}") from None
            formulation = formulation_of(own)
            if formulation == "dry":
                continue
            wet.append(own)
            if formulation != formulation_of(wet[0]):
                raise ValueError(
                    f'{body}.formulation = "{formulation}" is not allowed, as what is wet in a scene '
                    f'has one formulation; it must be "{formulation_of(wet[0])}" or "dry"'
                )
            for field in COMMON:
                here, there = (getattr(material, field, None) for material in (own, wet[0]))
                if here != there:
                    raise ValueError(
                        f"{name}.{field} = {json.dumps(here)} is not allowed, as all that is wet in a scene shares it; "
                        f"it must be {json.dumps(there)}"
                    )
        return self

    @model_validator(mode="after")
    def _what_arrives(self) -> Self:
        inflow = self.inflow
        if inflow is None:
            return self
        surges = surges_of(inflow, self.material_of)
        if inflow.pore_pressure_ratios is not None and all(formulation_of(own) == "dry" for *_, own in surges):
            raise ValueError(
                "inflow.pore_pressure_ratios are not allowed, as all that arrives is dry and has no liquid; leave them "
                "out"
            )
        if inflow.densities_kg_per_m3 is None:
            return self
        for begin, end, _, own in surges:
            bounds = sorted([getattr(own, "liquid_density_kg_per_m3", 0.0), own.grain_density_kg_per_m3])
            for place, density in enumerate(inflow.densities_kg_per_m3):
                time, depth = inflow.times[place], inflow.depths[place]
                nothing = depth == density == 0.0
                if begin <= time <= end and not nothing and not bounds[0] < density < bounds[1]:
                    raise ValueError(
                        f"inflow.densities_kg_per_m3[{place}] = {density:g} is not allowed; it must be above "
                        f"{bounds[0]:g} and below {bounds[1]:g}, the densities of what fills the voids and of grains"
                    )
        return self

    @property
    def arriving(self) -> list[Arriving]:
        """What arrives, by material, in the order in which each begins to."""
        return parts_of(self.inflow, self.material_of) if self.inflow is not None else []

    def arrived_volume(self, mass: float) -> float:
        """Volume [m³/m] of so much mass [kg/m] of what arrives first."""
        parts = self.arriving
        if len(parts) == 1:
            return mass / parts[0].material.density
        assert self.inflow is not None
        volumes, masses = pieces_of(self.inflow, parts)
        return float(np.interp(mass, np.append(0.0, np.cumsum(masses)), np.append(0.0, np.cumsum(volumes))))

    @property
    def arriving_mass(self) -> float:
        """Mass of all that arrives [kg/m]."""
        return float(pieces_of(self.inflow, self.arriving)[1].sum()) if self.inflow is not None else 0.0

    @property
    def others(self) -> list[tuple[str, OtherMaterial]]:
        """What may be of another material, with its name below `flow`: deposits, what arrives, its later surges."""
        found: list[tuple[str, OtherMaterial]] = [(f"deposits[{k}]", one) for k, one in enumerate(self.deposits)]
        if self.inflow is not None:
            found.append(("inflow", self.inflow))
            found += [(f"inflow.surges[{k}]", one) for k, one in enumerate(self.inflow.surges)]
        return found

    def material_of(self, body: OtherMaterial) -> Skeleton:
        """The material of a body: the flow's, but for what its own says. What is left out of another law's fields
        has that law's defaults.

        Raises:
            ScenarioError: a field's value is not allowed, or one is missing.
            ValueError: there is no such field, or law.
        """
        given = body.material or {}
        if not given and body.formulation in (None, formulation_of(self.material)):
            return self.material
        law = given.get("law", self.material.law)
        if law not in LAWS.names:
            raise ValueError(f"law = {json.dumps(law)} is not known; it must be one of {', '.join(LAWS.names)}")
        formulation = body.formulation or formulation_of(self.material)
        kind = with_law(_MATERIALS[_FLOWS[formulation]], LAWS.named(law))
        for field in given:
            if field not in kind.model_fields:
                raise ValueError(
                    f'{field} is not allowed; a material with the formulation "{formulation}" and the law "{law}" has '
                    f"{', '.join(kind.model_fields)}"
                )
        base = self.material.model_dump()
        dropped = set() if law == self.material.law else set(LAWS.named(self.material.law).Settings.model_fields)
        if not LAWS.named(law).dilates:
            dropped.add("dilatancy")
        if "hydraulic_conductivity_m_per_s" in given or "intrinsic_permeability_m2" in given:
            dropped |= {"hydraulic_conductivity_m_per_s", "intrinsic_permeability_m2"}
        kept = {name: value for name, value in base.items() if name in kind.model_fields and name not in dropped}
        return kind.model_validate(kept | given | {"law": law})

    @property
    def materials(self) -> list[Skeleton]:
        """All of the scene's, the flow's first, then the deposits' own, then those of what arrives; equal ones once."""
        found = [self.material]
        for own in [*map(self.material_of, self.deposits), *(part.material for part in self.arriving)]:
            if own not in found:
                found.append(own)
        return found

    @property
    def wettest(self) -> Skeleton:
        """The first of the scene's materials whose liquid moves on its own; failing that, the first that holds any."""
        order = ("two_phase", "undrained", "dry")
        return min(self.materials, key=lambda material: order.index(formulation_of(material)))

    @property
    def wettest_formulation(self) -> Literal["two_phase", "undrained", "dry"]:
        """Formulation of a flow of that material: what a scene must know of its liquid."""
        return formulation_of(self.wettest)

    def of_material(self, place: int) -> Flow:
        """The flow as if all of it were of one of its materials."""
        if not place:
            return self  # type: ignore[return-value]
        material = self.materials[place]
        formulation = formulation_of(material)
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return _FLOWS[formulation].model_construct(**fields | {"formulation": formulation, "material": material})

    @property
    def polygon(self) -> geometry.Polygon:
        """Outline at t = 0, vertices [V, 2] in metres; of a flow that only arrives the box of its volume and depth that
        ends at the section."""
        if self.shape is not None:
            return self.shape.polygon
        assert self.inflow is not None
        right, low, depth = self.inflow.x_m, self.inflow.base, self.inflow.greatest_depth
        left = right - self.inflow.volume / depth
        return np.array([[left, low], [right, low], [right, low + depth], [left, low + depth]])

    @property
    def outlines(self) -> list[geometry.Polygon]:
        """All that is there at t = 0, vertices [V, 2] each [m], and of what arrives the section [2, 2]."""
        found = [outline for _, outline in self.bodies]
        if self.inflow is not None:
            x, low = self.inflow.x_m, self.inflow.base
            found.append(np.array([[x, low], [x, low + self.inflow.greatest_depth]]))
        return found

    @property
    def lateral_stress_ratio(self) -> float:
        """K0 [-], given or that of the material's law."""
        if self.lateral_stress_coefficient is not None:
            return self.lateral_stress_coefficient
        return LAWS.named(self.material.law).lateral_stress_ratio(self.material)

    @property
    def volume(self) -> float:
        """Volume V_1 [m³/m] of all that flows, what arrives during the run included."""
        there = geometry.area(self.shape.polygon) if self.shape is not None else 0.0
        return there + self.inflow.volume if self.inflow is not None else there

    @property
    def mass(self) -> float:
        """Mass of that [kg/m]."""
        if all(part.material == self.material for part in self.arriving):
            return self.volume * self.material.density
        there = geometry.area(self.shape.polygon) if self.shape is not None else 0.0
        return there * self.material.density + self.arriving_mass

    @property
    def deposited_volume(self) -> float:
        """Volume of the deposits [m³/m]."""
        return sum(geometry.area(deposit.shape.polygon) for deposit in self.deposits)

    @property
    def deposited_mass(self) -> float:
        """Mass of the deposits [kg/m]."""
        return sum(self.material_of(one).density * geometry.area(one.shape.polygon) for one in self.deposits)

    @property
    def depth(self) -> float:
        """Flow depth h [m]: the greatest vertical thickness of the outline and of what arrives."""
        if isinstance(self.shape, FrontAndTail):
            there = self.shape.depth_m
        else:
            there = geometry.maximum_depth(self.shape.polygon) if self.shape is not None else 0.0
        return max(there, self.inflow.greatest_depth) if self.inflow is not None else there

    @property
    def equivalent_length(self) -> float:
        """Length L_m [m] of the box of the same volume and depth."""
        return self.volume / self.depth

    @property
    def speed(self) -> float:
        """Magnitude of the initial velocity [m/s], meant over the depth, or of the greatest that arrives."""
        speed = math.hypot(*self.velocity_m_per_s)
        return max(speed, self.inflow.greatest_speed) if self.inflow is not None else speed

    @property
    def greatest_speed(self) -> float:
        """Magnitude of the greatest velocity at any height, initial or of what arrives [m/s]."""
        return max(self.speed, math.hypot(*self.velocity_m_per_s) * self.greatest_pace)


class TwoPhaseFlow(_FlowBase):
    """Saturated flow, solid and liquid with their own velocities (a_S–a_L formulation)."""

    formulation: Literal["two_phase"]
    material: TwoPhaseMaterial


class UndrainedFlow(_FlowBase):
    """Saturated flow, one velocity; the skeleton's volume strain drives the pore pressure."""

    formulation: Literal["undrained"]
    material: UndrainedMaterial


class DryFlow(_FlowBase):
    """Dry granular flow."""

    formulation: Literal["dry"]
    material: Skeleton


Flow = TwoPhaseFlow | UndrainedFlow | DryFlow

_FLOWS: dict[str, type[Flow]] = {"two_phase": TwoPhaseFlow, "undrained": UndrainedFlow, "dry": DryFlow}

_MATERIALS: dict[type[_FlowBase], type[Skeleton]] = {
    TwoPhaseFlow: TwoPhaseMaterial,
    UndrainedFlow: UndrainedMaterial,
    DryFlow: Skeleton,
}


def offer_laws() -> None:
    """Make each flow take materials of every law, with that law's fields."""
    for flow, material in _MATERIALS.items():
        kinds: Any = Union[tuple(with_law(material, law) for law in LAWS)]  # noqa: UP007 - of as many as there are
        set_fields(flow, {"material": (Annotated[kinds, Field(discriminator="law")], ...)})


offer_laws()
