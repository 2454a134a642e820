"""What the master reads of a unit: fields, dependencies, abilities; and what it refuses."""

import zipfile

import numpy as np
import pytest
from models import N

from lcmchain.coupling.cosimulation.archive import unpack
from lcmchain.coupling.cosimulation.description import read_description
from lcmchain.coupling.cosimulation.start_values import start_values, with_declared_units
from lcmchain.errors import InputError


def described(path, tmp_path):
    return read_description(unpack(path, tmp_path / f"of_{path.stem}"), path)


def test_structured_names_of_fmi_2_are_the_field_of_fmi_3(units, tmp_path):
    two = described(units / "Field_2.fmu", tmp_path)
    three = described(units / "Field_3.fmu", tmp_path)
    for description in (two, three):
        field = description.find("y")
        assert (field.size, field.is_field, field.unit.name) == (N, True, "Pa")
        assert list(description.variables) == ["x_in", "a", "b", "c", "y", "sum"]
    assert np.array_equal(np.diff(two.find("y").references), np.ones(N - 1))
    assert three.find("y").references.size == 1
    assert two.find("y[7]").references[0] == two.find("y").references[6]
    with pytest.raises(InputError, match='no variable "yy"; did you mean "y"'):
        three.find("yy")


def test_dependencies_are_read_by_field(units, tmp_path):
    for version in (2, 3):
        tail = described(units / f"Tail_{version}.fmu", tmp_path)
        assert tail.depends_initially["force"] == {"position1"}
        assert tail.depends_initially["position"] == frozenset()


def model_description(variables, **root):
    about = {"fmiVersion": "2.0", "modelName": "m", "guid": "g", **root}
    attributes = " ".join(f'{key}="{value}"' for key, value in about.items())
    return (
        f'<fmiModelDescription {attributes}><CoSimulation modelIdentifier="m"/>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


def scalar(name, number, kind="Real", causality="local", extra=""):
    return (
        f'<ScalarVariable name="{name}" valueReference="{number}" causality="{causality}">'
        f"<{kind} {extra}/></ScalarVariable>"
    )


def read_text(text, tmp_path):
    file = tmp_path / "m.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", text)
    return described(file, tmp_path)


def test_values_are_put_together_by_index_whatever_their_order(tmp_path):
    rows = "".join(scalar(f"f[{i},{j}]", 10 * i + j) for j in (2, 1, 3) for i in (2, 1))
    found = read_text(model_description(rows), tmp_path).find("f")
    assert found.references.tolist() == [11, 12, 13, 21, 22, 23]


@pytest.mark.parametrize(
    "rows",
    [
        scalar("f[1]", 0) + scalar("f[3]", 1),  # one is missing
        scalar("f[1]", 0)
        + scalar("f[2]", 1, "Integer", extra="", causality="local").replace(
            'causality="local"', 'causality="local" variability="discrete"'
        ),
        scalar("f[2]", 0) + scalar("f[3]", 1),  # begins at 2
        scalar("f", 5) + scalar("f[1]", 0) + scalar("f[2]", 1),  # the name is taken
    ],
)
def test_what_is_no_whole_field_stays_scalar(rows, tmp_path):
    description = read_text(model_description(rows), tmp_path)
    assert not any(variable.is_field for variable in description.variables.values())


@pytest.mark.parametrize(
    "text, reason",
    [
        (model_description("", fmiVersion="1.0"), 'is of FMI "1.0"'),
        (model_description("").replace("CoSimulation", "ModelExchange"), "no co-simulation"),
        (model_description("").replace('r="m"', 'r="../../m"'), "no name of a library"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]>" + model_description(""), "document type declaration"),
        (model_description("")[:-5], "not well-formed"),
    ],
)
def test_other_descriptions_are_refused(text, reason, tmp_path):
    with pytest.raises(InputError, match=reason) as caught:
        read_text(text, tmp_path)
    assert "m.fmu" in str(caught.value)


def test_an_archive_without_description_is_no_unit(tmp_path):
    file = tmp_path / "a.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a", "b")
    with pytest.raises(InputError, match="no functional mock-up unit"):
        described(file, tmp_path)


TORQUE = 'kg="1" m="2" s="-2"'
DEFINED = f"""<UnitDefinitions>
<Unit name="Nm"><BaseUnit {TORQUE}/><DisplayUnit name="inlb" factor="8"/></Unit>
<Unit name="Ohm"><BaseUnit kg="1" m="2" s="-3" A="-2"/></Unit>
<Unit name="gee"><BaseUnit m="1" s="-2" factor="10"/><DisplayUnit name="per" inverse="true"/></Unit>
</UnitDefinitions>"""


def test_start_values_follow_the_units_that_the_unit_defines(tmp_path):
    rows = "".join(
        scalar(name, number, "Real", "input", extra)
        for number, (name, extra) in enumerate(
            (("torque", 'unit="Nm" start="0"'), ("R", 'unit="Ohm" start="0"'),
             ("pull", 'unit="gee" start="0"'), ("bare", 'start="0"'))
        )
    )  # fmt: skip
    text = model_description(rows).replace("<ModelVariables>", DEFINED + "<ModelVariables>")
    description = read_text(text, tmp_path)
    given = {"torque": "5 Nm", "R": "2 Ohm", "pull": "3 gee"}
    found = {v.name: values[0] for v, values in start_values("m", description, given)}
    assert found == {"torque": 5.0, "R": 2.0, "pull": 3.0}
    given = {"torque": "16 inlb", "R": "2 kOhm", "pull": "3 m/s2"}
    found = {v.name: values[0] for v, values in start_values("m", description, given)}
    assert found == {"torque": 2.0, "R": 2000.0, "pull": pytest.approx(0.3)}
    with pytest.raises(InputError, match='unknown unit "per"'):
        start_values("m", description, {"pull": "3 per"})
    with pytest.raises(InputError, match='for example "2.0 Ohm"'):
        start_values("m", description, {"R": 2.0})
    with_declared_units("m", description, {"bare": "gee"}, {})
    ((_, values),) = start_values("m", description, {"bare": "20 m/s2"})
    assert values[0] == 2.0


def test_a_name_that_stands_twice_is_told_and_not_found(tmp_path):
    twice = read_text(model_description(scalar("x", 0) + scalar("x", 1)), tmp_path)
    assert any("are not unique (x)" in remark for remark in twice.remarks)
    assert sum("not unique" in remark for remark in twice.remarks) == 1
    with pytest.raises(InputError, match='more than one variable "x"'):
        twice.find("x")


def test_clocks_and_binary_variables_are_told(tmp_path):
    clocks = (
        '<Clock name="tick" valueReference="1" causality="input" intervalVariability="triggered"/>'
        '<Float64 name="x" valueReference="2" causality="output" clocks="1"/>'
        '<Binary name="blob" valueReference="3" causality="output"/>'
    )
    text = model_description(clocks, fmiVersion="3.0").replace("guid", "instantiationToken")
    remarks = read_text(text, tmp_path).remarks
    assert any("its clocks (tick) do not tick" in r and "still (x)" in r for r in remarks)
    assert any("binary variables (blob) are left out" in r for r in remarks)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_types_are_told_by_their_names_in_the_standard(version, tmp_path):
    kinds = ["Float32", "Int32", "UInt32", "Int64", "Boolean"]
    variables = "".join(f'<{k} name="{k}" valueReference="{n}"/>' for n, k in enumerate(kinds))
    if version == "2.0":
        kinds = ["Real", "Integer", "Boolean", "String"]
        variables = "".join(scalar(kind, n, kind) for n, kind in enumerate(kinds))
    text = model_description(variables, fmiVersion=version)
    if version == "3.0":
        text = text.replace("guid", "instantiationToken")
    description = read_text(text, tmp_path)
    assert [description.variables[kind].type_name for kind in kinds] == kinds


@pytest.mark.parametrize("version", ["3.0-beta.2", "2.0-RC1", "3.0-alpha"])
def test_drafts_of_the_standard_are_refused(version, tmp_path):
    with pytest.raises(InputError, match=f'is of FMI "{version}", a draft'):
        read_text(model_description("", fmiVersion=version), tmp_path)
