"""Scatter and gather of a few random points against sums written out in NumPy."""

from pathlib import Path

import numpy as np
import pytest

from warp_mpm.kernels import layout as at
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.simulator.step import launches

GRAVITY = np.array([0.3, -9.7])
TIME_STEP = 2e-4


def weights_and_slopes(simulation, position):
    """Splines [N, columns, rows] of every node at every point, and their gradient [N, columns, rows, 2] [1/m]."""
    x, y = simulation.grid.node_positions()
    spacing = simulation.grid.spacing

    def spline(r):
        a = np.abs(r)
        value = np.where(a < 0.5, 0.75 - a**2, np.where(a < 1.5, 0.5 * (1.5 - a) ** 2, 0.0))
        slope = np.where(a < 0.5, -2.0 * r, np.where(a < 1.5, -(1.5 - a) * np.sign(r), 0.0))
        return value, slope / spacing

    wx, dx = spline((position[:, :1] - x) / spacing)
    wy, dy = spline((position[:, 1:] - y) / spacing)
    weight = wx[:, :, None] * wy[:, None, :]
    return weight, np.stack([dx[:, :, None] * wy[:, None, :], wx[:, :, None] * dy[:, None, :]], axis=-1)


class Bench:
    """A simulation with a random state, whose kernels are launched one by one."""

    def __init__(self, scenario):
        changes = {
            "numerics.spacing_m": 0.5, "output.end_time_s": 0.2, "domain.left_m": -24.0, "domain.right_m": 13.0,
            "domain.top_m": 8.0, "gravity.tilt_deg": 1.0,
        }  # fmt: skip
        self.simulation = simulation = Simulation(scenario.replaced(changes))
        simulation._parameters.gravity = simulation._types.V2(*GRAVITY)
        self.material = simulation.scenario.flow.material
        self.two_phase = simulation.effects.two_phase
        self.number = number = simulation.material_points
        generator = np.random.default_rng(3)
        self.position = np.stack([generator.uniform(-17, -3, number), generator.uniform(0.5, 4.5, number)], axis=1)
        phases = 2 if self.two_phase else 1
        self.velocity = generator.normal(scale=5.0, size=(number, 2 * phases))
        self.stress = generator.normal(scale=2e4, size=(number, 4))
        self.reference = generator.uniform(0.05, 0.08, number)
        self.volume = self.reference * generator.uniform(0.9, 1.1, number)
        self.set(position=self.position, velocity=self.velocity, stress=self.stress, volume=self.volume)
        self.set(reference_volume=self.reference)
        self.pressure = np.zeros(number)
        if simulation.effects.liquid:
            self.pressure = generator.uniform(1e3, 3e4, number)
            self.set(liquid_strain=-self.pressure / self.material.liquid_bulk_modulus_Pa)
        self.viscous = generator.uniform(0.0, 3e3, number)
        self.set(viscous_pressure=self.viscous)
        self.affine = np.zeros((number, 2 * phases, 2))
        if simulation.effects.transfer in ("apic", "aflip"):
            self.affine = generator.normal(size=(number, 2 * phases, 2))
            self.set(affine_x=self.affine[:, :, 0], affine_y=self.affine[:, :, 1])
        clock = simulation._clock.numpy()
        clock[at.TIME_STEP] = TIME_STEP
        simulation._clock.assign(clock)
        self.density = np.repeat([self.material.solid_partial_density, self.material.liquid_partial_density], 2)
        self.density = self.density[: 2 * phases]
        self.weight, self.slope = weights_and_slopes(simulation, self.position)

    def set(self, **arrays):
        for name, values in arrays.items():
            self.simulation._point_arrays[name].assign(values)

    def get(self, name):
        return self.simulation._point_arrays[name].numpy()

    def launch(self, kernel):
        simulation = self.simulation
        (launch,) = (one for one in launches(simulation.effects) if one.kernel == kernel)
        if launch.over in ("points", "flow"):
            simulation._stepping.launch_over_points(launch)
            return
        arguments = [simulation._stepping.arguments[name] for name in launch.takes]
        simulation._stepping.launch(launch, simulation._stepping.counts[launch.over], arguments)

    def scatter(self):
        simulation = self.simulation
        for kernel in ("clear", "forget", "scatter"):
            self.launch(kernel)
        return {name: array.numpy() for name, array in simulation._grid_arrays.items()}

    def gather(self, velocity, gain=None):
        """From nodes that have `velocity` and, where the scheme asks for it, have gained `gain` of it in the step."""
        simulation = self.simulation
        simulation._grid_arrays["velocity"].assign(velocity)
        if gain is not None:
            step = simulation._clock.numpy()[at.TIME_STEP]
            kept = 1.0 - simulation._parameters.pic_rate * step
            simulation._grid_arrays["increment"].assign(velocity - kept * (velocity - gain))
        self.launch("gather")

    def internal_force(self):
        """Force [columns, rows, 2 phases] on the nodes [N/m], of each phase's total stress (audit, section 3.4)."""
        n = self.material.porosity if self.two_phase else 0.0
        pressure = self.pressure + self.viscous
        xx, yy, _, xy = self.stress.T
        tensor = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
        solid = tensor - (1.0 - n) * pressure[:, None, None] * np.eye(2)
        force = -np.einsum("p,pab,pijb->ija", self.volume, solid, self.slope)
        if self.two_phase:
            liquid = np.einsum("p,pija->ija", self.volume * n * pressure, self.slope)
            force = np.concatenate([force, liquid], axis=-1)
        return force


@pytest.fixture(scope="module")
def scenes():
    folder = Path(__file__).parents[2] / "scenarios"
    shipped = {name: Scenario.load(folder / f"{name}.json") for name in ("case_1", "case_1_dry")}
    # Of another scheme no other test needs the kernels: without bodies there are less to compile.
    return shipped | {"alone": shipped["case_1"].replaced({"barrier": None, "ground": None, "domain.bottom_m": -2.0})}


@pytest.fixture(scope="module")
def affine(scenes):
    return Bench(scenes["alone"].replaced({"numerics.transfer": "apic"}))


@pytest.fixture(scope="module", params=["case_1", "case_1_dry"])
def augmented(scenes, request):
    return Bench(scenes[request.param].replaced({"numerics.transfer": "aflip", "numerics.transfer_damping": 0.25}))


@pytest.fixture(scope="module")
def flip(scenes):
    """Without smoothing, which no scheme knows of."""
    changes = {"numerics.transfer": "flip", "numerics.pic_share": 0.25, "numerics.volumetric_smoothing": False}
    return Bench(scenes["alone"].replaced(changes))


def test_mass_and_momentum_with_the_forces_share_reach_the_nodes(affine):
    """APIC: a node receives the momentum at the end of the step, internal force and gravity included."""
    grid = affine.scatter()
    x, y = affine.simulation.grid.node_positions()
    node = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    away = node[None] - affine.position[:, None, None, :]
    field = affine.velocity[:, None, None, :] + np.einsum("pab,pijb->pija", affine.affine, away)
    field = field + TIME_STEP * np.tile(GRAVITY, 2)
    volume = np.einsum("p,pij->ij", affine.reference, affine.weight)
    momentum = np.einsum("p,pij,pija->ija", affine.reference, affine.weight, field) * affine.density
    momentum += TIME_STEP * affine.internal_force()
    np.testing.assert_allclose(grid["mass"], affine.density[0] * volume, atol=1e-14 * affine.density[0])
    # Until the nodes move, what becomes their velocity is their momentum.
    np.testing.assert_allclose(grid["velocity"], momentum, atol=1e-13 * np.abs(momentum).max())


def test_flip_keeps_momentum_and_force_apart(flip):
    grid = flip.scatter()
    momentum = np.einsum("p,pij,pa->ija", flip.reference, flip.weight, flip.velocity) * flip.density
    force = flip.internal_force()
    np.testing.assert_allclose(grid["velocity"], momentum, atol=1e-13 * np.abs(momentum).max())
    np.testing.assert_allclose(grid["force"], force, atol=1e-13 * np.abs(force).max())


def test_internal_forces_add_up_to_nothing(affine):
    """Action and reaction: per phase the forces of the points on the nodes sum to zero."""
    grid = affine.scatter()
    total = grid["velocity"].sum(axis=(0, 1))
    alone = affine.reference @ (affine.velocity + TIME_STEP * np.tile(GRAVITY, 2)) * affine.density
    scale = affine.reference @ np.abs(affine.velocity) * affine.density
    np.testing.assert_allclose(total, alone, atol=1e-12 * scale.max())


def test_only_blocks_with_material_are_in_use_and_all_are_emptied(affine):
    grid = affine.scatter()
    rows = affine.simulation.grid.rows // at.BLOCK
    listed = grid["active"][: grid["active_count"][0]]
    assert len(set(listed)) == len(listed)
    marked = np.zeros_like(grid["block"], dtype=bool)
    marked[listed // rows, listed % rows] = True
    touched = grid["mass"] > 0.0
    blocks = touched.reshape(marked.shape[0], at.BLOCK, marked.shape[1], at.BLOCK).any(axis=(1, 3))
    np.testing.assert_array_equal(marked, blocks)
    np.testing.assert_array_equal(affine.scatter()["mass"], grid["mass"])  # nothing of before is left


def of_the_middle(gradient):
    """Gradients [N, 2 phases, 2] of the velocities, in the places where half a step takes the points."""
    middle = np.linalg.inv(np.eye(2) + 0.5 * TIME_STEP * gradient[:, :2])
    return np.einsum("pab,pbc->pac", gradient, middle)


def random_velocities(bench, seed=5):
    grid = bench.simulation.grid
    return np.random.default_rng(seed).normal(size=(grid.columns, grid.rows, bench.velocity.shape[1]))


def test_gather_brings_velocity_gradient_and_affine_field(affine):
    nodes = random_velocities(affine)
    affine.scatter()  # empties the corners
    affine.gather(nodes)
    gradient = np.einsum("pija,ijb->pba", affine.slope, nodes)  # [p, component, direction]
    np.testing.assert_allclose(affine.get("velocity"), np.einsum("pij,ija->pa", affine.weight, nodes), atol=1e-14)
    solid = of_the_middle(gradient)[:, :2].reshape(-1, 4)
    np.testing.assert_allclose(affine.get("gradient"), solid, atol=1e-12)
    x, y = affine.simulation.grid.node_positions()
    node = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    away = node[None] - affine.position[:, None, None, :]
    # C = sum w v (x_i - x_p) 4 / d^2, Jiang et al. (2015) for quadratic splines.
    field = np.einsum("pij,ija,pijb->pab", affine.weight, nodes, away) * 4.0 / affine.simulation.grid.spacing**2
    np.testing.assert_allclose(affine.get("affine_x"), field[:, :, 0], atol=1e-12)
    np.testing.assert_allclose(affine.get("affine_y"), field[:, :, 1], atol=1e-12)


def test_corners_receive_volume_strain_rates_and_excess_pressure(affine):
    """Each corner the sums over the points around, by bilinear hats; it lies half a cell beyond its node."""
    nodes = random_velocities(affine)
    affine.scatter()  # empties the corners
    affine.gather(nodes)
    spacing = affine.simulation.grid.spacing
    x, y = (nodes + 0.5 * spacing for nodes in affine.simulation.grid.node_positions())
    hat_x, hat_y = (
        np.maximum(1.0 - np.abs(affine.position[:, k : k + 1] - at_) / spacing, 0.0) for k, at_ in enumerate((x, y))
    )
    volume = np.einsum("p,pi,pj->pij", affine.reference, hat_x, hat_y)
    gradient = of_the_middle(np.einsum("pija,ijb->pba", affine.slope, nodes))
    divergence = gradient[:, ::2, 0] + gradient[:, 1::2, 1]  # of solid and liquid
    excess = affine.pressure - affine.material.liquid_density_kg_per_m3 * affine.position @ GRAVITY
    corner = affine.simulation._grid_arrays["corner"].numpy()
    for place, values in ((0, np.ones(affine.number)), (1, divergence[:, 0]), (2, excess), (4, divergence[:, 1])):
        expected = np.einsum("pij,p->ij", volume, values)
        np.testing.assert_allclose(corner[..., place], expected, atol=1e-12 * np.abs(expected).max())


def test_without_smoothing_a_point_keeps_its_own_liquid_divergence(flip):
    nodes = random_velocities(flip)
    flip.gather(nodes)
    gradient = of_the_middle(np.einsum("pija,ijb->pba", flip.slope, nodes))
    np.testing.assert_allclose(flip.get("liquid_divergence"), gradient[:, 2, 0] + gradient[:, 3, 1], atol=1e-11)


def test_a_linear_velocity_field_arrives_as_it_is(affine):
    x, y = affine.simulation.grid.node_positions()
    node = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    slope = np.array([[0.5, -2.0], [1.5, 0.25], [-1.0, 0.75], [3.0, -0.5]])
    affine.gather(1.0 + node @ slope.T)
    np.testing.assert_allclose(affine.get("velocity"), 1.0 + affine.position @ slope.T, atol=1e-12)
    middle = np.tile(of_the_middle(slope[None])[0, :2].ravel(), (affine.number, 1))
    np.testing.assert_allclose(affine.get("gradient"), middle, atol=1e-11)


def test_flip_adds_the_increment_and_the_given_share_of_the_grids_velocity(flip):
    flip.set(velocity=flip.velocity)
    nodes, increment = random_velocities(flip), random_velocities(flip, seed=6)
    flip.gather(nodes, increment)
    smooth = np.einsum("pij,ija->pa", flip.weight, nodes)
    kept = flip.velocity + np.einsum("pij,ija->pa", flip.weight, increment)
    share = 0.25 * TIME_STEP * flip.simulation._limits.sound_speed / flip.simulation.grid.spacing
    np.testing.assert_allclose(flip.get("velocity")[:, :2], (kept + share * (smooth - kept))[:, :2], atol=1e-13)


def gathered(bench, nodes, increment):
    """Velocity and affine field, columns along x and y, after a gather from those at the start."""
    bench.set(velocity=bench.velocity, affine_x=bench.affine[:, :, 0], affine_y=bench.affine[:, :, 1])
    bench.gather(nodes, increment)
    return bench.get("velocity"), np.stack([bench.get("affine_x"), bench.get("affine_y")], axis=-1)


def means_and_moments(bench, nodes):
    """Of a field at the nodes [columns, rows, k]: mean [N, k] at the points, and slope by moments [N, k, 2]."""
    x, y = bench.simulation.grid.node_positions()
    away = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)[None] - bench.position[:, None, None, :]
    mean = np.einsum("pij,ija->pa", bench.weight, nodes)
    slope = np.einsum("pij,ija,pijb->pab", bench.weight, nodes, away) * 4.0 / bench.simulation.grid.spacing**2
    return mean, slope


def test_aflip_gains_what_the_nodes_gain_and_is_drawn_to_what_they_have(augmented):
    bench = augmented
    nodes, increment = random_velocities(bench), random_velocities(bench, seed=6)
    velocity, affine = gathered(bench, nodes, increment)
    (mean, slope), (gain, gain_slope) = means_and_moments(bench, nodes), means_and_moments(bench, increment)
    speed = bench.simulation._limits.sound_speed + bench.simulation.scenario.flow.speed
    share = 0.25 * TIME_STEP * speed / bench.simulation.grid.spacing
    kept = bench.velocity + gain
    kept += share * (mean - kept)
    np.testing.assert_allclose(velocity[:, :2], kept[:, :2], atol=1e-12)
    if bench.two_phase:
        # Drag acts on what the nodes do not see of the phases' relative velocity.
        decay = 1.0 / (1.0 + TIME_STEP * bench.simulation._parameters.drag_rate)
        relative, seen = kept[:, 2:] - kept[:, :2], mean[:, 2:] - mean[:, :2]
        expected = kept[:, :2] + seen + decay * (relative - seen)
        np.testing.assert_allclose(velocity[:, 2:], expected, atol=1e-12)
    expected = bench.affine + gain_slope
    expected += share * (slope - expected)
    for a in range(0, expected.shape[1], 2):
        C = expected[:, a : a + 2]
        rotation = np.maximum(np.linalg.det(C), 0.0)[:, None, None]
        spread = np.maximum(np.trace(C, axis1=1, axis2=2), 0.0)[:, None, None]
        moved = (C + TIME_STEP * rotation * np.eye(2)) / (1.0 + TIME_STEP * spread + TIME_STEP**2 * rotation)
        np.testing.assert_allclose(affine[:, a : a + 2], moved, atol=1e-11)


def test_aflip_takes_part_in_the_work_of_the_nodes_without_loss(scenes):
    """In the limit of short steps: the energy of points and affine fields changes by the work on the nodes."""
    bench = Bench(scenes["case_1_dry"].replaced({"numerics.transfer": "aflip", "numerics.transfer_damping": 0.0}))
    clock = bench.simulation._clock.numpy()
    clock[at.TIME_STEP] = 0.0
    bench.simulation._clock.assign(clock)
    momentum = bench.scatter()["velocity"].copy()
    increment = random_velocities(bench, seed=6)
    velocity, affine = gathered(bench, random_velocities(bench), increment)
    spread = 0.25 * bench.simulation.grid.spacing**2
    each = (bench.velocity * (velocity - bench.velocity)).sum(axis=1)
    each += spread * (bench.affine * (affine - bench.affine)).sum(axis=(1, 2))
    power = bench.density[0] * bench.reference @ each
    assert power == pytest.approx((momentum * increment).sum(), rel=1e-10)


def test_affine_transfer_conserves_linear_and_angular_momentum(affine):
    """To the grid and back, without gravity: the momentum of the affine fields themselves included."""
    bench, spacing = affine, affine.simulation.grid.spacing
    bench.set(velocity=bench.velocity, affine_x=bench.affine[:, :, 0], affine_y=bench.affine[:, :, 1])

    def momenta(velocity, affine):
        linear = bench.reference @ velocity
        angular = []
        for a in (0, 2):
            orbital = bench.position[:, 0] * velocity[:, a + 1] - bench.position[:, 1] * velocity[:, a]
            spin = 0.25 * spacing**2 * (affine[:, a + 1, 0] - affine[:, a, 1])
            angular.append(bench.reference @ (orbital + spin))
        return np.concatenate([linear, angular])

    before = momenta(bench.velocity, bench.affine)
    bench.simulation._parameters.gravity = bench.simulation._types.V2(0.0, 0.0)
    try:
        grid = bench.scatter()
    finally:
        bench.simulation._parameters.gravity = bench.simulation._types.V2(*GRAVITY)
    # Of one material, whose phases' masses are in the ratio of their densities everywhere.
    mass = grid["mass"][..., None] * bench.density / bench.density[0]
    # The internal forces ride along; of symmetric stresses they conserve both momenta too.
    bench.gather(np.divide(grid["velocity"], mass, out=np.zeros_like(grid["velocity"]), where=mass > 0.0))
    after = momenta(bench.get("velocity"), np.stack([bench.get("affine_x"), bench.get("affine_y")], axis=-1))
    scale = bench.reference @ np.abs(bench.velocity).max(axis=1) * np.abs(bench.position).max()
    np.testing.assert_allclose(after, before, atol=1e-12 * scale)
