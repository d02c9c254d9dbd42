"""`python -m warp_mpm init`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.command_line import complain, refusals


def _option(words: str) -> Any:
    return typer.Option(metavar="NUMBER", help=words, show_default=False)


def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file to make.")] = Path("site.json"),
    depth: Annotated[str | None, _option("Depth of the flow [m].")] = None,
    length: Annotated[str | None, _option("Length of the flow [m], of the box of its volume and depth.")] = None,
    volume: Annotated[str | None, _option("Volume of the flow [m3/m], in place of its length.")] = None,
    speed: Annotated[str | None, _option("Speed of the flow [m/s]; also in km/h.")] = None,
    slope: Annotated[str | None, _option("Slope of the ground, falling with the flow [degrees]; 0.")] = None,
    bulk_density: Annotated[
        str | None, _option("Bulk density of the flow [kg/m3]; also in t/m3, or a unit weight. It gives the porosity.")
    ] = None,
    water_content: Annotated[
        str | None, _option("Mass of water over mass of grains [-]; also in %. In place of the bulk density.")
    ] = None,
    porosity: Annotated[str | None, _option("Porosity of the flow [-]; 0.45. In place of the bulk density.")] = None,
    grain_density: Annotated[str | None, _option("Density of the grains [kg/m3]; 2650.")] = None,
    liquid_density: Annotated[str | None, _option("Density of the liquid [kg/m3]; 1000.")] = None,
    friction_angle: Annotated[str | None, _option("Friction angle of the grains [degrees]; 30.")] = None,
    conductivity: Annotated[str | None, _option("Hydraulic conductivity of the flow [m/s]; 1e-3.")] = None,
    dry: Annotated[bool, typer.Option("--dry", help="The flow has no liquid.")] = False,
    ground_friction: Annotated[str | None, _option("Friction coefficient of the ground [-]; 0.3.")] = None,
    height: Annotated[str | None, _option("Height of the barrier [m].")] = None,
    crest: Annotated[str | None, _option("Width of the barrier's crest [m]; 1.")] = None,
    face_angle: Annotated[str | None, _option("Angle of the barrier's faces with the ground [degrees]; 75.")] = None,
    mass: Annotated[str | None, _option("Mass of the barrier [kg/m]; also in t/m, or a weight.")] = None,
    barrier_density: Annotated[str | None, _option("Density of the barrier [kg/m3]; 2000. In place of mass.")] = None,
    sliding: Annotated[bool, typer.Option("--sliding/--fixed", help="Whether the barrier may slide.")] = True,
    base_friction: Annotated[str | None, _option("Friction coefficient under the barrier [-]; 0.5.")] = None,
    face_friction: Annotated[str | None, _option("Friction coefficient of the flow on the barrier [-]; 0.3.")] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(metavar="LIMIT", help='Limit of the verdict: "displacement <= 0.5 m".', show_default=False),
    ] = None,
    distance: Annotated[str | None, _option("From the front to the barrier at the start [m]; half the depth.")] = None,
    spacing: Annotated[str | None, _option("Spacing of the grid [m]; a sixth of the depth or so.")] = None,
    until: Annotated[str | None, _option("Simulated time [s]; twice the flow's passing, and a second.")] = None,
    title: Annotated[str | None, typer.Option(help="Title of the scenario.", show_default=False)] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file of that name.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the scenario as JSON, write nothing.")] = False,
) -> None:
    """Make a scenario of your own site from a few numbers, in your units; each number may have a unit: "1.95 t/m3".

    What is not given is asked for on a terminal, with what is usual as the answer; elsewhere that is taken. All of it
    is printed with where it is from, and what was not given stands in the scenario's notes.
    """
    from warp_mpm.site import asked, conflicts, new_scenario

    given = {
        "depth": depth, "length": length, "volume": volume, "speed": speed, "slope": slope,
        "bulk_density": bulk_density, "water_content": water_content, "porosity": porosity,
        "grain_density": grain_density, "liquid_density": liquid_density, "friction_angle": friction_angle,
        "conductivity": conductivity, "ground_friction": ground_friction, "height": height, "crest": crest,
        "face_angle": face_angle, "mass": mass, "barrier_density": barrier_density, "base_friction": base_friction,
        "face_friction": face_friction, "distance": distance, "spacing": spacing, "until": until,
    }  # fmt: skip
    with refusals():
        from warp_mpm.by_simulation.limits import design_fields, read_limits
        from warp_mpm.caveats import scene_caveats
        from warp_mpm.scenario import Scenario

        if not as_json and file.exists() and not force:
            raise ValueError(f"{file} is there already; choose another name, or add --force.")
        if not as_json and not file.parent.is_dir():
            raise ValueError(f"{file} cannot be made: the folder {file.parent} does not exist.")
        limits = design_fields(read_limits(limit or []))
        if sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty() and not conflicts(given):
            given = asked(given, sliding=sliding, prompt=_prompt, complain=complain)
        content, told = new_scenario(given, title=title, sliding=sliding, dry=dry, limits=limits)
        scenario = Scenario.model_validate(content)
        text = json.dumps(content, indent=2, ensure_ascii=False) + "\n"
        if as_json:
            typer.echo(text, nl=False)
            return
        from analytic.whole_file import write_whole

        write_whole(file, text)
    _print(told)
    for sentence in scene_caveats(scenario):
        typer.echo(f"Note: {sentence}")
    typer.echo(f"{file}: {scenario.title}. Next: python -m warp_mpm check {file}; python -m warp_mpm run {file}")


def _prompt(words: str, default: str) -> str:
    return typer.prompt(words, default=default or None, err=True, type=str)


def _print(told: list[Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 160
    table = Table("", "value", "from", box=None, padding=(0, 2, 0, 0))
    for one in told:
        table.add_row(one.words, one.value, one.origin, style="" if one.origin == "given" else "dim")
    console.print(table)
