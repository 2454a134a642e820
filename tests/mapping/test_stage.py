"""The mapping as a stage: files that other programs open, the report, and clear refusals."""

import json
from datetime import datetime

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.mapping import MappingWeights, map_file, map_forming, read_sheet, read_target

FIELDS = ["thickness", "fibre_volume_fraction", "areal_fibre_mass", "shear_angle"]
FIBRES = ["fibre_direction_1", "fibre_direction_2"]
SHEAR = np.radians(25.0)


@pytest.fixture(scope="module")
def result(make):
    """A bowl of 100 mm with two families sheared by 25 degrees."""
    points, quads = make.grid(14, 14, (-0.05, -0.05), (0.05, 0.05), jitter=0.1)
    points = make.bowl(points, depth=6.0)
    first, second = make.families(points, quads, SHEAR)
    return make.forming_result(
        points,
        quads,
        thickness=lambda c: 1e-3 * (1.0 - 4.0 * np.hypot(c[:, 0], c[:, 1])),
        areal_fibre_mass=lambda c: 0.6 + 2.0 * c[:, 0],
        shear_angle=SHEAR,
        fibre_direction_1=first,
        fibre_direction_2=second,
    )


@pytest.fixture
def part(make, write_mesh):
    """Write a target mesh for the bowl: half width and scale of the coordinates, kind of cells."""

    def write(half=0.04, scale=1.0, cells="triangle", name="target.vtu"):
        points, quads = make.grid(9, 9, (-half, -half), (half, half), jitter=0.1, seed=9)
        points = make.bowl(points, depth=6.0)
        if cells == "hexahedron":  # of the thickness of the sheet, along its normal
            count = len(points)
            normals = np.stack([-12.0 * points[:, 0], -12.0 * points[:, 1], np.ones(count)], axis=1)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            half = 5e-4 * (1.0 - 4.0 * np.hypot(points[:, :1], points[:, 1:2])) * normals
            points = np.concatenate([points - half, points + half])
            blocks = [("quad", quads), (cells, np.hstack([quads, quads + count]))]
        else:
            blocks = [(cells, make.triangles_of(quads) if cells == "triangle" else quads)]
        return write_mesh(points * scale, blocks, name)

    return write


def left_behind(folder):
    return sorted(path.name for path in folder.iterdir())


def test_all_files_and_fields_are_written(result, part, tmp_path):
    out = tmp_path / "out"
    report = map_forming(result, part(), name="infiltration", kind="infiltration", out_dir=out)
    endings = ["json", "nc", "png", "vtu"]
    assert left_behind(out) == [f"infiltration.{ending}" for ending in endings]
    assert set(report.files.values()) == set(left_behind(out))
    assert report.status_count["inside"] == sum(report.status_count.values()) == 162
    assert report.target_coverage == pytest.approx(1.0, abs=1e-3)
    assert report.source_coverage == pytest.approx(0.64, abs=0.03)
    assert abs(report.conservation_error) < 1e-12
    assert json.loads((out / "infiltration.json").read_text()) == report.as_dict()
    assert "162 inside" in report.summary()

    with xr.open_dataset(out / "infiltration.nc") as dataset:
        thickness = dataset["thickness"].values
        nodes = dataset["target_face_nodes"].values.astype(int)
        x, y = (dataset[f"target_node_{axis}"].values for axis in "xy")
        radius = np.hypot(x[nodes].mean(axis=1), y[nodes].mean(axis=1))
        # The last frame, not the first, which holds half of it.
        np.testing.assert_allclose(thickness, 1e-3 * (1.0 - 4.0 * radius), atol=2e-5)
        for name in [*FIELDS, *[f"{f}_{axis}" for f in FIBRES for axis in "xyz"]]:
            assert np.isfinite(dataset[name].values).all()
    mesh = meshio.read(out / "infiltration.vtu")
    np.testing.assert_array_equal(mesh.cell_data["thickness"][0], thickness)
    for name in FIBRES:
        np.testing.assert_allclose(np.linalg.norm(mesh.cell_data[name][0], axis=1), 1.0)


@pytest.mark.parametrize("cells", ["triangle", "quad", "hexahedron"])
def test_netcdf_keeps_the_conventions(result, part, tmp_path, cells):
    map_file(result, part(cells=cells), tmp_path / "mapped.nc", picture=False)
    location, group = ("volume", "solid") if cells == "hexahedron" else ("face", None)
    with xr.open_dataset(tmp_path / "mapped.nc", group=group) as dataset:
        fields = [v for v in dataset.data_vars.values() if v.dims == (f"target_{location}",)]
        described = [v for v in fields if v.name != "target_volume_shape"]
        assert {v.name for v in described} >= {*FIELDS, "mapping_status", "mapping_coverage"}
        for variable in described:
            assert {"units", "long_name", "mesh", "location"} <= set(variable.attrs), variable.name
            assert variable.attrs["mesh"] == "target"
            assert variable.attrs["location"] == location
        assert "UGRID-1.0" in dataset.attrs["Conventions"]
        assert dataset.attrs["history"].endswith("formed")
        assert dataset.attrs["scene"] == "title = 1"


@pytest.mark.parametrize(("cells", "count"), [("triangle", 162), ("quad", 81), ("hexahedron", 198)])
def test_netcdf_opens_elsewhere(result, part, tmp_path, cells, count):
    """Of solids they see the skin: 81 cells have 162 faces above and below and 36 at the edge."""
    path = tmp_path / "mapped.nc"
    map_file(result, part(cells=cells), path, picture=False)
    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(path, print_summary=False)
    assert not checker.logger.report_statement_logrecords(), checker.checking_report()
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(path) as opened:
        assert opened.ugrid.grid.n_face == count
        assert opened["thickness"].ugrid.grid.topology_dimension == 2
    netcdf = pytest.importorskip("vtkmodules.vtkIONetCDF")
    reader = netcdf.vtkNetCDFUGRIDReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == count
    assert grid.GetCellData().HasArray("fibre_volume_fraction")


def test_vtu_opens_in_vtk(result, part, tmp_path):
    map_file(result, part(cells="hexahedron"), tmp_path / "mapped.vtu", picture=False)
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "mapped.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == 81
    for name in FIBRES:
        assert grid.GetCellData().GetArray(name).GetNumberOfComponents() == 3


def test_second_family_error_is_the_shear_angle(result, part, tmp_path):
    report = map_file(result, part(cells="quad"), tmp_path / "structure.nc", picture=False)
    assert report.second_family_error_max == pytest.approx(SHEAR, abs=np.radians(1.0))
    (warning,) = [w for w in report.warnings if "one orientation per element" in w]
    assert "25." in warning or "24." in warning
    assert f"cell {report.second_family_error_cell}" in warning


def test_skin_of_a_solid_is_left_aside_and_said_so(result, part, tmp_path):
    report = map_file(result, part(cells="hexahedron"), tmp_path / "s.nc", picture=False)
    assert report.ignored_cells == {"quad": 81}
    assert any("81 quad" in warning for warning in report.warnings)
    assert abs(report.conservation_error) < 1e-12
    shells = read_target(part(cells="hexahedron"), kind="infiltration")
    assert shells.cell_count == 81 and not shells.is_solid


def test_unmapped_cells_stop_the_mapping_and_leave_nothing(result, part, tmp_path):
    path = part(half=0.09)
    out = tmp_path / "out"
    with pytest.raises(InputError, match=r"of 162 cells have no sheet within .* allow unmapped"):
        map_file(result, path, out / "mapped.nc")
    assert not out.exists()
    report = map_file(result, path, out / "mapped.nc", allow_unmapped=True)
    assert report.status_count["unmapped"] > 50
    assert report.target_coverage < 0.5
    values = meshio.read(out / "mapped.vtu").cell_data
    unmapped = values["mapping_status"][0] == 3
    for name in [*FIELDS, *FIBRES]:
        assert np.isnan(values[name][0][unmapped]).all()
        assert np.isfinite(values[name][0][~unmapped]).all()
    assert any("unmapped" in warning for warning in report.warnings)


def test_coordinates_in_millimetres(result, part, tmp_path):
    path = part(scale=1e3)
    with pytest.raises(InputError, match="check length_unit"):
        map_file(result, path, tmp_path / "mapped.nc")
    map_file(result, path, tmp_path / "mapped.nc", length_unit="mm", picture=False)
    assert np.abs(meshio.read(tmp_path / "mapped.vtu").points).max() < 0.06
    with pytest.raises(InputError, match="length_unit"):
        map_file(result, path, tmp_path / "mapped.nc", length_unit="kg")


@pytest.mark.parametrize("scale", [1e3, 25.4, 1e-3, 1 / 25.4])
def test_a_wrong_unit_is_told_also_where_cells_may_stay_unmapped(result, part, tmp_path, scale):
    """And no cell takes values from farther away than an edge of the sheet."""
    path = part(scale=scale)
    try:
        report = map_file(result, path, tmp_path / "mapped.nc", allow_unmapped=True, picture=False)
    except InputError as error:
        assert "check length_unit" in str(error) and not list(tmp_path.glob("mapped*"))
        return
    assert any("check length_unit" in warning for warning in report.warnings)
    assert report.worst_distance < 0.01
    values = meshio.read(tmp_path / "mapped.vtu").cell_data
    status, distance = values["mapping_status"][0], values["mapping_distance"][0]
    assert np.isnan(values["thickness"][0][status == 3]).all()
    assert np.nanmax(distance, initial=0.0) < 0.01


def test_a_mesh_of_the_size_of_the_sheet_gives_no_hint(result, part, tmp_path):
    for half in (0.04, 0.02):
        report = map_file(result, part(half=half), tmp_path / "mapped.nc", picture=False)
        assert not any("length_unit" in warning for warning in report.warnings)


def test_a_mesh_nowhere_near_the_sheet_is_refused_in_any_case(result, make, write_mesh, tmp_path):
    points, quads = make.grid(4, 4, (5.0, 5.0), (5.1, 5.1))
    path = write_mesh(make.lifted(points), [("quad", quads)])
    with pytest.raises(InputError, match="16 of 16 cells have no sheet within") as error:
        map_file(result, path, tmp_path / "out" / "mapped.nc", allow_unmapped=True)
    assert "allow unmapped" not in str(error.value)
    assert not (tmp_path / "out").exists()


POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1]], dtype=float)


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ([("triangle", [[0, 1, 9]])], "1 triangle cells have nodes that do not exist .cell 0."),
        ([("quad", [[0, 1, 2, 3], [0, 1, 2, -2]])], "nodes that do not exist .cell 1."),
        ([("triangle", [[0, 1, 2]]), ("quad", [[0, 1, 1, 0]])], "no area .cell 1."),
        ([("triangle", [[0, 1, 1]] * 9)], "9 triangle cells have no area .cell 0, 1, 2, 3, 4, ..."),
        ([("quad", [[0, 2, 1, 3]])], "no area"),
        ([("tetra", [[0, 1, 2, 3]])], "no volume"),
        ([("hexahedron", [[0, 1, 2, 3, 0, 1, 2, 3]])], "no volume"),
        ([("line", [[0, 1]])], "no shells or solids to map onto .cell types found: line."),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_cells_that_are_none_are_refused(cells, words, write_mesh):
    path = write_mesh(POINTS, [(name, np.array(nodes)) for name, nodes in cells])
    with pytest.raises(InputError, match=words):
        read_target(path)


def test_solids_between_two_copies_of_a_curved_surface_are_refused(write_mesh):
    """No solid is flat, and none holds anything; a thousandth of an edge is a volume."""
    below = np.array([[0, 0, 0], [1, 0, 0.3], [1, 1, 0], [0, 1, 0.3]])
    cell = [("hexahedron", np.arange(8)[None])]
    with pytest.raises(InputError, match="1 hexahedron cells have no volume .cell 0."):
        read_target(write_mesh(np.concatenate([below, below]), cell))
    assert read_target(write_mesh(np.concatenate([below, below + [0, 0, 1e-3]]), cell)).is_solid


def test_nodes_at_no_place_are_refused(write_mesh):
    for value, words in ((np.nan, "places that are not finite"), (1e200, "beyond 1e")):
        points = POINTS.copy()
        points[1, 0] = value
        path = write_mesh(points, [("triangle", np.array([[0, 1, 2]]))])
        with pytest.raises(InputError, match=words):
            read_target(path)


def test_a_quadrilateral_that_stands_for_a_triangle_is_read(write_mesh):
    assert read_target(write_mesh(POINTS, [("quad", np.array([[0, 1, 2, 2]]))])).cell_count == 1


def test_folders_are_said_to_be_folders(result, part, tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        map_file(result, tmp_path, tmp_path / "mapped.nc")
    with pytest.raises(InputError, match="is a folder"):
        map_file(tmp_path, part(), tmp_path / "mapped.nc")
    (tmp_path / "folder.nc").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        map_file(result, part(), tmp_path / "folder.nc")


def thicker(dataset, value):
    dataset["thickness"].values[..., 3] = value


def faces(dataset, value):
    dataset["sheet_face_nodes"].values[3, 1:] = value


#: What is done to a sound file, and words of the message.
DAMAGES = {
    "no mesh": (lambda d: d.drop_vars("sheet"), "has one two-dimensional mesh, this has 0"),
    "no faces": (lambda d: d.drop_vars("sheet_face_nodes"), 'no variable "sheet_face_nodes"'),
    "no nodes": (lambda d: d.drop_vars("sheet_node_z"), "no x, y and z node coordinates"),
    "no fields": (lambda d: d.drop_vars(["thickness", "fibre_volume_fraction"]), "has no field"),
    "negative thickness": (lambda d: thicker(d, -1e-3), "thickness of face 3 is -0.001"),
    "huge thickness": (lambda d: thicker(d, 1e300), r"thickness of face 3 is 1e\+300"),
    "thickness that is none": (lambda d: thicker(d, np.nan), "thickness of face 3 is not finite"),
    "node that does not exist": (lambda d: faces(d, 999), "nodes that do not exist"),
    "negative node": (lambda d: faces(d, -7), "nodes that do not exist"),
    "face without area": (lambda d: faces(d, 0), "1 faces of the mesh have no area, .* face 3"),
    "positions in millimetres": (
        lambda d: d["sheet_node_x"].attrs.update(units="mm"), 'sheet_node_x is in "mm"'
    ),
    "thickness in millimetres": (
        lambda d: d["thickness"].attrs.update(units="mm"), 'has it in "m"; convert'
    ),
    "one component of a fibre": (
        lambda d: d.assign(fibre_direction_1_x=d["fibre_volume_fraction"]), "only the components"
    ),
    "numbering from 7": (
        lambda d: d["sheet_face_nodes"].attrs.update(start_index=np.int32(7)), "start_index"
    ),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_source_is_refused(damage, make, tmp_path):
    points, quads = make.grid(3, 3)
    change, words = DAMAGES[damage]
    dataset = make.forming_result(make.lifted(points), quads)
    dataset["thickness"].values.setflags(write=True)
    changed = change(dataset)
    write_netcdf(tmp_path / "forming.nc", {"/": dataset if changed is None else changed})
    with pytest.raises(InputError, match=words) as error:
        read_sheet(tmp_path / "forming.nc")
    assert "forming.nc" in str(error.value)


def test_a_source_of_which_a_part_is_missing_is_refused(make, tmp_path):
    points, quads = make.grid(3, 3)
    path = tmp_path / "forming.nc"
    write_netcdf(path, {"/": make.forming_result(make.lifted(points), quads)})
    content = path.read_bytes()
    assert read_sheet(path).surface.face_count == 9
    for size in (0, 10, len(content) // 2, len(content) - 100):
        path.write_bytes(content[:size])
        with pytest.raises(InputError, match="not a netCDF forming result"):
            read_sheet(path)


def test_weights_are_stored_and_used_again(result, part, tmp_path):
    path, stored = part(), tmp_path / "weights.npz"
    first = map_file(result, path, tmp_path / "a.nc", weights_file=stored, picture=False)
    before = stored.stat().st_mtime_ns
    assert isinstance(MappingWeights.load(stored), MappingWeights)
    second = map_file(result, path, tmp_path / "b.nc", weights_file=stored, picture=False)
    assert stored.stat().st_mtime_ns == before
    assert first.fibre_mass_on_target == second.fibre_mass_on_target
    earlier = map_file(result, path, tmp_path / "c.nc", weights_file=stored, frame=0, picture=False)
    assert earlier.fibre_mass_on_target == pytest.approx(0.5 * first.fibre_mass_on_target)
    with pytest.raises(InputError, match="stored weights are overlap"):
        map_file(result, path, tmp_path / "d.nc", weights_file=stored, method="closest")


def test_mapping_twice_gives_the_same_bytes(result, part, tmp_path, monkeypatch):
    class Clock(datetime):
        @classmethod
        def now(cls, zone=None):  # the history tells when, to the second
            return cls(2026, 1, 1, tzinfo=zone)

    monkeypatch.setattr("lcmchain.mapping.files.datetime", Clock)
    path = part()
    for name in ("a", "b"):
        map_file(result, path, tmp_path / name / "mapped.nc", picture=False)
    for ending in ("nc", "vtu", "json"):
        one, two = (tmp_path / name / f"mapped.{ending}" for name in ("a", "b"))
        assert one.read_bytes() == two.read_bytes(), ending


def test_a_result_from_a_file_maps_like_the_dataset(result, part, tmp_path):
    result.to_netcdf(tmp_path / "forming.nc", engine="netcdf4")
    one = map_file(result, part(), tmp_path / "a.nc", picture=False)
    two = map_file(tmp_path / "forming.nc", part(), tmp_path / "b.nc", picture=False)
    assert one.fibre_mass_on_target == two.fibre_mass_on_target


def test_the_picture_shows_the_uncovered_cells_grey(result, part, tmp_path):
    image = pytest.importorskip("matplotlib.image")
    colours = {}
    for half in (0.04, 0.09):
        map_file(result, part(half=half), tmp_path / "m.nc", allow_unmapped=True)
        pixels = (255 * image.imread(tmp_path / "m.png")[:, :, :3]).round().astype(int)
        right = pixels[:, pixels.shape[1] // 2 : int(0.85 * pixels.shape[1])]
        grey = (np.ptp(right, axis=2) == 0) & (right[:, :, 0] > 150) & (right[:, :, 0] < 215)
        colours[half] = grey.mean()
    assert colours[0.09] > 0.05 > 10 * colours[0.04]


def test_the_picture_paints_and_hatches_the_right_cells(make, part, tmp_path, monkeypatch):
    """Of a solid, every facet of the skin has the colour of its cell, and the hatch of it."""
    painted, hatched = [], []

    def record(facets):
        def draw(axis, corners, view, *arguments, **options):
            facets.append((corners, *arguments))

        return draw

    monkeypatch.setattr("lcmchain.mapping.picture.draw_facets", record(painted))
    monkeypatch.setattr("lcmchain.mapping.picture.draw_hatches", record(hatched))
    points, quads = make.grid(14, 14, (-0.05, -0.05), (0.05, 0.05))
    points = make.bowl(points, depth=6.0)
    first, second = make.families(points, quads)
    slope = make.forming_result(
        points,
        quads,
        thickness=lambda c: 1e-3 * (1.0 + 4.0 * c[:, 0]),
        areal_fibre_mass=0.6,
        shear_angle=0.0,
        fibre_direction_1=first,
        fibre_direction_2=second,
    )
    mesh = part(half=0.09, cells="hexahedron")
    report = map_file(slope, mesh, tmp_path / "m.nc", allow_unmapped=True, thickness_limit=1.0)

    for corners, colours in painted[:2]:  # thickness on the sheet and on the target
        x = corners.mean(axis=1)[:, 0]
        known = np.ptp(colours[:, :3], axis=1) > 0.0
        assert np.corrcoef(x[known], colours[known, 1])[0, 1] > 0.95  # viridis: green grows
    # one facet above and one below at each cell, and those of cells at the outline
    counts = {pattern: len(corners) for corners, pattern in hatched[:2]}
    for pattern, status in (("....", "extrapolated"), ("////", "unmapped")):
        assert report.status_count[status] > 0
        assert 2 * report.status_count[status] <= counts[pattern] <= 4 * report.status_count[status]
    assert sorted(counts) == ["....", "////"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "fluid"}, "infiltration, structure"),
        ({"method": "nearest"}, "overlap, closest"),
        ({"maximum_distance": -1.0}, "positive"),
        ({"frame": 7}, "frame 7 does not exist; there are 2"),
        ({"out": "mapped.csv"}, r"\.nc or \.vtu"),
        ({"out": "target.vtu/mapped.nc"}, "cannot be written"),
        ({"source": "absent.nc"}, "does not exist"),
        ({"source": "target.vtu"}, "not a netCDF forming result"),
        ({"target": "absent.vtu"}, "does not exist"),
        ({"target": "broken.vtu"}, "cannot be read as a VTU file"),
        ({"target": "mesh.unknown"}, "cannot read"),
        ({"target": "lines.vtu"}, "no shells or solids"),
        ({"target": "lines.vtu", "kind": "infiltration"}, "no triangles or quadrilaterals"),
    ],
)
def test_wrong_input_gives_one_clear_error(result, part, write_mesh, tmp_path, change, message):
    part()
    (tmp_path / "broken.vtu").write_text("<VTKFile")
    (tmp_path / "mesh.unknown").write_text("")
    write_mesh(np.eye(3), [("line", np.array([[0, 1], [1, 2]]))], "lines.vtu")
    before = left_behind(tmp_path)
    arguments = {"source": result, "target": "target.vtu", "out": "mapped.nc", **change}
    source = arguments.pop("source")
    source = tmp_path / source if isinstance(source, str) else source
    target, out = (tmp_path / arguments.pop(key) for key in ("target", "out"))
    with pytest.raises(InputError, match=message):
        map_file(source, target, out, **arguments)
    assert left_behind(tmp_path) == before


def test_positions_and_fields_belong_to_the_same_frame(make, write_mesh, tmp_path):
    """The mesh of the file shows the last frame; an earlier one needs its displacement."""
    points, quads = make.grid(6, 6)
    flat, formed = make.lifted(points), make.bowl(points, depth=0.4)
    result = make.forming_result(formed, quads, frames=2)
    for k, axis in enumerate("xyz"):
        moves = np.stack([0.0 * formed[:, k], formed[:, k] - flat[:, k]])
        result[f"reference_position_{axis}"] = ("sheet_node", flat[:, k])
        result[f"displacement_{axis}"] = (("time", "sheet_node"), moves)
    np.testing.assert_allclose(read_sheet(result).surface.points, formed, atol=1e-15)
    np.testing.assert_array_equal(read_sheet(result, frame=0).surface.points, flat)
    report = map_file(
        result, write_mesh(flat, [("quad", quads)]), tmp_path / "m.nc", frame=0, picture=False
    )
    assert report.worst_distance < 1e-12


def test_permeability_axes_keep_their_place_in_the_sheet(make, result, part, tmp_path):
    """In-plane axes are turned into the cells; the one through the thickness stays normal."""
    with_axes = result.copy()
    stack = {"1": "fibre_direction_1", "2": "fibre_direction_2"}
    first, second = (
        np.stack([result[f"{stack[k]}_{a}"].values[-1] for a in "xyz"], axis=1) for k in "12"
    )
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    for k, axis in enumerate("xyz"):
        for name, values in (("1", first), ("3", normal)):
            with_axes[f"permeability_direction_{name}_{axis}"] = ("sheet_face", values[:, k])
    with_axes["permeability_1"] = ("sheet_face", np.where(np.arange(196) == 5, np.nan, 1e-12))
    report = map_file(with_axes, part(), tmp_path / "m.vtu", picture=False)
    normals = read_target(tmp_path / "target.vtu").surface.normals
    found = meshio.read(tmp_path / "m.vtu").cell_data
    in_plane = np.einsum("ci,ci->c", found["permeability_direction_1"][0], normals)
    along = np.abs(np.einsum("ci,ci->c", found["permeability_direction_3"][0], normals))
    np.testing.assert_allclose(in_plane, 0.0, atol=1e-12)
    assert along.min() > 0.99
    assert report.ignored_fields == ["permeability_1"]  # it has a hole
    assert any("permeability_1" in warning for warning in report.warnings)


def test_a_source_without_numbers_is_refused(make, result, part, tmp_path):
    broken = result.copy(deep=True)
    broken["thickness"].values[-1, 17] = np.nan
    with pytest.raises(InputError, match="thickness of face 17"):
        map_file(broken, part(), tmp_path / "mapped.nc")
    with pytest.raises(InputError, match="one two-dimensional mesh"):
        map_file(xr.Dataset(), part(), tmp_path / "mapped.nc")
    spoilt = result.copy(deep=True)
    spoilt["sheet"].attrs["cf_role"] = np.array([1, 2])  # no text
    with pytest.raises(InputError, match="one two-dimensional mesh"):
        map_file(spoilt, part(), tmp_path / "mapped.nc")
