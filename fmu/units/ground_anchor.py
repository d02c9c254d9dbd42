"""The unit GroundAnchor: a tendon that holds the barrier back, elastic until it yields, slack when pushed."""

from __future__ import annotations

from typing import Any

from .interface import METRE, NEWTON_PER_METRE, NEWTON_PER_SQUARE_METRE, ONE, Interface, Variable
from .slave import UnitSlave

DISPLACEMENT_LIMIT = 1e6
"""Largest displacement that the input may bring [m]: a number above it is a mistake."""

INTERFACE = Interface(
    "GroundAnchor",
    "Elastic, perfectly plastic anchor that holds a sliding barrier back, per metre of width",
    (
        Variable(
            "stiffness",
            "parameter",
            "Anchor force per metre of elongation and metre of width",
            unit=NEWTON_PER_SQUARE_METRE,
            start=200e3,
            minimum=0.0,
            open_minimum=True,
            nominal=1e5,
            tunable=True,
        ),
        Variable(
            "slack",
            "parameter",
            "Displacement of the barrier at which the anchor tightens",
            unit=METRE,
            start=0.0,
            minimum=0.0,
        ),
        Variable(
            "yield_force",
            "parameter",
            "Force per metre of width at which the anchor yields",
            unit=NEWTON_PER_METRE,
            start=150e3,
            minimum=0.0,
            open_minimum=True,
            nominal=1e5,
            tunable=True,
        ),
        Variable(
            "barrier_displacement",
            "input",
            "Displacement of the barrier, positive in the direction of the flow",
            unit=METRE,
            start=0.0,
            minimum=-DISPLACEMENT_LIMIT,
            maximum=DISPLACEMENT_LIMIT,
        ),
        Variable(
            "force",
            "output",
            "Force of the anchor on the barrier per metre of width; negative, it holds back",
            unit=NEWTON_PER_METRE,
            maximum=0.0,
            nominal=1e5,
        ),
        Variable("utilisation", "output", "Anchor force over the yield force", unit=ONE, minimum=0.0, maximum=1.0),
        Variable("yielded", "output", "Whether the anchor has yielded", "Boolean"),
    ),
    stop_time=4.0,
    step_size=0.01,
)


class GroundAnchorSlave(UnitSlave):
    """The anchor as a co-simulation unit; its force is that of the displacement at the end of the step."""

    interface = INTERFACE
    plastic_elongation = 0.0

    def start(self) -> None:
        self.plastic_elongation = 0.0
        self["yielded"] = False
        self._pull()

    def step(self, end: float) -> None:
        self._pull()

    def _pull(self) -> None:
        stiffness, yield_force = self["stiffness"], self["yield_force"]
        elongation = self["barrier_displacement"] - self["slack"] - self.plastic_elongation
        tension = max(stiffness * elongation, 0.0)
        if tension > yield_force:
            self.plastic_elongation += (tension - yield_force) / stiffness
            tension = yield_force
            self["yielded"] = True
        self["force"] = 0.0 - tension  # 0.0 first: a slack anchor shows 0, not -0
        self["utilisation"] = tension / yield_force

    def snapshot(self) -> Any:
        return self.plastic_elongation

    def restore(self, snapshot: Any) -> None:
        self.plastic_elongation = snapshot
