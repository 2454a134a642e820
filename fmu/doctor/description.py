"""The head of a model description: version, kinds, abilities and what they mean for a master."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.archive import read_xml
from lcmchain.coupling.cosimulation.description import TERMINALS_FILE, left_out, version_problem
from lcmchain.errors import InputError
from lcmchain.fmu.doctor.findings import Finding, Level
from lcmchain.fmu.doctor.profiles import NEEDED, features_of, profiles_for
from lcmchain.fmu.doctor.rules import Broken, broken_rules

KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
#: How many breaches of one rule are told.
MOST_TOLD = 3


@dataclass(frozen=True)
class Description:
    """What a model description says before its variables.

    Parameters
    ----------
    kinds : interface types, as the element names of FMI.
    identifier : name of the binary; that of co-simulation where the unit has it.
    abilities : attributes of that interface type, as they are written.
    left_out : what lcmchain cosim does not take of it, in sentences.
    broken : rules of the standard that it breaks; those of drafts and of FMI 1.0 are not known.
    features : that profiles of importers name, see :mod:`lcmchain.fmu.doctor.profiles`.
    """

    fmi_version: str
    model_name: str
    generation_tool: str
    kinds: tuple[str, ...]
    identifier: str
    abilities: dict[str, str]
    variable_count: int
    left_out: tuple[str, ...]
    broken: tuple[Broken, ...] = ()
    features: tuple[str, ...] = ()

    def can(self, *names: str) -> bool:
        """Return whether one of these abilities is declared."""
        return any(self.abilities.get(name) in ("true", "1") for name in names)


def read_description(folder: Path, unit: Path) -> Description:
    """Read the model description of an unpacked unit.

    Raises
    ------
    InputError : there is none, or it is none of FMI 1.0, 2.0 or 3.0.
    """
    path = folder / "modelDescription.xml"
    if not path.is_file():
        raise InputError("this is no unit: it holds no modelDescription.xml", file=unit)
    root = read_xml(path.read_bytes(), f"{unit}: modelDescription.xml")
    version = root.get("fmiVersion", "")
    if root.tag != "fmiModelDescription" or version.split(".")[0] not in ("1", "2", "3"):
        raise InputError(
            f'its modelDescription.xml is not one of FMI 1.0, 2.0 or 3.0 (fmiVersion "{version}")',
            file=unit,
        )
    kinds = [kind for kind in KINDS if root.find(kind) is not None]
    head = root.find(kinds[0]) if kinds else root
    if version.startswith("1"):  # there the name of the binary stands at the root
        head = root
        kinds = ["CoSimulation" if root.find("Implementation") is not None else "ModelExchange"]
    identifier = head.get("modelIdentifier") if head is not None else None
    if not kinds or not identifier:
        raise InputError("its modelDescription.xml names no binary (modelIdentifier)", file=unit)
    variables = root.find("ModelVariables")
    return Description(
        fmi_version=version,
        model_name=root.get("modelName", ""),
        generation_tool=root.get("generationTool", ""),
        kinds=tuple(kinds),
        identifier=identifier,
        abilities={} if head is None else dict(head.attrib),
        variable_count=0 if variables is None else len(variables),
        left_out=tuple(left_out(root)),
        broken=() if version_problem(version) else _broken(root, folder, unit),
        features=() if version.startswith("1") else features_of(root, folder),
    )


def _broken(root: Element, folder: Path, unit: Path) -> tuple[Broken, ...]:
    path = folder / TERMINALS_FILE
    terminals = None
    if path.is_file() and root.get("fmiVersion", "").startswith("3"):
        terminals = read_xml(path.read_bytes(), f"{unit}: {TERMINALS_FILE}")
    return tuple(broken_rules(root, terminals, folder))


def findings_of(description: Description, *, is_python: bool) -> Iterator[Finding]:
    """Yield what a master should know of a unit before it is loaded.

    is_python : the tool that it needs is Python, which is looked at by itself.
    """
    kinds = " and ".join(KINDS[kind] for kind in description.kinds)
    by = f", by {description.generation_tool}" if description.generation_tool else ""
    yield Finding(
        Level.OK, "unit",
        f"{description.model_name}: FMI {description.fmi_version}, {kinds}, "
        f"{description.variable_count} variables{by}",
    )  # fmt: skip
    problem = version_problem(description.fmi_version)
    if problem:
        yield Finding(
            Level.WARNING, "unit", f"lcmchain cosim refuses it: it {problem}",
        )  # fmt: skip
    yield from map(_finding_of, description.broken)
    if "CoSimulation" not in description.kinds:
        yield Finding(
            Level.WARNING, "unit", "it has no co-simulation; lcmchain cosim cannot use it",
            "export it for co-simulation",
        )  # fmt: skip
        return
    if not description.can("canGetAndSetFMUstate", "canGetAndSetFMUState"):
        yield Finding(
            Level.WARNING, "abilities",
            "it cannot go back to a saved state (canGetAndSetFMUstate): no implicit coupling, no "
            "retry of a failed step",
        )  # fmt: skip
    elif not description.can("canSerializeFMUstate", "canSerializeFMUState"):
        yield Finding(
            Level.NOTE, "abilities",
            "its state cannot be stored (canSerializeFMUstate): no checkpoint of the system",
        )  # fmt: skip
    if not description.can("canHandleVariableCommunicationStepSize"):
        yield Finding(
            Level.WARNING, "abilities",
            "it takes steps of one size only (canHandleVariableCommunicationStepSize)",
            "give the system a constant step",
        )  # fmt: skip
    if "fixedInternalStepSize" in description.abilities:
        yield Finding(
            Level.NOTE, "abilities",
            f"it computes in steps of {description.abilities['fixedInternalStepSize']} s "
            "(fixedInternalStepSize): in shorter windows its outputs change now and then only",
        )  # fmt: skip
    if description.can("canBeInstantiatedOnlyOncePerProcess"):
        yield Finding(
            Level.NOTE, "abilities",
            "a process can hold only one instance of it: lcmchain cosim gives each a process of "
            "its own",
        )  # fmt: skip
    if description.features:
        yield _finding_of_profiles(description.features)
    for text in description.left_out:
        yield Finding(Level.WARNING, "variables", text)
    if description.can("needsExecutionTool") and not is_python:
        yield Finding(
            Level.WARNING, "tool",
            "it needs the tool that exported it on this machine (needsExecutionTool)",
            f"install {description.generation_tool or 'that tool'} and its licence",
        )  # fmt: skip


def _finding_of_profiles(features: tuple[str, ...]) -> Finding:
    """Return what a unit asks of importers, and which profiles of these have it."""
    needed = ", ".join(feature for feature in features if feature in NEEDED)
    offered = ", ".join(feature for feature in features if feature not in NEEDED)
    profiles = ", ".join(profiles_for(features))
    if not needed:
        text = "it needs nothing that not every importer has"
    elif profiles:
        text = f"it needs {needed}, which importers of FMI's profiles {profiles} have"
    else:
        text = f"it needs {needed}: none of FMI's profiles has it all"
    return Finding(Level.OK, "profiles", text + (f"; it offers {offered}" if offered else ""))


def _finding_of(broken: Broken) -> Finding:
    """Return what is told about a broken rule: its name, how it is broken, what is asked."""
    shown = "; ".join(broken.how[:MOST_TOLD])
    more = len(broken.how) - MOST_TOLD
    return Finding(
        Level.WARNING, "standard",
        f"{broken.rule.name}: {shown}" + (f"; and {more} more" if more > 0 else ""),
        f"the standard asks for {broken.rule.asks} ({broken.rule.source})",
    )  # fmt: skip
