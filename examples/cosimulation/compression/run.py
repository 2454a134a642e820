"""Compression of a saturated strip by two units, against the same coupling in one process.

    python examples/cosimulation/compression/run.py

builds both units, simulates them in the project's master, runs the scene in one process, and checks
that both agree with each other and with squeeze flow, p = mu h' L² / (2 K h).
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import xarray as xr

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import read_system
from lcmchain.coupling.wet_forming.wet_forming import WetForming
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.scene import read_scene
from lcmchain.solver.simulation import Simulation

HERE = Path(__file__).parent
TIME = 6e-3  # [s]


def main() -> None:
    """Simulate both ways, and compare."""
    scene = HERE / "scene.toml"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build_fmu(scene, folder / "sheet.fmu", fmi=3)
        build_infiltration_fmu(
            None, scene, folder / "resin.fmu", fmi=3, options=InfiltrationUnit(motion="volume")
        )
        shutil.copy(HERE / "system.toml", folder)
        summary = run_system(read_system(folder / "system.toml"), folder / "out")
        record = folder / "out" / "cosimulation.nc"
        with xr.open_dataset(record, group="resin") as resin:
            pressure = float(resin["pressure_max"].values[-1])
        with xr.open_dataset(record, group="sheet") as sheet:
            force = abs(float(sheet["press_force"].values[-1]))

    wet = WetForming(read_scene(scene), Simulation.from_scene(read_scene(scene)))
    wet.advance_to(TIME)
    wanted, own = wet.filling.pressure.max(), wet.force()[0]
    thickness = wet.filling.state.thickness.mean()
    # the plates close at 10 mm/s; their surfaces give way to the pressure, which still rises
    speed = -wet.forming.get_fields(["thickness_rate"])["thickness_rate"].mean()
    squeeze = 1e-3 * speed * 0.05**2 / (2.0 * 1e-10 * thickness)
    count = summary["window_count"]
    print(f"two units:   {force:.3f} N, {1e-3 * pressure:.3f} kPa; {count} windows")
    print(f"one process: {own:.3f} N, {1e-3 * wanted:.3f} kPa")
    print(f"squeeze flow:           {1e-3 * squeeze:.3f} kPa")
    assert abs(pressure / wanted - 1.0) < 0.005 and abs(force / own - 1.0) < 0.005
    assert abs(pressure / squeeze - 1.0) < 0.01


if __name__ == "__main__":
    main()
