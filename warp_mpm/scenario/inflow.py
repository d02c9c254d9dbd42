"""A flow that arrives: at a section, with depth and velocity over time."""

from __future__ import annotations

import csv
import json
import math
import os
import re
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from warp_mpm.scenario.ground import Ground
from warp_mpm.scenario.other_material import OtherMaterial
from warp_mpm.scenario.velocity_profile import VelocityProfile
from warp_mpm.schema import Coordinate, Length, NonNegative, Series, Text

Array = NDArray[np.float64]

APPROACH = 4
"""Cells upstream of the section in which what arrives is held at its depth and velocity, so that the section sees a
full neighbourhood: a point's nodes reach 1.5 cells, and the points of these nodes as far again."""

LEAST_PACE = 0.1
"""Least velocity of what arrives over the mean over its depth: what stands still at the section never comes."""

PIECES = 32
"""Straight pieces for the curved way of an interval in which the velocity changes."""

LARGEST_TABLE = 4 * 1024 * 1024
"""Bytes of a hydrograph; anything larger is a mistake."""

COLUMNS = {
    "times_s": ("time", "t", "time_s"),
    "depths_m": ("depth", "h", "depth_m", "flow_depth", "flow_height", "flow_thickness", "ft"),
    "velocities_m_per_s": ("velocity", "v", "u", "velocity_m_per_s", "speed", "flow_velocity", "fv"),
    "discharge": ("discharge", "q", "discharge_m3_per_s", "discharge_m2_per_s"),
    "pore_pressure_ratios": ("pore_pressure_ratio", "lambda_p"),
    "densities_kg_per_m3": ("density", "rho", "density_kg_per_m3", "bulk_density", "flow_density"),
}
"""Names of the columns of a hydrograph, in small letters, without their unit in brackets, and _ for a space."""


DENSITY_STEPS = 8
"""Materials at most that stand for a density that changes over time."""

LARGEST = {"depths_m": 1e6, "velocities_m_per_s": 1e4, "pore_pressure_ratios": 1.0, "densities_kg_per_m3": 1e5}
"""Greatest values of the columns of the table; the least is 0."""


class Surge(OtherMaterial):
    """What arrives from some time on, of a material of its own."""

    from_s: NonNegative
    """Time from which it passes the section."""


class Inflow(VelocityProfile, OtherMaterial):
    """A flow that arrives at an upright section, in one surge or several.

    Between the given times depth, velocity and density are linear; before the first and after the last nothing arrives,
    nor where the depth is 0. What arrives has the flow's material, but for what it says otherwise, and moves along the
    ground at the section, which is straight for some cells before it; its stress is that of a flow at rest of its depth
    (`initial_stress`).
    """

    x_m: Coordinate
    """x of the section."""
    base_m: Coordinate | None = None
    """y of the flow's underside at the section; null: the ground's height there."""
    times_s: Series | None = None
    """Times, increasing."""
    depths_m: Series | None = None
    """Depths then, upright, at least 0."""
    velocities_m_per_s: Series | None = None
    """Velocities then, along x, meant over the depth, at least 0."""
    velocity_m_per_s: Annotated[float, Field(gt=0.0, le=1e4)] | None = None
    """One velocity for all times, in place of velocities_m_per_s."""
    pore_pressure_ratios: Series | None = None
    """λ_p then, pore pressure over total vertical stress, 0 to 1; null: that of the flow."""
    densities_kg_per_m3: Series | None = None
    """Densities of the whole then, which the porosity makes, between those of liquid and grains; where the depth is 0
    they may be 0: as next to it. null: that of the material."""
    surges: Annotated[tuple[Surge, ...], Field(strict=False, max_length=20)] = ()
    """What arrives from some times on is of other materials; before the first it is of this one."""
    hydrograph_csv: Text | None = None
    """File with the table, beside the scenario, in place of times_s and what belongs to them."""
    width_m: Length | None = None
    """Width of the channel by which a discharge in the file is divided; null: it is per metre of width."""
    base_velocity_share: Annotated[float, Field(ge=LEAST_PACE, le=1.0)] = 1.0
    """Velocity at the flow's underside over the mean over the depth; 1: the same at all heights."""

    _bed: tuple[float, float] = (0.0, 0.0)

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(data.get("hydrograph_csv"), str):
            return data
        doubled = [name for name in ("times_s", "depths_m", "velocities_m_per_s") if data.get(name) is not None]
        if doubled:
            raise ValueError(f"hydrograph_csv is not allowed with {' and '.join(doubled)}; give the one or the other")
        kept = {name: value for name, value in data.items() if name not in ("hydrograph_csv", "width_m")}
        table = hydrograph(data["hydrograph_csv"], data.get("velocity_m_per_s"), data.get("width_m"))
        if "velocities_m_per_s" in table:
            kept.pop("velocity_m_per_s", None)
        return kept | table

    @model_validator(mode="after")
    def _table(self) -> Self:
        if self.times_s is None or self.depths_m is None:
            raise ValueError("needs times_s and depths_m, or hydrograph_csv")
        if (self.velocities_m_per_s is None) == (self.velocity_m_per_s is None):
            raise ValueError("needs exactly one of velocities_m_per_s and velocity_m_per_s")
        if self.width_m is not None:
            raise ValueError(f"width_m = {self.width_m:g} is of a discharge, which only hydrograph_csv gives")
        count = len(self.times_s)
        if count < 2:
            raise ValueError(f"times_s has {count} entry; it must have at least 2")
        for name, largest in LARGEST.items():
            values = getattr(self, name)
            if values is None:
                continue
            if len(values) != count:
                raise ValueError(f"{name} has {len(values)} entries and times_s {count}; they must be as many")
            for place, value in enumerate(values):
                if not 0.0 <= value <= largest:
                    raise ValueError(f"{name}[{place}] = {value:g} is not allowed; it must be from 0 to {largest:g}")
        for place in range(count - 1):
            if not self.times_s[place] < self.times_s[place + 1]:
                raise ValueError(
                    f"times_s[{place + 1}] = {self.times_s[place + 1]:g} follows {self.times_s[place]:g}; times must "
                    "increase"
                )
        if self.times_s[0] < 0.0:
            raise ValueError(f"times_s[0] = {self.times_s[0]:g} is not allowed; it must be at least 0")
        if not self.volume > 0.0:
            raise ValueError("brings nothing: depth or velocity is 0 at all times")
        before = self.times_s[0]
        for place, surge in enumerate(self.surges):
            if not before < surge.from_s < self.times_s[-1]:
                raise ValueError(
                    f"surges[{place}].from_s = {surge.from_s:g} is not allowed; it must be above {before:g} and below "
                    f"{self.times_s[-1]:g}, the last of times_s"
                )
            before = surge.from_s
        if self.velocity_profile is not None:
            paces = self.paces(np.array(self.velocity_profile)[:, 0])
            if paces.min() < LEAST_PACE * (1.0 - 1e-9):
                raise ValueError(
                    f"velocity_profile[{int(np.argmin(paces))}] has {paces.min():.3g} of the mean velocity; of what "
                    f"arrives it must be at least {LEAST_PACE:g}"
                )
        return self

    # -- the section -----------------------------------------------------------------------------------------------

    def laid_on(self, ground: Ground) -> Self:
        """The same inflow over `ground`."""
        laid = self.model_copy()
        laid._bed = ground.before(self.x_m)
        return laid

    @property
    def bed(self) -> float:
        """y of the ground just before the section [m]."""
        return self._bed[0]

    @property
    def base(self) -> float:
        """y of the flow's underside at the section [m]."""
        return self.bed if self.base_m is None else self.base_m

    @property
    def slope(self) -> float:
        """dy/dx of the ground just before the section, along which the flow arrives."""
        return self._bed[1]

    def approach(self, spacing: float) -> Array:
        """Outline [4, 2] of the approach filled to the greatest depth [m]."""
        right, run = self.x_m, APPROACH * spacing
        low = np.array([[right - run, self.base - self.slope * run], [right, self.base]])
        return np.concatenate([low, low[::-1] + np.array([0.0, self.greatest_depth])])

    # -- the table -------------------------------------------------------------------------------------------------

    @property
    def times(self) -> Array:
        """[K] s."""
        return np.array(self.times_s)

    @property
    def depths(self) -> Array:
        """[K] m."""
        return np.array(self.depths_m)

    @property
    def velocities(self) -> Array:
        """[K] m/s."""
        if self.velocities_m_per_s is None:
            return np.full(len(self.times), self.velocity_m_per_s)
        return np.array(self.velocities_m_per_s)

    @property
    def ways(self) -> Array:
        """Way of the flow through the section until the times [K], the time integral of its velocity [m]."""
        steps = 0.5 * (self.velocities[1:] + self.velocities[:-1]) * np.diff(self.times)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def slackening(self) -> Array:
        """Change of the velocity along x at the section at the times [K] [1/s], of a flow of which each part keeps its
        own velocity: -(du/dt) / u."""
        u = self.velocities
        return -np.divide(np.gradient(u, self.times), u, out=np.zeros(len(u)), where=u > 0.0)

    def most_stretch(self, gravity: float) -> Array:
        """That change [K] [1/s] at which the surface falls or rises at a quarter of √(g h)."""
        return 0.25 * np.sqrt(gravity / np.maximum(self.depths, 1e-9))

    def stretches(self, gravity: float) -> Array:
        """How what approaches the section stretches at the times [K] [1/s]: it slackens, within `most_stretch`.

        Args:
            gravity: acceleration [m/s²] of the scene.
        """
        most = self.most_stretch(gravity)
        return np.clip(self.slackening, -most, most)

    def way(self, time: float) -> float:
        """That way until a time [s]."""
        times, velocities = self.times, self.velocities
        if time <= times[0]:
            return 0.0
        if time >= times[-1]:
            return float(self.ways[-1])
        k = int(np.searchsorted(times, time, side="right")) - 1
        s = time - times[k]
        gain = (velocities[k + 1] - velocities[k]) / (times[k + 1] - times[k])
        return float(self.ways[k] + (velocities[k] + 0.5 * gain * s) * s)

    @property
    def volume(self) -> float:
        """All that arrives: the time integral of depth times velocity [m³/m]."""
        u, h = self.velocities, self.depths
        means = (2.0 * (u[:-1] * h[:-1] + u[1:] * h[1:]) + u[:-1] * h[1:] + u[1:] * h[:-1]) / 6.0
        return float(means @ np.diff(self.times))

    def volume_until(self, time: float) -> float:
        """What has arrived by then [m³/m]."""
        if time >= self.times[-1]:
            return self.volume
        way, volume = self.profile[0], self.profile[1]
        return float(np.interp(self.way(time), way, volume))

    @property
    def profile(self) -> tuple[Array, Array, Array]:
        """The flow as it would lie upstream of the section: way [L] at which it is there, increasing, with the volume
        [L] until then [m³/m] and the depth [L]."""
        shares = np.arange(PIECES) / PIECES
        k = np.repeat(np.arange(len(self.times) - 1), PIECES)
        share = np.concatenate([np.tile(shares, len(self.times) - 1), [1.0]])
        k = np.append(k, len(self.times) - 2)
        step = np.diff(self.times)[k]
        u, gain = self.velocities[k], np.diff(self.velocities)[k]
        h, rise = self.depths[k], np.diff(self.depths)[k]
        way = self.ways[k] + step * share * (u + 0.5 * share * gain)
        part = step * share * (u * h + 0.5 * share * (u * rise + h * gain) + share**2 / 3.0 * gain * rise)
        whole = np.diff(self.times) * (
            self.velocities[:-1] * self.depths[:-1]
            + 0.5 * (self.velocities[:-1] * np.diff(self.depths) + self.depths[:-1] * np.diff(self.velocities))
            + np.diff(self.velocities) * np.diff(self.depths) / 3.0
        )
        volume = np.concatenate([[0.0], np.cumsum(whole)])[k] + part
        return way, volume, h + share * rise

    def density(self, time: Array) -> Array:
        """Density of the whole of what passes at times [N] [s]; nan where the table has none [kg/m³]."""
        if self.densities_kg_per_m3 is None:
            return np.full(len(time), np.nan)
        densities = np.array(self.densities_kg_per_m3)
        there = densities > 0.0
        return np.interp(time, self.times[there], densities[there])

    @property
    def passing(self) -> tuple[Array, Array]:
        """All that passes in pieces, small beside the intervals of the table: times [L] [s], volumes [L] [m³/m]."""
        shares = np.arange(PIECES) / PIECES
        times = np.append((self.times[:-1, None] + np.diff(self.times)[:, None] * shares).ravel(), self.times[-1])
        volumes = np.diff(self.profile[1])
        return (0.5 * (times[1:] + times[:-1]))[volumes > 0.0], volumes[volumes > 0.0]

    @property
    def greatest_depth(self) -> float:
        """[m]."""
        return float(self.depths.max())

    @property
    def greatest_speed(self) -> float:
        """Of any height, along the ground [m/s]."""
        return float(self.velocities.max()) * self.greatest_pace * math.hypot(1.0, self.slope)


def surges_of(inflow: Inflow) -> list[tuple[float, float]]:
    """Begin and end [s] of each stretch of time in which something arrives."""
    bringing = (inflow.depths * inflow.velocities) > 0.0
    busy = bringing[:-1] | bringing[1:]  # of each interval; linear between its ends
    found: list[tuple[float, float]] = []
    for k in np.flatnonzero(busy):
        begin, end = float(inflow.times[k]), float(inflow.times[k + 1])
        if found and found[-1][1] == begin and bringing[k]:
            found[-1] = (found[-1][0], end)
        else:
            found.append((begin, end))
    return found


def hydrograph(path: str, velocity: Any = None, width: Any = None) -> dict[str, tuple[float, ...]]:
    """The table of a CSV file: a line of names, then numbers; lines that begin with # are passed over.

    Args:
        path: of the file.
        velocity: for all times [m/s]; None: the file has a column of it.
        width: by which a discharge is divided [m]; None: it is per metre of width.

    Raises:
        ValueError: with a sentence on what is wrong with the file.
    """
    shown = f"hydrograph_csv = {json.dumps(path, ensure_ascii=False)}"
    try:
        if Path(path).stat().st_size > LARGEST_TABLE:
            raise ValueError(f"{shown} is larger than {LARGEST_TABLE // 1024**2} MB; this is no hydrograph")
        text = Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{shown} is no UTF-8 text; it must be a CSV file") from None
    except OSError as error:
        raise ValueError(f"{shown} cannot be read: {os.strerror(error.errno) if error.errno else error}") from None
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 3:
        raise ValueError(f"{shown} has {max(len(lines) - 1, 0)} rows of numbers; it must have a line of names and 2")
    separator = next((sign for sign in (";", "\t") if sign in lines[0][1]), ",")
    rows = [(n, next(csv.reader([line], delimiter=separator))) for n, line in lines]
    names = [_plain(name) for name in rows[0][1]]
    found: dict[str, int] = {}
    for what, known in COLUMNS.items():
        places = [place for place, name in enumerate(names) if name in known]
        if len(places) > 1:
            raise ValueError(f"{shown} has the columns {' and '.join(rows[0][1][p].strip() for p in places)}; one only")
        found |= dict.fromkeys([what], places[0]) if places else {}
    if "times_s" not in found:
        raise ValueError(f"{shown} has no column of the time; it must be named time, t or time_s")
    columns: dict[str, list[float]] = {what: [] for what in found}
    for number, row in rows[1:]:
        for what, place in found.items():
            word = row[place].strip() if place < len(row) else ""
            try:
                value = float(word)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise ValueError(
                    f"{shown}, line {number}: {word!r} in the column {rows[0][1][place].strip()} must be a finite "
                    "number"
                )
            columns[what].append(value)
    return _table_of(shown, columns, velocity, width)


def _table_of(shown: str, columns: dict[str, list[float]], velocity: Any, width: Any) -> dict[str, tuple[float, ...]]:
    table = {what: tuple(values) for what, values in columns.items() if what != "discharge"}
    if "velocities_m_per_s" in table and velocity is not None:
        raise ValueError(f"{shown} has a column of the velocity; velocity_m_per_s = {velocity} must then be left out")
    per_metre = 1.0
    if width is not None:
        if "discharge" not in columns:
            raise ValueError(f"{shown} has no discharge; width_m = {width} must then be left out")
        if not isinstance(width, int | float) or not 0.0 < width <= 1e6:
            raise ValueError(f"width_m = {width} is not allowed; it must be a number greater than 0 and at most 1e+06")
        per_metre = float(width)
    if "depths_m" in table:
        if "velocities_m_per_s" not in table and velocity is None:
            speeds = _divided(columns.get("discharge"), per_metre, columns["depths_m"])
            if speeds is None:
                raise ValueError(f"{shown} has no column of the velocity; give one, or velocity_m_per_s")
            table["velocities_m_per_s"] = speeds
        return table
    if "discharge" not in columns:
        raise ValueError(f"{shown} has no column of the depth; it must have depth or discharge")
    speed = columns.get("velocities_m_per_s")
    if speed is None:
        if not isinstance(velocity, int | float) or not velocity > 0.0:
            raise ValueError(f"{shown} has no column of the velocity; give one, or velocity_m_per_s")
        speed = [float(velocity)] * len(columns["discharge"])
    depths = _divided(columns["discharge"], per_metre, speed)
    assert depths is not None
    return table | {"depths_m": depths}


def _divided(discharge: list[float] | None, width: float, by: list[float]) -> tuple[float, ...] | None:
    """Discharge per metre of width over a depth, or a velocity; 0 where there is none."""
    if discharge is None:
        return None
    return tuple(
        q / width / other if q != 0.0 and other != 0.0 else 0.0 for q, other in zip(discharge, by, strict=True)
    )


def _plain(name: str) -> str:
    """A column's name in small letters, without a unit in brackets."""
    return re.sub(r"\W+", "_", re.sub(r"[(\[].*?[)\]]", "", name).strip().lower()).strip("_")
