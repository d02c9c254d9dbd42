"""A recorded impact force: its impulse, its moving mean, what stays of it, and when the impact is over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FILTER_WINDOW = 0.05
"""Length [s] of the moving mean of the filtered force."""

START_SHARE = 0.01
"""Share of the peak force at which the impact starts."""

END_SHARE = 0.1
"""Share of the peak's height over the residual force at which the impact is over."""

RESIDUAL_SHARE = 0.1
"""Last share of the record over which the residual force is taken."""

SETTLED_SHARE = 0.05
"""Share of the peak force below which a residual force has settled, however it changes."""

ROUNDING_SHARE = 1e-9
"""Share of the peak force by which a steady force may differ from itself."""


def cumulative_impulse(time: Array, force: Array) -> Array:
    """Impulse [N s/m] from the first time to each, of forces that are means over the interval before it."""
    return np.concatenate([[0.0], np.cumsum(force[1:] * np.diff(time))])[: len(time)]


def moving_mean(time: Array, force: Array, window: float = FILTER_WINDOW) -> Array:
    """Mean force [N/m] over `window` seconds around each time, over what there is of it at the ends of the record."""
    if window == 0.0 or len(time) < 2:
        return force
    impulse = cumulative_impulse(time, force)
    low = np.maximum(time - 0.5 * window, time[0])
    high = np.minimum(time + 0.5 * window, time[-1])
    return (np.interp(high, time, impulse) - np.interp(low, time, impulse)) / (high - low)


def filtered_peak(filtered: Array) -> int:
    """Place of the greatest filtered force; of places that differ by rounding alone the last."""
    peak = float(filtered.max())
    return int(np.flatnonzero(filtered >= peak - ROUNDING_SHARE * abs(peak))[-1])


def still_rises(filtered: Array) -> bool:
    """Whether a filtered force [N/m] is above nil and nowhere greater than where its record ends: what its peak will be
    is not known."""
    return len(filtered) > 0 and bool(filtered[-1] > 0.0) and filtered_peak(filtered) == len(filtered) - 1


@dataclass(frozen=True)
class ImpactEnd:
    """How an impact ends, as far as a record tells."""

    residual_force: float
    """Mean force over the last `RESIDUAL_SHARE` of the record [N/m]."""
    time: float
    """From which on the filtered force, less the residual one, stays below `END_SHARE` of its peak less that [s]; the
    end of the record where it never does."""
    over: bool
    """Whether that time lies before the last `RESIDUAL_SHARE`, and the force has settled by then. It has not where the
    residual force is above `SETTLED_SHARE` of the peak and, at the rate of its last change, would change by more than
    `END_SHARE` of the peak in as long as the impact has lasted: a longer record then shows another end."""


def impact_end(time: Array, force: Array, filtered: Array, start: float) -> ImpactEnd:
    """The end of an impact.

    Args:
        time: ends of the intervals [s], two at least, increasing, the first the start of the record.
        force: mean over the interval that ends then [N/m].
        filtered: its moving mean [N/m], somewhere above nil.
        start: time at which the impact starts [s].
    """
    impulse = cumulative_impulse(time, force)
    tenth = RESIDUAL_SHARE * float(time[-1] - time[0])
    tail = float(time[-1]) - tenth
    before, at_tail = np.interp([tail - tenth, tail], time, impulse)
    residual = float(impulse[-1] - at_tail) / tenth
    peak = float(filtered.max())
    to_come = abs(residual - float(at_tail - before) / tenth) / tenth * (float(time[-1]) - start)
    settled = residual <= SETTLED_SHARE * peak or to_come <= END_SHARE * peak
    level = max(residual, 0.0)
    above = np.flatnonzero(filtered >= level + END_SHARE * (peak - level) - ROUNDING_SHARE * peak)
    # The residual force is above the filtered peak where the force rises to the end: then nothing has fallen yet.
    last = int(above[-1]) if len(above) else len(time) - 1
    end = float(time[min(last + 1, len(time) - 1)])
    return ImpactEnd(residual, end, bool(settled) and end <= tail)
