"""A run that ends with a stage, as it was asked to, and goes on from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from staged_strip import staged

from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.pipeline import run
from lcmchain.provenance import run_fingerprint
from lcmchain.results.folder import read_summary
from lcmchain.solver.checkpoint import FILE_NAME, read_checkpoint
from lcmchain.solver.stage_start import model_digest, started_state

NAMES = ("press", "hold")
FAST = (
    "output.pictures=false", "output.report=false", "output.vtu=false",
    # in the last stage, "after", hardly anything happens
    "tools.punch.stages=['press', 'hold', 'after']", "tools.weight.motion.force='0.01 N'",
    "grippers.spring.force='0.01 N'", "grippers.spring.stiffness='0.01 N/mm'",
)  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The groups of the run that never stopped."""
    folder = tmp_path_factory.mktemp("whole")
    return run(staged(*NAMES, overrides=FAST), folder, threads=1).datasets


def test_a_run_ends_with_a_stage_and_goes_on_bit_for_bit(whole, tmp_path):
    scene = staged(*NAMES, overrides=FAST)
    first = run(scene, tmp_path, threads=1, until_stage="press")
    assert first.summary["state"].startswith("stopped: with the stage press, as asked")
    assert read_summary(tmp_path)["state"] == first.summary["state"]
    with xr.open_dataset(tmp_path / "forming.nc") as file:
        times, state = file["time"].values, file.attrs["state"]
    assert state == first.summary["state"]
    assert times[-1] == pytest.approx(4e-3) and len(times) < scene.process.frames
    assert (tmp_path / FILE_NAME).exists()
    second = run(scene, tmp_path, threads=1, until_stage="hold", resume=True)
    assert second.summary["time_reached_s"] == pytest.approx(5e-3)
    with pytest.raises(InputError, match="--until-stage.*press.*4 ms.*has come to 5 ms"):
        run(scene, tmp_path, threads=1, until_stage="press", resume=True)
    last = run(scene, tmp_path, threads=1, resume=True)
    assert last.summary["state"] == "complete" and not (tmp_path / FILE_NAME).exists()
    for group in ("/", "/history"):
        for name, found in last.datasets[group].data_vars.items():
            if found.dtype.kind == "f":
                np.testing.assert_array_equal(found.values, whole[group][name].values, str(name))


def test_the_last_stage_is_the_whole_process(whole, tmp_path):
    result = run(staged(*NAMES, overrides=FAST), tmp_path, threads=1, until_stage="after")
    assert result.summary["state"] == "complete"
    np.testing.assert_array_equal(result.datasets["/"]["time"].values, whole["/"]["time"].values)


def test_a_stage_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match='--until-stage.*"pres".*did you mean "press"'):
        run(staged(*NAMES, overrides=FAST), tmp_path, until_stage="pres")


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """The folder of a run that has ended with the first stage."""
    folder = tmp_path_factory.mktemp("pressed")
    run(staged(*NAMES, overrides=FAST), folder, threads=1, until_stage="press")
    return folder


FURTHER = (
    "stages.hold.motions.punch={type='stroke', direction=[0,0,-1], distance='0.02 mm'}",
    "tools.weight.stages=['hold', 'after']",
)


def test_another_scene_goes_on_from_a_stage_bit_for_bit(pressed, tmp_path):
    """As if it had been run from its start; the folder that it begins from stays as it is."""
    before = {path.name: path.stat().st_mtime_ns for path in pressed.iterdir()}
    other = staged(*NAMES, overrides=(*FAST, *FURTHER))
    found = run(other, tmp_path / "from", threads=1, start_from=pressed)
    scratch = run(other, tmp_path / "scratch", threads=1)
    assert found.summary["started_from"] == {"folder": str(pressed), "stage": "press"}
    assert found.summary["state"] == "complete"
    assert found.summary["step_count"] == scratch.summary["step_count"]
    for group in ("/", "/history"):
        for name, values in found.datasets[group].data_vars.items():
            if values.dtype.kind == "f":
                expected = scratch.datasets[group][name].values
                np.testing.assert_array_equal(values.values, expected, str(name))
    assert {path.name: path.stat().st_mtime_ns for path in pressed.iterdir()} == before


def test_later_stages_may_be_others_and_longer(pressed, tmp_path):
    """Frames and samples of before stay, and those of the other stages follow."""
    interval = "output.history_interval='0.05 ms'"
    other = staged(*NAMES, overrides=(*FAST, interval))
    with pytest.raises(InputError, match=r"^output.history_interval.*later stages"):
        run(other, tmp_path, threads=1, start_from=pressed)
    interval = f"output.history_interval='{staged(*NAMES).history_interval!r} s'"
    longer = ("stages.hold.time='2.5 ms'", "process.frames=20")
    other = staged(*NAMES, overrides=(*FAST, interval, *longer))
    result = run(other, tmp_path, threads=1, start_from=pressed, until_stage="hold")
    times = result.datasets["/"]["time"].values
    with xr.open_dataset(pressed / "forming.nc") as file:
        earlier = file["time"].values
    np.testing.assert_array_equal(times[: len(earlier)], earlier)
    assert (np.diff(times) > 0.0).all() and times[-1] == pytest.approx(6.5e-3)
    assert [stage["name"] for stage in result.summary["stages"]] == ["press", "hold"]
    samples = result.datasets["/history"]["history_time"].values
    assert (np.diff(samples) > 0.0).all() and samples[-1] > 6.4e-3
    again = run(other, tmp_path, threads=1, resume=True)
    assert again.summary["state"] == "complete"


def test_a_run_does_not_end_with_a_stage_before_its_start(whole, tmp_path):
    scene, held = staged(*NAMES, overrides=FAST), tmp_path / "held"
    run(scene, held, threads=1, until_stage="hold")
    with pytest.raises(InputError, match="^--until-stage.*press.*4 ms.*held has come to 5 ms"):
        run(scene, tmp_path / "from", threads=1, start_from=held, until_stage="press")


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("stages.press.motions.punch.distance='0.1 mm'", "stages.press.motions.punch.distance"),
        ("contact.friction=0.2", "contact.friction"),
        ("tools.punch.position='0 0 1.1 mm'", r"tools.punch.position\[2\]"),
        ("tools.weight.stages=['press', 'after']", r"tools.weight.stages"),
    ],
)
def test_what_has_worked_before_must_be_the_same(pressed, tmp_path, override, key):
    with pytest.raises(InputError, match=f"^{key}: is another in the scene"):
        run(staged(*NAMES, overrides=(*FAST, override)), tmp_path, start_from=pressed)


def test_a_run_goes_on_from_the_end_of_a_stage_alone(whole, pressed, tmp_path):
    scene = staged(*NAMES, overrides=FAST)
    with pytest.raises(InputError, match="--from: .*nothing.*--until-stage NAME"):
        run(scene, tmp_path, start_from=tmp_path / "nothing")
    with pytest.raises(InputError, match="--from: is the folder of this run"):
        run(scene, pressed, start_from=pressed)
    with pytest.raises(InputError, match="--from: goes on from another run, and --resume"):
        folder = tmp_path / "both"
        run(scene, folder, until_stage="press", threads=1)
        run(scene, folder, start_from=pressed, resume=True)


def test_the_model_of_the_earlier_stages_is_compared(pressed):
    """What is found for all stages together must not have changed in the earlier ones."""
    scene = staged(*NAMES, overrides=FAST)
    own = model_digest(build_model(scene), 1)
    assert model_digest(build_model(staged(*NAMES, overrides=(*FAST, *FURTHER))), 1) == own
    for override in ("contact.penalty='9 N/mm^3'", "stages.press.mass_damping='1 1/s'"):
        assert model_digest(build_model(staged(*NAMES, overrides=(*FAST, override))), 1) != own
    checkpoint = read_checkpoint(pressed, run_fingerprint(scene))
    assert checkpoint.digest == own
    with pytest.raises(InputError, match="--from.*contact.penalty and contact.depth"):
        started_state(replace(checkpoint, digest=""), build_model(scene), 1, pressed)
