"""The front passes from any material into any other, and into every corner of any mesh."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.front import find_front
from lcmchain.coupling.infiltration.flow.network import Network, RaceTrack
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform

from .sample_meshes import plate

LENGTH, WIDTH, HEIGHT = 0.3, 0.1, 0.003
POROSITY, VISCOSITY, PRESSURE = 0.5, 0.1, 1e5
MESHES = {
    "quadrilaterals": plate(30, 4, LENGTH, WIDTH),
    "triangles": plate(30, 5, LENGTH, WIDTH, triangles=True),
}


def filled(mesh, permeability, **more):
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, permeability), VISCOSITY,
        [Gate("left", mesh.node_sets["left"], pressure=PRESSURE)],
        [Vent("right", mesh.node_sets["right"])], **more,
    )  # fmt: skip
    outcome, message = filling.advance(1e9)
    assert outcome == "filled", message
    return filling


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("ratio", [1e-3, 0.05, 5.0, 8.0, 30.0, 1e3, 1e5])
def test_two_zones_in_series(kind, ratio):
    """x of the second zone adds µx²/2K to the resistance of the first, µL/2K."""
    mesh, one = MESHES[kind], 1e-11
    other = ratio * one
    left = mesh.centroids[:, 0] < 0.5 * LENGTH
    filling = filled(mesh, np.where(left, one, other)[:, None, None] * np.eye(3))
    half = 0.5 * LENGTH
    in_first = 0.5 * half**2 / one
    in_second = half**2 / one + 0.5 * half**2 / other
    exact = POROSITY * VISCOSITY / PRESSURE * (in_first + in_second)
    assert filling.time == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("ratio", [20.0, 1e4])
def test_a_tight_strip_of_one_row_of_cells_holds_nothing_back_for_ever(ratio):
    mesh = MESHES["quadrilaterals"]
    tight = np.abs(mesh.centroids[:, 0] - 0.105) < 0.005
    filled(mesh, np.where(tight, 1e-12, ratio * 1e-12)[:, None, None] * np.eye(3))


def test_a_channel_along_edges_that_conduct_nothing_fills():
    """Fibres, ten times as permeable, run two squares aside to one along the channel."""
    mesh = plate(4, 30, 0.04, LENGTH, triangles=True)
    tensor = 1e-17 * np.array([[8.2, 3.6, 0.0], [3.6, 2.8, 0.0], [0.0, 0.0, 1.0]])
    row = mesh.node_sets["left"]
    row = row[np.argsort(mesh.points[row, 1])]
    section, conductance = 1e-6, 1e-14
    channel = RaceTrack("edge", np.stack([row[:-1], row[1:]], axis=1), conductance, section)
    filling = Filling(
        mesh, Preform(HEIGHT, 1e-9, tensor), VISCOSITY,
        [Gate("begin", row[:1], pressure=PRESSURE)], [Vent("end", row[-1:])], edges=[channel],
    )  # fmt: skip
    exact = VISCOSITY * section * LENGTH**2 / (2.0 * conductance * PRESSURE)
    filling.advance(1.01 * exact)
    times = filling.state.fill_time[row]
    assert np.isfinite(times).all()
    assert times[-1] == pytest.approx(exact, rel=1e-2)


@pytest.mark.parametrize("seed", range(8))
def test_every_corner_of_a_poor_mesh_fills(seed):
    """Needles with conductances that are mostly negative, a sheet up to 30 times orthotropic."""
    random = np.random.default_rng(seed)
    size = np.array([0.3, 0.3 * 10 ** random.uniform(-1.0, 1.0)])
    flat = np.vstack([random.uniform(0.0, 1.0, (40, 2)), [[0, 0], [1, 0], [1, 1], [0, 1]]]) * size
    corner = flat[Delaunay(flat).simplices]
    ahead, aside = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    twice = ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0]
    cells = Delaunay(flat).simplices[np.abs(twice) > 1e-9 * np.abs(twice).max()]
    angle = random.uniform(0.0, np.pi)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    tensor = turn @ np.diag([10 ** random.uniform(-10, -8.5), 1e-10, 1e-11]) @ turn.T
    mesh = FlowMesh(np.hstack([flat, np.zeros((len(flat), 1))]), cells)
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, tensor), VISCOSITY,
        [Gate("corner", [40], pressure=PRESSURE)], [Vent("opposite", [42])],
    )  # fmt: skip
    outcome, message = filling.advance(1e9)
    assert outcome == "filled", message
    assert abs(filling.state.balance_error) <= 1e-10 * filling.state.stored


def test_resin_does_not_leak_across_the_fibres_ahead_of_the_front():
    """Four times as permeable along the diagonal of its squares: 1/6 reaches the acute corner."""
    mesh = plate(6, 6, 0.06, 0.06)
    tensor = 1e-10 * np.array([[2.5, 1.5, 0.0], [1.5, 2.5, 0.0], [0.0, 0.0, 0.1]])
    network = Network(mesh, np.repeat(tensor[None], mesh.cell_count, axis=0))
    full = np.zeros(mesh.node_count, dtype=bool)
    middle = 3 * 7 + 3
    full[middle] = True
    scale = np.full(mesh.cell_count, HEIGHT / VISCOSITY)
    front = find_front(network, network.conductances(scale, 1.0), full, full.astype(float))
    along, across = [middle - 8, middle + 8], [middle - 6, middle + 6]
    assert np.isin(along, front.nodes).all()
    assert not np.isin(across, front.nodes).any()
