"""A simulation: state on the device and the captured steps that advance it. It knows nothing of files."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .channel import Channel
from .discretization import MaterialPoints, material_points
from .effect_rules import derive_effects
from .grid import fit_grid
from .kernels import layout as at
from .kernels.build import build_kernels
from .kernels.quiet_start import start_warp
from .kernels.turns import one_thread_at_a_time, one_thread_at_a_time_on_a_gpu
from .quantities.quantity import of_width
from .quantities.time_series import OWN
from .scenario import Scenario
from .simulator.bodies import Body, Driven, Sliding
from .simulator.bodies.arrays import effects_of
from .simulator.bodies.loads import Patches, slots_of
from .simulator.bodies.of_scene import BARRIER, scene_bodies
from .state import saved
from .state.arrays import memory_for
from .state.divergence import SimulationDiverged, diverging, what_diverged, what_is_no_number
from .state.initial import check_given, fit_velocities, set_points
from .state.loads import LoadsNow
from .state.on_device import OnDevice
from .state.parameters import kernel_parameters, tell_nodes
from .state.points import PointsNow, stiffness_of_liquid
from .state.samples import BarrierNow, Now, Window, mean_forces, sampled_quantities, wanted_quantities
from .stepping import MOST_STEPS_AT_ONCE, Stepping
from .time_step import ONE_TIME, nominal_step, step_limits

__all__ = ["Simulation", "SimulationDiverged"]

LOOK_UP = 0.25
"""Wall time [s] after which the device hands back to the host, which then hears Ctrl-C; a step is never cut."""

FIRST_LOOK_UP = 100_000
"""Steps times material points until the first time, when nothing has been timed: some hundredths of a second."""

INTERVAL = ("begin", "reactions", "turned", "taken")
"""Parts of the mark of the last interval, as a state keeps them."""


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

    @one_thread_at_a_time
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
        """The surfaces of each barrier, divided, by its name."""
        length = scenario.output.pressure_patch_m
        self._patches = {name: Patches.along(slots.face, length) for name, slots in self.slots.items()}
        self.effects = derive_effects(scenario).with_bodies(effects_of(self.bodies))
        if channel is not None:
            self.effects = replace(self.effects, dimensions=3)
        start_warp()
        try:
            self.device = wp.get_device(device)
        except ValueError:
            names = ", ".join(str(d) for d in wp.get_devices())
            raise ValueError(f"device = {device!r} does not exist here; it must be one of {names}") from None
        kernels = build_kernels(self.effects)
        self._types = kernels.types
        self._limits = step_limits(scenario)
        self.nominal_step = nominal_step(scenario)
        """The step [s] against which times are told apart: see `time_step.nominal_step`."""
        # One worker walks the list of blocks on the CPU; on a GPU there are as many as keep it busy.
        workers = 1 if self.device.is_cpu else 65536
        of_materials = [
            kernel_parameters(
                scenario.of_material(place),
                self.effects,
                self._types,
                bodies=self.bodies,
                grid=self.grid,
                limits=self._limits,
                workers=workers,
                liquid_density=getattr(scenario.flow.wettest, "liquid_density_kg_per_m3", 0.0),
            )
            for place in range(len(scenario.flow.materials))
        ]
        tell_nodes(of_materials, self._types)
        self._parameters = of_materials[0]
        with memory_for(scenario):
            initial = material_points(scenario)
            if channel is not None:
                initial = channel.drawn(initial, scenario)
            _check_room(bodies, initial, self.grid.spacing)
            self.material_points = len(initial.volume)
            self._held = OnDevice(
                scenario,
                self.effects,
                self._types,
                self.grid,
                initial,
                bodies=self.bodies,
                slots=self.slots.values(),
                liquid_stiffness=stiffness_of_liquid(scenario, initial.material),
                of_materials=of_materials,
                device=self.device,
            )
        self._point_arrays, self._grid_arrays = self._held.points, self._held.nodes
        self._body_arrays, self._contact_arrays = self._held.bodies, self._held.contact
        self._clock = self._held.clock["clock"]
        self._read, self._fill, self._clock_entry = self._held.read, self._held.fill, self._held.clock_entry
        self._stepping = Stepping(scenario, self._held, kernels, initial, workers=workers)
        self._steps_at_once = max(1, FIRST_LOOK_UP // max(1, self.material_points))
        self._points_now = PointsNow(
            scenario, self.effects, self._point_arrays, initial.solid_mass, initial.liquid_mass, initial.material
        )
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
            fit_velocities(self._held, initial.position, mass, initial.velocity, initial.there)

    # -- stepping ----------------------------------------------------------------------------------------------

    def prepare(self) -> None:
        """Compile the kernels, or find them compiled, and capture an interval; the first step does so otherwise."""
        self._stepping.prepare()

    @property
    def launched_kernels(self) -> tuple[str, ...]:
        """Names of the kernels that a step launches, in their order, as captured; the first call compiles them. Those
        over points are launched once for each span of points of one material."""
        self.prepare()
        return self._stepping.kernels_of_a_step

    @property
    def arrays(self) -> dict[str, int]:
        """Every array that the simulation holds on the device, by name, with its bytes."""
        return {name: int(array.capacity) for name, array in self._held.by_name.items()}

    @property
    def blocks_in_use(self) -> float:
        """Share of the grid's blocks that held material in the last step; all that the grid costs is theirs."""
        return float(self._grid_arrays["active_count"].numpy()[0]) / self._grid_arrays["block"].size

    @one_thread_at_a_time_on_a_gpu
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
        self._stepping.make_room(until)
        self.prepare()
        self._fill(self._stepping.target, until)
        if until - self._clock_entry(at.TIME) < ONE_TIME * self.nominal_step:
            return
        since = self.window()
        while True:
            before, begin = self.steps, time.perf_counter()
            self._fill(self._stepping.steps_left, self._steps_at_once)
            self._stepping.go()
            counters = self._read("counters")  # waits for the device
            self._since = since
            if int(counters[at.DIVERGED]):
                raise SimulationDiverged(self._what_diverged())
            if int(counters[at.STEPS]) < before + self._steps_at_once or self.time >= until or stop():
                return
            rate = self._steps_at_once / (time.perf_counter() - begin)
            self._steps_at_once = max(1, min(int(rate * LOOK_UP), MOST_STEPS_AT_ONCE))

    @one_thread_at_a_time
    def kernel_times(self, until: float) -> dict[str, float]:
        """Run to the time `until` [s] with every kernel launched on its own, and tell the wall time [s] of each.

        Launches are prepared beforehand; what is left of their own cost, a few microseconds, is that of `forget`, which
        does next to nothing. The CPU waits for each launch, so that its time is its own.
        """
        self._stepping.make_room(until)
        self._fill(self._stepping.target, until)
        return self._stepping.kernel_times()

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

    @one_thread_at_a_time
    def set_points(self, **state: NDArray[np.float64]) -> None:
        """Replace part of the initial state; only before the first step.

        Args:
            state: any of `solid_velocity`, `liquid_velocity` [N, 2] m/s (the latter with two phases only),
                `effective_stress` [N, 4] Pa (xx, yy, zz, xy, tension positive) and `pore_pressure` [N] Pa
                (compression positive), in the order of `points()`.

        Raises:
            ValueError: the run has begun, or a field is unknown here, of another shape or not finite.
        """
        if any(map(len, self._stepping.entry)):
            raise ValueError("set_points knows no flow that arrives (flow.inflow)")
        if self.channel is not None and not {"solid_velocity", "liquid_velocity"}.isdisjoint(state):
            raise ValueError("set_points knows no velocities in three dimensions yet")
        if self.steps > 0:
            raise ValueError("set_points changes the initial state; this simulation has made steps already")
        now = self.points()
        check_given(state, now)
        self._initial_momentum = set_points(
            self._held,
            now | state,
            moved=not {"solid_velocity", "liquid_velocity"}.isdisjoint(state),
            liquid_stiffness=stiffness_of_liquid(self.scenario, self._points_now.material),
            gravity=self.scenario.gravity.vector,
        )

    # -- state -------------------------------------------------------------------------------------------------

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

    @one_thread_at_a_time_on_a_gpu
    def points(self, names: Collection[str] | None = None) -> dict[str, NDArray[np.float64]]:
        """State of the N material points still in the domain, as float64 arrays in SI units: all, or what is named.

        `position`, `solid_velocity`, `liquid_velocity` [N, 2] (the last with two phases only); `effective_stress`
        [N, 4] (xx, yy, zz, xy, tension positive); `pore_pressure` (compression positive; not if dry), `porosity`,
        `deviatoric_strain` (cumulative), `volume`, `solid_mass`, `liquid_mass` [N], and `material` where there are
        several. What the law or the transfer scheme
        keeps at a point besides, and has a meaning for, comes when it is named. In space vectors are [N, 3], and
        stresses [N, 6] (yz and xz besides).
        """
        return self._points_now.read(names)

    def window(self) -> Window:
        """A mark of the present time, since which `sample` can tell mean forces. It belongs to the caller.

        Pressures on a patch are means over `output.pressure_patch_s`: where that is longer than the caller's intervals,
        `Window.after` keeps what is needed of the marks before.
        """
        if not self.slots:
            return Window(self._clock_entry(at.TIME), self._read("reactions").tolist())
        return Window(
            self._clock_entry(at.TIME),
            self._read("reactions").tolist(),
            self._held.number_of(self._barrier, "base_impulse") if self._barrier is not None else 0.0,
            self._read("turned").tolist(),
            self._read("taken").copy(),
            reach=self.scenario.output.pressure_patch_s,
        )

    @one_thread_at_a_time_on_a_gpu
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
            sums = self._stepping.sums()
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
            self._held.number_of(number, "work"),
            self._held.number_of(number, "base_work"),
            body.motion.mass if isinstance(body.motion, Sliding) else 0.0,
        )

    def _now(self, now: Window, since: Window, sums: Sequence[float]) -> Now:
        barrier = self._motion_of(self._barrier) if self._barrier is not None else BarrierNow()
        forces, base_force = mean_forces(self.bodies, now, since)
        loads = {
            name: LoadsNow(self.scenario, self.bodies, slots, self._patches[name], now, since)
            for name, slots in self.slots.items()
        }
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
            loads=loads.get(BARRIER),
            loads_on=loads,
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

    @one_thread_at_a_time_on_a_gpu
    def save_state(self) -> bytes:
        """Everything that the run needs to go on, bit for bit (on the CPU)."""
        return saved.packed(self._state())

    @one_thread_at_a_time
    def restore_state(self, data: bytes) -> None:
        """Go back to a state from `save_state` of a simulation of the same scenario.

        Raises:
            ValueError: the state belongs to another scene or is damaged; nothing was changed.
        """
        state = saved.unpacked(data, self._state())
        for name, array in self._held.state.items():
            array.assign(state[name])
        self._stepping.forget_the_flow()
        if self.effects.joined:
            self._fill(self._contact_arrays["near"], 1)
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
        state = {name: array.numpy() for name, array in self._held.state.items()}
        kept: dict[str, Any] = {"initial_momentum": self._initial_momentum, "scene": self._scene_mark}
        since = self._since
        numbers = ([since.time, since.base_impulse], since.reactions, since.turned, since.taken)
        kept |= {f"interval.{name}": values for name, values in zip(INTERVAL, numbers, strict=True)}
        return state | {name: np.array(values) for name, values in kept.items()}
