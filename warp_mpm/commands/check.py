"""`python -m warp_mpm check`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.command_line import BAD_INPUT, complain, refusals, tell


def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE", help="Scenario files.", show_default=False)],
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="PICTURE",
            help="Draw the scene there, with ground, flow, barriers and domain to scale: a png, pdf or svg file.",
            show_default="no picture",
        ),
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print what was found as JSON: for each file its problems, notes and numbers."),
    ] = False,
) -> None:
    """Check scenario files and tell what they describe; nothing is run, and nothing written but the picture."""
    if plot is not None:
        with refusals():
            if len(files) > 1:
                raise ValueError(f"--plot draws one scene, {len(files)} were given.")
            from warp_mpm import plotting

            plotting.check_path(plot)
    from warp_mpm.caveats import scene_caveats
    from warp_mpm.description import described, described_domain, described_material, numbers
    from warp_mpm.regime import described_regime
    from warp_mpm.scenario import Scenario
    from warp_mpm.scenario_errors import ScenarioError

    found: list[dict[str, Any]] = []
    for file in files:
        try:
            scenario = Scenario.load(file)
        except ScenarioError as error:
            found.append({"file": str(file), "valid": False, "problems": error.problems})
            if not as_json:
                complain(str(error))
            continue
        notes = scene_caveats(scenario)
        found.append(
            {"file": str(file), "valid": True, "problems": [], "title": scenario.title, "notes": notes}
            | {"numbers": numbers(scenario)}
        )
        if not as_json:
            card = [*described(scenario), described_material(scenario), described_domain(scenario)]
            told = [*card, described_regime(scenario), *(f"Note: {sentence}" for sentence in notes)]
            tell("\n  ".join([f"{file}: {scenario.title}", *filter(None, told)]))
    if as_json:
        typer.echo(json.dumps(found, indent=2, ensure_ascii=False))
    if not all(one["valid"] for one in found):
        raise typer.Exit(BAD_INPUT)
    if plot is not None:
        with refusals():
            plotting.save(plotting.scene(scenario, domain=True), plot)
            typer.echo(str(plot))
