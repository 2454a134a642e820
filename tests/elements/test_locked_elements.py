"""Elements of a fabric that locks: kernel, potential, and the bound of the frequency."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.materials.features.shear import ShearLocking
from lcmchain.verification.random_elements import bounds_and_frequencies

COUNT = 37
LOCKING = ShearLocking.from_angle(np.radians(40.0), 2e9)  # stiffer than the fibres

#: Kernels of curved elements ask the law of flat ones: test_kernel.py has both for other laws.
FLAT_FIRST = ["flat", pytest.param("curved", marks=pytest.mark.slow)]


def locked_elements(make, rng, shape="flat", **options):
    """References, node positions of elements sheared by 30 to 65 degrees of either sign, fabric."""
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references = [reference(rng) for _ in range(COUNT)]
    angles = np.radians(rng.uniform(30.0, 65.0, COUNT)) * rng.choice([-1.0, 1.0], COUNT)
    x = [
        make.deformed(rng, *element, gradient=make.sheared(angle, 0.8, 1.001), warp=0.05)
        for element, angle in zip(references, angles, strict=True)
    ]
    return references, np.array(x), make.md600(LOCKING)


@pytest.mark.parametrize("shape", FLAT_FIRST)
def test_forces_of_the_kernel_agree_with_the_reference_element(make, shape):
    references, x, fabric = locked_elements(make, np.random.default_rng(31), shape)
    X, fibres = map(np.array, zip(*references, strict=True))
    model = make.separate_elements(X, fibres, fabric, ElementOptions())
    forces = make.corner_forces(model, make.positions_of(x))
    for nodes, fibre, now, force in zip(X, fibres, x, forces, strict=True):
        expected = ReferenceElement(nodes, fibre, fabric, ElementOptions()).evaluate(now).force
        np.testing.assert_allclose(force, expected, rtol=0.0, atol=1e-12 * abs(expected).max())


def test_they_have_a_potential(make):
    """Forces against sixth-order differences of the energies, hourglass part included."""
    references, x, fabric = locked_elements(make, np.random.default_rng(32))
    for (nodes, fibre), now in list(zip(references, x, strict=True))[:4]:
        element = ReferenceElement(nodes, fibre, fabric, ElementOptions())
        expected = np.zeros(24)
        for i, dx in enumerate(1e-6 * np.eye(24).reshape(24, 8, 3)):
            d1, d2, d3 = (
                (energy(element, now + k * dx) - energy(element, now - k * dx)) / (2 * k)
                for k in (1, 2, 3)
            )
            expected[i] = (15 * d1 - 6 * d2 + d3) / 10e-6
        force = element.evaluate(now).force.ravel()
        np.testing.assert_allclose(force, expected, rtol=0.0, atol=1e-7 * abs(expected).max())


def energy(element, x):
    result = element.evaluate(x)
    return result.energy + result.hourglass_energy


@pytest.mark.parametrize("shape", FLAT_FIRST)
def test_the_bound_knows_the_locked_tangent(make, shape):
    """Never below the true frequency, and far above that of the fabric which does not lock."""
    references, x, fabric = locked_elements(make, np.random.default_rng(33), shape)
    bound, true = bounds_and_frequencies(references, x, fabric)
    assert (bound / true).min() > 1.0 - 1e-6
    assert (bound / true).mean() < 1.3
    free, _ = bounds_and_frequencies(references, x, make.md600())
    assert (bound / free).max() > 1.3
