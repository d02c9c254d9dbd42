"""`python -m warp_mpm export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import refusals


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Run folder.", show_default=False)],
    vtu: Annotated[
        bool, typer.Option("--vtu", help="VTK XML: one file for each snapshot and a collection to open.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the files.", show_default="vtu in the run folder")
    ] = None,
) -> None:
    """Write the snapshots of a run in another format.

    --vtu is for ParaView older than 5.13, which does not read snapshots.vtkhdf with its times: open snapshots.pvd.
    """
    with refusals():
        if not vtu:
            raise ValueError("--vtu is missing; it must be given, as the one format that there is.")
        from warp_mpm.results import Results
        from warp_mpm.vtu import COLLECTION, write_vtu

        folder = out if out is not None else run / "vtu"
        count = write_vtu(Results.open(run), folder)
        typer.echo(f"{folder / COLLECTION} ({count} snapshots)")
