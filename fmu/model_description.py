"""What pythonfmu leaves out of ``modelDescription.xml``: units and the structure of the model."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import (
    Boolean,
    Fmi2Causality,
    Fmi2Initial,
    Fmi2Variability,
    Integer,
    Real,
    String,
)

from lcmchain.fmu.variables import UNITS, Kind, Variable

_CLASSES = {
    Kind.REAL: Real,
    Kind.INTEGER: Integer,
    Kind.BOOLEAN: Boolean,
    Kind.STRING: String,
}


def scalar_variables(variables: Sequence[Variable]) -> list[Real | Integer | Boolean | String]:
    """Return the scalar variables of FMI 2 in the order of their value references."""
    scalars = []
    for variable in variables:
        computed = variable.causality == "output"
        for name, description in variable.scalars():
            scalars.append(
                _CLASSES[variable.kind](
                    name,
                    description=description,
                    causality=Fmi2Causality[variable.causality],
                    variability=Fmi2Variability[variable.variability],
                    initial=Fmi2Initial.calculated if computed else _initial(variable),
                    getter=_unused,
                    setter=_unused,
                )
            )
    return scalars


def complete(root: Element, variables: Sequence[Variable]) -> None:
    """Add unit definitions, the units of all variables, and the structure of the model.

    Outputs at a communication point depend on no input at that point: they are those of the state
    that the last step has reached. Masters that know this see no algebraic loop.
    """
    used = {variable.unit for variable in variables if variable.unit is not None}
    definitions = Element("UnitDefinitions")
    for name, exponents in UNITS.items():
        if name in used:
            unit = SubElement(definitions, "Unit", {"name": name})
            SubElement(unit, "BaseUnit", {base: str(power) for base, power in exponents.items()})
    # The schema wants them right after the kind of the unit.
    root.insert(list(root).index(next(root.iter("CoSimulation"))) + 1, definitions)

    units = [variable.unit for variable in variables for _ in variable.scalars()]
    for element, unit_name in zip(next(root.iter("ModelVariables")), units, strict=True):
        if unit_name is not None:
            element[0].set("unit", unit_name)

    structure = next(root.iter("ModelStructure"))
    outputs = next(structure.iter("Outputs"))
    initial = SubElement(structure, "InitialUnknowns")
    for unknown in outputs:
        unknown.set("dependencies", "")
        SubElement(initial, "Unknown", dict(unknown.attrib))


def _initial(variable: Variable) -> Fmi2Initial | None:
    # FMI 2 wants "exact" left out for inputs.
    return Fmi2Initial.exact if variable.causality == "parameter" else None


def _unused(*_) -> None:
    """Stand in for pythonfmu's access per variable; the slave answers for many at once."""
