"""The infiltration stage from end to end: a strip with a known answer, its files, its ends."""

import json
import os
import signal
import xml.etree.ElementTree as ET
from dataclasses import fields, replace
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.infiltration import picture
from lcmchain.coupling.infiltration.files import read_checkpoint
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.report import filling_report
from lcmchain.coupling.infiltration.results import FillingRecord
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import (
    FillOptions,
    checkpoint_file,
    fill,
    fill_part,
    fingerprint_of,
    write_filling,
)
from lcmchain.errors import InputError, SimulationInterrupted
from lcmchain.report.chapters import filling_rows

from .conftest import (
    FILL_TIME,
    GATE,
    HEAD,
    LENGTH,
    PERMEABILITY,
    POROSITY,
    VENT,
    VISCOSITY,
    WIDTH,
    strip,
    write_forming,
)

PORES = LENGTH * WIDTH * 2e-3 * POROSITY
PLAIN = FillOptions(picture=False, vtu=False)


@pytest.fixture(scope="module")
def strip_result(tmp_path_factory):
    """Report and folder of a strip that is filled with everything written."""
    folder = tmp_path_factory.mktemp("strip")
    source = write_forming(folder / "forming.nc", *strip())
    from lcmchain.scene import infiltration_from_text

    case = infiltration_from_text(HEAD + 'animation = "gif"\n' + GATE + VENT)
    return fill_part(source, case, name="strip", out_dir=folder), folder


def test_the_strip_fills_as_the_closed_formula_says(strip_result):
    report, folder = strip_result
    assert report.outcome == "filled" and report.warnings == []
    assert report.filled_share == pytest.approx(1.0, abs=1e-9)
    assert report.time == pytest.approx(FILL_TIME, rel=0.02)
    assert report.pore_volume == pytest.approx(PORES, rel=1e-12, abs=0.0)
    assert report.resin_mass == pytest.approx(1100.0 * PORES, rel=1e-9)
    assert report.balance_error < 1e-10
    assert report.gates["left"]["pressure_max"] == pytest.approx(1e5)
    assert f"filled after {report.time:.4g} s" in report.summary()


def test_a_title_does_not_say_infiltration_twice(kit, tmp_path):
    """It is the name of a filling that is given none."""
    filled = fill(read_formed_part(kit.forming()), kit.case(HEAD, GATE, VENT))
    report = filling_report("infiltration", filled)
    write_filling(tmp_path / "a.nc", filled, report)
    with xr.open_dataset(tmp_path / "a.nc") as found:
        assert found.attrs["title"] == "strip: infiltration"


@pytest.mark.parametrize(("outcome", "told"), [("filled", "239.8 s"), ("reached", "240.6 s")])
def test_the_picture_of_a_full_part_tells_when_the_last_node_filled(monkeypatch, outcome, told):
    """The last step ends later, and what presses on a part goes on: no end of the filling."""
    drawn = []
    monkeypatch.setattr(picture, "_draw", lambda *given, **_: drawn.append(given[5]))
    filled = SimpleNamespace(
        fill_time=np.array([0.0, 239.8]), time=np.array([0.0, 240.6]),
        is_filled=outcome == "filled",
        history=SimpleNamespace(filled_share=np.array([0.0, 1.0])),
    )  # fmt: skip
    picture.draw_fill_time("none.png", filled, "part")
    assert drawn == [f"part  ·  100 % filled after {told}"]


def test_every_file_is_there_and_the_report_is_the_json(strip_result):
    report, folder = strip_result
    for name in report.files.values():
        assert (folder / name).is_file(), name
    assert set(report.files) == {
        "netcdf", "vtu", "series", "report", "fill_time", "pressure", "curves", "film",
    }  # fmt: skip
    assert json.loads((folder / "strip_filling.json").read_text()) == report.as_dict()
    assert not checkpoint_file(folder, "strip").exists()


def test_fields_hold_what_their_names_say(strip_result):
    report, folder = strip_result
    with xr.open_dataset(folder / "strip_filling.nc") as found:
        x = found["sheet_node_x"].values
        # x_f² = 2 K p t / (porosity viscosity): the front passes a place after x² / L² of the time
        inner = (x > 0.06) & (x < 0.29)
        passed = found["fill_time"].values[inner]
        assert passed == pytest.approx(FILL_TIME * (x[inner] / LENGTH) ** 2, rel=0.1)
        share = found["resin_mass"].sum("sheet_node").values / (1100.0 * PORES)
        assert share[0] == 0.0 and np.all(np.diff(share) > 0.0)
        assert share[-1] == pytest.approx(1.0, rel=1e-9)
        assert np.all(share[1:-1] >= np.arange(1, 5) / 5.0 - 1e-9)  # frames at equal shares
        middle = int(np.argmin(np.abs(share - 0.6)))
        wet = x < 0.9 * share[middle] * LENGTH - 0.025
        front = share[middle] * LENGTH
        pressure = found["resin_pressure"].values[middle][wet]
        assert pressure == pytest.approx(1e5 * (1.0 - x[wet] / front), rel=0.1, abs=2e3)
        velocity = found["darcy_velocity_x"].values[middle]
        first = np.argmin(
            found["sheet_node_x"].values[found["sheet_face_nodes"].values[:, 0].astype(int)]
        )
        exact = PERMEABILITY / VISCOSITY * 1e5 / front
        assert velocity[first] == pytest.approx(exact, rel=0.05)
        assert np.abs(found["darcy_velocity_y"].values[middle]).max() < 1e-6 * exact
        for variable in ("resin_pressure", "fill_factor", "resin_mass", "darcy_velocity_x"):
            about = found[variable].attrs
            assert {"units", "long_name", "comment", "mesh", "location"} <= set(about), variable
        assert "resin_temperature" not in found  # the resin of the case has none
        assert found.attrs["filling_outcome"] == "filled"
        assert found.attrs["title"] == "strip: strip: infiltration"
        assert found["gate_left"].values.sum() == 4
    with xr.open_dataset(folder / "strip_filling.nc", group="/history") as history:
        injected = history["injected_volume"].sel(gate="left").values
        assert np.all(np.diff(injected) >= 0.0)
        assert injected == pytest.approx(history["stored_volume"].values, rel=1e-9, abs=1e-15)


def test_netcdf_opens_elsewhere(strip_result):
    _, folder = strip_result
    path = folder / "strip_filling.nc"
    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(path, print_summary=False)
    assert not checker.logger.report_statement_logrecords(), checker.checking_report()
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(path) as opened:
        assert opened["fill_factor"].ugrid.grid.n_node == 52
    netcdf = pytest.importorskip("vtkmodules.vtkIONetCDF")
    reader = netcdf.vtkNetCDFUGRIDReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == 36 and grid.GetPointData().GetArray("fill_factor")


def test_the_series_for_paraview_has_every_state(strip_result):
    _, folder = strip_result
    listed = list(ET.parse(folder / "strip_filling.pvd").getroot().iter("DataSet"))
    times = [float(entry.get("timestep")) for entry in listed]
    with xr.open_dataset(folder / "strip_filling.nc") as found:
        assert times == found["time"].values.tolist()
        fill_factor = found["fill_factor"].values
    for frame, entry in enumerate(listed):
        mesh = meshio.read(folder / entry.get("file"))
        assert mesh.point_data["fill_factor"].tolist() == fill_factor[frame].tolist()
        assert mesh.cell_data["darcy_velocity"][0].shape == (36, 3)


def test_a_mapped_mesh_is_filled_through_its_named_sets(kit, tmp_path):
    from lcmchain.coupling.infiltration.stage import map_and_fill

    points, quads = strip(10, 2)
    grids = [f"GRID,{n + 1},,{x:.6f},{y:.6f},{z:.6f}" for n, (x, y, z) in enumerate(points)]
    shells = [
        f"CQUAD4,{c + 1},1," + ",".join(str(n + 1) for n in quad) for c, quad in enumerate(quads)
    ]
    left = ",".join(str(n + 1) for n in np.flatnonzero(points[:, 0] == 0.0))
    right = ",".join(str(n + 1) for n in np.flatnonzero(points[:, 0] == LENGTH))
    deck = [
        "SOL 101", '$HMSET        7        1 "IN"', '$HMSET        8        1 "OUT"', "CEND",
        f"SET 7 = {left}", f"SET 8 = {right}", "BEGIN BULK", *grids, *shells, "PSHELL,1,1,1.",
        "ENDDATA",
    ]  # fmt: skip
    mesh = tmp_path / "part.bdf"
    mesh.write_text("\n".join(deck) + "\n")
    case = kit.case(
        HEAD, '[[gates]]\nname = "g"\nset = "IN"\npressure = "1 bar"',
        '[[vents]]\nname = "v"\nset = "OUT"',
    )  # fmt: skip
    mapped, report = map_and_fill(
        kit.forming(), mesh, case, name="part", out_dir=tmp_path, options=PLAIN
    )
    assert mapped is not None and report.outcome == "filled"
    assert report.time == pytest.approx(FILL_TIME, rel=0.02)
    again, second = map_and_fill(
        tmp_path / "part.nc", mesh, case, name="part", out_dir=tmp_path, options=PLAIN
    )
    assert again is None and second.time == report.time
    with pytest.raises(InputError, match='no set "INN"; did you mean "IN"'):
        wrong = kit.case(HEAD, '[[gates]]\nname = "g"\nset = "INN"\npressure = "1 bar"', VENT)
        map_and_fill(tmp_path / "part.nc", None, wrong, name="x", out_dir=tmp_path)


def interrupt_at(share):
    """A listener that presses Ctrl-C once."""
    pressed = []

    def tell(filled, text):
        if filled > share and text.startswith("filling") and not pressed:
            pressed.append(True)
            os.kill(os.getpid(), signal.SIGINT)

    return tell


@pytest.mark.parametrize("frames", ["", 'frame_interval = "20 s"\n'])
def test_an_interrupted_filling_goes_on_to_the_same_bits(kit, tmp_path, frames):
    source, case = kit.forming(), kit.case(HEAD + frames, GATE, VENT)
    whole = fill(read_formed_part(source), case)
    with pytest.raises(SimulationInterrupted, match="with --resume goes on from here"):
        fill_part(source, case, name="a", out_dir=tmp_path, options=PLAIN, tell=interrupt_at(0.4))
    assert [path.name for path in tmp_path.iterdir() if "filling" in path.name] == [
        "a_filling_checkpoint.npz"
    ]
    resume = FillOptions(picture=False, vtu=False, resume=True)
    with pytest.raises(InputError, match="written for another case"):
        other = kit.case(HEAD + frames, GATE.replace("1 bar", "2 bar"), VENT)
        fill_part(source, other, name="a", out_dir=tmp_path, options=resume)
    fill_part(source, case, name="a", out_dir=tmp_path, options=resume)
    with xr.open_dataset(tmp_path / "a_filling.nc") as found:
        assert found["time"].values.tolist() == whole.time.tolist()
        np.testing.assert_array_equal(found["resin_pressure"].values, whole.pressure)
        np.testing.assert_array_equal(found["fill_time"].values, whole.fill_time)
        np.testing.assert_array_equal(found["darcy_velocity_x"].values, whole.velocity[..., 0])
    with xr.open_dataset(tmp_path / "a_filling.nc", group="/history") as history:
        np.testing.assert_array_equal(history["injected_volume"].values, whole.history.injected)
    assert not checkpoint_file(tmp_path, "a").exists()


def test_a_filling_that_is_stopped_as_it_is_written_is_not_computed_again(
    kit, tmp_path, monkeypatch
):
    source, case = kit.forming(), kit.case()
    whole = fill(read_formed_part(source), case)

    def stop_at_the_writing(filled, text):
        if text.startswith("writing"):
            raise KeyboardInterrupt

    options = FillOptions(picture=False, vtu=False)
    with pytest.raises(SimulationInterrupted, match="--resume writes them"):
        fill_part(
            source, case, name="a", out_dir=tmp_path, options=options, tell=stop_at_the_writing
        )
    monkeypatch.setattr(Filling, "frame", None)  # what a step or a saved state would call
    resume = replace(options, resume=True)
    report = fill_part(source, case, name="a", out_dir=tmp_path, options=resume)
    assert (report.outcome, report.message) == (whole.outcome, whole.message)
    with xr.open_dataset(tmp_path / "a_filling.nc") as found:
        np.testing.assert_array_equal(found["resin_pressure"].values, whole.pressure)


def test_a_damaged_or_absent_checkpoint_is_refused(kit, tmp_path):
    source, case = kit.forming(), kit.case()
    resume = FillOptions(picture=False, vtu=False, resume=True)
    with pytest.raises(InputError, match="no checkpoint to go on from"):
        fill_part(source, case, name="a", out_dir=tmp_path, options=resume)
    with pytest.raises(SimulationInterrupted):
        fill_part(source, case, name="a", out_dir=tmp_path, options=PLAIN, tell=interrupt_at(0.2))
    path = checkpoint_file(tmp_path, "a")
    fingerprint = fingerprint_of(set_up(read_formed_part(source), case))
    state, record = read_checkpoint(path, fingerprint)
    lengths = {entry.name: len(getattr(record, entry.name)) for entry in fields(FillingRecord)}
    assert lengths["time"] == state.step_count + 1
    content = bytearray(path.read_bytes())
    content[-1000] ^= 1
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match="it is damaged"):
        fill_part(source, case, name="a", out_dir=tmp_path, options=resume)


def test_a_flow_rate_needs_ever_more_pressure_and_stops_at_its_limit(kit):
    rate = PORES / 100.0  # filled in 100 s
    gate = GATE.replace('pressure = "1 bar"', f'flow_rate = "{1e6 * rate} ml/s"')
    filled = fill(read_formed_part(kit.forming()), kit.case(HEAD, gate, VENT))
    assert filled.outcome == "filled" and filled.state.time == pytest.approx(100.0, rel=1e-6)
    late = filled.history.time > 20.0
    exact = VISCOSITY * rate / (WIDTH * 2e-3 * PERMEABILITY) * LENGTH * filled.history.time / 100.0
    assert filled.history.gate_pressure[late, 0] == pytest.approx(exact[late], rel=0.1)
    limited = kit.case(HEAD, gate + 'pressure_limit = "1 bar"', VENT)
    slower = fill(read_formed_part(kit.forming()), limited)
    assert np.nanmax(slower.history.gate_pressure) <= 1e5 * (1.0 + 1e-9)
    assert slower.state.time > 110.0


def test_resin_that_a_gate_takes_back_is_told(kit, tmp_path):
    """A second gate of 2 bar pushes resin out through the first, of 1 bar, once the fronts meet."""
    first, second = GATE.replace("left", "a-b"), GATE.replace("left", "a_b")
    second = second.replace('"0 ', '"150 ').replace("1 bar", "2 bar")
    filled = fill(read_formed_part(kit.forming()), kit.case(HEAD, first, second, VENT))
    report = filling_report("strip", filled)
    write_filling(tmp_path / "a.nc", filled, report)
    with xr.open_dataset(tmp_path / "a.nc") as found:  # both are there, whatever their names
        marks = {v.attrs["set_name"]: v for n, v in found.items() if str(n).startswith("gate_")}
        for gate in filled.setup.gates:
            assert np.flatnonzero(marks[gate.name].values).tolist() == gate.nodes.tolist()
    entered = np.diff(filled.history.injected[:, 0])
    back = -entered[entered < 0.0].sum()
    assert report.gates["a-b"]["returned_volume"] == pytest.approx(back) and back > 0.01 * PORES
    assert report.gates["a_b"]["returned_volume"] == 0.0
    warnings = [text for text in report.warnings if "of resin back" in text]
    assert len(warnings) == 1 and f'"a-b" takes {1e6 * back:.3g} ml' in warnings[0]
    assert any("ml flowed back" in text for _, text in filling_rows(report.as_dict()))


def test_regions_change_what_they_say(kit):
    part = read_formed_part(kit.forming())
    everywhere = '[[regions]]\nname = "r"\nbox = ["-1 -1 -1 mm", "301 61 1 mm"]\n'
    slow = fill(part, kit.case(HEAD, GATE, VENT, everywhere + "permeability_factor = 0.5"))
    exact = fill(part, kit.case())
    assert slow.state.time == pytest.approx(2.0 * exact.state.time, rel=1e-6)
    thick = kit.case(HEAD, GATE, VENT, everywhere + 'thickness = "4 mm"')
    thick = fill(part, thick)
    assert thick.state.time == pytest.approx(exact.state.time, rel=1e-6)
    assert thick.history.stored[-1] == pytest.approx(2.0 * exact.history.stored[-1], rel=1e-9)
    dense = fill(part, kit.case(HEAD, GATE, VENT, everywhere + "fibre_volume_fraction = 0.75"))
    assert dense.state.time == pytest.approx(0.5 * exact.state.time, rel=1e-6)
    half = everywhere.replace("-1 -1 -1 mm", "-1 29 -1 mm") + "permeability_factor = 0.1"
    half = fill(part, kit.case(HEAD.replace("500 s", "1 h"), GATE, VENT, half))
    ends = np.flatnonzero(half.setup.mesh.points[:, 0] == LENGTH)
    y = half.setup.mesh.points[ends, 1]
    assert half.fill_time[ends[np.argmin(y)]] < half.fill_time[ends[np.argmax(y)]]


def test_a_race_track_runs_ahead(kit):
    track = '[[race_tracks]]\nname = "gap"\nbox = ["-1 -1 -1 mm", "301 1 1 mm"]\nwidth = "1 mm"\n'
    filled = fill(read_formed_part(kit.forming()), kit.case(HEAD, GATE, VENT, track))
    at = filled.setup.mesh.points
    along = np.flatnonzero((at[:, 1] == 0.0) & (at[:, 0] == 0.15))[0]
    beside = np.flatnonzero((at[:, 1] == WIDTH) & (at[:, 0] == 0.15))[0]
    assert filled.fill_time[along] < 0.8 * filled.fill_time[beside]
    (built,) = filled.setup.race_tracks
    assert built.conductance == pytest.approx(2e-3 * 1e-3**3 / 12.0, rel=1e-9, abs=0.0)
    assert built.section == pytest.approx(2e-3 * 1e-3, rel=1e-9, abs=0.0)
    # it is filled too, and its volume is one of the pores
    report = filling_report("a", filled)
    assert report.resin_volume == pytest.approx(report.pore_volume, rel=1e-9, abs=0.0)


def test_wetted_places_are_full_at_the_start(kit):
    wet = '[[wetted]]\nname = "w"\nbox = ["-1 -1 -1 mm", "101 61 1 mm"]\n'
    filled = fill(read_formed_part(kit.forming()), kit.case(HEAD, GATE, VENT, wet))
    x = filled.setup.mesh.points[:, 0]
    assert (filled.fill[0][x < 0.099] == 1.0).all() and (filled.fill[0][x > 0.12] == 0.0).all()
    assert filled.state.time < FILL_TIME


def test_a_gate_that_opens_on_arrival(kit):
    second = (
        '[[gates]]\nname = "late"\nbox = ["150 -1 -1 mm", "150 61 1 mm"]\npressure = "1 bar"\n'
        'opens_on_arrival = { box = ["150 -1 -1 mm", "150 61 1 mm"] }\n'
    )
    part = read_formed_part(kit.forming())
    early = fill(part, kit.case())
    both = fill(part, kit.case(HEAD, GATE, second, VENT))
    assert both.state.time < 0.7 * early.state.time
    before = both.history.time < 0.2 * FILL_TIME
    assert both.history.injected[before, 1].max() == 0.0 < both.history.injected[-1, 1]


def test_a_part_that_is_not_full_says_where_it_is_dry(kit, tmp_path):
    case = kit.case(HEAD.replace("500 s", "50 s"), GATE, VENT)
    report = fill_part(kit.forming(), case, name="a", out_dir=tmp_path, options=PLAIN)
    assert report.outcome == "reached" and report.time == pytest.approx(50.0)
    assert report.filled_share == pytest.approx(np.sqrt(50.0 / FILL_TIME), rel=0.03)
    (warning,) = report.warnings
    assert warning.count("of the pores are filled") == 1
    assert "the dry part is around (2" in warning


def test_a_resin_that_gels_stops_the_front_and_says_so(kit, tmp_path):
    resin = (
        'resin = { law = "castro_macosko", reference_viscosity = "0.1 Pa*s", '
        'reference_temperature = "60 degC", activation_energy = "50 kJ/mol", gel_cure = 0.5, '
        'exponent = 1.5, cure = { law = "nth_order", rate = "0.02 1/s", energy = "1 J/mol", '
        'order = 1.0 }, temperature = { law = "constant", value = "60 degC" } }'
    )
    head = HEAD.replace(HEAD.splitlines()[3], resin)
    report = fill_part(
        kit.forming(), kit.case(head, GATE, VENT), name="a", out_dir=tmp_path, options=PLAIN
    )
    # half of the resin has reacted after ln 2 / 0.02 = 35 s: the front is no farther than then
    assert report.outcome != "filled"
    assert report.filled_share < 1.05 * np.sqrt(35.0 / FILL_TIME)
    assert report.fill_time_last < 40.0
    share, gelled = report.warnings
    assert share.count("of the pores are filled") == 1
    assert "the resin has gelled (cure above 0.5) at the front, as at (" in gelled
    with xr.open_dataset(tmp_path / "a_filling.nc") as found:
        assert found["degree_of_cure"].values[-1].max() > 0.5
        assert found["resin_temperature"].values.max() == pytest.approx(333.15)


def test_a_film_is_pressed_through_the_thickness(kit, tmp_path):
    # values.md 4.3 case 9: porosity viscosity h² / (2 K3 p) = 0.1 s; 1 mm of resin fills the pores
    film = 'film = { thickness = "1.2 mm", pressure = "1 bar" }\n'
    case = kit.case(HEAD.replace("500 s", "10 s") + film, VENT)
    filled = fill(read_formed_part(kit.forming()), case)
    assert filled.outcome == "filled"
    assert filled.state.time == pytest.approx(0.1, rel=0.05)
    assert filled.state.from_film == pytest.approx(PORES, rel=1e-9, abs=0.0)
    assert filled.film[0] == pytest.approx(1.2e-3) and filled.film[-1] == pytest.approx(2e-4)
    part = film.replace("}", ', over = { box = ["-1 -1 -1 mm", "151 61 1 mm"] } }')
    report = fill_part(
        kit.forming(), kit.case(HEAD.replace("500 s", "10 s") + part, VENT), name="a",
        out_dir=tmp_path, options=PLAIN,
    )  # fmt: skip
    assert report.outcome != "filled" and report.balance_error < 1e-10
    with xr.open_dataset(tmp_path / "a_filling.nc") as found:
        x = found["sheet_node_x"].values
        assert (found["resin_film"].values[0] > 0.0).tolist() == (x < 0.151).tolist()


WRONG = {
    "a gate outside the mesh": (
        GATE.replace('box = ["0 -1 -1 mm", "0 61 1 mm"]', 'point = "0 0 100 mm"'),
        VENT,
        r'gates\[0\] "left".point: \(0.0, 0.0, 100.0\) mm lies outside the mesh',
    ),
    "gate and vent at one node": (
        GATE,
        VENT.replace("300 -1 -1 mm", "0 -1 -1 mm"),
        r'gates\[0\] "left": shares 4 nodes with the vent "right" \(node 1 at \(0.0, 0.0, 0.0\)',
    ),
    "two vents at one node": (
        GATE,
        f'{VENT}\n[[vents]]\nname = "corner"\nbox = ["299 -1 -1 mm", "301 1 1 mm"]\n',
        r'vents\[0\] "right": shares 1 node with the vent "corner" \(node \d+ at \(300.0, 0.0, 0.0',
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_places_are_refused_before_anything_is_written(kit, tmp_path, name):
    gate, vent, message = WRONG[name]
    with pytest.raises(InputError, match=message):
        fill_part(kit.forming(), kit.case(HEAD, gate, vent), name="a", out_dir=tmp_path)
    assert not list(tmp_path.glob("a_*"))


def test_a_piece_that_can_never_fill_is_named(tmp_path, kit):
    points, quads = strip()
    away = points + [0.0, 0.1, 0.0]
    source = write_forming(
        tmp_path / "two.nc", np.concatenate([points, away]),
        np.concatenate([quads, quads[::-1] + len(points)]),
    )  # fmt: skip
    with pytest.raises(InputError, match="2 pieces that do not hang together") as caught:
        fill(read_formed_part(source), kit.case())
    assert "36 cells, the first is cell 37 at (287.5, 150.0, 0.0) mm" in str(caught.value)
    gates = GATE.replace("61 1 mm", "200 1 mm")
    with pytest.raises(InputError, match="1 of them have no vent, so that their air cannot leave"):
        fill(read_formed_part(source), kit.case(HEAD, gates, VENT))


def test_a_gate_of_one_node_is_doubted(kit):
    gate = GATE.replace('box = ["0 -1 -1 mm", "0 61 1 mm"]', 'point = "150 20 0 mm"')
    setup = set_up(read_formed_part(kit.forming()), kit.case(HEAD, gate, VENT))
    (warning,) = setup.warnings
    assert 'the gate "left" is one node with a pressure' in warning
    setup = set_up(read_formed_part(kit.forming()), kit.case(HEAD, gate + 'radius = "1 mm"', VENT))
    assert setup.warnings == () and setup.gates[0].radius == 1e-3
