"""What the documentation tells a reader to type is typed: every `bash` and `python` block of the pages, in order.

Blocks marked `console` are for other machines (a cluster, a GPU) or take long; they are not typed. A `json` block with
a title is saved under that name, as the page asks its reader to do. Pages that run many scenes are marked slow; the
pages share one folder, as they do on a reader's machine.
"""

import json
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import analytic.cli
import warp_mpm.cli
from warp_mpm.scenario import Scenario

ROOT = Path(__file__).parents[2]
QUICK = ("index", "api")
HOW_TO = (f"how_to/{path.stem}" for path in sorted((ROOT / "docs/how_to").glob("*.md")))
PAGES = ("../README", "index", "ten_minutes", "tutorial", "api", *HOW_TO)

BLOCK = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(page):
    return BLOCK.findall((ROOT / "docs" / f"{page}.md").read_text())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder as a reader has it: the scenarios at hand, the results of all pages in `runs`."""
    folder = tmp_path_factory.mktemp("reader")
    (folder / "scenarios").symlink_to(ROOT / "scenarios")
    return folder


@pytest.mark.parametrize(
    "page", [page if page in QUICK else pytest.param(page, marks=pytest.mark.slow) for page in PAGES]
)
def test_page_does_what_it_says(page, folder):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    for language, title, text in blocks(page):
        if title:
            (folder / title).write_text(text)
            continue
        if language == "python":
            commands = [[sys.executable, "-c", text]]
        elif language == "bash":
            lines = text.replace("\\\n", " ").strip().split("\n")
            lines = [line for line in lines if not line.startswith(("make ", "pip install "))]
            assert all(line.startswith("python ") for line in lines), text
            commands = [["bash", "-c", line] for line in lines]
        else:
            continue
        for command in commands:
            answer = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600, check=False
            )
            assert answer.returncode == 0, f"{' '.join(command[1:])}\n{answer.stdout}\n{answer.stderr}"


def test_commands_of_the_papers_figures_exist():
    """The figures themselves need minutes of runs; here, that each command is one and its scenes are there."""
    text = (ROOT / "docs/paper_figures.md").read_text()
    commands = re.findall(r"`(python -m [^`]+)`", text)
    assert len(commands) >= 12
    apps = {"warp_mpm": warp_mpm.cli.app, "analytic": analytic.cli.app}
    for command in commands:
        module, verb = command.split()[2:4]
        answer = CliRunner().invoke(apps[module], [verb, "--help"], env={"COLUMNS": "200"})
        assert answer.exit_code == 0, command
        for run in re.findall(r"runs/paper/(\w+)", command):
            assert (ROOT / "scenarios" / f"{run}.json").exists(), run
        for option in re.findall(r"--[a-z-]+", command):
            assert option in answer.stdout, (command, option)


def test_navigation_leads_to_pages():
    """A page that is left out of it, the build tells of."""
    navigation = (ROOT / "docs/site/mkdocs.yml").read_text().split("\nnav:\n")[1]
    listed = re.findall(r": (\S+\.md)", navigation)
    assert len(listed) > 15
    for page in listed:
        assert (ROOT / "docs" / page).is_file(), page


def test_the_gallery_has_every_scene():
    """As `python docs/gallery.py` writes it."""
    gallery = runpy.run_path(str(ROOT / "docs/gallery.py"))
    scenes = gallery["shown"]()
    assert len(scenes) > 20
    wanted = "".join(gallery["entry"](name, Scenario.load(file)) for name, file in scenes.items())
    assert (ROOT / "docs/gallery.md").read_text() == gallery["HEAD"] + wanted
    assert {path.stem for path in (ROOT / "docs/images/gallery").glob("*.png")} == set(scenes)


def test_ten_minutes_are_typed_as_printed():
    """What the script that times the page types is what stands on it, and every option is one."""
    timed = runpy.run_path(str(ROOT / "docs/ten_minutes.py"))["commands"]()
    assert timed[0].startswith("python3 -m venv")
    assert timed[1].startswith("pip install warp_mpm_impact")
    verbs = [line.split()[3] for line in timed[2:]]
    assert verbs == ["init", "check", "design", "run", "report"]
    for verb, line in zip(verbs, timed[2:], strict=True):
        help_text = CliRunner().invoke(warp_mpm.cli.app, [verb, "--help"], env={"COLUMNS": "200"}).stdout
        for option in re.findall(r" (--[a-z-]+)", line):
            assert option in help_text, line


def test_notebook_runs(folder):
    """Its cells one after the other, as a notebook runs them; Jupyter itself is not needed for that."""
    cells = json.loads((ROOT / "docs/notebook.ipynb").read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] for cell in code)  # as they are read where nobody runs them
    lines = [line for cell in cells if cell["cell_type"] == "code" for line in [*cell["source"], "\n"]]
    program = "\n".join(line.rstrip("\n") for line in lines if not line.startswith("%"))
    answer = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    assert "lambda" in answer.stdout
