"""A stack of plies and its resin as two units: columns for cells, and saved states."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from fmpy import extract, read_model_description
from sheet_and_resin import as_units, in_one_process

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.solids.stack import StackForming
from lcmchain.coupling.wet_forming.sheet import blank_of_scene
from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.forming.variables import variables_of
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.fmu.mesh_fields import read_mesh_fields
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.solver.simulation import Simulation

STEP, STOP = 1e-4, 8e-4
SCENE = """
process = { time = "10 ms", mass_damping = "200 1/s" }
material = { preset = "MD600" }
contact = { friction = 0.0, penalty = "40 MPa/mm" }
permeability = { law = "constant", k1 = "1e-10 m^2", k2 = "1e-10 m^2", k3 = "1e-11 m^2" }
[[plies]]
name = "long"
size = ["60 mm", "10 mm"]
edge_length = "5 mm"
[[plies]]
name = "short"
size = ["40 mm", "10 mm"]
edge_length = "5 mm"
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
position = "0 0 -0.502 mm"
[[tools]]
name = "press"
shape = { type = "plate", side = "above" }
position = "0 0 1.506 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm", profile = "linear" }
[infiltration]
time = "10 ms"
resin = { law = "constant", viscosity = "1 mPa*s", density = "1100 kg/m^3" }
with_forming = {}
[[infiltration.wetted]]
name = "all"
box = ["-21 -10 -5 mm", "21 10 5 mm"]
[[infiltration.vents]]
name = "left"
box = ["-21 -10 -5 mm", "-19 10 5 mm"]
bleeds = true
[[infiltration.vents]]
name = "right"
box = ["19 -10 -5 mm", "21 10 5 mm"]
bleeds = true
"""
COLUMNS = 12 * 2


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("wet_stack") / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def sheet_unit(scene_file):
    return build_fmu(scene_file, scene_file.parent / "sheet.fmu", fmi=3)


def test_a_fluid_exchanges_the_columns_of_a_stack(scene_file):
    """As many as the largest ply has elements; other fields keep their sizes."""
    sizes = {v.name: v.size for v in variables_of(read_scene(scene_file), pore_pressure=True)}
    for name in ("pore_pressure", "volume", "pore_resistance", "fluid_thickness"):
        assert sizes[name] == COLUMNS
    assert sizes["short.thickness"] == 8 * 2 and sizes["stack_thickness"] == COLUMNS + 16


def test_columns_lie_on_the_faces_of_the_largest_ply(sheet_unit):
    placed = read_mesh_fields(sheet_unit)
    pressure = placed.on_faces("pore_pressure", np.arange(COLUMNS))
    own = placed.on_faces("long.thickness", np.arange(COLUMNS))
    np.testing.assert_array_equal(pressure, own)
    assert np.isfinite(own).sum() == COLUMNS < len(own)


def test_units_give_the_result_of_the_process(scene_file, sheet_unit):
    """Both sides of a stack from one scene, coupled by the master and within one process."""
    folder, scene = scene_file.parent, read_scene(scene_file)
    stack = StackForming(Simulation.from_scene(scene), unlike=True)
    resin = FillingPart(set_up(blank_of_scene(scene), scene.wet_forming).filling())
    in_one_process(stack, resin, STEP, STOP)
    build_infiltration_fmu(
        None, scene_file, folder / "resin.fmu", fmi=3, options=InfiltrationUnit(motion="volume")
    )
    as_units(folder, folder / "out", STEP, STOP)
    with xr.open_dataset(folder / "out" / "cosimulation.nc", group="resin") as record:
        pressure = record["pore_pressure"].values[-1]
    with xr.open_dataset(folder / "out" / "cosimulation.nc", group="sheet") as record:
        thickness = record["fluid_thickness"].values[-1]
    wanted = resin.get_fields(["pore_pressure"])["pore_pressure"]
    assert wanted.max() > 5e3
    np.testing.assert_allclose(pressure, wanted, rtol=1e-7, atol=1e-6 * wanted.max())
    wanted = stack.get_fields(["thickness"])["thickness"]
    assert wanted.max() > 1.9 * wanted.min()  # where there are two plies, and one
    np.testing.assert_allclose(thickness, wanted, rtol=1e-8)


def test_a_saved_state_goes_on_to_the_same_bits(sheet_unit, tmp_path):
    """Outputs of the last step come back too, which belong to the columns that it began with."""
    from lcmchain.fmu.conduct import Status
    from lcmchain.fmu.instances import open_unit
    from lcmchain.fmu.part import SavedState

    folder = extract(str(sheet_unit), unzipdir=str(tmp_path))
    unit = open_unit(f"{folder}/resources", "one", lambda *_: None, arrays=True)
    unit.set_up(0.0)
    unit.enter_initialization()
    unit.exit_initialization()
    part = unit.part

    def step(number):
        slide = np.zeros(part.values.field("pore_pressure").size)
        slide[:] = 2e4 * (number + 1.0)
        part.values.field("pore_pressure")[:] = slide
        assert unit.step(number * STEP, STEP) is Status.OK
        return unit.save().to_bytes()

    def told():
        return {name: np.array(value) for name, value in part.wet.get_fields(
            ["volume", "thickness", "area", "volume_rate"]).items()}  # fmt: skip

    for number in range(3):
        before = step(number)
    outputs = told()
    # plies that slide change the columns, so that those of the last step are not those of now
    after = [step(3), step(4)]
    changed = part.simulation.state.position
    changed[0, part.simulation.model.bodies[1].first_node :] += 1e-3
    part.wet.renew()
    assert unit.restore(SavedState.from_bytes(before)) is Status.OK
    for name, value in told().items():
        np.testing.assert_array_equal(value, outputs[name], name)
    assert [step(3), step(4)] == after
    assert read_model_description(str(sheet_unit)).modelName == "sheet"


def test_a_film_lets_no_fluid_through():
    foil = """
[materials.foil]
law = "neo-hooke"
shear_modulus = "0.4 MPa"
thickness = "1 mm"
density = "1100 kg/m^3"
"""
    text = SCENE[: SCENE.index("[infiltration]")].replace("permeability = ", "#")
    text = text.replace('name = "short"', 'name = "short"\nmaterial = "foil"\nfilm = true') + foil
    with pytest.raises(InputError, match="film: lets a fluid act.*through which none flows"):
        variables_of(scene_from_text(text), pore_pressure=True)
