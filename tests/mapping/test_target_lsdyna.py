"""Keyword decks of LS-DYNA as targets and tools: columns and commas, squeezed elements, sets.

What Gmsh writes is read in test_target_universal.py.
"""

import warnings

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from lcmchain.errors import InputError
from lcmchain.mapping import read_target
from lcmchain.mesh_files.readers.decks.lsdyna import _TURNS, solid_of_eight
from lcmchain.tools import ToolWarning
from lcmchain.tools.surfaces.reading import read_triangles

PLACES = [(0.0, 0.0, 0.0), (20.0, 0.0, -1.5), (20.0, 20.0, 0.0), (0.0, 20.0, 0.0), (-1e-20, 5.0, 9)]


def columns(width, *numbers):
    return "".join(f"{number:{width}d}" for number in numbers)


def nodes(number_width=8, place_width=16, first=1, end="\n"):
    return "".join(
        columns(number_width, first + k) + "".join(f"{x:{place_width}.9g}" for x in place) + end
        for k, place in enumerate(PLACES)
    )


BIG = 12_345_670  # fills its eight columns: numbers touch each other
SETS = (
    "*SET_NODE_LIST_TITLE\nINLET GATE\n$#     sid\n         1       0.0\n"
    f"{columns(10, BIG + 1, BIG + 2)}\n"
    "*SET_NODE_ADD\n         2\n         1         3\n"
    f"*SET_NODE_COLUMN\n         3\n{columns(10, BIG + 5)}\n{columns(10, 99)}\n"
    f"*SET_SHELL_LIST_GENERATE_TITLE\nrange\n         7\n{columns(10, 1, BIG, 0, 0)}\n"
    "*SET_PART_LIST_TITLE\nboth parts\n         8\n         4         5\n"
    f"*SET_SEGMENT\n         9\n{columns(10, BIG + 1, BIG + 2, BIG + 3, BIG + 3)}       1.0\n"
    "*SET_BEAM_TITLE\nstiffener\n         3\n         6\n"
    "*SET_NODE_GENERAL\n        11\nPART               4\n"
)
STANDARD = (
    "$# a comment\n*KEYWORD\n*TITLE\na title\n*PART\nply above\n         4         1         1\n"
    "a part, with a comma\n         5         1         1\n"
    f"*NODE\n$#   nid               x\n{nodes(first=BIG + 1)}"
    f"*ELEMENT_SHELL_THICKNESS_OFFSET\n"
    f"{columns(8, BIG, 4, BIG + 1, BIG + 2, BIG + 3, BIG + 4)}\n{4 * '             1.0'}\n"
    "             0.5\n"
    f"{columns(8, 3, 5, BIG + 1, BIG + 2, BIG + 5, BIG + 5)}\n\n{3 * '             1.0'}\n"
    "             0.5\n"
    f"*ELEMENT_BEAM\n{columns(8, 6, 5, BIG + 3, BIG + 4, BIG + 1)}\n{SETS}*END\n*NODE\n  what\n"
)  # fmt: skip


def test_parts_and_sets_of_columns_that_touch(tmp_path):
    (tmp_path / "part.k").write_text(STANDARD)
    target = read_target(tmp_path / "part.k", length_unit="mm")
    np.testing.assert_allclose(target.points, 1e-3 * np.array(PLACES), atol=1e-15)
    assert [(name, table.tolist()) for name, table in target.blocks] == [
        ("quad", [[0, 1, 2, 3]]), ("triangle", [[0, 1, 4]]),
    ]  # fmt: skip
    assert target.cell_ids.tolist() == [BIG, 3]
    assert target.node_ids.tolist() == [BIG + k for k in range(1, 6)]
    parts = {name: rows.tolist() for name, rows in target.parts.items()}
    assert parts == {"ply above": [0], "a part, with a comma": [1]}
    cells = {name: rows.tolist() for name, rows in target.cell_sets.items()}
    assert cells == {"range": [0, 1], "both parts": [0, 1]}
    kept = {name: rows.tolist() for name, rows in target.node_sets.items()}
    assert kept == {
        "INLET GATE": [0, 1], "node set 2": [0, 1, 4], "node set 3": [4],
        "segment set 9": [0, 1, 2], "stiffener": [2, 3],
    }  # fmt: skip
    assert target.ignored == {"beam": 1}
    said = " | ".join(target.notes)
    assert "node set 2 (1), node set 3 (1)" in said
    assert "*SET_NODE_GENERAL (line" in said and "segments are kept" in said


@pytest.mark.parametrize(
    ("head", "node", "shell", "width"),
    [("*KEYWORD I10=Y\n", "", "", 10), ("*KEYWORD LONG=Y\n", "", "", 20),
     ("*KEYWORD long=s\n", "", "", 8), ("*KEYWORD\n", "%", " %", 10), ("*KEYWORD\n", " +", "+", 20),
     ("*KEYWORD LONG=Y\n", "-", " -", 8)],
)  # fmt: skip
def test_formats_of_long_numbers(tmp_path, head, node, shell, width):
    """Columns of ten and twenty, for all of a deck or for one keyword."""
    first = {8: 1, 10: 1_234_567_890, 20: 10_000_000_000_001}[width]
    text = nodes(width, 20 if width == 20 else 16, first)
    quad = columns(width, first, 7, *(first + k for k in range(4)))
    (tmp_path / "part.key").write_text(
        f"{head}*NODE{node}\n{text}*ELEMENT_SHELL{shell}\n{quad}\n*END\n"
    )
    target = read_target(tmp_path / "part.key")
    np.testing.assert_allclose(target.points, PLACES, atol=1e-15)
    assert target.cell_ids.tolist() == [first] and target.blocks[0][1].tolist() == [[0, 1, 2, 3]]
    assert list(target.parts) == ["part 7"]


def test_commas_and_fortran_numbers(tmp_path):
    (tmp_path / "part.k").write_text(
        "*keyword\n*node\n1,0.,0.,0.\n2,2.0D+1,,0\n3,2+1,20.0,0\n4,0,20.\n"
        "*element_shell\n1,1,1,2,3,4\n2,1,1,2,3\n*end\n"
    )
    target = read_target(tmp_path / "part.k")
    assert target.points.tolist() == [[0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]]
    assert [name for name, _ in target.blocks] == ["quad", "triangle"]


def test_included_files_in_other_folders(tmp_path):
    (tmp_path / "mesh").mkdir()
    (tmp_path / "more").mkdir()
    (tmp_path / "mesh" / "nodes.k").write_text(f"*NODE\n{nodes()}*END\nwhat\n")
    (tmp_path / "more" / "shells.inc").write_text(
        f"*ELEMENT_SHELL\n{columns(8, 1, 1, 1, 2, 3, 4)}\n"
    )
    (tmp_path / "main.k").write_text(
        # a name goes on in the next line behind a blank and a plus
        "*KEYWORD\n*INCLUDE_PATH_RELATIVE\nmore\n*INCLUDE\nmesh\\no +\ndes.k\nshells.inc\n*END\n"
    )
    target = read_target(tmp_path / "main.k")
    assert target.cell_count == 1 and len(target.points) == 5
    (tmp_path / "main.k").write_text("*KEYWORD\n*INCLUDE\nmain.k\n")
    with pytest.raises(InputError, match="line 3: .*INCLUDE leads back to main.k"):
        read_target(tmp_path / "main.k")


CUBE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0),
                 (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], float)  # fmt: skip


def squeezed(alike):
    """Corners of a cube of which some coincide: number and place of each."""
    numbers, places = list(range(1, 9)), CUBE.copy()
    for same in alike:
        places[list(same)] = CUBE[list(same)].mean(axis=0)
        for k in same:
            numbers[k] = numbers[same[0]]
    return numbers, places


@pytest.mark.parametrize(
    ("alike", "shape", "volume"),
    [([], "hexahedron", 1.0), ([(4, 5), (6, 7)], "wedge", 0.5), ([(2, 3), (6, 7)], "wedge", 0.5),
     ([(4, 5, 6, 7)], "pyramid", 1 / 3), ([(2, 3), (4, 5, 6, 7)], "tetra", 1 / 6)],
)  # fmt: skip
def test_squeezed_hexahedra_in_every_turn(tmp_path, alike, shape, volume):
    numbers, places = squeezed(alike)
    for turn in _TURNS:
        found = solid_of_eight([numbers[k] for k in turn])
        assert found is not None and found[0] == shape
        assert set(found[1]) == set(numbers)
    text = "*KEYWORD\n*NODE\n" + "".join(
        columns(8, k) + "".join(f"{x:16.9g}" for x in places[numbers.index(k)]) + "\n"
        for k in sorted(set(numbers))
    )
    (tmp_path / "one.k").write_text(f"{text}*ELEMENT_SOLID\n{columns(8, 1, 1, *numbers)}\n")
    two = f"{columns(8, 1, 1)}\n{columns(8, *numbers, 0, 0)}\n"
    (tmp_path / "two.k").write_text(f"{text}*ELEMENT_SOLID\n{two}")
    for name in ("one.k", "two.k"):
        target = read_target(tmp_path / name)
        assert target.blocks[0][0] == shape
        assert not any("inside out" in note for note in target.notes)
        corners = target.points[target.blocks[0][1][0]]
        hull = ConvexHull(corners).volume if shape != "wedge" else volume
        assert hull == pytest.approx(volume, rel=1e-9)


def test_a_tetrahedron_with_its_last_node_five_times(tmp_path):
    numbers = (1, 2, 4, 5, 5, 5, 5, 5)
    (tmp_path / "a.k").write_text(
        f"*KEYWORD\n*NODE\n{nodes()}*ELEMENT_SOLID\n{columns(8, 1, 1, *numbers)}\n"
    )
    target = read_target(tmp_path / "a.k")
    assert target.blocks[0][0] == "tetra" and target.blocks[0][1].tolist() == [[0, 1, 3, 4]]
    assert not any("inside out" in note for note in target.notes)


def test_shells_and_solids_with_the_same_numbers(tmp_path):
    (tmp_path / "a.k").write_text(
        f"*KEYWORD\n*NODE\n{nodes()}*ELEMENT_SHELL\n{columns(8, 1, 2, 1, 2, 3, 4)}\n"
        f"*ELEMENT_SOLID\n{columns(8, 1, 3, 1, 2, 4, 5, 5, 5, 5, 5)}\n"
        f"*SET_SHELL_LIST\n         1\n         1\n*SET_SOLID\n         1\n         1\n"
    )
    target = read_target(tmp_path / "a.k")
    assert list(target.parts) == ["part 3"] and target.cell_sets["solid set 1"].tolist() == [0]
    assert target.node_sets["shell set 1"].tolist() == [0, 1, 2, 3]
    assert any("same numbers" in note for note in target.notes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToolWarning)
        assert read_triangles(tmp_path / "a.k")[1].tolist() == [[0, 1, 2], [0, 2, 3]]


DECK = f"*KEYWORD\n*NODE\n{nodes()}*ELEMENT_SHELL\n{columns(8, 1, 2, 1, 2, 3, 4)}\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [(DECK.replace("               0", "              0x", 1), 'line 3: "0x" is no number'),
     (DECK.replace("       3       4", "       3      44"), "line 9: element 1 has node 44"),
     (DECK.replace("SHELL\n", "SHELL_COMPOSITE\n"), r"ELEMENT_SHELL_COMPOSITE has the option COMP"),
     (DECK + "*ELEMENT_SOLID_P15\n", "option P15"),
     (DECK + "*ELEMENT_SOLID_T15\n  1\n", "option T15"),
     (DECK + "*INCLUDE_TRANSFORM\nb.k\n", "line 10: .*INCLUDE_TRANSFORM is not followed"),
     (DECK + "*INCLUDE\nb.k\n", "line 11: .*INCLUDE names b.k, which does not exist"),
     (DECK.replace("       1       2       1", "       1       2      &n", 1),
      "write the value of the parameter"),
     (DECK + columns(8, 2, 2, 1, 2, 3, 4, 5, 1) + "\n", "element 2 has six nodes"),
     (DECK + "*ELEMENT_SOLID\n" + columns(8, 3, 1, 1, 2, 3, 1, 4, 5, 4, 5), "make no hexahedron"),
     (DECK + "*ELEMENT_SOLID\n" + columns(8, 3, 1) + "\n", "ends before the nodes of element 3"),
     ("*KEYWORD\n*NODE\n", "has no .NODE"), ("*KEYWORD\n*CONTROL\n", "has no .NODE")],
)  # fmt: skip
def test_a_wrong_deck_names_its_line(tmp_path, text, words):
    (tmp_path / "a.k").write_text(text)
    with pytest.raises(InputError, match=words):
        read_target(tmp_path / "a.k")
