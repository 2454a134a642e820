"""Pinched semi-cylinder of Sze, Liu, Lo, isotropic and laminated, against their deflections."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.scene import Element
from lcmchain.verification.benchmarks.meshes import AS_PUBLISHED
from lcmchain.verification.benchmarks.semi_cylinder import (
    DEFLECTION,
    E_L,
    E_T,
    LAYUPS,
    NU,
    laminate_stiffness,
    semi_cylinder,
)


def test_laminates_have_the_stiffness_of_the_classical_theory():
    """Layers along and across: A/h their mean, 12 D/h³ with the outer ones 26 times the inner."""
    membrane, bending = laminate_stiffness(LAYUPS["0/90/0"])
    major = 1.0 / (1.0 - NU**2 * E_T / E_L)
    along, across = major * E_L, major * E_T
    assert membrane[0, 0] == pytest.approx((2.0 * along + across) / 3.0)
    assert bending[0, 0] == pytest.approx((26.0 * along + across) / 27.0)
    assert bending[1, 1] == pytest.approx((26.0 * across + along) / 27.0)
    for matrix in (membrane, bending):
        np.testing.assert_allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    order = [1, 0, 2, 3, 5, 4]  # the axes after a quarter turn about the normal
    turned = laminate_stiffness(LAYUPS["90/0/90"])
    np.testing.assert_allclose(turned[0][np.ix_(order, order)], membrane)
    np.testing.assert_allclose(turned[1][np.ix_(order, order)], bending)


@pytest.mark.slow  # test_benchmarks_large_deformation.py bends shells far in the default run
@pytest.mark.parametrize(
    "layup",
    # the stiffness of 0/90/0 is that of 90/0/90 after a quarter turn, as the test above shows
    [layup for layup in LAYUPS if layup != "0/90/0"],
)
def test_semi_cylinder_on_a_coarse_mesh_takes_the_full_load(layup):
    """Within 4 % of the largest deflection; half of their elements along each edge."""
    curve = semi_cylinder(layup, 20, Element(), rows=slice(4, None, 5))
    assert curve.load_factor[-1] == 1.0
    assert curve.end == ""
    assert abs(curve.deviation).max() < 0.04


@pytest.mark.slow
@pytest.mark.parametrize("layup", LAYUPS)
def test_semi_cylinder_follows_the_published_deflections(layup):
    """On their mesh, at all of their loads, within 1 % of the largest deflection."""
    curve = semi_cylinder(layup, 40, Element())
    assert len(curve.load_factor) == len(DEFLECTION)
    assert curve.end == ""
    assert abs(curve.deviation).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("layup", ["isotropic", "90/0/90"])
def test_semi_cylinder_as_published_follows_the_published_deflections(layup):
    curve = semi_cylinder(layup, 40, AS_PUBLISHED)
    assert curve.end == ""
    assert abs(curve.deviation).max() < 0.01
