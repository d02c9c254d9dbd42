"""Standard output and standard error of the command lines, whatever they are connected to.

Text that the terminal's encoding lacks is spelled in ASCII; a stream that is closed (services, `2>&-`), full or broken
takes nothing more and ends no computation.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import sys
import unicodedata
from collections.abc import Callable, Iterator
from typing import Any

SPELLED = {
    **dict.fromkeys("–—−─━", "-"),
    **dict.fromkeys("Δ∆∂", "d"),
    **dict.fromkeys("′’‘", "'"),
    **dict.fromkeys("“”", '"'),
    "≥": ">=",
    "≤": "<=",
    "≈": "~",
    "→": "->",
    "±": "+-",
    "×": "x",
    "·": "*",
    "⁄": "/",
    "√": "sqrt",
    "∞": "inf",
    "∫": "int",
    "Σ": "sum",
    "°": " deg",
    "§": "sec. ",
    "…": "...",
}
"""Characters that Unicode does not decompose into those of ASCII; Greek letters go by their names."""

HANDLER = "spelled_in_ascii"


def spelled(character: str) -> str:
    """A character in ASCII: ₂ is 2, ≥ is >=, λ is lambda; ? where there is no way to spell it."""
    if character.isascii():
        return character
    if character in SPELLED:
        return SPELLED[character]
    name = unicodedata.name(character, "").split()
    if name[:3] == ["GREEK", "SMALL", "LETTER"]:
        return {"MU": "u", "LAMDA": "lambda"}.get(name[3], name[3].lower())
    parts = [part for part in unicodedata.normalize("NFKD", character) if not unicodedata.combining(part)]
    return "?" if parts == [character] else "".join(map(spelled, parts))


def _spell(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(spelled, error.object[error.start : error.end])), error.end


codecs.register_error(HANDLER, _spell)


class Outlet:
    """A standard stream that takes what it can: after its first failure it drops what is written, and no one fails."""

    def __init__(self, stream: Any):
        self._stream = stream
        self.failure: Exception | None = None
        """Why nothing more is written."""

    @property
    def encoding(self) -> str:
        """The stream's, but for ASCII: Typer would take that for a mistake and write UTF-8 past this outlet."""
        encoding = self._stream.encoding or "utf-8"
        return "latin-1" if codecs.lookup(encoding).name == "ascii" else encoding

    def write(self, text: str) -> int:
        """Write, or drop."""
        self._try(self._stream.write, text)
        return len(text)

    def flush(self) -> None:
        """Bring out what was written, or drop it."""
        self._try(self._stream.flush)

    def _try(self, action: Callable[..., Any], *arguments: Any) -> None:
        if self.failure is None:
            try:
                action(*arguments)
            except (OSError, ValueError) as error:  # a file that someone has closed is a ValueError
                self.failure = error

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def standard_streams() -> Iterator[Outlet]:
    """Let standard output and standard error be safe to write to; yields the former, whose `failure` tells of losses.

    Descriptors 0 to 2 that are closed are opened on nothing, or the next file that is opened would get their numbers,
    and with them what libraries print.
    """
    for number in (0, 1, 2):
        _occupy(number)
    before = sys.stdout, sys.stderr
    errors = []
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or stream.closed:
            stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - as long as the process
        if hasattr(stream, "reconfigure"):
            errors.append((stream, stream.errors))
            stream.reconfigure(errors=HANDLER)
        setattr(sys, name, Outlet(stream))
    output: Any = sys.stdout
    try:
        yield output
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for stream, handler in errors:
            with contextlib.suppress(OSError, ValueError):
                stream.reconfigure(errors=handler)
        if output.failure is None:
            sys.stdout, sys.stderr = before


def _occupy(number: int) -> None:
    try:
        os.fstat(number)
    except OSError:
        opened = os.open(os.devnull, os.O_RDWR)
        if opened != number:
            os.dup2(opened, number)
            os.close(opened)
        os.set_inheritable(number, True)


def printable(text: str) -> str:
    """The text with control characters, by which a file could command a terminal, and halves of characters as codes."""
    return "".join(
        character.encode("unicode_escape").decode()
        if unicodedata.category(character) in ("Cc", "Cs") and character not in "\n\t"
        else character
        for character in text
    )
