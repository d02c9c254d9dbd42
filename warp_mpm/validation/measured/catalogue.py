"""All cases held against measurements, in the order of the page."""

from __future__ import annotations

from warp_mpm.validation.case import Case
from warp_mpm.validation.measured import fronts, water_on_a_wall
from warp_mpm.validation.measured.given import Given, measured_case


def measured_cases(given: Given) -> tuple[Case, ...]:
    """The cases, each to be run as it is given."""
    return (
        measured_case(
            "water-on-a-wall",
            "Water on a wall",
            "A column of water of 0.6 × 0.3 m runs over a dry bed of 1.01 m onto a wall: pressures at four heights, "
            "front, levels at four gauges; three spacings.",
            "Lobovský, Botia-Vera, Castellana, Mas-Soler and Souto-Iglesias (2014), J. Fluids Struct. 48:407–434, 100 "
            "repeats; numbers as transcribed in public repositories",
            water_on_a_wall.lobovsky,
            given,
        ),
        measured_case(
            "buchner-wall",
            "Water on a wall, another tank",
            "The same proportions at H = 0.6 m, with sensors of 90 mm at 160 and 584 mm.",
            "Buchner (2002), as digitised from Marrone et al. (2011), Fig. 5, ± 0.02 of p*",
            water_on_a_wall.buchner,
            given,
        ),
        measured_case(
            "fronts",
            "Fronts of collapsing columns",
            "Columns of water as wide as deep, and half as wide, collapse on a dry bed.",
            "Martin and Moyce (1952), Koshizuka and Oka (1996), Lobovský et al. (2014)",
            fronts.fronts,
            given,
        ),
    )
