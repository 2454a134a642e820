"""Resin in a stack while it is formed whose plies end inside others."""

from __future__ import annotations

import numpy as np
import pytest
from strips import PERMEABILITY, VISCOSITY, between_plates, bleeding_at_both_ends, wet

from lcmchain.coupling.solids.stack import PliesInColumns
from lcmchain.coupling.solids.tool_loads import _fluid_forces
from lcmchain.errors import InputError
from lcmchain.scene import scene_from_text

T = 1.004e-3
HALF, WIDTH, SPEED = 25e-3, 10e-3, 0.01

PLY = """
[[plies]]
name = "{name}"
size = ["{length} mm", "10 mm"]
edge_length = "5 mm"
"""


def text_of(**lengths):
    """Return the scene of plies with lengths [mm] by their names, bottom first."""
    head = """
process = { time = "10 ms", frames = 3, mass_damping = "200 1/s" }
material = { preset = "MD600" }
contact = { friction = 0.0, penalty = "40 MPa/mm" }
output = { pictures = false, report = false, vtu = false }
"""
    plies = "".join(PLY.format(name=name, length=length) for name, length in lengths.items())
    top = 1e3 * T * (len(lengths) - 0.5)
    ends = bleeding_at_both_ends(25, reach=26, high=9)
    return head + plies + between_plates(top=f"{top:.6g}") + ends


@pytest.fixture(scope="module")
def patched():
    """A patch between two long plies, at the start."""
    return wet(text_of(lower=100, patch=50, upper=100))


def parts_of(part):
    """Part of the lower and upper face of each element that looks at a ply, by the plies."""
    part.forming.renew()
    bodies, inner = part.simulation.model.bodies, np.stack(part.forming.inner)
    firsts = [body.first_element for body in bodies]
    return dict(zip((body.name for body in bodies), np.split(inner, firsts[1:], axis=1)))


def middles(part, name):
    """Where elements of a ply lie along the strip (E,) [m]."""
    body = next(body for body in part.simulation.model.bodies if body.name == name)
    own = part.simulation.state.position.T[body.first_node :][: body.mesh.node_count]
    return own[body.mesh.elements].mean(axis=1)[:, 0]


def test_a_ply_looks_at_the_next_one_that_is_there(patched):
    """Beside the patch the long plies are a ply apart, and their faces bare, until they meet."""
    found = parts_of(patched)
    under = np.abs(middles(patched, "lower")) < HALF
    np.testing.assert_allclose(found["patch"], 1.0, atol=1e-9)
    np.testing.assert_allclose(found["lower"], [0.0 * under, under], atol=1e-9)
    np.testing.assert_allclose(found["upper"], [under, 0.0 * under], atol=1e-9)
    state, upper = patched.simulation.state, patched.simulation.model.bodies[2]
    before = state.position.copy()
    beside = np.abs(state.position[0]) > HALF + 1e-3
    beside[: upper.first_node] = False
    state.position[2, beside] -= T
    found = parts_of(patched)
    state.position[:] = before
    far = np.abs(middles(patched, "upper")) > HALF + 5e-3
    np.testing.assert_allclose(found["upper"][0][far], 1.0, atol=1e-9)
    np.testing.assert_allclose(found["lower"][1][far], 1.0, atol=1e-9)


def test_equal_pressure_pushes_no_stack_away(patched):
    """The whole stays in balance, slid or not; within the plies' rims no inner face is loaded."""
    state, model = patched.simulation.state, patched.simulation.model
    before, patch = state.position.copy(), model.bodies[1]
    for slid in (0.0, 1.7e-3, 4.1e-3):
        state.position[0, patch.first_node :][: patch.mesh.node_count] += slid
        patched.forming.renew()
        pressure = patched.forming._pressure_in_lanes(np.full(patched.forming.element_count, 1e5))
        force = _fluid_forces(patched.simulation.model, state.position, pressure)
        own = force[:, patch.first_node :][:, : patch.mesh.node_count]
        inside = (
            np.abs(state.position[0, patch.first_node :][: patch.mesh.node_count] - slid) < 19e-3
        )
        state.position[:] = before
        size = 1e5 * 25e-6
        assert np.abs(force.sum(axis=1)).max() < 1e-9 * size
        assert np.abs(own[2, inside]).max() < 1e-9 * size
        assert np.abs(force[2]).max() > 0.4 * size
    patched.forming.renew()


def test_faces_of_two_plies_look_at_each_other_alike():
    """What one sees above is what the others see below, in every column."""
    rng = np.random.default_rng(3)
    part = rng.random((4, 50))
    part[1] = np.where(part[1] < 0.3, 0.0, part[1])
    height = np.cumsum(rng.uniform(0.8, 1.6, (4, 50)), axis=0)
    plies = PliesInColumns(part, height, np.ones_like(part))
    below, above = plies.facing([1.0] * 4)
    np.testing.assert_allclose(below.sum(axis=0), above.sum(axis=0), atol=1e-12)
    assert (below <= part + 1e-12).all() and (above <= part + 1e-12).all()
    assert not below[0].any() and not above[3].any() and above[0].any()
    # what lies on each other looks at the next one wherever both are, and past it elsewhere
    lying = plies._replace(height=np.arange(4.0)[:, None] * np.ones(50))
    below, above = lying.facing([1.0] * 4)
    np.testing.assert_allclose(above[2], np.minimum(part[2], part[3]))
    np.testing.assert_allclose(above[0], np.minimum(part[0], part[1]))
    touching = plies._replace(height=np.zeros_like(part), thickness=np.zeros_like(part))
    below, above = touching.facing([1.0] * 4)
    np.testing.assert_allclose(above[0], np.minimum(part[0], part[1:].max(axis=0)))


@pytest.mark.slow
def test_a_short_ply_on_a_long_one_is_squeezed_as_a_strip_of_both():
    """p = mu h' (a² - x²) / (2 K h) with the half length of the short one."""
    part = wet(text_of(long=100, short=50))
    fibres = part._permeability.fibre_volume.sum()
    part.advance_to(4e-3)
    filling, state = part.filling, part.filling.state
    wet_cells = np.abs(filling.mesh.centroids[:, 0]) < HALF
    thickness = state.thickness[wet_cells].mean()
    assert thickness == pytest.approx(2 * T - 0.04e-3, rel=0.005)
    np.testing.assert_allclose(state.thickness[~wet_cells], T, rtol=0.01)
    speed = -part.forming.get_fields(["thickness_rate"])["thickness_rate"][wet_cells].mean()
    largest = VISCOSITY * speed * HALF**2 / (2.0 * PERMEABILITY * thickness)
    assert state.pressure.max() == pytest.approx(largest, rel=0.02)
    assert part.force()[2] == pytest.approx(4.0 / 3.0 * largest * HALF * WIDTH, rel=0.02)
    # resin, fibres, and one volume of both sides
    assert np.abs(part.record.balance_error).max() < 1e-12 * state.started_volume
    lost = state.started_volume - state.resin_volume.sum()
    assert state.vented.sum() == pytest.approx(lost, rel=1e-12)
    assert filling.medium.fibre_volume.sum() == pytest.approx(fibres, rel=1e-12)
    of_resin = state.thickness * filling.mesh.areas
    np.testing.assert_allclose(of_resin[wet_cells], part.forming.volume()[wet_cells], rtol=1e-4)
    assert part.history.mean_iterations < 6.0
    energy = part.simulation.energy()
    assert abs(energy["balance_error"]) < 0.02 * energy["external"]


def test_a_ply_that_floats_above_the_others_is_refused():
    text = text_of(long=100, short=50).replace('name = "short"', 'name = "short"\nheight = "3 mm"')
    with pytest.raises(InputError, match='leaves a gap of .* mm to "long".*with_forming'):
        scene_from_text(text)
