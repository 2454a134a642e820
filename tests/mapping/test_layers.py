"""Walls, folds and layers that are closer to each other than an edge of a mesh."""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import Status, TargetMesh, compute_weights, map_file, read_sheet
from lcmchain.mapping.fields import transfer_average
from lcmchain.mapping.surfaces.intersection import Overlaps, overlaps
from lcmchain.mapping.surfaces.pairing import choose_layers
from lcmchain.mapping.surfaces.surface import Surface

EDGE = 5e-3
LENGTH = 0.06


def shell(points, cells):
    return TargetMesh(points, (({3: "triangle", 4: "quad"}[cells.shape[1]], cells),), {})


def swept(profile, width, count):
    """Quadrilaterals over a polygon (N, 2) in the plane x, z that is swept along y."""
    y = np.linspace(0.0, width, count + 1)
    points = np.array([[x, along, z] for x, z in profile for along in y])
    node = np.arange(len(points)).reshape(len(profile), count + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    return points, np.stack(corners, axis=-1).reshape(-1, 4)


def bends(gap, walls, wall_count, bend_count):
    """Polygon of ``walls`` upright walls with a gap, joined by half circles: U, S, and so on."""
    profile, radius = [], 0.5 * gap
    for wall in range(walls):
        z = np.linspace(0.0, LENGTH, wall_count + 1)
        z = z if wall % 2 else z[::-1]
        profile.append(np.stack([np.full(len(z), wall * gap), z], axis=1))
        if wall + 1 < walls:
            angle = np.linspace(np.pi, 0.0, bend_count + 1)[1:-1]
            side, foot = (1.0, LENGTH) if wall % 2 else (-1.0, 0.0)
            middle = (wall + 0.5) * gap
            bend = [middle + radius * np.cos(angle), foot + side * radius * np.sin(angle)]
            profile.append(np.stack(bend, axis=1))
    return np.concatenate(profile)


def on_walls(make, gap, walls=2, offset=0.0, triangles=False, flipped=False, bend=4):
    """Map the number of the wall; return weights, mapped values, and what they have to be."""
    points, quads = swept(bends(gap, walls, 12, bend), LENGTH, 12)
    other, cells = swept(bends(gap, walls, 17, 3), 0.97 * LENGTH, 17)
    cells = make.triangles_of(cells) if triangles else cells
    cells = cells[:, ::-1] if flipped else cells
    number = np.rint(points[quads].mean(axis=1)[:, 0] / gap)
    sheet = read_sheet(make.forming_result(points, quads, fibre_volume_fraction=0.3 + 0.1 * number))
    target = shell(other + [offset, 5e-4, 0.0], cells)
    weights = compute_weights(sheet, target)
    values = transfer_average(sheet, weights, sheet.scalars["fibre_volume_fraction"])
    centroid = other[cells].mean(axis=1)
    upright = (centroid[:, 2] > 0.1 * LENGTH) & (centroid[:, 2] < 0.9 * LENGTH)
    return weights, values, 0.3 + 0.1 * np.rint(centroid[:, 0] / gap), upright


@pytest.mark.parametrize("gap", [0.2, 0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("offset", [0.0, 0.25, -0.25, 0.7])
@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("triangles", [False, True])
def test_no_cell_of_a_thin_u_takes_from_the_other_wall(make, gap, offset, flipped, triangles):
    """Also where the target lies nearer to the other wall: that one shows its other side."""
    gap *= EDGE
    weights, found, expected, upright = on_walls(
        make, gap, offset=offset * gap, triangles=triangles, flipped=flipped
    )
    np.testing.assert_allclose(found[upright], expected[upright], rtol=1e-12)
    assert not (weights.status == Status.AMBIGUOUS).any()


@pytest.mark.parametrize("gap", [0.2, 0.5])
def test_folds_of_a_wrinkle_that_is_pressed_flat_do_not_mix(make, gap):
    """Walls one and three of an S show the same side; the nearer one is the one."""
    weights, found, expected, upright = on_walls(make, gap * EDGE, walls=3)
    np.testing.assert_allclose(found[upright], expected[upright], rtol=1e-12)
    assert not (weights.status == Status.AMBIGUOUS).any()


def two_plates(make, gap, turned=False):
    """Two plates above each other, which show the same side or, turned, different ones."""
    points, quads = make.grid(8, 8, (0.0, 0.0), (LENGTH, LENGTH))
    both = np.concatenate([make.lifted(points), make.lifted(points) + [0.0, 0.0, gap]])
    upper = quads[:, ::-1] if turned else quads
    faces = np.concatenate([quads, upper + len(points)])
    wall = np.repeat([0.3, 0.6], len(quads))
    return make.forming_result(both, faces, areal_fibre_mass=wall, fibre_volume_fraction=wall)


def test_a_target_halfway_between_two_layers_cannot_be_mapped(make, write_mesh, tmp_path):
    gap = 0.4 * EDGE
    result = two_plates(make, gap)
    other, cells = make.grid(5, 5, (0.0, 0.0), (LENGTH, LENGTH))
    middle = write_mesh(make.lifted(other) + [0.0, 0.0, 0.52 * gap], [("quad", cells)])
    with pytest.raises(InputError, match="25 of 25 cells lie about as near to one layer"):
        map_file(result, middle, tmp_path / "m.nc", picture=False)
    assert not (tmp_path / "m.nc").exists()
    report = map_file(result, middle, tmp_path / "m.nc", picture=False, allow_ambiguous=True)
    assert report.status_count["ambiguous"] == 25
    near = write_mesh(make.lifted(other) + [0.0, 0.0, 0.1 * gap], [("quad", cells)])
    report = map_file(result, near, tmp_path / "m.nc", picture=False)
    assert report.status_count["inside"] == 25


def test_layers_that_the_target_lacks_are_told(make, write_mesh, tmp_path):
    result = two_plates(make, 0.4 * EDGE)
    other, cells = make.grid(5, 5, (0.0, 0.0), (LENGTH, LENGTH))
    lower = write_mesh(make.lifted(other), [("quad", cells)])
    report = map_file(result, lower, tmp_path / "m.nc", picture=False)
    (warning,) = [text for text in report.warnings if "no cell takes from them" in text]
    assert warning.startswith("64 faces of the sheet") and "50 %" in warning
    assert report.source_coverage == pytest.approx(0.5, rel=1e-12)


def test_a_skin_that_shows_both_sides_goes_by_distance(make):
    """Top and bottom of a closed box take from the plate near them, whatever side it shows."""
    gap = EDGE
    sheet = read_sheet(two_plates(make, gap))
    low, high = (0.0, 0.0, 0.0), (LENGTH, LENGTH, gap)
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                        for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])  # fmt: skip
    sides = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    target = shell(corners, np.array(sides))
    weights = compute_weights(sheet, target)
    found = transfer_average(sheet, weights, sheet.scalars["fibre_volume_fraction"])
    np.testing.assert_allclose(found[:2], [0.3, 0.6], rtol=1e-12)


def test_pieces_of_the_sheet_beside_each_other_are_no_rivals(make):
    """A target over two sheets that meet edge to edge takes from both in every cell."""
    points, quads = make.grid(6, 6)
    both = np.concatenate([make.lifted(points), make.lifted(points) + [1.0, 0.0, 0.0]])
    apart = np.concatenate([quads, quads[:, ::-1] + len(points)])  # and wound differently
    sheet = read_sheet(make.forming_result(both, apart, thickness=0.01))
    other, cells = make.grid(7, 3, (0.0, 0.0), (2.0, 1.0))
    weights = compute_weights(sheet, shell(make.lifted(other), cells))
    np.testing.assert_allclose(weights.coverage, 1.0, rtol=1e-12)
    assert set(weights.status) == {Status.INSIDE}


@pytest.mark.parametrize("nearer", [-1e-3, 1e-3])
@pytest.mark.parametrize(("part", "is_rival"), [(1e-11, False), (1e-2, True)])
def test_a_face_that_touches_a_cell_at_its_edge_is_no_rival(make, nearer, part, is_rival):
    """Rounding gives it a tiny area over the cell that a face over all of the cell fills."""
    points, quads = make.grid(4, 4)
    target = shell(make.lifted(points), quads)
    cells = target.polygons(np.empty((0, 3)))
    surface = Surface(make.lifted(points) + [0.0, 0.0, 0.02], quads)
    found = overlaps(surface, cells, 0.1)
    last = int(np.flatnonzero(found.cell == found.cell.max())[-1])
    touching = Overlaps(*(values[[last]] for values in found))
    touching = touching._replace(
        layer=touching.layer + 1,
        area=part * touching.area,
        height=(1.0 + nearer) * touching.height,
    )
    # faces over a curved target cover a little more than the cell
    whole = found._replace(area=1.004 * found.area)
    both = Overlaps(*(np.append(a, b, axis=0) for a, b in zip(whole, touching, strict=True)))
    choice = choose_layers(both, target.surface.winding, cells.areas, 0.1)
    assert choice.ambiguous[-1] == is_rival
    assert not choice.ambiguous[:-1].any()
    assert choice.taken[last] or is_rival
    assert not choice.taken[-1] or is_rival
