"""Shear polynomial and viscosity from picture frames at several speeds."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.coupons.analytic import PictureFrame
from lcmchain.errors import InputError
from lcmchain.identification.from_file import identify_viscous_file
from lcmchain.identification.result import FitRefusedError
from lcmchain.materials.viscous_shear import ViscousShear
from lcmchain.scene import scene_from_text
from lcmchain.verification.random_elements import md600

FRAME = PictureFrame(0.2, 1.004e-3)
SPEEDS = (0.01, 0.05, 0.25)  # [m/s]
THINNING = ViscousShear(viscosity=3e4, time_constant=5.0, exponent=0.2)


def write(path, viscous, *, speeds=SPEEDS, noise=0.01, seed=1):
    """Write the forces of a fabric on a frame: S12 of the law at rates of the machine."""
    rng, rows = np.random.default_rng(seed), ["displacement [mm],force [N],speed [mm/s],specimen"]
    fabric = md600()
    for number, speed in enumerate(speeds):
        travel = np.linspace(2e-3, 70e-3, 40)
        angle = FRAME.shear_angle(travel)
        # the rate from the angles of the frame a microsecond apart
        rate = (FRAME.shear_angle(travel + 1e-6 * speed) - angle) / 1e-6
        strain = np.zeros((len(angle), 6))
        strain[:, 3] = np.sin(angle)
        stress = fabric.stress_and_tangent(strain)[0][:, 3]
        stress = stress + viscous.viscosity_at(rate) * rate / np.cos(angle)
        force = FRAME.force(angle, lambda g, s=stress: s)
        force *= 1.0 + noise * rng.standard_normal(len(force))
        rows += [f"{1e3 * d:.9g},{f:.9g},{1e3 * speed:g},{number}" for d, f in zip(travel, force)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_the_viscosity_of_the_data_lies_in_its_interval(tmp_path):
    for seed in range(4):
        file = write(tmp_path / "frames.csv", ViscousShear(viscosity=1500.0), seed=seed)
        found = identify_viscous_file(file, {})
        viscosity = found["viscosity"]
        assert viscosity.value == pytest.approx(1500.0, rel=0.02)
        assert viscosity.low < 1500.0 < viscosity.high and viscosity.is_determined
        assert viscosity.high - viscosity.low < 0.05 * 1500.0
        stiffness = [found[f"s{k}"].value for k in range(5)]
        assert np.polynomial.polynomial.polyval(0.3, stiffness) == pytest.approx(
            np.polynomial.polynomial.polyval(0.3, md600().law[4:9]), rel=0.05
        )


def test_what_is_found_is_a_scene(tmp_path, capsys):
    file = write(tmp_path / "frames.csv", ViscousShear(viscosity=1500.0))
    with pytest.raises(SystemExit) as ended:
        cli.main(["identify", "viscous", str(file), "--out", str(tmp_path / "out")])
    assert not ended.value.code
    told = capsys.readouterr().out
    assert "viscosity" in told and "Pa*s" in told and "--side" not in told
    snippet = (tmp_path / "out" / "parameters.toml").read_text(encoding="utf-8")
    entries = tomllib.loads(snippet)["material"]
    scene = scene_from_text(
        'process = { time = "1 s" }\nblank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }\n'
        + snippet
        + 'preset = "MD600"\n'
    )
    assert scene.material.viscous.viscosity == pytest.approx(1500.0, rel=0.02)
    assert set(entries) == {"membrane", "viscous"}
    assert scene.material.build().viscous.viscosity == scene.material.viscous.viscosity


def test_a_viscosity_that_falls_with_the_rate_is_refused(tmp_path):
    file = write(tmp_path / "thinning.csv", THINNING)
    with pytest.raises(FitRefusedError, match="a constant viscosity does not follow the data"):
        identify_viscous_file(file, {})
    accepted = identify_viscous_file(file, {}, accept=True)
    assert accepted.warnings[0].startswith("accepted although")
    assert "material.viscous.cross" in accepted.holds


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace(",10,", ",0,"), "speed.*: is not above 0"),
        (lambda text: text.replace(",10,", ",50,").replace(",250,", ",50,"), "speeds of a ratio"),
        (lambda text: text.replace("70,", "117,"), "displacement.*more than 85 deg"),
    ],
    ids=["still", "one speed", "folded"],
)
def test_wrong_tests_are_refused(tmp_path, change, message):
    file = write(tmp_path / "frames.csv", ViscousShear(viscosity=1500.0))
    file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        identify_viscous_file(file, {})
