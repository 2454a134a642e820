"""The unit in the project's own master: as in fmpy, and as the direct run."""

import fmpy
import numpy as np
import xarray as xr

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import system_from

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
