"""Impact mechanisms over Froude number and relative height of the barrier (the paper's Fig. 1 and Table 3)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from warp_mpm.plotting.style import BLUE, GREEN, GREY, ORANGE, PURPLE, grid
from warp_mpm.results import Results, ResultsError
from warp_mpm.scenario import Trapezoid

MARKS = {
    "dead zone": ("s", PURPLE),
    "airborne jet": ("^", ORANGE),
    "standing jump": ("o", BLUE),
    "bore": ("D", GREEN),
    "none": ("x", GREY),
}
"""Mark and colour of each mechanism."""

WALL_HEIGHT = 12.0
"""H/h at which a wall without end is drawn."""


def mechanism_diagram(runs: Sequence[Results]) -> Figure:
    """The mechanism seen in each run, at the Froude number of its flow and the relative height of its barrier.

    Faug's boundaries between the mechanisms are not drawn: the paper gives them as a sketch without numbers.

    Raises:
        ResultsError: a run has no barrier, no summary, or no gravity to make a Froude number of.
    """
    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    panel = figure.subplots()
    seen: dict[str, tuple[list[float], list[float]]] = {}
    labels: dict[tuple[float, float], list[str]] = {}
    for results in runs:
        scenario, mechanism = results.scenario, results.summary.get("mechanism")
        gravity = scenario.gravity.acceleration_m_per_s2
        if scenario.barrier is None or mechanism is None or gravity == 0.0:
            raise ResultsError(f"{results.path} has no barrier or no gravity, so it has no place in the diagram.")
        froude = scenario.flow.speed / math.sqrt(gravity * scenario.flow.depth)
        shape = scenario.barrier.shape
        height = shape.base_crest_height[2] / scenario.flow.depth if isinstance(shape, Trapezoid) else WALL_HEIGHT
        xs, ys = seen.setdefault(mechanism, ([], []))
        xs.append(froude)
        ys.append(height)
        labels.setdefault((round(froude, 2), round(height, 2)), []).append(results.path.resolve().name)
    for mechanism, (xs, ys) in seen.items():
        mark, colour = MARKS.get(mechanism, ("*", GREY))
        panel.plot(xs, ys, mark, color=colour, markersize=9, label=mechanism, linestyle="none")
    for (x, y), names in labels.items():
        panel.annotate(", ".join(names), (x, y), xytext=(8, 5), textcoords="offset points", fontsize=8)
    if any(y == WALL_HEIGHT for _, ys in seen.values() for y in ys):
        panel.axhline(WALL_HEIGHT, color=GREY, linewidth=0.6, linestyle=":")
        panel.text(0.0, WALL_HEIGHT, " H/h = ∞ (wall without end)", fontsize=8, va="bottom", color=GREY)
    panel.set_xlim(left=0.0, right=1.25 * max(x for xs, _ in seen.values() for x in xs) + 0.5)
    panel.set_ylim(bottom=0.0, top=1.12 * max(y for _, ys in seen.values() for y in ys) + 0.5)
    panel.set_xlabel(r"Froude number $v / \sqrt{g h}$ [-]")
    panel.set_ylabel("relative height $H/h$ [-]")
    panel.legend(fontsize=9, title="seen in the simulation", title_fontsize=8)
    grid(panel)
    return figure
