"""Results of CalculiX on the cells and nodes of the mesh, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.structure.dat import read_printed
from lcmchain.mapping.structure.deck import Units
from lcmchain.mapping.structure.frd import NodalResult, read_displacements
from lcmchain.mapping.structure.mesh import DeckMesh
from lcmchain.mapping.structure.sections import THINNEST_LAYER, Sections, Through
from lcmchain.scene.structure import Structure


@dataclass(frozen=True)
class StructuralResults:
    """Solved displacements (N, 3), modes (M, N, 3), and values of the cells.

    Parameters
    ----------
    displacement : static [m], (N, 3), or None.
    frequencies : [Hz], (M,). modes : their shapes, largest displacement 1, (M, N, 3).
    stress, strain : mean over the cell in its axes, rows 11, 22, 33, 12, 13, 23 with engineering
        shear strains, (C, 6), or None.
    fibre_strain : along all families, the largest of the integration points by size, (C, n).
    """

    displacement: np.ndarray | None
    frequencies: np.ndarray
    modes: np.ndarray
    stress: np.ndarray | None
    strain: np.ndarray | None
    fibre_strain: np.ndarray | None


def read_results(
    deck: Path, mesh: DeckMesh, sections: Sections, structure: Structure, units: Units
) -> StructuralResults:
    """Read what a solved deck left.

    Raises
    ------
    InputError : files that are absent or broken, or hold less than the deck asks for.
    """
    found = read_displacements(deck.with_suffix(".frd"))
    printed = read_printed(deck.with_suffix(".dat"))
    static = [block for block in found if block.mode == 0]
    modes = [block for block in found if block.mode > 0]
    wanted = bool(structure.loads), structure.frequencies
    if (bool(static), len(modes)) != wanted or len(printed.frequencies) != len(modes):
        raise InputError(
            f"holds {len(static)} static states and {len(modes)} modes, but the deck asks for "
            f"{int(wanted[0])} and {wanted[1]}; look into the log",
            file=deck.with_suffix(".frd"),
        )
    shapes = np.full((len(modes), len(mesh.points), 3), np.nan)
    for shape, block in zip(shapes, modes):
        shape[:] = _on_nodes(block, mesh)
        shape /= np.nanmax(np.linalg.norm(shape, axis=1))
    stress = strain = fibre_strain = displacement = None
    if static:
        displacement = _on_nodes(static[-1], mesh) / units.length
        row = _rows(printed.element, mesh.cell_ids)
        of_points = printed.strain * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
        part = _part_of_points(row, sections.through, mesh.cell_count)
        stress = _mean(printed.stress / units.stress, row, part, mesh.cell_count)
        strain = _mean(of_points, row, part, mesh.cell_count)
        fibre_strain = _along_fibres(of_points, row, sections.angles, mesh.cell_count)
    return StructuralResults(
        displacement, printed.frequencies, shapes, stress, strain, fibre_strain
    )


def _on_nodes(block: NodalResult, mesh: DeckMesh) -> np.ndarray:
    """Displacements of the mesh's nodes (N, 3), not a number where no element is.

    Layered shells leave the nodes of the solids that CalculiX makes of them in the file too.
    """
    known = np.isin(block.node_ids, mesh.node_ids)
    values = np.full((len(mesh.points), 3), np.nan)
    values[_rows(block.node_ids[known], mesh.node_ids)] = block.displacement[known]
    if np.isnan(values[mesh.used]).any():
        raise InputError("CalculiX left no displacement for some nodes of the deck")
    return values


def _rows(numbers: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Rows of the user's numbers."""
    order = np.argsort(known, kind="stable")
    place = np.minimum(np.searchsorted(known, numbers, sorter=order), len(known) - 1)
    rows = order[place]
    if not np.array_equal(known[rows], numbers):
        raise InputError("the results of CalculiX are of another mesh than the deck's")
    return rows


def _part_of_points(row: np.ndarray, through: Through | None, count: int) -> np.ndarray:
    """Return which part of its cell an integration point stands for (P,).

    CalculiX prints the points of a cell one after the other, those of the lowest layer first, as
    many in every layer however thick it is.
    """
    points = np.bincount(row, minlength=count)
    if through is None:
        return 1.0 / points[row]
    order = np.argsort(row, kind="stable")
    first = np.concatenate([[0], np.cumsum(points)[:-1]])
    number = np.empty(len(row), dtype=np.int64)
    number[order] = np.arange(len(row)) - np.repeat(first, points)
    written = through.share > THINNEST_LAYER
    each = points // written.sum(axis=0)
    # the layers that a cell has, one behind the other
    layers = np.argsort(~written, axis=0, kind="stable")
    layer = layers[number // each[row], row]
    share = through.share / through.share.sum(axis=0)
    return share[layer, row] / each[row]


def _mean(values: np.ndarray, row: np.ndarray, part: np.ndarray, count: int) -> np.ndarray:
    summed = [np.bincount(row, part * column, minlength=count) for column in values.T]
    return np.stack(summed, axis=1)


def _along_fibres(
    strain: np.ndarray, row: np.ndarray, angles: tuple[np.ndarray, ...], count: int
) -> np.ndarray:
    """Strain along all families that is the largest by size over each cell's points, (C, n)."""
    along = [strain[:, 0]]
    for angle in angles:
        c, s = np.cos(angle[row]), np.sin(angle[row])
        along.append(c * c * strain[:, 0] + s * s * strain[:, 1] + c * s * strain[:, 3])
    largest = np.zeros((count, len(along)))
    for family, values in enumerate(along):
        order = np.argsort(np.abs(values), kind="stable")
        largest[row[order], family] = values[order]  # the last one written is the largest
    return largest
