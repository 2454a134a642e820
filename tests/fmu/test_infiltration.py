"""The infiltration unit: equal to the direct filling, moved from outside, and never at a loss."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
import xarray as xr
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.flow.boundaries import Gate
from lcmchain.coupling.infiltration.flow.motion import FULL
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import FillOptions, fill_part
from lcmchain.errors import InputError
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.fmu.infiltration.variables import FRONT
from lcmchain.mapping.interface import read_interface
from lcmchain.scene import read_infiltration

_spec = importlib.util.spec_from_file_location(
    "fillings", Path(__file__).parents[1] / "coupling" / "infiltration_stage" / "conftest.py"
)
fillings = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(fillings)

STEP = 8.0  # exact in binary, so that sums of steps are too
CASE = (
    fillings.HEAD.replace("frames = 6", 'frame_interval = "16 s"').replace("500 s", "64 s")
    + fillings.GATE
    + fillings.VENT
)
QUICK = CASE.replace("0.1 Pa*s", "0.01 Pa*s")  # all is filled long before the end
RATE_GATE = fillings.GATE.replace('pressure = "1 bar"', 'flow_rate = "50 mm^3/s"')


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Build a unit of the strip by its options, once each; the source is gone afterwards."""
    units = {}

    def make(fmi=3, case=CASE, **options):
        key = fmi, case, repr(options)
        if key not in units:
            folder = tmp_path_factory.mktemp("unit")
            sources = folder / "sources"
            sources.mkdir()
            forming = fillings.write_forming(sources / "forming.nc", *fillings.strip())
            (sources / "case.toml").write_text(case)
            units[key] = build_infiltration_fmu(
                forming, sources / "case.toml", folder / "strip.fmu", fmi=fmi,
                options=InfiltrationUnit(**options),
            )  # fmt: skip
            shutil.rmtree(sources)
        return units[key]

    return make


@pytest.fixture
def kit(tmp_path):
    """The direct filling of the same part: ``setup(case)``."""
    forming = fillings.write_forming(tmp_path / "forming.nc", *fillings.strip())

    class Kit:
        source = forming

        @staticmethod
        def case(text=CASE):
            (tmp_path / "case.toml").write_text(text)
            return read_infiltration(tmp_path / "case.toml")

        @classmethod
        def setup(cls, text=CASE):
            return set_up(read_formed_part(forming), cls.case(text))

    return Kit


class Master:
    """An instance of a unit of FMI 3.0, with fields by name."""

    def __init__(self, unit, folder, **settings):
        self.folder = Path(fmpy.extract(str(unit), unzipdir=str(folder)))
        description = fmpy.read_model_description(str(self.folder))
        self.variables = {v.name: v for v in description.modelVariables}
        self.slave = FMU3Slave(
            guid=description.guid, unzipDirectory=str(self.folder), instanceName="strip",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.slave.instantiate()
        self.slave.enterInitializationMode()
        for name, value in settings.items():
            self.slave.setString([self.variables[name].valueReference], [value])
        self.slave.exitInitializationMode()
        self.time = 0.0

    def size(self, name):
        dimensions = self.variables[name].dimensions
        return int(np.prod([int(d.start) for d in dimensions])) if dimensions else 1

    def set(self, **inputs):
        for name, value in inputs.items():
            own = name.replace("__", ".")
            reference = [self.variables[own].valueReference]
            if isinstance(value, bool):
                self.slave.setBoolean(reference, [value])
            else:
                values = np.broadcast_to(np.asarray(value, dtype=float), self.size(own))
                self.slave.setFloat64(reference, values.tolist())

    def get(self, name):
        reference = [self.variables[name].valueReference]
        if self.variables[name].type == "Int32":
            return self.slave.getInt32(reference)[0]
        if self.variables[name].type == "Enumeration":
            return self.slave.getInt64(reference)[0]
        if self.variables[name].type == "String":
            return self.slave.getString(reference)[0]
        values = np.array(self.slave.getFloat64(reference, self.size(name)))
        return values if self.variables[name].dimensions else values[0]

    def step(self, size=STEP):
        self.slave.doStep(self.time, size)
        self.time += size

    def all(self):
        return {n: self.get(n) for n, v in self.variables.items() if v.causality == "output"}


@pytest.fixture
def master(made, tmp_path):
    """Make an instance of a unit; it is freed after the test."""
    masters = []

    def make(settings=None, **options):
        folder = tmp_path / f"unpacked {len(masters)}"
        masters.append(Master(made(**options), folder, **(settings or {})))
        return masters[-1]

    yield make
    for one in masters:
        one.slave.freeInstance()


def same(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], err_msg=name)


# --- the unit and the direct filling --------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("motion", ["none", "thickness", "volume"])
def test_fmpy_finds_no_problem(made, fmi, motion):
    unit = made(fmi=fmi, motion=motion)
    assert validate_fmu(str(unit)) == []
    description = fmpy.read_model_description(str(unit))
    inputs = {v.name.partition("[")[0] for v in description.modelVariables
              if v.causality == "input" and "." not in v.name}  # fmt: skip
    assert inputs == {
        "none": set(),
        "thickness": {"thickness", "thickness_rate"},
        "volume": {"volume_rate", "volume_rate_slope", "reference_pressure", "pore_resistance"},
    }[motion]  # fmt: skip
    assert float(description.defaultExperiment.stopTime) == 64.0
    front = next(v for v in description.modelVariables if v.name == "front_state")
    assert front.type == "Enumeration"
    told = {item.name: int(item.value) for item in front.declaredType.items}
    assert list(told.values()) == list(FRONT.values()) and told["filled"] == FRONT["filled"]


@pytest.mark.parametrize("fmi, case", [(2, CASE), (3, CASE), (3, QUICK)])
def test_result_is_that_of_the_command_to_the_last_bit(made, kit, tmp_path, fmi, case):
    """Every group and field; fmpy drives the unit, ``lcmchain fill`` goes its own way."""
    fmpy.simulate_fmu(
        str(made(fmi=fmi, case=case)), stop_time=64.0, output_interval=16.0,
        start_values={"out_dir": str(tmp_path / "unit")}, output=["fill_fraction"],
    )  # fmt: skip
    options = FillOptions(picture=False, vtu=False)
    fill_part(
        kit.source, kit.case(case), name="infiltration", out_dir=tmp_path / "run", options=options
    )
    (found,) = (tmp_path / "unit").iterdir()
    with xr.open_datatree(found) as unit, xr.open_datatree(tmp_path / "run" / found.name) as run:
        assert unit.groups == run.groups
        for group in run.groups:
            of_unit, of_run = unit[group].to_dataset(), run[group].to_dataset()
            assert set(of_unit.variables) == set(of_run.variables)
            for name in of_run.variables:
                np.testing.assert_array_equal(of_unit[name], of_run[name], err_msg=name)
                assert str(of_unit[name].attrs) == str(of_run[name].attrs), name
        assert unit.attrs.keys() == run.attrs.keys()
        differing = {key for key in run.attrs if str(unit.attrs[key]) != str(run.attrs[key])}
        assert differing <= {"history"}
        assert run["history"]["filled_share"][-1] > 0.4


def test_a_result_has_every_step_and_the_last_state_wherever_a_master_ends(master, tmp_path):
    """Also where no state of the case is due within the steps of the master."""
    unit = master({"out_dir": str(tmp_path / "unit")}, motion="none")
    for _ in range(3):
        unit.step(5.0)
    unit.slave.terminate()
    (found,) = (tmp_path / "unit").iterdir()
    with xr.open_datatree(found) as result:
        np.testing.assert_array_equal(result["time"], [0.0, 15.0])
        history = result["history"].to_dataset()
        times = history["history_time"]
        assert np.isin([0.0, 5.0, 10.0, 15.0], times).all() and np.all(np.diff(times) > 0.0)


def test_outputs_are_those_of_the_direct_filling(master, kit):
    unit = master(motion="none")
    filling = kit.setup().filling()
    gate = "left"
    for _ in range(5):
        unit.step()
        filling.advance(unit.time)
        state = filling.state
        assert unit.get("fill_fraction") == filling.filled_share
        assert unit.get(f"{gate}.flow_rate") == state.gate_rate[0]
        assert unit.get(f"{gate}.pressure") == state.gate_pressure[0] == 1e5
        assert unit.get(f"{gate}.injected_volume") == state.injected[0]
        assert unit.get("injected_volume") == state.injected.sum()
        assert unit.get("stored_volume") == state.stored
        assert unit.get("pressure_max") == filling.pressure.max()
        assert unit.get("step_count") == state.step_count
        pressure = FillingPart(kit.setup().filling())
        pressure.restore(FillingPart(filling).save())
        np.testing.assert_array_equal(unit.get("pore_pressure"), pressure.present_pressure())
        fill = unit.get("fill_factor")
        np.testing.assert_allclose(
            fill @ filling.mesh.areas, state.fill @ nodal(filling), rtol=1e-12
        )
    force = unit.get("pressure_force")
    assert force == pytest.approx(unit.get("pore_pressure") @ filling.mesh.areas, rel=1e-12)
    assert 0.3 < unit.get("fill_fraction") < 1.0 and unit.get("front") == 0


THREE_GATES = (
    fillings.HEAD.replace("frames = 6", 'frame_interval = "1 s"').replace("500 s", "8 s")
    + fillings.GATE
    + '[[gates]]\nname = "round"\npoint = "150 20 0 mm"\nradius = "18 mm"\npressure = "3 bar"\n'
    + '[[gates]]\nname = "one_node"\npoint = "225 20 0 mm"\npressure = "2 bar"\n'
    + fillings.VENT
)


def test_pressures_of_unit_part_and_results_are_one(master, kit, tmp_path):
    """At an edge, in one node and in a hole so large that its nodes' own pressure lies above it.

    Also where a node has filled in the time step that the results were saved after.
    """
    unit, filling = master(motion="none", case=THREE_GATES), kit.setup(THREE_GATES).filling()
    options = FillOptions(picture=False, vtu=False)
    fill_part(kit.source, kit.case(THREE_GATES), name="a", out_dir=tmp_path, options=options)
    with xr.open_datatree(tmp_path / "a_filling.nc") as found:
        time, results = found["time"].values, found["resin_pressure"].values
        full = found["fill_factor"].values >= FULL
        history = found["history"].to_dataset().load()
    areas, cells, above, new = filling.medium.network.corner_areas, filling.mesh.cells, 0.0, 0
    assert len(time) == 9
    for number in range(1, len(time)):
        unit.step(1.0)
        filling.advance(unit.time)
        assert time[number] == unit.time
        np.testing.assert_allclose(filling.pressure, results[number], rtol=1e-12)
        assert unit.get("pressure_max") == pytest.approx(results[number].max(), rel=1e-12)
        sample = history.isel(history_time=np.flatnonzero(history["history_time"] == unit.time)[-1])
        for place, name in enumerate(("left", "round", "one_node")):
            told = unit.get(f"{name}.pressure"), unit.get(f"{name}.flow_rate")
            kept = sample["gate_pressure"].values[place], sample["gate_flow_rate"].values[place]
            np.testing.assert_allclose(told, np.nan_to_num(kept), rtol=1e-12)
        resin = np.where(full[number], results[number], 0.0)  # of the air where none is
        mean = (areas * resin[cells]).sum(axis=1) / areas.sum(axis=1)
        np.testing.assert_allclose(unit.get("pore_pressure"), mean, rtol=1e-12)
        np.testing.assert_allclose(FillingPart(filling).present_pressure(), mean, rtol=1e-12)
        assert unit.get("pressure_force") == pytest.approx(mean @ filling.mesh.areas, rel=1e-12)
        above = max(above, filling.state.pressure.max())
        new += np.count_nonzero(full[number] & ~full[number - 1])
    assert results.max() <= 3e5 * (1.0 + 1e-12) and above > 3.02e5 and new > 20


def nodal(filling):
    """Area of the mesh that belongs to each node."""
    network = filling.medium.network
    return network.corner_sum(network.corner_areas)


def test_front_tells_when_all_is_filled_and_time_goes_on(master):
    unit = master(motion="none")
    unit.step(400.0)
    assert unit.get("front") == unit.get("front_state") == 1
    assert unit.get("fill_fraction") == pytest.approx(1.0, rel=1e-9)
    unit.step(100.0)
    assert unit.get("time") == 500.0
    assert abs(unit.get("balance_error")) < 1e-12 * unit.get("stored_volume")


# --- a preform that moves -------------------------------------------------------------------------


def rates_of(count, step):
    chance = np.random.default_rng(step)
    return {
        "volume_rate": chance.uniform(-2e-10, 1e-11, count),
        "volume_rate_slope": chance.uniform(0.0, 1e-16, count),
        "reference_pressure": chance.uniform(0.0, 1e4, count),
    }


def test_volume_rates_act_as_on_the_part_in_process(master, kit):
    unit = master(motion="volume")
    fluid = FillingPart(kit.setup().filling())
    count = fluid.filling.mesh.cell_count
    for step in range(4):
        rates = rates_of(count, step)
        unit.set(**rates)
        fluid.set_fields(rates)
        unit.step()
        fluid.advance(STEP)
        found = fluid.get_fields(["pore_pressure", "thickness", "volume"])
        np.testing.assert_array_equal(unit.get("pore_pressure"), found["pore_pressure"])
        np.testing.assert_array_equal(unit.get("preform_thickness"), found["thickness"])
        np.testing.assert_array_equal(unit.get("preform_volume"), found["volume"])
    assert np.ptp(found["thickness"]) > 1e-6


def test_thickness_is_reached_at_the_end_of_a_step_and_pushes_the_resin(master, kit):
    unit = master(motion="thickness")
    unit.step()
    before, areas = unit.get("preform_thickness"), kit.setup().mesh.areas
    wanted = before * np.linspace(0.98, 0.95, len(before))
    unit.set(thickness=wanted)
    stored, entered = unit.get("stored_volume"), unit.get("injected_volume")
    unit.step()
    np.testing.assert_allclose(unit.get("preform_thickness"), wanted, rtol=1e-12)
    unit.step()  # held: it stays
    np.testing.assert_allclose(unit.get("preform_thickness"), wanted, rtol=1e-12)
    gained = unit.get("stored_volume") - stored
    assert gained == pytest.approx(unit.get("injected_volume") - entered, rel=1e-9)
    unit.set(thickness=0.0, thickness_rate=-1e-6)
    unit.step()
    np.testing.assert_allclose(unit.get("preform_thickness"), wanted - 1e-6 * STEP, rtol=1e-12)
    volume = unit.get("preform_volume").sum()
    assert volume == pytest.approx((wanted - 1e-6 * STEP) @ areas, rel=1e-12)


@pytest.mark.parametrize("motion", ["thickness", "volume"])
def test_coarse_interface_conserves_what_it_carries(master, kit, motion):
    unit = master(motion=motion, interface=7)
    fields = read_interface(unit.folder / "resources" / "interface.nc").fields
    fluid = FillingPart(kit.setup().filling())
    assert unit.size("pore_pressure") == 7 == fields.patches.count
    start = unit.get("preform_volume")
    np.testing.assert_allclose(start, fields.total(fluid.get_fields(["volume"])["volume"]))
    rate = -np.linspace(1.0, 2.0, 7) * 1e-9
    if motion == "volume":
        unit.set(volume_rate=rate)
        fluid.set_fields({"volume_rate": fields.shared(rate)})
    else:
        thickness_rate = rate / fields.patch_areas
        unit.set(thickness_rate=thickness_rate)
    for _ in range(3):
        unit.step()
        fluid.advance(STEP)
    np.testing.assert_allclose(unit.get("preform_volume"), start + 3 * STEP * rate, rtol=1e-12)
    if motion == "volume":
        found = fluid.get_fields(["pore_pressure"])["pore_pressure"]
        np.testing.assert_array_equal(unit.get("pore_pressure"), fields.mean(found))
    else:
        wanted = unit.get("preform_thickness") * 0.97
        unit.set(thickness=wanted)
        unit.step()
        np.testing.assert_allclose(unit.get("preform_thickness"), wanted, rtol=1e-12)


def test_thickness_that_leaves_no_room_for_resin_is_undone(master):
    unit = master(motion="thickness")
    unit.step()
    before = unit.all()
    unit.set(thickness=0.9e-3)  # of 2 mm, half of it fibres
    with pytest.raises(FMICallException):
        unit.step()
    assert unit.get("status") == unit.get("step_outcome") == 1
    assert "stopped and undone" in unit.get("message") and "thickness = 0.0009" in unit.get(
        "message"
    )
    after = unit.all()
    for name in ("status", "step_outcome", "message"):
        before.pop(name), after.pop(name)
    same(before, after)
    unit.set(thickness=0.0)
    unit.step()
    assert unit.get("status") == 0 and unit.get("message") == ""


# --- gates and vents ------------------------------------------------------------------------------


def direct(kit, *gates, case=CASE):
    """A filling whose gates are set anew for every step: the filled shares after each."""
    setup = kit.setup(case)
    filling = setup.filling()
    shares = []
    for number, change in enumerate(gates, start=1):
        filling.set_supply([change(setup.gates[0])], setup.vents)
        filling.advance(number * STEP)
        shares.append(filling.filled_share)
    return shares


def test_driven_gates_follow_their_inputs(master, kit):
    def at(pressure):
        return lambda gate: Gate(gate.name, gate.nodes, pressure)

    unit = master(motion="none")
    shares = []
    for pressure in (2e5, 0.5e5):
        unit.set(left__drive=True, left__pressure_input=pressure)
        unit.step()
        assert unit.get("left.pressure") == pressure
        shares.append(unit.get("fill_fraction"))
    unit.set(left__closed=True)
    unit.step()
    assert unit.get("left.flow_rate") == 0.0 and unit.get("fill_fraction") == shares[-1]
    assert unit.get("front") == 3
    unit.set(left__closed=False, left__drive=False)
    unit.step()
    assert unit.get("left.pressure") == 1e5 and unit.get("fill_fraction") > shares[-1]
    assert shares == direct(kit, at(2e5), at(0.5e5))
    # the front of a constant pressure goes with the root of pressure and time
    assert shares[0] == pytest.approx(np.sqrt(2e5 * STEP / (1e5 * fillings.FILL_TIME)), rel=0.02)


def test_driven_flow_rates_inject_what_they_say(master):
    case = CASE.replace(fillings.GATE, RATE_GATE)
    unit = master(motion="none", case=case)
    assert "left.pressure_input" not in unit.variables
    unit.step()
    assert unit.get("injected_volume") == pytest.approx(50e-9 * STEP, rel=1e-9)
    unit.set(left__drive=True, left__flow_rate_input=20e-9)
    unit.step()
    assert unit.get("injected_volume") == pytest.approx(70e-9 * STEP, rel=1e-9)
    unit.set(left__flow_rate_input=-1e-9)
    with pytest.raises(FMICallException):
        unit.step()
    assert "negative" in unit.get("message")
    unit.set(left__flow_rate_input=0.0)
    unit.step()
    assert unit.get("injected_volume") == pytest.approx(70e-9 * STEP, rel=1e-9)


# --- rollback -------------------------------------------------------------------------------------


def drive(unit, steps):
    """Steps in which everything changes."""
    for step in steps:
        unit.set(left__drive=step % 2 == 0, left__pressure_input=1.5e5, **rates_of(36, step))
        unit.step()


def test_going_on_from_a_saved_state_is_bit_identical(master, tmp_path):
    out = {"out_dir": str(tmp_path / "once")}
    unit = master(settings=out, motion="volume")
    drive(unit, range(2))
    saved, at = unit.slave.getFMUState(), unit.time
    drive(unit, range(2, 7))
    once = unit.all()
    for _ in range(2):
        unit.slave.setFMUState(saved)
        unit.time = at
        drive(unit, range(2, 7))
        same(once, unit.all())
    unit.slave.terminate()
    plain = master(settings={"out_dir": str(tmp_path / "plain")}, motion="volume")
    drive(plain, range(7))
    same(once, plain.all())
    plain.slave.terminate()
    name = "infiltration_filling.nc"
    with (
        xr.open_datatree(tmp_path / "once" / name) as one,
        xr.open_datatree(tmp_path / "plain" / name) as other,
    ):
        for group in one.groups:
            xr.testing.assert_equal(one[group].to_dataset(), other[group].to_dataset())
        assert "pressed_thickness" in one


ELSEWHERE = """
import importlib.util, sys
import numpy as np
spec = importlib.util.spec_from_file_location("there", sys.argv[1])
there = importlib.util.module_from_spec(spec); spec.loader.exec_module(there)
unit = there.Master(sys.argv[2], sys.argv[3])
state = unit.slave.deserializeFMUState(open(sys.argv[4], "rb").read())
unit.slave.setFMUState(state)
unit.time = float(sys.argv[5])
there.drive(unit, range(2, 5))
np.savez(sys.argv[6], **unit.all())
"""


def test_a_state_goes_on_in_another_process_to_the_last_bit(master, made, tmp_path):
    unit = master(motion="volume")
    drive(unit, range(2))
    content = unit.slave.serializeFMUState(unit.slave.getFMUState())
    (tmp_path / "state").write_bytes(content)
    at = unit.time
    drive(unit, range(2, 5))
    arguments = [
        __file__, made(motion="volume"), tmp_path / "elsewhere", tmp_path / "state", at,
        tmp_path / "found.npz",
    ]  # fmt: skip
    subprocess.run([sys.executable, "-P", "-c", ELSEWHERE, *map(str, arguments)], check=True)
    with np.load(tmp_path / "found.npz") as found:
        same(unit.all(), dict(found))


def test_state_of_another_part_is_refused(master):
    unit, other = master(motion="volume"), master(motion="none")
    unit.step()
    content = unit.slave.serializeFMUState(unit.slave.getFMUState())
    before = other.all()
    with pytest.raises(FMICallException, match="SetFMUState"):
        other.slave.setFMUState(other.slave.deserializeFMUState(content))
    with pytest.raises(FMICallException, match="DoStep"):
        other.step()
    assert "another unit" in other.get("message")
    other.time = 0.0
    other.step()
    assert other.get("fill_fraction") > before["fill_fraction"]


# --- building -------------------------------------------------------------------------------------

SCENE = """
title = "Strip"
[process]
time = "1 ms"
[blank]
size = ["30 mm", "20 mm"]
edge_length = "5 mm"
[material]
preset = "MD600"
[permeability]
law = "gebart"
fibre_radius = "3.5 um"
[infiltration]
time = "64 s"
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
[[infiltration.gates]]
name = "left"
box = ["0 -1 -1 mm", "0 61 1 mm"]
pressure = "1 bar"
[[infiltration.vents]]
name = "right"
box = ["300 -1 -1 mm", "300 61 1 mm"]
"""


def test_scene_gives_its_infiltration(kit, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    unit = build_infiltration_fmu(kit.source, scene, tmp_path / "strip.fmu", fmi=3)
    scene.unlink()
    result = fmpy.simulate_fmu(
        str(unit), stop_time=16.0, output_interval=STEP, output=["fill_fraction"]
    )
    filling = kit.setup(CASE).filling()
    filling.advance(STEP)
    filling.advance(16.0)
    assert result["fill_fraction"][-1] == filling.filled_share
    scene.write_text(SCENE)
    with pytest.raises(InputError, match='no infiltration "other".*the scene has sheet'):
        build_infiltration_fmu(
            kit.source, scene, tmp_path / "a.fmu", options=InfiltrationUnit(name="other")
        )


@pytest.mark.parametrize(
    ("case", "options", "told"),
    [
        (CASE.replace("300 -1", "400 -1").replace("300 61", "410 61"), {}, "right"),
        (CASE, {"motion": "sideways"}, "no motion"),
        (CASE, {"fields": ["colour"]}, "no field"),
        (CASE, {"interface": -2}, "at least one patch"),
        (CASE, {"name": "a/b"}, "no name for files"),
        (CASE.replace("64 s", "64"), {}, "time"),
    ],
)
def test_wrong_input_is_told_and_leaves_the_old_unit(kit, tmp_path, case, options, told):
    kit.case()
    (tmp_path / "case.toml").write_text(case)
    out = tmp_path / "strip.fmu"
    out.write_text("an older unit")
    with pytest.raises(InputError, match=told):
        build_infiltration_fmu(
            kit.source, tmp_path / "case.toml", out, options=InfiltrationUnit(**options)
        )
    assert out.read_text() == "an older unit"


def test_unit_says_nothing_of_the_machine_it_was_built_on(made, tmp_path):
    folder = Path(fmpy.extract(str(made(fmi=3)), unzipdir=str(tmp_path / "unit")))
    for path in folder.rglob("*"):
        if path.is_file() and path.suffix not in (".so", ".dll"):
            assert str(tmp_path.parent).encode() not in path.read_bytes(), path


def test_fmi2_units_have_few_fields_unless_asked(made):
    few = fmpy.read_model_description(str(made(fmi=2, motion="none")))
    names = {v.name.partition("[")[0] for v in few.modelVariables if "[" in v.name}
    assert names == {"pore_pressure", "fill_factor"}
    every = fmpy.read_model_description(str(made(fmi=2, motion="none", fields=("all",))))
    names = {v.name.partition("[")[0] for v in every.modelVariables if "[" in v.name}
    assert names == {
        "pore_pressure",
        "pressure_at_rest",
        "fill_factor",
        "preform_thickness",
        "preform_volume",
    }
