"""Terminals of FMI 3.0: one line connects what belongs together."""

import re
import shutil
import zipfile

import pytest

from lcmchain.coupling.cosimulation.description import TERMINALS_FILE
from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.ssp.reading import read_ssp
from lcmchain.coupling.cosimulation.ssp.writing import write_ssp
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError

MASS = {"way": "position", "force": "force"}
TAIL = {"way": "position1", "force": "force"}
LINKS = ["one.position -> two.position1", "two.force -> one.force"]


def terminal(members, name="port", rule="plug", inner="", kind="signal"):
    rows = "".join(
        f'<TerminalMemberVariable variableName="{variable}" memberName="{member}" '
        f'variableKind="{kind}"/>'
        for member, variable in members.items()
    )
    return f'<Terminal name="{name}" matchingRule="{rule}">{rows}{inner}</Terminal>'


STREAM = (
    '<TerminalStreamMemberVariable inStreamMemberName="a" outStreamMemberName="b" '
    'inStreamVariableName="force" outStreamVariableName="position"/>'
)


@pytest.fixture
def ported(units, tmp_path):
    """Return a folder with Mass.fmu and Tail.fmu that have these terminals."""

    def make(of_mass, of_tail):
        for name, content in (("Mass", of_mass), ("Tail", of_tail)):
            path = shutil.copy(units / f"{name}_3.fmu", tmp_path / f"{name}.fmu")
            text = content if content is None or content.startswith("<?") else (
                '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>'
                f"{content}</Terminals></fmiTerminalsAndIcons>"
            )  # fmt: skip
            with zipfile.ZipFile(path, "a") as archive:
                if text is not None:
                    archive.writestr(TERMINALS_FILE, text)
        return tmp_path

    return make


def tables(connections=("one.port <-> two.port",), **options):
    return {
        "stop_time": "1 s", "window": "50 ms", "connections": list(connections),
        "units": [{"name": "one", "fmu": "Mass.fmu"}, {"name": "two", "fmu": "Tail.fmu"}],
        "scheme": {"type": "iqn-ils", **options},
    }  # fmt: skip


@pytest.mark.parametrize(
    "of_mass, of_tail",
    [
        (terminal(MASS), terminal(TAIL)),
        (terminal(MASS, rule="bus"), terminal({**TAIL, "place": "position"}, rule="bus")),
        (terminal(MASS, rule="plug"), terminal({"place": "position", **TAIL}, rule="bus")),
        (terminal(MASS, rule="sequence"), terminal(TAIL, rule="sequence")),
        (terminal({"way": "position"}, inner=terminal({"force": "force"}, "inner")),
         terminal({"way": "position1"}, inner=terminal({"force": "force"}, "inner"))),
    ],
    ids=["plug", "bus", "plug and bus", "sequence", "nested"],
)  # fmt: skip
def test_a_line_of_terminals_gives_the_bits_of_its_connections(ported, tmp_path, of_mass, of_tail):
    folder = ported(of_mass, of_tail)
    ours = run_system(system_from(tables(), None, directory=folder), tmp_path / "a")
    theirs = run_system(system_from(tables(LINKS), None, directory=folder), tmp_path / "b")
    assert sorted(ours["connections"]) == sorted(theirs["connections"]) == sorted(LINKS)
    # the order of connections orders sums in the acceleration
    same = run_system(
        system_from(tables(ours["connections"]), None, directory=folder), tmp_path / "c"
    )
    assert ours["final_values"] == same["final_values"]
    assert ours["final_values"]["one.position"] == pytest.approx(
        theirs["final_values"]["one.position"], rel=1e-5
    )


def test_either_end_may_stand_first_and_entries_hold_for_all(ported, assembled_in):
    folder = ported(terminal(MASS), terminal(TAIL))
    link = {"link": "two.port <-> one.port", "relative": 1e-3, "within": "held"}
    assembly = assembled_in(folder, tables([link]))
    assert sorted(link.name for link in assembly.links) == sorted(LINKS)
    for made in assembly.links:
        assert (made.entry.relative, made.entry.within) == (1e-3, "held")


def test_a_nested_terminal_can_be_named(ported, assembled_in):
    folder = ported(
        terminal({}, rule="bus", inner=terminal(MASS, "inner")), terminal(TAIL, "flange")
    )
    assembly = assembled_in(folder, tables(["one.port.inner <-> two.flange"]))
    assert sorted(link.name for link in assembly.links) == sorted(LINKS)


@pytest.mark.parametrize(
    "of_mass, of_tail, words",
    [
        (terminal(MASS), None, 'unit "two" has no terminal "port"; it has none; connect'),
        (terminal(MASS), terminal(TAIL, "other"), 'has no terminal "port"; it has other'),
        (terminal({**MASS, "rate": "velocity"}), terminal(TAIL, rule="bus"),
         r"all members of one\.port \(plug\) .* but rate would not be"),
        (terminal(MASS), terminal({"way": "position1", "force": "position"}, rule="bus"),
         "m .* cannot be converted into N"),
        (terminal({"a": "position"}, rule="bus"), terminal({"b": "position1"}, rule="bus"),
         r"no member in common .*one\.port has a, two\.port has b"),
        (terminal({"a": "position"}, rule="bus"), terminal({"a": "position"}, rule="bus"),
         "no member in common"),
        (terminal(MASS, rule="sequence"), terminal({"a": "position1"}, rule="sequence"),
         r"2 members \(sequence\), port 1"),
        (terminal(MASS, rule="sequence"), terminal(TAIL), "both have to be one"),
        (terminal(MASS, rule="none"), terminal(TAIL), 'by the rule "none", which is not known'),
        (terminal(MASS, kind="inflow"), terminal(TAIL), "is no signal but a flow"),
        (terminal({**MASS, "x": "nothing"}), terminal({**TAIL, "x": "force"}), '"nothing"'),
        (terminal(MASS, inner=STREAM), terminal(TAIL), "its stream members would not be"),
    ],
)  # fmt: skip
def test_terminals_that_do_not_fit_are_told(ported, assembled_in, of_mass, of_tail, words):
    folder = ported(of_mass, of_tail)
    with pytest.raises(InputError) as caught:
        assembled_in(folder, tables())
    assert re.search(words, caught.value.message), caught.value.message
    assert "one." in str(caught.value) or "nothing" in words


@pytest.mark.parametrize("text", ["<?xml version='1.0'?><a>", "<?xml version='1.0'?><other/>"])
def test_damaged_terminals_are_a_warning(ported, assembled_in, text):
    folder = ported(text, None)
    assembly = assembled_in(folder, tables(LINKS))
    (remark,) = assembly.remarks
    assert 'unit "one": its terminals are left out' in remark


def test_factors_are_for_variables(ported):
    with pytest.raises(InputError, match="factor and offset are for a connection of two variables"):
        system_from(tables([{"link": "one.port <-> two.port", "factor": 2.0}]), None)


def test_an_archive_holds_the_connections_of_the_variables(ported, tmp_path):
    folder = ported(terminal(MASS), terminal(TAIL))
    system = system_from(tables(), None, directory=folder)
    write_ssp(system, tmp_path / "t.ssp")
    again = read_ssp(tmp_path / "t.ssp", tmp_path / "in")
    assert sorted(entry.link for entry in again.connections) == sorted(LINKS)
    ours = run_system(system, tmp_path / "a")["final_values"]
    assert run_system(again, tmp_path / "b")["final_values"] == ours
