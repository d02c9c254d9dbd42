"""What an installed wheel holds, and what it can do where there is no checkout."""

import json
import os
import re
import runpy
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import pytest
import setuptools

ROOT = Path(__file__).parents[2]
SCENES = sorted(path.relative_to(ROOT) for path in (ROOT / "scenarios").rglob("*.*"))
FOLDERS = {"warp_mpm": "warp_mpm", "analytic": "analytic", "warp_mpm_fmu": "fmu"}
"""Of the packages by the names that they are installed by."""


@pytest.fixture
def arguments(monkeypatch):
    """Of `setup` in setup.py."""
    given = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    return given


def packed(arguments):
    """The data files that setup.py and pyproject.toml put into a wheel, by their places in it."""
    patterns = tomllib.loads(Path("pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    found = {}
    for package in arguments["packages"]:
        folder = Path(arguments["package_dir"].get(package, package.replace(".", "/")))
        for pattern in patterns.get(package, ()):
            for file in folder.glob(pattern):
                found[Path(package.replace(".", "/")) / file.relative_to(folder)] = file
    return found


def test_scenes_and_types_are_packed(arguments):
    files = packed(arguments)
    assert {Path("warp_mpm") / scene for scene in SCENES} <= set(files)
    assert all(files[Path("warp_mpm") / scene] == scene for scene in SCENES)
    assert {Path(package, "py.typed") for package in FOLDERS} <= set(files)


def test_every_pattern_packs_something():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    folders = FOLDERS | {"warp_mpm.scenarios": "scenarios"}
    for package, its in patterns.items():
        assert [one for one in its if not list((ROOT / folders[package]).glob(one))] == [], package


def test_every_package_is_packed_and_none_by_a_name_of_others(arguments):
    """PyPI has a package `fmu`: the folder of that name is installed by another."""
    assert {name.partition(".")[0] for name in arguments["packages"]} == set(FOLDERS)
    for package, top in FOLDERS.items():
        modules = list(Path(top).rglob("*.py"))
        assert len(modules) > 20
        parents = {".".join((package, *path.parent.relative_to(top).parts)) for path in modules}
        assert parents <= set(arguments["packages"])
        assert arguments["package_dir"].get(package, package) == top


def test_the_folder_fmu_knows_itself_by_no_name():
    """Its modules import each other relatively, so that it is the same by its own name and by the installed one."""
    for path in (ROOT / "fmu").rglob("*.py"):
        assert not re.search(r"^ *(from|import) (fmu|warp_mpm_fmu)\b", path.read_text(), re.MULTILINE), path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT], check=True
    )
    (built,) = folder.glob("*.whl")
    return built


def stand_in(folder):
    """A wheel of another project that has a package `fmu`, as PyPI's has."""
    files = {
        "fmu/__init__.py": "OWNER = 'others'\n",
        "fmu-9.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: fmu\nVersion: 9.0\n",
        "fmu-9.0.dist-info/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files["fmu-9.0.dist-info/RECORD"] = "".join(f"{name},,\n" for name in (*files, "fmu-9.0.dist-info/RECORD"))
    path = folder / "fmu-9.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def pip(python, *words):
    subprocess.run([sys.executable, "-m", "pip", "--python", python, *words], check=True)


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Python of an environment with the wheel and another project's package `fmu`, beside it this one's packages."""
    folder = tmp_path_factory.mktemp("wheel environment ü")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)
    python = folder / "env" / "bin" / "python"
    pip(python, "install", "--quiet", "--no-index", "--no-deps", stand_in(folder), wheel)
    scheme = {"base": str(folder / "env"), "platbase": str(folder / "env")}
    # A path file leaves the path files behind that path alone, so this checkout's own, if it is installed, too.
    others = Path(sysconfig.get_path("purelib", vars=scheme)) / "others.pth"
    others.write_text(sysconfig.get_path("purelib"))
    yield python
    others.unlink()
    pip(python, "uninstall", "--quiet", "--yes", "warp-mpm-impact")
    owner = subprocess.run([python, "-c", "import fmu; print(fmu.OWNER)"], cwd=folder, capture_output=True, text=True)
    assert owner.stdout == "others\n", owner.stderr


def typed(program, folder, *words):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(
        [program, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_a_wheel_has_nothing_of_the_name_of_others(wheel):
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.partition("/")[0] for name in archive.namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(FOLDERS)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="programs lie elsewhere there")
def test_the_units_are_built_beside_a_package_fmu_of_others(installed, tmp_path):
    for words in (
        ("--help",),
        ("parameters", ROOT / "scenarios" / "set_iib.json"),
        ("build", "--only", "BarrierSliding", "--only", "GroundAnchorC", "--platform", "linux64"),
        ("check", "build/fmu/BarrierSliding.fmu"),
    ):
        done = typed(installed.parent / "warp-mpm-fmu", tmp_path, *words)
        assert done.returncode == 0, (words, done.stderr)
    assert (
        typed(installed, tmp_path, "-m", "warp_mpm_fmu", "--help")
        .stdout.lstrip()
        .startswith("Usage: python -m warp_mpm_fmu ")
    )
    assert typed(installed, tmp_path, "-c", "import fmu; print(fmu.OWNER)").stdout == "others\n"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="programs lie elsewhere there")
def test_a_wheel_does_without_the_checkout(installed, tmp_path):
    place = subprocess.run(
        [installed, "-c", "import warp_mpm; print(warp_mpm.__file__)"], cwd=tmp_path, capture_output=True, text=True
    )
    assert str(ROOT) not in place.stdout
    folder = tmp_path / "Jörg Müller"
    folder.mkdir()
    for words in (
        ("warp_mpm", "--version"),
        ("warp_mpm", "scenarios", "--out", "scenarios"),
        ("warp_mpm", "check", "scenarios/case_1.json"),
        ("warp_mpm", "run", "scenarios/set_iib.json", "--spacing", 0.75, "--until", 0.4, "--report"),
        ("warp_mpm", "hard-cases", "--quick", "--only", "one_point"),
        ("analytic", "predict", "scenarios/set_iib.json"),
        ("warp_mpm_fmu", "build"),
        ("warp_mpm_fmu", "check", "scenarios/set_iib.json", "--spacing", 1.0),
    ):
        done = typed(installed, folder, "-m", *words)
        assert done.returncode == 0, (words, done.stderr)
    copied = sorted(path.relative_to(folder) for path in (folder / "scenarios").rglob("*.*"))
    assert copied == SCENES
    record = json.loads((folder / "runs" / "set_iib" / "run.json").read_text())
    assert record["status"] == "finished"
