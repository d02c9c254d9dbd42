"""What all tests share."""

import pytest

from warp_mpm import run

DRAW = run._draw


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
