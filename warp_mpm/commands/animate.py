"""`python -m warp_mpm animate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import refusals


def animate(
    run: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Run folder.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="An mp4 or gif file.", show_default="NAME of the run.mp4 here")
    ] = None,
    field: Annotated[
        str,
        typer.Option(
            help="Colour: pore_pressure, speed, slip, volumetric_strain, mean_effective_stress or deviatoric_strain.",
            show_default="pore_pressure; speed of a dry flow",
        ),
    ] = "",
    speed: Annotated[float, typer.Option(min=0.01, max=100.0, help="Simulated seconds per second of the film.")] = 0.5,
    width: Annotated[int, typer.Option(min=320, max=3840, help="Width of the picture in pixels.")] = 1280,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print errors only.")] = False,
) -> None:
    """Film a run: the flow coloured by a field, and the force and the displacement as they grow.

    One picture for each snapshot. mp4 needs the package imageio-ffmpeg (in a checkout: pip install '.[animate]'); gif
    needs nothing more.
    """
    with refusals():
        target = out if out is not None else Path(f"{run.resolve().name}.mp4")
        from rich.console import Console
        from rich.progress import track

        from warp_mpm.animation import write_film
        from warp_mpm.results import Results

        console = Console(quiet=quiet, stderr=True)
        write_film(
            Results.open(run),
            target,
            field_name=field,
            speed=speed,
            width=width,
            watch=lambda frames: track(frames, "pictures", console=console, disable=not console.is_terminal),
        )
        if not quiet:
            typer.echo(f"{target} ({target.stat().st_size / 1e6:.2g} MB)")
