"""The order of a step: which kernels are launched, over what, and with what, as data."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from ..effects import Effects


@dataclass(frozen=True)
class Launch:
    """One launch of a kernel."""

    kernel: str
    over: Literal["one", "workers", "points", "rows", "columns", "contacts"]
    """What its threads count: workers share the blocks of the grid in use."""
    takes: tuple[str, ...]
    """Its arguments, by the names under which the simulation knows them."""
    does: str
    """What it does, in a clause."""


def launches(effects: Effects) -> tuple[Launch, ...]:
    """The kernels of a step for `effects`, in their order; a scheme's own ones stand where it says."""
    grid = ("grid", "parameters", "clock")
    points = ("points", *grid)
    step = [
        Launch("clear", "workers", ("grid", "parameters"), "empties the blocks that were in use"),
        Launch("forget", "one", ("grid",), "empties their list"),
        Launch("scatter", "points", points, "mass, momentum and internal force of the points to the nodes"),
        Launch("move", "workers", grid, "velocities of the nodes at the end of the step, drag included"),
    ]
    if effects.ground != "none":
        step.append(Launch("ground", "workers", (*grid, "reactions"), "contact with the ground"))
    if effects.side_walls:
        step.append(Launch("side_walls", "rows", (*grid, "reactions"), "contact with the walls at the sides"))
    if effects.ceiling:
        step.append(Launch("ceiling", "columns", (*grid, "reactions"), "contact with the wall above"))
    if effects.barrier != "none":
        step.append(Launch("collect", "contacts", ("contact", *grid), "what the barrier's surface sees of the flow"))
        if effects.barrier == "sliding":
            mover = ("contact", "contact_count", "parameters", "clock", "counters")
            step.append(Launch("slide", "one", mover, "the barrier's velocity, together with the contact"))
        step.append(Launch("barrier", "contacts", ("contact", *grid, "reactions"), "contact with the barrier"))
    step.append(Launch("gather", "points", points, "velocities and their gradients to the points, strains to corners"))
    if effects.smoothing_grid:
        step.append(Launch("average", "workers", ("grid", "parameters"), "means at the corners"))
    takes = ("points", "parameters", "clock")
    step += [
        Launch("advect", "points", (*points, "counters", "left"), "moves the points"),
        Launch("update", "points", takes, "strain, effective stress and pore pressure"),
        *(() if effects.skeleton.vectorised else (Launch("yielding", "points", takes, "what the law allows"),)),
        Launch("bound", "points", takes, "limits that few points come to"),
        Launch(
            "tick",
            "one",
            ("parameters", "clock", "counters", "running", "reactions", "left", "times", "velocities"),
            "time, the barrier's place and the next step's length",
        ),
    ]
    return _inserted(step, effects.scheme.launches())


def _inserted(step: list[Launch], own: Iterable[tuple[str, Launch]]) -> tuple[Launch, ...]:
    """The step with more launches, each after the kernel that is named with it."""
    for after, launch in own:
        step.insert(1 + [one.kernel for one in step].index(after), launch)
    return tuple(step)
