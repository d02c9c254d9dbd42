"""The kernels of a step, launched one by one or captured as a whole interval, over the points that have arrived."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from .discretization import MaterialPoints
from .effect_rules import kind_of
from .kernels import layout as at
from .kernels.cache import load_kernels
from .kernels.turns import one_thread_at_a_time
from .scenario import Scenario
from .simulator.step import LEDGER, START, Launch, launches
from .state.on_device import OnDevice

MOST_STEPS_AT_ONCE = 2**30
"""Bound of the device's counter."""

GROWTHS = 12
"""Times at most that a run with an inflow is captured anew, for more points."""


class Stepping:
    """Launches kernels on what a simulation holds.

    Args:
        scenario: what is simulated.
        held: what the kernels work on.
        kernels: built for its effects.
        initial: the material points at the start.
        workers: threads that share the blocks of the grid.
    """

    def __init__(
        self, scenario: Scenario, held: OnDevice, kernels: SimpleNamespace, initial: MaterialPoints, *, workers: int
    ) -> None:
        self.held, self.effects, self.device = held, held.effects, held.device
        self._scenario, self._kernels, self._workers = scenario, kernels, workers
        self._kinds = [
            self.effects.kinds.index(kind_of(material)) if self.effects.kinds else 0
            for material in scenario.flow.materials
        ]
        """Of each material, its place among the kinds of kernels over points."""
        _, first = held.spans[0]
        self.arguments: dict[str, Any] = (
            held.clock | held.structures | {"parameters": held.of_materials[0], "book": first["book"]}
        )
        """Of a launch, by the names of `Launch.takes`."""
        self.entry = [
            initial.entry[part.begin : part.end][initial.waits[part.begin : part.end]] for part in initial.spans
        ]
        """Of each span, the ways at which its points that wait come."""
        self.counts = {"one": 1, "workers": workers}
        """Threads, by what a kernel goes over."""
        if self.effects.bodies:
            self.counts |= {"groups": len(held.contact["block"]), "lanes": held.lanes}
        self.target = held.clock["clock"][at.TARGET : at.TARGET + 1]
        """Time to go to [s]."""
        self.steps_left = held.clock["running"][at.STEPS_LEFT : at.STEPS_LEFT + 1]
        """Steps to make before the device hands back."""
        self._goes_on = held.clock["running"][at.GOES_ON : at.GOES_ON + 1]
        self._graph: Any = None
        self._in_flow: list[tuple[int, int, int]] = []
        """Of each span, entries FLOW_... of what the kernels over the flow go over."""
        self._threads = [0] * len(held.spans)
        """Of each span, its points that `update` goes over."""
        self.make_room(0.0)
        self._on_launch: Callable[[str], None] | None = None
        self._commands: list[tuple[str, Any]] | None = None
        self.kernels_of_a_step: tuple[str, ...] = ()
        """Their names, as captured."""
        self.ledger_graph: Any = None

    def launch(self, launch: Launch, dim: int, arguments: Sequence[Any], kernels: Any = None) -> None:
        """Launch a kernel with so many threads; of `kernels`, where it is another kind's."""
        kernel, kept = getattr(kernels or self._kernels, launch.kernel), self._commands is not None
        command = wp.launch(kernel, dim=dim, inputs=list(arguments), device=self.device, record_cmd=kept)
        if self._commands is not None and command is not None:  # of no threads there is none
            self._commands.append((launch.kernel, command))
        if self._on_launch is not None:
            self._on_launch(launch.kernel)

    def _step(self) -> None:
        for launch in launches(self.effects):
            if launch.over in ("points", "flow"):
                self.launch_over_points(launch)
            else:
                self.launch(launch, self.counts[launch.over], [self.arguments[name] for name in launch.takes])

    def launch_over_points(self, launch: Launch) -> None:
        """Once for each span of points of one material, as far as they can have arrived."""
        for (part, own), count in zip(self.held.spans, self._threads, strict=True):
            arguments = self.arguments | own
            kernels = self._kernels.of_kinds[self._kinds[part.material]]
            flow = self._in_turn(count) if count else 0
            threads = {"workers": self._workers, "flow": flow}.get(launch.over, count)
            if threads > 0 and hasattr(kernels, launch.kernel):  # some are only another kind's
                self.launch(launch, threads, [arguments[name] for name in launch.takes], kernels)

    def _in_turn(self, count: int) -> int:
        """Threads of a kernel over the flow, for so many points."""
        return 1 if self.device.is_cpu else count

    def _start(self) -> None:
        self.launch(START, 1, [self.arguments[name] for name in START.takes])

    def _interval(self) -> None:
        self._start()
        wp.capture_while(self._goes_on, self._step)

    def _sum_up(self) -> None:
        self.held.clock["sums"].zero_()
        self.launch_over_points(LEDGER)

    def make_room(self, until: float) -> None:
        """Let the kernels go over all points that may have arrived by a time [s]: those that wait cost nothing.

        Those over the flow are told how many these are. `update` has a thread for each point, so that it is captured
        anew, for some more points at a time.
        """
        held = self.held
        inflow = self._scenario.flow.inflow
        # On the device the way is summed up in other pieces.
        way = inflow.way(until) + 1e-6 * held.grid.spacing if inflow is not None else 0.0
        share = max(1, -(-sum(map(len, self.entry)) // GROWTHS))
        before = self._in_flow or [(0, 0, 0)] * len(held.spans)
        # From a state put back, with as many threads as a run that came to it: rounding depends on how many there are.
        threads_before = self._threads if self._in_flow else [0] * len(held.spans)
        state = held.points["inside"].numpy() if inflow is not None else None
        ends, arriving, threads = [], [], []
        for (part, _), entry, (_, begin, _), so_far in zip(held.spans, self.entry, before, threads_before, strict=True):
            there = part.end - part.begin - len(entry)
            come = int(np.searchsorted(entry, way, side="right"))
            threads.append(max(so_far, there + min(len(entry), -(-come // share) * share)))
            ends.append(there + come)
            begin = max(begin, there)
            if state is not None:
                own = state[part.begin + begin : part.begin + there + come]
                not_yet = (own == at.WAITING) | (own == at.HELD)
                begin += int(not_yet.argmax()) if not_yet.any() else len(own)
            arriving.append(begin)
        if threads != self._threads:
            self._threads, self.counts["points"] = threads, sum(threads)
            self._graph = None
        step = self._in_turn(max(threads))
        in_flow = [(end, begin, step) for end, begin in zip(ends, arriving, strict=True)]
        if in_flow != self._in_flow:
            self._in_flow = in_flow
            held.fill(held.clock["flow"], np.array(in_flow, dtype=np.int32).ravel())

    def forget_the_flow(self) -> None:
        """After another state is put into the arrays: what is in the flow is found anew."""
        self._in_flow = []

    def prepare(self) -> None:
        """Compile the kernels, or find them compiled, and capture an interval, unless that is done."""
        if self._graph is None:
            names: list[str] = []
            self._on_launch = names.append
            self._graph = self._captured(self._interval)
            self._on_launch = None
            self.kernels_of_a_step = tuple(dict.fromkeys(names[1:]))  # the first one starts the interval

    @one_thread_at_a_time
    def _captured(self, launches: Callable[[], None]) -> Any:
        """A graph of the launches, which replays for a hundredth of what they cost one by one."""
        for name in self.effects.module_names:
            load_kernels(name, self.device)
        with wp.ScopedCapture(device=self.device) as capture:
            launches()
        return capture.graph

    def go(self) -> None:
        """Step to the target, or until no steps are left, as captured."""
        wp.capture_launch(self._graph)

    def sums(self) -> list[float]:
        """Sums over the points now: entries LEDGER_... of `kernels.layout`."""
        if self.ledger_graph is None:
            self.ledger_graph = self._captured(self._sum_up)
        wp.capture_launch(self.ledger_graph)
        sums: list[float] = self.held.read("sums").tolist()
        return sums

    def kernel_times(self) -> dict[str, float]:
        """Step to the target with every kernel launched on its own, and tell the wall time [s] of each."""
        self.held.fill(self.steps_left, MOST_STEPS_AT_ONCE)
        self._commands = []
        self._start()
        self._step()
        (_, start), *commands = self._commands
        self._commands = None
        start.launch()
        spent = dict.fromkeys((name for name, _ in commands), 0.0)
        while int(self.held.read("running")[at.GOES_ON]):
            for name, command in commands:
                begin = time.perf_counter()
                command.launch()
                wp.synchronize_device(self.device)
                spent[name] += time.perf_counter() - begin
        return spent
