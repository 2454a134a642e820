"""A tool that touches the blank at the start within the tolerance begins without a force."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.errors import SimulationError
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools.table import OVERLAP_TOLERANCE

THICKNESS = 1.004e-3
SCENE = """
title = "touch"
process = {{ time = "2 ms", frames = 2 }}
material = {{ preset = "MD600" }}
blank = {{ size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }}
element = {{ type = "{family}" }}
[[tools]]
name = "bed"
shape = {{ type = "plate", side = "below" }}
position = "0 0 {bed:.12f} mm"
[[tools]]
name = "press"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {press:.12f} mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "0.2 mm", start = "{start} ms" }}
"""


def simulation(bed=0.0, press=1.004, start=1, family="solid-shell") -> Simulation:
    text = SCENE.format(bed=bed, press=press, start=start, family=family)
    return Simulation.from_scene(scene_from_text(text))


def test_touching_and_rounding_are_no_overlap():
    """Tools that touch to the last bits keep the bits of their gaps."""
    for shift in (0.0, 1e-12, -1e-12, -0.5):
        sim = simulation(bed=shift, press=1.004 - shift)
        assert (sim.model.tools.initial_overlap == 0.0).all()


@pytest.mark.parametrize("family", ["solid-shell", "membrane-shell"])
def test_a_tolerated_overlap_exerts_no_force_and_holds_no_energy(family):
    sim = simulation(bed=0.005, press=0.996, family=family)
    np.testing.assert_allclose(sim.model.tools.initial_overlap, [5e-6, 8e-6], rtol=1e-9)
    for time in (1e-7, 5e-6, 1e-3):
        sim.advance_to(time)
        energy = sim.energy()
        # depths of rounding, some 1e-18 m, are driven to zero as well
        assert abs(energy["external"]) < 1e-30
        assert max(abs(value) for value in energy.values()) < 1e-15
        assert np.abs(sim.state.tool_force).max() < 1e-6
    assert sim.state.penetration_max.max() < 1e-12


def test_the_energy_balance_is_that_of_a_touch():
    """The same press, 8 µm further in at the start: from step 0 on the same energies."""
    touch, overlap = simulation(start=0), simulation(bed=0.005, press=1.001, start=0)
    for time in np.linspace(0.0, 2e-3, 41)[1:]:
        touch.advance_to(float(time))
        overlap.advance_to(float(time))
        expected, found = touch.energy(), overlap.energy()
        size = max(abs(value) for value in expected.values())
        for name, value in expected.items():
            assert found[name] == pytest.approx(value, abs=1e-6 * size), name
    assert expected["external"] > 1e-3


def test_a_deeper_overlap_is_left_to_the_guard():
    sim = simulation(bed=1.1e3 * OVERLAP_TOLERANCE * THICKNESS)
    assert (sim.model.tools.initial_overlap == 0.0).all()
    with pytest.raises(SimulationError, match="runs away"):
        sim.advance_to(1e-3)


def test_a_restored_run_goes_on_to_the_same_bits():
    whole, first, second = (simulation(bed=0.005, press=0.996, start=0) for _ in range(3))
    whole.advance_to(1e-3)
    first.advance_to(1e-3)
    saved = first.state.copy()
    first.advance_to(1.1e-3)  # what a rollback throws away
    first.restore(saved)
    second.restore(saved)
    for sim in (whole, first, second):
        sim.advance_to(2e-3)
    for name, array in whole.state.as_dict().items():
        assert np.array_equal(array, getattr(first.state, name)), name
        assert np.array_equal(array, getattr(second.state, name)), name
