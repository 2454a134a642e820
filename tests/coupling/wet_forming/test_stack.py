"""Forming and filling of a stack at once: against one sheet, unlike plies, resuming, sliding."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from strips import bleeding_at_both_ends, wet

from lcmchain.coupling.solids.stack import StackForming
from lcmchain.coupling.solids.tool_loads import fibre_forces
from lcmchain.coupling.wet_forming.sheet import through_columns
from lcmchain.errors import InputError
from lcmchain.interfaces.in_frames import GAP, PRESSED
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

# Saturated plies between stiff plates; the resin leaves at both ends. Neither friction nor a film
# holds the plies together, and nothing else damps.
T = 1.004e-3
ALONG, ACROSS = 2e-10, 1e-10


def scene_text(plies, count, width=10, closing=0.1, damping=0.0, material='preset = "MD600"'):
    layered = plies.startswith("layup")
    lowest = T if layered else count * T
    return f"""
{plies if layered else ""}
process = {{ time = "10 ms", frames = 3, mass_damping = "{damping} 1/s" }}
blank = {{ size = ["100 mm", "{width} mm"], edge_length = "5 mm" }}
material = {{ {material} }}
contact = {{ friction = 0.0, penalty = "40 MPa/mm" }}
[permeability]
law = "constant"
k1 = "{ALONG} m^2"
k2 = "{ACROSS} m^2"
k3 = "1e-11 m^2"
[[tools]]
name = "die"
shape = {{ type = "plate", side = "below" }}
position = "0 0 {-500 * lowest} mm"
[[tools]]
name = "press"
shape = {{ type = "plate", side = "above" }}
position = "0 0 {1e3 * count * T - 500 * lowest} mm"
[tools.motion]
type = "stroke"
direction = [0, 0, -1]
distance = "{closing} mm"
profile = "linear"
[output]
pictures = false
report = false
vtu = false
{bleeding_at_both_ends(across=60, high=9)}"""


TWO = scene_text('layup = "[0/90]2"', 2, damping=200)
UNLIKE = scene_text('layup = "[0/90, 45/-45, 30/-60, 0/90]"', 4, width=40, closing=0.4)
ONE = scene_text(
    "one", 2, damping=200,
    material='preset = "MD600", thickness = "2.008 mm", areal_mass = "1.203 kg/m^2"',
)  # fmt: skip


# --- columns: no step is made ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def unlike():
    return wet(UNLIKE)


def test_all_of_every_ply_lies_in_columns(unlike):
    forming = unlike.forming
    assert forming.reference == 0 and forming.element_count == 20 * 8
    shares = forming.shares
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-9)
    assert shares.min() >= 0.0
    # each column has the whole of its area of each ply, but for the cut elements at the rim
    for body in unlike.simulation.model.bodies:
        own = shares[body.first_element : body.first_element + body.mesh.element_count]
        area = own.T @ body.mesh.areas(body.mesh.node_positions)
        np.testing.assert_allclose(area, 25e-6, rtol=0.02)
    volume = forming.volume()
    assert volume.sum() == pytest.approx(100e-3 * 40e-3 * 4 * T, rel=1e-12)
    of_resin = unlike.filling.state.thickness * unlike.filling.mesh.areas
    np.testing.assert_allclose(of_resin, volume, rtol=1e-9)


def test_layers_conduct_side_by_side_along_the_stack():
    """Two plies across each other have the mean of both permeabilities in every direction."""
    crossed = wet(scene_text('layup = "[0/90, 90/0]"', 2))
    tensor = crossed.filling.medium.preform.permeability
    mean = 0.5 * (ALONG + ACROSS)
    expected = np.broadcast_to(np.diag([mean, mean, 0.0]), tensor.shape)
    np.testing.assert_allclose(tensor, expected, atol=1e-6 * mean)
    np.testing.assert_allclose(crossed.filling.medium.preform.through_permeability, 1e-11)


def test_layers_conduct_one_after_the_other_through_the_stack():
    axes, normals = np.stack([np.eye(3)] * 2), np.array([[0.0, 0.0, 1.0]])
    values = np.array([[4.0, 2.0, 1.0], [8.0, 4.0, 0.2]])
    tensor, through = through_columns(csr_array([[3.0], [1.0]]), values, axes, normals)
    np.testing.assert_allclose(tensor[0], np.diag([5.0, 2.5, 0.0]))
    assert through[0] == pytest.approx(4.0 / (3.0 / 1.0 + 1.0 / 0.2))


def test_a_ply_that_slides_takes_its_fibres_along_and_leaves_the_resin():
    part = wet(scene_text('layup = "[0/90]2"', 2))
    forming, filling = part.forming, part.filling
    pores, resin = filling.pores.copy(), filling.state.resin_volume.copy()
    fibres = filling.medium.fibre_volume.copy()
    upper = part.simulation.model.bodies[1]
    moved = part.simulation.state.position[:, upper.first_node :]
    moved[0] += 2e-3
    part._permeability.renew(filling)
    np.testing.assert_allclose(filling.pores, pores, rtol=1e-12)
    np.testing.assert_array_equal(filling.state.resin_volume, resin)
    # two columns at one end have lost 2 of 5 mm of a ply; what hangs over at the other end is dry
    lost = fibres - filling.medium.fibre_volume
    ends = filling.mesh.centroids[:, 0] < -47e-3
    np.testing.assert_allclose(lost[ends], 0.5 * 0.4 * fibres[ends], rtol=1e-6)
    np.testing.assert_allclose(lost[~ends], 0.0, atol=1e-6 * fibres.max())
    beside = forming.shares[upper.first_element :].sum(axis=1).min()
    assert beside == pytest.approx(0.6, rel=1e-6)
    # and only its part over columns is under pressure
    pressure = forming._pressure_in_lanes(np.full(forming.element_count, 1e5))
    assert pressure[part.simulation.model.pore.place].min() == pytest.approx(1e5 * 0.6)


def test_one_sheet_is_no_stack():
    model = build_model(scene_from_text(ONE), pore_pressure=True)
    with pytest.raises(InputError, match="no stack"):
        StackForming(Simulation(model))


# --- formed ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def squeezed():
    """Two equal plies, and pressure, forces and thickness at some times."""
    part = wet(TWO)
    return part, followed(part)


def followed(part, times=(0.5e-3, 1e-3, 2e-3, 3e-3, 4e-3)):
    found = []
    for time in times:
        part.advance_to(time)
        total, _, resin, _, _ = part.force()
        state = part.filling.state
        found.append([state.pressure.max(), resin, total, state.thickness.mean()])
    return np.array(found)


@pytest.mark.slow
def test_two_equal_plies_are_pressed_as_one_of_twice_the_thickness(squeezed):
    """Pressure, its force, the whole force and the thickness, while it settles and afterwards."""
    part, found = squeezed
    expected = followed(wet(ONE))
    np.testing.assert_allclose(found, expected, rtol=5e-3)
    np.testing.assert_allclose(found[:, 3], expected[:, 3], rtol=1e-5)
    assert part.history.mean_iterations < 4.0


@pytest.mark.slow
def test_a_stack_and_its_resin_have_the_same_volume(squeezed):
    part, _ = squeezed
    of_resin = part.filling.state.thickness * part.filling.mesh.areas
    np.testing.assert_allclose(of_resin, part.forming.volume(), rtol=1e-5)
    state = part.filling.state
    lost = state.started_volume - state.resin_volume.sum()
    assert lost > 0.01 * state.started_volume
    assert state.vented.sum() == pytest.approx(lost, rel=1e-12)
    assert np.abs(part.record.balance_error).max() < 1e-12 * state.started_volume


@pytest.mark.slow
def test_the_plies_bear_what_resin_leaves_to_the_fibres(squeezed):
    """Springs between the plies carry the fibres' part, a fraction of the whole.

    The interface swings a little; the mean of the fibres below and above it has no part in that.
    """
    part, _ = squeezed
    simulation = part.simulation
    state, contact = simulation.state, simulation.model.ply_contact
    lower, upper = simulation.model.bodies
    below = np.unique(lower.mesh.elements[:, 4:])
    above = np.unique(upper.mesh.elements[:, :4]) + upper.first_node
    pressed = simulation.between_plies(contact.data)[PRESSED][above].sum()
    force = fibre_forces(simulation, state.position - state.last_step * state.velocity)[2]
    fibres = 0.5 * (force[below].sum() - force[above].sum())
    assert part.force()[2] > 5.0 * fibres > 0.0
    assert pressed == pytest.approx(fibres, rel=0.01)


@pytest.mark.slow
def test_unlike_plies_share_the_thickness_without_friction_or_damping():
    """Four plies that nothing holds together stay flat and have one thickness."""
    part = wet(UNLIKE)
    part.advance_to(6e-3)
    simulation = part.simulation
    positions = simulation.state.position.T
    mean = part.filling.state.thickness.mean() / 4.0
    assert mean == pytest.approx(T - 0.06e-3, rel=2e-3)
    for body in simulation.model.bodies:
        own = positions[body.first_node : body.first_node + body.mesh.node_count]
        pairs = body.mesh.pair_count
        thickness = np.linalg.norm(own[pairs:] - own[:pairs], axis=1)
        assert thickness.mean() == pytest.approx(mean, rel=5e-3)
        assert np.abs(thickness / mean - 1.0).max() < 0.05
    gap = simulation.between_plies(simulation.model.ply_contact.data)[GAP]
    assert np.nanmax(np.abs(gap)) < 5e-3 * T
    assert part.history.mean_iterations < 4.0
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 0.02 * energy["external"]


@pytest.mark.slow
def test_a_stopped_and_resumed_stack_goes_on_bit_by_bit(tmp_path):
    whole = wet(TWO)
    whole.advance_to(1e-3)
    whole.write_checkpoint(tmp_path, 7)
    whole.advance_to(2e-3)
    resumed = wet(TWO)
    resumed.restore_checkpoint(tmp_path, 7)
    resumed.advance_to(2e-3)
    for name, values in whole.simulation.state.as_dict().items():
        np.testing.assert_array_equal(resumed.simulation.state.as_dict()[name], values, name)
    first, second = whole.filling.save(), resumed.filling.save()
    for name in ("resin_volume", "pressure", "thickness", "vented"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), name)


@pytest.mark.slow
def test_what_is_filled_knows_its_plies(squeezed):
    part, _ = squeezed
    part.keep_frame()
    simulation = part.simulation
    start = Simulation.from_scene(part.scene).snapshot()
    filled = part.filled([start, simulation.snapshot()])
    dataset = filled.setup.part.dataset
    for name in ("ply_1", "ply_2"):
        np.testing.assert_allclose(dataset[f"ply_share_{name}"], 0.5, atol=0.01)
    fraction = dataset["fibre_volume_fraction"].values
    np.testing.assert_allclose(
        fraction, part.filling.medium.fibre_fraction(part.filling.state.thickness), rtol=0.01
    )
