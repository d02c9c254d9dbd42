"""The co-simulation of flow, barrier and anchor as an SSP archive, and its run with fmpy.

    python -m fmu build
    python docs/cosimulation/system.py --out build/system.ssp --run

The barrier's mass, base friction and slope, and the end of the run, are those of the scenario in DebrisFlow.fmu, as in
coupled.py. Any tool that reads SSP takes the archive, for instance libcosim or OMSimulator; they apply the parameters
in it. fmpy's own runner leaves them to its caller, so they are read here and passed on.
"""

from __future__ import annotations

import argparse
import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

from coupled import barrier_parameters, scenario_in
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
    scenario = scenario_in(archives)
    values = barrier_parameters(scenario) | ({} if spacing is None else {"spacing": spacing})
    structure = STRUCTURE.read_text(encoding="utf-8")
    for name, value in values.items():
        structure = re.sub(rf'(name="{name}"><ssv:Real value=)"[^"]*"', rf'\g<1>"{value!r}"', structure)
    structure = re.sub(r'stopTime="[^"]*"', f'stopTime="{scenario.output.end_time_s!r}"', structure)
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
    parser.add_argument("--end", type=float, help="end time [s]; without it the scenario's")
    given = parser.parse_args()
    if not all((given.archives / f"{name}.fmu").is_file() for name in UNITS):
        parser.error(f"--archives: {given.archives} must hold {', '.join(UNITS)}; python -m fmu build makes them")
    try:
        path = write_system(given.archives, given.out, spacing=given.spacing)
    except ValueError as error:
        parser.error(str(error))
    except OSError as error:
        parser.error(f"--out: {given.out} cannot be written: {error.strerror}")
    print(f"System: {path}")
    if given.run:
        end = scenario_in(given.archives).output.end_time_s if given.end is None else given.end
        result = simulate_ssp(str(path), stop_time=end, step_size=given.step, parameter_set=parameters(path))
        last = result[-1]
        print(f"Final displacement: {last['barrier.barrier_displacement']:.3f} m")
        print(f"Anchor used to: {last['anchor.utilisation']:.0%}")


if __name__ == "__main__":
    main()
