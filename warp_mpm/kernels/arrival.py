"""A flow that arrives at a section: how far it has come, and its points on their last cells before the section."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from .elementary import make_elementary
from .layout import (
    CONVEYED_BEFORE,
    CONVEYED_INTERVAL,
    CONVEYED_SPEED,
    CONVEYED_SPEED_BEFORE,
    CONVEYED_STRETCH,
    CONVEYED_STRETCH_BEFORE,
    CONVEYED_WAY,
    FLOW_ARRIVING,
    FLOW_END,
    FLOW_STEP,
    HELD,
    INFLOW_ENERGY,
    INFLOW_LIQUID_MASS,
    INFLOW_MOMENTUM_X,
    INFLOW_MOMENTUM_Y,
    INFLOW_SOLID_MASS,
    INITIAL_MASS_LIQUID,
    INITIAL_MASS_SOLID,
    INSIDE,
    SPEED_MAX,
    TIME,
    TIME_STEP,
    WAITING,
)


def make_conveyor(types: SimpleNamespace, module: str) -> Any:
    """Build the kernel `convey` (one thread)."""
    Arrival, Book = types.Arrival, types.Book

    @wp.kernel(module=module)
    def convey(arrival: Arrival, book: Book):
        """How far what arrives has come at the end of the step, and how fast it is then."""
        time = book.clock[wp.static(TIME)] + book.clock[wp.static(TIME_STEP)]
        last = arrival.times.shape[0] - 1
        k = wp.int32(arrival.conveyed[wp.static(CONVEYED_INTERVAL)])
        while k + 1 < last and time > arrival.times[k + 1]:
            k += 1
        way = wp.float64(0.0)
        speed = wp.float64(0.0)
        stretch = wp.float64(0.0)
        if time >= arrival.times[last]:
            way = arrival.ways[last]
        elif time > arrival.times[0]:
            passed = time - arrival.times[k]
            first = arrival.velocities[k]
            gain = (arrival.velocities[k + 1] - first) / (arrival.times[k + 1] - arrival.times[k])
            way = arrival.ways[k] + (first + wp.float64(0.5) * gain * passed) * passed
            speed = first + gain * passed
            share = passed / (arrival.times[k + 1] - arrival.times[k])
            stretch = arrival.stretches[k] + share * (arrival.stretches[k + 1] - arrival.stretches[k])
        arrival.conveyed[wp.static(CONVEYED_BEFORE)] = arrival.conveyed[wp.static(CONVEYED_WAY)]
        arrival.conveyed[wp.static(CONVEYED_SPEED_BEFORE)] = arrival.conveyed[wp.static(CONVEYED_SPEED)]
        arrival.conveyed[wp.static(CONVEYED_STRETCH_BEFORE)] = arrival.conveyed[wp.static(CONVEYED_STRETCH)]
        arrival.conveyed[wp.static(CONVEYED_STRETCH)] = stretch
        arrival.conveyed[wp.static(CONVEYED_WAY)] = way
        arrival.conveyed[wp.static(CONVEYED_SPEED)] = speed
        arrival.conveyed[wp.static(CONVEYED_INTERVAL)] = wp.float64(k)
        if time < arrival.times[last]:
            fastest = arrival.fastest * arrival.fastest
            book.clock[wp.static(SPEED_MAX)] = wp.max(book.clock[wp.static(SPEED_MAX)], fastest)

    return convey


def make_arrival(
    types: SimpleNamespace, vectors: SimpleNamespace, pore: SimpleNamespace, rest: Any, module: str
) -> Any:
    """Build the kernel `hold` (over points).

    What arrives rides on a conveyor: drawn upstream of the section as it will pass there, it moves at the velocity that
    the table gives for the time. In its last cells, the approach, a point is seen by the nodes; whatever velocity they
    give it is taken from it again, with the stress that it began with. So the section has a full neighbourhood
    upstream, which pushes as the flow that arrives would. At the section the point is let go.

    Args:
        types: of the kernels.
        vectors: functions that take vectors apart.
        pore: functions of the pore pressure.
        rest: function of a point that makes it one at rest to `update`.
        module: name of the Warp module.
    """
    effects = types.effects
    F, V2, S = types.scalar, types.V2, types.S
    Points, Grid, Parameters, Arrival, Book = types.Points, types.Grid, types.Parameters, types.Arrival, types.Book
    elementary = make_elementary(types)
    read, write = elementary.read, elementary.write
    TWO_PHASE = effects.two_phase
    RELAXATION = effects.pressure_relaxation
    halt, pressure_at, of_phases = types.scheme.halt, pore.pressure, vectors.of_phases

    @wp.func
    def prescribed(x: wp.float64, y: wp.float64, speed: wp.float64, stretch: wp.float64, arrival: Arrival) -> V2:
        """Velocity at a place of the approach: along the ground; what differs along x leaves upward, or is fed from
        above."""
        way = x - arrival.section
        along = speed + stretch * way
        return V2(F(along), F(arrival.slope * along - stretch * (y - (arrival.base + arrival.slope * way))))

    @wp.func
    def push(
        points: Points, p: wp.int32, x: V2, pace: wp.float64, parameters: Parameters, arrival: Arrival, dt: wp.float64
    ):
        """Give to the flow what the nodes gave to a point that is held, but for gravity's share."""
        half = wp.float64(0.5)
        g = dt * wp.vec2d(wp.float64(parameters.gravity[0]), wp.float64(parameters.gravity[1]))
        speed = pace * arrival.conveyed[wp.static(CONVEYED_SPEED_BEFORE)]
        stretch = arrival.conveyed[wp.static(CONVEYED_STRETCH_BEFORE)]
        before = prescribed(wp.float64(x[0]), wp.float64(x[1]), speed, stretch, arrival)
        held = wp.vec2d(wp.float64(before[0]), wp.float64(before[1]))
        v = read(points.velocity, p)
        given = wp.vec2d(wp.float64(v[0]), wp.float64(v[1]))
        reference = wp.float64(read(points.reference_volume, p))
        impulse = reference * wp.float64(parameters.solid_density) * (given - held - g)
        work = half * wp.dot(impulse, given + held)
        if TWO_PHASE:
            given = wp.vec2d(wp.float64(v[2]), wp.float64(v[3]))
            of_liquid = reference * wp.float64(parameters.liquid_density) * (given - held - g)
            work += half * wp.dot(of_liquid, given + held)
            impulse += of_liquid
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_MOMENTUM_X), -impulse[0])
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_MOMENTUM_Y), -impulse[1])
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_ENERGY), -work)

    @wp.func
    def let_go(points: Points, p: wp.int32, x: V2, v: V2, parameters: Parameters, arrival: Arrival, book: Book):
        """Hand a point over to the flow, and keep account of what it brings."""
        points.inside[p] = wp.static(INSIDE)
        reference = read(points.reference_volume, p)
        solid = wp.float64(reference * parameters.solid_density)
        total = solid
        if TWO_PHASE:
            liquid = wp.float64(reference * parameters.liquid_density)
            total += liquid
            wp.atomic_add(book.balance, wp.static(INITIAL_MASS_LIQUID), liquid)
            wp.atomic_add(arrival.inflow, wp.static(INFLOW_LIQUID_MASS), liquid)
        wp.atomic_add(book.balance, wp.static(INITIAL_MASS_SOLID), solid)
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_SOLID_MASS), solid)
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_MOMENTUM_X), total * wp.float64(v[0]))
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_MOMENTUM_Y), total * wp.float64(v[1]))
        energy = wp.float64(F(0.5) * wp.dot(v, v) - wp.dot(parameters.gravity, x))
        wp.atomic_add(arrival.inflow, wp.static(INFLOW_ENERGY), total * energy)

    @wp.func
    def convoy(
        p: wp.int32,
        state: wp.int32,
        points: Points,
        grid: Grid,
        parameters: Parameters,
        arrival: Arrival,
        book: Book,
    ):
        """Move the points that approach as the conveyor does; those whose time has come begin to, or are let go."""
        pace = wp.float64(read(points.pace, p))
        x = read(points.position, p)
        way = arrival.conveyed[wp.static(CONVEYED_WAY)]
        at = wp.float64(x[0]) + pace * way
        # Points that wait are kept at the height that they have at the section.
        high = wp.float64(x[1])
        if state == wp.static(HELD):
            at -= pace * arrival.conveyed[wp.static(CONVEYED_BEFORE)]
            high -= arrival.slope * (wp.float64(x[0]) - arrival.section)
            push(points, p, x, pace, parameters, arrival, book.clock[wp.static(TIME_STEP)])
        elif at < arrival.entry:
            return
        place = V2(F(at), F(high + arrival.slope * (at - arrival.section)))
        margin = F(2.0)
        sx = (place[0] - parameters.left - F(grid.shift[1])) * parameters.inverse_spacing
        sy = (place[1] - parameters.bottom) * parameters.inverse_spacing
        if not (
            sx >= margin and sx < F(parameters.columns) - margin and sy >= margin and sy < F(parameters.rows) - margin
        ):
            # A grid that rides with the barrier may have left it behind: it comes when the conveyor has caught up.
            write(points.position, p, V2(F(at - pace * way), F(high)))
            points.inside[p] = wp.static(WAITING)
            rest(points, p)
            return
        speed = pace * arrival.conveyed[wp.static(CONVEYED_SPEED)]
        stretch = arrival.conveyed[wp.static(CONVEYED_STRETCH)]
        v = prescribed(wp.float64(place[0]), wp.float64(place[1]), speed, stretch, arrival)
        write(points.velocity, p, of_phases(v, v))
        write(points.position, p, place)
        rest(points, p)
        if RELAXATION:
            # As smooth as can be: else its own pressure would count as noise.
            smooth = S()
            smooth[2] = pressure_at(read(points.liquid_strain, p), parameters)
            write(points.smooth, p, smooth)
        halt(points, p)
        points.inside[p] = wp.static(HELD)
        if at >= arrival.section:
            let_go(points, p, place, v, parameters, arrival, book)

    @wp.kernel(module=module)
    def hold(points: Points, grid: Grid, parameters: Parameters, arrival: Arrival, book: Book):
        begin = book.flow[wp.static(FLOW_ARRIVING)] + wp.tid()
        for p in range(begin, book.flow[wp.static(FLOW_END)], book.flow[wp.static(FLOW_STEP)]):
            state = read(points.inside, p)
            if state == wp.static(WAITING) or state == wp.static(HELD):
                convoy(p, state, points, grid, parameters, arrival, book)

    return hold
