"""Ten cubic metres of debris let go down the flume of the U.S. Geological Survey, with the paper's law and others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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

STRAIGHT, RADIUS, TURN = 82.5, 10.0, 28.5
"""Way down the bed from the gate at which the slope of 31° ends [m], radius of the arc that follows [m], and by how
much it turns, to 2.5° [°]."""

PLACES = (32.0, 66.0, 90.0)
"""Gauges, in metres of bed from the gate; the last one lies 2.5 m beyond the arc."""

ARRIVED = 0.05
"""Depth at which the front is there [m]."""

LATER = (1.0, 2.0, 3.0, 4.0, 5.0)
"""Seconds behind the arrival at which depths are compared; stresses from the second one on, as the front is dilute."""

ARRIVALS = {
    ("SG", 32.0): 3.87,
    ("SG", 66.0): 8.42,
    ("SG", 90.0): 14.45,
    ("SGM", 32.0): 4.13,
    ("SGM", 66.0): 7.14,
    ("SGM", 90.0): 11.42,
}
"""[s], by mixture (sand and gravel, without and with mud) and place."""

Behind = Mapping[tuple[str, float], tuple[tuple[float, float], ...]]

DEPTHS: Behind = {
    ("SG", 32.0): ((0.148, 0.024), (0.158, 0.022), (0.147, 0.017), (0.107, 0.020), (0.072, 0.020)),
    ("SG", 66.0): ((0.162, 0.027), (0.159, 0.029), (0.139, 0.022), (0.109, 0.017), (0.089, 0.019)),
    ("SG", 90.0): ((0.203, 0.071), (0.221, 0.079), (0.228, 0.073), (0.216, 0.060), (0.219, 0.061)),
    ("SGM", 32.0): ((0.174, 0.033), (0.121, 0.022), (0.092, 0.029), (0.062, 0.023), (0.042, 0.014)),
    ("SGM", 66.0): ((0.140, 0.030), (0.136, 0.019), (0.115, 0.026), (0.082, 0.014), (0.062, 0.010)),
    ("SGM", 90.0): ((0.124, 0.016), (0.119, 0.015), (0.113, 0.019), (0.113, 0.028), (0.108, 0.024)),
}
"""Mean and standard deviation of the ensemble [m], means over half a second around `LATER`."""

STRESSES: Behind = {
    ("SG", 32.0): ((2.492, 0.486), (2.606, 0.339), (2.072, 0.389), (1.500, 0.386)),
    ("SG", 66.0): ((2.626, 0.914), (2.380, 0.716), (1.860, 0.520), (1.469, 0.372)),
    ("SGM", 32.0): ((1.916, 0.312), (1.502, 0.389), (1.071, 0.299), (0.799, 0.204)),
    ("SGM", 66.0): ((2.513, 0.973), (1.955, 0.518), (1.331, 0.318), (0.993, 0.223)),
}
"""Normal stress on the bed [kPa]. None at 90 m, where what was measured would weigh 2500 to 3000 kg/m³ of depth, more
than a mixture of these grains can."""

PRESSURES: Behind = {
    ("SG", 32.0): ((1.590, 0.531), (1.876, 0.289), (1.526, 0.210), (1.204, 0.215)),
    ("SG", 66.0): ((1.694, 0.513), (1.586, 0.424), (1.266, 0.319), (1.047, 0.295)),
    ("SG", 90.0): ((1.252, 1.231), (1.153, 1.112), (1.117, 1.018), (1.087, 0.948)),
    ("SGM", 32.0): ((1.617, 0.670), (1.240, 0.425), (0.962, 0.278), (0.819, 0.233)),
    ("SGM", 66.0): ((1.789, 0.767), (1.742, 0.360), (1.396, 0.230), (1.150, 0.172)),
    ("SGM", 90.0): ((2.223, 0.855), (2.073, 0.700), (1.978, 0.636), (1.957, 0.670)),
}
"""Pore pressure on the bed [kPa]."""

FRICTIONS = (38.0, 40.7, 43.0)
"""Angles of the bed's friction [°], the published likely value between the ends of its range."""

PERMEABILITIES = (1e-8, 5e-9, 1e-12)
"""Likewise [m²]."""

FLUID_VISCOSITIES = (0.005, 0.01, 0.05)
"""Likewise, of water with fines [Pa s]."""

CRITICALS = (0.62, 0.64, 0.66)
"""Likewise solid fractions at which shearing changes no volume; the mixture starts at 0.61."""

STARTS = {"hydrostatic": None, "liquefied": 1.0}
"""Ratio of pore pressure to total stress at the start. None: hydrostatic, as in the settings published with the
data."""

OFF_THE_BUMPS = 31.0
"""Friction of the bed before 6 m and beyond 82.5 m, where it has no bumps, in one of the published settings [°]."""

GRAINS = 0.00155
"""Diameter δ of the grains in the published settings [m]."""

COARSE = 0.01
"""Their diameter in the figures of the published scripts [m], taken for μ(I), which is of coarse grains that touch."""

GROWTH = 0.26
"""By how much μ(I) grows from rest to fast shearing: as of glass beads (Jop and others 2006), for want of its own."""


VISCOSITIES = (2.1, 9.5)
"""Of the mixture [Pa s]: least and greatest that measured fits a₂ e^(b₂ C) give at its solid fraction of 0.61, of those
whose R² is 0.7 or more (Geotechnics 2025, 5(2), 37). The least one is of the sample with the coarsest grains, 25.4 mm,
nearest to the flume's gravel, and of the best fit, 0.93."""

HELD = 10.0
"""Friction of a bed on which nothing slips."""


@dataclass(frozen=True)
class Setting:
    """What a run is made with; left out, the paper's law, Mohr–Coulomb without dilatancy."""

    friction: float = 40.7
    permeability: float = 5e-9
    start: str = "liquefied"
    critical: float | None = None
    """Critical solid fraction of a skeleton with dilatancy; None: without."""
    fluid: float = 0.01
    internal: float | None = None
    """Angle of friction within the material [°]; None: that of the bed."""
    smooth_ends: bool = False
    """The bed rubs by `OFF_THE_BUMPS` where it has no bumps."""
    mu_i: bool = False
    viscous: float | None = None
    """Viscosity of the mixture beside its friction [Pa s]; None: without."""
    held: bool = False
    """The bed holds what touches it, in place of its friction."""

    @property
    def words(self) -> str:
        said = [f"{self.friction:g}°", f"κ = {self.permeability:g} m²", f"{self.start} start"]
        said += [f"m_crit = {self.critical:g}"] if self.critical is not None else []
        said += [f"η = {self.fluid:g} Pa s"] if self.fluid != 0.01 else []
        said += [f"φ' = {self.internal:g}°"] if self.internal is not None else []
        said += ["31° off the bumps"] if self.smooth_ends else []
        said += ["μ(I)"] if self.mu_i else []
        said += [f"{self.viscous:g} Pa s"] if self.viscous is not None else []
        said += ["bed that holds"] if self.held else []
        return ", ".join(said)

    @property
    def soil(self) -> dict[str, Any]:
        """Fields of the material."""
        fields: dict[str, Any] = {
            "grain_density_kg_per_m3": 2700.0,
            "liquid_density_kg_per_m3": 1100.0,
            "porosity": 0.39,
            "young_modulus_Pa": 1e5,
            "poisson_ratio": 0.3,
            "liquid_bulk_modulus_Pa": 2e6,
            "liquid_viscosity_Pa_s": self.fluid,
            "hydraulic_conductivity_m_per_s": self.permeability * 1100.0 * G / self.fluid,
        }
        tangent = math.tan(math.radians(self.friction))
        if self.mu_i:
            fields |= {"law": "mu_i", "static_friction": tangent, "dynamic_friction": tangent + GROWTH}
            fields |= {"grain_diameter_m": COARSE}
        else:
            fields |= {"friction_angle_deg": self.friction if self.internal is None else self.internal}
        if self.viscous is not None:
            fields |= {"law": "coulomb_viscous", "mixture_viscosity_Pa_s": self.viscous}
        if self.critical is not None:
            fields |= {"porosity_update": True, "conductivity_law": "exponential"}
            fields["dilatancy"] = {
                "critical_solid_fraction": self.critical,
                "coefficient": 1.0,
                "grain_diameter_m": COARSE if self.mu_i else GRAINS,
            }
        return fields


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


END, RECORD = 12.0, 0.05
LATE_END = 20.0
"""Of runs that are to be seen on the pad, where the experiments come after 11 and 14 s."""

FAR = 103.0
"""Where the domain ends [m along the slope of 31°], 8 m beyond the last gauge; what flows on is let go."""

HALF_STRIP = 0.25
"""Half the length of bed over which a gauge takes means [m]."""


def profile() -> list[list[float]]:
    """The bed, in axes along and normal to its slope of 31°: straight, an arc of twenty pieces, straight."""
    angles = np.radians(np.linspace(0.0, TURN, 21))
    arc = [[STRAIGHT + RADIUS * math.sin(a), RADIUS * (1.0 - math.cos(a))] for a in angles.tolist()]
    x, y = arc[-1]
    return [[-7.0, 0.0], *arc, [FAR + 1.0, y + (FAR + 1.0 - x) * math.tan(math.radians(TURN))]]


def along(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Way down the bed from the gate [m], height normal to it [m], and angle by which it has turned there [rad]."""
    turn = math.radians(TURN)
    angle = np.where(x > STRAIGHT, np.clip(np.arctan2(x - STRAIGHT, RADIUS - y), 0.0, turn), 0.0)
    foot_x, foot_y = STRAIGHT + RADIUS * np.sin(angle), RADIUS * (1.0 - np.cos(angle))
    foot_x = np.where(x > STRAIGHT, foot_x, x)
    beyond = (x - foot_x) * np.cos(angle) + (y - foot_y) * np.sin(angle)  # of the arc's end; 0 before
    height = -(x - foot_x) * np.sin(angle) + (y - foot_y) * np.cos(angle)
    way = np.where(x > STRAIGHT, STRAIGHT + RADIUS * angle + beyond, x)
    return way, height, angle


def run_down(setting: Setting, spacing: float, end: float = END) -> Passed:
    """One release, until `end` [s]."""
    tangent = HELD if setting.held else math.tan(math.radians(setting.friction))
    made = scene(
        f"debris flume, {setting.words}",
        HOPPER,
        "two_phase",
        end_time=end,
        tilt=SLOPE,
        soil=setting.soil,
        spacing_m=spacing,
        domain={"left_m": -6.0, "right_m": FAR, "top_m": 12.0},
    )
    ground: dict[str, Any] = {"profile_m": profile(), "friction": tangent}
    if setting.smooth_ends:
        ends = math.tan(math.radians(OFF_THE_BUMPS))
        ground["friction"] = ends
        ground["stretches"] = [{"from_m": 6.0, "friction": tangent}, {"from_m": STRAIGHT, "friction": ends}]
    start = STARTS[setting.start]
    simulation = Simulation(made.replaced({"ground": ground, "flow.initial_pore_pressure_ratio": start}))
    times = np.arange(1, round(end / RECORD) + 1) * RECORD
    rows = []
    for time in times.tolist():
        simulation.advance(time)
        points = simulation.points(["position", "volume", "effective_stress", "pore_pressure"])
        rows.append(at_gauges(points, spacing))
    depth, stress, pressure = np.array(rows).transpose(2, 0, 1)
    return Passed(times.astype(np.float64), depth, stress, pressure)


def at_gauges(points: Mapping[str, Array], spacing: float) -> list[tuple[float, float, float]]:
    """Depth [m], and total normal stress and pore pressure [Pa] in the lowest cell, over a strip of the bed, of each
    gauge."""
    x, y = points["position"].T
    way, height, angle = along(x, y)
    xx, yy, xy = points["effective_stress"][:, [0, 1, 3]].T
    sine, cosine = np.sin(angle), np.cos(angle)
    normal = points["pore_pressure"] - (xx * sine**2 + yy * cosine**2 - 2.0 * xy * sine * cosine)
    found = []
    for place in PLACES:
        near = np.abs(way - place) < HALF_STRIP
        depth = float(points["volume"][near].sum() / (2.0 * HALF_STRIP))
        low = near & (height < spacing)
        weight = points["volume"][low]
        stress, pressure = (
            float(np.average(values[low], weights=weight)) if low.any() else 0.0
            for values in (normal, points["pore_pressure"])
        )
        found.append((depth, stress, pressure))
    return found


JUDGED = PLACES[:2]
"""Gauges whose depths, stresses and pressures count together; of the one at 90 m depths count, by themselves."""


def _hits(run: Passed, mix: str) -> dict[str, list[bool]]:
    """Which means behind the front lie within a standard deviation of the ensemble, by quantity."""
    found: dict[str, list[bool]] = {}
    for name, values, theirs, later, places in (
        ("depth", run.depth, DEPTHS, LATER, JUDGED),
        ("stress on the bed", run.stress / 1e3, STRESSES, LATER[1:], JUDGED),
        ("pore pressure on the bed", run.pressure / 1e3, PRESSURES, LATER[1:], JUDGED),
        ("depth at 90 m", run.depth, DEPTHS, LATER, PLACES[2:]),
    ):
        found[name] = [
            abs(run.behind(values, PLACES.index(place), time) - mean) <= deviation
            for place in places
            for time, (mean, deviation) in zip(later, theirs[mix, place], strict=True)
        ]
    return found


def _spacings(given: Given) -> tuple[float, ...]:
    return tuple(spacing / given.finer for spacing in ((0.2, 0.1) if given.quick else (0.2, 0.1, 0.05)))


def _outcome(
    given: Given,
    central: Setting,
    others: Sequence[Setting],
    title: str,
    short: str,
    words: str,
    *,
    by: str,
    beside: Mapping[str, Passed] | None = None,
) -> Outcome:
    """A setting at every spacing, judged, and others at the first one; `by` names the law in the picture of all, and
    runs `beside` are drawn with those that are judged."""
    drawn = dict(beside or {})
    spacings = _spacings(given)
    ladder = Ladder([f"{spacing:g} m" for spacing in spacings], by=by)
    runs = [run_down(central, spacing) for spacing in spacings]
    _judge(ladder, runs, short)
    explored = {central.words: runs[0]} | {setting.words: run_down(setting, spacings[0]) for setting in others}
    return Outcome(
        checks=ladder.checks,
        points=ladder.points,
        panels=_panels([*runs, *drawn.values()], [*ladder.spacings, *drawn], given),
        tables=[ladder.table, _explored_table(explored, f"{title}, {spacings[0]:g} m")],
        remarks=[words],
    )


SHORT = (
    "no start stands in for what the law lacks: a liquefied one runs as if without friction, is at 66 m when a body "
    "that falls freely down 31° would be, 5.1 s, and 40 % too shallow there; a hydrostatic one is at 32 and 66 m in "
    "time, after 3.6 to 4.2 and 6 to 7 s, yet as a film of 0.1 m whose body stays in the hopper or comes seconds "
    "later, and at 90 m three seconds early; no friction or permeability of the ranges changes that; why, see the next "
    "case; spacings from 0.2 to 0.05 m agree on arrival and depth, not yet on the stresses, which the lowest of one to "
    "three cells shows"
)
"""Why the aim is missed, written after the run."""

CAUSE = (
    "with dilatancy the mixture liquefies as it leaves the hopper, as it should, and comes to 32 m, with the doors' "
    "time, when the experiments do; but it goes on as if without friction and is at 66 m 1.7 to 3.0 s before them. "
    "What is missing the measurements show: at 32 m there is pore pressure from the first contact on, at 66 m there "
    "is none, under 0.1 kPa, in the first half second behind the front, some 5 m of it. Such a dry front, of 40.7° on "
    "a slope of 31°, loses 2 m/s each second and dams up what follows: measured fronts run from 32 to 66 m with 7.5 "
    "and 11 m/s, ours with 20. Coarse grains gather there and the water drains from them (Iverson 1997); a material "
    "of one grain size cannot part so, and no density, friction, permeability, viscosity of the pore fluid or start "
    "of the ranges and no spacing stands in for it; what a viscosity of the mixture does, see the next case. A "
    "friction that grows with the rate slows a hydrostatic start, to 6.8 s at 66 m, as a film of 0.07 m, and a "
    "liquefied one not at all. Too little to be the cause: the doors (0.56 s), the side walls (4 % of what drives the "
    "flow), the bed's range of friction (0.3 s at 66 m)"
)
"""Why the aims are missed with dilatancy too: what the measurements themselves say of it."""


def debris_flume(given: Given) -> Outcome:
    """The aim: depth, normal stress and pore pressure on the bed within one standard deviation of the ensemble for more
    than half of the times behind the front (one to five seconds at 32 and 66 m for depths, two to five for stresses),
    for at least one of the two mixtures, at the finest spacing with the published likely values, 40.7° and 5e-9 m², and
    a liquefied start. One standard deviation, because two thirds of the experiments themselves lie within it; half of
    the times, because the ensemble's shape is that of no single flow. The same of depths at 90 m, on the pad.

    Arrival at 32 m within 15 % of the experiments', whose two mixtures differ by 7 % there, by 16 % at 66 m and by 24 %
    at 90 m; the same at 66 and 90 m. (Made stricter after the runs on the straight part had been seen, of which the
    arrival at 66 m was only reported: the profile is now the flume's, to beyond 90 m.)

    Friction and permeability come from the published ranges and no other; nothing is fitted. Every run of the ranges is
    on the page, the best and the worst. The law is the paper's, without dilatancy: the mixture's measured start is
    looser than critical (0.61 against 0.64), so that shearing raises its pore pressure, which this law does not know. A
    start that is liquefied stands in for it; a hydrostatic one is run beside it. So a hydrostatic start is expected to
    come too late, and a miss of the pressures to say what the law lacks.
    """
    others = [Setting(start="hydrostatic")]
    if not given.quick:
        ends = product(FRICTIONS[::2], PERMEABILITIES[::2], STARTS)
        others += [Setting(friction, permeability, start) for friction, permeability, start in ends]
        others += [Setting(start="hydrostatic", internal=SHEARED_AS_MEASURED)]
        others += [Setting(start="hydrostatic", internal=SHEARED_AS_MEASURED, smooth_ends=True)]
    words = (
        "SG is the mixture without mud, SGM that with it. The bed is the flume's: 82.5 m at 31°, an arc of 10 m "
        "radius, a pad of 2.5°. The flume is 2 m wide; beside its pad there are no walls, and the experiments spread "
        "where a plane flow cannot. Depth is volume over area of half a metre of bed; stress and pore pressure are "
        "means over the lowest cell of it. The skeleton is soft (E = 100 kPa), as the published compressibility makes "
        "it under some kilopascals. The internal friction is that of the bed; without dilatancy it shears at sin φ' "
        "of the normal stress, so that the material slips in its lowest cells before the bed does: φ' = "
        f"{SHEARED_AS_MEASURED:g}°, whose sine is tan 40.7°, has it slide on the bed as the friction was measured. The "
        "hopper's back is open, its load is 4.95 m² per metre of width. The side walls do not rub: with half of the "
        "weight across, a friction of 0.5 and 0.15 m of depth they would bear 2 % of the weight, which is 4 % of what "
        "drives the flow."
    )
    title = "Every run of the published ranges"
    return _outcome(given, Setting(), others, title, SHORT, words, by="debris, paper's law")


SHEARED_AS_MEASURED = 59.3
"""φ' [°] at which a material without dilatancy shears at tan 40.7° of the normal stress."""


def debris_flume_dilatancy(given: Given) -> Outcome:
    """The aims are those of the case before: shares within one standard deviation, and arrival within 15 %, for the law
    that knows what the paper's does not. Its start is hydrostatic, as in the settings published with the data, since a
    loose mixture liquefies by itself.

    Parameters, all published with the data and none fitted: solid fraction 0.61 at the start, 0.64 critical (0.62 to
    0.66), coefficient 1, grains of 1.55 mm, bed friction 40.7° (38 to 43), permeability 5e-9 m² (1e-8 to 1e-12) that
    falls by a factor e for each 0.04 of solid fraction, a pore fluid of 0.01 Pa s (0.005 to 0.05). The likely values
    are judged; every end of every range is on the page. They were chosen before any run with this law was made. Then
    runs at 0.2 and 0.1 m were seen before this sentence was written; no value was changed for them.

    μ(I) beside it is of the bed's friction at rest, with grains of 10 mm and the growth by 0.26 of glass beads: a law
    whose friction grows with the rate of shearing can only slow the flow down.

    A miss means (said after the runs) that neither law, with what was measured of the material, foretells such a flow
    from its release.
    """
    likely = Setting(start="hydrostatic", critical=0.64)
    others: list[Setting] = []
    if given.quick:
        others = [Setting(start="hydrostatic", mu_i=True)]
    else:
        ends = product(FRICTIONS[::2], CRITICALS[::2])
        others += [Setting(friction, start="hydrostatic", critical=critical) for friction, critical in ends]
        others += [Setting(permeability=k, start="hydrostatic", critical=0.64) for k in PERMEABILITIES[::2]]
        others += [Setting(start="hydrostatic", critical=0.64, fluid=fluid) for fluid in FLUID_VISCOSITIES[::2]]
        others += [Setting(start="hydrostatic", critical=0.63, fluid=0.005, smooth_ends=True)]
        others += [Setting(start="liquefied", critical=0.64)]
        others += [Setting(start="hydrostatic", mu_i=True), Setting(start="liquefied", mu_i=True)]
        others += [Setting(start="hydrostatic", critical=0.64, mu_i=True)]
    words = (
        "Bed, gauges and skeleton are those of the case before. The row of m_crit = 0.63 is the setting of the "
        "published script of these experiments, with 31° where the bed has no bumps. The doors of the hopper, gone at "
        "once here, opened over 0.74 to 0.77 s; over their angle as published, the part of the width that they close "
        f"adds up to {DOORS:g} s."
    )
    title = "Every run of the published ranges, and of μ(I)"
    return _outcome(given, likely, others, title, CAUSE, words, by="debris, with dilatancy")


def debris_flume_viscous(given: Given) -> Outcome:
    """The aims are those of the cases before. The law is Coulomb's friction with a viscosity of the mixture beside it,
    and dilatancy; it was run last, when the runs of the other laws had been seen, and the parameters below were written
    down before its first run.

    The viscosity stays where the pore pressure has taken the load off the grains, so that it is the one stress of these
    laws that could hold back a liquefied flow: at 15 m/s over 0.15 m, sheared at 100 to 300 a second, 2 Pa s make 0.2
    to 0.6 kPa of the 1.5 kPa that pull. Its values are what measured fits of coarse debris give at the solid fraction
    of the mixture at its start, 0.61: 2.1 Pa s for the coarsest grains, which is judged, up to 9.5 Pa s, run beside it;
    the fits are of other debris, up to 25 mm, and slower shearing. All else is as judged with dilatancy.

    A bed that slips by its friction lets a liquefied flow pass however viscous it is. So each viscosity is also run on
    a bed that holds what touches it, as bumps of 16 mm may a viscous body; that is outside of the published friction of
    the bed, and therefore not judged. A miss means (said after the first runs) that a viscosity measured on such
    debris does not stand in for what the other laws lack.
    """
    likely = Setting(start="hydrostatic", critical=0.64, viscous=VISCOSITIES[0])
    others: list[Setting] = []
    for viscosity in VISCOSITIES:
        plain = Setting(viscous=viscosity)
        others += [replace(likely, viscous=viscosity), replace(plain, start="hydrostatic"), plain]
        others += [replace(likely, viscous=viscosity, held=True), replace(plain, held=True)]
    words = "Bed, gauges and skeleton are those of the cases before."
    title = "Every run with a viscosity of the mixture"
    chosen = others[1:2] if given.quick else others[1:]
    by = "debris, with a viscosity"
    if given.quick:
        return _outcome(given, likely, chosen, title, VISCOUS, words, by=by)
    spacings = _spacings(given)
    # The finest spacing is for the greater viscosity alone: with the lesser the coarser ones differ too much already.
    by_spacing = [*product(VISCOSITIES[:1], spacings[:-1]), *product(VISCOSITIES[1:], spacings)]
    held = {
        f"{viscosity:g} Pa s, {spacing:g} m": run_down(replace(likely, viscous=viscosity, held=True), spacing)
        for viscosity, spacing in by_spacing
    }
    longer = {
        f"{viscosity:g} Pa s, {spacings[1]:g} m, until {LATE_END:g} s": run_down(
            replace(likely, viscous=viscosity, held=True), spacings[1], LATE_END
        )
        for viscosity in VISCOSITIES
    }
    beside = {f"bed that holds, {name}": run for name, run in longer.items()}
    outcome = _outcome(given, likely, chosen, title, VISCOUS, words, by=by, beside=beside)
    return replace(outcome, tables=[*outcome.tables, _explored_table(held | longer, "On a bed that holds, by spacing")])


VISCOUS = (
    "on the bed's own friction a viscosity does next to nothing: where the pore pressure has taken the load off the "
    "grains the flow slips on its bed as a block, whether with 2.1 or 9.5 Pa s, and is at 66 m after 5.0 to 5.4 s "
    "from a start that liquefies. What brakes it is drag at the bed. On a bed that holds it, which is outside of the "
    "published friction, 9.5 Pa s come to 32 m after 3.6 s and to 66 m after 8.1 s, within the limits, alike at 0.1 "
    "and 0.05 m; at 0.05 m 12 of the 26 depths, stresses and pore pressures of the mixture with mud at 32 and 66 m "
    "are within one deviation, until 12 s, more than with any other setting on this page, and still less than half; "
    "but it is not at 90 m after 20 s, where the experiments come after 11 to 14 s. 2.1 Pa s come there after 8.4 s, "
    "but their arrival hangs on the spacing, whose lowest cell is the layer that is sheared. So a drag at the bed "
    "that does not go with the grains' load is as good an account of the late arrival at 66 m as the dry front of the "
    "case before, and neither is of the pad as well"
)
"""Why the aims are missed with a viscosity too, written after the run."""

DOORS = 0.56
"""Time that the doors of the hopper take away [s]: the integral of cos of their angle, the part of the width that they
close, over four recorded openings of two doors (0.53 to 0.58 s), published with the data."""


def _judge(ladder: Ladder, runs: Sequence[Passed], short: str) -> None:
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
            remark=short,
        )
        ladder.add(check, ours)
    for gauge, place in enumerate(PLACES):
        low, high = sorted(ARRIVALS[mix, place] for mix in ("SG", "SGM"))
        middle = 0.5 * (low + high)
        ours = [run.arrival(gauge) for run in runs]
        earliest, latest = 0.85 * low, 1.15 * high
        check = holds(
            f"arrival at {place:g} m",
            "s",
            ours[-1],
            earliest <= ours[-1] <= latest,
            reference=f"{earliest:.3g} … {latest:.3g}",
            remark=short,
        )
        ladder.add(check, ours, measured=(middle, low, high))
        late = [time + DOORS for time in ours]
        ladder.add(reported(f"the same at {place:g} m, {DOORS:g} s later for the doors", "s", late[-1]), late)
        for name, unit, theirs, seen, later in (
            ("depth", "m", DEPTHS, [run.depth for run in runs], LATER),
            ("stress on the bed", "kPa", STRESSES, [run.stress / 1e3 for run in runs], LATER[1:]),
            ("pore pressure on the bed", "kPa", PRESSURES, [run.pressure / 1e3 for run in runs], LATER[1:]),
        ):
            for k, after in enumerate(later if ("SG", place) in theirs else ()):
                mean, deviation = theirs["SG", place][k]
                found = [run.behind(values, gauge, after) for run, values in zip(runs, seen, strict=True)]
                if np.isfinite(found).all():
                    ladder.points.append(
                        simulated(
                            f"{name} at {place:g} m, {after:g} s behind the front [{unit}]",
                            mean,
                            found,
                            band=(max(mean - deviation, 0.1 * mean), mean + deviation),
                            by=ladder.by,
                        )
                    )


def _explored_table(explored: Mapping[str, Passed], title: str) -> Table:
    """Runs by what they are called."""
    rows = []
    for name, run in explored.items():
        hits = {mix: sum(sum(found) for found in _hits(run, mix).values()) for mix in ("SG", "SGM")}
        of = sum(len(found) for found in _hits(run, "SG").values())
        rows.append(
            (
                name,
                *(_time(run.arrival(gauge), float(run.time[-1])) for gauge in range(len(PLACES))),
                *(number(float(run.depth[:, gauge].max())) for gauge in range(len(PLACES))),
                *(f"{hits[mix]} of {of}" for mix in ("SG", "SGM")),
            )
        )
    measured = ["measured, SG / SGM"]
    measured += [f"{ARRIVALS['SG', place]:g} / {ARRIVALS['SGM', place]:g}" for place in PLACES]
    measured += ["0.163 / 0.188", "0.178 / 0.159", "0.235 / 0.181", "", ""]
    return Table(
        f"{title}: arrival [s], greatest depth [m], means within one standard deviation",
        ("", *(f"at {place:g} m" for place in PLACES), *(f"depth at {place:g} m" for place in PLACES), "SG", "SGM"),
        [*rows, tuple(measured)],
    )


def _time(arrival: float, end: float) -> str:
    return number(arrival) if math.isfinite(arrival) else f"after {end:g}"


DRAWN = (
    *(("depth", place) for place in JUDGED),
    *(("stress on the bed", place) for place in JUDGED),
    *(("pore pressure on the bed", place) for place in JUDGED),
    ("depth", PLACES[2]),
    ("pore pressure on the bed", PLACES[2]),
)
"""Panels, two in a row."""


def _panels(runs: Sequence[Passed], labels: Sequence[str], given: Given) -> list[Panel]:
    quantities = {
        "depth": ("m", "h_m", 1.0, DEPTHS, LATER),
        "stress on the bed": ("kPa", "sigma_kPa", 1e-3, STRESSES, LATER[1:]),
        "pore pressure on the bed": ("kPa", "p_kPa", 1e-3, PRESSURES, LATER[1:]),
    }
    panels = []
    for name, place in DRAWN:
        unit, column, factor, theirs, later = quantities[name]
        bands = []
        for mix in ("SG", "SGM"):
            table = given.tables.get(f"usgs_flume_{mix}_rough_x{place:.0f}m")
            if table is not None:
                x, y, d = (table.numbers(each) for each in ("t_s", column, f"sd_{column}"))
            else:
                x = ARRIVALS[mix, place] + np.array(later)
                y, d = np.array(theirs[mix, place]).T
            bands.append(Band(x, y - d, y + d, f"{mix}, ± one deviation"))
        curves = []
        for run, label in zip(runs, labels, strict=True):
            values = {"depth": run.depth, "stress on the bed": run.stress}.get(name, run.pressure)
            curves.append(Curve(run.time, factor * values[:, PLACES.index(place)], label))
        end = ARRIVALS["SG", place] + 6.0
        panels.append(Panel(f"{name} at {place:g} m", "t [s]", unit, curves, bands=bands, x_range=(0.0, end)))
    return panels
