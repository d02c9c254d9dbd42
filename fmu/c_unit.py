"""Builds ``BarrierSlidingC.fmu``: the same unit in plain C, for hosts that have no Python.

The table of variables is written out as a C header, so both units have one interface. The PyPI package ``ziglang``
brings a compiler that builds for every platform from any one; without it the machine's own C compiler builds for the
machine alone.
"""

from __future__ import annotations

import importlib.util
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import indent, tostring

import fmpy

from analytic.version import project_version
from fmu import documentation
from fmu.archive import BuildError, write_archive
from fmu.units.barrier_sliding import INTERFACE as PYTHON_INTERFACE
from fmu.units.interface import Interface, Variable
from fmu.units.model_description import guid, model_description
from warp_mpm.extras import missing

INTERFACE = replace(PYTHON_INTERFACE, name="BarrierSlidingC")

PLATFORMS = {
    "linux64": (".so", ("x86_64-linux-gnu.2.17",)),
    "win64": (".dll", ("x86_64-windows-gnu",)),
    "darwin64": (".dylib", ("x86_64-macos", "aarch64-macos")),
}
"""FMI platform: file name extension of its binary, and the targets of the cross-compiler that go into it."""

_SOURCES = Path(__file__).parent / "c"
_FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
_HEADER_NAMES = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
_COMPILED = ("model.c", "unit.c")
# No contraction to fused multiply-add: the same results on every processor, and as Python has them.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-shared", "-DNDEBUG")


def build_c_unit(folder: Path, *, platforms: tuple[str, ...] | None = None, version: str | None = None) -> Path:
    """Build ``folder/BarrierSlidingC.fmu``, its sources included.

    Parameters
    ----------
    folder: created if missing; an archive of the same name in it is replaced.
    platforms: names out of ``PLATFORMS``; None builds all where ``ziglang`` is installed, else this machine's.
    version: instead of the project's version.

    Raises
    ------
    BuildError: there is no compiler for a platform, or it failed; nothing is left in ``folder``.
    """
    version = version or project_version()
    chosen = platforms if platforms is not None else tuple(PLATFORMS) if has_cross_compiler() else (host_platform(),)
    unknown = [name for name in chosen if name not in PLATFORMS]
    if unknown:
        raise BuildError(f"platform is {unknown[0]}, it must be one of {', '.join(PLATFORMS)}.")
    sources = {name: (_SOURCES / name).read_text(encoding="utf-8") for name in (*_COMPILED, "unit.h", "model.h")}
    stamped = f"{version}+c{_stamp(sources)}"
    sources["table.h"] = table_header(INTERFACE, guid(INTERFACE, stamped))
    sources |= {name: (_FMI_HEADERS / name).read_text(encoding="utf-8") for name in _HEADER_NAMES}
    description = model_description(
        INTERFACE,
        version=stamped,
        tool="warp-mpm-impact",
        needs_execution_tool=False,
        source_files=_COMPILED,
    )
    indent(description)
    entries = {f"sources/{name}": text.encode() for name, text in sources.items()}
    entries["modelDescription.xml"] = tostring(description, "UTF-8", xml_declaration=True)
    with tempfile.TemporaryDirectory(prefix="fmu_build_") as temporary:
        stage = Path(temporary)
        for name, text in sources.items():
            (stage / name).write_text(text, encoding="utf-8")
        for platform in chosen:
            extension, targets = PLATFORMS[platform]
            slices = [_compile(stage, f"{target}{extension}", target) for target in targets]
            entries[f"binaries/{platform}/{INTERFACE.name}{extension}"] = (
                slices[0] if len(slices) == 1 else universal_binary(slices)
            )
    entries |= documentation.entries(INTERFACE, version, packer="c")
    return write_archive(folder / f"{INTERFACE.name}.fmu", entries)


def has_cross_compiler() -> bool:
    """Whether the package ``ziglang`` is installed."""
    return importlib.util.find_spec("ziglang") is not None


def needs_cross_compiler(what: str) -> str:
    """The sentence for what cannot be built without ``ziglang``."""
    return missing(what, "the package ziglang", "fmu")


def platforms_of(unit: Path) -> list[str]:
    """Platforms for which an archive holds a binary."""
    with zipfile.ZipFile(unit) as archive:
        names = [name.split("/") for name in archive.namelist()]
    return [platform for platform in PLATFORMS if any(name[:2] == ["binaries", platform] for name in names)]


def host_platform() -> str:
    """FMI's name of this machine's platform."""
    return {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}.get(sys.platform, sys.platform)


def table_header(interface: Interface, identity: str) -> str:
    """The table of variables as a C header."""
    lines = [
        "/* Generated from the table of variables in fmu/units/barrier_sliding.py: change it there. */",
        "#ifndef TABLE_H",
        "#define TABLE_H",
        "",
        "#include <math.h>",
        "",
        f'#define UNIT_GUID "{identity}"',
        f"#define VARIABLE_COUNT {len(interface.variables)}",
        "",
        "enum { REAL, INTEGER, BOOLEAN };",
        'static const char *const KIND_NAMES[] = {"Real", "Integer", "Boolean"};',
        "enum { PARAMETER, INPUT, OUTPUT };",
        "",
        "/* Value references. */",
        f"enum {{ {', '.join(v.name.upper() for v in interface.variables)} }};",
        "",
    ]
    prefixes = {"Variant": "VARIANT", "ImpactPhase": "PHASE", "ImpactForceSource": "SOURCE"}
    for choice in {v.choice.name: v.choice for v in interface.variables if v.choice}.values():
        items = ", ".join(f"{prefixes[choice.name]}_{n.upper()} = {i}" for i, (n, _) in enumerate(choice.items, 1))
        lines.append(f"enum {{ {items} }};")
    lines += [
        "",
        "typedef struct {",
        "    const char *name, *unit, *range;",
        "    int kind, causality, open_minimum;",
        "    double start, minimum, maximum;",
        "} Entry;",
        "",
        "static const Entry TABLE[VARIABLE_COUNT] = {",
        *(f"    {_entry(v)}," for v in interface.variables),
        "};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def universal_binary(slices: list[bytes]) -> bytes:
    """Join Mach-O binaries of several processors into one file, as Apple's ``lipo`` does."""
    alignment = 14  # 2**14 bytes, the page of Apple's own processors
    header, bodies, offset = struct.pack(">II", 0xCAFEBABE, len(slices)), [], 1 << alignment
    for data in slices:
        processor, subtype = struct.unpack_from("<II", data, 4)
        header += struct.pack(">5I", processor, subtype, offset, len(data), alignment)
        padding = -len(data) % (1 << alignment)
        bodies.append(data + bytes(padding))
        offset += len(data) + padding
    return header.ljust(1 << alignment, b"\0") + b"".join(bodies)


def _compile(stage: Path, name: str, target: str) -> bytes:
    if has_cross_compiler():
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-s"]
    elif PLATFORMS[host_platform()][1][0] == target and (compiler := shutil.which("cc") or shutil.which("gcc")):
        command = [compiler, "-s"]
    else:
        own = "" if PLATFORMS[host_platform()][1][0] != target else " without a C compiler (cc or gcc)"
        raise BuildError(needs_cross_compiler(f"Building for {target}{own}"))
    if "windows" not in target:
        command += ["-fPIC", "-fvisibility=hidden"]
    libraries = [] if "windows" in target else ["-lm"]
    # The compiler gets names without folders: what it writes must not depend on where the stage happens to be.
    result = subprocess.run(
        [*command, *_FLAGS, "-I.", "-o", name, *_COMPILED, *libraries],
        cwd=stage,
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode:
        raise BuildError(f"The C compiler failed for {target}: {result.stderr.strip()}")
    return (stage / name).read_bytes()


def _stamp(sources: dict[str, str]) -> str:
    import hashlib

    return hashlib.sha256("".join(sources[name] for name in sorted(sources)).encode()).hexdigest()[:8]


def _entry(variable: Variable) -> str:
    low = "-INFINITY" if variable.minimum is None else repr(float(variable.minimum))
    high = "INFINITY" if variable.maximum is None else repr(float(variable.maximum))
    start = 0.0
    if variable.start is not None:
        start = float(variable.start)
    if variable.choice:
        low, high, start = "1.0", repr(float(len(variable.choice.items))), start or 1.0
    unit = f" {variable.unit.name}" if variable.kind == "Real" and variable.unit.name != "1" else ""
    texts = ", ".join(f'"{text}"' for text in (variable.name, unit, variable.range_text))
    flags = f"{variable.kind.upper()}, {variable.causality.upper()}, {int(variable.open_minimum)}"
    return f"{{{texts}, {flags}, {start!r}, {low}, {high}}}"
