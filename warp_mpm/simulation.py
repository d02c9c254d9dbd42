"""A simulation: state on the device and the captured steps that advance it. It knows nothing of files."""

from __future__ import annotations

import math
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, replace
from functools import cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .channel import Channel
from .discretization import MaterialPoints, Span, material_points
from .effect_rules import derive_effects, kind_of
from .grid import fit_grid
from .kernels import layout as at
from .kernels.build import build_kernels
from .kernels.cache import initialize_warp, load_kernels
from .kernels.pore_pressure import LEAST_POROSITY
from .quantities.quantity import of_width
from .quantities.time_series import OWN
from .scenario import Scenario
from .simulator.bodies import Body, Driven, Sliding
from .simulator.bodies.arrays import body_arrays, contact_arrays, effects_of
from .simulator.bodies.loads import Patches, slots_of
from .simulator.bodies.of_scene import BARRIER, scene_bodies
from .simulator.step import LEDGER, START, Launch, launches
from .state import saved
from .state.arrays import Group, arrival_arrays, clock_arrays, grid_arrays, memory_for, point_arrays, span_of
from .state.divergence import SimulationDiverged, diverging, what_diverged, what_is_no_number
from .state.loads import LoadsNow
from .state.parameters import kernel_parameters, tell_nodes
from .state.samples import BarrierNow, Now, Window, mean_forces, sampled_quantities, wanted_quantities
from .time_step import ONE_TIME, nominal_step, step_limits

__all__ = ["Simulation", "SimulationDiverged"]

LOOK_UP = 0.25
"""Wall time [s] after which the device hands back to the host, which then hears Ctrl-C; a step is never cut."""

FIRST_LOOK_UP = 100_000
"""Steps times material points until the first time, when nothing has been timed: some hundredths of a second."""

MOST_STEPS_AT_ONCE = 2**30
"""Bound of the device's counter."""


STATE_OF_BODIES = (
    *("displacement", "velocity", "old_velocity", "impulse", "work"),
    *("ahead", "next", "external_force", "base_impulse", "base_work", "times", "velocities", "held"),
)
"""Arrays of the bodies that change during a run."""

LANES = 256
"""Threads of the one block that shares the joined places of contact on a GPU, Warp's own size of a block."""

IMPULSES = ("solid", "liquid", "alone", "rubbed", "inverse")
"""Arrays of the places of contact that a step leaves to the next."""

INTERVAL = ("begin", "reactions", "turned", "taken")
"""Parts of the mark of the last interval, as a state keeps them."""

ARRIVED = ("conveyed", "inflow")
"""Arrays of an inflow that change during a run."""

GROWTHS = 12
"""Times at most that a run with an inflow is captured anew, for more points."""

LOADS = ("taken", "turned")
"""Sums of the barrier's slots and surfaces since t = 0."""


def _check_names(bodies: Sequence[Body]) -> None:
    for kind, names in (
        ("body", [body.name for body in bodies]),
        ("surface", [surface.name for body in bodies for surface in body.surfaces]),
    ):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"name = {twice[0]!r} belongs to more than one {kind}; each needs a name of its own")


def _check_room(bodies: Sequence[Body], initial: MaterialPoints, spacing: float) -> None:
    for body in bodies:
        inside = int((body.outline.distance(initial.position) < -1e-9 * spacing).sum())
        if inside:
            raise ValueError(f"{body.name} holds {inside} material points of the flow; it must lie outside the flow")


LARGEST_FORCE = 1e15
"""Greatest force [N/m] that a caller may put on the barrier: far beyond any, and its arithmetic stays finite."""

LARGEST_VELOCITY = 1e4
"""Greatest velocity [m/s] at which a caller may drive the barrier, as in a scenario."""


def _out_of_range(name: str, value: float, largest: float, unit: str) -> str:
    return f"{name} = {value!r} is not allowed; it must be a number from {-largest:g} to {largest:g} {unit}"


P = ParamSpec("P")
R = TypeVar("R")

_WARP = threading.RLock()
"""Held around what Warp does for one thread at a time: to start, to build and load kernels, and to capture, during
which whatever another thread allocates or copies would be taken for part of the graph. Replaying a graph needs no
lock on the CPU; on a GPU all threads share one stream, so that there everything waits for its turn."""


def _one_thread_at_a_time(
    method: Callable[Concatenate[Simulation, P], R],
) -> Callable[Concatenate[Simulation, P], R]:
    @wraps(method)
    def alone(self: Simulation, *arguments: P.args, **named: P.kwargs) -> R:
        with _WARP:
            return method(self, *arguments, **named)

    return alone


def _one_thread_at_a_time_on_a_gpu(
    method: Callable[Concatenate[Simulation, P], R],
) -> Callable[Concatenate[Simulation, P], R]:
    @wraps(method)
    def alone(self: Simulation, *arguments: P.args, **named: P.kwargs) -> R:
        if self.device.is_cpu:
            return method(self, *arguments, **named)
        with _WARP:
            return method(self, *arguments, **named)

    return alone


@cache
def _start_warp() -> None:
    """Start Warp without its banner, and without its warning that a machine has no GPU, which is no fault of anyone's.

    Warp prints that from C to the file descriptor, so that is where it is caught; anything else is passed on, also
    what another thread writes at the same time.
    """
    wp.config.log_level = wp.LOG_WARNING
    if sys.stderr is None:  # a service, or Windows without a console: nothing is shown anyway
        initialize_warp()
        return
    sys.stderr.flush()
    stderr = os.dup(2)
    try:
        with tempfile.TemporaryFile() as caught:
            os.dup2(caught.fileno(), 2)
            try:
                initialize_warp()
            finally:
                os.dup2(stderr, 2)
            caught.seek(0)
            for line in caught:
                if b"Could not find or load the NVIDIA CUDA driver" not in line:
                    os.write(2, line)
    finally:
        os.close(stderr)


class Simulation:
    """Runs one scenario.

    >>> simulation = Simulation(Scenario.load("scenarios/case_1.json"))
    >>> simulation.advance(until=1.0)
    >>> simulation.points()["pore_pressure"].max()

    Threads may each make and run simulations of their own: making and preparing take turns, running goes on side by
    side on the CPU. One simulation belongs to one thread at a time.

    Args:
        scenario: what to simulate.
        device: a Warp device, "cpu" or "cuda:0".
        bodies: solid bodies beside those of the scenario, which the flow meets as well.
        channel: makes the scenario a section of it, and the simulation one in space; None: a simulation in the plane,
            per metre of width.

    Raises:
        ValueError: the device does not exist; the bodies are no scene's: two of one name, flow inside one of them; or
            what the scenario asks for is not there in space.
        MemoryError: the device, or this process, may not have what the scene needs.
    """

    @_one_thread_at_a_time
    def __init__(
        self,
        scenario: Scenario,
        *,
        device: str = "cpu",
        bodies: Sequence[Body] = (),
        channel: Channel | None = None,
    ) -> None:
        self.scenario = scenario
        self.channel = channel
        """The third dimension; None in the plane."""
        if channel is not None:
            channel.check(scenario, bodies)
        self.grid = fit_grid(scenario, [body.outline.vertices for body in bodies])
        self.bodies: tuple[Body, ...] = (*scene_bodies(scenario, self.grid), *bodies)
        if channel is not None:
            self.grid = channel.stacked(self.grid)
            self.bodies += tuple(channel.walls())
        """All that the flow meets, in the order in which they act on it."""
        _check_names(self.bodies)
        self.slots = slots_of(scenario, self.bodies)
        """The barrier's surfaces, divided; None without a barrier."""
        if self.slots is not None:
            self._patches = Patches.along(self.slots.face, scenario.output.pressure_patch_m)
        self.effects = derive_effects(scenario).with_bodies(effects_of(self.bodies))
        if channel is not None:
            self.effects = replace(self.effects, dimensions=3)
        _start_warp()
        try:
            self.device = wp.get_device(device)
        except ValueError:
            names = ", ".join(str(d) for d in wp.get_devices())
            raise ValueError(f"device = {device!r} does not exist here; it must be one of {names}") from None
        self._kernels = build_kernels(self.effects)
        self._types = self._kernels.types
        self._limits = step_limits(scenario)
        self.nominal_step = nominal_step(scenario)
        """The step [s] against which times are told apart: see `time_step.nominal_step`."""
        # One worker walks the list of blocks on the CPU; on a GPU there are as many as keep it busy.
        self._workers = 1 if self.device.is_cpu else 65536
        self._of_materials = [
            kernel_parameters(
                scenario.of_material(place),
                self.effects,
                self._types,
                bodies=self.bodies,
                grid=self.grid,
                limits=self._limits,
                workers=self._workers,
                liquid_density=getattr(scenario.flow.wettest, "liquid_density_kg_per_m3", 0.0),
            )
            for place in range(len(scenario.flow.materials))
        ]
        tell_nodes(self._of_materials, self._types)
        self._parameters = self._of_materials[0]
        self._kinds = [
            self.effects.kinds.index(kind_of(material)) if self.effects.kinds else 0
            for material in scenario.flow.materials
        ]
        """Of each material, its place among the kinds of kernels over points."""
        with memory_for(scenario):
            initial = material_points(scenario)
            if channel is not None:
                initial = channel.drawn(initial, scenario)
            _check_room(bodies, initial, self.grid.spacing)
            self.material_points = len(initial.volume)
            self._solid_mass, self._liquid_mass = initial.solid_mass, initial.liquid_mass
            self._material = initial.material
            self._make_arrays(initial)
        self._arguments: dict[str, Any] = self._clock_arrays | {
            "points": self._points,
            "grid": self._grid,
            "bodies": self._bodies,
            "contact": self._contact,
            "arrival": self._arrival,
            "parameters": self._parameters,
            "book": self._book,
        }
        self._entry = [
            initial.entry[part.begin : part.end][initial.waits[part.begin : part.end]] for part in initial.spans
        ]
        """Of each span, the ways at which its points that wait come."""
        self._counts = {"one": 1, "workers": self._workers}
        if self.effects.bodies:
            self._counts |= {"groups": len(self._contact_arrays["block"]), "lanes": 1 if self.device.is_cpu else LANES}
        self._graph: Any = None
        self._in_flow: list[tuple[int, int, int]] = []
        """Of each span, entries FLOW_... of what the kernels over the flow go over."""
        self._threads = [0] * len(self._spans)
        """Of each span, its points that `update` goes over."""
        self._make_room(0.0)
        self._on_launch: Callable[[str], None] | None = None
        self._commands: list[tuple[str, Any]] | None = None
        self._kernels_of_a_step: tuple[str, ...] = ()
        self._ledger_graph: Any = None
        self._barrier = next((number for number, body in enumerate(self.bodies) if body.name == BARRIER), None)
        further = {one.name for one in scenario.barriers}
        self._further = [number for number, body in enumerate(self.bodies) if body.name in further]
        self._quantities = sampled_quantities(scenario, self.bodies, self.effects.dimensions)
        self._since = self.window()
        """When the last call of `advance` that made a step began."""
        moving = (initial.velocity != 0.0).any(axis=1)
        mass = initial.solid_mass + initial.liquid_mass
        flow_mass = float(initial.solid_mass[moving].sum() + initial.liquid_mass[moving].sum())
        drawn = {"channel": asdict(channel)} if channel is not None else {}
        self._scene_mark = saved.scene_mark(scenario.resolved() | drawn)
        velocities = (*scenario.flow.velocity_m_per_s, 0.0)[: self.effects.dimensions]
        self._initial_momentum = [flow_mass * velocity for velocity in velocities]
        if scenario.flow.sheared:
            self._initial_momentum = (mass @ initial.velocity).tolist()
            self._fit_velocities(initial.position, mass, initial.velocity, initial.there)

    def _make_arrays(self, initial: MaterialPoints) -> None:
        scenario, effects, types, device = self.scenario, self.effects, self._types, self.device
        points = point_arrays(
            scenario,
            effects,
            types,
            initial,
            liquid_stiffness=self._stiffness_of_liquid(),
            device=device,
        )
        self._points, self._point_arrays = points.structure, points.arrays
        grid = grid_arrays(self.bodies, effects, types, self.grid, device=device)
        self._grid, self._grid_arrays = grid.structure, grid.arrays
        solid = body_arrays(self.bodies, effects, types, self.grid, scenario.gravity.vector, device=device)
        self._bodies, self._body_arrays = solid.structure, solid.arrays
        self._contact, self._contact_arrays = None, {}
        if effects.bodies:
            lanes = 1 if device.is_cpu else LANES
            contact = contact_arrays(
                self.bodies, effects, types, self.grid, slots=self.slots, lanes=lanes, device=device
            )
            self._contact, self._contact_arrays = contact.structure, contact.arrays
        self._arrival, self._arrival_arrays = None, {}
        if effects.arriving:
            arrival = arrival_arrays(scenario, types, device=device)
            self._arrival, self._arrival_arrays = arrival.structure, arrival.arrays
        surfaces = sum(len(body.surfaces) for body in self.bodies)
        self._clock_arrays = clock_arrays(scenario, effects, initial, surfaces=surfaces, device=device)
        self._spans = [
            (part, self._span_of(number, part, points if len(initial.spans) > 1 else None))
            for number, part in enumerate(initial.spans)
        ]
        self._book = self._spans[0][1]["book"]
        self._clock = self._clock_arrays["clock"]
        self._counters = self._clock_arrays["counters"]
        self._limiters = self._clock_arrays["limiters"]
        self._running = self._clock_arrays["running"]
        self._reactions = self._clock_arrays["reactions"]
        self._left = self._clock_arrays["left"]
        self._balance = self._clock_arrays["balance"]
        self._sums = self._clock_arrays["sums"]
        self._target = self._clock[at.TARGET : at.TARGET + 1]
        self._goes_on = self._running[at.GOES_ON : at.GOES_ON + 1]
        self._steps_left = self._running[at.STEPS_LEFT : at.STEPS_LEFT + 1]
        self._steps_at_once = max(1, FIRST_LOOK_UP // max(1, self.material_points))
        # On the CPU the host sees the device's own memory; elsewhere every look is a copy.
        self._seen = {}
        if device.is_cpu:
            watched = self._clock_arrays | self._body_arrays | self._arrival_arrays
            self._seen = {name: array.numpy() for name, array in watched.items()}
            self._seen |= {name: self._contact_arrays[name].numpy() for name in LOADS if name in self._contact_arrays}

    def _span_of(self, number: int, part: Span, points: Group | None) -> dict[str, Any]:
        """What kernels over the points of one material are launched with; without `points`, over all of them.

        Points of a material lie one after the other, and kernels go over one such span after the other, each with
        numbers that are the same for all of it: a loop that looked them up at each point would not be vectorised.
        """
        book = self._types.Book()
        for name in at.BOOK:
            setattr(book, name, self._clock_arrays[name])
        if points is None:
            return {"points": self._points, "parameters": self._parameters, "book": book}
        book.flow = self._clock_arrays["flow"][number * at.FLOW_SIZE : (number + 1) * at.FLOW_SIZE]
        own = span_of(points, self._types, part.begin, part.end)
        return {"points": own, "parameters": self._of_materials[part.material], "book": book}

    # -- stepping ----------------------------------------------------------------------------------------------

    def _launch(self, launch: Launch, dim: int, arguments: Sequence[Any], kernels: Any = None) -> None:
        kernel, kept = getattr(kernels or self._kernels, launch.kernel), self._commands is not None
        command = wp.launch(kernel, dim=dim, inputs=list(arguments), device=self.device, record_cmd=kept)
        if self._commands is not None and command is not None:  # of no threads there is none
            self._commands.append((launch.kernel, command))
        if self._on_launch is not None:
            self._on_launch(launch.kernel)

    def _step(self) -> None:
        for launch in launches(self.effects):
            if launch.over in ("points", "flow"):
                self._launch_over_points(launch)
            else:
                self._launch(launch, self._counts[launch.over], [self._arguments[name] for name in launch.takes])

    def _launch_over_points(self, launch: Launch) -> None:
        """Once for each span of points of one material, as far as they can have arrived."""
        for (part, own), count in zip(self._spans, self._threads, strict=True):
            arguments = self._arguments | own
            kernels = self._kernels.of_kinds[self._kinds[part.material]]
            flow = self._in_turn(count) if count else 0
            threads = {"workers": self._workers, "flow": flow}.get(launch.over, count)
            if threads > 0 and hasattr(kernels, launch.kernel):  # some are only another kind's
                self._launch(launch, threads, [arguments[name] for name in launch.takes], kernels)

    def _in_turn(self, count: int) -> int:
        """Threads of a kernel over the flow, for so many points."""
        return 1 if self.device.is_cpu else count

    def _start(self) -> None:
        self._launch(START, 1, [self._arguments[name] for name in START.takes])

    def _interval(self) -> None:
        self._start()
        wp.capture_while(self._goes_on, self._step)

    def _sum_up(self) -> None:
        self._sums.zero_()
        self._launch_over_points(LEDGER)

    def _make_room(self, until: float) -> None:
        """Let the kernels go over all points that may have arrived by a time [s]: those that wait cost nothing.

        Those over the flow are told how many these are. `update` has a thread for each point, so that it is captured
        anew, for some more points at a time.
        """
        inflow = self.scenario.flow.inflow
        # On the device the way is summed up in other pieces.
        way = inflow.way(until) + 1e-6 * self.grid.spacing if inflow is not None else 0.0
        share = max(1, -(-sum(map(len, self._entry)) // GROWTHS))
        before = self._in_flow or [(0, 0, 0)] * len(self._spans)
        state = self._point_arrays["inside"].numpy() if inflow is not None else None
        ends, arriving, threads = [], [], []
        for (part, _), entry, (_, begin, _), so_far in zip(
            self._spans, self._entry, before, self._threads, strict=True
        ):
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
            self._threads, self._counts["points"] = threads, sum(threads)
            self._graph = None
        step = self._in_turn(max(threads))
        in_flow = [(end, begin, step) for end, begin in zip(ends, arriving, strict=True)]
        if in_flow != self._in_flow:
            self._in_flow = in_flow
            self._fill(self._clock_arrays["flow"], np.array(in_flow, dtype=np.int32).ravel())

    def prepare(self) -> None:
        """Compile the kernels, or find them compiled, and capture an interval; the first step does so otherwise."""
        if self._graph is None:
            names: list[str] = []
            self._on_launch = names.append
            self._graph = self._captured(self._interval)
            self._on_launch = None
            self._kernels_of_a_step = tuple(dict.fromkeys(names[1:]))  # the first one starts the interval

    @_one_thread_at_a_time
    def _captured(self, launches: Callable[[], None]) -> Any:
        """A graph of the launches, which replays for a hundredth of what they cost one by one."""
        for name in self.effects.module_names:
            load_kernels(name, self.device)
        with wp.ScopedCapture(device=self.device) as capture:
            launches()
        return capture.graph

    @property
    def launched_kernels(self) -> tuple[str, ...]:
        """Names of the kernels that a step launches, in their order, as captured; the first call compiles them. Those
        over points are launched once for each span of points of one material."""
        self.prepare()
        return self._kernels_of_a_step

    @property
    def arrays(self) -> dict[str, int]:
        """Every array that the simulation holds on the device, by name, with its bytes."""
        groups = {"points": self._point_arrays, "grid": self._grid_arrays, "bodies": self._body_arrays}
        groups |= {"contact": self._contact_arrays, "arrival": self._arrival_arrays}
        held = {f"{group}.{name}": array for group, arrays in groups.items() for name, array in arrays.items()}
        return {name: int(array.capacity) for name, array in (held | self._clock_arrays).items()}

    @property
    def blocks_in_use(self) -> float:
        """Share of the grid's blocks that held material in the last step; all that the grid costs is theirs."""
        return float(self._grid_arrays["active_count"].numpy()[0]) / self._grid_arrays["block"].size

    @_one_thread_at_a_time_on_a_gpu
    def advance(self, until: float, *, stop: Callable[[], bool] = lambda: False) -> None:
        """Run to the time `until` [s], exactly.

        Times that differ by less than a thousandth of a nominal step (`time_step.ONE_TIME`) are one time: no step is
        made then, and `time` is `until`. What is left out is made up for by the next step.

        The device hands back about every quarter of a second, between two steps, so that Ctrl-C is heard. That changes
        no step: whoever goes on to the same time gets the numbers, bit for bit, of a run without a break.

        Args:
            until: [s].
            stop: asked whenever the device hands back; true leaves the simulation at the time that it has reached.

        Raises:
            ValueError: `until` lies in the past or is not finite.
            SimulationDiverged: a quantity is no longer finite or sensible.
        """
        if not math.isfinite(until) or until < self.time:
            raise ValueError(f"until = {until} must be finite and at least the present time {self.time:g} s")
        self._make_room(until)
        self.prepare()
        self._fill(self._target, until)
        if until - self._clock_entry(at.TIME) < ONE_TIME * self.nominal_step:
            return
        since = self.window()
        while True:
            before, begin = self.steps, time.perf_counter()
            self._fill(self._steps_left, self._steps_at_once)
            wp.capture_launch(self._graph)
            counters = self._read("counters")  # waits for the device
            self._since = since
            if int(counters[at.DIVERGED]):
                raise SimulationDiverged(self._what_diverged())
            if int(counters[at.STEPS]) < before + self._steps_at_once or self.time >= until or stop():
                return
            rate = self._steps_at_once / (time.perf_counter() - begin)
            self._steps_at_once = max(1, min(int(rate * LOOK_UP), MOST_STEPS_AT_ONCE))

    @_one_thread_at_a_time
    def kernel_times(self, until: float) -> dict[str, float]:
        """Run to the time `until` [s] with every kernel launched on its own, and tell the wall time [s] of each.

        Launches are prepared beforehand; what is left of their own cost, a few microseconds, is that of `forget`, which
        does next to nothing. The CPU waits for each launch, so that its time is its own.
        """
        self._make_room(until)
        self._fill(self._target, until)
        self._fill(self._steps_left, MOST_STEPS_AT_ONCE)
        self._commands = []
        self._start()
        self._step()
        (_, start), *commands = self._commands
        self._commands = None
        start.launch()
        spent = dict.fromkeys((name for name, _ in commands), 0.0)
        while int(self._read("running")[at.GOES_ON]):
            for name, command in commands:
                begin = time.perf_counter()
                command.launch()
                wp.synchronize_device(self.device)
                spent[name] += time.perf_counter() - begin
        return spent

    def _what_diverged(self) -> str:
        names = diverging(self.effects)
        return what_diverged(
            {name: self._point_arrays[name].numpy() for name in names if name in self._point_arrays},
            names,
            time=self.time,
            steps=self.steps,
            barrier_velocity=self.barrier_velocity or 0.0,
            numerics=self.scenario.numerics,
        )

    @_one_thread_at_a_time
    def set_points(self, **state: NDArray[np.float64]) -> None:
        """Replace part of the initial state; only before the first step.

        Args:
            state: any of `solid_velocity`, `liquid_velocity` [N, 2] m/s (the latter with two phases only),
                `effective_stress` [N, 4] Pa (xx, yy, zz, xy, tension positive) and `pore_pressure` [N] Pa
                (compression positive), in the order of `points()`.

        Raises:
            ValueError: the run has begun, or a field is unknown here, of another shape or not finite.
        """
        if any(map(len, self._entry)):
            raise ValueError("set_points knows no flow that arrives (flow.inflow)")
        if self.channel is not None and not {"solid_velocity", "liquid_velocity"}.isdisjoint(state):
            raise ValueError("set_points knows no velocities in three dimensions yet")
        if self.steps > 0:
            raise ValueError("set_points changes the initial state; this simulation has made steps already")
        now = self.points()
        allowed = {"solid_velocity", "liquid_velocity", "effective_stress", "pore_pressure"} & set(now)
        for name, values in state.items():
            if name not in allowed:
                raise ValueError(f"set_points knows no {name} in this scene; it can set {', '.join(sorted(allowed))}")
            if np.shape(values) != now[name].shape or not np.isfinite(values).all():
                raise ValueError(f"set_points needs finite {name} of shape {now[name].shape}, not {np.shape(values)}")
        now |= state
        velocity, solid, liquid = now["solid_velocity"], now["solid_mass"], now["liquid_mass"]
        momentum = (solid + liquid) @ velocity
        if self.effects.two_phase:
            momentum = solid @ velocity + liquid @ now["liquid_velocity"]
            velocity = np.concatenate([velocity, now["liquid_velocity"]], axis=1)
        self._initial_momentum = momentum.tolist()
        self._point_arrays["velocity"].assign(velocity)
        if not {"solid_velocity", "liquid_velocity"}.isdisjoint(state):
            self._fit_velocities(now["position"], solid + liquid, velocity, len(velocity))
        self._point_arrays["stress"].assign(now["effective_stress"])
        if self.effects.liquid:
            self._point_arrays["liquid_strain"].assign(-now["pore_pressure"] / self._stiffness_of_liquid())
        clock = self._clock.numpy()
        clock[at.SPEED_MAX] = (velocity.reshape(-1, self.effects.dimensions) ** 2).sum(axis=1).max()
        self._clock.assign(clock)
        if self.effects.two_phase:
            balance = self._balance.numpy()
            slip = liquid @ (now["liquid_velocity"] - now["solid_velocity"])
            balance[at.SEEPAGE_POWER_BEFORE] = slip[:2] @ np.array(self.scenario.gravity.vector)
            self._balance.assign(balance)

    def _fit_velocities(
        self, position: NDArray[np.float64], mass: NDArray[np.float64], velocity: NDArray[np.float64], there: int
    ) -> None:
        """Begin the transfer scheme's own point fields with the velocities [N, ...] of the points [N, 2], of which the
        first `there` are there."""
        places = (position[:there] - [self._parameters.left, self._parameters.bottom]) / self.grid.spacing
        phases = self._types.components // velocity.shape[1]
        given = np.tile(velocity[:there], (1, phases))
        for name, values in self.effects.scheme.fitted(places, self.grid.spacing, mass[:there], given).items():
            rest = np.zeros((len(velocity) - there, values.shape[1]))
            self._point_arrays[name].assign(np.concatenate([values, rest]))

    # -- state -------------------------------------------------------------------------------------------------

    @_one_thread_at_a_time_on_a_gpu
    def _read(self, name: str) -> NDArray[Any]:
        """Present numbers of clock, bodies, counters or sums; on the CPU they go on changing with the run."""
        if name in self._seen:
            return self._seen[name]
        for arrays in (self._body_arrays, self._contact_arrays, self._arrival_arrays):
            if name in arrays:
                return arrays[name].numpy()
        return self._clock_arrays[name].numpy()

    def _fill(self, array: Any, value: float | tuple[float, float] | NDArray[np.int32]) -> None:
        """Set all of an array on the device; on the CPU behind Warp's back, which may be at work for another thread."""
        if self.device.is_cpu:
            array.numpy()[...] = value
            return
        with _WARP:
            array.assign(value) if isinstance(value, np.ndarray) else array.fill_(value)

    def _clock_entry(self, entry: int) -> float:
        return float(self._read("clock")[entry])

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        reached, asked = self._clock_entry(at.TIME), self._clock_entry(at.TARGET)
        return asked if 0.0 <= asked - reached < ONE_TIME * self.nominal_step else reached

    @property
    def steps(self) -> int:
        """Time steps so far."""
        return int(self._read("counters")[at.STEPS])

    @property
    def barrier_displacement(self) -> float | None:
        """Displacement of the barrier [m]; None without a barrier."""
        return self.body_displacement(BARRIER)[0] if self._barrier is not None else None

    @property
    def barrier_velocity(self) -> float | None:
        """Velocity of the barrier [m/s]; None without a barrier."""
        return self.body_velocity(BARRIER)[0] if self._barrier is not None else None

    def body_displacement(self, name: str) -> tuple[float, float]:
        """Displacement of a body along x and y since t = 0 [m].

        Raises:
            ValueError: there is no such body.
        """
        return self._of_body("displacement", name)

    def body_velocity(self, name: str) -> tuple[float, float]:
        """Velocity of a body along x and y [m/s].

        Raises:
            ValueError: there is no such body.
        """
        return self._of_body("velocity", name)

    def _of_body(self, field: str, name: str) -> tuple[float, float]:
        names = [body.name for body in self.bodies]
        if name not in names:
            raise ValueError(f"there is no body {name!r} in this scene; it has {', '.join(names) or 'none'}")
        if not self.effects.moving:
            return 0.0, 0.0
        x, y = self._read(field)[names.index(name)]
        return float(x), float(y)

    def _number_of(self, body: int, field: str) -> float:
        return float(self._read(field)[body]) if field in self._body_arrays else 0.0

    def set_barrier_velocity(self, velocity: float) -> None:
        """Drive the barrier at `velocity` [m/s] from now on; only for a barrier with prescribed motion.

        Raises:
            ValueError: the barrier is not driven, or the velocity is no number from -10,000 to 10,000.
        """
        if self._barrier is None or not isinstance(self.bodies[self._barrier].motion, Driven):
            raise ValueError("set_barrier_velocity needs a barrier whose motion is of the kind 'prescribed'")
        if not abs(velocity) <= LARGEST_VELOCITY:
            raise ValueError(_out_of_range("velocity", velocity, LARGEST_VELOCITY, "m/s"))
        first, last = (int(place) for place in self._body_arrays["first_time"].numpy()[self._barrier :][:2])
        self._fill(self._body_arrays["velocities"][first:last], (float(velocity), 0.0))

    def set_external_force(self, force: float) -> None:
        """Horizontal force [N/m] on a sliding barrier from now on, positive downstream.

        Raises:
            ValueError: the barrier does not slide, or the force is no number from -1e15 to 1e15.
        """
        if self._barrier is None or not isinstance(self.bodies[self._barrier].motion, Sliding):
            raise ValueError("set_external_force needs a barrier whose motion is of the kind 'sliding'")
        if not abs(force) <= LARGEST_FORCE:
            raise ValueError(_out_of_range("force", force, LARGEST_FORCE, of_width("N")))
        self._fill(self._body_arrays["external_force"][self._barrier : self._barrier + 1], float(force))

    @_one_thread_at_a_time_on_a_gpu
    def points(self, names: Collection[str] | None = None) -> dict[str, NDArray[np.float64]]:
        """State of the N material points still in the domain, as float64 arrays in SI units: all, or what is named.

        `position`, `solid_velocity`, `liquid_velocity` [N, 2] (the last with two phases only); `effective_stress`
        [N, 4] (xx, yy, zz, xy, tension positive); `pore_pressure` (compression positive; not if dry), `porosity`,
        `deviatoric_strain` (cumulative), `volume`, `solid_mass`, `liquid_mass` [N], and `material` where there are
        several. What the law or the transfer scheme
        keeps at a point besides, and has a meaning for, comes when it is named. In space vectors are [N, 3], and
        stresses [N, 6] (yz and xz besides).
        """
        inside = self._point_arrays["inside"].numpy() == at.INSIDE
        rows = slice(None) if inside.all() else inside

        @cache
        def stored(name: str) -> NDArray[np.float64]:
            return self._point_arrays[name].numpy()[rows].astype(np.float64)

        def grains() -> NDArray[np.float64]:
            return (1.0 - own("porosity")) * stored("reference_volume")

        def own(name: str) -> NDArray[np.float64]:
            return self._of_each(name)[rows]

        def porosity() -> NDArray[np.float64]:
            if self.effects.porosity_update or self.effects.dilatancy:
                return np.maximum(1.0 - grains() / stored("volume"), LEAST_POROSITY)
            return own("porosity")

        quantities: dict[str, Callable[[], NDArray[np.float64]]] = {
            "position": lambda: stored("position"),
            "solid_velocity": lambda: stored("velocity")[:, : self.effects.dimensions],
            "effective_stress": lambda: stored("stress"),
            "deviatoric_strain": lambda: stored("deviatoric_strain"),
            "volume": lambda: np.maximum(stored("volume"), grains()),
            "solid_mass": lambda: self._solid_mass[inside],
            "liquid_mass": lambda: self._liquid_mass[inside],
            "porosity": porosity,
        }
        if len(self._of_materials) > 1:
            quantities["material"] = lambda: self._material[inside].astype(np.float64)
        if self.effects.two_phase:
            quantities["liquid_velocity"] = lambda: stored("velocity")[:, self.effects.dimensions :]
        if self.effects.liquid:
            quantities["pore_pressure"] = lambda: np.maximum(
                -own("liquid_bulk_modulus_Pa") * stored("liquid_strain"), -own("cavitation_pressure_Pa")
            )
        shown = quantities if names is None else names
        kept = self.effects.point_fields
        return {name: stored(name) if name in kept else quantities[name]() for name in shown}

    def _stiffness_of_liquid(self) -> NDArray[np.float64]:
        """Bulk modulus of each point's liquid [N] [Pa]; infinite where there is none, which bears no pressure."""
        modulus = self._of_each("liquid_bulk_modulus_Pa")
        return np.where(modulus > 0.0, modulus, math.inf)

    def _of_each(self, name: str) -> NDArray[np.float64]:
        """A field of each point's material [N]; 0 where that has none."""
        return np.array([getattr(own, name, 0.0) for own in self.scenario.flow.materials])[self._material]

    def window(self) -> Window:
        """A mark of the present time, since which `sample` can tell mean forces. It belongs to the caller.

        Pressures on a patch are means over `output.pressure_patch_s`: where that is longer than the caller's intervals,
        `Window.after` keeps what is needed of the marks before.
        """
        if self._barrier is None:
            return Window(self._clock_entry(at.TIME), self._read("reactions").tolist())
        return Window(
            self._clock_entry(at.TIME),
            self._read("reactions").tolist(),
            self._number_of(self._barrier, "base_impulse"),
            self._read("turned").tolist(),
            self._read("taken").copy(),
            reach=self.scenario.output.pressure_patch_s,
        )

    @_one_thread_at_a_time_on_a_gpu
    def sample(self, names: Collection[str] | None = None, *, since: Window | None = None) -> dict[str, float]:
        """Quantities now, and forces as means since a time: impulse over interval. Looking changes nothing.

        Keys without the effect they belong to are absent. Sums over the material points are formed only if one of them
        is named.

        Args:
            names: what is wanted beside the time; None: all.
            since: a mark from `window`; None: when the last call of `advance` that made a step began.

        Raises:
            SimulationDiverged: some quantity of a material point, or of the sample, is not a finite number; not every
                point is looked at where no sum over them is formed.
        """
        wanted = wanted_quantities(self._quantities, names)
        sums = [0.0] * at.LEDGER_SIZE
        if any(quantity.of_points for quantity in wanted):
            if self._ledger_graph is None:
                self._ledger_graph = self._captured(self._sum_up)
            wp.capture_launch(self._ledger_graph)
            sums = self._read("sums").tolist()
            if sums[at.LEDGER_NOT_FINITE] > 0.0:
                raise SimulationDiverged(self._what_diverged())
        now = self._now(self.window(), self._since if since is None else since, sums)
        values = {}
        for quantity in wanted:
            values[quantity.key] = value = float(quantity.read(now))
            if not math.isfinite(value):
                if quantity.key in OWN:
                    raise ValueError(
                        f"the quantity {quantity.key} is {value:g} at t = {self.time:.6g} s; it must be a finite number"
                    )
                raise SimulationDiverged(
                    what_is_no_number(quantity.key, value, time=self.time, steps=self.steps, scenario=self.scenario)
                )
        return values if names is None else {key: values[key] for key in values if key == "time" or key in names}

    def _motion_of(self, number: int) -> BarrierNow:
        body = self.bodies[number]
        return BarrierNow(
            self.body_displacement(body.name)[0],
            self.body_velocity(body.name)[0],
            self._number_of(number, "work"),
            self._number_of(number, "base_work"),
            body.motion.mass if isinstance(body.motion, Sliding) else 0.0,
        )

    def _now(self, now: Window, since: Window, sums: Sequence[float]) -> Now:
        barrier = self._motion_of(self._barrier) if self._barrier is not None else BarrierNow()
        forces, base_force = mean_forces(self.bodies, now, since)
        loads = (
            None if self.slots is None else LoadsNow(self.scenario, self.bodies, self.slots, self._patches, now, since)
        )
        return Now(
            scenario=self.scenario,
            bodies=self.bodies,
            barrier=barrier,
            further={self.bodies[number].name: self._motion_of(number) for number in self._further},
            time=self.time,
            time_step=self._clock_entry(at.TIME_STEP),
            elapsed=now.time - since.time,
            forces=forces,
            base_force=base_force,
            loads=loads,
            impulses=now.reactions,
            initial_momentum=self._initial_momentum,
            points=self.points,
            sums=sums,
            departed=self._read("left").tolist(),
            balanced=self._read("balance").tolist(),
            **({"arrived": self._read("inflow").tolist()} if self.effects.arriving else {}),
        )

    @property
    def units(self) -> dict[str, str]:
        """Unit of each quantity of a sample, by its key: per metre of width in the plane, of the whole in space."""
        return {key: quantity.unit for key, quantity in self._quantities.items()}

    @property
    def record(self) -> dict[str, Any]:
        """What ruled the run: counts of the limits on the time step, of barrier iterations, of points that left, and of
        the points on which a limiter acted, once per step and point."""
        counters, clock, limiters = self._read("counters"), self._read("clock"), self._read("limiters")
        return {
            "steps": int(counters[at.STEPS]),
            "steps_limited_by_wave": int(counters[at.LIMIT_WAVE]),
            "steps_limited_by_drag": int(counters[at.LIMIT_DRAG]),
            "steps_limited_by_law": int(counters[at.LIMIT_LAW]),
            "steps_limited_by_output": int(counters[at.LIMIT_OUTPUT]),
            "time_step_min": float(clock[at.SMALLEST_TIME_STEP]),
            "time_step_max": float(clock[at.LARGEST_TIME_STEP]),
            "barrier_iterations": int(counters[at.BARRIER_ITERATIONS]),
            "barrier_unconverged": int(counters[at.BARRIER_UNCONVERGED]),
            "points_left": int(counters[at.POINTS_LEFT]),
            "points_pushed_out": int(counters[at.POINTS_PUSHED]),
            "gaps_bounded": int(limiters[at.GAPS_BOUNDED]),
            "voids_closed": int(limiters[at.VOIDS_CLOSED]),
        }

    def _state_arrays(self) -> dict[str, Any]:
        arrays = {f"points.{name}": array for name, array in self._point_arrays.items()}
        # Corner sums and the rest of the grid are rebuilt every step; only the blocks in use are remembered.
        arrays |= {
            "clock": self._clock,
            "counters": self._counters,
            "limiters": self._limiters,
            "reactions": self._reactions,
            "left": self._left,
            "balance": self._balance,
            "grid.shift": self._grid_arrays["shift"],
        }
        if self.slots is not None:
            arrays |= {f"contact.{name}": self._contact_arrays[name] for name in LOADS}
        arrays |= {f"arrival.{name}": self._arrival_arrays[name] for name in ARRIVED if name in self._arrival_arrays}
        arrays |= {f"bodies.{name}": array for name, array in self._body_arrays.items() if name in STATE_OF_BODIES}
        if self.effects.joined:
            # Their impulses begin with those of the step before. Places that stand alone begin with none; how many they
            # are depends on the grid, which is larger for a later end.
            contact = self._contact_arrays
            joined = int(contact["colour"].numpy()[0])
            arrays["contact.last"] = contact["last"]
            arrays |= {f"contact.{name}": contact[name][joined:] for name in IMPULSES if name in contact}
        return arrays

    @_one_thread_at_a_time_on_a_gpu
    def save_state(self) -> bytes:
        """Everything that the run needs to go on, bit for bit (on the CPU)."""
        return saved.packed(self._state())

    @_one_thread_at_a_time
    def restore_state(self, data: bytes) -> None:
        """Go back to a state from `save_state` of a simulation of the same scenario.

        Raises:
            ValueError: the state belongs to another scene or is damaged; nothing was changed.
        """
        state = saved.unpacked(data, self._state())
        for name, array in self._state_arrays().items():
            array.assign(state[name])
        self._in_flow = []  # found anew
        self._initial_momentum = state["initial_momentum"].tolist()
        (begin, base_impulse), reactions, turned, taken = (state[f"interval.{name}"] for name in INTERVAL)
        self._since = replace(
            self.window(),
            time=float(begin),
            base_impulse=float(base_impulse),
            reactions=reactions.tolist(),
            turned=turned.tolist(),
            taken=taken.copy(),
        )

    def _state(self) -> dict[str, NDArray[Any]]:
        state = {name: array.numpy() for name, array in self._state_arrays().items()}
        kept: dict[str, Any] = {"initial_momentum": self._initial_momentum, "scene": self._scene_mark}
        since = self._since
        numbers = ([since.time, since.base_impulse], since.reactions, since.turned, since.taken)
        kept |= {f"interval.{name}": values for name, values in zip(INTERVAL, numbers, strict=True)}
        return state | {name: np.array(values) for name, values in kept.items()}
