"""The verdict on a barrier: what the scenario's `design` group asks, answered with the loads of the run.

The barrier is a rigid block on its base. Forces of the flow are moving means over `FILTER_WINDOW`, times the load
factor. `docs/how_to/design_checks.md` has every formula with its source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.empirical import reflected_depth_ratio
from analytic.force_record import RESIDUAL_SHARE, cumulative_impulse, moving_mean
from warp_mpm import geometry
from warp_mpm.arrival_figures import came_beyond, departed_volume
from warp_mpm.quantities import Quantity
from warp_mpm.quantities.quantity import FORCE, VOLUME
from warp_mpm.quantities.time_series import OF_BARRIER, series_of_barrier
from warp_mpm.scenario import Barrier, Design, Fixed, OutlineShape, Scenario, Sliding, Trapezoid
from warp_mpm.scenario.site import all_standing

Array = NDArray[np.float64]
Series = Mapping[str, Array]


@dataclass(frozen=True)
class Check(Quantity):
    """A figure of the verdict, or a formula that is set beside the run."""

    formula: str = ""
    least: bool = False
    """Whether its limit is the least allowed; the greatest otherwise."""


CHECKS: Mapping[str, Check] = {
    check.name: check
    for check in (
        Check("displacement", "m", "sliding distance at the end of the run", formula="Δx"),
        Check(
            "sliding_factor", "-", "least factor of safety against sliding, over time", "sliding, factor of safety",
            formula="tan δ_b / γ_δ · N / H, N = W cos θ - γ_F V, H = γ_F F + W sin θ", least=True,
        ),
        Check(
            "overturning_factor", "-", "least factor of safety against overturning about the heel, over time",
            "overturning, factor of safety",
            formula="W cos θ · B/2 / (γ_F M_heel + W sin θ · y_c)", least=True,
        ),
        Check(
            "eccentricity_of_base", "-", "greatest eccentricity of the base's reaction, over the base width",
            "eccentricity over base width", formula="|e| / B, e = B/2 - (M_stabilising - M_overturning) / N",
        ),
        Check(
            "base_pressure", "Pa", "greatest pressure on the base, over time", "greatest base pressure",
            formula="N/B (1 + 6 e/B), outside the kern (e > B/6) 2 N / (3 (B/2 - e)); against R / γ_R",
        ),
        Check(
            "overtopped_share", "-", "share of the flow's volume beyond the crest at the end", "overtopped share",
            shown=("%", 100.0), formula="overtopped volume / volume of the flow",
        ),
        Check(
            "overtopped_volume", VOLUME, "volume beyond the crest at the end", "overtopped volume",
            formula="overtopped volume, with what left the domain downstream",
        ),
        Check("freeboard", "m", "height of the crest above the greatest run-up", "freeboard", formula="H - h_r",
              least=True),
    )
}  # fmt: skip
"""What is judged where the user gives a limit, by name."""

TOLD: Mapping[str, Check] = {
    check.name: check
    for check in (
        Check(
            "static_load", FORCE, f"horizontal force left over the last {RESIDUAL_SHARE:.0%} of the run",
            "static load that stays", formula="mean of F over the last tenth",
        ),
        Check(
            "static_load_height", "m", "height at which it acts", "  at a height of",
            formula="mean of F h_F over that of F",
        ),
        Check(
            "hydrostatic_load", FORCE, "hydrostatic thrust of a deposit of the height reached at the end",
            "  hydrostatic, of that height", formula="½ ρ g cos θ h_d²",
        ),
        Check(
            "energy_head", "m", "run-up of a flow that turns all its energy into height", "run-up bound, energy",
            formula="h + v² / (2 g)",
        ),
        Check(
            "reflected_depth", "m", "depth of the bore that a wall throws back", "run-up bound, reflected bore",
            formula="x h, (x - 1)² (x + 1) = 2 Fr² x",
        ),
        Check(
            "landing_distance", "m", "where a flow that leaves the crest level at its speed lands, from the crest",
            "landing of what overtops",
            formula="v²/(g cos θ) [tan θ + √(tan² θ + 2 g H_B / (v² cos θ))] + H_B tan θ",
        ),
        Check(
            "boulder_force", "N", "force of the boulder; not simulated, superposed on the flow's greatest loads",
            "boulder, superposed", shown=("kN", 1e-3), formula="K_c · 4000 v^1.2 r² kN (Hong Kong) [recalled: medium]",
        ),
    )
}  # fmt: skip
"""What is told beside, and judged by nobody."""

GUIDELINES: Mapping[str, Check] = {
    check.name: check
    for check in (
        Check("hong_kong", FORCE, "thrust on a rigid barrier", "Hong Kong (GEO), α = 2.5",
              formula="α ρ v² h [recalled: high]"),
        Check("switzerland_fine", FORCE, "thrust of a fine or muddy flow", "Switzerland (SIA 261/1), a = 2",
              formula="a ρ v² h [recalled: medium]"),
        Check("switzerland_granular", FORCE, "thrust of a granular flow", "Switzerland (SIA 261/1), a = 4",
              formula="a ρ v² h [recalled: medium]"),
        Check("japan", FORCE, "thrust of a direct hit", "Japan (2016), K_h = 1",
              formula="K_h ρ h v² [recalled: high]"),
        Check("china", FORCE, "thrust on a flat face", "China (DZ/T 0239), λ = 1.33",
              formula="λ ρ v² sin β h [recalled: medium]"),
    )
}  # fmt: skip
"""Thrusts by guidelines, for comparison with peak_force_filtered; only those that the scenario names."""


def verdict(scenario: Scenario, series: Series, figures: Mapping[str, Any]) -> dict[str, Any] | None:
    """What the run says to the scenario's `design`; None where it has none or no barrier.

    Args:
        scenario: what was run.
        series: columns of the time series.
        figures: key figures of the summary, so far.

    Returns:
        `holds` (None where nothing could be judged), `checks` (name, value, time, limit, holds, formula; all but the
        names and formulas None where they are not known), `told` and `guidelines` (name, value, formula), `remarks`,
        sentences, and of a scene with further barriers `barriers` (name, checks, told), which `holds` counts too.
    """
    design = scenario.design
    if design is None or scenario.barrier is None:
        return None
    limits: dict[str, float | None] = {
        "displacement": design.displacement_m,
        "sliding_factor": design.sliding_factor,
        "overturning_factor": design.overturning_factor,
        "eccentricity_of_base": design.eccentricity_of_base,
        "base_pressure": None if design.bearing_resistance_Pa is None
        else design.bearing_resistance_Pa / design.bearing_factor,
        "overtopped_share": design.overtopped_share,
        "overtopped_volume": design.overtopped_volume_m3_per_m,
        "freeboard": design.freeboard_m,
    }  # fmt: skip
    remarks: list[str] = []
    answers: list[bool | None] = []
    judged: dict[str, dict[str, Any]] = {}
    for one in _all(scenario, series, figures):
        checks = _checks(scenario, design, one, limits)
        answers += [check["holds"] for check in checks if check["limit"] is not None]
        told = [_said(TOLD[name], value) for name, value in _told(scenario, one).items()]
        for name, limit in limits.items():
            if limit is not None and all(check["name"] != name for check in checks):
                one.remarks.append(f"{CHECKS[name].words}: not known of this scene.")
                answers.append(None)
        remarks += one.remarks if one.name == BARRIER else [f"Barrier {one.name}: {said}" for said in one.remarks]
        judged[one.name] = {"checks": checks, "told": told}
    first = judged.pop(BARRIER)
    return {
        "holds": False if False in answers else None if None in answers or not answers else True,
        "checks": first["checks"],
        "told": first["told"],
        "guidelines": [_said(GUIDELINES[name], _guideline(scenario, name)) for name in design.guidelines],
        "remarks": remarks,
        **({"barriers": [{"name": name} | found for name, found in judged.items()]} if judged else {}),
    }


BARRIER = "barrier"
"""Name of the first barrier."""


@dataclass(frozen=True)
class _Judged:
    """A barrier that is judged."""

    name: str
    barrier: Barrier
    standing: Array | None
    """`standing_outline`."""
    series: Series
    """What acted on it and how it moved, by the names that the columns of the first barrier have."""
    figures: Mapping[str, Any]
    """Key figures of it, by the names that those of the first barrier have."""
    remarks: list[str] = field(default_factory=list)


def _all(scenario: Scenario, series: Series, figures: Mapping[str, Any]) -> list[_Judged]:
    """All barriers of a scene, the first one first."""
    rows = {row["name"]: row for row in figures.get("barriers", ())}
    found = []
    for name, _, barrier, standing in all_standing(scenario):
        own, known = series_of_barrier(series, name), figures
        if name != BARRIER:
            known = _further_figures(scenario, barrier, own, rows.get(name, {}), figures)
        found.append(_Judged(name, barrier, standing, own, known))
    return sorted(found, key=lambda one: one.name != BARRIER)


def _further_figures(
    scenario: Scenario, barrier: Barrier, series: Series, row: Mapping[str, Any], figures: Mapping[str, Any]
) -> dict[str, Any]:
    """Key figures of a further barrier by the names that the first one's have; `row` is that of `barrier_figures`."""
    time, force, run_up = series["time"], series.get("impact_force_x"), series.get("run_up")
    found: dict[str, Any] = {"barrier_displacement_final": 0.0 if isinstance(barrier.motion, Fixed) else None}
    found |= {name: figures.get(name) for name in ("left_volume", "end_time")}
    if "barrier_displacement" in series:
        found["barrier_displacement_final"] = float(series["barrier_displacement"][-1])
    if isinstance(barrier.motion, Sliding) and "barrier_velocity" in series:
        found["barrier_at_rest"] = bool(series["barrier_velocity"][-1] == 0.0)
    found["overtopped_volume"] = row.get("passed_volume")
    if run_up is not None:
        highest = int(np.argmax(run_up))
        found["run_up_max"], found["run_up_max_time"] = float(run_up[highest]), float(time[highest])
    if force is not None and len(time) > 1 and force.max() > 0.0:
        impulse, tenth = cumulative_impulse(time, force), RESIDUAL_SHARE * float(time[-1] - time[0])
        found["residual_force"] = float(impulse[-1] - np.interp(time[-1] - tenth, time, impulse)) / tenth
    return found


def _checks(
    scenario: Scenario, design: Design, one: _Judged, limits: Mapping[str, float | None]
) -> list[dict[str, Any]]:
    """All checks of a barrier that are known."""
    displacement, at_rest = one.figures.get("barrier_displacement_final"), one.figures.get("barrier_at_rest")
    values: dict[str, tuple[float | None, float | None]] = {}
    if one.name == BARRIER or displacement is not None:
        values["displacement"] = (displacement, None)
    if at_rest is False:
        one.remarks.append("The barrier still slides at the end of the run: its displacement is not final.")
    values |= _stability(scenario, design, one)
    values |= _overtopping(scenario, one)
    checks = [_judged(CHECKS[name], *values[name], limits[name]) for name in CHECKS if name in values]
    for check in checks:
        if check["name"] == "displacement" and check["holds"] and at_rest is False:
            check["holds"] = None
    return checks


def _sliding_factor(
    scenario: Scenario, design: Design, series: Series, force: str, block: tuple[float, float], push: float = 0.0
) -> tuple[float | None, float | None]:
    """Least factor of safety against sliding under a recorded force, and its time [s].

    Args:
        force: name of its columns, without the axis.
        block: mass [kg/m] and friction coefficient of the base.
        push: further load along x [N/m].
    """
    time, tilt, (mass, friction) = series["time"], math.radians(scenario.gravity.tilt_deg), block
    weight = mass * scenario.gravity.acceleration_m_per_s2
    across, lift = (design.load_factor * moving_mean(time, series[f"{force}_{axis}"]) for axis in "xy")
    resistance = friction / design.base_friction_factor * np.maximum(weight * math.cos(tilt) - lift, 0.0)
    return _least(time, resistance, across + weight * math.sin(tilt) + push)


def _judged(check: Check, value: float | None, time: float | None, limit: float | None) -> dict[str, Any]:
    """A check with its answer. A factor of safety that is None has nothing to withstand; any other figure that is None
    has no end."""
    holds: bool | None = None
    if limit is not None:
        holds = check.least if value is None else (value >= limit if check.least else value <= limit)
    return {
        "name": check.name, "value": value, "time": time, "limit": limit, "holds": holds, "formula": check.formula
    }  # fmt: skip


def _said(check: Check, value: float) -> dict[str, Any]:
    return {"name": check.name, "value": value, "formula": check.formula}


@dataclass(frozen=True)
class _Block:
    """The barrier as a rigid block on its base."""

    weight: float
    """[N/m]"""
    base: float
    """[m]"""
    arm: float
    """Way from its heel upstream to its centre of gravity [m]."""
    middle: float
    """Height of its centre of gravity [m]."""
    friction: float | None
    """tan δ_b."""


def _block(scenario: Scenario, design: Design, one: _Judged) -> _Block | str:
    """The block, or why it is not known."""
    barrier, standing = one.barrier, one.standing
    assert isinstance(barrier.shape, Trapezoid)
    friction, density = design.base_friction, design.density_kg_per_m3
    mass = None if density is None else density * geometry.area(barrier.shape.outline)
    if isinstance(barrier.motion, Sliding):
        mass, friction = barrier.mass, barrier.motion.base_friction_coefficient
    if mass is None:
        return "The barrier has no weight: design.density_kg_per_m3 is needed for its stability."
    assert standing is not None
    if abs(standing[-1, 1] - standing[0, 1]) > 1e-6 * float(np.ptp(standing)):
        return "The barrier's base is not level: its stability is not judged."
    base, crest, height = barrier.shape.base_crest_height
    arm, middle = 0.5 * base, height / 3.0 * (base + 2.0 * crest) / (base + crest)
    if isinstance(barrier.shape, OutlineShape):
        centre, middle = (float(way) for way in geometry.centroid(barrier.shape.outline))
        arm = base - centre
    return _Block(mass * scenario.gravity.acceleration_m_per_s2, base, arm, middle, friction)


def _stability(scenario: Scenario, design: Design, one: _Judged) -> dict[str, tuple[float | None, float | None]]:
    """Factors of safety, eccentricity and base pressure: the worst over time, with its time [s]."""
    series, remarks = one.series, one.remarks
    if not isinstance(one.barrier.shape, Trapezoid):
        return _sliding_of_wall(scenario, design, one)
    needed = [f"{name}_force_{axis}" for name in ("impact", "back") for axis in "xy"]
    needed += ["top_force", "top_force_y", "heel_moment"]
    block = _block(scenario, design, one)
    if isinstance(block, str):
        remarks.append(block)
        return {}
    missing = [name for name in needed if name not in series]
    if missing or len(series["time"]) < 2:
        remarks.append(_unknown(one, missing))
        return {}
    time, tilt, factor = series["time"], math.radians(scenario.gravity.tilt_deg), design.load_factor
    mean = {name: factor * moving_mean(time, series[name]) for name in needed}
    down, along = block.weight * math.cos(tilt), block.weight * math.sin(tilt)
    across = mean["impact_force_x"] + mean["top_force"] + mean["back_force_x"] + along
    normal = down - (mean["impact_force_y"] + mean["top_force_y"] + mean["back_force_y"])
    overturning = mean["heel_moment"] + along * block.middle
    if design.boulder is not None:
        push, height = _boulder_push(scenario, design, one.barrier)
        across, overturning = across + push, overturning + push * height
    found: dict[str, tuple[float | None, float | None]] = {}
    if block.friction is None:
        remarks.append("The barrier has no base friction: design.base_friction is needed for the factor of sliding.")
    else:
        resistance = block.friction / design.base_friction_factor * np.maximum(normal, 0.0)
        found["sliding_factor"] = _least(time, resistance, across)
    found["overturning_factor"] = _least(time, np.full(len(time), down * block.arm), overturning)
    # Where the reaction of the base acts, from its heel; the base cannot pull.
    with np.errstate(divide="ignore", invalid="ignore"):
        from_heel = np.where(normal > 0.0, (down * block.arm - overturning) / normal, -math.inf)
        share = np.abs(0.5 - from_heel / block.base)
        edge = (0.5 - share) * block.base
        pressure = np.where(share <= 1.0 / 6.0, normal / block.base * (1.0 + 6.0 * share), 2.0 * normal / (3.0 * edge))
    pressure = np.where(share < 0.5, pressure, math.inf)
    found["eccentricity_of_base"] = _greatest(time, share)
    found["base_pressure"] = _greatest(time, pressure)
    return found


def _sliding_of_wall(scenario: Scenario, design: Design, one: _Judged) -> dict[str, tuple[float | None, float | None]]:
    """The factor of sliding of a wall without end, by its mass; it has no base to turn over or to press with."""
    barrier, series, remarks = one.barrier, one.series, one.remarks
    if not isinstance(barrier.motion, Sliding):
        remarks.append(
            "A wall without end that does not slide has neither weight nor base: its stability is not judged."
        )
        return {}
    remarks.append("A wall without end has no base: only its sliding is judged, by its mass.")
    missing = [name for name in ("impact_force_x", "impact_force_y") if name not in series]
    if missing or len(series["time"]) < 2:
        remarks.append(_unknown(one, missing))
        return {}
    assert barrier.mass is not None
    block = (barrier.mass, barrier.motion.base_friction_coefficient)
    boulder = 0.0 if design.boulder is None else _boulder_push(scenario, design, barrier)[0]
    return {"sliding_factor": _sliding_factor(scenario, design, series, "impact_force", block, boulder)}


def _unknown(one: _Judged, missing: Sequence[str]) -> str:
    """That its stability is not known without columns, by the names of the first barrier's."""
    own = missing if one.name == BARRIER else [f"{one.name}_{OF_BARRIER[name]}" for name in missing]
    return f"The barrier's stability is not known without {', '.join(own) or 'samples'}."


def _least(time: Array, withstands: Array, load: Array) -> tuple[float | None, float | None]:
    """Least ratio where there is a load, and its time; None without one."""
    loaded = load > 1e-9 * max(float(np.abs(withstands).max()), 1e-300)
    if not loaded.any():
        return None, None
    ratio = np.where(loaded, withstands / np.where(loaded, load, 1.0), math.inf)
    worst = int(np.argmin(ratio))
    return float(ratio[worst]), float(time[worst])


def _greatest(time: Array, values: Array) -> tuple[float | None, float | None]:
    """Greatest value and its time; None for one without end."""
    worst = int(np.argmax(values))
    return (float(values[worst]) if math.isfinite(values[worst]) else None), float(time[worst])


def _boulder_push(scenario: Scenario, design: Design, barrier: Barrier) -> tuple[float, float]:
    """Load per metre [N/m], with its partial factor, and the height at which it acts [m]."""
    boulder = design.boulder
    assert boulder is not None
    shape = barrier.shape
    crest = shape.base_crest_height[2] if isinstance(shape, Trapezoid) else math.inf
    height = min(boulder.height_m if boulder.height_m is not None else scenario.flow.depth, crest)
    return design.load_factor * boulder_force(scenario, design) / boulder.width_m, height


def boulder_force(scenario: Scenario, design: Design) -> float:
    """Force [N] of the boulder on the face, K_c · 4000 v^1.2 r² kN."""
    boulder = design.boulder
    assert boulder is not None
    speed = abs(boulder.speed_m_per_s) if boulder.speed_m_per_s is not None else scenario.flow.speed
    return 1e3 * boulder.load_factor * 4000.0 * speed**1.2 * boulder.radius_m**2


def _overtopping(scenario: Scenario, one: _Judged) -> dict[str, tuple[float | None, float | None]]:
    figures, shape = one.figures, one.barrier.shape
    found: dict[str, tuple[float | None, float | None]] = {}
    if not isinstance(shape, Trapezoid):
        # Nothing gets over a wall without end; what left the domain did so elsewhere.
        return {"overtopped_share": (0.0, None), "overtopped_volume": (0.0, None), "freeboard": (None, None)}
    beyond, left = figures.get("overtopped_volume"), departed_volume(scenario, figures)
    if beyond is not None:
        volume = float(beyond)
        if one.name == BARRIER:  # of the further ones that is told already
            volume = came_beyond(scenario, volume, shape.crest_end)
        volume += max(float(left or 0.0), 0.0)  # on the safe side: it may have left upstream
        found["overtopped_share"] = (volume / scenario.flow.volume, None)
        found["overtopped_volume"] = (volume, None)
    if figures.get("run_up_max") is not None:
        height = shape.base_crest_height[2]
        found["freeboard"] = (height - float(figures["run_up_max"]), figures.get("run_up_max_time"))
    return found


def _told(scenario: Scenario, one: _Judged) -> dict[str, float]:
    """Loads and bounds beside the checks; those of the flow at the start with the first barrier."""
    series, figures = one.series, one.figures
    flow, tilt = scenario.flow, math.radians(scenario.gravity.tilt_deg)
    g = scenario.gravity.acceleration_m_per_s2
    found: dict[str, float] = {}
    time, force = series["time"], series.get("impact_force_x")
    last = time >= time[-1] - RESIDUAL_SHARE * (time[-1] - time[0])
    if figures.get("residual_force") is not None:
        found["static_load"] = float(figures["residual_force"])
        if force is not None and "impact_force_height" in series and float(force[last].sum()) > 0.0:
            moment = float((force * series["impact_force_height"])[last].sum())
            found["static_load_height"] = moment / float(force[last].sum())
    if "run_up" in series:
        reached = float(series["run_up"][last].mean())
        found["hydrostatic_load"] = 0.5 * flow.material.density * g * math.cos(tilt) * reached**2
    if one.name != BARRIER:
        return found
    if g > 0.0:
        found["energy_head"] = flow.depth + flow.speed**2 / (2.0 * g)
        froude = flow.speed / math.sqrt(g * flow.depth)
        found["reflected_depth"] = float(reflected_depth_ratio(froude)) * flow.depth
        shape = one.barrier.shape
        if isinstance(shape, Trapezoid) and flow.speed > 0.0 and math.cos(tilt) > 0.0:
            crest, cosine, slope = shape.base_crest_height[2], math.cos(tilt), math.tan(tilt)
            # The formula with a speed drawn into the root, so that none is too small to be divided by.
            root = math.sqrt((flow.speed * slope) ** 2 + 2.0 * g * crest / cosine)
            found["landing_distance"] = flow.speed / (g * cosine) * (flow.speed * slope + root) + crest * slope
    if scenario.design is not None and scenario.design.boulder is not None:
        found["boulder_force"] = boulder_force(scenario, scenario.design)
    return found


def _guideline(scenario: Scenario, name: str) -> float:
    """Thrust [N/m] on the flow's depth, at its speed and depth at the start."""
    flow = scenario.flow
    assert scenario.barrier is not None
    shape = scenario.barrier.shape
    face = math.radians(shape.built_face_angle_deg) if isinstance(shape, Trapezoid) else 0.5 * math.pi
    factor = {
        "hong_kong": 2.5,
        "switzerland_fine": 2.0,
        "switzerland_granular": 4.0,
        "japan": 1.0,
        "china": 1.33 * math.sin(face),
    }[name]
    return factor * flow.material.density * flow.speed**2 * flow.depth


def verdict_rows(verdict: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and value, with unit, limit and judgement, of all that a verdict says."""
    limited = any(check["limit"] is not None for check in verdict["checks"])
    unknown = "not known: see the remarks" if limited else "not judged: the design group has no limits"
    rows = [("verdict", {True: "holds", False: "does NOT hold", None: unknown}[verdict["holds"]])]
    rows += [(f"  {CHECKS[entry['name']].words}", _answer_row(entry)) for entry in verdict["checks"]]
    for one in verdict.get("barriers", ()):
        rows += [(f"  {one['name']}: {CHECKS[entry['name']].words}", _answer_row(entry)) for entry in one["checks"]]
        rows += [
            (f"  {one['name']}: {TOLD[entry['name']].words.strip()}", TOLD[entry["name"]].text(entry["value"]))
            for entry in one["told"]
        ]
    for table, part in ((TOLD, "told"), (GUIDELINES, "guidelines")):
        rows += [
            (f"  {table[entry['name']].words}", table[entry["name"]].text(entry["value"])) for entry in verdict[part]
        ]
    return [*rows, *(("  remark", sentence) for sentence in verdict["remarks"])]


def _answer_row(entry: Mapping[str, Any]) -> str:
    """Value, limit and judgement of a check."""
    check = CHECKS[entry["name"]]
    value, limit = entry["value"], entry["limit"]
    nothing = "no crest to reach" if check.name == "freeboard" else "no load" if check.least else "without end"
    text = nothing if value is None else check.text(value).removesuffix(" -")
    text += f" at {entry['time']:.3f} s" if entry["time"] is not None else ""
    if limit is not None:
        bound = check.text(limit).removesuffix(" -")
        answer = {True: "holds", False: "FAILS", None: "not known yet"}[entry["holds"]]
        text += f"; {'at least' if check.least else 'at most'} {bound}: {answer}"
    return text
