"""Operations of the parts of a step, counted in their compiled code.

Each part is compiled once more for numbers instead of vectors, in a process of its own: then every
instruction of its loop over elements or nodes is one operation of one of them. What is written for
packs of nodes stays packed: there an instruction is one of as many nodes as its registers hold. A
fused multiply-add counts as two, as in the largest rate of the machine it is compared with.
Comparisons and choices are none.
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
from numba import njit, typeof, types
from numba.core.dispatcher import Dispatcher

from lcmchain.bench.hemisphere import SCENE
from lcmchain.effects.fibre_bending import bend
from lcmchain.elements.blocks import PACKS_OF_CHUNK
from lcmchain.elements.solid_shell.kernel import element_forces
from lcmchain.errors import SimulationError
from lcmchain.packs import PACK, pack
from lcmchain.scene import scene_from_text
from lcmchain.solver.interactions.contact_forces import PackOfNodes, press, rub
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.distance import gaps
from lcmchain.tools.pack_distance import (
    closer_arc,
    closer_corner,
    closer_line,
    faces_level_part,
    profile_distances,
)
from lcmchain.tools.profiles import ARC, BEGIN, CORNER_COLUMNS, DEPTH, END, HEIGHT
from lcmchain.tools.table import ToolTable

#: Of one number each, on x86: arithmetic, square roots, the larger or smaller of two.
SINGLE = re.compile(r"\sv?(?:add|sub|mul|div|sqrt|max|min)sd\s")
FUSED = re.compile(r"\svfn?m(?:add|sub)(?:132|213|231)sd\s")
#: The same of packed numbers, with the first letter of the registers.
PACKED = re.compile(r"\sv?(?:add|sub|mul|div|sqrt|max|min)pd\s[^\n]*%([xyz])mm")
PACKED_FUSED = re.compile(r"\svfn?m(?:add|sub)(?:132|213|231)pd\s[^\n]*%([xyz])mm")
WIDTH = {"x": 2, "y": 4, "z": 8}
NO_VECTORS = {"NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
# Several turns of a loop in one would count as often.
NO_UNROLLING = ("--unroll-allow-partial=0", "--unroll-runtime=0")


class Operations(NamedTuple):
    """Operations of the loops of a step of MD600 on a flat sheet.

    kernel : per element. bending : of the fibres, per mid-surface node.
    Of contact, per node of a pack near a tool: frame : to that of the tool, and whether its level
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
            encoding="utf-8",
            errors="replace",
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


def counted_of_packs(assembly: str) -> int:
    """Return the operations per node in x86 code for packs of them."""
    once = sum(WIDTH[register] for register in PACKED.findall(assembly))
    twice = sum(WIDTH[register] for register in PACKED_FUSED.findall(assembly))
    return (once + 2 * twice) // PACK


def contact_operations(simulation: Simulation, operations: Operations) -> float:
    """Return the operations of the contact with revolved tools, of a step at the present state."""
    arrays, table = simulation.arrays, simulation.model.tools
    position, total = np.ascontiguousarray(arrays.position.T), 0
    for tool in range(table.kind.size):
        pieces = table.segments[table.segment_start[tool] : table.segment_start[tool + 1], 0]
        arcs = int(np.sum(pieces == ARC))
        corners = int(table.corner_start[tool + 1] - table.corner_start[tool])
        profile = operations.profile + operations.arc * arcs + operations.corner * corners
        profile += operations.line * (pieces.size - arcs)
        travel = float(arrays.tool_travel[tool])
        gap = gaps(table, tool, position, travel) - (arrays.offset - table.initial_overlap[tool])
        level = _near_level_part(table, tool, position, travel)
        for number in np.flatnonzero(arrays.near_pack[:, tool]).tolist():
            chunk, place = divmod(number, PACKS_OF_CHUNK)
            begin = int(arrays.chunk_start[chunk]) + place * PACK
            own = slice(begin, min(begin + PACK, int(arrays.chunk_start[chunk + 1])))
            total += operations.frame + operations.gap
            total += 0 if level[own].all() else profile
            total += operations.force if (gap[own] < 0.0).any() else 0
    return float(PACK * total)


def _near_level_part(
    table: ToolTable, tool: int, position: np.ndarray, travel: float
) -> np.ndarray:
    """Tell which nodes lie nearer to the level part of a revolved tool than to any other part."""
    part = table.level_part[tool]
    x, y, z = (position - table.origin[tool] - travel * table.direction[tool]).T
    away, across = np.abs(z - part[HEIGHT]), np.hypot(x, y)
    found: np.ndarray = (
        (across > part[BEGIN] + away) & (across < part[END] - away) & (away < part[DEPTH])
    )
    return found


def _operations_of(function: Dispatcher, *arguments: object) -> int:
    """Return the operations in the code of a function, compiled for such arguments."""
    # code loaded from the disk cache cannot be inspected
    left_out = ("nopython", "forceinline")
    options = {k: v for k, v in function.targetoptions.items() if k not in left_out}
    options |= {"parallel": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    fresh = njit(**options)(function.py_func)
    kinds = [one if isinstance(one, types.Type) else typeof(one) for one in arguments]
    fresh.compile(tuple(kinds))
    (assembly,) = fresh.inspect_asm().values()
    in_packs = any(pack in (kind, getattr(kind, "dtype", None)) for kind in kinds)
    return counted_of_packs(assembly) if in_packs else counted(assembly)


def operations_of_pieces(tools: ToolTable) -> list[int]:
    """Return the operations of a line, an arc and a corner of a profile, per node."""
    piece, corner, best = tools.segments[0], np.zeros(CORNER_COLUMNS), types.UniTuple(pack, 5)
    return [
        _operations_of(closer_line, piece, pack, pack, best),
        _operations_of(closer_arc, piece, pack, pack, best),
        _operations_of(closer_corner, corner, pack, pack, best),
    ]


def _count_here() -> Operations:
    """Count with the compiler options of this process."""
    simulation = Simulation.from_scene(scene_from_text(SCENE))
    arrays, model = simulation.arrays, simulation.model
    data, tools = model.only_body().data, model.tools
    assert model.fibre_bending is not None
    fibres = model.fibre_bending.data
    assert fibres is not None
    vector = types.UniTuple(pack, 3)
    nodes = types.NamedTuple((vector, pack, types.float64, pack, pack, pack), PackOfNodes)
    pieces = operations_of_pieces(tools)
    # that of all profiles holds the code of every piece once
    profile = _operations_of(profile_distances, tools, 0, True, vector) - sum(pieces)
    return Operations(
        kernel=_operations_of(
            element_forces, arrays.position, data.corner_node, data.corner_run, data.element_data,
            arrays.corner_force, arrays.history, data.law, data.options, data.quick_data,
            data.quick_options, data.general, 0.0, 0.0,
        ),
        # with the middle between two nodes, and the sums of four vectors that come and four sent
        bending=_operations_of(bend, fibres.constants, 0, *[vector] * 5) + 6 + 24,
        # from the origin of the tool, whose axes are the global ones
        frame=3 + _operations_of(faces_level_part, tools.level_part[0], True, vector),
        profile=profile,
        line=pieces[0],
        arc=pieces[1],
        corner=pieces[2],
        # less the offset of the node and the overlap at the start
        gap=2,
        force=_operations_of(press, nodes, vector, pack, vector, vector, vector, 0.0, 0.0)
        + _operations_of(rub, nodes, pack, vector, pack, vector, vector, 0.0),
    )  # fmt: skip


if __name__ == "__main__":
    for option in NO_UNROLLING:
        llvm.set_option("lcmchain", option)
    print(json.dumps(_count_here()))
