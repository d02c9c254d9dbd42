"""The co-simulation of the documentation: it must agree with the simulation that moves its barrier itself."""

from __future__ import annotations

import importlib.util
import json
import math
import shutil
import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from scipy.integrate import solve_ivp

from analytic.impact import Impact
from fmu import c_unit
from warp_mpm import Scenario, Simulation

ROOT = Path(__file__).parents[2]
SPACING = 0.75
ANCHOR = {"stiffness": 1e5, "yield_force": 150e3}


def documented(name: str) -> ModuleType:
    """A script of the documentation as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / "cosimulation" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


coupled = documented("coupled")
system = documented("system")


@pytest.fixture(scope="module")
def folder(archives: dict[str, Path]) -> Path:
    paths = [archives[name] for name in coupled.UNITS]
    return paths[0].parent


def monolithic(end: float, anchor: dict[str, float] | None = None) -> float:
    """Final displacement [m] of the simulation that moves its barrier itself.

    It stops at the communication points too, since that shortens its time steps; an anchor's force is renewed there.
    """
    scenario = Scenario.load(ROOT / "scenarios" / "set_iib.json").replaced({"numerics.spacing_m": SPACING})
    simulation = Simulation(scenario)
    for step in range(1, round(end / 0.01) + 1):
        if anchor:
            pull = min(anchor["stiffness"] * simulation.barrier_displacement, anchor["yield_force"])
            simulation.set_external_force(-pull)
        simulation.advance(until=step * 0.01)
    return simulation.barrier_displacement


def test_final_displacement_is_that_of_the_monolithic_run(folder: Path) -> None:
    """Within 2 % at a communication step of 10 ms; 0.1 % was measured."""
    rows = coupled.run_coupled(folder, step=0.01, end=6.0, spacing=SPACING)
    assert rows[-1].barrier_velocity == 0.0
    assert rows[-1].barrier_displacement == pytest.approx(monolithic(6.0), rel=0.02)


def test_anchor_holds_as_much_as_in_the_monolithic_run(folder: Path) -> None:
    rows = coupled.run_coupled(folder, step=0.01, end=2.0, spacing=SPACING, anchor=ANCHOR)
    assert rows[-1].anchor_force == -ANCHOR["yield_force"]
    assert rows[-1].barrier_displacement == pytest.approx(monolithic(2.0, ANCHOR), rel=0.01)
    assert rows[-1].barrier_displacement < 0.95 * monolithic(2.0)


@pytest.mark.slow  # by default the two above hold the error of the step that the documentation takes
def test_coupling_error_falls_with_the_step(folder: Path) -> None:
    """First order in the step, for a barrier so light that the coupling is what rules."""
    scenario = Scenario.load(ROOT / "scenarios" / "set_iib.json").replaced(
        {
            "numerics.spacing_m": SPACING,
            "barrier.motion": {"kind": "sliding", "mass_kg_per_m": 10000.0, "base_friction": 0.29},
        }
    )
    simulation = Simulation(scenario)
    simulation.advance(until=1.0)
    errors = []
    for step in (0.05, 0.01):
        rows = coupled.run_coupled(folder, step=step, end=1.0, spacing=SPACING, barrier_mass=10000.0)
        errors.append(abs(rows[-1].barrier_displacement / simulation.barrier_displacement - 1))
    assert errors[1] < 0.02
    assert errors[1] < errors[0] / 2.5  # first order: 5; chaos of the free surface takes its share


OWN_SCENE = {
    "numerics.spacing_m": 0.75,
    "gravity.tilt_deg": 8.0,
    "barrier.motion": {"kind": "sliding", "mass_kg_per_m": 150e3, "base_soil_friction_angle_deg": 30.0},
    "output.end_time_s": 1.5,
}


@pytest.fixture(scope="module")
def own(archives: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Scenario, Path]:
    """A scene of one's own: another barrier, on a slope; and the folder of units that were built for it."""
    folder = tmp_path_factory.mktemp("own")
    scenario = Scenario.load(ROOT / "scenarios" / "set_iib.json").replaced(OWN_SCENE)
    file = folder / "own.json"
    file.write_text(json.dumps(scenario.resolved()))
    (unit,) = [unit for unit in c_unit.C_UNITS if unit.name == "DebrisFlowC"]
    c_unit.build_c_unit(unit, folder, platforms=(c_unit.host_platform(),), scenario=file)
    for name in ("BarrierSlidingC", "GroundAnchorC"):
        shutil.copy(archives[name], folder)
    return scenario, folder


def test_the_coupled_barrier_is_that_of_the_scene(own: tuple[Scenario, Path]) -> None:
    """Its mass, base friction and slope, and the end of the run: nothing of Set IIb, for which the script was made."""
    scenario, folder = own
    rows = coupled.run_coupled(folder, step=0.01)
    simulation = Simulation(scenario)
    for step in range(1, 151):
        simulation.advance(until=step * 0.01)
    assert rows[-1].time == pytest.approx(1.5)
    assert simulation.barrier_displacement > 0.2
    assert rows[-1].barrier_displacement == pytest.approx(simulation.barrier_displacement, rel=0.01)


def test_the_packed_system_is_that_of_the_scene(own: tuple[Scenario, Path], tmp_path: Path) -> None:
    _, folder = own
    path = system.write_system(folder, tmp_path / "system.ssp", spacing=0.9)
    values = {one.name: float(one.value) for one in system.parameters(path).parameters}
    friction = 0.8 * math.tan(math.radians(30))
    assert values["barrier.barrier_mass"] == 150e3
    assert values["barrier.base_friction"] == pytest.approx(friction)
    assert values["barrier.gravity"] == 9.81
    assert values["barrier.slope"] == 8.0
    assert values["flow.spacing"] == 0.9
    with zipfile.ZipFile(path) as packed:
        assert 'stopTime="1.5"' in packed.read("SystemStructure.ssd").decode()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"barrier.motion": {"kind": "fixed"}}, "barrier.motion.kind is 'fixed', it must be 'sliding'"),
        ({"barrier": None}, "there is no barrier, it must be 'sliding'"),
        ({"gravity.tilt_deg": 25.0}, "base friction is 0.462, it must be greater than the slope's tangent, 0.466"),
    ],
)
def test_a_scene_without_a_barrier_that_slides_is_refused(
    own: tuple[Scenario, Path], changes: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        coupled.barrier_parameters(own[0].replaced(changes))


def test_ssp_archive_runs_with_every_master(folder: Path, tmp_path: Path) -> None:
    """fmpy's runner, libcosim and ecos against the master script with the same scheme and step."""
    path = system.write_system(folder, tmp_path / "system.ssp", spacing=1.0)
    expected = coupled.run_coupled(folder, step=0.02, end=1.0, spacing=1.0, scheme="jacobi", anchor=ANCHOR)
    from fmpy.ssp.simulation import simulate_ssp

    # fmpy adds up its steps and would take one more than fits but for rounding: it stops half a step early.
    result = simulate_ssp(str(path), stop_time=0.99, step_size=0.02, parameter_set=system.parameters(path))
    displacement = expected[-1].barrier_displacement
    assert result["barrier.barrier_displacement"][-1] == pytest.approx(displacement, rel=1e-6)
    for master in (LIBCOSIM, ECOS):
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(master), str(path)],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        # They pass the initial outputs on before the first step, which fmpy's runner and the script do not differ from.
        assert float(done.stdout) == pytest.approx(displacement, rel=1e-3), master


LIBCOSIM = """
    import sys
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(sys.argv[1], 20_000_000)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    index = execution.slave_index_from_instance_name("barrier")
    references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
    assert execution.simulate_until(1_000_000_000)
    print(observer.last_real_values(index, [references["barrier_displacement"]])[0])
"""

ECOS = """
    import ctypes, sys
    from pathlib import Path
    ctypes.CDLL(str(next(Path(sys.prefix, "lib").glob("libtbb.so.*"))), ctypes.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation
    EcosLib.set_log_level("err")
    simulation = EcosSimulation(0.02, ssp_path=sys.argv[1])
    simulation.init(0.0, "scene")
    simulation.step(50)
    print(simulation.get_real("barrier::barrier_displacement"))
    simulation.terminate()
    simulation.free()
"""


def test_ten_line_script_runs(folder: Path) -> None:
    """The first example of the documentation, as it stands there."""
    text = (ROOT / "docs" / "cosimulation.md").read_text(encoding="utf-8")
    script = text.split("```python\n")[1].split("```")[0]
    assert len(script.strip().splitlines()) <= 10
    done = subprocess.run(
        [sys.executable, "-c", script.replace("build/fmu", str(folder)).replace("plt.show()", "")],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={"MPLBACKEND": "Agg", "PATH": "/usr/bin:/bin"},
    )
    assert done.returncode == 0, done.stderr
    assert "1.36" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--step", "-1"], "--step: -1 is not allowed; it must be a finite number greater than 0."),
        (["--step", "nan"], "--step: nan is not allowed; it must be a finite number greater than 0."),
        (["--end", "soon"], "--end: soon is not allowed; it must be a finite number greater than 0."),
        (["--step", "7"], "--step: 7 is not allowed; it must be at most --end, 6."),
        (["--spacing", "-0.1"], "--spacing: -0.1 is not allowed; it must be a finite number at least 0."),
        (["--archives", "nowhere"], "--archives: nowhere must hold DebrisFlowC, BarrierSlidingC, GroundAnchorC; "),
    ],
)
def test_script_refuses_in_one_sentence(
    arguments: list[str],
    sentence: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["coupled.py", "--archives", str(folder), *arguments])
    with pytest.raises(SystemExit) as stop:
        coupled.main()
    assert stop.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(sentence)
    assert said.err.count("\n") == 1


def test_anchor_that_yields_beside_a_dashpot(folder: Path) -> None:
    """Against SciPy, which has the barrier, the spring that yields and the dashpot in one system of equations."""
    example = documented("damped_anchor")
    found = example.slide(folder, yield_force=50e3, damping=10e3)
    impact = Impact(flow_length=15.0, flow_height=3.0, geometry_change=0.41, rise_ratio=0.35, **example.BARRIER)
    friction = 0.29 * 81e3 * 9.81

    def motion(t: float, y: list[float]) -> list[float]:
        x, v, plastic = y
        tension = min(max(2e5 * (x - plastic), 0.0), 50e3)
        yields = 2e5 * (x - plastic) >= 50e3 and v > 0
        driving = impact.force(t) - tension - 10e3 * v
        held = v <= 0 and abs(driving) <= friction
        return [max(v, 0.0), 0.0 if held else (driving - friction) / 81e3, v if yields else 0.0]

    start, x, plastic = 0.0, 0.0, 0.0
    solved = solve_ivp(motion, (0.0, 4.0), [x, start, plastic], max_step=1e-3, rtol=1e-8)
    assert found["displacement"] == pytest.approx(solved.y[0].max(), rel=5e-3)  # first order in the step of 1 ms
    assert found["anchor_force"] == 50e3
    assert found["plastic_elongation"] == pytest.approx(found["displacement"] - 0.25, abs=1e-9)
    free = example.slide(folder, yield_force=0.0, damping=0.0, step=0.01)
    assert free["displacement"] == pytest.approx(1.36484471, rel=1e-8)


def test_gauge_warns_before_the_flow_arrives(folder: Path) -> None:
    """The front goes at 20 m/s from the gauge to the barrier: that is the time there is."""
    example = documented("warning_system")
    found = example.run(folder, threshold=0.5, gauge=-1.5, spacing=0.75)
    assert found.alarm == pytest.approx((3.0 - 1.5) / 20.0, abs=0.045)  # the gauge sees two spacings
    assert 0.08 < found.arrival < 0.25
    assert found.margin == pytest.approx(found.arrival - found.alarm - 0.07)
    never = example.run(folder, threshold=50.0, spacing=0.75)
    assert math.isinf(never.alarm)
    assert math.isinf(never.closed)
    assert never.arrival == found.arrival  # of the same flow, so that a gate that takes half a second is late
    assert example.Warned(found.alarm, found.alarm + 0.02 + 0.5, found.arrival).margin < 0.0


def test_energy_is_accounted_for(folder: Path) -> None:
    account = documented("energy_account").run(folder, spacing=SPACING, end=1.0)
    assert account.flow_work > 5e5
    assert min(account.barrier, account.base, account.anchor) > 0.01 * account.flow_work
    assert abs(account.left_over) < 1e-9 * account.flow_work
    assert account.flow_lost > account.flow_work
