"""What all tests share."""

import os

import pytest

from warp_mpm import run

DRAW = run._draw

# Processes that tests begin would otherwise compile all of the packages' sources, a third of a second each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

LONGEST = (
    "test_known_answers.py",
    "test_debris_flow.py",
    "test_bodies.py",
    "test_effects.py",
    "test_cross_check.py",
    "test_resume.py",
    "test_pictures.py",
    "test_compiled_code.py",
    "test_accuracy.py",
    "test_laws.py",
    "test_surroundings.py",
    "test_rooms.py",
    "test_safeguards.py",
    "test_collection.py",
    "test_slope.py",
    "test_batch.py",
    "test_sweep.py",
)
"""Files that take longest, in the order in which they begin, so that no process is left alone with one at the end."""


def pytest_collection_modifyitems(items):
    """The longest files first, the others as they are found."""
    order = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path.name, len(LONGEST)))


@pytest.fixture(autouse=True, scope="module")
def runs_without_pictures():
    """Runs in this process leave out their two pictures, which take longer than a coarse run does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "_draw", lambda results, path: None)
        yield


@pytest.fixture
def runs_with_pictures(monkeypatch):
    """For tests of the pictures."""
    monkeypatch.setattr(run, "_draw", DRAW)
