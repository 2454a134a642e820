"""The unit of a stack of plies: outputs of every ply and of the stack, and saved states."""

import fmpy
import fmpy.validation
import numpy as np
import pytest
import xarray as xr
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from lcmchain.errors import InputError
from lcmchain.fields.summary import stack_summary
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.forming.variables import variables_of
from lcmchain.fmu.mesh_fields import read_mesh_fields
from lcmchain.mapping.interface import read_interface
from lcmchain.scene import read_scene
from lcmchain.solver.simulation import Simulation

SCENE = """
title = "Dome of two plies"
process = { time = "1.5 ms", frames = 4 }
material = { preset = "MD600" }
contact = { friction = 0.157 }
[fmu]
parameters = ["interfaces.0.friction"]
[[plies]]
name = "lower"
size = ["40 mm", "40 mm"]
edge_length = "5 mm"
height = "0.502 mm"
[[plies]]
name = "upper-patch"
size = ["30 mm", "24 mm"]
edge_length = "6 mm"
fibre_angle = "45 deg"
[[interfaces]]
friction = 0.2
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "15 mm" }
position = "0 0 2.008 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "2.9 mm", profile = "linear" }
[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "17 mm", fillet_radius = "5 mm", side = "below" }
"""
PLIES = ("lower", "'upper-patch'")
COUNTS = (64, 16, 80)  # elements of each, and of both
STEP = 2.5e-4
POINTS = [k * STEP for k in range(7)]


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "stack.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def units(scene_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("units")
    return {fmi: build_fmu(scene_file, folder / f"stack{fmi}.fmu", fmi=fmi) for fmi in (2, 3)}


@pytest.fixture(scope="module")
def simulated(units, tmp_path_factory):
    """What fmpy has recorded of the unit of FMI 3.0, and the groups of the file that it wrote."""
    out = tmp_path_factory.mktemp("out")
    recorded = fmpy.simulate_fmu(
        str(units[3]), stop_time=POINTS[-1], output_interval=STEP,
        start_values={"out_dir": str(out)},
    )  # fmt: skip
    with xr.open_datatree(out / "forming.nc") as tree:
        groups = {name: tree[name].to_dataset().load() for name in tree.groups}
    return recorded, groups


def test_fmpy_finds_no_problem(units):
    for unit in units.values():
        assert fmpy.validation.validate_fmu(str(unit)) == []


def test_fields_of_every_ply_and_of_the_stack_are_those_of_the_file(simulated):
    recorded, groups = simulated
    for prefix, group in zip(PLIES, ("lower", "upper-patch"), strict=True):
        of_file = groups[f"/{group}"]
        for name in ("thickness", "fibre_volume_fraction", "shear_angle"):
            found = recorded[f"{prefix}.{name}"][-1]
            np.testing.assert_array_equal(found, of_file[name].values[-1])
            if name != "shear_angle":
                assert recorded[f"{prefix}.{name}_min"][-1] == found.min() < found.max()
            assert recorded[f"{prefix}.{name}_max"][-1] == np.abs(found).max()
        change = np.diff(recorded[f"{prefix}.thickness"][-2:], axis=0)[0]
        rate = recorded[f"{prefix}.thickness_rate"][-1]
        np.testing.assert_allclose(rate, change / STEP, rtol=1e-9, atol=1e-12)
        for axis in "xyz":
            nodes = of_file[f"{group}_node_{axis}"].values
            corners = of_file[f"{group}_face_nodes"].values
            whole = ~np.isnan(corners).any(axis=1)  # cut faces have their centre elsewhere
            np.testing.assert_allclose(
                recorded[f"{prefix}.position_{axis}"][-1][whole],
                nodes[corners[whole].astype(int)].mean(axis=1),
                atol=1e-15,
            )
    sheet = groups["/"]
    for name in ("stack_thickness", "stack_fibre_volume_fraction"):
        found = recorded[name][-1]
        np.testing.assert_array_equal(found, sheet[name].values[-1])
        assert recorded[f"{name}_min"][-1] == found.min() < found.max()
        assert recorded[f"{name}_max"][-1] == found.max()
    # the patch ends inside the lower ply
    assert recorded["stack_thickness_max"][0] == pytest.approx(2.008e-3)
    assert recorded["stack_thickness_min"][0] == pytest.approx(1.004e-3)


def test_extrema_without_a_ply_are_those_of_all_plies(simulated):
    recorded, _ = simulated
    for name, end in (("thickness", "min"), ("thickness", "max"), ("shear_angle", "max")):
        of_plies = [recorded[f"{prefix}.{name}_{end}"][-1] for prefix in PLIES]
        assert of_plies[0] != of_plies[1]
        assert recorded[f"{name}_{end}"][-1] == (min if end == "min" else max)(of_plies)


BETWEEN = ("ply_pressure_max", "slip_max", "slip_path_max", "sliding_part")


def test_what_happens_between_the_plies_is_that_of_the_file(simulated):
    recorded, groups = simulated
    of_run = stack_summary(groups)
    of_plies = [of_run["plies"][name] for name in ("lower", "upper-patch")]
    for prefix, entries in zip(
        ("", *(f"{ply}." for ply in PLIES)), (of_run["stack"], *of_plies), strict=True
    ):
        pressure, slip, path, part = (recorded[f"{prefix}{name}"] for name in BETWEEN)
        assert pressure[-1] == entries["ply_pressure_max_Pa"] > 0.0
        assert slip[-1] == entries["slip_max_m"] > 0.0
        assert path[-1] == entries["slip_path_max_m"] >= slip[-1]
        assert part[-1] == pytest.approx(entries["sliding_part"], rel=1e-12)
        assert 0.0 < part.max() <= 1.0
        assert path[0] == 0.0


def test_both_versions_give_the_same_numbers(simulated, units):
    of_fmi3, _ = simulated
    of_fmi2 = fmpy.simulate_fmu(str(units[2]), stop_time=POINTS[-1], output_interval=STEP)
    for name, count in zip((*(f"{ply}.thickness" for ply in PLIES), "stack_thickness"), COUNTS):
        assert of_fmi3[name].shape == (len(POINTS), count)
        found = [of_fmi2[f"{name}[{entry + 1}]"][-1] for entry in range(count)]
        np.testing.assert_array_equal(found, of_fmi3[name][-1])
    between = [f"{prefix}{name}" for prefix in ("", *(f"{p}." for p in PLIES)) for name in BETWEEN]
    for name in ("internal_energy", "punch.force_z", "step_count", *between):
        np.testing.assert_array_equal(of_fmi2[name], of_fmi3[name])


class Master:
    """An instance of either version, and how it saves its state."""

    def __init__(self, fmi, unit, folder):
        description = read_model_description(str(unit))
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        kind, self.word = (FMU2Slave, "FMUstate") if fmi == 2 else (FMU3Slave, "FMUState")
        self.slave = kind(
            guid=description.guid if fmi == 2 else description.instantiationToken,
            unzipDirectory=extract(str(unit), unzipdir=str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="stack",
        )
        self.read = self.slave.getReal if fmi == 2 else self.slave.getFloat64
        self.slave.instantiate()
        if fmi == 2:
            self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def call(self, verb, *arguments):
        return getattr(self.slave, f"{verb}{self.word}")(*arguments)

    def step(self, number):
        self.slave.doStep(currentCommunicationPoint=POINTS[number], communicationStepSize=STEP)

    def between(self):
        """What the unit tells of the contact between the plies."""
        names = [
            f"{prefix}{name}" for prefix in ("", *(f"{p}." for p in PLIES)) for name in BETWEEN
        ]
        return list(self.read([self.references[name] for name in names]))

    def content(self):
        """The whole state, as bytes."""
        state = self.call("get")
        content = self.call("serialize", state)
        self.call("free", state)
        return content


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_saved_state_goes_on_to_the_same_bits(fmi, units, tmp_path):
    """Rolled back twice, and in another instance from the bytes."""
    one = Master(fmi, units[fmi], tmp_path / "one")
    for number in range(2):
        one.step(number)
    state, content, before = one.call("get"), one.content(), one.between()
    ends, told = [], []
    for _ in range(3):
        for number in range(2, 6):
            one.step(number)
        ends.append(one.content())
        told.append(one.between())
        one.call("set", state)
        assert one.between() == before
    assert told[0] == told[1] == told[2] != before
    assert ends[0] == ends[1] == ends[2] != content == one.content()
    other = Master(fmi, units[fmi], tmp_path / "other")
    assert other.content() != content
    restored = other.call("deSerialize" if fmi == 2 else "deserialize", content)
    other.call("set", restored)
    for number in range(2, 6):
        other.step(number)
    assert other.content() == ends[0] and other.between() == told[0]
    for master in (one, other):
        master.slave.freeInstance()


def test_the_springs_between_the_plies_belong_to_the_state(units, tmp_path):
    """Each array of the interface is in the bytes and changes what comes: none can be left out."""
    from lcmchain.fmu.conduct import Status
    from lcmchain.fmu.instances import open_unit
    from lcmchain.fmu.part import SavedState

    folder = extract(str(units[3]), unzipdir=str(tmp_path))
    unit = open_unit(f"{folder}/resources", "one", lambda *_: None, arrays=True)
    unit.set_up(0.0)
    unit.enter_initialization()
    unit.exit_initialization()
    for number in range(3):
        assert unit.step(POINTS[number], STEP) is Status.OK
    saved = SavedState.from_bytes(unit.save().to_bytes())
    assert unit.step(POINTS[3], STEP) is Status.OK
    state = unit.part.simulation.state
    springs = [name for name in state.as_dict() if name.startswith("ply_")]
    reached = {name: getattr(state, name).tobytes() for name in springs}
    own = [name for name in springs if f"state_{name}" in saved.part.arrays]
    assert own == springs and {"ply_rows", "ply_slope", "ply_counters"} < set(springs)
    assert (saved.part.arrays["state_ply_facet"] >= 0).any(), "the plies must touch"
    for name in springs:
        getattr(state, name)[...] = 0
    assert unit.restore(saved) is Status.OK
    for name in springs:
        held = saved.part.arrays[f"state_{name}"].tobytes()
        assert getattr(unit.part.simulation.state, name).tobytes() == held, name
    assert unit.step(POINTS[3], STEP) is Status.OK
    for name in springs:
        assert getattr(unit.part.simulation.state, name).tobytes() == reached[name], name


def test_a_master_sets_the_friction_between_the_plies(units, scene_file, simulated):
    recorded, _ = simulated
    other = fmpy.simulate_fmu(
        str(units[3]), stop_time=POINTS[-1], output_interval=STEP,
        start_values={"interfaces.'0'.friction": 0.4}, output=["external_work"],
    )  # fmt: skip
    direct = Simulation.from_scene(read_scene(scene_file, ["interfaces.0.friction=0.4"]))
    for time in POINTS[1:]:
        direct.advance_to(time)
    assert other["external_work"][-1] == direct.energy()["external"]
    assert other["external_work"][-1] != recorded["external_work"][-1]


def test_the_interface_tells_the_plies_apart(units, tmp_path):
    folder = extract(str(units[3]), unzipdir=str(tmp_path))
    interface = read_interface(f"{folder}/resources/interface.nc")
    assert not interface.is_coarse
    np.testing.assert_array_equal(interface.part, np.repeat([0, 1], COUNTS[:2]))
    upper = interface.cells[64:]
    assert upper[upper >= 0].min() == interface.cells[:64].max() + 1


def test_fields_lie_on_the_faces_of_their_ply(units, simulated):
    """At the start the centres that the unit tells are those of the faces of its mesh."""
    recorded, _ = simulated
    placed = read_mesh_fields(units[3])
    faces = placed.meshes["interface_face_nodes"].values.astype(int)
    faces[:, 3] = np.where(faces[:, 3] >= 0, faces[:, 3], faces[:, 2])  # triangles of the cut ply
    for axis in "xyz":
        nodes = placed.meshes[f"interface_node_{axis}"].values
        centres = nodes[faces].mean(axis=1)
        names = [f"{ply}.position_{axis}" for ply in PLIES]
        first = [placed.on_faces(name, recorded[name][0]) for name in names]
        on_ply = ~np.isnan(first)
        np.testing.assert_array_equal(on_ply.sum(axis=1), COUNTS[:2])
        assert (on_ply[0] != on_ply[1]).all()
        np.testing.assert_allclose(np.where(on_ply[0], *first), centres, atol=1e-12)
    assert placed.fields["stack_thickness"].entries == "interface_patch"


REFUSED = {
    "patches": ({"interface": 4}, r"--interface: groups the elements of one sheet.* 2 plies"),
    "mesh": ({"overrides": ['fmu.parameters=["plies.lower.edge_length"]']}, "decides the mesh"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_stack_has_no_meaning_for_is_refused(scene_file, tmp_path, case):
    options, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        build_fmu(scene_file, tmp_path / "unit.fmu", **options)


def test_fields_are_chosen_by_one_name_for_all_plies(scene_file):
    names = [v.name for v in variables_of(read_scene(scene_file), ["thickness"]) if v.size]
    assert names == ["lower.thickness", "'upper-patch'.thickness"]
    names = [v.name for v in variables_of(read_scene(scene_file), ["stack_thickness"]) if v.size]
    assert names == ["stack_thickness"]
    flat = read_scene(scene_file, ['plies.upper-patch.element="membrane-shell"'])
    names = {v.name for v in variables_of(flat)}
    assert {"thickness_min", "lower.thickness", "'upper-patch'.shear_angle"} <= names
    assert not {n for n in names if "patch'.thickness" in n or n.startswith("stack_")}
