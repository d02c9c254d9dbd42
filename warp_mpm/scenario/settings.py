"""Gravity, ground, the region that is followed, how the equations are solved and what is recorded."""

from __future__ import annotations

import json
import math
from typing import Annotated, Literal

from pydantic import Field, field_validator

from warp_mpm.quantities.time_series import NAMED
from warp_mpm.schema import Coordinate, Interval, Length, Model, NonNegative, set_fields
from warp_mpm.simulator.schemes import SCHEMES

STANDARD_GRAVITY = 9.81
"""Gravity [m/s²] to which a hydraulic conductivity refers, whatever the scene's own gravity."""


class Gravity(Model):
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


class Domain(Model):
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
    """y of the lower edge of a scene without ground, which is open; with ground it is the ground."""
    top_m: Coordinate | None = None
    """y of the upper edge."""


class Numerics(Model):
    """How the equations are solved."""

    spacing_m: Annotated[float, Field(ge=1e-6, le=1e6)] = 0.2
    """Side of the square cells of the background grid."""
    points_per_cell: Literal[1, 4, 9, 16] = 4
    """Material points in a full cell at t = 0."""
    courant_number: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    """Share of the critical time step that is used, C_NB."""
    transfer: str = "aflip"
    drag: Literal["semi_implicit", "explicit"] = "semi_implicit"
    """How the drag between the phases is integrated; explicit limits the time step at low conductivity."""
    volumetric_smoothing: bool = True
    """Volume strains are averaged over the grid, against volumetric locking."""
    density_correction: Annotated[float, Field(ge=0.0, le=2.0)] = 1.0
    """Share of the crowding of points (cells that hold more than there is room for, where a flow is stirred) that is
    undone per unit of shear strain; 0 lets it grow. Needs volumetric_smoothing."""
    pressure_relaxation: NonNegative = 0.2
    """Rate at which the noise of point pressures about their grid average decays, per sound crossing of a cell [-]."""
    bulk_viscosity: Annotated[float, Field(ge=0.0, le=2.0)] = 0.2
    """Artificial viscosity on compression, as a share b of rho c d (density, sound speed, spacing); 0 is none."""
    precision: Literal["float64", "float32"] = "float64"
    """Floating-point numbers of the simulation."""


def offer_schemes() -> None:
    """Make `Numerics` take the name of every scheme, and the fields of each."""
    titles = "; ".join(f"{scheme.name}: {scheme.title}" for scheme in SCHEMES)
    names = Annotated[
        Literal[*SCHEMES.names],  # type: ignore[valid-type]
        Field(description=f"Velocity transfer between points and grid. {titles}."),
    ]
    fields = {"transfer": (names, Numerics.model_fields["transfer"].default)}
    for scheme in SCHEMES:
        fields |= {name: (field.rebuild_annotation(), field) for name, field in scheme.settings.model_fields.items()}
    Numerics.fields_from = tuple(scheme.settings for scheme in SCHEMES)
    set_fields(Numerics, fields)


offer_schemes()


class Output(Model):
    """What is recorded, and when."""

    end_time_s: Annotated[float, Field(ge=1e-9, le=1e6)]
    """Simulated time at which the run ends."""
    time_series_interval_s: Interval = 0.005
    """Interval of the time series; forces are means over it."""
    snapshot_interval_s: Interval = 0.05
    """Interval of the snapshots of all material points."""
    quantities: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    """Names of the quantities in the time series, beside its time; null: all that the scene has. What is left out is
    not computed where computing costs, and figures of the summary that need it are told as not recorded."""
    pressure_patch_m: Length = 0.5
    """Length of the patch of the impacted face over which pressure_patch_max is a mean; of a shorter face all of it."""
    pressure_patch_s: Interval = 0.02
    """Time over which it is one too."""
    loads_by_height: bool = False
    """Record pressure and friction along the barrier's surfaces at each time of the series, in loads.h5."""
    checkpoint_interval_s: Interval | None = None
    """Simulated time between checkpoints, from which an interrupted run goes on; null: one in 30 s of wall time."""

    @field_validator("quantities")
    @classmethod
    def _known(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if names is not None:
            known = list(NAMED)
            for name in names:
                if name not in known:
                    raise ValueError(
                        f"{json.dumps(name)[:80]} cannot be chosen; each must be one of {', '.join(known)} (columns of "
                        "further barriers are recorded always)"
                    )
                if names.count(name) > 1:
                    raise ValueError(f"{json.dumps(name)} is there twice; each must be there once")
        return names
