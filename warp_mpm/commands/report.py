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
            help="The page, the PDF or the workbook.",
            show_default="report.html, .pdf or .xlsx in the run folder; of several, comparison.html … here",
        ),
    ] = None,
    times: Annotated[
        str | None,
        typer.Option(help="Times of the still pictures [s], with commas between.", show_default=DEFAULT_TIMES),
    ] = None,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="A PDF to hand over, in place of the page: cover, pictures, appendix.")
    ] = False,
    xlsx: Annotated[
        bool, typer.Option("--xlsx", help="A workbook, in place of the page: tables and time series as numbers.")
    ] = False,
) -> None:
    """Write one HTML page that tells and shows all of a run, or of several side by side.

    The page needs no network and no other file: the flow to play and to point at, forces, motion and energies with the
    closed form over them, still pictures, key figures, ledger, effects, settings, versions and warnings. The page
    prints on A4; --pdf writes the same to hand over, without what moves. --xlsx writes figures, verdict, ledger,
    settings and time series for a spreadsheet (pip install '.[xlsx]').
    """
    with refusals():
        if xlsx and (pdf or times is not None):
            raise ValueError(f"--xlsx does not go with {'--pdf' if pdf else '--times'}; a workbook has no pictures.")
        from warp_mpm.recording.run_folder import REPORT
        from warp_mpm.results import Results

        wanted = times_of(times)
        target = out if out is not None else (runs[0] / REPORT if len(runs) == 1 else Path("comparison.html"))
        if out is None and (pdf or xlsx):
            target = target.with_suffix(".pdf" if pdf else ".xlsx")
        results = [Results.open(run) for run in runs]
        if target.is_dir() or not target.parent.is_dir():
            raise ValueError(f"--out {target} must be a file in a folder that exists.")
        if xlsx:
            from warp_mpm.report.workbook import write_workbook

            write_workbook(results, target)
            typer.echo(f"{target} ({target.stat().st_size / 1e6:.2g} MB)")
            return
        if pdf:
            from warp_mpm.report.pdf import write_pdf as write
        else:
            from warp_mpm.report import write_report as write

        write(results, target, times=times_within(results, wanted))
        typer.echo(f"{target} ({target.stat().st_size / 1e6:.2g} MB)")
