"""Tuples of many arrays that compiled code takes by reference.

Numba hands a tuple of arrays on array by array, and each of these as seven to nine numbers: a
function that takes all arrays of the solver has some eight hundred arguments. A call of it writes
them all, and the compiler follows each through every call. Here such a tuple is laid down in memory
once, and compiled code takes its address; a field is read where it is used.

What is laid down must not change, so that a loop may read it once, before it begins: no arrays may
be replaced. Their elements may.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.base import BaseContext
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed
from numba.core.registry import cpu_target
from numba.core.typing.templates import AttributeTemplate, Signature
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    register_model,
    unbox,
)
from numba.np.numpy_support import as_dtype

from lcmchain.compilation.processor import zeros

if TYPE_CHECKING:  # numba may move what it does not publish
    from numba.core.datamodel.manager import DataModelManager
    from numba.core.pythonapi import _UnboxContext as UnboxContext

#: What compiled code keeps of an array, in its order.
ARRAY = ("meminfo", "parent", "nitems", "itemsize", "data", "shape", "strides")
#: How a number of a kind lies in memory, as the module struct names it.
CODES = {"bool": "?", "uint8": "B", "int8": "b", "int32": "i", "int64": "q", "float64": "d"}


class ReferenceType(types.Type):
    """Type of a reference to a named tuple of the type ``to``."""

    def __init__(self, to: types.NamedTuple) -> None:
        self.to = to
        super().__init__(f"Reference({to})")

    @property
    def key(self) -> types.NamedTuple:
        return self.to


@register_model(ReferenceType)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, manager: DataModelManager, of_type: types.Type) -> None:
        super().__init__(manager, of_type, ir.IntType(64))


class Reference:
    """A named tuple as compiled code takes it by reference; for Python it has the same fields."""

    def __init__(self, fields: tuple) -> None:
        kind = typeof(fields)
        layout = _layout(kind)
        numbers: list[Any] = []
        _collect(kind, fields, numbers)
        self.referent = fields
        self._numba_type_ = ReferenceType(kind)
        self._memory = zeros((layout.size,), np.uint8)
        self._address = self._memory.ctypes.data
        layout.pack_into(self._memory.data, 0, *numbers)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.referent, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return Reference, (self.referent,)  # in another process, or a copy, it lies elsewhere


@cache
def _layout(kind: types.Type) -> struct.Struct:
    """Return how compiled code has the numbers of a value in memory."""
    places = sorted(_places(kind, 0))
    size = cpu_target.target_context.get_abi_sizeof(cpu_target.target_context.get_data_type(kind))
    form, end = "=", 0
    for at, code in places:
        form += f"{at - end}x{code}"
        end = at + struct.calcsize(f"={code}")
    return struct.Struct(f"{form}{size - end}x")


def _places(kind: types.Type, at: int) -> Iterator[tuple[int, str]]:
    """Yield where the numbers of a value begin, and their kinds, in the order of `_collect`."""
    if isinstance(kind, types.NoneType):
        return
    if isinstance(kind, types.BaseTuple):
        for of_part, offset in zip(kind.types, _offsets(kind), strict=True):  # type: ignore[attr-defined]
            yield from _places(of_part, at + offset)
    elif isinstance(kind, types.Array):
        rows = cpu_target.target_context.data_model_manager[kind]._fields
        if tuple(rows) != ARRAY:
            raise NotImplementedError(f"arrays of this numba have {rows}, not {ARRAY}")
        for row, offset in zip(rows, _offsets(kind), strict=True):
            count = kind.ndim if row in ("shape", "strides") else 1
            yield from ((at + offset + 8 * k, "q") for k in range(count))
    elif isinstance(kind, ReferenceType):
        yield at, "q"
    else:
        yield at, CODES[as_dtype(kind).name]


def _offsets(kind: types.Type) -> list[int]:
    """Return at which bytes of a tuple or an array its parts begin."""
    context = cpu_target.target_context
    data = context.get_data_type(kind)
    if isinstance(data, ir.ArrayType):  # a tuple of one type
        step = context.get_abi_sizeof(data.element)
        return [k * step for k in range(data.count)]
    return [int(data.get_element_offset(context.target_data, k)) for k in range(len(data.elements))]


def _collect(kind: types.Type, value: Any, numbers: list[Any]) -> None:
    """Append the numbers that stand for a value in compiled code.

    Of an array nobody counts the references: the tuple keeps it alive.
    """
    if isinstance(kind, types.Array):
        address = value.__array_interface__["data"][0]
        numbers += (0, 0, value.size, value.itemsize, address, *value.shape, *value.strides)
    elif isinstance(kind, types.BaseTuple):
        for of_part, part in zip(kind.types, value, strict=True):  # type: ignore[attr-defined]
            _collect(of_part, part, numbers)
    elif isinstance(kind, ReferenceType):
        numbers.append(value._address)
    elif not isinstance(kind, types.NoneType):
        numbers.append(value)


@intrinsic
def referred(_: Any, reference: ReferenceType) -> Any:
    """Return the tuple that a reference refers to."""

    def lower(
        context: BaseContext,
        builder: ir.IRBuilder,
        signature: Signature,
        arguments: Sequence[ir.Value],
    ) -> ir.Value:
        kind = signature.return_type
        place = builder.inttoptr(arguments[0], context.get_data_type(kind).as_pointer())
        value = context.data_model_manager[kind].from_data(builder, _read_parts(builder, place))
        return impl_ret_borrowed(context, builder, kind, value)

    return reference.to(reference), lower


@unbox(ReferenceType)
def _unbox_reference(of_type: ReferenceType, reference: ir.Value, c: UnboxContext) -> NativeValue:
    number = c.pyapi.object_getattr_string(reference, "_address")
    address = c.unbox(types.int64, number).value
    c.pyapi.decref(number)
    return NativeValue(address)


@infer_getattr
class _FieldTypes(AttributeTemplate):
    key = ReferenceType

    def generic_resolve(self, reference: ReferenceType, name: str) -> types.Type | None:  # type: ignore[override]
        fields = reference.to.fields
        return reference.to.types[fields.index(name)] if name in fields else None


@lower_getattr_generic(ReferenceType)
def _read_field(
    context: BaseContext,
    builder: ir.IRBuilder,
    reference: ReferenceType,
    address: ir.Value,
    name: str,
) -> ir.Value:
    to = reference.to
    at = to.fields.index(name)
    place = builder.inttoptr(address, context.get_data_type(to).as_pointer())
    data = _read_parts(builder, cgutils.gep_inbounds(builder, place, 0, at))
    kind = to.types[at]
    value = context.data_model_manager[kind].from_data(builder, data)
    return impl_ret_borrowed(context, builder, kind, value)


def _read_parts(builder: ir.IRBuilder, place: ir.Value) -> ir.Value:
    """Read a value number by number, each as one that never changes: what is not used goes."""
    kind = place.type.pointee
    if isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        count = kind.count if isinstance(kind, ir.ArrayType) else len(kind.elements)
        value = ir.Constant(kind, ir.Undefined)
        for k in range(count):
            part = _read_parts(builder, cgutils.gep_inbounds(builder, place, 0, k))
            value = builder.insert_value(value, part, k)
        return value
    number = builder.load(place)
    number.set_metadata("invariant.load", builder.module.add_metadata([]))
    return number
