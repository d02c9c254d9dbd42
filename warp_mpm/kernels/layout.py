"""Types and data structures of the kernels for one set of effects: an absent effect has no field here.

Grid indices: node (i, j) lies at x = origin + (i + 1/2) d, y = bottom + (j + 1/2) d, so that the knots of the quadratic
B-splines, and with them the corners of the cells, fall on multiples of the spacing d. A flat ground, wall or upright
barrier face on such a multiple is then met exactly by mirrored pairs of nodes. Corner (i, j) of the smoothing grid lies
at x = origin + (i + 1) d, y = bottom + (j + 1) d: the upper right corner of the cell around node (i, j).

In space the grid is a stack of such grids, one behind the other: the nodes of layer l, at z = front + (l + 1/2) d, are
the rows l columns to (l + 1) columns - 1 of the same arrays. Whatever goes over nodes alone does not know of it, and
blocks are those of one layer.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from ..effects import Effects
from ..simulator.bodies.kernels import PIECE, body_fields, contact_fields
from ..simulator.laws.dilatancy import CONSTANTS as DILATANCY_CONSTANTS

BLOCK_SHIFT = 3
BLOCK = 1 << BLOCK_SHIFT
"""Nodes along the side of a block, the unit in which the grid is switched on and off."""

# Entries of the clock, a float64 array: time, and what sets its step.
TIME = 0
TARGET = 1
TIME_STEP = 2
SPEED_MAX = 3
"""Greatest square of a speed, of either phase [m2/s2]."""
LARGEST_TIME_STEP = 4
SMALLEST_TIME_STEP = 5
CLOCK_SIZE = 6

# Entries of the balance, a float64 array: what gravity gave to the flow, and the mass on which it acts.
GRAVITY_IMPULSE_X = 0
GRAVITY_IMPULSE_Y = 1
ACTIVE_MASS_SOLID = 2
ACTIVE_MASS_LIQUID = 3
INITIAL_MASS_SOLID = 4
INITIAL_MASS_LIQUID = 5
SEEPAGE_POWER = 6
"""Rate at which gravity works on liquid that moves relative to the skeleton, as it is summed up in a step [W/m]."""
SEEPAGE_POWER_BEFORE = 7
SEEPAGE_WORK = 8
"""Its integral over time, by the trapezoidal rule over the steps [J/m]."""
BALANCE_SIZE = 9

# Entries of the limiters, a float64 array: how often each acted, once per step and point.
GAPS_BOUNDED = 0
"""Times that the gap of a point was cut to the room that its neighbours leave."""
VOIDS_CLOSED = 1
"""Times that a point went into a step with the volume of its grains and no voids."""
LIMITERS_SIZE = 2

FASTEST = 1.0e5
"""Speed [m/s] beyond which a run has diverged, whatever the scene."""

SURROUNDED, BESIDE_CUT = 1, 2
"""`surrounded` of a point whose corners are all filled: the filter draws its pressure toward the average; beside an
outline that cuts cells only by `BESIDE_CUT_SHARE`. Of any other: 0."""

BESIDE_CUT_SHARE = 0.05
"""Of what the filter of the pore pressure takes from a point, where cells are cut. Their points need pressures that
differ, or they would not push on the nodes as the surface does: an average takes that away, the skeleton bears it, and
friction grows by that. What does not push on the nodes at all goes at a twentieth of the rate as well; left alone it
grows with the liquid's stiffness."""

# Where a material point is, an entry of the points' `inside`.
WAITING = -1
"""It has yet to arrive."""
OUTSIDE = 0
"""It has left."""
INSIDE = 1
HELD = 2
"""It approaches the section of an inflow, at its prescribed velocity: the nodes feel it, the records do not."""

# Counters, an int32 array.
STEPS = 0
DIVERGED = 1
LIMIT_WAVE = 2
LIMIT_DRAG = 3
LIMIT_OUTPUT = 4
BARRIER_ITERATIONS = 5
BARRIER_UNCONVERGED = 6
POINTS_LEFT = 7
POINTS_PUSHED = 8
"""Times that a point deeper than half a cell in a solid was set back to that depth."""
LIMIT_LAW = 9
COUNTERS_SIZE = 10

# Whether the loop over steps goes on, an int32 array; no part of the state.
GOES_ON = 0
STEPS_LEFT = 1
"""Steps that the device may make before the host looks up; the host says how many."""
RUNNING_SIZE = 2

# Ledger sums, a float64 array written by the ledger kernel.
LEDGER_KINETIC = 0
LEDGER_GRAVITATIONAL = 1
LEDGER_ELASTIC = 2
LEDGER_MOMENTUM_X = 3
LEDGER_MOMENTUM_Y = 4
LEDGER_PRESSURE_MAX = 5
LEDGER_SOLID_MASS = 6
LEDGER_LIQUID_MASS = 7
LEDGER_SPEED_MAX = 8
LEDGER_PRESSURE_MEAN = 9
"""Greatest pressure upstream of the crest's end, less its noise about the mean over a cell."""
LEDGER_NOT_FINITE = 10
"""Material points of which some quantity is not a finite number."""
LEDGER_MOMENTUM_Z = 11
"""In space."""
LEDGER_SIZE = 12

# What left the domain, a float64 array.
LEFT_SOLID_MASS = 0
LEFT_LIQUID_MASS = 1
LEFT_MOMENTUM_X = 2
LEFT_MOMENTUM_Y = 3
LEFT_ENERGY = 4
LEFT_SIZE = 5
LEFT_MOMENTUM_Z = LEFT_SIZE
"""In space, where the array is longer by one."""

# What has arrived at the section of an inflow, a float64 array.
INFLOW_SOLID_MASS = 0
INFLOW_LIQUID_MASS = 1
INFLOW_MOMENTUM_X = 2
"""With the mass, and by the thrust of what is held upstream of the section."""
INFLOW_MOMENTUM_Y = 3
INFLOW_ENERGY = 4
INFLOW_SIZE = 5

# How far what arrives has come, a float64 array.
CONVEYED_WAY = 0
"""Time integral of the mean velocity [m] at the end of the step."""
CONVEYED_BEFORE = 1
"""The same at its start."""
CONVEYED_SPEED = 2
"""Mean velocity at the end of the step [m/s]."""
CONVEYED_SPEED_BEFORE = 3
CONVEYED_INTERVAL = 4
"""Of the table, in which the time lies."""
CONVEYED_STRETCH = 5
"""Change of the velocity along x at the section, at the end of the step [1/s]."""
CONVEYED_STRETCH_BEFORE = 6
CONVEYED_SIZE = 7

# Entries of a slot of the barrier (`simulator.bodies.loads`): impulses since t = 0 [N s/m].
SLOT_NORMAL = 0
"""Into the barrier: of the solid, of one phase of the mixture."""
SLOT_LIQUID = 1
"""Into the barrier: of the liquid with two phases; with one, what the liquid's pressure carries of the first."""
SLOT_ALONG = 2
"""Along the surface, toward its next slot."""
SLOT_SIZE = 3

# Which material points kernels over the flow go over, an int32 array that the host fills; no part of the state.
FLOW_END = 0
"""Those before this one; what comes later has yet to arrive."""
FLOW_ARRIVING = 1
"""All that has arrived comes before this one."""
FLOW_STEP = 2
"""Each thread takes every so many of them. A processor's one thread takes them all, in a loop of its own: so it fetches
once what it needs for every point, which else is a fifth of a kernel's time."""
FLOW_SIZE = 3

BOOK: dict[str, Any] = {
    "clock": wp.array(dtype=wp.float64),
    "counters": wp.array(dtype=wp.int32),
    "balance": wp.array(dtype=wp.float64),
    "limiters": wp.array(dtype=wp.float64),
    "reactions": wp.array(dtype=wp.float64),
    "left": wp.array(dtype=wp.float64),
    "sums": wp.array(dtype=wp.float64),
    "flow": wp.array(dtype=wp.int32),
}
"""What is kept account of, in one structure. Of a kernel that takes an array by itself, Warp compiles a second version
for an array with gaps, which is never called; that is a third of the compiler's time. Only `update` needs it so: the
first version is the one that becomes vector instructions."""


def _structure(name: str, fields: dict[str, Any]) -> Any:
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


@cache
def layout(effects: Effects) -> SimpleNamespace:
    """Scalar, vector and structure types for `effects`.

    `V` is the vector of all velocities at a place: (v_x, v_y) with one phase, (v_Sx, v_Sy, v_Lx, v_Ly) with two. `X` is
    a place, `T` a symmetric tensor, `G` a velocity gradient and `R` what acts along a surface: see `vectors`.
    """
    scalar = wp.float64 if effects.precision == "float64" else wp.float32
    dimensions = effects.dimensions
    components = (2 if effects.two_phase else 1) * dimensions
    V2 = wp.types.vector(2, scalar)
    V3 = wp.types.vector(3, scalar)
    V4 = wp.types.vector(4, scalar)
    V = wp.types.vector(components, scalar)
    X = wp.types.vector(dimensions, scalar)
    X64 = wp.types.vector(dimensions, wp.float64)
    T = wp.types.vector(4 if dimensions == 2 else 6, scalar)
    G = wp.types.vector(dimensions**2, scalar)
    R = scalar if dimensions == 2 else X
    # Corner sums: volume, and volume times: solid's divergence, excess pressure, its residual, liquid's divergence.
    S = wp.types.vector({"dry": 2, "undrained": 4, "two_phase": 5}[effects.formulation], scalar)
    P = wp.types.vector(PIECE, scalar)
    W = wp.types.vector(3**dimensions, scalar)  # of the nodes around a place of contact
    array = wp.array
    types = SimpleNamespace(
        effects=effects, scalar=scalar, V2=V2, V3=V3, V4=V4, V=V, S=S, P=P, W=W, components=components
    )
    types.partly_dry = effects.partly_dry
    types.dimensions, types.X, types.X64, types.T, types.G, types.R = dimensions, X, X64, T, G, R

    points: dict[str, Any] = {
        "position": array(dtype=X),
        "velocity": array(dtype=V),
        "stress": array(dtype=T),
        "reference_volume": array(dtype=scalar),
        "volume": array(dtype=scalar),
        "deviatoric_strain": array(dtype=scalar),
        "gradient": array(dtype=G),
        "inside": array(dtype=wp.int32),
    }
    if any(law.opens for law in effects.laws):
        points["solid_gap"] = array(dtype=scalar)
    if any(law.extra_stress for law in effects.laws):
        points["extra_stress"] = array(dtype=T)
    if effects.liquid:
        points["liquid_strain"] = array(dtype=scalar)
    if effects.smoothing_grid:
        points["smooth"] = array(dtype=S)  # the corners' averages at the point
    if effects.density_correction:
        points["crowding"] = array(dtype=scalar)  # volume over room, less 1: a mean over the last unit of shear strain
    if effects.pressure_relaxation:
        points["pressure_residual"] = array(dtype=scalar)
        points["surrounded"] = array(dtype=wp.int32)  # whether the filter acts: SURROUNDED, BESIDE_CUT or 0
    if effects.bulk_viscosity:
        points["viscous_pressure"] = array(dtype=scalar)
    if effects.two_phase and not effects.volumetric_smoothing:
        points["liquid_divergence"] = array(dtype=scalar)

    if effects.arriving:
        points["pace"] = array(dtype=scalar)  # velocity of what arrives over its mean over the depth

    points |= {name: array(dtype=getattr(types, field.kind)) for name, field in effects.point_fields.items()}

    grid: dict[str, Any] = {
        "mass": array(dtype=scalar, ndim=2),  # of the solid; of the mixture where both phases move as one [kg/m]
        "velocity": array(dtype=V, ndim=2),  # `scatter` leaves the momentum here, `move` divides it by the mass
        "shift": array(dtype=wp.float64),  # of the grid along x since the start: now, and at the end of the step [m]
        "block": array(dtype=wp.int32, ndim=2),
        "active": array(dtype=wp.int32),
        "active_count": array(dtype=wp.int32),
    }
    told = effects.told_to_nodes
    types.told = {name: place for place, name in enumerate(told)}
    types.M = wp.types.vector(max(len(told), 1), scalar)
    if told:
        # By how much each is more than it would be, were all of the flow's material: its points need not tell it.
        grid["told"] = array(dtype=types.M, ndim=2)
        grid["telling"] = array(dtype=wp.int32, ndim=2)  # 1 of the blocks in which somebody ever did
        if effects.unlike_porosity:
            # Impulse of the pressure in the step: all of it, and the liquid's share by each point's own porosity.
            grid["pore_impulse"] = array(dtype=V, ndim=2)
        if effects.liquid_alone and not effects.two_phase:
            grid["filling_gain"] = array(dtype=X, ndim=2)  # what the liquid alone gains in the step, times its ratio
    if effects.porosity_update and "drag" not in told:
        grid["drag"] = array(dtype=scalar, ndim=2)  # drag coefficient over its value at the start, times mass
        if effects.inertial_drag and effects.conductivity != "constant":
            grid["drag_beyond"] = array(dtype=scalar, ndim=2)  # the same of the drag with the square of the slip
    if effects.liquid_alone:
        # Velocity that the liquid would have alone. Undrained, `scatter` leaves here by how much the liquid's momentum
        # would exceed the mixture's; with two phases `move` alone writes it. Contact reads nodes without mass too:
        # `clear` empties them.
        grid["liquid_alone"] = array(dtype=X, ndim=2)
    if effects.smoothing_grid:
        grid["corner"] = array(dtype=S, ndim=2)
    if effects.bodies and not effects.passing:
        grid["solid"] = array(dtype=wp.int32, ndim=2)  # what a point in the cell may be near
    if effects.smoothing_grid and effects.partly_dry:
        grid["corner_wet"] = array(dtype=scalar, ndim=2)  # volume of what is dry; then of what is wet, over the room
    if effects.smoothing_grid:
        grid["corner_room"] = array(dtype=scalar, ndim=2)  # 1 / volume around each corner that is open to flow
    if effects.density_correction:
        # The same with half a cell more in front of an inclined face, where points come to rest.
        grid["corner_space"] = array(dtype=scalar, ndim=2)

    grid |= {name: array(dtype=getattr(types, kind), ndim=2) for name, kind in effects.scheme.grid_fields.items()}

    parameters: dict[str, Any] = {
        "spacing": scalar,
        "inverse_spacing": scalar,
        "left": scalar,
        "bottom": scalar,
        "columns": wp.int32,
        "rows": wp.int32,
        "block_rows": wp.int32,
        "workers": wp.int32,  # threads that share the blocks in use
        "gravity": X,
        "solid_density": scalar,  # per volume of mixture: (1 - n) rho_S; undrained: rho_m
        "lame": scalar,
        "shear_modulus": scalar,
        "bulk_modulus": scalar,
        "grain_share": scalar,  # volume of the grains over that of the whole, initially: 1 - n
        "wave_speed": wp.float64,
        "courant_number": wp.float64,
        "largest_stable_step": wp.float64,
        "largest_stable_step_counter": wp.int32,  # which of the counters LIMIT_... tells how often it ruled
    }
    if dimensions == 3:
        parameters |= {"front": scalar, "layers": wp.int32, "layer": wp.int32}  # z [m]; layers, and nodes of each
    of_laws = [name for law in effects.laws for name in law.constants]
    parameters |= dict.fromkeys((*of_laws, *effects.scheme.constants), scalar)
    if effects.dilatancy:
        parameters |= dict.fromkeys(DILATANCY_CONSTANTS, scalar)
    if effects.density_correction:
        parameters["density_correction"] = scalar  # share of the crowding undone per unit of shear strain
    if effects.bulk_viscosity:
        parameters["bulk_viscosity"] = scalar  # pressure per rate of compression [Pa s]
    if effects.liquid:
        for name in (
            "porosity",
            "true_liquid_density",
            "filling_ratio",  # mass of liquid that would fill the whole volume, over that of the solid
            "liquid_bulk_modulus",
            "cavitation_pressure",
            "relaxation_rate",
        ):
            parameters[name] = scalar
    if effects.liquid and effects.bodies:
        parameters["crest_end"] = wp.float64  # x of the downstream end of a crest at t = 0; far away: there is none
        parameters["crest_body"] = wp.int32  # whose crest
    if effects.two_phase:
        parameters["liquid_density"] = scalar  # per volume of mixture: n rho_L
        parameters["drag_rate"] = scalar  # 1 / relaxation time of v_L - v_S
        parameters["liquid_ratio"] = scalar  # mass of liquid over that of the solid
        if effects.inertial_drag:
            parameters["inertial_drag_rate"] = scalar  # the same per speed of the slip, of the drag with its square
        if effects.conductivity == "exponential":
            parameters["conductivity_scale"] = scalar  # change of the porosity for a factor of e
        parameters["drag_per_mass"] = scalar  # Q = n^2 rho_L g / k_sat, per mass of the solid in a volume
        if effects.materials and effects.inertial_drag:
            parameters["inertial_drag_per_mass"] = scalar  # the same of the drag with the square of the slip
    if told:
        parameters["excess"] = types.M  # what a point of the material tells the nodes, per mass of its solid
        parameters["tells"] = wp.int32  # 1: it is not nil
        if effects.two_phase:
            parameters["solid_share"] = scalar  # mass of the solid over that of the whole
    bodies = body_fields(effects, scalar, V2, V4, P)
    contact = contact_fields(effects, scalar, X, V3, W, R) if effects.bodies else {}

    arrival: dict[str, Any] = {}
    if effects.arriving:
        arrival = {
            "times": array(dtype=wp.float64),
            "velocities": array(dtype=wp.float64),
            "ways": array(dtype=wp.float64),
            "stretches": array(dtype=wp.float64),
            "conveyed": array(dtype=wp.float64),
            "inflow": array(dtype=wp.float64),
            "section": wp.float64,  # x [m]
            "base": wp.float64,  # y of the underside at the section [m]
            "slope": wp.float64,  # dy/dx of the ground beneath the approach
            "entry": wp.float64,  # x of the upstream end of the approach [m]
            "fastest": wp.float64,  # greatest velocity of the table, at any height [m/s]
        }
        types.Arrival = _structure("Arrival", arrival)
    types.Parameters = _structure("Parameters", parameters)
    types.Points = _structure("Points", points)
    types.Grid = _structure("Grid", grid)
    types.Bodies = _structure("Bodies", bodies)
    types.Contact = _structure("Contact", contact)
    types.Book = _structure("Book", BOOK)
    types.point_fields, types.grid_fields, types.parameter_fields = points, grid, parameters
    types.body_fields, types.contact_fields, types.arrival_fields = bodies, contact, arrival
    return types
