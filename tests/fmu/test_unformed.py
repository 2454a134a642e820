"""A mesh that was not formed offers what a formed part does: units, and a part for preCICE."""

import json
import shutil

import fmpy
import meshio
import numpy as np
import pytest
import xarray as xr
from fmpy.validation import validate_fmu
from test_infiltration import CASE as FORMED_CASE
from test_infiltration import Master, fillings, same
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.formed_part import unformed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import FillOptions, map_and_fill
from lcmchain.coupling.precice_adapter.case import read_case
from lcmchain.coupling.precice_adapter.run import build_part
from lcmchain.errors import InputError
from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu
from lcmchain.mapping import MappingOptions
from lcmchain.scene import read_infiltration

PREFORM = """
[preform]
thickness = "2 mm"
fibre_volume_fraction = 0.5
permeability = { k1 = "1e-10 m^2", ratio = 0.5, axis = [1, 0, 0] }
"""
STEP = 16.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A mesh in millimetres, its case, and units with which both may be gone."""
    path = tmp_path_factory.mktemp("unformed")
    points, quads = fillings.strip()
    meshio.write(path / "strip.vtu", meshio.Mesh(1e3 * points, [("quad", quads)]))
    (path / "case.toml").write_text(FORMED_CASE + PREFORM)
    return path


@pytest.fixture(scope="module")
def made(folder):
    def make(fmi=3, motion="none"):
        out = folder / f"strip_{fmi}_{motion}.fmu"
        if not out.exists():
            options = InfiltrationUnit(motion=motion, length_unit="mm")
            build_infiltration_fmu(
                folder / "strip.vtu", folder / "case.toml", out, fmi=fmi, options=options
            )
        return out

    return make


def direct(folder):
    case = read_infiltration(folder / "case.toml")
    return set_up(unformed_part(folder / "strip.vtu", case.preform, length_unit="mm"), case)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("motion", ["none", "thickness", "volume"])
def test_fmpy_finds_no_problem_with_any_motion(made, fmi, motion):
    assert validate_fmu(str(made(fmi, motion))) == []


def test_its_result_is_that_of_the_command_to_the_last_bit(made, folder, tmp_path):
    """Also where the mesh and the case are gone."""
    fmpy.simulate_fmu(
        str(shutil.copy(made(), tmp_path)), stop_time=4 * STEP, output_interval=STEP,
        start_values={"out_dir": str(tmp_path / "unit")}, output=["fill_fraction"],
    )  # fmt: skip
    options = FillOptions(picture=False, vtu=False)
    map_and_fill(
        folder / "strip.vtu", None, read_infiltration(folder / "case.toml"), name="infiltration",
        out_dir=tmp_path / "run", mapping=MappingOptions(length_unit="mm"), options=options,
    )  # fmt: skip
    (found,) = (tmp_path / "unit").iterdir()
    with xr.open_datatree(found) as unit, xr.open_datatree(tmp_path / "run" / found.name) as run:
        assert unit.groups == run.groups
        for group in run.groups:
            of_unit, of_run = unit[group].to_dataset(), run[group].to_dataset()
            assert set(of_unit.variables) == set(of_run.variables)
            for name in of_run.variables:
                np.testing.assert_array_equal(of_unit[name], of_run[name], err_msg=name)
        assert unit.attrs["unformed_mesh"] == "strip.vtu"
        assert run["history"]["filled_share"][-1] > 0.3


def test_a_master_moves_it_and_the_permeability_follows(made, folder, tmp_path):
    """Bit for bit the coupled part in process, by Kozeny and Carman."""
    master = Master(made(motion="volume"), tmp_path / "unit")
    setup = direct(folder)
    part = FillingPart(setup.filling())
    volume = setup.mesh.areas * 2e-3
    for rate in (-0.05, -0.02, 0.0):
        inputs = {"volume_rate": rate * volume / STEP, "volume_rate_slope": 0.0 * volume,
                  "reference_pressure": 0.0 * volume}  # fmt: skip
        master.set(**inputs)
        part.set_fields(inputs)
        master.step(STEP)
        part.advance(STEP)
        names = {"preform_thickness": "thickness", "pore_pressure": "pore_pressure"}
        for of_unit, own in names.items():
            assert np.array_equal(master.get(of_unit), part.get_fields([own])[own])
    assert np.allclose(master.get("preform_thickness"), 0.93 * 2e-3)
    factor = part.filling.medium.factor(part.filling.state.thickness)
    kozeny = ((1.0 - 0.5 / 0.93) / 0.5) ** 3 / (1.0 / 0.93) ** 2
    assert np.allclose(factor, kozeny) and kozeny < 0.8
    master.slave.freeInstance()


def test_the_command_builds_it_and_names_what_is_wrong(made, folder, tmp_path):
    def build(*more, source="strip.vtu"):
        out = tmp_path / "strip.fmu"
        words = ["fmu", "build", str(folder / "case.toml"), "--part", "infiltration", "-o",
                 str(out), "--fmi", "3", "--motion", "none"]  # fmt: skip
        words += ["--source", str(folder / source)] if source else []
        return out, CliRunner().invoke(app, [*words, *more])

    out, answer = build("--length-unit", "mm")
    assert answer.exit_code == 0, answer.output
    one, other = (fmpy.read_model_description(str(unit)) for unit in (out, made()))
    assert one.guid == other.guid
    for more, source, said in (
        (("--length-unit", "kg"), "strip.vtu", "length-unit"),
        ((), "strip.vtu", "no node lies in the box"),  # in metres the vent is far from the mesh
        ((), "other.vtu", "no forming result.*its mesh with --source"),
        ((), None, "its mesh with --source"),
    ):
        _, answer = build(*more, source=source)
        assert isinstance(answer.exception, InputError)
        with pytest.raises(InputError, match=said):
            raise answer.exception


def test_what_is_of_formed_parts_alone_is_refused(folder, tmp_path):
    forming = fillings.write_forming(tmp_path / "forming.nc", *fillings.strip())
    (tmp_path / "formed.toml").write_text(FORMED_CASE)
    for source, case, options, said in (
        (forming, folder / "case.toml", {}, "preform: is of a mesh that was not formed"),
        (folder / "strip.vtu", folder / "case.toml", {"frame": 1, "length_unit": "mm"},
         "frame: is 1, but a mesh that was not formed has no frames"),
        (forming, tmp_path / "formed.toml", {"length_unit": "mm"},
         "length_unit: is of a mesh that was not formed"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            build_infiltration_fmu(
                source, case, tmp_path / "a.fmu", options=InfiltrationUnit(**options)
            )


PARTICIPANT = """
participant = "Fluid"
config = "precice-config.xml"
mesh = "Fluid-Mesh"
[part]
type = "infiltration"
source = "strip.vtu"
case = "case.toml"
length_unit = {unit}
"""


def test_a_participant_of_precice_fills_it(folder):
    path = folder / "fluid.toml"
    path.write_text(PARTICIPANT.format(unit=json.dumps("mm")))
    simulated = build_part(read_case(path), folder, lambda share, text: None)
    own = FillingPart(direct(folder).filling())
    for part in (simulated.part, own):
        part.advance(STEP)
    names = ["pore_pressure", "thickness", "volume"]
    same(simulated.part.get_fields(names), own.get_fields(names))
    assert own.get_fields(["pore_pressure"])["pore_pressure"].max() > 1e4
    path.write_text(PARTICIPANT.format(unit=json.dumps("kg")))
    with pytest.raises(InputError, match="length_unit"):
        read_case(path)
