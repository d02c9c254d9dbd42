"""The cost of effects as bars."""

from __future__ import annotations

from matplotlib.figure import Figure

from warp_mpm.plotting.style import BLUE, GREY, ORANGE, grid


def effects_chart(costs: list[tuple[str, float, float]]) -> Figure:
    """Bars of what each effect adds, where the ones above it end.

    Args:
        costs: name, ratio to the yardstick with all effects so far, and cost [ns], in the order of their adding.
    """
    figure = Figure(figsize=(8.0, 0.34 * len(costs) + 1.2), layout="constrained")
    panel = figure.add_subplot()
    grid(panel)
    panel.set_axisbelow(True)
    before = 0.0
    for place, (_, ratio, _) in enumerate(costs):
        added = ratio - before
        colour = GREY if place == 0 else BLUE if added >= 0.0 else ORANGE
        panel.barh(place, added, left=before, color=colour)
        panel.text(max(ratio, before) + 0.06, place, f"{ratio:.2f}", va="center", fontsize=9)
        before = ratio
    panel.axvline(1.0, color="black", linewidth=1.0, linestyle="--")
    panel.text(1.0, -0.78, " the barest step", va="top", fontsize=8)
    panel.set_yticks(range(len(costs)), [name if k == 0 else f"+ {name}" for k, (name, _, _) in enumerate(costs)])
    panel.set_ylim(len(costs) - 0.4, -0.9)
    panel.set_xlim(0.0, 1.12 * max(ratio for _, ratio, _ in costs))
    panel.set_xlabel("cost per point and step, in yardsticks")
    return figure
