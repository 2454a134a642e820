"""Exodus files as targets: number maps, blocks, node and side sets, as VTK and meshio write."""

import json
import subprocess
import sys

import meshio
import netCDF4
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target


def text(file, name, words, length=33):
    """Write names as Exodus does: rows of characters."""
    if "len_name" not in file.dimensions:
        file.createDimension("len_name", length)
    file.createDimension(f"n_{name}", len(words))
    variable = file.createVariable(name, "S1", (f"n_{name}", "len_name"))
    for row, word in enumerate(words):
        variable[row] = netCDF4.stringtochar(np.array([word.encode()], f"S{length}"))[0]


@pytest.fixture
def exodus(tmp_path, make):
    """Write two blocks of solids and one of shells, as SAND92-2137 describes the file."""
    path = tmp_path / "part.exo"
    points, quads = make.grid(3, 1)
    count = len(points)
    nodes = np.concatenate([make.lifted(points), make.lifted(points) + [0, 0, 0.2]])
    bricks = np.hstack([quads, quads + count])
    with netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        file.createDimension("num_dim", 3)
        file.createDimension("num_nodes", len(nodes))
        file.createDimension("num_elem", 4)
        file.createDimension("num_el_blk", 3)
        file.createDimension("num_node_sets", 1)
        file.createDimension("num_side_sets", 1)
        for axis, values in zip("xyz", nodes.T, strict=True):
            file.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = values
        blocks = (("HEX8", bricks[:2]), ("hex", bricks[2:]), ("SHELL4", quads[:1]))
        for number, (kind, cells) in enumerate(blocks, start=1):
            file.createDimension(f"num_el_in_blk{number}", len(cells))
            file.createDimension(f"num_nod_per_el{number}", cells.shape[1])
            connect = file.createVariable(
                f"connect{number}", "i4", (f"num_el_in_blk{number}", f"num_nod_per_el{number}")
            )
            connect.elem_type = kind
            connect[:] = cells + 1
        file.createVariable("eb_prop1", "i4", ("num_el_blk",))[:] = [10, 20, 30]
        text(file, "eb_names", ["core", "", "patch"])
        file.createVariable("elem_num_map", "i4", ("num_elem",))[:] = [500, 7, 300, 42]
        ids = np.arange(len(nodes))[::-1] * 2 + 5
        file.createVariable("node_num_map", "i4", ("num_nodes",))[:] = ids
        file.createDimension("num_nod_ns1", 2)
        file.createVariable("node_ns1", "i4", ("num_nod_ns1",))[:] = [3, 1]
        text(file, "ns_names", ["corner"])
        file.createDimension("num_side_ss1", 3)
        file.createVariable("elem_ss1", "i4", ("num_side_ss1",))[:] = [1, 3, 2]
        file.createVariable("side_ss1", "i4", ("num_side_ss1",))[:] = [5, 6, 1]
        file.createVariable("ss_prop1", "i4", ("num_side_sets",))[:] = [77]
    return path, bricks, ids


def test_numbers_blocks_and_sets(exodus):
    path, bricks, ids = exodus
    target = read_target(path)
    np.testing.assert_array_equal(np.concatenate([cells for _, cells in target.blocks]), bricks)
    assert target.cell_ids.tolist() == [500, 7, 300]
    assert target.node_ids.tolist() == ids.tolist()
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {
        "core": [0, 1], "block 20": [2],
    }  # fmt: skip
    assert target.node_sets["corner"].tolist() == [0, 2]
    # the lower face of the first brick, the upper one of the third, side 1 of the second
    sides = {*bricks[0, :4].tolist(), *bricks[2, 4:].tolist(), *bricks[1, [0, 1, 5, 4]].tolist()}
    assert target.node_sets["side set 77"].tolist() == sorted(sides)
    assert target.ignored == {"quad": 1}
    assert sorted(target.node_sets["patch"].tolist()) == sorted(bricks[0, :4].tolist())
    assert any("side sets are kept as the sets of their nodes" in note for note in target.notes)
    assert not any("inside out" in note for note in target.notes)


@pytest.mark.parametrize("name", ["hexahedron20", "wedge15"])
def test_mid_side_nodes_come_in_vtk_order(tmp_path, name):
    """Exodus lists the edges across between those of the lower and of the upper face."""
    corners, edges, vtk_edges = {
        "hexahedron20": (
            [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1),
             (0, 1, 1)],
            [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6),
             (6, 7), (7, 4)],
            [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
             (2, 6), (3, 7)],
        ),
        "wedge15": (
            [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
            [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)],
            [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
        ),
    }[name]  # fmt: skip
    at = np.array(corners, dtype=float)
    nodes = np.concatenate([at, [(at[a] + at[b]) / 2 for a, b in edges]])
    with netCDF4.Dataset(tmp_path / "m.e", "w", format="NETCDF3_CLASSIC") as file:
        file.createDimension("num_nodes", len(nodes))
        file.createDimension("num_dim", 3)
        file.createDimension("num_el_blk", 1)
        file.createDimension("one", 1)
        file.createVariable("coord", "f8", ("num_dim", "num_nodes"))[:] = nodes.T
        connect = file.createVariable("connect1", "i4", ("one", "num_nodes"))
        connect.elem_type = {"hexahedron20": "HEX20", "wedge15": "WEDGE15"}[name]
        connect[:] = [np.arange(1, len(nodes) + 1)]
    target = read_target(tmp_path / "m.e")
    ((found, cells),) = target.blocks
    assert found == name
    placed = target.points[cells[0]]
    np.testing.assert_allclose(placed[len(at) :], [(at[a] + at[b]) / 2 for a, b in vtk_edges])


WRITE_BY_VTK = """
import sys
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import VTK_QUAD, vtkUnstructuredGrid
from vtkmodules.vtkIOExodus import vtkExodusIIWriter
import json
points, quads = json.load(sys.stdin)
grid, places = vtkUnstructuredGrid(), vtkPoints()
for point in points:
    places.InsertNextPoint(*point)
grid.SetPoints(places)
for nodes in quads:
    grid.InsertNextCell(VTK_QUAD, 4, nodes)
writer = vtkExodusIIWriter()
writer.SetFileName(sys.argv[1])
writer.SetInputData(grid)
writer.Write()
"""


def test_files_written_by_vtk(tmp_path, make):
    """VTK's writer keeps ids of its own under its names of arrays.

    It brings another HDF5 than netCDF4 does, and both in one process may crash it.
    """
    pytest.importorskip("vtkmodules.vtkCommonCore")
    points, quads = make.grid(3, 2)
    meshes = json.dumps([make.lifted(points).tolist(), quads.tolist()])
    path = tmp_path / "vtk.exii"
    command = [sys.executable, "-c", WRITE_BY_VTK, str(path)]
    subprocess.run(command, input=meshes, text=True, check=True, timeout=120)
    target = read_target(path)
    np.testing.assert_allclose(target.points, make.lifted(points), atol=1e-6)
    assert sorted(map(tuple, target.blocks[0][1].tolist())) == sorted(map(tuple, quads.tolist()))
    assert len(target.parts) == 1


def test_files_written_by_meshio(tmp_path, make):
    points, quads = make.grid(3, 2)
    mesh = meshio.Mesh(
        make.lifted(points), [("quad", quads[:4]), ("triangle", make.triangles_of(quads[4:]))],
        point_sets={"left": np.array([0, 4])},
    )  # fmt: skip
    meshio.write(tmp_path / "m.e", mesh)
    target = read_target(tmp_path / "m.e")
    for (_, found), block in zip(target.blocks, mesh.cells, strict=True):
        np.testing.assert_array_equal(found, block.data)
    assert target.node_sets["left"].tolist() == [0, 4]
    assert [len(rows) for rows in target.parts.values()] == [4, 4]


def test_broken_files_are_refused(exodus):
    path, *_ = exodus
    content = path.read_bytes()
    for wrong in (content[:500], b"no netCDF file", content[: len(content) // 2]):
        path.write_bytes(wrong)
        with pytest.raises(InputError):
            read_target(path)
    path.write_bytes(b"no netCDF file")
    with pytest.raises(InputError, match="no sound Exodus file .*; export it again"):
        read_target(path)
