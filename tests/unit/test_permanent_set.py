"""The fabric with a permanent set: a law with memory, alone and in the solver."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, derive_fields, model_datasets, pressure_fields
from lcmchain.materials.fabric_with_set import FabricWithSetLaw
from lcmchain.materials.law import (
    evolved_history,
    history_count,
    load_history,
    membrane_response,
    store_history,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.mesh.blank import build_blank
from lcmchain.model import assemble_sheet
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import State
from lcmchain.statics import StaticProblem

SET = 0.3
THICKNESS = 1.004e-3
SCENE = """
process = {{ time = "20 ms", frames = 5, mass_damping = "500 1/s" }}
blank = {{ size = ["10 mm", "10 mm"], edge_length = "5 mm", height = "0.502 mm" }}
contact = {{ penalty = "1000 N/mm^3" }}

[material]
{material}

[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}

[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 1.004 mm"
motion = {{ type = "table", direction = [0, 0, -1], times = "0 10 20 ms", travel = "0 0.3 0 mm" }}
"""
WITH_SET = 'law = "fabric-with-set"\npreset = "MD600"\ncompaction.permanent_set = '


def scene(permanent_set=SET):
    return scene_from_text(SCENE.format(material=f"{WITH_SET}{permanent_set}"))


@pytest.fixture(scope="module")
def material():
    return scene().material.build()


def strains(E33):
    E = np.zeros((np.size(E33), 6))
    E[:, 2] = E33
    return E


def compiled(material, E33, most):
    """S33 and C33 of the compiled law."""
    S, C = membrane_response(material.law, (0.0, 0.0, E33, 0.0, 0.0, 0.0), (most,))
    return S[2], C[2]


# --- the law --------------------------------------------------------------------------------------


@pytest.mark.parametrize("E33", [-0.28, -0.2, -0.15, -0.07, -0.01, 0.02])
def test_the_stress_is_the_derivative_of_the_stored_energy(material, E33):
    """On the way back, where the set stays; with κ = -0.2 the set is at -0.06."""
    most, step = -0.2, 1e-6
    if E33 <= most:
        most = E33 - 1e-3  # κ ahead: the strain moves on the way back
    past = np.array([[most, most]])
    low, high = material.membrane_energy(strains([E33 - step, E33 + step]), past)
    S33, C33 = compiled(material, E33, most)
    assert S33 == pytest.approx((high - low) / (2.0 * step), rel=1e-6)
    low, high = (compiled(material, E33 + d, most)[0] for d in (-step, step))
    assert C33 == pytest.approx((high - low) / (2.0 * step), rel=1e-5)


@pytest.mark.parametrize("most", [-0.05, -0.2, -0.3])
def test_stored_and_lost_energy_are_the_work_of_the_loading(material, most):
    points, weights = leggauss(40)
    path = 0.5 * most * (1.0 + points)
    stress = [compiled(material, E33, 0.0)[0] for E33 in path]
    work = 0.5 * most * np.dot(weights, stress)
    past = np.array([[most]])
    (stored,), (lost,) = (
        material.membrane_energy(strains(most), past),
        material.dissipated_energy(past),
    )
    assert stored + lost == pytest.approx(work, rel=1e-9)
    assert lost / work == pytest.approx(SET, rel=1e-9)


def test_the_sheet_is_free_at_the_set_and_thickens_as_a_fresh_one(material):
    most = -0.2
    assert compiled(material, SET * most, most)[0] == pytest.approx(0.0, abs=1e-12)
    S33, C33 = compiled(material, SET * most + 0.05, most)
    assert (S33, C33) == pytest.approx(compiled(material, 0.05, 0.0), rel=1e-12)


def test_loading_is_that_of_the_fabric(material):
    fabric = scene_from_text(SCENE.format(material='preset = "MD600"')).material.build()
    for E33 in (-0.3, -0.1, 0.0, 0.1):
        S, C = membrane_response(fabric.law, (1e-3, -2e-3, E33, 0.4, 0.01, 0.02), ())
        own = membrane_response(material.law, (1e-3, -2e-3, E33, 0.4, 0.01, 0.02), (0.0,))
        assert own[0] == pytest.approx(S, rel=1e-12)
        assert own[1][2] == pytest.approx(C[2] / (1.0 - SET) if E33 < 0.0 else C[2], rel=1e-12)
        plain = [law.stress_and_tangent(strains(E33))[0] for law in (material, fabric)]
        np.testing.assert_allclose(*plain, rtol=1e-12)


@pytest.mark.parametrize(("E33", "most"), [(-0.15, -0.2), (-0.2, -0.1), (0.05, -0.2)])
def test_slope_and_curvature_are_those_of_the_tangent(material, E33, most):
    """For a path that keeps the set, or one that moves it all along."""
    step = 1e-4
    E = (0.0, 0.0, E33, 0.1, 0.0, 0.0)
    C = [compiled(material, E33 + d, most)[1] for d in (-step, 0.0, step)]
    slope = tangent_slope(material.law, E, (most,))
    curvature = tangent_curvature(material.law, E, (most,))
    assert slope[2] == pytest.approx((C[2] - C[0]) / (2 * step), rel=1e-5, abs=1e-3)
    assert curvature[2] == pytest.approx((C[2] - 2 * C[1] + C[0]) / step**2, rel=1e-4, abs=1.0)
    assert [slope[i] is None for i in range(6)] == [True, True, False, False, True, True]


def test_the_history_is_the_most_compacted_strain(material):
    law = material.law
    assert history_count(law) == 1 and FabricWithSetLaw.remembers[0].unit == "1"
    assert evolved_history(law, (0.0, 0.0, -0.1, 0.0, 0.0, 0.0), (-0.2,)) == (-0.2,)
    assert evolved_history(law, (0.0, 0.0, -0.3, 0.0, 0.0, 0.0), (-0.2,)) == (-0.3,)
    data = np.arange(6.0)
    assert load_history(law, data, 2, 16) == (2.0,)
    store_history(law, (7.0,), data, 2, 16)
    assert data[2] == 7.0


def test_without_a_set_it_is_the_fabric():
    plain = scene_from_text(SCENE.format(material='preset = "MD600"'))
    runs = [Simulation.from_scene(s) for s in (plain, scene(0.0))]
    for run in runs:
        run.make_steps(400, 0.5 * run.prepare_steps())
    np.testing.assert_allclose(runs[1].state.position, runs[0].state.position, rtol=0, atol=1e-15)


# --- in the solver --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cycle():
    """Pressed from 1.004 mm to 0.704 mm and back: (simulation, snapshots, state half way)."""
    simulation = Simulation.from_scene(scene())
    snapshots = [simulation.snapshot()]
    for time in np.linspace(0.0, 0.02, 41)[1:]:
        simulation.advance_to(float(time))
        snapshots.append(simulation.snapshot())
        if len(snapshots) == 31:
            half_way = simulation.state.copy()
    return simulation, snapshots, half_way


def mean_fields(simulation, snapshot):
    body = simulation.model.only_body()
    fields = derive_fields(body.mesh, body.material, snapshot.position)
    return fields | pressure_fields(body, snapshot.position, snapshot.history)


def test_pressure_over_thickness_is_the_law_on_both_ways(cycle):
    simulation, snapshots, _ = cycle
    # the force is that at the last step's positions: a frame lies within 3 µs of it
    for number in (12, 16, 20, 22, 24):
        snapshot = snapshots[number]
        pressure = mean_fields(simulation, snapshot)["compaction_pressure"]
        measured = snapshot.tool_force[0, 2] / -1e-4
        assert measured == pytest.approx(float(pressure.mean()), rel=0.02)
    # at the same thickness the way back carries less
    down, up = snapshots[16], snapshots[24]
    thickness = [float(mean_fields(simulation, s)["thickness"].mean()) for s in (down, up)]
    assert thickness[0] == pytest.approx(thickness[1], rel=0.01)
    assert -up.tool_force[0, 2] < 0.75 * -down.tool_force[0, 2]


def test_the_released_sheet_keeps_the_set(cycle):
    simulation, snapshots, _ = cycle
    most = snapshots[-1].history.min()
    assert most == pytest.approx(0.5 * ((0.704 / 1.004) ** 2 - 1.0), rel=5e-3)
    free = THICKNESS * np.sqrt(1.0 + 2.0 * SET * most)
    thickness = mean_fields(simulation, snapshots[-1])["thickness"]
    np.testing.assert_allclose(thickness, free, rtol=2e-3)


def test_the_energy_balance_counts_what_is_lost(cycle):
    simulation, snapshots, _ = cycle
    lost = [s.energy["inelastic"] for s in snapshots]
    largest = max(s.energy["internal"] for s in snapshots)
    assert min(np.diff(lost)) >= 0.0
    body = simulation.model.only_body()
    past = body.element_history(snapshots[-1].history)
    density = body.material.dissipated_energy(past)
    assert lost[-1] == pytest.approx(float(density.mean()) * body.volume, rel=1e-9)
    assert lost[-1] > 0.2 * largest
    assert max(abs(s.energy["balance_error"]) for s in snapshots) < 2e-3 * (largest + lost[-1])


def test_a_restored_state_goes_on_with_its_history(cycle):
    simulation, snapshots, half_way = cycle
    again = Simulation.from_scene(scene())
    again.restore(half_way)
    for time in np.linspace(0.0, 0.02, 41)[31:]:
        again.advance_to(float(time))
    for name, array in again.state.as_dict().items():
        np.testing.assert_array_equal(array, getattr(simulation.state, name), err_msg=name)
    forgetful = State(**half_way.as_dict() | {"history": 0.0 * half_way.history})
    again.restore(forgetful)
    again.advance_to(0.02)
    assert abs(again.state.position - simulation.state.position).max() > 1e-5


def test_the_history_is_a_field_of_the_result(cycle):
    simulation, snapshots, _ = cycle
    frames = FrameSeries.from_snapshots(snapshots, simulation.model.tool_names)
    sheet = model_datasets(scene(), simulation.model, frames)["/"]
    most = sheet["largest_compaction_strain"]
    assert most.dims == ("time", "sheet_face") and most.attrs["units"] == "1"
    assert most.attrs["location"] == "face" and "thinnest" in most.attrs["long_name"]
    E33 = 0.5 * ((sheet["thickness"] / THICKNESS) ** 2 - 1.0)
    np.testing.assert_allclose(most[:21], E33[:21].clip(max=0.0), rtol=0.05, atol=2e-3)
    np.testing.assert_array_equal(np.diff(most, axis=0).max() <= 0.0, True)


def test_the_static_solver_says_that_it_knows_no_memory(material):
    the_scene = scene()
    model = assemble_sheet(build_blank(the_scene.blank, THICKNESS), material)
    with pytest.raises(InputError, match="material.law: .* has a law with memory"):
        StaticProblem(model=model, held=np.ones((3, model.node_count), dtype=bool))
