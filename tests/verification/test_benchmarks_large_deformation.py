"""Shell benchmarks with large rotations against published curves and the exact circle."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.scene import Element
from lcmchain.verification.benchmarks.large_deformation import (
    END_SHEAR,
    HEMISPHERE,
    PINCHED_CYLINDER,
    end_shear,
    hemisphere,
    pinched_cylinder,
    roll_up,
)

# The pinched cylinder by MBDyn's four-node shell on 48x48 elements (tests/plates/sze2004/sze36 of
# its sources, read off between load steps): an independent element, linear elastic in Biot strains.
# Load over 12000 -> deflection under the force and of the side (outwards).
MBDYN = np.array(
    [
        [0.10, 23.06, -2.363], [0.25, 62.35, 15.41], [0.50, 74.32, 25.99],
        [0.75, 79.92, 31.29], [1.00, 83.79, 35.11],
    ]
)  # fmt: skip


def largest(curve):
    return abs(curve.deviation).max()


def test_cantilever_under_end_shear_follows_the_published_curve():
    curve = end_shear(16)
    assert len(curve.load_factor) == len(END_SHEAR)
    assert largest(curve) < 0.005


def test_roll_up_is_a_circle():
    """Within 1 % up to the full circle; the polygon of the elements converges to it."""
    deviations = [largest(roll_up(count, np.linspace(0.1, 1.0, 10))) for count in (12, 24, 48)]
    assert deviations[-1] < 0.01
    assert deviations[0] > deviations[1] > deviations[2]
    # what is left is the strain of 2.6 % in the faces, which a circular arc neglects
    assert np.log2((deviations[0] - deviations[1]) / (deviations[1] - deviations[2])) > 1.7


def test_roll_up_takes_few_steps():
    """Half a circle in one step: the tangent follows finite rotations."""
    steps = []
    roll_up(48, [0.5, 1.0], on_step=steps.append)
    assert sum(step.iterations for step in steps) < 60


def test_hemisphere_on_a_coarse_mesh():
    curve = hemisphere(16, table=HEMISPHERE[[3, 11, 19]])
    np.testing.assert_allclose(curve.values[-1] / curve.references[-1], 1.0, atol=0.035)


@pytest.mark.slow
def test_hemisphere_follows_the_published_curve():
    curve = hemisphere(32)
    assert len(curve.load_factor) == len(HEMISPHERE)
    assert largest(curve) < 0.02
    np.testing.assert_allclose(curve.values[-1] / curve.references[-1], 1.0, atol=0.02)


def test_normal_thickness_stiffens_coarse_curved_meshes_of_a_stiff_material():
    """It takes the chord of bent elements for a loss of thickness; it converges with the mesh."""
    table = HEMISPHERE[[3]]
    published = [hemisphere(count, table=table).values[0, 1] for count in (8, 16)]
    normal = [hemisphere(count, Element(), table=table).values[0, 1] for count in (8, 16)]
    short = np.subtract(published, normal)
    assert short[0] > 2.0 * short[1] > 0.0


@pytest.mark.slow
def test_pinched_cylinder_follows_the_published_curve():
    """The deflection within 2 % of Sze, Liu, Lo, both displacements within 2 % of MBDyn.

    The side comes out 3 % farther than Sze, Liu, Lo have it; MBDyn finds the same. Where the side
    snaps out, between 0.15 and 0.2 of the load, the curve is too steep for such a comparison.
    """
    curve = pinched_cylinder(48)
    assert len(curve.load_factor) == len(PINCHED_CYLINDER)
    away = abs(curve.load_factor - 0.175) > 0.03
    assert abs(curve.deviation[away, 0]).max() < 0.02
    assert abs(curve.deviation[away, 1]).max() < 0.04
    rows = np.searchsorted(curve.load_factor, MBDYN[:, 0])
    deviation = curve.values[rows] - MBDYN[:, 1:]
    assert abs(deviation / MBDYN[-1, 1:]).max() < 0.02
