"""Read a target mesh, choose the cells that receive fields, and say what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.target.mesh import TargetMesh
from lcmchain.mesh_files import FileMesh, read_mesh_file
from lcmchain.mesh_files.file_mesh import NO_CELLS, NO_IDS
from lcmchain.mesh_files.length_unit import stated_unit_hint
from lcmchain.mesh_files.shapes import (
    SOLID_CORNERS,
    SOLID_FACES,
    SURFACE_CORNERS,
    base_type,
    corner_count,
)
from lcmchain.quantities.units import QuantityError, length_factor

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
            _require_whole_cells(points, name, nodes, ids[rows], called, path)
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
    return target.with_notes(_warnings_about(target))


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
    try:
        return length_factor(length_unit)
    except QuantityError as error:
        raise InputError(f"length_unit: {error}", file=path) from None


# --- cells that are none, and what makes a mapping doubtful ---------------------------------------

# A cell that is thinner than this part of its length is none.
FLATNESS = 1e-7

# Farthest place of a node [m] that squares and products of lengths can be computed with.
FARTHEST = 1e9


def _require_whole_cells(
    points: np.ndarray, name: str, cells: np.ndarray, ids: np.ndarray, called: str, path: Path
) -> None:
    """Refuse cells of a block that are none.

    Parameters
    ----------
    points : node positions [m], shape (N, 3). name : type of the cells.
    cells : rows of their nodes, shape (C, K). ids : numbers to name them by, shape (C,).
    called : what the numbers count, ``"element"`` of the file or ``"cell"``.

    Raises
    ------
    InputError : nodes that do not exist or lie nowhere, no area or volume.
    """

    def refuse(wrong: np.ndarray | np.bool, what: str) -> None:
        if wrong.any():
            numbers = ids[np.flatnonzero(wrong)]
            raise InputError(
                f"{len(numbers)} {name} cells have {what} ({_few(called, numbers)}); the mesh is "
                "broken, export or mesh it again",
                file=path,
            )

    if cells.ndim != 2 or cells.shape[1] < corner_count(name):
        raise InputError(f"{name} cells have too few nodes; the mesh is broken", file=path)
    refuse(((cells < 0) | (cells >= len(points))).any(axis=1), "nodes that do not exist")
    corners = points[cells[:, : corner_count(name)]]
    refuse(~np.isfinite(corners).all(axis=(1, 2)), "nodes at places that are not finite")
    refuse((np.abs(corners) > FARTHEST).any(axis=(1, 2)), f"nodes beyond {FARTHEST:g} m")
    offset = corners - corners.mean(axis=1, keepdims=True)
    if base_type(name) in SOLID_CORNERS:
        spread = np.linalg.eigvalsh(np.einsum("cki,ckj->cij", offset, offset))
        refuse(spread[:, 0] <= FLATNESS**2 * spread[:, 2], "no volume")
        # Solids between two copies of a curved surface are not flat and yet hold nothing.
        size = np.linalg.norm(offset, axis=2).max(axis=1)
        refuse(np.abs(_volumes(name, offset)) <= FLATNESS * size**3, "no volume")
    else:
        doubled = np.cross(offset[:, 2] - offset[:, 0], offset[:, -1] - offset[:, 1])
        size = np.linalg.norm(offset, axis=2).max(axis=1)
        refuse(np.linalg.norm(doubled, axis=1) <= FLATNESS * size**2, "no area")


def _warnings_about(target: TargetMesh) -> list[str]:
    """Return sentences about what makes a mapping onto this mesh doubtful, with the remedy."""
    return [
        *_doubled_cells(target),
        *(_of_solids(target) if target.is_solid else _of_shells(target)),
    ]


def _doubled_cells(target: TargetMesh) -> Iterable[str]:
    _, first, counts = np.unique(
        np.sort(target.corners, axis=1), axis=0, return_index=True, return_counts=True
    )
    if (counts > 1).any():
        doubled = target.cell_ids[np.sort(first[counts > 1])]
        yield (
            f"{int((counts - 1)[counts > 1].sum())} cells have the same nodes as others "
            f"({_few('number', doubled)}): each receives the whole fibre mass; delete one of each"
        )


def _of_shells(target: TargetMesh) -> Iterable[str]:
    """Edges with more than two cells, and neighbours with opposite normals."""
    faces = target.corners
    closed = np.where(faces < 0, faces[:, 2:3], faces)
    ends = np.stack([closed, np.roll(closed, -1, axis=1)], axis=2).reshape(-1, 2)
    real = ends[:, 0] != ends[:, 1]
    owner = np.repeat(np.arange(len(faces)), faces.shape[1])[real]
    ends = ends[real]
    forwards = ends[:, 0] < ends[:, 1]
    _, edge, counts = np.unique(
        np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    edge = edge.reshape(-1)
    many = counts > 2
    if many.any():
        cells = target.cell_ids[np.unique(owner[many[edge]])]
        yield (
            f"{int(many.sum())} edges have more than two cells, as ribs or doubled layers do "
            f"({_few('number', cells)}): every cell takes what lies over it; map the layers apart, "
            "or leave out of the mesh what is not of this sheet"
        )
    turns = np.bincount(edge, weights=np.where(forwards, 1.0, -1.0), minlength=len(counts))
    turned = (counts == 2) & (turns != 0.0)
    if turned.any():
        cells = target.cell_ids[np.unique(owner[turned[edge]])]
        yield (
            f"neighbouring cells have opposite normals at {int(turned.sum())} edges "
            f"({_few('number', cells)}): what follows the normal, as the sign of the shear angle, "
            "changes there; turn the normals of the mesh to one side"
        )


def _volumes(name: str, offset: np.ndarray) -> np.ndarray:
    """Return the volumes of solids [m^3], (C,), from their corners less their middles, (C, K, 3).

    It is negative where a solid is inside out.
    """
    volume = np.zeros(len(offset))
    for face in SOLID_FACES[base_type(name)]:
        a, b, c, d = (offset[:, face[k if k < len(face) else -1]] for k in range(4))
        volume += np.einsum("ci,ci->c", np.cross(c - a, d - b), a + b + c + d) / 24.0
    return volume


def _of_solids(target: TargetMesh) -> Iterable[str]:
    """Solids with a negative volume, and faces with more than two of them."""
    volumes, faces, owners = [], [], []
    first = 0
    for name, cells in target.blocks:
        corners = target.points[cells[:, : corner_count(name)]]
        volumes.append(_volumes(name, corners - corners.mean(axis=1, keepdims=True)))
        for face in SOLID_FACES[base_type(name)]:
            closed = [*face, face[-1]][:4]
            faces.append(np.sort(cells[:, closed], axis=1))
            owners.append(first + np.arange(len(cells)))
        first += len(cells)
    inside_out = np.concatenate(volumes) < 0.0
    if inside_out.any():
        yield (
            f"{int(inside_out.sum())} solids are inside out, their volume is negative "
            f"({_few('number', target.cell_ids[inside_out])}): solvers refuse such meshes; turn "
            "the order of their nodes"
        )
    _, number, counts = np.unique(
        np.concatenate(faces), axis=0, return_inverse=True, return_counts=True
    )
    if (counts > 2).any():
        cells = np.unique(np.concatenate(owners)[(counts > 2)[number.reshape(-1)]])
        yield (
            f"{int((counts > 2).sum())} faces have more than two solids "
            f"({_few('number', target.cell_ids[cells])}): cells overlap, mesh the part again"
        )


def _few(called: str, numbers: np.ndarray, count: int = 5) -> str:
    shown = ", ".join(str(number) for number in numbers[:count])
    return f"{called} {shown}" + (", ..." if len(numbers) > count else "")
