"""Shear-compaction coupling: its potential, its limits, and the compiled law."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lcmchain.materials.law import (
    membrane_response,
    tangent_coupling,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.scene import scene_from_text

SCENE = """
title = "material"
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
{}
"""
LAWS = {
    "plain": "",
    "locks": 'membrane.locking_angle = "30 deg"\nmembrane.locking_stiffness = "80 MPa"',
    "linear": "compaction.c1 = 0.0",
    "set": 'law = "fabric-with-set"\ncompaction.permanent_set = 0.4',
}
HISTORY = {"set": (-0.3,)}
# compressed, free, thickened; sheared little and much, of either sign
STRAINS = [(e, g) for e in (-0.25, -0.05, 0.0, 0.4) for g in (0.0, 0.3, -0.6, 0.8)]


def fabric(beta, entries=""):
    return scene_from_text(
        SCENE.format(f"compaction.shear_coupling = {beta}\n" + entries)
    ).material.build()


def voigt(E33, g):
    E = np.zeros((np.size(g), 6))
    E[:, 2], E[:, 3] = E33, g
    return E


def numbers(*values):
    return [0.0 if value is None else float(value) for value in values]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("beta", [0.5, 1.0, 1.7])
def test_the_compiled_law_agrees_with_numpy(beta, name):
    material = fabric(beta, LAWS[name])
    # NumPy answers for first loading: the compiled law has a memory of it
    for E33, g in STRAINS:
        E = voigt(E33, g)
        past = (0.0,) if name == "set" else ()
        S, C = membrane_response(material.law, tuple(E[0]), past)
        stress, tangent = material.stress_and_tangent(E)
        scale = 1e5
        assert np.allclose(S, stress[0], rtol=1e-11, atol=1e-11 * scale)
        assert np.allclose(C, np.diag(tangent[0]), rtol=1e-11, atol=1e-11 * scale)
        _, slope, curvature = material.stabilising_tangent(E)
        c36, *mixed = tangent_coupling(material.law, tuple(E[0]), past)
        assert c36 == pytest.approx(tangent[0, 2, 3], rel=1e-10, abs=1e-6)
        if name == "set":
            continue  # loading goes another way than the tangent
        for ours, theirs in zip(mixed, material.tangent_coupling(E), strict=True):
            assert ours == pytest.approx(float(theirs[0]), rel=1e-9, abs=1e-3)
        found = numbers(*tangent_slope(material.law, tuple(E[0]), past))
        assert np.allclose(found, slope[0], rtol=1e-9, atol=1e-3)
        found = numbers(*tangent_curvature(material.law, tuple(E[0]), past))
        assert np.allclose(found, curvature[0], rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize("beta", [0.5, 1.0, 1.7])
def test_stress_and_tangent_follow_from_the_energy(beta):
    """By central differences of order four, of energy, stress and stabilising tangent."""
    material = fabric(beta)
    h = 1e-4

    def slope_of(function, E33, g, along):
        def at(step):
            return function(E33 + step * (along == 2), g + step * (along == 3))

        return (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h)

    def energy(E33, g):
        return float(material.membrane_energy(voigt(E33, g))[0])

    def stress(component):
        return lambda E33, g: float(material.stress_and_tangent(voigt(E33, g))[0][0, component])

    def stiffness(E33, g):
        return float(material.stabilising_tangent(voigt(E33, g))[0][0, 2, 2])

    def coupling(k):
        return lambda E33, g: float(material.tangent_coupling(voigt(E33, g))[k][0])

    for E33, g in [(-0.25, 0.3), (-0.2, -0.6), (-0.05, 0.75), (0.4, 0.2)]:
        S, C = (values[0] for values in material.stress_and_tangent(voigt(E33, g)))
        slope = material.stabilising_tangent(voigt(E33, g))[1][0]
        for component in (2, 3):
            assert slope_of(energy, E33, g, component) == pytest.approx(S[component], rel=1e-7)
            for other in (2, 3):
                found = slope_of(stress(component), E33, g, other)
                assert found == pytest.approx(C[component, other], rel=1e-7)
        assert slope_of(stiffness, E33, g, 2) == pytest.approx(slope[2], rel=1e-6)
        assert slope_of(stiffness, E33, g, 3) == pytest.approx(coupling(0)(E33, g), rel=1e-6)
        assert slope_of(coupling(0), E33, g, 2) == pytest.approx(coupling(1)(E33, g), rel=1e-6)
        assert slope_of(coupling(0), E33, g, 3) == pytest.approx(coupling(2)(E33, g), rel=1e-6)


def test_a_closed_loop_of_thickness_and_shear_does_no_work():
    """A circle in the plane of thickness stretch and shear, by the trapezoidal rule."""
    material = fabric(0.8)
    phase = np.linspace(0.0, 2.0 * np.pi, 2001)
    stretch, g = 0.8 + 0.15 * np.cos(phase), 0.4 + 0.3 * np.sin(phase)
    E33 = 0.5 * (stretch**2 - 1.0)
    S = material.stress_and_tangent(voigt(E33, g))[0]
    dE33, dg = -stretch * 0.15 * np.sin(phase), 0.3 * np.cos(phase)
    power = S[:, 2] * dE33 + S[:, 3] * dg
    work = np.trapezoid(power, phase)
    assert abs(work) < 1e-10 * np.trapezoid(np.abs(power), phase)


@pytest.mark.parametrize("degrees", [0.0, 15.0, 30.0, 45.0])
def test_the_limits_of_the_coupling(degrees):
    """β = 1: no pressure at 1/cos γ, the law at one fibre volume fraction on the present area."""
    g, cos = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    plain, one, half = fabric(0.0), fabric(1.0), fabric(0.5)
    free = voigt(0.5 * (cos**-2 - 1.0), g)
    shear = plain.stress_and_tangent(voigt(0.0, g))[0][0, 3]
    S = one.stress_and_tangent(free)[0][0]
    assert abs(S[2]) < 1e-9 * 1e5 and S[3] == pytest.approx(shear, rel=1e-9)
    for stretch in (0.7, 0.9):
        law = plain.compaction_pressure(stretch * cos)
        assert one.compaction_pressure(stretch, None, g) / cos == pytest.approx(law, rel=1e-12)
        law = plain.compaction_pressure(stretch * math.sqrt(cos))
        found = half.compaction_pressure(stretch, None, g) / math.sqrt(cos)
        assert found == pytest.approx(law, rel=1e-12)
        stress = one.stress_and_tangent(voigt(0.5 * (stretch**2 - 1.0), g))[0][0]
        assert -stretch * stress[2] == pytest.approx(
            one.compaction_pressure(stretch, None, g), rel=1e-10
        )
        assert stress[3] >= shear  # what presses resists the shear
