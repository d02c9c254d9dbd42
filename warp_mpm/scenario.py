"""A scenario: what the user asks for, in SI units, checked before anything is created.

The layout of the JSON file is the layout of the models below; `python -m warp_mpm schema` prints it as JSON Schema.
Coordinates: the toe of the barrier's upstream face is the origin, the ground is y = 0, the flow comes from x < 0 and
moves toward +x. All forces, masses and volumes are per metre of width.
"""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from warp_mpm import geometry
from warp_mpm.scenario_errors import ScenarioError, read_json, sentences

STANDARD_GRAVITY = 9.81
"""Gravity [m/s²] to which a hydraulic conductivity refers, whatever the scene's own gravity."""

BASE_STRENGTH_RATIO = 0.8
"""Share of the base soil's tan φ that resists sliding at the barrier's base (paper, §2.2)."""

LARGEST_SCENE = 20_000_000
"""Most material points that a scenario may ask for."""

LARGEST_GRID = 100_000_000
"""Most nodes of the grid between edges that a scenario may ask for."""

BYTES_PER_NODE = 120
"""Rough memory of one node of the grid in a two-phase run."""

LARGEST_SNAPSHOTS = 1e12
"""Most bytes of snapshots that a scenario may ask for."""

BYTES_PER_SNAPSHOT_POINT = 110
"""Size on the disk of one material point in a snapshot."""

BYTES_PER_POINT = 500
"""Rough memory of one material point in a two-phase run, grid and output included."""

# The outer bounds are far beyond any flow; they keep the arithmetic of a typing error finite.
Positive = Annotated[float, Field(gt=0.0, le=1e15)]
NonNegative = Annotated[float, Field(ge=0.0, le=1e15)]
Length = Annotated[float, Field(gt=0.0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Density = Annotated[float, Field(gt=0.0, le=1e6)]
Velocity = Annotated[float, Field(ge=-1e4, le=1e4)]
Friction = Annotated[float, Field(ge=0.0, le=10.0)]
Interval = Annotated[float, Field(ge=1e-9, le=1e6)]
Point = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Series = Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=100_000)]


class _Model(BaseModel):
    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Gravity(_Model):
    """Gravity; tilted, it turns the ground (y = 0) into a slope without tilting the axes."""

    acceleration_m_per_s2: Annotated[float, Field(ge=0.0, le=1000.0)] = STANDARD_GRAVITY
    """Magnitude. 0 switches gravity off."""
    tilt_deg: Annotated[float, Field(gt=-90.0, lt=90.0)] = 0.0
    """Slope of the ground. Positive: the ground falls toward +x, gravity also pulls the flow downstream."""

    @property
    def vector(self) -> tuple[float, float]:
        """Components along x and y [m/s²]."""
        tilt = math.radians(self.tilt_deg)
        return self.acceleration_m_per_s2 * math.sin(tilt), -self.acceleration_m_per_s2 * math.cos(tilt)


class FrontAndTail(_Model):
    """The paper's flow: a front at 45°, `squares` squares of the flow's depth, a tail of three depths."""

    kind: Literal["front_and_tail"]
    depth_m: Length
    """Flow depth h."""
    squares: Annotated[int, Field(ge=0, le=100_000)]
    """Number i of squares between front and tail. Volume (2 + i) h² per metre of width."""
    distance_m: Annotated[float, Field(ge=0.0, le=1e6)]
    """Distance d from the front's toe to the barrier's toe."""

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres."""
        return geometry.front_and_tail(self.depth_m, self.squares, self.distance_m)


class FlowPolygon(_Model):
    """A flow of any outline."""

    kind: Literal["polygon"]
    vertices_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=3, max_length=2000)]
    """Corners [x, y], in order around the outline, the last joining the first."""

    @model_validator(mode="after")
    def _simple(self) -> Self:
        crossing = geometry.crossing_edges(self.polygon)
        if crossing is not None:
            first, second = crossing
            raise ValueError(
                f"vertices_m must not cross or touch themselves; the side after corner {first + 1} meets "
                f"the side after corner {second + 1}"
            )
        if not geometry.area(self.polygon) > 0.0:
            raise ValueError("vertices_m must enclose an area greater than 0")
        return self

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [V, 2] in metres."""
        return np.array(self.vertices_m)


class Skeleton(_Model):
    """Solid grains and their skeleton: linear elastic, non-associative Mohr–Coulomb."""

    grain_density_kg_per_m3: Density
    """Density of the grains themselves. The dry (partial) density is (1 - n) times this."""
    porosity: Annotated[float, Field(gt=0.0, lt=1.0)]
    """Volume of the voids over the total volume, n."""
    young_modulus_Pa: Positive
    """Young's modulus E' of the drained skeleton."""
    poisson_ratio: Annotated[float, Field(gt=-1.0, lt=0.5)]
    """Poisson's ratio ν of the drained skeleton."""
    friction_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)]
    """Internal friction angle φ'."""
    cohesion_Pa: NonNegative = 0.0
    """Effective cohesion c'."""
    dilatancy_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 0.0
    """Dilatancy angle ψ, at most the friction angle."""
    tension_cutoff_Pa: NonNegative = 0.0
    """Largest tensile principal effective stress."""
    plasticity: bool = True
    """False leaves the skeleton elastic."""

    @model_validator(mode="after")
    def _flow_rule(self) -> Self:
        if self.dilatancy_angle_deg > self.friction_angle_deg:
            raise ValueError(
                f"dilatancy_angle_deg = {self.dilatancy_angle_deg:g} must not exceed "
                f"friction_angle_deg = {self.friction_angle_deg:g}"
            )
        return self

    @property
    def solid_partial_density(self) -> float:
        """Mass of solid per volume of the whole, (1 - n) ρ_grain [kg/m³]."""
        return (1.0 - self.porosity) * self.grain_density_kg_per_m3

    @property
    def liquid_partial_density(self) -> float:
        """Mass of liquid per volume of the whole, n ρ_L [kg/m³]; 0 for a dry flow."""
        return 0.0

    @property
    def density(self) -> float:
        """Density of the whole, ρ_m [kg/m³]."""
        return self.solid_partial_density + self.liquid_partial_density

    @property
    def oedometric_modulus(self) -> float:
        """E (1 - ν) / ((1 + ν)(1 - 2ν)) [Pa]."""
        nu = self.poisson_ratio
        return self.young_modulus_Pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))


class UndrainedMaterial(Skeleton):
    """A skeleton whose voids are full of liquid that cannot leave them."""

    liquid_density_kg_per_m3: Density
    """Density ρ_L of the liquid."""
    liquid_bulk_modulus_Pa: Positive
    """Bulk modulus K_L of the liquid."""
    cavitation_pressure_Pa: NonNegative = 0.0
    """Largest tension that the liquid bears before it cavitates."""

    @property
    def liquid_partial_density(self) -> float:
        """Mass of liquid per volume of the whole, n ρ_L [kg/m³]."""
        return self.porosity * self.liquid_density_kg_per_m3


class TwoPhaseMaterial(UndrainedMaterial):
    """A saturated skeleton through which the liquid moves by Darcy's law.

    The drag follows from `hydraulic_conductivity_m_per_s`, or from `intrinsic_permeability_m2` and
    `liquid_viscosity_Pa_s`; exactly one of the two ways is given.
    """

    hydraulic_conductivity_m_per_s: Positive | None = None
    """Saturated hydraulic conductivity k_sat, at 9.81 m/s² whatever the scene's gravity."""
    intrinsic_permeability_m2: Positive | None = None
    """Intrinsic permeability κ, in place of the hydraulic conductivity."""
    liquid_viscosity_Pa_s: Positive = 1e-3
    """Dynamic viscosity μ_L. With the conductivity given it only tells the intrinsic permeability."""
    porosity_update: bool = False
    """True updates the porosity with the skeleton's volume strain; False keeps it, as the paper does (Eq. (A11))."""

    @model_validator(mode="after")
    def _one_conductivity(self) -> Self:
        if (self.hydraulic_conductivity_m_per_s is None) == (self.intrinsic_permeability_m2 is None):
            raise ValueError("needs exactly one of hydraulic_conductivity_m_per_s and intrinsic_permeability_m2")
        return self

    @property
    def hydraulic_conductivity(self) -> float:
        """k_sat [m/s] at 9.81 m/s², given or from κ ρ_L g / μ_L."""
        if self.hydraulic_conductivity_m_per_s is not None:
            return self.hydraulic_conductivity_m_per_s
        assert self.intrinsic_permeability_m2 is not None
        weight = self.liquid_density_kg_per_m3 * STANDARD_GRAVITY
        return self.intrinsic_permeability_m2 * weight / self.liquid_viscosity_Pa_s


class _FlowBase(_Model):
    shape: Annotated[FrontAndTail | FlowPolygon, Field(discriminator="kind")]
    """Outline at t = 0."""
    velocity_m_per_s: Annotated[tuple[Velocity, Velocity], Field(strict=False)]
    """Uniform velocity [x, y] at t = 0, of both phases."""
    initial_stress: Literal["geostatic", "zero"] = "geostatic"
    """geostatic: liquid pressure hydrostatic and effective stress from the weight, along each vertical; zero: none."""
    lateral_stress_coefficient: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    """K0, horizontal over vertical effective stress at t = 0; null: Jaky's 1 - sin φ'."""

    material: Skeleton

    @property
    def polygon(self) -> geometry.Polygon:
        """Outline at t = 0, vertices [V, 2] in metres."""
        return self.shape.polygon

    @property
    def lateral_stress_ratio(self) -> float:
        """K0 [-], given or 1 - sin φ'."""
        if self.lateral_stress_coefficient is not None:
            return self.lateral_stress_coefficient
        return 1.0 - math.sin(math.radians(self.material.friction_angle_deg))

    @property
    def volume(self) -> float:
        """Volume V_1 [m³/m]."""
        return geometry.area(self.polygon)

    @property
    def depth(self) -> float:
        """Flow depth h [m]: the greatest vertical thickness of the outline."""
        return self.shape.depth_m if isinstance(self.shape, FrontAndTail) else geometry.maximum_depth(self.polygon)

    @property
    def equivalent_length(self) -> float:
        """Length L_m [m] of the box of the same volume and depth."""
        return self.volume / self.depth

    @property
    def speed(self) -> float:
        """Magnitude of the initial velocity [m/s]."""
        return math.hypot(*self.velocity_m_per_s)


class TwoPhaseFlow(_FlowBase):
    """Saturated flow, solid and liquid with their own velocities (a_S–a_L formulation)."""

    formulation: Literal["two_phase"]
    material: TwoPhaseMaterial


class UndrainedFlow(_FlowBase):
    """Saturated flow, one velocity; the skeleton's volume strain drives the pore pressure."""

    formulation: Literal["undrained"]
    material: UndrainedMaterial


class DryFlow(_FlowBase):
    """Dry granular flow."""

    formulation: Literal["dry"]
    material: Skeleton


Flow = TwoPhaseFlow | UndrainedFlow | DryFlow


class Trapezoid(_Model):
    """Symmetric embankment. Three of its four measures fix it; the fourth follows.

    Given all four, the two widths and the height build it and the stated angle must agree to 1°, because tables of
    such barriers are rounded: the paper's case 1 states 60° where its widths and height make 59.7°.
    """

    kind: Literal["trapezoid"]
    base_width_m: Length | None = None
    """Greater base B, on the ground."""
    crest_width_m: Annotated[float, Field(ge=0.0, le=1e6)] | None = None
    """Smaller base b, at the top."""
    height_m: Length | None = None
    """Height H."""
    face_angle_deg: Annotated[float, Field(gt=0.0, le=90.0)] | None = None
    """Angle β between the impacted face and the base."""

    @model_validator(mode="after")
    def _closed(self) -> Self:
        measures = (self.base_width_m, self.crest_width_m, self.height_m, self.face_angle_deg)
        if sum(measure is None for measure in measures) > 1:
            raise ValueError("needs at least three of base_width_m, crest_width_m, height_m and face_angle_deg")
        base, crest, height = self.base_crest_height
        if not (0.0 <= crest <= base and height > 0.0):
            raise ValueError(
                f"base_width_m = {base:g}, crest_width_m = {crest:g} and height_m = {height:g} make no barrier; "
                "the crest must be from 0 to as wide as the base, and the height greater than 0"
            )
        if self.face_angle_deg is not None and abs(self.built_face_angle_deg - self.face_angle_deg) > 1.0:
            raise ValueError(
                f"face_angle_deg = {self.face_angle_deg:g} must agree to 1° with the angle that base_width_m, "
                f"crest_width_m and height_m make, {self.built_face_angle_deg:.2f}; or leave one of the four out"
            )
        return self

    @property
    def base_crest_height(self) -> tuple[float, float, float]:
        """B, b, H [m], the missing one from B - b = 2 H / tan β."""
        base, crest, height = self.base_width_m, self.crest_width_m, self.height_m
        if base is not None and crest is not None and height is not None:
            return base, crest, height
        assert self.face_angle_deg is not None
        # At 90° the cotangent is 0, not the 6e-17 of the floating-point tangent.
        cotangent = 0.0 if self.face_angle_deg == 90.0 else 1.0 / math.tan(math.radians(self.face_angle_deg))
        if height is None:
            assert base is not None
            assert crest is not None
            return base, crest, (base - crest) / (2.0 * cotangent) if cotangent > 0.0 else 0.0
        if base is None:
            assert crest is not None
            return crest + 2.0 * height * cotangent, crest, height
        return base, base - 2.0 * height * cotangent, height

    @property
    def built_face_angle_deg(self) -> float:
        """Angle β [°] of the face as built from B, b and H."""
        base, crest, height = self.base_crest_height
        return math.degrees(math.atan2(height, 0.5 * (base - crest)))

    @property
    def polygon(self) -> geometry.Polygon:
        """Vertices [4, 2] in metres at t = 0: toe, upstream crest, downstream crest, heel."""
        return geometry.trapezoid(*self.base_crest_height)


class Wall(_Model):
    """A vertical wall without end: the face is x = 0, y >= 0, and all of x > 0 is solid."""

    kind: Literal["wall"]


class Fixed(_Model):
    """The barrier does not move."""

    kind: Literal["fixed"]


class Sliding(_Model):
    """The barrier slides on its base with Coulomb friction, downstream only, and sticks when it comes to rest."""

    kind: Literal["sliding"]
    density_kg_per_m3: Density | None = None
    """Density of the barrier; or give its mass."""
    mass_kg_per_m: Positive | None = None
    """Mass m_2 per metre of width; or give its density."""
    base_friction: Friction | None = None
    """Friction coefficient tan δ_b at the base; or give the base soil's friction angle."""
    base_soil_friction_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] | None = None
    """Friction angle of the soil under the barrier, of whose tangent 80 % resist (paper, §2.2)."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if (self.density_kg_per_m3 is None) == (self.mass_kg_per_m is None):
            raise ValueError("needs exactly one of density_kg_per_m3 and mass_kg_per_m")
        if (self.base_friction is None) == (self.base_soil_friction_angle_deg is None):
            raise ValueError("needs exactly one of base_friction and base_soil_friction_angle_deg")
        return self

    @property
    def base_friction_coefficient(self) -> float:
        """tan δ_b [-]."""
        if self.base_friction is not None:
            return self.base_friction
        assert self.base_soil_friction_angle_deg is not None
        return BASE_STRENGTH_RATIO * math.tan(math.radians(self.base_soil_friction_angle_deg))


class Prescribed(_Model):
    """The barrier follows a given velocity, whatever the flow does to it."""

    kind: Literal["prescribed"]
    times_s: Series
    """Increasing times, the first at or after 0."""
    velocities_m_per_s: Annotated[tuple[Velocity, ...], Field(strict=False, min_length=1, max_length=100_000)]
    """Velocity along x at these times; linear in between, constant before the first and after the last."""

    @model_validator(mode="after")
    def _series(self) -> Self:
        if len(self.times_s) != len(self.velocities_m_per_s):
            raise ValueError(
                f"times_s has {len(self.times_s)} entries and velocities_m_per_s has "
                f"{len(self.velocities_m_per_s)}; they must be as many"
            )
        if self.times_s[0] < 0.0 or any(b <= a for a, b in zip(self.times_s, self.times_s[1:], strict=False)):
            raise ValueError("times_s must start at or after 0 and increase")
        return self


class SurfaceFriction(_Model):
    """Friction coefficient tan δ between the flow's solid and each surface of the barrier."""

    face: Friction
    """Impacted side."""
    top: Friction
    """Crest."""
    back: Friction
    """Downstream side."""


def _or_one_friction(schema: dict[str, Any]) -> None:
    schema["anyOf"] = [{"$ref": schema.pop("$ref")}, {"type": "number", "minimum": 0, "maximum": 10}]


class Barrier(_Model):
    """A rigid, impermeable barrier on the ground."""

    shape: Annotated[Trapezoid | Wall, Field(discriminator="kind")]
    motion: Annotated[Fixed | Sliding | Prescribed, Field(discriminator="kind")]
    friction: Annotated[SurfaceFriction, Field(json_schema_extra=_or_one_friction)]
    """Friction coefficient tan δ against the flow; one number holds for all surfaces."""

    @field_validator("friction", mode="before")
    @classmethod
    def _one_number(cls, value: Any) -> Any:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return {"face": value, "top": value, "back": value}
        if not isinstance(value, (dict, SurfaceFriction)):
            raise ValueError(
                f"{json.dumps(value, default=repr)[:80]} is not allowed; it must be a number at least 0 "
                "and at most 10, or a group of the fields face, top, back"
            )
        return value

    @model_validator(mode="after")
    def _mass_of_wall(self) -> Self:
        if isinstance(self.shape, Wall) and isinstance(self.motion, Sliding) and self.motion.mass_kg_per_m is None:
            raise ValueError("motion needs mass_kg_per_m: a wall without end has no mass of its own")
        return self

    @property
    def mass(self) -> float | None:
        """Mass m_2 [kg/m] of a sliding barrier; None where the motion does not depend on it."""
        if not isinstance(self.motion, Sliding):
            return None
        if self.motion.mass_kg_per_m is not None:
            return self.motion.mass_kg_per_m
        assert isinstance(self.shape, Trapezoid)
        assert self.motion.density_kg_per_m3 is not None
        return self.motion.density_kg_per_m3 * geometry.area(self.shape.polygon)


class Ground(_Model):
    """Rigid, impermeable ground at y = 0."""

    friction: Friction = 0.0
    """Friction coefficient tan φ_b between the flow's solid and the ground; 0 is smooth, as in the paper."""


class Domain(_Model):
    """Edges of the region in which the flow is followed. An extent left out is fitted to the scene."""

    left_edge: Literal["open", "wall"] = "open"
    """open: what crosses the edge leaves, and is counted; wall: smooth and impermeable."""
    right_edge: Literal["open", "wall"] = "open"
    top_edge: Literal["open", "wall"] = "open"
    left_m: Coordinate | None = None
    """x of the left edge."""
    right_m: Coordinate | None = None
    """x of the right edge."""
    bottom_m: Coordinate | None = None
    """y of the lower edge of a scene without ground, which is open; with ground it is the ground, y = 0."""
    top_m: Coordinate | None = None
    """y of the upper edge."""


class Numerics(_Model):
    """How the equations are solved."""

    spacing_m: Annotated[float, Field(ge=1e-6, le=1e6)] = 0.2
    """Side of the square cells of the background grid."""
    points_per_cell: Literal[1, 4, 9, 16] = 4
    """Material points in a full cell at t = 0."""
    courant_number: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    """Share of the critical time step that is used, C_NB."""
    transfer: Literal["flip", "apic"] = "apic"
    """Velocity transfer between points and grid: affine particle-in-cell, or flip (Sulsky et al. 1995, the paper's)."""
    pic_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    """With flip: share of the grid's own velocity in the update during the time in which sound crosses a cell."""
    drag: Literal["semi_implicit", "explicit"] = "semi_implicit"
    """How the drag between the phases is integrated; explicit limits the time step at low conductivity."""
    volumetric_smoothing: bool = True
    """Volume strains are averaged over the grid, against volumetric locking."""
    pressure_relaxation: NonNegative = 1.0
    """Rate at which the noise of point pressures about their grid average decays, per sound crossing of a cell [-]."""
    bulk_viscosity: Annotated[float, Field(ge=0.0, le=2.0)] = 0.2
    """Artificial viscosity on compression, as a share b of rho c d (density, sound speed, spacing); 0 is none."""
    precision: Literal["float64", "float32"] = "float64"
    """Floating-point numbers of the simulation."""


class Output(_Model):
    """What is recorded, and when."""

    end_time_s: Annotated[float, Field(gt=0.0, le=1e6)]
    """Simulated time at which the run ends."""
    time_series_interval_s: Interval = 0.005
    """Interval of the time series; forces are means over it."""
    snapshot_interval_s: Interval = 0.05
    """Interval of the snapshots of all material points."""
    checkpoint_interval_s: Interval | None = None
    """Simulated time between checkpoints, from which an interrupted run goes on; null: one in 30 s of wall time."""


class Scenario(_Model):
    """A whole scene. `Scenario.load(path)` reads one; `Scenario.model_validate(dict)` makes one from Python."""

    title: Annotated[str, Field(min_length=1, max_length=200)]
    """One line that names the scene."""
    source: str = ""
    """Where the scene's figures come from."""
    notes: Annotated[tuple[str, ...], Field(strict=False)] = ()
    """Remarks, for instance on a figure of the source that had to be interpreted."""
    gravity: Gravity = Gravity()
    flow: Annotated[Flow, Field(discriminator="formulation")]
    barrier: Barrier | None = None
    """null: no barrier."""
    ground: Ground | None = Ground()
    """null: no ground, for instance for a free jet."""
    domain: Domain = Domain()
    numerics: Numerics = Numerics()
    output: Output

    @classmethod
    def load(cls, path: str | Path) -> Scenario:
        """Read a scenario from a JSON file.

        Raises:
            ScenarioError: the file cannot be read, is no JSON, or says something impossible; one sentence per problem.
        """
        return cls.model_validate(read_json(Path(path)), source_name=str(path))

    @classmethod
    def model_validate(cls, obj: Any, *, source_name: str | None = None, **kwargs: Any) -> Scenario:
        """Check `obj`, a dict of the file's layout, and make a Scenario of it.

        Raises:
            ScenarioError: with one sentence per problem, each naming field, value and what is allowed.
        """
        try:
            return super().model_validate(obj, **kwargs)
        except ValidationError as error:
            raise ScenarioError(sentences(error, cls), source_name) from None

    @model_validator(mode="before")
    @classmethod
    def _without_schema_pointer(cls, data: Any) -> Any:
        # "$schema" tells an editor where the JSON Schema lies; it says nothing about the scene.
        return {key: value for key, value in data.items() if key != "$schema"} if isinstance(data, dict) else data

    def resolved(self) -> dict[str, Any]:
        """The scenario as a dict of plain JSON values with every default filled in; loads to an equal Scenario."""
        return self.model_dump(mode="json")

    def replaced(self, changes: Mapping[str, Any]) -> Scenario:
        """A copy with some fields changed, named by their path: `{"numerics.spacing_m": 0.25}`.

        Raises:
            ScenarioError: a changed value is not allowed, or the path leads nowhere.
        """
        data = self.resolved()
        for path, value in changes.items():
            *parents, leaf = path.split(".")
            place = data
            for name in parents:
                if not isinstance(place.get(name), dict):
                    raise ScenarioError([f"{path} leads nowhere: this scenario has no group {name!r} there."])
                place = place[name]
            place[leaf] = value
        return type(self).model_validate(data)

    @model_validator(mode="after")
    def _scene(self) -> Self:
        problems = [*self._misplaced_flow(), *self._impossible_domain(), *self._excessive_size()]
        if self.ground is None and self.barrier is not None and isinstance(self.barrier.motion, Sliding):
            problems.append("ground = null is not allowed with a sliding barrier, which needs a base to slide on")
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def _misplaced_flow(self) -> list[str]:
        outline = self.flow.polygon
        problems = []
        lowest = float(outline[:, 1].min())
        # A hair below is rounding of the user's own arithmetic.
        hair = 1e-9 * max(1.0, float(np.abs(outline).max()))
        if self.ground is not None and lowest < -hair:
            problems.append(f"flow.shape reaches y = {lowest:g} m; it must stay on or above the ground, y >= 0")
        if self.barrier is not None:
            if isinstance(self.barrier.shape, Wall):
                inside = geometry.clip_half_plane(outline, (-1.0, 0.0), 0.0)
            else:
                inside = geometry.clip_convex(outline, self.barrier.shape.polygon)
            overlap = geometry.area(inside) if len(inside) else 0.0
            if overlap > hair * self.flow.depth:
                problems.append(
                    f"flow.shape lies inside the barrier by {overlap:.3g} m² of area; it must lie outside "
                    "(the barrier's toe is at x = 0 and its body at x >= 0)"
                )
        return problems

    def _extent(self) -> tuple[float, float, float, float]:
        """Smallest and greatest x, smallest and greatest y [m] of flow and barrier."""
        outline = self.flow.polygon
        x_low, y_low = outline.min(axis=0)
        x_high, y_high = outline.max(axis=0)
        if self.barrier is not None:
            x_low = min(x_low, 0.0)
            if isinstance(self.barrier.shape, Trapezoid):
                base, _, height = self.barrier.shape.base_crest_height
                x_high, y_high = max(x_high, base), max(y_high, height)
            else:
                x_high = max(x_high, 0.0)
        return float(x_low), float(x_high), float(y_low), float(y_high)

    def _impossible_domain(self) -> list[str]:
        domain = self.domain
        x_low, x_high, y_low, y_high = self._extent()
        problems = []
        if domain.left_m is not None and domain.left_m > x_low:
            problems.append(f"domain.left_m = {domain.left_m:g} cuts the scene; it must be at most {x_low:g}")
        if domain.right_m is not None and domain.right_m < x_high:
            problems.append(f"domain.right_m = {domain.right_m:g} cuts the scene; it must be at least {x_high:g}")
        if domain.top_m is not None and domain.top_m < y_high:
            problems.append(f"domain.top_m = {domain.top_m:g} cuts the scene; it must be at least {y_high:g}")
        if domain.bottom_m is not None:
            if self.ground is not None:
                problems.append("domain.bottom_m is not allowed with a ground, which is the lower edge at y = 0")
            elif domain.bottom_m > y_low:
                problems.append(f"domain.bottom_m = {domain.bottom_m:g} cuts the scene; it must be at most {y_low:g}")
        return problems

    def _excessive_size(self) -> list[str]:
        problems = []
        points = self.flow.volume / self.numerics.spacing_m**2 * self.numerics.points_per_cell
        if points > LARGEST_SCENE:
            problems.append(
                f"numerics.spacing_m = {self.numerics.spacing_m:g} asks for {points:.3g} material points "
                f"(about {points * BYTES_PER_POINT / 1e9:.3g} GB of memory); at most {LARGEST_SCENE:.3g} are allowed"
            )
        if points < 1.0:
            problems.append(
                f"numerics.spacing_m = {self.numerics.spacing_m:g} leaves less than one material point for the flow "
                f"of {self.flow.volume:.3g} m²; it must be smaller"
            )
        domain = self.domain
        x_low, x_high, y_low, y_high = self._extent()
        given = (domain.left_m, domain.right_m, domain.bottom_m, domain.top_m)
        left, right, low, high = (
            asked if asked is not None else fitted
            for asked, fitted in zip(given, (x_low, x_high, y_low, y_high), strict=True)
        )
        low = 0.0 if self.ground is not None else low
        nodes = (right - left) * (high - low) / self.numerics.spacing_m**2
        if nodes > LARGEST_GRID:
            problems.append(
                f"domain of {right - left:.3g} m by {high - low:.3g} m at numerics.spacing_m = "
                f"{self.numerics.spacing_m:g} asks for a grid of {nodes:.3g} nodes (about "
                f"{nodes * BYTES_PER_NODE / 1e9:.3g} GB of memory); at most {LARGEST_GRID:.3g} are allowed"
            )
        snapshots = points * BYTES_PER_SNAPSHOT_POINT * self.output.end_time_s / self.output.snapshot_interval_s
        if points <= LARGEST_SCENE and snapshots > LARGEST_SNAPSHOTS:
            problems.append(
                f"output.snapshot_interval_s = {self.output.snapshot_interval_s:g} asks for about "
                f"{snapshots / 1e9:.3g} GB on the disk; at most {LARGEST_SNAPSHOTS / 1e9:.3g} GB are allowed"
            )
        for name in ("time_series_interval_s", "snapshot_interval_s"):
            interval = getattr(self.output, name)
            if self.output.end_time_s / interval > 1e7:
                problems.append(
                    f"output.{name} = {interval:g} asks for more than ten million records until "
                    f"end_time_s = {self.output.end_time_s:g}; it must be longer"
                )
        return problems


def json_schema() -> str:
    """The scenario format as JSON Schema (draft 2020-12), indented text."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()}
    schema["properties"] = {"$schema": {"type": "string"}, **schema["properties"]}
    return json.dumps(schema, indent=2, ensure_ascii=False)
