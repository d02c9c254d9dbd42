"""The benchmark of the units measures all of them and refuses what cannot be."""

from __future__ import annotations

from typer.testing import CliRunner

from analytic.command_line import BAD_INPUT
from fmu.cli import app


def test_every_unit_has_its_line() -> None:
    answer = CliRunner().invoke(app, ["benchmark", "--spacing", "1.5"])
    assert answer.exit_code == 0, answer.output
    for line in (
        "BarrierSliding.fmu, one step",
        "BarrierSlidingC.fmu, one step",
        "DebrisFlow.fmu, start",
        "over a plain",
    ):
        assert line in answer.stdout


def test_a_spacing_that_cannot_be() -> None:
    answer = CliRunner().invoke(app, ["benchmark", "--spacing", "-1"])
    assert answer.exit_code == BAD_INPUT
    assert "numerics.spacing_m = -1" in answer.stderr
