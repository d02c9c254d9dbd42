"""The tables of a study: CSV for programs, Markdown for people."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from io import StringIO

from warp_mpm.accuracy.budget import LABELS, SPACING, TOGETHER
from warp_mpm.accuracy.errors import KEY_QUANTITIES, QUANTITIES
from warp_mpm.accuracy.formulas import Formula
from warp_mpm.accuracy.verdict import TARGETS, Study, sentences

SHOWN = ("peak_force", "impulse", "barrier_displacement_final", "pressure_patch_max", "energy_curve")
"""Quantities of the Markdown table; the CSV has all."""

CURVES_TOLD = ("force_curve", "energy_curve", "displacement_curve")
"""Curves whose uncertainty is told part by part beside that of the figures."""


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
    for row in sorted([*study.rows, *study.refined], key=lambda row: row.time):
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
        converges = name == "overall" or QUANTITIES[name].converges
        cells[2] = f"± {study.doubt(name):.1%}" if converges else "–"
        for target in TARGETS:
            row = study.price(name, target)
            cells.append("–" if row is None else f"{row.time:.2g} s ({row.setting.name})")
        lines.append("| " + " | ".join(cells) + " |")
    return [
        *lines,
        "",
        "–: no setting of the study keeps it, or the reference is not known so well. Known to: spacing and shared "
        "settings together, see the uncertainty budget.",
    ]


def budget_table(study: Study) -> list[str]:
    """What makes up the uncertainty of the references: the spacing, and each setting that all spacings share."""
    budget = study.references.budget
    if budget.at is None:
        return ["The uncertainty is the spacing's alone: what the runs share was not looked at."]
    names = [name for name in study.references.names if name in (*study.references.told_names, *CURVES_TOLD)]
    finer = {row.setting.knob: row.setting.name.partition(",")[0] for row in study.refined}
    lines = [
        f"What each cause does. Settings were refined one by one at {budget.at:g} m, each held against the scenario's "
        "own settings there. The part of the settings is the root of the squares of their changes, or the change with "
        "all of them at once where that is more; twice that where all of them at once do the same at both spacings, so "
        "that it does not fall. Known to: the root of the squares of the spacing's part and of the settings'.",
        "",
        "| cause | refined to | " + " | ".join(_short(name) for name in names) + " |",
        "|---|---|" + "---:|" * len(names),
        _line(LABELS[SPACING], "its limit", [f"± {budget.spacing[name]:.2%}" for name in names]),
    ]
    lines += [
        _line(LABELS[cause], finer[cause].rpartition(" ")[2], [_change(part.get(name)) for name in names])
        for cause, part in budget.settings.items()
    ]
    lines += [
        _line(TOGETHER, f"the same, at {spacing:g} m", [_change(part.get(name)) for name in names])
        for spacing, part in sorted(budget.together.items(), reverse=True)
    ]
    shared = [f"± {budget.shared(name):.2%}{' (twice)' if budget.stays(name) else ''}" for name in names]
    lines.append(_line("part of the settings", "", shared))
    lines.append(_line("**known to**", "", [f"**± {budget.total(name):.2%}**" for name in names]))
    lines.append(_line("greatest part", "", [budget.greatest(name) for name in names]))
    if budget.lost:
        lines += ["", f"Diverged when refined, so not in the table: {', '.join(budget.lost)}."]
    return lines


def scenes_table(studies: Sequence[Study]) -> list[str]:
    """How far the key figures of several scenes are known, what limits that, and how their errors fall."""
    known = " | ".join(f"{_short(name)} known to" for name in KEY_QUANTITIES)
    lines = [
        f"| scene | {known} | greatest part of the worst | the worst error falls | spacing for 5% |",
        "|---|" + "---:|" * len(KEY_QUANTITIES) + "---|---|---:|",
    ]
    for study in studies:
        references, worst, spacing = study.references, study.worst, study.recommended_spacing
        doubts = [f"± {study.doubt(name):.1%}" if name in references.key_names else "–" for name in KEY_QUANTITIES]
        cause = f"{_short(worst)}: {references.budget.greatest(worst)}"
        advised = "–" if spacing is None else f"{spacing:g} m"
        lines.append(_line(study.scenario.title, doubts, cause, str(study.slopes["overall"]), advised))
    return lines


def _line(*cells: str | list[str]) -> str:
    return "| " + " | ".join(" | ".join(cell) if isinstance(cell, list) else cell for cell in cells) + " |"


def _change(value: float | None) -> str:
    return "–" if value is None else f"{value:+.2%}"


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
        "",
        "## How far the reference is known",
        "",
        *budget_table(study),
    ]
    lines += ["", "## Runs, cheapest first", ""]
    headings = ["setting", "CPU time [s]", "steps", "key figures"] + [_short(name) for name in shown]
    lines += ["| " + " | ".join(headings) + " | front |", "|---|" + "---:|" * (len(headings) - 1) + "---|"]
    for row in sorted([*study.rows, *study.refined], key=lambda row: row.time):
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
