"""A jet of perfect fluid on a deflector, without gravity: forces from the momentum alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, compared, holds, reference
from warp_mpm.validation.scenes import INVISCID, fixed, sampled, scene

DEPTH, SPEED, LENGTH = 1.0, 10.0, 16.0
"""Jet [m, m/s, m]."""

PLATEAU = 6.0, 12.0
"""Time v t / h from which on the flow in the corner is steady, and until which the jet's tail has no effect."""


def jet_forces(angle: float, spacing: float, **numerics: Any) -> tuple[Array, Array, Array]:
    """Time v t / h, horizontal force on the deflector and vertical force on it and the ground, over ρ h v²."""
    shape = {"kind": "trapezoid", "height_m": 8.0, "crest_width_m": 1.0, "face_angle_deg": angle}
    front = [[-LENGTH, 0.0], [-0.5, 0.0], [-0.5 - DEPTH, DEPTH], [-LENGTH, DEPTH]]
    simulation = Simulation(
        scene(
            f"jet on a deflector of {angle:g}°",
            front,
            "undrained",
            end_time=1.3 * DEPTH / SPEED * 10.0,
            velocity=(SPEED, 0.0),
            gravity=0.0,
            stress="zero",
            soil=INVISCID,
            barrier=fixed({"kind": "wall"} if angle == 90.0 else shape),
            spacing_m=spacing,
            **numerics,
            domain={"top_m": 16.0},
        )
    )
    series = sampled(simulation, np.linspace(0.0, 1.3, 131)[1:])
    unit = simulation.scenario.flow.material.density * DEPTH * SPEED**2
    return (
        series["time"] * SPEED / DEPTH,
        series["impact_force_x"] / unit,
        -(series["impact_force_y"] + series["ground_force_y"]) / unit,
    )


def jets(quick: bool) -> Outcome:
    angles = (60.0, 90.0) if quick else (60.0, 72.0, 80.0, 90.0)
    spacings = (0.25, 0.125) if quick else (0.2, 0.1, 0.05)
    crowded = (
        "points crowd in the corner, and the layer of cells along the face leaves more slowly than the jet; the "
        "density correction undoes most of it, not all"
    )
    checks: list[Check] = []
    panels: list[Panel] = []
    for angle in angles:
        turn = math.radians(angle)
        exact = {"F_x": 1.0 - math.cos(turn), "F_y": math.sin(turn)}
        errors: dict[str, list[float]] = {name: [] for name in exact}
        noise: dict[str, float] = {}
        curves = []
        for spacing, style in zip(spacings, (":", "--", "-")[-len(spacings) :], strict=True):
            time, *forces = jet_forces(angle, spacing)
            steady = (time > PLATEAU[0]) & (time <= PLATEAU[1])
            for name, force in zip(exact, forces, strict=True):
                mean = float(force[steady].mean())
                errors[name].append(abs(mean / exact[name] - 1.0))
                noise[name] = _standard_error(force[steady]) / exact[name]
                if spacing == spacings[-1]:
                    what = "horizontal, on the deflector" if name == "F_x" else "vertical, deflector and ground"
                    checks.append(compared(f"{angle:g}°: {what}", "ρ h v²", mean, exact[name], 0.05, remark=crowded))
            curves += [
                Curve(time, forces[0], f"F_x, h/{DEPTH / spacing:g}", "b" + style),
                Curve(time, forces[1], f"F_y, h/{DEPTH / spacing:g}", "r" + style),
            ]
        for name, values in errors.items():
            checks.append(
                holds(
                    f"{angle:g}°: error of {name} falls with the spacing, or cannot be told from none",
                    "-",
                    values[-1],
                    values[-1] < max(values[0], 0.01, 2.0 * noise[name]),
                    remark=crowded,
                    reference=" → ".join(f"{100 * value:.2g} %" for value in values)
                    + f", mean known to {100 * noise[name]:.2g} %",
                )
            )
        flat = np.array(PLATEAU)
        panels.append(
            Panel(
                f"deflector of {angle:g}°",
                "v t / h",
                "force / (ρ h v²)",
                [
                    reference(flat, [exact["F_x"]] * 2, "1 − cos θ, sin θ"),
                    reference(flat, [exact["F_y"]] * 2, ""),
                    *curves,
                ],
            )
        )
    return Outcome(checks=checks, panels=panels)


def _standard_error(force: Array) -> float:
    """Of the mean of a plateau that flutters, from the means of its quarters, which are far enough apart."""
    return float(np.std([part.mean() for part in np.array_split(force, 4)], ddof=1) / 2.0)


CASES = (
    Case(
        name="jet",
        title="Jet on a deflector",
        tests="A jet of perfect fluid (undrained, φ = 0, no gravity) runs along smooth ground onto smooth faces of "
        "60°, 72°, 80° and 90°; means over the steady plateau, 6 < v t/h < 12.",
        source="momentum: F_x = ρ h v² (1 − cos θ) on the deflector, F_y = ρ h v² sin θ on deflector "
        "and ground together",
        limit="5 % of the plateau, the error falling with the spacing",
        run=jets,
    ),
)
