"""Probability that a barrier slides farther than a limit, and which uncertain input matters most."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc, rankdata

from analytic.arrays import outcomes
from analytic.design import MASS_RATIOS
from analytic.impact import STANDARD_GRAVITY

Array = NDArray[np.float64]

INPUTS = {
    "density": (0.0, math.inf),
    "flow_length": (0.0, math.inf),
    "flow_height": (0.0, math.inf),
    "speed": (0.0, math.inf),
    "barrier_mass": (0.0, math.inf),
    "base_friction": (0.0, math.inf),
    "geometry_change": (0.0, 1.0),
    "rise_ratio": (0.0, 1.0),
    "vertical_load_ratio": (0.0, math.inf),
}
"""Inputs that may be uncertain, SI, and the range in which each makes sense; distributions are cut off there."""


LARGEST_SQUARED = 1e100
"""Far below what a square of would be no number, far above 1."""

LEAST_SPREAD = 1e-9
"""From the first tenth to the last, over the number: with less, samples are told apart by rounding alone."""


@dataclass(frozen=True)
class Distribution:
    """An uncertain number: `normal(mean, deviation)`, `lognormal(mean, coefficient of variation)`,
    `uniform(low, high)` or `triangular(low, mode, high)`.
    """

    kind: str
    parameters: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(f'{value:g}' for value in self.parameters)})"

    def quantile(self, probability: Array, low: float = -math.inf, high: float = math.inf) -> Array:
        """Values at the probabilities in (0, 1), of the distribution cut off at `low` and `high`."""
        start, end = (float(self._cumulative(bound)) for bound in (low, high))
        return self._inverse(start + (end - start) * probability)

    def _cumulative(self, value: float) -> float:
        a, b = self.parameters[0], self.parameters[-1]
        match self.kind:
            case "normal":
                return float(ndtr((value - a) / b))
            case "lognormal":
                mu, sigma = self._log_moments()
                return float(ndtr((math.log(value) - mu) / sigma)) if value > 0 else 0.0
            case "uniform":
                return min(max((value - a) / (b - a), 0.0), 1.0)
            case _:
                if value <= a:
                    return 0.0
                if value >= b:
                    return 1.0
                mode = self.parameters[1]
                if value <= mode:
                    return (value - a) ** 2 / ((b - a) * (mode - a))
                return 1 - (b - value) ** 2 / ((b - a) * (b - mode))

    def _inverse(self, p: Array) -> Array:
        a, b = self.parameters[0], self.parameters[-1]
        match self.kind:
            case "normal":
                return np.asarray(a + b * ndtri(p))
            case "lognormal":
                mu, sigma = self._log_moments()
                return np.exp(mu + sigma * ndtri(p))
            case "uniform":
                return np.asarray(a + (b - a) * p)
            case _:
                mode = self.parameters[1]
                below = a + np.sqrt(p * (b - a) * (mode - a))
                return np.where(p < (mode - a) / (b - a), below, b - np.sqrt((1 - p) * (b - a) * (b - mode)))

    def _log_moments(self) -> tuple[float, float]:
        mean, variation = self.parameters
        variance = math.log1p(variation**2) if variation < LARGEST_SQUARED else 2 * math.log(variation)
        return math.log(mean) - variance / 2, math.sqrt(variance)


_KINDS = {
    "normal": ("normal(mean, deviation)", 2),
    "lognormal": ("lognormal(mean, coefficient_of_variation)", 2),
    "uniform": ("uniform(low, high)", 2),
    "triangular": ("triangular(low, mode, high)", 3),
}


def parse(name: str, text: str) -> float | Distribution:
    """A number, or a distribution written as `kind(parameters)`; `name` is for the error.

    Raises:
        ValueError: one sentence that names the input, the text and what it may be.
    """
    forms = ", ".join(form for form, _ in _KINDS.values())
    try:
        return float(text)
    except ValueError:
        pass
    found = re.fullmatch(r"\s*(\w+)\s*\(([^()]*)\)\s*", text)
    if not found or found[1] not in _KINDS:
        raise ValueError(f"{name} is {text!r}, it must be a number, or one of {forms}.")
    form, count = _KINDS[found[1]]
    try:
        parameters = tuple(float(part) for part in found[2].split(","))
    except ValueError:
        parameters = ()
    if len(parameters) != count or not all(map(math.isfinite, parameters)) or not _ordered(found[1], parameters):
        raise ValueError(f"{name} is {text!r}, it must read {form} with finite numbers in order and a spread above 0.")
    distribution = Distribution(found[1], parameters)
    with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond all sizes have no spread that is a number
        low, high = distribution.quantile(np.array([0.1, 0.9]))
        swallowed = math.isfinite(high) and high - low <= LEAST_SPREAD * max(abs(low), abs(high))
    if swallowed:
        raise ValueError(f"{name} is {text!r}, it must be a number where its spread is nothing beside it.")
    return distribution


def _ordered(kind: str, parameters: tuple[float, ...]) -> bool:
    a, *_, b = parameters
    if kind == "normal":
        return b > 0
    if kind == "lognormal":
        return a > 0 and b > 0
    return a < b and all(a <= value <= b for value in parameters)


@dataclass(frozen=True)
class Reliability:
    """Distribution of the final displacement."""

    samples: int
    probability: float
    """Of a displacement beyond the limit."""
    interval: tuple[float, float]
    """95 % confidence interval of `probability` (Wilson's)."""
    mean: float
    """Mean displacement [m]."""
    quantiles: Mapping[float, float]
    """Displacement [m] at the probabilities 0.05, 0.5, 0.95, 0.99."""
    curve: Array
    """Probabilities from 0 to 0.999 and the displacements [m] at them [2, 1000]."""
    sensitivity: Mapping[str, Sensitivity]
    """By input, the one that matters most first."""


@dataclass(frozen=True)
class Sensitivity:
    """How one uncertain input acts on the displacement."""

    total: float
    """Total Sobol' index: share of the variance that goes when all but this input are known [-]."""
    first: float
    """First-order Sobol' index: share of the variance that goes when this input is known [-]."""
    rank_correlation: float
    """Spearman's rank correlation with the displacement; its sign tells the direction [-]."""


def reliability(
    inputs: Mapping[str, float | Distribution],
    limit: float,
    *,
    samples: int = 1_000_000,
    seed: int = 1,
    variant: str = "stick_slip",
    gravity: float = STANDARD_GRAVITY,
    slope: float = 0.0,
) -> Reliability:
    """Sample the closed form.

    Args:
        inputs: a number or a distribution for each of `INPUTS`; they are independent of each other.
        limit: on the final displacement [m] >= 0.
        samples: number of samples for the probability, at least 1000.
        seed: of the random numbers; the same seed gives the same result.

    Raises:
        ValueError: an input is unknown, missing or out of its range, or nothing is uncertain.
    """
    fixed, uncertain = _sorted(inputs)
    uniform = _uniform(limit, samples, len(uncertain), seed)

    def displacement(points: Array) -> Array:
        return _displacement(_values(fixed, uncertain, points), len(points), variant, gravity, slope)

    moved = displacement(uniform)
    exceeding = int(np.count_nonzero(moved > limit))
    levels = (0.05, 0.5, 0.95, 0.99)
    probabilities = np.arange(1000) / 1000
    return Reliability(
        samples=samples,
        probability=exceeding / samples,
        interval=_wilson(exceeding, samples),
        mean=float(moved.mean()),
        quantiles=dict(zip(levels, map(float, np.quantile(moved, levels)), strict=True)),
        curve=np.array([probabilities, np.quantile(moved, probabilities)]),
        sensitivity=_sensitivity(displacement, list(uncertain), uniform, moved, seed),
    )


def lightest_mass(
    inputs: Mapping[str, float | Distribution],
    limit: float,
    probability: float,
    *,
    samples: int = 1_000_000,
    seed: int = 1,
    variant: str = "stick_slip",
    gravity: float = STANDARD_GRAVITY,
    slope: float = 0.0,
) -> float:
    """Least barrier mass [kg/m] that slides beyond `limit` [m] with at most the given probability.

    The same samples serve every trial mass. `inputs`: as in `reliability`; a `barrier_mass` there is not used.

    Raises:
        ValueError: as `reliability`; the probability is not in (0, 1); or no mass is enough.
    """
    if not 0 < probability < 1:
        raise ValueError(f"probability is {probability:g}, it must be a number in (0, 1).")
    fixed, uncertain = _sorted({**inputs, "barrier_mass": 1.0})
    values = _values(fixed, uncertain, _uniform(limit, samples, len(uncertain), seed))
    typical = float(np.median(values["flow_mass"]))

    def share(mass: float) -> float:
        values["barrier_mass"] = mass
        return float(np.mean(_displacement(values, samples, variant, gravity, slope) > limit))

    low, high = MASS_RATIOS[0] * typical, MASS_RATIOS[1] * typical
    if share(high) > probability:
        raise ValueError(f"No barrier up to {MASS_RATIOS[1]:g} times the flow's mass keeps {limit:g} m so surely.")
    while high > low * (1 + 1e-4):  # bisection: the share falls as the mass grows
        middle = math.sqrt(low * high)
        low, high = (low, middle) if share(middle) <= probability else (middle, high)
    return high


def _uniform(limit: float, samples: int, count: int, seed: int) -> Array:
    """Random points in the open unit cube, at whose faces quantiles are infinite."""
    if not (math.isfinite(limit) and limit >= 0):
        raise ValueError(f"limit is {limit:g}, it must be a number in [0, inf).")
    if samples < 1000:
        raise ValueError(f"samples is {samples}, it must be at least 1000.")
    return np.clip(np.random.default_rng(seed).random((samples, count)), 1e-12, 1 - 1e-12)


def _values(fixed: Mapping[str, Any], uncertain: Mapping[str, Distribution], points: Array) -> dict[str, Any]:
    """Inputs of `outcomes` at points of the unit cube."""
    values = dict(fixed)
    for column, (name, distribution) in enumerate(uncertain.items()):
        values[name] = distribution.quantile(points[:, column], *INPUTS[name])
    values["flow_mass"] = values.pop("density") * values["flow_length"] * values.pop("flow_height")
    return values


def _displacement(values: Mapping[str, Any], count: int, variant: str, gravity: float, slope: float) -> Array:
    found = outcomes(**values, variant=variant, gravity=gravity, slope=slope).barrier_displacement_final
    if not np.all(np.isfinite(found)):
        raise ValueError("base_friction must be above 0, without it a barrier that slides never stops.")
    return np.broadcast_to(found, (count,))


def _sorted(inputs: Mapping[str, float | Distribution]) -> tuple[dict[str, Any], dict[str, Distribution]]:
    fixed: dict[str, Any] = {}
    uncertain: dict[str, Distribution] = {}
    for name in inputs:
        if name not in INPUTS:
            raise ValueError(f"input is {name!r}, it must be one of {', '.join(INPUTS)}.")
    for name, (low, high) in INPUTS.items():
        value = inputs.get(name, 0.0 if name == "vertical_load_ratio" else None)
        if value is None:
            raise ValueError(f"{name} is missing, give a number or a distribution.")
        if isinstance(value, Distribution):
            if not value._cumulative(high) - value._cumulative(low) > 0.5:
                raise ValueError(f"{name} is mostly outside [{low:g}, {high:g}], where it makes sense.")
            uncertain[name] = value
        else:
            fixed[name] = value
    if not uncertain:
        raise ValueError("No input is uncertain, give at least one as a distribution.")
    return fixed, uncertain


def _wilson(count: int, samples: int) -> tuple[float, float]:
    z = 1.959964  # 97.5 % quantile of the normal distribution
    share = count / samples
    centre = (share + z**2 / (2 * samples)) / (1 + z**2 / samples)
    half = z / (1 + z**2 / samples) * math.sqrt(share * (1 - share) / samples + (z / (2 * samples)) ** 2)
    return max(centre - half, 0.0), min(centre + half, 1.0)


def _sensitivity(
    displacement: Any, names: list[str], uniform: Array, moved: Array, seed: int
) -> dict[str, Sensitivity]:
    """Sobol' indices by Saltelli's (first) and Jansen's (total) estimators on 2^15 points of a Sobol' sequence."""
    count = len(names)
    points = qmc.Sobol(2 * count, seed=seed).random_base2(15)
    points = np.clip(points, 1e-12, 1 - 1e-12)
    first_half, second_half = points[:, :count], points[:, count:]
    at_first, at_second = displacement(first_half), displacement(second_half)
    centre = np.mean([at_first, at_second])
    variance = float(np.var(np.concatenate([at_first, at_second])))
    ranks = rankdata(moved[: 2**15])
    found = {}
    for column, name in enumerate(names):
        mixed = first_half.copy()
        mixed[:, column] = second_half[:, column]
        at_mixed = displacement(mixed)
        total = float(np.mean((at_first - at_mixed) ** 2)) / (2 * variance) if variance > 0 else 0.0
        first = float(np.mean((at_second - centre) * (at_mixed - at_first))) / variance if variance > 0 else 0.0
        # The quantile function grows with the probability, so both have the same ranks.
        both = np.corrcoef(rankdata(uniform[: 2**15, column]), ranks) if variance > 0 else np.zeros((2, 2))
        correlation = float(both[0, 1])
        found[name] = Sensitivity(total=total, first=first, rank_correlation=correlation)
    return dict(sorted(found.items(), key=lambda item: -item[1].total))
