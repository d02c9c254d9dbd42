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

    one = wp.constant(wp.float64(1.0))

    @wp.func
    def stored_in_skeleton(pressure: wp.float64, volume: wp.float64, grains: wp.float64, modulus: wp.float64):
        """Energy [J/m] of a mean stress. The rate of Eq. (A3) makes it p = K (V_0 / V - 1), so the work done on the
        way there is V ((K + p) ln(1 + p / K) - p), and p^2 / 2 K per volume only while p is far below K. Beyond
        closed voids the volume that works is that of the grains."""
        stretch = wp.max(one + pressure / modulus, wp.float64(1.0e-6))
        result = volume * (modulus * stretch * wp.log(stretch) - pressure)
        if volume < grains:
            # At closure V_0 / V was less by the ratio of the volumes.
            closed = stretch * volume / grains
            result = grains * modulus * (closed * wp.log(closed) - closed + one)
            result += grains * modulus * (stretch - closed - wp.log(stretch / closed))
        return result

    @wp.func
    def stored_in_liquid(
        pressure: wp.float64, n: wp.float64, volume: wp.float64, grains: wp.float64, modulus: wp.float64
    ):
        """Energy [J/m] of a pore pressure p = -(K_L / n) ln(V / V_0): V (K_L / n) (exp e - 1 - e), e = n p / K_L."""
        strain = n * pressure / modulus
        stiffness = modulus / n
        result = volume * stiffness * (wp.exp(strain) - one - strain)
        if volume < grains:
            closed = strain + wp.log(volume / grains)
            result = grains * stiffness * (wp.exp(closed) - one - closed)
            result += grains * stiffness * wp.float64(0.5) * (strain * strain - closed * closed)
        return result

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
        grains = parameters.grain_share * reference
        mean = wp.float64(-trace / F(3.0))
        # Shear stress s at the volume V was s V / V_0 before the volume changed, which does no work on it.
        stretch = wp.max(one + mean / wp.float64(parameters.bulk_modulus), wp.float64(1.0e-6))
        elastic = wp.float64(volume * deviatoric / (F(4.0) * parameters.shear_modulus)) / stretch
        # In double precision always: the work is a small difference of the terms.
        elastic += stored_in_skeleton(mean, wp.float64(volume), wp.float64(grains), wp.float64(parameters.bulk_modulus))
        sound = wp.isfinite(squares) and wp.isfinite(volume) and wp.isfinite(speed)
        if LIQUID:
            # Taken before the pressure's own maximum, which passes over what is no number.
            sound = sound and wp.isfinite(points.liquid_strain[p])
            pressure = pressure_at(points.liquid_strain[p], parameters)
            n = porosity(reference, volume, parameters)
            elastic += stored_in_liquid(
                wp.float64(pressure),
                wp.float64(n),
                wp.float64(volume),
                wp.float64(grains),
                wp.float64(parameters.liquid_bulk_modulus),
            )
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
        wp.atomic_add(sums, wp.static(LEDGER_ELASTIC), elastic)
        wp.atomic_add(sums, wp.static(LEDGER_MOMENTUM_X), wp.float64(momentum_x))
        wp.atomic_add(sums, wp.static(LEDGER_MOMENTUM_Y), wp.float64(momentum_y))
        wp.atomic_add(sums, wp.static(LEDGER_SOLID_MASS), wp.float64(solid))
        wp.atomic_max(sums, wp.static(LEDGER_SPEED_MAX), wp.float64(speed))

    return SimpleNamespace(ledger=ledger)
