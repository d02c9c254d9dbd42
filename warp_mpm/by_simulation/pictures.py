"""Charts of a search for a barrier, and of an uncertainty study."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warp_mpm.by_simulation.barrier import Answer
from warp_mpm.by_simulation.fields import words
from warp_mpm.by_simulation.limits import Limit
from warp_mpm.by_simulation.uncertain import Study, Told
from warp_mpm.plotting.style import BLUE, GREEN, GREY, ORANGE, grid, heading


def search_chart(answer: Answer) -> Figure:
    """What was tried: each limited figure over the objective, and, of two variables, the plane of both."""
    question = answer.question
    plane = len(question.ranges) == 2
    panels = len(question.limits) + plane
    figure = Figure(figsize=(max(4.6 * panels + 0.6, 7.2), 4.4), layout="constrained")
    axes = figure.subplots(1, panels, squeeze=False)[0]
    heading(figure, question.scenario.title)
    if plane:
        _plane(axes[0], answer)
    for panel, limit in zip(axes[plane:], question.limits, strict=True):
        _figure(panel, answer, limit)
    figure.legend(*axes[-1].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return figure


def _plane(panel: Axes, answer: Answer) -> None:
    question = answer.question
    first, second = question.ranges
    xs, ys = np.linspace(first.low, first.high, 12), np.linspace(second.low, second.high, 12)
    weights = np.array([[question.weigh((float(x), float(y))) for x in xs] for y in ys])
    unit, factor = question.objective.shown
    lines = panel.contour(xs, ys, weights * factor, levels=8, colors=GREY, linewidths=0.6)
    panel.clabel(lines, fontsize=7, fmt="%g")
    panel.set_title(f"lines: {question.objective.words} [{unit}]", fontsize=9)
    for holds, colour, mark in ((True, BLUE, "o"), (False, ORANGE, "x")):
        points = np.array([one.point for one, _ in answer.tried if one.holds is holds]).reshape(-1, 2)
        panel.plot(*points.T, mark, color=colour, markersize=5)
    if answer.best is not None:
        panel.plot(*answer.best.point, "*", color=GREEN, markersize=16, markeredgecolor="black", zorder=5)
    panel.set_xlabel(first.label)
    panel.set_ylabel(second.label)
    grid(panel)


def _figure(panel: Axes, answer: Answer, limit: Limit) -> None:
    question = answer.question
    quantity, (unit, factor) = limit.quantity, question.objective.shown
    for holds, colour, mark, label in ((True, BLUE, "o", "keeps all limits"), (False, ORANGE, "x", "breaks one")):
        shown = [
            (one.objective * factor, run.figures[limit.name] * quantity.factor)
            for one, run in answer.tried
            if one.holds is holds and run.figures is not None and run.figures.get(limit.name) is not None
        ]
        panel.plot(*np.array(shown).reshape(-1, 2).T, mark, color=colour, markersize=5, label=label)
    panel.axhline(limit.bound * quantity.factor, color="black", linewidth=1.0, linestyle="--", label="limit")
    best = answer.best
    if best is not None and answer.rungs and answer.rungs[-1].figures is not None:
        value = answer.rungs[-1].figures.get(limit.name)
        known = next((one for one in answer.known if one.limit == limit), None)
        if known is not None:
            panel.errorbar(
                best.objective * factor, known.value * quantity.factor, yerr=known.uncertainty * quantity.factor,
                color=GREEN, capsize=4, zorder=4,
            )  # fmt: skip
        if value is not None:
            panel.plot(
                best.objective * factor, value * quantity.factor, "*", color=GREEN, markersize=16,
                markeredgecolor="black", zorder=5, linestyle="none",
                label=f"answer, at {answer.rungs[-1].spacing:.3g} m",
            )  # fmt: skip
    panel.set_xlabel(f"{question.objective.words} [{unit}]")
    panel.set_ylabel(f"{quantity.words} [{quantity.shown_unit}]")
    values = [
        run.figures[limit.name] * quantity.factor
        for _, run in answer.tried
        if run.figures is not None and run.figures.get(limit.name) is not None
    ]
    # Far from the limit the barriers slide off: what is near it is what matters.
    top = limit.bound * quantity.factor * 4.0
    if limit.bound > 0.0 and values and max(values) > top > 0.0 and min(values) >= 0.0:
        panel.set_ylim(0.0, top)
        beyond = sum(value > top for value in values)
        panel.set_title(f"{beyond} trials above", fontsize=9)
    grid(panel)


def study_chart(study: Study) -> Figure:
    """Of each figure: how likely it is exceeded, by the surrogate and by the runs, and what that depends on."""
    rows = len(study.told)
    figure = Figure(figsize=(9.6, 2.5 * rows + 0.9), layout="constrained")
    axes = figure.subplots(rows, 2, squeeze=False)
    heading(figure, study.design.scenario.title)
    for (curve, bars), one in zip(axes, study.told, strict=True):
        _exceedance(curve, study, one)
        _sensitivities(bars, one)
    axes[0][0].set_title("probability of being exceeded", fontsize=10, loc="left")
    axes[0][1].set_title("Sobol' indices: what it depends on", fontsize=10)
    axes[-1][1].set_xlabel("share of the variance [-]")
    axes[0][1].legend(fontsize=8, loc="best")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return figure


def _exceedance(panel: Axes, study: Study, one: Told) -> None:
    factor = one.quantity.factor
    shares, values = one.curve
    panel.plot(values * factor, 1.0 - shares, color=BLUE, label="surrogate, a million samples")
    panel.fill_betweenx(
        1.0 - shares, (values - one.surrogate.error) * factor, (values + one.surrogate.error) * factor,
        color=BLUE, alpha=0.15, linewidth=0.0, label="its error, by cross-validation",
    )  # fmt: skip
    known = np.sort(one.values[np.isfinite(one.values)])
    panel.plot(
        known * factor, 1.0 - (np.arange(len(known)) + 0.5) / len(known), ".", color=GREY, markersize=3, label="runs"
    )
    limit = next((limit for limit in study.limits if limit.name == one.name), None)
    if limit is not None:
        panel.axvline(limit.bound * factor, color=ORANGE, linestyle="--", linewidth=1.2)
        chance = next(found.probability for found in study.exceeded if found.limit is limit)
        side = "below" if limit.least else "above"
        panel.set_title(f"{chance:.1%} {side} the limit", fontsize=9, color=ORANGE, loc="right")
    panel.set_xlabel(f"{one.quantity.words} [{one.quantity.shown_unit}]")
    panel.set_ylabel("probability [-]")
    panel.set_ylim(0.0, 1.02)
    grid(panel)


def _sensitivities(panel: Axes, one: Told) -> None:
    names = sorted(one.total, key=lambda name: one.total[name])
    places = np.arange(len(names))
    panel.barh(places + 0.2, [one.total[name] for name in names], 0.36, color=BLUE, label="total")
    panel.barh(places - 0.2, [one.first[name] for name in names], 0.36, color=GREEN, label="first order")
    panel.set_yticks(places, [words(name) for name in names], fontsize=8)
    panel.set_xlim(0.0, max(1.0, max(one.total.values()) * 1.05))
    panel.set_axisbelow(True)
    grid(panel)
