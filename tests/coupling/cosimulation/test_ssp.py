"""SSP 1.0: systems of other tools are read, own ones written so that schema and reader agree."""

import zipfile

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.ssp_export import write_ssp
from lcmchain.coupling.cosimulation.ssp_import import read_ssp
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError

SPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for short, name in (("ssc", "Common"), ("ssd", "Description"), ("ssv", "ParameterValues"),
                        ("ssm", "ParameterMapping"))
)  # fmt: skip


def structure(system, more=""):
    return (
        f'<ssd:SystemStructureDescription {SPACES} version="1.0" name="Nested">'
        f"{system}{more}"
        '<ssd:DefaultExperiment startTime="0" stopTime="2"/></ssd:SystemStructureDescription>'
    )


def real(name, kind, unit=None):
    about = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real{about}/></ssd:Connector>'


def connection(start, end, more="", **attributes):
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    for side, place in (("start", start), ("end", end)):
        element, _, connector = place.rpartition("/")
        text += f' {side}Element="{element}"' if element else ""
        text += f' {side}Connector="{connector}"'
    return f"<ssd:Connection{text}>{more}</ssd:Connection>"


def values(*parameters, **attributes):
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    rows = "".join(
        f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"'
        + (f' unit="{unit}"' if unit else "")
        + "/></ssv:Parameter>"
        for name, kind, value, unit in parameters
    )
    return (
        f"<ssd:ParameterBinding{text}><ssd:ParameterValues>"
        f'<ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>{rows}</ssv:Parameters>'
        "</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>"
    )


def component(name, source, connectors, bindings=""):
    bound = f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""
    return (
        f'<ssd:Component name="{name}" source="resources/{source}.fmu">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors>{bound}</ssd:Component>"
    )


def pack(units, path, text, *sources, **files):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for source in sources:
            archive.write(units / f"{source}.fmu", f"resources/{source}.fmu")
        for name, content in files.items():
            archive.writestr(name.replace("__", "."), content)
    return path


NESTED = (
    '<ssd:System name="root"><ssd:Connectors>' + real("load", "input", "kN") + "</ssd:Connectors>"
    '<ssd:ParameterBindings><ssd:ParameterBinding source="set.ssv"/>'
    + values(("load", "Real", "0.002", "kN"), ("inner.tail.mass", "Real", "1500", "g"))
    + "</ssd:ParameterBindings><ssd:Elements>"
    + component("head", "Mass_2", real("force", "input", "N") + real("position", "output", "m"),
                values(("mass", "Real", "1", "kg"), ("stiffness", "Real", "3", None)))
    + '<ssd:System name="inner"><ssd:Connectors>' + real("in", "input", "m")
    + real("out", "output", "N") + "</ssd:Connectors><ssd:Elements>"
    + component("tail", "Tail_3", real("position1", "input", "mm") + real("force", "output", "kN"),
                values(("coupling", "Real", "2", "N/m"), ("mass", "Real", "9", "kg")))
    + component("watch", "Follower_2", real("x_in", "input", "N") + real("y", "output"))
    + "</ssd:Elements><ssd:Connections>"
    + connection("in", "tail/position1") + connection("tail/force", "out")
    + "</ssd:Connections></ssd:System></ssd:Elements><ssd:Connections>"
    + connection("head/position", "inner/in") + connection("inner/out", "head/force")
    + connection("load", "inner.watch/x_in").replace("inner.watch", "inner")
    .replace('endConnector="x_in"', 'endConnector="unknown"')
    + "</ssd:Connections></ssd:System>"
)  # fmt: skip
SET = f"""<ssv:ParameterSet {SPACES} version="1.0" name="s"><ssv:Parameters>
<ssv:Parameter name="head.mass"><ssv:Real value="2" unit="kg"/></ssv:Parameter>
<ssv:Parameter name="head.position0"><ssv:Real value="10" unit="cm"/></ssv:Parameter>
<ssv:Parameter name="nobody.knows"><ssv:Real value="10"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet>"""


def test_a_nested_system_with_parameter_sets_is_flattened(units, tmp_path):
    path = pack(units, tmp_path / "n.ssp", structure(NESTED), "Mass_2", "Tail_3", "Follower_2",
                set__ssv=SET)  # fmt: skip
    system = read_ssp(path, tmp_path / "in", ["window=20 ms", "scheme.type=iqn-ils"])
    assert system.title == "Nested" and system.stop_time == 2.0
    assert [unit.name for unit in system.units] == ["head", "inner_tail", "inner_watch"]
    assert [entry.link for entry in system.connections] == [
        "head.position -> inner_tail.position1", "inner_tail.force -> head.force",
    ]  # fmt: skip
    starts = {unit.name: unit.start for unit in system.units}
    # outer values take precedence; one without a unit is in that of the variable
    assert starts["head"] == {"mass": "2.0 kg", "stiffness": {"value": 3.0}, "position0": "10.0 cm"}
    assert starts["inner_tail"] == {"coupling": "2.0 N/m", "mass": "1500.0 g"}
    assert any("nobody.knows" in remark for remark in system.remarks)
    direct = system_from(
        {
            "stop_time": "2 s", "window": "20 ms", "scheme": {"type": "iqn-ils"},
            "units": [
                {"name": "head", "fmu": "Mass_2.fmu",
                 "start": {"mass": "2 kg", "stiffness": "3 N/m", "position0": "10 cm"}},
                {"name": "tail", "fmu": "Tail_3.fmu",
                 "start": {"mass": "1.5 kg", "coupling": "2 N/m"}},
            ],
            "connections": ["head.position -> tail.position1", "tail.force -> head.force"],
        }, None, directory=units,
    )  # fmt: skip
    ours, theirs = (
        run_system(one, tmp_path / name) for one, name in ((system, "a"), (direct, "b"))
    )
    for ssp, toml in (("head.position", "head.position"), ("inner_tail.force", "tail.force")):
        assert ours["final_values"][ssp] == theirs["final_values"][toml] != 0.0


def single(more="", attributes="", source="resources/Mass_2.fmu", other=""):
    return structure(
        '<ssd:System name="r"><ssd:Elements>'
        f'<ssd:Component name="a" source="{source}" {attributes}/>'
        '<ssd:Component name="b" source="resources/Tail_3.fmu"/>'
        f"{other}</ssd:Elements><ssd:Connections>{more}</ssd:Connections></ssd:System>"
    )


def test_transformations_act_after_the_unit_conversion_or_in_its_place(units, tmp_path):
    shift = '<ssc:LinearTransformation factor="2" offset="5"/>'
    for suppress, expected in (("false", 2005.0), ("true", 7.0)):
        link = connection("a/position", "b/position1", shift, suppressUnitConversion=suppress)
        path = pack(units, tmp_path / "t.ssp", single(link), "Mass_2", "Tail_3")
        folder = tmp_path / suppress
        system = read_ssp(path, folder)
        from lcmchain.coupling.cosimulation.assembly import assemble

        with assemble(system, tmp_path / f"x{suppress}", lambda text: None) as assembly:
            found = assembly.parts["b"].get_fields(["position1"])["position1"]
            assert found == expected


@pytest.mark.parametrize(
    "text, reason",
    [
        (single(source="../a.fmu"), "does not lie in the archive"),
        (single(source="http://localhost/a.fmu"), "does not lie in the archive"),
        (single(source="file:///etc/passwd"), "does not lie in the archive"),
        (single(source="resources/none.fmu"), "holds no resources/none.fmu"),
        (single(attributes='type="application/x-ssp-package"'), "only FMUs are read"),
        (single(other='<ssd:SignalDictionaryReference name="s" dictionary="d"/>'), "is not read"),
        (single(connection("a/position", "b/position1") * 2), "two connections lead to"),
        (single(connection("a/position", "b/position1", "<ssc:BooleanMappingTransformation/>")),
         "BooleanMappingTransformation is not read"),
        (single(connection("a/nothing", "b/position1")), 'no variable "nothing"'),
        ("<!DOCTYPE a>" + single(), "document type declaration"),
        ("<a/>", "no system structure of SSP 1.0"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_told(units, tmp_path, text, reason):
    path = pack(units, tmp_path / "t.ssp", text, "Mass_2", "Tail_3")
    with pytest.raises(InputError, match=reason) as caught:
        system = read_ssp(path, tmp_path / "in")
        run_system(system, tmp_path / "out")
    assert "t.ssp" in str(caught.value) or "nothing" in str(caught.value)


TABLES = {
    "title": "All of it", "start_time": "500 ms", "stop_time": "2 s", "unit_tolerance": 1e-7,
    "window": {"size": "50 ms", "smallest": "5 ms"},
    "scheme": {"type": "aitken", "relative": 1e-7},
    "recorder": {"every": 2},
    "connections": [
        "one.position -> two.position1",
        {"link": "two.force -> one.force", "factor": 0.5, "absolute": 1e-9},
        {"link": "left.y -> right.x_in", "of_window": "mean"},
        {"link": "right.y -> left.x_in", "convert_units": False},
        "count.word -> count.word_in",
    ],
    "units": [
        {"name": "one", "fmu": "Mass_2.fmu", "start": {"mass": "2 kg", "position0": "1 cm"}},
        {"name": "two", "fmu": "Tail_3.fmu", "substeps": 2},
        {"name": "left", "fmu": "Field_2.fmu", "start": {"x_in": "2 kPa", "b": -0.1}},
        {"name": "right", "fmu": "Field_3.fmu", "start": {"a": -0.5}},
        {"name": "count", "fmu": "Counter_2.fmu",
         "start": {"greeting": "a <b> & 'c'", "first": -3, "on_in": True}},
        {"name": "again", "fmu": "Mass_2.fmu", "quantities": {"x": "m"}},
    ],
}  # fmt: skip


def test_a_system_that_is_written_and_read_gives_the_same_bits(units, tmp_path):
    system = system_from(TABLES, None, directory=units)
    target = tmp_path / "all.ssp"
    write_ssp(system, target)
    described = read_ssd(str(target))  # validates against the schema of the standard
    assert [element.name for element in described.system.elements] == [
        "one", "two", "left", "right", "count", "again",
    ]  # fmt: skip
    with zipfile.ZipFile(target) as archive:
        assert sum(name.startswith("resources/Mass") for name in archive.namelist()) == 1
    again = read_ssp(target, tmp_path / "in")
    assert [entry.link for entry in again.connections] == [e.link for e in system.connections]
    assert again.window == system.window and again.scheme == system.scheme
    ours, theirs = run_system(system, tmp_path / "a"), run_system(again, tmp_path / "b")
    assert ours["final_values"] == theirs["final_values"]
    assert ours["iteration_count"] == theirs["iteration_count"]
    for name in ("one.position", "left.sum"):
        assert np.isfinite(ours["final_values"][name]) and ours["final_values"][name] != 0.0
