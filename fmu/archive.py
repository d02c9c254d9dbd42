"""Builds the archives: pythonfmu packs a unit, and what a plain archive lacks is put right here.

A plain archive of pythonfmu differs at every build, has no documentation, and its modules have names that another
archive in the same host may also use, which then runs the wrong code in silence. Here the code goes into a package
whose name carries the version and a stamp of its content, pythonfmu's own modules with it; documentation, licence, icon
and reference results are added; and the archive is written anew with fixed order, dates and compression.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from analytic.version import PROJECT, project_version
from warp_mpm.shipped import SCENARIOS

from . import documentation, reference
from .units.debris_flow import SCENARIO
from .units.interface import Interface
from .units.slave import UnitError
from .units.worker_process import RECORD

_HERE = Path(__file__).parent
_UNITS = _HERE / "units"
ROOT = _HERE.parent
WORKER = f"{__package__}.worker"
"""The simulator's module, which `ROOT` on the import path makes known."""
_COMMON_MODULES = ("__init__.py", "interface.py", "model_description.py", "slave.py")
_ARCHIVE_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can hold

_IMPORT_FROM_OUTSIDE = re.compile(r"^( *)from (?:analytic|warp_mpm\.quantities)\.", re.MULTILINE)


@dataclass(frozen=True)
class Mend:
    """What is wrong with a wrapper, and the bytes to put in its place."""

    start: int
    end: int
    """Offsets in the file, within which it stands."""
    before: bytes
    after: bytes
    count: int
    """How often it stands there."""


_WRAPPER_FAULTS: dict[str, tuple[Mend, ...]] = {
    # pythonfmu 0.7.0, linux64.
    "4be156a552c16f30eb4395805c59855d8d4086056d0f165442565f6c5fbac0c9": (
        # When the process exits, a function that runs after the destructors releases the wrapper's state a second time,
        # which corrupts the host's memory ("corrupted double-linked list"). The destructor does the same work, so the
        # function is made to return at once: its first instruction after the marker.
        Mend(0x2F7E4, 0x2F7E5, b"\x55", b"\xc3", 1),
        # Whatever exception a unit raises is answered with fatal, after which an importer may call no instance of any
        # unit. A refusal is an error: what the handlers of twenty functions return, and the status of their message.
        Mend(0x14F80, 0x167B1, b"\xb8\x04\x00\x00\x00", b"\xb8\x03\x00\x00\x00", 20),
        Mend(0x14F80, 0x167B1, b"\xbe\x04\x00\x00\x00", b"\xbe\x03\x00\x00\x00", 20),
    ),
}
"""By the SHA-256 of a wrapper."""

_SCRIPT = """\
import sys

if sys.version_info < (3, 10):
    found = "{{}}.{{}}".format(*sys.version_info)
    sys.stderr.write("{unit.name} needs Python 3.10 or later in the importer's process, this is " + found + ".\\n")
    raise ImportError("Python 3.10 or later is needed")

from {package}.{unit.module} import {unit.slave}
from {package}.slave import keep_alive

# The wrapper runs this file at every instantiation and then releases its namespace, which it does not own.
keep_alive(globals())


class {unit.name}({unit.slave}):
    version = {version}
"""


class BuildError(Exception):
    """An archive that could not be built; the message is one sentence for the user."""


@dataclass(frozen=True)
class PythonUnit:
    """A unit that pythonfmu packs: its module in `fmu/units`, its slave class, and other modules that it needs, of
    that folder, of `analytic` and of `warp_mpm/quantities`."""

    name: str
    module: str
    slave: str
    other_modules: tuple[str, ...] = ()
    analytic_modules: tuple[str, ...] = ()
    quantity_modules: tuple[str, ...] = ()

    @property
    def interface(self) -> Interface:
        import importlib

        return importlib.import_module(f".units.{self.module}", __package__).INTERFACE


DEFAULT_SCENARIO = SCENARIOS / "set_iib.json"

PYTHON_UNITS = (
    PythonUnit(
        "BarrierSliding", "barrier_sliding", "BarrierSlidingSlave", analytic_modules=("impact.py", "sliding.py")
    ),
    PythonUnit("GroundAnchor", "ground_anchor", "GroundAnchorSlave"),
    PythonUnit(
        *("DebrisFlow", "debris_flow", "DebrisFlowSlave", ("worker_process.py", "protocol.py")),
        quantity_modules=("quantity.py", "time_series.py"),
    ),
)


def build_python_unit(
    unit: PythonUnit,
    folder: Path,
    *,
    version: str | None = None,
    scenario: Path | None = None,
    simulated: Mapping[str, bytes] | None = None,
    recorded: bool = True,
) -> Path:
    """Build `folder/<name>.fmu`.

    Args:
        unit: which one.
        folder: created if missing; an archive of the same name in it is replaced.
        version: instead of the project's version.
        scenario: the scenario file inside `DebrisFlow`, Set IIb if None.
        simulated: reference results of `DebrisFlow`, from `simulated_reference`; those of the other units are
            always there.
        recorded: whether `DebrisFlow` remembers this Python as the one that has the simulator; without, it is the
            same file wherever it is built.

    Raises:
        BuildError: pythonfmu refused; nothing is left in `folder`.
    """
    version = version or project_version()
    sources = _shipped_sources(unit)
    content = hashlib.sha256(json.dumps([metadata.version("pythonfmu"), sorted(sources.items())]).encode()).hexdigest()[
        :8
    ]
    stamp = re.sub(r"\W", "_", f"{unit.module}_{version}_{content}")
    package, script = f"_{stamp}", stamp
    with tempfile.TemporaryDirectory(prefix="fmu_build_") as temporary:
        stage = Path(temporary)
        (stage / package).mkdir()
        for name, text in sources.items():
            (stage / package / name).write_text(text, encoding="utf-8")
        script_text = _SCRIPT.format(package=package, unit=unit, version=repr(f"{version}+{content}"))
        (stage / f"{script}.py").write_text(script_text, encoding="utf-8")
        _run_pythonfmu(stage, script, package)
        with zipfile.ZipFile(stage / f"{unit.name}.fmu") as plain:
            entries = {info.filename: plain.read(info) for info in plain.infolist() if not info.is_dir()}
        entries = {name: _mended(data) for name, data in _own_pythonfmu(entries, package).items()}
        if unit.name == "DebrisFlow":
            own = _simulator_resources(scenario_for(scenario), recorded=recorded)
            entries |= {f"resources/{name}": data for name, data in own.items()}
            entries |= {f"documentation/{name}": data for name, data in (simulated or {}).items()}
        entries |= documentation.entries(unit.interface, version)
        return write_archive(folder / f"{unit.name}.fmu", entries)


def write_archive(path: Path, entries: Mapping[str, bytes]) -> Path:
    """Write a zip file whose bytes depend on the entries alone; an earlier file is replaced only when all is well."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part")
    try:
        with zipfile.ZipFile(partial, "w") as archive:
            for name in sorted(entries, key=lambda name: (name != "modelDescription.xml", name)):
                info = zipfile.ZipInfo(name, _ARCHIVE_DATE)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.create_system = 3  # Unix, wherever it is built
                info.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
                archive.writestr(info, entries[name])
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    return path


def _shipped_sources(unit: PythonUnit) -> dict[str, str]:
    names = (*_COMMON_MODULES, f"{unit.module}.py", *unit.other_modules)
    sources = {name: (_UNITS / name).read_text(encoding="utf-8") for name in names}
    sources |= {name: (ROOT / "analytic" / name).read_text(encoding="utf-8") for name in unit.analytic_modules}
    outside = ROOT / "warp_mpm" / "quantities"
    sources |= {name: (outside / name).read_text(encoding="utf-8") for name in unit.quantity_modules}
    return {name: _IMPORT_FROM_OUTSIDE.sub(r"\1from .", text) for name, text in sources.items()}


def _run_pythonfmu(stage: Path, script: str, package: str) -> None:
    # A process of its own: pythonfmu imports the script by name, which would stay in this process for the next build.
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", f"{script}.py", "-d", ".", package]
    result = subprocess.run(
        [*command, "--handle-state", "--serialize-state"], cwd=stage, capture_output=True, text=True, check=False
    )
    if result.returncode:
        last = (result.stderr.strip().splitlines() or [f"exit code {result.returncode}"])[-1]
        raise BuildError(f"pythonfmu could not build {package}: {last}")


def scenario_for(chosen: Path | None) -> Path:
    """The scenario file inside `DebrisFlow`.

    Raises:
        BuildError: it is not there.
    """
    scenario = chosen or DEFAULT_SCENARIO
    if not scenario.is_file():
        raise BuildError(f"The scenario {scenario} is not there; name one with --scenario.")
    return scenario


def _simulator_resources(scenario: Path, *, recorded: bool = True) -> dict[str, bytes]:
    """The scenario that runs unless the importer names another, and which Python has the simulator."""
    record = {"interpreter": sys.executable, "worker": WORKER, "import_path": [str(ROOT)]}
    return {
        SCENARIO: whole(scenario),
        **({RECORD: json.dumps(record, indent=2).encode()} if recorded else {}),
        "requirements.txt": f"{PROJECT}=={project_version()}\n".encode(),
    }


def whole(scenario: Path) -> bytes:
    """The scenario in one file: one that names a table beside it, which is not in the archive, with what is in that."""
    content = scenario.read_bytes()
    if b'_csv"' not in content:
        return content
    from warp_mpm.scenario import Scenario

    return json.dumps(Scenario.load(scenario).resolved(), indent=2).encode()


def simulated_reference(scenario: Path | None) -> dict[str, bytes]:
    """Run the simulator for the reference results of `DebrisFlow` with a scenario, Set IIb if None.

    Raises:
        BuildError: the scenario is not there, or does not run.
    """
    with tempfile.TemporaryDirectory(prefix="fmu_build_") as temporary:
        for name, data in _simulator_resources(scenario_for(scenario)).items():
            (Path(temporary) / name).write_bytes(data)
        try:
            return reference.simulated_files(Path(temporary))
        except UnitError as error:
            raise BuildError(str(error)) from None


def _own_pythonfmu(entries: Mapping[str, bytes], package: str) -> dict[str, bytes]:
    """Move pythonfmu's modules into the stamped package: another archive in the host may bring another version."""
    plain, own = "resources/pythonfmu/", f"resources/{package}/pythonfmu/"
    moved = {own + name.removeprefix(plain) if name.startswith(plain) else name: data for name, data in entries.items()}
    slave = f"resources/{package}/slave.py"
    text = moved[slave].decode()
    if "from pythonfmu." not in text:
        raise BuildError("slave.py does not import pythonfmu in the expected way.")
    moved[slave] = text.replace("from pythonfmu.", "from .pythonfmu.").encode()
    # The package's front door imports the builder, which a host does not need.
    moved[f"{own}__init__.py"] = b""
    for tool in ("__main__", "builder", "csvbuilder", "deploy"):
        moved.pop(f"{own}{tool}.py", None)
    return moved


def _mended(data: bytes) -> bytes:
    """The wrapper without its known faults; any other file, or a wrapper of another version, as it is."""
    for mend in _WRAPPER_FAULTS.get(hashlib.sha256(data).hexdigest(), ()):
        place = data[mend.start : mend.end]
        if place.count(mend.before) != mend.count:
            raise BuildError("The wrapper of pythonfmu is not the one that the correction was made for.")
        data = data[: mend.start] + place.replace(mend.before, mend.after) + data[mend.end :]
    return data
