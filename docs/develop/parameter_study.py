"""A parameter study from Python: speed of the flow against friction at the barrier's base, as a table."""

import sys
from pathlib import Path

from warp_mpm import Scenario
from warp_mpm.sweep import study

SCENES = Path(__file__).parents[2] / "scenarios"


def main(folder: Path, spacing: float = 0.5, until: float = 1.0):
    scenario = Scenario.load(SCENES / "set_iib.json").replaced(
        {"numerics.spacing_m": spacing, "output.end_time_s": until}
    )
    speed, friction = "flow.velocity_m_per_s.0", "barrier.motion.base_friction"
    frame = study(scenario, {speed: [10, 20], friction: [0.3, 0.6]}, folder)
    print(frame.pivot(index=speed, columns=friction, values="barrier_displacement_final"), frame.attrs["units"])
    return frame


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/parameter_study"))
