"""Dry sand: columns that collapse, and a flume that ends at a wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import (
    Array,
    Case,
    Check,
    Curve,
    Outcome,
    Panel,
    at_most,
    holds,
    reference,
    reported,
    within,
)
from warp_mpm.validation.scenes import box, fixed, sampled, scene

G = 9.81


# -- column collapse ---------------------------------------------------------------------------------------------

HALF_WIDTH = 0.2
"""Width L_0 of the column beside the wall [m]."""

REPOSE = 30.0
"""Angle at which the sand comes to rest [°]."""

SAND: dict[str, Any] = {
    "grain_density_kg_per_m3": 2650.0,
    "porosity": 0.4,
    "young_modulus_Pa": 1e6,
    "poisson_ratio": 0.3,
    "friction_angle_deg": math.degrees(math.asin(math.tan(math.radians(REPOSE)))),
}
"""A skeleton that shears without dilating bears a shear of sin φ' times the normal stress (Davis 1968), not tan φ'."""

EDGE = 0.03
"""Depth over L_0 at which the deposit ends: about two grains of the experiments."""


def run_out_band(ratio: float) -> tuple[float, float]:
    """(L - L_0)/L_0 of plane columns of aspect ratio a, from the two laws fitted to experiments: Lube et al. (2005)
    1.2 a (a < 1.8), 1.9 a^(2/3) (a > 2.8), straight in between; Lajeunesse et al. (2005) 1.8 a (a < 3), 2.3 a^(2/3)."""
    low = float(np.interp(ratio, [0.0, 1.8, 2.8], [0.0, 1.2 * 1.8, 1.9 * 2.8 ** (2 / 3)]))
    if ratio > 2.8:
        low = 1.9 * ratio ** (2 / 3)
    return low, 1.8 * ratio if ratio < 3.0 else 2.3 * ratio ** (2 / 3)


@dataclass(frozen=True)
class Collapsed:
    """A column after it has come to rest; lengths over L_0."""

    run_out: float
    height: float
    """At the wall."""
    mass_error: float
    profiles: list[Curve]


def collapsed(ratio: float, cells: int, soil: dict[str, Any], ground: float) -> Collapsed:
    """A column of an aspect ratio, let go on a ground of some friction, with so many cells over L_0."""
    height, spacing = ratio * HALF_WIDTH, HALF_WIDTH / cells
    end = 6.0 * math.sqrt(height / G)
    right = 10.0 * HALF_WIDTH * max(1.0, ratio**0.7)
    simulation = Simulation(
        scene(
            f"column collapse, a = {ratio:g}",
            box(-HALF_WIDTH, 0.0, height),
            "dry",
            end_time=end,
            soil=soil,
            ground=ground,
            spacing_m=spacing,
            domain={"left_edge": "wall", "left_m": -HALF_WIDTH, "right_m": right, "top_m": 1.2 * height},
        )
    )
    mass = simulation.sample()["solid_mass"]
    edges = np.arange(-HALF_WIDTH, right, 2.0 * spacing)
    middle = 0.5 * (edges[1:] + edges[:-1])
    curves = []
    for share in (0.0, 0.25, 0.5, 1.0):
        simulation.advance(share * end)
        points = simulation.points()
        depth = np.histogram(points["position"][:, 0], bins=edges, weights=points["volume"])[0] / (2.0 * spacing)
        curves.append(Curve(middle / HALF_WIDTH, depth / HALF_WIDTH, f"t = {share * 6.0:g} √(H/g)"))
    last = simulation.sample()
    return Collapsed(
        _edge(middle, depth) / HALF_WIDTH,
        float(depth[0]) / HALF_WIDTH,
        (last["solid_mass"] + last["left_mass"]) / mass - 1.0,
        curves,
    )


def _of_column(ratio: float, found: Collapsed, reason: str, before: str = "") -> list[Check]:
    low, high = run_out_band(ratio)
    return [
        within(f"{before}a = {ratio:g}: run-out", "L_0", found.run_out, low, high, remark=reason),
        at_most(f"{before}a = {ratio:g}: mass lost", "of the mass", found.mass_error, 1e-6),
        reported(
            f"{before}a = {ratio:g}: height at the wall",
            "L_0",
            found.height,
            reference=ratio if ratio < 1.15 else ratio**0.4,
            remark="Lube et al. (2005), recalled",
        ),
    ]


def _bands(curves: list[Curve]) -> Panel:
    fine = np.linspace(0.3, 4.5, 100)
    bands = np.array([run_out_band(float(a)) for a in fine])
    laws = [reference(fine, bands[:, 0], "1.2 a, 1.9 a^⅔"), reference(fine, bands[:, 1], "1.8 a, 2.3 a^⅔")]
    return Panel("run-out", "a = H/L_0", "(L − L_0)/L_0", [*laws, *curves])


def collapse(quick: bool) -> Outcome:
    cells = 20 if quick else 40
    ratios = (1.0, 2.0) if quick else (0.5, 1.0, 2.0, 4.0)
    checks: list[Check] = []
    panels: list[Panel] = []
    run_outs = []
    reason = (
        "no single angle of friction serves all ratios: low columns stop early and tall ones run far, because the "
        "skeleton's friction does not grow with the rate of shearing"
    )
    for ratio in ratios:
        found = collapsed(ratio, cells, SAND, math.tan(math.radians(REPOSE)))
        run_outs.append(found.run_out)
        checks += _of_column(ratio, found, reason)
        low, high = run_out_band(ratio)
        band = [
            Curve([low, low], [0.0, 0.15], "band of the experiments", "k--"),
            Curve([high, high], [0.0, 0.15], "", "k--"),
        ]
        profiles = [*found.profiles, *band]
        panels.append(Panel(f"a = {ratio:g}", "x / L_0", "depth / L_0", profiles, x_range=(-1.0, 1.3 * high)))
    return Outcome(checks=checks, panels=[*panels, _bands([Curve(ratios, run_outs, f"L_0/{cells}", "o")])])


RATE_SETS = {
    "beads of 1 mm": {"static_friction": 0.48, "dynamic_friction": 0.74, "grain_diameter_m": 1e-3},
    "fitted": {"static_friction": 0.20, "dynamic_friction": 1.0, "grain_diameter_m": 1e-2},
}
"""μ_s = tan 25.5°, μ_2 = tan 36.5°, I_0 = 0.279, used for collapses of beads by Ionescu et al. (2015), recalled; and a
set that was fitted to the bands here."""


def collapse_by_rate(quick: bool) -> Outcome:
    cells = 20
    ratios = (0.5, 1.0) if quick else (0.5, 1.0, 2.0, 4.0)
    reason = (
        "grains of a millimetre shear at an inertial number of some hundredths, at which friction has hardly grown; "
        "walls at the sides, which slow the experiments' columns, are not in the model"
    )
    rest = {name: value for name, value in SAND.items() if name != "friction_angle_deg"} | {"law": "mu_i"}
    checks: list[Check] = []
    curves = []
    for name, own in RATE_SETS.items():
        run_outs = []
        for ratio in ratios:
            # The ground holds the grains, so that the law's own friction acts on it.
            found = collapsed(ratio, cells, rest | own, 1.0)
            run_outs.append(found.run_out)
            checks += _of_column(ratio, found, reason, f"{name}, ")
        curves.append(Curve(ratios, run_outs, name, "o"))
    return Outcome(
        checks=checks,
        panels=[_bands(curves)],
        remarks=[
            "One set of parameters meets the bands of all four ratios, but it is not the material's: its static "
            "friction is that of a slope of 11°, its grains are a twentieth of the column's width, and its heaps are a "
            "third too low at the wall. With figures of real beads the low columns, which a single angle of friction "
            "stops early, come into the band, and the tallest one still runs 13 % too far. The two laws that bound the "
            "band were fitted to experiments that differ by half among themselves."
        ],
    )


def _edge(x: Array, depth: Array) -> float:
    """Farthest place at which the deposit is as deep as `EDGE`."""
    inside = int(np.flatnonzero(depth > EDGE * HALF_WIDTH)[-1])
    share = (depth[inside] - EDGE * HALF_WIDTH) / (depth[inside] - depth[inside + 1])
    return float(x[inside] + share * (x[inside + 1] - x[inside]))


# -- sand in a flume ---------------------------------------------------------------------------------------------

SLOPES = (45.0, 50.0, 55.0, 60.0, 65.0)
"""Of the flume [°]."""


def flume(quick: bool) -> Outcome:
    slopes = (45.0, 65.0) if quick else SLOPES
    spacing = 0.02 if quick else 0.0125
    checks: list[Check] = []
    curves, peak_curves = [], []
    for base, style in ((0.5, "-"), (math.tan(math.radians(41.0)), "--")):
        peaks = []
        for slope in slopes:
            time, force = _force_on_plate(slope, base, spacing)
            peaks.append(float(force.max()))
            curves.append(Curve(time, force, f"{slope:g}°, base friction {base:.2f}", style))
            checks.append(reported(f"{slope:g}°, base friction {base:.2f}: peak, mean over 0.05 s", "N", peaks[-1]))
        checks.append(
            holds(
                f"base friction {base:.2f}: the peak grows with the slope",
                "N",
                peaks[-1] - peaks[0],
                all(b > a for a, b in pairwise(peaks)),
                reference="> 0",
            )
        )
        peak_curves.append(Curve(slopes, peaks, f"ours, base friction {base:.2f}", "o" + style))
    return Outcome(
        checks=checks,
        panels=[
            Panel("force on the wall", "time [s]", "force [N]", curves),
            Panel("peak force", "slope [°]", "force [N]", peak_curves),
        ],
        remarks=[
            "Moriguchi, Borja, Yashima and Sawada (2009) measured such peaks. Their values cannot be had as numbers, "
            "only recalled, and neither can the friction of their base, the shape of their box or the friction of the "
            "side walls, which in a flume of 0.3 m bear a part of the load that a plane model gives to the plate. So "
            "nothing is compared. Two base frictions are run, 0.5 and as rough as the sand; the sand starts as a block "
            "of 50 kg, 0.5 m long. The case gates on the trend with slope alone."
        ],
    )


def _force_on_plate(slope: float, base: float, spacing: float) -> tuple[Array, Array]:
    """Times [s] and force on a plate 0.3 m wide [N], mean over 0.05 s."""
    length, width, density = 0.5, 0.3, 1379.0
    simulation = Simulation(
        scene(
            f"sand in a flume of {slope:g}°",
            box(-1.8 - length, -1.8, 50.0 / width / density / length),
            "dry",
            end_time=2.0,
            tilt=slope,
            ground=base,
            spacing_m=spacing,
            barrier=fixed({"kind": "wall"}),
            soil={
                "grain_density_kg_per_m3": 2650.0,
                "porosity": 1.0 - density / 2650.0,
                "young_modulus_Pa": 1e6,
                "poisson_ratio": 0.3,
                "friction_angle_deg": 41.0,
            },
            domain={"left_m": -2.6, "top_m": 1.0},
        )
    )
    series = sampled(simulation, np.linspace(0.0, 2.0, 201)[1:])
    return series["time"][2:-2], np.convolve(series["impact_force_x"], np.full(5, 0.2), "valid") * width


CASES = (
    Case(
        name="collapse",
        title="Collapse of a dry column",
        tests="A plane column of dry sand that comes to rest at 30° (sin φ' = tan 30°, base friction tan 30°) beside "
        "a smooth wall is let go; the deposit ends where it is thinner than 3 % of L_0.",
        source="run-out laws fitted to experiments: Lube et al. (2005) and Lajeunesse et al. (2005), as quoted by "
        "Lagrée, Staron and Popinet (2011)",
        limit="between the two laws, a = 0.5, 1, 2, 4; mass 1e-6",
        run=collapse,
    ),
    Case(
        name="collapse-by-rate",
        title="Collapse of a dry column, μ(I)",
        tests="The same with friction that grows with the inertial number, with figures of glass beads of 1 mm and "
        "with one set that was fitted to the bands; the ground holds the grains.",
        source="as above",
        limit="between the two laws, a = 0.5, 1, 2, 4; mass 1e-6",
        run=collapse_by_rate,
    ),
    Case(
        name="flume",
        title="Dry sand in a flume onto a wall",
        tests="50 kg of dry sand slide 1.8 m down a flume of 45° to 65° onto a force plate.",
        source="the trend alone: peaks that grow with the slope, as Moriguchi, Borja, Yashima and Sawada (2009) found",
        limit="the peak grows with the slope",
        run=flume,
    ),
)
