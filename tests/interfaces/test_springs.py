"""Springs of points on facets: potential, momentum, smooth surface, shares, lists."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from stacks import MU, T, of_points, ply, scene_of, stack

from lcmchain.compilation.references import Reference
from lcmchain.elements.blocks import SPAN
from lcmchain.interfaces import forces
from lcmchain.interfaces.forces import add_ply_forces, forces_of_points, list_points
from lcmchain.interfaces.refresh import refresh, renew_slopes
from lcmchain.interfaces.rims import share_over
from lcmchain.interfaces.rows import AREA, FORCE, HELD, REACH, SHARE, WAY
from lcmchain.interfaces.springs import project, spring_at
from lcmchain.interfaces.table import Interface

DEPTH = 20e-6  # of one ply in the other [m]


@pytest.fixture(scope="module")
def sim():
    """Two plies with cut rims, one shifted over the other and pressed on: shares of all kinds."""
    plies = [
        ply("a", width=30.0, height=15.0, z=0.5 * T),
        ply("b", shift=(3.3, 0.7, 0.0), width=30.0, height=15.0, z=1.5 * T, angle=30.0, edge=4.0),
    ]
    sim = stack(plies, scene_of())
    renew(sim)
    sim.state.position[2, sim.model.bodies[1].first_node :] -= DEPTH
    renew(sim)
    return sim


def renew(sim, steps=0):
    """Renew the springs of plies at rest after some steps; return what that puts in [J]."""
    sim.arrays.ply_counters[forces.LAST_STEPS] = steps
    return refresh(*sim.model.ply_contact, sim.arrays, 0.0, 1e-6)


def forces_at(sim, position):
    """Forces of the frozen springs on all nodes (3, node_count) [N], and their energy [J]."""
    plies, arrays = Reference(sim.model.ply_contact), sim.arrays
    kept, springs = arrays.position.copy(), arrays.ply_rows.copy()
    arrays.position[:] = position
    list_points(plies.data, arrays)
    forces_of_points(plies, arrays, 0.0)
    arrays.force[:] = 0.0
    stored = 0.0
    for chunk, (first, last) in enumerate(pairwise(arrays.chunk_start.tolist())):
        stored += add_ply_forces(plies, arrays, chunk, first, last)[0]
    arrays.position[:] = kept
    arrays.ply_rows[:] = springs
    return arrays.force.copy(), stored


def test_forces_are_the_slope_of_the_energy(sim):
    """Also those by which the share at a rim changes."""
    position = sim.state.position
    shares = of_points(sim, SHARE)[sim.state.ply_facet >= 0]
    assert (shares != 1.0).sum() > 10
    force, _ = forces_at(sim, position)
    rng = np.random.default_rng(0)
    for _ in range(3):
        way = rng.normal(size=position.shape) * 1e-9
        slope = forces_at(sim, position + way)[1] - forces_at(sim, position - way)[1]
        assert -0.5 * slope == pytest.approx(np.sum(force * way), rel=1e-5)


def test_forces_have_no_sum_and_no_moment(sim):
    """The moment up to what a point has slid since its spring was made."""
    force, _ = forces_at(sim, sim.state.position)
    size = np.abs(force).sum()
    assert size > 1.0
    assert np.abs(force.sum(axis=1)).max() < 1e-12 * size
    moment = np.cross(sim.state.position.T, force.T).sum(axis=0)
    assert np.abs(moment).max() < 1e-2 * size * 1e-3 * T


def test_the_surface_is_smooth_and_exact_for_a_parabola():
    """z = x²/2R between facets of 5 mm: the sagitta of a facet is 78 µm, what is left below 2."""
    radius = 0.04
    sheet = ply("a", width=30.0, height=15.0)
    sim = stack([sheet, ply("b", z=50.0)], scene_of())
    data, arrays = sim.model.ply_contact.data, sim.arrays
    count = sheet.mesh.node_count
    x = arrays.position[0, :count]
    arrays.position[2, :count] += x**2 / (2.0 * radius)
    renew_slopes(data, arrays, 1.0)
    for place in np.linspace(-0.0145, 0.0145, 30):
        # a point over the upper face, beside the middle line
        point = (place, 1e-3, place**2 / (2.0 * radius) + 0.5e-3 * T)
        upper = np.flatnonzero(data.facet_ply == 0)[sheet.mesh.element_count :]
        corner = arrays.position[:2, data.facet_node[upper]]
        near = (np.abs(corner.mean(axis=2) - np.array(point[:2])[:, None]) <= 2.5e-3).all(axis=0)
        facet = upper[np.flatnonzero(near)[0]]
        xi, eta = project(
            arrays.position, data.facet_node, arrays.ply_slope, facet, 0.0, 0.0, point
        )
        _, normal, _, gap = spring_at(
            arrays.position, data.facet_node, arrays.ply_slope, facet, xi, eta, point
        )
        assert abs(gap) < 2e-6
        slope = -normal[0] / normal[2]
        assert slope == pytest.approx(place / radius, abs=2e-3)


def test_the_share_of_a_rim_point_is_that_of_its_area():
    """The upper ply stands over by a part of an edge: what lies outside does not count."""
    step = 5.0
    for part, wanted in [(0.0, 1.0), (0.1, 0.8), (0.25, 0.5), (0.5, 0.0)]:
        plies = [ply("a", z=0.5 * T), ply("b", shift=(part * step, 0.0, 0.0), z=1.5 * T)]
        sim = stack(plies, scene_of())
        data, position = sim.model.ply_contact.data, sim.state.position
        first = sim.model.bodies[1].first_node
        place = plies[1].mesh.node_positions
        here = (place[:, 0] > place[:, 0].max() - 1e-9) & (place[:, 2] < 1.1e-3 * T)
        point = first + np.flatnonzero(here & (np.abs(place[:, 1]) < 1e-6))[0]
        nodes = data.facet_node
        over = (position[2, nodes] > 0.9e-3 * T).all(axis=1) & (data.facet_ply == 0)
        corner = position[:2, nodes].mean(axis=2)
        at_rim = over & (corner[0] > 7e-3) & (corner[1] > 0.0) & (corner[1] < 5e-3)
        share, slope = share_over(position, data, point, np.flatnonzero(at_rim)[0])
        assert share == pytest.approx(wanted, abs=1e-9)
        if 0.0 < wanted < 1.0:
            assert slope == pytest.approx((-2.0 / (1e-3 * step), 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_shares_add_up_to_the_area_that_lies_over_the_other_ply(angle):
    """Of a ply whose mesh follows other angles, with elements of unlike size at its own rims."""
    plies = [
        ply("a", width=50.0, height=24.0, edge=4.0, angle=angle, z=0.5 * T),
        ply("b", shift=(-6.1, 1.3, 0.0), width=16.0, height=12.0, edge=4.0, z=1.5 * T),
    ]
    sim = stack(plies, scene_of())
    renew(sim)
    covered = of_points(sim, AREA) * of_points(sim, SHARE)
    lower = (sim.model.ply_contact.data.ply == 0) & (sim.state.ply_facet >= 0)
    assert covered[lower].sum() == pytest.approx(0.5e-6 * 16.0 * 12.0, rel=2e-2)


def test_points_stand_in_the_lists_of_the_chunks_that_they_press_on_in_order(sim):
    data, arrays = sim.model.ply_contact.data, sim.arrays
    list_points(data, arrays)
    facets = sim.state.ply_facet
    point = np.repeat(np.flatnonzero(facets >= 0), 4)
    node = data.facet_node[facets[facets >= 0]].ravel()
    for chunk, (first, last) in enumerate(pairwise(arrays.chunk_start.tolist())):
        on = (node >= first) & (node < last)
        runs = slice(*arrays.ply_run_start[chunk : chunk + 2])
        items = slice(*arrays.ply_run_item[[runs.start, runs.stop]])
        assert arrays.ply_node[items].tolist() == node[on].tolist()
        # one run for all that a point presses on in a chunk
        points, counts = np.unique(point[on], return_counts=True)
        assert arrays.ply_run_point[runs].tolist() == points.tolist()
        lengths = np.diff(arrays.ply_run_item[runs.start : runs.stop + 1])
        assert lengths.tolist() == counts.tolist()


def test_a_refresh_at_rest_changes_nothing(sim):
    """Made again where they are, springs have the same energy: half of ½ κ depth² A of each ply."""
    assert abs(renew(sim)) < 1e-12
    stored = forces_at(sim, sim.state.position)[1]
    penalty = sim.model.ply_contact.data.penalty[0]
    area = 1e-6 * (30.0 - 3.3) * (15.0 - 0.7)
    assert stored == pytest.approx(0.5 * penalty * DEPTH**2 * area, rel=2e-2)


def test_what_hangs_down_beyond_a_rim_is_let_go_and_what_is_over_the_ply_is_told(sim):
    """Both nodes lie 0.6 of a thickness below the other ply's face, one of them beside it."""
    state, counters = sim.state, sim.arrays.ply_counters
    position, first = state.position, sim.model.bodies[1].first_node
    upper = np.flatnonzero(state.ply_facet[first:] >= 0) + first
    outside = position[0, upper] > 15.5e-3  # the lower ply ends at 15 mm
    partly = of_points(sim, SHARE)[upper] > 0.05
    before = state.copy()
    for point, told in (
        (upper[outside & partly][0], False),
        (upper[np.abs(position[:2, upper]).max(axis=0) < 5e-3][0], True),
    ):
        position[2, point] -= 0.6e-3 * T
        renew(sim)
        assert (counters[forces.TOO_DEEP] == point + 1) == told
        assert (state.ply_facet[point] >= 0) == told
        state.set_to(before)


BED, SLED, COVER = 0, 1, 2


def three_plies(bed=0.55 * T):
    """A short ply between two longer ones, whose meshes do not match; ``bed`` is its height.

    The bed is found from above the short ply, a little less than a thickness off.
    """
    return stack(
        [
            ply("bed", width=40.0, height=30.0, edge=4.0, z=bed),
            ply("sled", width=16.0, height=12.0, edge=4.0, z=1.5 * T),
            ply("cover", width=25.0, height=19.0, edge=3.0, z=2.5 * T),
        ],
        scene_of(),
    )


def hanging_over(sim):
    """Points of the cover that hang beyond the short ply's rim, less far than their area."""
    position, first = sim.state.position, sim.model.bodies[COVER].first_node
    x, y = np.abs(position[:2, first:])
    low = position[2, first:] < 2.1e-3 * T
    reach = 0.5 * sim.model.ply_contact.data.spacing[first:] - 1e-6
    beyond = np.maximum(x - 8e-3, y - 6e-3)
    return first + np.flatnonzero(low & (beyond > 1e-6) & (beyond < reach))


def test_a_point_beyond_a_rim_faces_the_facet_that_it_hangs_beside():
    """Also where another facet of the uneven ply, drawn on beyond its own side, comes nearer."""
    sim = three_plies()
    state, data = sim.state, sim.model.ply_contact.data
    body = sim.model.bodies[SLED]
    own = slice(body.first_node, body.first_node + body.mesh.node_count)
    state.position[2, own] += 0.03e-3 * np.random.default_rng(1).normal(size=body.mesh.node_count)
    renew(sim)
    points = hanging_over(sim)
    points = points[np.abs(state.position[1, points]) < 6e-3]  # beyond the ends, not the sides
    assert len(points) == 6
    corner = state.position[1, data.facet_node[state.ply_facet[points]]]
    y = state.position[1, points]
    assert (corner.min(axis=1) <= y).all()
    assert (y <= corner.max(axis=1)).all()


def test_a_point_keeps_to_the_ply_beyond_whose_rim_it_hangs():
    """As long as a part of its area lies on it: another ply is a whole thickness below."""
    sim = three_plies()
    renew(sim)
    points = hanging_over(sim)
    assert len(points) > 10
    assert (sim.model.ply_contact.data.facet_ply[sim.state.ply_facet[points]] == SLED).all()


def test_depths_held_follow_those_on_the_same_ply_alone():
    """Points beside, which hang high over a further ply, do not count for the mean depth."""
    held = []
    for bed in (0.55 * T, -50.0):
        sim = three_plies(bed)
        renew(sim)
        sim.state.position[2, sim.model.bodies[COVER].first_node :] -= DEPTH
        for _ in range(3):
            renew(sim, steps=100)
        held.append(of_points(sim, HELD)[sim.model.bodies[COVER].first_node :])
    assert held[0].max() > 0.1 * DEPTH
    assert held[0] == pytest.approx(held[1], abs=1e-12)


def test_depths_go_to_zero_over_a_time_where_their_steps_would_be_too_few():
    """Plies that are heavy for their springs would vibrate: they are lifted as they are damped."""
    held, dt = [], 1e-6
    for times in (0.0, 4.0):
        sim = stack([ply("a", z=0.5 * T), ply("b", edge=4.0, z=1.5 * T)], scene_of())
        renew(sim)
        sim.state.position[2, sim.model.bodies[1].first_node :] -= DEPTH
        renew(sim)  # finds the depths
        data, laws = sim.model.ply_contact
        time = times * data.depth_steps * dt
        data = data._replace(depth_time=np.full_like(data.depth_time, time))
        sim.arrays.ply_counters[forces.LAST_STEPS] = 5
        refresh(data, laws, sim.arrays, 0.0, dt)
        held.append(of_points(sim, HELD))
    assert held[0].max() > 1e-3 * DEPTH
    np.testing.assert_allclose(held[1], 0.25 * held[0], rtol=1e-12)


def test_a_point_once_found_is_held_without_a_search():
    """Up to a thickness off, and a little further."""
    sim = stack([ply("a", z=0.5 * T), ply("b", edge=4.0, z=2.3 * T)], scene_of())
    renew(sim)
    found = sim.state.ply_facet.copy()
    assert (found >= 0).sum() > 40
    assert sim.arrays.ply_counters[forces.REFRESHES_LEFT] > 0
    renew(sim)
    assert (sim.state.ply_facet == found).all()


@pytest.fixture
def parted():
    """Two plies with friction, the upper one 1 µm over the lower one."""
    plies = [
        ply("a", width=30.0, height=15.0, z=0.5 * T),
        ply("b", width=30.0, height=15.0, z=1.5 * T + 1e-3, angle=30.0, edge=4.0),
    ]
    sim = stack(plies, scene_of(), Interface(friction=MU))
    renew(sim)
    return sim


def glide(sim, way, asked=False):
    """Move the upper ply on by a way [m] in one step; return the forces on points, and energies.

    asked : ask the laws of all points, also of those that rest.
    """
    plies, arrays, dt = Reference(sim.model.ply_contact), sim.arrays, 1e-6
    upper = slice(sim.model.bodies[1].first_node, None)
    arrays.velocity[:, upper] = np.reshape(way, (3, 1)) / dt
    arrays.position[:, upper] += np.reshape(way, (3, 1))
    if asked:
        arrays.ply_acts[:] = 1
    list_points(plies.data, arrays)
    forces_of_points(plies, arrays, dt)
    sums = arrays.ply_sums[:, [forces.STORED, forces.LOST, forces.DAMPED]].sum(axis=0)
    return np.stack([of_points(sim, FORCE + d) for d in range(3)]), sums


# it slides over the lower ply, comes down on it while it slides, goes on, and comes off
WAYS = [(3e-7, 0.0, 0.0)] * 3 + [(3e-9, 1e-9, -2e-6), (3e-9, 1e-9, 0.0), (0.0, 0.0, 2e-6)]
PRESSED = 3


def test_points_that_rested_have_the_slip_of_those_whose_laws_were_asked(parted):
    """It is that of one step, below friction: from an anchor of before they would slide."""
    start = parted.state.copy()
    asked = [glide(parted, way, asked=True) for way in WAYS]
    force = np.abs(asked[PRESSED][0]).sum(axis=1)
    assert 0.0 < force[0] < 0.1 * MU * force[2]
    assert asked[-1][1][1] > 0.0  # the elastic slip goes with the pressure
    parted.restore(start)
    for way, (points, sums) in zip(WAYS, asked, strict=True):
        found = glide(parted, way)
        np.testing.assert_allclose(found[0], points, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(found[1], sums, rtol=1e-6, atol=1e-18)


def test_spans_whose_points_are_apart_rest(parted):
    """After a renewal all are asked once; a point that comes down wakes its span alone."""
    data, arrays = parted.model.ply_contact.data, parted.arrays
    assert arrays.ply_acts.any()
    glide(parted, (0.0, 0.0, 0.0))
    assert not arrays.ply_acts.any()
    ways = of_points(parted, WAY)
    glide(parted, (1e-9, 0.0, 0.0))
    np.testing.assert_array_equal(of_points(parted, WAY), ways)
    lower_face = np.flatnonzero((data.ply == 1) & (parted.state.ply_facet >= 0))
    away = parted.state.position[:2, lower_face].T - (3.75e-3, 0.0)
    point = int(lower_face[np.argmin(np.linalg.norm(away, axis=1))])
    arrays.position[2, point] -= 1.2e-6
    (_, _, force), _ = glide(parted, (0.0, 0.0, 0.0))
    assert np.flatnonzero(arrays.ply_acts).tolist() == [data.lane[point] // SPAN]
    assert np.flatnonzero(arrays.ply_near).tolist() == [point]
    assert np.flatnonzero(force).tolist() == [point]


def test_a_point_whose_depth_is_held_always_acts(parted):
    """Apart, it has the energy of that depth until its spring is made anew."""
    parted.state.position[2, parted.model.bodies[1].first_node :] -= DEPTH
    renew(parted)
    renew(parted, steps=50)
    held = of_points(parted, HELD) > 0.0
    assert held.sum() > 50
    assert np.isinf(of_points(parted, REACH)[held]).all()
    assert (of_points(parted, REACH)[~held] == 0.0).all()


def test_points_are_found_over_curved_facets():
    """Between its corners the smooth surface lies 40 µm nearer than the facet."""
    plies = [
        ply("a", width=30.0, height=15.0),
        ply("b", z=1.99 * T, width=30.0, height=15.0, edge=4.0),
    ]
    sim = stack(plies, scene_of(), Interface(friction=MU))
    x, y, _ = sim.state.position.copy()
    sim.state.position[2] += x**2 / (2.0 * 0.04)
    renew(sim)
    data = sim.model.ply_contact.data
    upper_face = np.arange(x.size) > data.partner
    inside = (data.ply == 0) & upper_face & (np.abs(x) < 8e-3) & (np.abs(y) < 5e-3)
    assert inside.sum() > 4
    assert (sim.state.ply_facet[inside] >= 0).all()
