"""Cell types that meshio names by their number in VTK and misses in its other tables.

meshio 5.3.5 maps VTK's types 26, 27, 30, 31, 33 and 34 to names, and then fails to build a block of
them (``KeyError: 'wedge15'``), when it reads a file as well as when it writes one. Importing this
module adds what is missing; entries that meshio has, or comes to have, stay as they are.
"""

from __future__ import annotations

from meshio._common import num_nodes_per_cell
from meshio._mesh import topological_dimension
from meshio._vtk_common import meshio_to_vtk_type

#: Dimension and number of nodes of each type. Corners come first, as in VTK.
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
