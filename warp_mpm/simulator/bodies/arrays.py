"""The arrays of the bodies and of their contact on the device."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mpm.effects import Effects
from warp_mpm.grid import GridLayout
from warp_mpm.kernels.layout import BLOCK, SLOT_SIZE

from .body import Body, Driven, Sliding
from .kernels import NEAR
from .loads import Slots, feet, shares
from .outline import ENDLESS, FEW, Segments
from .places import Places, along_grid, by_block, coloured, neighbours, places_of, sharing


@dataclass(frozen=True)
class Group:
    """Arrays that kernels take together."""

    structure: Any
    """The Warp structure that holds them."""
    arrays: dict[str, Any]
    """The same, by name."""


def filled(
    structure: Any, fields: Mapping[str, Any], given: Mapping[str, Any], shapes: Mapping[str, Any], device: Any
) -> Group:
    """The structure with a value for each of its fields, an array where it is one: what is given, else zeros of the
    shape."""
    arrays = {}
    for name, field in fields.items():
        if not isinstance(field, wp.array):
            setattr(structure, name, given[name])
            continue
        if name in given:
            array = wp.array(given[name], dtype=field.dtype, device=device)
        else:
            array = wp.zeros(shapes[name], dtype=field.dtype, device=device)
        setattr(structure, name, array)
        arrays[name] = array
    return Group(structure, arrays)


def carrier(bodies: Sequence[Body]) -> int:
    """Number of the body with which the grid rides; -1 where it rests.

    Raises:
        ValueError: two bodies carry the grid.
    """
    found = [number for number, body in enumerate(bodies) if body.carries_grid]
    if len(found) > 1:
        names = " and ".join(bodies[number].name for number in found)
        raise ValueError(f"{names} both carry the grid; carries_grid must be True of at most one body")
    return found[0] if found else -1


def passes(body: Body, bodies: Sequence[Body]) -> bool:
    """Whether a body moves relative to the grid. One that is level and without end looks the same wherever that is."""
    riding = carrier(bodies)
    if riding >= 0 and body is bodies[riding]:
        return False
    pieces = body.outline.segments
    level = not pieces.closed and len(pieces) == 1 and bool(pieces.normal[0, 0] == 0.0)
    return body.moves or (riding >= 0 and bodies[riding].moves and not level)


def profiled(bodies: Sequence[Body]) -> int:
    """Number of the body whose pieces are found by the column of the grid: an open outline of many that rests and leads
    along x; -1 where there is none."""
    for number, body in enumerate(bodies):
        pieces = body.outline.segments
        along = not pieces.closed and len(pieces) > FEW and bool((pieces.along[:, 0] >= 0.0).all())
        if along and not passes(body, bodies):
            return number
    return -1


def effects_of(bodies: Sequence[Body]) -> dict[str, bool]:
    """Those fields of `Effects` that the bodies decide."""
    ground_alone = len(bodies) == 1 and _is_level_ground(bodies[0])
    return {
        "bodies": len(bodies) > 0,
        "friction": any(body.rubs for body in bodies),
        "turbulence": any(body.turbulent for body in bodies),
        "sliding": any(isinstance(body.motion, Sliding) for body in bodies),
        "driven": any(isinstance(body.motion, Driven) for body in bodies),
        "joined": len(bodies) > 0 and not ground_alone,
        "passing": any(passes(body, bodies) for body in bodies),
        "profile": profiled(bodies) >= 0,
    }


def _is_level_ground(body: Body) -> bool:
    """Whether all its places of contact stand alone: it lies along y = 0, a line of cell corners, and rests."""
    pieces = body.outline.segments
    return len(pieces) == 1 and not body.moves and bool(pieces.normal[0, 1] == 1.0 and pieces.offset[0] == 0.0)


def body_arrays(
    bodies: Sequence[Body],
    effects: Effects,
    types: SimpleNamespace,
    grid: GridLayout,
    gravity: tuple[float, float],
    *,
    device: Any,
) -> Group:
    """Outlines, surfaces and motion of all bodies; fields that nothing is said of begin at 0."""
    count = len(bodies)
    given: dict[str, Any] = {"count": count}
    if effects.bodies:
        pieces = [body.outline.segments for body in bodies]
        boxes = np.array([_box(body, bodies, grid) for body in bodies])
        given |= {
            "first_piece": _firsts([len(piece) for piece in pieces]),
            "first_surface": _firsts([len(body.surfaces) for body in bodies]),
            "box": boxes,
            "ahead": boxes + 0.5 * grid.spacing * np.array([1.0, -1.0, 1.0, -1.0]),
            "pieces": np.concatenate([piece.numbers for piece in pieces]),
            "hull": np.concatenate([piece.hull for piece in pieces]),
        }
    if effects.profile:
        number = profiled(bodies)
        given["profiled"] = number
        given["near"] = pieces_by_column(bodies[number].outline.segments, grid) + given["first_piece"][number]
    if effects.friction:
        given["friction"] = np.array([surface.friction for body in bodies for surface in body.surfaces])
        given["rubs"] = np.array([body.rubs for body in bodies], dtype=np.int32)
    if "cuts" in types.body_fields:
        cuts = [passes(body, bodies) or not along_grid(body.outline.segments, grid).all() for body in bodies]
        given["cuts"] = np.array([cut and not body.edge for cut, body in zip(cuts, bodies, strict=True)], np.int32)
    if effects.turbulence:
        given["turbulence"] = np.array([surface.turbulence for body in bodies for surface in body.surfaces])
    if effects.moving:
        given["carrier"] = carrier(bodies)
    if effects.sliding:
        mass = np.array([body.motion.mass if isinstance(body.motion, Sliding) else 0.0 for body in bodies])
        given |= {
            "mass": mass,
            "weight": -mass * gravity[1],
            "pull": mass * gravity[0],
            "base_friction": np.array(
                [body.motion.base_friction if isinstance(body.motion, Sliding) else 0.0 for body in bodies]
            ),
        }
    if effects.driven:
        tables = [body.motion for body in bodies if isinstance(body.motion, Driven)]
        given |= {
            "first_time": _firsts([len(b.motion.times) if isinstance(b.motion, Driven) else 0 for b in bodies]),
            "times": np.concatenate([table.times for table in tables]),
            "velocities": np.concatenate([table.velocities for table in tables]),
        }
    return filled(types.Bodies(), types.body_fields, given, dict.fromkeys(types.body_fields, count), device)


def contact_arrays(
    bodies: Sequence[Body],
    effects: Effects,
    types: SimpleNamespace,
    grid: GridLayout,
    *,
    slots: Collection[Slots],
    lanes: int,
    device: Any,
) -> Group:
    """Where the bodies act, and what they give there in a step.

    Args:
        bodies: all that the flow meets.
        effects: of the scene.
        types: of the kernels, from `layout`.
        grid: on which they act.
        slots: of each barrier.
        lanes: threads that share the joined places; see `places.coloured`.
        device: of Warp.
    """
    passing = [passes(body, bodies) for body in bodies]
    places = places_of(bodies, grid, passing)
    joined = sharing(places, bodies, grid, passing)
    order, block, start = by_block(places.chosen(~joined), grid)
    alone, together = places.chosen(~joined).chosen(order), places.chosen(joined)
    order, colour = coloured(together, bodies, grid, passing)
    places = Places.together([alone, together.chosen(order)])
    first = _firsts([len(body.surfaces) for body in bodies])
    surface_of = [np.array(body.surface_of_piece, dtype=np.int32) + first[k] for k, body in enumerate(bodies)]
    given = {
        "body": places.body,
        "surface": np.array([surface_of[b][p] for b, p in zip(places.body, places.piece, strict=True)], dtype=np.int32),
        "position": places.position,
        "normal": places.normal,
        "fixed": (places.first >= 0).astype(np.int32),
        "first": places.first,
        "weight_x": places.weight_x,
        "weight_y": places.weight_y,
        "block": block,
        "start": start,
    }
    if effects.dimensions == 3:
        given["weight_z"] = places.weight_z
    if effects.joined:
        slides = np.array([isinstance(body.motion, Sliding) for body in bodies])[together.chosen(order).body]
        abreast = [slides[a:b].sum() for a, b in pairwise(colour)]
        given |= {"colours": len(colour) - 1, "colour": colour + len(alone), "lanes": lanes}
        given |= runs_of(places, colour + len(alone), grid, passing, RUN if lanes == 1 else 1)
        given["abreast"] = float(max(abreast, default=1))
    if effects.friction:
        before, after = neighbours(together)
        rank = np.argsort(order)  # where each place has come to
        own = np.arange(len(alone))
        given |= {
            name: np.concatenate([own, len(alone) + rank[beside[order]]]).astype(np.int32)
            for name, beside in (("before", before), ("after", after))
        }
    if effects.turbulence:
        given["length"] = places.length
    given["slot"] = np.full(len(places), -1, dtype=np.int32)
    if slots:
        given["slot"], given["share"] = shares(slots, places, grid.spacing)
        given["foot"] = feet(slots, places)
    shapes = dict.fromkeys(types.contact_fields, len(places)) | {"last": 1, "more": 1}
    shapes |= {"taken": SLOT_SIZE * sum(map(len, slots)), "turned": 2 * int(first[-1])}
    return filled(types.Contact(), types.contact_fields, given, shapes, device)


RUN = 8
"""Places of one run, where one thread does them all."""


def runs_of(
    places: Places, colour: NDArray[np.int32], grid: GridLayout, passing: Sequence[bool], length: int
) -> dict[str, NDArray[np.int32]]:
    """Runs of places of one colour, `length` at most, and the blocks of the grid that may hold the nodes of each; all
    blocks where its body moves relative to the grid."""
    begins = [np.arange(begin, end, length) for begin, end in pairwise(colour)]
    first = np.concatenate([np.zeros(0, dtype=np.int64), *begins])
    ends = np.append(first, colour[-1])[1:]
    blocks = np.array([grid.columns, grid.rows]) // BLOCK
    around = np.tile(np.array([0, blocks[0] - 1, 0, blocks[1] - 1], dtype=np.int32), (len(first), 1))
    cell = np.floor((places.position[:, :2] - (grid.left, grid.bottom)) / grid.spacing).astype(np.int64)
    held = places.first >= 0
    cell[held] = np.stack(np.divmod(places.first[held] % (grid.columns * grid.rows), grid.rows), axis=1) + 1
    moves = np.array(passing)[places.body]
    for run, (begin, end) in enumerate(zip(first, ends, strict=True)):
        if not moves[begin:end].any():
            # Nodes lie a cell to either side; one more for rounding.
            low, high = cell[begin:end].min(axis=0) - 2, cell[begin:end].max(axis=0) + 2
            around[run] = np.clip(np.stack([low, high], axis=1) // BLOCK, 0, blocks[:, None] - 1).ravel()
    return {
        "runs": np.searchsorted(first, colour).astype(np.int32),
        "run": np.append(first, colour[-1]).astype(np.int32),
        "around": around,
        "near": np.ones(len(first), dtype=np.int32),
    }


def pieces_by_column(pieces: Segments, grid: GridLayout) -> NDArray[np.int32]:
    """First and last but one of the pieces [columns, 2] within `NEAR` cells of each column of the grid."""
    left = grid.left + np.arange(grid.columns) * grid.spacing
    low, high = left - NEAR * grid.spacing, left + (NEAR + 1.0) * grid.spacing
    start, end = (pieces.begin[:, 0] + limit * pieces.along[:, 0] for limit in (pieces.low, pieces.high))
    first = np.searchsorted(end, low, side="left")
    last = np.searchsorted(start, high, side="right")
    return np.stack([first, np.maximum(last, first + 1)], axis=1).astype(np.int32)


def _box(body: Body, bodies: Sequence[Body], grid: GridLayout) -> NDArray[np.float64]:
    """Around the solid (x from, x to, y from, y to), with all that lies beyond the grid; nothing of an edge."""
    if body.edge:
        return np.array([ENDLESS, -ENDLESS, ENDLESS, -ENDLESS])
    pieces = body.outline.segments
    everywhere = np.array([-ENDLESS, ENDLESS, -ENDLESS, ENDLESS])
    if pieces.closed:
        (x0, y0), (x1, y1) = body.outline.vertices.min(axis=0), body.outline.vertices.max(axis=0)
        return np.array([x0, x1, y0, y1])
    if passes(body, bodies):
        return everywhere
    edges = (grid.left, grid.left + grid.columns * grid.spacing, grid.bottom, grid.bottom + grid.rows * grid.spacing)
    found = pieces.box(*edges)
    corners = np.array([[x, y] for x in edges[:2] for y in edges[2:]])
    solid = corners[body.outline.distance(corners) < 0.0]
    if found is None:
        return everywhere if len(solid) else np.array([ENDLESS, -ENDLESS, ENDLESS, -ENDLESS])
    for x, y in solid:
        found[0 if x == edges[0] else 1] = -ENDLESS if x == edges[0] else ENDLESS
        found[2 if y == edges[2] else 3] = -ENDLESS if y == edges[2] else ENDLESS
    return found


def _firsts(counts: Sequence[int]) -> NDArray[np.int32]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
