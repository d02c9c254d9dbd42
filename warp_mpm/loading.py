"""What makes the start of a run shorter."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_garbage() -> Iterator[None]:
    """Where some hundred thousand objects are made that all stay: looking for garbage among them, again and again,
    takes a tenth of the start of a run."""
    looked = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looked:
            gc.enable()
