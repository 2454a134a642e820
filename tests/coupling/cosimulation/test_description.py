"""What the master reads of a unit: fields, dependencies, abilities; and what it refuses."""

import zipfile

import numpy as np
import pytest
from models import N

from lcmchain.coupling.cosimulation.archive import unpack
from lcmchain.coupling.cosimulation.description import read_description
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
