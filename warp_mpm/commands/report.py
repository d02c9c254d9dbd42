"""`python -m warp_mpm report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import refusals
from warp_mpm.commands.options import DEFAULT_TIMES, times_of, times_within


def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN_DIR", help="Run folders.", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The page, or the PDF.",
            show_default="report.html or .pdf in the run folder; of several, comparison.html or .pdf here",
        ),
    ] = None,
    times: Annotated[
        str | None,
        typer.Option(help="Times of the still pictures [s], with commas between.", show_default=DEFAULT_TIMES),
    ] = None,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="A PDF to hand over, in place of the page: cover, pictures, appendix.")
    ] = False,
) -> None:
    """Write one HTML page that tells and shows all of a run, or of several side by side.

    The page needs no network and no other file: the flow to play and to point at, forces, motion and energies with the
    closed form over them, still pictures, key figures, ledger, effects, settings, versions and warnings. The page
    prints on A4; --pdf writes the same to hand over, without what moves.
    """
    with refusals():
        from warp_mpm.recording.run_folder import REPORT
        from warp_mpm.results import Results

        wanted = times_of(times)
        target = out if out is not None else (runs[0] / REPORT if len(runs) == 1 else Path("comparison.html"))
        target = target.with_suffix(".pdf") if pdf and out is None else target
        results = [Results.open(run) for run in runs]
        if target.is_dir() or not target.parent.is_dir():
            raise ValueError(f"--out {target} must be a file in a folder that exists.")
        if pdf:
            from warp_mpm.report.pdf import write_pdf as write
        else:
            from warp_mpm.report import write_report as write

        write(results, target, times=times_within(results, wanted))
        typer.echo(f"{target} ({target.stat().st_size / 1e6:.2g} MB)")
