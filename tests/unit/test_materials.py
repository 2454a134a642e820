"""Material laws: published values, tangents, energies, and the compiled law against NumPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.materials.fabric import Fabric, FabricLaw
from lcmchain.materials.features.compaction import (
    compaction_tangent_curvature,
    compaction_tangent_slope,
)
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.features.shear import shear_tangent_curvature, shear_tangent_slope
from lcmchain.materials.law import (
    bending_stiffness,
    hourglass_tangent,
    membrane_response,
    stabilising_tangent,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.materials.st_venant_kirchhoff import (
    OrthotropicLaw,
    StiffnessLaw,
    StVenantKirchhoff,
    isotropic_stiffness,
    orthotropic_stiffness,
)
from lcmchain.materials.stiffness import orthotropic_rows, product
from lcmchain.scene import scene_from_text

MPA = 1e6
SHEAR = np.array([0.1919, -2.3637, 14.7593, -40.7199, 42.3208]) * MPA  # Table B.1
C0, C1, C2 = 0.1563 * MPA, 60.4653, 2.4528  # Table B.2
THICKNESS = 1.004e-3

SCENE = """
title = "material"
[process]
time = "1 ms"
[blank]
size = ["20 mm", "20 mm"]
edge_length = "5 mm"
[material]
preset = "MD600"
{}
"""


def md600(entries="") -> Fabric:
    return scene_from_text(SCENE.format(entries)).material.build()


def strain(**components):
    """Voigt strain with the given components, E12 meaning the tensor component."""
    E = np.zeros(6)
    for name, value in components.items():
        row = {"E11": 0, "E22": 1, "E33": 2, "E12": 3, "E23": 4, "E13": 5}[name]
        E[row] = value * (2.0 if row > 2 else 1.0)
    return E


def random_strains(count=200, seed=0):
    rng = np.random.default_rng(seed)
    size = np.array([0.01, 0.01, 0.45, 0.9, 0.3, 0.3])
    return rng.uniform(-1.0, 1.0, (count, 6)) * size


# --- MD600 ----------------------------------------------------------------------------------------


def test_md600_holds_the_published_parameters():
    fabric = md600()
    assert fabric.law == pytest.approx(
        FabricLaw(
            1000 * MPA, 1000 * MPA, 0.1 * MPA, 0.1 * MPA, *SHEAR, C0, C1, C2,
            38.0615 * MPA, 43.0668 * MPA, 0.1 * MPA, 4.2123 * MPA, 0.1 * MPA, 0.1 * MPA,
        ),
        rel=1e-14,
    )  # fmt: skip
    assert bending_stiffness(fabric.law) == pytest.approx(np.diag(fabric.bending_matrix()))
    assert np.diag(fabric.bending_matrix())[:3] == pytest.approx([38.0615e6, 43.0668e6, 0.1e6])
    # not the density of the fibres
    assert fabric.density == pytest.approx(597.6, abs=0.05)


# γ [degrees]: secant C12, C12 E12 and its derivative with respect to E12 [MPa]
SHEAR_TABLE = {
    5: (0.11371, 0.00496, 0.05726),
    10: (0.07369, 0.00640, 0.02065),
    15: (0.05681, 0.00735, 0.02800),
    20: (0.05186, 0.00887, 0.04474),
    25: (0.05163, 0.01091, 0.05511),
    30: (0.05250, 0.01313, 0.05900),
    40: (0.05650, 0.01816, 0.09664),
    50: (0.07457, 0.02856, 0.27884),
    60: (0.11755, 0.05090, 0.66201),
    70: (0.17843, 0.08383, 1.16338),
}


@pytest.mark.parametrize("gamma", SHEAR_TABLE)
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("convention, factor", [("engineering", 2.0), ("tensor", 1.0)])
def test_shear_stress_follows_the_published_polynomial(gamma, sign, convention, factor):
    """S12 = C12·2E12 (engineering shear, the default) or C12·E12, the same for both signs."""
    fabric = md600(f'membrane.shear_convention = "{convention}"')
    secant, stress, slope = SHEAR_TABLE[gamma]
    E12 = sign * 0.5 * math.sin(math.radians(gamma))
    S, C = fabric.stress_and_tangent(strain(E12=E12))
    assert S[3] / E12 / factor == pytest.approx(secant * MPA, abs=6.0)
    assert S[3] == pytest.approx(sign * factor * stress * MPA, abs=6.0 * factor)
    # the tangent is with respect to 2 E12
    assert 2.0 * C[3, 3] == pytest.approx(factor * slope * MPA, abs=6.0 * factor)


def test_shear_convention_also_scales_transverse_and_bending_shear():
    engineering, tensor = md600().law, md600('membrane.shear_convention = "tensor"').law
    for name in ("C23", "C13", "s0", "s4", "B12", "B23", "B13"):
        assert getattr(tensor, name) == 0.5 * getattr(engineering, name)
    for name in ("C11", "C22", "c0", "c1", "c2", "B11", "B22", "B33"):
        assert getattr(tensor, name) == getattr(engineering, name)


def test_shear_stress_rises_with_the_angle_up_to_locking():
    fabric = md600()
    gamma = np.radians(np.linspace(-90.0, 90.0, 3601))
    E = np.zeros((gamma.size, 6))
    E[:, 3] = np.sin(gamma)
    S, C = fabric.stress_and_tangent(E)
    assert (np.diff(S[:, 3]) > 0.0).all()
    # the softest tangent is a tenth of the first, at 10.95 degrees
    softest = np.argmin(C[:, 3, 3])
    assert abs(np.degrees(gamma[softest])) == pytest.approx(10.95, abs=0.05)
    assert C[softest, 3, 3] == pytest.approx(0.0200 * MPA, abs=50.0)


# t [mm]: E33, C33, dS33/dE33, |S33|, p [MPa]
COMPACTION_TABLE = {
    0.950: (-0.0523, 0.1633, 0.181, 0.00854, 0.00809),
    0.900: (-0.0982, 0.1917, 0.288, 0.01883, 0.01688),
    0.850: (-0.1416, 0.2578, 0.574, 0.03651, 0.03091),
    0.800: (-0.1825, 0.3973, 1.306, 0.07252, 0.05778),
    0.750: (-0.2210, 0.6939, 3.231, 0.15335, 0.11456),
    0.700: (-0.2569, 1.3521, 8.508, 0.34742, 0.24222),
    0.650: (-0.2904, 2.8800, 23.46, 0.83643, 0.54152),
    0.600: (-0.3214, 6.5585, 66.67, 2.10810, 1.25982),
    0.550: (-0.3500, 15.598, 191.7, 5.45858, 2.99026),
    0.500: (-0.3760, 37.835, 547.2, 14.2257, 7.08453),
}


@pytest.mark.parametrize("millimetres", COMPACTION_TABLE)
def test_compaction_follows_the_published_law(millimetres):
    fabric = md600()
    E33, secant, slope, stress, pressure = COMPACTION_TABLE[millimetres]
    stretch = millimetres / 1.004
    exact = 0.5 * (stretch**2 - 1.0)
    assert exact == pytest.approx(E33, abs=6e-5)
    S, C = fabric.stress_and_tangent(strain(E33=exact))
    assert S[2] / exact == pytest.approx(secant * MPA, rel=3e-4)
    assert S[2] == pytest.approx(-stress * MPA, rel=1e-4, abs=6.0)
    assert C[2, 2] == pytest.approx(slope * MPA, rel=3e-3)
    assert fabric.compaction_pressure(stretch) == pytest.approx(pressure * MPA, rel=1e-4, abs=6.0)


@pytest.mark.parametrize("t", [0.90, 0.80, 0.70, 0.65, 0.60])
def test_tool_pressure_is_near_the_measured_one(t):
    """Φ = 0.2820 (p/kPa)^0.0926, within 12 % of the pressure, 1 % of the fibre volume content."""
    volume_content = 0.6 / (1810.0 * t * 1e-3)
    measured = 1e3 * (volume_content / 0.2820) ** (1.0 / 0.0926)
    assert md600().compaction_pressure(t / 1.004) == pytest.approx(measured, rel=0.12)


def test_thickening_is_linear_and_needs_no_pressure():
    fabric = md600()
    for E33 in (1e-9, 0.01, 0.3):
        S, C = fabric.stress_and_tangent(strain(E33=E33))
        assert S[2] == pytest.approx(C0 * E33, rel=1e-14)
        assert C[2, 2] == pytest.approx(C0, rel=1e-14)
    np.testing.assert_array_equal(fabric.compaction_pressure([1.0, 1.001, 1.5]), 0.0)
    # the two branches meet with the same stress and slope
    below, above = (fabric.stress_and_tangent(strain(E33=e))[1][2, 2] for e in (-1e-6, 1e-6))
    assert below == pytest.approx(above, rel=1e-10)


# --- tangent, energy, compiled law ----------------------------------------------------------------


@pytest.mark.parametrize("convention", ["engineering", "tensor"])
def test_tangent_is_the_derivative_of_the_stress(convention):
    fabric = md600(f'membrane.shear_convention = "{convention}"')
    E = random_strains()
    h = 1e-5
    C = fabric.stress_and_tangent(E)[1]
    for row in range(6):
        d = h * np.eye(6)[row]
        near = fabric.stress_and_tangent(E + d)[0] - fabric.stress_and_tangent(E - d)[0]
        far = fabric.stress_and_tangent(E + 2 * d)[0] - fabric.stress_and_tangent(E - 2 * d)[0]
        # the polynomial in |E12| has a kink in its slope at 0
        smooth = abs(E[:, 3]) > 4 * h if row == 3 else slice(None)
        derivative = ((8 * near - far) / (12 * h))[smooth]
        size = abs(C).max(axis=(1, 2), keepdims=True)[smooth][:, :, 0]
        np.testing.assert_allclose(derivative / size, C[:, :, row][smooth] / size, atol=1e-9)


def test_slope_and_curvature_are_derivatives_of_the_tangent():
    """On both sides of the kinks at E12 = 0 and E33 = 0; compiled and in NumPy."""
    fabric = md600()
    h = 1e-5
    for value in (-0.45, -0.2, -0.03, -1e-4, 1e-4, 0.03, 0.3, 0.9):
        E = np.zeros(6)
        E[[2, 3]] = value
        d = h * np.eye(6)[[2, 3]].sum(axis=0)
        points = [E + k * d for k in (-2, -1, 1, 2)]
        tangent = [np.diag(fabric.stress_and_tangent(p)[1]) for p in points]
        slope = (8 * (tangent[2] - tangent[1]) - (tangent[3] - tangent[0])) / (12 * h)
        size = abs(slope).max() + MPA
        np.testing.assert_allclose(fabric.tangent_slope(E) / size, slope / size, atol=1e-8)
        compiled = (
            compaction_tangent_slope(fabric.law, value),
            shear_tangent_slope(fabric.law, value),
        )
        np.testing.assert_allclose(compiled, fabric.tangent_slope(E)[[2, 3]], rtol=1e-12)

        slopes = [fabric.tangent_slope(p) for p in points]
        curvature = (8 * (slopes[2] - slopes[1]) - (slopes[3] - slopes[0])) / (12 * h)
        compiled = (
            compaction_tangent_curvature(fabric.law, value),
            shear_tangent_curvature(fabric.law, value),
        )
        size = abs(curvature).max() + MPA
        np.testing.assert_allclose(compiled / size, curvature[[2, 3]] / size, atol=1e-6)


def stabilising(law, g):
    """Tangent 12, slope and curvature of the stabilising tangent at g, compiled."""
    E = (0.0, 0.0, 0.0, g, 0.0, 0.0)
    C_M = membrane_response(law, E, ())[1]
    return (
        hourglass_tangent(law, E, C_M, ())[3],
        tangent_slope(law, E, ())[3],
        tangent_curvature(law, E, ())[3],
    )


@pytest.mark.parametrize("g", [-0.9, -0.1, -0.05, -1e-3, 0.0, 1e-3, 0.03, 0.0872, 0.3])
def test_the_stabilising_shear_tangent_is_smooth(g):
    """Its slope and curvature are derivatives, also across zero; compiled and in NumPy."""
    fabric, h = md600(), 1e-5
    points = [stabilising(fabric.law, g + k * h) for k in (-2, -1, 0, 1, 2)]
    for below, own in ((0, 1), (1, 2)):
        before2, before, _, after, after2 = (p[below] for p in points)
        derivative = (8 * (after - before) - (after2 - before2)) / (12 * h)
        assert points[2][own] == pytest.approx(derivative, rel=1e-4, abs=1e-2 * MPA)
    E = np.array([0.0, 0.0, 0.0, g, 0.0, 0.0])
    tangent, slope, curvature = stabilising_tangent(fabric, E)
    plain = (tangent[3, 3], slope[3], curvature[3])
    assert points[2] == pytest.approx(plain, rel=1e-10, abs=1.0)


def test_the_stabilising_tangent_is_that_of_the_law_beyond_five_degrees():
    fabric = md600()
    for angle in (5.01, 20.0, -40.0):
        g = np.sin(np.radians(angle))
        assert (
            stabilising(fabric.law, g)[0]
            == membrane_response(fabric.law, (0.0, 0.0, 0.0, g, 0.0, 0.0), ())[1][3]
        )


@pytest.mark.parametrize("change", [10.0, 19.0])
def test_the_shear_stress_keeps_its_sign_where_the_shear_angle_changes_over_an_element(change):
    """With the kink of the tangent it was wrong below 0.2° and more."""
    fabric = md600()
    half = np.radians(0.5 * change)

    def stress(g, slope):
        return membrane_response(fabric.law, (0.0, 0.0, 0.0, g, 0.0, 0.0), ())[0][3] + (
            slope * half**2 / 6.0
        )

    for angle in (0.01, 0.1, 0.5, 1.0, 3.0):
        g = np.radians(angle)
        assert stress(g, stabilising(fabric.law, g)[1]) > 0.0
        assert stress(-g, stabilising(fabric.law, -g)[1]) < 0.0
    assert stress(1e-3, shear_tangent_slope(fabric.law, 1e-3)) < 0.0  # as it was


@pytest.mark.parametrize("c2", [2.4528, 1.5])
def test_thickening_has_no_slope_or_curvature(c2):
    law = md600(f"compaction.c2 = {c2}").law
    for E33 in (0.0, 1e-6, 0.2):
        assert compaction_tangent_curvature(law, E33) == 0.0
        assert abs(compaction_tangent_slope(law, E33)) < 1e-4 * C0


def test_energy_is_the_work_of_the_stress():
    """Along a straight path from the undeformed state, by quadrature over each smooth part."""
    fabric = md600()
    points, weights = np.polynomial.legendre.leggauss(60)
    along, weights = 0.5 * (1.0 + points), 0.5 * weights
    for E in random_strains(50, seed=1):
        stress = fabric.stress_and_tangent(along[:, None] * E)[0]
        np.testing.assert_allclose(fabric.membrane_energy(E), weights @ (stress @ E), rtol=1e-10)
    np.testing.assert_array_equal(fabric.membrane_energy(np.zeros(6)), 0.0)


def test_compiled_law_agrees_with_numpy():
    fabric = md600()
    extremes = [strain(E33=e33, E12=e12) for e33 in (-0.48, 0.0, 2.0) for e12 in (-0.5, 0.0, 0.5)]
    for E in [*random_strains(300, seed=2), *extremes]:
        expected, tangent = fabric.stress_and_tangent(E)
        S, C = membrane_response(fabric.law, tuple(E), ())
        np.testing.assert_allclose(S, expected, rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(C, np.diag(tangent), rtol=1e-13)


# --- elementary functions -------------------------------------------------------------------------


@given(st.floats(-690.0, 690.0))
def test_exponential(x):
    assert exponential(x) == pytest.approx(math.exp(x), rel=5e-16, abs=0.0)


@given(st.floats(1e-300, 1e300))
def test_logarithm(x):
    assert logarithm(x) == pytest.approx(math.log(x), rel=5e-16, abs=1e-18)


def test_logarithm_near_one_keeps_its_digits():
    for x in np.concatenate([1.0 + np.logspace(-15, -1, 50), 1.0 - np.logspace(-15, -1, 50)]):
        assert logarithm(x) == pytest.approx(math.log(x), rel=5e-16)
    assert logarithm(1.0) == 0.0 and exponential(0.0) == 1.0


# --- St. Venant-Kirchhoff -------------------------------------------------------------------------


def test_isotropic_stiffness_answers_to_uniaxial_stress():
    """Stretch E/E, contraction -ν, no shear; G = E/2(1+ν); bulk modulus E/3(1-2ν)."""
    young, nu = 70e9, 0.3
    C = isotropic_stiffness(young, nu)
    contraction = np.array([1.0, -nu, -nu, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(C @ contraction, [young, 0, 0, 0, 0, 0], atol=1e-4)
    np.testing.assert_allclose(C @ np.eye(6)[4], young / 2 / (1 + nu) * np.eye(6)[4])
    volume = C @ [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(volume[:3], young / (1 - 2 * nu))
    np.testing.assert_allclose(C, isotropic_stiffness(young, nu).T)


def test_orthotropic_stiffness_answers_to_uniaxial_stress():
    """A stress along i stretches by 1/E_i and contracts j by ν_ij/E_i; ν_ji = ν_ij E_j/E_i."""
    E1, E2, E3, nu12, nu13, nu23 = 60e9, 20e9, 10e9, 0.25, 0.3, 0.35
    C = orthotropic_stiffness(E1, E2, E3, nu12, nu13, nu23, 5e9, 4e9, 3e9)
    compliance = np.linalg.inv(C)
    np.testing.assert_allclose(compliance[:3, 0], [1 / E1, -nu12 / E1, -nu13 / E1], rtol=1e-12)
    np.testing.assert_allclose(compliance[:3, 1], [-nu12 / E1, 1 / E2, -nu23 / E2], rtol=1e-12)
    np.testing.assert_allclose(compliance[:3, 2], [-nu13 / E1, -nu23 / E2, 1 / E3], rtol=1e-12)
    # Voigt order 12, 23, 13
    np.testing.assert_allclose(np.diag(C)[3:], [5e9, 3e9, 4e9])
    assert (np.linalg.eigvalsh(C) > 0.0).all()


def test_orthotropic_becomes_isotropic():
    G = 70e9 / 2.6
    C = orthotropic_stiffness(70e9, 70e9, 70e9, 0.3, 0.3, 0.3, G, G, G)
    np.testing.assert_allclose(C, isotropic_stiffness(70e9, 0.3), rtol=1e-12, atol=1e-2)


def test_st_venant_kirchhoff_is_linear_with_its_energy():
    C = isotropic_stiffness(70e9, 0.3)
    material = StVenantKirchhoff(C, 0.1 * C, thickness=1e-3, density=2700.0)
    E = random_strains(20)
    S, tangent = material.stress_and_tangent(E)
    np.testing.assert_allclose(S, E @ C.T)
    np.testing.assert_array_equal(tangent, np.broadcast_to(C, (20, 6, 6)))
    np.testing.assert_allclose(material.membrane_energy(E), 0.5 * np.sum(S * E, axis=1))
    np.testing.assert_array_equal(material.bending_matrix(), 0.1 * C)
    assert material.areal_mass == pytest.approx(2.7)
    stretch = 0.9
    expected = stretch * C[2, 2] * 0.5 * (1.0 - stretch**2)
    assert material.compaction_pressure(stretch) == pytest.approx(expected)
    assert material.compaction_pressure(1.1) == 0.0


def uncoupled_and_coupled():
    """Matrices that couple the normal strains alone, and what each other coupling makes of one."""
    rng = np.random.default_rng(5)
    A, B = rng.normal(size=(2, 3, 3))
    membrane, bending = np.diag(np.arange(3.0, 9.0)), np.diag(np.arange(9.0, 3.0, -1.0))
    membrane[:3, :3] += A @ A.T
    bending[:3, :3] += B @ B.T
    yield membrane, bending, OrthotropicLaw
    for i in range(6):
        for j in range(max(i + 1, 3), 6):
            coupled = bending.copy()
            coupled[i, j] = coupled[j, i] = 0.1
            yield membrane, coupled, StiffnessLaw
            yield coupled, membrane, StiffnessLaw
    unsymmetric = bending.copy()
    unsymmetric[0, 1] += 0.1
    yield membrane, unsymmetric, StiffnessLaw


def test_a_stiffness_has_the_law_of_its_couplings():
    E = np.array([0.02, -0.01, 0.3, 0.4, -0.2, 0.1])
    found = set()
    for membrane, bending, law in uncoupled_and_coupled():
        material = StVenantKirchhoff(membrane, bending, thickness=1e-3, density=1.0)
        assert type(material.law) is law
        found.add(law)
        S, tangent = membrane_response(material.law, tuple(E), ())
        np.testing.assert_allclose(S, membrane @ E, rtol=1e-14)
        np.testing.assert_allclose(product(tangent, tuple(E)), membrane @ E, rtol=1e-14)
        C_B = bending_stiffness(material.law)
        np.testing.assert_allclose(product(C_B, tuple(E)), bending @ E, rtol=1e-14)
        if law is OrthotropicLaw:
            np.testing.assert_array_equal(orthotropic_rows(tangent), membrane)
            np.testing.assert_array_equal(orthotropic_rows(C_B), bending)
    assert found == {OrthotropicLaw, StiffnessLaw}
