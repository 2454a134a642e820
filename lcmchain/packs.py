"""Packs: eight numbers as one value of compiled code, which one register of 512 bits holds.

Loops over the lanes of a block are left to LLVM, which finds vectors in them where all that a loop
touches lies in one array or in few. Work on nodes takes what it needs from many arrays, and stores
into some: which of them lie apart LLVM cannot tell, so that such loops had to copy everything into
the rows of one scratch array first. A pack is loaded, reckoned with and stored as a whole, and
nothing is left to be found. On processors with registers of 256 bits it lies in two of them.

Packs know ``+ - * /`` with packs and numbers, ``abs``, ``min`` and ``max`` of two, ``math.sqrt``;
comparisons make masks, which know ``&`` and ``|``. A choice between two is :func:`choose`, as a
branch would be one for all eight; it takes numbers as well, so that one equation serves both.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.base import BaseContext
from numba.core.datamodel import PrimitiveModel
from numba.core.errors import TypingError
from numba.core.imputils import lower_cast
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model
from numba.np.arrayobj import make_array

from lcmchain.jit import FLOATING_POINT, equation

if TYPE_CHECKING:  # numba may move what it does not publish
    from numba.core.datamodel.manager import DataModelManager

#: Numbers of a pack.
PACK = 8
#: What operations on packs allow, as those on numbers do.
FLAGS = tuple(sorted(FLOATING_POINT))

DOUBLE, BIT, INDEX = ir.DoubleType(), ir.IntType(1), ir.IntType(64)
NUMBERS, BITS = ir.VectorType(DOUBLE, PACK), ir.VectorType(BIT, PACK)
ALIGNMENT = 8  # of numbers in an array [bytes]


class PackType(types.Type):
    """Eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="pack")


class MaskType(types.Type):
    """Eight answers yes or no."""

    def __init__(self) -> None:
        super().__init__(name="mask")


pack, mask = PackType(), MaskType()


@register_model(PackType)
class PackModel(PrimitiveModel):
    def __init__(self, manager: DataModelManager, kind: types.Type) -> None:
        super().__init__(manager, kind, NUMBERS)


@register_model(MaskType)
class MaskModel(PrimitiveModel):
    def __init__(self, manager: DataModelManager, kind: types.Type) -> None:
        super().__init__(manager, kind, BITS)


def choose(condition: Any, chosen: Any, other: Any) -> Any:
    """Return the one where a condition holds, and the other elsewhere; both are made."""
    return chosen if condition else other


# --- arithmetic -----------------------------------------------------------------------------------


@lower_cast(types.Number, PackType)
def _pack_of_number(context, builder, number_type, pack_type, number):
    return _repeated(builder, context.cast(builder, number, number_type, types.float64))


@lower_cast(types.Boolean, MaskType)
def _mask_of_answer(context, builder, boolean_type, mask_type, answer):
    return _repeated(builder, builder.trunc(answer, BIT) if answer.type != BIT else answer)


def _repeated(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Return a vector of a value in all lanes."""
    some = ir.Constant(ir.VectorType(value.type, PACK), ir.Undefined)
    first = builder.insert_element(some, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, some, _lanes([0] * PACK))


def _lanes(numbers: list[int]) -> ir.Constant:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(numbers)), numbers)


def _let(function: Callable, count: int, result: types.Type, build: Callable[..., Any]) -> None:
    """Let a function of Python take ``count`` packs, one or some of which may be numbers."""

    @infer_global(function)
    class Template(AbstractTemplate):
        key = function

        def generic(self, args, kws):
            known = all(isinstance(kind, (PackType, types.Number)) for kind in args)
            if kws or len(args) != count or not known or pack not in args:
                return None
            return signature(result, *[pack] * count)

    @lower_builtin(function, *[PackType] * count)
    def lower(context, builder, sig, args):
        return build(builder, *args)


def _with_flags(name: str) -> Callable[..., Any]:
    return lambda builder, one, other: getattr(builder, name)(one, other, flags=FLAGS)


def _compared(sign: str) -> Callable[..., Any]:
    return lambda builder, one, other: builder.fcmp_ordered(sign, one, other)


def _of_llvm(name: str) -> Callable[..., Any]:
    def build(builder, one):
        kind = ir.FunctionType(NUMBERS, [NUMBERS])
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{PACK}f64")
        return builder.call(function, [one])

    return build


def _better(sign: str) -> Callable[..., Any]:
    """Return the larger or smaller of two, as Python does: of two equal ones the first."""

    def build(builder, one, other):
        return builder.select(builder.fcmp_ordered(sign, other, one), other, one)

    return build


for _plain, _in_place, _name in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    _let(_plain, 2, pack, _with_flags(_name))
    _let(_in_place, 2, pack, _with_flags(_name))
for _function, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
):  # fmt: skip
    _let(_function, 2, mask, _compared(_sign))
_let(operator.ne, 2, mask, lambda builder, one, other: builder.fcmp_unordered("!=", one, other))
_let(max, 2, pack, _better(">"))
_let(min, 2, pack, _better("<"))
_let(abs, 1, pack, _of_llvm("fabs"))
_let(math.sqrt, 1, pack, _of_llvm("sqrt"))
_let(operator.neg, 1, pack, lambda builder, one: builder.fneg(one))


def _let_masks(function: Callable, name: str) -> None:
    @infer_global(function)
    class Template(AbstractTemplate):
        key = function

        def generic(self, args, kws):
            known = all(isinstance(kind, (MaskType, types.Boolean)) for kind in args)
            return signature(mask, mask, mask) if known and mask in args else None

    @lower_builtin(function, MaskType, MaskType)
    def lower(context, builder, sig, args):
        return getattr(builder, name)(*args)


_let_masks(operator.and_, "and_")
_let_masks(operator.or_, "or_")


@infer_global(choose)
class _Choice(AbstractTemplate):
    key = choose

    def generic(self, args, kws):
        condition, *both = args
        if not all(isinstance(kind, (PackType, types.Number)) for kind in both):
            return None
        one = pack if isinstance(condition, MaskType) or pack in both else types.float64
        return signature(one, condition, one, one)


@lower_builtin(choose, MaskType, PackType, PackType)
@lower_builtin(choose, types.Boolean, PackType, PackType)
@lower_builtin(choose, types.Boolean, types.Float, types.Float)
def _lower_choice(context, builder, sig, args):
    return builder.select(*args)


def instruction(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a function that compiled code alone calls, whose first argument numba gives it."""
    made: Callable[..., Any] = intrinsic(function)
    return made


# --- to and from memory ---------------------------------------------------------------------------


@instruction
def load(typing_context, values, place):
    """Return the pack that begins at a place in the memory of a C-contiguous array."""

    def build(context, builder, sig, args):
        return builder.load(_address(context, builder, values, *args), align=ALIGNMENT)

    return pack(values, types.intp), build


@instruction
def load_first(typing_context, values, place, count):
    """Return the first ``count`` numbers of a pack, and zeros behind; no more is read."""

    def build(context, builder, sig, args):
        address = _address(context, builder, values, *args[:2])
        return _masked_load(builder, address, _first(builder, args[2]))

    return pack(values, types.intp, types.intp), build


@instruction
def load_lanes(typing_context, values, place, lanes):
    """Return some lanes, given as bits, of the pack that begins at a place, and zeros elsewhere.

    No more is read: the place may lie before the array where the first lanes are none of these.
    """

    def build(context, builder, sig, args):
        bits = builder.bitcast(builder.trunc(args[2], ir.IntType(PACK)), BITS)
        return _masked_load(builder, _address(context, builder, values, *args[:2]), bits)

    return pack(values, types.intp, types.intp), build


@instruction
def load_two(typing_context, values, first, second, turn):
    """Return the pack that begins at ``first``, and from a lane on the one that begins elsewhere.

    Both are read whole.
    """

    def build(context, builder, sig, args):
        array, *places, turn = args
        one, other = (
            builder.load(_address(context, builder, values, array, place), align=ALIGNMENT)
            for place in places
        )
        return builder.select(_first(builder, turn), one, other)

    return pack(values, *[types.intp] * 3), build


@instruction
def load_indexed(typing_context, values, shift, indices, place):
    """Return the numbers ``shift`` behind the eight indices (int32) that begin at a place.

    Both arrays are C-contiguous, of any shape.
    """

    def build(context, builder, sig, args):
        array, shift, index_array, place = args
        data = make_array(values)(context, builder, array).data
        index_data = make_array(indices)(context, builder, index_array).data
        numbers = ir.Constant(NUMBERS, ir.Undefined)
        for lane in range(PACK):
            at = builder.gep(index_data, [builder.add(place, ir.Constant(INDEX, lane))])
            index = builder.add(builder.sext(builder.load(at), INDEX), shift)
            number = builder.load(builder.gep(data, [index]))
            numbers = builder.insert_element(numbers, number, ir.Constant(ir.IntType(32), lane))
        return numbers

    return pack(values, types.intp, indices, types.intp), build


@instruction
def store(typing_context, values, place, numbers):
    """Write a pack to a place in the memory of a C-contiguous array."""

    def build(context, builder, sig, args):
        builder.store(args[2], _address(context, builder, values, *args[:2]), align=ALIGNMENT)
        return context.get_dummy_value()

    return types.none(values, types.intp, pack), build


@instruction
def store_first(typing_context, values, place, numbers, count):
    """Write the first ``count`` numbers of a pack; what lies behind stays as it is."""

    def build(context, builder, sig, args):
        address = _address(context, builder, values, *args[:2])
        kind = ir.FunctionType(ir.VoidType(), [NUMBERS, address.type, ir.IntType(32), BITS])
        name = f"llvm.masked.store.v{PACK}f64.p0"
        function = cgutils.get_or_insert_function(builder.module, kind, name)
        align = ir.Constant(ir.IntType(32), ALIGNMENT)
        builder.call(function, [args[2], address, align, _first(builder, args[3])])
        return context.get_dummy_value()

    return types.none(values, types.intp, pack, types.intp), build


def _address(
    context: BaseContext, builder: ir.IRBuilder, kind: types.Array, array: ir.Value, place: ir.Value
) -> ir.Value:
    """Return the pointer to the pack that begins at a place of an array."""
    if kind.layout != "C" or kind.dtype != types.float64:
        raise TypingError("packs are of numbers of double precision in C-contiguous arrays")
    data = make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [place]), NUMBERS.as_pointer())


def _masked_load(builder: ir.IRBuilder, address: ir.Value, lanes: ir.Value) -> ir.Value:
    """Return what lies in some lanes of a pack in memory, and zeros elsewhere."""
    kind = ir.FunctionType(NUMBERS, [address.type, ir.IntType(32), BITS, NUMBERS])
    name = f"llvm.masked.load.v{PACK}f64.p0"
    function = cgutils.get_or_insert_function(builder.module, kind, name)
    align, zeros = ir.Constant(ir.IntType(32), ALIGNMENT), ir.Constant(NUMBERS, [0.0] * PACK)
    return builder.call(function, [address, align, lanes, zeros])


def _first(builder: ir.IRBuilder, count: ir.Value) -> ir.Value:
    """Return which lanes are the first ``count``."""
    numbered = ir.Constant(ir.VectorType(INDEX, PACK), list(range(PACK)))
    return builder.icmp_signed("<", numbered, _repeated(builder, count))


# --- vectors, as tuples of three packs ------------------------------------------------------------


@equation
def load_three(values, step, place):
    """Return the packs that begin at a place, one step behind it, and two."""
    return load(values, place), load(values, place + step), load(values, place + 2 * step)


@equation
def store_three(values, step, place, a):
    """Write three packs to a place, one step behind it, and two."""
    store(values, place, a[0])
    store(values, place + step, a[1])
    store(values, place + 2 * step, a[2])


@equation
def load_vector(values, first, count):
    """Return the three components (3, node_count) of ``count`` nodes from ``first`` on."""
    step = values.shape[1]
    return (
        load_first(values, first, count),
        load_first(values, first + step, count),
        load_first(values, first + 2 * step, count),
    )


@equation
def store_vector(values, first, count, a):
    """Write the three components (3, node_count) of ``count`` nodes from ``first`` on."""
    step = values.shape[1]
    store_first(values, first, a[0], count)
    store_first(values, first + step, a[1], count)
    store_first(values, first + 2 * step, a[2], count)


# --- all eight together ---------------------------------------------------------------------------


@instruction
def pack_of(typing_context, number):
    """Return a pack of one number."""
    return pack(types.float64), lambda context, builder, sig, args: _repeated(builder, args[0])


@instruction
def first_lanes(typing_context, count):
    """Return a mask of the first ``count`` lanes."""
    return mask(types.intp), lambda context, builder, sig, args: _first(builder, args[0])


@instruction
def any_lane(typing_context, answers):
    """Tell whether a mask holds in any lane."""

    def build(context, builder, sig, args):
        bits = builder.bitcast(args[0], ir.IntType(PACK))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return types.boolean(mask), build


@instruction
def all_lanes(typing_context, answers):
    """Tell whether a mask holds in all lanes."""

    def build(context, builder, sig, args):
        bits = builder.bitcast(args[0], ir.IntType(PACK))
        return builder.icmp_unsigned("==", bits, ir.Constant(bits.type, -1))

    return types.boolean(mask), build


@instruction
def sum_of(typing_context, numbers):
    """Return the sum of a pack: its halves added lane by lane, theirs, and so on."""

    def build(context, builder, sig, args):
        (rest,) = args
        count = PACK
        while count > 1:
            count //= 2
            halves = [_lanes(list(range(k, k + count))) for k in (0, count)]
            low, high = (builder.shuffle_vector(rest, rest, half) for half in halves)
            rest = builder.fadd(low, high)
        return builder.extract_element(rest, ir.Constant(ir.IntType(32), 0))

    return types.float64(pack), build
