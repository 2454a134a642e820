"""What resists the rate of the shear, from picture frames: speeds, stands, temperatures."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.coupons.analytic import PictureFrame
from lcmchain.errors import InputError
from lcmchain.identification.files import scene_snippet
from lcmchain.identification.from_file import identify_viscous_file
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.synthetic import picture_frame_curve, preset_fabric
from lcmchain.materials.features.temperature_field import arrhenius_factor
from lcmchain.materials.features.viscous_shear import Relaxation, ViscousShear
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


def pulled(speed, *, hold=0.0, travel=70e-3):
    """Return times and travels of a pull at a speed, after which the frame may stand still."""
    way = np.linspace(0.0, travel, 41)
    time = way / speed
    if hold:
        still = np.geomspace(1e-4 * hold, hold, 30)
        time, way = np.append(time, time[-1] + still), np.append(way, np.full(30, travel))
    return time, way


def write_timed(path, viscous, pulls, *, temperatures=None, factor=None, noise=0.01, seed=1):
    """Write pulls over time; ``factor`` of a temperature [K] is on all times of the fabric."""
    rows = ["time [s],displacement [mm],force [N],specimen"]
    rows[0] += ",temperature [degC]" if temperatures else ""
    for number, (time, way) in enumerate(pulls):
        own = viscous if factor is None else viscous.shifted(factor(temperatures[number]))
        force = picture_frame_curve(
            preset_fabric(), own, FRAME, time, way, noise=noise, seed=100 * seed + number
        )
        heat = f",{temperatures[number] - 273.15:.6g}" if temperatures else ""
        rows += [
            f"{t:.9g},{1e3 * d:.9g},{f:.9g},{number}{heat}" for t, d, f in zip(time, way, force)
        ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def scene_of(found):
    """Return what resists the rate in a scene with the parameters found."""
    scene = scene_from_text(
        'process = { time = "1 s" }\nblank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }\n'
        + scene_snippet(found)
        + 'preset = "MD600"\n'
    )
    return scene.material.build().viscous


def inside(found, **true):
    """Return how many of the true values lie in the intervals of what was found."""
    return sum(found[name].low <= value <= found[name].high for name, value in true.items())


def test_a_viscosity_that_falls_with_the_rate_is_found_from_three_speeds(tmp_path):
    counted = 0
    for seed in range(6):
        file = write(tmp_path / "thinning.csv", THINNING, speeds=(0.001, *SPEEDS), seed=seed)
        found = identify_viscous_file(file, {})
        assert not found.objections and "Cross's law" in found.method
        counted += inside(found, viscosity=3e4, time_constant=5.0, exponent=0.2)
        # over the rates of the tests at which it counts, whatever each number may be
        rates = np.geomspace(0.05, 2.0, 20)
        assert scene_of(found).viscosity_at(rates) == pytest.approx(
            THINNING.viscosity_at(rates), rel=0.04
        )
    assert counted >= 15  # of 18


class Thickening:
    """A viscosity that grows with the rate, which the law does not know."""

    def viscosity_at(self, rate):
        return 2000.0 * np.sqrt(rate / 0.1)


def test_a_viscosity_that_grows_with_the_rate_is_refused(tmp_path):
    file = write(tmp_path / "thickening.csv", Thickening())
    with pytest.raises(FitRefusedError, match="a constant viscosity does not follow the data"):
        identify_viscous_file(file, {})
    accepted = identify_viscous_file(file, {}, accept=True)
    assert accepted.warnings[0].startswith("accepted although")


def test_two_speeds_do_not_tell_whether_a_viscosity_falls(tmp_path):
    file = write(tmp_path / "thinning.csv", THINNING, speeds=(0.01, 0.25))
    found = identify_viscous_file(file, {})
    assert "constant viscosity" in found.method
    assert any("2 speeds do not tell whether the viscosity falls" in w for w in found.warnings)
    # three speeds do, and need no such word
    file = write(tmp_path / "constant.csv", ViscousShear(viscosity=1500.0))
    found = identify_viscous_file(file, {})
    assert "constant viscosity" in found.method and not found.warnings


def test_numbers_that_the_rates_do_not_reach_are_named(tmp_path):
    power_law = ViscousShear(viscosity=3e6, time_constant=5e4, exponent=0.3)
    file = write(tmp_path / "fast.csv", power_law, speeds=(0.001, *SPEEDS))
    found = identify_viscous_file(file, {})
    assert not found["viscosity"].is_determined and not found["time_constant"].is_determined
    assert inside(found, exponent=0.3) and found["exponent"].is_determined
    told = " ".join(found.warnings)
    assert "do not determine viscosity, time_constant" in told
    assert "do not reach down to a constant viscosity" in told
    assert "infinite_viscosity is left at 0, and up to" in told


def test_a_frame_that_stands_still_tells_as_many_maxwell_elements_as_there_are(tmp_path):
    one = ViscousShear(viscosity=1000.0, terms=(Relaxation(3e4, 2.0),))
    two = ViscousShear(viscosity=1000.0, terms=(Relaxation(2e4, 0.2), Relaxation(1e4, 5.0)))
    pulls = [pulled(0.05, hold=60.0), pulled(0.25, hold=60.0)]
    counted = 0
    for seed in range(1, 4):
        found = identify_viscous_file(write_timed(tmp_path / "one.csv", one, pulls, seed=seed), {})
        assert len(scene_of(found).terms) == 1
        counted += inside(found, viscosity=1000.0, modulus_1=3e4, relaxation_time_1=2.0)
        found = identify_viscous_file(write_timed(tmp_path / "two.csv", two, pulls, seed=seed), {})
        assert [t.modulus for t in scene_of(found).terms] == pytest.approx([2e4, 1e4], rel=0.15)
        assert [t.time for t in scene_of(found).terms] == pytest.approx([0.2, 5.0], rel=0.3)
        counted += inside(
            found, viscosity=1000.0, modulus_1=2e4, relaxation_time_1=0.2, modulus_2=1e4,
            relaxation_time_2=5.0,
        )  # fmt: skip
    assert counted >= 21  # of 24


def test_each_test_starts_without_a_past(tmp_path):
    one = ViscousShear(viscosity=1000.0, terms=(Relaxation(3e4, 2.0),))
    pulls = [pulled(0.25, hold=0.5), pulled(0.05, hold=0.5), pulled(0.01, hold=8.0)]
    found = identify_viscous_file(
        write_timed(tmp_path / "short.csv", one, pulls, noise=1e-5), {"side": "200 mm"}
    )
    numbers = [found[name].value for name in ("viscosity", "modulus_1", "relaxation_time_1")]
    # what is left is the rate of the angle between two rows, taken as constant in four parts
    assert numbers == pytest.approx([1000.0, 3e4, 2.0], rel=2e-3)


def test_a_force_that_rises_while_the_frame_stands_is_refused(tmp_path):
    one = ViscousShear(terms=(Relaxation(3e4, 2.0),))
    file = write_timed(tmp_path / "drift.csv", one, [pulled(0.05, hold=60.0)])
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    for k, own in enumerate(cells[-30:]):
        own[2] = f"{float(own[2]) * (1.0 + 0.03 * k):.9g}"
    file.write_text("\n".join([head, *(",".join(own) for own in cells)]), encoding="utf-8")
    with pytest.raises(FitRefusedError, match="the relaxation does not follow the data"):
        identify_viscous_file(file, {})


def test_temperatures_tell_the_energy_of_activation(tmp_path):
    law = ViscousShear(viscosity=1000.0, terms=(Relaxation(3e4, 2.0),))
    pulls = [pulled(0.05, hold=60.0)] * 3
    heat = {"temperatures": [500.0, 530.0, 560.0]}
    file = write_timed(
        tmp_path / "heat.csv", law, pulls, **heat,
        factor=lambda kelvin: arrhenius_factor(kelvin, 530.0, 6e4),
    )  # fmt: skip
    found = identify_viscous_file(file, {})
    assert found["activation_energy"].value == pytest.approx(6e4, rel=0.05)
    assert inside(
        found, activation_energy=6e4, viscosity=1000.0, modulus_1=3e4, relaxation_time_1=2.0
    ) >= 3  # fmt: skip
    assert ("reference temperature", "530 K", "of all times") in found.inputs
    # the scene is at the reference temperature until it states its own
    assert scene_of(found).terms[0].time == pytest.approx(found["relaxation_time_1"].value)
    # times that do not follow one energy
    bent = write_timed(
        tmp_path / "bent.csv", law, pulls, **heat,
        factor=lambda kelvin: {500.0: 1.0, 530.0: 3.0, 560.0: 0.3}[kelvin],
    )  # fmt: skip
    with pytest.raises(FitRefusedError, match="does not follow the data"):
        identify_viscous_file(bent, {})


def test_one_temperature_and_no_stand_are_told(tmp_path):
    law = ViscousShear(viscosity=1500.0)
    pulls = [pulled(0.01), pulled(0.25)]
    file = write_timed(
        tmp_path / "one.csv", law, pulls, temperatures=[530.0, 530.0], factor=lambda kelvin: 1.0
    )
    found = identify_viscous_file(file, {})
    told = {name: value for name, value, _ in found.inputs}
    assert told["activation energy"] == "not looked for"
    assert told["Maxwell elements"] == "none looked for"
    assert found["viscosity"].value == pytest.approx(1500.0, rel=0.05)


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
