"""A sheet and its resin as two units in the project's master, and as two objects in one process."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest
import xarray as xr
from fmpy import read_model_description
from sheet_and_resin import as_units, in_one_process

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.solids.explicit import ExplicitForming
from lcmchain.fields import write_forming_netcdf
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.scene import read_infiltration, read_scene
from lcmchain.solver.simulation import Simulation

STEP, STOP = 1e-4, 1.5e-3
SCENE = """
process = { time = "10 ms", mass_damping = "200 1/s" }
blank = { size = ["40 mm", "10 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
contact = { friction = 0.0 }
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
position = "0 0 -0.502 mm"
[[tools]]
name = "press"
shape = { type = "plate", side = "above" }
position = "0 0 0.502 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm", profile = "linear" }
"""
CASE = """
time = "10 ms"
resin = { law = "constant", viscosity = "1 mPa*s" }
permeability = { law = "constant", k1 = "1e-11 m^2", k2 = "1e-11 m^2", k3 = "1e-12 m^2" }
[[wetted]]
name = "all"
box = ["-30 -10 -5 mm", "30 10 5 mm"]
[[vents]]
name = "ends"
rim = true
bleeds = true
"""


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    (folder / "scene.toml").write_text(SCENE)
    (folder / "case.toml").write_text(CASE)
    scene = read_scene(folder / "scene.toml")
    simulation = Simulation.from_scene(scene)
    start = forming_datasets(scene, simulation, [simulation.snapshot()])
    write_forming_netcdf(folder / "blank.nc", start)
    return folder


@pytest.fixture(scope="module")
def in_process(sources):
    """Return sheet and resin after the same windows, by the same scheme."""
    sheet = ExplicitForming.from_scene(read_scene(sources / "scene.toml"))
    case = read_infiltration(sources / "case.toml")
    resin = FillingPart(set_up(read_formed_part(sources / "blank.nc"), case).filling())
    return sheet, resin, in_one_process(sheet, resin, STEP, STOP)


@pytest.mark.parametrize("fmi", [2, 3])
def test_units_give_the_result_of_the_process(sources, in_process, tmp_path, fmi):
    sheet, resin, coupled = in_process
    build_fmu(sources / "scene.toml", tmp_path / "sheet.fmu", fmi=fmi, pore_pressure=True)
    build_infiltration_fmu(
        sources / "blank.nc", sources / "case.toml", tmp_path / "resin.fmu", fmi=fmi,
        options=InfiltrationUnit(motion="volume"),
    )  # fmt: skip
    summary = as_units(tmp_path, tmp_path / "out", STEP, STOP)
    assert summary["window_count"] == len(coupled.history.accepted)
    with xr.open_dataset(tmp_path / "out" / "cosimulation.nc", group="resin") as record:
        pressure = record["pore_pressure"].values[-1]
    with xr.open_dataset(tmp_path / "out" / "cosimulation.nc", group="sheet") as record:
        thickness = record["fluid_thickness"].values[-1]
        force = float(record["press_force"].values[-1])
    wanted = resin.get_fields(["pore_pressure"])["pore_pressure"]
    assert wanted.max() > 1e3
    np.testing.assert_allclose(pressure, wanted, rtol=1e-8)
    wanted = sheet.get_fields(["thickness"])["thickness"]
    np.testing.assert_allclose(thickness, wanted, rtol=1e-8)
    tools = sheet.simulation.model.tools
    wanted = sheet.simulation.state.tool_force[1] @ tools.direction[1]
    assert abs(force) == pytest.approx(abs(wanted), rel=1e-8)


@pytest.mark.parametrize("around", [0.0, 1e5])
def test_the_sheet_is_surrounded_by_the_pressure_of_the_vents(sources, tmp_path, around):
    """In absolute pressures 1 bar in the pores loads nothing, as in the process."""
    wet = f"""
[permeability]
law = "constant"
k1 = "1e-11 m^2"
k2 = "1e-11 m^2"
k3 = "1e-12 m^2"
[infiltration]
time = "10 s"
vent_pressure = "{around:g} Pa"
resin = {{ law = "constant", viscosity = "0.02 Pa*s" }}
film = {{ thickness = "0.5 mm", pressure = "{around + 100.0:g} Pa" }}
with_forming = {{ }}
[[infiltration.vents]]
name = "rim"
rim = true
"""
    (tmp_path / "wet.toml").write_text(SCENE + wet)
    path = build_fmu(tmp_path / "wet.toml", tmp_path / "wet.fmu", fmi=3)
    variables = {v.name: v for v in read_model_description(str(path)).modelVariables}
    start = np.array(variables["pore_pressure"].start.split(), dtype=float)
    assert set(start) == {around}
    assert variables["pore_pressure"].description.endswith(f"surroundings at {around:g}")
    result = fmpy.simulate_fmu(
        str(path), stop_time=STEP, output_interval=STEP, output=["internal_energy", "thickness_min"]
    )
    # beside what the press does in this time
    assert result["thickness_min"][-1] == pytest.approx(1.004e-3, rel=2e-3)
