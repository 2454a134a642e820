"""Functions of compiled code alone: linked as before, without machine code, callable even so."""

import numpy as np
import pytest
from numba import float64, guvectorize, njit, prange
from numba.core.codegen import JITCodeLibrary
from numba.extending import overload

from lcmchain.compilation.compiled_parts import PartDispatcher, PartLibrary
from lcmchain.jit import entry, equation, routine
from lcmchain.solver.loop import make_batches, move_nodes

MODULE = """
from lcmchain.jit import entry, equation, routine

@equation
def square(x, shift=1.0):
    return x * x + shift

@routine
def root(x):
    if x < 0.0:
        raise ValueError("no root of a negative number", x)
    return x**0.5

@entry
def sum_of_squares(values):
    total = 0.0
    for x in values:
        total += square(x)
    return total

@entry
def sum_of_roots(values):
    total = 0.0
    for x in values:
        total += root(square(x, -2.0))
    return total
"""
CALL = """
import json
import numpy as np
import parts
values = np.linspace(2.0, 3.0, 5)
found = {first}(values), {second}(values)
try:
    parts.sum_of_roots(np.zeros(1))
except ValueError as error:
    told = error.args
hits = [f.stats.cache_hits.total() for f in (parts.square, parts.root)]
print(json.dumps([found, told, hits, parts.square(3.0), parts.square(shift=2.0, x=3.0)]))
"""


@equation
def twice(x):
    return 2.0 * x


@routine
def twice_and_one(x):
    return twice(x) + 1.0


@entry
def called(x):
    return twice_and_one(x)


def test_parts_are_linked_and_have_no_code_of_their_own():
    assert called(3.0) == 7.0
    for function in (twice, twice_and_one):
        assert isinstance(function, PartDispatcher)
        function.compile((float64,))  # or reads it, where the caller was read from disk
        (compiled,) = function.overloads.values()
        assert isinstance(compiled.library, PartLibrary)
        with pytest.raises(RuntimeError, match="no address"):
            compiled.library.get_pointer_to_function("any")
    assert not isinstance(called, PartDispatcher)


def test_python_calls_a_part_that_compiled_code_has_called():
    assert called(1.0) == twice_and_one(1.0) == 3.0
    assert twice(1) == 2.0 and twice(1j) == 2j


@pytest.fixture
def machine_code(monkeypatch):
    """Names of what becomes machine code from here on."""
    names, finalize = [], JITCodeLibrary._finalize_final_module

    def noting(self):
        names.append(self.name)
        finalize(self)

    monkeypatch.setattr(JITCodeLibrary, "_finalize_final_module", noting)
    return names


@pytest.fixture
def optimised(monkeypatch):
    """Names of what is optimised from here on."""
    names, optimise = [], JITCodeLibrary._optimize_final_module

    def noting(self):
        names.append(self.name)
        optimise(self)

    monkeypatch.setattr(JITCodeLibrary, "_optimize_final_module", noting)
    return names


def test_bodies_of_parallel_loops_are_compiled_in_their_kernel_alone(machine_code, optimised):
    @njit(parallel=True)
    def roots(values):
        for i in prange(values.size):
            values[i] = np.sqrt(values[i])

    values = np.array([1.0, 4.0, 9.0])
    roots(values)
    assert values.tolist() == [1.0, 2.0, 3.0]
    assert [name for name in machine_code if "gufunc" in name.lower()] == []
    assert any("roots" in name for name in machine_code)
    assert optimised and [name for name in optimised if "gufunc" in name.lower()] == []


def halved(x):
    return 0.5 * x


@overload(halved)
def choose_halved(x):
    return lambda x: 0.5 * x


def test_what_stands_for_a_function_in_compiled_code_has_no_code_of_its_own(machine_code):
    @njit
    def at_least_one(x):
        return max(halved(x), 1.0)

    assert at_least_one(5.0) == 2.5 and at_least_one(1.5) == 1.0
    assert len(machine_code) == 1 and "at_least_one" in machine_code[0]


def test_loops_of_compiled_code_alone_are_parts():
    assert isinstance(make_batches, PartDispatcher) and isinstance(move_nodes, PartDispatcher)


def test_functions_of_the_user_over_arrays_have_code_as_before(machine_code):
    @guvectorize(["(f8[:], f8[:])"], "(n)->(n)", target="parallel", nopython=True)
    def halved(values, result):
        result[:] = 0.5 * values

    assert halved(np.array([[1.0, 2.0], [3.0, 4.0]])).tolist() == [[0.5, 1.0], [1.5, 2.0]]
    assert any("gufunc" in name.lower() for name in machine_code)


@pytest.fixture
def process(tmp_path, in_new_process):
    """Call two functions of the module in a process of its own, with one cache for all."""
    (tmp_path / "parts.py").write_text(MODULE, encoding="utf-8")

    def call(first, second):
        return in_new_process(CALL.format(first=first, second=second))

    return call


def test_parts_are_read_from_disk(process):
    """In another process, for other callers, which raise what a part raises."""
    squares = sum(x * x + 1.0 for x in (2.0, 2.25, 2.5, 2.75, 3.0))
    (first, _), told, hits, *from_python = process("parts.sum_of_squares", "parts.sum_of_squares")
    assert first == pytest.approx(squares) and hits == [0, 0]
    assert told == ["no root of a negative number", -2.0]
    assert from_python == [10.0, 11.0]
    again = "(lambda values: parts.sum_of_squares(values.astype(np.float32)))"
    (other, roots), told, hits, *from_python = process(again, "parts.sum_of_roots")
    assert other == pytest.approx(squares)
    assert roots == pytest.approx(sum((x * x - 2.0) ** 0.5 for x in (2.0, 2.25, 2.5, 2.75, 3.0)))
    assert told == ["no root of a negative number", -2.0]
    assert from_python == [10.0, 11.0]


def test_an_entry_compiled_anew_takes_its_parts_from_disk(process, tmp_path):
    process("parts.sum_of_squares", "parts.sum_of_squares")
    for kept in (tmp_path / "cache").rglob("parts.sum_of*"):
        kept.unlink()
    _, told, hits, *_ = process("parts.sum_of_squares", "parts.sum_of_roots")
    assert hits[1] == 1 and hits[0] >= 1
    assert told == ["no root of a negative number", -2.0]
