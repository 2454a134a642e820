"""Structural parameters of FMI 3.0 that are set: arrays of foreign units get other sizes."""

import zipfile
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from test_ssp import component, connection, pack, values
from test_ssp2 import array, array_value, structure

from lcmchain.coupling.cosimulation import assembly as assembly_module
from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.ssp.reading import read_ssp
from lcmchain.coupling.cosimulation.ssp.structure import SSC, SSD, SSV
from lcmchain.coupling.cosimulation.ssp.writing import write_ssp
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import InputError, SimulationError

STEP, WINDOWS = 0.25, 4


def system_of(rng, count_u, count_x, count_y):
    """Return sizes and matrices of a linear system, and its start."""
    sizes = {"count_u": count_u, "count_x": count_x, "count_y": count_y}
    shapes = {"A": (count_x, count_x), "B": (count_x, count_u), "C": (count_y, count_x),
              "D": (count_y, count_u), "x0": (count_x,)}  # fmt: skip
    return sizes, {name: rng.uniform(-1.0, 1.0, shape) for name, shape in shapes.items()}


def start_of(sizes, arrays):
    return {**sizes, **{name: array.ravel().tolist() for name, array in arrays.items()}}


ONE, TWO = (
    system_of(np.random.default_rng(seed), *sizes)
    for seed, sizes in ((1, (1, 2, 4)), (2, (4, 3, 2)))
)
INPUT = [0.7]
TABLES = {
    "title": "Spaces", "stop_time": f"{WINDOWS * STEP} s", "window": f"{STEP} s",
    "scheme": {"type": "jacobi"}, "connections": ["one.y -> two.u_in"],
    "units": [
        {"name": "one", "fmu": "Space_3.fmu", "start": {**start_of(*ONE), "u_in": INPUT}},
        {"name": "two", "fmu": "Space_3.fmu", "start": start_of(*TWO)},
    ],
}  # fmt: skip


def own_loop():
    """Advance both systems by Euler's method; the second one sees what the first one had before."""
    (_, one), (_, two) = ONE, TWO
    x1, x2 = one["x0"], two["x0"]
    for _ in range(WINDOWS):
        u2 = one["C"] @ x1 + one["D"] @ INPUT
        x1, x2 = (
            x1 + STEP * (one["A"] @ x1 + one["B"] @ INPUT),
            x2 + STEP * (two["A"] @ x2 + two["B"] @ u2),
        )
    return x1, x2, one["C"] @ x1 + one["D"] @ INPUT


def solved(assembly):
    assembly.coupled.advance_to(WINDOWS * STEP)
    found = assembly.coupled.get_fields(["one.x", "two.x", "one.y"])
    for name, expected in zip(("one.x", "two.x", "one.y"), own_loop(), strict=True):
        assert found[name].shape == expected.shape
        assert np.abs(found[name] - expected).max() < 1e-12 and np.abs(expected).max() > 0.1
    return found


def with_start(unit=0, **start):
    """Return the tables with other start values of a unit; None takes one away."""
    units = [dict(entry) for entry in TABLES["units"]]
    kept = {**units[unit]["start"], **start}
    units[unit]["start"] = {key: value for key, value in kept.items() if value is not None}
    return {**TABLES, "units": units}


def test_arrays_of_other_sizes_give_the_numbers_of_an_own_loop(assembled):
    """One unit twice, as systems of 1 to 4 and of 4 to 2 values; the file says 3 for all of it."""
    assembly = assembled(TABLES)
    assert not [text for text in assembly.remarks if "start values" in text]
    sizes = {name: part.description.variables["A"].size for name, part in assembly.parts.items()}
    assert sizes == {"one": 4, "two": 9}
    solved(assembly)


def test_units_in_processes_of_their_own_are_configured_too(assembled, monkeypatch):
    monkeypatch.setattr(assembly_module, "OWN_TOOL", "lcmchain ")
    assembly = assembled(TABLES)
    assert all(part.apart for part in assembly.parts.values())
    solved(assembly)


def test_a_size_as_exported_is_not_set(assembled, monkeypatch):
    """A unit without a configuration mode takes it, and its start values stay."""
    from lcmchain.coupling.cosimulation.library_instance import Fmi3Instance

    asked = []
    monkeypatch.setattr(Fmi3Instance, "configure", lambda self, settings: asked.append(settings))
    start = {"count_x": 3, "count_u": 3}
    alone = {"connections": [], "units": [{"name": "a", "fmu": "Space_3.fmu", "start": start}]}
    part = assembled({**TABLES, **alone}).parts["a"]
    assert asked == [] and np.array_equal(part.get_fields(["A"])["A"], np.ones(9))


def test_arrays_without_values_after_their_sizes_have_changed_are_told(assembled):
    """A connected input has values; one that is not, and matrices, need start values."""
    (told,) = [
        text
        for text in assembled(with_start(0, A=None, u_in=None)).remarks
        if "start values" in text
    ]
    assert told.startswith('unit "one": the start values of A, u_in are gone')


@pytest.mark.parametrize(
    ("tables", "key", "reason"),
    [
        (with_start(count_x=6), "one.start.count_x", "takes from 0 to 5, not 6"),
        (with_start(count_x=0), "one.start.count_x", '"A" one of 0 x 0 entries'),
        (with_start(count_x=-1), "one.start.count_x", "beyond the range of UInt64"),
        (with_start(count_x=2.0), "one.start.count_x", "must be a whole number"),
        (with_start(count_x=[2, 2]), "one.start.count_x", "has 2 values, but the variable has 1"),
        (with_start(count_x=3), "one.start.A",
         r"has 4 values, but the variable has 9 \(its size is given by count_x, count_x\)"),
        (with_start(1, count_u=3, B=0.5, D=0.5), None,
         r"one\.y has 4 values, two\.u_in takes 3"),
    ],
)  # fmt: skip
def test_what_a_structural_parameter_does_not_take_is_named(assembled, tables, key, reason):
    with pytest.raises(InputError, match=reason) as error:
        assembled(tables)
    assert key is None or error.value.key == f"units.{key}"


def test_a_unit_that_refuses_a_size_is_named_with_it_and_its_words(assembled):
    """The limits of its description allow 5; its library has room for 4."""
    tables = with_start(count_x=5, A=0.0, B=0.0, C=0.0, x0=0.0)
    with pytest.raises(SimulationError) as error:
        assembled(tables)
    for words in ('unit "one" does not take', "count_x = 5", "there is no room for that size"):
        assert words in str(error.value)


def test_other_parameters_cannot_be_set_as_sizes(assembled):
    """Units of FMI 2.0, and arrays of fixed size, are as they were."""
    units = [{"name": "a", "fmu": "Field_3.fmu", "start": {"x_in": ["1 Pa", "2 Pa"]}}]
    with pytest.raises(InputError, match="has 40; give that many"):
        assembled({**TABLES, "connections": [], "units": units})


# --- SSP 2.0 --------------------------------------------------------------------------------------


def bound(sizes, arrays, **more):
    sets = values(*((name, "UInt64", size, None) for name, size in sizes.items()))
    for name, numbers in {**arrays, **more}.items():
        sets += array_value(name, [repr(float(x)) for x in np.ravel(numbers)])
    return sets


def content(first=ONE):
    """Return a structure whose connectors have the sizes that other connectors hold."""
    own = "".join(
        f'<ssd:Connector name="{name}" kind="structuralParameter"><ssc:UInt64/></ssd:Connector>'
        for name in ONE[0]
    )
    return structure(
        component("one", "Space_3", own + array("y", "output", "count_y"),
                  bound(*first, u_in=INPUT))
        + component("two", "Space_3", own + array("u_in", "input", 4), bound(*TWO)),
        connection("one/y", "two/u_in"),
    )  # fmt: skip


def test_ssp_2_sets_them_and_keeps_them_when_written(units, tmp_path):
    """Read from a parameter set, run, written, and read again: the same numbers."""
    path = pack(units, tmp_path / "s.ssp", content(), "Space_3")
    options = [f"window={STEP} s", f"stop_time={WINDOWS * STEP} s", "scheme.type=jacobi"]
    system = read_ssp(path, tmp_path / "in", options)
    assert [system.units[k].start["count_x"] for k in (0, 1)] == [2, 3]
    with assembly_module.assemble(system, tmp_path / "unpacked", print) as assembly:
        found = solved(assembly)
    write_ssp(system, tmp_path / "again.ssp", "2.0")
    with zipfile.ZipFile(tmp_path / "again.ssp") as archive:
        root = fromstring(archive.read("SystemStructure.ssd"))
    kinds = {c.get("name"): c.get("kind") for c in root.iter(f"{SSD}Connector")}
    assert kinds["count_x"] == "structuralParameter"
    sizes = [d.get("size") for d in root.find(f".//{SSD}Component").iter(f"{SSC}Dimension")]
    assert "4" in sizes
    parameters = {p.get("name"): p[0] for p in root.iter(f"{SSV}Parameter")}
    assert parameters["count_u"].tag == f"{SSV}UInt64"
    again = read_ssp(tmp_path / "again.ssp", tmp_path / "in2")
    assert again.units[0].start["count_x"] == 2  # 3, with which the unit is exported, is left out
    assert "count_x" not in again.units[1].start
    with assembly_module.assemble(again, tmp_path / "unpacked2", print) as assembly:
        assert all(np.array_equal(found[k], v) for k, v in solved(assembly).items())


def test_ssp_1_has_no_place_for_them(units, tmp_path):
    system = system_from(TABLES, None, directory=units)
    with pytest.raises(InputError, match="structural parameter.*--ssp-version 2.0") as error:
        write_ssp(system, tmp_path / "s.ssp", "1.0")
    assert error.value.key == "units.one.start.count_u"


def test_a_connector_of_another_size_than_the_parameters_give_is_refused(units, tmp_path):
    sizes, arrays = TWO
    other = content().replace('<ssc:Dimension size="4"/></ssd:Connector>',
                              '<ssc:Dimension size="3"/></ssd:Connector>')  # fmt: skip
    path = pack(units, tmp_path / "s.ssp", other, "Space_3")
    with pytest.raises(InputError, match=r"two\.u_in is an array of 3, .* 4 values; give count_u"):
        read_ssp(path, tmp_path / "in")


def test_checkpoints_of_other_sizes_are_told_apart(units, tmp_path):
    """The size belongs to what a resumed run has to agree with."""
    first = system_from(TABLES, None, directory=units)
    other = system_from(with_start(1, x0=0.0), None, directory=units)
    assert first.digest() != other.digest()
    found = run_system(first, tmp_path / "out")
    assert found["state"] == "complete"
