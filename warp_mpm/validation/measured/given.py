"""What a case held against measurements is given, and how it judges a figure that it has at several spacings."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from warp_mpm.validation.case import Case, Check, Outcome, Point, Table, number
from warp_mpm.validation.measured.tables import Tables

SMOOTH = "water, smooth bed"
"""What most figures of the picture of all are computed with, in its words."""


@dataclass(frozen=True)
class Given:
    """How a case is to be run."""

    quick: bool = False
    finer: int = 1
    """Every spacing is divided by this."""
    tables: Tables = field(default_factory=Tables)
    """Measured curves, for pictures and for errors over whole curves; the figures that gate stand in the cases."""


def measured_case(
    name: str, title: str, tests: str, source: str, run: Callable[[Given], Outcome], given: Given
) -> Case:
    """A case whose limit, with its reason, is what stands in the docstring of `run`: it is part of the source, and was
    there before the run was made."""
    limit = inspect.getdoc(run) or ""
    return Case(
        name=name,
        title=title,
        tests=tests,
        source=source,
        limit=limit,
        set_before=True,
        run=lambda quick: run(Given(quick, given.finer, given.tables)),
        module=run.__module__,
    )


def simulated(
    quantity: str,
    measured: float,
    values: Sequence[float],
    *,
    band: tuple[float, float] | None = None,
    by: str = SMOOTH,
) -> Point:
    """A figure of the finest of several spacings; its bar reaches to that of the spacing before.

    Args:
        quantity: its name.
        measured: its measured value.
        values: ours at each spacing, coarsest first.
        band: ends of what was measured; None where they are not known.
        by: what computed it, in words.
    """
    low, high = (measured, measured) if band is None else band
    return Point(quantity, by, measured, low, high, values[-1], min(values[-2:]), max(values[-2:]))


class Ladder:
    """Figures at several spacings, coarsest first; the finest one is judged."""

    def __init__(self, spacings: Sequence[str], *, by: str = SMOOTH):
        """Args: spacings: as they are printed; by: what computes, in words of the picture of all figures."""
        self.spacings = spacings
        self.by = by
        self.checks: list[Check] = []
        self.points: list[Point] = []
        self._rows: list[tuple[str, ...]] = []

    def add(
        self,
        check: Check,
        values: Sequence[float],
        *,
        measured: tuple[float, float, float] | None = None,
    ) -> None:
        """A figure.

        Args:
            check: of the finest spacing.
            values: at each spacing.
            measured: what was measured and the ends of its band, for the picture of all figures; None: not in it.
        """
        self.checks.append(check)
        self._rows.append((check.quantity, check.unit, check.reference, *(number(value) for value in values)))
        if measured is not None and np.isfinite(values).all():
            self.points.append(simulated(check.quantity, measured[0], values, band=measured[1:], by=self.by))

    @property
    def table(self) -> Table:
        """All figures at all spacings."""
        return Table("At each spacing", ("", "unit", "measured", *self.spacings), self._rows)
