"""A run that ends with a stage, as it was asked to, and goes on from there."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from staged_strip import staged

from lcmchain.errors import InputError
from lcmchain.pipeline import run
from lcmchain.results.state import read_summary
from lcmchain.solver.checkpoint import FILE_NAME

NAMES = ("press", "hold", "pull")
FAST = ("output.pictures=false", "output.report=false", "output.vtu=false")


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
