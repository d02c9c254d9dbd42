"""All validation cases, in the order of the page."""

from __future__ import annotations

from collections.abc import Sequence

from warp_mpm.validation import (
    at_rest,
    case_one,
    columns,
    contact,
    elements,
    free_motion,
    granular,
    jets,
    paper,
    phases,
    refinement,
    rheology,
    shallow_water,
    sites,
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
    *shallow_water.CASES,
    *sites.CASES,
    *granular.CASES,
    *rheology.CASES,
    *case_one.CASES,
    *refinement.CASES,
    *paper.CASES,
)


def chosen(names: Sequence[str] | None, *, quick: bool) -> list[Case]:
    """The cases of these names, or all of them; a quick run without names leaves out what has no quick variant.

    Raises:
        ValueError: a name is unknown.
    """
    known = {case.name: case for case in CASES}
    for name in names or ():
        if name not in known:
            raise ValueError(f"--only {name} is no validation case; it must be one of {', '.join(known)}.")
    cases = [known[name] for name in dict.fromkeys(names or ())]
    return cases or [case for case in CASES if case.in_quick or not quick]
