"""A simulation: state on the device and the captured steps that advance it. It knows nothing of files."""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .discretization import material_points
from .effect_rules import derive_effects
from .grid import barrier_planes, contact_nodes, fit_grid, open_corner_volumes
from .kernels import layout as at
from .kernels.build import build_kernels
from .kernels.mohr_coulomb import yield_constants
from .kernels.pore_pressure import LEAST_POROSITY
from .scenario import STANDARD_GRAVITY, Prescribed, Scenario, Sliding, Trapezoid
from .time_step import step_limits


@cache
def _start_warp() -> None:
    """Start Warp without its banner, and without its warning that a machine has no GPU, which is no fault of anyone's.

    Warp prints that from C to the file descriptor, so that is where it is caught; anything else is passed on.
    """
    wp.config.log_level = wp.LOG_WARNING
    sys.stderr.flush()
    stderr = os.dup(2)
    try:
        with tempfile.TemporaryFile() as caught:
            os.dup2(caught.fileno(), 2)
            try:
                wp.init()
            finally:
                os.dup2(stderr, 2)
            caught.seek(0)
            for line in caught:
                if b"Could not find or load the NVIDIA CUDA driver" not in line:
                    os.write(2, line)
    finally:
        os.close(stderr)


class SimulationDiverged(RuntimeError):  # noqa: N818 - a state of the run, not a mistake of the caller
    """The run left the range of sense; the message says when and what to try."""


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
        self._parameters = self._make_parameters()
        self._make_points()
        self._make_grid()
        self._make_barrier()
        self._make_clock()
        self._graph: Any = None
        self._on_launch: Callable[[str], None] | None = None
        self._commands: list[tuple[str, Any]] | None = None
        self._kernels_of_a_step: tuple[str, ...] = ()
        self._last = self._totals()
        mass = self._initial.solid_mass.sum() + self._initial.liquid_mass.sum()
        self._initial_momentum = mass * np.array(scenario.flow.velocity_m_per_s)

    # -- construction ------------------------------------------------------------------------------------------

    def _make_parameters(self) -> Any:
        scenario, effects = self.scenario, self.effects
        material, numerics = scenario.flow.material, scenario.numerics
        parameters = self._types.Parameters()
        young, nu = material.young_modulus_Pa, material.poisson_ratio
        shear = young / (2.0 * (1.0 + nu))
        lame = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        speed_per_cell = self._limits.sound_speed / numerics.spacing_m
        values: dict[str, Any] = {
            "spacing": numerics.spacing_m,
            "inverse_spacing": 1.0 / numerics.spacing_m,
            "left": self.grid.left,
            "bottom": self.grid.bottom,
            "columns": self.grid.columns,
            "rows": self.grid.rows,
            "block_rows": self.grid.rows // at.BLOCK,
            "workers": self._workers,
            "gravity": self._types.V2(*scenario.gravity.vector),
            "solid_density": material.density if effects.formulation == "undrained" else material.solid_partial_density,
            "lame": lame,
            "shear_modulus": shear,
            "bulk_modulus": lame + 2.0 / 3.0 * shear,
            "wave_speed": self._limits.wave_speed,
            "courant_number": numerics.courant_number,
            "largest_stable_step": self._limits.drag_step,
            "pic_rate": numerics.pic_share * speed_per_cell,
        }
        if effects.plasticity:
            values |= yield_constants(
                lame=lame,
                shear_modulus=shear,
                friction_angle=math.radians(material.friction_angle_deg),
                dilatancy_angle=math.radians(material.dilatancy_angle_deg),
                cohesion=material.cohesion_Pa,
                tension_cutoff=material.tension_cutoff_Pa,
            )
        if effects.bulk_viscosity:
            values["bulk_viscosity"] = (
                numerics.bulk_viscosity * material.density * self._limits.sound_speed * numerics.spacing_m
            )
        if effects.liquid:
            liquid: Any = material
            values["porosity"] = material.porosity
            values["true_liquid_density"] = liquid.liquid_density_kg_per_m3
            values["liquid_bulk_modulus"] = liquid.liquid_bulk_modulus_Pa
            values["cavitation_pressure"] = liquid.cavitation_pressure_Pa
            if scenario.barrier is not None:
                shape = scenario.barrier.shape
                values["crest_end"] = shape.polygon[2, 0] if isinstance(shape, Trapezoid) else 0.0
            values["relaxation_rate"] = numerics.pressure_relaxation * speed_per_cell
        if effects.two_phase:
            two: Any = material
            n, solid, water = two.porosity, two.solid_partial_density, two.liquid_partial_density
            coefficient = n**2 * two.liquid_density_kg_per_m3 * STANDARD_GRAVITY / two.hydraulic_conductivity
            values["liquid_density"] = water
            values["drag_coefficient"] = coefficient
            values["drag_rate"] = coefficient * (1.0 / solid + 1.0 / water)
        if scenario.ground is not None:
            values["ground_row"] = self.grid.ground_row
            values["ground_friction"] = scenario.ground.friction
        if effects.ceiling:
            top = scenario.domain.top_m
            above = self.grid.rows - 4 if top is None else round((top - self.grid.bottom) / self.grid.spacing)
            values["ceiling_row"] = above - 1
        if effects.side_walls:
            far = 1e6 * self.grid.spacing * self.grid.columns
            domain = scenario.domain
            x_right = self.grid.left + self.grid.columns * self.grid.spacing
            left = domain.left_m if domain.left_m is not None else self.grid.left + 4 * self.grid.spacing
            right = domain.right_m if domain.right_m is not None else x_right - 4 * self.grid.spacing
            values["left_wall"] = left if domain.left_edge == "wall" else -far
            values["right_wall"] = right if domain.right_edge == "wall" else far
        if scenario.barrier is not None:
            planes = {surface: (normal, offset) for surface, normal, offset in barrier_planes(scenario.barrier)}
            nowhere = ((0.0, 1.0), 1e30)
            values["face_normal"] = self._types.V2(*planes[at.FACE][0])
            values["crest_height"] = planes.get(at.TOP, nowhere)[1]
            values["back_normal"] = self._types.V2(*planes.get(at.BACK, nowhere)[0])
            values["back_offset"] = planes.get(at.BACK, nowhere)[1]
        if effects.barrier == "sliding":
            assert scenario.barrier is not None
            assert isinstance(scenario.barrier.motion, Sliding)
            mass = scenario.barrier.mass
            assert mass is not None
            values["barrier_mass"] = mass
            values["barrier_weight"] = -mass * scenario.gravity.vector[1]
            values["barrier_pull"] = mass * scenario.gravity.vector[0]
            values["base_friction"] = scenario.barrier.motion.base_friction_coefficient
        for name, value in values.items():
            setattr(parameters, name, value)
        return parameters

    def _array(self, values: Any, dtype: Any) -> Any:
        return wp.array(values, dtype=dtype, device=self.device)

    def _empty(self, fields: dict[str, Any], name: str, shape: Any) -> Any:
        return wp.zeros(shape, dtype=fields[name].dtype, device=self.device)

    def _make_points(self) -> None:
        types, effects = self._types, self.effects
        initial = material_points(self.scenario)
        self._initial = initial
        count = len(initial.volume)
        velocity = np.tile(np.array(self.scenario.flow.velocity_m_per_s), (count, types.components // 2))
        given = {
            "position": initial.position,
            "velocity": velocity,
            "stress": initial.effective_stress,
            "reference_volume": initial.volume,
            "volume": initial.volume,
            "inside": np.ones(count, dtype=np.int32),
        }
        if effects.liquid:
            given["liquid_strain"] = -initial.pore_pressure / self._parameters.liquid_bulk_modulus
        self._points = types.Points()
        self._point_arrays = {}
        for name in types.point_fields:
            if name in given:
                array = self._array(given[name], types.point_fields[name].dtype)
            else:
                array = self._empty(types.point_fields, name, count)
            setattr(self._points, name, array)
            self._point_arrays[name] = array
        self.material_points = count

    def _make_grid(self) -> None:
        types = self._types
        blocks = (self.grid.columns // at.BLOCK, self.grid.rows // at.BLOCK)
        shapes = {"block": blocks, "active": blocks[0] * blocks[1], "active_count": 1}
        self._grid = types.Grid()
        self._grid_arrays = {}
        for name in types.grid_fields:
            if name == "corner_room":
                array = self._array(1.0 / open_corner_volumes(self.scenario, self.grid), types.scalar)
            else:
                shape = shapes.get(name, (self.grid.columns, self.grid.rows))
                array = self._empty(types.grid_fields, name, shape)
            setattr(self._grid, name, array)
            self._grid_arrays[name] = array

    def _make_barrier(self) -> None:
        types = self._types
        self._contact_count = 0
        self._contact_arrays: dict[str, Any] = {}
        times, velocities = np.zeros(1), np.zeros(1)
        if self.scenario.barrier is not None:
            nodes = contact_nodes(self.scenario.barrier, self.grid)
            self._contact_count = len(nodes.node)
            given = {
                "node": nodes.node,
                "mirror": nodes.mirror,
                "normal": nodes.normal,
                "surface": nodes.surface,
                "friction": nodes.friction,
            }
            self._contact = types.Contact()
            for name, field in types.contact_fields.items():
                if name in given:
                    array = self._array(given[name], field.dtype)
                else:
                    array = self._empty(types.contact_fields, name, self._contact_count)
                setattr(self._contact, name, array)
                self._contact_arrays[name] = array
            motion = self.scenario.barrier.motion
            if isinstance(motion, Prescribed):
                times, velocities = np.array(motion.times_s), np.array(motion.velocities_m_per_s)
        self._times = self._array(times, wp.float64)
        self._velocities = self._array(velocities, wp.float64)

    def _make_clock(self) -> None:
        clock = np.zeros(at.CLOCK_SIZE)
        clock[at.SMALLEST_TIME_STEP] = math.inf
        clock[at.SPEED_MAX] = self.scenario.flow.speed**2 * (2.0 if self.effects.two_phase else 1.0)
        solid, liquid = float(self._initial.solid_mass.sum()), float(self._initial.liquid_mass.sum())
        if not self.effects.two_phase:
            solid, liquid = solid + liquid, 0.0
        clock[at.INITIAL_MASS_SOLID] = clock[at.ACTIVE_MASS_SOLID] = solid
        clock[at.INITIAL_MASS_LIQUID] = clock[at.ACTIVE_MASS_LIQUID] = liquid
        self._clock = self._array(clock, wp.float64)
        self._counters = wp.zeros(at.COUNTERS_SIZE, dtype=wp.int32, device=self.device)
        self._running = wp.zeros(1, dtype=wp.int32, device=self.device)
        self._reactions = wp.zeros(2 * at.SURFACES, dtype=wp.float64, device=self.device)
        self._left = wp.zeros(at.LEFT_SIZE, dtype=wp.float64, device=self.device)
        self._sums = wp.zeros(at.LEDGER_SIZE, dtype=wp.float64, device=self.device)
        self._target = wp.zeros(1, dtype=wp.float64, device=self.device)

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
        self._launch("update", count, points, grid, parameters, clock, self._counters, self._left)
        if effects.plasticity:
            self._launch("plasticity", count, points, parameters)
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
        wp.capture_while(self._running, self._step)

    def _prepare(self) -> None:
        """Compile the kernels and capture an interval, once."""
        if self._graph is None:
            names: list[str] = []
            wp.load_module(wp.get_module(self.effects.module_name), device=self.device)
            self._on_launch = names.append
            with wp.ScopedCapture(device=self.device) as capture:
                self._interval()
            self._on_launch = None
            self._kernels_of_a_step = tuple(names[1:])  # the first one starts the interval
            self._graph = capture.graph

    @property
    def launched_kernels(self) -> tuple[str, ...]:
        """Names of the kernels that a step launches, in their order, as captured; the first call compiles them."""
        self._prepare()
        return self._kernels_of_a_step

    @property
    def arrays(self) -> dict[str, int]:
        """Every array that the simulation holds on the device, by name, with its bytes."""
        groups = {"points": self._point_arrays, "grid": self._grid_arrays, "contact": self._contact_arrays}
        held = {f"{group}.{name}": array for group, arrays in groups.items() for name, array in arrays.items()}
        for name in ("clock", "counters", "running", "reactions", "left", "sums", "target", "times", "velocities"):
            held[name] = getattr(self, f"_{name}")
        return {name: int(array.capacity) for name, array in held.items()}

    @property
    def blocks_in_use(self) -> float:
        """Share of the grid's blocks that held material in the last step; all that the grid costs is theirs."""
        return float(self._grid_arrays["active_count"].numpy()[0]) / self._grid_arrays["block"].size

    def advance(self, until: float) -> None:
        """Run to the time `until` [s], exactly.

        Raises:
            ValueError: `until` lies in the past or is not finite.
            SimulationDiverged: a quantity is no longer finite or sensible.
        """
        if not math.isfinite(until) or until < self.time:
            raise ValueError(f"until = {until} must be finite and at least the present time {self.time:g} s")
        wp.copy(self._clock, self._array(np.array([until]), wp.float64), dest_offset=at.TARGET, count=1)
        self._prepare()
        wp.capture_launch(self._graph)
        if int(self._counters.numpy()[at.DIVERGED]):
            raise SimulationDiverged(self._what_diverged())

    def kernel_times(self, until: float) -> dict[str, float]:
        """Run to the time `until` [s] with every kernel launched on its own, and tell the wall time [s] of each.

        Launches are prepared beforehand; what is left of their own cost, a few microseconds, is that of `forget`, which
        does next to nothing. The CPU waits for each launch, so that its time is its own.
        """
        wp.copy(self._clock, self._array(np.array([until]), wp.float64), dest_offset=at.TARGET, count=1)
        self._commands = []
        self._start()
        self._step()
        (_, start), *commands = self._commands
        self._commands = None
        start.launch()
        spent = dict.fromkeys((name for name, _ in commands), 0.0)
        while int(self._running.numpy()[0]):
            for name, command in commands:
                begin = time.perf_counter()
                command.launch()
                wp.synchronize_device(self.device)
                spent[name] += time.perf_counter() - begin
        return spent

    def _what_diverged(self) -> str:
        """When, which quantity, where, and what to try."""
        names = {
            "velocity": "the velocity",
            "stress": "the effective stress",
            "liquid_strain": "the pore pressure",
            "volume": "the volume",
            "position": "the position",
        }
        arrays = {name: self._point_arrays[name].numpy() for name in names if name in self._point_arrays}
        found, place = "", None
        for name, values in arrays.items():
            bad = ~np.isfinite(values.reshape(self.material_points, -1)).all(axis=1)
            if bad.any():
                known = arrays["position"][bad & np.isfinite(arrays["position"]).all(axis=1)]
                found = f"{names[name]} of {bad.sum()} of {self.material_points} material points is not a finite number"
                place = known[0] if len(known) else None
                break
        if not found:
            speed = np.abs(arrays["velocity"]).max(axis=1)
            fastest = int(speed.argmax())
            found = f"the speed of a material point passed {at.FASTEST:g} m/s"
            place = arrays["position"][fastest]
            if speed[fastest] < 0.1 * at.FASTEST:
                found, place = f"the barrier's velocity is {self.barrier_velocity:g} m/s", None
        where = "" if place is None else f", near x = {place[0]:.3g} m, y = {place[1]:.3g} m"
        return (
            f"The run diverged at t = {self.time:.6g} s (step {self.steps}): {found}{where}. Try a smaller "
            f"numerics.courant_number (now {self.scenario.numerics.courant_number:g}) or a finer numerics.spacing_m "
            f"(now {self.scenario.numerics.spacing_m:g})."
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
        self._initial_momentum = (solid + liquid) @ velocity
        if self.effects.two_phase:
            self._initial_momentum = solid @ velocity + liquid @ now["liquid_velocity"]
            velocity = np.concatenate([velocity, now["liquid_velocity"]], axis=1)
        self._point_arrays["velocity"].assign(velocity)
        self._point_arrays["stress"].assign(now["effective_stress"])
        if self.effects.liquid:
            self._point_arrays["liquid_strain"].assign(-now["pore_pressure"] / self._parameters.liquid_bulk_modulus)
        clock = self._clock.numpy()
        clock[at.SPEED_MAX] = (velocity**2).sum(axis=1).max()
        self._clock.assign(clock)

    # -- state -------------------------------------------------------------------------------------------------

    def _clock_entry(self, entry: int) -> float:
        return float(self._clock.numpy()[entry])

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._clock_entry(at.TIME)

    @property
    def steps(self) -> int:
        """Time steps so far."""
        return int(self._counters.numpy()[at.STEPS])

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
        wp.copy(self._clock, self._array(np.array([force]), wp.float64), dest_offset=at.EXTERNAL_FORCE, count=1)

    def points(self) -> dict[str, NDArray[np.float64]]:
        """State of the N material points still in the domain, as float64 arrays in SI units.

        `position`, `solid_velocity`, `liquid_velocity` [N, 2] (the last with two phases only); `effective_stress`
        [N, 4] (xx, yy, zz, xy, tension positive); `pore_pressure` (compression positive; not if dry), `porosity`,
        `deviatoric_strain` (cumulative), `volume`, `solid_mass`, `liquid_mass` [N].
        """
        inside = self._point_arrays["inside"].numpy() > 0
        arrays = {
            name: array.numpy()[inside].astype(np.float64)
            for name, array in self._point_arrays.items()
            if name != "inside"
        }
        material = self.scenario.flow.material
        state = {
            "position": arrays["position"],
            "solid_velocity": arrays["velocity"][:, :2],
            "effective_stress": arrays["stress"],
            "deviatoric_strain": arrays["deviatoric_strain"],
            "volume": arrays["volume"],
            "solid_mass": self._initial.solid_mass[inside],
            "liquid_mass": self._initial.liquid_mass[inside],
        }
        state["porosity"] = np.full(len(arrays["volume"]), material.porosity)
        if self.effects.porosity_update:
            grains = (1.0 - material.porosity) * arrays["reference_volume"]
            state["porosity"] = np.maximum(1.0 - grains / arrays["volume"], LEAST_POROSITY)
        if self.effects.two_phase:
            state["liquid_velocity"] = arrays["velocity"][:, 2:]
        if self.effects.liquid:
            liquid: Any = material
            state["pore_pressure"] = np.maximum(
                -liquid.liquid_bulk_modulus_Pa * arrays["liquid_strain"], -liquid.cavitation_pressure_Pa
            )
        return state

    def _totals(self) -> SimpleNamespace:
        return SimpleNamespace(clock=self._clock.numpy().copy(), reactions=self._reactions.numpy().copy())

    def sample(self) -> dict[str, float]:
        """Quantities now, and forces as means over the time since the last sample (impulse over interval).

        Keys without the effect they belong to are absent.

        Raises:
            SimulationDiverged: some quantity of a material point is not a finite number.
        """
        self._sums.zero_()
        self._launch("ledger", self.material_points, self._points, self._parameters, self._clock, self._sums)
        sums = self._sums.numpy()
        if sums[at.LEDGER_NOT_FINITE] > 0.0:
            raise SimulationDiverged(self._what_diverged())
        totals = self._totals()
        clock, reactions = totals.clock, totals.reactions
        elapsed = clock[at.TIME] - self._last.clock[at.TIME]
        rate = 1.0 / elapsed if elapsed > 0.0 else 0.0
        forces = (reactions - self._last.reactions) * rate
        left = self._left.numpy()
        values: dict[str, float] = {"time": clock[at.TIME]}
        momentum_x, momentum_y = sums[at.LEDGER_MOMENTUM_X], sums[at.LEDGER_MOMENTUM_Y]
        residual_x = momentum_x - self._initial_momentum[0] - clock[at.GRAVITY_IMPULSE_X] + left[at.LEFT_MOMENTUM_X]
        residual_y = momentum_y - self._initial_momentum[1] - clock[at.GRAVITY_IMPULSE_Y] + left[at.LEFT_MOMENTUM_Y]
        residual_x += reactions[0::2].sum()
        residual_y += reactions[1::2].sum()
        if self.effects.barrier != "none":
            values |= {
                "impact_force_x": forces[2 * at.FACE],
                "impact_force_y": forces[2 * at.FACE + 1],
                "top_force_x": forces[2 * at.TOP],
                "top_force_y": forces[2 * at.TOP + 1],
                "back_force_x": forces[2 * at.BACK],
                "back_force_y": forces[2 * at.BACK + 1],
                "barrier_velocity": clock[at.BARRIER_VELOCITY],
                "barrier_displacement": clock[at.GRID_SHIFT],
                "barrier_work": clock[at.BARRIER_WORK],
            }
        if self.effects.barrier == "sliding":
            assert self.scenario.barrier is not None
            mass = self.scenario.barrier.mass
            assert mass is not None
            friction = clock[at.BASE_FRICTION_IMPULSE] - self._last.clock[at.BASE_FRICTION_IMPULSE]
            vertical = sum(forces[2 * surface + 1] for surface in (at.FACE, at.TOP, at.BACK))
            values |= {
                "base_force": -friction * rate,
                "base_normal_force": max(self._parameters.barrier_weight - vertical, 0.0),
                "base_friction_work": clock[at.BASE_FRICTION_WORK],
                "barrier_kinetic_energy": 0.5 * mass * clock[at.BARRIER_VELOCITY] ** 2,
            }
        if self.effects.ground != "none":
            values |= {
                "ground_force_x": forces[2 * at.GROUND],
                "ground_force_y": forces[2 * at.GROUND + 1],
            }
        values |= {
            "flow_kinetic_energy": sums[at.LEDGER_KINETIC],
            "flow_gravitational_energy": sums[at.LEDGER_GRAVITATIONAL],
            "flow_elastic_energy": sums[at.LEDGER_ELASTIC],
            "speed_max": math.sqrt(sums[at.LEDGER_SPEED_MAX]),
            "solid_mass": sums[at.LEDGER_SOLID_MASS],
        }
        if self.effects.liquid:
            values["pore_pressure_max_anywhere"] = sums[at.LEDGER_PRESSURE_MAX]
            # What loads the barrier: upstream of the crest's end and meant over a cell. Where a jet lands behind it,
            # single points meet the ground at water-hammer pressure.
            values["pore_pressure_max"] = sums[at.LEDGER_PRESSURE_MEAN]
        if self.effects.two_phase:
            values["liquid_mass"] = sums[at.LEDGER_LIQUID_MASS]
        values |= {
            "momentum_x": momentum_x,
            "momentum_y": momentum_y,
            "momentum_residual_x": residual_x,
            "momentum_residual_y": residual_y,
            "left_mass": left[at.LEFT_SOLID_MASS] + left[at.LEFT_LIQUID_MASS],
            "left_momentum_x": left[at.LEFT_MOMENTUM_X],
            "left_momentum_y": left[at.LEFT_MOMENTUM_Y],
            "left_energy": left[at.LEFT_ENERGY],
            "time_step": clock[at.TIME_STEP],
        }
        self._last = totals
        return {name: float(value) for name, value in values.items()}

    @property
    def record(self) -> dict[str, Any]:
        """What ruled the run: counts of the limits on the time step, of barrier iterations, of points that left."""
        counters, clock = self._counters.numpy(), self._clock.numpy()
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
        """Everything that the run needs to go on, bit for bit (on the CPU): a line of JSON that lists the arrays, then
        their numbers."""
        state = self._state()
        listed = [[name, values.dtype.str, list(values.shape)] for name, values in state.items()]
        return json.dumps(listed).encode() + b"\n" + b"".join(values.tobytes() for values in state.values())

    def restore_state(self, data: bytes) -> None:
        """Go back to a state from `save_state` of a simulation of the same scenario.

        Raises:
            ValueError: the state belongs to another scene or is damaged; nothing was changed.
        """
        listed, _, numbers = data.partition(b"\n")
        state = self._state()
        expected = [[name, values.dtype.str, list(values.shape)] for name, values in state.items()]
        if listed != json.dumps(expected).encode():
            raise ValueError("the state does not fit this scenario: its arrays are others, or of other sizes")
        if len(numbers) != sum(values.nbytes for values in state.values()):
            raise ValueError("the state is damaged: it is not as long as its arrays")
        arrays, begin = self._state_arrays(), 0
        for name, now in state.items():
            values = np.frombuffer(numbers, now.dtype, now.size, begin).reshape(now.shape)
            begin += now.nbytes
            if name in arrays:
                arrays[name].assign(values)
            else:
                state[name] = values.copy()
        self._initial_momentum = state["initial_momentum"]
        self._last = SimpleNamespace(clock=state["last.clock"], reactions=state["last.reactions"])

    def _state(self) -> dict[str, NDArray[Any]]:
        state = {name: array.numpy() for name, array in self._state_arrays().items()}
        kept = {"last.clock": self._last.clock, "last.reactions": self._last.reactions}
        return state | kept | {"initial_momentum": np.asarray(self._initial_momentum, dtype=np.float64)}
