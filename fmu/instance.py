"""One instance of an archive, driven through fmpy's plain FMI calls: the project's one importer."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self


class Unit:
    """One instance of a unit; variables by name."""

    def __init__(
        self, path: Path, unzipped: Path, *, name: str | None = None, settings: Mapping[str, Any] | None = None
    ) -> None:
        """Args: path: the archive; unzipped: folder with its content; name: of the instance; settings: parameters by
        name, set at each initialization, those that the unit has."""
        from fmpy import read_model_description
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        description = read_model_description(str(path))
        self.variables = {v.name: v for v in description.modelVariables}
        self.name = path.name
        self.fmi3 = description.fmiVersion.startswith("3")
        self.fmu = (FMU3Slave if self.fmi3 else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=str(unzipped),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name or path.stem,
        )
        self.fmu.instantiate()
        self.time = 0.0
        self._settings = {name: value for name, value in (settings or {}).items() if name in self.variables}

    def initialize(self, start_time: float = 0.0, stop_time: float | None = None, **values: Any) -> Self:
        """Set the settings and parameters, and initialize at the time [s]."""
        times = {"startTime": start_time, "stopTime": stop_time}
        if not self.fmi3:
            self.fmu.setupExperiment(**times)
        self.time = start_time
        for name, value in (self._settings | values).items():
            self[name] = value
        self.fmu.enterInitializationMode(**(times if self.fmi3 else {}))
        self.fmu.exitInitializationMode()
        return self

    def again(self, start_time: float = 0.0, **values: Any) -> Self:
        """Reset and initialize."""
        self.fmu.reset()
        return self.initialize(start_time, **values)

    def step(self, size: float) -> Any:
        """Go on by a step [s]."""
        self.fmu.doStep(self.time, size)
        self.time += size

    def __getitem__(self, name: str) -> Any:
        return self._access(name, "get")([self.variables[name].valueReference])[0]

    def __setitem__(self, name: str, value: Any) -> None:
        self._access(name, "set")([self.variables[name].valueReference], [value])

    def _access(self, name: str, verb: str) -> Any:
        kind = self.variables[name].type
        return getattr(self.fmu, verb + ("Int64" if kind == "Enumeration" else kind))

    def reals(self, names: Sequence[str]) -> list[float]:
        """Values of variables that are numbers, in one call."""
        references = [self.variables[name].valueReference for name in names]
        return list(self.fmu.getFloat64(references) if self.fmi3 else self.fmu.getReal(references))

    def save(self) -> Any:
        """The unit's state, for `restore`."""
        return self.fmu.getFMUState() if self.fmi3 else self.fmu.getFMUstate()

    def restore(self, state: Any, time: float) -> None:
        """Go back to a state and its time [s]."""
        (self.fmu.setFMUState if self.fmi3 else self.fmu.setFMUstate)(state)
        self.time = time

    def release(self, state: Any) -> None:
        """Give a state back."""
        (self.fmu.freeFMUState if self.fmi3 else self.fmu.freeFMUstate)(state)

    def serialized(self, state: Any) -> bytes:
        """A state as bytes."""
        return (self.fmu.serializeFMUState if self.fmi3 else self.fmu.serializeFMUstate)(state)

    def deserialized(self, data: bytes) -> Any:
        """A state from its bytes."""
        return (self.fmu.deserializeFMUState if self.fmi3 else self.fmu.deSerializeFMUstate)(data)

    def outputs(self) -> dict[str, Any]:
        """All outputs by name."""
        return {name: self[name] for name, v in self.variables.items() if v.causality == "output"}

    def real_outputs(self) -> list[float]:
        """The outputs that are numbers and the same in every run: the ratio of simulated to wall time is not."""
        return self.reals(
            [
                name
                for name, v in self.variables.items()
                if v.causality == "output" and v.type in ("Real", "Float64") and name != "time_ratio"
            ]
        )

    def free(self) -> None:
        """Give the instance back; its library stays loaded."""
        (self.fmu.fmi3FreeInstance if self.fmi3 else self.fmu.fmi2FreeInstance)(self.fmu.component)


@contextlib.contextmanager
def instance_of(path: Path) -> Iterator[Unit]:
    """An instance of the archive, unpacked into a folder of its own; instance and folder are gone at the end."""
    with (
        tempfile.TemporaryDirectory(prefix="fmu_", ignore_cleanup_errors=True) as folder,
        instance(path, Path(folder)) as unit,
    ):
        yield unit


@contextlib.contextmanager
def instance(path: Path, folder: Path, settings: Mapping[str, Any] | None = None) -> Iterator[Unit]:
    """An instance of the archive, unpacked into the folder, freed at the end."""
    from fmpy import extract

    unzipped = folder / path.stem
    if not unzipped.exists():
        extract(str(path), unzipdir=str(unzipped))
    unit = Unit(path, unzipped, settings=settings)
    try:
        yield unit
    finally:
        unit.free()
