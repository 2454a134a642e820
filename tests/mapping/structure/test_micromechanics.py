"""Stiffness of plies: limits, bounds, and an independent mean-field computation."""

import numpy as np
import pytest

from lcmchain.mapping.structure.stiffness import (
    MODELS,
    chamis,
    halpin_tsai,
    mori_tanaka,
    ply_stiffness,
)
from lcmchain.scene.presets import FIBRES, RESINS
from lcmchain.scene.structure import Fibre, Resin

CARBON, EPOXY = Fibre(preset="T300"), Resin(preset="MY750")
V = np.array([0.2, 0.45, 0.6])


def isotropic(E, nu):
    """Stiffness in the order 11, 22, 33, 12, 13, 23."""
    return ply_stiffness_of(E, E, 0.5 * E / (1 + nu), nu, nu)


def ply_stiffness_of(E1, E2, G12, nu12, nu23):
    S = np.zeros((6, 6))
    S[0, 0], S[1, 1], S[2, 2] = 1 / E1, 1 / E2, 1 / E2
    S[0, 1] = S[1, 0] = S[0, 2] = S[2, 0] = -nu12 / E1
    S[1, 2] = S[2, 1] = -nu23 / E2
    S[3, 3] = S[4, 4] = 1 / G12
    S[5, 5] = 2 * (1 + nu23) / E2
    return np.linalg.inv(S)


@pytest.mark.parametrize("name", MODELS)
def test_without_fibres_it_is_the_resin_and_without_resin_the_fibre(name):
    none, all_ = (MODELS[name](CARBON, EPOXY, np.array([v])) for v in (0.0, 1.0))
    np.testing.assert_allclose(ply_stiffness(none)[0], isotropic(EPOXY.E, EPOXY.nu), rtol=1e-12)
    of_fibre = ply_stiffness_of(CARBON.E1, CARBON.E2, CARBON.G12, CARBON.nu12, CARBON.nu23)
    np.testing.assert_allclose(ply_stiffness(all_)[0], of_fibre, rtol=1e-12)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("fibre", FIBRES)
@pytest.mark.parametrize("resin", RESINS)
def test_every_preset_gives_a_stable_ply_between_resin_and_fibre(name, fibre, resin):
    fibre, resin = Fibre(preset=fibre), Resin(preset=resin)
    ply = MODELS[name](fibre, resin, np.linspace(0.05, 0.75, 15))
    assert np.linalg.eigvalsh(ply_stiffness(ply)).min() > 0.0
    for values, low, high in (
        (ply.E1, resin.E, fibre.E1),
        (ply.E2, resin.E, fibre.across),
        (ply.G12, resin.shear, fibre.shear),
    ):
        assert np.all(np.diff(values) > 0.0) and low < values[0] and values[-1] < high


def test_mori_tanaka_equals_the_mean_field_with_the_tensor_of_a_cylinder():
    """Against the scheme itself: C = Cm + v (Cf - Cm) A, A the strain in an Eshelby cylinder."""
    Cm = isotropic(EPOXY.E, EPOXY.nu)
    Cf = ply_stiffness_of(CARBON.E1, CARBON.E2, CARBON.G12, CARBON.nu12, CARBON.nu23)
    nu = EPOXY.nu
    # Eshelby's tensor of a circular cylinder along 1 (Mura, Micromechanics of Defects in Solids,
    # eq. 11.22), for engineering shear strains.
    S = np.zeros((6, 6))
    S[1, 1] = S[2, 2] = (5 - 4 * nu) / (8 * (1 - nu))
    S[1, 2] = S[2, 1] = (4 * nu - 1) / (8 * (1 - nu))
    S[1, 0] = S[2, 0] = nu / (2 * (1 - nu))
    S[3, 3] = S[4, 4] = 0.5
    S[5, 5] = (3 - 4 * nu) / (4 * (1 - nu))
    dilute = np.linalg.inv(np.eye(6) + S @ np.linalg.solve(Cm, Cf - Cm))
    for v in V:
        A = dilute @ np.linalg.inv((1 - v) * np.eye(6) + v * dilute)
        expected = Cm + v * (Cf - Cm) @ A
        found = ply_stiffness(mori_tanaka(CARBON, EPOXY, np.array([v])))[0]
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-3)


def test_moduli_across_the_fibre_are_those_of_the_sources():
    """Worked by hand from the printed equations, v = 0.6."""
    ply = chamis(CARBON, EPOXY, np.array([0.6]))
    assert ply.E2[0] == pytest.approx(3.35e9 / (1 - 0.774597 * (1 - 3.35 / 15)), rel=1e-6)
    efficiency = (15 / 3.35 - 1) / (15 / 3.35 + 2)
    ply = halpin_tsai(CARBON, EPOXY, np.array([0.6]))
    expected = 3.35e9 * (1 + 1.2 * efficiency) / (1 - 0.6 * efficiency)
    assert ply.E2[0] == pytest.approx(expected, rel=1e-12)
    assert ply.E1[0] == pytest.approx(0.6 * 230e9 + 0.4 * 3.35e9, rel=1e-12)
    assert MODELS["rule_of_mixtures"](CARBON, EPOXY, np.array([0.6])).E2[0] == pytest.approx(
        1 / (0.6 / 15e9 + 0.4 / 3.35e9), rel=1e-12
    )
