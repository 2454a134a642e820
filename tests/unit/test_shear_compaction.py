"""Shear-compaction coupling: its potential, its limits, and the compiled law."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from lcmchain.coupons.compaction import compaction
from lcmchain.coupons.picture_frame import picture_frame
from lcmchain.errors import InputError
from lcmchain.identification.data import CouponData
from lcmchain.identification.from_file import identify_compaction_file
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.sheared_compaction import identify_sheared_compaction
from lcmchain.materials.law import (
    membrane_response,
    tangent_coupling,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.scene import scene_from_text

EXAMPLES = Path(__file__).parents[2] / "examples"
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


def table(beta, entries=""):
    text = SCENE.format(f"compaction.shear_coupling = {beta}\n" + entries)
    return scene_from_text(text).material


def fabric(beta, entries=""):
    return table(beta, entries).build()


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


def test_an_energy_counted_from_the_initial_thickness_would_drive_the_shear():
    """Why W is counted from the free thickness: W = t0 ∫_λ^1 p(λ' cos γ) dλ' falls with the shear.

    Its slope with γ at λ = 1/cos γ, β tan γ (λ p(λ) - p(1)) + W) with p(λ) = 0, over t0 S12 cos γ.
    """
    material, gamma = fabric(0.0), math.radians(45.0)
    cos = math.cos(gamma)
    stretch = np.linspace(1.0, 1.0 / cos, 4001)
    energy = -np.trapezoid(material.compaction_pressure(stretch * cos), stretch)
    moment = math.tan(gamma) * (energy - float(material.compaction_pressure(cos)))
    shear = material.stress_and_tangent(voigt(0.0, math.sin(gamma)))[0][0, 3] * cos
    assert moment / shear == pytest.approx(-7.27, abs=0.01)
    one = fabric(1.0)
    free = voigt(0.5 * (cos**-2 - 1.0), math.sin(gamma))
    assert one.stress_and_tangent(free)[0][0, 3] * cos == pytest.approx(shear, rel=1e-9)


# --- identification -------------------------------------------------------------------------------


def sheared_tests(beta, *, noise=0.02, wrong=0.0, seed=5):
    """Compaction of specimens at 0 to 45 degrees; ``wrong`` bends the coupling with the angle."""
    rng = np.random.default_rng(seed)
    columns = {"thickness": [], "pressure": [], "shear angle": []}
    for degrees in (0.0, 15.0, 30.0, 45.0):
        angle = math.radians(degrees)
        own = fabric(beta + wrong * degrees)
        free = math.cos(angle) ** -(beta + wrong * degrees)
        stretch = free * np.linspace(0.95, 0.62, 40)
        pressure = own.compaction_pressure(stretch, None, math.sin(angle)) / math.cos(angle)
        columns["thickness"].append(own.thickness * stretch)
        columns["pressure"].append(pressure * (1.0 + noise * rng.standard_normal(40)))
        columns["shear angle"].append(np.full(40, angle))
    values = {name: np.concatenate(parts) for name, parts in columns.items()}
    return CouponData("data.csv", values, np.arange(160) + 2, np.repeat(np.arange(4), 40))


def identified(data, **options):
    own = fabric(0.0)
    height = own.areal_mass / own.fibre_density
    return identify_sheared_compaction(
        data, thickness=own.thickness, solid_height=height, **options
    )


@pytest.mark.parametrize("beta", [0.4, 1.0])
def test_the_coupling_is_found_from_sheared_compaction(beta):
    """17 of 20 intervals or more hold the truth in 98 % of all draws if each does in 95 %."""
    covered = 0
    for seed in range(20):
        found = identified(sheared_tests(beta, seed=seed))
        coupling = found["shear_coupling"]
        covered += coupling.low < beta < coupling.high
        assert coupling.high - coupling.low < 0.02
    assert covered >= 17
    assert float(found.scene_entries["shear_coupling"]) == pytest.approx(coupling.value, rel=1e-3)
    assert not found.warnings


def test_a_coupling_that_changes_with_the_angle_is_refused():
    with pytest.raises(FitRefusedError, match="the coupling does not follow the data"):
        identified(sheared_tests(0.2, wrong=0.02))


def test_sheared_rows_alone_are_refused():
    data = sheared_tests(1.0)
    with pytest.raises(InputError, match="no rows without shear"):
        identified(data.keep(data["shear angle"] > 0.0))


def test_a_file_with_a_shear_angle_tells_the_coupling(tmp_path):
    data = sheared_tests(0.7)
    rows = zip(data.specimen, *data.columns.values(), strict=True)
    text = "specimen,thickness [mm],pressure [MPa],shear angle [deg]\n" + "".join(
        f"{s},{1e3 * t:.8g},{1e-6 * p:.8g},{math.degrees(a):.8g}\n" for s, t, p, a in rows
    )
    file = tmp_path / "sheared.csv"
    file.write_text(text, encoding="utf-8")
    found = identify_compaction_file(file, {})
    assert found["shear_coupling"].value == pytest.approx(0.7, abs=0.02)


# --- coupons --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "degrees",
    [pytest.param(own, marks=pytest.mark.slow) for own in (0.0, 15.0, 30.0)] + [45.0],
)
def test_a_sheared_piece_is_pressed_as_the_law_says(degrees):
    """0.1 % from 0.02 to 1.4 MPa on the present area, from the thickness that it takes freely."""
    sheared = {"shear_angle": math.radians(degrees)} if degrees else {}
    result = compaction(table(1.0), size=10e-3, **sheared)
    # unsheared, the measured pressures of the paper stand beside
    of_law = [own for own in result.comparisons if "experiment" not in own.origin]
    assert len(of_law) == 7
    assert max(abs(c.relative) for c in of_law) < 1e-3
    free = 1.004 / math.cos(math.radians(degrees))
    assert result.curves["thickness [mm]"][0] == pytest.approx(free, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("beta", [0.0, 1.0])
def test_a_picture_frame_thickens_without_pressure(beta):
    """1/cos^β to 1e-5 up to 60 degrees, at the shear force of the fabric without coupling."""
    result = picture_frame(table(beta), side=0.1, edge_length=10e-3)
    thickness = result.curves["thickness [mm]"]
    expected = 1.004 / np.cos(np.radians(result.curves["analytic shear angle [deg]"])) ** beta
    np.testing.assert_allclose(thickness, expected, rtol=1e-5)
    assert max(abs(c.relative) for c in result.comparisons) < 0.01


# --- a formed part --------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_hemisphere_thickens_with_the_coupling_and_fills_sooner(tmp_path):
    """The rows of the table of the manual on a coarser mesh: what β does goes one way."""
    compare = runpy.run_path(str(EXAMPLES / "shear_compaction" / "compare.py"))
    found = []
    for beta in (0.0, 1.0):
        cells = compare["row"](beta, tmp_path, 10.0).split("|")[2:8]
        found.append([float(cell.split()[-1].rstrip("°")) for cell in cells])
    plain, coupled = np.array(found)
    most, sheared, fraction, force, shear, time = range(6)
    assert coupled[most] > 1.2 * plain[most] and coupled[sheared] > 1.2 * plain[sheared]
    assert coupled[fraction] < 0.85 * plain[fraction]
    assert coupled[force] > plain[force] and abs(coupled[shear] - plain[shear]) < 3.0
    assert coupled[time] < plain[time]
