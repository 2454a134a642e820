"""Forming results and target meshes with known geometry and known fields."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import xarray as xr


def grid(nx, ny, low=(0.0, 0.0), high=(1.0, 1.0), jitter=0.0, seed=0):
    """Points (N, 2) and quadrilaterals of a plate; inner nodes are moved by jitter * cell size."""
    x, y = np.linspace(low[0], high[0], nx + 1), np.linspace(low[1], high[1], ny + 1)
    points = np.stack([c.ravel() for c in np.meshgrid(x, y, indexing="ij")], axis=1)
    inner = np.all((points > np.add(low, 1e-9)) & (points < np.subtract(high, 1e-9)), axis=1)
    move = np.random.default_rng(seed).uniform(-1.0, 1.0, points.shape)
    cell = np.array([x[1] - x[0], y[1] - y[0]])
    points[inner] += jitter * cell * move[inner]
    node = np.arange(len(points)).reshape(nx + 1, ny + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    return points, np.stack([c.ravel() for c in corners], axis=1)


def lifted(points):
    """Plane points in space, shape (N, 3)."""
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1)


def bowl(points, depth=0.3):
    """Map a plate around the origin to a paraboloid."""
    return np.concatenate([points, depth * (points**2).sum(axis=1, keepdims=True)], axis=1)


def triangles_of(quads):
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def area_vectors(points, faces):
    c = points[faces]
    return 0.5 * np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1])


def forming_result(points, faces, frames=2, **fields) -> xr.Dataset:
    """Dataset in the conventions of forming.nc; earlier frames hold other values than the last.

    Fields are functions of the face centroids (F, 3), arrays, or constants; fibre directions have
    shape (F, 3).
    """
    centroid = points[faces].mean(axis=1)
    dataset = xr.Dataset()
    dataset["sheet"] = (
        (),
        np.int32(0),
        {
            "cf_role": "mesh_topology",
            "topology_dimension": 2,
            "node_coordinates": "sheet_node_x sheet_node_y sheet_node_z",
            "face_node_connectivity": "sheet_face_nodes",
        },
    )
    dataset["sheet_face_nodes"] = (
        ("sheet_face", "sheet_face_corner"),
        faces.astype(np.int32),
        {"cf_role": "face_node_connectivity", "start_index": 0},
    )
    dataset["sheet_face_nodes"].encoding["_FillValue"] = np.int32(-1)
    for axis, values in zip("xyz", points.T, strict=True):
        dataset[f"sheet_node_{axis}"] = ("sheet_node", values, {"units": "m"})

    def add(name, values, units):
        values = np.broadcast_to(np.asarray(values, dtype=float), len(faces))
        history = np.stack([values * (k + 1) / frames for k in range(frames)])
        attributes = {"units": units, "long_name": name, "mesh": "sheet", "location": "face"}
        dataset[name] = (("time", "sheet_face"), history, attributes)

    units = {"thickness": "m", "areal_fibre_mass": "kg m-2", "shear_angle": "rad"}
    for name, values in {"thickness": 1e-3, "fibre_volume_fraction": 0.5, **fields}.items():
        if isinstance(values, Callable):
            values = values(centroid)
        if np.ndim(values) == 2:
            for axis, component in zip("xyz", np.transpose(values), strict=True):
                add(f"{name}_{axis}", component, "1")
        else:
            add(name, values, units.get(name, "1"))
    dataset.attrs = {"Conventions": "CF-1.11 UGRID-1.0", "history": "formed", "scene": "title = 1"}
    return dataset


def families(points, faces, shear=0.0):
    """Two fibre families in the faces' planes, closed by the shear angle [rad]."""
    normal = area_vectors(points, faces)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    first = np.cross([0.0, 1.0, 0.0], normal)
    first /= np.linalg.norm(first, axis=1)[:, None]
    across = np.cross(normal, first)
    return first, np.sin(shear) * first + np.cos(shear) * across


def bricks(points, quads, heights, shape=None, kind="hexahedron"):
    """Solid cells over a plate: nodes (N, 3), cells (C, ...), one layer between two heights.

    shape : function of plate points and height that gives nodes; flat by default. Tetrahedra are
    five to a brick, mirrored from brick to brick so that they fit; pyramids six, to its middle.
    """
    shape = shape or (lambda p, z: lifted(p) + [0.0, 0.0, z])
    nodes = np.concatenate([shape(points, z) for z in heights])
    count, layers = len(points), len(heights) - 1
    cells = np.concatenate(
        [np.hstack([quads + k * count, quads + (k + 1) * count]) for k in range(layers)]
    )
    if kind == "hexahedron":
        return nodes, cells
    if kind == "wedge":
        return nodes, cells[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
    if kind == "pyramid":
        middle = len(nodes) + np.arange(len(cells))
        sides = [[0, 1, 2, 3], [7, 6, 5, 4], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
        tips = np.repeat(middle, 6)[:, None]
        pyramids = np.hstack([cells[:, sides].reshape(-1, 4), tips])
        return np.concatenate([nodes, nodes[cells].mean(axis=1)]), pyramids
    row = points[quads[:, 3], 0] > points[np.roll(quads[:, 3], 1), 0] + 1e-9
    columns = np.cumsum(row)
    along = np.arange(len(quads)) - np.searchsorted(columns, columns)
    odd = np.concatenate([(columns + along + k) % 2 for k in range(layers)]) == 1
    halves = (
        [[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7]],
        [[0, 1, 2, 5], [0, 2, 3, 7], [0, 2, 7, 5], [0, 5, 7, 4], [2, 5, 6, 7]],
    )
    split = np.where(odd[:, None, None], cells[:, halves[0]], cells[:, halves[1]])
    return nodes, split.reshape(-1, 4)


def shell_of_bowl(depth):
    """Shape of solids around the bowl: a plate at a height along the normals of the paraboloid."""

    def shape(points, height):
        normal = np.concatenate([-2.0 * depth * points, np.ones((len(points), 1))], axis=1)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        return bowl(points, depth) + height * normal

    return shape


def two_plies(first, second, **fields):
    """Forming result of two plies, ``under`` and ``over``: points and faces of each.

    Fields are pairs of what :func:`forming_result` takes, one for each ply.
    """
    each = [
        forming_result(*mesh, **{name: pair[k] for name, pair in fields.items()})
        for k, mesh in enumerate((first, second))
    ]
    points = np.concatenate([first[0], second[0]])
    faces = np.concatenate([first[1], second[1] + len(first[0])])
    joined = forming_result(points, faces)
    for name, variable in each[0].data_vars.items():
        if variable.dims == ("time", "sheet_face"):
            values = np.concatenate([one[name].values for one in each], axis=1)
            joined[name] = (variable.dims, values, variable.attrs)
    ply = np.repeat(np.arange(2, dtype=np.int32), [len(first[1]), len(second[1])])
    flags = {"flag_values": np.arange(2, dtype=np.int32), "flag_meanings": "under over"}
    joined["body"] = (("sheet_face",), ply, flags)
    return joined


@pytest.fixture(scope="session")
def make():
    """The makers above; test files of the suite cannot import each other."""
    makers = (
        grid, lifted, bowl, triangles_of, area_vectors, forming_result, families,
        bricks, shell_of_bowl, two_plies,
    )  # fmt: skip
    return SimpleNamespace(**{maker.__name__: maker for maker in makers})


@pytest.fixture
def write_mesh(tmp_path):
    """Write a mesh with meshio and return its path."""

    def write(points, cells, name="target.vtu"):
        path = tmp_path / name
        meshio.Mesh(points, cells).write(path)
        return path

    return write
