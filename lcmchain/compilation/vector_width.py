"""Vectors for compiled code: of 512 bits on processors that lose nothing by them.

LLVM prefers 256 bits on every Intel processor with AVX-512, because the first of them lower their
clock where they meet 512-bit arithmetic. Those from Ice Lake on hardly do: there the lane loops of
the element kernels run about 1.3 times faster with whole registers.
"""

from __future__ import annotations

import llvmlite.binding as llvm
from numba import config

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
