"""A co-simulation of three units with an fmpy master: the flow, the barrier that it pushes, and an anchor.

    python -m fmu build
    python docs/cosimulation/coupled.py

DebrisFlow gives the force on the barrier, BarrierSliding moves the barrier under it and gives its velocity back, and
GroundAnchor holds the barrier by a force that follows from its displacement. The barrier's mass, base friction and
slope, and the end of the run, are those of the scenario in DebrisFlowC.fmu. Run with --help for the options.
"""

from __future__ import annotations

import argparse
import math
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import NoReturn

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from warp_mpm_fmu.system import barrier_parameters, scenario_in

UNITS = ("DebrisFlowC", "BarrierSlidingC", "GroundAnchorC")


class Unit:
    """One instance of an archive; its variables by name."""

    def __init__(self, archive: Path, **parameters: float | int | bool | str) -> None:
        description = read_model_description(str(archive))
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.folder = extract(str(archive))
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=archive.stem,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        for name, value in parameters.items():
            self[name] = value
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def __getitem__(self, name: str) -> float:
        variable = self.variables[name]
        return getattr(self.fmu, f"get{variable.type}")([variable.valueReference])[0]

    def __setitem__(self, name: str, value: float | int | bool | str) -> None:
        variable = self.variables[name]
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [value])

    def step(self, time: float, size: float) -> None:
        self.fmu.doStep(time, size)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass
class Row:
    """State of the system at a communication point, SI units per metre of width."""

    time: float
    barrier_force: float
    barrier_velocity: float
    barrier_displacement: float
    anchor_force: float
    wall_time: float
    """Since the first step began [s]."""


def run_coupled(
    archives: Path,
    *,
    step: float,
    end: float | None = None,
    spacing: float = 0.0,
    scheme: str = "gauss-seidel",
    barrier_mass: float | None = None,
    anchor: dict[str, float] | None = None,
) -> list[Row]:
    """Run the three units to `end` [s] with a communication step [s]; what is not given is the scenario's.

    `gauss-seidel` steps the flow first and passes its mean force over the step to the barrier's step over the same
    time, so that the barrier receives just the momentum that the flow lost. `jacobi` steps all units with what the
    others gave at the last communication point, as tools do that step them side by side.
    """
    scenario = scenario_in(archives / "DebrisFlowC.fmu")
    parameters = barrier_parameters(scenario, barrier_mass)
    end = scenario.output.end_time_s if end is None else end
    flow = Unit(archives / "DebrisFlowC.fmu", barrier_motion=2, spacing=spacing)
    barrier = Unit(archives / "BarrierSlidingC.fmu", impact_force_source=2, **parameters)
    tie = Unit(archives / "GroundAnchorC.fmu", **(anchor or {"slack": 1e3}))
    rows = [Row(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)]
    started = perf_counter()
    try:
        for number in range(round(end / step)):
            time = number * step
            if scheme == "gauss-seidel":
                flow["barrier_velocity_input"] = barrier["barrier_velocity"]
                flow.step(time, step)
                _pass_forces(flow, barrier, tie)
                barrier.step(time, step)
                tie["barrier_displacement"] = barrier["barrier_displacement"]
                tie.step(time, step)
            else:
                velocity, displacement = barrier["barrier_velocity"], barrier["barrier_displacement"]
                _pass_forces(flow, barrier, tie)
                flow["barrier_velocity_input"], tie["barrier_displacement"] = velocity, displacement
                for unit in (flow, barrier, tie):
                    unit.step(time, step)
            rows.append(
                Row(
                    time + step,
                    flow["barrier_force"],
                    barrier["barrier_velocity"],
                    barrier["barrier_displacement"],
                    tie["force"],
                    perf_counter() - started,
                )
            )
    finally:
        for unit in (flow, barrier, tie):
            unit.close()
    return rows


def _pass_forces(flow: Unit, barrier: Unit, tie: Unit) -> None:
    barrier["impact_force_input"] = flow["barrier_force"]
    barrier["vertical_load"] = flow["vertical_load"]
    barrier["external_force"] = tie["force"]


class Parser(argparse.ArgumentParser):
    """Refuses with one sentence."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{message}.\n".replace("argument ", ""))


def number(*, above: float = -math.inf, least: float = -math.inf) -> Callable[[str], float]:
    """Reads a number that is finite and within its bound."""
    allowed = f"greater than {above:g}" if above > -math.inf else f"at least {least:g}"

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > above and value >= least):
            raise argparse.ArgumentTypeError(f"{text} is not allowed; it must be a finite number {allowed}")
        return value

    return read


def main() -> None:
    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--step", type=number(above=0.0), default=0.005, help="communication step [s]")
    parser.add_argument("--end", type=number(above=0.0), help="end time [s]; without it the scenario's")
    parser.add_argument(
        "--spacing", type=number(least=0.0), default=0.0, help="grid spacing [m]; 0 takes the scenario's"
    )
    parser.add_argument("--scheme", choices=("gauss-seidel", "jacobi"), default="gauss-seidel")
    stiffness = "stiffness of the anchor [N/m2]; without it there is none"
    parser.add_argument("--stiffness", type=number(least=0.0), help=stiffness)
    parser.add_argument("--yield-force", type=number(above=0.0), default=150e3, help="yield force of the anchor [N/m]")
    given = parser.parse_args()
    if not all((given.archives / f"{name}.fmu").is_file() for name in UNITS):
        parser.error(f"--archives: {given.archives} must hold {', '.join(UNITS)}; python -m fmu build makes them")
    scenario = scenario_in(given.archives / "DebrisFlowC.fmu")
    end = scenario.output.end_time_s if given.end is None else given.end
    if given.step > end:
        parser.error(f"--step: {given.step:g} is not allowed; it must be at most --end, {end:g}")
    try:
        barrier_parameters(scenario)
    except ValueError as error:
        parser.error(str(error).removesuffix("."))
    anchor = {"stiffness": given.stiffness, "yield_force": given.yield_force} if given.stiffness else None
    rows = run_coupled(
        given.archives, step=given.step, end=end, spacing=given.spacing, scheme=given.scheme, anchor=anchor
    )
    print(f"{'time [s]':>9} {'force [kN/m]':>13} {'v2 [m/s]':>9} {'dx [m]':>8} {'anchor [kN/m]':>14}")
    for row in rows[:: max(len(rows) // 24, 1)]:
        print(
            f"{row.time:9.2f} {row.barrier_force / 1e3:13.1f} {row.barrier_velocity:9.3f} "
            f"{row.barrier_displacement:8.3f} {row.anchor_force / 1e3:14.1f}"
        )
    print(f"Final displacement: {rows[-1].barrier_displacement:.3f} m")


if __name__ == "__main__":
    main()
