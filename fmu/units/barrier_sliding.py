"""The unit BarrierSliding: the closed-form impact model, and the sliding of the barrier under forces from a system."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from analytic.impact import PHASES, STANDARD_GRAVITY, VARIANTS, Impact
from analytic.sliding import slide

from .interface import (
    DEGREE,
    JOULE_PER_METRE,
    KILOGRAM_PER_METRE,
    METRE,
    METRE_PER_SECOND,
    METRE_PER_SECOND_SQUARED,
    NEWTON_PER_METRE,
    PASCAL,
    SECOND,
    Choice,
    Interface,
    Variable,
)
from .slave import UnitError, UnitSlave

_VARIANT_TEXTS = {
    "stick_slip": "The barrier slides only while the force exceeds its base friction",
    "momentum_closed": "As stick_slip, the impulse raised until flow and barrier have one velocity at the impact's end",
    "as_printed": "The paper's formulas to the letter, for comparison; takes no inputs",
}
_PHASE_TEXTS = {
    "approach": "The flow has not arrived",
    "stick": "A force acts, the barrier holds still",
    "acceleration": "The barrier slides, the force exceeds the base friction",
    "deceleration": "The barrier slides, the force is below the base friction",
    "inertia": "The impact force has ended, the barrier still slides",
    "rest": "The impact force has ended, the barrier holds still",
}
VARIANT = Choice("Variant", "Variant of the closed-form model", tuple((n, _VARIANT_TEXTS[n]) for n in VARIANTS))
PHASE = Choice("ImpactPhase", "Phase of the impact", tuple((n, _PHASE_TEXTS[n]) for n in PHASES))
FORCE_SOURCE = Choice(
    "ImpactForceSource",
    "Where the impact force comes from",
    (
        ("closed_form", "The closed-form model gives it"),
        ("input", "The input impact_force_input gives it, from a simulator or any other model of the flow"),
    ),
)

FORCE_LIMIT = 1e9
"""Largest force that an input may bring [N/m], far beyond any flow: a number above it is a mistake."""

STEEPEST = 89.0
"""Largest slope [degrees], up or down; a barrier that may slide rests on none that is steeper than its friction."""


def _parameter(name: str, description: str, start: float, **rest: Any) -> Variable:
    return Variable(name, "parameter", description, start=start, **rest)


def _force_input(name: str, description: str) -> Variable:
    bounds = {"minimum": -FORCE_LIMIT, "maximum": FORCE_LIMIT}
    return Variable(name, "input", description, unit=NEWTON_PER_METRE, start=0.0, nominal=1e5, **bounds)  # type: ignore[arg-type]


def _output(name: str, description: str, **rest: Any) -> Variable:
    return Variable(name, "output", description, **rest)


VARIABLES = (
    _parameter(
        "flow_mass",
        "Mass m1 of the flow per metre of width",
        81000.0,
        unit=KILOGRAM_PER_METRE,
        minimum=0.0,
        open_minimum=True,
        nominal=1e5,
    ),
    _parameter(
        "flow_length",
        "Length L of the flow's equivalent box",
        15.0,
        unit=METRE,
        minimum=0.0,
        open_minimum=True,
        nominal=10.0,
    ),
    _parameter("flow_height", "Depth h of the flow", 3.0, unit=METRE, minimum=0.0, open_minimum=True),
    _parameter(
        "speed",
        "Velocity v1,0 of the flow when it arrives",
        10.0,
        unit=METRE_PER_SECOND,
        minimum=0.0,
        open_minimum=True,
        nominal=10.0,
    ),
    _parameter("arrival_time", "Time at which the front reaches the barrier", 0.0, unit=SECOND, minimum=0.0),
    Variable("barrier_fixed", "parameter", "Whether the barrier is fixed to the ground", "Boolean", start=False),
    _parameter(
        "barrier_mass",
        "Mass m2 of the barrier per metre of width",
        81000.0,
        unit=KILOGRAM_PER_METRE,
        minimum=0.0,
        open_minimum=True,
        nominal=1e5,
    ),
    _parameter(
        "barrier_initial_velocity",
        "Velocity v2,0 of the barrier at the start, below the flow's speed",
        0.0,
        unit=METRE_PER_SECOND,
        minimum=0.0,
    ),
    _parameter("base_friction", "Friction tan(delta_b) of the barrier on its base", 0.29, minimum=0.0, tunable=True),
    _parameter(
        "geometry_change",
        "Geometry change lambda = s1max / L of the flow; unused where s1max is given",
        0.41,
        minimum=0.0,
        maximum=1.0,
        open_minimum=True,
    ),
    _parameter(
        "s1max",
        "Largest geometry change length of the flow, at most its length; 0 takes geometry_change times flow_length",
        0.0,
        unit=METRE,
        minimum=0.0,
    ),
    _parameter(
        "rise_ratio",
        "Ratio tau = T1 / T2 of the force's rise to its duration",
        0.35,
        minimum=0.0,
        maximum=1.0,
        open_minimum=True,
    ),
    _parameter(
        "vertical_load_ratio",
        "Vertical load kappa of the flow on the barrier over its horizontal force, wherever that comes from; the "
        "paper's model leaves it out",
        0.0,
        minimum=0.0,
    ),
    _parameter(
        "gravity",
        "Acceleration of gravity",
        STANDARD_GRAVITY,
        unit=METRE_PER_SECOND_SQUARED,
        minimum=0.0,
        open_minimum=True,
        nominal=10.0,
    ),
    _parameter(
        "slope",
        "Angle by which the ground falls in the direction of the flow; forces and motions are along the ground",
        0.0,
        unit=DEGREE,
        minimum=-STEEPEST,
        maximum=STEEPEST,
        nominal=10.0,
    ),
    Variable("variant", "parameter", VARIANT.description, "Integer", start=1, choice=VARIANT),
    Variable("impact_force_source", "parameter", FORCE_SOURCE.description, "Integer", start=1, choice=FORCE_SOURCE),
    _force_input(
        "external_force",
        "Horizontal force on the barrier per metre of width beside the impact, positive in the direction of the flow",
    ),
    _force_input(
        "vertical_load",
        "Load on the barrier, normal to its base, per metre of width beside its weight; it raises the base friction",
    ),
    _force_input(
        "impact_force_input",
        "Horizontal impact force per metre of width where impact_force_source is input, constant over a step",
    ),
    _output("impact_force", "Horizontal impact force F per metre of width", unit=NEWTON_PER_METRE, nominal=1e5),
    _output(
        "peak_force",
        "Peak of the impact force per metre of width; so far, where it is an input",
        unit=NEWTON_PER_METRE,
        minimum=0.0,
        nominal=1e5,
    ),
    _output("peak_pressure", "Peak of the impact force over the flow's depth", unit=PASCAL, minimum=0.0, nominal=1e5),
    _output("barrier_velocity", "Velocity v2 of the barrier", unit=METRE_PER_SECOND),
    _output("barrier_displacement", "Displacement of the barrier since the start", unit=METRE),
    _output(
        "flow_velocity",
        "Velocity v1 of the flow's centre of mass, from its momentum",
        unit=METRE_PER_SECOND,
        nominal=10.0,
    ),
    _output(
        "flow_kinetic_energy",
        "Kinetic energy E_k1 of the flow per metre of width",
        unit=JOULE_PER_METRE,
        minimum=0.0,
        nominal=1e6,
    ),
    _output(
        "barrier_kinetic_energy",
        "Kinetic energy E_k2 of the barrier per metre of width",
        unit=JOULE_PER_METRE,
        minimum=0.0,
        nominal=1e6,
    ),
    Variable("impact_phase", "output", PHASE.description, "Integer", choice=PHASE),
)

INTERFACE = Interface(
    "BarrierSliding",
    "Closed-form impact of a debris flow on a rigid barrier that may slide on its base, per metre of width",
    VARIABLES,
    stop_time=4.0,
    step_size=0.01,
)


def check_friction(base_friction: float, slope: float, vertical_load_ratio: float) -> None:
    """What `Impact` demands of a base friction, for one that is changed between steps."""
    steepest = abs(math.tan(math.radians(slope)))
    if steepest > 0 and base_friction <= steepest:
        raise UnitError(
            f"base_friction is {base_friction:g}, on a slope of {slope:g} degrees it must be above {steepest:.4g}, "
            "else the barrier slides by its own weight."
        )
    if vertical_load_ratio * base_friction >= 1:
        raise UnitError(f"vertical_load_ratio is {vertical_load_ratio:g}, it must be in [0, {1 / base_friction:g}).")


@dataclass
class Loads:
    """What a system brings onto the barrier [N/m], constant over a step, and the friction of its base."""

    base_friction: float

    external_force: float = 0.0
    vertical_load: float = 0.0
    impact_force: float = 0.0


@dataclass
class SlidingBarrier:
    """The barrier between two communication points.

    As long as no load acts from outside, the barrier follows `Impact`, which is a function of time alone: any steps
    lead to the same trajectory. From the first load on it is integrated from step to step, exactly for loads that are
    constant over a step.
    """

    impact: Impact
    force_is_input: bool
    time: float
    displacement: float = 0.0
    velocity: float = 0.0
    integrated: bool = False
    impulse: float = 0.0
    """Impulse of the impact force so far [N s/m], where it is an input."""
    peak_force: float = 0.0
    force: float = 0.0
    phase: str = PHASES[0]
    base_friction: float = field(init=False)
    """tan(delta_b) as last set: the importer may change it between steps."""

    def __post_init__(self) -> None:
        self.base_friction = self.impact.base_friction or 0.0
        if self.force_is_input:
            self.velocity, self.integrated = self.impact.barrier_initial_velocity, True
        else:
            self._follow_closed_form(self.time)

    def _follow_closed_form(self, time: float) -> None:
        impact = self.impact
        self.time = time
        self.displacement, self.velocity = impact.barrier_displacement(time), impact.barrier_velocity(time)
        self.force, self.peak_force, self.phase = impact.force(time), impact.peak_force, impact.phase(time)

    def advance(self, end: float, loads: Loads) -> None:
        """Go on to the time `end` [s] under the loads."""
        impact = self.impact
        tuned = not impact.fixed and loads.base_friction != self.base_friction
        acted = loads.external_force or loads.vertical_load or tuned
        if acted and impact.variant == "as_printed":
            fault = "base_friction must stay as it was" if tuned else "external_force and vertical_load must be 0"
            raise UnitError(
                f"variant is 3 (as_printed), which is a set of functions of time: {fault}, or choose 1 (stick_slip)."
            )
        if tuned:
            check_friction(loads.base_friction, impact.slope, impact.vertical_load_ratio)
            self.base_friction = loads.base_friction
        if not self.integrated and not acted:
            self._follow_closed_form(end)
            return
        self.integrated = True
        tangent, angle = self.base_friction, math.radians(impact.slope)
        weight = (impact.barrier_mass or 0.0) * impact.gravity
        pressing = max(weight * math.cos(angle) + loads.vertical_load, 0.0)
        pushing = loads.external_force + weight * math.sin(angle)
        share = impact.vertical_load_ratio
        for duration, force, rate in () if impact.fixed else self._force_pieces(end, loads):
            self.displacement, self.velocity = slide(
                self.displacement,
                self.velocity,
                duration,
                force + pushing,
                rate,
                tangent * max(pressing + share * force, 0.0),
                tangent * share * rate,
                impact.barrier_mass or math.inf,
            )
        if self.force_is_input:
            self.force = loads.impact_force
            self.impulse += self.force * (end - self.time)
            self.peak_force = max(self.peak_force, self.force)
        else:
            self.force = impact.force(end)
        self.time = end
        self.phase = self._phase(self.force + pushing, tangent * max(pressing + share * self.force, 0.0))

    def _force_pieces(self, end: float, loads: Loads) -> list[tuple[float, float, float]]:
        """Duration, impact force at the start and its rate of each piece of the step in which it is linear."""
        if self.force_is_input:
            return [(end - self.time, loads.impact_force, 0.0)]
        impact = self.impact
        arrival, peak_time, impact_end = impact.arrival_time, impact.peak_time, impact.impact_end_time
        rise = impact.peak_force / (peak_time - arrival)
        fall = -impact.peak_force / (impact_end - peak_time) if impact_end > peak_time else 0.0
        corners = (
            (-math.inf, arrival, 0.0, 0.0),
            (arrival, peak_time, 0.0, rise),
            (peak_time, impact_end, impact.peak_force, fall),
            (impact_end, math.inf, 0.0, 0.0),
        )
        pieces = []
        for corner, next_corner, force, rate in corners:
            start, stop = max(corner, self.time), min(next_corner, end)
            if stop > start:
                pieces.append((stop - start, force + (start - corner) * rate if rate else force, rate))
        return pieces

    def _phase(self, applied: float, friction: float) -> str:
        impacting = self.force > 0
        if self.velocity == 0:
            if impacting:
                return "stick"
            arrived = self.peak_force > 0 if self.force_is_input else self.time > self.impact.arrival_time
            return "rest" if arrived else "approach"
        if not impacting:
            return "inertia"
        return "acceleration" if applied * self.velocity > friction * abs(self.velocity) else "deceleration"

    @property
    def flow_velocity(self) -> float:
        """Velocity of the flow's centre of mass [m/s], from the impulse that it has given away."""
        if self.force_is_input:
            return self.impact.speed - self.impulse / self.impact.flow_mass
        return self.impact.flow_velocity(self.time)


class BarrierSlidingSlave(UnitSlave):
    """`SlidingBarrier` as a co-simulation unit."""

    interface = INTERFACE
    barrier: SlidingBarrier

    def start(self) -> None:
        s1max, fixed = self["s1max"], self["barrier_fixed"]
        impact = Impact(
            **{
                name: self[name]
                for name in (
                    "flow_mass",
                    "flow_length",
                    "flow_height",
                    "speed",
                    "arrival_time",
                    "barrier_initial_velocity",
                    "rise_ratio",
                    "vertical_load_ratio",
                    "gravity",
                    "slope",
                )
            },
            barrier_mass=None if fixed else self["barrier_mass"],
            base_friction=None if fixed else self["base_friction"],
            geometry_change=None if s1max else self["geometry_change"],
            s1max=s1max or None,
            variant=VARIANT.name_of(self["variant"]),
        )
        self.barrier = SlidingBarrier(impact, FORCE_SOURCE.name_of(self["impact_force_source"]) == "input", self.time)
        if self.barrier.force_is_input:
            self.barrier.advance(self.time, self._loads())
        self._write_outputs()

    def step(self, end: float) -> None:
        self.barrier.advance(end, self._loads())
        self._write_outputs()

    def _loads(self) -> Loads:
        return Loads(self["base_friction"], self["external_force"], self["vertical_load"], self["impact_force_input"])

    def _write_outputs(self) -> None:
        barrier = self.barrier
        impact, v1, v2 = barrier.impact, barrier.flow_velocity, barrier.velocity
        self["impact_force"] = barrier.force
        self["peak_force"] = barrier.peak_force
        self["peak_pressure"] = barrier.peak_force / impact.flow_height
        self["barrier_velocity"] = v2
        self["barrier_displacement"] = barrier.displacement
        self["flow_velocity"] = v1
        self["flow_kinetic_energy"] = impact.flow_mass * v1 * v1 / 2
        self["barrier_kinetic_energy"] = 0.0 if impact.fixed else (impact.barrier_mass or 0.0) * v2 * v2 / 2
        self["impact_phase"] = PHASE.number_of(barrier.phase)

    def snapshot(self) -> dict[str, Any]:
        # The impact is what the parameters make of it, with the base friction as it was at the start.
        state = asdict(self.barrier)
        del state["impact"]
        return {"friction_at_start": self.barrier.impact.base_friction or 0.0, "barrier": state}

    def restore(self, snapshot: dict[str, Any]) -> None:
        values = list(self.values)
        self["base_friction"] = snapshot["friction_at_start"]
        self.start()
        self.values = values
        for name, value in snapshot["barrier"].items():
            setattr(self.barrier, name, value)
