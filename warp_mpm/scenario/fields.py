"""Types of a scenario's fields, with their outer bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

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


def set_fields(model: type[Model], fields: Mapping[str, tuple[Any, Any]]) -> None:
    """Give a model more fields, or other ones of the same name, each an annotation with a default or a FieldInfo.

    Models that hold this one must be built anew (`model_rebuild(force=True)`).
    """
    for name, (annotation, default) in fields.items():
        field = default if isinstance(default, FieldInfo) else FieldInfo.from_annotated_attribute(annotation, default)
        model.model_fields[name] = field
        model.__annotations__[name] = annotation
    model.model_rebuild(force=True)
