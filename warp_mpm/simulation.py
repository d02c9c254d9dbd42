"""A simulation: state on the device and the captured steps that advance it. It knows nothing of files."""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .discretization import MaterialPoints, material_points
from .effect_rules import derive_effects
from .grid import fit_grid
from .kernels import layout as at
from .kernels.build import build_kernels
from .kernels.cache import initialize_warp, load_kernels
from .kernels.pore_pressure import LEAST_POROSITY
from .scenario import Scenario
from .state import saved
from .state.arrays import clock_arrays, contact_arrays, grid_arrays, memory_for, point_arrays
from .state.divergence import NAMES, SimulationDiverged, what_diverged
from .state.parameters import kernel_parameters
from .state.samples import Constants, Totals, sample
from .time_step import step_limits

__all__ = ["Simulation", "SimulationDiverged"]

LOOK_UP = 0.25
"""Wall time [s] after which the device hands back to the host, which then hears Ctrl-C; a step is never cut."""

FIRST_LOOK_UP = 100_000
"""Steps times material points until the first time, when nothing has been timed: some hundredths of a second."""

MOST_STEPS_AT_ONCE = 2**30
"""Bound of the device's counter."""


@cache
def _start_warp() -> None:
    """Start Warp without its banner, and without its warning that a machine has no GPU, which is no fault of anyone's.

    Warp prints that from C to the file descriptor, so that is where it is caught; anything else is passed on.
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

    Args:
        scenario: what to simulate.
        device: a Warp device, "cpu" or "cuda:0".

    Raises:
        ValueError: the device does not exist.
        MemoryError: the device, or this process, may not have what the scene needs.
    """

    def __init__(self, scenario: Scenario, *, device: str = "cpu") -> None:
        self.scenario = scenario
        self.effects = derive_effects(scenario)
        _start_warp()
        try:
            self.device = wp.get_device(device)
        except ValueError:
            names = ", ".join(str(d) for d in wp.get_devices())
            raise ValueError(f"device = {device!r} does not exist here; it must be one of {names}") from None
        self._kernels = build_kernels(self.effects)
        self._types = self._kernels.types
        self.grid = fit_grid(scenario)
        self._limits = step_limits(scenario)
        # One worker walks the list of blocks on the CPU; on a GPU there are as many as keep it busy.
        self._workers = 1 if self.device.is_cpu else 65536
        self._parameters = kernel_parameters(
            scenario, self.effects, self._types, grid=self.grid, limits=self._limits, workers=self._workers
        )
        with memory_for(scenario):
            initial = material_points(scenario)
            self.material_points = len(initial.volume)
            self._solid_mass, self._liquid_mass = initial.solid_mass, initial.liquid_mass
            self._make_arrays(initial)
        self._graph: Any = None
        self._on_launch: Callable[[str], None] | None = None
        self._commands: list[tuple[str, Any]] | None = None
        self._kernels_of_a_step: tuple[str, ...] = ()
        self._ledger_graph: Any = None
        mass = scenario.barrier.mass if scenario.barrier is not None else None
        weight = -mass * scenario.gravity.vector[1] if mass is not None else None
        self._constants = Constants(self.effects, barrier_mass=mass, barrier_weight=weight)
        self._last = self._totals()
        flow_mass = float(initial.solid_mass.sum() + initial.liquid_mass.sum())
        self._initial_momentum = [flow_mass * velocity for velocity in scenario.flow.velocity_m_per_s]

    def _make_arrays(self, initial: MaterialPoints) -> None:
        scenario, effects, types, device = self.scenario, self.effects, self._types, self.device
        bulk_modulus = self._parameters.liquid_bulk_modulus if effects.liquid else 0.0
        points = point_arrays(scenario, effects, types, initial, liquid_bulk_modulus=bulk_modulus, device=device)
        self._points, self._point_arrays = points.structure, points.arrays
        grid = grid_arrays(scenario, effects, types, self.grid, device=device)
        self._grid, self._grid_arrays = grid.structure, grid.arrays
        self._contact_count, self._contact_arrays = 0, {}
        if scenario.barrier is not None:
            contact = contact_arrays(scenario.barrier, types, self.grid, device=device)
            self._contact, self._contact_arrays = contact.structure, contact.arrays
            self._contact_count = len(contact.arrays["node"])
        self._clock_arrays = clock_arrays(scenario, effects, initial, device=device)
        self._clock = self._clock_arrays["clock"]
        self._counters = self._clock_arrays["counters"]
        self._running = self._clock_arrays["running"]
        self._reactions = self._clock_arrays["reactions"]
        self._left = self._clock_arrays["left"]
        self._sums = self._clock_arrays["sums"]
        self._times = self._clock_arrays["times"]
        self._velocities = self._clock_arrays["velocities"]
        self._target = self._clock[at.TARGET : at.TARGET + 1]
        self._goes_on = self._running[at.GOES_ON : at.GOES_ON + 1]
        self._steps_left = self._running[at.STEPS_LEFT : at.STEPS_LEFT + 1]
        self._steps_at_once = max(1, FIRST_LOOK_UP // max(1, self.material_points))
        # On the CPU the host sees the device's own memory; elsewhere every look is a copy.
        self._seen = {name: array.numpy() for name, array in self._clock_arrays.items()} if device.is_cpu else {}

    # -- stepping ----------------------------------------------------------------------------------------------

    def _launch(self, name: str, dim: Any, *arguments: Any) -> None:
        kernel, kept = getattr(self._kernels, name), self._commands is not None
        command = wp.launch(kernel, dim=dim, inputs=list(arguments), device=self.device, record_cmd=kept)
        if self._commands is not None:
            self._commands.append((name, command))
        if self._on_launch is not None:
            self._on_launch(name)

    def _step(self) -> None:
        effects, grid, points, parameters, clock = (
            self.effects,
            self._grid,
            self._points,
            self._parameters,
            self._clock,
        )
        count = self.material_points
        self._launch("clear", self._workers, grid, parameters)
        self._launch("forget", 1, grid)
        self._launch("scatter", count, points, grid, parameters, clock)
        self._launch("move", self._workers, grid, parameters, clock)
        if effects.ground != "none":
            self._launch("ground", self._workers, grid, parameters, clock, self._reactions)
        if effects.side_walls:
            self._launch("side_walls", self.grid.rows, grid, parameters, clock, self._reactions)
        if effects.ceiling:
            self._launch("ceiling", self.grid.columns, grid, parameters, clock, self._reactions)
        if effects.barrier != "none":
            self._launch("collect", self._contact_count, self._contact, grid, parameters, clock)
            if effects.barrier == "sliding":
                self._launch("slide", 1, self._contact, self._contact_count, parameters, clock, self._counters)
            self._launch("barrier", self._contact_count, self._contact, grid, parameters, clock, self._reactions)
        self._launch("gather", count, points, grid, parameters, clock)
        if effects.smoothing_grid:
            self._launch("average", self._workers, grid, parameters)
        self._launch("advect", count, points, grid, parameters, clock, self._counters, self._left)
        self._launch("update", count, points, parameters, clock)
        self._launch("bound", count, points, parameters, clock)
        self._launch(
            "tick",
            1,
            parameters,
            clock,
            self._counters,
            self._running,
            self._reactions,
            self._left,
            self._times,
            self._velocities,
        )

    def _start(self) -> None:
        self._launch(
            "start", 1, self._parameters, self._clock, self._counters, self._running, self._times, self._velocities
        )

    def _interval(self) -> None:
        self._start()
        wp.capture_while(self._goes_on, self._step)

    def _sum_up(self) -> None:
        self._sums.zero_()
        self._launch("ledger", self._workers, self._points, self._parameters, self._clock, self._sums)

    def prepare(self) -> None:
        """Compile the kernels, or find them compiled, and capture an interval; the first step does so otherwise."""
        if self._graph is None:
            names: list[str] = []
            self._on_launch = names.append
            self._graph = self._captured(self._interval)
            self._on_launch = None
            self._kernels_of_a_step = tuple(names[1:])  # the first one starts the interval

    def _captured(self, launches: Callable[[], None]) -> Any:
        """A graph of the launches, which replays for a hundredth of what they cost one by one."""
        load_kernels(self.effects.module_name, self.device)
        with wp.ScopedCapture(device=self.device) as capture:
            launches()
        return capture.graph

    @property
    def launched_kernels(self) -> tuple[str, ...]:
        """Names of the kernels that a step launches, in their order, as captured; the first call compiles them."""
        self.prepare()
        return self._kernels_of_a_step

    @property
    def arrays(self) -> dict[str, int]:
        """Every array that the simulation holds on the device, by name, with its bytes."""
        groups = {"points": self._point_arrays, "grid": self._grid_arrays, "contact": self._contact_arrays}
        held = {f"{group}.{name}": array for group, arrays in groups.items() for name, array in arrays.items()}
        return {name: int(array.capacity) for name, array in (held | self._clock_arrays).items()}

    @property
    def blocks_in_use(self) -> float:
        """Share of the grid's blocks that held material in the last step; all that the grid costs is theirs."""
        return float(self._grid_arrays["active_count"].numpy()[0]) / self._grid_arrays["block"].size

    def advance(self, until: float, *, stop: Callable[[], bool] = lambda: False) -> None:
        """Run to the time `until` [s], exactly.

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
        self._target.fill_(until)
        self.prepare()
        while True:
            before, begin = self.steps, time.perf_counter()
            self._steps_left.fill_(self._steps_at_once)
            wp.capture_launch(self._graph)
            counters = self._read("counters")  # waits for the device
            if int(counters[at.DIVERGED]):
                raise SimulationDiverged(self._what_diverged())
            if int(counters[at.STEPS]) < before + self._steps_at_once or self.time >= until or stop():
                return
            rate = self._steps_at_once / (time.perf_counter() - begin)
            self._steps_at_once = max(1, min(int(rate * LOOK_UP), MOST_STEPS_AT_ONCE))

    def kernel_times(self, until: float) -> dict[str, float]:
        """Run to the time `until` [s] with every kernel launched on its own, and tell the wall time [s] of each.

        Launches are prepared beforehand; what is left of their own cost, a few microseconds, is that of `forget`, which
        does next to nothing. The CPU waits for each launch, so that its time is its own.
        """
        self._target.fill_(until)
        self._steps_left.fill_(MOST_STEPS_AT_ONCE)
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
        return what_diverged(
            {name: self._point_arrays[name].numpy() for name in NAMES if name in self._point_arrays},
            time=self.time,
            steps=self.steps,
            barrier_velocity=self.barrier_velocity,
            numerics=self.scenario.numerics,
        )

    def set_points(self, **state: NDArray[np.float64]) -> None:
        """Replace part of the initial state; only before the first step.

        Args:
            state: any of `solid_velocity`, `liquid_velocity` [N, 2] m/s (the latter with two phases only),
                `effective_stress` [N, 4] Pa (xx, yy, zz, xy, tension positive) and `pore_pressure` [N] Pa
                (compression positive), in the order of `points()`.

        Raises:
            ValueError: the run has begun, or a field is unknown here, of another shape or not finite.
        """
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
        self._point_arrays["stress"].assign(now["effective_stress"])
        if self.effects.liquid:
            self._point_arrays["liquid_strain"].assign(-now["pore_pressure"] / self._parameters.liquid_bulk_modulus)
        clock = self._clock.numpy()
        clock[at.SPEED_MAX] = (velocity.reshape(-1, 2) ** 2).sum(axis=1).max()
        self._clock.assign(clock)

    # -- state -------------------------------------------------------------------------------------------------

    def _read(self, name: str) -> NDArray[Any]:
        """Present numbers of the clock, the counters or the sums; on the CPU they go on changing with the run."""
        return self._seen[name] if name in self._seen else self._clock_arrays[name].numpy()

    def _clock_entry(self, entry: int) -> float:
        return float(self._read("clock")[entry])

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._clock_entry(at.TIME)

    @property
    def steps(self) -> int:
        """Time steps so far."""
        return int(self._read("counters")[at.STEPS])

    @property
    def barrier_displacement(self) -> float:
        """Displacement of the barrier [m]."""
        return self._clock_entry(at.GRID_SHIFT)

    @property
    def barrier_velocity(self) -> float:
        """Velocity of the barrier [m/s]."""
        return self._clock_entry(at.BARRIER_VELOCITY)

    def set_barrier_velocity(self, velocity: float) -> None:
        """Drive the barrier at `velocity` [m/s] from now on; only for a barrier with prescribed motion."""
        if self.effects.barrier != "driven":
            raise ValueError("set_barrier_velocity needs a barrier whose motion is of the kind 'prescribed'")
        self._velocities.fill_(float(velocity))

    def set_external_force(self, force: float) -> None:
        """Horizontal force [N/m] on a sliding barrier from now on, positive downstream."""
        if self.effects.barrier != "sliding":
            raise ValueError("set_external_force needs a barrier whose motion is of the kind 'sliding'")
        self._clock[at.EXTERNAL_FORCE : at.EXTERNAL_FORCE + 1].fill_(float(force))

    def points(self, names: Collection[str] | None = None) -> dict[str, NDArray[np.float64]]:
        """State of the N material points still in the domain, as float64 arrays in SI units: all, or what is named.

        `position`, `solid_velocity`, `liquid_velocity` [N, 2] (the last with two phases only); `effective_stress`
        [N, 4] (xx, yy, zz, xy, tension positive); `pore_pressure` (compression positive; not if dry), `porosity`,
        `deviatoric_strain` (cumulative), `volume`, `solid_mass`, `liquid_mass` [N].
        """
        inside = self._point_arrays["inside"].numpy() > 0
        rows = slice(None) if inside.all() else inside
        material: Any = self.scenario.flow.material

        @cache
        def stored(name: str) -> NDArray[np.float64]:
            return self._point_arrays[name].numpy()[rows].astype(np.float64)

        def grains() -> NDArray[np.float64]:
            return (1.0 - material.porosity) * stored("reference_volume")

        def porosity() -> NDArray[np.float64]:
            if self.effects.porosity_update:
                return np.maximum(1.0 - grains() / stored("volume"), LEAST_POROSITY)
            return np.full(len(stored("volume")), material.porosity)

        quantities: dict[str, Callable[[], NDArray[np.float64]]] = {
            "position": lambda: stored("position"),
            "solid_velocity": lambda: stored("velocity")[:, :2],
            "effective_stress": lambda: stored("stress"),
            "deviatoric_strain": lambda: stored("deviatoric_strain"),
            "volume": lambda: np.maximum(stored("volume"), grains()),
            "solid_mass": lambda: self._solid_mass[inside],
            "liquid_mass": lambda: self._liquid_mass[inside],
            "porosity": porosity,
        }
        if self.effects.two_phase:
            quantities["liquid_velocity"] = lambda: stored("velocity")[:, 2:]
        if self.effects.liquid:
            quantities["pore_pressure"] = lambda: np.maximum(
                -material.liquid_bulk_modulus_Pa * stored("liquid_strain"), -material.cavitation_pressure_Pa
            )
        return {name: quantities[name]() for name in (quantities if names is None else names)}

    def _totals(self) -> Totals:
        return Totals(self._read("clock").tolist(), self._read("reactions").tolist())

    def sample(self) -> dict[str, float]:
        """Quantities now, and forces as means over the time since the last sample (impulse over interval).

        Keys without the effect they belong to are absent.

        Raises:
            SimulationDiverged: some quantity of a material point is not a finite number.
        """
        if self._ledger_graph is None:
            self._ledger_graph = self._captured(self._sum_up)
        wp.capture_launch(self._ledger_graph)
        sums = self._read("sums").tolist()
        if sums[at.LEDGER_NOT_FINITE] > 0.0:
            raise SimulationDiverged(self._what_diverged())
        totals = self._totals()
        values = sample(
            self._constants,
            totals,
            self._last,
            sums=sums,
            left=self._read("left").tolist(),
            initial_momentum=self._initial_momentum,
        )
        self._last = replace(
            totals, seepage_power=sums[at.LEDGER_SEEPAGE], seepage_work=values.get("seepage_work", 0.0)
        )
        return values

    @property
    def record(self) -> dict[str, Any]:
        """What ruled the run: counts of the limits on the time step, of barrier iterations, of points that left, and of
        the points on which a limiter acted, once per step and point."""
        counters, clock = self._read("counters"), self._read("clock")
        return {
            "steps": int(counters[at.STEPS]),
            "steps_limited_by_wave": int(counters[at.LIMIT_WAVE]),
            "steps_limited_by_drag": int(counters[at.LIMIT_DRAG]),
            "steps_limited_by_output": int(counters[at.LIMIT_OUTPUT]),
            "time_step_min": float(clock[at.SMALLEST_TIME_STEP]),
            "time_step_max": float(clock[at.LARGEST_TIME_STEP]),
            "barrier_iterations": int(counters[at.BARRIER_ITERATIONS]),
            "barrier_unconverged": int(counters[at.BARRIER_UNCONVERGED]),
            "points_left": int(counters[at.POINTS_LEFT]),
            "points_pushed_out": int(counters[at.POINTS_PUSHED]),
            "gaps_bounded": int(clock[at.GAPS_BOUNDED]),
            "voids_closed": int(clock[at.VOIDS_CLOSED]),
        }

    def _state_arrays(self) -> dict[str, Any]:
        arrays = {f"points.{name}": array for name, array in self._point_arrays.items()}
        # Corner sums and the rest of the grid are rebuilt every step; only the blocks in use are remembered.
        arrays |= {
            "clock": self._clock,
            "counters": self._counters,
            "reactions": self._reactions,
            "left": self._left,
            "times": self._times,
            "velocities": self._velocities,
        }
        return arrays

    def save_state(self) -> bytes:
        """Everything that the run needs to go on, bit for bit (on the CPU)."""
        return saved.packed(self._state())

    def restore_state(self, data: bytes) -> None:
        """Go back to a state from `save_state` of a simulation of the same scenario.

        Raises:
            ValueError: the state belongs to another scene or is damaged; nothing was changed.
        """
        state = saved.unpacked(data, self._state())
        for name, array in self._state_arrays().items():
            array.assign(state[name])
        self._initial_momentum = state["initial_momentum"].tolist()
        self._last = Totals(
            state["last.clock"].tolist(), state["last.reactions"].tolist(), *state["last.seepage"].tolist()
        )

    def _state(self) -> dict[str, NDArray[Any]]:
        state = {name: array.numpy() for name, array in self._state_arrays().items()}
        kept = {
            "last.clock": self._last.clock,
            "last.reactions": self._last.reactions,
            "last.seepage": [self._last.seepage_power, self._last.seepage_work],
            "initial_momentum": self._initial_momentum,
        }
        return state | {name: np.array(values) for name, values in kept.items()}
