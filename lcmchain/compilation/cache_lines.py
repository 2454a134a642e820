"""Stacks and arrays that begin where cache lines do, for loops over whole vectors.

A vector of 64 bytes fills a line of the cache. Laid out as they come, stacks and arrays begin at
any 16 bytes: three times in four every vector lies across two lines, and takes twice as long to be
read and several times as long to be read back after it has been written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core.base import BaseContext
from numba.core.codegen import CPUCodeLibrary

#: Bytes of a line, and of the widest vectors.
LINE = 64


def align_compiled_code() -> None:
    """Let compiled functions align their stacks and new arrays; before anything is compiled.

    What a loop has no register for goes to the stack. LLVM finds that out after it has laid down
    how the stack begins, so it has to be told before.
    """
    add = CPUCodeLibrary.add_ir_module

    def add_aligned(self: Any, module: Any) -> None:
        for function in module.functions:
            if not function.is_declaration:
                function.attributes.alignstack = LINE
                # llvmlite writes the former only beside another one; no compiled function unwinds
                function.attributes.add("nounwind")
        add(self, module)

    CPUCodeLibrary.add_ir_module = add_aligned  # type: ignore[method-assign]
    BaseContext.get_preferred_array_alignment = lambda self, ty: LINE  # type: ignore[method-assign]


def zeros(shape: tuple[int, ...], dtype: Any = float) -> np.ndarray:
    """Return an array of zeros that begins with a cache line."""
    kind = np.dtype(dtype)
    size = int(np.prod(shape)) * kind.itemsize
    memory = np.zeros(size + LINE, dtype=np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size].view(kind).reshape(shape)


def aligned(array: np.ndarray) -> np.ndarray:
    """Return a copy of an array that begins with a cache line."""
    copy = zeros(array.shape, array.dtype)
    copy[...] = array
    return copy
