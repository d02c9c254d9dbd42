"""What must not depend on the numerics in the paper's case 1: friction on the face, and the figures by time step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.scenario.barrier import Trapezoid
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, Table, compared
from warp_mpm.validation.paper_runs import paper_scene

# -- friction on the face ----------------------------------------------------------------------------------------

STEADY = 0.6, 1.2
"""Time in which the flow runs up the face and slips on all of it [s]."""

LAYERS = 4
"""Layers of one cell beside the face in which the material's stresses are looked at."""


def friction_on_the_face(spacing: float) -> tuple[float, Array]:
    """Of the fixed barrier of case 1, means over `STEADY`: T / (N tan δ) of the forces on its face, and the share
    σ'_n / (σ'_n + p_L) that the skeleton carries of the normal stress in the material beside it [LAYERS].

    Half a metre at toe and crest is left out of the share.
    """
    scenario = paper_scene("case_1_fixed", spacing)
    assert scenario.barrier is not None
    assert isinstance(scenario.barrier.shape, Trapezoid)
    base, crest, height = scenario.barrier.shape.base_crest_height
    along = np.array([0.5 * (base - crest), height])
    length = float(np.hypot(*along))
    along /= length
    normal = np.array([-along[1], along[0]])
    tangent = scenario.barrier.friction.face

    simulation = Simulation(scenario)
    simulation.advance(STEADY[0])
    simulation.sample()
    force = np.zeros(2)
    effective, pore = np.zeros(LAYERS), np.zeros(LAYERS)
    for time in np.linspace(*STEADY, 121)[1:]:
        simulation.advance(float(time))
        sample = simulation.sample()
        force += sample["impact_force_x"], sample["impact_force_y"]
        points = simulation.points()
        place = points["position"] @ np.stack([normal, along], axis=1)
        layer = np.floor(place[:, 0] / spacing).astype(np.int64)
        beside = (layer >= 0) & (layer < LAYERS) & (place[:, 1] > 0.5) & (place[:, 1] < length - 0.5)
        xx, yy, _, xy = points["effective_stress"].T
        stress = -(xx * normal[0] ** 2 + yy * normal[1] ** 2 + 2.0 * xy * normal[0] * normal[1])
        for sums, values in ((effective, stress), (pore, points["pore_pressure"])):
            sums += np.bincount(layer[beside], (points["volume"] * values)[beside], LAYERS)
    ratio = float((force @ along) / -(force @ normal)) / tangent
    return ratio, effective / (effective + pore)


def face_friction(quick: bool) -> Outcome:
    checks: list[Check] = []
    curves: list[Curve] = []
    finest: tuple[NDArray[Any], NDArray[Any]] | None = None
    for spacing in (0.4,) if quick else (0.1, 0.2, 0.4):
        ratio, shares = friction_on_the_face(spacing)
        place = (np.arange(LAYERS) + 0.5) * spacing
        checks.append(
            compared(
                f"{spacing:g} m: T/(N tan δ) on the face, over the material's share in the cell at the face",
                "-",
                ratio / shares[0],
                1.0,
                0.05,
            )
        )
        if finest is None:
            finest = place, shares
        else:
            for at, share in zip(place, shares, strict=True):
                if at <= finest[0][-1]:
                    checks.append(
                        compared(
                            f"the material's share {at:g} m from the face, with {spacing:g} m over 0.1 m",
                            "-",
                            share / float(np.interp(at, *finest)),
                            1.0,
                            0.05,
                            remark="what lies at the face was the front, whose skeleton is stressed least: the share "
                            "rises away from the face, in metres and not in cells",
                        )
                    )
        curves += [
            Curve(place, shares, f"in the material, {spacing:g} m", "o-"),
            Curve(np.zeros(1), np.array([ratio]), f"T/(N tan δ), {spacing:g} m", "x"),
        ]
    return Outcome(
        checks=checks,
        panels=[Panel("the skeleton's share of the normal stress", "from the face [m]", "σ'_n/(σ'_n + p_L)", curves)],
    )


# -- time step ---------------------------------------------------------------------------------------------------

FIGURES = {
    "displacement at the end": "m",
    "peak force, mean over 0.05 s": "kN/m",
    "impulse until 1.2 s": "kN s/m",
    "kinetic energy of the flow at 1.2 s": "kJ/m",
}
IMPACT = 1.2
"""At the latest, the force's peak is past [s]."""

MARK = 0.01
"""Times [s] at which every run keeps the impulse, so that all see the peak through the same windows."""

ENDS = {"case_1": ("case 1", 6.0), "set_iib": ("Set IIb", IMPACT)}
"""Title and end [s] of the scenes; the barrier of case 1 has stopped at its end."""


LONG_SLIDE = (
    "forces and impulse agree; the displacement at the end is the small difference of thrust and friction at the base "
    "over seconds, and still moves in the first order of the time step"
)


def figures(name: str, spacing: float, courant_number: float, interval: float, end: float) -> Array:
    """`FIGURES` of one of the paper's scenes, recorded every `interval` [s], which divides `MARK`, until `end` [s]."""
    scene = paper_scene(
        name,
        spacing,
        numerics__courant_number=courant_number,
        output__end_time_s=end,
        output__time_series_interval_s=interval,
    )
    simulation = Simulation(scene)
    force = []
    for record in range(1, round(IMPACT / interval) + 1):
        simulation.advance(record * interval)
        sample = simulation.sample()
        force.append(sample["impact_force_x"])
    energy = sample["flow_kinetic_energy"]
    for time in np.arange(round(IMPACT / interval) + 1, round(end / interval) + 1) * interval:
        simulation.advance(float(time))
    marks = np.array(force).reshape(-1, round(MARK / interval)).mean(axis=1)
    peak = np.convolve(marks, np.full(5, 0.2), "valid").max()
    moved = simulation.barrier_displacement or 0.0
    return np.array([moved, peak / 1e3, marks.sum() * MARK / 1e3, energy / 1e3])


def time_step(quick: bool) -> Outcome:
    spacing = 0.4 if quick else 0.2
    settings = (
        [(0.95, MARK), (0.95, 1e-3), (0.5, MARK)] if quick else [(0.95, MARK), (0.5, MARK), (0.95, 1e-4), (0.1, MARK)]
    )
    scenes = {"case_1": ENDS["case_1"]} if quick else ENDS
    checks: list[Check] = []
    tables: list[Table] = []
    for name, (title, end) in scenes.items():
        found = np.array([figures(name, spacing, *setting, end) for setting in settings])
        labels = [f"Courant number {number:g}, a record every {1e3 * interval:g} ms" for number, interval in settings]
        for label, ours in zip(labels[:-1], found, strict=False):
            for (figure, unit), value, finest in zip(FIGURES.items(), ours, found[-1], strict=True):
                checks.append(
                    compared(f"{title}: {figure}; {label}", unit, float(value), float(finest), 0.01, remark=LONG_SLIDE)
                )
        rows = [(label, *(f"{value:.5g}" for value in row)) for label, row in zip(labels, found, strict=True)]
        columns = ("", *(f"{figure} [{unit}]" for figure, unit in FIGURES.items()))
        tables.append(Table(f"{title} at {spacing:g} m, until {end:g} s", columns, rows))
    return Outcome(checks=checks, tables=tables)


CASES = (
    Case(
        name="face-friction",
        title="Friction on the face",
        tests="Case 1 with its barrier held, from 0.6 to 1.2 s: friction over normal force on the face, over what the "
        "skeleton carries of the normal stress in the cell beside it; and that this share is the same function of the "
        "distance from the face at all spacings.",
        source="Coulomb: T = tan δ times the effective normal force, so T/(N tan δ) = σ'_n/(σ'_n + p_L) of the "
        "material",
        limit="1 ± 0.05",
        run=face_friction,
    ),
    Case(
        name="time-step",
        title="Time step and record interval",
        tests="Case 1 at 0.2 m until its barrier has stopped, and Set IIb until 1.2 s, with a half and a tenth of the "
        "time step, and with records that cut the steps short; quick: case 1 at 0.4 m, with a half.",
        source="the run of the smallest Courant number",
        limit="displacement, peak, impulse and kinetic energy within 1 %",
        run=time_step,
    ),
)
