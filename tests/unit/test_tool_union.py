"""Solids of a file that overlap or touch are united on request: the outer surface remains."""

import sys
import warnings

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.tools import ToolWarning, build_tool_table, gaps
from lcmchain.tools.shapes import SurfaceMesh
from lcmchain.tools.surfaces.reading import read_surface
from lcmchain.tools.tool import Tool


@pytest.fixture(autouse=True, scope="module")
def _library():
    pytest.importorskip("manifold3d")


def box(size, centre=(0.0, 0.0, 0.0)):
    """Closed box with outward normals."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return (corners - 0.5) * size + centre, np.array(triangles)


def ball(radius, steps=16):
    """Closed faceted ball, the same on both sides of the planes of its axes."""
    up = np.linspace(0.0, np.pi, steps + 1)[1:-1]
    around = np.linspace(0.0, 2.0 * np.pi, 2 * steps, endpoint=False)
    ring = np.stack([np.outer(np.sin(up), np.cos(around)), np.outer(np.sin(up), np.sin(around)),
                     np.outer(np.cos(up), np.ones(len(around)))], axis=2)  # fmt: skip
    points = radius * np.concatenate([ring.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    number = np.arange(len(up) * len(around)).reshape(len(up), len(around))
    after = np.roll(number, -1, axis=1)
    a, b, c, d = (n.ravel() for n in (number[:-1], number[1:], after[1:], after[:-1]))
    top, bottom = np.full(len(around), number.size), np.full(len(around), number.size + 1)
    triangles = np.concatenate([
        np.stack([a, b, c], 1), np.stack([a, c, d], 1),
        np.stack([top, number[0], after[0]], 1), np.stack([bottom, after[-1], number[-1]], 1),
    ])  # fmt: skip
    return points, triangles


def written(path, *meshes):
    """STL file of solids, each with vertices of its own."""
    starts = np.cumsum([0, *(len(points) for points, _ in meshes)])
    triangles = np.concatenate([own + start for (_, own), start in zip(meshes, starts)])
    points = np.concatenate([points for points, _ in meshes])
    meshio.Mesh(points, [("triangle", triangles)]).write(path.with_suffix(".ply"), binary=True)
    return path.with_suffix(".ply")


def read(path, union=True):
    """Surface of a file, in which nothing is told."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", ToolWarning)
        return read_surface(path, "m", union=union)


def volume(surface):
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    return float(np.einsum("ti,ti->", a, np.cross(b, c))) / 6.0


def outside_of_box(points, size, centre):
    """Distance of points to a box, negative inside."""
    away = np.abs(np.asarray(points) - centre) - 0.5 * np.asarray(size)
    return np.linalg.norm(np.maximum(away, 0.0), axis=1) + np.minimum(away.max(axis=1), 0.0)


BASE = (0.06, 0.05, 0.03)
BOSS = (0.02, 0.02, 0.02)


@pytest.mark.parametrize(
    ("centre", "common"),
    [((0.0, 0.0, 0.01), 0.02 * 0.02 * 0.015), ((0.03, 0.02, 0.01), 0.01 * 0.015 * 0.015),
     ((0.0, 0.0, 0.025), 0.0), ((0.02, 0.015, 0.025), 0.0)],
    ids=["sunk", "over a corner", "touching", "touching at an edge of the base"],
)  # fmt: skip
def test_the_union_is_as_large_as_both_without_what_they_share(tmp_path, centre, common):
    path = written(tmp_path / "die", box(BASE), box(BOSS, centre))
    surface = read(path)
    assert volume(surface) == pytest.approx(np.prod(BASE) + np.prod(BOSS) - common, rel=1e-9)
    assert (surface.edge_use == 2).all() and surface.orientation.united == 2
    middles = surface.points[surface.triangles].mean(axis=1)
    for size, at in ((BASE, (0, 0, 0)), (BOSS, centre)):  # nothing is left inside a solid
        assert outside_of_box(middles, size, at).min() > -1e-9
    np.testing.assert_array_equal(read(path).points, surface.points)
    np.testing.assert_array_equal(read(path).triangles, surface.triangles)


def test_contact_sees_the_outer_surface_alone(tmp_path):
    centre = np.array([0.0, 0.0, 0.01])
    path = written(tmp_path / "die", box(BASE), box(BOSS, centre))
    around = np.random.default_rng(0).uniform(-0.004, 0.004, (4000, 3))
    where = around + [[0.01, 0.0, 0.015]]  # about the edge where the boss leaves the base
    tables = []
    for union in (True, False):
        shape = SurfaceMesh.model_construct(
            type="surface_mesh", file=path.name, length_unit="m", spacing=0.0005, union=union
        )
        tool = Tool.model_construct(
            name="die", shape=shape, position=(0.0, 0.0, 0.0), friction=None
        )
        if union:
            tables.append(build_tool_table([tool], tmp_path, 0.1))
        else:
            with pytest.raises(InputError, match="write union = true in the tool's shape"):
                build_tool_table([tool], tmp_path, 0.1)
    found = gaps(tables[0], 0, where, 0.0)
    both = [outside_of_box(where, *solid) for solid in ((BASE, (0, 0, 0)), (BOSS, centre))]
    exact = np.minimum(*both)
    # beyond 1.2 mm the field is a bound; half way between both it is rounded over a spacing
    near = (exact > 0.0) & (exact < 0.0012) & (np.abs(both[0] - both[1]) > 0.001)
    assert near.sum() > 300
    np.testing.assert_allclose(found[near], exact[near], atol=2e-5)
    deep = exact < -0.001
    assert deep.sum() > 500 and (found[deep] < -0.0009).all()


def test_half_a_ball_sticks_out_of_a_box(tmp_path):
    points, triangles = ball(0.02)
    whole = written(tmp_path / "ball", (points, triangles))
    half = 0.5 * volume(read(whole, union=False))
    path = written(tmp_path / "both", (points, triangles), box((0.08, 0.1, 0.1), (0.04, 0, 0)))
    assert volume(read(path)) == pytest.approx(half + 0.08 * 0.1 * 0.1, rel=1e-9)


def test_a_cavity_stays_where_no_other_solid_fills_it(tmp_path):
    hollow = box((0.06, 0.06, 0.06)), (box((0.04, 0.02, 0.02))[0], box(1.0)[1][:, ::-1])
    plug = box((0.05, 0.01, 0.01), (0.025, 0.0, 0.0))  # ends in the middle of the cavity
    surface = read(written(tmp_path / "die", *hollow, plug))
    left = 0.06**3 - 0.04 * 0.02**2
    assert volume(surface) == pytest.approx(left + (0.02 + 0.02) * 0.01**2, rel=1e-9)
    assert surface.orientation.united == 2


def test_solids_apart_and_a_single_one_stay_as_they_are(tmp_path):
    one = written(tmp_path / "one", box(BASE))
    np.testing.assert_array_equal(read(one).triangles, read(one, union=False).triangles)
    np.testing.assert_array_equal(read(one).points, read(one, union=False).points)
    apart = read(written(tmp_path / "two", box(BASE), box(BOSS, (0.0, 0.0, 0.1))))
    assert volume(apart) == pytest.approx(np.prod(BASE) + np.prod(BOSS), rel=1e-9)


@pytest.mark.filterwarnings("ignore::lcmchain.tools.ToolWarning")
def test_what_cannot_be_united_is_told(tmp_path, monkeypatch):
    points, triangles = box(BASE)
    path = written(tmp_path / "open", (points, triangles[1:]), box(BOSS, (0.0, 0.0, 0.01)))
    with pytest.raises(InputError, match="1 of 2 parts are open, the first near"):
        read_surface(path, "m", union=True)
    path = written(tmp_path / "mould", (box((0.3, 0.3, 0.3))[0], triangles[:, ::-1]))
    with pytest.raises(InputError, match="is hollow: a mould in which the blank lies"):
        read_surface(path, "m", 0.1 * (np.eye(3) - 0.3), union=True)
    monkeypatch.setitem(sys.modules, "manifold3d", None)
    with pytest.raises(InputError, match=r'needs manifold3d: pip install "lcmchain\[union\]"'):
        read_surface(path, "m", union=True)
