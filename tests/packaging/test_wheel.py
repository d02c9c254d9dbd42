"""What an installed wheel holds, and what it can do where there is no checkout."""

import json
import os
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


def packed(monkeypatch):
    """The data files that setup.py and pyproject.toml put into a wheel, by their places in it."""
    arguments = {}
    monkeypatch.setattr(setuptools, "setup", arguments.update)
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    patterns = tomllib.loads(Path("pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    found = {}
    for package in arguments["packages"]:
        folder = Path(arguments["package_dir"].get(package, package.replace(".", "/")))
        for pattern in patterns.get(package, ()):
            for file in folder.glob(pattern):
                found[Path(package.replace(".", "/")) / file.relative_to(folder)] = file
    return found


def test_scenes_and_types_are_packed(monkeypatch):
    files = packed(monkeypatch)
    assert {Path("warp_mpm") / scene for scene in SCENES} <= set(files)
    assert all(files[Path("warp_mpm") / scene] == scene for scene in SCENES)
    assert {Path(package, "py.typed") for package in ("warp_mpm", "analytic", "fmu")} <= set(files)


def test_every_pattern_packs_something():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    folders = {"warp_mpm.scenarios": ROOT / "scenarios"}
    for package, its in patterns.items():
        assert [one for one in its if not list(folders.get(package, ROOT / package).glob(one))] == [], package


def test_every_package_is_packed(monkeypatch):
    arguments = {}
    monkeypatch.setattr(setuptools, "setup", arguments.update)
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    modules = [path for top in ("warp_mpm", "analytic", "fmu") for path in Path(top).rglob("*.py")]
    assert len(modules) > 100
    assert {".".join(path.parent.parts) for path in modules} <= set(arguments["packages"])


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Python of an environment with the wheel alone, and beside it this one's other packages."""
    folder = tmp_path_factory.mktemp("wheel environment ü")
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT], check=True
    )
    (wheel,) = folder.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)
    scheme = {"base": str(folder / "env"), "platbase": str(folder / "env")}
    packages = Path(sysconfig.get_path("purelib", vars=scheme))
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    # A path file leaves the path files behind that path alone, so this checkout's own, if it is installed, too.
    (packages / "others.pth").write_text(sysconfig.get_path("purelib"))
    return folder / "env" / "bin" / "python"


def typed(python, folder, *words):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(
        [python, "-m", *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


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
        ("fmu", "build"),
        ("fmu", "check", "scenarios/set_iib.json", "--spacing", 1.0),
    ):
        done = typed(installed, folder, *words)
        assert done.returncode == 0, (words, done.stderr)
    copied = sorted(path.relative_to(folder) for path in (folder / "scenarios").rglob("*.*"))
    assert copied == SCENES
    record = json.loads((folder / "runs" / "set_iib" / "run.json").read_text())
    assert record["status"] == "finished"
