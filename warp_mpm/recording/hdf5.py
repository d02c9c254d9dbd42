"""What the recorders in HDF5 share: a file that opens whenever its process is killed, and what a disk refuses."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from warp_mpm.recording.run_folder import RunFolderError

FILE_OPTIONS = {"libver": ("earliest", "v108"), "locking": False, "rdcc_nbytes": 0}
"""Newer versions of the format mark a file that is open for writing, and a mark left by a killed process bars readers.
Without a cache for chunks, numbers go to the file as they are written, not at some later flush."""


def room_for(interval: float, end_time: float) -> int:
    """Most records that a run may make.

    Args:
        interval: between two of them [s].
        end_time: of the run [s]; its end is recorded too, on the interval or not.
    """
    return int(end_time / interval * (1.0 + 1e-9)) + 3


def created(path: Path) -> h5py.File:
    """A new file.

    Raises:
        FileExistsError: there is one already.
    """
    return h5py.File(path, "x", **FILE_OPTIONS)


@contextlib.contextmanager
def reopened(path: Path) -> Iterator[h5py.File]:
    """A file to go on with: open beyond the block, which looks whether it is whole, or closed where that fails.

    Raises:
        RunFolderError: it cannot be read, or the block finds that it is not what a recorder left.
    """
    file = None
    try:
        file = h5py.File(path, "r+", **FILE_OPTIONS)
        yield file
        file.flush()
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        if file is not None:
            file.close()
        if isinstance(error, OSError) and error.errno is not None:  # of the system, not of what is in the file
            raise RunFolderError(f"{path} cannot be read: {os.strerror(error.errno)}.") from None
        raise RunFolderError(f"{path} is damaged: {error}.") from None


def set_aside(
    group: h5py.Group,
    name: str,
    shape: tuple[int, ...],
    kind: type = np.float64,
    *,
    chunk: int | None = None,
    blank: bool = True,
) -> h5py.Dataset:
    """A data set whose room is laid down at once, so that filling it changes nothing in the file's structure.

    Args:
        group: that it belongs to.
        name: in the group.
        shape: of the room; the number of rows, which is the first, may be changed.
        kind: of its numbers.
        chunk: rows that lie together; None: all.
        blank: whether the room is filled with zeros first.
    """
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    if not blank:
        creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    rows, *columns = shape
    creation.set_chunk((chunk or rows, *columns))
    space = h5py.h5s.create_simple(shape, (h5py.h5s.UNLIMITED, *columns))
    numbers = h5py.h5t.py_create(np.dtype(kind), logical=True)
    return h5py.Dataset(h5py.h5d.create(group.id, name.encode(), numbers, space, dcpl=creation))


def fill(dataset: h5py.Dataset, begin: int, rows: np.ndarray) -> None:
    """Write rows from `begin` on, by HDF5's own call: h5py's indexing takes longer than the writing."""
    space = dataset.id.get_space()
    space.select_hyperslab((begin, *(0 for _ in rows.shape[1:])), rows.shape)
    dataset.id.write(h5py.h5s.create_simple(rows.shape), space, rows)


def bring_to_the_disk(file: h5py.File, path: Path) -> None:
    """Let a file survive the loss of power."""
    file.flush()
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def failures_of_the_disk() -> Iterator[None]:
    """HDF5 reports them as errors of any kind, with its whole life in the message."""
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:
        text = str(error)
        reason = text.partition("error message = '")[2].partition("'")[0]
        raise OSError(reason or text.partition("\n")[0]) from None
