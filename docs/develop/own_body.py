"""A flow around a pillar of any outline, onto a plate that gives way as it is told: bodies of a script."""

import math
import sys
from functools import partial
from pathlib import Path

from warp_mpm import Results, Scenario, Simulation
from warp_mpm.run import run_scenario
from warp_mpm.simulator.bodies import Body, Driven, Outline, Surface

SCENES = Path(__file__).parents[2] / "scenarios"


def pillar(x: float, y: float, radius: float) -> Body:
    """A round pillar as a polygon of 24 corners; its upstream half is rough."""
    angles = [2.0 * math.pi * k / 24 for k in range(24)]
    outline = Outline([(x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles])
    faces_the_flow = outline.segments.normal[:, 0] < 0.0
    upstream = tuple(k for k in range(24) if faces_the_flow[k])
    downstream = tuple(k for k in range(24) if not faces_the_flow[k])
    return Body("pillar", outline, (Surface("bow", 0.3, upstream), Surface("stern", 0.0, downstream)))


def plate(x: float, height: float) -> Body:
    """A plate that swings downstream and back by half a metre in a second."""
    outline = Outline([(x, -1.0), (x + 1.0, -1.0), (x + 1.0, height), (x, height)])
    times = [0.02 * k for k in range(101)]
    swing = Driven.function(lambda t: (0.5 * math.pi * math.sin(2.0 * math.pi * t), 0.0), times)
    return Body("plate", outline, motion=swing)


def main(folder: Path, spacing: float = 0.25, until: float = 1.0) -> Results:
    scenario = Scenario.load(SCENES / "case_1.json").replaced(
        {"barrier": None, "numerics.spacing_m": spacing, "output.end_time_s": until}
    )
    bodies = [pillar(0.5, 1.5, 1.0), plate(6.0, 4.0)]
    outcome = run_scenario(scenario, folder, make_simulation=partial(Simulation, bodies=bodies))
    results = Results.open(outcome.path)
    for name in ("bow", "stern", "plate"):
        force = results.time_series[f"{name}_force_x"]
        print(f"greatest force on {name}: {force.max() / 1e3:.0f} kN/m")
    return results


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/own_body"))
