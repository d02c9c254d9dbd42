"""Every recorded or derived quantity, once: name, unit, meaning, label, factor, when it is there, how it is read.

`TIME_SERIES` (columns of `timeseries.csv`), `POINT_FIELDS` (arrays of a snapshot), `DRAWN` (what colours points) and
`figures.FIGURES` (key figures of `summary.json`). A script adds to the first by `register`:

>>> from warp_mpm.quantities import Sampled, register
>>> register(Sampled("front", "m", "foremost point", read=lambda now: now.points()["position"][:, 0].max()))

`docs/develop/add_a_quantity.md` goes through one.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from .quantity import Quantity, Sampled
from .time_series import NAMED, OWN, TIME_SERIES, force_of_surface, further_quantities, quantity_of_column

__all__ = [
    "NAMED",
    "TIME_SERIES",
    "Quantity",
    "Sampled",
    "force_of_surface",
    "further_quantities",
    "quantities_of",
    "quantity_of_column",
    "recorded_quantities",
    "register",
]


SUMMED_UP = ("max", "max_time", "final")
"""Figures of a column that is none of the package's: greatest value, its time [s], last value."""


def register(quantity: Sampled) -> None:
    """Record a quantity of your own in all runs from now on, beside those of the package; another one of its name,
    registered before, gives way to it.

    It is a column of `timeseries.csv`, an entry of `Simulation.sample()`, a chart of the report and of the force
    figure; `summary.json` has its greatest value with the time, and its last. `output.quantities` does not name it.

    Args:
        quantity: its name, unit, meaning and `read`, which takes it from a `warp_mpm.state.samples.Now`.

    Raises:
        ValueError: the name is no name or one of the package's own, or unit or meaning is missing.
    """
    name = quantity.name
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ValueError(f"the quantity's name = {name!r} must be small letters, digits and underscores")
    if name in TIME_SERIES or (name not in OWN and quantity_of_column(name) is not None):
        raise ValueError(f"the quantity {name!r} is one of the package's own; yours must have another name")
    if quantity.key != name:
        raise ValueError(f"the key of the quantity {name!r} = {quantity.key!r} must be its name")
    from .figures import FIGURES

    for figure in SUMMED_UP:
        if f"{name}_{figure}" in FIGURES:
            raise ValueError(f"the quantity {name!r} would make a second {name}_{figure}; give it another name")
    for part in ("unit", "meaning"):
        text = getattr(quantity, part)
        if not text or any(sign in text for sign in ",\n[]" if part == "unit"):
            raise ValueError(f"the {part} of the quantity {name!r} = {text!r} must be words without , [ and ]")
    OWN[name] = quantity


def quantities_of(scenario: Any) -> list[str]:
    """Keys of the quantities that a scene has, in their order, whether they are recorded or not."""
    known = (*TIME_SERIES.items(), *further_quantities(scenario).items(), *OWN.items())
    return [key for key, one in known if one.there(scenario)]


def recorded_quantities(scenario: Any) -> list[str]:
    """Keys of those that its time series has: all, or the time, what `output.quantities` names, what is told of further
    barriers, and what a script registered."""
    chosen: Collection[str] | None = scenario.output.quantities
    keys = quantities_of(scenario)
    if chosen is None:
        return keys
    always = {"time", *further_quantities(scenario), *OWN}
    return [key for key in keys if key in always or _name(key) in chosen]


def left_out(scenario: Any) -> set[str]:
    """Names of those that the scene has and `output.quantities` leaves out."""
    recorded = recorded_quantities(scenario)
    return {_name(key) for key in quantities_of(scenario) if key not in recorded}


def _name(key: str) -> str:
    return TIME_SERIES[key].name if key in TIME_SERIES else key
