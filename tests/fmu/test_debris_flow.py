"""The simulator as a unit: the same numbers as without the unit, and a worker that can fail without harm."""

from __future__ import annotations

import gc
import json
import math
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException

from fmu.units.debris_flow import DebrisFlowSlave
from fmu.units.worker_process import INTERPRETER_VARIABLE, WorkerProcess
from warp_mpm import Scenario, Simulation

Open = Callable[[str], Any]
ROOT = Path(__file__).parents[2]
COARSE = 0.75  # grid spacing [m]: a second of flow in a tenth of a second
QUICK = {"spacing": COARSE}
REPRODUCIBLE = ("impact_force_x", "impact_force_y", "top_force", "barrier_velocity", "barrier_displacement",
                "pore_pressure_max", "flow_kinetic_energy", "overtopped_volume")  # fmt: skip
posix_only = pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")


def workers() -> list[int]:
    """Process numbers of the workers that this process has; what no test holds any longer is let go first."""
    gc.collect()
    found = [item for item in gc.get_objects() if type(item).__name__ == "WorkerProcess"]
    return sorted(item.process_id for item in found if item.process_id)


def alive(process_id: int) -> bool:
    try:
        os.kill(process_id, 0)
    except OSError:
        return False
    return True


def wait_until_dead(process_id: int, limit: float = 5.0) -> None:
    end = time.monotonic() + limit
    while alive(process_id):
        assert time.monotonic() < end, f"process {process_id} is still there"
        time.sleep(0.02)


def failing_step(host: Any, size: float = 0.1) -> str:
    """Take a step that must fail as a discarded one; return the unit's message."""
    with pytest.raises(FMICallException) as caught:
        host.step(size)
    assert caught.value.status == 2
    outputs = host.outputs()
    message = outputs.pop("message")
    assert all(math.isnan(value) for value in outputs.values())
    return message.decode() if isinstance(message, bytes) else message


def plain_simulation(**changes: Any) -> Simulation:
    scenario = Scenario.load(ROOT / "scenarios" / "set_iib.json")
    return Simulation(scenario.replaced({"numerics.spacing_m": COARSE, **changes}))


def deposited(simulation: Simulation, where: Any) -> float:
    """Volume at the flow's initial density [m3/m] of the chosen material points."""
    material = simulation.scenario.flow.material
    grains = (1 - material.porosity) * material.grain_density_kg_per_m3
    return float(simulation.points()["solid_mass"][where].sum()) / grains


def test_unit_gives_the_numbers_of_the_plain_simulation(open_unit: Open) -> None:
    """Bit for bit, with steps of different sizes; the warm-up during initialization leaves no trace."""
    simulation = plain_simulation()
    host = open_unit("DebrisFlow").initialize(**QUICK)
    assert host["pore_pressure_max"] == simulation.sample()["pore_pressure_max"]
    for size in (0.1, 0.05, 0.2, 0.01, 1.0):
        host.run(size)
        simulation.advance(until=host.time)
        sample = simulation.sample()
        assert host["impact_force_x"] == sample["impact_force_x"]
        assert host["barrier_velocity"] == sample["barrier_velocity"]
        assert host["barrier_displacement"] == sample["barrier_displacement"]
        assert host["flow_kinetic_energy"] == sample["flow_kinetic_energy"]
        assert host["vertical_load"] == pytest.approx(
            -sample["impact_force_y"] - sample["top_force_y"] - sample["back_force_y"], abs=1e-9
        )
    assert host["impact_force_x"] > 1e5
    assert host["time_ratio"] > 0
    beyond = simulation.points()["position"][:, 0] > 7.5 + simulation.barrier_displacement
    assert host["overtopped_volume"] == pytest.approx(deposited(simulation, beyond), rel=1e-9)


def test_second_simulation_in_a_process(archives: dict[str, Path]) -> None:
    """fmpy removes the folder of the first one, in which the modules that Python remembers were found."""
    for _ in range(2):
        result = simulate_fmu(
            str(archives["DebrisFlow"]), stop_time=0.2, output_interval=0.1, start_values={"spacing": 1.0}
        )
        assert result["time"][-1] == pytest.approx(0.2)
        assert np.all(np.isfinite(result["impact_force_x"]))


def test_start_time_is_the_beginning_of_the_simulation(open_unit: Open) -> None:
    early, late = plain_simulation(), open_unit("DebrisFlow").initialize(8.0, **QUICK).run(0.25, 0.1)
    for time_then in (0.25, 0.35):
        early.advance(time_then)
    assert late["impact_force_x"] == pytest.approx(early.sample()["impact_force_x"], rel=1e-9)
    assert late["impact_force_x"] > 1e4


def test_rollback_is_bitwise(open_unit: Open) -> None:
    host = open_unit("DebrisFlow").initialize(**QUICK).run(0.3)
    host["external_force"] = -5e4
    host.run(0.1)
    state, time_then = host.fmu.getFMUstate(), host.time
    data = host.fmu.serializeFMUstate(state)

    def go_on(unit: Any) -> dict[str, Any]:
        unit.time = time_then
        unit.run(0.05, 0.1)
        return {name: unit[name] for name in REPRODUCIBLE}

    first = go_on(host)
    host.fmu.setFMUstate(state)
    assert go_on(host) == first
    other = open_unit("DebrisFlow").initialize(**QUICK)
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(data))
    assert go_on(other) == first
    host.again(**QUICK)  # the reset ended the worker that kept the state
    host.fmu.setFMUstate(state)
    assert go_on(host) == first
    host.fmu.freeFMUstate(state)


def test_states_are_released_in_the_worker(open_unit: Open) -> None:
    host = open_unit("DebrisFlow").initialize(**QUICK)
    states = [host.fmu.getFMUstate() for _ in range(3)]
    (worker,) = (o for o in gc.get_objects() if type(o).__name__ == "WorkerProcess" and o.process_id)
    kept = [o for o in gc.get_objects() if type(o).__name__ == "WorkerState" and o.worker is worker]
    keys = [state.key for state in kept]
    assert len(keys) == 3
    del kept
    for state in states:
        host.fmu.freeFMUstate(state)
    for key in keys:
        with pytest.raises(Exception, match="KeyError"):
            worker.ask("restore_state", 10.0, key=key)


def test_driven_barrier_follows_the_input(open_unit: Open) -> None:
    host = open_unit("DebrisFlow").initialize(barrier_motion=2, **QUICK).run(0.2)
    assert host["barrier_displacement"] == 0.0
    host["barrier_velocity_input"] = 2.0
    host.run(0.1)
    host["barrier_velocity_input"] = 1.0
    host.run(0.1)
    assert host["barrier_displacement"] == pytest.approx(0.3, abs=1e-9)
    assert host["barrier_velocity"] == 1.0
    assert host["barrier_force"] > 1e5


def test_external_force_moves_a_sliding_barrier(open_unit: Open) -> None:
    free, held = plain_simulation(), open_unit("DebrisFlow").initialize(external_force=-2e5, **QUICK).run(0.6)
    free.advance(0.6)
    assert held["barrier_displacement"] < 0.8 * free.barrier_displacement


def test_scenario_is_a_parameter(open_unit: Open, tmp_path: Path) -> None:
    path = tmp_path / "Größe #1 (x).json"
    path.write_text((ROOT / "scenarios" / "case_1_fixed.json").read_text())
    host = open_unit("DebrisFlow").initialize(scenario_file=str(path), **QUICK).run(1.0)
    assert host["impact_force_x"] > 1e4
    assert host["barrier_displacement"] == 0.0
    host["external_force"] = 1.0
    assert "external_force is 1 N/m" in failing_step(host)


def test_refused_step_can_be_taken_back(open_unit: Open) -> None:
    """A master that saved its state goes on after a step that the simulation refused; one is the velocity of a barrier
    that slides, which is no input of it."""
    host = open_unit("DebrisFlow").initialize(**QUICK).run(0.2)
    state, time_then = host.fmu.getFMUstate(), host.time
    for name, value, says in (
        ("external_force", 2e9, "external_force is 2e+09"),
        ("barrier_velocity_input", 1.0, "barrier_motion is 2 (driven)"),
    ):
        host[name] = value
        assert says in failing_step(host)
        host.fmu.setFMUstate(state)
        host.time = time_then
    assert host.run(0.1)["impact_force_x"] >= 0.0


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"scenario_file": "/nowhere/scene.json"}, "/nowhere/scene.json"),
        # A worker for each: `test_wrong_scenario_names_the_field` and test_cross_check.py stand for these two.
        pytest.param({"device": "cuda:77"}, "device = 'cuda:77'", marks=pytest.mark.slow),
        pytest.param({"spacing": 1e-7}, "spacing_m", marks=pytest.mark.slow),
        ({"spacing": -1.0}, "spacing is -1 m"),
        ({"reply_time_limit": 0.0}, "reply_time_limit is 0 s"),
        ({"barrier_motion": 3}, "1 (as_scenario), 2 (driven)"),
    ],
)
def test_bad_parameters_are_refused(
    values: dict[str, Any], says: str, open_unit: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    host = open_unit("DebrisFlow")
    with pytest.raises(FMICallException):
        host.initialize(**values)
    text = "".join(capfd.readouterr())
    assert says in text
    assert "Traceback" not in text
    assert workers() == []


def test_wrong_scenario_names_the_field(open_unit: Open, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scenario = json.loads((ROOT / "scenarios" / "case_1.json").read_text())
    scenario["flow"]["material"]["porosity"] = 1.5
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(scenario))
    with pytest.raises(FMICallException):
        open_unit("DebrisFlow").initialize(scenario_file=str(path))
    assert "porosity" in "".join(capfd.readouterr())


@posix_only
def test_dead_worker_is_reported(open_unit: Open) -> None:
    host = open_unit("DebrisFlow").initialize(**QUICK).run(0.1)
    (process_id,) = workers()
    os.kill(process_id, signal.SIGKILL)
    message = failing_step(host)
    assert "ended by signal 9" in message
    assert failing_step(host) == message  # and stays reported
    assert not alive(process_id)
    assert host.again(**QUICK).run(0.1)["flow_kinetic_energy"] > 0  # a reset starts a new one


@posix_only
def test_hanging_worker_is_ended(open_unit: Open) -> None:
    host = open_unit("DebrisFlow").initialize(reply_time_limit=20.0, **QUICK)
    (process_id,) = workers()
    os.kill(process_id, signal.SIGSTOP)
    (slave,) = (item for item in gc.get_objects() if type(item).__name__ == "DebrisFlow")
    slave["reply_time_limit"] = 0.3  # a start takes longer than this test wants to wait
    assert "did not answer the request 'step' within 0.3 s" in failing_step(host)
    assert not alive(process_id)


@posix_only
@pytest.mark.parametrize(
    "ending",
    # Others that terminate and reset count the workers, too.
    ["free", pytest.param("terminate", marks=pytest.mark.slow), pytest.param("reset", marks=pytest.mark.slow)],
)
def test_no_process_is_left(ending: str, host_class: Any, archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """Neither with a state that the importer forgot to free."""
    host = host_class(archives["DebrisFlow"], unzipped["DebrisFlow"]).initialize(**QUICK).run(0.1)
    host.fmu.getFMUstate()
    (process_id,) = workers()
    if ending == "terminate":
        host.fmu.terminate()
    elif ending == "reset":
        host.fmu.reset()
    else:
        host.fmu.fmi2FreeInstance(host.fmu.component)
    wait_until_dead(process_id)
    assert workers() == []
    if ending != "free":
        host.fmu.fmi2FreeInstance(host.fmu.component)


HOST = """
    import sys, time
    from fmpy import read_model_description
    from fmpy.fmi2 import FMU2Slave
    path, folder, spacing = sys.argv[1:]
    description = read_model_description(path)
    variables = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName="i",
                    modelIdentifier=description.coSimulation.modelIdentifier)
    fmu.instantiate()
    fmu.setupExperiment()
    fmu.setReal([variables["spacing"]], [float(spacing)])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    import gc
    (worker,) = (o for o in gc.get_objects() if type(o).__name__ == "WorkerProcess")
    print(worker.process_id, flush=True)
"""


@posix_only
@pytest.mark.parametrize("busy", [pytest.param(False, marks=pytest.mark.slow), True])
def test_worker_dies_with_its_host(busy: bool, archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """The host is killed while the worker waits, and in the middle of a long step."""
    code = textwrap.dedent(HOST) + ("fmu.doStep(0.0, 100.0)\n" if busy else "time.sleep(100)\n")
    arguments = [str(archives["DebrisFlow"]), str(unzipped["DebrisFlow"]), "0.2" if busy else str(COARSE)]
    with subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, text=True) as host:
        assert host.stdout is not None
        process_id = int(host.stdout.readline())
        time.sleep(0.3 if busy else 0.0)
        assert alive(process_id)
        host.kill()
    wait_until_dead(process_id)


def test_worker_is_safe_from_the_hosts_environment(
    archives: dict[str, Path], unzipped: dict[str, Path], tmp_path: Path
) -> None:
    """Packages of our names on the host's path and in its working folder, a PYTHONHOME that leads nowhere."""
    for package in ("warp_mpm", "fmu", "numpy"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("raise SystemExit('poisoned')\n")
    code = textwrap.dedent(HOST).replace(
        "fmu.enterInit",
        f"import os\nos.environ.update(PYTHONHOME='/nowhere', PYTHONPATH={str(tmp_path)!r})\n"
        f"os.chdir({str(tmp_path)!r})\nfmu.enterInit",
    )
    result = subprocess.run(
        [sys.executable, "-c", code, archives["DebrisFlow"], unzipped["DebrisFlow"], str(COARSE)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) > 0


@pytest.fixture
def resources(tmp_path: Path) -> Path:
    """The resources of an archive whose Python has gone."""
    (tmp_path / "worker.json").write_text(
        json.dumps({"interpreter": "/gone/python", "worker": "fmu.worker", "import_path": []})
    )
    return tmp_path


def test_missing_interpreter_is_named(resources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(INTERPRETER_VARIABLE, raising=False)
    with pytest.raises(Exception, match=f"no Python for the simulator at /gone/python: set {INTERPRETER_VARIABLE}"):
        WorkerProcess(str(resources))
    monkeypatch.setenv(INTERPRETER_VARIABLE, "/also/gone")
    with pytest.raises(Exception, match=f"{INTERPRETER_VARIABLE} is /also/gone, it must be the path"):
        WorkerProcess(str(resources))


def test_interpreter_without_the_project_is_reported(
    resources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A virtual environment that has nothing installed."""
    import venv

    venv.create(tmp_path / "empty", symlinks=os.name == "posix", with_pip=False)
    folder = "bin" if os.name == "posix" else "Scripts"
    monkeypatch.setenv(INTERPRETER_VARIABLE, str(tmp_path / "empty" / folder / "python"))
    with pytest.raises(
        Exception,
        match=r"The Python .*empty.* has no warp-mpm-impact \(No module named 'warp_mpm_fmu'\): install it there, or "
        f"set {INTERPRETER_VARIABLE}",
    ):
        WorkerProcess(str(resources))


def fake_worker(folder: Path, behaviour: str) -> str:
    """Resources of an archive whose worker does what the statements say before, or instead of, serving."""
    package = folder / "fake" / "fmu"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "worker.py").write_text(textwrap.dedent(behaviour))
    (folder / "worker.json").write_text(
        json.dumps({"interpreter": sys.executable, "worker": "fmu.worker", "import_path": [str(folder / "fake")]})
    )
    return str(folder)


_REAL_WORKER = f"""
        import sys
        sys.path.remove(sys.argv[2])
        sys.path.insert(0, {str(ROOT)!r})
        for name in [name for name in sys.modules if name.split(".")[0] == "fmu"]:
            del sys.modules[name]
        from fmu import worker
"""


def test_prints_do_not_get_between_the_answers(tmp_path: Path) -> None:
    resources = fake_worker(
        tmp_path,
        _REAL_WORKER
        + """
        import os

        def noisy(self):
            print("a banner")
            os.write(1, b"a line from C\\n")
            return {"fine": True}

        worker.Worker.sample = noisy
        main = worker.main
        """,
    )
    worker = WorkerProcess(resources)
    assert worker.ask("sample", 20.0) == {"fine": True}
    assert worker.ask("sample", 20.0) == {"fine": True}
    worker.close()


@pytest.mark.parametrize(
    ("poison", "says"),
    [
        ('self.simulation._point_arrays["velocity"].fill_(1e6)', "diverged at t ="),
        pytest.param('self.simulation._point_arrays["velocity"].fill_(nan)', "diverged at t =", marks=pytest.mark.slow),
        ('self.simulation.sample = lambda names: {"impact_force_x": nan}', "gave nan for impact_force_x"),
    ],
)
def test_failed_computation_is_reported(poison: str, says: str, tmp_path: Path) -> None:
    """Values out of all sense, put into the real simulation in its real worker."""
    resources = fake_worker(
        tmp_path,
        _REAL_WORKER
        + f"""
        from math import nan

        plain_step = worker.Worker.step

        def poisoned_step(self, **arguments):
            {poison}
            return plain_step(self, **arguments)

        worker.Worker.step = poisoned_step
        main = worker.main
        """,
    )
    slave = DebrisFlowSlave(instance_name="diverging", resources=resources)
    slave["scenario_file"], slave["spacing"] = str(ROOT / "scenarios" / "case_1.json"), COARSE
    slave.setup_experiment(0.0, None, None)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert slave["flow_kinetic_energy"] > 0.0
    assert not slave.do_step(0.0, 0.1)
    assert says in slave["message"]
    assert math.isnan(slave["impact_force_x"])
    assert not slave.do_step(0.1, 0.1)
    assert len(workers()) == 1
    slave.terminate()
    assert workers() == []


@pytest.mark.parametrize(
    ("behaviour", "says"),
    [
        ("def main(): print('hello')", "no answer to 'start'"),
        ("def main(): print('{\"protocol\": 99}')", "speaks version 99 of the protocol, this archive version"),
        ("def main(): raise SystemExit('out of memory.')", "ended with exit code 1 .*: out of memory"),
    ],
)
def test_strange_workers_are_reported(behaviour: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(Exception, match=says):
        WorkerProcess(fake_worker(tmp_path, behaviour))
    assert workers() == []


def test_instances_do_not_disturb_each_other(open_unit: Open) -> None:
    alone = plain_simulation()
    one, two = open_unit("DebrisFlow").initialize(**QUICK), open_unit("DebrisFlow").initialize(spacing=1.0)
    for _ in range(2):
        one.run(0.2)
        two.run(0.2)
        alone.advance(one.time)
    assert one["barrier_displacement"] == alone.barrier_displacement > 0.0
    assert two["barrier_displacement"] != alone.barrier_displacement


def test_overtopped_volume_is_the_same_whenever_asked_for(open_unit: Open) -> None:
    """Within each step for an importer that has asked before; `test_unit_gives_the_numbers_of_the_plain_simulation`
    asks for the first time afterwards."""
    host, simulation = open_unit("DebrisFlow").initialize(**QUICK), plain_simulation()
    assert host["overtopped_volume"] == 0.0
    host.run(1.0, 0.5)
    for time_then in (1.0, 1.5):
        simulation.advance(time_then)
    beyond = simulation.points()["position"][:, 0] > 7.5 + simulation.barrier_displacement
    assert host["overtopped_volume"] == pytest.approx(deposited(simulation, beyond), rel=1e-9)
    assert host["overtopped_volume"] > 0.0
