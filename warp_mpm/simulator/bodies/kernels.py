"""Bodies as kernels see them: arrays of pieces, surfaces and bodies, and indices between them."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_mpm.effects import Effects

from .outline import TIE

DEEP, RUBS = 1, 2
"""Bits of the grid's `solid`: a point in the cell may be half a cell deep in a body, or within `RUBBED` cells of one
that rubs."""

RUBBED = 3.0
"""Cells from a surface within which points may share a node with it."""

PIECE = 9
"""Numbers of a piece: begin (x, y), along (x, y), low, high, normal (x, y), offset, as in `outline.Segments`."""


def body_fields(effects: Effects, scalar: Any, V2: Any, V4: Any, P: Any) -> dict[str, Any]:
    """Fields of the structure `Bodies` for `effects`: B bodies, S surfaces, G pieces of their outlines."""
    array = wp.array
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
    if effects.friction:
        fields["friction"] = array(dtype=scalar)  # [S]
        fields["rubs"] = array(dtype=wp.int32)  # [B] 1: some surface of the body has friction
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
        ):
            fields[name] = array(dtype=wp.float64)
    if effects.driven:
        fields["first_time"] = array(dtype=wp.int32)  # [B + 1] where each body's table begins; empty: not driven
        fields["times"] = array(dtype=wp.float64)
        fields["velocities"] = array(dtype=wp.vec2d)
    return fields


def contact_fields(effects: Effects, scalar: Any, V2: Any, V: Any, P: Any) -> dict[str, Any]:
    """Fields of the structure `Contact`, one per body: its C places of contact, in groups that share a block."""
    array = wp.array
    fields: dict[str, Any] = {
        "body": wp.int32,
        "node": array(dtype=wp.vec2i),
        "mirror": array(dtype=wp.vec2i),  # (-1, -1): none
        "normal": array(dtype=V2),
        "surface": array(dtype=wp.int32),  # -1: nothing acts here
        "block": array(dtype=wp.int32),  # [groups]; -1: not in one block
        "start": array(dtype=wp.int32),  # [groups + 1]
    }
    if effects.sliding:
        # Gathered each step, for the body's equation of motion.
        fields["pair"] = array(dtype=wp.int32)  # 1: acts with its mirror image
        fields["mass"] = array(dtype=scalar)
        fields["velocity"] = array(dtype=V)
        if effects.friction and effects.liquid:
            fields["liquid_free"] = array(dtype=V2)  # what the liquid would do alone, for the effective normal force
    if effects.passing:
        # Of the outline behind whose pieces nodes act, and its window of nodes, by which the places are found anew.
        fields |= {
            "pieces": array(dtype=P),
            "crest": array(dtype=scalar),
            "surfaces": array(dtype=wp.int32),
            "corner": V2,
            "columns": wp.int32,
            "rows": wp.int32,
            "depth": scalar,
            "edge": wp.int32,
        }
    return fields


def make_body_functions(types: SimpleNamespace, elementary: SimpleNamespace) -> SimpleNamespace:
    """Build the functions `nearest`, `normal_of`, `travel`, `displaced`, `in_box`, `in_hull`, `look_ahead`, `set_back`.

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
    SAME = TIE if effects.precision == "float64" else 1e-6

    pieces_of = wp.array(dtype=P)
    numbers = wp.array(dtype=F)

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
    def set_back(pieces: pieces_of, first: wp.int32, last: wp.int32, seen: V2, depth: F) -> V2:
        """How a point is moved [m] that may lie `-depth` [m] deep in a body at most and is `seen` from it."""
        distance, direction, _piece = nearest(pieces, first, last, seen)
        return wp.max(depth - distance, F(0.0)) * direction

    return SimpleNamespace(
        nearest=nearest,
        normal_of=normal_of,
        travel=travel,
        displaced=displaced,
        in_box=in_box,
        in_hull=in_hull,
        look_ahead=look_ahead,
        set_back=set_back,
    )


def make_place(types: SimpleNamespace, functions: SimpleNamespace, module: str) -> Any:
    """Build the kernel `place` (over the window's nodes): where a body acts that moves relative to the grid. It is the
    rule of `nodes.contact_nodes`, seen from the grid as it lies now; only an edge of the domain acts on pairs."""
    F = types.scalar
    V2 = types.V2
    Contact, Bodies, Grid, Parameters = types.Contact, types.Bodies, types.Grid, types.Parameters
    nearest, normal_of, displaced = functions.nearest, functions.normal_of, functions.displaced

    @wp.kernel(module=module)
    def place(contact: Contact, bodies: Bodies, grid: Grid, parameters: Parameters):
        e = wp.tid()
        at = displaced(bodies, contact.body)
        spacing = parameters.spacing
        origin = V2(parameters.left + F(grid.shift[0]), parameters.bottom)
        if contact.edge == 1:
            edge = contact.pieces[0]
            n = normal_of(edge)
            axis = V2(wp.abs(n[0]), wp.abs(n[1]))
            line = (edge[8] * (n[0] + n[1]) - wp.dot(axis, origin)) * parameters.inverse_spacing
            at += ((wp.floor(line + F(0.5)) - line) * spacing) * axis
        i = wp.int32(0)
        j = wp.int32(0)
        if contact.columns < parameters.columns:
            i = wp.int32(wp.floor((contact.corner[0] + at[0] - origin[0]) * parameters.inverse_spacing))
        if contact.rows < parameters.rows:
            j = wp.int32(wp.floor((contact.corner[1] + at[1] - origin[1]) * parameters.inverse_spacing))
        i += e / contact.rows
        j += e % contact.rows
        surface = wp.int32(-1)
        mirror = wp.vec2i(-1, -1)
        if i >= 0 and i < parameters.columns and j >= 0 and j < parameters.rows:
            seen = origin + spacing * V2(F(i) + F(0.5), F(j) + F(0.5)) - at
            distance, _direction, piece = nearest(contact.pieces, 0, contact.pieces.shape[0], seen)
            distance *= parameters.inverse_spacing
            acts = distance < F(0.0) and distance > -contact.depth
            if contact.edge == 0 and distance > F(-0.5):
                acts = acts and seen[1] <= contact.crest[piece] - spacing * F(1.0 - 1.0e-9)
            if acts:
                surface = contact.surfaces[piece]
                normal = normal_of(contact.pieces[piece])
                contact.normal[e] = normal
                if contact.edge == 1 and distance > F(-1.0):
                    mi = i + wp.int32(normal[0])
                    mj = j + wp.int32(normal[1])
                    if mi >= 0 and mi < parameters.columns and mj >= 0 and mj < parameters.rows:
                        mirror = wp.vec2i(mi, mj)
        contact.node[e] = wp.vec2i(i, j)
        contact.mirror[e] = mirror
        contact.surface[e] = surface

    return place
