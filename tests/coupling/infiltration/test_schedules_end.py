"""A filling that waits for its clock: it ends when the part is full, and tables have an end."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Schedule, TimeTable, Vent
from lcmchain.coupling.infiltration.flow.film import Film
from lcmchain.coupling.infiltration.flow.preform import Preform

from .sample_meshes import plate


def filling(*gates):
    mesh = plate(8, 2, 0.1, 0.02)
    made = [Gate(name, mesh.node_sets["left"] if name == "a" else [13], **of) for name, of in gates]
    vent = Vent("v", mesh.node_sets["right"])
    return Filling(mesh, Preform(2e-3, 0.5, 1e-10), 0.1, made, [vent])


def test_a_full_part_does_not_wait_for_what_still_changes():
    """Not for the rest of a table of pressures, nor for a gate that opens later."""
    table = TimeTable(np.array([0.0, 400.0]), np.array([1e5, 3e5]))
    late = {"pressure": 1e5, "schedule": Schedule(opens=1000.0)}
    alone = filling(("a", {"pressure": table}))
    outcome, _ = alone.advance(5000.0)
    assert outcome == "filled" and alone.time < 100.0 and alone.state.step_count < 500
    both = filling(("a", {"pressure": table}), ("b", late))
    assert both.advance(5000.0)[0] == "filled" and both.time < 100.0


def test_a_pressure_that_is_too_low_at_first_is_followed_to_its_end():
    """No flow up to 100 s, where the table passes the vent's pressure: shares of what is left of
    a piece of the table would never reach its end."""
    table = TimeTable(np.array([0.0, 100.0, 110.0]), np.array([-1e5, 0.0, 2e5]))
    part = filling(("a", {"pressure": table}))
    outcome, _ = part.advance(5000.0)
    assert outcome == "filled"
    first = np.nanmin(part.state.fill_time[part.state.fill_time > 0.0])
    assert 100.0 < first < 110.0 and part.state.step_count < 1000
    never = filling(("a", {"pressure": TimeTable(np.array([0.0, 100.0]), np.array([-2e5, -1e5]))}))
    assert never.advance(5000.0)[0] == "no_source"
    assert never.time == pytest.approx(100.0, rel=1e-9)


def test_a_film_waits_for_the_pressure_that_presses_it():
    """Nothing presses up to 10 s; then p = p' t, and depth² = 2 K/(µ φ) p' t²/2 fills at h."""
    mesh = plate(8, 2, 0.1, 0.02)
    pressure = TimeTable(np.array([0.0, 10.0, 20.0]), np.array([0.0, 0.0, 5e5]))
    part = Filling(
        mesh, Preform(2e-3, 0.5, 1e-10, 1e-12), 0.1, [], [Vent("v", mesh.node_sets["right"])],
        film=Film(1.2e-3, pressure),
    )  # fmt: skip
    outcome, message = part.advance(100.0)
    assert outcome == "filled", message
    last = 10.0 + np.sqrt(0.5 * 0.1 * 2e-3**2 / (1e-12 * 5e4))
    assert part.time == pytest.approx(last, abs=0.06)
    half = 10.0 + 0.5 * (last - 10.0)  # what counts as the front is half the depth
    np.testing.assert_allclose(part.state.fill_time, half, atol=0.05)
