"""Sentences on what a reader must know before he trusts a scene or its figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from warp_mpm.extent import domain_caveats
from warp_mpm.quantities.quantity import of_width
from warp_mpm.scenario import Prescribed, Scenario, Sliding, UndrainedMaterial
from warp_mpm.simulator.laws import LAWS
from warp_mpm.slips import slips

Key = TypeVar("Key")

LEAST_CELLS = 4.0
"""Cells over the flow's depth below which even peak forces were a tenth off (case 1 at 3.75: 11 %)."""

GREATEST_FRICTION = 2.0
"""Friction coefficient, that is 63°, above which no rock rubs on another."""

RIDGE_DEPTH, RIDGE_WIDTH = 2.0, 0.5
"""Cells below its top at which a ridge is looked at, and how thick it must be there: one of 0.13 had the flow's energy
grow sevenfold, one of 0.6 had none appear."""

GREATEST_STRAIN = 0.1
"""Compression at rest by the flow's own weight above which a modulus looks like a slip."""

BOUNDS = {
    "float64": {"mass_error": 1e-9, "momentum_error": 1e-6, "energy_error": 0.02},
    "float32": {"mass_error": 1e-4, "momentum_error": 1e-3, "energy_error": 0.02},
}
"""Greatest relative errors of the ledger that call for no remark, by precision."""


def scene_caveats(scenario: Scenario) -> list[str]:
    """What looks like a slip in a scene that could be run; before it is."""
    flow, found = scenario.flow, []
    cells = flow.depth / scenario.numerics.spacing_m
    if cells < LEAST_CELLS * (1.0 - 1e-9):
        found.append(
            f"The flow's depth has {cells:.2g} cells; below {LEAST_CELLS:g} (numerics.spacing_m = "
            f"{flow.depth / LEAST_CELLS:.3g}) expect figures to be off by a tenth and more."
        )
    found += slips(scenario)
    found += LAWS.named(flow.material.law).caveats(flow.material)
    found += [
        *_unlikely_friction(scenario),
        *_impossible_start(scenario),
        *_abrupt_inflow(scenario),
        *_thin_ridges(scenario),
    ]
    uneven = scenario.ground is not None and scenario.ground.profile_m is not None
    if scenario.barrier is not None and not uneven and not _can_arrive(scenario):
        driven = isinstance(scenario.barrier.motion, Prescribed)
        found.append(
            f"The flow does not get to the barrier by t = {scenario.output.end_time_s:g} s; look at "
            + ("flow.inflow, " if flow.inflow is not None else "flow.velocity_m_per_s, the flow's distance, ")
            + ("barrier.motion.velocities_m_per_s, " if driven else "")
            + "gravity.tilt_deg and output.end_time_s."
        )
    return [*found, *domain_caveats(scenario)]


def _thin_ridges(scenario: Scenario) -> list[str]:
    """Ridges of the ground that no grid resolves."""
    if scenario.ground is None or scenario.ground.level:
        return []
    x, y = scenario.ground.profile.T
    spacing, found = scenario.numerics.spacing_m, []
    for top in range(1, len(x) - 1):
        level = y[top] - RIDGE_DEPTH * spacing
        if y[top] < max(y[top - 1], y[top + 1]) or y[top] == y[top - 1]:
            continue
        left, right = top, top
        while left > 0 and y[left] > level:
            left -= 1
        while right < len(x) - 1 and y[right] > level:
            right += 1
        if max(y[left], y[right]) <= level:
            begin = np.interp(level, y[left : left + 2], x[left : left + 2])
            thick = float(np.interp(level, y[right - 1 : right + 1][::-1], x[right - 1 : right + 1][::-1]) - begin)
            if thick < RIDGE_WIDTH * spacing:
                found.append((float(x[top]), thick))
    if not found:
        return []
    place, thick = found[0]
    others = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return [
        f"The ground's ridge at x = {place:g} m{others} is {thick:.2g} m thick {RIDGE_DEPTH:g} cells below its top; "
        f"less than {RIDGE_WIDTH:g} cells do not part the flow on its two sides, and energy may appear there. Take its "
        "top out of ground.profile_m."
    ]


def _abrupt_inflow(scenario: Scenario) -> list[str]:
    """Where what approaches a section stretches less than its table asks for."""
    inflow = scenario.flow.inflow
    if inflow is None:
        return []
    asked, most = inflow.slackening, inflow.most_stretch(scenario.gravity.acceleration_m_per_s2)
    beyond = np.flatnonzero((inflow.depths > 0.0) & (np.abs(asked) > most * (1.0 + 1e-9)))
    if not len(beyond):
        return []
    first = beyond[0]
    return [
        f"flow.inflow: the velocity changes so fast at t = {inflow.times[first]:g} s that what approaches the section "
        f"would stretch by {asked[first]:.3g} of its length a second; {most[first]:.3g} is the most that is followed, "
        "and the flow makes up for the rest once it is let go."
    ]


def _unlikely_friction(scenario: Scenario) -> list[str]:
    """Surfaces that are rougher than any."""
    given: dict[str, float | None] = {"ground.friction": scenario.ground.friction if scenario.ground else None}
    for number, stretch in enumerate(scenario.ground.stretches if scenario.ground else ()):
        given[f"ground.stretches[{number}].friction"] = stretch.friction
    for number, further in enumerate(scenario.barriers):
        given |= {
            f"barriers[{number}].friction.{name}": getattr(further.friction, name) for name in ("face", "top", "back")
        }
    if scenario.barrier is not None:
        rubbing = scenario.barrier.friction
        given |= {f"barrier.friction.{name}": getattr(rubbing, name) for name in ("face", "top", "back")}
        if isinstance(scenario.barrier.motion, Sliding):
            given["barrier.motion.base_friction"] = scenario.barrier.motion.base_friction_coefficient
    high = {name: value for name, value in given.items() if value is not None and value > GREATEST_FRICTION}
    if not high:
        return []
    told = ", ".join(f"{name} = {value:g}" for name, value in high.items())
    angle = math.degrees(math.atan(max(high.values())))
    meant = ", ".join(f"{math.tan(math.radians(value)):.2g}" for value in high.values())
    return [
        f"{told}: a friction coefficient above {GREATEST_FRICTION:g}, up to {angle:.0f}°; rock has about 0.6. Where "
        f"degrees were meant, it is their tangent: {meant}."
    ]


def _impossible_start(scenario: Scenario) -> list[str]:
    """What the initial stress asks of the material that it cannot bear."""
    flow, material = scenario.flow, scenario.flow.material
    if flow.initial_stress != "geostatic":
        return []
    found = []
    # What the liquid bears of the weight as a density, where it is least and where it is most.
    liquid = most_liquid = material.liquid_density_kg_per_m3 if isinstance(material, UndrainedMaterial) else 0.0
    if flow.pore_pressure_ratio_range is not None:
        liquid, most_liquid = (ratio * material.density for ratio in flow.pore_pressure_ratio_range)
    head = -scenario.gravity.vector[1] * flow.depth
    vertical = (material.density - liquid) * head  # at the base, compression positive
    for field, modulus, pressure, what in (
        ("young_modulus_Pa", material.oedometric_modulus, abs(vertical), "effective stress"),
        (
            "liquid_bulk_modulus_Pa",
            getattr(material, "liquid_bulk_modulus_Pa", math.inf),
            most_liquid * head,
            "pressure",
        ),
    ):
        if pressure > GREATEST_STRAIN * modulus:
            found.append(
                f"flow.material.{field} = {getattr(material, field):g} is too soft for the {what} of "
                f"{pressure / 1e3:.3g} kPa under the flow, which compresses it by more than {GREATEST_STRAIN:.0%} at "
                "rest."
            )
    law = LAWS.named(material.law)
    if vertical < 0.0:
        if law.opens:
            found.append(
                f"The mixture, {material.density:g} kg/m³, is lighter than its liquid "
                "(flow.material.liquid_density_kg_per_m3 = "
                f"{liquid:g}): the skeleton starts in tension, outside the yield surface, and the first step changes "
                "it."
            )
        return found
    least, most = law.lateral_stress_range(material, vertical)
    if not least * (1.0 - 1e-9) <= flow.lateral_stress_ratio <= most * (1.0 + 1e-9):
        found.append(
            f"The initial stress lies outside the yield surface: flow.lateral_stress_coefficient = "
            f"{flow.lateral_stress_ratio:g}, where the law {law.name} bears {least:.3g} to {most:.3g}; the first step "
            "changes it."
        )
    return found


def _can_arrive(scenario: Scenario) -> bool:
    """No front is faster than one that slides without friction and spreads as a dam break does, 2 √(g h) ahead. A
    driven barrier comes to meet it, or flees, and one that slides by its own weight may come to meet it."""
    flow, end = scenario.flow, scenario.output.end_time_s
    acceleration, _ = scenario.gravity.vector
    x, y = flow.polygon.T
    along, across = flow.velocity_m_per_s
    begin = 0.0
    if flow.inflow is not None:
        along = max(along, flow.inflow.greatest_speed)
        begin = flow.inflow.times[0] if flow.shape is None else 0.0
    speed = along + abs(across) + 2.0 * math.sqrt(scenario.gravity.acceleration_m_per_s2 * float(np.ptp([0.0, *y])))
    # Where gravity holds it back, a front is farthest before the end.
    farthest = speed / -acceleration if speed > 0.0 > acceleration else math.inf
    time = np.linspace(0.0, end, 401)
    going = np.clip(time - begin, 0.0, farthest)
    front = float(x.max()) + speed * going + 0.5 * acceleration * going**2
    # From there it goes back, unless the ground holds it.
    held = scenario.ground.friction * -scenario.gravity.vector[1] if scenario.ground is not None else 0.0
    front += 0.5 * min(acceleration + held, 0.0) * np.maximum(time - begin - farthest, 0.0) ** 2
    face = np.zeros(len(time))  # where it starts
    motion = scenario.barrier.motion if scenario.barrier is not None else None
    if isinstance(motion, Prescribed):
        velocity = np.interp(time, motion.times_s, motion.velocities_m_per_s)
        face[1:] = np.cumsum(0.5 * (velocity[1:] + velocity[:-1])) * (end / (len(time) - 1))
    elif isinstance(motion, Sliding):
        # Where the ground falls upstream, its own weight may pull it to the flow.
        held = motion.base_friction_coefficient * -scenario.gravity.vector[1]
        face = 0.5 * min(acceleration + held, 0.0) * time**2
    return bool((front >= face - scenario.numerics.spacing_m).any())


def run_caveats(record: Mapping[str, Any], summary: Mapping[str, Any]) -> list[str]:
    """What the figures of a run do not tell by themselves.

    Args:
        record: of the run folder (run.json).
        summary: its key figures.
    """
    found = []
    if record.get("git_changed"):
        found.append("The program's source differed from its commit when this was run.")
    if record.get("points_left"):
        left = summary.get("left_volume") or 0.0
        found.append(f"{record['points_left']:,} material points ({left:.3g} {of_width('m³')}) left the domain.")
    if record.get("barrier_unconverged"):
        found.append(f"The barrier's motion was not solved to its tolerance in {record['barrier_unconverged']} steps.")
    precision = record.get("effects", {}).get("precision", "float64")
    for name, bound in BOUNDS[precision].items():
        value = summary.get(name)
        if value is not None and not value <= bound:  # one that is no number calls for a remark
            found.append(f"{name} = {value:.2g} is above {bound:g}.")
    unknown = summary.get("not_recorded") or {}
    if unknown:
        needed = sorted({name for names in unknown.values() for name in names})
        found.append(
            f"Not known, because output.quantities leaves out {', '.join(needed)}: {', '.join(sorted(unknown))}."
        )
    if summary.get("peak_force") == 0.0:
        found.append("The flow did not touch the barrier.")
    displacement = summary.get("barrier_displacement_final")
    if summary.get("barrier_at_rest") is not None and displacement is not None and displacement < 0.0:
        found.append(f"The barrier slid upstream, by {-displacement:.3g} m: displacement and velocity are negative.")
    if summary.get("barrier_at_rest") is False:
        found.append(
            f"The barrier still slides at {summary['barrier_velocity_final']:.3g} m/s at the end of the run: its "
            "displacement is not final."
        )
    if summary.get("force_still_rises"):
        found.append(
            "The force still rises at the end of the run: its peak is not known; force, impulse, displacement, "
            "volumes and mechanism are those so far."
        )
    elif impact_goes_on(summary):
        found.append(
            "The impact is not over at the end of the run: its duration is not known; impulse, volumes and mechanism "
            "are those so far."
        )
    return found


def told_of(notes: Mapping[Key, Sequence[str]]) -> list[tuple[str, list[Key]]]:
    """Each sentence once, with all of which it is told."""
    found: dict[str, list[Key]] = {}
    for name, sentences in notes.items():
        for sentence in sentences:
            found.setdefault(sentence, []).append(name)
    return list(found.items())


def impact_goes_on(summary: Mapping[str, Any]) -> bool:
    """The force on the face still rises or falls at the end of the run."""
    return bool(summary.get("peak_force")) and summary.get("impact_end_time") is None
