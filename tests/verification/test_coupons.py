"""Simulated coupons against their analytic solutions."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.coupons.analytic import elastica
from lcmchain.coupons.bias_extension import bias_extension
from lcmchain.coupons.cantilever import bent_strip, cantilever
from lcmchain.coupons.compaction import compaction
from lcmchain.coupons.picture_frame import picture_frame
from lcmchain.coupons.result import write_coupon
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import read_forming
from lcmchain.scene import Element, scene_from_text

SCENE = """
process = { time = "1 s" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""


@pytest.fixture(scope="module")
def md600():
    return scene_from_text(SCENE).material


def compared(result, quantity):
    found = [c for c in result.comparisons if c.quantity == quantity]
    assert found, [c.quantity for c in result.comparisons]
    return found


@pytest.fixture(scope="module")
def pulled(md600):
    """The paper's specimen with elements of 10 mm, up to where the pin-jointed net holds."""
    return bias_extension(md600, displacement=0.034, edge_length=10e-3)


def test_bias_extension_follows_the_pin_jointed_net(pulled):
    u = pulled.curves["displacement [mm]"]
    angle = pulled.curves["shear angle [deg]"]
    expected = pulled.curves["pin-joint shear angle [deg]"]
    assert u[-1] > 30.0
    assert np.abs(angle - expected)[u <= 30.5].max() < 1.0
    (force,) = compared(pulled, "force at 30 mm")
    assert abs(force.relative) < 0.05
    assert force.reference == pytest.approx(6.80, rel=0.01)
    assert abs(pulled.figures["balance_error_to_internal"]) < 5e-3


def test_bias_extension_has_three_zones(pulled, tmp_path):
    """Undeformed at the clamps, half the angle beside them, the full angle at the centre."""
    sheet = pulled.datasets["/"]
    x, y = (sheet[f"reference_position_{a}"].values[sheet["sheet_face_nodes"].values.clip(0)]
            .mean(axis=1) for a in "xy")  # fmt: skip
    angle = np.degrees(np.abs(sheet["shear_angle"].values[-1]))
    full = pulled.curves["shear angle [deg]"][-1]
    at_clamp = (np.abs(x) > 0.145) & (np.abs(y) < 0.03)
    beside = (np.abs(np.abs(x) - 0.08) < 0.02) & (np.abs(y) > 0.06)
    centre = (np.abs(x) < 0.03) & (np.abs(y) < 0.03)
    assert angle[at_clamp].mean() < 1.0
    assert angle[beside].mean() == pytest.approx(0.5 * full, abs=2.0)
    assert angle[centre].mean() == pytest.approx(full, abs=2.0)

    files = write_coupon(tmp_path, pulled)
    assert all(file.stat().st_size > 100 for file in files)
    assert {"curve.csv", "bias-extension.png", "shear_angle.png"} <= {f.name for f in files}
    assert "shear_angle" in read_forming(tmp_path / "forming.nc")


def test_bias_extension_of_a_short_strip_is_refused(md600):
    with pytest.raises(InputError, match="twice as long"):
        bias_extension(md600, length=0.2, width=0.16)


def test_picture_frame_force_is_the_shear_flow(md600):
    result = picture_frame(md600, side=0.1, edge_length=10e-3)
    assert [c.quantity for c in result.comparisons][-1] == "edge shear force at 60°"
    assert max(abs(c.relative) for c in result.comparisons) < 0.01
    simulated = result.curves["shear angle [deg]"]
    np.testing.assert_allclose(simulated, result.curves["analytic shear angle [deg]"], atol=0.05)


def test_compaction_pressure_is_that_of_the_law(md600):
    result = compaction(md600, size=10e-3)
    law = [c for c in result.comparisons if c.origin.startswith("λ")]
    experiment = [c for c in result.comparisons if c.origin.startswith("experiment")]
    assert len(law) == len(experiment) == 7
    assert max(abs(c.relative) for c in law) < 1e-3
    assert max(abs(c.relative) for c in experiment) < 0.12
    assert result.figures["thickness_spread_max_m"] < 1e-9
    p = result.curves["pressure [MPa]"]
    assert p[-1] == pytest.approx(1.5, rel=1e-3)
    pressed = p > 1e-3  # below, the inertia of the sheet shows
    ratio = p[pressed] / result.curves["law pressure [MPa]"][pressed]
    np.testing.assert_allclose(ratio, 1.0, atol=1e-3)


def test_cantilever_overhangs_are_those_of_the_elastica(md600):
    result = cantilever(md600)
    (along,) = compared(result, "overhang at 0°")
    (across,) = compared(result, "overhang at 90°")
    free, held = compared(result, "overhang at 45°")
    assert (along.reference, across.reference) == pytest.approx((163.4, 170.3), abs=0.1)
    assert max(abs(along.relative), abs(across.relative)) < 0.02
    # a strip of finite width is stiffer than a free one and softer than one held across
    assert (free.reference, held.reference) == pytest.approx((116.9, 141.1), abs=0.1)
    assert free.reference < free.value < held.reference


def overhang_at(load_parameter, material):
    stiffness = material.bending.C11 * material.thickness**3 / 12.0
    return np.cbrt(load_parameter * stiffness / (material.areal_mass * 9.81))


@pytest.fixture(scope="module")
def upright(md600):
    """MD600 with directors that neither tilt nor shorten, as the elastica assumes."""
    shear = {"C13": 10e6, "C23": 10e6}
    return md600.model_copy(
        update={
            "membrane": md600.membrane.model_copy(update=shear),
            "bending": md600.bending.model_copy(update=shear),
            "compaction": md600.compaction.model_copy(update={"c0": 10e6}),
        }
    )


@pytest.mark.parametrize(
    ("load_parameter", "x", "y"),
    [
        (0.5, 0.99778, 0.06231), (1, 0.99125, 0.12347), (2, 0.96689, 0.23851),
        (5, 0.84666, 0.49591), (8, 0.72442, 0.64063), (10, 0.65635, 0.70020),
        (20, 0.44523, 0.82988), (50, 0.24501, 0.90792), (100, 0.15922, 0.93752),
    ],
)  # fmt: skip
def test_bent_strips_have_the_shape_of_the_heavy_elastica(upright, load_parameter, x, y):
    L = overhang_at(load_parameter, upright)
    strip = bent_strip(upright, Element(), 0.0, overhang=L, width=10e-3, edge_length=5e-3)
    np.testing.assert_allclose(strip.line[-1] / L, (x, y), rtol=0.01)


def test_bent_strips_converge_with_the_square_of_the_edge_length(upright):
    L = overhang_at(100.0, upright)
    exact = elastica(100.0).x[-1]
    error = [
        abs(bent_strip(upright, Element(), 0.0, overhang=L, width=2 * h, edge_length=h).line[-1, 0]
            / L / exact - 1.0)
        for h in (L / 40, L / 80)
    ]  # fmt: skip
    assert error[0] > 3.0 * error[1]


@pytest.mark.slow
def test_bias_extension_of_the_paper(md600):
    result = bias_extension(md600)
    u = result.curves["displacement [mm]"]
    error = result.curves["shear angle [deg]"] - result.curves["pin-joint shear angle [deg]"]
    assert np.abs(error)[u <= 31.0].max() < 1.0
    assert abs(compared(result, "force at 30 mm")[0].relative) < 0.05
    # the stretching fibres keep the angle below 63 degrees at 60 mm (paper, Fig. 4b)
    assert 55.0 < result.curves["shear angle [deg]"][-1] < 63.0
