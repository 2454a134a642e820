"""Coupon tests that measure another quantity than usual: shear angle, frame, fibre volume fraction.

Each comes from the same law as the usual file, so that the parameters must be the same.
"""

import numpy as np
import pytest

from lcmchain.coupons.analytic import BiasExtension, PictureFrame
from lcmchain.errors import InputError
from lcmchain.identification.entering_rows import RowChoice
from lcmchain.identification.from_file import identify_compaction_file, identify_shear_file
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.synthetic import (
    bias_extension_curve,
    compaction_curve,
    noisy,
    preset_fabric,
)
from lcmchain.materials.features.shear_compaction import free_shear_stress

MD600 = preset_fabric("MD600")
STRIP = BiasExtension(0.32, 0.16, MD600.thickness)
FRAME = PictureFrame(0.15, MD600.thickness)
SOLID = MD600.areal_mass / MD600.fibre_density
NAMES = [f"s{k}" for k in range(5)]


def written(path, **columns):
    """Write columns with all their digits; a name as shear_angle__deg has its unit behind it."""
    header = [name.replace("__", " [").replace("_", " ") + "]" for name in columns]
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    text = [",".join(header), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


def frame_force(angle):
    return FRAME.force(angle, lambda g: free_shear_stress(MD600, g))


def assert_same(found, other, names=NAMES, relative=1e-9):
    for name in names:
        assert found[name].value == pytest.approx(other[name].value, rel=relative), name


def test_a_measured_angle_gives_the_law_that_its_displacement_gives(tmp_path):
    way = np.linspace(0.0, 0.042, 60)[1:]
    force, angle = bias_extension_curve(MD600, STRIP, way), STRIP.shear_angle(way)
    usual = identify_shear_file(
        written(tmp_path / "u.csv", displacement__m=way, force__N=force), {}
    )
    by_angle = written(tmp_path / "a.csv", shear_angle__rad=angle, force__N=force)
    found = identify_shear_file(by_angle, {})
    assert_same(found, usual)
    assert found.panels[0].x_label == "shear angle [deg]"
    assert found.panels[0].points[0].x == pytest.approx(np.degrees(angle))
    # yarns slip: the machine travels farther than the net, which the camera does not see
    both = written(
        tmp_path / "b.csv", displacement__m=way * (1.0 + 10.0 * way), shear_angle__rad=angle,
        force__N=force,
    )  # fmt: skip
    assert_same(identify_shear_file(both, {}, measured_angle=True), usual)
    by_way = identify_shear_file(both, {}, accept=True)
    assert by_way["s0"].value < 0.95 * usual["s0"].value


def test_a_measured_angle_is_cut_and_refused_in_its_own_axis(tmp_path):
    angle = np.radians(np.linspace(1.0, 40.0, 60))
    force = STRIP.force(angle, lambda g: free_shear_stress(MD600, g))
    bent = np.where(angle > np.radians(30.0), 0.4, 1.0) * force
    path = written(tmp_path / "a.csv", shear_angle__rad=angle, force__N=bent)
    with pytest.raises(FitRefusedError, match=r"rows up to 29\.\d deg \(line 4\d\) describes"):
        identify_shear_file(path, {})
    found = identify_shear_file(path, {}, rows=RowChoice(ranges=("up to 30 deg",)))
    assert [found[name].value for name in NAMES] == pytest.approx(MD600_POLYNOMIAL, rel=1e-8)
    assert found.panels[0].left_out[0].x.min() > 30.0
    wrong = written(tmp_path / "w.csv", shear_angle__deg=np.degrees(angle) * 3.0, force__N=force)
    with pytest.raises(InputError, match='line 44, column "shear angle": is more than 85 deg'):
        identify_shear_file(wrong, {})


MD600_POLYNOMIAL = [getattr(MD600.law, name) for name in NAMES]


@pytest.mark.parametrize("by", ["displacement__mm", "shear_angle__deg"])
def test_a_picture_frame_gives_the_law_by_crosshead_and_by_angle(tmp_path, by):
    angle = np.radians(np.linspace(0.5, 50.0, 80))
    x = np.degrees(angle) if by == "shear_angle__deg" else 1e3 * FRAME.displacement(angle)
    path = written(tmp_path / "f.csv", **{by: x, "force__N": frame_force(angle)})
    found = identify_shear_file(path, {"side": "150 mm"}, test="picture-frame")
    assert [found[name].value for name in NAMES] == pytest.approx(MD600_POLYNOMIAL, rel=1e-8)
    # the stress that is drawn is that of the law, without a recursion
    stress = found.panels[1].points[0]
    assert 1e6 * stress.y == pytest.approx(free_shear_stress(MD600, angle), rel=1e-9)
    scattered = written(
        tmp_path / "n.csv", **{by: x, "force__N": noisy(frame_force(angle), 0.01, 2)}
    )
    rough = identify_shear_file(scattered, {"side": "150 mm"}, test="picture-frame")
    assert all(rough[n].low < v < rough[n].high for n, v in zip(NAMES, MD600_POLYNOMIAL))


def test_sizes_and_methods_of_another_test_are_refused(tmp_path):
    angle = np.radians(np.linspace(1.0, 40.0, 20))
    path = written(tmp_path / "f.csv", shear_angle__rad=angle, force__N=frame_force(angle))
    with pytest.raises(InputError, match="--width: is no size of this --test"):
        identify_shear_file(path, {"width": "0.1 m"}, test="picture-frame")
    with pytest.raises(InputError, match="--side: is no size of this --test"):
        identify_shear_file(path, {"side": "0.1 m"})
    with pytest.raises(InputError, match="--method: a picture frame needs no recursion"):
        identify_shear_file(path, {}, test="picture-frame", method="recursion")
    with pytest.raises(InputError, match='--test: "frame" must be one of'):
        identify_shear_file(path, {}, test="frame")


@pytest.mark.parametrize(("unit", "factor"), [("pc", 100.0), ("1", 1.0)])
def test_pressure_over_fibre_volume_fraction_gives_the_law_over_thickness(tmp_path, unit, factor):
    t = MD600.thickness * np.linspace(0.98, 0.6, 50)
    p = compaction_curve(MD600, t)
    usual = identify_compaction_file(
        written(tmp_path / "t.csv", thickness__m=t, pressure__Pa=p), {}
    )
    path = written(
        tmp_path / "f.csv", **{f"fibre_volume_fraction__{unit}": factor * SOLID / t}, pressure__Pa=p
    )
    path.write_text(path.read_text(encoding="utf-8").replace("[pc]", "[%]"), encoding="utf-8")
    found = identify_compaction_file(path, {})
    assert_same(found, usual, ("c0", "c1", "c2", "A", "B"), 1e-7)
    end = 100.0 * SOLID / t[30]
    cut = identify_compaction_file(path, {}, rows=RowChoice(ranges=(f"up to {end:.12g} %",)))
    assert cut.point_count == 31
    grey = cut.panels[0].left_out[0]  # drawn over the thickness
    assert grey.x == pytest.approx(1e3 * t[31:]) and grey.y == pytest.approx(1e-6 * p[31:])


def test_a_fraction_above_one_and_another_unit_are_refused(tmp_path):
    t = MD600.thickness * np.linspace(0.98, 0.6, 50)
    p = compaction_curve(MD600, t)
    path = written(tmp_path / "f.csv", fibre_volume_fraction__1=100.0 * SOLID / t, pressure__Pa=p)
    with pytest.raises(InputError, match="fibre volume fraction"):
        identify_compaction_file(path, {})
    path = written(tmp_path / "g.csv", fibre_volume_fraction__mm=SOLID / t, pressure__Pa=p)
    with pytest.raises(InputError, match='"mm" is no unit of a fraction; write .*%'):
        identify_compaction_file(path, {})
