"""All cases held against measurements, in the order of the page."""

from __future__ import annotations

from warp_mpm.validation.case import Case
from warp_mpm.validation.measured import debris_flume, field_bounds, fronts, loose_wedge, water_on_a_wall
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
            "water-behind-a-gate",
            "Water on a wall, with the gate and a bed that holds it",
            "The same with the gate lifted at its measured speed, and a bed on which water does not slip.",
            "as above",
            water_on_a_wall.lobovsky_with_gate,
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
        measured_case(
            "debris-flume",
            "Debris in a flume of 95 m",
            "About 10 m³ of sand and gravel, without and with mud, let go at t = 0 down a rough bed of 31° onto a pad "
            "of 2.5°: arrival and depth at 32, 66 and 90 m, normal stress and pore pressure on the bed; the paper's "
            "law at three spacings, and every corner of the published ranges.",
            "Iverson, Logan, LaHusen and Berti (2010), J. Geophys. Res. 115, F03005, ensemble means and deviations; "
            "settings as published for D-Claw",
            debris_flume.debris_flume,
            given,
        ),
        measured_case(
            "debris-flume-dilatancy",
            "Debris in a flume of 95 m, with dilatancy",
            "The same with a skeleton that shrinks as it is sheared, and with a friction that grows with the rate.",
            "as above; Iverson and George (2014)",
            debris_flume.debris_flume_dilatancy,
            given,
        ),
        measured_case(
            "debris-flume-viscous",
            "Debris in a flume of 95 m, with a viscosity of the mixture",
            "The same with dilatancy and a viscosity of the mixture beside the friction of its grains, on the bed's "
            "friction and on a bed that holds.",
            "as above; viscosities measured on coarse debris (Geotechnics 2025, 5(2), 37)",
            debris_flume.debris_flume_viscous,
            given,
        ),
        measured_case(
            "loose-wedge",
            "A loose wedge that liquefied as it failed",
            "About 6 m³ of loose sand and gravel behind a wall on a bed of 31°, brought to failure by water: pore "
            "pressure in its middle and way of its surface, with dilatancy; without it, and dense, beside it.",
            "Iverson and others (2000), Science 290:513; settings as published for D-Claw (George and Iverson 2014)",
            loose_wedge.loose_wedge,
            given,
        ),
        measured_case(
            "field-bounds",
            "Bands from the field: context, no validation",
            "Greatest forces of our fixed barriers over ρ h v², and how far case 1 slides by its conductivity, before "
            "bands from field, centrifuge and guidelines.",
            "Bugnion et al. (2012) and University of Salerno, abstracts; guidelines recalled",
            field_bounds.field_bounds,
            given,
        ),
    )
