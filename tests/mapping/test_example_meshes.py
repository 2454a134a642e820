"""The target meshes of the hemisphere example describe the ideally formed part."""

import importlib.util
from pathlib import Path

import meshio
import numpy as np
import pytest

from lcmchain.mapping import read_target

FOLDER = Path(__file__).parents[2] / "examples" / "hemisphere_holder"


@pytest.fixture(scope="module")
def make_meshes():
    specification = importlib.util.spec_from_file_location("make_meshes", FOLDER / "make_meshes.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_meridian_touches_punch_and_fillet_without_a_kink(make_meshes):
    meridian = make_meshes.Meridian()
    length = np.linspace(0.0, 0.15, 30001)
    r, z = meridian.at(length)
    step = np.hypot(np.diff(r), np.diff(z)) / np.diff(length)
    np.testing.assert_allclose(step, 1.0, atol=1e-6)  # parametrised by arc length
    slope = np.unwrap(np.arctan2(np.diff(z), np.diff(r)))
    assert np.abs(np.diff(slope)).max() < 1.1 * np.diff(length)[0] / meridian.fillet_radius
    # Half a thickness off the tools, never nearer.
    half = 0.5 * make_meshes.THICKNESS
    pole = make_meshes.THICKNESS - make_meshes.STROKE
    to_punch = np.hypot(r, z - pole - make_meshes.PUNCH_RADIUS) - make_meshes.PUNCH_RADIUS
    fillet = make_meshes.HOLE_RADIUS + make_meshes.FILLET_RADIUS, -make_meshes.FILLET_RADIUS
    to_fillet = np.hypot(r - fillet[0], z - fillet[1]) - make_meshes.FILLET_RADIUS
    assert to_punch.min() == pytest.approx(half, rel=1e-9)
    assert to_fillet.min() == pytest.approx(half, rel=1e-9)
    assert z[0] == pytest.approx(-0.074498, abs=1e-9)
    assert z[-1] == pytest.approx(half)


def test_the_parts_end_inside_the_drawn_in_blank(make_meshes):
    reach = make_meshes.Meridian().at(np.array([0.15]))[0][0]  # end of a fibre through the pole
    assert make_meshes.STRUCTURE_HALF_WIDTH < make_meshes.INFILTRATION_HALF_WIDTH < reach - 5e-3


@pytest.mark.parametrize(
    ("name", "kind", "cells"),
    [("infiltration", "infiltration", "triangle"), ("structure", "structure", "quad")],
)
def test_the_files_are_those_of_the_script(make_meshes, tmp_path, monkeypatch, name, kind, cells):
    file = FOLDER / f"{name}.vtu"
    assert file.stat().st_size < 500_000
    target = read_target(file, kind=kind)
    assert [block for block, _ in target.blocks] == [cells]
    monkeypatch.setattr(make_meshes, "__file__", str(tmp_path / "make_meshes.py"))
    make_meshes.main()
    anew = meshio.read(tmp_path / f"{name}.vtu")
    np.testing.assert_allclose(target.points, anew.points, atol=1e-12)
    np.testing.assert_array_equal(target.blocks[0][1], anew.cells[0].data)


@pytest.mark.parametrize("name", ["infiltration", "structure"])
def test_cells_are_well_shaped(name):
    surface = read_target(FOLDER / f"{name}.vtu").surface
    assert np.all(surface.normals[:, 2] > 0.15)  # upwards everywhere: no cell is turned over
    corners = surface.triangle_corners
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    doubled = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert np.min(doubled / edges.max(axis=1) ** 2) > 0.2
