"""The structural stage in a run and as a command: what is left, printed and refused."""

import json
import shutil

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain import cli
from lcmchain.errors import InputError, MappingError
from lcmchain.pipeline import run
from lcmchain.scene import read_scene
from lcmchain.scene.presets import FIBRES, RESINS
from lcmchain.scene.structure import Fibre, Resin

from .conftest import needs_calculix

SCENE = """
title = "press"
process = { time = "1 ms", frames = 2 }
output = { pictures = false, vtu = false, report = false }
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
material = { preset = "MD600" }

[[tools]]
name = "plate"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.01 mm" }

[[mapping]]
name = "part"
mesh = "part.vtu"
kind = "structure"
maximum_distance = "3 mm"

[mapping.structure]
fibre = { preset = "T300", density = "1810 kg/m^3" }
resin = { preset = "MY750" }
elements = "as_mesh"
frequencies = 3
supports = [{ name = "rim", edge = true }]
loads = [{ name = "push", point = "0 0 0.5 mm", force = "0 0 -1 N" }]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, make):
    folder = tmp_path_factory.mktemp("press")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    points, quads = make.grid(4, 4, (-0.015, -0.015), (0.015, 0.015))
    meshio.write(folder / "part.vtu", meshio.Mesh(make.lifted(points), [("quad", quads)]))
    return folder


@pytest.fixture(scope="module")
def out(folder):
    """Results of a run with a structural analysis."""
    run(read_scene(folder / "scene.toml"), folder / "out")
    return folder / "out"


def exit_code(*arguments):
    with pytest.raises(SystemExit) as stop:
        cli.main([str(argument) for argument in arguments])
    return stop.value.code or 0


@needs_calculix
def test_a_run_analyses_the_mapped_part(out):
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    report = summary["structure"]["part"]
    assert report["solved"] and report["elements"] == ["S4"]
    assert len(report["eigenfrequencies"]) == 3 and report["displacement_max"] > 0.0
    assert report == json.loads((out / "part_calculix.json").read_text(encoding="utf-8"))
    with xr.open_dataset(out / "part_calculix.nc") as results:
        assert "areal_fibre_mass" in results and "stress_11" in results
        assert "structural stage" in results.attrs["history"]
    log = (out / "lcmchain.log").read_text(encoding="utf-8")
    assert "part: S4 elements are too stiff" in log


def test_a_wrong_place_is_told_before_anything_is_computed(folder, tmp_path):
    change = 'mapping.part.structure.supports.rim={name = "rim", set = "RIM"}'
    scene = read_scene(folder / "scene.toml", [change])
    with pytest.raises(InputError, match="the file has no sets"):
        run(scene, tmp_path / "out")
    assert not (tmp_path / "out" / "forming.nc").exists()


def test_a_2d_approach_has_no_structure(folder, tmp_path):
    overrides = ["element=membrane-shell"]
    with pytest.raises(MappingError, match="no thickness; form the sheet"):
        run(read_scene(folder / "scene.toml", overrides), tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["mapping"]["part"]["status_count"]["unmapped"] == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("mapping.part.kind=infiltration", 'mapping.*structure: needs kind = "structure"'),
        ("mapping.part.structure.fibre.preset=T3", 'there is no preset "T3"; did you mean "T300"'),
        ("mapping.part.structure.loads.push.pressure=1 MPa", "force and pressure"),
        ("mapping.part.structure.supports=[]", "the part has to be held"),
        ("mapping.part.structure.resin.E=3 GP", "resin.E"),
        ('mapping.part.structure.supports.rim.point="0 0 0 m"', "but has point and edge"),
    ],
)
def test_wrong_entries_of_a_scene(folder, change, message):
    with pytest.raises(InputError, match=message):
        read_scene(folder / "scene.toml", [change])


@needs_calculix
def test_the_command_maps_and_then_takes_what_is_mapped(folder, out, tmp_path, capsys):
    case = tmp_path / "case.toml"
    case.write_text(SCENE.partition("[mapping.structure]\n")[2], encoding="utf-8")
    mesh = folder / "part.vtu"
    command = ["structure", out / "forming.nc", mesh, "--case", case, "--out", tmp_path / "one"]
    assert exit_code(*command, "--maximum-distance", "3 mm", "--name", "part") == 0
    told = capsys.readouterr().out
    assert "part: 16 cells" in told and "eigenfrequencies" in told and "part_calculix.inp" in told
    first = json.loads((tmp_path / "one" / "part_calculix.json").read_text(encoding="utf-8"))
    source = tmp_path / "one" / "part.nc"
    again = ["structure", source, mesh, "--case", case, "--out", tmp_path / "two"]
    assert exit_code(*again, "--name", "part", "--set", "frequencies=0") == 0
    assert not (tmp_path / "two" / "part.nc").exists()
    second = json.loads((tmp_path / "two" / "part_calculix.json").read_text(encoding="utf-8"))
    assert second["displacement_max"] == first["displacement_max"]
    assert second["eigenfrequencies"] == []


def test_a_deck_keeps_numbers_and_sets_of_the_user_s_file(make, out, tmp_path, capsys):
    """From an Abaqus file in mm, whose numbers begin anywhere, to the deck of CalculiX."""
    points, quads = make.grid(2, 2, (-15.0, -15.0), (15.0, 15.0))
    nodes = "".join(f"{301 + 2 * k}, {x}, {y}, 0.0\n" for k, (x, y) in enumerate(points))
    cells = "".join(
        f"{9000 - k}, " + ", ".join(str(301 + 2 * node) for node in nodes_of_cell) + "\n"
        for k, nodes_of_cell in enumerate(quads)
    )
    (tmp_path / "part.inp").write_text(
        f"*NODE\n{nodes}*ELEMENT, TYPE=S4R, ELSET=SKIN\n{cells}*NSET, NSET=LEFT\n301, 303, 305\n"
        "*ELSET, ELSET=PATCH\n9000, 8998\n"
    )
    case = tmp_path / "case.toml"
    text = SCENE.partition("[mapping.structure]\n")[2].partition("supports")[0]
    case.write_text(
        f'{text}supports = [{{ name = "left", set = "LEFT" }}]\n'
        'loads = [{ name = "wind", set = "PATCH", pressure = "10 Pa" }]\n'
    )
    command = ["structure", out / "forming.nc", tmp_path / "part.inp", "--case", case]
    code = exit_code(*command, "--out", tmp_path / "o", "--length-unit", "mm", "--no-solve")
    assert code == 0, capsys.readouterr().err
    mesh = (tmp_path / "o" / "structure_calculix_mesh.inp").read_text().splitlines()
    assert "9000, 301, 307, 309, 303" in mesh
    assert mesh[mesh.index("*NSET, NSET=LEFT") + 1] == "301, 303, 305,"
    assert mesh[mesh.index("*ELSET, ELSET=PATCH") + 1] in ("9000, 8998,", "8998, 9000,")
    deck = (tmp_path / "o" / "structure_calculix.inp").read_text()
    assert "303, 3, 3" in deck and "8998, P, 1.0" in deck and "8999, P" not in deck
    sections = (tmp_path / "o" / "structure_calculix_sections.inp").read_text()
    assert "*ORIENTATION, NAME=LCM_O9000" in sections


def test_without_a_solver_the_command_has_done_its_work(folder, out, tmp_path, capsys):
    case = tmp_path / "case.toml"
    case.write_text(SCENE.partition("[mapping.structure]\n")[2], encoding="utf-8")
    command = ["structure", out / "part.nc", folder / "part.vtu", "--case", case]
    assert exit_code(*command, "--out", tmp_path, "--ccx", "no-such-solver") == 0
    captured = capsys.readouterr()
    assert "CalculiX is not installed" in " ".join((captured.out + captured.err).split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--case", "absent.toml"], "there is no such scene file"),
        (["--case", "case.toml", "--name", "a/b"], "no name for files"),
        (["--case", "case.toml", "--set", "fibre.E1=3 m"], "fibre.E1"),
        (["--case", "case.toml", "--ccx", "/no/such/ccx"], "no program that can be run"),
    ],
)
def test_wrong_commands(folder, out, tmp_path, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(SCENE.partition("[mapping.structure]\n")[2])
    shutil.copy(folder / "part.vtu", tmp_path)
    assert exit_code("structure", out / "part.nc", "part.vtu", *arguments) == 2
    assert message in capsys.readouterr().err


def test_a_saved_state_is_chosen_by_its_time(folder, out, tmp_path, capsys):
    """Of the forming result; a file that is mapped onto the mesh already has one state."""
    case = tmp_path / "case.toml"
    case.write_text(SCENE.partition("[mapping.structure]\n")[2], encoding="utf-8")
    mesh, end = folder / "part.vtu", ["--case", case, "--out", tmp_path, "--no-solve"]
    with xr.open_dataset(out / "forming.nc") as opened:
        times = opened["time"].values
    command = ["structure", out / "forming.nc", mesh, *end, "--maximum-distance", "30 mm"]
    assert exit_code(*command, "--time", f"{times[0]} s") == 0, capsys.readouterr().err
    with xr.open_dataset(tmp_path / "structure.nc") as opened:
        assert opened["time"] == times[0] != times[-1]
    assert exit_code(*command, "--time", "1 ms", "--frame", "1") == 2
    assert "leave out frame or time" in capsys.readouterr().err
    for option in (("--frame", "0"), ("--time", "1 ms")):
        assert exit_code("structure", out / "part.nc", mesh, *end, *option) == 2
        told = " ".join(capsys.readouterr().err.split())
        assert f"{option[0][2:]}: is of no effect: the file is mapped onto this mesh" in told


def test_what_a_preset_gives_is_told_as_such(folder):
    source = read_scene(folder / "scene.toml").source
    told = dict(source.defaulted)
    assert told["mapping.part.structure.fibre.E2"] == "15 GPa (preset T300)"
    assert told["mapping.part.structure.resin.nu"] == "0.35 (preset MY750)"
    assert dict(source.given)["mapping.part.structure.fibre.density"] == "1810 kg/m^3"
    assert told["material.areal_mass"].endswith("(preset MD600)")


def test_presets_are_the_ones_that_may_be_named():
    for model, published in ((Fibre, FIBRES), (Resin, RESINS)):
        for name, values in published.items():
            table = model(preset=name)
            assert {key for key in values if getattr(table, key) is None} == set()
            assert all(basis.note for _, basis in values.values())
    assert np.isclose(Fibre(preset="T300").across_shear, 7e9, rtol=1e-4)
    assert Fibre(preset="E-glass").across == 74e9
