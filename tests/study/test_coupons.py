"""Coupon tests as sources of studies: the same engine, the clamps' force in place of a punch's."""

import csv

import numpy as np
import pytest
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupons.bias_extension import bias_extension
from lcmchain.errors import InputError
from lcmchain.study import Variant, Workers, read_source
from lcmchain.study.accuracy import RUNG, ladder
from lcmchain.study.comparison import differences
from lcmchain.study.runs import RUNS, Study, make_run
from lcmchain.study.sources import SceneText

#: A small strip, pulled a little: a run takes a moment.
SMALL = (
    "blank.size=['80 mm', '40 mm']", "blank.edge_length=8 mm", "process.time=20 ms",
    "coupon.displacement=6 mm",
)  # fmt: skip


@pytest.fixture
def strip():
    return read_source("bias_extension", SMALL)


def test_a_run_of_a_study_is_that_of_the_coupon_command(strip):
    """Same force, same fields: what a study varies is the test that users run."""
    text = read_source("bias-extension", ("coupon.displacement=6 mm", "blank.edge_length=20 mm"))
    outcome = make_run(text, Variant("as it is", "x"), 1)
    result = bias_extension(text.scene().material, displacement=6e-3, edge_length=20e-3)
    assert outcome.failure == ""
    # angles and times are read from a text here, and computed there: apart by their last bit
    force = result.curves["force [N]"].max()
    assert outcome.numbers["clamp_force_max_N"] == pytest.approx(force, rel=1e-9)
    sheet = result.datasets["/"]
    for name in ("shear_angle", "thickness", "fibre_volume_fraction"):
        wanted = sheet[name].values[-1]
        np.testing.assert_allclose(outcome.values[name], wanted, rtol=1e-9, atol=1e-12)
    assert outcome.numbers["step_count"] == result.figures["steps"]
    assert outcome.seconds > 0.0


def test_the_force_of_a_frame_is_that_of_its_coupon():
    from lcmchain.coupons.picture_frame import picture_frame

    text = read_source("picture_frame", ("coupon.shear_angle=10 deg", "blank.edge_length=50 mm"))
    outcome = make_run(text, Variant("as it is", "x"), 1)
    result = picture_frame(text.scene().material, shear_angle=np.radians(10.0), edge_length=0.05)
    force = result.curves["force [N]"].max()
    assert outcome.numbers["clamp_force_max_N"] == pytest.approx(force, rel=1e-9)


def test_longer_pulls_take_longer_at_the_speed_of_the_test():
    assert read_source("bias-extension").scene().process.time == pytest.approx(0.2)
    half = read_source("bias-extension", ("coupon.displacement=30 mm",))
    assert half.scene().process.time == pytest.approx(0.1)
    given = read_source("bias-extension", ("coupon.displacement=30 mm", "process.time=0.3 s"))
    assert given.scene().process.time == pytest.approx(0.3)


def test_the_ladder_of_a_coupon_varies_what_its_model_honours(strip):
    variants = ladder(strip)
    assert len(variants) >= 13
    axes = {variant.axis for variant in variants}
    assert axes >= {"edge length", "process time", "time step", "damping", "added mass",
                    "fibre modulus", RUNG}  # fmt: skip
    assert "contact stiffness" not in axes  # it has no tools
    assert "kinematic" not in {variant.model for variant in variants}  # a laid net knows no clamps
    assert {"membrane", "membrane-shell"} <= {variant.model for variant in variants}


def test_what_decides_a_run_decides_its_fingerprint(strip, tmp_path):
    variant = Variant("as it is", "x")
    first = Study(strip, tmp_path).outcome(variant)
    made = (tmp_path / RUNS / "as_it_is.nc").stat().st_mtime_ns
    assert Study(strip, tmp_path).outcome(variant).equals(first)
    assert (tmp_path / RUNS / "as_it_is.nc").stat().st_mtime_ns == made
    prints = {strip.job(variant).fingerprint}
    for other in ("coupon.displacement=7 mm", "blank.edge_length=10 mm"):
        prints.add(strip.job(Variant("other", "x", (other,))).fingerprint)
    frame = read_source("picture-frame", SMALL[:3])
    prints.add(frame.job(variant).fingerprint)
    assert len(prints) == 4


@pytest.mark.slow
def test_a_cluster_runs_coupons_to_the_same_bits(strip, tmp_path):
    pytest.importorskip("distributed")
    edges = [Variant(f"{e} mm", "edge length", (f"blank.edge_length={e} mm",)) for e in (10, 8)]
    here = Study(strip, tmp_path / "here").outcomes(edges)
    there = Study(strip, tmp_path / "there", Workers(2, 1)).outcomes(edges)
    assert all(there[name].equals(here[name]) for name in here)


def test_clamps_that_pull_farther_take_more_force_and_shear(strip):
    near, far = (
        make_run(strip, Variant(d, "x", (f"coupon.displacement={d}",)), 1) for d in ("6 mm", "9 mm")
    )
    found = differences(far, near)
    assert found["clamp_force"].typical > 0.1
    assert np.isnan(found["punch_force"].typical)
    assert found["shear_angle"].typical > 0.03
    assert far.numbers["forming_work_J"] > near.numbers["forming_work_J"]


def test_commands_of_studies_take_coupons(tmp_path):
    common = ["--workers", "1", "--threads", "1", "--quiet"]
    common += [word for entry in SMALL for word in ("--set", entry)]
    edges = ["--vary", "blank.edge_length=10 mm|8 mm|6 mm"]
    done = CliRunner().invoke(
        app, ["study", "accuracy", "bias_extension", *edges, "--out", str(tmp_path / "a"), *common],
        catch_exceptions=False,
    )  # fmt: skip
    assert done.exit_code == 0
    with open(tmp_path / "a" / "accuracy.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert 0.0 < float(rows[0]["clamp_force_typical"]) < 1.0
    assert "punch_force_typical" not in rows[0]
    assert "clamp force" in (tmp_path / "a" / "accuracy.md").read_text(encoding="utf-8")
    pulls = ["--vary", "coupon.displacement=5 mm|6 mm"]
    done = CliRunner().invoke(
        app, ["study", "sweep", "bias-extension", *pulls, "--out", str(tmp_path / "b"), *common],
        catch_exceptions=False,
    )  # fmt: skip
    assert done.exit_code == 0
    with open(tmp_path / "b" / "sweep.csv", encoding="utf-8") as file:
        forces = [float(row["clamp_force"]) for row in csv.DictReader(file)]
    assert 0.0 < forces[0] < forces[1]


@pytest.mark.parametrize(
    ("name", "entry", "told"),
    [
        ("bias_extensio", None, 'did you mean "bias-extension"'),
        ("cantilever", None, "neither a scene file nor a coupon that can be studied"),
        ("missing.toml", None, "no such scene file"),
        ("bias_extension", "coupon.displacemen=5 mm", 'there is "coupon.displacement"'),
        ("bias_extension", "coupon.displacement=5 deg", "coupon.displacement"),
        ("bias_extension", "coupon.displacement=0 mm", "must be positive"),
        ("bias_extension", "blank.edge=5 mm", "edge_length"),
        ("bias_extension", "element=kinematic", "cannot be pulled"),
        ("picture_frame", "coupon.displacement=5 mm", 'there is "coupon.shear_angle"'),
    ],
)
def test_wrong_coupons_are_told_before_anything_runs(name, entry, told):
    with pytest.raises(InputError, match=told):
        read_source(name, () if entry is None else (entry,))


def test_a_file_is_a_scene_even_if_it_has_a_coupons_name(dent, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bias-extension").write_text(dent.text, encoding="utf-8")
    assert isinstance(read_source("bias-extension"), SceneText)
