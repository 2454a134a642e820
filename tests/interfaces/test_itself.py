"""A ply that touches itself where it folds."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import T, of_points, ply, scene_of, stack, wrapped
from test_springs import forces_at, renew

from lcmchain.effects.supports import Support
from lcmchain.interfaces.rows import LAST_DEPTH
from lcmchain.interfaces.table import Interface
from lcmchain.solver.simulation import Simulation

RADIUS = 0.9e-3 * T  # of the mid-surface in the bend: its legs are 0.8 of a thickness apart
LONG = 30.0  # of the strip [mm]


def folded(*interfaces):
    """A strip around a half turn, its legs upright beside each other, and a ply far off."""
    strip = {"width": LONG, "height": 8.0, "edge": 1.0}
    sim = stack([ply("strip", **strip), ply("far", z=80.0)], scene_of(), *interfaces)
    bent = wrapped("strip", RADIUS, np.pi, **strip).mesh.node_positions
    sim.state.position[:, : len(bent)] = bent.T
    return sim


def faces(sim):
    """Upper and lower points of the strip, by how far they lie from the middle of the bend [m]."""
    body = sim.model.bodies[0]
    along = np.abs(ply("strip", width=LONG, height=8.0, edge=1.0).mesh.node_positions[:, 0])
    upper = np.unique(body.mesh.elements[:, 4:])
    return upper, np.setdiff1d(np.arange(body.mesh.node_count), upper), along


@pytest.fixture(scope="module")
def sim():
    sim = folded(Interface(itself=True))
    renew(sim)
    return sim


def test_the_inner_faces_of_a_fold_see_each_other_but_not_in_its_crease(sim):
    upper, lower, along = faces(sim)
    held = sim.state.ply_facet >= 0
    assert held[upper[along[upper] > 2.8e-3]].all()
    assert not held[upper[along[upper] < 2.2e-3]].any()
    assert not held[lower].any()
    gap = -of_points(sim, LAST_DEPTH)[upper[along[upper] > 2.8e-3]]
    assert gap == pytest.approx(2.0 * RADIUS - 1e-3 * T, rel=1e-3)


def test_they_press_each_other_with_no_sum(sim):
    """The legs pressed together by a fiftieth of a millimetre more than their gap."""
    upper, lower, along = faces(sim)
    position = sim.state.position.copy()
    legs = sim.model.bodies[0].mesh.node_count
    right = np.flatnonzero(position[0, :legs] > 0.0)
    position[0, right] -= 2.0 * RADIUS - 1e-3 * T + 20e-6
    force, stored = forces_at(sim, position)
    pressed = upper[along[upper] > 2.8e-3]
    assert stored > 0.0
    assert np.abs(force.sum(axis=1)).max() < 1e-12 * np.abs(force).sum()
    assert (force[0, np.intersect1d(pressed, right)] > 0.0).all()
    assert (force[0, np.setdiff1d(pressed, right)] < 0.0).all()


def test_without_the_entry_a_ply_passes_through_itself():
    sim = folded(Interface())
    renew(sim)
    assert (sim.state.ply_facet < 0).all()


def test_a_single_sheet_may_touch_itself():
    model = stack([ply("strip")], scene_of(), Interface(itself=True)).model
    assert model.ply_contact.data.interface.tolist() == [[0]]
    assert stack([ply("strip")], scene_of(), Interface()).model.ply_contact is None


@pytest.mark.slow
def test_a_strip_is_folded_over_and_pressed_flat():
    """Its end is turned over to lie on its other half, and a plate comes down on both."""
    sim = turned_over()
    sim.advance_to(FOLDED)
    body = sim.model.bodies[0]
    x, _, z = sim.state.position
    along = body.mesh.node_positions[:, 0]
    upper = np.unique(body.mesh.elements[:, 4:])
    left = upper[along[upper] < -12e-3]
    right = upper[along[upper] > 12e-3]
    for node in right:  # the face of the turned half, which looks down now
        nearest = left[np.argmin(np.abs(x[left] - x[node]))]
        if abs(x[nearest] - x[node]) < 2e-3:
            assert z[node] - z[nearest] > -0.1e-3 * T
    energy = sim.energy()
    assert abs(energy["balance_error"]) < 5e-3 * energy["external"]


FOLDED = 0.2  # time of the fold [s]
HIGH, LOW = 60.0, 3.5  # of the plate above the lower one, at first and in the end [mm]


def turned_over() -> Simulation:
    """A strip whose right end goes over to the left by half a turn, and a plate that follows."""
    sheet = ply("strip", width=80.0, height=15.0, edge=2.5)
    X = sheet.mesh.node_positions
    ends = [np.flatnonzero(np.abs(X[:, 0] - x) < 1e-9) for x in (X[:, 0].min(), X[:, 0].max())]
    pivot = np.array([0.0, 0.0, 8e-3])

    def smooth(part):
        part = min(max(part, 0.0), 1.0)
        return part * part * (3.0 - 2.0 * part)

    def turn(time):
        part = smooth(time / (0.6 * FOLDED))
        c, s = np.cos(np.pi * part), np.sin(np.pi * part)
        turned = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        way = pivot - turned @ pivot + [4e-3 * part, 0.0, 0.0]
        way[2] -= (2.0 * pivot[2] - 1e-3 * T) * smooth((time / FOLDED - 0.6) / 0.3)
        return np.column_stack([turned, way])

    scene = scene_of(
        time=1e3 * FOLDED, damping=200.0, bottom=-0.5 * T, top=HIGH - 0.5 * T,
        times=f"0 {620 * FOLDED} {930 * FOLDED} {1e3 * FOLDED} ms",
        way=f"0 0 {HIGH - LOW} {HIGH - LOW} mm",
    )  # fmt: skip
    return stack(
        [sheet],
        scene,
        Interface(friction=0.2, itself=True),
        supports=[Support("left", ends[0]), Support("right", ends[1], "xyz", turn)],
    )
