"""VMAP: the vendor-neutral HDF5 file of the VMAP Standards Community, version 0.5.2 of its layout.

Source: VMAP Standard Specifications (vmap-standard.org), and files that the community's own
library wrote of single element types (linear and quadratic triangles to hexahedra), for the numbers
of element and integration types.
"""

from __future__ import annotations

from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.formats.format import ExportReport, Loss, MappedCells, Saver, worst
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.mapping.surfaces.averages import perpendicular_family_error

NAME = "vmap"

GEOMETRY = "1"
STATE = "STATE-1"

# Where values lie, and what they are made of.
ON_ELEMENTS = 3
REAL = 1

LARGEST_IDENTIFIER = np.iinfo(np.int32).max


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write mesh, sets, both fibre directions and every other field of the cells.

    The coordinate system of an element has the first fibre direction as its first axis and the
    normal of the sheet as its third one.

    Raises
    ------
    InputError : no fibre directions, cells of a type that VMAP does not name, or numbers of cells
        or nodes beyond 32 bits.
    """
    target = cells.target
    families = _with_plane(cells, cells.families(NAME))
    for what, numbers in (("cell", target.cell_ids), ("node", target.node_ids)):
        if numbers.max(initial=0) > LARGEST_IDENTIFIER:
            raise InputError(
                f"the {what} number {numbers.max()} does not fit into the 32 bits of VMAP",
                file=target.file,
            )
    unknown = sorted({name for name, _ in target.blocks} - set(ELEMENT_TYPES))
    if unknown:
        raise InputError(
            f"VMAP has no element type for cells of the type {', '.join(unknown)}; mesh the "
            f"target with {', '.join(ELEMENT_TYPES)}",
            file=target.file,
        )
    return partial(_write, path, cells, families)


def _with_plane(
    cells: MappedCells, families: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return two directions (C, 3) that span the sheet: both families, or one and that across it.

    Raises
    ------
    InputError : a single family in solids, which have no normal.
    """
    if len(families) > 1:
        return families[0], families[1]
    cells.require_shells(f"{NAME} of a fabric with one family")
    return families[0], np.cross(cells.normals, families[0])


def _write(path: Path, cells: MappedCells, families: tuple[np.ndarray, np.ndarray]) -> ExportReport:
    # Families that lie on each other span no plane (not a number, too, is not above nought).
    spanned = np.linalg.norm(np.cross(*families), axis=1) > 0.0
    oriented = cells.mapped & spanned
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        root = file.create_group("VMAP")
        root.attrs["VERSION"] = np.array(
            (0, 5, 2), dtype=[("myMajor", "<i4"), ("myMinor", "<i4"), ("myPatch", "<i4")]
        )
        _write_geometry(root.create_group(f"GEOMETRY/{GEOMETRY}"), cells, oriented)
        _write_material(root.create_group("MATERIAL"), cells)
        _write_system(root.create_group("SYSTEM"), cells, families, oriented)
        _write_variables(root.create_group(f"VARIABLES/{STATE}"), cells)
    dropped = worst(
        "an element's coordinate system is orthonormal, so that a reader that takes it alone has "
        "the second family perpendicular to the first (both directions are variables of the file)",
        perpendicular_family_error(*families),
        cells.target.cell_ids,
        unit="rad",
    )
    losses = [dropped] if FIBRE_FAMILIES[1] in cells.vectors else []
    return ExportReport(
        NAME,
        [path.name],
        int(cells.mapped.sum()),
        [*losses, *_unmapped(cells)],
        details={"geometry": GEOMETRY, "state": STATE},
    )


def _unmapped(cells: MappedCells) -> list[Loss]:
    count = int((~cells.mapped).sum())
    return [Loss(f"{count} unmapped cells are in the mesh and in no variable")] if count else []


def _write_geometry(group: h5py.Group, cells: MappedCells, oriented: np.ndarray) -> None:
    target = cells.target
    group.attrs["MYNAME"] = _fixed_text(target.file.stem if target.file else "target")
    points = group.create_group("POINTS")
    points.attrs["MYSIZE"] = np.uint64(len(target.points))
    points.attrs["MYCOORDINATESYSTEM"] = np.int32(GLOBAL)
    points["MYCOORDINATES"] = np.asarray(target.points, dtype="<f8")
    points["MYIDENTIFIERS"] = target.node_ids.astype("<i4")[:, None]

    rows = np.empty((target.cell_count, 1), dtype=ELEMENT)
    rows["myIdentifier"][:, 0] = target.cell_ids
    rows["myCoordinateSystem"][:, 0] = np.where(
        oriented, GLOBAL + 1 + np.arange(target.cell_count), GLOBAL
    )
    rows["myMaterialType"], rows["mySectionType"] = MATERIAL, ONLY_SECTION
    first = 0
    for number, (_, nodes) in enumerate(target.blocks):
        block = slice(first, first + len(nodes))
        rows["myElementType"][block] = number
        for row, of_cell in zip(rows["myConnectivity"][block], nodes, strict=True):
            row[0] = target.node_ids[of_cell].astype("<i4")
        first += len(nodes)
    elements = group.create_group("ELEMENTS")
    elements.attrs["MYSIZE"] = np.uint64(target.cell_count)
    elements.create_dataset("MYELEMENTS", data=rows, dtype=ELEMENT)

    sets = group.create_group("GEOMETRYSETS")
    found = [
        *((name, 0, target.node_ids[rows_]) for name, rows_ in target.node_sets.items()),
        *((name, 1, target.cell_ids[rows_]) for name, rows_ in target.cell_sets.items()),
        *(
            (name, 1, target.cell_ids[rows_])
            for name, rows_ in target.parts.items()
            if name not in target.cell_sets
        ),
    ]
    sets.attrs["MYSIZE"] = np.int32(len(found))
    for number, (name, kind, ids) in enumerate(found):
        one = sets.create_group(f"{number:06d}")
        one.attrs["MYIDENTIFIER"] = np.int32(number)
        one.attrs["MYSETINDEXTYPE"] = np.int32(1)  # members are given by their identifiers
        one.attrs["MYSETNAME"] = _fixed_text(name)
        one.attrs["MYSETTYPE"] = np.int32(kind)  # 0 nodes, 1 elements
        one["MYGEOMETRYSETDATA"] = ids.astype("<i4")[:, None]


def _write_variables(state: h5py.Group, cells: MappedCells) -> None:
    time = 0.0 if cells.time is None else cells.time
    state.attrs["MYSTATEINCREMENT"] = np.int32(0)
    state.attrs["MYSTATENAME"] = _fixed_text("formed")
    state.attrs["MYSTEPTIME"], state.attrs["MYTOTALTIME"] = time, time
    group = state.create_group(GEOMETRY)
    fields = {
        **{name: values[:, None] for name, values in cells.scalars.items()},
        **{name: cells.vectors[name] for name in _families_first(cells)},
    }
    number = 0
    for name, values in fields.items():
        known = np.isfinite(values).all(axis=1)
        if not known.any():
            continue
        number += 1
        component = name if name in cells.scalars else f"{name}_x"
        about = cells.attributes.get(component, {})
        unit = str(about.get("units", "1"))
        variable = group.create_group(name.upper())
        attributes: dict[str, Any] = {
            "MYCOORDINATESYSTEM": np.int32(-1),  # components along the global axes
            "MYDIMENSION": np.int32(values.shape[1]),
            "MYENTITY": np.int32(REAL),
            "MYIDENTIFIER": np.int32(number),
            "MYINCREMENTVALUE": np.int32(0),
            "MYLOCATION": np.int32(ON_ELEMENTS),
            "MYMULTIPLICITY": np.int32(1),
            "MYTIMEVALUE": time,
            "MYUNIT": np.int32(_unit_number(unit)),
            "MYVARIABLEDEPENDENCY": _fixed_text(" "),
            "MYVARIABLEDESCRIPTION": _fixed_text(f"{about.get('long_name', name)} [{unit}]"),
            "MYVARIABLENAME": _fixed_text(name.upper()),
        }
        for key, value in attributes.items():
            variable.attrs[key] = value
        variable["MYGEOMETRYIDS"] = cells.target.cell_ids[known].astype("<i4")[:, None]
        variable["MYVALUES"] = values[known].astype("<f8")
    group.attrs["MYSIZE"] = np.int32(number)


def _families_first(cells: MappedCells) -> list[str]:
    others = [name for name in cells.vectors if name not in FIBRE_FAMILIES]
    return [*(name for name in FIBRE_FAMILIES if name in cells.vectors), *others]


# --- the groups MATERIAL and SYSTEM: types, units and the axes of every element -------------------

# Identifiers of the only material and section, and of the global coordinate system.
MATERIAL, ONLY_SECTION, GLOBAL = 0, 0, 1

# An orthonormal coordinate system, given by its origin and three axes.
CARTESIAN = 2


def _write_material(group: h5py.Group, cells: MappedCells) -> None:
    """Write the textile as the only material, with what the run says of it."""
    name = str(cells.provenance.get("material") or "textile")
    material = group.create_group(name.replace("/", "_"))
    material.attrs["MYIDENTIFIER"] = np.int32(MATERIAL)
    description = {
        "MYNAME": name,
        "MYDESCRIPTION": "formed textile",
        "MYSTATE": "solid",
        "MYSUPPLIER": "",
        "MYTYPE": "dry textile",
    }
    for key, text in description.items():
        material.attrs[key] = _fixed_text(text)
    card = material.create_group("MATERIALCARD")
    about = {
        "MYIDEALISATION": "shell" if not cells.target.is_solid else "solid",
        "MYIDENTIFIER": name,
        "MYMODELNAME": name,
        "MYPHYSICS": "solid_mechanics",
        "MYSOLUTION": "explicit FEM",
        "MYSOLVER": "lcmchain",
        "MYSOLVERVERSION": str(cells.provenance.get("source", "")),
        "MYUNITSYSTEM": "m kg s A K mol cd",
    }
    for key, text in about.items():
        card.attrs[key] = _fixed_text(text)
    parameters = [
        (key, str(cells.provenance[key]), text)
        for key, text in (
            ("areal_mass_kg_m2", "areal mass of the unformed textile [kg/m2]"),
            ("fibre_density_kg_m3", "density of the fibres [kg/m3]"),
        )
        if key in cells.provenance
    ]
    _table(card, "PARAMETERS", MATERIAL_PARAMETER, parameters)


def _write_system(
    group: h5py.Group,
    cells: MappedCells,
    families: tuple[np.ndarray, np.ndarray],
    oriented: np.ndarray,
) -> None:
    """Write the types of elements, units, origin of the file, and one frame per oriented element.

    oriented : whether a cell has both fibre directions, shape (C,).
    """
    used = [name for name, _ in cells.target.blocks]
    _table(group, "ELEMENTTYPES", ELEMENT_TYPE, [
        ELEMENT_TYPES[name].row(number) for number, name in enumerate(used)
    ])  # fmt: skip
    integration = dict.fromkeys(ELEMENT_TYPES[name].integration for name in used)
    _table(group, "INTEGRATIONTYPES", INTEGRATION_TYPE,
           [(key, *INTEGRATION_TYPES[key]) for key in integration])  # fmt: skip
    _table(group, "SECTION", SECTION,
           [(ONLY_SECTION, "formed sheet", 1, MATERIAL, -1, -1, -1)])  # fmt: skip
    _table(group, "UNITSYSTEM", UNIT_SYSTEM, SI_UNITS)
    _table(group, "UNITS", UNIT, [(key, *about) for key, about in UNITS.values()])
    now = datetime.now(UTC)
    description = cells.provenance.get("title", "mapped forming fields")
    about = [
        ("ExporterName", str(cells.provenance.get("source", "lcmchain"))),
        ("FileDate", f"{now:%Y-%m-%d}"),
        ("FileTime", f"{now:%H:%M:%S}"),
        ("Description", f"{description}; SI units"),
        ("Analysis Type", "forming, mapped"),
        ("User Id", ""),
    ]
    group.create_dataset("METADATA", data=np.array(about, dtype=object), dtype=TEXT)

    rows = np.zeros((1 + int(oriented.sum()), 1), dtype=COORDINATE_SYSTEM)
    rows["myType"] = CARTESIAN
    rows["myIdentifier"][0], rows["myAxisVectors"][0, 0] = GLOBAL, np.eye(3).ravel()
    rows["myIdentifier"][1:, 0] = GLOBAL + 1 + np.flatnonzero(oriented)
    rows["myReferencePoint"][1:, 0] = cells.target.centroids[oriented]
    axes = _axes(cells, families[0][oriented], families[1][oriented], oriented)
    rows["myAxisVectors"][1:, 0] = axes.reshape(-1, 9)
    group.create_dataset("COORDINATESYSTEM", data=rows, dtype=COORDINATE_SYSTEM)


def _axes(
    cells: MappedCells, first: np.ndarray, second: np.ndarray, oriented: np.ndarray
) -> np.ndarray:
    """Orthonormal axes, one a row, shape (M, 3, 3): first family, across it, normal."""
    if cells.target.is_solid:
        normal = np.cross(first, second)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
    else:
        normal = cells.normals[oriented]
    return np.stack([first, np.cross(normal, first), normal], axis=1)


def _unit_number(unit: str) -> int:
    """Return the identifier of a unit in the file; -1 of a number without one."""
    for number, _, _, symbol, _ in SI_UNITS:
        if symbol == unit:
            return number
    return UNITS[unit][0] if unit in UNITS else -1


def _table(group: h5py.Group, name: str, dtype: np.dtype, rows: list[tuple]) -> None:
    """One compound dataset of a column, shape (M, 1); lists become arrays of the column's type."""
    table = np.empty((len(rows), 1), dtype=dtype)
    lists = [h5py.check_vlen_dtype(dtype[column]) for column in dtype.names or ()]
    for row, values in enumerate(rows):
        table[row, 0] = tuple(
            np.array(value, dtype=of_list) if isinstance(value, list) else value
            for value, of_list in zip(values, lists, strict=True)
        )
    group.create_dataset(name, data=table, dtype=dtype)


def _fixed_text(text: str) -> np.bytes_:
    """Return a text as the attributes of VMAP hold it."""
    # A fixed text of length nought is none in HDF5; the community's library writes a blank.
    return np.bytes_((text or " ").encode("utf-8"))


# --- tables: columns, units, types of integration and of elements ---------------------------------

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
