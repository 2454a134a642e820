"""The model description of FMI 3.0 from the definition of a unit."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from lcmchain.fmu import description
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.variables import Kind, Variable

_ELEMENTS = {
    Kind.REAL: "Float64",
    Kind.INTEGER: "Int32",
    Kind.BOOLEAN: "Boolean",
    Kind.STRING: "String",
}


def model_description(definition: UnitDefinition, *, needs_tool: bool = True) -> Element:
    """Return ``modelDescription.xml`` of FMI 3.0; a field is one array.

    Outputs at a communication point depend on no input at that point: they are those of the state
    that the last step has reached. Masters that know this see no algebraic loop.

    Parameters
    ----------
    needs_tool : say that the unit needs a tool that is installed (``needsExecutionTool``); some
        masters refuse a unit that does.
    """
    variables = definition.variables
    root = Element("fmiModelDescription", description.head(definition, "3.0", structured=True))
    root.set("instantiationToken", definition.guid)
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": definition.model_name,
            "needsExecutionTool": str(needs_tool).lower(),
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "canHandleVariableCommunicationStepSize": "true",
        },
    )
    description.add_units(root, variables)
    types = SubElement(root, "TypeDefinitions")
    for name, own in description.used_types(variables).items():
        kind = "Enumeration" if own.items else _ELEMENTS[own.kind]
        declared = SubElement(types, f"{kind}Type", {"name": name, **own.attributes})
        for item in own.items:
            SubElement(declared, "Item", item)
    description.add_categories(root)
    description.add_experiment(root, definition)
    listed = SubElement(root, "ModelVariables")
    reference = {variable.name: str(index) for index, variable in enumerate(variables)}
    for variable in variables:
        _add_variable(listed, variable, reference[variable.name])
    structure = SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for variable in variables:
            if variable.causality == "output":
                dependencies = " ".join(reference[name] for name in variable.dependencies)
                unknown = {
                    "valueReference": reference[variable.name],
                    "dependencies": dependencies,
                }
                SubElement(structure, kind, unknown)
    return root


def _add_variable(listed: Element, variable: Variable, reference: str) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": reference,
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        **description.initial(variable),
        **description.limits(variable),
    }
    kind = "Enumeration" if variable.is_enumeration else _ELEMENTS[variable.kind]
    element = SubElement(listed, kind, attributes)
    if variable.size is not None:
        SubElement(element, "Dimension", {"start": str(variable.size)})
    if variable.start is None:
        return
    if variable.kind is Kind.STRING:
        SubElement(element, "Start", {"value": str(variable.start)})
    else:
        text = description.start_text(variable)
        element.set("start", " ".join([text] * variable.count))
