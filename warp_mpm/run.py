"""A whole run: a scenario in, a run folder out, or the same in memory. Both are one loop with different recorders."""

from __future__ import annotations

import contextlib
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from warp_mpm.arrival_figures import arrival_figures, with_what_arrives
from warp_mpm.barrier_figures import barrier_figures
from warp_mpm.caveats import run_caveats, scene_caveats
from warp_mpm.design_checks import verdict
from warp_mpm.quantities import recorded_quantities
from warp_mpm.quantities.time_series import OWN
from warp_mpm.recording import (
    Checkpointer,
    LoadsInMemory,
    LoadsRecorder,
    Recorder,
    RunFolder,
    Schedule,
    SeriesInMemory,
    SnapshotRecorder,
    SnapshotsInMemory,
    TimeSeriesRecorder,
    read_checkpoint,
    record_until,
    run_folder,
)
from warp_mpm.recording.checkpoint import Checkpoint, versions
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.recording.surfaces import write_surfaces
from warp_mpm.results import Loads, Results, ResultsError, SurfaceLoads
from warp_mpm.scenario import Scenario
from warp_mpm.snapshot import Snapshot
from warp_mpm.summary import summarize


@dataclass(frozen=True)
class RunProgress:
    """Where a run stands."""

    time: float
    """Simulated time [s]."""
    end_time: float
    """Simulated time at which the run ends [s]."""
    rate: float | None
    """Simulated seconds per second, compilation left out; None until it can be told."""
    sample: dict[str, float]
    """Latest sample of the time series."""

    @property
    def time_left(self) -> float | None:
        """Wall time that is left at this rate [s]; None until it can be told."""
        return (self.end_time - self.time) / self.rate if self.rate else None


@dataclass(frozen=True)
class RunOutcome:
    """What came of a run."""

    path: Path
    """The run folder."""
    finished: bool
    """False when it was stopped before its end."""
    summary: dict[str, Any]
    """Key figures, as in summary.json."""


@dataclass(frozen=True)
class MemoryRun:
    """A run that left nothing on the disk."""

    scenario: Scenario
    finished: bool
    """False when it was stopped before its end."""
    time_series: dict[str, NDArray[np.float64]]
    """Columns by name, as of `Results.time_series`."""
    snapshots: list[Snapshot]
    """As of `Results.snapshots`, in double precision."""
    summary: dict[str, Any]
    """Key figures, as in summary.json."""
    loads: Loads | None = None
    """Loads by height, as of `Results.loads`; None unless `output.loads_by_height` asks for them."""


def run_in_memory(
    scenario: Scenario,
    *,
    make_simulation: Callable[[Scenario], Any],
    recorders: Sequence[Recorder] = (),
    on_progress: Callable[[RunProgress], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> MemoryRun:
    """Simulate a scenario as `run_scenario` does, and write nothing: the same steps, the same samples.

    Args:
        scenario: what to run.
        make_simulation: as in `run_scenario`.
        recorders: of your own, beside those of the run; they are closed at its end, however it ends.
        on_progress: called after each record.
        stop: asked between records; true ends the run cleanly before its time.

    Raises:
        Exception: whatever the simulation raises; your own recorders hold what was recorded until then.
    """
    started = time.perf_counter()
    simulation = make_simulation(scenario)
    output = scenario.output
    series = SeriesInMemory(Schedule(output.time_series_interval_s), quantities=_asked(scenario))
    snapshots = SnapshotsInMemory(Schedule(output.snapshot_interval_s))
    loads = LoadsInMemory(Schedule(output.time_series_interval_s)) if output.loads_by_height else None
    all_recorders: list[Recorder] = [series, snapshots, *([loads] if loads is not None else []), *recorders]
    report = _reporter(scenario, series, on_progress)
    try:
        finished = record_until(simulation, all_recorders, output.end_time_s, on_step=report, stop=stop)
    finally:
        _close(recorders)
    record = simulation.record | {
        "status": "finished" if finished else "stopped",
        "material_points": simulation.material_points,
        "wall_time": time.perf_counter() - started,
    }
    columns = series.series()
    summary = _summary(scenario, columns, snapshots.snapshots, record)
    summary["notes"] = [*scene_caveats(scenario), *run_caveats(record, summary)]
    kept = None if loads is None else _loads(loads)
    return MemoryRun(scenario, finished, columns, snapshots.snapshots, summary, kept)


def _loads(recorder: LoadsInMemory) -> Loads:
    surfaces = {}
    for stretch in recorder.stretches:
        place, height = stretch.place(stretch.edges).T
        surfaces[stretch.surface] = SurfaceLoads(stretch.edges, place, height, recorder.pressures(stretch.surface))
    return Loads(np.array(recorder.times), surfaces)


def run_scenario(
    scenario: Scenario,
    out: str | Path,
    *,
    make_simulation: Callable[[Scenario], Any],
    force: bool = False,
    origin: str = "",
    recorders: Sequence[Recorder] = (),
    on_progress: Callable[[RunProgress], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
    keep: Callable[[], bool] = lambda: False,
    pictures: bool = True,
) -> RunOutcome:
    """Simulate a scenario and record it in a run folder.

    Everything that was computed is on the disk when this returns or raises.

    Args:
        scenario: what to run.
        out: the run folder to make.
        make_simulation: makes the simulation, for instance `lambda scenario: Simulation(scenario, device="cpu")`.
        force: an older run in `out` is replaced.
        origin: where the scenario came from, for the record.
        recorders: of your own, beside those of the run; the simulation lands on their times too. They are closed at
            the end of the run, however it ends.
        on_progress: called after each record.
        stop: asked between records; true ends the run cleanly before its time.
        keep: asked between records; true writes a checkpoint, beside those that are due anyway.
        pictures: draw the run's two figures at the end, which takes longer than a coarse run does.

    Raises:
        RunFolderError: `out` cannot be used; nothing was touched.
        Exception: whatever the simulation raises; the run's record then says `failed`.
    """
    out = Path(out)
    RunFolder.check(out, force=force)
    preparing = time.perf_counter()
    simulation = make_simulation(scenario)
    simulation.prepare()
    record = _record(scenario, simulation, origin) | {"preparation_time": time.perf_counter() - preparing}
    with RunFolder.create(out, scenario.resolved(), record, force=force) as folder:
        return _go_on(folder, scenario, simulation, record, recorders, on_progress, stop, keep, pictures)


def resume_run(
    out: str | Path,
    *,
    make_simulation: Callable[[Scenario], Any],
    recorders: Sequence[Recorder] = (),
    on_progress: Callable[[RunProgress], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
    keep: Callable[[], bool] = lambda: False,
    pictures: bool = True,
) -> RunOutcome:
    """Go on with an interrupted run from its last checkpoint; on the CPU its records are then, bit for bit, those of a
    run that was not interrupted. A run that was interrupted before its first record begins anew.

    Args:
        out: the run folder.
        make_simulation: as in `run_scenario`.
        recorders: as in `run_scenario`; they record where the run goes on, and from then on at their times.
        on_progress: as in `run_scenario`.
        stop: as in `run_scenario`.
        keep: as in `run_scenario`.
        pictures: as in `run_scenario`.

    Raises:
        RunFolderError: there is nothing to go on with, or it is damaged; the sentence says so, nothing was touched.
        ScenarioError, ResultsError: the scenario or the record in the folder cannot be read.
    """
    out = Path(out)
    results = Results.open(out)
    with RunFolder(out) as folder:
        folder.lock()
        record = results.record
        if record.get("status") == "finished":
            outcome = RunOutcome(out, True, evaluate(out, pictures=pictures))
            (out / run_folder.CHECKPOINT).unlink(missing_ok=True)
            return outcome
        if not (out / run_folder.SCENARIO).exists():
            raise RunFolderError(f"{out} holds a run that ended before it began; start it again with --force.")
        scenario = results.scenario
        checkpoint = None
        if (out / run_folder.CHECKPOINT).exists():
            checkpoint = read_checkpoint(out / run_folder.CHECKPOINT, scenario.resolved())
        preparing = time.perf_counter()
        simulation = make_simulation(scenario)
        simulation.prepare()
        preparation_time = time.perf_counter() - preparing
        if checkpoint is None:
            for name in (run_folder.TIME_SERIES, run_folder.SNAPSHOTS, run_folder.LOADS):
                (out / name).unlink(missing_ok=True)
        else:
            try:
                simulation.restore_state(checkpoint.state)
            except ValueError as error:
                raise RunFolderError(f"{out / run_folder.CHECKPOINT} cannot be used: {error}.") from None
        start = checkpoint.time if checkpoint is not None else 0.0
        resumed = {
            "at": _now(),
            "simulated_time": start,
            "device": str(simulation.device),
            "preparation_time": preparation_time,
        }
        record |= {"status": "running", "problem": None, "resumed": [*record.get("resumed", []), resumed]}
        return _go_on(folder, scenario, simulation, record, recorders, on_progress, stop, keep, pictures, checkpoint)


def _go_on(
    folder: RunFolder,
    scenario: Scenario,
    simulation: Any,
    record: dict[str, Any],
    own: Sequence[Recorder],
    on_progress: Callable[[RunProgress], None] | None,
    stop: Callable[[], bool],
    keep: Callable[[], bool],
    pictures: bool,
    checkpoint: Checkpoint | None = None,
) -> RunOutcome:
    """Run to the end and record, from the start or from a checkpoint to which the simulation has been set back."""
    out, output, end_time = folder.path, scenario.output, scenario.output.end_time_s
    wall_before = checkpoint.wall_time if checkpoint is not None else 0.0
    marks: dict[str, Any] = checkpoint.marks if checkpoint is not None else {}
    started = time.perf_counter()
    # The structure of HDF5 can be damaged in more ways than a text: it is opened before that is cut.
    structured: dict[str, Any] = {}
    try:
        structured["snapshots"] = SnapshotRecorder(
            out / run_folder.SNAPSHOTS, output.snapshot_interval_s, end_time, mark=marks.get("snapshots")
        )
        if output.loads_by_height:
            structured["loads"] = LoadsRecorder(
                out / run_folder.LOADS, output.time_series_interval_s, end_time, mark=marks.get("loads")
            )
        series = TimeSeriesRecorder(
            out / run_folder.TIME_SERIES,
            output.time_series_interval_s,
            quantities=_asked(scenario),
            mark=marks.get("time_series"),
        )
    except RunFolderError:
        _close(list(structured.values()))
        raise
    recorders: list[Recorder] = [series, *structured.values(), *own]
    if checkpoint is not None:
        folder.write(run_folder.RECORD, record)
    checkpointer = Checkpointer(
        folder,
        scenario.resolved(),
        {"time_series": series, **structured},
        output.checkpoint_interval_s,
        wall_before=wall_before,
        asked=keep,
    )

    status, problem = "failed", None
    try:
        finished = record_until(
            simulation,
            recorders,
            end_time,
            on_step=_reporter(scenario, series, on_progress),
            stop=stop,
            after_records=checkpointer.after_records,
        )
        status = "finished" if finished else "stopped"
    except Exception as error:
        problem = str(error)
        raise
    finally:
        _close(recorders)
        ended = {
            "status": status,
            "problem": problem,
            "ended": _now(),
            "simulated_time": simulation.time,
            "wall_time": wall_before + time.perf_counter() - started,
            **simulation.record,
        }
        with contextlib.suppress(OSError):
            folder.write(run_folder.RECORD, record | ended)
    outcome = RunOutcome(out, finished, evaluate(out, pictures=pictures))
    if finished:
        (out / run_folder.CHECKPOINT).unlink(missing_ok=True)
    return outcome


class _Series(Protocol):
    @property
    def latest(self) -> dict[str, float]:
        """The last sample."""


def _reporter(
    scenario: Scenario, series: _Series, on_progress: Callable[[RunProgress], None] | None
) -> Callable[[Any], None]:
    """Tells where a run stands, after each stretch."""
    first: list[float] = []

    def report(simulated: Any) -> None:
        now, wall = simulated.time, time.perf_counter()
        first.extend([] if first else [now, wall])
        rate = (now - first[0]) / (wall - first[1]) if now > first[0] else None
        if on_progress is not None:
            on_progress(RunProgress(now, scenario.output.end_time_s, rate, series.latest))

    return report


def _close(recorders: Sequence[Recorder]) -> None:
    """A disk that is full must not hide the error that tells so."""
    for recorder in recorders:
        with contextlib.suppress(OSError):
            recorder.close()


def _asked(scenario: Scenario) -> list[str] | None:
    """Keys of the quantities that are sampled; None for all."""
    return None if scenario.output.quantities is None else recorded_quantities(scenario)


def evaluate(path: str | Path, *, pictures: bool = True) -> dict[str, Any]:
    """Write the summary and, where asked for, the figures of a run folder from its records, and return the summary.

    Raises:
        ResultsError: the records cannot be read, or a figure is no finite number.
    """
    path = Path(path)
    results, folder = Results.open(path), RunFolder(path)
    record = results.record
    with results.snapshots as snapshots:
        summary = _summary(results.scenario, results.time_series, snapshots, record)
        summary["notes"] = [*scene_caveats(results.scenario), *run_caveats(record, summary)]
        folder.write(run_folder.SUMMARY, summary)
        _write_surfaces(results, path)
        if pictures:
            _draw(results, path)
    return summary


def _summary(
    scenario: Scenario, series: Mapping[str, NDArray[np.float64]], snapshots: Any, record: dict[str, Any]
) -> dict[str, Any]:
    balanced = with_what_arrives(scenario, series)
    summary = summarize(scenario, balanced, snapshots, _of_the_run(record))
    barriers = barrier_figures(scenario, series, snapshots)
    if barriers:  # what passed each of several
        summary["verdict"] = verdict(scenario, balanced, summary | barriers)
    return summary | arrival_figures(scenario, series, summary) | barriers


def _draw(results: Results, path: Path) -> None:
    """The first pictures of a run."""
    from warp_mpm import plotting  # a third of a second, which the first step does not wait for

    with contextlib.suppress(ResultsError):  # a scene without a barrier has no force to draw
        plotting.save(plotting.force_and_displacement(results), path / run_folder.FORCE_PLOT)
    plotting.save(plotting.pore_pressure(results), path / run_folder.PRESSURE_PLOT)


def _write_surfaces(results: Results, path: Path) -> None:
    """Barriers and ground beside the snapshots, as far as the material reaches."""
    snapshots = results.snapshots
    displacements, edges = [], []
    for snapshot in snapshots:
        displacements.append(results.barrier_displacements(snapshot))
        x, y = snapshot.position.T if len(snapshot.position) else np.zeros((2, 1))
        edges.append((x.min(), x.max(), y.max()))
    if edges:
        left, right, top = np.array(edges).T
        extent = (float(left.min()), float(right.max()), float(top.max()))
        write_surfaces(results.scenario, snapshots.times.tolist(), displacements, extent, path / run_folder.SURFACES)


def _of_the_run(record: dict[str, Any]) -> dict[str, Any]:
    """What a summary takes over from a run's record."""
    taken_over = ("status", "material_points", "steps", "wall_time", "time_step_min", "time_step_max")
    return {name: record.get(name) for name in taken_over} | {"time_step_limit": _ruling_limit(record)}


def _ruling_limit(record: dict[str, Any]) -> str | None:
    """The limit that set most time steps; None before the first."""
    prefix = "steps_limited_by_"
    counts = {name.removeprefix(prefix): count for name, count in record.items() if name.startswith(prefix)}
    return max(counts, key=lambda name: counts[name]) if any(counts.values()) else None


def _record(scenario: Scenario, simulation: Any, origin: str) -> dict[str, Any]:
    used = {"python": platform.python_version(), **versions()}
    for package in ("numpy", "h5py"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            used[package] = metadata.version(package)
    return {
        "format": run_folder.FORMAT,
        "status": "running",
        "title": scenario.title,
        "scenario_file": origin,
        "command": sys.argv,
        "started": _now(),
        "device": str(simulation.device),
        "material_points": simulation.material_points,
        **({"effects": asdict(simulation.effects)} if hasattr(simulation, "effects") else {}),
        **_own_quantities(scenario),
        "machine": f"{platform.system()} {platform.machine()}",
        "versions": used,
        **_commit(),
    }


def _own_quantities(scenario: Scenario) -> dict[str, Any]:
    """What a script says of the quantities that it registered, for whoever reads the run without it."""
    said = ("unit", "meaning", "label", "symbol")
    own = {name: {part: getattr(one, part) for part in said} for name, one in OWN.items() if one.there(scenario)}
    return {"quantities": own} if own else {}


def _commit() -> dict[str, Any]:
    """Git commit of the source tree, and whether files differ from it; None where the package is installed."""
    source = Path(__file__).parent

    def git(*arguments: str) -> str | None:
        try:
            answer = subprocess.run(
                ["git", "-C", str(source), *arguments], capture_output=True, text=True, timeout=5, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return None
        return answer.stdout.strip()

    # A package inside some other repository, in a virtual environment say, has no commit of its own.
    tracked = git("ls-files", "--error-unmatch", Path(__file__).name) is not None
    commit = git("rev-parse", "HEAD") if tracked else None
    changed = git("status", "--porcelain", "--untracked-files=no", ".") if commit else None
    return {"git_commit": commit, "git_changed": bool(changed) if commit else None}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
