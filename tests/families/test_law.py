"""Fibre families: the fabric law as a special case, invariance, potentials, the compiled law."""

from __future__ import annotations

import math

import numpy as np
import pytest
from of_families import across, fabric, fibres, like_md600, pair, triaxial, unidirectional

from lcmchain.materials.features.shear import ShearLocking
from lcmchain.materials.fibre_families import _shear_of, in_voigt
from lcmchain.materials.law import (
    bending_stiffness,
    history_count,
    hourglass_tangent,
    membrane_response,
    tangent_curvature,
    tangent_slope,
    with_fibre_modulus,
)
from lcmchain.materials.stiffness import product
from lcmchain.verification.random_elements import md600

OBLIQUE = fabric(
    fibres(10.0, compression=30.0),
    fibres(70.0, tension=700.0, compression=700.0),
    shear=[pair(1, 2, locking_angle="35 deg", locking_stiffness="80 MPa")],
)
#: Woven fibres straighten before they are pulled; in compression they buckle, more so later.
CURVES = {
    "tension": None,
    "tension_curve": {"strain": [0.004, 0.008, 0.012], "stress": "0.4 2 6 MPa"},
    "compression": None,
    "compression_curve": {"strain": [0.002, 0.01], "stress": "0.2 0.5 MPa"},
}
FABRICS = {
    "curves": fabric(
        fibres(-20.0) | CURVES,
        fibres(60.0),
        shear=[pair(1, 2)],
    ),
    "unidirectional": unidirectional(25.0),
    "oblique": OBLIQUE,
    "three": triaxial(
        10.0, compression=40.0, shear=[pair(1, 2), pair(3, 1, "0.5 0 0 0 0 MPa"), pair(2, 3)]
    ),
}


def strains(seed=1, count=40):
    """Strains of formed fabric: fibres to 2 %, shear to 0.8, thickness from 0.7 to 1.2."""
    rng = np.random.default_rng(seed)
    E = rng.uniform(-1.0, 1.0, (count, 6)) * [0.02, 0.02, 0.25, 0.8, 0.1, 0.1]
    return np.concatenate([np.zeros((1, 6)), E])


def rotated(E, angle):
    """Strains (..., 6) as seen in axes turned by an angle about the normal [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    whole = np.zeros((*E.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))):
        whole[..., i, j] = whole[..., j, i] = E[..., k] * (1.0 if i == j else 0.5)
    turned = R @ whole @ R.T
    parts = [turned[..., i, j] * (1.0 if i == j else 2.0) for i, j in
             ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))]  # fmt: skip
    return np.stack(parts, axis=-1)


def compiled(material, E):
    """Stress and tangent (6, 6) of the compiled law at one strain."""
    S, C = membrane_response(material.law, tuple(E), ())
    return np.array(S), matrix(C)


def matrix(C):
    return np.array([product(C, tuple(unit)) for unit in np.eye(6)]).T


@pytest.mark.parametrize("locks", [False, True])
def test_two_families_at_a_right_angle_are_the_fabric(locks):
    entries, locking = {}, None
    if locks:
        entries = {"locking_angle": "30 deg", "locking_stiffness": "80 MPa"}
        locking = ShearLocking.from_angle(math.radians(30.0), 80e6)
    ours, theirs = like_md600(**entries).build(), md600(locking)
    E = strains()
    scale = np.abs(theirs.stress_and_tangent(E)[1]).max()
    for mine, other in zip(ours.stress_and_tangent(E), theirs.stress_and_tangent(E), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-12, atol=1e-15 * scale)
    np.testing.assert_allclose(
        ours.stabilising_tangent(E)[0], theirs.stabilising_tangent(E)[0], rtol=1e-12
    )
    for k in (1, 2):
        mine, other = ours.stabilising_tangent(E)[k], theirs.stabilising_tangent(E)[k]
        np.testing.assert_allclose(mine, other, rtol=1e-12, atol=1e-3)
    np.testing.assert_allclose(ours.membrane_energy(E), theirs.membrane_energy(E), rtol=1e-12)
    np.testing.assert_allclose(ours.bending_matrix(), theirs.bending_matrix(), rtol=1e-12)
    for one in E[:6]:
        S, C = compiled(ours, one)
        S_fabric, C_fabric = membrane_response(theirs.law, tuple(one), ())
        np.testing.assert_allclose(S, S_fabric, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(C, np.diag(C_fabric), rtol=1e-12, atol=1e-9)
    assert ours.wave_stiffness() == pytest.approx(theirs.wave_stiffness(), rel=1e-12)


@pytest.mark.parametrize("name", FABRICS)
def test_the_compiled_law_agrees_with_numpy(name):
    material = FABRICS[name].build()
    law = material.law
    E = strains(2, 12)
    stress, tangent = material.stress_and_tangent(E)
    terms = material.stabilising_terms(E)
    r = terms.readers
    for k, one in enumerate(E):
        S, C = compiled(material, one)
        np.testing.assert_allclose(S, stress[k], rtol=1e-11, atol=1e-4)
        np.testing.assert_allclose(C, tangent[k], rtol=1e-11, atol=1e-4)
        _, C_M = membrane_response(law, tuple(one), ())
        C_hg = hourglass_tangent(law, tuple(one), C_M, ())
        expected = np.einsum("t,ti,tj->ij", terms.modulus[k], r, r)
        np.testing.assert_allclose(matrix(C_hg), expected, rtol=1e-11, atol=1e-4)
        count = len(material.pairs)
        for found, kept in (
            (tangent_slope(law, tuple(one), ()), terms.slope[k]),
            (tangent_curvature(law, tuple(one), ()), terms.curvature[k]),
        ):
            ours = [*found.shear[:count], found.C33]
            own = kept[len(material.normal) : len(material.normal) + count + 1]
            np.testing.assert_allclose(ours, own, rtol=1e-9, atol=1e-3)
    bending = material.bending_matrix()
    np.testing.assert_allclose(matrix(bending_stiffness(law)), bending, rtol=1e-12, atol=1e-3)


@pytest.mark.parametrize("name", FABRICS)
def test_energies_are_asked_as_of_any_fabric(name):
    """A run asks for what is stored and lost with the history of the elements, empty here."""
    material, E = FABRICS[name].build(), strains(2, 4)
    past = np.zeros((history_count(material.law), 5))
    stored = material.membrane_energy(E, past)
    np.testing.assert_array_equal(stored, material.membrane_energy(E))
    assert not material.dissipated_energy(past).any()
    assert not material.viscous_energy(past).any()


@pytest.mark.parametrize("name", FABRICS)
def test_stress_and_tangents_follow_from_the_energy(name):
    """By central differences of order four, where no fibre changes from tension to compression."""
    material = FABRICS[name].build()
    h = 1e-5
    E = strains(3)
    E = E[np.all([np.abs(E @ read) > 3.0 * h for read in readers_of(material)], axis=0)]
    assert len(E) > 20

    def slope(function, i):
        def at(step):
            return function(E + step * np.eye(6)[i])

        return (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h)

    S, C = material.stress_and_tangent(E)
    terms = material.stabilising_terms(E)
    for i in range(6):
        energy = slope(material.membrane_energy, i)
        np.testing.assert_allclose(S[:, i], energy, rtol=1e-7, atol=1e-7 * abs(S).max())
        stress = slope(lambda strain: material.stress_and_tangent(strain)[0], i)
        np.testing.assert_allclose(C[:, :, i], stress, rtol=1e-7, atol=1e-7 * abs(C).max())
        modulus = slope(lambda strain: material.stabilising_terms(strain).modulus, i)
        expected = terms.slope * terms.readers[:, i]
        scale = 1e-6 * abs(terms.slope).max()
        np.testing.assert_allclose(modulus, expected, rtol=1e-6, atol=scale)
        rise = slope(lambda strain: material.stabilising_terms(strain).slope, i)
        expected = terms.curvature * terms.readers[:, i]
        np.testing.assert_allclose(rise, expected, atol=1e-5 * abs(terms.curvature).max())
    assert abs(C - C.transpose(0, 2, 1)).max() < 1e-14 * abs(C).max()


def readers_of(material):
    return [[r[0], r[1], 0.0, r[2], 0.0, 0.0] for r in (own.reader for own in material.normal)]


def test_three_equal_families_are_isotropic_in_the_plane():
    """Stress turns with the strain to 1e-10, and the bending does too; one family does not."""
    E = 1e-4 * strains(4)
    E[:, 2] = E[:, 4:] = 0.0
    for angle in (0.3, math.radians(45.0), 1.3):
        for material, isotropic in ((triaxial(), True), (unidirectional(), False)):
            own = material.build()
            for stiffness in (own.stress_and_tangent(np.zeros(6))[1], own.bending_matrix()):
                in_plane = stiffness.copy()
                in_plane[2] = in_plane[4:] = 0.0
                there = rotated(E, angle) @ in_plane
                here = E @ in_plane
                there_back = stress_rotated(there, -angle)
                error = abs(there_back - here).max() / abs(here).max()
                assert (error < 1e-10) == isotropic
                assert isotropic or error > 0.1


def stress_rotated(S, angle):
    """Stresses turned as strains are, without the factor 2 of shears."""
    double = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    return rotated(S * double, angle) / double


@pytest.mark.parametrize("build", [unidirectional, like_md600, triaxial])
def test_a_fabric_that_is_turned_in_its_ply_answers_the_turned_strain(build):
    E = strains(5)
    E[:, 4:] = 0.0
    angle = 37.0
    here = build(0.0).build().stress_and_tangent(rotated(E, math.radians(angle)))[0]
    there = build(angle).build().stress_and_tangent(E)[0]
    there = stress_rotated(there, math.radians(angle))
    np.testing.assert_allclose(there, here, rtol=1e-11, atol=1e-11 * abs(here).max())


@pytest.mark.parametrize("change", [-40.0, -10.0, 5.0, 40.0])
def test_the_shear_of_a_pair_is_the_change_of_its_angle(change):
    """Fibres of constant length at 60 degrees, moved towards and from each other."""
    own = OBLIQUE.build().pairs[0]
    angles = np.radians([10.0, 70.0])
    a, b = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    end = angles[1] - math.radians(change)
    F = np.stack([a, [math.cos(end), math.sin(end)]], axis=1) @ np.linalg.inv(np.stack([a, b], 1))
    E = 0.5 * (F.T @ F - np.eye(2))
    g = own.reader @ [E[0, 0], E[1, 1], 2.0 * E[0, 1]]
    assert g == pytest.approx(float(own.strain_of(math.radians(change))), rel=1e-12)
    small = 1e-6 * math.radians(change)
    assert own.strain_of(small) == pytest.approx(small, rel=1e-5)
    # stretching both fibres alike leaves the angle as it is
    assert own.reader @ [0.01, 0.01, 0.0] == pytest.approx(0.0, abs=1e-16)


def test_a_pair_locks_on_both_sides_at_its_angle():
    """The tangent gains the locking stiffness where both families lie on each other."""
    own = OBLIQUE.build().pairs[0]
    free = own._replace(locking_angle=None)
    for change, gained in ((34.9, False), (35.1, True), (-34.9, False), (-35.1, True)):
        g = own.strain_of(math.radians(change))
        assert (_shear_of(own, g)[1] > _shear_of(free, g)[1]) == gained
    for end in (own.most_closed, -own.most_opened):
        g = np.float64(end)
        assert _shear_of(own, g)[1] - _shear_of(free, g)[1] == pytest.approx(80e6, rel=1e-12)


def test_a_curve_goes_through_its_points_and_on():
    """Nominal stress at engineering strain, from the fibre's own stress and strain."""
    own = FABRICS["curves"].build().families[0]
    for sign, name in ((1.0, "tension"), (-1.0, "compression")):
        entry = CURVES[f"{name}_curve"]
        stresses = [1e6 * float(value) for value in entry["stress"].split()[:-1]]
        for strain, stress in zip(entry["strain"], stresses, strict=True):
            stretch = 1.0 + sign * strain
            found, modulus, _ = own.response(np.array([0.5 * (stretch**2 - 1.0)]))
            assert found[0] * stretch == pytest.approx(sign * stress, rel=1e-12)
            # beyond the last point it goes on with its last slope
            further, _, _ = own.response(np.array([0.5 * (stretch**2 - 1.0) + sign * 1e-9]))
            assert sign * (further[0] - found[0]) > 0.0
    assert own.buckles and own.largest == pytest.approx(own.response(np.array([0.1]))[1][0])
    softer = with_fibre_modulus(FABRICS["curves"].build(), 0.5)
    E = np.array([0.02, -0.01, 0.0, 0.05, 0.0, 0.0])
    whole = FABRICS["curves"].build().families[0].response(E @ in_voigt(own.reader))[0]
    half = softer.families[0].response(E @ in_voigt(own.reader))[0]
    assert half == pytest.approx(0.5 * whole)
    np.testing.assert_allclose(
        compiled(softer, E)[0], softer.stress_and_tangent(E)[0], rtol=1e-11, atol=1e-6
    )


def test_fibres_are_softer_in_compression_and_by_a_factor():
    own = unidirectional().build()
    soft = with_fibre_modulus(own, 0.25)
    for strain, modulus in ((0.01, 1000e6), (-0.01, 20e6)):
        E = np.array([strain, 0.0, 0.0, 0.0, 0.0, 0.0])
        assert own.stress_and_tangent(E)[0][0] == pytest.approx(modulus * strain)
        assert soft.stress_and_tangent(E)[0][0] == pytest.approx(0.25 * modulus * strain)
        # what bounds the step and stabilises is what they may come to
        tangent = membrane_response(own.law, tuple(E), ())[1]
        assert tangent.normal[0] == modulus and tangent.largest[0] == 1000e6
        assert membrane_response(soft.law, tuple(E), ())[0][0] == pytest.approx(
            0.25 * modulus * strain
        )
    E = np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
    assert soft.stress_and_tangent(E)[0][1] == own.stress_and_tangent(E)[0][1] == 0.01 * 2e6
    assert soft.fibre_modulus_factor == 0.25


# --- compression across by the spacing of the fibres ----------------------------------------------


def spaced(angle=20.0, **entries):
    return fabric(fibres(angle, compression=20.0), across=across(compressed="spacing", **entries))


def squeezed_strains():
    """Random strains, most of them squeezed across, with fibres that hardly stretch."""
    E = 0.1 * np.random.default_rng(3).standard_normal((60, 6))
    along, over = (in_voigt(own.reader) for own in spaced().build().normal)
    E -= np.outer(E @ along - 1e-3, along / (along @ along))
    return E - np.outer(np.full(len(E), 0.04), over)


def test_stress_and_tangent_of_the_spacing_are_those_of_its_energy():
    built, E = spaced().build(), squeezed_strains()
    S, C = built.stress_and_tangent(E)
    assert np.count_nonzero(built._spacing(E)[0] < 0.0) > 30
    for i, unit in enumerate(1e-6 * np.eye(6)):
        ends = [built.membrane_energy(E + sign * unit) for sign in (1.0, -1.0)]
        np.testing.assert_allclose(S[:, i], (ends[0] - ends[1]) / 2e-6, rtol=1e-6, atol=1.0)
        ends = [built.stress_and_tangent(E + sign * unit)[0] for sign in (1.0, -1.0)]
        np.testing.assert_allclose(C[:, :, i], (ends[0] - ends[1]) / 2e-6, rtol=1e-5, atol=50.0)


def test_the_compiled_spacing_is_the_plain_one_and_its_moduli_bound_the_tangent():
    built, E = spaced().build(), squeezed_strains()
    S, C = built.stress_and_tangent(E)
    for strain, stress, tangent in zip(E, S, C, strict=True):
        found, moduli = membrane_response(built.law, tuple(strain), ())
        np.testing.assert_allclose(found, stress, rtol=1e-9, atol=1e-3)
        bound = np.diag([0.0, 0.0, moduli.C33, 0.0, moduli.C23, moduli.C13])
        for readers, values in (
            (moduli.along, moduli.largest), (moduli.between, moduli.shear)
        ):  # fmt: skip
            for reader, modulus in zip(readers, values, strict=True):
                read = in_voigt(np.array(reader))
                bound = bound + modulus * np.outer(read, read)
        assert np.linalg.eigvalsh(bound - tangent)[0] > -1e-3


def test_fibres_that_slide_along_each_other_keep_what_presses_them_together():
    """Squeezed to 0.9 and sheared at that spacing: the line across grows, the pressure stays."""
    for angle in (0.0, 30.0):
        line, own = (
            fabric(fibres(0.0, compression=20.0), across=across(compressed=by)).build()
            for by in ("line", "spacing")
        )
        k = math.tan(math.radians(angle))
        F = np.array([[1.0, 0.9 * k], [0.0, 0.9]])
        C = F.T @ F
        E = np.array([0.5 * (C[0, 0] - 1), 0.5 * (C[1, 1] - 1), 0.0, C[0, 1], 0.0, 0.0])
        # force across the fibres per initial length of them: row 2 of F S on the normal 2
        S = own.stress_and_tangent(E)[0]
        pressed = (F @ np.array([[S[0], S[3]], [S[3], S[1]]]))[1, 1]
        stress = line.stress_and_tangent(np.array([0.0, 0.5 * (0.81 - 1), 0, 0, 0, 0]))[0][1]
        pulled = max(E[1], 0.0) * 2e6  # stitching along the line
        assert pressed == pytest.approx(0.9 * (stress + pulled), rel=1e-9)
        if angle:
            loose = line.stress_and_tangent(E)[0]
            assert loose[1] > 0.0 > stress
