"""The effects that a scene calls for: the only thing that kernels are specialised on."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Literal

from .simulator.laws import DEFAULT, LAWS, Law
from .simulator.schemes import SCHEMES, Scheme

LONGEST_NAME = 220
"""Characters of a module's name: file systems take 255, and Warp adds a hash and an ending."""


@dataclass(frozen=True)
class Effects:
    """What is simulated, and nothing else: an effect that is off is not compiled, not launched and has no arrays.

    Two scenes with equal effects share their compiled kernels, whatever their sizes and material constants.
    """

    formulation: Literal["dry", "undrained", "two_phase"]
    """Dry and undrained: one velocity field. Two-phase: solid and liquid velocities (a_S-a_L formulation)."""
    precision: Literal["float64", "float32"] = "float64"
    """Scalar type of points and grid; time, ledger and barrier are float64 throughout."""
    law: str = DEFAULT
    """Key of the law of the skeleton."""
    volumetric_smoothing: bool = True
    """Volume strain rates averaged over the cells' corners (anti-locking)."""
    density_correction: bool = False
    """Points that crowd beyond the room there is are compressed, so that pressure makes them spread again."""
    pressure_relaxation: bool = True
    """Excess pore pressure drawn toward its grid projection at a given rate."""
    bulk_viscosity: bool = False
    """Artificial viscosity on compression, against ringing behind a front of sound."""
    transfer: str = "flip"
    """Key of the scheme that brings velocities from the points to the nodes and back."""
    drag: Literal["none", "semi_implicit", "explicit"] = "none"
    """Interaction of the phases; only with two of them."""
    porosity_update: bool = False
    """Porosity follows the skeleton's volume strain; off: Dn/Dt = 0, Eq. (A11)."""
    barrier: Literal["none", "fixed", "sliding", "driven"] = "none"
    """Driven: its velocity is given, as a table of the scene or from outside during the run."""
    barrier_friction: bool = False
    ground: Literal["none", "smooth", "frictional"] = "none"
    side_walls: bool = False
    """Smooth vertical walls at the left or right edge of the domain."""
    ceiling: bool = False
    """Smooth wall at the upper edge of the domain."""

    @property
    def liquid(self) -> bool:
        """Pore pressure exists."""
        return self.formulation != "dry"

    @property
    def skeleton(self) -> Law:
        """The law of the skeleton."""
        return LAWS.keyed(self.law)

    @property
    def scheme(self) -> Scheme:
        """The transfer scheme."""
        return SCHEMES.keyed(self.transfer)

    @property
    def two_phase(self) -> bool:
        return self.formulation == "two_phase"

    @property
    def smoothing_grid(self) -> bool:
        """The grid of cell corners exists."""
        return self.volumetric_smoothing or self.pressure_relaxation

    @property
    def friction(self) -> bool:
        """Some surface rubs on the flow, so that the effective normal force is needed."""
        return self.barrier_friction or self.ground == "frictional"

    @property
    def liquid_alone(self) -> bool:
        """Friction follows the effective normal force, so that the nodes tell what the liquid would do alone."""
        return self.friction and self.liquid

    @property
    def module_name(self) -> str:
        """Name of the Warp module: one per set of effects."""
        flags: list[str] = [
            self.formulation,
            self.precision,
            self.law,
            self.transfer,
            self.drag,
            self.barrier,
            self.ground,
        ]
        flags += [
            name
            for name in (
                "volumetric_smoothing",
                "density_correction",
                "pressure_relaxation",
                "porosity_update",
                "barrier_friction",
                "side_walls",
                "ceiling",
                "bulk_viscosity",
            )
            if getattr(self, name)
        ]
        name = "warp_mpm." + "-".join(flags)
        if len(name) > LONGEST_NAME:  # of a file, with what Warp adds to it
            name = name[: LONGEST_NAME - 17] + "-" + hashlib.sha256(name.encode()).hexdigest()[:16]
        return name
