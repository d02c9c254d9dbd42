"""Motion whose dissipation is known: a standing wave, a disc that turns, a layer that shears on a rough slope."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, at_most, compared, holds, reference
from warp_mpm.validation.scenes import (
    FRICTION_ANGLE,
    GRAIN_DENSITY,
    INVISCID,
    POISSON_RATIO,
    POROSITY,
    YOUNG_MODULUS,
    box,
    scene,
)

G = 9.81
COURANT_NUMBERS = (0.95, 0.25, 0.05)


def observed_order(errors: Sequence[float]) -> float:
    """Order from runs of halved spacing: of the last three from their differences, which no limit of the reference
    itself enters; of two from their ratio, as if they tended to the reference."""
    if len(errors) == 2:
        return math.log2(abs(errors[0] / errors[1]))
    coarse, middle, fine = errors[-3:]
    return math.log2(abs((coarse - middle) / (middle - fine)))


# -- sloshing ----------------------------------------------------------------------------------------------------

TANK, DEPTH = 2.0, 1.0
"""Length, which is half a wave, and depth of the tank [m]."""

WAVE_NUMBER = math.pi / TANK
FREQUENCY = math.sqrt(G * WAVE_NUMBER * math.tanh(WAVE_NUMBER * DEPTH))
"""Of the linear standing wave [rad/s]."""

PERIODS = 4


def _mode(position: Array) -> Array:
    """Velocity field of the standing wave, one at the surface's antinode."""
    x, y = WAVE_NUMBER * position[:, 0], WAVE_NUMBER * position[:, 1]
    height = math.sinh(WAVE_NUMBER * DEPTH)
    return np.stack([-np.sin(x) * np.cosh(y) / height, np.cos(x) * np.sinh(y) / height], axis=1)


def standing_wave(cells: int, courant_number: float) -> tuple[Array, Array, float, float]:
    """Times over the period, amplitude of the mode over its start, damping ratio ζ, ω over theory less one.

    The liquid's stiffness of 3 MPa is soft enough for short runs: sound crosses the tank eight times in a period.
    """
    simulation = Simulation(
        scene(
            "standing wave",
            box(0.0, TANK, DEPTH),
            "undrained",
            end_time=PERIODS * 2.0 * math.pi / FREQUENCY,
            lateral=1.0,
            soil=INVISCID | {"liquid_bulk_modulus_Pa": 3e6},
            spacing_m=2.0 * TANK / cells,
            courant_number=courant_number,
            domain={"left_edge": "wall", "right_edge": "wall", "left_m": 0.0, "right_m": TANK, "top_m": 2.0 * DEPTH},
        )
    )
    speed = 0.2
    simulation.set_points(solid_velocity=speed * _mode(simulation.points()["position"]))
    shares = np.linspace(0.0, PERIODS, 16 * PERIODS + 1)[1:]
    times = shares * (2.0 * math.pi / FREQUENCY)
    amplitude = []
    for time in times:
        simulation.advance(float(time))
        points = simulation.points()
        mode, mass = _mode(points["position"]), points["solid_mass"][:, None]
        amplitude.append(float((mass * points["solid_velocity"] * mode).sum() / (mass * mode**2).sum()) / speed)
    found = np.array(amplitude)

    def misfit(fit: Array) -> Array:
        size, damping, frequency, phase = fit
        wave: Array = size * np.exp(-damping * FREQUENCY * times) * np.cos(frequency * FREQUENCY * times + phase)
        return wave - found

    _, damping, frequency, _ = least_squares(misfit, [1.0, 0.01, 1.0, 0.0]).x
    return shares, found, float(damping), float(frequency) - 1.0


def sloshing(quick: bool) -> Outcome:
    numbers = (0.95, 0.25) if quick else COURANT_NUMBERS
    checks: list[Check] = []
    curves: list[Curve] = []
    damping: list[Curve] = []
    for number, style in zip(numbers, ("o-", "s--", "x:"), strict=False):
        ratios, errors = [], []
        ladder = (16, 32) if quick or number < 0.95 else (16, 32, 64)
        for cells in ladder:
            times, amplitude, ratio, error = standing_wave(cells, number)
            ratios.append(ratio)
            errors.append(error)
            if cells == 32:
                label = f"Courant number {number:g}"
                checks += [
                    at_most(f"32 cells a wave, {label}: damping ratio ζ", "-", ratio, 0.002),
                    at_most(f"32 cells a wave, {label}: error of the frequency", "-", error, 0.01, percent=True),
                ]
                curves.append(Curve(times, amplitude, label, style[1:]))
        order = observed_order(errors)
        checks.append(
            holds(
                f"Courant number {number:g}: order of the frequency's error, {ladder[0]} to {ladder[-1]} cells",
                "-",
                order,
                order >= 1.8,
                reference="≥ 1.8; errors " + ", ".join(f"{100 * error:.2g} %" for error in errors),
            )
        )
        damping.append(Curve(ladder, np.abs(ratios), f"Courant number {number:g}", style))
    time = np.linspace(0.0, PERIODS, 200)
    return Outcome(
        checks=checks,
        panels=[
            Panel(
                "amplitude of the standing wave, 32 cells",
                "t / T",
                "velocity over its start",
                [reference(time, np.cos(2.0 * math.pi * time), "linear theory"), *curves],
            ),
            Panel("damping ratio", "cells a wavelength", "|ζ|", damping, log_x=True, log_y=True),
        ],
        remarks=[
            "Linear theory is not the limit of these runs to better than some tenths of a percent: the wave has a "
            "height (k a = 0.08), and the fluid gives way a little (g h/c² = 0.003). The order is therefore taken from "
            "the differences of three spacings where there are three."
        ],
    )


# -- a disc that turns -------------------------------------------------------------------------------------------

SPIN = 2.0 * math.pi
"""Of the disc, of radius 1 m [rad/s]."""


def spread_of_a_disc() -> float:
    """Moment of inertia of the turning disc over its start, less one: plane strain, in elastic equilibrium.

    u = A r − k r³, k = ρ ω²/(8 (λ + 2μ)), A = k (3 (λ + 2μ) + λ)/(2 (λ + μ)), free at r = 1 (Timoshenko).
    """
    lame = YOUNG_MODULUS * POISSON_RATIO / ((1.0 + POISSON_RATIO) * (1.0 - 2.0 * POISSON_RATIO))
    shear = 0.5 * YOUNG_MODULUS / (1.0 + POISSON_RATIO)
    modulus = lame + 2.0 * shear
    cubic = (1.0 - POROSITY) * GRAIN_DENSITY * SPIN**2 / (8.0 * modulus)
    linear = cubic * (3.0 * modulus + lame) / (2.0 * (lame + shear))
    return 2.0 * linear - 4.0 / 3.0 * cubic


def turning_disc(cells: int, courant_number: float, turns: int) -> tuple[Array, Array]:
    """Moment of inertia and angular momentum of a free elastic disc, over their start, after each turn.

    Radius 1 m, divided into `cells`; one turn a second, without gravity.
    """
    angles = np.linspace(0.0, 2.0 * math.pi, 181)[:-1]
    simulation = Simulation(
        scene(
            "disc that turns",
            [[math.cos(angle), math.sin(angle)] for angle in angles],
            "dry",
            end_time=float(turns),
            gravity=0.0,
            stress="zero",
            ground=None,
            soil={"law": "elastic"},
            spacing_m=1.0 / cells,
            courant_number=courant_number,
            domain={"left_m": -2.0, "right_m": 2.0, "bottom_m": -2.0, "top_m": 2.0},
        )
    )
    place = simulation.points()["position"]
    simulation.set_points(solid_velocity=SPIN * np.stack([-place[:, 1], place[:, 0]], axis=1))

    def measured() -> Array:
        points = simulation.points()
        mass, (x, y), (u, v) = points["solid_mass"], points["position"].T, points["solid_velocity"].T
        return np.array([(mass * (x**2 + y**2)).sum(), (mass * (x * v - y * u)).sum()])

    start = measured()
    found = []
    for turn in range(1, turns + 1):
        simulation.advance(float(turn))
        found.append(measured() / start)
    inertia, momentum = np.array(found).T
    return inertia, momentum


def free_disc(quick: bool) -> list[Check]:
    """What two turns of a free disc leave of its moment of inertia and of its angular momentum."""
    swelling = spread_of_a_disc()
    checks: list[Check] = []
    for cells in (10,) if quick else (10, 5):
        for number in (0.95,) if quick else COURANT_NUMBERS:
            inertia, momentum = turning_disc(cells, number, 2)
            where = f"free disc, {cells} cells a radius, Courant number {number:g}"
            checks += [
                compared(
                    f"{where}: moment of inertia after a turn, over its start", "-", inertia[0], 1.0 + swelling, 0.005
                ),
                at_most(
                    f"{where}: its change in the second turn", "-", inertia[1] / inertia[0] - 1.0, 0.005, percent=True
                ),
                at_most(
                    f"{where}: angular momentum, change in two turns",
                    "-",
                    momentum[1] - 1.0,
                    0.005,
                    percent=True,
                    remark="the transfer between points and grid loses it at the rim, by the cell; twice the cells "
                    "lose a fourth",
                ),
            ]
    return checks


# -- a layer on a rough slope ------------------------------------------------------------------------------------

SLOPE = 30.0


def sheared_layer(cells: int, courant_number: float) -> tuple[Array, Array, float]:
    """Times, velocity of the surface in the middle of a long layer, and its acceleration from t = 0.2 to 0.6 s.

    Dry soil, 1 m deep, starts at rest. Shear waves need 0.1 s to bring it to flow; the ends, 20 m away, are felt later.
    """
    length, end = 40.0, 0.6
    simulation = Simulation(
        scene(
            "layer on a rough slope",
            box(-length, 0.0, 1.0),
            "dry",
            end_time=end,
            tilt=SLOPE,
            ground=1.0,
            spacing_m=1.0 / cells,
            courant_number=courant_number,
            domain={"left_m": -length - 1.0, "right_m": 6.0, "top_m": 2.0},
        )
    )
    x, y = simulation.points()["position"].T
    surface = (np.abs(x + 0.5 * length) < 1.0) & (y > 1.0 - 1.0 / cells)
    times = np.linspace(0.0, end, 61)[1:]
    speed = []
    for time in times:
        simulation.advance(float(time))
        speed.append(float(simulation.points()["solid_velocity"][surface, 0].mean()))
    flowing = times >= 0.2
    return times, np.array(speed), float(np.polyfit(times[flowing], np.array(speed)[flowing], 1)[0])


def rough_slope(quick: bool) -> Outcome:
    ladder = (5, 10) if quick else (5, 10, 20)
    angle = math.radians(SLOPE)
    exact = G * (math.sin(angle) - math.sin(math.radians(FRICTION_ANGLE)) * math.cos(angle))
    checks: list[Check] = []
    curves: list[Curve] = []
    errors = []
    for cells in ladder:
        times, speed, acceleration = sheared_layer(cells, 0.95)
        errors.append(acceleration / exact - 1.0)
        curves.append(Curve(times, speed, f"{cells} cells deep"))
        if cells >= 10:
            checks.append(
                compared(f"acceleration of the surface, {cells} cells deep", "m/s²", acceleration, exact, 0.03)
            )
    if not quick:
        _, _, acceleration = sheared_layer(10, 0.25)
        checks.append(
            compared("the same, 10 cells, Courant number 0.25", "m/s²", acceleration, exact, 0.03),
        )
    order = observed_order(errors)
    checks.append(
        holds(
            f"order of its error, {ladder[0]} to {ladder[-1]} cells, or all that is left is below 0.5 %",
            "-",
            order,
            order >= 1.5 or abs(errors[-1]) < 0.005,
            reference="≥ 1.5; errors " + ", ".join(f"{100 * error:+.2g} %" for error in errors),
        )
    )
    return Outcome(
        checks=checks,
        panels=[
            Panel(
                "surface of the layer",
                "time [s]",
                "velocity [m/s]",
                [reference(times, exact * times, "g (sin θ − sin φ' cos θ) t"), *curves],
            )
        ],
    )


CASES = (
    Case(
        name="sloshing",
        title="Standing wave in a tank",
        tests="A perfect fluid (undrained, φ = 0) swings in a tank of 2 m by 1 m in its first mode, v = 0.2 m/s at the "
        "antinode; four periods, by cells a wavelength and Courant number. Damping and frequency are fitted.",
        source="linear waves: ω² = g k tanh(k h), no damping",
        limit="32 cells: ζ 0.002 and frequency 1 % at every Courant number; order of the frequency's error 1.8",
        run=sloshing,
    ),
    Case(
        name="rough-slope",
        title="Layer on a rough slope",
        tests="A dry layer of 1 m on a slope of 30° whose ground is rougher (μ = 1) than the soil shears in its lowest "
        "cells; acceleration of its surface from 0.2 to 0.6 s.",
        source="a soil that shears without dilating bears τ = σ_n sin φ' (Davis 1968): a = g (sin θ − sin φ' cos θ)",
        limit="3 % at 10 cells and more; order 1.5, or less than 0.5 % left",
        run=rough_slope,
    ),
)
