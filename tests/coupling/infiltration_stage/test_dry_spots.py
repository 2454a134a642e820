"""Air that resin encloses, from the command line to its files: with and without its compression.

Resin runs ahead in a gap around the whole sheet, closes the vents at the other end, and leaves the
air in the middle without a way out. Compressed air keeps a bubble: of the air at 1 bar that the
front closed around, a quarter of the volume at the 4 bar of the gate (Boyle).
"""

import json

import numpy as np
import pytest
import xarray as xr

from lcmchain import cli
from lcmchain.coupling.infiltration.stage import FillOptions, fill_part
from lcmchain.report.chapters import dry_spot_rows

from .conftest import POROSITY, strip, write_forming

LENGTH, WIDTH, GAP, HEIGHT = 0.3, 0.2, 3e-3, 2e-3
CASE = """
time = "5000 s"
frames = 5
vent_pressure = "1 bar"
trapped_air = {0}
resin = {{ law = "constant", viscosity = "0.1 Pa*s" }}
[[gates]]
name = "left"
box = ["0 -1 -1 mm", "0 201 1 mm"]
pressure = "4 bar"
[[vents]]
name = "right"
box = ["300 -1 -1 mm", "300 201 1 mm"]
[[race_tracks]]
name = "gap"
rim = true
width = "3 mm"
"""
#: Pores of the sheet, and of the gap around it.
SHEET = LENGTH * WIDTH * HEIGHT * POROSITY
PORES = SHEET + 2.0 * (LENGTH + WIDTH) * GAP * HEIGHT


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """Folder and report with air that leaves, and with air that is compressed, by ``trapped``."""
    folder = tmp_path_factory.mktemp("dry")
    source = write_forming(folder / "forming.nc", *strip(18, 12, LENGTH, WIDTH))
    found = {}
    for trapped in (False, True):
        case = folder / f"{trapped}.toml"
        case.write_text(CASE.format(str(trapped).lower()))
        out = folder / str(trapped)
        with pytest.raises(SystemExit) as ended:
            cli.main(["fill", str(source), "--case", str(case), "--out", str(out), "-q"])
        assert not ended.value.code
        found[trapped] = out, json.loads((out / "infiltration_filling.json").read_text())
    return found


def test_the_enclosed_air_is_told_with_place_and_size_in_every_file(filled):
    for trapped, (out, report) in filled.items():
        (spot,) = report["dry_spots"]
        x, y, z = spot["place"]
        assert 0.1 < x < 0.2 and y == pytest.approx(WIDTH / 2) and z == pytest.approx(0.0, abs=1e-9)
        assert 0.5 * LENGTH * WIDTH < spot["area"] < LENGTH * WIDTH
        assert spot["pore_volume"] == pytest.approx(spot["area"] * HEIGHT * POROSITY, rel=0.02)
        assert 0.0 < spot["time"] < 1.0
        with xr.open_dataset(out / "infiltration_filling.nc", group="/dry_spots") as stored:
            assert stored["dry_spot"].values.tolist() == ["dry 1"]
            for name in ("time", "area", "pore_volume", "area_left", "pore_volume_left"):
                assert stored[f"dry_spot_{name}"].values.tolist() == [spot[name]]
            assert [float(stored[f"dry_spot_{a}"].values[0]) for a in "xyz"] == spot["place"]
        told = [w for w in report["warnings"] if w.startswith("dry 1: the front closes around")]
        assert len(told) == 1 and f"{1e3 * x:.1f}, {1e3 * y:.1f}, 0.0) mm" in told[0]
        assert ("stay dry" in told[0]) == trapped
        (row,) = dry_spot_rows(report)
        assert row[0] == "dry 1" and row[2] == f"{1e4 * spot['area']:.3g}"
        assert (out / "infiltration_filling_time.png").stat().st_size > 20_000


def test_air_that_vanishes_leaves_a_part_that_is_full(filled):
    out, report = filled[False]
    assert report["outcome"] == "filled" and report["dry_spots"][0]["pore_volume_left"] == 0.0
    assert report["resin_volume"] == pytest.approx(PORES, rel=1e-9)


def test_compressed_air_keeps_a_bubble_after_boyle(filled):
    out, report = filled[True]
    (spot,) = report["dry_spots"]
    assert report["outcome"] == "trapped" and report["time"] < 5000.0
    left = spot["pore_volume_left"]
    assert left == pytest.approx(spot["pore_volume"] / 4.0, rel=1e-6)
    assert report["resin_volume"] == pytest.approx(PORES - left, rel=1e-9)
    assert report["filled_share"] == pytest.approx(1.0 - left / PORES, rel=1e-9)
    assert report["balance_error"] < 1e-10
    with xr.open_dataset(out / "infiltration_filling.nc") as found:
        last = found.isel(time=-1)
        dry = last["fill_factor"].values < 1.0
        np.testing.assert_allclose(last["resin_pressure"].values, 4e5, rtol=1e-6)
        at = np.stack([found[f"sheet_node_{axis}"].values for axis in "xyz"], axis=1)
        assert np.abs(at[dry].mean(axis=0) - spot["place"]).max() < 0.03


def test_two_gates_that_meet_enclose_nothing_before_their_vent(kit, tmp_path):
    """From both ends to a vent in the middle: none is enclosed until the vent is reached."""
    ends = "".join(
        f'[[gates]]\nname = "g{x}"\nbox = ["{x} -1 -1 mm", "{x} 61 1 mm"]\npressure = "4 bar"\n'
        for x in (0, 300)
    )
    head = 'time = "500 s"\nvent_pressure = "1 bar"\ntrapped_air = true\n'
    head += 'resin = { law = "constant", viscosity = "0.1 Pa*s" }\n'
    plain = FillOptions(picture=False, vtu=False)
    for x, dry in ((150, 0), (75, 1)):
        vent = f'[[vents]]\nname = "v"\nbox = ["{x} -1 -1 mm", "{x} 61 1 mm"]\n'
        report = fill_part(
            kit.forming(), kit.case(head, ends, vent), name=f"a{x}", out_dir=tmp_path, options=plain
        )
        assert len(report.dry_spots) == dry
        assert (report.outcome == "filled") == (dry == 0)
    # The vent at 75 mm closes as the left front reaches it; the right one has come as far then.
    (spot,) = report.dry_spots
    assert spot["place"][0] == pytest.approx((0.075 + 0.225) / 2.0, abs=0.013)
    assert spot["pore_volume_left"] == pytest.approx(spot["pore_volume"] / 4.0, rel=1e-6)
