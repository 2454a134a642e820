"""Facets, neighbours, rims and laws of interfaces, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from stacks import T, ply, scene_of, stack

from lcmchain.errors import InputError
from lcmchain.interfaces.search import build_grid
from lcmchain.interfaces.surfaces import NONE
from lcmchain.interfaces.table import Interface
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

PAIR = [ply("a", z=0.5 * T), ply("b", z=1.5 * T, angle=30.0, edge=4.0)]


def test_a_ply_may_begin_where_another_one_ends():
    stack([PAIR[0], ply("b", shift=(20.0, 0.0, 0.0), z=0.5 * T)], scene_of())


def data_of(*interfaces):
    return stack(PAIR, scene_of(), *interfaces).model.ply_contact.data


@pytest.fixture(scope="module")
def data():
    return data_of()


@pytest.fixture(scope="module")
def position():
    return np.concatenate([sheet.mesh.node_positions for sheet in PAIR])


def test_facets_look_outwards_from_their_ply(data, position):
    corner = position[data.facet_node]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    outwards = corner[:, 0] - position[data.partner[data.facet_node[:, 0]]]
    assert (np.einsum("ij,ij->i", normal, outwards) > 0.0).all()


def test_neighbours_share_the_edge(data):
    nodes = data.facet_node
    assert any(nodes[:, 2] == nodes[:, 3])  # triangles at the cut edges
    for facet, edge in np.argwhere(data.neighbour != NONE):
        ends = {nodes[facet, edge], nodes[facet, (edge + 1) % 4]}
        other = data.neighbour[facet, edge]
        assert ends <= set(nodes[other])
        assert facet in data.neighbour[other]


def test_the_rim_runs_once_around_each_face(data, position):
    edges = np.unique(data.rim, axis=0)
    length = np.linalg.norm(position[edges[:, 1]] - position[edges[:, 0]], axis=1).sum()
    assert length == pytest.approx(4 * 4 * 20e-3, rel=1e-2)
    # the facet lies on the left, seen from outside: a rim turns once to the left
    assert sorted(np.unique(edges[:, 0])) == sorted(np.unique(edges[:, 1]))


CUT = """
title = "cut"
process = { time = "10 ms" }
layup = "[0/90, 0/90]"
[blank]
size = ["60 mm", "40 mm"]
edge_length = "5 mm"
MORE
[material]
preset = "MD600"
"""


@pytest.mark.parametrize(
    "cut", ['slits = [[["-30 mm", "0 mm"], ["10 mm", "0 mm"]]]', 'courses = { joints = ["0 mm"] }']
)
def test_beside_a_cut_a_facet_has_its_own_lip_and_not_the_one_that_lies_on_it(cut):
    """By the other lip, as near, a point over the facet would lie outside of the ply."""
    model = build_model(scene_from_text(CUT.replace("MORE", cut)))
    data, position = model.ply_contact.data, model.node_positions
    middle = position[data.facet_node].mean(axis=1)
    owner = {}
    for facet, edge in np.argwhere(data.neighbour == NONE):
        ends = data.facet_node[facet, [edge, (edge + 1) % 4]]
        owner[tuple(ends)] = facet
    facet = np.repeat(np.arange(len(middle)), np.diff(data.rim_start))
    side = np.array([middle[owner[tuple(ends)], 1] for ends in data.rim])
    x, y = position[data.rim].mean(axis=1)[:, :2].T
    on_cut = (np.abs(y) < 1e-9) & (x < 10e-3) & (np.abs(x) < 29e-3)
    assert (np.sign(side[on_cut]) == np.sign(middle[facet[on_cut], 1])).all()
    beside = np.flatnonzero((np.abs(middle[:, 1]) < 5e-3) & (middle[:, 0] < 5e-3))
    assert set(beside) <= set(facet[on_cut]) and len(beside) >= 4 * 2 * 7


def test_every_node_has_its_partner_on_the_other_face(data, position):
    assert (data.partner[data.partner] == np.arange(data.partner.size)).all()
    assert np.abs(position[data.partner] - position)[:, 2] == pytest.approx(1e-3 * T)


def test_the_law_named_last_holds():
    model = stack(
        PAIR, scene_of(), Interface(friction=0.1), Interface(between=("b", "a"), friction=0.3)
    ).model
    data, (law, *_) = model.ply_contact
    assert law.friction[data.interface[0, 1]] == law.friction[data.interface[1, 0]] == 0.3
    assert data.interface[0, 0] == data.interface[1, 1] == NONE


def test_both_plies_feel_each_other(data):
    assert data.interface[0, 1] == data.interface[1, 0] == 0


def test_the_automatic_stiffness_is_that_of_the_softer_ply():
    data = data_of()
    alone = [stack([sheet], scene_of()).model.environment.penalty for sheet in PAIR]
    assert data.penalty == pytest.approx([min(alone)])
    assert data_of(Interface(penalty="5 N/mm^3")).penalty == pytest.approx([5e9])


@pytest.mark.parametrize(
    ("between", "words"),
    [(("a", "c"), 'no ply "c"; the plies are a, b'), (("a", "a"), "cannot touch itself")],
)
def test_plies_that_cannot_touch_are_refused(between, words):
    with pytest.raises(InputError, match=words) as error:
        data_of(Interface(between=between))
    assert error.value.key == "interfaces[0].between"


def test_negative_friction_is_refused():
    with pytest.raises(ValidationError):
        Interface(friction=-0.1)


def test_plies_that_overlap_at_the_start_are_refused():
    deep = [PAIR[0], ply("b", z=0.9 * T)]
    with pytest.raises(InputError, match=r"plies a and b overlap by 0\.602 mm"):
        stack(deep, scene_of())


def test_places_that_are_no_numbers_leave_the_search_a_grid(data, position):
    """So that a guard can tell which node has been lost, and a run may go back."""
    slopes = np.zeros((data.facet_node.shape[0], 8))
    for lost in (np.nan, np.inf):
        places = np.ascontiguousarray(position.T)
        whole = build_grid(places, data, slopes)
        assert whole.entry.size >= data.facet_node.shape[0]
        for nodes in (3, slice(None)):
            places[:, nodes] = lost
            grid = build_grid(places, data, slopes)
            assert (grid.cells >= 1).all() and grid.start.size == grid.cells.prod() + 1
