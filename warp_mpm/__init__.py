"""Two-phase Material Point Method for debris flows that hit a rigid barrier which may slide.

>>> from warp_mpm import Scenario, Simulation
>>> simulation = Simulation(Scenario.load("scenarios/case_1.json"))
>>> simulation.advance(until=1.0)
>>> simulation.points()["pore_pressure"].max()

Nothing is loaded, and no device started, before a name is used.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # without `typing`, which takes long enough for a Ctrl-C before the command line can hear it

if TYPE_CHECKING:
    from typing import Any

    from warp_mpm.results import Results as Results
    from warp_mpm.scenario import Scenario as Scenario
    from warp_mpm.scenario_errors import ScenarioError as ScenarioError
    from warp_mpm.simulation import Simulation as Simulation

_HOMES = {
    "Results": "warp_mpm.results",
    "Scenario": "warp_mpm.scenario",
    "ScenarioError": "warp_mpm.scenario_errors",
    "Simulation": "warp_mpm.simulation",
}

__all__ = ["Results", "Scenario", "ScenarioError", "Simulation"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
