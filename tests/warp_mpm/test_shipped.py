"""The scenes that come with the program, and what a user is told who lacks something."""

import json
import os
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from typer.testing import CliRunner

import analytic.cli
import fmu.cli
import warp_mpm.cli
from analytic.version import PROJECT
from warp_mpm import extras
from warp_mpm.results import Results
from warp_mpm.run import run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError

ROOT = Path(__file__).parents[2]
SCENES, TABLES = (
    sorted(path.relative_to(ROOT / "scenarios").as_posix() for path in (ROOT / "scenarios").rglob(f"*.{kind}"))
    for kind in ("json", "csv")
)
FILES = SCENES + TABLES


def scenarios(*arguments):
    return CliRunner().invoke(warp_mpm.cli.app, ["scenarios", *map(str, arguments)])


def test_every_scene_is_listed_with_its_title():
    lines = [line.split(maxsplit=1) for line in scenarios().stdout.splitlines()]
    assert sorted(f"{name}.json" for name, _ in lines) == SCENES
    assert lines[0] == ["case_1", "Case 1: standing jump, sliding barrier at 60 degrees, 10 m/s"]
    rows = json.loads(scenarios("--json").stdout)
    assert [row["title"] for row in rows] == [title for _, title in lines]
    assert all(Path(row["file"]).is_file() for row in rows)


def test_scenes_are_copied_where_the_examples_look_for_them(tmp_path):
    answer = scenarios("--out", tmp_path / "scenarios")
    assert answer.exit_code == 0
    assert answer.stderr == f"Copied into {tmp_path / 'scenarios'}: {len(FILES)} files.\n"
    assert {"site_channel.csv", "site_two_surges.csv"} <= set(TABLES)
    for name in FILES:
        assert (tmp_path / "scenarios" / name).read_bytes() == (ROOT / "scenarios" / name).read_bytes()
    again = scenarios("--out", tmp_path / "scenarios")
    assert again.exit_code == 0
    assert f"0 files; {len(FILES)} were there already." in again.stderr


def test_a_name_may_be_written_as_the_file_is(tmp_path):
    for name in ("case_1", "case_1.json", "scenarios/case_1.json"):
        rows = json.loads(scenarios(name, "--out", tmp_path, "--json").stdout)
        assert rows == [{"name": "case_1", "title": rows[0]["title"], "file": str(tmp_path / "case_1.json")}]


def test_a_changed_scene_is_not_replaced_unasked(tmp_path):
    (tmp_path / "set_i.json").write_text("mine")
    refused = scenarios("--out", tmp_path)
    assert refused.exit_code == 2
    assert refused.stderr == f"{tmp_path / 'set_i.json'} is there already and differs; --force replaces it.\n"
    assert [path.name for path in tmp_path.iterdir()] == ["set_i.json"]
    assert scenarios("set_i", "--out", tmp_path, "--force").exit_code == 0
    assert (tmp_path / "set_i.json").read_bytes() == (ROOT / "scenarios" / "set_i.json").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("nope",), "There is no scene 'nope'; python -m warp_mpm scenarios lists the "),
        (("case_1", "--out", "/dev/null/x"), "/dev/null/x"),
    ],
)
def test_what_cannot_be_copied(arguments, sentence):
    answer = scenarios(*arguments)
    assert answer.exit_code == 2
    assert answer.stderr.startswith(sentence)
    assert answer.stderr.count("\n") == 1


def test_a_scene_that_is_not_there_is_told_where_to_get(tmp_path):
    with pytest.raises(ScenarioError, match="comes with the program: python -m warp_mpm scenarios --out scenarios"):
        Scenario.load(tmp_path / "case_1.json")
    with pytest.raises(ScenarioError) as other:
        Scenario.load(tmp_path / "mine.json")
    assert "comes with" not in str(other.value)


@pytest.mark.parametrize("name", ["case1.json", "case_1", "CASE1"])
def test_a_scene_whose_name_is_mistyped_is_told_which_is_meant(tmp_path, name):
    with pytest.raises(ScenarioError, match=r"directory\. case_1\.json comes with the program"):
        Scenario.load(tmp_path / name)
    for place in (tmp_path / "scenarios" / "case_1.json", tmp_path / "case_1.json"):
        place.parent.mkdir(exist_ok=True)
        place.write_text("{}")
        with pytest.raises(ScenarioError, match=rf"directory\. Did you mean {place}\?"):
            Scenario.load(tmp_path / name)
        place.unlink()


@pytest.mark.parametrize("app", [warp_mpm.cli.app, analytic.cli.app, fmu.cli.app])
def test_version(app):
    answer = CliRunner().invoke(app, ["--version"])
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert answer.exit_code == 0
    assert answer.stdout.startswith(f"{PROJECT} {version}, Warp {metadata.version('warp-lang')}, Python ")


@pytest.mark.parametrize(("read", "package"), [("frame", "pandas"), ("dataset", "xarray")])
def test_what_an_optional_package_is_wanted_for(tmp_path, coarse_case_1, flying_points, monkeypatch, read, package):
    run_scenario(coarse_case_1, tmp_path / "run", make_simulation=flying_points)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError, match=rf"^Results\.{read}\(\) needs {package}: pip install ") as missing:
        getattr(Results.open(tmp_path / "run"), read)()
    assert f'"{package}>=' in str(missing.value)


def test_a_sweep_without_dask_is_refused_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    file = str(ROOT / "scenarios" / "sweeps" / "slope.json")
    answer = CliRunner().invoke(warp_mpm.cli.app, ["sweep", file, "--out", str(tmp_path / "out")])
    assert answer.exit_code == 2
    assert answer.stderr.startswith('sweep needs Dask, pandas and pyarrow: pip install "dask[distributed]>=')
    assert not (tmp_path / "out").exists()


def test_hints_name_what_the_extras_hold():
    """Not the project itself, which no package index has."""
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra in ("xarray", "sweep", "animate", "fmu"):
        words = extras.install(extra)
        assert words == "pip install " + " ".join(f'"{package}"' for package in asked[extra])
        assert PROJECT not in words


def test_a_bare_checkout_has_a_hint_too(monkeypatch):
    def unknown(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", unknown)
    assert extras.missing("It", "Dask", "sweep") == "It needs Dask: pip install '.[sweep]' in the project's folder"


@pytest.mark.parametrize(
    ("file", "command"),
    [
        ("analytic.py", ("warp_mpm", "--version")),
        ("warp_mpm.py", ("analytic", "predict", ROOT / "scenarios" / "set_iib.json")),
        ("analytic.py", ("fmu", "--version")),
    ],
)
def test_a_users_file_does_not_stand_in_for_a_package_of_ours(tmp_path, file, command):
    (tmp_path / file).write_text("raise SystemExit('the wrong one')")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-m", *map(str, command)]
    answer = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
