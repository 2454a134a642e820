"""The unit in the project's own master: as in fmpy, and as the direct run."""

from contextlib import contextmanager

import fmpy
import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.cosimulation import run as run_module
from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.errors import SimulationError, SimulationInterrupted

STEP = 5e-4
STOP = 6 * STEP


def test_the_unit_runs_as_in_fmpy_bit_for_bit(unit, tmp_path):
    system = system_from(
        {
            "stop_time": f"{STOP!r} s",
            "window": f"{STEP!r} s",
            "units": [
                {"name": "dome", "fmu": unit.name, "start": {"out_dir": str(tmp_path / "forming")}}
            ],
        },
        None,
        directory=unit.parent,
    )
    summary = run_system(system, tmp_path / "out")
    assert summary["units"]["dome"]["step_count"] == 6

    with xr.open_dataset(tmp_path / "out" / "cosimulation.nc", group="dome") as record:
        record.load()
    # fmpy at the very points at which the master was
    points = record["time"].values
    names = ["punch.force", "punch.travel", "internal_energy", "thickness[1]", "thickness[400]"]
    peer = fmpy.simulate_fmu(
        str(unit), stop_time=STOP, output_interval=STEP, output=[*names, "thickness_min"]
    )
    assert np.allclose(points, peer["time"], rtol=1e-12, atol=0)
    for name in names[:3]:
        ours = record[name.replace(".", "_")].values
        assert np.abs(ours).max() > 0.0
        assert np.allclose(ours, peer[name], rtol=1e-9, atol=1e-12 * np.abs(ours).max()), name
    assert np.allclose(record["thickness"].values[:, 0], peer["thickness[1]"], rtol=1e-12)
    assert np.allclose(record["thickness"].values[:, 399], peer["thickness[400]"], rtol=1e-12)
    assert record["thickness"].sizes == {"time": 7, "value_400": 400}
    assert record["thickness"].attrs["units"] == "m"
    # the file that the unit itself writes holds the same field
    with xr.open_dataset(tmp_path / "forming" / "forming.nc") as forming:
        last = forming["thickness"].isel(time=-1).values
    assert np.array_equal(record["thickness"].values[-1], last)


def test_a_resumed_forming_is_bit_identical(unit, tmp_path, monkeypatch):
    """The state of the unit goes through the checkpoint's file into a new instance."""
    system = system_from(
        {
            "stop_time": f"{STOP!r} s",
            "window": f"{STEP!r} s",
            "units": [{"name": "dome", "fmu": unit.name}],
        },
        None,
        directory=unit.parent,
    )
    run_system(system, tmp_path / "whole")
    looks = iter(range(100))

    class StopAfterThree:
        def is_set(self):
            return next(looks) >= 6  # looked at twice in a window

    @contextmanager
    def stopping():
        yield StopAfterThree()

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "stop_requests", stopping)
        with pytest.raises(SimulationInterrupted):
            run_system(system, tmp_path / "parts")
    run_system(system, tmp_path / "parts", resume=True)
    whole, parts = (
        xr.load_dataset(tmp_path / name / "cosimulation.nc", group="dome")
        for name in ("whole", "parts")
    )
    assert np.ptp(whole["thickness"].values[-1]) > 1e-6
    for name in whole:
        assert np.array_equal(whole[name].values, parts[name].values), name


@pytest.mark.parametrize("version", [2, 3])
def test_a_step_that_the_unit_refuses_is_told_with_its_words(version, unit, unit3, tmp_path):
    """pythonfmu says after every refused step that the simulation should end; it is none."""
    file = unit if version == 2 else unit3
    start = {"punch.drive": True, "punch.velocity_input": "400 m/s"}
    system = system_from(
        {
            "stop_time": f"{STOP!r} s",
            "window": f"{STEP!r} s",
            "units": [{"name": "dome", "fmu": file.name, "start": start}],
        },
        None,
        directory=file.parent,
    )
    with pytest.raises(SimulationError) as caught:
        run_system(system, tmp_path / "out")
    told = str(caught.value)
    assert told.startswith('coupled part "dome" failed at 0 s, step 0.0005 s: it refused the step')
    assert "was stopped and undone" in told and "punch.velocity_input = 400.0" in told
    assert "asked for the end" not in told
