"""What compiled code takes from the processor: the width of its vectors, the lines of its cache.

LLVM prefers 256 bits on every Intel processor with AVX-512, because the first of them lower their
clock where they meet 512-bit arithmetic. Those from Ice Lake on hardly do: there the lane loops of
the element kernels run about 1.3 times faster with whole registers.

A vector of 64 bytes fills a line of the cache. Laid out as they come, stacks and arrays begin at
any 16 bytes: three times in four every vector lies across two lines, and takes twice as long to be
read and several times as long to be read back after it has been written. Stacks of compiled code,
and the arrays of the loop, begin where a line does.
"""

from __future__ import annotations

import llvmlite.binding as llvm
import numpy as np
from numba import config
from numba.core.base import BaseContext
from numba.core.codegen import CPUCodeLibrary
from numpy.typing import DTypeLike

#: An instruction set that came with the first processors that keep their clock.
KEEPS_CLOCK = "avx512vbmi2"
WHOLE_REGISTERS = "-prefer-256-bit"


#: LLVM lays out loops of up to so many turns before it looks for vectors in them: fewer than the
#: lanes of a block (``elements/blocks.py``).
LONGEST_LAID_OUT = 8


def keep_lane_loops() -> None:
    """Have LLVM find the loops over the 16 lanes of a block as loops; before anything is compiled.

    Short loops over the lanes it would else write out turn by turn, number by number.
    """
    llvm.set_option("lcmchain", f"--unroll-full-max-count={LONGEST_LAID_OUT}")


def use_widest_vectors() -> None:
    """Let numba compile for whole registers; before anything is compiled in this process.

    Numba keeps the instruction sets in the key of each compiled function, so that code of either
    width is never taken for the other. A choice by NUMBA_CPU_NAME, NUMBA_CPU_FEATURES or
    NUMBA_ENABLE_AVX stands.
    """
    chosen = config.CPU_NAME is not None or config.CPU_FEATURES is not None  # type: ignore[attr-defined]
    if chosen or not config.ENABLE_AVX:  # type: ignore[attr-defined]
        return
    features = widest(host_features())
    if features is not None:
        config.CPU_FEATURES = features  # type: ignore[attr-defined]


def host_features() -> dict[str, bool]:
    """Return which instruction sets this processor has; nothing where LLVM cannot tell."""
    try:
        return llvm.get_host_cpu_features()
    except RuntimeError:
        return {}


def widest(features: dict[str, bool]) -> str | None:
    """Return the features for LLVM with whole registers; None where its own choice serves."""
    if not features.get(KEEPS_CLOCK, False):
        return None
    flags = [("+" if present else "-") + name for name, present in sorted(features.items())]
    return ",".join([*flags, WHOLE_REGISTERS])


#: Bytes of a line, and of the widest vectors.
LINE = 64


def align_compiled_code() -> None:
    """Let compiled functions align their stacks and new arrays; before anything is compiled.

    What a loop has no register for goes to the stack. LLVM finds that out after it has laid down
    how the stack begins, so it has to be told before.
    """
    add = CPUCodeLibrary.add_ir_module

    def add_aligned(self: CPUCodeLibrary, module: llvm.ModuleRef) -> None:
        for function in module.functions:
            if not function.is_declaration:
                function.attributes.alignstack = LINE
                # llvmlite writes the former only beside another one; no compiled function unwinds
                function.attributes.add("nounwind")
        add(self, module)

    CPUCodeLibrary.add_ir_module = add_aligned  # type: ignore[method-assign]
    BaseContext.get_preferred_array_alignment = lambda self, ty: LINE  # type: ignore[method-assign]


def zeros(shape: tuple[int, ...], dtype: DTypeLike = float) -> np.ndarray:
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
