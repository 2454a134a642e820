"""What forces owe to energy: potentials, rigid motions, frame invariance, rank, no locking."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.materials.features.shear_compaction import PowerCoupling
from lcmchain.materials.st_venant_kirchhoff import StVenantKirchhoff, isotropic_stiffness
from lcmchain.verification.random_elements import CURVES

STRAINS = ("normal", "director")
seeds = st.integers(0, 2**32 - 1)


def gradient(energy, x, step):
    """Derivative (8, 3) of a scalar by central differences, extrapolated to sixth order."""
    result = np.zeros(24)
    for i in range(24):
        dx = np.zeros(24)
        dx[i] = step
        dx = dx.reshape(8, 3)
        d1, d2, d3 = ((energy(x + k * dx) - energy(x - k * dx)) / (2 * k) for k in (1, 2, 3))
        result[i] = (15 * d1 - 6 * d2 + d3) / (10 * step)
    return result.reshape(8, 3)


def assert_forces_derive_from_energy(element, x, step, energy, force):
    expected = gradient(lambda x: energy(element.evaluate(x)), x, step)
    actual = force(element.evaluate(x))
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-7 * abs(expected).max())


def stiffnesses(make, rng, kind):
    """Full stiffnesses of which the element, without its cross terms, has a potential."""
    material = make.coupled(rng)
    C_M, C_B = material.C_membrane, material.C_bending
    if kind == "equal":
        C_B = C_M
    elif kind == "proportional":
        C_B = 0.04 * C_M
    elif kind == "compaction on its own":
        for C in (C_M, C_B):
            C[2, [0, 1, 3, 4, 5]] = C[[0, 1, 3, 4, 5], 2] = 0.0
    return StVenantKirchhoff(C_M, C_B, thickness=1e-3, density=600.0)


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("kind", ["equal", "proportional", "compaction on its own"])
def test_constant_stiffness_has_a_potential(make, kind, strain):
    """With C^M = C^B as printed, else once the cross terms of Eqs. (15) and (19) are dropped.

    The enhanced strain of Eq. (19) keeps it where C^M and C^B couple 33 in the same proportions.
    """
    rng = np.random.default_rng(11)
    equal = kind == "equal"
    for reference in (make.flat_reference, make.curved_reference):
        X, fibre = reference(rng)
        options = ElementOptions(
            compaction_strain=strain, cross_terms=equal, in_plane_shear_hourglass=equal
        )
        assert_forces_derive_from_energy(
            ReferenceElement(X, fibre, stiffnesses(make, rng, kind), options),
            make.deformed(rng, X, fibre),
            1e-5,
            lambda result: result.energy + result.hourglass_energy,
            lambda result: result.force,
        )


def work_around(element, corners):
    """Work of the forces along a closed polygon of configurations over the sum of its amounts."""
    points, weights = np.polynomial.legendre.leggauss(16)
    work, amount = 0.0, 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        for point, weight in zip(0.5 * (1 + points), 0.5 * weights, strict=True):
            force = element.evaluate(start + point * (end - start)).force
            work += weight * np.sum(force * (end - start))
            amount += weight * abs(np.sum(force * (end - start)))
    return abs(work) / amount


def test_cross_terms_have_no_potential_when_stiffnesses_differ(make):
    """The reason why they can be dropped: the work around a closed path does not vanish."""
    rng = np.random.default_rng(12)
    material = stiffnesses(make, rng, "compaction on its own")
    X, fibre = make.flat_reference(rng, thickness=5e-3)
    corners = [make.deformed(rng, X, fibre, warp=0.5, rotated=False) for _ in range(3)]
    printed, dropped = (
        work_around(ReferenceElement(X, fibre, material, options), corners)
        for options in (ElementOptions(cross_terms=True), ElementOptions())
    )
    assert dropped < 1e-10
    assert printed > 1e-4


FORMED = pytest.mark.parametrize("shear, compaction", [(0.9, 0.7), (-0.4, 0.85), (0.02, 1.1)])


def formed_fabric(make, shear, compaction, *, law=None, **options):
    """A warped element of fabric, sheared and compacted, and its node positions."""
    rng = np.random.default_rng(13)
    X, fibre = make.curved_reference(rng)
    options = ElementOptions(**options)
    x = make.deformed(rng, X, fibre, gradient=make.sheared(shear, compaction, 1.001), warp=0.05)
    material = make.md600(**law or {})
    return ReferenceElement(X, fibre, material, options), x


@FORMED
@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("bending_thickness", ["current", "reference"])
def test_fabric_has_a_potential(make, bending_thickness, strain, shear, compaction):
    options = {"compaction_strain": strain, "bending_thickness": bending_thickness}
    assert_forces_derive_from_energy(
        *formed_fabric(make, shear, compaction, **options),
        1e-6,
        lambda result: result.energy + result.hourglass_energy,
        lambda result: result.force,
    )


@FORMED
@pytest.mark.parametrize(
    "law", [{"coupling": PowerCoupling(0.8)}, {"bending_curves": CURVES}], ids=list
)
def test_fabric_with_all_that_a_law_can_have_has_a_potential(make, law, shear, compaction):
    assert_forces_derive_from_energy(
        *formed_fabric(make, shear, compaction, law=law),
        1e-6,
        lambda result: result.energy + result.hourglass_energy,
        lambda result: result.force,
    )


@FORMED
def test_fabric_as_published_has_one_but_for_its_hourglass_part(make, shear, compaction):
    """Eq. (16) leaves out that the tangent of Eq. (18) follows the strain at the centre."""
    element, x = formed_fabric(make, shear, compaction, hourglass="published")
    assert_forces_derive_from_energy(
        element,
        x,
        1e-6,
        lambda result: result.energy,
        lambda result: result.force - result.hourglass_force,
    )
    stored = gradient(lambda x: element.evaluate(x).hourglass_energy, x, 1e-6)
    published = element.evaluate(x).hourglass_force
    assert abs(published - stored).max() > 1e-5 * abs(stored).max()


# --- rigid motions and frame invariance -----------------------------------------------------------


def unit_strain_force(element, X):
    """Largest nodal force under a strain of the order of one."""
    return abs(element.evaluate(X + 0.5 * (X - X.mean(axis=0))).force).max()


def random_element(make, seed, strain, curved):
    rng = np.random.default_rng(seed)
    material = make.md600() if seed % 2 else make.coupled(rng)
    X, fibre = (make.curved_reference if curved else make.flat_reference)(rng)
    bending_thickness = ("current", "reference")[seed // 2 % 2]
    options = ElementOptions(compaction_strain=strain, bending_thickness=bending_thickness)
    return rng, X, fibre, ReferenceElement(X, fibre, material, options)


@given(seed=seeds, strain=st.sampled_from(STRAINS), curved=st.booleans())
def test_rigid_motion_costs_nothing(make, seed, strain, curved):
    rng, X, _, element = random_element(make, seed, strain, curved)
    moved = (X - X.mean(axis=0)) @ make.rotation(rng).T + rng.normal(size=3)
    result = element.evaluate(moved)
    scale = unit_strain_force(element, X)
    assert abs(result.force).max() < 1e-9 * scale
    assert abs(result.energy + result.hourglass_energy) < 1e-12 * scale * 5e-3


@given(seed=seeds, strain=st.sampled_from(STRAINS), curved=st.booleans())
def test_forces_turn_with_the_element(make, seed, strain, curved):
    """f(Q x + c) = Q f(x), with the same energy: no frame is preferred."""
    rng, X, fibre, element = random_element(make, seed, strain, curved)
    x = make.deformed(rng, X, fibre)
    Q = make.rotation(rng)
    result = element.evaluate(x)
    turned = element.evaluate((x - x.mean(axis=0)) @ Q.T + rng.normal(size=3) * 0.1)
    scale = abs(result.force).max()
    np.testing.assert_allclose(turned.force, result.force @ Q.T, rtol=0.0, atol=1e-10 * scale)
    np.testing.assert_allclose(turned.energy, result.energy, rtol=1e-10)
    np.testing.assert_allclose(turned.hourglass_energy, result.hourglass_energy, rtol=1e-9)


@given(seed=seeds, strain=st.sampled_from(STRAINS), curved=st.booleans())
def test_forces_are_in_equilibrium(make, seed, strain, curved):
    rng, X, fibre, element = random_element(make, seed, strain, curved)
    x = make.deformed(rng, X, fibre)
    force = element.evaluate(x).force
    arm = x - x.mean(axis=0)
    scale = abs(force).max()
    assert abs(force.sum(axis=0)).max() < 1e-12 * scale
    assert abs(np.cross(arm, force).sum(axis=0)).max() < 1e-12 * scale * abs(arm).max()


# --- rank -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("shear_row", [True, False], ids=["as printed", "shear row dropped"])
@pytest.mark.parametrize("kind", ["fabric", "isotropic", "coupled"])
def test_six_zero_eigenvalues_and_no_more(make, kind, shear_row, strain):
    """The tangent at the reference of distorted elements: six rigid motions, the rest stiff."""
    rng = np.random.default_rng(14)
    options = ElementOptions(compaction_strain=strain, in_plane_shear_hourglass=shear_row)
    for _ in range(3):
        material = {
            "fabric": make.md600,
            "isotropic": make.isotropic,
            "coupled": lambda: make.coupled(rng),
        }[kind]()
        X, fibre = make.curved_reference(rng)
        element = ReferenceElement(X, fibre, material, options)
        K = make.difference_tangent(element.evaluate, X, 1e-8)
        eigenvalues = np.linalg.eigvalsh(0.5 * (K + K.T))
        # the softest deformation of a fabric is 1e-6 of the stiffest, noise is 1e-11
        assert np.count_nonzero(abs(eigenvalues) < 1e-9 * eigenvalues[-1]) == 6
        assert np.count_nonzero(eigenvalues > 1e-8 * eigenvalues[-1]) == 18


# --- bending at the reference thickness -----------------------------------------------------------


def bent(make, thickness_stretch, bending_thickness, curvature=20.0):
    """A flat element of MD600 bent about η and compacted, and its result."""
    material = make.md600()
    X = make.cube * np.array([2.5e-3, 2.5e-3, 0.5 * material.thickness])
    angle = curvature * X[:, 0]
    x = X * [1.0, 1.0, thickness_stretch]
    x[:, 0] -= x[:, 2] * np.sin(angle)
    options = ElementOptions(bending_thickness=bending_thickness)
    return ReferenceElement(X, [1.0, 0.0, 0.0], material, options), x


def test_bending_energy_at_the_reference_thickness_knows_the_curvature_only(make):
    """At the thickness stretch λ the same curvature stores the same, else λ² of it."""

    def bending(stretch, bending_thickness):
        element, x = bent(make, stretch, bending_thickness)
        straight, y = bent(make, stretch, bending_thickness, curvature=0.0)
        return element.evaluate(x).energy - straight.evaluate(y).energy

    full = bending(1.0, "current")
    # but for the quadratic term, the shorter directors and the stretched mid-surface
    assert bending(1.0, "reference") == pytest.approx(full, rel=1e-3)
    assert bending(0.7, "reference") == pytest.approx(full, rel=1e-2)
    assert bending(0.7, "current") == pytest.approx(0.49 * full, rel=1e-2)


def test_bending_at_the_reference_thickness_does_not_press(make):
    """The work of a change of the thickness: that of the compaction law, bent or not."""

    def work(bending_thickness, curvature):
        element, x = bent(make, 0.7, bending_thickness, curvature)
        force = element.evaluate(x).force
        return 0.5 * np.sum((force[4:] - force[:4]) * (x[4:] - x[:4]))

    flat = work("reference", 0.0)
    assert flat == pytest.approx(work("current", 0.0), rel=1e-12)
    # the chord: E33 is taken with the mean of directors that turn by 0.1
    assert work("reference", 20.0) == pytest.approx(flat, rel=2e-3)
    pulled = work("current", 20.0) - flat
    assert pulled == pytest.approx(
        make.md600().law.B11 * (20.0 * 0.7 * 0.502e-3) ** 2 / 3.0 * 25e-6 * 1.004e-3, rel=0.02
    )


def test_without_curvature_the_thickness_of_bending_does_not_matter(make):
    """The patch test: a constant strain in a distorted plane mesh causes no bending strain."""
    rng = np.random.default_rng(17)
    X = make.cube * np.array([2.5e-3, 2.5e-3, 0.502e-3])
    X[:, :2] += np.tile(rng.uniform(-4e-4, 4e-4, (4, 2)), (2, 1))
    x = X @ make.sheared(0.4, 0.8, 1.01).T
    one, other = (
        ReferenceElement(
            X, [1.0, 0.0, 0.0], make.md600(), ElementOptions(bending_thickness=thickness)
        ).evaluate(x)
        for thickness in ("current", "reference")
    )
    np.testing.assert_allclose(one.force, other.force, rtol=0.0, atol=1e-12 * abs(one.force).max())


# --- enhanced strain ------------------------------------------------------------------------------


def bending_stiffness(make, material, curvature=1e-3):
    """Moment over curvature and width of a flat element bent about η, its top and bottom free."""
    t, a = material.thickness, 5e-3
    X = make.cube * np.array([a / 2, a / 2, t / 2])
    x = X.copy()
    angle = curvature * X[:, 0] / t
    x[:, 0] -= X[:, 2] * np.sin(angle)
    force = ReferenceElement(X, [1.0, 0, 0], material).evaluate(x).force
    right = make.cube[:, 0] > 0
    moment = -np.sum(force[right, 0] * X[right, 2])
    return moment / (2 * angle.max() / a) / a


def test_enhanced_strain_frees_bending_from_the_thickness(make):
    """Plane-strain bending: E t³/12(1-ν²); without the enhanced strain 22 % more (ν = 0.3)."""
    nu, E = 0.3, 70e9
    material = make.isotropic(nu, E)
    plate = E * material.thickness**3 / 12 / (1 - nu**2)
    np.testing.assert_allclose(bending_stiffness(make, material), plate, rtol=1e-4)

    # a membrane stiffness without coupling to 33 leaves the enhanced strain at work on 33 alone
    locked = (1 - nu) / ((1 + nu) * (1 - 2 * nu)) * E * material.thickness**3 / 12
    stiff = isotropic_stiffness(E, nu)
    uncoupled = stiff.copy()
    uncoupled[2, :2] = uncoupled[:2, 2] = 0.0
    without = StVenantKirchhoff(uncoupled, uncoupled, thickness=material.thickness, density=1.0)
    np.testing.assert_allclose(bending_stiffness(make, without), locked, rtol=1e-4)
    assert locked > 1.2 * plate
