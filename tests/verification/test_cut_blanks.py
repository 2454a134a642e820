"""Formed blanks with a hole and darts, and the flat outline of a wanted rim."""

import shutil
from pathlib import Path

import meshio
import numpy as np
import pytest
import xarray as xr
from scipy.spatial import cKDTree

from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.solids.stack_compaction import compaction_of
from lcmchain.errors import InputError
from lcmchain.fields.dataset import SHEET
from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.mapping import MappingOptions, map_file
from lcmchain.mesh.cells import boundary_edges
from lcmchain.pattern.flat import SceneForming, flat_pattern, trimming_line
from lcmchain.pattern.formed import FormedSheet
from lcmchain.pattern.tables import rim_table, section_table
from lcmchain.pipeline import run
from lcmchain.scene import read_scene

SCENE = Path(__file__).parents[2] / "examples/darts/scene.toml"
EDGE = 10e-3
COARSE = [
    'blank.edge_length="10 mm"', "process.frames=3", 'process.time="150 ms"',
    'process.mass_damping="200 1/s"', "output={ pictures = false, report = false, vtu = false }",
]  # fmt: skip

pytestmark = pytest.mark.skipif(not SCENE.is_file(), reason="needs the checkout")


@pytest.fixture(scope="module")
def darts(tmp_path_factory):
    """The example; its drawing is gone once it has been formed."""
    folder = tmp_path_factory.mktemp("darts")
    for file in ("scene.toml", "part.dxf"):
        shutil.copy(SCENE.parent / file, folder)
    result = run(read_scene(folder / "scene.toml", COARSE), folder / "out")
    (folder / "part.dxf").unlink()
    return result


def test_a_blank_with_a_hole_and_four_darts_is_formed_symmetrically(darts):
    sheet = darts.datasets[SHEET]
    flat, formed = reference_positions(sheet)[:, :2], sheet_positions(sheet)
    tree = cKDTree(flat)
    for mirror in ([-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
        away, image = tree.query(flat * mirror[:2])
        assert away.max() < 1e-12
        assert np.abs(formed[image] - formed * mirror).max() < 1e-3 * EDGE
    energy = darts.summary["energy"]
    assert abs(energy["balance_error"]) < 1e-3 * energy["internal"]


def test_darts_close_as_the_fabric_shears_and_their_sides_do_not_meet(darts):
    sheet = darts.datasets[SHEET]
    flat, formed = reference_positions(sheet)[:, :2], sheet_positions(sheet)
    tree = cKDTree(flat)
    ends = tree.query([(0.15, 0.095), (0.095, 0.15)])[1]
    across = np.array([1.0, -1.0]) / np.sqrt(2.0)
    mouth = (
        (flat[ends[0]] - flat[ends[1]]) @ across,
        (formed[ends[0], :2] - formed[ends[1], :2]) @ across,
    )
    assert mouth[0] == pytest.approx(0.055 * np.sqrt(2.0), rel=1e-9)
    assert mouth[0] - 2.0 * EDGE < mouth[1] < mouth[0] - 0.2 * EDGE
    # the hole lies on the pole of the punch and keeps its size but for bending
    edges = boundary_edges(sheet_faces(sheet))
    hole = np.unique(edges[(np.hypot(*flat[edges].mean(axis=1).T) < 0.03)])
    assert np.hypot(*flat[hole].T) == pytest.approx(0.02, rel=0.04)
    assert np.hypot(*formed[hole, :2].T) == pytest.approx(np.hypot(*flat[hole].T), rel=0.08)
    # the apexes stay in the flange, and the sides do not come together
    assert not any("passes through itself" in text for text in darts.summary["warnings"])


def test_a_result_is_complete_without_the_drawing_of_its_blank(darts, tmp_path):
    """Tables, trimming line, mapping and what fills it need the result alone; a new run tells."""
    forming = tmp_path / "forming.nc"  # by itself, in another folder
    shutil.copy(darts.folder / "forming.nc", forming)
    sheet = xr.load_dataset(forming)
    assert len(rim_table(sheet)["draw-in [m]"]) > 100
    assert len(section_table(sheet, np.zeros(3), np.array([0.0, 1.0, 0.0]))["element"]) > 10
    ring = 0.09 * np.stack([np.cos(np.arange(12.0)), np.sin(np.arange(12.0))], axis=1)
    net = ring[np.argsort(np.arctan2(*ring.T[::-1]))]
    assert trimming_line(FormedSheet.of_result(sheet), net, key="net").shape[1] == 2
    meshio.Mesh(sheet_positions(sheet), [("quad", sheet_faces(sheet)[:50])]).write(
        tmp_path / "target.vtu"
    )
    map_file(forming, tmp_path / "target.vtu", tmp_path / "mapped.nc", MappingOptions())
    assert (tmp_path / "mapped.nc").is_file()
    part = read_formed_part(forming)
    assert len(compaction_of(part).thickness) == part.target.cell_count
    with pytest.raises(InputError, match="part.dxf") as caught:
        read_scene(darts.folder.parent / "scene.toml")
    assert caught.value.key == "blank.drawing.file"


def test_the_outline_of_a_flat_pattern_is_formed_to_the_wanted_rim(tmp_path):
    whole = ['blank={ size = ["300 mm", "300 mm"], edge_length = "10 mm", height = "0.502 mm" }']
    scene = read_scene(SCENE, [*whole, *COARSE[1:]])
    angle = 2.0 * np.pi * np.arange(72) / 72
    net = 0.115 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rounds = flat_pattern(net, SceneForming(scene, tmp_path), tolerance=0.05 * EDGE, most_rounds=2)
    assert rounds[-1].miss < 0.25 * EDGE  # half an edge is asked of it
    # drawn in further along the fibres than across: the flat outline is no circle
    radius = np.hypot(*rounds[-1].outline.T)
    assert np.ptp(radius) > EDGE / 2
