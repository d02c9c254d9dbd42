"""The report as a workbook: tables and time series as numbers, with units, for one's own sums and charts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analytic.version import versions
from analytic.whole_file import whole_file
from warp_mpm.design_checks import CHECKS, GUIDELINES, TOLD
from warp_mpm.extras import missing
from warp_mpm.quantities import Quantity
from warp_mpm.quantities.figures import FIGURES
from warp_mpm.report.content import flattened, ledger_values, run_content
from warp_mpm.results import Results

if TYPE_CHECKING:
    from openpyxl import Workbook

MOST_LETTERS = 32_767
"""Of a cell."""

MOST_ROWS = 1_048_576
"""Of a sheet."""

LONGEST_NAME = 31
"""Letters of a sheet's name."""

WIDEST = 60
"""Of a column, in letters."""

CHARTED = ("impact_force_x", "barrier_displacement")

Row = Sequence[Any]


def write_workbook(runs: Sequence[Results], target: str | Path) -> None:
    """Write the workbook of one run or of several, whole or not at all: `Figures`, `Verdict` and `Barriers` where there
    are any, `Ledger`, `Settings`, `Notes`, and a sheet of each run's time series.

    Numbers are in the units that stand beside them: in tables those in which people read, in series SI, as in
    `timeseries.csv`.

    Args:
        runs: at least one.
        target: the file; one that is there is replaced.

    Raises:
        ValueError: openpyxl is not there; the sentence says how to install it.
        ResultsError: a run cannot be read.
        UnwrittenError: the file cannot be written.
    """
    try:
        from openpyxl import Workbook
    except ImportError:
        raise ValueError(missing("A workbook", "openpyxl", "xlsx")) from None
    names = _names(runs)
    book = Workbook(write_only=True)
    book.properties.creator, book.properties.title = "warp-mpm", " · ".join(names)
    summaries = [results.summary for results in runs]
    _sheet(book, "Figures", ["figure", "unit", *names, "meaning"], _figures(summaries))
    verdicts = [summary.get("verdict") for summary in summaries]
    if any(verdicts):
        header = ["run", "what", "unit", "value", "limit", "at least or at most", "at [s]", "holds", "formula"]
        _sheet(book, "Verdict", header, _verdict(names, verdicts))
    if any(summary.get("barriers") for summary in summaries):
        _sheet(book, "Barriers", *_barriers(names, summaries))
    ledgers = [_ledger(results) for results in runs]
    units = {words: unit for one in ledgers for words, (_, unit) in one.items()}
    rows = [[words, unit, *(one.get(words, (None,))[0] for one in ledgers)] for words, unit in units.items()]
    _sheet(book, "Ledger", ["what was there, came and went", "unit", *names], rows)
    settings = [dict(flattened(results.scenario.resolved())) for results in runs]
    rows = [[path, *(one.get(path) for one in settings)] for path in _union(settings)]
    _sheet(book, "Settings", ["field", *names], rows)
    _sheet(book, "Notes", ["run", "kind", "text"], _notes(names, runs))
    for results, name in zip(runs, names, strict=True):
        _series(book, results, name)
    with whole_file(Path(target)) as aside:
        book.save(aside)


def _names(runs: Sequence[Results]) -> list[str]:
    """What the runs are called: names of sheets, which are short and differ."""
    names: list[str] = []
    for results in runs:
        plain = "".join("_" if letter in "[]:*?/\\'" else letter for letter in results.path.resolve().name)
        name, count = plain[:LONGEST_NAME] or "run", 1
        while name.casefold() in {*(one.casefold() for one in names), *RESERVED}:
            count += 1
            name = f"{plain[: LONGEST_NAME - 4]} {count}"
        names.append(name)
    return names


RESERVED = {"figures", "verdict", "barriers", "ledger", "settings", "notes", "history"}
"""Names of the other sheets, and one that the program that opens the file keeps to itself."""


def _union(parts: Iterable[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(name for part in parts for name in part))


def _figures(summaries: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Figures in the order in which they first come, those that a table has a word for in people's units."""
    rows: list[Row] = []
    for name in _union(summaries):
        values = [summary.get(name) for summary in summaries]
        if all(value is None or isinstance(value, dict | list) for value in values):
            continue
        figure: Quantity | None = FIGURES.get(name)
        if figure is None and name.endswith("_time"):
            figure = Quantity(name, "s", f"time of {name.removesuffix('_time')}")
        if figure is None:
            rows.append([name.replace("_", " "), "", *values, ""])
            continue
        shown: list[Any] = [one * figure.factor if _number(one) else one for one in values]  # type: ignore[operator]
        words = " ".join((figure.words, figure.symbol)).strip()
        rows.append([words, figure.shown_unit, *shown, figure.meaning])
    return rows


def _ledger(results: Results) -> dict[str, tuple[float, str]]:
    """Values and units, as people read them, by words."""
    rows = ledger_values(results.time_series, results.summary)
    return {words: (value * one.factor, one.shown_unit) for words, value, one in rows}


def _verdict(names: Sequence[str], verdicts: Sequence[Mapping[str, Any] | None]) -> list[Row]:
    rows: list[Row] = []
    for run, verdict in zip(names, verdicts, strict=True):
        if verdict is None:
            continue
        rows.append([run, "verdict", "", None, None, "", None, _answer(verdict["holds"]), ""])
        of = [("", verdict["checks"]), *((f"{one['name']}: ", one["checks"]) for one in verdict.get("barriers", ()))]
        for barrier, entry in ((barrier, entry) for barrier, checks in of for entry in checks):
            check = CHECKS[entry["name"]]
            scaled = [None if one is None else one * check.factor for one in (entry["value"], entry["limit"])]
            side = "" if entry["limit"] is None else "at least" if check.least else "at most"
            answer = "" if entry["limit"] is None else _answer(entry["holds"])
            words = f"{barrier}{check.words}"
            rows.append([run, words, check.shown_unit, *scaled, side, entry["time"], answer, check.formula])
        beside = [("", TOLD, verdict["told"]), ("", GUIDELINES, verdict["guidelines"])]
        beside += [(f"{one['name']}: ", TOLD, one["told"]) for one in verdict.get("barriers", ())]
        for barrier, table, entries in beside:
            for entry in entries:
                told = table[entry["name"]]
                words, value = f"{barrier}{told.words.strip()}", entry["value"] * told.factor
                rows.append([run, words, told.shown_unit, value, None, "", None, "", told.formula])
        rows += [[run, sentence, "", None, None, "", None, "", ""] for sentence in verdict["remarks"]]
    return rows


def _answer(holds: bool | None) -> str:
    return {True: "holds", False: "FAILS", None: "not known"}[holds]


def _barriers(names: Sequence[str], summaries: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[Row]]:
    """A row for each barrier of each run, SI."""
    found = [(run, row) for run, summary in zip(names, summaries, strict=True) for row in summary.get("barriers") or ()]
    columns = [name for name in _union(row for _, row in found) if not isinstance(found[0][1].get(name), dict | list)]
    return ["run", *columns], [[run, *(row.get(column) for column in columns)] for run, row in found]


def _notes(names: Sequence[str], runs: Sequence[Results]) -> list[Row]:
    rows: list[Row] = [["", "workbook", f"made by {versions()}; forces, masses and volumes are per metre of width"]]
    for run, results in zip(names, runs, strict=True):
        content = run_content(results, run)
        rows += [[run, "title", content["title"]], [run, "scene", content["description"]]]
        rows += [[run, "warning", sentence] for sentence in content["warnings"]]
        rows += [[run, "assumed or remarked", sentence] for sentence in content["notes"]]
        rows += [[run, "effect", f"{name}: {why}"] for name, why in content["effects"].items()]
        rows += [[run, name, value] for name, value in content["versions"].items()]
    return rows


def _series(book: Workbook, results: Results, name: str) -> None:
    """Names, units, meanings, and below them the samples; of longer series than a sheet takes one in so many."""
    from openpyxl.chart import Reference, ScatterChart, Series

    series = results.time_series
    quantities = [results.quantities.get(column) for column in series]
    stride = max(1, math.ceil(len(series["time"]) / (MOST_ROWS - 3)))
    rows = [
        [one.unit if one is not None else "" for one in quantities],
        [one.meaning if one is not None else "" for one in quantities],
        *zip(*(values[::stride].tolist() for values in series.values()), strict=True),
    ]
    sheet = _sheet(book, name, list(series), rows, frozen="B4", widths=[16] * len(series))
    columns, last = list(series), len(rows) + 1
    for number, charted in enumerate(column for column in CHARTED if column in series):
        chart = ScatterChart(scatterStyle="lineMarker")
        chart.title = results.quantities[charted].words
        chart.x_axis.title, chart.y_axis.title = "time [s]", results.quantities[charted].heading
        chart.x_axis.delete = chart.y_axis.delete = False
        chart.legend, chart.width, chart.height = None, 18, 9
        place = columns.index(charted) + 1
        line = Series(
            Reference(sheet, min_col=place, min_row=4, max_row=last),
            Reference(sheet, min_col=1, min_row=4, max_row=last),
        )
        line.marker.symbol, line.smooth = "none", False
        chart.series.append(line)
        sheet.add_chart(chart, f"{'BK'[number]}6")


def _sheet(
    book: Workbook,
    name: str,
    header: Sequence[str],
    rows: Sequence[Row],
    *,
    frozen: str = "B2",
    widths: Sequence[float] | None = None,
) -> Any:
    """A sheet with a bold head that stays."""
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.styles import Font
    from openpyxl.utils import get_column_letter

    sheet = book.create_sheet(name)
    sheet.freeze_panes = frozen
    for column in range(len(header)):
        texts = [str(row[column]) for row in (header, *rows) if isinstance(row[column], str)] if widths is None else []
        longest = max((len(text) for text in texts), default=12)
        width = widths[column] if widths is not None else min(WIDEST, max(12, longest + 2))
        sheet.column_dimensions[get_column_letter(column + 1)].width = width

    def cell(value: Any, *, bold: bool = False) -> Any:
        made = WriteOnlyCell(sheet, value=_cell(value))
        if isinstance(made.value, str):
            made.data_type = "s"  # a text that begins with = is no formula
        if bold:
            made.font = Font(bold=True)
        return made

    sheet.append([cell(words, bold=True) for words in header])
    for row in rows:
        # Numbers alone, as in a series, go as they are: a cell of its own would take ten times as long.
        plain = all(isinstance(value, float) and math.isfinite(value) for value in row)
        sheet.append(row if plain else [cell(value) for value in row])
    return sheet


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: Any) -> Any:
    """What a cell takes: no number without end, no letter that is none, no longer text."""
    if value is None or isinstance(value, bool) or _number(value):
        return value if not isinstance(value, float) or math.isfinite(value) else None
    text = value if isinstance(value, str) else ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return "".join(letter for letter in text if letter >= " " or letter in "\t\n")[:MOST_LETTERS]
