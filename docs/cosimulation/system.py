"""The co-simulation of flow, barrier and anchor as an SSP archive, and its run with fmpy.

    python -m fmu build
    python docs/cosimulation/system.py --out build/system.ssp --run

Any tool that reads SSP takes the archive, for instance libcosim or OMSimulator; they apply the parameters in it. fmpy's
own runner leaves them to its caller, so they are read here and passed on.
"""

from __future__ import annotations

import argparse
import zipfile
from pathlib import Path
from xml.etree import ElementTree

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet

STRUCTURE = Path(__file__).with_name("SystemStructure.ssd")
UNITS = ("DebrisFlow", "BarrierSliding", "GroundAnchor")
NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}


def write_system(archives: Path, path: Path, *, spacing: float | None = None) -> Path:
    """Pack the structure and the units into ``path``; ``spacing`` [m] replaces that of the scenario."""
    structure = STRUCTURE.read_text(encoding="utf-8")
    if spacing is not None:
        structure = structure.replace('<ssv:Real value="0.0" unit="m"/>', f'<ssv:Real value="{spacing}" unit="m"/>')
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SystemStructure.ssd", structure)
        for unit in UNITS:
            archive.write(archives / f"{unit}.fmu", f"resources/{unit}.fmu")
    return path


def parameters(path: Path) -> ParameterSet:
    """The parameters in an SSP archive, in the form that fmpy's runner takes."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    found = ParameterSet(name="all")
    for component in root.iterfind(".//ssd:Component", NAMESPACES):
        for parameter in component.iterfind(".//ssv:Parameter", NAMESPACES):
            name, value = f"{component.get('name')}.{parameter.get('name')}", parameter[0].get("value")
            found.parameters.append(Parameter(name=name, type=parameter[0].tag.split("}")[1], value=value))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archives", type=Path, default=Path("build/fmu"), help="folder with the built units")
    parser.add_argument("--out", type=Path, default=Path("build/system.ssp"), help="the SSP archive to write")
    parser.add_argument("--spacing", type=float, help="grid spacing [m], instead of the scenario's")
    parser.add_argument("--run", action="store_true", help="run it with fmpy")
    parser.add_argument("--step", type=float, default=0.01, help="communication step [s]")
    parser.add_argument("--end", type=float, default=6.0, help="end time [s]")
    given = parser.parse_args()
    path = write_system(given.archives, given.out, spacing=given.spacing)
    print(f"System: {path}")
    if given.run:
        result = simulate_ssp(str(path), stop_time=given.end, step_size=given.step, parameter_set=parameters(path))
        last = result[-1]
        print(f"Final displacement: {last['barrier.barrier_displacement']:.3f} m")
        print(f"Anchor used to: {last['anchor.utilisation']:.0%}")


if __name__ == "__main__":
    main()
