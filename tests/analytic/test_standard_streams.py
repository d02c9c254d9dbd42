"""Command lines whose standard output cannot take everything, or anything: all is computed all the same."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from analytic.cli.terminal import print_table
from analytic.standard_streams import Outlet, printable, spelled

ROOT = Path(__file__).parents[2]
PREDICT = [sys.executable, "-m", "analytic", "predict", str(ROOT / "scenarios" / "set_iib.json")]


def predict(redirection="", **environment):
    """The command in a shell."""
    words = " ".join(f"'{word}'" for word in PREDICT)
    return subprocess.run(
        f"{words} {redirection}",
        shell=True,
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize("encoding", ["cp1252", "latin-1", "ascii", "utf-8"])
def test_what_an_encoding_lacks_is_spelled(encoding):
    answer = predict(PYTHONIOENCODING=encoding)
    assert (answer.returncode, answer.stderr) == (0, b"")
    text = answer.stdout.decode(encoding)
    assert ("λ = 0.41" if encoding == "utf-8" else "lambda = 0.41") in text
    assert "?" not in text


@pytest.mark.parametrize(
    "redirection",
    [*(pytest.param(closed, marks=pytest.mark.slow) for closed in ("2>&-", ">&-", ">&- 2>&-")), ">&- 2>&- <&-"],
)
def test_closed_streams_stop_nothing(redirection, tmp_path):
    figure = tmp_path / "figure.png"
    answer = predict(f"--plot {figure} {redirection}")
    assert answer.returncode == 0
    assert answer.stderr == (b"" if "2>&-" in redirection else f"Figure: {figure}\n".encode())
    assert figure.stat().st_size > 1000
    assert (b"final barrier displacement" in answer.stdout) == (">&-" not in redirection.replace("2>&-", ""))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_under_standard_output_is_told():
    answer = predict("--json >/dev/full")
    assert answer.returncode == 2
    assert answer.stderr == b"Standard output cannot be written: No space left on device.\n"


def test_a_pipe_that_is_closed_stops_nothing(tmp_path):
    figure = tmp_path / "figure.png"
    answer = predict(f"--plot {figure} | true")
    assert answer.stderr == f"Figure: {figure}\n".encode()
    assert figure.stat().st_size > 1000


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), ValueError("I/O operation on closed file")])
def test_an_outlet_fails_once_and_hurts_no_one(error):
    class Broken:
        calls = 0
        encoding = "utf-8"

        def write(self, text):
            self.calls += 1
            raise error

        flush = write

    broken = Broken()
    outlet = Outlet(broken)
    assert [outlet.write("abc"), outlet.write("de")] == [3, 2]
    outlet.flush()
    assert (outlet.failure, broken.calls) == (error, 1)


def test_spelling():
    assert "".join(map(spelled, "F₂ₓ ≥ 3 m³, Δx, β = 60°, σ′, ½, 10⁻³, è")) == (
        "F2x >= 3 m3, dx, beta = 60 deg, sigma', 1/2, 10-3, e"
    )
    assert spelled("\ud800") == spelled("漢") == "?"


def test_control_characters_are_shown_as_codes(monkeypatch):
    sent = []
    monkeypatch.setattr(typer, "echo", sent.append)
    print_table("a\x1b[31mred", ["name", "value"], [["b\x9b", "1"]], ["c\x07"])
    assert "a\\x1b[31mred" in sent[0]
    assert not {"\x1b", "\x9b", "\x07"} & set(sent[0])
    assert printable("a\x1b[31m\x9b\ud800\nλ") == "a\\x1b[31m\\x9b\\ud800\nλ"
