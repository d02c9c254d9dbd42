"""How likely limits are exceeded where fields of a scenario are uncertain: runs, a surrogate of them, many samples.

The runs lie on a scrambled Sobol' sequence over the distributions. A surrogate of each figure is chosen by
cross-validation among polynomials (least squares) and radial basis functions (scipy); what it costs in accuracy is told
with every number that rests on it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.interpolate import RBFInterpolator
from scipy.stats import qmc

from analytic.reliability import Distribution, parse
from warp_mpm.by_simulation.fields import allowed, number_at, typed, with_values
from warp_mpm.by_simulation.limits import FIGURES_OF_LIMITS, Limit
from warp_mpm.by_simulation.runs import Run, coarse, untouched
from warp_mpm.quantities import Quantity
from warp_mpm.scenario import Scenario

Array = NDArray[np.float64]

FIGURES_TOLD = ("peak_force_filtered", "impulse", "displacement", "overtopped_volume")
"""Figures whose distribution is told, beside the limited ones, as far as the scene has them."""

SAMPLES = 2**20
"""Points at which a surrogate is asked for its distribution."""

INDEX_SAMPLES = 2**13
"""Points of one matrix of the Sobol' indices."""

FOLDS = 10
"""Parts of the cross-validation."""

LEAST_RUNS = 16
"""Fewest runs that a surrogate is made of."""

LEVELS = (0.05, 0.5, 0.95, 0.99)
"""Shares of the quantiles that are told."""

LEAST_CUT = 1e-3
"""Share of a distribution that is cut off from which on that is told."""

EDGE = 1e-6
"""Share of a distribution left out at each end, where quantiles are infinite."""


@dataclass(frozen=True)
class Uncertain:
    """A field and its distribution, cut off where the field takes no value."""

    path: str
    distribution: Distribution
    low: float
    high: float

    @property
    def cut(self) -> float:
        """Share of the distribution that lies where the field takes no value, and is cut off."""
        return 1.0 - float(self.distribution._cumulative(self.high) - self.distribution._cumulative(self.low))

    def values(self, share: Array) -> Array:
        """Values below which these shares of the distribution lie."""
        return self.distribution.quantile(np.clip(share, EDGE, 1.0 - EDGE), self.low, self.high)


def read_uncertain(text: str, scenario: Scenario) -> Uncertain:
    """A distribution as it was typed, `FIELD=normal(mean, deviation)`.

    Raises:
        ValueError: the field is no number of the scenario, or the distribution cannot be read or lies mostly where the
            field takes no value.
    """
    path, rest = typed(text)
    number_at(scenario, path)
    found = parse(f"--vary {path}", rest)
    if not isinstance(found, Distribution):
        raise ValueError(
            f"--vary {path} is {rest!r}, it must be a distribution: normal(mean, deviation), "
            "lognormal(mean, coefficient_of_variation), uniform(low, high) or triangular(low, mode, high)."
        )
    low, high = allowed(scenario, path)
    uncertain = Uncertain(path, found, low, high)
    if not uncertain.cut < 0.5:
        raise ValueError(f"--vary {path}={found} is mostly outside [{low:g}, {high:g}], which the field takes.")
    return uncertain


@dataclass(frozen=True)
class Design:
    """The runs of a study."""

    scenario: Scenario
    uncertain: tuple[Uncertain, ...]
    shares: Array
    """Points of the unit cube [runs, fields]."""
    spacing: float

    @property
    def values(self) -> Array:
        """Values of the fields [runs, fields]."""
        return _mapped(self.uncertain, self.shares)

    def scenes(self) -> list[Scenario]:
        """The scenarios, all checked.

        Raises:
            ScenarioError: values are not allowed together; the sentence names them.
        """
        paths = [one.path for one in self.uncertain]
        return [
            coarse(with_values(self.scenario, dict(zip(paths, map(float, row), strict=True))), self.spacing)
            for row in self.values
        ]


def design_of(
    scenario: Scenario, uncertain: Sequence[Uncertain], runs: int, *, spacing: float, seed: int = 1
) -> Design:
    """A scrambled Sobol' sequence; the first points of a longer one are those of a shorter one."""
    shares = qmc.Sobol(len(uncertain), scramble=True, rng=seed).random_base2(math.ceil(math.log2(runs)))[:runs]
    return Design(scenario, tuple(uncertain), shares, spacing)


def _mapped(uncertain: Sequence[Uncertain], shares: Array) -> Array:
    return np.stack([one.values(shares[:, column]) for column, one in enumerate(uncertain)], axis=1)


Model = Callable[[Array], Array]
"""Values [N] at scaled points [N, fields]."""


@dataclass(frozen=True)
class Surrogate:
    """A figure as a function of the fields."""

    name: str
    kind: str
    """In words."""
    model: Model
    error: float
    """Root mean square of what cross-validation was off, in the figure's unit."""
    explained: float
    """1 less the square of that over the figure's variance: 1 is perfect, 0 no better than the mean."""
    residuals: Array
    """Of the cross-validation [runs]."""
    least: float
    """Below which the figure does not go: 0 of one that was nowhere negative."""

    def __call__(self, scaled: Array) -> Array:
        parts = [self.model(scaled[start : start + 2**16]) for start in range(0, len(scaled), 2**16)]
        return np.maximum(np.concatenate(parts), self.least)


def fitted(name: str, scaled: Array, values: Array) -> Surrogate:
    """The surrogate of a figure that cross-validation likes best.

    Args:
        name: of the figure.
        scaled: values of the fields at the runs, over their spread [runs, fields].
        values: of the figure [runs].
    """
    spread = float(values.std())
    least = 0.0 if values.min() >= 0.0 else -math.inf
    if spread <= 1e-12 * max(float(np.abs(values).max()), 1e-300):
        mean = float(values.mean())
        return Surrogate(name, "a constant", lambda at: np.full(len(at), mean), 0.0, 1.0, 0.0 * values, least)
    best: tuple[float, str, Callable[[Array, Array], Model], Array] | None = None
    folds = np.arange(len(values)) % FOLDS
    for kind, fit in _candidates(scaled.shape[1], len(values)).items():
        residuals = np.empty(len(values))
        for fold in range(FOLDS):
            out = folds == fold
            residuals[out] = np.maximum(fit(scaled[~out], values[~out])(scaled[out]), least) - values[out]
        error = float(np.sqrt(np.mean(residuals**2)))
        if best is None or error < 0.98 * best[0]:  # a simpler one is kept where it is as good
            best = error, kind, fit, residuals
    assert best is not None
    error, kind, fit, residuals = best
    return Surrogate(name, kind, fit(scaled, values), error, 1.0 - (error / spread) ** 2, residuals, least)


def _candidates(fields: int, runs: int) -> dict[str, Callable[[Array, Array], Model]]:
    found: dict[str, Callable[[Array, Array], Model]] = {}
    for degree in (1, 2, 3):
        if 2 * math.comb(fields + degree, degree) <= runs * (FOLDS - 1) // FOLDS:
            found[f"polynomial of degree {degree}"] = _polynomial(fields, degree)
    for kernel in ("thin_plate_spline", "cubic"):
        for smoothing in (1e-3, 1e-1, 10.0):
            found[f"radial basis functions, {kernel.replace('_', ' ')}, smoothing {smoothing:g}"] = _radial(
                kernel, smoothing
            )
    return found


def _polynomial(fields: int, degree: int) -> Callable[[Array, Array], Model]:
    powers = [power for power in itertools.product(range(degree + 1), repeat=fields) if sum(power) <= degree]

    def basis(at: Array) -> Array:
        return np.stack([np.prod(at ** np.array(power), axis=1) for power in powers], axis=1)

    def fit(at: Array, values: Array) -> Model:
        weights, *_ = np.linalg.lstsq(basis(at), values, rcond=None)
        return lambda where: basis(where) @ weights

    return fit


def _radial(kernel: str, smoothing: float) -> Callable[[Array, Array], Model]:
    def fit(at: Array, values: Array) -> Model:
        return RBFInterpolator(at, values, kernel=kernel, smoothing=smoothing)

    return fit


@dataclass(frozen=True)
class Exceeded:
    """How likely a limit is broken."""

    limit: Limit
    probability: float
    """By the surrogate."""
    low: float
    """Where the surrogate were off by its error, to the safe side ..."""
    high: float
    """... and to the other."""
    of_runs: float
    """Share of the runs themselves that broke it."""
    of_runs_interval: tuple[float, float]
    """95 % confidence interval of that (Wilson's)."""


@dataclass(frozen=True)
class Told:
    """The distribution of a figure."""

    name: str
    surrogate: Surrogate
    mean: float
    quantiles: Mapping[float, float]
    """By `LEVELS`."""
    curve: Array
    """Shares and the values that they lie below [2, 400]."""
    values: Array
    """Of the runs [runs]."""
    first: Mapping[str, float]
    """First-order Sobol' index by field: share of the variance that goes when it is known."""
    total: Mapping[str, float]
    """Total Sobol' index: share that stays when all others are known."""

    @property
    def quantity(self) -> Quantity:
        return FIGURES_OF_LIMITS[self.name]


@dataclass
class Study:
    """What a study found."""

    design: Design
    limits: tuple[Limit, ...]
    runs: list[Run]
    told: list[Told] = field(default_factory=list)
    exceeded: list[Exceeded] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def study(design: Design, limits: Sequence[Limit], runs: Sequence[Run], *, seed: int = 1) -> Study:
    """Surrogates of the runs, and what a million samples of them say.

    Raises:
        ValueError: too few runs came to their end.
    """
    found = Study(design, tuple(limits), list(runs))
    good = np.array([run.figures is not None for run in runs])
    if good.sum() < LEAST_RUNS:
        problem = next((run.problem for run in runs if run.problem), "")
        raise ValueError(f"Only {good.sum()} of {len(runs)} runs came to their end; {LEAST_RUNS} are needed. {problem}")
    values = design.values
    centre, spread = values.mean(axis=0), values.std(axis=0)
    scaled = (values[good] - centre) / spread
    many = qmc.Sobol(len(design.uncertain), scramble=True, rng=seed + 1).random(SAMPLES)
    sampled = (_mapped(design.uncertain, many) - centre) / spread
    figures = [run.figures for run in runs if run.figures is not None]
    for name in _names(limits, figures):
        known = np.array([float("nan") if one.get(name) is None else float(one[name]) for one in figures])
        limit = next((one for one in limits if one.name == name), None)
        there = np.isfinite(known)
        if there.sum() < max(LEAST_RUNS, 0.9 * len(known)):
            found.remarks.append(
                f"{FIGURES_OF_LIMITS[name].words} is known of {there.sum()} of {len(known)} runs only; it is left out."
            )
            continue
        surrogate = fitted(name, scaled[there], known[there])
        at_many = surrogate(sampled)
        found.told.append(_told(surrogate, at_many, known, design, centre, spread, seed))
        if limit is not None:
            found.exceeded.append(_exceeded(limit, surrogate, at_many, known[there]))
    _remark(found, good)
    return found


def _names(limits: Sequence[Limit], figures: Sequence[Mapping[str, Any]]) -> list[str]:
    limited = [limit.name for limit in limits]
    told = [name for name in FIGURES_TOLD if any(one.get(name) is not None for one in figures)]
    return list(dict.fromkeys([*limited, *told]))


def _told(
    surrogate: Surrogate, at_many: Array, known: Array, design: Design, centre: Array, spread: Array, seed: int
) -> Told:
    shares = np.linspace(0.0, 1.0, 400)
    first, total = _indices(surrogate, design, centre, spread, seed)
    return Told(
        surrogate.name,
        surrogate,
        float(at_many.mean()),
        dict(zip(LEVELS, map(float, np.quantile(at_many, LEVELS)), strict=True)),
        np.array([shares, np.quantile(at_many, shares)]),
        known,
        first,
        total,
    )


def _indices(
    surrogate: Surrogate, design: Design, centre: Array, spread: Array, seed: int
) -> tuple[dict[str, float], dict[str, float]]:
    paths = [one.path for one in design.uncertain]
    if surrogate.error == 0.0 and surrogate.kind == "a constant":
        return dict.fromkeys(paths, 0.0), dict.fromkeys(paths, 0.0)
    if len(paths) == 1:
        return {paths[0]: 1.0}, {paths[0]: 1.0}

    def function(shares: Array) -> Array:
        return surrogate((_mapped(design.uncertain, shares.T) - centre) / spread)

    found = stats.sobol_indices(func=function, n=INDEX_SAMPLES, dists=[stats.uniform()] * len(paths), rng=seed)
    return (
        dict(zip(paths, map(float, np.ravel(found.first_order)), strict=True)),
        dict(zip(paths, map(float, np.ravel(found.total_order)), strict=True)),
    )


def _exceeded(limit: Limit, surrogate: Surrogate, at_many: Array, known: Array) -> Exceeded:
    def share(values: Array, shift: float = 0.0) -> float:
        moved = values + (-shift if limit.least else shift)
        return float(np.mean(moved < limit.bound if limit.least else moved > limit.bound))

    broken = round(share(known) * len(known))
    interval = stats.binomtest(broken, len(known)).proportion_ci(method="wilson")
    return Exceeded(
        limit,
        share(at_many),
        share(at_many, -surrogate.error),
        share(at_many, surrogate.error),
        broken / len(known),
        (float(interval.low), float(interval.high)),
    )


def _remark(found: Study, good: NDArray[np.bool_]) -> None:
    failed = int((~good).sum())
    if failed:
        problem = next(run.problem for run in found.runs if run.problem)
        found.remarks.append(f"{failed} of {len(good)} runs failed and are left out: {problem}")
    for uncertain in found.design.uncertain:
        if uncertain.cut > LEAST_CUT:
            typed_as = f"{uncertain.path}={uncertain.distribution}"
            found.remarks.append(
                f"{uncertain.cut:.1%} of {typed_as} lies outside [{uncertain.low:g}, {uncertain.high:g}], which the "
                "field takes; it is cut off, and the rest made the whole."
            )
    idle = sum(map(untouched, found.runs))
    if idle:
        found.remarks.append(
            f"In {idle} of {len(good)} runs the flow did not push on the barrier by t = "
            f"{found.design.scenario.output.end_time_s:g} s; see whether that is meant."
        )
    moving = sum(run.figures is not None and run.figures.get("barrier_at_rest") is False for run in found.runs)
    if moving:
        found.remarks.append(
            f"In {moving} of {len(good)} runs the barrier still slid at the end: their displacement is at least what "
            "counts here. A later output.end_time_s would tell."
        )
    for one in found.told:
        if one.surrogate.explained < 0.9 and one.values.std() > 0.0:
            found.remarks.append(
                f"The surrogate of {one.quantity.words} explains {one.surrogate.explained:.0%} of its variance only; "
                "more runs (--runs) would tell more."
            )
