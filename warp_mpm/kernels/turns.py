"""What Warp does for one thread at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
S = TypeVar("S")


class _OnDevice(Protocol):
    @property
    def device(self) -> Any: ...


D = TypeVar("D", bound=_OnDevice)

WARP = threading.RLock()
"""Held around what Warp does for one thread at a time: to start, to build and load kernels, and to capture, during
which whatever another thread allocates or copies would be taken for part of the graph. Replaying a graph needs no
lock on the CPU; on a GPU all threads share one stream, so that there everything waits for its turn."""


def one_thread_at_a_time(
    method: Callable[Concatenate[S, P], R],
) -> Callable[Concatenate[S, P], R]:
    @wraps(method)
    def alone(self: S, *arguments: P.args, **named: P.kwargs) -> R:
        with WARP:
            return method(self, *arguments, **named)

    return alone


def one_thread_at_a_time_on_a_gpu(
    method: Callable[Concatenate[D, P], R],
) -> Callable[Concatenate[D, P], R]:
    @wraps(method)
    def alone(self: D, *arguments: P.args, **named: P.kwargs) -> R:
        if self.device.is_cpu:
            return method(self, *arguments, **named)
        with WARP:
            return method(self, *arguments, **named)

    return alone
