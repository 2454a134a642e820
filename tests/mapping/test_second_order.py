"""Fields that vary within the faces: exactness, rates, accuracy on curved parts, and bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lcmchain.mapping import TargetMesh, compute_weights, read_sheet, transfer
from lcmchain.mapping.fields import (
    content_of_cells,
    content_of_sheet,
    covered_areas,
    transfer_average,
)

RADIUS = 0.1


def shell(points, cells):
    return TargetMesh(points, (({3: "triangle", 4: "quad"}[cells.shape[1]], cells),), {})


def dome(points):
    """Map a square of [-1, 1] to the hemisphere."""
    x, y = points.T
    u, v = x * np.sqrt(1.0 - 0.5 * y * y), y * np.sqrt(1.0 - 0.5 * x * x)
    r = np.hypot(u, v)
    angle = 0.999 * 0.5 * np.pi * r
    factor = np.where(r > 0.0, np.sin(angle) / np.where(r > 0.0, r, 1.0), 0.0)
    return RADIUS * np.stack([u * factor, v * factor, np.cos(angle)], axis=1)


def saddle(points):
    """Map the square to a part that is bent to both sides and folded over at two edges."""
    x, y = RADIUS * points.T
    height = 0.03 * np.sin(2.0 * x / RADIUS) * np.cos(1.5 * y / RADIUS) - 2.0 * y * y
    return np.stack([x + 0.2 * height, y, height], axis=1)


def exact_means(shape, plane, faces, field, parts=6):
    """Means of a field in space over the curved cells, by the midpoints of ever smaller parts."""
    total, weight = np.zeros(len(faces)), np.zeros(len(faces))
    halves = [(0, 1, 2)] if faces.shape[1] == 3 else [(0, 1, 2), (0, 2, 3)]
    for half in halves:
        a, b, c = (plane[faces[:, k]] for k in half)

        def place(i, j, a=a, b=b, c=c):
            return a + (b - a) * (i / parts) + (c - a) * (j / parts)

        for i in range(parts):
            for j in range(parts - i):
                up = [(i, j), (i + 1, j), (i, j + 1)]
                down = [(i + 1, j), (i + 1, j + 1), (i, j + 1)]
                for corners in [up, down][: 2 if i + j < parts - 1 else 1]:
                    flat = [place(*corner) for corner in corners]
                    p, q, r = (shape(corner) for corner in flat)
                    area = np.linalg.norm(np.cross(q - p, r - p), axis=1)
                    total += area * field(shape(sum(flat) / 3.0))
                    weight += area
    return total / weight


def waves(p):
    return 1.0 + 0.5 * np.sin(20.0 * p[:, 0]) * np.cos(15.0 * p[:, 1]) + 2.0 * p[:, 2]


def rotated(points, degrees):
    """Turn the points of the plane within the largest circle that the square holds."""
    return Rotation.from_euler("z", degrees, degrees=True).apply(
        np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    )[:, :2]


def error_on(make, shape, source, target, turn=0.0, order=2, field=waves):
    """Relative error (L2) of exact means that are mapped from quadrilaterals to triangles."""
    plane, quads = make.grid(source, source, (-1.0, -1.0), (1.0, 1.0))
    other, cells = make.grid(target, target, (-1.0, -1.0), (1.0, 1.0))
    cells = make.triangles_of(cells)
    if shape is dome:  # the sphere turns onto itself: no cell of one mesh is one of the other
        rotation = Rotation.from_euler("z", turn)
        positions, sampled = rotation.apply(dome(other)), lambda p: rotation.apply(dome(p))
    else:
        other = 0.6 * rotated(other, turn)
        positions, sampled = shape(other), shape
    means = exact_means(shape, plane, quads, field)
    expected = exact_means(sampled, other, cells, field)
    sheet = read_sheet(make.forming_result(shape(plane), quads, thickness=means))
    receiver = shell(positions, cells)
    weights = compute_weights(sheet, receiver, order=order)
    found = transfer_average(sheet, weights, sheet.scalars["thickness"])
    areas = receiver.surface.areas
    return np.sqrt(np.sum(areas * (found - expected) ** 2) / np.sum(areas * expected**2))


def test_a_dome_and_a_saddle_keep_their_fields_to_a_ten_thousandth(make):
    """3,600 quadrilaterals onto 10,082 triangles; first order is twenty times worse."""
    of_dome = error_on(make, dome, 60, 71, turn=0.3)
    assert of_dome < 5e-5
    assert error_on(make, dome, 60, 71, turn=0.3, order=1) > 20.0 * of_dome
    assert error_on(make, saddle, 60, 71, turn=20.0) < 1e-4


@pytest.mark.parametrize(("order", "least"), [(1, 0.95), (2, 1.9)])
@pytest.mark.parametrize("shape", [dome, saddle])
def test_errors_fall_with_the_order_of_the_mapping(make, shape, order, least):
    coarse, fine = (error_on(make, shape, n, 3 * n // 2, 0.4, order) for n in (16, 64))
    assert np.log(coarse / fine) / np.log(4.0) > least


def test_linear_fields_are_exact_on_plane_meshes_up_to_their_edge(make):
    points, quads = make.grid(9, 8, jitter=0.3, seed=1)
    other, cells = make.grid(11, 13, jitter=0.3, seed=2)
    surface = shell(make.lifted(points), quads).surface
    slope = np.array([0.3, -0.2, 0.0])
    sheet = read_sheet(
        make.forming_result(
            make.lifted(points),
            quads,
            thickness=1.0 + surface.centroids @ slope,
            areal_fibre_mass=2.0 - surface.centroids @ slope,
        )
    )
    target = shell(make.lifted(other), cells)
    found = transfer(sheet, target, compute_weights(sheet, target)).scalars
    linear = target.surface.centroids @ slope
    np.testing.assert_allclose(found["thickness"], 1.0 + linear, rtol=1e-12)
    np.testing.assert_allclose(found["areal_fibre_mass"], 2.0 - linear, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_constant_fields_stay_constant(make, order):
    plane, quads = make.grid(20, 20, (-1.0, -1.0), (1.0, 1.0), jitter=0.2)
    other, cells = make.grid(13, 27, (-0.9, -0.9), (0.9, 0.9), jitter=0.2)
    sheet = read_sheet(make.forming_result(saddle(plane), quads, thickness=0.0123))
    target = shell(saddle(other), make.triangles_of(cells))
    weights = compute_weights(sheet, target, order=order)
    found = transfer_average(sheet, weights, sheet.scalars["thickness"])
    np.testing.assert_allclose(found, 0.0123, rtol=1e-13)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_jumps_and_noise_stay_within_their_bounds(make, seed):
    random = np.random.default_rng(seed)
    plane, quads = make.grid(15, 15, (-1.0, -1.0), (1.0, 1.0), jitter=0.3, seed=seed)
    other, cells = make.grid(31, 31, (-1.0, -1.0), (1.0, 1.0), jitter=0.3, seed=seed + 1)
    centroid = plane[quads].mean(axis=1)
    step = np.where(centroid @ random.uniform(-1.0, 1.0, 2) > 0.2, 1.0, 0.0)
    target = shell(make.lifted(other), cells)
    for values in (step, random.uniform(0.2, 0.9, len(quads)), random.integers(0, 2, len(quads))):
        sheet = read_sheet(make.forming_result(make.lifted(plane), quads, thickness=values))
        found = transfer_average(sheet, compute_weights(sheet, target), sheet.scalars["thickness"])
        spread = np.ptp(values)
        # Beside the edge of the sheet a few faces in a row look like a linear field.
        assert found.min() > values.min() - 0.12 * spread
        assert found.max() < values.max() + 0.12 * spread


def test_a_field_that_is_never_negative_stays_so(make):
    """Also at the edge of the sheet, where a linear field would run below zero."""
    plane, quads = make.grid(6, 6)
    other, cells = make.grid(40, 40)
    centroid = plane[quads].mean(axis=1)
    ramp = np.maximum(centroid[:, 0] - centroid[:, 0].min(), 0.0)
    sheet = read_sheet(make.forming_result(make.lifted(plane), quads, thickness=ramp))
    target = shell(make.lifted(other), cells)
    assert transfer_average(sheet, compute_weights(sheet, target), ramp).min() >= -1e-15


@pytest.mark.parametrize("shape", [dome, saddle])
def test_contents_are_kept_without_scaling(make, shape):
    """The cells over the faces tile them: the correction that was needed is rounding."""
    plane, quads = make.grid(24, 24, (-1.0, -1.0), (1.0, 1.0), jitter=0.2)
    other, cells = make.grid(40, 35, (-0.7, -0.6), (0.5, 0.7), jitter=0.2, seed=3)
    mass = 0.6 + 0.2 * waves(shape(plane)[quads].mean(axis=1))
    sheet = read_sheet(make.forming_result(shape(plane), quads, areal_fibre_mass=mass))
    for target in (shell(shape(other), cells), shell(shape(other), make.triangles_of(cells))):
        weights = compute_weights(sheet, target)
        assert weights.wedge_correction < 1e-12
        found = transfer(sheet, target, weights).scalars["areal_fibre_mass"]
        covered = content_of_sheet(sheet, weights, mass)
        assert content_of_cells(weights, found) == pytest.approx(covered, rel=1e-12)
        inner = np.isin(np.arange(len(quads)), weights.face) & (weights.face_coverage > 1.0 - 1e-9)
        whole = np.sum((mass * sheet.surface.areas)[inner])
        assert 0.7 * covered < whole < covered


def test_the_fibre_volume_fraction_is_that_of_mass_and_thickness(make):
    """Its mass, in the mapped thickness over the covered area, is that of the covered sheet."""
    plane, quads = make.grid(24, 24, (-1.0, -1.0), (1.0, 1.0))
    other, cells = make.grid(17, 19, (-0.8, -0.8), (0.8, 0.8), jitter=0.2)
    density = 1810.0
    thickness = 1e-3 * waves(dome(plane)[quads].mean(axis=1))
    mass = 0.6 * (1.0 + 3.0 * dome(plane)[quads].mean(axis=1)[:, 0])
    fields = {"thickness": thickness, "areal_fibre_mass": mass}
    sheet = read_sheet(
        make.forming_result(
            dome(plane), quads, **fields, fibre_volume_fraction=mass / (density * thickness)
        )
    )
    target = shell(dome(other), cells)
    weights = compute_weights(sheet, target)
    found = transfer(sheet, target, weights).scalars
    volume = found["thickness"] * covered_areas(weights)
    fibres = np.sum(found["fibre_volume_fraction"] * density * volume)
    assert fibres == pytest.approx(content_of_sheet(sheet, weights, mass), rel=1e-12)


def directions_on_dome(surface, shear):
    """Two families on the sphere, closed by a shear angle (F,), projected onto the facets."""
    normal = surface.centroids / np.linalg.norm(surface.centroids, axis=1)[:, None]
    first = np.cross([0.0, 1.0, 0.0], normal)
    first /= np.linalg.norm(first, axis=1)[:, None]
    across = np.cross(normal, first)
    turn = 0.5 * shear[:, None]
    families = (
        np.cos(turn) * first + np.sin(turn) * across,
        np.sin(turn) * first + np.cos(turn) * across,
    )
    projected = []
    for family in families:
        out = np.einsum("fi,fi->f", family, surface.normals)[:, None]
        flat = family - out * surface.normals
        projected.append(flat / np.linalg.norm(flat, axis=1)[:, None])
    return projected


def test_fibres_at_large_shear_with_random_signs_keep_their_angles(make):
    """A dome with up to 50 degrees of shear to either side, 2,500 faces onto 5,000 triangles."""

    def shear_at(points):
        return np.radians(50.0) * np.sin(20.0 * points[:, 0]) * np.sin(20.0 * points[:, 1])

    plane, quads = make.grid(50, 50, (-0.9, -0.9), (0.9, 0.9))
    other, cells = make.grid(53, 51, (-0.88, -0.88), (0.88, 0.88))
    cells = make.triangles_of(cells)
    random = np.random.default_rng(0)
    source = shell(dome(plane), quads).surface
    families = directions_on_dome(source, shear_at(source.centroids))
    signed = [family * random.choice([-1.0, 1.0], (len(quads), 1)) for family in families]
    sheet = read_sheet(
        make.forming_result(
            dome(plane), quads, fibre_direction_1=signed[0], fibre_direction_2=signed[1]
        )
    )
    target = shell(dome(other), cells)
    found = transfer(sheet, target, compute_weights(sheet, target)).directions
    expected = directions_on_dome(target.surface, shear_at(target.surface.centroids))

    def angle(a, b):
        return np.degrees(np.arccos(np.clip(np.abs(np.einsum("ci,ci->c", a, b)), 0.0, 1.0)))

    mapped = [found[f"fibre_direction_{number}"].direction for number in (1, 2)]
    for family, wanted in zip(mapped, expected, strict=True):
        error = angle(family, wanted)
        assert np.median(error) < 0.1
        assert error.max() < 0.6
    assert np.abs(angle(*mapped) - angle(*expected)).max() < 0.5


def test_the_order_of_nodes_faces_and_cells_and_flipped_normals_do_not_matter(make):
    random = np.random.default_rng(4)
    plane, quads = make.grid(14, 15, (-1.0, -1.0), (1.0, 1.0), jitter=0.2)
    other, cells = make.grid(18, 13, (-0.8, -0.8), (0.8, 0.8), jitter=0.2)
    points, centroid = saddle(plane), saddle(plane)[quads].mean(axis=1)
    mass = 0.6 + 0.1 * waves(centroid)
    sheet = read_sheet(make.forming_result(points, quads, areal_fibre_mass=mass, thickness=mass))
    target = shell(saddle(other), cells)
    still = transfer(sheet, target, compute_weights(sheet, target)).scalars

    node, face, cell = (random.permutation(len(a)) for a in (points, quads, cells))
    place = np.argsort(node)
    shuffled = make.forming_result(
        points[node], place[quads][face], areal_fibre_mass=mass[face], thickness=mass[face]
    )
    there = shell(saddle(other), cells[cell][:, ::-1])  # also seen from below
    again = read_sheet(shuffled)
    found = transfer(again, there, compute_weights(again, there)).scalars
    for name in ("thickness", "areal_fibre_mass"):
        np.testing.assert_allclose(found[name], still[name][cell], rtol=1e-12)
