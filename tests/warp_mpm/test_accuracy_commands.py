"""`python -m warp_mpm accuracy` and `run --accuracy | --budget`, from the command line."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from warp_mpm.accuracy import purchase, runner, shipped
from warp_mpm.accuracy.keys import scene_key
from warp_mpm.accuracy.report import put_into_page
from warp_mpm.cli import app
from warp_mpm.engine import Ended, Task
from warp_mpm.scenario import Scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"


class Here:
    """An engine without processes, whose start takes longer than what many a test runs in them."""

    def __init__(self, at_once: int):
        pass

    def run(self, tasks: Sequence[Task], *, on_start: Callable[[Task], None]) -> Iterator[Ended]:
        for task in tasks:
            on_start(task)
            yield Ended(task, task.function(*task.arguments))


@pytest.fixture
def coarse(tmp_path: Path) -> Path:
    """Case 1 until shortly after the front's arrival, on a grid on which that takes a moment."""
    content = json.loads((SCENARIOS / "case_1.json").read_text())
    content["numerics"]["spacing_m"] = 0.8
    content["output"]["end_time_s"] = 0.8
    path = tmp_path / "coarse.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--accuracy", "5"], "--accuracy 5 must be a percentage from 0.1% to 50%"),
        (["--budget", "0s"], "--budget 0s must be a time from 1s"),
        (["--budget", "60s", "--spacing", "0.3"], "only one is allowed"),
        (["--budget", "60s", "--accuracy", "5%"], "only one is allowed"),
    ],
)
def test_refuses_in_one_sentence(coarse: Path, tmp_path: Path, options: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["run", str(coarse), "--out", str(tmp_path / "run"), *options])
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.output
    assert not (tmp_path / "run").exists()


def test_buys_runs_and_settles(coarse: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarser probes than those of a user, to be quick."""
    monkeypatch.setattr(purchase, "PROBE_CELLS", (3.0, 4.0, 5.0))
    monkeypatch.setenv("WARP_MPM_CACHE_DIR", str(tmp_path / "cache"))
    folder = tmp_path / "run"
    result = CliRunner().invoke(app, ["run", str(coarse), "--accuracy", "50%", "--out", str(folder)])
    assert result.exit_code == 0, result.stderr
    assert "Chosen: spacing" in result.stderr
    assert "times what was expected" in result.stderr
    chosen = json.loads((folder / "scenario.json").read_text())["numerics"]["spacing_m"]
    assert f"Chosen: spacing {chosen:g} m" in result.stderr


@pytest.mark.slow  # 26 runs; accuracy/ checks each part of it on runs that are made up
def test_ladders_of_several_scenes_and_their_data(
    coarse: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "Processes", Here)
    fixed = tmp_path / "fixed.json"
    content = json.loads(coarse.read_text())
    content["barrier"]["motion"] = {"kind": "fixed"}
    fixed.write_text(json.dumps(content))
    out, data = tmp_path / "out", tmp_path / "data.json"
    command = ["accuracy", str(coarse), str(fixed), "--quick", "--jobs", "1", "--out", str(out), "--data", str(data)]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.stderr
    # Four spacings each, seven settings refined at one of them, and all at once at two.
    assert "26 done, 0 running, 0 left" in result.stderr
    for picture in ("closed_form", "error_against_cost"):
        assert (out / f"{picture}.png").stat().st_size > 10_000
    assert "closed form, paper's λ" in (out / "closed_form.md").read_text()
    content = json.loads(data.read_text())
    scenes, fields = content["scenes"], frozenset(content["fields"])
    of_coarse, of_fixed = (scene_key(Scenario.load(file), fields) for file in (coarse, fixed))
    sliding = scenes[of_coarse]
    assert [rung["spacing"] for rung in sliding["rungs"]] == [2.0, 1.6, 1.2, 0.8]
    assert sliding["rungs"][0]["figures"]["barrier_displacement_final"] > 0.0
    assert set(sliding["shared"]) == {"peak_force", "impulse", "barrier_displacement_final"}
    assert all(0.0 < change < 2.0 for change in sliding["shared"].values())
    monkeypatch.setattr(shipped, "_data", lambda: json.loads(data.read_text()))
    assert shipped.shipped_scenes()[of_coarse].shared == sliding["shared"]
    del scenes[of_coarse]["shared"]
    data_without = json.loads(data.read_text()) | {"scenes": scenes}
    monkeypatch.setattr(shipped, "_data", lambda: data_without)
    assert list(shipped.shipped_scenes()) == [of_fixed]  # no promise rests on a ladder alone
    assert "barrier_displacement_final" not in scenes[of_fixed]["rungs"][0]["figures"]
    # The same again: nothing is run.
    again = CliRunner().invoke(app, command)
    assert "running (" not in again.stderr
    assert "26 done, 0 running, 0 left" in again.stderr


def test_accuracy_refuses_a_folder_that_is_none(coarse: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["accuracy", str(coarse), "--data", str(tmp_path / "no" / "data.json")])
    assert result.exit_code == 2
    assert "must be a file in a folder that exists" in result.stderr


def test_scene_without_a_barrier_is_refused_before_anything_runs(coarse: Path, tmp_path: Path) -> None:
    coarse.write_text(json.dumps(json.loads(coarse.read_text()) | {"barrier": None}))
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["accuracy", str(coarse), "--out", str(out)])
    assert result.exit_code == 2
    assert "no barrier, so it has no key figures" in " ".join(result.stderr.split())
    assert not out.exists()


def test_result_goes_into_the_page_and_nothing_else_changes(tmp_path: Path) -> None:
    page, picture = tmp_path / "page.md", tmp_path / "picture.png"
    page.write_text("before\n<!-- accuracy one -->\nold\n<!-- end -->\n<!-- accuracy two -->\nkept\n<!-- end -->\n")
    picture.write_bytes(b"drawn")
    for _ in range(2):  # the second time replaces the first
        put_into_page(page, "one", "| a table |\n", [picture])
        text = page.read_text()
        assert text.startswith("before\n<!-- accuracy one -->\n")
        assert "old" not in text
        assert text.count("| a table |") == text.count("images/accuracy/one_picture.png") == 1
        assert text.endswith("<!-- end -->\n<!-- accuracy two -->\nkept\n<!-- end -->\n")
    assert (tmp_path / "images" / "accuracy" / "one_picture.png").read_bytes() == b"drawn"


def test_page_without_a_place_is_refused_before_anything_runs(coarse: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("no place")
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["accuracy", str(coarse), "--out", str(out), "--page", str(page)])
    assert result.exit_code == 2
    assert "with the line <!-- accuracy out -->" in " ".join(result.stderr.split())
    assert not out.exists()
    assert page.read_text() == "no place"


@pytest.mark.slow
def test_whole_study(coarse: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["accuracy", str(coarse), "--quick", "--jobs", "2", "--out", str(out)])
    assert result.exit_code == 0, result.stderr
    assert "are beaten by" in result.stdout
    text = (out / "study.md").read_text()
    assert "| **known to** | " in text
    for heading in ("What it says", "What each percent costs", "leaving an effect out", "price of the closed form"):
        assert f"## {heading}" in text or f"## The price of {heading}" in text or f"## The {heading}" in text
    for picture in ("error_against_time", "each_setting", "where_time_goes"):
        assert (out / f"{picture}.png").stat().st_size > 10_000


def test_shipped_data_is_of_the_scenes_that_are_shipped() -> None:
    """A scenario that changes makes its data useless without a word; then it is to be measured anew."""
    known = {scene_key(Scenario.load(path)) for path in SCENARIOS.glob("*.json")}
    scenes = shipped.shipped_scenes()
    assert scenes
    assert set(scenes) <= known
    for one in scenes.values():
        rungs = one.rungs
        assert len(rungs) >= 3
        assert {name for name in rungs[0].figures if rungs[0].figures[name]} <= set(one.shared)
        times = [rung.time for rung in sorted(rungs, key=lambda rung: -rung.spacing)]
        assert times == sorted(times)
