"""`python -m warp_mpm plan`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analytic.command_line import refusals
from warp_mpm.commands.options import with_options

if TYPE_CHECKING:
    from rich.console import Console

    from warp_mpm.performance.plan import Plan, Switch


def plan(
    scenario_file: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="Scenario file (JSON).", show_default=False)
    ],
    what_if: Annotated[bool, typer.Option("--what-if", help="Also what switching each effect would cost.")] = False,
    spacing: Annotated[
        float | None, typer.Option(help="Grid spacing in metres.", show_default="that of the scenario")
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="End time in seconds.", show_default="that of the scenario")
    ] = None,
    device: Annotated[str, typer.Option(help="Warp device: cpu, cuda:0, ...")] = "cpu",
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as JSON, SI units.")] = False,
) -> None:
    """Tell what a run will compute, hold and cost, before it is started; nothing is written.

    Each effect, on or off and why; the kernels of a step and their cost, measured for half a second; arrays and memory;
    the number of steps and the limit that sets them; and the wall time, without compiling and drawing.
    """
    from rich.console import Console

    with refusals():
        from warp_mpm.caveats import scene_caveats
        from warp_mpm.description import described_domain
        from warp_mpm.performance.plan import make_plan
        from warp_mpm.performance.plan import what_if as switched
        from warp_mpm.regime import described_regime, regime
        from warp_mpm.scenario import Scenario

        scenario = with_options(Scenario.load(scenario_file), spacing=spacing, until=until)
        console = Console(highlight=False, markup=False)
        if not console.is_terminal:
            console.width = 130
        progress = Console(stderr=True, highlight=False, markup=False)
        card = make_plan(scenario, device=device)
        switches: list[Switch] = []
        if what_if:
            switches = switched(
                scenario, device=device, on_progress=lambda name: progress.print(f"preparing: {name}", style="dim")
            )
    if as_json:
        told = asdict(card) | {"wall_time": card.wall_time, "limit": card.limit}
        told |= {name: told[name] if told[name] < float("inf") else None for name in ("drag_step", "law_step")}
        told["regime"] = {name: value for name, value in regime(scenario).items() if value < float("inf")}
        told["rules"] = [asdict(rule) | {"on": rule.on} for rule in card.rules]
        typer.echo(json.dumps(told | {"what_if": [asdict(switch) for switch in switches]}, indent=2))
        return
    console.print(scenario.title, style="bold")
    console.print(described_domain(scenario), soft_wrap=True)
    if words := described_regime(scenario):
        console.print(words, soft_wrap=True)
    for sentence in scene_caveats(scenario):
        console.print(f"Note: {sentence}", soft_wrap=True)
    _print_effects(console, card)
    _print_kernels(console, card)
    _print_size(console, card)
    if switches:
        _print_switches(console, switches)


def _print_effects(console: Console, card: Plan) -> None:
    from rich.table import Table

    from warp_mpm.performance.plan import described

    table = Table("effect", "", "because", title="Effects", title_justify="left", box=None, padding=(0, 2, 0, 0))
    for rule in card.rules:
        table.add_row(rule.effect.replace("_", " "), described(rule.value), rule.reason, style="" if rule.on else "dim")
    console.print(table)


def _print_kernels(console: Console, card: Plan) -> None:
    from rich.table import Table

    table = Table(title="\nKernels of a step", title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("kernel")
    table.add_column("ns per point", justify="right")
    table.add_column("share", justify="right")
    table.add_column("of the run [s]", justify="right")
    for name, cost in card.kernels.items():
        share = cost / card.step_cost
        table.add_row(name, f"{cost:.1f}", f"{share:.0%}", f"{share * card.stepping_time:.2f}")
    table.add_row("all", f"{card.step_cost:.1f}", "100%", f"{card.stepping_time:.2f}", style="bold")
    console.print(table)


def _print_size(console: Console, card: Plan) -> None:
    from rich.table import Table

    def megabytes(group: str) -> float:
        return sum(size for name, size in card.arrays.items() if name.startswith(f"{group}.")) / 1e6

    whole = sum(card.arrays.values()) / 1e6
    columns, rows = card.cells
    points = megabytes("points")
    limit = f"{card.limit} limit, {card.largest_step:.3g} s at the flow's initial speed"
    table = Table(title="\nSize and time", title_justify="left", show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_row("material points", f"{card.material_points:,}, {1e6 * points / card.material_points:.0f} bytes each")
    table.add_row("grid", f"{columns:,} x {rows:,} cells, {card.blocks_in_use:.1%} of its blocks in use at the start")
    table.add_row(
        "memory", f"{whole:.1f} MB in {len(card.arrays)} arrays (points {points:.1f}, grid {megabytes('grid'):.1f})"
    )
    table.add_row("time step", f"set by the {limit}")
    table.add_row("steps", f"about {card.steps:,}")
    table.add_row(
        "wall time",
        f"about {card.wall_time:.1f} s: steps {card.stepping_time:.1f} s, records {card.recording_time:.1f} s; "
        "without compiling and drawing",
    )
    console.print(table)
    arrays = Table("array", "bytes", title="\nArrays", title_justify="left", box=None, padding=(0, 2, 0, 0))
    arrays.columns[1].justify = "right"
    for name, size in card.arrays.items():
        arrays.add_row(name, f"{size:,}")
    console.print(arrays)


def _print_switches(console: Console, switches: list[Switch]) -> None:
    from rich.table import Table

    table = Table(title="\nWhat if", title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("effect")
    table.add_column("switched")
    for heading in ("ns per point", "steps", "stepping [s]", "difference"):
        table.add_column(heading, justify="right")
    base = switches[0]
    for switch in switches:
        table.add_row(
            switch.effect.replace("_", " "),
            switch.change,
            f"{switch.step_cost:.1f}",
            f"{switch.steps:,}",
            f"{switch.stepping_time:.2f}",
            "" if switch is base else f"{switch.stepping_time / base.stepping_time - 1.0:+.0%}",
        )
    console.print(table)
