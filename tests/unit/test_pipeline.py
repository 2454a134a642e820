"""The chain of stages: what is left when one of them fails, and what the terminal then says."""

import json
import warnings

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain import cli, pipeline
from lcmchain.errors import InputError, MappingError, SimulationError
from lcmchain.fields import read_forming
from lcmchain.pipeline import run
from lcmchain.provenance import run_fingerprint
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.solver.checkpoint import FILE_NAME, FRAME_FILE_NAME
from lcmchain.solver.simulation import Simulation
from lcmchain.tools import ToolWarning

SCENE = """
title = "dent [1]"
element = "membrane-shell"
process = { time = "5 ms", frames = 3 }
output = { pictures = false, vtu = false }
blank = { size = ["40 mm", "40 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }

[[mapping]]
name = "near"
mesh = "near.vtu"
kind = "structure"
maximum_distance = "3 mm"

[[mapping]]
name = "far"
mesh = "far.vtu"
kind = "structure"
maximum_distance = "3 mm"
"""


def write_square(path, height):
    points = 1e-3 * np.array([[-5.0, -5, height], [5, -5, height], [5, 5, height], [-5, 5, height]])
    meshio.write(path, meshio.Mesh(points, [("quad", [[0, 1, 2, 3]])]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene whose second mesh lies 50 mm away from the sheet."""
    folder = tmp_path_factory.mktemp("dent")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    write_square(folder / "near.vtu", 0.0)
    write_square(folder / "far.vtu", 50.0)
    return folder


@pytest.fixture(scope="module")
def failed(folder):
    """What the run leaves whose second mapping fails, and its error."""
    out = folder / "out"
    with pytest.raises(MappingError) as caught:
        run(read_scene(folder / "scene.toml"), out)
    return out, caught.value


def summary_in(out):
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def test_what_is_no_scene_or_no_number_of_threads_is_told(tmp_path):
    with pytest.raises(InputError, match="needs a scene and got str; read a file by"):
        run("scene.toml", tmp_path / "results")
    with pytest.raises(InputError, match="threads: is -1; give 1 or more"):
        run(scene_from_text(SCENE.partition("[[mapping]]")[0]), tmp_path / "results", threads=-1)
    assert not (tmp_path / "results").exists()


def test_a_failed_mapping_leaves_the_forming_results(failed, folder):
    out, error = failed
    summary = summary_in(out)
    assert summary == error.result.summary
    assert summary["step_count"] > 0 and summary["punch_force_max_N"] > 0.0
    scene = read_scene(folder / "scene.toml")
    assert summary["scene_sha256"] == scene.source.sha256
    assert summary["run_fingerprint"] == run_fingerprint(scene).sha256
    sheet = read_forming(out / "forming.nc")
    assert sheet.sizes["time"] == 3 and sheet.attrs["state"] == "complete"
    with xr.open_dataset(out / "near.nc") as mapped:
        assert mapped.attrs["source_file"] == "forming.nc"
        assert mapped.attrs["state"] == "complete"
    assert summary["mapping"]["near"]["status_count"]["unmapped"] == 0
    assert (out / "near.nc").is_file() and not (out / "far.nc").exists()
    assert "no sheet within 3 mm" in summary["mapping"]["far"]["error"]


def test_a_failed_mapping_says_what_to_do(failed):
    out, error = failed
    assert error.exit_code == 2
    for words in ('mapping "far" failed', "no sheet within", str(out), "--resume"):
        assert words in str(error)
    assert '"near"' not in str(error)


def test_resume_maps_without_forming_again(failed, folder, tmp_path, monkeypatch):
    """With a mended mapping; the forming part of the summary stays, and the checkpoint goes."""
    out, error = failed
    mended = tmp_path / "scene.toml"
    mended.write_text(SCENE.replace("far.vtu", "near.vtu"), encoding="utf-8")
    write_square(tmp_path / "near.vtu", 0.0)
    again = tmp_path / "again"
    again.mkdir()
    for name in (FILE_NAME, FRAME_FILE_NAME):
        (again / name).write_bytes((out / name).read_bytes())

    def advance_to(*arguments):
        raise AssertionError("formed again")

    monkeypatch.setattr(Simulation, "advance_to", advance_to)
    result = run(read_scene(mended), again, resume=True)
    assert summary_in(again) == result.summary
    assert not (again / FILE_NAME).exists()
    assert (again / "far.nc").is_file()
    with pytest.raises(InputError, match="is complete, nothing of it is left"):
        run(read_scene(mended), again, resume=True)
    before = error.result.summary
    changed = {key for key in before if before[key] != result.summary[key]}
    assert changed <= {
        "scene_sha256", "wall_s", "compile_s", "us_per_element_step", "mapping", "run", "state",
        "provenance",
    }  # fmt: skip
    assert result.summary["wall_s"] == pytest.approx(before["wall_s"], abs=0.5)


def test_a_run_tells_of_tools_that_leave_no_space_for_the_sheet(tmp_path):
    """As check does: what follows, deep penetration or no numbers at all, does not tell why."""
    table = '[[tools]]\nname = "table"\nshape = { type = "plate", side = "below" }\n'
    with pytest.raises(SimulationError):
        run(scene_from_text(SCENE.partition("[[mapping]]")[0] + table), tmp_path)
    (told,) = (text for text in summary_in(tmp_path)["warnings"] if "no space" in text)
    assert told.startswith("punch and table are 0.004 mm apart")


def test_an_unreadable_mesh_is_told_before_any_work(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "Simulation", None)
    (tmp_path / "near.vtu").write_text("no mesh", encoding="utf-8")
    (tmp_path / "far.vtu").write_bytes((folder / "far.vtu").read_bytes())
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    with pytest.raises(InputError, match="near.vtu") as caught:
        run(read_scene(tmp_path / "scene.toml"), tmp_path / "out")
    assert not isinstance(caught.value, MappingError)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["forming", "summary", "shear_angle", "tools", "initial"])
def test_a_mapping_does_not_take_the_name_of_other_files(folder, tmp_path, name):
    scene = read_scene(folder / "scene.toml", [f'mapping.near.name="{name}"'])
    with pytest.raises(InputError, match="choose another name") as caught:
        run(scene, tmp_path / "out")
    assert "mapping[0].name" in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_pictures_that_fail_leave_the_summary(folder, tmp_path, monkeypatch):
    from lcmchain.report import run_pictures

    def draw(*arguments, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run_pictures, "draw_result", draw)
    scene = read_scene(folder / "scene.toml", ["output.pictures=true", "mapping=[]"])
    with pytest.raises(OSError, match="No space"):
        run(scene, tmp_path)
    assert summary_in(tmp_path)["mapping"] == {}


def test_what_tools_warn_of_is_in_the_summary_and_said_at_once(folder, tmp_path, monkeypatch):
    build = Simulation.from_scene

    def from_scene(scene):
        warnings.warn(ToolWarning("punch.stl: 3 holes were closed"), stacklevel=1)
        return build(scene)

    monkeypatch.setattr(Simulation, "from_scene", from_scene)
    with pytest.warns(ToolWarning, match="3 holes"):
        result = run(read_scene(folder / "scene.toml", ["mapping=[]"]), tmp_path)
    assert result.summary["warnings"].count("punch.stl: 3 holes were closed") == 1


# --- terminal -------------------------------------------------------------------------------------


def test_the_command_prints_the_summary_of_a_failed_mapping_and_its_error(folder, tmp_path, capsys):
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as stop:
        cli.main(["run", str(folder / "scene.toml"), "--out", str(out)])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    summary = summary_in(out)
    assert "dent [1]" in captured.out
    assert f"{np.degrees(summary['shear_angle_max_rad']):.1f} deg" in captured.out
    assert f"{summary['step_count']:,}" in captured.out
    for warning in summary["warnings"]:
        assert warning in captured.out
    assert f"Results in {out}" in captured.out
    assert captured.err.count("Error:") == 1 and 'mapping "far" failed' in captured.err
