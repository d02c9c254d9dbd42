"""HDF5 files that a run adds to: how they are opened again, brought to the disk, and what is said of their failures."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import h5py

from warp_mpm.recording.run_folder import RunFolderError

FILE_OPTIONS = {"libver": ("earliest", "v108"), "locking": False, "rdcc_nbytes": 0}
"""Newer versions of the format mark a file that is open for writing, and a mark left by a killed process bars readers.
Without a cache for chunks, numbers go to the file as they are written, not at some later flush."""


@contextlib.contextmanager
def reopened(path: Path) -> Iterator[h5py.File]:
    """The file, open for more; what shows in the block that it is not as it should be closes it again.

    Raises:
        RunFolderError: it cannot be read or is damaged.
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


def bring_to_disk(file: h5py.File, path: Path) -> None:
    """Whatever was written to the file, past the buffers of the system."""
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
