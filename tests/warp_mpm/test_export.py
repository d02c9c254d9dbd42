"""Snapshots for readers of VTK XML, read by VTK itself."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.results import Results
from warp_mpm.run import run_scenario

vtk_io = pytest.importorskip("vtkmodules.vtkIOXML")


@pytest.fixture(scope="module")
def run(tmp_path_factory, coarse_case_1, flying_points):
    path = tmp_path_factory.mktemp("runs") / "case_1"
    run_scenario(coarse_case_1.replaced({"output.end_time_s": 0.2}), path, make_simulation=flying_points)
    return path


def read(path):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = vtk_io.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData())
    data = grid.GetPointData()
    arrays = {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}
    return grid, points, arrays


def test_every_snapshot_is_there_with_its_time(run):
    answer = CliRunner().invoke(app, ["export", str(run), "--vtu"])
    assert answer.exit_code == 0, answer.output
    results = Results.open(run)
    snapshots = results.snapshots
    entries = re.findall(
        r'<DataSet timestep="(.*?)" part="(\d)" file="(.*?)"/>', (run / "vtu/snapshots.pvd").read_text()
    )
    assert [float(time) for time, part, _ in entries if part == "0"] == pytest.approx(list(snapshots.times), abs=1e-9)
    assert answer.output.strip().endswith(f"({len(snapshots)} snapshots)")
    number = len(snapshots) - 1
    grid, points, arrays = read(run / f"vtu/points_{number:05d}.vtu")
    snapshot = snapshots[number]
    assert grid.GetNumberOfCells() == len(snapshot.position)
    np.testing.assert_allclose(points[:, :2], snapshot.position, rtol=1e-6)
    assert not points[:, 2].any()
    np.testing.assert_allclose(arrays["pore_pressure [Pa]"], snapshot["pore_pressure"], rtol=1e-6)
    assert arrays["solid_velocity [m/s]"].shape == (len(points), 3)
    np.testing.assert_allclose(arrays["effective_stress [Pa]"][:, :4], snapshot["effective_stress"], rtol=1e-6)
    # The barrier where it stands at that time.
    grid, corners, _ = read(run / f"vtu/surfaces_{number:05d}.vtu")
    assert grid.GetNumberOfCells() == 2
    barrier = results.scenario.barrier.shape.polygon + np.array([snapshot.barrier_displacement, 0.0])
    np.testing.assert_allclose(corners[-4:, :2], barrier, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["RUN"], "--vtu is missing; it must be given, as the one format that there is."),
        (["nowhere", "--vtu"], "nowhere is no folder."),
        (["RUN", "--vtu", "--out", "RUN/run.json"], "run.json cannot be written: it is no folder."),
    ],
)
def test_what_cannot_be_exported(run, words, sentence):
    answer = CliRunner().invoke(app, ["export", *(word.replace("RUN", str(run)) for word in words)])
    assert (answer.exit_code, answer.stdout) == (2, "")
    assert answer.stderr.rstrip().endswith(sentence)
