"""Fitting the constants of the variant `calibrated` to the table of a sweep, and how well they predict.

Every error is of a scene that the constants were not fitted to: five-fold cross-validation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.fitted import Coefficients, Constants, coefficients
from analytic.scene import Scene
from analytic.sweep import Run

Array = NDArray[np.float64]

FOLDS = 5

RESAMPLES = 200
"""Times that the runs are drawn anew for the standard errors of the constants."""

ROBUST_SCALE = 0.1
"""Residual [-] beyond which a run's weight falls."""

SMALL_DISPLACEMENT = 0.05
"""Added to displacement / depth before a ratio is taken [-]: below it, displacements count as alike."""

MOVED = 0.1
"""Displacement / depth [-] from which a barrier counts as moved."""


@dataclass(frozen=True)
class Score:
    """How well a rule predicts the runs of a sweep."""

    runs: int
    peak_force_median: float
    """Median of |F_closed / F_simulated - 1| [-]."""
    peak_force_bias: float
    """Median of F_closed / F_simulated [-]."""
    rise_time_median: float
    """Median of |T1_closed / T1_simulated - 1| [-]."""
    moved: int
    """Runs whose barrier moved, to which the following belong."""
    displacement_median: float
    """Median of |closed - simulated| [m]."""
    displacement_bias: float
    """Median of closed / simulated, both raised by `SMALL_DISPLACEMENT` depths [-]."""
    displacement_factor: float
    """exp of the root mean square of ln(closed / simulated), both raised likewise [-]."""
    within_two: float
    """Share of the displacements within a factor of two, both raised likewise [-]."""


Rule = Callable[[Scene], Coefficients]


def paper_rule(scene: Scene) -> Coefficients:
    """The paper's two constants in the variant `stick_slip`."""
    return Coefficients(geometry_change=scene.paper_geometry_change)


def score(runs: Sequence[Run], predicted: Sequence[Coefficients]) -> Score:
    """How well the closed form with the numbers `predicted` for each run meets the runs."""
    impacts = [run.scene.impact(**numbers.model) for run, numbers in zip(runs, predicted, strict=True)]
    force = np.array([i.peak_force / run.peak_force for i, run in zip(impacts, runs, strict=True)])
    rise = np.array([i.peak_time / run.rise_time for i, run in zip(impacts, runs, strict=True)])
    depth = np.array([run.flow_height for run in runs])
    found = np.array([i.barrier_displacement_final for i in impacts])
    true = np.array([0.0 if run.fixed else run.barrier_displacement_final for run in runs])
    moved = true > MOVED * depth
    ratio = (found + SMALL_DISPLACEMENT * depth)[moved] / (true + SMALL_DISPLACEMENT * depth)[moved]
    nothing = not moved.any()
    return Score(
        runs=len(runs),
        peak_force_median=float(np.median(np.abs(force - 1))),
        peak_force_bias=float(np.median(force)),
        rise_time_median=float(np.median(np.abs(rise - 1))),
        moved=int(moved.sum()),
        displacement_median=math.nan if nothing else float(np.median(np.abs(found - true)[moved])),
        displacement_bias=math.nan if nothing else float(np.median(ratio)),
        displacement_factor=math.nan if nothing else float(np.exp(np.sqrt(np.mean(np.log(ratio) ** 2)))),
        within_two=math.nan if nothing else float(np.mean(np.abs(np.log(ratio)) <= math.log(2))),
    )


def fit(runs: Sequence[Run]) -> Constants:
    """The constants of peak force and rise time that meet the runs best, all of them fixed or all of them sliding.

    T1 by linear least squares on its logarithm, F_peak by least squares on its logarithm, in which residuals beyond
    `ROBUST_SCALE` count less (soft L1): a few flows pile up behind a high barrier and push hardest long after the
    jet, and one formula cannot have both. The displacement takes no part: it is predicted.
    """
    fixed = runs[0].fixed
    turned = np.array([1 - math.cos(math.radians(run.face_angle)) for run in runs])
    length_ratio = np.array([run.flow_length / run.flow_height for run in runs])
    rise = np.array([run.rise_time * run.speed / run.flow_height for run in runs])
    matrix = np.column_stack([np.ones(len(runs)), np.log(length_ratio), np.log(turned)])
    (log_rise, by_length, by_angle), *_ = np.linalg.lstsq(matrix, np.log(rise), rcond=None)

    over_dynamic = np.array([run.peak_force / (run.flow_mass / run.flow_length * run.speed**2) for run in runs])
    froude = np.array([run.scene.froude_number for run in runs])
    log_share = np.array([0.0 if fixed else -math.log1p(run.flow_mass / run.barrier_mass) for run in runs])

    def residuals(p: Array) -> Array:
        return np.log(p[0] * turned + p[1] / froude**2) + p[2] * log_share - np.log(over_dynamic)

    low, high = [1e-3, 1e-3, -1.0], [np.inf, np.inf, 1.0]
    from scipy.optimize import least_squares

    found = least_squares(residuals, [1.0, 0.5, 0.0], bounds=(low, high), loss="soft_l1", f_scale=ROBUST_SCALE)
    return Constants(
        jet=float(found.x[0]),
        weight=float(found.x[1]),
        mass_exponent=0.0 if fixed else float(found.x[2]),
        rise=math.exp(log_rise),
        rise_length_exponent=float(by_length),
        rise_angle_exponent=float(by_angle),
    )


def standard_errors(runs: Sequence[Run], seed: int = 1) -> Constants:
    """The standard error of each constant, by the bootstrap: its spread over fits to as many runs, drawn anew."""
    random = np.random.default_rng(seed)
    draws = random.integers(len(runs), size=(RESAMPLES, len(runs)))
    found = [list(vars(fit([runs[index] for index in draw])).values()) for draw in draws]
    spread = np.std(found, axis=0, ddof=1)
    return Constants(**{name: float(value) for name, value in zip(vars(fit(runs)), spread, strict=True)})


def vertical_load_scatter(runs: Sequence[Run]) -> tuple[float, float]:
    """Root mean square of the recorded kappa about cot(beta), and their own spread [-]; of sliding barriers."""
    kappa = np.array([run.vertical_load_ratio for run in runs])
    rule = np.array([1 / math.tan(math.radians(run.face_angle)) for run in runs])
    return float(np.sqrt(np.mean((kappa - rule) ** 2))), float(np.std(kappa))


def cross_validated(runs: Sequence[Run], seed: int = 1) -> list[Coefficients]:
    """For each run the numbers from constants that were fitted to the runs of the other folds."""
    order = np.random.default_rng(seed).permutation(len(runs))
    predicted: list[Coefficients] = [Coefficients()] * len(runs)
    for fold in np.array_split(order, FOLDS):
        held_out = set(fold.tolist())
        constants = fit([run for index, run in enumerate(runs) if index not in held_out])
        for index in held_out:
            predicted[index] = coefficients(runs[index].scene, constants)
    return predicted


def usable(runs: Sequence[Run], fixed: bool) -> list[Run]:
    """The runs of one kind of barrier that had come to rest when their record ended."""
    return [run for run in runs if run.fixed == fixed and run.at_rest]
