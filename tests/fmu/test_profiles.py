"""Which of FMI's profiles have what a unit needs of its importer."""

import zipfile

import pytest

from lcmchain.fmu.doctor import examine
from lcmchain.fmu.doctor.profiles import NEEDED, PROFILES, profiles_for

ALL = list(PROFILES)
X = 'name="x" valueReference="1" '
SIZE = (
    '<UInt64 name="n" valueReference="9" causality="structuralParameter" variability="fixed" '
    'start="2"/>'
)


def array(name, reference, causality, dimension):
    return (f'<Float64 name="{name}" valueReference="{reference}" causality="{causality}">'
            f"<Dimension {dimension}/></Float64>")  # fmt: skip


def written(path, variables="", *, version="3.0", abilities="", kinds="", structure="", files=()):
    """Write a unit of these variables; ``kinds`` are interface types besides co-simulation."""
    description = (
        f'<fmiModelDescription fmiVersion="{version}" modelName="m" instantiationToken="1" '
        f'guid="1"><CoSimulation modelIdentifier="m" {abilities}/>{kinds}'
        f"<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        for name in files:
            archive.writestr(name, "")
    return path


@pytest.mark.parametrize(
    ("variables", "options", "features", "profiles"),
    [
        (f'<Float64 {X} causality="output"/>', {}, set(), ALL),
        (f'<Float64 {X} causality="parameter" variability="tunable"/>', {},
         {"tunable parameters"}, ALL),
        (f'<String {X} causality="output"/>', {}, {"texts as inputs or outputs"},
         ["Dynamics", "Dynamics Controller"]),
        (f'<String {X} causality="parameter"/>', {}, set(), ALL),
        (f'<ScalarVariable {X} causality="input"><String start=""/></ScalarVariable>',
         {"version": "2.0"}, {"texts as inputs or outputs"}, ["Dynamics", "Dynamics Controller"]),
        (f'<Binary {X} causality="input"/>', {}, {"binary inputs or outputs"},
         ["Sensor", "Basic HiL & Sensor HiL", "SIL ECU", "Dynamics", "Dynamics Controller"]),
        (f'<Binary {X} causality="parameter"/>', {}, {"binary parameters"},
         ["Sensor", "Basic HiL & Sensor HiL", "SIL ECU"]),
        (f'<Int32 {X} causality="output"/>', {}, set(), ALL),
        (f'<UInt8 {X} causality="output"/>', {}, {"integers of other sizes than 32 bits"},
         [name for name in ALL if name not in ("Basic CS", "Sensor")]),
        (array("a", 1, "output", 'start="3"'), {}, {"arrays of fixed size as inputs or outputs"},
         [name for name in ALL if name != "Sensor"]),
        (SIZE + array("a", 1, "output", 'valueReference="9"'), {},
         {"arrays of settable size as inputs or outputs"},
         ["Basic CS", "SIL ECU", "Dynamics", "Dynamics Controller"]),
        (SIZE + array("a", 1, "output", 'valueReference="9"')
         + array("b", 2, "input", 'valueReference="9"'), {},
         {"arrays of settable size as inputs or outputs",
          "arrays of inputs or outputs that share a settable size"},
         ["Dynamics", "Dynamics Controller"]),
        (SIZE + array("a", 1, "parameter", 'valueReference="9"'), {},
         {"arrays of settable size as parameters"},
         ["Basic CS", "SIL ECU", "Dynamics", "Dynamics Controller", "Optimization"]),
        ("", {"abilities": 'mightReturnEarlyFromDoStep="true"'}, {"early return from a step"},
         ["Dynamics", "Dynamics Controller"]),
        ("", {"abilities": 'mightReturnEarlyFromDoStep="false" maxOutputDerivativeOrder="0"'},
         set(), ALL),
        (f'<Clock {X} causality="input" intervalVariability="triggered"/>', {},
         {"clocks in co-simulation"}, ["SIL ECU", "Dynamics", "Dynamics Controller"]),
        (f'<Clock {X} causality="input" intervalVariability="triggered"/>',
         {"kinds": '<ModelExchange modelIdentifier="m"/>'},
         {"clocks in co-simulation", "model exchange with clocks"}, ["Dynamics Controller"]),
        (f'<Binary {X} causality="parameter"/><String name="s" valueReference="2" '
         'causality="input"/>', {}, {"binary parameters", "texts as inputs or outputs"}, []),
    ],
)  # fmt: skip
def test_what_a_unit_needs_decides_which_profiles_have_it(
    tmp_path, variables, options, features, profiles
):
    found = examine(written(tmp_path / "m.fmu", variables, **options))
    assert set(found.facts["features"]) == features
    assert found.facts["profiles"] == profiles
    (told,) = [finding.text for finding in found.findings if finding.subject == "profiles"] or [""]
    needed = [feature for feature in features if feature in NEEDED]
    assert all(word in told for word in (*needed, *(profiles if needed else [])))


def test_what_a_unit_offers_asks_nothing_of_importers(tmp_path):
    """Abilities, dependencies, code and binaries; each told, and each by its own mark."""
    abilities = (
        'canGetAndSetFMUState="true" canSerializeFMUState="1" maxOutputDerivativeOrder="2" '
        'canHandleVariableCommunicationStepSize="true" providesDirectionalDerivatives="true" '
        'providesAdjointDerivatives="true" providesIntermediateUpdate="true"'
    )
    path = written(
        tmp_path / "m.fmu", f'<Float64 {X} causality="output"/>', abilities=abilities,
        kinds='<ScheduledExecution modelIdentifier="m"/>',
        structure='<Output valueReference="1" dependencies=""/>',
        files=["sources/m.c", "binaries/x86_64-linux/m.so", "binaries/armv7-linux/m.so"],
    )  # fmt: skip
    found = examine(path)
    assert found.facts["features"] == [
        "saved states", "states that can be stored", "steps of any size",
        "dependencies of states and outputs", "derivatives of outputs", "directional derivatives",
        "adjoint derivatives", "values within a step", "scheduled execution", "source code",
        "binaries for desktop computers", "binaries for other platforms",
    ]  # fmt: skip
    assert found.facts["profiles"] == ALL


def test_what_own_units_need(unit, unit3):
    """As the manual says of them: texts, and in FMI 3.0 arrays."""
    for path, more in ((unit, []), (unit3, ["arrays of fixed size as inputs or outputs"])):
        facts = examine(path).facts
        needed = [feature for feature in facts["features"] if feature in NEEDED]
        assert needed == ["texts as inputs or outputs", *more]
        assert {"saved states", "states that can be stored", "steps of any size"} < set(
            facts["features"]
        )
        assert facts["profiles"] == ["Dynamics", "Dynamics Controller"]


def test_every_profile_has_what_its_table_marks():
    """Counts of the draft's table of required features."""
    assert {name: len(required) for name, required in PROFILES.items()} == {
        "Basic CS": 6, "Sensor": 5, "Basic HiL & Sensor HiL": 10, "SIL ECU": 15, "Dynamics": 19,
        "Dynamics Controller": 20, "Optimization": 14,
    }  # fmt: skip
    assert profiles_for(()) == tuple(ALL)
