"""What arrives, in parts of one material."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mpm.scenario.inflow import DENSITY_STEPS, Inflow
from warp_mpm.scenario.material import Skeleton, of_density
from warp_mpm.scenario.other_material import OtherMaterial


class Arriving(NamedTuple):
    """A part of what arrives that is of one material."""

    begin: float
    """Time [s] from which on it passes the section."""
    end: float
    """Until then [s]."""
    density: float
    """Of what passes then, that of which the density of the whole is next to this one [kg/m³]; nan: all of it."""
    own: OtherMaterial
    """What it says of its material."""
    material: Skeleton


def part_at(parts: list[Arriving], time: NDArray[np.float64], density: NDArray[np.float64]) -> NDArray[np.int64]:
    """Place among the parts of what passes at times [N] [s] with densities [N] [kg/m³]."""
    apart = []
    for part in parts:
        beside = np.maximum(np.maximum(part.begin - time, time - part.end), 0.0)
        apart.append(1e12 * beside + (0.0 if math.isnan(part.density) else np.abs(part.density - density)))
    return np.argmin(apart, axis=0)


def surges_of(
    inflow: Inflow, material_of: Callable[[OtherMaterial], Skeleton]
) -> list[tuple[float, float, OtherMaterial, Skeleton]]:
    """Begin, end [s], what is said of the material and the material of each surge of an inflow."""
    said: list[OtherMaterial] = [inflow, *inflow.surges]
    begins = [-math.inf, *(surge.from_s for surge in inflow.surges)]
    ends = [*begins[1:], math.inf]
    return [(begin, end, own, material_of(own)) for begin, end, own in zip(begins, ends, said, strict=True)]


def parts_of(inflow: Inflow, material_of: Callable[[OtherMaterial], Skeleton]) -> list[Arriving]:
    """What arrives, by material, in the order in which each begins to.

    A density that changes over time is one of the porosity: at equal volume some of the solid gives way to liquid,
    or to air. It is cut into `DENSITY_STEPS` equal steps at most, each with the mean of what passes of it, so that
    the mass is that of the table.
    """
    found = []
    times, volumes = inflow.passing
    for begin, end, own, material in surges_of(inflow, material_of):
        within = (times >= begin) & (times < end)
        if not within.any():
            continue
        if inflow.densities_kg_per_m3 is None:
            found.append(Arriving(begin, end, math.nan, own, material))
            continue
        density, volume = inflow.density(times[within]), volumes[within]
        least, most = float(density.min()), float(density.max())
        count = DENSITY_STEPS if most - least > 1e-9 * most else 1
        middles = least + (most - least) * (np.arange(count) + 0.5) / count
        steps = np.abs(middles[:, None] - density).argmin(axis=0)
        for step in dict.fromkeys(steps.tolist()):
            mean = float(np.average(density[steps == step], weights=volume[steps == step]))
            found.append(Arriving(begin, end, float(middles[step]), own, of_density(material, mean)))
    return found


def pieces_of(inflow: Inflow, parts: list[Arriving]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Volumes [L] [m³/m] and masses [L] [kg/m] of what arrives, one piece after the other."""
    times, volumes = inflow.passing
    densities = np.array([part.material.density for part in parts])
    return volumes, volumes * densities[part_at(parts, times, inflow.density(times))]
