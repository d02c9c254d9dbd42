"""Archives built once per test session, and a host that drives one instance through fmpy's plain FMI calls."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmpy import extract

from fmu import archive, c_unit
from fmu.instance import Unit

UNITS = {unit.name: unit for unit in archive.PYTHON_UNITS}
C_UNITS = {unit.name: unit for unit in c_unit.C_UNITS}


class Made(dict[str, Path]):
    """Paths by the unit's name, made when a test first asks for them."""

    def __init__(self, make: Callable[[str], Path]) -> None:
        super().__init__()
        self._make = make

    def __missing__(self, name: str) -> Path:
        self[name] = self._make(name)
        return self[name]


class Host(Unit):
    """An importer that looks at what a step returns."""

    def step(self, size: float) -> int:
        if self.fmi3:
            self.fmu.doStep(self.time, size)
            status = 0
        else:
            status = self.fmu.fmi2DoStep(self.fmu.component, self.time, size, 1)
        self.time += size
        return status

    def run(self, *sizes: float) -> Host:
        for size in sizes:
            assert self.step(size) == 0
        return self


@pytest.fixture(scope="session")
def archives(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The built archives by the unit's name, all in one folder; those in C for this machine's platform."""
    folder = tmp_path_factory.mktemp("fmus")

    def make(name: str) -> Path:
        if name in UNITS:
            return archive.build_python_unit(UNITS[name], folder)
        return c_unit.build_c_unit(C_UNITS[name], folder, platforms=(c_unit.host_platform(),))

    return Made(make)


@pytest.fixture(scope="session")
def unzipped(archives: dict[str, Path]) -> Iterator[dict[str, Path]]:
    """The archives' contents, unpacked once."""
    folders = Made(lambda name: Path(extract(str(archives[name]))))
    yield folders
    for folder in folders.values():
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def open_unit(archives: dict[str, Path], unzipped: dict[str, Path]) -> Iterator[Callable[[str], Host]]:
    """Open an instance of a unit by name; all are freed at the end of the test."""
    hosts: list[Host] = []

    def opener(name: str) -> Host:
        hosts.append(Host(archives[name], unzipped[name], name=f"{name}{len(hosts)}"))
        return hosts[-1]

    yield opener
    for host in hosts:
        host.free()


@pytest.fixture
def host_class() -> type[Host]:
    """For tests that free their instance themselves."""
    return Host


@pytest.fixture(scope="session")
def c_compiler() -> list[str]:
    """The command that compiles C for this machine."""
    return [sys.executable, "-m", "ziglang", "cc"] if c_unit.has_cross_compiler() else ["cc"]


@pytest.fixture(scope="session")
def c_program(c_compiler: list[str], tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], Path]:
    """Compile a program of one file; once."""
    made: dict[Path, Path] = {}

    def compiled(source: Path) -> Path:
        if source not in made:
            program = tmp_path_factory.mktemp("host") / source.stem
            command = [*c_compiler, "-Wall", "-Werror", "-o", program, source, "-ldl"]
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            made[source] = program
        return made[source]

    return compiled
