"""Off-axis tension: the even state against the modulus of a lamina, and simulated strips."""

from __future__ import annotations

import math

import numpy as np
import pytest
from of_families import like_md600, triaxial, unidirectional

from lcmchain.coupons.analytic.off_axis import affine_tension, axes_turned, lines_of
from lcmchain.coupons.off_axis import OffAxisTest, off_axis
from lcmchain.errors import InputError
from lcmchain.identification.synthetic import preset_fabric
from lcmchain.scene import FabricMaterial, scene_from_text
from lcmchain.scene.presets import PRESETS
from lcmchain.study import Variant, read_source
from lcmchain.study.runs import make_run

ANGLES = (30.0, 45.0, 60.0)
SMALL = {"length": 0.08, "width": 0.03, "displacement": 0.006, "edge_length": 0.01}


def radians(degrees):
    return math.radians(degrees)


@pytest.mark.parametrize("degrees", ANGLES)
def test_small_strains_have_the_modulus_of_a_lamina(degrees):
    """1/E = c⁴/E1 + s⁴/E2 + c² s²/G and the tilt -S16/S11 of the compliance, without Poisson."""
    own, angle = unidirectional().build(), radians(degrees)
    c, s = math.cos(angle), math.sin(angle)
    E1, E2, G = 1000e6, 2e6, 0.2e6
    compliance = c**4 / E1 + s**4 / E2 + c**2 * s**2 / G
    state = affine_tension(own, angle, [1.0 + 1e-7])
    assert state.stress[0] / 1e-7 == pytest.approx(1.0 / compliance, rel=1e-5)
    tilt = 2.0 * c * s * (c**2 / E1 - s**2 / E2) - c * s * (c**2 - s**2) / G
    assert state.tilt[0] / 1e-7 == pytest.approx(tilt / compliance, rel=1e-5)


@pytest.mark.parametrize("degrees", ANGLES)
def test_nothing_acts_on_the_sides_of_the_even_state(degrees):
    own, angle = unidirectional(20.0).build(), radians(degrees)
    turn = angle - lines_of(own)[0]
    state = affine_tension(own, turn, [1.02, 1.1])
    F = state.gradient()
    E = np.zeros((2, 6))
    C = F.transpose(0, 2, 1) @ F
    E[:, 0], E[:, 1], E[:, 3] = 0.5 * (C[:, 0, 0] - 1), 0.5 * (C[:, 1, 1] - 1), C[:, 0, 1]
    T = axes_turned(turn)
    S = own.stress_and_tangent(E @ T.T)[0] @ T
    np.testing.assert_allclose(S[:, [1, 2, 3]], 0.0, atol=1e-3)
    np.testing.assert_allclose(S[:, 0], state.stress, rtol=1e-9)
    # the angle between the fibres and the line across, from both carried lines
    lines = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    a, b = np.einsum("tij,lj->lti", F, lines)
    cosine = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    found = state.shear_angle(angle, lines_of(own)[1])
    np.testing.assert_allclose(found, 0.5 * math.pi - np.arccos(cosine), rtol=1e-9)


def test_three_equal_families_pull_alike_in_all_directions():
    """Their apparent modulus is one number for small strains."""
    own = triaxial().build()
    found = [affine_tension(own, radians(a), [1.0 + 1e-7]).stress[0] for a in (0.0, 17.0, 45.0)]
    np.testing.assert_allclose(found, found[0], rtol=1e-6)


def test_the_fabric_and_two_families_at_a_right_angle_pull_alike():
    stretch = [1.01, 1.05]
    ours = affine_tension(like_md600().build(), radians(40.0), stretch)
    theirs = affine_tension(preset_fabric(), radians(40.0), stretch)
    np.testing.assert_allclose(ours.stress, theirs.stress, rtol=1e-9)


def assert_within_a_percent(material, degrees):
    result = off_axis(material, angle=radians(degrees), **SMALL)
    assert len(result.comparisons) == 4
    for found in result.comparisons:
        assert abs(found.relative) < 0.01, found
    assert abs(result.figures["balance_error_to_internal"]) < 1e-3


def test_clamps_tilt_as_the_ends_of_the_even_state_do():
    """x = λ X + k Y on both ends, free across; nothing at the start."""
    scene = scene_from_text(
        OffAxisTest().text,
        overrides=("blank.fibre_angle=30 deg", 'blank.size=["80 mm", "30 mm"]'),
    )
    blank = scene.stack[0].build_blank()
    left, right = OffAxisTest(0.006).supports(scene)(blank)
    assert left.components == right.components == "x" and len(left.nodes) == len(right.nodes) > 4
    np.testing.assert_allclose(np.abs(blank.node_positions[right.nodes, 0]), 0.04)
    state = affine_tension(preset_fabric(), radians(30.0), [1.075])
    for clamp in (left, right):
        np.testing.assert_allclose(clamp.motion(0.0), np.eye(3, 4), atol=1e-12)
        ends = clamp.motion(scene.process.time)
        np.testing.assert_allclose(ends[0], [1.075, state.tilt[0], 0.0, 0.0], rtol=1e-9)
    assert abs(state.tilt[0]) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [30.0, 45.0])
def test_a_woven_strip_follows_the_even_state(degrees):
    material = FabricMaterial.model_validate(PRESETS["MD600"])
    assert_within_a_percent(material, degrees)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("build", [unidirectional, like_md600, triaxial])
def test_strips_of_families_follow_the_even_state(build, degrees):
    assert_within_a_percent(build(), degrees)


def test_angles_along_the_pull_and_solids_are_refused():
    with pytest.raises(InputError, match="more than 0 and less than 90 deg"):
        off_axis(unidirectional(), angle=0.0)
    from lcmchain.materials.st_venant_kirchhoff import IsotropicMaterial

    steel = IsotropicMaterial(thickness=1e-3, density=7800.0, young_modulus=1e6, poisson_ratio=0.0)
    with pytest.raises(InputError, match="has no fibres"):
        off_axis(steel)


@pytest.mark.slow
def test_a_study_pulls_the_strip_of_the_coupon():
    """Read by name, at 45 degrees and another length; the force is that of the coupon."""
    size = ("coupon.displacement=5 mm", "blank.edge_length=10 mm", 'blank.size=["80 mm", "30 mm"]')
    source = read_source("off-axis", size)
    outcome = make_run(source, Variant("as it is", "x"), 1)
    result = off_axis(source.scene().material, **(SMALL | {"displacement": 0.005}))
    force = result.curves["force [N]"].max()
    assert outcome.numbers["clamp_force_max_N"] == pytest.approx(force, rel=1e-9)
