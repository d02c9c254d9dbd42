"""The pictures of a study."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from warp_mpm.accuracy.errors import KEY_QUANTITIES, QUANTITIES
from warp_mpm.accuracy.formulas import Formula
from warp_mpm.accuracy.study import DEFAULT, KNOBS, level_text
from warp_mpm.accuracy.tables import formula_errors
from warp_mpm.accuracy.verdict import Study, error_of, sloping
from warp_mpm.plotting.style import BLUE, GREY, ORANGE, RUN_COLOURS, grid

LEAST_ERROR = 1e-4
"""Errors below are drawn here: less than any reference is known to."""

SHOWN_BELOW_DOUBT = 5.0
"""How far the panels go on below what the spacing lets the reference be known to; what is less is drawn on the lower
edge."""

MARKERS = dict(zip((DEFAULT, *KNOBS), "osD^2v<>H1x", strict=True))
"""One for each knob: its points are told apart although there are fewer colours than knobs."""

FLOOR, SPACING_FLOOR = "#EEEEEE", "#DADADA"
"""Colours of errors that are below what the reference is known to, and below the spacing's part of that."""

FORMULA_MARKERS = "*PXphd8"

LABEL_PLACES = (
    *((3, 4, "left", "bottom"), (-3, 4, "right", "bottom"), (3, -4, "left", "top"), (-3, -4, "right", "top")),
    *((0, 12, "center", "bottom"), (0, -12, "center", "top"), (0, 20, "center", "bottom"), (0, -20, "center", "top")),
)
"""Where a spacing may stand beside its point: offset [points] and alignment, the first choice first."""

PANELS = (
    *("overall", "peak_force", "impulse", "barrier_displacement_final", "barrier_velocity_max", "impact_duration"),
    *(
        "peak_force_time",
        "pressure_patch_max",
        "overtopped_volume",
        "force_curve",
        "energy_curve",
        "displacement_curve",
    ),
)


def error_against_time(study: Study, found: Sequence[Formula]) -> Figure:
    """Error against time, one panel for each quantity, the cheapest choices joined, formulas at the left.

    Above each panel stands how the error falls as the spacing does; a dashed line of that slope goes through the runs
    from which it is told. Grey is what the reference is not known to, dark grey the spacing's part of that.
    """
    names = [name for name in PANELS if name == "overall" or name in study.references.names]
    columns = 4
    rows = math.ceil(len(names) / columns)
    figure = Figure(figsize=(15.0, 3.3 * rows + 1.0), layout="constrained")
    figure.suptitle(f"{study.scenario.title}: error against CPU time", fontsize=12)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    for panel, name in zip(panels, names, strict=False):
        _error_panel(panel, study, name, found)
    handles: dict[str, Any] = {}
    for panel in panels[: len(names)]:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=5, fontsize=8)
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()  # only now the points have their places
    for panel, name in zip(panels, names, strict=False):
        _name_spacings(panel, study, name)
    return figure


def _error_panel(panel: Axes, study: Study, name: str, found: Sequence[Formula]) -> None:
    knobs = [DEFAULT, *(knob for knob in KNOBS if any(row.setting.knob == knob for row in study.rows))]
    least = _least(study, name)
    for number, knob in enumerate(knobs):
        rows = [r for r in study.rows if r.setting.knob == knob and math.isfinite(error_of(r, name))]
        panel.plot(
            [row.time for row in rows],
            [_drawn(error_of(row, name), least) for row in rows],
            MARKERS[knob],
            color=RUN_COLOURS[number % len(RUN_COLOURS)],
            markersize=6 if knob == DEFAULT else 4.5,
            markerfacecolor=None if knob == DEFAULT else "none",
            label="spacing alone [m]" if knob == DEFAULT else knob.replace("_", " "),
        )
    best = study.fronts[name]
    panel.plot(
        [r.time for r in best], [_drawn(error_of(r, name), least) for r in best], "o-", color=GREY, linewidth=1.2,
        markersize=11, markerfacecolor="none", zorder=1, label="cheapest choices",
    )  # fmt: skip
    _draw_slope(panel, study, name)
    for number, formula in enumerate(found):
        error = formula_errors(study, formula).get(name)
        if error is not None:
            panel.plot(
                formula.time, _drawn(abs(error), least), FORMULA_MARKERS[number % len(FORMULA_MARKERS)],
                color=ORANGE if "closed form" in formula.name else GREY, markersize=8, label=formula.name,
            )  # fmt: skip
    _draw_floor(panel, study, name)
    _logarithmic(panel, least)
    panel.set_title(f"{_title(name)}\n{study.slopes[name]}", fontsize=9)
    panel.set_xlabel("CPU time", fontsize=8)
    panel.set_ylabel("error (grey: reference unsure)", fontsize=8)


def _draw_slope(panel: Axes, study: Study, name: str) -> None:
    """A line of the slope with which the error falls, through the runs from which it is told."""
    power = study.slopes[name].cost
    if power is None:
        return
    time, error = np.array([(row.time, error_of(row, name)) for row in sloping(study, name) if row.time > 0.0]).T
    middle = np.exp(np.log(error).mean()) * (time / np.exp(np.log(time).mean())) ** -power
    panel.plot(time, middle, "--", color="black", linewidth=1.2, zorder=3, label="slope along the spacings")


def _draw_floor(panel: Axes, study: Study, name: str) -> None:
    """What the reference is not known to, and in it, darker, the spacing's part."""
    least = _least(study, name)
    panel.axhspan(least / 2, max(study.doubt(name), least), color=FLOOR, zorder=-1)
    panel.axhspan(least / 2, max(study.spacing_doubt(name), least), color=SPACING_FLOOR, zorder=0)


def _name_spacings(panel: Axes, study: Study, name: str) -> None:
    """Spacings beside their points, apart from each other and within the panel, over as few other points as can be."""
    least = _least(study, name)
    points = [(r.time, _drawn(error_of(r, name), least)) for r in study.rows if math.isfinite(error_of(r, name))]
    pixels = panel.transData.transform(points)
    taken: list[Bbox] = []
    for row in study.rows:
        if row.setting.knob != DEFAULT or not row.errors:
            continue
        free: list[tuple[int, int, Any, Bbox]] = []
        for x, y, across, upright in LABEL_PLACES:
            label = panel.annotate(
                f"{row.setting.spacing:.3g}", (row.time, _drawn(error_of(row, name), least)), fontsize=7, color=BLUE,
                xytext=(x, y), textcoords="offset points", ha=across, va=upright, in_layout=False,
            )  # fmt: skip
            extent = label.get_window_extent()
            inside = all(panel.bbox.contains(*corner) for corner in (extent.min, extent.max))
            if inside and not any(extent.overlaps(other) for other in taken):
                free.append((extent.padded(2.0).count_contains(pixels), len(free), label, extent))
            label.set_visible(False)
        if free:  # else the spacing is left to its neighbours to tell
            _, _, label, extent = min(free, key=lambda place: place[:2])
            label.set_visible(True)
            taken.append(extent)


def error_of_each_knob(study: Study) -> Figure:
    """Error of the key figures against each knob alone; for the spacing, each quantity with its observed order."""
    turned = [knob for knob in KNOBS if any(one.name == knob for one in study.knobs)]
    columns = 3
    rows = math.ceil((len(turned) + 1) / columns)
    figure = Figure(figsize=(12.5, 3.3 * rows), layout="constrained")
    figure.suptitle(f"{study.scenario.title}: each setting alone (dashed: how far the reference is known)", fontsize=12)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel in panels[len(turned) + 1 :]:
        panel.set_axis_off()
    ladder = sorted((r for r in study.rows if r.setting.knob == DEFAULT and r.errors), key=lambda r: r.setting.spacing)
    spacings = [row.setting.spacing for row in ladder]
    for number, name in enumerate([*study.references.told_names, "energy_curve"]):
        if name not in study.references.names:
            continue
        reference = study.references.scalars.get(name)
        order = (
            "" if reference is None else ", no order" if reference.order is None else f", order {reference.order:.2g}"
        )
        panels[0].plot(
            spacings, [_drawn(error_of(row, name)) for row in ladder], "o-", color=RUN_COLOURS[number], linewidth=1.0,
            markersize=4, label=f"{QUANTITIES[name].label}{order}",
        )  # fmt: skip
    _logarithmic(panels[0], times=False)
    panels[0].set_xticks(spacings, [f"{value:.3g}" for value in spacings])
    panels[0].minorticks_off()
    panels[0].set_xlabel("spacing [m]")
    panels[0].set_ylabel("error")
    panels[0].legend(fontsize=6.5)
    for panel, knob in zip(panels[1:], turned, strict=False):
        points = [(one.level, one.overall, one.time_ratio) for one in study.knobs if one.name == knob]
        one = next(one for one in study.knobs if one.name == knob)
        own = getattr(study.scenario.numerics, knob)
        points = sorted(
            [*points, (own, one.default_overall, 1.0)],
            key=lambda point: KNOBS[knob].index(point[0]) if point[0] in KNOBS[knob] else -1,
        )
        places = np.arange(len(points))
        finite = [value if math.isfinite(value) else 0.0 for _, value, _ in points]
        bars = panel.bar(
            places,
            [100.0 * value for value in finite],
            color=[BLUE if level == own else GREY for level, _, _ in points],
        )
        texts = [f"{ratio:.2g}× time" if math.isfinite(value) else "diverged" for _, value, ratio in points]
        panel.bar_label(
            bars,
            texts,
            fontsize=8,
            padding=2,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
        )
        panel.axhline(100.0 * study.doubt("overall"), color=ORANGE, linewidth=1.0, linestyle="--")
        panel.set_xticks(places, [level_text(level).replace("_", "-") for level, _, _ in points])
        panel.set_title(f"{knob.replace('_', ' ')} (blue: the scenario's own)", fontsize=9)
        panel.set_ylabel("error of the key figures [%]", fontsize=8)
        panel.margins(y=0.18)
    return figure


def where_time_goes(study: Study) -> Figure:
    """CPU time of each spacing, and the share of each kernel in a step of the finest."""
    ladder = sorted((r for r in study.rows if r.setting.knob == DEFAULT and r.errors), key=lambda r: -r.setting.spacing)
    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    times, kernels = figure.subplots(1, 2)
    places = np.arange(len(ladder))
    parts: Mapping[str, str] = {
        "cpu_time": "stepping",
        "recording_time": "recording",
        "preparation_time": "preparation",
    }
    below = np.zeros(len(ladder))
    for (name, label), colour in zip(parts.items(), RUN_COLOURS, strict=False):
        values = np.array([row.result[name] for row in ladder])
        times.bar(places, values, bottom=below, color=colour, label=label)
        below += values
    times.set_xticks(places, [f"{row.setting.spacing:.3g}" for row in ladder])
    times.set_xlabel("spacing [m]")
    times.set_ylabel("CPU time [s]")
    times.legend(fontsize=8)
    for place, row in zip(places, ladder, strict=True):
        rate = row.result["cpu_time"] / max(row.result["steps"] * row.result["material_points"], 1) * 1e9
        times.annotate(f"{rate:.0f} ns", (place, below[place]), ha="center", va="bottom", fontsize=8)
    times.set_title("CPU time; above, stepping per point and step", fontsize=9)
    times.margins(y=0.1)
    shares = ladder[-1].result["kernel_times"]
    names = list(shares)[::-1]
    kernels.barh(names, [100.0 * shares[name] for name in names], color=BLUE)
    kernels.set_xlabel("share of a step [%], launched one by one")
    kernels.set_title(f"kernels at spacing {ladder[-1].setting.spacing:g} m", fontsize=9)
    return figure


def error_against_cost(studies: Sequence[Study]) -> Figure:
    """Error of each key figure against time along the ladder of spacings, a panel for each scene.

    Above each panel stands how the worst of them falls. Grey is what its reference is not known to, dark grey the
    spacing's part of that.
    """
    columns = min(4, len(studies))
    rows = math.ceil(len(studies) / columns)
    figure = Figure(figsize=(3.7 * columns + 0.4, 3.2 * rows + 0.7), layout="constrained")
    figure.suptitle("Error of the key figures against CPU time (grey: reference unsure)", fontsize=12)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel in panels[len(studies) :]:
        panel.set_axis_off()
    handles: dict[str, Any] = {}
    for panel, study in zip(panels, studies, strict=False):
        own = sorted((r for r in study.rows if r.setting.knob == DEFAULT and r.errors), key=lambda row: row.time)
        least = _least(study, "overall")
        for number, name in enumerate(KEY_QUANTITIES):
            if name in study.references.scalars:
                panel.plot(
                    [row.time for row in own], [_drawn(error_of(row, name), least) for row in own], "o-", markersize=4,
                    color=RUN_COLOURS[number], linewidth=1.0, label=QUANTITIES[name].label,
                )  # fmt: skip
        _draw_slope(panel, study, "overall")
        _draw_floor(panel, study, "overall")
        _logarithmic(panel, least)
        title = textwrap.fill(study.scenario.title, 52, max_lines=2)
        panel.set_title(f"{title}\nthe worst: {study.slopes['overall']}", fontsize=8)
        panel.set_xlabel("CPU time", fontsize=8)
        panel.set_ylabel("error", fontsize=8)
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=4, fontsize=8)
    return figure


PRICED = ("peak_force", "impact_impulse", "impact_duration", "barrier_displacement_final")


def price_of_the_closed_form(studies: Sequence[tuple[Study, Sequence[Formula]]]) -> Figure:
    """All scenes in the same panels: simulations and formulas, error against time, from a microsecond up."""
    figure = Figure(figsize=(13.0, 8.6), layout="constrained")
    figure.suptitle("Error against the converged simulation, from a formula to the finest spacing", fontsize=12)
    colours: dict[str, str] = {}
    for panel, name in zip(figure.subplots(2, 2).ravel(), PRICED, strict=True):
        for study, found in studies:
            if name not in study.references.scalars:
                continue
            ladder = sorted((r for r in study.rows if r.setting.knob == DEFAULT and r.errors), key=lambda r: r.time)
            ladder = [row for row in ladder if name in row.errors][:-1]  # the finest is close by making
            panel.plot(
                [row.time for row in ladder], [_drawn(error_of(row, name)) for row in ladder], "o-", color=BLUE,
                markersize=3, linewidth=0.6, alpha=0.7, label="simulation, one line a scene",
            )  # fmt: skip
            for formula in found:
                error = formula_errors(study, formula).get(name)
                if error is None:
                    continue
                colour = colours.setdefault(formula.name, [c for c in RUN_COLOURS if c != BLUE][len(colours) % 7])
                filled = study.scenario.barrier is not None and study.scenario.barrier.motion.kind == "fixed"
                panel.plot(
                    formula.time, _drawn(abs(error)), "s", color=colour, markersize=5,
                    markerfacecolor=colour if filled else "none", label=formula.name,
                )  # fmt: skip
        _logarithmic(panel)
        panel.set_title(_title(name), fontsize=10)
        panel.set_xlabel("CPU time")
        panel.set_ylabel("error")
    handles: dict[str, Any] = {}
    for panel in figure.axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        list(handles.values()), list(handles), loc="outside lower center", ncols=4, fontsize=8,
        title="filled: fixed barrier; open: sliding barrier", title_fontsize=8,
    )  # fmt: skip
    return figure


def _least(study: Study, name: str) -> float:
    """The lower edge of a panel, on which lesser errors are drawn."""
    return max(LEAST_ERROR, study.spacing_doubt(name) / SHOWN_BELOW_DOUBT)


def _drawn(error: float, least: float = LEAST_ERROR) -> float:
    return max(error, least)


def _logarithmic(panel: Axes, least: float = LEAST_ERROR, *, times: bool = True) -> None:
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_ylim(bottom=least / 1.5)
    low, high = panel.get_ylim()
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high / low < 1e4 else (1.0,), numticks=20))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100.0 * value:g} %"))
    panel.yaxis.set_minor_formatter(NullFormatter())
    if times:
        low, high = panel.get_xlim()
        panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high / low < 1e2 else (1.0,), numticks=6))
        panel.xaxis.set_major_formatter(FuncFormatter(_time_text))
        panel.xaxis.set_minor_formatter(NullFormatter())
    panel.tick_params(labelsize=8)
    grid(panel)


def _time_text(seconds: float, _: Any = None) -> str:
    if seconds >= 1000.0:
        return f"{seconds:,.0f} s"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= 0.1 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"


def _title(name: str) -> str:
    return "key figures, the worst" if name == "overall" else QUANTITIES[name].label
