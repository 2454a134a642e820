"""The unit as a file: what it declares, what it holds, and how building it fails."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.cosimulation.physical_units import display_unit, unit_from_name
from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu, model_identifier
from lcmchain.fmu.conduct import StepOutcome
from lcmchain.fmu.description import as_bytes, model_description
from lcmchain.fmu.forming.scene_parameters import overrides, scene_parameters
from lcmchain.fmu.forming.variables import Abilities, field_names, forming_variables
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.variables import DECLARED_TYPES, DISPLAY_UNITS, TYPE_OF_UNIT, UNITS
from lcmchain.scene import read_scene
from lcmchain.tools.motion import FIXED, GUIDED, PRESCRIBED

ELEMENT_COUNT = 400
POSITION = ("drive_to_position", "position_input")

TETRAHEDRON = """solid punch
facet normal 0 0 -1
outer loop
vertex 0 0 5
vertex 0 10 5
vertex 10 0 5
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 5
vertex 10 0 5
vertex 0 0 15
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 5
vertex 0 0 15
vertex 0 10 5
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 10 0 5
vertex 0 10 5
vertex 0 0 15
endloop
endfacet
endsolid punch
"""

#: A stroke leads the sheet: no time is needed.
WITHOUT_TIME = """
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
material = { preset = "MD600" }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "15 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "2 mm" }
"""


def test_fmpy_finds_no_problem_in_the_model_description(unit):
    assert validate_fmu(str(unit)) == []


def test_interface_is_that_of_the_scene(unit):
    description = read_model_description(str(unit))
    by_name = {v.name: v for v in description.modelVariables}
    assert len(by_name) == len(description.modelVariables)

    inputs = {v.name for v in description.modelVariables if v.causality == "input"}
    assert inputs == {
        "punch.drive",
        "punch.velocity_input",
        "'blank-holder'.drive",
        "'blank-holder'.velocity_input",
        "'blank-holder'.force_input",
        *[f"{tool}.{x}" for tool in ("punch", "'blank-holder'") for x in POSITION],
    }
    assert {v.name for v in description.modelVariables if v.causality == "parameter"} == {
        "threads",
        "out_dir",
        "contact.friction",
    }
    for field, unit_name in (("thickness", "m"), ("fibre_volume_fraction", "1")):
        names = [name for name in by_name if name.startswith(f"{field}[")]
        assert names == [f"{field}[{i}]" for i in range(1, ELEMENT_COUNT + 1)]
        assert {by_name[name].unit for name in names} == {unit_name}
    for tool in ("punch", "die", "'blank-holder'"):
        units = [by_name[f"{tool}.{name}"].unit for name in ("travel", "velocity", "force")]
        assert units == ["m", "m/s", "N"]
    newton = next(u for u in description.unitDefinitions if u.name == "N").baseUnit
    assert (newton.kg, newton.m, newton.s) == (1, 1, -2)

    abilities = description.coSimulation
    assert abilities.canGetAndSetFMUstate
    assert abilities.canSerializeFMUstate
    assert abilities.canHandleVariableCommunicationStepSize
    experiment = description.defaultExperiment
    assert float(experiment.stopTime) == 3e-3
    assert float(experiment.stepSize) == pytest.approx(1e-3)


def test_outputs_depend_on_no_input_at_the_same_time(unit):
    description = read_model_description(str(unit))
    assert all(unknown.dependencies == [] for unknown in description.outputs)


def test_fields_are_single_variables_of_the_definition():
    tools = [("punch", PRESCRIBED), ("die", FIXED), ("holder", GUIDED)]
    whole = Abilities(tools, 9, 5e-3, "Scene", True, True, False)
    variables = forming_variables(whole)
    assert [(v.name, v.size) for v in variables if v.size] == [(n, 9) for n in field_names(whole)]
    chosen = forming_variables(whole, fields=["shear_angle"])
    assert [v.name for v in chosen if v.size] == ["shear_angle"]
    without = forming_variables(whole._replace(has_fibre_volume_fraction=False))
    assert {v.name for v in variables} - {v.name for v in without} == {
        "fibre_volume_fraction",
        "fibre_volume_fraction_min",
        "fibre_volume_fraction_max",
    }
    assert not [v.name for v in variables if v.causality == "input" and "die" in v.name]
    wet = forming_variables(whole._replace(takes_pore_pressure=True))
    added = [v for v in wet if v.name not in {v.name for v in variables}]
    names = [v.name for v in added if v.causality == "input"]
    assert names == ["pore_pressure", "pore_pressure_at_rest"]
    assert {"volume_rate", "volume_rate_slope", "reference_pressure"} <= {v.name for v in added}


def test_both_descriptions_tell_the_same(unit, unit3):
    """Names, causalities, units, types and starts; a field of FMI 2 is many scalars."""
    two, three = (read_model_description(str(path)) for path in (unit, unit3))
    of_three = {v.name: v for v in three.modelVariables}
    assert of_three["thickness"].dimensions[0].start == 400
    seen = set()
    for scalar in two.modelVariables:
        other = of_three[scalar.name.split("[")[0]]
        seen.add(other.name)
        for what in ("causality", "variability", "unit", "initial", "min", "max", "nominal"):
            assert getattr(scalar, what) == getattr(other, what), (scalar.name, what)
        if scalar.start is not None:
            assert scalar.start == other.start
        declared = scalar.declaredType and scalar.declaredType.name
        assert declared == (other.declaredType and other.declaredType.name)
    assert seen | {"shear_angle", "thickness_rate", *(f"position_{x}" for x in "xyz")} == set(
        of_three
    )
    assert [u.variable.name for u in three.outputs] == [
        v.name for v in three.modelVariables if v.causality == "output"
    ]


@pytest.fixture(scope="module", params=[2, 3])
def description(request, unit, unit3):
    return read_model_description(str(unit if request.param == 2 else unit3))


def test_all_variables_have_types_with_nominal_values_and_the_unit_says_whose_it_is(description):
    assert all(v.declaredType is not None for v in description.modelVariables)
    reals = [v for v in description.modelVariables if v.type in ("Real", "Float64")]
    assert len(reals) > 20
    assert {v.unit or v.declaredType.unit for v in reals} == {v.declaredType.unit for v in reals}
    nominal = {v.declaredType.name: v.declaredType.nominal for v in reals}
    far = {"Thickness": 1e-3, "TimeStep": 1e-6}
    far |= {"ThicknessRate": 1e-3} if description.fmiVersion == "3.0" else {}
    assert {name: float(value) for name, value in nominal.items() if value} == far
    assert {"Ratio", "Fraction", "Length"} <= set(nominal)
    assert "MIT" in description.license and "lcmchain" in description.copyright


def test_a_state_is_an_enumeration_that_says_what_its_values_mean(description):
    by_name = {v.name: v for v in description.modelVariables}
    assert by_name["step_outcome"].type == "Enumeration"
    items = by_name["step_outcome"].declaredType.items
    assert [int(item.value) for item in items] == list(StepOutcome)
    assert items[1].name == "undone" and all(item.description for item in items)
    assert by_name["status"].type in ("Integer", "Int32"), "some masters read no enumeration"
    added = [name for name in by_name if ".mean_" in name]  # behind all others
    assert list(by_name)[-len(added) - 1] == "step_outcome", "references stay what they were"
    assert list(by_name)[-len(added) :] == added


def test_lengths_are_shown_in_millimetres_and_angles_in_degrees(description):
    shown = {v.name: v.declaredType.displayUnit for v in description.modelVariables}
    assert (shown["punch.travel"], shown["shear_angle_max"]) == ("mm", "deg")
    assert shown["punch.force"] is None
    defined = {u.name: {d.name: float(d.factor) for d in u.displayUnits}
               for u in description.unitDefinitions}  # fmt: skip
    assert defined["m"] == {"mm": 1000.0} and set(defined["rad"]) == {"deg"}


def test_a_value_in_a_display_unit_means_what_its_name_means():
    """To the bit: start values of systems are the same with and without the definition."""
    for unit, shown in DISPLAY_UNITS.items():
        for name, factor in shown.items():
            own = display_unit(name, unit_from_name(unit), factor, 0.0)
            assert (own.factor, own.offset) == (unit_from_name(name).factor, 0.0), name
    for quantity in DECLARED_TYPES.values():
        assert quantity.shown_in is None or quantity.shown_in in DISPLAY_UNITS[quantity.unit]


@pytest.mark.parametrize("elements", [4, 5000])
@pytest.mark.parametrize("version, convention", [(2, "flat"), (3, "structured")])
def test_the_naming_convention_does_not_depend_on_the_size_of_the_model(
    version, convention, elements
):
    variables = forming_variables(Abilities([], elements, 5e-3, "Scene", True, True, False))
    unit = UnitDefinition("0", {}, "Scene", "unit", variables, 1.0, 0.1)
    root = model_description(unit, version)
    assert root.get("variableNamingConvention") == convention


def test_every_unit_has_a_type():
    assert set(TYPE_OF_UNIT) == set(UNITS)
    assert TYPE_OF_UNIT["m"] == "Length" and TYPE_OF_UNIT["m3/s"] == "VolumeFlowRate"


@pytest.mark.parametrize("version", [2, 3])
def test_a_unit_need_not_say_that_it_needs_a_tool(scene_file, tmp_path, version):
    """Masters refuse units that do."""
    for option, needed in (("--execution-tool", True), ("--no-execution-tool", False)):
        path = tmp_path / f"{needed}.fmu"
        arguments = ["fmu", "build", str(scene_file), "-o", str(path), "--fmi", str(version)]
        assert CliRunner().invoke(app, [*arguments, option]).exit_code == 0
        assert read_model_description(str(path)).coSimulation.needsExecutionTool is needed


def test_fmpy_finds_no_problem_in_fmi3(unit3):
    assert validate_fmu(str(unit3)) == []
    description = read_model_description(str(unit3))
    assert description.coSimulation.canGetAndSetFMUstate
    assert description.coSimulation.canSerializeFMUstate


def test_description_of_3600_elements_is_small(tmp_path):
    """Below 300 kB in FMI 3.0, with all that a fluid exchanges."""
    tools = [(f"tool {k}", GUIDED) for k in range(10)]
    abilities = Abilities(tools, 3600, 5e-3, "Scene", True, True, True)
    definition = UnitDefinition("0", {}, "Scene", "unit", forming_variables(abilities), 1.0, 0.1)
    content = as_bytes(model_description(definition, 3))
    assert len(content) < 300_000
    assert content.count(b"<Dimension") == len(field_names(abilities)) + 1


def test_unit_is_compressed_and_says_what_it_needs(unit3):
    with zipfile.ZipFile(unit3) as archive:
        assert all(entry.compress_type == zipfile.ZIP_DEFLATED for entry in archive.infolist())
        needs = archive.read("documentation/externalDependencies.txt").decode()
        index = archive.read("documentation/index.html").decode()
    assert "lcmchain" in needs and "pythonfmu3" in needs and "Python" in needs
    assert "<td>punch.velocity_input</td>" in index


def test_parameters_are_what_the_scene_marks(patch_file, tmp_path):
    unit = build_fmu(patch_file, tmp_path / "patch.fmu")
    mass = {v.name: v for v in read_model_description(str(unit)).modelVariables}[
        "tools.holder.motion.mass"
    ]
    assert (mass.causality, mass.variability, mass.unit, float(mass.start)) == (
        "parameter", "fixed", "kg", 0.5,
    )  # fmt: skip


@pytest.mark.parametrize("fmi, kind", [(2, "Integer"), (3, "Int32")])
def test_a_parameter_that_is_a_whole_number_is_set_as_one(patch_file, tmp_path, fmi, kind):
    marked = ['fmu.parameters=["process.frames"]']
    unit = build_fmu(patch_file, tmp_path / "patch.fmu", fmi=fmi, overrides=marked)
    assert validate_fmu(str(unit)) == []
    variables = {v.name: v for v in read_model_description(str(unit)).modelVariables}
    frames = variables["process.frames"]
    assert (frames.type, frames.unit, frames.start) == (kind, None, "4")
    scene = read_scene(patch_file, marked)
    (parameter,) = (p for p in scene_parameters(scene) if p.key == "process.frames")
    changed = overrides([parameter], {"process.frames": 9.0})
    assert read_scene(patch_file, [*marked, *changed]).process.frames == 9


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("tools.holder.motion.weight", "no entry"),
        ("tools.absent.friction", "no entry"),
        ("blank.edge_length", "decides the mesh"),
        ("tools.holder.motion.gravity", "not one number"),
        ("title", "not one number"),
        ("grippers.rim.count", "how many outputs"),
        ("tools.punch.position.2", "cannot be set alone: .*as a list"),
    ],
)
def test_a_parameter_that_is_none_is_told(patch_file, tmp_path, key, told):
    with pytest.raises(InputError, match=told) as caught:
        build_fmu(patch_file, tmp_path / "patch.fmu", overrides=[f'fmu.parameters=["{key}"]'])
    assert caught.value.key == "fmu.parameters" and key in str(caught.value)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"fmi": 1}, "no FMI 1"),
        ({"part": "flow"}, 'no part "flow"'),
        ({"fields": ["thick"]}, 'no field "thick"'),
    ],
)
def test_an_unknown_option_is_told(patch_file, tmp_path, options, told):
    with pytest.raises(InputError, match=told):
        build_fmu(patch_file, tmp_path / "patch.fmu", **options)


def test_same_scene_gives_the_same_guid_and_another_scene_another(scene_file, unit, tmp_path):
    def guid(path):
        return read_model_description(str(path)).guid

    assert guid(build_fmu(scene_file, tmp_path / "again.fmu")) == guid(unit)
    other = tmp_path / "other.toml"
    other.write_text(scene_file.read_text().replace("0.157", "0.2"))
    assert guid(build_fmu(other, tmp_path / "other.fmu")) != guid(unit)


def test_building_leaves_the_process_as_it_was(scene_file, tmp_path):
    path, modules = list(sys.path), set(sys.modules)
    build_fmu(scene_file, tmp_path / "dome.fmu")
    assert sys.path == path
    assert not {name for name in set(sys.modules) - modules if "forming_unit" in name}


def test_unit_holds_the_files_that_the_scene_names(scene_file, tmp_path):
    for folder in ("scene", "scene/meshes", "elsewhere"):
        (tmp_path / folder).mkdir()
    (tmp_path / "scene/meshes/inner.stl").write_text(TETRAHEDRON)
    (tmp_path / "elsewhere/outer.stl").write_text(TETRAHEDRON)
    text = scene_file.read_text()
    for name, file in (("inner", "meshes/inner.stl"), ("outer", "../elsewhere/outer.stl")):
        text += f"""
[[tools]]
name = "{name}"
shape = {{ type = "surface_mesh", file = "{file}", length_unit = "mm", spacing = "0.5 mm" }}
"""
    scene = tmp_path / "scene/scene.toml"
    scene.write_text(text)
    built = build_fmu(scene, tmp_path / "a unit.fmu")
    with zipfile.ZipFile(built) as archive:
        names = set(archive.namelist())
        assert archive.read("resources/scene/meshes/inner.stl").decode() == TETRAHEDRON
        (moved,) = (name for name in names if name.endswith("outer.stl"))
        assert moved.startswith("resources/scene/")
        overrides = json.loads(archive.read("resources/unit.json"))["overrides"]
    assert overrides == [f'tools[4].shape.file="{moved.removeprefix("resources/scene/")}"']
    description = read_model_description(str(built))
    assert description.coSimulation.modelIdentifier == "a_unit"
    assert {"binaries/linux64/a_unit.so", "binaries/win64/a_unit.dll"} <= names
    assert str(tmp_path) not in json.dumps(overrides)


@pytest.mark.parametrize(
    ("name", "identifier"), [("dome", "dome"), ("2 layers", "_2_layers"), ("höhe-1", "h_he_1")]
)
def test_model_identifier_is_one_of_the_c_language(name, identifier):
    assert model_identifier(name) == identifier


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('{ type = "sphere_capped_punch", radius = "25 mm" }',
         '{ type = "surface_mesh", file = "absent.stl", length_unit = "mm" }', "absent.stl"),
        ('position = "0 0 1.004 mm"', 'position = "0 0 0 mm"', "into the blank"),
        ('edge_length = "5 mm"', "edge_length = 5", "edge_length"),
    ],
)  # fmt: skip
def test_wrong_scene_is_told_and_leaves_the_old_unit(scene_file, tmp_path, old, new, told):
    scene = tmp_path / "dome.toml"
    scene.write_text(scene_file.read_text().replace(old, new))
    out = tmp_path / "dome.fmu"
    out.write_text("an older unit")
    with pytest.raises(InputError, match=told):
        build_fmu(scene, out)
    assert out.read_text() == "an older unit"
    assert {path.name for path in tmp_path.iterdir()} == {"dome.toml", "dome.fmu"}


def test_name_of_the_unit_must_end_in_fmu(scene_file, tmp_path):
    with pytest.raises(InputError, match=r"\.fmu"):
        build_fmu(scene_file, tmp_path / "dome.zip")


def test_unit_without_lcmchain_says_what_to_install():
    entry = Path(__file__).parents[2] / "fmu" / "entry_environment.py"
    program = f"import runpy; runpy.run_path({str(entry)!r})['prepare'](__file__)"
    program = program.replace("__file__", repr(str(entry)))
    # Isolated and without site-packages: a Python that has the standard library only.
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", program], capture_output=True, text=True, env={}
    )
    assert done.returncode != 0
    assert "ImportError: this unit needs lcmchain" in done.stderr
    assert done.stderr.startswith("this unit needs lcmchain in the Python 3.")


def test_unit_of_the_2d_approach_forms_without_thickness(scene_file, tmp_path):
    """No variable promises what `element = "membrane-shell"` does not predict."""
    text = scene_file.read_text(encoding="utf-8")
    (tmp_path / "flat.toml").write_text('element = "membrane-shell"\n' + text, encoding="utf-8")
    unit = build_fmu(tmp_path / "flat.toml", tmp_path / "flat.fmu")
    names = {v.name for v in read_model_description(str(unit)).modelVariables}
    assert not [name for name in names if name.startswith(("thickness", "fibre_volume_fraction"))]
    outputs = ["punch.force", "shear_angle_max", "internal_energy", "hourglass_energy"]
    result = simulate_fmu(
        str(unit), stop_time=1e-3, output_interval=5e-4, output=outputs, validate=False
    )
    assert result["hourglass_energy"][-1] == 0.0
    assert result["shear_angle_max"][-1] > 0.0 and result["internal_energy"][-1] > 0.0
    assert result["punch.force"][-1] < 0.0


def test_a_tool_may_have_the_name_of_a_field(scene_file, tmp_path):
    """Only fields that the elements do not predict are left out, whatever tools are called."""
    text = scene_file.read_text(encoding="utf-8").replace('"punch"', '"thickness_gauge"')
    (tmp_path / "flat.toml").write_text('element = "membrane-shell"\n' + text, encoding="utf-8")
    unit = build_fmu(tmp_path / "flat.toml", tmp_path / "flat.fmu")
    names = {v.name for v in read_model_description(str(unit)).modelVariables}
    assert {"thickness_gauge.drive", "thickness_gauge.travel", "thickness_gauge.force"} <= names
    assert not names & {"thickness_min", "thickness_max", "thickness[1]"}


def test_a_fluid_acts_on_no_unit_whose_scene_has_no_time(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(WITHOUT_TIME, encoding="utf-8")
    with pytest.raises(InputError, match="a fluid acts in the pores") as caught:
        build_fmu(scene, tmp_path / "unit.fmu", pore_pressure=True)
    assert caught.value.key == "process.time"
    assert not (tmp_path / "unit.fmu").exists()
    unit = build_fmu(scene, tmp_path / "unit.fmu")
    experiment = read_model_description(str(unit)).defaultExperiment
    assert float(experiment.stopTime) == pytest.approx(read_scene(scene).process.time)
