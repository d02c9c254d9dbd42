"""Archives built once per test session, and a host that drives one instance through fmpy's plain FMI calls."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmpy import extract

from fmu import archive, c_unit
from fmu.instance import Unit

UNITS = {unit.name: unit for unit in archive.PYTHON_UNITS}


class Host(Unit):
    """An importer that looks at what a step returns."""

    def step(self, size: float) -> int:
        status = self.fmu.fmi2DoStep(self.fmu.component, self.time, size, 1)
        self.time += size
        return status

    def run(self, *sizes: float) -> Host:
        for size in sizes:
            assert self.step(size) == 0
        return self


@pytest.fixture(scope="session")
def archives(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The built archives by the unit's name; the C unit for this machine's platform."""
    folder = tmp_path_factory.mktemp("fmus")
    built = {name: archive.build_python_unit(unit, folder) for name, unit in UNITS.items()}
    built["BarrierSlidingC"] = c_unit.build_c_unit(folder, platforms=(c_unit.host_platform(),))
    return built


@pytest.fixture(scope="session")
def unzipped(archives: dict[str, Path]) -> Iterator[dict[str, Path]]:
    """The archives' contents, unpacked once."""
    folders = {name: Path(extract(str(path))) for name, path in archives.items()}
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
