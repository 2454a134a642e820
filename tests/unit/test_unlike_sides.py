"""Shear that is not alike to both sides: the law alone, in a scene, in elements and in a coupon."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain.coupons.bias_extension import fibre_angle_of
from lcmchain.dispatch import is_implemented
from lcmchain.elements.family import shear_may_stiffen
from lcmchain.errors import InputError
from lcmchain.materials.fabric import FabricLaw
from lcmchain.materials.features.shear import with_side
from lcmchain.materials.law import (
    hourglass_tangent,
    membrane_response,
    plane_response,
    remembered,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.materials.shear_waves import shear_energy, shear_wave_speeds
from lcmchain.mesh.sheet_mesh import shear_angles
from lcmchain.scene import scene_from_text

SCENE = """
title = "material"
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
{}
"""
OTHER = (0.6e6, -3e6, 16e6, -40e6, 42e6)  # [Pa]
SIDES = 'membrane.shear_polynomial_negative = "0.6 -3 16 -40 42 MPa"'
LOCKING = 'membrane.locking_angle = "50 deg"\nmembrane.locking_stiffness = "80 MPa"'
FRICTION = 'membrane.friction = { stress = "2 kPa", angle = "2 deg", growth = 0.2 }'
# on both sides, within the width of the rounded strain and beyond it
STRAINS = [sign * g for g in (1e-6, 0.02, 0.05, 0.087, 0.0873, 0.3, 0.8, 1.1) for sign in (1, -1)]


def fabric(*entries):
    return scene_from_text(SCENE.format("\n".join(entries))).material.build()


def swapped():
    """The fabric with its sides exchanged, as if it were turned by 90 degrees."""
    own = scene_from_text(SCENE.format("")).material.membrane.shear_polynomial
    texts = (" ".join(f"{1e-6 * s:.17g}" for s in sides) for sides in (OTHER, own))
    names = ("shear_polynomial", "shear_polynomial_negative")
    return fabric(*(f'membrane.{n} = "{t} MPa"' for n, t in zip(names, texts, strict=True)))


def voigt(shear):
    E = np.zeros((np.size(shear), 6))
    E[:, 3] = shear
    return E


def test_each_side_has_its_polynomial():
    """Eq. (21) with the coefficients of the side, to the digit that the difference keeps."""
    plain, sides = fabric(), fabric(SIDES)
    g = np.linspace(0.0, 1.0, 21)
    for one, other in zip(
        plain.stress_and_tangent(voigt(g)), sides.stress_and_tangent(voigt(g)), strict=True
    ):
        np.testing.assert_array_equal(one, other)
    e = 0.5 * g
    modulus = sum(s * e**k for k, s in enumerate(OTHER))
    tangent = sum((k + 1) * s * e**k for k, s in enumerate(OTHER))
    S, C = sides.stress_and_tangent(voigt(-g))
    np.testing.assert_allclose(S[:, 3], -modulus * g, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(C[1:, 3, 3], tangent[1:], rtol=1e-12)


@pytest.mark.parametrize("g", STRAINS)
def test_turned_by_a_right_angle_its_sides_are_exchanged(g):
    """Response, energy and stabilising tangent of one at g are those of the other at -g."""
    one, other = fabric(SIDES), swapped()
    E = -0.1, g
    S, C = membrane_response(one.law, (0.0, 0.0, E[0], E[1], 0.0, 0.0), ())
    S_other, C_other = membrane_response(other.law, (0.0, 0.0, E[0], -E[1], 0.0, 0.0), ())
    assert S[3] == pytest.approx(-S_other[3], rel=1e-11)
    assert C[3] == pytest.approx(C_other[3], rel=1e-11)
    energies = one.membrane_energy(voigt(g))[0], other.membrane_energy(voigt(-g))[0]
    assert energies[0] == pytest.approx(energies[1], rel=1e-11)
    for k, sense in enumerate((1.0, -1.0, 1.0)):
        found = [m.stabilising_tangent(voigt(s))[k] for m, s in ((one, g), (other, -g))]
        value, mirrored = (f[0, 3, 3] if k == 0 else f[0, 3] for f in found)
        assert value == pytest.approx(sense * mirrored, rel=1e-9), k


@pytest.mark.parametrize("entries", [(SIDES,), (SIDES, LOCKING)])
@pytest.mark.parametrize("g", STRAINS)
def test_the_compiled_law_agrees_with_numpy(entries, g):
    material = fabric(*entries)
    stress, tangent = material.stress_and_tangent(voigt(g))
    E = tuple(voigt(g)[0])
    S, C = membrane_response(material.law, E, ())
    assert (S[3], C[3]) == pytest.approx((stress[0, 3], tangent[0, 3, 3]), rel=1e-12)
    flat, flat_tangent = plane_response(material.law, 0.0, 0.0, g)
    assert (flat[2], flat_tangent[2]) == pytest.approx((S[3], C[3]), rel=1e-13)
    C_stab, slope, curvature = material.stabilising_tangent(voigt(g))
    compiled = (
        hourglass_tangent(material.law, E, C, ())[3],
        tangent_slope(material.law, E, ())[3],
        tangent_curvature(material.law, E, ())[3],
    )
    plain = C_stab[0, 3, 3], slope[0, 3], curvature[0, 3]
    assert compiled == pytest.approx(plain, rel=1e-11)


@pytest.mark.parametrize("g", [g for g in STRAINS if 1e-3 < abs(g) and abs(abs(g) - 0.0872) > 1e-3])
def test_stress_and_tangents_are_derivatives(g):
    """Of the energy and the stress; of the stabilising tangent and its slope."""
    material, h = fabric(SIDES), 1e-4

    def derivative(function):
        near, far = (function(g + k * h) - function(g - k * h) for k in (1, 2))
        return (8 * near - far) / (12 * h)

    stress = lambda x: material.stress_and_tangent(voigt(x))[0][0, 3]  # noqa: E731
    stabilising = lambda x: material.stabilising_tangent(voigt(x))  # noqa: E731
    S, C = material.stress_and_tangent(voigt(g))
    assert derivative(lambda x: material.membrane_energy(voigt(x))[0]) == pytest.approx(
        S[0, 3], rel=1e-6
    )
    assert derivative(stress) == pytest.approx(C[0, 3, 3], rel=1e-6)
    _, slope, curvature = stabilising(g)
    assert derivative(lambda x: stabilising(x)[0][0, 3, 3]) == pytest.approx(slope[0, 3], rel=1e-5)
    assert derivative(lambda x: stabilising(x)[1][0, 3]) == pytest.approx(curvature[0, 3], rel=1e-5)


def test_the_stabilising_tangent_lies_between_both_sides_and_does_not_jump():
    g = np.linspace(-0.2, 0.2, 4001)
    C, slope, curvature = fabric(SIDES).stabilising_tangent(voigt(g))
    of_sides = [m.stabilising_tangent(voigt(np.abs(g)))[0][:, 3, 3] for m in (fabric(), swapped())]
    assert (C[:, 3, 3] > np.minimum(*of_sides) - 1e-6).all()
    assert (C[:, 3, 3] < np.maximum(*of_sides) + 1e-6).all()
    for values in (C[:, 3, 3], slope[:, 3], curvature[:, 3]):
        assert np.abs(np.diff(values)).max() < 0.02 * np.ptp(values)


def test_a_law_of_like_sides_holds_nothing_of_it():
    assert type(fabric().law) is FabricLaw
    assert not is_implemented(with_side, FabricLaw)
    assert fabric(SIDES).law[: len(FabricLaw._fields)] == fabric().law


def test_the_shear_convention_holds_for_both_sides():
    tensor = fabric(SIDES, 'membrane.shear_convention = "tensor"').unlike_sides
    np.testing.assert_allclose(tensor, np.multiply(0.5, fabric(SIDES).unlike_sides), rtol=1e-14)


def test_it_goes_with_a_permanent_set_and_with_friction():
    entries = (SIDES, FRICTION, 'law = "fabric-with-set"', "compaction.permanent_set = 0.3")
    law = fabric(*entries).law
    assert [r.name for r in remembered(law)][0] == "largest_compaction_strain"
    E = (0.0, 0.0, -0.1, -0.3, 0.0, 0.0)
    history = (0.0, -0.3, 0.0, 0.0)  # rubbed there, without a moment
    found = membrane_response(law, E, history)[0][3]
    assert found == pytest.approx(membrane_response(fabric(SIDES).law, E, ())[0][3], rel=1e-13)


def test_waves_and_work_are_those_of_the_softer_side():
    plain, sides, other = fabric(), fabric(SIDES), swapped()
    assert shear_wave_speeds(sides) == pytest.approx(shear_wave_speeds(other), rel=1e-12)
    assert shear_wave_speeds(sides)[0] == pytest.approx(shear_wave_speeds(plain)[0], rel=1e-12)
    angle = math.radians(20.0)
    assert shear_energy(sides, angle) == pytest.approx(shear_energy(other, angle), rel=1e-12)
    assert shear_energy(sides, angle) == pytest.approx(shear_energy(plain, angle), rel=1e-12)


def test_coupons_shear_to_the_positive_side():
    """A strip that is pulled along x, as the frame that brings fibres 1 and 2 together."""
    scene = scene_from_text(SCENE.format(SIDES))
    angle = fibre_angle_of(scene.material)
    turned = f'edge_length = "5 mm", fibre_angle = "{math.degrees(angle)} deg"'
    text = SCENE.format(SIDES).replace('edge_length = "5 mm"', turned)
    (ply,) = scene_from_text(text).stack
    sheet = ply.build_blank()
    pulled = sheet.node_positions * (1.1, 0.9, 1.0)
    expected = math.radians(90.0) - 2.0 * math.atan(0.9 / 1.1)
    np.testing.assert_allclose(shear_angles(sheet, pulled), expected, rtol=1e-9)
    assert fibre_angle_of(scene_from_text(SCENE.format("")).material) == -angle


def test_a_stiffer_negative_side_shortens_the_step():
    """A sheet that locks is followed closely where either side comes near the bound."""
    condition = SimpleNamespace(area_stretch=np.array([math.cos(math.radians(40.0))]))
    stiff = 'membrane.shear_polynomial_negative = "500 0 0 0 0 MPa"'

    def followed(*entries):
        material = fabric(LOCKING, *entries)
        body = SimpleNamespace(material=material, least_mass_factor=1.0, shortest_length=5e-3)
        wave = 4.0 * material.law.C11 / (material.density * 5e-3**2)  # along the fibres
        return shear_may_stiffen(body, condition, wave)

    assert followed(stiff) and not followed()


def test_a_falling_stress_is_refused_by_its_side():
    with pytest.raises(InputError, match="falling shear stress") as caught:
        fabric('membrane.shear_polynomial_negative = "0.2 -3 0 0 0 MPa"')
    assert caught.value.key == "material.membrane.shear_polynomial_negative"
