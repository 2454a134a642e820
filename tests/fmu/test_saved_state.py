"""A forming unit goes on only from a state of its own: same unit, same files, same sources."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lcmchain import compile_cache
from lcmchain.errors import LcmchainError, SimulationError
from lcmchain.fmu import forming_slave
from lcmchain.fmu.forming_slave import FormingSlave, sheet_mesh, variables_of
from lcmchain.fmu.saved_state import SavedState
from lcmchain.model import build_model
from lcmchain.scene import read_scene
from lcmchain.solver.simulation import Snapshot
from lcmchain.state import State


@pytest.fixture
def slave(unpacked):
    folder, _ = unpacked
    return FormingSlave(instance_name="one", resources=f"{folder}/resources")


def test_a_state_of_the_same_unit_is_taken(slave):
    saved = SavedState.from_bytes(slave._get_fmu_state().to_bytes())
    slave._set_fmu_state(replace(saved, start_time=0.25))
    assert slave._get_fmu_state().start_time == 0.25


def test_a_state_of_another_unit_is_refused(slave):
    with pytest.raises(SimulationError, match="another unit"):
        slave._set_fmu_state(replace(slave._get_fmu_state(), guid="another"))


@pytest.mark.parametrize(
    ("part", "words"),
    [("files", "mesh files"), ("sources", "other source files of lcmchain")],
)
def test_a_state_of_other_files_or_sources_is_refused(slave, part, words):
    saved = slave._get_fmu_state()
    fingerprint = saved.fingerprint._replace(**{part: "other"})
    foreign = SavedState.from_bytes(replace(saved, fingerprint=fingerprint).to_bytes())
    with pytest.raises(SimulationError, match=words):
        slave._set_fmu_state(foreign)


def test_the_fingerprint_is_that_of_the_sources_that_run(slave, unpacked, tmp_path, monkeypatch):
    monkeypatch.setattr(compile_cache, "_package_folders", lambda: [tmp_path])
    other = FormingSlave(instance_name="other", resources=f"{unpacked[0]}/resources")
    assert other.guid == slave.guid  # the interface is the same
    with pytest.raises(SimulationError, match="other source files"):
        other._set_fmu_state(slave._get_fmu_state())


def test_bytes_hold_the_whole_state(slave, scene_file):
    """Every entry of the state, and of the frames saved on the way."""
    model = build_model(read_scene(scene_file))
    rng = np.random.default_rng(0)
    state = State.at_rest(model)
    for array in state.as_dict().values():
        array[...] = rng.integers(0, 100, array.shape)
    frames = tuple(
        Snapshot(0.1 * k, {"kinetic": k}, {name: a + k for name, a in state.frame().items()})
        for k in range(3)
    )
    saved = replace(
        slave._get_fmu_state(), state=state, critical_step=1.5e-6, start_time=0.5, frames=frames,
        failure="stopped",
    )  # fmt: skip
    read = SavedState.from_bytes(saved.to_bytes())
    for name, array in state.as_dict().items():
        assert getattr(read.state, name).tobytes() == array.tobytes(), name
    for one, other in zip(read.frames, frames, strict=True):
        assert (one.time, one.energy) == (other.time, other.energy)
        assert set(one.arrays) == set(other.arrays) == set(state.frame())
        for name, array in other.arrays.items():
            assert np.array_equal(one.arrays[name], array), name
    assert replace(read, state=None, frames=()) == replace(saved, state=None, frames=())


def test_bytes_that_are_no_state_are_refused(slave):
    for content in (b"no archive", b"", slave._get_fmu_state().to_bytes()[:-30]):
        with pytest.raises(LcmchainError, match="no saved state"):
            FormingSlave._fmu_state_from_bytes(content)


@pytest.mark.parametrize("element", ["solid-shell", "membrane-shell"])
def test_a_unit_counts_the_elements_of_the_model(scene_file, element, monkeypatch):
    """Two triangles for each hexahedron."""
    counts = []
    monkeypatch.setattr(
        forming_slave, "forming_variables", lambda tools, count, **has: counts.append(count)
    )
    scene = read_scene(scene_file, [f"element={element}"])
    variables_of(scene, sheet_mesh(scene))
    model = build_model(scene)
    assert counts == [model.element_count] == [400 if element == "solid-shell" else 800]


@pytest.mark.parametrize("shear", [0.3, -0.3])
def test_outputs_are_those_of_the_fields(slave, scene_file, shear):
    """Extrema over all elements, of shear angles their size."""
    model = build_model(read_scene(scene_file))
    state = State.at_rest(model)
    x, y, z = state.position
    x += shear * y
    middle = z.mean()  # the mid-surface stays plane: no bends
    z[:] = middle + (z - middle) * np.where(x > 0.0, 0.9, 1.1)
    slave._simulation = SimpleNamespace(model=model, state=state)
    outputs = slave._field_outputs()
    angle = np.arctan(abs(shear))
    assert outputs["shear_angle_max"] == pytest.approx(angle, rel=1e-2)
    for name in ("thickness", "fibre_volume_fraction"):
        assert outputs[f"{name}_min"] == outputs[name].min() < outputs[name].max()
        assert outputs[f"{name}_max"] == outputs[name].max()
    assert outputs["thickness_min"] == pytest.approx(0.9 * model.material.thickness, rel=1e-9)
