"""Commands plot and animate: every kind, what the axes say, what the files hold, and what is refused."""

import os
import re
from itertools import combinations

import pytest
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from typer.testing import CliRunner

from analytic.whole_file import UnwrittenError
from warp_mpm import animation, plotting
from warp_mpm.animation import write_film
from warp_mpm.cli import app
from warp_mpm.fields import FIELDS, field_values
from warp_mpm.results import Results
from warp_mpm.run import run_scenario


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def runs(folder, load_scene, flying_points):
    paths = []
    for name in ("case_1", "case_5", "case_1_dry"):
        path = folder / name
        if not path.exists():
            changes = {"numerics.spacing_m": 1.0, "output.end_time_s": 1.2, "output.snapshot_interval_s": 0.2}
            run_scenario(load_scene(name, **changes), path, make_simulation=flying_points)
        paths.append(path)
    return paths


def command(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize("kind", ["scene", "history", "comparison", "field", "mechanism"])
def test_every_kind_is_drawn(runs, tmp_path, kind):
    chosen = runs[:1] if kind in ("scene", "history") else runs[:2]
    answer = command("plot", kind, *chosen, "--out", tmp_path / "figure.svg", "--times", "0.4,1")
    assert answer.exit_code == 0, answer.output
    assert (tmp_path / "figure.svg").read_text().startswith("<?xml")
    assert [item.name for item in tmp_path.iterdir()] == ["figure.svg"]


def test_every_axis_says_its_unit(runs):
    results = [Results.open(path) for path in runs]
    figures = [
        plotting.scene(results[0].scenario),
        plotting.force_and_displacement(results[0]),
        plotting.comparison(results[:2]),
        plotting.field_panels(results[:2], "volumetric_strain", (0.4, 1.0)),
        plotting.mechanism_diagram(results[:2]),
    ]
    for figure in figures:
        for axis in figure.axes:
            for label in (axis.get_xlabel(), axis.get_ylabel()):
                assert label == "" or "[" in label, label
        assert any(axis.get_xlabel() for axis in figure.axes)


def drawn_texts(figure):
    """Words and extents of all texts of a figure, those of the ticks apart, and the extents of its axes with theirs."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axes = [axis for axis in figure.findobj(Axis) if axis.get_visible()]
    of_ticks = {
        label for axis in axes for tick in (*axis.majorTicks, *axis.minorTicks) for label in tick.get_children()
    }
    texts = [
        (text.get_text(), text.get_window_extent())
        for text in figure.findobj(lambda artist: isinstance(artist, Text) and artist not in of_ticks)
        if text.get_visible() and text.get_text().strip()
    ]
    around = [extent for axis in axes if (extent := axis.get_tightbbox(canvas.get_renderer())) is not None]
    return texts, around


def assert_all_can_be_read(figure):
    """Every text lies on the canvas, and none on another."""
    texts, around = drawn_texts(figure)
    width, height = figure.bbox.max
    for words, extent in [*texts, *(("an axis", extent) for extent in around)]:
        assert extent.x0 > -1, words
        assert extent.y0 > -1, words
        assert extent.x1 < width + 1, words
        assert extent.y1 < height + 1, words
    for (words, extent), (others, other) in combinations(texts, 2):
        common = extent.intersection(extent, other)
        assert common is None or min(common.width, common.height) < 1, f"{words!r} over {others!r}"


LOW_AND_WIDE = {"kind": "trapezoid", "base_width_m": 20.0, "crest_width_m": 14.0, "height_m": 1.5}
HIGH_AND_NARROW = {"kind": "trapezoid", "base_width_m": 1.0, "crest_width_m": 0.8, "height_m": 12.0}
NEARLY_NONE = {"kind": "trapezoid", "base_width_m": 0.3, "crest_width_m": 0.1, "height_m": 0.2}
PEAKED = {"kind": "trapezoid", "base_width_m": 8.0, "crest_width_m": 0.0, "height_m": 4.0}
LONG_TITLE = "All that a user would like to say of a scene, at a price of 5 $ or of $10, in one line. " * 2


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("case_1", {}),
        ("case_5", {}),
        ("set_iib", {}),
        ("case_1_fixed", {"title": LONG_TITLE}),
        ("case_1", {"barrier.shape": LOW_AND_WIDE, "gravity.tilt_deg": 12.0, "ground.friction": 0.3}),
        ("case_1_fixed", {"barrier.shape": HIGH_AND_NARROW, "gravity.tilt_deg": -45.0}),
        ("case_1_fixed", {"barrier.shape": NEARLY_NONE, "title": LONG_TITLE}),
        ("case_1", {"barrier.shape": PEAKED, "gravity.acceleration_m_per_s2": 0.0}),
        ("case_1", {"barrier": None, "ground": None}),
    ],
)
def test_scene_can_be_read(load_scene, name, changes):
    scenario = load_scene(name, **changes)
    figure = plotting.scene(scenario)
    assert_all_can_be_read(figure)
    assert figure.get_suptitle().replace("\\$", "$") == scenario.title
    panel = figure.axes[0]
    for text in panel.texts:
        assert panel.bbox.contains(*text.get_window_extent().min), text
        assert panel.bbox.contains(*text.get_window_extent().max), text


def test_scene_tells_slope_and_ground(load_scene):
    def words(**changes):
        return " ".join(text for text, _ in drawn_texts(plotting.scene(load_scene("case_1", **changes)))[0])

    level = words()
    assert "ground: smooth" in level
    assert "tilted" not in level
    sloping = words(**{"gravity.tilt_deg": 12.5, "ground.friction": 0.36})
    assert "tilted by 12.5°: the ground falls toward +x" in sloping
    assert "$φ_b$ = 0.36" in sloping
    assert "ground:" not in words(ground=None, barrier=None)


def test_figures_of_runs_can_be_read(runs):
    results = [Results.open(path) for path in runs]
    assert_all_can_be_read(plotting.comparison(results))
    for one in results:
        assert_all_can_be_read(plotting.force_and_displacement(one))
    longest = sorted(FIELDS, key=lambda field: len(field.title))[-2:]  # where the bar's label takes most room
    for field in longest:
        assert_all_can_be_read(plotting.field_panels(results[:1], field.name, (0.4,)))
        assert_all_can_be_read(plotting.field_panels(results[:2], field.name))


@pytest.mark.slow
@pytest.mark.parametrize("field", [field.name for field in FIELDS])
def test_every_field_can_be_read(runs, field):
    assert_all_can_be_read(plotting.field_panels([Results.open(runs[0])], field, (0.4,)))


@pytest.mark.parametrize("width", [320, *(pytest.param(width, marks=pytest.mark.slow) for width in (333, 480, 1280))])
@pytest.mark.parametrize("title", ["Case 1: standing jump, sliding barrier at 60 degrees, 10 m/s", LONG_TITLE])
def test_pictures_of_a_film_can_be_read(load_scene, flying_points, tmp_path, monkeypatch, width, title):
    figures = []

    def kept(**options):
        figures.append(Figure(**options))
        return figures[-1]

    monkeypatch.setattr(animation, "Figure", kept)
    changes = {"numerics.spacing_m": 1.0, "output.end_time_s": 0.2, "output.snapshot_interval_s": 0.2, "title": title}
    run_scenario(load_scene("case_1", **changes), tmp_path / "run", make_simulation=flying_points)
    write_film(Results.open(tmp_path / "run"), tmp_path / "film.gif", field_name="slip", width=width)
    assert_all_can_be_read(figures[-1])
    with pytest.importorskip("PIL.Image").open(tmp_path / "film.gif") as film:
        assert film.size[0] == width


def test_history_says_whether_the_barrier_has_come_to_rest(runs):
    results = Results.open(runs[0])
    moving = plotting.force_and_displacement(results)
    assert [text.get_text() for text in moving.axes[1].texts] == ["0.14 m, still sliding"]
    results.time_series["barrier_velocity"][-1] = 0.0
    resting = plotting.force_and_displacement(results)
    assert [text.get_text() for text in resting.axes[1].texts] == ["0.14 m"]
    FigureCanvasAgg(moving).draw()
    legend, panel = moving.axes[0].get_legend(), moving.axes[0]
    assert legend.get_window_extent().y0 > panel.bbox.y1 - 1  # above the curves, not over them
    label, curve = moving.axes[1].texts[0].get_window_extent(), moving.axes[1].lines[0]
    assert not label.count_contains(curve.get_transform().transform(curve.get_xydata()))


def test_comparison_leaves_out_what_is_nil_in_all_runs(folder, load_scene, runs, flying_points):
    path = folder / "fixed"
    if not path.exists():
        changes = {"numerics.spacing_m": 1.0, "output.end_time_s": 1.2, "output.snapshot_interval_s": 0.2}
        run_scenario(load_scene("case_1_fixed", **changes), path, make_simulation=flying_points)

    def panels(*paths):
        return [panel.get_ylabel() for panel in plotting.comparison([Results.open(one) for one in paths]).axes]

    # The stand-in has no friction at the base and none on the crest.
    assert [label.split()[0] for label in panels(path, path)] == ["horizontal", "vertical", "kinetic"]
    assert [label.split()[0] for label in panels(path, runs[0])] == ["horizontal", "vertical", "barrier", "kinetic"]


def test_times_beyond_the_end_are_told(runs, tmp_path):
    def panels(*times):
        answer = command("plot", "field", runs[0], "--out", tmp_path / "figure.svg", *times)
        shown = re.findall("t = ([0-9.]+) s, greatest", (tmp_path / "figure.svg").read_text())
        return answer, sorted(set(shown))

    answer, shown = panels("--times", "0.4,1,4,6")
    assert answer.exit_code == 0
    assert shown == ["0.40", "1.00"]
    assert answer.stderr == "Left out of --times: 4, 6 s, beyond the last snapshot at t = 1.2 s.\n"
    answer, shown = panels()
    assert answer.stderr == ""
    assert shown == ["0.20", "0.40", "0.80"]


def test_times_of_the_papers_scenes_are_the_papers(folder, load_scene, flying_points):
    changes = {"numerics.spacing_m": 1.0, "output.snapshot_interval_s": 0.5}
    run_scenario(load_scene("case_5", **changes), folder / "long", make_simulation=flying_points)
    long = Results.open(folder / "long")
    assert plotting.still_times([long]) == [1.0, 2.0, 4.0]
    assert plotting.still_times([long], (3.0, 6.0, 6.5)) == [3.0, 6.0]


@pytest.mark.parametrize("arguments", [["plot", "history"], ["report"], ["animate", "--quiet"]])
def test_what_cannot_be_written_is_named_as_the_user_named_it(runs, tmp_path, arguments):
    target = tmp_path / ("figure.gif" if arguments[0] == "animate" else "figure.png")
    if arguments[0] == "report":
        (tmp_path / "figure.png.new").mkdir()  # the file beside it, which is not the user's business
    else:
        target.mkdir()
    answer = command(*arguments, runs[2], "--out", target)
    assert answer.exit_code == 2
    assert answer.stderr == f"{target} cannot be written: Is a directory.\n"
    assert len(list(tmp_path.iterdir())) == 1


def test_scene_of_a_scenario_file_shows_its_measures(load_scene):
    scene = load_scene("set_iib")
    words = " ".join(text.get_text() for text in plotting.scene(scene).axes[0].texts)
    for measure in ("B = 11 m", "b = 4 m", "H = 6 m", "h = 3 m", "d = 3 m", "20 m/s", "β = 59.7°"):
        assert measure in words


def test_fields_are_what_they_say(runs):
    results = Results.open(runs[0])
    frame = results.snapshots[3]
    density = results.scenario.flow.material.solid_partial_density
    values = {field.name: field_values(frame, field.name, density) for field in FIELDS}
    # The stand-in: points fly freely, liquid 1.5 times as fast, volumes and stresses as at the start.
    velocity = (frame["solid_velocity"] ** 2).sum(axis=1) ** 0.5
    assert values["speed"] == pytest.approx(velocity)
    assert values["slip"] == pytest.approx(0.5 * velocity, rel=1e-5)
    assert values["volumetric_strain"] == pytest.approx(0.0, abs=1e-4)  # single precision of a ratio, in percent
    stress = frame["effective_stress"]
    assert values["mean_effective_stress"] == pytest.approx(-(stress[:, 0] + stress[:, 1] + stress[:, 2]) / 3e3)
    assert field_values(Results.open(runs[2]).snapshots[0], "pore_pressure", density) is None


def test_gif_has_a_picture_for_each_snapshot(runs, tmp_path):
    image_module = pytest.importorskip("PIL.Image")
    answer = command("animate", runs[2], "--out", tmp_path / "film.gif", "--width", "320", "--speed", "1")
    assert answer.exit_code == 0, answer.output
    with image_module.open(tmp_path / "film.gif") as film:
        assert film.n_frames == len(Results.open(runs[2]).snapshots) == 7
        assert film.info["duration"] == 200  # 0.2 s of simulated time at 1 s/s
        assert film.size[0] == 320
    assert [item.name for item in tmp_path.iterdir()] == ["film.gif"]


def test_mp4_plays_as_long_as_it_should(runs, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    seen = []
    write_film(
        Results.open(runs[0]),
        tmp_path / "film.mp4",
        speed=0.5,
        width=400,
        watch=lambda frames: (seen.append(frame) or frame for frame in frames),
    )
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert seen == list(range(7))
    assert frames == 7
    assert seconds == pytest.approx(7 * 0.2 / 0.5, abs=0.05)


@pytest.mark.skipif(os.name == "nt", reason="no limits on files")
def test_film_that_is_cut_off_is_not_called_done(runs, tmp_path):
    """The encoder ends in silence where it may write no more."""
    pytest.importorskip("imageio_ffmpeg")
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, before[1]))
    try:
        with pytest.raises(UnwrittenError, match=r"film.mp4 cannot be written: the encoder could not write all of it"):
            write_film(Results.open(runs[0]), tmp_path / "film.mp4", width=400)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plot", "history", "RUN", "RUN"], "draws one run, 2 were given"),
        (["plot", "history", "RUN", "--out", "figure.bmp"], "must be one of png, pdf, svg"),
        (["plot", "field", "RUN", "--field", "colour"], "field = 'colour' is not known"),
        (["plot", "field", "DRY", "--field", "pore_pressure"], "has no pore pressure: it is a dry flow"),
        (
            ["plot", "field", "RUN", "--times", "10,12"],
            "nothing to draw at 10, 12 s: the last snapshot is at t = 1.2 s",
        ),
        (["plot", "field", "RUN", "--times", "-1"], "'-1' must be a number of seconds at least 0"),
        (["plot", "scene", "nowhere.json"], "nowhere.json"),
        (["animate", "RUN", "--out", "film.avi"], "must be one of mp4, gif"),
        (["animate", "nowhere"], "nowhere is no folder"),
    ],
)
def test_bad_input_is_one_sentence(runs, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    names = {"RUN": runs[0], "DRY": runs[2]}
    answer = command(*(names.get(word, word) for word in arguments))
    assert answer.exit_code == 2
    assert words in answer.stderr
    assert "Traceback" not in answer.output
    assert not list(tmp_path.iterdir())
