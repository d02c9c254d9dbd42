"""Ten cubic metres of debris let go down the straight part of the flume of the U.S. Geological Survey."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Band, Curve, Outcome, Panel, Table, holds, number, reported
from warp_mpm.validation.measured.given import Given, Ladder, simulated
from warp_mpm.validation.scenes import scene

G = 9.81
SLOPE = 31.0
HOPPER = [[-4.7, 0.0], [0.0, 0.0], [-0.978, 1.629], [-4.18, 0.83]]
"""Outline along and normal to the bed, 4.95 m²; the gate is at x = 0 and is gone at t = 0."""

PLACES = (32.0, 66.0)
"""Gauges on the straight bed; it ends at 78 to 82.5 m, so that the one at 90 m is not compared."""

ARRIVED = 0.05
"""Depth at which the front is there [m]."""

LATER = (1.0, 2.0, 3.0, 4.0, 5.0)
"""Seconds behind the arrival at which depths are compared; stresses from the second one on, as the front is dilute."""

ARRIVALS = {("SG", 32.0): 3.87, ("SG", 66.0): 8.42, ("SGM", 32.0): 4.13, ("SGM", 66.0): 7.14}
"""[s], by mixture (sand and gravel, without and with mud) and place."""

Behind = Mapping[tuple[str, float], tuple[tuple[float, float], ...]]

DEPTHS: Behind = {
    ("SG", 32.0): ((0.148, 0.024), (0.158, 0.022), (0.147, 0.017), (0.107, 0.020), (0.072, 0.020)),
    ("SG", 66.0): ((0.162, 0.027), (0.159, 0.029), (0.139, 0.022), (0.109, 0.017), (0.089, 0.019)),
    ("SGM", 32.0): ((0.174, 0.033), (0.121, 0.022), (0.092, 0.029), (0.062, 0.023), (0.042, 0.014)),
    ("SGM", 66.0): ((0.140, 0.030), (0.136, 0.019), (0.115, 0.026), (0.082, 0.014), (0.062, 0.010)),
}
"""Mean and standard deviation of the ensemble [m], means over half a second around `LATER`."""

STRESSES: Behind = {
    ("SG", 32.0): ((2.492, 0.486), (2.606, 0.339), (2.072, 0.389), (1.500, 0.386)),
    ("SG", 66.0): ((2.626, 0.914), (2.380, 0.716), (1.860, 0.520), (1.469, 0.372)),
    ("SGM", 32.0): ((1.916, 0.312), (1.502, 0.389), (1.071, 0.299), (0.799, 0.204)),
    ("SGM", 66.0): ((2.513, 0.973), (1.955, 0.518), (1.331, 0.318), (0.993, 0.223)),
}
"""Normal stress on the bed [kPa]."""

PRESSURES: Behind = {
    ("SG", 32.0): ((1.590, 0.531), (1.876, 0.289), (1.526, 0.210), (1.204, 0.215)),
    ("SG", 66.0): ((1.694, 0.513), (1.586, 0.424), (1.266, 0.319), (1.047, 0.295)),
    ("SGM", 32.0): ((1.617, 0.670), (1.240, 0.425), (0.962, 0.278), (0.819, 0.233)),
    ("SGM", 66.0): ((1.789, 0.767), (1.742, 0.360), (1.396, 0.230), (1.150, 0.172)),
}
"""Pore pressure on the bed [kPa]."""

FRICTIONS = (38.0, 40.7, 43.0)
"""Angles of the bed's friction [°], the published likely value between the ends of its range."""

PERMEABILITIES = (1e-8, 5e-9, 1e-12)
"""Likewise [m²], with a pore fluid of 0.01 Pa s."""

STARTS = {"hydrostatic": None, "liquefied": 1.0}
"""Ratio of pore pressure to total stress at the start; the experiments' is not published. None: hydrostatic."""


@dataclass(frozen=True)
class Setting:
    """What a run is made with; the paper's law, Mohr–Coulomb without dilatancy."""

    friction: float = 40.7
    permeability: float = 5e-9
    start: str = "liquefied"

    @property
    def words(self) -> str:
        return f"{self.friction:g}°, κ = {self.permeability:g} m², {self.start} start"


@dataclass(frozen=True)
class Passed:
    """What the gauges of a run saw; SI units."""

    time: Array
    depth: Array
    """[T, gauges]"""
    stress: Array
    pressure: Array

    def arrival(self, gauge: int) -> float:
        """When the front is there [s]; nan where it never is."""
        there = np.flatnonzero(self.depth[:, gauge] > ARRIVED)
        return float(self.time[there[0]]) if there.size else math.nan

    def behind(self, values: Array, gauge: int, later: float) -> float:
        """Mean over half a second around a time after the arrival; nan where the run has ended by then."""
        inside = np.abs(self.time - self.arrival(gauge) - later) <= 0.25
        return float(values[inside, gauge].mean()) if inside.sum() > 2 else math.nan


END, RECORD = 14.0, 0.05
BED = 80.0
HALF_STRIP = 0.25
"""Half the length of bed over which a gauge takes means [m]."""


def run_down(setting: Setting, spacing: float) -> Passed:
    """One release."""
    soil: dict[str, Any] = {
        "grain_density_kg_per_m3": 2700.0,
        "liquid_density_kg_per_m3": 1100.0,
        "porosity": 0.39,
        "friction_angle_deg": setting.friction,
        "young_modulus_Pa": 1e5,
        "poisson_ratio": 0.3,
        "liquid_bulk_modulus_Pa": 2e6,
        "liquid_viscosity_Pa_s": 0.01,
        "hydraulic_conductivity_m_per_s": setting.permeability * 1100.0 * G / 0.01,
    }
    made = scene(
        f"debris flume, {setting.words}",
        HOPPER,
        "two_phase",
        end_time=END,
        tilt=SLOPE,
        ground=math.tan(math.radians(setting.friction)),
        soil=soil,
        spacing_m=spacing,
        domain={"left_m": -6.0, "right_m": BED, "top_m": 2.5},
    ).replaced({"flow.initial_pore_pressure_ratio": STARTS[setting.start]})
    simulation = Simulation(made)
    times = np.arange(1, round(END / RECORD) + 1) * RECORD
    rows = []
    for time in times.tolist():
        simulation.advance(time)
        points = simulation.points(["position", "volume", "effective_stress", "pore_pressure"])
        rows.append([_at_gauge(points, place, spacing) for place in PLACES])
    depth, stress, pressure = np.array(rows).transpose(2, 0, 1)
    return Passed(times.astype(np.float64), depth, stress, pressure)


def _at_gauge(points: Mapping[str, Array], place: float, spacing: float) -> tuple[float, float, float]:
    """Depth [m], and total normal stress and pore pressure [Pa] in the lowest cell, over a strip of the bed."""
    x, y = points["position"].T
    near = np.abs(x - place) < HALF_STRIP
    depth = float(points["volume"][near].sum() / (2.0 * HALF_STRIP))
    low = near & (y < spacing)
    if not low.any():
        return depth, 0.0, 0.0
    weight = points["volume"][low]
    pressure = float(np.average(points["pore_pressure"][low], weights=weight))
    return depth, pressure - float(np.average(points["effective_stress"][low, 1], weights=weight)), pressure


def _hits(run: Passed, mix: str) -> dict[str, list[bool]]:
    """Which means behind the front lie within a standard deviation of the ensemble, by quantity."""
    found: dict[str, list[bool]] = {}
    for name, values, theirs, later in (
        ("depth", run.depth, DEPTHS, LATER),
        ("stress on the bed", run.stress / 1e3, STRESSES, LATER[1:]),
        ("pore pressure on the bed", run.pressure / 1e3, PRESSURES, LATER[1:]),
    ):
        found[name] = [
            abs(run.behind(values, gauge, time) - mean) <= deviation
            for gauge, place in enumerate(PLACES)
            for time, (mean, deviation) in zip(later, theirs[mix, place], strict=True)
        ]
    return found


CENTRAL = Setting()
SHORT = (
    "every run of the published ranges is too fast and too thin: the front runs ahead of the rest, is 0.1 m deep at "
    "66 m and comes there after 4.65 to 6.1 s; the experiments are known for a front of coarse grains, from which the "
    "water has drained and which holds back what follows; grain sizes are not in the model and dilatancy is not in "
    "the law, and no friction, permeability or start of the ranges stands in for them; spacings from 0.2 to 0.05 m "
    "agree on arrival and depth, not yet on the stresses, which the lowest of one to three cells shows"
)
"""Why the aim is missed, written after the run."""


def debris_flume(given: Given) -> Outcome:
    """The aim: depth, normal stress and pore pressure on the bed within one standard deviation of the ensemble for more
    than half of the times behind the front (one to five seconds at 32 and 66 m for depths, two to five for stresses),
    for at least one of the two mixtures, at the finest spacing with the published likely values, 40.7° and 5e-9 m², and
    a liquefied start. One standard deviation, because two thirds of the experiments themselves lie within it; half of
    the times, because the ensemble's shape is that of no single flow.

    Arrival at 32 m within 15 % of the experiments', whose two mixtures differ by 7 % there and by 16 % at 66 m.

    Friction and permeability come from the published ranges and no other; nothing is fitted. Every run of the ranges is
    on the page, the best and the worst. The law is the paper's, without dilatancy: the mixture's measured start is
    looser than critical (0.61 against 0.64), so that shearing raises its pore pressure, which this law does not know. A
    start that is liquefied stands in for it; a hydrostatic one is run beside it. So a hydrostatic start is expected to
    come too late, and a miss of the pressures to say what the law lacks.

    Only the straight part: at 90 m the real flume has bent to 2.5°.
    """
    spacings = tuple(spacing / given.finer for spacing in ((0.2, 0.1) if given.quick else (0.2, 0.1, 0.05)))
    ladder = Ladder([f"{spacing:g} m" for spacing in spacings])
    runs = [run_down(CENTRAL, spacing) for spacing in spacings]
    _judge(ladder, runs)
    explored: dict[Setting, Passed] = {}
    for friction, permeability, start in _explored(given):
        explored[Setting(friction, permeability, start)] = run_down(Setting(friction, permeability, start), spacings[1])
    return Outcome(
        checks=ladder.checks,
        points=ladder.points,
        panels=_panels(runs, spacings, given),
        tables=[ladder.table, _explored_table(explored, spacings[1])],
        remarks=[
            "Depth is volume over area of half a metre of bed; stress and pore pressure are means over the lowest "
            "cell of it. The skeleton is soft (E = 100 kPa), as the published compressibility makes it under some "
            "kilopascals. The internal friction is that of the bed; without dilatancy it shears at sin φ' of the "
            "normal stress, so that the material slips in its lowest cells before the bed does. The hopper's back is "
            "open, its load is 4.95 m² per metre of width, and the flume's side walls do not rub."
        ],
    )


def _explored(given: Given) -> list[tuple[float, float, str]]:
    if given.quick:
        return [(40.7, 5e-9, "hydrostatic")]
    return list(product(FRICTIONS, PERMEABILITIES, STARTS))


def _judge(ladder: Ladder, runs: Sequence[Passed]) -> None:
    best = {mix: _hits(runs[-1], mix) for mix in ("SG", "SGM")}
    for name in best["SG"]:
        shares = {mix: float(np.mean(hits[name])) for mix, hits in best.items()}
        told = ", ".join(f"{mix} {sum(hits[name])} of {len(hits[name])}" for mix, hits in best.items())
        ours = [max(float(np.mean(_hits(run, mix)[name])) for mix in best) for run in runs]
        check = holds(
            f"{name}: share of the times behind the front within one standard deviation",
            "-",
            ours[-1],
            max(shares.values()) > 0.5,
            reference=f"> 0.5; {told}",
            remark=SHORT,
        )
        ladder.add(check, ours)
    for gauge, place in enumerate(PLACES):
        low, high = sorted(ARRIVALS[mix, place] for mix in ("SG", "SGM"))
        middle = 0.5 * (low + high)
        ours = [run.arrival(gauge) for run in runs]
        if place == PLACES[0]:
            earliest, latest = 0.85 * low, 1.15 * high
            check = holds(
                f"arrival at {place:g} m",
                "s",
                ours[-1],
                earliest <= ours[-1] <= latest,
                reference=f"{earliest:.3g} … {latest:.3g}",
                remark=SHORT,
            )
        else:
            check = reported(f"arrival at {place:g} m", "s", ours[-1], reference=middle)
        ladder.add(check, ours, measured=(middle, low, high))
        for name, unit, theirs, seen, later in (
            ("depth", "m", DEPTHS, [run.depth for run in runs], LATER),
            ("stress on the bed", "kPa", STRESSES, [run.stress / 1e3 for run in runs], LATER[1:]),
            ("pore pressure on the bed", "kPa", PRESSURES, [run.pressure / 1e3 for run in runs], LATER[1:]),
        ):
            for k, after in enumerate(later):
                mean, deviation = theirs["SG", place][k]
                found = [run.behind(values, gauge, after) for run, values in zip(runs, seen, strict=True)]
                if np.isfinite(found).all():
                    ladder.points.append(
                        simulated(
                            f"{name} at {place:g} m, {after:g} s behind the front [{unit}]",
                            mean,
                            found,
                            band=(max(mean - deviation, 0.1 * mean), mean + deviation),
                        )
                    )


def _explored_table(explored: Mapping[Setting, Passed], spacing: float) -> Table:
    rows = []
    for setting, run in explored.items():
        hits = {mix: sum(sum(found) for found in _hits(run, mix).values()) for mix in ("SG", "SGM")}
        of = sum(len(found) for found in _hits(run, "SG").values())
        rows.append(
            (
                setting.words,
                *(number(run.arrival(gauge)) for gauge in range(len(PLACES))),
                *(number(float(run.depth[:, gauge].max())) for gauge in range(len(PLACES))),
                *(f"{hits[mix]} of {of}" for mix in ("SG", "SGM")),
            )
        )
    measured = ["measured, SG / SGM"]
    measured += [f"{ARRIVALS['SG', place]:g} / {ARRIVALS['SGM', place]:g}" for place in PLACES]
    measured += ["0.163 / 0.188", "0.178 / 0.159", "", ""]
    return Table(
        f"Every run of the published ranges, {spacing:g} m: arrival [s], greatest depth [m], means within one standard "
        "deviation",
        ("", "at 32 m", "at 66 m", "depth at 32 m", "depth at 66 m", "SG", "SGM"),
        [*rows, tuple(measured)],
    )


def _panels(runs: Sequence[Passed], spacings: Sequence[float], given: Given) -> list[Panel]:
    panels = []
    for name, unit, column, factor, theirs, later in (
        ("depth", "m", "h_m", 1.0, DEPTHS, LATER),
        ("stress on the bed", "kPa", "sigma_kPa", 1e-3, STRESSES, LATER[1:]),
        ("pore pressure on the bed", "kPa", "p_kPa", 1e-3, PRESSURES, LATER[1:]),
    ):
        for gauge, place in enumerate(PLACES):
            bands = []
            for mix in ("SG", "SGM"):
                table = given.tables.get(f"usgs_flume_{mix}_rough_x{place:.0f}m")
                if table is not None:
                    x, y, d = (table.numbers(each) for each in ("t_s", column, f"sd_{column}"))
                    bands.append(Band(x, y - d, y + d, f"{mix}, ± one deviation"))
                else:
                    x = ARRIVALS[mix, place] + np.array(later)
                    y, d = np.array(theirs[mix, place]).T
                    bands.append(Band(x, y - d, y + d, f"{mix}, ± one deviation"))
            curves = []
            for run, spacing in zip(runs, spacings, strict=True):
                values = {"depth": run.depth, "stress on the bed": run.stress}.get(name, run.pressure)
                curves.append(Curve(run.time, factor * values[:, gauge], f"{spacing:g} m"))
            end = ARRIVALS["SG", place] + 6.0
            panels.append(Panel(f"{name} at {place:g} m", "t [s]", unit, curves, bands=bands, x_range=(2.0, end)))
    return panels
