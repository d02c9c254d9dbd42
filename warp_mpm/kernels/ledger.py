"""Sums over the material points: masses, momentum, energies and extremes. Only launched when a sample is taken."""

from types import SimpleNamespace

import warp as wp

from .elementary import make_elementary
from .layout import (
    INSIDE,
    LEDGER_ELASTIC,
    LEDGER_GRAVITATIONAL,
    LEDGER_KINETIC,
    LEDGER_LIQUID_MASS,
    LEDGER_MOMENTUM_X,
    LEDGER_MOMENTUM_Y,
    LEDGER_MOMENTUM_Z,
    LEDGER_NOT_FINITE,
    LEDGER_PRESSURE_MAX,
    LEDGER_PRESSURE_MEAN,
    LEDGER_SOLID_MASS,
    LEDGER_SPEED_MAX,
)


def make_ledger(
    types: SimpleNamespace, vectors: SimpleNamespace, pore: SimpleNamespace, module: str
) -> SimpleNamespace:
    """Build the kernel `ledger` (over workers that share the points), which adds to an array emptied before."""
    effects = types.effects
    F = types.scalar
    Points = types.Points
    pressure_at = pore.pressure
    porosity = pore.porosity
    Parameters = types.Parameters
    elementary = make_elementary(types)
    read, larger = elementary.read, elementary.larger
    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    stored_in_skeleton = types.law.stored
    RELAXATION = effects.pressure_relaxation
    BODIES = effects.bodies
    MOVING = effects.moving
    Bodies = types.Bodies
    Book = types.Book
    X64 = types.X64
    solid_of, liquid_of, squares, wide = vectors.solid_of, vectors.liquid_of, vectors.squares, vectors.wide
    SPATIAL = types.dimensions == 3

    one = wp.constant(wp.float64(1.0))

    @wp.func
    def work_of_exponential(x: wp.float64):
        """exp(x) - 1 - x, of second order: near 0 the difference loses all digits, so there by its series."""
        result = wp.float64(0.0)
        if wp.abs(x) < wp.float64(0.01):
            result = x * (wp.float64(wp.static(1.0 / 120.0)) + x * wp.float64(wp.static(1.0 / 720.0)))
            result = x * (wp.float64(wp.static(1.0 / 6.0)) + x * (wp.float64(wp.static(1.0 / 24.0)) + result))
            result = (wp.float64(0.5) + result) * x * x
        else:
            result = wp.exp(x) - one - x
        return result

    @wp.func
    def stored_in_liquid(
        strain: wp.float64, n: wp.float64, volume: wp.float64, grains: wp.float64, modulus: wp.float64
    ):
        """Energy [J/m] of a pore pressure p = -(K_L / n) ln(V / V_0): V (K_L / n) (exp e - 1 - e), e = n p / K_L."""
        stiffness = modulus / n
        result = volume * stiffness * work_of_exponential(strain)
        if volume < grains:
            closed = strain + wp.log(volume / grains)
            result = grains * stiffness * work_of_exponential(closed)
            result += grains * stiffness * wp.float64(0.5) * (strain * strain - closed * closed)
        return result

    @wp.kernel(module=module)
    def ledger(points: Points, parameters: Parameters, bodies: Bodies, book: Book):
        solid_mass = wp.float64(0.0)
        liquid_mass = wp.float64(0.0)
        kinetic_energy = wp.float64(0.0)
        gravitational_energy = wp.float64(0.0)
        elastic_energy = wp.float64(0.0)
        momentum = X64()
        speed_max = wp.float64(0.0)
        pressure_max = wp.float64(0.0)
        pressure_mean = wp.float64(0.0)
        not_finite = wp.float64(0.0)
        if LIQUID:
            if BODIES:
                crest_end = parameters.crest_end
                if MOVING:
                    crest_end += bodies.displacement[parameters.crest_body][0]
            per_liquid_modulus = one / wp.float64(parameters.liquid_bulk_modulus)
        # Each thread sums for itself and adds to the common sums once.
        p = wp.tid()
        while p < points.inside.shape[0]:
            if read(points.inside, p) == wp.static(INSIDE):
                reference = read(points.reference_volume, p)
                volume = read(points.volume, p)
                v = read(points.velocity, p)
                solid = reference * parameters.solid_density
                of_solid = solid_of(v)
                speed = wp.dot(of_solid, of_solid)
                kinetic = solid * speed
                mass = solid
                along = solid * of_solid
                if TWO_PHASE:
                    liquid = reference * parameters.liquid_density
                    of_liquid = liquid_of(v)
                    liquid_speed = wp.dot(of_liquid, of_liquid)
                    kinetic += liquid * liquid_speed
                    speed = larger(speed, liquid_speed)
                    mass += liquid
                    along += liquid * of_liquid
                    liquid_mass += wp.float64(liquid)
                s = read(points.stress, p)
                grains = parameters.grain_share * reference
                elastic_energy += stored_in_skeleton(s, volume, grains, parameters)
                # Not negative, any of them, so that what is not finite in one shows in the sum.
                sound = squares(s) + volume + kinetic
                if LIQUID:
                    # Taken before the pressure's own maximum, which passes over what is no number.
                    sound += wp.abs(read(points.liquid_strain, p))
                    pressure = pressure_at(read(points.liquid_strain, p), parameters)
                    n = porosity(reference, volume, parameters)
                    elastic_energy += stored_in_liquid(
                        wp.float64(n) * wp.float64(pressure) * per_liquid_modulus,
                        wp.float64(n),
                        wp.float64(volume),
                        wp.float64(grains),
                        wp.float64(parameters.liquid_bulk_modulus),
                    )
                    pressure_max = larger(pressure_max, wp.float64(pressure))
                    upstream = wp.bool(True)
                    if BODIES:
                        upstream = wp.float64(read(points.position, p)[0]) < crest_end
                    if upstream:
                        if RELAXATION:
                            pressure -= read(points.pressure_residual, p)
                        pressure_mean = larger(pressure_mean, wp.float64(pressure))
                if not wp.isfinite(sound):
                    not_finite += wp.float64(1.0)
                kinetic_energy += wp.float64(F(0.5) * kinetic)
                gravitational_energy -= wp.float64(mass * wp.dot(parameters.gravity, read(points.position, p)))
                momentum += wide(along)
                solid_mass += wp.float64(solid)
                speed_max = larger(speed_max, wp.float64(speed))
            p += parameters.workers
        wp.atomic_add(book.sums, wp.static(LEDGER_SOLID_MASS), solid_mass)
        wp.atomic_add(book.sums, wp.static(LEDGER_KINETIC), kinetic_energy)
        wp.atomic_add(book.sums, wp.static(LEDGER_GRAVITATIONAL), gravitational_energy)
        wp.atomic_add(book.sums, wp.static(LEDGER_ELASTIC), elastic_energy)
        wp.atomic_add(book.sums, wp.static(LEDGER_MOMENTUM_X), momentum[0])
        wp.atomic_add(book.sums, wp.static(LEDGER_MOMENTUM_Y), momentum[1])
        if SPATIAL:
            wp.atomic_add(book.sums, wp.static(LEDGER_MOMENTUM_Z), momentum[2])
        wp.atomic_max(book.sums, wp.static(LEDGER_SPEED_MAX), speed_max)
        wp.atomic_add(book.sums, wp.static(LEDGER_NOT_FINITE), not_finite)
        if TWO_PHASE:
            wp.atomic_add(book.sums, wp.static(LEDGER_LIQUID_MASS), liquid_mass)
        if LIQUID:
            wp.atomic_max(book.sums, wp.static(LEDGER_PRESSURE_MAX), pressure_max)
            wp.atomic_max(book.sums, wp.static(LEDGER_PRESSURE_MEAN), pressure_mean)

    return SimpleNamespace(ledger=ledger)
