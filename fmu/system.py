"""Flow, barrier and anchor as one system: an SSP 1.0 archive (structure, parameters, units) of the units in C."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, fromstring, indent, register_namespace, tostring

from .archive import write_archive
from .units import barrier_sliding, debris_flow, ground_anchor
from .units.interface import Interface
from .units.model_description import number, unit_definitions

if TYPE_CHECKING:
    from warp_mpm import Scenario

NAMESPACES = {
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
STEP = 0.01
"""Communication step [s] that the archive proposes."""

COMPONENTS: dict[str, tuple[str, Interface]] = {
    "flow": ("DebrisFlowC", debris_flow.INTERFACE),
    "barrier": ("BarrierSlidingC", barrier_sliding.INTERFACE),
    "anchor": ("GroundAnchorC", ground_anchor.INTERFACE),
}
"""By the name in the system: the archive, and its table of variables."""

CONNECTIONS = (
    ("flow.barrier_force", "barrier.impact_force_input"),
    ("flow.vertical_load", "barrier.vertical_load"),
    ("anchor.force", "barrier.external_force"),
    ("barrier.barrier_velocity", "flow.barrier_velocity_input"),
    ("barrier.barrier_displacement", "anchor.barrier_displacement"),
)
SHOWN = ("anchor.utilisation",)
"""Outputs that are told beside those that are connected."""

PARAMETER_SET = "scene"

Values = Mapping[str, Mapping[str, float]]


def scenario_in(archive: Path) -> Scenario:
    """The scenario inside an archive of `DebrisFlow`."""
    from warp_mpm import Scenario

    with zipfile.ZipFile(archive) as file:
        return Scenario.model_validate(json.loads(file.read(f"resources/{debris_flow.SCENARIO}")))


def barrier_parameters(scenario: Scenario, barrier_mass: float | None = None) -> dict[str, float]:
    """What BarrierSliding must be given to be the scenario's barrier, or one of another mass [kg/m].

    Raises:
        ValueError: the scenario's barrier is none that BarrierSliding could be.
    """
    motion = scenario.barrier.motion if scenario.barrier is not None else None
    if scenario.barrier is None or motion is None or motion.kind != "sliding":
        kind = f"barrier.motion.kind is {motion.kind!r}" if motion is not None else "there is no barrier"
        raise ValueError(f"{scenario.title}: {kind}, it must be 'sliding' for a barrier that another unit moves.")
    friction, gravity, slope = motion.base_friction_coefficient, scenario.gravity, scenario.gravity.tilt_deg
    if slope and friction <= abs(math.tan(math.radians(slope))):
        raise ValueError(
            f"{scenario.title}: the barrier's base friction is {friction:.3g}, it must be greater than the slope's "
            f"tangent, {abs(math.tan(math.radians(slope))):.3g}: BarrierSliding knows no barrier that slides by itself."
        )
    mass = barrier_mass if barrier_mass is not None else scenario.barrier.mass
    assert mass is not None
    acceleration = gravity.acceleration_m_per_s2
    return {"barrier_mass": mass, "base_friction": friction, "gravity": acceleration, "slope": slope}


def parameter_values(scenario: Scenario, spacing: float | None = None) -> Values:
    """Parameters of the components by name, for a scenario; `spacing` [m] replaces the scenario's."""
    return {
        "flow": {"barrier_motion": 2, "spacing": spacing or 0.0},
        "barrier": {"impact_force_source": 2, **barrier_parameters(scenario)},
        "anchor": {"stiffness": 1e5, "yield_force": 150e3},
    }


def write_system(archives: Path, path: Path, *, spacing: float | None = None) -> Path:
    """Pack structure, parameters and units into `path`; the same units give the same bytes.

    Args:
        archives: folder with the units in C.
        spacing: of the simulator's grid [m], instead of the scenario's.

    Raises:
        ValueError: the scenario's barrier is none that BarrierSliding could be.
    """
    scenario = scenario_in(archives / f"{COMPONENTS['flow'][0]}.fmu")
    values = parameter_values(scenario, spacing)
    entries = {"SystemStructure.ssd": as_xml(structure(scenario.output.end_time_s))}
    for component, (unit, interface) in COMPONENTS.items():
        entries[f"resources/{component}.ssv"] = as_xml(parameter_set(interface, values[component]))
        entries[f"resources/{unit}.fmu"] = (archives / f"{unit}.fmu").read_bytes()
    return write_archive(path, entries)


def parameters_in(path: Path) -> dict[str, tuple[str, str]]:
    """Type and value of the parameters in an SSP archive, by component and name, as a tool would read them."""
    found = {}
    with zipfile.ZipFile(path) as archive:
        root = fromstring(archive.read("SystemStructure.ssd"))
        for component in root.iterfind(".//ssd:Component", NAMESPACES):
            for binding in component.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
                values = fromstring(archive.read(binding.attrib["source"]))
                for parameter in values.iterfind(".//ssv:Parameter", NAMESPACES):
                    name = f"{component.attrib['name']}.{parameter.attrib['name']}"
                    found[name] = (parameter[0].tag.split("}")[1], parameter[0].attrib["value"])
    return found


def structure(end_time: float) -> Element:
    """The root element of `SystemStructure.ssd`."""
    root = _element("ssd", "SystemStructureDescription", {"version": "1.0", "name": "SlidingBarrierWithAnchor"})
    about = {"name": "system", "description": "A debris flow pushes a barrier that an anchor holds back"}
    system = _child(root, "ssd", "System", about)
    elements = _child(system, "ssd", "Elements")
    used: set[str] = set()
    for name, (unit, interface) in COMPONENTS.items():
        source = {"type": "application/x-fmu-sharedlibrary", "source": f"resources/{unit}.fmu"}
        component = _child(elements, "ssd", "Component", {"name": name, **source})
        connectors = _child(component, "ssd", "Connectors")
        for end in sorted({*(end for pair in CONNECTIONS for end in pair), *SHOWN}):
            owner, variable_name = end.split(".")
            if owner == name:
                variable = interface.variables[interface.references[variable_name]]
                connector = _child(connectors, "ssd", "Connector", {"name": variable_name, "kind": variable.causality})
                _child(connector, "ssc", "Real", {"unit": variable.unit.name})
                used.add(variable.unit.name)
        bindings = _child(component, "ssd", "ParameterBindings")
        _child(bindings, "ssd", "ParameterBinding", {"source": f"resources/{name}.ssv"})
    connections = _child(system, "ssd", "Connections")
    for start, end in CONNECTIONS:
        ends = {"start": start.split("."), "end": end.split(".")}
        attributes = {f"{side}Element": parts[0] for side, parts in ends.items()}
        attributes |= {f"{side}Connector": parts[1] for side, parts in ends.items()}
        _child(connections, "ssd", "Connection", attributes)
    # OMSimulator asks each system which master steps it.
    noted = _noted(system)
    _child(noted, "oms", "FixedStepMaster", {"description": "oms-ma", "stepSize": number(STEP)})
    _units(root, "ssd", [interface for _, interface in COMPONENTS.values()], used)
    experiment = _child(root, "ssd", "DefaultExperiment", {"startTime": "0.0", "stopTime": repr(end_time)})
    _noted(experiment).attrib |= {
        "resultFile": "system_res.mat",
        "loggingInterval": "0.0",
        "bufferSize": "10",
        "signalFilter": "",
    }
    return root


def parameter_set(interface: Interface, values: Mapping[str, float | str]) -> Element:
    """The root element of a file of parameter values (SSV) for a unit."""
    root = _element("ssv", "ParameterSet", {"version": "1.0", "name": PARAMETER_SET})
    group = _child(root, "ssv", "Parameters")
    used = set()
    for name, value in values.items():
        variable = interface.variables[interface.references[name]]
        parameter = _child(group, "ssv", "Parameter", {"name": name})
        if variable.kind == "Real":
            _child(parameter, "ssv", "Real", {"value": repr(float(value)), "unit": variable.unit.name})
            used.add(variable.unit.name)
        else:
            text = str(value).lower() if variable.kind == "Boolean" else str(value)
            _child(parameter, "ssv", variable.kind, {"value": text})
    if used:
        _units(root, "ssv", [interface], used)
    return root


def as_xml(root: Element) -> bytes:
    """The file of a root element."""
    for prefix, address in NAMESPACES.items():
        register_namespace(prefix, address)
    indent(root)
    return tostring(root, "UTF-8", xml_declaration=True)


def _units(root: Element, room: str, interfaces: list[Interface], used: set[str]) -> None:
    """Declare the units that are used, which the standard demands of the file that uses them."""
    collected: dict[str, Element] = {}
    for interface in interfaces:
        holder = Element("holder")
        unit_definitions(holder, interface)
        collected |= {unit.attrib["name"]: unit for unit in holder.iter("Unit")}
    group = _child(root, room, "Units")
    for name in sorted(used):
        unit = _child(group, "ssc", "Unit", {"name": name})
        base = collected[name].find("BaseUnit")
        _child(unit, "ssc", "BaseUnit", base.attrib if base is not None else {})


def _noted(parent: Element) -> Element:
    annotation = _child(_child(parent, "ssd", "Annotations"), "ssc", "Annotation", {"type": "org.openmodelica"})
    return _child(_child(annotation, "oms", "Annotations"), "oms", "SimulationInformation")


def _element(room: str, tag: str, attributes: Mapping[str, str] | None = None) -> Element:
    return Element(f"{{{NAMESPACES[room]}}}{tag}", dict(attributes or {}))


def _child(parent: Element, room: str, tag: str, attributes: Mapping[str, str] | None = None) -> Element:
    return SubElement(parent, f"{{{NAMESPACES[room]}}}{tag}", dict(attributes or {}))
