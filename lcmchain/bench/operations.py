"""Operations of the parts of a step, counted in their compiled code.

Each part is compiled once more for numbers instead of vectors, in a process of its own: then every
instruction of its loop over elements or nodes is one operation of one of them. A fused multiply-add
counts as two, as in the largest rate of the machine it is compared with. Comparisons and choices
are none.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np
from numba import njit, typeof
from numba.core.dispatcher import Dispatcher

from lcmchain.bench.hemisphere import SCENE
from lcmchain.effects.fibre_bending import NEAR_ROWS, add_vectors, find_middle, find_vectors
from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.kernel import element_forces
from lcmchain.errors import SimulationError
from lcmchain.scene import scene_from_text
from lcmchain.solver.contact_forces import ROWS, find_gaps, make_forces
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.profiles import ARC, CORNER_COLUMNS
from lcmchain.tools.span_distance import (
    LOCAL_X,
    distances_to_arc,
    distances_to_corner,
    distances_to_line,
    faces_level_part,
    profile_distances,
    span_distances,
    to_tool_frame,
)
from lcmchain.tools.span_rows import SPAN, SPANS_OF_CHUNK, load_rows

#: Of one number each, on x86: arithmetic, square roots, the larger or smaller of two.
SINGLE = re.compile(r"\sv?(?:add|sub|mul|div|sqrt|max|min)sd\s")
FUSED = re.compile(r"\svfn?m(?:add|sub)(?:132|213|231)sd\s")
NO_VECTORS = {"NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
# Several turns of a loop in one would count as often.
NO_UNROLLING = ("--unroll-allow-partial=0", "--unroll-runtime=0")


class Operations(NamedTuple):
    """Operations of the loops of a step of MD600 on a flat sheet.

    kernel : per element. bending : of the fibres, per mid-surface node.
    Of contact, per node of a span near a tool: frame : to that of the tool, and whether its level
    part is the nearest. profile : of the distance to a profile, with line, arc and corner for each
    of its pieces. gap : from the distance. force : pressure and friction, where a node touches.
    """

    kernel: int
    bending: int
    frame: int
    profile: int
    line: int
    arc: int
    corner: int
    gap: int
    force: int


def count_operations() -> Operations:
    """Count; compiles for about half a minute, and keeps nothing of it.

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
    try:
        found = Operations(*json.loads(done.stdout))
    except ValueError:
        reason = done.stderr.strip()[-500:]
        raise SimulationError(f"no operations could be counted: {reason}") from None
    if found.kernel == 0:
        raise SimulationError("no operations could be counted: the code is not for x86")
    return found


def counted(assembly: str) -> int:
    """Return the operations in x86 code without vectors."""
    return len(SINGLE.findall(assembly)) + 2 * len(FUSED.findall(assembly))


def contact_operations(simulation: Simulation, operations: Operations) -> float:
    """Return the operations of the contact with revolved tools, of a step at the present state."""
    arrays, table = simulation.arrays, simulation.model.tools
    work, total = np.empty(ROWS * SPAN), 0
    for tool in range(table.kind.size):
        pieces = table.segments[table.segment_start[tool] : table.segment_start[tool + 1], 0]
        arcs = int(np.sum(pieces == ARC))
        corners = int(table.corner_start[tool + 1] - table.corner_start[tool])
        profile = operations.profile + operations.arc * arcs + operations.corner * corners
        profile += operations.line * (pieces.size - arcs)
        travel, overlap = arrays.tool_travel[tool], table.initial_overlap[tool]
        for span in np.flatnonzero(arrays.near_span[tool]).tolist():
            chunk, place = divmod(span, SPANS_OF_CHUNK)
            begin = int(arrays.chunk_start[chunk]) + place * SPAN
            count = min(SPAN, int(arrays.chunk_start[chunk + 1]) - begin)
            load_rows(arrays.position, begin, count, LOCAL_X, work)
            to_tool_frame(table, tool, travel, work)
            level = faces_level_part(table.level_part[tool], True, work)
            span_distances(table, tool, arrays.position, begin, count, travel, work)
            touching, _ = find_gaps(arrays.offset, begin, count, overlap, 0.0, work)
            total += operations.frame + operations.gap
            total += 0 if level else profile
            total += operations.force if touching else 0
    return float(SPAN * total)


def _operations_of(function: Dispatcher, *arguments: object) -> int:
    """Return the operations in the code of a function, compiled for such arguments."""
    # code loaded from the disk cache cannot be inspected
    left_out = ("nopython", "forceinline")
    options = {k: v for k, v in function.targetoptions.items() if k not in left_out}
    options |= {"parallel": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    fresh = njit(**options)(function.py_func)
    fresh.compile(tuple(map(typeof, arguments)))
    (assembly,) = fresh.inspect_asm().values()
    return counted(assembly)


def _count_here() -> Operations:
    """Count with the compiler options of this process."""
    simulation = Simulation.from_scene(scene_from_text(SCENE))
    arrays, model = simulation.arrays, simulation.model
    data, tools = model.only_body().data, model.tools
    assert model.fibre_bending is not None
    fibres = model.fibre_bending.data
    near, work = np.empty(NEAR_ROWS * LANES), np.empty(ROWS * SPAN)
    middle, vector = arrays.bending_middle, arrays.bending_vector
    piece, corner = tools.segments[0], np.zeros(CORNER_COLUMNS)
    pieces = [
        _operations_of(distances_to_line, piece, work),
        _operations_of(distances_to_arc, piece, work),
        _operations_of(distances_to_corner, corner, work),
    ]
    # that of all profiles holds the code of every piece once
    profile = _operations_of(profile_distances, tools, 0, True, work) - sum(pieces)
    return Operations(
        kernel=_operations_of(
            element_forces, arrays.position, data.corner_node, data.corner_run, data.element_data,
            arrays.corner_force, arrays.history, data.law, data.options, data.quick_data,
            data.quick_options, data.general, 0.0, 0.0,
        ),
        bending=_operations_of(find_middle, fibres, arrays.position, middle, 0, near)
        + _operations_of(find_vectors, fibres, middle, vector, 0, near)
        + _operations_of(add_vectors, fibres, vector, arrays.corner_force, 0, near),
        # from the origin of the tool, whose axes are the global ones
        frame=3 + _operations_of(faces_level_part, tools.level_part[0], True, work),
        profile=profile,
        line=pieces[0],
        arc=pieces[1],
        corner=pieces[2],
        gap=_operations_of(find_gaps, arrays.offset, 0, SPAN, 0.0, 0.0, work),
        force=_operations_of(
            make_forces, model.environment, arrays.free, None, (0.0, 0.0, 0.0), 0.1, SPAN, 0.0, 0.0,
            work,
        ),
    )  # fmt: skip


if __name__ == "__main__":
    for option in NO_UNROLLING:
        llvm.set_option("lcmchain", option)
    print(json.dumps(_count_here()))
