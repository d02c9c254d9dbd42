"""All validation cases, in the order of the page."""

from __future__ import annotations

from collections.abc import Sequence

from warp_mpm.validation import (
    at_rest,
    case_one,
    case_one_by_law,
    columns,
    contact,
    corner,
    dilatancy,
    elements,
    free_motion,
    grains_on_a_slope,
    granular,
    jets,
    mud,
    paper,
    paper_forces,
    phases,
    refinement,
    shallow_water,
    sites,
    sliding_blocks,
)
from warp_mpm.validation.case import Case

CASES: tuple[Case, ...] = (
    *elements.CASES,
    *columns.CASES,
    *phases.CASES,
    *contact.CASES,
    *at_rest.CASES,
    *free_motion.CASES,
    *jets.CASES,
    *corner.CASES,
    *shallow_water.CASES,
    *sites.CASES,
    *granular.CASES,
    *mud.CASES,
    *grains_on_a_slope.CASES,
    *sliding_blocks.CASES,
    *case_one_by_law.CASES,
    *dilatancy.CASES,
    *case_one.CASES,
    *refinement.CASES,
    *paper.CASES,
    *paper_forces.CASES,
)


def chosen(names: Sequence[str] | None, *, quick: bool) -> list[Case]:
    """The cases of these names, or all of them; a quick run without names leaves out what has no quick variant.

    Raises:
        ValueError: a name is unknown.
    """
    if names:
        return named(CASES, names)
    return [case for case in CASES if case.in_quick or not quick]


def named(cases: Sequence[Case], names: Sequence[str] | None) -> list[Case]:
    """Those of the cases with these names, or all.

    Raises:
        ValueError: a name is unknown.
    """
    known = {case.name: case for case in cases}
    for name in names or ():
        if name not in known:
            raise ValueError(f"--only {name} is no validation case; it must be one of {', '.join(known)}.")
    return [known[name] for name in dict.fromkeys(names or known)]
