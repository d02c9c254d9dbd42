"""Materials of a flow: grains and their skeleton, the liquid in its voids, and the fields of their law."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

from __future__ import annotations

import json
from functools import cache
from typing import Annotated, Any, Literal, Self

from pydantic import Field, create_model, model_validator

from warp_mpm.scenario.settings import STANDARD_GRAVITY
from warp_mpm.schema import Density, Model, NonNegative, Positive
from warp_mpm.simulator.laws import DEFAULT, LAWS, Law
from warp_mpm.simulator.laws.dilatancy import Dilatancy


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


def formulation_of(material: Skeleton) -> Literal["two_phase", "undrained", "dry"]:
    """Formulation of a flow of that material."""
    if isinstance(material, TwoPhaseMaterial):
        return "two_phase"
    return "undrained" if isinstance(material, UndrainedMaterial) else "dry"


def of_density(material: Skeleton, density: float) -> Skeleton:
    """The material with the porosity that makes its density [kg/m³], which lies between those of its parts."""
    filling = getattr(material, "liquid_density_kg_per_m3", 0.0)
    grains = material.grain_density_kg_per_m3
    porosity = (grains - density) / (grains - filling)
    if abs(porosity - material.porosity) < 1e-12:
        return material
    return material.model_copy(update={"porosity": porosity})


@cache
def with_law(material: type[Skeleton], law: Law) -> type[Skeleton]:
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
