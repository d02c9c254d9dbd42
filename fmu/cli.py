"""The command line: `python -m fmu build | check | benchmark`.

Exit codes: 0 done, 1 a check failed, 2 the input cannot be used (one sentence says why, on the standard error stream).
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from analytic.command_line import add_version
from warp_mpm.commands.options import ScenarioCommandLine, with_options
from warp_mpm.shipped import where_to_get

if TYPE_CHECKING:
    from fmu.cross_check import CrossCheck

FAILED = 1
DEFAULT_FOLDER = Path("build/fmu")

app = typer.Typer(
    cls=ScenarioCommandLine,
    help="FMI 2.0 co-simulation units of the closed-form model and of the simulator.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
add_version(app)


def main() -> None:
    """Entry point of `python -m fmu`."""
    app(prog_name="python -m fmu")


@app.command(epilog="Example: python -m fmu build --only BarrierSliding --only BarrierSlidingC --out fmus")
def build(
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = DEFAULT_FOLDER,
    only: Annotated[list[str] | None, typer.Option(help="Unit to build; may be repeated.", show_default="all")] = None,
    scenario: Annotated[
        Path | None, typer.Option(help="Scenario inside DebrisFlow.", show_default="scenarios/set_iib.json")
    ] = None,
    platform: Annotated[
        list[str] | None,
        typer.Option(
            help="Platform of the C unit: linux64, win64, darwin64; may be repeated.",
            show_default="all with ziglang installed, else this machine's",
        ),
    ] = None,
) -> None:
    """Build the units: BarrierSliding, BarrierSlidingC (plain C), GroundAnchor, DebrisFlow.

    The same sources give the same bytes. DebrisFlow remembers this Python as the one that runs its simulator.
    """
    from fmu import archive, c_unit

    names = [*(unit.name for unit in archive.PYTHON_UNITS), c_unit.INTERFACE.name]
    chosen = only or names
    unknown = [name for name in chosen if name not in names]
    if unknown:
        _refuse(f"--only = {unknown[0]} is not allowed; it must be one of {', '.join(names)}.")
    if scenario is not None:
        _check_scenario(scenario)
    _check_folder(out)
    try:
        if c_unit.INTERFACE.name in chosen:  # first, because it is the one that may lack what it needs
            built = c_unit.build_c_unit(out, platforms=tuple(platform) if platform else None)
            _tell(built, f"for {', '.join(c_unit.platforms_of(built))}")
            if platform is None and not c_unit.has_cross_compiler():
                typer.echo(c_unit.needs_cross_compiler(f"{built.name} for other platforms"), err=True)
        for unit in archive.PYTHON_UNITS:
            if unit.name in chosen:
                _tell(archive.build_python_unit(unit, out, scenario=scenario, simulate_reference=True))
    except archive.BuildError as error:
        _refuse(str(error))
    except OSError as error:
        _refuse(f"{out} cannot be written: {error.strerror or error}.")


@app.command(
    epilog="Examples: python -m fmu check; python -m fmu check build/fmu/BarrierSliding.fmu; "
    "python -m fmu check scenarios/set_iib.json --out checks"
)
def check(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[FILE]...",
            help="Archives (.fmu), which are proved, and scenarios (.json), on which the closed-form unit is compared "
            "with the simulation.",
            show_default="all units, freshly built",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for a scenario's figure (png) and table (md).")] = Path(
        "build/check"
    ),
    spacing: Annotated[float | None, typer.Option(help="Grid spacing [m].", show_default="the scenario's")] = None,
    until: Annotated[float | None, typer.Option(help="End time [s].", show_default="the scenario's")] = None,
    device: Annotated[str, typer.Option(help="Device of the simulation: cpu, cuda:0, ...")] = "cpu",
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON, SI units.")] = False,
) -> None:
    """Prove archives, and compare the closed-form unit with the simulation of a scenario.

    For a scenario: simulates it, calibrates λ and τ on the simulated force, runs the unit through fmpy, and shows F(t),
    v2(t) and Δx(t) of both in one figure and their differences in one table.
    """
    from fmu import archive, c_unit

    for file in files or ():
        if not file.is_file():
            _refuse(f"{file} is not there.{where_to_get(file)}")
        if file.suffix not in (".fmu", ".json"):
            _refuse(f"{file} has the suffix {file.suffix!r}, it must be .fmu or .json.")
    content: list[object] = []
    passed = True
    with tempfile.TemporaryDirectory(prefix="fmu_check_") as temporary:
        folder = Path(temporary)
        try:
            archives = [file for file in files or () if file.suffix == ".fmu"]
            if not files:
                archives = [archive.build_python_unit(unit, folder) for unit in archive.PYTHON_UNITS]
                archives.append(c_unit.build_c_unit(folder, platforms=(c_unit.host_platform(),)))
            for file in archives:
                passed &= _prove(file, content, as_json)
            scenarios = [file for file in files or () if file.suffix == ".json"]
            if scenarios:
                _check_folder(out)
                unit = archive.build_python_unit(archive.PYTHON_UNITS[0], folder)
            for file in scenarios:
                _compare(file, unit, out, spacing, until, device, content, as_json)
        except archive.BuildError as error:
            _refuse(str(error))
    if as_json:
        from analytic.cli.terminal import print_json

        print_json(content)
    if not passed:
        raise typer.Exit(FAILED)


@app.command(epilog="Example: python -m fmu benchmark --spacing 0.4")
def benchmark(
    scenario: Annotated[
        Path | None, typer.Option(help="Scenario inside DebrisFlow.", show_default="scenarios/set_iib.json")
    ] = None,
    spacing: Annotated[float | None, typer.Option(help="Grid spacing [m].", show_default="the scenario's")] = None,
) -> None:
    """Measure what the units cost: a step of the closed form through fmpy, and DebrisFlow over the plain simulation."""
    from analytic.cli.terminal import print_table
    from fmu import archive, c_unit
    from fmu.benchmark import closed_form_costs, simulator_costs

    if scenario is not None:
        _check_scenario(scenario)
    with tempfile.TemporaryDirectory(prefix="fmu_benchmark_") as temporary:
        folder = Path(temporary)
        units = {unit.name: unit for unit in archive.PYTHON_UNITS}
        try:
            closed_form = [
                archive.build_python_unit(units["BarrierSliding"], folder),
                c_unit.build_c_unit(folder, platforms=(c_unit.host_platform(),)),
            ]
            simulator = archive.build_python_unit(units["DebrisFlow"], folder, scenario=scenario)
            costs = closed_form_costs(closed_form)
            costs += simulator_costs(simulator, scenario or archive.DEFAULT_SCENARIO, spacing)
        except (archive.BuildError, ValueError) as error:
            _refuse(str(error))
    rows = []
    for cost in costs:
        value = f"{cost.value:+.1%}" if cost.unit == "%" else f"{cost.value:.2g} s"
        if cost.unit == "s" and cost.value < 1e-3:
            value = f"{1e6 * cost.value:.2g} µs"
        rows.append([cost.what, value])
    print_table("Cost of the units, wall time", ["", "measured"], rows)


def _prove(file: Path, content: list[object], as_json: bool) -> bool:
    from analytic.cli.terminal import print_table
    from fmu.check import CheckError, check_archive

    try:
        results = check_archive(file)
    except CheckError as error:
        _refuse(str(error))
    content.append(
        {"archive": file.name, "checks": {r.name: {"passed": r.passed, "detail": r.detail} for r in results}}
    )
    if not as_json:
        rows = [[r.name, "pass" if r.passed else "FAIL", r.detail] for r in results]
        print_table(file.name, ["check", "", "found"], rows)
    return all(result.passed for result in results)


def _compare(
    file: Path,
    unit: Path,
    out: Path,
    spacing: float | None,
    until: float | None,
    device: str,
    content: list[object],
    as_json: bool,
) -> None:
    from analytic import plots
    from analytic.cli.terminal import print_table
    from fmu.cross_check import cross_check
    from fmu.figure import cross_check_figure
    from warp_mpm import Scenario

    try:
        scenario = with_options(Scenario.load(file), spacing=spacing, until=until)
        found = cross_check(scenario, unit, device=device, on_progress=None if as_json else _Progress(scenario).show)
    except ValueError as error:  # of the scenario, the device, the closed form or the calibration: one sentence each
        _refuse(str(error))
    picture, written = out / f"{file.stem}.png", out / f"{file.stem}.md"
    table = _comparison(found)
    try:
        plots.save(cross_check_figure(found), picture)
        written.write_text(_markdown(*table), encoding="utf-8")
    except OSError as error:
        _refuse(f"{out} cannot be written: {error.strerror or error}.")
    content.append({"scenario": str(file), "figure": str(picture), "table": str(written), **found.as_dict()})
    if not as_json:
        print_table(*table)
        typer.echo(f"Figure and table: {picture}, {written}", err=True)


def _markdown(title: str, header: list[str], rows: list[list[str]], notes: list[str]) -> str:
    lines = [f"# {title}", "", *("| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows))]
    return "\n".join([*lines, *(f"\n{note}" for note in notes)]) + "\n"


def _comparison(found: CrossCheck) -> tuple[str, list[str], list[list[str]], list[str]]:
    """Title, header, rows and notes of the table."""
    from analytic.cli.terminal import number
    from fmu.cross_check import CURVES, FIGURES

    header = ["", *(f"{label} [{unit}]" for label, unit, _ in FIGURES.values()), *(f"rms {s}" for s in CURVES.values())]
    rows = [
        [
            "simulation",
            *(
                ("≥ " if key in found.at_least else "") + number(factor * found.figures[key])
                for key, (_, _, factor) in FIGURES.items()
            ),
            *("" for _ in CURVES),
        ]
    ]
    for comparison in found.comparisons:
        cells = []
        for key, (_, _, factor) in FIGURES.items():
            error = comparison.errors[key]
            share = "" if error is None else f" ({error:+.1%})"
            cells.append(number(factor * comparison.figures[key]) + share)
        for key in CURVES:
            rms = comparison.root_mean_squares[key]
            cells.append("–" if rms is None else f"{rms:.1%}")
        rows.append([f"unit, {comparison.name}", *cells])
    fits = [c.parameters for c in found.comparisons if c.name == "calibrated"]
    notes = [
        f"Calibrated: s1max = {p['s1max']:.4g} m (λ = {p['s1max'] / p['flow_length']:.3g}), τ = {p['rise_ratio']:.3g}."
        for p in fits
    ]
    notes += [
        f"With vertical load: κ = {c.parameters['vertical_load_ratio']:.3g}."
        for c in found.comparisons
        if "vertical_load_ratio" in c.parameters
    ]
    notes += [
        f"Simulated force: {found.filter_rule}. rms: over the largest simulated value.",
        *found.notes,
    ]
    return found.title, header, rows, notes


class _Progress:
    """One line that tells how far the simulation is; nothing where no person watches."""

    def __init__(self, scenario: object) -> None:
        self.end = scenario.output.end_time_s  # type: ignore[attr-defined]

    def show(self, time: float) -> None:
        import sys

        if sys.stderr.isatty():
            end = "\n" if time >= self.end else ""
            sys.stderr.write(f"\rSimulating: {time:.2f} of {self.end:g} s{end}")
            sys.stderr.flush()


def _check_scenario(file: Path) -> None:
    from warp_mpm.scenario import Scenario
    from warp_mpm.scenario_errors import ScenarioError

    try:
        Scenario.load(file)
    except ScenarioError as error:
        _refuse(str(error))


def _check_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        _refuse(f"{folder} cannot be made: {error.strerror or error}.")


def _tell(path: Path, remark: str = "") -> None:
    typer.echo(f"{path}  {path.stat().st_size / 1000:.0f} kB  {remark}".rstrip())


def _refuse(sentence: str) -> NoReturn:
    raise typer.BadParameter(sentence)


if __name__ == "__main__":
    main()
