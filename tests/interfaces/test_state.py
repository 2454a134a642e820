"""What a stack remembers, for any number of threads, and what stops it."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from stacks import ALL, MU, T, of_points, ply, scene_of, stack, thickness
from test_sliding import sled

from lcmchain.elements.blocks import NODE_CHUNK
from lcmchain.errors import SimulationError
from lcmchain.interfaces.forces import REFRESHES, TOO_DEEP
from lcmchain.interfaces.laws.viscous_film import ViscousFilmTable
from lcmchain.interfaces.rows import SPRING_ROWS
from lcmchain.interfaces.table import Interface
from lcmchain.solver import guards
from lcmchain.solver.interactions.ply_contact import omega2_bound
from lcmchain.solver.simulation import Simulation
from lcmchain.state import KINETIC


def assert_identical(a, b):
    for name, array in a.as_dict().items():
        np.testing.assert_array_equal(array, getattr(b, name), err_msg=name)


@pytest.fixture(scope="module")
def halfway():
    """A sled on its way, and where it comes to without a stop."""
    sim = sled()
    sim.advance_to(3e-3)
    before = sim.state.copy()
    sim.make_steps(333, 1e-6)
    return before, sim


def test_a_saved_stack_goes_on_as_if_nothing_had_happened(halfway):
    before, sim = halfway
    again = Simulation(sim.model)
    again.restore(before)
    again.make_steps(100, 1e-6)
    state = again.state.copy()
    again = Simulation(sim.model)
    again.restore(state)
    again.make_steps(233, 1e-6)
    assert_identical(again.state, sim.state)
    assert (of_points(sim, SPRING_ROWS) != 0.0).any()  # the anchor of friction


def test_the_loop_of_a_stack_holds_no_array_after_its_steps(halfway, references):
    """Also where springs are renewed on the way."""
    sim = Simulation(halfway[1].model)
    sim.restore(halfway[0])
    sim.make_steps(1, 1e-6)  # which orders the bodies
    before, renewed = references(sim), int(sim.state.ply_counters[REFRESHES])
    sim.make_steps(120, 1e-6)
    assert sim.state.ply_counters[REFRESHES] > renewed
    assert references(sim) == before


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_threads_do_not_change_a_bit(halfway):
    before, sim = halfway
    threads = numba.get_num_threads()
    for count in (1, 2):
        numba.set_num_threads(count)
        again = Simulation(sim.model)
        again.restore(before)
        again.make_steps(333, 1e-6)
        assert_identical(again.state, sim.state)
    numba.set_num_threads(threads)
    assert sim.model.node_count > NODE_CHUNK


@pytest.mark.slow
def test_sixteen_plies_go_on_with_the_same_bits_on_one_thread_and_on_two():
    """Of two angles in turn: the loop takes those of one angle as one body."""
    plies = [
        ply(f"ply {k}", width=30.0, height=30.0, angle=45.0 * (k % 2), z=(k + 0.5) * T)
        for k in range(16)
    ]
    scene = scene_of(time=2.0, bottom=0.0, top=16 * T, travel=2.0 * T, damping=200.0)
    sim = stack(plies, scene, Interface(friction=0.2))
    sim.advance_to(1e-3)
    before = sim.state.copy()
    sim.advance_to(2e-3)
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 5e-3 * energy["external"]
    heights = np.array([thickness(sim, body).mean() for body in sim.model.bodies])
    assert heights.sum() == pytest.approx(14e-3 * T, rel=2e-2)
    threads = numba.get_num_threads()
    for count in range(1, min(2, numba.config.NUMBA_NUM_THREADS) + 1):
        numba.set_num_threads(count)
        again = Simulation(sim.model)
        again.restore(before)
        again.advance_to(2e-3)
        assert_identical(again.state, sim.state)
    numba.set_num_threads(threads)


def test_a_ply_that_goes_through_another_one_stops_the_run():
    """Springs that are far too soft: it names both plies, the element and what to do."""
    plies = [ply("lower", z=0.5 * T), ply("upper", z=1.5 * T)]
    plates = scene_of(time=2.0, bottom=0.0, top=2 * T, travel=0.9 * T, stop=1.9)
    sim = stack(plies, plates, ALL, Interface(penalty="0.001 N/mm^3"))
    with pytest.raises(SimulationError, match="half the thickness of the thicker") as error:
        sim.advance_to(2e-3)
    for words in ("lower", "upper", "element", "ms (step", "interfaces.penalty"):
        assert words in str(error.value)
    assert "Likely cause: pressure that a contact stiffness of 0.001 N/mm^3" in str(error.value)


def test_what_moves_fast_is_told_to_be_slow_before_stiff():
    """Loose rims flap at any stiffness of the springs; where nothing moves, plies were pressed."""
    sim = stack([ply("lower", z=0.5 * T), ply("upper", z=1.5 * T)], scene_of())
    state = sim.state
    state.ply_counters[TOO_DEEP], state.ply_facet[0] = 1, 0
    state.velocity[2, 0] = 3.0  # the facet is at rest, or has a part of it as its own corner
    told = {}
    for moved in (0.0, 1.0):
        state.work[KINETIC] = moved
        with pytest.raises(SimulationError) as error:
            guards.require_on_the_face(sim.model, state)
        told[moved] = str(error.value)
    pressed, struck = (text.partition("Likely cause: ")[2] for text in told.values())
    assert pressed.startswith("pressure that a contact stiffness of")
    assert struck.startswith("a process so fast that loose rims flap")
    assert struck.index("process.time = ") < struck.index("interfaces.penalty")
    assert "m/s against each other" in told[1.0]
    state.tool_velocity[1] = -5.0  # a tool that is faster drives them
    with pytest.raises(SimulationError, match="Likely cause: pressure"):
        guards.require_on_the_face(sim.model, state)


def test_a_depth_in_a_tool_is_measured_by_the_thinnest_ply_and_names_it():
    plies = [ply("lower", z=0.5 * T), ply("upper", z=1.5 * T)]
    sim = stack(plies, scene_of())
    sim.state.penetration_max[0] = 0.2e-3 * T
    with pytest.raises(SimulationError, match=r"0\.15 of the thickness of the thinnest ply, lower"):
        guards.require_outside(sim.model, sim.state)
    alone = stack(plies[:1], scene_of())
    alone.state.penetration_max[0] = 0.2e-3 * T
    with pytest.raises(SimulationError, match=r"0\.15 of the thickness of the sheet\."):
        guards.require_outside(alone.model, alone.state)


def test_the_springs_count_in_the_step(halfway):
    """Σ |K| / m of the whole matrix of springs, by one force for each displacement."""
    before, sim = halfway
    sim.restore(before)
    stiff = stack(
        [ply("lower", z=0.5 * T), ply("upper", z=1.5 * T)],
        scene_of(),
        Interface(penalty="10000 N/mm^3"),
    )
    largest = [omega2_bound(own.model.ply_contact, own.model, own.state) for own in (sim, stiff)]
    assert largest[1] > 1e2 * largest[0]
    stiff.prepare_steps()
    assert stiff.control.cause == "contact between plies"
    sim.prepare_steps()
    assert stiff.control.step < 0.2 * sim.control.step


def test_a_thick_film_between_plies_is_named_as_what_shortens_the_step():
    """What resists a speed has no stiffness, and shortens the step even so."""
    film = ViscousFilmTable(viscosity=50.0, thickness=0.05e-3)
    plies = [ply("lower", z=0.5 * T), ply("upper", z=1.5 * T)]
    thick, dry = (
        stack(plies, scene_of(), ALL, Interface(friction=MU, laws=laws)) for laws in ((film,), ())
    )
    for sim in (thick, dry):
        sim.prepare_steps()
    assert thick.control.step < 0.2 * dry.control.step
    assert thick.control.cause == "damping by contact between plies"
    assert "damping" not in dry.control.cause
