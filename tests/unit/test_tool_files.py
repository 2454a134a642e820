"""Tools are read from files as targets are: decks with instances, systems, rigid elements."""

import warnings

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target
from lcmchain.tools import ToolWarning
from lcmchain.tools.surfaces.reading import read_surface, read_triangles

PART = (
    "*PART, NAME=Die\n*NODE\n1, 0, 0, 0\n2, 100, 0, 0\n3, 100, 100, 0\n4, 0, 100, 0\n"
    "*ELEMENT, TYPE={}\n1, 1, 2, 3, 4\n*NODE\n5, 0, 0, 50\n*NSET, NSET=REF\n5\n*END PART\n"
    "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=Die-1, PART=Die\n-50, -50, -20\n*END INSTANCE\n"
    "*END ASSEMBLY\n"
)
CYLINDRICAL = (
    "CORD2C,1,,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.\nGRID,1,1,100.,0.,0.\nGRID,2,1,100.,90.,0.\n"
    "GRID,3,1,100.,90.,50.\nGRID,4,1,100.,0.,50.\nCQUAD4,1,1,1,2,3,4\n"
)


@pytest.mark.parametrize(
    ("name", "text"),
    [("moved.inp", PART.format("S4R")), ("rigid.inp", PART.format("R3D4")),
     ("cylindrical.bdf", CYLINDRICAL), ("without-begin-bulk.dat", CYLINDRICAL)],
)  # fmt: skip
def test_a_tool_lies_where_the_same_target_lies(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToolWarning)
        surface = read_surface(tmp_path / name, "mm")
    target = read_target(tmp_path / name, length_unit="mm")
    corners = target.points[target.corners[0]]
    assert len(surface.triangles) == 2
    np.testing.assert_allclose(
        np.sort(surface.points, axis=0), np.sort(corners, axis=0), atol=1e-15
    )


def test_an_instance_that_is_moved_is_a_tool_that_is_moved(tmp_path):
    (tmp_path / "moved.inp").write_text(PART.format("S4R"))
    surface = read_surface(tmp_path / "moved.inp", "mm")
    np.testing.assert_allclose(surface.points.min(axis=0), [-0.05, -0.05, -0.02], atol=1e-15)
    np.testing.assert_allclose(surface.points.max(axis=0), [0.05, 0.05, -0.02], atol=1e-15)


def test_what_a_tool_leaves_out_is_a_warning(tmp_path):
    text = PART.format("R3D4").replace("*NODE\n5", "*ELEMENT, TYPE=MASS\n2, 1\n*NODE\n5")
    (tmp_path / "die.inp").write_text(text)
    with pytest.warns(ToolWarning) as said:
        read_surface(tmp_path / "die.inp", "mm")
    told = [str(warning.message) for warning in said]
    assert any("R3D4 are taken for cells" in text for text in told)
    assert any(text.endswith("left out are: 1 MASS") for text in told)
    assert len(told) == 2  # sets are nothing to a tool


@pytest.mark.parametrize("name", ["tool.obj", "tool.ply", "tool.stl", "tool.vtk"])
def test_triangles_keep_the_order_of_the_file(tmp_path, name):
    """Blocks one after the other, of quadrilaterals all first halves and then all second ones."""
    points = np.array([[i, j, 0.25 * i * j] for i in range(4) for j in range(3)], dtype=float)
    quads = np.array([[0, 3, 4, 1], [1, 4, 5, 2]])
    triangles = np.array([[3, 6, 7], [3, 7, 4]])
    cells = [("triangle", triangles)] if name == "tool.stl" else [
        ("quad", quads), ("triangle", triangles), ("quad", quads + 6)
    ]  # fmt: skip
    meshio.Mesh(points, cells).write(tmp_path / name)
    read, found = read_triangles(tmp_path / name)
    halves = [q[:, rows] for q in (quads, quads + 6) for rows in ([0, 1, 2], [0, 2, 3])]
    order = [triangles] if name == "tool.stl" else [*halves[:2], triangles, *halves[2:]]
    np.testing.assert_allclose(read[found], points[np.concatenate(order)], rtol=1e-7)


def test_second_order_surfaces_are_taken_by_their_corners(tmp_path):
    text = (
        "*NODE\n1,0,0,0\n2,2,0,0\n3,0,2,0\n4,1,0,0\n5,1,1,0\n6,0,1,0\n"
        "*ELEMENT, TYPE=STRI65\n1,1,2,3,4,5,6\n"
    )
    (tmp_path / "a.inp").write_text(text)
    assert read_triangles(tmp_path / "a.inp")[1].tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("size", "unit", "told"),
    [(12.0, "mm", '"inch" (1 times)'), (300.0, "in", '"mm" (1 times)'), (0.3, "mm", '"m" (1 t'),
     (30.0, "mm", None), (3000.0, "mm", None), (12.0, "in", None)],
)  # fmt: skip
def test_a_tool_in_another_unit_is_noticed(tmp_path, size, unit, told):
    points = size * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0)])
    meshio.Mesh(points, [("triangle", [[0, 1, 2]])]).write(tmp_path / "die.ply")
    blank = 0.3 * np.array([(0, 0, 0.1), (1, 0, 0.1), (1, 1, 0.1), (0, 1, 0.1)])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        read_surface(tmp_path / "die.ply", unit, blank)
    doubts = [
        str(warning.message) for warning in said if "check length_unit" in str(warning.message)
    ]
    if told is None:
        assert not doubts
    else:
        (doubt,) = doubts
        assert told in doubt and f'(now "{unit}", more likely' in doubt


def test_a_deck_that_is_broken_names_its_line(tmp_path):
    (tmp_path / "a.bdf").write_text(CYLINDRICAL.replace("GRID,4,1,100.", "GRID,4,1,x"))
    with pytest.raises(InputError, match="line 6: field 4 of GRID"):
        read_surface(tmp_path / "a.bdf", "mm")
