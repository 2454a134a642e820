"""Shapes of cells: names, corners, edges, and the order of mid-side nodes.

Names are meshio's, with the number of nodes behind the shape where it is more than the corners:
``hexahedron20``. Nodes are in VTK's order.

meshio 5.3.5 names the types 26, 27, 30, 31, 33 and 34 of VTK, and then fails to build a block of
them (``KeyError: 'wedge15'``), when it reads a file as well as when it writes one. Importing this
module adds what is missing; entries that meshio has, or comes to have, stay as they are.
"""

from __future__ import annotations

import numpy as np
from meshio._common import num_nodes_per_cell
from meshio._mesh import topological_dimension
from meshio._vtk_common import meshio_to_vtk_type

# Corner count of the cells that are understood; the further nodes of higher-order cells are kept
# in the file but play no part in the geometry.
SURFACE_CORNERS = {"triangle": 3, "quad": 4}
SOLID_CORNERS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}

#: Edges of the solids, in the order in which VTK lists their mid-side nodes.
SOLID_EDGES = {
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "pyramid": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "hexahedron": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
}
# Places of the edges of the upper face among those of a solid, from and to.
_UPPER_EDGES = {"hexahedron": (4, 8), "wedge": (3, 6)}

#: Faces of the solids, their normals outwards.
SOLID_FACES: dict[str, list[tuple[int, ...]]] = {
    "tetra": [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    "pyramid": [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
    "wedge": [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    "hexahedron": [
        *[(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)],
        *[(1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    ],
}


def base_type(name: str) -> str:
    """Cell shape of a meshio type: ``hexahedron20`` is a ``hexahedron``."""
    return name.rstrip("0123456789")


def corner_count(name: str) -> int:
    """Number of corners of a cell of a surface or a solid."""
    shape = base_type(name)
    return SURFACE_CORNERS.get(shape) or SOLID_CORNERS[shape]


def reordered(name: str, corners: list[int], edges: list[tuple[int, int]]) -> np.ndarray:
    """Places in a foreign order of nodes from which a solid in VTK's order takes its own.

    Parameters
    ----------
    name : of the cell type, without or with all mid-side nodes.
    corners : for each corner in VTK's order its place among the foreign corners.
    edges : foreign corners at the ends of each edge, as the foreign order lists the mid-side
        nodes behind the corners.
    """
    shape = base_type(name)
    order = list(corners)
    if name != shape:
        place = {frozenset(edge): len(corners) + k for k, edge in enumerate(edges)}
        order += [place[frozenset((corners[a], corners[b]))] for a, b in SOLID_EDGES[shape]]
    return np.array(order)


def edges_across_first(name: str, node_count: int) -> np.ndarray:
    """Places of VTK's nodes in the order of Exodus and CGNS.

    They list the mid-side nodes of the edges across before those of the upper face.

    Parameters
    ----------
    name : of the cell type. node_count : of a cell of the file, those in its faces too.
    """
    shape = base_type(name)
    if name == shape or shape not in SOLID_EDGES:
        return np.arange(node_count)
    edges = SOLID_EDGES[shape]
    if shape in _UPPER_EDGES:
        first, end = _UPPER_EDGES[shape]
        edges = [*edges[:first], *edges[end:], *edges[first:end]]
    return reordered(name, list(range(corner_count(name))), edges)


#: Types that meshio misses: dimension and number of nodes. Corners come first, as in VTK.
ADDED = {
    "triangle7": (2, 7),
    "quad6": (2, 6),
    "wedge12": (3, 12),
    "wedge15": (3, 15),
    "pyramid13": (3, 13),
    "hexahedron24": (3, 24),
}

for _name, (_dimension, _node_count) in ADDED.items():
    topological_dimension.setdefault(_name, _dimension)
    num_nodes_per_cell.setdefault(_name, _node_count)


def is_known_to_vtk(name: str) -> bool:
    """Whether VTK has a cell type for meshio's name, so that a VTU file can hold it whole."""
    return name in meshio_to_vtk_type
