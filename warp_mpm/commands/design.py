"""`python -m warp_mpm design`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import refusals
from warp_mpm.commands.by_simulation import begun, ended, runs_in, say

NONE_FOUND = 4
"""Exit code where no barrier within the ranges keeps the limits, or the finer run breaks them."""


def design(
    scenario_file: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="Scenario file (JSON).", show_default=False)
    ],
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIMIT",
            help='What must hold, SI unless a unit is given: "displacement <= 0.5 m", "overtopped <= 20 %", '
            '"sliding_factor >= 1.3"; several are kept together.',
            show_default="those of the scenario's design group",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD=LOW:HIGH",
            help="One or two fields of the scenario that may vary, with their ranges; without a range a quarter to "
            "twice the value: barrier.shape.crest_width_m=0.5:4.",
            show_default="the crest's width",
        ),
    ] = None,
    minimize: Annotated[
        str, typer.Option(metavar="FIELD", help="mass, area (of the section), or a field of the scenario.")
    ] = "mass",
    spacing: Annotated[
        float | None, typer.Option(help="Grid spacing of the trials in metres.", show_default="a fifth of the depth")
    ] = None,
    confirm: Annotated[
        float | None,
        typer.Option(
            help="Grid spacing in metres of the run that confirms.", show_default="half of that of the trials"
        ),
    ] = None,
    no_confirm: Annotated[bool, typer.Option("--no-confirm", help="Leave out the finer runs.")] = False,
    until: Annotated[
        float | None, typer.Option(help="End time in seconds.", show_default="that of the scenario")
    ] = None,
    samples: Annotated[
        int, typer.Option(min=0, max=1000, help="Lighter barriers that are tried against the search's assumption.")
    ] = 8,
    tolerance: Annotated[float, typer.Option(min=1e-4, max=0.5, help="Share to which the least mass is found.")] = 0.01,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the answer.", show_default="runs/design_NAME")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Runs at a time.", show_default="number of cores")
    ] = None,
    device: Annotated[str, typer.Option(help="Warp device: cpu, cuda:0, ...")] = "cpu",
    as_json: Annotated[bool, typer.Option("--json", help="Print the answer as JSON, SI units.")] = False,
) -> None:
    """Find the lightest barrier that keeps limits, by simulation: coarse runs in parallel, confirmed by finer ones.

    The search takes it that what is heavier is safer; it says how far the trials bear that out. The folder then holds
    all trials (tried.csv), the answer (answer.json), the barrier as a scenario (barrier.json) and a chart (answer.png).
    The same command again, or another one on the same folder, runs only what is missing.

    Exit codes: 0 found, 2 the input cannot be used, 4 no barrier within the ranges keeps the limits, or the finer run
    breaks them, 130 interrupted.
    """
    with refusals():
        from warp_mpm.by_simulation.barrier import FINER, Question, check_ranges, lightest, objective_of
        from warp_mpm.by_simulation.fields import check_once, freed, read_range, typed
        from warp_mpm.by_simulation.limits import limits_of, read_limits
        from warp_mpm.by_simulation.runs import COARSE_CELLS
        from warp_mpm.by_simulation.tables import PICTURE, content, told, write_answer
        from warp_mpm.commands.options import with_options
        from warp_mpm.scenario import Scenario

        scenario = with_options(Scenario.load(scenario_file), spacing=None, until=until)
        if scenario.barrier is None:
            raise ValueError(f"{scenario_file} has no barrier, so there is none to be found.")
        limits = read_limits(limit or []) or limits_of(scenario)
        if not limits:
            raise ValueError('--limit is missing; it must be given: "displacement <= 0.5 m", "overtopped <= 20 %".')
        varied = vary or ["barrier.shape.crest_width_m"]
        if len(varied) > 2:
            raise ValueError(f"--vary is given {len(varied)} times; one or two fields may vary.")
        check_once(varied)
        loose, follows = freed(scenario, [typed(text)[0] for text in varied])
        ranges = tuple(read_range(text, loose) for text in varied)
        coarse_spacing = spacing if spacing is not None else scenario.flow.depth / COARSE_CELLS
        fine = None if no_confirm else confirm if confirm is not None else coarse_spacing / FINER[-1]
        if spacing is not None:
            with_options(loose, spacing=spacing, until=None)
        if fine is not None and not 0.0 < fine < coarse_spacing:
            raise ValueError(
                f"--confirm = {fine:g} is not allowed; it must be greater than 0 and less than the spacing of the "
                f"trials, {coarse_spacing:g} m."
            )
        question = Question(
            loose, ranges, limits, objective_of(loose, minimize), coarse_spacing, fine, tolerance, samples
        )
        check_ranges(question)
        folder = begun("design", scenario_file, out, scenario, follows)
        with runs_in(folder, jobs, device) as runs:
            answer = lightest(question, runs, say=lambda what: say(f"{runs.made + runs.found} runs: {what}"))
        write_answer(folder, answer)
        from warp_mpm.by_simulation.pictures import search_chart
        from warp_mpm.plotting import save

        save(search_chart(answer), folder / PICTURE)
    ended(content(answer), told(answer), [f"Note: {sentence}" for sentence in answer.remarks], as_json=as_json)
    say(f"{runs.made} runs made, {runs.found} found; table, chart and scenario: {folder}")
    if answer.best is None or answer.confirmed is False:
        raise typer.Exit(NONE_FOUND)
