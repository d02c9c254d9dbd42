"""The paper's conceptual model, Eqs. (1) to (4) as corrected, evaluated on the simulated fields.

With h the depth of the flow above a surface, a the deceleration of its centre of mass, p_L the pore pressure at the
surface, β the angle of the face and tan δ, tan δ_b the frictions on crest and base:

    F_1 = ∫ (ρ_m - ρ_L) g h tan φ_b dx                                     nil on smooth ground
    F_2 = ∫ [(ρ_m - ρ_L) a h + p_L] ds, normal to the face                 no 1/cos β: s runs along the face
    F_3 = ∫ (ρ_m - ρ_L) g h tan δ dx, over the crest
    F_4 = tan δ_b [½ ρ_b g H (b + B) + F_2 cos β + ∫ ρ_m g h dx over the crest]
"""

from __future__ import annotations

import math

import numpy as np

from analytic.force_record import moving_mean
from warp_mpm.results import Snapshot
from warp_mpm.scenario import Sliding, Trapezoid
from warp_mpm.validation.case import Array
from warp_mpm.validation.paper_runs import PaperRun

G = 9.81


def conceptual_forces(run: PaperRun) -> dict[str, Array]:
    """`time` [s] of the snapshots and, in N/m, `face_normal` F_2, `face_horizontal` F_2 sin β, its parts
    `face_inertia` and `face_pressure`, `crest_friction` F_3 and `base_friction` F_4."""
    scenario = run.scenario
    barrier = scenario.barrier
    assert barrier is not None
    assert isinstance(barrier.shape, Trapezoid)
    material = scenario.flow.material
    liquid = float(getattr(material, "liquid_density_kg_per_m3", 0.0))
    base, crest, height = barrier.shape.base_crest_height
    angle = math.atan2(height, 0.5 * (base - crest))
    times = run.results.snapshots.times
    deceleration = np.interp(times, run.series["time"], _deceleration(run))
    inertia, pressure, weight = np.zeros(len(times)), np.zeros(len(times)), np.zeros(len(times))
    for index, snapshot in enumerate(run.results.snapshots):
        on_face, on_crest = _loads(run, snapshot, angle, 0.5 * (base - crest), crest, height)
        inertia[index] = (material.density - liquid) * deceleration[index] * on_face[0]
        pressure[index] = on_face[1]
        weight[index] = on_crest * G
    normal = inertia + pressure
    forces = {
        "time": times,
        "face_normal": normal,
        "face_horizontal": normal * math.sin(angle),
        "face_inertia": inertia * math.sin(angle),
        "face_pressure": pressure * math.sin(angle),
        "crest_friction": (material.density - liquid) * weight * barrier.friction.top,
    }
    if isinstance(barrier.motion, Sliding):
        assert barrier.mass is not None
        pressed = barrier.mass * G + normal * math.cos(angle) + material.density * weight
        forces["base_friction"] = barrier.motion.base_friction_coefficient * pressed
    return forces


def _deceleration(run: PaperRun) -> Array:
    """Deceleration of the flow's centre of mass [m/s²] over the time series, mean over 0.05 s."""
    time, momentum = run.series["time"], run.series["momentum_x"]
    mass = run.scenario.flow.volume * run.scenario.flow.material.density
    rate = np.concatenate([[0.0], -np.diff(momentum) / np.diff(time)])
    return moving_mean(time, rate) / mass


def _loads(
    run: PaperRun, snapshot: Snapshot, angle: float, foot: float, crest: float, height: float
) -> tuple[tuple[float, float], float]:
    """Of a snapshot: ∫ h ds [m²] and ∫ p_L ds [N/m] over the face, and ∫ h dx [m²] over the crest."""
    spacing = run.scenario.numerics.spacing_m
    x = snapshot.position[:, 0] - (snapshot.barrier_displacement or 0.0)
    y = snapshot.position[:, 1]
    above = (x > foot) & (x <= foot + crest) & (y > height - spacing)
    # Volume over the face, per width of it along x: dx = ds cos β. An upright face has no flow above it.
    over_face = (x > 0.0) & (x <= foot)
    depth = float(snapshot["volume"][over_face].sum()) / math.cos(angle) if foot > 0.0 else 0.0
    load = 0.0
    if "pore_pressure" in snapshot:
        along = x * math.cos(angle) + y * math.sin(angle)
        off = -x * math.sin(angle) + y * math.cos(angle)
        length = height / math.sin(angle)
        near = (off > -0.5 * spacing) & (off < spacing) & (along > 0.0) & (along < length)
        cells = max(1, round(length / (2.0 * spacing)))
        cell = np.minimum((along[near] / length * cells).astype(np.int64), cells - 1)
        count = np.bincount(cell, minlength=cells)
        sums = np.bincount(cell, weights=snapshot["pore_pressure"][near], minlength=cells)
        load = float((sums / np.maximum(count, 1)).sum()) * length / cells
    return (depth, load), float(snapshot["volume"][above].sum())
