"""A VMAP file is read by pyLife's VMAP reader, and laid out as the files that others write."""

import h5py
import meshio
import numpy as np
import pandas
import pylife.vmap
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import compute_weights, read_target, transfer
from lcmchain.mapping.files import mapped_dataset
from lcmchain.mapping.formats import export
from lcmchain.mapping.report import mapping_report


@pytest.fixture(scope="module")
def written(bowl, tmp_path_factory):
    """The file and the report of its export."""
    path = tmp_path_factory.mktemp("vmap") / "bowl.vmap"
    return path, export(bowl.dataset, bowl.target, "vmap", path)


def read_on_elements(path, name, columns):
    """Values of a variable by element, in the order of the file, as pyLife reads them."""
    frame = (
        pylife.vmap.VMAPImport(path)
        .make_mesh("1", "STATE-1")
        .join_variable(name, column_names=columns)
        .to_frame()
    )
    return frame.groupby(level="element_id", sort=False).first()


def test_pylife_reads_nodes_elements_and_their_numbers(bowl, written):
    path, _ = written
    frame = pylife.vmap.VMAPImport(path).make_mesh("1").join_coordinates().to_frame()
    target = bowl.target
    expected = [
        (int(number), int(target.node_ids[node]))
        for number, corners in zip(target.cell_ids, target.corners, strict=True)
        for node in corners[corners >= 0]
    ]
    assert frame.index.tolist() == expected
    places = dict(zip(target.node_ids.tolist(), target.points, strict=True))
    read = frame[["x", "y", "z"]].to_numpy()
    assert np.array_equal(read, np.array([places[node] for _, node in expected]))


def test_pylife_reads_the_sets(bowl, written):
    path, _ = written
    target = bowl.target
    file = pylife.vmap.VMAPImport(path)
    assert set(file.element_sets("1")) == {"Inlet", "vent"}
    assert list(file.node_sets("1")) == ["corner"]
    frame = file.make_mesh("1").filter_element_set("Inlet").to_frame()
    found = set(frame.index.get_level_values("element_id"))
    assert found == set(target.cell_ids[target.cell_sets["Inlet"]].tolist())


@pytest.mark.parametrize(
    "name", ["thickness", "fibre_volume_fraction", "areal_fibre_mass", "permeability_1"]
)
def test_pylife_reads_every_scalar_to_the_last_bit(bowl, written, name):
    read = read_on_elements(written[0], name.upper(), [name])
    assert read.index.tolist() == bowl.target.cell_ids.tolist()
    assert np.array_equal(read[name].to_numpy(), bowl.dataset[name].values)


@pytest.mark.parametrize("name", ["fibre_direction_1", "fibre_direction_2"])
def test_pylife_reads_both_fibre_directions_to_the_last_bit(bowl, written, vectors, name):
    read = read_on_elements(written[0], name.upper(), ["x", "y", "z"])
    assert np.array_equal(read.to_numpy(), vectors(bowl.dataset, name))


def test_the_frame_of_an_element_follows_the_first_family_and_the_normal(bowl, written, vectors):
    with h5py.File(written[0]) as file:
        systems = {
            int(row["myIdentifier"]): row["myAxisVectors"].reshape(3, 3)
            for row in file["VMAP/SYSTEM/COORDINATESYSTEM"][:, 0]
        }
        elements = file["VMAP/GEOMETRY/1/ELEMENTS/MYELEMENTS"][:, 0]
    axes = np.array([systems[int(number)] for number in elements["myCoordinateSystem"]])
    assert np.allclose(axes @ axes.transpose(0, 2, 1), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(axes), 1.0)
    assert np.allclose(axes[:, 0], vectors(bowl.dataset, "fibre_direction_1"), atol=1e-12)
    assert np.allclose(axes[:, 2], bowl.target.surface.normals, atol=1e-12)


def test_the_report_names_the_worst_second_family(bowl, written, vectors):
    first, second = (vectors(bowl.dataset, f"fibre_direction_{n}") for n in (1, 2))
    error = np.abs(0.5 * np.pi - np.arccos(np.abs(np.einsum("ci,ci->c", first, second))))
    (loss,) = written[1].losses
    assert loss.error == pytest.approx(error.max(), rel=1e-9)
    assert loss.error > np.radians(20.0)
    assert loss.cell == bowl.target.cell_ids[np.argmax(error)]
    assert f"{np.degrees(error.max()):.2g} degrees" in written[1].warnings[0]


def test_numbers_and_sets_of_the_target_are_no_variables(bowl, written):
    found = set(pylife.vmap.VMAPImport(written[0]).variables("1", "STATE-1"))
    about_cells = {name for name in bowl.dataset.data_vars if name.startswith(("cell_", "part"))}
    assert len(about_cells) == 3  # number and two sets
    assert found.isdisjoint(name.upper() for name in about_cells)
    assert found >= {name.upper() for name in {*bowl.fields.scalars, *bowl.fields.vectors}}


def test_units_stand_in_the_file(written):
    with h5py.File(written[0]) as file:
        system = file["VMAP/SYSTEM/UNITSYSTEM"][:, 0]
        units = {int(row["myIdentifier"]): row for row in file["VMAP/SYSTEM/UNITS"][:, 0]}
        state = file["VMAP/VARIABLES/STATE-1/1"]
        assert [row["myUnitSymbol"].decode() for row in system] == [
            "m", "kg", "s", "A", "K", "mol", "cd",
        ]  # fmt: skip
        assert np.all(system["mySIScale"] == 1.0)
        assert state["THICKNESS"].attrs["MYUNIT"] == 1
        mass = units[int(state["AREAL_FIBRE_MASS"].attrs["MYUNIT"])]
        assert mass["myUnitDimension"].tolist() == [-2, 1, 0, 0, 0, 0, 0]
        assert state["FIBRE_VOLUME_FRACTION"].attrs["MYUNIT"] == -1


def test_fields_without_their_file_have_units_too(bowl, tmp_path):
    export(bowl.fields, bowl.target, "vmap", tmp_path / "fields.vmap")
    with h5py.File(tmp_path / "fields.vmap") as file:
        state = file["VMAP/VARIABLES/STATE-1/1"]
        assert state["THICKNESS"].attrs["MYUNIT"] == 1
        assert state["PERMEABILITY_1"].attrs["MYVARIABLEDESCRIPTION"].endswith(b"[m2]")


def shape_of(file):
    """Every group and dataset, with the names of its attributes and columns."""
    found = {}

    def note(name, item):  # what it returns would end the visit
        columns = item.dtype.names if isinstance(item, h5py.Dataset) else None
        found[name] = (set(item.attrs), columns)

    file.visititems(note)
    return found


def test_the_layout_is_that_of_a_file_which_another_program_wrote(bowl, written, tmp_path):
    """pyLife writes a mesh with a variable and sets; ours has the same groups and columns."""
    frame = pylife.vmap.VMAPImport(written[0]).make_mesh("1").join_coordinates().to_frame()
    frame = frame[frame.groupby(level="element_id")["x"].transform("size") == 4]
    other = tmp_path / "other.vmap"
    members = pandas.Index([frame.index[0][0]])
    (
        pylife.vmap.VMAPExport(other)
        .add_geometry("1", frame)
        .add_element_set("1", members, frame, "one")
        .add_variable("STATE-1", "1", "DISPLACEMENT", frame.assign(dx=0.0, dy=0.0, dz=0.0))
    )
    with h5py.File(other) as theirs, h5py.File(written[0]) as ours:
        expected, found = shape_of(theirs), shape_of(ours)
    renamed = {
        name.replace("DISPLACEMENT", "FIBRE_DIRECTION_1"): about for name, about in expected.items()
    }
    assert len(renamed) > 15
    for name, (attributes, columns) in renamed.items():
        assert name in found
        assert attributes <= found[name][0], name
        assert found[name][1] == columns, name


def test_solids_of_every_shape_keep_their_connectivity(bowl, make, tmp_path):
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    corners = corners * [0.1, 0.1, 0.01] + [0.1, 0.1, 0.0]
    points = np.concatenate([corners, corners + [0.2, 0.0, 0.0]])
    hexahedron, tetra = np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), np.array([[8, 9, 10, 12]])
    wedge = np.array([[9, 11, 10, 13, 15, 14]])
    cells = [("hexahedron", hexahedron), ("tetra", tetra), ("wedge", wedge)]
    meshio.Mesh(points, cells).write(tmp_path / "solid.vtu")
    target = read_target(tmp_path / "solid.vtu")
    weights = compute_weights(bowl.sheet, target, maximum_distance=0.2)
    fields = transfer(bowl.sheet, target, weights)
    mapping = mapping_report(bowl.sheet, target, weights, fields, name="solid", kind="structure")
    mapping.files = {"netcdf": "solid.nc"}
    dataset = mapped_dataset(bowl.sheet, target, weights, fields, mapping, command="lcmchain map")
    report = export(dataset, target, "vmap", tmp_path / "solid.vmap")
    frame = pylife.vmap.VMAPImport(tmp_path / "solid.vmap").make_mesh("1").to_frame()
    read = [group.index.get_level_values(1).tolist() for _, group in frame.groupby(level=0)]
    assert read == [(block[0] + 1).tolist() for _, block in cells]
    assert report.cells == 3
    thickness = read_on_elements(tmp_path / "solid.vmap", "THICKNESS", ["t"])["t"].to_numpy()
    assert np.array_equal(thickness, fields.scalars["thickness"])
    with h5py.File(tmp_path / "solid.vmap") as file:
        types = file["VMAP/SYSTEM/ELEMENTTYPES"]["myTypeName"][:, 0].tolist()
        axes = file["VMAP/SYSTEM/COORDINATESYSTEM"]["myAxisVectors"][1:, 0].reshape(-1, 3, 3)
    assert types == [
        b"VMAP_ELEM_3D_HEXAHEDRON_8", b"VMAP_ELEM_3D_TETRAHEDRON_4", b"VMAP_ELEM_3D_WEDGE_6",
    ]  # fmt: skip
    first, second = (fields.vectors[f"fibre_direction_{n}"] for n in (1, 2))
    assert np.allclose(axes[:, 0], first)
    assert np.allclose(np.einsum("ci,ci->c", axes[:, 2], second), 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["drape", "rtmsim", "lcmsim"])
def test_formats_of_shells_refuse_solids(bowl, tmp_path, name):
    points = np.array([[0.1, 0.1, 0.0], [0.2, 0.1, 0.0], [0.1, 0.2, 0.0], [0.1, 0.1, 0.1]])
    meshio.Mesh(points, [("tetra", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "solid.vtu")
    target = read_target(tmp_path / "solid.vtu")
    weights = compute_weights(bowl.sheet, target, maximum_distance=0.2)
    with pytest.raises(InputError, match="solid cells; map onto a mesh of triangles"):
        export(transfer(bowl.sheet, target, weights), target, name, tmp_path / "no")


def test_unmapped_cells_are_in_no_variable(bowl, tmp_path):
    dataset = bowl.dataset.copy(deep=True)
    for name in dataset.data_vars:
        if dataset[name].dtype.kind == "f" and dataset[name].attrs.get("location") == "face":
            dataset[name].values[5] = np.nan
    report = export(dataset, bowl.target, "vmap", tmp_path / "hole.vmap")
    with h5py.File(tmp_path / "hole.vmap") as file:
        ids = file["VMAP/VARIABLES/STATE-1/1/THICKNESS/MYGEOMETRYIDS"][:, 0]
        count = len(file["VMAP/GEOMETRY/1/ELEMENTS/MYELEMENTS"])
    assert set(bowl.target.cell_ids) - set(ids) == {bowl.target.cell_ids[5]}
    assert count == bowl.target.cell_count
    assert any("1 unmapped cell" in sentence for sentence in report.warnings)


def test_what_vmap_cannot_number_or_name_is_an_error(bowl, numbered, tmp_path):
    path = tmp_path / "no.vmap"
    with pytest.raises(InputError, match="32 bits"):
        export(*numbered(bowl, bowl.target.cell_ids + 2**31), "vmap", path)
    without = xr.Dataset({k: v for k, v in bowl.dataset.items() if "fibre_direction_1" not in k})
    with pytest.raises(InputError, match="needs fibre_direction_1"):
        export(without, bowl.target, "vmap", path)
    assert not path.exists()
