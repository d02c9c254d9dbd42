"""What a run writes can be read: by our reader, by VTK, and after the process was killed."""

import csv
import multiprocessing
import os
import signal

import h5py
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

from warp_mpm.quantities import TIME_SERIES
from warp_mpm.recording import RunFolder, Schedule, SnapshotRecorder, TimeSeriesRecorder, record_until, run_folder
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.results import ResultsError, Snapshots, read_time_series
from warp_mpm.state.samples import Window


class Clock:
    """A simulation that only keeps time, with a number of points that falls."""

    nominal_step = 0.01

    def __init__(self):
        self.time, self.barrier_displacement, self.visited = 0.0, 0.0, [0.0]

    def advance(self, until, **stop):
        assert until > self.time
        self.time = until
        self.barrier_displacement = 0.25 * until
        self.visited.append(until)

    def window(self):
        return Window(self.time, [])

    def sample(self, names=None, *, since=None):
        return {"time": self.time, "impact_force_x": 1.0 / 3.0}

    def points(self):
        number = 50 - int(self.time * 10)
        index = np.arange(number, dtype=float)
        return {
            "position": np.stack([index, self.time + 0 * index], axis=1),
            "solid_velocity": np.stack([index, -index], axis=1),
            "effective_stress": np.stack([index, 2 * index, 3 * index, 4 * index], axis=1),
            "pore_pressure": 1000.0 * index + self.time,
        }


def record(folder, until=2.0):
    clock = Clock()
    recorders = [
        TimeSeriesRecorder(folder / "series.csv", 0.1),
        SnapshotRecorder(folder / "snapshots.vtkhdf", 0.25, until),
    ]
    assert record_until(clock, recorders, until)
    for recorder in recorders:
        recorder.close()
        recorder.close()
    return clock


def test_schedules_meet_without_drift(tmp_path):
    clock = Clock()
    seen = {0.005: [], 0.05: []}

    class Note:
        def __init__(self, interval):
            self.schedule, self.interval = Schedule(interval), interval

        def record(self, simulation):
            seen[self.interval].append(simulation.time)

        def close(self):
            pass

    assert record_until(clock, [Note(0.005), Note(0.05)], 6.0)
    assert len(seen[0.005]) == 1201
    assert len(seen[0.05]) == 121
    assert np.allclose(seen[0.05], np.arange(121) * 0.05, rtol=0, atol=1e-12)
    assert len(clock.visited) == 1201  # where two schedules meet there is one stretch, not two


def test_the_end_is_recorded_even_off_the_interval(tmp_path):
    record(tmp_path, until=0.37)
    assert read_time_series(tmp_path / "series.csv")["time"][-1] == 0.37
    with Snapshots(tmp_path / "snapshots.vtkhdf") as snapshots:
        assert snapshots.times == pytest.approx([0.0, 0.25, 0.37])


def test_stop_keeps_what_was_recorded(tmp_path):
    clock = Clock()
    recorder = TimeSeriesRecorder(tmp_path / "series.csv", 0.1)
    assert not record_until(clock, [recorder], 5.0, stop=lambda: clock.time > 1.0)
    assert read_time_series(tmp_path / "series.csv")["time"][-1] == pytest.approx(1.1)


def test_time_series_keeps_all_digits_and_names_units(tmp_path):
    record(tmp_path)
    with (tmp_path / "series.csv").open() as file:
        header = next(csv.reader(file))
    assert header == ["time [s]", "impact_force_x [N/m]"]
    series = read_time_series(tmp_path / "series.csv")
    assert (series["impact_force_x"] == 1.0 / 3.0).all()
    assert len(series["time"]) == 21


def test_columns_promised_to_users():
    labels = {quantity.heading for quantity in TIME_SERIES.values()}
    assert labels >= {
        "time [s]",
        "impact_force_x [N/m]",
        "impact_force_y [N/m]",
        "top_force [N/m]",
        "base_force [N/m]",
        "barrier_velocity [m/s]",
        "barrier_displacement [m]",
        "flow_kinetic_energy [J/m]",
        "barrier_kinetic_energy [J/m]",
        "pore_pressure_max [Pa]",
    }


def test_quantity_without_a_unit_is_refused(tmp_path):
    clock = Clock()
    clock.sample = lambda names, *, since: {"time": 0.0, "mystery": 1.0}
    with pytest.raises(KeyError, match="No unit is known for mystery"):
        TimeSeriesRecorder(tmp_path / "series.csv", 0.1).record(clock)


def test_snapshots_round_trip(tmp_path):
    record(tmp_path)
    with Snapshots(tmp_path / "snapshots.vtkhdf") as snapshots:
        assert snapshots.times == pytest.approx(np.arange(9) * 0.25)
        assert len(snapshots) == 9
        for frame in snapshots:
            number = 50 - int(frame.time * 10)
            index = np.arange(number)
            assert frame.position.shape == (number, 2)
            assert (frame["pore_pressure"] == np.float32(1000.0 * index + frame.time)).all()
            assert (frame["solid_velocity"] == np.stack([index, -index], axis=1)).all()
            assert (frame["effective_stress"][:, 3] == 4 * index).all()
            assert frame.barrier_displacement == 0.25 * frame.time
            assert "liquid_velocity" not in frame
        assert snapshots.at(1.1).time == 1.0
        assert snapshots[-1].time == 2.0
        with pytest.raises(IndexError, match="holds 9 snapshots"):
            snapshots[9]


def open_in_vtk(path):
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    return reader


def frame_in_vtk(reader, step):
    reader.SetStep(step)
    reader.Update()
    return reader.GetOutputDataObject(0)


@pytest.mark.parametrize("step", [0, 3, 8])
def test_vtk_reads_the_animation(tmp_path, step):
    record(tmp_path)
    reader = open_in_vtk(tmp_path / "snapshots.vtkhdf")
    assert reader.GetNumberOfSteps() == 9
    grid = frame_in_vtk(reader, step)
    assert reader.GetTimeValue() == pytest.approx(0.25 * step)
    number = 50 - int(0.25 * step * 10)
    index = np.arange(number)
    assert grid.GetNumberOfPoints() == grid.GetNumberOfCells() == number
    assert {grid.GetCellType(cell) for cell in range(number)} == {1}
    assert [grid.GetCell(cell).GetPointId(0) for cell in range(number)] == list(index)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    assert (points == np.stack([index, 0 * index + np.float32(0.25 * step), 0 * index], axis=1)).all()
    data = grid.GetPointData()
    assert (vtk_to_numpy(data.GetArray("pore_pressure")) == np.float32(1000.0 * index + 0.25 * step)).all()
    assert vtk_to_numpy(data.GetArray("solid_velocity")).shape == (number, 3)
    stress = vtk_to_numpy(data.GetArray("effective_stress"))
    assert (stress[:, :4] == np.outer(index, [1, 2, 3, 4])).all()
    assert not stress[:, 4:].any()
    displacement = grid.GetFieldData().GetArray("barrier_displacement")
    assert vtk_to_numpy(displacement) == pytest.approx([0.0625 * step])


def test_units_stand_beside_the_fields(tmp_path):
    record(tmp_path)
    with h5py.File(tmp_path / "snapshots.vtkhdf") as file:
        assert file["VTKHDF/PointData/pore_pressure"].attrs["unit"] == "Pa"
        assert file["VTKHDF/PointData/solid_velocity"].attrs["unit"] == "m/s"
        assert file["VTKHDF/Points"].shape[0] == file["VTKHDF/NumberOfPoints"][:].sum()


def _record_and_die(folder):
    clock = Clock()
    recorders = [
        TimeSeriesRecorder(folder / "series.csv", 0.1),
        SnapshotRecorder(folder / "snapshots.vtkhdf", 0.25, 4.0),
    ]

    def die(simulation):
        if simulation.time > 1.3:
            os.kill(os.getpid(), signal.SIGKILL)

    record_until(clock, recorders, 4.0, on_step=die)


def test_nothing_is_lost_when_the_process_is_killed(tmp_path):
    process = multiprocessing.get_context("fork").Process(target=_record_and_die, args=(tmp_path,))
    process.start()
    process.join(60)
    assert process.exitcode == -signal.SIGKILL
    assert read_time_series(tmp_path / "series.csv")["time"][-1] == pytest.approx(1.4)
    with Snapshots(tmp_path / "snapshots.vtkhdf") as snapshots:
        assert snapshots.times[-1] == 1.25
        assert (snapshots[-1]["pore_pressure"] == np.float32(1000.0 * np.arange(38) + 1.25)).all()
    reader = open_in_vtk(tmp_path / "snapshots.vtkhdf")
    assert reader.GetNumberOfSteps() == 6
    assert frame_in_vtk(reader, 5).GetNumberOfPoints() == 38


def test_reading_while_the_run_goes_on(tmp_path):
    clock = Clock()
    recorder = SnapshotRecorder(tmp_path / "snapshots.vtkhdf", 0.5, 4.0)
    record_until(clock, [recorder], 1.0)
    with Snapshots(tmp_path / "snapshots.vtkhdf") as snapshots:
        assert len(snapshots) == 3
    recorder.close()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("time [s],speed [m]\n1,2\n", "column 'speed"),
        ("time [s]\n1\nx\n", "damaged in line 3"),
        ("time [s],impact_force_x [N/m]\n1,2\n3\n", "damaged in line 3"),
    ],
)
def test_damaged_time_series(tmp_path, text, message):
    path = tmp_path / "series.csv"
    path.write_text(text)
    with pytest.raises(ResultsError, match=message):
        read_time_series(path)


def test_a_torn_last_line_is_left_out(tmp_path):
    record(tmp_path)
    path = tmp_path / "series.csv"
    path.write_text(path.read_text()[:-9])
    assert len(read_time_series(path)["time"]) == 20


@pytest.mark.parametrize("content", [None, b"", b"no HDF5 at all"])
def test_damaged_snapshots(tmp_path, content):
    path = tmp_path / "snapshots.vtkhdf"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ResultsError, match="is missing" if content is None else "cannot be read as HDF5"):
        Snapshots(path)


def test_truncated_snapshots(tmp_path):
    record(tmp_path)
    path = tmp_path / "snapshots.vtkhdf"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ResultsError):
        _ = [frame.time for frame in Snapshots(path)]


def test_a_run_folder_is_never_overwritten_unasked(tmp_path):
    path = tmp_path / "deep" / "run"
    first = RunFolder.create(path, {"title": "a"}, {"status": "running"})
    (path / "mine.txt").write_text("notes")
    (path / run_folder.TIME_SERIES).write_text("old")
    with pytest.raises(RunFolderError, match=r"holds a run already; .* --force"):
        RunFolder.create(path, {}, {})
    with pytest.raises(RunFolderError, match="Another run is writing to"):
        RunFolder.create(path, {}, {}, force=True)
    first.release()
    RunFolder.create(path, {"title": "b"}, {"status": "running"}, force=True)
    assert '"b"' in (path / run_folder.SCENARIO).read_text()
    assert not (path / run_folder.TIME_SERIES).exists()
    assert (path / "mine.txt").read_text() == "notes"


def test_a_folder_of_something_else_is_refused_even_with_force(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    for force in (False, True):
        with pytest.raises(RunFolderError, match="no run has written"):
            RunFolder.check(tmp_path, force=force)
    with pytest.raises(RunFolderError, match="is a file"):
        RunFolder.check(tmp_path / "thesis.tex", force=True)


def test_an_empty_folder_is_used(tmp_path):
    RunFolder.create(tmp_path, {}, {})
    assert (tmp_path / run_folder.RECORD).is_file()


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="Cannot write to"):
        RunFolder.create(tmp_path / "file" / "run", {}, {})
