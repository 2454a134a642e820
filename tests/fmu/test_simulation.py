"""The unit in a master: the direct run, inputs, rollback, and steps that fail."""

import re

import fmpy
import numpy as np
import pytest
import xarray as xr
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

from lcmchain.fields import derive_fields, read_forming
from lcmchain.fmu.build import build_fmu
from lcmchain.pipeline import run
from lcmchain.scene import read_scene
from lcmchain.solver.simulation import Simulation

STEP = 5e-4
POINTS = [i * STEP for i in range(7)]


def fields_of(simulation):
    position = np.ascontiguousarray(simulation.state.position.T)
    return derive_fields(
        simulation.model.only_body().mesh, simulation.model.only_body().material, position
    )


@pytest.fixture(scope="module")
def direct(scene_file):
    """The direct run, advanced to the communication points of the masters."""
    simulation = Simulation.from_scene(read_scene(scene_file))
    for time in POINTS[1:]:
        simulation.advance_to(time)
    return simulation


def recorded(result, name, count=400):
    return np.array([result[f"{name}[{i + 1}]"][-1] for i in range(count)])


def sheet_of(folder):
    """The sheet of the result that a unit has written."""
    return read_forming(folder / "forming.nc")


# --- the direct run -------------------------------------------------------------------------------


def test_fmpy_forms_the_part_as_the_direct_run_does(unit, direct):
    result = fmpy.simulate_fmu(str(unit), stop_time=POINTS[-1], output_interval=STEP)
    np.testing.assert_allclose(result["time"], POINTS, rtol=1e-12)
    fields = fields_of(direct)
    assert np.ptp(fields["thickness"]) > 1e-6, "the dome must have been formed"
    for name in ("thickness", "fibre_volume_fraction"):
        np.testing.assert_allclose(recorded(result, name), fields[name], rtol=0, atol=1e-12)
        for end, expected in (("min", fields[name].min()), ("max", fields[name].max())):
            assert result[f"{name}_{end}"][-1] == expected
    assert result["shear_angle_max"][-1] == np.abs(fields["shear_angle"]).max()
    snapshot = direct.snapshot()
    for index, tool in enumerate(("punch", "die", "'blank-holder'")):
        assert result[f"{tool}.travel"][-1] == snapshot.tool_travel[index]
        force = [result[f"{tool}.force_{axis}"][-1] for axis in "xyz"]
        np.testing.assert_array_equal(force, snapshot.tool_force[index])
        along = force @ direct.model.tools.direction[index]
        assert result[f"{tool}.force"][-1] == pytest.approx(along, rel=1e-12)
        # the means of all steps make up the impulse of the run
        means = np.array([result[f"{tool}.mean_force_{axis}"] for axis in "xyz"])
        assert not means[:, 0].any()
        impulse = direct.state.tool_impulse[index]
        scale = np.abs(impulse).max()
        np.testing.assert_allclose(means.sum(axis=1) * STEP, impulse, atol=1e-9 * scale)
        along = direct.model.tools.direction[index] @ means
        np.testing.assert_allclose(result[f"{tool}.mean_force"], along, atol=1e-9 * scale / STEP)
    assert result["punch.mean_force"][-1] != result["punch.force"][-1]
    for output, energy in (
        ("kinetic_energy", "kinetic"),
        ("internal_energy", "internal"),
        ("external_work", "external"),
        ("energy_balance_error", "balance_error"),
    ):
        assert result[output][-1] == snapshot.energy[energy]
    assert result["step_count"][-1] == direct.state.step_count
    assert 1e-7 < result["critical_time_step"][0] < 1e-5
    assert result["thickness[1]"][0] == pytest.approx(1.004e-3, rel=1e-12)


def test_bit_identical_for_any_number_of_threads_and_any_start_time(new_master, direct):
    master = new_master().initialize(start_time=2.0, threads=1)
    for time in POINTS[:-1]:
        master.step(2.0 + time, STEP)
    # 2.0 + t has rounded the communication points
    expected = fields_of(direct)["thickness"]
    np.testing.assert_allclose(master.field("thickness"), expected, rtol=0, atol=1e-11)

    one, two = (new_master(f"{n} threads").initialize(threads=n) for n in (1, 2))
    for time in POINTS[:-1]:
        one.step(time, STEP)
        two.step(time, STEP)
    np.testing.assert_array_equal(one.field("thickness"), two.field("thickness"))
    np.testing.assert_array_equal(one.field("thickness"), expected)


def test_result_file_has_the_frames_of_the_scene(unit, scene_file, direct, tmp_path):
    out = tmp_path / "results" / "dome"
    fmpy.simulate_fmu(
        str(unit),
        stop_time=POINTS[-1],
        output_interval=STEP,
        start_values={"out_dir": str(out)},
        output=["punch.travel"],
    )
    sheet = sheet_of(out)
    np.testing.assert_allclose(sheet["time"], [0.0, 1e-3, 2e-3, 3e-3], rtol=1e-9)
    np.testing.assert_array_equal(sheet["thickness"][-1], fields_of(direct)["thickness"])
    assert [path.name for path in out.iterdir()] == ["forming.nc"]


def test_result_file_is_that_of_a_run(scene_file, tmp_path):
    """Every group, field, history and attribute, at the same communication points."""
    scene = tmp_path / "scene.toml"
    law = '[permeability]\nlaw = "gebart"\nfibre_radius = "3.5 um"\n'
    scene.write_text(scene_file.read_text(encoding="utf-8") + law, encoding="utf-8")
    fmpy.simulate_fmu(
        str(build_fmu(scene, tmp_path / "dome.fmu")),
        stop_time=POINTS[-1],
        output_interval=1e-3,  # of the frames
        start_values={"out_dir": str(tmp_path / "unit")},
        output=["punch.travel"],
    )
    quick = ["output.pictures=false", "output.vtu=false"]
    run(read_scene(scene, quick), tmp_path / "run")
    with (
        xr.open_datatree(tmp_path / "unit" / "forming.nc") as of_unit,
        xr.open_datatree(tmp_path / "run" / "forming.nc") as of_run,
    ):
        assert of_unit.groups == of_run.groups
        assert "permeability_direction_2_y" in of_unit
        for group in of_run.groups:
            xr.testing.assert_equal(of_unit[group].to_dataset(), of_run[group].to_dataset())
            for name, variable in of_run[group].variables.items():
                assert str(of_unit[group][name].attrs) == str(variable.attrs), (group, name)
        changed = {"history", "scene", "scene_sha256"}  # its time, and the overrides of the run
        expected = {key: of_run.attrs[key] for key in of_run.attrs.keys() - changed}
        assert of_unit.attrs.keys() == of_run.attrs.keys()
        assert {key: of_unit.attrs[key] for key in expected} == expected
        assert of_unit.attrs["state"] == "complete"


# --- inputs ---------------------------------------------------------------------------------------


def test_punch_driven_by_its_own_velocity_moves_as_in_the_scene(new_master):
    as_in_scene = new_master("scene").initialize()
    driven = new_master("driven").initialize(punch__drive=True, punch__velocity_input=1.0)
    for time in POINTS[:3]:
        as_in_scene.step(time, STEP)
        driven.step(time, STEP)
    # The scene's stroke is linear, 3 mm in 3 ms.
    assert driven.get("punch.travel") == pytest.approx(3 * STEP * 1.0, rel=1e-12)
    assert driven.get("punch.travel") == pytest.approx(as_in_scene.get("punch.travel"), rel=1e-12)
    assert driven.get("punch.velocity") == pytest.approx(1.0, rel=1e-9)
    np.testing.assert_allclose(
        driven.field("thickness"), as_in_scene.field("thickness"), rtol=0, atol=1e-9
    )


def test_velocity_is_held_over_a_step_and_may_turn_back(new_master):
    master = new_master().initialize(punch__drive=True)
    time = 0.0
    for velocity, travel in ((2.0, 1e-3), (0.5, 1.25e-3), (-1.0, 0.75e-3)):
        master.set("punch.velocity_input", velocity)
        time = master.step(time, STEP)
        assert master.get("punch.travel") == pytest.approx(travel, rel=1e-10)
        assert master.get("punch.velocity") == pytest.approx(velocity, rel=1e-9)


def test_force_on_the_holder_arrives_at_the_die(new_master):
    mass, weight, step, count = 0.5, 0.5 * 9.81, 5e-5, 40
    for force in (0.0, 50.0):
        master = new_master(f"{force} N").initialize(punch__drive=True)
        master.set("'blank-holder'.force_input", force)
        forces = np.zeros((count + 1, 2))
        for i in range(count):
            master.step(i * step, step)
            forces[i + 1] = master.get("die.force", "'blank-holder'.force")
        # The sheet pushes the die down (against its axis), the holder up (against its direction):
        # momentum of the holder, which bounces once, and the sheet hands the force on.
        die, holder = np.trapezoid(forces, dx=step, axis=0)
        momentum = mass * master.get("'blank-holder'.velocity")
        assert momentum - holder == pytest.approx((force + weight) * count * step, rel=0.02)
        assert die == pytest.approx(holder, rel=0.03)


def test_holder_can_be_driven_too(new_master):
    master = new_master().initialize()
    master.set("'blank-holder'.drive", True)
    master.set("'blank-holder'.velocity_input", -0.4)
    master.step(0.0, STEP)
    assert master.get("'blank-holder'.travel") == pytest.approx(-0.4 * STEP, rel=1e-10)
    assert master.get("'blank-holder'.force") == 0.0, "it has been lifted"


# --- rollback -------------------------------------------------------------------------------------


def test_rollback_repeats_a_step_exactly(new_master):
    master = new_master().initialize()
    outputs = ("punch.force", "internal_energy", "external_work", "critical_time_step")
    time = master.step(0.0, STEP)
    before = master.get(*outputs)
    saved = master.slave.getFMUstate()
    master.step(time, STEP)
    first = master.field("thickness"), master.get(*outputs)

    master.slave.setFMUstate(saved)
    assert master.get(*outputs) == before
    master.set("punch.drive", True)
    master.set("punch.velocity_input", 3.0)
    master.step(time, STEP)
    assert np.any(master.field("thickness") != first[0])

    master.slave.setFMUstate(saved)  # inputs go back as well
    master.step(time, STEP)
    np.testing.assert_array_equal(master.field("thickness"), first[0])
    assert master.get(*outputs) == first[1]
    master.slave.freeFMUstate(saved)


def test_serialized_state_goes_on_in_another_instance(new_master, tmp_path):
    one = new_master("one").initialize(out_dir=str(tmp_path))
    time = one.step(one.step(0.0, STEP), STEP)
    saved = one.slave.getFMUstate()
    content = one.slave.serializeFMUstate(saved)
    one.slave.freeFMUstate(saved)
    one.step(time, STEP)

    other = new_master("other")
    restored = other.slave.deSerializeFMUstate(content)
    other.slave.setFMUstate(restored)  # not even initialized
    other.slave.freeFMUstate(restored)
    other.step(time, STEP)
    np.testing.assert_array_equal(other.field("thickness"), one.field("thickness"))
    other.slave.terminate()
    sheet = sheet_of(tmp_path)
    np.testing.assert_allclose(sheet["time"], [0.0, 1e-3, 1.5e-3], rtol=1e-9)
    early = "stopped: the master ended the simulation after 1.5 of 3 ms"
    assert sheet.attrs["state"] == early


def test_reset_starts_over(new_master):
    master = new_master().initialize()
    master.step(0.0, STEP)
    first = master.field("thickness")
    master.slave.reset()
    master.initialize()
    assert master.get("punch.travel") == 0.0
    master.step(0.0, STEP)
    np.testing.assert_array_equal(master.field("thickness"), first)


# --- steps that fail ------------------------------------------------------------------------------


def test_guard_stops_the_step_with_unit_time_cause_and_inputs(new_master, capfd):
    master = new_master("press").initialize()
    time = master.step(0.0, STEP)
    good = master.field("thickness")
    master.set("punch.drive", True)
    master.set("punch.velocity_input", 400.0)
    with pytest.raises(FMICallException, match="discard"):
        master.step(time, STEP)
    message = capfd.readouterr().err.splitlines()[-1]
    assert message.startswith("press: the step from 0.0005 s to 0.001 s was stopped and undone: ")
    assert re.search(r"element \d+", message)
    assert "Likely cause" in message
    assert "punch.velocity_input = 400.0" in message
    assert master.slave.getBooleanStatus(fmi2Terminated)
    assert master.slave.getRealStatus(fmi2LastSuccessfulTime) == time

    # The state is that before the step, and a better input goes on from there.
    np.testing.assert_array_equal(master.field("thickness"), good)
    with pytest.raises(FMICallException, match="discard"):
        master.step(time, STEP)
    master.set("punch.velocity_input", 1.0)
    master.step(time, STEP)
    master.slave.terminate()


def test_fmpy_keeps_its_results_after_a_discard(unit, capfd, tmp_path):
    """fmpy takes a discarded step for an early end that the unit wished for."""
    start_values = {
        "punch.drive": True,
        "punch.velocity_input": 400.0,
        "out_dir": str(tmp_path),
    }
    result = fmpy.simulate_fmu(
        str(unit), stop_time=POINTS[-1], output_interval=STEP, start_values=start_values
    )
    assert result["time"].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(recorded(result, "thickness"), 1.004e-3, rtol=1e-12)
    assert result["status"].tolist() == [0, 1]
    assert "was stopped and undone" in capfd.readouterr().err
    sheet = sheet_of(tmp_path)
    assert sheet["thickness"].shape == (1, 400), "the last good frame is kept"
    assert re.match(r"stopped: .* was stopped and undone: .*element \d+", sheet.attrs["state"])


@pytest.mark.parametrize(
    ("settings", "time", "step", "told"),
    [
        ({"punch__velocity_input": float("nan")}, 0.0, STEP, "punch.velocity_input is nan"),
        ({}, 1e-3, STEP, "stands at 0 s, not at 0.001 s"),
        ({}, 0.0, -STEP, "negative"),
        ({}, 0.0, 0.0, "its size is 0"),
        ({}, 0.0, float("nan"), "no number"),
        ({}, float("inf"), STEP, "no number"),
    ],
)
def test_step_without_sense_is_refused(new_master, capfd, settings, time, step, told):
    master = new_master().initialize(**settings)
    with pytest.raises(FMICallException, match="discard"):
        master.step(time, step)
    assert told in capfd.readouterr().err
    assert master.get("punch.travel") == 0.0


def test_punch_must_not_jump_back_to_the_motion_of_the_scene(new_master, capfd):
    master = new_master().initialize(punch__drive=True, punch__velocity_input=0.2)
    time = master.step(0.0, STEP)
    master.set("punch.drive", False)
    with pytest.raises(FMICallException, match="discard"):
        master.step(time, STEP)
    assert "punch would jump by 0.4 mm" in capfd.readouterr().err


def test_unusable_folder_is_told_before_the_first_step(new_master, capfd, tmp_path):
    (tmp_path / "file").write_text("")
    master = new_master()
    with pytest.raises(FMICallException, match="ExitInitializationMode"):
        master.initialize(out_dir=str(tmp_path / "file"))
    assert "out_dir" in capfd.readouterr().err
    with pytest.raises(FMICallException, match="discard"):
        master.step(0.0, STEP)
    assert "initialization has failed: out_dir" in capfd.readouterr().err


def test_initialization_says_what_it_does_before_it_compiles(unpacked, capfd, monkeypatch):
    from lcmchain.fmu.instances import open_unit
    from lcmchain.solver.simulation import Simulation

    told = []
    monkeypatch.setattr(Simulation, "compile", lambda _: told.append(capfd.readouterr().err))
    one = open_unit(f"{unpacked[0]}/resources", "one", lambda *_: None, arrays=False)
    one.set_up(0.0)
    one.enter_initialization()
    assert "one: Dome, 400 elements" in told[0] and "compiling" in told[0]


# --- parameters and positions ---------------------------------------------------------------------


def test_friction_is_a_parameter(new_master, scene_file):
    master = new_master().initialize(contact__friction=0.4)
    other = Simulation.from_scene(read_scene(scene_file, ["contact.friction=0.4"]))
    time = 0.0
    for point in POINTS[1:4]:
        time = master.step(time, STEP)
        other.advance_to(point)
    np.testing.assert_array_equal(master.field("thickness"), fields_of(other)["thickness"])


def test_a_tool_goes_to_the_position_that_is_asked_for(new_master):
    master = new_master().initialize(punch__drive_to_position=True)
    time = 0.0
    for travel in (0.4e-3, 0.5e-3, 0.2e-3):
        master.set("punch.position_input", travel)
        time = master.step(time, STEP)
        assert master.get("punch.travel") == pytest.approx(travel, rel=1e-10)


def test_two_drives_at_once_are_refused(new_master, capfd):
    master = new_master().initialize(punch__drive=True, punch__drive_to_position=True)
    with pytest.raises(FMICallException, match="discard"):
        master.step(0.0, STEP)
    assert "both true" in capfd.readouterr().err


def test_a_velocity_that_drives_nothing_is_told_once(new_master, capfd):
    master = new_master().initialize(punch__velocity_input=0.2)
    time = master.step(0.0, STEP)
    assert "punch.drive nor punch.drive_to_position is true" in capfd.readouterr().err
    master.step(time, STEP)
    assert "punch.drive" not in capfd.readouterr().err


# --- FMI 3.0 --------------------------------------------------------------------------------------


def test_arrays_of_fmi3_hold_what_the_direct_run_has(unit3, direct, tmp_path):
    result = fmpy.simulate_fmu(
        str(unit3), stop_time=POINTS[-1], output_interval=STEP,
        start_values={"out_dir": str(tmp_path)},
    )  # fmt: skip
    fields = fields_of(direct)
    for name in ("thickness", "fibre_volume_fraction", "shear_angle"):
        assert result[name].shape == (len(POINTS), 400)
        np.testing.assert_array_equal(result[name][-1], fields[name])
    snapshot = direct.snapshot()
    assert result["punch.travel"][-1] == snapshot.tool_travel[0]
    assert result["internal_energy"][-1] == snapshot.energy["internal"]
    change = result["thickness"][-1] - result["thickness"][-2]
    np.testing.assert_allclose(result["thickness_rate"][-1], change / STEP, rtol=1e-9, atol=1e-12)
    centres = snapshot.position[direct.model.only_body().mesh.elements].mean(axis=1)
    np.testing.assert_allclose(result["position_z"][-1], centres[:, 2], rtol=0, atol=1e-15)
    assert sheet_of(tmp_path).attrs["state"] == "complete"
