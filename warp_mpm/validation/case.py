"""What a validation case is: a question with a known answer, the numbers that came out, and the curves to draw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Check:
    """One number beside its reference. `passed` is None where the number is only reported."""

    quantity: str
    unit: str
    ours: float
    reference: str
    """The reference value or band, as it is printed."""
    error: float | None
    """In the measure of `limit`; None for a number without one."""
    limit: float | None
    percent: bool = True
    """Error and limit are shares, printed in percent; false: in the unit of the quantity."""
    passed: bool | None
    remark: str = ""
    """For a number that falls short: why."""


def compared(
    quantity: str,
    unit: str,
    ours: float,
    reference: float,
    limit: float,
    *,
    scale: float | None = None,
    remark: str = "",
) -> Check:
    """`ours` against `reference`: the difference, as a share of `scale` (the reference itself if left out), is at
    most `limit`."""
    error = abs(ours - reference) / abs(reference if scale is None else scale)
    return Check(
        quantity=quantity,
        unit=unit,
        ours=ours,
        reference=number(reference),
        error=error,
        limit=limit,
        passed=bool(error <= limit),
        remark=remark,
    )


def at_most(
    quantity: str,
    unit: str,
    ours: float,
    limit: float,
    *,
    percent: bool = False,
    reference: str = "0",
    remark: str = "",
) -> Check:
    """A number that is itself an error: at most `limit`."""
    return Check(
        quantity=quantity,
        unit=unit,
        ours=ours,
        reference=reference,
        error=abs(ours),
        limit=limit,
        percent=percent,
        passed=bool(abs(ours) <= limit),
        remark=remark,
    )


def within(quantity: str, unit: str, ours: float, low: float, high: float, *, remark: str = "") -> Check:
    """A number inside a band; the error is its distance from the band, as a share of the band's nearer end."""
    edge = low if ours < low else high
    error = 0.0 if low <= ours <= high else abs(ours - edge) / abs(edge)
    return Check(
        quantity=quantity,
        unit=unit,
        ours=ours,
        reference=f"{number(low)} … {number(high)}",
        error=error,
        limit=0.0,
        passed=bool(low <= ours <= high),
        remark=remark,
    )


def holds(statement: str, unit: str, ours: float, true: bool, *, reference: str = "", remark: str = "") -> Check:
    """A statement that is true or false, with the number that shows it."""
    return Check(
        quantity=statement,
        unit=unit,
        ours=ours,
        reference=reference,
        error=None,
        limit=None,
        passed=bool(true),
        remark=remark,
    )


def falls(
    statement: str, errors: Sequence[float], *, left: float = 0.0, scale: float = 1.0, of: str = "errors"
) -> Check:
    """Errors at spacings, coarse first, fall: the last is less than 0.7 of the first, or less than `left`. They are
    told as shares of `scale`, which `of` names."""
    told = ", ".join(f"{100 * error / scale:.2g} %" for error in errors)
    true = errors[-1] < 0.7 * errors[0] or errors[-1] < left
    return holds(statement, "-", errors[-1] / errors[0], true, reference=f"< 0.7; {of} {told}")


def reported(quantity: str, unit: str, ours: float, *, reference: float | None = None, remark: str = "") -> Check:
    """A number that is not judged; beside a reference its difference is shown."""
    error = abs(ours - reference) / abs(reference) if reference else None
    return Check(
        quantity=quantity,
        unit=unit,
        ours=ours,
        reference="" if reference is None else number(reference),
        error=error,
        limit=None,
        passed=None,
        remark=remark,
    )


def number(value: float) -> str:
    """Four significant digits."""
    if value == 0.0 or not np.isfinite(value):
        return f"{value:g}"
    return f"{value:.4g}" if 1e-3 <= abs(value) < 1e5 else f"{value:.3e}"


@dataclass(frozen=True)
class Curve:
    """A line or marks of a panel."""

    x: ArrayLike
    y: ArrayLike
    label: str
    style: str = "-"
    """Matplotlib's format; references are drawn dashed in grey by `reference`."""


def reference(x: ArrayLike, y: ArrayLike, label: str = "reference") -> Curve:
    """A curve of the known answer."""
    return Curve(x, y, label, "reference")


@dataclass(frozen=True)
class Band:
    """Where a measurement may lie, shaded."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    label: str


@dataclass(frozen=True)
class Panel:
    """One diagram: ours over the reference."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    log_x: bool = False
    log_y: bool = False
    x_range: tuple[float, float] | None = None
    bands: Sequence[Band] = ()


@dataclass(frozen=True)
class Table:
    """A table of the page that is no list of checks."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Point:
    """A figure that was measured and computed, both with the ends of what they may be."""

    quantity: str
    by: str
    """What computed it, in words."""
    measured: float
    measured_low: float
    measured_high: float
    computed: float
    computed_low: float
    computed_high: float
    label: str = ""
    """Written beside it in the picture of all figures."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of a case."""

    checks: Sequence[Check]
    points: Sequence[Point] = ()
    """For the picture of everything measured against everything computed."""
    panels: Sequence[Panel] = ()
    pictures: dict[str, Figure] = field(default_factory=dict)
    """Ready figures by name, for what is no diagram of curves."""
    tables: Sequence[Table] = ()
    remarks: Sequence[str] = ()
    """Paragraphs that the reader needs to judge the numbers."""

    @property
    def short(self) -> list[Check]:
        """The checks that miss their limit."""
        return [check for check in self.checks if check.passed is False]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A question to the simulator whose answer is known."""

    name: str
    """Of `--only` and of the plot's file."""
    title: str
    tests: str
    """What is tested, and how."""
    source: str
    """The reference: formula with its origin."""
    limit: str
    """The limit in words."""
    set_before: bool = False
    """The limit is a text of its own, with its reason, that was written before the case was first run."""
    run: Callable[[bool], Outcome]
    """Called with True for the quick variant: a coarser or shorter run of the same checks."""
    in_quick: bool = True
    """Whether a quick validation of everything includes it."""
    module: str = ""
    """Whose imports decide the numbers; that of `run` unless told."""
