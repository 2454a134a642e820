"""Identification gives back the parameters behind noisy curves, with honest intervals."""

import json
import math
import runpy
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.coupons.analytic import BiasExtension
from lcmchain.errors import InputError
from lcmchain.identification.bending import identify_bending
from lcmchain.identification.cantilever_tests import COLUMNS as BENDING_COLUMNS
from lcmchain.identification.cantilever_tests import fit_deflection_curve
from lcmchain.identification.compaction import identify_compaction
from lcmchain.identification.data import CouponData, read_coupon
from lcmchain.identification.files import draw_fit, scene_snippet, tables, write_identification
from lcmchain.identification.from_file import identify_compaction_file
from lcmchain.identification.regression import exponential, fit_linear
from lcmchain.identification.result import Band, Panel, Points
from lcmchain.identification.shear import COLUMNS as SHEAR_COLUMNS
from lcmchain.identification.shear import identify_shear
from lcmchain.identification.synthetic import (
    bias_extension_curve,
    cantilever_overhangs,
    cantilever_shape,
    compaction_curve,
    power_law_curve,
    preset_fabric,
    strip_bending_stiffness,
)
from lcmchain.scene import scene_from_text

EXAMPLE = Path(__file__).parents[2] / "examples" / "identification"
MD600 = preset_fabric("MD600")
LAW = MD600.law
SHEAR = np.array([LAW.s0, LAW.s1, LAW.s2, LAW.s3, LAW.s4])
COMPACTION = np.array([LAW.c0, LAW.c1, LAW.c2])
BENDING = np.array([LAW.B11, LAW.B22, LAW.B12])
SPECIMEN = BiasExtension(0.32, 0.16, MD600.thickness)
DISPLACEMENT = np.arange(0.5, 60.01, 0.5) * 1e-3
THICKNESSES = np.linspace(0.98e-3, 0.56e-3, 85)
SOLID_HEIGHT = MD600.areal_mass / MD600.fibre_density
AREAL_WEIGHT = 9.81 * MD600.areal_mass
ORIENTATIONS = np.radians(np.repeat([0.0, 45.0, 90.0], 5))
NOISE = 0.02
SEEDS = range(40)
# 34 or more of 40 intervals hold the truth in 99.7 % of all draws if each does in 95 %.
FEWEST_COVERED = 34


def coupon(**columns) -> CouponData:
    count = len(next(iter(columns.values())))
    return CouponData("data.csv", columns, np.arange(count) + 2, np.zeros(count, dtype=int))


def shear_result(*, displacement=DISPLACEMENT, specimen=SPECIMEN, noise=0.0, seed=0, **options):
    force = bias_extension_curve(MD600, specimen, displacement, noise=noise, seed=seed)
    return identify_shear(coupon(displacement=displacement, force=force), specimen, **options)


def compaction_result(pressure, thickness=THICKNESSES):
    return identify_compaction(
        coupon(thickness=thickness, pressure=pressure),
        thickness=MD600.thickness, solid_height=SOLID_HEIGHT,
    )  # fmt: skip


def bending_result(*, assumption="free-strip", orientation=ORIENTATIONS, noise=0.0, seed=0):
    overhang = cantilever_overhangs(
        MD600, orientation, areal_weight=AREAL_WEIGHT, assumption=assumption, noise=noise, seed=seed
    )
    return identify_bending(
        coupon(orientation=orientation, overhang=overhang), thickness=MD600.thickness,
        areal_weight=AREAL_WEIGHT, off_axis=assumption,
    )  # fmt: skip


def values(parameters) -> np.ndarray:
    return np.array([p.value for p in parameters])


def covered(parameters, truth) -> np.ndarray:
    return np.array([p.low <= true <= p.high for p, true in zip(parameters, truth, strict=True)])


# --- noise-free -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "width"), [(0.32, 0.16), (0.30, 0.10), (0.25, 0.05)])
def test_exact_force_gives_the_shear_polynomial(length, width):
    specimen = BiasExtension(length, width, MD600.thickness)
    displacement = np.linspace(0.005, 0.9, 60) * specimen.locking_displacement
    result = shear_result(specimen=specimen, displacement=displacement)
    assert values(result.parameters) == pytest.approx(SHEAR, rel=1e-9)
    assert result.r_squared == pytest.approx(1.0)


def test_recursion_agrees_with_the_force_up_to_interpolation():
    result = shear_result(method="recursion")
    assert values(result.parameters) == pytest.approx(SHEAR, rel=2e-3)


def test_tensor_convention_doubles_the_coefficients():
    result = shear_result(convention="tensor")
    assert values(result.parameters) == pytest.approx(2.0 * SHEAR, rel=1e-9)


def test_printed_recursion_gives_a_stiffer_law():
    """Half of zone B's power missing: 20 % more initial stiffness, and forces that do not fit."""
    result = shear_result(method="printed")
    assert result["s0"].value == pytest.approx(1.2 * LAW.s0, rel=5e-3)
    assert result.relative_noise > 0.05


def test_exact_pressure_gives_the_compaction_law():
    result = compaction_result(compaction_curve(MD600, THICKNESSES))
    assert values(result.parameters) == pytest.approx(COMPACTION, rel=1e-9)


def test_exact_power_law_gives_its_parameters():
    result = compaction_result(power_law_curve(THICKNESSES, 0.282, 0.0926, SOLID_HEIGHT))
    assert values(result.derived) == pytest.approx([0.282, 0.0926], rel=1e-9)


def test_published_compaction_law_follows_from_the_published_power_law():
    """Table B.2: c0, c1, c2 were fitted to A, B; both agree above a few kPa only."""
    thickness = np.linspace(0.92e-3, 0.60e-3, 60)
    result = compaction_result(power_law_curve(thickness, 0.282, 0.0926, SOLID_HEIGHT), thickness)
    assert values(result.parameters) == pytest.approx(COMPACTION, rel=0.06)
    assert result.relative_noise < 0.01
    assert any("residuals are correlated" in warning for warning in result.warnings)


@pytest.mark.parametrize("assumption", ["free-strip", "cylindrical"])
def test_exact_overhangs_give_the_bending_stiffness(assumption):
    result = bending_result(assumption=assumption)
    assert values(result.parameters) == pytest.approx(BENDING, rel=1e-9)


def test_exact_deflection_curve_gives_the_stiffness():
    stiffness = strip_bending_stiffness(MD600, 0.0, "free-strip")
    for overhang in (0.08, 0.16, 0.25):
        x, y = cantilever_shape(stiffness, AREAL_WEIGHT, overhang)
        found, _, _ = fit_deflection_curve(x, y, AREAL_WEIGHT)
        assert found == pytest.approx(stiffness, rel=5e-6)


# --- noise: coverage of the intervals -------------------------------------------------------------


def test_shear_intervals_cover_the_truth():
    results = [shear_result(noise=NOISE, seed=seed) for seed in SEEDS]
    hits = sum(covered(result.parameters, SHEAR) for result in results)
    assert hits.min() >= FEWEST_COVERED
    assert np.mean([r.relative_noise for r in results]) == pytest.approx(NOISE, rel=0.05)


def test_shear_intervals_are_no_wider_than_needed():
    """Over 400 curves the five intervals hold the truth in 95 % of the cases, not in all."""
    hits = sum(
        covered(shear_result(noise=NOISE, seed=seed).parameters, SHEAR) for seed in range(400)
    )
    assert np.all((hits >= 0.92 * 400) & (hits <= 0.975 * 400))


def test_bootstrap_intervals_of_the_recursion_cover_the_truth():
    hits = sum(
        covered(
            shear_result(
                noise=NOISE, seed=seed, method="recursion", bootstrap_count=150
            ).parameters,
            SHEAR,
        )
        for seed in SEEDS
    )
    assert hits.min() >= FEWEST_COVERED


def test_force_determines_the_law_better_than_the_recursion():
    """Measured over 40 curves: the errors of the direct fit are about 0.45 of the recursion's."""

    def errors(method):
        fits = (
            shear_result(noise=NOISE, seed=seed, method=method, bootstrap_count=0) for seed in SEEDS
        )
        return np.sqrt(np.mean([(values(fit.parameters) - SHEAR) ** 2 for fit in fits], axis=0))

    assert np.all(errors("force") < 0.6 * errors("recursion"))


def test_band_of_the_law_covers_the_true_law():
    """Pointwise, within the data and beyond; at a shear angle of 0 it is the interval of s0."""
    hits = 0
    for seed in SEEDS:
        result = shear_result(noise=NOISE, seed=seed)
        (band,) = result.panels[3].curves
        stiffness = 1e-6 * np.polynomial.polynomial.polyval(0.5 * np.sin(np.radians(band.x)), SHEAR)
        hits = hits + ((band.low <= stiffness) & (stiffness <= band.high))
        assert 1e6 * band.low[0] == pytest.approx(result["s0"].low, rel=1e-9)
    assert hits.min() >= FEWEST_COVERED


def test_compaction_intervals_cover_the_truth():
    hits = sum(
        covered(
            compaction_result(
                compaction_curve(MD600, THICKNESSES, noise=NOISE, seed=seed)
            ).parameters,
            COMPACTION,
        )
        for seed in SEEDS
    )
    assert hits.min() >= FEWEST_COVERED


def test_power_law_intervals_cover_the_truth():
    hits = sum(
        covered(
            compaction_result(
                power_law_curve(THICKNESSES, 0.282, 0.0926, SOLID_HEIGHT, noise=NOISE, seed=seed)
            ).derived,
            (0.282, 0.0926),
        )
        for seed in SEEDS
    )
    assert hits.min() >= FEWEST_COVERED


@pytest.mark.parametrize("assumption", ["free-strip", "cylindrical"])
def test_bending_intervals_cover_the_truth(assumption):
    hits = sum(
        covered(bending_result(assumption=assumption, noise=NOISE, seed=seed).parameters, BENDING)
        for seed in SEEDS
    )
    assert hits.min() >= FEWEST_COVERED


def test_error_of_a_deflection_curve_covers_the_truth():
    stiffness = strip_bending_stiffness(MD600, 0.0, "free-strip")
    hits = 0
    for seed in range(20):
        x, y = cantilever_shape(stiffness, AREAL_WEIGHT, 0.17, noise=0.003, seed=seed)
        found, error, _ = fit_deflection_curve(x, y, AREAL_WEIGHT)
        hits += abs(math.log(found / stiffness)) <= 2.02 * error
    assert 16 <= hits  # at 95 % each, 15 or fewer of 20 happen once in 390


# --- what the data do not tell --------------------------------------------------------------------


def test_law_stays_rising_where_the_data_would_let_it_fall():
    """Few angles and much noise: unconstrained the stress would fall beyond the data."""
    strain = np.linspace(0.0, 0.5, 2001)
    held = hits = 0
    for seed in SEEDS:
        result = shear_result(displacement=np.linspace(1e-3, 20e-3, 30), noise=0.05, seed=seed)
        tangent = sum((k + 1) * s * strain**k for k, s in enumerate(values(result.parameters)))
        assert tangent.min() > 0.0
        assert any("extrapolated" in warning for warning in result.warnings)
        hits = hits + covered(result.parameters, SHEAR)
        if any("held rising" in warning for warning in result.warnings):
            held += 1
            held_law = result
    read_back(held_law)  # the scene accepts it
    assert held >= 10
    assert hits.min() >= FEWEST_COVERED


def test_constrained_fit_is_the_best_of_all_that_keep_the_bound():
    generator = np.random.default_rng(3)
    design, data = generator.normal(size=(30, 3)), generator.normal(size=30) + 5.0
    bounds = (generator.normal(size=(40, 3)), np.full(40, -0.05))
    ones = np.zeros(3)
    fit = fit_linear(design, data, 1.0, at_least=bounds)
    free = fit_linear(design, data, 1.0)
    assert fit.constrained and not free.constrained
    assert np.min(bounds[0] @ fit.parameters - bounds[1]) >= -1e-10

    def cost(parameters):
        return np.sum((data - design @ parameters) ** 2)

    assert cost(free.parameters) < cost(fit.parameters) < cost(ones)
    # Convex problem: no feasible point nearby, and none towards the free optimum, is better.
    for _ in range(2000):
        nearby = fit.parameters + 0.05 * generator.normal(size=3)
        if np.all(bounds[0] @ nearby >= bounds[1]):
            assert cost(nearby) >= cost(fit.parameters) * (1.0 - 1e-12)


def test_narrow_compaction_range_leaves_the_growth_open():
    thickness = np.linspace(0.99e-3, 0.94e-3, 20)
    result = compaction_result(compaction_curve(MD600, thickness, noise=NOISE), thickness)
    assert not result["c1"].is_determined
    assert result["c0"].is_determined
    assert any("do not determine c1" in warning for warning in result.warnings)
    remarks = tables(result)[1].columns[-1]
    assert remarks.header == "remark" and "not determined" in remarks.cells


def test_parameters_that_are_all_determined_have_no_remarks():
    thickness = np.linspace(0.99e-3, 0.7e-3, 40)
    result = compaction_result(compaction_curve(MD600, thickness, noise=NOISE), thickness)
    assert all(column.header for column in tables(result)[1].columns)
    assert tables(result)[1].columns[-1].header == "95 % interval"


def test_thickness_above_the_initial_one_is_left_out_and_told():
    thickness = np.append([1.10e-3, 1.02e-3], THICKNESSES)
    pressure = np.append([1.0, 2.0], compaction_curve(MD600, THICKNESSES))
    result = compaction_result(pressure, thickness)
    assert values(result.parameters) == pytest.approx(COMPACTION, rel=1e-9)
    assert any("2 rows at or above" in warning for warning in result.warnings)


def test_a_pressure_far_below_zero_is_refused_and_a_little_noise_is_not(tmp_path):
    lines = (EXAMPLE / "compaction.csv").read_text(encoding="utf-8").splitlines()
    file = tmp_path / "compaction.csv"
    for pressure, wrong in (("-1", True), ("-1e-4", False)):
        changed = [*lines[:22], f"{lines[22].split(',')[0]},{pressure}", *lines[23:]]
        file.write_text("\n".join(changed), encoding="utf-8")
        if wrong:
            with pytest.raises(InputError, match='line 23, column "pressure": is negative'):
                identify_compaction_file(file, {})
        else:
            assert identify_compaction_file(file, {}).point_count > 20


def test_a_band_without_end_is_drawn_as_far_as_the_data_can_be_seen(tmp_path):
    """On a logarithmic axis; matplotlib finds no labels for one that reaches to infinity."""
    x = np.linspace(0.56, 0.98, 200)
    y, ratio = np.geomspace(4.0, 1e-7, 200), np.geomspace(1e13, 1e263, 200)[::-1]
    band = Band(x, y, "fit", y / ratio, y * ratio)
    panel = Panel("x", "y", (Points(x[::20], y[::20], "measured"),), (band,), log_y=True)
    result = compaction_result(compaction_curve(MD600, THICKNESSES))
    draw_fit(tmp_path / "fit.png", replace(result, panels=(panel, *result.panels[1:])))
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    assert exponential(1e4) == np.inf and exponential(0.0) == 1.0


def test_single_strips_give_values_without_intervals():
    result = bending_result(orientation=np.radians([0.0, 45.0, 90.0]))
    assert values(result.parameters) == pytest.approx(BENDING, rel=1e-9)
    assert all(math.isnan(p.low) for p in result.parameters)
    assert any("no intervals" in warning for warning in result.warnings)


def test_without_off_axis_strips_torsion_stays_open():
    result = bending_result(orientation=np.radians([0.0, 0.0, 90.0, 90.0]), noise=NOISE)
    assert [p.name for p in result.parameters] == ["C11", "C22"]
    assert any("C12 stays open" in warning for warning in result.warnings)
    read_back(result)


def test_the_other_assumption_on_off_axis_strips_is_reported():
    overhang = cantilever_overhangs(
        MD600, ORIENTATIONS, areal_weight=AREAL_WEIGHT, assumption="cylindrical"
    )
    data = coupon(orientation=ORIENTATIONS, overhang=overhang)
    sizes = {"thickness": MD600.thickness, "areal_weight": AREAL_WEIGHT}
    free = identify_bending(data, off_axis="free-strip", **sizes)
    assert free["C12"].value > LAW.B12
    assert any(f"{LAW.B12 * 1e-6:.4g} MPa" in warning for warning in free.warnings)
    narrow = cantilever_overhangs(MD600, ORIENTATIONS, areal_weight=AREAL_WEIGHT)
    with pytest.raises(InputError, match="softer than any C12"):
        identify_bending(
            coupon(orientation=ORIENTATIONS, overhang=narrow), off_axis="cylindrical", **sizes
        )


def test_one_deflection_curve_per_direction(tmp_path):
    rows = ["orientation [deg],x [mm],y [mm]"]
    for degrees in (0, 90):
        stiffness = strip_bending_stiffness(MD600, math.radians(degrees), "free-strip")
        x, y = cantilever_shape(stiffness, AREAL_WEIGHT, 0.17, noise=0.002, seed=degrees)
        order = np.maximum.accumulate(x) <= x  # measured points come in order of reach
        rows += [f"{degrees},{1e3 * a},{-1e3 * b}" for a, b in zip(x[order], y[order])]
    file = tmp_path / "curves.csv"
    file.write_text("\n".join(rows), encoding="utf-8")
    with pytest.raises(InputError, match="x.*falls again"):
        read_coupon(file, BENDING_COLUMNS)
    rows[0] += ",specimen"
    rows[1:] = [f"{row},{row.split(',')[0]}" for row in rows[1:]]
    file.write_text("\n".join(rows), encoding="utf-8")
    result = identify_bending(
        read_coupon(file, BENDING_COLUMNS), thickness=MD600.thickness, areal_weight=AREAL_WEIGHT
    )
    assert covered(result.parameters, BENDING[:2]).all()
    assert result["C11"].high < 1.05 * result["C11"].low
    assert "each deflection curve" in result.interval_method


def test_length_and_angle_of_a_tilting_test():
    result = identify_bending(
        coupon(
            orientation=np.radians([0.0, 0.0, 90.0]),
            length=np.array([0.1634310, 0.10, 0.1703021]),
            angle=np.radians([41.5, 13.8567, 41.5]),
        ),
        thickness=MD600.thickness, areal_weight=AREAL_WEIGHT,
    )  # fmt: skip
    # The second row is the tabulated chord angle at a load parameter of 2: D = w L³ / 2.
    second = AREAL_WEIGHT * 0.1**3 / 2.0 / (MD600.thickness**3 / 12.0)
    between = sorted([LAW.B11, second])
    assert between[0] < result["C11"].value < between[1]
    assert result["C22"].value == pytest.approx(LAW.B22, rel=1e-5)


# --- files and command line -----------------------------------------------------------------------

SCENE = """
[process]
time = "1 ms"
[blank]
size = ["20 mm", "20 mm"]
edge_length = "5 mm"
[material]
preset = "MD600"
"""


def read_back(result):
    """Read a scene with the identified parameters pasted below the preset."""
    return scene_from_text(SCENE + scene_snippet(result)).material


def test_scene_takes_the_identified_parameters():
    shear = shear_result(noise=NOISE, convention="tensor")
    membrane = read_back(shear).membrane
    assert membrane.shear_polynomial == pytest.approx(values(shear.parameters), rel=1e-9)
    assert membrane.shear_convention == "tensor"
    tested = SPECIMEN.shear_angle(DISPLACEMENT).max()
    assert membrane.shear_range == pytest.approx(tested, rel=1e-3)
    assert membrane.C11 == LAW.C11
    pressure = compaction_curve(MD600, THICKNESSES, noise=NOISE)
    compaction = compaction_result(pressure)
    read = read_back(compaction).compaction
    assert (read.c0, read.c1, read.c2) == pytest.approx(values(compaction.parameters), rel=1e-9)
    bending = bending_result(noise=NOISE)
    read = read_back(bending).bending
    assert (read.C11, read.C22, read.C12) == pytest.approx(values(bending.parameters), rel=1e-9)
    assert read.C13 == LAW.B13


def test_example_data_are_those_of_its_script(tmp_path):
    runpy.run_path(str(EXAMPLE / "make_data.py"))["write_data"](tmp_path)
    names = ("shear", "compaction", "bending", "viscous", "off-axis", "bending-loop", "shear-loop")
    for name in (f"{own}.csv" for own in names):
        again = np.loadtxt(tmp_path / name, delimiter=",", comments="#", skiprows=2)
        kept = np.loadtxt(EXAMPLE / name, delimiter=",", comments="#", skiprows=2)
        assert again == pytest.approx(kept, rel=1e-6)


@pytest.mark.parametrize(
    ("law", "truth"),
    [
        ("shear", dict(zip(("s0", "s1", "s2", "s3", "s4"), SHEAR))),
        ("compaction", dict(zip(("c0", "c1", "c2"), COMPACTION))),
        ("bending", dict(zip(("C11", "C22", "C12"), BENDING))),
        ("off-axis", {"across": 4e6}),
        ("viscous", {"viscosity": 2000.0, "modulus_1": 3e4, "relaxation_time_1": 2.0}),
        ("bending-loop", {"friction_moment": 0.02, "friction_curvature": 4.0}),
        ("shear-loop", {"friction_stress": 5e3, "friction_growth": 0.3}),
    ],
)
def test_command_identifies_the_example(law, truth, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(
            ["identify", law, str(EXAMPLE / f"{law}.csv"), "--out", str(tmp_path / "out"),
             *(("--thickness", "0.6 mm") if law == "off-axis" else ())]
        )  # fmt: skip
    assert not stop.value.code
    shown = capsys.readouterr().out
    assert "default" in shown and "95 % interval" in shown
    numbers = json.loads((tmp_path / "out" / "identification.json").read_text(encoding="utf-8"))
    for name, true in truth.items():
        low, high = numbers["parameters"][name]["interval_95"]
        assert low <= true <= high
    snippet = tomllib.loads((tmp_path / "out" / "parameters.toml").read_text(encoding="utf-8"))
    assert len(snippet["material"]) == (2 if law in ("viscous", "off-axis") else 1)
    assert (tmp_path / "out" / "fit.png").stat().st_size > 20_000
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "fit.png", "identification.json", "parameters.toml",
    ]  # fmt: skip


def test_sizes_enter_the_result(tmp_path):
    file = tmp_path / "shear.csv"
    shutil.copy(EXAMPLE / "shear.csv", file)
    results = []
    for thickness in ("1.004 mm", "2.008 mm"):
        out = tmp_path / thickness[:1]
        with pytest.raises(SystemExit) as stop:
            cli.main(["identify", "shear", str(file), "--out", str(out), "--thickness", thickness])
        assert not stop.value.code
        text = (out / "identification.json").read_text(encoding="utf-8")
        results.append(json.loads(text)["parameters"]["s0"]["value"])
    assert results[1] == pytest.approx(0.5 * results[0], rel=1e-9)


def test_files_hold_no_invalid_numbers(tmp_path):
    """Unknown intervals are null in JSON and a word in the comments."""
    result = bending_result(orientation=np.radians([0.0, 45.0, 90.0]))
    snippet, _, numbers = write_identification(result, tmp_path)
    parsed = json.loads(numbers.read_text(), parse_constant=lambda text: pytest.fail(text))
    assert parsed["parameters"]["C11"]["interval_95"] == [None, None]
    assert parsed["parameters"]["C11"]["determined"] is None
    assert "unknown" in snippet.read_text()


GOOD = "displacement [mm],force [N]\n" + "".join(f"{i},{0.3 * i}\n" for i in range(1, 12))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        (GOOD.replace("force", "forse"), 'no column "force"; did you mean "forse"'),
        (GOOD.replace(" [N]", ""), 'column "force" has no unit'),
        (GOOD.replace("[N]", "[mm]"), 'column "force": .* is of dimension length'),
        (GOOD.replace("[N]", "[Newtn]"), 'column "force": unknown unit'),
        (GOOD.replace("\n5,1.5", "\n5,nan"), 'line 6, column "force"'),
        (GOOD.replace("\n5,1.5", "\n5,"), 'line 6, column "force": has no value'),
        (GOOD.replace("\n5,1.5", "\n5"), 'line 6, column "force": has no value'),
        (GOOD.replace("\n5,1.5", "\n2,1.5"), 'line 6, column "displacement": falls again'),
        ("# note\n\n" + GOOD.replace("\n5,1.5", "\n5,x"), 'line 8, column "force": "x" is not'),
        (GOOD.replace(",", ";").replace("\n5;1.5", "\n5;1,5"), "write a decimal point"),
        (GOOD.replace("force [N]", "force [N],force [kN]"), 'two columns "force"'),
        ("".join(GOOD.splitlines(keepends=True)[:5]), "4 rows of data; at least 8"),
        (GOOD.replace("11,3.3", "70,3.3"), 'line 12, column "displacement": is 70 mm; the fibres'),
        (GOOD.replace(",", ",-").replace(",-force", ",force"), "force is not positive"),
        (GOOD.replace("\n5,1.5", "\n5,1e308"), 'line 6, column "force": 1e.308 is too large'),
        (GOOD.replace("\n5,1.5", "\n5,1e-320"), 'line 6, column "force": .* is too small'),
        (GOOD.replace("\n", ",1" * 300 + "\n"), "302 columns and 11 rows; at most 200"),
        (GOOD + "12,3.6\n" * 30_000, "2 columns and 30,011 rows; at most 200 and 20,000"),
        (GOOD.splitlines()[0] + "\n4,1.2" * 12, "forces at 1 unlike shear angles"),
        (GOOD + "#" * 21_000_000, "more than 20 MB"),
    ],
)
def test_wrong_files_are_told(text, message, tmp_path):
    file = tmp_path / "shear.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as wrong:
        identify_shear(read_coupon(file, SHEAR_COLUMNS, minimum_rows=8), SPECIMEN)
    assert str(file) in str(wrong.value)


def test_time_must_rise(tmp_path):
    file = tmp_path / "shear.csv"
    rows = "".join(f"{i},{0.3 * i},{i if i != 7 else 3}\n" for i in range(1, 12))
    file.write_text("displacement [mm],force [N],time [s]\n" + rows, encoding="utf-8")
    with pytest.raises(InputError, match='line 8, column "time": does not rise'):
        read_coupon(file, SHEAR_COLUMNS)


def test_units_separators_and_specimens(tmp_path):
    file = tmp_path / "shear.csv"
    rows = "".join(f"{specimen};{i / 10};{300 * i};7\n" for specimen in "ab" for i in range(1, 9))
    file.write_text("\ufeffSpecimen;Displacement (cm);Force (mN);Load cell\n" + rows, "utf-8")
    data = read_coupon(file, SHEAR_COLUMNS, minimum_rows=8)
    assert data["displacement"][:3] == pytest.approx([1e-3, 2e-3, 3e-3])
    assert data["force"][:2] == pytest.approx([0.3, 0.6])
    assert list(np.unique(data.specimen)) == [0, 1]
    assert data.unused == ("Load cell",)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["shear", "shear.csv", "--length", "320"], "--length"),
        (["shear", "shear.csv", "--width", "200 mm"], "twice as long as wide"),
        (["shear", "shear.csv", "--width", "200 mm"], "--length and --width: "),
        (["shear", "shear.csv", "--method", "guess"], "--method"),
        (["shear", "nothing.csv"], "there is no such file"),
        (["shear", "compaction.csv"], 'no column "displacement"'),
        (["compaction", "compaction.csv", "--thickness", "0.5 mm"], "lie below the initial"),
        (["compaction", "compaction.csv", "--noise-floor", "2"], "--noise-floor"),
        (["bending", "bending.csv", "--angle", "89 deg"], "--angle"),
        (["bending", "bending.csv", "--off-axis", "wide"], "--off-axis"),
    ],
)
def test_wrong_command_lines_are_wrong_input(arguments, message, tmp_path, capsys):
    law, file, *options = arguments
    with pytest.raises(SystemExit) as stop:
        cli.main(["identify", law, str(EXAMPLE / file), *options, "--out", str(tmp_path / "out")])
    assert stop.value.code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("one, other", [("SMALL", "LARGE"), ("LARGE", "SMALL")])
def test_the_law_of_one_size_predicts_the_force_of_the_other(one, other):
    """Measured curves of a weave in two sizes: 25 % up to 35 degrees of the pin-jointed net."""
    sizes = runpy.run_path(str(EXAMPLE / "two_sizes.py"))
    angle, off = sizes["deviations"](sizes[one], sizes["shear_law"](sizes[other]))
    assert np.abs(off[angle < sizes["COMPARED_UP_TO"]]).max() < 0.25
    assert np.abs(sizes["deviations"](sizes[one], sizes["shear_law"](sizes[one]))[1]).max() < 0.05
