"""Files that were damaged or made to harm: one clear error, nothing written, nothing executed, no memory eaten."""

import contextlib
import json
import pickle
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warp_mpm.recording import run_folder
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.results import SUMMARY_KINDS, Results, ResultsError, read_time_series
from warp_mpm.run import evaluate, resume_run, run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation

ROOT = Path(__file__).parents[2]
SCENE = (ROOT / "scenarios" / "case_1.json").read_bytes()

QUIET = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]

mutations = st.lists(
    st.tuples(
        st.sampled_from(["flip", "cut", "insert", "repeat", "digit"]),
        st.floats(0.0, 1.0, exclude_max=True),
        st.one_of(st.binary(max_size=8), st.sampled_from([b"NaN", b"1e999", b"-", b"null", b"{", b"]", b"\x00", b'"'])),
    ),
    min_size=1,
    max_size=4,
)


def mutated(content, changes):
    """The same bytes, damaged."""
    for kind, place, junk in changes:
        at = int(place * len(content))
        if kind == "flip" and content:
            content = content[:at] + bytes([content[at] ^ (1 + (junk[0] if junk else 0) % 255)]) + content[at + 1 :]
        elif kind == "cut":
            content = content[:at]
        elif kind == "insert":
            content = content[:at] + junk + content[at:]
        elif kind == "repeat":
            content = content[:at] + content[at : at + 100] * 3 + content[at + 100 :]
        elif kind == "digit" and content[at : at + 1].isdigit():
            content = content[:at] + b"9" * 20 + content[at:]
    return content


def check_scenario(folder, changes):
    path = folder / "scene.json"
    path.write_bytes(mutated(SCENE, changes))
    problems = None
    try:
        scenario = Scenario.load(path)
    except ScenarioError as error:
        problems = error.problems
    else:
        assert Scenario.model_validate(scenario.resolved()) == scenario
    assert problems is None or (problems and all("\n" not in problem for problem in problems))
    assert [item.name for item in folder.iterdir()] == ["scene.json"]


@settings(max_examples=300, deadline=None, derandomize=True, suppress_health_check=QUIET)
@given(changes=mutations)
def test_damaged_scenarios(tmp_path, changes):
    check_scenario(tmp_path, changes)


@pytest.mark.slow
@settings(max_examples=3000, deadline=None, suppress_health_check=QUIET)
@given(changes=mutations)
def test_many_damaged_scenarios(tmp_path, changes):
    check_scenario(tmp_path, changes)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A short real run that was stopped: every kind of file that a run writes."""
    scenario = Scenario.load(ROOT / "scenarios" / "case_1.json").replaced(
        {"numerics.spacing_m": 1.0, "output.end_time_s": 1.0}
    )
    folder = tmp_path_factory.mktemp("stopped") / "run"
    seen = []
    run_scenario(
        scenario,
        folder,
        make_simulation=Simulation,
        on_progress=lambda progress: seen.append(progress.time),
        stop=lambda: bool(seen) and seen[-1] > 0.3,
    )
    return {item.name: item.read_bytes() for item in folder.iterdir()}


READ = (run_folder.RECORD, run_folder.SCENARIO, run_folder.TIME_SERIES, run_folder.SUMMARY, run_folder.CHECKPOINT)


def check_run_folder(parent, files, name, changes, make_simulation):
    folder = parent / "run"
    folder.mkdir(exist_ok=True)
    for item in folder.iterdir():
        item.unlink()
    for other, content in files.items():
        (folder / other).write_bytes(mutated(content, changes) if other == name else content)
    for use in (
        lambda: Results.open(folder).record,
        lambda: Results.open(folder).scenario,
        lambda: Results.open(folder).time_series,
        lambda: Results.open(folder).summary,
        lambda: list(Results.open(folder).snapshots),
        lambda: resume_run(folder, make_simulation=make_simulation, stop=lambda: True),
    ):
        # Any other exception, and with it a traceback, fails the test.
        with contextlib.suppress(ResultsError, RunFolderError, ScenarioError):
            use()
    assert [item.name for item in parent.iterdir()] == ["run"]
    assert {item.name for item in folder.iterdir()} <= {*run_folder.OWN_FILES, run_folder.CHECKPOINT}


def unmade(scenario):
    """Where a damaged folder still fits, making the simulation is as far as this test goes."""
    raise RunFolderError("this test simulates nothing")


@pytest.mark.usefixtures("runs_with_pictures")
@settings(max_examples=100, deadline=None, derandomize=True, suppress_health_check=QUIET)
@given(name=st.sampled_from(READ), changes=mutations)
def test_damaged_run_folders(tmp_path, stopped, name, changes):
    check_run_folder(tmp_path, stopped, name, changes, unmade)


@pytest.mark.slow
@pytest.mark.usefixtures("runs_with_pictures")
@settings(max_examples=2000, deadline=None, suppress_health_check=QUIET)
@given(name=st.sampled_from([*READ, run_folder.SNAPSHOTS]), changes=mutations)
def test_many_damaged_run_folders(tmp_path, stopped, name, changes):
    check_run_folder(tmp_path, stopped, name, changes, unmade)


def test_a_checkpoint_is_data_and_never_code(tmp_path, stopped):
    class Harm:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "harm",))

    folder = tmp_path / "run"
    folder.mkdir()
    for name, content in stopped.items():
        (folder / name).write_bytes(content)
    for harmful in (pickle.dumps(Harm()), b"\x93NUMPY\x01\x00" + pickle.dumps(np.array([Harm()], dtype=object))):
        (folder / run_folder.CHECKPOINT).write_bytes(harmful)
        with pytest.raises(RunFolderError, match="is damaged or no checkpoint"):
            resume_run(folder, make_simulation=Simulation)
    assert not (tmp_path / "harm").exists()


def test_a_huge_scene_is_refused_with_the_memory_it_would_need(tmp_path):
    """In a process that may have 4 GB at most."""
    scene = json.loads(SCENE)
    scene["numerics"]["spacing_m"] = 1e-5
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    answer = subprocess.run(
        [
            *(sys.executable, "-m", "warp_mpm", "run", "--no-pictures"),
            *(str(tmp_path / "scene.json"), "--out", str(tmp_path / "run")),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (4 << 30, resource.RLIM_INFINITY)),
    )
    assert answer.returncode == 2
    assert "asks for 1.8e+12 material points (about 9e+05 GB of memory)" in answer.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"domain.left_m": -1e6, "domain.right_m": 1e6, "domain.top_m": 1e6}, r"domain .* asks for a grid of .* GB"),
        ({"output.snapshot_interval_s": 1e-6}, r"snapshot_interval_s = 1e-06 asks for about .* GB on the disk"),
    ],
)
def test_more_than_a_machine_holds_is_refused(load_scene, changes, sentence):
    with pytest.raises(ScenarioError, match=sentence):
        load_scene("case_1", **changes)


@pytest.mark.usefixtures("runs_with_pictures")
def test_names_in_a_scenario_lead_nowhere(tmp_path, coarse_case_1, flying_points):
    """No text of a scenario becomes a path."""
    texts = {"title": "../../escaped", "source": "/etc/passwd", "notes": ["../x"]}
    scenario = coarse_case_1.replaced(texts | {"output.end_time_s": 0.3})
    run_scenario(scenario, tmp_path / "run", make_simulation=flying_points)
    evaluate(tmp_path / "run")
    assert [item.name for item in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("resumed", 7, "resumed = 7 must be a list"),
        ("resumed", None, "resumed = null must be a list"),
        ("status", 1, "status = 1 must be a text"),
        ("problem", [], r"problem = \[\] must be a text or null"),
        ("versions", [1], r"versions = \[1\] must be a group of fields"),
        ("wall_time", "1", 'wall_time = "1" must be a number'),
        ("steps", True, "steps = true must be a whole number"),
        ("time_step_min", float("nan"), "time_step_min = NaN must be null or a number"),
        ("effects", {"precision": "float16"}, 'effects.precision = "float16" must be float64 or float32'),
        ("effects", {"precision": 3}, "effects.precision = 3 must be float64 or float32"),
    ],
)
def test_a_record_of_the_wrong_kind_is_one_sentence(tmp_path, stopped, name, value, words):
    folder = tmp_path / "run"
    folder.mkdir()
    for other, content in stopped.items():
        (folder / other).write_bytes(content)
    record = json.loads((folder / run_folder.RECORD).read_text())
    (folder / run_folder.RECORD).write_text(json.dumps(record | {name: value}))
    with pytest.raises(ResultsError, match=rf"run.json is damaged: {words}\.$"):
        resume_run(folder, make_simulation=unmade)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("peak_force", "x", 'peak_force = "x" must be null or a number'),
        ("impulse", float("inf"), "impulse = Infinity must be null or a number"),
        ("steps", True, "steps = true must be null or a number"),
        ("mechanism", 3, "mechanism = 3 must be a text or null"),
        ("barrier_at_rest", 1, "barrier_at_rest = 1 must be true or false or null"),
        ("notes", "none", 'notes = "none" must be a list'),
        ("not_recorded", 3, "not_recorded = 3 must be a group of fields or null"),
        ("front_max", "far", 'front_max = "far" must be null or a number'),  # of a script's quantity
    ],
)
def test_a_summary_of_the_wrong_kind_is_one_sentence(tmp_path, name, value, words):
    (tmp_path / run_folder.RECORD).write_text(json.dumps({"format": run_folder.FORMAT}))
    (tmp_path / run_folder.SUMMARY).write_text(json.dumps({"peak_force": None, "grown": "since", name: value}))
    with pytest.raises(ResultsError, match=rf"summary.json is damaged: {words}\.$"):
        Results.open(tmp_path).summary  # noqa: B018


def test_every_figure_of_a_summary_has_its_kind(coarse_case_1, flying_points, tmp_path):
    summary = run_scenario(coarse_case_1, tmp_path / "run", make_simulation=flying_points).summary
    assert Results.open(tmp_path / "run").summary == summary
    assert summary.keys() <= SUMMARY_KINDS.keys()
    assert summary.keys() - {"title", "definitions"} <= summary["definitions"].keys()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("impact_force_x [N/m]\n1\n2\n", r"has no column 'time \[s\]'"),
        ("time [s],time [s]\n1,1\n2,2\n", "has the column 'time' twice"),
        ("time [s]\n0\n1\n1\n2\n", "line 4: time does not increase"),
        ("time [s]\n0\n2\n1\n", "line 4: time does not increase"),
    ],
)
def test_a_series_that_no_run_writes_is_one_sentence(tmp_path, text, words):
    (tmp_path / "timeseries.csv").write_text(text)
    with pytest.raises(ResultsError, match=rf"timeseries.csv {words}\.$"):
        read_time_series(tmp_path / "timeseries.csv")


def test_a_series_that_a_spreadsheet_has_saved_is_read(tmp_path):
    (tmp_path / "timeseries.csv").write_bytes(b"\xef\xbb\xbftime [s],impact_force_x [N/m]\r\n0,1\r\n1,2\r\n")
    found = read_time_series(tmp_path / "timeseries.csv")
    assert {name: values.tolist() for name, values in found.items()} == {"time": [0, 1], "impact_force_x": [1, 2]}
