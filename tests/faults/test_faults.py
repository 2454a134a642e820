"""What happens to results when a run is killed, stopped, starved of disk, or run twice at once.

Nothing complete is lost, nothing is half-written, nothing of one run lies among files of another.
"""

import contextlib
import hashlib
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain import atomic, cli
from lcmchain.errors import InputError, OutputError, SimulationError, SimulationInterrupted
from lcmchain.mapping import map_file
from lcmchain.pipeline import run
from lcmchain.results import ResultsFolder
from lcmchain.results.folder import HIDDEN, JOURNAL
from lcmchain.scene import read_scene
from lcmchain.solver import checkpoint
from lcmchain.solver.checkpoint import FILE_NAME, FRAME_FILE_NAME
from lcmchain.solver.simulation import Simulation

SCENE = """
title = "dent"
element = "membrane-shell"
process = { time = "0.4 ms", frames = 3 }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "DISTANCE" }

[[mapping]]
name = "onward"
mesh = "square.vtu"
kind = "structure"
maximum_distance = "3 mm"
"""
KILLED_RUN = Path(__file__).with_name("killed_run.py")


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    """Files of two scenes that differ in the travel of the punch."""
    folder = tmp_path_factory.mktemp("scenes")
    points = 1e-3 * np.array([[-5.0, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]])
    meshio.write(folder / "square.vtu", meshio.Mesh(points, [("quad", [[0, 1, 2, 3]])]))
    files = folder / "earlier.toml", folder / "later.toml"
    for file, distance in zip(files, ("0.1 mm", "0.2 mm"), strict=True):
        file.write_text(SCENE.replace("DISTANCE", distance), encoding="utf-8")
    return files


@pytest.fixture(scope="module")
def complete(scenes, tmp_path_factory):
    """Folders with the complete results of both scenes."""
    folders = []
    for scene in scenes:
        folders.append(tmp_path_factory.mktemp("complete") / scene.stem)
        run(read_scene(scene), folders[-1])
    return folders


@pytest.fixture
def folder(complete, tmp_path):
    """A copy of the complete results of the earlier scene."""
    return Path(shutil.copytree(complete[0], tmp_path / "results"))


def contents(folder):
    """Names of the files of results and hashes of their contents, hidden and older ones not."""
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
        and HIDDEN not in file.relative_to(folder).parts
        and not file.relative_to(folder).parts[0].startswith("previous-")
    }


def fields(folder):
    """The bits of all fields of a forming result."""
    with xr.open_dataset(folder / "forming.nc") as sheet:
        return {str(name): array.values.tobytes() for name, array in sheet.data_vars.items()}


def summary_in(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def require_same_results(folder, reference):
    """Fields, files and state are those of the complete reference, and nothing else is there."""
    assert fields(folder) == fields(reference)
    assert set(contents(folder)) == set(contents(reference))
    assert {path.name for path in folder.iterdir()} == {path.name for path in reference.iterdir()}
    assert summary_in(folder)["state"] == "complete"


def require_whole(folder):
    """Every file that a reader may open is complete."""
    for file in folder.rglob("*"):
        if not file.is_file() or file.name.startswith(atomic.UNFINISHED) or HIDDEN in file.parts:
            continue
        if file.suffix == ".nc":
            with xr.open_dataset(file) as dataset:
                dataset.load()
        elif file.suffix == ".json":
            json.loads(file.read_text(encoding="utf-8"))
        elif file.suffix == ".png":
            assert file.read_bytes().endswith(b"IEND\xaeB`\x82"), file
        elif file.suffix in (".vtu", ".pvd"):
            assert file.read_text(encoding="utf-8").rstrip().endswith("</VTKFile>"), file


# --- kills ----------------------------------------------------------------------------------------


def killed_run(scene, folder, moment):
    """Run in another process that is killed at a moment; return how many there were."""
    done = subprocess.run(
        [sys.executable, KILLED_RUN, scene, folder, str(moment)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == (-signal.SIGKILL if moment else 0), done.stderr
    return int(done.stdout or 0)


@pytest.fixture(scope="module")
def moment_count(scenes, complete, tmp_path_factory):
    """How many moments there are in a run of the later scene over results of the earlier one."""
    folder = shutil.copytree(complete[0], tmp_path_factory.mktemp("counted") / "results")
    return killed_run(scenes[1], folder, 0)


def check_killed_run(scenes, complete, folder, moment):
    shutil.copytree(complete[0], folder)
    killed_run(scenes[1], folder, moment)
    require_whole(folder)

    earlier, here = contents(complete[0]), contents(folder)
    is_later = summary_in(complete[1])["run_fingerprint"]
    summary = summary_in(folder) if "summary.json" in here else {}
    if summary.get("state") == "complete" and summary["run_fingerprint"] == is_later:
        assert fields(folder) == fields(complete[1])
    else:
        places = [here] + [
            contents(place)
            for place in (folder / HIDDEN / "previous", folder / "previous-complete")
            if place.is_dir()
        ]
        lost = {
            name
            for name, digest in earlier.items()
            if not any(files.get(name) == digest for files in places)
        }
        assert lost == set()
    if summary.get("run_fingerprint") == is_later:
        later = contents(complete[1])
        alike = {name for name, digest in earlier.items() if later.get(name) == digest}
        mixed = {name for name, digest in here.items() if earlier.get(name) == digest}
        assert mixed - alike == set()

    try:
        run(read_scene(scenes[1]), folder, resume=True)
    except InputError as error:
        assert "no checkpoint" in str(error)
        run(read_scene(scenes[1]), folder)
    require_same_results(folder, complete[1])


def test_a_run_killed_over_earlier_results(scenes, complete, moment_count, tmp_path):
    rng = np.random.default_rng(9)
    for moment in sorted(rng.integers(1, moment_count + 1, 2).tolist()):
        check_killed_run(scenes, complete, tmp_path / str(moment), moment)


@pytest.mark.slow
def test_a_run_killed_at_fifty_moments(scenes, complete, moment_count, tmp_path):
    for moment in np.unique(np.linspace(1, moment_count, 50).round().astype(int)).tolist():
        check_killed_run(scenes, complete, tmp_path / str(moment), moment)


def test_a_run_killed_while_it_removes_earlier_results(scenes, complete, folder, monkeypatch):
    """What is being removed is no earlier result any more, whatever part of it is left."""

    def killed(path, **options):
        for journal in Path(path).rglob(f"{HIDDEN}/{JOURNAL}"):
            journal.unlink()
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", killed)
        with pytest.raises(KeyboardInterrupt):
            run(read_scene(scenes[1]), folder)
    require_same_results(folder, complete[1])
    run(read_scene(scenes[0]), folder)
    require_same_results(folder, complete[0])
    assert [path.name for path in (folder / HIDDEN).iterdir() if path.is_dir()] == []


def test_a_refused_run_keeps_what_a_killed_one_was_setting_aside(scenes, complete, folder):
    earlier = contents(folder)
    gathered = folder / HIDDEN / "previous"
    gathered.mkdir()
    for path in (*(p for p in folder.iterdir() if p.name != HIDDEN), folder / HIDDEN / JOURNAL):
        place = gathered / path.relative_to(folder)
        place.parent.mkdir(exist_ok=True)
        path.rename(place)
    with pytest.raises(InputError, match="no checkpoint"):
        run(read_scene(scenes[1]), folder, resume=True)
    assert contents(gathered) == earlier
    run(read_scene(scenes[1]), folder)
    require_same_results(folder, complete[1])


# --- stops ----------------------------------------------------------------------------------------


def interrupted_run(scene, folder, **options):
    """Run, and press Ctrl-C as soon as the sheet is being formed."""

    def press(completed, total, text):
        if text.startswith("forming"):
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(SimulationInterrupted) as caught:
        run(read_scene(scene), folder, progress=press, **options)
    return caught.value


def test_an_interrupted_run_says_so_and_leaves_what_it_has(scenes, complete, folder):
    earlier = contents(folder)
    error = interrupted_run(scenes[1], folder)
    assert contents(folder / "previous-complete") == earlier
    summary = summary_in(folder)
    assert summary["state"] == "interrupted" and error.result.summary == summary
    assert 0.0 < summary["time_reached_s"] < summary["process_time_s"]
    with xr.open_dataset(folder / "forming.nc") as sheet:
        assert sheet.attrs["state"] == "interrupted"
    assert "interrupted" in (folder / "lcmchain.log").read_text(encoding="utf-8")
    run(read_scene(scenes[1]), folder, resume=True)
    require_same_results(folder, complete[1])


def test_a_fresh_run_keeps_an_interrupted_one_until_it_is_complete(scenes, complete, tmp_path):
    folder = tmp_path / "results"
    interrupted_run(scenes[0], folder)
    interrupted_run(scenes[1], folder)
    run(read_scene(scenes[0]), folder / "previous-interrupted", resume=True)
    require_same_results(folder / "previous-interrupted", complete[0])
    run(read_scene(scenes[1]), folder, resume=True)
    require_same_results(folder, complete[1])


def test_a_run_that_a_guard_stops_says_why(scenes, complete, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "results"

    def require_resolved(simulation):
        if simulation.time > 0.3e-3:
            raise SimulationError("element 7 is folded")

    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "require_resolved", require_resolved)
        with pytest.raises(SystemExit) as stop:
            cli.main(["run", str(scenes[0]), "--out", str(folder)])
    assert stop.value.code == 1
    captured = capsys.readouterr()
    assert "element 7 is folded. The frames up to 0.2 ms are in" in captured.err
    assert re.search(r"0\.3\d* of 0\.4 ms", captured.out), "the numbers of what there is"
    assert summary_in(folder)["state"] == "stopped: element 7 is folded"
    with xr.open_dataset(folder / "forming.nc") as sheet:
        assert sheet.attrs["state"] == "stopped: element 7 is folded"
    assert "element 7 is folded" in (folder / "lcmchain.log").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="element 7 is folded.*--allow-incomplete"):
        map_file(folder / "forming.nc", scenes[0].parent / "square.vtu", tmp_path / "m.nc")
    run(read_scene(scenes[0]), folder)
    require_same_results(folder, complete[0])


def test_a_failed_mapping_is_a_stopped_run(scenes, complete, tmp_path):
    points = np.array([[-5.0, -5, 9], [5, -5, 9], [5, 5, 9]])
    meshio.write(scenes[0].parent / "far.vtu", meshio.Mesh(points, [("triangle", [[0, 1, 2]])]))
    scene = read_scene(scenes[0], ['mapping.onward.mesh="far.vtu"'])
    with pytest.raises(InputError, match="onward"):
        run(scene, tmp_path)
    assert summary_in(tmp_path)["state"].startswith('stopped: mapping "onward" failed')
    with xr.open_dataset(tmp_path / "forming.nc") as sheet:
        assert sheet.attrs["state"] == "complete"


def test_fields_of_an_unfinished_run_are_not_mapped_unasked(scenes, tmp_path, capsys):
    folder = tmp_path / "results"
    interrupted_run(scenes[0], folder)
    arguments = [folder / "forming.nc", scenes[0].parent / "square.vtu", "--out", tmp_path / "m.nc"]
    command = ["map", *map(str, arguments), "--maximum-distance", "3 mm"]
    with pytest.raises(SystemExit) as stop:
        cli.main(command)
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert 'state "interrupted"' in error and "--allow-incomplete" in error
    assert not (tmp_path / "m.nc").exists()
    with contextlib.suppress(SystemExit):
        cli.main([*command, "--allow-incomplete"])
    assert 'state "interrupted"' in capsys.readouterr().out
    with xr.open_dataset(tmp_path / "m.nc") as mapped:
        assert mapped.attrs["state"] == "interrupted"


def test_a_moved_clock_changes_nothing(scenes, complete, tmp_path, monkeypatch):
    folder = tmp_path / "results"
    times = iter(range(4_000_000_000, 0, -86_400))
    monkeypatch.setattr(time, "time", lambda: float(next(times)))
    interrupted_run(scenes[1], folder)
    os.utime(folder / FILE_NAME, (0, 0))
    os.utime(folder / FRAME_FILE_NAME, (4_000_000_000, 4_000_000_000))
    run(read_scene(scenes[1]), folder, resume=True)
    require_same_results(folder, complete[1])


# --- disks ----------------------------------------------------------------------------------------


@contextlib.contextmanager
def disk_full_at(name):
    """Let writing fail from the moment at which a file of this name is about to appear."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    announce = atomic.announce

    def fill(path):
        announce(path)
        if path.name == name:
            resource.setrlimit(resource.RLIMIT_FSIZE, (40, before[1]))

    with pytest.MonkeyPatch.context() as patch:
        for module in (atomic, checkpoint):
            patch.setattr(module, "announce", fill)
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    "name",
    [
        "summary.json", FRAME_FILE_NAME, FILE_NAME, "forming.nc", "forming.vtu", "shear_angle.png",
        # written in the same way as those of their kind above
        *(pytest.param(name, marks=pytest.mark.slow)
          for name in ("forming.pvd", "onward.nc", "onward.vtu", "onward.png", "onward.json")),
    ],
)  # fmt: skip
def test_a_full_disk_loses_nothing(scenes, complete, folder, name):
    earlier = contents(folder)
    with disk_full_at(name), pytest.raises((OutputError, InputError)) as caught:
        run(read_scene(scenes[1]), folder)
    assert name in str(caught.value) and "free some space" in str(caught.value)
    assert contents(folder / "previous-complete") == earlier
    require_whole(folder)
    assert list(folder.rglob(f"{atomic.UNFINISHED}*")) == []
    if (folder / "summary.json").exists():
        assert summary_in(folder)["state"] != "complete"
    run(read_scene(scenes[1]), folder, resume=(folder / FILE_NAME).exists())
    require_same_results(folder, complete[1])


@pytest.mark.parametrize("place", ["/sys/results", "{file}", "{file}/results"])
def test_a_place_that_cannot_be_written_is_told_before_any_work(scenes, tmp_path, place, capsys):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    out = place.format(file=tmp_path / "file")
    with pytest.raises(SystemExit) as stop:
        cli.main(["run", str(scenes[0]), "--out", out])
    assert stop.value.code == 2
    assert "results cannot be written here" in capsys.readouterr().err
    assert (tmp_path / "file").read_text(encoding="utf-8") == "kept"


# --- two at once, inputs among outputs ------------------------------------------------------------


def test_one_folder_takes_one_run_at_a_time(scenes, complete, folder):
    earlier = contents(folder)
    with ResultsFolder.locked(folder):
        with pytest.raises(InputError, match="another run is at work in this folder") as caught:
            run(read_scene(scenes[1]), folder)
    assert "process" in str(caught.value) and "since" in str(caught.value)
    assert contents(folder) == earlier
    run(read_scene(scenes[1]), folder)
    require_same_results(folder, complete[1])


def test_files_of_the_user_stay(scenes, complete, folder):
    """They are no part of the report either, such as the picture of a check that was refused."""
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    shutil.copy(folder / "tools.png", folder / "initial.png")
    run(read_scene(scenes[1]), folder)
    assert (folder / "notes.txt").read_text(encoding="utf-8") == "mine"
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "(initial.png)" not in report and "(tools.png)" in report


def test_results_are_not_written_over_inputs(scenes, tmp_path):
    for suffix in (".toml", ".vtu"):
        for file in scenes[0].parent.glob(f"*{suffix}"):
            shutil.copy(file, tmp_path)
    mesh = (tmp_path / "square.vtu").rename(tmp_path / "onward.vtu").read_bytes()
    scene = read_scene(tmp_path / "earlier.toml", ['mapping.onward.mesh="onward.vtu"'])
    with pytest.raises(InputError, match="would write over it"):
        run(scene, tmp_path)
    assert (tmp_path / "onward.vtu").read_bytes() == mesh
    assert not (tmp_path / "forming.nc").exists() and not (tmp_path / HIDDEN).exists()


@pytest.mark.parametrize("which", ["source", "target"])
def test_a_mapping_is_not_written_over_its_inputs(complete, scenes, tmp_path, which, capsys):
    source = Path(shutil.copy(complete[0] / "forming.nc", tmp_path))
    target = Path(shutil.copy(scenes[0].parent / "square.vtu", tmp_path))
    before = source.read_bytes(), target.read_bytes()
    out = {"source": source, "target": target.with_suffix(".nc")}[which]
    with pytest.raises(SystemExit) as stop:
        cli.main(["map", str(source), str(target), "--out", str(out)])
    assert stop.value.code == 2 and "write over it" in capsys.readouterr().err
    assert (source.read_bytes(), target.read_bytes()) == before


def test_no_command_writes_over_its_own_input(tmp_path, capsys):
    """Test data that bear the name of a result, and a scene that bears that of the unit."""
    data = tmp_path / "parameters.toml"
    rows = [f"{u},{1e-3 * u + 1e-6 * u**4:.6g}" for u in range(0, 61, 4)]
    text = "\n".join(["displacement [mm],force [N]", *rows, ""])
    data.write_text(text, encoding="utf-8")
    scene = tmp_path / "scene.fmu"
    scene.write_text(SCENE.split("[[mapping]]")[0].replace("DISTANCE", "0.1 mm"), encoding="utf-8")
    before = scene.read_bytes()
    for command in (
        ["identify", "shear", str(data), "--out", str(tmp_path)],
        ["fmu", "build", str(scene), "-o", str(scene)],
    ):
        with pytest.raises(SystemExit) as stop:
            cli.main(command)
        assert stop.value.code == 2 and "write over it" in capsys.readouterr().err, command
    assert data.read_text(encoding="utf-8") == text and scene.read_bytes() == before


def test_what_a_killed_run_did_not_finish_is_removed(scenes, complete, tmp_path):
    """Also from a folder in which it had finished nothing."""
    folder = tmp_path / "results"
    interrupted_run(scenes[1], folder)
    shutil.rmtree(folder / "forming_frames")
    left = folder / "forming_frames" / f"{atomic.UNFINISHED}forming_0000-abc.vtu"
    left.parent.mkdir()
    left.write_text("half a file", encoding="utf-8")
    run(read_scene(scenes[1]), folder, resume=True)
    require_same_results(folder, complete[1])
