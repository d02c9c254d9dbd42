"""What keeps hard scenes stable, which scene needs each safeguard, and what no safeguard helps."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Safeguard:
    """One measure against instability."""

    name: str
    action: str
    without: str
    """What fails when it is switched off."""


SAFEGUARDS = (
    Safeguard(
        "volumetric smoothing",
        "volume strain rates are means over the corners of the cells",
        "`bulk_modulus_2e9`: volumetric locking; the pressure noise grows to half the signal",
    ),
    Safeguard(
        "pressure relaxation",
        "the part of the excess pressure that the grid does not see decays",
        "`face_90`: the pressure noise doubles and more",
    ),
    Safeguard(
        "bound on gaps",
        "a point that has parted from the flow remembers no more void than its neighbours leave",
        "`set_iib`: after the landing nine points in ten keep a gap, and the deposit loses half its pore pressure",
    ),
    Safeguard(
        "bulk viscosity",
        "artificial pressure against compression at the rate of sound",
        "a column stopped at its base: the pressure behind the front of sound overshoots by a quarter",
    ),
    Safeguard(
        "implicit drag",
        "the exchange between the phases is solved at the end of the step",
        "`conductivity_1e-9`: explicit drag at the same time step diverges within a few steps; at its own stable step "
        "it would need thousands of times as many",
    ),
    Safeguard(
        "implicit barrier",
        "the barrier's velocity and the flow's reaction are found together",
        "`resting` with a barrier of 1 kg/m: moved by the force of the step before, it is shot off at over 50 m/s; "
        "found together, it starts at less than 0.5 m/s",
    ),
    Safeguard(
        "divergence check",
        "every velocity each step, every quantity at each sample",
        "a stress or pressure that is no number: its points would leave in silence, or stay at zero pressure",
    ),
    Safeguard(
        "grid bounds at the next position",
        "a point is kept only where the grid, which rides with the barrier, will lie in the next step",
        "a barrier driven at 3 km/s: writing beside the grid ends the process",
    ),
)

KNOWN_LIMITS = (
    "Points rest up to 0.58 cells deep in a face at 89° for moments, 0.5 at the snapshots: between two columns of "
    "nodes the contact's own reach varies by half a cell. Penetration halves with the spacing, in metres.",
    "Over a barrier lower than the flow (`low_barrier`) the displacement changes by 13 % when the time step is halved "
    "at two cells of barrier height, 8 to 12 % at four, 5 % at eight; the peak force by 8, 3 and 2 %: the transfer "
    "dissipates per step, less on finer grids.",
    "Where a jet lands, single points meet the ground at up to half of the bound that their water hammer sets, for a "
    "few milliseconds. "
    "The figure `pore_pressure_max` of a run leaves them out, `pore_pressure_max_anywhere` holds them.",
    "The skeleton's stiffness is linear: a soft one of little porosity (0.05, below 1 MPa) is pressed beyond its voids "
    "by an impact, porosity by volume below zero. The run stays stable, the material law has no answer.",
    "A dry flow onto a wet deposit cannot be stated: a scene holds one material.",
    "Bit-for-bit continuation is promised on the processor only: on a GPU sums have no fixed order.",
)
"""Found by the collection and not mended."""

KNOWN_FAILURES = {"low_barrier": frozenset({"halving_displacement"})}
"""Criteria that a case is known not to meet, each explained in `KNOWN_LIMITS`."""
