"""What the fields of a model mean: the docstrings below them, read where somebody asks, as no run does.

Pydantic's own way to them (`use_attribute_docstrings`) reads the source of every model whenever it is imported.
"""

from __future__ import annotations

import ast
import inspect
import sys
from functools import cache
from typing import Any

from pydantic import BaseModel


def field_docstrings(model: type[BaseModel]) -> dict[str, str]:
    """The docstring of each field of a model that has one, its own or that of the base which declares the field.

    A model may name others in `fields_from`, out of which fields were put into it.
    """
    found: dict[str, str] = {}
    for name, field in model.model_fields.items():
        declared = next((base for base in model.__mro__ if name in inspect.get_annotations(base)), model)
        others = [other for other in getattr(model, "fields_from", ()) if name in other.model_fields]
        texts = [_of_class(declared).get(name), *(field_docstrings(other).get(name) for other in others)]
        text = field.description or next((text for text in texts if text), None)
        if text:
            found[name] = text
    return found


def _of_class(model: type) -> dict[str, str]:
    return _of_module(model.__module__).get(model.__qualname__, {})


@cache
def _of_module(name: str) -> dict[str, dict[str, str]]:
    """Docstrings of the fields of every class in a module, by the class's qualified name; none without a source."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[name]))
    except (KeyError, OSError, TypeError):  # typed in by hand
        return {}
    classes: dict[str, dict[str, str]] = {}
    _look_into(tree, "", classes)
    return classes


def _look_into(node: Any, path: str, classes: dict[str, dict[str, str]]) -> None:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ClassDef):
            classes[path + child.name] = {
                field.target.id: inspect.cleandoc(below.value.value)
                for field, below in zip(child.body, child.body[1:], strict=False)
                if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
                if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
                if isinstance(below.value.value, str)
            }
            _look_into(child, f"{path}{child.name}.", classes)
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            _look_into(child, f"{path}{child.name}.<locals>.", classes)
        else:
            _look_into(child, path, classes)
