"""Importers other than fmpy: libcosim, ecos, and a plain C program; each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import textwrap
from pathlib import Path
from typing import Any

import pytest

from fmu import c_unit

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
    return float(result.stdout)


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


@pytest.fixture(scope="module")
def c_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The C host of the documentation, compiled."""
    program = tmp_path_factory.mktemp("host") / "host"
    compiler = [sys.executable, "-m", "ziglang", "cc"] if c_unit.has_cross_compiler() else ["cc"]
    source = ROOT / "docs" / "cosimulation" / "host.c"
    result = run([*compiler, "-Wall", "-Werror", "-o", program, source, "-ldl"])
    assert result.returncode == 0, result.stderr
    return program


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
