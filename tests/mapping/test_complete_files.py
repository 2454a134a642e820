"""Mapped files say as much as the forming result: every field, its meaning, where it is from."""

import hashlib
import shlex

import meshio
import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.forming_fields import permeability_fields
from lcmchain.fields import FrameSeries, add_face_variables, build_datasets, write_forming_netcdf
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.mapping import map_file, read_sheet
from lcmchain.mesh.blank import build_blank
from lcmchain.scene import scene_from_text

SCENE = """
title = "Plate"
[process]
time = "20 ms"
[blank]
size = ["80 mm", "80 mm"]
edge_length = "8 mm"
[material]
preset = "MD600"
[permeability]
law = "gebart"
fibre_radius = "3.5 um"
packing = "hexagonal"
"""


@pytest.fixture(scope="module")
def formed(tmp_path_factory):
    """A folder with the file of a sheet that was sheared by 15 degrees under a pressure."""
    scene = scene_from_text(SCENE)
    blank = build_blank(scene.blank, scene.material.thickness)
    moved = blank.node_positions.copy()
    moved[:, 0] += np.tan(np.radians(15.0)) * moved[:, 1]
    frames = FrameSeries(
        time=np.array([0.0, 0.02]),
        positions=np.stack([blank.node_positions, moved]),
        tool_travel=np.zeros((2, 0)),
        tool_force=np.zeros((2, 0, 3)),
        contact_force=np.stack([np.zeros(blank.node_count), np.full(blank.node_count, 0.1)]),
    )
    groups = build_datasets(scene, blank, frames)
    groups = add_face_variables(groups, permeability_fields(scene.permeability, groups["/"]))
    groups["/"].attrs["state"] = "stopped: by the test"
    folder = tmp_path_factory.mktemp("formed")
    write_forming_netcdf(folder / "forming.nc", groups)
    return folder


@pytest.fixture(scope="module")
def mapped(formed, make):
    """The mapped file, as a dataset, and the report; the mesh is in millimetres."""
    points, quads = make.grid(7, 6, (-25.0, -25.0), (25.0, 25.0))
    meshio.Mesh(make.lifted(points), [("quad", quads)]).write(formed / "part.vtu")
    report = map_file(
        formed / "forming.nc", formed / "part.vtu", formed / "mapped.nc",
        kind="infiltration", length_unit="mm", maximum_distance=3e-3, picture=False,
        allow_incomplete=True,
    )  # fmt: skip
    with xr.open_dataset(formed / "mapped.nc") as dataset:
        return dataset.load(), report


def test_every_face_field_arrives_with_its_meaning(formed, mapped):
    dataset, report = mapped
    assert report.ignored_fields == []
    with xr.open_dataset(formed / "forming.nc") as sheet:
        fields = [str(n) for n in sheet.data_vars if sheet[n].dims == ("time", "sheet_face")]
        assert {"bending_pressure", "permeability_direction_3_z", "fibre_strain_2"} <= set(fields)
        for name in fields:
            about = dataset[name].attrs
            # the sign of the shear angle is that of the cell, not of the sheet, and says so
            kept = ("units", "long_name") + (() if name == "shear_angle" else ("comment",))
            for key in kept:
                assert about[key] == sheet[name].attrs[key], (name, key)
            assert (about["mesh"], about["location"]) == ("target", "face")
            assert np.isfinite(dataset[name]).all(), name
    assert "normal of the cell" in dataset["shear_angle"].attrs["comment"]


def test_the_pressure_of_tools_is_mapped_from_the_nodes_to_cells(formed, mapped):
    dataset, _ = mapped
    for side in ("top", "bottom"):
        variable = dataset[f"tool_pressure_{side}"]
        assert variable.attrs["units"] == "Pa"
        assert "mean of the nodes" in variable.attrs["comment"]
    # 0.1 N on every node, each of which has 64 mm2 within the sheet
    np.testing.assert_allclose(dataset["tool_pressure_top"], 0.1 / 64e-6, rtol=1e-9)
    sheet = read_sheet(formed / "forming.nc", frame=0)
    assert np.all(sheet.scalars["tool_pressure_top"] == 0.0)


def test_vtu_holds_the_same_fields(formed, mapped):
    dataset, _ = mapped
    data = meshio.read(formed / "mapped.vtu").cell_data
    for name, variable in dataset.data_vars.items():
        if variable.dims != ("target_face",):
            continue
        if name[-2:] in ("_x", "_y", "_z"):
            found = data[name[:-2]][0][:, "xyz".index(name[-1])]
        else:
            found = data[name][0]
        np.testing.assert_array_equal(found, variable, err_msg=name)


def test_the_file_says_where_it_is_from(formed, mapped):
    dataset, _ = mapped
    attributes = dataset.attrs
    assert attributes["Conventions"] == "CF-1.11 UGRID-1.0"
    assert attributes["title"] == "Plate: forming fields on the infiltration mesh mapped"
    assert attributes["scene"] == SCENE
    assert attributes["scene_sha256"] == hashlib.sha256(SCENE.encode()).hexdigest()
    for what, file in (("source", "forming.nc"), ("target", "part.vtu")):
        assert attributes[f"{what}_file"] == file
        content = (formed / file).read_bytes()
        assert attributes[f"{what}_sha256"] == hashlib.sha256(content).hexdigest()
    assert attributes["state"] == "stopped: by the test"
    assert attributes["material"] == "MD600"
    assert attributes["fibre_density_kg_m3"] == 1810.0
    assert float(dataset["time"]) == 0.02


def test_other_programs_open_it_in_plan_view(formed, mapped):
    dataset, _ = mapped
    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(formed / "mapped.nc", print_summary=False)
    assert not checker.logger.report_statement_logrecords(), checker.checking_report()
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(formed / "mapped.nc") as opened:
        assert opened.ugrid.grid.area.sum() == pytest.approx(0.05**2, rel=1e-9)
    netcdf = pytest.importorskip("vtkmodules.vtkIONetCDF")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = netcdf.vtkNetCDFUGRIDReader()
    reader.SetFileName(str(formed / "mapped.nc"))
    reader.Update()
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData())
    np.testing.assert_allclose(points[:, 0], dataset["target_node_x"], atol=1e-8)
    np.testing.assert_allclose(points[:, 1], dataset["target_node_y"], atol=1e-8)
    values = vtk_to_numpy(grid.GetCellData().GetArray("permeability_1"))
    np.testing.assert_array_equal(values, dataset["permeability_1"])


def test_the_history_names_the_command_that_maps_so(formed, mapped, tmp_path):
    dataset, _ = mapped
    step, origin = dataset.attrs["history"].split("\n")
    assert "formed by lcmchain" in origin
    told = shlex.split(step.partition("as by: ")[2])
    assert told[:2] == ["lcmchain", "map"]
    places = {"forming.nc": formed / "forming.nc", "part.vtu": formed / "part.vtu"}
    places["mapped.nc"] = tmp_path / "again.nc"
    done = CliRunner().invoke(app, [str(places.get(word, word)) for word in told[1:]])
    assert done.exit_code == 0, done.output
    with xr.open_dataset(tmp_path / "again.nc") as again:
        xr.testing.assert_equal(again, dataset)


def test_a_mapped_file_is_a_source_again(formed, mapped):
    """Its mesh lists x z y, the plan view of VTK's reader; `axis` says which is which."""
    sheet = read_sheet(formed / "mapped.nc")
    assert np.ptp(sheet.surface.points, axis=0) == pytest.approx([0.05, 0.05, 0.0], abs=1e-12)
    assert sheet.time == 0.02


def test_results_of_earlier_versions_are_read(formed):
    with xr.open_dataset(formed / "forming.nc", mask_and_scale=False) as dataset:
        earlier = dataset.load().rename_vars(time="frame_time").swap_dims(time="frame")
    earlier.coords["time"] = ("time", [0.0, 0.02])
    for frame in (0, -1):
        now, then = (read_sheet(s, frame=frame) for s in (formed / "forming.nc", earlier))
        assert now.time == then.time == (0.0, 0.02)[frame]
        np.testing.assert_array_equal(now.scalars["thickness"], then.scalars["thickness"])


def test_meshes_list_their_coordinates_as_their_readers_take_them():
    for dimension, order in ((2, "xzy"), (3, "xyz")):
        mesh = UgridMesh("part", dimension)
        variables = mesh.topology(np.zeros((1, 4)), long_name="a part")
        listed = variables["part"][2]["node_coordinates"].split()
        assert listed == [f"part_node_{axis}" for axis in order]
