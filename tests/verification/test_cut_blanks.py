"""Formed blanks with a hole and darts, and the flat outline of a wanted rim."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from lcmchain.fields.dataset import SHEET
from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.mesh.cells import boundary_edges
from lcmchain.pattern.flat import flat_pattern
from lcmchain.pattern.rounds import SceneForming
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
    scene = read_scene(SCENE, COARSE)
    return run(scene, tmp_path_factory.mktemp("darts"))


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


def test_darts_close_as_the_fabric_shears_and_where_their_sides_pass_is_told(darts):
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
    assert 0.5 * mouth[0] < mouth[1] < mouth[0] - EDGE
    # the hole lies on the pole of the punch and keeps its size but for bending
    edges = boundary_edges(sheet_faces(sheet))
    hole = np.unique(edges[(np.hypot(*flat[edges].mean(axis=1).T) < 0.03)])
    assert np.hypot(*flat[hole].T) == pytest.approx(0.02, rel=0.04)
    assert np.hypot(*formed[hole, :2].T) == pytest.approx(np.hypot(*flat[hole].T), rel=0.08)
    # next to the apexes the sides have slid over each other: no contact keeps a ply off itself
    told = [text for text in darts.summary["warnings"] if "passes through itself" in text]
    assert len(told) == 1


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
