"""Scenes of the validation cases, and the loop that runs them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from warp_mpm.recording import Moments, SeriesInMemory, record_until
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array

GRAIN_DENSITY, LIQUID_DENSITY, POROSITY = 2600.0, 1000.0, 0.5
YOUNG_MODULUS, POISSON_RATIO, FRICTION_ANGLE = 2e6, 0.25, 20.0
CONDUCTIVITY, LIQUID_BULK_MODULUS = 1e-4, 3e7
"""The paper's Table 1."""

JAKY = 1.0 - math.sin(math.radians(FRICTION_ANGLE))
"""Lateral stress at rest, of elastic scenes too, so that they begin as the others do."""

INVISCID = {"young_modulus_Pa": 1e4, "friction_angle_deg": 0.0}
"""A skeleton without strength: with its voids full of liquid the undrained mixture flows like a perfect fluid."""


def material(formulation: str, **changes: Any) -> dict[str, Any]:
    """The paper's material as dry, undrained or two-phase, with fields replaced."""
    fields: dict[str, Any] = {
        "grain_density_kg_per_m3": GRAIN_DENSITY,
        "porosity": POROSITY,
        "young_modulus_Pa": YOUNG_MODULUS,
        "poisson_ratio": POISSON_RATIO,
        "friction_angle_deg": FRICTION_ANGLE,
    }
    if formulation != "dry":
        fields |= {"liquid_density_kg_per_m3": LIQUID_DENSITY, "liquid_bulk_modulus_Pa": LIQUID_BULK_MODULUS}
    if formulation == "two_phase":
        fields |= {"hydraulic_conductivity_m_per_s": CONDUCTIVITY}
    if "law" in changes:
        del fields["friction_angle_deg"]  # a field of another law
    return fields | changes


def scene(
    title: str,
    vertices: list[list[float]],
    formulation: str,
    *,
    end_time: float,
    velocity: tuple[float, float] = (0.0, 0.0),
    gravity: float = 9.81,
    tilt: float = 0.0,
    stress: str = "geostatic",
    lateral: float | None = None,
    soil: dict[str, Any] | None = None,
    barrier: dict[str, Any] | None = None,
    ground: float | None = 0.0,
    domain: dict[str, Any] | None = None,
    **numerics: Any,
) -> Scenario:
    """A scene from a polygon and a few figures; `soil` replaces fields of the material, `ground` is its friction."""
    elastic = (soil or {}).get("law") == "elastic"
    return Scenario.model_validate(
        {
            "title": title,
            "gravity": {"acceleration_m_per_s2": gravity, "tilt_deg": tilt},
            "flow": {
                "formulation": formulation,
                "shape": {"kind": "polygon", "vertices_m": vertices},
                "velocity_m_per_s": velocity,
                "initial_stress": stress,
                "lateral_stress_coefficient": JAKY if lateral is None and elastic else lateral,
                "material": material(formulation, **(soil or {})),
            },
            "barrier": barrier,
            "ground": None if ground is None else {"friction": ground},
            "domain": domain or {},
            "numerics": numerics,
            "output": {"end_time_s": end_time},
        }
    )


def box(left: float, right: float, height: float, bottom: float = 0.0) -> list[list[float]]:
    """A rectangle."""
    return [[left, bottom], [right, bottom], [right, bottom + height], [left, bottom + height]]


def column(formulation: str, *, cells: int, end_time: float, **options: Any) -> Scenario:
    """A column of 1 m height and two cells width between smooth walls, on smooth ground: one-dimensional strain."""
    spacing = 1.0 / cells
    width = 2.0 * spacing
    walls = {"left_edge": "wall", "right_edge": "wall", "left_m": 0.0, "right_m": width, "top_m": 1.25}
    return scene(
        "column of 1 m",
        box(0.0, width, 1.0),
        formulation,
        end_time=end_time,
        domain=walls,
        spacing_m=spacing,
        **options,
    )


def fixed(shape: dict[str, Any], friction: float = 0.0) -> dict[str, Any]:
    """A barrier that does not move."""
    return {"shape": shape, "motion": {"kind": "fixed"}, "friction": friction}


def sampled(simulation: Simulation, times: Iterable[float]) -> dict[str, Array]:
    """Samples at `times`, by quantity; forces are means over the interval before."""
    moments = Moments(times)
    recorder = SeriesInMemory(moments)
    record_until(simulation, [recorder], moments.times[-1])
    return recorder.series()


def layers(values: Array, number: int) -> Array:
    """Means over the layers of a column, lowest first; material points are ordered by column and row."""
    return values.reshape(-1, number, *values.shape[1:]).mean(axis=0)
