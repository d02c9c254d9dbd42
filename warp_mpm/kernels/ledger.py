"""Sums over the material points: masses, momentum, energies and extremes. Only launched when a sample is taken."""

from types import SimpleNamespace

import warp as wp

from .layout import (
    GRID_SHIFT,
    LEDGER_ELASTIC,
    LEDGER_GRAVITATIONAL,
    LEDGER_KINETIC,
    LEDGER_LIQUID_MASS,
    LEDGER_MOMENTUM_X,
    LEDGER_MOMENTUM_Y,
    LEDGER_NOT_FINITE,
    LEDGER_PRESSURE_MAX,
    LEDGER_PRESSURE_MEAN,
    LEDGER_SOLID_MASS,
    LEDGER_SPEED_MAX,
)


def make_ledger(types: SimpleNamespace, pore: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernel `ledger` (over points), which adds to an array emptied before."""
    effects = types.effects
    F = types.scalar
    Points = types.Points
    pressure_at = pore.pressure
    porosity = pore.porosity
    Parameters = types.Parameters
    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    RELAXATION = effects.pressure_relaxation
    BARRIER = effects.barrier != "none"

    @wp.kernel(module=module)
    def ledger(
        points: Points, parameters: Parameters, clock: wp.array(dtype=wp.float64), sums: wp.array(dtype=wp.float64)
    ):
        p = wp.tid()
        if points.inside[p] == 0:
            return
        reference = points.reference_volume[p]
        volume = points.volume[p]
        v = points.velocity[p]
        solid = reference * parameters.solid_density
        speed = v[0] * v[0] + v[1] * v[1]
        kinetic = solid * speed
        mass = solid
        momentum_x = solid * v[0]
        momentum_y = solid * v[1]
        if TWO_PHASE:
            liquid = reference * parameters.liquid_density
            liquid_speed = v[2] * v[2] + v[3] * v[3]
            kinetic += liquid * liquid_speed
            speed = wp.max(speed, liquid_speed)
            mass += liquid
            momentum_x += liquid * v[2]
            momentum_y += liquid * v[3]
            wp.atomic_add(sums, wp.static(LEDGER_LIQUID_MASS), wp.float64(liquid))
        s = points.stress[p]
        trace = s[0] + s[1] + s[2]
        squares = s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + F(2.0) * s[3] * s[3]
        deviatoric = squares - trace * trace / F(3.0)
        elastic = volume * (
            trace * trace / (F(18.0) * parameters.bulk_modulus) + deviatoric / (F(4.0) * parameters.shear_modulus)
        )
        sound = wp.isfinite(squares) and wp.isfinite(volume) and wp.isfinite(speed)
        if LIQUID:
            # Taken before the pressure's own maximum, which passes over what is no number.
            sound = sound and wp.isfinite(points.liquid_strain[p])
            pressure = pressure_at(points.liquid_strain[p], parameters)
            n = porosity(reference, volume, parameters)
            elastic += F(0.5) * volume * n * pressure * pressure / parameters.liquid_bulk_modulus
            wp.atomic_max(sums, wp.static(LEDGER_PRESSURE_MAX), wp.float64(pressure))
            upstream = wp.bool(True)
            if BARRIER:
                upstream = wp.float64(points.position[p][0]) < parameters.crest_end + clock[wp.static(GRID_SHIFT)]
            if upstream:
                if RELAXATION:
                    pressure -= points.pressure_residual[p]
                wp.atomic_max(sums, wp.static(LEDGER_PRESSURE_MEAN), wp.float64(pressure))
        if not sound:
            wp.atomic_add(sums, wp.static(LEDGER_NOT_FINITE), wp.float64(1.0))
        wp.atomic_add(sums, wp.static(LEDGER_KINETIC), wp.float64(F(0.5) * kinetic))
        wp.atomic_add(
            sums,
            wp.static(LEDGER_GRAVITATIONAL),
            -wp.float64(mass * wp.dot(parameters.gravity, points.position[p])),
        )
        wp.atomic_add(sums, wp.static(LEDGER_ELASTIC), wp.float64(elastic))
        wp.atomic_add(sums, wp.static(LEDGER_MOMENTUM_X), wp.float64(momentum_x))
        wp.atomic_add(sums, wp.static(LEDGER_MOMENTUM_Y), wp.float64(momentum_y))
        wp.atomic_add(sums, wp.static(LEDGER_SOLID_MASS), wp.float64(solid))
        wp.atomic_max(sums, wp.static(LEDGER_SPEED_MAX), wp.float64(speed))

    return SimpleNamespace(ledger=ledger)
