"""Solid targets: fibre mass, fibre volume fraction and thickness, and what they must not depend on.

The sheet is a plate or a bowl; the solids are its own, in other meshes.
"""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from lcmchain.mapping import Status, TargetMesh, compute_weights, read_sheet, transfer
from lcmchain.mapping.fields import content_of_cells, content_of_sheet
from lcmchain.mapping.solids.tetrahedra import solids_of_cells

KINDS = ("hexahedron", "wedge", "tetra", "pyramid")
THICKNESS = 0.04
DENSITY = 0.6 / (0.5 * THICKNESS)  # of the fibres, so that fields of the sheet agree
ONE_LAYER = (-0.5 * THICKNESS, 0.5 * THICKNESS)
THREE_LAYERS = (-0.5 * THICKNESS, -0.1 * THICKNESS, 0.2 * THICKNESS, 0.5 * THICKNESS)
DEPTH = 0.3


def solid(nodes, cells):
    kind = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10"}[cells.shape[1]]
    return TargetMesh(nodes, ((kind, cells),), {})


def mapped_onto(sheet, target):
    weights = compute_weights(sheet, target)
    return weights, transfer(sheet, target, weights).scalars


def volumes_of(target):
    return solids_of_cells(target.points, target.corners).volumes


def mass_of(target, fields):
    """Σ v_f ρ V over the whole target."""
    return np.sum(fields["fibre_volume_fraction"] * DENSITY * volumes_of(target))


@pytest.fixture(scope="module")
def plate(make):
    points, quads = make.grid(12, 12, (-0.5, -0.5), (0.5, 0.5), jitter=0.2)
    even = {"thickness": THICKNESS, "areal_fibre_mass": 0.6, "fibre_volume_fraction": 0.5}
    return read_sheet(make.forming_result(make.lifted(points), quads, **even))


@pytest.fixture(scope="module")
def uneven_bowl(make):
    points, quads = make.grid(14, 13, (-0.5, -0.5), (0.5, 0.5), jitter=0.2)
    fields = {
        "thickness": lambda c: THICKNESS * (1.0 - 0.2 * c[:, 0]),
        "areal_fibre_mass": lambda c: DENSITY * THICKNESS * (0.5 + 0.3 * c[:, 1]),
        "fibre_volume_fraction": lambda c: (0.5 + 0.3 * c[:, 1]) / (1.0 - 0.2 * c[:, 0]),
    }
    return read_sheet(make.forming_result(make.bowl(points, DEPTH), quads, **fields))


def plate_target(make, kind, heights, half=0.5, shift=0.0):
    other, cells = make.grid(9, 10, (-half, -half), (half, half), jitter=0.2, seed=1)
    return solid(*make.bricks(other, cells, np.add(heights, shift), kind=kind))


def bowl_target(make, kind, heights, half=0.42, shift=0.0):
    other, cells = make.grid(9, 10, (-half, -half), (half, half), jitter=0.2, seed=1)
    shape = make.shell_of_bowl(DEPTH)
    return solid(*make.bricks(other, cells, np.add(heights, shift), shape, kind))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("heights", [ONE_LAYER, THREE_LAYERS])
def test_on_a_plate_every_solid_cell_has_what_the_sheet_has(make, plate, kind, heights):
    """Constant fields to 1e-13, whatever the cells are and wherever they lie in the thickness."""
    target = plate_target(make, kind, heights)
    weights, fields = mapped_onto(plate, target)
    for name, value in (
        ("fibre_volume_fraction", 0.5), ("thickness", THICKNESS), ("areal_fibre_mass", 0.6),
        ("solid_thickness", THICKNESS),
    ):  # fmt: skip
        np.testing.assert_allclose(fields[name], value, rtol=1e-13)
    np.testing.assert_allclose(fields["thickness_difference"], 0.0, atol=1e-13)
    np.testing.assert_allclose(weights.coverage, 1.0, rtol=1e-13)
    assert set(weights.status) == {Status.INSIDE}
    whole = np.sum(0.6 * plate.surface.areas)
    assert mass_of(target, fields) == pytest.approx(whole, rel=1e-13)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("heights", [ONE_LAYER, THREE_LAYERS])
@pytest.mark.parametrize("shift", [0.0, 0.3 * THICKNESS])
def test_the_fibre_mass_of_a_curved_solid_is_that_of_the_covered_sheet(
    make, uneven_bowl, kind, heights, shift
):
    """Σ v_f ρ V to 1e-12 with an uneven sheet, also where the target ends inside of faces."""
    target = bowl_target(make, kind, heights, shift=shift)
    weights, fields = mapped_onto(uneven_bowl, target)
    mass = uneven_bowl.scalars["areal_fibre_mass"]
    covered = content_of_sheet(uneven_bowl, weights, mass)
    assert mass_of(target, fields) == pytest.approx(covered, rel=1e-12)
    # of first order every face hands on its covered share
    even = compute_weights(uneven_bowl, target, order=1)
    shares = np.sum(mass * uneven_bowl.surface.areas * even.face_coverage)
    first = transfer(uneven_bowl, target, even).scalars
    assert mass_of(target, first) == pytest.approx(shares, rel=1e-12)
    assert covered == pytest.approx(shares, rel=1e-4)
    assert weights.wedge_correction == 0.0  # nothing was scaled
    shares = np.bincount(weights.face, weights.content, minlength=weights.face_count)
    np.testing.assert_allclose(shares, weights.face_coverage, atol=1e-13)
    assert content_of_cells(weights, fields["areal_fibre_mass"]) == pytest.approx(
        content_of_sheet(uneven_bowl, weights, mass), rel=1e-12
    )
    # the covered sheet is what lies over the target: the paraboloid over its square
    fine = make.grid(400, 400, (-0.42, -0.42), (0.42, 0.42))[0].reshape(401, 401, 2)
    middle = 0.25 * (fine[1:, 1:] + fine[:-1, 1:] + fine[1:, :-1] + fine[:-1, :-1])
    slope = np.sqrt(1.0 + 4.0 * DEPTH**2 * (middle**2).sum(axis=2))
    area_mass = slope * DENSITY * THICKNESS * (0.5 + 0.3 * middle[..., 1]) * (0.84 / 400) ** 2
    assert covered == pytest.approx(area_mass.sum(), rel=3e-3)


def test_a_curved_solid_has_the_fields_of_the_sheet(make, uneven_bowl):
    """Within what facets of this size differ from the paraboloid, in every layer."""
    target = bowl_target(make, "hexahedron", THREE_LAYERS)
    _, fields = mapped_onto(uneven_bowl, target)
    x, y = target.centroids[:, 0], target.centroids[:, 1]
    # less sure where the target ends inside of faces
    inside = np.abs(target.centroids[:, :2]).max(axis=1) < 0.3
    np.testing.assert_allclose(fields["solid_thickness"], THICKNESS, rtol=1.5e-2)
    np.testing.assert_allclose(fields["solid_thickness"][inside], THICKNESS, rtol=4e-3)
    np.testing.assert_allclose(fields["thickness"], THICKNESS * (1.0 - 0.2 * x), rtol=5e-3)
    difference = THICKNESS / fields["thickness"] - 1.0
    np.testing.assert_allclose(fields["thickness_difference"], difference, atol=1.5e-2)
    # the formed mass in the thickness of the solid
    found = fields["fibre_volume_fraction"]
    np.testing.assert_allclose(found, 0.5 + 0.3 * y, atol=1.2e-2)
    np.testing.assert_allclose(found[inside], (0.5 + 0.3 * y)[inside], atol=6e-3)
    for layer in np.split(found, 3)[1:]:  # uniform through the thickness
        np.testing.assert_allclose(layer, found[: len(layer)], rtol=4e-3)


@pytest.mark.parametrize("side", [-0.5, 0.5])
def test_the_thickness_beside_a_curved_sheet_is_measured_along_the_normal(make, side):
    """A solid on one face of the tool: there its area is off by 8 %."""
    points, quads = make.grid(20, 20, (-0.3, -0.3), (0.3, 0.3), jitter=0.1)
    depth, half = 1.0, 0.5 * THICKNESS
    sheet = read_sheet(make.forming_result(make.bowl(points, depth), quads, thickness=THICKNESS))
    other, cells = make.grid(17, 17, (-0.2, -0.2), (0.2, 0.2), jitter=0.1, seed=1)
    heights = 2.0 * side * half + np.array([-half, half])
    nodes, corners = make.bricks(other, cells, heights, make.shell_of_bowl(depth))
    _, fields = mapped_onto(sheet, solid(nodes, corners))
    inside = np.abs(nodes[corners].mean(axis=1)[:, :2]).max(axis=1) < 0.15
    found = fields["solid_thickness"][inside]
    assert np.abs(found / THICKNESS - 1.0).max() < 0.015


@pytest.mark.parametrize(("factor", "shift"), [(8.0, 0.0), (0.5, 0.0), (1.0, 0.9), (1.3, -0.4)])
def test_thicker_thinner_and_shifted_solids_hold_the_same_mass(make, plate, factor, shift):
    """A solid of eight times the thickness has an eighth of the fibre volume fraction."""
    target = plate_target(make, "wedge", factor * np.array(THREE_LAYERS), shift=shift * THICKNESS)
    _, fields = mapped_onto(plate, target)
    np.testing.assert_allclose(fields["solid_thickness"], factor * THICKNESS, rtol=1e-12)
    np.testing.assert_allclose(fields["thickness_difference"], factor - 1.0, atol=1e-12)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], 0.5 / factor, rtol=1e-12)
    np.testing.assert_allclose(fields["areal_fibre_mass"], 0.6, rtol=1e-12)
    whole = np.sum(0.6 * plate.surface.areas)
    assert mass_of(target, fields) == pytest.approx(whole, rel=1e-12)


def test_a_target_that_ends_inside_of_faces_takes_the_part_that_it_covers(make, plate):
    half = 0.37
    target = plate_target(make, "hexahedron", THREE_LAYERS, half=half)
    weights, fields = mapped_onto(plate, target)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], 0.5, rtol=1e-11)
    assert mass_of(target, fields) == pytest.approx(0.6 * (2.0 * half) ** 2, rel=1e-12)
    covered = np.sum(plate.surface.areas * weights.face_coverage)
    assert covered == pytest.approx((2.0 * half) ** 2, rel=1e-12)
    cut = (weights.face_coverage > 0.01) & (weights.face_coverage < 0.99)
    assert cut.sum() > 20


def test_cells_beyond_the_sheet_hold_no_fibre(make, plate):
    """What lies beyond the sheet is resin: a cell half beyond it has half of the fibre."""
    other, cells = make.grid(3, 1, (0.4, -0.3), (0.7, 0.3))
    target = solid(*make.bricks(other, cells, ONE_LAYER))
    shifted = TargetMesh(target.points + [0.05, 0.0, 0.0], target.blocks, {})
    weights, fields = mapped_onto(plate, shifted)
    np.testing.assert_allclose(weights.coverage, [0.5, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], [0.25, 0.0, 0.0], atol=1e-12)
    assert weights.status[0] == Status.EXTRAPOLATED
    np.testing.assert_allclose(fields["thickness"][0], THICKNESS, rtol=1e-12)
    assert mass_of(shifted, fields) == pytest.approx(0.6 * 0.05 * 0.6, rel=1e-12)


def test_tetrahedra_between_scattered_points_hold_the_mass(make, plate):
    generator = np.random.default_rng(4)
    inner = generator.uniform(-0.5, 0.5, (300, 3)) * [1.0, 1.0, THICKNESS]
    other, _ = make.grid(8, 8, (-0.5, -0.5), (0.5, 0.5), jitter=0.2, seed=5)
    skin = [make.lifted(other) + [0.0, 0.0, z] for z in ONE_LAYER]
    nodes = np.concatenate([inner, *skin])
    stretched = nodes * [1.0, 1.0, 8.0]  # so that the tetrahedra are not slivers
    cells = Delaunay(stretched).simplices.astype(np.int64)
    target = solid(nodes, cells[volumes_of(solid(nodes, cells)) > 1e-9])
    _, fields = mapped_onto(plate, target)
    whole = np.sum(0.6 * plate.surface.areas)
    assert mass_of(target, fields) == pytest.approx(whole, rel=1e-12)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], 0.5, rtol=1e-6)


def test_layers_that_do_not_fit_hold_the_same(make, plate):
    """Cells that meet without common nodes: what lies between them is no skin of the target."""
    parts = []
    for n, heights in ((9, ONE_LAYER[0] * np.array([1.0, 0.0])), (7, [0.0, ONE_LAYER[1]])):
        other, cells = make.grid(n, n, (-0.37, -0.37), (0.37, 0.37), jitter=0.2, seed=n)
        parts.append(make.bricks(other, cells, heights))
    nodes = np.concatenate([parts[0][0], parts[1][0]])
    target = solid(nodes, np.concatenate([parts[0][1], parts[1][1] + len(parts[0][0])]))
    _, fields = mapped_onto(plate, target)
    np.testing.assert_allclose(fields["fibre_volume_fraction"], 0.5, rtol=1e-11)
    assert mass_of(target, fields) == pytest.approx(0.6 * 0.74**2, rel=1e-12)


# --- what a mapping must not depend on ------------------------------------------------------------


def everything(sheet, target, order=2):
    weights = compute_weights(sheet, target, order=order)
    fields = transfer(sheet, target, weights).scalars
    return np.stack([*fields.values(), weights.coverage, weights.distance])


@pytest.mark.parametrize("kind", KINDS)
def test_numbering_means_nothing(make, uneven_bowl, kind):
    """Nodes, cells, faces and the first corner of each in any order: the same to 1e-12.

    Of first order, as the centroid of a warped face depends on the corner that it starts with.
    """
    target = bowl_target(make, kind, THREE_LAYERS, half=0.4)
    before = everything(uneven_bowl, target, order=1)
    generator = np.random.default_rng(6)
    faces = uneven_bowl.surface.faces
    nodes, order = (generator.permutation(n) for n in (len(uneven_bowl.surface.points), len(faces)))
    place = np.argsort(nodes)
    turned = np.stack([np.roll(row, k) for row, k in zip(faces, generator.integers(0, 4, 999))])
    fields = {name: values[order] for name, values in uneven_bowl.scalars.items()}
    sheet = read_sheet(
        make.forming_result(uneven_bowl.surface.points[nodes], place[turned[order]], **fields)
    )
    cells = target.blocks[0][1]
    turns = {
        "hexahedron": [1, 2, 3, 0, 5, 6, 7, 4],
        "wedge": [1, 2, 0, 4, 5, 3],
        "tetra": [1, 2, 0, 3],
        "pyramid": [1, 2, 3, 0, 4],
    }
    numbers, rows = (generator.permutation(n) for n in (len(target.points), len(cells)))
    renumbered = np.argsort(numbers)[cells[:, turns[kind]]][rows]
    after = everything(sheet, solid(target.points[numbers], renumbered), order=1)
    np.testing.assert_allclose(after, before[:, rows], rtol=1e-12, atol=1e-12)


def test_a_rigid_motion_means_nothing(make, uneven_bowl):
    target = bowl_target(make, "hexahedron", THREE_LAYERS, half=0.4)
    before = everything(uneven_bowl, target)
    rotation = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    shift = [0.1, -0.2, 0.3]
    sheet = read_sheet(
        make.forming_result(
            uneven_bowl.surface.points @ rotation.T + shift,
            uneven_bowl.surface.faces,
            **uneven_bowl.scalars,
        )
    )
    moved = TargetMesh(target.points @ rotation.T + shift, target.blocks, {})
    np.testing.assert_allclose(everything(sheet, moved), before, rtol=1e-12, atol=1e-12)


def test_the_upper_side_of_the_sheet_means_nothing(make, uneven_bowl):
    target = bowl_target(make, "wedge", THREE_LAYERS, half=0.4)
    flipped = read_sheet(
        make.forming_result(
            uneven_bowl.surface.points, uneven_bowl.surface.faces[:, ::-1], **uneven_bowl.scalars
        )
    )
    np.testing.assert_allclose(
        everything(flipped, target, order=1),
        everything(uneven_bowl, target, order=1),
        rtol=1e-12, atol=1e-12,
    )  # fmt: skip


def test_faces_that_are_wound_the_other_way_are_the_same(make, uneven_bowl):
    target = bowl_target(make, "wedge", THREE_LAYERS, half=0.4)
    faces = uneven_bowl.surface.faces.copy()
    faces[3::5] = faces[3::5, ::-1]
    points = uneven_bowl.surface.points
    mixed = read_sheet(make.forming_result(points, faces, **uneven_bowl.scalars))
    np.testing.assert_allclose(
        everything(mixed, target, order=1),
        everything(uneven_bowl, target, order=1),
        rtol=1e-12, atol=1e-12,
    )  # fmt: skip


def test_cells_that_are_numbered_inside_out_are_the_same(make, uneven_bowl):
    target = bowl_target(make, "hexahedron", THREE_LAYERS, half=0.37)
    turned = target.blocks[0][1][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    np.testing.assert_allclose(
        everything(uneven_bowl, solid(target.points, turned)),
        everything(uneven_bowl, target),
        rtol=1e-12, atol=1e-12,
    )  # fmt: skip


def test_cells_with_middle_nodes_are_those_of_their_corners(make, uneven_bowl):
    target = bowl_target(make, "tetra", ONE_LAYER, half=0.4)
    cells = target.blocks[0][1]
    edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    middles = np.stack([target.points[cells[:, e]].mean(axis=1) for e in edges], axis=1)
    count = len(target.points)
    numbers = count + np.arange(middles.size // 3).reshape(-1, 6)
    nodes = np.concatenate([target.points, middles.reshape(-1, 3)])
    quadratic = solid(nodes, np.hstack([cells, numbers]))
    np.testing.assert_array_equal(
        everything(uneven_bowl, quadratic), everything(uneven_bowl, target)
    )


def test_nodes_that_are_repeated_from_cell_to_cell_are_the_same(make, uneven_bowl):
    """As files hold them that are written part by part, of the sheet and of the target."""
    target = bowl_target(make, "hexahedron", THREE_LAYERS, half=0.37)
    cells = target.blocks[0][1]
    apart = solid(target.points[cells].reshape(-1, 3), np.arange(cells.size).reshape(cells.shape))
    faces = uneven_bowl.surface.faces
    points = uneven_bowl.surface.points[faces].reshape(-1, 3)
    loose = np.arange(faces.size).reshape(faces.shape)
    sheet = read_sheet(make.forming_result(points, loose, **uneven_bowl.scalars))
    np.testing.assert_allclose(
        everything(sheet, apart), everything(uneven_bowl, target), rtol=1e-12, atol=1e-12
    )


def test_a_wrinkled_solid_is_covered_to_its_outline(make):
    """Thin cells whose sides are warped by more than they are thick, to the edge of the sheet."""
    points, quads = make.grid(14, 14, (-0.5, -0.5), (0.5, 0.5), jitter=0.1)

    def wrinkled(p, z):
        x, y = p.T
        slope_x = 0.4 * np.cos(8.0 * x) * np.cos(7.0 * y)
        slope_y = -0.35 * np.sin(8.0 * x) * np.sin(7.0 * y)
        normal = np.stack([-slope_x, -slope_y, np.ones(len(p))], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        height = 0.05 * np.sin(8.0 * x) * np.cos(7.0 * y)
        return np.stack([x, y, height], axis=1) + z * normal

    even = {"thickness": 0.009, "areal_fibre_mass": 0.6, "fibre_volume_fraction": 0.5}
    sheet = read_sheet(make.forming_result(wrinkled(points, 0.0), quads, **even))
    target = solid(*make.bricks(points, quads, (-0.0045, -0.0015, 0.0015, 0.0045), wrinkled))
    weights, fields = mapped_onto(sheet, target)
    np.testing.assert_array_equal(weights.face_coverage, 1.0)
    mass = np.sum(fields["fibre_volume_fraction"] * 0.6 / 0.0045 * volumes_of(target))
    assert mass == pytest.approx(np.sum(0.6 * sheet.surface.areas), rel=1e-12)
    np.testing.assert_allclose(fields["solid_thickness"], 0.009, rtol=0.03)
