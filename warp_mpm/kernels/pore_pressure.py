"""Pore pressure from the liquid's volume strain, and the porosity of the skeleton it fills."""

from types import SimpleNamespace

import warp as wp

from .elementary import make_elementary
from .layout import BESIDE_CUT, BESIDE_CUT_SHARE, SURROUNDED

LEAST_POROSITY = 0.01
"""Porosity below which a crushed skeleton's voids are not followed."""


def make_pore_pressure(types: SimpleNamespace) -> SimpleNamespace:
    """Build the functions `pressure`, `porosity`, `resistance` and `filter_share`."""
    F = types.scalar
    Parameters = types.Parameters
    POROSITY = types.effects.porosity_update
    CONDUCTIVITY = types.effects.conductivity
    elementary = make_elementary(types)
    larger = elementary.larger
    exponential = elementary.exponential

    @wp.func
    def pressure(strain: F, parameters: Parameters) -> F:
        """Pressure [Pa], compression positive, at the recorded volume strain [-]; no tension beyond cavitation, from
        where on the strain is the record of a gap."""
        return larger(-parameters.liquid_bulk_modulus * strain, -parameters.cavitation_pressure)

    @wp.func
    def porosity(reference: F, volume: F, parameters: Parameters) -> F:
        """Porosity now: Dn/Dt = n_S div v_S, of which Eq. (A11) keeps only the zero; the grains keep their volume."""
        result = parameters.porosity
        if POROSITY:
            result = larger(F(1.0) - (F(1.0) - parameters.porosity) * reference / volume, F(wp.static(LEAST_POROSITY)))
        return result

    @wp.func
    def resistance(n: F, parameters: Parameters) -> F:
        """1 / permeability at the porosity n, over its value at the start."""
        result = F(1.0)
        if wp.static(CONDUCTIVITY == "kozeny_carman"):
            ratio = parameters.porosity / n
            share = (F(1.0) - n) / (F(1.0) - parameters.porosity)
            result = ratio * ratio * ratio * share * share
        if wp.static(CONDUCTIVITY == "exponential"):
            result = F(exponential(wp.float64((parameters.porosity - n) / parameters.conductivity_scale)))
        return result

    @wp.func
    def filter_share(surrounded: wp.int32) -> F:
        """Share of its residual that `pressure_relaxation` takes from a point."""
        beside = wp.where(surrounded == wp.static(BESIDE_CUT), F(wp.static(BESIDE_CUT_SHARE)), F(0.0))
        return wp.where(surrounded == wp.static(SURROUNDED), F(1.0), beside)

    return SimpleNamespace(pressure=pressure, porosity=porosity, resistance=resistance, filter_share=filter_share)
