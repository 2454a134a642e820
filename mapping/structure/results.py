"""Results of CalculiX on cells and nodes of the mesh, in SI units, and the files that hold them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np

from lcmchain import __version__
from lcmchain.errors import InputError
from lcmchain.fields.vtu import vtk_blocks, write_mesh
from lcmchain.mapping.structure.calculix import NodalResult, read_displacements, read_printed
from lcmchain.mapping.structure.deck import Units
from lcmchain.mapping.structure.mesh import DeckMesh
from lcmchain.mapping.structure.sections import THINNEST_LAYER, Sections, Through
from lcmchain.mapping.target import TargetMesh
from lcmchain.scene.structure import Structure

if TYPE_CHECKING:
    import xarray as xr


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


# --- netCDF (UGRID) and VTU, both complete or not at all ------------------------------------------

#: Components of stresses and strains in the axes of a cell, and of laminates.
COMPONENTS = ("11", "22", "33", "12", "13", "23")
_OF_LAMINATE = (("11", 0, 0), ("22", 1, 1), ("12", 0, 1), ("66", 2, 2), ("16", 0, 2), ("26", 1, 2))

#: Nodes closer than this share of the mesh's size are at the same place.
SAME_PLACE = 1e-6
_UNITS_OF_LAMINATE = {"A": "N m-1", "B": "N", "D": "N m"}


def results_dataset(
    mapped: xr.Dataset,
    target: TargetMesh,
    mesh: DeckMesh,
    sections: Sections,
    results: StructuralResults | None,
    attributes: dict[str, Any],
) -> xr.Dataset:
    """Mapped fields and structural results as one UGRID dataset, on the mesh of the mapped file."""
    dataset = mapped.copy()
    location = "volume" if target.is_solid else "face"
    cells = mapped["thickness"].dims[0]
    nodes = mapped[_coordinates(mapped)[0]].dims[0]
    rows = _node_rows(mapped, target, mesh)
    for name, (values, about) in cell_values(sections, results).items():
        on_mesh = {"mesh": "target", "location": location}
        dataset[name] = ((cells,), values, about | on_mesh)
    on_nodes = {"mesh": "target", "location": "node"}
    for name, (values, about) in _node_values(results).items():
        for axis, column in zip("xyz", values[rows].T):
            told = about | {"long_name": f"{axis} {about['long_name']}"} | on_nodes
            dataset[f"{name}_{axis}"] = ((nodes,), np.ascontiguousarray(column), told)
    if results is not None and len(results.frequencies):
        dataset["eigenfrequency"] = (
            ("mode",),
            results.frequencies,
            {"units": "Hz", "long_name": "eigenfrequency"},
        )
        for axis, shapes in zip("xyz", np.moveaxis(results.modes[:, rows], 2, 0)):
            about = {"units": "1", "long_name": f"{axis} of the mode, largest length 1"} | on_nodes
            dataset[f"mode_shape_{axis}"] = (("mode", nodes), np.ascontiguousarray(shapes), about)
    dataset.attrs |= attributes | {
        "history": _history(mapped),
        "source": f"lcmchain {__version__}, structural stage",
    }
    return dataset


def write_results_vtu(
    path: Path | str, mesh: DeckMesh, sections: Sections, results: StructuralResults | None
) -> None:
    """Write values of cells and nodes on the mesh of the deck as VTU; vectors as such."""
    ends = np.cumsum([len(cells) for _, _, cells in mesh.blocks])[:-1]
    on_cells = {name: values for name, (values, _) in cell_values(sections, results).items()}
    on_cells |= {f"axis_{k + 1}": sections.axes[:, k] for k in range(3)}
    on_points = {name: values for name, (values, _) in _node_values(results).items()}
    if results is not None:
        for number, shape in enumerate(results.modes, start=1):
            on_points[f"mode_{number}"] = shape
    on_points = {name: np.nan_to_num(values) for name, values in on_points.items()}
    on_cells["cell_id"] = mesh.cell_ids
    on_points["node_id"] = mesh.node_ids
    write_mesh(
        path,
        meshio.Mesh(
            mesh.points,
            vtk_blocks([(name, cells) for name, _, cells in mesh.blocks]),
            point_data=on_points,
            cell_data={name: np.split(values, ends) for name, values in on_cells.items()},
        ),
    )


def cell_values(
    sections: Sections, results: StructuralResults | None
) -> dict[str, tuple[np.ndarray, dict[str, str]]]:
    """Every value of the cells with its attributes."""
    values = {
        "deck_fibre_volume_fraction": (
            sections.fibre_volume_fraction,
            {"units": "1", "long_name": "fibre volume fraction of the cell in the deck"},
        ),
        "composite_density": (
            sections.density,
            {"units": "kg m-3", "long_name": "density of fibres and resin"},
        ),
    }
    for number, angle in enumerate(sections.angles, start=2):
        name = "family_angle" if number == 2 else f"family_angle_1{number}"
        which = {2: "second", 3: "third"}[number]
        values[name] = (
            angle,
            {"units": "rad", "long_name": f"angle from the first to the {which} fibre family"},
        )
    if sections.thickness is not None:
        values["deck_thickness"] = (
            sections.thickness,
            {"units": "m", "long_name": "thickness of the cell in the deck, mean of its nodes"},
        )
    if sections.laminate is not None:
        for name, matrix in zip("ABD", sections.laminate):
            for component, row, column in _OF_LAMINATE:
                values[f"laminate_{name}_{component}"] = (
                    matrix[:, row, column],
                    {
                        "units": _UNITS_OF_LAMINATE[name],
                        "long_name": f"{name}_{component} of the laminate in the cell's axes",
                    },
                )
    if results is None or results.stress is None:
        return values
    assert results.strain is not None and results.fibre_strain is not None
    for column, component in enumerate(COMPONENTS):
        values[f"stress_{component}"] = (
            results.stress[:, column],
            {"units": "Pa", "long_name": f"mean stress {component} in the cell's axes"},
        )
        values[f"strain_{component}"] = (
            results.strain[:, column],
            {
                "units": "1",
                "long_name": f"mean strain {component} in the cell's axes (engineering shear)",
            },
        )
    for family in range(1, 1 + results.fibre_strain.shape[1]):
        values[f"elastic_fibre_strain_{family}"] = (
            results.fibre_strain[:, family - 1],
            {
                "units": "1",
                "long_name": f"largest strain by size along fibre family {family} in the cell",
            },
        )
    return values


def _node_values(results: StructuralResults | None) -> dict[str, tuple[np.ndarray, dict[str, str]]]:
    """Displacements of the nodes, (N, 3), with their attributes."""
    if results is None or results.displacement is None:
        return {}
    about = {"units": "m", "long_name": "displacement under the static loads"}
    return {"structural_displacement": (results.displacement, about)}


def require_same_nodes(mapped: xr.Dataset, target: TargetMesh, mesh: DeckMesh, file: str) -> None:
    """Refuse a mapped file whose nodes lie elsewhere than those of the mesh.

    Raises
    ------
    InputError : another mesh, or the same one read in another unit of length.
    """
    names = {
        mapped[name].attrs.get("axis", name[-1].upper()): name for name in _coordinates(mapped)
    }
    places = np.stack([mapped[names[axis]].values for axis in "XYZ"], axis=1)
    rows = _node_rows(mapped, target, mesh)
    off = np.inf
    if len(rows) == len(places):
        off = np.abs(places - mesh.points[rows]).max()
    if off > SAME_PLACE * mesh.size:
        told = f"lie up to {1e3 * off:.3g} mm away from" if np.isfinite(off) else "are others than"
        raise InputError(
            f"the nodes of the mapped file {told} those of the mesh; give the mesh that the fields "
            "were mapped onto, and its length unit",
            file=file,
        )


def _node_rows(mapped: xr.Dataset, target: TargetMesh, mesh: DeckMesh) -> np.ndarray:
    """Rows of the deck's mesh that are the nodes of the mapped file, in its order."""
    if "node_id" in mapped:
        order = np.argsort(mesh.node_ids)
        numbers = mapped["node_id"].values.astype(np.int64)
        place = np.searchsorted(mesh.node_ids, numbers, sorter=order)
        return order[np.minimum(place, len(order) - 1)]  # others are told by their places
    return np.unique(target.corners[target.corners >= 0])


def _coordinates(mapped: xr.Dataset) -> list[str]:
    return str(mapped["target"].attrs["node_coordinates"]).split()


def _history(mapped: xr.Dataset) -> str:
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    step = f"{now} structural stage of lcmchain {__version__}"
    return f"{step}\n{mapped.attrs.get('history', '')}".strip()
