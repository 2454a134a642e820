"""A unit with a coarse interface, and the conduct of an infiltration unit under random calls."""

import gc
import importlib.util
import math
import weakref
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.fmu.instances import open_unit
from lcmchain.fmu.part import PartState, SavedState
from lcmchain.fmu.variables import Kind
from lcmchain.mapping.interface import read_interface

_spec = importlib.util.spec_from_file_location(
    "fillings", Path(__file__).parents[1] / "coupling" / "infiltration_stage" / "conftest.py"
)
fillings = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(fillings)


class Instance:
    """An instance of a unit without FMI between."""

    def __init__(self, resources):
        self.unit = open_unit(str(resources), "one", lambda *told: None, arrays=True)
        self.references = {v.name: n for n, v in enumerate(self.unit.definition.variables)}
        self.time = 0.0

    def start(self):
        self.unit.enter_initialization()
        assert self.unit.exit_initialization() is Status.OK
        return self

    def set(self, name, value):
        variable = self.unit.definition.variables[self.references[name]]
        values = np.broadcast_to(np.asarray(value, dtype=float), variable.count).tolist()
        return self.unit.set_numbers([self.references[name]], values, variable.kind)

    def get(self, name):
        variable = self.unit.definition.variables[self.references[name]]
        found = self.unit.get_numbers([self.references[name]], variable.kind)
        return found.copy() if variable.size is not None else found[0]

    def step(self, size, time=None):
        status = self.unit.step(self.time if time is None else time, size)
        if status is Status.OK:
            self.time += size
        return status

    def outputs(self):
        return {
            v.name: np.array(self.get(v.name)).tobytes()
            for v in self.unit.definition.variables
            if v.causality == "output" and v.kind is not Kind.STRING and v.group != "status"
        }


def unpacked(unit, folder):
    with ZipFile(unit) as archive:
        archive.extractall(folder)
    return folder / "resources"


# --- forming at a coarse interface ----------------------------------------------------------------

STEP = 1e-4


@pytest.fixture(scope="module")
def forming(patch_file, tmp_path_factory):
    """Start the unit of the patch with so many patches of its 16 elements."""
    resources = {}

    def start(count):
        if count not in resources:
            folder = tmp_path_factory.mktemp(f"interface{count}")
            unit = build_fmu(
                patch_file, folder / "patch.fmu", fmi=3, pore_pressure=True, interface=count
            )
            resources[count] = unpacked(unit, folder)
        return Instance(resources[count]).start(), resources[count]

    return start


def test_fields_of_patches_are_sums_and_means_of_those_of_the_elements(forming):
    (fine, _), (coarse, resources) = forming(0), forming(5)
    fields = read_interface(resources / "interface.nc").fields
    pressure = np.linspace(0.0, 2e3, 5)
    coarse.set("pore_pressure", pressure)
    fine.set("pore_pressure", fields.constant(pressure))
    before = None
    for _ in range(3):
        before = coarse.get("fluid_thickness")
        assert coarse.step(STEP) is fine.step(STEP) is Status.OK
    for name in ("volume", "volume_rate", "volume_rate_slope", "area", "area_rate"):
        np.testing.assert_array_equal(coarse.get(name), fields.total(fine.get(name)), err_msg=name)
        assert coarse.get(name).sum() == pytest.approx(fine.get(name).sum(), rel=1e-12)
    for name in ("thickness", "fibre_volume_fraction", "shear_angle", "thickness_rate",
                 "position_x", "reference_pressure"):  # fmt: skip
        np.testing.assert_array_equal(coarse.get(name), fields.mean(fine.get(name)), err_msg=name)
    thickness = coarse.get("fluid_thickness")
    np.testing.assert_array_equal(thickness, coarse.get("volume") / coarse.get("area"))
    np.testing.assert_allclose(
        coarse.get("fluid_thickness_rate"), (thickness - before) / STEP, rtol=1e-6, atol=1e-9
    )
    for name in ("punch.force", "internal_energy", "thickness_min", "step_count"):
        assert coarse.get(name) == fine.get(name)
    # the pressure of a patch works as that of its elements
    work = pressure @ coarse.get("volume_rate")
    assert work == pytest.approx(fields.constant(pressure) @ fine.get("volume_rate"), rel=1e-12)


def test_interface_of_all_elements_is_the_blank(forming):
    _, resources = forming(0)
    interface = read_interface(resources / "interface.nc")
    assert interface.size == 16 and not interface.is_coarse
    assert interface.surface.areas.sum() == pytest.approx(20e-3**2, rel=1e-12)


def test_more_patches_than_elements_are_the_elements(patch_file, tmp_path):
    unit = build_fmu(patch_file, tmp_path / "patch.fmu", fmi=3, interface=99)
    instance = Instance(unpacked(unit, tmp_path)).start()
    assert instance.get("thickness").shape == (16,)
    with pytest.raises(InputError, match="at least one patch"):
        build_fmu(patch_file, tmp_path / "patch.fmu", interface=-1)


FILL = """
time = "1 s"
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
permeability = { law = "gebart", fibre_radius = "3.5 um" }
[[wetted]]
name = "all"
box = ["-1 -1 -1 m", "1 1 1 m"]
[[vents]]
name = "rim"
rim = true
bleeds = true
"""


def test_infiltration_takes_the_interface_of_the_forming_and_they_exchange(
    forming, patch_file, tmp_path
):
    """Both count the same patches, and what one gives the other takes, without a mapping."""
    unit = build_fmu(patch_file, tmp_path / "patch.fmu", fmi=3, pore_pressure=True, interface=5)
    solid = Instance(unpacked(unit, tmp_path / "solid"))
    solid.unit.set_texts([solid.references["out_dir"]], [str(tmp_path / "out")])
    solid.start()
    assert solid.step(STEP) is Status.OK
    solid.unit.terminate()
    (tmp_path / "case.toml").write_text(FILL)

    def fluid_of(interface):
        built = build_infiltration_fmu(
            tmp_path / "out" / "forming.nc", tmp_path / "case.toml", tmp_path / "fluid.fmu", fmi=3,
            options=InfiltrationUnit(motion="volume", interface=interface, allow_incomplete=True),
        )  # fmt: skip
        resources = unpacked(built, tmp_path / "fluid")
        return Instance(resources).start(), read_interface(resources / "interface.nc")

    fluid, interface = fluid_of(unit)
    _, resources = forming(5)
    of_solid = read_interface(resources / "interface.nc")
    np.testing.assert_array_equal(interface.patches.of_cell, of_solid.patches.of_cell)
    solid, _ = forming(5)
    volume = fluid.get("preform_volume")
    assert solid.step(STEP) is Status.OK
    for name in ("volume_rate", "reference_pressure"):
        assert fluid.set(name, solid.get(name)) is Status.OK
    assert fluid.step(STEP) is Status.OK
    volume = volume + STEP * solid.get("volume_rate")
    np.testing.assert_allclose(fluid.get("preform_volume"), volume, rtol=1e-12)
    assert solid.set("pore_pressure", fluid.get("pore_pressure")) is Status.OK
    # with the slope of the fixed-stress split the volume gives way to the pressure
    fluid.set("volume_rate_slope", solid.get("volume_rate_slope"))
    assert fluid.step(STEP) is Status.OK
    assert (fluid.get("preform_volume") > volume + STEP * solid.get("volume_rate")).all()
    assert fluid.get("pore_pressure").max() > 0.0, "the punch presses on the resin"
    whole, every = fluid_of(0)
    assert whole.get("pore_pressure").shape == (16,) and not every.is_coarse
    with pytest.raises(InputError, match="another sheet"):
        other = build_fmu(
            patch_file, tmp_path / "other.fmu", fmi=3, overrides=["blank.edge_length='4 mm'"]
        )
        fluid_of(other)


# --- conduct of the infiltration unit -------------------------------------------------------------


@pytest.fixture(scope="module")
def strip(tmp_path_factory):
    """Resources of the unit of a strip of 8 cells, whose volume and gate the master moves."""
    folder = tmp_path_factory.mktemp("strip")
    forming = fillings.write_forming(folder / "forming.nc", *fillings.strip(4, 2))
    (folder / "case.toml").write_text(fillings.HEAD + fillings.GATE + fillings.VENT)
    unit = build_infiltration_fmu(
        forming, folder / "case.toml", folder / "strip.fmu", fmi=3,
        options=InfiltrationUnit(motion="volume"),
    )  # fmt: skip
    return unpacked(unit, folder / "unit")


odd = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300, 5e-324])
sizes = st.one_of(st.just(8.0), st.floats(1e-6, 30.0), odd.filter(lambda x: not x > 1e3))
calls = st.one_of(
    st.tuples(st.just("step"), sizes),
    st.tuples(st.just("volume_rate"), st.floats(-3e-9, 1e-9) | odd),
    st.tuples(st.just("volume_rate_slope"), st.floats(0.0, 1e-14) | odd),
    st.tuples(st.just("reference_pressure"), st.floats(0.0, 1e5) | odd),
    st.tuples(st.just("left.pressure_input"), st.floats(-1e5, 1e6) | odd),
    st.tuples(st.sampled_from(["left.drive", "left.closed", "right.closed", "right.drive"]),
              st.sampled_from([0.0, 1.0])),
    st.tuples(st.sampled_from(["fill_fraction", "threads", "cell_count"]), st.just(1.0)),
    st.tuples(st.sampled_from(["save", "restore", "bytes"]), st.just(0.0)),
)  # fmt: skip


@pytest.fixture(scope="module")
def played(strip):
    """An instance, the state of its start, and the outputs after one step from there."""
    instance = Instance(strip).start()
    start = instance.unit.save()
    assert instance.step(8.0) is Status.OK
    return instance, start, instance.outputs()


@settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(sequence=st.lists(calls, min_size=1, max_size=10))
def test_random_calls_never_raise_and_what_fails_changes_nothing(played, sequence):
    instance, start, expected = played
    assert instance.unit.restore(start) is Status.OK
    instance.time = 0.0
    saved = [(start, 0.0)]
    for call, value in sequence:
        before = instance.outputs()
        if call == "step":
            status = instance.step(value)
            if status is not Status.OK:
                assert status is Status.DISCARD and instance.unit.message
                assert instance.outputs() == before
        elif call == "save":
            saved.append((instance.unit.save(), instance.time))
        elif call == "bytes":
            content = instance.unit.save().to_bytes()
            assert SavedState.from_bytes(content).to_bytes() == content
        elif call == "restore":
            state, instance.time = saved[-1]
            assert instance.unit.restore(state) is Status.OK
        else:
            status = instance.set(call, value)
            assert (status is Status.ERROR) == (call in ("fill_fraction", "threads", "cell_count"))
            assert instance.outputs() == before
    assert instance.unit.restore(start) is Status.OK
    instance.time = 0.0
    assert instance.step(8.0) is Status.OK
    assert instance.outputs() == expected


def test_an_instance_is_gone_as_soon_as_it_is_freed(strip):
    """Its megabytes do not wait for the search for circles, which few objects do not set off."""

    def lived():
        instance = Instance(strip).start()
        instance.set("volume_rate", -1e-10)
        instance.step(8.0)
        part = instance.unit.part
        return [weakref.ref(own) for own in (instance.unit, part, part.fluid, part.filling)]

    gc.disable()
    try:
        assert [own() for own in lived()] == [None] * 4
    finally:
        gc.enable()


def test_states_with_something_wrong_inside_are_refused(played):
    """Their check sum would fit: each array in turn with one value less, then without it."""
    instance, start, expected = played
    assert instance.unit.restore(start) is Status.OK
    instance.time = 0.0
    instance.step(8.0)
    state = instance.unit.save()
    wrong = [{"tree": None}, {"tree": ["record", "FillingState", {}]}, {"ended": ["flying", ""]}]
    parts = [PartState(state.part.values | own, state.part.arrays) for own in wrong]
    for name, values in state.part.arrays.items():
        if values.size > 1:
            parts.append(PartState(state.part.values, state.part.arrays | {name: values[:-1]}))
        rest = {key: own for key, own in state.part.arrays.items() if key != name}
        parts.append(PartState(state.part.values, rest))
    assert len(parts) > 30
    for part in parts:
        assert instance.unit.restore(SavedState(**(vars(state) | {"part": part}))) is Status.ERROR
        instance.unit._refusals.clear()
        assert instance.outputs() == expected
