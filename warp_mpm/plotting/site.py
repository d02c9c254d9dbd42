"""Ground and barriers of a scene as every picture draws them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.patches import Rectangle

from warp_mpm.plotting.style import BARRIER, BLUE, EDGE, GREY, GROUND
from warp_mpm.scenario import Inflow, Scenario
from warp_mpm.scenario.site import all_standing

WATER, DEPOSIT = "#9CC7E3", "#C9B79C"

SHOWN_UPSTREAM = 3.0
"""How much of what arrives is shown upstream of the section, over its greatest depth."""


def ground_line(scenario: Scenario, left: float, right: float) -> np.ndarray:
    """Points [V, 2] of the ground's surface between two x [m]; of a scene that has one."""
    ground = scenario.ground
    assert ground is not None
    inside = ground.profile[(ground.profile[:, 0] > left) & (ground.profile[:, 0] < right)]
    ends = [[x, float(ground.height(x))] for x in (left, right)]
    return np.concatenate([ends[:1], inside, ends[1:]])


def lowest(scenario: Scenario, left: float, right: float) -> float:
    """Lowest y [m] of the ground between two x; 0 where it is level, or absent."""
    ground = scenario.ground
    return 0.0 if ground is None or ground.level else float(ground_line(scenario, left, right)[:, 1].min())


def draw_ground(panel: Axes, scenario: Scenario, left: float, right: float, bottom: float) -> None:
    """The ground from its surface down to `bottom` [m], where the scene has one."""
    if scenario.ground is None:
        return
    if scenario.ground.level:
        panel.axhspan(bottom, 0.0, color=GROUND, linewidth=0.0)
        panel.axhline(0.0, color=GREY, linewidth=0.8)
        return
    line = ground_line(scenario, left, right)
    panel.fill_between(line[:, 0], line[:, 1], min(bottom, float(line[:, 1].min())), color=GROUND, linewidth=0.0)
    panel.plot(line[:, 0], line[:, 1], color=GREY, linewidth=0.8)


def stream(inflow: Inflow) -> np.ndarray:
    """Outline [4, 2] of what is shown of a flow that arrives, upstream of its section [m]."""
    depth = inflow.greatest_depth
    back = SHOWN_UPSTREAM * depth
    low = np.array([[inflow.x_m - back, inflow.base - inflow.slope * back], [inflow.x_m, inflow.base]])
    return np.concatenate([low, low[::-1] + np.array([0.0, depth])])


def draw_flow(panel: Axes, scenario: Scenario, linewidth: float = 1.0) -> None:
    """What is there at the start, what lies there, and the section of what arrives, at its greatest depth."""
    flow = scenario.flow
    for name, outline in flow.bodies:
        water, edge = (WATER, BLUE) if name == "flow.shape" else (DEPOSIT, EDGE)
        panel.add_patch(PolygonPatch(outline, facecolor=water, edgecolor=edge, linewidth=linewidth))
    if flow.inflow is not None:
        panel.add_patch(PolygonPatch(stream(flow.inflow), facecolor=WATER, edgecolor="none", alpha=0.5))
        draw_section(panel, flow.inflow, linewidth=1.6 * linewidth)


def draw_section(panel: Axes, inflow: Inflow, linewidth: float = 1.6, linestyle: str = "-") -> None:
    """The section at which a flow arrives, as high as it is deep at most."""
    foot, top = inflow.base, inflow.base + inflow.greatest_depth
    panel.plot([inflow.x_m, inflow.x_m], [foot, top], color=BLUE, linewidth=linewidth, linestyle=linestyle)


def draw_barriers(
    panel: Axes, scenario: Scenario, displacements: Mapping[str, float], right: float, high: float
) -> None:
    """Every barrier where it stands and, dotted, where it stood; a wall without end as far as `right` and `high` [m].

    Args:
        panel: to draw on.
        scenario: the scene.
        displacements: along x by name [m]; of those left out 0.
        right: right edge of the picture [m].
        high: upper edge of the picture [m].
    """
    for name, x, _, standing in all_standing(scenario):
        shift = displacements.get(name, 0.0)
        if standing is None:
            foot = 0.0 if scenario.ground is None else float(scenario.ground.height(x))
            width = max(right - x - shift, 0.0)
            panel.add_patch(Rectangle((x + shift, foot), width, high - foot, facecolor=BARRIER, edgecolor=EDGE))
            continue
        now = standing + np.array([shift, 0.0])
        panel.add_patch(PolygonPatch(now, facecolor=BARRIER, edgecolor=EDGE, linewidth=0.8))
        if abs(shift) > 0.002 * abs(panel.get_xlim()[1] - panel.get_xlim()[0]):
            panel.add_patch(PolygonPatch(standing, fill=False, edgecolor=GREY, linewidth=0.8, linestyle=":"))
