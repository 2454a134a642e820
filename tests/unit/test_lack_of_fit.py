"""A law that does not describe its data is told with its range, and taken only when accepted."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

from lcmchain import cli
from lcmchain.coupons.analytic import BiasExtension, overhang_at_angle
from lcmchain.identification.bending import identify_bending
from lcmchain.identification.compaction import identify_compaction
from lcmchain.identification.data import CouponData
from lcmchain.identification.files import scene_snippet
from lcmchain.identification.regression import falling_row, fit_linear, lack_of_fit
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.shear import identify_shear
from lcmchain.identification.synthetic import (
    cantilever_overhangs,
    compaction_curve,
    noisy,
    preset_fabric,
    write_coupon,
)
from lcmchain.materials.features.shear_compaction import free_shear_stress

MD600 = preset_fabric("MD600")
SPECIMEN = BiasExtension(0.32, 0.16, MD600.thickness)
WEIGHT = 9.81 * MD600.areal_mass


def coupon(specimen=None, **columns) -> CouponData:
    count = len(next(iter(columns.values())))
    specimen = np.zeros(count, dtype=int) if specimen is None else specimen
    return CouponData("data.csv", columns, np.arange(count) + 2, specimen)


# --- deviations, falls ----------------------------------------------------------------------------


def test_what_lies_to_one_side_over_a_part_of_the_range_is_no_scatter():
    x, one = np.linspace(0.0, 1.0, 60), np.zeros(60, dtype=int)
    data = noisy(1.0 + x, 0.03, 1)
    assert not lack_of_fit(x, data, 1.0 + x, one).is_systematic
    missed = lack_of_fit(x, data, (1.0 + x) * np.where(x > 0.7, 1.2, 1.0), one)
    assert missed.is_systematic
    assert np.all(missed.x[missed.off] > 0.65) and missed.off.sum() == 3
    assert "17 % above them" in missed.text("the law", "x", "m")
    # the same in all rows counts as much; less than a tenth does not matter
    assert lack_of_fit(x, data, 1.2 * (1.0 + x), one).off.all()
    assert not lack_of_fit(x, data, 1.08 * (1.0 + x), one).is_systematic


def test_scatter_between_specimens_is_no_lack_of_fit():
    x = np.tile(np.linspace(0.0, 1.0, 2000), 3)
    specimen = np.repeat(np.arange(3), 2000)
    stiffer = np.array([0.8, 1.0, 1.6])[specimen]
    data = noisy((1.0 + x) * stiffer, 0.01, 2)
    assert not lack_of_fit(x, data, 1.0 + x, specimen).is_systematic
    assert lack_of_fit(x, (1.0 + x) * 1.3, 1.0 + x, specimen).is_systematic


def test_rows_that_are_too_few_to_tell_scatter_raise_no_objection():
    x, one = np.array([0.0, 0.8, 1.6]), np.zeros(3, dtype=int)
    assert not lack_of_fit(x, np.array([1.0, 2.0, 1.0]), np.ones(3), one).is_systematic


@pytest.mark.parametrize(
    ("load", "row"),
    [
        (np.append(np.arange(1.0, 20.0), [2.0, 0.5]), 19),
        (np.append(np.arange(1.0, 20.0), 2.0), 19),
        (np.arange(1.0, 20.0), None),
        (np.append(np.arange(1.0, 20.0), 18.0), None),  # less than a tenth
        (np.r_[1.0, 2.0, 9.0, 4.0, 5.0, 6.0], None),  # one row too high
        (np.where(np.arange(20) == 8, 3.0, np.arange(1.0, 21.0)), 8),
        (np.array([5.0, 1.0]), None),
    ],
)
def test_a_load_that_falls_is_found_at_its_row(load, row):
    assert falling_row(load, np.zeros(len(load), dtype=int)) == row


def test_a_fall_for_good_is_one_that_lasts():
    one, rising = np.zeros(40, dtype=int), np.arange(1.0, 41.0)
    dip = np.where(np.abs(rising - 20.0) < 2.0, 5.0, rising)
    assert falling_row(dip, one) is not None
    assert falling_row(dip, one, for_good=True) is None
    assert falling_row(np.where(rising < 40.0, rising, 5.0), one, for_good=True) is None
    assert falling_row(np.where(rising < 30.0, rising, 20.0), one, for_good=True) == 29


def test_scatter_is_no_fall_and_specimens_are_looked_at_one_by_one():
    rising, one = np.linspace(1.0, 3.0, 60), np.zeros(60, dtype=int)
    for seed in range(200):
        assert falling_row(noisy(rising, 0.06, seed), one) is None
    assert falling_row(np.tile(rising, 2), np.repeat([0, 1], 60)) is None
    torn = np.append(np.tile(rising, 2), 0.1)
    assert falling_row(torn, np.append(np.repeat([0, 1], 60), 1)) == 120


def test_residuals_that_a_block_shares_widen_the_intervals():
    """Blocks that err as one are as many measurements as there are blocks."""
    generator = np.random.default_rng(4)
    blocks = np.repeat(np.arange(10), 30)
    errors, estimates, told = 0.1 * generator.standard_normal((300, 10)), [], []
    for error in errors:
        fit = fit_linear(np.ones((300, 1)), 1.0 + error[blocks], 1.0)
        estimates.append(fit.parameters[0])
        told.append(replace(fit, blocks=blocks).half_widths()[0])
        assert told[-1] > 3.0 * fit.half_widths()[0]
    covered = np.mean(np.abs(np.array(estimates) - 1.0) <= told)
    assert 0.9 <= covered <= 0.99


# --- shear ----------------------------------------------------------------------------------------


def pulled(angle, *, slips_at=math.inf, noise=0.01):
    """Displacement and force of MD600 whose fabric shears by a seventh of the net beyond slip."""
    sheared = np.minimum(angle, slips_at) + 0.15 * np.maximum(angle - slips_at, 0.0)
    force = SPECIMEN.force(sheared, lambda g: free_shear_stress(MD600, g))
    return coupon(displacement=SPECIMEN.displacement(angle), force=noisy(force, noise, 5))


def test_slip_is_told_and_cuts_the_range_of_the_shear_law():
    data = pulled(np.radians(np.linspace(1.0, 80.0, 80)), slips_at=math.radians(50.0))
    with pytest.raises(FitRefusedError, match="data.csv: the shear law does not describe") as told:
        identify_shear(data, SPECIMEN)
    text = str(told.value)
    assert "reaches 80.0 deg, which no fabric shears to" in text
    assert "the yarns slip there" in text and "--accept" in text
    result = identify_shear(data, SPECIMEN, accept=True)
    end = float(result.scene_entries["shear_range"].strip('"').split()[0])
    assert 45.0 < end < 55.0
    assert f"rows up to {end:.1f} deg" in text
    sound = pulled(np.radians(np.linspace(1.0, end, 60)))
    assert not identify_shear(sound, SPECIMEN).objections


def test_a_net_beyond_any_shear_of_fabrics_is_told_where_the_forces_look_sound():
    data = pulled(np.radians(np.linspace(1.0, 75.0, 80)), noise=0.0)
    with pytest.raises(FitRefusedError, match="reaches 75.0 deg") as told:
        identify_shear(data, SPECIMEN)
    assert "describes them" in str(told.value) and "does not follow" not in str(told.value)
    entries = identify_shear(data, SPECIMEN, accept=True).scene_entries
    assert 69.0 < float(entries["shear_range"].strip('"').split()[0]) <= 70.0


@pytest.mark.parametrize("method", ["force", "recursion"])
def test_a_torn_strip_is_told_at_its_line(method):
    sound = pulled(np.radians(np.linspace(1.0, 45.0, 40)))
    force = sound["force"].copy()
    force[-2:] = 1.0, 0.2
    torn = coupon(displacement=sound["displacement"], force=force)
    with pytest.raises(
        FitRefusedError, match=r"the force falls .* at line 40 \(43\.9 deg\)"
    ) as told:
        identify_shear(torn, SPECIMEN, method=method)
    assert "a fit of the rows up to 42.7 deg" in str(told.value).lower()
    assert "line 39" in str(told.value)
    kept = identify_shear(sound.keep(np.arange(40) < 38), SPECIMEN, method=method)
    accepted = identify_shear(torn, SPECIMEN, method=method, accept=True)
    assert accepted.scene_entries["shear_range"] == '"42.74 deg"'
    for name in ("s0", "s2", "s4"):
        width = accepted[name].high - accepted[name].low
        assert width > 3.0 * (kept[name].high - kept[name].low)


def test_the_band_of_a_law_that_misses_its_data_reaches_to_them():
    """A force that steps up, which no smooth polynomial follows."""
    angle = np.radians(np.linspace(1.0, 50.0, 60))
    sound = pulled(angle)
    stepped = sound["force"] + np.where(angle > math.radians(30.0), 8.0, 0.0)
    data = coupon(displacement=sound["displacement"], force=stepped)
    with pytest.raises(FitRefusedError, match="does not follow the data"):
        identify_shear(data, SPECIMEN)
    result = identify_shear(data, SPECIMEN, accept=True)
    (band,) = result.panels[0].curves
    x = 1e3 * data["displacement"]
    low, high = np.interp(x, band.x, band.low), np.interp(x, band.x, band.high)
    assert np.mean((low <= stepped) & (stepped <= high)) > 0.9


# --- compaction -----------------------------------------------------------------------------------


def compacted(pressure, thickness, **options):
    return identify_compaction(
        coupon(thickness=thickness, pressure=pressure), thickness=MD600.thickness,
        solid_height=MD600.areal_mass / MD600.fibre_density, **options,
    )  # fmt: skip


def test_a_pressure_that_falls_or_that_the_law_misses_is_told():
    thickness = np.linspace(0.98e-3, 0.56e-3, 60)
    sound = compaction_curve(MD600, thickness, noise=0.01)
    fallen = np.append(sound[:-2], [0.2 * sound[-3], 0.1 * sound[-3]])
    with pytest.raises(FitRefusedError, match=r"the pressure falls .* at line 60 ") as told:
        compacted(fallen, thickness)
    assert "fit of the rows from 0.98 mm to 0.57" in str(told.value).lower()
    stopped = np.where(thickness > 0.7e-3, sound, 4.0 * sound)  # against a spacer from there on
    with pytest.raises(FitRefusedError, match="the law does not follow the data"):
        compacted(stopped, thickness)
    accepted = compacted(stopped, thickness, accept=True)
    assert any(text.startswith("accepted although the law") for text in accepted.warnings)
    sound = compacted(sound, thickness)
    assert not sound.objections
    for name in ("c0", "c2"):
        width = accepted[name].high - accepted[name].low
        assert width > 2.0 * (sound[name].high - sound[name].low)


# --- bending --------------------------------------------------------------------------------------


def limp_strip(overhang=0.25, weight=13.6, points=51):
    """Deflection curve x, y [m] of a strip that is stiff at first, then limp; M / kappa from clamp
    to tip [N m]."""

    def moment(curvature):
        return 0.23 * (1.0 - np.exp(-curvature / 0.6)) + 0.008 * curvature

    known = np.append(0.0, np.geomspace(1e-6, 400.0, 2000))
    count = 1000
    arc = np.linspace(0.0, overhang, count + 1)

    def shape(tip):
        slope, bend, turned = tip, 0.0, [tip]
        step = overhang / count
        for i in range(count):
            bend += weight * (i + 0.5) * step * math.cos(slope) * step
            slope -= step * np.interp(bend, moment(known), known)
            turned.append(slope)
        return np.array(turned)[::-1]

    slope = shape(brentq(lambda tip: shape(tip)[0], 0.01, 1.5, xtol=1e-6))
    x = cumulative_trapezoid(np.cos(slope), arc, initial=0.0)
    y = cumulative_trapezoid(np.sin(slope), arc, initial=0.0)
    at_clamp = weight * np.trapezoid(x, arc)
    clamp = at_clamp / np.interp(at_clamp, moment(known), known)
    chosen = np.linspace(0, count, points).astype(int)
    return x[chosen], y[chosen], (clamp, 0.23 / 0.6 + 0.008)


def test_a_stiffness_that_changes_along_the_strip_is_told_with_its_span():
    x, y, (least, largest) = limp_strip()
    assert largest / least > 10.0
    curves = coupon(
        specimen=np.repeat([0, 1], len(x)), orientation=np.repeat([0.0, 0.5 * np.pi], len(x)),
        x=np.tile(x, 2), y=np.tile(-y, 2),
    )  # fmt: skip
    sizes = {"thickness": MD600.thickness, "areal_weight": 13.6}
    with pytest.raises(FitRefusedError, match="M/kappa of the deflection curve from line 2 on"):
        identify_bending(curves, **sizes)
    result = identify_bending(curves, accept=True, **sizes)
    for name in ("D(0 deg)", "D(90 deg)"):
        assert result[name].low == pytest.approx(least, rel=0.1)
        assert result[name].high > 0.8 * largest
        assert not result[name].is_determined
    assert "widened to the stiffnesses" in result.interval_method


def test_a_stiffness_that_changes_with_the_length_is_told():
    """Tilting test of short and long strips, the short ones twice as stiff."""
    length = np.tile(np.linspace(0.10, 0.20, 12), 2)
    orientation = np.repeat([0.0, 0.5 * np.pi], 12)
    stiffness = 3e-3 * np.where(length < 0.15, 2.0, 1.0)
    angle = np.array([
        brentq(lambda a, D=D, L=L: float(overhang_at_angle(D, WEIGHT, a)) - L, 0.02, 1.4)
        for D, L in zip(stiffness, length)
    ])  # fmt: skip
    data = coupon(orientation=orientation, length=noisy(length, 0.005, 3), angle=angle)
    sizes = {"thickness": MD600.thickness, "areal_weight": WEIGHT}
    with pytest.raises(FitRefusedError, match="the stiffness does not follow the data: .* length"):
        identify_bending(data, **sizes)
    wide = identify_bending(data, accept=True, **sizes)["D(0 deg)"]
    assert wide.high > 1.3 * wide.low


def test_orientations_that_three_stiffnesses_do_not_describe_are_told():
    degrees = np.repeat([0.0, 22.5, 45.0, 67.5, 90.0], 4)
    overhang = cantilever_overhangs(
        MD600, np.radians(degrees), areal_weight=WEIGHT, noise=0.005, seed=1
    )
    sizes = {"thickness": MD600.thickness, "areal_weight": WEIGHT}
    data = {"orientation": np.radians(degrees), "overhang": overhang}
    assert not identify_bending(coupon(**data), **sizes).objections
    data["overhang"] = overhang * np.where(degrees == 22.5, 1.25, 1.0)
    with pytest.raises(FitRefusedError, match=r"around the orientation = 22\.5 deg"):
        identify_bending(coupon(**data), **sizes)


# --- command line ---------------------------------------------------------------------------------


def test_the_command_takes_such_a_fit_only_with_accept(tmp_path, capsys):
    force = pulled(np.radians(np.linspace(1.0, 45.0, 40)))
    file, out = tmp_path / "torn.csv", tmp_path / "out"
    values = np.where(np.arange(40) < 38, force["force"], 0.5)
    write_coupon(file, {"displacement [mm]": 1e3 * force["displacement"], "force [N]": values})
    for accept, code in (([], 2), (["--accept"], 0)):
        with pytest.raises(SystemExit) as stop:
            cli.main(["identify", "shear", str(file), "--out", str(out), *accept])
        assert (stop.value.code or 0) == code
        shown = capsys.readouterr()
        assert "the force falls" in " ".join((shown.out + shown.err).split())
        assert out.exists() == bool(accept)
    numbers = json.loads((out / "identification.json").read_text(encoding="utf-8"))
    assert "the force falls" in numbers["objections"][0] and "describes them" in numbers["holds"]
    assert "# Note: accepted although" in (out / "parameters.toml").read_text(encoding="utf-8")


def test_a_refused_fit_can_be_looked_at():
    data = pulled(np.radians(np.linspace(1.0, 75.0, 40)), noise=0.0)
    with pytest.raises(FitRefusedError) as told:
        identify_shear(data, SPECIMEN)
    assert told.value.exit_code == 2
    assert "shear_polynomial" in scene_snippet(told.value.result)
