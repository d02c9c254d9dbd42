"""The benchmark of the units measures all of them, fills the page, and refuses what cannot be."""

from __future__ import annotations

import itertools
import subprocess
import sys
import time
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


def test_nobody_always_follows_the_same_one() -> None:
    """Who comes after the plain simulation finds other caches than who comes after a unit."""
    order: list[str] = []

    def call(name: str) -> benchmark.Timed:
        def timed() -> float:
            order.append(name)
            return float(len(order))

        return timed

    times = benchmark._in_turns({name: call(name) for name in "abcd"}, 40)
    assert all(sorted(order[begin : begin + 4]) == list("abcd") for begin in range(0, 160, 4))
    assert set(itertools.permutations("abcd", 2)) <= set(itertools.pairwise(order))
    assert times["a"] == [place for place, name in enumerate(order, 1) if name == "a"]


def test_what_slows_a_turn_changes_no_ratio() -> None:
    """A turn in which everything took ten times as long is one turn of many."""
    assert benchmark._over([1.1, 11.0, 2.0], [1.0, 10.0, 1.0]) == pytest.approx(0.1)


@pytest.mark.skipif(not benchmark.CHILDREN.exists(), reason="only Linux tells of a process's children")
def test_processor_time_is_that_of_children_too() -> None:
    """What they compute, not what they sleep."""
    code = (
        "import time\ntime.sleep(0.2)\nbegin = time.process_time()\nwhile time.process_time() < begin + 0.1: pass\n"
        "print(flush=True)\ninput()"
    )
    before = benchmark.processor_time()
    child = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with child:
        assert child.stdout is not None
        child.stdout.readline()
        spent = benchmark.processor_time() - before
        assert child.stdin is not None
        child.stdin.write(b"\n")
    assert spent >= 0.1
    before, told, after = time.process_time(), benchmark.processor_time(), time.process_time()
    assert before <= told <= after + sum(map(benchmark.clock_of, benchmark.children()))  # the one that has ended not
    assert str(child.pid) not in benchmark.CHILDREN.read_text().split()


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
