"""MED files as targets: numbers and groups, as the MED library of medcoupling and meshio write."""

import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target


def written_by_medcoupling(path, mc, points, cells, kind, dimension):
    """Write a mesh with numbers and groups of nodes and cells with MEDLoader."""
    mesh = mc.MEDCouplingUMesh("part", dimension)
    mesh.allocateCells(len(cells))
    for nodes in cells:
        mesh.insertNextCell(kind, [int(node) for node in nodes])
    mesh.setCoords(mc.DataArrayDouble(np.ascontiguousarray(points, dtype=float)))
    mesh.finishInsertingCells()
    file = mc.MEDFileUMesh()
    file[0] = mesh
    groups = []
    for name, members in {"front": [0, 2], "all of it": list(range(len(cells)))}.items():
        group = mc.DataArrayInt(members)
        group.setName(name)
        groups.append(group)
    file.setGroupsAtLevel(0, groups)
    edge = mc.DataArrayInt([1, 3])
    edge.setName("edge")
    file.setGroupsAtLevel(1, [edge])
    file.setRenumFieldArr(0, mc.DataArrayInt([7 * k + 50 for k in range(len(cells))][::-1]))
    file.setRenumFieldArr(1, mc.DataArrayInt([100 - k for k in range(len(points))]))
    file.write(str(path), 2)


def test_numbers_and_groups_of_shells(tmp_path, make):
    mc = pytest.importorskip("medcoupling")
    points, quads = make.grid(3, 2)
    path = tmp_path / "part.med"
    written_by_medcoupling(path, mc, make.lifted(points), quads, mc.NORM_QUAD4, 2)
    target = read_target(path, length_unit="mm")
    np.testing.assert_allclose(1e3 * target.points, make.lifted(points), atol=1e-15)
    np.testing.assert_array_equal(target.blocks[0][1], quads)
    assert target.cell_ids.tolist() == [85, 78, 71, 64, 57, 50]
    assert target.node_ids.tolist() == list(range(100, 88, -1))
    assert target.cell_sets["front"].tolist() == [0, 2]
    assert target.cell_sets["all of it"].tolist() == [0, 1, 2, 3, 4, 5]
    assert target.node_sets["edge"].tolist() == [1, 3]


def test_solids_have_their_faces_outwards(tmp_path, make):
    """MED's order of nodes is turned against VTK's: medcoupling's own volume tells it."""
    mc = pytest.importorskip("medcoupling")
    points, quads = make.grid(3, 1)
    count = len(points)
    points = np.concatenate([make.lifted(points), make.lifted(points) + [0, 0, 0.2]])
    bricks = np.hstack([quads, quads + count])
    med = bricks[:, [0, 3, 2, 1, 4, 7, 6, 5]]
    checked = mc.MEDCouplingUMesh("part", 3)
    checked.allocateCells(len(med))
    for nodes in med:
        checked.insertNextCell(mc.NORM_HEXA8, [int(node) for node in nodes])
    checked.setCoords(mc.DataArrayDouble(np.ascontiguousarray(points)))
    assert checked.orientCorrectly3DCells() is None
    np.testing.assert_array_equal(  # medcoupling takes this order for the right one
        checked.getNodalConnectivity().toNumPyArray().reshape(-1, 9)[:, 1:], med
    )
    path = tmp_path / "part.med"
    written_by_medcoupling(path, mc, points, med, mc.NORM_HEXA8, 3)
    target = read_target(path)
    np.testing.assert_array_equal(target.blocks[0][1], bricks)
    assert not any("inside out" in note for note in target.notes)


def test_files_written_by_meshio(tmp_path, make):
    points, quads = make.grid(3, 2)
    mesh = meshio.Mesh(
        make.lifted(points), [("quad", quads), ("line", np.array([[0, 1], [1, 2]]))],
        point_data={"point_tags": np.array([0] * 10 + [2, 2])},
        cell_data={"cell_tags": [np.array([-6, -6, 0, 0, -7, -7]), np.array([-8, -8])]},
    )  # fmt: skip
    mesh.point_tags = {2: ["tip"]}
    mesh.cell_tags = {-6: ["a", "both"], -7: ["b", "both"], -8: ["rim"]}
    meshio.write(tmp_path / "m.med", mesh)
    target = read_target(tmp_path / "m.med")
    np.testing.assert_array_equal(target.blocks[0][1], quads)
    found = {name: rows.tolist() for name, rows in target.cell_sets.items()}
    assert found == {"a": [0, 1], "b": [4, 5], "both": [0, 1, 4, 5]}
    nodes = {name: rows.tolist() for name, rows in target.node_sets.items()}
    assert nodes == {"tip": [10, 11], "rim": [0, 1, 2]}
    assert target.ignored == {"line": 2}
    assert target.cell_ids.tolist() == [1, 2, 3, 4, 5, 6]


def test_broken_files_are_refused(tmp_path, make):
    points, quads = make.grid(3, 2)
    meshio.write(tmp_path / "m.med", meshio.Mesh(make.lifted(points), [("quad", quads)]))
    content = (tmp_path / "m.med").read_bytes()
    for wrong in (content[: len(content) // 2], b"no MED file"):
        (tmp_path / "m.med").write_bytes(wrong)
        with pytest.raises(InputError, match="no sound MED file .*; export it again"):
            read_target(tmp_path / "m.med")
