"""Blocks of 16 lanes, and constants that several of them share."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.elements.blocks import (
    LANES,
    NODE_CHUNK,
    SAME,
    from_blocks,
    in_blocks,
    in_shared_blocks,
    own_blocks,
)
from lcmchain.elements.solid_shell.kernel import ALIGNED_ROWS, GENERAL
from lcmchain.mesh.lattice import STRETCH
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SCENE = """
process = { time = "2 ms" }
blank = { size = ["300 mm", "250 mm"], edge_length = "EDGE mm", fibre_angle = "ANGLE deg" }
material = { preset = "MD600" }
"""

DRAWN = """
process = { time = "2 ms", gravity = true }
blank = { size = ["100 mm", "80 mm"], edge_length = "5 mm", fibre_angle = "30 deg" }
material = { preset = "MD600" }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 0.502 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "2 mm" }
"""


def model_of(edge=5.0, angle=0.0):
    text = SCENE.replace("EDGE", str(edge)).replace("ANGLE", str(angle))
    return build_model(scene_from_text(text))


def unpacked(blocks, row_count, count):
    """The rows (E, R) that the blocks stand for."""
    size = row_count * LANES
    values = np.concatenate([blocks.values[i : i + size] for i in blocks.start])
    return from_blocks(values, row_count, count)


@pytest.mark.parametrize("count", [1, 16, 40, 100])
def test_rows_come_back_from_blocks(count):
    rows = np.random.default_rng(0).normal(size=(count, 5))
    np.testing.assert_array_equal(from_blocks(in_blocks(rows), 5, count), rows)
    np.testing.assert_array_equal(unpacked(own_blocks(rows), 5, count), rows)
    shared = in_shared_blocks(rows, np.ones(5))
    np.testing.assert_array_equal(unpacked(shared, 5, count), rows)


def test_rows_that_differ_by_rounding_are_shared_and_others_are_not():
    rng = np.random.default_rng(1)
    kinds = rng.normal(size=(2, 3))
    rows = kinds[np.repeat([0, 1, 0, 0, 1, 0], LANES)]
    noise = rows * (1.0 + 0.1 * SAME * rng.uniform(-1.0, 1.0, rows.shape))
    shared = in_shared_blocks(noise, np.abs(kinds).max(axis=0))
    assert shared.values.size == 2 * 3 * LANES
    assert shared.start.tolist() == [0, 48, 0, 0, 48, 0]
    np.testing.assert_allclose(unpacked(shared, 3, len(rows)), rows, rtol=0.0, atol=3.0 * SAME)
    rows[40, 1] += 1e-9  # one lane of the third block
    shared = in_shared_blocks(rows, np.abs(kinds).max(axis=0))
    np.testing.assert_array_equal(unpacked(shared, 3, len(rows)), rows)
    assert shared.values.size == 3 * 3 * LANES


def test_the_elements_of_a_regular_sheet_have_one_block_of_constants():
    data = model_of().only_body().data
    assert data.element_data.start.size == 3000 // LANES + 1
    assert data.element_data.values.size == 19 * LANES
    assert data.quick_data.values.size == ALIGNED_ROWS * LANES
    assert (data.quick_data.start == 0).all()
    assert data.general is None


@pytest.mark.parametrize("angle", [10.0, 30.0, 45.0])
def test_elements_that_a_turned_outline_cuts_keep_their_own_and_the_others_share_one(angle):
    """Cut elements come together: few blocks have one, hardly more than there are cut elements."""
    body = model_of(angle=angle).only_body()
    data, count = body.data, body.mesh.element_count
    assert data.element_data.values.size == 66 * LANES * data.element_data.start.size
    assert data.quick_data.values.size == ALIGNED_ROWS * LANES
    is_flat = data.quick_data.start != GENERAL
    assert (data.quick_data.start[is_flat] == 0).all()
    of_block = np.pad(body.geometry.flat, (0, -count % LANES), mode="edge").reshape(-1, LANES)
    np.testing.assert_array_equal(is_flat, of_block.all(axis=1))
    assert is_flat.mean() > body.geometry.flat.mean() - LANES / STRETCH


def test_a_cut_sheet_moves_as_it_does_when_all_its_elements_count_as_curved(monkeypatch):
    def formed(quick):
        simulation = Simulation.from_scene(scene_from_text(DRAWN))
        assert (simulation.model.only_body().data.quick_data is not None) == quick
        simulation.advance_to(1e-3)
        return simulation.state

    fast = formed(True)
    monkeypatch.setattr("lcmchain.elements.solid_shell.body.quick_blocks", lambda geometry: None)
    slow = formed(False)
    assert fast.step_count == slow.step_count
    reference = slow.position
    moved = np.abs(reference - Simulation.from_scene(scene_from_text(DRAWN)).state.position).max()
    assert moved > 1e-4
    np.testing.assert_allclose(fast.position, reference, rtol=0.0, atol=1e-10 * moved)
    np.testing.assert_allclose(
        fast.velocity, slow.velocity, rtol=0.0, atol=1e-9 * np.abs(slow.velocity).max()
    )


def test_a_sheet_along_its_fibres_moves_as_parallelograms_do(monkeypatch):
    """Drawn over a punch, so that its elements share curvature; their edges have unlike lengths."""
    overrides = ('blank.size=["100 mm", "83 mm"]', 'blank.fibre_angle="0 deg"')
    scene = scene_from_text(DRAWN, overrides=overrides)

    def formed(quick):
        simulation = Simulation.from_scene(scene)
        data = simulation.model.only_body().data
        assert (data.quick_data is not None) == quick
        assert (data.general is None) == quick
        simulation.advance_to(1e-3)
        return simulation.state

    aligned = formed(True)
    monkeypatch.setattr("lcmchain.elements.solid_shell.body.quick_blocks", lambda geometry: None)
    general = formed(False)
    assert aligned.step_count == general.step_count
    moved = np.abs(general.position - Simulation.from_scene(scene).state.position).max()
    assert moved > 1e-4
    np.testing.assert_allclose(aligned.position, general.position, rtol=0.0, atol=1e-10 * moved)


@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_chunks_of_nodes_are_taken_in_the_order_of_their_elements(angle):
    """Each once; and from front to back they read the corner forces from front to back."""
    nodes = model_of(angle=angle).nodes
    order = nodes.chunk_order
    count = -(-nodes.mass.size // NODE_CHUNK)
    assert sorted(order) == list(range(count))
    first = nodes.force_slot[0]
    place = [np.median(first[c * NODE_CHUNK : (c + 1) * NODE_CHUNK]) for c in order]
    assert (np.diff(place) >= 0.0).all()
    # the two faces lie far from each other as nodes, but are read together
    assert np.abs(np.diff(order)).max() > count // 3
