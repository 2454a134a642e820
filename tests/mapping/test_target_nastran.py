"""Nastran bulk data as targets: numbers, properties, sets, coordinate systems and all formats."""

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target

# Small, large and free fields, numbers that are not sorted, reals without E, a continuation
# without a mark, comments of preprocessors, and case control sets with THRU and EXCEPT.
DECK = """\
SOL 101
CEND
$ a comment
SET 1 = 10,20 THRU 40,
 EXCEPT 30, 90
SET 2 = 7 THRU 9
SET 3 = 7
SET 4 = ALL
$HMSET        2        2 "wing root"
$HMSET        3        1 "not a node"
DISPLACEMENT(PLOT) = 1
STRESS = 2
SUBCASE 1
  LOAD = 5
BEGIN BULK
$HMNAME PROP                   3"Skin"  3
PSHELL         3       1     1.0       1
PSHELL,4,1,1.5
GRID          10             0.0     0.0      0.
GRID          20              1.      0.      0.
GRID*                 30                            1.+0             1.0
*                    0.0
GRID,40,,0.0,1.0,5.-4
GRID          90              2.     0.0     0.0 $ at the tip
GRID          80             2.0      1.     0.0
GRID         999              9.      9.      9.
CQUAD4         7       3      10      20      30      40     0.0
CTRIA3,9,4,20,90,80
CTRIA3*                8               4              20              80
*                     30
CBAR          60       5      10      20      0.      0.      1.
CONM2,61,10,,1.0
RBE2          62      10  123456      20
SET1          11      10    THRU      40
SET3          12    ELEM       7       9
ENDDATA
"""


@pytest.fixture
def deck(tmp_path):
    """Write a deck and return its path."""

    def write(text, name="deck.bdf"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def test_numbers_properties_and_sets(deck):
    target = read_target(deck(DECK), length_unit="mm")
    assert target.node_ids.tolist() == [10, 20, 30, 40, 90, 80, 999]
    assert sorted(target.cell_ids.tolist()) == [7, 8, 9]
    nodes = {}
    first = 0
    for _, cells in target.blocks:
        for row, cell in enumerate(cells):
            nodes[int(target.cell_ids[first + row])] = target.node_ids[cell].tolist()
        first += len(cells)
    assert nodes == {7: [10, 20, 30, 40], 9: [20, 90, 80], 8: [20, 80, 30]}
    np.testing.assert_allclose(target.points[2:4], [[1e-3, 1e-3, 0], [0, 1e-3, 5e-7]])
    parts = {name: set(target.cell_ids[rows].tolist()) for name, rows in target.parts.items()}
    assert parts == {"Skin": {7}, "property 4": {8, 9}}
    cells = {name: set(target.cell_ids[rows].tolist()) for name, rows in target.cell_sets.items()}
    assert cells == {"wing root": {7, 8, 9}, "SET 4": {7, 8, 9}, "SET 12": {7, 9}}
    of_nodes = {n: set(target.node_ids[rows].tolist()) for n, rows in target.node_sets.items()}
    assert of_nodes == {
        "SET 1": {10, 20, 40, 90}, "not a node": set(), "SET 4": set(target.node_ids.tolist()),
        "SET 11": {10, 20, 30, 40}, "property 5": {10, 20},
    }  # fmt: skip
    assert target.ignored == {"CBAR": 1, "CONM2": 1, "RBE2": 1}
    (doubtful,) = [note for note in target.notes if "nodes or elements" in note]
    assert "SET 4, SET 11" in doubtful
    # gaps in a range are none of the set's faults
    assert any(note.endswith("not defined: not a node (1)") for note in target.notes)


def test_bulk_data_alone_are_a_deck_too(deck):
    bulk = DECK.partition("BEGIN BULK\n")[2].replace("ENDDATA\n", "")
    target = read_target(deck(bulk, "bulk.nas"))
    assert sorted(target.cell_ids.tolist()) == [7, 8, 9]
    assert not any("ENDDATA" in note for note in target.notes)
    cut_off = read_target(deck(DECK.replace("ENDDATA\n", "")))
    assert any("does not end with ENDDATA" in note for note in cut_off.notes)


CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
WEDGE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
PYRAMID = [*CUBE[:4], (0.5, 0.5, 1)]
TETRA = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
#: Edges in the order in which the Quick Reference Guide draws the mid-side nodes, and VTK's.
QUADRATIC = {
    "CHEXA": (
        CUBE, "hexahedron20",
        [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7),
         (7, 4)],
        [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6),
         (3, 7)],
    ),
    "CPENTA": (
        WEDGE, "wedge15",
        [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)],
        [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    ),
    "CTETRA": (
        TETRA, "tetra10", [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
        [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    ),
    "CPYRAM": (
        PYRAMID, "pyramid13",
        [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
        [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
    ),
    "CQUAD8": (CUBE[:4], "quad8", [(0, 1), (1, 2), (2, 3), (3, 0)],
               [(0, 1), (1, 2), (2, 3), (3, 0)]),
    "CTRIA6": (WEDGE[:3], "triangle6", [(0, 1), (1, 2), (2, 0)], [(0, 1), (1, 2), (2, 0)]),
}  # fmt: skip


def element_deck(name, nodes, listed=None):
    lines = [f"GRID,{5 + 3 * k},,{x},{y},{z}" for k, (x, y, z) in enumerate(nodes)]
    fields = ["77", "2", *(listed or [str(5 + 3 * k) for k in range(len(nodes))])]
    rows = [fields[at : at + 8] for at in range(0, len(fields), 8)]
    cards = [name.ljust(8) + "".join(field.rjust(8) for field in rows[0])]
    cards += ["+       " + "".join(field.rjust(8) for field in row) for row in rows[1:]]
    return "\n".join([*lines, *cards, ""])


@pytest.mark.parametrize("name", QUADRATIC)
def test_mid_side_nodes_come_in_vtk_order(deck, name):
    corners, kind, edges, vtk_edges = QUADRATIC[name]
    at = np.array(corners, dtype=float)
    nodes = [*corners, *[tuple((at[a] + at[b]) / 2) for a, b in edges]]
    target = read_target(deck(element_deck(name, nodes)))
    ((found, cells),) = target.blocks
    assert found == kind and target.cell_ids.tolist() == [77]
    placed = target.points[cells[0]]
    np.testing.assert_allclose(placed[: len(corners)], corners)
    np.testing.assert_allclose(placed[len(corners) :], [(at[a] + at[b]) / 2 for a, b in vtk_edges])
    assert target.parts["property 2"].tolist() == [0]

    linear = read_target(deck(element_deck(name, corners)))
    assert linear.blocks[0][0] == kind.rstrip("0123456789")
    assert not linear.notes
    some = [str(5 + 3 * k) for k in range(len(nodes))]
    some[-1] = ""
    partly = read_target(deck(element_deck(name, nodes, some)))
    assert partly.blocks[0][0] == kind.rstrip("0123456789")
    assert any("1 elements have some of their mid-side nodes" in note for note in partly.notes)


def test_nodes_in_local_coordinate_systems(deck):
    """A cylinder whose axis is the global y, in a system that is itself turned."""
    text = (
        "CORD2R,5,,1.,0.,0.,1.,1.,0.,\n+,1.,0.,1.\n"
        "CORD2C         6       5     0.0     0.0     0.0     0.0     0.0     1.0+\n"
        "+            1.0     0.0     0.0\n"
        "CORD2S,7,,0.,0.,0.,0.,0.,1.,\n+,1.,0.,0.\n"
        "CORD1R,8,1,2,3\n"
        "GRID,1,5,0.,0.,0.\nGRID,2,6,2.,90.,3.\nGRID,3,7,2.,60.,30.\n"
        "GRID,4,8,0.,0.,1.\nCTRIA3,1,1,1,2,3\n"
    )
    points = read_target(deck(text)).points
    np.testing.assert_allclose(points[0], [1, 0, 0], atol=1e-12)
    # z' = y, x' = z, y' = x; 90 degrees about z' from x' is y'
    np.testing.assert_allclose(points[1], [1 + 2, 3, 0], atol=1e-12)
    np.testing.assert_allclose(points[2], [1.5, 0.75**0.5, 1], atol=1e-12)
    z = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    np.testing.assert_allclose(points[3], points[0] + z, atol=1e-12)


@pytest.mark.parametrize("point_format", ["fixed-small", "fixed-large", "free"])
def test_decks_written_by_meshio(tmp_path, make, point_format):
    points, quads = make.grid(5, 4)
    lifted = make.bowl(points, 0.4)
    mesh = meshio.Mesh(
        lifted, [("triangle", make.triangles_of(quads[:8])), ("quad", quads[8:])]
    )  # fmt: skip
    file = tmp_path / "meshio.bdf"
    meshio.nastran.write(file, mesh, point_format=point_format, cell_format="fixed-small")
    target = read_target(file)
    np.testing.assert_allclose(
        target.points, lifted, atol=1e-4 if "small" in point_format else 1e-11
    )
    for (_, found), block in zip(target.blocks, mesh.cells, strict=True):
        np.testing.assert_array_equal(found, block.data)
    assert target.cell_ids.tolist() == list(range(1, 29))
    assert not target.parts  # meshio leaves the property blank


# Written by pyNastran 1.4.1 (write_bdf with size=16), blanks at the ends of lines stripped.
PYNASTRAN = """\
$pyNastran: version=msc
$pyNastran: punch=True
$pyNastran: encoding=utf-8
$pyNastran: nnodes=5
$pyNastran: nelements=2
$NODES
GRID*                  4                              1.              0.
*                     0.
GRID*                  6                              0.              1.
*                     0.
GRID*                 12                              0.              0.
*                     0.
GRID*                 31                              1.              1.
*                .000001
GRID*                 77                             2.5             -.5
*                     0.
$ELEMENTS
CTRIA3       100       4       4      77      31
CQUAD4*              200               3              12               4
*                     31               6
$PROPERTIES
PSHELL*                3               1              1.               1
*
PSHELL*                4               1              2.               1
*
$MATERIALS
MAT1*                  1          70000.                             .33
*
$SETS
SET1*                  8             100
*
SET3           9    GRID       6      12
"""


def test_a_deck_written_by_pynastran(deck):
    target = read_target(deck(PYNASTRAN))
    assert [(name, len(cells)) for name, cells in target.blocks] == [("triangle", 1), ("quad", 1)]
    assert target.cell_ids.tolist() == [100, 200]
    assert target.node_ids[target.blocks[1][1]].tolist() == [[12, 4, 31, 6]]
    assert target.points[target.node_ids.tolist().index(31)].tolist() == [1.0, 1.0, 1e-6]
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {
        "property 3": [1], "property 4": [0],
    }  # fmt: skip
    assert target.cell_sets["SET 8"].tolist() == [0]
    assert target.node_ids[target.node_sets["SET 9"]].tolist() == [6, 12]


GRIDS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("CTRIA3,1,1,1,2,3\n", "has no GRID"),
        (GRIDS, "the mesh has no cells to map onto"),
        (GRIDS + "CTRIA3,1,1,1,2,9\n", "line 4: element 1 has node 9, which the file"),
        (GRIDS + "CTRIA3,1,1,1,2,x\n", 'line 4: field 6 of CTRIA3 is "x", not a number'),
        (GRIDS + "CTRIA3,1,1,1,2\n", "line 4: field 6 of CTRIA3"),
        (GRIDS + "GRID,4,,one,0.,0.\n", 'line 4: field 4 of GRID is "one"'),
        (GRIDS + "GRID,1,,5.,0.,0.\nCTRIA3,1,1,1,2,3\n", "line 4: node 1 was at another place"),
        (GRIDS + "CTRIA3,1,1,1,2,3\nCTRIA3,1,1,1,3,2\n", "element 1 had other nodes"),
        (GRIDS + "GRID,4,8,0.,0.,0.\nCTRIA3,1,1,1,2,3\n", "line 4: .* coordinate system 8, which"),
        (GRIDS + "CORD2R,8,8,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.\nGRID,4,8,0.,0.,0.\n", "by itself"),
        (GRIDS + "CORD2R,8,,0.,0.,0.,0.,0.,1.\n+,0.,0.,2.\nGRID,4,8,0.,0.,0.\n", "different axes"),
        ("+       1\n" + GRIDS, "line 1: continues an entry, but there is none"),
        ("INCLUDE 'absent.bdf'\n" + GRIDS, "line 1: INCLUDE names absent.bdf, which does not"),
        ("CEND\nSET 1 = 5 THRU x\nSTRESS=1\nBEGIN BULK\n" + GRIDS, "no cells|is no number"),
        (GRIDS + "CTRIA3,1,1,1,2,2\n", r"no area \(element 1\)"),
    ],
)
def test_wrong_decks_name_the_line_and_the_remedy(deck, text, words):
    with pytest.raises(InputError, match=words):
        read_target(deck(text))


#: Two rows of four nodes, the lower 1 to 4, the upper 11 to 14.
ROWS = "".join(
    f"GRID,{10 * j + i + 1},,{10.0 * i},{10.0 * j},0.\n" for j in range(2) for i in range(4)
)


@pytest.mark.parametrize(
    "replication",
    [
        "CQUAD4,1,1,1,2,12,11\n=,*1,=,*1,*1,*1,*1\n=1\n",
        "CQUAD4,1,1,1,2,12,11\n=,*(1),=,*(1),*1,*1,*1\n=(1)\n",
        "CQUAD4         1       1       1       2      12      11\n"
        "=             *1       =      *1      *1      *1      *1\n=1\n",
        "CQUAD4*                1               1               1               2\n"
        "*                     12              11\n=,*1,=,*1,*1,*1,*1\n=1\n",
    ],
    ids=["free", "parentheses", "small-field", "large-field"],
)
def test_replication_makes_the_entries_that_it_stands_for(deck, replication):
    target = read_target(deck("BEGIN BULK\n" + ROWS + replication + "ENDDATA\n"))
    assert target.cell_ids.tolist() == [1, 2, 3]
    ((_, cells),) = target.blocks
    expected = [[1, 2, 12, 11], [2, 3, 13, 12], [3, 4, 14, 13]]
    assert target.node_ids[cells].tolist() == expected
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {"property 1": [0, 1, 2]}


def test_nodes_are_replicated_with_exact_increments_of_reals(deck):
    """The example of the Quick Reference Guide: == repeats what follows, =3 makes three more."""
    text = "GRID,101,,1.0,1.05+1,,,3456\n=,*1,=,*0.2,*(0.1),==$\n=3\nCTRIA3,1,1,101,103,110\n"
    target = read_target(deck(text + "GRID,110,,0.,0.,0.\n"))
    assert target.node_ids.tolist() == [101, 102, 103, 104, 105, 110]
    expected = [[1.0, 10.5], [1.2, 10.6], [1.4, 10.7], [1.6, 10.8], [1.8, 10.9]]
    assert target.points[:5, :2].tolist() == expected
    assert not target.points[:, 2].any()


@pytest.mark.parametrize(
    "second", ["=,*1,=,*4,*4,*4,*4,*4,*4\n,*4,*4\n",
               "=             *1       =      *4      *4      *4      *4      *4      *4*1\n"
               "*1            *4      *4\n"],
)  # fmt: skip
def test_continuations_are_replicated_too(deck, second):
    layers = [(x, y, z) for z in range(3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    grids = "".join(f"GRID,{k + 1},,{x}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(layers))
    target = read_target(deck(grids + "CHEXA,1,1,1,2,3,4,5,6\n,7,8\n" + second))
    ((name, cells),) = target.blocks
    assert (name, target.cell_ids.tolist()) == ("hexahedron", [1, 2])
    assert target.node_ids[cells].tolist() == [
        [1, 2, 3, 4, 5, 6, 7, 8],
        [5, 6, 7, 8, 9, 10, 11, 12],
    ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("=,*1,=\n" + GRIDS, "line 1: .* there is none before"),
        (GRIDS + "CTRIA3,1,1,1,2,3\n=2\n", "line 5: =2 repeats an entry with increments, but"),
        (GRIDS + "CTRIA3,1,1,1,2,3\n=x,*1\n", 'line 5: "=X" replicates an entry, but is no ='),
        (GRIDS + "CTRIA3,1,,1,2,3\n=,*1,*1,=,=,=\n", 'line 5: field 3 of CTRIA3 is "\\*1"'),
        (GRIDS + "CTRIA3,1,1,1,2,3\n=,*1,=,=,=,*1\n", "line 5: element 2 has node 4, which"),
    ],
)
def test_a_replication_of_nothing_names_its_line(deck, text, words):
    with pytest.raises(InputError, match=words):
        read_target(deck(text))


def test_a_replication_of_what_is_not_read_stands_in_nobodys_way(deck):
    text = (
        GRIDS + "PSHELL,1,1,,2\n=,*1,=,*0.1,=\n=4\nDEQATN  7       f(a,b)=a+b\nCTRIA3,1,1,1,2,3\n"
    )
    assert read_target(deck(text)).cell_ids.tolist() == [1]


def test_sets_of_a_deck_without_begin_bulk_are_read(deck):
    text = (
        "SET 1 = 1,\n        2\nSET 2 = 2 THRU 3\nSTRESS = 1\nDISPLACEMENT(PLOT) = 2\n" + GRIDS
        + "GRID,4,,0.,1.,0.\nCTRIA3,1,1,1,2,3\nCTRIA3,2,1,1,3,4\nENDDATA\n"
    )  # fmt: skip
    target = read_target(deck(text))
    assert {name: rows.tolist() for name, rows in target.cell_sets.items()} == {"SET 1": [0, 1]}
    assert {name: rows.tolist() for name, rows in target.node_sets.items()} == {"SET 2": [1, 2]}
    assert not target.notes


def test_line_elements_keep_their_nodes_in_sets_and_properties(deck):
    text = (
        "CEND\nSET 1 = 7, 1\nSET 2 = 8\nSTRESS = 1\nFORCE = 2\nBEGIN BULK\n"
        "$HMNAME PROP                  10\"Gate\"\n" + GRIDS
        + "CBAR,7,10,1,2,0.,0.,1.\nCELAS1,8,11,3,1,2,1\nCTRIA3,1,1,1,2,3\nENDDATA\n"
    )  # fmt: skip
    target = read_target(deck(text))
    of_nodes = {n: target.node_ids[rows].tolist() for n, rows in target.node_sets.items()}
    assert of_nodes == {
        "SET 1": [1, 2], "SET 2": [2, 3], "Gate": [1, 2], "property 11": [2, 3],
    }  # fmt: skip
    assert {name: rows.tolist() for name, rows in target.cell_sets.items()} == {"SET 1": [0]}
    assert target.ignored == {"CBAR": 1, "CELAS1": 1}
    assert any("kept as the sets of their nodes: Gate, property 11" in n for n in target.notes)


def test_a_set_that_cannot_be_read_takes_no_other_with_it(deck):
    text = GRIDS + "CTRIA3,1,1,1,2,3\nSET1,5,1,THRU,x\nSET3,6,ELEM,1\n"
    target = read_target(deck(text))
    assert list(target.cell_sets) == ["SET 6"]
    assert any(n.startswith('SET 5 is left out: line 5: "X" is no number') for n in target.notes)


def test_elements_of_every_kind_that_is_no_cell_are_counted(deck):
    text = GRIDS + (
        "CTRIA3,1,1,1,2,3\nCHBDYG,11,,AREA3,,,,,\n,1,2,3\nCHBDYE,12,1,1\nCHBDYP,13,9,LINE,,,1,3\n"
        "CHBDYE,14,1,2\nCMASS2,15,1.,2,1\nPLOTEL3,16,1,2,3\nSET3,1,ELEM,11\nSET3,2,ELEM,13,15\n"
        "CONV,11,1,,,99\nCREEP,1,1.\nCORD3G,5\n"
    )
    target = read_target(deck(text))
    assert target.ignored == {
        "CHBDYG": 1, "CHBDYE": 2, "CHBDYP": 1, "CMASS2": 1, "PLOTEL3": 1,
    }  # fmt: skip
    of_nodes = {n: target.node_ids[rows].tolist() for n, rows in target.node_sets.items()}
    assert of_nodes == {"SET 1": [1, 2, 3], "SET 2": [1, 2, 3], "property 9": [1, 3]}
    assert len(target.notes) == 2  # of the sets and of the property


def test_entries_that_may_be_elements_are_named(deck):
    text = GRIDS + "CTRIA3,1,1,1,2,3\nCNEW8,5,1,1,2\nCNEW8,6,1,2,3\n"
    assert read_target(deck(text)).notes == (
        "entries that may be elements and are not known are left out: CNEW8 (2)",
    )


def test_sets_of_other_things_are_named(deck):
    text = GRIDS + (
        'CTRIA3,1,1,1,2,3\n$HMSET       4        5 "plies"\nSET3,3,PROP,1\nSET,4,PROP,LIST\n,1\n'
        "SET,5,ELEM,RANGE\n,1,2\nSET,6,ELEM,LIST\n,1\n"
    )
    target = read_target(deck(text))
    assert list(target.cell_sets) == ["SET 6"]
    assert target.notes == (
        "sets of other things than nodes and elements, or not given as a list, are left out: "
        "SET 3 (PROP), plies (PROP LIST), SET 5 (ELEM RANGE)",
    )


def test_included_files_are_read(tmp_path, deck):
    (tmp_path / "grids.bdf").write_text(GRIDS)
    path = deck("BEGIN BULK\nINCLUDE 'gri\nds.bdf'\nCTRIA3,1,1,1,2,3\nENDDATA\n")
    assert read_target(path).cell_ids.tolist() == [1]
    (tmp_path / "grids.bdf").write_text(GRIDS + "GRID,4,,x,,\n")
    with pytest.raises(InputError, match=r"grids.bdf: line 4: field 4 of GRID"):
        read_target(path)
