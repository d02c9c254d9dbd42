"""Plane geometry against figures known in closed form."""

import numpy as np
import pytest

from warp_mpm import geometry

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
# A comb with two teeth: concave, so that a cut falls apart into two pieces.
COMB = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 3.0], [4.0, 3.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])


def test_area_and_centroid_do_not_depend_on_place_or_direction():
    shift = np.array([1e5, -3e5])
    for polygon in (COMB, COMB[::-1], COMB + shift):
        assert geometry.area(polygon) == pytest.approx(9.0, rel=1e-9)
    assert geometry.centroid(COMB) == pytest.approx([2.5, (5 * 0.5 + 4 * 2.0) / 9])
    assert geometry.centroid(COMB + shift) - shift == pytest.approx(geometry.centroid(COMB), abs=1e-9)
    assert geometry.signed_area(COMB[::-1]) == -geometry.signed_area(COMB)


@pytest.mark.parametrize("squares", [0, 1, 3, 43])
@pytest.mark.parametrize("depth", [1.0, 3.0, 0.37])
def test_front_and_tail(squares, depth):
    polygon = geometry.front_and_tail(depth, squares, 3.0)
    assert geometry.area(polygon) == pytest.approx((2 + squares) * depth**2, rel=1e-13)
    front_toe, front_top = polygon[0], polygon[1]
    assert front_toe[0] - front_top[0] == pytest.approx(front_top[1])  # 45°
    assert geometry.maximum_depth(polygon) == pytest.approx(depth, rel=1e-8)
    assert geometry.crossing_edges(polygon) is None


def test_clip_of_a_concave_polygon():
    teeth = geometry.clip_half_plane(COMB, (0.0, -1.0), -1.0)  # y >= 1
    assert geometry.area(teeth) == pytest.approx(4.0)
    assert geometry.centroid(teeth) == pytest.approx([2.5, 2.0])
    assert len(geometry.clip_half_plane(COMB, (0.0, -1.0), -4.0)) == 0


@pytest.mark.parametrize("window_direction", [1, -1])
def test_clip_by_a_convex_window(window_direction):
    window = np.array([[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]])[::window_direction]  # x + y <= 2
    assert geometry.area(geometry.clip_convex(SQUARE, window)) == pytest.approx(2.0)


def test_clipping_agrees_with_counting_points():
    rng = np.random.default_rng(3)
    star_angle = np.sort(rng.uniform(0, 2 * np.pi, 12))
    star = np.stack([np.cos(star_angle), np.sin(star_angle)], axis=1) * rng.uniform(0.4, 2.0, (12, 1))
    window = np.array([[-0.7, -0.9], [1.1, -0.6], [0.8, 0.9], [-0.5, 0.7]])
    lattice = (np.stack(np.meshgrid(*[np.arange(1000)] * 2), axis=-1).reshape(-1, 2) + 0.5) / 250.0 - 2.0
    inside = geometry.contains(star, lattice) & geometry.contains(window, lattice)
    counted = inside.sum() / 250.0**2
    # The outline, about 6 m long, passes through 1500 squares of 1.6e-5 m², whose in-or-out errors scatter.
    assert geometry.area(geometry.clip_convex(star, window)) == pytest.approx(counted, abs=1e-3)


def test_crossing_edges():
    bow = SQUARE[[0, 2, 1, 3]]
    assert geometry.crossing_edges(bow) is not None
    assert geometry.crossing_edges(COMB) is None
    # The first side, drawn on, would cross the fourth, which its bounding box meets; it stops short of it.
    short = np.array([[0.0, 0.0], [3.0, 3.0], [1.0, 3.2], [2.0, 4.0], [6.0, 2.9], [6.0, 0.0]])
    assert geometry.crossing_edges(short) is None
    touching = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.0], [0.0, 2.0]])
    assert geometry.crossing_edges(touching) is not None


def test_depth_below_surface():
    points = np.array([[0.5, 0.5], [2.5, 0.25], [2.5, 2.0], [6.0, 1.0]])
    assert geometry.depth_below_surface(COMB, points) == pytest.approx([2.5, 0.75, 0.0, 0.0])


def test_depth_under_an_overhang():
    # A C open to the right: under its upper arm, the lower arm's depth counts to the gap, not to the top.
    c = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 2], [4, 2], [4, 3], [0, 3]], dtype=float)
    assert geometry.depth_below_surface(c, np.array([[3.0, 0.5], [3.0, 2.5], [0.5, 0.5]])) == pytest.approx(
        [0.5, 0.5, 2.5]
    )
