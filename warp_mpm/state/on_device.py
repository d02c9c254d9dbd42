"""All that a simulation holds on its device: how it is made, read and filled."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..discretization import MaterialPoints, Span
from ..effects import Effects
from ..grid import GridLayout
from ..kernels import layout as at
from ..kernels.turns import WARP, one_thread_at_a_time_on_a_gpu
from ..scenario import Scenario
from ..simulator.bodies import Body
from ..simulator.bodies.arrays import body_arrays, contact_arrays
from ..simulator.bodies.loads import Slots
from .arrays import Group, arrival_arrays, clock_arrays, grid_arrays, point_arrays, span_of

STATE_OF_BODIES = (
    *("displacement", "velocity", "old_velocity", "impulse", "work"),
    *("ahead", "next", "external_force", "base_impulse", "base_work", "times", "velocities", "held"),
)
"""Arrays of the bodies that change during a run."""

LANES = 256
"""Threads of the one block that shares the joined places of contact on a GPU, Warp's own size of a block."""

IMPULSES = ("solid", "liquid", "alone", "rubbed", "inverse")
"""Arrays of the places of contact that a step leaves to the next."""

ARRIVED = ("conveyed", "inflow")
"""Arrays of an inflow that change during a run."""

LOADS = ("taken", "turned")
"""Sums of the barriers' slots and surfaces since t = 0."""


class OnDevice:
    """Arrays of a simulation, by the names of `kernels.layout`, and the structures of them that kernels take.

    Args:
        scenario: what is simulated.
        effects: of the scene and its bodies.
        types: of the kernels that are built for them.
        grid: the nodes.
        initial: the material points at the start.
        bodies: all that the flow meets.
        slots: the surfaces of each barrier, divided.
        liquid_stiffness: as in `arrays.point_arrays`.
        of_materials: parameters of the kernels for each material.
        device: where the arrays lie.
    """

    def __init__(
        self,
        scenario: Scenario,
        effects: Effects,
        types: SimpleNamespace,
        grid: GridLayout,
        initial: MaterialPoints,
        *,
        bodies: Sequence[Body],
        slots: Collection[Slots],
        liquid_stiffness: NDArray[np.float64],
        of_materials: Sequence[Any],
        device: Any,
    ) -> None:
        self.effects, self.types, self.grid, self.device = effects, types, grid, device
        self.of_materials = of_materials
        """Of each, `Parameters` of its kernels."""
        self.lanes = 1 if device.is_cpu else LANES
        points = point_arrays(scenario, effects, types, initial, liquid_stiffness=liquid_stiffness, device=device)
        made: dict[str, Group] = {
            "points": points,
            "grid": grid_arrays(bodies, effects, types, grid, device=device),
            "bodies": body_arrays(bodies, effects, types, grid, scenario.gravity.vector, device=device),
        }
        if effects.bodies:
            made["contact"] = contact_arrays(bodies, effects, types, grid, slots=slots, lanes=self.lanes, device=device)
        if effects.arriving:
            made["arrival"] = arrival_arrays(scenario, types, device=device)
        none = dict.fromkeys(("contact", "arrival"))
        self.structures: dict[str, Any] = none | {name: group.structure for name, group in made.items()}
        """Of points, grid, bodies, contact and arrival, as kernels take them; None of what the scene has not."""
        self.points = points.arrays
        self.nodes = made["grid"].arrays
        self.bodies = made["bodies"].arrays
        self.contact = made["contact"].arrays if "contact" in made else {}
        self.arrival = made["arrival"].arrays if "arrival" in made else {}
        surfaces = sum(len(body.surfaces) for body in bodies)
        self.clock = clock_arrays(scenario, effects, initial, surfaces=surfaces, device=device)
        """Clock, counters, balance, limiters, impulses on the surfaces, sums and what is in the flow."""
        self.spans = [
            (part, self._span_of(number, part, points if len(initial.spans) > 1 else None))
            for number, part in enumerate(initial.spans)
        ]
        """Points of one material that lie one after the other, and what kernels over them are launched with."""
        self._slots = slots
        # On the CPU the host sees the device's own memory; elsewhere every look is a copy.
        self._seen: dict[str, NDArray[Any]] = {}
        if device.is_cpu:
            watched = self.clock | self.bodies | self.arrival
            self._seen = {name: array.numpy() for name, array in watched.items()}
            self._seen |= {name: self.contact[name].numpy() for name in LOADS if name in self.contact}

    def _span_of(self, number: int, part: Span, points: Group | None) -> dict[str, Any]:
        """What kernels over the points of one material are launched with; without `points`, over all of them.

        Points of a material lie one after the other, and kernels go over one such span after the other, each with
        numbers that are the same for all of it: a loop that looked them up at each point would not be vectorised.
        """
        book = self.types.Book()
        for name in at.BOOK:
            setattr(book, name, self.clock[name])
        if points is None:
            return {"points": self.structures["points"], "parameters": self.of_materials[0], "book": book}
        book.flow = self.clock["flow"][number * at.FLOW_SIZE : (number + 1) * at.FLOW_SIZE]
        own = span_of(points, self.types, part.begin, part.end)
        return {"points": own, "parameters": self.of_materials[part.material], "book": book}

    @property
    def by_name(self) -> dict[str, Any]:
        """Every array, by its group and its name."""
        groups = {"points": self.points, "grid": self.nodes, "bodies": self.bodies}
        groups |= {"contact": self.contact, "arrival": self.arrival}
        held = {f"{group}.{name}": array for group, arrays in groups.items() for name, array in arrays.items()}
        return held | self.clock

    @property
    def state(self) -> dict[str, Any]:
        """The arrays that a run needs to go on, bit for bit."""
        arrays = {f"points.{name}": array for name, array in self.points.items()}
        # Corner sums and the rest of the grid are rebuilt every step; only the blocks in use are remembered.
        kept = ("clock", "counters", "limiters", "reactions", "left", "balance")
        arrays |= {name: self.clock[name] for name in kept} | {"grid.shift": self.nodes["shift"]}
        if self._slots:
            arrays |= {f"contact.{name}": self.contact[name] for name in LOADS}
        arrays |= {f"arrival.{name}": self.arrival[name] for name in ARRIVED if name in self.arrival}
        arrays |= {f"bodies.{name}": array for name, array in self.bodies.items() if name in STATE_OF_BODIES}
        if self.effects.joined:
            # Their impulses begin with those of the step before. Places that stand alone begin with none; how many they
            # are depends on the grid, which is larger for a later end.
            contact = self.contact
            joined = int(contact["colour"].numpy()[0])
            arrays["contact.last"] = contact["last"]
            arrays |= {f"contact.{name}": contact[name][joined:] for name in IMPULSES if name in contact}
        return arrays

    @one_thread_at_a_time_on_a_gpu
    def read(self, name: str) -> NDArray[Any]:
        """Present numbers of clock, bodies, counters or sums; on the CPU they go on changing with the run."""
        if name in self._seen:
            return self._seen[name]
        for arrays in (self.bodies, self.contact, self.arrival):
            if name in arrays:
                return arrays[name].numpy()
        return self.clock[name].numpy()

    def fill(self, array: Any, value: float | tuple[float, float] | NDArray[np.int32]) -> None:
        """Set all of an array on the device; on the CPU behind Warp's back, which may be at work for another thread."""
        if self.device.is_cpu:
            array.numpy()[...] = value
            return
        with WARP:
            array.assign(value) if isinstance(value, np.ndarray) else array.fill_(value)

    def clock_entry(self, entry: int) -> float:
        """`kernels.layout`'s entry of the clock."""
        return float(self.read("clock")[entry])

    def number_of(self, body: int, field: str) -> float:
        """A number of a body; 0 where the scene does not have it."""
        return float(self.read(field)[body]) if field in self.bodies else 0.0
