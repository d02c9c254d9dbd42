"""`python -m warp_mpm accuracy`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analytic.command_line import complain, refusals
from analytic.whole_file import write_whole
from warp_mpm.commands.options import agreed, with_options

if TYPE_CHECKING:
    from warp_mpm.accuracy.offer import Offer
    from warp_mpm.accuracy.runner import StudyProgress
    from warp_mpm.scenario import Scenario

INTERRUPTED = 130


def accuracy(
    scenarios: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCENARIO",
            help="Scenario files. One: the whole study; several: a ladder of spacings of each, beside the closed form.",
            show_default=False,
        ),
    ],
    quick: Annotated[bool, typer.Option("--quick", help="Fewer runs, and coarser ones.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of tables and pictures.", show_default="runs/accuracy/NAME"),
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="End time in seconds.", show_default="that of the scenario")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Runs at a time.", show_default="number of cores")
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Check what `run --accuracy` promises on ten scenes drawn around the scenario."),
    ] = False,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write what `run --accuracy` needs to know of these scenes.", show_default=False
        ),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Markdown page to put the result into, below its line <!-- accuracy NAME -->; "
            "NAME is that of the folder.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Measure what accuracy costs in time: error against time over the settings that matter.

    The folder then holds study.md (what it says, all runs, the price of each effect, the price of the closed form),
    runs.csv, and pictures. The same command again runs only what is missing; what was run is found by the hash of
    scene, settings and program.

    With --check, ten new scenes are drawn around the scenario, bought, run and compared with runs that are refined in
    everything; the table is in check.md.

    Exit codes: 0 done, 1 the promises did not hold in nine of ten scenes (--check), 2 the input cannot be used,
    130 interrupted.
    """
    with refusals():
        from warp_mpm.accuracy.report import place_in, put_into_page, study_block, write_ladders, write_study
        from warp_mpm.accuracy.runner import run_settings
        from warp_mpm.accuracy.study import FULL_LADDER, QUICK_LADDER, known_ladder, plan
        from warp_mpm.engine import cores
        from warp_mpm.scenario import Scenario

        scenes = [with_options(Scenario.load(path), spacing=None, until=until) for path in scenarios]
        name = "check" if check else scenarios[0].stem if len(scenes) == 1 else "ladders"
        folder = out if out is not None else Path("runs/accuracy") / name
        if page is not None:
            place_in(page, folder.name)
        if check:
            if len(scenes) != 1 or data is not None or quick:
                raise ValueError("--check draws scenes around one scenario; --quick and --data do not go with it.")
            _check(scenes[0], folder, page, jobs or cores())
            return
        if data is not None and not data.parent.is_dir():
            raise ValueError(f"--data {data} must be a file in a folder that exists.")
        if len(scenes) == 1:
            if scenes[0].barrier is None:
                raise ValueError("This scene has no barrier, so it has no key figures whose errors could be measured.")
            plans = [plan(scenes[0], quick=quick)]
        else:
            factors = QUICK_LADDER if quick else FULL_LADDER
            plans = [known_ladder(scene, [factor * scene.numerics.spacing_m for factor in factors]) for scene in scenes]
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with _progress(len({setting.key for settings in plans for setting in settings})) as show:
                results = run_settings(
                    [setting for settings in plans for setting in settings],
                    folder / "results",
                    jobs=jobs or cores(),
                    on_progress=show,
                )
        except KeyboardInterrupt:
            complain(f"Interrupted; the runs that ended are in {folder}. The same command goes on from there.")
            raise typer.Exit(INTERRUPTED) from None
        if len(scenes) == 1:
            for sentence in write_study(folder, scenes[0], plans[0], results):
                typer.echo(sentence)
            block = study_block(scenes[0], plans[0], results)
            pictures = [folder / "error_against_time.png", folder / "each_setting.png", folder / "where_time_goes.png"]
        else:
            block = write_ladders(folder, list(zip(scenes, plans, strict=True)), results)
            pictures = [folder / "error_against_cost.png", folder / "closed_form.png"]
        if page is not None:
            put_into_page(page, folder.name, block, pictures)
        if data is not None:
            from warp_mpm.accuracy.shipped import write_data

            write_data(data, list(zip(scenes, plans, strict=True)), results)
        typer.echo(f"Tables and pictures: {folder}", err=True)


def _check(scenario: Scenario, folder: Path, page: Path | None, jobs: int) -> None:
    from warp_mpm.accuracy.check import check, drawn, holds, table
    from warp_mpm.accuracy.report import put_into_page

    try:
        checks = check(
            drawn(scenario), folder / "checks", jobs=jobs, on_progress=lambda line: typer.echo(line, err=True)
        )
    except KeyboardInterrupt:
        complain(f"Interrupted; what ended is in {folder}. The same command goes on from there.")
        raise typer.Exit(INTERRUPTED) from None
    text = table(checks)
    write_whole(folder / "check.md", text)
    typer.echo(text)
    if page is not None:
        put_into_page(page, folder.name, text, [])
    if not holds(checks):
        raise typer.Exit(1)


def bought(
    scenario: Scenario, accuracy: str | None, budget: str | None, device: str, *, quiet: bool, yes: bool
) -> tuple[Offer, Scenario]:
    """What `run --accuracy` or `run --budget` buys, and the scenario with the spacing that was chosen.

    Args:
        scenario: what will be run.
        accuracy: as typed.
        budget: as typed.
        device: on which.
        quiet: print nothing but questions.
        yes: what takes long is agreed to.

    Raises:
        typer.Exit: 2, after one sentence, where it cannot be had; 130 where it was interrupted.
    """
    with refusals():
        from warp_mpm.accuracy.kept import Kept
        from warp_mpm.accuracy.offer import percent, seconds
        from warp_mpm.accuracy.pace import Machine
        from warp_mpm.accuracy.purchase import buy

        say = (lambda sentence: None) if quiet else (lambda sentence: typer.echo(sentence, err=True))
        asked = {
            "accuracy": None if accuracy is None else percent(accuracy),
            "budget": None if budget is None else seconds(budget),
        }
        kept = Kept.of(scenario, device)
        try:
            offer = buy(
                scenario,
                **asked,
                bench=Machine(device),
                kept=kept,
                agree=lambda what: yes or agreed(f"{what}. Begin?"),
                on_probe=say,
            )
        except KeyboardInterrupt:
            also = " The probes that ended are kept." if kept.lasting else ""
            complain(f"Interrupted while the scene was probed; nothing was begun.{also}")
            raise typer.Exit(INTERRUPTED) from None
        say(offer.described())
        return offer, scenario.replaced({"numerics.spacing_m": offer.spacing})


@contextmanager
def _progress(total: int) -> Iterator[Callable[[StudyProgress], None]]:
    """A bar on a terminal; elsewhere a line for every run that ends."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True, highlight=False, markup=False)
    columns = (BarColumn(bar_width=30), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=total)

        def show(progress: StudyProgress) -> None:
            left = "" if progress.time_left is None else f", about {progress.time_left:.0f} s to go"
            text = f"{progress.done} done, {len(progress.running)} running, {progress.left} left{left}"
            bar.update(task, completed=progress.done, description=text)
            if not console.is_terminal:
                running = f" ({'; '.join(progress.running)})" if progress.running else ""
                console.print(text + running, soft_wrap=True)

        yield show
