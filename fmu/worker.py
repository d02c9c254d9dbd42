"""The worker of a DebrisFlow unit: runs the simulation in the user's own Python and answers requests over its pipes."""

from __future__ import annotations

import base64
import json
import math
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from warp_mpm.quantities.time_series import NAMED

from .units.protocol import PROTOCOL, RECORDED, SURFACE_FORCES

KEYS = {name: NAMED[name].key for name in RECORDED}
"""Of the outputs, in the simulator's samples."""
SAMPLED = frozenset({*KEYS.values(), *(f"{surface}_{axis}" for surface in SURFACE_FORCES for axis in "xy")})
"""All that a sample is asked for: more would cost at every step."""

HOST_CHECK_INTERVAL = 0.5
"""Time between looks at whether the host is still there [s], for a host that ends during a long step."""


class RefusedRequestError(Exception):
    """A request that cannot be met; the message is one sentence for the importer."""


class Worker:
    """The simulation behind one instance of a unit, and the states that its importer keeps."""

    def __init__(self) -> None:
        self.simulation: Any = None
        self.scenario: Any = None
        self.states: dict[int, bytes] = {}
        self.last_key = 0
        self.barrier_velocity: float | None = None
        self.external_force = 0.0
        self.crest_end: float | None = None
        """x of the crest's downstream end before the barrier moves [m]; None without a crest."""

    def open(self, *, scenario: str, device: str, spacing: float | None, driven: bool) -> dict[str, Any]:
        from warp_mpm.loading import no_garbage

        with no_garbage():
            from warp_mpm import Scenario, Simulation
            from warp_mpm.scenario.barrier import Trapezoid

        self.scenario = Scenario.load(Path(scenario))
        changes: dict[str, Any] = {}
        if spacing is not None:
            changes["numerics.spacing_m"] = spacing
        if driven:
            if self.scenario.barrier is None:
                raise RefusedRequestError("barrier_motion is 2 (driven), but the scenario has no barrier.")
            changes["barrier.motion"] = {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [0.0]}
        if changes:
            self.scenario = self.scenario.replaced(changes)
        shape = self.scenario.barrier.shape if self.scenario.barrier is not None else None
        if isinstance(shape, Trapezoid):  # a wall has no crest
            self.crest_end = float(shape.polygon[2, 0])
        self.simulation = Simulation(self.scenario, device=device)
        self.simulation.prepare()
        return {}

    def step(
        self, *, until: float, barrier_velocity: float | None, external_force: float, gauge: float | None
    ) -> dict[str, Any]:
        if barrier_velocity is not None and barrier_velocity != self.barrier_velocity:
            self.simulation.set_barrier_velocity(barrier_velocity)
            self.barrier_velocity = barrier_velocity
        if external_force != self.external_force:
            if self.scenario.barrier is None or self.scenario.barrier.motion.kind != "sliding":
                raise RefusedRequestError(
                    f"external_force is {external_force:g} N/m, it must be 0 N/m unless the barrier slides."
                )
            self.simulation.set_external_force(external_force)
            self.external_force = external_force
        if until > self.simulation.time:
            self.simulation.advance(until=until)
        return self.sample() | ({} if gauge is None else self.count(gauge=gauge))

    def sample(self) -> dict[str, Any]:
        values = self.simulation.sample(SAMPLED)
        wrong = [name for name, value in values.items() if not math.isfinite(value)]
        if wrong:
            raise RefusedRequestError(f"The simulation gave {values[wrong[0]]} for {wrong[0]}.")
        return {
            **{name: values.get(key, 0.0) for name, key in KEYS.items()},
            "barrier_force": sum(values.get(f"{surface}_x", 0.0) for surface in SURFACE_FORCES),
            "vertical_load": 0.0 - sum(values.get(f"{surface}_y", 0.0) for surface in SURFACE_FORCES),
        }

    def count(self, *, gauge: float) -> dict[str, Any]:
        """What takes all material points: volume beyond the crest as in ``mechanism.deposit``, and depth at the gauge,
        a place along x [m]. At every step it would cost to look at more than is told."""
        points, reach = self.simulation.points(("position", "volume", "solid_mass")), self.scenario.numerics.spacing_m
        x = points["position"][:, 0]
        volume = 0.0
        if self.crest_end is not None:
            beyond = points["solid_mass"][x > self.crest_end + self.simulation.barrier_displacement]
            volume = float(beyond.sum()) / self.scenario.flow.material.solid_partial_density
        depth = float(points["volume"][abs(x - gauge) <= reach].sum()) / (2.0 * reach)
        return {"overtopped_volume": volume, "gauge_depth": depth}

    def save_state(self) -> dict[str, Any]:
        self.last_key += 1
        self.states[self.last_key] = self._state()
        return {"key": self.last_key}

    def restore_state(self, *, key: int) -> dict[str, Any]:
        self._restore(self.states[key])
        return {}

    def drop_state(self, *, key: int) -> dict[str, Any]:
        self.states.pop(key, None)
        return {}

    def export_state(self, *, key: int) -> dict[str, Any]:
        return {"data": base64.b64encode(self.states[key]).decode()}

    def import_state(self, *, data: str) -> dict[str, Any]:
        self._restore(base64.b64decode(data))
        return {}

    def _state(self) -> bytes:
        inputs = json.dumps([self.barrier_velocity, self.external_force]).encode()
        return inputs + b"\n" + self.simulation.save_state()

    def _restore(self, state: bytes) -> None:
        inputs, _, simulation_state = state.partition(b"\n")
        self.simulation.restore_state(simulation_state)
        self.barrier_velocity, self.external_force = json.loads(inputs)


def main() -> None:
    """Answer requests until the input ends."""
    # Results go to a pipe of their own: whatever a library prints must not get between the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the host's to handle; the input ends with it
    if hasattr(select, "poll"):
        threading.Thread(target=_watch_host, daemon=True).start()
    _send(answers, {"protocol": PROTOCOL})
    worker = Worker()
    for line in sys.stdin.buffer:
        request = json.loads(line)
        _send(answers, answer(getattr(worker, request.pop("request")), request))


def answer(method: Callable[..., dict[str, Any]], arguments: dict[str, Any]) -> dict[str, Any]:
    """What a request comes to: its results, or one sentence of what is wrong."""
    try:
        return method(**arguments)
    except (RefusedRequestError, ValueError, RuntimeError) as error:
        return {"error": " ".join(str(error).split())}
    except Exception as error:
        import traceback

        traceback.print_exc()
        return {"error": f"{type(error).__name__}: {error}"}


def _send(answers: IO[str], message: dict[str, Any]) -> None:
    answers.write(json.dumps(message) + "\n")
    answers.flush()


def _watch_host() -> None:
    """End the process, a step under way included, when the host has closed the pipe or has gone."""
    host, hangup = os.getppid(), select.poll()
    hangup.register(0, 0)  # reports the other end's closing alone
    while not hangup.poll(0) and os.getppid() == host:
        time.sleep(HOST_CHECK_INTERVAL)
    os._exit(0)


if __name__ == "__main__":
    main()
