"""Types of the fields in scenario files, with their outer bounds: what every part of a scenario is made of."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema

from warp_mpm.field_docstrings import field_docstrings
from warp_mpm.scenario_errors import ScenarioError, sentences


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
    """Part of a scenario: frozen, strict, and no field that it does not know.

    Whichever way it is made, a value that is not allowed raises ScenarioError, with one sentence per problem.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True)

    fields_from: ClassVar[tuple[type[BaseModel], ...]] = ()
    """Models out of which `set_fields` put fields into this one."""

    def __init__(self, /, **fields: Any) -> None:
        with _refusals(type(self)):
            super().__init__(**fields)

    # Tells pydantic not to call the constructor for what lies inside a model that it checks as a whole.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def model_validate(cls, obj: Any, *, source_name: str | None = None, **options: Any) -> Self:
        """Check `obj`, a dict of the file's layout, and make a model of it; `source_name` is for the sentences.

        Raises:
            ScenarioError: with one sentence per problem, each naming field, value and what is allowed.
        """
        with _refusals(cls, source_name):
            return super().model_validate(obj, **options)

    @classmethod
    def model_validate_json(cls, json_data: str | bytes | bytearray, **options: Any) -> Self:
        """As `model_validate`, of JSON text.

        Raises:
            ScenarioError: as `model_validate`.
        """
        with _refusals(cls):
            return super().model_validate_json(json_data, **options)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for name, text in field_docstrings(cls).items():
            properties[name]["description"] = text
        return schema


@contextmanager
def _refusals(model: type[BaseModel], source_name: str | None = None) -> Iterator[None]:
    try:
        yield
    except ValidationError as error:
        raise ScenarioError(sentences(error, model), source_name) from None


def set_fields(model: type[Model], fields: Mapping[str, tuple[Any, Any]]) -> None:
    """Give a model more fields, or other ones of the same name, each an annotation with a default or a FieldInfo.

    Models that hold this one must be built anew (`model_rebuild(force=True)`).
    """
    for name, (annotation, default) in fields.items():
        field = default if isinstance(default, FieldInfo) else FieldInfo.from_annotated_attribute(annotation, default)
        model.model_fields[name] = field
        model.__annotations__[name] = annotation
    if model.__pydantic_complete__:  # else it is built when it is first used
        model.model_rebuild(force=True)
