"""A scene before anything moves, to scale and with its measures (the paper's Figs. 2 and 3)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.patches import Rectangle

from warp_mpm.geometry import Polygon
from warp_mpm.plotting.style import BARRIER, BLUE, EDGE, GREY, GROUND, heading
from warp_mpm.scenario import Scenario, Trapezoid, Wall
from warp_mpm.scenario.settings import STANDARD_GRAVITY

PAGE, BESIDE, BELOW = 9.0, (0.8, 0.15), 0.55
"""Width of the figure, and room for what stands to the left, right and below of its panel [inches]."""

TALLEST = 7.0
"""Greatest height of the panel [inches]."""

STEP, LABEL = 0.26, 3.6
"""From one line of measures to the next [inches]; the width of a label in such steps."""


FLOW, DEPOSIT = "#9CC7E3", "#C9B79C"

SHOWN_UPSTREAM = 3.0
"""How much of what arrives is shown upstream of the section, over its greatest depth."""


def scene(scenario: Scenario) -> Figure:
    """Outline of flow and barrier with depth, length, distance, widths, height and face angle; gravity where tilted."""
    flow = np.concatenate(scenario.flow.outlines)
    left, right = float(flow[:, 0].min()), float(flow[:, 0].max())
    bottom, high = min(0.0, float(flow[:, 1].min())), float(flow[:, 1].max())
    inflow = scenario.flow.inflow
    if inflow is not None:
        left = min(left, inflow.x_m - SHOWN_UPSTREAM * inflow.greatest_depth)
    shape = scenario.barrier.shape if scenario.barrier is not None else None
    tilted = scenario.gravity.tilt_deg != 0.0 and scenario.gravity.acceleration_m_per_s2 > 0.0
    # Room for the measures around what is drawn to scale [steps].
    before, behind, above, below = 1.5, 1.5, 2.0, 2.0
    if shape is not None:
        behind, below = 1.0 + LABEL, 4.6
        right = max(right, 0.0)
    if isinstance(shape, Trapezoid):
        base, _, height = shape.base_crest_height
        right, high = max(right, base), max(high, height)
    if scenario.flow.velocity_m_per_s[1] > 0.0:
        above += 2.5 * scenario.flow.velocity_m_per_s[1] / math.hypot(*scenario.flow.velocity_m_per_s)
    if tilted:
        above += 3.0

    wide = PAGE - sum(BESIDE)
    metres_per_inch = max(
        (right - left) / (wide - STEP * (before + behind)), (high - bottom) / (TALLEST - STEP * (above + below))
    )
    step = STEP * metres_per_inch
    spare = 0.5 * (wide * metres_per_inch - (right - left) - step * (before + behind))
    left, right = left - before * step - spare, right + behind * step + spare
    floor, ceiling = bottom - below * step, high + above * step

    figure = Figure(figsize=(PAGE, PAGE))
    panel = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlabel="x [m]", ylabel="y [m]", aspect="equal")
    panel.set(xlim=(left, right), ylim=(floor, ceiling))
    if scenario.ground is not None:
        panel.axhspan(floor, 0.0, color=GROUND, linewidth=0.0)
        panel.axhline(0.0, color=GREY, linewidth=0.8)
    if scenario.flow.shape is not None:
        panel.add_patch(PolygonPatch(scenario.flow.polygon, facecolor=FLOW, edgecolor=BLUE))
        _flow_measures(panel, scenario, bottom, step)
    for deposit in scenario.flow.deposits:
        panel.add_patch(PolygonPatch(deposit.shape.polygon, facecolor=DEPOSIT, edgecolor=EDGE))
        _deposit_measures(panel, deposit.shape.polygon, bottom, step)
    if inflow is not None:
        _inflow_measures(panel, scenario, bottom, step)
    if isinstance(shape, Trapezoid):
        panel.add_patch(PolygonPatch(shape.polygon, facecolor=BARRIER, edgecolor=EDGE))
        _barrier_measures(panel, shape, bottom, step)
    elif isinstance(shape, Wall):
        panel.add_patch(Rectangle((0.0, 0.0), right, ceiling, facecolor=BARRIER, edgecolor=EDGE))
        panel.text(0.5 * right, 0.5 * high, "wall\nwithout end", ha="center", va="center", fontsize=9)
    if tilted:
        _gravity(panel, scenario, (left + 3.0 * step, ceiling - 0.5 * step), step)
    _set_sizes(figure, panel, (ceiling - floor) / metres_per_inch, scenario)
    return figure


def _set_sizes(figure: Figure, panel: Axes, tall: float, scenario: Scenario) -> None:
    """Title and facts above the panel, which is `tall` [inches], and a figure that holds it all.

    By hand: matplotlib's layouts do not know beforehand how tall a panel to scale becomes, and cut its title off.
    """
    title = heading(figure, scenario.title)
    panel.set_position((BESIDE[0] / PAGE, 0.1, 1.0 - sum(BESIDE) / PAGE, 0.5))
    facts = panel.set_title(_facts(scenario), fontsize=9, loc="left", wrap=True)
    renderer = FigureCanvasAgg(figure).get_renderer()
    title_tall, facts_tall = (text.get_window_extent(renderer).height / figure.dpi for text in (title, facts))
    height = BELOW + tall + facts_tall + title_tall + 0.35
    figure.set_size_inches(PAGE, height)
    panel.set_position((BESIDE[0] / PAGE, BELOW / height, 1.0 - sum(BESIDE) / PAGE, tall / height))
    title.set_y(1.0 - 0.1 / height)


def _facts(scenario: Scenario) -> str:
    material, gravity = scenario.flow.material, scenario.gravity.acceleration_m_per_s2
    facts = [f"flow: V = {scenario.flow.volume:g} m³/m, n = {material.porosity:g}, ρ = {material.density:,.0f} kg/m³"]
    if scenario.barrier is not None:
        facts.append(f"barrier: {scenario.barrier.motion.kind}")
    if scenario.ground is not None:
        friction = scenario.ground.friction
        facts.append(f"ground: friction tan $φ_b$ = {friction:g}" if friction > 0.0 else "ground: smooth")
    if gravity != STANDARD_GRAVITY:
        facts.append(f"g = {gravity:g} m/s²")
    return "; ".join(facts)


def _flow_measures(panel: Axes, scenario: Scenario, bottom: float, step: float) -> None:
    flow = scenario.flow.polygon
    (tail, lowest), (front, highest) = flow.min(axis=0), flow.max(axis=0)
    speed = math.hypot(*scenario.flow.velocity_m_per_s)
    if speed > 0.0:
        along_x, along_y = (2.5 * step * component / speed for component in scenario.flow.velocity_m_per_s)
        start = (float(flow[:, 0].mean()) - 0.5 * along_x, highest + step)
        end = (start[0] + along_x, start[1] + along_y)
        panel.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6})
        panel.text(max(start[0], end[0]) + 0.3 * step, end[1], f"{speed:.4g} m/s", fontsize=9, va="center")
    _measure(panel, (tail, bottom - step), (front, bottom - step), f"{front - tail:.3g} m")
    deepest = float(flow[flow[:, 1] == highest, 0].mean())
    _measure(panel, (deepest, lowest), (deepest, highest), f"h = {scenario.flow.depth:g} m", step)
    if scenario.barrier is not None and front < -1e-9:
        _measure(panel, (front, bottom - 2.3 * step), (0.0, bottom - 2.3 * step), f"d = {-front:.3g} m")


def _deposit_measures(panel: Axes, outline: Polygon, bottom: float, step: float) -> None:
    (left, _), (right, high) = outline.min(axis=0), outline.max(axis=0)
    _measure(panel, (left, bottom - step), (right, bottom - step), f"{right - left:.3g} m")
    panel.text(0.5 * (left + right), high + 0.2 * step, f"deposit, {high:.3g} m", ha="center", va="bottom", fontsize=9)


def _inflow_measures(panel: Axes, scenario: Scenario, bottom: float, step: float) -> None:
    """The section with the depth that arrives there at most, and what else is to be known of the inflow."""
    inflow = scenario.flow.inflow
    assert inflow is not None
    x, low, depth = inflow.x_m, inflow.base_m, inflow.greatest_depth
    length = SHOWN_UPSTREAM * depth
    panel.add_patch(Rectangle((x - length, low), length, depth, facecolor=FLOW, edgecolor="none", alpha=0.5))
    panel.plot([x, x], [low, low + depth], color=BLUE, linewidth=1.6)
    height = low + 0.5 * depth
    panel.annotate(
        "", (x + 2.0 * step, height), (x - 0.5 * step, height),
        arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6},
    )  # fmt: skip
    first, last = inflow.times[0], inflow.times[-1]
    words = (
        f"arrives from t = {first:.3g} to {last:.3g} s:\n{inflow.volume:.3g} m³/m, h ≤ {depth:.3g} m, "
        f"v ≤ {inflow.greatest_speed:.3g} m/s"
    )
    panel.text(x - length, low + depth + 0.3 * step, words, fontsize=9, va="bottom")
    if scenario.barrier is not None:
        _measure(panel, (x, bottom - 2.3 * step), (0.0, bottom - 2.3 * step), f"{-x:.3g} m")


def _barrier_measures(panel: Axes, shape: Trapezoid, bottom: float, step: float) -> None:
    base, crest, height = shape.base_crest_height
    start = 0.5 * (base - crest)
    _measure(panel, (0.0, bottom - 3.6 * step), (base, bottom - 3.6 * step), f"B = {base:.3g} m")
    if crest > 0.0:
        _measure(panel, (start, height + 0.6 * step), (start + crest, height + 0.6 * step), f"b = {crest:.3g} m")
    # The angle stands in the toe where there is room below the face for it, else it is told beside the height.
    words, angle = f"H = {height:.3g} m", f"β = {shape.built_face_angle_deg:.1f}°"
    indent = (start / height + 0.3) * step
    if height >= step and base >= 2.0 * indent + LABEL * step:
        panel.text(indent, 0.25 * step, angle, fontsize=9)
    else:
        words += f"\n{angle}"
    beside = max(base + 0.8 * step, 0.5 * base + 1.6 * step)  # clear of the crest's label too
    panel.plot([start + crest, beside], [height, height], color=EDGE, linewidth=0.6, linestyle=":")
    _measure(panel, (beside, 0.0), (beside, height), words, step)


def _gravity(panel: Axes, scenario: Scenario, start: tuple[float, float], step: float) -> None:
    """Where gravity points, beside the vertical of the picture."""
    tilt = scenario.gravity.tilt_deg
    down = 2.2 * step
    along = (down * math.sin(math.radians(tilt)), -down * math.cos(math.radians(tilt)))
    panel.plot([start[0], start[0]], [start[1], start[1] - down], color=GREY, linewidth=0.8, linestyle=":")
    end = (start[0] + along[0], start[1] + along[1])
    panel.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": EDGE, "linewidth": 1.6, "shrinkA": 0})
    panel.text(
        start[0] + max(along[0], 0.0) + 0.5 * step,
        start[1] - 0.5 * down,
        f"g, tilted by {abs(tilt):g}°: the ground falls toward {'+x' if tilt > 0.0 else '-x'}",
        fontsize=9,
        va="center",
    )


def _measure(panel: Axes, start: tuple[float, float], end: tuple[float, float], words: str, room: float = 0.0) -> None:
    """An arrow with two heads; its label above, or beside an upright one, which may be lower than the `room` [m] that
    a label takes."""
    panel.annotate(
        "", end, start, arrowprops={"arrowstyle": "<->", "color": EDGE, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    )
    level = start[1] == end[1]
    place = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))
    if not level:
        place = (place[0], max(place[1], start[1] + 0.35 * room * (1 + words.count("\n"))))
    panel.annotate(
        words,
        place,
        xytext=(0, 3) if level else (4, 0),
        textcoords="offset points",
        ha="center" if level else "left",
        va="bottom" if level else "center",
        fontsize=9,
        color=EDGE,
    )
