"""Mapped solids in netCDF: their skin as the mesh that any reader opens, and all cells in a group.

A file holds them as the forming result holds its elements: in the root group only a
two-dimensional mesh, since readers of UGRID files (xugrid, VTK, ugrid-checks) know no volumes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.netcdf_file import ROOT
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.mapping.target import TargetMesh

if TYPE_CHECKING:
    import xarray as xr

SOLID = "solid"
SKIN = UgridMesh("skin")


def file_groups(dataset: xr.Dataset, target: TargetMesh) -> dict[str, xr.Dataset]:
    """Return the groups of the file that holds a mapping, by their path.

    Parameters
    ----------
    dataset : mapped fields on all cells of the target, as :func:`mapped_dataset` returns them.

    Returns
    -------
    groups : of a shell, the dataset at the root; of a solid, its skin at the root and the dataset
        in ``/solid``.
    """
    if not target.is_solid:
        return {ROOT: dataset}
    return {ROOT: _skin(dataset, target), SOLID: dataset}


def _skin(dataset: xr.Dataset, target: TargetMesh) -> xr.Dataset:
    """Outer faces with the values of the cells behind them."""
    faces, owners = target.skin
    # the dataset has the used corner nodes only, in ascending order
    used = np.unique(target.corners[target.corners >= 0])
    own, compact = np.unique(faces[faces >= 0], return_inverse=True)
    renumbered = np.full(faces.shape, -1, dtype=np.int64)
    renumbered[faces >= 0] = compact.reshape(-1)
    width = 3 if np.all(renumbered[:, 3] < 0) else 4
    variables = SKIN.topology(
        renumbered[:, :width], long_name="skin of the solid mesh that received the forming fields"
    )
    variables[SKIN.name][2]["skin_of"] = f"/{SOLID}"
    variables |= SKIN.node_positions(target.points[own])
    volume = UgridMesh("target", topology_dimension=3)
    nodes = np.searchsorted(used, own)
    told = "of the cell behind the face; all cells are in the group /solid"
    for name, variable in dataset.data_vars.items():
        about = dict(variable.attrs)
        if about.get("mesh") != volume.name:
            continue
        if variable.dims[-1:] == (volume.cell_dimension,):
            comment = f"{about.get('comment', '')}; {told}".removeprefix("; ")
            values = variable.values[..., owners]
            variables[str(name)] = SKIN.on_cells(values, about | {"comment": comment})
        elif variable.dims[-1:] == (volume.node_dimension,):
            variables[str(name)] = SKIN.on_nodes(variable.values[..., nodes], about)
    for name in dataset.coords:
        if name not in volume.coordinates:
            coordinate = dataset[name]
            about = dict(coordinate.attrs)
            variables[str(name)] = ([str(d) for d in coordinate.dims], coordinate.values, about)
    return SKIN.dataset(variables, dataset.attrs)
