"""From the words of a scene to nodes, cells and edges of the mesh."""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mesh.places import Places, Where

from .conftest import strip

KEY = 'gates[0] "g"'


@pytest.fixture
def places():
    """A strip of 6 by 3 cells of 50 by 20 mm, whose cell in the middle is missing, with sets."""
    points, quads = strip(6, 3)
    cells = np.delete(quads, 7, axis=0)
    triangles = np.array([[*cells[0, :3], -1], [cells[0, 0], *cells[0, 2:], -1]])
    cells = np.concatenate([cells[1:], triangles])
    sets = {"END": np.array([0, 1, 2, 3]), "FAR": np.array([], dtype=int)}
    ids = 100 + np.arange(len(points))
    return Places(points, cells, sets, {"TWO": np.array([0, 1])}, ids, 500 + np.arange(len(cells)))


def test_nodes_of_every_way(places):
    assert places.nodes(Where(set="END"), KEY).tolist() == [0, 1, 2, 3]
    assert set(places.nodes(Where(set="TWO"), KEY)) == set(places.cells[:2].ravel())
    assert places.nodes(Where(point=(0.051, 0.019, 0.001)), KEY).tolist() == [5]
    assert places.nodes(Where(point=(0.05, 0.02, 0.0), radius=0.021), KEY).tolist() == [4, 5, 6]
    box = Where(box=((0.05, 0.0, -1.0), (0.1, 0.02, 1.0)))
    assert places.nodes(box, KEY).tolist() == [4, 5, 8, 9]
    assert places.nodes(Where(box=tuple(reversed(box.box))), KEY).tolist() == [4, 5, 8, 9]


def test_the_rim_is_the_outer_boundary_and_a_loop_is_the_one_at_a_point(places):
    outer = places.nodes(Where(rim=True), KEY)
    on_the_rim = np.isin(places.points[:, 0], [0.0, 0.3]) | np.isin(
        places.points[:, 1], [0.0, 0.06]
    )
    assert outer.tolist() == np.flatnonzero(on_the_rim).tolist()
    hole = places.nodes(Where(loop=(0.125, 0.02, 0.0)), KEY)
    assert hole.tolist() == [9, 10, 13, 14]
    edges = places.edges(Where(loop=(0.125, 0.02, 0.0)), KEY)
    assert len(edges) == 4 and set(map(tuple, edges)) == {(9, 10), (9, 13), (10, 14), (13, 14)}


def test_boundaries_are_numbered_from_the_longest_on(places):
    assert (
        places.nodes(Where(boundary=1), KEY).tolist() == places.nodes(Where(rim=True), KEY).tolist()
    )
    assert places.nodes(Where(boundary=2), KEY).tolist() == [9, 10, 13, 14]
    with pytest.raises(
        InputError, match=r"boundary: is 3, but the mesh has 2 closed boundaries: 1 "
    ):
        places.nodes(Where(boundary=3), KEY)


def test_a_radius_smaller_than_the_cells_takes_the_nearest_node(places):
    assert places.nodes(Where(point=(0.051, 0.0, 0.0), radius=1e-4), KEY).tolist() == [4]


def test_cells_of_sets_boxes_and_radii(places):
    assert places.cells_of(Where(set="TWO"), KEY).tolist() == [0, 1]
    box = Where(box=((0.0, 0.0, 0.0), (0.05, 0.02, 0.0)))
    triangles = [len(places.cells) - 2, len(places.cells) - 1]
    assert places.cells_of(box, KEY).tolist() == triangles
    near = places.cells_of(Where(point=(0.275, 0.05, 0.0), radius=1e-3), KEY)
    assert np.allclose(places.centroids[near], [[0.275, 0.05, 0.0]])
    with pytest.raises(InputError, match="has no whole cell"):
        places.cells_of(Where(set="END"), KEY)


def test_edges_have_both_ends_in_the_place(places):
    assert places.edges(Where(set="END"), KEY).tolist() == [[0, 1], [1, 2], [2, 3]]
    with pytest.raises(InputError, match="no edge of the mesh has both its ends"):
        places.edges(Where(point=(0.0, 0.0, 0.0)), KEY)


def test_loops_do_not_depend_on_the_numbering_nor_on_the_orientation(places):
    rng = np.random.default_rng(3)
    order = rng.permutation(len(places.points))
    back = np.argsort(order)
    cells = np.where(places.cells >= 0, back[places.cells], -1)[rng.permutation(len(places.cells))]
    flipped = cells.copy()
    flipped[::2] = np.where(cells[::2, 3:] < 0, cells[::2][:, [2, 1, 0, 3]], cells[::2, ::-1])
    other = Places(places.points[order], flipped, {}, {})
    for where in (Where(rim=True), Where(loop=(0.125, 0.02, 0.0))):
        assert set(order[other.nodes(where, KEY)]) == set(places.nodes(where, KEY))


WRONG = {
    "point off the mesh": (
        Where(point=(0.0, 0.0, -0.2)),
        r"\(0.0, 0.0, -200.0\) mm lies outside the mesh: the nearest is node 100 at "
        r"\(0.0, 0.0, 0.0\) mm, 200 mm away",
    ),
    "radius off the mesh": (Where(point=(0.0, 0.0, -0.2), radius=0.1), "outside the mesh"),
    "unknown set": (Where(set="ENDE"), 'no set "ENDE"; did you mean "END"'),
    "quite another name": (Where(set="inlet"), "there is END, FAR, TWO"),
    "empty set": (Where(set="FAR"), 'the set "FAR" has no node of a cell'),
    "box beside": (
        Where(box=((0.31, 0.0, 0.0), (0.4, 0.1, 0.1))),
        r"nearest lies at \(300.0, 0.0, 0.0\) mm, 10 mm outside",
    ),
    "no boundary there": (Where(loop=(0.15, 0.03, 0.5)), "no boundary passes within one edge"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_places_are_named_with_the_nearest(places, name):
    where, message = WRONG[name]
    with pytest.raises(InputError, match=message) as caught:
        places.nodes(where, KEY)
    assert caught.value.key.startswith(KEY)


def test_a_closed_mesh_has_no_rim():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    cells = np.array([[0, 1, 2, -1], [0, 1, 3, -1], [1, 2, 3, -1], [0, 2, 3, -1]])
    with pytest.raises(InputError, match="the mesh is closed"):
        Places(corners, cells, {}, {}).nodes(Where(rim=True), KEY)


def test_a_mesh_without_sets_says_so(places):
    with pytest.raises(InputError, match="it has no sets: name a point"):
        Places(places.points, places.cells, {}, {}).nodes(Where(set="A"), KEY)
