"""Reading of target meshes: the reader of the file, the cells of the kind, their sets and parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.target.checks import require_whole_cells, warnings_about
from lcmchain.mapping.target.mesh import TargetMesh
from lcmchain.mesh_files import FileMesh, read_mesh_file
from lcmchain.mesh_files.file_mesh import NO_CELLS, NO_IDS
from lcmchain.mesh_files.length_unit import stated_unit_hint
from lcmchain.mesh_files.shapes import SOLID_CORNERS, SURFACE_CORNERS, base_type

KINDS = ("infiltration", "structure")


def read_target(path: Path | str, *, kind: str = "structure", length_unit: str = "m") -> TargetMesh:
    """Read a target mesh with the numbers, sets and parts of its file.

    Parameters
    ----------
    path : a deck of Abaqus, CalculiX, Nastran or LS-DYNA, a Universal file, a file of Gmsh, MED,
        NETGEN, CGNS or Exodus, or any other mesh file that meshio reads.
    kind : ``"infiltration"`` takes triangles and quadrilaterals; ``"structure"`` takes solids
        where the file has them (its surface cells are then boundary patches), else shells.
    length_unit : unit of the coordinates in the file.

    Raises
    ------
    InputError : the file is absent or unreadable, the unit is not a length, the file has no cells
        of the kind, or cells that are none: nodes that do not exist, no area or volume.
    """
    path = Path(path)
    if kind not in KINDS:
        raise InputError(f'kind is "{kind}"; write one of {", ".join(KINDS)}', file=path)
    mesh = read_mesh_file(path)
    chosen = _chosen(mesh, kind, path)
    points = _points_in_space(mesh.points, path) * _length_factor(length_unit, path)
    own_numbers = len(mesh.cell_ids) > 0
    ids = mesh.cell_ids if own_numbers else np.arange(mesh.cell_count)
    blocks = []
    for (name, nodes), rows in zip(mesh.blocks, _rows_of_blocks(mesh), strict=True):
        if len(rows) and chosen[rows[0]]:
            called = "element" if own_numbers else "cell"
            require_whole_cells(points, name, nodes, ids[rows], called, path)
            blocks.append((name, nodes))
    sets, moved = _sets_of_chosen(mesh, chosen)
    target = TargetMesh(
        points,
        tuple(blocks),
        _ignored(mesh, chosen),
        path,
        node_ids=mesh.node_ids if len(mesh.node_ids) else NO_IDS,
        cell_ids=mesh.cell_ids[chosen] if own_numbers else NO_IDS,
        cell_sets=sets,
        node_sets={**moved, **mesh.node_sets},
        parts={name: rows for name, rows in _renumbered(mesh.parts, chosen).items() if len(rows)},
        notes=(
            *mesh.notes,
            *_note_of_unit(mesh, length_unit),
            *mesh.notes_of_sets,
            *_note_of_moved(moved),
        ),
    )
    return target.with_notes(warnings_about(target))


def _rows_of_blocks(mesh: FileMesh) -> list[np.ndarray]:
    """Rows of the cells of each block."""
    ends = np.cumsum([len(nodes) for _, nodes in mesh.blocks])
    return np.split(np.arange(mesh.cell_count), ends[:-1]) if len(ends) else []


def _chosen(mesh: FileMesh, kind: str, path: Path) -> np.ndarray:
    """Whether each cell of the file receives fields, shape (C,)."""
    shapes = [base_type(name) for name, _ in mesh.blocks]
    sizes = [len(nodes) for _, nodes in mesh.blocks]
    solid = np.repeat([shape in SOLID_CORNERS for shape in shapes], sizes).astype(bool)
    surface = np.repeat([shape in SURFACE_CORNERS for shape in shapes], sizes).astype(bool)
    chosen = solid if kind == "structure" and solid.any() else surface
    if not chosen.any():
        names = {name for name, _ in mesh.blocks} | set(mesh.left_aside)
        if not names:
            raise InputError(NO_CELLS, file=path)
        wanted = "triangles or quadrilaterals" if kind == "infiltration" else "shells or solids"
        raise InputError(
            f"the mesh has no {wanted} to map onto (cell types found: {', '.join(sorted(names))})",
            file=path,
        )
    return chosen


def _ignored(mesh: FileMesh, chosen: np.ndarray) -> dict[str, int]:
    """Number of cells left aside by type."""
    ignored: dict[str, int] = {}
    for (name, nodes), rows in zip(mesh.blocks, _rows_of_blocks(mesh), strict=True):
        if len(rows) and not chosen[rows[0]]:
            ignored[name] = ignored.get(name, 0) + len(nodes)
    for name, count in mesh.left_aside.items():
        ignored[name] = ignored.get(name, 0) + count
    return ignored


def _renumbered(sets: dict[str, np.ndarray], chosen: np.ndarray) -> dict[str, np.ndarray]:
    """Sets of the chosen cells, by their rows among these."""
    row = np.cumsum(chosen) - 1
    return {name: row[rows[chosen[rows]]] for name, rows in sets.items()}


def _sets_of_chosen(
    mesh: FileMesh, chosen: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Sets of the chosen cells, and of the nodes of the others: an edge, a patch of the skin."""
    kept = _renumbered(mesh.cell_sets, chosen)
    moved: dict[str, np.ndarray] = {}
    blocks = list(zip(mesh.blocks, _rows_of_blocks(mesh), strict=True))
    for name, rows in {**mesh.parts, **mesh.cell_sets}.items():
        others = rows[~chosen[rows]]
        if len(others) == 0:
            continue
        nodes = [cells[np.isin(own, others)].reshape(-1) for (_, cells), own in blocks]
        found = np.unique(np.concatenate(nodes))
        free = name if name not in mesh.node_sets else f"{name} (cells)"
        moved[free] = found
        if len(others) == len(rows):
            kept.pop(name, None)
    return kept, moved


def _note_of_moved(moved: dict[str, np.ndarray]) -> list[str]:
    if not moved:
        return []
    names = ", ".join(list(moved)[:8]) + (", ..." if len(moved) > 8 else "")
    return [f"sets and parts of cells left aside are kept as the sets of their nodes: {names}"]


def _note_of_unit(mesh: FileMesh, length_unit: str) -> list[str]:
    hint = stated_unit_hint(mesh.unit, length_unit)
    return [] if hint is None else [hint]


def _points_in_space(points: np.ndarray, path: Path) -> np.ndarray:
    """Points with three coordinates, shape (N, 3); those of a plane mesh have z = 0."""
    given = np.asarray(points)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or given.dtype.kind not in "fiu":
        raise InputError("the mesh has no nodes with x, y and z", file=path)
    placed = np.zeros((len(given), 3))
    placed[:, : given.shape[1]] = given
    return placed


def _length_factor(length_unit: str, path: Path) -> float:
    if length_unit == "m":
        return 1.0  # spares the time to set up a table of units
    from lcmchain.quantities.units import QuantityError, length_factor

    try:
        return length_factor(length_unit)
    except QuantityError as error:
        raise InputError(f"length_unit: {error}", file=path) from None
