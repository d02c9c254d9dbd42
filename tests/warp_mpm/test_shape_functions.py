"""Splines and hats on their own, in a kernel that does nothing else."""

import numpy as np
import pytest
import warp as wp

from warp_mpm.effects import Effects
from warp_mpm.kernels.layout import layout
from warp_mpm.kernels.shape_functions import make_shape_functions

PLACES = np.concatenate([[0.0, 0.5, 1.0 - 1e-12], np.random.default_rng(1).random(500)])
"""Reduced coordinates inside a cell, its edges and its middle included."""


@pytest.fixture(scope="module")
def evaluated():
    """Weights [N, 3], slopes [N, 3] and hats [N, 2] at PLACES."""
    shapes = make_shape_functions(layout(Effects("dry")))
    weights, slopes, hats = shapes.weights, shapes.slopes, shapes.hats

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(
        place: wp.array(dtype=wp.float64),
        weight: wp.array(dtype=wp.vec3d),
        slope: wp.array(dtype=wp.vec3d),
        hat: wp.array(dtype=wp.vec2d),
    ):
        p = wp.tid()
        weight[p] = weights(place[p])
        slope[p] = slopes(place[p])
        hat[p] = hats(place[p])

    number = len(PLACES)
    out = [wp.zeros(number, dtype=kind, device="cpu") for kind in (wp.vec3d, wp.vec3d, wp.vec2d)]
    wp.launch(evaluate, number, [wp.array(PLACES, dtype=wp.float64, device="cpu")], out, device="cpu")
    return [array.numpy() for array in out]


def spline(distance):
    """Quadratic B-spline of the distance to its node in cells, in the form of the textbooks."""
    r = np.abs(distance)
    return np.where(r < 0.5, 0.75 - r**2, np.where(r < 1.5, 0.5 * (1.5 - r) ** 2, 0.0))


def test_weights_are_the_b_splines_of_the_three_nodes(evaluated):
    # The node of the cell lies in its middle: at f = 1/2.
    distances = PLACES[:, None] - 0.5 - np.array([-1.0, 0.0, 1.0])
    np.testing.assert_allclose(evaluated[0], spline(distances), atol=1e-15)


def test_partition_of_unity(evaluated):
    weights, slopes, hats = evaluated
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-15)
    np.testing.assert_allclose(slopes.sum(axis=1), 0.0, atol=1e-15)
    np.testing.assert_allclose(hats.sum(axis=1), 1.0, atol=1e-15)
    assert weights.min() >= 0.0
    assert hats.min() >= 0.0


def test_a_linear_field_and_its_slope_are_reproduced(evaluated):
    weights, slopes, hats = evaluated
    nodes, corners = np.array([-0.5, 0.5, 1.5]), np.array([0.0, 1.0])
    np.testing.assert_allclose(weights @ (3.0 + 2.0 * nodes), 3.0 + 2.0 * PLACES, atol=2e-15)
    np.testing.assert_allclose(slopes @ (3.0 + 2.0 * nodes), 2.0, atol=1e-14)
    np.testing.assert_allclose(hats @ (3.0 + 2.0 * corners), 3.0 + 2.0 * PLACES, atol=2e-15)


def test_slopes_are_the_derivatives_of_the_weights(evaluated):
    step = 1e-6
    nodes = np.array([-1.0, 0.0, 1.0])
    inside = PLACES[(step < PLACES) & (1.0 - step > PLACES)]
    distances = inside[:, None] - 0.5 - nodes
    difference = (spline(distances + step) - spline(distances - step)) / (2.0 * step)
    # A quadratic's central difference is exact; what remains is rounding, 1e-16 / step.
    np.testing.assert_allclose(evaluated[1][(step < PLACES) & (1.0 - step > PLACES)], difference, atol=1e-9)
