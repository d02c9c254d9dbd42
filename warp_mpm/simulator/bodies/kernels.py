"""Bodies as kernels see them: arrays of pieces, surfaces and bodies, and indices between them."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_mpm.effects import Effects

from .outline import TIE


def body_fields(effects: Effects, scalar: Any, V2: Any, V4: Any) -> dict[str, Any]:
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
            # [G] as in `outline.Segments`.
            "begin": array(dtype=V2),
            "along": array(dtype=V2),
            "low": array(dtype=scalar),
            "high": array(dtype=scalar),
            "normal": array(dtype=V2),
            "offset": array(dtype=scalar),
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


def contact_fields(effects: Effects, scalar: Any, V2: Any, V: Any) -> dict[str, Any]:
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
            "first_piece": array(dtype=wp.int32),
            "begin": array(dtype=V2),
            "along": array(dtype=V2),
            "low": array(dtype=scalar),
            "high": array(dtype=scalar),
            "normals": array(dtype=V2),
            "offset": array(dtype=scalar),
            "crest": array(dtype=scalar),
            "surfaces": array(dtype=wp.int32),
            "corner": V2,
            "columns": wp.int32,
            "rows": wp.int32,
            "depth": scalar,
            "edge": wp.int32,
        }
    return fields


def make_body_functions(types: SimpleNamespace) -> SimpleNamespace:
    """Build the functions `nearest`, `travel`, `displaced`, `surface_velocity`, `near` and `set_back`."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V4 = types.V4
    Bodies = types.Bodies
    MOVING = effects.moving
    SAME = TIE if effects.precision == "float64" else 1e-6

    vectors, numbers = wp.array(dtype=V2), wp.array(dtype=F)

    @wp.func
    def nearest(
        begin: vectors,
        along: vectors,
        low: numbers,
        high: numbers,
        normal: vectors,
        offset: numbers,
        first: wp.int32,
        last: wp.int32,
        place: V2,
    ):
        """Signed distance, outward normal and nearest piece, as `outline.Segments.nearest`."""
        best = F(1.0e30)
        facing = F(0.0)
        over = F(0.0)
        piece = first
        for k in range(first, last):
            across = wp.abs(wp.dot(normal[k], place) - offset[k])
            t = wp.dot(place - begin[k], along[k])
            beyond = wp.max(wp.max(low[k] - t, t - high[k]), F(0.0))
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
                piece = k
        distance = wp.dot(normal[piece], place) - offset[piece]
        direction = normal[piece]
        if over > F(0.0):
            distance = wp.where(distance < F(0.0), -best, best)
            t = wp.clamp(wp.dot(place - begin[piece], along[piece]), low[piece], high[piece])
            if distance != F(0.0):
                direction = (place - begin[piece] - t * along[piece]) / distance
        return distance, direction, piece

    @wp.func
    def surface_velocity(bodies: Bodies, body: wp.int32) -> V2:
        """[m/s], of a body that may move."""
        result = V2()
        if MOVING:
            v = bodies.velocity[body]
            result = V2(F(v[0]), F(v[1]))
        return result

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
    def within(box: V4, place: V2, margin: F) -> wp.bool:
        return (
            place[0] > box[0] - margin
            and place[0] < box[1] + margin
            and place[1] > box[2] - margin
            and place[1] < box[3] + margin
        )

    @wp.func
    def near(bodies: Bodies, body: wp.int32, place: V2, reach: F) -> wp.bool:
        """Whether `place`, seen from the body, lies inside it or within `reach` [m] of it."""
        result = wp.bool(False)
        if within(bodies.box[body], place, reach):
            distance, _normal, _piece = nearest(
                bodies.begin, bodies.along, bodies.low, bodies.high, bodies.normal, bodies.offset,
                bodies.first_piece[body], bodies.first_piece[body + 1], place,
            )  # fmt: skip
            result = distance < reach
        return result

    @wp.func
    def set_back(bodies: Bodies, place: V2, depth: F, time_step: F):
        """Where a point at `place` goes that may lie `-depth` [m] deep in a body at most, and how many moved it."""
        count = wp.int32(0)
        for body in range(bodies.count):
            seen = place - (displaced(bodies, body) + travel(bodies, body, time_step))
            if within(bodies.box[body], seen, depth):
                distance, normal, _piece = nearest(
                    bodies.begin, bodies.along, bodies.low, bodies.high, bodies.normal, bodies.offset,
                    bodies.first_piece[body], bodies.first_piece[body + 1], seen,
                )  # fmt: skip
                if distance < depth:
                    place += (depth - distance) * normal
                    count += 1
        return place, count

    return SimpleNamespace(
        nearest=nearest,
        travel=travel,
        displaced=displaced,
        surface_velocity=surface_velocity,
        near=near,
        set_back=set_back,
    )


def make_place(types: SimpleNamespace, functions: SimpleNamespace, module: str) -> Any:
    """Build the kernel `place` (over the window's nodes): where a body acts that moves relative to the grid. It is the
    rule of `nodes.contact_nodes`, seen from the grid as it lies now; only an edge of the domain acts on pairs."""
    F = types.scalar
    V2 = types.V2
    Contact, Bodies, Grid, Parameters = types.Contact, types.Bodies, types.Grid, types.Parameters
    nearest, displaced = functions.nearest, functions.displaced

    @wp.kernel(module=module)
    def place(contact: Contact, bodies: Bodies, grid: Grid, parameters: Parameters):
        e = wp.tid()
        at = displaced(bodies, contact.body)
        spacing = parameters.spacing
        origin = V2(parameters.left + F(grid.shift[0]), parameters.bottom)
        if contact.edge == 1:
            n = contact.normals[0]
            axis = V2(wp.abs(n[0]), wp.abs(n[1]))
            line = (contact.offset[0] * (n[0] + n[1]) - wp.dot(axis, origin)) * parameters.inverse_spacing
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
            distance, _direction, piece = nearest(
                contact.begin, contact.along, contact.low, contact.high, contact.normals, contact.offset,
                0, contact.first_piece[1], seen,
            )  # fmt: skip
            distance *= parameters.inverse_spacing
            acts = distance < F(0.0) and distance > -contact.depth
            if contact.edge == 0 and distance > F(-0.5):
                acts = acts and seen[1] <= contact.crest[piece] - spacing * F(1.0 - 1.0e-9)
            if acts:
                surface = contact.surfaces[piece]
                normal = contact.normals[piece]
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
