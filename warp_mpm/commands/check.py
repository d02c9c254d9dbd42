"""`python -m warp_mpm check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import BAD_INPUT, complain, refusals, tell


def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Scenario files.", show_default=False)],
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="PICTURE",
            help="Draw the scene there, with ground, flow, barriers and domain to scale: a png, pdf or svg file.",
            show_default="no picture",
        ),
    ] = None,
) -> None:
    """Check scenario files and tell what they describe; nothing is run, and nothing written but the picture."""
    if plot is not None:
        with refusals():
            if len(files) > 1:
                raise ValueError(f"--plot draws one scene, {len(files)} were given.")
            from warp_mpm import plotting

            plotting.check_path(plot)
    from warp_mpm.caveats import scene_caveats
    from warp_mpm.description import described, described_domain, described_material
    from warp_mpm.regime import described_regime
    from warp_mpm.scenario import Scenario
    from warp_mpm.scenario_errors import ScenarioError

    failed = False
    for file in files:
        try:
            scenario = Scenario.load(file)
            notes = [f"Note: {sentence}" for sentence in scene_caveats(scenario)]
            card = [*described(scenario), described_material(scenario), described_domain(scenario)]
            told = [*card, described_regime(scenario), *notes]
            tell("\n  ".join([f"{file}: {scenario.title}", *filter(None, told)]))
        except ScenarioError as error:
            failed = True
            complain(str(error))
    if failed:
        raise typer.Exit(BAD_INPUT)
    if plot is not None:
        with refusals():
            plotting.save(plotting.scene(scenario, domain=True), plot)
            typer.echo(str(plot))
