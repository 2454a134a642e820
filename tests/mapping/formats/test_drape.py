"""A DRAPE table is read by a bulk data reader, and turns a side of the element into the fibre."""

import bulkdata
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import MappingOptions, map_file, read_target
from lcmchain.mapping.formats import export


def read_tables(path):
    """Rows (element, factor, angle) of each DRAPE entry by its number."""
    with path.open() as file:
        deck = bulkdata.Deck.load(file)
    tables = {}
    for card in deck:
        assert card.name == "DRAPE"
        fields = [field.value for field in card.fields]
        rows = [fields[first : first + 4] for first in range(8, len(fields), 8)]
        assert {row[0] for row in rows} == {"ELEM"}
        tables[fields[0]] = np.array([row[1:] for row in rows], dtype=float)
    return tables


@pytest.fixture(scope="module")
def written(bowl, tmp_path_factory):
    path = tmp_path_factory.mktemp("drape") / "bowl.drape.fem"
    report = export(bowl.dataset, bowl.target, "drape", path)
    return read_tables(path), report, path


def test_every_element_has_a_row_in_the_table_of_each_family(bowl, written):
    tables, report, _ = written
    assert list(tables) == [1, 2]
    for rows in tables.values():
        assert rows[:, 0].astype(int).tolist() == bowl.target.cell_ids.tolist()
    assert report.cells == bowl.target.cell_count


def test_thinning_gives_back_the_thickness(bowl, written):
    tables, report, _ = written
    both = 2.0 * report.details["ply_thickness_m"] * tables[1][:, 1]
    assert np.allclose(both, bowl.dataset["thickness"].values, rtol=1e-6, atol=0.0)
    assert np.array_equal(tables[1][:, 1], tables[2][:, 1])


@pytest.mark.parametrize("family", [1, 2])
def test_a_side_turned_by_the_angle_is_the_fibre(bowl, written, vectors, family):
    """The turn is done with a rotation matrix about the normal, as a solver does it."""
    tables, _, _ = written
    corners = bowl.target.points[bowl.target.corners[:, :3]]
    side = corners[:, 1] - corners[:, 0]
    normal = bowl.target.surface.normals
    side -= np.einsum("ci,ci->c", side, normal)[:, None] * normal
    side /= np.linalg.norm(side, axis=1)[:, None]
    angle = np.radians(tables[family][:, 2])
    x, y, z = normal.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    turn = (
        np.eye(3)
        + np.sin(angle)[:, None, None] * cross
        + (1.0 - np.cos(angle))[:, None, None] * (cross @ cross)
    )
    turned = np.einsum("cij,cj->ci", turn, side)
    fibre = vectors(bowl.dataset, f"fibre_direction_{family}")
    off = np.degrees(np.arccos(np.clip(np.abs(np.einsum("ci,ci->c", turned, fibre)), 0.0, 1.0)))
    assert off.max() < 1e-4
    assert np.ptp(np.degrees(angle)) > 60.0


def test_reversed_fibres_have_the_same_angles(bowl, written):
    """Fibres have no sense: with all of them reversed the table is the same."""
    tables, _, path = written
    dataset = bowl.dataset.copy(deep=True)
    for name in dataset.data_vars:
        if name.startswith("fibre_direction"):
            dataset[name].values *= -1.0
    reversed_path = path.with_name("reversed.drape.fem")
    export(dataset, bowl.target, "drape", reversed_path)
    again = read_tables(reversed_path)
    for number, rows in tables.items():
        assert np.allclose(again[number], rows, atol=1e-4)


def test_rounding_to_eight_columns_is_in_the_report(bowl, written):
    tables, report, _ = written
    angle, thinning = report.losses[1:3]
    assert angle.unit == "rad" and 0.0 < angle.error < np.radians(1e-4)
    exact = bowl.dataset["thickness"].values / (2.0 * report.details["ply_thickness_m"])
    error = np.abs(tables[1][:, 1] / exact - 1.0)
    assert thinning.error == pytest.approx(error.max(), rel=1e-6)
    assert thinning.cell == bowl.target.cell_ids[np.argmax(error)]
    assert not any("eight columns" in sentence for sentence in report.warnings)


def test_the_plies_that_take_the_tables_are_told(written):
    _, report, path = written
    text = path.read_text()
    assert "lengths in m, angles in degrees" in text
    assert f"the thickness {report.details['ply_thickness_m']:.6g} m" in report.warnings[-1]


def test_unmapped_cells_have_no_row(bowl, tmp_path):
    dataset = bowl.dataset.copy(deep=True)
    for name in ("thickness", "fibre_direction_1_x", "fibre_direction_2_x"):
        dataset[name].values[[0, 3]] = np.nan
    report = export(dataset, bowl.target, "drape", tmp_path / "hole.drape.fem")
    rows = read_tables(tmp_path / "hole.drape.fem")[1]
    assert len(rows) == bowl.target.cell_count - 2
    assert any("2 unmapped cells have no row" in sentence for sentence in report.warnings)


def test_numbers_beyond_eight_columns_and_doubled_ones_are_errors(bowl, numbered, tmp_path):
    for ids, message in (
        (bowl.target.cell_ids + 10**8, "eight columns of bulk data"),
        (np.ones(bowl.target.cell_count, dtype=int), "the same number"),
    ):
        with pytest.raises(InputError, match=message):
            export(*numbered(bowl, ids), "drape", tmp_path / "no.fem")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_every_ply_of_a_stack_has_tables_of_its_own(make, flat_stack, write_mesh, tmp_path, order):
    """Two flat plies of unlike shear; the upper one is short and thins along x."""
    forming, thickness_at, names = flat_stack(order)
    flat, quads = make.grid(18, 18, (-0.9, -0.9), (0.9, 0.9))
    mesh = write_mesh(make.lifted(flat), [("quad", quads)])
    options = MappingOptions(exports=("drape",))
    report = map_file(forming, mesh, tmp_path / "stack.nc", options)
    thickness = report.exports[0]["details"]["ply_thickness_m"]
    target = read_target(mesh)
    tables = read_tables(tmp_path / "stack.drape.fem")
    # from the lowest to the highest, whatever the order of the result
    assert list(thickness) == names
    text = (tmp_path / "stack.drape.fem").read_text()
    of_tables = [line[2:] for line in text.splitlines() if line.startswith(("$ under", "$ over"))]
    assert of_tables == [f"{name} fibre_direction_{k}" for name in names for k in (1, 2)]
    assert [len(rows) for rows in tables.values()] == [324, 324, 162, 162]
    x = target.points[target.corners].mean(axis=1)[:, 0]
    for ply, shear in ((0, 0.3), (1, -0.5)):
        first, second = tables[2 * ply + 1], tables[2 * ply + 2]
        between = np.mod(second[:, 2] - first[:, 2], 180.0)
        assert between == pytest.approx(90.0 - np.degrees(shear), abs=1e-4)
        row = np.searchsorted(target.cell_ids, first[:, 0].astype(int))
        formed = 2.0 * thickness[names[ply]] * first[:, 1]
        assert formed == pytest.approx(thickness_at(ply, x[row]), rel=1e-6)
    assert not any("no row" in sentence for sentence in report.warnings)


@pytest.fixture
def mapped_stack(make, flat_stack, write_mesh, tmp_path):
    """Map the two plies onto quadrilaterals, of which those at x > -0.5 may be turned over.

    Returns the dataset, the target and x of its cells [m].
    """

    def build(*, turned=False):
        forming, _, _ = flat_stack((0, 1))
        flat, quads = make.grid(18, 18, (-0.9, -0.9), (0.9, 0.9))
        x = flat[quads].mean(axis=1)[:, 0]
        if turned:
            quads = np.where((x > -0.5)[:, None], quads[:, ::-1], quads)
        mesh = write_mesh(make.lifted(flat), [("quad", quads)])
        map_file(forming, mesh, tmp_path / "stack.nc", MappingOptions(picture=False))
        with xr.open_dataset(tmp_path / "stack.nc", mask_and_scale=False) as opened:
            return opened.load(), read_target(mesh), x

    return build


def test_plies_are_ordered_by_the_cells_where_both_lie(mapped_stack, tmp_path):
    """The target lies 5 mm above the stack where the short upper ply is, and in it elsewhere."""
    dataset, target, x = mapped_stack()
    for name in ("ply_height_under", "ply_height_over"):
        dataset[name] = dataset[name] - np.where(x < 0.0, 5e-3, 0.0)
    report = export(dataset, target, "drape", tmp_path / "stack.fem")
    assert list(report.details["ply_thickness_m"]) == ["under", "over"]
    assert not any("another order" in loss.what for loss in report.losses)


@pytest.mark.parametrize("name", ["drape", "openradioss"])
def test_cells_whose_plies_lie_in_another_order_are_told(mapped_stack, tmp_path, name):
    """Of nine columns with both plies five have turned normals; four do not."""
    dataset, target, _ = mapped_stack(turned=True)
    report = export(dataset, target, name, tmp_path / "stack.out")
    told = [loss.what for loss in report.losses if "another order along the normal" in loss.what]
    assert len(told) == 1 and told[0].startswith("in 72 cells (cell ")
