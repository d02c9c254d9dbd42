"""What other programs see of a run: ParaView's reader, pandas, xarray."""

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

from warp_mpm.recording import run_folder
from warp_mpm.recording.surfaces import BARRIER, GROUND
from warp_mpm.results import Results
from warp_mpm.run import evaluate, run_scenario


@pytest.fixture(scope="module")
def run(tmp_path_factory, coarse_case_1, flying_points):
    path = tmp_path_factory.mktemp("ecosystem") / "run"
    run_scenario(coarse_case_1, path, make_simulation=flying_points)
    return path


def read(path, step):
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    reader.SetStep(step)
    reader.Update()
    return reader, reader.GetOutput()


def test_surfaces_in_paraview_move_as_the_barrier(run):
    snapshots = Results.open(run).snapshots
    for step in (0, 17, len(snapshots) - 1):
        reader, grid = read(run / run_folder.SURFACES, step)
        assert reader.GetNumberOfSteps() == len(snapshots)
        assert reader.GetTimeValue() == pytest.approx(snapshots.times[step])
        part = vtk_to_numpy(grid.GetCellData().GetArray("part"))
        assert list(part) == [GROUND, BARRIER]
        # VTK lends the same cell each time.
        corners = [vtk_to_numpy(grid.GetCell(cell).GetPoints().GetData())[:, :2].copy() for cell in range(2)]
        # Case 1: toe at the origin, B = 11 m, b = 4 m, H = 6 m.
        shift = np.array([snapshots[step].barrier_displacement, 0.0])
        expected = np.array([[0, 0], [3.5, 6], [7.5, 6], [11, 0]]) + shift
        assert corners[1] == pytest.approx(expected, abs=1e-5)
        assert corners[0][:, 1].max() == 0.0
        assert corners[0][:, 0].min() <= min(frame.position[:, 0].min() for frame in snapshots)


def test_snapshots_and_surfaces_have_the_same_times(run):
    times = []
    for name in (run_folder.SNAPSHOTS, run_folder.SURFACES):
        reader, _ = read(run / name, 0)
        information = reader.GetOutputInformation(0)
        times.append(information.Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()))
    assert len(times[0]) == len(Results.open(run).snapshots)
    assert times[0] == times[1]


def test_scene_with_nothing_solid_has_no_surfaces(tmp_path, load_scene, flying_points):
    scene = load_scene("case_5", **{"numerics.spacing_m": 1.0, "output.end_time_s": 0.2})
    run_scenario(scene, tmp_path / "wall", make_simulation=flying_points)
    _, grid = read(tmp_path / "wall" / run_folder.SURFACES, 0)
    assert list(vtk_to_numpy(grid.GetCellData().GetArray("part"))) == [GROUND, BARRIER]  # the wall without end

    class Unobstructed(flying_points):
        def sample(self, names=None, *, since=None):
            series = super().sample(since=since).items()
            return {name: value for name, value in series if not name.startswith(("impact", "barrier"))}

    bare = {**scene.resolved(), "barrier": None, "ground": None}
    run_scenario(type(scene).model_validate(bare), tmp_path / "bare", make_simulation=Unobstructed)
    assert not (tmp_path / "bare" / run_folder.SURFACES).exists()


def test_evaluation_brings_surfaces_to_an_older_run(run):
    (run / run_folder.SURFACES).unlink()
    evaluate(run)
    assert (run / run_folder.SURFACES).exists()


def test_time_series_as_a_data_frame(run):
    results = Results.open(run)
    frame = results.frame()
    assert frame.index.name == "time"
    assert frame["impact_force_x"].to_numpy() == pytest.approx(results.time_series["impact_force_x"])
    assert frame.attrs["units"]["impact_force_x"] == "N/m"
    assert set(frame.attrs["units"]) == {"time", *frame.columns}
    assert frame.loc[1.0:2.0, "impact_force_x"].mean() > 0.0


def test_snapshots_as_a_dataset(run):
    results = Results.open(run)
    dataset = results.dataset()
    snapshot = results.snapshots.at(1.0)
    at = dataset.sel(time=1.0, method="nearest")
    assert at["pore_pressure"].to_numpy() == pytest.approx(snapshot["pore_pressure"])
    assert at["effective_stress"].sel(component="xy").to_numpy() == pytest.approx(snapshot["effective_stress"][:, 3])
    assert at["position"].sel(axis="y").to_numpy() == pytest.approx(snapshot.position[:, 1])
    assert dataset["pore_pressure"].attrs["units"] == "Pa"
    assert float(at["barrier_displacement"]) == pytest.approx(snapshot.barrier_displacement)


def test_points_that_left_are_missing_values(tmp_path, coarse_case_1, flying_points):
    class Leaving(flying_points):
        def points(self):
            keep = len(self._start.volume) - (100 if self.time > 1.0 else 0)
            return {name: values[:keep] for name, values in super().points().items()}

    run_scenario(coarse_case_1, tmp_path / "run", make_simulation=Leaving)
    pressure = Results.open(tmp_path / "run").dataset()["pore_pressure"]
    assert int(pressure.sel(time=0.5, method="nearest").isnull().sum()) == 0
    assert int(pressure.sel(time=2.0, method="nearest").isnull().sum()) == 100
