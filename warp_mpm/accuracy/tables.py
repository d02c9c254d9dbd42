"""The tables of a study: CSV for programs, Markdown for people."""

from __future__ import annotations

import csv
from io import StringIO

from warp_mpm.accuracy.errors import QUANTITIES
from warp_mpm.accuracy.formulas import Formula
from warp_mpm.accuracy.verdict import TARGETS, Study, sentences

SHOWN = ("peak_force", "impulse", "barrier_displacement_final", "pore_pressure_max", "energy_curve")
"""Quantities of the Markdown table; the CSV has all."""


def csv_table(study: Study) -> str:
    """One line for each run: settings, times, counts, figures (SI), relative errors, on the front or not."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = study.references.names
    scalars = list(study.references.scalars)
    writer.writerow(
        ["setting", "knob", "level", "spacing [m]", "status", "CPU time [s]", "preparation [s]", "recording [s]"]
        + ["steps", "material_points", "on_front", "error of the key figures [-]"]
        + [f"{name} [SI]" for name in scalars]
        + [f"error of {name} [-]" for name in names]
    )
    for row in sorted(study.rows, key=lambda row: row.time):
        result = row.result
        writer.writerow(
            [row.setting.name, row.setting.knob, row.setting.level, row.setting.spacing, result["status"]]
            + [f"{result[name]:.4g}" for name in ("cpu_time", "preparation_time", "recording_time")]
            + [result["steps"], result["material_points"], row in study.fronts["overall"]]
            + [f"{row.overall:.5g}" if row.errors else ""]
            + [_number(result["figures"].get(name)) for name in scalars]
            + [_number(row.errors.get(name)) for name in names]
        )
    return text.getvalue()


def prices(study: Study) -> list[str]:
    """What each percent costs, quantity by quantity: the cheapest setting of all that keeps it."""
    lines = [
        "| quantity | reference | known to | observed order | "
        + " | ".join(f"{target:.0%} costs" for target in TARGETS)
        + " |",
        "|---|---:|---:|---:|" + "---|" * len(TARGETS),
    ]
    for name in ["overall", *study.references.names]:
        cells = ["**key figures**, the worst", "", "", ""]
        if name != "overall":
            quantity, reference = QUANTITIES[name], study.references.scalars.get(name)
            cells = [quantity.label, "a curve", "", ""]
            if reference is not None:
                cells[1] = f"{reference.value * quantity.factor:.4g} {quantity.unit}"
                cells[3] = "none" if reference.order is None else f"{reference.order:.2g}"
        cells[2] = f"± {study.doubt(name):.1%}"
        for target in TARGETS:
            row = study.price(name, target)
            cells.append("–" if row is None else f"{row.time:.2g} s ({row.setting.name})")
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, "", "–: no setting of the study keeps it, or the reference is not known so well."]


def markdown(study: Study, found: list[Formula]) -> str:
    """The study in a page: what it says, prices, runs, effects, formulas."""
    shown = [name for name in SHOWN if name in study.references.names]
    lines = [f"# What accuracy costs: {study.scenario.title}", ""]
    lines += [
        "Times are CPU times of the stepping on one core of the machine of the study; a machine that is busy with "
        "other things does not stretch them. Errors are relative to the reference, of times to T₂, of volumes to "
        "the flow's, of curves the root mean square over the greatest value. The error of the key figures is the "
        "greatest of those of "
        f"{', '.join(QUANTITIES[name].label for name in study.references.key_names)}.",
        "",
        "## What it says",
        "",
        *(f"- {sentence}" for sentence in sentences(study)),
        "",
        "## What each percent costs",
        "",
        *prices(study),
    ]
    lines += ["", "## Runs, cheapest first", ""]
    headings = ["setting", "CPU time [s]", "steps", "key figures"] + [_short(name) for name in shown]
    lines += ["| " + " | ".join(headings) + " | front |", "|---|" + "---:|" * (len(headings) - 1) + "---|"]
    for row in sorted(study.rows, key=lambda row: row.time):
        cells = [row.setting.name, f"{row.time:.2g}", str(row.result["steps"])]
        if row.errors:
            cells += [f"{row.overall:.1%}", *(_signed(row.errors.get(name)) for name in shown)]
        else:
            cells += ["diverged", *("" for _ in shown)]
        lines.append("| " + " | ".join(cells) + f" | {'*' if row in study.fronts['overall'] else ''} |")
    if study.effects:
        lines += ["", "## The price of leaving an effect out", "", *effects_table(study)]
    if found:
        lines += ["", "## The price of the closed form", "", *formulas_table(study, found)]
    return "\n".join(lines) + "\n"


def effects_table(study: Study) -> list[str]:
    """How far off and how much faster the scene is without one effect."""
    names = [name for name in study.references.scalars if any(name in effect.changes for effect in study.effects)]
    lines = [
        "Changes from the whole scene at the same spacing.",
        "",
        "| in place of the whole | CPU time | " + " | ".join(_short(name) for name in names) + " |",
        "|---|---:|" + "---:|" * len(names),
    ]
    for effect in study.effects:
        cells = [effect.name, f"{effect.time_ratio:.0%}", *(_signed(effect.changes.get(name)) for name in names)]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def formulas_table(study: Study, found: list[Formula]) -> list[str]:
    """Time and errors of the answers without a simulation."""
    names = [name for name in study.references.scalars if any(name in formula.figures for formula in found)]
    lines = [
        "Errors against the converged simulation.",
        "",
        "| formula | time | " + " | ".join(_short(name) for name in names) + " |",
        "|---|---:|" + "---:|" * len(names),
    ]
    for formula in found:
        errors = formula_errors(study, formula)
        cells = [formula.name, f"{formula.time * 1e6:.2g} µs", *(_signed(errors.get(name)) for name in names)]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def formula_errors(study: Study, formula: Formula) -> dict[str, float]:
    """Relative errors of a formula against the references, signed, by quantity."""
    known = study.references
    return {
        name: (value - known.scalars[name].value) / known.scales[name]
        for name, value in formula.figures.items()
        if name in known.scalars
    }


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _signed(value: float | None) -> str:
    return "–" if value is None else f"{value:+.1%}"


def _short(name: str) -> str:
    return QUANTITIES[name].label.split(" (")[0]
