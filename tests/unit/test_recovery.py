"""Values that are no numbers: back to the last sound state, half the step, or the true cause."""

from __future__ import annotations

import json
import math

import numba
import numpy as np
import pytest

from lcmchain.effects.supports import Support
from lcmchain.errors import SimulationError, SimulationInterrupted
from lcmchain.pipeline import run
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import HALVINGS, MOST_HALVINGS
from lcmchain.verification.hard_cases.sheets import outline_nodes, simulation

PATCH = """
title = "patch"
process = { time = "4 ms", frames = 5 }
material = { preset = "MD600" }
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
"""
PUNCHED = (
    PATCH
    + """
contact = { friction = 0.157 }
[[tools]]
name = "bed"
shape = { type = "plate", side = "below" }
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "30 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm" }
"""
)


def overlong(step_safety=1.5, text=PUNCHED):
    """A simulation whose steps are longer than the stable one by ``step_safety``."""
    return simulation(text, step_safety=step_safety)


@pytest.fixture(scope="module")
def recovered():
    """A run with steps of 1.5 times the stable one to its end, and copies on the way."""
    sim, copies = overlong(), []
    sim.advance_to(4e-3, lambda sim: copies.append(sim.state.copy()))
    return sim, copies


def test_half_the_step_cures_it_for_the_rest_and_is_said(recovered):
    sim, _ = recovered
    (warning,) = sim.warnings()
    assert "half the step cured it" in warning and "with process.step_safety = 0.75" in warning
    assert "values were no numbers after" in warning and " mm; half" in warning
    assert sim.state.step_factor == 0.5
    stable = sim.critical_step()
    assert sim.control.step == pytest.approx(0.75 * stable, rel=0.05)
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 1e-2 * energy["external"]
    assert sum(sim.control.history.values()) == sim.state.step_count


def test_it_ends_as_the_run_with_the_smaller_step_from_the_start(recovered):
    """Only what was kept of the lost steps could tell them apart."""
    sim, _ = recovered
    smaller = overlong(0.75)
    smaller.advance_to(4e-3)
    assert smaller.warnings() == []
    difference = np.abs(sim.state.position - smaller.state.position).max()
    assert difference < 1e-6
    assert sim.state.work == pytest.approx(smaller.state.work, rel=2e-2, abs=1e-6)


def test_a_restored_run_keeps_the_smaller_step_bit_by_bit(recovered):
    sim, copies = recovered
    halved = [copy for copy in copies if copy.counters[HALVINGS]]
    for copy in (copies[0], halved[0], halved[-2]):
        again = overlong()
        again.restore(copy)
        again.advance_to(4e-3)
        assert again.warnings() == sim.warnings()
        for name, array in sim.state.as_dict().items():
            np.testing.assert_array_equal(getattr(again.state, name), array, err_msg=name)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_threads_do_not_change_a_bit(recovered):
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    alone = overlong()
    alone.advance_to(4e-3)
    numba.set_num_threads(before)
    for name, array in recovered[0].state.as_dict().items():
        np.testing.assert_array_equal(getattr(alone.state, name), array, err_msg=name)


def turned_over(time="6 ms"):
    """A square whose outline is pushed through itself: no step makes numbers of that."""
    duration = float(time.split()[0]) * 1e-3

    def motion(now):
        return np.diag([1.0 - 2.0 * now / duration, 1.0, 1.0, 0.0])[:3]

    return simulation(
        PATCH.replace("4 ms", time),
        supports=lambda X: [Support("frame", outline_nodes(X), motion=motion)],
    )


def test_what_half_the_step_does_not_cure_is_told_by_the_last_sound_state():
    sim = turned_over()
    with pytest.raises(SimulationError) as caught:
        sim.advance_to(6e-3)
    text = str(caught.value)
    assert "not a number" in text and "with half the step as well" in text
    facts, cause = text.split("Likely cause: ")
    for words in (
        "The last sound state, at ",
        "fibre volume fraction up to",
        "shear angle up to",
        "thickness down to",
        "hourglass energy",
        "fastest node",
        " in element ",
    ):
        assert words in facts
    assert "fastest node" in cause and "process.time" in cause
    assert "step_safety" not in text and "penalty" not in text
    # the state is the one that the message tells of
    assert np.isfinite(sim.state.position).all() and sim.warnings() == []
    assert f"{1e3 * sim.time:.4f} ms (step {sim.state.step_count})" in facts


def test_the_step_is_not_halved_for_ever():
    sim = overlong()
    sim.state.counters[HALVINGS] = MOST_HALVINGS
    sim.model.__dict__["step_safety"] = 1.5 * 2.0**MOST_HALVINGS
    with pytest.raises(SimulationError, match=f"after {MOST_HALVINGS} halvings of the step"):
        sim.advance_to(4e-3)


def test_the_deepest_penetration_is_named_with_its_tool():
    sim = overlong()
    sim.advance_to(1e-3)
    sim.state.penetration_max[1] = 0.2 * 1.004e-3
    sim._advance = lambda count, step: sim.state.position.fill(math.nan)
    words = r"deepest penetration 0\.201 mm \(punch\); check gap"
    with pytest.raises(SimulationError, match=words):
        sim._make_chunk(5, 1e-6)


def test_a_run_of_a_scene_says_it_in_its_summary_and_resumes(tmp_path, monkeypatch):
    """With a bound of the frequency that is too low by half, from a checkpoint too."""
    bound = Simulation._highest_frequency

    def too_low(self):
        omega2, element, code = bound(self)
        return omega2 / 2.8, element, code

    monkeypatch.setattr(Simulation, "_highest_frequency", too_low)
    scene = scene_from_text("output = { pictures = false, vtu = false }\n" + PUNCHED)
    whole = run(scene, tmp_path / "whole")
    (warning,) = [text for text in whole.summary["warnings"] if "no numbers" in text]
    assert "half the step cured it" in warning

    def stop_half_way(self, simulation):
        if simulation.time > 2e-3:
            self._save()
            raise SimulationInterrupted("stopped")

    with monkeypatch.context() as stopping:
        stopping.setattr("lcmchain.forming_run.FormingRun._after_chunk", stop_half_way)
        with pytest.raises(SimulationInterrupted):
            run(scene, tmp_path / "parts")
    parts = run(scene, tmp_path / "parts", resume=True)
    assert [w for w in parts.summary["warnings"] if "no numbers" in w] == [warning]
    for name in ("displacement_x", "shear_angle", "thickness"):
        one, other = (result.datasets["/"][name].values for result in (whole, parts))
        np.testing.assert_array_equal(one, other)
    assert json.loads((tmp_path / "parts" / "summary.json").read_text())["warnings"]
