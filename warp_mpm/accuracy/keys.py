"""What evidence rests on: keys of runs and of scenes, by what was asked and by the code that answered.

A key holds the value of every field that the shipped ladders were taken with, and of any newer field only where it
differs from its default. So an optional field that is new in the schema leaves all keys as they were, and a default
that changes does not. The code counts as the modules that a measurement really imports, without comments, docstrings
and the schema's declarations, whose outcome the fields' values hold.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import resources, util
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from warp_mpm.scenario import Scenario

DATA = "paper_scenes.json"
"""Shipped ladders, beside this file; `fields` lists what their keys hold."""

MEASUREMENT = "warp_mpm.accuracy.measure"
"""The module whose imports decide the numbers of a study."""

RULES = ("warp_mpm.summary", "warp_mpm.mechanism", "warp_mpm.accuracy.measure", "analytic.force_record")
"""Modules that make figures of a run: a ladder whose figures were made by other rules is of no use."""

_PACKAGES = ("warp_mpm", "analytic")
_SCHEMA = "warp_mpm.scenario"
_WORDS = ("title", "source", "notes")
_OTHER_THAN_THE_SCENE = ("numerics.", "output.", "design")


def run_key(scenario: Scenario) -> str:
    """A hash of all that decides the numbers of a run: the scene, its numerics, and the program that computes them."""
    return _hash(_counting(scenario) | {"program": program_digest()})


def scene_key(scenario: Scenario, fields: frozenset[str] | None = None) -> str:
    """A hash of the scene and its end time alone, whatever the numerics and the output.

    Args:
        scenario: the scene.
        fields: that count whatever their values; None for those of the shipped ladders.
    """
    counting = _counting(scenario, fields)
    kept = {path: value for path, value in counting.items() if not path.startswith(_OTHER_THAN_THE_SCENE)}
    return _hash(kept | {"output.end_time_s": scenario.output.end_time_s})


@cache
def program_digest() -> str:
    """A hash of the code that steps, samples and measures a simulation, as it was when first asked for."""
    return code_digest(sorted(imported_by(MEASUREMENT)))


@cache
def rules_digest() -> str:
    """A hash of the code that makes figures of a run."""
    return code_digest(RULES)


def scenario_fields(scenario: Scenario) -> list[str]:
    """Dotted paths of all fields of a scenario that count in its key."""
    return [path for path, _, _ in _leaves(scenario, "") if path not in _WORDS]


def imported_by(module: str) -> set[str]:
    """The project's own modules that `module` imports, itself and all that these import, wherever they do it."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _imports(name)
    return found


def code_digest(modules: Sequence[str]) -> str:
    """A hash of what the modules do; see this module's docstring for what does not count."""
    digest = hashlib.sha256()
    for name in modules:
        path = _source(name)
        assert path is not None, name
        digest.update(code_text(path.read_text(encoding="utf-8"), schema=name.startswith(_SCHEMA)).encode())
    return digest.hexdigest()[:12]


@cache
def code_text(source: str, *, schema: bool) -> str:
    """Source code without comments and docstrings and, in the schema's classes, without declarations of fields."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            fields = schema and isinstance(node, ast.ClassDef)
            node.body = [part for part in node.body if not (_is_text(part) or (fields and _declares(part)))]
            node.body = node.body or [ast.Pass()]
    return ast.unparse(tree)


def _is_text(part: ast.stmt) -> bool:
    return isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant) and isinstance(part.value.value, str)


def _declares(part: ast.stmt) -> bool:
    return isinstance(part, ast.AnnAssign)


def _counting(scenario: Scenario, fields: frozenset[str] | None = None) -> dict[str, Any]:
    """Values by path, of the fields that count."""
    recorded = _recorded_fields() if fields is None else fields
    return {
        path: value
        for path, value, default in _leaves(scenario, "")
        if path not in _WORDS and (path in recorded or value != default)
    }


def _leaves(model: BaseModel, prefix: str) -> Iterator[tuple[str, Any, Any]]:
    """(path, value, default) of every field that is no group of fields; a field without a default has one that no
    value equals. A group that is absent is a value."""
    for name, declared in type(model).model_fields.items():
        path, value = f"{prefix}{name}", getattr(model, name)
        if isinstance(value, BaseModel):
            yield from _leaves(value, f"{path}.")
        else:
            default = declared.get_default(call_default_factory=True, validated_data={})
            yield path, value, default if default is not PydanticUndefined else object()


@cache
def _recorded_fields() -> frozenset[str]:
    file = resources.files("warp_mpm.accuracy") / DATA
    content = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    return frozenset(content.get("fields", ()))


@cache
def _imports(module: str) -> tuple[str, ...]:
    path = _source(module)
    if path is None:
        return ()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = util.resolve_name("." * node.level + (node.module or ""), package) if node.level else node.module
            assert base is not None
            # What is imported from a package may be a module of it.
            found += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    parents = [".".join(name.split(".")[:depth]) for name in found for depth in range(1, name.count(".") + 2)]
    return tuple(dict.fromkeys(name for name in parents if _source(name) is not None))


@cache
def _source(module: str) -> Path | None:
    """The file of a module of the project; None for any other name."""
    first, *rest = module.split(".")
    if first not in _PACKAGES:
        return None
    base = Path(__file__).parents[2] / first
    place = base.joinpath(*rest)
    for path in (place / "__init__.py", place.with_suffix(".py")):
        if path.is_file():
            return path
    return None


def _hash(values: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()[:20]
