"""What "stable" means: every demand on a hard case, with its limit and its reason, in one place."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mpm.hard_cases.bounds import voids_close
from warp_mpm.scenario import Scenario


@dataclass(frozen=True)
class Criterion:
    """One figure that a hard case must keep below a limit."""

    figure: str
    """Key in `Measured.figures`."""
    limit: float
    single_precision_limit: float
    meaning: str
    """What the figure is, and where its limit comes from."""

    def limit_for(self, scenario: Scenario) -> float:
        """Limit for the precision in which `scenario` is computed; none where theory has the voids close."""
        if self.figure == "voids_closed_share" and voids_close(scenario):
            return 1.0
        return self.limit if scenario.numerics.precision == "float64" else self.single_precision_limit


CRITERIA = (
    Criterion(
        "diverged", 0.0, 0.0, "1 where the run ended early because a quantity was no longer a number or in range"
    ),
    Criterion(
        "mass_error",
        1e-12,
        1e-6,
        "greatest change of the mass, inside and departed together, less what has arrived, over it; rounding of the "
        "sum",
    ),
    Criterion(
        "momentum_error",
        1e-9,
        1e-3,
        "greatest momentum that no recorded impulse explains, over the greatest of the flow's momentum and the impulse "
        "of its weight; rounding summed over all steps",
    ),
    Criterion(
        "energy_error",
        0.01,
        0.01,
        "greatest energy above what was put in (start, gravity, a driven barrier, an inflow), over the energy put in; "
        "plastic flow, drag, friction and the transfer only take energy away",
    ),
    Criterion(
        "speed_ratio",
        1.0,
        1.0,
        "greatest speed over that of the jet where the flow closes on a surface (`bounds.speed_bound`): energy gives "
        "the speed of the impact, wave theory the pressure, Bernoulli the jet",
    ),
    Criterion(
        "pressure_ratio",
        1.0,
        1.0,
        "greatest pore pressure over that behind the shock that stops the fastest point, in a corner, and rho g h "
        "(`bounds.pressure_bound`): water hammer at low speed, stagnation at high",
    ),
    Criterion(
        "stress_ratio",
        1.0,
        1.0,
        "greatest principal effective stress over the same at the speed that energy gives at least, and 2 c that "
        "cohesion bears; not of an elastic material, whose stress is singular at a corner",
    ),
    Criterion(
        "penetration",
        0.5 + 1e-12,
        0.5 + 1e-5,
        "deepest material point inside the barrier, the ground or a wall, in cells: half a cell is what the grid "
        "resolves, and rounding of the place; a point any deeper is set back, see pushed_share",
    ),
    Criterion(
        "porosity_low",
        1e-12,
        1e-6,
        "least porosity by volume, below zero: -min(n); rounding, since grains keep their volume",
    ),
    Criterion("porosity_high", 1.0, 1.0, "greatest porosity of any material point"),
    Criterion(
        "yield_excess",
        1e-9,
        1e-4,
        "greatest distance of a stress outside Mohr-Coulomb and the cut-off, over the greatest stress of the run; "
        "rounding (single precision: of the stress before it is brought back)",
    ),
    Criterion(
        "pressure_noise",
        0.25,
        0.25,
        "median over the snapshots of the rms difference between a point's pressure and the mean of its cell, less the "
        "gradient at rest, over the rms pressure or rho g h, whichever is greater: a quarter of the signal",
    ),
    Criterion(
        "halving_peak_force",
        0.02,
        0.02,
        "change of the filtered peak force when the time step is halved, over that force or a tenth of rho v² h",
    ),
    Criterion(
        "pushed_share",
        1e-3,
        1e-3,
        "share of points and steps in which a point deeper than half a cell in a solid was set back to that depth",
    ),
    Criterion(
        "gaps_bounded_share",
        0.2,
        0.2,
        "the same in which the gap of a point was cut to the room between its neighbours; only of material in flight",
    ),
    Criterion(
        "voids_closed_share",
        0.01,
        0.01,
        "the same in which a point had no voids left, so that the law of the skeleton acted on the grains' volume; not "
        "asked where the impact or the weight must close them (`bounds.voids_close`)",
    ),
    Criterion(
        "unconverged_share",
        5e-3,
        5e-3,
        "share of steps in which the last of a hundred sweeps still changed the barrier's velocity by more than a "
        "thousandth of itself and of what its weight could give it in the step",
    ),
    Criterion(
        "halving_displacement",
        0.02,
        0.02,
        "change of the barrier's final displacement when the time step is halved, over that or a cell",
    ),
)
"""All demands. One that does not apply to a scene (no barrier, dry) has no figure and is passed over."""
