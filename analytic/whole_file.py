"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path


class UnwrittenError(OSError):
    """A file that cannot be written; one sentence, with the name that the user gave."""

    def __str__(self) -> str:
        return f"{self.filename} cannot be written: {self.strerror}."


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """An empty file beside `path`, to be written into; at the end it takes the place of `path`, or is gone.

    A link stays, and what it leads to is replaced. What is no file (a pipe, /dev/null) is written into.

    Raises:
        UnwrittenError: it cannot be made, written or put in its place.
    """
    with contextlib.ExitStack() as stack:
        try:
            target = path.resolve()
            if target.is_dir():  # said before the work, not after it
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            special = target.exists() and not target.is_file()
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory())) if special else target.parent
            aside = folder / (target.name + ".new")
            stack.callback(_remove, aside)
            aside.touch()
            yield aside
            if special:
                with aside.open("rb") as source, target.open("wb") as sink:
                    shutil.copyfileobj(source, sink)
            else:
                aside.replace(target)
        except OSError as error:
            reason = error.strerror or str(error).partition("\n")[0]  # ffmpeg's goes on with all of its command
            raise UnwrittenError(error.errno, reason.rstrip("."), str(path)) from None


def _remove(file: Path) -> None:
    with contextlib.suppress(OSError):
        file.unlink()


def write_whole(path: Path, text: str) -> None:
    """Write a text, whole or not at all.

    Raises:
        UnwrittenError: it cannot be made, written or put in its place.
    """
    with whole_file(path) as aside:
        aside.write_text(text, encoding="utf-8", errors="backslashreplace")
