"""`python -m warp_mpm validate`."""

from __future__ import annotations

import time
from importlib import metadata
from pathlib import Path
from typing import Annotated

import typer

SHORT = 1
"""Exit code when a case misses its limit."""


def validate(
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this case; may be given again.", show_default=False)
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Coarser or shorter variants of most cases.")] = False,
    measured: Annotated[
        bool, typer.Option("--measured", help="The cases held against measurements, in place of known answers.")
    ] = False,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="With --measured: folder of measured curves, which are not shipped.", show_default=False
        ),
    ] = None,
    finer: Annotated[
        int, typer.Option(metavar="N", min=1, max=16, help="With --measured: divide every spacing by this.")
    ] = 1,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the page and its plots.")] = Path(
        "runs/validation"
    ),
    resume: Annotated[
        bool, typer.Option("--resume", help="Take over what this program has run before into the same folder.")
    ] = False,
) -> None:
    """Run the cases whose answers are known, and write a page of ours beside the reference.

    The folder then holds validation.md and, in validation/, a plot of each case; with --measured measured.md and
    measured/. Every case has a limit; a number that misses it stays on the page as short, with the reason.

    Exit codes: 0 all within their limits, 1 some fall short, 2 the input cannot be used, 130 interrupted; the page then
    holds the cases that ended, and --resume goes on.
    """
    from rich.console import Console

    from analytic.command_line import complain, refusals
    from warp_mpm.validation import catalogue, page
    from warp_mpm.validation.kept import Kept

    with refusals():
        if not measured and (data is not None or finer != 1):
            option = "--data" if data is not None else "--finer"
            raise ValueError(f"{option} needs --measured; known answers take none.")
        if measured:
            from warp_mpm.validation.measured.catalogue import measured_cases
            from warp_mpm.validation.measured.given import Given
            from warp_mpm.validation.measured.tables import Tables

            tables = Tables(data)
            cases = catalogue.named(measured_cases(Given(finer=finer, tables=tables)), only)
            told = f"{len(tables.names)} tables of measured curves" if tables.names else "no tables of measured curves"
            how = f"{'quick' if quick else 'full'} variants{f', spacings over {finer}' if finer > 1 else ''}, {told}"
        else:
            cases = catalogue.chosen(only, quick=quick)
            how = "quick variants" if quick else "full variants"
        kind = page.KINDS["measured" if measured else "known answers"]
        pictures = out / kind.name
        pictures.mkdir(parents=True, exist_ok=True)
        kept = Kept(out / f"{kind.name}.json", pictures, asked=f"{how}; {_versions()}", goes_on=resume)
    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 160
    results: list[page.Result] = []
    for case in cases:
        result = kept.found(case)
        if result is None:
            try:
                with console.status(f"{case.name} ..."):
                    begin = time.perf_counter()
                    outcome = case.run(quick)
            except KeyboardInterrupt:
                complain(
                    f"Interrupted in {case.name}; {len(results)} of {len(cases)} cases are on the page in {out}. "
                    "The same command with --resume goes on from there."
                )
                raise typer.Exit(130) from None
            seconds = time.perf_counter() - begin
            with refusals():
                result = page.Result(case, outcome, seconds, page.draw(case, outcome, pictures))
                kept.keep(result)
        results.append(result)
        console.print(f"{case.title}  ({result.seconds:.1f} s)", style="bold")
        console.print(page.check_table(result.outcome))
        first = page.everything([result.outcome for result in results]) if measured else None
        with refusals():
            written = page.write(out, results, kind=kind, how=how, versions=_versions(), first=first)
    console.print(page.summary_table(results))
    console.print(f"The page is {written}", soft_wrap=True)
    if any(result.outcome.short for result in results):
        raise typer.Exit(SHORT)


def _versions() -> str:
    """Versions of what computed the page."""
    names = ("warp-mpm-impact", "warp-lang", "numpy")
    found = []
    for name in names:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            found.append(name)
    return ", ".join(found)
