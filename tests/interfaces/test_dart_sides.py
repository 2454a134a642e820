"""Sides of a dart that are led over each other: what contact of a ply with itself does and not."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import T, of_points, scene_of, smooth, stack, thickness
from test_springs import renew

from lcmchain.effects.supports import Support
from lcmchain.interfaces.rows import LAST_DEPTH
from lcmchain.interfaces.table import Interface
from lcmchain.mesh.blank import build_blank
from lcmchain.model import Sheet
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

EDGE = 2.5e-3
MOUTH, DEEP = 16e-3, 65e-3  # of the dart: its width at the rim, and from there to the apex [m]
APEX, RIM = -25e-3, 40e-3  # along y [m]
OVER = 26e-3  # way of the right side's end to the left [m]: 10 mm more than the mouth
# Facets within this of a point in the flat ply are left out, see lcmchain.interfaces.search.
CREASE = 2.5 * EDGE + 2e-3 * T
TIME = 0.1
PRESSED = 1.9  # distance of the plates in the end, in thicknesses


def dart(scene) -> Sheet:
    cut = scene_from_text(f"""
process = {{ time = "1 ms" }}
tools = []
[blank]
size = ["60 mm", "80 mm"]
edge_length = "{1e3 * EDGE} mm"
darts = [[["{-500 * MOUTH} mm", "{1e3 * RIM} mm"], ["0 mm", "{1e3 * APEX} mm"],
          ["{500 * MOUTH} mm", "{1e3 * RIM} mm"]]]
[material]
preset = "MD600"
""")
    mesh = build_blank(cut.blank, cut.material.thickness)
    return Sheet("dart", mesh, scene.material.build(), scene.element)


def sides(sim):
    """Lower nodes of the right side and upper ones of the left side of the dart."""
    mesh = sim.model.bodies[0].mesh
    x, y, _ = mesh.node_positions.T
    upper = np.unique(mesh.elements[:, 4:])
    lower = np.setdiff1d(np.arange(mesh.node_count), upper)
    right = lower[(x[lower] > 0.0) & (y[lower] > APEX)]
    left = upper[(x[upper] < 0.0) & (y[upper] > APEX)]
    return right, left


def sheared(sim, height):
    """Put the right side over the left one by shear along x, ``height`` [m] above it."""
    mesh = sim.model.bodies[0].mesh
    X = mesh.node_positions
    part = np.where(X[:, 0] > 0.0, np.clip((X[:, 1] - APEX) / DEEP, 0.0, 1.0), 0.0)
    position = X.copy()
    position[:, 0] -= OVER * part
    position[:, 2] += height * (part > 0.0)
    sim.state.position[:, : len(X)] = position.T
    renew(sim)
    return part


def held_of_overlap(sim, part):
    """Which nodes of the right side that lie over the left one are held, and how far they moved."""
    right, _ = sides(sim)
    x, y = sim.state.position[:2, right]
    over = x < -0.5 * MOUTH * (y - APEX) / DEEP - 0.5 * EDGE
    nodes = right[over]
    return nodes, sim.state.ply_facet[nodes] >= 0, OVER * part[nodes]


@pytest.fixture
def sim():
    scene = scene_of()
    return stack([dart(scene)], scene, Interface(itself=True))


def test_a_side_that_lies_on_the_other_is_held_up_beyond_the_crease(sim):
    part = sheared(sim, 1.02e-3 * T)
    nodes, held, moved = held_of_overlap(sim, part)
    assert nodes.size > 20
    far = moved > CREASE + 2.0 * EDGE
    assert far.any() and held[far].all()
    assert not held[moved < CREASE - 2.0 * EDGE].any()
    assert -of_points(sim, LAST_DEPTH)[nodes[far]] == pytest.approx(0.02e-3 * T, rel=1e-6)


def test_sides_that_slide_into_each_other_edge_to_edge_are_not(sim):
    part = sheared(sim, 0.0)
    _, held, _ = held_of_overlap(sim, part)
    assert held.size > 20 and not held.any()


def pressed(*interfaces) -> Simulation:
    """Leads the right side over the left one, lays it down there and presses both with a plate."""

    def lead(time):
        up = 3e-3 * T * smooth(time / (0.2 * TIME))
        across = OVER * smooth((time / TIME - 0.15) / 0.4)
        way = [-across, -(DEEP - np.sqrt(DEEP**2 - across**2)), up]
        return np.column_stack([np.eye(3), way])

    scene = scene_of(
        time=1e3 * TIME, damping=200.0, bottom=-0.5 * T, top=5.0 * T,
        times=f"0 {550 * TIME} {900 * TIME} {1e3 * TIME} ms",
        way=f"0 0 {(5.5 - PRESSED) * T} {(5.5 - PRESSED) * T} mm",
    )  # fmt: skip
    ply = dart(scene)
    x, y, _ = ply.mesh.node_positions.T
    end = np.abs(y - RIM) < 1e-9
    second = np.abs(y - RIM + EDGE) < 0.5 * EDGE
    supports = [
        Support("bottom", np.flatnonzero(np.abs(y + RIM) < 1e-9), "xy"),
        Support("left", np.flatnonzero(end & (x < 0.0)), "xy"),
        Support("right", np.flatnonzero(end & (x > 0.0)), "xy", lead),
        Support("up", np.flatnonzero(second & (x > 0.0)), "z", lead, release_time=0.6 * TIME),
    ]
    return stack([ply], scene, *interfaces, supports=supports)


@pytest.mark.slow
def test_sides_led_over_each_other_carry_a_plate_between_them():
    sim = pressed(Interface(friction=0.2, itself=True))
    sim.advance_to(TIME)
    body = sim.model.bodies[0]
    X, position = body.mesh.node_positions, sim.state.position.T
    right, left = sides(sim)
    moved = np.linalg.norm(position - X, axis=1)
    left_rim = -0.5 * MOUTH * (position[:, 1] - APEX) / DEEP
    far = (moved > CREASE + 2.0 * EDGE) & (position[:, 0] < left_rim - 0.5 * EDGE)
    nodes = right[far[right]]
    assert nodes.size > 20
    for node in nodes:
        nearest = left[np.argmin(np.hypot(*(position[left] - position[node])[:, :2].T))]
        assert abs(position[node, 2] - position[nearest, 2]) < 0.03e-3 * T
    # both are squeezed between the plates, and share what is missing
    owned = far[body.mesh.elements[:, :4]].all(axis=1) & (
        X[body.mesh.elements[:, :4], 0].min(axis=1) > 0.0
    )
    assert thickness(sim, body)[owned] == pytest.approx(0.5 * PRESSED * 1e-3 * T, rel=0.03)
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 5e-3 * energy["external"]
