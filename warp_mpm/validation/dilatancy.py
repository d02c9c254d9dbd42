"""Dilatancy: layers that are sheared at a given rate, undrained and drained, loose and dense."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, at_most, compared, holds, reference
from warp_mpm.validation.scenes import box, scene

G = 9.81
GRAINS, LIQUID, VISCOSITY = 2600.0, 1000.0, 1e-3
CRITICAL, COEFFICIENT, FRICTION = 0.56, 0.5, 30.0
SHEAR = 4.0
"""Rate of shearing of the layer at the start [1/s]: the bed holds it, and what its weight pulls friction holds, so that
it goes on so."""

NO_SLIP = 10.0
"""Friction of a bed on which nothing slips."""

SOFT: dict[str, Any] = {
    "friction_angle_deg": FRICTION,
    "young_modulus_Pa": 4e5,
    "poisson_ratio": 0.25,
}
"""So soft that a pressure of the layer's own size takes tenths of a second to come and go."""

SHEAR_MODULUS = SOFT["young_modulus_Pa"] / 2.5
BULK_MODULUS = SOFT["young_modulus_Pa"] / 1.5
OEDOMETRIC_MODULUS = BULK_MODULUS + 4.0 / 3.0 * SHEAR_MODULUS


def tangent(m: Any, pressure: Any, viscosity: float = VISCOSITY) -> Any:
    """tan ψ [-] at a solid fraction and an effective pressure [Pa], sheared at `SHEAR` (Iverson and George 2014)."""
    state = viscosity * SHEAR / (GRAINS * (SHEAR * 1e-3) ** 2 + np.maximum(pressure, 0.0))
    return COEFFICIENT * (m - CRITICAL / (1.0 + np.sqrt(state)))


def sheared_layer(fraction: float, formulation: str, cells: int, *, end: float) -> tuple[Simulation, float]:
    """A layer 1 m deep and its effective weight [N/m³] across the slope, on which friction holds it as it is sheared.

    Args:
        fraction: of solid.
        formulation: of the flow.
        cells: over the depth.
        end: time [s] until which what happens at the layer's ends must not reach its middle.
    """
    wet = formulation != "dry"
    density = fraction * GRAINS + ((1.0 - fraction) * LIQUID if wet else 0.0)
    carried = density - (LIQUID if wet else 0.0)
    sine = math.sin(math.radians(FRICTION) + math.atan(COEFFICIENT * (fraction - CRITICAL)))
    slope = math.atan(sine * carried / density)
    length = 8.0 + 8.0 * end
    soil = SOFT | {
        "porosity": 1.0 - fraction,
        "grain_density_kg_per_m3": GRAINS,
        "dilatancy": {"critical_solid_fraction": CRITICAL, "coefficient": COEFFICIENT},
    }
    simulation = Simulation(
        scene(
            "sheared layer",
            box(-length, 0.0, 1.0),
            formulation,
            end_time=end,
            velocity=(0.5 * SHEAR, 0.0),
            tilt=math.degrees(slope),
            ground=NO_SLIP,
            lateral=1.0,
            soil=soil | ({"hydraulic_conductivity_m_per_s": 1e-7} if formulation == "two_phase" else {}),
            spacing_m=1.0 / cells,
            domain={"left_m": -length - 1.0, "right_m": 0.75 * length, "top_m": 2.0},
        )
    )
    points = simulation.points()
    y, stress = points["position"][:, 1], points["effective_stress"].copy()
    velocity = np.stack([SHEAR * y, 0.0 * y], axis=1)
    weight = carried * G * math.cos(slope)
    stress[:, 3] = sine * weight * (1.0 - y)
    phases = {"solid_velocity": velocity} | ({"liquid_velocity": velocity} if formulation == "two_phase" else {})
    simulation.set_points(effective_stress=stress, **phases)
    return simulation, weight


def middle_of(simulation: Simulation, low: float, high: float) -> tuple[dict[str, Array], Array]:
    """The points, and which of them lie in the middle of the layer's length, at heights that began from low to high."""
    points = simulation.points()
    x = points["position"][:, 0]
    return points, np.abs(x - x.mean()) < 1.0


def undrained_pressure(fraction: float, weight: float, heights: Array, times: Array) -> Array:
    """Effective pressure [T, N] of a layer that cannot drain: p' changes by K tan ψ Γ' a second, Γ' = γ̇ - τ'/G with
    τ = p' sin(φ + ψ); the liquid's own compression gives back K / (E_oed + K_L/n) of it."""
    given_back = 1.0 - BULK_MODULUS / (OEDOMETRIC_MODULUS + 3e7 / (1.0 - fraction))
    pressure = weight * (1.0 - heights)
    found, steps = [pressure], 200
    for interval in np.diff(times):
        for _ in range(steps):
            psi = tangent(fraction, pressure)
            sine = np.sin(math.radians(FRICTION) + np.arctan(psi))
            gain = given_back * BULK_MODULUS * psi
            pressure = pressure + interval / steps * SHEAR * gain / (1.0 + gain / SHEAR_MODULUS * sine)
            pressure = np.maximum(pressure, 0.0)
        found.append(pressure)
    return np.array(found)


def undrained(quick: bool) -> Outcome:
    ladder = (5,) if quick else (5, 10, 20)
    checks: list[Check] = []
    panels = []
    end = 0.6
    times = np.linspace(0.0, end, 25)
    for name, fraction in (("loose", 0.55), ("dense", 0.57)):
        curves, errors = [], []
        for cells in ladder:
            simulation, weight = sheared_layer(fraction, "two_phase", cells, end=end)
            start = simulation.points()
            height = start["position"][:, 1]
            x = start["position"][:, 0]
            chosen = (np.abs(x - x.mean()) < 1.0) & (height > 0.15) & (height < 0.45)
            exact = undrained_pressure(fraction, weight, height[chosen], times)
            change = (exact - exact[0]).mean(axis=1)
            ours = [0.0]
            for time in times[1:]:
                simulation.advance(float(time))
                pressure = simulation.points()["pore_pressure"][chosen]
                ours.append(float((start["pore_pressure"][chosen] - pressure).mean()))
            errors.append(float(np.abs(np.array(ours) - change).max() / abs(change[-1])))
            curves.append(Curve(times, -1e-3 * np.array(ours), f"{cells} cells", "."))
        panels.append(
            Panel(name, "time [s]", "change of the pore pressure [kPa]", [reference(times, -1e-3 * change, "ODE"), *curves])
        )
        checks.append(
            at_most(f"{name}: change of the pore pressure, largest error", "of the change", errors[-1], 0.05, percent=True)
        )
    return Outcome(checks=checks, panels=panels)


if __name__ == "__main__":
    out = undrained(False)
    for c in out.checks: print(c)
    for p in out.panels:
        for q in p.curves: print(p.title, q.label, np.polyfit(q.x,q.y,1)[0], np.round(q.y,2))
