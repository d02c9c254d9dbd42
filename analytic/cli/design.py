"""`python -m analytic design`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.predict import option
from analytic.cli.terminal import AsJson, Plot, check_plot, check_sizes, number, print_json, print_table, write_plot
from analytic.command_line import refusals
from analytic.fitted import beyond_fit
from analytic.impact import STANDARD_GRAVITY, friction_deceleration
from analytic.scene import ASSUMED_RISE_RATIO, PAPER_GEOMETRY_CHANGE, Scene, read_scene

ASSUMED_DENSITY = 2000.0
"""Density of the barrier [kg/m^3] where neither an option nor the scenario gives it."""

ASSUMED_HEIGHT_RATIO = 2.0
"""Likewise H / h [-]."""

BY_SIMULATION = (
    "The closed form's displacement may be off by a factor of two, calibrated in one scene of four by more, and it "
    "does not see overtopping: python -m warp_mpm design SCENARIO finds the lightest barrier by simulation."
)
"""What goes with every answer."""

INPUTS = {
    "density": ("density of the flow ρ", "kg/m³"),
    "flow_length": ("length of the flow L", "m"),
    "flow_height": ("depth of the flow h", "m"),
    "speed": ("velocity of the flow v", "m/s"),
    "gravity": ("gravity g", "m/s²"),
    "slope": ("slope of the ground θ", "°"),
    "barrier_mass": ("mass of the barrier m2", "kg/m"),
    "base_friction": ("base friction tan δ_b", "-"),
    "barrier_density": ("density of the barrier", "kg/m³"),
    "barrier_height": ("height of the barrier H", "m"),
    "least_crest_width": ("least crest width b", "m"),
    "face_angle": ("face angle β", "°"),
    "geometry_change": ("λ", "-"),
    "rise_ratio": ("τ", "-"),
    "vertical_load_ratio": ("vertical load κ", "-"),
}
"""What an answer rests on: label and unit of the table."""

FORMS = "a number, or normal(mean, deviation), lognormal(mean, variation), uniform(low, high), triangular(a, mode, b)"


def design(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            help="Scenario file for the flow, the ground and the barrier's height, density and base friction; "
            "options override it.",
            show_default=False,
        ),
    ] = None,
    limit: Annotated[float | None, option("--limit", help="Greatest final displacement [m].")] = None,
    density: Annotated[str | None, option("--density", help=f"ρ of the flow [kg/m³]: {FORMS}.")] = None,
    flow_length: Annotated[str | None, option("--flow-length", help="L [m], likewise.")] = None,
    flow_height: Annotated[str | None, option("--flow-height", help="h [m], likewise.")] = None,
    speed: Annotated[str | None, option("--speed", help="v1,0 [m/s], likewise.")] = None,
    base_friction: Annotated[str | None, option("--base-friction", help="tan δ_b [-], likewise.")] = None,
    geometry_change: Annotated[
        str | None,
        option(
            "--lambda", "--geometry-change", help=f"λ [-], likewise; {PAPER_GEOMETRY_CHANGE['sliding']} if not given."
        ),
    ] = None,
    rise_ratio: Annotated[
        str | None, option("--tau", "--rise-ratio", help=f"τ [-], likewise; {ASSUMED_RISE_RATIO} if not given.")
    ] = None,
    vertical_load_ratio: Annotated[
        str | None,
        option("--vertical-load-ratio", help="Vertical over horizontal force [-], likewise; 0 if not given."),
    ] = None,
    calibrated: Annotated[
        bool, typer.Option("--calibrated", help="Take λ, τ and the vertical load from the fit to simulations.")
    ] = False,
    barrier_mass: Annotated[
        str | None, option("--barrier-mass", help="m2 [kg/m] of a given barrier, whose probability is asked for.")
    ] = None,
    probability: Annotated[
        float | None, option("--probability", help="Accepted probability of sliding beyond the limit.")
    ] = None,
    height: Annotated[
        float | None, option("--height", help="H [m] of the barrier; the scenario's, or 2 h if it has none.")
    ] = None,
    crest_width: Annotated[
        float | None, option("--crest-width", help="Least crest width b [m]; 1 if not given.")
    ] = None,
    face_angle: Annotated[
        tuple[float, float] | None,
        option("--face-angle", help="Least and greatest face angle β [degrees]; 60 and 80 if not given."),
    ] = None,
    barrier_density: Annotated[
        float | None,
        option("--barrier-density", help=f"Density [kg/m³]; the scenario's, or {ASSUMED_DENSITY:g} if it has none."),
    ] = None,
    samples: Annotated[int, typer.Option("--samples", help="Number of samples.")] = 1_000_000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the random numbers.")] = 1,
    gravity: Annotated[
        float | None, option("--gravity", help=f"g [m/s²]; the scenario's, or {STANDARD_GRAVITY}.")
    ] = None,
    slope: Annotated[
        float | None,
        option("--slope", help="θ [degrees], by which the ground falls in the flow's direction; likewise, or 0."),
    ] = None,
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
        base = None if scenario is None else read_scene(scenario)
        inputs = _Inputs(base)
        flow = {
            "density": density,
            "flow_length": flow_length,
            "flow_height": flow_height,
            "speed": speed,
            "base_friction": base_friction,
        }
        values: dict[str, Any] = {name: inputs.needed(name, text, parse) for name, text in flow.items()}
        model = {
            "geometry_change": (geometry_change, PAPER_GEOMETRY_CHANGE["sliding"]),
            "rise_ratio": (rise_ratio, ASSUMED_RISE_RATIO),
            "vertical_load_ratio": (vertical_load_ratio, 0.0),
        }
        for name, (text, assumed) in model.items():
            values[name] = inputs.choose(name, None if text is None else parse(name, text), assumed)
        if barrier_mass is not None:
            values["barrier_mass"] = inputs.choose("barrier_mass", parse("barrier_mass", barrier_mass), None)
        sizes = {"limit": limit, "gravity": gravity, "slope": slope, "height": height, "crest_width": crest_width}
        check_sizes(values | sizes | {"barrier_density": barrier_density, "face_angle": face_angle})
        medians = {name: _median(value, name) for name, value in values.items()}
        scene = Scene(
            flow_mass=medians["density"] * medians["flow_length"] * medians["flow_height"],
            flow_length=medians["flow_length"],
            flow_height=medians["flow_height"],
            speed=medians["speed"],
            barrier_mass=1.0,
            base_friction=medians["base_friction"],
            gravity=inputs.choose("gravity", gravity, STANDARD_GRAVITY),
            slope=inputs.choose("slope", slope, 0.0),
            remarks=() if base is None else base.remarks,
        )
        if base is None:
            scene = replace(scene, remarks=replace(scene, barrier_mass=None).doubts)
        bounds = Bounds(
            height=inputs.choose("barrier_height", height, ASSUMED_HEIGHT_RATIO * scene.flow_height),
            density=inputs.choose("barrier_density", barrier_density, ASSUMED_DENSITY),
            crest_width=inputs.choose("least_crest_width", crest_width, 1.0),
            face_angle=inputs.choose("face_angle", face_angle, (60.0, 80.0)),
        )
        job = _Job(scene, inputs, values, medians, limit, bounds, samples, seed, calibrated, as_json, plot)
        if any(isinstance(value, Distribution) for value in values.values()):
            if calibrated:
                raise ValueError("calibrated is for numbers; with distributions give λ, τ and the vertical load.")
            job.uncertain(probability, mass_given=barrier_mass is not None)
        elif probability is not None or barrier_mass is not None:
            name = "probability" if probability is not None else "barrier_mass"
            raise ValueError(f"{name} needs an uncertain input, give at least one as a distribution.")
        else:
            job.certain()


class _Inputs:
    """What the answer rests on, and where each value is from."""

    def __init__(self, scene: Scene | None):
        self.scene = scene
        self.chosen: dict[str, tuple[Any, str]] = {}

    def choose(self, name: str, given: Any, assumed: Any) -> Any:
        """The given value, or else the scenario's where it has a finite one, or else the assumed one."""
        # The scenario's face angle is that of its barrier, not the range in which one is looked for.
        own = None if name == "face_angle" else getattr(self.scene, name, None)
        if given is not None:
            self.chosen[name] = (given, "given")
        elif own is not None and math.isfinite(own):
            self.chosen[name] = (own, "scenario")
        else:
            self.chosen[name] = (assumed, "assumed")
        return self.chosen[name][0]

    def needed(self, name: str, text: str | None, parse: Any) -> Any:
        """As `choose`, of the text of a number or a distribution, and refused where there is none."""
        value = self.choose(name, None if text is None else parse(name, text), None)
        if value is None:
            where = " or a scenario of a sliding barrier" if name == "base_friction" else " or a scenario file"
            raise ValueError(f"{name} is missing, give --{name.replace('_', '-')}{where}.")
        return value

    def drop_shape(self) -> None:
        """Leave out what bounds the shape, of which a barrier of given mass needs nothing."""
        for name in ("barrier_density", "barrier_height", "least_crest_width", "face_angle"):
            del self.chosen[name]

    def fitted(self, coefficients: Any) -> None:
        """Take λ, τ and the vertical load from the fit."""
        for name in ("geometry_change", "rise_ratio", "vertical_load_ratio"):
            self.chosen[name] = (getattr(coefficients, name), "fitted")

    def as_dict(self) -> dict[str, Any]:
        """For JSON; a distribution as it is written, bounds of the face angle as a list."""
        return {
            name: {"value": value if isinstance(value, float | tuple) else str(value), "source": source}
            for name, (value, source) in self.chosen.items()
        }

    def print(self, notes: list[str]) -> None:
        """One row for each value."""
        rows = []
        for name, (label, unit) in INPUTS.items():
            if name not in self.chosen:
                continue
            value, source = self.chosen[name]
            text = " to ".join(map(number, value)) if isinstance(value, tuple) else str(value)
            rows.append([label, number(value) if isinstance(value, float) else text, unit, source])
        print_table("What this rests on", ["input", "value", "unit", "from"], rows, notes)


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
        inputs: _Inputs,
        values: dict[str, Any],
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

        self.scene, self.inputs, self.values, self.limit, self.bounds = scene, inputs, values, limit, bounds
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
        designed = replace(
            self.scene, barrier_mass=found.mass, face_angle=found.face_angle, barrier_height=found.height
        )
        notes = _notes(designed)
        if self.calibrated:
            self.inputs.fitted(found.coefficients)
            notes += beyond_fit(designed)
        else:
            notes.append("Of the barrier the closed form sees the mass alone; equally light shapes slide alike.")
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
                    "base_resistance": _base_resistance(designed),
                    "inputs": self.inputs.as_dict(),
                    "notes": notes,
                }
            )
        else:
            rows = [
                *_shape_rows((found.base_width, found.crest_width, found.height, found.face_angle), found.mass),
                ["mass over the flow's", number(found.mass / self.scene.flow_mass), "-"],
                ["final displacement", number(found.displacement), "m"],
                ["base resistance R", number(_base_resistance(designed) / 1e3), "kN/m"],
                ["governed by", found.governed_by, ""],
            ]
            title = f"Lightest barrier that slides at most {self.limit:g} m"
            print_table(title, ["quantity", "value", "unit"], rows)
            self.inputs.print(notes)
        if self.plot is not None:
            write_plot(lambda: self._chart(found.mass, found.face_angle), self.plot)

    def uncertain(self, probability: float | None, mass_given: bool) -> None:
        """Probability of sliding beyond the limit, and what matters."""
        from analytic.design import lightest_barrier, trapezoid
        from analytic.reliability import lightest_mass, reliability

        if mass_given and probability is not None:
            raise ValueError("barrier_mass and probability are both given, give only one.")
        sampling: dict[str, Any] = {
            "samples": self.samples,
            "seed": self.seed,
            "gravity": self.scene.gravity,
            "slope": self.scene.slope,
        }
        if probability is not None:
            mass = lightest_mass(self.values, self.limit, probability, **sampling)
            which = f"lightest that slides beyond {self.limit:g} m with a probability of at most {probability:g}"
        elif mass_given:
            mass, which = self.given_mass or 0.0, "given"
        else:
            found = lightest_barrier(self.scene, self.limit, self.bounds, self.rule)
            mass, which = found.mass, "lightest for the medians"
        shape = None if mass_given else trapezoid(mass, self.bounds)
        if shape is None:
            self.inputs.drop_shape()
        else:
            mass = self.bounds.density * shape[2] * (shape[0] + shape[1]) / 2
        values = self.values if mass_given else {**self.values, "barrier_mass": mass}
        result = reliability(values, self.limit, **sampling)
        notes = _notes(replace(self.scene, barrier_mass=mass))
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
                "inputs": self.inputs.as_dict(),
                "notes": notes,
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
            self.inputs.print(notes)
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


def _base_resistance(scene: Scene) -> float:
    """R [N/m], the force that the barrier withstands before the flow comes."""
    mass, friction = scene.barrier_mass or 0.0, scene.base_friction or 0.0
    return mass * friction_deceleration(scene.gravity, friction, scene.slope)


def _notes(scene: Scene) -> list[str]:
    """What the closed form does not see, and whether a flow at rest would push the barrier on."""
    pull = scene.flow_mass * scene.gravity * math.sin(math.radians(scene.slope))
    notes = list(scene.notes)
    if pull > _base_resistance(scene):
        heavier = (
            "The flow's weight along the slope exceeds the base resistance: where the ground does not hold the flow, "
        )
        notes.append(heavier + "it pushes the barrier on for ever.")
    return [*notes, BY_SIMULATION]


def _shape_rows(shape: tuple[float, float, float, float], mass: float) -> list[list[str]]:
    base, crest, height, angle = shape
    return [
        ["base width B", number(base), "m"],
        ["crest width b", number(crest), "m"],
        ["height H", number(height), "m"],
        ["face angle β", number(angle), "°"],
        ["mass m2", number(mass, 6), "kg/m"],
    ]
