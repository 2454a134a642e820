"""Tools that reach into the blank at the start by less than counts: they begin at a touch.

Positions of tools are typed with a few digits, and surfaces of files are facets: what is meant to
touch overlaps by micrometres. Its contact springs would hold energy that nobody put in, and push
the sheet away at the first step. The overlap is taken for zero instead, during the whole run: as if
the surface of the tool lay deeper by it.
"""

from __future__ import annotations

import numpy as np

from lcmchain.tools.distance import gaps
from lcmchain.tools.table import ToolTable

#: Deepest overlap of a tool with the blank that still counts as touching, in parts of thickness.
OVERLAP_TOLERANCE = 0.01
#: Overlap in parts of thickness that is rounding, and too little to hold any energy.
ROUNDING = 1e-6


def without_initial_overlap(
    tools: ToolTable, positions: np.ndarray, offset: np.ndarray, thickness: float
) -> ToolTable:
    """Return tools whose overlap with nodes at the start, where it counts as a touch, is no force.

    Parameters
    ----------
    tools : at their start; positions : of the nodes [m], shape [node_count, 3].
    offset : distance of the sheet's surface from the nodes [m], shape [node_count].
    thickness : of the sheet [m]; deeper overlaps than its tolerated part are left as they are.
    """
    positions = np.ascontiguousarray(positions, dtype=float)
    overlap = np.zeros(tools.kind.size)
    for tool in range(tools.kind.size):
        deepest = -float((gaps(tools, tool, positions, 0.0) - offset).min())
        if ROUNDING * thickness < deepest <= OVERLAP_TOLERANCE * thickness:
            overlap[tool] = deepest
    return tools._replace(initial_overlap=overlap)
