"""What the paper says of its simulations in §2.3, each statement as a check with our figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from warp_mpm.validation.paper_runs import PaperRun

Runs = Mapping[str, PaperRun]
SLIDING = ("case_1", "case_3", "case_4")
"""The standing jumps on sliding barriers, 10 m/s."""


@dataclass(frozen=True)
class Statement:
    """A sentence of the paper, what we measure for it, and whether our simulations agree."""

    text: str
    measured: Callable[[Runs], str]
    agrees: Callable[[Runs], bool]


def _kpa(value: float) -> str:
    return f"{value / 1e3:.0f} kPa"


def _kn(value: float) -> str:
    return f"{value / 1e3:.0f} kN/m"


def _list(runs: Runs, names: tuple[str, ...], value: Callable[[PaperRun], float], form: str) -> str:
    return ", ".join(f"{runs[name].title} {format(value(runs[name]), form)}" for name in names)


def _peak(run: PaperRun) -> float:
    """Greatest horizontal force on the face, mean over 0.05 s [kN/m]."""
    return float(run.summary["peak_force_filtered"]) / 1e3


def _pressure(run: PaperRun) -> float:
    return run.pressure / 1e3


def _vertical(run: PaperRun) -> float:
    """Greatest downward force on the face [kN/m]."""
    return -float(run.smooth("impact_force_y").min()) / 1e3


def _top(run: PaperRun) -> float:
    """Greatest friction on the crest [kN/m]."""
    return float(np.abs(run.smooth("top_force")).max()) / 1e3


def _jet_time(run: PaperRun) -> float:
    """Time from which on the flow has less than half its kinetic energy [s]."""
    energy = run.series["flow_kinetic_energy"]
    return float(run.series["time"][np.argmax(energy < 0.5 * energy[0])])


def _peak_over_next_second(run: PaperRun) -> float:
    """Peak force over the mean of the second after it."""
    time = float(run.summary["peak_force_filtered_time"])
    end = min(time + 1.0, float(run.series["time"][-1]))
    return 1e3 * _peak(run) / run.mean("impact_force_x", time, end) if end - time > 0.2 else 1.0


def _first_impact(run: PaperRun) -> float:
    """Greatest force in the first second after arrival over the greatest of the whole run."""
    start = float(run.summary["impact_start_time"])
    force, time = run.smooth("impact_force_x"), run.series["time"]
    return float(force[time < start + 1.0].max() / force.max())


def _rebounds(run: PaperRun) -> float:
    """Kinetic energy regained after t = 2 s, over that at the start."""
    energy = run.series["flow_kinetic_energy"]
    after = energy[run.series["time"] >= 2.0]
    return float((after - np.minimum.accumulate(after)).max() / energy[0])


STATEMENTS: tuple[Statement, ...] = (
    Statement(
        "Before the impact the liquid pressure is below 30 kPa.",
        lambda r: _kpa(r["case_1"].at("pore_pressure_max", 0.0)),
        lambda r: r["case_1"].at("pore_pressure_max", 0.0) < 30e3,
    ),
    Statement(
        "It is greatest in the first instants of the impact, about t = 1 s, and diminishes later.",
        lambda r: (
            f"case 1, greatest over ±0.05 s: {', '.join(f'{_kpa(_near(r, t))} at {t:g} s' for t in (0.5, 1, 2, 4))}"
        ),
        lambda r: _near(r, 1.0) > _near(r, 4.0),
    ),
    Statement(
        "p_L,max is higher on the infinite wall than on the fixed embankment, as no overtopping is allowed.",
        lambda r: _list(r, ("case_5", "case_1_fixed"), _pressure, ".0f") + " kPa at 1 s",
        lambda r: r["case_5"].pressure > r["case_1_fixed"].pressure,
    ),
    Statement(
        "At t = 2 s the flow overtops the fixed embankment in a prolonged jet; later it falls down.",
        lambda r: _list(r, ("case_1_fixed",), lambda run: 100 * run.overtopped, ".0f") + " % of the flow overtops",
        lambda r: r["case_1_fixed"].overtopped > 0.05,
    ),
    Statement(
        "The bore of the wall goes upstream; the embankment's standing jump lets a part overtop with little energy.",
        lambda r: f"{r['case_5'].summary['mechanism']}; {r['case_1_fixed'].summary['mechanism']}",
        lambda r: (
            r["case_5"].summary["mechanism"] == "bore" and r["case_1_fixed"].summary["mechanism"] == "standing jump"
        ),
    ),
    Statement(
        "p_L,max is 11 % lower when the barrier is free to slide.",
        lambda r: f"{100 * (1 - r['case_1'].pressure / r['case_1_fixed'].pressure):.0f} % lower",
        lambda r: 0.05 < 1 - r["case_1"].pressure / r["case_1_fixed"].pressure < 0.17,
    ),
    Statement(
        "Less flow goes beyond the barrier when it is free to slide.",
        lambda r: _list(r, ("case_1", "case_1_fixed"), lambda run: 100 * run.overtopped, ".1f") + " %",
        lambda r: r["case_1"].overtopped < r["case_1_fixed"].overtopped,
    ),
    Statement(
        "A higher barrier lowers p_L,max (135 to 123 kPa).",
        lambda r: _list(r, ("case_1", "case_4"), _pressure, ".0f") + " kPa at 1 s",
        lambda r: r["case_4"].pressure < r["case_1"].pressure,
    ),
    Statement(
        "A steeper face raises p_L,max (135 to 146 kPa).",
        lambda r: _list(r, ("case_1", "case_3"), _pressure, ".0f") + " kPa at 1 s",
        lambda r: r["case_3"].pressure > r["case_1"].pressure,
    ),
    Statement(
        "All sliding barriers have a lower p_L,max than the fixed one.",
        lambda r: _list(r, (*SLIDING, "case_1_fixed"), _pressure, ".0f") + " kPa at 1 s",
        lambda r: all(r[name].pressure < r["case_1_fixed"].pressure for name in SLIDING),
    ),
    Statement(
        "Cases 1, 3 and 4 are standing jumps.",
        lambda r: ", ".join(str(r[name].summary["mechanism"]) for name in SLIDING),
        lambda r: all(r[name].summary["mechanism"] == "standing jump" for name in SLIDING),
    ),
    Statement(
        "The retained volume grows with the steepness of the face and with the barrier's height.",
        lambda r: _list(r, SLIDING, lambda run: run.retained, ".1f") + " m³/m",
        lambda r: min(r["case_3"].retained, r["case_4"].retained) > r["case_1"].retained,
    ),
    Statement(
        "The final displacement grows with the steepness and with a smaller base.",
        lambda r: _list(r, SLIDING, lambda run: run.displacement, ".2f") + " m",
        lambda r: min(r["case_3"].displacement, r["case_4"].displacement) > r["case_1"].displacement,
    ),
    Statement(
        "A faster flow raises p_L,max (135 to 172 kPa).",
        lambda r: _list(r, ("case_1", "case_2"), _pressure, ".0f") + " kPa at 1 s",
        lambda r: r["case_2"].pressure > r["case_1"].pressure,
    ),
    Statement(
        "Case 2 is an airborne jet, and retains much less than the standing jumps.",
        lambda r: (
            f"{r['case_2'].summary['mechanism']}; "
            + _list(r, ("case_2", *SLIDING), lambda run: run.retained, ".1f")
            + " m³/m"
        ),
        lambda r: (
            r["case_2"].summary["mechanism"] == "airborne jet"
            and r["case_2"].retained < 0.7 * min(r[name].retained for name in SLIDING)
        ),
    ),
    Statement(
        "Case 6 is a bore; its flow does not overtop the barrier.",
        lambda r: f"{r['case_6'].summary['mechanism']}, {100 * r['case_6'].overtopped:.1f} % overtops",
        lambda r: r["case_6"].summary["mechanism"] == "bore" and r["case_6"].overtopped < 0.05,
    ),
    Statement(
        "The peak of F_2,x is similar in all cases of 10 m/s but case 3, which has the highest.",
        lambda r: _list(r, ("case_1", "case_1_dry", "case_1_undrained", "case_4", "case_3"), _peak, ".0f") + " kN/m",
        lambda r: all(_peak(r["case_3"]) > _peak(r[name]) for name in ("case_1", "case_4", "case_1_undrained")),
    ),
    Statement(
        "Case 6 shows no peak at the impact.",
        lambda r: (
            f"first second over the greatest later: {_first_impact(r['case_6']):.2f} in case 6, "
            f"{_first_impact(r['case_1']):.2f} in case 1"
        ),
        lambda r: _first_impact(r["case_6"]) < 1.0 and _peak_over_next_second(r["case_6"]) < 1.3,
    ),
    Statement(
        "The force of the dry flow differs from the two-phase ones for t > 2 s: the liquid prolongs the interaction.",
        lambda r: (
            ", ".join(
                f"{r[name].title} {_kn(r[name].mean('impact_force_x', 2.0, 4.0))}" for name in ("case_1_dry", "case_1")
            )
            + " in the mean of 2 to 4 s"
        ),
        lambda r: (
            r["case_1"].mean("impact_force_x", 2.0, 4.0) > 1.05 * r["case_1_dry"].mean("impact_force_x", 2.0, 4.0)
        ),
    ),
    Statement(
        "The vertical force F_2,y is lowest for case 3 (80°).",
        lambda r: _list(r, SLIDING, _vertical, ".0f") + " kN/m downward at most",
        lambda r: _vertical(r["case_3"]) < min(_vertical(r["case_1"]), _vertical(r["case_4"])),
    ),
    Statement(
        "The displacement grows as the vertical force approaches nil.",
        lambda r: ", ".join(
            f"{r[name].title} {_vertical(r[name]):.0f} kN/m and {r[name].displacement:.2f} m" for name in SLIDING
        ),
        lambda r: (
            sorted(SLIDING, key=lambda name: _vertical(r[name]))
            == sorted(SLIDING, key=lambda name: -r[name].displacement)
        ),
    ),
    Statement(
        "The undrained flow has the greatest pore pressure, overtops most and has the greatest vertical force.",
        lambda r: "; ".join(
            f"{r[name].title} {_pressure(r[name]):.0f} kPa, {100 * r[name].overtopped:.1f} %, "
            f"{_vertical(r[name]):.0f} kN/m"
            for name in ("case_1_undrained", "case_1")
        ),
        lambda r: (
            r["case_1_undrained"].pressure > r["case_1"].pressure
            and r["case_1_undrained"].overtopped > r["case_1"].overtopped
            and _vertical(r["case_1_undrained"]) > _vertical(r["case_1"])
        ),
    ),
    Statement(
        "F_3 on the crest is highest for case 1, where the retained volume is smallest.",
        lambda r: _list(r, SLIDING, _top, ".0f") + " kN/m",
        lambda r: _top(r["case_1"]) > max(_top(r["case_3"]), _top(r["case_4"])),
    ),
    Statement(
        "F_3 can change sign, as in case 4, when flow falls back into the retained volume.",
        lambda r: (
            f"case 4: {_kn(float(r['case_4'].smooth('top_force').min()))} "
            f"to {_kn(float(r['case_4'].smooth('top_force').max()))}"
        ),
        lambda r: float(r["case_4"].smooth("top_force").min()) < -100.0,
    ),
    Statement(
        "F_3 is small beside F_4.",
        lambda r: f"case 1: {_top(r['case_1']):.0f} beside {r['case_1'].smooth('base_force').max() / 1e3:.0f} kN/m",
        lambda r: 1e3 * _top(r["case_1"]) < 0.1 * float(r["case_1"].smooth("base_force").max()),
    ),
    Statement(
        "F_1 is nil: the ground is smooth.",
        lambda r: f"{max(float(np.abs(run.series['ground_force_x']).max()) for run in r.values()):.2g} N/m",
        lambda r: all(float(np.abs(run.series["ground_force_x"]).max()) == 0.0 for run in r.values()),
    ),
    Statement(
        "The flow's kinetic energy falls sharply until about t = 2 s.",
        lambda r: f"case 1: {100 * r['case_1'].energy_share(2.0):.0f} % left at 2 s",
        lambda r: r["case_1"].energy_share(2.0) < 0.3,
    ),
    Statement(
        "It falls faster on steeper faces.",
        lambda r: _list(r, ("case_1", "case_4", "case_3"), _jet_time, ".2f") + " s until half of it is gone",
        lambda r: _jet_time(r["case_3"]) < _jet_time(r["case_4"]) < _jet_time(r["case_1"]),
    ),
    Statement(
        "In case 6 it falls slowly and evenly, without secondary peaks.",
        lambda r: (
            f"half gone after {_jet_time(r['case_6']):.1f} s (case 1 {_jet_time(r['case_1']):.1f} s); regained after "
            f"2 s: {100 * _rebounds(r['case_6']):.1f} % (case 1 {100 * _rebounds(r['case_1']):.1f} %)"
        ),
        lambda r: _jet_time(r["case_6"]) > 2.0 * _jet_time(r["case_1"]) and _rebounds(r["case_6"]) < 0.01,
    ),
    Statement(
        "The dry flow has the least kinetic energy of all, and moves the barrier least.",
        lambda r: ", ".join(
            f"{r[name].title} {100 * r[name].energy_share(1.5):.0f} % at 1.5 s and {r[name].displacement:.2f} m"
            for name in ("case_1_dry", "case_1", "case_1_undrained")
        ),
        lambda r: all(
            r["case_1_dry"].at("flow_kinetic_energy", 1.5) < r[name].at("flow_kinetic_energy", 1.5)
            and r["case_1_dry"].displacement < r[name].displacement
            for name in ("case_1", "case_1_undrained")
        ),
    ),
    Statement(
        "Undrained, the kinetic energy is slightly higher than coupled until 2 s, and more so afterwards.",
        lambda r: (
            ", ".join(
                f"{100 * (r['case_1_undrained'].energy_share(t) - r['case_1'].energy_share(t)):+.1f} % at {t:g} s"
                for t in (1.0, 2.0, 3.0, 4.0)
            )
            + " of the start"
        ),
        lambda r: all(r["case_1_undrained"].energy_share(t) > r["case_1"].energy_share(t) for t in (1.0, 2.0, 3.0)),
    ),
)


def _near(runs: Runs, time: float) -> float:
    """Mean of case 1's greatest pore pressure over 0.1 s around a time [Pa]."""
    series = runs["case_1"].series
    around = np.abs(series["time"] - time) <= 0.05
    return float(series["pore_pressure_max"][around].mean())
