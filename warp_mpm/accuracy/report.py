"""Tables and pictures of studies, into a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from warp_mpm.accuracy import pictures
from warp_mpm.accuracy.errors import QUANTITIES
from warp_mpm.accuracy.formulas import formulas
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import Setting
from warp_mpm.accuracy.tables import csv_table, formula_errors, markdown
from warp_mpm.accuracy.verdict import Study, evaluate, sentences
from warp_mpm.plotting.style import save
from warp_mpm.scenario import Scenario


def write_study(
    folder: Path, scenario: Scenario, settings: Sequence[Setting], results: Mapping[str, Result]
) -> list[str]:
    """Write `study.md`, `runs.csv` and the pictures of one scene, and return what the study says.

    Raises:
        ValueError: fewer than three spacings came to their end.
    """
    study, found = evaluate(scenario, settings, results), formulas(scenario)
    _write(folder / "runs.csv", csv_table(study))
    _write(folder / "study.md", markdown(study, found))
    save(pictures.error_against_time(study, found), folder / "error_against_time.png")
    save(pictures.error_of_each_knob(study), folder / "each_setting.png")
    save(pictures.where_time_goes(study), folder / "where_time_goes.png")
    return sentences(study)


def write_ladders(
    folder: Path, scenes: Sequence[tuple[Scenario, Sequence[Setting]]], results: Mapping[str, Result]
) -> None:
    """Write the price of the closed form over several scenes: `closed_form.md` and `closed_form.png`.

    Raises:
        ValueError: fewer than three spacings of a scene came to their end.
    """
    studies = [(evaluate(scene, settings, results), formulas(scene)) for scene, settings in scenes]
    drawn = [(study, found) for study, found in studies if study.references.key_names]
    save(pictures.price_of_the_closed_form(drawn), folder / "closed_form.png")
    lines = ["# The price of the closed form", "", "Errors against the converged simulation (SI: as stated).", ""]
    lines += ["| scene | answer | time | " + " | ".join(QUANTITIES[n].label for n in pictures.PRICED) + " |"]
    lines += ["|---|---|---:|" + "---:|" * len(pictures.PRICED)]
    for study, found in drawn:
        lines.append(_reference_line(study))
        for formula in found:
            wrong = formula_errors(study, formula)
            cells = [f"{wrong[n]:+.0%}" if n in wrong else "–" for n in pictures.PRICED]
            lines.append(f"| | {formula.name} | {formula.time * 1e6:.2g} µs | " + " | ".join(cells) + " |")
    _write(folder / "closed_form.md", "\n".join(lines) + "\n")


def _reference_line(study: Study) -> str:
    cells = []
    for name in pictures.PRICED:
        if name not in study.references.scalars:
            cells.append("–")
            continue
        quantity, reference = QUANTITIES[name], study.references.scalars[name]
        doubt = study.references.uncertainty(name)
        cells.append(f"{reference.value * quantity.factor:.3g} {quantity.unit} ± {doubt:.0%}")
    dearest = max(row.time for row in study.rows)
    return f"| {study.scenario.title} | simulation | {dearest:.2g} s | " + " | ".join(cells) + " |"


def _write(path: Path, text: str) -> None:
    aside = path.with_name(path.name + ".new")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)
