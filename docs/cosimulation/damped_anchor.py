"""A barrier on a spring-damper anchor that yields: how much of the slide an anchor of which strength saves.

    python -m fmu build --only BarrierSlidingC --only GroundAnchorC
    python docs/cosimulation/damped_anchor.py

The closed form pushes the barrier; GroundAnchorC is the spring that yields; the dashpot beside it is a line of the
master. Both act on the barrier over the next step.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from warp_mpm_fmu.instance import instance_of

BARRIER = {"flow_mass": 81e3, "barrier_mass": 81e3, "speed": 10.0, "base_friction": 0.29}
YIELD_FORCES = (0.0, 25e3, 50e3, 100e3, 200e3)


def slide(
    archives: Path, *, yield_force: float, damping: float, step: float = 1e-3, end: float = 4.0
) -> dict[str, float]:
    """Run barrier and anchor.

    Args:
        archives: folder with the units.
        yield_force: of the anchor [N/m]; 0 for none.
        damping: force of the dashpot per velocity of the barrier [N s/m2].
        step, end: communication step and end [s].

    Returns:
        Final displacement [m], largest anchor force [N/m], and plastic elongation of the anchor [m].
    """
    anchor = {"stiffness": 2e5, "yield_force": yield_force or 1.0, "slack": 0.0 if yield_force else 1e3}
    largest = 0.0
    with (
        instance_of(archives / "BarrierSlidingC.fmu") as barrier,
        instance_of(archives / "GroundAnchorC.fmu") as tie,
    ):
        barrier.initialize(**BARRIER)
        tie.initialize(**anchor)
        for _ in range(round(end / step)):
            barrier["external_force"] = tie["force"] - damping * barrier["barrier_velocity"]
            barrier.step(step)
            tie["barrier_displacement"] = barrier["barrier_displacement"]
            tie.step(step)
            largest = max(largest, -tie["force"])
        displacement = barrier["barrier_displacement"]
        elastic = -tie["force"] / anchor["stiffness"]
    plastic = max(displacement - elastic, 0.0) if yield_force else 0.0
    return {"displacement": displacement, "anchor_force": largest, "plastic_elongation": plastic}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--damping", type=float, default=10e3, help="of the dashpot [N s/m2]")
    given = parser.parse_args()
    print(f"{'yield force [kN/m]':>18} {'slide [m]':>10} {'anchor [kN/m]':>14} {'plastic [m]':>12}")
    for yield_force in YIELD_FORCES:
        found = slide(given.archives, yield_force=yield_force, damping=given.damping)
        print(
            f"{yield_force / 1e3:18.0f} {found['displacement']:10.3f} {found['anchor_force'] / 1e3:14.1f} "
            f"{found['plastic_elongation']:12.3f}"
        )


if __name__ == "__main__":
    main()
