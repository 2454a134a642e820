"""Rules of the standard: units that are built keep them, and each that is broken is found."""

import copy
import json
import re
import zipfile
from pathlib import Path
from xml.etree.ElementTree import SubElement, fromstring, tostring

import pytest
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.cosimulation.archive import read_member, read_xml
from lcmchain.coupling.cosimulation.description import TERMINALS_FILE
from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.doctor.description import MOST_TOLD, findings_of, read_description
from lcmchain.fmu.doctor.rules import RULES, broken_rules
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.fmu.infiltration.variables import MOTIONS
from lcmchain.manual.contents import read_page

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def description_of(unit):
    return read_xml(read_member(unit, "modelDescription.xml"), unit)


def broken_in(unit):
    """Return the rules that a unit breaks, with its terminals where it has any."""
    root, terminals = description_of(unit), None
    if root.get("fmiVersion") == "3.0":
        terminals = fromstring(read_member(unit, TERMINALS_FILE))
    return broken_rules(root, terminals)


@pytest.fixture(scope="module")
def described(patch_file, tmp_path_factory):
    """Descriptions of the small unit, with arrays of 16 values in FMI 3.0."""
    folder = tmp_path_factory.mktemp("rules")
    return {
        fmi: description_of(build_fmu(patch_file, folder / f"patch{fmi}.fmu", fmi=fmi))
        for fmi in (2, 3)
    }


# --- units that are built -------------------------------------------------------------------------


def scenes():
    """Yield the scenes among the examples of which a unit can be built."""
    found = [EXAMPLES / "cosimulation" / "dome.toml", *sorted(EXAMPLES.rglob("scene.toml"))]
    yield from (path for path in found if path.parent.name != "draping")  # laid without forces


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="needs the checkout, not only the tests")
@pytest.mark.parametrize("both", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_units_of_all_examples_keep_the_rules(tmp_path, both):
    """In one version or the other by turns; what they are made of is the same."""
    built = 0
    for number, scene in enumerate(scenes()):
        for fmi in (2, 3) if both else (2 + number % 2,):
            # without --fields all, which makes descriptions of megabytes of FMI 2.0 only
            unit = build_fmu(scene, tmp_path / "unit.fmu", fmi=fmi)
            assert broken_in(unit) == [], (scene, fmi)
            built += 1
    assert built >= (24 if both else 12)


@pytest.mark.parametrize("fmi", [2, 3])
def test_units_with_all_that_can_be_asked_for_keep_the_rules(patch_file, tmp_path, fmi):
    unit = build_fmu(
        patch_file, tmp_path / "unit.fmu", fmi=fmi, fields=["all"], pore_pressure=True, interface=4
    )
    root = description_of(unit)
    assert broken_in(unit) == []
    assert len(root.find("ModelVariables")) > 60


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="needs the checkout, not only the tests")
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("motion", MOTIONS)
def test_infiltration_units_keep_the_rules(tmp_path, fmi, motion):
    scene = EXAMPLES / "cosimulation" / "compression" / "scene.toml"
    for fields in (None, ["all"]):
        unit = build_infiltration_fmu(
            None, scene, tmp_path / "resin.fmu", fmi=fmi,
            options=InfiltrationUnit(motion=motion, fields=fields),
        )  # fmt: skip
        assert broken_in(unit) == []


# --- each rule broken -----------------------------------------------------------------------------


def variable(root, name):
    return next(v for v in root.find("ModelVariables") if v.get("name") == name)


def typed(root, name):
    """Return the element that holds type and start."""
    element = variable(root, name)
    return element[0] if root.get("fmiVersion") == "2.0" else element


def sets(name, /, of_type=False, **attributes):
    """Change attributes of a variable; None takes one away."""

    def change(root):
        element = (typed if of_type else variable)(root, name)
        for key, value in attributes.items():
            element.attrib.pop(key, None)
            if value is not None:
                element.set(key, value)

    return change


def at(path, /, **attributes):
    """Change attributes of the first element of a path."""

    def change(root):
        for key, value in attributes.items():
            root.find(path).set(key, value)

    return change


def twice(path):
    """Repeat the last element of a path."""

    def change(root):
        parent, _, _ = path.rpartition("/")
        root.find(parent).append(copy.deepcopy(root.findall(path)[-1]))

    return change


def without(path):
    def change(root):
        parent, _, _ = path.rpartition("/")
        root.find(parent).remove(root.find(path))

    return change


def has(kind, name, /, **attributes):
    """Add a variable of FMI 3.0; ``_dimension`` is the reference of one of its sizes."""

    def change(root):
        dimension = attributes.get("_dimension")
        kept = {key: value for key, value in attributes.items() if key != "_dimension"}
        element = SubElement(root.find("ModelVariables"), kind, {"name": name, **kept})
        if dimension is not None:
            SubElement(element, "Dimension", {"valueReference": dimension})

    return change


def has2(name, kind, start=None, /, **attributes):
    """Add a variable of FMI 2.0."""

    def change(root):
        element = SubElement(
            root.find("ModelVariables"), "ScalarVariable", {"name": name, **attributes}
        )
        SubElement(element, kind, {} if start is None else {"start": start})

    return change


def both(*changes):
    def change(root):
        for one in changes:
            one(root)

    return change


CLOCK = {"valueReference": "900", "causality": "input", "intervalVariability": "triggered"}
EVENTS = at("CoSimulation", hasEventMode="true")
TICK = both(EVENTS, has("Clock", "tick", **CLOCK))
LAST = has("Float64", "last", valueReference="901", variability="discrete", initial="exact",
           start="0", clocks="900")  # fmt: skip
NOW = {"valueReference": "902", "variability": "discrete", "initial": "exact", "start": "0"}
MEMORY = both(TICK, LAST, has("Float64", "now", **NOW, clocks="900", previous="901"))
SIZE = {"valueReference": "910", "causality": "structuralParameter", "variability": "fixed"}


def states(root):
    """Give FMI 2.0 or 3.0 a state that is computed at the start, and its derivative."""
    listed, structure = root.find("ModelVariables"), root.find("ModelStructure")
    if root.get("fmiVersion") == "2.0":
        number = len(listed)
        for name, more in (("x", {}), ("der(x)", {"derivative": str(number + 1)})):
            head = {"name": name, "valueReference": str(5000 + len(listed))}
            SubElement(SubElement(listed, "ScalarVariable", head), "Real", more)
        derivatives = SubElement(structure, "Derivatives")
        structure[:] = [structure[0], derivatives, structure[1]]
        SubElement(derivatives, "Unknown", {"index": str(number + 2)})
        for index in (number + 1, number + 2):
            SubElement(structure.find("InitialUnknowns"), "Unknown", {"index": str(index)})
        return
    SubElement(listed, "Float64", {"name": "x", "valueReference": "920"})
    SubElement(listed, "Float64", {"name": "der(x)", "valueReference": "921", "derivative": "920"})
    SubElement(structure, "ContinuousStateDerivative", {"valueReference": "921"})
    for reference in ("920", "921"):
        SubElement(structure, "InitialUnknown", {"valueReference": reference})


def reversed_initial_unknowns(root):
    listed = root.find("ModelStructure/InitialUnknowns")
    listed[:] = listed[::-1]


#: Changes that break one rule: the rule, the version, the change, words of the finding.
BROKEN = [
    ("variability", 2, sets("punch.travel", variability="fixed", initial=None),
     "punch.travel is output, fixed"),
    ("variability", 3, sets("threads", variability="discrete", initial=None),
     "threads is parameter, discrete"),
    ("variability", 2, sets("status", variability="continuous"), "is continuous, but Integer"),
    ("variability", 3, both(TICK, sets("tick", variability="tunable", causality="local")),
     "the clock tick is tunable"),
    ("initial", 2, sets("punch.drive", initial="exact"), 'discrete with initial "exact"'),
    ("initial", 3, sets("time", initial="exact"), 'independent, continuous with initial "exact"'),
    ("initial", 3, sets("threads", initial="approx"), 'fixed with initial "approx"'),
    ("start", 2, sets("punch.drive", of_type=True, start=None), "no start value, but is an input"),
    ("start", 3, sets("threads", start=None), "threads has no start value, but is initial exact"),
    ("start", 2, sets("punch.travel", of_type=True, start="0"), "is initial calculated"),
    ("start", 3, sets("time", start="0"), "time has a start value, but is the independent one"),
    ("start type", 2, sets("punch.drive", of_type=True, start="no"), "neither true nor false"),
    ("start type", 3, sets("threads", start="-1"), '"-1" of threads is beyond min and max'),
    ("start type", 3, sets("threads", start="4294967296"), "beyond the range of Int32"),
    ("start type", 2, sets("punch.velocity_input", of_type=True, start="fast"), "is no number"),
    ("limits", 2, sets("threads", of_type=True, max="-1"), "threads has min 0 above max -1"),
    ("limits", 3, at("TypeDefinitions/Float64Type[@name='Length']", min="x"),
     "the type Length has limits that are no Float64"),
    ("independent variable", 3, sets("time", causality="local"), "no variable is independent"),
    ("independent variable", 2, has2("t", "Real", causality="independent", valueReference="9000"),
     "are independent"),
    ("declared types", 2, sets("step_outcome", of_type=True, declaredType="Other"),
     'type "Other" of step_outcome is not defined'),
    ("declared types", 3, sets("step_outcome", declaredType=None), "has no declared type"),
    ("declared types", 3, sets("punch.travel", declaredType="Count"), "but its type"),
    ("units of measurement", 2, sets("punch.travel", of_type=True, unit="ell"),
     'the unit "ell" of punch.travel is not defined'),
    ("units of measurement", 3, at("TypeDefinitions/Float64Type[@name='Length']", displayUnit="ft"),
     'the display unit "ft" of the type Length is none of its unit "m"'),
    ("names", 3, sets("punch.travel", name="punch.2"), "punch.2 is no structured name"),
    ("names", 2, sets("punch.travel", name="a\nb"), "line breaks"),
    ("names", 3, sets("status", name="der(x)"), "der(x) is Int32"),
    ("value references", 3, has("Float64", "again", valueReference="0"), "and again"),
    ("value references", 2, sets("punch.travel", valueReference=None), "has no value reference"),
    ("aliases", 2, has2("again", "Integer", "0", causality="parameter", variability="fixed",
                        valueReference="{threads}"), "more than one can be set"),
    ("aliases", 2, has2("again", "Integer", variability="discrete",
                        valueReference="{element_count}"), "only some are constant"),
    ("aliases", 2, has2("again", "Integer", "7", causality="local", variability="constant",
                        valueReference="{element_count}"), "different start values"),
    ("aliases", 3, lambda root: SubElement(variable(root, "status"), "Alias", {"name": "time"}),
     '"time" of an alias is that of another variable'),
    ("setting more than once", 2, sets("punch.drive", canHandleMultipleSetPerTimeInstant="true"),
     "for co-simulation alone"),
    ("setting more than once", 3, sets("status", canHandleMultipleSetPerTimeInstant="false"),
     "status is output"),
    ("derivatives and restarts", 2, sets("punch.velocity", of_type=True, derivative="9999"),
     "the derivative of no other variable"),
    ("derivatives and restarts", 3, sets("punch.velocity", derivative="{status}"),
     "status, which is not continuous"),
    ("derivatives and restarts", 3, sets("punch.velocity", reinit="true"), "no continuous state"),
    ("dimensions", 3, lambda root: variable(root, "thickness").find("Dimension").attrib.clear(),
     "with neither or both"),
    ("dimensions", 3, has("Float64", "a", valueReference="911", _dimension="{threads}"),
     "which is neither constant nor a structural parameter"),
    ("dimensions", 3, both(has("UInt64", "n", **SIZE, start="0"),
                           has("Float64", "a", valueReference="911", _dimension="910")),
     'a has a dimension of the size "0"'),
    ("dimensions", 3, both(has("Int32", "n", **SIZE, start="3"),
                           has("Float64", "a", valueReference="911", _dimension="910")),
     "by n, which is Int32"),
    ("dimensions", 3, both(has("UInt64", "n", **SIZE, start="3"),
                           has("Float64", "a", valueReference="911", _dimension="910",
                               causality="parameter", start="1 2")),
     "a has 3 entries, but 2 start values"),
    ("dimensions", 3, has("UInt64", "n", **SIZE, start="3", _dimension="910"),
     "the structural parameter n has dimensions"),
    ("clocks", 3, has("Clock", "tick", **CLOCK), "the unit has clocks, but not hasEventMode"),
    ("clocks", 3, both(EVENTS, has("Clock", "tick", **CLOCK | {"intervalVariability": "constant"})),
     "is constant, but without intervalDecimal"),
    ("clocks", 3, both(EVENTS, has("Clock", "tick", **CLOCK, intervalDecimal="1")),
     "has intervalDecimal, but is triggered"),
    ("clocks", 3, both(TICK, sets("status", clocks="{time}")), "names clocks that are none"),
    ("previous values", 3, both(TICK, LAST, has("Float64", "now", **NOW, previous="901"),
                                lambda root: SubElement(root.find("ModelStructure"), "ClockedState",
                                                    {"valueReference": "902"})),
     "has a previous value, but no clocks"),
    ("previous values", 3, sets("status", intermediateUpdate="true"), "has intermediateUpdate"),
    ("outputs", 2, without("ModelStructure/Outputs/Unknown"), "is missing"),
    ("outputs", 3, at("ModelStructure/Output", valueReference="{threads}"), "threads is no output"),
    ("outputs", 2, twice("ModelStructure/Outputs/Unknown"), "stands there more than once"),
    ("derivatives of states", 3, both(states, at("ModelStructure/ContinuousStateDerivative",
                                                 valueReference="920"),
                                      without("ModelStructure/InitialUnknown[@valueReference='921']"),
                                      ),
     "x is no continuous derivative of a state"),
    ("initial unknowns", 2, without("ModelStructure/InitialUnknowns/Unknown"), "is missing"),
    ("initial unknowns", 3, twice("ModelStructure/InitialUnknown"), "stands there more than once"),
    ("initial unknowns", 2, both(states, without("ModelStructure/InitialUnknowns/Unknown[last()]")),
     "der(x) is missing"),
    ("initial unknowns", 3, both(states, without("ModelStructure/InitialUnknown[last()]")),
     "der(x) is missing"),
    ("initial unknowns", 3, both(MEMORY, lambda root: SubElement(
        root.find("ModelStructure"), "ClockedState", {"valueReference": "902"}),
        at("ModelStructure/InitialUnknown", valueReference="{threads}")), "threads is known at"),
    ("initial unknowns", 2, reversed_initial_unknowns, "not in ascending order"),
    ("dependencies", 2, at("ModelStructure/Outputs/Unknown", dependencies="99999"),
     "depends on 99999, which no variable is"),
    ("dependencies", 3, at("ModelStructure/Output", dependencies="{threads} {threads}"), "twice"),
    ("dependencies", 3, at("ModelStructure/Output", dependencies="{threads}",
                           dependenciesKind="fixed fixed"), "has 2 kinds of 1"),
    ("dependencies", 2, at("ModelStructure/InitialUnknowns/Unknown", dependencies="{threads}",
                           dependenciesKind="fixed"), "other than dependent, constant"),
    ("dependencies", 3, at("ModelStructure/InitialUnknown", dependencies="{status}"),
     "depends on status, which is not known then"),
    ("clocked states", 3, MEMORY, "now is missing"),
    ("abilities", 2, at("CoSimulation", canGetAndSetFMUstate="false"),
     "canSerializeFMUstate without canGetAndSetFMUstate"),
    ("abilities", 3, at("CoSimulation", canGetAndSetFMUState="false"),
     "canSerializeFMUState without canGetAndSetFMUState"),
    ("abilities", 3, at("CoSimulation", canReturnEarlyAfterIntermediateUpdate="true"),
     "without providesIntermediateUpdate"),
    ("abilities", 3, at("CoSimulation", fixedInternalStepSize="0"), "fixedInternalStepSize 0"),
    ("model identifier", 2, at("CoSimulation", modelIdentifier="2 press"), 'has "2 press"'),
    ("experiment", 3, at("DefaultExperiment", startTime="1"), "it goes from 1 to 0.003"),
    ("experiment", 2, at("DefaultExperiment", stepSize="0"), "its step is 0"),
    ("experiment", 2, at("DefaultExperiment", stepSize="1"), "longer than it takes"),
    ("experiment", 3, at("DefaultExperiment", tolerance="-1"), "tolerance is -1"),
    ("date", 2, at(".", generationDateAndTime="yesterday"), "yesterday"),
    ("definitions", 2, twice("UnitDefinitions/Unit"), "is defined twice"),
    ("definitions", 3, twice("TypeDefinitions/EnumerationType/Item"), "stands twice in the enumer"),
    ("definitions", 3, sets("status", name="Length"), '"Length" is a type and a variable'),
    ("definitions", 2, twice("LogCategories/Category"), "the log category"),
]  # fmt: skip


def with_references(root, change):
    """Make a change; ``{name}`` in what it has written is the number of that variable."""
    listed = list(root.find("ModelVariables"))
    numbers = {v.get("name"): (v.get("valueReference"), i) for i, v in enumerate(listed, 1)}
    change(root)
    for element in root.iter():
        for key, value in element.attrib.items():
            if "{" not in value:
                continue
            words = [word.strip("{}") for word in value.split()]
            by_index = element.tag == "Unknown" and root.get("fmiVersion") == "2.0"
            found = [str(numbers[word][1 if by_index else 0]) for word in words]
            element.set(key, " ".join(found))
    return root


def findings(root, folder):
    folder.joinpath("modelDescription.xml").write_bytes(tostring(root))
    description = read_description(folder, folder / "unit.fmu")
    found = findings_of(description, is_python=True)
    return [finding for finding in found if finding.subject == "standard"]


@pytest.mark.parametrize(
    ("name", "fmi", "change", "words"), BROKEN,
    ids=[f"{row[0]}-{number}" for number, row in enumerate(BROKEN)],
)  # fmt: skip
def test_a_rule_that_is_broken_is_found_by_its_name(described, tmp_path, name, fmi, change, words):
    root = with_references(copy.deepcopy(described[fmi]), change)
    (finding,) = findings(root, tmp_path)
    assert finding.text.startswith(f"{name}: ") and words in finding.text
    assert RULES[name].asks in finding.remedy and f"FMI {fmi}.0" in finding.remedy


def test_every_rule_is_broken_once_and_stands_in_the_manual():
    # in test_terminals.py, test_icons.py and test_mesh_fields.py
    of_own_files = {"terminals", "icons", "fields on meshes"}
    assert {row[0] for row in BROKEN} | of_own_files == set(RULES)
    page = read_page("fmu").text
    section = page[page.index("## Rules of the standard") :].partition("\n## ")[0]
    assert set(re.findall(r"`([a-z ]+)`", section)) >= set(RULES)


@pytest.mark.parametrize("fmi", [2, 3])
def test_states_clocks_and_structural_parameters_that_are_right_are_not_told(
    described, tmp_path, fmi
):
    root = copy.deepcopy(described[fmi])
    states(root)
    if fmi == 3:
        MEMORY(root)
        SubElement(root.find("ModelStructure"), "ClockedState", {"valueReference": "902"})
        has("UInt64", "n", **SIZE, start="3")(root)
        for reference, values in (("911", "1 2 3"), ("912", "1")):
            has("Float64", f"a{reference}", valueReference=reference, _dimension="910",
                causality="parameter", start=values)(root)  # fmt: skip
    assert findings(root, tmp_path) == []


def test_many_breaches_of_a_rule_are_one_finding(described, tmp_path):
    root = copy.deepcopy(described[2])
    for element in root.find("ModelVariables"):
        element.attrib.pop("valueReference")
    (finding,) = findings(root, tmp_path)
    count = len(root.find("ModelVariables"))
    assert f"and {count - MOST_TOLD} more" in finding.text


def test_drafts_of_the_standard_are_not_judged(described, tmp_path):
    root = copy.deepcopy(described[3])
    root.set("fmiVersion", "3.0-beta.2")
    root.find("CoSimulation").set("fixedInternalStepSize", "0")
    assert findings(root, tmp_path) == []


def test_the_command_tells_broken_rules_and_that_the_unit_can_run(patch_file, tmp_path):
    """A breach does not keep a unit from running: the exit code stays 0."""
    unit = build_fmu(patch_file, tmp_path / "patch.fmu", fmi=3)
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(unit) as old, zipfile.ZipFile(broken, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b'canGetAndSetFMUState="true" ', b"")
            new.writestr(name, content)
    answer = CliRunner().invoke(app, ["fmu", "doctor", str(broken), "--json"])
    assert answer.exit_code == 0, answer.output
    told = [f for f in json.loads(answer.output)["findings"] if f["subject"] == "standard"]
    assert [finding["text"].partition(":")[0] for finding in told] == ["abilities"]
    assert told[0]["level"] == "warning"
    sound = CliRunner().invoke(app, ["fmu", "doctor", str(unit), "--json"])
    assert "standard" not in {f["subject"] for f in json.loads(sound.output)["findings"]}


def test_a_description_of_rubbish_is_judged_without_failing(described, tmp_path):
    """Attributes that are no numbers and lists that are absent are broken rules, no exceptions."""
    for fmi in (2, 3):
        root = copy.deepcopy(described[fmi])
        for element in root.iter():
            for key in element.attrib:
                if key not in ("fmiVersion", "name", "modelIdentifier"):
                    element.set(key, "~")
        assert len(broken_rules(root)) > 4
        for part in list(root):
            if part.tag != "CoSimulation":
                root.remove(part)
        try:
            findings(root, tmp_path)
        except InputError as error:  # refused with words, which is as good
            assert error.message
