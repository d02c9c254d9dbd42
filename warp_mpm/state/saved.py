"""A simulation's state as bytes: a line of JSON that lists the arrays, then their numbers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

OF_NO_EFFECT = ("title", "source", "notes", "output", "design")
"""Parts of a scenario that a state does not depend on."""


def scene_mark(resolved: Mapping[str, Any]) -> NDArray[np.uint8]:
    """Check sum [32] of all in a resolved scenario that a state depends on."""
    scene = {name: part for name, part in resolved.items() if name not in OF_NO_EFFECT}
    return np.frombuffer(hashlib.sha256(json.dumps(scene, sort_keys=True).encode()).digest(), np.uint8)


def packed(state: Mapping[str, NDArray[Any]]) -> bytes:
    """The arrays as bytes, bit for bit."""
    # Joined from the arrays' own memory: a state may fill half of what there is.
    return b"".join([_listed(state), b"\n", *(np.ascontiguousarray(values).data for values in state.values())])


def unpacked(data: bytes, like: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The arrays of `packed`, which must be those of `like` in name, type and shape, and of its scene.

    Raises:
        ValueError: they are others, of another scene, or the data are damaged.
    """
    listed, _, numbers = data.partition(b"\n")
    if listed != _listed(like):
        raise ValueError("the state does not fit this scenario: its arrays are others, or of other sizes")
    if len(numbers) != sum(values.nbytes for values in like.values()):
        raise ValueError("the state is damaged: it is not as long as its arrays")
    state, begin = {}, 0
    for name, now in like.items():
        state[name] = np.frombuffer(numbers, now.dtype, now.size, begin).reshape(now.shape)
        begin += now.nbytes
    if not np.array_equal(state["scene"], like["scene"]):
        raise ValueError("the state does not fit this scenario: it belongs to another scene")
    return state


def _listed(state: Mapping[str, NDArray[Any]]) -> bytes:
    return json.dumps([[name, values.dtype.str, list(values.shape)] for name, values in state.items()]).encode()
