"""Recorders: what a run writes while it goes on. They read the simulation; the simulation knows nothing of them."""

from warp_mpm.recording.run_folder import RunFolder
from warp_mpm.recording.schedule import Recorder, Schedule, record_until
from warp_mpm.recording.snapshots import SnapshotRecorder
from warp_mpm.recording.time_series import TimeSeriesRecorder

__all__ = ["Recorder", "RunFolder", "Schedule", "SnapshotRecorder", "TimeSeriesRecorder", "record_until"]
