"""A unit of a process in stages: a master's steps cross the borders, and go back over them."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from staged_strip import simulation_of, text_of

from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.forming.variables import GRIPPERS, MEANS
from lcmchain.fmu.instances import open_unit, read_state
from lcmchain.fmu.part import SavedState
from lcmchain.fmu.variables import Kind

MS = 1e-3
NAMES = ("press", "hold", "pull")
# From one communication point to the next: both borders, at 4 and at 5 ms, lie within a step.
STEP = 1.5 * MS
BEFORE, BETWEEN, AFTER = "press", "hold", "pull"


@pytest.fixture(scope="module")
def resources(tmp_path_factory):
    """The folder of the unit of the strip: pressed, held, and drawn by grippers."""
    folder = tmp_path_factory.mktemp("strip")
    scene = folder / "strip.toml"
    scene.write_text(text_of(*NAMES), encoding="utf-8")
    with zipfile.ZipFile(build_fmu(scene, folder / "strip.fmu")) as unit:
        unit.extractall(folder / "unit")
    return folder / "unit" / "resources"


@pytest.fixture
def open_one(resources):
    told = []

    def make(name):
        unit = open_unit(str(resources), name, lambda _, __, text: told.append(text), arrays=False)
        unit.set_up(0.0)
        unit.enter_initialization()
        unit.exit_initialization()
        return unit

    make.told = told
    return make


def step_to(unit, number):
    """Take the steps up to a communication point, from where the unit is."""
    for k in range(round(unit.part.present / STEP), number):
        assert unit.step(k * STEP, STEP) is Status.OK


def stage_of(unit):
    return unit.part.simulation.model.present_stage.name


def assert_same(part, reference):
    assert set(part.arrays) == set(reference.arrays)
    for name, array in reference.arrays.items():
        assert part.arrays[name].tobytes() == array.tobytes(), name
    assert part.values == reference.values


def test_steps_of_a_master_cross_the_borders_as_a_run_does(open_one):
    """A border within a step is met at its own time: the state is that of a run, bit for bit."""
    unit, simulation = open_one("crossing"), simulation_of(*NAMES)
    found = []
    for number in (1, 2, 3, 4):
        step_to(unit, number)
        found.append(stage_of(unit))
        simulation.advance_to(number * STEP, lambda _: simulation.require_resolved())
        for name, array in simulation.state.as_dict().items():
            assert np.array_equal(getattr(unit.part.simulation.state, name), array), (number, name)
    assert found == [BEFORE, BEFORE, BETWEEN, AFTER], open_one.told


def test_a_rollback_of_a_unit_goes_back_over_the_borders(open_one):
    """To the stage before, in the same unit and by bytes in another one; both go on alike."""
    unit, other = open_one("first"), open_one("second")
    step_to(unit, 2)
    saved = unit.save()
    states = []
    for number in (3, 4, 5):
        step_to(unit, number)
        states.append(unit.save().part)
    assert stage_of(unit) == AFTER
    assert states[-1].arrays["state_gripper_force"].any(), "the last stage draws"
    assert unit.restore(saved) is Status.OK
    assert stage_of(unit) == BEFORE
    content = read_state(saved.to_bytes())
    assert isinstance(content, SavedState)
    assert other.restore(content) is Status.OK
    for one in (unit, other):
        for number, reference in zip((3, 4, 5), states, strict=True):
            step_to(one, number)
            assert_same(one.save().part, reference)


def test_a_state_of_a_later_stage_is_taken_at_the_start(open_one):
    """Forward over the borders: what the unit has not computed itself it goes on from."""
    unit, other = open_one("first"), open_one("second")
    step_to(unit, 4)
    assert stage_of(other) == BEFORE
    assert other.restore(unit.save()) is Status.OK
    assert stage_of(other) == AFTER
    for one in (unit, other):
        step_to(one, 5)
    assert_same(other.save().part, unit.save().part)


def test_outputs_tell_what_grippers_do(open_one):
    """Force and way of each, whether it holds, and the same after a rollback."""
    unit, reference = open_one("grips"), simulation_of(*NAMES)
    slots = unit.values.layout.slots

    def outputs():
        found = {**unit.part.outputs(GRIPPERS), **unit.part.outputs(MEANS)}
        assert set(found) <= set(slots)
        return found

    step_to(unit, 2)
    before = outputs()
    assert before["clamp.holds"] == before["spring.holds"] == 0.0  # not at work yet
    saved = unit.save()
    step_to(unit, 4)
    first = outputs()
    assert stage_of(unit) == AFTER and first["clamp.holds"] == first["spring.holds"] == 1.0
    for number in (1, 2, 3, 4):
        earlier = reference.state.copy()
        reference.advance_to(number * STEP, lambda _: reference.require_resolved())
    state = reference.state
    pulled = (state.gripper_impulse - earlier.gripper_impulse)[0] / STEP
    held = (state.support_impulse - earlier.support_impulse)[0] / STEP
    for axis, pull, hold in zip("xyz", pulled, held):
        assert first[f"spring.mean_grip_force_{axis}"] == pytest.approx(pull, rel=1e-12)
        assert first[f"clamp.mean_grip_force_{axis}"] == pytest.approx(hold, rel=1e-12)
    assert abs(pulled[0]) > 0.0 and abs(held[0]) > 0.0
    for axis, pull, hold in zip("xyz", state.gripper_force[0], state.support_force[0]):
        assert first[f"spring.grip_force_{axis}"] == pull
        assert first[f"clamp.grip_force_{axis}"] == hold
    grip = reference.model.grips[1]
    way = state.position[:, grip.nodes] @ grip.weights - grip.place
    assert first["spring.grip_force_x"] > 0.0
    assert abs(way[0]) > 1e-6 and first["spring.grip_travel_x"] == way[0]
    assert unit.restore(saved) is Status.OK
    assert outputs() == before
    step_to(unit, 4)
    assert outputs() == first
    (holds,) = [v for v in unit.values.layout.variables if v.name == "clamp.holds"]
    assert holds.kind is Kind.BOOLEAN


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_with_grippers_is_valid(tmp_path, fmi):
    path = tmp_path / "strip.toml"
    path.write_text(text_of(*NAMES), encoding="utf-8")
    unit = build_fmu(path, tmp_path / "strip.fmu", fmi=fmi)
    assert validate_fmu(str(unit)) == []
    assert "clamp.holds" in {v.name for v in read_model_description(str(unit)).modelVariables}
