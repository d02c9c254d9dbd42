"""One instance of an archive, driven through fmpy's plain FMI calls."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any


class Unit:
    """One instance of a unit; variables by name."""

    def __init__(self, path: Path, folder: Path, settings: dict[str, float] | None = None) -> None:
        """Args: path: the archive; folder: to unpack it into; settings: parameters by name, set at each initialization,
        those that the unit has."""
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave

        description = read_model_description(str(path))
        self.variables = {v.name: v for v in description.modelVariables}
        unzipped = folder / path.stem
        if not unzipped.exists():
            extract(str(path), unzipdir=str(unzipped))
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(unzipped),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=path.stem,
        )
        self.fmu.instantiate()
        self.time = 0.0
        self._settings = settings or {}

    def initialize(self, settings: dict[str, float] | None = None) -> None:
        self.time = 0.0
        self.fmu.setupExperiment(startTime=0.0)
        for name, value in (self._settings | (settings or {})).items():
            if name in self.variables:
                self.fmu.setReal([self.variables[name].valueReference], [value])
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def step(self, size: float) -> None:
        self.fmu.doStep(self.time, size)
        self.time += size

    def reset(self) -> None:
        self.fmu.reset()

    def outputs(self) -> dict[str, Any]:
        return {
            name: getattr(self.fmu, f"get{v.type}")([v.valueReference])[0]
            for name, v in self.variables.items()
            if v.causality == "output"
        }

    def real_outputs(self) -> list[float]:
        # The ratio of simulated to wall time is the only output that may differ from run to run.
        chosen = [
            v.valueReference
            for name, v in self.variables.items()
            if v.causality == "output" and v.type == "Real" and name != "time_ratio"
        ]
        return list(self.fmu.getReal(chosen))


@contextlib.contextmanager
def instance(path: Path, folder: Path, settings: dict[str, float] | None = None) -> Iterator[Unit]:
    """An instance of the archive, unpacked into the folder, freed at the end."""
    unit = Unit(path, folder, settings)
    try:
        yield unit
    finally:
        unit.fmu.fmi2FreeInstance(unit.fmu.component)
