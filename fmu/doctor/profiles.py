"""Features of a unit, and the profiles of importers that know all that it needs.

A profile is a set of features that tools promise together. Source: "FMI 2.0/3.0 Profiles"
(Modelica Association, fmi-guides, draft of December 2025), chapters 2 and 3.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from lcmchain.fmu.doctor.rules.interface import Entry, Interface, whole

TUNABLE = "tunable parameters"
STATES = "saved states"
STORED_STATES = "states that can be stored"
TEXTS = "texts as inputs or outputs"
BINARIES = "binary inputs or outputs"
BINARY_PARAMETERS = "binary parameters"
INTEGERS = "integers of other sizes than 32 bits"
ARRAYS = "arrays of fixed size as inputs or outputs"
SIZED_ARRAYS = "arrays of settable size as inputs or outputs"
TIED_ARRAYS = "arrays of inputs or outputs that share a settable size"
ARRAY_PARAMETERS = "arrays of fixed size as parameters"
SIZED_PARAMETERS = "arrays of settable size as parameters"
TIED_PARAMETERS = "arrays of parameters that share a settable size"
STEPS = "steps of any size"
DEPENDENCIES = "dependencies of states and outputs"
OUTPUT_DERIVATIVES = "derivatives of outputs"
DIRECTIONAL = "directional derivatives"
ADJOINT = "adjoint derivatives"
EARLY_RETURN = "early return from a step"
INTERMEDIATE = "values within a step"
CLOCKS = "clocks in co-simulation"
SCHEDULED = "scheduled execution"
CLOCKED_EXCHANGE = "model exchange with clocks"
SOURCES = "source code"
DESKTOP = "binaries for desktop computers"
OTHER_BINARIES = "binaries for other platforms"

#: What an importer has to know to use a unit that has it; the others may be left unused.
NEEDED = frozenset(
    {TEXTS, BINARIES, BINARY_PARAMETERS, INTEGERS, ARRAYS, SIZED_ARRAYS, TIED_ARRAYS,
     ARRAY_PARAMETERS, SIZED_PARAMETERS, TIED_PARAMETERS, EARLY_RETURN, CLOCKS, CLOCKED_EXCHANGE}
)  # fmt: skip

_BASIC = {TUNABLE, ARRAYS, SIZED_ARRAYS, ARRAY_PARAMETERS, SIZED_PARAMETERS, DESKTOP}
_DYNAMICS = _BASIC | {
    STATES, STORED_STATES, TEXTS, BINARIES, INTEGERS, TIED_ARRAYS, TIED_PARAMETERS, STEPS,
    DEPENDENCIES, OUTPUT_DERIVATIVES, EARLY_RETURN, INTERMEDIATE, CLOCKS,
}  # fmt: skip
#: Features that each profile requires.
PROFILES = {
    "Basic CS": frozenset(_BASIC),
    "Sensor": frozenset({TUNABLE, BINARIES, BINARY_PARAMETERS, STEPS, DESKTOP}),
    "Basic HiL & Sensor HiL": frozenset(
        {TUNABLE, BINARIES, BINARY_PARAMETERS, INTEGERS, ARRAYS, ARRAY_PARAMETERS, SCHEDULED,
         SOURCES, DESKTOP, OTHER_BINARIES}
    ),
    "SIL ECU": frozenset(
        _BASIC | {STATES, BINARIES, BINARY_PARAMETERS, INTEGERS, STEPS, CLOCKS, SCHEDULED,
                  SOURCES, OTHER_BINARIES}
    ),
    "Dynamics": frozenset(_DYNAMICS),
    "Dynamics Controller": frozenset(_DYNAMICS | {CLOCKED_EXCHANGE}),
    "Optimization": frozenset(
        {TUNABLE, STATES, STORED_STATES, INTEGERS, ARRAYS, ARRAY_PARAMETERS, SIZED_PARAMETERS,
         STEPS, DEPENDENCIES, OUTPUT_DERIVATIVES, DIRECTIONAL, ADJOINT, INTERMEDIATE, DESKTOP}
    ),
}  # fmt: skip

_PARAMETERS = ("parameter", "calculatedParameter", "constant")
_INTEGERS = ("Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64")
_DESKTOPS = ("win32", "win64", "linux32", "linux64", "darwin64", "x86-windows", "x86_64-windows",
             "aarch64-windows", "x86-linux", "x86_64-linux", "aarch64-linux", "x86_64-darwin",
             "aarch64-darwin")  # fmt: skip
# Features by the attributes of an interface type that tell them, of FMI 2.0 and 3.0.
_ABILITIES = {
    STATES: ("canGetAndSetFMUstate", "canGetAndSetFMUState"),
    STORED_STATES: ("canSerializeFMUstate", "canSerializeFMUState"),
    STEPS: ("canHandleVariableCommunicationStepSize",),
    DIRECTIONAL: ("providesDirectionalDerivative", "providesDirectionalDerivatives"),
    ADJOINT: ("providesAdjointDerivatives",),
    EARLY_RETURN: ("mightReturnEarlyFromDoStep", "canReturnEarlyAfterIntermediateUpdate"),
    INTERMEDIATE: ("providesIntermediateUpdate",),
}


def features_of(root: Element, folder: Path) -> tuple[str, ...]:
    """Return the features that a unit has, in the order of the profiles' chapter 2.

    Parameters
    ----------
    root : of its model description, of FMI 2.0 or 3.0.
    folder : into which the unit is unpacked.
    """
    return tuple(_features(Interface(root), folder))


def profiles_for(features: tuple[str, ...]) -> tuple[str, ...]:
    """Return the profiles whose importers know all that a unit with these features needs."""
    needed = NEEDED.intersection(features)
    return tuple(name for name, required in PROFILES.items() if needed <= required)


def _features(interface: Interface, folder: Path) -> Iterator[str]:
    root, variables = interface.root, interface.variables
    passed = [v for v in variables if v.causality in ("input", "output")]
    others = [v for v in variables if v.causality not in ("input", "output")]
    parameters = [v for v in others if _is_parameter(v)]
    if any(_is_parameter(v) and v.variability == "tunable" for v in variables):
        yield TUNABLE
    heads = [head for head in interface.kinds if head.tag != "ScheduledExecution"]
    able = {name for head in heads for name, value in head.attrib.items()
            if value in ("true", "1")}  # fmt: skip
    told = {feature for feature, names in _ABILITIES.items() if able.intersection(names)}
    yield from (feature for feature in (STATES, STORED_STATES) if feature in told)
    if any(v.kind == "String" for v in passed):
        yield TEXTS
    if any(v.kind == "Binary" for v in passed):
        yield BINARIES
    if any(v.kind == "Binary" for v in parameters):
        yield BINARY_PARAMETERS
    if any(v.kind in _INTEGERS for v in passed + parameters):
        yield INTEGERS
    settable = {v.reference for v in variables if v.causality == "structuralParameter"}
    yield from _of_arrays(passed, settable, (ARRAYS, SIZED_ARRAYS, TIED_ARRAYS))
    of_parameters = (ARRAY_PARAMETERS, SIZED_PARAMETERS, TIED_PARAMETERS)
    yield from _of_arrays(parameters, settable, of_parameters)
    if STEPS in told:
        yield STEPS
    structure = root.find("ModelStructure")
    if structure is not None and any("dependencies" in row.attrib for row in structure.iter()):
        yield DEPENDENCIES
    if any(head.get("maxOutputDerivativeOrder", "0") != "0" for head in heads):
        yield OUTPUT_DERIVATIVES
    yield from (f for f in (DIRECTIONAL, ADJOINT, EARLY_RETURN, INTERMEDIATE) if f in told)
    has_clocks = any(v.kind == "Clock" for v in variables)
    if has_clocks and root.find("CoSimulation") is not None:
        yield CLOCKS
    if root.find("ScheduledExecution") is not None:
        yield SCHEDULED
    if has_clocks and root.find("ModelExchange") is not None:
        yield CLOCKED_EXCHANGE
    if any(folder.glob("sources/*")):
        yield SOURCES
    platforms = {path.name for path in folder.glob("binaries/*") if path.is_dir()}
    if platforms.intersection(_DESKTOPS):
        yield DESKTOP
    if platforms.difference(_DESKTOPS):
        yield OTHER_BINARIES


def _is_parameter(variable: Entry) -> bool:
    return variable.causality in _PARAMETERS or variable.variability == "constant"


def _of_arrays(
    variables: list[Entry], settable: set[int], names: tuple[str, str, str]
) -> Iterator[str]:
    """Yield which of the three kinds of arrays are among variables."""
    fixed, sized, tied = names
    sizes = [
        settable.intersection(whole(size.get("valueReference")) for size in v.dimensions)
        for v in variables
        if v.dimensions
    ]
    if any(not own for own in sizes):
        yield fixed
    if any(sizes):
        yield sized
    if any(one & other for k, one in enumerate(sizes) for other in sizes[:k]):
        yield tied
