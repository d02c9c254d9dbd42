"""Warp starts without words of its own."""

from __future__ import annotations

import os
import sys
import tempfile
from functools import cache

import warp as wp

from .cache import initialize_warp


@cache
def start_warp() -> None:
    """Start Warp without its banner, and without its warning that a machine has no GPU, which is no fault of anyone's.

    Warp prints that from C to the file descriptor, so that is where it is caught; anything else is passed on, also
    what another thread writes at the same time.
    """
    wp.config.log_level = wp.LOG_WARNING
    if sys.stderr is None:  # a service, or Windows without a console: nothing is shown anyway
        initialize_warp()
        return
    sys.stderr.flush()
    stderr = os.dup(2)
    try:
        with tempfile.TemporaryFile() as caught:
            os.dup2(caught.fileno(), 2)
            try:
                initialize_warp()
            finally:
                os.dup2(stderr, 2)
            caught.seek(0)
            for line in caught:
                if b"Could not find or load the NVIDIA CUDA driver" not in line:
                    os.write(2, line)
    finally:
        os.close(stderr)
