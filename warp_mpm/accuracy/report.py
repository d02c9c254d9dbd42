"""Tables and pictures of studies, into a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from analytic.whole_file import write_whole
from warp_mpm.accuracy import pictures
from warp_mpm.accuracy.errors import QUANTITIES
from warp_mpm.accuracy.formulas import formulas
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import Setting
from warp_mpm.accuracy.tables import (
    budget_table,
    csv_table,
    effects_table,
    formula_errors,
    formulas_table,
    markdown,
    prices,
    scenes_table,
)
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
    write_whole(folder / "runs.csv", csv_table(study))
    write_whole(folder / "study.md", markdown(study, found))
    save(pictures.error_against_time(study, found), folder / "error_against_time.png")
    save(pictures.error_of_each_knob(study), folder / "each_setting.png")
    save(pictures.where_time_goes(study), folder / "where_time_goes.png")
    return sentences(study)


def study_block(scenario: Scenario, settings: Sequence[Setting], results: Mapping[str, Result]) -> str:
    """What a page shows of a study: what each percent costs, what each setting does, and the prices of leaving out.

    Raises:
        ValueError: as in `write_study`.
    """
    study, found = evaluate(scenario, settings, results), formulas(scenario)
    rows = [*study.rows, *study.refined]
    spent = sum(row.result["cpu_time"] + row.result["recording_time"] for row in rows)
    lines = [f"{len(settings)} runs, {spent:.0f} s of one core without the effects left out.", "", *prices(study), ""]
    lines += ["**Uncertainty budget.** " + budget_table(study)[0], *budget_table(study)[1:], ""]
    lines += ["What the program concludes from it:", "", *(f"- {said}" for said in sentences(study)), ""]
    if study.effects:
        lines += ["**Leaving an effect out.** " + effects_table(study)[0], *effects_table(study)[1:], ""]
    if found:
        lines += ["**Answers without a simulation.** " + formulas_table(study, found)[0]]
        lines += [*formulas_table(study, found)[1:], ""]
    return "\n".join(lines)


def put_into_page(page: Path, name: str, block: str, pictures: Sequence[Path]) -> None:
    """Replace what stands in a Markdown page between `<!-- accuracy NAME -->` and the next `<!-- end -->`.

    Pictures are copied into `images/accuracy` beside the page and shown above the block.

    Raises:
        ValueError: as in `place_in`.
    """
    before, after = place_in(page, name)
    shown = []
    folder = page.parent / "images" / "accuracy"
    folder.mkdir(parents=True, exist_ok=True)
    for picture in pictures:
        target = folder / f"{name}_{picture.name}"
        target.write_bytes(picture.read_bytes())
        shown += [f"![{name}, {picture.stem.replace('_', ' ')}](images/accuracy/{target.name})", ""]
    write_whole(page, "\n".join([before, "", *shown, block.rstrip(), "", after]))


def place_in(page: Path, name: str) -> tuple[str, str]:
    """What a page holds up to and with `<!-- accuracy NAME -->`, and from the next `<!-- end -->` on.

    Raises:
        ValueError: the page cannot be read, or has no such place.
    """
    begin, end = f"<!-- accuracy {name} -->", "<!-- end -->"
    text = page.read_text(encoding="utf-8") if page.is_file() else ""
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"--page {page} must be a file with the line {begin} and, below it, {end}.")
    return before + begin, end + after


def write_ladders(
    folder: Path, scenes: Sequence[tuple[Scenario, Sequence[Setting]]], results: Mapping[str, Result]
) -> str:
    """Write what the scenes cost and the price of the closed form over them: `error_against_cost.png`,
    `closed_form.md` and `closed_form.png`; returns the tables.

    Raises:
        ValueError: fewer than three spacings of a scene came to their end.
    """
    studies = [(evaluate(scene, settings, results), formulas(scene)) for scene, settings in scenes]
    drawn = [(study, found) for study, found in studies if study.references.key_names]
    save(pictures.price_of_the_closed_form(drawn), folder / "closed_form.png")
    save(pictures.error_against_cost([study for study, _ in drawn]), folder / "error_against_cost.png")
    lines = ["| scene | answer | time | " + " | ".join(QUANTITIES[n].label for n in pictures.PRICED) + " |"]
    lines += ["|---|---|---:|" + "---:|" * len(pictures.PRICED)]
    for study, found in drawn:
        lines.append(_reference_line(study))
        for formula in found:
            wrong = formula_errors(study, formula)
            cells = [f"{wrong[n]:+.0%}" if n in wrong else "–" for n in pictures.PRICED]
            lines.append(f"| | {formula.name} | {formula.time * 1e6:.2g} µs | " + " | ".join(cells) + " |")
    table = "\n".join(lines) + "\n"
    about = "# The price of the closed form\n\nErrors against the converged simulation.\n\n"
    write_whole(folder / "closed_form.md", about + table)
    return "\n".join([*scenes_table([study for study, _ in drawn]), "", table])


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
