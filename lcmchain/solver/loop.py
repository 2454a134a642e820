"""The explicit time loop: central differences with a lumped mass.

One step: internal forces of all elements; per node the sum of its corner forces, contact with the
tools near it, and the update of velocity and position; then supported nodes and tools. Sums over
nodes are made per chunk of nodes and then over the chunks in a fixed order: bit-identical for any
number of threads.

Every node has slots: places where the x-components of forces on it lie; y and z follow one and two
rows of a block behind. Elements and nodes are mostly numbered along the rows of a mesh. What eight
neighbours find in their first slots then lies in one run of memory, or in two, where a row or a
block ends. A pack of nodes reads run by run.

Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", box 6.1, with a variable step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll, prange

from lcmchain.compilation.references import Reference, referred
from lcmchain.effects.fibre_bending import (
    add_vectors,
    at_places,
    fibre_bending_forces,
    find_middle,
    find_vectors,
)
from lcmchain.effects.gravity import weight_at, weights_of
from lcmchain.effects.interaction import (
    add_to_nodes,
    after_nodes,
    before_nodes,
    begin_steps,
    scratch_size,
)
from lcmchain.effects.process.damping import averaged_velocity, damped_velocity
from lcmchain.elements.blocks import LANES, PACKS_OF_CHUNK
from lcmchain.elements.family import internal_forces
from lcmchain.elements.solid_shell.kernel import SolidShellData, forces_of_block
from lcmchain.elements.solid_shell.together import kinds_of, put_together
from lcmchain.jit import (
    equation,
    kernel_part,
    standalone_loop,
    standalone_routine,
    standalone_span_routine,
    uncounted_entry,
    uncounted_routine,
)
from lcmchain.materials.law import Step
from lcmchain.model import Model, NodeData, PlacedBody
from lcmchain.packs import PACK, load_lanes, pack_of, store_vector
from lcmchain.solver.schedule import Schedule, build_schedule
from lcmchain.state import (
    CONTACT,
    EXTERNAL,
    KINETIC,
    LAST_STEP,
    MASS_DAMPING,
    PACE,
    SHEET_TIME,
    STEPS,
    TIME,
    TOOL_COLUMNS,
    WORK_COLUMNS,
    Scratch,
    State,
)

#: What the loop reads and writes: constants of the nodes, state, and scratch arrays.
Arrays: Any = NamedTuple(  # type: ignore[misc]
    "Arrays",
    [
        (name, np.ndarray)
        for name in dict.fromkeys((*NodeData._fields, *State.names(), *Scratch.names()))
    ],
)


class LoopArguments(NamedTuple):
    """What :func:`advance` works on, by reference; it has no code for what is None or nothing.

    arrays : :data:`Arrays`. bodies : :class:`OrderedBody` each.
    fibre_bending : :class:`lcmchain.effects.fibre_bending.FibreBendingData`, or None.
    interactions : of the model, in the order in which they act on a node, as
        :func:`lcmchain.effects.interaction.in_places` returns them.
    environment : :class:`lcmchain.model.Environment`.
    averaging : time over which the mean velocity is taken that damping leaves alone [s], or None.
    """

    arrays: Reference
    bodies: tuple[Reference, ...]
    fibre_bending: Reference | None
    interactions: tuple[object, ...]
    environment: Reference
    averaging: float | None


@uncounted_entry
def advance(given, step_count, dt):
    """Make ``step_count`` steps of size ``dt`` [s] of the sheets' time.

    The process goes on by as much times its pace: tools, supports and pressures follow its time.

    Parameters
    ----------
    given : :class:`LoopArguments`, by reference.
    """
    make_steps(
        given.arrays, given.bodies, given.fibre_bending, given.interactions, given.environment,
        given.averaging, step_count, dt,
    )  # fmt: skip


@uncounted_routine
def make_steps(arrays, bodies, fibre_bending, interactions, environment, averaging, step_count, dt):
    """Make the steps of :func:`advance`."""
    clock = arrays.clock
    for interaction in literal_unroll(interactions):
        begin_steps(interaction, arrays)
    for _ in range(step_count):
        dt_last = clock[LAST_STEP]
        for interaction in literal_unroll(interactions):
            before_nodes(interaction, arrays, dt_last, dt)
        for body in literal_unroll(bodies):
            move_body(
                arrays, body, body.schedule, body.unscheduled, fibre_bending, interactions,
                environment, averaging, dt_last, dt,
            )  # fmt: skip
        add_chunk_sums(arrays)
        for interaction in literal_unroll(interactions):
            after_nodes(interaction, arrays, environment, dt_last, dt)
        clock[TIME] += clock[PACE] * dt
        clock[SHEET_TIME] += dt
        clock[LAST_STEP] = dt
        arrays.counters[STEPS] += 1


class OrderedBody(NamedTuple):
    """A body, or several of one kind, and the order of a step for it.

    schedule : by reference; None for a body whose loops run through all of it one after the other;
        then ``unscheduled`` is True, else None.
    slot_runs : :class:`SlotRuns` of all nodes, for the places of the orders; by reference.
    """

    placed: PlacedBody
    schedule: Reference | None
    unscheduled: bool | None
    slot_runs: Reference


def in_order(model: Model, batch_count: int) -> tuple[tuple[Reference, ...], Reference | None]:
    """Return the bodies of a model for :func:`advance`, and the fibres' bending, by reference.

    Bodies of one kind are put together (:mod:`lcmchain.elements.solid_shell.together`).

    Parameters
    ----------
    batch_count : in so many batches at most the work of a body is divided.
    """
    bending = None if model.fibre_bending is None else model.fibre_bending.data
    force_slot = model.nodes.force_slot
    kinds = kinds_of([placed.data for placed in model.placed])
    groups = [[model.placed[number] for number in kind] for kind in kinds]
    places = [np.zeros(0, dtype=np.int32)]
    found: list[tuple[PlacedBody, Schedule | None]] = []
    for group in groups:
        first, last = group[0], group[-1]
        bending_place = np.arange(last.last_bending - first.first_bending, dtype=np.int32)
        schedule = None
        if isinstance(first.data, SolidShellData):
            data = put_together([placed.data for placed in group])
            if len(groups) > 1:
                # with code for blocks of any kind groups are more often of one type for the loop
                data = data._replace(general=True)
            first = first._replace(
                data=data, last_force=last.last_force, last_history=last.last_history
            )
            schedule = build_schedule(
                group, data.corner_node, bending, force_slot, model.nodes.chunk_start, batch_count
            )
            force_slot, bending_place = schedule.force_slot, schedule.bending_place
        found.append((first, schedule))
        places.append(group[0].first_bending + bending_place)
    # a node finds its forces where the orders of all bodies have them
    runs = Reference(runs_of_slots(force_slot, model.nodes.chunk_start, model.empty_slot))
    bodies = [
        Reference(
            OrderedBody(placed, None, True, runs)
            if schedule is None
            else OrderedBody(placed, Reference(schedule), None, runs)
        )
        for placed, schedule in found
    ]
    if bending is None:
        return tuple(bodies), None
    at_its_places = at_places(bending, np.concatenate(places).astype(np.int32))
    return tuple(bodies), Reference(at_its_places)


@uncounted_routine
def move_body(
    arrays, body, schedule, unscheduled, fibre_bending, interactions, environment, averaging,
    dt_last, dt,
):  # fmt: skip
    """Make the internal forces of a body, and move its nodes."""
    first, second, third, fourth, fifth = interactions
    if schedule is not None:
        for phase in range(schedule.phase_start.size - 1):
            make_batches(
                arrays, body, fibre_bending, first, second, third, fourth, fifth, environment,
                averaging, phase, dt_last, dt,
            )  # fmt: skip
    if unscheduled is not None:
        placed = body.placed
        corner_force = arrays.corner_force[placed.first_force : placed.last_force]
        history = arrays.history[placed.first_history : placed.last_history]
        internal_forces(placed.data, arrays.position, corner_force, history)
        if fibre_bending is not None:
            fibre_bending_forces(
                referred(fibre_bending),  # type: ignore[call-arg]
                placed.first_bending,
                placed.last_bending,
                arrays.position,
                arrays.corner_force,
                arrays.bending_middle,
                arrays.bending_vector,
            )
        move_nodes(
            arrays, body, first, second, third, fourth, fifth, environment, averaging, dt_last, dt
        )


@kernel_part
def move_nodes(
    arrays, body, first, second, third, fourth, fifth, environment, averaging, dt_last, dt
):
    """Sum the forces on the nodes of a body, and update velocities and positions."""
    first_chunk = body.placed.first_chunk
    for k in prange(body.placed.last_chunk - first_chunk):
        acting = (first, second, third, fourth, fifth)
        work, chunk = np.empty(scratch_of(acting)), int(arrays.chunk_order[first_chunk + k])
        move_chunk(arrays, body.slot_runs, acting, environment, averaging, chunk, dt_last, dt, work)


@uncounted_routine
def move_chunk(arrays, slot_runs, acting, environment, averaging, chunk, dt_last, dt, work):
    """Sum the forces on the nodes of a chunk, and update their velocities and positions."""
    first, last = int(arrays.chunk_start[chunk]), int(arrays.chunk_start[chunk + 1])
    sums = arrays.chunk_sums[chunk]
    sums[:] = 0.0
    gather_internal_forces(arrays, slot_runs, chunk, first, last)
    # written out: in a loop over them they take a fortieth more of a step, and longer to compile
    add_to_nodes(acting[0], arrays, environment, chunk, first, last, dt_last, dt, work, sums)
    add_to_nodes(acting[1], arrays, environment, chunk, first, last, dt_last, dt, work, sums)
    add_to_nodes(acting[2], arrays, environment, chunk, first, last, dt_last, dt, work, sums)
    add_to_nodes(acting[3], arrays, environment, chunk, first, last, dt_last, dt, work, sums)
    add_to_nodes(acting[4], arrays, environment, chunk, first, last, dt_last, dt, work, sums)
    integrate(arrays, arrays.free, environment, averaging, first, last, dt_last, dt, sums)


@equation
def scratch_of(acting):
    """Return how many numbers of scratch the interactions of a node need, one after the other."""
    first, second, third, fourth, fifth = acting
    return max(
        max(scratch_size(first), scratch_size(second)),
        max(scratch_size(third), scratch_size(fourth)),
        scratch_size(fifth),
    )


@kernel_part
def make_batches(
    arrays, body, fibre_bending, first, second, third, fourth, fifth, environment, averaging,
    phase, dt_last, dt,
):  # fmt: skip
    """Make the batches of a phase of a step.

    One loop for all phases: compiled twice, a chunk of nodes might get other last digits between
    two batches than within one.
    """
    start = body.schedule.phase_start
    first_batch = int(start[phase])
    for k in prange(int(start[phase + 1]) - first_batch):
        acting = (first, second, third, fourth, fifth)
        work = np.empty(scratch_of(acting))
        make_batch(
            arrays, body, fibre_bending, acting, environment, averaging, first_batch + k, dt_last,
            dt, work,
        )  # fmt: skip


@uncounted_routine
def make_batch(
    arrays, body, fibre_bending, acting, environment, averaging, batch, dt_last, dt, work
):
    """Make a batch of a step: the forces of its tiles, and the motion of the nodes behind each."""
    schedule = body.schedule
    for tile in range(schedule.batch_start[batch], schedule.batch_start[batch + 1]):
        forces_of_tile(arrays, body, tile, dt_last)
        if fibre_bending is not None:
            bend_fibres(arrays, schedule, fibre_bending, tile)
        for place in range(schedule.chunk_start[tile], schedule.chunk_start[tile + 1]):
            chunk = int(schedule.chunk[place])
            move_chunk(
                arrays, body.slot_runs, acting, environment, averaging, chunk, dt_last, dt, work
            )


@standalone_loop
def forces_of_tile(arrays, body, tile, dt_last):
    """Write the internal forces of the elements of a tile."""
    schedule, placed = body.schedule, body.placed
    data = placed.data
    corner_force = arrays.corner_force[placed.first_force : placed.last_force]
    history = arrays.history[placed.first_history : placed.last_history]
    step = Step(dt_last, arrays.clock[TIME])
    for place in range(schedule.block_start[tile], schedule.block_start[tile + 1]):
        block = schedule.block[place]
        forces_of_block(
            arrays.position,
            data.corner_node,
            data.corner_run,
            data.element_data,
            corner_force,
            history,
            data.law,
            data.options,
            data.quick_data,
            data.quick_options,
            data.general,
            block,
            schedule.place[block],
            step,
        )


@standalone_routine
def bend_fibres(arrays, schedule, data, tile):
    """Make what the fibres' bending has to do behind a tile of elements."""
    middle, vector, force = arrays.bending_middle, arrays.bending_vector, arrays.corner_force
    for k in range(schedule.middle_start[tile], schedule.middle_start[tile + 1]):
        find_middle(data, arrays.position, middle, schedule.middle[k])
    for k in range(schedule.vector_start[tile], schedule.vector_start[tile + 1]):
        find_vectors(data, middle, vector, schedule.vector[k])
    for k in range(schedule.sum_start[tile], schedule.sum_start[tile + 1]):
        add_vectors(data, vector, force, schedule.sum[k])


class SlotRuns(NamedTuple):
    """Where packs of nodes read the forces in their slots; all arrays are int32.

    start : (pack_count + 1,) where the runs of each pack begin; every chunk of nodes has as many
    packs, of which the last ones may have fewer nodes or none. place : (run_count,) of the number
    for the first lane, as if the run began there. lanes : (run_count,) those that it serves, bit by
    bit.
    """

    start: np.ndarray
    place: np.ndarray
    lanes: np.ndarray


def runs_of_slots(force_slot: np.ndarray, chunk_start: np.ndarray, empty: int) -> SlotRuns:
    """Return the runs of all packs, slot by slot.

    Parameters
    ----------
    force_slot, chunk_start : as in :class:`lcmchain.model.NodeData`.
    empty : the slot in which there is nothing.
    """
    begin = (chunk_start[:-1, None] + PACK * np.arange(PACKS_OF_CHUNK)).ravel()
    lane = np.arange(PACK)
    node = begin[:, None] + lane
    missing = node >= np.repeat(chunk_start[1:], PACKS_OF_CHUNK)[:, None]
    slot = force_slot[:, np.minimum(node, force_slot.shape[1] - 1)].transpose(1, 0, 2)
    left = (slot != empty) & ~missing[:, None]  # (pack_count, valence, PACK)
    start = slot.astype(np.int64) - lane
    found = []
    while left.any():
        first = np.take_along_axis(start, left.argmax(axis=-1)[..., None], axis=-1)
        taken = left & (start == first)
        left &= ~taken
        pack, valence = np.nonzero(taken.any(axis=-1))
        lanes = (taken[pack, valence] << lane).sum(axis=-1)
        found.append(np.stack([pack, valence, first[pack, valence, 0], lanes]))
    pack, valence, place, lanes = np.concatenate(found, axis=1)
    order = np.lexsort((valence, pack))
    starts = np.searchsorted(pack[order], np.arange(begin.size + 1))
    arrays = (starts, place[order], lanes[order])
    return SlotRuns(*(array.astype(np.int32) for array in arrays))


@standalone_routine
def gather_internal_forces(arrays, runs, chunk, first, last):
    """Set the forces on the nodes ``first`` to ``last`` of a chunk to minus their corner forces.

    Summed in the order of their slots: a sheet moves as it does without the slots that others need.

    Parameters
    ----------
    runs : :class:`SlotRuns`.
    """
    corner_force = arrays.corner_force
    for begin in range(first, last, PACK):
        number = chunk * PACKS_OF_CHUNK + (begin - first) // PACK
        x = y = z = pack_of(0.0)
        for run in range(runs.start[number], runs.start[number + 1]):
            place, lanes = runs.place[run], runs.lanes[run]
            x -= load_lanes(corner_force, place, lanes)
            y -= load_lanes(corner_force, place + LANES, lanes)
            z -= load_lanes(corner_force, place + 2 * LANES, lanes)
        store_vector(arrays.force, begin, min(PACK, last - begin), (x, y, z))


@standalone_span_routine
def integrate(arrays, free, environment, averaging, first, last, dt_last, dt, sums):
    """Update velocity (to n + ½) and position (to n + 1), and sum the energies of the nodes.

    Components that are not free keep their position; supports move them afterwards.
    """
    interval = 0.5 * (dt_last + dt)
    damping = environment.mass_damping
    mass, inverse_mass = arrays.mass[first:last], arrays.inverse_mass[first:last]
    weights = weights_of(environment.gravity, first, last)
    for d in range(3):
        position, velocity = arrays.position[d, first:last], arrays.velocity[d, first:last]
        force = arrays.force[d, first:last]
        if free is not None:
            free_part = free[d, first:last]
        if averaging is not None:
            average = arrays.mean_velocity[d, first:last]
            part = min(interval / averaging, 1.0)
        kinetic, damped, weight = 0.0, 0.0, 0.0
        for i in range(last - first):
            gravity = -weight_at(weights, i) if d == 2 else 0.0
            share = 1.0
            if free is not None:
                share = free_part[i]
            old = velocity[i]
            acceleration = force[i] * inverse_mass[i] + gravity
            undamped = 0.0
            if averaging is not None:
                undamped = average[i]
            new = undamped + damped_velocity(old - undamped, acceleration, damping, interval)
            velocity[i] = new if share > 0.0 else old
            position[i] += share * dt * new
            mean = 0.5 * (old + new)
            free_mass = share * mass[i]
            kinetic += 0.5 * free_mass * old * new
            damped += damping * free_mass * (mean - undamped) * mean * interval
            if averaging is not None:
                average[i] = averaged_velocity(undamped, mean, part)
            weight += free_mass * gravity * mean * interval
        sums[KINETIC] += kinetic
        sums[MASS_DAMPING] += damped
        sums[EXTERNAL] += weight


@standalone_routine
def add_chunk_sums(arrays):
    """Reduce the sums of the chunks, in their order."""
    work, sums, tool_force = arrays.work, arrays.chunk_sums, arrays.tool_force
    work[KINETIC] = 0.0
    work[CONTACT] = 0.0
    tool_force[:] = 0.0
    for chunk in range(sums.shape[0]):
        for column in range(WORK_COLUMNS):
            work[column] += sums[chunk, column]
        for tool in range(tool_force.shape[0]):
            column = WORK_COLUMNS + TOOL_COLUMNS * tool
            for d in range(3):
                tool_force[tool, d] += sums[chunk, column + d]
            arrays.penetration_max[tool] = max(
                arrays.penetration_max[tool], -sums[chunk, column + 3]
            )
