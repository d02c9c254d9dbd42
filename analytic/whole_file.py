"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path


class UnwrittenError(OSError):
    """A file that cannot be written; one sentence, with the name that the user gave."""

    def __str__(self) -> str:
        return f"{self.filename} cannot be written: {self.strerror}."


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """An empty file beside `path`, to be written into; at the end it takes the place of `path`, or is gone.

    Raises:
        UnwrittenError: it cannot be made, written or put in its place.
    """
    aside = path.with_name(path.name + ".new")
    try:
        aside.touch()
        yield aside
        aside.replace(path)
    except OSError as error:
        reason = error.strerror or str(error).partition("\n")[0]  # ffmpeg's goes on with all of its command
        raise UnwrittenError(error.errno, reason.rstrip("."), str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            aside.unlink()


def write_whole(path: Path, text: str) -> None:
    """Write a text, whole or not at all.

    Raises:
        UnwrittenError: it cannot be made, written or put in its place.
    """
    with whole_file(path) as aside:
        aside.write_text(text, encoding="utf-8")
