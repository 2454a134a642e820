"""Compiled code that gives the same bits whether it was compiled here or read from disk.

Numba copies every function into the compiled code of each that calls it, and optimises the copies
once more there. They may differ in the last digit: which multiply-add is fused, and in which lanes
a sum is taken, is left to the compiler. All copies bear one name, and those that come later to a
process give way to the first: a process that has compiled a kernel runs the kernel's own code from
everywhere, one that reads a caller of it from disk runs the caller's copy. Here copies become
private to the code they stand in. What a function computes is then decided by itself alone.
"""

from __future__ import annotations

from numba.core.codegen import CPUCodeLibrary

#: Numba's pass that removes counting of references knows these by name; they compute nothing.
COUNTING = ("NRT_", "nrt_")


def keep_code_self_contained() -> None:
    """Make copies of functions private from now on; before anything is compiled.

    Two steps of numba's linking are taken apart for it: what is linked in is made private after
    all of it is there and before it is optimised.
    """
    optimize = CPUCodeLibrary._optimize_final_module

    def optimize_private(self: CPUCodeLibrary) -> None:
        for function in self._final_module.functions:
            copied = not function.is_declaration and function.linkage.name == "linkonce_odr"
            if copied and not function.name.startswith(COUNTING):
                function.linkage = "internal"
        optimize(self)

    CPUCodeLibrary._optimize_final_module = optimize_private  # type: ignore[method-assign]
