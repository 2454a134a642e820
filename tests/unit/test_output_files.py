"""Result files: what they hold, who reads them, and that they are whole or absent."""

import os
import xml.etree.ElementTree as ET

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError, OutputError
from lcmchain.fields import (
    FrameSeries,
    add_face_variables,
    build_datasets,
    fibre_mass,
    field_summary,
    read_forming,
    read_group,
    sheet_areas,
    sheet_positions,
    write_forming_netcdf,
    write_pvd,
    write_vtu,
)
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.ugrid import CONVENTIONS, TIME, UgridMesh, saved_times
from lcmchain.judgements.fields import field_warnings
from lcmchain.mesh.blank import build_blank
from lcmchain.quantities.fields import BETWEEN_PLIES, FIELDS
from lcmchain.scene import scene_from_text

# An outline with a slanted side, which leaves halved cells (triangles), and a title beyond ASCII.
SCENE = """
title = "Dome 0°/90°"
[process]
time = "20 ms"
[blank]
outline = ["-40 -40 mm", "40 -40 mm", "40 20 mm", "20 40 mm", "-40 40 mm"]
edge_length = "8 mm"
[material]
preset = "MD600"
"""
FRAMES = 4

OF_OTHER_FAMILIES = (
    "fibre_direction_3", "fibre_strain_3", "shear_angle_23", "shear_angle_31", "strain_across",
)  # fmt: skip


def dome(positions, height):
    """Raise the sheet to a dome; faces become warped."""
    x, y, z = positions.T
    lift = height * np.exp(-(x**2 + y**2) / 0.025**2)
    return np.stack([x, y, z * (1.0 - 4.0 * lift) + lift], axis=1)


@pytest.fixture(scope="module")
def scene():
    return scene_from_text(SCENE)


@pytest.fixture(scope="module")
def blank(scene):
    mesh = build_blank(scene.blank, scene.material.thickness)
    assert 0 < mesh.is_triangle.sum() < mesh.element_count
    return mesh


@pytest.fixture(scope="module")
def frames(blank):
    share = np.linspace(0.0, 1.0, FRAMES)
    return FrameSeries(
        time=0.02 * share,
        positions=np.stack([dome(blank.node_positions, 0.02 * s) for s in share]),
        tool_travel=np.stack([0.02 * share, 0.0 * share], axis=1),
        tool_force=np.stack([np.outer(share, [0, 3.0, 4.0]), np.outer(share, [0, 0, -9.0])], 1),
        energy={"kinetic": share * (1 - share), "internal": share**2, "balance_error": 0 * share},
        tool_names=("punch", "die"),
        contact_force=np.outer(share, np.arange(blank.node_count)),
    )


@pytest.fixture(scope="module")
def datasets(scene, blank, frames):
    return build_datasets(scene, blank, frames)


@pytest.fixture(scope="module")
def file(datasets, tmp_path_factory):
    path = tmp_path_factory.mktemp("result") / "forming.nc"
    write_forming_netcdf(path, datasets)
    return path


# --- contents -------------------------------------------------------------------------------------


def test_reading_gives_back_what_was_written(file, datasets):
    xr.testing.assert_identical(read_forming(file), datasets["/"])
    for group in ("solid", "history"):
        xr.testing.assert_identical(read_group(file, group), datasets[f"/{group}"])


def test_every_face_and_node_variable_says_what_it_is(file):
    with xr.open_dataset(file) as sheet:
        for name in sheet.variables:
            attributes = sheet[name].attrs
            assert attributes["long_name"]
            if name not in ("sheet", "sheet_face_nodes"):
                assert attributes["units"], name
        for field in FIELDS.values():
            # permeabilities need a law, the pressure of both sides the 2D approach, pores a fluid,
            # springback a stage that ends at rest, the wrinkle risk a scene that asks
            if field.name.startswith(("permeability", "wrinkle_risk")):
                continue
            if field.name in ("tool_pressure", "pore_pressure", "springback"):
                continue
            if field.name in OF_OTHER_FAMILIES:  # of a fabric with one or three of them
                assert not set(field.variables) & set(sheet.variables)
                continue
            if field.name.startswith("stack_") or field.name in BETWEEN_PLIES:  # of several plies
                assert not set(field.variables) & set(sheet.variables)
                continue
            for name in field.variables:
                assert sheet[name].attrs["mesh"] == "sheet"
                assert sheet[name].attrs["location"] == field.location
                assert sheet[name].attrs["units"] == field.units
                assert sheet[name].dims[-1] == f"sheet_{field.location}"
                assert (sheet[name].dims[0] == "time") == (field.name != "reference_position")


def test_the_agreed_names_of_the_mesh(file):
    sheet = read_forming(file)
    mesh = sheet["sheet"].attrs
    assert mesh["cf_role"] == "mesh_topology"
    assert mesh["topology_dimension"] == 2
    assert mesh["node_coordinates"] == "sheet_node_x sheet_node_z sheet_node_y"
    assert mesh["face_node_connectivity"] == "sheet_face_nodes"
    faces = sheet["sheet_face_nodes"]
    assert faces.dtype == np.int32
    assert faces.attrs["start_index"] == 0
    assert faces.attrs["_FillValue"] == -1
    axes = [sheet[f"sheet_node_{axis}"].attrs for axis in "xyz"]
    assert [axis["standard_name"] for axis in axes] == [
        "projection_x_coordinate",
        "projection_y_coordinate",
        "height",
    ]
    assert [axis.get("positive") for axis in axes] == [None, None, "up"]
    assert "".join(axis["axis"] for axis in axes) == "XYZ"
    assert read_group(file, "solid")["solid_node_z"].attrs["positive"] == "up"
    assert [axis["units"] for axis in axes] == ["m", "m", "m"]


def test_saved_states_are_selected_by_time_in_every_group(file, frames):
    for group, name in (
        (None, "thickness"),
        ("solid", "displacement_z"),
        ("history", "energy_internal"),
    ):
        with xr.open_dataset(file, group=group) as dataset:
            assert dataset[name].dims[0] == "time"
            np.testing.assert_array_equal(dataset.indexes["time"], frames.time)
            nearest = dataset[name].sel(time=0.012, method="nearest")
            np.testing.assert_array_equal(nearest, dataset[name].values[2])
            assert dataset["time"].attrs["units"] == "s"
            assert dataset["time"].attrs["axis"] == "T"


def test_the_file_opens_as_one_tree(file):
    with xr.open_datatree(file) as tree:
        assert set(tree.groups) == {"/", "/solid", "/history"}
        last = tree.sel(time=0.02)
        assert last["/thickness"].dims == ("sheet_face",)
        assert last["/solid/displacement_x"].dims == ("solid_node",)
        assert last["/history/tool_force_z"].dims == ("tool",)


def test_global_attributes_identify_the_run(file, scene):
    with xr.open_dataset(file) as sheet:
        assert sheet.attrs["Conventions"] == "CF-1.11 UGRID-1.0"
        assert sheet.attrs["title"] == "Dome 0°/90°"
        assert sheet.attrs["scene"] == SCENE
        assert sheet.attrs["scene_sha256"] == scene.source.sha256
        assert sheet.attrs["source"].startswith("lcmchain ")
        assert "lcmchain" in sheet.attrs["history"]


def test_root_group_holds_one_mesh_and_its_fields_only(file):
    sheet = read_forming(file)
    meshes = [n for n in sheet.variables if sheet[n].attrs.get("cf_role") == "mesh_topology"]
    assert meshes == ["sheet"]
    elsewhere = ("solid", "tool_travel", "tool_force", "energy")
    assert not [n for n in sheet.variables if n.startswith(elsewhere)]


def test_triangles_have_no_fourth_node(datasets, blank):
    faces = datasets["/"]["sheet_face_nodes"].values
    assert np.array_equal(faces[:, 3] == -1, blank.is_triangle)
    assert np.all(faces[:, :3] >= 0)
    assert np.array_equal(faces[:, :3], blank.faces[:, :3])


def test_coordinates_are_those_of_the_formed_shape(file, frames, blank):
    sheet = read_forming(file)
    bottom, top = np.split(frames.positions, 2, axis=1)
    middle = 0.5 * (bottom + top)
    stored = np.stack([sheet[f"sheet_node_{axis}"].values for axis in "xyz"], axis=1)
    assert np.array_equal(stored, middle[-1])
    for frame in range(FRAMES):
        np.testing.assert_allclose(sheet_positions(sheet, frame), middle[frame], atol=1e-16)
    np.testing.assert_allclose(sheet_positions(sheet, 0), blank.mid_surface_positions, atol=1e-16)


def test_fibre_mass_is_conserved(file, blank):
    sheet = read_forming(file)
    initial = 0.6 * blank.area
    for frame in range(FRAMES):
        assert fibre_mass(sheet, frame) == pytest.approx(initial, rel=1e-10)
    assert sheet_areas(sheet).sum() > 1.05 * blank.area  # the dome did stretch the sheet
    with xr.open_dataset(file) as masked:  # as xarray opens it by default
        assert fibre_mass(masked) == pytest.approx(initial, rel=1e-10)


def test_solid_group(file, frames, blank):
    solid = read_group(file, "solid")
    nodes = solid["solid_volume_nodes"].values
    quads = ~blank.is_triangle
    assert np.array_equal(nodes[quads], blank.elements[quads])
    assert np.all(nodes[~quads, 6:] == -1)
    assert np.all(nodes[~quads, :6] >= 0)
    stored = np.stack([solid[f"solid_node_{axis}"].values for axis in "xyz"], axis=1)
    assert np.array_equal(stored, frames.positions[-1])
    displacement = np.stack([solid[f"displacement_{axis}"].values for axis in "xyz"], axis=-1)
    np.testing.assert_allclose(blank.node_positions + displacement, frames.positions, atol=1e-16)


def test_history_group(file, frames):
    history = read_group(file, "history")
    assert [str(name) for name in history["tool"].values] == ["punch", "die"]
    assert np.array_equal(history["time"], frames.time)
    assert np.array_equal(history["tool_force_z"], frames.tool_force[:, :, 2])
    assert np.array_equal(history["energy_internal"], frames.energy["internal"])
    assert history["tool_travel"].attrs["units"] == "m"
    assert {history[n].attrs["units"] for n in history if n.startswith("energy")} == {"J"}


def test_summary(datasets, frames):
    summary = field_summary(datasets)
    assert summary["punch_force_max_N"] == pytest.approx(5.0)
    assert abs(summary["fibre_mass_error"]) < 1e-10
    last = datasets["/"].isel(time=-1)
    assert summary["thickness_min_m"] == float(last["thickness"].min())
    assert summary["shear_angle_max_rad"] == float(abs(last["shear_angle"]).max()) > 0.05
    assert field_summary(datasets, punch="die")["punch_force_max_N"] == pytest.approx(9.0)


def test_warning_where_fibres_are_packed_beyond_reason(scene, datasets):
    sheet, material = datasets["/"].copy(deep=True), scene.material.build()
    assert field_warnings(sheet, material) == []  # a dome turns to and fro once: that is no wave
    sheet["fibre_volume_fraction"][-1, 7] = 0.95
    (warning,) = field_warnings(sheet, material)
    assert "element 7" in warning
    assert "0.95" in warning


def test_several_meshes_stand_in_groups_of_their_own(tmp_path):
    """Any name, prefix and group; what xarray reads there is what was written."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], dtype=float)
    cells = np.array([[0, 1, 2, 3], [1, 4, 2, -1]])
    groups = {}
    for number, mesh in enumerate((UgridMesh("ply"), UgridMesh("fluid", prefix="resin"))):
        variables = {
            **mesh.topology(cells, long_name="a layer"),
            **mesh.node_positions(points + [0, 0, number]),
            TIME: saved_times([0.0, 0.5]),
            "thickness": mesh.on_cells(
                np.full((2, 2), 1e-3), {"units": "m", "long_name": "thickness"}
            ),
            "height": mesh.on_nodes(points[:, 2], {"units": "m", "long_name": "height"}),
        }
        groups[f"/bodies/{mesh.name}"] = mesh.dataset(variables, {"Conventions": CONVENTIONS})
    groups["/"] = xr.Dataset(attrs={"Conventions": CONVENTIONS})
    write_netcdf(tmp_path / "stack.nc", groups)

    for group, written in groups.items():
        xr.testing.assert_identical(read_group(tmp_path / "stack.nc", group), written)
    fluid = read_group(tmp_path / "stack.nc", "bodies/fluid")
    assert fluid["fluid"].attrs["face_node_connectivity"] == "resin_face_nodes"
    assert fluid["fluid"].attrs["node_coordinates"] == "resin_node_x resin_node_z resin_node_y"
    assert fluid["thickness"].dims == ("time", "resin_face")
    assert fluid["thickness"].attrs["mesh"] == "fluid"
    assert fluid["height"].dims == ("resin_node",)
    assert fluid["resin_face_nodes"].values.tolist() == cells.tolist()
    xugrid = pytest.importorskip("xugrid")
    with xr.open_dataset(tmp_path / "stack.nc", group="bodies/fluid") as opened:
        grid = xugrid.UgridDataset(opened).ugrid.grid
        assert grid.area.tolist() == [1.0, 0.5]


def test_volumes_say_their_shape():
    mesh = UgridMesh("part", topology_dimension=3)
    cells = np.full((4, 8), -1)
    for row, count in enumerate((4, 5, 6, 8)):
        cells[row, :count] = np.arange(count)
    variables = mesh.volume_shapes(cells, long_name="shape") | mesh.topology(cells, long_name="p")
    dimensions, shapes, attributes = variables["part_volume_shape"]
    assert dimensions == variables["part_volume_nodes"][0][0] == "part_volume"
    meaning = dict(zip(attributes["flag_values"], attributes["flag_meanings"].split(), strict=True))
    assert [meaning[s] for s in shapes] == ["tetrahedron", "pyramid", "wedge", "hexahedron"]
    # numbers of UGRID 1.0
    assert shapes.tolist() == [0, 1, 2, 3]
    assert variables["part"][2]["volume_shape_type"] == "part_volume_shape"


# --- other programs -------------------------------------------------------------------------------


def test_ugrid_checks_reports_nothing(file):
    from ugrid_checks.check import check_dataset

    checker = check_dataset(str(file), print_summary=False)
    report = checker.checking_report()
    assert checker.logger.N_FAILURES == 0, report
    assert checker.logger.N_WARNINGS == 0, report


def test_ugrid_checks_can_fail(file, tmp_path):
    from ugrid_checks.check import check_dataset

    broken = read_forming(file)
    broken["thickness"].attrs["location"] = "volume"
    broken.to_netcdf(tmp_path / "broken.nc")
    checker = check_dataset(str(tmp_path / "broken.nc"), print_summary=False)
    assert checker.logger.N_FAILURES > 0


def test_xugrid_opens_the_sheet(file, blank):
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(file) as dataset:
        grid = dataset.ugrid.grid
        sheet = read_forming(file)
        assert grid.n_face == blank.element_count
        assert np.array_equal(grid.node_x, sheet["sheet_node_x"])
        assert np.array_equal(grid.node_y, sheet["sheet_node_y"])
        assert np.array_equal(dataset["thickness"].isel(time=-1), sheet["thickness"][-1])
        # seen from above: the projected area, since xugrid knows two coordinates
        assert grid.area.sum() == pytest.approx(blank.area, rel=1e-9)


def vtk_sheet(path):
    from vtkmodules.vtkIONetCDF import vtkNetCDFUGRIDReader

    reader = vtkNetCDFUGRIDReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader, reader.GetOutput()


def test_vtk_opens_the_sheet(file, blank):
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    sheet = read_forming(file)
    reader, grid = vtk_sheet(file)
    assert grid.GetNumberOfPoints() == blank.pair_count
    assert grid.GetNumberOfCells() == blank.element_count
    # seen from above: it draws in the plane of the first and the last coordinate that it is given
    points = vtk_to_numpy(grid.GetPoints().GetData())
    np.testing.assert_allclose(points[:, 0], sheet["sheet_node_x"], atol=1e-8)
    np.testing.assert_allclose(points[:, 1], sheet["sheet_node_y"], atol=1e-8)
    assert np.all(points[:, 2] == 0.0)
    corners = [grid.GetCell(i).GetNumberOfPoints() for i in range(grid.GetNumberOfCells())]
    assert np.array_equal(np.array(corners) == 3, blank.is_triangle)
    # It steps through the frames, which it knows by the variable `time`.
    for frame in (0, FRAMES - 1):
        reader.UpdateTimeStep(float(sheet["time"][frame]))
        for name in ("thickness", "shear_angle", "fibre_direction_2_z"):
            values = vtk_to_numpy(grid.GetCellData().GetArray(name))
            assert np.array_equal(values, sheet[name][frame]), name
        place = grid.GetPointData()
        z = sum(vtk_to_numpy(place.GetArray(n)) for n in ("reference_position_z", "displacement_z"))
        np.testing.assert_allclose(z, sheet_positions(sheet, frame)[:, 2], atol=1e-16)


def test_attributes_that_vtk_must_read_are_character_arrays(file):
    import h5py

    with h5py.File(file) as content:
        for name in ("sheet", "sheet_face_nodes", "thickness", "displacement_z"):
            for attribute in ("cf_role", "location", "mesh", "node_coordinates"):
                if attribute in content[name].attrs:
                    kind = content[name].attrs.get_id(attribute).get_type()
                    assert not kind.is_variable_str(), (name, attribute)


# --- solid files ----------------------------------------------------------------------------------


def vtk_solid(path):
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def test_vtu_has_the_same_fields(datasets, frames, blank, tmp_path):
    write_vtu(tmp_path / "forming.vtu", datasets)
    mesh = meshio.read(tmp_path / "forming.vtu")
    assert {block.type: len(block.data) for block in mesh.cells} == {
        "hexahedron": (~blank.is_triangle).sum(),
        "wedge": blank.is_triangle.sum(),
    }
    np.testing.assert_allclose(mesh.points, frames.positions[-1], atol=1e-16)
    np.testing.assert_allclose(
        mesh.points - mesh.point_data["displacement"], blank.node_positions, atol=1e-16
    )
    np.testing.assert_array_equal(
        mesh.point_data["tool_pressure"], datasets["/solid"]["tool_pressure"][-1]
    )
    for side in (slice(None, blank.pair_count), slice(blank.pair_count, None)):
        np.testing.assert_array_equal(
            mesh.point_data["wrinkle_height"][side], datasets["/"]["wrinkle_height"][-1]
        )
    element = np.concatenate(mesh.cell_data["element"])
    last = datasets["/"].isel(time=-1)
    assert np.array_equal(
        np.concatenate(mesh.cell_data["thickness"]), last["thickness"].values[element]
    )
    direction = np.concatenate(mesh.cell_data["fibre_direction_1"])
    for i, axis in enumerate("xyz"):
        assert np.array_equal(direction[:, i], last[f"fibre_direction_1_{axis}"].values[element])


def test_vtu_has_the_springback_of_a_released_part(datasets, blank, tmp_path):
    height = datasets["/"]["wrinkle_height"]
    springback = height.copy(data=np.arange(float(height.size)).reshape(height.shape))
    released = {**datasets, "/": datasets["/"].assign(springback=springback)}
    write_vtu(tmp_path / "forming.vtu", released, frame=0)
    on_points = meshio.read(tmp_path / "forming.vtu").point_data["springback"]
    np.testing.assert_array_equal(on_points, np.tile(np.arange(blank.pair_count), 2))


def test_vtu_cells_have_their_volume_in_vtk(datasets, blank, tmp_path):
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter

    write_vtu(tmp_path / "start.vtu", datasets, frame=0)
    grid = vtk_solid(tmp_path / "start.vtu")
    element = vtk_to_numpy(grid.GetCellData().GetArray("element"))
    size = vtkCellSizeFilter()
    size.SetInputData(grid)
    size.Update()
    volume = vtk_to_numpy(size.GetOutput().GetCellData().GetArray("Volume"))
    expected = blank.element_areas[element] * blank.thickness
    np.testing.assert_allclose(volume, expected, rtol=1e-9)


def test_solid_reads_as_positive_wedges(datasets, blank):
    """Triple product of VTK's wedge: bottom seen clockwise from the top."""
    nodes = datasets["/solid"]["solid_volume_nodes"].values[blank.is_triangle]
    p = blank.node_positions[nodes[:, :6]]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    up = p[:, 3] - p[:, 0]
    assert np.all(np.einsum("ci,ci->c", normal, up) < 0.0)


def test_series_opens_from_another_folder(datasets, frames, tmp_path):
    write_pvd(tmp_path / "run" / "forming.pvd", datasets)
    os.rename(tmp_path / "run", tmp_path / "moved")
    entries = ET.parse(tmp_path / "moved" / "forming.pvd").getroot().findall(".//DataSet")
    np.testing.assert_allclose([float(e.get("timestep")) for e in entries], frames.time)
    for frame, entry in enumerate(entries):
        mesh = meshio.read(tmp_path / "moved" / entry.get("file"))
        np.testing.assert_allclose(mesh.points, frames.positions[frame], atol=1e-16)


# --- further fields -------------------------------------------------------------------------------


def test_permeabilities_join_the_face_fields(datasets, blank, tmp_path):
    shape = (FRAMES, blank.element_count)
    k1 = np.linspace(1e-12, 2e-12, FRAMES * blank.element_count).reshape(shape)
    direction = np.zeros((*shape, 3))
    direction[..., 1] = 1.0
    more = add_face_variables(
        datasets, {"permeability_1": k1, "permeability_direction_1": direction}
    )
    assert "permeability_1" not in datasets["/"]
    write_forming_netcdf(tmp_path / "forming.nc", more)
    sheet = read_forming(tmp_path / "forming.nc")
    assert np.array_equal(sheet["permeability_1"], k1)
    assert sheet["permeability_1"].attrs["units"] == "m2"
    assert sheet["permeability_direction_1_y"].attrs["location"] == "face"
    write_vtu(tmp_path / "forming.vtu", more)
    mesh = meshio.read(tmp_path / "forming.vtu")
    assert mesh.cell_data["permeability_direction_1"][0].shape[1] == 3


def test_unknown_or_misshaped_face_variables_are_refused(datasets, blank):
    values = np.zeros(blank.element_count)
    with pytest.raises(ValueError, match="units"):
        add_face_variables(datasets, {"colour": values})
    with pytest.raises(ValueError, match="shape"):
        add_face_variables(datasets, {"permeability_1": values[:-1]})
    named = (values, {"units": "1", "long_name": "colour"})
    assert add_face_variables(datasets, {"colour": named})["/"]["colour"].shape[0] == FRAMES


# --- whole or absent ------------------------------------------------------------------------------


def test_a_failed_write_leaves_the_old_file(datasets, tmp_path, monkeypatch):
    path = tmp_path / "forming.nc"
    write_forming_netcdf(path, datasets)
    before = path.read_bytes()

    def fail(*args, **kwargs):
        raise OSError(28, "No space left on device")

    broken = dict(datasets)
    broken["/history"] = type("Full", (), {"variables": {}, "dump_to_store": fail})()
    with pytest.raises(OutputError, match="(?i)no space left"):
        write_forming_netcdf(path, broken)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["forming.nc"]


def test_unwritable_places_are_named(datasets, tmp_path):
    (tmp_path / "file").write_text("")
    for write, name in ((write_forming_netcdf, "forming.nc"), (write_vtu, "forming.vtu")):
        with pytest.raises(InputError, match="cannot be written") as caught:
            write(tmp_path / "file" / name, datasets)
        assert name in str(caught.value)


def test_absent_and_foreign_files_are_named(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_forming(tmp_path / "absent.nc")
    (tmp_path / "text.nc").write_text("no netCDF")
    with pytest.raises(InputError, match="cannot read"):
        read_forming(tmp_path / "text.nc")
    xr.Dataset({"a": 1}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(InputError, match="no forming result"):
        read_forming(tmp_path / "other.nc")
    with pytest.raises(InputError, match="history"):
        read_group(tmp_path / "other.nc", "history")


def test_a_sheet_without_its_undeformed_shape_is_no_forming_result(datasets, tmp_path):
    names = [f"reference_position_{axis}" for axis in "xyz"]
    filled = {"/": datasets["/"].drop_vars(names)}
    write_forming_netcdf(tmp_path / "filling.nc", filled)
    with pytest.raises(InputError, match="name the forming.nc of the run"):
        read_forming(tmp_path / "filling.nc")


def test_same_frames_give_the_same_bits(scene, blank, frames, datasets):
    again = build_datasets(scene, blank, frames)
    for group in datasets:
        xr.testing.assert_equal(again[group], datasets[group])


def test_frames_of_wrong_shape_are_refused(frames):
    with pytest.raises(ValueError, match="tool_force"):
        FrameSeries(
            frames.time, frames.positions, frames.tool_travel, frames.tool_force[:, :1],
            frames.energy, frames.tool_names,
        )  # fmt: skip
