"""A scene in a few words."""

from __future__ import annotations

from typing import Any

import numpy as np

from warp_mpm.extent import Travel, barrier_travel, domain_extent
from warp_mpm.scenario import Barrier, Ground, Prescribed, Scenario, Skeleton, Sliding, Trapezoid
from warp_mpm.scenario.inflow import surges_of
from warp_mpm.scenario.material import formulation_of


def described(scenario: Scenario) -> list[str]:
    """A scene in two lines: flow and ground; barrier and run. Between them, where there is such, one on what arrives
    and what lies there."""
    flow, numerics, ground, tilt = scenario.flow, scenario.numerics, scenario.ground, scenario.gravity.tilt_deg
    speed = f"v = {flow.speed:.4g} m/s"
    if scenario.gravity.acceleration_m_per_s2 > 0.0:
        speed += f" (Fr {flow.speed / (scenario.gravity.acceleration_m_per_s2 * flow.depth) ** 0.5:.2f})"
    if flow.sheared:
        paces = flow.paces(np.linspace(0.0, 1.0, 1001))
        speed += f", from {paces.min():.3g} to {paces.max():.3g} of it over the depth"
    slope = "no ground" if ground is None else f"slope {tilt:g}°, {_ground(ground)}"
    material = flow.formulation.replace("_", "-")
    points = (flow.volume + flow.deposited_volume) / numerics.spacing_m**2 * numerics.points_per_cell
    return [
        f"{material} flow of {flow.volume:g} m³/m, {flow.volume * flow.material.density:,.0f} kg/m, "
        f"{flow.depth:g} m deep, {speed}; {slope}",
        *_arriving(scenario),
        f"{'; '.join(_barriers(scenario))}; ends at {scenario.output.end_time_s:g} s; about {points:,.0f} points on a "
        f"{numerics.spacing_m:g} m grid, {numerics.precision}",
    ]


def numbers(scenario: Scenario) -> dict[str, float | str | None]:
    """What a scene comes to, SI; None of what it does not have."""
    flow, barrier = scenario.flow, scenario.barrier
    material: Any = flow.material
    gravity = scenario.gravity.acceleration_m_per_s2
    shape = barrier.shape if barrier is not None else None
    base, crest, height = shape.base_crest_height if isinstance(shape, Trapezoid) else (None, None, None)
    edges = domain_extent(scenario).edges
    return {
        "formulation": flow.formulation,
        "flow_volume_m3_per_m": flow.volume,
        "flow_mass_kg_per_m": flow.volume * material.density,
        "flow_depth_m": flow.depth,
        "flow_length_m": flow.equivalent_length,
        "flow_speed_m_per_s": flow.speed,
        "froude_number": flow.speed / (gravity * flow.depth) ** 0.5 if gravity > 0.0 else None,
        "bulk_density_kg_per_m3": material.density,
        "porosity": material.porosity,
        "friction_angle_deg": getattr(material, "friction_angle_deg", None),
        "hydraulic_conductivity_m_per_s": getattr(material, "hydraulic_conductivity", None),
        "young_modulus_Pa": material.young_modulus_Pa,
        "lateral_stress_ratio": flow.lateral_stress_ratio,
        "slope_deg": scenario.gravity.tilt_deg,
        "ground_friction": None if scenario.ground is None else scenario.ground.friction,
        "barrier_motion": None if barrier is None else barrier.motion.kind,
        "barrier_mass_kg_per_m": None if barrier is None else barrier.mass,
        "barrier_base_width_m": base,
        "barrier_crest_width_m": crest,
        "barrier_height_m": height,
        "barrier_face_angle_deg": shape.built_face_angle_deg if isinstance(shape, Trapezoid) else None,
        "end_time_s": scenario.output.end_time_s,
        "spacing_m": scenario.numerics.spacing_m,
        "material_points": round(flow.volume / scenario.numerics.spacing_m**2 * scenario.numerics.points_per_cell),
        "domain_left_m": edges.left,
        "domain_right_m": edges.right,
        "domain_bottom_m": edges.bottom,
        "domain_top_m": edges.top,
    }


def _arriving(scenario: Scenario) -> list[str]:
    """What arrives and what lies there, in a line; none where neither does."""
    flow, words = scenario.flow, []
    if flow.inflow is not None:
        inflow = flow.inflow
        surges = len(surges_of(inflow))
        words.append(
            f"{inflow.volume:.4g} m³/m arrive at x = {inflow.x_m:g} m from t = {inflow.times[0]:g} to "
            f"{inflow.times[-1]:g} s, in {surges} surge{'' if surges == 1 else 's'}, up to "
            f"{inflow.greatest_depth:.3g} m deep and {inflow.greatest_speed:.3g} m/s fast"
        )
        late = inflow.volume - inflow.volume_until(scenario.output.end_time_s)
        if late > 1e-9 * inflow.volume:
            words.append(f"of it {late:.4g} m³/m after the end of the run")
        words += _materials_arriving(scenario)
    if flow.deposits:
        words.append(
            f"{len(flow.deposits)} deposit{'s' if len(flow.deposits) > 1 else ''} of {flow.deposited_volume:.4g} m³/m"
        )
        words += [
            f"deposit {number} {_told(own)}"
            for number, own in enumerate(map(flow.material_of, flow.deposits))
            if own != flow.material
        ]
    return ["; ".join(words)] if words else []


def _materials_arriving(scenario: Scenario) -> list[str]:
    """Of what arrives, materials that are not the flow's."""
    flow = scenario.flow
    found: dict[float, list[Skeleton]] = {}
    for part in flow.arriving:
        found.setdefault(part.begin, []).append(part.material)
    words = []
    for begin, own in found.items():
        if own != [flow.material]:
            densities = [one.density for one in own]
            among = f" to {max(densities):,.0f} kg/m³" if len(own) > 1 else ""
            lightest = own[int(np.argmin(densities))]
            words.append(("" if begin < 0.0 else f"from t = {begin:g} s on ") + f"{_told(lightest)}{among}")
    return words


def _told(material: Skeleton) -> str:
    """A material in three words."""
    return f"{formulation_of(material).replace('_', '-')}, {material.law}, {material.density:,.0f} kg/m³"


def described_material(scenario: Scenario) -> str:
    """The flow's material in one line, as a geotechnical engineer asks for it, with its length."""
    flow = scenario.flow
    material: Any = flow.material
    parts = [f"bulk density {material.density:,.4g} kg/m³", f"n = {material.porosity:g}"]
    if hasattr(material, "friction_angle_deg"):
        parts.append(f"φ' = {material.friction_angle_deg:g}°")
    if hasattr(material, "hydraulic_conductivity"):
        parts.append(f"k = {material.hydraulic_conductivity:.3g} m/s")
    parts.append(f"E = {material.young_modulus_Pa / 1e6:.4g} MPa")
    if flow.pore_pressure_ratio_range is not None:
        least, most = flow.pore_pressure_ratio_range
        parts.append(f"λ_p = {least:g}" + (f" to {most:g}" if most > least else ""))
    whence = f"by the law {material.law}" if flow.lateral_stress_coefficient is None else "given"
    parts.append(f"K0 = {flow.lateral_stress_ratio:.3g} ({whence})")
    return f"{', '.join(parts)}; L = {flow.equivalent_length:.4g} m, of the box of its volume and depth"


def described_domain(scenario: Scenario) -> str:
    """The domain in one line: its edges, given or fitted, and the speed that was reckoned with."""
    extent, domain = domain_extent(scenario), scenario.domain
    edges = extent.edges
    bottom = "" if scenario.ground is not None else f"y = {edges.bottom:.4g} m, "
    moves = scenario.plain and scenario.barrier is not None and barrier_travel(scenario) != Travel()
    rides = ", riding with the barrier" if moves else ""
    words = f"domain from x = {edges.left:.4g} to {edges.right:.4g} m, {bottom}up to y = {edges.top:.4g} m{rides}"
    if None in (domain.left_m, domain.right_m, domain.top_m):
        words += f"; fitted to speeds up to {extent.speed:.3g} m/s"
    ground = scenario.ground
    if ground is not None and ground.profile_m is not None:
        first, last = ground.ends
        ends = [f"x = {x:.4g} m" for x, edge in ((first, edges.left), (last, edges.right)) if x == edge]
        words += f", and no further than the ground's profile, {' and '.join(ends)}" if ends else ""
    return words


def _ground(ground: Ground) -> str:
    frictions = ", ".join(f"{friction:g}" for _, friction in ground.frictions)
    if ground.profile_m is None:
        return f"ground friction {frictions}"
    low, high = ground.profile[:, 1].min(), ground.profile[:, 1].max()
    return (
        f"ground of {len(ground.profile)} points from x = {ground.ends[0]:.4g} to {ground.ends[1]:.4g} m, "
        f"y = {low:.4g} to {high:.4g} m, friction {frictions}"
    )


def _barriers(scenario: Scenario) -> list[str]:
    found = [] if scenario.barrier is None and scenario.barriers else [_barrier(scenario.barrier)]
    return found + [f"{one.name} at x = {one.x_m:g} m: {_barrier(one)}" for one in scenario.barriers]


def _barrier(barrier: Barrier | None) -> str:
    if barrier is None:
        return "no barrier"
    words = "barrier: wall without end"
    if isinstance(barrier.shape, Trapezoid):
        _, _, height = barrier.shape.base_crest_height
        words = f"barrier H = {height:.4g} m, β = {barrier.shape.built_face_angle_deg:.3g}°"
    if isinstance(barrier.motion, Sliding):
        return (
            f"{words}, {barrier.mass:,.0f} kg/m, sliding with tan δ_b = {barrier.motion.base_friction_coefficient:.3g}"
        )
    return f"{words}, {'driven' if isinstance(barrier.motion, Prescribed) else 'fixed'}"
