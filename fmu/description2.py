"""The model description of FMI 2.0 from the definition of a unit."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from lcmchain.fmu import description
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.variables import Variable


def model_description(definition: UnitDefinition, *, needs_tool: bool = True) -> Element:
    """Return ``modelDescription.xml`` of FMI 2.0; every entry of a field is a scalar variable.

    Outputs at a communication point depend on no input at that point: they are those of the state
    that the last step has reached. Masters that know this see no algebraic loop.

    Parameters
    ----------
    needs_tool : say that the unit needs a tool that is installed (``needsExecutionTool``); some
        masters refuse a unit that does.
    """
    variables = definition.variables
    # Every entry of a field has a name, and reading a structured one costs masters time (fmpy
    # 1.7 ms): the names are declared as plain texts, however many there are.
    root = Element("fmiModelDescription", description.head(definition, "2.0", structured=False))
    root.set("guid", definition.guid)
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": definition.model_name,
            "needsExecutionTool": str(needs_tool).lower(),
            "canHandleVariableCommunicationStepSize": "true",
            "canInterpolateInputs": "false",
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
        },
    )
    description.add_units(root, variables)
    types = SubElement(root, "TypeDefinitions")
    for name, own in description.used_types(variables).items():
        simple = SubElement(types, "SimpleType", {"name": name})
        kind = "Enumeration" if own.items else own.kind.value
        declared = SubElement(simple, kind, own.attributes)
        for item in own.items:
            SubElement(declared, "Item", item)
    description.add_categories(root)
    description.add_experiment(root, definition)
    listed = SubElement(root, "ModelVariables")
    structure = SubElement(root, "ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    place = _places(variables)
    reference = 0
    for variable in variables:
        dependencies = " ".join(place[name] for name in variable.dependencies)
        for name, text in variable.scalars():
            _add_scalar(listed, variable, name, text, reference)
            reference += 1
            if variable.causality == "output":
                unknown = {"index": str(reference), "dependencies": dependencies}
                SubElement(outputs, "Unknown", unknown)
                SubElement(unknowns, "Unknown", unknown)
    return root


def _add_scalar(listed: Element, variable: Variable, name: str, text: str, reference: int) -> None:
    attributes = {
        "name": name,
        "valueReference": str(reference),
        "description": text,
        "causality": variable.causality,
        "variability": variable.variability,
        **description.initial(variable),
    }
    scalar = SubElement(listed, "ScalarVariable", attributes)
    kind = "Enumeration" if variable.is_enumeration else variable.kind.value
    typed = SubElement(scalar, kind, description.limits(variable))
    if variable.start is not None:
        typed.set("start", description.start_text(variable))


def _places(variables: tuple[Variable, ...]) -> dict[str, str]:
    """Return the indices of the scalars of every variable, as a list in XML."""
    first, places = 1, {}
    for variable in variables:
        places[variable.name] = " ".join(str(first + i) for i in range(variable.count))
        first += variable.count
    return places
