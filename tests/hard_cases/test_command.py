"""`python -m warp_mpm hard-cases` as a user types it."""

import json
import shlex

import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.commands import EXAMPLES, hard_cases


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
