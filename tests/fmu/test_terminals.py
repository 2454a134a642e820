"""Terminals of FMI 3.0 in the units that are built, and the rule that the doctor knows of them."""

from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy
import pytest
from lxml import etree

from lcmchain.coupling.cosimulation.archive import read_member, read_xml, unpack
from lcmchain.coupling.cosimulation.description import TERMINALS_FILE
from lcmchain.coupling.cosimulation.description import read_description as read_unit
from lcmchain.coupling.cosimulation.system_file import read_system
from lcmchain.coupling.cosimulation.terminal_links import with_variables
from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.description import terminals_of
from lcmchain.fmu.doctor.description import findings_of, read_description
from lcmchain.fmu.doctor.rules import RULES, broken_rules
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.fmu.variables import Kind, Variable

COMPRESSION = Path(__file__).resolve().parents[2] / "examples" / "cosimulation" / "compression"
needs_examples = pytest.mark.skipif(
    not COMPRESSION.is_dir(), reason="needs the checkout, not only the tests"
)


@pytest.fixture(scope="module")
def patch(patch_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("terminals")
    return {
        fmi: build_fmu(patch_file, folder / f"patch{fmi}.fmu", fmi=fmi, pore_pressure=True)
        for fmi in (2, 3)
    }


def test_a_unit_of_fmi_3_has_valid_terminals_and_one_of_fmi_2_none(patch):
    content = read_member(patch[3], TERMINALS_FILE)
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.fromstring(content))
    description = read_xml(read_member(patch[3], "modelDescription.xml"), patch[3])
    assert broken_rules(description, fromstring(content)) == []
    with pytest.raises(InputError):
        read_member(patch[2], TERMINALS_FILE)


def test_a_tool_that_moves_has_a_mechanical_port_and_the_sheet_one_of_fields(patch, tmp_path):
    unpack(patch[3], tmp_path / "unit")
    unit = read_unit(tmp_path / "unit", patch[3])
    assert {"punch", "preform", "preform_at_rest"} <= set(unit.terminals)
    members = {m.name: m.variable for m in unit.terminals["punch"].members}
    assert members["velocity"] == "punch.velocity_input" and members["force"] == "punch.force"
    assert members["actual_velocity"] == "punch.velocity"
    fields = {m.name: unit.find(m.variable) for m in unit.terminals["preform"].members}
    assert fields["thickness"].name == "fluid_thickness"
    assert fields["pore_pressure"].causality == "input"
    assert {variable.size for variable in fields.values()} == {fields["thickness"].size} != {1}
    at_rest = {m.name: m.variable for m in unit.terminals["preform_at_rest"].members}
    assert at_rest["pressure_at_rest"] == "pore_pressure" and "pore_pressure" not in at_rest


def test_a_tool_that_is_called_preform_keeps_its_name():
    def variable(name, causality="input", size=None):
        start = 0.0 if causality == "input" else None
        return Variable(name, Kind.REAL, causality, "continuous", name, start=start, size=size)

    found = terminals_of([variable("preform.velocity_input"), variable("thickness", "output", 4),
                          variable("table.moment", "output"), variable("table.velocity_input"),
                          variable("die.force", "output")])  # fmt: skip
    assert [terminal.name for terminal in found] == ["preform", "table", "preform_fields"]
    assert found[1].kind == "_lcmchain_rotation" and found[0].kind == "_lcmchain_translation"
    assert found[1].members["moment"] == "table.moment"
    # of FMI 2 each value is a variable, and a sheet without a thickness has no port
    assert terminals_of([variable("die.force", "output"), variable("thickness", "output")]) == []


@needs_examples
def test_one_line_connects_what_the_example_of_two_units_connects_by_five(tmp_path):
    scene = COMPRESSION / "scene.toml"
    units = {
        "sheet": build_fmu(scene, tmp_path / "sheet.fmu", fmi=3),
        "resin": build_infiltration_fmu(
            None, scene, tmp_path / "resin.fmu", fmi=3, options=InfiltrationUnit(motion="volume")
        ),
    }
    for unit in units.values():
        description = read_xml(read_member(unit, "modelDescription.xml"), unit)
        assert broken_rules(description, fromstring(read_member(unit, TERMINALS_FILE))) == []
    found = {}
    for name, unit in units.items():
        unpack(unit, tmp_path / name)
        found[name] = read_unit(tmp_path / name, unit)
    wanted = read_system(COMPRESSION / "system.toml")
    short = read_system(
        COMPRESSION / "system.toml",
        ['connections=["sheet.preform_at_rest <-> resin.preform"]', "title=One line"],
    )
    links = [entry.link for entry in with_variables(short, found).connections]
    assert sorted(links) == sorted(entry.link for entry in wanted.connections)
    assert len(links) == 5
    # the pressure itself, for a sheet whose fluid does not move within a step
    plain = read_system(
        COMPRESSION / "system.toml", ['connections=["sheet.preform <-> resin.preform"]']
    )
    links = [entry.link for entry in with_variables(plain, found).connections]
    assert "resin.pore_pressure -> sheet.pore_pressure" in links and len(links) == 5


# --- the doctor -----------------------------------------------------------------------------------


def terminal(inner="", name="t", rule="bus"):
    return f'<Terminal name="{name}" matchingRule="{rule}">{inner}</Terminal>'


def member(variable, name="m", kind="signal"):
    about = f' memberName="{name}"' if name else ""
    return f'<TerminalMemberVariable variableName="{variable}"{about} variableKind="{kind}"/>'


STREAM = (
    '<TerminalStreamMemberVariable inStreamMemberName="a" outStreamMemberName="b" '
    'inStreamVariableName="{0}" outStreamVariableName="{1}"/>'
)
INPUT, OUTPUT = "punch.velocity_input", "punch.force"


@pytest.mark.parametrize(
    "content, words",
    [
        (terminal() + terminal(), '"t" stands twice'),
        (terminal(terminal(name="u") * 2), '"t.u" stands twice'),
        (terminal(rule="plugs"), 't has the rule "plugs"'),
        (terminal(member(INPUT, name="")), "without a name, which bus"),
        (terminal(member(INPUT) + member(OUTPUT)), 'the member "m" of t stands twice'),
        (terminal(member("nothing")), 'the variable "nothing", which there is not'),
        (terminal(terminal(member("nothing"), name="u")), "t.u has the variable"),
        (terminal(member("edge_length")), "edge_length, which is local"),
        (terminal(STREAM.format(OUTPUT, OUTPUT)), f"{OUTPUT}, which is output"),
        (terminal(member(INPUT, "x", "inflow") + member(OUTPUT, "y", "outflow")
                  + STREAM.format(INPUT, OUTPUT)), "2 flows beside stream members"),
    ],
)  # fmt: skip
def test_a_terminal_that_breaks_the_rule_is_found(patch, tmp_path, content, words):
    unpack(patch[3], tmp_path / "unit")
    path = tmp_path / "unit" / TERMINALS_FILE
    text = '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{}</Terminals></fmiTerminalsAndIcons>'
    path.write_text(text.format(content))
    (finding,) = standard(tmp_path / "unit")
    assert finding.text.startswith("terminals: ") and words in finding.text
    assert RULES["terminals"].asks in finding.remedy and "2.4.9" in finding.remedy


@pytest.mark.parametrize(
    "text, words",
    [("<other/>", "describes <other>"),
     ('<fmiTerminalsAndIcons fmiVersion="2.0"/>', 'of FMI "2.0"')],
)  # fmt: skip
def test_a_file_of_terminals_that_is_none_is_told(patch, tmp_path, text, words):
    unpack(patch[3], tmp_path / "unit")
    (tmp_path / "unit" / TERMINALS_FILE).write_text(text)
    (finding,) = standard(tmp_path / "unit")
    assert words in finding.text


def test_terminals_that_are_right_are_not_told(patch, tmp_path):
    unpack(patch[3], tmp_path / "unit")
    content = terminal(
        member(INPUT, "x", "inflow") + STREAM.format(INPUT, OUTPUT) + terminal(name="u"),
        rule="plug",
    ) + terminal(member(INPUT, name="") + member(OUTPUT, name=""), "s", "sequence")
    content += terminal(name="own", rule="org.example.rule")
    text = '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{}</Terminals></fmiTerminalsAndIcons>'
    (tmp_path / "unit" / TERMINALS_FILE).write_text(text.format(content))
    assert standard(tmp_path / "unit") == []


def standard(folder):
    description = read_description(folder, folder / "unit.fmu")
    found = findings_of(description, is_python=True)
    return [finding for finding in found if finding.subject == "standard"]
