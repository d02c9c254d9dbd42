"""What the three command lines share: help that keeps its units, and one sentence for a value that is not allowed."""

import importlib
import re
import sys
import tomllib
import typing
from pathlib import Path

import pytest
from typer.models import ParameterInfo
from typer.testing import CliRunner

import analytic.cli
import fmu.cli
import warp_mpm.cli

SCENES = Path(__file__).parents[2] / "scenarios"
APPLICATIONS = {"warp_mpm": warp_mpm.cli.app, "analytic": analytic.cli.app, "fmu": fmu.cli.app}


def commands(app, *before):
    """Words that call a command, its function and its example."""
    for info in app.registered_commands:
        yield (*before, info.name or info.callback.__name__.replace("_", "-")), info.callback, info.epilog or ""
    for info in app.registered_groups:
        yield from commands(info.typer_instance, *before, info.name)


COMMANDS = {
    " ".join((name, *words)): (app, words, function, epilog)
    for name, app in APPLICATIONS.items()
    for words, function, epilog in commands(app)
}


def helps(function):
    """Texts of a command's help as they stand in its source."""
    yield function.__doc__
    for hint in typing.get_type_hints(function, include_extras=True).values():
        yield from (one.help or "" for one in getattr(hint, "__metadata__", ()) if isinstance(one, ParameterInfo))


def answer(app, *words):
    return CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "400"})


def words(line):
    return line.split()


def refusal(app, *words):
    result = answer(app, *words)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.count("\n") == 1
    return result.stderr.rstrip("\n")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_keeps_what_stands_in_brackets(command):
    app, words, function, epilog = COMMANDS[command]
    printed = answer(app, *words, "--help").stdout
    for text in (*helps(function), epilog):
        for bracket in re.findall(r"\S*\s?\[[^\]]*\]", " ".join(text.split())):
            assert bracket in printed
    assert "\\" not in printed


@pytest.mark.parametrize("command", COMMANDS)
def test_usage_has_no_brackets_nor_dots_twice(command):
    app, words, _, _ = COMMANDS[command]
    (usage,) = re.findall(r"Usage: .*", answer(app, *words, "--help").stdout)
    assert not re.search(r"\[\[|\]\]|\.[]}]", usage)


def test_help_breaks_lines_only_at_the_edge_and_between_paragraphs():
    printed = answer(analytic.cli.app, "design", "--help").stdout
    assert "beyond the limit, and which input matters most. The barrier is then the one of --barrier-mass" in printed


def test_there_is_much_in_brackets():
    """The test above has something to find."""
    found = {command: "".join(helps(function)).count("[") for command, (_, _, function, _) in COMMANDS.items()}
    assert len(found) > 20
    assert found["analytic predict"] > 10
    assert found["analytic design"] > 10
    for command in ("warp_mpm plot", "warp_mpm report", "warp_mpm animate", "analytic calibrate", "analytic field"):
        assert found[command] > 0
    assert "pip install '.[animate]'" in answer(warp_mpm.cli.app, "animate", "--help").stdout


@pytest.mark.parametrize("name", APPLICATIONS)
def test_an_application_alone_shows_its_help(name):
    result = answer(APPLICATIONS[name])
    assert "Usage:" in result.output
    assert result.stderr == ""


SPACING = "it must be a finite number at least 1e-06 and at most 1e+06."


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("warp_mpm run s.json --spacing abc", f"--spacing = abc is not allowed; {SPACING}"),
        ("warp_mpm plan s.json --spacing=abc", f"--spacing = abc is not allowed; {SPACING}"),
        ("fmu check s.json --spacing abc", f"--spacing = abc is not allowed; {SPACING}"),
        (
            "warp_mpm sweep s.json --workers 0",
            "--workers = 0 is not allowed; it must be a whole number at least 1 and at most 1024.",
        ),
        (
            "warp_mpm animate run --speed fast",
            "--speed = fast is not allowed; it must be a number at least 0.01 and at most 100.",
        ),
        (
            "warp_mpm plot foo run",
            "kind = foo is not allowed; it must be one of scene, history, comparison, field, mechanism, loads.",
        ),
        ("warp_mpm plot", "kind is missing; it must be one of scene, history, comparison, field, mechanism, loads."),
        ("warp_mpm plot history", "RUN_DIR is missing; it must be given."),
        ("warp_mpm benchmark foo", "what = foo is not allowed; it must be one of speed, effects, gpu."),
        ("warp_mpm run --foo", "No such option: --foo (Possible options: --force, --out); see root run --help."),
        ("warp_mpm runn", "No such command 'runn'. Did you mean 'run'?"),
        ("analytic predict --speed fast", "--speed = fast is not allowed; it must be a number."),
        ("analytic design --samples 1.5", "--samples = 1.5 is not allowed; it must be a whole number."),
        ("analytic design --face-angle 60 steep", "--face-angle = steep is not allowed; it must be a number."),
        ("analytic sweep plan a.json b --count x", "--count = x is not allowed; it must be a whole number."),
    ],
)
def test_one_sentence_names_option_value_and_range(command, sentence):
    name, *words = command.split()
    assert refusal(APPLICATIONS[name], *words) == sentence


def test_a_pipe_that_is_closed_early_is_no_mistake(monkeypatch):
    def closed(*arguments, **options):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(sys.modules["analytic.cli.predict"], "print_table", closed)
    result = answer(analytic.cli.app, "predict", SCENES / "set_i.json")
    assert (result.exit_code, result.stderr) == (1, "")


def test_an_option_has_the_name_under_which_it_was_typed():
    flow = words("predict --flow-mass 81000 --barrier-mass 81000 --flow-length 15 --flow-height 3 --speed 10")
    for option in ("--lambda", "--geometry-change"):
        said = refusal(analytic.cli.app, *flow, "--base-friction", "0.29", option, "0")
        assert said == f"{option} = 0.0 is not allowed; it must be a number in (0, 1] (it is s1max / flow_length)."
    said = refusal(analytic.cli.app, *flow, "--base-friction", "-1", "--tau=0.3")
    assert said.startswith("--base-friction = -1.0 is not allowed; it must be a number in [0, inf)")
    # A name that was not typed, and the word "fixed" of the sentence, stay what they are.
    assert refusal(analytic.cli.app, *flow).startswith("base_friction is missing")
    assert refusal(analytic.cli.app, *flow, "--fixed").endswith("and the barrier is fixed, give only one.")
    given = words("design --density 1800 --flow-length 15 --flow-height 3 --speed 10 --base-friction 0.29 --limit 1")
    said = refusal(analytic.cli.app, *given, "--barrier-density", "-5")
    assert said == "density of the barrier is -5, it must be a number in (0, inf)."


SCRIPTS = tomllib.loads((SCENES.parent / "pyproject.toml").read_text())["project"]["scripts"]


@pytest.mark.parametrize(
    ("script", "package"),
    [("warp-mpm", "warp_mpm"), ("warp-mpm-analytic", "analytic"), ("warp-mpm-fmu", "warp_mpm_fmu")],
)
def test_each_command_line_is_an_installed_command_that_knows_its_name(script, package, monkeypatch, capsys):
    """What an installer makes of `project.scripts`: a program of that name, which calls that function."""
    module, _, function = SCRIPTS[script].partition(":")
    for called, told in ((f"/usr/bin/{script}", script), (f"/somewhere/{package}/__main__.py", f"python -m {package}")):
        monkeypatch.setattr(sys, "argv", [called, "--help"])
        with pytest.raises(SystemExit) as end:
            getattr(importlib.import_module(module), function)()
        assert not end.value.code
        assert re.search(rf"Usage: {re.escape(told)} \[OPTIONS\]", capsys.readouterr().out)
