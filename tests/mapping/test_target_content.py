"""The content of a file tells its format; surfaces of OBJ and PLY, grids of VTK with texts."""

import shutil

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target

CORNERS = [(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)]
NASTRAN = (
    "$ a comment\nBEGIN BULK\n"
    + "".join(f"GRID,{k},,{x}.,{y}.,0.\n" for k, (x, y, _) in enumerate(CORNERS, start=1))
    + "CQUAD4,1,1,1,2,3,4\nENDDATA\n"
)
ABAQUS = (
    "** a comment\n\n*NODE, NSET=Nall\n"
    + "".join(f"{k},{x},{y},0\n" for k, (x, y, _) in enumerate(CORNERS, start=1))
    + "*ELEMENT, TYPE=S4, ELSET=Eall\n1,1,2,3,4\n"
)
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + "f 1 2 3 4\n"


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (NASTRAN, ["part.dat", "part.blk", "part.nas", "part.inp", "part.msh", "PART", "part.obj"]),
        (ABAQUS, ["all.msh", "all.dat", "all.bdf", "all.txt", "all.inp", "all.vtu"]),
        (OBJ, ["a.obj", "a.txt", "a.stl"]),
    ],
)
def test_the_ending_of_a_text_does_not_matter(tmp_path, text, names):
    for name in names:
        (tmp_path / name).write_text(text)
        target = read_target(tmp_path / name)
        assert target.points.tolist() == [list(map(float, point)) for point in CORNERS]
        assert [(kind, nodes.tolist()) for kind, nodes in target.blocks] == [
            ("quad", [[0, 1, 2, 3]])
        ]


@pytest.mark.parametrize(
    ("name", "options"),
    [("m.med", {}), ("m.e", {}), ("m.vtk", {}), ("m.vtu", {}), ("m.msh", {"file_format": "gmsh"}),
     ("m.ply", {"binary": True}), ("m.ply", {"binary": False})],
)  # fmt: skip
def test_files_of_other_programs_are_known_without_their_ending(tmp_path, name, options):
    meshio.Mesh(np.array(CORNERS, float), [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]).write(
        tmp_path / name, **options
    )
    shutil.copy(tmp_path / name, tmp_path / "mesh.dat")
    known, target = read_target(tmp_path / name), read_target(tmp_path / "mesh.dat")
    np.testing.assert_array_equal(target.points, known.points)
    np.testing.assert_array_equal(target.blocks[0][1], known.blocks[0][1])
    assert target.cell_count == 2


def test_obj_has_as_many_normals_as_it_likes(tmp_path):
    text = (
        "# a comment\no lid\nv 0 0 0 1 0 0\nv 20 0 0\nv 20 20 0\nv 0 20 0\nvn 0 0 1\nvt 0 0\n"
        "vt 1 0\ng base\nf 1/1/1 2/2/1 3/1/1\nf -4//1 \\\n -2//1 -1//1\ng quad\nusemtl m\n"
        "f 1 2 3 4\nl 1 2\n"
    )
    (tmp_path / "a.obj").write_text(text)
    target = read_target(tmp_path / "a.obj")
    assert target.points.tolist() == [list(map(float, point)) for point in CORNERS]
    assert [(name, nodes.tolist()) for name, nodes in target.blocks] == [
        ("triangle", [[0, 1, 2], [0, 2, 3]]), ("quad", [[0, 1, 2, 3]]),
    ]  # fmt: skip
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {
        "base": [0, 1], "quad": [2],
    }  # fmt: skip
    assert target.ignored == {"line": 1}


@pytest.mark.parametrize(
    ("line", "words"),
    [("f 1 2", 'line 6: "f 1 2" is no face'), ("f 1 2 x", "line 6: .* is no face"),
     ("v 1 2", "line 6: .* is no vertex"), ("f 1 2 0", "line 6: the face has the vertex 0"),
     ("f 1 2 -9", "line 6: the face has the vertex -9")],
)  # fmt: skip
def test_a_wrong_line_of_obj_is_named(tmp_path, line, words):
    (tmp_path / "a.obj").write_text(OBJ + line + "\n")
    with pytest.raises(InputError, match=words):
        read_target(tmp_path / "a.obj")


def ply(form, *, mixed=False):
    """A PLY file with a list of texture coordinates, and one of another element, on its faces."""
    faces = [[0, 1, 2, 3], [0, 2, 3]] if mixed else [[0, 1, 2], [0, 2, 3]]
    header = (
        f"ply\nformat {form} 1.0\ncomment a comment\nobj_info something\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty uchar red\nproperty float z\n"
        "element face 2\nproperty uchar flag\nproperty list uchar int vertex_index\n"
        "property list uchar float texcoord\nelement edge 1\nproperty int vertex1\nend_header\n"
    )
    if form == "ascii":
        text = "".join(f"{x} {y} 7 {z}\n" for x, y, z in CORNERS)
        text += "".join(
            f"{k} {len(f)} {' '.join(map(str, f))} 2 0.5 1\n" for k, f in enumerate(faces)
        )
        return (header + text + "5\n").encode()
    order = "<" if "little" in form else ">"
    types = [(n, order + "f4") for n in "xy"] + [("red", "u1"), ("z", order + "f4")]
    content = np.array([(x, y, 7, z) for x, y, z in CORNERS], types).tobytes()
    for k, face in enumerate(faces):
        content += bytes([k, len(face)]) + np.array(face, order + "i4").tobytes()
        content += bytes([2]) + np.array([0.5, 1.0], order + "f4").tobytes()
    return header.encode() + content + np.array([5], order + "i4").tobytes()


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("mixed", [False, True])
def test_ply_with_several_lists_on_its_faces(tmp_path, form, mixed):
    (tmp_path / "a.ply").write_bytes(ply(form, mixed=mixed))
    target = read_target(tmp_path / "a.ply")
    assert target.points.tolist() == [list(map(float, point)) for point in CORNERS]
    found = [(name, nodes.tolist()) for name, nodes in target.blocks]
    if mixed:
        assert found == [("quad", [[0, 1, 2, 3]]), ("triangle", [[0, 2, 3]])]
    else:
        assert found == [("triangle", [[0, 1, 2], [0, 2, 3]])]
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {
        "flag 0": [0], "flag 1": [1],
    }  # fmt: skip
    assert target.ignored == {"edge": 1}
    assert "lists of the faces are left out: texcoord" in target.notes


def test_a_broken_ply_is_refused(tmp_path):
    for form in ("ascii", "binary_little_endian"):
        (tmp_path / "a.ply").write_bytes(ply(form)[:-16])
        with pytest.raises(InputError, match="ends before its last number"):
            read_target(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(ply("ascii").replace(b"property uchar red", b"property red"))
    with pytest.raises(InputError, match='line 8: "property red" is no header'):
        read_target(tmp_path / "a.ply")


@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
@pytest.mark.parametrize("encoded", [0, 1])
@pytest.mark.parametrize("compressed", [False, True])
def test_texts_in_a_grid_are_left_out_by_name(tmp_path, mode, encoded, compressed):
    vtk = pytest.importorskip("vtk")
    grid, points, nodes = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkIdList()
    for number, corner in enumerate(CORNERS):
        points.InsertNextPoint(corner)
        nodes.InsertNextId(number)
    grid.SetPoints(points)
    grid.InsertNextCell(vtk.VTK_QUAD, nodes)
    for array, name, value, to in (
        (vtk.vtkStringArray(), "title", "a part", grid.GetFieldData()),
        (vtk.vtkStringArray(), "kind", "shell", grid.GetCellData()),
        (vtk.vtkIntArray(), "region", 7, grid.GetCellData()),
    ):
        array.SetName(name)
        array.InsertNextValue(value)
        to.AddArray(array)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(tmp_path / "grid.vtu"))
    writer.SetInputData(grid)
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetEncodeAppendedData(encoded)
    if compressed:
        writer.SetCompressorTypeToZLib()
    else:
        writer.SetCompressorTypeToNone()
    writer.Write()
    target = read_target(tmp_path / "grid.vtu")
    assert target.points.tolist() == [list(map(float, point)) for point in CORNERS]
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {"region 7": [0]}
    assert target.notes == ("arrays of text are left out: title, kind",)
