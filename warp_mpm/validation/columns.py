"""One-dimensional columns: rest, elastic waves of one and two phases, consolidation."""

from __future__ import annotations

import math

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.time_step import biot_wave_speeds, undrained_wave_speed
from warp_mpm.validation import scenes
from warp_mpm.validation.case import (
    Array,
    Case,
    Check,
    Curve,
    Outcome,
    Panel,
    at_most,
    compared,
    holds,
    reference,
    reported,
)
from warp_mpm.validation.scenes import GRAIN_DENSITY, LIQUID_BULK_MODULUS, LIQUID_DENSITY, POROSITY, column, layers

G = 9.81
DENSITY = (1.0 - POROSITY) * GRAIN_DENSITY + POROSITY * LIQUID_DENSITY
DRY_DENSITY = (1.0 - POROSITY) * GRAIN_DENSITY
_E, _NU = scenes.YOUNG_MODULUS, scenes.POISSON_RATIO
OEDOMETRIC_MODULUS = _E * (1.0 - _NU) / ((1.0 + _NU) * (1.0 - 2.0 * _NU))
REAL_WATER = 2.2e9


# -- rest --------------------------------------------------------------------------------------------------------


def hydrostatic(quick: bool) -> Outcome:
    cells = (10, 20) if quick else (20, 40)
    duration = 2.0 if quick else 10.0
    checks, pressure, stress, worst = [], [], [], {}
    for number in cells:
        simulation = Simulation(column("two_phase", cells=number, lateral=0.66, end_time=duration))
        speed = 0.0
        for time in np.linspace(0.0, duration, 41)[1:]:
            simulation.advance(float(time))
            points = simulation.points()
            speed = max(speed, *(float(np.abs(points[f"{phase}_velocity"]).max()) for phase in ("solid", "liquid")))
        depth = 1.0 - points["position"][:, 1]
        errors = (
            float(np.abs(points["pore_pressure"] - LIQUID_DENSITY * G * depth).max()) / (LIQUID_DENSITY * G),
            float(np.abs(points["effective_stress"][:, 1] + (DENSITY - LIQUID_DENSITY) * G * depth).max())
            / ((DENSITY - LIQUID_DENSITY) * G),
            speed / math.sqrt(G),
        )
        worst[number] = errors
        if number == 20:
            checks += [
                at_most(
                    f"p_L, largest error after {duration:g} s, {number} cells",
                    "of ρ_L g H",
                    errors[0],
                    0.01,
                    percent=True,
                ),
                at_most(f"σ'_v, largest error, {number} cells", "of (ρ_m − ρ_L) g H", errors[1], 0.01, percent=True),
                at_most(f"fastest point of either phase, {number} cells", "of √(gH)", errors[2], 1e-3),
            ]
        z = layers(points["position"], 2 * number)[:, 1]
        pressure.append(Curve(layers(points["pore_pressure"], 2 * number) / 1e3, z, f"{number} cells", "."))
        stress.append(Curve(-layers(points["effective_stress"], 2 * number)[:, 1] / 1e3, z, f"{number} cells", "."))
    coarse, fine = (worst[number] for number in cells)
    for name, before, after in zip(("p_L", "σ'_v"), coarse[:2], fine[:2], strict=True):
        checks.append(
            holds(
                f"error of {name} falls with the spacing: {cells[1]} over {cells[0]} cells",
                "-",
                after / before,
                after < 0.75 * before,
                reference="< 0.75",
            )
        )
    z = np.array([0.0, 1.0])
    return Outcome(
        checks=checks,
        panels=[
            Panel(
                "pore pressure",
                "p_L [kPa]",
                "height [m]",
                [reference(LIQUID_DENSITY * G * (1.0 - z) / 1e3, z, "ρ_L g z"), *pressure],
            ),
            Panel(
                "vertical effective stress",
                "−σ'_v [kPa]",
                "height [m]",
                [reference((DENSITY - LIQUID_DENSITY) * G * (1.0 - z) / 1e3, z, "(ρ_m − ρ_L) g z"), *stress],
            ),
        ],
    )


# -- waves -------------------------------------------------------------------------------------------------------


def _arrival(times: Array, values: Array, level: float) -> float:
    """Time at which `values` first pass `level`, by linear interpolation."""
    after = int(np.argmax(values >= level))
    if after == 0:
        return math.nan
    share = (level - values[after - 1]) / (values[after] - values[after - 1])
    return float(times[after - 1] + share * (times[after] - times[after - 1]))


def _impact(formulation: str, cells: int, speed: float, times: Array, **soil: float) -> dict[str, Array]:
    """A stress-free elastic column that moves down at `speed` [m/s] meets its base at t = 0.

    Returns heights [layers], and total stress (compression positive), effective stress and pore pressure
    [times, layers] in Pa.
    """
    scene = column(
        formulation,
        cells=cells,
        end_time=float(times[-1]),
        velocity=(0.0, -speed),
        gravity=0.0,
        stress="zero",
        soil={"law": "elastic", **soil},
    )
    simulation = Simulation(scene)
    height = layers(simulation.points()["position"], 2 * cells)[:, 1]
    effective, pore = [], []
    for time in times:
        simulation.advance(float(time))
        points = simulation.points()
        effective.append(-layers(points["effective_stress"], 2 * cells)[:, 1])
        pore.append(layers(points.get("pore_pressure", np.zeros(simulation.material_points)), 2 * cells))
    stress, pressure = np.array(effective), np.array(pore)
    return {"height": height, "total": stress + pressure, "effective": stress, "pore": pressure}


def _front(
    title: str, formulation: str, cells: int, wave_speed: float, density: float, limit: float, **soil: float
) -> tuple[list[Check], list[Panel], dict[str, Array]]:
    """Speed, level and overshoot of the front that runs up a column after it has met its base."""
    speed = 1e-3 * wave_speed / 186.0
    step = density * wave_speed * speed
    times = np.linspace(0.0, 0.9 / wave_speed, 181)[1:]
    wave = _impact(formulation, cells, speed, times, **soil)
    share, height = wave["total"] / step, wave["height"]
    low, high = (int(np.argmin(np.abs(height - place))) for place in (0.3, 0.8))
    measured = (height[high] - height[low]) / (
        _arrival(times, share[:, high], 0.5) - _arrival(times, share[:, low], 0.5)
    )
    shown = int(np.argmin(np.abs(times - 0.6 / wave_speed)))
    behind = (height > 0.05) & (height < 0.4)
    developed = times > 0.3 / wave_speed
    checks = [
        compared(f"speed of the front, {title}", "m/s", float(measured), wave_speed, limit),
        compared(f"stress behind it, {title}", "of ρ c v", float(share[shown, behind].mean()), 1.0, limit),
        at_most(
            f"overshoot behind the front, from 0.3 H on, {title}",
            "of the step",
            float(share[developed].max()) - 1.0,
            0.10,
            percent=True,
        ),
        reported(
            f"overshoot in the first cell at the base, {title}",
            "of the step",
            float(share.max()) - 1.0,
            remark="lasts as long as sound takes to cross two cells",
        ),
    ]
    exact = np.where(height <= wave_speed * times[shown], 1.0, 0.0)
    panel = Panel(
        f"{title}: total stress at t = 0.6 H/c",
        "height [m]",
        "σ / (ρ c v)",
        [reference(height, exact), Curve(height, share[shown], f"{cells} cells")],
    )
    return (
        checks,
        [panel],
        {name: wave[name][shown] if name != "height" else height for name in wave} | {"behind": behind},
    )


def dry_column(quick: bool) -> Outcome:
    wave_speed = undrained_wave_speed(OEDOMETRIC_MODULUS, 0.0, DRY_DENSITY)
    checks, panels, _ = _front("dry", "dry", 120 if quick else 160, wave_speed, DRY_DENSITY, 0.01)

    # Gravity of 1 m/s2 comes on at once: the column swings about its settled state with the period 4 H / c.
    cells, gravity, period = 20 if quick else 40, 1.0, 4.0 / wave_speed
    simulation = Simulation(
        column("dry", cells=cells, end_time=3.0 * period, gravity=gravity, stress="zero", soil={"law": "elastic"})
    )
    times = np.linspace(0.0, 2.6 * period, 521)
    top = [0.0]
    start = simulation.points()["position"]
    upper = start[:, 1] > 1.0 - 0.5 / cells
    for time in times[1:]:
        simulation.advance(float(time))
        top.append(float((simulation.points()["position"] - start)[upper, 1].mean()))
    sag = DRY_DENSITY * gravity / OEDOMETRIC_MODULUS
    crossings = _crossings(times, np.array(top) + 0.5 * sag)
    order = 2 * np.arange(200) + 1
    height = float(start[upper, 1].mean())
    # Separation of variables: u = -Σ u_m sin(m π z / 2H) (1 - cos(m π c t / 2H)), u_m = 16 ρ g H² / (E_oed m³ π³).
    series = -(
        (16.0 * sag / (order * math.pi) ** 3 * np.sin(order * math.pi * height / 2.0))
        * (1.0 - np.cos(np.multiply.outer(times, order * math.pi * wave_speed / 2.0)))
    ).sum(axis=1)
    checks.append(
        compared("period of the swinging column, 4 H/c", "s", 2.0 * float(np.diff(crossings).mean()), period, 0.01)
    )
    panels.append(
        Panel(
            "top of the column under gravity of 1 m/s²",
            "time [s]",
            "displacement [mm]",
            [reference(times, 1e3 * series, "series"), Curve(times, 1e3 * np.array(top), f"{cells} cells")],
        )
    )
    return Outcome(checks=checks, panels=panels)


def _crossings(times: Array, values: Array) -> Array:
    """Times at which `values` change sign."""
    at = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
    return times[at] - values[at] * (times[at + 1] - times[at]) / (values[at + 1] - values[at])


def saturated_wave(quick: bool) -> Outcome:
    cells = 120 if quick else 160
    stiffness = LIQUID_BULK_MODULUS / POROSITY
    slow_drainage = undrained_wave_speed(OEDOMETRIC_MODULUS, stiffness, DENSITY)
    share = stiffness / (OEDOMETRIC_MODULUS + stiffness)
    checks: list[Check] = []
    panels: list[Panel] = []
    settings: list[tuple[str, str, float, dict[str, float]]] = [
        ("undrained", "undrained", slow_drainage, {}),
        ("two-phase", "two_phase", slow_drainage, {}),
    ]
    if not quick:
        water = undrained_wave_speed(OEDOMETRIC_MODULUS, REAL_WATER / POROSITY, DENSITY)
        settings.append(("two-phase, K_L = 2.2 GPa", "two_phase", water, {"liquid_bulk_modulus_Pa": REAL_WATER}))
    for title, formulation, wave_speed, soil in settings:
        new, drawn, profile = _front(title, formulation, cells, wave_speed, DENSITY, 0.02, **soil)
        checks, panels = [*checks, *new], [*panels, *drawn]
        if not soil:
            ratio = profile["pore"][profile["behind"]].mean() / profile["total"][profile["behind"]].mean()
            checks.append(compared(f"Δp/q behind the front, {title}", "-", float(ratio), share, 0.02))
    new, drawn = _two_waves(160 if quick else 320)
    return Outcome(checks=[*checks, *new], panels=[*panels, *drawn])


def _two_waves(cells: int) -> tuple[list[Check], list[Panel]]:
    """Without drag the impact sends a fast and a slow wave up the column; both are exact by characteristics."""
    n, solid = POROSITY, 1.0 - POROSITY
    fast, slow = biot_wave_speeds(OEDOMETRIC_MODULUS, LIQUID_BULK_MODULUS, n, GRAIN_DENSITY, LIQUID_DENSITY)
    stiffness = LIQUID_BULK_MODULUS / n * np.array([[solid**2, solid * n], [solid * n, n**2]])
    stiffness[0, 0] += OEDOMETRIC_MODULUS
    mass = np.diag([solid * GRAIN_DENSITY, n * LIQUID_DENSITY])
    speed = 1e-3
    # Mode of speed c: (K - c² M) shape = 0. Together the two modes take the whole velocity from both phases.
    shapes = np.array([[stiffness[0, 1], c**2 * mass[0, 0] - stiffness[0, 0]] for c in (fast, slow)]).T
    amplitude = np.linalg.solve(shapes, [speed, speed])
    strain = shapes * amplitude / np.array([fast, slow])  # compression of (solid, liquid) by (fast, slow)
    effective = OEDOMETRIC_MODULUS * strain[0]
    pore = LIQUID_BULK_MODULUS / n * (solid * strain[0] + n * strain[1])

    times = np.linspace(0.0, 6.5e-3, 261)[1:]
    wave = _impact("two_phase", cells, speed, times, hydraulic_conductivity_m_per_s=1e6)
    height = wave["height"]

    def arrivals(values: Array, level: float, places: tuple[float, float]) -> float:
        low, high = (int(np.argmin(np.abs(height - place))) for place in places)
        first, second = (_arrival(times, values[:, at], level) for at in (low, high))
        return float((height[high] - height[low]) / (second - first))

    both = effective.sum()
    middle = 0.5 * (effective[0] + both)
    checks = [
        compared("fast Biot wave, no drag", "m/s", arrivals(wave["pore"], 0.5 * pore[0], (0.3, 0.8)), fast, 0.02),
        compared("slow Biot wave, no drag", "m/s", arrivals(wave["effective"], middle, (0.08, 0.18)), slow, 0.02),
    ]
    shown = int(np.argmin(np.abs(times - 3.2e-3)))
    between = (height > 1.5 * slow * times[shown]) & (height < 0.7 * fast * times[shown])
    behind = (height > 0.02) & (height < 0.6 * slow * times[shown])
    at = wave["pore"][shown], wave["effective"][shown]
    checks += [
        compared("p_L between the waves", "Pa", float(at[0][between].mean()), float(pore[0]), 0.02),
        compared("p_L behind both", "Pa", float(at[0][behind].mean()), float(pore.sum()), 0.02),
        compared("σ' behind both", "Pa", float(at[1][behind].mean()), float(both), 0.02),
    ]
    passed = np.array([height <= c * times[shown] for c in (fast, slow)], dtype=float)
    panels = [
        Panel(
            f"{name} at t = {1e3 * times[shown]:.1f} ms, no drag",
            "height [m]",
            label,
            [reference(height, levels @ passed), Curve(height, values, f"{cells} cells")],
        )
        for name, label, levels, values in (
            ("pore pressure", "p_L [Pa]", pore, at[0]),
            ("effective stress", "−σ' [Pa]", effective, at[1]),
        )
    ]
    return checks, panels


# -- consolidation -----------------------------------------------------------------------------------------------


def terzaghi_pressure(depth: Array, time_factor: float) -> Array:
    """Excess pressure over its start at `depth` / H below the drained surface, base closed (Terzaghi 1923)."""
    m = math.pi * (np.arange(200) + 0.5)
    return (2.0 / m * np.sin(np.multiply.outer(depth, m)) * np.exp(-(m**2) * time_factor)).sum(axis=-1)


def terzaghi(quick: bool) -> Outcome:
    cells = 40
    conductivity = 1e-3 if quick else scenes.CONDUCTIVITY
    factors = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
    # c_v with the storage of the liquid; p0 / q is the undrained response.
    coefficient = conductivity / (LIQUID_DENSITY * G * (1.0 / OEDOMETRIC_MODULUS + POROSITY / LIQUID_BULK_MODULUS))
    start = 10e3 * LIQUID_BULK_MODULUS / POROSITY / (OEDOMETRIC_MODULUS + LIQUID_BULK_MODULUS / POROSITY)
    scene = column(
        "two_phase",
        cells=cells,
        end_time=factors[-1] / coefficient,
        soil={"law": "elastic", "hydraulic_conductivity_m_per_s": conductivity},
    )
    simulation = Simulation(scene)
    points = simulation.points()
    stress = points["effective_stress"].copy()
    stress[:, 1] += start
    stress[:, [0, 2]] += start * _NU / (1.0 - _NU)
    simulation.set_points(effective_stress=stress, pore_pressure=points["pore_pressure"] + start)
    checks, curves = [], []
    fine = np.linspace(0.0, 1.0, 201)
    filtered = (
        "the pressure filter, which acts once per sound crossing of a cell, drains the column a little near its "
        "surface; without it the error is a quarter of this"
    )
    for factor in factors:
        simulation.advance(factor / coefficient)
        points = simulation.points()
        depth = 1.0 - layers(points["position"], 2 * cells)[:, 1]
        excess = (layers(points["pore_pressure"], 2 * cells) - LIQUID_DENSITY * G * depth) / start
        for place, wanted in (("base", 1.0), ("mid-height", 0.5)):
            ours = float(np.interp(-wanted, -depth, excess))
            checks.append(
                compared(
                    f"p/p0 at {place}, T = {factor:g}",
                    "-",
                    ours,
                    float(terzaghi_pressure(np.array([wanted]), factor)[0]),
                    0.02,
                    scale=1.0,
                    remark=filtered,
                )
            )
        curves += [
            reference(terzaghi_pressure(fine, factor), 1.0 - fine, "series" if factor == factors[0] else ""),
            Curve(excess, 1.0 - depth, f"T = {factor:g}", "."),
        ]
    remark = (
        "The load q = 10 kPa is not put on: the equations are linear, and the state of uniform stress −q that balances "
        "it is taken off on both sides. What is left starts with the excess pressure p0 = 0.9615 q and the effective "
        "stress +p0 everywhere, over the column's own weight, and consolidates without a load. This is the same "
        "problem, exactly."
    )
    return Outcome(
        checks=checks,
        remarks=[remark],
        panels=[Panel(f"excess pore pressure, {cells} cells", "p / p0", "height / H", curves)],
    )


CASES = (
    Case(
        name="hydrostatic",
        title="Hydrostatic column",
        tests="A saturated column of 1 m at rest under its own weight for 10 s, two-phase; the paper's material.",
        source="p_L = ρ_L g z, σ'_v = (ρ_m − ρ_L) g z, no motion",
        limit="1 % of the base values at 20 cells; fastest point 1e-3 √(gH); the error falls at 40 cells",
        run=hydrostatic,
    ),
    Case(
        name="dry-column",
        title="Dry column: elastic wave and period",
        tests="A dry elastic column that meets its base at 1 mm/s per 186 m/s of wave speed, and one on which gravity "
        "comes at once.",
        source="c = √(E_oed/ρ), stress ρ c v behind the front, period 4 H/c, displacement by separation of variables",
        limit="1 %; overshoot behind the front 10 %",
        run=dry_column,
    ),
    Case(
        name="saturated-wave",
        title="Waves in a saturated column",
        tests="A saturated elastic column meets its base: the step in stress that a suddenly applied load makes, "
        "undrained, two-phase with drag, with the bulk modulus of real water, and without drag.",
        source="c_u = √((E_oed + K_L/n)/ρ_m); Δp/q = (K_L/n)/(E_oed + K_L/n); without drag the two waves of the "
        "characteristics of the two-phase equations (speeds: eigenvalues of M⁻¹K, Biot 1956)",
        limit="speeds and levels 2 %, overshoot behind the front 10 %",
        run=saturated_wave,
    ),
    Case(
        name="terzaghi",
        title="Terzaghi's consolidation",
        tests="Excess pore pressure of a column of 1 m, drained at its top, two-phase; the paper's material "
        "(quick: ten times its conductivity).",
        source="p/p0 = Σ 2/M sin(M z/H) exp(−M² T), M = π(m + ½); c_v = k/(ρ_L g) / (1/E_oed + n/K_L)",
        limit="2 % of p0 at base and mid-height for T = 0.02 … 1",
        run=terzaghi,
    ),
)
