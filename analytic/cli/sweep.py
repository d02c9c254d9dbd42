"""`python -m analytic sweep plan | collect | fit`: from simulations to the constants of the variant `calibrated`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.terminal import AsJson, Plot, check_plot, number, print_json, print_table, write_plot
from analytic.command_line import refusals
from analytic.whole_file import write_whole

sweep = typer.Typer(help="Fit the calibrated variant to a sweep of simulations.", no_args_is_help=True)


@sweep.command(epilog="Example: python -m analytic sweep plan scenarios/set_i.json sweep --count 256")
def plan(
    template: Annotated[Path, typer.Argument(help="Scenario whose material and contact are kept.")],
    folder: Annotated[Path, typer.Argument(help="Folder for the scenario files; made if it is not there.")],
    count: Annotated[int, typer.Option(help="Number of scenes.")] = 256,
    seed: Annotated[int, typer.Option(help="Of the Sobol' sequence.")] = 1,
) -> None:
    """Write scenario files spread over speed, depth, length, porosity, face angle, height, mass and base friction.

    Run them with: python -m warp_mpm run sweep/*.json --out sweep/runs
    """
    with refusals():
        from analytic import sweep as scenes
        from analytic.scene import scene_of
        from warp_mpm.scenario import Scenario
        from warp_mpm.scenario_errors import read_json

        content = read_json(template)
        scenario = Scenario.model_validate(content, source_name=str(template))
        scene_of(scenario, str(template))  # its errors name file and field
        if scenario.flow.formulation != "two_phase":
            raise ValueError(f"{template} has the formulation {scenario.flow.formulation!r}, it must be two_phase.")
        planned = scenes.plan(content, count, seed)
        folder.mkdir(parents=True, exist_ok=True)
        for name, scene in planned.items():
            write_whole(folder / f"{name}.json", json.dumps(scene, indent=2) + "\n")
        typer.echo(f"{len(planned)} scenarios in {folder}")


@sweep.command(epilog="Example: python -m analytic sweep collect sweep/runs/* --out docs/data/sweep.csv")
def collect(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN_DIR", help="Run folders.", show_default=False)],
    out: Annotated[Path, typer.Option(help="CSV file to write.", show_default=False)],
    remark: Annotated[str, typer.Option(help="First line of the file, as a comment.")] = "",
) -> None:
    """Gather what the runs say into one table; a folder without a usable record is named and left out.

    Usable is a record in which the impact ends. A run whose barrier still moves at the end of the record is in the
    table, marked as not at rest, and takes no part in the fit.
    """
    with refusals():
        from analytic import sweep as scenes

        rows = []
        for path in sorted(runs):
            try:
                rows.append(scenes.collect(path))
            except ValueError as error:
                typer.echo(f"Left out: {error}", err=True)
        if not rows:
            raise ValueError("No folder holds a usable record.")
        for row in rows:
            if not row.at_rest:
                typer.echo(f"Not at rest: {row.name}, whose barrier still moves at the end of the record.", err=True)
        scenes.write_table(rows, out, remark)
        typer.echo(f"{len(rows)} of {len(runs)} runs in {out}")


@sweep.command(epilog="Example: python -m analytic sweep fit docs/data/sweep.csv")
def fit(
    table: Annotated[Path, typer.Argument(help="Table of the sweep.")],
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Fit the constants, say how sure they are and how well they predict scenes they were not fitted to."""
    with refusals():
        from analytic import sweep as scenes
        from analytic import sweep_fit

        check_plot(plot)
        runs = scenes.read_table(table)
        content: dict[str, Any] = {}
        rows, constant_rows, drawn, papers, held_out = [], [], [], [], []
        for kind, fixed in (("sliding", False), ("fixed", True)):
            usable = sweep_fit.usable(runs, fixed)
            if len(usable) < 4 * sweep_fit.FOLDS:
                raise ValueError(f"{table} holds {len(usable)} usable runs with a {kind} barrier, a fit needs 20.")
            paper, calibrated = [sweep_fit.paper_rule(run.scene) for run in usable], sweep_fit.cross_validated(usable)
            before, after = sweep_fit.score(usable, paper), sweep_fit.score(usable, calibrated)
            drawn += usable
            papers += [run.scene.impact(**numbers.model) for run, numbers in zip(usable, paper, strict=True)]
            held_out += [run.scene.impact(**numbers.model) for run, numbers in zip(usable, calibrated, strict=True)]
            constants, errors = vars(sweep_fit.fit(usable)), vars(sweep_fit.standard_errors(usable))
            content[kind] = {
                "constants": constants,
                "standard_errors": errors,
                "paper": vars(before),
                "calibrated": vars(after),
            }
            if not fixed:
                scatter, spread = sweep_fit.vertical_load_scatter(usable)
                content[kind]["vertical_load"] = {"scatter": scatter, "spread": spread}
            constant_rows += [
                [kind, *(_constant(name, value, ".3f", fixed) for name, value in constants.items())],
                ["±", *(_constant(name, value, ".2f", fixed) for name, value in errors.items())],
            ]
            rows += [_row(f"{kind}, paper's constants", before), _row(f"{kind}, calibrated", after)]
        if plot is not None:
            rules = {"paper's constants": papers, "calibrated, held out": held_out}
            write_plot(lambda: _figure(drawn, rules), plot)
        if as_json:
            print_json(content)
            return
        header = [
            "rule",
            "runs",
            "F: |error|",
            "bias",
            "T1: |error|",
            "moved",
            "Δx: |error|",
            "bias",
            "spread",
            "within 2x",
        ]
        notes = [
            "Medians; the calibrated ones by five-fold cross-validation, each run with constants fitted without it.",
            "Δx: of the barriers that moved by a tenth of the depth; spread: exp of the root mean square log ratio.",
        ]
        print_table("Closed form against simulations", header, rows, notes)
        notes = [
            f"±: standard errors, by drawing the runs anew {sweep_fit.RESAMPLES} times.",
            f"κ = cot β is not fitted: recorded κ scatter about it by {scatter:.2f}, their own spread is {spread:.2f}.",
        ]
        print_table("Constants", ["", "a", "b", "c", "t", "p", "q"], constant_rows, notes)


def _figure(runs: Any, rules: Any) -> Any:
    from analytic import plots

    return plots.sweep(runs, rules)


def _constant(name: str, value: float, form: str, fixed: bool) -> str:
    return "–" if fixed and name == "mass_exponent" else format(value, form)


def _row(name: str, found: Any) -> list[str]:
    def percent(value: float) -> str:
        return f"{100 * value:.0f} %"

    slides = found.moved > 0
    return [
        name,
        str(found.runs),
        percent(found.peak_force_median),
        number(found.peak_force_bias, 3),
        percent(found.rise_time_median),
        str(found.moved) if slides else "–",
        f"{number(found.displacement_median, 3)} m" if slides else "–",
        number(found.displacement_bias, 3),
        number(found.displacement_factor, 3),
        percent(found.within_two) if slides else "–",
    ]
