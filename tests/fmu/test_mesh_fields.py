"""Where the fields of a unit lie, by its layered standard: written, read, and each error found."""

import shutil
import zipfile
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
import xarray as xr
import xugrid

from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.doctor import examine
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.fmu.mesh_fields import FOLDER, NAME, VERSION, read_mesh_fields
from lcmchain.mapping.interface import read_interface

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def built(patch_file, tmp_path_factory):
    """The small unit in both versions, with all fields, and with four patches."""
    folder = tmp_path_factory.mktemp("units")
    return {
        (fmi, count): build_fmu(
            patch_file, folder / f"patch{fmi}_{count}.fmu", fmi=fmi, fields=["all"],
            pore_pressure=True, interface=count,
        )
        for fmi, count in ((2, 0), (3, 0), (3, 4))
    }  # fmt: skip


def unpacked(unit, folder):
    with zipfile.ZipFile(unit) as archive:
        archive.extractall(folder)
    return folder


def packed(folder, path):
    shutil.make_archive(str(path), "zip", folder)
    return Path(f"{path}.zip").rename(path)


def told(unit):
    """What the doctor says of the fields."""
    words = "fields on meshes: "
    return [f.text.removeprefix(words) for f in examine(unit).findings if f.text.startswith(words)]


def test_a_reader_of_xml_and_of_ugrid_needs_nothing_of_lcmchain(built, tmp_path):
    folder = unpacked(built[3, 0], tmp_path / "unit") / FOLDER
    manifest = fromstring((folder / "fmi-ls-manifest.xml").read_bytes())
    space = "{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-"
    assert manifest.tag == "fmiLayeredStandardManifest"
    assert manifest.attrib[f"{space}name"] == NAME == folder.name
    assert manifest.attrib[f"{space}version"] == VERSION and manifest.attrib[f"{space}description"]
    listed = fromstring((folder / "fields.xml").read_bytes()).findall("Field")
    described = fromstring((folder.parents[1] / "modelDescription.xml").read_bytes())
    arrays = {
        v.get("name"): v
        for v in described.find("ModelVariables")
        if v.find("Dimension") is not None
    }
    assert {field.get("variable") for field in listed} == set(arrays) and len(arrays) > 10
    with xr.open_dataset(folder / "fields.nc") as dataset:
        (grid,) = xugrid.UgridDataset(dataset).grids
        for field in listed:
            own = arrays[field.get("variable")]
            assert field.get("size") == own.find("Dimension").get("start")
            assert field.get("unit") == own.get("unit", "1")
            assert field.get("mesh") == grid.name and field.get("location") == "face"
            assert dataset[field.get("entries")].dims == (grid.face_dimension,)


def test_both_versions_say_the_same(built):
    two, three = (read_mesh_fields(built[fmi, 0]) for fmi in (2, 3))
    assert two.fields == three.fields
    xr.testing.assert_identical(two.meshes, three.meshes)
    combined = {name: field.combines for name, field in three.fields.items()}
    assert {n for n, how in combined.items() if how == "sum"} == {
        "volume", "volume_rate", "volume_rate_slope", "area", "area_rate",
    }  # fmt: skip
    assert [n for n, how in combined.items() if how == "parallel"] == ["pore_resistance"]
    vectors = {n: (f.vector, f.component) for n, f in three.fields.items() if f.vector}
    assert vectors == {f"position_{axis}": ("position", axis) for axis in "xyz"}


def test_faces_of_a_patch_share_its_entry(built, tmp_path):
    unit = built[3, 4]
    found = read_mesh_fields(unit)
    interface = read_interface(unpacked(unit, tmp_path / "unit") / "resources" / "interface.nc")
    values = np.arange(4.0) ** 2
    on_faces = found.on_faces("thickness", values)
    np.testing.assert_array_equal(on_faces, interface.spread(values))
    assert found.fields["thickness"].size == 4 and len(on_faces) == len(interface.cells)


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="needs the checkout, not only the tests")
def test_an_infiltration_unit_says_it_too(tmp_path):
    scene = EXAMPLES / "cosimulation" / "compression" / "scene.toml"
    options = InfiltrationUnit(motion="volume", fields=["all"])
    unit = build_infiltration_fmu(None, scene, tmp_path / "resin.fmu", fmi=3, options=options)
    fields = read_mesh_fields(unit).fields
    assert {n for n, field in fields.items() if field.combines == "sum"} == {
        "volume_rate", "volume_rate_slope", "preform_volume",
    }  # fmt: skip
    assert fields["fill_factor"].combines == "mean" and not told(unit)


def test_a_unit_of_others_says_nothing(tmp_path, built):
    folder = unpacked(built[3, 0], tmp_path / "unit")
    shutil.rmtree(folder / "extra")
    other = packed(folder, tmp_path / "other.fmu")
    assert not told(other)
    with pytest.raises(InputError, match="other.fmu.*fields.xml"):
        read_mesh_fields(other)


def replaced(old, new, name="fields.xml"):
    def change(folder):
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def of_mesh(change):
    """Change the mesh file."""

    def write(folder):
        with xr.open_dataset(folder / "fields.nc", decode_cf=False) as dataset:
            changed = dataset.load()
        change(changed)
        changed.to_netcdf(folder / "fields.nc")

    return write


def shifted(dataset):
    dataset["interface_patch"] += 1


def as_reals(dataset):
    dataset["interface_patch"] = dataset["interface_patch"].astype(float)


def elsewhere(dataset):
    dataset["interface_patch"].attrs["location"] = "node"


def without_mesh(dataset):
    del dataset["interface"].attrs["cf_role"]


@pytest.mark.parametrize(
    ("fmi", "change", "words"),
    [
        (3, lambda folder: (folder / "fields.nc").unlink(), "has no fields.nc"),
        (3, lambda folder: (folder / "fields.nc").write_bytes(b"x"), "fields.nc"),
        (3, replaced(NAME, "org.other", "fmi-ls-manifest.xml"), 'names the standard "org.other"'),
        (3, replaced(f'"{VERSION}"', '""', "fmi-ls-manifest.xml"), "names no version"),
        (3, replaced('"thickness"', '"thick"'), "thick is no array of the unit"),
        (2, replaced('"thickness"', '"thick"'), "thick is no array of the unit"),
        (3, replaced('size="16"', 'size="15"'), "has 16 entries, and 15 in fields.xml"),
        (2, replaced('size="16"', 'size="17"'), "has 16 entries, and 17 in fields.xml"),
        (3, replaced('size="16"', 'size="x"'), 'the field pore_pressure has the size "x"'),
        (3, replaced(' combines="mean"', ""), "the field pore_pressure has no combines"),
        (3, replaced('mesh="interface"', 'mesh="sheet"'), "lies on sheet, which is no mesh"),
        (3, replaced('"interface_patch"', '"patch"'), "the entries patch, no integers"),
        (3, of_mesh(shifted), "does not number the 16 entries of thickness from 0"),
        (3, of_mesh(as_reals), "the entries interface_patch, no integers"),
        (3, of_mesh(elsewhere), "interface_patch does not lie on each face of interface"),
        (3, of_mesh(without_mesh), "lies on interface, which is no mesh"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found(built, tmp_path, fmi, change, words):
    unit = built[fmi, 0]
    assert told(unit) == []
    folder = unpacked(unit, tmp_path / "unit")
    change(folder / FOLDER)
    (text,) = told(packed(folder, tmp_path / "broken.fmu"))
    assert words in text
