"""Bodies as kernels see them: arrays of pieces, surfaces and bodies, and indices between them."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_mpm.effects import Effects

from .outline import TIE

DEEP, RUBS, CUT = 1, 2, 4
"""Bits of the grid's `solid`: a point in the cell may be half a cell deep in a body, or within `RUBBED` cells of one
that rubs; the cell lies within `BESIDE` cells of an outline that cuts cells."""

RUBBED = 3.0
"""Cells from a surface within which points may share a node with it."""

BESIDE = 1.5
"""Cells from an outline that cuts cells within which pore pressures are hardly averaged (`layout.BESIDE_CUT_SHARE`):
those that it cuts and the ones next to them, whose corners they share."""

NEAR = 5.0
"""Cells from a point's column within which it looks at the pieces of a profile: more than `RUBBED` and the cells that a
point may be deep."""

PIECE = 9
"""Numbers of a piece: begin (x, y), along (x, y), low, high, normal (x, y), offset, as in `outline.Segments`."""


def body_fields(effects: Effects, scalar: Any, V2: Any, V4: Any, P: Any) -> dict[str, Any]:
    """Fields of the structure `Bodies` for `effects`: B bodies, S surfaces, G pieces of their outlines."""
    array, array2d = wp.array, wp.array2d
    fields: dict[str, Any] = {"count": wp.int32}
    if effects.bodies:
        fields |= {
            # [B + 1] where the pieces and the surfaces of each body begin.
            "first_piece": array(dtype=wp.int32),
            "first_surface": array(dtype=wp.int32),
            # [B] around the solid, and whatever lies beyond it; nothing of an edge of the domain.
            "box": array(dtype=V4),
            # [B] where a point may come to lie too deep in the body at the end of the step, as seen by the points.
            "ahead": array(dtype=V4),
            "pieces": array(dtype=P),  # [G]
            # [G] offset of those pieces on whose line's one side the whole body lies, far away of the others.
            "hull": array(dtype=scalar),
        }
    if effects.profile:
        fields["profiled"] = wp.int32  # the body whose pieces are found by the column of the grid
        fields["near"] = array2d(dtype=wp.int32)  # [columns, 2] first and last but one of its pieces about the column
    if effects.friction:
        fields["friction"] = array(dtype=scalar)  # [S]
        fields["rubs"] = array(dtype=wp.int32)  # [B] 1: some surface of the body has friction
    if effects.pressure_relaxation and effects.passing:
        fields["cuts"] = array(dtype=wp.int32)  # [B] 1: its outline cuts cells
    if effects.turbulence:
        fields["turbulence"] = array(dtype=scalar)  # [S] shear stress over the square of the slip [kg/m3]
    if effects.moving:
        fields |= {
            "carrier": wp.int32,  # the body with which the grid rides; -1: the grid rests
            "displacement": array(dtype=wp.vec2d),  # [B] since the start [m]
            "velocity": array(dtype=wp.vec2d),  # [B] [m/s]
            "old_velocity": array(dtype=wp.vec2d),  # [B] a step before
            "next": array(dtype=V2),  # [B] displacement at the end of the step [m]
            "impulse": array(dtype=wp.vec2d),  # [B] of the flow on the body since the start [N s/m]
            "work": array(dtype=wp.float64),  # [B] of the flow on the body since the start [J/m]
        }
    if effects.sliding:
        for name in (
            "mass",  # [B] [kg/m]; 0: does not slide
            "weight",  # [B] [N/m]
            "pull",  # [B] gravity's component along the base, times the mass [N/m]
            "base_friction",  # [B] tan delta_b
            "external_force",  # [B] along x [N/m]
            "base_impulse",  # [B] of friction at the base, positive when it acts downstream [N s/m]
            "base_work",  # [B] that friction at the base has taken [J/m]
            "held",  # [B] impulse of friction at the base along x, in the step [N s/m]
            "pressed",  # [B] of the flow along y, in the step [N s/m]
            "guess",  # [B] velocity after the last sweep [m/s]
        ):
            fields[name] = array(dtype=wp.float64)
        fields["pushed"] = array(dtype=wp.vec2d)  # [B] impulse of the flow that the velocity does not know yet [N s/m]
    if effects.driven:
        fields["first_time"] = array(dtype=wp.int32)  # [B + 1] where each body's table begins; empty: not driven
        fields["times"] = array(dtype=wp.float64)
        fields["velocities"] = array(dtype=wp.vec2d)
    return fields


def contact_fields(effects: Effects, scalar: Any, X: Any, V3: Any, W: Any, R: Any) -> dict[str, Any]:
    """Fields of the structure `Contact`: C places of contact of all bodies, first those that stand alone."""
    array = wp.array
    fields: dict[str, Any] = {
        "body": array(dtype=wp.int32),
        "surface": array(dtype=wp.int32),
        "position": array(dtype=X),  # at t = 0 [m]
        "normal": array(dtype=X),
        "fixed": array(dtype=wp.int32),  # 1: the nodes are always the same
        "first": array(dtype=wp.int32),  # lowest of the 3 x 3 (x 3) nodes, counted through; -1: outside the grid
        "weight_x": array(dtype=V3),
        "weight_y": array(dtype=V3),
        # Of all its nodes, and the same over their masses, 0 without mass: in the step, over those that have mass.
        "weight": array(dtype=W),
        "per_mass": array(dtype=W),
        "inverse": array(dtype=scalar),  # sum of N_i^2 / m_i; 0: nothing is there
        "solid": array(dtype=scalar),  # impulses of the step [N s/m]: on the solid along the normal,
        "slot": array(dtype=wp.int32),  # of a barrier (`loads.Slots`); -1: of another body
        "share": array(dtype=wp.float64),  # of the impulse that goes there; the rest goes to the next slot
        "foot": array(dtype=wp.vec2d),  # on the surface at t = 0, from the barrier's toe [m]
        "taken": array(dtype=wp.float64),  # [slots x SLOT_SIZE] sums since t = 0
        "turned": array(dtype=wp.float64),  # [surfaces x 2] sums of F_x y and F_y x of the same [N s]
        "block": array(dtype=wp.int32),  # [groups] of those that stand alone
        "start": array(dtype=wp.int32),  # [groups + 1]
    }
    if effects.dimensions == 3:
        fields["weight_z"] = array(dtype=V3)
    if effects.joined:
        fields |= {
            "colours": wp.int32,  # of joined places; those of one colour share no node
            "colour": array(dtype=wp.int32),  # [colours + 1] where each begins
            # Places of a colour that follow each other are a run, and run by run those far from the flow are left out.
            "runs": array(dtype=wp.int32),  # [colours + 1] the first run of each colour
            "run": array(dtype=wp.int32),  # [runs + 1] where each begins
            "around": array(dtype=wp.vec4i),  # [runs] first and last blocks along x and y that may hold its nodes
            "near": array(dtype=wp.int32),  # [runs] 1: one of them held flow in the last step
            "lanes": wp.int32,  # threads that share the places of a colour
            "abreast": scalar,  # places of one colour on a body that slides, at most
            "last": array(dtype=wp.float64),  # [1] time step of the impulses [s]
            "more": array(dtype=wp.int32),  # [1] 1: another sweep is needed
        }
    if effects.two_phase:
        fields["liquid"] = array(dtype=scalar)  # on the liquid,
    if effects.turbulence:
        fields["length"] = array(dtype=scalar)  # of the surface for which a place stands [m]
    if effects.friction:
        # Neighbours along the piece, or the place itself.
        fields["before"] = array(dtype=wp.int32)
        fields["after"] = array(dtype=wp.int32)
        fields["rubbed"] = array(dtype=R)  # on the solid along the surface,
        if effects.liquid:
            fields["alone"] = array(dtype=scalar)  # on liquid that fills the volume, as it would move alone
    if effects.materials:
        fields["mixed"] = array(dtype=wp.int32)  # 1: other materials than the flow's may be at the nodes
        # Means over the nodes of a place, per mass of the solid, as the parameters of these names.
        if effects.two_phase:
            fields["liquid_ratio"] = array(dtype=scalar)
            fields["liquid_inverse"] = array(dtype=scalar)  # gain of the liquid's velocity per impulse
            fields["drag_per_mass"] = array(dtype=scalar)
        if effects.liquid_alone:
            fields["filling_ratio"] = array(dtype=scalar)
            fields["filling_inverse"] = array(dtype=scalar)
    return fields


def make_body_functions(types: SimpleNamespace, elementary: SimpleNamespace) -> SimpleNamespace:
    """Build the functions `nearest`, `normal_of`, `travel`, `displaced`, `in_box`, `in_hull`, `look_ahead`, `about`,
    `set_back`.

    Each array that a kernel might look at costs it a load per thread, whether or not it does: kernels over points name
    few of them, and by `read`.
    """
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V4 = types.V4
    P = types.P
    Bodies, Grid = types.Bodies, types.Grid
    read = elementary.read
    MOVING = effects.moving
    PROFILE = effects.profile
    SAME = TIE if effects.precision == "float64" else 1e-6

    pieces_of = wp.array(dtype=P)
    numbers = wp.array(dtype=F)
    marks = wp.array(dtype=wp.int32)

    @wp.func
    def normal_of(piece: P) -> V2:
        return V2(piece[6], piece[7])

    @wp.func
    def nearest(pieces: pieces_of, first: wp.int32, last: wp.int32, place: V2):
        """Signed distance, outward normal and nearest piece, as `outline.Segments.nearest`."""
        best = F(1.0e30)
        facing = F(0.0)
        over = F(0.0)
        found = first
        for k in range(first, last):
            piece = read(pieces, k)
            across = wp.abs(wp.dot(normal_of(piece), place) - piece[8])
            t = wp.dot(place - V2(piece[0], piece[1]), V2(piece[2], piece[3]))
            beyond = wp.max(wp.max(piece[4] - t, t - piece[5]), F(0.0))
            distance = across
            if beyond > F(0.0):
                distance = wp.sqrt(across * across + beyond * beyond)
            better = distance < best
            if beyond + over > F(0.0):
                if wp.abs(distance - best) <= F(wp.static(SAME)) * distance:
                    better = across > facing
            if better:
                best = distance
                facing = across
                over = beyond
                found = k
        one = read(pieces, found)
        direction = normal_of(one)
        distance = wp.dot(direction, place) - one[8]
        if over > F(0.0):
            distance = wp.where(distance < F(0.0), -best, best)
            begin = V2(one[0], one[1])
            along = V2(one[2], one[3])
            t = wp.clamp(wp.dot(place - begin, along), one[4], one[5])
            if distance != F(0.0):
                direction = (place - begin - t * along) / distance
        return distance, direction, found

    @wp.func
    def travel(bodies: Bodies, body: wp.int32, time_step: F) -> V2:
        """How far a body moves in the step [m]."""
        result = V2()
        if MOVING:
            new = bodies.velocity[body]
            old = bodies.old_velocity[body]
            result = time_step * (F(0.5) * V2(F(new[0]) + F(old[0]), F(new[1]) + F(old[1])))
        return result

    @wp.func
    def displaced(bodies: Bodies, body: wp.int32) -> V2:
        """How far a body has moved [m]."""
        result = V2()
        if MOVING:
            d = bodies.displacement[body]
            result = V2(F(d[0]), F(d[1]))
        return result

    @wp.func
    def in_box(box: V4, place: V2) -> wp.bool:
        return place[0] > box[0] and place[0] < box[1] and place[1] > box[2] and place[1] < box[3]

    @wp.func
    def in_hull(pieces: pieces_of, hull: numbers, first: wp.int32, last: wp.int32, place: V2, margin: F) -> wp.bool:
        """Whether `place` lies within `margin` [m] of the hull of an outline."""
        for k in range(first, last):
            if wp.dot(normal_of(read(pieces, k)), place) - read(hull, k) >= margin:
                return False
        return True

    @wp.func
    def look_ahead(bodies: Bodies, grid: Grid, body: wp.int32, depth: F, time_step: F):
        """Note where a body whose velocity in this step is known will be, and the grid if it rides with it."""
        moved = displaced(bodies, body) + travel(bodies, body, time_step)
        box = bodies.box[body]
        bodies.next[body] = moved
        if body == bodies.carrier:
            middle = wp.float64(0.5) * (bodies.velocity[body][0] + bodies.old_velocity[body][0])
            grid.shift[1] = grid.shift[0] + wp.float64(time_step) * middle
        bodies.ahead[body] = V4(
            box[0] - depth + moved[0], box[1] + depth + moved[0], box[2] - depth + moved[1], box[3] + depth + moved[1]
        )

    @wp.func
    def about(bodies: Bodies, body: wp.int32, column: wp.int32, columns: wp.int32):
        """First and last but one of a body's pieces that a point in the column looks at."""
        first = read(bodies.first_piece, body)
        last = read(bodies.first_piece, body + 1)
        if PROFILE:
            if body == bodies.profiled:
                at = wp.clamp(column, 0, columns - 1)
                first = bodies.near[at, 0]
                last = bodies.near[at, 1]
        return first, last

    @wp.func
    def near_some(bodies: Bodies, which: marks, place: V2, column: wp.int32, columns: wp.int32, reach: F) -> wp.bool:
        """Whether `place` lies within `reach` [m] of any of the bodies that are marked, of whose outlines it is the
        hull that counts, but of a profile."""
        for body in range(bodies.count):
            if read(which, body) == 1:
                seen = place - displaced(bodies, body)
                first, last = about(bodies, body, column, columns)
                if PROFILE:
                    # In a valley no piece alone tells that a place is far away.
                    distance, _direction, _piece = nearest(bodies.pieces, first, last, seen)
                    if distance < reach:
                        return True
                elif in_hull(bodies.pieces, bodies.hull, first, last, seen, reach):
                    return True
        return False

    @wp.func
    def set_back(pieces: pieces_of, first: wp.int32, last: wp.int32, seen: V2, depth: F) -> V2:
        """How a point is moved [m] that may lie `-depth` [m] deep in a body at most and is `seen` from it."""
        distance, direction, _piece = nearest(pieces, first, last, seen)
        return wp.max(depth - distance, F(0.0)) * direction

    return SimpleNamespace(
        about=about,
        nearest=nearest,
        normal_of=normal_of,
        travel=travel,
        displaced=displaced,
        in_box=in_box,
        in_hull=in_hull,
        look_ahead=look_ahead,
        set_back=set_back,
        near_some=near_some,
    )
