"""The unit DebrisFlow: the material point simulation of a scenario, run in a process of its own."""

from __future__ import annotations

import contextlib
import json
import os
import time
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warp_mpm.quantities.time_series import NAMED

from .interface import (
    CUBIC_METRE_PER_METRE,
    METRE,
    METRE_PER_SECOND,
    NEWTON_PER_METRE,
    SECOND,
    UNITS,
    Choice,
    Interface,
    Unit,
    Variable,
)
from .slave import UnitError, UnitSlave, sealed
from .worker_process import WorkerProcess

SCENARIO = "scenario.json"
"""File in the archive's resources with the scenario that runs unless another is named."""

BARRIER_MOTION = Choice(
    "BarrierMotion",
    "What moves the barrier",
    (
        ("as_scenario", "The scenario says: it is fixed, slides under the flow and external_force, or follows a table"),
        ("driven", "The input barrier_velocity_input, from another unit"),
    ),
)


def _force(name: str, description: str) -> Variable:
    return Variable(name, "output", description, unit=NEWTON_PER_METRE, nominal=1e5)


def _output(name: str, description: str, unit: Unit, nominal: float = 1.0, minimum: float | None = None) -> Variable:
    return Variable(name, "output", description, unit=unit, nominal=nominal, minimum=minimum)


def _recorded(name: str, nominal: float = 1.0, minimum: float | None = None) -> Variable:
    """A quantity of the simulator's time series; its interval is here the step."""
    quantity = NAMED[name]
    meaning = quantity.meaning.replace("interval", "step")
    return _output(name, meaning[0].upper() + meaning[1:], UNITS[quantity.unit], nominal, minimum)


INTERFACE = Interface(
    "DebrisFlow",
    "Two-phase material point simulation of a debris flow that hits a rigid barrier, per metre of width",
    (
        Variable(
            "scenario_file",
            "parameter",
            "Path of the scenario file; empty takes the scenario in the archive",
            "String",
            start="",
        ),
        Variable("device", "parameter", "Device that computes: cpu, cuda:0 and so on", "String", start="cpu"),
        Variable(
            "spacing",
            "parameter",
            "Spacing of the computational grid; 0 takes the scenario's",
            unit=METRE,
            start=0.0,
            minimum=0.0,
        ),
        Variable("barrier_motion", "parameter", BARRIER_MOTION.description, "Integer", start=1, choice=BARRIER_MOTION),
        Variable(
            "reply_time_limit",
            "parameter",
            "Longest wall time that the simulator may take for one step, or for its start",
            unit=SECOND,
            start=600.0,
            minimum=0.0,
            open_minimum=True,
            nominal=100.0,
        ),
        Variable(
            "gauge_position",
            "parameter",
            "Place along x at which gauge_depth is measured; the toe of the barrier is at 0, upstream is below 0",
            unit=METRE,
            start=-1.0,
            minimum=-1e6,
            maximum=1e6,
        ),
        Variable(
            "barrier_velocity_input",
            "input",
            "Velocity of the barrier where barrier_motion is driven, constant over a step",
            unit=METRE_PER_SECOND,
            start=0.0,
            minimum=-100.0,
            maximum=100.0,
        ),
        Variable(
            "external_force",
            "input",
            "Horizontal force on a sliding barrier per metre of width beside the flow's, positive downstream",
            unit=NEWTON_PER_METRE,
            start=0.0,
            minimum=-1e9,
            maximum=1e9,
            nominal=1e5,
        ),
        _recorded("impact_force_x", 1e5),
        _recorded("impact_force_y", 1e5),
        _recorded("top_force", 1e5),
        _force("barrier_force", "Force of the flow on all of the barrier along x, mean over the step"),
        _force("vertical_load", "Downward force of the flow on all of the barrier, mean over the step"),
        _recorded("barrier_velocity"),
        _recorded("barrier_displacement"),
        _recorded("pore_pressure_max", 1e5),
        _recorded("flow_kinetic_energy", 1e6, 0.0),
        _output("overtopped_volume", "Volume of the flow beyond the crest per metre", CUBIC_METRE_PER_METRE, 10.0, 0.0),
        _output("gauge_depth", "Depth of the flow at gauge_position, mean over two grid spacings", METRE, 1.0, 0.0),
        Variable("time_ratio", "output", "Simulated time over wall time since the start", minimum=0.0),
        Variable("message", "output", "What went wrong, in one sentence; empty while all is well", "String"),
    ),
    stop_time=6.0,
    step_size=0.01,
)

_COUNTED = ("overtopped_volume", "gauge_depth")
"""Outputs that take all material points: counted for an importer that asks for one, and then within each step."""

_NOT_SAMPLED = (*_COUNTED, "time_ratio", "message")
_SAMPLED = tuple(v.name for v in INTERFACE.of("output") if v.name not in _NOT_SAMPLED)
_COUNTED_REFERENCES = frozenset(INTERFACE.references[name] for name in _COUNTED)


class WorkerState:
    """A state of the simulation that the worker keeps; released there when it is released here."""

    def __init__(self, worker: WorkerProcess, key: int, time_limit: float) -> None:
        self.worker, self.key, self.time_limit = worker, key, time_limit
        self.kept: str | None = None

    def data(self) -> str:
        """The state itself, as text."""
        return self.kept or self.worker.ask("export_state", self.time_limit, key=self.key)["data"]

    def keep(self) -> None:
        """Outlive the worker."""
        with contextlib.suppress(UnitError):
            self.kept = self.data()

    def __del__(self) -> None:
        with contextlib.suppress(UnitError):
            self.worker.ask("drop_state", 5.0, key=self.key)


class DebrisFlowSlave(UnitSlave):
    """The simulation as a co-simulation unit: passes inputs to the worker, outputs from it."""

    interface = INTERFACE

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.worker: WorkerProcess | None = None
        self.opened: dict[str, Any] = {}
        self.states: weakref.WeakSet[WorkerState] = weakref.WeakSet()
        self.start_time = 0.0
        self.wall_time = 0.0
        self.counts_due = self.counts_wanted = False

    def start(self) -> None:
        self.start_time, self.wall_time = self.time, 0.0
        self._take(self._open().ask("sample", self["reply_time_limit"]))

    def _open(self) -> WorkerProcess:
        """The worker with the scenario that the parameters name; the present one if it has that."""
        settings = {
            "scenario": os.path.abspath(self["scenario_file"] or Path(self.resources) / SCENARIO),
            "device": self["device"],
            "spacing": self["spacing"] or None,
            "driven": BARRIER_MOTION.name_of(self["barrier_motion"]) == "driven",
        }
        if self.worker is None or not self.worker.alive or settings != self.opened:
            self.close()
            self.worker = WorkerProcess(str(self.resources))
            try:
                # Compiles the kernels too, so that no step has to.
                self.worker.ask("open", self["reply_time_limit"], **settings)
            except UnitError:
                self.close()
                raise
            self.opened = settings
        return self.worker

    def step(self, end: float) -> None:
        assert self.worker is not None
        if not self.opened["driven"] and self["barrier_velocity_input"] != 0.0:
            raise UnitError(
                f"barrier_velocity_input is {self['barrier_velocity_input']:g} m/s, it must be 0 m/s unless "
                "barrier_motion is 2 (driven)."
            )
        started = time.perf_counter()
        answer = self.worker.ask(
            "step",
            self["reply_time_limit"],
            until=end - self.start_time,
            barrier_velocity=self["barrier_velocity_input"] if self.opened["driven"] else None,
            external_force=self["external_force"],
            gauge=self["gauge_position"] if self.counts_wanted else None,
        )
        self.wall_time += time.perf_counter() - started
        self["time_ratio"] = (end - self.start_time) / self.wall_time
        self._take(answer)

    def _take(self, answer: dict[str, Any]) -> None:
        for name in _SAMPLED:
            self[name] = answer[name]
        if self.wall_time == 0.0:
            self["time_ratio"] = 0.0
        self["message"] = ""
        self.counts_due = _COUNTED[0] not in answer
        for name in _COUNTED:
            self[name] = answer.get(name, 0.0)  # until it is asked for

    def _get(self, kind: str, references: Sequence[int]) -> list[Any]:
        due = self.counts_due and self.worker is not None
        if due and kind == "Real" and not _COUNTED_REFERENCES.isdisjoint(references):
            self.counts_due, self.counts_wanted = False, True
            assert self.worker is not None
            try:
                answer = self.worker.ask("count", self["reply_time_limit"], gauge=self["gauge_position"])
                for name in _COUNTED:
                    self[name] = answer[name]
            except UnitError as error:
                self.fail(str(error))
        return super()._get(kind, references)

    def fail(self, message: str) -> None:
        super().fail(message)
        self.counts_due = False

    def close(self) -> None:
        worker, self.worker = getattr(self, "worker", None), None
        if worker is not None:
            for state in list(self.states):
                state.keep()
            worker.close()

    def __del__(self) -> None:
        # An importer may free an instance without terminating it.
        self.close()

    def snapshot(self) -> Any:
        assert self.worker is not None
        limit = self["reply_time_limit"]
        state = WorkerState(self.worker, self.worker.ask("save_state", limit)["key"], limit)
        self.states.add(state)
        return {"worker_state": state, "start_time": self.start_time, "wall_time": self.wall_time}

    def restore(self, snapshot: Any) -> None:
        state, limit = snapshot["worker_state"], self["reply_time_limit"]
        self.start_time, self.wall_time = snapshot["start_time"], snapshot["wall_time"]
        worker = self._open()
        self.counts_due = True
        if isinstance(state, WorkerState) and state.worker is worker:
            worker.ask("restore_state", limit, key=state.key)
        else:
            worker.ask("import_state", limit, data=state.data() if isinstance(state, WorkerState) else state)

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        snapshot = state.get("snapshot")
        try:
            if snapshot is not None and isinstance(snapshot["worker_state"], WorkerState):
                snapshot = {**snapshot, "worker_state": snapshot["worker_state"].data()}
            return sealed(json.dumps({**state, "snapshot": snapshot}).encode())
        except UnitError as error:  # no exception may go to the wrapper from here, see `_fmu_state_from_bytes`
            return sealed(json.dumps({"fault": f"The state could not be serialized: {error}"}).encode())
