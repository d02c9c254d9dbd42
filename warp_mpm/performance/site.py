"""What a ground with a profile and a second material cost, against the same flow without."""

from __future__ import annotations

import math
from typing import Any

from warp_mpm.performance.probe import Stepper, clock_of, in_turns
from warp_mpm.performance.table import Progress, Table
from warp_mpm.performance.yardstick import Yardstick
from warp_mpm.scenario import Scenario

SLOPE = 8.0
"""[°]"""

LONG = 400.0
"""Half of the profile's length [m]; the domain ends where the flow can get."""

CORNERS = 600
"""Points of the profile that is not straight."""

Corners = list[list[float]]


def site_costs(base: Scenario, *, device: str, progress: Progress, rounds: int, seconds: float) -> Table:
    """Cost of a step with each, as ratio to the yardstick, and how much more that is than without.

    Args:
        base: a two-phase scene.
        device: a Warp device.
        progress: told what is measured.
        rounds: of turns.
        seconds: of a turn [s].
    """
    clock, steppers, flows = clock_of(device), [], scenes(base)
    for name, (scene, _) in flows.items():
        progress(name)
        steppers.append(Stepper(scene, device=device, clock=clock))
    yardstick = Yardstick(steppers[0].simulation.material_points, device=device, clock=clock)
    yard, *costs = in_turns([yardstick, *steppers], rounds=rounds, seconds=seconds)
    ratio = {name: cost / yard for name, cost in zip(flows, costs, strict=True)}
    rows = [
        (name, f"{ratio[name]:.2f}", "" if beside is None else f"{ratio[name] - ratio[beside]:+.2f}")
        for name, (_, beside) in flows.items()
    ]
    return Table("site", "Cost of a site's ground and materials, two-phase", ("flow", "yardsticks", "added"), rows)


def scenes(base: Scenario) -> dict[str, tuple[Scenario, str | None]]:
    """By name scenes on rough ground without a barrier, each with the name of the one that it is set against."""
    flat = base.replaced({"barrier": None, "ground.friction": 0.3})
    tilted = flat.replaced({"gravity.tilt_deg": SLOPE})
    ends = [[-LONG, 0.0], [LONG, 0.0]]
    bent = [[-LONG + 2.0 * LONG * k / (CORNERS - 1), 0.05 * (k % 2)] for k in range(CORNERS)]
    bent = [[x, y - 0.05] for x, y in bent]
    (velocity,) = turned([list(flat.flow.velocity_m_per_s)])
    assert flat.flow.shape is not None
    lying: dict[str, Any] = {
        "flow.shape": {"kind": "polygon", "vertices_m": turned(flat.flow.shape.polygon.tolist())},
        "flow.velocity_m_per_s": velocity,
    }
    right = float(flat.flow.shape.polygon[:, 0].max())
    content = flat.resolved()["flow"]["material"]
    denser = content | {"grain_density_kg_per_m3": 1.1 * content["grain_density_kg_per_m3"]}
    box = [[right + 1.0, 0.0], [right + 11.0, 0.0], [right + 11.0, 1.0], [right + 1.0, 1.0]]
    deposit: dict[str, Any] = {"shape": {"kind": "polygon", "vertices_m": box}}
    dry = {"formulation": "dry", "material": {name: content[name] for name in DRY if name in content}}
    level, profile, beside = "gravity tilted", "on a profile of two points", "a deposit before it"
    return {
        level: (tilted, None),
        profile: (flat.replaced(lying | {"ground.profile_m": turned(ends)}), level),
        f"on a profile of {CORNERS} points": (flat.replaced(lying | {"ground.profile_m": turned(bent)}), level),
        beside: (flat.replaced({"flow.deposits": [deposit]}), None),
        "the deposit denser": (flat.replaced({"flow.deposits": [deposit | {"material": denser}]}), beside),
        "the deposit dry": (flat.replaced({"flow.deposits": [deposit | dry]}), beside),
    }


DRY = ("grain_density_kg_per_m3", "porosity", "young_modulus_Pa", "poisson_ratio", "law", "friction_angle_deg")
"""Fields of a material that a dry one has too."""


def turned(corners: Corners) -> Corners:
    """Points turned so that what was level falls by the slope."""
    cosine, sine = math.cos(math.radians(SLOPE)), math.sin(math.radians(SLOPE))
    return [[x * cosine + y * sine, y * cosine - x * sine] for x, y in corners]
