"""Numbers of 16 neighbours, loaded by vectors where their indices count up.

Elements and nodes are mostly numbered along the rows of a mesh. What 16 neighbours read then lies
in one run of memory, or in two, where a row ends or a block. Both are loaded whole, and each lane
takes its number from one of them: a few instructions in place of 16 times index, load and store.
Where there are more runs, as in meshes without rows, the indices are followed one by one.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from lcmchain.elements.blocks import LANES
from lcmchain.jit import equation, span_part
from lcmchain.packs import PACK, load, load_indexed, load_two

#: Numbers that describe the runs of 16 indices.
RUN_COLUMNS = 3
#: First run of indices that are in no two runs.
SCATTERED = -1


def find_runs(indices: np.ndarray) -> np.ndarray:
    """Return where the runs of 16 indices (..., 16) begin, (..., 3) int32.

    For the first lane, as if the run began there: of the first run and of the second one; then the
    first lane of the second run. :data:`SCATTERED` where there are more runs, or where one as long
    as all lanes would begin before 0 or end behind the largest index of all.
    """
    start = indices.astype(np.int64) - np.arange(LANES)
    first, second = start[..., 0], start[..., -1]
    turns = np.diff(start, axis=-1) != 0
    turn = np.where(turns.any(axis=-1), turns.argmax(axis=-1) + 1, LANES)
    low, high = np.minimum(first, second), np.maximum(first, second)
    in_two = (turns.sum(axis=-1) <= 1) & (low >= 0) & (high + LANES <= indices.max(initial=0) + 1)
    return np.stack([np.where(in_two, first, SCATTERED), second, turn], axis=-1).astype(np.int32)


@span_part
def load_vectors(values, step, indices, place, runs, k, out, row):
    """Write three components of 16 indexed places to three rows of ``out``.

    Parameters
    ----------
    values : C-contiguous, of any shape, read in the order of memory: at an index, ``step`` numbers
        behind it, and as many behind that. indices : of which those from ``place`` on are taken.
    runs, k : :func:`find_runs` of the indices, and which 16 of them. out : written from ``row`` on.
    """
    first = runs[k * RUN_COLUMNS]
    if first >= 0:
        second, turn = runs[k * RUN_COLUMNS + 1], runs[k * RUN_COLUMNS + 2]
        if turn == LANES:
            for d in range(3):
                one, to = first + d * step, row + d * LANES
                copy_lanes(values, one, one, LANES, out, to)  # type: ignore[call-arg]
        else:
            for d in range(3):
                one, other, to = first + d * step, second + d * step, row + d * LANES
                copy_lanes(values, one, other, turn, out, to)  # type: ignore[call-arg]
    else:
        for lane in range(LANES):
            index = indices[place + lane]
            for d in range(3):
                at = index + d * step
                out[row + d * LANES + lane] = number_at(values, at)  # type: ignore[call-arg]


@equation
def vector_of_lanes(values, step, indices, place, runs, k, half):
    """Return three components of 8 of 16 indexed places as packs: the lower or the upper half.

    The parameters are those of :func:`load_vectors`; half : 0 or 1.
    """
    first, shift = runs[k * RUN_COLUMNS], half * PACK
    if first >= 0:
        first, second = first + shift, runs[k * RUN_COLUMNS + 1] + shift
        turn = runs[k * RUN_COLUMNS + 2] - shift
        if turn >= PACK:
            return load_three(values, step, first)
        if turn <= 0:
            return load_three(values, step, second)
        return (
            load_two(values, first, second, turn),
            load_two(values, first + step, second + step, turn),
            load_two(values, first + 2 * step, second + 2 * step, turn),
        )
    at = place + shift
    return (
        load_indexed(values, 0, indices, at),
        load_indexed(values, step, indices, at),
        load_indexed(values, 2 * step, indices, at),
    )


@equation
def load_three(values, step, place):
    """Return three packs, one step behind the other."""
    return load(values, place), load(values, place + step), load(values, place + 2 * step)


@intrinsic
def copy_lanes(typing_context, values, first, second, turn, out, row):
    """Copy 16 numbers as vectors: ``out[row + lane] = values[first + lane]``.

    From the lane ``turn`` on they come from ``values[second + lane]``. Of a loop over the lanes the
    compiler would make loads and stores one by one, as it cannot tell that the arrays are apart.
    """

    def build(context, builder, signature, arguments):
        source = _data(context, builder, values, arguments[0])
        target = _data(context, builder, out, arguments[4])
        vector = ir.VectorType(source.type.pointee, LANES)
        align = values.dtype.bitwidth // 8

        def at(data, place):
            return builder.bitcast(builder.gep(data, [place]), vector.as_pointer())

        one, other = (builder.load(at(source, place), align=align) for place in arguments[1:3])
        turns = ir.Constant(ir.VectorType(arguments[3].type, LANES), ir.Undefined)
        for lane in range(LANES):
            turns = builder.insert_element(turns, arguments[3], ir.Constant(ir.IntType(32), lane))
        before = builder.icmp_signed("<", ir.Constant(turns.type, list(range(LANES))), turns)
        both = builder.select(before, one, other)
        builder.store(both, at(target, arguments[5]), align=align)
        return context.get_dummy_value()

    return types.none(values, types.intp, types.intp, types.intp, out, types.intp), build


@intrinsic
def number_at(typing_context, values, place):
    """Return the number of a C-contiguous array of any shape at a place in memory."""

    def build(context, builder, signature, arguments):
        data = _data(context, builder, values, arguments[0])
        return builder.load(builder.gep(data, [arguments[1]]))

    return values.dtype(values, types.intp), build


@intrinsic
def put_number_at(typing_context, values, place, number):
    """Write a number to a place in the memory of a C-contiguous array of any shape."""

    def build(context, builder, signature, arguments):
        data = _data(context, builder, values, arguments[0])
        builder.store(arguments[2], builder.gep(data, [arguments[1]]))
        return context.get_dummy_value()

    return types.none(values, types.intp, values.dtype), build


def _data(context, builder, kind, array):
    """Return the pointer to an array's numbers."""
    if kind.layout != "C":
        raise TypingError("an array must be C-contiguous to be read in the order of memory")
    return make_array(kind)(context, builder, array).data
