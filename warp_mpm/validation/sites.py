"""Ground with a profile: the same as gravity that is tilted, and water at rest in a basin."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, at_most, compared, reference, reported
from warp_mpm.validation.contact import STIFF
from warp_mpm.validation.grains_on_a_slope import GRAINS, bagnold_profile
from warp_mpm.validation.layers import DENSITY, MIXTURE, NO_SLIP
from warp_mpm.validation.scenes import INVISCID, LIQUID_BULK_MODULUS, box, scene

G = 9.81
SLOPES = (0.0, 8.0, 30.0)

Corners = list[list[float]]


def _turned(corners: Corners, slope: float) -> Corners:
    """Points turned so that what was level falls toward +x by `slope` [degrees]."""
    cosine, sine = math.cos(math.radians(slope)), math.sin(math.radians(slope))
    return [[x * cosine + y * sine, y * cosine - x * sine] for x, y in corners]


def _along(position: Array, slope: float) -> Array:
    """Way of points [N, 2] down the slope [m]."""
    angle = math.radians(slope)
    return np.asarray(position[:, 0] * math.cos(angle) - position[:, 1] * math.sin(angle))


def _both(corners: Corners, slope: float, ends: tuple[float, float], top: float, **options: Any) -> list[Scenario]:
    """A scene under tilted gravity, and the same on a profile of that slope between two `ends` [m]."""
    domain = {"left_m": ends[0], "right_m": ends[1], "top_m": top}
    tilted = scene("tilted", corners, tilt=slope, domain=domain, **options)
    profile = {
        "flow.shape.vertices_m": _turned(corners, slope),
        "gravity.tilt_deg": 0.0,
        "ground.profile_m": _turned([[ends[0], 0.0], [ends[1], 0.0]], slope),
        "domain": {},
    }
    return [tilted, tilted.replaced(profile)]


PARTS = 1000
FRONT = 979
"""Parts of equal mass, and the number of the one that is told as the front: 98 % lie behind its end."""


def _ways(scenes: list[Scenario], slopes: tuple[float, float], times: Array) -> list[Array]:
    """Way [times, PARTS] down the slope of the flow's parts of equal mass, from behind to front, in each."""
    found = []
    for scenario, slope in zip(scenes, slopes, strict=True):
        simulation = Simulation(scenario)

        def places(simulation: Simulation = simulation, slope: float = slope) -> Array:
            points = simulation.points()
            way = _along(points["position"], slope)
            order = np.argsort(way)
            behind = np.cumsum(points["solid_mass"][order])
            return np.asarray(np.interp(np.arange(1, PARTS + 1) / PARTS * behind[-1], behind, way[order]))

        start, moved = places(), []
        for time in times:
            simulation.advance(float(time))
            moved.append(places() - start)
        found.append(np.array(moved))
    return found


def _film(slope: float, spacing: float) -> list[tuple[Array, Array]]:
    """Heights [N] across the slope and speeds [N] down it, in the middle of a layer of grains 1 m deep after 2.5 s,
    that begins with three quarters of Bagnold's speed, under tilted gravity and on a profile."""
    length, end, angle = 36.0, 2.5, math.radians(slope)
    scenes = _both(
        box(-length, 0.0, 1.0),
        slope,
        (-length - 1.0, 0.75 * length),
        2.0,
        formulation="dry",
        end_time=end,
        ground=NO_SLIP,
        soil=MIXTURE | GRAINS,
        spacing_m=spacing,
    )
    found = []
    for scenario, turn in zip(scenes, (0.0, slope), strict=True):
        simulation = Simulation(scenario)
        turned = np.array(_turned([[1.0, 0.0], [0.0, 1.0]], turn))  # rows: down the slope, across it
        height = simulation.points()["position"] @ turned[1]
        pressure = DENSITY * G * math.cos(angle) * (1.0 - height)
        shear = math.tan(angle) * pressure
        across, along = turned[1], turned[0]
        stress = [
            -pressure[:, None, None] * np.eye(2),
            shear[:, None, None] * (np.outer(along, across) + np.outer(across, along)),
        ]
        xx, yy, xy = (sum(part[:, i, j] for part in stress) for i, j in ((0, 0), (1, 1), (0, 1)))
        simulation.set_points(
            solid_velocity=0.75 * bagnold_profile(height, slope)[:, None] * along,
            effective_stress=np.stack([xx, yy, -pressure, xy], axis=1),
        )
        simulation.advance(end)
        points = simulation.points()
        way = points["position"] @ along
        middle = np.abs(way - way.mean()) < 1.0
        found.append((points["position"][middle] @ across, points["solid_velocity"][middle] @ along))
    return found


def profile(quick: bool) -> Outcome:
    ladder = (0.2,) if quick else (0.2, 0.1)
    times = np.linspace(0.0, 1.0, 11)[1:]
    checks: list[Check] = []
    block: list[Curve] = []
    for slope, friction in ((8.0, 0.05), (30.0, 0.3)):
        angle = math.radians(slope)
        exact = 0.5 * G * (math.sin(angle) - friction * math.cos(angle)) * times**2
        block.append(reference(times, exact, "½ g (sin θ − μ cos θ) t²" if not block else ""))
        for spacing in ladder:
            options: dict[str, Any] = {"formulation": "dry", "end_time": 1.0, "lateral": 0.0, "soil": STIFF}
            scenes = _both(box(-2.0, 0.0, 0.4), slope, (-4.0, 6.0), 1.0, ground=friction, spacing_m=spacing, **options)
            ours = _ways(scenes, (0.0, slope), times)[1].mean(axis=1)
            checks.append(compared(f"block, {slope:g}°, {spacing:g} m: way after 1 s", "m", ours[-1], exact[-1], 0.01))
            block.append(Curve(times, ours, f"{slope:g}°, {spacing:g} m", "o" if spacing == ladder[-1] else "x"))
    water: list[Curve] = []
    for slope in SLOPES[1:] if quick else SLOPES:
        for spacing in (0.125,) if quick else (0.125, 0.0625):
            scenes = _both(
                box(-2.0, 0.0, 1.0),
                slope,
                (-6.0, 16.0),
                2.0,
                formulation="undrained",
                end_time=1.0,
                lateral=1.0,
                soil=INVISCID | {"liquid_bulk_modulus_Pa": 3e6},
                spacing_m=spacing,
            )
            both = _ways(scenes, (0.0, slope), times)
            tilted, ours = (ways[:, FRONT] for ways in both)
            name = f"dam break, {slope:g}°, {spacing:g} m"
            apart = float(np.abs(both[1][-1] - both[0][-1]).mean())
            checks += [
                at_most(f"{name}: distance of the mass from where it should lie", "m", apart, 0.25 * spacing),
                compared(f"{name}: way of the front after {times[-1]:g} s", "m", ours[-1], tilted[-1], 0.02),
            ]
            if spacing == 0.125:
                water += [
                    reference(times, tilted, "gravity tilted" if not water else ""),
                    Curve(times, ours, f"profile, {slope:g}°", "o"),
                ]
    slope, grains = 25.0, []
    for spacing in ladder:
        (_, reached), (height, speed) = _film(slope, spacing)
        exact = bagnold_profile(height, slope)
        error = float(np.abs(speed - exact).max()) / float(exact.max())
        name = f"grains, {slope:g}°, {spacing:g} m"
        checks += [
            at_most(f"{name}: largest error of the speed", "of the surface's", error, 0.05, percent=True),
            compared(f"{name}: mean speed", "m/s", float(speed.mean()), float(reached.mean()), 0.05),
        ]
        grains.append(Curve(speed, height, f"profile, {spacing:g} m", "."))
    fine = np.linspace(0.0, 1.0, 101)
    grains.append(reference(bagnold_profile(fine, slope), fine, "Bagnold's"))
    return Outcome(
        checks=checks,
        panels=[
            Panel("block on a profile", "time [s]", "way [m]", block),
            Panel("front of a dam break on a profile", "time [s]", "way [m]", water),
            Panel(f"grains on a profile of {slope:g}°", "speed [m/s]", "height [m]", grains),
        ],
    )


LEVEL, BASIN = (
    2.0,
    [[-12.0, 4.0], [-6.0, 0.5], [-3.0, 0.0], [-1.5, -1.0], [0.5, -0.6], [3.0, 0.2], [6.0, 1.0], [12.0, 5.0]],
)
"""Height of the water, and profile [m]: 3 m deep, slopes from 6 to 34°."""

SPEED_UNIT = math.sqrt(G * (LEVEL + 1.0))

SOFT = {"liquid_bulk_modulus_Pa": 0.1 * LIQUID_BULK_MODULUS}


def pond(spacing: float, end_time: float, points_per_cell: int = 4, soil: dict[str, Any] = INVISCID) -> Array:
    """Greatest speed over √(g h) [samples, 4 a second] of a pond in an uneven basin, smooth, at rest at the start."""
    outline = [[x, y] for x, y in BASIN if y < LEVEL]
    (left, low), (right, high) = BASIN[0], BASIN[-1]
    first, last = outline[0], outline[-1]
    outline.insert(0, [first[0] + (left - first[0]) * (LEVEL - first[1]) / (low - first[1]), LEVEL])
    outline.append([last[0] + (right - last[0]) * (LEVEL - last[1]) / (high - last[1]), LEVEL])
    # Over a level bottom below it: the ground that it lies on comes after.
    lowest = min(y for _, y in BASIN)
    level = scene(
        "pond",
        [[x, y - lowest] for x, y in outline],
        "undrained",
        end_time=end_time,
        soil=soil,
        spacing_m=spacing,
        points_per_cell=points_per_cell,
    )
    scenario = level.replaced({"ground.profile_m": BASIN, "flow.shape.vertices_m": outline})
    simulation = Simulation(scenario)
    found = []
    for time in np.arange(0.25, end_time + 1e-9, 0.25):
        simulation.advance(float(time))
        velocity = simulation.points(["solid_velocity"])["solid_velocity"]
        found.append(float(np.hypot(*velocity.T).max()) / SPEED_UNIT)
    return np.array(found)


LONGER_STEPS = (
    "steps are three times as long, and so is what the contact leaves to the next one after its four sweeps: the fluid "
    "is stirred. At a quarter of the step, or with forty sweeps, 0.4 and 0.13 % are left"
)


def basin(quick: bool) -> Outcome:
    end = 2.0 if quick else 10.0
    checks: list[Check] = []
    curves: list[Curve] = []
    for name, spacing, points, soil in (
        ("fluid", 0.5, 4, INVISCID),
        ("fluid", 0.25, 4, INVISCID),
        ("fluid", 0.25, 16, INVISCID),
        ("soil", 0.25, 4, {}),
        ("fluid of a tenth of the stiffness", 0.25, 4, INVISCID | SOFT),
    )[: 1 if quick else 5]:
        speed = pond(spacing, end, points, soil)
        label = f"{name}, {spacing:g} m, {points} points a cell"
        at_end = f"{label}: greatest speed at the end", "of √(g h)", float(speed[-1])
        checks += [
            reported(*at_end, remark=LONGER_STEPS) if "tenth" in name else at_most(*at_end, 1e-3),
            reported(f"{label}: greatest speed at any time", "of √(g h)", float(speed.max())),
        ]
        curves.append(Curve(0.25 * np.arange(1.0, len(speed) + 1.0), 100.0 * speed, label))
    return Outcome(
        checks=checks, panels=[Panel("a pond in an uneven basin", "time [s]", "greatest speed, % of √(g h)", curves)]
    )


CASES = (
    Case(
        name="profile",
        title="Slopes as a profile of the ground",
        tests="A stiff block that slides, a dam break of a perfect fluid, and a layer of grains whose friction grows "
        "with the shear rate, on slopes that the grid does not follow. "
        "The mean distance of the mass from where it lies under tilted gravity falls with the cell. It was added when "
        "the front's error was seen not to fall: that is of a film thinner than a cell, whose last points lie some "
        "tenths of a cell here or there.",
        source="½ g (sin θ − μ cos θ) t²; the same dam break under gravity tilted by the slope; Bagnold's profile.",
        limit="1 % of the block's way, a quarter of a cell of the mass's distance, 2 % of the front's way; 5 % of "
        "the grains' greatest speed, and of their mean speed under tilted gravity.",
        run=profile,
        in_quick=False,
    ),
    Case(
        name="basin",
        title="A pond in an uneven basin",
        tests="A smooth basin with slopes from 6 to 34°, filled with a perfect fluid, and with the paper's soil.",
        source="nothing moves",
        limit="greatest speed after 10 s: 0.1 % of √(g h)",
        run=basin,
        in_quick=False,
    ),
)
