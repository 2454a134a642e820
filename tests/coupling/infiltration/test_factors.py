"""Factors of the pressure's equations are kept while the matrix is the same, and change no bit."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow import pressure as kept
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.preform import Preform
from lcmchain.errors import SimulationError

from .sample_meshes import plate, random_plate


def from_the_left(mesh, **given):
    return Filling(
        mesh, Preform(0.003, 0.5, 1e-10), 0.1,
        [Gate("inlet", mesh.node_sets["left"], pressure=1e5)],
        [Vent("end", mesh.node_sets["right"], closes_when_wet=False)], **given,
    )  # fmt: skip


def test_a_matrix_is_factorised_once():
    solver = kept.Factors()
    matrices = [csc_matrix(np.diag([4.0, 3.0, 2.0]) + s * np.ones((3, 3))) for s in range(6)]
    for matrix in (matrices[0], matrices[1], matrices[0].copy()):
        found = matrix @ solver.solve(matrix, np.arange(3.0))
        np.testing.assert_allclose(found, np.arange(3.0), atol=1e-14)
    assert (solver.work.factorisations, solver.work.solutions) == (2, 3)
    for matrix in matrices[2:]:
        solver.solve(matrix, np.ones(3))
    solver.solve(matrices[0], np.ones(3))  # the oldest were given up
    assert solver.work.factorisations == 7
    with pytest.raises(SimulationError, match="neither at a gate or vent nor at the front"):
        solver.solve(csc_matrix(np.zeros((2, 2))), np.ones(2))


def test_a_saturated_part_is_factorised_once():
    """Resin flows through; only the pressure at the gate would change."""
    mesh = plate(10, 4, 0.3, 0.1)
    filling = from_the_left(
        mesh, wetted=np.arange(mesh.node_count), options=FillingOptions(largest_step=5.0)
    )
    filling.advance(100.0)
    assert filling.state.step_count >= 20
    assert filling.work.factorisations == 1
    assert filling.work.solutions >= 20


def test_a_step_of_a_front_takes_two():
    filling = from_the_left(plate(20, 4, 0.3, 0.1))
    filling.advance(50.0)
    steps = filling.state.step_count
    assert filling.work.factorisations <= 2 * steps + 2


def test_a_step_that_is_done_again_needs_no_new_factors(monkeypatch):
    """As in an iteration between textile and resin; the result is that without kept factors."""
    results = []
    for count in (kept.KEPT, 0):
        monkeypatch.setattr(kept, "KEPT", count)
        filling = from_the_left(random_plate(0.02, 0.3, 0.1, seed=1))
        filling.advance(20.0)
        saved, before = filling.save(), filling.work.factorisations
        filling.advance(20.5)
        once = filling.work.factorisations - before
        for _ in range(3):
            filling.restore(saved)
            filling.advance(20.5)
        assert filling.work.factorisations - before == (once if count else once * 4 + 3)
        results.append(filling.state)
    for name in ("pressure", "resin_volume", "injected"):
        np.testing.assert_array_equal(getattr(results[0], name), getattr(results[1], name))
