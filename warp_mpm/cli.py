"""The command line: `python -m warp_mpm run | check | schema`, and the commands on runs in `warp_mpm/commands/`.

Exit codes: 0 done, 2 the input cannot be used (one sentence says why), 3 the simulation diverged, 130 interrupted.
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from analytic.command_line import BAD_INPUT, add_version, complain, refusals
from warp_mpm.commands import register
from warp_mpm.commands.check import check
from warp_mpm.commands.options import ScenarioCommandLine, with_options

if TYPE_CHECKING:
    from warp_mpm.live import LivePage
    from warp_mpm.scenario import Scenario

DIVERGED, INTERRUPTED = 3, 130

app = typer.Typer(
    cls=ScenarioCommandLine,
    help="Debris flows that hit a rigid barrier which may slide, by the two-phase Material Point Method.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
add_version(app)


def main() -> None:
    """Entry point of `python -m warp_mpm` and of the installed command `warp-mpm`."""
    app(prog_name="warp-mpm" if Path(sys.argv[0]).name.startswith("warp-mpm") else "python -m warp_mpm")


@app.command(
    epilog="Example: python -m warp_mpm run scenarios/set_iib.json --out runs/set_iib_coarse --spacing 0.25 --until 2; "
    "several at once: python -m warp_mpm run scenarios/case_*.json --jobs 4"
)
def run(
    scenario_files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="SCENARIO", help="Scenario files (JSON); several run at once.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the results; of several scenarios, the folder of their folders.",
            show_default="runs/NAME of the scenario",
        ),
    ] = None,
    device: Annotated[str, typer.Option(help="Warp device: cpu, cuda:0, ...")] = "cpu",
    spacing: Annotated[
        float | None, typer.Option(help="Grid spacing in metres.", show_default="that of the scenario")
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="End time in seconds.", show_default="that of the scenario")
    ] = None,
    accuracy: Annotated[
        str | None,
        typer.Option(
            metavar="PERCENT",
            help="Choose the spacing that keeps this error of peak force, impulse and sliding distance: 5%.",
            show_default=False,
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="Choose the finest spacing that fits into this time, start and probing included: 60s, 10min.",
            show_default=False,
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Begin what --accuracy takes more than five minutes for without asking.")
    ] = False,
    report: Annotated[bool, typer.Option("--report", help="Write report.html into the folder at the end.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the summary as JSON, SI units, in place of the table.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print errors only.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the run that is in the folder.")] = False,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Go on with the interrupted run in this folder.", show_default=False),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show the run in a browser of this machine while it goes on.")
    ] = False,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of the page of --live.", show_default="a free one")
    ] = None,
    pictures: Annotated[
        bool, typer.Option(help="Draw two figures at the end; they take longer than a coarse run.")
    ] = True,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Scenarios at a time.", show_default="number of cores")
    ] = None,
) -> None:
    """Simulate a scenario and write its results into a folder.

    The folder then holds the key figures (summary.json), the time series (timeseries.csv), the material points at
    intervals and barrier and ground beside them (snapshots.vtkhdf and surfaces.vtkhdf, for ParaView and h5py), two
    figures (PNG), the resolved scenario (scenario.json) and the record of the run (run.json).

    Ctrl-C ends the run cleanly and keeps all that was computed. A run that was interrupted, by whatever, goes on with
    --resume DIR, and on the CPU gives the same numbers as one that was not. With --live a page of 127.0.0.1 shows flow,
    forces and time left as they come, and stops the run or keeps what is there; looking changes no number.

    Exit codes: 0 done, 2 the input cannot be used, 3 the simulation diverged, 130 interrupted.
    """
    if (accuracy, budget) != (None, None) and (None not in (accuracy, budget) or spacing is not None):
        _refuse("--accuracy and --budget choose the spacing; of them and --spacing only one is allowed.")
    if (accuracy, budget) != (None, None) and (resume is not None or len(scenario_files or []) > 1):
        _refuse("--accuracy and --budget are for one new run, not for --resume nor for several scenarios.")
    if port is not None and not live:
        _refuse("--port is that of the page of --live, which is not asked for.")
    if scenario_files and len(scenario_files) > 1:
        if resume is not None:
            _refuse("--resume DIR goes on with one run; it takes no scenario files.")
        if live:
            _refuse("--live shows one run; it does not go with several scenarios.")
        from warp_mpm.commands.several import run_several

        options = _options(device, spacing, until, report, force, pictures)
        run_several(scenario_files, out, jobs, options, quiet, as_json, until=until, force=force)
        return
    scenario_file, ended_before = scenario_files[0] if scenario_files else None, False
    if resume is not None:
        if scenario_file is not None or out is not None or spacing is not None or until is not None or force:
            _refuse(
                "--resume DIR goes on with a run as it was begun; it takes no scenario, --out, --spacing, --until or "
                "--force."
            )
        folder, (scenario, ended_before) = resume, _run_in(resume)
    elif scenario_file is None:
        _refuse("run needs a scenario file, or --resume DIR to go on with an interrupted run.")
    else:
        scenario = _scenario(scenario_file, spacing, until)
        folder = out if out is not None else Path("runs") / scenario_file.stem

    from warp_mpm.loading import no_garbage

    with no_garbage():
        from analytic.whole_file import UnwrittenError
        from warp_mpm.recording.run_folder import CHECKPOINT, RunFolder, RunFolderError
        from warp_mpm.results import ResultsError
        from warp_mpm.run import resume_run, run_scenario
        from warp_mpm.terminal import RunDisplay, StopOnSignal

    try:
        if resume is None:
            RunFolder.check(folder, force=force)
    except RunFolderError as error:
        _refuse(str(error))
    offer, probing = None, 0.0
    if accuracy is not None or budget is not None:
        from warp_mpm.commands.accuracy import bought

        begun = time.process_time()
        offer, scenario = bought(scenario, accuracy, budget, device, quiet=quiet, yes=yes)
        probing = time.process_time() - begun
    from warp_mpm.simulation import Simulation, SimulationDiverged

    signal = StopOnSignal()

    def make_simulation(scenario: Scenario) -> Simulation:
        try:
            with signal.at_once():
                simulation = Simulation(scenario, device=device)
                simulation.prepare()
        except ValueError as error:
            _refuse(str(error))
        return simulation

    page = _live_page(scenario, folder, port) if live and not ended_before else None
    try:
        with signal, RunDisplay(scenario, device=device, quiet=quiet or as_json) as display, page or nullcontext():
            watching: dict[str, Any] = {"on_progress": display.show, "stop": lambda: signal.received}
            if page is not None:
                watching = page.watching(display.show, lambda: signal.received)
            how: dict[str, Any] = {"make_simulation": make_simulation, "pictures": pictures} | watching
            if resume is not None:
                outcome = resume_run(folder, **how)
            else:
                outcome = run_scenario(scenario, folder, force=force, origin=str(scenario_file), **how)
            if page is not None:
                page.end(outcome.finished)
    except (RunFolderError, ResultsError) as error:
        _refuse(str(error))
    except SimulationDiverged as error:
        complain(
            f"{error} What was computed before is in {folder}, with a state from shortly before the failure; to see it "
            f"fail again: python -m warp_mpm run --resume {folder}"
        )
        raise typer.Exit(DIVERGED) from None
    except UnwrittenError as error:
        _refuse(str(error))
    except MemoryError as error:
        if not (folder / CHECKPOINT).exists():
            raise
        complain(
            f"Memory ran out: {error}. What was computed before is kept; to go on where there is more: "
            f"python -m warp_mpm run --resume {folder}"
        )
        raise typer.Exit(BAD_INPUT) from None
    except OSError as error:
        complain(
            f"Cannot write to {folder}: {error.strerror or error}. What was written before is kept; to go on once that "
            f"is mended: python -m warp_mpm run --resume {folder}"
        )
        raise typer.Exit(BAD_INPUT) from None
    if as_json:
        typer.echo(json.dumps(outcome.summary, indent=2, ensure_ascii=False))
    else:
        display.summarize(outcome)
    if report:
        from warp_mpm.report import write_report
        from warp_mpm.results import Results

        with refusals():
            write_report([Results.open(folder)], folder / "report.html")
        if not quiet and not as_json:
            typer.echo(f"The report is {folder / 'report.html'}")
    if ended_before and not quiet:
        typer.echo(f"The run in {folder} had finished before; nothing was left to simulate.", err=True)
    if offer is not None and outcome.finished and not quiet:
        typer.echo(offer.settled(folder, time.process_time() - probing), err=True)
    if not outcome.finished:
        complain(
            f"Stopped at t = {outcome.summary['end_time']:.3f} s; everything up to there is in {folder}. "
            f"To run it to the end: python -m warp_mpm run --resume {folder}"
        )
        raise typer.Exit(INTERRUPTED)


app.command(epilog="Example: python -m warp_mpm check scenarios/*.json")(check)


@app.command(epilog="Example: python -m warp_mpm schema > scenario.schema.json")
def schema() -> None:
    """Print the scenario format as JSON Schema, with which an editor completes and checks a file as it is written."""
    from warp_mpm.scenario import json_schema

    typer.echo(json_schema())


register(app)


def _options(
    device: str, spacing: float | None, until: float | None, report: bool, force: bool, pictures: bool
) -> list[str]:
    """The options of `run`, as they are typed."""
    options = ["--device", device]
    for name, value in (("--spacing", spacing), ("--until", until)):
        options += [name, repr(value)] if value is not None else []
    return options + ["--report"] * report + ["--force"] * force + ["--no-pictures"] * (not pictures)


def _scenario(file: Path, spacing: float | None, until: float | None) -> Scenario:
    from warp_mpm.scenario import Scenario
    from warp_mpm.scenario_errors import ScenarioError

    try:
        return with_options(Scenario.load(file), spacing=spacing, until=until)
    except ScenarioError as error:
        _refuse(str(error))


def _live_page(scenario: Scenario, folder: Path, port: int | None) -> LivePage:
    """The page of the run, its address told."""
    from warp_mpm.live import LivePage

    try:
        page = LivePage(scenario, folder, port=port or 0)
    except ValueError as error:
        _refuse(str(error))
    typer.echo(f"The run can be watched at {page.address}", err=True)
    return page


def _run_in(folder: Path) -> tuple[Scenario, bool]:
    """The scenario of the run in a folder, and whether the run has finished."""
    from warp_mpm.results import Results, ResultsError
    from warp_mpm.scenario_errors import ScenarioError

    try:
        results = Results.open(folder)
        return results.scenario, results.record.get("status") == "finished"
    except (ResultsError, ScenarioError) as error:
        _refuse(str(error))


def _refuse(sentence: str) -> NoReturn:
    raise typer.BadParameter(sentence)
