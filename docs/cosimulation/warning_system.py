"""A warning system: a gauge upstream sees the flow come, and a gate closes; does it close before the flow is there?

    python -m fmu build --only DebrisFlowC
    python docs/cosimulation/warning_system.py --threshold 0.5 --closing 0.2

DebrisFlowC tells the depth at its gauge. The master is the rest of the system: an alarm at a threshold of the depth, a
signal that takes a while, and a gate that takes another to close.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from warp_mpm_fmu.instance import instance_of

FELT = 1e3
"""Force on the barrier [N/m] from which on the flow is there."""


@dataclass
class Warned:
    """Times [s]; infinite for what did not happen."""

    alarm: float = float("inf")
    closed: float = float("inf")
    arrival: float = float("inf")

    @property
    def margin(self) -> float:
        """Between the closing of the gate and the arrival of the flow [s]; negative: too late."""
        return self.arrival - self.closed


def run(
    archives: Path,
    *,
    threshold: float,
    gauge: float = -1.5,
    delay: float = 0.02,
    closing: float = 0.05,
    step: float = 0.005,
    end: float = 1.0,
    spacing: float = 0.0,
) -> Warned:
    """Run the flow until it is at the barrier.

    Args:
        archives: folder with the unit.
        threshold: depth at the gauge that raises the alarm [m].
        gauge: its place along x [m]; the toe of the barrier is at 0.
        delay, closing: of the signal, and of the gate [s].
        step, end: communication step and end [s].
        spacing: of the simulator's grid [m]; 0 takes the scenario's.
    """
    found = Warned()
    with instance_of(archives / "DebrisFlowC.fmu") as flow:
        flow.initialize(gauge_position=gauge, spacing=spacing)
        while flow.time < end and found.arrival > flow.time:
            flow.step(step)
            if flow["gauge_depth"] >= threshold and found.alarm > flow.time:
                found.alarm = flow.time
                found.closed = flow.time + delay + closing
            if flow["barrier_force"] > FELT:
                found.arrival = flow.time
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--threshold", type=float, default=0.5, help="depth that raises the alarm [m]")
    parser.add_argument("--gauge", type=float, default=-1.5, help="place of the gauge along x [m]")
    parser.add_argument("--closing", type=float, default=0.05, help="time that the gate takes to close [s]")
    parser.add_argument("--spacing", type=float, default=0.0, help="grid spacing [m]; 0 takes the scenario's")
    given = parser.parse_args()
    found = run(
        given.archives, threshold=given.threshold, gauge=given.gauge, closing=given.closing, spacing=given.spacing
    )
    print(f"Alarm at {found.alarm:.3f} s, gate closed at {found.closed:.3f} s")
    print(f"Flow at the barrier at {found.arrival:.3f} s")
    print(f"The gate is closed {abs(found.margin):.3f} s too {'early' if found.margin > 0 else 'late'}")


if __name__ == "__main__":
    main()
