"""Where along the barriers the flow acts: their surfaces are divided into slots, in which kernels sum up impulses.

A slot is about as long as a cell. A place of contact stands for a stretch of surface around it, whose impulse goes to
the slots that the stretch lies in by its share in each; what acts beyond the ends of a surface, as below the ground,
goes to the slot at that end. So slots add up to the surface's reactions. They hang on the scene alone, not on its grid.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_mpm.scenario import Barrier, Prescribed, Scenario, Trapezoid
from warp_mpm.scenario.site import all_standing

from .body import Body
from .outline import Segments
from .places import PER_CELL, Places

Array = NDArray[np.float64]

MOST = 4096
"""Slots of a surface at most."""


@dataclass(frozen=True)
class Stretch:
    """A surface of a barrier, along its straight pieces, and its n slots."""

    surface: str
    rubs: bool
    """Whether it has friction."""
    toe: Array
    """[2] of the barrier at t = 0 [m]."""
    pieces: tuple[int, ...]
    """Of the outline, one after the other."""
    first: int
    """Its first slot."""
    begins: Array
    """[pieces, 2] where each piece begins [m]."""
    along: Array
    """[pieces, 2] unit vectors."""
    starts: Array
    """[pieces] way along the surface to where each piece begins [m]; what lies below the ground counts from 0 down."""
    edges: Array
    """[n + 1] way along the surface to the slots' edges [m], evenly spaced."""

    def __len__(self) -> int:
        return len(self.edges) - 1

    @property
    def inclined(self) -> bool:
        """Whether a piece of it runs across the cells, so that the flow is met at points of it."""
        return bool((np.abs(self.along).max(axis=1) < 1.0 - 1e-9).any())

    @property
    def slots(self) -> slice:
        """Its part of all slots."""
        return slice(self.first, self.first + len(self))

    def place(self, way: Array) -> Array:
        """Points [N, 2] at t = 0, from the barrier's toe [m], at a way [N] along the surface."""
        piece = np.maximum(np.searchsorted(self.starts, way, side="left") - 1, 0)
        return self.begins[piece] - self.toe + (way - self.starts[piece])[:, None] * self.along[piece]

    @cached_property
    def heights(self) -> Array:
        """[n + 1] of the edges above the barrier's toe at t = 0 [m]."""
        return self.place(self.edges)[:, 1]


@dataclass(frozen=True)
class Patches:
    """All patches [P] of one length on a surface that may bear the greatest mean load: the load is even within a slot,
    so that the greatest one begins or ends at an edge of one.

    Points of an inclined surface lie closer than nodes do. Several of them hold the same nodes, and what a node gives
    is shared between them by where they happen to lie in their cells: in turns too much and too little, with a period
    of one and a half cells, however fine the cells are. Half of each slot's load is given to its neighbours, which is
    as finely as the nodes tell it, and goes with the spacing.
    """

    length: float
    """[m]; that of the surface where it is shorter than what was asked for."""
    heights: Array
    """[P] of their middles above the barrier's toe at t = 0 [m]."""
    shared: bool
    """Whether slots share their load with their neighbours."""
    _ends: tuple[tuple[NDArray[np.int64], Array], tuple[NDArray[np.int64], Array]]
    """Slot [P] in which each begins, and ends, and the share [P] of it that lies before that."""

    @classmethod
    def along(cls, stretch: Stretch, length: float) -> Patches:
        """Those of a surface with the length [m]."""
        edges = stretch.edges
        length = min(length, float(edges[-1] - edges[0]))
        low = np.concatenate([edges[edges <= edges[-1] - length], edges[edges >= edges[0] + length] - length])

        def place(at: Array) -> tuple[NDArray[np.int64], Array]:
            reach = (at - edges[0]) / (edges[1] - edges[0])
            slot = np.clip(np.floor(reach), 0, len(stretch) - 1).astype(np.int64)
            return slot, reach - slot

        heights = stretch.place(low + 0.5 * length)[:, 1]
        return cls(length, heights, stretch.inclined, (place(low), place(low + length)))

    def means(self, load: Array) -> Array:
        """Mean [P] over each patch, of loads [n] of the slots [N/m]; a pressure [Pa]."""
        if self.shared:
            # A quarter to either side; what would go beyond an end stays, so that the sum does.
            beyond = np.concatenate([load[:1], load, load[-1:]])
            load = 0.25 * beyond[:-2] + 0.5 * load + 0.25 * beyond[2:]
        before = np.cumsum(load) - load
        (first, start), (last, end) = self._ends
        return (before[last] + end * load[last] - before[first] - start * load[first]) / self.length


@dataclass(frozen=True)
class Slots:
    """A barrier's surfaces, divided: face, crest, back, those that it has."""

    stretches: tuple[Stretch, ...]
    body: int
    """Number of the barrier among the bodies."""
    heel: tuple[float, float] | None = None
    """From its toe [m]; None of a wall, which has none."""

    def __len__(self) -> int:
        return sum(len(stretch) for stretch in self.stretches)

    @cached_property
    def face(self) -> Stretch:
        """The impacted one."""
        return self.stretches[0]

    def pieces(self) -> Iterator[tuple[Stretch, int, float, Array, Array]]:
        """Of each piece its stretch, its number in the outline, its start, where it begins and its direction."""
        for stretch in self.stretches:
            for piece in zip(stretch.pieces, stretch.starts, stretch.begins, stretch.along, strict=True):
                yield stretch, *piece


def shares(barriers: Collection[Slots], places: Places, spacing: float) -> tuple[NDArray[np.int32], Array]:
    """Slot [C] of each place of contact, -1 of one that is no barrier's, and the share [C] of its impulse that goes
    there; the rest goes to the next slot."""
    slot, share = np.full(len(places), -1, dtype=np.int32), np.ones(len(places))
    for slots in barriers:
        for stretch, piece, start_of_piece, begin, along in slots.pieces():
            own = np.flatnonzero((places.body == slots.body) & (places.piece == piece))
            # A pair of nodes stands for a cell's side, a point of the surface for half of it.
            width = np.where(places.first[own] >= 0, spacing, spacing / PER_CELL)
            start = start_of_piece + (places.position[own] - begin) @ along - 0.5 * width - stretch.edges[0]
            length = stretch.edges[1] - stretch.edges[0]
            number = np.floor(start / length + 1e-9)
            part = np.clip(((number + 1.0) * length - start) / width, 0.0, 1.0)
            part[(number < 0) | (number >= len(stretch) - 1) | (part > 1.0 - 1e-6)] = 1.0
            slot[own] = stretch.first + np.clip(number, 0, len(stretch) - 1)
            share[own] = part
    return slot, share


def feet(barriers: Collection[Slots], places: Places) -> Array:
    """Points [C, 2] on the surface at t = 0 where the barriers' places act, from their toes [m]; those of others are
    nil."""
    found = np.zeros((len(places), 2))
    for slots in barriers:
        for stretch, piece, _, begin, along in slots.pieces():
            own = (places.body == slots.body) & (places.piece == piece)
            reach = (places.position[own] - begin) @ along
            found[own] = begin - stretch.toe + reach[:, None] * along
    return found


def slots_of(scenario: Scenario, bodies: Sequence[Body]) -> dict[str, Slots]:
    """The slots of each of the scenario's barriers by its name, in the order of the bodies."""
    standing = {name: (x, barrier, outline) for name, x, barrier, outline in all_standing(scenario)}
    found: dict[str, Slots] = {}
    first = 0
    for number, body in enumerate(bodies):
        if body.name not in standing:
            continue
        x, barrier, outline = standing[body.name]
        foot = 0.0 if scenario.ground is None else float(scenario.ground.height(x))
        toe = np.array([x, foot]) if outline is None else outline[0]
        pieces = body.outline.segments
        stretches: list[Stretch] = []
        for surface in body.surfaces:
            own = list(surface.pieces if surface.pieces is not None else range(len(pieces)))
            if not own:
                continue
            starts, low, high = _along(scenario, barrier, pieces, own, foot)
            count = int(min(max(1.0, (high - low) / scenario.numerics.spacing_m + 1e-9), MOST))
            edges = np.linspace(low, high, count + 1)
            lies = (pieces.begin[own], pieces.along[own], starts, edges)
            stretches.append(Stretch(surface.name, surface.friction > 0.0, toe, tuple(own), first, *lies))
            first += count
        heel = None if outline is None else (float(outline[-1, 0] - toe[0]), float(outline[-1, 1] - toe[1]))
        found[body.name] = Slots(tuple(stretches), number, heel)
    return found


def _along(
    scenario: Scenario, barrier: Barrier, pieces: Segments, own: Sequence[int], foot: float
) -> tuple[Array, float, float]:
    """Way along a surface [m] to where each of its pieces begins, and to where its slots begin and end. A wall has no
    end; what the flow would reach with twice its energy is divided, however long the run.

    Args:
        scenario: of the run.
        barrier: whose surface it is.
        pieces: of its outline.
        own: those of the surface.
        foot: y of the ground at its toe [m].
    """
    shape, flow = barrier.shape, scenario.flow
    if isinstance(shape, Trapezoid):
        corners = pieces.begin if pieces.closed else shape.outline
        lengths = np.array([float(np.hypot(*(corners[(k + 1) % len(corners)] - corners[k]))) for k in own])
        # What goes down to the base below the ground counts to the slot at the surface's end.
        beneath = [k >= len(pieces) - 3 for k in own] if pieces.closed else [False] * len(own)
        shown = np.where(beneath, 0.0, lengths)
        starts = np.concatenate([[0.0], np.cumsum(shown)[:-1]])
        if beneath[0]:
            starts[0] = -lengths[0]
        # A crest without width still has a slot, of no length to speak of.
        return starts, 0.0, max(float(shown.sum()), 1e-9)
    y, g = np.concatenate(flow.outlines)[:, 1], -scenario.gravity.vector[1]
    low, high = y.min(), y.max()
    motion, speed = barrier.motion, flow.greatest_speed
    if isinstance(motion, Prescribed):
        speed += max(abs(velocity) for velocity in motion.velocities_m_per_s)
    reach = flow.depth + (speed**2 / g if g > 0.0 else 10.0 * flow.depth)
    low = foot if scenario.ground is not None else float(low) - reach
    begin = float(pieces.begin[own[0], 1])
    return np.zeros(1), low - begin, float(high) + reach - begin
