"""Bands from field, centrifuge and guidelines behind our runs: context, no validation."""

from __future__ import annotations

import math

import numpy as np

from analytic.empirical import MODELS
from analytic.force_record import moving_mean
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Band, Check, Curve, Outcome, Panel, Table, reported
from warp_mpm.validation.measured.given import Given
from warp_mpm.validation.paper_runs import force_history, paper_scene

PLATE = 0.4, 0.8
"""C of p = C ρ v² on a small plate that the flow passes: Bugnion et al. (2012), Veltheim, 15 releases of 50 m³, speeds
of 2 to 13 m/s, depths of 0.3 to 1 m; of the abstract."""

PLATE_FROUDE = 2.0 / math.sqrt(9.81 * 1.0), 13.0 / math.sqrt(9.81 * 0.3)

SALERNO = 0.0, 0.18
"""Sliding [m] of barriers in a centrifuge, in the prototype's scale: University of Salerno, of an abstract."""

CONDUCTIVITIES = (9.81e-4, 3.1e-3, 9.81e-3)
"""The range that was back-analysed for those flows, with its middle [m/s]."""

GUIDELINES = {
    "Hong Kong (GEO), rigid barriers": 2.5,
    "Switzerland (SIA), muddy": 2.0,
    "Switzerland (SIA), granular": 4.0,
    "China (DZ/T 0239), rectangular": 1.33,
}
"""Factors of p = C ρ v², recalled, not read in the guidelines."""

FIXED = {
    "set_i_fixed": 0.4,
    "set_iia_fixed": 0.4,
    "set_iib_fixed": 0.4,
    "set_iii_fixed": 0.4,
    "set_iv_fixed": 0.4,
    "set_v_fixed": 0.4,
    "case_1_fixed": 0.4,
    "case_5": 0.4,
    "case_6": 0.2,
}
"""Scenes, and spacings [m]."""


def _coefficient(name: str, spacing: float) -> tuple[float, float]:
    """Froude number and F_peak/(ρ h v²) of a scene until 2 s, mean over 0.05 s."""
    scenario = paper_scene(name, spacing, output__end_time_s=2.0)
    series, _ = force_history(scenario, 0.005)
    flow = scenario.flow
    peak = float(moving_mean(series["time"], series["impact_force_x"], 0.05).max())
    return flow.speed / math.sqrt(9.81 * flow.depth), peak / (flow.material.density * flow.depth * flow.speed**2)


def _slid(conductivity: float, end: float) -> tuple[float, float]:
    """How far the barrier of case 1 slides until `end` [s], and the greatest share of the flow's energy that it has."""
    scenario = paper_scene(
        "case_1", 0.4, flow__material__hydraulic_conductivity_m_per_s=conductivity, output__end_time_s=end
    )
    series, simulation = force_history(scenario, 0.01)
    assert isinstance(simulation, Simulation)
    share = series["barrier_kinetic_energy"].max() / series["flow_kinetic_energy"][0]
    return float(series["barrier_displacement"][-1]), float(share)


def field_bounds(given: Given) -> Outcome:
    """None. These bands are of other barriers in other flows, known from abstracts, and of guidelines that are
    recalled: what lies inside proves nothing, what lies outside refutes nothing. They show in what company our numbers
    are.
    """
    scenes = {"case_1_fixed": 0.5, "case_6": 0.25} if given.quick else FIXED
    found = {name: _coefficient(name, spacing / given.finer) for name, spacing in scenes.items()}
    end = 1.0 if given.quick else 3.0
    slid = [_slid(conductivity, end) for conductivity in CONDUCTIVITIES]
    checks: list[Check] = [
        reported(f"{name}: F_peak/(ρ h v²) at Fr = {froude:.2f}", "-", value) for name, (froude, value) in found.items()
    ]
    checks += [
        reported(f"case 1 at k = {conductivity:g} m/s: sliding until {end:g} s", "m", way)
        for conductivity, (way, _) in zip(CONDUCTIVITIES, slid, strict=True)
    ]
    rows = [
        (f"{conductivity:g}", f"{way:.3f}", f"{100.0 * share:.2f} %")
        for conductivity, (way, share) in zip(CONDUCTIVITIES, slid, strict=True)
    ]
    return Outcome(
        checks=checks,
        panels=[_coefficients(found), _sliding(np.array([way for way, _ in slid]), end)],
        tables=[
            Table(
                f"Case 1 by conductivity, until {end:g} s",
                ("k [m/s]", "sliding [m]", "greatest energy of the barrier, of the flow's at the start"),
                rows,
            )
        ],
        remarks=[
            "Bugnion's plate is small and passed by the flow, which therefore does not stop before it; our barriers "
            "are as wide as the flow. A factor above his band is what a barrier that turns the whole flow is expected "
            "to have: momentum alone asks for 1 − cos β of the face's angle β, 0.5 at 60° and 1 at 90°. Guidelines' "
            "factors hold for a pressure on the flow's depth, with a margin for what is not known.",
            "The centrifuge's flows and barriers are not those of case 1: of the band its order of size is shown, and "
            "of the trend its sign. The source says that a lower conductivity sends more energy to the barrier. Ours "
            "goes the other way: from 1e-3 to 1e-2 m/s case 1 slides a fifth farther, and its barrier takes up 0.7 to "
            "1 % of the energy. Its flow starts formed, three metres before the barrier, so that it has no way on "
            "which conductivity could brake it.",
        ],
    )


def _coefficients(found: dict[str, tuple[float, float]]) -> Panel:
    froude = np.linspace(0.6, 7.6, 100)
    curves = []
    for name in ("closed_form", "armanini_2011", "huebl_holzinger_2003", "cui_2015"):
        # With ρ v² = 1 and h = v²/(g Fr²) a formula's pressure is its factor.
        factor = MODELS[name].pressure(np.ones(100), np.ones(100), 1.0 / (9.81 * froude**2))
        curves.append(Curve(froude, np.clip(factor, None, 6.0), MODELS[name].title))
    for name, factor_ in GUIDELINES.items():
        curves.append(Curve([0.6, 7.6], [factor_, factor_], name, ":"))
    values = np.array(list(found.values()))
    curves.append(Curve(values[:, 0], values[:, 1], "ours, fixed barriers", "ko"))
    return Panel(
        "greatest pressure over ρ v²",
        "Froude number",
        "C",
        curves,
        bands=[Band(PLATE_FROUDE, [PLATE[0]] * 2, [PLATE[1]] * 2, "small plate, Bugnion et al. (2012)")],
    )


def _sliding(way: Array, end: float) -> Panel:
    return Panel(
        f"sliding of case 1 until {end:g} s",
        "conductivity [m/s]",
        "m",
        [Curve(CONDUCTIVITIES, way, "ours, case 1", "ko-")],
        log_x=True,
        bands=[
            Band([CONDUCTIVITIES[0], CONDUCTIVITIES[-1]], [SALERNO[0]] * 2, [SALERNO[1]] * 2, "centrifuge, Salerno")
        ],
    )
