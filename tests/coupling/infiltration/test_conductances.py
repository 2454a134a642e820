"""Conductances between nodes: right for linear pressures, and not negative, whatever the tensor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcmchain.coupling.infiltration.flow.network import Network, RaceTrack
from lcmchain.coupling.infiltration.flow.pairs import cut, flip
from lcmchain.coupling.infiltration.flow.preform import FlowMesh

from .sample_meshes import plate, random_plate

SIDE = 0.3
MESHES = {
    "quadrilaterals": lambda: plate(14, 10, SIDE, SIDE),
    "triangles": lambda: plate(12, 12, SIDE, SIDE, triangles=True),
    "scattered": lambda: random_plate(0.03, SIDE, SIDE, seed=1),
}


def tensor(ratio, degrees):
    angle = np.radians(degrees)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    found = np.eye(3)
    found[:2, :2] = axes.T @ np.diag([np.sqrt(ratio), 1.0 / np.sqrt(ratio)]) @ axes
    return found


def network_of(mesh, one, **given):
    return Network(mesh, np.broadcast_to(one, (mesh.cell_count, 3, 3)), **given)


def laplacian(network, scale):
    flow = network.conductances(scale, 1.0).flow
    first, second = network.edges.T
    matrix = np.zeros((network.node_count, network.node_count))
    np.add.at(matrix, (first, first), flow)
    np.add.at(matrix, (second, second), flow)
    np.add.at(matrix, (first, second), -flow)
    np.add.at(matrix, (second, first), -flow)
    return matrix, flow


@pytest.mark.parametrize("kind", MESHES)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(ratio=st.floats(1.0, 30.0), degrees=st.floats(0.0, 180.0))
def test_no_conductance_inside_is_negative_and_linear_pressures_are_exact(kind, ratio, degrees):
    mesh, one = MESHES[kind](), tensor(ratio, degrees)
    network = network_of(mesh, one)
    matrix, flow = laplacian(network, np.ones(mesh.cell_count))
    on_rim = np.isin(network.edges, mesh.rim).all(axis=1)
    assert flow[~on_rim].min() > -1e-6 * flow.max()
    x = mesh.points[:, :2]
    inner = np.setdiff1d(np.arange(mesh.node_count), mesh.rim)
    assert np.abs((matrix @ x)[inner]).max() < 1e-12
    np.testing.assert_allclose(x.T @ matrix @ x / SIDE**2, one[:2, :2], atol=1e-10)


@pytest.mark.parametrize("kind", ["quadrilaterals", "triangles"])
def test_isotropic_cells_without_obtuse_angles_stay_as_they_are(kind):
    mesh = {"quadrilaterals": plate(6, 6, SIDE, SIDE), "triangles": MESHES["triangles"]()}[kind]
    network = network_of(mesh, np.eye(3))
    flow = network.conductances(np.ones(mesh.cell_count), 1.0).flow
    length = np.linalg.norm(np.diff(mesh.points[network.edges], axis=1)[:, 0], axis=1)
    across = length > 1.2 * length.min()
    if kind == "triangles":
        np.testing.assert_allclose(flow[across], 0.0, atol=1e-12)
        assert flow[~across].min() > 0.49
    else:
        np.testing.assert_allclose(flow[across], 1.0 / 3.0, rtol=1e-9)


def test_edges_flip_towards_the_fibres():
    """Diagonals against the fibres are exchanged for those along them, all over the plate."""
    mesh = plate(8, 8, SIDE, SIDE, triangles=True)
    steep = network_of(mesh, tensor(4.0, 135.0))
    away = mesh.points[steep.edges[:, 1]] - mesh.points[steep.edges[:, 0]]
    oblique = np.abs(away[:, 0] * away[:, 1]) > 0.0
    assert oblique.sum() == 64
    assert (away[oblique, 0] * away[oblique, 1] < 0.0).all()


def test_what_a_flipped_triangle_conducts_follows_the_cells_it_lies_in():
    """Twice the thickness everywhere conducts twice as well; that of one cell acts near it."""
    mesh = random_plate(0.03, SIDE, SIDE, seed=4)
    network = network_of(mesh, tensor(8.0, 25.0))
    flow = network.conductances(np.ones(mesh.cell_count), 1.0).flow
    twice = network.conductances(np.full(mesh.cell_count, 2.0), 1.0).flow
    np.testing.assert_allclose(twice, 2.0 * flow, rtol=1e-12)
    total = np.zeros(len(flow))
    for cell in range(mesh.cell_count):
        scale = np.zeros(mesh.cell_count)
        scale[cell] = 1.0
        own = network.conductances(scale, 1.0).flow
        total += own
        ends = mesh.points[network.edges[np.flatnonzero(own)]].reshape(-1, 3)
        assert np.linalg.norm(ends - mesh.centroids[cell], axis=1).max() < 0.2
    np.testing.assert_allclose(total, flow, rtol=1e-9, atol=1e-12)


def crossed(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def test_flipping_gives_every_cell_its_area_again():
    """The shares of the triangles in a cell, times their areas, sum to it."""
    mesh = random_plate(0.03, SIDE, SIDE, seed=4)
    count, flat = mesh.cell_count, mesh.corners[..., :2].copy()
    turned = crossed(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]) < 0.0
    cells = mesh.cells.copy()
    cells[turned, :3], flat[turned, :3] = cells[turned, 2::-1], flat[turned, 2::-1]
    turns = np.broadcast_to(np.eye(2), (count, 4, 2, 2))
    tensors = np.broadcast_to(tensor(8.0, 25.0)[:2, :2], (count, 2, 2))
    triangles = cut(cells, flat, turns, tensors, np.arange(count), np.zeros(count, dtype=int))
    assert flip(triangles, np.empty((0, 2), dtype=int)) > 50
    a, b, c = triangles.flat.swapaxes(0, 1)
    area = 0.5 * crossed(b - a, c - a)
    own = triangles.cell >= 0
    found = np.bincount(triangles.cell[own], (area[:, None] * triangles.share)[own])
    assert found.sum() == pytest.approx(SIDE**2, rel=1e-12)
    np.testing.assert_allclose(found, mesh.areas, rtol=1e-9)


def test_flipped_edges_have_the_vectors_of_the_sheet():
    """Also where cells run the other way round; the plane of a node is that of its first cell."""
    mesh = random_plate(0.03, SIDE, SIDE, seed=2)
    cells = mesh.cells.copy()
    cells[::3, :3] = cells[::3, 2::-1]
    for one in (mesh, FlowMesh(mesh.points, cells)):
        network = network_of(one, tensor(6.0, 20.0))
        assert len(np.setdiff1d(_numbers(network.edges), _numbers(one.edges))) > 20
        edges = np.arange(len(network.edges))
        length = np.linalg.norm(np.diff(one.points[network.edges], axis=1)[:, 0], axis=1)
        for end in (0, 1):
            vectors = network.edge_vectors(edges, np.full(len(edges), end))
            np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), length, rtol=1e-12)
        # Angles between the edges at a node are those in the sheet.
        node = int(np.argmin(np.linalg.norm(one.points - one.points.mean(axis=0), axis=1)))
        at = np.flatnonzero((network.edges == node).any(axis=1))
        end = (network.edges[at, 0] != node).astype(int)
        own = network.edge_vectors(at, end)
        other = network.edges[at, 1 - end]
        true = (one.points[node] - one.points[other])[:, :2]
        np.testing.assert_allclose(own @ own.T, true @ true.T, atol=1e-15)


def test_edges_of_gates_channels_and_other_materials_stay():
    mesh = plate(8, 8, SIDE, SIDE, triangles=True)
    one = tensor(9.0, 135.0)
    diagonal = np.array([[k * 9 + k, (k + 1) * 9 + k + 1] for k in range(8)])
    free = _numbers(network_of(mesh, one).edges)
    for named in ({"tracks": [RaceTrack("gap", diagonal, 1e-12)]}, {"gates": diagonal.ravel()}):
        kept = _numbers(network_of(mesh, one, **named).edges)
        assert np.isin(_numbers(diagonal), kept).all()
        assert not np.isin(_numbers(diagonal), free).any()
    # A part that conducts a hundred times better keeps its border.
    tensors = np.broadcast_to(one, (mesh.cell_count, 3, 3)).copy()
    centre = mesh.centroids
    tensors[centre[:, 1] > centre[:, 0]] *= 100.0
    border = _numbers(Network(mesh, tensors).edges)
    assert np.isin(_numbers(diagonal), border).all()


def _numbers(edges):
    return edges[:, 0] * 10_000 + edges[:, 1]
