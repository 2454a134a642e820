"""Decks of Abaqus and CalculiX as targets: numbers, sets, sections, parts and instances."""

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target

# As the manuals write it: numbers neither sorted nor contiguous, a node without a cell, comments,
# a keyword and an element that go on in the next line, mixed case, quoted names.
FLAT = """\
** a comment
*HEADING
 panel, with a comma
*Node, NSET=All nodes
  40, 0.0, 0.0, 0.
   3, 1.0, 0.0
  25, 1.0, 1.0, 0.0
   7, 0.0, 1.0, 1e-3
** between
 900, 5., 5., 5.
 101, 2.0, 0.0, 0.
 100, 2.0, 1.0, 0.
*ELEMENT, TYPE=S4R,
 ELSET=Eleft
 50, 40, 3,
     25, 7
*element, type=S3, elset=Eright
  8, 3, 101, 100
  6, 3, 100, 25
*ELEMENT, TYPE=B31, ELSET=Estiffener
 70, 40, 3
*NSET, NSET="Clamped edge"
 40, 7
*NSET, NSET=Generated, GENERATE
 3, 7, 2
 100, 101
*ELSET, ELSET=Both
 Eleft, Eright
*ELSET, ELSET=ERIGHT
 50
*SURFACE, NAME=Top
 Eleft, SPOS
*SURFACE, NAME=Rim
 50, E1
*SHELL SECTION, ELSET=Eleft, MATERIAL=CFRP
 1.0
*SHELL SECTION, ELSET=EYright, MATERIAL=CFRP
 1.0
*STEP
*STATIC
*END STEP
"""


@pytest.fixture
def deck(tmp_path):
    """Write a deck and return its path."""

    def write(text, name="deck.inp"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def numbers(target, name, nodes=False):
    """Numbers of the file of the members of a set."""
    if nodes:
        return target.node_ids[target.node_sets[name]].tolist()
    return target.cell_ids[target.cell_sets[name]].tolist()


def test_numbers_sets_and_sections_of_a_flat_deck(deck):
    target = read_target(deck(FLAT), length_unit="mm")
    assert target.node_ids.tolist() == [40, 3, 25, 7, 900, 101, 100]
    assert target.cell_ids.tolist() == [50, 8, 6]
    assert [name for name, _ in target.blocks] == ["quad", "triangle"]
    quad, triangles = (target.node_ids[nodes].tolist() for _, nodes in target.blocks)
    assert quad == [[40, 3, 25, 7]]
    assert triangles == [[3, 101, 100], [3, 100, 25]]
    np.testing.assert_allclose(target.points[3], [0.0, 1e-3, 1e-6])
    assert numbers(target, "Eleft") == [50]
    assert numbers(target, "Eright") == [50, 8, 6]  # the second *ELSET adds to it
    assert numbers(target, "Both") == [50, 8, 6]
    assert numbers(target, "All nodes", nodes=True) == target.node_ids.tolist()
    assert numbers(target, "Clamped edge", nodes=True) == [40, 7]
    assert numbers(target, "Generated", nodes=True) == [3, 7, 101, 100]
    assert numbers(target, "Top", nodes=True) == [40, 3, 25, 7]
    assert numbers(target, "Rim", nodes=True) == [40, 3]
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {"Eleft": [0]}
    assert target.ignored == {"B31": 1}
    assert any("Top, Rim" in note for note in target.notes)


def test_windows_line_ends_and_other_encodings_read_the_same(tmp_path):
    plain, other = tmp_path / "plain.inp", tmp_path / "other.inp"
    plain.write_text(FLAT)
    other.write_bytes(FLAT.replace("a comment", "über").replace("\n", "\r\n").encode("latin-1"))
    a, b = read_target(plain), read_target(other)
    np.testing.assert_array_equal(a.points, b.points)
    assert a.cell_ids.tolist() == b.cell_ids.tolist()
    assert a.cell_sets.keys() == b.cell_sets.keys()


#: Nodes of one cell of each shape.
CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
WEDGE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
TETRA = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]


def middles(corners, edges):
    """Corners, and the middles of edges."""
    at = np.array(corners, dtype=float)
    return [*at, *[(at[a] + at[b]) / 2 for a, b in edges]]


HEXAHEDRON_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
                    (2, 6), (3, 7)]  # fmt: skip
WEDGE_EDGES = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
TETRA_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
QUAD_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0)]
TRIANGLE_EDGES = [(0, 1), (1, 2), (2, 0)]

#: Nodes of an element as the Abaqus Elements Guide numbers them, and what VTK calls the cell.
ELEMENTS = {
    "S3": (WEDGE[:3], "triangle"), "S3R": (WEDGE[:3], "triangle"),
    "STRI65": (middles(WEDGE[:3], TRIANGLE_EDGES), "triangle6"),
    "S6": (middles(WEDGE[:3], TRIANGLE_EDGES), "triangle6"),
    "S4": (CUBE[:4], "quad"), "S4R": (CUBE[:4], "quad"), "S4RSW": (CUBE[:4], "quad"),
    "M3D4R": (CUBE[:4], "quad"), "M3D3": (WEDGE[:3], "triangle"),
    "S8": (middles(CUBE[:4], QUAD_EDGES), "quad8"),
    "S8R": (middles(CUBE[:4], QUAD_EDGES), "quad8"),
    "S8R5": (middles(CUBE[:4], QUAD_EDGES), "quad8"),
    "SC6R": (WEDGE, "wedge"), "SC8R": (CUBE, "hexahedron"), "CSS8": (CUBE, "hexahedron"),
    "SC8RT": (CUBE, "hexahedron"),
    "C3D4": (TETRA, "tetra"), "C3D6": (WEDGE, "wedge"), "C3D8": (CUBE, "hexahedron"),
    "C3D8I": (CUBE, "hexahedron"), "C3D8R": (CUBE, "hexahedron"), "C3D8RH": (CUBE, "hexahedron"),
    "C3D10": (middles(TETRA, TETRA_EDGES), "tetra10"),
    "C3D10MH": (middles(TETRA, TETRA_EDGES), "tetra10"),
    "C3D15": (middles(WEDGE, WEDGE_EDGES), "wedge15"),
    "C3D20": (middles(CUBE, HEXAHEDRON_EDGES), "hexahedron20"),
    "C3D20R": (middles(CUBE, HEXAHEDRON_EDGES), "hexahedron20"),
}  # fmt: skip
#: VTK's edges of each shape: its mid-side nodes lie on them in this order.
VTK_EDGES = {"hexahedron": HEXAHEDRON_EDGES, "wedge": WEDGE_EDGES, "tetra": TETRA_EDGES,
             "quad": QUAD_EDGES, "triangle": TRIANGLE_EDGES}  # fmt: skip


def element_deck(element, nodes, first=11):
    lines = ["*NODE"]
    lines += [f"{first + 2 * k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(nodes)]
    listed = [str(first + 2 * k) for k in range(len(nodes))]
    rows = [", ".join(listed[at : at + 10]) for at in range(0, len(listed), 10)]
    return "\n".join([*lines, f"*ELEMENT, TYPE={element}", "99, " + ",\n".join(rows), ""])


@pytest.mark.parametrize("element", ELEMENTS)
def test_every_element_type_keeps_all_nodes_in_vtk_order(deck, element):
    nodes, name = ELEMENTS[element]
    target = read_target(deck(element_deck(element, nodes)))
    assert not target.notes
    ((found, cells),) = target.blocks
    assert found == name and target.cell_ids.tolist() == [99]
    placed = target.points[cells[0]]
    np.testing.assert_allclose(placed, nodes)
    shape = name.rstrip("0123456789")
    if len(nodes) > len(set(sum(VTK_EDGES[shape], ()))):
        ends = placed[np.array(VTK_EDGES[shape])]
        np.testing.assert_allclose(placed[-len(ends) :], ends.mean(axis=1))


@pytest.mark.parametrize("element", ["R3D4", "SFM3D4", "CONN3D2", "COH3D8", "T3D2", "CAX4", "U1"])
def test_elements_that_carry_no_textile_are_counted(deck, element):
    extra = f"*ELEMENT, TYPE={element}, ELSET=OTHER\n 900, 40, 3, 25, 7\n"
    target = read_target(deck(FLAT.replace("*ELEMENT, TYPE=B31", extra + "*ELEMENT, TYPE=B31", 1)))
    assert target.ignored == {element: 1, "B31": 1}


ASSEMBLY = """\
*Heading
** Job name: panel Model name: Model-1
*Part, name=Skin
*Node
      1,   0., 0., 0.
      2,   1., 0., 0.
      3,   1., 1., 0.
      4,   0., 1., 0.
*Element, type=S4R
1, 1, 2, 3, 4
*Nset, nset=_PickedSet2, internal, generate
 1,  4,  1
*Elset, elset=Set-1
 1,
*Shell Section, elset=Set-1, material=CFRP
1., 5
*End Part
*Part, name=Unused
*End Part
*Assembly, name=Assembly
*Instance, name=Skin-1, part=Skin
*End Instance
*Instance, name=Skin-2, part=Skin
 10., 0., 0.
 10., 0., 0., 10., 0., 1., 90.
*End Instance
*Node
      1,  50., 0., 0.
*Nset, nset=Edge, instance=Skin-2
 1, 4
*Nset, nset=Edge, instance=Skin-1
 2
*Elset, elset=Everything
 Skin-1.Set-1, Skin-2.1
*Nset, nset=RP
 1
*End Assembly
"""


def test_parts_and_instances(deck):
    """Instances are placed as Abaqus does: translation, then rotation about the axis."""
    target = read_target(deck(ASSEMBLY))
    assert target.cell_ids.tolist() == [1, 1]
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {
        "Skin-1": [0], "Skin-2": [1],
    }  # fmt: skip
    second = target.points[target.blocks[0][1][1]]
    np.testing.assert_allclose(second, [(10, 0, 0), (10, 1, 0), (9, 1, 0), (9, 0, 0)], atol=1e-12)
    assert target.cell_sets["Everything"].tolist() == [0, 1]
    assert target.cell_sets["Skin-2.Set-1"].tolist() == [1]
    np.testing.assert_allclose(
        target.points[target.node_sets["Edge"]], [(1, 0, 0), (10, 0, 0), (9, 0, 0)], atol=1e-12
    )
    np.testing.assert_allclose(target.points[target.node_sets["RP"]], [(50, 0, 0)])
    assert len(target.node_sets["Skin-1._PickedSet2"]) == 4
    assert any("Unused" in note for note in target.notes)
    assert any("numbers repeat in the instances" in note for note in target.notes)


def test_included_files_stand_where_they_are_named(tmp_path, deck):
    (tmp_path / "mesh").mkdir()
    (tmp_path / "mesh" / "nodes.txt").write_text("1, 0, 0, 0\n2, 1, 0, 0\n")
    (tmp_path / "mesh" / "cells.inc").write_text("*ELEMENT, TYPE=S3\n5, 1, 2, 3\n")
    path = deck(
        "*NODE, NSET=N\n*INCLUDE, INPUT=mesh/nodes.txt\n3, 0, 1, 0\n"
        '*include, input="mesh/cells.inc"\n*ELSET, ELSET=E\n5\n'
    )
    target = read_target(path)
    assert numbers(target, "N", nodes=True) == [1, 2, 3]
    assert numbers(target, "E") == [5]
    (tmp_path / "mesh" / "cells.inc").write_text("*ELEMENT, TYPE=S3\n\n5, 1, 2, x\n")
    with pytest.raises(InputError, match=r"cells.inc: line 3: .*no element"):
        read_target(path)
    (tmp_path / "mesh" / "cells.inc").write_text("*INCLUDE, INPUT=deck.inp\n")
    with pytest.raises(InputError, match="leads back"):
        read_target(path)


def test_a_deck_written_by_meshio_is_read_as_meshio_wrote_it(tmp_path, make):
    points, quads = make.grid(4, 3)
    triangles = make.triangles_of(quads[:6])
    mesh = meshio.Mesh(
        make.lifted(points), [("triangle", triangles), ("quad", quads[6:])],
        point_sets={"left": np.array([0, 5, 2])},
        cell_sets={"half": [np.arange(3), np.array([1])]},
    )  # fmt: skip
    mesh.write(tmp_path / "meshio.inp")
    target = read_target(tmp_path / "meshio.inp")
    np.testing.assert_array_equal(target.points, mesh.points)
    for (_, found), block in zip(target.blocks, mesh.cells, strict=True):
        np.testing.assert_array_equal(found, block.data)
    assert target.node_sets["left"].tolist() == [0, 2, 5]
    assert target.cell_sets["half"].tolist() == [0, 1, 2, 13]


NODES = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("\n \n", "the file is empty"),
        ("a text\n", "line 1: this is no keyword"),
        ("*NODE\n1, 0, 0, 0\0\n", "line 2: holds a zero byte"),
        ("*NODE\n1, 0, zero, 0\n", r'line 2: "1, 0, zero, 0" is no node'),
        (NODES, r"has no \*ELEMENT"),
        (NODES + "*ELEMENT\n1, 1, 2, 3\n", r"line 6: \*ELEMENT has no TYPE="),
        (NODES + "*ELEMENT, TYPE=S4\n7, 1, 2, 3\n", "line 7: .* has 3 of 4 nodes; .* cut off"),
        (NODES + "*ELEMENT, TYPE=S3\n7, 1, 2, 3, 4\n", "line 7: element 7 has more than 3 nodes"),
        (NODES + "*ELEMENT, TYPE=S3\n7, 1, 2, 9\n", "line 7: element 7 has node 9, which the file"),
        (NODES + "*ELEMENT, TYPE=S3\n7, 1, 2, 3\n7, 1, 2, 4\n", "line 8: element 7 had other nod"),
        (NODES + "1, 5, 0, 0\n*ELEMENT, TYPE=S3\n7, 1, 2, 3\n", "line 6: node 1 was at another"),
        (NODES + "*ELEMENT, TYPE=S3\n7, 1, 2, 3\n*NGEN\n1, 2\n", r"line 8: \*NGEN is not followed"),
        (NODES + "*ELEMENT, TYPE=B31\n7, 1, 2\n", "no shells or solids .*found: B31"),
        (NODES + "*INCLUDE, INPUT=absent.inc\n", "line 6: .*absent.inc, which does not exist"),
        ("*PART, NAME=A\n" + NODES, r"line 1: \*PART has no \*END PART; the file is cut off"),
        ("*INSTANCE, NAME=A, PART=B\n*END INSTANCE\n", "the part B, which the deck does not"),
        ("*NODE, SYSTEM=Q\n1, 0, 0, 0\n", "line 1: .*NODE has SYSTEM=Q; it may be R"),
        ("*SYSTEM\n0, 0, 0, 1\n0, 1\n0\n", "line 1: .*SYSTEM takes the origin"),
        ("*SYSTEM\n0, 0, 0, 1, 0, 0\n2, 0, 0\n", "line 1: .*SYSTEM has no three different axes"),
        ("*SYSTEM\n0, zero\n", "line 2: .*SYSTEM takes numbers"),
        ("*NODE, INPUT=absent.txt\n", "line 1: .*absent.txt, which does not exist"),
        (NODES + "*ELEMENT, TYPE=S3\n7, 1, 2, 2\n", r"no area \(element 7\)"),
    ],
)  # fmt: skip
def test_wrong_decks_name_the_line_and_the_remedy(deck, text, words):
    with pytest.raises(InputError, match=words):
        read_target(deck(text))


ONE_SHELL = NODES + "*ELEMENT, TYPE=S4, ELSET=SKIN\n1, 1, 2, 3, 4\n"


def test_sets_of_left_out_elements_keep_their_nodes(deck):
    text = ONE_SHELL + (
        "*ELEMENT, TYPE=B31, ELSET=STIFF\n2, 1, 2\n*ELEMENT, TYPE=R3D3\n3, 2,\n3, 4\n"
        "*ELSET, ELSET=ALL\nSKIN, STIFF\n*ELSET, ELSET=RIGID\n3\n"
    )
    target = read_target(deck(text))
    assert {name: rows.tolist() for name, rows in target.cell_sets.items()} == {
        "SKIN": [0], "ALL": [0],
    }  # fmt: skip
    assert numbers(target, "STIFF", nodes=True) == numbers(target, "ALL", nodes=True) == [1, 2]
    assert numbers(target, "RIGID", nodes=True) == [2, 3, 4]
    assert target.ignored == {"B31": 1, "R3D3": 1}
    (note,) = target.notes
    assert note.endswith("kept as the sets of their nodes: STIFF, ALL, RIGID")


def test_a_node_set_takes_the_nodes_of_an_element_set(deck):
    text = ONE_SHELL + (
        "*ELEMENT, TYPE=MASS, ELSET=M\n2, 3\n*NSET, NSET=REF, ELSET=M\n"
        "*NSET, NSET=skin, ELSET=SKIN\n"
    )
    target = read_target(deck(text))
    assert numbers(target, "REF", nodes=True) == [3]
    assert numbers(target, "skin", nodes=True) == [1, 2, 3, 4]


def test_undefined_members_are_named_and_take_nothing_with_them(deck):
    text = ONE_SHELL + (
        "*ELSET, ELSET=A\nGONE, 1\n*NSET, NSET=N\nLOST, 2\n*NSET, NSET=P, INSTANCE=NONE\n3\n"
        "*SURFACE, NAME=TOP\nSKIN, SPOS\nAWAY, SPOS\n*SURFACE, NAME=POINTS, TYPE=NODE\nNO,\n"
    )
    target = read_target(deck(text))
    assert numbers(target, "A") == [1]
    assert numbers(target, "N", nodes=True) == [2]
    assert numbers(target, "P", nodes=True) == []
    assert numbers(target, "TOP", nodes=True) == [1, 2, 3, 4]
    assert "POINTS" not in target.node_sets
    assert any(n.endswith("not kept: POINTS") for n in target.notes)
    (note,) = [n for n in target.notes if "the deck does not define" in n]
    for what in ("set GONE (line 9)", "set LOST (line 11)", "instance NONE (line 13)",
                 "set AWAY (line 16)", "set NO (line 18)"):  # fmt: skip
        assert what in note


TWO_SHELLS = (
    NODES + "5, 2, 0, 0\n*ELEMENT, TYPE=S4\n10, 1, 2, 3, 4\n*ELEMENT, TYPE=S3\n12, 2, 5, 3\n"
)


def test_ranges_hold_the_numbers_that_exist_and_say_where_they_go_past_them(deck):
    """Other programs write the range of all numbers there may be; it is not written out."""
    text = TWO_SHELLS + (
        "*ELEMENT, TYPE=B31\n20, 1, 2\n"
        "*NSET, NSET=ALL, GENERATE\n1, 999999999999999999\n*NSET, NSET=ODD, GENERATE\n-1, 5, 2\n"
        "*ELSET, ELSET=MOST, GENERATE\n10, 20\n*ELSET, ELSET=NONE, GENERATE\n100, 200, 10\n"
        "*NSET, NSET=RIGHT, GENERATE\n2, 5, 3\n"
    )
    target = read_target(deck(text))
    assert numbers(target, "ALL", nodes=True) == [1, 2, 3, 4, 5]
    assert numbers(target, "ODD", nodes=True) == [1, 3, 5]
    assert numbers(target, "RIGHT", nodes=True) == [2, 5]
    assert sorted(numbers(target, "MOST")) == [10, 12]
    assert numbers(target, "MOST", nodes=True) == [1, 2]
    assert numbers(target, "NONE") == []
    (past,) = [note for note in target.notes if "go past the numbers" in note]
    assert past.endswith(
        ": ALL (1 to 999999999999999999, line 14), ODD (-1 to 5, line 16), "
        "NONE (100 to 200, line 20)"
    )
    (gaps,) = [note for note in target.notes if "does not have" in note]
    assert gaps.endswith(": MOST (8)")  # 11 and 13 to 19


def test_an_entry_of_a_set_that_cannot_be_read_takes_nothing_with_it(deck):
    text = TWO_SHELLS + (
        "*ELSET, ELSET=A, GENERATE\n7, 1\n10, 10\n*ELSET, ELSET=B, GENERATE\n1, last\n"
        "*NSET, NSET=C\n1, , 2\n3\n*ELSET, ELSET=D\nD, 12\n"
    )
    target = read_target(deck(text))
    assert numbers(target, "A") == [10] and numbers(target, "D") == [12]
    assert numbers(target, "B") == [] and numbers(target, "C", nodes=True) == [3]
    (note,) = target.notes
    assert note == (
        "entries of sets that cannot be read are left out: A (line 12: no range of numbers: 7 to 1 "
        "by 1), B (line 15: GENERATE takes first, last and increment), C (line 17: an entry of the "
        "set is empty), D (line 20: it lists itself)"
    )


def test_surfaces_that_are_no_faces_are_named(deck):
    text = TWO_SHELLS + (
        "*SURFACE, NAME=DRUM, TYPE=CYLINDER\n0, 0, 0, 1, 0, 0\n"
        "*SURFACE, NAME=BOTH, COMBINE=UNION\nDRUM, DRUM\n"
    )
    assert read_target(deck(text)).notes == ("surfaces of the deck that are not kept: DRUM, BOTH",)


ANGLES = "1, 2, 30, 5\n2, 2, 90, 5\n3, 1, 90, 5\n"


@pytest.mark.parametrize(
    ("system", "kind", "expected"),
    [
        ("", "C", [(3**0.5, 1, 5), (0, 2, 5), (0, 1, 5)]),
        ("*SYSTEM\n0, 2, 3\n", "Cylindrical", [(3**0.5, 3, 8), (0, 4, 8), (0, 3, 8)]),
        # the x axis along y of the deck, projected onto its plane of x and y
        ("*SYSTEM\n0, 0, 0, 0, 3, 9\n", "C", [(-1, 3**0.5, 5), (-2, 0, 5), (-1, 0, 5)]),
        # x along z, y along x, so that z is along y
        ("*SYSTEM\n0, 0, 1, 0, 0, 4\n3, 0, 7\n", "C", [(1, 5, 1 + 3**0.5), (2, 5, 1), (1, 5, 1)]),
        ("*SYSTEM\n0, 0, 1\n*SYSTEM\n", "R", [(2, 30, 5), (2, 90, 5), (1, 90, 5)]),
    ],
    ids=["cylindrical", "moved", "turned about z", "turned", "back to the deck's"],
)  # fmt: skip
def test_nodes_in_cylindrical_coordinates_and_local_systems(deck, system, kind, expected):
    text = f"{system}*NODE, SYSTEM={kind}\n{ANGLES}*ELEMENT, TYPE=S3\n1, 1, 2, 3\n"
    target = read_target(deck(text))
    np.testing.assert_allclose(target.points, expected, atol=1e-12)
    assert not target.notes


def test_spherical_coordinates_count_phi_from_the_plane_of_x_and_y(deck):
    text = (
        "*NODE, SYSTEM=S\n1, 2, 90, 30\n2, 2, 0, 0\n3, 2, 45, 90\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n"
    )
    target = read_target(deck(text))
    np.testing.assert_allclose(target.points, [(0, 3**0.5, 1), (2, 0, 0), (0, 0, 2)], atol=1e-12)
    assert target.notes == (
        "the nodes of line 1 are given in spherical coordinates: read as radius, angle about z "
        "from x, and angle from the plane of x and y",
    )


def test_a_local_system_ends_with_its_part_and_moves_with_its_instance(deck):
    part = (
        "*PART, NAME={0}\n{1}*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n"
        "*ELEMENT, TYPE=S3\n1, 1, 2, 3\n*END PART\n"
    )
    text = part.format("A", "*SYSTEM\n0, 0, 5, 0, 1, 5\n") + part.format("B", "") + (
        "*ASSEMBLY, NAME=M\n*INSTANCE, NAME=a, PART=A\n100, 0, 0\n*END INSTANCE\n"
        "*INSTANCE, NAME=b, PART=B\n*END INSTANCE\n*END ASSEMBLY\n"
    )  # fmt: skip
    target = read_target(deck(text))
    expected = [(100, 0, 5), (100, 1, 5), (99, 0, 5), (0, 0, 0), (1, 0, 0), (0, 1, 0)]
    np.testing.assert_allclose(target.points, expected, atol=1e-12)


def test_data_lines_of_other_files_are_read(tmp_path, deck):
    (tmp_path / "mesh").mkdir()
    (tmp_path / "mesh" / "nodes.txt").write_text(
        "** nodes\n1, 1, 0, 0\n\n2, 1, 90, 0\n3, 1, 180, 0\n"
    )
    (tmp_path / "mesh" / "cells.txt").write_text("7, 1,\n 2, 3\n")
    (tmp_path / "mesh" / "rim.txt").write_text("1\n3\n")
    path = deck(
        "*NODE, SYSTEM=C, INPUT=mesh/nodes.txt, NSET=N\n"
        '*ELEMENT, TYPE=S3, INPUT="mesh\\cells.txt", ELSET=E\n*NSET, NSET=RIM, INPUT=mesh/rim.txt\n'
    )
    target = read_target(path)
    np.testing.assert_allclose(target.points, [(1, 0, 0), (0, 1, 0), (-1, 0, 0)], atol=1e-12)
    assert numbers(target, "E") == [7]
    assert numbers(target, "N", nodes=True) == [1, 2, 3]
    assert numbers(target, "RIM", nodes=True) == [1, 3]
    (tmp_path / "mesh" / "cells.txt").write_text("\n7, 1, x, 3\n")
    with pytest.raises(InputError, match=r"cells.txt: line 2: .*no element"):
        read_target(path)
    (tmp_path / "mesh" / "cells.txt").write_text("*ELEMENT, TYPE=S3\n7, 1, 2, 3\n")
    with pytest.raises(InputError, match=r"cells.txt: line 1: .*is a keyword, .*name .*INCLUDE"):
        read_target(path)


def test_exponents_of_fortran_are_numbers(deck):
    text = "*NODE\n1, 0.0D0, 0., 0.\n2, 1.0D+1, 0., 0.\n3, 1.d1, 1.0+1, -.5-1\n"
    target = read_target(deck(text + "*ELEMENT, TYPE=S3\n1, 1, 2, 3\n"))
    assert target.points.tolist() == [[0, 0, 0], [10, 0, 0], [10, 10, -0.05]]


def test_definitions_that_repeat_themselves_count_once(deck):
    text = NODES + "1, 0, 0, 0\n*ELEMENT, TYPE=S3\n7, 1, 2, 3\n7, 1, 2, 3\n8, 1, 3, 4\n"
    target = read_target(deck(text))
    assert target.cell_ids.tolist() == [7, 8]
    assert target.node_ids.tolist() == [1, 2, 3, 4]
