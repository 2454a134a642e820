"""Meshes in netCDF files: topology, coordinates and variables on a mesh (UGRID 1.0, CF 1.11).

Every mesh that the chain writes passes through this module, under any name and into any group of a
file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

CONVENTIONS = "CF-1.11 UGRID-1.0"

#: Dimension of saved states, the same in every group, and its coordinate. VTK's reader finds time
#: steps under this name only.
TIME = "time"

#: Marks the missing last nodes of cells with fewer than the widest one.
NO_NODE = np.int32(-1)

#: Shapes of volumes by their number of nodes: name and flag of UGRID 1.0.
VOLUME_SHAPES = {4: ("tetrahedron", 0), 5: ("pyramid", 1), 6: ("wedge", 2), 8: ("hexahedron", 3)}

#: Dimensions, values and attributes.
Variable = tuple[Sequence[str] | str, Any, dict[str, Any]]
#: Values and attributes of a variable that has no mesh yet.
Described = tuple[np.ndarray, dict[str, Any]]


@dataclass(frozen=True)
class UgridMesh:
    """Name of a mesh in a file, and the variables that describe it and lie on it.

    Parameters
    ----------
    name : of the variable that describes the mesh.
    topology_dimension : 2 for a mesh of faces, 3 for one of volumes.
    prefix : of the mesh's dimensions and variables; by default the name.
    """

    name: str
    topology_dimension: int = 2
    prefix: str | None = None

    @property
    def location(self) -> str:
        """Place of a cell's values: ``"face"`` or ``"volume"``."""
        return {2: "face", 3: "volume"}[self.topology_dimension]

    @property
    def cell_dimension(self) -> str:
        return self._named(self.location)

    @property
    def node_dimension(self) -> str:
        return self._named("node")

    @property
    def cell_nodes(self) -> str:
        """Name of the variable that holds the nodes of each cell."""
        return self._named(f"{self.location}_nodes")

    @property
    def coordinates(self) -> list[str]:
        """Names of the variables that hold x, y and z of the nodes."""
        return [self._named(f"node_{axis}") for axis in "xyz"]

    def topology(
        self, cells: np.ndarray, *, long_name: str, cell_nodes_long_name: str | None = None
    ) -> dict[str, Variable]:
        """Return the variable that describes the mesh, and the nodes of its cells.

        Parameters
        ----------
        cells : nodes of each cell from 0, shape (C, K), volumes in VTK's order; -1 after the last
            node of a cell with fewer than K.
        long_name : what the mesh is. cell_nodes_long_name : what is in the table of nodes.
        """
        location = self.location
        description = {
            "cf_role": "mesh_topology",
            "long_name": long_name,
            "topology_dimension": np.int32(self.topology_dimension),
            "node_coordinates": " ".join(self._node_coordinates()),
            f"{location}_node_connectivity": self.cell_nodes,
            f"{location}_dimension": self.cell_dimension,
        }
        if location == "volume":
            description["volume_shape_type"] = self._named("volume_shape")
        nodes = {
            "cf_role": f"{location}_node_connectivity",
            "long_name": cell_nodes_long_name or f"nodes of each {location}",
            "start_index": np.int32(0),
            "_FillValue": NO_NODE,
        }
        corners = self._named(f"{location}_corner")
        return {
            self.name: ((), np.int32(0), description),
            self.cell_nodes: ((self.cell_dimension, corners), cells.astype(np.int32), nodes),
        }

    def _node_coordinates(self) -> list[str]:
        """Return the coordinates in the order in which the mesh lists them.

        VTK's reader, which draws surfaces only, takes the first and the last one as its plane: x
        and y give the plan view there. Other readers go by the attributes of each coordinate.
        """
        x, y, z = self.coordinates
        return [x, z, y] if self.topology_dimension == 2 else [x, y, z]

    def volume_shapes(
        self, cells: np.ndarray, *, long_name: str, node_counts: Sequence[int] = (4, 5, 6, 8)
    ) -> dict[str, Variable]:
        """Return the variable with the shape of each volume, which a mesh of volumes needs.

        Parameters
        ----------
        cells : as for :meth:`topology`.
        node_counts : shapes that the attributes list, by their number of nodes.
        """
        flags = np.array([VOLUME_SHAPES[count][1] for count in node_counts], dtype=np.int8)
        of_cells = [VOLUME_SHAPES[count][1] for count in (cells >= 0).sum(axis=1)]
        attributes = {
            "cf_role": "volume_shape_type",
            "long_name": long_name,
            "flag_values": flags,
            "flag_meanings": " ".join(VOLUME_SHAPES[count][0] for count in node_counts),
        }
        shapes = np.array(of_cells, dtype=np.int8)
        return {self._named("volume_shape"): (self.cell_dimension, shapes, attributes)}

    def node_positions(
        self, positions: np.ndarray, *, long_name: str = "coordinate of node"
    ) -> dict[str, Variable]:
        """Return the coordinates of the nodes (node_count, 3) [m].

        long_name : follows the name of the axis.
        """
        variables: dict[str, Variable] = {}
        for axis, name, values in zip("xyz", self.coordinates, positions.T, strict=True):
            attributes = {
                "units": "m",
                "long_name": f"{axis} {long_name}",
                # Readers of two-dimensional meshes know the plane of the map by these names.
                "standard_name": f"projection_{axis}_coordinate",
                "axis": axis.upper(),
            }
            if axis == "z":
                attributes |= {"standard_name": "height", "positive": "up"}
            variables[name] = (self.node_dimension, np.array(values), attributes)
        return variables

    def on_cells(self, values: np.ndarray, attributes: Mapping[str, Any]) -> Variable:
        """Return a variable on the cells, shape (C,), or (F, C) for F saved states."""
        place = {"mesh": self.name, "location": self.location}
        return (TIME, self.cell_dimension)[-np.ndim(values) :], values, {**attributes, **place}

    def on_nodes(self, values: np.ndarray, attributes: Mapping[str, Any]) -> Variable:
        """Return a variable on the nodes, shape (N,), or (F, N) for F saved states."""
        place = {"mesh": self.name, "location": "node"}
        return (TIME, self.node_dimension)[-np.ndim(values) :], values, {**attributes, **place}

    def dataset(
        self, variables: Mapping[str, Variable], attributes: Mapping[str, Any]
    ) -> xr.Dataset:
        """Return the mesh's variables as a dataset, its coordinates marked as such."""
        import xarray as xr  # a run need not wait for it before its first step

        dataset = xr.Dataset(dict(variables), attrs=dict(attributes))
        return dataset.set_coords(self.coordinates)

    def _named(self, part: str) -> str:
        return f"{self.prefix or self.name}_{part}"


def saved_times(time: np.ndarray) -> Variable:
    """Return the times [s] of the saved states, shape (F,), or of the only one, as coordinate."""
    attributes = {
        "units": "s",
        "long_name": "process time of the saved state",
        "standard_name": "time",
        "axis": "T",
    }
    values = np.array(time, dtype=float)
    return (TIME,) if values.ndim else (), values, attributes
