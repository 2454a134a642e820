"""Infiltration in the chain: as a stage of a run, in its report, and on the command line."""

import json
import os
import shutil
import signal
from pathlib import Path

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain import cli
from lcmchain.check import check_scene
from lcmchain.commands.after_forming import _fill_scene
from lcmchain.coupling.infiltration.stage import FillOptions, checkpoint_file
from lcmchain.errors import InputError, MappingError, SimulationInterrupted
from lcmchain.pipeline import run
from lcmchain.scene import read_scene

from .conftest import GATE, HEAD, VENT

SCENE = """
title = "flat sheet"
process = { time = "0.2 ms", frames = 2 }
output = { vtu = false }
blank = { size = ["60 mm", "60 mm"], edge_length = "10 mm" }
material = { preset = "MD600" }
permeability = { law = "gebart", fibre_radius = "3.5 um" }

[infiltration]
time = "1000 s"
resin = { law = "constant", viscosity = "0.1 Pa*s" }

[[infiltration.gates]]
name = "middle"
point = "0 0 0 mm"
radius = "11 mm"
pressure = "3 bar"

[[infiltration.vents]]
name = "rim"
rim = true

[[mapping]]
name = "part"
mesh = "part.vtu"
kind = "infiltration"

[mapping.infiltration]
time = "1000 s"
resin = { law = "constant", viscosity = "0.1 Pa*s" }

[[mapping.infiltration.gates]]
name = "left"
box = ["-26 -26 -5 mm", "-24 26 5 mm"]
pressure = "3 bar"

[[mapping.infiltration.vents]]
name = "right"
box = ["24 -26 -5 mm", "26 26 5 mm"]
"""


def command(*arguments):
    """Run the command line; return its exit code."""
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    return ended.value.code or 0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene with an infiltration of the sheet, and one of a smaller mesh in it."""
    folder = tmp_path_factory.mktemp("chain")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    x = np.linspace(-0.025, 0.025, 6)
    points = np.stack([c.ravel() for c in np.meshgrid(x, x, [0.0], indexing="ij")], axis=1)
    node = np.arange(36).reshape(6, 6)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1)
    meshio.write(folder / "part.vtu", meshio.Mesh(points, [("quad", quads.reshape(-1, 4))]))
    return folder


@pytest.fixture(scope="module")
def result(folder):
    return run(read_scene(folder / "scene.toml"), folder / "out")


def test_a_run_fills_sheet_and_mesh(result, folder):
    found = result.summary["infiltration"]
    assert list(found) == ["sheet", "part"]
    for name, report in found.items():
        assert report["outcome"] == "filled" and report["balance_error"] < 1e-10
        stored = json.loads((folder / "out" / f"{name}_filling.json").read_text())
        assert stored == report
        for file in report["files"].values():
            assert (folder / "out" / file).is_file(), file
        assert "vtu" not in report["files"]
    with xr.open_dataset(folder / "out" / "part_filling.nc") as part:
        assert {"mapping_status", "thickness", "fill_time"} <= set(part.data_vars)
        assert "forming_time_s" in part.attrs
    assert json.loads((folder / "out" / "summary.json").read_text())["state"] == "complete"


def test_the_report_tells_of_every_filling(result, folder):
    text = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert '<section id="infiltration">' in text and 'href="#infiltration"' in text
    assert "Infiltration: lines of equal fill time" in text
    seconds = result.summary["infiltration"]["sheet"]["time"]
    assert f"filled after {seconds:.4g} s" in text and "gate middle" in text


def test_the_check_lists_what_will_flow(folder):
    effects = {e.name: e.reason for e in check_scene(read_scene(folder / "scene.toml")).effects}
    assert effects["infiltration of sheet"] == (
        "gate middle: 3 bar at 11 mm around (0, 0, 0) mm; vent rim: rim; at most 1000 s"
    )
    assert "gate left: 3 bar at box" in effects["infiltration of part"]


def test_fill_takes_a_scene_whose_forming_is_done(result, folder, tmp_path, capsys):
    out = Path(shutil.copytree(folder / "out", tmp_path / "out"))
    before = (out / "part.nc").stat().st_mtime_ns
    assert command("fill", folder / "scene.toml", "--out", out, "-q") == 0
    again = json.loads((out / "part_filling.json").read_text())
    assert again["time"] == result.summary["infiltration"]["part"]["time"]
    assert (out / "part.nc").stat().st_mtime_ns == before  # not mapped once more
    assert command("fill", folder / "scene.toml", "--out", tmp_path / "empty") == 2
    assert "form it first with: lcmchain run" in capsys.readouterr().err


def press_once(stage, share):
    pressed = []

    def progress(completed, total, text):
        if text.startswith(stage) and completed > share * total and not pressed:
            pressed.append(True)
            os.kill(os.getpid(), signal.SIGINT)

    return progress


def test_a_run_that_is_stopped_while_it_fills_goes_on_there(result, folder, tmp_path):
    scene = read_scene(folder / "scene.toml", ["output.pictures=false", "output.report=false"])
    with pytest.raises(SimulationInterrupted) as caught:
        run(scene, tmp_path, progress=press_once("part: filling", 0.5))
    assert caught.value.result is not None and "are complete" in caught.value.where
    assert checkpoint_file(tmp_path, "part").is_file()
    stopped = shutil.copytree(tmp_path, tmp_path / "stopped")
    told = []
    run(scene, tmp_path, resume=True, progress=lambda c, t, text: told.append((c, text)))
    first = next(share for share, text in told if text.startswith("part: filling,"))
    assert first > 0.5  # not from the start
    for name in ("sheet", "part"):
        with (
            xr.open_dataset(tmp_path / f"{name}_filling.nc") as one,
            xr.open_dataset(folder / "out" / f"{name}_filling.nc") as other,
        ):
            np.testing.assert_array_equal(one["fill_time"].values, other["fill_time"].values)
            np.testing.assert_array_equal(one["resin_pressure"], other["resin_pressure"])
    # so does the filling of the scene, whose other part is done and has no checkpoint
    options = FillOptions(picture=False, vtu=False, resume=True)
    (_, sheet), (_, part) = _fill_scene(folder / "scene.toml", stopped, (), options, True)
    assert (
        sheet.outcome == part.outcome == "filled" and not checkpoint_file(stopped, "part").exists()
    )
    with pytest.raises(InputError, match="no checkpoint to go on from"):
        _fill_scene(folder / "scene.toml", stopped, (), options, True)
    # of an earlier state, by its time
    early = FillOptions(picture=False, vtu=False)
    _fill_scene(folder / "scene.toml", stopped, (), early, True, at=0.0)
    with xr.open_dataset(stopped / "sheet_filling.nc") as found:
        assert found.attrs["forming_time_s"] == 0.0


def test_a_place_beside_the_mesh_is_told_before_forming(folder, tmp_path):
    scene = read_scene(
        folder / "scene.toml",
        ['mapping.part.infiltration.gates.left.box=["1 1 1 m", "2 2 2 m"]'],
    )
    with pytest.raises(InputError, match=r'gates\[0\] "left".box: no node lies in the box'):
        run(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_failed_infiltration_leaves_the_forming_result(folder, tmp_path):
    scene = read_scene(
        folder / "scene.toml",
        ["infiltration.gates.middle.point=0 0 50 mm", "mapping=[]", "output.pictures=false"],
    )
    with pytest.raises(MappingError, match='infiltration "sheet" failed') as caught:
        run(scene, tmp_path)
    assert "lies outside the mesh" in str(caught.value)
    assert (tmp_path / "forming.nc").is_file()
    assert "error" in json.loads((tmp_path / "summary.json").read_text())["infiltration"]["sheet"]
    assert "lies outside the mesh" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_command_fills_a_file(kit, tmp_path, capsys):
    case = tmp_path / "case.toml"
    case.write_text(HEAD.replace("500 s", "60 s") + GATE + VENT)
    source = str(kit.forming())
    arguments = ["fill", source, "--case", str(case), "--out", str(tmp_path / "out")]
    assert command(*arguments, "--name", "strip", "--set", "frames=3") == 0
    said = capsys.readouterr().out
    assert "strip: 36 cells" in said and "Warning: only" in said
    with xr.open_dataset(tmp_path / "out" / "strip_filling.nc") as found:
        assert found.sizes["time"] <= 3
    assert command(*arguments, "--strict", "-q") == 1
    mesh = tmp_path / "preform.toml"
    preform = (
        '[preform]\nthickness = "1 mm"\nfibre_volume_fraction = 0.5\n'
        'permeability = { k1 = "1e-10 m^2" }\n'
    )
    mesh.write_text(HEAD + GATE + VENT + preform)
    for wrong, message in (
        (["fill", source], "--case: is missing"),
        (["fill", source + "x", "--case", str(case)], "there is no such file"),
        ([*arguments, "--mesh", str(tmp_path / "no.inp")], "there is no such mesh file"),
        ([*arguments, "--resume"], "no checkpoint to go on from"),
        ([*arguments, "--set", "gates.left.pressure=-1 bar"], "not above that of the vents"),
        ([*arguments, "--name", "a/b"], "is no name for files"),
        ([*arguments, "--time", "1 ms", "--frame", "0"], "--time: names a saved state, and"),
        ([*arguments, "--time", "1 ms"], "has no saved states with times"),
        (["fill", source, "--case", str(mesh), "--frame", "0"], "--frame: chooses a saved state"),
    ):
        assert command(*wrong) == 2
        assert message in capsys.readouterr().err


def test_the_check_refuses_places_that_the_mesh_does_not_have(folder, capsys):
    """Told before anything is formed, by the check as by the run."""
    wrong = SCENE.replace('box = ["24 -26 -5 mm", "26 26 5 mm"]', 'set = "OUT"')
    scene = folder / "no_set.toml"
    scene.write_text(wrong, encoding="utf-8")
    for verb in ("check", "run"):
        assert command(verb, scene, "--out", folder / "none") == 2
        assert 'vents[0] "right".set: the mesh has no set "OUT"' in capsys.readouterr().err
    assert not (folder / "none").exists()
