"""The closed-form model and the empirical formulas on the axes of a study: an answer in microseconds, and its error."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from analytic.empirical import EmpiricalModel, select
from analytic.fitted import calibrated_impact
from analytic.impact import Impact
from analytic.scene import Scene, SceneError, scene_of
from warp_mpm.scenario import Scenario

TIMED = 200
"""Evaluations over which a formula is timed."""


@dataclass(frozen=True)
class Formula:
    """An answer without a simulation."""

    name: str
    time: float
    """[s] of one evaluation."""
    figures: dict[str, float]
    """What it tells, SI, by the names of a simulation's figures."""


def formulas(scenario: Scenario) -> list[Formula]:
    """The closed form with the paper's lambda and with the fitted one, and every verified empirical formula.

    An empirical formula tells a pressure, taken over the depth of the flow as the peak force; the wall that it was
    made for does not give way. Empty where the closed form cannot see the scene.
    """
    try:
        scene = scene_of(scenario)
    except SceneError:
        return []
    makers: dict[str, Callable[[], Impact]] = {
        "closed form, paper's λ": scene.impact,
        "closed form, fitted λ": partial(calibrated_impact, scene),
    }
    found = []
    for name, make in makers.items():
        # The fit does not reach every scene.
        with contextlib.suppress(ValueError):
            found.append(_formula(name, partial(_closed_form, make, scene)))
    found += [
        _formula(model.title, partial(_empirical, model, scene)) for model in select() if model.name != "closed_form"
    ]
    return found


def _formula(name: str, answer: Callable[[], dict[str, float]]) -> Formula:
    figures = answer()
    start = time.process_time()
    for _ in range(TIMED):
        answer()
    return Formula(name, (time.process_time() - start) / TIMED, figures)


def _empirical(model: EmpiricalModel, scene: Scene) -> dict[str, float]:
    pressure = model.pressure(scene.density, scene.speed, scene.flow_height, scene.gravity)
    return {"peak_force": float(pressure) * scene.flow_height}


def _closed_form(make: Callable[[], Impact], scene: Scene) -> dict[str, float]:
    impact = make()
    figures = {
        "peak_force": impact.peak_force,
        "peak_force_time": impact.peak_time + scene.distance / scene.speed,
        "impact_impulse": impact.impulse,
        "impact_duration": impact.duration,
    }
    if not scene.fixed:
        figures["barrier_displacement_final"] = impact.barrier_displacement_final
        figures["barrier_velocity_max"] = impact.barrier_velocity_max
    return {name: value for name, value in figures.items() if math.isfinite(value)}
