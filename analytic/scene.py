"""What the closed form needs to know of a flow and a barrier, as numbers or taken from a scenario of the simulator.

The scenario's schema is loaded where a scenario is read, so that `predict` starts at once where numbers are given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analytic.impact import STANDARD_GRAVITY, Impact

if TYPE_CHECKING:
    from warp_mpm.scenario import Scenario

FITTED_FORMULATION, FITTED_LAW = "two_phase", "mohr_coulomb"
"""Of the simulations to which ``analytic.fitted`` is fitted, as of the paper's."""

PAPER_GEOMETRY_CHANGE = {"fixed": 0.72, "sliding": 0.41}
"""The paper's constants lambda = s1max / L_1,0 [-] (section 3.2)."""

ASSUMED_RISE_RATIO = 0.35
"""tau [-] assumed where none is given: the paper names no value, only that the rise is much shorter than the decay."""


class SceneError(ValueError):
    """A scenario that the closed form has no answer to; one sentence that names the file and the field."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A flow and a barrier, SI units per metre of width. `None`: not known, or not there."""

    flow_mass: float
    """m1 [kg/m]."""
    flow_length: float
    """L_1,0 [m], length of the box of the flow's volume and depth."""
    flow_height: float
    """h [m]."""
    speed: float
    """v_1,0 [m/s]."""
    barrier_mass: float | None = None
    """m2 [kg/m]; `None` for a fixed barrier."""
    base_friction: float | None = None
    """tan(delta_b) [-] of a barrier that may slide."""
    gravity: float = STANDARD_GRAVITY
    """[m/s^2]."""
    slope: float = 0.0
    """theta [degrees], by which the ground falls in the direction of the flow."""
    porosity: float | None = None
    """n [-]."""
    face_angle: float | None = None
    """beta, angle of the impacted face with the base [degrees]."""
    barrier_height: float | None = None
    """H [m]; infinite for a wall without end."""
    barrier_density: float | None = None
    """[kg/m^3]."""
    distance: float = 0.0
    """From the flow's front to the toe of the barrier [m]; from the section, of a flow that arrives."""
    sets_out: float = 0.0
    """Time [s] at which the front is at that distance: later than 0 for a flow that arrives then."""
    formulation: str | None = None
    """Of the simulator's flow: two_phase, undrained or dry."""
    law: str | None = None
    """Of the simulator's material."""
    title: str = ""
    remarks: tuple[str, ...] = ()
    """What of the file the scene does not hold."""

    @property
    def fixed(self) -> bool:
        """Whether the barrier is fixed."""
        return self.barrier_mass is None

    @property
    def density(self) -> float:
        """rho_m [kg/m^3]."""
        return self.flow_mass / (self.flow_length * self.flow_height)

    @property
    def froude_number(self) -> float:
        """Fr = v / sqrt(g h) [-]."""
        return self.speed / math.sqrt(self.gravity * self.flow_height)

    @property
    def weight_on_base(self) -> float:
        """m2 g cos(theta) [N/m], with which a barrier that may slide presses on its base; 0 for a fixed one."""
        return (self.barrier_mass or 0.0) * self.gravity * math.cos(math.radians(self.slope))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the closed form does not see, in sentences."""
        if self.slope == 0:
            return self.remarks
        pull = self.flow_mass * self.gravity * math.sin(math.radians(self.slope))
        seen = (
            "the flow's weight along it is left out"
            if self.fixed
            else "the barrier's weight along it is counted, the flow's is left out"
        )
        effect = "pushes on: forces and displacements come out too small" if pull > 0 else "holds the flow back"
        size = f"{abs(pull) / 1e3:.3g} kN/m"
        return (
            *self.remarks,
            f"Slope of {self.slope:g} degrees: {seen}, {size}, which {effect}.",
        )

    @property
    def doubts(self) -> tuple[str, ...]:
        """Numbers that are likely not those meant, of a scene that no scenario tells: a slip of the unit, mostly."""
        found = []
        if not 500.0 <= self.density <= 4000.0:
            meant = f"; in t it makes {1e3 * self.density:.4g} kg/m^3" if 0.5 <= self.density <= 4.0 else ""
            found.append(
                f"The flow's density, its mass over length and depth, is {self.density:.3g} kg/m^3; debris flows have "
                f"1300 to 2300{meant}."
            )
        if self.barrier_mass is not None and self.barrier_mass < 0.01 * self.flow_mass:
            found.append(
                f"barrier_mass = {self.barrier_mass:g} kg/m is less than a hundredth of the flow's {self.flow_mass:g} "
                f"kg/m; {1e3 * self.barrier_mass:g} was probably meant, the value is in t/m."
            )
        if self.base_friction is not None and self.base_friction > 2.0:
            tangent = math.tan(math.radians(self.base_friction))
            meant = f"; where degrees were meant, {tangent:.2g}" if self.base_friction < 90.0 else ""
            found.append(
                f"base_friction = {self.base_friction:g} is the tangent of "
                f"{math.degrees(math.atan(self.base_friction)):.0f} degrees{meant}."
            )
        if self.speed > 30.0:
            found.append(f"speed = {self.speed:g} m/s is above any debris flow's; in km/h, {self.speed / 3.6:.3g} m/s.")
        if self.face_angle is not None and 0.0 < self.face_angle <= 1.6:
            found.append(f"face_angle = {self.face_angle:g} degrees; in radians, {math.degrees(self.face_angle):.3g}.")
        return tuple(found)

    @property
    def paper_geometry_change(self) -> float:
        """The paper's lambda for this kind of barrier [-]."""
        return PAPER_GEOMETRY_CHANGE["fixed" if self.fixed else "sliding"]

    def impact(self, **model: Any) -> Impact:
        """The impact, with what is given in `model`: geometry change, rise ratio, variant, ... (see `Impact`)."""
        if "geometry_change" not in model and "s1max" not in model:
            model["geometry_change"] = self.paper_geometry_change
        scene = {
            "flow_mass": self.flow_mass,
            "barrier_mass": self.barrier_mass,
            "flow_length": self.flow_length,
            "flow_height": self.flow_height,
            "speed": self.speed,
            "base_friction": self.base_friction,
            "gravity": self.gravity,
            "slope": self.slope,
        }
        return Impact(**(scene | {"rise_ratio": ASSUMED_RISE_RATIO} | model))


def read_scene(path: str | Path) -> Scene:
    """Read a scenario file of the simulator, or the scenario of a run folder.

    Raises:
        ScenarioError: the file cannot be read, or is no scenario; as the simulator says it.
        SceneError: the closed form has no answer to the scenario.
    """
    from warp_mpm.scenario import Scenario

    path = Path(path)
    if path.is_dir():
        path = path / "scenario.json"
    return scene_of(Scenario.load(path), str(path))


def scene_of(scenario: Scenario, name: str = "The scenario") -> Scene:
    """The numbers of a scenario; `name` is for messages.

    Raises:
        SceneError: it has no barrier, one that follows a given velocity, or a flow that does not move towards it.
    """
    from warp_mpm.slips import slips

    flow, barrier = scenario.flow, scenario.barrier
    if barrier is None:
        raise SceneError(f"{name}: barrier is null, the closed form needs one.")
    motion, shape = barrier.motion, barrier.shape
    if motion.kind == "prescribed":
        raise SceneError(f"{name}: barrier.motion.kind is {motion.kind!r}, the closed form knows fixed and sliding.")
    velocity_x, velocity_y = flow.velocity_m_per_s
    remarks = []
    if flow.inflow is not None:
        velocity_x = max(velocity_x, flow.inflow.greatest_speed)
        remarks.append(
            "Of a flow that arrives the greatest depth and velocity are taken, and all of its volume; several surges "
            "are taken as one."
        )
        if any(part.material != flow.material for part in flow.arriving):
            remarks.append("What arrives counts with its own mass, and in all else as of flow.material.")
    if flow.deposits:
        remarks.append("The deposits are left out.")
    if velocity_x <= 0:
        raise SceneError(f"{name}: flow.velocity_m_per_s[0] is {velocity_x:g}, the flow must move towards the barrier.")
    if not scenario.gravity.acceleration_m_per_s2 > 0:
        raise SceneError(f"{name}: gravity.acceleration_m_per_s2 is 0, the closed form needs weight on the base.")
    remarks += slips(scenario)
    if velocity_y != 0:
        remarks.append(f"The flow's vertical velocity of {velocity_y:g} m/s is left out.")
    remarks += _of_material(scenario)
    if scenario.ground is not None and (scenario.ground.friction != 0 or any(scenario.ground.drags)):
        remarks.append("The friction between flow and ground is left out.")
    if scenario.ground is not None and scenario.ground.profile_m is not None:
        remarks.append("The ground's profile is left out: the closed form knows one slope, gravity.tilt_deg.")
    if scenario.barriers:
        remarks.append("Further barriers are left out.")
    return Scene(
        title=scenario.title,
        flow_mass=flow.mass,
        flow_length=flow.equivalent_length,
        flow_height=flow.depth,
        speed=velocity_x,
        barrier_mass=barrier.mass,
        base_friction=motion.base_friction_coefficient if motion.kind == "sliding" else None,
        gravity=scenario.gravity.acceleration_m_per_s2,
        slope=scenario.gravity.tilt_deg,
        porosity=flow.material.porosity,
        face_angle=shape.built_face_angle_deg if shape.kind != "wall" else 90.0,
        barrier_height=shape.base_crest_height[2] if shape.kind != "wall" else math.inf,
        barrier_density=barrier.density,
        distance=-float(flow.polygon[:, 0].max()),
        sets_out=_first_arrival(flow.inflow) if flow.inflow is not None and flow.shape is None else 0.0,
        formulation=flow.formulation,
        law=flow.material.law,
        remarks=tuple(remarks),
    )


def _first_arrival(inflow: Any) -> float:
    """Time [s] from which something arrives: depths are linear between the times of the table."""
    first = next(place for place, depth in enumerate(inflow.depths_m) if depth > 0)
    return float(inflow.times_s[max(first - 1, 0)])


def _of_material(scenario: Any) -> list[str]:
    """What the closed form does not know of the flow's material, where it is another one than the paper's."""
    flow, found = scenario.flow, []
    if flow.material.law != FITTED_LAW:
        found.append(f"The material's law, {flow.material.law}, is left out: the closed form knows no strength.")
    if flow.material.dilatancy is not None:
        found.append(
            "The flow's dilatancy is left out: whether it liquefies or locks as it arrives is not in the closed form."
        )
    if flow.pore_pressure_ratio_range is not None:
        found.append("The flow's pore pressure at the start is left out.")
    if flow.sheared:
        found.append("How the flow's velocity varies over its depth is left out: the closed form takes the mean.")
    return found
