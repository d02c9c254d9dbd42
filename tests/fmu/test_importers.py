"""Importers other than fmpy: libcosim, ecos, and a plain C program; each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FINAL_DISPLACEMENT = 1.36484471  # of the unit's start values, Fig. 9 with lambda = 0.41 and tau = 0.35
BOTH = pytest.mark.parametrize("unit", ["BarrierSliding", "BarrierSlidingC"])

LIBCOSIM = """
    import sys
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave
    log_output_level(CosimLogLevel.ERROR)
    path, step, end, output, *settings = sys.argv[1:]
    execution = CosimExecution.from_step_size(step_size=int(float(step) * 1e9))
    index = execution.add_local_slave(CosimLocalSlave(path, "unit"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
    for setting in settings:
        name, value = setting.split("=")
        execution.real_initial_value(index, references[name], float(value))
    assert execution.simulate_until(int(float(end) * 1e9))
    print(observer.last_real_values(index, [references[output]])[0])
"""

ECOS = """
    import ctypes, sys
    from pathlib import Path
    # ecos does not bring the thread library that it needs; PyPI's tbb puts it beside the interpreter.
    ctypes.CDLL(str(next(Path(sys.prefix, "lib").glob("libtbb.so.*"))), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure
    path, step, end, output, *settings = sys.argv[1:]
    EcosLib.set_log_level("err")
    structure = EcosSimulationStructure()
    structure.add_model("unit", path)
    structure.add_parameter_set("settings", {"unit::" + s.split("=")[0]: float(s.split("=")[1]) for s in settings})
    simulation = EcosSimulation(float(step), structure=structure)
    simulation.init(0.0, "settings")
    simulation.step(round(float(end) / float(step)))
    print(simulation.get_real("unit::" + output))
    simulation.terminate()
    simulation.free()
"""


def run(command: list[Any], **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in command],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def run_importer(code: str, archive: Path, *arguments: Any) -> float:
    result = run([sys.executable, "-c", textwrap.dedent(code), archive, *arguments])
    assert result.returncode == 0, result.stdout + result.stderr
    return float(result.stdout.splitlines()[-1])


@pytest.mark.skipif(sys.platform != "linux", reason="the importers' libraries are used as Linux has them")
@pytest.mark.parametrize("importer", [LIBCOSIM, ECOS], ids=["libcosim", "ecos"])
class TestOtherImporters:
    @BOTH
    def test_barrier_slides_as_far(self, importer: str, unit: str, archives: dict[str, Path]) -> None:
        found = run_importer(importer, archives[unit], 0.1, 4.0, "barrier_displacement")
        assert found == pytest.approx(FINAL_DISPLACEMENT, rel=1e-8)
        faster = run_importer(importer, archives[unit], 0.1, 4.0, "peak_force", "speed=20")
        assert faster == pytest.approx(4 * 493902.439, rel=1e-8)

    def test_simulator_runs(self, importer: str, archives: dict[str, Path]) -> None:
        arguments = (0.05, 0.4, "barrier_displacement", "spacing=1")
        found = run_importer(importer, archives["DebrisFlow"], *arguments)
        assert 0.05 < found < 0.5

    @BOTH
    def test_bad_parameter_is_no_silent_result(self, importer: str, unit: str, archives: dict[str, Path]) -> None:
        """libcosim ends its process with the message, ecos goes on: then there must be no numbers."""
        command = [
            sys.executable,
            "-c",
            textwrap.dedent(importer),
            archives[unit],
            0.1,
            1.0,
            "impact_force",
            "speed=-3",
        ]
        result = run(command)
        if result.returncode == 0:
            assert result.stdout.strip() == "nan"
        else:
            assert "speed is -3 m/s, it must be a finite number in (0, inf) m/s" in result.stderr + result.stdout
        assert result.returncode != -11, "segmentation fault"


@pytest.mark.skipif(sys.platform != "linux", reason="the importer's library is used as Linux has it")
def test_ecos_takes_fmi_3(archives: dict[str, Path]) -> None:
    """libcosim knows none of that version."""
    found = run_importer(ECOS, archives["BarrierSlidingC3"], 0.1, 4.0, "barrier_displacement")
    assert found == pytest.approx(FINAL_DISPLACEMENT, rel=1e-8)
    command = [
        sys.executable,
        "-c",
        textwrap.dedent(ECOS),
        archives["BarrierSlidingC3"],
        0.1,
        1.0,
        "impact_force",
        "speed=-3",
    ]
    assert run(command).stdout.splitlines()[-1] == "nan"


@pytest.fixture
def c_host(c_program: Callable[[Path], Path]) -> Path:
    """The C host of the documentation, compiled."""
    return c_program(ROOT / "docs" / "cosimulation" / "host.c")


@pytest.mark.skipif(sys.platform != "linux", reason="the host of the documentation is written for Linux")
class TestPlainCHost:
    def test_c_unit_needs_no_python(self, c_host: Path, unzipped: dict[str, Path]) -> None:
        result = run([c_host, unzipped["BarrierSlidingC"], "barrier_displacement", 0.01, 4.0], PATH="/nowhere")
        assert result.returncode == 0, result.stderr
        assert float(result.stdout) == pytest.approx(FINAL_DISPLACEMENT, rel=1e-8)

    def test_c_unit_works_from_any_folder(self, c_host: Path, unzipped: dict[str, Path], tmp_path: Path) -> None:
        """The Python wrapper crashes the host where a folder's name needs percent-encoding; the C unit must not."""
        folder = tmp_path / "Größe #1 + 100% (x) & y"
        folder.symlink_to(unzipped["BarrierSlidingC"])
        result = run([c_host, folder, "barrier_displacement", 0.01, 4.0])
        assert float(result.stdout) == pytest.approx(FINAL_DISPLACEMENT, rel=1e-8)

    def test_bad_parameter_of_the_c_unit_is_an_error(self, c_host: Path, unzipped: dict[str, Path]) -> None:
        result = run([c_host, unzipped["BarrierSlidingC"], "impact_force", 0.01, 4.0, "rise_ratio=1.5"])
        assert result.returncode == 1
        assert "status 3: rise_ratio is 1.5, it must be a finite number in (0, 1]." in result.stderr
        assert "fmi2ExitInitializationMode returned status 3." in result.stderr

    @pytest.mark.parametrize("unit", ["BarrierSliding", "DebrisFlow"])
    def test_python_units_run_with_a_preloaded_python(self, unit: str, c_host: Path, unzipped: dict[str, Path]) -> None:
        library = Path(sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME") or "none")
        if not library.is_file():
            pytest.skip("this Python is not built as a shared library, so no C host can load it")
        arguments = ["barrier_displacement", 0.01, 4.0] if unit == "BarrierSliding" else [
            "barrier_displacement", 0.05, 0.4, "spacing=1"
        ]  # fmt: skip
        home = {"PYTHONHOME": sys.base_prefix, "LD_PRELOAD": str(library)}
        result = run([c_host, unzipped[unit], *arguments], **home)
        assert result.returncode == 0, result.stderr
        if unit == "BarrierSliding":
            assert float(result.stdout) == pytest.approx(FINAL_DISPLACEMENT, rel=1e-8)
        else:
            assert 0.05 < float(result.stdout) < 0.5

    def test_python_unit_without_a_python_is_a_clear_error(self, c_host: Path, unzipped: dict[str, Path]) -> None:
        result = run([c_host, unzipped["BarrierSliding"], "impact_force", 0.01, 1.0])
        assert result.returncode == 1
        assert "undefined symbol" in result.stderr


TWO_UNITS = """
#include <stdio.h>
#include "fmi2Functions.h"

#define UNIT(NAME) \\
    fmi2Component NAME##_fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *, \\
                                         fmi2Boolean, fmi2Boolean); \\
    fmi2Status NAME##_fmi2EnterInitializationMode(fmi2Component); \\
    fmi2Status NAME##_fmi2ExitInitializationMode(fmi2Component); \\
    fmi2Status NAME##_fmi2DoStep(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean); \\
    fmi2Status NAME##_fmi2GetReal(fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]); \\
    fmi2Status NAME##_fmi2SetReal(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Real[]); \\
    void NAME##_fmi2FreeInstance(fmi2Component);
UNIT(BarrierSlidingC)
UNIT(GroundAnchorC)

int main(int count, char *arguments[]) {
    (void)count;
    fmi2Component barrier = BarrierSlidingC_fmi2Instantiate("b", fmi2CoSimulation, arguments[1], "", NULL, 0, 0);
    fmi2Component anchor = GroundAnchorC_fmi2Instantiate("a", fmi2CoSimulation, arguments[2], "", NULL, 0, 0);
    if (!barrier || !anchor) return 1;
    BarrierSlidingC_fmi2EnterInitializationMode(barrier), BarrierSlidingC_fmi2ExitInitializationMode(barrier);
    GroundAnchorC_fmi2EnterInitializationMode(anchor), GroundAnchorC_fmi2ExitInitializationMode(anchor);
    const fmi2ValueReference displacement = DISPLACEMENT, external = EXTERNAL, moved = MOVED, force = FORCE;
    double value;
    for (int step = 0; step < 400; step++) {
        if (BarrierSlidingC_fmi2DoStep(barrier, step * 0.01, 0.01, 1)) return 2;
        BarrierSlidingC_fmi2GetReal(barrier, &displacement, 1, &value);
        GroundAnchorC_fmi2SetReal(anchor, &moved, 1, &value);
        if (GroundAnchorC_fmi2DoStep(anchor, step * 0.01, 0.01, 1)) return 3;
        GroundAnchorC_fmi2GetReal(anchor, &force, 1, &value);
        BarrierSlidingC_fmi2SetReal(barrier, &external, 1, &value);
    }
    BarrierSlidingC_fmi2GetReal(barrier, &displacement, 1, &value);
    printf("%.17g", value);
    BarrierSlidingC_fmi2FreeInstance(barrier), GroundAnchorC_fmi2FreeInstance(anchor);
    return 0;
}
"""


@pytest.mark.skipif(sys.platform != "linux", reason="compiles as Linux does")
def test_two_units_in_one_program(
    c_compiler: list[str], unzipped: dict[str, Path], open_unit: Callable[[str], Any], tmp_path: Path
) -> None:
    """Linked statically from the archives' sources, with a prefix each, and coupled: as their shared libraries do."""
    from fmpy import read_model_description

    barrier, anchor = open_unit("BarrierSlidingC").initialize(), open_unit("GroundAnchorC").initialize()
    for _ in range(400):
        anchor["barrier_displacement"] = barrier.run(0.01)["barrier_displacement"]
        barrier["external_force"] = anchor.run(0.01)["force"]
    objects, guids = [], []
    for name in ("BarrierSlidingC", "GroundAnchorC"):
        sources, made = unzipped[name] / "sources", tmp_path / f"{name}.o"
        flags = ["-std=c99", "-O2", "-ffp-contract=off", f"-DFMI2_FUNCTION_PREFIX={name}_", "-I", sources]
        done = run([*c_compiler, "-c", *flags, "-o", made, sources / "fmi2.c"])
        assert done.returncode == 0, done.stderr
        objects.append(made)
        guids.append(read_model_description(str(unzipped[name])).guid)
    references = {
        "DISPLACEMENT": barrier.variables["barrier_displacement"],
        "EXTERNAL": barrier.variables["external_force"],
        "MOVED": anchor.variables["barrier_displacement"],
        "FORCE": anchor.variables["force"],
    }
    source, program = tmp_path / "two.c", tmp_path / "two"
    source.write_text(TWO_UNITS)
    macros = [f"-D{name}={variable.valueReference}" for name, variable in references.items()]
    include = ["-I", unzipped["BarrierSlidingC"] / "sources"]
    done = run([*c_compiler, *macros, *include, "-o", program, source, *objects, "-lm"])
    assert done.returncode == 0, done.stderr
    done = run([program, *guids])
    assert done.returncode == 0, done.returncode
    # The program counts its steps, the importer adds them up.
    assert float(done.stdout) == pytest.approx(barrier["barrier_displacement"], rel=1e-12)
