"""The locking branch of the shear law, alone, in a scene, and in the solver."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lcmchain.dispatch import is_implemented
from lcmchain.effects.supports import Support
from lcmchain.elements import family
from lcmchain.errors import InputError
from lcmchain.materials.fabric import FabricLaw, LockingFabricLaw
from lcmchain.materials.fabric_with_set import LockingFabricWithSetLaw
from lcmchain.materials.features.shear import (
    locking_response,
    shear_tangent_curvature,
    shear_tangent_slope,
)
from lcmchain.materials.law import membrane_response, plane_response, remembered
from lcmchain.scene import scene_from_text
from lcmchain.verification.hard_cases.sheets import simulation

ANGLE, STIFFNESS = math.radians(50.0), 80e6
SCENE = """
title = "material"
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
{}
"""
LOCKING = 'membrane.locking_angle = "50 deg"\nmembrane.locking_stiffness = "80 MPa"'
# on both sides of the angle from which on it locks, of either sign, and beyond 90 degrees
STRAINS = [sign * g for g in (0.0, 0.3, 0.76, 0.7662, 0.8, 0.95, 1.0, 1.1) for sign in (1, -1)]


def fabric(entries=LOCKING):
    return scene_from_text(SCENE.format(entries)).material.build()


def voigt(shear):
    E = np.zeros((np.size(shear), 6))
    E[:, 3] = shear
    return E


@pytest.mark.parametrize("degrees", [55.0, 70.0, 85.0, -70.0])
def test_the_added_stress_is_the_closed_form(degrees):
    """C_L (1 - sin γ_L) s³/3 with s = (sin γ - sin γ_L)/(1 - sin γ_L), tangent C_L s²."""
    g = math.sin(math.radians(degrees))
    part = (abs(g) - math.sin(ANGLE)) / (1.0 - math.sin(ANGLE))
    plain, locked = (m.stress_and_tangent(voigt(g)) for m in (fabric(""), fabric()))
    stress = STIFFNESS * (1.0 - math.sin(ANGLE)) * part**3 / 3.0
    assert (locked[0] - plain[0])[0, 3] == pytest.approx(math.copysign(stress, g), rel=1e-9)
    assert (locked[1] - plain[1])[0, 3, 3] == pytest.approx(STIFFNESS * part**2, rel=1e-9)


def test_up_to_the_angle_it_is_the_plain_law():
    g = np.linspace(-math.sin(ANGLE), math.sin(ANGLE), 41)
    for one, other in zip(
        fabric("").stress_and_tangent(voigt(g)), fabric().stress_and_tangent(voigt(g)), strict=True
    ):
        np.testing.assert_array_equal(one, other)
    for strain in g:
        E = (0.0, 0.0, -0.1, strain, 0.0, 0.0)
        assert membrane_response(fabric("").law, E, ()) == membrane_response(fabric().law, E, ())


@pytest.mark.parametrize("g", STRAINS)
def test_the_compiled_law_agrees_with_numpy(g):
    material = fabric()
    stress, tangent = material.stress_and_tangent(voigt(g))
    S, C = membrane_response(material.law, tuple(voigt(g)[0]), ())
    assert (S[3], C[3]) == pytest.approx((stress[0, 3], tangent[0, 3, 3]), rel=1e-13)
    S, C = plane_response(material.law, 0.0, 0.0, g)
    assert (S[2], C[2]) == pytest.approx((stress[0, 3], tangent[0, 3, 3]), rel=1e-13)
    compiled = shear_tangent_slope(material.law, g), shear_tangent_curvature(material.law, g)
    plain = material.tangent_slope(voigt(g))[0, 3], material.tangent_curvature(voigt(g))[0, 3]
    assert compiled == pytest.approx(plain, rel=1e-12)


@pytest.mark.parametrize("g", [0.3, 0.8, 0.95, 1.1, -0.8, -0.95])
def test_stress_tangent_slope_and_curvature_are_derivatives(g):
    """Of the energy, of the stress, of the tangent, of its slope; by differences of 4th order."""
    material, h = fabric(), 1e-4
    energy = material.membrane_energy
    functions = [
        lambda E: energy(E)[0],
        lambda E: material.stress_and_tangent(E)[0][0, 3],
        lambda E: material.stress_and_tangent(E)[1][0, 3, 3],
        lambda E: material.tangent_slope(E)[0, 3],
        lambda E: material.tangent_curvature(E)[0, 3],
    ]
    for function, derivative in zip(functions, functions[1:], strict=False):
        near = function(voigt(g + h)) - function(voigt(g - h))
        far = function(voigt(g + 2 * h)) - function(voigt(g - 2 * h))
        assert (8 * near - far) / (12 * h) == pytest.approx(derivative(voigt(g)), rel=1e-6)


def test_tangent_and_its_slope_do_not_jump_where_it_locks():
    material, start = fabric(), math.sin(ANGLE)
    below, above = voigt(start - 1e-9), voigt(start + 1e-9)
    for function in (lambda E: material.stress_and_tangent(E)[1][0, 3, 3],
                     lambda E: material.tangent_slope(E)[0, 3]):  # fmt: skip
        assert function(above) == pytest.approx(function(below), rel=1e-5)


def test_a_law_that_does_not_lock_holds_nothing_of_it():
    """The plain class answers with constants, which the compiler folds away."""
    assert type(fabric("").law) is FabricLaw and not fabric("").locks
    assert not is_implemented(locking_response, FabricLaw)
    assert type(fabric().law) is LockingFabricLaw and fabric().locks
    assert fabric().law[: len(FabricLaw._fields)] == fabric("").law


def test_the_stiffness_does_not_follow_the_shear_convention():
    tensor = fabric(LOCKING + '\nmembrane.shear_convention = "tensor"').law
    assert tensor[-2:] == fabric().law[-2:]
    assert tensor.s0 == 0.5 * fabric().law.s0


def test_a_fabric_with_a_permanent_set_locks_as_well():
    entries = LOCKING + '\nlaw = "fabric-with-set"\ncompaction.permanent_set = 0.3'
    law = fabric(entries).law
    assert type(law) is LockingFabricWithSetLaw
    assert [r.name for r in remembered(law)] == ["largest_compaction_strain"]
    E = (0.0, 0.0, -0.1, 0.9, 0.0, 0.0)
    plain = membrane_response(fabric().law, E, ())
    locked = membrane_response(law, E, (0.0,))
    assert locked[0] == pytest.approx(plain[0], rel=1e-13) and locked[1][3] == plain[1][3]


@pytest.mark.parametrize(
    ("entries", "key", "words"),
    [
        (LOCKING.splitlines()[0], "membrane.locking_stiffness", "together with locking_angle"),
        (LOCKING.splitlines()[1], "membrane.locking_angle", "together with locking_stiffness"),
        (LOCKING.replace("50 deg", "90 deg"), "membrane.locking_angle", "above 0 and below 90"),
        (LOCKING.replace("80 MPa", "0 MPa"), "membrane.locking_stiffness", "positive"),
    ],
)
def test_half_a_statement_is_refused(entries, key, words):
    with pytest.raises(InputError, match=words) as caught:
        fabric(entries)
    assert caught.value.key == f"material.{key}"


def test_the_preset_states_its_range_and_nothing_of_locking():
    membrane = scene_from_text(SCENE.format("")).material.membrane
    assert membrane.shear_range == pytest.approx(math.radians(60.0))
    assert membrane.locking_angle is None and membrane.locking is None


def sheared_sheet():
    """A square of 40 mm that is sheared to 65 degrees, every node as prescribed; locks at 45."""

    def motion(time):
        half = 0.5 * math.radians(65.0) * min(time / 0.02, 1.0)
        c, s = math.cos(half), math.sin(half)
        return np.array([[c, s, 0, 0], [s, c, 0, 0], [0, 0, 1.0, 0]])

    return simulation(
        """
        process = { time = "20 ms" }
        blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
        [material]
        preset = "MD600"
        membrane.locking_angle = "45 deg"
        membrane.locking_stiffness = "10000 MPa"
        """,
        supports=lambda X: [Support("all", np.arange(len(X)), motion=motion)],
    )


def steps_over_stable(sim):
    """Step of every chunk over the stable one at its end, without the safety factor."""
    found = []
    sim.advance_to(20e-3, lambda sim: found.append(sim.control.step / sim.critical_step()))
    return found


def test_the_step_follows_a_tangent_that_outgrows_the_fibres(monkeypatch):
    """At 65 degrees a locking stiffness of 10 GPa leaves less than half of the stable step."""
    sim = sheared_sheet()
    start = sim.critical_step()
    assert max(steps_over_stable(sim)) < 1.0
    assert sim.critical_step() < 0.5 * start

    monkeypatch.setattr(family, "SHEAR_SHARE", math.inf)
    assert max(steps_over_stable(sheared_sheet())) > 1.1
