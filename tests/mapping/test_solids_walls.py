"""Two walls of one sheet that are closer than a cell is long, each meshed as a solid."""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import Status, TargetMesh, compute_weights, map_file, read_sheet, transfer

EDGE = 0.1
LENGTH = 1.0
UPPER, LOWER, BEND = 0, 1, 2


def u_sheet(make, gap):
    """A sheet folded once about y: two walls of a distance along x > 0, and the half circle."""
    radius = 0.5 * gap
    along = np.arange(0.0, LENGTH + 0.5 * EDGE, EDGE)
    count = max(int(np.ceil(np.pi * radius / EDGE)), 4)
    angle = np.linspace(0.5 * np.pi, 1.5 * np.pi, count + 1)[1:-1]
    path = np.concatenate(
        [
            np.stack([along[::-1], np.full(len(along), radius)], axis=1),
            radius * np.stack([np.cos(angle), np.sin(angle)], axis=1),
            np.stack([along, np.full(len(along), -radius)], axis=1),
        ]
    )
    places, quads = make.grid(len(path) - 1, 5, (0.0, 0.0), (len(path) - 1.0, 0.5))
    x, z = path[np.rint(places[:, 0]).astype(int)].T
    points = np.stack([x, places[:, 1], z], axis=1)
    centre = points[quads].mean(axis=1)
    wall = np.where(centre[:, 0] < 0.0, BEND, np.where(centre[:, 2] > 0.0, UPPER, LOWER))
    return points, quads, wall


def two_walls(make, gap, thickness, kind="hexahedron", low=0.15, shift=0.0):
    """Both walls as solids in other meshes than the sheet; and the wall of each cell."""
    each, walls, first = [], [], 0
    for wall, side in ((UPPER, 1.0), (LOWER, -1.0)):
        other, cells = make.grid(9, 4, (low, 0.02), (0.93, 0.47), jitter=0.2, seed=wall)
        heights = side * 0.5 * gap + shift + thickness * np.array([-0.5, 0.1, 0.5])
        nodes, solids = make.bricks(other, cells, heights, kind=kind)
        each.append((nodes, solids + first))
        walls.append(np.full(len(solids), wall))
        first += len(nodes)
    cells = np.concatenate([cells for _, cells in each])
    return (
        TargetMesh(np.concatenate([nodes for nodes, _ in each]), ((kind, cells),), {}),
        np.concatenate(walls),
    )


def folded(make, gap, thickness):
    points, quads, wall = u_sheet(make, gap)
    values = np.choose(wall, [0.7, 0.3, 0.5])
    sheet = read_sheet(
        make.forming_result(
            points, quads, thickness=thickness, fibre_volume_fraction=values,
            areal_fibre_mass=1000.0 * thickness * values,
        )
    )  # fmt: skip
    return sheet, wall


@pytest.mark.parametrize("kind", ["hexahedron", "tetra"])
@pytest.mark.parametrize("gap", [0.2, 0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("filled", [0.8, 1.0])
def test_no_cell_takes_from_the_other_wall(make, gap, filled, kind):
    """Gaps of 0.2 to 1 edge length, with a clear gap and closed; every wall has its own value."""
    gap *= EDGE
    sheet, wall = folded(make, gap, filled * gap)
    target, own = two_walls(make, gap, filled * gap, kind)
    weights = compute_weights(sheet, target)
    assert np.all(wall[weights.face] == own[weights.cell])
    assert set(weights.status) == {Status.INSIDE}
    fields = transfer(sheet, target, weights).scalars
    expected = np.choose(own, [0.7, 0.3])
    np.testing.assert_allclose(fields["fibre_volume_fraction"], expected, rtol=1e-9)
    np.testing.assert_allclose(fields["solid_thickness"], filled * gap, rtol=1e-9)


@pytest.mark.parametrize("shift", [0.05, 0.1])
def test_walls_that_lie_off_still_take_from_their_own(make, shift):
    """Moved towards the other wall by up to a tenth of the gap, at a gap of 0.4 edge lengths."""
    gap = 0.4 * EDGE
    sheet, wall = folded(make, gap, 0.8 * gap)
    target, own = two_walls(make, gap, 0.8 * gap, shift=shift * gap)
    weights = compute_weights(sheet, target)
    assert np.all(wall[weights.face] == own[weights.cell])


def test_a_cell_between_two_walls_is_ambiguous(make, tmp_path, write_mesh):
    """In the middle between both walls nothing decides: the mapping fails unless it is allowed."""
    gap = 0.4 * EDGE
    points, quads, wall = u_sheet(make, gap)
    dataset = make.forming_result(points, quads, thickness=0.8 * gap)
    other, cells = make.grid(4, 2, (0.3, 0.1), (0.7, 0.3))
    nodes, solids = make.bricks(other, cells, (-0.3 * gap, 0.3 * gap))
    weights = compute_weights(read_sheet(dataset), TargetMesh(nodes, (("hexahedron", solids),), {}))
    assert set(weights.status) == {Status.AMBIGUOUS}
    for cell in range(len(solids)):
        assert len(set(wall[weights.face[weights.cell == cell]])) == 1
    mesh = write_mesh(nodes, [("hexahedron", solids)])
    options = {"picture": False, "thickness_limit": 1.0}
    with pytest.raises(InputError, match="8 of 8 cells lie about as near to one layer"):
        map_file(dataset, mesh, tmp_path / "mapped.nc", **options)
    report = map_file(dataset, mesh, tmp_path / "mapped.nc", allow_ambiguous=True, **options)
    assert report.status_count["ambiguous"] == 8


def test_both_sides_of_a_cut_are_one_wall(make):
    """A cell over a slit of the sheet takes from both of its sides."""
    left, right = (make.grid(4, 4, (x, 0.0), (x + 0.49, 1.0)) for x in (0.0, 0.51))
    points = make.lifted(np.concatenate([left[0], right[0]]))
    quads = np.concatenate([left[1], right[1] + len(left[0])])
    sheet = read_sheet(make.forming_result(points, quads, thickness=0.02, areal_fibre_mass=0.6))
    cell, corners = make.grid(1, 1, (0.4, 0.3), (0.6, 0.7))
    target = TargetMesh(*(lambda n, c: (n, (("hexahedron", c),)))(
        *make.bricks(cell, corners, (-0.01, 0.01))), {})  # fmt: skip
    weights = compute_weights(sheet, target)
    assert weights.status[0] != Status.AMBIGUOUS
    np.testing.assert_allclose(weights.coverage, 0.9, rtol=1e-12)
    x = sheet.surface.centroids[weights.face, 0]
    assert (x < 0.5).any() and (x > 0.5).any()
