"""``lcmchain coupon``: what it writes, what it refuses, and that it takes the scene's material."""

import json

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.coupons.result import CouponResult

STEEL = """
process = { time = "1 s" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
[material]
law = "isotropic"
thickness = "1 mm"
density = "7800 kg/m^3"
young_modulus = "1 MPa"
poisson_ratio = 0.0
"""


def exit_code(*arguments) -> int:
    with pytest.raises(SystemExit) as stop:
        cli.main([str(argument) for argument in arguments])
    return stop.value.code or 0


def test_compaction_writes_curve_picture_and_comparisons(tmp_path, capsys):
    out = tmp_path / "c"
    code = exit_code("coupon", "compaction", "--pressure", "0.05 MPa", "--size", "10 mm",
                     "--out", out)  # fmt: skip
    assert code == 0
    assert "simulated" in capsys.readouterr().out
    with (out / "curve.csv").open() as file:
        heading = file.readline().strip().split(",")
    assert heading[:2] == ["thickness [mm]", "pressure [MPa]"]
    curve = np.loadtxt(out / "curve.csv", delimiter=",", skiprows=1)
    assert curve[-1, 1] == pytest.approx(0.05, rel=1e-3)
    assert (out / "compaction.png").read_bytes()[:4] == b"\x89PNG"
    summary = json.loads((out / "coupon.json").read_text())
    assert {c["quantity"] for c in summary["comparisons"]} == {
        "pressure at 0.02 MPa", "pressure at 0.05 MPa"
    }  # fmt: skip
    assert summary["warnings"] == []


def test_a_coupon_says_which_laws_are_not_those_of_its_fabric(tmp_path, capsys, monkeypatch):
    def simulated(material, element, **rest):
        return CouponResult(
            name="compaction", settings={}, curves={"thickness [mm]": np.ones(2)}, comparisons=(),
            draw=lambda path: path.write_bytes(b""), datasets=None,
        )  # fmt: skip

    monkeypatch.setattr("lcmchain.coupons.compaction.compaction", simulated)
    for preset, count in (("glass-plain-600", 1), ("MD600", 0)):
        out = tmp_path / preset
        code = exit_code("coupon", "compaction", "--set", f"material.preset={preset}", "--out", out)
        assert code == 0
        shown = " ".join(capsys.readouterr().out.split())
        told = json.loads((out / "coupon.json").read_text())["warnings"]
        assert len(told) == count
        assert all("has no shear law" in text and text in shown for text in told)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bias-extension", "--length", "200 mm"], "twice as long"),
        (["bias-extension", "--width", "160"], "--width"),
        (["picture-frame", "--shear-angle", "60 mm"], "--shear-angle"),
        (["picture-frame", "--side", "0 mm"], "--side: must be positive"),
        (["pure-bending", "--curvature", "20 mm"], "--curvature"),
        (["pure-bending", "--fibre", "3"], "--fibre"),
        (["compaction", "--scene", "missing.toml"], "missing.toml"),
        (["cantilever", "--set", "material.preset=MD60"], "MD600"),
    ],
)
def test_wrong_input_is_told_before_anything_is_computed(tmp_path, capsys, arguments, message):
    out = tmp_path / "nothing"
    assert exit_code("coupon", *arguments, "--out", out) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_coupons_that_need_a_fabric_say_so(tmp_path, capsys):
    scene = tmp_path / "steel.toml"
    scene.write_text(STEEL)
    for name in ("cantilever", "bias-extension", "picture-frame"):
        assert exit_code("coupon", name, "--scene", scene, "--out", tmp_path / name) == 2
        assert 'material.law: is "isotropic"' in capsys.readouterr().err
