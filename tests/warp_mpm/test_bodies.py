"""Bodies: outlines, the contact rule, several of them at once, and those of a script."""

import importlib.util
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scipy.spatial import cKDTree

from warp_mpm import geometry
from warp_mpm.effect_rules import derive_effects
from warp_mpm.grid import fit_grid
from warp_mpm.kernels.elementary import make_elementary
from warp_mpm.kernels.layout import BESIDE_CUT, SURROUNDED, layout
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.simulator.bodies import Body, Driven, Outline, Sliding, Surface
from warp_mpm.simulator.bodies.arrays import effects_of
from warp_mpm.simulator.bodies.kernels import BESIDE, make_body_functions
from warp_mpm.simulator.bodies.of_scene import scene_bodies
from warp_mpm.simulator.bodies.places import coloured, places_of, sharing
from warp_mpm.validation.scenes import box, scene

FOLDER = Path(__file__).parents[2] / "scenarios"
SCENES = sorted([*FOLDER.glob("*.json"), *FOLDER.glob("hard/*.json")])
ANGLES = 2.0 * np.pi * np.arange(24) / 24.0
CIRCLE = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
NOTCHED = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 1.0], [0.0, 3.0]]
"""A block with a notch in its top."""
PROFILE = [[-2.0, 1.0], [-0.5, 0.0], [0.5, 0.2], [1.0, 1.5], [3.0, 1.5]]
"""Ground that is not flat."""
OUTLINES = {
    "circle": Outline(CIRCLE),
    "notched": Outline(NOTCHED),
    "barrier": Outline(geometry.trapezoid(4.0, 1.0, 2.0), closed=False),
    "needle": Outline(geometry.trapezoid(4.0, 0.0, 2.0), closed=False),
    "profile": Outline(PROFILE, closed=False),
}


def places():
    return np.random.default_rng(7).uniform(-3.0, 5.0, (2000, 2))


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
def test_distance_and_normal_are_those_of_the_outline(outline):
    """Against the outline's own points, finely laid, and the solid as a polygon."""
    corners = outline.vertices
    if not outline.closed:
        first, last = corners[0] - corners[1], corners[-1] - corners[-2]
        ends = [corners[0] + 100.0 * first / np.hypot(*first), corners[-1] + 100.0 * last / np.hypot(*last)]
        corners = np.array([ends[0], *corners, ends[1]])
        around = [[corners[-1, 0], -200.0], [corners[0, 0], -200.0]]
        solid = np.concatenate([corners, around])
        laid = np.concatenate([np.linspace(a, b, 40_001) for a, b in pairwise(corners)])
    else:
        solid = corners
        laid = np.concatenate([np.linspace(a, b, 4001) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
    place = places()
    nearest = cKDTree(laid).query(place)[0]
    inside = geometry.contains(solid, place)
    distance = outline.distance(place)
    np.testing.assert_allclose(np.abs(distance), nearest, atol=2e-3)
    clear = nearest > 1e-3
    assert (inside == (distance < 0.0))[clear].all()
    assert 100 < inside.sum() < 1900
    # The normal is the distance's gradient; not where two pieces are equally near.
    step = 1e-7
    gradient = np.stack(
        [(outline.distance(place + e) - outline.distance(place - e)) / (2.0 * step) for e in step * np.eye(2)], axis=1
    )
    smooth = np.abs(np.hypot(*gradient.T) - 1.0) < 1e-6
    assert smooth.mean() > 0.99
    np.testing.assert_allclose(outline.normal(place)[smooth], gradient[smooth], atol=1e-5)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_the_kernels_see_the_same_distance(load_scene, precision):
    types = layout(derive_effects(load_scene("case_1", **{"numerics.precision": precision})))
    F, V2, P, nearest = types.scalar, types.V2, types.P, make_body_functions(types, make_elementary(types)).nearest
    vectors, numbers, rows = wp.array(dtype=V2), wp.array(dtype=F), wp.array(dtype=P)

    @wp.kernel(module="unique")
    def look(pieces: rows, place: vectors, d: numbers, normal: vectors, piece: wp.array(dtype=wp.int32)):
        i = wp.tid()
        distance, direction, k = nearest(pieces, 0, pieces.shape[0], place[i])
        d[i] = distance
        normal[i] = direction
        piece[i] = k

    place = places()
    for outline in OUTLINES.values():
        s = outline.segments
        found = [wp.zeros(len(place), dtype=kind, device="cpu") for kind in (F, V2, wp.int32)]
        arrays = [wp.array(values, dtype=kind, device="cpu") for values, kind in ((s.numbers, P), (place, V2))]
        wp.launch(look, dim=len(place), inputs=[*arrays, *found], device="cpu")
        distance, normal, piece = s.nearest(place)
        tolerance = 1e-12 if precision == "float64" else 2e-6
        np.testing.assert_allclose(found[0].numpy(), distance, atol=tolerance)
        same = found[2].numpy() == piece
        assert same.mean() > (0.999 if precision == "float64" else 0.99)
        far = same & (np.abs(distance) > 0.05)
        np.testing.assert_allclose(found[1].numpy()[far], normal[far], atol=100.0 * tolerance)


def test_rules_of_effects_and_bodies_agree():
    for path in SCENES:
        scenario = Scenario.load(path)
        bodies = scene_bodies(scenario, fit_grid(scenario))
        effects = derive_effects(scenario)
        assert effects == effects.with_bodies(effects_of(bodies)), path.stem


# -- the contact rule --------------------------------------------------------------------------------------------


def basin(formulation="dry", *, bodies=(), end_time=1.0, **options):
    """A pool of 8 m x 2 m on smooth ground between walls, cells of 0.2 m, and bodies in or above it."""
    walls = {"left_edge": "wall", "right_edge": "wall", "left_m": -4.0, "right_m": 4.0, "top_m": 6.0}
    options = {"domain": walls, "spacing_m": 0.2} | options
    return Simulation(scene("pool", box(-4.0, 4.0, 2.0), formulation, end_time=end_time, **options), bodies=bodies)


@pytest.mark.parametrize("passing", [False, True])
def test_pore_pressures_are_hardly_averaged_beside_an_outline_that_cuts_cells(passing):
    """An inclined face does, an upright one on a line of the grid does not, unless it moves over the grid."""
    wedge = Body("wedge", Outline([[-4.0, -1.0], [-4.0, 3.0], [0.0, -1.0]]))
    post = Body(
        "post", Outline([[2.0, -1.0], [2.0, 3.0], [3.0, 3.0], [3.0, -1.0]]), motion=Driven((0.0,), ((0.0, 0.0),))
    )
    pool = [[-1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [-3.0, 2.0]]
    bodies = [wedge, post] if passing else [wedge, Body("post", post.outline)]
    simulation = Simulation(scene("pool", pool, "undrained", end_time=1.0, spacing_m=0.2), bodies=bodies)
    assert simulation.effects.passing == passing
    simulation.advance(0.02)
    points = {name: array.numpy() for name, array in simulation._held.points.items()}
    place, filter_of = points["position"], points["surrounded"]
    spacing = simulation.grid.spacing
    # With a grid that rests it is a matter of a point's cell, from whose middle it lies 0.71 cells away at most.
    unsure = 0.01 if passing else 0.72
    distance = np.minimum(wedge.outline.distance(place), post.outline.distance(place) if passing else np.inf) / spacing
    beside, near, off = filter_of == BESIDE_CUT, distance < BESIDE - unsure, distance > BESIDE + unsure
    assert beside.sum() > 50
    assert (filter_of == SURROUNDED).sum() > 500
    assert not (near & (filter_of == SURROUNDED)).any()
    assert not (off & beside).any()


def acting(simulation, name):
    """Where the nodes and weights of a body's places of contact say that these lie, and where they lie, relative to the
    grid; only those whose weights all count."""
    number = [body.name for body in simulation.bodies].index(name)
    arrays = {field: array.numpy() for field, array in simulation._contact_arrays.items()}
    mine = (arrays["body"] == number) & (arrays["first"] >= 0)
    weight_x, weight_y = arrays["weight_x"][mine], arrays["weight_y"][mine]
    whole = np.abs(weight_x.sum(axis=1) * weight_y.sum(axis=1) - 1.0) < 1e-14
    grid = simulation.grid
    first = np.stack(np.divmod(arrays["first"][mine], grid.rows), axis=1)
    middle = np.stack([weight_x @ np.arange(3.0), weight_y @ np.arange(3.0)], axis=1)
    told = [grid.left, grid.bottom] + grid.spacing * (first + 0.5 + middle)
    return told[whole], arrays["position"][mine][whole]


def test_a_body_that_passes_acts_at_its_outline():
    """The splines' weights give back where a place lies, for a pillar that has moved across the grid."""
    pillar = Body("pillar", Outline(0.7 * CIRCLE + [0.0, 3.5]), motion=Driven((0.0,), ((3.0, -1.0),)))
    beside = Body("block", block(4.03, 5.0, 1.5), motion=Sliding(2000.0, 0.1))
    simulation = basin(bodies=[pillar, beside], domain={"left_m": -8.0, "right_m": 12.0, "top_m": 6.0})
    for time in (0.03, 0.2):
        simulation.advance(time)
        # As it lay at the begin of the last step.
        step = float(simulation._clock.numpy()[2])
        moved = np.array(simulation.body_displacement("pillar")) - step * np.array([3.0, -1.0])
        told, position = acting(simulation, "pillar")
        assert len(told) > 20
        np.testing.assert_allclose(told, position + moved, atol=1e-12)
        np.testing.assert_allclose(pillar.outline.distance(told - moved), 0.0, atol=1e-12)


def test_walls_stay_in_place_while_the_grid_rides(load_scene):
    """Seen from a grid that rides with a barrier they move."""
    changes = {
        "barrier.motion": {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [2.0]},
        "numerics.spacing_m": 0.5,
        "domain.left_edge": "wall", "domain.right_edge": "wall", "domain.left_m": -25.0, "domain.right_m": 20.0,
    }  # fmt: skip
    simulation = Simulation(load_scene("case_1", **changes))
    simulation.advance(0.4)
    step = float(simulation._clock.numpy()[2])
    shift = simulation.barrier_displacement - 2.0 * step
    assert shift > 0.5
    for name, x in (("left_wall", -25.0), ("right_wall", 20.0)):
        told, _ = acting(simulation, name)
        assert len(told) > 10
        np.testing.assert_allclose(told[:, 0] + shift, x, atol=1e-12)
    sample = simulation.sample()
    assert abs(sample["momentum_residual_x"]) < 1e-9 * abs(sample["momentum_x"])


FACES = [
    pytest.param("case_1", {}, id="rides with the grid"),
    pytest.param("case_1_fixed", {"gravity.tilt_deg": 5.0}, id="on a slope"),
    pytest.param("case_1_fixed", {"ground.profile_m": [[-60, 0], [0, 0], [40, -2]]}, id="on a profile"),
]


@pytest.mark.parametrize(("name", "changes"), FACES)
def test_places_of_a_face_begin_at_its_toe_whatever_the_spacing(load_scene, name, changes):
    """Friction in the toe's cell hangs on how far from the toe the first place is.

    Laid from the crest down, the first came anywhere within half a cell; the friction on case 1's face then scattered
    by 5 % from one spacing to the next, its sliding distance by 3 %.
    """
    for spacing in (0.5, 0.37, 0.3):
        scenario = load_scene(name, **changes, **{"numerics.spacing_m": spacing})
        grid = fit_grid(scenario)
        bodies = scene_bodies(scenario, grid)
        places = places_of(bodies, grid, [False] * len(bodies))
        number = next(k for k, body in enumerate(bodies) if body.name == "barrier")
        own = (places.body == number) & (places.normal[:, 0] < -0.1) & (places.position[:, 1] > 0.0)
        along = np.sort(np.hypot(*places.position[own].T)) / spacing
        assert along[0] == pytest.approx(0.25, abs=0.01)
        assert np.diff(along) == pytest.approx(0.5, abs=0.02)


def test_places_lie_closer_at_the_corners_of_a_profile(load_scene):
    """Two to a cell cannot bear what a pond at rest gives to the nodes of a corner: a current runs along its basin."""
    corners = np.array([[-60.0, 0.0], [0.0, 0.0], [3.0, 1.0], [3.4, 1.5], [40.0, 8.0]])
    scenario = load_scene("case_1", barrier=None, **{"numerics.spacing_m": 0.25, "ground.profile_m": corners.tolist()})
    grid = fit_grid(scenario)
    bodies = [body for body in scene_bodies(scenario, grid) if body.name == "ground"]
    places = places_of(bodies, grid, [False])
    for k, (begin, end) in list(enumerate(pairwise(corners)))[1:]:
        along = (end - begin) / np.hypot(*(end - begin))
        place, stands_for = (places.position - begin)[places.piece == k] @ along, places.length[places.piece == k]
        order = np.argsort(place)
        steps, middle = np.diff(place[order]) / 0.25, 0.5 * (place[order][1:] + place[order][:-1])
        ends = np.hypot(*(end - begin)) if k < 3 else np.inf  # the last piece goes on
        near = (middle < 0.45) | (middle > ends - 0.45)
        assert steps[near] == pytest.approx(1.0 / 3.0, abs=0.03)
        assert steps[~near].max(initial=0.5) == pytest.approx(0.5, abs=0.02)
        if k < 3:
            assert stands_for.sum() == pytest.approx(ends)


@pytest.mark.parametrize("height", [0.0, 0.05])
def test_places_of_one_colour_share_no_node(height):
    """So that threads may do them at the same time; and those that stand alone share a node with none."""
    bodies = [Body("pillar", Outline(0.7 * CIRCLE + [0.0, 3.1])),
              Body("slope", Outline([[4.0, 2.0 + height], [-4.0, 5.0 + height]], closed=False))]  # fmt: skip
    simulation = basin("undrained", bodies=bodies, domain={"left_m": -8.0, "right_m": 8.0, "top_m": 6.0}, barrier=None)
    passing = [False] * len(simulation.bodies)
    places = places_of(simulation.bodies, simulation.grid, passing)
    joined = sharing(places, simulation.bodies, simulation.grid, passing)
    arrays = {field: array.numpy() for field, array in simulation._contact_arrays.items()}
    simulation.advance(1e-3)
    colour, count = arrays["colour"], len(places)
    assert count == len(arrays["first"])
    assert colour[0] == (~joined).sum()
    assert colour[-1] == count
    order, begin = coloured(places.chosen(joined), simulation.bodies, simulation.grid, passing)
    assert sorted(order) == list(range(joined.sum()))
    np.testing.assert_array_equal(begin + colour[0], colour)
    nodes = []
    for e in range(count):
        used = [
            int(arrays["first"][e]) + k * simulation.grid.rows + m
            for k in range(3)
            for m in range(3)
            if arrays["first"][e] >= 0 and arrays["weight_x"][e][k] * arrays["weight_y"][e][m] > 0.0
        ]
        nodes.append(set(used))
    for first, last in pairwise(colour):
        used = [node for e in range(first, last) for node in nodes[e]]
        assert len(used) == len(set(used))
    others = set().union(*nodes[colour[0] :])
    alone = [node for e in range(colour[0]) for node in nodes[e]]
    assert len(alone) == len(set(alone))
    assert others.isdisjoint(alone)


# -- several bodies ----------------------------------------------------------------------------------------------


def block(left, right, height):
    return Outline([[left, -1.0], [right, -1.0], [right, height], [left, height]])


# Undrained there is one velocity, as in a dry flow, and a liquid's pressure, as in a two-phase one.
@pytest.mark.parametrize(
    "formulation",
    [pytest.param("dry", marks=pytest.mark.slow), pytest.param("undrained", marks=pytest.mark.slow), "two_phase"],
)
def test_two_sliding_blocks_and_a_pillar(formulation):
    """A pool breaks out on both sides and shoves two blocks of different weight away; a pillar in its middle stands.

    Each sliding block's momentum is what the flow and its base gave to it, its base takes no more than friction can,
    and all impulses together are what the flow lost.
    """
    light, heavy = Sliding(500.0, 0.3), Sliding(2000.0, 0.1)
    bodies = [
        Body("left_block", block(-5.0, -4.05, 1.5), (Surface("left_block", 0.2),), light),
        Body("right_block", block(4.03, 5.0, 1.5), motion=heavy),
        Body("pillar", Outline(0.5 * CIRCLE + [0.0, 3.0]), (Surface("pillar", 0.4),)),
    ]
    simulation = basin(formulation, bodies=bodies, domain={"left_m": -12.0, "right_m": 12.0, "top_m": 6.0},
                       velocity=(0.0, 3.0))  # fmt: skip
    assert simulation.effects.sliding
    assert simulation.effects.passing
    impulse = {name: np.zeros(2) for name in ("left_block", "right_block", "pillar", "ground")}
    interval, told = 0.05, []
    for count in range(1, 13):
        simulation.advance(count * interval)
        sample = simulation.sample()
        told.append(sample)
        for name in impulse:
            impulse[name] += interval * np.array([sample[f"{name}_force_x"], sample[f"{name}_force_y"]])
    mass = simulation.points()["solid_mass"].sum() + simulation.points()["liquid_mass"].sum()
    scale = mass * 3.0
    for name, motion, sign in (("left_block", light, -1.0), ("right_block", heavy, 1.0)):
        number = [body.name for body in simulation.bodies].index(name)
        velocity = simulation.body_velocity(name)[0]
        base = simulation._read("base_impulse")[number]
        assert sign * velocity > 0.05
        assert sign * simulation.body_displacement(name)[0] > 0.01
        assert motion.mass * velocity == pytest.approx(impulse[name][0] + base, abs=1e-9 * scale)
        assert -sign * base <= motion.base_friction * (motion.mass * 9.81 * 0.6 - impulse[name][1]) + 1e-6 * scale
    assert simulation.body_velocity("pillar") == (0.0, 0.0)
    assert impulse["pillar"][1] > 0.0  # the pool was thrown up against it
    assert simulation.record["barrier_unconverged"] == 0
    # The flow's own momentum, against all impulses and its weight.
    last = told[-1]
    assert abs(last["momentum_residual_x"]) < 1e-9 * scale
    assert abs(last["momentum_residual_y"]) < 1e-9 * scale
    expected = np.array([0.0, mass * 3.0 - mass * 9.81 * 0.6]) - sum(impulse.values())
    np.testing.assert_allclose([last["momentum_x"], last["momentum_y"]], expected, atol=1e-9 * scale)
    depth = simulation.bodies[-1].outline.distance(simulation.points()["position"])
    assert depth.min() > -0.1 - 1e-9


def test_a_second_barrier_stays_while_the_grid_rides_with_the_first(load_scene):
    """The flow goes over a barrier that slides and meets a wall of the script behind it, which does not move."""
    behind = Body("second", block(12.0, 13.0, 3.0))
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 3.0, "barrier.shape.height_m": 2.0}
    changes |= {"barrier.shape": {"kind": "trapezoid", "base_width_m": 4.0, "crest_width_m": 2.0, "height_m": 1.5}}
    del changes["barrier.shape.height_m"]
    simulation = Simulation(load_scene("case_1", **changes), bodies=[behind])
    impulse, lowest = 0.0, 0.0
    for count in range(1, 31):
        simulation.advance(0.1 * count)
        sample = simulation.sample()
        impulse += 0.1 * sample["second_force_x"]
        lowest = min(lowest, behind.outline.distance(simulation.points()["position"]).min())
    assert simulation.barrier_displacement > 1.0
    assert simulation._grid_arrays["shift"].numpy()[0] == simulation.barrier_displacement
    assert simulation.body_displacement("second") == (0.0, 0.0)
    assert impulse > 1e4
    assert lowest > -0.25 - 1e-9
    assert abs(sample["momentum_residual_x"]) < 1e-9 * 81_000.0 * 10.0


def test_a_plate_pushes_a_pool():
    """A piston, driven by a function: it goes where it is told, and its work is force times way."""
    plate = Body(
        "plate", block(-4.5, -4.0, 4.0), (Surface("plate", 0.2),),
        motion=Driven.function(lambda t: (0.5 * np.sin(np.pi * t), 0.0), np.linspace(0.0, 1.0, 101)),
    )  # fmt: skip
    simulation = basin("two_phase", bodies=[plate], domain={"left_m": -8.0, "right_m": 4.0, "top_m": 6.0,
                                                            "right_edge": "wall"})  # fmt: skip
    assert not simulation.effects.sliding
    work, before = 0.0, 0.0
    for count in range(1, 101):
        simulation.advance(0.01 * count)
        way = simulation.body_displacement("plate")[0]
        sample = simulation.sample()
        work += sample["plate_force_x"] * (way - before)
        before = way
    assert before == pytest.approx(1.0 / np.pi, rel=1e-3)
    assert sample["plate_force_x"] < 0.0  # pushed back
    number = [body.name for body in simulation.bodies].index("plate")
    assert simulation._read("work")[number] == pytest.approx(work, rel=2e-2)
    assert abs(sample["momentum_residual_x"]) < 1e-6
    assert plate.outline.distance(simulation.points()["position"] - [before, 0.0]).min() > -0.1 - 1e-9


def test_a_run_with_bodies_goes_on_from_its_state():
    bodies = [
        Body("block", block(4.03, 5.0, 1.5), motion=Sliding(2000.0, 0.1)),
        Body("pillar", Outline(0.5 * CIRCLE + [0.0, 3.0]), motion=Driven((0.0, 1.0), ((0.0, 0.0), (0.0, -2.0)))),
    ]
    options = {"bodies": bodies, "domain": {"left_m": -8.0, "right_m": 12.0, "top_m": 6.0}}
    first, second = basin(**options), basin(**options)
    first.advance(0.2)
    second.restore_state(first.save_state())
    for simulation in (first, second):
        simulation.advance(0.4)
    assert first.sample() == second.sample()
    np.testing.assert_array_equal(first.points()["position"], second.points()["position"])
    assert first.body_displacement("pillar")[1] < 0.0


def test_the_script_of_the_guide(tmp_path):
    """A pillar and a plate of a script, in a run folder: forces on each, recorded and read again; and resumed."""
    found = importlib.util.spec_from_file_location("own_body", Path(__file__).parents[2] / "docs/develop/own_body.py")
    own_body = importlib.util.module_from_spec(found)
    found.loader.exec_module(own_body)
    results = own_body.main(tmp_path / "run", spacing=0.5, until=1.0)
    series = results.time_series
    for name in ("bow", "stern", "plate"):
        assert np.isfinite(series[f"{name}_force_x"]).all()
    assert series["bow_force_x"].max() > 5e4
    assert abs(series["stern_force_x"]).max() < series["bow_force_x"].max()
    assert results.frame().attrs["units"]["bow_force_x"] == "N/m"
    momentum = np.abs(series["momentum_x"]).max()
    assert np.abs(series["momentum_residual_x"]).max() < 1e-9 * momentum


# -- what is absent, what is wrong -------------------------------------------------------------------------------


def test_without_bodies_there_is_nothing_of_them():
    flying = scene("flies", box(0.0, 1.0, 1.0), "two_phase", end_time=0.1, ground=None, spacing_m=0.25)
    simulation = Simulation(flying)
    simulation.advance(0.01)
    assert not [name for name in simulation.arrays if name.startswith(("bodies", "contact"))]
    assert not {"press", "join"} & set(simulation.launched_kernels)
    smooth = Simulation(flying.replaced({"ground": {"friction": 0.0}}))
    absent = {"friction", "rubs", "displacement", "base_work"}
    assert not absent & {name.split(".")[-1] for name in smooth.arrays}
    assert "grid.liquid_alone" not in smooth.arrays


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Outline([[0, 0], [1, 1]]), "it needs 3 or more"),
        (lambda: Outline([[0, 0], [1, 1], [1, 0], [0, 1]]), "must not cross"),
        (lambda: Outline([[0, 0], [0, 0], [1, 0]], closed=False), "need a length"),
        (lambda: Outline([[0, 0], [np.nan, 1], [1, 0]]), "finite"),
        (lambda: Surface("Face"), "small letters"),
        (lambda: Surface("face", friction=-1.0), "from 0 to 10"),
        (lambda: Sliding(0.0, 0.1), "greater than 0"),
        (lambda: Driven((0.0, 0.0), ((0.0, 0.0), (1.0, 0.0))), "increase"),
        (lambda: Body("a", Outline(NOTCHED), (Surface("a", pieces=(0, 1)),)), "must belong to one surface"),
        (lambda: basin(bodies=[Body("ground", block(9, 10, 1))]), "more than one body"),
        (lambda: basin(bodies=[Body("in", block(0, 1, 1))]), "in holds 100 material points"),
    ],
)
def test_what_makes_no_body_is_refused_in_a_sentence(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()
