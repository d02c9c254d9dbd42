"""An energy account over a coupled system: where the work of the flow on the barrier goes.

    python -m fmu build --only DebrisFlowC --only BarrierSlidingC --only GroundAnchorC
    python docs/cosimulation/energy_account.py

Flow, barrier and anchor are coupled as in coupled.py (Gauss-Seidel). Forces are constant over a step, so their work
over it is force times way, exactly: the account must close to rounding, and tells a coupling that passes on the wrong
force.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from warp_mpm_fmu.instance import instance_of
from warp_mpm_fmu.system import barrier_parameters, scenario_in


@dataclass
class Account:
    """Energies per metre of width [J/m] at the end of a run."""

    flow_work: float = 0.0
    """Of the flow on the barrier."""
    barrier: float = 0.0
    """Kinetic energy of the barrier."""
    base: float = 0.0
    """Taken by friction at the barrier's base."""
    anchor: float = 0.0
    """Taken by the anchor, stored or spent."""
    flow_lost: float = 0.0
    """Kinetic energy that the flow has lost, on the barrier and within itself."""

    @property
    def left_over(self) -> float:
        """What is not accounted for."""
        return self.flow_work - self.barrier - self.base - self.anchor


def run(
    archives: Path, *, step: float = 0.01, end: float = 2.0, spacing: float = 0.0, yield_force: float = 150e3
) -> Account:
    """Run the system and keep the account.

    Args:
        archives: folder with the units.
        step, end: communication step and end [s].
        spacing: of the simulator's grid [m]; 0 takes the scenario's.
        yield_force: of the anchor [N/m].
    """
    parameters = barrier_parameters(scenario_in(archives / "DebrisFlowC.fmu"))
    weight = parameters["barrier_mass"] * parameters["gravity"]
    account = Account()
    with (
        instance_of(archives / "DebrisFlowC.fmu") as flow,
        instance_of(archives / "BarrierSlidingC.fmu") as barrier,
        instance_of(archives / "GroundAnchorC.fmu") as anchor,
    ):
        flow.initialize(barrier_motion=2, spacing=spacing)
        barrier.initialize(impact_force_source=2, **parameters)
        anchor.initialize(stiffness=1e5, yield_force=yield_force)
        first, place = flow["flow_kinetic_energy"], 0.0
        for _ in range(round(end / step)):
            flow["barrier_velocity_input"] = barrier["barrier_velocity"]
            flow.step(step)
            push, load, pull = flow["barrier_force"], flow["vertical_load"], anchor["force"]
            barrier["impact_force_input"], barrier["vertical_load"], barrier["external_force"] = push, load, pull
            barrier.step(step)
            way, place = barrier["barrier_displacement"] - place, barrier["barrier_displacement"]
            account.flow_work += push * way
            account.anchor -= pull * way
            account.base += parameters["base_friction"] * max(weight + load, 0.0) * abs(way)
            anchor["barrier_displacement"] = place
            anchor.step(step)
        account.barrier = barrier["barrier_kinetic_energy"]
        account.flow_lost = first - flow["flow_kinetic_energy"]
    return account


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--spacing", type=float, default=0.0, help="grid spacing [m]; 0 takes the scenario's")
    parser.add_argument("--end", type=float, default=2.0, help="end time [s]")
    given = parser.parse_args()
    account = run(given.archives, spacing=given.spacing, end=given.end)
    for name, value in (
        ("Kinetic energy lost by the flow", account.flow_lost),
        ("Work of the flow on the barrier", account.flow_work),
        ("  kinetic energy of the barrier", account.barrier),
        ("  friction at its base", account.base),
        ("  anchor", account.anchor),
        ("  not accounted for", account.left_over),
    ):
        print(f"{name:34} {value / 1e3:12.3f} kJ/m")


if __name__ == "__main__":
    main()
