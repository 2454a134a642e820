"""Properties of a mapping: constants, linear fields, conservation, rotation, status, storage."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from lcmchain.errors import InputError
from lcmchain.mapping import (
    MappingWeights,
    Status,
    TargetMesh,
    compute_weights,
    read_sheet,
    transfer,
)
from lcmchain.mapping.fields import content_of_cells, content_of_sheet, transfer_average
from lcmchain.mapping.report import mapping_report
from lcmchain.mapping.surfaces.averages import map_directions
from lcmchain.mapping.weights import default_maximum_distance

METHODS = ("overlap", "closest")


def shell(points, cells):
    return TargetMesh(points, (("triangle" if cells.shape[1] == 3 else "quad", cells),), {})


def rotation_of(turn):
    """Rotation matrix of a rotation vector."""
    angle = np.linalg.norm(turn)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.array(turn) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.fixture(scope="module")
def bowls(make):
    """The same paraboloid meshed twice: 12 x 12 quadrilaterals, and triangles on another grid."""
    points, quads = make.grid(12, 12, (-0.5, -0.5), (0.5, 0.5), jitter=0.2, seed=3)
    other, cells = make.grid(9, 10, (-0.5, -0.5), (0.5, 0.5), jitter=0.2, seed=4)
    return (make.bowl(points), quads), (make.bowl(other), make.triangles_of(cells))


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_field_stays_constant(make, bowls, method):
    source, target = bowls
    sheet = read_sheet(make.forming_result(*source, thickness=0.7, fibre_volume_fraction=0.42))
    target = shell(*target)
    weights = compute_weights(sheet, target, method=method)
    mapped = transfer(sheet, target, weights)
    np.testing.assert_allclose(mapped.scalars["thickness"], 0.7, rtol=1e-12)
    np.testing.assert_allclose(mapped.scalars["fibre_volume_fraction"], 0.42, rtol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_mesh_mapped_onto_itself_returns_every_value(make, bowls, method):
    source, _ = bowls
    values = np.random.default_rng(0).uniform(0.3, 0.7, len(source[1]))
    sheet = read_sheet(make.forming_result(*source, fibre_volume_fraction=values))
    weights = compute_weights(sheet, shell(*source), method=method, order=1)
    # Seen along the normals of their triangles, warped quadrilaterals overlap a sliver.
    np.testing.assert_allclose(
        transfer_average(sheet, weights, values), values, atol=5e-3 if method == "overlap" else 0.0
    )
    assert set(weights.status) == {Status.INSIDE}


def test_a_linear_field_is_exact_on_the_same_plane_mesh(make):
    points, quads = make.grid(7, 8, jitter=0.3)
    linear = lambda c: 0.2 + 0.5 * c[:, 0] - 0.1 * c[:, 1]  # noqa: E731
    sheet = read_sheet(
        make.forming_result(make.lifted(points), quads, fibre_volume_fraction=linear)
    )
    weights = compute_weights(sheet, shell(make.lifted(points), quads))
    expected = sheet.scalars["fibre_volume_fraction"]
    found = transfer_average(sheet, weights, expected)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_smooth_field_converges_at_first_order_or_better(make):
    smooth = lambda c: np.sin(5.0 * c[:, 0]) * np.cos(4.0 * c[:, 1])  # noqa: E731
    errors = []
    for n in (8, 16, 32):
        points, quads = make.grid(n, n, jitter=0.2, seed=n)
        other, cells = make.grid(n + 3, n + 1, jitter=0.2, seed=n + 1)
        sheet = read_sheet(
            make.forming_result(make.lifted(points), quads, fibre_volume_fraction=smooth)
        )
        target = shell(make.lifted(other), make.triangles_of(cells))
        weights = compute_weights(sheet, target)
        found = transfer_average(sheet, weights, sheet.scalars["fibre_volume_fraction"])
        errors.append(np.sqrt(np.mean((found - smooth(target.centroids)) ** 2)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(rates > 0.85), (errors, rates)


def test_fibre_mass_is_conserved_between_plates(make):
    points, quads = make.grid(11, 9, jitter=0.3, seed=1)
    other, cells = make.grid(6, 7, jitter=0.3, seed=2)
    uneven = lambda c: 0.6 + 0.3 * np.sin(9.0 * c[:, 0] * c[:, 1])  # noqa: E731
    sheet = read_sheet(make.forming_result(make.lifted(points), quads, areal_fibre_mass=uneven))
    target = shell(make.lifted(other), cells)
    weights = compute_weights(sheet, target)
    mapped = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
    exact = np.sum(sheet.scalars["areal_fibre_mass"] * sheet.surface.areas)
    np.testing.assert_allclose(np.sum(mapped * target.surface.areas), exact, rtol=1e-12)
    np.testing.assert_allclose(weights.face_coverage, 1.0, rtol=1e-12)
    assert weights.wedge_correction < 1e-12
    # Local, too: a cell receives what lies over it, between the extremes of its surroundings.
    assert np.all(mapped > 0.29) and np.all(mapped < 0.91)


def test_fibre_mass_is_conserved_between_curved_meshes(make, bowls):
    source, target = bowls
    sheet = read_sheet(make.forming_result(*source, areal_fibre_mass=lambda c: 0.5 + c[:, 0] ** 2))
    target = shell(*target)
    weights = compute_weights(sheet, target)
    mapped = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
    mass = sheet.scalars["areal_fibre_mass"]
    assert content_of_cells(weights, mapped) == pytest.approx(
        content_of_sheet(sheet, weights, mass), rel=1e-12
    )
    # Both meshes cover the bowl, so the whole mass has to arrive, and locally unchanged.
    assert content_of_cells(weights, mapped) == pytest.approx(
        np.sum(mass * sheet.surface.areas), rel=2e-3
    )
    np.testing.assert_allclose(mapped, 0.5 + target.centroids[:, 0] ** 2, atol=0.05)
    assert weights.wedge_correction < 0.1


@pytest.mark.parametrize("offset", [-0.05, 0.05])
def test_no_fibre_is_lost_between_the_cells_of_a_bent_target(make, offset):
    """Off the sheet, prisms over neighbouring cells of an arc leave or share thin wedges."""

    def arc(points, radius):
        angle, width = points.T
        return np.stack([radius * np.sin(angle), width, radius * np.cos(angle)], axis=1)

    points, quads = make.grid(24, 4)
    other, cells = make.grid(9, 3, (-0.2, -0.2), (1.2, 1.2))
    sheet = read_sheet(make.forming_result(arc(points, 1.0), quads, areal_fibre_mass=0.6))
    target = shell(arc(other, 1.0 + offset), cells)
    weights = compute_weights(sheet, target, maximum_distance=0.2)
    np.testing.assert_allclose(weights.face_coverage, 1.0, rtol=1e-14)
    assert weights.wedge_correction < 1e-12  # tiled, not scaled
    mapped = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
    whole = 0.6 * sheet.surface.areas.sum()
    assert content_of_cells(weights, mapped) == pytest.approx(whole, rel=1e-12)


def test_no_fibre_is_lost_at_a_sharp_bend(make):
    """A target inside of a corner leaves a strip of the sheet along it, which is handed on."""

    def corner(points, inside):
        along, width = points.T
        flat = np.minimum(along, 1.0 - inside)
        return np.stack([flat, width, inside + np.maximum(along - (1.0 - inside), 0.0)], axis=1)

    points, quads = make.grid(20, 4, (0.0, 0.0), (2.0, 1.0))
    other, cells = make.grid(26, 5, (0.0, 0.0), (1.94, 1.0))
    other[:, 0] = np.interp(other[:, 0], [0.0, 0.97, 1.94], [0.0, 0.97, 2.0 - 0.06])
    sheet = read_sheet(make.forming_result(corner(points, 0.0), quads, areal_fibre_mass=0.6))
    target = shell(corner(other, 0.03), cells)
    weights = compute_weights(sheet, target, maximum_distance=0.2)
    assert 0.1 < weights.wedge_correction < 0.6
    mapped = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
    covered = content_of_sheet(sheet, weights, sheet.scalars["areal_fibre_mass"])
    assert content_of_cells(weights, mapped) == pytest.approx(covered, rel=1e-12)
    beside_corner = np.abs(sheet.surface.centroids[:, [0, 2]] - [1.0, 0.0]).max(axis=1) < 0.1
    inner = beside_corner & (np.abs(sheet.surface.centroids[:, 1] - 0.5) < 0.25)
    assert inner.sum() == 4
    np.testing.assert_allclose(weights.face_coverage[inner], 1.0, rtol=1e-12)


@settings(max_examples=15)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), st.sampled_from(METHODS))
def test_a_rotated_pair_of_meshes_maps_the_same(make, bowls, turn, method):
    (points, quads), (other, cells) = bowls
    rotation = rotation_of(turn)
    first, second = make.families(points, quads, shear=0.3)
    fields = {"areal_fibre_mass": lambda c: 0.6 + 0.1 * np.arange(len(c)) / len(c)}
    results = []
    for r in (np.eye(3), rotation):
        fibres = {"fibre_direction_1": first @ r.T, "fibre_direction_2": second @ r.T}
        sheet = read_sheet(make.forming_result(points @ r.T, quads, **fields, **fibres))
        target = shell(other @ r.T, cells)
        weights = compute_weights(sheet, target, method=method)
        results.append((weights, transfer(sheet, target, weights)))
    (weights, still), (turned_weights, turned) = results
    np.testing.assert_array_equal(weights.status, turned_weights.status)
    np.testing.assert_allclose(weights.distance, turned_weights.distance, atol=1e-12)
    mass = "areal_fibre_mass"
    np.testing.assert_allclose(turned.scalars[mass], still.scalars[mass], rtol=1e-9)
    for name, family in still.directions.items():
        expected = family.direction @ rotation.T
        np.testing.assert_allclose(turned.directions[name].direction, expected, atol=1e-8)


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_signs_of_fibre_directions_have_no_meaning(make, bowls, seed):
    (points, quads), (other, cells) = bowls
    first, second = make.families(points, quads, shear=-0.4)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (2, len(quads), 1))
    target = shell(other, cells)
    found = []
    for s in (np.ones_like(signs), signs):
        fibres = {"fibre_direction_1": s[0] * first, "fibre_direction_2": s[1] * second}
        sheet = read_sheet(make.forming_result(points, quads, **fibres))
        weights = compute_weights(sheet, target)
        found.append(transfer(sheet, target, weights).directions)
    for name in ("fibre_direction_1", "fibre_direction_2"):
        a, b = found[0][name].direction, found[1][name].direction
        np.testing.assert_allclose(np.abs(np.einsum("ci,ci->c", a, b)), 1.0, atol=1e-12)


def test_fibre_directions_lie_in_the_cells_and_keep_their_angle(make, bowls):
    (points, quads), (other, cells) = bowls
    shear = 0.35
    first, second = make.families(points, quads, shear)
    sheet = read_sheet(
        make.forming_result(points, quads, fibre_direction_1=first, fibre_direction_2=second)
    )
    target = shell(other, cells)
    mapped = transfer(sheet, target, compute_weights(sheet, target)).directions
    a, b = (mapped[f"fibre_direction_{k}"].direction for k in (1, 2))
    for family in (a, b):
        np.testing.assert_allclose(np.linalg.norm(family, axis=1), 1.0, rtol=1e-12)
        in_plane = np.einsum("ci,ci->c", family, target.surface.normals)
        np.testing.assert_allclose(in_plane, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.arcsin(np.abs(np.sum(a * b, axis=1))), shear, atol=0.02)


def test_the_mean_of_two_axes_bisects_their_acute_angle(make):
    points, quads = make.grid(2, 1)
    fibres = np.array([[np.cos(x), np.sin(x), 0.0] for x in np.radians([80.0, 120.0])])
    sheet = read_sheet(
        make.forming_result(make.lifted(points), quads, fibre_direction_1=fibres * [[1], [-1]])
    )
    cell = shell(
        make.lifted(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])), np.array([[0, 1, 2, 3]])
    )
    family = transfer(sheet, cell, compute_weights(sheet, cell)).directions["fibre_direction_1"]
    expected = [np.cos(np.radians(100.0)), np.sin(np.radians(100.0)), 0.0]
    np.testing.assert_allclose(np.abs(family.direction[0] @ expected), 1.0, rtol=1e-12)
    np.testing.assert_allclose(family.alignment, 0.5 * (1.0 + np.cos(np.radians(40.0))))


@pytest.mark.parametrize("method", METHODS)
def test_every_cell_says_how_it_was_mapped(make, method):
    """A target twice as long as the sheet: over it, across its edge, near it, and far from it."""
    points, quads = make.grid(10, 10)
    sheet = read_sheet(make.forming_result(make.lifted(points), quads, areal_fibre_mass=0.6))
    other, cells = make.grid(8, 1, (0.2, 0.0), (1.8, 1.0))
    target = shell(make.lifted(other), cells)
    weights = compute_weights(sheet, target, method=method, maximum_distance=0.35)
    expected = [Status.INSIDE] * 4 + [Status.EXTRAPOLATED] * 2 + [Status.UNMAPPED] * 2
    np.testing.assert_array_equal(weights.status, expected)
    mapped = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
    np.testing.assert_allclose(mapped[:6], 0.6, rtol=1e-12)
    assert np.isnan(mapped[6:]).all() and np.isnan(weights.distance[6:]).all()
    np.testing.assert_allclose(weights.distance[4:6], [0.1, 0.3], rtol=1e-9)


def test_coverage_of_half_overlapping_plates_is_exact(make):
    points, quads = make.grid(7, 6, jitter=0.2)
    sheet = read_sheet(make.forming_result(make.lifted(points), quads, areal_fibre_mass=0.6))
    other, cells = make.grid(9, 5, (0.37, 0.0), (1.37, 1.0), jitter=0.2)
    target = shell(make.lifted(other), cells)
    weights = compute_weights(sheet, target)
    assert np.sum(weights.coverage * weights.cell_area) == pytest.approx(0.63, rel=1e-12)
    assert np.sum(weights.face_coverage * sheet.surface.areas) == pytest.approx(0.63, rel=1e-12)
    mapped = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
    assert content_of_cells(weights, mapped) == pytest.approx(0.6 * 0.63, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_distance_decides_between_inside_projected_and_unmapped(make, method):
    points, quads = make.grid(10, 10)
    sheet = read_sheet(make.forming_result(make.lifted(points), quads, thickness=0.02))
    other, cells = make.grid(4, 4, (0.1, 0.1), (0.9, 0.9))
    found = {}
    for height in (0.009, -0.011, 0.06, 0.11):
        target = shell(make.lifted(other) + [0.0, 0.0, height], cells)
        weights = compute_weights(sheet, target, method=method, maximum_distance=0.1)
        (found[height],) = set(weights.status)
        if height < 0.1:
            np.testing.assert_allclose(weights.distance, abs(height), rtol=1e-12)
    assert list(found.values()) == [
        Status.INSIDE,
        Status.PROJECTED,
        Status.PROJECTED,
        Status.UNMAPPED,
    ]


def test_no_mapped_cell_is_farther_than_the_largest_distance(make):
    """Cells at random: of steep faces a part may be near whose plane is far off the centroid."""
    random = np.random.default_rng(2)
    points, quads = make.grid(6, 6)
    sheet = read_sheet(make.forming_result(make.bowl(points, depth=1.0), quads))
    corners = random.uniform([0.0, 0.0, -0.5], [1.0, 1.0, 2.5], (400, 1, 3))
    corners = corners + random.uniform(-0.4, 0.4, (400, 3, 3))
    target = shell(corners.reshape(-1, 3), np.arange(1200).reshape(-1, 3))
    weights = compute_weights(sheet, target, maximum_distance=0.3)
    assert weights.mapped.sum() > 50
    assert np.nanmax(weights.distance) <= 0.3
    assert np.isfinite(weights.distance[weights.mapped]).all()


def test_opposite_walls_do_not_mix(make):
    """Two plates one edge length apart; each wall of the target takes its own wall's values."""
    points, quads = make.grid(10, 10)
    far = 0.3
    both = np.concatenate([make.lifted(points), make.lifted(points) + [0.0, 0.0, far]])
    faces = np.concatenate([quads, quads + len(points)])
    wall = np.repeat([0.3, 0.6], len(quads))
    sheet = read_sheet(make.forming_result(both, faces, fibre_volume_fraction=wall))
    other, cells = make.grid(7, 7)
    for height, value in ((0.02, 0.3), (far - 0.03, 0.6)):
        target = shell(make.lifted(other) + [0.0, 0.0, height], cells)
        weights = compute_weights(sheet, target)
        np.testing.assert_allclose(transfer_average(sheet, weights, wall), value, rtol=1e-12)


def test_a_cell_takes_one_layer_of_a_fold(make):
    """Two layers of the sheet lie over every cell: the nearer one counts, the other is missed."""
    points, quads = make.grid(10, 10)
    layers = np.concatenate([make.lifted(points), make.lifted(points) + [0.0, 0.0, 1e-3]])
    faces = np.concatenate([quads, quads + len(points)])
    sheet = read_sheet(make.forming_result(layers, faces, areal_fibre_mass=0.6))
    other, cells = make.grid(7, 7)
    target = shell(make.lifted(other), cells)
    weights = compute_weights(sheet, target)
    mapped = transfer(sheet, target, weights).scalars
    np.testing.assert_allclose(mapped["areal_fibre_mass"], 0.6, rtol=1e-12)
    np.testing.assert_allclose(weights.coverage, 1.0, rtol=1e-12)
    np.testing.assert_allclose(weights.face_coverage[: len(quads)], 1.0, rtol=1e-12)
    np.testing.assert_array_equal(weights.face_coverage[len(quads) :], 0.0)


def solid_plate(make, kind):
    """Plate of 6 x 5 x 2 bricks from z = -0.02 to 0.02, or the tetrahedra of these."""
    points, quads = make.grid(6, 5, jitter=0.2, seed=5)
    layers = [make.lifted(points) + [0.0, 0.0, z] for z in (-0.02, 0.0, 0.02)]
    count = len(points)
    bricks = np.concatenate(
        [np.hstack([quads + k * count, quads + (k + 1) * count]) for k in (0, 1)]
    )
    if kind == "hexahedron":
        return TargetMesh(np.concatenate(layers), (("hexahedron", bricks),), {})
    parts = {
        "wedge": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
        "tetra": [[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7]],
    }[kind]
    cells = bricks[:, parts].reshape(-1, len(parts[0]))
    return TargetMesh(np.concatenate(layers), ((kind, cells),), {})


@pytest.mark.parametrize("kind", ["hexahedron", "wedge", "tetra"])
@pytest.mark.parametrize("method", METHODS)
def test_solids_take_the_values_of_the_sheet_through_them(make, kind, method):
    points, quads = make.grid(20, 20)
    first, second = make.families(make.lifted(points), quads, 0.2)
    sheet = read_sheet(
        make.forming_result(
            make.lifted(points), quads, fibre_direction_1=first, fibre_direction_2=second,
            fibre_volume_fraction=lambda c: 0.4 + 0.2 * c[:, 0], thickness=0.05,
        )
    )  # fmt: skip
    target = solid_plate(make, kind)
    weights = compute_weights(sheet, target, method=method)
    mapped = transfer(sheet, target, weights)
    assert set(weights.status) == {Status.INSIDE}
    expected = 0.4 + 0.2 * target.centroids[:, 0]
    np.testing.assert_allclose(mapped.scalars["fibre_volume_fraction"], expected, atol=0.012)
    directions = mapped.directions["fibre_direction_2"].direction
    np.testing.assert_allclose(np.abs(directions @ second[0]), 1.0, rtol=1e-12)


def test_the_section_of_a_brick_has_its_area(make):
    target = solid_plate(make, "hexahedron")
    polygons = target.polygons(np.tile([0.0, 0.0, 1.0], (target.cell_count, 1)))
    np.testing.assert_allclose(polygons.areas.sum(), 2.0, rtol=1e-12)  # two layers of bricks
    tilted = np.tile([0.6, 0.0, 0.8], (target.cell_count, 1))
    assert np.all(target.polygons(tilted).areas > 0.0)


def test_stored_weights_map_the_same(make, bowls, tmp_path):
    source, other = bowls
    sheet = read_sheet(make.forming_result(*source, areal_fibre_mass=lambda c: 0.5 + c[:, 0] ** 2))
    target = shell(*other)
    weights = compute_weights(sheet, target)
    weights.save(tmp_path / "weights.npz")
    stored = MappingWeights.load(tmp_path / "weights.npz")
    stored.check_meshes(sheet, target, file="weights.npz")
    before, after = (transfer(sheet, target, w).scalars for w in (weights, stored))
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values)
    assert stored.method == "overlap" and stored.maximum_distance == weights.maximum_distance
    with pytest.raises(InputError, match="another target mesh"):
        stored.check_meshes(sheet, shell(other[0] * 1.001, other[1]), file="weights.npz")
    with pytest.raises(InputError, match="another sheet"):
        moved = read_sheet(make.forming_result(source[0] + 1e-6, source[1]))
        stored.check_meshes(moved, target, file="weights.npz")


def test_broken_weights_are_refused(tmp_path):
    (tmp_path / "weights.npz").write_bytes(b"PK no archive")
    np.savez(tmp_path / "other.npz", values=np.zeros(3))
    for name in ("weights.npz", "other.npz", "absent.npz"):
        with pytest.raises(InputError, match=name):
            MappingWeights.load(tmp_path / name)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"method": "nearest"}, "overlap, closest"), ({"maximum_distance": 0.0}, "positive")],
)
def test_wrong_options_are_refused(make, bowls, wrong, message):
    sheet = read_sheet(make.forming_result(*bowls[0]))
    with pytest.raises(InputError, match=message):
        compute_weights(sheet, shell(*bowls[1]), **wrong)


@pytest.mark.slow  # compiling xugrid's search takes half a minute
def test_overlap_regridding_agrees_with_xugrid(make):
    pytest.importorskip("numba_celltree")  # without it xugrid cannot search
    xugrid = pytest.importorskip("xugrid")
    points, quads = make.grid(12, 9, jitter=0.2, seed=6)
    other, cells = make.grid(7, 8, jitter=0.2, seed=7)
    values = np.random.default_rng(8).uniform(0.3, 0.7, len(quads))
    grids = [xugrid.Ugrid2d(p[:, 0], p[:, 1], -1, f) for p, f in ((points, quads), (other, cells))]
    data = xugrid.UgridDataArray(xr.DataArray(values, dims=[grids[0].face_dimension]), grids[0])
    peer = xugrid.OverlapRegridder(data, grids[1], method="mean").regrid(data)
    sheet = read_sheet(
        make.forming_result(make.lifted(points), quads, fibre_volume_fraction=values)
    )
    weights = compute_weights(sheet, shell(make.lifted(other), cells))
    np.testing.assert_allclose(transfer_average(sheet, weights, values), peer.values, rtol=1e-9)


def test_a_cell_with_no_sheet_near_its_middle_has_the_mean_distance_of_what_lies_over_it(make):
    """A strip over one edge of a large cell that falls from above the cell to below it."""
    points, quads = make.grid(1, 10, (0.0, 0.0), (1.0, 10.0))
    falling = make.lifted(points) + [0.0, 0.0, 1.0] * (0.3 - 0.06 * points[:, 1:])
    sheet = read_sheet(make.forming_result(falling, quads))
    corners = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    cell = shell(make.lifted(corners), np.array([[0, 1, 2, 3]]))
    weights = compute_weights(sheet, cell, maximum_distance=0.5)
    # Faces are seen along their own normals, which the slope turns by 3.4 deg.
    np.testing.assert_allclose(weights.distance, 0.15, rtol=0.01)
    np.testing.assert_allclose(weights.coverage, 0.1, rtol=0.01)


# --- the numbers behind directions and distances --------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_mapped_direction_points_as_the_fibres_do(make, bowls, sign):
    """An axis has no sign, but a picture of arrows and a deck do: that of the leading face."""
    (points, quads), (other, cells) = bowls
    first, second = (sign * family for family in make.families(points, quads, shear=0.3))
    sheet = read_sheet(
        make.forming_result(points, quads, fibre_direction_1=first, fibre_direction_2=second)
    )
    target = shell(other, cells)
    mapped = transfer(sheet, target, compute_weights(sheet, target)).directions
    # within the bowl, the first family always has a part along +x, the second along +y
    assert (sign * mapped["fibre_direction_1"].direction[:, 0] > 0.7).all()
    assert (sign * mapped["fibre_direction_2"].direction[:, 1] > 0.5).all()


def test_the_sign_of_a_mapped_direction_is_that_of_the_face_with_the_largest_weight(make):
    """A cell over 0.3 of one face and 0.7 of the next, whose fibres run against each other."""
    points, quads = make.grid(2, 1, (0.0, 0.0), (2.0, 1.0))
    fibres = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    for left, right, expected in ((0.7, 1.7, -1.0), (0.3, 1.3, 1.0)):
        sheet = read_sheet(
            make.forming_result(make.lifted(points), quads, fibre_direction_1=fibres)
        )
        corners = np.array([[left, 0], [right, 0], [right, 1], [left, 1.0]])
        cell = shell(make.lifted(corners), np.array([[0, 1, 2, 3]]))
        family = transfer(sheet, cell, compute_weights(sheet, cell)).directions["fibre_direction_1"]
        np.testing.assert_allclose(family.direction, [[expected, 0.0, 0.0]], atol=1e-12)
        np.testing.assert_allclose(family.alignment, 1.0)


@pytest.mark.parametrize("degrees", [0.0, 20.0, -20.0, 70.0])
def test_tilt_is_the_angle_by_which_a_cell_turned_the_direction(make, degrees):
    """Fibres along x on cells that are turned about y: tilted; along y: not."""
    points, quads = make.grid(3, 3)
    sheet = read_sheet(make.forming_result(make.lifted(points), quads))
    plate = shell(make.lifted(points), quads)
    weights = compute_weights(sheet, plate)
    angle = np.radians(degrees)
    normals = np.tile([np.sin(angle), 0.0, np.cos(angle)], (len(quads), 1))
    along_x, along_y = (np.tile(axis, (len(quads), 1)) for axis in np.eye(3)[:2])
    mapped = map_directions(sheet.surface, weights, along_x, normals)
    np.testing.assert_allclose(mapped.tilt, abs(angle), atol=1e-12)
    expected = np.tile([np.cos(angle), 0.0, -np.sin(angle)], (len(quads), 1))
    np.testing.assert_allclose(mapped.direction, expected, atol=1e-12)
    np.testing.assert_allclose(
        map_directions(sheet.surface, weights, along_y, normals).tilt, 0.0, atol=1e-12
    )
    np.testing.assert_array_equal(map_directions(sheet.surface, weights, along_x, None).tilt, 0.0)


@pytest.mark.parametrize(("degrees", "said"), [(25.0, False), (40.0, True)])
def test_fibres_that_leave_the_cells_are_told(make, degrees, said):
    points, quads = make.grid(3, 3)
    along_x = np.tile([1.0, 0.0, 0.0], (len(quads), 1))
    sheet = read_sheet(make.forming_result(make.lifted(points), quads, fibre_direction_1=along_x))
    target = shell(make.lifted(points), quads)
    weights = compute_weights(sheet, target)
    angle = np.radians(degrees)
    normals = np.tile([np.sin(angle), 0.0, np.cos(angle)], (len(quads), 1))
    mapped = transfer(sheet, target, weights)
    mapped.directions["fibre_direction_1"] = map_directions(
        sheet.surface, weights, along_x, normals
    )
    report = mapping_report(sheet, target, weights, mapped, name="part", kind="structure")
    found = [text for text in report.warnings if "leaves the plane" in text]
    assert bool(found) == said
    if said:
        assert f"by up to {degrees:.0f} degrees" in found[0]


@pytest.mark.parametrize(
    ("cells_per_side", "distance"),
    [(8, 0.1), (4, 0.125 * np.sqrt(2.0)), (1, 0.5 * np.sqrt(2.0))],
)
def test_the_default_distance_is_an_edge_of_the_sheet_or_the_radius_of_a_cell(
    make, cells_per_side, distance
):
    """Whichever is larger; a cell farther off is unmapped."""
    points, quads = make.grid(10, 10)
    sheet = read_sheet(make.forming_result(make.lifted(points), quads))
    other, cells = make.grid(cells_per_side, cells_per_side)
    target = shell(make.lifted(other), cells)
    assert default_maximum_distance(sheet, target) == pytest.approx(distance, rel=1e-12)
    for share, status in ((0.99, Status.PROJECTED), (1.01, Status.UNMAPPED)):
        moved = shell(target.points + [0.0, 0.0, share * distance], cells)
        weights = compute_weights(sheet, moved)
        assert weights.maximum_distance == pytest.approx(distance, rel=1e-12)
        assert set(weights.status) == {status}


def test_the_conservation_error_is_positive_where_the_target_has_more(make):
    """One cell over faces of 1 and 3 kg/m²: closest weights take the value of one of them."""
    points, quads = make.grid(2, 1, (0.0, 0.0), (2.0, 1.0))
    sheet = read_sheet(
        make.forming_result(make.lifted(points), quads, areal_fibre_mass=np.array([1.0, 3.0]))
    )
    for left, right, value in ((0.0, 1.9, 1.0), (0.1, 2.0, 3.0)):
        corners = np.array([[left, 0], [right, 0], [right, 1], [left, 1.0]])
        cell = shell(make.lifted(corners), np.array([[0, 1, 2, 3]]))
        weights = compute_weights(sheet, cell, method="closest", order=1, maximum_distance=1.0)
        mapped = transfer(sheet, cell, weights)
        report = mapping_report(sheet, cell, weights, mapped, name="part", kind="structure")
        # of the face that reaches beyond the cell, two of four corners lie over it
        source = 1.0 + 0.5 * 3.0 if value == 1.0 else 0.5 * 1.0 + 3.0
        assert report.fibre_mass_of_covered_sheet == pytest.approx(source, rel=1e-12)
        assert report.fibre_mass_on_target == pytest.approx(1.9 * value, rel=1e-12)
        assert report.conservation_error == pytest.approx(1.9 * value / source - 1.0, rel=1e-9)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0])
def test_an_inclined_face_gives_the_share_that_lies_over_the_cell(make, degrees):
    """The share of the face itself, not of its projection."""
    points, quads = make.grid(1, 1)
    slope = np.tan(np.radians(degrees))
    inclined = make.lifted(points) + [0.0, 0.0, 1.0] * (slope * points[:, :1])
    sheet = read_sheet(make.forming_result(inclined, quads, areal_fibre_mass=0.6))
    cosine = np.cos(np.radians(degrees))
    corners = np.array([[-0.1, -0.1], [0.4, -0.1], [0.4, 1.1], [-0.1, 1.1]])
    cell = shell(make.lifted(corners), np.array([[0, 1, 2, 3]]))
    weights = compute_weights(sheet, cell, maximum_distance=2.0)
    # seen along the face's normal the edge of the cell at 0.4 lies at 0.4 cos(angle)
    share = 0.4 * cosine**2
    np.testing.assert_allclose(weights.face_coverage, share, rtol=1e-12)
    np.testing.assert_allclose(weights.content, share, rtol=1e-12)
    content = content_of_sheet(sheet, weights, sheet.scalars["areal_fibre_mass"])
    assert content == pytest.approx(share * 0.6 / cosine, rel=1e-12)
    np.testing.assert_allclose(weights.coverage, 0.4 / 0.6, rtol=1e-12)
