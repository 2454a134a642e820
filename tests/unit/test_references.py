"""Tuples that compiled code takes by reference, and functions with machine code of their own."""

from __future__ import annotations

import pickle
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit, typeof

from lcmchain.compilation.references import Reference, ReferenceType, referred
from lcmchain.compilation.standalone import PREFIX, StandaloneDispatcher
from lcmchain.effects.interaction import scratch_size
from lcmchain.packs import PACK
from lcmchain.solver import loop
from lcmchain.solver.interactions.contact_forces import KEPT_PACKS
from lcmchain.tools.table import build_tool_table


class Inner(NamedTuple):
    """A tuple within another one."""

    flag: bool
    rate: float
    rows: np.ndarray


class Fields(NamedTuple):
    """Every kind of field that tuples of the solver have."""

    values: np.ndarray
    absent: Any
    count: int
    inner: Inner
    bits: np.ndarray
    several: tuple[float, float, float]
    strided: np.ndarray
    last: float
    other: Any


def fields():
    table = np.arange(24.0).reshape(4, 6)
    return Fields(
        np.array([1.0, 2.0]), None, -7, Inner(True, 0.5, table), np.array([3, 250], np.uint8),
        (1.5, 2.5, 3.5), table[::2, 1::2], 9.0, Reference(Inner(False, 0.25, table[:2])),
    )  # fmt: skip


@njit
def all_of(t):
    there = 1.0 if t.inner.flag else 0.0
    sums = t.values.sum() + t.inner.rows[2, 3] + t.strided[1, 2] + t.strided.shape[1]
    return sums, t.count, there, t.inner.rate, t.bits[1], t.several, t.last, t.other.rows[1, 5]


@njit
def is_absent(value):
    return value is None


@njit
def absent_of(t):
    return is_absent(t.absent), is_absent(t.values)


def test_a_field_is_that_of_the_tuple():
    given = fields()
    reference = Reference(given)
    expected = (3.0 + 15.0 + 17.0 + 3, -7, 1.0, 0.5, 250, (1.5, 2.5, 3.5), 9.0, 11.0)
    assert all_of(reference) == all_of(given) == expected
    assert absent_of(reference) == (True, False)
    assert reference.values is given.values and reference.inner is given.inner


def test_elements_of_arrays_are_shared_and_fields_are_not_changed():
    reference = Reference(fields())

    @njit
    def write(t):
        t.values[0] = 5.0

    write(reference)
    assert reference.values[0] == 5.0
    reference.inner.rows[2, 3] = 100.0
    assert all_of(reference)[0] == 5.0 + 2.0 + 100.0 + 17.0 + 3


def test_a_copy_lies_elsewhere():
    reference = Reference(fields())
    copied = pickle.loads(pickle.dumps(reference))
    copied.values[0] = 7.0
    assert all_of(copied)[0] == all_of(reference)[0] + 6.0


def test_the_tuple_of_a_reference():
    @njit
    def back(t):
        flag, rate, rows = referred(t)
        return flag, rate, rows[1, 5]

    assert back(Reference(fields().inner)) == (True, 0.5, 11.0)


def test_nobody_counts_the_references_of_its_arrays():
    reference = Reference(fields())
    before = sys.getrefcount(reference.values)
    for _ in range(3):
        all_of(reference)
    after = sys.getrefcount(reference.values)
    assert after == before


def test_answers_by_class_take_a_reference_for_its_tuple():
    @njit
    def ask(t):
        return scratch_size(t)

    tools = build_tool_table((), None, 1.0)
    assert ask(Reference(tools._replace(kind=np.zeros(3, np.int8)))) == 3 * KEPT_PACKS * PACK


def test_a_field_that_the_tuple_does_not_have_is_refused():
    @njit
    def wrong(t):
        return t.missing

    with pytest.raises(Exception, match="missing"):
        wrong(Reference(fields().inner))
    with pytest.raises(AttributeError, match="missing"):
        Reference(fields().inner).missing  # noqa: B018


def test_heavy_work_of_a_step_has_code_of_its_own():
    """One kind of element, of contact or of motion is compiled once, whatever it is run with."""
    for function in (loop.forces_of_tile, loop.bend_fibres, loop.integrate):
        assert isinstance(function, StandaloneDispatcher)
    names = {loop.integrate.name_for((typeof(np.zeros(shape)),)) for shape in (2, (2, 2))}
    assert len(names) == 2 and all(name.startswith(PREFIX) for name in names)


def test_classes_of_one_name_are_told_apart():
    def other():
        class Inner(NamedTuple):
            flag: bool
            rate: float
            rows: np.ndarray

        return Inner

    given = fields().inner
    kinds = typeof(given), typeof(other()(*given))
    assert str(kinds[0]) == str(kinds[1])
    names = {loop.integrate.name_for((kind,)) for kind in kinds}
    assert len(names | {loop.integrate.name_for((ReferenceType(kinds[0]),))}) == 3


MODULE = """
from numba import prange
from lcmchain.jit import entry, kernel_part, standalone_routine, standalone_span_routine

@standalone_routine
def root(x):
    if x < 0.0:
        raise ValueError("no root of a negative number")
    return x**0.5

@standalone_span_routine
def scale(t, factor):
    for i in range(t.values.size):
        t.values[i] *= factor
    return root(t.values[0])

@kernel_part
def scale_all(t, factors, results):
    for k in prange(results.size):
        results[k] = root(factors[k]) + t.values[1]

@entry
def first(t, factor):
    return scale(t, factor)

@entry
def second(t, factors, results):
    scale_all(t, factors, results)
    return scale(t, 3.0)
"""
CALL = """
import json
import numpy as np
import callers
from lcmchain.compilation.references import Reference
import held_in
t = Reference(held_in.T(np.array([4.0, 1.0])))
results = np.zeros(2)
found = [callers.first(t, 4.0)]
found.append(callers.second(t, np.array([4.0, 9.0]), results))
try:
    callers.first(t, -1.0)
    told = ""
except ValueError as error:
    told = str(error)
hits = [sum(f.stats.cache_hits.values()) for f in
        (callers.scale, callers.root, callers.first, callers.second)]
print(json.dumps([found, results.tolist(), t.values.tolist(), told, hits]))
"""


@pytest.fixture
def process(tmp_path, in_new_process):
    (tmp_path / "callers.py").write_text(MODULE, encoding="utf-8")
    (tmp_path / "held_in.py").write_text(
        "from typing import NamedTuple\nimport numpy as np\n\n\n"
        "class T(NamedTuple):\n    values: np.ndarray\n",
        encoding="utf-8",
    )
    return lambda: in_new_process(CALL)


EXPECTED = [[4.0, 48.0**0.5], [6.0, 7.0], [-48.0, -12.0], "no root of a negative number"]


def test_callers_read_from_disk_find_what_they_call(process, tmp_path):
    *found, hits = process()
    assert found == EXPECTED and hits == [0, 0, 0, 0]
    *found, hits = process()
    assert found == EXPECTED and hits == [1, 1, 1, 1]


@pytest.mark.parametrize(
    "lost", ["scale", "first", *(pytest.param(n, marks=pytest.mark.slow) for n in ("root", "sc"))]
)
def test_what_is_no_longer_on_disk_is_compiled_again(process, tmp_path, lost):
    process()
    kept = list((tmp_path / "cache").rglob(f"callers.{lost}*"))
    assert kept
    for file in kept:
        file.unlink()
    *found, _ = process()
    assert found == EXPECTED
