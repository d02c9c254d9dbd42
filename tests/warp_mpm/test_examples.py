"""Examples may be followed one after the other: no two write the same run, and none reads one that was not made."""

import re
import shlex
from glob import glob
from pathlib import Path

import pytest

import warp_mpm.cli
from warp_mpm.commands import EXAMPLES

ROOT = Path(__file__).parents[2]
PAGES = [
    "README.md",
    *("docs/" + page for page in re.findall(r": (\S+\.md)", (ROOT / "docs/site/mkdocs.yml").read_text())),
]
"""In the order in which a reader meets them."""

SHELL = re.compile(r"^```(?:bash|sh|console)?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PYTHON = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def commands(page):
    """The commands of a page, each a list of words."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for block in SHELL.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            if re.match(r"(python|warp-mpm|make)\b", line):
                yield shlex.split(line.split("<<")[0], comments=True)


def help_examples():
    """The commands at the end of help texts."""
    texts = [command.epilog for command in warp_mpm.cli.app.registered_commands if command.epilog]
    assert len(texts) == len(EXAMPLES) + 3
    for text in texts:
        for example in re.findall(r"python -m [^;]+", text):
            yield shlex.split(example)


STUDIES = ("design", "uncertainty")
"""Commands whose folder has their name before the scenario's."""


def made(words):
    """Run folders that a command makes: {folder: the inputs that it is made of}."""
    if words[:2] == ["make", "run"]:
        (line,) = re.findall(r"python (-m warp_mpm run .*)", (ROOT / "Makefile").read_text())
        words = ["python", *line.split()]
    if words[:3] != ["python", "-m", "warp_mpm"] or words[3] not in ("run", "sweep", *STUDIES):
        return {}
    files = []
    for word in words[4:]:
        if word.startswith("-"):
            break
        files += sorted(glob(word, root_dir=ROOT)) or [word]
    out = words[words.index("--out") + 1] if "--out" in words else None
    if len(files) == 1:
        stem = Path(files[0]).stem
        return {out or f"runs/{words[3]}_{stem}" if words[3] in STUDIES else out or f"runs/{stem}": tuple(words)}
    return {f"{out or 'runs'}/{Path(file).stem}": tuple(words) for file in files}


def read(words):
    """Run folders that a command reads."""
    places = [place for place, word in enumerate(words) if word.startswith("runs/")]
    return [words[place] for place in places if words[place - 1] != "--out"]


def collisions(pages):
    """Folders that two commands would make, with the pages; `--force` and a sweep that goes on are no collisions."""
    found, owners = [], {}
    for page, words in pages:
        for folder, made_of in made(words).items():
            before = owners.setdefault(folder, (page, made_of))
            goes_on = words[3:4] == ["sweep"] and before[1][:5] == made_of[:5]
            if before[1] is not made_of and not goes_on:
                found.append(f"{folder} of {page} is there already, made by {before[0]}")
    return found


def all_commands():
    return [*((page, words) for page in PAGES for words in commands(page)), *(("help", one) for one in help_examples())]


def test_no_two_examples_make_the_same_run():
    assert len(PAGES) > 20
    assert sum(bool(made(words)) for _, words in all_commands()) > 20
    assert collisions(all_commands()) == []


def test_a_collision_would_be_found():
    run = ["python", "-m", "warp_mpm", "run", "scenarios/case_1.json"]
    several = ["python", "-m", "warp_mpm", "run", "scenarios/case_*.json"]
    assert collisions([("a", run), ("b", [*run, "--out", "runs/other"])]) == []
    assert len(collisions([("a", run), ("b", run.copy())])) == 1
    assert len(collisions([("a", run), ("b", several)])) == 1
    assert collisions(
        [("README.md", ["make", "run"]), ("b", ["python", "-m", "warp_mpm", "run", "scenarios/set_iib.json"])]
    )


@pytest.mark.parametrize("page", PAGES)
def test_a_page_makes_the_runs_that_it_reads(page):
    """Itself, or `make run` does, with which everything begins."""
    there = set(made(["make", "run"]))
    for words in commands(page):
        for folder in read(words):
            assert any(folder == one or folder.startswith(f"{one}/") for one in there), " ".join(words)
        there |= set(made(words))
    text = (ROOT / page).read_text(encoding="utf-8")
    for block in PYTHON.findall(text):
        for folder in re.findall(r'Results\.open\("([^"]+)"\)', block):
            assert folder in there, folder


TIMED = re.compile(
    r"\d (?:s|µs|minutes) (?:on|of) one core|wall time|wall \[s\]|takes? [\d.]+ (?:s|ms|µs)\b|\| [\d.]+ µs \|"
)
MACHINE = re.compile(r"AMD EPYC|Intel|Apple M\d|GeForce|A100|H\d00")


def test_times_on_a_page_name_their_machine():
    timed = [page for page in PAGES if TIMED.search((ROOT / page).read_text(encoding="utf-8"))]
    assert {"README.md", "docs/validation.md", "docs/performance.md", "docs/cosimulation.md"} <= set(timed)
    assert [page for page in timed if not MACHINE.search((ROOT / page).read_text(encoding="utf-8"))] == []
