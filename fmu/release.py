"""All archives, the system of them, and a manifest of their hashes: what a release carries.

The same sources, compiler and pythonfmu give the same bytes in any folder, on any day. The archives of the simulator
remember no Python: whoever runs them names one by the environment variable.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from . import archive, c_unit
from .system import write_system

MANIFEST = "SHA256SUMS"
"""In the form that `sha256sum --check` takes."""

SYSTEM = "SlidingBarrierWithAnchor.ssp"


def build_release(
    folder: Path,
    *,
    platforms: tuple[str, ...] | None = None,
    with_simulated: bool = True,
    tell: Callable[[Path], None] = lambda path: None,
) -> Path:
    """Build everything into a folder, and the manifest last.

    Args:
        folder: created if missing; files of the same names in it are replaced.
        platforms: of the units in C, as `build_c_unit` takes them.
        with_simulated: whether the simulator runs for the reference results of its own units.
        tell: called with each file when it is there.

    Raises:
        BuildError: something cannot be built; what was built before is left, without a manifest.
    """
    (folder / MANIFEST).unlink(missing_ok=True)
    simulated = archive.simulated_reference(None) if with_simulated else None
    chosen = platforms if platforms is not None else c_unit.default_platforms()
    built = []
    for unit in c_unit.C_UNITS:
        if any(c_unit.offered(unit, platform) for platform in chosen):
            built.append(c_unit.build_c_unit(unit, folder, platforms=chosen, simulated=simulated, recorded=False))
            tell(built[-1])
    for packed in archive.PYTHON_UNITS:
        built.append(archive.build_python_unit(packed, folder, simulated=simulated, recorded=False))
        tell(built[-1])
    built.append(write_system(folder, folder / SYSTEM))
    tell(built[-1])
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in sorted(built)]
    manifest = folder / MANIFEST
    manifest.write_text("".join(lines), encoding="utf-8")
    tell(manifest)
    return manifest
