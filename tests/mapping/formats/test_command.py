"""``lcmchain map --export FORMAT`` writes beside the mapped file and says what a format lacks."""

import json

import meshio
import numpy as np
import pylife.vmap
import pytest
import xarray as xr
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.errors import InputError
from lcmchain.mapping.formats import FORMATS


@pytest.fixture
def inputs(make, tmp_path):
    """A sheared plate as forming.nc and a mesh of its size in millimetres."""
    points2, faces = make.grid(8, 8)
    points = make.lifted(points2)
    first, second = make.families(points, faces, shear=0.3)
    dataset = make.forming_result(
        points, faces, areal_fibre_mass=0.6, shear_angle=0.3,
        fibre_direction_1=first, fibre_direction_2=second,
    )  # fmt: skip
    dataset.attrs["state"] = "complete"
    dataset.to_netcdf(tmp_path / "forming.nc", engine="netcdf4")
    flat, quads = make.grid(4, 3)
    meshio.Mesh(1e3 * make.lifted(flat), [("quad", quads)]).write(tmp_path / "target.vtu")
    return tmp_path


def run(folder, *words, target="target.vtu"):
    command = [
        "map", str(folder / "forming.nc"), str(folder / target),
        "--out", str(folder / "mapped.nc"), "--length-unit", "mm", *words,
    ]  # fmt: skip
    return CliRunner().invoke(app, command)


def written(folder):
    return {path.name for path in folder.iterdir()} - {"forming.nc", "target.vtu"}


def test_exports_lie_beside_the_mapped_file_and_in_its_report(inputs):
    done = run(inputs, "--export", "vmap", "--export", "drape", "--export", "vmap")
    assert done.exit_code == 0, done.output
    assert {"mapped.nc", "mapped.vmap", "mapped.drape.fem"} <= written(inputs)
    report = json.loads((inputs / "mapped.json").read_text())
    assert [export["format"] for export in report["exports"]] == ["vmap", "drape"]
    vmap = report["exports"][0]
    assert vmap["files"] == ["mapped.vmap"] and vmap["cells"] == 12
    assert vmap["losses"][0]["error"] == pytest.approx(0.3, abs=1e-9)
    assert vmap["losses"][0]["unit"] == "rad"
    told = [w for w in report["warnings"] if w.startswith("export vmap")]
    assert len(told) == 1 and "17 degrees" in told[0]
    assert "perpendicular" in done.output.replace("\n", " ")
    frame = (
        pylife.vmap.VMAPImport(inputs / "mapped.vmap").make_mesh("1").join_coordinates().to_frame()
    )
    assert np.allclose(frame["x"].max(), 1.0)  # metres


def test_numbers_and_sets_of_a_solver_deck_arrive(inputs):
    deck = """*NODE
    10, 0.0, 0.0, 0.0
    20, 1000.0, 0.0, 0.0
    30, 1000.0, 1000.0, 0.0
    40, 0.0, 1000.0, 0.0
    *ELEMENT, TYPE=S3, ELSET=SKIN
    700, 10, 20, 30
    800, 10, 30, 40
    *ELSET, ELSET=GATE
    800,
    *NSET, NSET=CORNER
    20, 30
    """
    (inputs / "target.inp").write_text(deck.replace("    ", ""))
    done = run(inputs, "--export", "vmap", target="target.inp")
    assert done.exit_code == 0, done.output
    file = pylife.vmap.VMAPImport(inputs / "mapped.vmap")
    nodes = {700: [10, 20, 30], 800: [10, 30, 40]}
    found = file.make_mesh("1").to_frame().index.tolist()
    assert found == [(cell, node) for cell, corners in nodes.items() for node in corners]
    assert set(file.element_sets("1")) == {"SKIN", "GATE"}
    gate = file.make_mesh("1").filter_element_set("GATE").to_frame()
    assert set(gate.index.get_level_values("element_id")) == {800}
    corner = file.make_mesh("1").filter_node_set("CORNER").to_frame()
    assert set(corner.index.get_level_values("node_id")) == {20, 30}


def test_the_history_of_the_file_repeats_the_exports(inputs):
    run(inputs, "--export", "drape")
    with xr.open_dataset(inputs / "mapped.nc") as dataset:
        assert "--export drape" in dataset.attrs["history"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--export", "odb"), "write one of vmap, drape, rtmsim, lcmsim"),
        (("--export", "vmap", "--export", "rtmsim"), "needs the permeability"),
    ],
)
def test_an_export_that_cannot_be_is_told_before_anything_is_written(inputs, words, message):
    done = run(inputs, *words)
    assert isinstance(done.exception, InputError) and done.exception.exit_code == 2
    assert message in str(done.exception)
    assert written(inputs) == set()


def test_help_names_every_format():
    text = " ".join(CliRunner().invoke(app, ["map", "--help"], terminal_width=200).output.split())
    for name in FORMATS:
        assert name in text
