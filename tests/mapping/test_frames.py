"""Saved states: which one is mapped, and a target that follows the material through all of them."""

from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, write_netcdf
from lcmchain.mapping import TargetMesh, compute_weights, map_file, read_sheet
from lcmchain.mapping.fields import content_of_sheet
from lcmchain.mapping.frames import mapped_frames, material_places, positions_of, weights_at
from lcmchain.mapping.surfaces.surface import Surface

TIMES = (0.0, 0.04, 0.1)


def drawn(points, share):
    """Plate (N, 2) on its way to a bowl that is also stretched and turned."""
    stretched = points * [1.0 + 0.2 * share, 1.0 - 0.1 * share]
    height = 6.0 * share * (stretched**2).sum(axis=1, keepdims=True)
    return Rotation.from_rotvec([0.0, 0.2 * share, 0.5 * share]).apply(
        np.concatenate([stretched, height], axis=1)
    )


@pytest.fixture(scope="module")
def plate(make):
    return make.grid(14, 14, (-0.05, -0.05), (0.05, 0.05), jitter=0.1)


@pytest.fixture(scope="module")
def result(make, plate):
    """Three saved states of a plate that becomes a bowl; its fibre mass stays where it is."""
    points, quads = plate
    shares = np.array(TIMES) / TIMES[-1]
    positions = np.stack([drawn(points, share) for share in shares])
    area = [Surface(p, quads).areas for p in positions]
    mass = 0.6 * area[0] * (1.0 + 5.0 * points[quads].mean(axis=1)[:, 0])
    first, second = make.families(positions[-1], quads)
    dataset = make.forming_result(
        positions[-1], quads, frames=3, thickness=lambda c: 1e-3 + c[:, 0] ** 2,
        areal_fibre_mass=1.0, fibre_direction_1=first, fibre_direction_2=second,
    )  # fmt: skip
    dataset["areal_fibre_mass"].values[:] = [mass / a for a in area]
    for name in [f"fibre_direction_{k}_{a}" for k in (1, 2) for a in "xyz"]:
        dataset[name].values[:] = dataset[name].values[-1]
    for axis, name in enumerate("xyz"):
        units = {"units": "m"}
        moved = positions[..., axis] - positions[0, :, axis]
        dataset[f"displacement_{name}"] = ("time", "sheet_node"), moved, units
        dataset[f"reference_position_{name}"] = "sheet_node", positions[0, :, axis], units
    return dataset.assign_coords(time=("time", np.array(TIMES), {"units": "s"}))


@pytest.fixture
def cells(make):
    """Triangles over most of the formed bowl, on another grid."""
    points, quads = make.grid(9, 9, (-0.04, -0.04), (0.04, 0.04), jitter=0.1, seed=9)
    return points, make.triangles_of(quads)


def shell(points, cells):
    return TargetMesh(points, (("triangle", cells),), {})


# --- places on the material -----------------------------------------------------------------------


def surfaces(plate):
    points, quads = plate
    return [Surface(drawn(points, t / TIMES[-1]), quads) for t in TIMES]


def test_places_are_where_they_were_found(plate, cells):
    """On the sheet, off it, and beyond its edge."""
    surface = surfaces(plate)[-1]
    points = np.concatenate([drawn(cells[0], 1.0), [[0.09, 0.0, 0.04], [0.0, 0.0, -0.02]]])
    points[::3] += 2e-3
    found = positions_of(material_places(surface, points), surface)
    np.testing.assert_allclose(found, points, atol=1e-15)


def test_places_turn_with_the_sheet(plate, cells):
    surface = surfaces(plate)[-1]
    points = np.concatenate([drawn(cells[0], 1.0) + [0, 0, 2e-3], [[0.09, 0.0, 0.04]]])
    turn, shift = Rotation.from_rotvec([1.0, -2.0, 0.5]), [0.1, 0.2, 0.3]
    places = material_places(surface, points)
    found = positions_of(places, Surface(turn.apply(surface.points) + shift, surface.faces))
    np.testing.assert_allclose(found, turn.apply(points) + shift, atol=1e-14)


def test_places_stay_on_their_material(plate, cells):
    """Nodes of the formed bowl go back to where their material was in the flat plate."""
    before, _, after = surfaces(plate)
    offset = 0.3e-3
    points = drawn(cells[0], 1.0)
    places = material_places(after, points + offset * normals_of_bowl(cells[0]))
    found = positions_of(places, before)
    # the facets of the bowl, of 7 mm, lie up to 0.15 mm inside it, which is no part of the offset
    np.testing.assert_allclose(found[:, :2], cells[0], atol=0.1e-3)
    np.testing.assert_allclose(found[:, 2], offset, atol=0.03e-3)


def normals_of_bowl(points):
    stretched = points * [1.2, 0.9]
    normal = np.concatenate([-12.0 * stretched, np.ones((len(points), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return Rotation.from_rotvec([0.0, 0.2, 0.5]).apply(normal)


# --- fields ---------------------------------------------------------------------------------------


def test_fields_of_every_state_arrive_on_the_mesh_of_the_sheet(result, plate):
    """Cells that are the faces have the values of the faces in every state, and their places."""
    points, quads = plate
    sheet = read_sheet(result)
    target = TargetMesh(sheet.surface.points, (("quad", quads),), {})
    weights = compute_weights(sheet, target, method="closest", order=1)
    frames = list(mapped_frames(result, sheet, target, weights))
    assert [frame.time for frame in frames] == list(TIMES)
    for number, frame in enumerate(frames):
        source = read_sheet(result, frame=number)
        np.testing.assert_allclose(frame.target.points, source.surface.points, atol=1e-15)
        for name in ("thickness", "areal_fibre_mass"):
            np.testing.assert_allclose(frame.mapped.scalars[name], source.scalars[name], rtol=1e-12)


def test_every_state_keeps_the_fibre_mass_and_every_cell_its_own(result, cells):
    sheet = read_sheet(result)
    target = shell(drawn(cells[0], 1.0), cells[1])
    weights = compute_weights(sheet, target)
    masses, areas = [], []
    for frame in mapped_frames(result, sheet, target, weights):
        areas.append(frame.target.surface.areas)
        masses.append(frame.mapped.scalars["areal_fibre_mass"] * weights.coverage.clip(max=1.0)
                      * areas[-1])  # fmt: skip
    for mass in masses[:-1]:
        np.testing.assert_allclose(mass, masses[-1], rtol=1e-12)
    content = content_of_sheet(sheet, weights, sheet.scalars["areal_fibre_mass"])
    np.testing.assert_allclose(masses[0].sum(), content, rtol=1e-12)
    assert np.ptp(areas, axis=0).min() > 1e-7  # and the cells did change


def test_cells_of_solids_change_as_the_faces_above_them(result, plate, cells):
    before, _, after = surfaces(plate)
    points = drawn(cells[0], 1.0)
    wedges = np.hstack([cells[1], cells[1] + len(points)])
    both = np.concatenate([points - [0, 0, 4e-4], points + [0, 0, 4e-4]])
    solid = TargetMesh(both, (("wedge", wedges),), {})
    weights = compute_weights(read_sheet(result), solid)
    found = weights_at(weights, after, before, solid).cell_area / weights.cell_area
    stretch = before.areas / after.areas
    expected = weights.average_matrix @ stretch
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert found.max() < 1.0 and np.ptp(found) > 0.1


# --- the stage ------------------------------------------------------------------------------------


@pytest.fixture
def written(result, cells, write_mesh, tmp_path):
    """Map all states from a file, as users do, and return the folder and the report."""
    write_netcdf(tmp_path / "forming.nc", {ROOT: result})
    target = write_mesh(drawn(cells[0], 1.0), [("triangle", cells[1])])
    report = map_file(
        tmp_path / "forming.nc", target, tmp_path / "out" / "m.nc", all_frames=True, picture=False
    )
    return tmp_path / "out", report


def test_all_states_lie_over_time_in_one_file(written, result, cells):
    folder, report = written
    assert report.files["frames"] == "m.pvd"
    sheet, target = read_sheet(result), shell(drawn(cells[0], 1.0), cells[1])
    frames = list(mapped_frames(result, sheet, target, compute_weights(sheet, target)))
    with xr.open_dataset(folder / "m.nc") as dataset:
        np.testing.assert_array_equal(dataset["time"].values, TIMES)
        assert dataset.attrs["mapping_time_s"] == TIMES[-1]
        assert "--all-frames" in dataset.attrs["history"]
        assert dataset["mapping_status"].dims == ("target_face",)
        for number, frame in enumerate(frames):
            for name in ("thickness", "areal_fibre_mass"):
                found = dataset[name].isel(time=number).values
                np.testing.assert_allclose(found, frame.mapped.scalars[name], rtol=1e-12)
            moved = [
                dataset[f"reference_position_{a}"].values
                + dataset[f"displacement_{a}"].values[number]
                for a in "xyz"
            ]
            np.testing.assert_allclose(np.transpose(moved), frame.target.points, atol=1e-15)
    # and it is a forming result of its own, state by state
    for number, frame in enumerate(frames):
        again = read_sheet(folder / "m.nc", frame=number)
        np.testing.assert_allclose(again.surface.points, frame.target.points, atol=1e-15)
        assert again.time == TIMES[number]


def test_files_over_time_open_elsewhere(written):
    folder, _ = written
    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(folder / "m.nc", print_summary=False)
    assert not checker.logger.report_statement_logrecords(), checker.checking_report()
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(folder / "m.nc") as opened:
        assert opened["thickness"].sizes["time"] == 3
    listed = ElementTree.parse(folder / "m.pvd").findall("Collection/DataSet")
    assert [float(entry.get("timestep")) for entry in listed] == list(TIMES)
    heights = [np.ptp(vtk_points(folder / entry.get("file"))[:, 2]) for entry in listed]
    assert heights[0] < 2e-4 < 5e-3 < heights[1] < heights[2]


def vtk_points(path):
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader = xml.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    return numpy_support.vtk_to_numpy(reader.GetOutput().GetPoints().GetData())


def test_a_registered_target_keeps_its_place_in_every_state(result, cells, write_mesh, tmp_path):
    """Its file lies 2 mm beside the sheet: so do all frames, and their directions turn with it."""
    points = drawn(cells[0], 1.0)
    options = {"all_frames": True, "picture": False, "maximum_distance": 0.01}
    turn = Rotation.from_rotvec([0.02, -0.03, 0.0])
    away = turn.apply(points) + [0.0, 0.0, 2e-3]
    right = write_mesh(points, [("triangle", cells[1])], "right.vtu")
    wrong = write_mesh(away, [("triangle", cells[1])], "wrong.vtu")
    map_file(result, right, tmp_path / "r.nc", **options)
    map_file(result, wrong, tmp_path / "w.nc", register=True, **options)
    last = meshio.read(tmp_path / "w_frames" / "w_0002.vtu")
    np.testing.assert_allclose(last.points, away, atol=1e-12)
    for number in range(3):
        found = meshio.read(tmp_path / "w_frames" / f"w_{number:04d}.vtu")
        expected = meshio.read(tmp_path / "r_frames" / f"r_{number:04d}.vtu")
        error = found.points - (turn.apply(expected.points) + [0.0, 0.0, 2e-3])
        assert np.abs(error).max() < 0.3e-3  # a bowl barely determines where it turned
        along = turn.apply(expected.cell_data["fibre_direction_1"][0])
        cosine = np.einsum("ci,ci->c", found.cell_data["fibre_direction_1"][0], along)
        assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 1.0


def test_a_state_is_chosen_by_number_or_time(result, cells, write_mesh, tmp_path):
    target = write_mesh(drawn(cells[0], 0.4), [("triangle", cells[1])])
    mapped = []
    for options in ({"frame": 1}, {"time": 0.04}, {"time": 0.05}, {"frame": -2}):
        map_file(result, target, tmp_path / "m.nc", picture=False, **options)
        with xr.open_dataset(tmp_path / "m.nc") as dataset:
            assert float(dataset["time"]) == 0.04
            mapped.append(dataset["thickness"].values)
            assert ("--time" in dataset.attrs["history"]) == ("time" in options)
    for values in mapped[1:]:
        np.testing.assert_array_equal(values, mapped[0])
    with pytest.raises(InputError, match="no saved state at 120 ms; they go from 0 to 100 ms"):
        map_file(result, target, tmp_path / "m.nc", time=0.12)
    with pytest.raises(InputError, match="frame 3 does not exist; there are 3"):
        map_file(result, target, tmp_path / "m.nc", frame=3)
    still = result.isel(time=2).drop_vars("time")
    target = write_mesh(drawn(cells[0], 1.0), [("triangle", cells[1])])
    with pytest.raises(InputError, match="no saved states with times"):
        map_file(still, target, tmp_path / "m.nc", all_frames=True)
