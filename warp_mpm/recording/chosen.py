"""Which quantities of the time series a scene has, and which of them it asks to be recorded."""

from __future__ import annotations

from warp_mpm.quantities import TIME_SERIES
from warp_mpm.scenario import DryFlow, Scenario, Sliding, TwoPhaseFlow

OF_BARRIER = ("impact_force_x", "impact_force_y", "top_force_x", "top_force_y", "back_force_x", "back_force_y",
              "barrier_velocity", "barrier_displacement", "barrier_work")  # fmt: skip
OF_SLIDING = ("base_force", "base_normal_force", "base_friction_work", "barrier_kinetic_energy")
OF_GROUND = ("ground_force_x", "ground_force_y")
OF_LIQUID = ("pore_pressure_max", "pore_pressure_max_anywhere")
OF_TWO_PHASES = ("seepage_work", "liquid_mass")


def quantities_of(scenario: Scenario) -> list[str]:
    """Keys of the quantities that a scene has, in their order, whether they are recorded or not."""
    barrier, flow = scenario.barrier, scenario.flow
    absent = {
        *(OF_BARRIER if barrier is None else ()),
        *(() if barrier is not None and isinstance(barrier.motion, Sliding) else OF_SLIDING),
        *(OF_GROUND if scenario.ground is None else ()),
        *(OF_LIQUID if isinstance(flow, DryFlow) else ()),
        *(() if isinstance(flow, TwoPhaseFlow) else OF_TWO_PHASES),
    }
    return [key for key in TIME_SERIES if key not in absent]


def recorded_quantities(scenario: Scenario) -> list[str]:
    """Keys of those that its time series has: all, or the time and what `output.quantities` names."""
    chosen = scenario.output.quantities
    keys = quantities_of(scenario)
    return keys if chosen is None else [key for key in keys if key == "time" or TIME_SERIES[key].name in chosen]


def left_out(scenario: Scenario) -> set[str]:
    """Names of those that the scene has and `output.quantities` leaves out."""
    recorded = recorded_quantities(scenario)
    return {TIME_SERIES[key].name for key in quantities_of(scenario) if key not in recorded}
