"""Types of a scenario's fields, with their outer bounds."""

from __future__ import annotations

import unicodedata
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _text(value: str) -> str:
    for character in value:
        if unicodedata.category(character) in ("Cc", "Cs") and character not in "\n\t":
            kind = "half of a character" if unicodedata.category(character) == "Cs" else "a control character"
            raise ValueError(f"holds U+{ord(character):04X}, {kind}, where only text is allowed")
    return value


AsWhole = BeforeValidator(_whole)
"""Of a whole number, after its bounds: JSON and evenly spaced values may write it as 3.0."""
Text = Annotated[str, AfterValidator(_text)]
"""What a terminal and a file can take as it is."""

# The outer bounds are far beyond any flow; they keep the arithmetic of a typing error finite.
Positive = Annotated[float, Field(gt=0.0, le=1e15)]
NonNegative = Annotated[float, Field(ge=0.0, le=1e15)]
Length = Annotated[float, Field(gt=0.0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Density = Annotated[float, Field(gt=0.0, le=1e6)]
Velocity = Annotated[float, Field(ge=-1e4, le=1e4)]
Friction = Annotated[float, Field(ge=0.0, le=10.0)]
Interval = Annotated[float, Field(ge=1e-9, le=1e6)]
Point = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Series = Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=100_000)]


class Model(BaseModel):
    """Part of a scenario: frozen, strict, and no field that it does not know."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )
