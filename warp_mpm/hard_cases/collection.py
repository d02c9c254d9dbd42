"""The collection: one scenario file per case, whose first note says why it is hard."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from warp_mpm.scenario import Scenario
from warp_mpm.shipped import SCENARIOS

FOLDER = SCENARIOS / "hard"

LARGE = frozenset({"million_points"})
"""Cases that take minutes on a processor; `--small` and `--quick` leave them out."""


@dataclass(frozen=True)
class HardCase:
    """A scene that is hard."""

    name: str
    scenario: Scenario

    @property
    def reason(self) -> str:
        """Why it is hard, in one line."""
        return self.scenario.notes[0]


def hard_cases(names: list[str] | None = None, *, folder: Path = FOLDER, small: bool = False) -> list[HardCase]:
    """The cases named, or all of them.

    Raises:
        ValueError: there is no case of a name, or no collection in the folder.
        ScenarioError: a file is damaged.
    """
    known = {path.stem: path for path in sorted(folder.glob("*.json"))}
    if not known:
        raise ValueError(f"{folder} holds no hard cases.")
    unknown = [name for name in names or [] if name not in known]
    if unknown:
        raise ValueError(f"There is no hard case {unknown[0]!r}; it must be one of {', '.join(known)}.")
    chosen = names or [name for name in known if not (small and name in LARGE)]
    return [HardCase(name, Scenario.load(known[name])) for name in chosen]
