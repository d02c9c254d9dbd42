"""Workers of the simulator that are there at once: each is forked off a process that has everything loaded.

    with forked_workers(scenario, spacing) as python: ...

`python` is a program that stands in for the Python that a unit starts its worker with (`WARP_MPM_PYTHON`). It hands its
standard streams to the process that waits there, which forks; the fork runs the worker's own `main` on them. What a
thousand starts would spend on loading is so spent once.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]

STAND_IN = """#!{python} -SE
import os, socket
with socket.socket(socket.AF_UNIX) as line:
    line.connect({address!r})
    socket.send_fds(line, [b"streams"], [0, 1, 2])
    for stream in range(3):
        os.close(stream)
    line.recv(1)  # ends with the worker
"""


@contextmanager
def forked_workers(scenario: Path, spacing: float) -> Iterator[Path]:
    """The stand-in, as long as workers can be forked; kernels of the scenario are loaded beforehand."""
    with tempfile.TemporaryDirectory(prefix="fork_") as folder:
        address, program = str(Path(folder) / "line"), Path(folder) / "python"
        program.write_text(STAND_IN.format(python=sys.executable, address=address))
        program.chmod(0o755)
        command = [sys.executable, "-P", __file__, address, scenario, str(spacing)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            if not process.stdout.readline():
                raise RuntimeError("no worker can be forked")
            yield program
            process.stdin.close()  # ends it


def serve(address: str, scenario: Path, spacing: float) -> None:
    """Fork a worker for whoever calls, until the standard input is closed."""
    import select
    import signal

    from fmu.worker import main
    from warp_mpm import Scenario, Simulation

    Simulation(Scenario.load(scenario).replaced({"numerics.spacing_m": spacing})).prepare()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody asks how a worker ended
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(address)
        door.listen()
        print("ready", flush=True)
        while True:
            ready, _, _ = select.select([door, 0], [], [])
            if 0 in ready:
                return
            line, _ = door.accept()
            _, streams, _, _ = socket.recv_fds(line, 16, 3)
            if len(streams) == 3 and os.fork() == 0:
                door.close()
                for place, stream in enumerate(streams):
                    os.dup2(stream, place)
                    os.close(stream)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                sys.stdin = os.fdopen(0, encoding="utf-8", closefd=False)
                try:
                    main()
                finally:
                    os._exit(0)
            line.close()
            for stream in streams:
                os.close(stream)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    serve(sys.argv[1], Path(sys.argv[2]), float(sys.argv[3]))
