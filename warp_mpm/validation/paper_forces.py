"""The force of the paper's case 1, by the length of its moving mean and by the mesh: ours, and the paper's own code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.calibration import window_of
from analytic.force_record import cumulative_impulse, moving_mean
from analytic.scene import Scene, read_scene
from warp_mpm.accuracy.errors import extrapolate
from warp_mpm.shipped import SCENARIOS
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, Table, compared, reference, reported
from warp_mpm.validation.paper_runs import TITLES, force_history, paper_scene

GEOMETRY_CHANGE = {"case_1_fixed": 0.72, "case_1": 0.41}
"""λ calibrated by the paper from its simulations, §3.2."""

WINDOWS = (0.001, 0.005, 0.02, 0.05, 0.1)
"""Lengths of the moving mean of the force [s]."""

END = 1.3
"""Of the runs [s]; the paper's code was run until 1.05 to 1.3 s."""

SUSTAINED = 0.5, 1.0
"""Time over which the sustained force is a mean [s]."""


@dataclass(frozen=True)
class OfTheirCode:
    """A run of case 1, fixed, with the paper's code, made for this project: the public Linux fork of Anura3D, triangles
    of three nodes fitted to flow and barrier, three points in each, Courant number 0.98; forces in kN/m."""

    contact: str
    size: float
    """Side of the triangles [m]."""
    peaks: tuple[float, float, float, float, float]
    """Greatest moving mean over each of `WINDOWS`."""
    sustained: float
    pressures: tuple[float, float, float] | None = None
    """Greatest pore pressure at 1 s [kPa]: of a point, of 99 % of the points, of the means of half-metre cells."""


FIXITIES, CONTACT = "velocity held at the face's nodes", "contact at the face's nodes"

THEIRS = (
    OfTheirCode(FIXITIES, 1.0, (650, 646, 597, 436, 425), 376, (153, 153, 153)),
    OfTheirCode(FIXITIES, 0.5, (612, 596, 490, 432, 405), 381, (215, 143, 179)),
    OfTheirCode(CONTACT, 1.0, (852, 764, 713, 560, 513), 448, (80, 80, 73)),
    OfTheirCode(CONTACT, 0.5, (740, 706, 562, 501, 476), 435, (241, 184, 186)),
    OfTheirCode(CONTACT, 0.25, (734, 710, 579, 477, 441), 404, (703, 430, 333)),
)
"""The liquid bears no tension in these; where it may, the peaks over 50 ms are 22 to 25 kN/m higher, without smoothing
of strains (1.0 m) 48 lower, with Courant number and contact varied within 13."""


@dataclass(frozen=True)
class Peaks:
    """What one of our runs says; SI units."""

    peaks: Array
    """Greatest moving mean over each of `WINDOWS`."""
    times: Array
    """When it is there, since the arrival."""
    sustained: float
    patch: float
    """Greatest mean of the pore pressure over 0.5 m of the face and 20 ms, at 1 s."""
    series: Mapping[str, Array]


def peaks_of(name: str, spacing: float) -> Peaks:
    """One of the paper's scenes at a spacing, until `END`, recorded every millisecond."""
    series, _ = force_history(paper_scene(name, spacing, output__end_time_s=END), 0.001)
    time, force = series["time"], series["impact_force_x"]
    arrival = float(time[np.argmax(force > 0.01 * force.max())])
    means = [moving_mean(time, force, window) for window in WINDOWS]
    impulse = cumulative_impulse(time, force)
    begin, end = np.interp(SUSTAINED, time, impulse)
    return Peaks(
        np.array([mean.max() for mean in means]),
        np.array([time[np.argmax(mean)] for mean in means]) - arrival,
        float(end - begin) / (SUSTAINED[1] - SUSTAINED[0]),
        float(np.interp(1.0, time, series["pore_pressure_patch"])),
        series,
    )


def _scene(name: str) -> Scene:
    return read_scene(SCENARIOS / f"{name}.json")


def force_of(name: str, geometry_change: float) -> float:
    """Peak force [N/m] that belongs to a λ, F = ¾ μ v²/(λ L) by Eqs. (5) and (7), and λ to a force the same way."""
    return _scene(name).impact(geometry_change=geometry_change, rise_ratio=0.3).peak_force


def forces(quick: bool) -> Outcome:
    spacings = (1.0, 0.5) if quick else (0.4, 0.2, 0.1)
    checks: list[Check] = []
    tables: list[Table] = []
    found = {name: [peaks_of(name, spacing) for spacing in spacings] for name in GEOMETRY_CHANGE}
    fixed = found["case_1_fixed"]
    theirs = THEIRS[-1]
    checks.append(
        compared(
            f"sustained force, fixed, mean from 0.5 to 1 s, {spacings[-1]:g} m; theirs: contact, {theirs.size:g} m",
            "kN/m",
            fixed[-1].sustained / 1e3,
            theirs.sustained,
            0.05,
        )
    )
    for name, paper in GEOMETRY_CHANGE.items():
        rows, new = _constants(name, spacings, found[name], paper)
        checks += new
        tables.append(rows)
    tables += [_forces_table(spacings, fixed), _pressures_table(spacings, fixed), *([] if quick else [_influences()])]
    return Outcome(checks=checks, panels=_panels(spacings, fixed), tables=tables, remarks=REMARKS)


REMARKS = (
    "The paper's λ = 0.72 belongs to a peak of 562 kN/m. Case 1 with the barrier fixed was run with the paper's own "
    "code, so that the two can be told apart. The sustained force agrees: the mean from 0.5 to 1 s is 404 kN/m with "
    "their contact at 0.25 m and falls with the size of their triangles; ours is 413 at 0.1 m, 2 % from it. 562 kN/m "
    "is nowhere a sustained force. It is the oscillation about that level of coarse triangles with contact at their "
    "nodes, read over a short window: 560 over 50 ms at 1.0 m, 562 over 20 ms at 0.5 m, 579 over 20 ms at 0.25 m, all "
    "about t = 0.97 s. Over 50 ms it falls with refinement: 560, 501, 477. With the face's nodes held instead of "
    "contact it is 436 and 432, near ours. So λ = 0.72 is explained as the reading of a short peak on a coarse mesh, "
    "as far as it can be without the paper's curve; the triangles alone, friction or the filter do not make it.",
    "These are facts for comparison: one mesh to a size, a Linux fork of the code, and neither the sliding case nor "
    "the paper's own contact with a barrier of material were run. Sizes are not comparable one to one: a triangle of "
    "0.5 m carries three points, a cell of ours of 0.2 m four.",
    "The greatest pore pressure of a point is no figure to calibrate on: with their contact it is 80, 241 and 703 kPa "
    "at 1.0, 0.5 and 0.25 m. Means over half a metre scatter less and are what is compared; theirs have not "
    "converged. Ours are of the face, theirs of anywhere in the flow. Over windows shorter than 50 ms the time of the "
    "peak is that of one of many ripples on a plateau, so that τ is not known.",
)


def _constants(name: str, spacings: tuple[float, ...], runs: list[Peaks], paper: float) -> tuple[Table, list[Check]]:
    """λ and τ of a scene by window, with what the spacings leave open."""
    scene = _scene(name)
    unit = force_of(name, 1.0)
    rows, checks = [], []
    for k, window in enumerate(WINDOWS):
        lambdas = [unit / float(run.peaks[k]) for run in runs]
        taus = [
            float(run.times[k]) / (8.0 / 3.0 * value * scene.flow_length / scene.speed)
            for run, value in zip(runs, lambdas, strict=True)
        ]
        rows.append((f"{1e3 * window:g} ms", _between(spacings, lambdas), _between(spacings, taus)))
        if window == 0.05:
            needed = window_of(paper, runs[-1].series["time"], runs[-1].series["impact_force_x"], scene)
            checks += [
                reported(
                    f"λ, {TITLES[name]}, from the peak, mean over 0.05 s",
                    "-",
                    lambdas[-1],
                    reference=paper,
                    remark=f"{TITLES[name]}, {spacings[-1]:g} m: the paper's {needed.words}",
                ),
                reported(f"τ = T_1/T_2, {TITLES[name]}", "-", taus[-1], remark="the paper gives no value"),
            ]
    return Table(f"λ and τ of {TITLES[name]} by the moving mean's length", ("", "λ", "τ"), rows), checks


def _between(spacings: tuple[float, ...], values: list[float]) -> str:
    if len(values) < 3:
        return f"{values[-1]:.2f} ± {max(np.ptp(values), 0.01):.2f}"
    leads = extrapolate(spacings, values)
    return f"{leads.value:.2f} ± {max(leads.uncertainty, 0.01):.2f}"


def _forces_table(spacings: tuple[float, ...], runs: list[Peaks]) -> Table:
    rows = [
        (f"paper's code, {one.contact}, {one.size:g} m", *(f"{peak:.0f}" for peak in one.peaks), f"{one.sustained:.0f}")
        for one in THEIRS
    ]
    rows += [
        (f"ours, {spacing:g} m", *(f"{peak / 1e3:.0f}" for peak in run.peaks), f"{run.sustained / 1e3:.0f}")
        for spacing, run in zip(spacings, runs, strict=True)
    ]
    columns = ("", *(f"{1e3 * window:g} ms" for window in WINDOWS), "mean 0.5–1 s")
    return Table("Case 1, fixed: greatest moving mean of F_2,x [kN/m] by its length", columns, rows)


def _pressures_table(spacings: tuple[float, ...], runs: list[Peaks]) -> Table:
    rows = [
        (f"paper's code, {one.contact}, {one.size:g} m", *(f"{value:.0f}" for value in one.pressures))
        for one in THEIRS
        if one.pressures is not None
    ]
    rows += [
        (f"ours, {spacing:g} m", "", "", f"{run.patch / 1e3:.0f}") for spacing, run in zip(spacings, runs, strict=True)
    ]
    columns = ("", "point", "99 % of the points", "mean: theirs over half-metre cells, ours over 0.5 m and 20 ms")
    return Table("Case 1, fixed: greatest pore pressure at 1 s [kPa]", columns, rows)


def _panels(spacings: tuple[float, ...], runs: list[Peaks]) -> list[Panel]:
    windows = 1e3 * np.array(WINDOWS)
    needed = reference([windows[0], windows[-1]], [562.0, 562.0], "belongs to the paper's λ = 0.72")
    by_window = [needed]
    by_size = [reference([0.08, 1.1], [562.0, 562.0], "belongs to the paper's λ = 0.72")]
    for contact, colour, words in (
        (CONTACT, "r", "paper's code, contact"),
        (FIXITIES, "k", "paper's code, held nodes"),
    ):
        own = [one for one in THEIRS if one.contact == contact]
        for one, style in zip(own, ("-", "--", ":"), strict=False):
            by_window.append(Curve(windows, one.peaks, f"{words}, {one.size:g} m", f"{colour}{style}"))
        sizes = [one.size for one in own]
        by_size.append(Curve(sizes, [one.peaks[3] for one in own], f"{words}, 50 ms", f"{colour}o-"))
        by_size.append(Curve(sizes, [one.sustained for one in own], f"{words}, 0.5–1 s", f"{colour}s:"))
    for spacing, run, style in zip(spacings, runs, ("-", "--", ":"), strict=False):
        by_window.append(Curve(windows, run.peaks / 1e3, f"ours, {spacing:g} m", f"b{style}"))
    by_size.append(Curve(spacings, [run.peaks[3] / 1e3 for run in runs], "ours, 50 ms", "bo-"))
    by_size.append(Curve(spacings, [run.sustained / 1e3 for run in runs], "ours, 0.5–1 s", "bs:"))
    return [
        Panel("greatest moving mean of F_2,x", "length of the mean [ms]", "kN/m", by_window, log_x=True),
        Panel("against the mesh", "size of triangles or cells [m]", "kN/m", by_size, log_x=True),
    ]


INFLUENCES: Mapping[str, dict[str, Any]] = {
    "as shipped": {},
    "no friction on the barrier": {"barrier__friction": 0.0},
    "face as rough as the flow, tan δ = tan φ'": {"barrier__friction": 0.364},
    "FLIP transfer (Sulsky), as in the paper": {"numerics__transfer": "flip"},
    "no volumetric smoothing": {"numerics__volumetric_smoothing": False},
    "no pressure filter": {"numerics__pressure_relaxation": 0.0},
    "no bulk viscosity": {"numerics__bulk_viscosity": 0.0},
    "9 points per cell": {"numerics__points_per_cell": 9},
    "liquid as stiff as real water, K_L = 2.2 GPa": {"flow__material__liquid_bulk_modulus_Pa": 2.2e9},
    "elastic flow": {"law": "elastic"},
}
"""What is changed in case 1, sliding and fixed, to see what moves the peak."""


def _influences() -> Table:
    spacing = 0.2
    rows = []
    for label, changes in INFLUENCES.items():
        cells = [label]
        for name in GEOMETRY_CHANGE:
            series, _ = force_history(paper_scene(name, spacing, output__end_time_s=1.2, **changes), 0.005)
            force = float(moving_mean(series["time"], series["impact_force_x"], 0.05).max())
            cells += [f"{force / 1e3:.0f}", f"{force_of(name, 1.0) / force:.2f}"]
        rows.append(cells)
    last = ["the paper's λ and the force that belongs to it"]
    for name, value in GEOMETRY_CHANGE.items():
        last += [f"{force_of(name, value) / 1e3:.0f}", f"{value:g}"]
    return Table(
        f"What moves the peak (mean over 0.05 s, {spacing:g} m): force [kN/m] and the λ that follows",
        ("", "fixed", "λ", "sliding", "λ"),
        [*rows, last],
    )


CASES = (
    Case(
        name="paper-forces",
        title="The paper's force, and its own code",
        tests="Case 1 with the barrier fixed by two codes, ours and the paper's: the greatest moving mean of the "
        "force by its length and by the mesh, the sustained force, λ and τ with their uncertainty, and the pore "
        "pressure as means over patches.",
        source="runs of case 1 with a public fork of Anura3D, made for this project; the paper's λ, §3.2",
        limit="sustained force within 5 %; λ and τ reported",
        run=forces,
        in_quick=False,
    ),
)
