"""The process in which the simulator of a DebrisFlow unit runs, seen from the importer's side.

The importer's process runs no simulator: its Python may be another one, and the simulator's libraries have been seen to
bring hosts down. Requests and answers are one line of JSON each, over the standard input and output of the worker.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import queue
import select
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import IO, Any

from .protocol import PROTOCOL
from .slave import UnitError

INTERPRETER_VARIABLE = "WARP_MPM_PYTHON"
"""Environment variable that names the Python of the worker, above the one recorded when the archive was built."""

RECORD = "worker.json"
"""File in the archive's resources that names the Python which built it, the worker's module and where it found that."""

PLAIN_RECORD = "worker.txt"
"""The same, a line each, for the unit in C."""

START_TIME_LIMIT = 60.0
"""Longest time [s] that a worker may take to say that it is there."""

# What a host sets for its own Python, or preloads into it, must not reach the worker's.
_HOST_ONLY = ("LD_PRELOAD", "PYTHONHOME", "PYTHONPATH", "PYTHONEXECUTABLE", "PYTHONSTARTUP", "__PYVENV_LAUNCHER__")
_CHUNK = 1 << 20
LAUNCH = "import sys, importlib; sys.path[:0] = sys.argv[2:]; importlib.import_module(sys.argv[1]).main()"
INSTALLED_WORKER = "warp_mpm_fmu.worker"
"""The worker's module where this project is installed; in a checkout it is `fmu.worker`."""


class WorkerProcess:
    """One worker; started at once, ended by `close` or when this object is released.

    Raises:
        UnitError: there is no interpreter, it does not start, or it has no simulator; one sentence that says what to
            do.
    """

    def __init__(self, resources: str) -> None:
        interpreter, *arguments = find_interpreter(resources)
        environment = {name: value for name, value in os.environ.items() if name.upper() not in _HOST_ONLY}
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the worker
        try:
            self._process: subprocess.Popen[bytes] | None = subprocess.Popen(
                # -P: the host's working folder is no place to import from.
                [interpreter, "-P", "-c", LAUNCH, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                # Without buffers: they hide what has come from a poll, and their locks can abort a host at its exit.
                bufsize=0,
                env=environment,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            self._process = None
            self._errors.close()
            raise UnitError(
                f"The simulator's Python {interpreter} does not start ({error.strerror}): "
                f"set {INTERPRETER_VARIABLE} to the Python of the environment that has warp-mpm-impact."
            ) from None
        assert self._process.stdout is not None
        self._lines = _Lines(self._process.stdout)
        try:
            hello = self._answer("start", START_TIME_LIMIT)
        except UnitError as error:
            _, absent, name = str(error).partition("No module named ")
            if not absent:
                raise
            raise UnitError(
                f"The Python {interpreter} has no warp-mpm-impact ({absent}{name.rstrip('.')}): install it there, or "
                f"set {INTERPRETER_VARIABLE} to the Python of an environment that has it."
            ) from None
        if hello.get("protocol") != PROTOCOL:
            self.close()
            raise UnitError(
                f"The simulator at {interpreter} speaks version {hello.get('protocol')} of the protocol, this archive "
                f"version {PROTOCOL}: install the release of warp-mpm-impact that built the archive."
            )

    def ask(self, request: str, time_limit: float, **arguments: Any) -> dict[str, Any]:
        """Send a request and wait for its answer.

        Raises:
            UnitError: the simulator refused or failed, the worker died, or it did not answer in time and was ended.
        """
        if self._process is None or self._process.stdin is None:
            raise UnitError("The simulator's process has ended.")
        line = memoryview((json.dumps({"request": request, **arguments}) + "\n").encode())
        try:
            while line:
                line = line[self._process.stdin.write(line) :]
        except OSError:
            raise UnitError(self._obituary(request)) from None
        return self._answer(request, time_limit)

    @property
    def process_id(self) -> int | None:
        """Number of the worker's process, None after its end."""
        return self._process.pid if self._process else None

    @property
    def alive(self) -> bool:
        """Whether the worker still runs."""
        return self._process is not None and self._process.poll() is None

    def close(self, patience: float = 5.0) -> None:
        """End the worker and wait for its end; without patience [s] it is killed."""
        process, self._process = getattr(self, "_process", None), None
        if process is None or process.stdin is None or process.stdout is None:
            return
        if patience > 0:
            with contextlib.suppress(OSError, subprocess.TimeoutExpired):
                process.stdin.close()  # a worker ends when its input does
                process.wait(patience)
        if process.poll() is None:
            process.kill()
            process.wait()
        for pipe in (process.stdin, process.stdout, self._errors):
            with contextlib.suppress(OSError):
                pipe.close()

    __del__ = close

    def _answer(self, request: str, time_limit: float) -> dict[str, Any]:
        try:
            line = self._lines.next(time_limit)
        except TimeoutError:
            self._kill()
            raise UnitError(
                f"The simulator did not answer the request {request!r} within {time_limit:g} s and was ended; "
                "reply_time_limit sets how long to wait."
            ) from None
        if line is None:
            raise UnitError(self._obituary(request))
        try:
            answer = json.loads(line)
        except ValueError:
            self._kill()
            raise UnitError(f"The simulator's process sent what is no answer to {request!r}: {line[:80]!r}.") from None
        if "error" in answer:
            raise UnitError(answer["error"])
        return answer

    def _kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _obituary(self, request: str) -> str:
        """How the worker ended, with its last words."""
        assert self._process is not None
        self._process.wait()
        code = self._process.returncode
        how = f"by signal {-code}" if code < 0 else f"with exit code {code}"
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        words = f": {lines[-1].rstrip('.')}" if lines else ""
        return f"The simulator's process ended {how} during the request {request!r}{words}."


def find_interpreter(resources: str) -> list[str]:
    """The Python for the worker, the worker's module, and what must be added to the import path.

    Raises:
        UnitError: neither the environment variable nor the archive's record names a file that is there.
    """
    chosen = os.environ.get(INTERPRETER_VARIABLE)
    if chosen:
        if not Path(chosen).is_file():
            raise UnitError(f"{INTERPRETER_VARIABLE} is {chosen}, it must be the path of a Python interpreter.")
        return [chosen, INSTALLED_WORKER]
    try:
        record = json.loads((Path(resources) / RECORD).read_text(encoding="utf-8"))
    except OSError:
        record = {"interpreter": ""}
    if not Path(record["interpreter"]).is_file():
        raise UnitError(
            f"There is no Python for the simulator at {record['interpreter'] or 'any recorded place'}: "
            f"set {INTERPRETER_VARIABLE} to the Python of the environment that has warp-mpm-impact."
        )
    return [record["interpreter"], record["worker"], *record["import_path"]]


class _Lines:
    """Lines from a pipe, with a limit on the wait for each."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe, self._parts = pipe, b""
        # Windows cannot wait for a pipe with a limit, so there a thread waits without one.
        self._chunks: queue.SimpleQueue[bytes] | None = None
        if hasattr(select, "poll"):
            self._poll = select.poll()
            self._poll.register(pipe, select.POLLIN)
        else:
            self._chunks = queue.SimpleQueue()
            threading.Thread(target=_read_chunks, args=(pipe, self._chunks), daemon=True).start()

    def next(self, time_limit: float) -> bytes | None:
        """The next line, None at the end; raises TimeoutError if none comes within the limit [s]."""
        end = time.monotonic() + time_limit
        while b"\n" not in self._parts:
            chunk = self._chunk(max(end - time.monotonic(), 0.0))
            if not chunk:
                return None
            self._parts += chunk
        line, _, self._parts = self._parts.partition(b"\n")
        return line

    def _chunk(self, time_limit: float) -> bytes:
        if self._chunks is not None:
            try:
                return self._chunks.get(timeout=time_limit)
            except queue.Empty:
                raise TimeoutError from None
        if not self._poll.poll(math.ceil(1000 * time_limit)):
            raise TimeoutError
        return os.read(self._pipe.fileno(), _CHUNK)


def _read_chunks(pipe: IO[bytes], chunks: queue.SimpleQueue[bytes]) -> None:
    with contextlib.suppress(OSError, ValueError):  # the pipe may be closed under way
        while chunk := pipe.read(_CHUNK):
            chunks.put(chunk)
    chunks.put(b"")
