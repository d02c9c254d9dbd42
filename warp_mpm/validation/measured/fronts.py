"""Fronts of columns of water that collapse on a dry bed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_mpm.validation.case import Array, Curve, Outcome, Panel, at_most, reference
from warp_mpm.validation.measured.given import Given, Ladder, simulated
from warp_mpm.validation.measured.water import (
    MOST_SHIFT,
    SQUARE,
    TALL,
    Setup,
    Watched,
    at_times,
    best_shift,
    rms,
    spacings,
    watch,
)


@dataclass(frozen=True)
class Series:
    """A measured front: distances from the back wall over the column's width a, at times T = t √(g/a) n, n² = H/a."""

    title: str
    setup: Setup
    table: str
    own: dict[str, str]
    """Which rows of the table."""
    times: tuple[float, ...]
    places: tuple[float, ...]


SERIES = (
    Series(
        "Martin and Moyce, n² = 1, a = 57 mm",
        SQUARE,
        "martin_moyce_1952_and_koshizuka_oka_1996",
        {"series": "MM_front_n2=1_a2.25in"},
        (1.0, 1.5, 2.0, 2.5, 3.0),
        (1.71, 2.40, 3.11, 3.83, 4.51),
    ),
    Series(
        "Lobovský, square, H = 0.6 m",
        SQUARE,
        "lobovsky2014_fronts",
        {},
        (0.25, 0.5, 0.75, 1.0, 1.25, 1.5),
        (1.192, 1.400, 1.628, 1.894, 2.208, 2.551),
    ),
    Series(
        "Martin and Moyce, n² = 2, a = 57 mm",
        TALL,
        "martin_moyce_1952_and_koshizuka_oka_1996",
        {"series": "MM_front_n2=2_a2.25in_Table2"},
        (1.0, 1.5, 2.0, 2.5, 3.0),
        (1.32, 1.75, 2.35, 2.99, 3.70),
    ),
    Series(
        "Koshizuka and Oka, n² = 2",
        TALL,
        "martin_moyce_1952_and_koshizuka_oka_1996",
        {"series": "KO1996_front_n2=2"},
        (1.0, 1.5, 2.0, 2.5, 3.0),
        (1.40, 1.85, 2.30, 2.79, 3.47),
    ),
)
"""Read off between the tables' entries, straight: Martin and Moyce (1952) tables 2 and 6, Koshizuka and Oka (1996),
Lobovský et al. (2014) Fig. 12."""

SHORT = (
    "on a bed without friction the front comes to 1.8 to 2 √(g H), as theory has it, where experiments stay at 1.4 to "
    "1.6: the boundary layer is as deep as a thin front; spacings from H/15 to H/60 change nothing; with a bed that "
    "holds the water Lobovský's front at H = 0.3 m is met (see above)"
)
"""Why a series misses its limit, written after the run."""


def fronts(given: Given) -> Outcome:
    """Each front within 5 % of the column's depth H (root mean square over its five or six times), after one shift of
    its clock by at most 0.2 of t √(g/H): a membrane or a gate does not vanish at once, and the four experiments, which
    should be one curve for each shape, differ by 0.1 to 0.2 in time and by 5 % in place among themselves. So a miss on
    one of two experiments of one shape is no more than their own difference; a miss on both means that the front is
    wrong.

    The fluid here has no viscosity. Beds of 57 mm columns brake thin fronts; beyond five widths no front is compared.
    Judged is the finest spacing.
    """
    cells = spacings(given)
    runs = {setup: [watch(setup, count) for count in cells] for setup in (SQUARE, TALL)}
    ladder = Ladder([f"H/{count}" for count in cells])
    panels = []
    for setup in (SQUARE, TALL):
        curves = []
        for series in (one for one in SERIES if one.setup == setup):
            curves += _judge(ladder, series, runs[setup], given)
        for run in runs[setup]:
            curves.append(Curve(_scaled(setup, run.time), _place(setup, run), f"H/{run.cells}, not shifted"))
        shape = "square column, H = a" if setup == SQUARE else "tall column, H = 2a"
        panels.append(Panel(shape, "T = n t √(g/a)", "front from the back wall / a", curves, x_range=(0.0, 3.4)))
    return Outcome(checks=ladder.checks, points=ladder.points, panels=panels, tables=[ladder.table])


def _scaled(setup: Setup, time: Array) -> Array:
    """T = n t √(g/a) of t* = t √(g/H): with n² = H/a and a = width it is t*/width."""
    return time / setup.width


def _place(setup: Setup, run: Watched) -> Array:
    """Distance of the front from the back wall over the column's width."""
    return 1.0 + run.front / setup.width


def _judge(ladder: Ladder, series: Series, runs: list[Watched], given: Given) -> list[Curve]:
    setup = series.setup
    times, places = np.array(series.times) * setup.width, np.array(series.places)
    shifts = [best_shift([(run, _place(setup, run), times, places)]) for run in runs]
    ours = [at_times(run, _place(setup, run), times, shift) for run, shift in zip(runs, shifts, strict=True)]

    off = [setup.width * rms(found - places) for found in ours]
    ladder.add(at_most(f"{series.title}: front, rms", "of H", off[-1], 0.05, percent=True, remark=SHORT), off)
    ladder.add(at_most(f"{series.title}: shift of the clock", "t √(g/H)", shifts[-1], MOST_SHIFT), shifts)
    ladder.points += [
        simulated(f"{series.title}, T = {series.times[k]:g}", place, [float(found[k]) for found in ours])
        for k, place in enumerate(series.places)
    ]
    curves = [Curve(series.times, places, series.title, "o")]
    table = given.tables.get(series.table)
    if table is not None:
        if series.own:
            x, y = (table.numbers(name, where=series.own) for name in ("T_or_tau", "Z_or_H"))
        else:
            own = table.numbers("H_m") == 0.6
            x, y = table.numbers("t_star")[own], 1.0 + table.numbers("x_over_H")[own]
        curves.append(reference(x, y, ""))
    return curves
