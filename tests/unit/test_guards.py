"""Guards stop a run in words that name element, place, time and cause."""

from __future__ import annotations

import re

import numpy as np
import pytest

from lcmchain import state as columns
from lcmchain.errors import SimulationError
from lcmchain.quantities.readable import millimetres
from lcmchain.scene import scene_from_text
from lcmchain.solver import guards, remedies
from lcmchain.solver.recovery import diagnosis
from lcmchain.solver.simulation import Simulation
from lcmchain.state import (
    EXTERNAL,
    KINETIC,
    LAST_STEP,
    LOOKED,
    SAMPLE_COLUMNS,
    SAMPLES,
    TIME,
)

SCENE = """
title = "patch"
process = { time = "1 ms", frames = 2 }
material = { preset = "MD600" }
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
"""


@pytest.fixture
def simulation():
    return Simulation.from_scene(scene_from_text(SCENE))


def test_a_value_that_is_not_a_number_names_node_element_place_and_time(simulation):
    guards.require_finite(simulation.model, simulation.state, "Why")
    simulation.state.velocity[1, 7] = np.nan
    words = r"node 7 \(element \d+.* mm\) at .* ms \(step 0\)\. Why"
    with pytest.raises(SimulationError, match=words):
        guards.require_finite(simulation.model, simulation.state, "Why")


@pytest.mark.parametrize(("fraction", "word"), [(0.32, "collapsed"), (-0.2, "inverted")])
def test_a_folded_element_is_named(simulation, fraction, word):
    """Squeeze one element until it holds more fibre than space (0.33), or turn it inside out."""
    model, state = simulation.model, simulation.state
    bottom, top = model.only_body().mesh.elements[5, :4], model.only_body().mesh.elements[5, 4:]
    middle = 0.5 * (state.position[2, bottom] + state.position[2, top])
    half = 0.5 * fraction * model.only_body().material.thickness
    state.position[2, bottom], state.position[2, top] = middle - half, middle + half
    with pytest.raises(SimulationError, match=rf"element 5 is {word}\b.*edge_length"):
        simulation.advance_to(1e-4)


BED = """
[[tools]]
name = "bed"
shape = { type = "plate", side = "below" }
"""
PRESS = (
    BED
    + """[[tools]]
name = "press"
shape = { type = "plate", side = "above" }
position = "0 0 1.2 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm" }
"""
)
BAG = (
    BED
    + """[[pressure]]
name = "bag"
face = "top"
value = "0.5 MPa"
ramp = "1 ms"
"""
)


def test_a_sheet_that_sinks_into_a_tool_stops_the_run():
    """Plates closed to half the thickness: 7 MPa are beyond the automatic contact stiffness."""
    plates = (
        BED
        + """
        [[tools]]
        name = "press"
        shape = { type = "plate", side = "above" }
        position = "0 0 1.004 mm"
        motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
        """
    )
    text = SCENE.replace('"1 ms"', '"10 ms"') + plates
    sim = Simulation.from_scene(scene_from_text(text, overrides=["contact.depth=free"]))
    words = r'0\.1\d+ mm inside (bed|press) .* contact\.penalty = "(\d+) N/mm\^3"$'
    with pytest.raises(SimulationError, match=words) as error:
        sim.advance_to(10e-3)
    place = r"\(step \d+\), the deepest in element \d+ at \(-?\d+\.\d\d, .*\) mm, more than 0\.15"
    assert re.search(place, str(error.value))
    # what is named lets the same plates press to their end, at twice this pressure and more
    value = str(error.value).split("set ")[1]
    cured = text.replace('"1 mm"', '"0.4 mm"')
    again = Simulation.from_scene(
        scene_from_text(cured, overrides=["contact.depth=free", value.replace(" = ", "=")])
    )
    again.advance_to(10e-3)
    assert again.state.penetration_max.max() < 0.1 * again.model.only_body().material.thickness


def sunk(scene, depth, part_of_the_process):
    """A simulation with so deep a penetration [m], and the entry that its guard names."""
    sim = Simulation.from_scene(scene_from_text(scene))
    sim.state.penetration_max[0] = depth
    sim.state.clock[TIME] = part_of_the_process * sim.model.process_time
    with pytest.raises(SimulationError, match="mm inside") as error:
        guards.require_outside(sim.model, sim.state)
    return sim, str(error.value).split("or set ")[1]


def test_a_blow_that_is_over_names_what_moves_fastest_beside_the_tool():
    """A loose edge strikes a tool between two looks, and is out again at the second."""
    sim, _ = sunk(SCENE + PRESS, 0.2e-3, 0.5)
    node = 7
    sim.state.near[:] = True
    sim.state.velocity[2, node] = 2.5
    with pytest.raises(SimulationError) as error:
        guards.require_outside(sim.model, sim.state)
    place = millimetres(sim.state.position[:, node])
    element = f"element {sim.model.element_at(node)} at {place}"
    words = (
        f"come out again; of the nodes beside it {element} is the fastest, with 2.5 m/s, more than"
    )
    assert words in str(error.value)


def named_stiffness(entry):
    """The contact stiffness [Pa/m] of a scene entry."""
    return 1e9 * float(entry.split('"')[1].split()[0])


def test_the_stiffness_that_is_named_leaves_little_depth_until_the_end_of_the_process():
    """A tool that goes on presses with the square of its travel; a bag as its table says."""
    thickness = 1.004e-3
    press = SCENE + PRESS
    for part in (0.5, 1.0):
        sim, entry = sunk(press, 0.2e-3, part)
        deepest = 0.2e-3 / part**2 * sim.model.environment.penalty / named_stiffness(entry)
        assert 0.9 * 0.05 * thickness < deepest < 1.001 * 0.05 * thickness
        assert 'contact.depth = "zero"' not in entry
    # where depths are driven to zero by themselves, a stiffness that is given switches that off
    _, entry = sunk(press.replace('"0.1 mm"', '"0.3 mm"'), 0.2e-3, 1.0)
    assert entry.endswith('N/mm^3" and contact.depth = "zero"')
    bag = SCENE + BAG
    sim, entry = sunk(bag, 0.2e-3, 0.25)  # a quarter of the ramp: 0.104 of the pressure
    deepest = 0.2e-3 / 0.1035 * sim.model.environment.penalty / named_stiffness(entry)
    assert deepest == pytest.approx(0.05 * thickness, rel=0.1)


def test_energy_from_nowhere_stops_the_run(simulation):
    model, state = simulation.model, simulation.state
    state.work[EXTERNAL], state.work[KINETIC] = 1.0, 1.05
    guards.require_passive(model, state)
    state.work[KINETIC] = 1.2
    state.velocity[2, 3] = 50.0
    with pytest.raises(SimulationError, match="energy balance runs away.*fastest node is 3"):
        guards.require_passive(model, state)


PLATES = """
[[tools]]
name = "bed"
shape = { type = "plate", side = "below" }
position = "0 0 BED mm"
[[tools]]
name = "press"
shape = { type = "plate", side = "above" }
position = "0 0 1.1 mm"
motion = { type = "table", direction = [0, 0, -1], times = "0 0.5 0.50001 ms", travel = "0 0 1 mm" }
"""


def with_plates(bed=0.0, more="", scene=SCENE) -> Simulation:
    return Simulation.from_scene(scene_from_text(scene + PLATES.replace("BED", str(bed)) + more))


def runaway(sim, **work) -> str:
    """Message of the guard where energies [J] by column are these."""
    for name, value in work.items():
        sim.state.work[getattr(columns, name)] = value
    with pytest.raises(SimulationError, match="runs away") as error:
        guards.require_passive(sim.model, sim.state)
    return str(error.value)


@pytest.mark.parametrize("time", [1e-7, 4e-4])
def test_an_overlap_at_the_start_is_named_whatever_became_of_its_energy(time):
    """After a step the springs hold the energy, after a chunk of steps the sheet moves with it."""
    sim = with_plates(bed=0.03)
    with pytest.raises(SimulationError, match="runs away") as error:
        sim.advance_to(time)
    assert "bed reaches 0.03 mm into the sheet at the start" in str(error.value)
    assert "tools.bed.position" in str(error.value)


def test_a_tool_that_jumps_is_named():
    sim = with_plates()
    with pytest.raises(SimulationError) as error:
        sim.advance_to(1e-3)
    # the step within which it jumps by 1 mm ends in values that are no numbers
    assert "press moves by 1 mm in one step" in str(error.value)
    assert "Likely cause: press moves" in str(error.value)
    assert "it jumps; check tools.press.motion" in str(error.value)
    driven = with_plates()
    driven.state.driven[0], driven.state.tool_velocity[0] = 1, 100.0
    driven.state.clock[LAST_STEP] = 5e-6
    assert "bed jumps by 0.5 mm in one step; check the velocity that drives it from outside" in (
        runaway(driven, CONTACT=1.0)
    )


def test_the_advice_fits_where_the_energy_is():
    """The largest part of the energy names the cause; each has an entry of its own to change."""
    assert "process.step_safety = 0.45" in runaway(with_plates(), KINETIC=1.0, CONTACT=0.2)
    assert "kinetic energy 1 J, contact springs 0.2 J" in runaway(
        with_plates(), KINETIC=1.0, CONTACT=0.2
    )
    assert "leave contact.penalty" not in runaway(with_plates(), KINETIC=1.0)
    stiff = '[contact]\npenalty = "50 N/mm^3"\ndamping_ratio = 1.5'
    assert "contact.penalty = 50 N/mm^3 is given" in runaway(with_plates(more=stiff), CONTACT=1.0)
    assert "leave contact.penalty to the program" in runaway(with_plates(more=stiff), KINETIC=1.0)
    assert "contact.damping_ratio below 1" in runaway(
        with_plates(more=stiff), CONTACT=1.0, CONTACT_DAMPING=1.2
    )
    assert "process.time" in runaway(with_plates(), CONTACT=1.0)
    assert "process.mass_damping" in runaway(with_plates(), MASS_DAMPING=1.0, KINETIC=0.5)
    printed = "[element]\ncross_terms = true"
    assert "element.cross_terms = true: such forces have no potential" in runaway(
        with_plates(more=printed), KINETIC=1.0
    )
    published = '[element]\nhourglass = "published"'
    assert 'element.hourglass = "published":' in runaway(with_plates(more=published), FRICTION=1.0)


def test_a_strained_start_counts_as_energy_put_in(simulation):
    """Released from a sheared shape a sheet vibrates, and the balance stays closed."""
    x, y, z = simulation.state.position
    simulation.set_position(np.array([x + 0.01 * y, y + 0.01 * x, z]))
    stored = simulation.state.work[EXTERNAL]
    assert stored > 0.0
    simulation.advance_to(0.1e-3)
    first = simulation.energy()["balance_error"]
    simulation.advance_to(1e-3)
    energy = simulation.energy()
    assert energy["kinetic"] > 0.1 * stored
    assert abs(first) < 0.02 * stored  # the fibres' part of it vibrates within a few steps
    assert abs(energy["balance_error"] - first) < 1e-3 * stored


def test_too_large_a_step_is_caught_by_a_guard(simulation):
    """Three times the stable step: the run ends in a guard's words within the process time."""
    state = simulation.state
    rng = np.random.default_rng(0)
    state.velocity[:] = rng.normal(scale=1e-3, size=state.velocity.shape)
    step = 3.0 * simulation.critical_step()
    with pytest.raises(SimulationError, match="not a number|runs away|inverted|collapsed"):
        for _ in range(400):
            simulation.make_steps(10, step)
            simulation.require_sound()


def test_a_mesh_that_the_hourglass_terms_carry_is_named(simulation):
    model, state = simulation.model, simulation.state
    floor = guards.energy_floor(model)
    sound = {"internal": 100.0 * floor, "hourglass": 14.0 * floor, "kinetic": 0.0}
    carried = sound | {"hourglass": 16.0 * floor}
    assert guards.hourglass_part(model, sound) == pytest.approx(0.14)
    assert guards.hourglass_part(model, carried) == pytest.approx(0.16)
    # before the sheet is loaded, and while it moves more than it is strained, a ratio says nothing
    barely = carried | {"internal": 0.9 * guards.LOADED * floor}
    assert guards.hourglass_part(model, barely) == 0.0
    assert guards.hourglass_part(model, carried | {"kinetic": 101.0 * floor}) == 0.0

    def look(part_of_the_process, energy):
        state.clock[TIME] = part_of_the_process * model.process_time
        guards.require_resolved(model, state, energy)

    for part in (0.1, 0.12, 0.14):  # for a moment, and again after a look that finds it sound
        look(part - 0.01, sound)
        look(part, carried)
    look(0.17, carried)
    # it has grown to 16 % within 0.19 of the process: 10 mm (0.05 * 0.19 / 0.16)^½
    words = r'16% of the strain energy at .* in element \d+ at .* of 10 mm .* radii .*"2\.4 mm"'
    with pytest.raises(SimulationError, match=words):
        look(0.19, carried)
    # a sheet that was struck is to be formed slower first
    state.samples[0, SAMPLE_COLUMNS.index("kinetic")] = 11.0 * floor
    state.counters[SAMPLES] = 1
    words = r'struck, .* reached 11% .* use process.time = "1\.1 ms", before a smaller blank'
    with pytest.raises(SimulationError, match=words):
        look(0.19, carried)
    state.samples[0, SAMPLE_COLUMNS.index("kinetic")] = 9.0 * floor
    with pytest.raises(SimulationError, match="too coarse for the radii"):
        look(0.19, carried)
    look(0.99, sound)
    with pytest.raises(SimulationError, match="16% of the strain energy"):
        look(1.0, carried)


def test_energy_that_has_vanished_or_come_from_nowhere_is_no_end_of_a_process(simulation):
    model, state = simulation.model, simulation.state
    floor = guards.energy_floor(model)
    large = {"external": 1000.0 * floor, "internal": 700.0 * floor}

    def look(part_of_the_process, error):
        state.clock[TIME] = part_of_the_process * model.process_time
        guards.require_balanced(model, state, large | {"balance_error": error * floor})

    look(1.0, 99.0)
    look(1.0, -99.0)
    look(0.99, -200.0)  # on the way nothing is lost yet that may not come back
    with pytest.raises(SimulationError, match="J vanished .* 12% of the largest energy .*step_saf"):
        look(1.0, -120.0)
    with pytest.raises(SimulationError, match="came from nowhere"):
        look(1.0, 120.0)


def test_the_element_that_holds_the_hourglass_energy_is_named(simulation):
    """A checkerboard of one element's corners is its own, and less of its neighbours."""
    model, state = simulation.model, simulation.state
    nodes = model.only_body().mesh.elements[5]
    signs = np.array([1.0, -1.0, 1.0, -1.0] * 2)
    state.position[0, nodes] += 1e-5 * signs
    energies = model.only_body().hourglass_energies(state.position, state.history)
    stored = model.only_body().stored_energy(state.position, state.history)[1]
    assert np.argmax(energies) == 5 and energies.sum() == pytest.approx(stored)
    element, place = guards._most_hourglass(model, state)
    assert element == 5
    np.testing.assert_allclose(place, state.position[:, nodes].mean(axis=1))


def test_the_hourglass_guard_looks_at_times_of_its_own(simulation):
    """Whatever a run saves: from time to time, after every halt of it, and at its end."""
    model, state = simulation.model, simulation.state
    due = []
    for part in np.linspace(0.0, 1.0, 401):
        state.clock[TIME] = part * model.process_time
        if guards.resolution_is_due(model, state):
            due.append(part)
            state.clock[LOOKED] = state.time
    assert np.allclose(np.diff(due), guards.LOOK_INTERVAL, atol=0.0026)
    assert due[-1] == 1.0


def struck(scene, element_at):
    """What a guard says of a sheet that was struck, the most hourglass energy at a place [m]."""
    sim = Simulation.from_scene(scene_from_text(scene))
    model, state = sim.model, sim.state
    centres = model.only_body().mesh.mid_surface(model.node_positions)[
        model.only_body().mesh.sheet_faces
    ]
    element = int(np.argmin(np.linalg.norm(centres.mean(axis=1)[:, :2] - element_at, axis=1)))
    state.position[0, model.only_body().mesh.elements[element]] += 1e-5 * np.array(
        [1, -1, 1, -1] * 2
    )
    floor = guards.energy_floor(model)
    state.samples[0, SAMPLE_COLUMNS.index("kinetic")] = 40.0 * floor
    state.counters[SAMPLES] = 1
    state.clock[TIME] = model.process_time
    energy = {"internal": 100.0 * floor, "hourglass": 20.0 * floor, "kinetic": 0.0}
    with pytest.raises(SimulationError, match="struck") as error:
        guards.require_resolved(model, state, energy)
    return str(error.value)


def test_a_struck_sheet_is_told_of_its_elements_too_where_a_tool_turns_faster_than_they_can():
    """No slower process cures elements of 10 mm on a ball of 12 mm; on one of 60 mm it does."""
    ball = """
        [[tools]]
        name = "ball"
        shape = { type = "sphere_capped_punch", radius = "%s mm" }
        position = "0 0 1.004 mm"
        motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
        """
    told = struck(SCENE + ball % 12, [5e-3, 5e-3])
    assert 'use process.time = "2 ms", and blank.edge_length = "5 mm", since ball turns' in told
    told = struck(SCENE + ball % 60, [5e-3, 5e-3])
    assert 'use process.time = "2 ms", before a smaller blank.edge_length' in told
    bag = struck(SCENE + BAG, [5e-3, 5e-3])
    assert 'process.time = "2 ms" with pressure.ramp 2 times as long, or more process.mass' in bag


def test_remedies_are_named_for_a_sheet_that_touches_nothing_and_for_one_without_numbers():
    """A run that breaks in its first steps has no depth and no hourglass energy to go by."""
    simulation = Simulation.from_scene(scene_from_text(SCENE + BED))
    model, state = simulation.model, simulation.state
    present = 1e-9 * model.environment.penalty
    named = remedies.stiffer_contact(model, state)
    assert float(re.search(r'penalty = "([\d.e+]+) N', named)[1]) == pytest.approx(present, rel=0.1)
    assert remedies.finer_elements(model, state, 0.0) == 'blank.edge_length = "10 mm"'
    assert "nothing here is near its limit" in diagnosis(model, state, simulation.energy(), 1e-4)
    state.penetration_max[:] = np.inf
    assert remedies.stiffer_contact(model, state) == "a larger contact.penalty"
    assert remedies.finer_elements(model, state, np.inf) == "a smaller blank.edge_length"
    assert remedies.slower_loads(model, np.inf) == "a longer process.time"
