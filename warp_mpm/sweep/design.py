"""Which cases a sweep has: the layout of its file, and the values of each case."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError, read_json, sentences
from warp_mpm.schema import AsWhole, Text

MOST_CASES = 100_000
"""Most cases of a sweep; more is a typing error."""

Number = Annotated[float, Field(ge=-1e15, le=1e15)]
Pair = Annotated[tuple[Number, Number], Field(strict=False)]
Triple = Annotated[tuple[Number, Number, Number], Field(strict=False)]


class SweepError(ValueError):
    """A sweep that cannot be run; the message is one sentence for each problem."""


class _Model(BaseModel):
    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Variation(_Model):
    """What a field takes: exactly one of these."""

    values: Annotated[list[Any], Field(min_length=1)] | None = None
    """Listed values, of any kind that the field takes."""
    range: tuple[Number, Number, int] | None = Field(None, strict=False)
    """First, last and number of evenly spaced values."""
    uniform: Pair | None = None
    """Least and greatest, every value between them as likely."""
    log_uniform: Pair | None = None
    """The same of the logarithm; both above 0."""
    normal: Pair | None = None
    """Mean and standard deviation."""
    lognormal: Pair | None = None
    """Mean and coefficient of variation, both above 0."""
    triangular: Triple | None = None
    """Least, most likely and greatest."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = self.model_fields_set
        if len(given) != 1:
            raise ValueError(f"needs exactly one of {', '.join(type(self).model_fields)}")
        if self.range is not None and not 1 <= self.range[2] <= MOST_CASES:
            raise ValueError(f"range[2] = {self.range[2]} must be a number of values, 1 to {MOST_CASES}")
        for name in ("uniform", "log_uniform"):
            bounds = getattr(self, name)
            if bounds is not None and not bounds[0] < bounds[1]:
                raise ValueError(f"{name} = {list(bounds)} must increase")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise ValueError(f"log_uniform[0] = {self.log_uniform[0]:g} must be greater than 0")
        if self.normal is not None and self.normal[1] <= 0.0:
            raise ValueError(f"normal[1] = {self.normal[1]:g} must be greater than 0")
        if self.lognormal is not None and min(self.lognormal) <= 0.0:
            raise ValueError(f"lognormal = {list(self.lognormal)} must be two numbers greater than 0")
        if self.triangular is not None:
            low, mode, high = self.triangular
            if not (low <= mode <= high and low < high):
                raise ValueError(f"triangular = {list(self.triangular)} must increase")
        return self

    @property
    def listed(self) -> list[Any] | None:
        """The values of a list or a range; None of a distribution."""
        if self.range is not None:
            first, last, count = self.range
            return [float(value) for value in np.linspace(first, last, count)]
        return self.values

    def quantiles(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values [N] below which these shares of the distribution lie."""
        from scipy import stats

        if self.uniform is not None:
            low, high = self.uniform
            return low + share * (high - low)
        if self.log_uniform is not None:
            low, high = np.log(self.log_uniform)
            return np.exp(low + share * (high - low))
        if self.normal is not None:
            return stats.norm.ppf(share, *self.normal)
        if self.lognormal is not None:
            mean, variation = self.lognormal
            spread = math.sqrt(math.log1p(variation**2))
            return stats.lognorm.ppf(share, spread, scale=mean * math.exp(-0.5 * spread**2))
        assert self.triangular is not None
        low, mode, high = self.triangular
        return stats.triang.ppf(share, (mode - low) / (high - low), loc=low, scale=high - low)


@dataclass(frozen=True)
class Case:
    """One run of a sweep."""

    number: int
    values: dict[str, Any]
    """Value of each varied field."""
    scenario: Scenario

    @property
    def name(self) -> str:
        """Name of its run folder."""
        return f"{self.number:05d}"


class Sweep(_Model):
    """The content of a sweep file. `Sweep.load(path)` reads one."""

    title: Annotated[Text, Field(min_length=1, max_length=200)]
    """One line that names the sweep."""
    scenario: str
    """Scenario file, seen from the folder of the sweep file."""
    fixed: dict[str, Any] = Field(default_factory=dict)
    """Fields that are changed in all cases, by their paths."""
    method: Literal["grid", "list", "latin_hypercube", "random"]
    """grid: every combination of the listed values; list: first with first, second with second, ...; latin_hypercube
    and random: samples of distributions."""
    vary: Annotated[dict[str, Variation], Field(min_length=1)]
    """Fields that vary, by their paths; a number at the end of a path picks from a list, `flow.velocity_m_per_s.0`."""
    samples: Annotated[int, Field(ge=1, le=MOST_CASES), AsWhole] | None = None
    """Number of cases of latin_hypercube and random."""
    seed: Annotated[int, Field(ge=0), AsWhole] = 0
    """Start of the random numbers: the same seed, the same cases."""

    @classmethod
    def load(cls, path: str | Path) -> Sweep:
        """Read and check a sweep file.

        Raises:
            SweepError: it cannot be read, or asks for something impossible.
        """
        try:
            content = read_json(Path(path))
        except ScenarioError as error:
            raise SweepError(str(error)) from None
        if isinstance(content, dict) and "flow" in content and "vary" not in content:
            raise SweepError(f"{path}: This is a scenario; a sweep is a file that names one and what varies in it.")
        return cls.checked(content, str(path))

    @classmethod
    def checked(cls, content: Any, name: str) -> Sweep:
        """A sweep of the content of a file; `name` begins the sentences of what is wrong with it.

        Raises:
            SweepError: it asks for something impossible.
        """
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise SweepError("\n".join(f"{name}: {sentence}" for sentence in sentences(error, cls))) from None

    @model_validator(mode="after")
    def _method_fits(self) -> Self:
        sampled = self.method in ("latin_hypercube", "random")
        for path, variation in self.vary.items():
            if sampled and variation.listed is not None:
                raise ValueError(f"vary.{path} lists values; method = {self.method!r} needs distributions")
            if not sampled and variation.listed is None:
                raise ValueError(f"vary.{path} is a distribution; method = {self.method!r} needs values or range")
        if sampled and self.samples is None:
            raise ValueError(f"samples is missing; method = {self.method!r} needs it")
        if not sampled and self.samples is not None:
            raise ValueError(f"samples is not allowed with method = {self.method!r}; the values say how many cases")
        lengths = {path: len(variation.listed or ()) for path, variation in self.vary.items()}
        if self.method == "list" and len(set(lengths.values())) > 1:
            raise ValueError(f"vary: method = 'list' needs as many values of each field, not {lengths}")
        if self.method == "grid" and math.prod(lengths.values()) > MOST_CASES:
            raise ValueError(f"vary asks for {math.prod(lengths.values())} cases; at most {MOST_CASES} are allowed")
        return self

    def values(self) -> list[dict[str, Any]]:
        """Values of the varied fields, case by case."""
        names = list(self.vary)
        if self.method in ("grid", "list"):
            columns = [self.vary[name].listed or [] for name in names]
            rows = itertools.product(*columns) if self.method == "grid" else zip(*columns, strict=True)
            return [dict(zip(names, row, strict=True)) for row in rows]
        assert self.samples is not None
        if self.method == "latin_hypercube":
            from scipy.stats import qmc

            shares = qmc.LatinHypercube(len(names), rng=np.random.default_rng(self.seed)).random(self.samples)
        else:
            shares = np.random.default_rng(self.seed).random((self.samples, len(names)))
        columns = [self.vary[name].quantiles(shares[:, index]).tolist() for index, name in enumerate(names)]
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]

    def cases(self, base: Scenario) -> list[Case]:
        """All cases, each with its scenario checked.

        Raises:
            SweepError: a case is no possible scene; the sentence names its values.
        """
        cases = []
        for number, values in enumerate(self.values()):
            try:
                scenario = changed(base, {**self.fixed, **values})
            except ScenarioError as error:
                told = ", ".join(f"{path} = {json.dumps(value)}" for path, value in values.items())
                raise SweepError(f"Case {number} ({told}): {error}") from None
            cases.append(Case(number, {path: _as_taken(scenario, path, values[path]) for path in values}, scenario))
        return cases


def _as_taken(scenario: Scenario, path: str, value: Any) -> Any:
    """The value, as a whole number where the field takes only those."""
    taken: Any = scenario
    for name in path.split("."):
        taken = taken[int(name)] if isinstance(taken, tuple) else getattr(taken, name)
    return taken if isinstance(taken, int) and not isinstance(value, bool) else value


def changed(base: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """`Scenario.replaced`, where a path may also pick from a list: `{"flow.velocity_m_per_s.0": 12.0}`.

    Raises:
        ScenarioError: a changed value is not allowed, or a path leads nowhere.
    """
    whole: dict[str, Any] = {}
    for path, value in changes.items():
        head, _, last = path.rpartition(".")
        if not last.isdecimal():
            whole[path] = value
            continue
        content: Any = base.resolved()
        for name in head.split("."):
            content = content.get(name) if isinstance(content, dict) else None
        entries = list(whole.get(head, content or ()))
        if int(last) >= len(entries):
            raise ScenarioError(
                [f"{path} leads nowhere: this scenario has no list {head!r} of more than {last} entries."]
            )
        entries[int(last)] = value
        whole[head] = entries
    return base.replaced(whole)
