"""Arrays are declared once: loop, frames, saved states and checks follow."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.model import NodeData
from lcmchain.scene import scene_from_text
from lcmchain.solver.loop import Arrays
from lcmchain.solver.simulation import Simulation
from lcmchain.state import Scratch, State, sizes

SCENE = """
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "{height} mm"], edge_length = "5 mm", height = "0.502 mm" }}
material = {{ preset = "MD600" }}

[[tools]]
name = "die"
shape = {{ type = "plate", side = "below" }}
"""


def simulation(height=10):
    return Simulation.from_scene(scene_from_text(SCENE.format(height=height)))


def test_every_declaration_says_what_the_array_is():
    for declared in (*fields(State), *fields(Scratch)):
        about = declared.metadata
        assert about["shape"] and about["unit"] and len(about["meaning"]) > 5, declared.name


def test_the_loop_gets_every_array_and_nothing_else():
    names = [*NodeData._fields, *State.names(), *Scratch.names()]
    assert list(Arrays._fields) == list(dict.fromkeys(names))
    # which components are free is a constant at first; a support that lets go changes it
    assert [name for name in set(names) if names.count(name) > 1] == ["free"]
    sim = simulation()
    for name in State.names():
        if name != "free":
            assert getattr(sim._arrays, name) is getattr(sim.state, name)
    assert sim._arrays.free is None


def test_arrays_have_the_declared_shapes():
    sim = simulation()
    size = sizes(sim.model)
    assert (size["node"], size["tool"]) == (30, 1)
    for declared in fields(State):
        expected = tuple(size[name] for name in declared.metadata["shape"])
        assert getattr(sim.state, declared.name).shape == expected
    np.testing.assert_array_equal(sim.state.position.T, sim.model.only_body().mesh.node_positions)


def test_a_copy_is_whole_and_independent():
    state = simulation().state
    copied = state.copy()
    for name, array in state.as_dict().items():
        other = getattr(copied, name)
        np.testing.assert_array_equal(other, array)
        assert other.size == 0 or not np.shares_memory(other, array), name


def test_frames_hold_what_is_declared_for_them():
    sim = simulation()
    frame = sim.snapshot()
    framed = {declared.name for declared in fields(State) if declared.metadata["in_frames"]}
    assert framed == set(frame.arrays)
    assert framed == {
        "position", "tool_travel", "tool_force", "contact_force", "history", "pore_pressure"
    }  # fmt: skip
    sim.state.position += 1.0
    np.testing.assert_array_equal(frame.position, sim.model.only_body().mesh.node_positions)


def test_arrays_that_are_missing_or_unknown_are_named():
    arrays = simulation().state.as_dict()
    del arrays["stick"]
    with pytest.raises(ValueError, match="missing or unknown arrays: extra, stick"):
        State.from_arrays({**arrays, "extra": np.zeros(3)})


def test_the_state_of_another_model_is_refused():
    sim, other = simulation(), simulation(height=15)
    with pytest.raises(InputError, match=r"another model: position is float64 \(3, 40\) instead"):
        sim.restore(other.state)
    with pytest.raises(InputError, match="another model"):  # where a simulation begins with it
        Simulation(sim.model, other.state)
    wrong_type = State(**sim.state.as_dict() | {"near": sim.state.near.astype(float)})
    with pytest.raises(InputError, match="near is float64 .* instead of uint8"):
        sim.restore(wrong_type)
