"""The order of a step: which kernels are launched, over what, and with what, as data."""

from __future__ import annotations

from collections.abc import Iterable

from ..effects import Effects
from .launch import Launch

START = Launch("start", "one", ("parameters", "clock", "counters", "running", "bodies", "grid"), "begins an interval")
LEDGER = Launch("ledger", "workers", ("points", "parameters", "bodies", "book"), "sums over the points, for a sample")


def launches(effects: Effects) -> tuple[Launch, ...]:
    """The kernels of a step for `effects`, in their order; a scheme's own ones stand where it says."""
    grid = ("grid", "parameters", "book")
    points = ("points", "grid", "parameters", "bodies", "book")
    step = [
        Launch("clear", "workers", ("grid", "parameters"), "empties the blocks that were in use"),
        Launch("forget", "one", ("grid",), "empties their list"),
        Launch("scatter", "flow", points, "mass, momentum and internal force of the points to the nodes"),
        Launch("move", "workers", grid, "velocities of the nodes at the end of the step, drag included"),
    ]
    seen = ("contact", "bodies", *grid)
    if effects.bodies:
        step.append(Launch("press", "groups", seen, "contact at places that share no node with another"))
    if effects.joined:
        step.append(Launch("join", "lanes", seen, "contact at all others, and bodies that slide"))
    if effects.two_phase:
        step.append(Launch("seep", "workers", grid, "rate at which gravity works on liquid that seeps"))
    step.append(Launch("gather", "flow", ("points", *grid), "velocities, their gradients and strains from the nodes"))
    if effects.smoothing_grid:
        step.append(Launch("average", "workers", ("grid", "parameters"), "means at the corners"))
    takes = ("points", "parameters", "book")
    step.append(Launch("advect", "flow", points, "moves the points"))
    if effects.arriving:
        arriving = ("points", "grid", "parameters", "arrival", "book")
        step += [
            Launch("convey", "one", ("arrival", "book"), "how far what arrives has come"),
            Launch("hold", "flow", arriving, "points on their last cells before the section of an inflow"),
        ]
    step += [
        Launch("update", "points", ("points", "parameters", "clock"), "strain, effective stress and pore pressure"),
        *(
            ()
            if all(law.vectorised for law in effects.laws)
            else (Launch("yielding", "points", takes, "what the law allows"),)
        ),
        Launch("bound", "flow", takes, "limits that few points come to"),
        Launch(
            "tick",
            "one",
            ("parameters", "clock", "counters", "running", "reactions", "left", "balance", "bodies", "grid"),
            "time, the bodies' places and the next step's length",
        ),
    ]
    return _inserted(step, effects.scheme.launches())


def _inserted(step: list[Launch], own: Iterable[tuple[str, Launch]]) -> tuple[Launch, ...]:
    """The step with more launches, each after the kernel that is named with it."""
    for after, launch in own:
        step.insert(1 + [one.kernel for one in step].index(after), launch)
    return tuple(step)
