"""SSP 2.0: arrays, types of FMI 3 and structural parameters, read and written."""

import shutil
import zipfile
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from models import N
from test_ssp import SPACES, component, connection, pack, values
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.commands.cosim import _file_of, _read
from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.ssp.reading import read_ssp
from lcmchain.coupling.cosimulation.ssp.structure import SSC, SSD, SSV
from lcmchain.coupling.cosimulation.ssp.writing import write_ssp
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError


def structure(elements, connections="", more="", version="2.0"):
    text = (
        f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="Arrays">'
        f'<ssd:System name="root"><ssd:Elements>{elements}</ssd:Elements>'
        f"<ssd:Connections>{connections}</ssd:Connections></ssd:System>{more}"
        '<ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>'
    )
    for empty in ("Connectors", "Connections"):  # which the schema does not allow
        text = text.replace(f"<ssd:{empty}></ssd:{empty}>", "")
    return text


def array(name, kind, *sizes, type_="Float64", unit=None):
    """A connector of an array; a size is a number, or the name of a connector."""
    about = f' unit="{unit}"' if unit else ""
    rows = "".join(
        f'<ssc:Dimension size="{size}"/>' if isinstance(size, int) else
        f'<ssc:Dimension sizeConnector="{size}"/>' if size else "<ssc:Dimension/>"
        for size in sizes
    )  # fmt: skip
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}{about}/>{rows}</ssd:Connector>'


def array_value(name, numbers, unit=None, size=None, kind="Float64"):
    about = f' unit="{unit}"' if unit else ""
    text = " ".join(map(str, numbers))
    return (
        f'<ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0" name="p">'
        f'<ssv:Parameters><ssv:Parameter name="{name}"><ssv:{kind} value="{text}"{about}/>'
        f'<ssc:Dimension size="{size or len(numbers)}"/></ssv:Parameter></ssv:Parameters>'
        "</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>"
    )


FIRST = [0.5 * k - 3.0 for k in range(N)]  # [kPa]
CLOSED = structure(
    component("one", "Field_3", array("x_in", "input", N, unit="Pa") + array("y", "output", N),
              array_value("x_in", FIRST, "kPa")
              + values(("a", "Float64", "0.9", None), ("b", "Float32", "0.25", None)))
    + component("two", "Field_2", "", values(("a", "Real", "-0.5", None))),
    connection("one/y", "two/x_in") + connection("two/y", "one/x_in"),
)  # fmt: skip


def own_loop(first, steps, a=(0.9, -0.5), b=(0.25, 0.25), c=(1.0, 1.0)):
    """Advance both rows by the windows of an explicit, parallel scheme."""
    x, y = [np.array(first), np.zeros(N)], [np.zeros(N), np.zeros(N)]
    place = np.arange(1.0, N + 1)
    for step in range(steps):
        if step:
            x = [y[1], y[0]]
        y = [a[i] * x[i] + b[i] * np.concatenate([[0.0], x[i][:-1]]) + c[i] * place for i in (0, 1)]
    return y


def test_arrays_and_their_units_give_the_numbers_of_an_own_loop(units, tmp_path):
    """Whole arrays of FMI 3, connected to the values of a field of FMI 2; starts in another unit.

    The first window is the one that sees the start values.
    """
    path = pack(units, tmp_path / "a.ssp", CLOSED, "Field_3", "Field_2")
    system = read_ssp(path, tmp_path / "in", ["window=1 s", "scheme.type=jacobi"])
    assert [entry.link for entry in system.connections] == [
        "one.y -> two.x_in",
        "two.y -> one.x_in",
    ]
    assert system.units[0].start["x_in"][:2] == ["-3.0 kPa", "-2.5 kPa"]
    open_ended = system.model_copy(update={"connections": system.connections[:1]})
    found = run_system(open_ended, tmp_path / "out")["final_values"]
    expected = own_loop([1e3 * value for value in FIRST], 1)[0].sum()
    assert found["one.sum"] == pytest.approx(expected, rel=1e-12) and abs(expected) > 1e4


def test_a_system_of_ssp_2_iterates_as_an_own_loop(units, tmp_path):
    path = pack(units, tmp_path / "a.ssp", CLOSED, "Field_3", "Field_2")
    system = read_ssp(path, tmp_path / "in", ["window=250 ms", "scheme.type=jacobi"])
    found = run_system(system, tmp_path / "out")["final_values"]
    # an input that is connected has the output it is fed by, from the first window on
    expected = own_loop(np.zeros(N), 4)
    for name, row in zip(("one", "two"), expected):
        assert found[f"{name}.sum"] == pytest.approx(row.sum(), rel=1e-12) and row.sum() != 0.0


TABLES = {
    "title": "Arrays", "stop_time": "1 s", "window": "250 ms", "scheme": {"type": "jacobi"},
    "connections": ["one.y -> two.x_in", "count.word -> count.word_in"],
    "units": [
        {"name": "one", "fmu": "Field_3.fmu",
         "start": {"x_in": [f"{0.1 * k!r} Pa" for k in range(N)], "a": 0.1}},
        {"name": "two", "fmu": "Field_3.fmu", "start": {"x_in": "2 kPa"}},
        {"name": "count", "fmu": "Counter_3.fmu",
         "start": {"greeting": "a <b> & 'c'", "first": -3, "on_in": True}},
    ],
}  # fmt: skip


def written(units, tmp_path, tables=TABLES, version="2.0"):
    system = system_from(tables, None, directory=units)
    target = tmp_path / "written.ssp"
    write_ssp(system, target, version)
    with zipfile.ZipFile(target) as archive:
        return system, target, fromstring(archive.read("SystemStructure.ssd"))


def test_a_system_written_as_ssp_2_and_read_gives_the_same_bits(units, tmp_path):
    system, target, root = written(units, tmp_path)
    assert root.get("version") == "2.0"
    assert {e.get("version") for e in root.iter(f"{SSV}ParameterSet")} == {"2.0"}
    connectors = {
        (component.get("name"), connector.get("name")): connector
        for component in root.iter(f"{SSD}Component")
        for connector in component.iter(f"{SSD}Connector")
    }
    y = connectors["one", "y"]
    assert [child.tag for child in y] == [f"{SSC}Float64", f"{SSC}Dimension"]
    assert y.find(f"{SSC}Dimension").get("size") == str(N)
    assert connectors["count", "first"][0].tag == f"{SSC}Int32"
    again = read_ssp(target, tmp_path / "in")
    assert again.units[0].start["x_in"] == system.units[0].start["x_in"]
    assert [entry.link for entry in again.connections] == [e.link for e in system.connections]
    ours, theirs = run_system(system, tmp_path / "a"), run_system(again, tmp_path / "b")
    assert ours["final_values"] == theirs["final_values"] and ours["final_values"]["one.sum"] != 0.0


def test_ssp_1_refuses_the_array_for_which_it_has_no_place(units, tmp_path):
    """One value for all entries is no array; FMI 2 has a connector for each value."""
    with pytest.raises(InputError, match="40 start values that differ.*--ssp-version 2.0") as error:
        written(units, tmp_path, version="1.0")
    assert error.value.key == "units.one.start.x_in"
    alike = {**TABLES, "units": [*TABLES["units"][1:], TABLES["units"][1] | {"name": "one"}]}
    _, _, root = written(units, tmp_path, alike, "1.0")
    assert root.get("version") == "1.0" and not list(root.iter(f"{SSC}Dimension"))
    of_fmi2 = TABLES["units"][0] | {"fmu": "Field_2.fmu"}
    _, target, _ = written(
        units, tmp_path, {**TABLES, "units": [of_fmi2, *TABLES["units"][1:]]}, "1.0"
    )
    again = read_ssp(target, tmp_path / "in")
    assert again.units[0].start["x_in[3]"] == "0.2 Pa"


def test_the_command_writes_the_version_that_is_asked_for(units, tmp_path):
    file = units / "one_mass.toml"
    file.write_text(
        'stop_time = "1 s"\nwindow = "1 s"\nconnections = []\n[[units]]\nname = "a"\n'
        'fmu = "Mass_3.fmu"\nstart = { mass = "2 kg" }\n'
    )
    for version, options in (("1.0", []), ("2.0", ["--ssp-version", "2.0"])):
        target = tmp_path / f"{version}.ssp"
        answer = CliRunner().invoke(app, ["cosim", str(file), "--export", str(target), *options])
        assert answer.exit_code == 0, answer.output
        with zipfile.ZipFile(target) as archive:
            assert fromstring(archive.read("SystemStructure.ssd")).get("version") == version
    answer = CliRunner().invoke(
        app, ["cosim", str(file), "--export", str(target), "--ssp-version", "3"]
    )
    assert isinstance(answer.exception, InputError) and "1.0 or 2.0" in str(answer.exception)


ENUMERATION = (
    '<ssd:Enumerations><ssc:Enumeration name="Way"><ssc:Item name="up" value="7"/>'
    '<ssc:Item name="down" value="-2"/></ssc:Enumeration></ssd:Enumerations>'
)


def enumerated(text, name="Way"):
    return (
        '<ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0" name="p">'
        f'<ssv:Parameters><ssv:Parameter name="first"><ssv:Enumeration value="{text}" '
        f'name="{name}"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>'
        "</ssd:ParameterBinding>"
    )


def test_items_of_enumerations_are_read_by_name(units, tmp_path):
    for text, expected in (("down", -2), ("4", 4)):
        content = structure(component("a", "Counter_3", "", enumerated(text)), more=ENUMERATION)
        path = pack(units, tmp_path / "e.ssp", content, "Counter_3")
        assert read_ssp(path, tmp_path / text).units[0].start == {"first": expected}


def test_texts_of_an_array_stand_one_by_one(units, tmp_path):
    inner = '<ssv:Value value="a b"/>'
    bound = values(("greeting", "String", "x", None)).replace(
        '<ssv:String value="x"/>', f"<ssv:String>{inner}</ssv:String>"
    )
    path = pack(units, tmp_path / "t.ssp", structure(component("a", "Counter_3", "", bound)),
                "Counter_3")  # fmt: skip
    assert read_ssp(path, tmp_path / "in").units[0].start == {"greeting": "a b"}


def with_structural_parameter(units, folder):
    """Write Field_3 again with a structural parameter that holds the size of its input."""
    target = folder / "Sized_3.fmu"
    with zipfile.ZipFile(units / "Field_3.fmu") as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                row = (
                    f'<UInt64 name="n" valueReference="7777" causality="structuralParameter" '
                    f'variability="fixed" start="{N}"/>'
                )
                text = text.replace("<ModelVariables>", f"<ModelVariables>{row}")
                content = text.replace(
                    f'<Dimension start="{N}"/>', '<Dimension valueReference="7777"/>', 1
                ).encode()
            new.writestr(name, content)
    return folder


def test_structural_parameters_as_exported_leave_the_unit_as_it_is(units, tmp_path):
    with_structural_parameter(units, tmp_path)
    connectors = array("x_in", "input", "n") + array("y", "output", None)
    content = structure(component("a", "Sized_3", connectors, values(("n", "UInt64", N, None))))
    path = pack(tmp_path, tmp_path / "s.ssp", content, "Sized_3")
    assert read_ssp(path, tmp_path / "in").units[0].start == {"n": N}


@pytest.mark.parametrize(
    "text, reason",
    [
        (structure("", version="3.0"), 'is of SSP "3.0"; 1.0, 1.1, 2.0 are read'),
        (structure(component("a", "Field_3", array("x_in", "input", 4, 5))),
         r"connector a\.x_in is an array of 4 x 5, but the variable of its unit has 40 values"),
        (structure(component("a", "Field_3", array("x_in", "input", "none"))),
         r'dimension by "none" \(sizeConnector\) has no size'),
        (structure(component("a", "Field_3", array("x_in", "input", 40).replace(
            "size=", 'sizeConnector="n" size='))), "both a size and a sizeConnector"),
        (structure(component("a", "Field_3", "", array_value("x_in", [1.0, 2.0], size=40))),
         '"x_in" has 2 values, its dimensions are for 40'),
        (structure(component("a", "Field_3", "", array_value("x_in", ["1", "x"]))),
         r'the value of a\.x_in, "x", is no Real'),
        (structure(component("a", "Counter_3", "", enumerated("left")), more=ENUMERATION),
         '"left", is no Enumeration; the archive defines up, down'),
        (structure(component("a", "Field_3", ""), connection("a/y", "a/x_in", startIndices="1")),
         "single entries of an array"),
        (structure(component("a", "Field_3", "", values(sourceBase="component"))),
         r"within its unit \(sourceBase\)"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(units, tmp_path, text, reason):
    path = pack(units, tmp_path / "t.ssp", text, "Field_3", "Counter_3")
    with pytest.raises(InputError, match=reason) as error:
        read_ssp(path, tmp_path / "in")
    assert "t.ssp" in str(error.value)


def test_start_values_of_another_size_than_the_array_are_refused(units, tmp_path):
    text = structure(component("a", "Field_3", "", array_value("x_in", [1.0, 2.0], "Pa")))
    path = pack(units, tmp_path / "t.ssp", text, "Field_3")
    with pytest.raises(InputError, match=r"units\.a\.start\.x_in: has 2 values, .* has 40"):
        run_system(read_ssp(path, tmp_path / "in"), tmp_path / "out")


def test_binary_values_and_clocks_are_left_out_by_name(units, tmp_path):
    connectors = array("blob", "output", type_="Binary") + array("tick", "output", type_="Clock")
    text = structure(
        component("a", "Mass_3", connectors, values(("blob", "Binary", "00ff", None)))
        + component("b", "Tail_3", array("blob", "input", type_="Binary"))
        .replace("<ssd:Component ", '<ssd:Component implementation="ModelExchange" '),
        connection("a/blob", "b/blob") + connection("a/tick", "b/tick")
        + connection("a/position", "b/position1"),
    )  # fmt: skip
    path = pack(units, tmp_path / "b.ssp", text, "Mass_3", "Tail_3")
    system = read_ssp(path, tmp_path / "in")
    assert [entry.link for entry in system.connections] == ["a.position -> b.position1"]
    told = "\n".join(system.remarks)
    assert "from a.blob to b.blob carries binary values" in told
    assert "from a.tick to b.tick carries the ticks of a clock" in told
    assert "the binary value of a.blob is left out" in told
    assert 'component "b" is meant as ModelExchange' in told


def test_a_folder_is_the_system_that_it_holds(units, tmp_path, monkeypatch):
    folder = tmp_path / "press"
    (folder / "resources").mkdir(parents=True)
    shutil.copy(units / "Mass_3.fmu", folder / "resources")
    with pytest.raises(InputError, match=r"holds no SystemStructure\.ssd"):
        _file_of(folder)
    for name in ("one.ssd", "SystemStructure.ssd"):
        (folder / name).write_text(structure(component("a", "Mass_3", "")))
        with _read(_file_of(folder), ()) as system:
            assert [unit.name for unit in system.units] == ["a"]
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(app, ["cosim", "press", "--set", "window=1 s", "-q"])
    assert answer.exit_code == 0, answer.output
    assert (tmp_path / "results" / "press" / "cosimulation.nc").is_file()
    (folder / "SystemStructure.ssd").rename(folder / "two.ssd")
    with pytest.raises(InputError, match=r"holds 2 systems \(one\.ssd, two\.ssd\)"):
        _file_of(folder)
