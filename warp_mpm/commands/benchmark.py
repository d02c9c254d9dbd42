"""`python -m warp_mpm benchmark`."""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analytic.command_line import refusals
from analytic.whole_file import write_whole

if TYPE_CHECKING:
    from warp_mpm.performance.table import Table


class What(StrEnum):
    """What is measured."""

    speed = "speed"
    effects = "effects"
    gpu = "gpu"


def benchmark(
    what: Annotated[
        What,
        typer.Argument(help="speed: ratios to the barest step; effects: the cost of each; gpu: a GPU against the CPU."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for tables and chart.", show_default=False),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(
            help="Markdown page to put the tables into, below its lines <!-- benchmark NAME -->.", show_default=False
        ),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="Up to a million points; some minutes and 2 GB.")] = False,
    device: Annotated[str, typer.Option(help="Warp device: cpu, cuda:0, ...")] = "cpu",
) -> None:
    """Measure what a step costs on this machine, in ratios to a yardstick: the barest scatter and gather there can be.

    Everything takes turns with the yardstick, and on the CPU time is that of the process, so that other work on the
    machine changes the ratios little. New effects are compiled first, some seconds each.

    `gpu` takes under five minutes: six scenes on both, where the forces, the sliding and the ledger must agree to what
    rounding allows (exit code 1 where they do not), and the cost of a step with 0.1, 1 and 10 million points in both
    precisions. Name the GPU by --device cuda:0; with --device cpu it is rehearsed with few points.
    """
    from rich.console import Console
    from rich.table import Table as Shown

    with refusals():
        from warp_mpm.performance.benchmark import (
            CASE,
            ROUNDS,
            SHORT,
            TURN,
            effect_costs,
            law_costs,
            machine,
            speed_tables,
        )
        from warp_mpm.performance.chart import effects_chart
        from warp_mpm.performance.site import site_costs
        from warp_mpm.performance.table import Table as Made
        from warp_mpm.performance.table import put_into_page
        from warp_mpm.plotting import save
        from warp_mpm.scenario import Scenario

        console = Console(highlight=False, markup=False)
        progress = Console(stderr=True, highlight=False, markup=False)
        base = Scenario.load(CASE)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)

        def told(name: str) -> None:
            progress.print(f"measuring: {name}", style="dim")

        agree = True
        if what is What.gpu:
            from warp_mpm.performance.two_devices import agreement, throughput

            compared, agree = agreement(base, device=device, progress=told)
            tables = [compared, throughput(base, device=device, progress=told)]
        elif what is What.speed:
            tables = speed_tables(base, device=device, full=full, progress=told)
        else:
            costs = effect_costs(base, device=device, progress=told)
            rows, before = [], 0.0
            for name, ratio, cost in costs:
                rows.append((name, f"{ratio:.2f}", f"{ratio - before:+.2f}", f"{cost:.1f}"))
                before = ratio
            columns = ("effects, one more each", "yardsticks", "added", "ns per point and step")
            tables = [Made("effects", "Cost of each effect, added to those above it", columns, rows)]
            tables.append(law_costs(base, device=device, progress=told))
            tables.append(site_costs(base.replaced(SHORT), device=device, progress=told, rounds=ROUNDS, seconds=TURN))
            if out is not None:
                save(effects_chart(costs), out / "effects.png")
        for table in tables:
            shown = Shown(
                *table.columns, title=f"\n{table.title}", title_justify="left", box=None, padding=(0, 2, 0, 0)
            )
            for row in table.rows:
                shown.add_row(*row)
            console.print(shown)
        if out is not None:
            _write(out, what, tables, machine())
        if page is not None:
            # Tables of a GPU are of another machine than those of the CPU beside them.
            place = "gpu machine" if what is What.gpu else "machine"
            put_into_page(page, tables, _machine_line(machine()), machine=place)
        if not agree:
            raise typer.Exit(1)


def _write(out: Path, what: What, tables: list[Table], taken_on: dict[str, str]) -> None:
    content = {"machine": taken_on, "tables": [asdict(table) for table in tables]}
    write_whole(out / f"{what}.json", json.dumps(content, indent=2, ensure_ascii=False) + "\n")
    shown = "\n".join(f"**{table.title}**\n\n{table.markdown()}" for table in tables)
    write_whole(out / f"{what}.md", f"{_machine_line(taken_on)}\n\n{shown}")


def _machine_line(taken_on: dict[str, str]) -> str:
    return f"{taken_on['processor']}, Warp {taken_on['warp']}, Python {taken_on['python']}, {taken_on['taken']}"
