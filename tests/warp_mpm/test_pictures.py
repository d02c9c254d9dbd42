"""Commands plot and animate: every kind, what the axes say, what the files hold, and what is refused."""

import pytest
from typer.testing import CliRunner

from warp_mpm import plotting
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


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plot", "history", "RUN", "RUN"], "draws one run, 2 were given"),
        (["plot", "history", "RUN", "--out", "figure.bmp"], "must be one of png, pdf, svg"),
        (["plot", "field", "RUN", "--field", "colour"], "field = 'colour' is not known"),
        (["plot", "field", "DRY", "--field", "pore_pressure"], "has no pore pressure: it is a dry flow"),
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
