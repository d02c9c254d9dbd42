"""A loose wedge of soil behind a wall that liquefied as it failed, 9 June 1999, in the flume of the U.S. Geological
Survey."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Curve, Outcome, Panel, Table, compared, holds, number, reference, reported
from warp_mpm.validation.measured.given import Given, simulated
from warp_mpm.validation.scenes import scene

G = 9.81
TIMES = (0.0, 0.5, 1.0, 1.5)
HEADS = (35.3, 48.2, 59.5, 79.7)
"""Pore pressure in the middle, 64 cm deep [cm of water]."""

WAYS = (0.0, 0.122, 0.522, 1.129)
"""Of the upper extensometer from its place at t = 0 [m]."""

SOLID, CRITICAL, SLOPE, DEPTH = 0.48, 0.56, 31.0, 0.65

BED = (
    (-7.0, 0.0),
    (-1.95, 0.0),
    (-1.82, 0.013),
    (-0.975, 0.182),
    (-0.455, 0.39),
    (0.0, DEPTH),
    (1.888, 0.0),
    (12.0, 0.0),
)
"""The surface on which the wedge fails, along and normal to the slope: the bed, then up over the soil that stays behind
the wall to its crest at x = 0, then down 19° to the bed, as published for D-Claw. Between −1.95 and 0 it is a curve
of the fourth order through these points."""

TOP = (-4.516, -5.598)
"""Where the surface of the wedge begins to fall upslope, and where it meets the bed, level in space."""

MIDDLE, UPPER = -2.2, -3.4

DENSITY = SOLID * 2700.0 + (1.0 - SOLID) * 1000.0
RATIO = 0.353 * 1000.0 * G / (DENSITY * G * math.cos(math.radians(SLOPE)) * 0.64)
"""Pore pressure over total stress at t = 0, as measured."""


@dataclass(frozen=True)
class Wedge:
    """What a run is made with."""

    solid: float = SOLID
    coefficient: float = 1.0
    compressibility: float = 0.3
    """a of the skeleton's K = m (σ' + 1 kPa)/a; 0.3 in the settings of this experiment, 0.03 the flume's likely one."""
    lateral: float | None = 1.0
    """Stress along the slope over that normal to it at the start; None: Jaky's."""
    poisson_ratio: float = 0.0
    """The least there is, so that a skeleton of that K is as stiff in shear as it can be."""


def ground() -> list[list[float]]:
    """The surface on which it fails, its curve in sixteen pieces."""
    x, y = np.array(BED).T
    curve = np.polynomial.Polynomial.fit(x[1:6], y[1:6], 4)
    inner = [[float(at), float(max(curve(at), 0.0))] for at in np.linspace(x[1], 0.0, 17)]
    return [list(BED[0]), *inner, *(list(corner) for corner in BED[6:])]


def outline() -> list[list[float]]:
    """Corners of the wedge, counter-clockwise from where it meets the bed upslope."""
    below = [corner for corner in ground() if BED[1][0] <= corner[0] <= 0.0]
    return [[TOP[1], 0.0], *below, [TOP[0], DEPTH]]


def failed(spacing: float, wedge: Wedge | None = None) -> tuple[Array, Array, Array]:
    """Times [T] [s], heads in the middle [cm of water] and ways of the upper surface [m] of a wedge let go."""
    wedge = wedge or Wedge()
    borne = DENSITY * G * math.cos(math.radians(SLOPE)) * 0.5 * DEPTH * (1.0 - RATIO)
    stiffness = SOLID * (borne + 1e3) / wedge.compressibility
    soil: dict[str, Any] = {
        "grain_density_kg_per_m3": 2700.0,
        "porosity": 1.0 - wedge.solid,
        "friction_angle_deg": 38.0,
        "young_modulus_Pa": 3.0 * stiffness * (1.0 - 2.0 * wedge.poisson_ratio),
        "poisson_ratio": wedge.poisson_ratio,
        "liquid_bulk_modulus_Pa": 1e7,
        "hydraulic_conductivity_m_per_s": 2.5e-4,
        "porosity_update": True,
        "conductivity_law": "exponential",
        "dilatancy": {"critical_solid_fraction": CRITICAL, "coefficient": wedge.coefficient},
    }
    made = scene(
        "loose wedge of 1999",
        outline(),
        "two_phase",
        end_time=TIMES[-1],
        tilt=SLOPE,
        lateral=wedge.lateral,
        soil=soil,
        spacing_m=spacing,
        domain={"left_m": -6.5, "right_m": 11.0, "top_m": 2.5},
    )
    bed = {"profile_m": ground(), "friction": math.tan(math.radians(38.0))}
    simulation = Simulation(made.replaced({"ground": bed, "flow.initial_pore_pressure_ratio": RATIO}))
    x, y = simulation.points()["position"].T
    surface = (np.abs(x - UPPER) < 0.25) & (y > 0.75 * DEPTH)
    start = float(x[surface].mean())
    times = np.linspace(0.0, TIMES[-1], 31)
    heads, ways = [], []
    for time in times:
        simulation.advance(float(time))
        points = simulation.points(["position", "pore_pressure"])
        x, y = points["position"].T
        deep = (np.abs(x - MIDDLE) < 0.3) & (y < 0.1)
        heads.append(float(points["pore_pressure"][deep].mean()) / (10.0 * G) if deep.any() else 0.0)
        ways.append(float(x[surface].mean()) - start)
    return times, np.array(heads), np.array(ways)


PRESSED = (
    "until 1 s the head rises as measured; then ours has run over the crest and thins out, which the experiment's, "
    "behind its sides, had not yet done"
)
"""Why the last head is missed, written after the run."""

MOVED = (
    "ours sets out at 4 m/s², almost as if nothing held it, the experiment's at 1 m/s² throughout. Three things let "
    "it: it is let go at once; a skeleton of a = 0.3 has a shear modulus of 10 kPa and moves two decimetres before its "
    "friction is called up, which a stiffer one halves, but that liquefies within 0.5 s; and with the head measured at "
    "the start, 35 cm, friction of 38° bears only 0.84 of the pull on a long slope, whatever the stiffness: what held "
    "the experiment, beside the crest, are the sides of a flume of 2 m, which are not in the model and bear, by their "
    "friction on 0.65 m of soil, a tenth or two of its weight. No law or parameter in a plane stands in for them"
)
"""Likewise the ways."""


def loose_wedge(given: Given) -> Outcome:
    """That its pore pressure rises toward its weight as it fails, that without dilatancy it does not, and that a dense
    one's falls: asked of every spacing, of heads over those at the start. Heads at 0.5, 1 and 1.5 s within 30 %, ways
    within a factor of 2: the wall and the flume's sides hold the wedge in ways that are not in the model, and it is let
    go at once out of its balance, where the experiment came to it slowly.

    (Written after two runs at 0.08 m, in which the numbers had missed by more, had been seen. Since then the settings,
    not the limits, were changed: the shape of the wedge and of what it slides on, and the compressibility a = 0.3, are
    now those published for this very experiment, where a guess and the flume's likely 0.03 had stood; the stress at the
    start is alike in all directions and Poisson's ratio 0, as the law for which a was published knows no shear
    stiffness. What each of these does is on the page.)

    A miss of the heads means (said after the runs) that shearing and pore pressure are not coupled as they were, one of
    the ways that what held the wedge back is not in the model.
    """
    spacings = (0.1,) if given.quick else tuple(spacing / given.finer for spacing in (0.08, 0.05, 0.032))
    curves, moved = [reference(TIMES, HEADS, "measured")], [reference(TIMES, WAYS, "measured")]
    checks, points = [], []
    at_times: list[tuple[Array, Array]] = []
    for spacing in spacings:
        times, heads, ways = failed(spacing)
        _, plain, slides = failed(spacing, Wedge(coefficient=0.0))
        _, dense, stays = failed(spacing, Wedge(solid=0.60))
        others = [("without dilatancy", plain, slides), ("dense, m = 0.60", dense, stays)]
        for name, head, way in [("loose", heads, ways), *(others if spacing == spacings[-1] else [])]:
            curves.append(Curve(times, head, f"{name}, {spacing:g} m"))
            moved.append(Curve(times, way, f"{name}, {spacing:g} m"))
        at_times.append((np.interp(TIMES, times, heads), np.interp(TIMES, times, ways)))
        at = int(np.argmin(np.abs(times - 1.0)))
        loose, without, packed = (head[at] / head[0] for head in (heads, plain, dense))
        checks.append(
            holds(
                f"{spacing:g} m: head at 1 s over that at the start: loose above 1.3 of plain, plain above dense",
                "-",
                float(loose),
                bool(loose > 1.3 * without and without > packed),
                reference=f"plain {without:.2f}, dense {packed:.2f}",
            )
        )
    for k in range(1, len(TIMES)):
        time, reached, gone = TIMES[k], HEADS[k], WAYS[k]
        ours, moves = (float(values[k]) for values in at_times[-1])
        for name, measured, which in (("head [m]", 0.01 * reached, 0), ("way [m]", gone, 1)):
            found = [(0.01, 1.0)[which] * float(values[which][k]) for values in at_times]
            points.append(simulated(f"{name} at {time:g} s", measured, found, by="loose wedge, with dilatancy"))
        checks += [
            compared(f"head in the middle at {time:g} s", "cm", ours, reached, 0.30, remark=PRESSED),
            holds(
                f"way of the surface at {time:g} s",
                "m",
                moves,
                0.5 < moves / gone < 2.0,
                reference=f"{gone:g}, within a factor of 2",
                remark=MOVED,
            ),
        ]
    checks.append(reported("greatest head", "cm", float(heads.max()), reference=max(HEADS)))
    return Outcome(
        checks=checks,
        points=points,
        panels=[
            Panel("pore pressure in the middle, 64 cm deep", "time [s]", "head [cm of water]", curves),
            Panel("surface of the upper part", "time [s]", "way [m]", moved),
        ],
        tables=[] if given.quick else [_tried(spacings[0])],
    )


def _tried(spacing: float) -> Table:
    """What each of the settings does to the loose wedge."""
    judged = Wedge()
    wedges = {
        "as judged": judged,
        "a = 0.03": replace(judged, compressibility=0.03),
        "a = 0.03, without dilatancy": replace(judged, compressibility=0.03, coefficient=0.0),
        "a = 0.003, without dilatancy": replace(judged, compressibility=0.003, coefficient=0.0),
        "Jaky's stress at the start": replace(judged, lateral=None),
        "Poisson's ratio 0.3": replace(judged, poisson_ratio=0.3),
        "Jaky's, 0.3, a = 0.03": Wedge(compressibility=0.03, lateral=None, poisson_ratio=0.3),
    }
    rows = []
    for name, wedge in wedges.items():
        times, heads, ways = failed(spacing, wedge)
        rows.append((name, *(number(float(np.interp(t, times, v))) for v in (heads, ways) for t in TIMES[1:])))
    rows.append(("measured", *(number(value) for value in (*HEADS[1:], *WAYS[1:]))))
    columns = ("", *(f"head [cm] at {t:g} s" for t in TIMES[1:]), *(f"way [m] at {t:g} s" for t in TIMES[1:]))
    return Table(f"What was tried, {spacing:g} m", columns, rows)
