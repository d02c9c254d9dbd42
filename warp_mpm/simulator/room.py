"""A room: ideas of one kind by their names, those of the package and those that a script brings along."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from types import CodeType, FunctionType
from typing import Any, ClassVar, Generic, Protocol, TypeVar


class Idea(Protocol):
    """What stands in a room."""

    name: ClassVar[str]


T = TypeVar("T", bound=Idea)


class Room(Generic[T]):
    """Ideas of one kind.

    Each has a key, by which kernels are compiled and kept apart: its name, and of a script's idea its content besides,
    so that two of the same name never share a compiled module.
    """

    def __init__(self, kind: str, own: Iterable[T]):
        self._kind = kind
        self._by_name = {idea.name: idea for idea in own}
        self._by_key: dict[str, T] = dict(self._by_name)
        self._keys = {name: name for name in self._by_name}
        self._own = frozenset(self._by_name)

    def __iter__(self) -> Iterator[T]:
        return iter(self._by_name.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the order in which they came."""
        return tuple(self._by_name)

    def add(self, idea: T) -> None:
        """Take in an idea of a script; one of the same name that came before gives way.

        Raises:
            ValueError: the name is no name, or one of the package's own.
        """
        name = getattr(idea, "name", None)
        if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise ValueError(f"the {self._kind}'s name = {name!r} must be small letters, digits and underscores")
        if name in self._own:
            raise ValueError(f"the {self._kind} {name!r} is one of the package's own; yours must have another name")
        key = f"{name}-{content(idea)}"
        if self._keys.get(name) == key:
            return  # the same again: scenes that were made with it stay valid
        self._by_name[name] = self._by_key[key] = idea
        self._keys[name] = key

    def named(self, name: str) -> T:
        """The idea that a scenario names."""
        return self._by_name[name]

    def key(self, name: str) -> str:
        """Key of the idea that now has this name."""
        return self._keys[name]

    def keyed(self, key: str) -> T:
        """The idea of a key, though another may have taken over its name."""
        return self._by_key[key]


def content(idea: Any) -> str:
    """A hash of all that an idea of a script consists of: its methods, what they name beside them, its own numbers.

    Of the compiled code, which is there even where the source is not, as for a class of a notebook.
    """
    digest = hashlib.sha256()
    seen: set[Any] = set()

    def take(value: Any) -> None:
        value = getattr(value, "func", value)  # of a Warp function
        if isinstance(value, property):
            value = value.fget
        elif isinstance(value, staticmethod | classmethod):
            value = value.__func__
        if isinstance(value, FunctionType | type):
            if value in seen or value.__module__.partition(".")[0] in _KNOWN:
                return
            seen.add(value)
        if isinstance(value, FunctionType):
            for name in sorted(take_code(value.__code__)):
                if name in value.__globals__:
                    digest.update(name.encode())
                    take(value.__globals__[name])
            for cell in value.__closure__ or ():
                take(cell.cell_contents)
        elif isinstance(value, type):
            for base in value.__bases__:
                take(base)
            for name, member in sorted(vars(value).items()):
                if not name.startswith("__"):
                    digest.update(name.encode())
                    take(member)
        elif isinstance(value, Mapping):
            take(list(value.items()))
        elif isinstance(value, list | tuple):
            digest.update(b"[")
            for item in value:
                take(item)
        elif isinstance(value, bool | int | float | str | bytes | None):
            digest.update(repr(value).encode())

    def take_code(code: CodeType) -> set[str]:
        """Take in a function's code; return the names of others that it uses."""
        digest.update(code.co_code + repr(code.co_varnames).encode())
        names = set(code.co_names)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                names |= take_code(constant)
            else:
                digest.update(repr(constant).encode())
        return names

    take(type(idea))
    take(getattr(idea, "__dict__", {}))
    return digest.hexdigest()[:12]


_KNOWN = {"builtins", "warp_mpm", "warp", "pydantic", "typing", "abc", "numpy"}
"""Packages whose classes and functions are not part of a script."""
