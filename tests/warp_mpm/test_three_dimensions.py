"""Three dimensions: the same kernels, with another number of components.

A dry block falls onto the ground, a saturated one rests in a box, and a section that is drawn along z between smooth
walls does what it does in the plane.
"""

import importlib.util
import math
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from warp_mpm.channel import Channel
from warp_mpm.effect_rules import derive_effects
from warp_mpm.effects import Effects
from warp_mpm.kernels.build import build_kernels
from warp_mpm.kernels.elementary import make_elementary
from warp_mpm.kernels.layout import layout
from warp_mpm.kernels.vectors import make_vectors
from warp_mpm.quantities import TIME_SERIES
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.simulator.bodies import Body
from warp_mpm.simulator.bodies.outline import Outline
from warp_mpm.simulator.laws.law import all_functions

ROOT = Path(__file__).parents[2]
GRAVITY = 9.81
SOIL = {
    "grain_density_kg_per_m3": 2650.0,
    "porosity": 0.4,
    "young_modulus_Pa": 1e6,
    "poisson_ratio": 0.3,
    "friction_angle_deg": 30.0,
}
WET = SOIL | {"liquid_density_kg_per_m3": 1000.0, "liquid_bulk_modulus_Pa": 2e7}
MATERIALS = {"dry": SOIL, "undrained": WET, "two_phase": WET | {"hydraulic_conductivity_m_per_s": 0.01}}
BOX = {"left_edge": "wall", "right_edge": "wall", "left_m": -1.0, "right_m": 0.0, "top_m": 2.0}


def section(formulation="dry", *, corners, friction=0.0, domain=None, flow=None, material=None, **numerics):
    """A scene with a ground and a flow that fills the box between two corners."""
    (x0, y0), (x1, y1) = corners
    return Scenario.model_validate(
        {
            "title": "Block",
            "flow": {
                "formulation": formulation,
                "shape": {"kind": "polygon", "vertices_m": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]},
                "velocity_m_per_s": [0.0, 0.0],
                "material": MATERIALS[formulation] | (material or {}),
            }
            | (flow or {}),
            "ground": {"friction": friction},
            "domain": domain or {"left_m": -2.5, "right_m": 1.5, "top_m": 3.0},
            "numerics": {"spacing_m": 0.25} | numerics,
            "output": {"end_time_s": 1.0},
        }
    )


# -- tensors -------------------------------------------------------------------------------------------------------


def as_matrix(tensor):
    """[N, 3, 3] of the components [N, 6] or, in the plane, [N, 4]."""
    xx, yy, zz, xy, yz, xz = np.concatenate([tensor, np.zeros((len(tensor), 6 - tensor.shape[1]))], axis=1).T
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


def as_tensor(matrix):
    return np.stack([matrix[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))], axis=1)


@pytest.fixture(scope="module")
def law():
    """Function of material, dimensions, stresses and gradients: what a step makes of the stresses, and the opening."""
    built = {}

    def build(dimensions):
        effects = Effects("dry", dimensions=dimensions)
        types = layout(effects)
        T, G, F, Points, Parameters = types.T, types.G, types.scalar, types.Points, types.Parameters
        functions = all_functions(effects.skeleton, types, make_elementary(types))
        trial, back, trace = functions["trial"], functions["back"], make_vectors(types).trace

        @wp.kernel(module="unique", enable_backward=False)
        def step(
            points: Points, stress: wp.array(dtype=T), gradient: wp.array(dtype=G), opened: wp.array(dtype=F),
            time_step: F, parameters: Parameters,
        ):  # fmt: skip
            p = wp.tid()
            g = gradient[p]
            s, _ = trial(points, p, stress[p], g, trace(g) * time_step, time_step, parameters)
            s, opening = back(points, p, s, g, F(1.0), time_step, parameters)
            stress[p] = s
            opened[p] = opening

        return effects, types, step

    def run(dimensions, stress, gradient, **soil):
        if dimensions not in built:
            built[dimensions] = build(dimensions)
        effects, types, step = built[dimensions]
        material = section(corners=((-1.0, 0.0), (0.0, 1.0)), material=soil).flow.material
        parameters = types.Parameters()
        numbers = {name: getattr(material, name) for name in ("shear_modulus", "bulk_modulus")}
        for name, value in (effects.skeleton.numbers(material) | numbers | {"lame": material.lame_modulus}).items():
            setattr(parameters, name, value)
        out = wp.array(stress, dtype=types.T, device="cpu")
        opened = wp.zeros(len(stress), dtype=wp.float64, device="cpu")
        rates = wp.array(gradient.reshape(len(stress), -1), dtype=types.G, device="cpu")
        wp.launch(step, len(stress), [types.Points(), out, rates, opened, 1e-3, parameters], device="cpu")
        return out.numpy(), opened.numpy()

    return run


SOILS = (
    {},
    {"cohesion_Pa": 5e3, "tension_cutoff_Pa": 2e3, "dilatancy_angle_deg": 10.0},
    {"cohesion_Pa": 1e9, "tension_cutoff_Pa": 1e9},  # elastic
)


@pytest.mark.parametrize("soil", SOILS)
def test_the_law_in_space_is_that_of_the_plane(law, soil):
    random = np.random.default_rng(1)
    stress = random.normal(-5e3, 1e4, (400, 4))
    stress[:40, 2] = stress[:40, 0]  # two principal stresses that are alike
    stress[:40, 3] = 0.0
    stress[40:80] = 0.0
    gradient = random.normal(0.0, 3.0, (400, 2, 2))
    deep = np.zeros((400, 3, 3))
    deep[:, :2, :2] = gradient
    flat, opened = law(2, stress, gradient, **soil)
    space, opened_in_space = law(3, np.concatenate([stress, np.zeros((400, 2))], axis=1), deep, **soil)
    scale = np.abs(flat).max()
    # Rounding, of the rotations by which the principal stresses are found and undone.
    np.testing.assert_allclose(space[:, :4], flat, rtol=0.0, atol=1e-13 * scale)
    np.testing.assert_array_equal(space[:, 4:], 0.0)
    np.testing.assert_allclose(opened_in_space, opened, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("soil", SOILS)
def test_the_law_in_space_knows_no_axis(law, soil):
    """Turned stresses and velocities give turned stresses."""
    random = np.random.default_rng(2)
    stress, gradient = random.normal(-5e3, 1e4, (400, 6)), random.normal(0.0, 3.0, (400, 3, 3))
    turn = np.linalg.qr(random.normal(size=(400, 3, 3)))[0]
    back = turn.transpose(0, 2, 1)
    first, opened = law(3, stress, gradient, **soil)
    turned = law(3, as_tensor(turn @ as_matrix(stress) @ back), turn @ gradient @ back, **soil)
    scale = np.abs(first).max()
    np.testing.assert_allclose(turned[0], as_tensor(turn @ as_matrix(first) @ back), rtol=0.0, atol=1e-12 * scale)
    np.testing.assert_allclose(turned[1], opened, rtol=0.0, atol=1e-12)


def test_the_gradient_in_the_middle_of_the_step():
    """L (I + Δt L / 2)⁻¹, and the trace of the liquid's own likewise."""
    types = layout(Effects("two_phase", dimensions=3))
    V, G, F, midway = types.V, types.G, types.scalar, make_vectors(types).midway

    @wp.kernel(module="unique", enable_backward=False)
    def look(slopes: wp.array2d(dtype=V), time_step: F, solid: wp.array(dtype=G), liquid: wp.array(dtype=F)):
        p = wp.tid()
        gradient, divergence = midway(slopes[p, 0], slopes[p, 1], slopes[p, 2], time_step)
        solid[p] = gradient
        liquid[p] = divergence

    rates = np.random.default_rng(3).normal(0.0, 30.0, (100, 2, 3, 3))  # of both phases: component, axis
    time_step = 5e-3
    slopes = wp.array(rates.transpose(0, 3, 1, 2).reshape(100, 3, 6), dtype=V, device="cpu")
    solid, liquid = wp.zeros(100, dtype=G, device="cpu"), wp.zeros(100, dtype=F, device="cpu")
    wp.launch(look, 100, [slopes, time_step, solid, liquid], device="cpu")
    inverse = np.linalg.inv(np.eye(3) + 0.5 * time_step * rates[:, 0])
    np.testing.assert_allclose(solid.numpy().reshape(100, 3, 3), rates[:, 0] @ inverse, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(liquid.numpy(), np.trace(rates[:, 1] @ inverse, axis1=1, axis2=2), rtol=0.0, atol=1e-11)


# -- a dry block falls onto the ground -----------------------------------------------------------------------------


def falling():
    """The cube of `docs/develop/falling_block.py`, in the middle of a channel too wide for it."""
    place = importlib.util.spec_from_file_location("falling_block", ROOT / "docs/develop/falling_block.py")
    script = importlib.util.module_from_spec(place)
    place.loader.exec_module(script)
    return script.falling()


@pytest.fixture(scope="module")
def fall():
    simulation = falling()
    start = simulation.points()["position"]
    samples = [simulation.sample()]
    for time in np.linspace(0.0, 3.0, 31)[1:]:
        simulation.advance(float(time))
        samples.append(simulation.sample())
    return SimpleNamespace(simulation=simulation, start=start, samples=samples)


def test_a_block_falls_freely_and_lands(fall):
    mass = fall.simulation.points()["solid_mass"].sum()
    assert mass == pytest.approx(0.6 * 2650.0, rel=1e-12)  # a cubic metre, whatever the width of the channel
    before, landed = fall.samples[2], math.sqrt(2.0 * 0.5 / GRAVITY)
    assert before["time"] < landed < fall.samples[4]["time"]
    assert before["momentum_y"] == pytest.approx(-mass * GRAVITY * 0.2, rel=1e-12)
    assert before["flow_kinetic_energy"] == pytest.approx(0.5 * mass * (GRAVITY * 0.2) ** 2, rel=1e-12)
    assert before["ground_force_y"] == 0.0
    assert fall.samples[4]["ground_force_y"] < -2.0 * mass * GRAVITY


def test_its_momentum_and_energy_are_accounted_for(fall):
    scale = 0.6 * 2650.0 * GRAVITY * 3.0
    for sample in fall.samples:
        for axis in "xyz":
            assert abs(sample[f"momentum_residual_{axis}"]) < 1e-13 * scale
    energy = [
        sum(sample[f"flow_{kind}_energy"] for kind in ("kinetic", "gravitational", "elastic"))
        for sample in fall.samples
    ]
    # It swings on the ground, and its energy is told half a step off: 0.6 % at most, in the plane 0.8 %.
    assert (np.diff(energy) < 0.01 * energy[0]).all()
    assert energy[-1] < 0.7 * energy[0]


def test_it_comes_to_rest_and_the_ground_bears_it(fall):
    weight = 0.6 * 2650.0 * GRAVITY
    last = fall.samples[-1]
    # It swings on its elasticity, less and less: over the last half second the mean is the weight.
    assert last["flow_kinetic_energy"] < 1e-3 * max(sample["flow_kinetic_energy"] for sample in fall.samples)
    force = np.mean([sample["ground_force_y"] for sample in fall.samples[-5:]])
    assert force == pytest.approx(-weight, rel=0.01)
    position = fall.simulation.points()["position"]
    assert position[:, 1].min() > 0.0
    assert 0.5 < position[:, 1].mean() < 0.6  # it is squeezed a little, and a gap of half a cell is the grid's


def test_no_horizontal_direction_is_another(fall):
    """The mirror images of the cube, and the one across its diagonal, to what rounding has grown to."""
    middle = np.array([-0.5, 0.0, 1.5])
    start, end = fall.start - middle, fall.simulation.points()["position"] - middle

    def image(places):
        return np.lexsort(np.round(places * 64.0).T)

    own = image(start)
    for flip in (np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, 1.0, -1.0]), np.eye(3)[[2, 1, 0]]):
        other = image(start @ flip)
        np.testing.assert_allclose((end @ flip)[other], end[own], rtol=0.0, atol=1e-12)
    for sample in fall.samples:
        for axis in "xz":
            assert abs(sample[f"ground_force_{axis}"]) < 1e-12 * 0.6 * 2650.0 * GRAVITY


def test_its_state_is_kept_and_belongs_to_its_channel(fall):
    simulation = falling()
    simulation.advance(0.4)
    state = simulation.save_state()
    simulation.advance(0.5)
    again = falling()
    again.restore_state(state)
    again.advance(0.5)
    np.testing.assert_array_equal(again.points()["position"], simulation.points()["position"])
    wider = Simulation(simulation.scenario, channel=Channel(width=3.5, flow=(1.0, 2.0)))
    with pytest.raises(ValueError, match="it belongs to another scene"):
        wider.restore_state(state)


# -- a section that is drawn along z -------------------------------------------------------------------------------


def pair(scene, width):
    return Simulation(scene), Simulation(scene, channel=Channel(width=width))


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["dry", "undrained", "two_phase"])
def test_a_collapse_in_a_channel_is_that_of_the_plane(formulation):
    """To the error of the scheme: volumes that are averaged over the grid spread over three directions, not two, and a
    few sweeps find the friction in the corners. It takes the kernels of the falling block."""
    scene = section(
        formulation,
        corners=((-2.0, 0.0), (0.0, 2.0)),
        friction=0.4,
        domain={"left_edge": "wall", "left_m": -2.0, "right_m": 4.0, "top_m": 4.0},
    )
    plane, space = pair(scene, 0.5)
    for time in (0.25, 0.5):
        plane.advance(time)
        space.advance(time)
        flat, deep = plane.sample(), space.sample()
        for name, tolerance in (
            ("solid_mass", 1e-12),
            ("flow_kinetic_energy", 5e-3),
            ("flow_gravitational_energy", 1e-3),
            ("momentum_x", 5e-3),
            ("ground_force_y", 5e-3),
            ("ground_force_x", 3e-2),
        ):
            assert deep[name] / 0.5 == pytest.approx(flat[name], rel=tolerance), name
    layers = space.points()["position"].reshape(4, -1, 3)
    np.testing.assert_allclose(layers[:, :, :2], np.tile(plane.points()["position"], (4, 1, 1)), rtol=0.0, atol=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize(("formulation", "transfer"), [("dry", "aflip"), ("undrained", "flip"), ("two_phase", "apic")])
def test_waves_in_a_closed_channel_are_those_of_the_plane(formulation, transfer):
    """To rounding, while the soil yields: nothing is averaged, no wall is left, nothing opens."""
    plain = {"volumetric_smoothing": False, "density_correction": 0.0, "pressure_relaxation": 0.0}
    scene = section(
        formulation,
        corners=((-1.0, 0.0), (0.0, 1.0)),
        domain=BOX | {"top_edge": "wall", "top_m": 1.0},
        transfer=transfer,
        **plain,
    )
    plane, space = pair(scene, 0.5)
    x, y = plane.points()["position"].T
    stress = -4e4 + np.stack([5e3 * np.cos(np.pi * x), 2e4 * np.cos(np.pi * y), 0.0 * x, 8e3 * x * y], axis=1)
    stress[:, 3] += 4e4
    state = {"effective_stress": stress}
    if formulation != "dry":
        state["pore_pressure"] = 3e4 + 1e4 * x * y
    plane.set_points(**state)
    deep = {name: np.concatenate([values] * 4) for name, values in state.items()}
    deep["effective_stress"] = np.concatenate([deep["effective_stress"], np.zeros((4 * len(x), 2))], axis=1)
    space.set_points(**deep)
    until = 0.2 if formulation == "dry" else 0.03  # sound in a liquid is faster, and dies away sooner
    plane.advance(until)
    space.advance(until)
    assert plane.steps > 20
    flat, there = plane.points(), space.points()
    for name, values in flat.items():
        if name in ("solid_mass", "liquid_mass", "volume"):
            values = 0.125 * values
        found = there[name].reshape(4, len(x), *there[name].shape[1:])
        components = values.shape[1] if values.ndim > 1 else None
        scale = np.abs(values).max()
        for layer in found:
            plain_part = layer if components is None else layer[:, :components]
            np.testing.assert_allclose(plain_part, values, rtol=0.0, atol=1e-10 * scale, err_msg=name)
    assert np.abs(flat["solid_velocity"]).max() > 0.01  # it has not come to rest yet
    assert flat["deviatoric_strain"].max() > 2e-3
    assert np.abs(there["solid_velocity"][:, 2]).max() < 1e-10


# -- a saturated block rests in a box ------------------------------------------------------------------------------


def saturated(spacing, **flow):
    scene = section("two_phase", corners=((-1.0, 0.0), (0.0, 1.0)), domain=BOX, flow=flow, spacing_m=spacing)
    return Simulation(scene, channel=Channel(width=1.0))


def pressure_error(simulation):
    """Of the pore pressures of the N points over that of the depth of 1 m [N]."""
    points = simulation.points(["position", "pore_pressure"])
    return points["pore_pressure"] / (1000.0 * GRAVITY) - (1.0 - points["position"][:, 1])


@pytest.mark.slow
def test_a_saturated_block_rests_under_hydrostatic_pressure():
    """Pressures of points scatter about the hydrostatic ones as the points do about the cells: by a share of a cell's
    own pressure difference, so that the error falls with the cells. The mean is exact to second order."""
    errors = []
    for spacing in (0.25, 0.125):
        simulation = saturated(spacing)
        simulation.advance(0.1)
        sample, error = simulation.sample(), pressure_error(simulation)
        errors.append((np.abs(error).max(), np.sqrt(np.mean(error**2))))
        assert abs(np.mean(error)) < 0.05 * spacing**2 / 0.0625
        assert sample["speed_max"] < 1e-3 * math.sqrt(GRAVITY)
        weight = sum(simulation.points()[name].sum() for name in ("solid_mass", "liquid_mass")) * GRAVITY
        assert sample["ground_force_y"] == pytest.approx(-weight, rel=1e-3)
        stress = simulation.points(["effective_stress"])["effective_stress"]
        # What the walls' sweeps leave in the corners is not the same along x and z.
        np.testing.assert_allclose(stress[:, 2], stress[:, 0], rtol=0.0, atol=3e-3 * np.abs(stress).max())
    assert errors[0][0] < 0.04
    assert errors[1][0] < 0.02
    assert errors[1][1] < 0.6 * errors[0][1]


@pytest.mark.slow
def test_a_liquefied_block_drains_until_its_pressure_is_hydrostatic():
    """It begins with nearly all of its weight borne by the liquid."""
    simulation = saturated(0.25, initial_pore_pressure_ratio=0.9)
    assert np.abs(pressure_error(simulation)).max() > 0.6
    simulation.advance(2.0)
    assert np.abs(pressure_error(simulation)).max() < 0.045
    assert simulation.sample()["speed_max"] < 1e-3 * math.sqrt(GRAVITY)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "darwin", reason="Warp comes without CUDA there")
def test_the_kernels_of_space_compile_for_a_gpu(tmp_path):
    scene = section("undrained", corners=((-1.0, 0.0), (0.0, 1.0)), friction=0.4)
    effects = Simulation(scene, channel=Channel(width=1.0)).effects
    assert effects.dimensions == 3
    build_kernels(effects)
    wp.compile_aot_module(wp.get_module(effects.module_name), arch=[80], module_dir=tmp_path, use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    assert ".entry" in code.read_text()


# -- what is there, and what is not --------------------------------------------------------------------------------


def test_units_are_those_of_the_whole():
    scene = section(corners=((-1.0, 0.0), (0.0, 1.0)))
    plane, space = pair(scene, 1.0)
    assert plane.units["ground_force_x"] == "N/m"
    assert space.units["ground_force_x"] == space.units["ground_force_z"] == "N"
    assert space.units["flow_kinetic_energy"] == "J"
    assert space.units["solid_mass"] == "kg"
    assert space.units["momentum_z"] == "N s"
    assert space.units["speed_max"] == plane.units["speed_max"] == "m/s"
    assert "momentum_z" not in plane.units
    assert TIME_SERIES["impact_force_x"].in_dimensions(3).title == "horizontal impact force F₂,x [kN]"


LABELS = (
    *("quantities", "report", "plotting", "terminal.py", "design_checks.py", "caveats.py", "fields.py", "animation.py"),
)


def test_no_label_has_a_metre_of_width_of_its_own():
    """That a unit is per metre of width is said by `quantity.of_width` alone."""
    found = []
    for view in LABELS:
        place = ROOT / "warp_mpm" / view
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            code = re.sub(r'""".*?"""|#.*', "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
            found += [f"{path.name}: {hit}" for hit in re.findall(r"\b(?:k?N|k?J|kg|t|m3|m³)(?: [sm])?/m\b(?!³)", code)]
    assert found == []


def test_the_plane_is_not_another_set_of_kernels():
    effects = derive_effects(section(corners=((-1.0, 0.0), (0.0, 1.0))))
    assert effects.dimensions == 2
    assert "space" not in effects.module_name


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ({"width": 0.3}, r"channel.width = 0.3 must be a multiple of numerics.spacing_m = 0.25"),
        ({"width": 0.0}, r"channel.width = 0 must be"),
        ({"width": math.inf}, r"channel.width = inf must be"),
        ({"width": 1.0, "flow": (0.5, 1.5)}, r"channel.flow = \(0.5, 1.5\) must be two places from 0 to"),
        ({"width": 1.0, "flow": (0.5, 0.5)}, r"channel.flow = \(0.5, 0.5\) must be two places from 0 to"),
    ],
)
def test_channels_that_are_refused(channel, message):
    with pytest.raises(ValueError, match=message):
        Simulation(section(corners=((-1.0, 0.0), (0.0, 1.0))), channel=Channel(**channel))


MUD = {"law": "herschel_bulkley", "yield_stress_Pa": 300.0, "consistency_Pa_s": 50.0}


@pytest.mark.parametrize(
    ("name", "changes", "told"),
    [
        ("case_1", {}, "a barrier"),
        ("case_1_mud", {"barrier": None}, "flow.material.law = herschel_bulkley"),
        ("case_1_dry", {"barrier": None, "domain.right_edge": "wall", "domain.right_m": 5.1}, "domain.right_m = 5.1"),
        (
            "case_1_dry",
            {"barrier": None, "ground": {"profile_m": [[-30.0, 0.0], [0.0, 0.0], [20.0, -1.0]]}},
            "a ground that is not level",
        ),
        ("case_1_dry", {"barrier": None, "flow.base_velocity_share": 0.5}, "a velocity that varies over the depth"),
    ],
)
def test_what_is_not_there_in_space_is_refused(load_scene, name, changes, told):
    scene = load_scene(name, **{"numerics.spacing_m": 0.5} | changes)
    with pytest.raises(ValueError, match=told) as refused:
        Simulation(scene, channel=Channel(width=1.0))
    assert "is not there in three dimensions yet" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_bodies_of_a_script_and_velocities_are_refused_in_space():
    scene = section(corners=((-1.0, 0.0), (0.0, 1.0)))
    pillar = Body("pillar", Outline([[0.5, 0.0], [0.5, 1.0], [1.0, 1.0], [1.0, 0.0]]))
    with pytest.raises(ValueError, match="the body 'pillar' of a script is not there in three dimensions yet"):
        Simulation(scene, channel=Channel(width=1.0), bodies=[pillar])
    simulation = Simulation(scene, channel=Channel(width=1.0))
    velocity = np.zeros_like(simulation.points()["solid_velocity"])
    with pytest.raises(ValueError, match="set_points knows no velocities in three dimensions yet"):
        simulation.set_points(solid_velocity=velocity)
