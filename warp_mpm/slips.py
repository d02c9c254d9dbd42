"""Values that are allowed and absurd: a slip of the unit, mostly. Each sentence names the value that may be meant.

They come with the other remarks on a scene wherever one is read: `check`, `run`, `plan`, `sweep`, the report, and what
the closed form says of a scenario.
"""

from __future__ import annotations

import math
from typing import Any

from warp_mpm import geometry
from warp_mpm.scenario import Barrier, Prescribed, Scenario, Sliding, Trapezoid

IN_TONNES = 20.0
"""Density [kg/m³] below which a value is one in t/m³."""

LIGHTEST, HEAVIEST = 500.0, 4500.0
"""Densities [kg/m³] between which a barrier's lies: gabions have 1700, steel frames filled with air some hundreds."""

SOFTEST = 1e4
"""Young's modulus [Pa] below which no soil's lies; mud that flows has some 1e5."""

SOFTEST_LIQUID = 1e5
"""Bulk modulus [Pa] below which no liquid's lies, however softened for the time step."""

SMALLEST_ANGLE = 1.6
"""Angle [degrees] up to which it looks like radians, of which a right angle has 1.57, or like a tangent."""

STEEPEST_SMOOTH = 1.0
"""Slope [degrees] above which a flow on smooth ground gains more speed than any that slides on soil."""

FASTEST = 30.0
"""Speed [m/s] above which no debris flow is known."""


def slips(scenario: Scenario) -> list[str]:
    """One sentence for each value that is likely not the one meant."""
    return [*_material(scenario), *_angles(scenario), *_barrier(scenario), *_motion(scenario)]


def _material(scenario: Scenario) -> list[str]:
    material: Any = scenario.flow.material
    found = []
    for field, least, usual in (
        ("grain_density_kg_per_m3", 1000.0, "rock has about 2650"),
        ("liquid_density_kg_per_m3", 500.0, "water has 1000"),
    ):
        value = getattr(material, field, None)
        if value is not None and value < least:
            meant = f": {1e3 * value:g} was probably meant, the value is in t/m³" if value < IN_TONNES else ""
            found.append(f"flow.material.{field} = {value:g} is lighter than water; {usual}{meant}.")
    found += _stiffness("young_modulus_Pa", material.young_modulus_Pa, SOFTEST, "soil", 1e3)
    if hasattr(material, "liquid_bulk_modulus_Pa"):
        found += _stiffness("liquid_bulk_modulus_Pa", material.liquid_bulk_modulus_Pa, SOFTEST_LIQUID, "liquid", 1e4)
    return found


def _stiffness(field: str, value: float, softest: float, what: str, mega: float) -> list[str]:
    """Pa where MPa or kPa were meant; below `mega` they were MPa."""
    if value >= softest:
        return []
    factor, unit = (1e6, "MPa") if value < mega else (1e3, "kPa")
    return [
        f"flow.material.{field} = {value:g} Pa is softer than any {what}; {factor * value:g} was probably meant, the "
        f"value is in {unit}."
    ]


def _angles(scenario: Scenario) -> list[str]:
    given: dict[str, float | None] = {
        "flow.material.friction_angle_deg": getattr(scenario.flow.material, "friction_angle_deg", None),
    }
    barrier = scenario.barrier
    if barrier is not None:
        if isinstance(barrier.shape, Trapezoid):
            given["barrier.shape.face_angle_deg"] = barrier.shape.face_angle_deg
        if isinstance(barrier.motion, Sliding):
            given["barrier.motion.base_soil_friction_angle_deg"] = barrier.motion.base_soil_friction_angle_deg
    found = []
    for field, value in given.items():
        if value is not None and 0.0 < value <= SMALLEST_ANGLE:
            if field.endswith("friction_angle_deg"):
                meant = f"{math.degrees(math.atan(value)):.3g}° was probably meant, the value is the angle's tangent"
            else:
                meant = f"{math.degrees(value):.3g}° was probably meant, the value is in radians"
            found.append(f"{field} = {value:g}° is next to nothing; {meant}.")
    return found


def _barrier(scenario: Scenario) -> list[str]:
    barrier = scenario.barrier
    if barrier is None:
        return []
    found = []
    if isinstance(barrier.shape, Trapezoid) and barrier.shape.face_angle_deg is None:
        built = barrier.shape.built_face_angle_deg
        if built < 10.0:
            found.append(
                f"The barrier's face, from its widths and height, rises at {built:.2g}°, as a ramp: look at "
                "barrier.shape.base_width_m, crest_width_m and height_m."
            )
    if isinstance(barrier.motion, Sliding):
        found += _weight(barrier, scenario.flow.mass)
    return found


def _weight(barrier: Barrier, flow_mass: float) -> list[str]:
    """A barrier that weighs next to nothing, or more than any."""
    motion = barrier.motion
    assert isinstance(motion, Sliding)
    if motion.density_kg_per_m3 is not None:
        density = motion.density_kg_per_m3
        if LIGHTEST <= density <= HEAVIEST:
            return []
        told = f"barrier.motion.density_kg_per_m3 = {density:g} kg/m³"
        if density < IN_TONNES:
            return [f"{told} is lighter than snow; {1e3 * density:g} was probably meant, the value is in t/m³."]
        return [f"{told} lies outside {LIGHTEST:g} to {HEAVIEST:g}; soil and gabions have about 2000, concrete 2400."]
    mass = motion.mass_kg_per_m
    assert mass is not None
    told = f"barrier.motion.mass_kg_per_m = {mass:,.10g} kg/m"
    if isinstance(barrier.shape, Trapezoid):
        area = geometry.area(barrier.shape.outline)
        density = mass / area
        if LIGHTEST <= density <= HEAVIEST:
            return []
        where = f"{told} makes {density:.3g} kg/m³ over the barrier's {area:.3g} m²"
        for factor, unit in ((1e3, "t/m"), (1e3 / 9.81, "kN/m")):
            if 1000.0 <= factor * density <= HEAVIEST:
                return [f"{where}; {factor * mass:,.6g} was probably meant, the value is in {unit}."]
        return [f"{where}; soil and gabions have about 2000, concrete 2400: about {2000.0 * area:,.3g} kg/m."]
    if mass < 1e-2 * flow_mass:
        return [
            f"{told} is less than a hundredth of the flow's {flow_mass:,.3g} kg/m; {1e3 * mass:,.6g} was probably "
            "meant, the value is in t/m."
        ]
    return []


def _motion(scenario: Scenario) -> list[str]:
    flow, found = scenario.flow, []
    along, _ = flow.velocity_m_per_s
    pull, press = scenario.gravity.vector
    if flow.speed > FASTEST:
        found.append(
            f"The flow's speed of {flow.speed:g} m/s is above {FASTEST:g} m/s, and no debris flow is known to be as "
            f"fast; where km/h were meant, {flow.speed / 3.6:.3g} m/s."
        )
    if scenario.barrier is not None and not isinstance(scenario.barrier.motion, Prescribed):
        held = scenario.ground.friction * -press if scenario.ground is not None else 0.0
        if along < 0.0 and pull <= held:
            found.append(
                f"The flow runs away from the barrier, which lies downstream of x = 0: flow.velocity_m_per_s[0] = "
                f"{along:g}; {-along:g} was probably meant."
            )
    tilt = scenario.gravity.tilt_deg
    smooth = scenario.ground is not None and scenario.ground.friction == 0.0
    if smooth and abs(tilt) > STEEPEST_SMOOTH and scenario.gravity.acceleration_m_per_s2 > 0.0:
        angle = getattr(flow.material, "friction_angle_deg", 0.0)
        likely = f"; a rough bed has about tan φ' = {math.tan(math.radians(angle)):.2g}" if angle else ""
        found.append(
            f"The ground is smooth (ground.friction = 0) and falls by gravity.tilt_deg = {tilt:g}°: nothing holds the "
            f"flow, nor a deposit{likely}."
        )
    return found
