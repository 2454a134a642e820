"""Files of Gmsh as targets: numbers and physical groups, as Gmsh itself writes them."""

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target


@pytest.fixture(scope="module")
def gmsh():
    try:
        import gmsh
    except (ImportError, OSError) as error:  # the second where the system lacks its libraries
        pytest.skip(f"Gmsh cannot be loaded ({error})")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()


@pytest.fixture
def plate(gmsh, tmp_path):
    """Write two squares side by side, a line and all: version, text or binary, order, overlap."""

    def write(version=4.1, binary=0, order=1, overlapping=False, quads=True, name="plate.msh"):
        gmsh.clear()
        gmsh.model.add("plate")
        left = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        right = gmsh.model.occ.addRectangle(1, 0, 0, 1, 1)
        gmsh.model.occ.fragment([(2, left)], [(2, right)])
        gmsh.model.occ.synchronize()
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
        curve = next(
            tag for _, tag in gmsh.model.getEntities(1)
            if np.allclose(np.array(gmsh.model.getBoundingBox(1, tag))[[0, 3]], 0.0, atol=1e-6)
        )  # fmt: skip
        gmsh.model.addPhysicalGroup(2, surfaces[:1], 7, name="left half")
        gmsh.model.addPhysicalGroup(2, surfaces if overlapping else surfaces[1:], 9)
        gmsh.model.addPhysicalGroup(1, [curve], 7, name="clamped")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.option.setNumber("Mesh.ElementOrder", order)
        gmsh.option.setNumber("Mesh.RecombineAll", int(quads))
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.model.mesh.generate(2)
        # numbers that are neither sorted nor contiguous
        tags = gmsh.model.mesh.getElements()[1]
        old = np.concatenate(tags)
        new = np.random.default_rng(3).permutation(old) * 3 + 1000
        gmsh.model.mesh.renumberElements(old, new)
        nodes = gmsh.model.mesh.getNodes()[0]
        gmsh.model.mesh.renumberNodes(nodes, np.random.default_rng(4).permutation(nodes) * 2 + 50)
        gmsh.write(str(tmp_path / name))
        return tmp_path / name

    return write


def of_gmsh(gmsh, path):
    """Nodes of each element and places of the nodes, by their numbers, as Gmsh reads the file.

    Writing version 2.2, Gmsh numbers anew.
    """
    gmsh.clear()
    gmsh.merge(str(path))
    tags, places, _ = gmsh.model.mesh.getNodes()
    points = dict(zip(tags.tolist(), places.reshape(-1, 3), strict=True))
    cells = {}
    for kind, numbers, nodes in zip(*gmsh.model.mesh.getElements(2), strict=True):
        count = gmsh.model.mesh.getElementProperties(kind)[3]
        rows = nodes.reshape(-1, count).tolist()
        cells |= dict(zip(numbers.tolist(), rows, strict=True))
    return cells, points


def cells_by_number(target):
    rows = [row for _, nodes in target.blocks for row in nodes]
    return {
        int(cell): target.node_ids[row].tolist()
        for cell, row in zip(target.cell_ids, rows, strict=True)
    }


@pytest.mark.parametrize("binary", [0, 1], ids=["text", "binary"])
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("order", [1, 2])
def test_numbers_and_groups(gmsh, plate, version, binary, order):
    path = plate(version, binary, order)
    target = read_target(path)
    cells, points = of_gmsh(gmsh, path)
    assert version == 2.2 or min(cells) > 1000  # numbered as the fixture asks for
    assert cells_by_number(target) == cells
    for number, place in zip(target.node_ids.tolist(), target.points, strict=True):
        np.testing.assert_allclose(place, points[number], atol=1e-15)
    assert set(target.parts) == {"left half", "physical surface 9"}
    centre = target.centroids[:, 0]
    assert np.all(centre[target.parts["left half"]] < 1.0)
    assert np.all(centre[target.parts["physical surface 9"]] > 1.0)
    assert sum(len(rows) for rows in target.parts.values()) == target.cell_count
    clamped = target.points[target.node_sets["clamped"]]
    assert len(clamped) >= 4 and np.all(clamped[:, 0] == 0.0)


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_groups_that_overlap_are_sets_and_no_cell_is_doubled(gmsh, plate, version):
    """Version 2 writes the elements of a surface once for each group it is in."""
    path = plate(version, overlapping=True)
    target = read_target(path)
    cells, _ = of_gmsh(gmsh, path)
    assert {tuple(nodes) for nodes in cells.values()} == {
        tuple(nodes) for nodes in cells_by_number(target).values()
    }
    assert target.cell_count == len({tuple(nodes) for nodes in cells.values()})
    assert not target.parts
    half, whole = target.cell_sets["left half"], target.cell_sets["physical surface 9"]
    assert len(whole) == target.cell_count > len(half) > 0
    assert np.all(target.centroids[half, 0] < 1.0)
    assert not any("same nodes" in note for note in target.notes)


@pytest.mark.parametrize("binary", [0, 1], ids=["text", "binary"])
def test_coordinates_of_parameters_are_passed_over(gmsh, plate, binary):
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    try:
        path = plate(4.1, binary)
    finally:
        gmsh.option.setNumber("Mesh.SaveParametric", 0)
    target = read_target(path)
    cells, points = of_gmsh(gmsh, path)
    assert cells_by_number(target) == cells
    for number, place in zip(target.node_ids.tolist(), target.points, strict=True):
        np.testing.assert_allclose(place, points[number], atol=1e-15)


def test_version_4_0_says_what_is_lost_and_what_to_do(plate, tmp_path, make):
    with pytest.raises(InputError, match=r"MSH 4 .*save as version 4.1"):
        read_target(plate(4.0))
    points, quads = make.grid(4, 3)
    mesh = meshio.Mesh(make.lifted(points), [("quad", quads)])
    meshio.gmsh.write(tmp_path / "m.msh", mesh, "4.0")
    target = read_target(tmp_path / "m.msh")
    assert target.cell_count == len(quads)
    assert any("are not read" in note for note in target.notes)


@pytest.mark.parametrize("binary", [0, 1], ids=["text", "binary"])
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("kind", ["tetra10", "hexahedron20", "wedge15", "hexahedron27", "wedge18"])
def test_mid_side_nodes_of_solids_come_in_vtk_order(gmsh, tmp_path, kind, version, binary):
    gmsh.clear()
    gmsh.model.add("box")
    full = kind in ("hexahedron27", "wedge18")
    if kind == "tetra10":
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    else:
        base = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.extrude([(2, base)], 0, 0, 1, [2], recombine=True)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.RecombineAll", int(kind.startswith("hexahedron")))
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(not full))
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(tmp_path / "box.msh"))
    target = read_target(tmp_path / "box.msh")
    names = {"hexahedron27": "hexahedron20", "wedge18": "wedge15"}
    assert {name for name, _ in target.blocks} == {names.get(kind, kind)}
    edges = {
        "tetra10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
        "wedge15": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
        "hexahedron20": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4),
                         (0, 4), (1, 5), (2, 6), (3, 7)],
    }[names.get(kind, kind)]  # fmt: skip
    for _, cells in target.blocks:
        corners = target.points[cells]
        ends = corners[:, np.array(edges)].mean(axis=2)
        np.testing.assert_allclose(corners[:, -len(edges) :], ends, atol=1e-12)
    assert not any("inside out" in note for note in target.notes)


@pytest.mark.parametrize("file_format", ["gmsh", "gmsh22"])
@pytest.mark.parametrize("binary", [False, True])
def test_files_written_by_meshio(tmp_path, make, file_format, binary):
    points, quads = make.grid(4, 3)
    mesh = meshio.Mesh(
        make.lifted(points), [("quad", quads[:5]), ("triangle", make.triangles_of(quads[5:]))],
        cell_data={"gmsh:physical": [np.full(5, 3), np.full(14, 4)],
                   "gmsh:geometrical": [np.full(5, 1), np.full(14, 2)]},
        field_data={"skin": np.array([3, 2]), "rib": np.array([4, 2])},
    )  # fmt: skip
    if file_format == "gmsh":  # of one cell type only
        mesh = meshio.Mesh(mesh.points, [("quad", quads)])
    meshio.write(tmp_path / "m.msh", mesh, file_format=file_format, binary=binary)
    target = read_target(tmp_path / "m.msh")
    np.testing.assert_allclose(target.points, mesh.points)
    for (_, found), block in zip(target.blocks, mesh.cells, strict=True):
        np.testing.assert_array_equal(found, block.data)
    if file_format == "gmsh22":  # meshio writes no groups of version 4
        assert {name: len(rows) for name, rows in target.parts.items()} == {"skin": 5, "rib": 14}


TEXT = (
    '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 5 "a b"\n$EndPhysicalNames\n'
    "$Nodes\n4\n1 0 0 0\n9 1 0 0\n5 1 1 0\n4 0 1 0\n$EndNodes\n"
    "$Elements\n2\n30 2 2 5 1 1 9 5\n20 2 3 5 1 0 1 5 4\n$EndElements\n"
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (TEXT[:150], "has no end; the file is cut off"),
        (TEXT.replace("9 1 0 0", "9 1 x 0"), r"\$Nodes holds something that is no number"),
        (TEXT.replace("$Nodes\n4", "$Nodes\n5"), r"\$Nodes ends before its last number"),
        (TEXT.replace("$Nodes\n4", "$Nodes\n-4"), "a count that cannot be right"),
        (TEXT.replace("1 5 4\n$", "1 5 7\n$"), "element 20 has a node that the file does not def"),
        (TEXT.replace("30 2 2", "30 92 2"), "elements of type 92, above the second order"),
        (TEXT.replace("30 2 2", "30 2 -1"), "a count that cannot be right"),
        (TEXT.replace("9 1 0 0", "1 1 0 0"), "lists a node twice"),
        (TEXT.partition("$Elements")[0], "no nodes or no elements"),
        (TEXT + "more", "no section of an MSH file"),
        ("$MeshFormat\n", "cannot be read"),
    ],
)
def test_broken_files_are_refused(tmp_path, text, words):
    (tmp_path / "m.msh").write_text(text)
    with pytest.raises(InputError, match=words):
        read_target(tmp_path / "m.msh")


def test_entities_without_elements_are_passed_over(tmp_path):
    text = (
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n"
        "0 0 0\n1 0 0\n0 1 0\n$EndNodes\n"
        "$Elements\n2 1 5 5\n2 1 3 0\n2 1 2 1\n5 1 2 3\n$EndElements\n"
    )
    (tmp_path / "m.msh").write_text(text)
    assert read_target(tmp_path / "m.msh").cell_ids.tolist() == [5]


def test_a_file_as_the_manual_describes_it(tmp_path):
    (tmp_path / "m.msh").write_text(TEXT)
    target = read_target(tmp_path / "m.msh", length_unit="mm")
    assert target.cell_ids.tolist() == [30, 20]
    assert target.node_ids.tolist() == [1, 9, 5, 4]
    assert target.parts["a b"].tolist() == [0, 1]
    np.testing.assert_allclose(target.points[1], [1e-3, 0, 0])


@pytest.mark.parametrize("binary", [0, 1])
def test_nodes_with_their_parameters_are_nodes(plate, gmsh, tmp_path, binary):
    plain = read_target(plate(version=2.2, binary=binary))
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    gmsh.write(str(tmp_path / "parametric.msh"))
    gmsh.option.setNumber("Mesh.SaveParametric", 0)
    assert b"$ParametricNodes" in (tmp_path / "parametric.msh").read_bytes()
    target = read_target(tmp_path / "parametric.msh")
    np.testing.assert_array_equal(target.points, plain.points)
    np.testing.assert_array_equal(target.node_ids, plain.node_ids)
    np.testing.assert_array_equal(target.blocks[0][1], plain.blocks[0][1])
