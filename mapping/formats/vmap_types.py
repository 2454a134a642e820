"""Tables of VMAP's SYSTEM group: element types, integration types, units, and their columns.

Source: the numbers are those that the VMAP community's own library wrote into files of single
element types (linear and quadratic triangles to hexahedra, VMAP 0.5.2).
"""

from __future__ import annotations

from typing import NamedTuple

import h5py
import numpy as np

TEXT = h5py.string_dtype()
NUMBERS = h5py.vlen_dtype(np.dtype("<i4"))
REALS = h5py.vlen_dtype(np.dtype("<f8"))

ELEMENT = np.dtype([
    ("myIdentifier", "<i4"), ("myElementType", "<i4"), ("myCoordinateSystem", "<i4"),
    ("myMaterialType", "<i4"), ("mySectionType", "<i4"), ("myConnectivity", NUMBERS),
])  # fmt: skip
ELEMENT_TYPE = np.dtype([
    ("myIdentifier", "<i4"), ("myTypeName", TEXT), ("myTypeDescription", TEXT),
    ("myNumberOfNodes", "<i4"), ("myDimension", "<i4"), ("myShapeType", "<i4"),
    ("myInterpolationType", "<i4"), ("myIntegrationType", "<i4"),
    ("myNumberOfNormalComponents", "<i4"), ("myNumberOfShearComponents", "<i4"),
    ("myConnectivity", NUMBERS), ("myFaceConnectivity", NUMBERS),
])  # fmt: skip
INTEGRATION_TYPE = np.dtype([
    ("myIdentifier", "<i4"), ("myTypeName", TEXT), ("myNumberOfPoints", "<i4"),
    ("myDimension", "<i4"), ("myOffset", "<f8"), ("myAbscissas", REALS), ("myWeights", REALS),
    ("mySubTypes", NUMBERS),
])  # fmt: skip
SECTION = np.dtype([
    ("myIdentifier", "<i4"), ("myName", TEXT), ("myType", "<i4"), ("myMaterial", "<i4"),
    ("myCoordinateSystem", "<i4"), ("myIntegrationType", "<i4"), ("myThicknessType", "<i4"),
])  # fmt: skip
COORDINATE_SYSTEM = np.dtype([
    ("myIdentifier", "<i4"), ("myType", "<i4"), ("myReferencePoint", "<f8", (3,)),
    ("myAxisVectors", "<f8", (9,)),
])  # fmt: skip
UNIT_SYSTEM = np.dtype([
    ("myIdentifier", "<i4"), ("mySIScale", "<f8"), ("mySIShift", "<f8"), ("myUnitSymbol", TEXT),
    ("myUnitQuantity", TEXT),
])  # fmt: skip
UNIT = np.dtype([
    ("myIdentifier", "<i4"), ("myUnitSymbol", TEXT), ("myUnitDimension", "<i4", (7,)),
])  # fmt: skip
MATERIAL_PARAMETER = np.dtype([("NAME", TEXT), ("VALUE", TEXT), ("DESCRIPTION", TEXT)])

SI_UNITS = [
    (1, 1.0, 0.0, "m", "LENGTH"),
    (2, 1.0, 0.0, "kg", "MASS"),
    (3, 1.0, 0.0, "s", "TIME"),
    (4, 1.0, 0.0, "A", "ELECTRIC CURRENT"),
    (5, 1.0, 0.0, "K", "TEMPERATURE"),
    (6, 1.0, 0.0, "mol", "AMOUNT OF SUBSTANCE"),
    (7, 1.0, 0.0, "cd", "LUMINOUS INTENSITY"),
]

#: Derived units by their name in netCDF: number, symbol, powers of the seven above.
UNITS = {
    "m2": (8, ("m^2", (2, 0, 0, 0, 0, 0, 0))),
    "kg m-2": (9, ("kg/m^2", (-2, 1, 0, 0, 0, 0, 0))),
    "Pa": (10, ("Pa", (-1, 1, -2, 0, 0, 0, 0))),
    "rad": (11, ("rad", (0, 0, 0, 0, 0, 0, 0))),
}

#: Name, number of points, dimension, offset, places, weights and parts of the rule by its number.
#: Values of cells belong to the one point of their middle.
INTEGRATION_TYPES: dict[int, tuple] = {
    500: ("GAUSS_TRIANGLE_1", 1, 2, 0.0, [1 / 3, 1 / 3], [0.5], []),
    504: ("GAUSS_QUAD_1", 1, 2, 0.0, [0.0, 0.0], [4.0], []),
    800: ("GAUSS_TETRAHEDRON_1", 1, 3, 0.0, [0.25, 0.25, 0.25], [1 / 6], []),
    809: (
        "GAUSS_WEDGE_2", 2, 3, 0.0,
        [1 / 3, 1 / 3, -(3**-0.5), 1 / 3, 1 / 3, 3**-0.5], [0.5, 0.5], [],
    ),
    814: ("GAUSS_HEXAHEDRON_1", 1, 3, 0.0, [0.0, 0.0, 0.0], [8.0], []),
}  # fmt: skip

# Interpolation inside an element.
LINEAR, BILINEAR, TRILINEAR, QUADRATIC, BIQUADRATIC, TRIQUADRATIC = range(2, 8)


class ElementType(NamedTuple):
    """Type of an element in VMAP.

    faces : local nodes of each face; of a surface element, of each edge.
    """

    shape_name: str
    nodes: int
    shape: int
    interpolation: int
    integration: int
    faces: tuple[tuple[int, ...], ...]

    def row(self, identifier: int) -> tuple:
        """Row of the table of element types."""
        faces = [len(self.faces)]
        for face in self.faces:
            faces += [len(face), *face]
        description = f"lcmchain: {self.shape_name.lower()} with {self.nodes} nodes"
        # Surface elements lie in space, as shells do: three normal and three shear components.
        return (
            identifier, f"VMAP_ELEM_3D_{self.shape_name}_{self.nodes}", description, self.nodes, 3,
            self.shape, self.interpolation, self.integration, 3, 3, list(range(self.nodes)), faces,
        )  # fmt: skip


_TRIANGLE = ((0, 1), (1, 2), (2, 0))
_QUAD = ((0, 1), (1, 2), (2, 3), (3, 0))
_TETRA = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_WEDGE = ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0))
_HEXAHEDRON = (
    (0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0),
)  # fmt: skip

#: By meshio's name of the cell; both count the nodes in the same order.
ELEMENT_TYPES = {
    "triangle": ElementType("TRIANGLE", 3, 5, LINEAR, 500, _TRIANGLE),
    "triangle6": ElementType(
        "TRIANGLE", 6, 7, QUADRATIC, 500, ((0, 3, 1), (1, 4, 2), (2, 5, 0))
    ),
    "quad": ElementType("QUAD", 4, 8, BILINEAR, 504, _QUAD),
    "quad8": ElementType(
        "QUAD", 8, 9, BIQUADRATIC, 504, ((0, 4, 1), (1, 5, 2), (2, 6, 3), (3, 7, 0))
    ),
    "tetra": ElementType("TETRAHEDRON", 4, 11, LINEAR, 800, _TETRA),
    "tetra10": ElementType(
        "TETRAHEDRON", 10, 13, QUADRATIC, 800,
        ((0, 4, 1, 5, 2, 6), (0, 7, 3, 8, 1, 4), (1, 8, 3, 9, 2, 5), (2, 9, 3, 7, 0, 6)),
    ),
    "wedge": ElementType("WEDGE", 6, 18, LINEAR, 809, _WEDGE),
    "wedge15": ElementType(
        "WEDGE", 15, 19, QUADRATIC, 809,
        ((0, 6, 1, 7, 2, 8), (3, 11, 5, 10, 4, 9), (0, 12, 3, 9, 4, 13, 1, 6),
         (1, 13, 4, 10, 5, 14, 2, 7), (2, 14, 5, 11, 3, 12, 0, 8)),
    ),
    "hexahedron": ElementType("HEXAHEDRON", 8, 20, TRILINEAR, 814, _HEXAHEDRON),
    "hexahedron20": ElementType(
        "HEXAHEDRON", 20, 22, TRIQUADRATIC, 814,
        ((0, 8, 1, 9, 2, 10, 3, 11), (4, 15, 7, 14, 6, 13, 5, 12), (0, 16, 4, 12, 5, 17, 1, 8),
         (1, 17, 5, 13, 6, 18, 2, 9), (2, 18, 6, 14, 7, 19, 3, 10), (3, 19, 7, 15, 4, 16, 0, 11)),
    ),
}  # fmt: skip
