"""Key figures of a run, as in `summary.json`: what they are called, how they are taken, what they need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from analytic.force_record import END_SHARE, FILTER_WINDOW, RESIDUAL_SHARE, SETTLED_SHARE, START_SHARE

from .quantity import FORCE, IMPULSE, MOMENT, VOLUME, Quantity


@dataclass(frozen=True)
class Figure(Quantity):
    """A number that sums up a run."""

    needs: tuple[str, ...] = ()
    """Names of the columns of the time series without which it is not known."""
    short: str = ""
    """For the heading of a column of a table; empty: the symbol, or the words."""
    number: bool = True
    """Whether it is one, and no word, table, or yes or no."""

    @property
    def column(self) -> str:
        """Heading of a column of a table: short, with the unit in which people read it."""
        return f"{self.short or self.symbol or self.words} [{self.shown_unit}]"


ON_FACE = ("impact_force_x",)


def _time(of: str, when: str) -> Figure:
    """The time of a greatest value."""
    return Figure(f"{of}_time", "s", f"time of {of}: {when}")


_MIDDLE = f"middle of the {FILTER_WINDOW:g} s that the moving mean is taken over, as far as the record reaches"
_PATCH_END = "end of the time over which it is a mean"

PATCH = (
    "output.pressure_patch_m of the face and output.pressure_patch_s (0.5 m and 20 ms unless given), or over a cell "
    "and an interval of the time series where these are greater; on an inclined face each piece of a cell's length "
    "first gives half of its load to its neighbours"
)

_ROWS = (
    Figure("end_time", "s", "simulated time at which the run ended"),
    Figure("status", "-", "finished; or stopped or failed, before its end time", number=False),
    Figure("material_points", "-", "number of material points, with those that arrive later"),
    Figure("steps", "-", "number of time steps"),
    Figure("time_step_min", "s", "smallest time step, those that land on a record or on the end included"),
    Figure("time_step_max", "s", "greatest time step"),
    Figure(
        "time_step_limit", "-",
        "what set most time steps: wave (the fastest wave and speed), drag (explicit drag), law (the skeleton's law), "
        "output (landing on a record)",
        number=False,
    ),
    Figure(
        "peak_force", FORCE,
        "greatest horizontal force on the impacted face, each value a mean over one interval of the series; "
        "where force_still_rises, that so far, at least",
        "peak force", needs=ON_FACE,
    ),
    Figure("peak_force_time", "s", "time of peak_force: end of the interval", "time of the peak"),
    Figure(
        "peak_force_filtered", FORCE,
        f"greatest moving mean over {FILTER_WINDOW:g} s of the horizontal force on the impacted face; where "
        "force_still_rises, that so far, at least",
        f"peak force F₂ₓ, {FILTER_WINDOW:g} s mean", needs=ON_FACE, short=f"peak F₂ₓ, {FILTER_WINDOW:g} s mean",
    ),
    _time("peak_force_filtered", _MIDDLE),
    Figure(
        "force_still_rises", "-",
        f"whether the force's moving mean over {FILTER_WINDOW:g} s is greatest where the run ends; null without an "
        "impact",
        number=False,
    ),
    Figure(
        "impact_start_time", "s", f"start of the first interval whose force exceeds {START_SHARE:.0%} of peak_force",
        "impact from", needs=ON_FACE,
    ),
    Figure(
        "rise_time", "s", "T1: peak_force_filtered_time less impact_start_time; null where force_still_rises",
        "rise time", "T₁", needs=ON_FACE,
    ),
    Figure(
        "residual_force", FORCE, f"mean force over the last {RESIDUAL_SHARE:.0%} of the run", "residual force",
        needs=ON_FACE,
    ),
    Figure(
        "impact_end_time", "s",
        "first time after the peak from which the filtered force, less the residual force, stays below "
        f"{END_SHARE:.0%} of the filtered peak less the residual force; null where that is only in the last "
        f"{RESIDUAL_SHARE:.0%} of the run, or the force has not settled by then: residual_force is above "
        f"{SETTLED_SHARE:.0%} of the filtered peak and, at the rate of its last change, would change by more than "
        f"{END_SHARE:.0%} of that peak in as long as the impact has lasted",
    ),
    Figure(
        "impact_duration", "s", "T2: impact_end_time less impact_start_time", "impact duration", "T₂", needs=ON_FACE,
    ),
    Figure(
        "impulse", IMPULSE,
        "time integral of the horizontal force on the impacted face over the whole run; in the rows of barriers that "
        "is face_impulse, and impulse the one on the whole barrier, crest and back included",
        "impulse", needs=ON_FACE,
    ),
    Figure(
        "impact_impulse", IMPULSE,
        "time integral of the horizontal force on the impacted face from impact_start_time to impact_end_time",
        "impulse until T₂", needs=ON_FACE,
    ),
    Figure(
        "barrier_velocity_max", "m/s", "greatest velocity downstream; 0 of a barrier that only slides upstream",
        "greatest barrier velocity", needs=("barrier_velocity",), short="v₂,max",
    ),
    _time("barrier_velocity_max", "end of the interval"),
    Figure(
        "barrier_displacement_final", "m",
        "displacement of the barrier along x at the end of the run; not final unless barrier_at_rest",
        "sliding distance", "Δx", needs=("barrier_displacement",),
    ),
    Figure(
        "barrier_velocity_final", "m/s", "velocity of the barrier at the end of the run", needs=("barrier_velocity",),
    ),
    Figure(
        "barrier_at_rest", "-", "whether a sliding barrier stands still at the end of the run",
        needs=("barrier_velocity",), number=False,
    ),
    Figure(
        "peak_force_height", "m",
        "height above the barrier's base at which the horizontal force on the impacted face acts at "
        "peak_force_filtered_time, of its moving mean",
        "height of the peak force", "h_F", needs=(*ON_FACE, "impact_force_height"),
    ),
    Figure(
        "toe_moment_filtered", MOMENT,
        f"greatest moment of the flow on the barrier about its toe, of the moving mean over {FILTER_WINDOW:g} s",
        f"greatest moment about the toe, {FILTER_WINDOW:g} s mean", "M_toe", needs=("toe_moment",),
    ),
    _time("toe_moment_filtered", _MIDDLE),
    Figure(
        "heel_moment_filtered", MOMENT,
        f"greatest moment of the flow that overturns the barrier about its heel, of the moving mean over "
        f"{FILTER_WINDOW:g} s; its own weight is not counted; null of a wall, which has no heel",
        f"greatest moment about the heel, {FILTER_WINDOW:g} s mean", "M_heel", needs=("heel_moment",),
    ),
    _time("heel_moment_filtered", _MIDDLE),
    Figure(
        "pressure_patch_max", "Pa",
        f"greatest normal pressure of the flow on the impacted face, of both phases, as a mean over {PATCH}",
        "greatest pressure on the face", "p_max", needs=("pressure_patch",),
    ),
    _time("pressure_patch_max", _PATCH_END),
    Figure(
        "pressure_patch_max_height", "m",
        "height above the barrier's base of the middle of the patch of pressure_patch_max",
        "height of the greatest pressure", needs=("pressure_patch", "pressure_patch_height"),
    ),
    Figure(
        "pressure_patch_m", "m", "length of the patch of pressure_patch_max and pore_pressure_patch_max",
        "length of the patch",
    ),
    Figure(
        "pressure_patch_s", "s", "time over which pressure_patch_max and pore_pressure_patch_max are means",
        "time of the patch's mean",
    ),
    Figure(
        "pore_pressure_patch_max", "Pa",
        f"greatest pressure of the liquid on the impacted face, as a mean over {PATCH}; null of one phase on a smooth "
        "face, where it is not told apart",
        "greatest pore pressure on the face", "p_L", needs=("pore_pressure_patch",),
    ),
    _time("pore_pressure_patch_max", _PATCH_END),
    Figure(
        "pore_pressure_patch_max_height", "m",
        "height above the barrier's base of the middle of the patch of pore_pressure_patch_max",
        "height of the greatest pore pressure", needs=("pore_pressure_patch", "pore_pressure_patch_height"),
    ),
    Figure(
        "run_up_max", "m",
        "greatest height above the barrier's base up to which the flow pressed on the impacted face (`run_up`); that "
        "of the crest where it went over",
        "run-up on the face", "h_r", needs=("run_up",),
    ),
    _time("run_up_max", _PATCH_END),
    Figure(
        "pore_pressure_max", "Pa",
        "greatest pore pressure upstream of the barrier's crest at any sample, meant over a cell alone: at the "
        "material points, less their noise. It may double with each refinement of the grid and is no load to design "
        "for",
        "greatest pore pressure in a cell", needs=("pore_pressure_max",),
    ),
    _time("pore_pressure_max", "that of the sample"),
    Figure(
        "pore_pressure_max_anywhere", "Pa",
        "greatest pore pressure of any single material point, noise and jets included. It may grow with each "
        "refinement",
        "greatest pore pressure of a point", needs=("pore_pressure_max_anywhere",),
    ),
    _time("pore_pressure_max_anywhere", "that of the sample"),
    Figure("initial_volume", VOLUME, "volume of what is there at the start, deposits included"),
    Figure("left_volume", VOLUME, "what has left the domain until the end, at the flow's initial density"),
    Figure(
        "retained_volume", VOLUME, "material upstream of the crest at the end, at the flow's initial density",
        "volume retained", short="retained",
    ),
    Figure(
        "on_crest_volume", VOLUME, "material above the crest at the end", "volume on the crest",
        short="on the crest",
    ),
    Figure(
        "overtopped_volume", VOLUME,
        "material beyond the crest at the end that did not lie there as a deposit at the start; left_volume is what "
        "has left the domain",
        "volume overtopped", short="beyond",
    ),
    Figure(
        "inflow_volume", VOLUME, "what has arrived at the section of the inflow until the end, at the flow's density",
        "volume that has arrived", short="arrived", needs=("inflow_mass",),
    ),
    Figure("deposited_volume", VOLUME, "what lay there at the start as a deposit", "volume deposited before"),
    Figure(
        "mass_error", "-",
        "greatest change of the mass of both phases, inside and departed together, over the initial mass",
        "error of mass", needs=("solid_mass", "liquid_mass", "left_mass", "inflow_mass"),
    ),
    Figure(
        "momentum_error", "-",
        "greatest momentum not accounted for by the recorded impulses, over the greatest of the flow's "
        "momentum and the impulse of its weight",
        "error of momentum",
        needs=(
            *("momentum_residual_x", "momentum_residual_y", "momentum_x", "momentum_y", "solid_mass", "liquid_mass"),
        ),
    ),
    Figure(
        "energy_error", "-",
        "greatest energy that appeared beyond what was there at the start less the work done on the "
        "barrier and beyond gravity's work on liquid that seeps, over the flow's initial energy; plastic flow and drag "
        "only take energy away",
        "energy created",
        needs=(
            *("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy"),
            *("left_energy", "barrier_work", "seepage_work", "inflow_energy"),
        ),
    ),
    Figure(
        "barriers", "-",
        "of a scene with further barriers: a row for each, from upstream to downstream, with the force on the whole of "
        "it, its impulse and that of its face alone, greatest moments, the height of the force, greatest pressures and "
        "run-up on its face, its motion, the volumes held before its crest at the end and passed beyond it, and how "
        "far from its heel the first of what passed was on the ground (docs/how_to/site.md)",
        number=False,
    ),
    Figure(
        "mechanism_measures", "-",
        "what the mechanism rests on, over all snapshots: greatest share of the flow past the crest and a depth above "
        "it (airborne_share), greatest share beyond the crest (overtopped_share), greatest depth upstream of the toe "
        "over the flow's (jump_depth_ratio), greatest height of material upstream of the crest (run_up) [m]",
        number=False,
    ),
    Figure(
        "not_recorded", "-",
        "figures that are not known because output.quantities leaves out columns that they are taken from, with these",
        number=False,
    ),
    Figure("wall_time", "s", "wall time of the run, its preparation left out", "wall time"),
)  # fmt: skip

FIGURES: Mapping[str, Figure] = {row.name: row for row in _ROWS}
"""Key figures by name."""

NUMBERS: Mapping[str, Figure] = {name: figure for name, figure in FIGURES.items() if figure.number}
"""Those of them that a limit may be on."""

NEEDED: Mapping[str, tuple[str, ...]] = {figure.name: figure.needs for figure in _ROWS if figure.needs}
"""Columns of the time series that a figure is taken from."""
