"""Universal files as targets and tools, and what Gmsh writes of one mesh in six formats."""

import warnings

import numpy as np
import pytest
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.mapping import read_target
from lcmchain.mesh_files import read_mesh_file
from lcmchain.tools import ToolWarning
from lcmchain.tools.surfaces.reading import read_surface, read_triangles


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Write a meshed block with a named side and body, by shape and order, in several formats."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # the second where the system lacks its libraries
        pytest.skip(f"Gmsh cannot be loaded ({error})")
    folder = tmp_path_factory.mktemp("block")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    for name in ("Mesh.SaveGroupsOfElements", "Mesh.SaveGroupsOfNodes",
                 "Mesh.SecondOrderIncomplete"):  # fmt: skip
        gmsh.option.setNumber(name, 1)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.7)

    def write(shape, order, *endings):
        gmsh.clear()
        face = gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
        layers = [] if shape == "tetra" else [2]
        body = gmsh.model.occ.extrude([(2, face)], 0.1, 0, 0.5, layers, recombine=bool(layers))
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [face], 3, "side")
        gmsh.model.addPhysicalGroup(3, [body[1][1]], 4, "body")
        if shape == "hexahedron":
            gmsh.model.mesh.setRecombine(2, face)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        paths = [folder / f"{shape}{order}{ending}" for ending in endings]
        for path in paths:
            gmsh.write(str(path))
        return paths

    yield write
    gmsh.finalize()


#: Largest error of a coordinate: Gmsh writes six digits into decks of LS-DYNA.
DIGITS = {".unv": 1e-12, ".cgns": 1e-12, ".med": 1e-12, ".inp": 1e-12, ".key": 2e-6}


def differences(found, expected, turned=False):
    """Largest distance of the nodes of cells (C, K, 3) from those of the nearest cell of others.

    Cells may be turned, their nodes in another order, where this is said.
    """
    assert found.shape == expected.shape
    nearest = cKDTree(expected.mean(axis=1)).query(found.mean(axis=1))[1]
    assert len(np.unique(nearest)) == len(found)
    far = np.abs(found[:, :, None] - expected[nearest][:, None, :]).max(axis=3)
    return far.min(axis=2).max() if turned else far[:, *np.diag_indices(found.shape[1])].max()


@pytest.mark.parametrize("ending", list(DIGITS))
@pytest.mark.parametrize("shape", ["tetra", "wedge", "hexahedron"])
@pytest.mark.parametrize("order", [1, 2])
def test_gmsh_writes_the_same_mesh_in_another_format(block, ending, shape, order):
    own, other = block(shape, order, ".msh", ending)
    if (ending, shape, order) == (".key", "wedge", 2):
        with pytest.raises(InputError, match="option P15, which is not read"):
            read_target(other)
        return
    for kind in ("structure", "infiltration"):
        expected, found = (read_target(path, kind=kind) for path in (own, other))
        (name, nodes), (known, known_nodes) = found.blocks[0], expected.blocks[0]
        if ending == ".key" and known == "hexahedron20":  # corners alone, and told
            assert name == "hexahedron" and "taken by their corners" in " ".join(found.notes)
            known_nodes = known_nodes[:, :8]
        else:
            assert name == known
        # LS-DYNA knows no wedge but a hexahedron that lists nodes twice
        turned = (ending, name) == (".key", "wedge")
        places = found.points[nodes], expected.points[known_nodes]
        assert differences(*places, turned) < DIGITS[ending]
        assert not any("inside out" in note for note in found.notes)
    side = expected.points[np.unique(known_nodes)]  # kind is "infiltration": the side alone
    if ending in (".unv", ".key"):  # the others hold the groups of elements alone
        kept = found.points[found.node_sets["side"]]
        assert differences(kept[:, None], side[:, None]) < DIGITS[ending]
    if ending != ".key":  # which holds those of nodes alone
        solid = read_target(other)
        assert len(solid.cell_sets["body"]) == solid.cell_count
        assert len(found.cell_sets["side"]) == found.cell_count


@pytest.mark.parametrize("ending", list(DIGITS))
def test_gmsh_writes_the_same_tool_in_another_format(block, ending):
    surfaces = []
    for path in block("tetra", 2, ".msh", ending):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToolWarning)  # about the solids
            points, triangles = read_triangles(path)
        surfaces.append(points[triangles])
    assert differences(*surfaces) < DIGITS[ending]


def dataset(number, *lines):
    return "\n".join(["    -1", f"{number:6d}", *lines, "    -1", ""])


def whole(*numbers):
    return "".join(f"{number:10d}" for number in numbers)


def node(label, *place, system=1):
    return whole(label, system, 1, 11) + "\n" + "".join(f"{x:25.16E}" for x in place).replace(
        "E", "D"
    )  # fmt: skip


SQUARE = [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 20.0, 1.5), (0.0, 20.0, 0.0)]
NODES = dataset(2411, *(node(label, *place) for label, place in zip((11, 12, 13, 14), SQUARE)))
SHELL = dataset(2412, whole(7, 94, 3, 1, 7, 4), whole(11, 12, 13, 14))


def units(code, factor):
    return dataset(
        164, f"{code:10d}{'as it is called':>20s}{2:10d}",
        "".join(f"{x:25.17E}" for x in (factor, 1.0, 1.0)).replace("E", "D"), f"{273.15:25.17E}",
    )  # fmt: skip


BEAMS = dataset(
    2412, whole(7, 94, 3, 1, 7, 4), whole(11, 12, 13, 14),
    whole(21, 21, 5, 1, 7, 2), whole(0, 1, 1), whole(11, 12),
    whole(22, 11, 5, 1, 7, 2), whole(12, 13),  # a rod without a line of its own
    whole(23, 24, 5, 1, 7, 3), whole(0, 1, 1), whole(13, 14, 11),
    whole(8, 91, 4, 1, 7, 3), whole(11, 12, 13),
)  # fmt: skip
GROUPS = dataset(
    2467, whole(1, 0, 0, 0, 0, 0, 0, 3), "GATE",
    whole(7, 12, 0, 0, 7, 11, 0, 0), whole(7, 99, 0, 0),
    whole(2, 0, 0, 0, 0, 0, 0, 2), "STIFFENER", whole(8, 21, 0, 0, 8, 23, 0, 0),
    whole(3, 0, 0, 0, 0, 0, 0, 3), "BOTH",
    whole(8, 8, 0, 0, 7, 14, 0, 0), whole(5, 1, 0, 0),
) + dataset(2429, whole(4, 0, 0, 0, 0, 0, 0, 5), "OLD", whole(8, 7, 8, 8, 7, 11, 7, 12),
            whole(7, 13))  # fmt: skip
PART = (
    dataset(151, "a header", "-1 is no delimiter here") + units(5, 1e3) + NODES + BEAMS + GROUPS
    + dataset(2414, whole(1), "results")
)  # fmt: skip


def test_numbers_properties_and_groups_are_kept(tmp_path):
    (tmp_path / "part.unv").write_text(PART, newline="\r\n")
    target = read_target(tmp_path / "part.unv", length_unit="mm")
    np.testing.assert_allclose(target.points, 1e-3 * np.array(SQUARE), atol=1e-15)
    assert [(name, nodes.tolist()) for name, nodes in target.blocks] == [
        ("quad", [[0, 1, 2, 3]]), ("triangle", [[0, 1, 2]]),
    ]  # fmt: skip
    assert target.cell_ids.tolist() == [7, 8] and target.node_ids.tolist() == [11, 12, 13, 14]
    parts = {name: rows.tolist() for name, rows in target.parts.items()}
    assert parts == {"property 3": [0], "property 4": [1]}
    cells = {name: rows.tolist() for name, rows in target.cell_sets.items()}
    assert cells == {"BOTH": [1], "OLD": [0, 1]}
    nodes = {name: rows.tolist() for name, rows in target.node_sets.items()}
    assert nodes == {"GATE": [0, 1], "STIFFENER": [0, 1, 2, 3], "BOTH": [3], "OLD": [0, 1, 2]}
    assert target.ignored == {"beam": 3}
    said = " | ".join(target.notes)
    assert "do not have" not in said and "GATE (1)" in said and "BOTH (1)" in said
    assert "datasets that are no part of a mesh here: 2414" in said
    assert "length_unit" not in said


def test_old_datasets_of_nodes_and_elements(tmp_path):
    old = dataset(15, *(
        whole(label, 0, 0, 11) + "".join(f"{x:13.5E}" for x in place)
        for label, place in zip((11, 12, 13, 14), -np.array(SQUARE))
    ))  # fmt: skip
    double = dataset(781, *(node(label, *place) for label, place in zip(range(11, 15), SQUARE)))
    quad = dataset(780, whole(7, 94, 1, 3, 1, 1, 7, 4), whole(11, 12, 13, 14))
    for nodes, sign in ((old, -1.0), (double, 1.0)):
        (tmp_path / "part.unv").write_text(nodes + quad)
        target = read_target(tmp_path / "part.unv")
        np.testing.assert_allclose(target.points, sign * np.array(SQUARE), atol=1e-15)
        assert target.parts["property 3"].tolist() == [0]


def test_labels_that_fill_their_columns(tmp_path):
    big = 1_000_000_001
    nodes = dataset(2411, *(node(big + k, *place) for k, place in enumerate(SQUARE)))
    quad = dataset(2412, whole(big, 94, 3, 1, 7, 4), whole(*(big + k for k in range(4))))
    (tmp_path / "part.unv").write_text(nodes + quad)
    target = read_target(tmp_path / "part.unv")
    assert target.cell_ids.tolist() == [big] and target.node_ids[3] == big + 3


@pytest.mark.parametrize(
    ("code", "factor", "unit", "told"),
    [(5, 1e3, "m", 'its unit of length as "mm", but length_unit is "m"'),
     (7, 39.3700787, "mm", 'its unit of length as "inch"'), (9, 100.0, "mm", '"cm"'),
     (7, 39.3700787, "in", None), (1, 1.0, "m", None), (0, 1e3, "mm", None),
     (1, 1e3, "mm", "the code 1 stands for 1 m, the factor for 0.001 m")],
)  # fmt: skip
def test_the_unit_that_a_file_states_is_compared(tmp_path, code, factor, unit, told):
    (tmp_path / "part.unv").write_text(units(code, factor) + NODES + SHELL)
    notes = [note for note in read_target(tmp_path / "part.unv", length_unit=unit).notes
             if "unit" in note]  # fmt: skip
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        surface = read_surface(tmp_path / "part.unv", unit)
    of_tool = [str(warning.message) for warning in said if "unit" in str(warning.message)]
    assert len(surface.triangles) == 2
    assert len(notes) == len(of_tool) == (told is not None)
    if told is not None:
        assert told in notes[0] and told in of_tool[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [(NODES + SHELL.rstrip()[:-2], "dataset 2412 has no end"), (SHELL, "has no nodes"),
     (NODES.replace("2.0000000000000000D+01", "2.0000000000000000D+", 1) + SHELL,
      "line 6: dataset 2411: .* is not three numbers"),
     (NODES + SHELL.replace("        12", "        1x"), "line 15: dataset 2412: .* whole numbers"),
     (NODES + SHELL.replace("        12", "        19"), "line 14: element 7 has node 19"),
     (NODES + dataset(2412, whole(7, 94, 3, 1, 7, 4)), "ends in the middle of a record"),
     (NODES + "    -1\n  what\n", 'line 13: "what" is no number of a dataset'),
     (dataset(18, whole(5, 1)) + dataset(15, whole(11, 5, 0, 1) + 3 * f"{0.0:13.5E}"),
      r"coordinate systems of their own \(dataset 18\)")],
)  # fmt: skip
def test_a_wrong_file_names_its_line(tmp_path, text, words):
    (tmp_path / "part.unv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_target(tmp_path / "part.unv")


def test_nodes_in_moved_systems_are_told(tmp_path):
    moved = "\n".join("".join(f"{x:25.16E}" for x in row) for row in
                      np.vstack([np.eye(3), [1.0, 0.0, 0.0]]))  # fmt: skip
    systems = dataset(2420, whole(1), "part", whole(1, 0, 0), "CS1", moved)
    (tmp_path / "part.unv").write_text(systems + NODES + SHELL)
    assert any(
        "systems 1, which are moved" in n for n in read_mesh_file(tmp_path / "part.unv").notes
    )
