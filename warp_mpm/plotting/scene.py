"""A scene before anything moves, to scale and with its measures (the paper's Figs. 2 and 3)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.patches import Rectangle

from warp_mpm.plotting.style import BARRIER, BLUE, EDGE, GREY, GROUND
from warp_mpm.scenario import Scenario, Trapezoid, Wall


def scene(scenario: Scenario) -> Figure:
    """Outline of flow and barrier with depth, length, distance, widths, height and face angle."""
    flow = scenario.flow.polygon
    right, high = float(flow[:, 0].max()), float(flow[:, 1].max())
    shape = scenario.barrier.shape if scenario.barrier is not None else None
    if isinstance(shape, Trapezoid):
        base, _, height = shape.base_crest_height
        right, high = max(right, base), max(high, height)
    elif isinstance(shape, Wall):
        right, high = max(right, 2.5), 1.6 * high
    left, bottom = float(flow[:, 0].min()), min(0.0, float(flow[:, 1].min()))
    margin = 0.05 * (right - left)
    step = 0.035 * (right - left)  # between one line of measures and the next
    figure = Figure(figsize=(9.0, 9.0 * (high - bottom + 5.0 * step + margin) / (right - left + 2 * margin) + 0.4))
    figure.set_layout_engine("constrained")
    panel = figure.subplots()
    panel.set(
        xlim=(left - margin, right + margin), ylim=(bottom - 4.5 * step, high + margin + 0.5 * step), aspect="equal"
    )
    panel.set_xlabel("x [m]")
    panel.set_ylabel("y [m]")
    if scenario.ground is not None:
        panel.axhspan(bottom - 4.5 * step, 0.0, color=GROUND, linewidth=0.0)
        panel.axhline(0.0, color=GREY, linewidth=0.8)
    panel.add_patch(PolygonPatch(flow, facecolor="#9CC7E3", edgecolor=BLUE))
    _flow_measures(panel, scenario, flow, step)
    if isinstance(shape, Trapezoid):
        panel.add_patch(PolygonPatch(shape.polygon, facecolor=BARRIER, edgecolor=EDGE))
        _barrier_measures(panel, shape, step)
    elif isinstance(shape, Wall):
        panel.add_patch(Rectangle((0.0, 0.0), right + margin, 2.0 * high, facecolor=BARRIER, edgecolor=EDGE))
        panel.text(0.5 * (right + margin), 0.5 * high, "wall\nwithout end", ha="center", va="center", fontsize=9)
    return figure


def _flow_measures(panel: Axes, scenario: Scenario, flow: np.ndarray, step: float) -> None:
    material, depth = scenario.flow.material, scenario.flow.depth
    front, tail = float(flow[:, 0].max()), float(flow[:, 0].min())
    middle = flow.mean(axis=0)
    panel.set_title(
        f"flow: V = {scenario.flow.volume:g} m³/m, n = {material.porosity:g}, ρ = {material.density:,.0f} kg/m³"
        + ("" if scenario.barrier is None else f"; barrier: {scenario.barrier.motion.kind}"),
        fontsize=9,
        loc="left",
    )
    speed = scenario.flow.speed
    if speed > 0.0:
        along_x, along_y = (2.5 * step * component / speed for component in scenario.flow.velocity_m_per_s)
        start = (float(middle[0]) - 0.5 * along_x, float(flow[:, 1].max()) + 0.9 * step)
        end = (start[0] + along_x, start[1] + along_y)
        panel.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6})
        panel.text(end[0] + 0.3 * step, end[1], f"{speed:g} m/s", fontsize=9, va="center")
    _measure(panel, (tail, -step), (front, -step), f"{front - tail:.3g} m")
    deepest = float(flow[flow[:, 1] == flow[:, 1].max(), 0].mean())
    _measure(panel, (deepest, float(flow[:, 1].min())), (deepest, float(flow[:, 1].max())), f"h = {depth:g} m")
    if scenario.barrier is not None and front < -1e-9:
        _measure(panel, (front, -step), (0.0, -step), f"d = {-front:.3g} m")


def _barrier_measures(panel: Axes, shape: Trapezoid, step: float) -> None:
    base, crest, height = shape.base_crest_height
    start = 0.5 * (base - crest)
    _measure(panel, (0.0, -2.9 * step), (base, -2.9 * step), f"B = {base:.3g} m")
    if crest > 0.0:
        _measure(panel, (start, height + 0.6 * step), (start + crest, height + 0.6 * step), f"b = {crest:.3g} m")
    middle = start + 0.5 * crest
    _measure(panel, (middle, 0.0), (middle, height), f"H = {height:.3g} m")
    angle = shape.built_face_angle_deg
    panel.text(
        0.9 * step * math.cos(math.radians(angle / 2)) + 0.2 * step,
        0.25 * step,
        f"β = {angle:.1f}°",
        fontsize=9,
    )


def _measure(panel: Axes, start: tuple[float, float], end: tuple[float, float], words: str) -> None:
    panel.annotate(
        "", end, start, arrowprops={"arrowstyle": "<->", "color": EDGE, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    )
    level = start[1] == end[1]
    place = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))
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
