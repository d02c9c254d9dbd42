"""The report as a workbook: the run's own numbers with their units, and nothing that a spreadsheet would take amiss."""

import sys
import zipfile

import numpy as np
import openpyxl
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.report import workbook
from warp_mpm.report.workbook import write_workbook
from warp_mpm.results import Results
from warp_mpm.run import run_scenario


@pytest.fixture(scope="module")
def runs(tmp_path_factory, coarse_case_1, flying_points):
    """Two runs of one name, with a title that is a formula to a spreadsheet."""
    folder = tmp_path_factory.mktemp("runs")
    design = {"displacement_m": 0.5, "guidelines": ["hong_kong"]}
    scene = coarse_case_1.replaced({"title": '=HYPERLINK("http://a.example")', "design": design})
    scene = scene.replaced({"output.time_series_interval_s": 0.02, "output.snapshot_interval_s": 0.5})
    for part in ("a", "b"):
        (folder / part).mkdir()
        run_scenario(scene, folder / part / "case: [1]", make_simulation=flying_points)
    return [Results.open(folder / part / "case: [1]") for part in ("a", "b")]


@pytest.fixture(scope="module")
def book(runs, tmp_path_factory):
    path = tmp_path_factory.mktemp("book") / "report.xlsx"
    write_workbook(runs, path)
    return openpyxl.load_workbook(path)


def table(sheet):
    """Rows below the head, by their first cell."""
    head, *rows = sheet.iter_rows(values_only=True)
    return {row[0]: dict(zip(head[1:], row[1:], strict=True)) for row in rows}


def test_series_are_those_of_the_csv(runs, book):
    names = [name for name in book.sheetnames if name.startswith("case")]
    assert names == ["case_ _1_", "case_ _1_ 2"]
    for results, name in zip(runs, names, strict=True):
        columns = list(book[name].iter_cols(values_only=True))
        assert [column[0] for column in columns] == list(results.time_series)
        for column, values in zip(columns, results.time_series.values(), strict=True):
            np.testing.assert_allclose(column[3:], values, rtol=1e-15)  # a workbook has 16 digits
        units = {column[0]: column[1] for column in columns}
        assert (units["time"], units["impact_force_x"]) == ("s", "N/m")
        assert len(book[name]._charts) == 2


def test_tables_are_numbers_with_their_units(runs, book):
    summary, run = runs[0].summary, "case_ _1_"
    figures = table(book["Figures"])
    force = figures["peak force F₂ₓ, 0.05 s mean"]
    assert (force["unit"], force[run]) == ("kN/m", pytest.approx(summary["peak_force_filtered"] / 1e3))
    assert figures["peak force F₂ₓ, 0.05 s mean"]["meaning"].startswith("greatest moving mean over 0.05 s")
    assert table(book["Settings"])["numerics.spacing_m"][run] == 0.5
    ledger = table(book["Ledger"])
    assert ledger["error of momentum, relative"][run] == pytest.approx(summary["momentum_error"], rel=1e-15)
    assert ledger["impulse on the impacted face"][run] == pytest.approx(summary["impulse"] / 1e3)
    rows = [row for row in book["Verdict"].iter_rows(values_only=True) if row[0] == run]
    (slid,) = (row for row in rows if row[1] == "displacement")
    assert slid[2:6] == ("m", pytest.approx(summary["barrier_displacement_final"]), 0.5, "at most")
    assert slid[7] == "FAILS"
    assert any(row[1].startswith("Hong Kong") for row in rows)


def test_no_text_is_a_formula_and_no_letter_breaks_the_file(book):
    notes = [(cell.value, cell.data_type) for row in book["Notes"].iter_rows() for cell in row]
    assert ('=HYPERLINK("http://a.example")', "s") in notes
    assert all(cell.data_type != "f" for sheet in book for row in sheet.iter_rows() for cell in row)


@pytest.mark.parametrize(
    ("value", "stored"),
    [
        *((float("nan"), None), (float("inf"), None), (True, True), (3, 3), (None, None), ("x" * 40_000, "x" * 32_767)),
        *(("a\x00b\x1fc\n", "abc\n"), ([1.0, 2.0], "1.0, 2.0")),
    ],
)
def test_what_a_cell_takes(value, stored):
    assert workbook._cell(value) == stored


def test_a_longer_series_than_a_sheet_takes_is_thinned(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(workbook, "MOST_ROWS", 83)
    write_workbook(runs[:1], tmp_path / "thin.xlsx")
    times = [row[0] for row in openpyxl.load_workbook(tmp_path / "thin.xlsx")["case_ _1_"].iter_rows(values_only=True)]
    assert 60 < len(times) <= 83
    assert times[3] == 0.0


def test_the_command_writes_it_whole_or_says_what_is_missing(runs, tmp_path, monkeypatch):
    def typed(*words):
        return CliRunner().invoke(app, ["report", str(runs[0].path), "--xlsx", *map(str, words)])

    answer = typed()
    assert answer.exit_code == 0, answer.output
    assert zipfile.is_zipfile(runs[0].path / "report.xlsx")
    for words, sentence in (
        (["--pdf"], "--xlsx does not go with --pdf"),
        (["--times", "1"], "--xlsx does not go with --times"),
        (["--out", tmp_path / "none" / "a.xlsx"], "must be a file in a folder that exists"),
    ):
        refused = typed(*words)
        assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
        assert sentence in refused.stderr
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    refused = typed("--out", tmp_path / "other.xlsx")
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
    assert refused.stderr.startswith("A workbook needs openpyxl: pip install ")
    assert "openpyxl>=3.1.5" in refused.stderr or "xlsx" in refused.stderr
    assert list(tmp_path.iterdir()) == []
