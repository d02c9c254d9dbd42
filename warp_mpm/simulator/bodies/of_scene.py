"""The bodies that a scenario names, in the order in which they act: ground, edges of the domain, barriers."""

from __future__ import annotations

import numpy as np

from warp_mpm.grid import GridLayout
from warp_mpm.scenario import Barrier, Ground, Prescribed, Scenario, Wall
from warp_mpm.scenario import Sliding as SlidingBarrier
from warp_mpm.scenario.site import all_standing

from .body import Body, Driven, Fixed, Sliding, Surface
from .outline import Array, Outline

BARRIER = "barrier"
"""Name of the scenario's first barrier among the bodies."""

GROUND = "ground"
"""Name of the ground, and of its surface where that is one."""

BENEATH = 8.0
"""Cells below the lowest ground to which barriers go down that stand on a profile: no point gets there."""


def scene_bodies(scenario: Scenario, grid: GridLayout) -> list[Body]:
    """Ground, side walls, ceiling and barriers of `scenario`, those that it has."""
    bodies = []
    if scenario.ground is not None:
        weight = scenario.flow.material.density * scenario.gravity.acceleration_m_per_s2
        bodies.append(ground_body(scenario.ground, weight))
    bodies += _edges(scenario, grid)
    return bodies + barrier_bodies(scenario)


def ground_body(ground: Ground, weight: float = 0.0) -> Body:
    """The ground, with a surface for each stretch: `ground`, or `ground_1` and so on where there are several.

    Args:
        ground: of the scene.
        weight: ρ g of the flow [N/m³], for the part of Voellmy's friction that grows with the speed.
    """
    if ground.level:
        alone = Surface(GROUND, ground.friction, turbulence=weight * ground.drags[0])
        return Body(GROUND, Outline(ground.profile, closed=False), (alone,))
    vertices = ground.profile
    begins = [begin for begin, _ in ground.frictions[1:]]
    for begin in begins:
        if begin not in vertices[:, 0]:
            place = int(np.searchsorted(vertices[:, 0], begin))
            vertices = np.insert(vertices, place, [begin, float(ground.height(begin))], axis=0)
    middle = 0.5 * (vertices[:-1, 0] + vertices[1:, 0])
    # A piece belongs to the last stretch that begins before its middle; an upright step to the one that begins there.
    stretch = np.searchsorted(begins, middle, side="right")
    names = [f"{GROUND}_{number + 1}" for number in range(len(begins) + 1)] if begins else [GROUND]
    surfaces = [
        Surface(name, friction, tuple(int(piece) for piece in np.flatnonzero(stretch == number)), weight * drag)
        for number, (name, (_, friction), drag) in enumerate(zip(names, ground.frictions, ground.drags, strict=True))
    ]
    return Body(GROUND, Outline(vertices, closed=False), tuple(surfaces), dense_corners=True)


def barrier_bodies(scenario: Scenario) -> list[Body]:
    """All barriers of a scene, the first one first.

    On level ground a single barrier is an outline without its base, whose faces go on below the ground; the grid rides
    with it. Any other one is closed by a base below the ground, to which it goes straight down from toe and heel.
    """
    found = []
    for name, x, barrier, standing in all_standing(scenario):
        names = ("impact", "top", "back") if name == BARRIER else (f"{name}_face", f"{name}_top", f"{name}_back")
        rubbing = (barrier.friction.face, barrier.friction.top, barrier.friction.back)
        outline, stretches = _outline_of(scenario, barrier, x, standing)
        surfaces = tuple(map(Surface, names, rubbing, stretches))
        motion: Fixed | Driven | Sliding = Fixed()
        if isinstance(barrier.motion, Prescribed):
            motion = Driven(barrier.motion.times_s, tuple((v, 0.0) for v in barrier.motion.velocities_m_per_s))
        elif isinstance(barrier.motion, SlidingBarrier):
            assert barrier.mass is not None
            motion = Sliding(barrier.mass, barrier.motion.base_friction_coefficient)
        rides = scenario.plain and not isinstance(motion, Fixed)
        found.append(Body(name, outline, surfaces, motion, carries_grid=rides))
    return sorted(found, key=lambda body: body.name != BARRIER)


def _outline_of(
    scenario: Scenario, barrier: Barrier, x: float, standing: Array | None
) -> tuple[Outline, tuple[tuple[int, ...], ...]]:
    """A barrier's outline, and the pieces of face, crest and back, from the bottom of the face on."""
    if standing is None:
        return Outline([[x, 0.0], [x, 1.0]], closed=False), ((0,), (), ())
    if scenario.plain:
        return Outline(standing, closed=False), ((0,), (1,), (2,))
    assert scenario.ground is not None
    assert not isinstance(barrier.shape, Wall)
    first, last = barrier.shape.crest_corners
    if (standing[first] == standing[last]).all():  # a crest without width
        standing = np.delete(standing, np.arange(first, last), axis=0)
        last = first
    deep = scenario.ground.range(*scenario.ground.ends)[0] if not scenario.ground.level else 0.0
    deep = min(deep, float(standing[:, 1].min())) - BENEATH * scenario.numerics.spacing_m
    sides = len(standing) - 1
    vertices = np.concatenate([standing, [[standing[-1, 0], deep], [standing[0, 0], deep]]])
    face = (sides + 2, *range(first))
    return Outline(vertices), (face, tuple(range(first, last)), (*range(last, sides), sides, sides + 1))


def _edges(scenario: Scenario, grid: GridLayout) -> list[Body]:
    domain, spacing = scenario.domain, grid.spacing
    found = []
    if domain.left_edge == "wall":
        x = domain.left_m if domain.left_m is not None else grid.left + 4 * spacing
        found.append(("left_wall", [[x, 1.0], [x, 0.0]]))
    if domain.right_edge == "wall":
        x = domain.right_m if domain.right_m is not None else grid.left + (grid.columns - 4) * spacing
        found.append(("right_wall", [[x, 0.0], [x, 1.0]]))
    if domain.top_edge == "wall":
        y = domain.top_m if domain.top_m is not None else grid.bottom + (grid.rows - 4) * spacing
        found.append(("ceiling", [[1.0, y], [0.0, y]]))
    return [Body(name, Outline(vertices, closed=False), edge=True) for name, vertices in found]
