"""What a quantity is: everything that is said of it anywhere is said of it here.

This module and the table of the time series need nothing but Python: the unit `DebrisFlow` ships them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

IN_THE_PLANE, IN_SPACE = 2, 3
"""Dimensions that a simulation may have."""


def of_width(unit: str, dimensions: int = IN_THE_PLANE) -> str:
    """Unit of what grows with the width of a scene: in the plane it is per metre of that.

    >>> of_width("kN")
    'kN/m'
    """
    return f"{unit}/m" if dimensions == IN_THE_PLANE else unit


_OF_WIDTH = ("N", "N s", "N m", "J", "kg", "m3")
FORCE, IMPULSE, MOMENT, ENERGY, MASS, VOLUME = map(of_width, _OF_WIDTH)
"""Units of forces, impulses, moments, energies, masses and volumes in the plane."""

SHOWN_UNITS = {
    "Pa": ("kPa", 1e-3),
    **{
        of_width(unit, dimensions): (of_width(shown, dimensions), factor)
        for dimensions in (IN_THE_PLANE, IN_SPACE)
        for unit, shown, factor in (
            ("N", "kN", 1e-3),
            ("N s", "kN s", 1e-3),
            ("N m", "kN m", 1e-3),
            ("J", "kJ", 1e-3),
            ("m3", "m³", 1.0),
        )
    },
}
"""Units in which people read a quantity, with the factor from SI; any other unit is shown as it is."""


@dataclass(frozen=True)
class Quantity:
    """A quantity in SI units, in the plane; `in_dimensions` is that of another space."""

    name: str
    """In files and in Python."""
    unit: str
    meaning: str
    """What it is, with its sign and the paper's symbol."""
    label: str = ""
    """Words in pictures, tables and reports; empty: the name's own words."""
    symbol: str = ""
    """Of the paper, in Unicode: F₂,x."""
    shown: tuple[str, float] | None = None
    """Unit in which people read it, and the factor to it; None: as `SHOWN_UNITS` has it."""

    @property
    def heading(self) -> str:
        """Name with unit, as in the header of a column: `impact_force_x [N/m]`."""
        return f"{self.name} [{self.unit}]"

    def in_dimensions(self, dimensions: int) -> Self:
        """The same with its unit there: in space nothing is per metre of width."""
        whole = {of_width(unit): of_width(unit, dimensions) for unit in _OF_WIDTH}
        return replace(self, unit=whole.get(self.unit, self.unit))

    @property
    def words(self) -> str:
        """The label, or the words of the name."""
        return self.label or self.name.replace("_", " ")

    @property
    def shown_unit(self) -> str:
        """Unit in which people read it."""
        return (self.shown or SHOWN_UNITS.get(self.unit, (self.unit, 1.0)))[0]

    @property
    def factor(self) -> float:
        """What a value in SI is multiplied by for `shown_unit`."""
        return (self.shown or SHOWN_UNITS.get(self.unit, (self.unit, 1.0)))[1]

    @property
    def title(self) -> str:
        """Words, symbol and the unit in which people read it: `barrier velocity v₂ [m/s]`."""
        return " ".join(part for part in (self.words, self.symbol, f"[{self.shown_unit}]") if part)

    def text(self, value: float, form: str = ",.4g") -> str:
        """A value with the unit in which people read it."""
        return f"{value * self.factor:{form}} {self.shown_unit}"


def always(scene: Any) -> bool:
    """That every scene has it."""
    return True


@dataclass(frozen=True)
class Sampled(Quantity):
    """A quantity of the time series: one number at each sample, a column of `timeseries.csv`.

    >>> Sampled("front", "m", "place of the foremost point", read=lambda now: now.points()["position"][:, 0].max())
    """

    key: str = ""
    """In `Simulation.sample`; empty: the name."""
    read: Callable[[Any], float] = lambda now: float("nan")
    """Takes it from a `warp_mpm.state.samples.Now`."""
    there: Callable[[Any], bool] = always
    """Whether a scenario has it."""
    of_points: bool = True
    """Whether it needs all material points: it is then read only where it is asked for."""
    of_loads: bool = False
    """Whether it needs where the flow acts on the barrier: it is then read only where it is asked for."""
    mean: bool = False
    """Whether it is a mean over the interval: pictures show its moving mean."""

    def __post_init__(self) -> None:
        if not self.key:
            object.__setattr__(self, "key", self.name)
