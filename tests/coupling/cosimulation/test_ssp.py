"""SSP 1.0: systems of other tools are read, own ones written so that schema and reader agree."""

import re
import shutil
import zipfile

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd

from lcmchain.commands.cosim import _read
from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.ssp.reading import read_ssp
from lcmchain.coupling.cosimulation.ssp.writing import write_ssp
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


LINEAR = {"more": '<ssc:LinearTransformation factor="2"/>'}
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


def test_a_connector_of_another_type_than_its_variable_is_told(units, tmp_path):
    wrong = real("position", "output", "m").replace("Real", "Integer")
    body = component("a", "Mass_2", wrong + real("force", "input"))
    text = structure(f'<ssd:System name="r"><ssd:Elements>{body}</ssd:Elements></ssd:System>')
    path = pack(units, tmp_path / "t.ssp", text, "Mass_2")
    remarks = [one for one in read_ssp(path, tmp_path / "in").remarks if "connector" in one]
    assert remarks == [
        "the connector a.position is Integer, but the variable of its unit is Real, which is "
        "taken; correct the connector"
    ]


def mapped(value, kind="Real", step='factor="2"', source="given"):
    """A component with one value that is mapped to its mass with a linear transformation."""
    entry = (
        f'<ssm:MappingEntry source="{source}" target="mass"><ssc:LinearTransformation {step}/>'
        "</ssm:MappingEntry>"
    )
    bound = values(("given", kind, value, None)).replace(
        "</ssd:ParameterBinding>",
        f'<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{entry}</ssm:ParameterMapping>'
        "</ssd:ParameterMapping></ssd:ParameterBinding>",
    )
    body = component("a", "Mass_2", "", bound)
    return structure(f'<ssd:System name="root"><ssd:Elements>{body}</ssd:Elements></ssd:System>')


def kept(text):
    """A system with settings of this program that somebody has changed by hand."""
    return single().replace(
        "</ssd:SystemStructureDescription>",
        '<ssd:Annotations><ssc:Annotation type="lcmchain.cosimulation">'
        f"<settings>{text}</settings></ssc:Annotation></ssd:Annotations>"
        "</ssd:SystemStructureDescription>",
    )


LINK = connection("a/position", "b/position1", '<ssc:LinearTransformation factor="two"/>')


@pytest.mark.parametrize(
    "text, reason",
    [
        (single(LINK), 'factor of a LinearTransformation is "two"'),
        (single().replace('stopTime="2"', 'stopTime="soon"'), 'the stopTime .* is "soon"'),
        (single().replace('startTime="0"', 'startTime="-inf"'), 'the startTime .* is "-inf"'),
        (single(connection("c/position", "b/position1")), 'lacks the element "c"'),
        (single(connection("a/position", "c/position1")), 'lacks the element "c"'),
        (single('<ssd:Connection startElement="a" startConnector="x"/>'), "lacks one of its conn"),
        (single(other=component("a", "Mass_2", "")), 'two elements have the name "a"'),
        (single().replace("<ssd:Connections>", '<ssd:ParameterBindings><ssd:ParameterBinding '
                          'source="set.ssv"/></ssd:ParameterBindings><ssd:Connections>', 1),
         "set.ssv is no ParameterSet"),
        (mapped("heavy"), 'value of "given" is "heavy"'),
        (mapped("true", "Boolean"), "its value is a Boolean"),
        (mapped("3", step='offset="x"'), 'offset of a LinearTransformation is "x"'),
        (kept('{"units": 5}'), "annotation lcmchain.cosimulation is damaged"),
        (kept('{"connections": {"a": 7}}'), "annotation lcmchain.cosimulation is damaged"),
        (kept("[]"), "annotation lcmchain.cosimulation is damaged"),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_told_with_its_name_and_archive(units, tmp_path, text, reason):
    path = pack(units, tmp_path / "t.ssp", text, "Mass_2", "Tail_3", set__ssv="<a/>")
    with pytest.raises(InputError, match=reason) as caught:
        read_ssp(path, tmp_path / "in")
    assert "t.ssp" in str(caught.value)


def test_a_mapping_keeps_whole_numbers_and_tells_what_it_does_not_find(units, tmp_path):
    path = pack(units, tmp_path / "t.ssp", mapped("3", "Integer"), "Mass_2")
    assert read_ssp(path, tmp_path / "in").units[0].start == {"mass": 6}
    path = pack(units, tmp_path / "u.ssp", mapped("3", source="other"), "Mass_2")
    assert any('the parameter set has no "other"' in one for one in
               read_ssp(path, tmp_path / "un")._remarks)  # fmt: skip


def of_two(connections, a, b, own="", bindings=""):
    """A system with connectors of its own around a mass and its tail."""
    return structure(
        f'<ssd:System name="r"><ssd:Connectors>{own}</ssd:Connectors><ssd:ParameterBindings>'
        f"{bindings}</ssd:ParameterBindings><ssd:Elements>{component('a', 'Mass_2', a)}"
        f"{component('b', 'Tail_3', b)}</ssd:Elements><ssd:Connections>{connections}"
        "</ssd:Connections></ssd:System>"
    )


def read_of(units, folder, text):
    """Read a system; return it with its remarks but the one on the window."""
    path = pack(units, folder / "t.ssp", text, "Mass_2", "Tail_3")
    shutil.rmtree(folder / "in", ignore_errors=True)
    system = read_ssp(path, folder / "in")
    return system, [one for one in system.remarks if "communication step" not in one]


@pytest.mark.parametrize(
    "unit, step, expected",
    [
        ("km", "", 6001.0),  # 3 km are 3000 m, twice that and 1 m more
        (None, "", 7.0),
        ("km", 'suppressUnitConversion="true"', 7.0),
        ("m", "", 7.0),
    ],
)
def test_a_mapping_changes_a_value_in_the_unit_of_its_target(units, tmp_path, unit, step, expected):
    text = mapped("3", step='factor="2" offset="1"').replace('target="mass"', 'target="position0"')
    text = text.replace("<ssm:MappingEntry", f"<ssm:MappingEntry {step}")
    text = text.replace('value="3"', f'value="3" unit="{unit}"' if unit else 'value="3"')
    system, _ = read_of(units, tmp_path, text)
    assert system.units[0].start == {"position0": {"value": expected}}


def test_a_mapping_of_two_parameters_to_one_is_an_error(units, tmp_path):
    entry = '<ssm:MappingEntry source="given" target="mass"/></ssm:ParameterMapping>'
    with pytest.raises(InputError, match='more than one parameter to "mass"'):
        read_of(units, tmp_path, mapped("3").replace("</ssm:ParameterMapping>", entry))


POSITION, INPUT = real("position", "output", "m"), real("position1", "input", "mm")


@pytest.mark.parametrize("a, b", [(POSITION, INPUT), ("", "")])
def test_a_connection_may_start_at_the_end_that_takes_the_value(units, tmp_path, a, b):
    """The standard leaves open which end is the start; the kinds of both say where it goes."""
    found = []
    for ends in (("a/position", "b/position1"), ("b/position1", "a/position")):
        text = of_two(connection(*ends, LINEAR["more"]), a, b)
        system, remarks = read_of(units, tmp_path, text)
        found.append(system.connections)
        assert remarks == []
    assert found[0] == found[1]
    assert found[0][0].link == "a.position -> b.position1" and found[0][0].factor == 2.0


@pytest.mark.parametrize("turned", [False, True])
def test_a_value_of_a_system_is_in_the_unit_of_its_connector(units, tmp_path, turned):
    ends = ("a/force", "load") if turned else ("load", "a/force")
    text = of_two(
        connection(*ends), real("force", "input", "N"), "", real("load", "input", "kN"),
        values(("load", "Real", "0.002", None)),
    )  # fmt: skip
    system, remarks = read_of(units, tmp_path, text)
    assert system.units[0].start == {"force": {"value": 2.0}} and remarks == []


@pytest.mark.parametrize(
    "text, words",
    [
        (of_two("", real("position", "input", "m"), ""),
         ["a.position is of the kind input, but the variable of its unit is output"]),
        (of_two("", real("position", "output", "mm"), ""),
         ["a.position is in mm, but the variable of its unit is in m, which is taken"]),
        (of_two(connection("a/position", "out"), POSITION, "", real("out", "output", "K")),
         ["a.position to out does not fit: m \\(m\\) cannot be converted into K"]),
        (of_two(connection("a/position", "out"), POSITION, "",
                '<ssd:Connector name="out" kind="output"><ssc:Boolean/></ssd:Connector>'),
         ["a.position to out does not fit: Real is no Boolean"]),
        (of_two(connection("load", "b/position1"), "", INPUT, real("load", "output", "m")),
         ["between load and b.position1 joins two connectors that take values"]),
        (of_two(connection("a/position", "out"), POSITION, "", real("out", "output", "mm")), []),
        (of_two("", real("position", "output", "meter"), real("position1", "unspecified")), []),
    ],
)  # fmt: skip
def test_connectors_that_do_not_fit_are_told(units, tmp_path, text, words):
    _, remarks = read_of(units, tmp_path, text)
    assert len(remarks) == len(words), remarks
    for remark, expected in zip(remarks, words):
        assert re.search(expected, remark), remark


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


def unit_text(name, **base):
    numbers = " ".join(f'{key}="{value}"' for key, value in base.items())
    return f'<ssc:Unit name="{name}"><ssc:BaseUnit {numbers}/></ssc:Unit>'


OWN_UNITS = f"""<ssv:ParameterSet {SPACES} version="1.0" name="s"><ssv:Parameters>
<ssv:Parameter name="a.mass"><ssv:Real value="2" unit="slug"/></ssv:Parameter>
<ssv:Parameter name="a.stiffness"><ssv:Real value="2" unit="stiff"/></ssv:Parameter>
<ssv:Parameter name="a.position0"><ssv:Real value="3" unit="m"/></ssv:Parameter>
</ssv:Parameters><ssv:Units>{unit_text("stiff", kg=1, s=-2, factor=5)}
{unit_text("slug", kg=1, factor=10)}{unit_text("m", m=1)}</ssv:Units></ssv:ParameterSet>"""


def test_values_follow_the_units_of_their_parameter_set_and_of_the_structure(units, tmp_path):
    """A unit of an own name, and one that usually means something else (slug: 14.6 kg)."""
    binding = '<ssd:ParameterBinding source="set.ssv"/>'
    text = structure(
        '<ssd:System name="root"><ssd:ParameterBindings>' + binding + "</ssd:ParameterBindings>"
        "<ssd:Elements>" + component("a", "Mass_2", real("force", "input", "N"))
        + component("b", "Follower_2", real("y", "output", "stiff"),
                    values(("shift", "Real", "4", "stiff")))
        + "</ssd:Elements></ssd:System>",
        f"<ssd:Units>{unit_text('stiff', kg=1, factor=7)}</ssd:Units>",
    )  # fmt: skip
    path = pack(units, tmp_path / "u.ssp", text, "Mass_2", "Follower_2", set__ssv=OWN_UNITS)
    system = read_ssp(path, tmp_path / "in")
    starts = {unit.name: unit.start for unit in system.units}
    assert starts["a"] == {"mass": "20.0 kg^1", "stiffness": "10.0 kg^1*s^-2", "position0": "3.0 m"}
    assert starts["b"] == {"shift": "28.0 kg^1"}
    assert system.units[1].quantities == {"y": "stiff"}
    from lcmchain.coupling.cosimulation.assembly import assemble

    system.units[1].start.clear()  # the follower's shift has no unit
    with assemble(system, tmp_path / "x", lambda text: None) as assembly:
        parts = assembly.parts
        assert parts["a"].get_fields(["mass", "stiffness"]) == {"mass": 20.0, "stiffness": 10.0}
        assert parts["b"].description.find("y").unit.factor == 7.0


def annotated(*rows):
    text = "".join(f'<ssc:Annotation type="{tool}"><{row}/></ssc:Annotation>' for tool, row in rows)
    return single().replace(
        "</ssd:System>", f"<ssd:Annotations>{text}</ssd:Annotations></ssd:System>"
    )


@pytest.mark.parametrize(
    "rows, overrides, size, words",
    [
        ([("org.tool", 'FixedStepMaster stepSize="0.005"')], [], 0.005, None),
        ([("com.osp", 'FixedStepAlgorithm baseStepSize="0.02"')], [], 0.02, None),
        ([("a", 'M stepSize="0.02"'), ("b", 'N baseStepSize="0.01"')], [], 0.01,
         r"0\.02 s \(stepSize of M, a\), 0\.01 s \(baseStepSize of N, b\); the smallest"),
        ([("a", 'M stepSize="often"')], [], 0.004, "does not say how long .* 0.004 s is taken"),
        ([("a", 'M other="1"')], ["window=50 ms"], 0.05, None),
    ],
)  # fmt: skip
def test_the_step_size_of_an_annotation_is_taken(units, tmp_path, rows, overrides, size, words):
    path = pack(units, tmp_path / "s.ssp", annotated(*rows), "Mass_2", "Tail_3")
    system = read_ssp(path, tmp_path / "in", overrides)
    assert system.window.size == size
    remarks = [text for text in system.remarks if "communication step" in text]
    assert len(remarks) == (words is not None)
    if words is not None:
        assert re.search(words, remarks[0])


def test_a_description_that_stands_alone_is_read_beside_its_units(units, tmp_path):
    text = annotated(("a", 'M stepSize="0.5"'))
    (tmp_path / "resources").mkdir()
    for name in ("Mass_2", "Tail_3"):
        shutil.copy(units / f"{name}.fmu", tmp_path / "resources")
    for name in ("bare.ssd", "other.xml"):  # told by its content
        (tmp_path / name).write_text(text)
        with _read(tmp_path / name, ()) as system:
            assert [unit.fmu for unit in system.units] == [
                "resources/Mass_2.fmu", "resources/Tail_3.fmu",
            ]  # fmt: skip
            assert run_system(system, tmp_path / "out")["state"] == "complete"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "bare.ssd", "other.xml", "out", "resources",
    ]  # fmt: skip
    packed = pack(units, tmp_path / "archive.zip", text, "Mass_2", "Tail_3")
    with _read(packed, ()) as system:
        assert system.window.size == 0.5
    (tmp_path / "bare.ssd").write_text(text.replace("resources/Mass_2", "none"))
    with pytest.raises(InputError, match=r"bare\.ssd: the archive holds no none\.fmu"):
        with _read(tmp_path / "bare.ssd", ()):
            pass


@pytest.mark.parametrize(
    "unit, outer, inner, words",
    [
        ("K", LINEAR, {}, None),
        ("degF", LINEAR, {}, 'at nest.t in "degF", but nest.sensor.temperature is in "K"'),
        ("degC", {"suppressUnitConversion": "true"}, {}, 'at nest.t in "degC", but nest.sensor'),
        ("degC", {}, {"suppressUnitConversion": "true"}, None),
        ("K", {}, {"suppressUnitConversion": "true"}, 'at nest.t in "K", but kettle.temperature'),
    ],
)
def test_a_transformation_in_a_unit_between_those_of_the_ends_is_refused(
    units, tmp_path, unit, outer, inner, words
):
    """It would be done in the unit of the component: 20 degC twice are 136 degF, and not 586 K."""
    nest = (
        f'<ssd:System name="nest"><ssd:Connectors>{real("t", "input", unit)}</ssd:Connectors>'
        "<ssd:Elements>" + component("sensor", "Sensor_3", real("temperature", "input", "K"))
        + "</ssd:Elements><ssd:Connections>" + connection("t", "sensor/temperature", **inner)
        + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    text = (
        '<ssd:System name="root"><ssd:Elements>'
        + component("kettle", "Kettle_2", real("temperature", "output", "degC")) + nest
        + "</ssd:Elements><ssd:Connections>" + connection("kettle/temperature", "nest/t", **outer)
        + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    path = pack(units, tmp_path / "t.ssp", structure(text), "Kettle_2", "Sensor_3")
    if words is None:
        (link,) = read_ssp(path, tmp_path / "in", ["window=1 s"]).connections
        assert link.factor == (2.0 if outer else 1.0) and link.convert_units == (not inner)
    else:
        with pytest.raises(InputError, match=re.escape(words)):
            read_ssp(path, tmp_path / "in", ["window=1 s"])
