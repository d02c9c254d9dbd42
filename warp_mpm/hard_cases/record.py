"""The record of the collection: pictures, figures and the page docs/robustness.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analytic.whole_file import write_whole
from warp_mpm.accuracy.keys import code_digest, imported_by, run_key
from warp_mpm.fields import field_named
from warp_mpm.hard_cases.collection import HardCase
from warp_mpm.hard_cases.criteria import CRITERIA
from warp_mpm.hard_cases.measure import Measured
from warp_mpm.hard_cases.safeguards import KNOWN_LIMITS, SAFEGUARDS
from warp_mpm.plotting.points import draw_points, draw_surroundings, window
from warp_mpm.results import Snapshot

Outcome = tuple[HardCase, Measured]


class Kept:
    """Figures of the cases that have been run, in a file that is written whole after each.

    Args:
        path: of the file; an earlier run's cases stay in it if this one goes on with it.
        halved: whether this run makes the runs at half the time step.
        goes_on: find what the same program has measured before.
    """

    def __init__(self, path: Path, *, halved: bool, goes_on: bool) -> None:
        self._path, self._halved, self._goes_on = path, halved, goes_on
        self._cases: dict[str, dict[str, Any]] = {}
        if goes_on and path.exists():
            try:
                self._cases = dict(json.loads(path.read_text(encoding="utf-8")))
            except ValueError as error:
                raise ValueError(f"{path} cannot be read: {error}; without --resume it is replaced") from None

    def found(self, case: HardCase) -> Measured | None:
        """What was measured of a case before, without its snapshots; None where it must be run."""
        one = self._cases.get(case.name)
        if not self._goes_on or not isinstance(one, dict) or one.get("key") != self._key(case):
            return None
        return Measured(dict(one["figures"]), one["problem"])

    def keep(self, case: HardCase, measured: Measured) -> None:
        """Add a case to the file.

        Raises:
            UnwrittenError: the file cannot be written.
        """
        self._cases[case.name] = {
            "stable": not measured.failures(case.scenario),
            "problem": measured.problem,
            "figures": measured.figures,
            "key": self._key(case),
        }
        write_whole(self._path, json.dumps(self._cases, indent=2) + "\n")

    def _key(self, case: HardCase) -> str:
        # Figures are ratios to bounds: whatever the measurement imports counts, not its own module alone.
        own = code_digest(sorted(imported_by("warp_mpm.hard_cases.measure")))
        return f"{run_key(case.scenario)}-{own}" + "-halved" * self._halved


def picture(case: HardCase, measured: Measured, path: Path) -> None:
    """Draw the case at its most violent snapshot and at its end, coloured by pore pressure (speed, if dry)."""
    frames = [frame for frame in (measured.peak, measured.last) if frame is not None and len(frame.position) > 0]
    windows = [_in_sight(case, frame) for frame in frames]
    shapes = [max((right - left) / (top - bottom), 0.8) for left, right, bottom, top in windows]
    height = min(max(7.5 / max(sum(shapes), 1.0), 0.7), 2.6)
    figure = Figure(figsize=(9.5, height + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, max(len(frames), 1), width_ratios=shapes or [1.0])
    for panel, frame, sight in zip(np.ravel(panels)[: len(frames)], frames, windows, strict=True):
        wet = "pore_pressure" in frame
        field = field_named("pore_pressure" if wet else "speed")
        values = frame["pore_pressure"] / 1e3 if wet else np.hypot(*frame["solid_velocity"].T)
        drawn = draw_points(panel, frame, values, field, (0.0, max(float(np.quantile(values, 0.99)), 1e-9)))
        draw_surroundings(panel, case.scenario, frame, sight)
        panel.set_title(f"{frame.time:.2f} s, ≤ {abs(values.max()):,.0f} {field.unit}", fontsize=8, loc="left")
        panel.tick_params(labelsize=7)
        figure.colorbar(drawn, ax=panel, shrink=0.9, pad=0.01).ax.tick_params(labelsize=7)
    figure.savefig(path, dpi=75)


def _in_sight(case: HardCase, frame: Snapshot) -> tuple[float, float, float, float]:
    """Limits that leave out the spray: the innermost 98 % of the points, and the barrier."""
    low, high = np.quantile(frame.position, [0.01, 0.99], axis=0)
    inner = ((frame.position >= low) & (frame.position <= high)).all(axis=1)
    if not inner.any():
        inner[:] = True
    fields = {name: values[inner] for name, values in frame.fields.items()}
    core = Snapshot(frame.time, frame.barrier_displacement, frame.position[inner], fields)
    left, right, bottom, top = window(case.scenario, [core])
    return left, right, bottom, max(top, bottom + 0.15 * (right - left))


def verdict(case: HardCase, measured: Measured) -> str:
    """`stable`, or what was not met."""
    failures = measured.failures(case.scenario)
    if not failures:
        return "stable"
    return ", ".join(f"{criterion.figure} {value:.2g}" for criterion, value in failures)


COLUMNS = (
    ("energy_error", "energy"),
    ("momentum_error", "momentum"),
    ("speed_ratio", "speed"),
    ("pressure_ratio", "pressure"),
    ("penetration", "depth"),
    ("pressure_noise", "noise"),
    ("stress_ratio", "stress"),
    ("pushed_share", "set back"),
    ("gaps_bounded_share", "gaps cut"),
    ("voids_closed_share", "no voids"),
    ("halving_peak_force", "Δt/2: force"),
    ("halving_displacement", "Δt/2: Δx"),
)
"""Figures shown in tables, with their short headings."""


def row(case: HardCase, measured: Measured) -> list[str]:
    """Cells of a table: name, figures, verdict."""
    figures = [measured.figures.get(name) for name, _ in COLUMNS]
    shown = ["" if value is None else f"{value:.0e}" if 0 < value < 1e-3 else f"{value:.2g}" for value in figures]
    return [case.name, *shown, verdict(case, measured)]


def record_page(outcomes: list[Outcome], pictures: str) -> str:
    """The page docs/robustness.md.

    Args:
        outcomes: every case with its figures.
        pictures: folder of the pictures, as seen from the page.
    """
    stable = sum(not measured.failures(case.scenario) for case, measured in outcomes)
    lines = [
        "# Robustness",
        "",
        "Made by `python -m warp_mpm hard-cases --page docs/robustness.md`; do not edit by hand. `--small` leaves out "
        "the scene of a million material points.",
        "",
        f"Scenes chosen to break the code: {stable} of {len(outcomes)} meet every demand. Most are coarse variants of "
        "case 1 (3 m deep, 0.5 m spacing), so that each runs in seconds: a coarse grid is the harder test.",
        "",
        "## What is demanded",
        "",
        "| figure | at most | float32 | meaning |",
        "|---|---|---|---|",
        *(f"| {c.figure} | {c.limit:g} | {c.single_precision_limit:g} | {c.meaning} |" for c in CRITERIA),
        "",
        "## The collection",
        "",
        "| case | " + " | ".join(heading for _, heading in COLUMNS) + " | verdict |",
        "|---" * (len(COLUMNS) + 2) + "|",
        *("| " + " | ".join(row(case, measured)) + " |" for case, measured in outcomes),
        "",
        "## Safeguards, and the scene that needs each",
        "",
        "Every one is switched off in `tests/hard_cases/test_safeguards.py`, which shows the scene that then fails.",
        "",
        "| safeguard | what it does | what fails without it |",
        "|---|---|---|",
        *(f"| {guard.name} | {guard.action} | {guard.without} |" for guard in SAFEGUARDS),
        "",
        "## Known not to work",
        "",
        *(f"- {limit}" for limit in KNOWN_LIMITS),
        "",
        "## Pictures",
        "",
        "Left: the snapshot with the greatest pressure (speed, if dry); right: the end. Colours end at the 99th "
        "percentile, frames at the 98th: spray flies beyond.",
        "",
    ]
    for case, measured in outcomes:
        lines += [
            f"### {case.name}",
            "",
            f"{case.scenario.title}. {case.reason} **{verdict(case, measured)}**"
            + (f" {measured.problem}" if measured.problem else ""),
            "",
            f"![{case.name}]({pictures}/{case.name}.png)",
            "",
        ]
    return "\n".join(lines)
