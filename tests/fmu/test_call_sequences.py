"""No host is brought down by what it calls, in whatever order; and what calls out of order are answered with."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

Open = Callable[[str], Any]
CLOSED_FORMS = pytest.mark.parametrize("unit", ["BarrierSliding", "BarrierSlidingC", "BarrierSlidingC3"])
EACH = pytest.mark.parametrize("unit", ["BarrierSliding", "BarrierSlidingC", "BarrierSlidingC3", "GroundAnchorC"])
PROGRAM = Path(__file__).with_name("call_sequences.py")


def call_at_random(unit: str, count: int, archives: dict[str, Path], unzipped: dict[str, Path], log: Path) -> None:
    done = subprocess.run(
        [sys.executable, PROGRAM, archives[unit], unzipped[unit], str(count), log],
        capture_output=True,
        text=True,
        timeout=3600,
        check=False,
    )
    assert done.returncode == 0, f"{log.read_text() if log.exists() else None}\n{done.stderr[-4000:]}"


@pytest.mark.parametrize("unit", ["BarrierSliding", "BarrierSlidingC3"])
def test_random_calls(unit: str, archives: dict[str, Path], unzipped: dict[str, Path], tmp_path: Path) -> None:
    call_at_random(unit, 25, archives, unzipped, tmp_path / "calls")


@pytest.mark.slow
@pytest.mark.parametrize(
    "unit", [name + kind for name in ("BarrierSliding", "GroundAnchor", "DebrisFlow") for kind in ("", "C", "C3")]
)
def test_many_random_calls(unit: str, archives: dict[str, Path], unzipped: dict[str, Path], tmp_path: Path) -> None:
    call_at_random(unit, 500, archives, unzipped, tmp_path / "calls")


def refused(call: Callable[..., Any], *arguments: Any, **named: Any) -> None:
    """The call is answered with a discarded step or an error."""
    with pytest.raises(FMICallException) as caught:
        call(*arguments, **named)
    assert caught.value.status in (2, 3)


@EACH
def test_calls_out_of_order_are_errors(unit: str, open_unit: Open, capfd: pytest.CaptureFixture[str]) -> None:
    host = open_unit(unit)
    refused(host.fmu.exitInitializationMode)
    refused(host.fmu.terminate)
    refused(host.step, 0.1)
    host = open_unit(unit).initialize()
    refused(host.fmu.enterInitializationMode)
    refused(host.fmu.exitInitializationMode)
    if not host.fmi3:
        refused(host.fmu.setupExperiment, startTime=5.0)
    host.run(0.1)  # and it goes on as if nothing had been asked
    host.fmu.terminate()
    refused(host.fmu.terminate)
    refused(host.step, 0.1)
    said = "".join(capfd.readouterr())
    assert "is out of order in the setup stage of a unit." in said
    assert "is out of order in the stepping stage of a unit." in said
    assert "A step is out of order in the terminated stage of a unit." in said


@EACH
def test_a_step_beyond_the_stop_time_is_an_error(unit: str, open_unit: Open, capfd: pytest.CaptureFixture[str]) -> None:
    host = open_unit(unit).initialize(stop_time=1.0)
    host.run(0.1, 0.2, 0.3, 0.4)  # adds up to 1.0000000000000002 in some orders
    refused(host.step, 0.1)
    assert "it must end by the stop time that was set, 1 s." in "".join(capfd.readouterr())
    free = open_unit(unit).initialize()
    free.run(1.0, 100.0)


@EACH
@pytest.mark.parametrize("size", [math.inf, math.nan, -1e-3])
def test_absurd_steps_are_refused(unit: str, size: float, open_unit: Open, capfd: pytest.CaptureFixture[str]) -> None:
    host = open_unit(unit).initialize()
    refused(host.step, size)
    assert "it must be a finite number of at least 0 s." in "".join(capfd.readouterr())


@CLOSED_FORMS
@pytest.mark.parametrize("values", [{"speed": 1e200}, {"flow_mass": 1e308, "speed": 1e10}, {"flow_height": 5e-324}])
def test_no_output_is_no_number(
    unit: str, values: dict[str, float], open_unit: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    """Parameters within their ranges whose results cannot be told as numbers are refused, not answered with inf."""
    host = open_unit(unit)
    refused(host.initialize, **values)
    assert "beyond what can be computed with" in "".join(capfd.readouterr())


@pytest.mark.parametrize("times", [{"start_time": math.nan}, {"start_time": 2.0, "stop_time": 1.0}])
@EACH
def test_absurd_times_are_refused(unit: str, times: dict[str, float], open_unit: Open) -> None:
    refused(open_unit(unit).initialize, **times)


@EACH
@pytest.mark.parametrize("data", [b"", b"no state", b"\x00" * 2000, b'{"unit": "x"}'])
def test_bytes_that_are_no_state_are_refused(unit: str, data: bytes, open_unit: Open) -> None:
    host = open_unit(unit).initialize().run(0.3)
    before = host.outputs()

    def take() -> None:
        host.restore(host.deserialized(data), 0.0)

    refused(take)
    assert host.outputs() == before
    host.run(0.1)


@EACH
def test_a_state_goes_back_to_any_stage(unit: str, open_unit: Open) -> None:
    """Of the setup and of the initialization too, and takes the stop time along."""
    host = open_unit(unit)
    first = host.save()
    host.initialize(stop_time=1.0).run(0.5)
    outputs = host.outputs()
    host.restore(first, 0.0)
    assert host.initialize(stop_time=2.0).run(0.5).outputs() == outputs
    host.run(1.5)
    refused(host.step, 0.5)


def test_bad_bytes_do_not_end_a_host(archives: dict[str, Path], unzipped: dict[str, Path]) -> None:
    """The wrapper of pythonfmu releases what it does not own after an exception: here in every instance of many."""
    code = """
import sys
from pathlib import Path
from fmu.instance import Unit
path, folder = map(Path, sys.argv[1:])
for number in range(20):
    unit = Unit(path, folder).initialize()
    unit.step(0.1)
    state = unit.save()
    data = unit.serialized(state)
    for bad in (data[:-1], b"", b"[]", data.replace(b"values", b"valves")):
        try:
            unit.restore(unit.deserialized(bad), 0.1)
        except Exception:
            pass
        else:
            raise SystemExit("bad bytes were taken")
    unit.restore(state, 0.1)
    unit.step(0.1)
    unit.release(state)
    unit.free()
print("alive")
"""
    command = [sys.executable, "-c", code, archives["BarrierSliding"], unzipped["BarrierSliding"]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "alive"
