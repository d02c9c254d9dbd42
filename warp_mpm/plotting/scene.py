"""A scene before anything moves, to scale and with its measures (the paper's Figs. 2 and 3)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from warp_mpm import geometry
from warp_mpm.extent import domain_extent
from warp_mpm.plotting.site import draw_barriers, draw_flow, draw_ground, lowest, stream
from warp_mpm.plotting.style import BLUE, EDGE, GREY, heading
from warp_mpm.quantities.quantity import of_width
from warp_mpm.scenario import Scenario, Trapezoid, Wall
from warp_mpm.scenario.settings import STANDARD_GRAVITY
from warp_mpm.scenario.site import all_standing

PAGE, BESIDE, BELOW = 9.0, (0.8, 0.15), 0.55
"""Width of the figure, and room for what stands to the left, right and below of its panel [inches]."""

TALLEST = 7.0
"""Greatest height of the panel [inches]."""

DOMAIN_TALLEST = 4.0
"""The same of the panel of the domain."""

BARRIER_NAME = "barrier"
"""Of the first one."""

STEP, LABEL = 0.26, 3.6
"""From one line of measures to the next [inches]; the width of a label in such steps."""


def scene(scenario: Scenario, *, domain: bool = False) -> Figure:
    """Ground, flow and barriers with depth, length, distance, widths, height and face angle; gravity where tilted.

    Args:
        scenario: any.
        domain: below it, the whole domain that a run would get, to scale too.
    """
    flow = np.concatenate(scenario.flow.outlines)
    inflow = scenario.flow.inflow
    if inflow is not None:
        flow = np.concatenate([flow, stream(inflow)])
    left, right = float(flow[:, 0].min()), float(flow[:, 0].max())
    bottom, high = min(0.0, float(flow[:, 1].min())), float(flow[:, 1].max())
    shape = scenario.barrier.shape if scenario.barrier is not None else None
    tilted = scenario.gravity.tilt_deg != 0.0 and scenario.gravity.acceleration_m_per_s2 > 0.0
    # Room for the measures around what is drawn to scale [steps].
    before, behind, above, below = 1.5, 1.5, 2.0, 2.0
    if shape is not None:
        behind, below = 1.0 + LABEL, 4.6
        right = max(right, 0.0)
    for name, x, _, standing in all_standing(scenario):
        right = max(right, x)
        if standing is not None:
            right, high = max(right, float(standing[:, 0].max())), max(high, float(standing[:, 1].max()))
            left = min(left, float(standing[:, 0].min()))
            above = above if name == BARRIER_NAME else max(above, 3.0)
    bottom = min(bottom, lowest(scenario, left, right))
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
    draw_ground(panel, scenario, left, right, floor)
    draw_flow(panel, scenario)
    if scenario.flow.shape is not None:
        _flow_measures(panel, scenario, bottom, step)
    for deposit in scenario.flow.deposits:
        _deposit_measures(panel, deposit.shape.polygon, bottom, step)
    if inflow is not None:
        _inflow_measures(panel, scenario, bottom, step)
    draw_barriers(panel, scenario, {}, right, ceiling)
    if isinstance(shape, Trapezoid):
        _barrier_measures(panel, shape, bottom, step)
    elif isinstance(shape, Wall):
        panel.text(0.5 * right, 0.5 * high, "wall\nwithout end", ha="center", va="center", fontsize=9)
    for name, x, barrier, standing in all_standing(scenario):
        if name != BARRIER_NAME and standing is not None and isinstance(barrier.shape, Trapezoid):
            top = standing[int(np.argmax(standing[:, 1]))]
            words = f"{name}: x = {x:g} m,\nH = {barrier.shape.base_crest_height[2]:.3g} m, {barrier.motion.kind}"
            panel.text(top[0], top[1] + 0.4 * step, words, fontsize=8, ha="center", va="bottom")
    if tilted:
        _gravity(panel, scenario, (left + 3.0 * step, ceiling - 0.5 * step), step)
    below_it = _domain(figure, scenario) if domain else None
    _set_sizes(figure, panel, (ceiling - floor) / metres_per_inch, scenario, below_it)
    return figure


def _domain(figure: Figure, scenario: Scenario) -> tuple[Axes, float]:
    """A panel with the whole domain, and how tall it is [inches]."""
    edges = domain_extent(scenario).edges
    margin = 0.03 * max(edges.right - edges.left, edges.top - edges.bottom)
    left, right = edges.left - margin, edges.right + margin
    floor, ceiling = edges.bottom - margin, edges.top + margin
    panel = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlabel="x [m]", ylabel="y [m]", aspect="equal", label="domain")
    panel.set(xlim=(left, right), ylim=(floor, ceiling))
    draw_ground(panel, scenario, left, right, floor)
    draw_flow(panel, scenario, linewidth=0.6)
    draw_barriers(panel, scenario, {}, right, ceiling)
    size = (edges.right - edges.left, edges.top - edges.bottom)
    panel.add_patch(
        Rectangle((edges.left, edges.bottom), *size, fill=False, edgecolor=EDGE, linestyle="--", linewidth=0.9)
    )
    for side, x in (("left", edges.left), ("right", edges.right)):
        if getattr(scenario.domain, f"{side}_edge") == "wall":
            panel.plot([x, x], [edges.bottom, edges.top], color=EDGE, linewidth=2.5)
    panel.set_title("domain, dashed: what crosses an open edge leaves and is counted", fontsize=9, loc="left")
    tall = (PAGE - sum(BESIDE)) * (ceiling - floor) / (right - left)
    return panel, min(tall, DOMAIN_TALLEST)


def _set_sizes(
    figure: Figure, panel: Axes, tall: float, scenario: Scenario, below_it: tuple[Axes, float] | None = None
) -> None:
    """Title and facts above the panel, which is `tall` [inches], and a figure that holds it all.

    By hand: matplotlib's layouts do not know beforehand how tall a panel to scale becomes, and cut its title off.
    """
    title = heading(figure, scenario.title)
    panel.set_position((BESIDE[0] / PAGE, 0.1, 1.0 - sum(BESIDE) / PAGE, 0.5))
    facts = panel.set_title(_facts(scenario), fontsize=9, loc="left", wrap=True)
    renderer = FigureCanvasAgg(figure).get_renderer()
    title_tall, facts_tall = (text.get_window_extent(renderer).height / figure.dpi for text in (title, facts))
    lower = 0.0 if below_it is None else BELOW + below_it[1] + 0.3
    height = lower + BELOW + tall + facts_tall + title_tall + 0.35
    figure.set_size_inches(PAGE, height)
    wide = 1.0 - sum(BESIDE) / PAGE
    panel.set_position((BESIDE[0] / PAGE, (lower + BELOW) / height, wide, tall / height))
    if below_it is not None:
        below_it[0].set_position((BESIDE[0] / PAGE, BELOW / height, wide, below_it[1] / height))
    title.set_y(1.0 - 0.1 / height)


def _facts(scenario: Scenario) -> str:
    material, gravity = scenario.flow.material, scenario.gravity.acceleration_m_per_s2
    facts = [f"flow: V = {scenario.flow.volume:g} m³/m, n = {material.porosity:g}, ρ = {material.density:,.0f} kg/m³"]
    if scenario.barrier is not None:
        facts.append(f"barrier: {scenario.barrier.motion.kind}")
    if scenario.ground is not None:
        friction = scenario.ground.friction
        if scenario.ground.stretches:
            facts.append(
                f"ground: friction tan $φ_b$ = {', '.join(f'{one:g}' for _, one in scenario.ground.frictions)}"
            )
        else:
            facts.append(f"ground: friction tan $φ_b$ = {friction:g}" if friction > 0.0 else "ground: smooth")
    if gravity != STANDARD_GRAVITY:
        facts.append(f"g = {gravity:g} m/s²")
    return "; ".join(facts)


def _flow_measures(panel: Axes, scenario: Scenario, bottom: float, step: float) -> None:
    flow = scenario.flow.polygon
    (tail, low), (front, highest) = flow.min(axis=0), flow.max(axis=0)
    speed = math.hypot(*scenario.flow.velocity_m_per_s)
    if speed > 0.0:
        along_x, along_y = (2.5 * step * component / speed for component in scenario.flow.velocity_m_per_s)
        start = (float(flow[:, 0].mean()) - 0.5 * along_x, highest + step)
        end = (start[0] + along_x, start[1] + along_y)
        panel.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6})
        panel.text(max(start[0], end[0]) + 0.3 * step, end[1], f"{speed:.4g} m/s", fontsize=9, va="center")
    _measure(panel, (tail, bottom - step), (front, bottom - step), f"{front - tail:.3g} m")
    deepest, under, over = float(flow[flow[:, 1] == highest, 0].mean()), low, highest
    if scenario.ground is not None and not scenario.ground.level:
        deepest, under, over = _deepest(flow)
    _measure(panel, (deepest, under), (deepest, over), f"h = {geometry.maximum_depth(flow):.4g} m", step)
    if scenario.barrier is not None and front < -1e-9:
        _measure(panel, (front, bottom - 2.3 * step), (0.0, bottom - 2.3 * step), f"d = {-front:.3g} m")


def _deposit_measures(panel: Axes, outline: geometry.Polygon, bottom: float, step: float) -> None:
    (left, _), (right, high) = outline.min(axis=0), outline.max(axis=0)
    _measure(panel, (left, bottom - step), (right, bottom - step), f"{right - left:.3g} m")
    words = f"deposit, {geometry.maximum_depth(outline):.3g} m"
    panel.text(0.5 * (left + right), high + 0.2 * step, words, ha="center", va="bottom", fontsize=9)


def _inflow_measures(panel: Axes, scenario: Scenario, bottom: float, step: float) -> None:
    """What is to be known of the inflow: from when to when, how much, how deep and fast at most, and where."""
    inflow = scenario.flow.inflow
    assert inflow is not None
    x, height = inflow.x_m, inflow.base + 0.5 * inflow.greatest_depth
    run = step / math.hypot(1.0, inflow.slope)
    rise = inflow.slope * run
    panel.annotate(
        "", (x + 2.0 * run, height + 2.0 * rise), (x - 0.5 * run, height - 0.5 * rise),
        arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6},
    )  # fmt: skip
    first, last = inflow.times[0], inflow.times[-1]
    words = (
        f"arrives from t = {first:.3g} to {last:.3g} s:\n{inflow.volume:.3g} {of_width('m³')}, "
        f"h ≤ {inflow.greatest_depth:.3g} m, v ≤ {inflow.greatest_speed:.3g} m/s"
    )
    outline = stream(inflow)
    panel.text(outline[:, 0].min(), outline[:, 1].max() + 0.3 * step, words, fontsize=9, va="bottom")
    if scenario.barrier is not None:
        _measure(panel, (x, bottom - 2.3 * step), (0.0, bottom - 2.3 * step), f"{-x:.3g} m")


def _deepest(flow: np.ndarray) -> tuple[float, float, float]:
    """x, lower and upper y [m] of the vertical on which the outline is thickest."""
    best = (float(flow[0, 0]), float(flow[0, 1]), float(flow[0, 1]))
    for x in np.linspace(flow[:, 0].min(), flow[:, 0].max(), 101)[1:-1]:
        heights = []
        for (x0, y0), (x1, y1) in zip(flow, np.roll(flow, -1, axis=0), strict=True):
            if (x0 > x) != (x1 > x):
                heights.append(y0 + (x - x0) * (y1 - y0) / (x1 - x0))
        heights.sort()
        for under, over in zip(heights[::2], heights[1::2], strict=True):
            if over - under > best[2] - best[1]:
                best = (float(x), float(under), float(over))
    return best


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
