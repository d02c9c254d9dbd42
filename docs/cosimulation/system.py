"""The co-simulation of flow, barrier and anchor as an SSP archive, and its run with fmpy.

    python -m fmu build
    python docs/cosimulation/system.py --out build/system.ssp --run

The barrier's mass, base friction and slope, and the end of the run, are those of the scenario in DebrisFlowC.fmu, as in
coupled.py. Any tool that reads SSP takes the archive, for instance libcosim or OMSimulator; they apply the parameters
in it. fmpy's own runner leaves them to its caller, so they are read here and passed on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet

from warp_mpm_fmu.system import COMPONENTS, parameters_in, scenario_in, write_system

UNITS = tuple(unit for unit, _ in COMPONENTS.values())


def parameters(path: Path) -> ParameterSet:
    """The parameters in an SSP archive, in the form that fmpy's runner takes."""
    found = ParameterSet(name="all")
    for name, (kind, value) in parameters_in(path).items():
        found.parameters.append(Parameter(name=name, type=kind, value=value))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--out", type=Path, default=Path("build/system.ssp"), help="the SSP archive to write")
    parser.add_argument("--spacing", type=float, help="grid spacing [m], instead of the scenario's")
    parser.add_argument("--run", action="store_true", help="run it with fmpy")
    parser.add_argument("--step", type=float, default=0.01, help="communication step [s]")
    parser.add_argument("--end", type=float, help="end time [s]; without it the scenario's")
    given = parser.parse_args()
    if not all((given.archives / f"{name}.fmu").is_file() for name in UNITS):
        parser.error(f"--archives: {given.archives} must hold {', '.join(UNITS)}; python -m fmu build makes them")
    try:
        path = write_system(given.archives, given.out, spacing=given.spacing)
    except ValueError as error:
        parser.error(str(error))
    except OSError as error:
        parser.error(f"--out: {given.out} cannot be written: {error.strerror}")
    print(f"System: {path}")
    if given.run:
        end = given.end or scenario_in(given.archives / f"{UNITS[0]}.fmu").output.end_time_s
        result = simulate_ssp(str(path), stop_time=end, step_size=given.step, parameter_set=parameters(path))
        last = result[-1]
        print(f"Final displacement: {last['barrier.barrier_displacement']:.3f} m")
        print(f"Anchor used to: {last['anchor.utilisation']:.0%}")


if __name__ == "__main__":
    main()
