"""What all tests share."""

import os

import pytest

from warp_mpm import run

DRAW = run._draw

# Processes that tests begin would otherwise compile all of the packages' sources, a third of a second each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

LONGEST = (
    "test_debris_flow.py",
    "test_effects.py",
    "test_known_answers.py",
    "test_coupling.py",
    "test_debris_flow_c.py",
    "test_resume.py",
    "test_pictures.py",
    "test_bodies.py",
    "test_cross_check.py",
    "test_loads.py",
    "test_site.py",
    "test_surroundings.py",
    "test_purchase.py",
    "test_study.py",
    "test_verdict.py",
    "test_laws.py",
    "test_rooms.py",
    "test_run.py",
    "test_by_simulation.py",
    "test_compiled_code.py",
    "test_drag.py",
    "test_transfer.py",
    "test_report.py",
    "test_archives.py",
    "test_buying.py",
    "test_sweep.py",
    "test_impact_properties.py",
    "test_collection.py",
    "test_importers.py",
    "test_three_dimensions.py",
    "test_divergence.py",
    "test_checked_build.py",
    "test_threads.py",
    "test_live.py",
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
