"""Compiled code that takes tuples of many arrays, in good time.

The loops of the solver take what they read and write as tuples of some fifty arrays. Numba hands
them on whole: every use of one array loads all of the tuple and takes one part of it. LLVM's pass
that breaks up such loads (SROA) comes first and takes all of them apart, which grows with the
square of the arrays: two thirds of the time that the solver took to compile. A pass that comes
later (instruction combining) turns a load of which one part is used into a load of that part.
Here it comes first as well.
"""

from __future__ import annotations

from typing import Any

from llvmlite.binding.newpassmanagers import create_new_function_pass_manager
from numba.core.codegen import CPUCodeLibrary


def load_parts_of_tuples() -> None:
    """Let compiled functions load parts in place of whole tuples from now on."""
    optimize = CPUCodeLibrary._optimize_functions

    def optimize_parts(self: Any, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        _, builder = self._codegen._function_pass_manager()
        for function in module.functions:
            if not function.is_declaration:
                passes = create_new_function_pass_manager()
                passes.add_instruction_combine_pass()
                passes.run(function, builder)
        optimize(self, module)

    CPUCodeLibrary._optimize_functions = optimize_parts  # type: ignore[method-assign]
