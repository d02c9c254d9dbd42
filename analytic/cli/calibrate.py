"""`python -m analytic calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.terminal import AsJson, Plot, check_plot, number, print_json, print_table, write_plot
from analytic.command_line import refusals


def calibrate(
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN_DIR", help="Run folders of the simulator, or CSV files with --scenario.", show_default=False
        ),
    ],
    scenario: Annotated[
        Path | None, typer.Option(help="Scenario of the CSV files, which carry none.", show_default=False)
    ] = None,
    filter_window: Annotated[float, typer.Option(help="Length of the force's moving mean [s].")] = 0.05,
    with_vertical_load: Annotated[
        bool, typer.Option("--with-vertical-load", help="Let the recorded vertical load press on the barrier's base.")
    ] = False,
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Fit λ (or s1max) and τ to recorded forces, by the paper's rule and by least squares.

    The peak rule takes the peak of the filtered force and its time; least squares takes the triangle nearest to F(t)
    from arrival to the end of the impact. Misfits are root mean squares over the largest recorded value. A note says
    which moving mean the paper's λ would need.
    """
    with refusals():
        check_plot(plot)
        from analytic.calibration import RULES, misfit, warnings, window_of

        rows: list[list[str]] = []
        content: list[dict[str, Any]] = []
        drawn = []
        rule_of_filtering = ""
        told: list[str] = []
        needs: list[str] = []
        for path in records:
            name, series, scene = load(path, scenario)
            kappa = _vertical_load_ratio(series, scene, filter_window)
            fits = [_fit(series, scene, rule, filter_window, kappa if with_vertical_load else None) for rule in RULES]
            found_wanting = [f"{warning}." for warning in warnings(series, fits[0].measured)]
            told += [f"{name}: {note}" for note in [*scene.notes, *found_wanting]]
            drawn.append((f"{name}: {scene.title}", series, fits))
            needed = window_of(scene.paper_geometry_change, series["time"], series["impact_force_x"], scene)
            needs.append(f"{name}: the paper's {needed.words}.")
            for fit in fits:
                found = misfit(fit.impact, series, fit.measured)
                misfits = [found.force, found.flow_kinetic_energy, found.barrier_velocity, found.barrier_displacement]
                rows.append(
                    [
                        name if fit is fits[0] else "",
                        fit.rule.replace("_", " "),
                        number(fit.s1max) + ("" if fit.within_range else " *"),
                        number(fit.geometry_change),
                        number(fit.rise_ratio),
                        number(kappa if fit is fits[0] else None, 3),
                        *("–" if value is None else f"{100 * value:.1f} %" for value in misfits),
                    ]
                )
                paper = {
                    "geometry_change": needed.geometry_change,
                    "peak_force": needed.peak_force,
                    "filter_window": needed.window,
                    "largest_force": needed.largest_force,
                }
                told_of_it = {"paper": paper, "notes": [*scene.notes, *found_wanting]}
                content.append(_as_dict(path, fit, kappa, found) | told_of_it)
            rule_of_filtering = fits[0].measured.filter_rule
        if as_json:
            print_json(content)
        else:
            notes = [f"Filter: {rule_of_filtering}.", "κ: recorded vertical over horizontal impulse on the barrier."]
            if any(not entry["within_range"] for entry in content):
                notes.append("*: beyond s1max = L or τ = 1; the misfits are those of the nearest values within.")
            if any(entry["measured"]["at_least"] for entry in content):
                notes.append("Where the impact is not over, least squares and κ are of the part that was recorded.")
            notes += [*needs, *told]
            header = ["run", "rule", "s1max [m]", "λ", "τ", "κ", "misfit F", "E_k1", "v2", "Δx"]
            print_table("Calibration of the closed form", header, rows, notes)
        if plot is not None:
            write_plot(lambda: _figure(drawn), plot)


def load(path: Path, scenario: Path | None) -> tuple[str, Any, Any]:
    """Name, time series and scene of a run folder, or of a CSV file whose scene is given aside."""
    from analytic.scene import read_scene
    from analytic.time_series import read_time_series

    if path.is_dir():
        return path.name or str(path), read_time_series(path), read_scene(scenario or path)
    if scenario is None:
        raise ValueError(f"{path} is no run folder; give the scenario of a CSV file with --scenario.")
    return path.stem, read_time_series(path), read_scene(scenario)


def _fit(series: Any, scene: Any, rule: str, filter_window: float, kappa: float | None) -> Any:
    from analytic.calibration import calibrate

    return calibrate(
        series["time"],
        series["impact_force_x"],
        scene,
        rule=rule,
        filter_window=filter_window,
        vertical_load_ratio=max(kappa or 0.0, 0.0),
    )


def _vertical_load_ratio(series: Any, scene: Any, filter_window: float) -> float | None:
    from analytic.calibration import measure, measured_vertical_load_ratio

    if scene.fixed or "base_normal_force" not in series:
        return None
    measured = measure(series["time"], series["impact_force_x"], filter_window)
    return measured_vertical_load_ratio(
        series["time"], series["impact_force_x"], series["base_normal_force"], scene.weight_on_base, measured
    )


def _as_dict(path: Path, fit: Any, kappa: float | None, found: Any) -> dict[str, Any]:
    measured = fit.measured
    return {
        "run": str(path),
        "rule": fit.rule,
        "s1max": fit.s1max,
        "geometry_change": fit.geometry_change,
        "rise_ratio": fit.rise_ratio,
        "within_range": fit.within_range,
        "vertical_load_ratio": kappa,
        "filter": measured.filter_rule,
        "filter_window": measured.filter_window,
        "measured": {
            "arrival_time": measured.arrival_time,
            "peak_force": measured.peak_force,
            "rise_time": measured.rise_time,
            "duration": measured.duration,
            "impulse": measured.impulse,
            "residual_force": measured.residual_force,
            "at_least": measured.at_least,
        },
        "misfit": {
            "force": found.force,
            "flow_kinetic_energy": found.flow_kinetic_energy,
            "barrier_velocity": found.barrier_velocity,
            "barrier_displacement": found.barrier_displacement,
        },
    }


def _figure(drawn: Any) -> Any:
    from analytic import plots

    return plots.calibrations(drawn)
