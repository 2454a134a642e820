"""The order of a step: nothing is done before what it needs, nothing twice, and no bit changes."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.effects.fibre_bending import FORCE_ROWS, INDEX_ROWS, MIDDLE_ROWS, VECTOR_ROWS
from lcmchain.elements.blocks import LANES, NODE_CHUNK, in_blocks
from lcmchain.elements.solid_shell.kernel import CORNER_ROWS
from lcmchain.model import PlacedBody, build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.schedule import LEAST_BATCH, build_schedule
from lcmchain.solver.simulation import Simulation

STAGES = ("block", "middle", "vector", "sum", "chunk")


def performed(schedule):
    """When each piece of a stage is done: (phase, batch, place within the batch)."""
    found = {stage: {} for stage in STAGES}
    for phase in range(schedule.phase_start.size - 1):
        for batch in range(schedule.phase_start[phase], schedule.phase_start[phase + 1]):
            place = 0
            for tile in range(schedule.batch_start[batch], schedule.batch_start[batch + 1]):
                for stage in STAGES:
                    start = getattr(schedule, f"{stage}_start")
                    for piece in getattr(schedule, stage)[start[tile] : start[tile + 1]]:
                        assert int(piece) not in found[stage], f"{stage} {piece} is done twice"
                        found[stage][int(piece)] = (phase, batch, place)
                        place += 1
    return found


def is_after(later, earlier):
    """Whether a piece surely finds another one done: in an earlier phase, or before it in one."""
    if later[0] != earlier[0]:
        return later[0] > earlier[0]
    return later[1] == earlier[1] and later[2] > earlier[2]


def schedule_of(model, batches, number=0):
    """The order of a step of one of the bodies."""
    bending = None if model.fibre_bending is None else model.fibre_bending.data
    placed, nodes = model.placed[number], model.nodes
    return build_schedule(
        [placed], placed.data.corner_node, bending, nodes.force_slot, nodes.chunk_start, batches
    )


def require_order(model, schedule):
    done = performed(schedule)
    corners = model.placed[0].data.corner_node.reshape(-1, 8 * LANES)
    chunk_of = [set((nodes // NODE_CHUNK).tolist()) for nodes in corners]
    assert sorted(done["block"]) == list(range(len(corners)))
    assert sorted(done["chunk"]) == list(range(-(-model.node_count // NODE_CHUNK)))
    for block, chunks in enumerate(chunk_of):
        for chunk in chunks:
            assert is_after(done["chunk"][chunk], done["block"][block])
    require_forces_kept(model, schedule, chunk_of, done)
    if model.fibre_bending is None:
        assert not done["middle"] and not done["vector"] and not done["sum"]
        return
    indices = model.fibre_bending.data.indices.reshape(-1, INDEX_ROWS, LANES)
    uses = {piece: [] for piece in range(len(indices))}
    for piece, rows in enumerate(indices):
        for chunk in set((rows[:2] // NODE_CHUNK).ravel().tolist()):
            # the positions are read before the nodes move, the forces are there when they do
            assert is_after(done["chunk"][chunk], done["middle"][piece])
            assert is_after(done["chunk"][chunk], done["sum"][piece])
            uses[piece].append(done["chunk"][chunk])
        for needed in {piece, *(rows[2:6] // (MIDDLE_ROWS * LANES)).ravel().tolist()}:
            assert is_after(done["vector"][piece], done["middle"][needed])
            uses[needed].append(done["vector"][piece])
        for needed in {piece, *(rows[6:] // (VECTOR_ROWS * LANES)).ravel().tolist()}:
            assert is_after(done["sum"][piece], done["vector"][needed])
            uses[needed].append(done["sum"][piece])
    require_places_left(schedule.bending_place, done["middle"], uses)


def require_forces_kept(model, schedule, chunk_of, done):
    """Forces lie where they are looked for, and stay there until they have been summed up."""
    bending = 0 if model.fibre_bending is None else model.fibre_bending.data.first_force
    for first, rows, place in (
        (0, CORNER_ROWS, schedule.place),
        (bending, FORCE_ROWS, schedule.bending_place),
    ):
        slot = model.nodes.force_slot
        inside = (slot >= first) & (slot < first + place.size * rows * LANES)
        block, within = np.divmod(slot[inside] - first, rows * LANES)
        moved = first + place[block] * rows * LANES + within
        np.testing.assert_array_equal(schedule.force_slot[inside], moved)
    uses = {
        block: [done["chunk"][chunk] for chunk in chunks] for block, chunks in enumerate(chunk_of)
    }
    require_places_left(schedule.place, done["block"], uses)


def require_places_left(place, written, uses):
    """Nothing is written to a place before all that reads what was there has been done."""
    for one in set(place.tolist()):
        pieces = sorted(np.flatnonzero(place == one).tolist(), key=lambda piece: written[piece])
        for before, after in pairwise(pieces):
            assert all(is_after(written[after], use) for use in uses[before])


SHEET = """
process = { time = "2 ms" }
blank = { size = ["150 mm", "120 mm"], edge_length = "5 mm", fibre_angle = "30 deg" }
material = { preset = "MD600" }
"""


@pytest.mark.parametrize("batches", [1, 2, 3, 8, 1000])
@pytest.mark.parametrize("in_plane", [True, False])
def test_nothing_is_done_before_what_it_needs(batches, in_plane):
    overrides = () if in_plane else ("material.bending.in_plane=0.0",)
    model = build_model(scene_from_text(SHEET, overrides=overrides))
    assert (model.fibre_bending is not None) == in_plane
    schedule = schedule_of(model, batches)
    require_order(model, schedule)
    blocks = model.placed[0].data.corner_node.size // (8 * LANES)
    assert schedule.phase_start[1] == min(batches, -(-blocks // LEAST_BATCH))
    if batches == 1:
        assert schedule.phase_start.tolist() == [0, 1]


@pytest.mark.parametrize("batches", [1, 2, 5])
@pytest.mark.parametrize("edge", ["4 mm", "2.5 mm"])
def test_rows_of_any_length_in_tiles_of_any_size(edge, batches, monkeypatch):
    overrides = (f"blank.edge_length={edge}", "blank.fibre_angle=0 deg")
    model = build_model(scene_from_text(SHEET, overrides=overrides))
    for tile in (1, 2, 4):
        monkeypatch.setattr("lcmchain.solver.schedule.TILE", tile)
        require_order(model, schedule_of(model, batches))


def test_forces_lie_where_others_have_been_summed_up():
    model = build_model(scene_from_text(SHEET, overrides=("blank.edge_length=1 mm",)))
    schedule = schedule_of(model, 2)
    # two batches, and in each of them little more than the tiles at work
    assert schedule.place.max() < 0.25 * schedule.place.size
    assert schedule.bending_place.max() < 0.25 * schedule.bending_place.size


def test_in_the_second_round_parts_complete_what_lies_between_them():
    overrides = ("blank.edge_length=2.5 mm", "blank.fibre_angle=0 deg")
    model = build_model(scene_from_text(SHEET, overrides=overrides))
    schedule = schedule_of(model, 2)
    require_order(model, schedule)
    assert schedule.phase_start.tolist() == [0, 2, 4]


@given(st.integers(0, 10**6), st.integers(1, 9), st.integers(1, 400), st.integers(9, 2000))
def test_any_numbering_of_elements_and_nodes_will_do(seed, batches, element_count, node_count):
    random = np.random.default_rng(seed)
    # some numberings along the sheet, some across it
    reach = random.choice([3, 50, node_count])
    middle = np.linspace(0, node_count - 1, element_count)[:, None]
    nodes = np.clip(middle + random.integers(-reach, reach + 1, (element_count, 8)), 0, None)
    nodes = np.minimum(nodes, node_count - 1).astype(np.int32)
    mid_count = max(1, node_count // 2)
    own = np.arange(mid_count)
    ends = np.clip(own + random.integers(-reach, reach + 1, (4, mid_count)), 0, mid_count - 1)

    def place(node, rows):
        return node // LANES * rows * LANES + node % LANES

    columns = [own, own + node_count // 2, *place(ends, MIDDLE_ROWS), *place(ends, VECTOR_ROWS)]
    columns[1] = np.minimum(columns[1], node_count - 1)
    indices = in_blocks(np.column_stack(columns).astype(np.int32))
    size = -(-element_count // LANES) * CORNER_ROWS * LANES
    data = SimpleNamespace(
        indices=indices, start=np.zeros(-(-mid_count // LANES)), first_force=size
    )
    chunk_start = np.append(np.arange(0, node_count, NODE_CHUNK), node_count)
    placed = PlacedBody(
        SimpleNamespace(corner_node=in_blocks(nodes)), 0, node_count, 0, chunk_start.size - 1,
        0, size, 0, 0, 0, data.start.size,
    )  # fmt: skip
    model = SimpleNamespace(
        placed=(placed,),
        fibre_bending=SimpleNamespace(data=data),
        node_count=node_count,
        nodes=SimpleNamespace(
            force_slot=random.integers(0, 2 * size, (3, node_count)), chunk_start=chunk_start
        ),
    )
    # tiles of a block or two: many turns for so few elements
    with patch("lcmchain.solver.schedule.TILE", int(random.integers(1, 3))):
        schedule = schedule_of(model, batches)
    require_order(model, schedule)


CUP = """
process = { time = "2 ms", mass_damping = "200 1/s" }
blank = { size = ["150 mm", "120 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
contact = { friction = 0.2 }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "25 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "2 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "28 mm", fillet_radius = "10 mm", side = "below" }
"""


@pytest.mark.parametrize("angle", ["0 deg", "30 deg"])
def test_the_number_of_parts_changes_no_bit(monkeypatch, angle):
    """Of a sheet whose elements are all alike, and of one that its outline cuts."""

    def formed(batches):
        scene = scene_from_text(CUP, overrides=(f"blank.fibre_angle={angle}",))
        simulation = Simulation.from_scene(scene)
        assert (simulation.model.only_body().data.general is None) == (angle == "0 deg")
        monkeypatch.setattr(
            "lcmchain.solver.loop.build_schedule",
            lambda *arguments: build_schedule(*arguments[:-1], batches),
        )
        simulation.advance_to(2e-3)
        return {name: array.tobytes() for name, array in simulation.state.as_dict().items()}

    one = formed(1)
    for batches in (2, 3, 5):
        assert formed(batches) == one
