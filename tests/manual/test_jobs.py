"""The scenes of the page of jobs: short, and they run to their end with longer edges."""

from __future__ import annotations

import re

import pytest

from lcmchain.check import require_no_initial_overlap
from lcmchain.manual.contents import read_page
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

#: Lines of a scene that a reader takes in at once, and how much longer its edges are here.
LONGEST, LONGER = 40, 2.0
#: Plies whose elements are a fifth of the radius of the punch lose each other, and a guard says so.
LONGER_IN_RUNS = {"reinforce a place by a patch": 1.5}
#: Error of the energy balance over the largest energy that was stored or put in.
BALANCE = 0.05

JOBS = dict(
    re.findall(
        r"^## \.\.\. (.*?)\?\n.*?^```toml\n(.*?)^```",
        read_page("jobs").text,
        re.MULTILINE | re.DOTALL,
    )
)

# What each shows of the process when it has ended, beside that it got there.
SHOWN = {
    "hold the blank by springs in place of a blank holder": lambda sim: (
        20.0 < 1e3 * -sim.state.position[2].min() < 60.0
    ),
    "hold the blank by segments, each with a force of its own": lambda sim: (
        sim.state.tool_impulse[2:4, 2].min() > 2.0 * sim.state.tool_impulse[4:, 2].max()
    ),
    "form a stack of plies": lambda sim: len(sim.model.bodies) == 3,
    "reinforce a place by a patch": lambda sim: sim.state.ply_facet.max() >= 0,
    "press a sheet onto a tool by a vacuum bag": lambda sim: sim.state.position[2].min() < 5e-3,
    "form one place before another, and release the part": lambda sim: sim.model.stage == 2,
    "cut holes and darts into the blank": lambda sim: sim.model.bodies[0].mesh.element_count > 0,
    "form with a diaphragm": lambda sim: sim.state.position[2].min() < 8e-3,
    "close two moulds to a gap": lambda sim: sim.state.position[2].min() < 2e-3,
}
# Kinds of loops that no other test compiles: that takes most of their time.
SLOW = {
    "hold the blank by springs in place of a blank holder",
    "form a stack of plies",
    "reinforce a place by a patch",
    "press a sheet onto a tool by a vacuum bag",
    "form one place before another, and release the part",
    "cut holes and darts into the blank",
    "form with a diaphragm",
    "close two moulds to a gap",
}


def test_there_are_nine_jobs_and_each_scene_is_short():
    assert list(JOBS) == list(SHOWN)
    assert max(text.count("\n") for text in JOBS.values()) <= LONGEST


@pytest.mark.parametrize("job", JOBS)
def test_a_scene_of_the_page_can_be_formed(job):
    """It is a scene, nothing overlaps at the start, and it has the bodies to begin with."""
    scene = scene_from_text(JOBS[job]).with_longer_edges(LONGER)
    simulation = Simulation.from_scene(scene)
    require_no_initial_overlap(scene, simulation.model.tools)
    assert all(body.mesh.element_count > 0 for body in simulation.model.bodies)


@pytest.mark.parametrize(
    "job", [pytest.param(job, marks=pytest.mark.slow if job in SLOW else ()) for job in JOBS]
)
def test_a_scene_of_the_page_runs_to_its_end(job):
    scene = scene_from_text(JOBS[job]).with_longer_edges(LONGER_IN_RUNS.get(job, LONGER))
    simulation = Simulation.from_scene(scene)
    simulation.advance_to(scene.process.time, lambda sim: sim.require_resolved())
    energy = simulation.energy()
    largest = max(abs(value) for name, value in energy.items() if name != "balance_error")
    assert abs(energy["balance_error"]) < BALANCE * largest
    assert SHOWN[job](simulation)
