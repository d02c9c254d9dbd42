"""The flow: its outline, its material and its formulation."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

from __future__ import annotations

import json
import math
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, Self, Union

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, model_validator

from warp_mpm import geometry
from warp_mpm.scenario.ground import Ground
from warp_mpm.scenario.inflow import DENSITY_STEPS, Inflow
from warp_mpm.scenario.other_material import OtherMaterial
from warp_mpm.scenario.settings import STANDARD_GRAVITY
from warp_mpm.scenario.velocity_profile import VelocityProfile
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.schema import (
    AsWhole,
    Coordinate,
    Density,
    Length,
    Model,
    NonNegative,
    Point,
    Positive,
    Velocity,
    set_fields,
)
from warp_mpm.simulator.laws import DEFAULT, LAWS, Law
from warp_mpm.simulator.laws.dilatancy import Dilatancy

NARROWEST = 1e-6
"""Least width and height [m] of a flow's outline, those of the finest grid's cell."""

THINNEST = 1e-12
"""Least area of a flow's outline over the square of its extent; below it rounding decides where inside is."""


class FrontAndTail(Model):
    """The paper's flow: a front at 45°, `squares` squares of the flow's depth, a tail of three depths.

    Its length may be given in metres in place of a whole number of squares; exactly one of the two is given.
    """

    kind: Literal["front_and_tail"]
    depth_m: Length
    """Flow depth h."""
    squares: Annotated[int, Field(ge=0, le=100_000), AsWhole] | None = None
    """Number i of squares between front and tail. Volume (2 + i) h² per metre of width."""
    length_m: Length | None = None
    """Length L of the box of the flow's volume and depth, at least 2 h, in place of `squares`. Volume L h."""
    distance_m: Annotated[float, Field(ge=0.0, le=1e6)]
    """Distance d from the front's toe to the barrier's toe."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if (self.squares is None) == (self.length_m is None):
            raise ValueError("needs exactly one of squares and length_m")
        if self.length_m is not None and self.length_m < 2.0 * self.depth_m * (1.0 - 1e-9):
            raise ValueError(
                f"length_m = {self.length_m:g} must be at least twice depth_m, {2.0 * self.depth_m:g}: "
                "front and tail alone have as much"
            )
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres."""
        if self.squares is not None:
            return geometry.front_and_tail(self.depth_m, self.squares, self.distance_m)
        assert self.length_m is not None
        between = self.length_m / self.depth_m - 2.0
        return geometry.front_and_tail(self.depth_m, between if between > 1e-9 else 0, self.distance_m)


class FlowPolygon(Model):
    """A flow of any outline."""

    kind: Literal["polygon"]
    vertices_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=3, max_length=2000)]
    """Corners [x, y], in order around the outline, the last joining the first."""

    @model_validator(mode="after")
    def _simple(self) -> Self:
        crossing = geometry.crossing_edges(self.polygon)
        if crossing is not None:
            first, second = crossing
            raise ValueError(
                f"vertices_m must not cross or touch themselves; the side after corner {first + 1} meets "
                f"the side after corner {second + 1}"
            )
        if not geometry.area(self.polygon) > 0.0:
            raise ValueError("vertices_m must enclose an area greater than 0")
        width, height = np.ptp(self.polygon, axis=0)
        share = geometry.area(self.polygon) / (width**2 + height**2)
        if min(width, height) < NARROWEST or share < THINNEST:
            raise ValueError(
                f"vertices_m enclose {geometry.area(self.polygon):.3g} m² in a box of {width:.3g} m by {height:.3g} m; "
                f"the box must be at least {NARROWEST:g} m wide and high, and the area at least {THINNEST:g} of its "
                "diagonal squared"
            )
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres."""
        return np.array(self.vertices_m)


class FlowOnGround(Model):
    """What lies on the ground, whatever its profile: made into a polygon when the scenario is read."""

    kind: Literal["on_ground"]
    from_m: Coordinate
    """x of its tail."""
    to_m: Coordinate
    """x of its front."""
    depth_m: Length
    """Upright depth between tail and front."""
    tail_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Length over which the depth grows from nothing at the tail; 0: an upright end."""
    front_m: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Length over which the depth goes down to nothing at the front."""

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        if not self.to_m - self.from_m >= max(self.tail_m + self.front_m, NARROWEST):
            raise ValueError(
                f"to_m = {self.to_m:g} must be at least {max(self.tail_m + self.front_m, NARROWEST):g} m, tail_m and "
                f"front_m, beyond from_m = {self.from_m:g}"
            )
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres on level ground."""
        return self.over(Ground()).polygon

    def over(self, ground: Ground) -> FlowPolygon:
        """Its outline over `ground`, anticlockwise from the tail."""
        x = ground.profile[:, 0]
        ends = [[place, float(ground.height(place))] for place in (self.from_m, self.to_m)]
        lower = np.concatenate([ends[:1], ground.profile[(x > self.from_m) & (x < self.to_m)], ends[1:]])
        top = np.unique([*lower[:, 0], self.from_m + self.tail_m, self.to_m - self.front_m])
        depth = np.full(len(top), self.depth_m)
        if self.tail_m:
            depth *= np.clip((top - self.from_m) / self.tail_m, 0.0, 1.0)
        if self.front_m:
            depth *= np.clip((self.to_m - top) / self.front_m, 0.0, 1.0)
        upper = np.stack([top, ground.height(top) + depth], axis=1)
        outline = np.concatenate([lower, upper[depth > 0.0][::-1]])
        return FlowPolygon(kind="polygon", vertices_m=outline.tolist())


class Deposit(OtherMaterial):
    """What lies there at the start: the deposit of an earlier surge."""

    shape: Annotated[FlowPolygon | FlowOnGround, Field(discriminator="kind")]
    """Its outline."""

    def laid_on(self, ground: Ground) -> Self:
        """The same deposit as a polygon over `ground`, where it is of the kind on_ground."""
        if not isinstance(self.shape, FlowOnGround):
            return self
        return self.model_copy(update={"shape": self.shape.over(ground)})


class Skeleton(Model):
    """Solid grains and their skeleton, elastic up to what its law allows; the law's own fields stand beside these."""

    grain_density_kg_per_m3: Density
    """Density of the grains themselves. The dry (partial) density is (1 - n) times this."""
    porosity: Annotated[float, Field(gt=0.0, lt=1.0)]
    """Volume of the voids over the total volume, n."""
    young_modulus_Pa: Positive
    """Young's modulus E' of the drained skeleton."""
    poisson_ratio: Annotated[float, Field(gt=-1.0, lt=0.5)]
    """Poisson's ratio ν of the drained skeleton."""
    dilatancy: Dilatancy | None = None
    """How the skeleton swells or shrinks as it is sheared, by its density; null: by the law's constant angle."""
    law: str = DEFAULT
    """How the skeleton answers a strain."""

    @model_validator(mode="before")
    @classmethod
    def _no_plasticity(cls, data: Any) -> Any:
        if isinstance(data, dict) and "plasticity" in data:
            instead = '"law": "elastic"' if data["plasticity"] is False else 'nothing, or "law": "mohr_coulomb"'
            raise ValueError(
                f"plasticity = {json.dumps(data['plasticity'], default=str)} is no longer a field of a scenario; "
                f"write {instead} instead"
            )
        return data

    @model_validator(mode="after")
    def _can_dilate(self) -> Self:
        if self.dilatancy is None:
            return self
        if not LAWS.named(self.law).dilates:
            able = " or ".join(f'"{law.name}"' for law in LAWS if law.dilates)
            raise ValueError(f'dilatancy is not allowed with the law "{self.law}"; it must be null, or the law {able}')
        constant = getattr(self, "dilatancy_angle_deg", 0.0)
        if constant > 0.0:
            raise ValueError(
                f"dilatancy_angle_deg = {constant:g} is not allowed with dilatancy, which tells the angle; it must be 0"
            )
        return self

    @property
    def solid_partial_density(self) -> float:
        """Mass of solid per volume of the whole, (1 - n) ρ_grain [kg/m³]."""
        return (1.0 - self.porosity) * self.grain_density_kg_per_m3

    @property
    def liquid_partial_density(self) -> float:
        """Mass of liquid per volume of the whole, n ρ_L [kg/m³]; 0 for a dry flow."""
        return 0.0

    @property
    def density(self) -> float:
        """Density of the whole, ρ_m [kg/m³]."""
        return self.solid_partial_density + self.liquid_partial_density

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + ν)) [Pa]."""
        return self.young_modulus_Pa / (2.0 * (1.0 + self.poisson_ratio))

    @property
    def lame_modulus(self) -> float:
        """λ = E ν / ((1 + ν)(1 - 2ν)) [Pa]."""
        nu = self.poisson_ratio
        return self.young_modulus_Pa * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def bulk_modulus(self) -> float:
        """K = λ + 2 G / 3 [Pa]."""
        return self.lame_modulus + 2.0 / 3.0 * self.shear_modulus

    @property
    def oedometric_modulus(self) -> float:
        """E (1 - ν) / ((1 + ν)(1 - 2ν)) [Pa]."""
        nu = self.poisson_ratio
        return self.young_modulus_Pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))


class UndrainedMaterial(Skeleton):
    """A skeleton whose voids are full of liquid that cannot leave them."""

    liquid_density_kg_per_m3: Density
    """Density ρ_L of the liquid."""
    liquid_bulk_modulus_Pa: Positive
    """Bulk modulus K_L of the liquid."""
    cavitation_pressure_Pa: NonNegative = 0.0
    """Largest tension that the liquid bears before it cavitates."""

    @property
    def liquid_partial_density(self) -> float:
        """Mass of liquid per volume of the whole, n ρ_L [kg/m³]."""
        return self.porosity * self.liquid_density_kg_per_m3


class TwoPhaseMaterial(UndrainedMaterial):
    """A saturated skeleton through which the liquid moves by Darcy's law.

    The drag follows from `hydraulic_conductivity_m_per_s`, or from `intrinsic_permeability_m2` and
    `liquid_viscosity_Pa_s`; exactly one of the two ways is given.
    """

    hydraulic_conductivity_m_per_s: Positive | None = None
    """Saturated hydraulic conductivity k_sat, at 9.81 m/s² whatever the scene's gravity."""
    intrinsic_permeability_m2: Positive | None = None
    """Intrinsic permeability κ, in place of the hydraulic conductivity."""
    liquid_viscosity_Pa_s: Positive = 1e-3
    """Dynamic viscosity μ_L. With the conductivity given it only tells the intrinsic permeability."""
    inertial_drag_coefficient: NonNegative = 0.0
    """C_F of the drag that Forchheimer adds to Darcy's, n³ ρ_L C_F |w| w / √κ per volume of mixture, w = v_L - v_S; 0
    is none, 1.75 / √(150 n³) Ergun's for a bed of grains."""
    porosity_update: bool = False
    """True updates the porosity with the skeleton's volume strain; False keeps it, as the paper does (Eq. (A11))."""
    conductivity_law: Literal["constant", "kozeny_carman", "exponential"] = "constant"
    """How the conductivity follows the porosity n, which porosity_update must update: kozeny_carman by n³/(1 - n)²,
    exponential by e^((n - n_0)/conductivity_scale)."""
    conductivity_scale: Annotated[float, Field(ge=0.005, le=1.0)] = 0.04
    """Change of the porosity by which the exponential conductivity changes by a factor of e."""

    @model_validator(mode="after")
    def _one_conductivity(self) -> Self:
        if (self.hydraulic_conductivity_m_per_s is None) == (self.intrinsic_permeability_m2 is None):
            raise ValueError("needs exactly one of hydraulic_conductivity_m_per_s and intrinsic_permeability_m2")
        return self

    @model_validator(mode="after")
    def _porosity_is_followed(self) -> Self:
        if self.conductivity_law != "constant" and not self.porosity_update:
            raise ValueError(
                f'conductivity_law = "{self.conductivity_law}" is not allowed with porosity_update = false; it must be '
                '"constant", or porosity_update true'
            )
        return self

    @property
    def may_be_explicit(self) -> bool:
        """Whether its drag may be integrated explicitly: it is linear in the slip, and stays as it is."""
        return self.inertial_drag_coefficient == 0.0 and self.conductivity_law == "constant"

    @property
    def hydraulic_conductivity(self) -> float:
        """k_sat [m/s] at 9.81 m/s², given or from κ ρ_L g / μ_L."""
        if self.hydraulic_conductivity_m_per_s is not None:
            return self.hydraulic_conductivity_m_per_s
        assert self.intrinsic_permeability_m2 is not None
        weight = self.liquid_density_kg_per_m3 * STANDARD_GRAVITY
        return self.intrinsic_permeability_m2 * weight / self.liquid_viscosity_Pa_s

    @property
    def intrinsic_permeability(self) -> float:
        """κ [m²], given or from k_sat."""
        weight = self.liquid_density_kg_per_m3 * STANDARD_GRAVITY
        return self.hydraulic_conductivity * self.liquid_viscosity_Pa_s / weight


def _of_density(material: Skeleton, density: float) -> Skeleton:
    """The material with the porosity that makes its density [kg/m³], which lies between those of its parts."""
    filling = getattr(material, "liquid_density_kg_per_m3", 0.0)
    grains = material.grain_density_kg_per_m3
    porosity = (grains - density) / (grains - filling)
    if abs(porosity - material.porosity) < 1e-12:
        return material
    return material.model_copy(update={"porosity": porosity})


COMMON = ("porosity_update", "conductivity_law")
"""Fields in which wet materials of one scene do not differ."""


def formulation_of(material: Skeleton) -> Literal["two_phase", "undrained", "dry"]:
    """Formulation of a flow of that material."""
    if isinstance(material, TwoPhaseMaterial):
        return "two_phase"
    return "undrained" if isinstance(material, UndrainedMaterial) else "dry"


class Arriving(NamedTuple):
    """A part of what arrives that is of one material."""

    begin: float
    """Time [s] from which on it passes the section."""
    end: float
    """Until then [s]."""
    density: float
    """Of what passes then, that of which the density of the whole is next to this one [kg/m³]; nan: all of it."""
    own: OtherMaterial
    """What it says of its material."""
    material: Skeleton


def part_at(parts: list[Arriving], time: NDArray[np.float64], density: NDArray[np.float64]) -> NDArray[np.int64]:
    """Place among the parts of what passes at times [N] [s] with densities [N] [kg/m³]."""
    apart = []
    for part in parts:
        beside = np.maximum(np.maximum(part.begin - time, time - part.end), 0.0)
        apart.append(1e12 * beside + (0.0 if math.isnan(part.density) else np.abs(part.density - density)))
    return np.argmin(apart, axis=0)


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
        surges = self._surges(inflow)
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

    def _surges(self, inflow: Inflow) -> list[tuple[float, float, OtherMaterial, Skeleton]]:
        """Begin, end [s], what is said of the material and the material of each surge of an inflow."""
        said: list[OtherMaterial] = [inflow, *inflow.surges]
        begins = [-math.inf, *(surge.from_s for surge in inflow.surges)]
        ends = [*begins[1:], math.inf]
        return [(begin, end, own, self.material_of(own)) for begin, end, own in zip(begins, ends, said, strict=True)]

    @property
    def arriving(self) -> list[Arriving]:
        """What arrives, by material, in the order in which each begins to.

        A density that changes over time is one of the porosity: at equal volume some of the solid gives way to liquid,
        or to air. It is cut into `DENSITY_STEPS` equal steps at most, each with the mean of what passes of it, so that
        the mass is that of the table.
        """
        inflow, found = self.inflow, []
        if inflow is None:
            return []
        times, volumes = inflow.passing
        for begin, end, own, material in self._surges(inflow):
            within = (times >= begin) & (times < end)
            if not within.any():
                continue
            if inflow.densities_kg_per_m3 is None:
                found.append(Arriving(begin, end, math.nan, own, material))
                continue
            density, volume = inflow.density(times[within]), volumes[within]
            least, most = float(density.min()), float(density.max())
            count = DENSITY_STEPS if most - least > 1e-9 * most else 1
            middles = least + (most - least) * (np.arange(count) + 0.5) / count
            steps = np.abs(middles[:, None] - density).argmin(axis=0)
            for step in dict.fromkeys(steps.tolist()):
                mean = float(np.average(density[steps == step], weights=volume[steps == step]))
                found.append(Arriving(begin, end, float(middles[step]), own, _of_density(material, mean)))
        return found

    def arrived_volume(self, mass: float) -> float:
        """Volume [m³/m] of so much mass [kg/m] of what arrives first."""
        parts = self.arriving
        if len(parts) == 1:
            return mass / parts[0].material.density
        volumes, masses = self._arriving_pieces(parts)
        return float(np.interp(mass, np.append(0.0, np.cumsum(masses)), np.append(0.0, np.cumsum(volumes))))

    @property
    def arriving_mass(self) -> float:
        """Mass of all that arrives [kg/m]."""
        return float(self._arriving_pieces(self.arriving)[1].sum()) if self.inflow is not None else 0.0

    def _arriving_pieces(self, parts: list[Arriving]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Volumes [L] [m³/m] and masses [L] [kg/m] of what arrives, one piece after the other."""
        assert self.inflow is not None
        times, volumes = self.inflow.passing
        densities = np.array([part.material.density for part in parts])
        return volumes, volumes * densities[part_at(parts, times, self.inflow.density(times))]

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
        kind = _with_law(_MATERIALS[_FLOWS[formulation]], LAWS.named(law))
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
        kinds: Any = Union[tuple(_with_law(material, law) for law in LAWS)]  # noqa: UP007 - of as many as there are
        set_fields(flow, {"material": (Annotated[kinds, Field(discriminator="law")], ...)})


@cache
def _with_law(material: type[Skeleton], law: Law) -> type[Skeleton]:
    """The material with a law's fields, under a name of its own in this module, so that it can be pickled."""
    default = DEFAULT if law.name == DEFAULT else ...
    name = material.__name__ + "".join(part.capitalize() for part in law.name.split("_"))
    tag: Any = (Literal[law.name], Field(default, description=f"How the skeleton answers a strain: {law.title}."))
    made: Any = create_model(
        name,
        __base__=(material,) if law.Settings is Model else (law.Settings, material),
        __module__=__name__,
        __doc__=f"{material.__doc__} Law: {law.title}.",
        law=tag,
    )
    globals()[name] = made
    return made


offer_laws()
