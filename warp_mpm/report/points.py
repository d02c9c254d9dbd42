"""Snapshots packed for the viewer: 16-bit numbers, thinned to a budget, compressed."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.fields import FIELDS, colour_limits, field_values, solid_density_of
from warp_mpm.quantities.points import Drawn
from warp_mpm.results import Results
from warp_mpm.scenario import Scenario
from warp_mpm.snapshot import Snapshot

Array = NDArray[np.float64]

LEVELS = 65535
"""Steps into which the range of each quantity is divided."""


def packed(results: Results, budget: int, times: Sequence[float]) -> tuple[dict[str, Any], str]:
    """The snapshots of a run as a description and a text (base64 of zlib of little-endian unsigned 16-bit numbers).

    The numbers run by frame, in it by quantity (x, y, then the fields), in it by point; 0 to 65535 span the
    quantity's range.

    Args:
        results: of the run.
        budget: most bytes before compression; beyond it frames are left out down to 60, then points.
        times: [s] of snapshots that are kept in any case.
    """
    snapshots = results.snapshots
    numbers = [len(snapshot.position) for snapshot in snapshots]
    per_point = 2 * (2 + len(_fields(results.scenario, snapshots[0])))

    whole = per_point * sum(numbers)
    frame_stride = max(1, min(-(-whole // budget), len(numbers) // 60))
    kept = set(range(0, len(numbers), frame_stride)) | {len(numbers) - 1}
    kept |= {int(np.argmin(np.abs(snapshots.times - time))) for time in times}
    frames = sorted(kept)
    size = per_point * sum(numbers[frame] for frame in frames)
    point_stride = max(1, -(-size // budget))

    moved = ((snapshots[frame], results.barrier_displacements(snapshots[frame])) for frame in frames)
    description, blob = packed_frames(results.scenario, moved, point_stride)
    return description | {"frame_stride": frame_stride}, blob


def packed_frames(
    scenario: Scenario, frames: Iterable[tuple[Snapshot, Mapping[str, float]]], point_stride: int
) -> tuple[dict[str, Any], str]:
    """Snapshots and the displacements of the barriers at their times [m], by name, packed as of `packed`.

    Args:
        scenario: of the run.
        frames: at least one.
        point_stride: of so many points one is kept.
    """
    fields: list[Drawn] = []
    quantities: list[list[Array]] = []
    times: list[float] = []
    shifts: list[list[float]] = []
    for snapshot, moved in frames:
        if not times:
            fields = _fields(scenario, snapshot)
            quantities = [[] for _ in range(2 + len(fields))]
        times.append(snapshot.time)
        shifts.append([moved.get(name, 0.0) for name, _, _ in scenario.all_barriers])
        solid_density = solid_density_of(scenario, snapshot)
        columns = [*snapshot.position.T, *(field_values(snapshot, field.name, solid_density) for field in fields)]
        for column, values in zip(quantities, columns, strict=True):
            assert values is not None
            column.append(values[::point_stride])

    ranges = [_range(column) for column in quantities]
    parts = []
    for index in range(len(times)):
        for column, (low, high) in zip(quantities, ranges, strict=True):
            share = (np.nan_to_num(column[index], nan=low) - low) / (high - low)
            parts.append(np.rint(np.clip(share, 0.0, 1.0) * LEVELS).astype("<u2").tobytes())
    description = {
        "times": [round(time, 6) for time in times],
        "shifts": shifts,
        "counts": [len(values) for values in quantities[0]],
        "ranges": ranges,
        "fields": [
            {
                "name": field.name,
                "label": field.words,
                "unit": field.shown_unit,
                "signed": field.signed,
                "scale": colour_limits(np.concatenate(column), field.signed),
            }
            for field, column in zip(fields, quantities[2:], strict=True)
        ],
        "diameter": _diameter(scenario, point_stride),
        "point_stride": point_stride,
        "window": _window(quantities[0], quantities[1]),
        "start": [float(side(axis[0])) for axis in quantities[:2] for side in (np.min, np.max)],
    }
    return description, base64.b64encode(zlib.compress(b"".join(parts), 9)).decode("ascii")


def _fields(scenario: Scenario, snapshot: Snapshot) -> list[Drawn]:
    """Those that a snapshot has."""
    solid_density = solid_density_of(scenario, snapshot)
    return [field for field in FIELDS if field_values(snapshot, field.name, solid_density) is not None]


def _range(column: Iterable[Array]) -> tuple[float, float]:
    values = np.concatenate(list(column))
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return low, high if high > low else low + 1.0


def _diameter(scenario: Scenario, point_stride: int) -> float:
    """Diameter [m] with which the points of the undeformed flow cover it."""
    numerics = scenario.numerics
    return 1.3 * numerics.spacing_m * (point_stride / numerics.points_per_cell) ** 0.5


def _window(x: Iterable[Array], y: Iterable[Array]) -> tuple[float, float, float, float]:
    """left, right, bottom, top [m] around all but the stray points of a jet, which a reader finds by zooming out."""
    xs, ys = np.concatenate(list(x)), np.concatenate(list(y))
    left, right = np.quantile(xs, [0.01, 0.99])
    bottom, top = np.quantile(ys, [0.01, 0.99])
    return float(left), float(right), float(bottom), float(top)
