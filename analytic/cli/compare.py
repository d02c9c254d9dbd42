"""`python -m analytic compare`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.calibrate import load
from analytic.cli.predict import choose_model, make_impact, option
from analytic.cli.terminal import AsJson, Plot, check_plot, number, print_json, print_table, write_plot
from analytic.command_line import refusals
from analytic.fitted import CALIBRATED, beyond_fit, calibrated_impact
from analytic.impact import VARIANTS
from analytic.scene import ASSUMED_RISE_RATIO, Scene, read_scene

COLUMNS = {
    "peak_force": ("F_peak [kN/m]", 1e-3),
    "rise_time": ("T1 [s]", 1.0),
    "duration": ("T2 [s]", 1.0),
    "impulse": ("J [kN s/m]", 1e-3),
    "flow_kinetic_energy_at_peak": ("E_k1(T1) [kJ/m]", 1e-3),
    "barrier_kinetic_energy_max": ("E_k2,max [kJ/m]", 1e-3),
    "barrier_velocity_max": ("v2,max [m/s]", 1.0),
    "barrier_displacement_final": ("Δx_f [m]", 1.0),
}
"""Figures that are compared, with the unit of the table and its factor from SI."""

SIMULATED = "simulated"


def compare(
    paths: Annotated[
        list[Path],
        typer.Argument(metavar="PATH", help="Run folders of the simulator, or scenario files.", show_default=False),
    ],
    variant: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Variant to show, of {', '.join([*VARIANTS, CALIBRATED])}; may be repeated.", show_default="all"
        ),
    ] = None,
    geometry_change: Annotated[
        float | None, option("--lambda", "--geometry-change", help="λ [-]. The paper's: 0.72 fixed, 0.41 sliding.")
    ] = None,
    rise_ratio: Annotated[float, typer.Option("--tau", "--rise-ratio", help="τ [-].")] = ASSUMED_RISE_RATIO,
    reference_speed: Annotated[
        float | None, option("--reference-speed", help="Speed [m/s] for which λ and τ hold; scales them (§3.2).")
    ] = None,
    filter_window: Annotated[float, typer.Option(help="Length of the force's moving mean [s].")] = 0.05,
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Hold the closed form, without fitting it to them, against simulations; or its variants against each other.

    In brackets: the difference from the simulated value. A value marked ≥ is as far as the record goes, in which the
    impact or the barrier's motion did not end; nothing is compared with it. For one scenario, also what the pressure
    formulas say of the same flow on a fixed barrier.
    """
    with refusals():
        check_plot(plot)
        known = [*VARIANTS, CALIBRATED]
        for name in variant or ():
            if name not in known:
                raise ValueError(f"variant is {name!r}, it must be one of {', '.join(known)}.")
        given = {"geometry_change": geometry_change, "rise_ratio": rise_ratio}
        scenes: dict[str, Scene] = {}
        found: dict[str, dict[str, Any]] = {}
        notes: dict[str, list[str]] = {}
        for path in paths:
            name = path.stem if path.is_file() else path.name or str(path)
            found[name], scenes[name], notes[name] = _figures(
                path, variant or known, given, reference_speed, filter_window
            )
        if as_json:
            print_json(
                {
                    name: {source: vars(figures) for source, figures in rows.items()} | {"notes": notes[name]}
                    for name, rows in found.items()
                }
            )
        else:
            _print(found, scenes, notes)
        if plot is not None:
            write_plot(lambda: _figure(found, scenes), plot)


def _figures(
    path: Path,
    variants: list[str],
    given: dict[str, float | None],
    reference_speed: float | None,
    filter_window: float,
) -> tuple[dict[str, Any], Scene, list[str]]:
    """Key figures by source, the scene, and what is to be known of both, of a run folder or a scenario file."""
    from analytic.calibration import NoImpactError, key_figures, measure, measured_key_figures, warnings

    rows: dict[str, Any] = {}
    notes: list[str] = []
    if path.is_dir():
        _, series, scene = load(path, None)
        try:
            measured = measure(series["time"], series["impact_force_x"], filter_window)
        except NoImpactError:
            measured = None
        rows[SIMULATED] = measured_key_figures(series, measured)
        notes += [f"≥: {warning}." for warning in warnings(series, measured)]
    else:
        scene = read_scene(path)
    for name in variants:
        if scene.fixed and name in VARIANTS[1:]:
            continue  # a fixed barrier does not tell them from the first
        try:
            if name == CALIBRATED:
                impact = calibrated_impact(scene)
                notes += [f"{CALIBRATED}: {sentence}" for sentence in beyond_fit(scene)]
            else:
                model, _ = choose_model(scene, name, given)
                impact = make_impact(scene, model, reference_speed)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        rows[name] = key_figures(impact)
    return rows, scene, [*scene.notes, *notes]


def _print(found: dict[str, dict[str, Any]], scenes: dict[str, Scene], notes: dict[str, list[str]]) -> None:
    rows = []
    for name, sources in found.items():
        reference = sources.get(SIMULATED)
        for source, figures in sources.items():
            cells = [_cell(figures, reference, column, factor) for column, (_, factor) in COLUMNS.items()]
            rows.append([name if source == next(iter(sources)) else "", source, *cells])
    told = [f"{name}: {note}" for name in found for note in notes[name]]
    print_table("Impact", ["scene", "source", *(label for label, _ in COLUMNS.values())], rows, told)
    if len(scenes) == 1 and SIMULATED not in next(iter(found.values())):
        _print_pressures(next(iter(scenes.values())))


def _cell(figures: Any, reference: Any, column: str, factor: float) -> str:
    value = getattr(figures, column)
    text = number(None if value is None else value * factor)
    if column in figures.at_least:
        return f"≥ {text}"
    base = None if reference is None or column in reference.at_least else getattr(reference, column)
    if figures is reference or not base or value is None or math.isinf(value):
        return text
    return f"{text} ({100 * (value / base - 1):+.0f} %)"


def _print_pressures(scene: Scene) -> None:
    from analytic.empirical import select

    rows = []
    for model in select():
        pressure = float(model.pressure(scene.density, scene.speed, scene.flow_height, scene.gravity))
        over = pressure / (scene.density * scene.speed**2)
        rows.append([model.title, number(pressure / 1e3), number(over), model.confidence.value])
    title = f"Peak pressure of the same flow on a fixed barrier, Fr = {scene.froude_number:.2f}"
    print_table(title, ["model", "p [kPa]", "p / (ρ v²)", "confidence"], rows)


def _figure(found: dict[str, dict[str, Any]], scenes: dict[str, Scene]) -> Any:
    from analytic import plots

    kinds = {True: "fixed", False: "sliding"}
    kind = " and ".join(word for fixed, word in kinds.items() if any(one.fixed == fixed for one in scenes.values()))
    barriers = "barriers" if len(scenes) > 1 else "barrier"
    sources = {source for rows in found.values() for source in rows}
    words = "Simulated and closed-form impact" if SIMULATED in sources else "Closed-form impact"
    return plots.comparison(f"{words}, {kind} {barriers}", found, "sliding" in kind)
