"""The benchmark of the units measures all of them, fills the page, and refuses what cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from analytic.command_line import BAD_INPUT
from fmu import benchmark
from fmu.cli import app

PAGE = Path(__file__).parents[2] / "docs" / "cosimulation.md"


@pytest.mark.slow  # starts every unit; the others below refuse before
def test_every_unit_has_its_line_in_terminal_and_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "STARTS", 1)
    page = tmp_path / "page.md"
    page.write_text(PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    answer = CliRunner().invoke(app, ["benchmark", "--spacing", "1.5", "--until", "0.1", "--page", str(page)])
    assert answer.exit_code == 0, answer.output
    found = page.read_text(encoding="utf-8")
    for text in (answer.stdout, found[found.index("## Cost") :]):
        for name in ("BarrierSliding", "DebrisFlow"):
            for unit in (f"{name}.fmu", f"{name}C.fmu", f"{name}C3.fmu"):
                assert text.count(unit) == 1, unit
        assert "plain simulation" in text
    assert "| plain simulation |  |" not in found


def test_turns_go_round_and_what_slows_a_turn_changes_no_ratio() -> None:
    """Nobody always follows the same one; a turn in which everything took ten times as long is one turn of many."""
    order = []

    def call(name: str, seconds: list[float]) -> benchmark.Timed:
        def timed() -> float:
            order.append(name)
            return seconds.pop(0)

        return timed

    times = benchmark._in_turns({"plain": call("plain", [1.0, 10.0, 1.0]), "unit": call("unit", [1.1, 11.0, 2.0])}, 3)
    assert order == ["plain", "unit", "unit", "plain", "plain", "unit"]
    assert benchmark._over(times["unit"], times["plain"]) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--spacing", "-1"], "--spacing = -1"),
        (["--until", "0"], "--until = 0"),
        (["--scenario", "nowhere.json"], "nowhere.json"),
        (["--page", "nowhere.md"], "--page nowhere.md must be a file"),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_measured(arguments: list[str], says: str) -> None:
    answer = CliRunner().invoke(app, ["benchmark", *arguments])
    assert answer.exit_code == BAD_INPUT
    assert says in answer.stderr
    assert "measuring" not in answer.stderr
