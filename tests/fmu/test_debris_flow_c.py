"""The simulator's unit in C: the numbers of the one in Python, no Python in the host, and a worker that can fail."""

from __future__ import annotations

import contextlib
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

import pytest
from fmpy.fmi1 import FMICallException

from fmu.units.worker_process import INTERPRETER_VARIABLE

Open = Callable[[str], Any]
ROOT = Path(__file__).parents[2]
QUICK = {"spacing": 0.75}
SLOW = pytest.mark.slow  # what a unit in Python, or of the other version, has in a like test
EACH = pytest.mark.parametrize("unit", ["DebrisFlowC", pytest.param("DebrisFlowC3", marks=SLOW)])
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for processes as Linux lists them")


def children(parent: int | None = None) -> list[int]:
    """Process numbers of what a process has started, this one if none is named."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
            command = (folder / "cmdline").read_bytes()
            if int(fields[1]) == (parent or os.getpid()) and fields[0] != "Z" and b"fmu.worker" in command:
                found.append(int(folder.name))
    return sorted(found)


def text(value: bytes | str) -> str:
    return value.decode() if isinstance(value, bytes) else value


@pytest.fixture
def errors(capfd: pytest.CaptureFixture[str]) -> Callable[[], str]:
    return lambda: "".join(capfd.readouterr())


def test_unit_gives_the_numbers_of_the_python_unit(open_unit: Open) -> None:
    """To the last bit, in both versions of the standard, with loads from outside and what lies beyond the crest."""
    units = [open_unit(name).initialize(**QUICK) for name in ("DebrisFlow", "DebrisFlowC", "DebrisFlowC3")]
    for size, force in ((0.3, 0.0), (0.05, -1e5), (0.4, -1e5), (0.4, 5e4)):
        found = []
        for unit in units:
            unit["external_force"] = force
            unit.run(size)
            found.append(
                {name: value for name, value in unit.outputs().items() if name not in ("time_ratio", "message")}
            )
        assert found[0] == found[1] == found[2]
    assert found[0]["impact_force_x"] > 1e5
    assert found[0]["overtopped_volume"] > 0.0
    assert units[1]["time_ratio"] > 0.0


@EACH
def test_states_outlive_their_worker(unit: str, open_unit: Open) -> None:
    host = open_unit(unit).initialize(**QUICK).run(0.3)
    host["external_force"] = -5e4
    state, data = host.save(), host.serialized(host.save())
    first = host.run(0.2)["barrier_displacement"]
    host.restore(state, 0.3)
    assert host.run(0.2)["barrier_displacement"] == first
    host.again(**QUICK)  # the reset ended the worker that kept the state
    for kept in (state, host.deserialized(data)):
        host.restore(kept, 0.3)
        assert host.run(0.2)["barrier_displacement"] == first
        host.release(kept)
    early = open_unit(unit).initialize(**QUICK)
    early.restore(early.save(), 0.0)
    assert early.run(0.1)["flow_kinetic_energy"] > 0.0


@EACH
def test_bad_state_is_refused(unit: str, open_unit: Open) -> None:
    host = open_unit(unit).initialize(**QUICK).run(0.1)
    data = bytearray(host.serialized(host.save()))
    data[-100] ^= 1
    with pytest.raises(FMICallException):
        host.deserialized(bytes(data))
    assert host.run(0.1)["flow_kinetic_energy"] > 0.0


@EACH
def test_bad_parameters_are_errors(unit: str, open_unit: Open, errors: Callable[[], str]) -> None:
    host = open_unit(unit)
    for values, says in (
        ({"scenario_file": '/nowhere/sc\\ene "ä".json'}, '/nowhere/sc\\ene "ä".json: Cannot read the scenario'),
        ({"spacing": -1.0}, "spacing is -1 m, it must be a finite number in [0, inf) m."),
        ({"device": "cuda:77"}, "device = 'cuda:77'"),
        ({"barrier_motion": 3}, "1 (as_scenario), 2 (driven)"),
        ({"scenario_file": "x" * 5000}, "scenario_file must be a text of less than 4096 bytes."),
    ):
        with pytest.raises(FMICallException) as caught:
            host.again(**values)
        assert caught.value.status == 3
        assert says in errors()
    assert children() == []
    assert host.again(**QUICK).run(0.1)["flow_kinetic_energy"] > 0.0


def test_dead_worker_is_reported(open_unit: Open) -> None:
    host = open_unit("DebrisFlowC").initialize(**QUICK).run(0.1)
    state = host.save()
    (worker,) = children()
    os.kill(worker, signal.SIGKILL)
    with pytest.raises(FMICallException) as caught:
        host.step(0.1)
    assert caught.value.status == 3
    assert "The simulator's process ended by signal 9 during the request 'step'" in text(host["message"])
    assert math.isnan(host["impact_force_x"])
    with pytest.raises(FMICallException):  # its states went with it
        host.restore(state, 0.1)
    assert host.again(**QUICK).run(0.1)["flow_kinetic_energy"] > 0.0  # a reset starts a new one


def test_slow_worker_is_ended(open_unit: Open, errors: Callable[[], str]) -> None:
    """No simulator opens its scene within a hundredth of a second."""
    with pytest.raises(FMICallException):
        open_unit("DebrisFlowC").initialize(reply_time_limit=0.01, **QUICK)
    assert "did not answer the request 'open' within 0.01 s and was ended; reply_time_limit sets" in errors()
    assert children() == []


@pytest.mark.parametrize("ending", [pytest.param("terminate", marks=SLOW), pytest.param("reset", marks=SLOW), "free"])
def test_no_process_is_left(ending: str, host_class: Any, archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    host = host_class(archives["DebrisFlowC"], unzipped["DebrisFlowC"]).initialize(**QUICK).run(0.1)
    host.save()
    assert len(children()) == 1
    if ending == "free":
        host.free()
    else:
        getattr(host.fmu, ending)()
    assert children() == []
    if ending != "free":
        host.free()


def test_worker_dies_with_its_host(archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    code = """
        import sys, time
        from pathlib import Path
        from fmu.instance import Unit
        unit = Unit(Path(sys.argv[1]), Path(sys.argv[2])).initialize(spacing=0.75)
        print("ready", flush=True)
        time.sleep(100)
    """
    command = [sys.executable, "-c", textwrap.dedent(code), archives["DebrisFlowC"], unzipped["DebrisFlowC"]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as host:
        assert host.stdout is not None
        assert host.stdout.readline() == "ready\n"
        (worker,) = children(host.pid)
        host.kill()
    end = time.monotonic() + 5.0
    while Path(f"/proc/{worker}").exists():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_interpreter_without_the_project_is_named(
    open_unit: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, errors: Callable[[], str]
) -> None:
    import venv

    venv.create(tmp_path / "empty", symlinks=True, with_pip=False)
    monkeypatch.setenv(INTERPRETER_VARIABLE, str(tmp_path / "empty" / "bin" / "python"))
    with pytest.raises(FMICallException):
        open_unit("DebrisFlowC").initialize(**QUICK)
    said = errors()
    assert f"The Python {tmp_path}/empty/bin/python has no warp-mpm-impact (No module named 'warp_mpm_fmu'): " in said
    assert f": install it there, or set {INTERPRETER_VARIABLE}" in said
    monkeypatch.setenv(INTERPRETER_VARIABLE, str(tmp_path))
    with pytest.raises(FMICallException):
        open_unit("DebrisFlowC").initialize(**QUICK)
    assert f"{INTERPRETER_VARIABLE} is {tmp_path}, it must be the path of a Python interpreter." in errors()


def test_host_without_python_runs_it_from_any_folder(
    c_program: Callable[[Path], Path], unzipped: dict[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "Größe #1 + 100% (x) & y"
    folder.symlink_to(unzipped["DebrisFlowC"])
    command = [
        c_program(ROOT / "docs" / "cosimulation" / "host.c"),
        folder,
        "barrier_displacement",
        "0.05",
        "0.4",
        "spacing=1",
    ]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert 0.05 < float(done.stdout) < 0.5
