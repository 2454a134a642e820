"""Files of participants: a bag over an infusion through the double, and what is refused."""

import numpy as np
import pytest
import xarray as xr

from lcmchain import cli
from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    Tolerance,
    fixed_point,
    fixed_stress_exchanges,
)
from lcmchain.coupling.mould import Mould, begin
from lcmchain.coupling.precice_adapter.adapter import Adapter
from lcmchain.coupling.precice_adapter.case import read_case
from lcmchain.coupling.precice_adapter.example import write_example
from lcmchain.coupling.precice_adapter.run import build_part
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.scene import read_infiltration

from .in_memory import Configured, Coupling, run_pair

LENGTH, WIDTH, COLUMNS, THICKNESS = 0.2, 0.04, 10, 1.1e-3
SCENE = """
process = { time = "1 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""
CASE = """
time = "200 s"
frames = 3
vent_pressure = "0.05 bar"
resin = { law = "constant", viscosity = "0.1 Pa*s" }
[[gates]]
name = "left"
box = ["-1 -1 -1 mm", "1 41 1 mm"]
pressure = "1 bar"
[[vents]]
name = "right"
box = ["199 -1 -1 mm", "201 41 1 mm"]
[permeability]
law = "kozeny_carman"
fibre_radius = "30 um"
k_along = 1.0
k_across = 1.0
"""
HEAD = 'participant = "{0}"\nconfig = "precice-config.xml"\nmesh = "{0}-Mesh"\n'
FIELDS = {"Rate": "volume_rate", "Slope": "volume_rate_slope", "Reference": "reference_pressure"}
SOLID = (
    HEAD.format("Solid")
    + '[part]\ntype = "compaction"\nsource = "forming.nc"\npressure = "0.05 bar"\n'
    + 'closure = { type = "bag", pressure = "1.01 bar" }\n'
    + '[[read]]\ndata = "Pressure"\nfield = "pore_pressure"\n'
    + "".join(
        f'[[write]]\ndata = "{data}"\nfield = "{field}"\n'
        + ('of_window = "mean"\n' if data == "Rate" else "")
        for data, field in FIELDS.items()
    )
)
FLUID = (
    HEAD.format("Fluid")
    + '[part]\ntype = "infiltration"\nsource = "forming.nc"\ncase = "case.toml"\n'
    + '[[write]]\ndata = "Pressure"\nfield = "pore_pressure"\n'
    + "".join(
        f'[[read]]\ndata = "{data}"\nfield = "{field}"\nwithin = "held"\n'
        for data, field in FIELDS.items()
    )
)


@pytest.fixture
def folder(tmp_path):
    """A flat strip of the fabric, its case, and the files of both participants."""
    x, y = np.linspace(0.0, LENGTH, COLUMNS + 1), np.linspace(0.0, WIDTH, 3)
    points = np.stack([c.ravel() for c in np.meshgrid(x, y, [0.0], indexing="ij")], axis=1)
    node = np.arange(len(points)).reshape(COLUMNS + 1, 3)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1)
    quads = quads.reshape(-1, 4)
    mesh = UgridMesh("sheet")
    variables = {**mesh.topology(quads, long_name="sheet"), **mesh.node_positions(points)}
    values = {"thickness": THICKNESS, "fibre_volume_fraction": 0.6 / (1810.0 * THICKNESS),
              "areal_fibre_mass": 0.6, "shear_angle": 0.0}  # fmt: skip
    for number in (1, 2):
        for axis, name in enumerate("xyz"):
            values[f"fibre_direction_{number}_{name}"] = float(axis == number - 1)
    units = {"thickness": "m", "areal_fibre_mass": "kg m-2", "shear_angle": "rad"}
    for name, value in values.items():
        about = {"units": units.get(name, "1"), "long_name": name}
        variables[name] = mesh.on_cells(np.full(len(quads), value), about)
    attributes = {"Conventions": "CF-1.11 UGRID-1.0", "state": "complete", "scene": SCENE}
    write_netcdf(tmp_path / "forming.nc", {"/": mesh.dataset(variables, attributes)})
    for name, text in (("case", CASE), ("solid", SOLID), ("fluid", FLUID)):
        (tmp_path / f"{name}.toml").write_text(text)
    return tmp_path


BAG = '[closure]\ntype = "bag"\npressure = "1.01 bar"\n'
WETTED = '[[wetted]]\nname = "third"\nbox = ["-1 -1 -1 mm", "61 41 1 mm"]\n'
OF_CASE = SOLID.replace('pressure = "0.05 bar"\n', "").replace(
    'closure = { type = "bag", pressure = "1.01 bar" }', 'case = "case.toml"'
)


def give_closure(folder, closure=BAG, wetted=""):
    """Let both participants begin as the case says."""
    with open(folder / "case.toml", "a") as file:
        file.write(wetted + closure)
    (folder / "solid.toml").write_text(OF_CASE)


def built(folder, name):
    return build_part(read_case(folder / f"{name}.toml"), folder, lambda share, text: None).part


@pytest.mark.parametrize("pressed", ["dry", "wet"])
def test_both_participants_begin_as_the_closure_of_the_case_says(folder, pressed):
    give_closure(folder, BAG + f'pressed = "{pressed}"\n', WETTED)
    solid, fluid = built(folder, "solid"), built(folder, "fluid")
    formed = read_formed_part(folder / "forming.nc")
    setup = set_up(formed, read_infiltration(folder / "case.toml"))
    mould = Mould(formed, setup.filling(), setup.case.closure, 1.0)
    for one, other in ((solid, mould.solid), (fluid, FillingPart(mould.filling))):
        for name in ("thickness", "pore_pressure", "volume"):
            np.testing.assert_array_equal(
                one.get_fields([name])[name], other.get_fields([name])[name]
            )
    np.testing.assert_array_equal(solid.thickness, fluid.filling.state.thickness)
    wet = solid.thickness.reshape(COLUMNS, 2)[:4]  # and those that share nodes with them
    if pressed == "wet":
        np.testing.assert_array_equal(wet, THICKNESS)
    else:
        assert wet.max() < 0.9 * THICKNESS


@pytest.mark.parametrize("wetted", ["", WETTED], ids=["dry", "wet"])
def test_a_bag_over_an_infusion_is_that_of_the_system_in_process(folder, wetted):
    size, count = 0.25, 6
    give_closure(folder, wetted=wetted)
    data = dict.fromkeys(FIELDS, ("Solid", 1)) | {"Pressure": ("Fluid", 1)}
    config = Configured(
        "Solid", "Fluid", {"Solid": "Solid-Mesh", "Fluid": "Fluid-Mesh"}, data, size,
        count * size, initial=("Fluid",), relative=1e-12, most_iterations=60,
    )  # fmt: skip
    written = {}

    def side(name):
        case = read_case(folder / f"{name}.toml")
        simulated = build_part(case, folder, lambda share, text: None)

        def run(participant):
            adapter = Adapter(simulated.part, participant, case.reads, case.writes, name=name)
            steps = adapter.run(simulated.on_window)
            assert steps.windows == count
            written[name] = simulated

        return run

    run_pair(Coupling(config), side("solid"), side("fluid"))
    # one after the other: the library below netCDF serves one thread at a time
    files = {name: simulated.write(folder) for name, simulated in written.items()}
    solid, fluid = written["solid"].part, written["fluid"].part

    part = read_formed_part(folder / "forming.nc")
    case = read_infiltration(folder / "case.toml")
    filling = set_up(part, case).filling()
    own = FillingPart(filling)
    parts = {"solid": begin(part, own, case.closure).solid, "fluid": own}
    tight = Tolerance(1e-12)
    exchanges = [
        Exchange("solid", "fluid", "volume_rate", of_window="mean", within="held", tolerance=tight),
        Exchange("fluid", "solid", "pore_pressure", tolerance=tight),
        *fixed_stress_exchanges("solid", "fluid"),
    ]
    system = CoupledSystem(parts, exchanges, fixed_point(1.0), window=size, prediction=0)
    system.advance_to(count * size)
    for ours, theirs, field in (
        (solid, parts["solid"], "thickness"), (fluid, parts["fluid"], "pore_pressure"),
        (fluid, parts["fluid"], "volume"),
    ):  # fmt: skip
        expected = theirs.get_fields([field])[field]
        values = ours.get_fields([field])[field]
        np.testing.assert_allclose(values, expected, rtol=0.0, atol=1e-9 * expected.max())
    assert 0.2 < filling.filled_share < 0.9
    state = fluid.filling.state
    assert abs(state.balance_error) <= 1e-10 * state.stored
    with xr.open_dataset(folder / "solid.nc") as found:
        assert found["pressed_thickness"].shape == (count + 1, 2 * COLUMNS)
        np.testing.assert_array_equal(found["pressed_thickness"].values[-1], solid.thickness)
    with xr.open_dataset(folder / "fluid_filling.nc") as found:
        assert found.attrs["filling_outcome"] == "reached"
        np.testing.assert_array_equal(found["fill_factor"].values[-1], state.fill)
    assert {file.name for file in files["fluid"]} >= {"fluid_filling.nc", "fluid_filling.json"}


def test_forming_is_a_participant(folder):
    (folder / "scene.toml").write_text(SCENE)
    text = HEAD.format("Solid") + '[part]\ntype = "forming"\nscene = "scene.toml"\n'
    text += '[[read]]\ndata = "Pressure"\nfield = "pore_pressure"\n'
    text += '[[write]]\ndata = "Rate"\nfield = "volume_rate"\nof_window = "mean"\n'
    (folder / "forming.toml").write_text(text)
    case = read_case(folder / "forming.toml")
    simulated = build_part(case, folder, lambda share, text: None)

    def forming(participant):
        Adapter(simulated.part, participant, case.reads, case.writes, name="Solid").run(
            simulated.on_window
        )

    def outside(participant):
        """Keeps the pressure at nothing and reads the rates; nothing moves then."""
        places = simulated.part.places("volume_rate")
        ids = participant.set_mesh_vertices("Fluid-Mesh", places)
        participant.initialize()
        while participant.is_coupling_ongoing():
            left = participant.get_max_time_step_size()
            rates = participant.read_data("Fluid-Mesh", "Rate", ids, left)
            assert np.abs(rates).max() < 1e-12
            participant.write_data("Fluid-Mesh", "Pressure", ids, np.zeros(len(ids)))
            participant.advance(left)

    data = {"Rate": ("Solid", 1), "Pressure": ("Fluid", 1)}
    config = Configured("Solid", "Fluid", {"Solid": "Solid-Mesh", "Fluid": "Fluid-Mesh"}, data,
                        1e-4, 5e-4, implicit=False)  # fmt: skip
    run_pair(Coupling(config), forming, outside)
    assert simulated.part.time == pytest.approx(5e-4, rel=1e-9)
    simulated.write(folder)
    with xr.open_dataset(folder / "forming.nc") as found:
        assert found.attrs["state"] == "stopped: the coupling ended at 0.0005 s"
        assert found["time"].values[-1] == pytest.approx(5e-4, rel=1e-9)


WRONG = {
    "an unknown key": ("substep = 2\n", r'substep is unknown; did you mean "substeps"\?'),
    "no part": ("-part", "part is missing"),
    "an unknown part": ('-type = "compaction"\n+type = "cooking"', "part: "),
    "a window of its own": ('-"1.01 bar"+"1 bar", window = "1 s"', r"part\.closure\.window: "),
    "a wet start": ('-"1.01 bar"+"1 bar", pressed = "wet"', r"part\.closure\.pressed: .* case"),
    "a pressure beside a case": ('-closure = {+case = "c.toml" #', r"part\.pressure: "),
    "two closures": ('-"forming.nc"+"f.nc"\ncase = "c.toml"', r"part\.closure: .* both"),
    "a number without a unit": ('-"1.01 bar"+3.0', r"part\.closure\.pressure"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files_of_participants_are_refused(folder, name):
    change, message = WRONG[name]
    text = SOLID
    if change == "-part":
        text = text[: text.index("[part]")] + text[text.index("[[read]]") :]
    elif change.startswith("-"):
        old, _, new = change[1:].partition("+")
        text = text.replace(old.strip(), new)
    else:
        text = change + text
    (folder / "solid.toml").write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_case(folder / "solid.toml")
    assert "solid.toml" in str(caught.value)


def test_a_textile_that_begins_thinner_than_the_infiltration_does_is_told(folder):
    with pytest.warns(UserWarning, match="begins up to .* % thinner .* name that case with case"):
        solid = built(folder, "solid")
    fluid = built(folder, "fluid")
    assert solid.thickness.max() < 0.9 * fluid.filling.state.thickness.min()


def test_the_case_of_a_textile_needs_a_closure(folder):
    (folder / "solid.toml").write_text(OF_CASE)
    with pytest.raises(InputError, match=r"part\.case: has no \[closure\]"):
        built(folder, "solid")


def test_the_command_writes_an_example_and_says_what_is_missing(tmp_path, capsys, monkeypatch):
    def ends(*arguments):
        with pytest.raises(SystemExit) as ended:
            cli.main([str(argument) for argument in arguments])
        return ended.value.code or 0

    assert ends("precice", "--example", tmp_path / "new") == 0
    assert {file.name for file in write_example(tmp_path / "other")} == {
        "precice-config.xml", "solid.toml", "fluid.toml",
    }  # fmt: skip
    assert ends("precice", "--example", tmp_path / "new") == 2
    assert "exists already; name another folder" in capsys.readouterr().err
    assert ends("precice") == 2
    assert "use --example" in capsys.readouterr().err
    # None in the list of modules makes the import fail, as where it is not installed
    monkeypatch.setitem(__import__("sys").modules, "precice", None)
    monkeypatch.chdir(tmp_path / "new")
    assert ends("precice", "solid.toml", "-q") == 2
    told = capsys.readouterr().err
    assert "preCICE cannot be loaded" in told and "pip install" in told
    assert not (tmp_path / "new" / "results").exists()
