"""Interrupted, resumed and threaded runs give the bits of the plain run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from lcmchain.cli import main
from lcmchain.fields import read_forming, read_group
from lcmchain.pipeline import run
from lcmchain.scene import read_scene
from lcmchain.solver.checkpoint import FILE_NAME, FRAME_FILE_NAME

SCENE = """
title = "small cup"
process = { time = "40 ms", frames = 5 }
output = { pictures = false, vtu = false }
material = { preset = "MD600" }
contact = { friction = 0.157 }

[blank]
size = ["120 mm", "120 mm"]
edge_length = "5 mm"
height = "0.502 mm"

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "25 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "20 mm" }

[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "28 mm", fillet_radius = "10 mm", side = "below" }

[[tools]]
name = "holder"
shape = { type = "plate_with_hole", hole_radius = "28 mm", fillet_radius = "10 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "0.3 kg", ramp = "5 ms" }
"""


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("cup") / "cup.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def plain(scene_file, tmp_path_factory, compiled_by_two):
    folder = tmp_path_factory.mktemp("plain")
    with compiled_by_two():
        run(read_scene(scene_file), folder, threads=2)
    return folder


def assert_same_bits(folder, plain):
    """Of fields and of histories."""
    for group in ("/", "history"):
        one, other = (read_group(path / "forming.nc", group) for path in (folder, plain))
        assert set(one.variables) == set(other.variables)
        for name in one.variables:
            assert one[name].values.tobytes() == other[name].values.tobytes(), name
    assert one.sizes["history_time"] == 200
    for entry in ("punch_force_max_N", "punch_force_peak_N", "tool_loads", "energy", "warnings"):
        found, expected = (
            json.loads((path / "summary.json").read_text())[entry] for path in (folder, plain)
        )
        assert found == expected, entry


def command(scene_file, folder, *options):
    program = [
        sys.executable,
        "-P",
        "-m",
        "lcmchain.cli",
        "run",
        str(scene_file),
        "--out",
        str(folder),
    ]
    return [*program, *options]


@pytest.mark.parametrize(
    "number",
    # the last two are one request to a run
    [signal.SIGKILL, signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)],
)
def test_killed_and_resumed_run_is_bit_identical(scene_file, plain, tmp_path, number):
    """A killed run goes on from its last checkpoint, an interrupted one from where it stopped."""
    process = subprocess.Popen(
        command(scene_file, tmp_path), stderr=subprocess.PIPE, text=True, env=os.environ
    )
    checkpoint = tmp_path / FILE_NAME
    deadline = time.monotonic() + 600.0  # the run may compile, on a busy machine
    while not checkpoint.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    # somewhere in the second frame
    time.sleep(float(np.random.default_rng(number).uniform(0.0, 0.15)))
    process.send_signal(number)
    _, message = process.communicate(timeout=60)
    assert process.returncode != 0, "the run ended before it was stopped"
    if number != signal.SIGKILL:
        assert process.returncode == 1 and "--resume" in message
    assert checkpoint.exists()
    state = json.loads((tmp_path / "summary.json").read_text())["state"]
    assert state == ("running" if number == signal.SIGKILL else "interrupted")
    assert (tmp_path / "forming.nc").exists() == (number != signal.SIGKILL)

    subprocess.run(command(scene_file, tmp_path, "--resume"), check=True)
    assert_same_bits(tmp_path, plain)
    assert not checkpoint.exists() and not (tmp_path / FRAME_FILE_NAME).exists()


def test_one_and_two_threads_give_the_same_bits(scene_file, plain, tmp_path):
    run(read_scene(scene_file), tmp_path, threads=1)
    assert_same_bits(tmp_path, plain)


def test_resume_without_or_with_a_broken_checkpoint_is_refused(scene_file, tmp_path, capsys):
    def refused():
        with pytest.raises(SystemExit) as stop:
            main(["run", str(scene_file), "--out", str(tmp_path), "--resume"])
        assert stop.value.code == 2
        return capsys.readouterr().err

    assert "no checkpoint" in refused()
    (tmp_path / FILE_NAME).write_bytes(b"no archive")
    assert "no checkpoint of lcmchain" in refused()


# damped and with free depths as the hard case of compaction between plates: they share kernels
PRESS = """
title = "press"
process = { time = "20 ms", frames = 11, mass_damping = "200 1/s" }
output = { pictures = false, vtu = false }
element = { compaction_strain = "director" }
contact = { depth = "free" }
material = { preset = "MD600" }
blank = { size = ["60 mm", "60 mm"], edge_length = "5 mm", height = "0.502 mm" }

[[tools]]
name = "table"
shape = { type = "plate", side = "below" }

[[tools]]
name = "press"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "1 mm" }
"""


def test_guard_stops_the_published_compaction_and_keeps_the_good_frames(tmp_path, capsys):
    """Between frictionless plates the published director strain tilts and folds over."""
    scene_file = tmp_path / "press.toml"
    scene_file.write_text(PRESS, encoding="utf-8")
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(SystemExit) as stop:
        main(["run", str(scene_file), "--out", str(out)])
    assert stop.value.code == 1
    said = capsys.readouterr().err
    for part in ("element", "mm at", "ms (step", "Likely cause", "director", "normal"):
        assert part in said, said
    (error,) = [line for line in said.splitlines() if line.startswith("Error: ")]
    frames = read_forming(out / "forming.nc")
    assert 2 <= frames.sizes["time"] < 11
    assert np.isfinite(frames["thickness"].values).all()
    assert frames["thickness"].values.min() > 0.0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["state"].startswith("stopped: ") and frames.attrs["state"] == summary["state"]
    reason = summary["state"].removeprefix("stopped: ")
    assert (
        error == f"Error: {reason}. The frames up to {1e3 * frames['time'].values[-1]:.4g} ms "
        f"are in {out / 'forming.nc'}"
    )
