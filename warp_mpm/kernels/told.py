"""What nodes know of the materials around them, per mass of the solid: constants of the scene where there is one."""

from types import SimpleNamespace

import warp as wp


def next_to_nil(types: SimpleNamespace) -> float:
    """Share below which a difference of two sums is their rounding."""
    return 1e-13 if types.effects.precision == "float64" else 1e-6


def make_told(types: SimpleNamespace) -> SimpleNamespace:
    """Build `ratio_of_liquid`, `drag_per_mass`, `drag_beyond_per_mass` and `ratio_of_filling` (told: M, parameters), of
    what was told to a node over the mass there; `parameters` are those of the flow's material."""
    F, M, Parameters = types.scalar, types.M, types.Parameters
    # With a porosity that changes no point's drag is a constant, and all of them tell it.
    POROSITY = types.effects.porosity_update
    LIQUID, DRAG, BEYOND, FILLING = (types.told.get(name, 0) for name in ("liquid", "drag", "drag_beyond", "filling"))
    NEXT_TO_NIL = next_to_nil(types)

    @wp.func
    def ratio_of_liquid(told: M, parameters: Parameters) -> F:
        """Mass of liquid; nil where it is but rounding."""
        ratio = parameters.liquid_ratio + told[wp.static(LIQUID)]
        return wp.where(ratio > F(wp.static(NEXT_TO_NIL)) * parameters.liquid_ratio, ratio, F(0.0))

    @wp.func
    def drag_per_mass(told: M, parameters: Parameters) -> F:
        """Q, times volume [1/s]."""
        result = told[wp.static(DRAG)]
        if not POROSITY:
            result += parameters.drag_per_mass
        return wp.max(result, F(0.0))

    @wp.func
    def drag_beyond_per_mass(told: M, parameters: Parameters) -> F:
        """The same of the drag with the square of the slip [1/m]."""
        result = told[wp.static(BEYOND)]
        if not POROSITY:
            result += parameters.inertial_drag_per_mass
        return wp.max(result, F(0.0))

    @wp.func
    def ratio_of_filling(told: M, parameters: Parameters) -> F:
        """Mass of liquid that would fill the whole volume."""
        return wp.max(parameters.filling_ratio + told[wp.static(FILLING)], F(0.0))

    return SimpleNamespace(
        ratio_of_liquid=ratio_of_liquid,
        drag_per_mass=drag_per_mass,
        drag_beyond_per_mass=drag_beyond_per_mass,
        ratio_of_filling=ratio_of_filling,
    )
