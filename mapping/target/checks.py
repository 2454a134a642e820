"""What is wrong with a target mesh: cells that are none, and what makes a mapping doubtful."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.target.mesh import TargetMesh
from lcmchain.mesh_files.shapes import SOLID_CORNERS, SOLID_FACES, base_type, corner_count

# A cell that is thinner than this part of its length is none.
FLATNESS = 1e-7

# Farthest place of a node [m] that squares and products of lengths can be computed with.
FARTHEST = 1e9


def require_whole_cells(
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
    else:
        doubled = np.cross(offset[:, 2] - offset[:, 0], offset[:, -1] - offset[:, 1])
        size = np.linalg.norm(offset, axis=2).max(axis=1)
        refuse(np.linalg.norm(doubled, axis=1) <= FLATNESS * size**2, "no area")


def warnings_about(target: TargetMesh) -> list[str]:
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


def _of_solids(target: TargetMesh) -> Iterable[str]:
    """Solids with a negative volume, and faces with more than two of them."""
    volumes, faces, owners = [], [], []
    first = 0
    for name, cells in target.blocks:
        corners = target.points[cells[:, : corner_count(name)]]
        middle = corners.mean(axis=1)
        volume = np.zeros(len(cells))
        for face in SOLID_FACES[base_type(name)]:
            a, b, c, d = (corners[:, face[k if k < len(face) else -1]] - middle for k in range(4))
            volume += np.einsum("ci,ci->c", np.cross(c - a, d - b), a + b + c + d) / 24.0
            closed = [*face, face[-1]][:4]
            faces.append(np.sort(cells[:, closed], axis=1))
            owners.append(first + np.arange(len(cells)))
        volumes.append(volume)
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
