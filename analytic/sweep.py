"""Scenes over which the closed form's numbers are fitted: planning them, and collecting what simulations say.

The scenes are scenario files of the simulator, which this package writes but does not run. What comes back is one
table, a CSV file with one row for each run.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from analytic.calibration import CalibrationError, at_rest, measure, measured_key_figures, measured_vertical_load_ratio
from analytic.scene import Scene, SceneError, read_scene
from analytic.time_series import read_time_series
from analytic.whole_file import whole_file

RANGES = {
    "froude_number": (1.0, 5.0),
    "depth": (1.0, 4.0),
    "length_ratio": (3.0, 10.0),
    "porosity": (0.3, 0.55),
    "face_angle": (50.0, 90.0),
    "height_ratio": (1.25, 4.0),
    "mass_ratio": (0.5, 3.0),
    "base_friction": (0.2, 0.5),
}
"""Ranges of a sweep: Fr = v / sqrt(g h), h [m], L / h, n, beta [degrees], H / h, m2 / m1, tan(delta_b)."""

LOGARITHMIC = ("froude_number", "depth", "length_ratio", "height_ratio", "mass_ratio", "base_friction")
"""Ranges that are filled evenly in the logarithm."""

FIXED_SHARE = 0.3
"""Share of the scenes whose barrier is fixed."""

CELLS_PER_DEPTH = 8
"""Grid cells over the flow's depth; coarse, for a trend and not for a figure."""

CREST_WIDTH = 0.5
"""Crest width over the barrier's height [-]."""

GRAVITY = 9.81


def plan(template: Mapping[str, Any], count: int, seed: int = 1) -> dict[str, dict[str, Any]]:
    """Scenario files of a sweep by name, spread evenly over `RANGES` by a scrambled Sobol' sequence.

    Args:
        template: content of a two-phase scenario with a trapezoid; the material beside the porosity is taken from it.
        count: number of scenes > 0.
        seed: of the sequence.

    Raises:
        ValueError: the count is not positive.
    """
    if count < 1:
        raise ValueError(f"count is {count}, it must be at least 1.")
    from scipy.stats import qmc

    points = qmc.Sobol(len(RANGES) + 1, seed=seed).random(count)
    return {f"scene_{index:03d}": _scene(template, _stretch(point), index) for index, point in enumerate(points)}


def _stretch(point: Sequence[float]) -> dict[str, float]:
    values = {}
    for share, (name, (low, high)) in zip(point, RANGES.items(), strict=False):
        values[name] = low * (high / low) ** share if name in LOGARITHMIC else low + (high - low) * share
    return values | {"fixed": float(point[-1] < FIXED_SHARE)}


def _scene(template: Mapping[str, Any], at: Mapping[str, float], index: int) -> dict[str, Any]:
    depth, angle = at["depth"], at["face_angle"]
    squares = max(round(at["length_ratio"]) - 2, 0)
    length = (2 + squares) * depth
    speed = at["froude_number"] * math.sqrt(GRAVITY * depth)
    height = at["height_ratio"] * depth
    material = dict(template["flow"]["material"]) | {"porosity": round(at["porosity"], 4)}
    n = material["porosity"]
    density = (1 - n) * material["grain_density_kg_per_m3"] + n * material["liquid_density_kg_per_m3"]
    motion: dict[str, Any] = {"kind": "fixed"}
    sliding_time = 0.0
    if not at["fixed"]:
        mass = at["mass_ratio"] * density * length * depth
        motion = {"kind": "sliding", "mass_kg_per_m": round(mass, 1), "base_friction": round(at["base_friction"], 4)}
        sliding_time = speed / (1 + at["mass_ratio"]) / (GRAVITY * at["base_friction"])
    # Long enough for the whole flow to have come, and for the barrier to have stopped.
    end = (depth + 3 * length) / speed + sliding_time + 8 * math.sqrt(height / GRAVITY)
    return {
        "title": f"Sweep {index}: " + ", ".join(f"{name} {value:.3g}" for name, value in at.items()),
        "gravity": {"acceleration_m_per_s2": GRAVITY, "tilt_deg": 0},
        "flow": {
            **template["flow"],
            "shape": {
                "kind": "front_and_tail",
                "depth_m": round(depth, 4),
                "squares": squares,
                "distance_m": round(depth, 4),
            },
            "velocity_m_per_s": [round(speed, 4), 0],
            "material": material,
        },
        "barrier": {
            "shape": {
                "kind": "trapezoid",
                "crest_width_m": round(CREST_WIDTH * height, 4),
                "height_m": round(height, 4),
                "face_angle_deg": round(angle, 3),
            },
            "motion": motion,
            "friction": template["barrier"]["friction"],
        },
        "ground": {"friction": 0},
        "numerics": {**template.get("numerics", {}), "spacing_m": round(depth / CELLS_PER_DEPTH, 4)},
        "output": {
            "end_time_s": round(end, 2),
            "time_series_interval_s": 0.005,
            "snapshot_interval_s": round(end, 2),
        },
    }


# --- the table -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """One row of the table: a scene and what its simulation says. SI units per metre of width."""

    name: str
    fixed: bool
    flow_mass: float
    flow_length: float
    flow_height: float
    speed: float
    porosity: float
    face_angle: float
    barrier_height: float
    barrier_mass: float
    """`nan` where the barrier is fixed, likewise in the columns below that it has no value for."""
    base_friction: float
    peak_force: float
    """Of the filtered force, see `analytic.calibration`."""
    rise_time: float
    duration: float
    impulse: float
    vertical_load_ratio: float
    barrier_displacement_final: float
    barrier_velocity_max: float
    at_rest: bool
    """Whether the barrier was at rest when the record ended."""

    @property
    def scene(self) -> Scene:
        """The scene, as the closed form takes it."""
        return Scene(
            flow_mass=self.flow_mass,
            flow_length=self.flow_length,
            flow_height=self.flow_height,
            speed=self.speed,
            barrier_mass=None if self.fixed else self.barrier_mass,
            base_friction=None if self.fixed else self.base_friction,
            porosity=self.porosity,
            face_angle=self.face_angle,
            barrier_height=self.barrier_height,
            title=self.name,
        )


def collect(folder: Path) -> Run:
    """The row of a run folder.

    Raises:
        SceneError, TimeSeriesError, CalibrationError: the folder holds no usable record of an impact, or one that ends
        before the impact does, or of an impact on a slope, for which the table has no column.
    """
    scene, series = read_scene(folder), read_time_series(folder)
    if scene.slope != 0:
        raise SceneError(f"{folder}: gravity.tilt_deg is {scene.slope:g}, a sweep is of level ground.")
    measured = measure(series["time"], series["impact_force_x"])
    if measured.warning is not None:
        raise CalibrationError(f"{folder}: {measured.warning}.")
    figures = measured_key_figures(series, measured)
    kappa = displacement = largest = math.nan
    if scene.barrier_mass is not None:
        kappa = measured_vertical_load_ratio(
            series["time"], series["impact_force_x"], series["base_normal_force"], scene.weight_on_base, measured
        )
        displacement, largest = float(series["barrier_displacement"][-1]), float(series["barrier_velocity"].max())
    return Run(
        name=folder.name,
        fixed=scene.fixed,
        flow_mass=scene.flow_mass,
        flow_length=scene.flow_length,
        flow_height=scene.flow_height,
        speed=scene.speed,
        porosity=scene.porosity or math.nan,
        face_angle=scene.face_angle or math.nan,
        barrier_height=scene.barrier_height or math.nan,
        barrier_mass=math.nan if scene.barrier_mass is None else scene.barrier_mass,
        base_friction=math.nan if scene.base_friction is None else scene.base_friction,
        peak_force=figures.peak_force,
        rise_time=measured.rise_time,
        duration=measured.duration,
        impulse=figures.impulse,
        vertical_load_ratio=kappa,
        barrier_displacement_final=displacement,
        barrier_velocity_max=largest,
        at_rest=scene.fixed or at_rest(series),
    )


def write_table(runs: Iterable[Run], path: Path, remark: str = "") -> None:
    """Write the table; `remark` becomes a comment in its first line."""
    with whole_file(path) as aside, aside.open("w", encoding="utf-8", newline="") as file:
        if remark:
            file.write(f"# {remark}\n")
        writer = csv.writer(file)
        writer.writerow(field.name for field in fields(Run))
        for run in runs:
            writer.writerow(f"{v:.6g}" if isinstance(v, float) else v for v in asdict(run).values())


def read_table(path: Path) -> list[Run]:
    """Read a table that `write_table` has written.

    Raises:
        ValueError: the file cannot be read, or is no such table; one sentence.
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}.") from None
    names = [field.name for field in fields(Run)]
    rows = list(csv.reader(lines))
    if not rows or rows[0] != names:
        raise ValueError(f"{path} is no table of a sweep, its columns must be {', '.join(names)}.")
    runs = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            values: list[Any] = [
                text if field.type == "str" else text == "True" if field.type == "bool" else float(text)
                for field, text in zip(fields(Run), row, strict=True)
            ]
        except ValueError:
            raise ValueError(f"{path}: row {number} is no row of a sweep's table.") from None
        runs.append(Run(*values))
    return runs
