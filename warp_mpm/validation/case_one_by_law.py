"""Case 1 by each law of the flow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analytic.force_record import moving_mean
from warp_mpm.effect_rules import with_law
from warp_mpm.plotting.style import BLUE, grid
from warp_mpm.results import Results
from warp_mpm.run import run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import (
    Case,
    Curve,
    Outcome,
    Panel,
    Table,
    reported,
)
from warp_mpm.validation.paper_runs import paper_scene

VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "mohr_coulomb, φ' = 20°": ("case_1", {}),
    "the same, liquefied at the start": ("case_1", {"flow.initial_pore_pressure_ratio": 1.0}),
    "the same, liquefied at the front": (
        "case_1",
        {"flow.initial_pore_pressure_ratios": [[-15.0, 1.0 / 1.8], [-6.0, 1.0]]},  # hydrostatic behind
    ),
    "the same, from half the velocity at the bed": ("case_1", {"flow.base_velocity_share": 0.5}),
    "the same, inertial drag (Ergun)": ("case_1", {"flow.material.inertial_drag_coefficient": 0.404}),
    "the same, loose: solid fraction 0.50 of 0.56": ("case_1_loose", {}),
    "the same, dense: 0.50 of 0.44": (
        "case_1_loose",
        {"flow.material.dilatancy.critical_solid_fraction": 0.44},
    ),
    "coulomb_viscous, 20°, 200 Pa s": ("case_1", {"law": "coulomb_viscous", "mixture_viscosity_Pa_s": 200.0}),
    "coulomb_viscous, 20°, 2000 Pa s": ("case_1", {"law": "coulomb_viscous", "mixture_viscosity_Pa_s": 2000.0}),
    "mu_i, 0.38 to 0.64, 10 mm": ("case_1_mu_i", {}),
    "mohr_coulomb, undrained": ("case_1_undrained", {}),
    "herschel_bulkley, 500 Pa, 20 Pa s": ("case_1_mud", {}),
    "herschel_bulkley, 5 kPa, 500 Pa s": (
        "case_1_mud",
        {"flow.material.yield_stress_Pa": 5e3, "flow.material.consistency_Pa_s": 500.0},
    ),
}
"""Case 1 by each law: name, shipped scene and what is changed in it."""

ONE_EACH = ("coulomb_viscous, 20°, 200 Pa s", "mu_i, 0.38 to 0.64, 10 mm", "herschel_bulkley, 500 Pa, 20 Pa s")
"""One of `VARIANTS` for each law of the rate."""


def variant(name: str, spacing: float) -> Scenario:
    """One of `VARIANTS` at a spacing [m]."""
    file, changes = VARIANTS[name]
    base = paper_scene(file, spacing)
    if "law" in changes:
        own = {field: value for field, value in changes.items() if field != "law"}
        angle = base.resolved()["flow"]["material"]["friction_angle_deg"]
        return base.replaced(with_law(base, changes["law"], friction_angle_deg=angle, **own))
    return base.replaced(changes)


def laws(quick: bool) -> Outcome:
    # Quick, to see that the laws of the rate run, each once; no figure of it has a limit.
    spacing, names = (1.0, ONE_EACH) if quick else (0.2, tuple(VARIANTS))
    rows, forces, slides = [], [], []
    figures: dict[str, list[float]] = {
        "peak force, mean over 0.05 s [kN/m]": [],
        "sliding distance [m]": [],
        "run-up [m]": [],
        "overtopped [% of the flow]": [],
    }
    with TemporaryDirectory(prefix="warp-mpm-laws-") as folder:
        for number, name in enumerate(names):
            out = Path(folder) / str(number)
            run_scenario(variant(name, spacing), out, make_simulation=Simulation, pictures=False)
            results = Results.open(out)
            summary, series = results.summary, results.time_series
            measures = summary["mechanism_measures"]
            found = (
                1e-3 * summary["peak_force_filtered"],
                summary["barrier_displacement_final"],
                measures["run_up"],
                100.0 * measures["overtopped_share"],
            )
            time = series["time"]
            forces.append(Curve(time, 1e-3 * moving_mean(time, series["impact_force_x"], 0.05), name))
            slides.append(Curve(time, series["barrier_displacement"], name))
            results.snapshots.close()
            for values, value in zip(figures.values(), found, strict=True):
                values.append(float(value))
            rows.append((name, *(f"{value:.3g}" for value in found), str(summary["mechanism"])))
    checks = [
        reported(f"{figure}: greatest over least of all laws", "-", max(values) / min(values))
        for figure, values in figures.items()
    ]
    return Outcome(
        checks=checks,
        panels=[
            Panel("force on the face", "time [s]", "force [kN/m]", forces),
            Panel("sliding", "time [s]", "displacement [m]", slides),
        ],
        pictures={"figures": _bars(names, figures)},
        tables=[Table(f"case 1 by each law, {spacing:g} m", ("law", *figures, "mechanism"), rows)],
    )


def _bars(names: Sequence[str], figures: Mapping[str, Sequence[float]]) -> Figure:
    """Key figures side by side."""
    picture = Figure(figsize=(10.0, 6.0), layout="constrained")
    for panel, (title, values) in zip(picture.subplots(2, 2, sharey=True).flat, figures.items(), strict=True):
        place = np.arange(len(values))
        panel.barh(place, values, color=BLUE)
        panel.bar_label(panel.containers[0], fmt="%.3g", fontsize=8, padding=2)
        panel.set_yticks(place, names, fontsize=8)
        panel.set_xlim(0.0, 1.15 * max(values))
        panel.set_ylim(len(values) - 0.5, -0.5)
        panel.set_title(title, fontsize=10)
        grid(panel)
        panel.set_axisbelow(True)
    return picture


CASES = (
    Case(
        name="laws",
        title="Case 1 by each law",
        tests="The paper's case 1 with other laws of the flow: how much does the law matter?",
        source="none: reported",
        limit="reported",
        run=laws,
        in_quick=False,
    ),
)
