"""Greatest speeds and pressures that energy and wave theory allow in a scene, with their derivations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warp_mpm.scenario import Prescribed, Scenario, TwoPhaseMaterial
from warp_mpm.scenario.site import lowest_ground
from warp_mpm.simulator.bodies.of_scene import barrier_bodies, ground_body
from warp_mpm.time_step import step_limits


def impact_speed(scenario: Scenario) -> float:
    """Greatest speed [m/s] at which material can meet a surface, by energy alone: u = sqrt(v0² + 2 g H) + v_b.

    H is the height that it can fall, with what it covers downhill on a slope; v_b the speed of a driven barrier.
    """
    outline = np.concatenate(scenario.flow.outlines)
    gx, gy = scenario.gravity.vector
    lowest = scenario.domain.bottom_m
    if scenario.ground is not None:
        lowest = lowest_ground(scenario, *_between(scenario))
    height = outline[:, 1].max() - (lowest if lowest is not None else outline[:, 1].min())
    time = scenario.output.end_time_s
    downhill = abs(gx) * (scenario.flow.greatest_speed * time + 0.5 * abs(gx) * time**2)
    speed = math.sqrt(scenario.flow.greatest_speed**2 + 2.0 * (abs(gy) * height + downhill))
    driven = [barrier.motion for _, _, barrier in scenario.all_barriers if isinstance(barrier.motion, Prescribed)]
    speed += max((abs(velocity) for motion in driven for velocity in motion.velocities_m_per_s), default=0.0)
    return speed


def _between(scenario: Scenario) -> tuple[float, float]:
    """Least and greatest x [m] of the domain, of what is given of it."""
    left, right = scenario.domain.left_m, scenario.domain.right_m
    return -math.inf if left is None else left, math.inf if right is None else right


def shock_speed(scenario: Scenario, speed: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
    """Speed U [m/s] of the shock that stops material of `speed` u [m/s], relative to the material in front of it.

    Rankine-Hugoniot: mass rho0 U = rho (U - u), momentum p = rho0 U u. With p = rho0 c² (rho / rho0 - 1), the law of
    the skeleton (that of the liquid, with the logarithm of the density, is softer), U (U - u) = c², so that
    U = u / 2 + sqrt(u² / 4 + c²). Where that would take more than the voids, rho / rho0 = U / (U - u) stops at
    1 / (1 - n), where U = u / n.
    """
    sound, porosity = step_limits(scenario).sound_speed, scenario.flow.material.porosity
    return np.maximum(0.5 * speed + np.sqrt(0.25 * speed**2 + sound**2), speed / porosity)


def pressure_bound(scenario: Scenario, speed: float) -> float:
    """Greatest pressure [Pa] where the fastest point has `speed` v [m/s], and rho g h at rest beneath.

    Behind the shock that stops it, it is rho U(v) v: water hammer at low speed, stagnation at high. Where two surfaces
    meet, each stops the part of the velocity across it, one behind the other, and the pressures add: for a velocity at
    the angle alpha, rho (U(v cos alpha) v cos alpha + U(v sin alpha) v sin alpha), sqrt(2) rho c v at most if v is
    small against c and no more than on one surface if it is great. Of all angles, the worst.
    """
    material, depth = scenario.flow.material, float(np.ptp(scenario.flow.polygon[:, 1]))
    at_rest = material.density * scenario.gravity.acceleration_m_per_s2 * depth
    angle = np.linspace(0.0, 0.5 * math.pi, 91)
    one, other = speed * np.cos(angle), speed * np.sin(angle)
    hammer = material.density * (shock_speed(scenario, one) * one + shock_speed(scenario, other) * other)
    return float(hammer.max()) + at_rest


def voids_close(scenario: Scenario) -> bool:
    """Whether impact or weight press the voids of the skeleton shut where it is alone, its liquid drained or apart.

    The pressure rho U u + rho g h, with the skeleton's own c² = E_oed / rho, reaches rho c² n / (1 - n), at which the
    law of the skeleton has no voids left.
    """
    material, speed = scenario.flow.material, impact_speed(scenario)
    stiffness, n = material.oedometric_modulus / material.density, material.porosity
    at_rest = scenario.gravity.acceleration_m_per_s2 * float(np.ptp(scenario.flow.polygon[:, 1]))
    shock = 0.5 * speed + math.sqrt(0.25 * speed**2 + stiffness)
    return shock * speed + at_rest >= stiffness * n / (1.0 - n)


def closing_angle(scenario: Scenario) -> float:
    """Least angle [rad] between a side of the flow at t = 0 and a surface that it is about to meet; pi / 2 at most."""
    outline = scenario.flow.polygon
    area = 0.5 * np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1])
    begin, end = (outline, np.roll(outline, -1, axis=0)) if area > 0.0 else (np.roll(outline, -1, axis=0), outline)
    along = (end - begin) / np.linalg.norm(end - begin, axis=1)[:, None]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    surfaces = []
    bodies = barrier_bodies(scenario)
    if scenario.ground is not None:
        bodies.append(ground_body(scenario.ground))
    for body in bodies:
        pieces = body.outline.segments
        surfaces += [((nx, ny), offset) for (nx, ny), offset in zip(pieces.normal, pieces.offset, strict=True)]
    domain = scenario.domain
    if domain.left_edge == "wall" and domain.left_m is not None:
        surfaces.append(((1.0, 0.0), domain.left_m))
    if domain.right_edge == "wall" and domain.right_m is not None:
        surfaces.append(((-1.0, 0.0), -domain.right_m))
    least = 0.5 * math.pi
    for normal, offset in surfaces:
        facing = outward @ normal < -1e-9
        apart = np.maximum(begin @ normal, end @ normal) - offset > 1e-9
        if (facing & apart).any():
            cosine = -(outward @ normal)[facing & apart].min()
            least = min(least, math.acos(min(cosine, 1.0)))
    return least


def speed_bound(scenario: Scenario) -> float:
    """Greatest speed [m/s] of a material point: that of the jet where the flow closes on a surface.

    A flow of speed u meets a surface at some angle, with u_n across and u_t along it. Its side and the surface enclose
    the angle theta and close at a point that runs along the surface at u_n / tan(theta), faster by at most pi / 2 as
    the liquid piles up before it (Wagner 1932): w = (pi / 2) u_n / tan(theta). Beyond the speed U of the shock there is
    no jet, as no news of the free surface reaches the point (Lesser 1981): w <= U. Seen from that point the flow comes
    at sqrt(w² + u_n²) with a pressure of at most that of the shock, rho U u_n, and leaves along the surface without:
    by Bernoulli at sqrt(w² + u_n² + 2 U u_n); seen from the surface faster by w + u_t. Of all angles, the worst. Liquid
    that drains out of its skeleton takes all of the pressure on its own density, so that there 2 U u_n is greater by
    rho / rho_L. What later breaks over the flow may close at smaller angles still; the bound takes those of the scene.
    """
    material = scenario.flow.material
    lightness = 1.0
    if isinstance(material, TwoPhaseMaterial):
        lightness = max(1.0, material.density / material.liquid_density_kg_per_m3)
    angle = np.linspace(0.0, 0.5 * math.pi, 181)
    speed, theta = impact_speed(scenario), closing_angle(scenario)
    across, along = speed * np.cos(angle), speed * np.sin(angle)
    shock = shock_speed(scenario, across)
    running = shock if theta == 0.0 else np.minimum(shock, 0.5 * math.pi * across / math.tan(theta))
    return float(np.max(along + running + np.sqrt(running**2 + across**2 + 2.0 * lightness * shock * across)))
