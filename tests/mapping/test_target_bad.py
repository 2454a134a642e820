"""Targets that are no good: cut off, mutilated, in another unit, doubled, turned over."""

import random
import re
import runpy
from pathlib import Path

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import map_file, read_target
from lcmchain.mesh_files.length_unit import length_unit_hint


def grid_mesh(make, cells=(3, 3)):
    points, quads = make.grid(*cells)
    return make.lifted(points), quads


def notes_of(tmp_path, points, blocks):
    meshio.Mesh(points, blocks).write(tmp_path / "t.vtu")
    return read_target(tmp_path / "t.vtu").notes


def test_a_sound_mesh_has_no_notes(tmp_path, make):
    points, quads = grid_mesh(make)
    assert notes_of(tmp_path, points, [("quad", quads)]) == ()
    upper = points + [0, 0, 0.2]
    bricks = np.hstack([quads, quads + len(points)])
    assert notes_of(tmp_path, np.concatenate([points, upper]), [("hexahedron", bricks)]) == ()
    # a closed strip, a Moebius band would be told
    assert notes_of(tmp_path, points, [("quad", np.roll(quads, 1, axis=1))]) == ()


def test_cells_that_lie_twice_in_the_mesh_are_told(tmp_path, make):
    points, quads = grid_mesh(make)
    doubled = np.concatenate([quads, np.roll(quads[4:6], 2, axis=1)])
    notes = notes_of(tmp_path, points, [("quad", doubled)])
    assert any(note.startswith("2 cells have the same nodes as others (number 5, 6)")
               and "delete one of each" in note for note in notes)  # fmt: skip


def test_ribs_are_told(tmp_path, make):
    points, quads = grid_mesh(make)
    edge = quads[4][:2]
    top = len(points)
    points = np.concatenate([points, points[edge] + [0, 0, 1]])
    rib = [[edge[0], edge[1], top + 1, top]]
    (note,) = notes_of(tmp_path, points, [("quad", np.concatenate([quads, rib]))])
    assert note.startswith("1 edges have more than two cells") and "number 4, 5, 10" in note


def test_normals_to_both_sides_are_told(tmp_path, make):
    points, quads = grid_mesh(make)
    quads[4] = quads[4][::-1]
    (note,) = notes_of(tmp_path, points, [("quad", quads)])
    assert "opposite normals at 4 edges" in note and "turn the normals" in note


@pytest.mark.parametrize(
    ("kind", "order"),
    [("hexahedron", [4, 5, 6, 7, 0, 1, 2, 3]), ("tetra", [0, 2, 1, 4]),
     ("wedge", [0, 2, 1, 4, 6, 5]),
     ("pyramid", [0, 3, 2, 1, 5])],
)  # fmt: skip
def test_solids_that_are_inside_out_are_told(tmp_path, kind, order):
    cube = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1),
                     (0, 1, 1)], dtype=float)  # fmt: skip
    sound = {"hexahedron": list(range(8)), "tetra": [0, 1, 2, 4], "wedge": [0, 1, 2, 4, 5, 6],
             "pyramid": [0, 1, 2, 3, 5]}[kind]  # fmt: skip
    assert notes_of(tmp_path, cube, [(kind, np.array([sound]))]) == ()
    (note,) = notes_of(tmp_path, cube, [(kind, np.array([order]))])
    assert note.startswith("1 solids are inside out") and "turn the order" in note


@pytest.mark.parametrize(
    ("part", "is_in", "read_in", "told"),
    [
        (0.9, "mm", "m", '"mm" (0.9 times)'),
        (0.5, "cm", "m", '"cm" (0.5 times)'),
        (0.9, "inch", "m", '"inch" (0.9 times)'),
        (0.4, "inch", "mm", '"inch" (0.4 times)'),
        (0.9, "cm", "mm", '"cm" (0.9 times)'),
        (0.9, "mm", "inch", '"mm" (0.9 times)'),
        (0.9, "m", "mm", '"m" (0.9 times)'),
    ],
)
def test_a_wrong_unit_is_told_with_the_likely_one(part, is_in, read_in, told):
    metres = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254, "m": 1.0}
    hint = length_unit_hint(part * metres[read_in] / metres[is_in] * 0.3, 0.3, read_in)
    assert f'check length_unit (now "{read_in}", more likely' in hint and told in hint


def test_parts_of_usual_size_are_not_doubted():
    for ratio in (0.06, 0.2, 0.5, 1.0, 1.2, 2.5):
        assert length_unit_hint(ratio * 0.3, 0.3, "mm") is None


@pytest.mark.parametrize("name", ["t.vtu", "t.inp", "t.bdf", "t.msh", "t.med", "t.exo", "t.vtk"])
def test_empty_files_are_told_to_be_empty(tmp_path, name):
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(InputError, match=rf"{name}: cannot read .*the file is empty"):
        read_target(tmp_path / name)


def test_an_unrelated_target_is_told_where_it_lies(make, tmp_path):
    points, quads = make.grid(6, 6, (-0.05, -0.05), (0.05, 0.05))
    result = make.forming_result(make.bowl(points), quads, areal_fibre_mass=0.6)
    far = make.lifted(points) + [1.0, 0, 0]
    meshio.Mesh(far, [("quad", quads)]).write(tmp_path / "t.inp")
    with pytest.raises(InputError, match=r"36 of 36 cells have no sheet within .* centroid at"):
        map_file(result, tmp_path / "t.inp", tmp_path / "m.nc")


# --- mutilated files ------------------------------------------------------------------------------

ODD = [b"", b"-1", b"0", b"1e400", b"nan", b"99999999999999999999", b"4294967297", b"x", b'"', b",",
       b"*", b"$", b"\0", b"\xff", b"1.5", b"THRU", b"=", b"\n", b"+"]  # fmt: skip


def mutated(rng, content):
    """Cut, flip bytes, lose or repeat lines, or replace a word."""
    kind = rng.choice(["cut", "flip", "lose", "repeat", "word", "word", "word", "insert"])
    if kind == "cut":
        return content[: rng.randrange(len(content))]
    if kind == "flip":
        changed = bytearray(content)
        for _ in range(rng.choice([1, 3, 20])):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
        return bytes(changed)
    if kind == "insert":
        at = rng.randrange(len(content))
        return content[:at] + rng.choice(ODD) * rng.choice([1, 50]) + content[at:]
    if kind == "word":
        first, end = rng.choice([m.span() for m in re.finditer(rb"[^\s,=]+", content)])
        return content[:first] + rng.choice(ODD) + content[end:]
    lines = content.split(b"\n")
    row = rng.randrange(len(lines))
    if kind == "lose":
        del lines[row]
    else:
        lines.insert(rng.randrange(len(lines)), lines[row])
    return b"\n".join(lines)


def sound_files(make, folder):
    """Contents of sound files by their names: decks of the other tests, and what meshio writes."""
    here = Path(__file__).parent
    decks = runpy.run_path(str(here / "test_target_abaqus.py"))
    bulk = runpy.run_path(str(here / "test_target_nastran.py"))
    universal = runpy.run_path(str(here / "test_target_universal.py"))
    content = runpy.run_path(str(here / "test_target_content.py"))
    runpy.run_path(str(here / "test_target_cgns.py"))["written"](folder / "zones.cgns", zones=2)
    points, quads = make.grid(4, 3)
    mesh = meshio.Mesh(make.lifted(points), [("quad", quads)])
    files = {
        "part.unv": universal["PART"].encode(), "box.vol": content["netgen"](2).encode(),
        "sets.k": runpy.run_path(str(here / "test_target_lsdyna.py"))["STANDARD"].encode(),
        "zones.cgns": (folder / "zones.cgns").read_bytes(),
        "flat.inp": decks["FLAT"].encode(), "assembly.inp": decks["ASSEMBLY"].encode(),
        "bulk.bdf": bulk["DECK"].encode(), "large.bdf": bulk["PYNASTRAN"].encode(),
    }  # fmt: skip
    for name, options in {
        "text.msh": {"file_format": "gmsh", "binary": False},
        "binary.msh": {"file_format": "gmsh", "binary": True},
        "old.msh": {"file_format": "gmsh22", "binary": False},
        "binary-old.msh": {"file_format": "gmsh22", "binary": True},
        "m.med": {}, "m.e": {}, "m.vtu": {},
    }.items():  # fmt: skip
        meshio.write(folder / name, mesh, **options)
        files[name] = (folder / name).read_bytes()
    return files


def test_mutilated_files_are_refused_or_read_to_sound_meshes(make, tmp_path):
    """Never with a traceback, and never with members of sets or nodes that do not exist."""
    outcomes = {"read": 0, "refused": 0}
    for name, content in sound_files(make, tmp_path).items():
        path = tmp_path / f"mutilated{Path(name).suffix}"
        path.write_bytes(content)
        read_target(path)
        for number in range(40):
            path.write_bytes(mutated(random.Random(f"{name} {number}"), content))
            try:
                target = read_target(path)
            except InputError as error:
                assert path.name in str(error) and len(str(error)) < 2500
                outcomes["refused"] += 1
                continue
            outcomes["read"] += 1
            assert np.isfinite(target.points[target.corners[target.corners >= 0]]).all()
            for sets, count in (
                (target.cell_sets, target.cell_count), (target.parts, target.cell_count),
                (target.node_sets, len(target.points)),
            ):  # fmt: skip
                for rows in sets.values():
                    assert np.all((rows >= 0) & (rows < count))
    assert min(outcomes.values()) > 80


EMPTY_VTU = """<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="0" NumberOfCells="0"></Piece></UnstructuredGrid></VTKFile>
"""
EMPTY_VTK = """# vtk DataFile Version 4.2
empty
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 0 double
CELLS 0 0
CELL_TYPES 0
"""


@pytest.mark.parametrize(
    ("name", "text"),
    [("t.vtu", EMPTY_VTU), ("t.vtk", EMPTY_VTK), ("t.bdf", "GRID,1,,0.,0.,0.\n")],
)
def test_a_mesh_without_cells_is_told(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=rf"{name}: the mesh has no cells to map onto; export"):
        read_target(tmp_path / name)


@pytest.mark.parametrize("cells", [[], [("quad", np.zeros((0, 4), dtype=int))]])
def test_a_mesh_that_meshio_wrote_without_cells_is_told(tmp_path, cells):
    meshio.Mesh(np.eye(3), cells).write(tmp_path / "t.vtu")
    with pytest.raises(InputError, match="the mesh has no cells to map onto"):
        read_target(tmp_path / "t.vtu")
