"""Files of a structural analysis: netCDF (UGRID) and VTU, both complete or not at all."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np

from lcmchain import __version__
from lcmchain.errors import InputError
from lcmchain.fields.vtu import vtk_blocks, write_mesh
from lcmchain.mapping.structure.mesh import DeckMesh
from lcmchain.mapping.structure.results import StructuralResults
from lcmchain.mapping.structure.sections import Sections
from lcmchain.mapping.target import TargetMesh

if TYPE_CHECKING:
    import xarray as xr

#: Components of stresses and strains in the axes of a cell, and of laminates.
COMPONENTS = ("11", "22", "33", "12", "13", "23")
_OF_LAMINATE = (("11", 0, 0), ("22", 1, 1), ("12", 0, 1), ("66", 2, 2), ("16", 0, 2), ("26", 1, 2))

#: Nodes closer than this share of the mesh's size are at the same place.
SAME_PLACE = 1e-6
_UNITS_OF_LAMINATE = {"A": "N m-1", "B": "N", "D": "N m"}


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


def node_values(results: StructuralResults | None) -> dict[str, tuple[np.ndarray, dict[str, str]]]:
    """Displacements of the nodes, (N, 3), with their attributes."""
    if results is None or results.displacement is None:
        return {}
    about = {"units": "m", "long_name": "displacement under the static loads"}
    return {"structural_displacement": (results.displacement, about)}


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
    for name, (values, about) in node_values(results).items():
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


def write_results_vtu(
    path: Path | str, mesh: DeckMesh, sections: Sections, results: StructuralResults | None
) -> None:
    """Write values of cells and nodes on the mesh of the deck as VTU; vectors as such."""
    ends = np.cumsum([len(cells) for _, _, cells in mesh.blocks])[:-1]
    on_cells = {name: values for name, (values, _) in cell_values(sections, results).items()}
    on_cells |= {f"axis_{k + 1}": sections.axes[:, k] for k in range(3)}
    on_points = {name: values for name, (values, _) in node_values(results).items()}
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
