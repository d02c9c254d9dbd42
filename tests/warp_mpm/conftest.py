"""A stand-in for the simulation: material points that fly freely, and a force known in closed form."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.discretization import material_points
from warp_mpm.scenario import Scenario
from warp_mpm.state.samples import Window

SCENES = Path(__file__).parents[2] / "scenarios"


class FlyingPoints:
    """The simulation's interface: points on parabolas, a triangular force on the face, a barrier that speeds up evenly.

    Impulse of the force: ½ · PEAK · (END - START).
    """

    START, PEAK_TIME, END, PEAK = 0.5, 0.8, 2.0, 4.0e5
    nominal_step = 1e-3

    def __init__(self, scenario, device="cpu", fail_at=None):
        self.time, self.steps, self.device = 0.0, 0, device
        self._start = material_points(scenario)
        self._velocity = np.array(scenario.flow.velocity_m_per_s, dtype=float)
        self._gravity = np.array(scenario.gravity.vector)
        self._fixed = scenario.barrier is None or scenario.barrier.mass is None
        self._fail_at = fail_at
        self.material_points = len(self._start.volume)

    def prepare(self):
        """There is nothing to compile."""

    def advance(self, until, **stop):
        if self._fail_at is not None and until > self._fail_at:
            raise ArithmeticError("the run has diverged")
        self.steps += 1
        self.time = until

    def save_state(self):
        return json.dumps([self.time, self.steps]).encode()

    def restore_state(self, data):
        self.time, self.steps = json.loads(data)

    @property
    def record(self):
        return {"steps": self.steps, "steps_limited_by_wave": self.steps, "steps_limited_by_output": 0}

    @property
    def barrier_displacement(self):
        return 0.0 if self._fixed else 0.1 * self.time**2

    def impulse(self, time):
        if time <= self.START:
            return 0.0
        if time <= self.PEAK_TIME:
            return 0.5 * self.PEAK * (time - self.START) ** 2 / (self.PEAK_TIME - self.START)
        whole = 0.5 * self.PEAK * (self.END - self.START)
        return whole - 0.5 * self.PEAK * max(self.END - time, 0.0) ** 2 / (self.END - self.PEAK_TIME)

    def window(self):
        return Window(self.time, [self.impulse(self.time)])

    def sample(self, names=None, *, since=None):
        begin = since or Window(0.0, [0.0])
        span = self.time - begin.time
        force = (self.impulse(self.time) - begin.reactions[0]) / span if span > 0 else 0.0
        mass = float(self._start.solid_mass.sum() + self._start.liquid_mass.sum())
        velocity = self._velocity + self._gravity * self.time
        points = self.points()
        sample = {
            "time": self.time,
            "impact_force_x": force,
            "impact_force_y": -0.5 * force,
            "barrier_velocity": 0.0 if self._fixed else 0.2 * self.time,
            "barrier_displacement": self.barrier_displacement,
            "flow_kinetic_energy": 0.5 * mass * float(velocity @ velocity),
            "flow_gravitational_energy": -mass * float(self._gravity @ points["position"].mean(axis=0)),
            "flow_elastic_energy": 0.0,
            "barrier_kinetic_energy": 0.0,
            "solid_mass": float(self._start.solid_mass.sum()),
            "momentum_x": mass * velocity[0],
            "momentum_y": mass * velocity[1],
            "momentum_residual_x": 1e-10 * mass,
            "momentum_residual_y": 0.0,
            "time_step": 1e-3,
        }
        if self._start.liquid_mass.any():
            sample["liquid_mass"] = float(self._start.liquid_mass.sum())
            sample["pore_pressure_max_anywhere"] = 3e5
            sample["pore_pressure_max"] = 1e5 * math.exp(-((self.time - 1) ** 2))
        return sample

    def points(self):
        start, time = self._start, self.time
        number = len(start.volume)
        velocity = np.tile(self._velocity + self._gravity * time, (number, 1))
        points = {
            "position": start.position + self._velocity * time + 0.5 * self._gravity * time**2,
            "solid_velocity": velocity,
            "effective_stress": start.effective_stress,
            "porosity": np.full(number, 0.5),
            "deviatoric_strain": np.full(number, time),
            "volume": start.volume,
            "solid_mass": start.solid_mass,
        }
        if start.liquid_mass.any():
            points |= {
                "liquid_velocity": 1.5 * velocity,
                "pore_pressure": start.pore_pressure,
                "liquid_mass": start.liquid_mass,
            }
        return points


@pytest.fixture(scope="session")
def flying_points():
    return FlyingPoints


@pytest.fixture(scope="session")
def load_scene():
    return lambda name, **changes: Scenario.load(SCENES / f"{name}.json").replaced(changes)


@pytest.fixture(scope="session")
def largest_difference():
    """Of all that the points of two simulations hold, over the greatest of its kind."""

    def found(one, other):
        return max(
            float(np.abs(other.points()[name] - values).max() / (np.abs(values).max() or 1.0))
            for name, values in one.points().items()
        )

    return found


@pytest.fixture(scope="session")
def coarse_case_1(load_scene):
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 3.0}
    return Scenario.model_validate(load_scene("case_1").replaced(changes).resolved())
