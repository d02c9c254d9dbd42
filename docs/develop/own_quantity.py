"""Two quantities of a script in a run's time series: how far the flow has come, and the load on all of the barrier."""

import sys
from pathlib import Path

from warp_mpm import Results, Scenario, Simulation
from warp_mpm.quantities import Sampled, register
from warp_mpm.run import run_scenario

SCENES = Path(__file__).parents[2] / "scenarios"


def foremost(now) -> float:
    """[m]; an empty scene has come nowhere."""
    x = now.points(["position"])["position"][:, 0]
    return float(x.max()) if len(x) else 0.0


def load(now) -> float:
    """Of the flow on face, crest and downstream side along x [N/m], the mean since the sample before."""
    return sum(now.forces[surface][0] for surface in ("impact", "top", "back"))


register(Sampled("front", "m", "x of the foremost material point", "front of the flow", "x_f", read=foremost))
register(
    Sampled(
        "barrier_load",
        "N/m",
        "force of the flow on all of the barrier along x; mean over the interval",
        "load on the barrier",
        read=load,
        there=lambda scenario: scenario.barrier is not None,
        of_points=False,  # it asks for no points, and costs nothing where other quantities ask for none
        mean=True,
    )
)


def main(folder: Path, spacing: float = 0.25, until: float = 1.0) -> Results:
    scenario = Scenario.load(SCENES / "case_1.json").replaced(
        {"numerics.spacing_m": spacing, "output.end_time_s": until}
    )
    outcome = run_scenario(scenario, folder, make_simulation=Simulation)
    results = Results.open(outcome.path)
    for name, quantity in results.quantities.items():
        if name in ("front", "barrier_load"):
            print(f"{quantity.title}: at most {outcome.summary[f'{name}_max'] * quantity.factor:.4g}")
    return results


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/own_quantity"))
