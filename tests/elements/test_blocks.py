"""Blocks of 16 lanes, and constants that several of them share."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.elements.blocks import (
    LANES,
    SAME,
    from_blocks,
    in_blocks,
    in_shared_blocks,
    own_blocks,
)
from lcmchain.model import NODE_CHUNK, build_model
from lcmchain.scene import scene_from_text

SCENE = """
process = { time = "2 ms" }
blank = { size = ["300 mm", "250 mm"], edge_length = "EDGE mm", fibre_angle = "ANGLE deg" }
material = { preset = "MD600" }
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
    data = model_of().body.data
    assert data.element_data.start.size == 3000 // LANES + 1
    assert data.element_data.values.size == 19 * LANES


def test_elements_that_a_turned_outline_cuts_keep_their_own():
    data = model_of(angle=30.0).body.data
    assert data.element_data.values.size > 19 * LANES


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
