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
import typer
from typer.testing import CliRunner

import analytic.cli
import fmu.cli
import warp_mpm.cli
from warp_mpm.commands.plot import Kind
from warp_mpm.scenario import Scenario

ROOT = Path(__file__).parents[2]
QUICK = ("api",)
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


COMMAND_LINES = {
    "warp_mpm": typer.main.get_command(warp_mpm.cli.app),
    "analytic": typer.main.get_command(analytic.cli.app),
    "fmu": typer.main.get_command(fmu.cli.app),
}
WRITTEN = sorted([*ROOT.glob("*.md"), ROOT / "Makefile", *(ROOT / "docs").rglob("*.md")])


def with_commands_of(command):
    return [command, *(one for below in getattr(command, "commands", {}).values() for one in with_commands_of(below))]


def options_of(command):
    return {"--help", *(option for one in command.params for option in (*one.opts, *one.secondary_opts))}


def test_commands_of_the_pages_exist():
    """With their options, wherever a page, a table or a remark names one; what they do, the blocks above show."""
    seen = 0
    for page in WRITTEN:
        for module, rest in re.findall(
            r"python -m (warp_mpm|analytic|fmu) ([^\n`#]+)", page.read_text().replace("\\\n", " ")
        ):
            command, words = COMMAND_LINES[module], rest.split()
            while words and words[0] in getattr(command, "commands", {}):
                command = command.commands[words.pop(0)]
                seen += 1
            assert command is not COMMAND_LINES[module] or words[0] in ("…", "..."), (page.name, rest)
            options = {word.partition("=")[0] for word in words if re.match("--[a-z]", word)}
            assert options <= options_of(command), (page.name, rest)
    assert seen > 100


def test_the_page_of_the_commands_has_a_row_for_each():
    rows = re.findall(r"^\| `([a-z-]+)", (ROOT / "docs/commands.md").read_text(), re.MULTILINE)
    assert {*COMMAND_LINES["warp_mpm"].commands} <= {*rows}


def test_options_and_pictures_that_the_prose_names_exist():
    options = {
        option for line in COMMAND_LINES.values() for one in with_commands_of(line) for option in options_of(one)
    }
    for page in WRITTEN:
        text = page.read_text()
        assert set(re.findall(r"`(--[a-z][a-z-]*)", text)) <= options, page.name
        assert set(re.findall(r"`(?:python -m warp_mpm )?plot ([a-z]+)`", text)) <= {*Kind}, page.name


def test_scenes_of_the_papers_figures_exist():
    text = (ROOT / "docs/paper_figures.md").read_text()
    runs = re.findall(r"runs/paper/(\w+)", text)
    assert len(set(runs)) > 15
    assert all((ROOT / "scenarios" / f"{run}.json").exists() for run in runs)


def test_every_row_belongs_to_a_table():
    """A blank line in a table leaves what follows it as bare text."""
    for page in WRITTEN:
        lines = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE).splitlines()
        for before, line, after in zip(["", *lines], lines, [*lines[1:], ""], strict=False):
            if line.startswith("|") and not before.startswith("|"):
                assert re.fullmatch(r"\|[ :|-]+", after), (page.name, line[:60])


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


@pytest.mark.slow  # the page of the API has the same calls
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
