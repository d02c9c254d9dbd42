"""What a body of the scene has otherwise than the flow."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from warp_mpm.schema import Model


class OtherMaterial(Model):
    """The fields of a body that may be of another material than the flow's."""

    lateral_stress_coefficient: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    """K0 of its initial stress, which is geostatic, with the liquid hydrostatic; null: that of the flow, or of the law
    where it has a `material`."""
    formulation: Literal["two_phase", "undrained", "dry"] | None = None
    """Whether its voids hold liquid, and whether that moves on its own; null: as in the flow. All that is wet in a
    scene has one formulation."""
    material: dict[str, Any] | None = None
    """What its material has otherwise than flow.material, any of the fields of one of its law and formulation: `law`
    with the fields of that law, densities, porosity, moduli, conductivity; null: nothing."""

    @property
    def other(self) -> bool:
        """Whether it says anything of its material."""
        return self.material is not None or self.formulation is not None
