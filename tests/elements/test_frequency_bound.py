"""The bound of the highest element frequency: never too low, and seldom far too high."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.elements.solid_shell.frequency import Parts, add_pair, add_row
from lcmchain.elements.solid_shell.reference import ElementOptions
from lcmchain.materials.features.shear_compaction import PowerCoupling
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, orthotropic_stiffness
from lcmchain.verification.random_elements import bounds_and_frequencies

COUNT = 48

#: Both kinds of references, where each compiles a kernel of its own and takes the same terms of the
#: bound: those of flat ones stand in the tests of fabrics.
CURVED_FIRST = ["curved", pytest.param("flat", marks=pytest.mark.slow)]


def assert_close_from_above(bound, true):
    ratio = bound / true
    assert ratio.min() > 1.0 - 1e-6
    assert ratio.mean() < 1.3


@pytest.mark.parametrize("shear", [0.0, 30.0, -60.0])
@pytest.mark.parametrize("compaction", [1.15, 0.8, 0.6])
@pytest.mark.parametrize("shape", ["flat", "curved"])
def test_fabric_sheared_compacted_and_stretched(make, shape, compaction, shear):
    rng = np.random.default_rng(21)
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references = [reference(rng) for _ in range(COUNT)]
    x = []
    for element in references:
        gradient = make.sheared(np.radians(shear), compaction, rng.uniform(0.997, 1.01))
        x.append(make.deformed(rng, *element, gradient=gradient, warp=rng.uniform(0.0, 0.1)))
    assert_close_from_above(*bounds_and_frequencies(references, x, make.md600()))


@pytest.mark.parametrize("shear", [30.0, -60.0])
@pytest.mark.parametrize("compaction", [1.15, 0.8, 0.6])
def test_fabric_whose_thickness_knows_its_shear(make, compaction, shear):
    rng = np.random.default_rng(29)
    references = [make.curved_reference(rng) for _ in range(COUNT)]
    x = []
    for element in references:
        gradient = make.sheared(np.radians(shear), compaction, rng.uniform(0.997, 1.01))
        x.append(make.deformed(rng, *element, gradient=gradient, warp=rng.uniform(0.0, 0.1)))
    assert_close_from_above(
        *bounds_and_frequencies(references, x, make.md600(coupling=PowerCoupling(1.0)))
    )


@pytest.mark.parametrize("shape", ["flat", "curved"])
def test_fabric_that_is_curved_with_its_neighbours(make, shape):
    rng = np.random.default_rng(27)
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references = [reference(rng) for _ in range(COUNT)]
    x = [
        make.deformed(rng, *element, gradient=make.sheared(0.5, 0.65), warp=0.05)
        for element in references
    ]
    assert_close_from_above(*bounds_and_frequencies(references, x, make.md600(), rng=rng))


@pytest.mark.parametrize("shape", CURVED_FIRST)
def test_bending_at_the_reference_thickness(make, shape):
    """Formed, and with a bending stiffness large enough to govern."""
    rng = np.random.default_rng(27)
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references = [reference(rng) for _ in range(COUNT)]
    x = []
    for element in references:
        gradient = make.sheared(0.5, rng.uniform(0.6, 1.1))
        x.append(make.deformed(rng, *element, gradient=gradient, warp=rng.uniform(0.0, 0.1)))
    options = ElementOptions(bending_thickness="reference")
    assert_close_from_above(*bounds_and_frequencies(references, x, make.md600(), options))
    stiff = make.md600(B11=1e10, B22=1e10, B12=1e9)
    assert_close_from_above(*bounds_and_frequencies(references, x, stiff, options))


@pytest.mark.slow
def test_fabric_as_published(make):
    rng = np.random.default_rng(22)
    references = [make.flat_reference(rng) for _ in range(COUNT)]
    x = [
        make.deformed(rng, *element, gradient=make.sheared(0.5, 0.65), warp=0.05)
        for element in references
    ]
    options = ElementOptions(compaction_strain="director", hourglass="published")
    assert_close_from_above(*bounds_and_frequencies(references, x, make.md600(), options))


@pytest.mark.parametrize(
    ("poisson_ratio", "shape"),
    [
        (0.0, "curved"), (0.3, "curved"),
        pytest.param(0.3, "flat", marks=pytest.mark.slow),
        pytest.param(0.0, "flat", marks=pytest.mark.slow),  # without enhanced strain, as fabrics
    ],
)  # fmt: skip
@pytest.mark.parametrize("thickness", [10e-3, 1e-3, 0.1e-3])
def test_isotropic_thick_and_thin(make, thickness, poisson_ratio, shape):
    rng = np.random.default_rng(23)
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references = [reference(rng, thickness=thickness) for _ in range(COUNT)]
    x = [make.deformed(rng, *element, stretch=0.03) for element in references]
    assert_close_from_above(*bounds_and_frequencies(references, x, make.isotropic(poisson_ratio)))


@pytest.mark.parametrize("cross_terms", [pytest.param(True, marks=pytest.mark.slow), False])
def test_orthotropic_with_soft_bending(make, cross_terms):
    rng = np.random.default_rng(24)
    C = orthotropic_stiffness(60e9, 20e9, 10e9, 0.25, 0.3, 0.35, 5e9, 4e9, 3e9)
    material = StVenantKirchhoff(C, 0.04 * C, thickness=1e-3, density=1500.0)
    references = [make.curved_reference(rng) for _ in range(COUNT)]
    x = [make.deformed(rng, *element, stretch=0.03) for element in references]
    options = ElementOptions(cross_terms=cross_terms, integration_points=2)
    assert_close_from_above(*bounds_and_frequencies(references, x, material, options))


@pytest.mark.parametrize("shape", CURVED_FIRST)
def test_full_stiffness_matrices(make, shape):
    rng = np.random.default_rng(26)
    reference = make.flat_reference if shape == "flat" else make.curved_reference
    references = [reference(rng) for _ in range(COUNT)]
    x = [make.deformed(rng, *element) for element in references]
    for equal in (True, False):
        assert_close_from_above(
            *bounds_and_frequencies(references, x, make.coupled(rng, equal=equal))
        )


def test_fibre_aligned_rectangle_is_bounded_by_its_fibre_wave(make):
    """2 c / l of the shorter side, exactly, where fibres are much stiffer than all else."""
    rng = np.random.default_rng(25)
    fabric = make.md600()
    references = [make.flat_reference(rng, aligned=True) for _ in range(COUNT)]
    x = [nodes for nodes, _ in references]
    bound, true = bounds_and_frequencies(references, x, fabric)
    sides = [
        min(np.linalg.norm(nodes[1] - nodes[0]), np.linalg.norm(nodes[3] - nodes[0])) for nodes in x
    ]
    exact = 2.0 * np.sqrt(fabric.law.C11 / fabric.density) / np.array(sides)
    np.testing.assert_allclose(true, exact, rtol=1e-5)
    # the bound adds the shear rows of the same mode, 0.3 MPa to 1000 MPa
    np.testing.assert_allclose(bound, exact, rtol=1e-3)

    stiff = make.md600(C11=1e12, C22=1e12)
    bound, _ = bounds_and_frequencies(references, x, stiff)
    exact = 2.0 * np.sqrt(stiff.law.C11 / stiff.density) / np.array(sides)
    np.testing.assert_allclose(bound, exact, rtol=1e-6)


def test_compaction_comes_to_govern(make):
    """At 0.50 mm the thickness wave limits the step to 2.2 µs, at 0.70 mm to 12.6 µs."""
    fabric = make.md600(C11=1.0, C22=1.0)  # nothing but compaction can govern
    X = make.cube * np.array([2.5e-3, 2.5e-3, 0.502e-3])
    for thickness, critical in ((0.70e-3, 12.6e-6), (0.60e-3, 5.3e-6), (0.50e-3, 2.2e-6)):
        x = X * [1.0, 1.0, thickness / 1.004e-3]
        (bound,), (true,) = bounds_and_frequencies([(X, [1.0, 0.0, 0.0])], [x], fabric)
        np.testing.assert_allclose(2.0 / true, critical, rtol=0.02)
        np.testing.assert_allclose(bound, true, rtol=0.1)


def test_rows_that_few_modes_have_a_part_of():
    """Norms of the blocks of d b bᵀ and of d (b cᵀ + c bᵀ), where b and c share some modes."""
    random = np.random.default_rng(4)
    rows = random.normal(size=(2, 7, 3)) * [[[1], [0], [1], [0], [0], [1], [0]]]
    rows[1, 3], rows[1, 0] = random.normal(size=3), 0.0
    parts = Parts(np.empty((2, 7)), np.empty((2, 7), dtype=np.int64))
    (b, c), norms = np.linalg.norm(rows, axis=2), np.full((7, 7), 0.5)
    add_row(rows[0].ravel(), 3.0, norms, parts)
    np.testing.assert_allclose(norms, 0.5 + 3.0 * np.outer(b, b), rtol=1e-14)
    norms[:] = 0.5
    add_pair(rows[0].ravel(), rows[1].ravel(), 2.0, norms, parts)
    np.testing.assert_allclose(norms, 0.5 + 2.0 * (np.outer(b, c) + np.outer(c, b)), rtol=1e-14)
