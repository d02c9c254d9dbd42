"""Names, units and meanings of everything that a run records. They are a contract with the readers of run folders."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One recorded quantity, SI, per metre of width where it is extensive."""

    name: str
    unit: str
    meaning: str

    @property
    def label(self) -> str:
        """Name with unit, as in the header of a column: `impact_force_x [N/m]`."""
        return f"{self.name} [{self.unit}]"


_SHORT_NAMES = {"top_force_x": "top_force"}  # the crest is level, so its force along x is the paper's F_3


def _registry(*rows: tuple[str, str, str]) -> dict[str, Quantity]:
    return {name: Quantity(_SHORT_NAMES.get(name, name), unit, meaning) for name, unit, meaning in rows}


TIME_SERIES = _registry(
    ("time", "s", "simulated time at the end of the interval"),
    (
        "impact_force_x",
        "N/m",
        "force of the flow on the impacted face, F_2x; mean over the interval; + pushes downstream",
    ),
    ("impact_force_y", "N/m", "the same along y, F_2y; + lifts the barrier"),
    ("top_force_x", "N/m", "force of the flow on the crest along x, F_3; mean over the interval"),
    ("top_force_y", "N/m", "the same along y; - presses on the crest"),
    ("back_force_x", "N/m", "force of the flow on the downstream side along x; mean over the interval"),
    ("back_force_y", "N/m", "the same along y"),
    ("ground_force_x", "N/m", "force of the flow on the ground along x, F_1; mean over the interval"),
    ("ground_force_y", "N/m", "the same along y; - presses on the ground"),
    ("base_force", "N/m", "friction of the base soil on the barrier, F_4; mean over the interval; + resists sliding"),
    ("base_normal_force", "N/m", "force with which the barrier presses on its base; mean over the interval"),
    ("barrier_velocity", "m/s", "velocity of the barrier along x, v_2"),
    ("barrier_displacement", "m", "displacement of the barrier along x, Δx"),
    ("flow_kinetic_energy", "J/m", "kinetic energy of both phases of the flow, E_k1"),
    ("flow_gravitational_energy", "J/m", "potential energy of the flow, zero at the origin"),
    ("flow_elastic_energy", "J/m", "elastic energy of the skeleton and the liquid"),
    (
        "seepage_work",
        "J/m",
        "work of gravity since t = 0 on liquid that moves through the skeleton, whose place in the potential energy is "
        "the skeleton's",
    ),
    ("barrier_kinetic_energy", "J/m", "kinetic energy of the barrier, E_k2"),
    ("barrier_work", "J/m", "work done by the flow on the barrier since t = 0"),
    ("base_friction_work", "J/m", "work that friction at the barrier's base has taken since t = 0"),
    (
        "pore_pressure_max",
        "Pa",
        "greatest pore pressure upstream of the crest, meant over a cell, p_L,max, compression positive",
    ),
    ("pore_pressure_max_anywhere", "Pa", "greatest pore pressure of any material point, a landing jet's included"),
    ("speed_max", "m/s", "greatest speed of any material point, either phase"),
    ("solid_mass", "kg/m", "mass of solid in the domain"),
    ("liquid_mass", "kg/m", "mass of liquid in the domain"),
    ("momentum_x", "N s/m", "momentum of the flow along x"),
    ("momentum_y", "N s/m", "the same along y"),
    ("momentum_residual_x", "N s/m", "momentum along x, less its start, less all recorded impulses"),
    ("momentum_residual_y", "N s/m", "the same along y"),
    ("left_mass", "kg/m", "mass of both phases that has left the domain since t = 0"),
    ("left_momentum_x", "N s/m", "momentum along x that has left the domain with it"),
    ("left_momentum_y", "N s/m", "the same along y"),
    ("left_energy", "J/m", "kinetic, potential and elastic energy that has left the domain with it"),
    ("time_step", "s", "time step at the end of the interval"),
)
"""Columns of `timeseries.csv`, by their keys in the simulation's samples."""

POINT_FIELDS = _registry(
    ("solid_velocity", "m/s", "velocity of the solid, v_S"),
    ("liquid_velocity", "m/s", "velocity of the liquid, v_L"),
    ("effective_stress", "Pa", "effective stress σ', tension positive; components xx, yy, zz, xy, yz, xz"),
    ("pore_pressure", "Pa", "pore pressure p_L, compression positive"),
    ("porosity", "-", "volume of the voids over the total volume, n"),
    ("deviatoric_strain", "-", "cumulative deviatoric strain, ε_d"),
    ("volume", "m3/m", "volume of the material point"),
    ("solid_mass", "kg/m", "mass of solid of the material point"),
    ("liquid_mass", "kg/m", "mass of liquid of the material point"),
)
"""Point arrays of a snapshot, beside the positions."""


def time_series_quantity(key: str) -> Quantity | None:
    """Of a column of `timeseries.csv`, by its key in the samples or its name; None where there is no such column.

    Beside those of `TIME_SERIES`, forces on the surfaces of bodies that a script adds: `NAME_force_x`, `NAME_force_y`.
    """
    if key in TIME_SERIES:
        return TIME_SERIES[key]
    surface, _, axis = key.rpartition("_force_")
    if surface and axis in ("x", "y"):
        return Quantity(key, "N/m", f"force of the flow on {surface} along {axis}; mean over the interval")
    return None


def check_known(names: set[str], registry: dict[str, Quantity]) -> None:
    """Refuse a quantity that has no entry here, since its unit would go unsaid.

    Raises:
        KeyError: a name is not registered.
    """
    unknown = sorted(names - registry.keys())
    if unknown:
        raise KeyError(f"No unit is registered for {', '.join(unknown)}; add it to warp_mpm/quantities.py.")
