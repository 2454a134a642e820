"""Operations of the element kernel, counted in its compiled code.

The kernel is compiled once more for numbers instead of vectors, in a process of its own: then every
instruction of its loop over the lanes of a block is one operation of one element. A fused
multiply-add counts as two, as in the largest rate of the machine it is compared with.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile

import numpy as np
from numba import njit, typeof

from lcmchain.bench.sizes import free_plate
from lcmchain.elements.solid_shell.kernel import element_forces
from lcmchain.errors import SimulationError

#: Of one number each, on x86: arithmetic, square roots, the larger or smaller of two.
SINGLE = re.compile(r"\sv?(?:add|sub|mul|div|sqrt|max|min)sd\s")
FUSED = re.compile(r"\svfn?m(?:add|sub)(?:132|213|231)sd\s")
NO_VECTORS = {"NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}


def kernel_operations() -> int:
    """Return how many operations the kernel makes per element, for MD600 on a flat sheet.

    Compiles for about a quarter of a minute, and keeps nothing of it.

    Raises
    ------
    SimulationError : the code could not be compiled so, or is for another kind of processor.
    """
    with tempfile.TemporaryDirectory(prefix="lcmchain-operations-") as folder:
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__],
            env={**os.environ, **NO_VECTORS, "NUMBA_CACHE_DIR": folder},
            capture_output=True,
            text=True,
        )
    if done.returncode != 0 or not done.stdout.strip().isdigit():
        raise SimulationError(f"no operations could be counted: {done.stderr.strip()[-500:]}")
    return int(done.stdout)


def counted(assembly: str) -> int:
    """Return the operations in x86 code without vectors."""
    return len(SINGLE.findall(assembly)) + 2 * len(FUSED.findall(assembly))


def kernel_assembly() -> str:
    """Return the code of the kernel as it is compiled in this process."""
    model = free_plate(25).model
    data = model.body.data
    arguments = (
        model.node_positions.T.copy(),
        data.corner_node,
        data.corner_run,
        data.element_data,
        np.zeros(model.corner_force_size),
        np.zeros(model.history_size),
        data.law,
        data.options,
        data.quick_data,
        data.quick_options,
        data.general,
    )
    # code loaded from the disk cache cannot be inspected
    options = {k: v for k, v in element_forces.targetoptions.items() if k != "nopython"}
    fresh = njit(**{**options, "parallel": False})(element_forces.py_func)
    fresh.compile(tuple(map(typeof, arguments)))
    (assembly,) = fresh.inspect_asm().values()
    return assembly


if __name__ == "__main__":
    print(counted(kernel_assembly()))
