"""Sums of corner forces at nodes: run by run the same bits as slot by slot."""

import numpy as np
import pytest

from lcmchain.elements.blocks import EMPTY_ROWS, LANES
from lcmchain.jit import entry
from lcmchain.packs import PACK
from lcmchain.scene import scene_from_text
from lcmchain.solver.loop import gather_internal_forces, runs_of_slots
from lcmchain.solver.simulation import Simulation

FORCES = 40 * LANES


@entry
def gather(arrays, runs, chunk_start):
    for chunk in range(chunk_start.size - 1):
        gather_internal_forces(arrays, runs, chunk, chunk_start[chunk], chunk_start[chunk + 1])


@pytest.fixture(scope="module")
def sheet():
    """Rows of 41 nodes."""
    return Simulation.from_scene(
        scene_from_text(
            'title = "sheet"\n[process]\ntime = "1 ms"\n[material]\npreset = "MD600"\n'
            '[blank]\nsize = ["200 mm", "50 mm"]\nedge_length = "5 mm"\n'
        )
    )


def gathered(sheet, force_slot, chunk_start, seed=1):
    """Return the forces by runs, and one by one, on random corner forces."""
    corner_force = np.random.default_rng(seed).normal(size=FORCES + EMPTY_ROWS)
    corner_force[FORCES:] = 0.0
    runs = runs_of_slots(force_slot, chunk_start, FORCES)
    force = np.full((3, chunk_start[-1]), np.nan)
    arrays = sheet.arrays._replace(force=force, corner_force=corner_force)
    gather(arrays, runs, chunk_start)
    expected = np.zeros_like(arrays.force)
    for slots in force_slot:
        for d in range(3):
            expected[d] -= corner_force[slots + d * LANES]
    return arrays.force, expected, runs


@pytest.mark.parametrize("seed", range(5))
def test_any_slots_give_the_sums_of_their_forces(sheet, seed):
    """Scattered ones, empty ones between, runs that cross, and chunks that end within a pack."""
    random = np.random.default_rng(seed)
    starts = np.array([0, 128, 256, 261, 389, 400], dtype=np.int32)
    slots = random.integers(0, FORCES - 2 * LANES, (4, 400))
    slots[0] = np.arange(400)
    slots[1] = np.where(random.random(400) < 0.3, FORCES, 7 + np.arange(400))
    slots[2, 100:] = FORCES
    found, expected, _ = gathered(sheet, slots.astype(np.int32), starts, seed)
    np.testing.assert_array_equal(found, expected)


def test_nodes_in_a_row_are_read_in_one_run_and_holes_do_not_part_it(sheet):
    slots = np.arange(20, 20 + PACK, dtype=np.int32)[None]
    slots[0, [0, 4]] = FORCES
    found, expected, runs = gathered(sheet, slots, np.array([0, PACK], dtype=np.int32))
    np.testing.assert_array_equal(found, expected)
    assert runs.place.tolist() == [20] and runs.lanes.tolist() == [0b11101110]


def test_the_slots_of_a_sheet_are_mostly_in_runs(sheet):
    """About two and a half runs for each pack of a slot."""
    model = sheet.model
    nodes = model.nodes
    runs = runs_of_slots(nodes.force_slot, nodes.chunk_start, model.empty_slot)
    packs_with_slot = (nodes.force_slot != model.empty_slot).sum() / PACK
    assert runs.place.size < 2.6 * packs_with_slot
