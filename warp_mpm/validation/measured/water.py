"""Columns of water that collapse: the scene, what is read of it, and how two clocks are made one.

Water is the perfect fluid of the dam break among the known answers: a skeleton without strength whose voids are full of
liquid, undrained, on smooth ground between smooth walls. Viscosity and surface tension are not in it (at 0.3 m the
Reynolds number is 5e5 and the Weber number 1e4), nor is air, nor the gate, which is gone at once; `WALL_WITH_GATE` has
the gate, and a bed that holds the water. Sound is at ten times
the speed of the front, so that the density changes by about a percent; a real impact's milliseconds of compression are
not resolved.

All lengths are over the depth H of the column, times t* = t √(g/H), pressures p* = p/(ρ g H). Everything is similar, so
that one run serves experiments of the same proportions at any H.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warp_mpm.kernels import layout as at
from warp_mpm.simulation import Simulation
from warp_mpm.simulator.bodies import Body, Driven, Outline
from warp_mpm.validation.case import Array
from warp_mpm.validation.measured.given import Given
from warp_mpm.validation.scenes import box, fixed, scene

G = 9.81
DEPTH = 0.3
"""H of every run [m]; results are similar."""

DENSITY = 997.0
SOUND = 17.5
"""Speed of sound over √(g H)."""

RECORD = 0.02
"""Interval of the records in t*."""

WATER: dict[str, Any] = {
    "grain_density_kg_per_m3": DENSITY,
    "liquid_density_kg_per_m3": DENSITY,
    "young_modulus_Pa": 1e3,
    "friction_angle_deg": 0.0,
    "liquid_bulk_modulus_Pa": 0.5 * DENSITY * SOUND**2 * G * DEPTH,
}
"""A mixture of water and water of a porosity of one half; its skeleton is a thousandth as stiff as its liquid."""

HELD: dict[str, Any] = {"law": "herschel_bulkley", "yield_stress_Pa": 0.0, "consistency_Pa_s": 1e-3}
"""Water with its viscosity, so that a bed can hold it: the cell beside the bed then stands for the boundary layer."""

NO_SLIP = 10.0
"""Friction of a bed on which nothing slips."""

MOST_SHIFT = 0.2
"""By how much in t* the clocks of experiment and simulation may differ: a gate takes time to go."""


@dataclass(frozen=True)
class Setup:
    """Lengths over H."""

    width: float
    """Of the column, behind the gate."""
    bed: float
    """From the back wall to the end of what is followed, or to the wall."""
    end: float
    """t*."""
    wall: bool = False
    """A wall stands at the end of the bed."""
    ceiling: float | None = None
    gate: float | None = None
    """Speed over √(g H) at which a gate is lifted; None: it is gone at once."""
    held: bool = False
    """The bed holds the water that touches it, which has the viscosity of water; false: it is smooth."""
    points: int = 4
    """Material points per cell."""


WALL = Setup(width=2.0, bed=1.61 / 0.3, end=7.5, wall=True, ceiling=2.0)
"""Lobovský's tank at H = 0.3 m. Buchner's has the same proportions, apart from its ceiling."""

WALL_WITH_GATE = replace(WALL, gate=3.46 / math.sqrt(9.81 * 0.3), held=True)
"""The gate's median speed at H = 0.3 m is 3.46 m/s."""

SQUARE = Setup(width=1.0, bed=6.0, end=3.3)
TALL = Setup(width=0.5, bed=4.0, end=1.7)


@dataclass(frozen=True)
class Watched:
    """A run, at the times t* of its records."""

    cells: int
    """Over H."""
    time: Array
    front: Array
    """[T] distance of the farthest material point from the gate."""
    levels: Array
    """[T, G] depth at each gauge: volume over width of a strip two cells wide."""
    edges: Array
    """[S + 1] heights of the ends of the wall's slots."""
    loads: Array
    """[T, S] force on each slot over ρ g H², mean over the record's interval."""

    def pressure(self, height: float, width: float) -> Array:
        """p* [T] of a sensor whose middle is at `height`: mean over its width, or two cells where that is more,
        shifted up where it would reach below the bed."""
        width = max(width, 2.0 / self.cells)
        low = max(height - 0.5 * width, 0.0)
        sums = np.concatenate([np.zeros((len(self.time), 1)), np.cumsum(self.loads, axis=1)], axis=1)
        ends = [[np.interp(place, self.edges, row) for place in (low, low + width)] for row in sums]
        return np.diff(np.array(ends), axis=1)[:, 0] / width


def spacings(given: Given) -> tuple[int, ...]:
    """Cells over H, coarsest first."""
    cells = (10, 20) if given.quick else (15, 30, 60)
    return tuple(count * given.finer for count in cells)


def watch(setup: Setup, cells: int, gauges: Sequence[float] = ()) -> Watched:
    """Run a set-up with so many cells over H; gauges at distances over H from the back wall."""
    back, spacing, unit = -setup.bed * DEPTH, DEPTH / cells, math.sqrt(DEPTH / G)
    domain = {"left_edge": "wall", "left_m": back, "top_m": 2.0 * DEPTH}
    if setup.ceiling is not None:
        domain |= {"top_edge": "wall", "top_m": setup.ceiling * DEPTH}
    if not setup.wall:
        domain |= {"right_m": 0.0}
    simulation = Simulation(
        scene(
            "column of water",
            box(back, back + setup.width * DEPTH, DEPTH),
            "undrained",
            end_time=setup.end * unit,
            lateral=1.0,
            soil=_soil(setup),
            ground=NO_SLIP if setup.held else 0.0,
            barrier=fixed({"kind": "wall"}) if setup.wall else None,
            spacing_m=spacing,
            points_per_cell=setup.points,
            domain=domain,
        ),
        bodies=_gate(setup, spacing),
    )
    times = np.arange(1, round(setup.end / RECORD) + 1) * RECORD
    edges = simulation.slots["barrier"].face.heights if simulation.slots else np.zeros(1)
    fronts, levels, loads = [], [], []
    before = simulation.window()
    for time in times:
        simulation.advance(float(time * unit))
        points = simulation.points(["position", "volume"])
        x = points["position"][:, 0] - back
        fronts.append(x.max() / DEPTH - setup.width)
        strips = [np.abs(x - place * DEPTH) < spacing for place in gauges]
        levels.append([points["volume"][strip].sum() / (2.0 * spacing * DEPTH) for strip in strips])
        now = simulation.window()
        taken = (now.taken - before.taken).reshape(-1, at.SLOT_SIZE)[: len(edges) - 1, at.SLOT_NORMAL]
        loads.append(taken / (now.time - before.time) / (DENSITY * G * DEPTH**2))
        before = now
    return Watched(cells, times.astype(np.float64), np.array(fronts), np.array(levels), edges / DEPTH, np.array(loads))


def _soil(setup: Setup) -> dict[str, Any]:
    if not setup.held:
        return WATER
    return {name: value for name, value in WATER.items() if name != "friction_angle_deg"} | HELD


def _gate(setup: Setup, spacing: float) -> list[Body]:
    """A smooth plate two cells thick before the column, which comes to its speed within a hundredth of t*."""
    if setup.gate is None:
        return []
    left, top, unit = (setup.width - setup.bed) * DEPTH, 2.0 * DEPTH, math.sqrt(DEPTH / G)
    right = left + 2.0 * spacing
    outline = Outline([[left, 0.0], [right, 0.0], [right, top], [left, top]])
    speed = setup.gate * math.sqrt(G * DEPTH)
    motion = Driven((0.0, 0.01 * unit, setup.end * unit), ((0.0, 0.0), (0.0, speed), (0.0, speed)))
    return [Body("gate", outline, motion=motion)]


# -- clocks ------------------------------------------------------------------------------------------------------


def at_times(watched: Watched, values: Array, times: Array, shift: float) -> Array:
    """Values of a run at times of an experiment whose clock shows `shift` more than the run's."""
    return np.interp(times - shift, watched.time, values)


def best_shift(curves: Sequence[tuple[Watched, Array, Array, Array]]) -> float:
    """The one shift in t*, of at most `MOST_SHIFT`, that brings curves of a run nearest to those of an experiment.

    Args:
        curves: run, its values, times and values of the experiment; any number of them.
    """

    def misfit(shift: float) -> float:
        return sum(rms(at_times(run, values, times, shift) - theirs) ** 2 for run, values, times, theirs in curves)

    return float(min(np.linspace(-MOST_SHIFT, MOST_SHIFT, 81), key=misfit))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def filtered(values: Array, width: float) -> Array:
    """Moving mean over a width in t*."""
    count = max(round(width / RECORD), 1)
    return np.convolve(values, np.full(count, 1.0 / count), "same")


def mean_between(time: Array, values: Array, begin: float, end: float) -> float:
    """Mean of the records within a stretch of time."""
    inside = (time > begin) & (time <= end)
    return float(values[inside].mean()) if inside.any() else math.nan
