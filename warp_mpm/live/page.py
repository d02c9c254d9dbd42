"""What the page shows, and when a run makes it: only while somebody looks, and at times at which it records anyway."""

from __future__ import annotations

import html
import json
import math
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from string import Template
from types import TracebackType
from typing import Any, Self

from warp_mpm.live.server import Server
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.recording.run_folder import finite
from warp_mpm.recording.schedule import Schedule
from warp_mpm.report import page as report
from warp_mpm.report.content import setting
from warp_mpm.report.points import packed_frames
from warp_mpm.run import RunProgress
from warp_mpm.scenario import Scenario
from warp_mpm.snapshot import snapshot_of

ASSETS = Path(__file__).parent / "assets"

MOST_POINTS = 20_000
"""Points of a picture; of more, one in so many is shown."""

REST = 50.0
"""How many times longer than a picture takes none is made, so that looking costs 2 % at most."""

LEAST_REST = 0.25
"""Least wall time between two pictures [s]."""

LOOKED_AT = 5.0
"""Wall time after a request for which somebody is taken to look [s]; the page asks twice a second."""

LAST_LOOK = 3.0
"""Longest that the end of a run waits for a page to hear of it [s]."""

CHARTS: Mapping[str, tuple[str, ...]] = {
    "impact force": ("impact_force_x",),
    "barrier displacement": ("barrier_displacement",),
    "kinetic energy of the flow": ("flow_kinetic_energy",),
}
"""Columns of the time series that are drawn as they come."""


class LivePage:
    """Shows a run in browsers of this machine. A recorder, and a context manager that serves.

    It lands on no times but those of the time series, so that the steps are the same with and without it.
    """

    def __init__(self, scenario: Scenario, folder: str | Path, *, port: int = 0):
        """Args: scenario that runs; folder of the run; port of 127.0.0.1, 0 for a free one.

        Raises:
            ValueError: the port cannot be had.
        """
        self.schedule = Schedule(scenario.output.time_series_interval_s)
        self._scenario, self._folder = scenario, Path(folder)
        self._charts = _charts(scenario)
        self._lock = threading.Lock()
        self._status, self._words = "preparing", "preparing (kernels of new effects are compiled once)"
        self._progress: RunProgress | None = None
        self._samples: list[list[float | None]] = []
        self._frame: dict[str, Any] | None = None
        self._frames = 0
        self._next_frame = self._last_request = -math.inf
        self._simulation: Any = None
        self._stop, self._keep, self._keeping = False, False, False
        self._kept: float | None = None
        self._heard = threading.Event()
        self._server = Server(self, port)

    @property
    def address(self) -> str:
        """Of the page; whoever does not know it sees nothing and stops nothing."""
        return self._server.address

    def __enter__(self) -> Self:
        self._server.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, Exception):  # who ends the program at once does not wait for a page
            self._tell_end("failed", f"ended: {error}" if str(error) else "ended")
        self._server.end()

    def watching(self, on_progress: Callable[[RunProgress], None], stop: Callable[[], bool]) -> dict[str, Any]:
        """What `run_scenario` and `resume_run` take to be watched; `on_progress` and `stop` are one's own."""

        def show(progress: RunProgress) -> None:
            self.show(progress)
            on_progress(progress)

        return {
            "recorders": [self],
            "on_progress": show,
            "stop": lambda: self._stop or stop(),
            "keep": self.keep_asked,
        }

    def end(self, finished: bool) -> None:
        """Tell a page that is open that the run has finished, or was stopped, and wait until it has heard."""
        self._tell_end("finished" if finished else "stopped", "finished" if finished else "stopped")

    # -- what the run calls --------------------------------------------------------------------------------------------

    def record(self, simulation: Any) -> None:
        """Make a picture, if somebody looks and the last one is old enough."""
        self._simulation = simulation
        now = time.monotonic()
        if now >= self._next_frame and now - self._last_request < LOOKED_AT:
            self._take(simulation)
            self._next_frame = time.monotonic() + max(LEAST_REST, REST * (time.monotonic() - now))

    def close(self) -> None:
        """Of the recorder: there is nothing to close, the page stays until `__exit__`."""

    def show(self, progress: RunProgress) -> None:
        """Take where the run stands."""
        sample = progress.sample
        columns = [name for chart in self._charts for name in chart["columns"]]
        row = [sample.get("time"), *(sample.get(name) for name in columns)]
        with self._lock:
            if self._status == "preparing":
                self._status, self._words = "running", "running"
            self._progress = progress
            if not self._samples or self._samples[-1][0] != row[0]:
                self._samples.append(row)
            if self._keeping:
                self._keeping, self._kept = False, progress.time

    def keep_asked(self) -> bool:
        """Whether somebody asked to keep what is there, since this was asked last."""
        if not self._keep:
            return False
        self._keep, self._keeping = False, True
        return True

    def _tell_end(self, status: str, words: str) -> None:
        watched = time.monotonic() - self._last_request < LOOKED_AT
        if watched and self._simulation is not None and status != "failed":
            self._take(self._simulation)
        with self._lock:
            self._status, self._words = status, words
        if watched:
            self._heard.wait(LAST_LOOK)

    def _take(self, simulation: Any) -> None:
        snapshot = snapshot_of(simulation)
        if len(snapshot.position) == 0:  # of a flow that is yet to arrive
            return
        moved = {"barrier": snapshot.barrier_displacement or 0.0}
        for one in self._scenario.barriers:
            if one.motion.kind != "fixed":
                moved[one.name] = float(simulation.body_displacement(one.name)[0])
        stride = -(-len(snapshot.position) // MOST_POINTS)
        points, numbers = packed_frames(self._scenario, [(snapshot, moved)], stride)
        with self._lock:
            self._frames += 1
            self._frame = {"number": self._frames, "points": points, "numbers": numbers}

    # -- what the server calls, in its own threads ---------------------------------------------------------------------

    def page(self) -> str:
        """The page; it needs nothing from elsewhere."""
        data = {
            "title": self._scenario.title,
            "end": self._scenario.output.end_time_s,
            "charts": self._charts,
            "colours": {kind: report.palette(name) for kind, name in report.COLOURS.items()},
        }
        scripts = [report.ASSETS / "points.js", report.ASSETS / "charts.js", ASSETS / "live.js"]
        return Template((ASSETS / "live.html").read_text(encoding="utf-8")).substitute(
            title=html.escape(self._scenario.title),
            folder=html.escape(str(self._folder)),
            style=(report.ASSETS / "style.css").read_text(encoding="utf-8"),
            data=report.embedded(data | setting(self._scenario)),
            script="\n".join(script.read_text(encoding="utf-8") for script in scripts),
        )

    def state(self, samples: int, frame: int) -> str:
        """Where the run stands, as JSON, with what came after so many samples and after the frame of that number."""
        self._last_request = time.monotonic()
        with self._lock:
            progress = self._progress
            found = {
                "status": self._status,
                "words": self._words,
                "time": progress.time if progress is not None else 0.0,
                "rate": progress.rate if progress is not None else None,
                "left": progress.time_left if progress is not None else None,
                "stopping": self._stop,
                "keeping": self._keep or self._keeping,
                "kept": self._kept,
                "samples": self._samples[max(samples, 0) :],
                "frame": self._frame if self._frames > frame else None,
            }
        return json.dumps(finite(found), ensure_ascii=False, allow_nan=False)

    def ask(self, what: str) -> bool:
        """Take a request, `stop` or `keep`; false where there is no such."""
        if what == "stop":
            self._stop = True
        elif what == "keep":
            self._keep = True
        elif what == "heard":
            self._heard.set()
        else:
            return False
        return True


def _charts(scenario: Scenario) -> list[dict[str, Any]]:
    """Charts of what the scene has: title, unit and factor to it, columns and what each is called."""
    found = []
    for title, names in CHARTS.items():
        further = [f"{one.name}_force_x" for one in scenario.barriers] if "impact_force_x" in names else []
        if names[0] in NAMED and NAMED[names[0]].there(scenario):
            quantity = NAMED[names[0]]
            labels = [quantity.words, *(f"on {one.name}, whole barrier" for one in scenario.barriers if further)]
            found.append(
                {
                    "title": title,
                    "unit": quantity.shown_unit,
                    "factor": quantity.factor,
                    "columns": [*names, *further],
                    "labels": labels,
                }
            )
    return found
