"""What a person sees in the terminal while a scene runs and afterwards."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn
from rich.table import Table
from rich.text import Text

from analytic.command_line import other_ends
from warp_mpm.caveats import impact_goes_on, run_caveats, scene_caveats
from warp_mpm.description import described
from warp_mpm.design_checks import verdict_rows
from warp_mpm.quantities.figures import FIGURES
from warp_mpm.quantities.quantity import of_width
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.results import Results
from warp_mpm.run import RunOutcome, RunProgress
from warp_mpm.scenario import Scenario

REFRESH = 0.1
"""Least time [s] between two states of the bar: a run has hundreds of records a second."""

PLAIN_LINES = 10
"""Lines of progress in a pipe, where there is no bar."""

PIPE_WIDTH = 160
"""Columns of a table in a pipe or a file, which has no edge to fit to."""


class StopOnSignal:
    """Ctrl-C, termination and a terminal that is closed ask the run to stop after its present steps; a second Ctrl-C
    ends it at once, and so does the first while nothing has been computed."""

    def __init__(self) -> None:
        self.received = False
        self._nothing_to_lose = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, *other_ends()):
            self._before[number] = signal.signal(number, self._receive)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Around what may be broken off: kernels take half a minute to compile."""
        self._nothing_to_lose = True
        try:
            yield
        finally:
            self._nothing_to_lose = False

    def _receive(self, number: int, frame: FrameType | None) -> None:
        if self.received or self._nothing_to_lose:
            raise KeyboardInterrupt
        self.received = True


class RunDisplay:
    """A progress bar on a terminal, a few plain lines in a pipe, nothing when quiet."""

    def __init__(self, scenario: Scenario, *, device: str, quiet: bool = False):
        self._console = Console(quiet=quiet, highlight=False, markup=False)
        if not self._console.is_terminal:
            self._console.width = PIPE_WIDTH
        self._scenario, self._device = scenario, device
        self._bar: Progress | None = None
        self._task = TaskID(0)
        self._lines = 0
        self._shown = -math.inf

    def __enter__(self) -> Self:
        self._console.print(self._scenario.title, style="bold")
        lines = "\n".join(described(self._scenario))
        self._console.print(f"{lines}; {self._device}", soft_wrap=True)
        for sentence in scene_caveats(self._scenario):
            self._console.print(f"Note: {sentence}", soft_wrap=True)
        if self._console.is_terminal and not self._console.quiet:
            self._bar = Progress(
                SpinnerColumn(),
                BarColumn(bar_width=max(4, min(24, self._console.width - 78))),
                TextColumn("{task.description}"),
                console=self._console,
                transient=True,
            )
            self._task = self._bar.add_task(
                "preparing (kernels of new effects are compiled once)", total=self._scenario.output.end_time_s
            )
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, progress: RunProgress) -> None:
        """Bring the display up to date."""
        if self._bar is not None:
            now = time.monotonic()
            if now - self._shown < REFRESH and progress.time < progress.end_time:
                return
            self._shown = now
            self._bar.update(self._task, completed=progress.time, description=_state(progress))
        elif progress.time >= self._lines / PLAIN_LINES * progress.end_time:
            self._lines = math.floor(progress.time / progress.end_time * PLAIN_LINES) + 1
            self._console.print(_state(progress), soft_wrap=True)

    def summarize(self, outcome: RunOutcome) -> None:
        """Print the key figures of a run."""
        table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
        table.add_column(style="dim")
        table.add_column()
        for name, value in summary_rows(outcome.summary):
            table.add_row(Text(name), Text(value))
        self._console.print(table)
        for sentence in run_caveats(Results.open(outcome.path).record, outcome.summary):
            self._console.print(f"Note: {sentence}", soft_wrap=True)
        self._console.print(f"Results are in {outcome.path}", soft_wrap=True)


def _barrier_row(row: Mapping[str, Any]) -> str:
    """Force, motion and volumes of one of several barriers."""
    parts = []
    if row["peak_force_filtered"] is not None:
        when = "" if row["peak_force_filtered_time"] is None else f" at {row['peak_force_filtered_time']:.3f} s"
        parts.append(FIGURES["peak_force_filtered"].text(row["peak_force_filtered"], ",.1f") + when)
    if row["heel_moment_filtered"]:
        parts.append(FIGURES["heel_moment_filtered"].text(row["heel_moment_filtered"], ",.1f") + " about its heel")
    if row["pressure_patch_max"]:
        parts.append(FIGURES["pressure_patch_max"].text(row["pressure_patch_max"], ",.1f") + " on the face")
    if row["displacement"]:
        parts.append(f"moved {row['displacement']:.2f} m")
    if row["held_volume"] is not None:
        parts.append(f"holds {row['held_volume']:.1f} {of_width('m³')}, passed by {row['passed_volume']:.1f}")
    if row["landing_distance"] is not None:
        parts.append(f"landing {row['landing_distance']:.1f} m from its heel")
    return "; ".join(parts)


def summary_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and value, with unit, of the figures that a person wants first; those that are None are left out."""

    def told(name: str, form: str = ",.1f", at: str | None = None) -> str | None:
        value = summary.get(name)
        if value is None:
            return None
        moment = summary.get(at) if at is not None else None
        return FIGURES[name].text(value, form) + (f" at {moment:.3f} s" if moment is not None else "")

    def relative(name: str) -> str | None:
        value = summary.get(name)
        return None if value is None else f"{value:.1e}"

    def patch(name: str) -> str | None:
        height = summary.get(f"{name}_height")
        where = "" if height is None else f", {height:.2f} m up"
        value = told(name, at=f"{name}_time")
        return None if value is None else value + where

    volumes = [
        f"{summary[name]:.1f} {FIGURES[name].short}"
        for name in ("retained_volume", "on_crest_volume", "overtopped_volume")
        if summary.get(name) is not None
    ]

    def words(name: str) -> str:
        return FIGURES[name].words

    # Where there is no face to press on, or the run is an older one's.
    pressed = summary.get("pressure_patch_max") is not None
    mean_over = " and ".join(filter(None, (told(f"pressure_patch_{unit}", "g") for unit in "ms")))
    smallest, limit = summary.get("time_step_min"), summary.get("time_step_limit")
    rows = [
        (words("inflow_volume"), told("inflow_volume", ",.1f")),
        (words("peak_force_filtered"), told("peak_force_filtered", at="peak_force_filtered_time")),
        ("  over one record", told("peak_force", at="peak_force_time")),
        ("  acting at a height of", told("peak_force_height", ",.2f")),
        (words("impulse"), told("impulse")),
        (words("impact_start_time"), told("impact_start_time", ",.3f")),
        (
            f"{words('rise_time')} {FIGURES['rise_time'].symbol}, duration {FIGURES['impact_duration'].symbol}",
            _times(summary),
        ),
        (words("pressure_patch_max"), patch("pressure_patch_max")),
        ("  as a mean over", mean_over if pressed else None),
        ("  of the liquid", patch("pore_pressure_patch_max")),
        (words("pore_pressure_max"), None if pressed else told("pore_pressure_max", at="pore_pressure_max_time")),
        (words("barrier_velocity_max"), told("barrier_velocity_max", ",.2f")),
        (words("barrier_displacement_final"), displacement(summary)),
        (f"volume [{FIGURES['retained_volume'].shown_unit}]", ", ".join(volumes) or None),
        ("mechanism seen so far" if impact_goes_on(summary) else "mechanism seen", summary.get("mechanism")),
        *((f"barrier {row['name']}", _barrier_row(row)) for row in summary.get("barriers") or ()),
        *((words(name), relative(name)) for name in ("mass_error", "momentum_error", "energy_error")),
        (
            "time steps",
            None if smallest is None else f"{summary['steps']:,}, smallest {smallest:.2e} s, mostly limited by {limit}",
        ),
        (words("wall_time"), told("wall_time")),
    ]
    judged = verdict_rows(summary["verdict"]) if summary.get("verdict") else []
    return [*((name, value) for name, value in rows if value is not None), *judged]


def displacement(summary: Mapping[str, Any]) -> str | None:
    """Sliding distance with its unit, and whether it is final."""
    value = summary.get("barrier_displacement_final")
    if value is None:
        return None
    still = summary.get("barrier_at_rest") is False
    told = FIGURES["barrier_displacement_final"].text(value, ",.3f")
    return told + (f", still sliding at {summary['barrier_velocity_final']:.3g} m/s" if still else "")


AT_LEAST = "≥ before Δx: the barrier still slides at the end of the run."


def sliding_distance(summary: Mapping[str, Any]) -> str:
    """Sliding distance [m] for a table, marked where it is not final (`AT_LEAST`)."""
    value = summary.get("barrier_displacement_final")
    if value is None:
        return "–"
    return ("≥ " if summary.get("barrier_at_rest") is False else "") + f"{value:,.4g}"


def _times(summary: Mapping[str, Any]) -> str | None:
    """Rise time and duration of the impact, as far as the run tells them; None where there is none."""
    rise, duration = summary.get("rise_time"), summary.get("impact_duration")
    if rise is None:
        return "the force still rises at the end of the run" if summary.get("force_still_rises") else None
    return f"{rise:,.3f} s, " + ("not over at the end of the run" if duration is None else f"{duration:,.3f} s")


def _state(progress: RunProgress) -> str:
    left = progress.time_left
    parts = [f"t = {progress.time:.2f} of {progress.end_time:g} s"]
    if left is not None:
        parts += [f"{progress.rate:.3g} s/s", f"{int(left) // 60}:{int(left) % 60:02d} left"]
    for name, form in (("impact_force_x", ".0f"), ("barrier_velocity", ".2f")):
        if name in progress.sample:
            parts.append(f"{NAMED[name].symbol} = {NAMED[name].text(progress.sample[name], form)}")
    return "  ".join(parts)
