"""What NETGEN itself writes of one mesh, as target and as tool."""

import gzip
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.mapping import read_target
from lcmchain.tools import ToolWarning
from lcmchain.tools.surfaces.reading import read_triangles

EXPORTS = {"inp": "Abaqus Format", "msh": "Gmsh2 Format", "stl": "STL Format"}
#: Largest error of a coordinate [mm]: into other formats NETGEN writes six digits.
DIGITS = {"vol": 1e-12, "vol.gz": 1e-12, "inp": 1e-4, "msh": 1e-6, "stl": 1e-4}


@pytest.fixture(scope="module", params=[1, 2])
def plate(request, tmp_path_factory):
    """A plate with a hole, meshed in first or second order: its cells, names and files."""
    pytest.importorskip("netgen.meshing")
    occ = pytest.importorskip("netgen.occ")
    folder = tmp_path_factory.mktemp("netgen")
    solid = occ.Box((0, 0, 0), (20, 12, 8)) - occ.Cylinder(occ.Pnt(10, 6, 0), occ.Z, 3, 8)
    solid.faces.name = "rim"
    solid.faces.Min(occ.Z).name, solid.faces.Max(occ.Z).name = "bottom", "top"
    solid.mat("preform")
    mesh = occ.OCCGeometry(solid).GenerateMesh(maxh=6)
    if request.param == 2:
        mesh.SecondOrder()
    for ending, name in EXPORTS.items():
        mesh.Export(str(folder / f"plate.{ending}"), name)
    for ending in ("vol", "vol.gz"):
        mesh.Save(str(folder / f"plate.{ending}"))
    points = np.array([point.p for point in mesh.Points()])

    def cells(elements):
        return points[np.array([[node.nr - 1 for node in e.points] for e in elements])]

    faces = mesh.Elements2D()
    names = np.array([mesh.GetBCName(face.index - 1) for face in faces])
    return SimpleNamespace(
        order=request.param, folder=folder, solids=cells(mesh.Elements3D()), faces=cells(faces),
        names=names,
    )  # fmt: skip


def rows_of(found, expected, digits):
    """Rows of the expected cells (C, K, 3) that have the same nodes as the found ones."""
    assert found.shape == expected.shape
    rows = cKDTree(expected.mean(axis=1)).query(found.mean(axis=1))[1]
    assert len(np.unique(rows)) == len(found)
    far = np.abs(found[:, :, None] - expected[rows][:, None]).max(axis=3)
    assert far.min(axis=2).max() < digits
    return rows


@pytest.mark.parametrize("ending", [ending for ending in DIGITS if ending != "stl"])
def test_a_mesh_with_its_materials_and_boundaries(plate, ending):
    file = plate.folder / f"plate.{ending}"
    solid, skin = read_target(file), read_target(file, kind="infiltration")
    ((kind, nodes),) = solid.blocks
    assert kind == {1: "tetra", 2: "tetra10"}[plate.order]
    rows_of(solid.points[nodes], plate.solids, DIGITS[ending])
    corners = solid.points[nodes[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    turned = ending == "msh"  # as NETGEN writes them, and the reader tells
    assert ((np.linalg.det(edges) < 0) == turned).all()
    assert any("562 solids are inside out" in note for note in solid.notes) == turned
    ((kind, nodes),) = skin.blocks
    assert kind == {1: "triangle", 2: "triangle6"}[plate.order]
    names = plate.names[rows_of(skin.points[nodes], plate.faces, DIGITS[ending])]
    if ending == "msh":
        return  # NETGEN writes numbers into it, no names
    kept = {**skin.cell_sets, **skin.parts}
    assert {name: set(rows) for name, rows in kept.items()} == {
        name: set(np.flatnonzero(names == name)) for name in ("bottom", "rim", "top")
    }
    whole = {**solid.cell_sets, **solid.parts}["preform"]
    assert len(whole) == len(plate.solids)
    top = solid.points[solid.node_sets["top"]]
    assert (top[:, 2] > 8 - 1e-4).all() and len(top) == len(np.unique(top, axis=0))


@pytest.mark.parametrize("ending", DIGITS)
def test_a_tool(plate, ending):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToolWarning)  # about the solids
        points, triangles = read_triangles(plate.folder / f"plate.{ending}")
    rows_of(points[triangles], plate.faces[:, :3], DIGITS[ending])


def test_a_compressed_file_that_is_damaged(plate):
    whole = (plate.folder / "plate.vol.gz").read_bytes()
    cut = plate.folder / "cut.vol.gz"
    cut.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"cut.vol.gz: cannot be unpacked .*compress"):
        read_target(cut)
    text = gzip.decompress(whole).replace(b"volumeelements\n", b"volumeelements\nx", 1)
    wrong = plate.folder / "wrong.vol.gz"
    wrong.write_bytes(gzip.compress(text))
    with pytest.raises(InputError, match=r"^\S*wrong.vol.gz: line") as error:
        read_target(wrong)
    assert str(error.value).count("wrong.vol.gz") == 1
