"""Distances between tools and blank before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.scene import Scene, Tool
from lcmchain.tools.distance import gaps as node_gaps
from lcmchain.tools.table import ToolTable

#: Deepest overlap of a tool with the blank that still counts as touching, in parts of thickness.
OVERLAP_TOLERANCE = 0.01


@dataclass(frozen=True)
class InitialGap:
    """Smallest distance between a tool and the blank before anything moves.

    Parameters
    ----------
    tool : name of the tool.
    gap : signed distance of the nearest node [m], negative inside the tool.
    position : that node [m].
    """

    tool: str
    gap: float
    position: tuple[float, float, float]


def initial_gaps(
    tools: Sequence[Tool], blank: BlankMesh, tool_table: ToolTable
) -> list[InitialGap]:
    """Measure the smallest distance of every tool to the blank's nodes before anything moves."""
    positions = np.ascontiguousarray(blank.node_positions, dtype=np.float64)
    nearest = []
    for index, tool in enumerate(tools):
        gaps = node_gaps(tool_table, index, positions, 0.0)
        node = int(np.argmin(gaps))
        nearest.append(InitialGap(tool.name, float(gaps[node]), tuple(positions[node].tolist())))
    return nearest


def require_no_initial_overlap(
    scene: Scene, blank: BlankMesh, tool_table: ToolTable
) -> list[InitialGap]:
    """Stop when a tool reaches into the blank at the start, deeper than 1 % of the thickness.

    Such a tool would push the blank away with a jump of contact force that no process has.

    Parameters
    ----------
    scene : validated scene.
    blank : its mesh.
    tool_table : its tools, in the order of ``scene.tools``.

    Returns
    -------
    The smallest gap of every tool.

    Raises
    ------
    InputError : names every tool that overlaps, the depth and the place.
    """
    gaps = initial_gaps(scene.tools, blank, tool_table)
    tolerance = OVERLAP_TOLERANCE * scene.material.thickness
    sentences = []
    keys = []
    for index, gap in enumerate(gaps):
        if gap.gap >= -tolerance:
            continue
        x, y, z = (1e3 * coordinate for coordinate in gap.position)
        keys.append(f'tools[{index}] "{gap.tool}".position')
        sentences.append(
            f"the tool reaches {-1e3 * gap.gap:.3g} mm into the blank at the start, deepest at "
            f"({x:.4g}, {y:.4g}, {z:.4g}) mm; the blank lies between z = "
            f"{1e3 * (scene.blank.height - scene.material.thickness / 2):.4g} mm and "
            f"{1e3 * (scene.blank.height + scene.material.thickness / 2):.4g} mm. Move the tool, "
            "or set blank.height"
        )
    if len(keys) == 1:
        raise InputError(sentences[0], key=keys[0])
    if keys:
        lines = "".join(f"\n  {key}: {text}" for key, text in zip(keys, sentences))
        raise InputError(f"{len(keys)} tools overlap the blank at the start:{lines}", key="tools")
    return gaps
