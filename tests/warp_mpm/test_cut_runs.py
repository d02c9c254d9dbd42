"""Runs that end at any moment: summary, notes, report and comparison tell what there is, and what is still to come."""

import numpy as np
import pytest
from typer.testing import CliRunner

import analytic.cli
from warp_mpm.caveats import run_caveats
from warp_mpm.report import write_report
from warp_mpm.report.content import run_content
from warp_mpm.results import Results, ResultsError
from warp_mpm.run import evaluate, run_scenario
from warp_mpm.summary import energy_error, momentum_error, summarize
from warp_mpm.terminal import summary_rows


@pytest.mark.parametrize("until", [0.005, 0.05, 0.52, 0.7, 0.85, 1.5, 2.5])
def test_a_run_that_ends_anywhere_has_all_that_can_be_told(coarse_case_1, flying_points, tmp_path, until):
    """The force starts at 0.5 s, is greatest at 0.8 s and over at 2 s."""
    scenario = coarse_case_1.replaced({"output.end_time_s": until})
    outcome = run_scenario(scenario, tmp_path / "run", make_simulation=flying_points)
    rises = True if 0.5 < until < 0.8 else False if until > 0.5 else None
    assert outcome.summary["force_still_rises"] is rises
    assert outcome.summary["peak_force"] == 0.0 if rises is None else outcome.summary["peak_force"] > 0.0
    results = Results.open(tmp_path / "run")
    assert any("The force still rises" in note for note in run_caveats(results.record, results.summary)) is bool(rises)
    told = dict(summary_rows(results.summary)).get("rise time T₁, duration T₂")
    assert told == {None: None, True: "the force still rises at the end of the run"}.get(rises, told)
    warnings = " ".join(run_content(results, "run")["warnings"])
    assert ("there is no peak to calibrate on" in warnings) is bool(rises)
    assert ("there is no impact to calibrate on" in warnings) is (rises is None and until > 0.005)
    write_report([results], tmp_path / "report.html")
    compared = CliRunner().invoke(analytic.cli.app, ["compare", str(tmp_path / "run"), "--json"])
    # A file of two samples is none that it reads.
    assert compared.exit_code == (2 if until == 0.005 else 0), compared.output
    assert ("the force still rises at the end of the record" in compared.output) is bool(rises)


def test_a_series_cut_at_any_byte_is_summed_up_or_refused(coarse_case_1, flying_points, tmp_path):
    """As a full disk or a copy that broke off leaves it."""
    scenario = coarse_case_1.replaced({"output.end_time_s": 0.7, "output.time_series_interval_s": 0.05})
    run_scenario(scenario, tmp_path / "run", make_simulation=flying_points)
    path = tmp_path / "run" / "timeseries.csv"
    whole = path.read_bytes()
    first_line = whole.index(b"\n") + 1
    refused, samples = 0, set()
    for length in [*range(0, first_line + 40, 37), *np.linspace(first_line + 400, len(whole), 25).astype(int)]:
        path.write_bytes(whole[:length])
        try:
            results = Results.open(tmp_path / "run")
            summary = summarize(results.scenario, results.time_series, None, {})
            samples.add(summary["end_time"])
            run_content(results, "run")
        except ResultsError:
            refused += 1
    assert refused > 5
    assert len(samples) > 5


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_a_figure_that_is_no_number_is_an_error(coarse_case_1, flying_points, tmp_path, value):
    scenario = coarse_case_1.replaced({"output.end_time_s": 0.7, "output.time_series_interval_s": 0.05})
    run_scenario(scenario, tmp_path / "run", make_simulation=flying_points)
    path = tmp_path / "run" / "timeseries.csv"
    lines = path.read_text().splitlines(keepends=True)
    column = lines[0].split(",").index("flow_elastic_energy [J/m]")
    cells = lines[5].split(",")
    cells[column] = value
    path.write_text("".join([*lines[:5], ",".join(cells), *lines[6:]]))
    with pytest.raises(ResultsError, match=rf"line 6: flow_elastic_energy is {value}, it must be a finite number"):
        evaluate(tmp_path / "run")


def test_an_error_of_the_ledger_that_is_no_number_is_not_none(coarse_case_1):
    """max(0, nan) is 0 in Python, and nothing is greater than NaN."""
    bad, good = np.array([0.0, np.nan]), np.array([1.0, 2.0])
    energies = {f"flow_{kind}_energy": good for kind in ("kinetic", "gravitational", "elastic")}
    momenta = {f"momentum{part}_{axis}": good for part in ("", "_residual") for axis in "xy"}
    series = {"time": np.array([0.0, 1.0]), "solid_mass": good} | energies | momenta
    for name in energies:
        for broken in (bad, bad[::-1]):
            assert np.isnan(energy_error(series | {name: broken}))
            with pytest.raises(ResultsError, match="energy_error is nan"):
                summarize(coarse_case_1, series | {name: broken}, None, {})
    for name in (*momenta, "solid_mass"):
        assert np.isnan(momentum_error(series | {name: bad[::-1]}, 9.81)), name
    assert run_caveats({"effects": {"precision": "float64"}}, {"energy_error": np.nan}) != []
