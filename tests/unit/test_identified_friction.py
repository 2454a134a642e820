"""Friction of bending and shear from loops: found, left open, or refused, each with its word."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.coupons.analytic import PictureFrame
from lcmchain.errors import InputError
from lcmchain.identification.data import CouponData
from lcmchain.identification.files import scene_snippet
from lcmchain.identification.from_file import identify_bending_loop_file, identify_shear_loop_file
from lcmchain.identification.loops.bending import identify_bending_loop
from lcmchain.identification.loops.shear import identify_shear_loop, shear_loops
from lcmchain.identification.regression import falling_row
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.synthetic import (
    bending_loop_curve,
    preset_fabric,
    shear_loop_curve,
    write_coupon,
)
from lcmchain.materials.features.rheology import Friction
from lcmchain.materials.features.shear_friction import ShearFriction
from lcmchain.scene import scene_from_text

THICKNESS = 1.004e-3
STIFFNESS, FRICTION = 5e-3, Friction(0.02, 4.0)
FABRIC = preset_fabric("MD600")
FRAME = PictureFrame(0.2, THICKNESS)
GROWING = ShearFriction(5e3, math.radians(1.0), 0.3)


def course(*points, count=40):
    """Rows from zero on between turning points."""
    ways = [np.linspace(first, last, count + 1)[1:] for first, last in zip(points, points[1:])]
    return np.concatenate([[0.0], *ways])


BENT = course(0.0, 20.0, -20.0, 20.0)
SHEARED = course(0.0, *[float(FRAME.displacement(0.8)), 0.0] * 2)


def coupon(specimen=None, **columns) -> CouponData:
    count = len(next(iter(columns.values())))
    specimen = np.zeros(count, dtype=int) if specimen is None else specimen
    return CouponData("data.csv", columns, np.arange(count) + 2, specimen)


def bending(moment, curvature=BENT, **options):
    columns = {"curvature": curvature, "moment": moment}
    columns |= {name: options.pop(name) for name in ("time",) if name in options}
    data = coupon(options.pop("specimen", None), **columns)
    return identify_bending_loop(data, thickness=THICKNESS, **options)


def moments(noise=0.0, seed=0, curvature=BENT):
    return bending_loop_curve(STIFFNESS, FRICTION, curvature, noise=noise, seed=seed)


def rubbing(curvature=BENT):
    """The part of the friction of the moments."""
    return moments(curvature=curvature) - STIFFNESS * curvature


def shear(force, travel=SHEARED, **options):
    return identify_shear_loop(coupon(displacement=travel, force=force), FRAME, **options)


def inside(found, **true):
    """Return which of the true values lie in the intervals of what was found."""
    return np.array([found[name].low <= value <= found[name].high for name, value in true.items()])


def scene_of(found):
    """Return the material of a scene with the parameters found."""
    return scene_from_text(
        'process = { time = "1 s" }\nblank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }\n'
        + scene_snippet(found)
        + ("" if found.scene_table == "material" else "[material]\n")
        + 'preset = "MD600"\n'
    ).material


# --- bending --------------------------------------------------------------------------------------


def test_a_loop_without_noise_gives_its_law_back():
    found = bending(moments())
    assert found["stiffness"].value == pytest.approx(STIFFNESS, rel=1e-6)
    assert found["friction_moment"].value == pytest.approx(FRICTION.limit, rel=1e-6)
    assert found["friction_curvature"].value == pytest.approx(FRICTION.length, rel=1e-6)
    # what the loop loses is its area: by rows that lie denser than 1/m
    dense = course(0.0, 20.0, -20.0, 20.0, count=4000)
    area = np.trapezoid(moments(curvature=dense)[4000:], dense[4000:])
    assert found["loop_loss"].value == pytest.approx(area, rel=1e-3)


def test_true_numbers_lie_in_their_intervals_as_often_as_these_say():
    """2 % of the largest moment, an eighth of the width of the loop: 95 of 100, and no refusal."""
    seeds = 60
    told = [bending(moments(0.02, seed)) for seed in range(seeds)]
    counted = sum(
        inside(own, stiffness=STIFFNESS, friction_moment=0.02, friction_curvature=4.0)
        for own in told
    )
    assert np.all(counted >= 0.9 * seeds) and np.any(counted < seeds)
    widths = [own["friction_moment"].high - own["friction_moment"].low for own in told]
    assert np.mean(widths) < 0.1 * FRICTION.limit


def test_what_is_found_of_bending_is_a_scene(tmp_path, capsys):
    file = tmp_path / "loop.csv"
    write_coupon(
        file, {"curvature [1/cm]": 1e-2 * BENT, "moment [gf*cm/cm]": moments(0.01) / 9.80665e-3}
    )
    options = ["--fibre", "2", "--thickness", "1.004 mm", "--out", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as ended:
        cli.main(["identify", "bending-loop", str(file), *options])
    assert not ended.value.code and "friction_moment" in capsys.readouterr().out
    snippet = (tmp_path / "out" / "parameters.toml").read_text(encoding="utf-8")
    assert set(tomllib.loads(snippet)["material"]["bending"]) == {"C22", "friction_2"}
    material = scene_of(identify_bending_loop_file(file, {}, fibre=2))
    assert material.bending.friction_2.moment == pytest.approx(0.02, rel=0.05)
    stiffness = material.build().law.B22 * THICKNESS**3 / 12.0
    assert stiffness == pytest.approx(STIFFNESS, rel=0.02)


def test_bending_that_softens_becomes_a_curve():
    """Elastic moment by points of its own, not those of the fit: within 4 % of the largest."""

    def elastic(curvature):
        size = np.abs(curvature)
        return np.sign(curvature) * (0.03 * np.tanh(size / 8.0) + 0.002 * size)

    moment = elastic(BENT) + rubbing()
    moment = moment + 0.01 * moment.max() * np.random.default_rng(1).standard_normal(len(moment))
    found = bending(moment)
    assert "a curve by points" in found.method and not found.objections
    material = scene_of(found)
    points = np.append(0.0, material.bending.curve_1.curvature)
    values = np.append(0.0, material.bending.curve_1.moment)
    places = np.linspace(0.0, 20.0, 41)
    assert np.interp(places, points, values) == pytest.approx(elastic(places), abs=0.04 * 0.07)
    assert found["friction_moment"].value == pytest.approx(FRICTION.limit, rel=0.1)
    # one stiffness stays one, whatever the seed
    assert all("stiffness" in bending(moments(0.02, k)).method for k in range(20))


def test_friction_is_left_open_without_a_way_back_and_not_found_where_there_is_none():
    there = bending(moments(0.01)[:41], BENT[:41])
    assert [own.name for own in there.parameters][-1] != "friction_curvature"
    assert "no test turns back: the friction is left open" in there.warnings[-1]
    assert not any("friction" in key for key in there.scene_entries)
    # all that it resists on the way there is taken as elastic
    assert scene_of(there).bending.friction_1 is None
    for seed in range(20):
        noise = 0.002 * np.random.default_rng(seed).standard_normal(len(BENT))
        closed = bending(STIFFNESS * BENT + noise)
        assert "no friction is found" in closed.warnings[-1]


def test_what_scatters_in_the_curvature_turns_nothing_round():
    jitter = 0.1 * np.random.default_rng(3).standard_normal(len(BENT))
    found = bending(moments(0.01), np.where(BENT == 0.0, 0.0, BENT + jitter))
    assert found["friction_moment"].value == pytest.approx(FRICTION.limit, rel=0.05)
    assert found["friction_curvature"].value == pytest.approx(FRICTION.length, rel=0.1)


def noise(seed=1):
    return 0.001 * np.random.default_rng(seed).standard_normal(len(BENT))


def harmonic():
    """A dashpot under a harmonic course: an ellipse, which no friction has."""
    phase = np.linspace(0.0, 4.0 * np.pi, 241)
    moment = STIFFNESS * 20.0 * np.sin(phase) + 0.02 * np.cos(phase) * -np.expm1(-8.0 * phase)
    return moment + 0.001 * np.random.default_rng(2).standard_normal(241), 20.0 * np.sin(phase)


def narrowing():
    """Friction that is an eighth less in every branch."""
    curvature = course(0.0, *[20.0, -20.0] * 3)
    branch = np.append(0, np.repeat(np.arange(6), 40))
    return STIFFNESS * curvature + rubbing(curvature) * (1.0 - 0.12 * branch), curvature


def torn():
    moment = moments(0.01)
    moment[30:41] *= 0.3
    return moment, BENT


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda: (moments() + 0.006 + noise(), BENT), "zero of the test is off by .* every branch"),
        (
            lambda: (moments() + 0.02 * np.arange(len(BENT)) / len(BENT) + noise(), BENT),
            "zero (of the test|changes)",
        ),
        (harmonic, "on the way .* the law does not follow the data: .* of the friction"),
        (narrowing, "changes from branch to branch"),
        (torn, "the moment falls at line 32 while the curvature goes on"),
        (
            lambda: (rubbing() + 1e-3 * BENT + 5e-6 * BENT**3 + noise(), BENT),
            "does not follow the data: .* of the largest moment",
        ),
    ],
)
def test_a_loop_that_the_law_does_not_describe_is_refused(made, told):
    moment, curvature = made()
    with pytest.raises(FitRefusedError, match=told):
        bending(moment, curvature)
    taken = bending(moment, curvature, accept=True)
    assert taken.warnings[0].startswith("accepted although")


def test_the_range_of_branches_that_hold_is_named():
    with pytest.raises(FitRefusedError, match=r"A fit of the first \d branches \(up to line \d+\)"):
        bending(*narrowing())


def test_friction_that_knows_the_rate_is_refused_where_tests_tell_it():
    """Two tests at speeds 100 apart, the fast one with twice the friction."""
    moment = np.concatenate([STIFFNESS * BENT + share * rubbing() for share in (0.7, 1.4)])
    moment = moment + 0.001 * np.random.default_rng(1).standard_normal(len(moment))
    rows = np.arange(len(BENT), dtype=float)
    options = {
        "curvature": np.tile(BENT, 2),
        "time": np.concatenate([rows, 0.01 * rows]),
        "specimen": np.repeat([0, 1], len(BENT)),
    }
    with pytest.raises(FitRefusedError, match="depends on the rate: .* where the test is faster"):
        bending(moment, **options)
    same = np.tile(moments(), 2) + 0.001 * np.random.default_rng(2).standard_normal(len(moment))
    assert not bending(same, **options).objections


def test_a_test_that_begins_bent_or_pushes_is_refused_by_name():
    with pytest.raises(InputError, match='line 2, column "curvature": is far from zero'):
        bending(moments()[40:], BENT[40:])
    with pytest.raises(InputError, match="does not resist the curvature"):
        bending(-moments())
    with pytest.raises(InputError, match="stays zero"):
        bending(moments(), 0.0 * BENT)


def test_small_loads_of_even_scatter_do_not_fall():
    rising, one = np.linspace(0.0, 1.0, 60), np.zeros(60, dtype=int)
    falls = 0
    for seed in range(100):
        load = rising + 0.02 * np.random.default_rng(seed).standard_normal(60)
        assert falling_row(load, one, noise_floor=0.5) is None
        falls += falling_row(load, one) is not None
    assert falls > 10
    load[50:] = 0.2
    assert falling_row(load, one, noise_floor=0.5) == 50


# --- shear ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("growth", [0.0, 0.3])
def test_a_frame_there_and_back_gives_friction_and_its_growth(growth):
    friction = ShearFriction(GROWING.stress, GROWING.angle, growth)
    counted, seeds = 0, 6
    for seed in range(seeds):
        found = shear(shear_loop_curve(FABRIC, friction, FRAME, SHEARED, noise=0.01, seed=seed))
        true = {"friction_stress": 5e3, "friction_angle": math.radians(1.0)}
        true |= {"friction_growth": growth} if growth else {}
        assert {own.name for own in found.parameters[5:]} == set(true) and not found.objections
        counted += inside(found, **true).sum()
        assert found["friction_stress"].value == pytest.approx(5e3, rel=0.1)
        law = scene_of(found).build()
        angles = np.radians([10.0, 25.0, 40.0])
        E = np.zeros((3, 6))
        E[:, 3] = np.sin(angles)
        expected = FABRIC.stress_and_tangent(E)[0][:, 3]
        assert law.stress_and_tangent(E)[0][:, 3] == pytest.approx(expected, rel=0.04)
    assert counted >= 0.85 * seeds * len(true)


def test_angle_and_stress_or_force_tell_the_same_as_travel_and_force(tmp_path):
    force = shear_loop_curve(FABRIC, GROWING, FRAME, SHEARED)
    angle = FRAME.shear_angle(SHEARED)
    stress = force / FRAME.force(angle, np.ones_like)
    by_travel, by_force, by_stress = (
        shear_loops(coupon(**columns), FRAME)
        for columns in (
            {"displacement": SHEARED, "force": force},
            {"shear angle": angle, "force": force},
            {"shear angle": angle, "shear stress": stress},
        )
    )
    np.testing.assert_array_equal(by_travel.elastic, by_force.elastic)
    lever = by_travel.lever / by_stress.lever
    np.testing.assert_allclose(by_travel.measured, lever * by_stress.measured, rtol=1e-12)
    file = tmp_path / "stress.csv"
    write_coupon(
        file, {"shear angle [deg]": np.degrees(angle), "shear stress [kPa]": 1e-3 * stress}
    )
    found = identify_shear_loop_file(file, {})
    assert found["friction_growth"].value == pytest.approx(0.3, rel=0.03)
    assert found["friction_angle"].value == pytest.approx(GROWING.angle, rel=0.05)


def test_shear_to_both_sides_is_one_law():
    top = float(FRAME.displacement(0.6))
    travel = course(0.0, top, 0.0, float(FRAME.displacement(-0.6)), 0.0, top, count=30)
    force = shear_loop_curve(FABRIC, GROWING, FRAME, travel, noise=0.005, seed=3)
    found = shear(force, travel)
    assert found["friction_stress"].value == pytest.approx(5e3, rel=0.1)
    assert found["friction_growth"].value == pytest.approx(0.3, abs=0.05)


def test_a_frame_whose_force_has_a_wrong_zero_or_that_only_pulls():
    force = shear_loop_curve(FABRIC, GROWING, FRAME, SHEARED, noise=0.005, seed=1)
    with pytest.raises(FitRefusedError, match="does not describe these data"):
        shear(force + 0.15 * force.max())
    there = shear(force[:41], SHEARED[:41])
    assert "no test turns back" in there.warnings[-1] and "friction" not in there.scene_entries
    beyond = course(0.0, float(FRAME.displacement(1.5)), 0.0)
    with pytest.raises(InputError, match="by more than 85 deg"):
        shear(np.ones(len(beyond)), beyond)
