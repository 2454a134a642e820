"""CGNS files as targets: mixed sections, zones, conditions; Gmsh's in test_target_universal.py."""

import h5py
import meshio
import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping import read_target

PLACES = np.array([(0, 0, 0), (20, 0, 0), (20, 20, 1.5), (0, 20, 0), (30, 10, 0)], dtype=float)
TRIANGLE, QUAD, BAR, MIXED, NGON = 5, 7, 3, 20, 22


def node(parent, name, label, data=None):
    """A node of the file mapping: its label, and its data in a dataset of their own."""
    group = parent.create_group(name)
    group.attrs["label"] = np.bytes_(label)
    if isinstance(data, str):
        data = np.frombuffer(data.encode(), dtype=np.int8)
    if data is not None:
        group[" data"] = np.asarray(data)
    return group


def section(zone, name, kind, first, last, connectivity):
    own = node(zone, name, "Elements_t", np.array([kind, 0], np.int32))
    node(own, "ElementRange", "IndexRange_t", np.array([first, last], np.int32))
    node(own, "ElementConnectivity", "DataArray_t", np.array(connectivity, np.int32))


def condition(conditions, name, location, **entries):
    own = node(conditions, name, "BC_t", "BCInflow")
    if location:
        node(own, "GridLocation", "GridLocation_t", location)
    for entry, numbers in entries.items():
        node(own, entry, "IndexArray_t", np.array([numbers], np.int32))
    return own


def written(path, zones=1, kind="Unstructured", unit="Millimeter"):
    with h5py.File(path, "w") as file:
        node(file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([4.0], np.float32))
        base = node(file, "Plate", "CGNSBase_t", np.array([2, 3], np.int32))
        words = "".join(word.ljust(32) for word in ("Kilogram", unit, "Second", "Kelvin", "Degree"))
        node(base, "DimensionalUnits", "DimensionalUnits_t", words)
        family = node(base, "F1", "Family_t")
        node(family, "left gate", "FamilyName_t", "left gate")
        for k in range(zones):
            zone = node(base, f"Zone{k}", "Zone_t", np.array([[5], [3], [0]], np.int32))
            node(zone, "ZoneType", "ZoneType_t", kind)
            grid = node(zone, "GridCoordinates", "GridCoordinates_t")
            for axis, column in zip("XYZ", (PLACES + [40.0 * k, 0, 0]).T):
                node(grid, f"Coordinate{axis}", "DataArray_t", column)
            section(zone, "rim", BAR, 4, 5, [1, 2, 2, 3])
            section(zone, "shells", MIXED, 1, 3, [TRIANGLE, 2, 5, 3, QUAD, 1, 2, 3, 4, TRIANGLE,
                                                  1, 2, 5])  # fmt: skip
            section(zone, "faces", NGON, 6, 7, [3, 1, 2, 3, 3, 1, 2, 3])
            conditions = node(zone, "ZoneBC", "ZoneBC_t")
            node(condition(conditions, "BC1", "CellCenter", PointList=[2]), "FamilyName",
                 "FamilyName_t", "F1")  # fmt: skip
            condition(conditions, "edge", "EdgeCenter", PointRange=[4, 5])
            condition(conditions, "points", "", PointList=[1, 4, 9])
            condition(conditions, "lost", "FaceCenter", PointList=[3, 6])
    return path


def test_mixed_sections_and_conditions(tmp_path):
    target = read_target(written(tmp_path / "a.cgns"), length_unit="mm")
    np.testing.assert_allclose(target.points, 1e-3 * PLACES, atol=1e-15)
    assert [(name, rows.tolist()) for name, rows in target.blocks] == [
        ("triangle", [[1, 4, 2], [0, 1, 4]]), ("quad", [[0, 1, 2, 3]]),
    ]  # fmt: skip
    assert target.cell_ids.tolist() == [1, 3, 2]
    assert {name: rows.tolist() for name, rows in target.parts.items()} == {"shells": [0, 1, 2]}
    cells = {name: rows.tolist() for name, rows in target.cell_sets.items()}
    assert cells == {"left gate": [2], "lost": [1]}
    nodes = {name: rows.tolist() for name, rows in target.node_sets.items()}
    assert nodes == {"points": [0, 3], "rim": [0, 1, 2], "edge": [0, 1, 2]}
    assert target.ignored == {"line": 2, "NGON": 2}
    said = " | ".join(target.notes)
    assert "lost lists 1 elements that are left aside" in said
    assert "points lists 1 nodes that do not exist" in said and "length_unit" not in said


def test_zones_stand_side_by_side(tmp_path):
    target = read_target(written(tmp_path / "a.cgns", zones=2), length_unit="m")
    np.testing.assert_array_equal(target.points[5:] - target.points[:5], [[40.0, 0, 0]] * 5)
    assert target.cell_count == 6 and list(target.parts) == ["Zone0.shells", "Zone1.shells"]
    quads = np.concatenate([rows for name, rows in target.blocks if name == "quad"])
    assert quads.tolist() == [[0, 1, 2, 3], [5, 6, 7, 8]]
    assert len(target.cell_sets["left gate"]) == 2
    said = " | ".join(target.notes)
    assert "2 zones are taken side by side" in said
    assert 'states its unit of length as "mm", but length_unit is "m"' in said


def test_files_of_meshio_and_those_that_are_refused(tmp_path):
    cells = [("tetra", np.array([[0, 1, 3, 2]]))]
    meshio.Mesh(PLACES, cells).write(tmp_path / "m.cgns")
    assert read_target(tmp_path / "m.cgns").blocks[0][1].tolist() == [[0, 1, 3, 2]]
    with pytest.raises(InputError, match="zone Zone0 is structured"):
        read_target(written(tmp_path / "a.cgns", kind="Structured"))
    with pytest.raises(InputError, match="has no zones"):
        read_target(written(tmp_path / "b.cgns", zones=0))
    (tmp_path / "c.cgns").write_bytes(b"@(#)ADF Database Version A02011>\n")
    with pytest.raises(InputError, match="old ADF form.* convert it with adf2hdf"):
        read_target(tmp_path / "c.cgns")
