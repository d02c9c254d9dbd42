"""`python -m warp_mpm uncertainty`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import refusals
from warp_mpm.commands.by_simulation import begun, ended, runs_in, say


def uncertainty(
    scenario_file: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="Scenario file (JSON).", show_default=False)
    ],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD=DISTRIBUTION",
            help="An uncertain field of the scenario: normal(mean, deviation), lognormal(mean, "
            "coefficient_of_variation), uniform(low, high) or triangular(low, mode, high); several are independent.",
            show_default=False,
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIMIT",
            help='Whose probability is asked for, SI unless a unit is given: "displacement <= 0.5 m".',
            show_default="those of the scenario's design group",
        ),
    ] = None,
    runs: Annotated[int, typer.Option(min=16, max=4096, help="Coarse runs that the surrogate is made of.")] = 128,
    spacing: Annotated[
        float | None, typer.Option(help="Grid spacing of the runs in metres.", show_default="a fifth of the depth")
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="End time in seconds.", show_default="that of the scenario")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random numbers; the same seed, the same runs.")] = 1,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the study.", show_default="runs/uncertainty_NAME")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Runs at a time.", show_default="number of cores")
    ] = None,
    device: Annotated[str, typer.Option(help="Warp device: cpu, cuda:0, ...")] = "cpu",
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON, SI units.")] = False,
) -> None:
    """Tell how likely limits are exceeded where fields of a scenario are uncertain, and which field matters most.

    Coarse runs over the distributions, in parallel; a surrogate of each figure, chosen and judged by cross-validation;
    a million samples of it. The folder then holds all runs (runs.csv), what was found (uncertainty.json) and a chart
    (uncertainty.png). The same command again runs only what is missing; with more --runs it adds to them.
    """
    with refusals():
        from warp_mpm.by_simulation.fields import check_once, freed, typed
        from warp_mpm.by_simulation.limits import limits_of, read_limits
        from warp_mpm.by_simulation.runs import COARSE_CELLS
        from warp_mpm.by_simulation.tables import STUDY_PICTURE, study_content, study_told, write_study
        from warp_mpm.by_simulation.uncertain import design_of, read_uncertain, study
        from warp_mpm.commands.options import with_options
        from warp_mpm.scenario import Scenario

        scenario = with_options(Scenario.load(scenario_file), spacing=spacing, until=until)
        if not vary:
            raise ValueError('--vary is missing; it must be given: "flow.velocity_m_per_s.0=lognormal(12, 0.15)".')
        check_once(vary)
        limits = read_limits(limit or []) or limits_of(scenario)
        loose, follows = freed(scenario, [typed(text)[0] for text in vary])
        uncertain = [read_uncertain(text, loose) for text in vary]
        coarse_spacing = spacing if spacing is not None else scenario.flow.depth / COARSE_CELLS
        plan = design_of(loose, uncertain, runs, spacing=coarse_spacing, seed=seed)
        scenes = plan.scenes()
        folder = begun("uncertainty", scenario_file, out, scenario, follows)
        told: set[int] = set()

        def progress(done: int, total: int) -> None:
            tenth = 10 * done // max(total, 1)
            if tenth not in told:
                told.add(tenth)
                say(f"{done} of {total} runs")

        with runs_in(folder, jobs, device, progress) as runs_made:
            found = study(plan, limits, runs_made(scenes), seed=seed)
        write_study(folder, found)
        from warp_mpm.by_simulation.pictures import study_chart
        from warp_mpm.plotting import save

        save(study_chart(found), folder / STUDY_PICTURE)
    notes = ["Not counted: the error of the coarse runs themselves (python -m warp_mpm design, accuracy)."]
    notes += [f"Note: {sentence}" for sentence in found.remarks]
    ended(study_content(found), study_told(found), notes, as_json=as_json)
    say(f"{runs_made.made} runs made, {runs_made.found} found; table and chart: {folder}")
