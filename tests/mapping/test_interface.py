"""Patches of cells and the fields between them: connected, compact, conserving both ways."""

import numpy as np
import pytest
import xarray as xr
import xugrid
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.errors import InputError
from lcmchain.mapping.interface import Interface, Patches, group_cells, read_interface, shared_edges


def plate(columns, rows, *, triangles=0.0, seed=0):
    """Cells of 1 m, a share of them halved to triangles, in an order that means nothing."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    quads = first[:, None] + np.array([0, 1, columns + 2, columns + 1])
    chance = np.random.default_rng(seed)
    cut = chance.random(len(quads)) < triangles
    none = np.full(cut.sum(), -1)
    halves = [np.column_stack([quads[cut][:, k], none]) for k in ([0, 1, 2], [0, 2, 3])]
    cells = np.vstack([quads[~cut], *halves])
    cells = cells[chance.permutation(len(cells))]
    turned = chance.random(len(cells)) < 0.5  # either sense
    three = cells[:, 3] < 0
    cells[turned & ~three] = cells[turned & ~three][:, ::-1]
    cells[turned & three, :3] = cells[turned & three, :3][:, ::-1]
    return points, cells


def rolled(points, radius=0.7):
    """The plate wound up along x: layers lie closer to each other than patches are wide."""
    turn = points[:, 0] / radius / 4.0
    r = radius + 0.12 * turn
    return np.stack([r * np.cos(turn), points[:, 1], r * np.sin(turn)], axis=1)


def piece_counts(cells, patches, part=None):
    """In how many pieces each patch lies."""
    one, other = shared_edges(cells, part)
    inside = patches.of_cell[one] == patches.of_cell[other]
    size = len(cells)
    pairs = coo_matrix((np.ones(inside.sum()), (one[inside], other[inside])), (size, size))
    labels = connected_components(pairs, directed=False)[1]
    return [len(set(labels[patches.of_cell == p])) for p in range(patches.count)]


def grouped(points, cells, count, **options):
    return group_cells(
        points, cells, count, areas=Interface.of_mesh(points, cells).surface.areas, **options
    )


# --- patches --------------------------------------------------------------------------------------

meshes = st.builds(
    plate,
    st.integers(1, 14),
    st.integers(1, 14),
    triangles=st.floats(0.0, 1.0),
    seed=st.integers(0),
)


@settings(deadline=None, max_examples=60)
@given(mesh=meshes, count=st.integers(1, 60), shape=st.sampled_from(["flat", "rolled"]))
def test_every_patch_is_one_piece_and_none_is_empty(mesh, count, shape):
    points, cells = mesh
    points = points if shape == "flat" else rolled(points)
    patches = grouped(points, cells, count)
    assert patches.count == min(count, len(cells))
    assert np.bincount(patches.of_cell, minlength=patches.count).min() >= 1
    assert set(piece_counts(cells, patches)) == {1}
    firsts = np.unique(patches.of_cell, return_index=True)[1]
    assert (np.diff(firsts) > 0).all(), "numbered by their first cell"
    again = grouped(points, cells, count)
    np.testing.assert_array_equal(patches.of_cell, again.of_cell)


def test_patches_are_compact_and_of_similar_area():
    """Second moments within 15 % of those of squares, areas within 45 % of the mean."""
    points, cells = plate(60, 60)
    interface = Interface.of_mesh(points, cells, 150)
    area = interface.fields.patch_areas
    assert 0.55 * area.mean() < area.min() and area.max() < 1.45 * area.mean()
    middles = interface.fields.patch_centres[interface.patches.of_cell]
    centres = points[cells].mean(axis=1)
    moment = ((centres - middles) ** 2).sum() + len(cells) / 6.0  # of the cells themselves
    assert moment < 1.15 * (area**2).sum() / 6.0


def test_layers_of_a_roll_do_not_mix():
    points, cells = plate(60, 6)
    wound = rolled(points)
    patches = grouped(wound, cells, 60)
    widths = [np.ptp(points[cells[patches.of_cell == p]][..., 0]) for p in range(60)]
    assert max(widths) < 10.0 and np.median(widths) < 5.0, (
        "a patch goes along the sheet, not through the air"
    )


def test_plies_and_loose_pieces_have_patches_of_their_own():
    points, cells = plate(8, 8)
    stack = np.vstack([points, points + [0.0, 0.0, 1e-3], points + [20.0, 0.0, 0.0]])
    three = np.vstack([cells, cells + len(points), cells + 2 * len(points)])
    patches = grouped(stack, three, 12)
    of_piece = [set(patches.of_cell[k * len(cells) : (k + 1) * len(cells)]) for k in range(3)]
    assert [len(numbers) for numbers in of_piece] == [4, 4, 4]
    assert set.union(*of_piece) == set(range(12))
    with pytest.raises(InputError, match="3 loose pieces"):
        grouped(stack, three, 2)
    # labels part a sheet that is in one piece
    part = (points[cells].mean(axis=1)[:, 0] > 4.0).astype(int) + 7
    halves = grouped(points, cells, 6, part=part)
    for p in range(6):
        assert len(set(part[halves.of_cell == p])) == 1
    assert set(piece_counts(cells, halves, part)) == {1}


def test_small_pieces_get_one_patch_and_large_ones_by_area():
    points, cells = plate(10, 10)
    small = points * 0.01 + [30.0, 0.0, 0.0]
    patches = grouped(np.vstack([points, small]), np.vstack([cells, cells + len(points)]), 21)
    assert len(set(patches.of_cell[: len(cells)])) == 20


def test_a_rigid_motion_and_other_node_numbers_change_nothing():
    points, cells = plate(30, 20, triangles=0.3)
    points += np.random.default_rng(2).uniform(-0.1, 0.1, points.shape)  # no two distances equal
    patches = grouped(points, cells, 40)
    moved = points[:, [1, 2, 0]] + [100.0, -20.0, 3.0]
    np.testing.assert_array_equal(grouped(moved, cells, 40).of_cell, patches.of_cell)
    order = np.random.default_rng(1).permutation(len(points))
    place = np.argsort(order)
    renumbered = np.where(cells >= 0, place[cells], -1)
    np.testing.assert_array_equal(grouped(points[order], renumbered, 40).of_cell, patches.of_cell)


def test_wrong_counts_are_refused():
    points, cells = plate(3, 3)
    with pytest.raises(InputError, match="at least one"):
        Interface.of_mesh(points, cells, -1)
    with pytest.raises(InputError, match="none of them empty"):
        Patches(np.array([0, 2, 2]), 3)


# --- fields ---------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=60)
@given(mesh=meshes, count=st.integers(1, 60), seed=st.integers(0), constant=st.floats(-1e9, 1e9))
def test_sums_and_constants_stay_both_ways(mesh, count, seed, constant):
    points, cells = mesh
    fields = Interface.of_mesh(rolled(points), cells, min(count, len(cells))).fields
    chance = np.random.default_rng(seed)
    weights = chance.uniform(0.5, 2.0, len(cells))
    values = chance.normal(size=len(cells))
    scale = 1e-13 * np.abs(values).sum()
    # extensive, up and down
    totals = fields.total(values)
    assert abs(totals.sum() - values.sum()) < scale
    for given_weights in (None, weights):
        shared = fields.shared(totals, given_weights)
        np.testing.assert_allclose(fields.total(shared), totals, rtol=0, atol=scale)
        # intensive, up and down
        means = fields.mean(values, given_weights)
        w = fields.areas if given_weights is None else given_weights
        assert abs((means * fields.total(w)).sum() - (values * w).sum()) < 2.0 * scale
        same = fields.mean(np.full(len(cells), constant), given_weights)
        assert (same == constant).all()
    means = fields.mean(values)
    np.testing.assert_array_equal(fields.mean(fields.constant(means)), means)
    for limited in (True, False):
        spread = fields.linear(means, limited=limited)
        np.testing.assert_allclose(fields.mean(spread), means, rtol=0, atol=scale)
        everywhere = fields.linear(np.full(fields.patches.count, constant), limited=limited)
        np.testing.assert_allclose(everywhere, constant, rtol=1e-12)
    if fields.patches.count > 1:
        spread = fields.linear(means)
        assert means.min() - scale <= spread.min() and spread.max() <= means.max() + scale


def test_pressure_down_and_rate_up_do_the_same_work():
    points, cells = plate(12, 9)
    fields = Interface.of_mesh(points, cells, 10).fields
    chance = np.random.default_rng(3)
    pressure, rate = chance.normal(size=10), chance.normal(size=len(cells))
    work = pressure @ fields.total(rate)
    assert work == pytest.approx(fields.constant(pressure) @ rate, rel=1e-12)


def test_linear_fields_come_back_exactly_and_smooth_ones_at_second_order():
    points, cells = plate(40, 40, triangles=0.2)
    points = points / 40.0
    centres = np.array([points[c[c >= 0]].mean(axis=0) for c in cells])
    fields = Interface.of_mesh(points, cells, 60).fields
    linear = 3.0 + centres @ [2.0, -5.0, 1.0]
    np.testing.assert_allclose(
        fields.linear(fields.mean(linear), limited=False), linear, atol=1e-12
    )
    # limited: exact inside, where the patches around reach as far as the cells
    kept = np.isclose(fields.linear(fields.mean(linear)), linear, atol=1e-12)
    inside = (np.abs(centres[:, :2] - 0.5) < 0.25).all(axis=1)
    assert kept[inside].all()

    def error(count, down):
        fields = Interface.of_mesh(points, cells, count).fields
        smooth = np.sin(3.0 * centres[:, 0]) * np.cos(2.0 * centres[:, 1])
        return np.sqrt(np.mean((down(fields, fields.mean(smooth)) - smooth) ** 2))

    def rate(down):
        return np.log2(error(25, down) / error(400, down)) / 2.0

    assert rate(lambda f, v: f.constant(v)) == pytest.approx(1.0, abs=0.2)
    assert rate(lambda f, v: f.linear(v, limited=False)) > 1.8


# --- the file -------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [0, 9])
def test_interface_comes_back_from_its_file(tmp_path, count):
    points, cells = plate(7, 6, triangles=0.3)
    part = (np.arange(len(cells)) % 2) if count == 0 else None
    interface = Interface.of_mesh(rolled(points), cells, count, part=part)
    assert interface.size == (count or len(cells)) and interface.is_coarse is bool(count)
    path = tmp_path / "interface.nc"
    interface.write(path, {"title": "Part"})
    again = read_interface(path)
    np.testing.assert_array_equal(again.points, interface.points)
    np.testing.assert_array_equal(again.cells, interface.cells)
    np.testing.assert_array_equal(again.patches.of_cell, interface.patches.of_cell)
    values = np.random.default_rng(0).normal(size=interface.size)
    np.testing.assert_array_equal(again.fields.linear(values), interface.fields.linear(values))
    if count == 0:
        np.testing.assert_array_equal(again.part, part)
    with xr.open_dataset(path) as dataset:
        grid = xugrid.UgridDataset(dataset)
        assert grid.ugrid.grid.n_face == len(cells)
        assert dataset.attrs["title"] == "Part"
        found = np.bincount(dataset["interface_patch"], interface.surface.areas)
        np.testing.assert_allclose(dataset["interface_patch_area"], found, rtol=1e-14)


def test_file_of_something_else_is_refused(tmp_path):
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(InputError, match="no interface"):
        read_interface(tmp_path / "other.nc")
