"""The content of a file tells its format; surfaces of OBJ and PLY, grids of VTK with texts."""

import shutil
import warnings

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target
from lcmchain.mesh_files.shapes import SOLID_EDGES
from lcmchain.tools.surfaces.reading import read_triangles

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


UNIVERSAL = (
    "    -1\n  2411\n"
    + "".join(
        f"{k:10d}{1:10d}{1:10d}{11:10d}\n" + "".join(f"{v:25.16E}" for v in place) + "\n"
        for k, place in enumerate(CORNERS, start=1)
    )
    + "    -1\n    -1\n  2412\n"
    + "".join(f"{v:10d}" for v in (1, 94, 1, 1, 7, 4)) + "\n"
    + "".join(f"{v:10d}" for v in (1, 2, 3, 4)) + "\n    -1\n"
)  # fmt: skip
LSDYNA = (
    "$# a comment\n*NODE\n"
    + "".join(f"{k},{x},{y},0\n" for k, (x, y, _) in enumerate(CORNERS, start=1))
    + "*ELEMENT_SHELL\n1,1,1,2,3,4\n*END\n"
)


@pytest.mark.parametrize(
    ("text", "name", "told"),
    [(NASTRAN, "a.inp", "the ending .inp stands for Abaqus or CalculiX deck, but the file is read "
      "by its content: Nastran or OptiStruct bulk data"),
     (ABAQUS, "a.unv", "content: Abaqus"), (UNIVERSAL, "a.k", "content: Universal file"),
     (LSDYNA, "a.med", "stands for MED file, but the file is read by its content: LS-DYNA"),
     (OBJ, "a.stl", "content: OBJ"), (UNIVERSAL, "a.UNV", None), (UNIVERSAL, "a.txt", None),
     (LSDYNA, "a.K", None), (LSDYNA, "a.dat", None), (ABAQUS, "a.msh", None),
     (NASTRAN, "a.blk", None), (NASTRAN, "a", None)],
)  # fmt: skip
def test_an_ending_that_disagrees_is_told_once(tmp_path, text, name, told):
    (tmp_path / name).write_text(text)
    target = read_target(tmp_path / name)
    assert target.points.tolist() == [list(map(float, point)) for point in CORNERS]
    assert target.blocks[0][1].tolist() == [[0, 1, 2, 3]]
    of_ending = [note for note in target.notes if "ending" in note]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        read_triangles(tmp_path / name)
    of_tool = [str(warning.message) for warning in said if "ending" in str(warning.message)]
    assert len(of_ending) == len(of_tool) == (told is not None)
    if told is not None:
        assert told in of_ending[0] and told in of_tool[0]


def test_a_file_that_is_no_mesh_is_refused_with_the_list(tmp_path):
    (tmp_path / "a.txt").write_text("Dear colleague,\nhere is the mesh.\n")
    with pytest.raises(InputError, match="no mesh of a format that is known") as error:
        read_target(tmp_path / "a.txt")
    for title in ("Universal file", "LS-DYNA keyword file", "NETGEN mesh", "STL file", ".xdmf"):
        assert title in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"ISO-10303-21;\nHEADER;\n", "this is a STEP model, which is not read: .* mesh it"),
     (b"part".ljust(72) + b"S      1\n", "IGES model"), (b"PK\x03\x04abc", "zip archive"),
     (b"#RADIOSS STARTER\n/BEGIN\n", "Radioss starter deck"),
     (b"$NOD\n4\n", "Gmsh mesh of version 1"), (b"#VRML V2.0 utf8\n", "VRML model"),
     (b"/COM,ANSYS\n/PREP7\nNBLOCK\n", "Ansys deck")],
)  # fmt: skip
@pytest.mark.parametrize("name", ["a.dat", "a.inp", "a"])
def test_what_is_known_to_be_no_mesh_is_named(tmp_path, content, words, name):
    (tmp_path / name).write_bytes(content)
    for read in (read_target, read_triangles):
        with pytest.raises(InputError, match=words):
            read(tmp_path / name)


@pytest.mark.parametrize("name", ["m.off", "m.su2", "m.xdmf", "m.mesh"])
def test_files_of_meshio_are_known_without_their_ending(tmp_path, name):
    cells = [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]
    if name == "m.su2":  # which meshio 5.3.5 reads and cannot write
        places = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS)
        (tmp_path / name).write_text(
            f"% a comment\nNDIME= 3\nNELEM= 2\n5 0 1 2\n5 0 2 3\nNPOIN= 4\n{places}NMARK= 0\n"
        )
    else:
        meshio.Mesh(np.array(CORNERS, float), cells).write(tmp_path / name)
    known = read_target(tmp_path / name)
    shutil.copy(tmp_path / name, tmp_path / "mesh.dat")
    target = read_target(tmp_path / "mesh.dat")
    np.testing.assert_array_equal(target.points, known.points)
    assert target.cell_count == 2


def netgen(order):
    """A file as NETGEN 6.2.2608 writes it: a tetrahedron, its four faces, three of one name."""
    places = [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)]
    middles = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    if order == 2:
        places += [tuple(np.add(places[a], places[b]) / 2) for a, b in middles]

    def element(*corners, pairs):
        nodes = list(corners)
        if order == 2:
            nodes += [4 + middles.index(tuple(sorted((corners[a], corners[b])))) for a, b in pairs]
        return f"{len(nodes)} {' '.join(str(node + 1) for node in nodes)}"

    faces = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    sides = [(1, 2), (0, 2), (0, 1)]  # opposite to each corner
    listed = "".join(f" {k + 1} {k + 1} 1 0 {element(*face, pairs=sides)}\n"
                     for k, face in enumerate(faces))  # fmt: skip
    return (
        "# Generated by NETGEN v6.2.2608\n\nmesh3d\ndimension\n3\ngeomtype\n0\n\n"
        "# surfnr\tdomin\tdomout\ttlosurf\tbcprop\nfacedescriptors\n4\n"
        + "".join(f"{k} 1 0 0 {k}\n" for k in range(1, 5))
        + f"\nsurfaceelements\n4\n{listed}\n\nvolumeelements\n1\n"
        f"1 {element(0, 1, 2, 3, pairs=middles)}\n\n# p1 p2\nedgesegmentsgi3\n1\n"
        f"1 2 -1 -1 0 0 0\n\n#  X  Y  Z\npoints\n{len(places)}\n"
        + "".join(" ".join(f"{x:22.16f}" for x in place) + "\n" for place in places)
        + "\nmaterials\n1\n1 the body\n\nbcnames\n4\n1\tskin\n2\tskin\n3\tskin\n4\tgate\n\n"
        "face_colours\n4\n1 0. 1. 0.\nendmesh\n\ncsgsurfaces 6\n"
    )


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", ["a.vol", "a.txt"])
def test_netgen_with_its_boundaries_and_materials(tmp_path, order, name):
    (tmp_path / name).write_text(netgen(order))
    solid = read_target(tmp_path / name)
    ((kind, nodes),) = solid.blocks
    assert kind == {1: "tetra", 2: "tetra10"}[order]
    assert not any("inside out" in note for note in solid.notes)
    for at, (a, b) in enumerate(SOLID_EDGES["tetra"] if order == 2 else [], start=4):
        middle = solid.points[nodes[0, [a, b]]].mean(axis=0)
        np.testing.assert_allclose(solid.points[nodes[0, at]], middle, atol=1e-15)
    assert solid.parts["the body"].tolist() == [0] and len(solid.node_sets["gate"]) == 3 * order
    skin = read_target(tmp_path / name, kind="infiltration")
    assert {part: rows.tolist() for part, rows in skin.parts.items()} == {
        "skin": [0, 1, 2], "gate": [3],
    }  # fmt: skip
    ((_, faces),) = skin.blocks
    for at, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)] if order == 2 else [], start=3):
        middles = skin.points[faces[:, [a, b]]].mean(axis=1)
        np.testing.assert_allclose(skin.points[faces[:, at]], middles, atol=1e-15)
    assert skin.ignored["line"] == 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [("volumeelements\n1\n", "volumeelements\n1\nx ", "is no element"),
     ("points\n4", "points\n40", "is no point"), ("points\n4", "points\nx", '"x" is no number')],
)  # fmt: skip
def test_a_wrong_file_of_netgen_names_its_line(tmp_path, old, new, words):
    (tmp_path / "a.vol").write_text(netgen(1).replace(old, new))
    with pytest.raises(InputError, match=f"line .*{words}"):
        read_target(tmp_path / "a.vol")


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
