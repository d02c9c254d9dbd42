"""Several scenes at once: each in its own folder, none begun where one cannot be, all ended cleanly on Ctrl-C."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from warp_mpm.batch import Job, run_jobs
from warp_mpm.cli import app

SCENES = Path(__file__).parents[2] / "scenarios"
COARSE = ("--spacing", "1", "--until", "0.3", "--no-pictures")


def status(folder):
    return json.loads((folder / "run.json").read_text())["status"]


def test_scenes_run_each_into_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(SCENES.parent)
    scenes = [str(SCENES / f"{name}.json") for name in ("case_1", "case_4")]
    answer = CliRunner().invoke(app, ["run", *scenes, "--out", str(tmp_path / "runs"), "--jobs", "2", *COARSE])
    assert answer.exit_code == 0, answer.output
    assert [status(tmp_path / "runs" / name) for name in ("case_1", "case_4")] == ["finished"] * 2
    assert answer.stdout.count("finished") == 2
    assert "\x1b" not in answer.output

    # One of the folders is taken: nothing at all is begun.
    again = CliRunner().invoke(app, ["run", scenes[0], str(SCENES / "case_6.json"), "--out", str(tmp_path / "runs")])
    assert again.exit_code == 2
    assert "case_1 holds a run already" in again.stderr
    assert not (tmp_path / "runs/case_6").exists()


def test_stop_ends_what_runs_and_begins_no_more(tmp_path, monkeypatch):
    monkeypatch.chdir(SCENES.parent)
    jobs = []
    # Whatever the machine, not over before the stop gets there; the longer, the larger is the domain.
    endless = ("--spacing", "0.5", "--until", "60", "--no-pictures")
    for name in ("case_1", "case_4", "case_6"):
        folder = tmp_path / name
        jobs.append(Job(name, folder, (str(SCENES / f"{name}.json"), "--out", str(folder), *endless), 3600.0))
    moving = []
    ends = run_jobs(
        jobs,
        at_once=1,
        on_progress=lambda job, time: moving.append(time) if time > 0.0 else None,
        stop=lambda: bool(moving),
    )
    assert [(end.job.name, end.code) for end in ends] == [("case_1", 130)]
    assert "Stopped at t =" in ends[0].message
    assert status(tmp_path / "case_1") == "stopped"
    assert not (tmp_path / "case_4").exists()


@pytest.mark.parametrize(
    ("files", "words"),
    [
        (["case_1.json", "none.json"], "none.json"),
        (["case_1.json", "../scenarios/case_1.json"], "same file name"),
    ],
)
def test_nothing_is_begun_where_one_scene_cannot_be(tmp_path, files, words):
    answer = CliRunner().invoke(app, ["run", *(str(SCENES / file) for file in files), "--out", str(tmp_path / "runs")])
    assert answer.exit_code == 2
    assert words in answer.stderr
    assert not (tmp_path / "runs").exists()


def test_a_summary_as_json(tmp_path, monkeypatch):
    monkeypatch.chdir(SCENES.parent)
    scene = str(SCENES / "case_1.json")
    one = CliRunner().invoke(app, ["run", scene, "--out", str(tmp_path / "one"), "--json", *COARSE])
    assert json.loads(one.stdout) == json.loads((tmp_path / "one/summary.json").read_text())


@pytest.mark.slow
def test_summaries_of_several_as_json(tmp_path, monkeypatch):
    monkeypatch.chdir(SCENES.parent)
    scenes = [str(SCENES / f"{name}.json") for name in ("case_1", "case_4")]
    two = CliRunner().invoke(app, ["run", *scenes, "--out", str(tmp_path / "two"), "--json", *COARSE])
    assert list(json.loads(two.stdout)) == [str(tmp_path / "two" / name) for name in ("case_1", "case_4")]
