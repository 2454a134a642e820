"""Radial filling, ellipses of anisotropic sheets, and independence of mesh and shape in space."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform

from .sample_meshes import disc, plate, random_plate

HOLE, HEIGHT, POROSITY, VISCOSITY = 0.01, 0.003, 0.7, 0.06
PERMEABILITY, PRESSURE = 3e-10, 35e3
TIMES = (10.0, 25.0, 50.0, 100.0, 150.0, 200.0)
RADII = (0.06137, 0.08663, 0.11368, 0.15033, 0.17758, 0.20010)


def front_radius(filling, hole=HOLE):
    """Radius of the circle that holds the resin and the hole."""
    area = filling.state.stored / (HEIGHT * POROSITY)
    return np.sqrt(area / np.pi + hole**2)


def from_hole(mesh):
    return Filling(
        mesh, Preform(HEIGHT, POROSITY, PERMEABILITY), VISCOSITY,
        [Gate("hole", mesh.node_sets["hole"], pressure=PRESSURE)],
        [Vent("rim", mesh.node_sets["rim"])],
    )  # fmt: skip


def test_radial_front():
    filling = from_hole(disc(HOLE, 0.21, 0.008, 40))
    for time, radius in zip(TIMES, RADII, strict=True):
        filling.advance(time)
        assert front_radius(filling) == pytest.approx(radius, rel=1e-2 if time >= 50.0 else 1.5e-2)


def test_radial_front_on_a_coarse_mesh():
    """About 600 triangles in the disc of 0.2 m: within 2 %, early on too."""
    mesh = disc(HOLE, 0.21, 0.026, 12)
    inside = np.linalg.norm(mesh.centroids, axis=1) < 0.2
    assert 450 <= inside.sum() <= 650
    filling = from_hole(mesh)
    for time, radius in zip(TIMES, RADII, strict=True):
        filling.advance(time)
        assert front_radius(filling) == pytest.approx(radius, rel=2e-2)


def test_front_is_round_on_a_coarse_mesh():
    """Nodes are reached at the time that belongs to their radius, within a tenth of an edge."""
    mesh = disc(HOLE, 0.21, 0.026, 12)
    filling = from_hole(mesh)
    filling.advance(200.0)
    radius = np.linalg.norm(mesh.points, axis=1)
    times = filling.state.fill_time
    reached = times > 5.0
    line = np.linspace(HOLE, 0.25, 2000)
    factor = POROSITY * VISCOSITY / (2.0 * PERMEABILITY * PRESSURE)
    exact = factor * (line**2 * np.log(line / HOLE) - 0.5 * (line**2 - HOLE**2))
    away = radius[reached] - np.interp(times[reached], exact, line)
    assert np.sqrt(np.mean(away**2)) < 0.1 * 0.026
    assert np.abs(away).max() < 0.25 * 0.026


def from_point(mesh, tensor, radius, time):
    middle = int(np.argmin(np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1)))
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, tensor), VISCOSITY,
        [Gate("point", [middle], pressure=PRESSURE, radius=radius)],
        [Vent("rim", mesh.rim)],
    )  # fmt: skip
    filling.advance(time)
    return filling, mesh.points[middle]


@pytest.mark.parametrize("edge", [0.02, 0.01])
def test_point_gate_with_a_radius(edge):
    """The hole is smaller than an edge: the node's effective radius stands between."""
    mesh = random_plate(edge, 0.5, 0.5, seed=1)
    filling, _ = from_point(mesh, PERMEABILITY, 0.002, 200.0)
    line = np.linspace(0.002, 0.3, 4000)
    factor = POROSITY * VISCOSITY / (2.0 * PERMEABILITY * PRESSURE)
    exact = factor * (line**2 * np.log(line / 0.002) - 0.5 * (line**2 - 0.002**2))
    radius = np.interp(200.0, exact, line)
    assert front_radius(filling, hole=0.0) == pytest.approx(radius, rel=1e-2)


def ellipse(filling, centre, share=0.95):
    """Ratio of the axes and angle of the larger one [rad] of the front at a share of the time.

    Fitted to the points on the cells' sides where the front was then.
    """
    times, ends = filling.state.fill_time, filling.mesh.edges
    moment = share * filling.time
    ends = ends[np.isfinite(times[ends]).all(axis=1)]
    first, second = times[ends].T
    cut = (first < moment) != (second < moment)
    part = ((moment - first) / np.where(second == first, 1.0, second - first))[cut]
    a, b = filling.mesh.points[ends[cut]].swapaxes(0, 1)
    x, y = (a + part[:, None] * (b - a) - centre)[:, :2].T
    xx, xy, yy = np.linalg.lstsq(np.stack([x * x, x * y, y * y], 1), np.ones(len(x)), rcond=None)[0]
    values, vectors = np.linalg.eigh([[xx, 0.5 * xy], [0.5 * xy, yy]])
    return np.sqrt(values[1] / values[0]), np.arctan2(vectors[1, 0], vectors[0, 0]) % np.pi


def test_a_hole_in_a_corner_is_a_quarter_of_one_in_the_middle():
    filled = []
    for mesh, gate in ((plate(40, 40, 0.4, 0.4), 20 * 41 + 20), (plate(20, 20, 0.2, 0.2), 0)):
        filling = Filling(
            mesh, Preform(HEIGHT, POROSITY, PERMEABILITY), VISCOSITY,
            [Gate("hole", [gate], pressure=PRESSURE, radius=0.004)],
            [Vent("far", [mesh.node_count - 1])],
        )  # fmt: skip
        filling.advance(60.0)
        filled.append(filling.state.stored)
    assert 4.0 * filled[1] == pytest.approx(filled[0], rel=5e-3)


@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_a_hole_wider_than_the_edges_is_that_of_all_its_nodes(ratio):
    """On any mesh as on a fine one, where nodes are many."""
    tensor = PERMEABILITY * np.diag([np.sqrt(ratio), 1.0 / np.sqrt(ratio), 1.0])
    radii = []
    for edge in (0.012, 0.008, 0.006):
        mesh = random_plate(edge, 0.36, 0.36, seed=6)
        away = np.linalg.norm(mesh.points - [0.18, 0.18, 0.0], axis=1)
        filling = Filling(
            mesh, Preform(HEIGHT, POROSITY, tensor), VISCOSITY,
            [Gate("hole", np.flatnonzero(away < 0.02), pressure=PRESSURE, radius=0.02)],
            [Vent("rim", mesh.rim)],
        )  # fmt: skip
        filling.advance(40.0)
        radii.append(front_radius(filling, hole=0.0))
    if ratio == 1.0:
        line = np.linspace(0.02, 0.3, 4000)
        factor = POROSITY * VISCOSITY / (2.0 * PERMEABILITY * PRESSURE)
        exact = factor * (line**2 * np.log(line / 0.02) - 0.5 * (line**2 - 0.02**2))
        np.testing.assert_allclose(radii, np.interp(40.0, exact, line), rtol=0.015)
    assert max(radii) / min(radii) < 1.02


def test_no_pressure_that_is_shown_is_above_the_gate():
    """Nodes inside a hole stand for the field around it, which rises on towards its middle."""
    mesh = random_plate(0.005, 0.1, 0.1, seed=1)
    middle = mesh.points.mean(axis=0)
    nodes = np.flatnonzero(np.linalg.norm(mesh.points - middle, axis=1) < 0.012)
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, PERMEABILITY), VISCOSITY,
        [Gate("hole", nodes, pressure=PRESSURE, radius=0.012)], [Vent("rim", mesh.rim)],
    )  # fmt: skip
    shown = [frame.pressure.max() for frame in filling.run(1e5).frames[1:]]
    assert max(shown) <= PRESSURE * (1.0 + 1e-9)
    assert max(shown) > 0.99 * PRESSURE


@pytest.mark.parametrize(("ratio", "within"), [(1.0, 0.01), (10.0, 0.1)])
def test_a_hole_larger_than_its_only_node_fills_in_few_steps(ratio, within):
    """While the front is next to the node, the hole takes no more resistance than there is."""
    mesh = plate(60, 60, 0.15, 0.15)
    tensor = PERMEABILITY * np.diag([np.sqrt(ratio), 1.0 / np.sqrt(ratio), 1.0])
    middle = int(np.argmin(np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1)))
    filling = Filling(
        mesh, Preform(HEIGHT, POROSITY, tensor), VISCOSITY,
        [Gate("hole", [middle], pressure=PRESSURE, radius=0.002)], [Vent("rim", mesh.rim)],
    )  # fmt: skip

    def few(filling):
        assert filling.state.step_count < 100

    filling.advance(5.0, few)
    # Far away the hole is a round one of the mean of its semi-axes, where the sheet is isotropic.
    hole = 0.5 * 0.002 * (ratio**0.25 + ratio**-0.25)
    line = np.linspace(1.001 * hole, 0.2, 4000)
    factor = POROSITY * VISCOSITY / (2.0 * PERMEABILITY * PRESSURE)
    exact = factor * (line**2 * np.log(line / hole) - 0.5 * (line**2 - hole**2))
    found = front_radius(filling, hole=0.0)
    assert found == pytest.approx(np.interp(5.0, exact, line), rel=within)


SHEETS = {
    "scattered": lambda edge: random_plate(edge, 0.36, 0.36, seed=2),
    "quadrilaterals": lambda edge: plate(round(0.36 / edge), round(0.36 / edge), 0.36, 0.36),
    "triangles": lambda edge: plate(
        round(0.36 / edge), round(0.36 / edge), 0.36, 0.36, triangles=True
    ),
}


def from_point_along(mesh, ratio, degrees, time, shares=(0.6, 0.8, 0.95)):
    """A sheet whose axes are turned, and how far its front's ratio and angle are off."""
    angle = np.radians(degrees)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    tensor = np.zeros((3, 3))
    tensor[:2, :2] = axes.T @ np.diag([np.sqrt(ratio), 1.0 / np.sqrt(ratio)]) @ axes
    filling, centre = from_point(mesh, PERMEABILITY * tensor, 0.002, time)
    assert not filling.state.full[mesh.rim].any()
    found = [ellipse(filling, centre, share) for share in shares]
    off = [one / np.sqrt(ratio) - 1.0 for one, _ in found]
    turned = [(one - angle + np.pi / 2) % np.pi - np.pi / 2 for _, one in found]
    return np.array(off), np.array(turned)


@pytest.mark.parametrize(
    ("kind", "degrees"),
    [("scattered", 0.0), ("scattered", 30.0), ("scattered", 45.0), ("quadrilaterals", 45.0),
     ("quadrilaterals", 15.0), ("triangles", 135.0)],
)  # fmt: skip
def test_ellipse_of_an_orthotropic_sheet(kind, degrees):
    """Four times as permeable along the fibres, in any direction to the mesh: within 1 %."""
    off, turned = from_point_along(SHEETS[kind](0.005), 4.0, degrees, 60.0)
    assert np.abs(off).max() < 1e-2
    # One hundredth of a right angle.
    assert np.abs(turned).max() < 0.01 * np.pi / 2


@pytest.mark.parametrize("kind", SHEETS)
def test_a_strongly_orthotropic_sheet_converges(kind):
    """Ten times as permeable along the fibres; the ellipse is only nine coarse edges wide."""
    errors = []
    for edge in (0.01, 0.005, 0.0025) if kind == "scattered" else (0.01, 0.005):
        # Later, edges of the coarse mesh have ends that the front has not reached.
        off, turned = from_point_along(SHEETS[kind](edge), 10.0, 20.0, 30.0, (0.4, 0.55, 0.7))
        errors.append(np.sqrt(np.mean(off**2)))
    assert np.abs(turned).max() < 0.01 * np.pi / 2
    assert errors[1] < 1e-2
    assert errors[-1] < 0.5 * errors[0]


def test_independent_of_the_mesh():
    """Grids of quadrilaterals and triangles and scattered nodes, straight and turned by 45°."""
    tensor = np.diag([2.0, 1.0, 1.0]) * PERMEABILITY
    turn = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, np.sqrt(2.0)]]) / np.sqrt(2.0)
    radii = []
    for mesh in (
        plate(75, 75, 0.5, 0.5), plate(75, 75, 0.5, 0.5, triangles=True),
        random_plate(0.5 / 75.0, 0.5, 0.5, seed=4),
    ):  # fmt: skip
        for rotation in (np.eye(3), turn):
            # The mesh turns, the sheet's axes do not.
            turned = FlowMesh(mesh.points @ rotation.T, mesh.cells)
            filling, centre = from_point(turned, tensor, 0.002, 120.0)
            radii.append(front_radius(filling, hole=0.0))
            assert ellipse(filling, centre)[0] == pytest.approx(np.sqrt(2.0), rel=2e-2)
    assert max(radii) / min(radii) < 1.02


@pytest.mark.parametrize("triangles", [False, True])
def test_rolled_up_plate_equals_the_flat_one(triangles):
    """With an oblique tensor that turns with the sheet, from a corner."""
    flat = plate(16, 8, 0.4, 0.2, triangles=triangles)
    rolled = plate(16, 8, 0.4, 0.2, triangles=triangles, roll_radius=0.1)
    plane = np.diag([2.0, 1.0, 0.0]) + 0.4 * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    results = []
    for mesh in (flat, rolled):
        along = mesh.points[9 * 1 :][::9][:16] - mesh.points[::9][:16]
        column = np.arange(mesh.cell_count) % 128 // 8
        first = along[column] / np.linalg.norm(along[column], axis=1)[:, None]
        second = np.broadcast_to([0.0, 1.0, 0.0], first.shape)
        frame = np.stack([first, second, np.cross(first, second)], axis=1)
        tensor = PERMEABILITY * np.einsum("cmi,mn,cnj->cij", frame, plane, frame)
        filling = Filling(
            mesh, Preform(HEIGHT, POROSITY, tensor), VISCOSITY,
            [Gate("corner", [0, 1, 9], pressure=PRESSURE)],
            [Vent("end", flat.node_sets["right"])],
        )  # fmt: skip
        filling.advance(100.0)
        results.append(filling.state)
    assert 0.3 < results[0].fill.mean() < 0.95
    for name in ("fill", "pressure", "fill_time"):
        a, b = (getattr(state, name) for state in results)
        assert np.array_equal(np.isnan(a), np.isnan(b))
        assert np.nanmax(np.abs(a - b)) <= 1e-10 * np.nanmax(np.abs(a))


def test_mirrored_cells_change_nothing():
    """Cells may run clockwise or counter-clockwise."""
    mesh = random_plate(0.03, 0.4, 0.4, seed=5)
    cells = mesh.cells.copy()
    cells[::3, :3] = cells[::3, 2::-1]
    tensor = np.diag([2.0, 1.0, 1.0]) * PERMEABILITY
    volumes = []
    for one in (mesh, FlowMesh(mesh.points, cells)):
        filling, _ = from_point(one, tensor, 0.002, 60.0)
        volumes.append(filling.state.resin_volume)
    assert np.abs(volumes[0] - volumes[1]).max() <= 1e-10 * volumes[0].max()


def test_smaller_steps_change_little():
    mesh = disc(HOLE, 0.21, 0.015, 20)
    stored = []
    for step in (0.6, 0.15):
        filling = from_hole(mesh)
        filling.options = FillingOptions(front_step=step)
        filling.advance(100.0)
        stored.append(filling.state.stored)
    assert stored[0] == pytest.approx(stored[1], rel=5e-3)
