"""A run that is watched: what its page shows and takes, who may ask it for what, and that looking changes no number."""

import base64
import json
import re
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
import zlib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm import cli
from warp_mpm.live import LivePage
from warp_mpm.live import page as live_page
from warp_mpm.recording import read_checkpoint
from warp_mpm.recording.run_folder import CHECKPOINT
from warp_mpm.results import Results
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.simulation import Simulation

SCENES = Path(__file__).parents[2] / "scenarios"


@pytest.fixture(autouse=True)
def does_not_wait_long(monkeypatch):
    """At the end, for pages that do not say that they have heard of it."""
    monkeypatch.setattr(live_page, "LAST_LOOK", 0.3)


@pytest.fixture
def scenario(load_scene):
    """With no checkpoint of its own but the first."""
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 1.2, "output.checkpoint_interval_s": 100.0}
    changes |= {"output.time_series_interval_s": 0.02, "output.snapshot_interval_s": 0.2}
    return load_scene("case_1", **changes)


def answer(address, *, post=False, **headers):
    """Status, headers and text of a request."""
    request = urllib.request.Request(address, method="POST" if post else "GET", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as response:
            return response.status, response.headers, response.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read().decode()


def state(page, samples=0, frame=0):
    return json.loads(answer(f"{page.address}state?samples={samples}&frame={frame}")[2])


def watched(scenario, folder, make_simulation, at):
    """A run with its page; `at(page, progress)` is called after each record."""
    with LivePage(scenario, folder) as page:
        watching = page.watching(lambda progress: at(page, progress), lambda: False)
        outcome = run_scenario(scenario, folder, make_simulation=make_simulation, **watching)
        page.end(outcome.finished)
        return page, outcome


def test_samples_and_points_come_as_the_run_makes_them(scenario, tmp_path, flying_points):
    rows, frames = [], []

    def look(page, progress):
        if not rows or progress.time > 0.3 * len(frames):
            page._next_frame = -np.inf  # pictures rest between, so that they cost little
            new = state(page, len(rows), frames[-1]["number"] if frames else 0)
            rows.extend(new["samples"])
            frames.extend([new["frame"]] if new["frame"] else [])
            assert (new["status"], new["time"]) == ("running", progress.time)

    watched(scenario, tmp_path / "run", flying_points, look)
    results = Results.open(tmp_path / "run")
    series, times = results.time_series, np.array([row[0] for row in rows])
    assert len(frames) >= 3
    then = slice(1, 1 + len(rows))  # the start is no progress
    assert len(rows) > 40
    np.testing.assert_array_equal(times, series["time"][then])
    np.testing.assert_allclose([row[1] for row in rows], series["impact_force_x"][then])
    np.testing.assert_allclose([row[2] for row in rows], series["barrier_displacement"][then])
    points = frames[-1]["points"]
    numbers = np.frombuffer(zlib.decompress(base64.b64decode(frames[-1]["numbers"])), dtype="<u2")
    made = flying_points(scenario)
    made.time = points["times"][0]
    (low, high), count = points["ranges"][0], points["counts"][0]
    x = low + numbers[:count] / 65535 * (high - low)
    np.testing.assert_allclose(x, made.points()["position"][:, 0], atol=1e-3)
    assert points["shifts"] == [[pytest.approx(made.barrier_displacement)]]


def test_the_page_is_whole_and_found_by_nobody_who_does_not_know_it(scenario, tmp_path):
    with LivePage(scenario, tmp_path) as page:
        status, headers, text = answer(page.address)
        assert status == 200
        assert scenario.title in text
        assert set(re.findall(r"https?://[^\"'\\\s<>]+", text)) <= {"http://www.w3.org/2000/svg"}
        assert not re.search(r"<(script|img|link)[^>]+(src|href)=(?!\"data:)", text)
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        origin, secret = re.fullmatch(r"(http://127\.0\.0\.1:\d+)/([\w-]{20,})/", page.address).groups()
        for place in ("/", "/state", f"/{secret}", f"/{secret}x/", "/../etc/passwd"):
            assert answer(origin + place)[0] == 404
        assert answer(f"{page.address}state?samples=many")[0] == 400
    with pytest.raises(urllib.error.URLError):
        answer(page.address)


def test_a_stop_is_that_of_ctrl_c(scenario, tmp_path, flying_points):
    def stop(page, progress):
        if progress.time == pytest.approx(1.0):
            assert answer(f"{page.address}stop", post=True, Origin=page.address.rsplit("/", 2)[0])[0] == 200
            assert state(page)["stopping"]

    _, outcome = watched(scenario, tmp_path / "cut", flying_points, stop)
    assert not outcome.finished
    cut = Results.open(tmp_path / "cut")
    assert cut.record["status"] == "stopped"
    assert cut.time_series["time"][-1] < 1.05
    assert resume_run(tmp_path / "cut", make_simulation=flying_points).finished
    run_scenario(scenario, tmp_path / "whole", make_simulation=flying_points)
    assert (tmp_path / "cut/timeseries.csv").read_bytes() == (tmp_path / "whole/timeseries.csv").read_bytes()


def test_nobody_else_stops_it(scenario, tmp_path, flying_points):
    asked = []

    def try_to_stop(page, progress):
        if progress.time == pytest.approx(1.0):
            origin = page.address.rsplit("/", 2)[0]
            asked.append(answer(f"{page.address}stop", post=True, Origin="https://elsewhere.example")[0])
            asked.append(answer(f"{page.address}stop", post=True, Origin="null")[0])
            asked.append(answer(f"{page.address}stop")[0])
            asked.append(answer(f"{origin}/stop", post=True)[0])
            asked.append(answer(f"{origin}/guessed/stop", post=True)[0])
            asked.append(answer(f"{page.address}reset", post=True)[0])

    _, outcome = watched(scenario, tmp_path / "run", flying_points, try_to_stop)
    assert asked == [403, 403, 404, 404, 404, 404]
    assert outcome.finished


def test_what_is_kept_is_on_the_disk(scenario, tmp_path, flying_points):
    kept = []

    def keep(page, progress):
        if progress.time == pytest.approx(1.0):
            assert answer(f"{page.address}keep", post=True)[0] == 200
            assert state(page)["kept"] is None
        elif progress.time > 1.0 and not kept:
            checkpoint = read_checkpoint(tmp_path / "run" / CHECKPOINT, scenario.resolved())
            kept.extend([progress.time, checkpoint.time, state(page)["kept"]])

    _, outcome = watched(scenario, tmp_path / "run", flying_points, keep)
    assert outcome.finished
    assert kept[0] == kept[1] == kept[2] == pytest.approx(1.02)


def test_pictures_are_made_only_while_somebody_looks(scenario, tmp_path, flying_points):
    with LivePage(scenario, tmp_path) as page:
        simulation = flying_points(scenario)
        page.record(simulation)
        assert state(page)["frame"] is None
        page.record(simulation)
        assert state(page)["frame"]["number"] == 1
        assert state(page, frame=1)["frame"] is None


@pytest.mark.parametrize(("outcome", "words"), [(True, "finished"), (False, "stopped"), (None, "ended: out of luck")])
def test_an_open_page_hears_of_the_end(scenario, tmp_path, monkeypatch, outcome, words):
    monkeypatch.setattr(live_page, "LAST_LOOK", 10.0)
    heard = []
    with LivePage(scenario, tmp_path) as page:
        state(page)

        def listen():
            while not heard or heard[-1]["status"] == "preparing":
                heard.append(state(page))
            answer(f"{page.address}heard", post=True)

        listener = threading.Thread(target=listen)
        listener.start()
        if outcome is None:
            page.__exit__(ArithmeticError, ArithmeticError("out of luck"), None)
        else:
            page.end(outcome)
        listener.join()
    assert heard[-1]["words"] == words


def test_looking_changes_no_number(scenario, tmp_path):
    scenario = scenario.replaced({"output.end_time_s": 0.2})
    run_scenario(scenario, tmp_path / "alone", make_simulation=Simulation)

    def look(page, progress):
        page._next_frame = -np.inf
        state(page)

    page, _ = watched(scenario, tmp_path / "watched", Simulation, look)
    assert page._frames > 8
    one, other = (Results.open(tmp_path / name) for name in ("alone", "watched"))
    assert (tmp_path / "alone/timeseries.csv").read_bytes() == (tmp_path / "watched/timeseries.csv").read_bytes()
    for name, values in one.snapshots[-1].fields.items():
        np.testing.assert_array_equal(values, other.snapshots[-1][name])
    assert one.record["steps"] == other.record["steps"]


def test_the_command_tells_the_address_and_refuses_what_it_cannot_do(tmp_path):
    def typed(*words):
        return CliRunner().invoke(cli.app, [str(word) for word in ("run", *words)])

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        refused = typed(SCENES / "case_1.json", "--out", tmp_path / "run", "--live", "--port", port)
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
    assert f"--port {port} of 127.0.0.1 cannot be had: Address already in use." in refused.stderr
    assert not (tmp_path / "run").exists()
    for words, sentence in (
        (["--port", 8000], "--port is that of the page of --live, which is not asked for."),
        ([SCENES / "case_2.json", "--live"], "--live shows one run; it does not go with several scenarios."),
        (["--live", "--port", 70000], "--port = 70000 is not allowed; it must be a whole number"),
    ):
        refused = typed(SCENES / "case_1.json", *words)
        assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
        assert sentence in refused.stderr
    done = typed(
        SCENES / "case_1.json", "--spacing", 0.5, "--until", 0.05, "--out", tmp_path / "run", "--live", "--quiet"
    )
    assert done.exit_code == 0
    assert re.fullmatch(r"The run can be watched at http://127\.0\.0\.1:\d+/[\w-]+/\n", done.stderr)


def test_who_does_not_ask_does_not_pay():
    look = "import sys, warp_mpm.cli, warp_mpm.run; print(*sys.modules)"
    said = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True).stdout.split()
    assert "warp_mpm.run" in said
    assert not {"warp_mpm.live", "http.server", "warp_mpm.report.page"} & set(said)
