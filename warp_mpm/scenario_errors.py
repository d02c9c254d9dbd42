"""What is wrong with a scenario, in one sentence per problem."""

from __future__ import annotations

import difflib
import json
import math
import types
import typing
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import BaseModel, ValidationError

from warp_mpm.field_docstrings import field_docstrings
from warp_mpm.shipped import where_to_get

LARGEST_FILE = 16 * 1024 * 1024
"""Bytes; a scenario is a page of text, so anything larger is a mistake."""


class ScenarioError(ValueError):
    """A scenario that cannot be run.

    Attributes:
        problems: one sentence each, naming field, value and what is allowed.
        source_name: the file, where there is one.
    """

    def __init__(self, problems: Sequence[str], source_name: str | None = None):
        self.problems = list(problems)
        self.source_name = source_name
        prefix = f"{source_name}: " if source_name else ""
        super().__init__("\n".join(prefix + problem for problem in self.problems))


def read_json(path: Path) -> Any:
    """Content of a JSON file.

    Raises:
        ScenarioError: the file is missing, unreadable, too large, no JSON, or names a field twice.
    """

    def no_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        seen: dict[str, Any] = {}
        for key, value in pairs:
            if key in seen:
                raise ScenarioError([f"The field {key!r} is given twice in one group."], str(path))
            seen[key] = value
        return seen

    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ScenarioError(
                [f"The file is larger than {LARGEST_FILE // 1024**2} MB; this is no scenario."], str(path)
            )
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise ScenarioError([f"Cannot read the scenario: {error.strerror}.{where_to_get(path)}"], str(path)) from None
    except OSError as error:
        raise ScenarioError([f"Cannot read the scenario: {error.strerror or error}."], str(path)) from None
    except UnicodeDecodeError:
        raise ScenarioError(["The file is not UTF-8 text; a scenario is a JSON file."], str(path)) from None
    try:
        return json.loads(text, object_pairs_hook=no_duplicates)
    except ScenarioError:  # of a field that is given twice
        raise
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise ScenarioError([f"The file is no valid JSON: {error.msg} at {place}."], str(path)) from None
    except RecursionError:
        raise ScenarioError(["The file is nested too deeply; this is no scenario."], str(path)) from None
    except ValueError as error:  # a number with more digits than Python reads
        raise ScenarioError([f"The file holds a number that cannot be read: {error}."], str(path)) from None


def sentences(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One sentence for each problem that pydantic found."""
    return [sentence for problem in error.errors() for sentence in _sentences_of(problem, model)]


def allowed(path: str, model: type[BaseModel]) -> str:
    """What a field takes, in words, as the sentences have it; `path` as in `numerics.spacing_m`."""
    return _range_of(_walk(tuple(path.split(".")), model)[1])


def bounds(model: type[BaseModel], field: str) -> tuple[float, float]:
    """Least and greatest number that a field of a model takes; infinite where there is no bound."""
    low, high = -math.inf, math.inf
    for constraint in _constraints(_members(model.model_fields[field].rebuild_annotation())[0]):
        if isinstance(constraint, Gt | Ge):
            low = max(low, float(constraint.gt if isinstance(constraint, Gt) else constraint.ge))  # type: ignore[arg-type]
        elif isinstance(constraint, Lt | Le):
            high = min(high, float(constraint.lt if isinstance(constraint, Lt) else constraint.le))  # type: ignore[arg-type]
    return low, high


def _sentences_of(problem: Any, model: type[BaseModel]) -> Iterator[str]:
    location, kind, value = problem["loc"], problem["type"], problem["input"]
    if kind == "missing" and isinstance(location[-1], int):  # of a list that is too short the whole is shown
        location, kind = location[:-1], "too_short"
    path, annotation, owner, tags = _walk(location, model)
    if kind == "missing":
        yield f"{path} is missing; it must be given{_range_of(annotation, ' as ')}."
    elif kind == "extra_forbidden":
        name = str(location[-1])
        known = list(owner.model_fields) if owner is not None else []
        # A name that another kind of scene knows is no slip of the pen.
        close = [] if name in _all_names(model) else difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"allowed are {', '.join(known)}."
        where = ", where " + " and ".join(f"{field} is {json.dumps(value)}" for field, value in tags) if tags else ""
        yield f"{path} is not a field of a {model.__name__.lower()}{where}; {hint}"
    elif kind == "union_tag_not_found":
        yield f"{path} needs the field {problem['ctx']['discriminator']}; it must be one of {_tags(annotation)}."
    elif kind == "union_tag_invalid":
        tag, discriminator = problem["ctx"]["tag"], problem["ctx"]["discriminator"].strip("'")
        choices = problem["ctx"]["expected_tags"].replace("'", '"')
        yield f"{path}.{discriminator} = {_shown(tag)} is not allowed; it must be one of {choices}."
    elif kind == "value_error":
        for line in str(problem["ctx"]["error"]).split("\n"):
            yield f"{path + ': ' if path else ''}{line}."
    else:
        words = _range_of(annotation) or _plain(problem)
        if kind in ("too_short", "too_long") and owner is not None and _is_fixed_list(annotation):
            meaning = field_docstrings(owner).get(str(location[-1]), "").rstrip(".")
            words += f": {meaning[:1].lower()}{meaning[1:]}" if meaning else ""
        yield f"{path or 'The scenario'} = {_shown(value)} is not allowed; it must be {words}."


def _walk(
    location: tuple[int | str, ...], model: type[BaseModel]
) -> tuple[str, Any, type[BaseModel] | None, list[tuple[str, str]]]:
    """The path as a user writes it, the annotation at its end, the model that holds its last part and of which kinds
    that and those around it are."""
    path, annotation, owner = "", typing.cast(Any, model), None
    tags: list[tuple[str, str]] = []
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
            arguments = typing.get_args(_bare(_members(annotation)[0]))
            annotation = (arguments[0] if Ellipsis in arguments else arguments[part]) if arguments else Any
            owner = None
            continue
        if typing.get_origin(_bare(annotation)) is dict:  # of groups by names that the user chooses
            path, annotation, owner = f"{path}.{part}", typing.get_args(_bare(annotation))[1], None
            continue
        members = [member for member in _members(annotation) if _is_model(member)]
        tagged = [member for member in members if part in _tags_of(member)]
        if tagged and len(members) > 1:  # the tag that pydantic puts into the location, no part of the user's path
            annotation = tagged[0]
            tags.append((next(name for name in _TAG_FIELDS if part in _values_of(tagged[0], name)), part))
            continue
        owner = members[0] if members else None
        path += f".{part}" if path else part
        field = owner.model_fields.get(part) if owner is not None else None
        annotation = Any if field is None else field.rebuild_annotation()
    return path, annotation, owner, tags


def _all_names(model: type[BaseModel]) -> set[str]:
    """Names of all fields at any depth."""
    names = set(model.model_fields)
    for field in model.model_fields.values():
        for member in _members(field.annotation):
            if _is_model(member):
                names |= _all_names(member)
    return names


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _is_fixed_list(annotation: Any) -> bool:
    """Whether it is a list of so many entries, each with its own meaning."""
    bare = _bare(_members(annotation)[0])
    return typing.get_origin(bare) is tuple and Ellipsis not in typing.get_args(bare)


def _bare(annotation: Any) -> Any:
    """Without Annotated."""
    while typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    return annotation


def _members(annotation: Any) -> list[Any]:
    """Members of a union, None left out; a single annotation otherwise. Constraints stay attached."""
    bare = _bare(annotation)
    if typing.get_origin(bare) in (typing.Union, types.UnionType):
        return [inner for member in typing.get_args(bare) if member is not type(None) for inner in _members(member)]
    return [bare if _is_model(bare) else annotation]


def _tags_of(model: type[BaseModel]) -> tuple[Any, ...]:
    return next((values for name in _TAG_FIELDS if (values := _values_of(model, name))), ())


def _values_of(model: type[BaseModel], field: str) -> tuple[Any, ...]:
    """What a field of fixed values may be; nothing where the model does not have it."""
    return typing.get_args(model.model_fields[field].annotation) if field in model.model_fields else ()


def _tags(annotation: Any) -> str:
    return ", ".join(f'"{tag}"' for member in _members(annotation) if _is_model(member) for tag in _tags_of(member))


def _range_of(annotation: Any, prefix: str = "") -> str:
    """What the annotation allows, in words; empty when there is nothing to say."""
    members = _members(annotation)
    if len(members) != 1:
        tags = _tags(annotation)
        return f"{prefix}a group of fields of one of the kinds {tags}" if tags else ""
    bare, words = _bare(members[0]), ""
    constraints = _constraints(members[0])
    if typing.get_origin(bare) is typing.Literal:
        words = "one of " + ", ".join(json.dumps(choice) for choice in typing.get_args(bare))
    elif bare in (float, int):
        words = "a finite number" if bare is float else "a whole number"
        bounds = [
            f"{_BOUNDS[type(bound)][0]} {getattr(bound, _BOUNDS[type(bound)][1]):g}"
            for bound in constraints
            if type(bound) in _BOUNDS
        ]
        words += f" {' and '.join(bounds)}" if bounds else ""
    elif bare is bool:
        words = "true or false"
    elif bare is str:
        words = "a text" + (" of at least one character" if any(isinstance(c, MinLen) for c in constraints) else "")
    elif _is_model(bare):
        words = f"a group of the fields {', '.join(bare.model_fields)}"
    elif typing.get_origin(bare) in (dict, list):
        words = "a group of fields" if typing.get_origin(bare) is dict else "a list"
        words += " with at least one entry" if any(isinstance(c, MinLen) for c in constraints) else ""
    elif typing.get_origin(bare) is tuple:
        arguments = typing.get_args(bare)
        many = Ellipsis in arguments
        item = _bare(arguments[0])
        things = "numbers" if item is float else "texts" if item is str else "pairs of numbers [x, y]"
        if _is_model(item):
            things = f"groups of the fields {', '.join(item.model_fields)}"
        least = next((c.min_length for c in constraints if isinstance(c, MinLen)), 0)
        most = next((c.max_length for c in constraints if isinstance(c, MaxLen)), None)
        count = f"{least} to {most} " if many and most else "" if many else f"{len(arguments)} "
        words = f"a list of {count}{things}"
    return prefix + words if words else ""


_TAG_FIELDS = ("kind", "formulation", "law")
"""Fields that tell which of several models a group is."""

_BOUNDS: dict[type, tuple[str, str]] = {
    Gt: ("greater than", "gt"),
    Ge: ("at least", "ge"),
    Lt: ("less than", "lt"),
    Le: ("at most", "le"),
}


def _constraints(annotation: Any) -> list[Any]:
    found: list[Any] = []
    while typing.get_origin(annotation) is typing.Annotated:
        annotation, *extra = typing.get_args(annotation)
        for item in extra:
            found += getattr(item, "metadata", None) or [item]
    return found


def _plain(problem: Any) -> str:
    message = str(problem["msg"])
    return message[0].lower() + message[1:]


def _shown(value: Any) -> str:
    try:
        text = json.dumps(value, ensure_ascii=False)
    except (TypeError, ValueError):
        text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
