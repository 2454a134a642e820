"""A unit goes on only from a state of its own: same unit, same files, same sources."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain import provenance
from lcmchain.compilation import cache as compile_cache
from lcmchain.errors import SimulationError
from lcmchain.fmu.conduct import Phase, Status
from lcmchain.fmu.forming import variables as interface
from lcmchain.fmu.forming.part import BeforeStep
from lcmchain.fmu.forming.variables import meshes_of, variables_of
from lcmchain.fmu.instances import open_unit, read_state
from lcmchain.fmu.part import PartState, SavedState, Unreadable
from lcmchain.fmu.variables import Kind
from lcmchain.model import build_model
from lcmchain.scene import read_scene
from lcmchain.state import State

STEP = 5e-4


@pytest.fixture
def told():
    return []


@pytest.fixture
def open_one(unpacked, told):
    def make(name="one"):
        hear = lambda status, category, text: told.append(text)  # noqa: E731
        return open_unit(f"{unpacked[0]}/resources", name, hear, arrays=False)

    return make


@pytest.fixture
def one(open_one):
    return open_one()


def started(unit):
    unit.set_up(0.0)
    unit.enter_initialization()
    unit.exit_initialization()
    return unit


def test_a_state_of_the_same_unit_is_taken(one):
    saved = SavedState.from_bytes(one.save().to_bytes())
    assert one.restore(replace(saved, start_time=0.25)) is Status.OK
    assert one.save().start_time == 0.25


def test_a_state_of_another_unit_is_refused(one, told):
    assert one.restore(replace(one.save(), guid="another")) is Status.ERROR
    assert "another unit" in told[-1]


@pytest.mark.parametrize("foreign", [None, 1, "text", object()])
def test_what_is_no_state_is_refused(one, told, foreign):
    assert one.restore(foreign) is Status.ERROR
    assert "no state of a unit" in told[-1]


@pytest.mark.parametrize("part", ["mesh files", "source files of lcmchain"])
def test_a_state_of_other_files_or_sources_is_refused(one, told, part):
    saved = one.save()
    (name,) = (name for name in saved.fingerprint if part in name)
    foreign = replace(saved, fingerprint={**saved.fingerprint, name: "other"})
    assert one.restore(SavedState.from_bytes(foreign.to_bytes())) is Status.ERROR
    assert part in told[-1]


def test_the_fingerprint_is_that_of_the_sources_that_run(open_one, tmp_path, monkeypatch, told):
    one = open_one()
    monkeypatch.setattr(compile_cache, "_package_folders", lambda: [tmp_path])
    # asked anew, as another process would
    monkeypatch.setattr(provenance, "_sources", provenance._sources.__wrapped__)
    other = open_one("other")
    assert other.definition.guid == one.definition.guid  # the interface is the same
    assert other.restore(one.save()) is Status.ERROR
    assert "other source files" in told[-1]


def test_bytes_hold_the_whole_state(one):
    """Every entry of the state, and of the frames saved on the way."""
    started(one)
    rng = np.random.default_rng(0)
    part = one.part
    for array in part.simulation.state.as_dict().values():
        array[...] = rng.integers(0, 100, array.shape)
    part.frames = tuple(part.simulation.snapshot() for _ in range(3))
    part.critical_step, part.step = 1.5e-6, 2.5e-4
    part.before = BeforeStep(**{n: rng.random(a.shape) for n, a in vars(part.before).items()})
    saved = replace(one.save(), start_time=0.5, message="stopped", outcome=1, phase=Phase.STEPPING)
    read = SavedState.from_bytes(saved.to_bytes())
    assert set(read.part.arrays) == set(saved.part.arrays)
    for name, array in saved.part.arrays.items():
        assert read.part.arrays[name].tobytes() == array.tobytes(), name
        assert read.part.arrays[name].dtype == array.dtype
    assert sum(name.startswith("state_") for name in read.part.arrays) == len(State.names())
    assert read.part.values == saved.part.values
    assert {name: list(v) for name, v in read.numbers.items()} == {
        name: list(v) for name, v in saved.numbers.items()
    }
    stripped = {"part": None, "numbers": {}}
    assert replace(read, **stripped) == replace(saved, **stripped)


def test_bytes_that_are_no_state_are_refused(one, told):
    good = one.save().to_bytes()
    for content in (b"no archive", b"", good[:-30], good + b"x", good[:40]):
        found = read_state(content)
        assert isinstance(found, Unreadable)
        assert one.restore(found) is Status.ERROR
        assert str(found) in told[-1]


def test_no_flipped_bit_of_a_state_is_taken(one):
    """Also among the numbers of its fields, where nothing but the check sum can tell."""
    good = started(one).save().to_bytes()
    for place in range(0, len(good), len(good) // 200):
        content = bytearray(good)
        content[place] ^= 1 << place % 8
        assert isinstance(read_state(bytes(content)), Unreadable), place
    assert isinstance(read_state(good), SavedState)


@pytest.mark.parametrize(
    "change",
    [
        lambda part: PartState({}, part.arrays),
        lambda part: PartState(part.values, {}),
        lambda part: PartState(part.values, {**part.arrays, "before_position": np.zeros(3)}),
        lambda part: PartState(part.values, {**part.arrays, "before_tool_impulse": np.zeros(3)}),
        lambda part: PartState(part.values, {**part.arrays, "state_clock": np.zeros(3)}),
    ],
)
def test_a_state_with_parts_missing_leaves_the_unit_as_it_was(one, told, change):
    """Its check sum may fit: it can have been written by a defect."""
    started(one)
    assert one.step(0.0, STEP) is Status.OK
    saved, reference = one.save(), outputs(one)
    assert one.restore(replace(saved, part=change(saved.part))) is Status.ERROR
    assert outputs(one) == reference
    assert one.restore(saved) is Status.OK
    assert one.step(STEP, STEP) is Status.OK


def outputs(unit):
    """Every number of the unit, as bytes."""
    found = []
    for kind in (Kind.REAL, Kind.INTEGER):
        slots = [unit.layout.slots[v.name] for v in unit.definition.variables if v.kind is kind]
        references = [k for where in slots for k in range(where.start, where.stop)]
        found.append(unit.get_numbers(references, kind).tobytes())
    return found


def test_rollback_over_five_steps_is_bit_identical(one):
    started(one)
    assert one.step(0.0, STEP) is Status.OK

    def five():
        states = []
        for k in range(1, 6):
            assert one.step(k * STEP, STEP) is Status.OK
            states.append((outputs(one), one.save().part))
        return states

    saved = one.save()
    first = five()
    assert one.restore(saved) is Status.OK
    for (mine, my_state), (other, other_state) in zip(five(), first, strict=True):
        assert mine == other
        for name, array in other_state.arrays.items():
            assert my_state.arrays[name].tobytes() == array.tobytes(), name
    assert len({tuple(reached) for reached, _ in first}) == 5, "every step changes something"


@pytest.mark.parametrize(
    ("name", "kind"),
    [("punch.travel", Kind.REAL), ("internal_energy", Kind.REAL), ("thickness_min", Kind.REAL),
     ("step_count", Kind.INTEGER)],
)  # fmt: skip
def test_outputs_of_every_group_are_those_of_the_last_step(one, name, kind):
    started(one)
    where = [one.layout.slots[name].start]
    found = [float(one.get_numbers(where, kind)[0])]
    for k in range(3):
        assert one.step(k * STEP, STEP) is Status.OK
        found.append(float(one.get_numbers(where, kind)[0]))
    assert len(set(found)) == 4, found


def test_a_step_that_fails_at_its_end_is_undone(one, told, monkeypatch):
    """Not only where the solver itself goes back: whatever refuses what was computed."""
    started(one)
    assert one.step(0.0, STEP) is Status.OK
    before = one.save()

    def refuse(*_):
        raise SimulationError("the mesh does not follow")

    with monkeypatch.context() as patched:
        patched.setattr(one.part.simulation, "require_resolved", refuse)
        assert one.step(STEP, STEP) is Status.DISCARD
    assert "stopped and undone: the mesh does not follow" in told[-1]
    after = one.save()
    for key, array in before.part.arrays.items():
        assert after.part.arrays[key].tobytes() == array.tobytes(), key
    assert after.part.values == before.part.values
    assert one.step(STEP, STEP) is Status.OK


RESTORED = """
import sys
from lcmchain.fmu.instances import open_unit, read_state
from lcmchain.fmu.variables import Kind
unit = open_unit(sys.argv[1], "other", lambda *_: None, arrays=False)
unit.restore(read_state(open(sys.argv[2], "rb").read()))
for k in range(1, 6):
    unit.step(k * 5e-4, 5e-4)
open(sys.argv[3], "wb").write(unit.save().to_bytes())
"""


def test_another_process_goes_on_bit_identically(one, unpacked, tmp_path):
    started(one)
    assert one.step(0.0, STEP) is Status.OK
    before, after = tmp_path / "before", tmp_path / "after"
    before.write_bytes(one.save().to_bytes())
    subprocess.run(
        [sys.executable, "-P", "-c", RESTORED, f"{unpacked[0]}/resources", before, after],
        check=True,
    )
    for k in range(1, 6):
        assert one.step(k * STEP, STEP) is Status.OK
    assert after.read_bytes() == one.save().to_bytes()


@pytest.mark.parametrize("element", ["solid-shell", "membrane-shell"])
def test_a_unit_counts_the_elements_of_the_model(scene_file, element, monkeypatch):
    """Two triangles for each hexahedron."""
    counts = []
    monkeypatch.setattr(
        interface, "forming_variables", lambda able, *_: counts.append(able.element_count)
    )
    scene = read_scene(scene_file, [f"element={element}"])
    variables_of(scene)
    model = build_model(scene)
    assert counts == [model.element_count] == [400 if element == "solid-shell" else 800]
    assert meshes_of(scene)[0].element_count == counts[0]


@pytest.mark.parametrize("shear", [0.3, -0.3])
def test_outputs_are_those_of_the_fields(one, scene_file, shear):
    """Extrema over all elements, of shear angles their size."""
    model = build_model(read_scene(scene_file))
    state = State.at_rest(model)
    x, y, z = state.position
    x += shear * y
    middle = z.mean()  # the mid-surface stays plane: no bends
    z[:] = middle + (z - middle) * np.where(x > 0.0, 0.9, 1.1)
    one.part.simulation = SimpleNamespace(model=model, state=state)
    found = one.part.outputs("fields")
    angle = np.arctan(abs(shear))
    assert found["shear_angle_max"] == pytest.approx(angle, rel=1e-2)
    assert np.sign(found["shear_angle"]).tolist() == [np.sign(found["shear_angle"][0])] * 400
    for name in ("thickness", "fibre_volume_fraction"):
        assert found[f"{name}_min"] == found[name].min() < found[name].max()
        assert found[f"{name}_max"] == found[name].max()
    assert found["thickness_min"] == pytest.approx(
        0.9 * model.only_body().material.thickness, rel=1e-9
    )
