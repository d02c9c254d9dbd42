"""A scenario: what the user asks for, in SI units, checked before anything is created.

The layout of the JSON file is the layout of the models below; `python -m warp_mpm schema` prints it as JSON Schema.
Coordinates: the toe of the barrier's upstream face is the origin, the ground is y = 0 or a profile through it, the flow
comes from x < 0 and moves toward +x. All forces, masses and volumes are per metre of width.
"""

from warp_mpm.scenario.barrier import (
    Barrier,
    Fixed,
    FurtherBarrier,
    OutlineShape,
    Prescribed,
    Sliding,
    SurfaceFriction,
    Trapezoid,
    Wall,
)
from warp_mpm.scenario.design import Boulder, Design
from warp_mpm.scenario.flow import DryFlow, Flow, TwoPhaseFlow, UndrainedFlow
from warp_mpm.scenario.flow_outline import Deposit, FlowOnGround, FlowPolygon, FrontAndTail
from warp_mpm.scenario.ground import Ground, Stretch
from warp_mpm.scenario.inflow import Inflow, Surge
from warp_mpm.scenario.material import Skeleton, TwoPhaseMaterial, UndrainedMaterial
from warp_mpm.scenario.scene import Scenario, json_schema
from warp_mpm.scenario.settings import STANDARD_GRAVITY, Domain, Gravity, Numerics, Output

__all__ = [
    "STANDARD_GRAVITY",
    "Barrier",
    "Boulder",
    "Deposit",
    "Design",
    "Domain",
    "DryFlow",
    "Fixed",
    "Flow",
    "FlowOnGround",
    "FlowPolygon",
    "FrontAndTail",
    "FurtherBarrier",
    "Gravity",
    "Ground",
    "Inflow",
    "Numerics",
    "OutlineShape",
    "Output",
    "Prescribed",
    "Scenario",
    "Skeleton",
    "Sliding",
    "Stretch",
    "SurfaceFriction",
    "Surge",
    "Trapezoid",
    "TwoPhaseFlow",
    "TwoPhaseMaterial",
    "UndrainedFlow",
    "UndrainedMaterial",
    "Wall",
    "json_schema",
]
