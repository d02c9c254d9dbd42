"""Design: the lightest barrier is the lightest, and the sampled probability is the one that can be worked out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

from analytic.arrays import outcomes
from analytic.design import Bounds, Coefficients, DesignError, chart, displacement, lightest_barrier
from analytic.reliability import Distribution, parse, reliability
from analytic.scene import Scene

FLOW = Scene(flow_mass=81000.0, flow_length=15.0, flow_height=3.0, speed=10.0, barrier_mass=81000.0, base_friction=0.29)


@pytest.mark.parametrize("limit", [0.1, 0.5, 1.0, 2.0])
def test_a_lighter_barrier_slides_too_far(limit: float) -> None:
    design = lightest_barrier(FLOW, limit, Bounds(height=6.0))
    assert design.governed_by == "displacement"
    assert float(displacement(FLOW, design.mass, design.coefficients)) <= limit
    assert float(displacement(FLOW, 0.999 * design.mass, design.coefficients)) > limit
    assert FLOW.impact().barrier_displacement_final == pytest.approx(
        float(displacement(FLOW, FLOW.barrier_mass, Coefficients()))
    )


def test_the_trapezoid_has_its_mass_and_angle() -> None:
    design = lightest_barrier(FLOW, 1.0, Bounds(height=6.0))
    area = (design.base_width + design.crest_width) / 2 * design.height
    assert 2000 * area == pytest.approx(design.mass)
    face = math.degrees(math.atan2(design.height, (design.base_width - design.crest_width) / 2))
    assert face == pytest.approx(design.face_angle)
    assert design.face_angle == 60  # of equally light ones the flattest


def test_a_barrier_that_must_not_move_resists_the_peak() -> None:
    design = lightest_barrier(FLOW, 0.0, Bounds(height=6.0))
    impact = replace(FLOW, barrier_mass=design.mass).impact()
    assert impact.peak_force == pytest.approx(impact.friction, rel=1e-6)


def test_the_crest_bounds_the_shape() -> None:
    design = lightest_barrier(FLOW, 100.0, Bounds(height=6.0, crest_width=2.0))
    assert design.governed_by == "shape"
    assert design.crest_width == pytest.approx(2.0)
    assert design.face_angle == 80  # the steepest face makes the lightest shape
    assert design.displacement < 100


def test_a_face_that_is_pressed_down_makes_a_lighter_barrier() -> None:
    """With a vertical load that grows as the face flattens, the flattest face carries the load."""

    def rule(scene: Scene) -> Coefficients:
        assert scene.face_angle is not None
        return Coefficients(vertical_load_ratio=1 / math.tan(math.radians(scene.face_angle)))

    loaded = lightest_barrier(FLOW, 1.0, Bounds(height=6.0), rule)
    assert loaded.face_angle == 60
    assert loaded.mass < lightest_barrier(FLOW, 1.0, Bounds(height=6.0)).mass
    steep = lightest_barrier(FLOW, 1.0, Bounds(height=6.0, face_angle=(75.0, 75.0)), rule)
    assert loaded.mass < steep.mass


def test_chart_holds_the_displacement_of_each_pair() -> None:
    ratios, speeds = np.array([0.5, 1.0, 2.0]), np.array([5.0, 10.0])
    found = chart(FLOW, ratios, speeds)
    assert found.shape == (2, 3)
    scene = replace(FLOW, speed=5.0, barrier_mass=2 * FLOW.flow_mass)
    assert found[0, 2] == pytest.approx(scene.impact().barrier_displacement_final)
    assert np.all(np.diff(found, axis=1) <= 0)
    assert np.all(np.diff(found, axis=0) >= 0)


def test_what_cannot_be_designed_is_refused() -> None:
    with pytest.raises(DesignError, match=r"limit is -1, it must be a number in \[0, inf\)"):
        lightest_barrier(FLOW, -1.0, Bounds(height=6.0))
    with pytest.raises(DesignError, match=r"No barrier up to 10000 times the flow's mass keeps 1 m"):
        lightest_barrier(replace(FLOW, base_friction=0.0), 1.0, Bounds(height=6.0))
    with pytest.raises(DesignError, match=r"base_friction is missing"):
        lightest_barrier(replace(FLOW, base_friction=None), 1.0, Bounds(height=6.0))
    with pytest.raises(ValueError, match=r"face_angle is 95, it must be a number in \[60, 90\]"):
        Bounds(height=6.0, face_angle=(60.0, 95.0))
    with pytest.raises(ValueError, match=r"height is nan, it must be a number in \(0, inf\)"):
        Bounds(height=math.nan)


NUMBERS = {
    "density": 1800.0,
    "flow_length": 15.0,
    "flow_height": 3.0,
    "speed": 10.0,
    "barrier_mass": 90000.0,
    "base_friction": 0.29,
    "geometry_change": 0.41,
    "rise_ratio": 0.35,
}


def test_probability_of_one_uncertain_input_can_be_worked_out() -> None:
    """The displacement grows with the speed, so it exceeds the limit where the speed exceeds one value."""
    limit = 1.5
    speed = Distribution("normal", (10.0, 1.5))
    critical = brentq(
        lambda v: float(displacement(replace(FLOW, speed=v), 90000.0, Coefficients())) - limit, 1, 30, xtol=1e-10
    )
    expected = stats.norm(10, 1.5).sf(critical)
    found = reliability(NUMBERS | {"speed": speed}, limit)
    # Four standard deviations of a share of a million samples.
    assert found.probability == pytest.approx(expected, abs=4 * math.sqrt(expected * (1 - expected) / 1e6))
    assert found.interval[0] < found.probability < found.interval[1]
    assert found.sensitivity["speed"].total == pytest.approx(1, abs=0.01)
    assert found.sensitivity["speed"].first == pytest.approx(1, abs=0.01)
    assert found.sensitivity["speed"].rank_correlation > 0.99


def test_sobol_indices_of_two_inputs() -> None:
    """First-order index: variance of the mean at given speed; total: one less the index of the other. By quadrature."""
    speed, friction = Distribution("uniform", (9.0, 11.0)), Distribution("uniform", (0.25, 0.33))
    v, tan = np.linspace(9, 11, 401)[:, None], np.linspace(0.25, 0.33, 401)[None, :]
    moved = _grid(v, tan)
    variance = moved.var()
    first_speed, first_friction = moved.mean(axis=1).var() / variance, moved.mean(axis=0).var() / variance
    found = reliability(NUMBERS | {"speed": speed, "base_friction": friction}, 1.0, samples=100_000).sensitivity
    assert list(found) == ["speed", "base_friction"]
    # 2^15 points of a Sobol' sequence; other seeds differ by less than this.
    assert found["speed"].first == pytest.approx(first_speed, abs=0.01)
    assert found["speed"].total == pytest.approx(1 - first_friction, abs=0.01)
    assert found["base_friction"].first == pytest.approx(first_friction, abs=0.01)
    assert found["base_friction"].rank_correlation < 0


def _grid(v: np.ndarray, tan: np.ndarray) -> np.ndarray:
    return outcomes(
        flow_mass=81000.0,
        barrier_mass=90000.0,
        flow_length=15.0,
        speed=v,
        base_friction=tan,
        geometry_change=0.41,
        rise_ratio=0.35,
    ).barrier_displacement_final


def test_samples_are_a_million_unless_told() -> None:
    found = reliability(
        NUMBERS | {name: Distribution("lognormal", (NUMBERS[name], 0.2)) for name in ("speed", "density")}, 1.0
    )
    assert found.samples == 1_000_000


@pytest.mark.parametrize(
    ("text", "reference"),
    [
        ("normal(1, 0.5)", stats.truncnorm(-2, np.inf, 1, 0.5)),
        ("uniform(1, 3)", stats.uniform(1, 2)),
        ("triangular(1, 1.5, 3)", stats.triang(0.25, 1, 2)),
        ("triangular(1, 1, 3)", stats.triang(0, 1, 2)),
        ("lognormal(2, 0.3)", stats.lognorm(math.sqrt(math.log(1.09)), scale=2 / math.sqrt(1.09))),
    ],
)
def test_distributions_cut_off_at_nil(text: str, reference: stats.rv_continuous) -> None:
    distribution = parse("speed", text)
    assert isinstance(distribution, Distribution)
    probability = np.linspace(0.01, 0.99, 9)
    assert distribution.quantile(probability, low=0.0) == pytest.approx(reference.ppf(probability))


def test_a_cut_off_distribution_stays_inside() -> None:
    values = Distribution("triangular", (0.2, 0.9, 1.3)).quantile(np.array([1e-12, 0.5, 1 - 1e-12]), 0.0, 1.0)
    assert np.all((values > 0.2) & (values <= 1))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("ten", r"speed is 'ten', it must be a number, or one of normal\(mean, deviation\)"),
        ("gamma(1, 2)", r"must be a number, or one of"),
        ("normal(1)", r"speed is 'normal\(1\)', it must read normal\(mean, deviation\)"),
        ("normal(1, -2)", r"a spread above 0"),
        ("uniform(3, 1)", r"in order"),
        ("triangular(1, 4, 3)", r"in order"),
        ("lognormal(-1, 2)", r"must read lognormal"),
        ("normal(a, b)", r"must read normal"),
    ],
)
def test_a_distribution_that_is_none_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        parse("speed", text)


def test_bad_inputs_of_the_sampling_are_refused() -> None:
    speed = Distribution("normal", (10.0, 1.0))
    with pytest.raises(ValueError, match="No input is uncertain"):
        reliability(NUMBERS, 1.0)
    with pytest.raises(ValueError, match="input is 'sped'"):
        reliability(NUMBERS | {"sped": speed}, 1.0)
    with pytest.raises(ValueError, match="density is missing"):
        reliability({"speed": speed}, 1.0)
    with pytest.raises(ValueError, match="limit is nan"):
        reliability(NUMBERS | {"speed": speed}, math.nan)
    with pytest.raises(ValueError, match="samples is 10, it must be at least 1000"):
        reliability(NUMBERS | {"speed": speed}, 1.0, samples=10)
    with pytest.raises(ValueError, match="base_friction must be above 0"):
        reliability(NUMBERS | {"speed": speed, "base_friction": 0.0}, 1.0, samples=1000)
    with pytest.raises(ValueError, match=r"rise_ratio is mostly outside \[0, 1\]"):
        reliability(NUMBERS | {"rise_ratio": Distribution("normal", (2.0, 0.1))}, 1.0, samples=1000)
