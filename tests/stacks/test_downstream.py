"""What comes after the forming of a stack, by the commands, from a result that was laid by hand."""

import json

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.forming_fields import with_permeability
from lcmchain.fields import write_forming_netcdf
from lcmchain.fields.dataset import SHEET
from lcmchain.fields.sheet import sheet_areas
from lcmchain.fields.stack import PLY
from lcmchain.scene import read_scene

SCENE = """
title = "dome of three plies"
process = { time = "10 ms", frames = 2 }
material = { preset = "MD600" }
[[plies]]
size = ["80 mm", "80 mm"]
edge_length = "8 mm"
name = "lower"
[[plies]]
size = ["40 mm", "40 mm"]
edge_length = "5 mm"
fibre_angle = "30 deg"
name = "patch"
[[plies]]
size = ["80 mm", "80 mm"]
edge_length = "10 mm"
fibre_angle = "45 deg"
name = "upper"
[permeability]
law = "gebart"
fibre_radius = "3.5 um"
[infiltration]
time = "2 h"
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
gates = [{ name = "pole", point = "0 0 100 mm", radius = "10 mm", pressure = "3 bar" }]
vents = [{ name = "rim", rim = true }]
"""


@pytest.fixture(scope="module")
def results(laid, tmp_path_factory):
    """A scene and its results in a folder; the groups of the result."""
    folder = tmp_path_factory.mktemp("dome")
    path = folder / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    scene = read_scene(path)
    groups = with_permeability(scene, laid(scene))
    groups[SHEET].attrs["state"] = "complete"
    (folder / "out").mkdir()
    write_forming_netcdf(folder / "out" / "forming.nc", groups)
    return path, folder / "out", groups


def lcmchain(*arguments):
    found = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert found.exit_code == 0, found.output
    return found.output


def test_a_scene_fills_its_formed_stack(results):
    path, out, groups = results
    lcmchain("fill", path, "--out", out, "--quiet")
    report = json.loads((out / "sheet_filling.json").read_text(encoding="utf-8"))
    assert report["outcome"] == "filled"
    sheet = groups[SHEET]
    areas, plies = sheet_areas(sheet), sheet[PLY].values
    pores = areas * sheet["thickness"].values[-1] * (1 - sheet["fibre_volume_fraction"].values[-1])
    # the patch counts with whole faces of the lower ply, upon which it ends
    assert report["pore_volume"] == pytest.approx(pores.sum(), rel=0.05)
    assert report["pore_volume"] > 1.05 * pores[plies != 1].sum()
    with xr.open_dataset(out / "sheet_filling.nc") as filled:
        thickness = np.unique(filled["thickness"].values.round(9))
        assert thickness == pytest.approx([0.9 * 2 * 1.004e-3, 0.9 * 3 * 1.004e-3], rel=1e-3)
        assert np.isfinite(filled["fill_time"].values).all()
        assert filled["patch_thickness"].attrs["long_name"].endswith("ply patch")


def test_the_formed_stack_becomes_a_deck_with_its_plies_as_layers(results, tmp_path):
    import meshio

    path, out, groups = results
    lower = groups["/lower"]
    points = np.stack([lower[f"lower_node_{axis}"].values for axis in "xyz"], axis=1)
    faces = lower["lower_face_nodes"].values.astype(int)
    inner = np.abs(points[faces].mean(axis=1)[:, :2]).max(axis=1) < 0.02
    used, cells = np.unique(faces[inner], return_inverse=True)
    meshio.Mesh(points[used], [("quad", cells.reshape(-1, 4))]).write(tmp_path / "part.vtu")
    case = tmp_path / "case.toml"
    case.write_text(
        'lay_up = "plies"\nfibre = { preset = "T300" }\nresin = { preset = "MY750" }\n'
        '[[supports]]\nname = "rim"\nedge = true\nfixed = ["x", "y", "z"]\n',
        encoding="utf-8",
    )
    lcmchain(
        "structure", out / "forming.nc", tmp_path / "part.vtu", "--case", case,
        "--out", tmp_path / "part", "--no-solve",
    )  # fmt: skip
    (deck,) = (tmp_path / "part").glob("*_calculix_sections.inp")
    lines = deck.read_text(encoding="ascii").splitlines()
    heads = [number for number, line in enumerate(lines) if line.endswith("COMPOSITE")]
    assert len(heads) == inner.sum()
    middle = heads[int(np.argmin(np.linalg.norm(points[faces[inner]].mean(axis=1)[:, :2], axis=1)))]
    layers = [line.split(",") for line in lines[middle + 1 : middle + 4]]
    assert [layer[2].strip().rpartition("_")[2] for layer in layers] == ["1", "2", "3"]
    thickness = [float(layer[0]) for layer in layers]
    assert thickness == pytest.approx([0.9 * 1.004e-3] * 3, rel=0.02)
