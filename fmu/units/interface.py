"""The table of a unit's variables: the one source of its XML, its Python, its C code and its documentation."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field

Value = float | int | bool | str

SMALLEST_ABOVE_NIL = sys.float_info.min
"""The standard's `min` includes its number, so a range that begins above nil is told with this one."""


@dataclass(frozen=True)
class Unit:
    """A unit of measurement: its exponents of kg, m, s and rad, and the display unit offered beside it."""

    name: str
    kg: int = 0
    m: int = 0
    s: int = 0
    rad: int = 0
    factor: float = 1.0
    """Value in the base units per value in this unit."""
    display_name: str | None = None
    display_factor: float = 1.0
    """Value in the display unit per value in this unit."""


ONE = Unit("1")
SECOND = Unit("s", s=1)
METRE = Unit("m", m=1)
METRE_PER_SECOND = Unit("m/s", m=1, s=-1)
METRE_PER_SECOND_SQUARED = Unit("m/s2", m=1, s=-2)
KILOGRAM_PER_METRE = Unit("kg/m", kg=1, m=-1, display_name="t/m", display_factor=1e-3)
NEWTON_PER_METRE = Unit("N/m", kg=1, s=-2, display_name="kN/m", display_factor=1e-3)
NEWTON_PER_SQUARE_METRE = Unit("N/m2", kg=1, m=-1, s=-2, display_name="kN/m2", display_factor=1e-3)
JOULE_PER_METRE = Unit("J/m", kg=1, m=1, s=-2, display_name="kJ/m", display_factor=1e-3)
PASCAL = Unit("Pa", kg=1, m=-1, s=-2, display_name="kPa", display_factor=1e-3)
CUBIC_METRE_PER_METRE = Unit("m3/m", m=2)
UNITS = {unit.name: unit for unit in (METRE, METRE_PER_SECOND, NEWTON_PER_METRE, JOULE_PER_METRE, PASCAL)}
"""Units of the simulator's quantities, by name."""
DEGREE = Unit("deg", rad=1, factor=math.pi / 180)


@dataclass(frozen=True)
class Choice:
    """A closed choice, of which a variable holds the number; numbers count from 1.

    An FMI enumeration would say the same, but some importers skip variables of that type (libcosim does), and with
    them the setting: hence Integer variables whose descriptions list the choice.
    """

    name: str
    description: str
    items: tuple[tuple[str, str], ...]
    """Name and description of each item."""

    def name_of(self, number: int) -> str:
        return self.items[number - 1][0]

    def number_of(self, name: str) -> int:
        return [item for item, _ in self.items].index(name) + 1


@dataclass(frozen=True)
class Variable:
    """One variable of a unit.

    `kind` is `Real`, `Integer` (a choice), `Boolean` or `String`; `causality` is `parameter`, `input`
    or `output`. `start` is given for parameters and inputs alone: outputs are calculated. `minimum` and
    `maximum` bound the value; with `open_minimum` the minimum itself is refused. A `tunable` parameter may be
    changed between steps and acts from the next one on.
    """

    name: str
    causality: str
    description: str
    kind: str = "Real"
    unit: Unit = ONE
    start: Value | None = None
    minimum: float | None = None
    maximum: float | None = None
    open_minimum: bool = False
    nominal: float = 1.0
    choice: Choice | None = None
    tunable: bool = False

    @property
    def variability(self) -> str:
        if self.causality == "parameter":
            return "tunable" if self.tunable else "fixed"
        return "continuous" if self.kind == "Real" else "discrete"

    @property
    def least(self) -> float | None:
        """The least number that is allowed, as an importer reads it: above nil where nil is refused."""
        return SMALLEST_ABOVE_NIL if self.open_minimum and self.minimum == 0 else self.minimum

    @property
    def range_text(self) -> str:
        """The allowed values in words: an interval with its unit, or the numbers and names of a choice."""
        if self.choice:
            return ", ".join(f"{number} ({name})" for number, (name, _) in enumerate(self.choice.items, 1))
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        left = "(" if self.open_minimum or math.isinf(low) else "["
        right = ")" if math.isinf(high) else "]"
        return f"{left}{low:g}, {high:g}{right}{self._unit_text}"

    @property
    def _unit_text(self) -> str:
        return "" if self.kind != "Real" or self.unit.name == "1" else f" {self.unit.name}"

    def fault(self, value: Value) -> str | None:
        """One sentence that names the variable, its value and its range if the value is not allowed, else None."""
        if self.choice:
            inside = value in range(1, len(self.choice.items) + 1)
            return None if inside else f"{self.name} is {value}, it must be one of {self.range_text}."
        if self.kind != "Real":
            return None
        number = float(value)
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if math.isfinite(number) and number <= high and (number > low if self.open_minimum else number >= low):
            return None
        return f"{self.name} is {number:g}{self._unit_text}, it must be a finite number in {self.range_text}."


@dataclass(frozen=True)
class Interface:
    """All that an importer sees of a unit. A variable's value reference is its place in `variables`."""

    name: str
    description: str
    variables: tuple[Variable, ...]
    stop_time: float
    step_size: float
    output_derivatives: int = 0
    """Highest order of the derivatives of its outputs that the unit gives."""
    directional_derivatives: bool = False
    """Whether the unit gives derivatives of its outputs with respect to inputs and tunable parameters."""
    references: dict[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        references = {variable.name: number for number, variable in enumerate(self.variables)}
        if len(references) != len(self.variables):
            raise ValueError(f"{self.name} has two variables of one name.")
        object.__setattr__(self, "references", references)

    def of(self, causality: str) -> tuple[Variable, ...]:
        """The variables of one causality, in order."""
        return tuple(variable for variable in self.variables if variable.causality == causality)

    @property
    def settable_in_steps(self) -> tuple[Variable, ...]:
        """What an importer may set between steps: inputs and tunable parameters."""
        return tuple(variable for variable in self.variables if variable.causality == "input" or variable.tunable)
