"""`python -m analytic predict`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.terminal import AsJson, Plot, check_plot, check_sizes, number, print_json, print_table, write_plot
from analytic.command_line import refusals
from analytic.fitted import CALIBRATED, beyond_fit, coefficients
from analytic.impact import STANDARD_GRAVITY, VARIANTS, Impact
from analytic.scene import ASSUMED_RISE_RATIO, Scene, read_scene


def option(*names: str, help: str) -> Any:
    """An option that may be left out."""
    return typer.Option(*names, help=help, show_default=False)


def predict(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="Scenario file or run folder of the simulator; options override it.", show_default=False),
    ] = None,
    flow_mass: Annotated[float | None, option("--flow-mass", help="m1 [kg/m].")] = None,
    barrier_mass: Annotated[float | None, option("--barrier-mass", help="m2 [kg/m].")] = None,
    fixed: Annotated[bool, typer.Option("--fixed", help="The barrier is fixed to the ground.")] = False,
    flow_length: Annotated[float | None, option("--flow-length", help="L [m], of the box of equal volume.")] = None,
    flow_height: Annotated[float | None, option("--flow-height", help="h [m].")] = None,
    speed: Annotated[float | None, option("--speed", help="v1,0 [m/s].")] = None,
    barrier_initial_velocity: Annotated[float, typer.Option("--barrier-initial-velocity", help="v2,0 [m/s].")] = 0.0,
    base_friction: Annotated[float | None, option("--base-friction", help="tan δ_b [-].")] = None,
    geometry_change: Annotated[
        float | None,
        option("--lambda", "--geometry-change", help="λ = s1max / L [-]. The paper's: 0.72 fixed, 0.41 sliding."),
    ] = None,
    s1max: Annotated[float | None, option("--s1max", help="s1max [m], in place of λ.")] = None,
    rise_ratio: Annotated[
        float | None, option("--tau", "--rise-ratio", help=f"τ = T1 / T2 [-]; {ASSUMED_RISE_RATIO} is assumed.")
    ] = None,
    vertical_load_ratio: Annotated[
        float | None, option("--vertical-load-ratio", help="Vertical over horizontal force on the barrier [-]; 0.")
    ] = None,
    variant: Annotated[str, typer.Option("--variant", help=f"One of {', '.join([*VARIANTS, CALIBRATED])}.")] = VARIANTS[
        0
    ],
    face_angle: Annotated[
        float | None, option("--face-angle", help="β of the impacted face [degrees], for the calibrated variant.")
    ] = None,
    reference_speed: Annotated[
        float | None,
        option("--reference-speed", help="Speed [m/s] for which λ and τ are given; scales them to --speed (§3.2)."),
    ] = None,
    arrival_time: Annotated[float, typer.Option("--arrival-time", help="Time of arrival at the barrier [s].")] = 0.0,
    gravity: Annotated[
        float | None, option("--gravity", help=f"g [m/s²]; {STANDARD_GRAVITY} unless a scenario says otherwise.")
    ] = None,
    slope: Annotated[
        float | None, option("--slope", help="θ [degrees], by which the ground falls in the flow's direction; 0.")
    ] = None,
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Predict one impact: forces, times, velocities and the barrier's final displacement."""
    with refusals():
        check_plot(plot)
        given = {
            "flow_mass": flow_mass,
            "barrier_mass": barrier_mass,
            "flow_length": flow_length,
            "flow_height": flow_height,
            "speed": speed,
            "base_friction": base_friction,
            "gravity": gravity,
            "slope": slope,
            "face_angle": face_angle,
        }
        given_model = {
            "s1max": s1max,
            "geometry_change": geometry_change,
            "rise_ratio": rise_ratio,
            "vertical_load_ratio": vertical_load_ratio,
        }
        motion = {"barrier_initial_velocity": barrier_initial_velocity, "arrival_time": arrival_time}
        check_sizes(given | given_model | motion | {"reference_speed": reference_speed})
        scene = assemble(scenario, given, fixed)
        notes = [*(scene.doubts if scenario is None else ()), *scene.notes]
        model, assumed = choose_model(scene, variant, given_model)
        notes += assumed
        model |= motion
        impact = make_impact(scene, model, reference_speed)
        if as_json:
            print_json(_results(impact) | {"inputs": _inputs(impact), "notes": notes})
        else:
            _print(impact, _title(impact, scene, variant), notes)
        if plot is not None:
            write_plot(lambda: _figure(impact, variant, _title(impact, scene, variant)), plot)


def assemble(scenario: Path | None, given: dict[str, float | None], fixed: bool) -> Scene:
    """The scene of the file with what is given on the command line in place of its own."""
    stated = {name: value for name, value in given.items() if value is not None}
    if fixed and "barrier_mass" in stated:
        raise ValueError(f"barrier_mass is {stated['barrier_mass']:g} and the barrier is fixed, give only one.")
    if scenario is not None:
        base = read_scene(scenario)
        return Scene(**(base.__dict__ | stated | ({"barrier_mass": None} if fixed else {})))
    for name in ("flow_mass", "flow_length", "flow_height", "speed"):
        if name not in stated:
            raise ValueError(f"{name} is missing, give --{name.replace('_', '-')} or a scenario file.")
    if not fixed and "barrier_mass" not in stated:
        raise ValueError("barrier_mass is missing, give --barrier-mass, --fixed or a scenario file.")
    return Scene(**dict[str, Any](stated))


def choose_model(scene: Scene, variant: str, given: dict[str, float | None]) -> tuple[dict[str, Any], list[str]]:
    """Arguments of `Scene.impact` for a variant, the calibrated one included, and what is assumed, in sentences.

    `given`: what the user states of s1max, geometry_change, rise_ratio and vertical_load_ratio; it goes before the
    fitted or assumed values.
    """
    known = [*VARIANTS, CALIBRATED]
    if variant not in known:
        raise ValueError(f"variant is {variant!r}, it must be one of {', '.join(known)}.")
    stated = {name: value for name, value in given.items() if value is not None}
    lambda_stated = "s1max" in stated or "geometry_change" in stated
    if variant == CALIBRATED:
        model = coefficients(scene).model
        if lambda_stated:
            del model["geometry_change"]
        fitted = "λ, τ and the vertical load are fitted to simulations; see docs/closed_form.md for their errors."
        return model | stated, [fitted, *beyond_fit(scene)]
    notes = []
    if not lambda_stated:
        notes.append(f"λ = {scene.paper_geometry_change} is the paper's for this kind of barrier.")
    if "rise_ratio" not in stated:
        notes.append(f"τ = {ASSUMED_RISE_RATIO} is assumed; the paper names no value.")
    return {"variant": variant, **stated}, notes


def make_impact(scene: Scene, model: dict[str, Any], reference_speed: float | None) -> Impact:
    """The impact; s1max and tau scaled from the reference speed to the scene's by the rule of section 3.2."""
    if reference_speed is None:
        return scene.impact(**model)
    reference = Scene(**(scene.__dict__ | {"speed": reference_speed})).impact(**model)
    return reference.scaled_to_speed(scene.speed)


RESULTS = {
    "peak_force": ("peak force F", "kN/m", 1e-3),
    "peak_pressure": ("peak pressure F/h", "kPa", 1e-3),
    "peak_time": ("time of the peak", "s", 1.0),
    "impact_end_time": ("end of the impact", "s", 1.0),
    "impulse": ("impulse J", "kN s/m", 1e-3),
    "common_velocity": ("common velocity", "m/s", 1.0),
    "barrier_velocity_max": ("largest barrier velocity", "m/s", 1.0),
    "barrier_velocity_at_impact_end": ("barrier velocity at impact end", "m/s", 1.0),
    "barrier_kinetic_energy_max": ("largest barrier energy", "kJ/m", 1e-3),
    "stop_time": ("barrier at rest from", "s", 1.0),
    "barrier_displacement_final": ("final barrier displacement", "m", 1.0),
}
"""What is printed, with the unit of the table and its factor from SI."""


def _results(impact: Impact) -> dict[str, Any]:
    return {name: getattr(impact, name) for name in RESULTS}


def _inputs(impact: Impact) -> dict[str, Any]:
    return {
        "flow_mass": impact.flow_mass,
        "barrier_mass": None if impact.fixed else impact.barrier_mass,
        "fixed": impact.fixed,
        "flow_length": impact.flow_length,
        "flow_height": impact.flow_height,
        "speed": impact.speed,
        "barrier_initial_velocity": impact.barrier_initial_velocity,
        "base_friction": impact.base_friction,
        "geometry_change": impact.geometry_change_length / impact.flow_length,
        "s1max": impact.geometry_change_length,
        "rise_ratio": impact.rise_ratio,
        "vertical_load_ratio": impact.vertical_load_ratio,
        "variant": impact.variant,
        "arrival_time": impact.arrival_time,
        "gravity": impact.gravity,
        "slope": impact.slope,
    }


def _title(impact: Impact, scene: Scene, variant: str) -> str:
    return f"{scene.title or ('Fixed barrier' if impact.fixed else 'Sliding barrier')}; {variant}"


def _print(impact: Impact, title: str, notes: list[str]) -> None:
    rows = [[label, number(getattr(impact, name) * factor, 6), unit] for name, (label, unit, factor) in RESULTS.items()]
    inputs = (
        f"m1 = {impact.flow_mass:g} kg/m, m2 = {'fixed' if impact.fixed else f'{impact.barrier_mass:g} kg/m'}, "
        f"L = {impact.flow_length:g} m, h = {impact.flow_height:g} m, v = {impact.speed:g} m/s, "
        f"λ = {impact.geometry_change_length / impact.flow_length:.4g}, τ = {impact.rise_ratio:.4g}"
    )
    if not impact.fixed:
        inputs += f", tan δ_b = {impact.base_friction:g}"
    if impact.slope:
        inputs += f", θ = {impact.slope:g}°"
    if impact.vertical_load_ratio:
        inputs += f", κ = {impact.vertical_load_ratio:.4g}"
    if impact.variant == "as_printed":
        notes = [*notes, "as_printed: the paper's formulas to the letter, which break momentum; for comparison only."]
    clock = "Times count from the arrival of the flow." if impact.arrival_time == 0 else ""
    print_table(title, ["quantity", "value", "unit"], rows, [inputs, *filter(None, [clock]), *notes])


def _figure(impact: Impact, variant: str, title: str) -> Any:
    from analytic import plots

    return plots.impacts({variant: impact}, title)
