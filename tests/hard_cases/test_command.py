"""`python -m warp_mpm hard-cases` as a user types it."""

import json
import shlex

import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.commands import EXAMPLES, hard_cases
from warp_mpm.hard_cases.measure import Measured


def command(*arguments):
    return CliRunner().invoke(app, ["hard-cases", *map(str, arguments)])


def test_the_helps_example_is_run_drawn_and_recorded(tmp_path):
    page = tmp_path / "robustness.md"
    words = shlex.split(EXAMPLES[hard_cases].split("hard-cases ")[1])
    result = command(*words, "--out", tmp_path / "out", "--page", page)
    assert result.exit_code == 0, result.output
    assert "2 of 2 cases are stable" in result.stdout
    figures = json.loads((tmp_path / "out" / "hard_cases.json").read_text())
    assert figures["face_90"]["stable"]
    assert 0.0 < figures["face_90"]["figures"]["speed_ratio"] < 1.0
    for name in ("one_point", "face_90"):
        assert (tmp_path / "robustness" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"![{name}](robustness/{name}.png)" in page.read_text()


def test_an_unstable_case_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("warp_mpm.hard_cases.criteria.Criterion.limit_for", lambda criterion, scenario: -1.0)
    result = command("--quick", "--only", "one_point", "--out", tmp_path)
    assert result.exit_code == 1
    assert "NOT STABLE: diverged 0, mass_error" in result.stdout


def test_what_was_measured_before_an_interrupt_is_kept_and_taken_over(tmp_path, monkeypatch):
    run = []

    def measured(scenario, *, halve):
        run.append(scenario.title)
        if len(run) == 2:
            raise KeyboardInterrupt
        return Measured({"wall_time": 0.1 * len(run), "speed_ratio": 0.5})

    monkeypatch.setattr("warp_mpm.hard_cases.measure.measure", measured)
    monkeypatch.setattr("warp_mpm.hard_cases.record.picture", lambda case, measured, path: path.touch())
    words = ("--quick", "--only", "one_point", "--only", "face_90", "--out", tmp_path)
    stopped = command(*words)
    assert stopped.exit_code == 130
    assert "1 of 2 cases are in" in stopped.stderr
    (kept,) = json.loads((tmp_path / "hard_cases.json").read_text())
    assert command(*words, "--resume").exit_code == 0
    assert len(run) == 3  # the one that was kept is not run again
    assert json.loads((tmp_path / "hard_cases.json").read_text())[kept]["figures"]["wall_time"] == 0.1
    assert command(*words).exit_code == 0  # without --resume everything is
    assert len(run) == 5
    # What another program measured, also one with other bounds, is not taken over.
    monkeypatch.setattr("warp_mpm.hard_cases.record.code_digest", ",".join)
    assert command(*words, "--resume").exit_code == 0
    assert len(run) == 7
    assert "warp_mpm.hard_cases.bounds," in (tmp_path / "hard_cases.json").read_text()
    (tmp_path / "hard_cases.json").write_text("{")
    assert "cannot be read" in command(*words, "--resume").stderr


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--only", "none"), "There is no hard case 'none'; it must be one of at_rest_60s, "),
        (("--only", "one_point", "--out", "/dev/null/x"), "Cannot write to /dev/null/x: Not a directory."),
    ],
)
def test_bad_input(arguments, sentence):
    result = command(*arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith(sentence)
