"""Build the units of press and dome, simulate them together, and check what the README says.

python examples/cosimulation/run.py [DIR]
"""

from __future__ import annotations

import sys
from pathlib import Path

import xarray as xr
from pythonfmu import FmuBuilder

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import read_system
from lcmchain.fmu.build import build_fmu

HERE = Path(__file__).parent
LIMIT = 4.0  # N, as in system.toml
#: Settings of the three runs beside those of system.toml.
RUNS = {
    "limited": [],
    "free": ['units.press.start.force_limit="1 kN"'],
    # contact opens and closes, so that the force at an instant is not smooth in the velocity
    "implicit": [
        "scheme.type=iqn-ils",
        'connections[0]={link = "dome.punch.force -> press.part_force", absolute = 0.1}',
        'connections[1]={link = "press.velocity -> dome.punch.velocity_input", absolute = 1e-3}',
    ],
}


def build_units() -> None:
    """Write Press.fmu and dome.fmu beside this file."""
    FmuBuilder.build_FMU(
        HERE / "press.py", dest=HERE, needsExecutionTool="false",
        canGetAndSetFMUstate="true", canSerializeFMUstate="true",
    )  # fmt: skip
    build_fmu(HERE / "dome.toml", HERE / "dome.fmu")


def main(out: Path) -> None:
    """Run, print and check."""
    build_units()
    records = {}
    print(f"{'run':10} {'force [N]':>10} {'travel [mm]':>12} {'velocity at the end [mm/s]':>27}")
    for name, settings in RUNS.items():
        run_system(read_system(HERE / "system.toml", settings), out / name)
        press, dome = (
            xr.load_dataset(out / name / "cosimulation.nc", group=unit)
            for unit in ("press", "dome")
        )
        records[name] = (
            float(press["force"].max()),
            1e3 * float(dome["punch_travel"][-1]),
            1e3 * float(press["velocity"][-1]),
        )
        print("{:10} {:10.2f} {:12.2f} {:27.1f}".format(name, *records[name]))
    force, travel, velocity = records["limited"]
    assert 0.9 * LIMIT < force < 1.05 * LIMIT, "the press must keep its limit, and come to it"
    assert 0.0 < velocity < 60.0, "before the limit the ram has slowed from 500 mm/s"
    free_force, free_travel, _ = records["free"]
    assert free_force > 1.5 * LIMIT and free_travel > travel + 2.0, "without it, it goes on"
    assert abs(records["implicit"][0] - force) < 0.05 * LIMIT, "both schemes agree"
    print("The press keeps its limit.")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("results/cosimulation"))
