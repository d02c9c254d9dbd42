"""`python -m analytic design`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.predict import option
from analytic.cli.terminal import AsJson, Plot, check_plot, number, print_json, print_table, refusals, write_plot
from analytic.impact import STANDARD_GRAVITY
from analytic.scene import ASSUMED_RISE_RATIO, PAPER_GEOMETRY_CHANGE, Scene, read_scene

FORMS = "a number, or normal(mean, deviation), lognormal(mean, variation), uniform(low, high), triangular(a, mode, b)"


def design(
    scenario: Annotated[
        Path | None, typer.Argument(help="Scenario file for the flow; options override it.", show_default=False)
    ] = None,
    limit: Annotated[float | None, option("--limit", help="Greatest final displacement [m].")] = None,
    density: Annotated[str | None, option("--density", help=f"ρ of the flow [kg/m³]: {FORMS}.")] = None,
    flow_length: Annotated[str | None, option("--flow-length", help="L [m], likewise.")] = None,
    flow_height: Annotated[str | None, option("--flow-height", help="h [m], likewise.")] = None,
    speed: Annotated[str | None, option("--speed", help="v1,0 [m/s], likewise.")] = None,
    base_friction: Annotated[str | None, option("--base-friction", help="tan δ_b [-], likewise.")] = None,
    geometry_change: Annotated[
        str, typer.Option("--lambda", "--geometry-change", help="λ [-], likewise.")
    ] = f"{PAPER_GEOMETRY_CHANGE['sliding']}",
    rise_ratio: Annotated[
        str, typer.Option("--tau", "--rise-ratio", help="τ [-], likewise.")
    ] = f"{ASSUMED_RISE_RATIO}",
    vertical_load_ratio: Annotated[
        str, typer.Option("--vertical-load-ratio", help="Vertical over horizontal force [-], likewise.")
    ] = "0",
    calibrated: Annotated[
        bool, typer.Option("--calibrated", help="Take λ, τ and the vertical load from the fit to simulations.")
    ] = False,
    barrier_mass: Annotated[
        str | None, option("--barrier-mass", help="m2 [kg/m] of a given barrier, whose probability is asked for.")
    ] = None,
    probability: Annotated[
        float | None, option("--probability", help="Accepted probability of sliding beyond the limit.")
    ] = None,
    height: Annotated[float | None, option("--height", help="H [m] of the barrier; 2 h if not given.")] = None,
    crest_width: Annotated[float, typer.Option("--crest-width", help="Least crest width b [m].")] = 1.0,
    face_angle: Annotated[
        tuple[float, float], typer.Option("--face-angle", help="Least and greatest face angle β [degrees].")
    ] = (60.0, 80.0),
    barrier_density: Annotated[float, typer.Option("--barrier-density", help="Density [kg/m³].")] = 2000.0,
    samples: Annotated[int, typer.Option("--samples", help="Number of samples.")] = 1_000_000,
    seed: Annotated[int, typer.Option("--seed", help="Of the random numbers.")] = 1,
    gravity: Annotated[float, typer.Option("--gravity", help="g [m/s²].")] = STANDARD_GRAVITY,
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Find the lightest trapezoid that a flow moves no farther than a limit.

    With a distribution in place of a number: the probability that the barrier slides beyond the limit, and which
    input matters most. The barrier is then the one of --barrier-mass, or the lightest one that keeps --probability, or
    the lightest one for the medians. Overturning and inner stability are not looked at.
    """
    with refusals():
        check_plot(plot)
        from analytic.design import Bounds
        from analytic.reliability import Distribution, parse

        if limit is None:
            raise ValueError("limit is missing, give --limit in metres.")
        texts = _texts(scenario, density, flow_length, flow_height, speed, base_friction)
        texts |= {
            "geometry_change": geometry_change,
            "rise_ratio": rise_ratio,
            "vertical_load_ratio": vertical_load_ratio,
        }
        if barrier_mass is not None:
            texts["barrier_mass"] = barrier_mass
        inputs = {name: parse(name, text) for name, text in texts.items()}
        medians = {name: _median(value, name) for name, value in inputs.items()}
        scene = Scene(
            flow_mass=medians["density"] * medians["flow_length"] * medians["flow_height"],
            flow_length=medians["flow_length"],
            flow_height=medians["flow_height"],
            speed=medians["speed"],
            barrier_mass=1.0,
            base_friction=medians["base_friction"],
            gravity=gravity,
        )
        bounds = Bounds(
            height=2 * scene.flow_height if height is None else height,
            crest_width=crest_width,
            face_angle=face_angle,
            density=barrier_density,
        )
        job = _Job(scene, inputs, medians, limit, bounds, samples, seed, calibrated, as_json, plot)
        if any(isinstance(value, Distribution) for value in inputs.values()):
            if calibrated:
                raise ValueError("calibrated is for numbers; with distributions give λ, τ and the vertical load.")
            job.uncertain(probability, mass_given=barrier_mass is not None)
        elif probability is not None or barrier_mass is not None:
            name = "probability" if probability is not None else "barrier_mass"
            raise ValueError(f"{name} needs an uncertain input, give at least one as a distribution.")
        else:
            job.certain()


def _texts(scenario: Path | None, *given: str | None) -> dict[str, str]:
    """Flow and base friction as texts, from the options or else from the scenario."""
    names = ("density", "flow_length", "flow_height", "speed", "base_friction")
    texts = {name: text for name, text in zip(names, given, strict=True) if text is not None}
    if scenario is not None:
        scene = read_scene(scenario)
        for name in names:
            if name not in texts and getattr(scene, name) is not None:
                texts[name] = repr(getattr(scene, name))
    for name in names:
        if name not in texts:
            where = " or a scenario of a sliding barrier" if name == "base_friction" else " or a scenario file"
            raise ValueError(f"{name} is missing, give --{name.replace('_', '-')}{where}.")
    return texts


def _median(value: Any, name: str) -> float:
    if isinstance(value, float):
        return value
    import numpy as np

    from analytic.reliability import INPUTS

    return float(value.quantile(np.array(0.5), *INPUTS[name]))


class _Job:
    """One call of the command, its inputs read."""

    def __init__(
        self,
        scene: Scene,
        inputs: dict[str, Any],
        medians: dict[str, float],
        limit: float,
        bounds: Any,
        samples: int,
        seed: int,
        calibrated: bool,
        as_json: bool,
        plot: Path | None,
    ):
        from analytic import fitted

        self.scene, self.inputs, self.limit, self.bounds = scene, inputs, limit, bounds
        self.samples, self.seed, self.as_json, self.plot = samples, seed, as_json, plot
        self.calibrated = calibrated
        names = ("geometry_change", "rise_ratio", "vertical_load_ratio")
        self.coefficients = fitted.Coefficients(**dict[str, Any]({name: medians[name] for name in names}))
        self.given_mass = medians.get("barrier_mass")
        self.rule = fitted.coefficients if calibrated else self._constant

    def _constant(self, scene: Scene) -> Any:
        return self.coefficients

    def certain(self) -> None:
        """The lightest trapezoid and the chart."""
        from analytic.design import lightest_barrier

        found = lightest_barrier(self.scene, self.limit, self.bounds, self.rule)
        if self.as_json:
            print_json(
                {
                    "base_width": found.base_width,
                    "crest_width": found.crest_width,
                    "height": found.height,
                    "face_angle_deg": found.face_angle,
                    "mass": found.mass,
                    "mass_ratio": found.mass / self.scene.flow_mass,
                    "displacement": found.displacement,
                    "limit": self.limit,
                    "governed_by": found.governed_by,
                    "coefficients": found.coefficients.model,
                }
            )
        else:
            rows = [
                *_shape_rows((found.base_width, found.crest_width, found.height, found.face_angle), found.mass),
                ["mass over the flow's", number(found.mass / self.scene.flow_mass), "-"],
                ["final displacement", number(found.displacement), "m"],
                ["governed by", found.governed_by, ""],
            ]
            at = found.coefficients
            notes = [f"λ = {at.geometry_change:.3g}, τ = {at.rise_ratio:.3g}, κ = {at.vertical_load_ratio:.3g}"]
            if not self.calibrated:
                notes.append("Of the barrier the closed form sees the mass alone; equally light shapes slide alike.")
            title = f"Lightest barrier that slides at most {self.limit:g} m"
            print_table(title, ["quantity", "value", "unit"], rows, notes)
        if self.plot is not None:
            write_plot(lambda: self._chart(found.mass, found.face_angle), self.plot)

    def uncertain(self, probability: float | None, mass_given: bool) -> None:
        """Probability of sliding beyond the limit, and what matters."""
        from analytic.design import lightest_barrier, trapezoid
        from analytic.reliability import lightest_mass, reliability

        if mass_given and probability is not None:
            raise ValueError("barrier_mass and probability are both given, give only one.")
        if probability is not None:
            sampling: dict[str, Any] = {"samples": self.samples, "seed": self.seed, "gravity": self.scene.gravity}
            mass = lightest_mass(self.inputs, self.limit, probability, **sampling)
            which = f"lightest that slides beyond {self.limit:g} m with a probability of at most {probability:g}"
        elif mass_given:
            mass, which = self.given_mass or 0.0, "given"
        else:
            found = lightest_barrier(self.scene, self.limit, self.bounds, self.rule)
            mass, which = found.mass, "lightest for the medians"
        shape = None if mass_given else trapezoid(mass, self.bounds)
        if shape is not None:
            mass = self.bounds.density * shape[2] * (shape[0] + shape[1]) / 2
        inputs = self.inputs if mass_given else {**self.inputs, "barrier_mass": mass}
        result = reliability(inputs, self.limit, samples=self.samples, seed=self.seed, gravity=self.scene.gravity)
        if self.as_json:
            names = ("base_width", "crest_width", "height", "face_angle_deg")
            content: dict[str, Any] = {} if shape is None else dict(zip(names, shape, strict=True))
            content |= {
                "mass": mass,
                "limit": self.limit,
                "probability": result.probability,
                "confidence_interval": list(result.interval),
                "samples": result.samples,
                "mean_displacement": result.mean,
                "quantiles": {f"{level:g}": value for level, value in result.quantiles.items()},
                "sensitivity": {
                    name: {"total": s.total, "first": s.first, "rank_correlation": s.rank_correlation}
                    for name, s in result.sensitivity.items()
                },
            }
            print_json(content)
        else:
            rows = [] if shape is None else _shape_rows(shape, mass)
            low, high = result.interval
            rows += [
                ["probability of sliding farther", f"{result.probability:.4g}", "-"],
                ["  95 % confidence", f"{low:.4g} to {high:.4g}", "-"],
                ["mean displacement", number(result.mean), "m"],
                *([f"  {level:.0%} stay below", number(value), "m"] for level, value in result.quantiles.items()),
            ]
            title = f"Barrier ({which}), limit {self.limit:g} m, {result.samples} samples"
            print_table(title, ["quantity", "value", "unit"], rows)
            rows = [
                [name.replace("_", " "), f"{s.total:.3f}", f"{s.first:.3f}", f"{s.rank_correlation:+.2f}"]
                for name, s in result.sensitivity.items()
            ]
            header = ["input", "total Sobol' index", "first order", "rank correlation"]
            print_table("What the displacement depends on, the most important first", header, rows)
        if self.plot is not None:
            from analytic import plots

            write_plot(lambda: plots.reliability(result, self.limit, f"Barrier of {mass:.0f} kg/m"), self.plot)

    def _chart(self, mass: float, angle: float) -> Any:
        import numpy as np

        from analytic import plots
        from analytic.design import chart

        ratio = mass / self.scene.flow_mass
        ratios = np.linspace(min(0.2, 0.5 * ratio), max(3.0, 1.5 * ratio), 60)
        speeds = np.linspace(0.2 * self.scene.speed, 2 * self.scene.speed, 60)
        moved = chart(
            replace(self.scene, face_angle=angle, barrier_height=self.bounds.height), ratios, speeds, self.rule
        )
        title = f"Final displacement; L = {self.scene.flow_length:g} m, h = {self.scene.flow_height:g} m"
        return plots.design_chart(ratios, speeds, moved, self.limit, (ratio, self.scene.speed), title)


def _shape_rows(shape: tuple[float, float, float, float], mass: float) -> list[list[str]]:
    base, crest, height, angle = shape
    return [
        ["base width B", number(base), "m"],
        ["crest width b", number(crest), "m"],
        ["height H", number(height), "m"],
        ["face angle β", number(angle), "°"],
        ["mass m2", number(mass, 6), "kg/m"],
    ]
