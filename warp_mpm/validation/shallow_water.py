"""Bore and dam break: the perfect fluid in depth-averaged motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Curve, Outcome, Panel, compared, reference, reported
from warp_mpm.validation.scenes import INVISCID, box, fixed, scene

G = 9.81
FLUID = INVISCID | {"liquid_bulk_modulus_Pa": 3e6}
"""Sound at 59 m/s, ten times the fastest flow here, keeps the time step long."""


def jump_depth_ratio(froude: float) -> float:
    """Depth behind a bore that leaves a wall, over the arriving depth: root x > 1 of (x − 1)²(x + 1) = 2 Fr² x."""
    roots = np.roots([1.0, -1.0, -1.0 - 2.0 * froude**2, 1.0])
    return float(max(roots.real))


def _depths(simulation: Simulation, edges: Array) -> Array:
    """Depth [cells] of the flow between `edges`."""
    points = simulation.points()
    mass = points["solid_mass"] + points["liquid_mass"]
    return np.histogram(points["position"][:, 0], bins=edges, weights=mass)[0] / (
        simulation.scenario.flow.material.density * np.diff(edges)
    )


def bore(quick: bool) -> Outcome:
    froude, depth, spacing = 1.843, 1.0, 0.2 if quick else 0.1
    speed = froude * math.sqrt(G * depth)
    ratio = jump_depth_ratio(froude)
    bore_speed = speed / (ratio - 1.0)
    pool, reservoir = 6.0, 60.0
    slope = 0.5 * (ratio - 1.0)  # half-width of the first front: 45°
    # Until the rarefaction from the reservoir's open end meets the bore.
    end = (reservoir - 4.0) / (speed + bore_speed + math.sqrt(G * depth))
    outline = [
        [-reservoir - pool, 0.0],
        [0.0, 0.0],
        [0.0, ratio],
        [-pool + slope, ratio],
        [-pool - slope, depth],
        [-reservoir - pool, depth],
    ]
    simulation = Simulation(
        scene(
            "bore on a wall",
            outline,
            "undrained",
            end_time=end,
            velocity=(speed, 0.0),
            soil=FLUID,
            barrier=fixed({"kind": "wall"}),
            spacing_m=spacing,
            domain={"top_m": 10.0},
        )
    )
    points = simulation.points()
    local = np.interp(points["position"][:, 0], [-pool - slope, -pool + slope], [depth, ratio * depth])
    velocity = np.zeros_like(points["solid_velocity"])
    velocity[:, 0] = (speed + bore_speed) * depth / local - bore_speed  # the same discharge through every section
    simulation.set_points(solid_velocity=velocity)
    times = np.linspace(0.0, end, 101)[1:]
    edges = np.arange(-reservoir - pool, 0.25, 0.5)
    middle = 0.5 * (edges[1:] + edges[:-1])
    force, place, height, profiles = [], [], [], []
    for time in times:
        simulation.advance(float(time))
        force.append(simulation.sample()["impact_force_x"])
        depths = np.convolve(_depths(simulation, edges), np.full(4, 0.25), "same")
        high = int(np.argmax(depths > 0.5 * (1.0 + ratio) * depth))
        share = (0.5 * (1.0 + ratio) * depth - depths[high - 1]) / (depths[high] - depths[high - 1])
        place.append(-float(middle[high - 1] + share * (middle[high] - middle[high - 1])))
        height.append(float(_depths(simulation, np.array([-0.6 * place[-1], 0.0]))[0]))
        profiles.append(_depths(simulation, edges))
    unit = 0.5 * simulation.scenario.flow.material.density * G * depth**2
    steady = times > 0.25 * end
    travel = np.polyfit(times, place, 1)[0]
    after = pool + bore_speed * times[-1]
    checks = [
        compared(
            "force on the wall, mean of the plateau",
            "½ ρ g h²",
            float(np.array(force)[steady].mean()) / unit,
            ratio**2,
            0.10,
        ),
        compared("depth behind the bore", "h", float(np.array(height)[steady].mean()) / depth, ratio, 0.10),
        compared(
            "speed of the bore",
            "m/s",
            float(travel),
            bore_speed,
            0.10,
            remark="the roller breaks again and again, so that the place of the front is uncertain by a depth",
        ),
        reported(
            "force on the wall, mean over the last quarter",
            "½ ρ g h²",
            float(np.array(force)[times > 0.75 * end].mean()) / unit,
            reference=ratio**2,
        ),
    ]
    return Outcome(
        checks=checks,
        panels=[
            Panel(
                "force on the wall",
                "time [s]",
                "F / (½ ρ g h²)",
                [reference(times, np.full(100, ratio**2), "x²"), Curve(times, np.array(force) / unit, "ours")],
            ),
            Panel(
                f"depth at t = {end:.2f} s",
                "x [m]",
                "depth [m]",
                [
                    reference([-reservoir, -after, -after, 0.0], [depth, depth, ratio, ratio], "shallow water"),
                    Curve(middle, profiles[-1], f"h/{depth / spacing:g}"),
                ],
            ),
        ],
        remarks=[
            "The bore starts formed: a front of 45° with the depths and the discharge of the jump on both sides. A "
            "front that arrives at a bare wall first throws a jet up along it, which shallow water does not know and "
            "whose fall stirs the bore for longer than the reservoir lasts."
        ],
    )


def dam_break(quick: bool) -> Outcome:
    depth, length = 1.0, 10.0
    spacing = 0.05 if quick else 0.04
    celerity, unit = math.sqrt(G * depth), math.sqrt(depth / G)
    moments = (2.0, 4.0, 6.0)
    simulation = Simulation(
        scene(
            "dam break",
            box(-length, 0.0, depth),
            "undrained",
            end_time=moments[-1] * unit,
            soil=FLUID,
            spacing_m=spacing,
            domain={"left_edge": "wall", "left_m": -length, "right_m": 20.0, "top_m": 2.0},
        )
    )
    edges = np.arange(-length, 20.0, 0.25)
    middle = 0.5 * (edges[1:] + edges[:-1])
    checks, curves = [], []
    for moment in moments:
        time = moment * unit
        simulation.advance(time)
        ours, exact = _depths(simulation, edges), ritter_depth(middle, time, depth)
        fan = (middle > -celerity * time) & (middle < 1.5 * celerity * time)
        error = float(np.abs(ours - exact)[fan].sum() / exact[fan].sum())
        name = f"depth in −1 < x/(c_0 t) < 1.5, L1, at t √(g/h_0) = {moment:g}"
        if moment == moments[-1]:
            checks.append(
                compared(
                    name, "-", error, 0.0, 0.05, scale=1.0, remark="the start is not shallow; the error falls with time"
                )
            )
        else:
            checks.append(reported(name, "-", error, remark="the start is not shallow"))
        curves += [
            reference(middle / (celerity * time), exact, "Ritter" if moment == moments[0] else ""),
            Curve(middle / (celerity * time), ours, f"t √(g/h_0) = {moment:g}"),
        ]
    front = float(simulation.points()["position"][:, 0].max())
    checks.append(
        reported(
            "front, over 2 c_0 t",
            "-",
            front / (2.0 * celerity * time),
            reference=1.0,
            remark="a front of a tip as thin as a cell lags; 5 to 15 % are usual",
        )
    )
    return Outcome(checks=checks, panels=[Panel("depth", "x / (c_0 t)", "depth [m]", curves, x_range=(-1.5, 2.5))])


def ritter_depth(x: Any, time: float, depth: float) -> Array:
    """Depth after a dam of depth h_0 has gone: (2 c_0 − x/t)²/(9 g) for −c_0 < x/t < 2 c_0 (Ritter 1892)."""
    celerity = math.sqrt(G * depth)
    speed = np.asarray(x) / time
    inside = np.clip(2.0 * celerity - speed, 0.0, None) ** 2 / (9.0 * G)
    return np.where(speed < -celerity, depth, inside)


CASES = (
    Case(
        name="bore",
        title="Bore on a vertical wall",
        tests="A long reservoir of perfect fluid at Fr = 1.84 runs onto a vertical wall; the bore goes back upstream.",
        source="shallow-water jump (x − 1)²(x + 1) = 2 Fr² x, F = ½ ρ g h² x², u = v/(x − 1)",
        limit="10 % of force, depth and speed",
        run=bore,
    ),
    Case(
        name="dam-break",
        title="Dam break",
        tests="A reservoir of perfect fluid, ten depths long, whose dam is gone at t = 0, on smooth ground.",
        source="Ritter (1892): h = (2 c_0 − x/t)²/(9 g)",
        limit="5 % in depth (L1 over the fan short of its tip)",
        run=dam_break,
    ),
)
