"""Turning and homogenising plies, against full tensors and a laminate solved ply by ply."""

import numpy as np
import pytest

from lcmchain.mapping.structure.stiffness import (
    chamis,
    homogenised,
    interleaved,
    laminate,
    ply_stiffness,
    reduced,
    turned,
)
from lcmchain.scene.structure import Fibre, Resin

PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
ANGLES = np.radians([20.0, -75.0, 130.0])


@pytest.fixture(scope="module")
def ply():
    v = np.array([0.3, 0.5, 0.6])
    return ply_stiffness(chamis(Fibre(preset="T300"), Resin(preset="MY750"), v))


def tensor(stiffness):
    """Full tensor (3, 3, 3, 3) of a matrix."""
    full = np.zeros((3, 3, 3, 3))
    for row, (i, j) in enumerate(PAIRS):
        for column, (k, m) in enumerate(PAIRS):
            for a, b in {(i, j), (j, i)}:
                for c, d in {(k, m), (m, k)}:
                    full[a, b, c, d] = stiffness[row, column]
    return full


def matrix(full):
    return np.array([[full[*a, *b] for b in PAIRS] for a in PAIRS])


def test_turning_is_that_of_the_full_tensor(ply):
    found = turned(ply, ANGLES)
    for stiffness, angle, result in zip(ply, ANGLES, found):
        c, s = np.cos(angle), np.sin(angle)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        expected = np.einsum("ia,jb,kc,ld,abcd->ijkl", R, R, R, R, tensor(stiffness))
        np.testing.assert_allclose(result, matrix(expected), rtol=1e-12, atol=1e-2)


def test_homogenised_plies_share_strains_in_the_plane_and_stresses_on_it(ply):
    """Each ply solved for itself: the mean stresses are those of the homogenised material."""
    plies, shares = [turned(ply, ANGLES), turned(ply, -2.0 * ANGLES)], [0.3, 0.7]
    whole = homogenised(plies, shares)
    plane, through = [0, 1, 3], [2, 4, 5]
    strain = np.random.default_rng(3).normal(size=6)
    for cell in range(3):
        stress = whole[cell] @ strain
        mean_stress, mean_strain = np.zeros(6), np.zeros(6)
        for C, f in zip((p[cell] for p in plies), shares):
            own = strain.copy()
            rest = stress[through] - C[np.ix_(through, plane)] @ strain[plane]
            own[through] = np.linalg.solve(C[np.ix_(through, through)], rest)
            mean_stress += f * C @ own
            mean_strain += f * own
        np.testing.assert_allclose(mean_strain, strain, rtol=1e-10)
        np.testing.assert_allclose(mean_stress, stress, rtol=1e-10)


def test_equal_plies_are_their_own_laminate(ply):
    np.testing.assert_allclose(homogenised([ply, ply], [0.4, 0.6]), ply, rtol=1e-12, atol=1e-3)
    thickness = np.array([1e-3, 2e-3, 0.5e-3])
    found = laminate([(ply, 0.25), (ply, 0.75)], thickness)
    expected = interleaved(reduced(ply), thickness)
    np.testing.assert_allclose(found.A, expected.A, rtol=1e-12)
    np.testing.assert_allclose(found.D, expected.D, rtol=1e-12)
    np.testing.assert_allclose(found.B, 0.0, atol=1e-9 * found.A.max() * thickness.max())


def test_two_plies_couple_and_three_mirrored_ones_do_not(ply):
    """Closed forms of 0/90: B = (Q90 - Q0) t^2 / 8, and D of the outer halves of 0/90/0."""
    thickness = np.full(3, 2e-3)
    other = turned(ply, np.full(3, np.pi / 2))
    t, q0, q90 = 2e-3, reduced(ply), reduced(other)
    pair = laminate([(ply, 0.5), (other, 0.5)], thickness)
    np.testing.assert_allclose(pair.B, (q90 - q0) * t**2 / 8, rtol=1e-12, atol=1e-9)
    mirrored = laminate([(ply, 0.25), (other, 0.5), (ply, 0.25)], thickness)
    np.testing.assert_allclose(mirrored.B, 0.0, atol=1e-9)
    np.testing.assert_allclose(mirrored.A, pair.A, rtol=1e-12)
    expected = (q0 * (1 - 1 / 8) + q90 / 8) * t**3 / 12
    np.testing.assert_allclose(mirrored.D, expected, rtol=1e-12, atol=1e-12)


def test_reduced_stiffness_of_the_homogenised_is_the_mean_of_the_plies(ply):
    plies = [turned(ply, ANGLES), turned(ply, ANGLES + 1.0)]
    whole = reduced(homogenised(plies, [0.5, 0.5]))
    np.testing.assert_allclose(whole, 0.5 * (reduced(plies[0]) + reduced(plies[1])), rtol=1e-11)
