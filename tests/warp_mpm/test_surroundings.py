"""What goes wrong around a run, not in it: streams, the cache of compiled kernels, memory, files, devices."""

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp
import warp._src.build as warp_build
from typer.testing import CliRunner

import warp_mpm.cli
from analytic.whole_file import UnwrittenError, whole_file, write_whole
from warp_mpm.kernels import cache
from warp_mpm.recording import run_folder
from warp_mpm.recording.run_folder import RunFolder, RunFolderError
from warp_mpm.recording.snapshots import SnapshotRecorder
from warp_mpm.results import Results, ResultsError
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.simulation import Simulation
from warp_mpm.state import arrays

ROOT = Path(__file__).parents[2]


def run(folder, redirection="", pictures=False, **environment):
    """A short run in a shell; with its pictures it takes twice as long."""
    options = "--spacing 1 --until 0.3" + " --no-pictures" * (not pictures)
    words = f"'{sys.executable}' -m warp_mpm run scenarios/case_1.json {options} --out '{folder}'"
    return subprocess.run(
        f"{words} {redirection}",
        shell=True,
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        timeout=120,
        check=False,
    )


# -- streams -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", [pytest.param("cp1252", marks=pytest.mark.slow), "ascii"])
def test_a_run_in_any_encoding(tmp_path, encoding):
    answer = run(tmp_path / "run", PYTHONIOENCODING=encoding)
    assert (answer.returncode, answer.stderr) == (0, b"")
    assert "F2x" in answer.stdout.decode(encoding)


@pytest.mark.parametrize(
    "redirection",
    [*(pytest.param(to, marks=pytest.mark.slow) for to in ("2>&-", ">&- 2>&- <&-")), ">/dev/full 2>/dev/full"],
)
def test_a_run_whose_streams_take_nothing(tmp_path, redirection):
    run(tmp_path / "run", redirection, pictures="<&-" in redirection)
    assert json.loads((tmp_path / "run" / run_folder.SUMMARY).read_text())["status"] == "finished"
    assert json.loads((tmp_path / "run" / run_folder.RECORD).read_text())["status"] == "finished"


def test_a_simulation_from_python_without_streams(tmp_path):
    code = (
        "import sys; from pathlib import Path; from warp_mpm import Scenario, Simulation\n"
        "assert sys.stderr is sys.stdout is None\n"
        "scene = Scenario.load('scenarios/case_1.json').replaced({'numerics.spacing_m': 1.0})\n"
        "simulation = Simulation(scene); simulation.advance(0.01)\n"
        f"Path({str(tmp_path / 'time')!r}).write_text(str(simulation.time))\n"
    )
    subprocess.run(f"'{sys.executable}' -c \"{code}\" >&- 2>&-", shell=True, cwd=ROOT, timeout=120, check=True)
    assert (tmp_path / "time").read_text() == "0.01"


# -- compiled kernels --------------------------------------------------------------------------------------------------

MODULE = "test_surroundings_cache"


@wp.kernel(module=MODULE)
def add_one(values: wp.array(dtype=float)):
    values[wp.tid()] += 1.0


def works():
    values = wp.zeros(3, dtype=float, device="cpu")
    wp.launch(add_one, dim=3, inputs=[values], device="cpu")
    return values.numpy().tolist() == [1.0, 1.0, 1.0]


@pytest.fixture
def kernel_cache(tmp_path, monkeypatch):
    """An empty one; a function that forgets what was loaded from it."""
    wp.init()
    cache._temporary.cache_clear()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))

    def forget():
        wp.get_module(MODULE).execs.clear()

    forget()
    yield forget
    forget()


def halved(file):
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2] + bytes(len(content) - len(content) // 2))


def replaced_by_a_folder(file):
    file.unlink()
    file.mkdir()


@pytest.mark.parametrize(
    ("ending", "harm"),
    [
        ("*.o", lambda file: file.write_bytes(b"")),
        ("*.o", lambda file: file.write_bytes(file.read_bytes()[:-64])),
        ("*.o", halved),
        ("*.o", replaced_by_a_folder),
        ("*.meta", lambda file: file.write_text("{")),
    ],
)
def test_broken_compiled_kernels_are_built_anew(kernel_cache, tmp_path, caplog, ending, harm):
    cache.load_kernels(MODULE, "cpu")
    assert works()
    assert not caplog.messages
    kernel_cache()
    (file,) = tmp_path.rglob(ending)
    harm(file)
    cache.load_kernels(MODULE, "cpu")
    assert works()
    assert [message.partition(" are broken")[0] for message in caplog.messages] == [
        f"Compiled kernels in {file.parent}"
    ]
    kernel_cache()
    cache.load_kernels(MODULE, "cpu")
    assert len(caplog.messages) == 1


def test_of_several_processes_one_compiles(kernel_cache, tmp_path, monkeypatch):
    """What is compiled is locked meanwhile; whoever waits for the lock finds it compiled then."""
    fcntl = pytest.importorskip("fcntl")
    build, flock, built, waited = warp_build.build_cpu, fcntl.flock, [], []

    def build_cpu(*arguments, **options):
        (lock,) = tmp_path.glob("*.lock")
        with lock.open() as file, pytest.raises(BlockingIOError):
            flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        built.append(lock)
        return build(*arguments, **options)

    monkeypatch.setattr(warp_build, "build_cpu", build_cpu)
    cache.load_kernels(MODULE, "cpu")
    assert works()
    assert len(built) == 1
    assert not built[0].exists()
    kernel_cache()
    (folder,) = tmp_path.iterdir()
    aside = folder.rename(tmp_path / "by another process")

    def other_is_done(file, how):
        waited.append(how)
        aside.rename(folder)

    monkeypatch.setattr(fcntl, "flock", other_is_done)
    cache.load_kernels(MODULE, "cpu")
    assert works()
    assert waited == [fcntl.LOCK_EX]
    assert len(built) == 1


def test_a_build_that_failed_is_tried_again(kernel_cache, monkeypatch, caplog):
    """Warp remembers the failure, and would tell of it again."""
    build, calls = warp_build.build_cpu, []

    def build_cpu(*arguments, **options):
        calls.append(None)
        if len(calls) == 1:
            raise RuntimeError("Out of space")
        return build(*arguments, **options)

    monkeypatch.setattr(warp_build, "build_cpu", build_cpu)
    cache.load_kernels(MODULE, "cpu")
    assert works()
    assert len(calls) == 2


def test_a_cache_that_takes_nothing_is_gone_round(kernel_cache, tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "file"))
    cache.load_kernels(MODULE, "cpu")
    assert works()
    (message,) = caplog.messages
    assert message.startswith(f"Compiled kernels cannot be kept in {tmp_path / 'file'} (Not a directory): they are")


def test_no_place_for_compiled_kernels_is_one_sentence(kernel_cache, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "file"))

    def full(**options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache.tempfile, "TemporaryDirectory", full)
    with pytest.raises(cache.KernelCacheError, match=r"cannot be written to .*file: Not a directory; WARP_CACHE_PATH="):
        cache.load_kernels(MODULE, "cpu")


# -- memory ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [MemoryError("numpy's"), RuntimeError("Failed to allocate 360048000 bytes")])
def test_memory_that_cannot_be_had(coarse_case_1, monkeypatch, error, tmp_path):
    def refuse(*arguments, **options):
        raise error

    monkeypatch.setattr(arrays.wp, "zeros", refuse)
    with pytest.raises(MemoryError, match=r"numerics.spacing_m = .* asks for .* material points and a grid, about"):
        Simulation(coarse_case_1)
    answer = CliRunner().invoke(
        warp_mpm.cli.app, ["run", str(ROOT / "scenarios" / "case_1.json"), "--out", str(tmp_path / "run")]
    )
    assert answer.exit_code == 2
    assert answer.stderr.startswith("There is not enough memory: numerics.spacing_m = 0.2 asks for 4.5e+03 material")
    assert answer.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


# -- files -------------------------------------------------------------------------------------------------------------


def test_a_link_that_leads_nowhere_is_told(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(RunFolderError, match=r"link is a link to .*gone, which is not there"):
        RunFolder.check(tmp_path / "link")
    with pytest.raises(RunFolderError, match="link is no folder"):
        RunFolder.create(tmp_path / "link" / "run", {}, {})


@pytest.mark.parametrize("command", ["run scenarios/case_1.json", "sweep scenarios/sweeps/slope.json", "report RUN"])
def test_a_name_that_is_too_long_is_told(tmp_path, command, coarse_case_1, flying_points, monkeypatch):
    monkeypatch.chdir(ROOT)
    run = str(run_scenario(coarse_case_1, tmp_path / "run", make_simulation=flying_points).path)
    arguments = command.replace("RUN", run).split()
    answer = CliRunner().invoke(warp_mpm.cli.app, [*arguments, "--out", str(tmp_path / ("a" * 300))])
    assert answer.exit_code == 2
    assert answer.stderr.count("\n") == 1
    assert "File name too long" in answer.stderr
    if command.startswith("run"):
        assert answer.stderr.endswith("aaa cannot be used: File name too long; choose another folder with --out.\n")
    assert "Traceback" not in answer.stderr
    assert answer.exception is None or isinstance(answer.exception, SystemExit)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only the administrator makes devices")
def test_a_device_is_written_into_and_stays_a_device(tmp_path):
    for name, minor in (("null", 3), ("full", 7)):
        os.mknod(tmp_path / name, stat.S_IFCHR | 0o666, os.makedev(1, minor))
    write_whole(tmp_path / "null", "text")
    with pytest.raises(UnwrittenError, match="full cannot be written: No space left on device"):
        write_whole(tmp_path / "full", "text")
    assert all(stat.S_ISCHR((tmp_path / name).stat().st_mode) for name in ("null", "full"))
    assert len(list(tmp_path.iterdir())) == 2


def test_a_pipe_is_written_into(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with subprocess.Popen(["cat", tmp_path / "pipe"], stdout=subprocess.PIPE) as reader:
        try:
            write_whole(tmp_path / "pipe", "text")
            assert reader.communicate(timeout=20)[0] == b"text"
        finally:
            reader.kill()  # it would wait for ever for what never came
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_whole(tmp_path / "link", "text")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "text"
    with pytest.raises(UnwrittenError), whole_file(tmp_path / "no" / "file"):
        pass


DENIED = PermissionError(13, "Permission denied")


def denied(*arguments, **options):
    raise DENIED


def test_what_may_not_be_read_is_neither_missing_nor_damaged(tmp_path, coarse_case_1, flying_points, monkeypatch):
    seen = []
    run_scenario(
        coarse_case_1,
        tmp_path / "run",
        make_simulation=flying_points,
        on_progress=seen.append,
        stop=lambda: len(seen) > 30,
    )
    snapshots = tmp_path / "run" / run_folder.SNAPSHOTS
    with monkeypatch.context() as context:
        context.setattr("warp_mpm.results.h5py.File", denied)
        with pytest.raises(ResultsError, match=r"snapshots.vtkhdf cannot be read: Permission denied\."):
            Results.open(tmp_path / "run").snapshots  # noqa: B018
    with monkeypatch.context() as context:
        context.setattr("warp_mpm.recording.snapshots.h5py.File", denied)
        with pytest.raises(RunFolderError, match=r"snapshots.vtkhdf cannot be read: Permission denied\."):
            SnapshotRecorder(snapshots, 0.1, 1.0, mark={"records": 1, "snapshots": 1, "points": 1})
        with pytest.raises(RunFolderError, match="cannot be read: Permission denied"):
            resume_run(tmp_path / "run", make_simulation=flying_points)
    with monkeypatch.context() as context:
        context.setattr(Path, "read_text", denied)
        for name in ("record", "summary", "time_series"):
            with pytest.raises(ResultsError, match=r"cannot be read: Permission denied\."):
                getattr(Results(tmp_path / "run"), name)  # `open` would stumble over the record
    with monkeypatch.context() as context:
        context.setattr(Path, "is_file", denied)
        with pytest.raises(ResultsError, match=r"run cannot be read: Permission denied\."):
            Results.open(tmp_path / "run")


@pytest.mark.parametrize("command", ["check FILE", "run FILE", "report FILE"])
def test_a_file_that_may_not_be_read_is_not_called_missing(command, monkeypatch):
    """The administrator may read everything: the question is answered for him."""
    file = ROOT / "scenarios" / "case_1.json"
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: str(path) != str(file) and access(path, mode))
    monkeypatch.setattr(Path, "read_text", denied)
    answer = CliRunner().invoke(warp_mpm.cli.app, [word.replace("FILE", str(file)) for word in command.split()])
    assert answer.exit_code == 2
    assert answer.stderr == f"{file} cannot be read: Permission denied.\n"


def test_a_file_name_that_is_no_text_is_recorded(tmp_path, coarse_case_1, flying_points):
    run_scenario(coarse_case_1, tmp_path / "run", make_simulation=flying_points, origin="sc\udcffne.json")
    assert Results.open(tmp_path / "run").record["scenario_file"] == "sc\udcffne.json"


def test_pictures_do_not_hang_on_the_window_system_that_is_set(tmp_path):
    answer = run(tmp_path / "run", "--quiet", pictures=True, MPLBACKEND="nonsense")
    assert (answer.returncode, answer.stderr) == (0, b"")
    assert (tmp_path / "run" / run_folder.FORCE_PLOT).exists()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such limits")
@pytest.mark.parametrize(
    "command", ["warp_mpm scenarios case_1 --out copied", "analytic sweep plan scenarios/case_1.json copied --count 1"]
)
def test_what_a_full_disk_takes_in_part_is_not_left(tmp_path, command):
    """A file may grow to 512 bytes: of a scene there would be a fifth."""
    command = command.replace("scenarios/", f"{ROOT}/scenarios/")
    words = f"ulimit -f 1; cd '{tmp_path}' && PYTHONPATH='{ROOT}' '{sys.executable}' -B -m {command}"
    answer = subprocess.run(["sh", "-c", words], capture_output=True, text=True, timeout=60, check=False)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert " cannot be written: File too large." in answer.stderr
    assert answer.stderr.startswith("copied/")
    assert list((tmp_path / "copied").iterdir()) == []
