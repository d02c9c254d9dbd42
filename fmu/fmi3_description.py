"""The XML files of a unit of FMI 3.0 from its table of variables: model, build, and terminals with icon."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from .units.interface import SECOND, Choice, Interface, Variable
from .units.model_description import (
    AUTHOR,
    GENERATION_DATE,
    LICENSE,
    LOG_CATEGORIES,
    boolean,
    number,
    typed_attributes,
    unit_definitions,
)

VERSION = "3.0"

TIME = "time"
"""Name of the independent variable, which stands behind all others."""

_TYPES = {"Real": "Float64", "Boolean": "Boolean", "String": "String"}

_PLUGS: dict[str, dict[str, tuple[str, dict[str, str]]]] = {
    "BarrierSliding": {
        "flow": (
            "What pushes the barrier, and how it gives way",
            {"force": "impact_force_input", "weight": "vertical_load", "velocity": "barrier_velocity"},
        ),
        "support": (
            "What holds the barrier, and how far it has come",
            {"force": "external_force", "displacement": "barrier_displacement"},
        ),
    },
    "GroundAnchor": {
        "support": ("The barrier that it holds", {"force": "force", "displacement": "barrier_displacement"}),
    },
    "DebrisFlow": {
        "flow": (
            "The barrier that it pushes, where another unit moves it",
            {"force": "barrier_force", "weight": "vertical_load", "velocity": "barrier_velocity_input"},
        ),
    },
}
"""Terminals by unit and name: meaning, and the variable of each member. Those of one name fit together."""


def model_description(
    interface: Interface, *, version: str, token: str, tool: str, needs_execution_tool: bool
) -> Element:
    """The root element of `modelDescription.xml`; arguments as for FMI 2.0, `token` is what the GUID was."""
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": VERSION,
            "modelName": interface.name,
            "instantiationToken": token,
            "description": interface.description,
            "author": AUTHOR,
            "version": version,
            "copyright": AUTHOR,
            "license": LICENSE,
            "generationTool": tool,
            "generationDateAndTime": GENERATION_DATE,
            "variableNamingConvention": "structured",
        },
    )
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": interface.name,
            "needsExecutionTool": boolean(needs_execution_tool),
            "canHandleVariableCommunicationStepSize": "true",
            "maxOutputDerivativeOrder": str(interface.output_derivatives),
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "providesDirectionalDerivatives": boolean(interface.directional_derivatives),
            "hasEventMode": "false",
        },
    )
    unit_definitions(root, interface, SECOND)
    _type_definitions(root, interface)
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": description})
    SubElement(
        root,
        "DefaultExperiment",
        {"startTime": "0", "stopTime": number(interface.stop_time), "stepSize": number(interface.step_size)},
    )
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(interface.variables):
        variables.append(_variable(reference, variable))
    SubElement(
        variables,
        "Float64",
        {
            "name": TIME,
            "valueReference": str(len(interface.variables)),
            "description": "Time that the unit has reached",
            "causality": "independent",
            "variability": "continuous",
            "unit": "s",
        },
    )
    structure = SubElement(root, "ModelStructure")
    known = [str(interface.references[v.name]) for v in interface.variables if v.causality != "output"]
    outputs = [str(interface.references[v.name]) for v in interface.of("output")]
    for reference_text in outputs:
        # An output belongs to the step that ended: an input set afterwards changes nothing until the next step.
        SubElement(structure, "Output", {"valueReference": reference_text, "dependencies": ""})
    kinds = " ".join("dependent" for _ in known)
    for reference_text in outputs:
        depends = {"dependencies": " ".join(known), "dependenciesKind": kinds}
        SubElement(structure, "InitialUnknown", {"valueReference": reference_text, **depends})
    return root


def build_description(name: str, source: str) -> Element:
    """The root element of `sources/buildDescription.xml`: one file to compile."""
    root = Element("fmiBuildDescription", {"fmiVersion": VERSION})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": name, "description": "Any C99 compiler"})
    sources = SubElement(configuration, "SourceFileSet", {"language": "C99"})
    SubElement(sources, "SourceFile", {"name": source})
    return root


def terminals(base: str) -> Element:
    """The root element of `terminalsAndIcons/terminalsAndIcons.xml` of a unit."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": VERSION})
    picture = SubElement(root, "GraphicalRepresentation")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    SubElement(picture, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": "0.1"})
    SubElement(picture, "Icon", corners)
    group = SubElement(root, "Terminals")
    for name, (meaning, members) in _PLUGS[base].items():
        terminal = SubElement(group, "Terminal", {"name": name, "matchingRule": "plug", "description": meaning})
        for member, variable in members.items():
            attributes = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            SubElement(terminal, "TerminalMemberVariable", attributes)
    return root


def _type_definitions(root: Element, interface: Interface) -> None:
    choices: dict[str, Choice] = {v.choice.name: v.choice for v in interface.variables if v.choice}
    if not choices:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for name, choice in choices.items():
        kind = SubElement(definitions, "EnumerationType", {"name": name, "description": choice.description})
        for value, (item, meaning) in enumerate(choice.items, 1):
            SubElement(kind, "Item", {"name": item, "value": str(value), "description": meaning})


def _variable(reference: int, variable: Variable) -> Element:
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.choice is not None:
        attributes["declaredType"] = variable.choice.name
    if variable.causality == "parameter":
        attributes["initial"] = "exact"
    elif variable.causality == "output":
        attributes["initial"] = "calculated"
    typed = typed_attributes(variable)
    if variable.kind == "String":
        element = Element("String", attributes)
        if "start" in typed:
            SubElement(element, "Start", {"value": typed["start"]})
        return element
    return Element("Enumeration" if variable.choice is not None else _TYPES[variable.kind], attributes | typed)
