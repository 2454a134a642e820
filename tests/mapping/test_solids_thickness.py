"""A solid of another thickness than the formed sheet: told, refused, and mapped on purpose."""

import json

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import (
    MappingWeights,
    TargetMesh,
    compute_weights,
    map_file,
    read_sheet,
    transfer,
)
from lcmchain.mapping.fields import transfer_average
from lcmchain.mapping.solids.tetrahedra import solids_of_cells
from lcmchain.mapping.stage import MappingOptions

THICKNESS = 1e-3
QUIET = {"picture": False}


@pytest.fixture(scope="module")
def plate(make):
    points, quads = make.grid(10, 10, (-0.05, -0.05), (0.05, 0.05), jitter=0.2)
    first, second = make.families(make.lifted(points), quads, 0.3)
    return make.forming_result(
        make.lifted(points), quads, thickness=THICKNESS, fibre_volume_fraction=0.5,
        areal_fibre_mass=0.9, fibre_direction_1=first, fibre_direction_2=second,
    )  # fmt: skip


def stepped(make, factor, half=0.05):
    """Solid of the sheet's thickness, times a factor for x > 0: nodes and hexahedra."""
    other, cells = make.grid(8, 8, (-half, -half), (half, half))

    def shape(points, z):
        scale = np.where(points[:, :1] > 1e-9, factor, 1.0)
        return make.lifted(points) + [0.0, 0.0, z] * scale

    return make.bricks(other, cells, (-0.5 * THICKNESS, 0.0, 0.5 * THICKNESS), shape)


@pytest.mark.parametrize(
    ("factor", "said"), [(8.0, "700 % thicker"), (1.2, "20 % thicker"), (0.7, "30 % thinner")]
)
def test_a_solid_of_another_thickness_is_refused(make, plate, write_mesh, tmp_path, factor, said):
    nodes, cells = stepped(make, factor)
    mesh = write_mesh(nodes, [("hexahedron", cells)])
    with pytest.raises(InputError, match=said) as caught:
        map_file(plate, mesh, tmp_path / "mapped.nc", **QUIET)
    text = str(caught.value)
    assert "against 1 mm; " in text and "of 128 cells differ by more than 10 %" in text
    assert "Mesh the part with the formed thickness, 1 mm" in text
    assert "raise thickness_limit" in text
    assert not (tmp_path / "mapped.nc").exists()


def test_the_limit_is_ten_per_cent(make, plate, write_mesh, tmp_path):
    assert MappingOptions().thickness_limit == 0.1
    for factor, refused in ((1.09, False), (1.11, True), (0.91, False), (0.89, True)):
        mesh = write_mesh(*(lambda n, c: (n, [("hexahedron", c)]))(*stepped(make, factor)))
        if refused:
            with pytest.raises(InputError, match="more than 10 %"):
                map_file(plate, mesh, tmp_path / "mapped.nc", **QUIET)
        else:
            map_file(plate, mesh, tmp_path / "mapped.nc", **QUIET)


def test_with_the_limit_raised_the_mass_is_that_of_the_sheet(make, plate, write_mesh, tmp_path):
    """An eighth of the fibre volume fraction in eight times the thickness, and it is said."""
    nodes, cells = stepped(make, 8.0)
    mesh = write_mesh(nodes, [("hexahedron", cells)])
    report = map_file(plate, mesh, tmp_path / "mapped.nc", thickness_limit=7.5, **QUIET)
    assert any("up to 7e+02 % thicker" in text for text in report.warnings), report.warnings
    assert abs(report.conservation_error) < 1e-12
    with xr.open_dataset(tmp_path / "mapped.nc", group="solid") as mapped:
        found = {name: mapped[name].values for name in mapped.data_vars}
        attributes = mapped["solid_thickness"].attrs
    x = nodes[cells].mean(axis=1)[:, 0]
    far, near = x > 0.025, x < -0.025  # between, faces of the sheet lie over both
    np.testing.assert_allclose(found["solid_thickness"][near], THICKNESS, rtol=1e-9)
    np.testing.assert_allclose(found["solid_thickness"][far], 8.0 * THICKNESS, rtol=1e-9)
    np.testing.assert_allclose(found["thickness_difference"][far], 7.0, rtol=1e-9)
    np.testing.assert_allclose(found["thickness"], THICKNESS, rtol=1e-9)
    np.testing.assert_allclose(found["fibre_volume_fraction"][far], 0.5 / 8.0, rtol=1e-9)
    np.testing.assert_allclose(found["fibre_volume_fraction"][near], 0.5, rtol=1e-9)
    volumes = solids_of_cells(nodes, cells).volumes
    mass = np.sum(found["fibre_volume_fraction"] * 1800.0 * volumes)
    assert mass == pytest.approx(0.9 * 0.01, rel=1e-12)
    assert attributes["units"] == "m" and "solid mesh" in attributes["long_name"]
    with xr.open_dataset(tmp_path / "mapped.nc") as skin:
        assert "--thickness-limit 7.5" in skin.attrs["history"]
    vtu = meshio.read(tmp_path / "mapped.vtu").cell_data
    np.testing.assert_array_equal(vtu["thickness_difference"][0], found["thickness_difference"])


def test_cells_beyond_the_sheet_are_told(make, plate, write_mesh, tmp_path):
    nodes, cells = stepped(make, 1.0, half=0.055)
    mesh = write_mesh(nodes, [("hexahedron", cells)])
    report = map_file(plate, mesh, tmp_path / "mapped.nc", **QUIET)
    assert abs(report.conservation_error) < 1e-12
    said = [text for text in report.warnings if "hold fibre only where it is" in text]
    assert len(said) == 1 and said[0].startswith("56 cells")
    assert json.loads((tmp_path / "mapped.json").read_text())["source_coverage"] == pytest.approx(
        1.0
    )


def test_stored_weights_of_solids_map_the_same(make, plate, write_mesh, tmp_path):
    nodes, cells = stepped(make, 1.05)
    mesh = write_mesh(nodes, [("hexahedron", cells)])
    stored = tmp_path / "weights.npz"
    for name in ("first", "again"):
        map_file(plate, mesh, tmp_path / f"{name}.nc", weights_file=stored, **QUIET)
    weights = MappingWeights.load(stored)
    assert weights.solid_thickness.shape == (len(cells),)
    with (
        xr.open_dataset(tmp_path / "first.nc") as one,
        xr.open_dataset(tmp_path / "again.nc") as two,
    ):
        for name in one.data_vars:
            np.testing.assert_array_equal(one[name].values, two[name].values)


@pytest.mark.parametrize("order", [1, 2])
def test_a_linear_field_within_the_sheet(make, order):
    """Second order finds the mean over every cell exactly; first order does not."""
    points, quads = make.grid(9, 8, (-0.05, -0.05), (0.05, 0.05), jitter=0.3)
    sheet = read_sheet(
        make.forming_result(make.lifted(points), quads, thickness=lambda c: 1e-3 + 4e-3 * c[:, 0])
    )
    linear = 1e-3 + 4e-3 * sheet.surface.centroids[:, 0]
    sheet.scalars["thickness"][:] = linear
    other, cells = make.grid(11, 7, (-0.03, -0.03), (0.03, 0.03), jitter=0.2, seed=1)
    nodes, corners = make.bricks(other, cells, (-5e-4, 2e-4, 5e-4), kind="tetra")
    target = TargetMesh(nodes, (("tetra", corners),), {})
    weights = compute_weights(sheet, target, order=order)
    found = transfer_average(sheet, weights, linear)
    error = np.abs(found - (1e-3 + 4e-3 * target.centroids[:, 0])).max()
    if order == 2:
        assert error < 1e-15
    else:
        assert error > 1e-6


def test_second_order_keeps_the_mass_on_a_curved_solid(make):
    points, quads = make.grid(14, 13, (-0.5, -0.5), (0.5, 0.5), jitter=0.2)
    fields = {
        "thickness": 0.04,
        "areal_fibre_mass": lambda c: 20.0 * (1.0 + np.sin(5.0 * c[:, 0])),
        "fibre_volume_fraction": lambda c: 0.5 * (1.0 + np.sin(5.0 * c[:, 0])),
    }
    sheet = read_sheet(make.forming_result(make.bowl(points), quads, **fields))
    other, cells = make.grid(17, 18, (-0.55, -0.55), (0.55, 0.55), jitter=0.2, seed=1)
    nodes, corners = make.bricks(other, cells, (-0.02, 0.02), make.shell_of_bowl(0.3))
    target = TargetMesh(nodes, (("hexahedron", corners),), {})
    weights = compute_weights(sheet, target)
    fraction = transfer(sheet, target, weights).scalars["fibre_volume_fraction"]
    mass = np.sum(fraction * 1000.0 * solids_of_cells(nodes, corners).volumes)
    whole = np.sum(sheet.scalars["areal_fibre_mass"] * sheet.surface.areas)
    assert mass == pytest.approx(whole, rel=1e-12)
    inner = np.abs(target.centroids[:, :2]).max(axis=1) < 0.4
    exact = 0.5 * (1.0 + np.sin(5.0 * target.centroids[:, 0]))
    off = np.abs(fraction - exact)[inner].max()
    first = compute_weights(sheet, target, order=1)
    coarse = transfer(sheet, target, first).scalars["fibre_volume_fraction"]
    assert off < 0.35 * np.abs(coarse - exact)[inner].max()
