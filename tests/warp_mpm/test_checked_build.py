"""The build of the kernels for debugging: an index outside its array ends the process and says where.

Slow: it is for who looks for an error in a kernel, and takes kernels of its own.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from warp_mpm.simulation import Simulation

REPOSITORY = Path(__file__).parents[2]

PROGRAM = """
import sys
from warp_mpm import Scenario, Simulation

scenario = Scenario.load(sys.argv[1]).replaced({"numerics.spacing_m": 1.0, "output.end_time_s": 0.2})
simulation = Simulation(scenario)
simulation.advance(0.1)
print("energy", simulation.sample()["flow_kinetic_energy"], flush=True)
if sys.argv[2] == "thrown":
    position = simulation._point_arrays["position"].numpy()
    position[0] = (1e4, 1e4)  # outside the grid, where `advect` lets no point be
    simulation.advance(0.2)
"""


pytestmark = pytest.mark.slow


def run(name, how, **environment):
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, REPOSITORY / f"scenarios/{name}.json", how],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("name", ["case_1_dry", "case_1"])
def test_an_index_outside_its_array_is_named(load_scene, name):
    """Until then the run goes through, and to the numbers of the plain build."""
    done = run(name, "thrown", WARP_MPM_CHECKED="1")
    assert done.returncode != 0
    assert "Assertion failed: 'p >= 0 && p <" in done.stderr
    assert "warp_mpm/" in done.stderr  # the kernel's file and line
    plain = Simulation(load_scene(name, **{"numerics.spacing_m": 1.0, "output.end_time_s": 0.2}))
    plain.advance(0.1)
    energy = float(done.stdout.split()[1])
    # Another compiler's level, another rounding.
    assert energy == pytest.approx(plain.sample()["flow_kinetic_energy"], rel=1e-12)
