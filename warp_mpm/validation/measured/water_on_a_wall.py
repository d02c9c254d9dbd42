"""Water that runs onto a wall: pressures, fronts and levels (Lobovský et al. 2014), pressures (Buchner 2002)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analytic.empirical import MODELS
from warp_mpm.validation.case import (
    Array,
    Band,
    Check,
    Curve,
    Outcome,
    Panel,
    Point,
    Table,
    at_most,
    compared,
    number,
    reference,
    reported,
    within,
)
from warp_mpm.validation.measured.given import SMOOTH, Given, Ladder, simulated
from warp_mpm.validation.measured.water import (
    DEPTH,
    MOST_SHIFT,
    RECORD,
    WALL,
    WALL_WITH_GATE,
    Setup,
    Watched,
    at_times,
    best_shift,
    filtered,
    mean_between,
    rms,
    spacings,
    watch,
)

GAUGES = {"H1": 0.300, "H2": 0.865, "H3": 1.114, "H4": 1.3625}
"""Places of Lobovský's gauges from the back wall [m]."""

SENSOR = 0.0042
"""Diameter of Lobovský's sensors [m]."""

_RUNS: dict[tuple[Setup, int], Watched] = {}
"""Two cases look at the same runs."""


def _runs(given: Given, setup: Setup) -> list[Watched]:
    for cells in spacings(given):
        if (setup, cells) not in _RUNS:
            _RUNS[setup, cells] = _watched(setup, cells)
    return [_RUNS[setup, cells] for cells in spacings(given)]


def _watched(setup: Setup, cells: int) -> Watched:
    return watch(setup, cells, [place / DEPTH for place in GAUGES.values()])


# -- Lobovský ----------------------------------------------------------------------------------------------------

MBAR = 100.0 / (997.0 * 9.81 * 0.3)
"""A millibar as p* at H = 0.3 m."""

HEIGHTS = {"z = 3 mm": 0.003, "z = 15 mm": 0.015, "z = 30 mm": 0.030, "z = 80 mm": 0.080}
PEAKS = {  # mbar: median, 2.5 % and 97.5 % of 100 repeats; table 2 of the source
    "z = 3 mm": (91.44, 75.06, 130.98),
    "z = 15 mm": (57.49, 53.26, 63.31),
    "z = 30 mm": (43.76, 39.79, 49.62),
    "z = 80 mm": (30.15, 24.18, 36.32),
}
ARRIVALS = {"z = 3 mm": 2.444, "z = 15 mm": 2.460, "z = 30 mm": 2.509, "z = 80 mm": 2.754}
"""First p* above 0.1 in t*, of the event that the source calls typical; the next three tables are of it too."""

REACHED = 0.1
WINDOWS = np.arange(3.0, 7.0, 0.5)
MEANS = {
    "z = 3 mm": (0.852, 0.745, 0.643, 0.654, 0.640, 0.774, 0.933, 0.810),
    "z = 15 mm": (0.757, 0.679, 0.637, 0.667, 0.664, 0.778, 0.923, 0.799),
    "z = 30 mm": (0.788, 0.588, 0.573, 0.607, 0.589, 0.698, 0.839, 0.693),
    "z = 80 mm": (0.521, 0.561, 0.566, 0.485, 0.468, 0.548, 0.684, 0.528),
}
"""Mean p* over half a unit of t* from each of `WINDOWS` on."""

IMPULSES = {"z = 3 mm": 4.014, "z = 15 mm": 3.834, "z = 30 mm": 3.420, "z = 80 mm": 2.317}
"""∫ p* dt* until 7.15."""

FILTERED_PEAKS = {"z = 3 mm": 2.201, "z = 15 mm": 1.878, "z = 30 mm": 1.517, "z = 80 mm": 0.589}
"""Greatest mean over 0.1 t* of the typical event before `IMPACT_END`."""

IMPULSE_END = 7.15
FILTER = 0.1
IMPACT_END = 5.0
"""In t*; what is greater later is a wave that falls back."""

FRONT = np.array([[0.25, 0.170], [0.5, 0.406], [0.75, 0.624], [1.0, 0.907], [1.25, 1.237], [1.5, 1.595],
                  [1.75, 1.964], [2.0, 2.366], [2.25, 2.789]])  # fmt: skip
"""t* and distance of the tip from the gate over H, H = 0.3 m; read from the curve of the source's Fig. 12."""

FRONT_SPEED = 1.57
"""Slope dX/dt* of that curve beyond t* = 1.2."""

LEVEL_TIMES = np.arange(1.0, 7.5, 1.0)
LEVELS = {
    "H1": (0.929, 0.782, 0.634, 0.504, 0.403, 0.325, 0.266),
    "H2": (0.038, 0.214, 0.261, 0.290, 0.293, 0.270, 0.250),
    "H3": (0.000, 0.139, 0.171, 0.224, 0.239, 0.236, 0.523),
    "H4": (0.000, 0.008, 0.135, 0.157, 0.209, 0.441, 0.771),
}
"""Mean depth over H within 0.25 of each of `LEVEL_TIMES`, of both repeats where there are two (Fig. 16)."""

ARRIVING = 0.13
"""Depth over H at the last gauge while the front meets the wall."""

ARRIVING_PRESSURE = 1.609
"""Greatest mean over that depth of the wall and 0.1 t* of the typical event's p*, straight between its sensors."""

NUMERICS = (
    "spacings from H/15 to H/60 lead to the same curves, and transfer (apic), density correction 0 to 2, nine points "
    "to a cell, a third of the time step, no pressure filter, no bulk viscosity, no volumetric smoothing and a liquid "
    "that bears tension move them by some percent"
)

REASONS = {
    WALL: {
        "impulse": "the smooth bed lets the water arrive 15 % too fast, and it turns up the wall in a thin jet with "
        "too much pressure below and too little above, where the experiment has the pressure of standing water from "
        "t* = 3 on; " + NUMERICS + "; nor is it that points crowd at the foot of the wall: sixteen to a cell take 5 % "
        "off its impulse, which is 26 % too large at that spacing (last table); with the gate and a bed that holds the "
        "water, in the next case, most of it goes",
        "peak": "3 mm: the filter takes as much from the experiment, whose typical event falls to 2.20; 30 and 80 mm: "
        "the thin jet presses below them",
        "level": "until t* = 5 all levels are within some percent of H; what falls back from the wall afterwards is "
        "gathered in a smaller and faster wave than the experiment's",
        "front": "it starts too slowly, as no water escapes beneath a gate, and then runs 15 % too fast on a bed "
        "without friction; no spacing changes that; the next case meets the limit",
    },
    WALL_WITH_GATE: {
        "impulse": "what is missing is missing after t* = 4.5, when water falls back; with the spacing the layer that "
        "the bed holds gets thinner, and the lower sensors drift; sixteen points to a cell raise all four impulses by "
        "14 to 19 %, to within 7 % at the lower sensors and 10 % at 80 mm, while window means come no nearer (last "
        "table), so that these impulses hang on the discretisation by as much as they miss",
        "peak": "the filter takes 13 % from the experiment's own peak at 3 mm; at 15 and 30 mm a percent is missing, "
        "as cells of 5 mm stand for sensors of 4.2 mm; at 80 mm the typical event's own filtered peak, 0.59, is below "
        "the band too, and ours is as great",
        "level": "until t* = 5 all levels are within some percent of H; what falls back from the wall afterwards is "
        "gathered in a smaller wave than the experiment's, whose tank holds air",
        "front": "",
    },
}
"""Why figures miss their limit, written after the runs."""


def lobovsky(given: Given) -> Outcome:
    """The clock. The gate of the experiment takes 0.09 s, half a unit of t*, to leave the water; the simulation's is
    gone at once, and the front's record lags that of the pressures by 0.16. So one common shift of t* may be taken for
    all pressures and another one for front and levels, of at most 0.2 each, which is itself a check.

    Arrival of p* > 0.1 at each sensor within 0.2 of t* after that shift: the interval in which the water's edge climbs
    from one sensor to the next is 0.3.

    Impulse ∫ p* dt* until 7.15 at each sensor within 10 %: the repeats differ by some percent, and an impulse is what a
    barrier feels; it hangs neither on filters nor on the instant of the peak.

    Means of p* over half a unit of t*, eight windows from 3 to 7 at each sensor, within 15 %: after the peak the
    pressure is that of the water which stands before the wall; beyond t* = 6 a wave falls back, whose place differs
    from repeat to repeat.

    Greatest p* filtered over 0.1 t* within the 2.5 to 97.5 % band of the peaks of 100 repeats. The peaks of the
    experiment are not filtered; a simulated peak must be, for a sharper one is a matter of the grid. At z = 3 mm this
    asks for more than the experiment has, whose typical event falls from 2.52 to 2.20 under the same filter: a miss
    there is one of the measure. The filtered peak of that event stands beside. (Made stricter after the first run: of
    the time before t* = 5, as at 30 mm a wave that fell back at 6.6 had passed for the impact.)

    Front at nine times within 5 % of H (root mean square), and levels at four gauges, means around t* = 1 to 7, within
    5 % of H each (root mean square): two repeats of the levels differ by 1 to 3 % of H.

    A miss means that the simulated flow is not that of the experiment in that figure. Judged is the finest spacing.
    """
    return _against_lobovsky(given, WALL)


def lobovsky_with_gate(given: Given) -> Outcome:
    """The limits are those of the case above. Its first run had been seen when this one was made: its front starts too
    slowly and then runs too fast, which a gate that lets water out beneath it and a bed that brakes it would both
    correct. So nothing here is fitted, but it was known what was missing. The gate is lifted at its measured speed of
    3.46 m/s; the bed holds the water that touches it, in a layer one cell thick, whose thickness therefore hangs on the
    spacing. The wall is smooth.
    """
    return _against_lobovsky(given, WALL_WITH_GATE)


def _against_lobovsky(given: Given, setup: Setup) -> Outcome:
    runs, reasons = _runs(given, setup), REASONS[setup]
    by = SMOOTH if setup == WALL else "water, gate and bed that holds"
    ladder = Ladder([f"H/{run.cells}" for run in runs], by=by)
    traces = {name: [run.pressure(z / DEPTH, SENSOR / DEPTH) for run in runs] for name, z in HEIGHTS.items()}
    arrivals = {
        name: [_first(run.time, trace) for run, trace in zip(runs, own, strict=True)] for name, own in traces.items()
    }
    shifts = [float(np.mean([ARRIVALS[name] - arrivals[name][k] for name in HEIGHTS])) for k in range(len(runs))]
    ladder.add(at_most("shift of the clock of the pressures", "t*", shifts[-1], MOST_SHIFT), shifts)
    clipped = [float(np.clip(shift, -MOST_SHIFT, MOST_SHIFT)) for shift in shifts]
    for name, theirs in ARRIVALS.items():
        ours = [arrival + shift for arrival, shift in zip(arrivals[name], clipped, strict=True)]
        ladder.add(
            _near(f"{name}: arrival", "t*", ours[-1], theirs, 0.2),
            ours,
            measured=(theirs, theirs - RECORD, theirs + RECORD),
        )
    for name, theirs in IMPULSES.items():
        ours = [_impulse(run, trace, shift) for run, trace, shift in zip(runs, traces[name], clipped, strict=True)]
        ladder.add(
            compared(f"{name}: ∫ p* dt* until 7.15", "-", ours[-1], theirs, 0.1, remark=reasons["impulse"]),
            ours,
            measured=(theirs, theirs, theirs),
        )
    rows = []
    for name, theirs_all in MEANS.items():
        ours_all = np.array(
            [
                [mean_between(run.time + shift, trace, begin, begin + 0.5) for begin in WINDOWS]
                for run, trace, shift in zip(runs, traces[name], clipped, strict=True)
            ]
        )
        off = ours_all / np.array(theirs_all) - 1.0
        worst = int(np.argmax(np.abs(off[-1])))
        within_limit = int((np.abs(off[-1]) <= 0.15).sum())
        ours = [float(value) for value in off[:, worst]]
        ladder.add(
            at_most(
                f"{name}: window means, worst of eight ({within_limit} within), from t* = {WINDOWS[worst]:g}",
                "of it",
                ours[-1],
                0.15,
                percent=True,
                remark=reasons["impulse"],
            ),
            ours,
        )
        ladder.points += [
            simulated(f"{name}, from t* = {begin:g}", theirs, ours, by=by)
            for begin, theirs, ours in zip(WINDOWS, theirs_all, ours_all.T.tolist(), strict=True)
        ]
        rows.append((f"{name}, measured", *(number(value) for value in theirs_all)))
        rows.append((f"{name}, ours", *(number(value) for value in ours_all[-1])))
    for name, band in PEAKS.items():
        median, low, high = (value * MBAR for value in band)
        ours = [_peak(run, trace) for run, trace in zip(runs, traces[name], strict=True)]
        ladder.add(
            within(f"{name}: greatest p*, mean over 0.1 t*", "-", ours[-1], low, high, remark=reasons["peak"]),
            ours,
            measured=(median, low, high),
        )
        ladder.add(
            reported(
                f"{name}: the same beside the typical event's under the same filter",
                "-",
                ours[-1],
                reference=FILTERED_PEAKS[name],
            ),
            ours,
        )
    panels = [_pressure_panel(name, runs, traces[name], clipped, given) for name in HEIGHTS]
    front_panels = _fronts_and_levels(ladder, runs, setup, given)
    points = [*ladder.points, *(_formulas(ladder, runs) if setup == WALL else [])]
    return Outcome(
        checks=ladder.checks,
        points=points,
        panels=[*panels, *front_panels],
        tables=[
            ladder.table,
            Table(
                f"Means of p* over half a unit of t*, H/{runs[-1].cells}",
                ("", *(f"{begin:g}–{begin + 0.5:g}" for begin in WINDOWS)),
                rows,
            ),
            *([] if given.quick else [_more_points(runs[1], setup)]),
        ],
        remarks=[
            "A sensor is 4.2 mm wide; a simulated one is a mean over two cells where these are wider. Grey in the "
            "pictures: the typical event, where its table is given, and for the greatest pressure the band of 100 "
            "repeats. Formulas are given the measured speed of the front and the depth that arrives, and are compared "
            "with the greatest mean over that depth and 0.1 t*."
        ],
    )


def _more_points(run: Watched, setup: Setup) -> Table:
    """What more material points in a cell change, beside a run of four, at its spacing."""
    means = sum(len(theirs) for theirs in MEANS.values())
    rows = [("measured", *(number(IMPULSES[name]) for name in HEIGHTS), "")]
    for points, one in ((setup.points, run), (MORE, _watched(replace(setup, points=MORE), run.cells))):
        traces = {name: one.pressure(z / DEPTH, SENSOR / DEPTH) for name, z in HEIGHTS.items()}
        shifts = [ARRIVALS[name] - _first(one.time, trace) for name, trace in traces.items()]
        shift = float(np.clip(np.mean(shifts), -MOST_SHIFT, MOST_SHIFT))
        near = sum(
            abs(mean_between(one.time + shift, traces[name], begin, begin + 0.5) / mean - 1.0) <= 0.15
            for name, theirs in MEANS.items()
            for begin, mean in zip(WINDOWS, theirs, strict=True)
        )
        impulses = [_impulse(one, trace, shift) for trace in traces.values()]
        cells = [
            f"{number(ours)} ({ours / IMPULSES[name] - 1.0:+.0%})" for name, ours in zip(HEIGHTS, impulses, strict=True)
        ]
        rows.append((f"{points} points a cell", *cells, f"{near} of {means}"))
    columns = ("", *(f"{name}: ∫ p* dt*" for name in HEIGHTS), "window means within 15 %")
    return Table(f"What was tried: more points in a cell, H/{run.cells}", columns, rows)


MORE = 16
"""Points in a cell, with which those of the corner at the foot of a wall crowd less."""


def _peak(run: Watched, trace: Array) -> float:
    """Greatest filtered p* of the impact."""
    return float(filtered(trace, FILTER)[run.time < IMPACT_END].max())


def _first(time: Array, values: Array) -> float:
    reached = np.flatnonzero(values > REACHED)
    return float(time[reached[0]]) if reached.size else math.nan


def _near(quantity: str, unit: str, ours: float, theirs: float, limit: float) -> Check:
    """`ours` within `limit` of `theirs`, both in the unit."""
    error = abs(ours - theirs)
    return Check(
        quantity=quantity,
        unit=unit,
        ours=ours,
        reference=number(theirs),
        error=error,
        limit=limit,
        percent=False,
        passed=bool(error <= limit),
    )


def _impulse(run: Watched, trace: Array, shift: float) -> float:
    """∫ p* dt* until `IMPULSE_END` on the clock of the experiment."""
    sums = np.cumsum(trace) * RECORD
    return float(np.interp(IMPULSE_END - shift, run.time, sums))


def _pressure_panel(name: str, runs: list[Watched], traces: list[Array], shifts: list[float], given: Given) -> Panel:
    _, low, high = (value * MBAR for value in PEAKS[name])
    arrival = ARRIVALS[name]
    bands = [Band([arrival - 0.1, arrival + 0.4], [low] * 2, [high] * 2, "peak of 100 repeats, 2.5–97.5 %")]
    curves = []
    table = given.tables.get("lobovsky2014_H300_pressure_event_mean_0p02")
    if table is not None:
        column = dict(zip(HEIGHTS, ("p1_z3mm", "p2_z15mm", "p3_z30mm", "p4_z80mm"), strict=True))[name]
        curves.append(reference(table.numbers("t_star"), table.numbers(column), "measured, typical event"))
    else:
        steps = np.repeat(np.append(WINDOWS, WINDOWS[-1] + 0.5), 2)[1:-1]
        curves.append(reference(steps, np.repeat(MEANS[name], 2), "measured, means over ½ t*"))
    for run, trace, shift in zip(runs, traces, shifts, strict=True):
        curves.append(Curve(run.time + shift, filtered(trace, FILTER), f"H/{run.cells}, mean over 0.1 t*"))
    return Panel(name, "t*", "p*", curves, bands=bands, x_range=(2.0, 7.5))


def _fronts_and_levels(ladder: Ladder, runs: list[Watched], setup: Setup, given: Given) -> list[Panel]:
    reasons = REASONS[setup]
    shifts = [
        best_shift(
            [(run, run.front, FRONT[:, 0], FRONT[:, 1])]
            + [(run, _smooth_levels(run)[:, k], LEVEL_TIMES, np.array(LEVELS[name])) for k, name in enumerate(GAUGES)]
        )
        for run in runs
    ]
    ladder.add(
        at_most("shift of the clock of front and levels, the one that fits best", "t*", shifts[-1], MOST_SHIFT), shifts
    )
    ours = [
        rms(at_times(run, run.front, FRONT[:, 0], shift) - FRONT[:, 1]) for run, shift in zip(runs, shifts, strict=True)
    ]
    ladder.add(
        at_most("front, rms over nine times", "of H", ours[-1], 0.05, percent=True, remark=reasons["front"]), ours
    )
    ours = [_front_speed(run) for run in runs]
    ladder.add(
        reported("slope of the front, t* from 1.2 to 2.2", "-", ours[-1], reference=FRONT_SPEED),
        ours,
        measured=(FRONT_SPEED, FRONT_SPEED, FRONT_SPEED),
    )
    for k, (name, place) in enumerate(GAUGES.items()):
        theirs = np.array(LEVELS[name])
        ours_all = [
            at_times(run, _smooth_levels(run)[:, k], LEVEL_TIMES, shift)
            for run, shift in zip(runs, shifts, strict=True)
        ]
        ours = [rms(levels - theirs) for levels in ours_all]
        ladder.add(
            at_most(
                f"level at x = {place:g} m ({name}), rms",
                "of H",
                ours[-1],
                0.05,
                percent=True,
                remark=reasons["level"],
            ),
            ours,
        )
        ladder.points += [
            simulated(f"{name}, t* = {time:g}", level, [float(levels[i]) for levels in ours_all], by=ladder.by)
            for i, (time, level) in enumerate(zip(LEVEL_TIMES, LEVELS[name], strict=True))
            if level > 0.05
        ]
    panels = [_front_panel(runs, shifts, given)]
    table = given.tables.get("lobovsky2014_H300_water_levels")
    for k, name in enumerate(GAUGES):
        curves = []
        if table is not None:
            where = {"gauge": name}
            time, level = (table.numbers(column, where=where) for column in ("t_star", "h_star"))
            order = np.argsort(time)
            curves.append(reference(time[order], level[order], "measured"))
            shown = time < LEVEL_TIMES[-1]
            off = at_times(runs[-1], runs[-1].levels[:, k], time[shown], shifts[-1]) - level[shown]
            ladder.checks.append(
                reported(f"level {name} over the whole measured curve until t* = 7, rms", "of H", rms(off))
            )
        curves += [
            Curve(run.time + shift, run.levels[:, k], f"H/{run.cells}") for run, shift in zip(runs, shifts, strict=True)
        ]
        curves.append(Curve(LEVEL_TIMES, LEVELS[name], "measured, means over ½ t*", "ko"))
        panels.append(Panel(f"level {name}, x = {GAUGES[name]:g} m", "t*", "depth / H", curves, x_range=(0.0, 7.5)))
    return panels


def _smooth_levels(run: Watched) -> Array:
    """Means over half a unit of t*, as the measured ones are."""
    return np.stack([filtered(column, 0.5) for column in run.levels.T], axis=1)


def _front_speed(run: Watched) -> float:
    inside = (run.time > 1.2) & (run.time < 2.2)
    return float(np.polyfit(run.time[inside], run.front[inside], 1)[0])


def _front_panel(runs: list[Watched], shifts: list[float], given: Given) -> Panel:
    curves = []
    table = given.tables.get("lobovsky2014_fronts")
    if table is not None:
        own = table.numbers("H_m") == 0.3
        curves.append(reference(table.numbers("t_star")[own], table.numbers("x_over_H")[own], "measured"))
    curves += [Curve(run.time + shift, run.front, f"H/{run.cells}") for run, shift in zip(runs, shifts, strict=True)]
    curves.append(Curve(FRONT[:, 0], FRONT[:, 1], "measured, where compared", "ko"))
    return Panel("front", "t*", "distance from the gate / H", curves, x_range=(0.0, 3.0))


FORMULAS = ("closed_form", "huebl_holzinger_2003", "armanini_2011", "cui_2015", "momentum_jet", "shallow_water_bore")


def formula_pressures(speed: float, depth: float, density: float = 997.0) -> dict[str, float]:
    """Pressures [Pa] of the formulas that need no coefficient of the user's, by their title."""
    return {MODELS[name].title: float(MODELS[name].pressure(density, speed, depth)) for name in FORMULAS}


def _formulas(ladder: Ladder, runs: list[Watched]) -> list[Point]:
    """The greatest mean pressure over the depth that arrives: simulated, and by formulas."""
    ours = [float(filtered(run.pressure(0.5 * ARRIVING, ARRIVING), FILTER).max()) for run in runs]
    ladder.add(
        reported(
            f"greatest mean p* over the lowest {ARRIVING:g} H and 0.1 t*", "-", ours[-1], reference=ARRIVING_PRESSURE
        ),
        ours,
        measured=(ARRIVING_PRESSURE, ARRIVING_PRESSURE, ARRIVING_PRESSURE),
    )
    celerity = math.sqrt(9.81 * DEPTH)
    found = formula_pressures(FRONT_SPEED * celerity, ARRIVING * DEPTH)
    unit = 997.0 * 9.81 * DEPTH
    points = []
    for title, pressure in found.items():
        value = pressure / unit
        ladder.checks.append(reported(f"the same by formula: {title}", "-", value, reference=ARRIVING_PRESSURE))
        by = "closed form" if title == MODELS["closed_form"].title else "pressure formulas"
        measured = (ARRIVING_PRESSURE,) * 3
        points.append(Point(title, by, *measured, value, value, value, label=title.split(" (")[0]))
    return points


# -- Buchner -----------------------------------------------------------------------------------------------------

DIAMETER = 0.15
"""Of Buchner's sensors over H."""

SENSORS: Mapping[str, float] = {"P1": 160.0 / 600.0, "P2": 584.0 / 600.0}
PLATEAU, PLATEAU_MEAN = (3.3, 5.3), 0.538
FIRST_PEAK, FIRST_PEAK_UNTIL = 0.687, 3.3
SECOND_PEAK = (0.84, 0.88)
P1_ARRIVAL, P2_PEAK = 2.47, 0.236
DIGITISED = 0.02
"""Error of the digitised curve in p*."""


BUCHNER_SHORT = (
    "as of Lobovský's sensor at the same height: on a smooth bed and without a gate the water turns in a thin jet that "
    "presses below this sensor; " + NUMERICS + "; how Buchner's gate moves is not known, so that it was not put in; "
    "with Lobovský's, and a bed that holds the water, the pressure at this height is 0.45 to 0.6 from t* = 3.3 to 4.5"
)


def buchner(given: Given) -> Outcome:
    """The plateau of P1, mean p* for 3.3 < t* < 5.3, within 10 %: it is the pressure of the water that stands before
    the wall, which single events share.

    Its first peak within 10 % and the error of the digitised curve, 0.02 of p*: it is one event of one tank, and a
    sensor of 90 mm makes the peak a mean over half of the water's height there.

    Arrival, the second peak (a breaking wave that falls back) and P2 are reported: their repeats are not known.

    No shift of the clock: a plateau and a greatest value do not need one. A miss means that the sustained pressure on
    the wall is wrong. Judged is the finest spacing.
    """
    runs = _runs(given, WALL)
    ladder = Ladder([f"H/{run.cells}" for run in runs])
    lower, upper = ([run.pressure(SENSORS[name], DIAMETER) for run in runs] for name in ("P1", "P2"))
    ours = [mean_between(run.time, trace, *PLATEAU) for run, trace in zip(runs, lower, strict=True)]
    ladder.add(
        compared("P1: mean p* for 3.3 < t* < 5.3", "-", ours[-1], PLATEAU_MEAN, 0.1, remark=BUCHNER_SHORT),
        ours,
        measured=(PLATEAU_MEAN, PLATEAU_MEAN - DIGITISED, PLATEAU_MEAN + DIGITISED),
    )
    ours = [float(trace[run.time < FIRST_PEAK_UNTIL].max()) for run, trace in zip(runs, lower, strict=True)]
    ladder.add(
        within(
            "P1: first peak",
            "-",
            ours[-1],
            0.9 * FIRST_PEAK - DIGITISED,
            1.1 * FIRST_PEAK + DIGITISED,
            remark=BUCHNER_SHORT,
        ),
        ours,
        measured=(FIRST_PEAK, FIRST_PEAK - DIGITISED, FIRST_PEAK + DIGITISED),
    )
    ours = [_first(run.time, trace) for run, trace in zip(runs, lower, strict=True)]
    ladder.add(
        reported("P1: arrival, p* > 0.1", "t*", ours[-1], reference=P1_ARRIVAL),
        ours,
        measured=(P1_ARRIVAL, P1_ARRIVAL - DIGITISED, P1_ARRIVAL + DIGITISED),
    )
    ours = [float(filtered(trace, FILTER)[run.time > PLATEAU[1]].max()) for run, trace in zip(runs, lower, strict=True)]
    ladder.add(
        reported("P1: second peak, mean over 0.1 t*", "-", ours[-1], reference=0.5 * sum(SECOND_PEAK)),
        ours,
        measured=(0.5 * sum(SECOND_PEAK), *SECOND_PEAK),
    )
    ours = [float(filtered(trace, FILTER).max()) for trace in upper]
    ladder.add(
        reported("P2: greatest p*, mean over 0.1 t*", "-", ours[-1], reference=P2_PEAK),
        ours,
        measured=(P2_PEAK, P2_PEAK - DIGITISED, P2_PEAK + DIGITISED),
    )
    table = given.tables.get("buchner2002_wall_pressure")
    panels = []
    for name, traces in (("P1", lower), ("P2", upper)):
        curves = [
            Curve(run.time, filtered(trace, FILTER), f"H/{run.cells}") for run, trace in zip(runs, traces, strict=True)
        ]
        bands = []
        if table is not None:
            time, value = (table.numbers(column, where={"sensor": name}) for column in ("t_star", "p_star"))
            bands.append(Band(time, value - DIGITISED, value + DIGITISED, "measured ± 0.02"))
        elif name == "P1":
            bands.append(Band(PLATEAU, [PLATEAU_MEAN - DIGITISED] * 2, [PLATEAU_MEAN + DIGITISED] * 2, "measured mean"))
        panels.append(Panel(f"{name}, mean over 0.1 t*", "t*", "p*", curves, bands=bands, x_range=(2.0, 7.5)))
    return Outcome(
        checks=ladder.checks,
        points=ladder.points,
        panels=panels,
        tables=[ladder.table],
        remarks=[
            "The tank has the proportions of Lobovský's, so that the same runs serve both; only their ceiling at 2 H "
            "is Lobovský's. Both experiments have a sensor at 0.267 H: the mean for 3.3 < t* < 5.3 is 0.538 here and "
            "0.51 there, by sensors of 0.15 H and 0.014 H."
        ],
    )
