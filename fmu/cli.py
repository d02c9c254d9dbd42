"""The command line: `python -m fmu build | release | check | parameters | benchmark`, `warp_mpm_fmu` where installed.

Exit codes: 0 done, 1 a check failed, 2 the input cannot be used (one sentence says why, on the standard error stream).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from analytic.command_line import add_version
from analytic.whole_file import write_whole
from warp_mpm.commands.options import ScenarioCommandLine, with_options
from warp_mpm.shipped import where_to_get

if TYPE_CHECKING:
    from .cross_check import CrossCheck

FAILED = 1
DEFAULT_FOLDER = Path("build/fmu")
COMMAND = f"python -m {__package__}"
"""The package is `fmu` in a checkout, `warp_mpm_fmu` where it is installed."""

app = typer.Typer(
    cls=ScenarioCommandLine,
    help="Co-simulation units (FMI 2.0 and 3.0) of the closed-form model and of the simulator.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
add_version(app)


def main() -> None:
    """Entry point of `python -m fmu` and of the installed command `warp-mpm-fmu`."""
    app(prog_name="warp-mpm-fmu" if Path(sys.argv[0]).name.startswith("warp-mpm") else COMMAND)


@app.command(epilog=f"Example: {COMMAND} build --only BarrierSliding --only BarrierSlidingC --out fmus")
def build(
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = DEFAULT_FOLDER,
    only: Annotated[list[str] | None, typer.Option(help="Unit to build; may be repeated.", show_default="all")] = None,
    scenario: Annotated[
        Path | None, typer.Option(help="Scenario inside DebrisFlow.", show_default="scenarios/set_iib.json")
    ] = None,
    platform: Annotated[
        list[str] | None,
        typer.Option(
            help="Platform of the C units: linux64, linux-aarch64, win64, darwin64; may be repeated.",
            show_default="all with ziglang installed, else this machine's",
        ),
    ] = None,
) -> None:
    """Build the units BarrierSliding, GroundAnchor and DebrisFlow: packed by pythonfmu, in C, and in C for FMI 3.0.

    The names of those in C end in C and C3. The same sources give the same bytes. DebrisFlow remembers this Python as
    the one that runs its simulator.
    """
    from . import archive, c_unit

    names = [unit.name for unit in archive.PYTHON_UNITS] + [unit.name for unit in c_unit.C_UNITS]
    chosen = only or names
    unknown = [name for name in chosen if name not in names]
    if unknown:
        _refuse(f"--only = {unknown[0]} is not allowed; it must be one of {', '.join(names)}.")
    if scenario is not None:
        _check_scenario(scenario)
    _check_folder(out)
    try:
        _build(chosen, out, scenario, tuple(platform) if platform else None, by_name=only is not None)
    except archive.BuildError as error:
        _refuse(str(error))
    except OSError as error:
        _refuse(f"{out} cannot be written: {error.strerror or error}.")


@app.command(epilog=f"Example: {COMMAND} release --out dist")
def release(
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = Path("dist"),
    platform: Annotated[
        list[str] | None,
        typer.Option(
            help="Platform of the C units; may be repeated.",
            show_default="all with ziglang installed, else this machine's",
        ),
    ] = None,
) -> None:
    """Build what a release carries: all units, the system of them (SSP), and a manifest of hashes.

    The same sources give the same bytes in any folder, on any day. The simulator's units remember no Python here.
    """
    from . import archive
    from .release import build_release

    _check_folder(out)
    try:
        build_release(out, platforms=tuple(platform) if platform else None, tell=_tell)
    except archive.BuildError as error:
        _refuse(str(error))
    except OSError as error:
        _refuse(f"{out} cannot be written: {error.strerror or error}.")


@app.command(
    epilog=f"Examples: {COMMAND} check; {COMMAND} check build/fmu/BarrierSliding.fmu; "
    f"{COMMAND} check scenarios/set_iib.json --out checks"
)
def check(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE",
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
    from . import archive, c_unit

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
                host = (c_unit.host_platform(),)
                archives += [
                    c_unit.build_c_unit(unit, folder, platforms=host)
                    for unit in c_unit.C_UNITS
                    if c_unit.offered(unit, host[0])
                ]
            for file in archives:
                passed &= _prove(file, content, as_json)
            scenarios = [file for file in files or () if file.suffix == ".json"]
            if scenarios:
                _check_folder(out)
                closed_form = archive.build_python_unit(archive.PYTHON_UNITS[0], folder)
            for file in scenarios:
                _compare(file, closed_form, out, spacing, until, device, content, as_json)
        except archive.BuildError as error:
            _refuse(str(error))
    if as_json:
        from analytic.cli.terminal import print_json

        print_json(content)
    if not passed:
        raise typer.Exit(FAILED)


@app.command(
    epilog=f"Examples: {COMMAND} parameters scenarios/set_iib.json; "
    f"{COMMAND} parameters scenarios/set_iib.json --ssv > barrier.ssv"
)
def parameters(
    scenario: Annotated[Path, typer.Argument(help="Scenario file or run folder of the simulator.")],
    variant: Annotated[
        str, typer.Option(help="Of what --ssv prints: paper or calibrated. The others print both.")
    ] = "calibrated",
    as_ssv: Annotated[bool, typer.Option("--ssv", help="Print an SSP parameter file (SSV).")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the values as JSON, SI units.")] = False,
) -> None:
    """Start values of the closed-form unit for a scenario: with the paper's λ and τ, and with fitted ones."""
    from analytic.cli.terminal import number, print_json, print_table
    from analytic.fitted import CALIBRATED
    from analytic.scene import read_scene

    from . import start_values
    from .system import as_xml, parameter_set
    from .units.barrier_sliding import INTERFACE

    if variant not in start_values.WAYS:
        _refuse(f"--variant = {variant} is not allowed; it must be one of {', '.join(start_values.WAYS)}.")
    if as_ssv and as_json:
        _refuse("--ssv and --json are two forms of one output; it must be one of them.")
    try:
        scene = read_scene(scenario)
        scene.impact()
        values = {start_values.PAPER: start_values.start_values(scene, start_values.PAPER)}
        notes = {way: start_values.notes(scene, way) for way in start_values.WAYS}
        try:
            values[CALIBRATED] = start_values.start_values(scene, CALIBRATED)
        except ValueError as error:  # the paper's numbers are there where the fit has no answer
            if as_ssv and variant == CALIBRATED:
                raise
            notes[CALIBRATED] = (*notes[start_values.PAPER], f"No calibrated values: {error}")
    except ValueError as error:  # of the scenario or the closed form: one sentence each
        _refuse(str(error))
    if as_ssv:
        typer.echo(as_xml(parameter_set(INTERFACE, values[variant])).decode())
        for note in notes[variant]:
            typer.echo(note, err=True)
    elif as_json:
        print_json({**values, "notes": notes})
    else:
        names = [v.name for v in INTERFACE.of("parameter") if any(v.name in chosen for chosen in values.values())]
        table = {v.name: v for v in INTERFACE.variables}
        rows = []
        for name in names:
            unit = table[name].unit.name if table[name].kind == "Real" else ""
            cells = [values[way].get(name, table[name].start) for way in values]
            shown = [str(cell).lower() if isinstance(cell, bool) else number(cell, 6) for cell in cells]
            rows.append([name, *shown, "" if unit == "1" else unit])
        print_table(f"Start values of BarrierSliding: {scene.title}", ["", *values, "unit"], rows, notes[variant])


@app.command(epilog=f"Example: {COMMAND} benchmark --page docs/cosimulation.md")
def benchmark(
    scenario: Annotated[
        Path | None, typer.Option(help="Scenario inside DebrisFlow.", show_default="scenarios/set_iib.json")
    ] = None,
    spacing: Annotated[float | None, typer.Option(help="Grid spacing [m].", show_default="the scenario's")] = None,
    until: Annotated[float | None, typer.Option(help="End time [s].", show_default="the scenario's")] = None,
    page: Annotated[
        Path | None,
        typer.Option(
            help="Markdown page to put the tables into, below its lines <!-- benchmark NAME -->.", show_default=False
        ),
    ] = None,
) -> None:
    """Measure what the units cost: a step of the closed form through fmpy, start and steps of the simulator's units.

    All are measured in one run and take turns, the plain simulation among them, so that other work on the machine
    changes the ratios little.
    """
    from fmpy.fmi1 import FMICallException

    from analytic.cli.terminal import print_table
    from warp_mpm import Scenario
    from warp_mpm.performance.benchmark import machine
    from warp_mpm.performance.table import put_into_page

    from . import archive, c_unit
    from .benchmark import closed_form_costs, simulator_costs

    chosen = scenario or archive.DEFAULT_SCENARIO
    _check_scenario(chosen)
    if page is not None and not (page.is_file() and "<!-- benchmark simulator -->" in page.read_text(encoding="utf-8")):
        _refuse(f"--page {page} must be a file with lines <!-- benchmark NAME --> and <!-- end -->.")

    def told(what: str) -> None:
        typer.echo(f"measuring: {what}", err=True)

    with tempfile.TemporaryDirectory(prefix="fmu_benchmark_") as temporary:
        folder = Path(temporary)
        try:
            simulated = with_options(Scenario.load(chosen), spacing=spacing, until=until)
            built: dict[str, list[Path]] = {"BarrierSliding": [], "DebrisFlow": []}
            for packed in archive.PYTHON_UNITS:
                if packed.name in built:
                    built[packed.name].append(archive.build_python_unit(packed, folder, scenario=chosen))
            for unit in c_unit.C_UNITS:
                if unit.base in built and c_unit.offered(unit, c_unit.host_platform()):
                    platforms = (c_unit.host_platform(),)
                    built[unit.base].append(c_unit.build_c_unit(unit, folder, platforms=platforms, scenario=chosen))
            tables = [
                closed_form_costs(built["BarrierSliding"], progress=told),
                simulator_costs(built["DebrisFlow"], simulated, end_time=simulated.output.end_time_s, progress=told),
            ]
            for table in tables:
                print_table(table.title, list(table.columns), [list(row) for row in table.rows])
            if page is not None:
                taken_on = machine()
                put_into_page(
                    page, tables, f"{taken_on['processor']}, Python {taken_on['python']}, {taken_on['taken']}"
                )
        except (archive.BuildError, FMICallException, ValueError) as error:  # the unit itself has said why
            _refuse(str(error))


def _build(
    names: list[str], out: Path, scenario: Path | None, platforms: tuple[str, ...] | None, *, by_name: bool
) -> None:
    from . import archive, c_unit

    simulated = None
    c_units = [unit for unit in c_unit.C_UNITS if unit.name in names]
    if platforms:  # what cannot be built is said before anything is
        if not by_name:
            c_units = [unit for unit in c_units if any(c_unit.offered(unit, one) for one in platforms)] or c_units
        for unit in c_units:
            c_unit.check_platforms(unit, platforms)
    # Units in C first: they are the ones that may lack what they need.
    for unit in sorted(c_units, key=lambda unit: unit.base == "DebrisFlow"):
        if unit.base == "DebrisFlow" and simulated is None:
            simulated = archive.simulated_reference(scenario)
        built = c_unit.build_c_unit(unit, out, platforms=platforms, scenario=scenario, simulated=simulated)
        _tell(built, f"for {', '.join(c_unit.platforms_of(built))}")
    if c_units and platforms is None and not c_unit.has_cross_compiler():
        typer.echo(c_unit.needs_cross_compiler("Building the units in C for other platforms"), err=True)
    for packed in archive.PYTHON_UNITS:
        if packed.name in names:
            if packed.name == "DebrisFlow" and simulated is None:
                simulated = archive.simulated_reference(scenario)
            _tell(archive.build_python_unit(packed, out, scenario=scenario, simulated=simulated))


def _prove(file: Path, content: list[object], as_json: bool) -> bool:
    from analytic.cli.terminal import print_table

    from .check import CheckError, check_archive

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
    from warp_mpm import Scenario

    from .cross_check import cross_check
    from .figure import cross_check_figure

    try:
        scenario = with_options(Scenario.load(file), spacing=spacing, until=until)
        found = cross_check(scenario, unit, device=device, on_progress=None if as_json else _Progress(scenario).show)
    except ValueError as error:  # of the scenario, the device, the closed form or the calibration: one sentence each
        _refuse(str(error))
    picture, written = out / f"{file.stem}.png", out / f"{file.stem}.md"
    table = _comparison(found)
    try:
        plots.save(cross_check_figure(found), picture)
        write_whole(written, _markdown(*table))
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

    from .cross_check import CURVES, FIGURES

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
        f"Calibrated on this run: s1max = {p['s1max']:.4g} m (λ = {p['s1max'] / p['flow_length']:.3g}), "
        f"τ = {p['rise_ratio']:.3g}."
        for p in fits
    ]
    notes += [
        f"{c.name.capitalize()}: κ = {c.parameters['vertical_load_ratio']:.3g}."
        for c in found.comparisons
        if c.name == "with vertical load"
    ]
    notes += [
        f"Variant calibrated, fitted to other simulations: λ = {c.parameters['geometry_change']:.3g}, "
        f"τ = {c.parameters['rise_ratio']:.3g}, κ = {c.parameters['vertical_load_ratio']:.3g}."
        for c in found.comparisons
        if c.name == "variant calibrated"
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
