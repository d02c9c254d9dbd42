"""The effects that a scene calls for: the only thing that kernels are specialised on."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from .simulator.laws import DEFAULT, LAWS, Law
from .simulator.point_field import PointField
from .simulator.schemes import SCHEMES, Scheme

LONGEST_NAME = 200
"""Characters of a module's name: file systems take 255, and Warp adds a hash and an ending."""


@dataclass(frozen=True)
class Kind:
    """What the kernels over points of one material depend on beside what is common to the scene."""

    law: str
    """Key of the law of its skeleton."""
    wet: bool
    """Its voids are full of liquid."""
    dilatancy: bool = False

    def __str__(self) -> str:
        return "-".join([self.law, *(["wet"] if self.wet else ["dry"]), *(["dilatancy"] if self.dilatancy else [])])


@dataclass(frozen=True)
class Effects:
    """What is simulated, and nothing else: an effect that is off is not compiled, not launched and has no arrays.

    Two scenes with equal effects share their compiled kernels, whatever their sizes and material constants.
    """

    formulation: Literal["dry", "undrained", "two_phase"]
    """Dry and undrained: one velocity field. Two-phase: solid and liquid velocities (a_S-a_L formulation)."""
    dimensions: Literal[2, 3] = 2
    """2: plane strain, per metre of width. 3: a section that goes on along z (`warp_mpm.channel`)."""
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
    inertial_drag: bool = False
    """Drag beyond Darcy's, with the square of the slip; implicit, whatever `drag` is."""
    porosity_update: bool = False
    """Porosity follows the skeleton's volume strain; off: Dn/Dt = 0, Eq. (A11)."""
    conductivity: Literal["constant", "kozeny_carman", "exponential"] = "constant"
    """How the conductivity follows the porosity, which is updated; constant: not at all."""
    dilatancy: bool = False
    """Sheared, the skeleton swells or shrinks toward a solid fraction of equilibrium."""
    bodies: bool = False
    """Something solid is there: ground, walls, a barrier."""
    friction: bool = False
    """Some surface rubs on the flow, so that the effective normal force is needed."""
    turbulence: bool = False
    """Some surface rubs with the square of the slip besides (Voellmy)."""
    sliding: bool = False
    """Some body slides on its base: its velocity is found together with the contact."""
    driven: bool = False
    """Some body's velocity is given, as a table or from outside during the run."""
    joined: bool = False
    """Some places of contact share nodes, or act on a body that slides: their impulses are found together."""
    passing: bool = False
    """Some body moves relative to the grid, so that its places of contact are found anew in every step."""
    arriving: bool = False
    """Some of the flow arrives at a section during the run."""
    materials: bool = False
    """Materials differ in what a node must know of them per mass of the solid, so that the points tell it."""
    unlike_porosity: bool = False
    """Wet materials of two phases differ in porosity, so that nodes share the pressure out by their own."""
    kinds: tuple[Kind, ...] = ()
    """Kinds of the scene's materials, that of the flow first, where there are several; `law` is then that of the first,
    the formulation that of the wettest, and a scene dilates where one of them does."""
    profile: bool = False
    """The ground has many pieces, of which a point looks at those about its column of the grid alone."""

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
    def of_kinds(self) -> tuple[Effects, ...]:
        """What kernels over the points of each kind of material are specialised on: these effects where there is one
        kind, and of a dry one in a wet scene those of a dry scene."""
        if not self.kinds:
            return (self,)
        dry: dict[str, Any] = {"formulation": "dry", "pressure_relaxation": False, "drag": "none"}
        dry |= {"inertial_drag": False, "porosity_update": False, "conductivity": "constant"}
        return tuple(
            replace(self, kinds=(), law=kind.law, dilatancy=kind.dilatancy, **({} if kind.wet else dry))
            for kind in self.kinds
        )

    @property
    def laws(self) -> list[Law]:
        """The laws of all skeletons, each once."""
        return [LAWS.keyed(key) for key in dict.fromkeys([kind.law for kind in self.kinds] or [self.law])]

    @property
    def told_to_nodes(self) -> tuple[str, ...]:
        """What points of other materials than the flow's tell the nodes: of what nodes otherwise know, per mass of the
        solid, from the scene."""
        if not self.materials:
            return ()
        of_phases = ("liquid", "drag", *(["drag_beyond"] if self.inertial_drag else [])) if self.two_phase else ()
        return (*of_phases, *(["filling"] if self.liquid_alone or self.unlike_porosity else []))

    @property
    def partly_dry(self) -> bool:
        """Some points hold liquid and some do not."""
        return self.liquid and any(not kind.wet for kind in self.kinds)

    @property
    def point_fields(self) -> dict[str, PointField]:
        """What a point stores for the laws and for the scheme."""
        of_laws = {name: field for law in self.laws for name, field in law.point_fields.items()}
        across = self.scheme.point_fields_in_space if self.dimensions == 3 else {}
        return {**of_laws, **self.scheme.point_fields, **across}

    @property
    def two_phase(self) -> bool:
        return self.formulation == "two_phase"

    @property
    def smoothing_grid(self) -> bool:
        """The grid of cell corners exists."""
        return self.volumetric_smoothing or self.pressure_relaxation

    def with_bodies(self, decided: Mapping[str, bool]) -> Effects:
        """The same with other bodies, of which `decided` says what they call for."""
        others: dict[str, Any] = dict(decided)
        return replace(self, **others)

    @property
    def moving(self) -> bool:
        """Some body moves."""
        return self.sliding or self.driven

    @property
    def liquid_alone(self) -> bool:
        """Friction follows the effective normal force, so that the nodes tell what the liquid would do alone."""
        return self.friction and self.liquid

    @property
    def module_names(self) -> list[str]:
        """Names of all the Warp modules: the first kind's, and one for the kernels over points of each further kind,
        which have the same names."""
        return [self.module_name, *(f"{self.module_name}.{number}" for number in range(1, len(self.kinds)))]

    @property
    def module_name(self) -> str:
        """Name of the Warp module: one per set of effects."""
        flags: list[str] = ["space"] if self.dimensions == 3 else []
        flags += [self.formulation, self.precision, self.law, self.transfer, self.drag]
        flags += [
            name
            for name in (
                "volumetric_smoothing",
                "density_correction",
                "pressure_relaxation",
                "inertial_drag",
                "porosity_update",
                "dilatancy",
                "bulk_viscosity",
                "bodies",
                "friction",
                "turbulence",
                "sliding",
                "driven",
                "joined",
                "passing",
                "arriving",
                "materials",
                "unlike_porosity",
                "profile",
            )
            if getattr(self, name)
        ]
        if self.conductivity != "constant":
            flags.append(self.conductivity)
        flags += map(str, self.kinds)
        name = "warp_mpm." + "-".join(flags)
        if len(name) > LONGEST_NAME:  # of a file, with what Warp adds to it
            name = name[: LONGEST_NAME - 17] + "-" + hashlib.sha256(name.encode()).hexdigest()[:16]
        return name
