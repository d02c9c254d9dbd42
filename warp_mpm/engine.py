"""Many runs: each task in a process of its own, since Warp's CPU backend uses one core for one scene; or on Dask.

Whatever runs many scenes goes through here: `run A.json B.json`, studies of accuracy, sweeps.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol, Self

POLL = 0.2
"""Time between looks at what runs [s]."""

DIED = "the process died, for want of memory perhaps"

_CONTEXT = multiprocessing.get_context("spawn")
"""Warp's state does not survive a fork."""

ALLOWED_FAILURES = 5
"""How many of Dask's workers may die under a task before it counts as failed: one that kills them must not go on."""


def cores() -> int:
    """Cores that this process may use: of a batch job or a container its share, not the whole machine."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class Task:
    """A call of a function of a module, with arguments that can be sent to another process."""

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = field(repr=False)


@dataclass(frozen=True)
class Ended:
    """How a task ended."""

    task: Task
    result: Any
    """What the function returned; None where there is a problem."""
    problem: str | None = None
    """What it raised, or that its process died; one sentence."""
    died: bool = False
    """Whether its process died, for want of memory say."""
    exit_code: int | None = None
    """Of a process that died; less than 0: what signal ended it."""


class Engine(Protocol):
    """Runs tasks, some at once."""

    def run(
        self,
        tasks: Sequence[Task],
        *,
        on_start: Callable[[Task], None] = lambda task: None,
        on_look: Callable[[Task], None] = lambda task: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> Iterator[Ended]:
        """The ends of the tasks, as they come. Whoever breaks off ends what runs.

        Args:
            tasks: in the order in which they begin.
            on_start: called as a task begins.
            on_look: called for each running task, now and then.
            stop: asked now and then; true asks the running tasks to end (SIGTERM) and begins no more.
        """


@dataclass(frozen=True)
class Processes:
    """Processes of this machine, one for each task; a task that dies takes no other with it."""

    at_once: int

    def run(
        self,
        tasks: Sequence[Task],
        *,
        on_start: Callable[[Task], None] = lambda task: None,
        on_look: Callable[[Task], None] = lambda task: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> Iterator[Ended]:
        """As of any engine."""

        def begun(task: Task) -> tuple[Connection, SpawnProcess]:
            ours, theirs = _CONTEXT.Pipe(duplex=False)
            process = _CONTEXT.Process(target=_work, args=(theirs, task.function, task.arguments), name=task.name)
            return _started(process, ours, theirs)

        def ended(task: Task, pipe: Connection, process: SpawnProcess) -> Ended:
            end = _end_of(task, pipe, process)
            if not end.died:
                pipe.close()
                process.join()
            return end

        return _in_turn(tasks, self.at_once, begun, ended, on_start, on_look, stop)


class Standing:
    """Processes of this machine that stay for the tasks to come, where a task is as short as a process's beginning.

    A context manager; at its end they are gone.
    """

    def __init__(self, at_once: int):
        self.at_once = at_once
        self._idle: list[tuple[Connection, SpawnProcess]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *of_an_error: object) -> None:
        for pipe, process in self._idle:
            process.terminate()
            pipe.close()
            process.join()
        self._idle.clear()

    def run(
        self,
        tasks: Sequence[Task],
        *,
        on_start: Callable[[Task], None] = lambda task: None,
        on_look: Callable[[Task], None] = lambda task: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> Iterator[Ended]:
        """As of any engine."""

        def ended(task: Task, pipe: Connection, process: SpawnProcess) -> Ended:
            end = _end_of(task, pipe, process)
            if not end.died:
                self._idle.append((pipe, process))
            return end

        return _in_turn(tasks, self.at_once, self._given, ended, on_start, on_look, stop)

    def _given(self, task: Task) -> tuple[Connection, SpawnProcess]:
        """A process that has been given the task: one that stands idle, unless it has died meanwhile, or a new one."""
        while self._idle:
            ours, process = self._idle.pop()
            with contextlib.suppress(OSError):
                ours.send((task.function, task.arguments))
                return ours, process
            ours.close()
        ours, process = self._begun()
        ours.send((task.function, task.arguments))
        return ours, process

    def _begun(self) -> tuple[Connection, SpawnProcess]:
        ours, theirs = _CONTEXT.Pipe()
        return _started(_CONTEXT.Process(target=_serve, args=(theirs,), name="standing"), ours, theirs)


@dataclass(frozen=True)
class Dask:
    """The workers of a Dask scheduler; what a worker that died was at is run again by another."""

    client: Any

    def run(
        self,
        tasks: Sequence[Task],
        *,
        on_start: Callable[[Task], None] = lambda task: None,
        on_look: Callable[[Task], None] = lambda task: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> Iterator[Ended]:
        """As of any engine; tasks begin and are looked at where the workers are, so that nothing is told of that."""
        from distributed import as_completed

        futures = {
            self.client.submit(
                task.function, *task.arguments, key=f"{task.name}-{id(self.client)}-{place}", pure=False
            ): task
            for place, task in enumerate(tasks)
        }
        try:
            for future in as_completed(futures):
                if future.status == "finished":
                    yield Ended(futures[future], future.result())
                else:
                    yield Ended(futures[future], None, _problem(future), died=True)
                if stop():
                    return
        finally:
            for future in futures:
                with contextlib.suppress(Exception):  # the scheduler may be gone
                    future.cancel()


class SchedulerError(ValueError):
    """A Dask scheduler that does not answer; one sentence."""


@contextmanager
def dask_engine(workers: int, scheduler: str | None) -> Iterator[tuple[Dask, str]]:
    """Dask on the workers of a scheduler, or on `workers` processes of this machine, and the address of its dashboard.

    Raises:
        SchedulerError: the scheduler does not answer.
    """
    import dask
    import distributed

    with contextlib.ExitStack() as opened:
        opened.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": ALLOWED_FAILURES}))
        if scheduler is not None:
            try:
                client = opened.enter_context(distributed.Client(scheduler, timeout="10s"))
            except (OSError, ValueError) as error:
                raise SchedulerError(f"--scheduler {scheduler} does not answer: {error}.") from None
        else:
            cluster = opened.enter_context(
                distributed.LocalCluster(
                    n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
                )
            )
            client = opened.enter_context(distributed.Client(cluster))
        yield Dask(client), getattr(client, "dashboard_link", "") or ""


@contextmanager
def _held_ctrl_c() -> Iterator[None]:
    """Hear Ctrl-C only afterwards; a process that is begun meanwhile does not hear it before `_work`."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # whose start would let it through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(pipe: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Of a process: the task, and how it ended."""
    _leave_ctrl_c_to_parent()
    _answer(pipe, function, arguments)


def _serve(pipe: Connection) -> None:
    """Of a process that stays: one task after the other, until nobody asks any more."""
    _leave_ctrl_c_to_parent()
    with contextlib.suppress(EOFError):
        while True:
            _answer(pipe, *pipe.recv())


def _answer(pipe: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    result, problem = None, None
    try:
        result = function(*arguments)
    except Exception as error:
        problem = f"{type(error).__name__}: {error}"
    with contextlib.suppress(BrokenPipeError):  # nobody waits for it any more
        pipe.send((result, problem))


def _leave_ctrl_c_to_parent() -> None:
    """Ctrl-C is for the process that began this one, which passes it on once; and end with it."""
    if hasattr(os, "setsid"):
        os.setsid()
        heard = signal.signal(signal.SIGINT, signal.SIG_IGN)  # drops one that came before
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, heard)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Of a thread: end this process when the one that began it is gone, killed say, as if it had been asked to."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)


def _in_turn(
    tasks: Sequence[Task],
    at_once: int,
    begun: Callable[[Task], tuple[Connection, SpawnProcess]],
    ended: Callable[[Task, Connection, SpawnProcess], Ended],
    on_start: Callable[[Task], None],
    on_look: Callable[[Task], None],
    stop: Callable[[], bool],
) -> Iterator[Ended]:
    """The tasks in processes, `at_once` of them at a time: `begun` gives one a process, `ended` takes what it sent."""
    waiting = list(tasks)
    running: dict[Connection, tuple[Task, SpawnProcess]] = {}
    told = False
    try:
        while running or (waiting and not stop()):
            while waiting and len(running) < at_once and not stop():
                task = waiting.pop(0)
                pipe, process = begun(task)
                running[pipe] = task, process
                on_start(task)
            ready = wait(list(running), timeout=POLL)
            if stop() and not told:
                told = True
                for _, process in running.values():
                    process.terminate()
            for one in ready:
                assert isinstance(one, Connection)
                task, process = running.pop(one)
                yield ended(task, one, process)
            for task, _ in running.values():
                on_look(task)
    finally:
        for pipe, (_, process) in running.items():
            process.terminate()
            pipe.close()


def _started(process: SpawnProcess, ours: Connection, theirs: Connection) -> tuple[Connection, SpawnProcess]:
    """The process, begun, and our end of its pipe."""
    with _held_ctrl_c():
        process.start()
    theirs.close()
    return ours, process


def _end_of(task: Task, pipe: Connection, process: SpawnProcess) -> Ended:
    """What came of a task; a process that died is done with."""
    try:
        result, problem = pipe.recv()
    except EOFError:
        pipe.close()
        process.join()
        return Ended(task, None, DIED, True, process.exitcode)
    return Ended(task, result, problem)


def _problem(future: Any) -> str:
    try:
        error = future.exception(timeout=5)
    except Exception as unknown:
        error = unknown
    return f"{type(error).__name__}: {error}"
