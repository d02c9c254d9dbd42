"""What a DebrisFlow unit and its worker agree on; alone, since the worker needs nothing else of a unit."""

from __future__ import annotations

PROTOCOL = 3
"""Version of the requests and answers; the worker names its own when it starts."""

RECORDED = (
    *("impact_force_x", "impact_force_y", "top_force", "barrier_velocity", "barrier_displacement"),
    *("pore_pressure_max", "flow_kinetic_energy"),
)
"""Outputs that are quantities of the simulator's time series, by their names there; nil where the scene lacks one."""

SURFACE_FORCES = ("impact_force", "top_force", "back_force")
"""Forces on the surfaces of the barrier: names in the simulator's samples, without the axis."""
