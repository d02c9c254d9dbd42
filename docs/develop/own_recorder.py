"""A recorder of a script: the depth of the flow over x, at times of its own, in a file of its own."""

import sys
from pathlib import Path

import numpy as np

from warp_mpm import Scenario, Simulation
from warp_mpm.recording import Schedule
from warp_mpm.run import run_scenario

SCENES = Path(__file__).parents[2] / "scenarios"


class DepthProfile:
    """Writes a line of depths at each of its times: volume of the points over each strip's width."""

    def __init__(self, path: Path, interval: float, edges: np.ndarray):
        """Args: path of a CSV file; interval between lines [s]; edges of the strips [m]."""
        self.schedule = Schedule(interval)
        self._edges = edges
        self._file = path.open("w", encoding="utf-8")
        middle = 0.5 * (edges[1:] + edges[:-1])
        self._file.write("time [s]," + ",".join(f"depth at {x:g} m [m]" for x in middle) + "\n")

    def record(self, simulation: Simulation) -> None:
        points = simulation.points(["position", "volume"])
        volume, _ = np.histogram(points["position"][:, 0], self._edges, weights=points["volume"])
        depth = volume / np.diff(self._edges)
        self._file.write(",".join(f"{value:.6g}" for value in (simulation.time, *depth)) + "\n")
        self._file.flush()  # what is written survives the process

    def close(self) -> None:
        self._file.close()


def main(folder: Path, spacing: float = 0.25, until: float = 1.0) -> Path:
    scenario = Scenario.load(SCENES / "case_1.json").replaced(
        {"numerics.spacing_m": spacing, "output.end_time_s": until}
    )
    path = folder.with_suffix(".depth.csv")
    profile = DepthProfile(path, interval=0.1, edges=np.arange(-26.0, 4.1, 1.0))
    run_scenario(scenario, folder, make_simulation=Simulation, recorders=[profile])
    print(f"depths are in {path}")
    return path


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/own_recorder"))
