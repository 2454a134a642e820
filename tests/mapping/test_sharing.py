"""The fibre mass of a cell is what the sheet has over it, also at coarse bends and over waves."""

import numpy as np
import pytest

from lcmchain.mapping import compute_weights, read_sheet, transfer
from lcmchain.mapping.fields import content_of_cells, content_of_sheet
from lcmchain.mapping.target import TargetMesh

MASS = 0.6


def bent(points, radius=10e-3, flat=30e-3, angle=0.5 * np.pi):
    """A strip along x that runs flat, round an edge of the radius, and on, in metres."""
    s, y = points.T
    turn = np.clip((s - flat) / radius, 0.0, angle)
    beyond = np.maximum(s - flat - radius * angle, 0.0)
    x = np.minimum(s, flat) + radius * np.sin(turn) + beyond * np.cos(angle)
    z = -radius * (1.0 - np.cos(turn)) - beyond * np.sin(angle)
    return np.stack([x, y, z], axis=1)


def mapped_mass(make, source, target, **options):
    sheet = read_sheet(make.forming_result(*source, areal_fibre_mass=MASS))
    mesh = TargetMesh(target[0], (("triangle", make.triangles_of(target[1])),), {})
    weights = compute_weights(sheet, mesh, **options)
    mass = transfer(sheet, mesh, weights).scalars["areal_fibre_mass"]
    arrived = content_of_cells(weights, mass)
    covered = content_of_sheet(sheet, weights, sheet.scalars["areal_fibre_mass"])
    assert arrived == pytest.approx(covered, rel=1e-12)
    return mass, weights, mesh


@pytest.mark.parametrize("turn", [0.1, 0.5])
def test_a_coarse_bend_does_not_scatter_the_mass(make, turn):
    """Facets of 5 mm on a radius of 10 mm: cells over their edges are seen from two sides."""
    points, quads = make.grid(16, 8, (0.0, 0.0), (80e-3, 40e-3))
    other, cells = make.grid(26, 13, (0.0, 0.0), (80e-3, 40e-3))
    middle = np.array([40e-3, 20e-3])
    cosine, sine = np.cos(turn), np.sin(turn)
    turned = (other - middle) @ np.array([[cosine, sine], [-sine, cosine]]) * 0.6 + middle
    mass, weights, mesh = mapped_mass(
        make, (bent(points), quads), (bent(turned), cells), maximum_distance=5e-3
    )
    within = weights.coverage == 1.0
    assert within.sum() > 500
    # The chords of the sheet are 1 % shorter than its arcs, and those of the target less.
    np.testing.assert_allclose(mass[within], MASS, rtol=0.03)
    assert 1e-3 < weights.moved < 0.05


def test_nothing_is_moved_where_the_sheet_is_plane(make):
    points, quads = make.grid(9, 11, jitter=0.3, seed=1)
    other, cells = make.grid(13, 8, (0.05, 0.1), (0.9, 0.95), jitter=0.3, seed=2)
    mass, weights, _ = mapped_mass(make, (make.lifted(points), quads), (make.lifted(other), cells))
    assert weights.moved < 1e-14
    np.testing.assert_allclose(mass, MASS, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_waves_of_the_sheet_keep_their_mass_over_a_flat_target(make, order):
    """Waves of 20 by 1.5 mm on one half of the sheet: 5 % more fibre over one half of the mesh."""
    length, height = 20e-3, 1.5e-3

    def surface(points):
        x, y = points.T
        return np.column_stack([x, y, height * np.sin(2 * np.pi * x / length) * (x < 100e-3)])

    points, quads = make.grid(200, 4, (0.0, 0.0), (200e-3, 10e-3))
    other, cells = make.grid(117, 5, (0.0, 0.0), (200e-3, 10e-3))
    source = surface(points), quads
    mass, weights, mesh = mapped_mass(
        make, source, (make.lifted(other), cells), order=order, maximum_distance=5e-3
    )
    x, areas = mesh.centroids[:, 0], mesh.surface.areas
    sheet = read_sheet(make.forming_result(*source, areal_fibre_mass=MASS)).surface
    # Whole waves, and the plane from the first cell that no wave reaches.
    edges = np.linspace(0.0, 200e-3, 118)
    beside, beyond = edges[edges > 100e-3][[0, 4]]
    waves = (sheet.centroids[:, 0] > 20e-3) & (sheet.centroids[:, 0] < 80e-3)
    excess = sheet.areas[waves].sum() / (60e-3 * 10e-3)
    assert excess > 1.04
    for first, last, expected in ((20e-3, 80e-3, MASS * excess), (beside, beyond, MASS)):
        over = (x > first) & (x < last)
        density = np.sum(mass[over] * areas[over]) / areas[over].sum()
        assert density == pytest.approx(expected, rel=4e-3)
