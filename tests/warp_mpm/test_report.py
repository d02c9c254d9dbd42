"""The report as a file: one page, nothing from elsewhere, and the run's own numbers in it."""

import base64
import json
import re
import shutil
import subprocess
import zlib

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.fields import field_values
from warp_mpm.report import write_report
from warp_mpm.report.pdf import write_pdf
from warp_mpm.results import Results
from warp_mpm.run import run_scenario


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def run(folder, coarse_case_1, flying_points):
    path = folder / "case_1"
    if not path.exists():
        run_scenario(coarse_case_1, path, make_simulation=flying_points)
    return path


def page_data(page):
    return json.loads(re.search(r'id="report-data">(.*?)</script>', page, re.DOTALL).group(1))


def packed_points(page, index=0):
    text = re.search(rf'id="points-{index}">(.*?)</script>', page, re.DOTALL).group(1)
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype="<u2")


def test_page_needs_nothing_from_elsewhere(run, tmp_path):
    write_report([Results.open(run)], tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert [item.name for item in tmp_path.iterdir()] == ["report.html"]
    # Names of XML dialects look like addresses and are none.
    addresses = set(re.findall(r"https?://[^\"'\\\s<>]+", page))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not re.search(r"<(script|img|link)[^>]+(src|href)=(?!\"data:)", page)


def test_packed_points_are_those_of_the_snapshots(run, tmp_path):
    results = Results.open(run)
    write_report([results], tmp_path / "report.html", times=(1.0,))
    page = (tmp_path / "report.html").read_text()
    points, numbers = page_data(page)["runs"][0]["points"], packed_points(page)
    snapshots = Results.open(run).snapshots
    assert points["times"] == pytest.approx(snapshots.times)
    names = [field["name"] for field in points["fields"]]
    assert names[0] == "pore_pressure"
    assert len(numbers) == (2 + len(names)) * sum(points["counts"])
    frame, start = 20, (2 + len(names)) * sum(points["counts"][:20])
    snapshot, count = snapshots[frame], points["counts"][frame]
    density = results.scenario.flow.material.solid_partial_density
    columns = [*snapshot.position.T, *(field_values(snapshot, name, density) for name in names)]
    for quantity, expected in enumerate(columns):
        low, high = points["ranges"][quantity]
        raw = numbers[start + quantity * count : start + (quantity + 1) * count]
        # Half a step of 1/65535 of the range is lost in packing.
        assert low + raw / 65535 * (high - low) == pytest.approx(expected, abs=0.51 * (high - low) / 65535)


def test_budget_thins_frames_then_points_and_keeps_the_times_asked_for(run, tmp_path, monkeypatch):
    monkeypatch.setattr("warp_mpm.report.page.POINT_BUDGET", 200_000)
    write_report([Results.open(run)], tmp_path / "report.html", times=(0.85, 2.0))
    page = (tmp_path / "report.html").read_text()
    points = page_data(page)["runs"][0]["points"]
    assert packed_points(page).nbytes <= 200_000
    assert points["point_stride"] > 1
    assert {0.0, 0.85, 2.0, 3.0} <= {round(time, 6) for time in points["times"]}


def test_page_tells_what_the_run_folder_tells(run, tmp_path):
    results = Results.open(run)
    write_report([results], tmp_path / "report.html")
    content = page_data((tmp_path / "report.html").read_text())["runs"][0]
    force = next(chart for chart in content["charts"] if chart["title"].startswith("impact force"))
    raw = next(line for line in force["lines"] if line["style"] == "faint")
    assert raw["v"] == pytest.approx(results.time_series["impact_force_x"] / 1e3, rel=1e-5, abs=1e-9)
    assert {"dashed", "dotted"} <= {line["style"] for line in force["lines"]}  # the closed form by both rules
    assert content["settings"]["numerics.spacing_m"] == "0.5"
    assert [fit["rule"] for fit in content["closed_form"]] == ["peak", "least squares"]
    assert ["error of momentum, relative", f"{results.summary['momentum_error']:,.4g}"] in content["ledger"]


def test_times_beyond_the_end_are_told(run, tmp_path):
    page = tmp_path / "report.html"
    answer = CliRunner().invoke(app, ["report", str(run), "--times", "1,9", "--out", str(page)])
    assert answer.exit_code == 0
    assert answer.stderr == "Left out of --times: 9 s, beyond the last snapshot at t = 3 s.\n"
    assert page_data(page.read_text())["times"] == [1.0]
    write_report([Results.open(run)], page)
    assert page_data(page.read_text())["times"] == [0.5, 1.0, 2.0]


def test_several_runs_side_by_side(run, folder, tmp_path, load_scene, flying_points):
    fixed = folder / "fixed"
    scene = load_scene("case_1_fixed", **{"numerics.spacing_m": 0.5, "output.end_time_s": 2.0})
    run_scenario(scene, fixed, make_simulation=flying_points)
    answer = CliRunner().invoke(app, ["report", str(run), str(fixed), "--out", str(tmp_path / "both.html")])
    assert answer.exit_code == 0, answer.output
    data = page_data((tmp_path / "both.html").read_text())
    assert [content["name"] for content in data["runs"]] == ["case_1", "fixed"]
    assert "barrier velocity" not in {chart["title"] for chart in data["runs"][1]["charts"]}


def test_text_of_a_scenario_cannot_break_out_of_the_page(tmp_path, coarse_case_1, flying_points):
    evil = "</script><script>alert(1)</script>"
    run_scenario(coarse_case_1.replaced({"title": evil}), tmp_path / "run", make_simulation=flying_points)
    write_report([Results.open(tmp_path / "run")], tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "<script>alert" not in page
    assert page_data(page)["runs"][0]["title"] == evil


def test_scripts_are_valid(run, tmp_path):
    node = shutil.which("node")
    write_report([Results.open(run)], tmp_path / "report.html")
    script = re.findall(r"<script>(.*?)</script>", (tmp_path / "report.html").read_text(), re.DOTALL)[-1]
    for pair in ("()", "[]", "{}"):
        assert script.count(pair[0]) == script.count(pair[1])
    assert "$" + "script" not in script
    if node is not None:  # a parser where there is one; the browser test runs the page
        (tmp_path / "page.js").write_text(script)
        checked = subprocess.run([node, "--check", tmp_path / "page.js"], capture_output=True, text=True, check=False)
        assert checked.returncode == 0, checked.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "nowhere is no folder"),
        (["RUN", "--times", "9"], "nothing to draw at 9 s: the last snapshot is at t = 3 s"),
        (["RUN", "--times", "1,x"], "'x' must be a number of seconds"),
        (["RUN", "--out", "none/report.html"], "must be a file in a folder that exists"),
    ],
)
def test_bad_input_is_one_sentence(run, arguments, words):
    answer = CliRunner().invoke(app, ["report", *(str(run) if word == "RUN" else word for word in arguments)])
    assert answer.exit_code == 2
    assert words in answer.stderr
    assert "Traceback" not in answer.output
    assert not list(run.glob("*.html*"))


def test_page_prints_reads_and_fits(run, tmp_path):
    """What no browser is needed for: the rules that paper, the dark, a narrow window and a screen reader ask for."""
    write_report([Results.open(run)], tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    printed = page[page.index("@media print") : page.index("</style>")]
    assert "canvas.viewer, canvas.still { height: auto !important; }" in printed
    hidden = re.search(r"([^{}]*)\{ display: none; \}", printed).group(1)
    assert ".hint" in hidden
    assert "caption" not in hidden
    # Captions of the stills are no hints, which paper leaves out.
    assert 'createElement("p"), {className: "caption"}' in page
    assert "@media screen and (prefers-color-scheme: dark)" in page
    assert 'heading(words, "col")' in page
    assert 'heading(name, "row")' in page
    assert "minmax(min(430px, 100%), 1fr)" in page
    # Every variable of the style has a value.
    assert set(re.findall(r"var\((--[\w-]+)\)", page)) <= set(re.findall(r"(--[\w-]+):", page))


def test_report_as_a_pdf(run):
    """A cover, pictures, an appendix, on A4."""
    answer = CliRunner().invoke(app, ["report", str(run), "--pdf", "--times", "1,2"])
    assert answer.exit_code == 0, answer.output
    data = (run / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF")
    pages = len(re.findall(rb"/Type /Page\b", data))
    assert 3 <= pages <= 12
    assert re.search(rb"/MediaBox \[ 0 0 595\.\d+ 841\.\d+ \]", data)  # A4
    (run / "report.pdf").unlink()


@pytest.mark.slow
def test_a_pdf_of_two_runs(run, tmp_path):
    write_pdf([Results.open(run), Results.open(run)], tmp_path / "two.pdf", times=(1.0,))
    assert len(re.findall(rb"/Type /Page\b", (tmp_path / "two.pdf").read_bytes())) > 5
