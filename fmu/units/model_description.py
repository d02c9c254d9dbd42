"""A unit's `modelDescription.xml` (FMI 2.0.2 for co-simulation) from its table of variables."""

from __future__ import annotations

import uuid
from xml.etree.ElementTree import Element, SubElement

from .interface import Interface, Unit, Variable

AUTHOR = "The developers of warp-mpm-impact"
LICENSE = "Apache-2.0"
GENERATION_DATE = "2026-01-01T00:00:00Z"
"""Part of the archive's bytes, hence a constant: the version tells the archives apart, not the clock."""

_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_DNS, "warp-mpm-impact.fmu")

LOG_CATEGORIES = {
    "logStatusWarning": "What the importer should know although the unit goes on.",
    "logStatusDiscard": "A step that the unit could not finish.",
    "logStatusError": "An input or a call that the unit refused.",
    "logStatusFatal": "A failure after which the unit cannot be used.",
    "logAll": "Every message.",
}


def guid(interface: Interface, version: str) -> str:
    """The archive's identity: the same for the same interface, version and code, another for any other."""
    return f"{{{uuid.uuid5(_NAMESPACE, f'{version} {interface!r}')}}}"


def model_description(
    interface: Interface, *, version: str, tool: str, needs_execution_tool: bool, source_files: tuple[str, ...] = ()
) -> Element:
    """The root element of `modelDescription.xml`.

    Args:
        interface: the table; its name is also the model identifier, the file name of the binaries.
        version: version and content stamp of the code inside.
        tool: what generated the archive.
        needs_execution_tool: whether the importer's machine must offer more than the archive, here a Python.
        source_files: names of the C files, for an archive that has them.
    """
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": interface.name,
            "guid": guid(interface, version),
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
    co_simulation = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": interface.name,
            "needsExecutionTool": boolean(needs_execution_tool),
            "canHandleVariableCommunicationStepSize": "true",
            "canInterpolateInputs": "false",
            "maxOutputDerivativeOrder": str(interface.output_derivatives),
            "canRunAsynchronuously": "false",
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            "providesDirectionalDerivative": boolean(interface.directional_derivatives),
        },
    )
    if source_files:
        files = SubElement(co_simulation, "SourceFiles")
        for name in source_files:
            SubElement(files, "File", {"name": name})
    unit_definitions(root, interface)
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
        variables.append(_scalar_variable(reference, variable))
    _model_structure(root, interface)
    return root


def full_description(variable: Variable) -> str:
    """The description with the meaning of each number of a choice."""
    return f"{variable.description}: {variable.range_text}" if variable.choice else variable.description


def unit_definitions(root: Element, interface: Interface, *others: Unit) -> None:
    """Append the units of the variables, and others."""
    units: dict[str, Unit] = {v.unit.name: v.unit for v in interface.variables if v.kind == "Real"}
    units |= {unit.name: unit for unit in others}
    definitions = SubElement(root, "UnitDefinitions")
    for name in sorted(units):
        unit = units[name]
        element = SubElement(definitions, "Unit", {"name": name})
        exponents = {"kg": unit.kg, "m": unit.m, "s": unit.s, "rad": unit.rad}
        base = {name: str(power) for name, power in exponents.items() if power}
        SubElement(element, "BaseUnit", base | ({} if unit.factor == 1 else {"factor": number(unit.factor)}))
        if unit.display_name:
            SubElement(element, "DisplayUnit", {"name": unit.display_name, "factor": number(unit.display_factor)})


def typed_attributes(variable: Variable) -> dict[str, str]:
    """What the XML says of a variable's values, the same in both versions of the standard."""
    typed: dict[str, str] = {}
    if variable.kind == "Real":
        typed["unit"] = variable.unit.name
        if variable.unit.display_name:
            typed["displayUnit"] = variable.unit.display_name
        if variable.least is not None:
            typed["min"] = number(variable.least)
        if variable.maximum is not None:
            typed["max"] = number(variable.maximum)
        typed["nominal"] = number(variable.nominal)
        if variable.start is not None:
            typed["start"] = number(float(variable.start))
    elif variable.choice is not None:
        typed["min"], typed["max"] = "1", str(len(variable.choice.items))
        if variable.start is not None:
            typed["start"] = str(variable.start)
    elif variable.start is not None:
        typed["start"] = boolean(bool(variable.start)) if variable.kind == "Boolean" else str(variable.start)
    return typed


def _scalar_variable(reference: int, variable: Variable) -> Element:
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": full_description(variable),
        "causality": variable.causality,
        "variability": variable.variability,
    }
    # FMI 2.0.2 section 2.2.7: an input must not state `initial`, its start value is exact by definition.
    if variable.causality == "parameter":
        attributes["initial"] = "exact"
    elif variable.causality == "output":
        attributes["initial"] = "calculated"
    element = Element("ScalarVariable", attributes)
    SubElement(element, variable.kind, typed_attributes(variable))
    return element


def _model_structure(root: Element, interface: Interface) -> None:
    structure = SubElement(root, "ModelStructure")
    outputs = SubElement(structure, "Outputs")
    initial_unknowns = SubElement(structure, "InitialUnknowns")
    indices = {variable.name: number for number, variable in enumerate(interface.variables, 1)}
    known = [v for v in interface.variables if v.causality in ("parameter", "input")]
    for variable in interface.of("output"):
        # An output belongs to the step that ended: an input set afterwards changes nothing until the next step.
        SubElement(outputs, "Unknown", {"index": str(indices[variable.name]), "dependencies": ""})
        SubElement(
            initial_unknowns,
            "Unknown",
            {
                "index": str(indices[variable.name]),
                "dependencies": " ".join(str(indices[v.name]) for v in known),
                "dependenciesKind": " ".join("dependent" for _ in known),
            },
        )


def boolean(value: bool) -> str:
    """As XML writes it."""
    return "true" if value else "false"


def number(value: float) -> str:
    """As XML writes it, to the last digit."""
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
