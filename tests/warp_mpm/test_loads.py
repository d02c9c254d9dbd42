"""Where the flow acts on the barrier: exact at rest, in sum what the reactions are; pressures that mean something."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.kernels import layout as at
from warp_mpm.plotting import loads_by_height
from warp_mpm.plotting.loads import patches
from warp_mpm.recording import LoadsRecorder, TimeSeriesRecorder
from warp_mpm.report import write_report
from warp_mpm.results import Results, ResultsError, read_loads
from warp_mpm.run import resume_run, run_in_memory, run_scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.simulator.bodies.loads import Patches, slots_of
from warp_mpm.state.loads import LoadsNow
from warp_mpm.state.samples import Window
from warp_mpm.terminal import summary_rows
from warp_mpm.validation.at_rest import DEPTH, G, pool
from warp_mpm.validation.scenes import INVISCID

DENSITY = 1800.0
"""Of the mixture at rest [kg/m³]."""


def normal_of(simulation, since=None):
    """Total impulses [n] on the slots of the face since a mark, along their normal."""
    taken = np.array(simulation.window().taken) - (np.array(since.taken) if since else 0.0)
    taken = taken.reshape(-1, at.SLOT_SIZE)[simulation.slots["barrier"].face.slots]
    return taken[:, at.SLOT_NORMAL] + (taken[:, at.SLOT_LIQUID] if simulation.effects.two_phase else 0.0)


# The mixture rests without strength, as a fluid. The quadrature of the points, two over a cell of 0.25 m, takes
# (0.125 / 3)² / 2 = 0.1 % off the moment; where the face cuts cells it is coarser, and half a per cent moves.
@pytest.mark.parametrize(("angle", "within"), [(90.0, 0.005), (60.0, 0.02)])
def test_water_at_rest(angle, within):
    simulation = Simulation(pool(angle, 0.25, 0.5, "undrained", INVISCID))
    simulation.advance(0.1)
    mark = simulation.window()
    simulation.advance(0.5)
    sample = simulation.sample(since=mark)
    sine = np.sin(np.radians(angle))
    wetted = DEPTH / sine
    thrust = 0.5 * DENSITY * G * DEPTH * wetted  # along the normal, a third of the wetted face above the toe
    assert sample["impact_force_x"] == pytest.approx(thrust * sine, rel=within)
    assert sample["impact_force_height"] == pytest.approx(DEPTH / 3.0, rel=within)
    assert sample["toe_moment"] == pytest.approx(thrust * wetted / 3.0, rel=within)
    if angle == 90.0:
        assert sample["toe_moment"] == pytest.approx(DENSITY * G * DEPTH**3 / 6.0, rel=within)
        assert "heel_moment" not in sample
    else:
        base = simulation.scenario.barrier.shape.base_crest_height[0]
        load = thrust * np.cos(np.radians(angle))  # which presses down on the face
        assert sample["heel_moment"] == pytest.approx(thrust * wetted / 3.0 - load * base, rel=within)
    # The lowest patch, of half a metre along the face.
    middle = 0.25 * sine
    assert sample["pressure_patch"] == pytest.approx(DENSITY * G * (DEPTH - middle), rel=2.0 * within)
    assert sample["pressure_patch_height"] == pytest.approx(middle, abs=0.01)


def test_pressure_at_rest_is_a_triangle():
    simulation = Simulation(pool(90.0, 0.25, 0.5, "undrained", INVISCID))
    simulation.advance(0.1)
    mark = simulation.window()
    simulation.advance(0.5)
    heights = simulation.slots["barrier"].face.heights
    pressure = normal_of(simulation, mark) / np.diff(heights) / (simulation.time - mark.time)
    middle = 0.5 * (heights[1:] + heights[:-1])
    inside = middle < DEPTH - 0.25  # at the surface the splines reach into the next cell
    assert pressure[inside] == pytest.approx(DENSITY * G * (DEPTH - middle[inside]), abs=0.01 * DENSITY * G * DEPTH)
    assert pressure[middle > DEPTH + 0.5] == pytest.approx(0.0)


SCENES = {
    "case_1": {},
    "case_1_dry": {},
    "case_1_undrained": {},
    "case_1_fixed": {},
    "case_5": {},
    "set_iib": {"numerics.precision": "float32"},
    "set_v": {},
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_slots_add_up_to_the_reactions(load_scene, name):
    scenario = load_scene(name, **{"numerics.spacing_m": 0.75, "output.end_time_s": 0.6} | SCENES[name])
    simulation = Simulation(scenario)
    simulation.advance(0.6)
    window = simulation.window()
    taken = np.array(window.taken).reshape(-1, at.SLOT_SIZE)
    names = [surface.name for body in simulation.bodies for surface in body.surfaces]
    pieces = simulation.bodies[simulation.slots["barrier"].body].outline.segments
    pressed = 0.0
    for stretch in simulation.slots["barrier"].stretches:
        normal, liquid, along = taken[stretch.slots].sum(axis=0)
        total = normal + (liquid if simulation.effects.two_phase else 0.0)
        k = names.index(stretch.surface)
        expected = -total * pieces.normal[stretch.pieces[0]] + along * stretch.along[0]
        scale = max(1.0, float(np.abs(taken[stretch.slots]).sum()))
        # Single precision rounds what a place gives in a step, the same in both; the sums are double.
        within = 1e-6 if scenario.numerics.precision == "float32" else 1e-13
        assert window.reactions[2 * k : 2 * k + 2] == pytest.approx(expected, abs=within * scale)
        pressed += total
    assert pressed > 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"gravity.acceleration_m_per_s2": 0.0},
        {"barrier.motion": {"kind": "prescribed", "times_s": [0.0, 9.0], "velocities_m_per_s": [0.0, -2.0]}},
    ],
)
def test_a_state_fits_a_longer_run_before_a_wall(load_scene, changes):
    """The slots of a wall without end hang on the scene, not on the grid that a later end calls for."""
    short, long = (
        Simulation(load_scene("case_5", **{"numerics.spacing_m": 0.75, "output.end_time_s": end} | changes))
        for end in (0.5, 5.0)
    )
    assert len(short.slots["barrier"]) == len(long.slots["barrier"])
    assert short.slots["barrier"].face.heights.tolist() == long.slots["barrier"].face.heights.tolist()


def test_what_the_flow_does_not_touch_takes_nothing(load_scene):
    simulation = Simulation(load_scene("case_1", **{"numerics.spacing_m": 0.75}))
    simulation.advance(0.2)
    assert not np.any(simulation.window().taken)
    sample = simulation.sample()
    for name in ("impact_force_height", "toe_moment", "heel_moment", "pressure_patch", "pressure_patch_height"):
        assert sample[name] == 0.0


def test_the_pressure_on_a_patch_converges(load_scene):
    """A flow of 2.2 m at 12 m/s on 8°: 418, 380, 378 and 375 kPa at 0.4, 0.2, 0.13 and 0.1 m."""
    shape = {"kind": "trapezoid", "height_m": 4.0, "crest_width_m": 1.5, "face_angle_deg": 75.0}
    scenario = load_scene(
        "case_1",
        **{
            "gravity.tilt_deg": 8.0,
            "ground.friction": 0.2,
            "flow.shape.depth_m": 2.2,
            "flow.shape.distance_m": 2.2,
            "flow.velocity_m_per_s": [12.0, 0.0],
            "barrier.shape": shape,
            "output.end_time_s": 0.4,
            "output.snapshot_interval_s": 0.4,
        },
    )
    # At 0.4 m the patch of 0.5 m is hardly longer than the cell of the toe, where face and ground share nodes.
    for spacing, off in ((0.4, 0.12), (0.2, 0.02)):
        coarse = scenario.replaced({"numerics.spacing_m": spacing})
        summary = run_in_memory(coarse, make_simulation=Simulation).summary
        assert summary["pressure_patch_max"] == pytest.approx(378e3, rel=off)
        assert summary["pore_pressure_patch_max"] == pytest.approx(214.6e3, rel=off)
        assert summary["pressure_patch_max_height"] == pytest.approx(0.25 * np.sin(np.radians(75.0)), abs=1e-9)
        assert 0.2 < summary["pressure_patch_max_time"] < 0.3


# -- the patch ---------------------------------------------------------------------------------------------------


def loads_of(load_scene, pressure, times, **changes):
    """`LoadsNow` at each of the times, for a pressure p(s, t) [Pa] on a face of 3 m in slots of 0.25 m."""
    scenario = load_scene(
        "case_1_dry",
        **{
            "numerics.spacing_m": 0.25,
            "barrier.shape": {"kind": "trapezoid", "base_width_m": 1.0, "crest_width_m": 1.0, "height_m": 3.0},
            "barrier.motion": {"kind": "fixed"},
        }
        | changes,
    )
    bodies = Simulation(scenario).bodies
    slots = slots_of(scenario, bodies)["barrier"]
    surfaces = sum(len(body.surfaces) for body in bodies)
    patches = Patches.along(slots.face, scenario.output.pressure_patch_m)
    middle = 0.5 * (slots.face.edges[1:] + slots.face.edges[:-1])
    found, mark, reach = [], None, scenario.output.pressure_patch_s
    fine = np.linspace(0.0, times[-1], 20_001)
    impulse = np.zeros((len(fine), len(middle)))
    rate = pressure(middle[None, :], fine[:, None]) * np.diff(slots.face.edges)
    impulse[1:] = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(fine)[:, None], axis=0)
    for time in times:
        taken = np.zeros((len(slots), at.SLOT_SIZE))
        taken[slots.face.slots, at.SLOT_NORMAL] = [np.interp(time, fine, column) for column in impulse.T]
        window = Window(time, [0.0] * 2 * surfaces, 0.0, [0.0] * 2 * surfaces, taken.ravel(), reach=reach)
        if mark is not None:
            found.append(LoadsNow(scenario, bodies, slots, patches, window, mark))
        mark = window.after(mark)
    return found


def test_slots_of_an_inclined_face_share_what_its_points_take_in_turns(load_scene):
    def in_turns(s, t):
        return 2e5 * (np.floor(s / 0.25) % 2) + 0 * t  # 0 or 200 kPa, slot by slot

    inclined = {"barrier.shape": {"kind": "trapezoid", "base_width_m": 4.0, "crest_width_m": 1.0, "height_m": 3.0}}
    patch = {"output.pressure_patch_m": 0.25}
    (upright,) = loads_of(load_scene, in_turns, [0.0, 0.02], **patch)
    assert upright.pressure_patch.pressure == pytest.approx(2e5)
    (loads,) = loads_of(load_scene, in_turns, [0.0, 0.02], **inclined | patch)
    face = loads.slots.face
    assert loads.pressure_patch.pressure <= 1.52e5  # half of it in the middle, three quarters at an end
    # The mean over the whole face is that of what acts.
    (whole,) = loads_of(load_scene, in_turns, [0.0, 0.02], **inclined | {"output.pressure_patch_m": 10.0})
    middle = 0.5 * (face.edges[1:] + face.edges[:-1])
    assert whole.pressure_patch.pressure == pytest.approx(in_turns(middle, 0.0).mean())


def test_a_patch_is_the_greatest_mean_over_half_a_metre(load_scene):
    def pressure(s, t):
        return (
            1e5 * np.where((s > 1.0) & (s < 1.5), 1.0, 0.0) + 3e5 * np.where((s > 2.0) & (s < 2.25), 1.0, 0.0) + 0 * t
        )

    (loads,) = loads_of(load_scene, pressure, [0.0, 0.02])
    # The quarter of a metre with thrice the pressure, half of the patch.
    assert loads.pressure_patch.pressure == pytest.approx(1.5e5)
    assert abs(loads.pressure_patch.height - 2.125) <= 0.125
    (loads,) = loads_of(load_scene, pressure, [0.0, 0.02], **{"output.pressure_patch_m": 0.25})
    assert loads.pressure_patch.pressure == pytest.approx(3e5)
    assert loads.pressure_patch.height == pytest.approx(2.125)
    (loads,) = loads_of(load_scene, pressure, [0.0, 0.02], **{"output.pressure_patch_m": 10.0})  # the whole face
    assert loads.pressure_patch.pressure == pytest.approx((0.5 * 1e5 + 0.25 * 3e5) / 3.0)
    assert loads.pressure_patch.height == pytest.approx(1.5)


@pytest.mark.parametrize("interval", [0.001, 0.004, 0.005, 0.012, 0.02])
def test_a_patch_is_a_mean_over_the_last_20_ms_however_often_it_is_sampled(load_scene, interval):
    def pressure(s, t):
        return 1e5 * (1.0 + np.sin(40.0 * t)) + 0.0 * s

    times = np.arange(0.0, 0.2401, interval)
    for loads in loads_of(load_scene, pressure, times)[round(0.03 / interval) :]:
        end = loads.now.time
        exact = 1e5 * (1.0 + (np.cos(40.0 * (end - 0.02)) - np.cos(40.0 * end)) / (40.0 * 0.02))
        # Where its start lies between two marks, d apart, the load there is taken as even: an impulse of d² / 8 · dp/dt
        # more or less. Of marks every millisecond a trail keeps every second one.
        distance = {0.001: 0.002, 0.012: 0.012}.get(interval, 0.0)
        assert loads.pressure_patch.pressure == pytest.approx(exact, rel=1e-4, abs=distance**2 / 8.0 * 4e6 / 0.02 + 1.0)


def test_a_longer_interval_is_the_time_of_the_mean(load_scene):
    loads = loads_of(load_scene, lambda s, t: 1e6 * t + 0.0 * s, [0.0, 0.1, 0.2])
    assert [one.pressure_patch.pressure for one in loads] == pytest.approx([0.05e6, 0.15e6])


def test_the_trail_of_a_mark_is_short():
    mark = None
    for number in range(1001):
        mark = replace(Window(1e-4 * number, [], 0.0, [], np.array([float(number)]), reach=0.02)).after(mark)
    assert len(mark.trail) <= 18
    assert mark.trail[0][0] <= 0.1 - 0.02 <= mark.trail[1][0]


def test_a_recorder_that_goes_on_knows_the_time_before(load_scene, tmp_path):
    """A checkpoint keeps the trail: the first pressure after it is the mean over the same 20 ms."""
    scenario = load_scene("case_1", **{"numerics.spacing_m": 0.75})
    simulation = Simulation(scenario)
    simulation.advance(0.4)
    recorder = TimeSeriesRecorder(tmp_path / "series.csv", 0.005)
    for step in range(8):
        simulation.advance(0.4 + 0.005 * step)
        recorder.record(simulation)
    mark = recorder.mark()
    recorder.close()
    again = TimeSeriesRecorder(tmp_path / "series.csv", 0.005, mark=mark)
    again.close()
    assert len(mark["window"]) == 7
    simulation.advance(0.45)
    kept, forgotten = (simulation.sample(since=one)["pressure_patch"] for one in (again._window, simulation._since))
    assert kept == simulation.sample(since=recorder._window)["pressure_patch"] > 0.0
    assert kept != forgotten


def test_the_headline_has_the_patch_and_not_the_cell():
    summary = {"pore_pressure_max": 8e5, "pore_pressure_max_time": 0.1, "pressure_patch_m": 0.5}
    summary["pressure_patch_s"] = 0.02
    assert ("greatest pore pressure in a cell", "800.0 kPa at 0.100 s") in summary_rows(summary)  # no barrier
    summary |= {"pressure_patch_max": 4e5, "pressure_patch_max_time": 0.2, "pressure_patch_max_height": 0.25}
    rows = dict(summary_rows(summary))
    assert rows["greatest pressure on the face"] == "400.0 kPa at 0.200 s, 0.25 m up"
    assert dict(summary_rows(summary | {"peak_force_height": 1.234}))["  acting at a height of"] == "1.23 m"
    assert rows["  as a mean over"] == "0.5 m and 0.02 s"
    assert not any("in a cell" in name for name in rows)


# -- by height and time ------------------------------------------------------------------------------------------


def asking(load_scene, name="case_1", **changes):
    coarse = {"numerics.spacing_m": 0.6, "output.end_time_s": 0.8, "output.loads_by_height": True}
    return load_scene(name, **coarse | changes)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, load_scene):
    """A coarse run of case 1 that records loads by height."""
    folder = tmp_path_factory.mktemp("loads") / "run"
    run_scenario(asking(load_scene), folder, make_simulation=Simulation)
    return Results.open(folder)


def test_loads_by_height_integrate_to_the_recorded_forces(recorded):
    loads, series = recorded.loads, recorded.time_series
    np.testing.assert_array_equal(loads.times, series["time"])
    columns = {"impact": ("impact_force_x", "impact_force_y"), "top": ("top_force", "top_force_y"),
               "back": ("back_force_x", "back_force_y")}  # fmt: skip
    assert set(loads.surfaces) == set(columns)
    for name, (along_x, along_y) in columns.items():
        surface = loads.surfaces[name]
        length = np.diff(surface.edges)
        x, y = np.diff(surface.place) / length, np.diff(surface.height) / length  # along the surface
        normal, shear = surface.pressures["normal"] * length, surface.pressures["shear"] * length
        # The solid lies on the right of the surface: pressure acts that way.
        for column, force in ((along_x, normal * y + shear * x), (along_y, -normal * x + shear * y)):
            scale = max(1.0, float(np.abs(normal).sum(axis=1).max()))
            np.testing.assert_allclose(force.sum(axis=1), series[column], rtol=0.0, atol=1e-11 * scale)
        assert (surface.pressures["liquid"] <= surface.pressures["normal"]).all()
    face = loads.surfaces["impact"]
    assert face.pressures["pore_pressure"] == pytest.approx(face.pressures["liquid"] / 0.5)
    assert face.height[[0, -1]] == pytest.approx([0.0, 6.0])
    assert np.diff(face.edges) == pytest.approx(np.diff(face.edges)[0])
    assert series["impact_force_x"].max() > 1e5


def test_who_does_not_ask_has_no_loads_and_the_same_run(recorded, load_scene, tmp_path):
    run_scenario(asking(load_scene, **{"output.loads_by_height": False}), tmp_path / "run", make_simulation=Simulation)
    plain = Results.open(tmp_path / "run")
    assert (plain.path / "timeseries.csv").read_bytes() == (recorded.path / "timeseries.csv").read_bytes()
    assert not (plain.path / "loads.h5").exists()
    with pytest.raises(ResultsError, match=r"loads.h5 is missing: output.loads_by_height = true records it"):
        _ = plain.loads


def test_an_undrained_flow_tells_its_pore_pressure_where_there_is_friction(load_scene, tmp_path):
    changes = {"output.end_time_s": 0.3, "output.quantities": ["impact_force_x"], "barrier.motion": {"kind": "fixed"}}
    for friction, told in (({"face": 0.3, "top": 0.0, "back": 0.0}, True), (0.0, False)):
        scenario = asking(load_scene, "case_1_undrained", **changes | {"barrier.friction": friction})
        run_scenario(scenario, tmp_path / f"{told}", make_simulation=Simulation)
        surfaces = Results.open(tmp_path / f"{told}").loads.surfaces
        assert ("pore_pressure" in surfaces["impact"].pressures) == told
        assert "pore_pressure" not in surfaces["top"].pressures
        assert "liquid" not in surfaces["impact"].pressures


def test_loads_that_were_interrupted_go_on(recorded, load_scene, tmp_path):
    """Stopped between two checkpoints: what was written after the last one is written again, once."""
    scenario = asking(load_scene, **{"output.checkpoint_interval_s": 0.1})
    seen = []
    run_scenario(
        scenario,
        tmp_path / "run",
        make_simulation=Simulation,
        on_progress=lambda progress: seen.append(progress.time),
        stop=lambda: bool(seen) and seen[-1] > 0.57,
    )
    stopped = Results.open(tmp_path / "run").loads
    assert 0.57 < stopped.times[-1] < 0.6
    assert resume_run(tmp_path / "run", make_simulation=Simulation).finished
    ours, whole = Results.open(tmp_path / "run").loads, recorded.loads
    np.testing.assert_array_equal(ours.times, whole.times)
    for name, surface in whole.surfaces.items():
        for kind, values in surface.pressures.items():
            np.testing.assert_array_equal(ours.surfaces[name].pressures[kind], values)


def test_loads_of_a_process_that_died_are_read(load_scene, tmp_path):
    """Nobody closes the file: its room is laid down, and the rows before the last are whole."""
    recorder = LoadsRecorder(tmp_path / "loads.h5", 0.1, 10.0)
    simulation = Simulation(asking(load_scene))
    for step in range(3):
        simulation.advance(0.1 * step)
        recorder.record(simulation)
    shutil.copy(tmp_path / "loads.h5", tmp_path / "copy.h5")
    loads = read_loads(tmp_path / "copy.h5")
    assert loads.times == pytest.approx([0.0, 0.1, 0.2])
    assert loads.surfaces["impact"].pressures["normal"].shape == (3, len(loads.surfaces["impact"].edges) - 1)
    recorder.close()
    (tmp_path / "copy.h5").write_bytes((tmp_path / "loads.h5").read_bytes()[:1000])
    with pytest.raises(ResultsError, match="cannot be read as HDF5"):
        read_loads(tmp_path / "copy.h5")


def test_loads_by_height_are_drawn(recorded, tmp_path):
    answer = CliRunner().invoke(app, ["plot", "loads", str(recorded.path), "--out", str(tmp_path / "loads.png")])
    assert answer.exit_code == 0, answer.output
    over_time, envelope, _ = loads_by_height(recorded).axes
    mesh = over_time.collections[0].get_array()
    face = recorded.loads.surfaces["impact"]
    assert mesh.shape == (len(face.edges) - 1, len(recorded.loads.times) - 1)
    assert float(mesh.max()) * 1e3 <= face.pressures["normal"].max()
    shares = patches(face.edges, 1.3)
    assert shares.sum(axis=0) == pytest.approx(1.0)
    assert shares[2, 2] == pytest.approx(np.diff(face.edges)[0] / 1.3)
    assert [text.get_text() for text in envelope.get_legend().get_texts()] == [
        "both phases",
        "pore pressure",
        "height of the peak force",
    ]
    write_report([recorded], tmp_path / "report.html")
    assert "height of the resultant" in (tmp_path / "report.html").read_text()


def test_loads_by_height_need_a_barrier_and_room(load_scene):
    with pytest.raises(ScenarioError, match=r"output.loads_by_height = true needs a barrier"):
        asking(load_scene, barrier=None)
    with pytest.raises(ScenarioError, match=r"output.time_series_interval_s = 1e-06 asks for about [0-9.e+]+ GB"):
        asking(
            load_scene,
            **{"numerics.spacing_m": 0.005, "output.time_series_interval_s": 1e-6, "output.end_time_s": 9.0},
        )


def test_loads_in_memory_are_those_of_the_folder(load_scene, tmp_path):
    changes = {"numerics.spacing_m": 0.75, "output.end_time_s": 0.5, "output.loads_by_height": True}
    scenario = load_scene("case_1", **changes)
    run_scenario(scenario, tmp_path / "run", make_simulation=Simulation)
    kept, written = run_in_memory(scenario, make_simulation=Simulation).loads, read_loads(tmp_path / "run/loads.h5")
    np.testing.assert_array_equal(kept.times, written.times)
    assert list(kept.surfaces) == list(written.surfaces)
    for name, surface in written.surfaces.items():
        for part in ("edges", "place", "height"):
            np.testing.assert_array_equal(getattr(kept.surfaces[name], part), getattr(surface, part))
        assert set(kept.surfaces[name].pressures) == set(surface.pressures)
        for kind, values in surface.pressures.items():
            np.testing.assert_array_equal(kept.surfaces[name].pressures[kind], values)
    assert written.surfaces["impact"].pressures["normal"].max() > 0.0
    plain = scenario.replaced({"output.loads_by_height": False, "output.end_time_s": 0.01})
    assert run_in_memory(plain, make_simulation=Simulation).loads is None
