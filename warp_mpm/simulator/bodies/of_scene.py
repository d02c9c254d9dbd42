"""The bodies that a scenario names, in the order in which they act: ground, edges of the domain, barrier."""

from __future__ import annotations

from warp_mpm.grid import GridLayout
from warp_mpm.scenario import Barrier, Prescribed, Scenario, Trapezoid
from warp_mpm.scenario import Sliding as SlidingBarrier

from .body import Body, Driven, Fixed, Sliding, Surface
from .outline import Outline

BARRIER = "barrier"
"""Name of the scenario's barrier among the bodies."""


def scene_bodies(scenario: Scenario, grid: GridLayout) -> list[Body]:
    """Ground, side walls, ceiling and barrier of `scenario`, those that it has."""
    bodies = []
    if scenario.ground is not None:
        level = Outline([[-1.0, 0.0], [1.0, 0.0]], closed=False)
        bodies.append(Body("ground", level, (Surface("ground", scenario.ground.friction),)))
    bodies += _edges(scenario, grid)
    if scenario.barrier is not None:
        bodies.append(barrier_body(scenario.barrier))
    return bodies


def barrier_body(barrier: Barrier) -> Body:
    """The barrier: an outline without its base, whose faces go on below the ground."""
    names = {"impact": barrier.friction.face, "top": barrier.friction.top, "back": barrier.friction.back}
    if isinstance(barrier.shape, Trapezoid):
        outline = Outline(barrier.shape.polygon, closed=False)
        stretches: tuple[tuple[int, ...], ...] = ((0,), (1,), (2,))
    else:
        outline = Outline([[0.0, 0.0], [0.0, 1.0]], closed=False)
        stretches = ((0,), (), ())
    surfaces = tuple(Surface(*named, pieces) for named, pieces in zip(names.items(), stretches, strict=True))
    motion: Fixed | Driven | Sliding = Fixed()
    if isinstance(barrier.motion, Prescribed):
        motion = Driven(barrier.motion.times_s, tuple((v, 0.0) for v in barrier.motion.velocities_m_per_s))
    elif isinstance(barrier.motion, SlidingBarrier):
        assert barrier.mass is not None
        motion = Sliding(barrier.mass, barrier.motion.base_friction_coefficient)
    return Body(BARRIER, outline, surfaces, motion, carries_grid=not isinstance(motion, Fixed))


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
