"""Archives built once per test session, and a host that drives one instance through fmpy's plain FMI calls."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from fmu import archive, c_unit

UNITS = {unit.name: unit for unit in archive.PYTHON_UNITS}


class Host:
    """One instance of a unit; variables by name."""

    def __init__(self, path: Path, unzipped: Path, name: str = "unit") -> None:
        self.description = read_model_description(str(path))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(unzipped),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.time = 0.0

    def initialize(self, start_time: float = 0.0, **values: Any) -> Host:
        self.fmu.setupExperiment(startTime=start_time)
        self.time = start_time
        for name, value in values.items():
            self[name] = value
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def again(self, start_time: float = 0.0, **values: Any) -> Host:
        self.fmu.reset()
        return self.initialize(start_time, **values)

    def step(self, size: float) -> int:
        status = self.fmu.fmi2DoStep(self.fmu.component, self.time, size, 1)
        self.time += size
        return status

    def run(self, *sizes: float) -> Host:
        for size in sizes:
            assert self.step(size) == 0
        return self

    def _access(self, name: str, verb: str) -> Callable[..., Any]:
        kind = self.variables[name].type
        return getattr(self.fmu, verb + kind)

    def __getitem__(self, name: str) -> Any:
        return self._access(name, "get")([self.variables[name].valueReference])[0]

    def __setitem__(self, name: str, value: Any) -> None:
        self._access(name, "set")([self.variables[name].valueReference], [value])

    def outputs(self) -> dict[str, Any]:
        return {name: self[name] for name, v in self.variables.items() if v.causality == "output"}

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.fmi2FreeInstance(self.fmu.component)


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
        hosts.append(Host(archives[name], unzipped[name], f"{name}{len(hosts)}"))
        return hosts[-1]

    yield opener
    for host in hosts:
        host.fmu.fmi2FreeInstance(host.fmu.component)


@pytest.fixture
def host_class() -> type[Host]:
    """For tests that free their instance themselves."""
    return Host
