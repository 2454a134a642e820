"""Fields of the faces that plies turn to each other, against what is known of a sled on a ply."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread
from stacks import T, of_points, ply, scene_of, stack
from test_sliding import MU, sled

from lcmchain.check.large_mesh import frame_bytes
from lcmchain.compilation.references import Reference
from lcmchain.elements.blocks import SPAN
from lcmchain.errors import InputError
from lcmchain.fields.dataset import model_datasets
from lcmchain.fields.saved import FrameSeries
from lcmchain.fields.sheet import node_areas, vector
from lcmchain.fields.stack import ply_sheet
from lcmchain.fields.summary import stack_summary
from lcmchain.fields.vtu import write_vtu
from lcmchain.interfaces.forces import LAST_STEPS, forces_of_points
from lcmchain.interfaces.in_frames import APART, FRAME_ROWS, GAP, SLID_PATH, SLIDES, STICKS
from lcmchain.interfaces.refresh import refresh
from lcmchain.interfaces.rows import HELD, PATH, SLIP
from lcmchain.interfaces.surfaces import PlyContact
from lcmchain.interfaces.table import Interface
from lcmchain.quantities.fields import BETWEEN_PLIES, FIELD_OF_VARIABLE, FIELDS
from lcmchain.report.numbers import key_numbers, ply_numbers
from lcmchain.report.stack_pictures import draw_plies
from lcmchain.report.style import CAPTIONS
from lcmchain.solver.simulation import Simulation
from lcmchain.state import State

START, END = 4e-3, 6.5e-3  # between which the sled goes at one speed [s]


def datasets_of(sim, snapshots):
    frames = FrameSeries.from_snapshots(snapshots, sim.model.tool_names)
    return model_datasets(scene_of(), sim.model, frames)


@pytest.fixture(scope="module")
def pulled():
    """A sled that is drawn over a held ply: pressed, on its way, and further on."""
    sim = sled()
    times = (0.0, 2e-3, START, END)
    snapshots, forces = [], []
    for time in times[:-1]:
        sim.advance_to(time)
        snapshots.append(sim.snapshot())
        forces.append(sim.state.tool_force[1, 2])
    on_the_way, loads = [], []
    for time in np.linspace(START, END, 26)[1:]:
        sim.advance_to(time)
        on_the_way.append(sim.snapshot())
        loads.append(sim.state.tool_force[1, 2])
    groups = datasets_of(sim, [*snapshots, on_the_way[-1]])
    plies = {name: ply_sheet(groups, name) for name in ("bed", "sled")}
    moving = ply_sheet(datasets_of(sim, on_the_way), "sled")
    return SimpleNamespace(
        sim=sim, groups=groups, forces=[*forces, loads[-1]], moving=moving, loads=loads, **plies
    )


def total(sheet, name, frame):
    return np.sum(sheet[name].values[frame] * node_areas(sheet, frame))


def test_the_pressure_adds_up_to_the_load_of_the_plate(pulled):
    """In the mean over the way: the sled shakes up and down, and its inertia with it."""
    found = [total(pulled.moving, "ply_pressure_bottom", k) for k in range(len(pulled.loads))]
    assert np.mean(found) == pytest.approx(np.mean(pulled.loads), rel=5e-3)
    assert min(found) > 1.0
    assert pulled.sled["ply_pressure_bottom"].values[3].min() > 0.0


def test_both_faces_have_the_same_force(pulled):
    for frame in (1, 2, 3):
        one, other = (
            total(sheet, f"ply_pressure_{side}", frame)
            for sheet, side in ((pulled.bed, "top"), (pulled.sled, "bottom"))
        )
        assert one == pytest.approx(other, rel=1e-12)
        assert one > 1.0
        for axis in "xyz":
            one, other = (
                total(sheet, f"ply_shear_stress_{side}_{axis}", frame)
                for sheet, side in ((pulled.bed, "top"), (pulled.sled, "bottom"))
            )
            assert one == pytest.approx(-other, abs=1e-12 * pulled.forces[frame])


def test_faces_that_look_at_no_other_ply_have_nothing(pulled):
    for sheet, side in ((pulled.bed, "bottom"), (pulled.sled, "top")):
        for name in ("ply_pressure", "slip_path", "ply_shear_stress_x", "slip_x"):
            stem, dot, axis = name.rpartition("_x")
            name = f"{stem}_{side}_x" if dot else f"{name}_{side}"
            np.testing.assert_array_equal(sheet[name], 0.0, err_msg=name)
        np.testing.assert_array_equal(sheet[f"faced_ply_{side}"], -1)
        np.testing.assert_array_equal(sheet[f"ply_contact_{side}"], APART)
        assert np.isnan(sheet[f"ply_gap_{side}"]).all()


def test_the_slip_of_a_sled_is_its_way(pulled):
    """On a ply that is held, along x; the bed's nodes slide the other way under it."""
    way = vector(pulled.sled, "displacement", 3)
    slip = vector(pulled.sled, "slip_bottom", 3)
    assert way[:, 0].min() > 6e-3
    # the displacement is that of the mid-surface
    np.testing.assert_allclose(slip[:, :2], way[:, :2], atol=5e-5)
    np.testing.assert_allclose(slip[:, 2], 0.0, atol=1e-6)
    path = pulled.sled["slip_path_bottom"].values
    assert (path[3] >= np.linalg.norm(slip, axis=1) * (1.0 - 1e-12)).all()
    np.testing.assert_allclose(path[3], way[:, 0], rtol=1e-2)
    assert (np.diff(path, axis=0) >= 0.0).all()
    # under the middle of the sled all the time
    bed = vector(pulled.bed, "slip_top", 3) - vector(pulled.bed, "slip_top", 2)
    covered = (pulled.bed["faced_ply_top"].values[2:] == 1).all(axis=0)
    last = np.mean(way[:, 0] - vector(pulled.sled, "displacement", 2)[:, 0])
    assert covered.sum() > 8
    np.testing.assert_allclose(bed[covered, 0], -last, rtol=2e-2)


def test_a_sliding_face_bears_its_friction_times_its_pressure(pulled):
    for sheet, side, sign in ((pulled.sled, "bottom", -1.0), (pulled.bed, "top", 1.0)):
        pressure = sheet[f"ply_pressure_{side}"].values[3]
        stress = vector(sheet, f"ply_shear_stress_{side}", 3)
        pressed = pressure > 0.1 * pressure.max()
        assert pressed.sum() >= 12
        # friction knows the spring's pressure, the force has its damping too
        np.testing.assert_allclose(stress[pressed, 0], sign * MU * pressure[pressed], rtol=1e-2)
        assert np.abs(stress[pressed, 1:]).max() < 1e-2 * MU * pressure.max()


def test_the_state_tells_what_slides_and_what_sticks(pulled):
    """Pressed on and not drawn yet, drawn, and beside the sled."""
    state = pulled.sled["ply_contact_bottom"]
    assert state.attrs["flag_meanings"].split() == ["apart", "sticks", "slides"]
    assert list(state.attrs["flag_values"]) == [APART, STICKS, SLIDES]
    np.testing.assert_array_equal(state[3], SLIDES)
    assert (state[1] == STICKS).any()
    bed, faced = (pulled.bed[f"{name}_top"].values[3] for name in ("ply_contact", "faced_ply"))
    np.testing.assert_array_equal(bed[faced < 0], APART)
    assert (bed[faced == 1] == SLIDES).sum() > 12
    assert pulled.bed["faced_ply_top"].attrs["flag_meanings"] == "none bed sled"
    np.testing.assert_array_equal(pulled.sled["faced_ply_bottom"].values[3], 0)


def test_points_of_a_vtu_file_bear_the_fields_of_their_face(pulled, tmp_path):
    import meshio

    write_vtu(tmp_path / "stack.vtu", pulled.groups)
    found = meshio.read(tmp_path / "stack.vtu").point_data
    count = len(pulled.bed["slip_path_top"][0])
    sled_nodes = slice(2 * count, 2 * count + len(pulled.sled["slip_path_top"][0]))
    np.testing.assert_allclose(
        found["ply_pressure"][sled_nodes], pulled.sled["ply_pressure_bottom"][3]
    )
    np.testing.assert_allclose(found["slip"][sled_nodes], vector(pulled.sled, "slip_bottom", 3))
    np.testing.assert_allclose(
        found["ply_pressure"][count : 2 * count], pulled.bed["ply_pressure_top"][3]
    )


def laid_over(gap, shift=0.0):
    """A ply over another one at a distance and shifted along x [mm], which has looked at it."""
    plies = [
        ply("lower", width=30.0, height=15.0, z=0.5 * T),
        ply("upper", shift=(shift, 0.0, 0.0), width=30.0, height=15.0, z=1.5 * T + gap),
    ]
    sim = stack(plies, scene_of(), Interface(friction=MU))
    look(sim)
    return sim


def look(sim, ahead=0.0):
    """Renew all springs, and make their forces; ``ahead`` is the time that springs shall last."""
    plies, arrays = Reference(sim.model.ply_contact), sim.arrays
    arrays.ply_counters[LAST_STEPS] = 2
    refresh(plies.data, plies.laws, arrays, 0.0, ahead)
    forces_of_points(plies, arrays, 0.0)


@pytest.mark.parametrize("gap", [0.3, -0.1])
def test_the_gap_of_held_plies_is_their_distance(gap):
    """Also where they were laid into each other, which takes no force."""
    sim = laid_over(gap)
    groups = datasets_of(sim, [sim.snapshot()])
    for name, side in (("lower", "top"), ("upper", "bottom")):
        sheet = ply_sheet(groups, name)
        np.testing.assert_allclose(sheet[f"ply_gap_{side}"][0], 1e-3 * gap, atol=1e-9)
        np.testing.assert_allclose(sheet[f"ply_pressure_{side}"][0], 0.0, atol=1e-6)


def test_plies_that_only_press_have_their_depth_as_gap_and_no_shear_at_rims():
    """The share of a rim has a force along the ply, which no law takes from it."""
    sim = laid_over(0.0, shift=2.3)
    sim.state.position[2, sim.model.bodies[1].first_node :] -= 20e-6
    for _ in range(50):
        look(sim, ahead=1e-5)
    groups = datasets_of(sim, [sim.snapshot()])
    assert of_points(sim, HELD).max() > 2e-6  # the springs feel more than the gap
    for name, side in (("lower", "top"), ("upper", "bottom")):
        sheet = ply_sheet(groups, name)
        gap, faced = (sheet[f"{field}_{side}"].values[0] for field in ("ply_gap", "faced_ply"))
        np.testing.assert_allclose(gap[faced >= 0], -20e-6, atol=1e-9)
        pressure = sheet[f"ply_pressure_{side}"].values[0]
        assert pressure.max() > 1e3
        shear = vector(sheet, f"ply_shear_stress_{side}", 0)
        assert np.abs(shear).max() < 1e-9 * pressure.max()


@pytest.mark.parametrize(
    ("gap", "reach", "counts"), [(0.05, 0.0, 1.0), (0.3, 0.0, 0.0), (0.3, 0.4, 1.0)]
)
def test_a_ply_slides_on_one_that_it_lies_on_or_that_a_law_reaches(gap, reach, counts):
    """Moved to and fro by 0.2 mm, of which the path has both and the slip nothing."""
    sim = laid_over(gap)
    (data, laws), model = sim.model.ply_contact, sim.model
    data = data._replace(near=np.full_like(data.near, 1e-3 * reach))
    sim = Simulation(replace(model, ply_contact=PlyContact(data, laws)), sim.state)
    own, way = sim.model.bodies[1].first_node, 0.2e-3
    for number, step in enumerate((way, -way)):
        sim.state.position[0, own:] += step
        faces = sim.state.ply_facet >= 0
        at_once = sim.snapshot().between_plies[SLID_PATH, faces]
        look(sim)
        wanted = counts * (number + 1) * way
        np.testing.assert_allclose(of_points(sim, PATH)[faces], wanted, rtol=1e-6, atol=1e-12)
        # a frame knows what has slid since the spring was made
        np.testing.assert_allclose(at_once, wanted, rtol=1e-6, atol=1e-12)
        upper = faces & (np.arange(faces.size) >= own)
        slip = of_points(sim, SLIP)[upper]
        np.testing.assert_allclose(slip, counts * (way if number == 0 else 0.0), atol=1e-9)


def test_plies_that_turn_together_do_not_slide_and_their_slip_turns_with_them():
    """A quarter of a turn in small parts; the smooth surface lies off facets of a curved ply."""
    sim = laid_over(0.01)
    position, start = sim.state.position, sim.state.position.copy()
    start[2] += start[0] ** 2 / (2.0 * 0.04)
    steps = 60
    for number in range(steps + 1):
        angle = 0.5 * np.pi * number / steps
        c, s = np.cos(angle), np.sin(angle)
        position[0], position[2] = c * start[0] - s * start[2], s * start[0] + c * start[2]
        turn = 0.5 * np.pi / steps
        sim.state.velocity[0], sim.state.velocity[2] = -turn * position[2], turn * position[0]
        look(sim, ahead=0.5)  # as in a run, springs are those of the middle of their time
        if number == 0:
            put_points(sim, PATH, 0.0)
            for row, value in enumerate((1e-3, 0.0, 0.0)):
                put_points(sim, SLIP + row, value)
    held = sim.state.ply_facet >= 0
    assert held.sum() > 50
    assert of_points(sim, PATH)[held].max() < 5e-6
    slip = np.stack([of_points(sim, SLIP + d)[held] for d in range(3)])
    np.testing.assert_allclose(np.linalg.norm(slip, axis=0), 1e-3, rtol=1e-2)
    # from along x to along z, but for how the ply curves there
    assert slip[2].min() > 0.9e-3


def put_points(sim, row, value):
    """Write a row of all points."""
    data = sim.model.ply_contact.data
    span, lane = np.divmod(data.lane, SPAN)
    sim.state.ply_rows[span * data.row_size + row * SPAN + lane] = value


def test_what_has_slid_is_not_forgotten_when_its_facet_is_lost():
    sim = sled()
    sim.advance_to(END)
    path, slip = of_points(sim, PATH), of_points(sim, SLIP)
    own = sim.model.bodies[1].first_node
    assert path.max() > 6e-3
    sim.state.position[2, own:] += 5e-3
    refresh(*sim.model.ply_contact, sim.arrays, 1e-6, 1e-6)
    assert (sim.state.ply_facet < 0).all()
    assert (of_points(sim, PATH) >= path).all()
    np.testing.assert_allclose(of_points(sim, SLIP), slip, atol=0.2e-3)


def test_a_restart_keeps_the_slip_to_the_bit(pulled):
    before = pulled.sim.state.copy()
    again = Simulation(pulled.sim.model)
    again.restore(before)
    np.testing.assert_array_equal(
        again.snapshot().between_plies, pulled.sim.snapshot().between_plies
    )
    pulled.sim.make_steps(50, 1e-6)
    again.make_steps(50, 1e-6)
    np.testing.assert_array_equal(
        again.snapshot().between_plies, pulled.sim.snapshot().between_plies
    )
    pulled.sim.restore(before)


def test_a_state_without_slip_is_refused_by_name(pulled):
    arrays = pulled.sim.state.copy().as_dict()
    rows = pulled.sim.model.ply_contact.data.row_size
    arrays["ply_rows"] = arrays["ply_rows"].reshape(-1, rows)[:, : rows - 16 * 7].ravel().copy()
    with pytest.raises(InputError, match="ply_rows") as error:
        Simulation(pulled.sim.model).restore(State.from_arrays(arrays))
    assert "from the start" in str(error.value)


def test_one_sheet_has_nothing_of_it(pulled):
    from lcmchain.model import build_model

    sim = Simulation(build_model(scene_of()))
    arrays = sim.snapshot().arrays
    assert "between_plies" not in arrays
    assert np.isnan(pulled.sim.snapshot().between_plies[GAP]).any()


def test_the_summary_tells_slip_pressure_and_what_slides(pulled):
    summary = stack_summary(pulled.groups)
    path = pulled.sled["slip_path_bottom"].values[3].max()
    pressures = [pulled.bed["ply_pressure_top"], pulled.sled["ply_pressure_bottom"]]
    stack, sled_alone = summary["stack"], summary["plies"]["sled"]
    assert stack["slip_path_max_m"] == sled_alone["slip_path_max_m"] == path > 6e-3
    assert stack["ply_pressure_max_Pa"] == max(float(p.values[3].max()) for p in pressures)
    assert sled_alone["ply_pressure_max_Pa"] == float(pressures[1].values[3].max())
    assert sled_alone["sliding_part"] == 1.0
    deepest, depths = summary["stack"]["ply_depth"], {}
    for name, sheet, side in (("bed", pulled.bed, "top"), ("sled", pulled.sled, "bottom")):
        touches = sheet[f"ply_contact_{side}"].values != APART
        depths[name] = np.where(touches, -sheet[f"ply_gap_{side}"].values, 0.0).max(axis=1)
    by = max(depths, key=lambda name: depths[name].max())
    assert deepest["ply"] == by and {by, deepest["into"]} == {"bed", "sled"}
    assert deepest["depth_m"] == depths[by].max() > 0.0
    frame = int(np.argmax(depths[by]))
    assert deepest["time_s"] == pulled.groups["/"]["time"].values[frame]
    assert deepest["part"] == pytest.approx(deepest["depth_m"] / (1e-3 * T), rel=1e-9)
    pressed_only = stack_summary(pulled.groups, frame=1)["plies"]["sled"]
    state, area = pulled.sled["ply_contact_bottom"].values[1], node_areas(pulled.sled, 1)
    wanted = area[state == SLIDES].sum() / area[state != APART].sum()
    assert wanted < 1.0
    assert pressed_only["sliding_part"] == pytest.approx(wanted)
    numbers = {number.name: number.in_words for number in key_numbers(summary)}
    slip = np.sqrt(sum(pulled.sled[f"slip_bottom_{xyz}"].values[3] ** 2 for xyz in "xyz")).max()
    assert sled_alone["slip_max_m"] == pytest.approx(slip, rel=1e-12)
    assert 0.0 < slip <= path * (1.0 + 1e-9)
    told = f"up to {1e3 * slip:.2f} mm (to and fro {1e3 * path:.2f} mm)"
    assert numbers["Slip between plies"].startswith(told)
    assert f"{1e-3 * stack['ply_pressure_max_Pa']:.3g} kPa" in numbers["Slip between plies"]
    rows = {number.name: number.in_words for number in ply_numbers(summary)}
    assert f"slid on others by {told}" in rows["Ply sled"]


def test_pressure_and_slip_are_drawn_on_the_ply_that_another_one_lies_on(pulled, tmp_path):
    """White where the sled never was, on the bed alone."""
    files = {file.name for file in draw_plies(tmp_path, pulled.groups)}
    names = {"plies_ply_pressure_top.png", "plies_slip_path_top.png"}
    assert names <= files & set(CAPTIONS)
    for name in names:
        picture = imread(tmp_path / name)[..., :3]
        assert picture.std() > 0.01
        assert (picture < 0.02).all(axis=2).mean() < 0.01  # no colour of its own is black
    at_start = {file.name for file in draw_plies(tmp_path, pulled.groups, 0)}
    assert not names & at_start


def test_memory_of_frames_counts_what_is_between_plies():
    alone, laid = frame_bytes(100, 200), frame_bytes(100, 200, is_stack=True)
    rows = sum(len(FIELDS[name].variables) for name in BETWEEN_PLIES)
    assert laid - alone == 3 * 8 * 200 * FRAME_ROWS
    assert alone < 8 * (len(FIELD_OF_VARIABLE) * 100 + 9 * 200)
    assert rows == 2 * FRAME_ROWS
