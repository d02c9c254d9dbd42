"""Which spacings are sold: those that put the barrier's crest, or the flow's surface, on a line of the grid."""

from __future__ import annotations

import math

from warp_mpm.scenario import Scenario, Trapezoid

FINEST_CELLS = 120.0
"""Most cells in the flow's depth that are sold: errors were measured far coarser."""


def aligned(scenario: Scenario, spacing: float) -> float:
    """The nearest spacing that puts the barrier's crest on a grid line, or the flow's surface where that is higher.

    A crest between two grid lines is off by up to half a cell, at every spacing by another part of it.
    """
    length = _aligned_length(scenario)
    return length / max(round(length / spacing), 1)


def sold_spacings(scenario: Scenario, coarsest: float) -> list[float]:
    """Spacings that `aligned` gives, from the finest sold to the coarsest that was measured [m].

    Those that a scenario does not allow, for their number of points say, are not sold.
    """
    length = _aligned_length(scenario)
    first, last = math.ceil(length / coarsest - 1e-9), math.floor(FINEST_CELLS * length / scenario.flow.depth)
    rows = range(first, max(last, first) + 1)
    allowed, beyond = 0, len(rows)  # finer ones are not allowed where a coarser one is not
    while beyond - allowed > 1:
        middle = (allowed + beyond) // 2
        allowed, beyond = (middle, beyond) if _allowed(scenario, length / rows[middle]) else (allowed, middle)
    return [length / number for number in reversed(rows[: allowed + 1])]


def _allowed(scenario: Scenario, spacing: float) -> bool:
    try:
        scenario.replaced({"numerics.spacing_m": spacing})
    except ValueError:
        return False
    return True


def _aligned_length(scenario: Scenario) -> float:
    barrier = scenario.barrier
    depth = scenario.flow.depth
    # The rows of a crest below the surface would be too few to choose from.
    if barrier is not None and isinstance(barrier.shape, Trapezoid) and barrier.shape.base_crest_height[2] >= depth:
        return barrier.shape.base_crest_height[2]
    return depth
