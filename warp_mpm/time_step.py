"""Critical time step: how fast waves run and how stiff the drag is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .scenario import STANDARD_GRAVITY, Scenario, TwoPhaseFlow, UndrainedFlow, UndrainedMaterial
from .simulator.laws import LAWS
from .simulator.schemes import SCHEMES, Scheme

ONE_TIME = 1e-3
"""Share of a nominal step by which two times may differ and be one: no step is made from one to the other. Times that
are meant to be equal differ by their rounding. What a contact gives in a step goes to nothing with the step, but the
first short steps after longer ones also hold what those left over, together up to half of what one of them gave: a mean
force over a sliver would be of any size."""

SHORTEST_RECORD = 0.1
"""Least share of a nominal step that a record of a run covers: records that lie closer are made at one time."""


@dataclass(frozen=True)
class StepLimits:
    """Bounds on the time step of a scene before the Courant number is applied."""

    wave_speed: float
    """Fastest wave through the material at rest [m/s], for the bound on the step; the flow's own speed is added as the
    run goes. Artificial viscosity b counts as a wave faster by b + sqrt(1 + b^2); where the material bears tension, a
    point may be alone on its nodes and swing: see `lone_point_courant_number`."""
    sound_speed: float
    """Speed of sound in the material as a whole [m/s], without drag between its phases where there are two."""
    drag_step: float
    """Largest stable step of explicitly integrated drag and waves together [s]; infinite where drag is implicit."""
    law_step: float = math.inf
    """Largest stable step of the skeleton's law [s]; infinite where waves alone bound it."""

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] beside that of waves."""
        return min(self.drag_step, self.law_step)


def undrained_wave_speed(oedometric_modulus: float, liquid_stiffness: float, density: float) -> float:
    """Speed [m/s] with both phases moving together: sqrt((E_oed + K_L / n) / rho_m)."""
    return math.sqrt((oedometric_modulus + liquid_stiffness) / density)


def biot_wave_speeds(
    oedometric_modulus: float, liquid_bulk_modulus: float, porosity: float, solid_density: float, liquid_density: float
) -> tuple[float, float]:
    """Fast and slow compression waves [m/s] of two phases without drag.

    Eigenvalues of M^-1 K with M = diag(n_S rho_S, n rho_L) and
    K = [[E_oed + n_S^2 K_L / n, n_S K_L], [n_S K_L, n K_L]].

    Args:
        oedometric_modulus: of the skeleton [Pa].
        liquid_bulk_modulus: K_L [Pa].
        porosity: n [-].
        solid_density: of the grains [kg/m3].
        liquid_density: of the liquid [kg/m3].
    """
    n, solid = porosity, 1.0 - porosity
    coupling = solid * liquid_bulk_modulus
    stiffness = np.array([[oedometric_modulus + solid * coupling / n, coupling], [coupling, n * liquid_bulk_modulus]])
    mass = np.diag([solid * solid_density, n * liquid_density])
    try:
        slow, fast = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real))
    except np.linalg.LinAlgError:  # a phase that weighs next to nothing
        slow = fast = math.inf
    return float(fast), float(slow)


def explicit_drag_step(
    *,
    spacing: float,
    oedometric_modulus: float,
    liquid_bulk_modulus: float,
    porosity: float,
    solid_density: float,
    liquid_density: float,
    conductivity: float,
) -> float:
    """Critical step [s] of the two-phase equations with explicit drag, which replaces Eq. (A13).

    Largest step for which the explicit update of one linear element's highest mode is stable, after Mieremet: with
    a the decay rate of v_L - v_S, and b and d the sum and product of the squared frequencies of the two modes,
    dt = (-2 a + sqrt(4 a^2 + 8 B)) / B with B = b + sqrt(b^2 - 4 d).
    """
    n, solid = porosity, 1.0 - porosity
    density = solid * solid_density + n * liquid_density
    inertia = n * solid * solid_density * liquid_density
    a = n * density * STANDARD_GRAVITY / (solid * solid_density * conductivity)
    b = (
        4.0
        * (
            n * density * liquid_bulk_modulus
            + (1.0 - 2.0 * n) * liquid_density * liquid_bulk_modulus
            + n * liquid_density * oedometric_modulus
        )
        / (inertia * spacing**2)
    )
    d = 16.0 * oedometric_modulus * liquid_bulk_modulus / (solid * solid_density * liquid_density * spacing**4)
    both = b + math.sqrt(max(b * b - 4.0 * d, 0.0))
    return (-2.0 * a + math.sqrt(4.0 * a * a + 8.0 * both)) / both


def lone_point_courant_number(poisson_ratio: float, scheme: Scheme, slopes: float = 6.0) -> float:
    """Largest stable c dt / d of an elastic point that is alone on its nodes, below that of a full grid, 1.

    Its pressure acts on nodes that hold no more than its own mass, sum_i (w_i')^2 / w_i = S per direction: 4 in the
    middle of a cell, 6 at its edge. Spread alike in both directions, with a = (c dt / d)^2 and
    r = (lambda + mu) / (lambda + 2 mu) = 1 / (2 (1 - nu)), stress s and rate of strain e of a step obey

        apic, aflip: e' = e - 8 r a s, s' = s + e - 2 r a S s, stable up to a = 1 / (r (S - 2)), as the point keeps e,
        flip: s' = s - 2 r a S s,                       stable up to a = 1 / (r S), as it keeps its mean velocity alone.

    Args:
        poisson_ratio: 0.5 for a liquid.
        scheme: apic or aflip, which keep the point's affine field, or flip, which does not, or another of either kind.
        slopes: S; the worst place by default.
    """
    kept = 2.0 if scheme.keeps_affine_field else 0.0
    return math.sqrt(2.0 * (1.0 - poisson_ratio) / (slopes - kept))


def moving_density(scenario: Scenario) -> float:
    """Mass per volume of the whole that moves with the solid [kg/m3]: all of it where both phases move as one."""
    material = scenario.flow.material
    return material.density if isinstance(scenario.flow, UndrainedFlow) else material.solid_partial_density


def _lone_point_speed(scenario: Scenario, sound: float) -> float:
    """Speed [m/s] that stands in for a lone point's limit; 0 where it cannot swing, because it bears no tension."""
    material, scheme = scenario.flow.material, SCHEMES.named(scenario.numerics.transfer)
    speed = 0.0
    if LAWS.named(material.law).bears_tension(material):
        skeleton = math.sqrt(material.oedometric_modulus / moving_density(scenario))
        speed = skeleton / lone_point_courant_number(material.poisson_ratio, scheme)
    if isinstance(material, UndrainedMaterial) and material.cavitation_pressure_Pa > 0.0:
        speed = max(speed, sound / lone_point_courant_number(0.5, scheme))
    return speed


def nominal_step(scenario: Scenario) -> float:
    """The step [s] against which times are told apart (`ONE_TIME`, `SHORTEST_RECORD`): the longest that is stable as
    the flow starts, or the shortest interval of the output where that is less."""
    numerics, output, limits = scenario.numerics, scenario.output, step_limits(scenario)
    stable = min(numerics.spacing_m / (limits.wave_speed + scenario.flow.greatest_speed), limits.drag_step)
    intervals = (output.time_series_interval_s, output.snapshot_interval_s, output.end_time_s)
    return min(numerics.courant_number * stable, *intervals)


def step_limits(scenario: Scenario) -> StepLimits:
    """Bounds on the time step of `scenario` (audit, section 3.4), with several materials the closest; the speed of
    sound is that of the flow's, or in a wet scene of a dry flow that of the first wet one.

    Raises:
        ValueError: sound through a material has no finite speed.
    """
    materials = scenario.flow.materials
    limits = [_limits(scenario.of_material(place)) for place in range(len(materials))]
    return StepLimits(
        max(one.wave_speed for one in limits),
        limits[materials.index(scenario.flow.wettest)].sound_speed,
        min(one.drag_step for one in limits),
        min(one.law_step for one in limits),
    )


def _limits(scenario: Scenario) -> StepLimits:
    flow, numerics = scenario.flow, scenario.numerics
    drag = math.inf
    if isinstance(flow, TwoPhaseFlow):
        material = flow.material
        sound, _ = biot_wave_speeds(
            material.oedometric_modulus,
            material.liquid_bulk_modulus_Pa,
            material.porosity,
            material.grain_density_kg_per_m3,
            material.liquid_density_kg_per_m3,
        )
        if numerics.drag == "explicit":
            drag = explicit_drag_step(
                spacing=numerics.spacing_m,
                oedometric_modulus=material.oedometric_modulus,
                liquid_bulk_modulus=material.liquid_bulk_modulus_Pa,
                porosity=material.porosity,
                solid_density=material.grain_density_kg_per_m3,
                liquid_density=material.liquid_density_kg_per_m3,
                conductivity=material.hydraulic_conductivity,
            )
    elif isinstance(flow, UndrainedFlow):
        stiffness = flow.material.liquid_bulk_modulus_Pa / flow.material.porosity
        sound = undrained_wave_speed(flow.material.oedometric_modulus, stiffness, flow.material.density)
    else:
        sound = undrained_wave_speed(flow.material.oedometric_modulus, 0.0, flow.material.density)
    if not 0.0 < sound < math.inf:
        raise ValueError(
            f"flow.material: sound would run through it at {sound:g} m/s; porosity, densities and moduli must give a "
            "finite speed greater than 0"
        )
    viscosity = numerics.bulk_viscosity
    fastest = max(sound, _lone_point_speed(scenario, sound))
    law_step = LAWS.named(flow.material.law).largest_step(
        flow.material, spacing=numerics.spacing_m, density=moving_density(scenario)
    )
    return StepLimits(fastest * (viscosity + math.hypot(1.0, viscosity)), sound, drag, law_step)
