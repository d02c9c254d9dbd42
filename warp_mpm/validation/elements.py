"""The constitutive law alone: Mohr-Coulomb with tension cut-off, and the Jaumann rate."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, at_most, compared, reference
from warp_mpm.validation.element_driver import Soil
from warp_mpm.validation.free_motion import free_disc

TIGHT = 1e-8


# -- return mapping against an exact slow solver -----------------------------------------------------------------


def slow_return(soil: Soil, trial: Array) -> Array:
    """Principal stresses [N, 3] by trying every set of active planes (Koiter's rule), of principal trials [N, 3].

    Six Mohr-Coulomb planes and three tension planes; of the sets of up to three of them, the one whose multipliers are
    all positive and whose stress violates no plane is the answer. Independent of the simulator's closed forms.
    """
    planes, flows, offsets = [], [], []
    for i in range(3):
        for j in range(3):
            if i != j:
                plane, flow = np.zeros(3), np.zeros(3)
                plane[i], plane[j] = 1.0 + soil.sin_friction, -(1.0 - soil.sin_friction)
                flow[i], flow[j] = 1.0 + soil.sin_dilatancy, -(1.0 - soil.sin_dilatancy)
                planes.append(plane)
                flows.append(flow)
                offsets.append(soil.cohesion_term)
    for i in range(3):
        planes.append(np.eye(3)[i])
        flows.append(np.eye(3)[i])
        offsets.append(soil.tension)
    A, b = np.array(planes), np.array(offsets)
    R = np.array(flows) @ (soil.lame * np.ones((3, 3)) + 2.0 * soil.shear * np.eye(3))
    scale = np.abs(trial).max(axis=1) + np.abs(b).max()
    result = np.full_like(trial, np.nan)
    worst = np.full(len(trial), np.inf)
    for size in range(4):
        for active in combinations(range(9), size):
            chosen = list(active)
            system = A[chosen] @ R[chosen].T
            if size and abs(np.linalg.det(system / np.abs(system).max())) < 1e-10:
                continue
            multiplier = np.linalg.solve(system, (trial @ A[chosen].T - b[chosen]).T).T if size else trial[:, :0]
            stress = trial - multiplier @ R[chosen]
            violation = (stress @ A.T - b).max(axis=1)
            negative = (-multiplier * np.diag(system)).max(axis=1, initial=0.0)
            fault = np.maximum(violation, negative) / scale
            better = fault < worst - 1e-12
            result[better], worst[better] = stress[better], fault[better]
    assert (worst < 1e-9).all(), "the slow solver found no admissible stress"
    return result


def mohr_coulomb(quick: bool) -> Outcome:
    number = 500 if quick else 5000
    rng = np.random.default_rng(1)
    checks: list[Check] = []
    for name, options in (
        ("c = 0, ψ = 0 (the paper)", {}),
        ("c = 5 kPa, ψ = 0, T = 2 kPa", {"cohesion": 5e3, "tension": 2e3}),
        ("c = 5 kPa, ψ = 10°, T up to the apex", {"cohesion": 5e3, "dilatancy": 10.0, "tension": 1e9}),
        ("φ = 0, c = 5 kPa", {"friction": 0.0, "cohesion": 5e3}),
        ("φ = ψ = 45°, ν = 0.45", {"friction": 45.0, "dilatancy": 45.0, "poisson": 0.45}),
    ):
        soil = Soil(**options)  # type: ignore[arg-type]
        principal = rng.normal(-5e3, 2e4, (number, 3))
        exact = slow_return(soil, principal)
        # Turned in the plane by a random angle; z is principal.
        angle = rng.uniform(0.0, math.pi, number)
        trial = _turned(principal, angle)
        ours = soil.map_back(trial)
        error = np.abs(ours - _turned(exact, angle)).max() / np.abs(principal).max()
        checks.append(at_most(f"{number} random stresses against the slow solver, {name}", "-", float(error), TIGHT))
    more, panels = _paths()
    return Outcome(checks=[*checks, *more], panels=panels)


def _turned(principal: Array, angle: Array) -> Array:
    """Stresses [N, 4] with principal values [N, 3] (first, z, last in the plane), the first at `angle` to x."""
    mean, radius = 0.5 * (principal[:, 0] + principal[:, 2]), 0.5 * (principal[:, 0] - principal[:, 2])
    return np.stack(
        [
            mean + radius * np.cos(2 * angle),
            mean - radius * np.cos(2 * angle),
            principal[:, 1],
            radius * np.sin(2 * angle),
        ],
        axis=1,
    )


def _paths() -> tuple[list[Check], list[Panel]]:
    """Element tests along strain paths with an exact end."""
    soil = Soil(cohesion=1e3)
    start = np.array([-20e3, -20e3, -20e3, 0.0])
    s, p = 20e3, 20e3
    cohesion = 0.5 * soil.cohesion_term  # c cos φ
    checks: list[Check] = []
    panels: list[Panel] = []

    # Triaxial, isochoric: the elastic trial is put in by hand, because the plane has no strain along z.
    strain, steps = 0.03, 300
    increment = 2.0 * soil.shear * strain / steps * np.array([0.5, -1.0, 0.5, 0.0])
    state, q = start[None, :].copy(), []
    for _ in range(steps):
        state = soil.map_back(state + increment)
        q.append(float(state[0, 0] - state[0, 1]))
    slope = 6.0 * soil.sin_friction / (3.0 - soil.sin_friction)
    plateau = slope * p + 6.0 * cohesion / (3.0 - soil.sin_friction)
    axial = strain * np.arange(1, steps + 1) / steps
    exact = np.minimum(3.0 * soil.shear * axial, plateau)
    checks.append(_tight("triaxial compression, isochoric: deviator q along the path", np.array(q), exact, plateau))
    checks.append(compared("triaxial: mean stress stays", "Pa", -float(state[0, :3].mean()), p, TIGHT))
    panels.append(_path_panel("triaxial compression, isochoric", "axial strain [%]", "q [kPa]", axial, exact, q))

    # Plane strain, isochoric.
    steps = 300
    gradient = np.array([strain, 0.0, 0.0, -strain]) / steps
    t, state = [], start[None, :].copy()
    for _ in range(steps):
        state, _ = soil.drive(state, gradient, 1)
        t.append(0.5 * float(state[0, 0] - state[0, 1]))
    plateau = s * soil.sin_friction + cohesion
    exact = np.minimum(2.0 * soil.shear * axial, plateau)
    checks.append(_tight("plane strain compression, isochoric: radius of Mohr's circle", np.array(t), exact, plateau))
    checks.append(compared("plane strain: σ_zz stays", "Pa", -float(state[0, 2]), p, TIGHT))
    panels.append(
        _path_panel("plane strain compression, isochoric", "strain [%]", "(σ_1 − σ_3)/2 [kPa]", axial, exact, t)
    )

    # Simple shear with rotation, far into flow: the principal axes stop where the spin balances the strain.
    shear, steps = 1.0, 2000
    step = shear / steps
    state, _ = soil.drive(start, np.array([0.0, step, 0.0, 0.0]), steps)
    radius = s * soil.sin_friction + cohesion
    turn = 4.0 * math.atan(0.25 * step)
    exact_shear = radius * math.sqrt(1.0 - (radius * math.sin(turn) / (soil.shear * step)) ** 2)
    checks.append(
        compared(
            "simple shear, plastic, γ = 1: shear stress of the steady state",
            "Pa",
            float(state[0, 3]),
            exact_shear,
            TIGHT,
        )
    )

    # Oedometric compression: both lateral stresses at the active limit; the rate integrates to p = K (V_0/V - 1).
    loose = Soil()
    steps, strain = 100, 0.01
    state, _ = loose.drive(np.zeros(4), np.array([0.0, 0.0, 0.0, -strain / steps]), steps)
    ratio = (1.0 - loose.sin_friction) / (1.0 + loose.sin_friction)
    bulk = loose.lame + 2.0 / 3.0 * loose.shear
    mean = bulk * math.expm1(strain)
    exact_axial = 3.0 * mean / (1.0 + 2.0 * ratio)
    checks.append(compared("oedometric compression, 1 %: axial stress", "Pa", -float(state[0, 1]), exact_axial, TIGHT))
    checks.append(
        compared(
            "oedometric compression: σ_xx/σ_yy = (1 − sin φ)/(1 + sin φ)",
            "-",
            float(state[0, 0] / state[0, 1]),
            ratio,
            TIGHT,
        )
    )

    # Tension: without strength nothing is borne and all of the strain is opening; with a cut-off the stress is held.
    state, opening = loose.drive(np.zeros(4), np.array([1e-4, 0.0, 0.0, 0.0]), 100)
    checks.append(
        at_most(
            "extension without strength: largest stress over E ε", "-", float(np.abs(state).max()) / (2e6 * 0.01), TIGHT
        )
    )
    # Of the volume at the end of each step.
    opened = -100 * math.expm1(-1e-4)
    checks.append(compared("extension without strength: opening", "-", float(opening[0]), opened, TIGHT))
    firm = Soil(cohesion=5e3, tension=2e3)
    state, _ = firm.drive(np.zeros(4), np.array([1e-5, 0.0, 0.0, 0.0]), 400)
    checks.append(compared("extension with a cut-off of 2 kPa: σ_xx", "Pa", float(state[0, 0]), 2e3, TIGHT))
    return checks, panels


def _tight(name: str, ours: Array, exact: Array, scale: float) -> Check:
    return at_most(f"{name}, largest error", "-", float(np.abs(ours - exact).max() / scale), TIGHT)


def _path_panel(title: str, x: str, y: str, strain: Array, exact: Array, ours: list[float]) -> Panel:
    every = slice(None, None, 10)
    return Panel(
        title,
        x,
        y,
        [
            reference(100.0 * strain, exact / 1e3),
            Curve(100.0 * strain[every], np.array(ours)[every] / 1e3, "ours", "o"),
        ],
    )


# -- the Jaumann rate --------------------------------------------------------------------------------------------


def rotation(quick: bool) -> Outcome:
    elastic = Soil(plasticity=False)
    start = np.array([-30e3, -10e3, -15e3, 4e3])
    checks, angles, errors = [], [], []
    for steps in (100, 400, 1600):
        turn = 2.0 * math.pi / steps
        state, _ = elastic.drive(start, np.array([0.0, -turn, turn, 0.0]), steps)
        difference = 0.5 * (state[0, 0] - state[0, 1]), state[0, 3]
        before = 0.5 * (start[0] - start[1]), start[3]
        size = math.hypot(*before)
        # The spin of a step turns the stress by 2 atan(θ/2), short of θ by θ³/12.
        short = 2.0 * steps * (turn - 2.0 * math.atan(0.5 * turn))
        turned = math.atan2(*reversed(before)) - short
        exact = size * math.cos(turned), size * math.sin(turned)
        drift = math.dist(difference, before) / size
        angles.append(math.degrees(turn))
        errors.append(drift)
        checks += [
            at_most(
                f"one turn in {steps} steps: change of the invariants",
                "-",
                max(
                    abs(math.hypot(*difference) / size - 1.0),
                    abs((state[0, 0] + state[0, 1]) / (start[0] + start[1]) - 1.0),
                ),
                1e-12,
            ),
            at_most(
                f"one turn in {steps} steps: stress against its exact lag 2N(θ − 2 atan θ/2)",
                "-",
                math.dist(difference, exact) / size,
                TIGHT,
            ),
            at_most(
                f"one turn in {steps} steps: spurious stress over the deviator",
                "-",
                drift,
                2.0 * steps * turn**3 / 12.0 * 1.01,
                reference=f"0, bound {number_of(2 * steps * turn**3 / 12)}",
            ),
        ]

    # Elastic simple shear: the Jaumann rate's own solution, which oscillates (Dienes 1979).
    largest = 4.0 * math.pi
    ends = []
    for steps in (1_000_000, 2_000_000):
        state, _ = elastic.drive(np.zeros(4), np.array([0.0, largest * 0.6 / steps, 0.0, 0.0]), steps)
        ends.append(state[0])
    end = 2.0 * ends[1] - ends[0]  # first-order in the step: extrapolated
    gamma = largest * 0.6
    checks.append(
        compared(
            "elastic simple shear γ = 7.54: σ_xy",
            "Pa",
            float(end[3]),
            elastic.shear * math.sin(gamma),
            TIGHT,
            scale=elastic.shear,
        )
    )
    checks.append(
        compared(
            "elastic simple shear γ = 7.54: σ_xx",
            "Pa",
            float(end[0]),
            elastic.shear * (1.0 - math.cos(gamma)),
            TIGHT,
            scale=elastic.shear,
        )
    )
    shears = np.linspace(0.0, largest, 41)[1:]
    steps = 4000
    states, _ = elastic.drive(
        np.zeros((len(shears), 4)), np.stack([0 * shears, shears / steps, 0 * shears, 0 * shears], axis=1), steps
    )
    fine = np.linspace(0.0, largest, 400)
    return Outcome(
        checks=[*checks, *free_disc(quick)],
        panels=[
            Panel(
                "elastic simple shear",
                "shear strain γ",
                "stress / G",
                [
                    reference(fine, np.sin(fine), "sin γ, 1 − cos γ"),
                    reference(fine, 1.0 - np.cos(fine), ""),
                    Curve(shears, states[:, 3] / elastic.shear, "σ_xy", "o"),
                    Curve(shears, states[:, 0] / elastic.shear, "σ_xx", "x"),
                ],
            ),
            Panel(
                "spurious stress after one turn",
                "angle per step [°]",
                "share of the deviator",
                [
                    reference(angles, [2 * 2 * math.pi * math.radians(a) ** 2 / 12 for a in angles], "2·2π θ²/12"),
                    Curve(angles, errors, "ours", "o"),
                ],
                log_x=True,
                log_y=True,
            ),
        ],
    )


def number_of(value: float) -> str:
    """Two significant digits."""
    return f"{value:.2g}"


CASES = (
    Case(
        name="mohr-coulomb",
        title="Mohr–Coulomb element tests",
        tests="The return mapping on random trial stresses of five soils, and strain paths with an exact end: "
        "triaxial, plane strain, simple shear with rotation, isochoric, oedometric, tension.",
        source="exact slow solver (every set of active planes, Koiter's rule); closed forms of the paths",
        limit="1e-8",
        run=mohr_coulomb,
    ),
    Case(
        name="rotation",
        title="Rotation without strain (Jaumann)",
        tests="A stressed element is turned once without strain; an elastic one is sheared far; a free elastic disc, "
        "without gravity, turns twice.",
        source="the stress turns with the element; its exact lag per step is θ − 2 atan(θ/2); simple shear: "
        "σ_xy = G sin γ, σ_xx = G (1 − cos γ) (Dienes 1979); the disc swells to its elastic equilibrium in "
        "plane strain and keeps its angular momentum",
        limit="invariants 1e-12; spurious stress at most 2N θ³/12 of the deviator after N steps of θ; 1e-8 against the "
        "rate form's own solutions; disc: inertia 0.5 % a turn, angular momentum 0.5 % in two turns",
        run=rotation,
    ),
)
