"""Zeros, slip and tear, range: what is added to a clean test comes out again, told and drawn."""

import json
from pathlib import Path

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.coupons.analytic import BiasExtension
from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.entering_rows import (
    Axes,
    RowChoice,
    contact_of,
    drops_of,
    entering_rows,
)
from lcmchain.identification.from_file import (
    identify_compaction_file,
    identify_off_axis_file,
    identify_shear_file,
    identify_viscous_file,
)
from lcmchain.identification.result import FitRefusedError
from lcmchain.identification.synthetic import (
    bias_extension_curve,
    compaction_curve,
    noisy,
    preset_fabric,
)
from lcmchain.quantities.units import FORCE, LENGTH

OFF_AXIS = Path(__file__).parents[2] / "examples" / "identification" / "off-axis.csv"
MD600 = preset_fabric("MD600")
SPECIMEN = BiasExtension(0.32, 0.16, MD600.thickness)
TRAVEL = np.linspace(0.0, 0.042, 43)  # a row per mm, with the zero
FORCES = np.append(0.0, bias_extension_curve(MD600, SPECIMEN, TRAVEL[1:]))
PULLED = Axes(Column("displacement", LENGTH, loading=1), Column("force", FORCE))
ZEROS = "force=0.31 N, displacement=7.5 mm"
NAMES = [f"s{k}" for k in range(5)]


def written(path, travel, force, specimen=None, names=("displacement [m]", "force [N]")):
    """Write rows with all their digits."""
    header = ",".join(names) + (",specimen" if specimen is not None else "")
    tails = [""] * len(travel) if specimen is None else [f",{name}" for name in specimen]
    rows = [f"{u!r},{f!r}{tail}" for u, f, tail in zip(travel.tolist(), force.tolist(), tails)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def coupon(travel, force):
    count = len(travel)
    columns = {"displacement": travel, "force": force}
    return CouponData("data.csv", columns, np.arange(count) + 2, np.zeros(count, dtype=int))


def slipped(travel, force, at, slip):
    """Let a clamp slip at a row: the specimen goes back by three rows, and is loaded again."""
    rows = np.r_[0 : at + 1, at - 3 : len(travel)]
    more = np.r_[np.zeros(at + 1), np.full(len(travel) - at + 3, slip)]
    return travel[rows] + more, force[rows]


def torn(travel, force):
    """Let the specimen tear behind the last row."""
    fall = force[-1] * np.array([0.7, 0.4, 0.2, 0.05])
    return np.r_[travel, travel[-1] + 1e-3 * np.arange(1, 5)], np.r_[force, fall]


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    path = tmp_path_factory.mktemp("clean") / "clean.csv"
    return identify_shear_file(written(path, TRAVEL, FORCES), {})


@pytest.fixture
def everything(tmp_path):
    """Return a test with an approach, both zeros off, a slip of 5 mm and a tear."""
    travel, force = torn(*slipped(TRAVEL, FORCES, 20, 5e-3))
    travel = np.r_[np.arange(-6.0, 0.0) * 1e-3, travel] + 0.0075
    return written(tmp_path / "raw.csv", travel, np.r_[np.zeros(6), force] + 0.31)


def assert_same(found, clean, relative=1e-9):
    for name in NAMES:
        assert found[name].value == pytest.approx(clean[name].value, rel=relative), name


# --- all of it ------------------------------------------------------------------------------------


def test_told_zeros_slip_and_tear_give_the_parameters_of_the_clean_test(everything, clean):
    choice = RowChoice(ZEROS, "slip,tear")
    found = identify_shear_file(everything, {}, rows=choice)
    assert_same(found, clean)
    told = {name: value for name, value, _ in found.inputs}
    assert told["slip"] == "5 mm" and told["zero of force"] == "reads 0.31 N"
    ahead, slip, tear = found.left_out
    assert ahead.why == "before contact" and ahead.lines.tolist() == list(range(2, 9))
    assert slip.why.startswith("slip: the force falls from") and "is back at 25 mm" in slip.why
    assert tear.why.startswith("tear: ") and tear.why.endswith("does not come back")
    # header, 6 rows ahead and the contact, 20 to the peak; then 3 below it; the last 4 are torn
    assert slip.lines.tolist() == [29, 30, 31] and tear.lines.tolist() == [55, 56, 57, 58]


def test_what_is_left_out_is_told_written_and_drawn(everything, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as stop:
        cli.main(
            ["identify", "shear", str(everything), "--out", str(out), "--zero", ZEROS,
             "--without", "slip,tear", "--range", "up to 40 mm"]
        )  # fmt: skip
    assert not stop.value.code
    numbers = json.loads((out / "identification.json").read_text(encoding="utf-8"))
    whys = [one["why"].split(":")[0] for one in numbers["left_out"]]
    assert whys == ["before contact", "slip", "tear", "outside the range"]
    assert numbers["left_out"][1]["lines"] == [29, 30, 31]
    snippet = (out / "parameters.toml").read_text(encoding="utf-8")
    assert "# left out: 3 rows" in snippet and "# slip: 5 mm (taken off" in snippet
    choice = RowChoice(ZEROS, "slip,tear", ("up to 40 mm",))
    found = identify_shear_file(everything, {}, rows=choice)
    grey = [points.label for points in found.panels[0].left_out]
    assert grey == [one.why for one in found.left_out]
    assert np.array_equal(found.panels[0].left_out[2].y, found.left_out[2].load)
    assert all(not panel.left_out for panel in found.panels[1:])


# --- zeros ----------------------------------------------------------------------------------------


def test_contact_is_found_where_the_line_of_the_first_loaded_rows_meets_the_zero(tmp_path):
    # of F = a x + b x², seen at h/2 and 3h/2 behind the contact, the line meets zero at
    # b x1 x2 / (a + b (x1 + x2))
    a, b, h = 2000.0, 3e5, 1e-3
    x = np.arange(30) * h - 9.5 * h
    force = np.where(x > 0.0, a * x + b * x * x, 0.0) + 0.7
    rows = entering_rows(coupon(x + 0.02, force), PULLED, RowChoice("contact"), 8)
    x1, x2 = 0.5 * h, 1.5 * h
    off = b * x1 * x2 / (a + b * (x1 + x2))
    assert rows.data["displacement"] == pytest.approx(x - off, abs=1e-12)
    assert rows.data["force"] == pytest.approx(force - 0.7, abs=1e-12)
    (ahead,) = rows.left_out
    assert ahead.why == "before contact" and len(ahead.lines) == 10
    assert [name for name, _, _ in rows.told] == [
        "zero of force",
        "zero of displacement",
        "left out",
    ]


def test_scatter_ahead_of_the_contact_is_no_load():
    generator = np.random.default_rng(4)
    x = np.linspace(-0.01, 0.03, 161)
    force = np.where(x > 0.0, 800.0 * x, 0.0) + 0.4 + 0.05 * generator.standard_normal(161)
    contact = contact_of(force)
    # mean of 40 rows and more, to 4 of its standard errors; a row seen at 5 of its scatter
    assert contact.load == pytest.approx(0.4, abs=4 * 0.05 / np.sqrt(40))
    assert 0.03 < contact.scatter < 0.07
    rows = entering_rows(coupon(x, force), PULLED, RowChoice("contact"), 8)
    zero = x[0] - rows.data["displacement"][0]
    assert abs(zero) < 2.5 * 5.0 * 0.05 / 800.0


def test_a_preload_is_taken_back_to_no_load(tmp_path):
    x = np.linspace(0.002, 0.02, 40)
    rows = entering_rows(coupon(x - 0.002, 900.0 * x), PULLED, RowChoice("preload"), 8)
    assert rows.data["displacement"] == pytest.approx(x, abs=1e-12)
    with pytest.raises(InputError, match="no preload; write --zero contact"):
        entering_rows(coupon(x, 900.0 * (x - x[0])), PULLED, RowChoice("preload"), 8)
    with pytest.raises(InputError, match="rises from the first row on.*--zero preload"):
        entering_rows(coupon(x, 900.0 * x), PULLED, RowChoice("contact"), 8)


# --- slip and tear --------------------------------------------------------------------------------


def test_a_slip_is_what_the_machine_travels_from_one_load_to_the_same():
    # straight rows, so that the line between two of them is exact where the load is back between
    x = np.linspace(0.0, 0.05, 51)
    back = np.r_[x[:21], x[16:] + 0.00875]
    force = 1000.0 * np.r_[x[:21], x[16:] + 0.0002]
    rows = entering_rows(coupon(back, force), PULLED, RowChoice(without="slip"), 8)
    assert rows.data["displacement"] == pytest.approx(1e-3 * rows.data["force"], abs=1e-12)
    assert dict(line[:2] for line in rows.told)["slip"] == "8.55 mm"
    assert len(rows.left_out[0].lines) == 4


def test_scatter_a_low_row_and_a_held_specimen_are_no_drops():
    x = np.linspace(0.001, 0.05, 200)
    assert not drops_of(x, noisy(900.0 * x, 0.02, 3))
    assert not drops_of(x, 900.0 * x * np.where(np.arange(200) == 120, 0.5, 1.0))
    held = np.r_[x, np.full(50, x[-1])]
    assert not drops_of(held, 900.0 * np.r_[x, x[-1] * np.exp(-np.linspace(0.0, 1.0, 50))])
    fall = np.r_[x, x[-1] + 1e-3 * np.arange(1, 4)]
    (tear,) = drops_of(fall, 900.0 * np.r_[x, 0.5 * x[-3:]])
    assert (tear.peak, tear.first, tear.back) == (199, 200, None)


def test_a_drop_is_told_where_nobody_asks(everything, clean, tmp_path):
    travel, force = slipped(TRAVEL, FORCES, 20, 4.5e-3)
    path = written(tmp_path / "slip.csv", travel, force)
    found = identify_shear_file(path, {})  # a slip of 9 % of the force is no reason to refuse
    assert found.warnings[-1].startswith("the force falls from 4.893 to 4.472 N behind 20 mm (line")
    assert found.warnings[-1].endswith("line 26): --without slip leaves that out")
    assert not found.left_out
    path = written(tmp_path / "torn.csv", *torn(TRAVEL, FORCES))
    with pytest.raises(FitRefusedError, match="does not come back: --without tear leaves that out"):
        identify_shear_file(path, {})


def test_what_is_not_there_changes_nothing(tmp_path, clean):
    path = written(tmp_path / "clean.csv", TRAVEL, FORCES)
    found = identify_shear_file(path, {}, rows=RowChoice(None, "slip,tear", ("0 mm to 1 m",)))
    assert [found[name] for name in NAMES] == [clean[name] for name in NAMES]
    assert found.left_out == () and found.panels[0].left_out == ()
    told = {name: value for name, value, _ in found.inputs}
    assert told["slip and tear"] == "none found" and told["range"] == "0 mm to 1 m"


# --- range ----------------------------------------------------------------------------------------


def test_a_range_takes_out_exactly_what_was_added(tmp_path, clean):
    travel = np.r_[TRAVEL, TRAVEL[-1] + 1e-3 * np.arange(1, 9)]
    wrong = np.r_[FORCES, FORCES[-1] * np.linspace(1.5, 4.0, 8)]
    path = written(tmp_path / "raw.csv", travel, wrong)
    found = identify_shear_file(path, {}, rows=RowChoice(ranges=("up to 42 mm",)))
    assert_same(found, clean)
    assert found.left_out[0].lines.tolist() == list(range(45, 53))
    assert identify_shear_file(path, {}, accept=True)["s4"].value > 2.0 * clean["s4"].value


def test_each_specimen_has_a_range_of_its_own(tmp_path, clean):
    travel, wrong = np.tile(TRAVEL, 2), np.r_[FORCES, np.where(TRAVEL > 0.0305, 0.1, 1.0) * FORCES]
    path = written(tmp_path / "two.csv", travel, wrong, ["left"] * 43 + ["right"] * 43)
    found = identify_shear_file(path, {}, rows=RowChoice(ranges=("right: up to 30 mm",)))
    assert_same(found, clean)
    assert found.left_out[0].specimen == "right" and len(found.left_out[0].lines) == 12


def test_a_gap_closes_through_its_range(tmp_path):
    t = MD600.thickness * np.linspace(0.99, 0.6, 60)
    p = compaction_curve(MD600, t) + 250.0
    t, p = np.r_[MD600.thickness * np.linspace(1.2, 1.02, 10), t], np.r_[np.full(10, 250.0), p]
    names = ("thickness [m]", "pressure [Pa]")
    clean = identify_compaction_file(
        written(tmp_path / "c.csv", t[10:], p[10:] - 250.0, names=names), {}
    )
    path = written(tmp_path / "raw.csv", t, np.where(t < 0.6 * t[10], 3.0, 1.0) * p, names=names)
    end = f"{0.63 * MD600.thickness!r} m"
    found = identify_compaction_file(path, {}, rows=RowChoice("contact", None, (f"up to {end}",)))
    for name in ("c0", "c1", "c2"):
        assert found[name].value == pytest.approx(clean[name].value, rel=1e-6)
    assert found.left_out[0].driven.max() < 0.63 * MD600.thickness
    grey = found.panels[0].left_out[0]
    assert grey.x == pytest.approx(1e3 * found.left_out[0].driven)


# --- wrong ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (RowChoice("touch"), '"touch" is no zero; write contact or preload or "force=20 N"'),
        (RowChoice("stress=1 MPa"), '"stress" has no zero here; write displacement or force'),
        (RowChoice("force=1 mm"), "--zero: .*force"),
        (RowChoice(without="creep"), '--without: "creep" is not slip, tear or "slip,tear"'),
        (
            RowChoice(ranges=("2 to 40 mm",)),
            "--range: in the axis of this test, displacement: .*no unit",
        ),
        (RowChoice(ranges=("40 mm",)), '"40 mm" is no range of the displacement'),
        (RowChoice(ranges=("up to 40 deg",)), "--range: in the axis of this test"),
        (RowChoice(ranges=("B: up to 40 mm",)), 'there is no specimen "B"; there are 1'),
        (RowChoice(ranges=("up to 5 mm",)), "6 of 43 rows are left; at least 8 are needed"),
    ],
)
def test_a_wrong_option_is_one_clear_error(tmp_path, choice, said):
    path = written(tmp_path / "clean.csv", TRAVEL, FORCES)
    with pytest.raises(InputError, match=said):
        identify_shear_file(path, {}, rows=choice)


def test_tests_that_remember_are_taken_from_their_beginning(tmp_path):
    path = tmp_path / "frames.csv"
    path.write_text(
        "displacement [mm],force [N],speed [mm/s]\n"
        + "\n".join(f"{k},{3.0 * k},2.0" for k in range(1, 40)), encoding="utf-8",
    )  # fmt: skip
    with pytest.raises(InputError, match='leaves out the beginning.*write "up to 40 mm"'):
        identify_viscous_file(path, {}, rows=RowChoice(ranges=("from 5 mm",)))
    with pytest.raises(InputError, match="later rows depend on a slip"):
        identify_viscous_file(path, {}, rows=RowChoice(without="slip"))


def test_strips_off_the_axis_take_the_same_options(tmp_path):
    lines = OFF_AXIS.read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    last = lines[-1].split(",")
    place = lines[start].split(",")
    way, load = (next(i for i, n in enumerate(place) if word in n) for word in ("displ", "force"))
    for k, share in enumerate((0.6, 0.2), 1):
        last[way], last[load] = str(float(last[way]) * (1.0 + 0.02 * k)), str(share)
        lines.append(",".join(last))
    path = tmp_path / "strips.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    clean = identify_off_axis_file(OFF_AXIS, {"thickness": "0.6 mm"})
    found = identify_off_axis_file(path, {"thickness": "0.6 mm"}, rows=RowChoice(without="tear"))
    assert [p.value for p in found.parameters] == [p.value for p in clean.parameters]
    assert len(found.left_out[0].lines) == 2 and found.left_out[0].specimen
