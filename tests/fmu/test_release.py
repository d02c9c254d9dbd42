"""What a release carries: the same bytes in another folder on another day, and a manifest that tells them."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from fmu import c_unit, release, system
from fmu.archive import PYTHON_UNITS

ROOT = Path(__file__).parents[2]


def hashes(manifest: Path) -> dict[str, str]:
    return {name: digest for digest, name in (line.split("  ") for line in manifest.read_text().splitlines())}


@pytest.fixture(scope="module")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For this machine's platform, without the simulator's reference results."""
    folder = tmp_path_factory.mktemp("release")
    return release.build_release(folder, platforms=(c_unit.host_platform(),), with_simulated=False)


def test_manifest_tells_every_file(released: Path) -> None:
    found = hashes(released)
    names = [unit.name for unit in PYTHON_UNITS] + [unit.name for unit in c_unit.C_UNITS]
    assert set(found) == {*(f"{name}.fmu" for name in names), release.SYSTEM}
    for name, digest in found.items():
        assert hashlib.sha256((released.parent / name).read_bytes()).hexdigest() == digest


def test_same_bytes_in_another_folder_on_another_day(released: Path, tmp_path: Path) -> None:
    """In a copy of the sources elsewhere, by a process with another clock, time zone, user name and order of hashes."""
    copy = tmp_path / "a copy"
    copy.mkdir()
    for name in ("fmu", "analytic", "warp_mpm", "scenarios", "LICENSE", "pyproject.toml"):
        (copy / name).symlink_to(ROOT / name)
    code = f"""
import sys, time
sys.path.insert(0, {str(copy)!r})
time.time = lambda: 2e9
from pathlib import Path
from fmu import c_unit, release
assert release.__file__.startswith({str(copy)!r})
release.build_release(Path("out"), platforms=(c_unit.host_platform(),), with_simulated=False)
"""
    elsewhere = {**os.environ, "TZ": "Asia/Kathmandu", "USER": "other", "PYTHONHASHSEED": "7", "LC_ALL": "C"}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, env=elsewhere, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert hashes(tmp_path / "out" / release.MANIFEST) == hashes(released)


def test_nothing_tells_of_this_machine(released: Path) -> None:
    for name in hashes(released):
        with zipfile.ZipFile(released.parent / name) as archive:
            for entry in archive.namelist():
                data = archive.read(entry)
                assert str(ROOT).encode() not in data, f"{name}: {entry}"
                assert sys.prefix.encode() not in data, f"{name}: {entry}"


@pytest.mark.parametrize(
    ("entries", "schema"),
    [
        (["SystemStructure.ssd"], "SystemStructureDescription.xsd"),
        ([f"resources/{name}.ssv" for name in system.COMPONENTS], "SystemStructureParameterValues.xsd"),
    ],
)
def test_system_is_valid(entries: list[str], schema: str, released: Path) -> None:
    """By the standard's own schemas, and every unit that is used is declared."""
    import fmpy

    schemas = Path(fmpy.__file__).parent / "ssp" / "schema"
    judge = etree.XMLSchema(etree.parse(str(schemas / schema)))
    with zipfile.ZipFile(released.parent / release.SYSTEM) as archive:
        for entry in entries:
            root = etree.fromstring(archive.read(entry))
            judge.assertValid(root)
            used = {element.get("unit") for element in root.iter() if element.get("unit")}
            declared = {unit.get("name") for unit in root.iter(f"{{{system.NAMESPACES['ssc']}}}Unit")}
            assert used == declared


def test_system_is_made_of_units_in_c(released: Path) -> None:
    with zipfile.ZipFile(released.parent / release.SYSTEM) as archive:
        units = [name for name in archive.namelist() if name.endswith(".fmu")]
        structure = archive.read("SystemStructure.ssd").decode()
    assert sorted(units) == [f"resources/{name}C.fmu" for name in ("BarrierSliding", "DebrisFlow", "GroundAnchor")]
    assert 'type="org.openmodelica"' in structure
    assert '<oms:FixedStepMaster description="oms-ma" stepSize="0.01" />' in structure
