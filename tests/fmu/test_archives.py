"""What every archive must be: valid, complete, reproducible, and alone in its host."""

from __future__ import annotations

import ast
import csv
import io
import json
import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from fmu import archive, c_unit
from fmu.check import check_archive
from warp_mpm import Scenario

C_NAMES = [unit.name for unit in c_unit.C_UNITS]
NAMES = [*(unit.name for unit in archive.PYTHON_UNITS), *C_NAMES]
TUNABLE = ("base_friction", "stiffness", "yield_force")
EACH = pytest.mark.parametrize("name", NAMES)
EACH_PYTHON = pytest.mark.parametrize("unit", archive.PYTHON_UNITS, ids=lambda unit: unit.name)


def run_python(code: str, *arguments: Any, expect: int = 0) -> str:
    """Run a host of its own, so that a crash is a result and not the end of the tests; return its output."""
    result = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert result.returncode == expect, result.stdout + result.stderr
    return result.stdout


@EACH
def test_checker_has_nothing_to_report(name: str, archives: dict[str, Path]) -> None:
    assert validate_fmu(str(archives[name])) == []


@EACH
def test_every_variable_is_described_in_full(name: str, archives: dict[str, Path]) -> None:
    description = read_model_description(str(archives[name]))
    units = {unit.name: unit for unit in description.unitDefinitions}
    assert description.version
    assert description.license == "Apache-2.0"
    assert description.author
    assert float(description.defaultExperiment.stepSize) > 0
    assert float(description.defaultExperiment.stopTime) > 0
    outputs = set()
    for variable in description.modelVariables:
        assert len(variable.description) > 10, variable.name
        assert variable.description[0].isupper(), variable.name
        if variable.causality == "output":
            outputs.add(variable.name)
            assert variable.initial == "calculated"
            assert variable.start is None
        elif variable.causality != "independent":
            assert variable.start is not None, variable.name
        if variable.type in ("Real", "Float64") and variable.causality != "independent":
            assert units[variable.unit].baseUnit is not None, variable.name
            assert variable.nominal is not None
            assert float(variable.nominal) > 0
            low = float(variable.min) if variable.min is not None else float("-inf")
            high = float(variable.max) if variable.max is not None else float("inf")
            if variable.start is not None:
                assert low <= float(variable.start) <= high
            if variable.causality == "input":
                assert low > float("-inf"), variable.name
                assert high < float("inf"), variable.name
            if variable.unit == "N/m":
                assert variable.displayUnit == "kN/m"
                assert units["N/m"].displayUnits[0].factor == pytest.approx(1e-3)
        if variable.causality == "parameter":
            assert (variable.variability == "tunable") is (variable.name in TUNABLE)
    assert {unknown.variable.name for unknown in description.outputs} == outputs
    assert {unknown.variable.name for unknown in description.initialUnknowns} == outputs
    known = {v.name for v in description.modelVariables if v.causality not in ("output", "independent")}
    for unknown in description.initialUnknowns:
        assert {v.name for v in unknown.dependencies} == known


@EACH
def test_no_minimum_is_a_refused_number(name: str, archives: dict[str, Path]) -> None:
    """The standard's min is a number that is allowed."""
    from fmu.units import barrier_sliding, debris_flow, ground_anchor

    tables = (barrier_sliding.INTERFACE, debris_flow.INTERFACE, ground_anchor.INTERFACE)
    known = {v.name: v for table in tables for v in table.variables}
    bounded = [v for v in read_model_description(str(archives[name])).modelVariables if v.min not in (None, "")]
    assert bounded
    for variable in bounded:
        if variable.type in ("Real", "Float64"):
            assert known[variable.name].fault(float(variable.min)) is None, variable.name


@EACH
def test_state_flags_are_claimed(name: str, archives: dict[str, Path]) -> None:
    co_simulation = read_model_description(str(archives[name])).coSimulation
    assert co_simulation.canGetAndSetFMUstate
    assert co_simulation.canSerializeFMUstate
    assert co_simulation.canHandleVariableCommunicationStepSize
    assert not co_simulation.canBeInstantiatedOnlyOncePerProcess
    assert co_simulation.needsExecutionTool is (name not in C_NAMES or name.startswith("DebrisFlow"))


@EACH
def test_elements_stand_in_the_standard_order(name: str, archives: dict[str, Path]) -> None:
    with zipfile.ZipFile(archives[name]) as file:
        root = ElementTree.fromstring(file.read("modelDescription.xml"))
    order = [
        "CoSimulation",
        "UnitDefinitions",
        "TypeDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "ModelVariables",
        "ModelStructure",
    ]
    found = [element.tag for element in root]
    assert found == [tag for tag in order if tag in found]
    assert root.get("generationDateAndTime", "").endswith("Z")


@EACH
def test_archive_holds_page_licence_and_icon(name: str, archives: dict[str, Path]) -> None:
    with zipfile.ZipFile(archives[name]) as file:
        page = file.read("documentation/index.html").decode()
        icon = "terminalsAndIcons/icon.png" if name.endswith("C3") else "model.png"
        assert file.read(icon).startswith(b"\x89PNG")
        assert b"Apache License" in file.read("documentation/licenses/license.txt")
        names = file.namelist()
        assert (f"<code>{name}C3</code> (FMI 3.0) are the same model in plain C" in page) == (name not in C_NAMES)
        assert names[0] == "modelDescription.xml"
        assert not [n for n in names if "__pycache__" in n or n.endswith(".pyc")]
    for variable in read_model_description(str(archives[name])).modelVariables:
        assert variable.causality == "independent" or f"<code>{variable.name}</code>" in page


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("DebrisFlow")])
def test_reference_results_are_reproduced(name: str, archives: dict[str, Path]) -> None:
    """The archive's own CSV files, run through an importer as the cross-check rules ask."""
    with zipfile.ZipFile(archives[name]) as file:
        given = _table(file.read(f"documentation/{name}_in.csv").decode())
        expected = _table(file.read(f"documentation/{name}_ref.csv").decode())
        options = dict(line.split(", ") for line in file.read(f"documentation/{name}_ref.opt").decode().splitlines())
    import numpy as np

    inputs = np.array([tuple(row) for row in given[1]], dtype=[(column, float) for column in given[0]])
    found = simulate_fmu(
        str(archives[name]),
        start_time=float(options["StartTime"]),
        stop_time=float(options["StopTime"]),
        output_interval=float(options["StepSize"]),
        input=inputs,
        use_event_mode=False,
    )
    assert len(found) == len(expected[1])
    # fmpy interpolates the inputs at the start of each step, which is where the file's rows stand.
    for number, column in enumerate(expected[0]):
        values = np.array([row[number] for row in expected[1]])
        assert np.allclose(found[column], values, rtol=1e-9, atol=1e-9 * max(1e-9, float(np.abs(values).max()))), column


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("BarrierSliding")])
def test_reference_results_of_every_way_to_drive_a_unit(name: str, archives: dict[str, Path], tmp_path: Path) -> None:
    """The closed form, and a force from outside; results that were changed are told."""
    (result,) = (r for r in check_archive(archives[name]) if r.name == "reference results")
    assert result.passed, result.detail
    assert result.detail.endswith(", driven in 2 ways")
    with zipfile.ZipFile(archives[name]) as file:
        entries = {entry: file.read(entry) for entry in file.namelist()}
    assert entries[f"documentation/{name}_force_input_start.csv"] == b'"impact_force_source"\n2\n'
    lines = entries[f"documentation/{name}_force_input_ref.csv"].splitlines()
    entries[f"documentation/{name}_force_input_ref.csv"] = b"\n".join(
        [*lines[:-1], lines[-1].replace(b"4.0,", b"4.0,9", 1)]
    )
    changed = archive.write_archive(tmp_path / archives[name].name, entries)
    (result,) = (r for r in check_archive(changed) if r.name == "reference results")
    assert not result.passed
    assert f"the reference results {name}_force_input are missed by" in result.detail


def _table(text: str) -> tuple[list[str], list[list[float]]]:
    rows = list(csv.reader(io.StringIO(text)))
    return rows[0], [[float(cell) for cell in row] for row in rows[1:]]


@pytest.mark.slow  # six workers; test_debris_flow.py: the numbers of the plain simulation
def test_reference_of_the_simulator_is_reproduced(tmp_path: Path) -> None:
    """With a coarse scenario inside, in all ways to drive it; bit for bit on one machine."""
    scenario = json.loads(archive.DEFAULT_SCENARIO.read_text())
    scenario["numerics"]["spacing_m"], scenario["output"]["end_time_s"] = 1.0, 1.5
    path = tmp_path / "coarse.json"
    path.write_text(json.dumps(scenario))
    (unit,) = (unit for unit in archive.PYTHON_UNITS if unit.name == "DebrisFlow")
    simulated = archive.simulated_reference(path)
    built = [archive.build_python_unit(unit, tmp_path / str(i), scenario=path, simulated=simulated) for i in range(2)]
    assert built[0].read_bytes() == built[1].read_bytes()
    (result,) = (r for r in check_archive(built[0]) if r.name == "reference results")
    assert result.passed, result.detail
    # The unit's own tolerance is for other machines; here only the rounding of the importer's times is left.
    assert float(result.detail.removeprefix("reproduced to ").removesuffix(", driven in 3 ways")) < 1e-9
    final = {}
    for way in ("", "_external_force", "_driven"):
        names, *rows = simulated[f"DebrisFlow{way}_ref.csv"].decode().splitlines()
        final[way] = dict(zip(names.split(","), rows[-1].split(","), strict=True))
    moved = {way: float(values['"barrier_displacement"']) for way, values in final.items()}
    assert moved["_external_force"] < moved[""]
    # Driven: 4 m/s2 from 0.3 s on in steps of 0.05 s, then 2 m/s for 0.2 s.
    assert moved["_driven"] == pytest.approx(0.05 * sum(4.0 * 0.05 * n for n in range(10)) + 2.0 * 0.2)


def test_tables_beside_a_scenario_come_along(tmp_path: Path) -> None:
    """A scene whose ground and inflow are files beside it runs from either archive."""
    path = archive.DEFAULT_SCENARIO.parent / "site_channel.json"
    for unit in ("DebrisFlow", "DebrisFlowC"):
        if unit.endswith("C"):
            (chosen,) = (each for each in c_unit.C_UNITS if each.name == unit)
            built = c_unit.build_c_unit(chosen, tmp_path, platforms=(c_unit.host_platform(),), scenario=path)
        else:
            built = archive.build_python_unit(archive.PYTHON_UNITS[-1], tmp_path, scenario=path)
        with zipfile.ZipFile(built) as file:
            inside = Scenario.model_validate(json.loads(file.read("resources/scenario.json")))
        assert inside.resolved() == Scenario.load(path).resolved()


@EACH_PYTHON
def test_only_the_standard_library_is_imported(unit: archive.PythonUnit, archives: dict[str, Path]) -> None:
    with zipfile.ZipFile(archives[unit.name]) as file:
        sources = {n: file.read(n).decode() for n in file.namelist() if n.endswith(".py")}
    assert sources
    own = {Path(n).parts[1] for n in sources if len(Path(n).parts) > 2}
    for name, text in sources.items():
        for node in ast.walk(ast.parse(text)):
            modules = []
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules = [node.module or ""]
            for module in modules:
                top = module.split(".")[0]
                assert top in sys.stdlib_module_names or top in own, f"{name} imports {module}"


@EACH_PYTHON
def test_names_carry_version_and_content(unit: archive.PythonUnit, archives: dict[str, Path]) -> None:
    """Modules of one name from two archives would be one module in a host: the first one's."""
    with zipfile.ZipFile(archives[unit.name]) as file:
        resources = {Path(n).parts[1] for n in file.namelist() if n.startswith("resources/")}
        version = read_model_description(str(archives[unit.name])).version
    stamp = version.replace(".", "_").replace("+", "_")
    modules = {name for name in resources if name.endswith(".py") or "." not in name}
    assert len(modules) == 2
    assert all(stamp in name for name in modules)


def test_two_versions_in_one_process_keep_their_own_code(archives: dict[str, Path], tmp_path: Path) -> None:
    unit = archive.PYTHON_UNITS[0]
    other = archive.build_python_unit(unit, tmp_path, version="99.0.0")
    code = """
        import sys
        from fmpy import simulate_fmu
        for path in sys.argv[1:]:
            simulate_fmu(path, stop_time=0.1)
        classes = [m.BarrierSliding.version for n, m in sorted(sys.modules.items()) if n.startswith("barrier_sliding_")]
        print(sorted(classes))
    """
    printed = run_python(code, archives[unit.name], other, archives[unit.name])
    assert "99.0.0+" in printed
    assert printed.count("+") == 2


def test_modules_of_the_host_do_not_shadow_the_archive(archives: dict[str, Path]) -> None:
    """A host that has other modules of our names, or another pythonfmu, loaded already."""
    code = """
        import sys, types
        for name in ("fmu", "analytic", "analytic.impact", "pythonfmu", "pythonfmu.fmi2slave", "slave", "impact"):
            sys.modules[name] = types.ModuleType(name)
        from fmpy import simulate_fmu
        result = simulate_fmu(sys.argv[1], stop_time=4.0)
        print(round(float(result["barrier_displacement"][-1]), 6))
    """
    assert run_python(code, archives["BarrierSliding"]).strip() == "1.364845"


def test_runs_without_site_packages_of_its_own(archives: dict[str, Path]) -> None:
    """Nothing of this project or its dependencies is imported from the host's site-packages."""
    code = """
        import sys
        from fmpy import simulate_fmu
        simulate_fmu(sys.argv[2], stop_time=0.1)  # what fmpy itself loads at its first simulation
        before = set(sys.modules)
        simulate_fmu(sys.argv[1], stop_time=0.1)
        tops = {name.split(".")[0] for name in set(sys.modules) - before}
        strangers = {t for t in tops if t not in sys.stdlib_module_names and "barrier_sliding" not in t}
        print(sorted(strangers))
    """
    assert run_python(code, archives["BarrierSliding"], archives["BarrierSlidingC"]).strip() == "[]"


def test_many_instances_over_a_long_session(archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """The wrapper releases the script's namespace at each instantiation: without our counterweight the second fails."""
    code = """
        import gc, sys
        from fmpy import read_model_description
        from fmpy.fmi2 import FMU2Slave
        path, folder = sys.argv[1:]
        description = read_model_description(path)
        alive = []
        for i in range(90):
            fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName=f"i{i}",
                            modelIdentifier=description.coSimulation.modelIdentifier)
            fmu.instantiate()
            fmu.setupExperiment()
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            fmu.doStep(0.0, 0.5)
            alive.append(fmu)
            if i % 3:
                old = alive.pop(0)
                old.terminate()
                old.fmi2FreeInstance(old.component)
        gc.collect()
        print(len(alive))
    """
    printed = run_python(code, archives["BarrierSliding"], unzipped["BarrierSliding"])
    assert printed.strip() == "30"


def test_exception_does_not_crash_the_host(archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """The wrapper drops references that it does not own after an exception, here again and again, at every call that
    can fail, with other instances alive and freed afterwards."""
    code = """
        import gc, math, sys
        from fmpy import read_model_description
        from fmpy.fmi2 import FMU2Slave
        path, folder = sys.argv[1:]
        description = read_model_description(path)
        variables = {v.name: v.valueReference for v in description.modelVariables}
        def instance(name):
            fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName=name,
                            modelIdentifier=description.coSimulation.modelIdentifier)
            fmu.instantiate()
            fmu.setupExperiment()
            return fmu
        def refused(call, *arguments):
            try:
                call(*arguments)
            except Exception:
                return
            raise SystemExit(f"{call} went through")
        bystander = instance("bystander")
        bystander.enterInitializationMode()
        bystander.exitInitializationMode()
        for i in range(20):
            fmu = instance(f"i{i}")
            fmu.setReal([variables["speed"]], [-1.0])
            fmu.enterInitializationMode()
            refused(fmu.exitInitializationMode)
            refused(fmu.setReal, [variables["impact_force"]], [1.0])
            refused(fmu.setReal, [variables["variant"]], [1.0])
            refused(fmu.getReal, [variables["variant"]])
            refused(fmu.getReal, [10_000])
            fmu.reset()
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            fmu.setReal([variables["external_force"]], [math.nan])
            refused(fmu.doStep, 0.0, 0.1)
            fmu.fmi2FreeInstance(fmu.component)
            gc.collect()
        bystander.doStep(0.0, 0.5)
        print(bystander.getReal([variables["barrier_displacement"]])[0])
        bystander.terminate()
        bystander.fmi2FreeInstance(bystander.component)
    """
    printed = run_python(code, archives["BarrierSliding"], unzipped["BarrierSliding"])
    assert float(printed) == pytest.approx(0.0221634585)


def test_instances_in_several_threads(archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """Importers step units from threads of their own, several at once."""
    code = """
        import sys, threading
        from fmpy import read_model_description
        from fmpy.fmi2 import FMU2Slave
        path, folder = sys.argv[1:]
        description = read_model_description(path)
        (reference,) = (v.valueReference for v in description.modelVariables if v.name == "barrier_displacement")
        found = []
        def run(number):
            fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName=f"i{number}",
                            modelIdentifier=description.coSimulation.modelIdentifier)
            fmu.instantiate()
            fmu.setupExperiment()
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            for step in range(400):
                fmu.doStep(step * 0.01, 0.01)
            found.append(fmu.getReal([reference])[0])
            fmu.terminate()
            fmu.fmi2FreeInstance(fmu.component)
        threads = [threading.Thread(target=run, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        print(len(found), len(set(found)), round(found[0], 6))
    """
    printed = run_python(code, archives["BarrierSliding"], unzipped["BarrierSliding"])
    assert printed.split() == ["4", "1", "1.364845"]


def test_folder_may_have_a_space(archives: dict[str, Path], unzipped: dict[str, Path], tmp_path: Path) -> None:
    """The one encoded character that the wrapper decodes; the others crash it, which the documentation says."""
    folder = tmp_path / "my units"
    folder.symlink_to(unzipped["BarrierSliding"])
    code = """
        import sys
        from fmpy import simulate_fmu
        print(round(float(simulate_fmu(sys.argv[1], stop_time=4.0)["barrier_displacement"][-1]), 6))
    """
    assert run_python(code, folder).strip() == "1.364845"


def test_nothing_is_printed_to_the_hosts_output(archives: dict[str, Path]) -> None:
    code = "import sys; from fmpy import simulate_fmu; [simulate_fmu(path, stop_time=0.1) for path in sys.argv[1:]]"
    assert run_python(code, archives["BarrierSliding"], archives["GroundAnchor"]) == ""


def test_faults_of_the_wrapper_are_mended(archives: dict[str, Path]) -> None:
    """At the host's exit the wrapper writes into memory that it has freed. Valgrind shows it, a crash is rare, so the
    one byte that prevents it is looked for. The others make an error of what was fatal: twenty functions, what they
    return and log. A new version of pythonfmu needs a new look at its wrapper."""
    import pythonfmu

    folder = Path(pythonfmu.__file__).parent / "resources" / "binaries" / "linux64"
    plain = (folder / "libpythonfmu-export.so").read_bytes()
    with zipfile.ZipFile(archives["BarrierSliding"]) as file:
        mended = file.read("binaries/linux64/BarrierSliding.so")
    assert len(mended) == len(plain)
    places = [place for place in range(len(plain)) if plain[place] != mended[place]]
    *statuses, exit_place = places
    assert plain[exit_place - 4 : exit_place] == b"\xf3\x0f\x1e\xfa"  # the marker at a function's entry
    assert mended[exit_place] == 0xC3  # return
    assert len(statuses) == 2 * 20
    assert {(plain[place], mended[place]) for place in statuses} == {(4, 3)}
    assert {plain[place - 1] for place in statuses} == {0xB8, 0xBE}  # into the registers of a result, of an argument


def test_freed_instance_is_gone_at_once(archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """Without the garbage collector, and although fmi2Terminate was not called: a unit must not hold a worker."""
    code = """
        import gc, sys, weakref
        gc.disable()
        from fmpy import read_model_description
        from fmpy.fmi2 import FMU2Slave
        path, folder = sys.argv[1:]
        description = read_model_description(path)
        fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName="i",
                        modelIdentifier=description.coSimulation.modelIdentifier)
        fmu.instantiate()
        fmu.setupExperiment()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        (module,) = (m for n, m in sys.modules.items() if n.startswith("barrier_sliding_"))
        (slave,) = (o for o in gc.get_objects() if type(o).__name__ == "BarrierSliding")
        watch = weakref.ref(slave)
        del slave
        fmu.fmi2FreeInstance(fmu.component)
        print(watch() is None)
    """
    assert run_python(code, archives["BarrierSliding"], unzipped["BarrierSliding"]).strip() == "True"
