"""What a target file calls its cells and nodes arrives in the files that a mapping writes."""

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import map_file, read_sheet, read_target


@pytest.fixture
def result(make):
    points, quads = make.grid(14, 14, (-0.05, -0.05), (0.05, 0.05))
    points = make.bowl(points, depth=6.0)
    first, second = make.families(points, quads)
    return make.forming_result(
        points, quads, thickness=lambda c: 1e-3 * (1.0 + 4.0 * c[:, 0]),
        areal_fibre_mass=0.6, shear_angle=0.0, fibre_direction_1=first, fibre_direction_2=second,
    )  # fmt: skip


def shuffled(count, seed, factor, offset):
    """Numbers that are neither sorted nor contiguous."""
    return np.random.default_rng(seed).permutation(count) * factor + offset


@pytest.fixture
def shell_deck(make, tmp_path):
    """Write a bowl of 6 x 6 cells in mm: node 5 belongs to no cell, part of the cells to sets."""
    points, quads = make.grid(6, 6, (-0.04, -0.04), (0.04, 0.04))
    points = 1e3 * make.bowl(points, depth=6.0)
    nodes, cells = shuffled(len(points), 1, 3, 100), shuffled(len(quads), 2, 7, 11)
    lines = ["*NODE", "5, 500., 500., 500."]
    lines += [f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in zip(nodes, points.tolist())]
    for name, rows in (("left half", quads[:18]), ("right-half", quads[18:])):
        lines.append(f'*ELEMENT, TYPE=S4R, ELSET="{name}"')
        first = 0 if name == "left half" else 18
        for k, row in enumerate(rows):
            lines.append(", ".join(map(str, [cells[first + k], *nodes[row]])))
    lines += ["*ELSET, ELSET=patch", ", ".join(map(str, cells[[3, 20, 21]]))]
    lines += ["*NSET, NSET=edge nodes", f"{nodes[4]}, {nodes[0]}, 5"]
    lines += ['*SHELL SECTION, ELSET="left half", MATERIAL=A', "1.,"]
    lines += ["*SHELL SECTION, ELSET=right-half, MATERIAL=A", "1.,", ""]
    path = tmp_path / "panel.inp"
    path.write_text("\n".join(lines))
    return path, nodes, cells, quads


def members(dataset, kind, name):
    """Numbers of the members of a set in a mapped file."""
    (variable,) = [
        v for v in dataset.data_vars.values()
        if str(v.name).startswith(kind) and v.attrs.get("set_name") == name
    ]  # fmt: skip
    ids = dataset["cell_id" if kind == "cell_set" else "node_id"].values
    assert variable.attrs["flag_meanings"] == "outside member"
    return set(ids[variable.values == 1].tolist())


def test_numbers_sets_and_parts_arrive_in_netcdf(result, shell_deck, tmp_path):
    path, nodes, cells, quads = shell_deck
    report = map_file(result, path, tmp_path / "m.nc", length_unit="mm", picture=False)
    assert report.cell_count == 36
    with xr.open_dataset(tmp_path / "m.nc") as file:
        np.testing.assert_array_equal(file["cell_id"], cells)
        corners = file["node_id"].values[file["target_face_nodes"].values.astype(int)]
        np.testing.assert_array_equal(corners, nodes[quads])
        assert 5 not in file["node_id"].values  # of no cell: UGRID has nodes of faces only
        assert members(file, "cell_set", "patch") == set(cells[[3, 20, 21]].tolist())
        assert members(file, "cell_set", "left half") == set(cells[:18].tolist())
        assert members(file, "node_set", "edge nodes") == {int(nodes[0]), int(nodes[4])}
        part = file["part"]
        assert part.attrs["flag_meanings"] == "none left_half right_half"
        assert part.attrs["part_names"] == "left half\nright-half"
        np.testing.assert_array_equal(part, np.repeat([1, 2], 18))
        for name in ("cell_id", "part", "cell_set_patch", "node_id", "node_set_edge_nodes"):
            location = "node" if name.startswith("node") else "face"
            assert file[name].attrs["location"] == location and file[name].attrs["long_name"]


def test_numbers_sets_and_parts_arrive_in_vtu(result, shell_deck, tmp_path):
    """All nodes are there, also that without a cell; and the file is a target again, unchanged."""
    path, nodes, cells, quads = shell_deck
    map_file(result, path, tmp_path / "m.vtu", length_unit="mm", picture=False)
    read = meshio.read(tmp_path / "m.vtu")
    np.testing.assert_array_equal(read.cell_data["cell_id"][0], cells)
    assert read.point_data["node_id"].tolist() == [5, *nodes.tolist()]
    np.testing.assert_allclose(read.points[0], 0.5)
    marked = cells[read.cell_data["cell_set:patch"][0] == 1]
    assert marked.tolist() == cells[[3, 20, 21]].tolist()
    first, again = read_target(path, length_unit="mm"), read_target(tmp_path / "m.vtu")
    for name in ("cell_ids", "node_ids", "points"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))
    for name in ("cell_sets", "node_sets", "parts"):
        before, after = getattr(first, name), getattr(again, name)
        assert {key: rows.tolist() for key, rows in after.items()} == {
            key: rows.tolist() for key, rows in before.items()
        }

    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "m.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetCellData().GetArray("cell_id")), cells)
    found = vtk_to_numpy(grid.GetPointData().GetArray("node_set:edge nodes"))
    assert set(read.point_data["node_id"][found == 1].tolist()) == {5, nodes[0], nodes[4]}


def brick_deck(make, path, kind):
    """Write a bowl of 4 x 4 x 2 solids in metres; returns the numbers of the cells."""
    points, quads = make.grid(4, 4, (-0.04, -0.04), (0.04, 0.04))
    middle = make.bowl(points, depth=6.0)
    count = len(points)
    nodes = np.concatenate([middle + [0, 0, z] for z in (-5e-4, 0.0, 5e-4)])
    cells = np.concatenate([np.hstack([quads, quads + count]) + layer * count for layer in (0, 1)])
    if kind == "C3D20R":
        edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
                 (2, 6), (3, 7)]  # fmt: skip
        ends = np.sort(cells[:, np.array(edges)].reshape(-1, 2), axis=1)
        unique, row = np.unique(ends, axis=0, return_inverse=True)
        cells = np.hstack([cells, len(nodes) + row.reshape(len(cells), -1)])
        nodes = np.concatenate([nodes, nodes[unique].mean(axis=1)])
    if kind == "C3D6":
        cells = np.concatenate([cells[:, [0, 1, 2, 4, 5, 6]], cells[:, [0, 2, 3, 4, 6, 7]]])
    ids = shuffled(len(cells), 3, 5, 1000)
    lines = ["*NODE", *[f"{k + 1}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in
                        enumerate(nodes.tolist())]]  # fmt: skip
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=CORE")
    for number, row in zip(ids, cells + 1):
        listed = [str(number), *map(str, row)]
        lines.append(
            ", ".join(listed[:11]) + (",\n " + ", ".join(listed[11:]) if listed[11:] else "")
        )
    lines += ["*ELSET, ELSET=some", f"{ids[0]}, {ids[5]}", ""]
    path.write_text("\n".join(lines))
    return ids, cells


@pytest.mark.parametrize("kind", ["SC8R", "C3D20R", "C3D6"])
def test_solids_open_in_other_programs(make, result, tmp_path, kind):
    """Their skin is the mesh that xugrid, VTK and ugrid-checks know; all cells are in a group."""
    ids, cells = brick_deck(make, tmp_path / "solid.inp", kind)
    path = tmp_path / "m.nc"
    map_file(result, tmp_path / "solid.inp", path, thickness_limit=0.3, picture=False)
    with xr.open_dataset(path, group="solid") as solid, xr.open_dataset(path) as root:
        np.testing.assert_array_equal(solid["cell_id"], ids)
        corners = {"SC8R": 8, "C3D20R": 8, "C3D6": 6}[kind]
        nodes = solid["target_volume_nodes"].values[:, :corners].astype(int)
        np.testing.assert_array_equal(solid["node_id"].values[nodes], cells[:, :corners] + 1)
        assert members(solid, "cell_set", "some") == {ids[0], ids[5]}
        values = dict(zip(solid["cell_id"].values, solid["thickness"].values, strict=True))
        assert set(root["cell_id"].values.tolist()) == set(ids.tolist())
        for number, value in zip(root["cell_id"].values, root["thickness"].values, strict=True):
            assert value == values[number]
        nodes_of = dict(zip(ids, cells[:, :corners] + 1, strict=True))
        faces = root["skin_face_nodes"].values
        for number, face in zip(root["cell_id"].values, faces, strict=True):
            own = face[face >= 0].astype(int)  # xarray makes the missing ones nan
            assert set(root["node_id"].values[own]) <= set(nodes_of[number])
        assert members(root, "cell_set", "some") == {ids[0], ids[5]}
        assert "/solid" in root["thickness"].attrs["comment"]
        faces = (16 if kind != "C3D6" else 32) * 2 + 2 * 16
        assert root.sizes["skin_face"] == faces
    read = meshio.read(tmp_path / "m.vtu")
    name = {"SC8R": "hexahedron", "C3D20R": "hexahedron20", "C3D6": "wedge"}[kind]
    assert read.cells[0].type == name
    np.testing.assert_array_equal(read.cells[0].data, cells)

    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(path, print_summary=False)
    assert not checker.logger.report_statement_logrecords(), checker.checking_report()
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(path) as opened:
        assert opened.ugrid.grid.n_face == faces
        assert opened["thickness"].ugrid.grid.topology_dimension == 2
    netcdf = pytest.importorskip("vtkmodules.vtkIONetCDF")
    reader = netcdf.vtkNetCDFUGRIDReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetOutput().GetNumberOfCells() == faces
    assert reader.GetOutput().GetCellData().HasArray("fibre_volume_fraction")


def test_the_skin_of_mapped_solids_is_no_sheet_to_map_from(make, result, tmp_path):
    brick_deck(make, tmp_path / "solid.inp", "C3D8")
    options = {"thickness_limit": 0.3, "picture": False}
    map_file(result, tmp_path / "solid.inp", tmp_path / "m.nc", **options)
    with pytest.raises(InputError, match="fields on a solid mesh"):
        read_sheet(tmp_path / "m.nc")


def test_the_report_says_what_of_the_target_is_not_kept(result, shell_deck, tmp_path):
    path, nodes, cells, _ = shell_deck
    deck = path.read_text() + f"*SURFACE, NAME=upper\n{cells[0]}, SPOS\n*ELSET, ELSET=gone\n77777\n"
    path.write_text(deck)
    report = map_file(result, path, tmp_path / "m.nc", length_unit="mm", picture=False)
    assert any("surfaces of the deck are kept as the sets of their nodes: upper" in warning
               for warning in report.warnings)  # fmt: skip
    assert any("gone (1)" in warning for warning in report.warnings)


def test_regions_and_numbers_that_vtk_writes(tmp_path, make):
    """Arrays of any file that meshio reads: numbers by their names, integers as regions."""
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import VTK_QUAD, vtkUnstructuredGrid

    points, quads = make.grid(4, 2)
    grid = vtkUnstructuredGrid()
    places = vtkPoints()
    places.SetData(numpy_to_vtk(make.lifted(points), deep=True))
    grid.SetPoints(places)
    for nodes in quads:
        grid.InsertNextCell(VTK_QUAD, 4, [int(node) for node in nodes])
    arrays = {
        "GlobalElementId": shuffled(8, 1, 5, 3), "MaterialIds": np.repeat([4, 9], 4),
        "zone": np.tile([1, 2], 4), "counter": np.arange(8.0),
    }  # fmt: skip
    for name, values in arrays.items():
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        grid.GetCellData().AddArray(array)
    ids = numpy_to_vtk(shuffled(15, 2, 4, 9), deep=True)
    ids.SetName("GlobalNodeId")
    grid.GetPointData().AddArray(ids)
    writer = xml.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(tmp_path / "t.vtu"))
    writer.SetInputData(grid)
    writer.Write()
    target = read_target(tmp_path / "t.vtu")
    np.testing.assert_array_equal(target.cell_ids, arrays["GlobalElementId"])
    np.testing.assert_array_equal(target.node_ids, shuffled(15, 2, 4, 9))
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {
        "MaterialIds 4": [0, 1, 2, 3], "MaterialIds 9": [4, 5, 6, 7],
    }  # fmt: skip
    assert {name: rows.tolist() for name, rows in target.cell_sets.items()} == {
        "zone 1": [0, 2, 4, 6], "zone 2": [1, 3, 5, 7],
    }  # fmt: skip


def test_numbers_that_repeat_are_told_and_not_used(tmp_path, make):
    points, quads = make.grid(2, 2)
    mesh = meshio.Mesh(make.lifted(points), [("quad", quads)],
                       cell_data={"element_id": [np.array([4, 5, 5, 6])]})  # fmt: skip
    mesh.write(tmp_path / "t.vtu")
    target = read_target(tmp_path / "t.vtu")
    assert target.cell_ids.tolist() == [1, 2, 3, 4]
    assert any('"element_id" repeats numbers' in note for note in target.notes)


def test_sets_count_the_cells_that_receive_fields(tmp_path):
    """Shells stand before solids in the file: rows of sets are those among the solids."""
    lines = ["*NODE", *[f"{k + 1}, {k % 2}, {k // 2 % 2}, {k // 4}" for k in range(12)]]
    lines += ["*ELEMENT, TYPE=S4, ELSET=SKIN", "1, 1, 2, 4, 3", "*ELEMENT, TYPE=C3D8, ELSET=A"]
    lines += ["20, 1, 2, 4, 3, 5, 6, 8, 7", "*ELEMENT, TYPE=C3D8, ELSET=B"]
    lines += ["30, 5, 6, 8, 7, 9, 10, 12, 11", "*ELSET, ELSET=MIXED", "1, 30", ""]
    (tmp_path / "t.inp").write_text("\n".join(lines))
    solids = read_target(tmp_path / "t.inp")
    assert solids.cell_ids.tolist() == [20, 30]
    found = {name: rows.tolist() for name, rows in solids.cell_sets.items()}
    assert found == {"A": [0], "B": [1], "MIXED": [1]}
    assert solids.node_ids[solids.node_sets["SKIN"]].tolist() == [1, 2, 3, 4]
    shells = read_target(tmp_path / "t.inp", kind="infiltration")
    assert {name: rows.tolist() for name, rows in shells.cell_sets.items()} == {
        "SKIN": [0], "MIXED": [0],
    }  # fmt: skip


def test_files_without_numbers_are_counted_from_one(tmp_path, make):
    points, quads = make.grid(2, 2)
    meshio.Mesh(make.lifted(points), [("quad", quads)]).write(tmp_path / "t.vtu")
    target = read_target(tmp_path / "t.vtu")
    assert target.cell_ids.tolist() == [1, 2, 3, 4]
    assert target.node_ids.tolist() == list(range(1, 10))
    assert not target.parts and not target.cell_sets and not target.node_sets


def test_names_that_netcdf_and_xml_cannot_hold_stay_apart(result, make, tmp_path):
    points, quads = make.grid(3, 3, (-0.04, -0.04), (0.04, 0.04))
    sets = {"a b": [np.array([0])], "a_b": [np.array([1])], 'ä<&"': [np.array([2])]}
    mesh = meshio.Mesh(make.bowl(points, depth=6.0), [("quad", quads)], cell_sets=sets)
    mesh.write(tmp_path / "t.inp")
    map_file(result, tmp_path / "t.inp", tmp_path / "m.nc", picture=False)
    with xr.open_dataset(tmp_path / "m.nc") as file:
        for number, name in enumerate(["a b", "a_b"], start=1):
            assert members(file, "cell_set", name) == {number}
    again = read_target(tmp_path / "m.vtu")
    assert again.cell_sets["ä__"].tolist() == [2]
    assert again.cell_sets["a b"].tolist() == [0] and again.cell_sets["a_b"].tolist() == [1]
