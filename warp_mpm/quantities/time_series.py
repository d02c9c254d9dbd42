"""Quantities of the time series: what they are called, what they mean, which scenes have them, how they are read.

The order is that of the columns of `timeseries.csv`. Names are a contract with the readers of run folders.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .quantity import ENERGY, FORCE, IMPULSE, MASS, MOMENT, Quantity, Sampled

Reader = Callable[[Any], float]

AXES = "xyz"
"""Of the components of a vector; in the plane there are the first two."""


def barrier(scenario: Any) -> bool:
    """Scenes with a barrier."""
    return scenario.barrier is not None


def sliding(scenario: Any) -> bool:
    """Scenes whose barrier slides."""
    return barrier(scenario) and scenario.barrier.motion.kind == "sliding"


def ground(scenario: Any) -> bool:
    """Scenes with a ground."""
    return scenario.ground is not None


def liquid(scenario: Any) -> bool:
    """Scenes that hold liquid."""
    return scenario.flow.wettest_formulation != "dry"


def two_phases(scenario: Any) -> bool:
    """Scenes whose liquid has a velocity of its own."""
    return scenario.flow.wettest_formulation == "two_phase"


def arriving(scenario: Any) -> bool:
    """Flows that arrive at a section during the run."""
    return scenario.flow.inflow is not None


def ended_barrier(scenario: Any) -> bool:
    """Scenes whose barrier has a base with two ends."""
    return barrier(scenario) and scenario.barrier.shape.kind != "wall"


def pressed_by_liquid(scenario: Any) -> bool:
    """Scenes that tell the liquid's pressure on the face: it is found with a phase of its own, or for friction."""
    return barrier(scenario) and (two_phases(scenario) or (liquid(scenario) and scenario.barrier.friction.face > 0.0))


def _force(surface: str, axis: str) -> Reader:
    place = AXES.index(axis)
    return lambda now: now.forces[surface][place]


def _sum(entry: str) -> Reader:
    return lambda now: now.ledger(entry)


def _left(entry: str) -> Reader:
    return lambda now: now.left(entry)


def _residual(axis: str) -> Reader:
    """Momentum, less its start, gravity's and an inflow's, plus what left and what the flow gave to the bodies."""
    place = AXES.index(axis)

    def read(now: Any) -> float:
        residual = now.ledger(f"momentum_{axis}") - now.initial_momentum[place]
        if axis != "z":  # along which neither gravity acts nor anything arrives
            residual -= now.balance(f"gravity_impulse_{axis}")
            residual -= now.inflow(f"momentum_{axis}")
        residual += now.left(f"momentum_{axis}")
        return residual + sum(now.impulses[place :: len(now.initial_momentum)])

    return read


def force_of_surface(surface: str, axis: str) -> Sampled:
    """Force on the surface of a body that a script adds: `NAME_force_x`, `NAME_force_y`."""
    meaning = f"force of the flow on {surface} along {axis}; mean over the interval"
    words = f"force on {surface} along {axis}"
    name = f"{surface}_force_{axis}"
    return Sampled(name, FORCE, meaning, words, read=_force(surface, axis), of_points=False, mean=True)


@dataclass(frozen=True)
class OfFurther:
    """What is told of each further barrier beside its forces: a column `NAME_barrier_work`, and so on."""

    unit: str
    meaning: str
    """With {name} for the barrier's name."""
    words: str
    read: Callable[[Any, str], float]
    """From a `Now`, of the barrier of that name."""
    there: Callable[[Any, Any], bool] = lambda scenario, one: True
    """Whether a scenario tells it of one of its further barriers."""
    of_loads: bool = False
    mean: bool = False


def _moves(scenario: Any, one: Any) -> bool:
    return bool(one.motion.kind != "fixed")


def _tells_liquid(scenario: Any, one: Any) -> bool:
    return two_phases(scenario) or (liquid(scenario) and one.friction.face > 0.0)


FURTHER: Mapping[str, OfFurther] = {
    "barrier_displacement": OfFurther(
        "m", "displacement of the barrier {name} along x", "displacement of {name}",
        lambda now, name: now.further[name].displacement, _moves,
    ),
    "barrier_velocity": OfFurther(
        "m/s", "velocity of the barrier {name} along x", "velocity of {name}",
        lambda now, name: now.further[name].velocity, _moves,
    ),
    "barrier_work": OfFurther(
        ENERGY, "work done by the flow on the barrier {name} since t = 0", "work done on {name}",
        lambda now, name: now.further[name].work, _moves,
    ),
    "face_force_height": OfFurther(
        "m", "impact_force_height of the barrier {name}, above its base", "height of the force on the face of {name}",
        lambda now, name: now.loads_on[name].height_of(f"{name}_face", now.forces[f"{name}_face"][0]), of_loads=True,
    ),
    "toe_moment": OfFurther(
        MOMENT, "toe_moment of the barrier {name}, about its toe", "moment on {name} about its toe",
        lambda now, name: now.loads_on[name].toe_moment, of_loads=True, mean=True,
    ),
    "heel_moment": OfFurther(
        MOMENT, "heel_moment of the barrier {name}, about its heel", "moment on {name} about its heel",
        lambda now, name: now.loads_on[name].heel_moment(now.forces[name]),
        lambda scenario, one: bool(one.shape.kind != "wall"), of_loads=True, mean=True,
    ),
    "face_pore_pressure_patch": OfFurther(
        "Pa", "pore_pressure_patch of the barrier {name}", "pore pressure on a patch of the face of {name}",
        lambda now, name: now.loads_on[name].pore_pressure_patch.pressure, _tells_liquid, of_loads=True,
    ),
    "face_pore_pressure_patch_height": OfFurther(
        "m", "pore_pressure_patch_height of the barrier {name}, above its base",
        "height of the patch of greatest pore pressure on {name}",
        lambda now, name: now.loads_on[name].pore_pressure_patch.height, _tells_liquid, of_loads=True,
    ),
    "face_pressure_patch": OfFurther(
        "Pa", "pressure_patch of the barrier {name}", "pressure on a patch of the face of {name}",
        lambda now, name: now.loads_on[name].pressure_patch.pressure, of_loads=True,
    ),
    "face_pressure_patch_height": OfFurther(
        "m", "pressure_patch_height of the barrier {name}, above its base",
        "height of the patch of greatest pressure on {name}",
        lambda now, name: now.loads_on[name].pressure_patch.height, of_loads=True,
    ),
    "face_run_up": OfFurther(
        "m", "run_up of the barrier {name}, above its base", "run-up on {name}",
        lambda now, name: now.loads_on[name].run_up, of_loads=True,
    ),
}  # fmt: skip
"""By the end of the column's name."""


def of_further_barrier(name: str, what: str) -> Sampled:
    """A row of `FURTHER` of the barrier `name`."""
    row = FURTHER[what]
    meaning, words = (text.format(name=name) for text in (row.meaning, row.words))
    return Sampled(
        f"{name}_{what}", row.unit, meaning, words, read=lambda now: row.read(now, name),
        of_points=False, of_loads=row.of_loads, mean=row.mean,
    )  # fmt: skip


def further_quantities(scenario: Any) -> dict[str, Sampled]:
    """What a scene tells of its further barriers, by key: force on the whole of each, where it acts, and how it
    moves."""
    found: dict[str, Sampled] = {}
    for one in getattr(scenario, "barriers", ()):
        rows = [force_of_surface(one.name, axis) for axis in "xy"]
        rows += [of_further_barrier(one.name, what) for what, row in FURTHER.items() if row.there(scenario, one)]
        found |= {row.key: row for row in rows}
    return found


OF_BARRIER: Mapping[str, str] = {
    "impact_force_x": "face_force_x",
    "impact_force_y": "face_force_y",
    "top_force": "top_force_x",
    "top_force_y": "top_force_y",
    "back_force_x": "back_force_x",
    "back_force_y": "back_force_y",
    "impact_force_height": "face_force_height",
    "toe_moment": "toe_moment",
    "heel_moment": "heel_moment",
    "pressure_patch": "face_pressure_patch",
    "pressure_patch_height": "face_pressure_patch_height",
    "pore_pressure_patch": "face_pore_pressure_patch",
    "pore_pressure_patch_height": "face_pore_pressure_patch_height",
    "run_up": "face_run_up",
    "barrier_velocity": "barrier_velocity",
    "barrier_displacement": "barrier_displacement",
    "barrier_work": "barrier_work",
}
"""Columns of the first barrier, and how those of a further one end that tell the same."""


def columns_of_further(name: str) -> set[str]:
    """All columns that a time series can have of the further barrier `name`."""
    ends = {*FURTHER, *OF_BARRIER.values(), "force_x", "force_y"}
    return {f"{name}_{end}" for end in ends}


def series_of_barrier(series: Mapping[str, Any], name: str) -> dict[str, Any]:
    """What a time series tells of one of a scene's barriers, by the names of the columns of the first one."""
    if name == "barrier":
        return dict(series)
    columns = {"time": "time"} | {first: f"{name}_{end}" for first, end in OF_BARRIER.items()}
    return {first: series[column] for first, column in columns.items() if column in series}


_ROWS = (
    Sampled(
        "time", "s", "simulated time at the end of the interval",
        read=lambda now: now.time, of_points=False,
    ),
    Sampled(
        "impact_force_x", FORCE,
        "force of the flow on the impacted face, F_2x; mean over the interval; + pushes downstream",
        "horizontal impact force", "F₂,x", read=_force("impact", "x"), there=barrier, of_points=False, mean=True,
    ),
    Sampled(
        "impact_force_y", FORCE,
        "force of the flow on the impacted face along y, F_2y; mean over the interval; + lifts the barrier",
        "vertical impact force", "F₂,y", read=_force("impact", "y"), there=barrier, of_points=False, mean=True,
    ),
    Sampled(  # the crest is level, so its force along x is the paper's F_3
        "top_force", FORCE, "force of the flow on the crest along x, F_3; mean over the interval",
        "friction on the crest", "F₃", key="top_force_x",
        read=_force("top", "x"), there=barrier, of_points=False, mean=True,
    ),
    Sampled(
        "top_force_y", FORCE, "force of the flow on the crest along y; mean over the interval; - presses on the crest",
        "vertical force on the crest", read=_force("top", "y"), there=barrier, of_points=False, mean=True,
    ),
    Sampled(
        "back_force_x", FORCE, "force of the flow on the downstream side along x; mean over the interval",
        "horizontal force on the downstream side",
        read=_force("back", "x"), there=barrier, of_points=False, mean=True,
    ),
    Sampled(
        "back_force_y", FORCE, "force of the flow on the downstream side along y; mean over the interval",
        "vertical force on the downstream side",
        read=_force("back", "y"), there=barrier, of_points=False, mean=True,
    ),
    Sampled(
        "ground_force_x", FORCE, "force of the flow on the ground along x, F_1; mean over the interval",
        "friction on the ground", "F₁", read=_force("ground", "x"), there=ground, of_points=False, mean=True,
    ),
    Sampled(
        "ground_force_y", FORCE,
        "force of the flow on the ground along y; mean over the interval; - presses on the ground",
        "vertical force on the ground",
        read=_force("ground", "y"), there=ground, of_points=False, mean=True,
    ),
    Sampled(
        "base_force", FORCE,
        "friction of the base soil on the barrier, F_4; mean over the interval; + resists sliding",
        "friction at the base", "F₄", read=lambda now: now.base_force, there=sliding, of_points=False, mean=True,
    ),
    Sampled(
        "base_normal_force", FORCE, "force with which the barrier presses on its base; mean over the interval",
        "normal force at the base", read=lambda now: now.base_normal_force, there=sliding, of_points=False, mean=True,
    ),
    Sampled(
        "impact_force_height", "m",
        "height above the barrier's base at which the horizontal force on the impacted face acts; of the mean over the "
        "interval; 0 without force",
        "height of the impact force", "h_F", there=barrier, of_points=False, of_loads=True,
        read=lambda now: now.loads.height_of("impact", now.forces["impact"][0]),
    ),
    Sampled(
        "toe_moment", MOMENT,
        "moment of the flow on the whole barrier about its toe; mean over the interval; + turns it downstream",
        "moment about the toe", "M_toe", read=lambda now: now.loads.toe_moment, there=barrier,
        of_points=False, of_loads=True, mean=True,
    ),
    Sampled(
        "heel_moment", MOMENT,
        "moment of the flow on the whole barrier about its heel; mean over the interval; + overturns it",
        "moment about the heel", "M_heel", there=ended_barrier, of_points=False, of_loads=True, mean=True,
        read=lambda now: now.loads.heel_moment(now.forces["barrier"]),
    ),
    Sampled(
        "pressure_patch", "Pa",
        "greatest mean of the total normal pressure over output.pressure_patch_m of the impacted face and the last "
        "output.pressure_patch_s, or the interval where that is longer; on an inclined face each piece of a cell's "
        "length first gives half of its load to its neighbours",
        "pressure on a patch of the face", "p", read=lambda now: now.loads.pressure_patch.pressure,
        there=barrier, of_points=False, of_loads=True,
    ),
    Sampled(
        "pressure_patch_height", "m",
        "height above the barrier's base of the middle of the patch of greatest pressure; 0 without pressure",
        "height of the patch of greatest pressure", read=lambda now: now.loads.pressure_patch.height,
        there=barrier, of_points=False, of_loads=True,
    ),
    Sampled(
        "pore_pressure_patch", "Pa",
        "greatest mean of the liquid's pressure over output.pressure_patch_m of the impacted face and the last "
        "output.pressure_patch_s, or the interval where that is longer; on an inclined face shared as pressure_patch "
        "is",
        "pore pressure on a patch of the face", "p_L",
        read=lambda now: now.loads.pore_pressure_patch.pressure,
        there=pressed_by_liquid, of_points=False, of_loads=True,
    ),
    Sampled(
        "pore_pressure_patch_height", "m",
        "height above the barrier's base of the middle of the patch of greatest pore pressure; 0 without pressure",
        "height of the patch of greatest pore pressure",
        read=lambda now: now.loads.pore_pressure_patch.height,
        there=pressed_by_liquid, of_points=False, of_loads=True,
    ),
    Sampled(
        "run_up", "m",
        "height above the barrier's base up to which the flow presses on the impacted face with a tenth at least of "
        "rho g h, h its depth at the start; of the mean over the last output.pressure_patch_s",
        "run-up on the face", "h_r", read=lambda now: now.loads.run_up, there=barrier, of_points=False,
        of_loads=True,
    ),
    Sampled(
        "barrier_velocity", "m/s", "velocity of the barrier along x, v_2", "barrier velocity", "v₂",
        read=lambda now: now.barrier.velocity, there=barrier, of_points=False,
    ),
    Sampled(
        "barrier_displacement", "m", "displacement of the barrier along x, Δx", "barrier displacement", "Δx",
        read=lambda now: now.barrier.displacement, there=barrier, of_points=False,
    ),
    Sampled(
        "flow_kinetic_energy", ENERGY, "kinetic energy of both phases of the flow, E_k1",
        "kinetic energy of the flow", "Eₖ₁", read=_sum("kinetic"),
    ),
    Sampled(
        "flow_gravitational_energy", ENERGY, "potential energy of the flow, zero at the origin",
        "potential energy of the flow", read=_sum("gravitational"),
    ),
    Sampled(
        "flow_elastic_energy", ENERGY, "elastic energy of the skeleton and the liquid",
        "elastic energy of the flow", read=_sum("elastic"),
    ),
    Sampled(
        # Liquid is carried at the skeleton's points, so that its own fall through the voids is in no potential energy.
        "seepage_work", ENERGY,
        "work of gravity since t = 0 on liquid that moves through the skeleton, whose place in the potential energy is "
        "the skeleton's",
        "work of gravity on seepage", read=lambda now: now.balance("seepage_work"), there=two_phases, of_points=False,
    ),
    Sampled(
        "barrier_kinetic_energy", ENERGY, "kinetic energy of the barrier, E_k2", "kinetic energy of the barrier", "Eₖ₂",
        read=lambda now: now.barrier.kinetic_energy, there=sliding, of_points=False,
    ),
    Sampled(
        "barrier_work", ENERGY, "work done by the flow on the barrier since t = 0", "work done on the barrier",
        read=lambda now: now.barrier.work, there=barrier, of_points=False,
    ),
    Sampled(
        "base_friction_work", ENERGY, "work that friction at the barrier's base has taken since t = 0",
        "work taken by base friction", read=lambda now: now.barrier.base_work, there=sliding, of_points=False,
    ),
    Sampled(
        # What loads the barrier: upstream of the crest's end and meant over a cell. Where a jet lands behind it, single
        # points meet the ground at water-hammer pressure.
        "pore_pressure_max", "Pa",
        "greatest pore pressure upstream of the crest, meant over a cell, p_L,max, compression positive; it may grow "
        "with each refinement of the grid",
        "greatest pore pressure in a cell", "p_L,max", read=_sum("pressure_mean"), there=liquid,
    ),
    Sampled(
        "pore_pressure_max_anywhere", "Pa",
        "greatest pore pressure of any material point, a landing jet's included",
        "greatest pore pressure of any point", read=_sum("pressure_max"), there=liquid,
    ),
    Sampled(
        "speed_max", "m/s", "greatest speed of any material point, either phase", "greatest speed",
        read=lambda now: math.sqrt(now.ledger("speed_max")),
    ),
    Sampled(
        "solid_mass", MASS, "mass of solid in the domain", "mass of solid", read=_sum("solid_mass"),
    ),
    Sampled(
        "liquid_mass", MASS, "mass of liquid in the domain", "mass of liquid",
        read=_sum("liquid_mass"), there=two_phases,
    ),
    Sampled(
        "momentum_x", IMPULSE, "momentum of the flow along x", "horizontal momentum of the flow",
        read=_sum("momentum_x"),
    ),
    Sampled(
        "momentum_y", IMPULSE, "momentum of the flow along y", "vertical momentum of the flow", read=_sum("momentum_y"),
    ),
    Sampled(
        "momentum_residual_x", IMPULSE, "momentum along x, less its start, less all recorded impulses",
        "horizontal momentum not accounted for", read=_residual("x"),
    ),
    Sampled(
        "momentum_residual_y", IMPULSE, "momentum along y, less its start, less all recorded impulses",
        "vertical momentum not accounted for", read=_residual("y"),
    ),
    Sampled(
        "left_mass", MASS, "mass of both phases that has left the domain since t = 0", "mass that left the domain",
        read=lambda now: now.left("solid_mass") + now.left("liquid_mass"), of_points=False,
    ),
    Sampled(
        "left_momentum_x", IMPULSE, "momentum along x that has left the domain with the mass",
        "horizontal momentum that left the domain", read=_left("momentum_x"), of_points=False,
    ),
    Sampled(
        "left_momentum_y", IMPULSE, "momentum along y that has left the domain with the mass",
        "vertical momentum that left the domain",
        read=_left("momentum_y"), of_points=False,
    ),
    Sampled(
        "left_energy", ENERGY, "kinetic, potential and elastic energy that has left the domain with the mass",
        "energy that left the domain", read=_left("energy"), of_points=False,
    ),
    Sampled(
        "inflow_mass", MASS, "mass of both phases that has arrived at the section of the inflow since t = 0",
        "mass that has arrived", read=lambda now: now.inflow("solid_mass") + now.inflow("liquid_mass"), there=arriving,
        of_points=False,
    ),
    Sampled(
        "inflow_momentum_x", IMPULSE,
        "momentum along x that the inflow has brought since t = 0, with its mass and by its thrust at the section",
        "horizontal momentum that has arrived", read=lambda now: now.inflow("momentum_x"), there=arriving,
        of_points=False,
    ),
    Sampled(
        "inflow_momentum_y", IMPULSE,
        "momentum along y that the inflow has given to the flow since t = 0, through the section",
        "vertical momentum that has arrived", read=lambda now: now.inflow("momentum_y"), there=arriving,
        of_points=False,
    ),
    Sampled(
        "inflow_energy", ENERGY,
        "kinetic and potential energy that the inflow has brought since t = 0, and the work of its thrust",
        "energy that has arrived", read=lambda now: now.inflow("energy"), there=arriving, of_points=False,
    ),
    Sampled(
        "time_step", "s", "time step at the end of the interval", "time step",
        read=lambda now: now.time_step, of_points=False,
    ),
)  # fmt: skip

IN_SPACE: Mapping[str, Sampled] = {
    row.key: row
    for row in (
        force_of_surface("ground", "z"),
        Sampled(
            "momentum_z",
            IMPULSE,
            "momentum of the flow along z",
            "momentum of the flow across",
            read=_sum("momentum_z"),
        ),
        Sampled(
            "momentum_residual_z",
            IMPULSE,
            "momentum along z, less its start, less all recorded impulses",
            "momentum across not accounted for",
            read=_residual("z"),
        ),
        Sampled(
            "left_momentum_z",
            IMPULSE,
            "momentum along z that has left the domain with the mass",
            "momentum across that left the domain",
            read=_left("momentum_z"),
            of_points=False,
        ),
    )
}
"""What there is besides in a simulation of three dimensions."""

TIME_SERIES: Mapping[str, Sampled] = {row.key: row for row in _ROWS}
"""Columns of `timeseries.csv`, by their keys in the simulation's samples."""

NAMED: Mapping[str, Sampled] = {row.name: row for row in _ROWS}
"""The same by their names."""


def quantity_of_column(name: str) -> Quantity | None:
    """Of a column of `timeseries.csv` by its name: of the table, of a script, of a further barrier, or a force on a
    surface of its bodies; None where there is no such column."""
    if name in NAMED:
        return NAMED[name]
    if name in OWN:
        return OWN[name]
    for what in FURTHER:
        if name.endswith(f"_{what}"):
            return of_further_barrier(name.removesuffix(f"_{what}"), what)
    surface, _, axis = name.rpartition("_force_")
    return force_of_surface(surface, axis) if surface and axis in ("x", "y") else None


OWN: dict[str, Sampled] = {}
"""Quantities that a script brought, by their names: see `warp_mpm.quantities.register`."""
