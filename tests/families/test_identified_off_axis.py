"""Moduli and shear of a unidirectional fabric from off-axis tension, against the even state."""

from __future__ import annotations

import math

import numpy as np
import pytest
from of_families import across, fabric, fibres

from lcmchain.coupons.analytic.off_axis import affine_tension
from lcmchain.errors import InputError
from lcmchain.identification.files import scene_snippet
from lcmchain.identification.from_file import identify_off_axis_file
from lcmchain.identification.off_axis import Strips, predicted
from lcmchain.identification.result import FitRefusedError
from lcmchain.scene import scene_from_text

LENGTH, WIDTH = 0.16, 0.04
ANGLES = (30.0, 45.0, 60.0)
STITCHED = {"tension": "4 MPa", "shear_polynomial": "1.5 0 4 0 0 MPa"}


def unidirectional(fibre=1e5, **of_across):
    """A fabric of one family whose fibres hardly stretch, as real ones."""
    return fabric(fibres(0.0, fibre, compression=20.0), across=across(**of_across))


def write(path, material, angles=ANGLES, *, noise=0.01, seed=1, scaled=None):
    """Write forces of the even state, which Newton's method finds from the law's own stress."""
    rng, rows = np.random.default_rng(seed), ["angle [deg],displacement [mm],force [N],specimen"]
    for number, angle in enumerate(angles):
        travel = np.linspace(0.0, 30e-3 if 0.0 < angle < 90.0 else 1e-3, 26)[1:]
        state = affine_tension(material.build(), math.radians(angle), 1.0 + travel / LENGTH)
        force = state.force(WIDTH, material.thickness) * (scaled or {}).get(angle, 1.0)
        force *= 1.0 + noise * rng.standard_normal(len(force))
        rows += [f"{angle},{1e3 * u:.9g},{f:.9g},{number}" for u, f in zip(travel, force)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def shear_stress(found, g):
    s = [found[name].value for name in ("s0", "s1", "s2", "s3", "s4") if has(found, name)]
    return np.polynomial.polynomial.polyval(0.5 * g, s) * g


def has(found, name):
    return name in {p.name for p in found.parameters}


def test_the_closed_form_is_the_even_state_and_its_derivatives_are_its_own():
    material = unidirectional(**STITCHED)
    theta = np.array([1e-11, 1.0 / 4e6, 1.5e6, 0.0, 4e6, 0.0, 0.0])
    for angle in (20.0, *ANGLES, 80.0):
        stretch = np.linspace(1.01, 1.2, 6)
        section = WIDTH * material.thickness
        strips = Strips(
            np.full(6, math.radians(angle)), stretch, np.ones(6), section, np.zeros(6, dtype=int)
        )
        force, slopes = predicted(strips, theta)
        state = affine_tension(material.build(), math.radians(angle), stretch)
        np.testing.assert_allclose(force, state.force(WIDTH, material.thickness), rtol=1e-8)
        for k, size in enumerate((1e-9, 1e-7, 1e6, 1e6, 1e6, 1e6, 1e6)):
            step = 1e-4 * min(size, abs(theta[k]) or size) * np.eye(7)[k]
            either = [predicted(strips, theta + sign * step)[0] for sign in (1.0, -1.0)]
            slope = (either[0] - either[1]) / (2.0 * step[k])
            largest = np.max(np.abs(slope))
            np.testing.assert_allclose(slopes[:, k], slope, rtol=1e-4, atol=1e-6 * largest)


def test_the_law_of_the_data_comes_back_within_its_intervals(tmp_path):
    g, counted = np.linspace(0.05, 0.4, 8), 0
    for seed in range(4):
        found = identify_off_axis_file(
            write(tmp_path / "strips.csv", unidirectional(**STITCHED), seed=seed), {}
        )
        truth = {"across": 4e6, "s0": 1.5e6}
        counted += sum(found[n].low <= v <= found[n].high for n, v in truth.items())
        assert found["across"].value == pytest.approx(4e6, rel=0.02)
        assert shear_stress(found, g) == pytest.approx((1.5e6 + 1e6 * g**2) * g, rel=0.03)
        # coefficients that the tests do not ask for are left out
        assert not has(found, "s4") and not has(found, "along")
        assert any("fibres are taken as inextensible" in told for told in found.warnings)
    assert counted >= 7  # of 8


def test_strips_along_and_across_tell_both_moduli(tmp_path):
    found = identify_off_axis_file(
        write(tmp_path / "strips.csv", unidirectional(1e3, **STITCHED), (0.0, *ANGLES, 90.0)), {}
    )
    for name, value in (("along", 1000e6), ("across", 4e6)):
        assert found[name].value == pytest.approx(value, rel=0.01)
        assert found[name].low < value < found[name].high and found[name].is_determined
    # the test along the fibres alone tells their modulus: it cannot be left out
    assert not any("law of the other angles" in told for told in found.warnings)


def test_an_angle_left_out_is_compared_with_the_law_of_the_others(tmp_path):
    good = identify_off_axis_file(write(tmp_path / "a.csv", unidirectional(**STITCHED)), {})
    labels = [curve.label for curve in good.panels[0].curves if curve.dashed]
    assert len(labels) == 3 and labels[0] == "by the law of the others"
    dashed = [curve.y for curve in good.panels[0].curves if curve.dashed]
    fitted = [curve.y for curve in good.panels[0].curves if not curve.dashed]
    for prediction, fit in zip(dashed, fitted, strict=True):
        np.testing.assert_allclose(prediction, fit, rtol=0.05)
    assert not any("law of the other angles" in told for told in good.warnings)
    file = write(tmp_path / "b.csv", unidirectional(**STITCHED), scaled={45.0: 1.2})
    with pytest.raises(FitRefusedError, match="the law does not follow the data"):
        identify_off_axis_file(file, {})
    odd = identify_off_axis_file(file, {}, accept=True)
    assert any("below the tests at 45 deg" in told for told in odd.warnings)


def test_stitching_that_is_slack_at_first_is_refused(tmp_path):
    held = across(shear_polynomial=STITCHED["shear_polynomial"])
    held.pop("tension")
    held["tension_curve"] = {"strain": [0.02, 0.06], "stress": "0.02 0.4 MPa"}
    file = write(tmp_path / "slack.csv", fabric(fibres(0.0, compression=20.0), across=held))
    with pytest.raises(FitRefusedError, match="the law at 60 deg.*across.tension_curve"):
        identify_off_axis_file(file, {})


def test_what_is_found_is_a_scene(tmp_path):
    found = identify_off_axis_file(write(tmp_path / "strips.csv", unidirectional(**STITCHED)), {})
    scene = scene_from_text(
        'process = { time = "1 s" }\nblank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }\n'
        + scene_snippet(found)
        + """
across.compression = "20 MPa"
across.bending = "4 MPa"
across.torsion = "4 MPa"
membrane.C23 = "0.1 MPa"
membrane.C13 = "0.1 MPa"
law = "fibre-families"
thickness = "0.6 mm"
areal_mass = "600 g/m^2"
fibre_density = "1800 kg/m^3"
compaction = { c0 = "0.15 MPa", c1 = 60.0, c2 = 2.5 }
bending = { C33 = "0.1 MPa", C23 = "0.1 MPa", C13 = "0.1 MPa" }
fibres = [{ angle = "0 deg", tension = "1 GPa", compression = "50 MPa", bending = "80 MPa" }]
"""
    )
    fitted = scene.material.build()
    assert fitted.normal[1].tension.modulus == pytest.approx(found["across"].value)
    assert fitted.pairs[0].polynomial[:2] == pytest.approx(
        (found["s0"].value, found["s1"].value), rel=1e-8
    )
    assert math.degrees(scene.material.membrane.shear_range) == pytest.approx(24.7, abs=0.5)


@pytest.mark.parametrize(
    ("angles", "change", "message"),
    [
        ((45.0,), None, "25 rows of 1 angles"),
        (ANGLES, lambda text: text.replace("45.0,", "95.0,"), "angle.*lies outside 0 to 90 deg"),
        (ANGLES, lambda text: text.replace(",30,", ",30,-"), "the force falls at line 26"),
    ],
    ids=["one angle", "wrong angle", "torn"],
)
def test_wrong_tests_are_refused(tmp_path, angles, change, message):
    file = write(tmp_path / "strips.csv", unidirectional(**STITCHED), angles)
    if change is not None:
        file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        identify_off_axis_file(file, {})
