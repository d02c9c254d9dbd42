"""The same scene twice, interrupted, and in single precision."""

import numpy as np
import pytest

from warp_mpm.simulation import Simulation

INTERVAL = 0.01


def coarse(load_scene, **changes):
    return load_scene("case_1", **{"numerics.spacing_m": 0.5, "output.end_time_s": 1.0} | changes)


def forces(simulation, until=1.0):
    """Impact force every INTERVAL [N/m], from now on."""
    values = []
    for time in INTERVAL * np.arange(round(simulation.time / INTERVAL) + 1, round(until / INTERVAL) + 1):
        simulation.advance(time)
        values.append(simulation.sample()["impact_force_x"])
    return np.array(values)


def test_two_runs_are_identical_to_the_bit(load_scene):
    first, second = (Simulation(coarse(load_scene)) for _ in range(2))
    np.testing.assert_array_equal(forces(first), forces(second))
    assert first.save_state() == second.save_state()


def test_a_restored_run_goes_on_to_the_bit(load_scene):
    whole, begun, resumed = (Simulation(coarse(load_scene)) for _ in range(3))
    expected = forces(whole)
    first = forces(begun, until=0.6)
    resumed.restore_state(begun.save_state())
    np.testing.assert_array_equal(np.concatenate([first, forces(resumed)]), expected)
    assert resumed.save_state() == whole.save_state()


def test_single_precision_agrees_to_a_thousandth(load_scene):
    double, single = Simulation(coarse(load_scene)), Simulation(coarse(load_scene, **{"numerics.precision": "float32"}))
    expected, found = forces(double), forces(single)
    assert found.max() == pytest.approx(expected.max(), rel=1e-3)
    assert found.sum() == pytest.approx(expected.sum(), rel=1e-3)
    assert single.barrier_displacement == pytest.approx(double.barrier_displacement, rel=1e-3)
    assert 0.0 < np.abs(single.points()["position"] - double.points()["position"]).max() < 0.05
