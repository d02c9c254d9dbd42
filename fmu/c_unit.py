"""Builds the units in plain C, for hosts that have no Python: one model each, in two versions of the standard.

The table of variables is written out as a C header, so a unit in C has the interface of the one in Python. The PyPI
package `ziglang` brings a compiler that builds for every platform from any one; without it the machine's own C
compiler builds for the machine alone.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import platform as machine
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element, indent, tostring

import fmpy

from analytic.version import PROJECT, project_version
from warp_mpm.extras import missing

from . import documentation, fmi3_description
from .archive import ROOT, WORKER, BuildError, scenario_for, whole, write_archive
from .units import protocol, worker_process
from .units.debris_flow import SCENARIO
from .units.interface import Interface, Variable
from .units.model_description import guid, model_description


@dataclass(frozen=True)
class CUnit:
    """A unit in C: the Python unit whose table it has, and the version of the standard."""

    base: str
    """Name of the Python unit."""
    module: str
    """Of the table in `fmu/units`, and of the model in `fmu/c`."""
    fmi: str
    """`2.0` or `3.0`."""
    derivatives: int = 0
    """Highest order of the derivatives of outputs that the model gives."""
    directional: bool = False
    """Whether it gives derivatives of outputs with respect to inputs and tunable parameters."""
    own_sources: tuple[str, ...] = ()
    """C files that the model includes."""
    posix_only: bool = False
    """Whether it does nothing on Windows."""

    @property
    def name(self) -> str:
        return self.base + {"2.0": "C", "3.0": "C3"}[self.fmi]

    @property
    def interface(self) -> Interface:
        table: Interface = importlib.import_module(f".units.{self.module}", __package__).INTERFACE
        return replace(
            table, name=self.name, output_derivatives=self.derivatives, directional_derivatives=self.directional
        )

    @property
    def compiled(self) -> str:
        """The one source file to compile."""
        return f"fmi{self.fmi[0]}.c"


C_UNITS = tuple(
    unit
    for fmi in ("2.0", "3.0")
    for unit in (
        CUnit("BarrierSliding", "barrier_sliding", fmi, derivatives=1, directional=True),
        CUnit("GroundAnchor", "ground_anchor", fmi, directional=True),
        CUnit("DebrisFlow", "debris_flow", fmi, own_sources=("process.c",), posix_only=True),
    )
)


@dataclass(frozen=True)
class Platform:
    """What is built for a platform: its name in each version of the standard, and the compiler's targets by FMI 3's."""

    extension: str
    fmi2: str | None
    targets: Mapping[str, str]


PLATFORMS = {
    "linux64": Platform(".so", "linux64", {"x86_64-linux": "x86_64-linux-gnu.2.17"}),
    "linux-aarch64": Platform(".so", None, {"aarch64-linux": "aarch64-linux-gnu.2.17"}),
    "win64": Platform(".dll", "win64", {"x86_64-windows": "x86_64-windows-gnu"}),
    "darwin64": Platform(".dylib", "darwin64", {"x86_64-darwin": "x86_64-macos", "aarch64-darwin": "aarch64-macos"}),
}
"""By the name that the command line takes. FMI 2.0 has no name for Linux on aarch64."""

_SOURCES = Path(__file__).parent / "c"
_FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
_HEADERS = {
    "2.0": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3.0": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
_PREFIXES = {
    "Variant": "VARIANT",
    "ImpactPhase": "PHASE",
    "ImpactForceSource": "SOURCE",
    "BarrierMotion": "MOTION",
}
"""Of the names of a choice's items in C."""

TEXT_SIZE = 4096
"""Room for a text of a unit in C [bytes], as long as a path may be."""

# No contraction to fused multiply-add: the same results on every processor, and as Python has them.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-shared", "-DNDEBUG")


def build_c_unit(
    unit: CUnit,
    folder: Path,
    *,
    platforms: tuple[str, ...] | None = None,
    version: str | None = None,
    scenario: Path | None = None,
    simulated: Mapping[str, bytes] | None = None,
    recorded: bool = True,
) -> Path:
    """Build `folder/<name>.fmu`, its sources included.

    Args:
        unit: which one.
        folder: created if missing; an archive of the same name in it is replaced.
        platforms: names out of `PLATFORMS`; None builds all where `ziglang` is installed, else this machine's.
        version: instead of the project's version.
        scenario: the scenario file inside `DebrisFlow`, Set IIb if None.
        simulated: reference results of `DebrisFlow`, from `archive.simulated_reference`.
        recorded: whether `DebrisFlow` remembers this Python as the one that has the simulator.

    Raises:
        BuildError: there is no compiler for a platform, or it failed; nothing is left in `folder`.
    """
    version = version or project_version()
    chosen = check_platforms(unit, platforms if platforms is not None else default_platforms())
    interface = unit.interface
    sources = _plain_sources(unit)
    stamped = f"{version}+c{_stamp(sources)}"
    identity = guid(interface, stamped)
    sources["table.h"] = table_header(unit, identity)
    sources |= {name: (_FMI_HEADERS / name).read_text(encoding="utf-8") for name in _HEADERS[unit.fmi]}
    entries = {f"sources/{name}": text.encode() for name, text in sources.items()}
    entries |= _binaries(unit, sources, chosen)
    entries |= documentation.entries(interface, version, packer="c")
    if unit.base == "DebrisFlow":
        entries[f"resources/{SCENARIO}"] = whole(scenario_for(scenario))
        if recorded:
            entries[f"resources/{worker_process.PLAIN_RECORD}"] = f"{sys.executable}\n{WORKER}\n{ROOT}\n".encode()
        entries["resources/requirements.txt"] = f"{PROJECT}=={project_version()}\n".encode()
        for name, data in (simulated or {}).items():
            entries[f"documentation/{name.replace(unit.base, unit.name)}"] = data
    if unit.fmi == "2.0":
        entries["modelDescription.xml"] = _xml(
            model_description(
                interface,
                version=stamped,
                tool=PROJECT,
                needs_execution_tool=unit.base == "DebrisFlow",
                source_files=(unit.compiled,),
            )
        )
    else:
        described = fmi3_description.model_description(
            interface,
            version=stamped,
            token=identity,
            tool=PROJECT,
            needs_execution_tool=unit.base == "DebrisFlow",
        )
        entries["modelDescription.xml"] = _xml(described)
        entries["sources/buildDescription.xml"] = _xml(fmi3_description.build_description(unit.name, unit.compiled))
        entries["terminalsAndIcons/terminalsAndIcons.xml"] = _xml(fmi3_description.terminals(unit.base))
        entries["terminalsAndIcons/icon.png"] = entries.pop("model.png")
    return write_archive(folder / f"{unit.name}.fmu", entries)


def default_platforms() -> tuple[str, ...]:
    """Those for which a build needs no more than what is there."""
    return tuple(PLATFORMS) if has_cross_compiler() else (host_platform(),)


def check_platforms(unit: CUnit, platforms: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the platforms for which a unit is built.

    Raises:
        BuildError: there is none, or one of them is unknown.
    """
    unknown = [name for name in platforms if name not in PLATFORMS]
    if unknown:
        raise BuildError(f"--platform = {unknown[0]} is not allowed; it must be one of {', '.join(PLATFORMS)}.")
    chosen = tuple(name for name in platforms if offered(unit, name))
    if not chosen:
        offers = [name for name in PLATFORMS if offered(unit, name)]
        raise BuildError(
            f"--platform = {platforms[0]} is not allowed for {unit.name}; it must be one of {', '.join(offers)}."
        )
    return chosen


def offered(unit: CUnit, platform: str) -> bool:
    """Whether a unit is built for a platform; what is no platform is said elsewhere."""
    if unit.posix_only and platform == "win64":
        return False
    return unit.fmi == "3.0" or platform not in PLATFORMS or PLATFORMS[platform].fmi2 is not None


def has_cross_compiler() -> bool:
    """Whether the package `ziglang` is installed."""
    return importlib.util.find_spec("ziglang") is not None


def needs_cross_compiler(what: str) -> str:
    """The sentence for what cannot be built without `ziglang`."""
    return missing(what, "the package ziglang", "fmu")


def platforms_of(unit: Path) -> list[str]:
    """Platforms for which an archive holds a binary, by the standard's names."""
    with zipfile.ZipFile(unit) as archive:
        found = dict.fromkeys(name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/"))
    return list(found)


def host_platform() -> str:
    """The command line's name of this machine's platform."""
    if sys.platform == "linux" and machine.machine() == "aarch64":
        return "linux-aarch64"
    return {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}.get(sys.platform, sys.platform)


def table_header(unit: CUnit, identity: str) -> str:
    """The table of variables as a C header."""
    interface = unit.interface
    texts = [v.name for v in interface.variables if v.kind == "String"]
    lines = [
        f"/* Generated from the table of variables in fmu/units/{unit.module}.py: change it there. */",
        "#ifndef TABLE_H",
        "#define TABLE_H",
        "",
        "#include <math.h>",
        "",
        f'#define MODEL_HEADER "{unit.module}.h"',
        f'#define MODEL_SOURCE "{unit.module}.c"',
        f'#define UNIT_IDENTITY "{identity}"',
        f"#define VARIABLE_COUNT {len(interface.variables)}",
        f"#define OUTPUT_DERIVATIVES {interface.output_derivatives}",
        f"#define TEXT_COUNT {len(texts)}",
        f"#define TEXT_SIZE {TEXT_SIZE if texts else 1}",
    ]
    if "message" in texts:
        lines.append("#define HAS_MESSAGE")
    if unit.base == "DebrisFlow":
        lines += [
            f'#define INTERPRETER_VARIABLE "{worker_process.INTERPRETER_VARIABLE}"',
            f'#define RECORD "{worker_process.PLAIN_RECORD}"',
            f'#define SCENARIO "{SCENARIO}"',
            f'#define LAUNCH "{worker_process.LAUNCH}"',
            f'#define INSTALLED_WORKER "{worker_process.INSTALLED_WORKER}"',
            f"#define PROTOCOL {protocol.PROTOCOL}",
        ]
    lines += [
        "",
        "enum { REAL, INTEGER, BOOLEAN, STRING };",
        'static const char *const KIND_NAMES[] = {"Real", "Integer", "Boolean", "String"};',
        "enum { PARAMETER, INPUT, OUTPUT };",
        "",
        "/* Value references. */",
        f"enum {{ {', '.join(v.name.upper() for v in interface.variables)} }};",
        "",
    ]
    for choice in {v.choice.name: v.choice for v in interface.variables if v.choice}.values():
        items = ", ".join(f"{_PREFIXES[choice.name]}_{n.upper()} = {i}" for i, (n, _) in enumerate(choice.items, 1))
        lines.append(f"enum {{ {items} }};")
    lines += [
        "",
        "typedef struct {",
        "    const char *name, *unit, *range, *start_text;",
        "    int kind, causality, open_minimum, tunable, text; /* text: its place among the texts */",
        "    double start, minimum, maximum;",
        "} Entry;",
        "",
        "static const Entry TABLE[VARIABLE_COUNT] = {",
        *(f"    {_entry(v, texts)}," for v in interface.variables),
        "};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def universal_binary(slices: list[bytes]) -> bytes:
    """Join Mach-O binaries of several processors into one file, as Apple's `lipo` does."""
    alignment = 14  # 2**14 bytes, the page of Apple's own processors
    header, bodies, offset = struct.pack(">II", 0xCAFEBABE, len(slices)), [], 1 << alignment
    for data in slices:
        processor, subtype = struct.unpack_from("<II", data, 4)
        header += struct.pack(">5I", processor, subtype, offset, len(data), alignment)
        padding = -len(data) % (1 << alignment)
        bodies.append(data + bytes(padding))
        offset += len(data) + padding
    return header.ljust(1 << alignment, b"\0") + b"".join(bodies)


def _plain_sources(unit: CUnit) -> dict[str, str]:
    names = (unit.compiled, "life.c", "unit.h", f"{unit.module}.c", f"{unit.module}.h", *unit.own_sources)
    return {name: (_SOURCES / name).read_text(encoding="utf-8") for name in names}


def _binaries(unit: CUnit, sources: Mapping[str, str], platforms: tuple[str, ...]) -> dict[str, bytes]:
    entries: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory(prefix="fmu_build_") as temporary:
        stage = Path(temporary)
        for name, text in sources.items():
            (stage / name).write_text(text, encoding="utf-8")
        for name in platforms:
            platform = PLATFORMS[name]
            file = unit.name + platform.extension
            slices = {
                fmi3: _compile(stage, unit.compiled, f"{target}{platform.extension}", target)
                for fmi3, target in platform.targets.items()
            }
            if unit.fmi == "3.0":
                entries |= {f"binaries/{fmi3}/{file}": data for fmi3, data in slices.items()}
            else:
                parts = list(slices.values())
                joined = parts[0] if len(parts) == 1 else universal_binary(parts)
                entries[f"binaries/{platform.fmi2}/{file}"] = joined
    return entries


def _compile(stage: Path, source: str, name: str, target: str) -> bytes:
    own = target in PLATFORMS[host_platform()].targets.values() if host_platform() in PLATFORMS else False
    if has_cross_compiler():
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-s"]
    elif own and (compiler := shutil.which("cc") or shutil.which("gcc")):
        command = [compiler, "-s"]
    else:
        without = " without a C compiler (cc or gcc)" if own else ""
        raise BuildError(needs_cross_compiler(f"Building for {target}{without}"))
    if "windows" not in target:
        command += ["-fPIC", "-fvisibility=hidden"]
    libraries = [] if "windows" in target else ["-lm"]
    # The compiler gets names without folders: what it writes must not depend on where the stage happens to be.
    result = subprocess.run(
        [*command, *_FLAGS, "-I.", "-o", name, source, *libraries],
        cwd=stage,
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode:
        raise BuildError(f"The C compiler failed for {target}: {result.stderr.strip()}")
    return (stage / name).read_bytes()


def _stamp(sources: Mapping[str, str]) -> str:
    return hashlib.sha256("".join(sources[name] for name in sorted(sources)).encode()).hexdigest()[:8]


def _entry(variable: Variable, texts: list[str]) -> str:
    low = "-INFINITY" if variable.minimum is None else repr(float(variable.minimum))
    high = "INFINITY" if variable.maximum is None else repr(float(variable.maximum))
    start = 0.0 if variable.start is None or variable.kind == "String" else float(variable.start)
    if variable.choice:
        low, high, start = "1.0", repr(float(len(variable.choice.items))), start or 1.0
    unit = f" {variable.unit.name}" if variable.kind == "Real" and variable.unit.name != "1" else ""
    start_text = str(variable.start or "") if variable.kind == "String" else ""
    quoted = ", ".join(f'"{text}"' for text in (variable.name, unit, variable.range_text, start_text))
    place = texts.index(variable.name) if variable.name in texts else 0
    flags = f"{variable.kind.upper()}, {variable.causality.upper()}, {int(variable.open_minimum)}"
    return f"{{{quoted}, {flags}, {int(variable.tunable)}, {place}, {start!r}, {low}, {high}}}"


def _xml(root: Element) -> bytes:
    indent(root)
    return tostring(root, "UTF-8", xml_declaration=True)
