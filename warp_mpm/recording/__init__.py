"""Recorders: what a run writes while it goes on. They read the simulation; the simulation knows nothing of them."""

from warp_mpm.recording.checkpoint import Checkpointer, read_checkpoint
from warp_mpm.recording.loads import LoadsRecorder
from warp_mpm.recording.memory import LoadsInMemory, SeriesInMemory, SnapshotsInMemory, Watcher
from warp_mpm.recording.run_folder import RunFolder
from warp_mpm.recording.schedule import Moments, Recorder, Schedule, record_until
from warp_mpm.recording.snapshots import SnapshotRecorder
from warp_mpm.recording.time_series import TimeSeriesRecorder

__all__ = [
    "Checkpointer",
    "LoadsInMemory",
    "LoadsRecorder",
    "Moments",
    "Recorder",
    "RunFolder",
    "Schedule",
    "SeriesInMemory",
    "SnapshotRecorder",
    "SnapshotsInMemory",
    "TimeSeriesRecorder",
    "Watcher",
    "read_checkpoint",
    "record_until",
]
