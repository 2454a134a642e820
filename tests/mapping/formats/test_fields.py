"""Numbers in eight columns, triangles of quadrilaterals, and results that no format can take."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hypothesis import example, given
from hypothesis import strategies as st

from lcmchain.errors import InputError
from lcmchain.mapping.formats import FORMATS, export
from lcmchain.mapping.formats.bulk_data import line, number, real
from lcmchain.mapping.formats.preform import triangles_of

ordinary = st.floats(1e-30, 1e6) | st.floats(-1e6, -1e-30)


@given(ordinary)
@example(0.99999999)
@example(-0.99999999)
@example(999999.96)
@example(9.9999999e-4)
@example(-1.0)
def test_a_real_fits_into_eight_columns_with_all_digits_that_fit(value):
    text = real(value)
    assert len(text) <= 8 and "." in text and "e" not in text.lower()
    # Sign, point and a two-digit exponent leave three digits in the worst case, most often five.
    allowed = 5e-4 if abs(value) < 1e-9 else 5e-5 if abs(value) < 1e-3 else 5e-7
    room = 10 if value < 0.0 else 1  # a sign takes one digit
    assert abs(number(text) - value) <= allowed * room * max(abs(value), 0.1 * (abs(value) >= 1e-3))


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0.0"), (1.0, "1.0"), (-0.5, "-.5"), (0.1234567, ".1234567"), (1.5e-5, "1.5000-5"),
     (12345678.0, "1.2346+7"), (-123456.0, "-123456."), (0.99999999, "1.0")],
)  # fmt: skip
def test_reals_are_written_as_bulk_data_has_them(value, text):
    assert real(value) == text


def test_a_line_has_columns_of_eight():
    assert line("GRID", 12, "", 0.25, -1.5, 3.0) == (
        "GRID          12             .25    -1.5     3.0"
    )


def test_quadrilaterals_are_cut_along_the_shorter_diagonal(bowl):
    triangles = triangles_of(bowl.target)
    points, corners = bowl.target.points, bowl.target.corners
    assert triangles.halved == int(bowl.target.surface.is_quadrilateral.sum()) == 36
    assert len(np.unique(triangles.ids)) == len(triangles.ids)
    for cell in np.flatnonzero(bowl.target.surface.is_quadrilateral):
        mine = triangles.nodes[triangles.cell == cell]
        assert set(mine.ravel()) == set(corners[cell])
        shared = sorted(set(mine[0]) & set(mine[1]))
        diagonals = [sorted(corners[cell][[0, 2]]), sorted(corners[cell][[1, 3]])]
        lengths = [np.linalg.norm(points[a] - points[b]) for a, b in diagonals]
        assert shared == diagonals[int(np.argmin(lengths))]
    area = 0.5 * np.cross(
        points[triangles.nodes[:, 1]] - points[triangles.nodes[:, 0]],
        points[triangles.nodes[:, 2]] - points[triangles.nodes[:, 0]],
    )
    normals = bowl.target.surface.normals[triangles.cell]
    assert np.all(np.einsum("ti,ti->t", area, normals) > 0.0)


@pytest.mark.parametrize("name", FORMATS)
def test_fields_themselves_give_the_same_as_the_dataset(bowl, tmp_path, name):
    ending = FORMATS[name].ending
    one = export(bowl.dataset, bowl.target, name, tmp_path / f"dataset{ending}")
    two = export(bowl.fields, bowl.target, name, tmp_path / f"fields{ending}")
    assert one.losses == two.losses


@pytest.mark.parametrize("name", FORMATS)
def test_a_result_of_another_mesh_is_refused(bowl, part, tmp_path, name):
    other = part(low=-0.8)
    fewer = replace(
        other.target,
        blocks=other.target.blocks[:1],
        cell_ids=other.target.cell_ids[:36],
        cell_sets={},
    )
    with pytest.raises(InputError, match="not one on this mesh of 36 cells"):
        export(bowl.dataset, fewer, name, tmp_path / "no")


def test_a_mesh_of_as_many_cells_with_other_numbers_is_refused(bowl, tmp_path):
    other = replace(bowl.target, cell_ids=bowl.target.cell_ids[::-1])
    with pytest.raises(InputError, match="not one on this mesh"):
        export(bowl.dataset, other, "vmap", tmp_path / "no")


@pytest.mark.parametrize("name", FORMATS)
def test_fields_on_nodes_are_refused(bowl, tmp_path, name):
    on_nodes = xr.Dataset(
        {
            "thickness": ("target_node", np.ones(90), {"location": "node", "units": "m"}),
            "cell_id": bowl.dataset["cell_id"],
            "mapping_status": bowl.dataset["mapping_status"],
        }
    )
    with pytest.raises(InputError, match="map onto cells"):
        export(on_nodes, bowl.target, name, tmp_path / "no")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_format_names_those_there_are(bowl, tmp_path):
    with pytest.raises(InputError, match='"abaqus"; write one of vmap, drape'):
        export(bowl.dataset, bowl.target, "abaqus", tmp_path / "no")


def test_fields_of_plies_are_left_out_and_told(bowl, tmp_path):
    layers = bowl.dataset["thickness"].expand_dims({"ply": 2})
    report = export(
        bowl.dataset.assign(ply_thickness=layers), bowl.target, "vmap", tmp_path / "plies.vmap"
    )
    assert any("left out: ply_thickness" in sentence for sentence in report.warnings)


def test_of_several_states_the_last_one_is_written(bowl, tmp_path):
    earlier = bowl.dataset.copy(deep=True)
    earlier["thickness"].values *= 2.0
    fields = [name for name, v in bowl.dataset.items() if v.attrs.get("location") == "face"]
    history = bowl.dataset.assign(
        {
            name: (
                ("time", *bowl.dataset[name].dims),
                np.stack([earlier[name].values, bowl.dataset[name].values]),
                bowl.dataset[name].attrs,
            )
            for name in fields
        }
    )
    last = export(bowl.dataset, bowl.target, "drape", tmp_path / "last.fem")
    of_all = export(history, bowl.target, "drape", tmp_path / "all.fem")
    assert of_all.details == last.details and of_all.losses == last.losses
