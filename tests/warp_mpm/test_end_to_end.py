"""The real command on the real simulation, coarse and short: what a user types and what he finds."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from warp_mpm import Results

ROOT = Path(__file__).parents[2]


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "warp_mpm", *map(str, arguments)],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "120"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "set_iib"
    answer = command("run", "scenarios/set_iib.json", "--out", folder, "--spacing", "0.5", "--until", "1.5")
    assert answer.returncode == 0, answer.stderr
    return folder, answer


def test_set_iib_slides_the_barrier_and_closes_its_ledger(run):
    folder, answer = run
    summary = json.loads((folder / "summary.json").read_text())
    assert f"{summary['peak_force'] / 1e3:,.1f} kN/m" in answer.stdout
    # A flow of 81 t/m at 20 m/s that is turned upward by a face at 60°: between a tenth of ρ v² h and all of it.
    assert 0.1 < summary["peak_force_filtered"] / (1800 * 20**2 * 3) < 1.0
    assert 0.0 < summary["impulse"] < 81_000 * 20
    assert summary["barrier_displacement_final"] > 1.0
    assert summary["mechanism"] == "airborne jet"
    assert summary["mass_error"] <= 1e-12
    assert summary["momentum_error"] <= 1e-9
    volumes = [summary[f"{name}_volume"] for name in ("retained", "on_crest", "overtopped", "left")]
    assert sum(volumes) == pytest.approx(45.0, rel=1e-6)  # snapshots are in single precision


def test_barrier_obeys_newton_by_the_recorded_forces(run):
    series = Results.open(run[0]).time_series
    horizontal = series["impact_force_x"] + series["top_force"] + series["back_force_x"] - series["base_force"]
    velocity = np.cumsum(horizontal[1:] * np.diff(series["time"])) / 90_000
    # Forces are interval means, so their sum is the exact impulse.
    assert velocity == pytest.approx(series["barrier_velocity"][1:], abs=1e-9)


def test_same_scene_same_numbers(run, tmp_path):
    folder, _ = run
    assert command("run", folder / "scenario.json", "--out", tmp_path / "again", "--no-pictures").returncode == 0
    assert (tmp_path / "again/timeseries.csv").read_bytes() == (folder / "timeseries.csv").read_bytes()


def test_refusal_leaves_no_trace(tmp_path):
    answer = command("run", "scenarios/set_iib.json", "--out", tmp_path / "run", "--device", "cuda:99")
    assert answer.returncode == 2
    assert "device = 'cuda:99' does not exist here" in answer.stderr
    assert "Traceback" not in answer.stderr
    assert not (tmp_path / "run").exists()
