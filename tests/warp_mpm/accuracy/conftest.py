"""What the tests of accuracy share."""

from __future__ import annotations

from pathlib import Path

import pytest

from warp_mpm.scenario import Scenario

SCENARIOS = Path(__file__).parents[3] / "scenarios"


@pytest.fixture(scope="module")
def scene() -> Scenario:
    return Scenario.load(SCENARIOS / "case_1.json").replaced({"numerics.spacing_m": 0.4, "output.end_time_s": 1.0})
