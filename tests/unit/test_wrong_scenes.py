"""Wrong scenes: each gives one clear message that names the key, exit code 2, and no output."""

import os

import pytest

from lcmchain.cli import main
from lcmchain.errors import InputError
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.scene.reading.single_tables import read_structure

SCENE = """
title = "Hemisphere"
[process]
time = "20 ms"
[blank]
size = ["100 mm", "80 mm"]
edge_length = "5 mm"
height = "0.502 mm"
[material]
preset = "MD600"
[contact]
friction = 0.157
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "30 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "20 mm" }
[[tools]]
name = "holder"
shape = { type = "plate_with_hole", hole_radius = "32 mm", fillet_radius = "5 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "1.7 kg" }
"""

STEEL = """[material]
law = "isotropic"
thickness = "1 mm"
density = "7850 kg/m^3"
young_modulus = "210 GPa"
poisson_ratio = 0.3
"""
TAPE = """[material]
law = "orthotropic"
thickness = "1 mm"
density = "1600 kg/m^3"
E1 = "100 GPa"
E2 = "10 GPa"
E3 = "10 GPa"
nu12 = 0.3
nu13 = 0.3
nu23 = 0.4
G12 = "5 GPa"
G13 = "5 GPa"
G23 = "3 GPa"
"""
MATRIX = """[material]
law = "stiffness"
thickness = "1 mm"
density = "1600 kg/m^3"
membrane = ["10 2 0 0 0 0 MPa", "2 10 0 0 0 0 MPa", "0 0 5 0 0 0 MPa",
            "0 0 0 1 0 0 MPa", "0 0 0 0 1 0 MPa", "0 0 0 0 0 1 MPa"]
bending = ["10 2 0 0 0 0 MPa", "2 10 0 0 0 0 MPa", "0 0 5 0 0 0 MPa",
           "0 0 0 1 0 0 MPa", "0 0 0 0 1 0 MPa", "0 0 0 0 0 1 MPa"]
"""
PRESET = '[material]\npreset = "MD600"\n'
PUNCH_SHAPE = 'shape = { type = "sphere_capped_punch", radius = "30 mm" }'
STROKE = 'motion = { type = "stroke", direction = [0, 0, -1], distance = "20 mm" }'
FILE = 'shape = { type = "surface_mesh", file = "FILE", length_unit = "mm" }'
BROKEN_FILE = FILE.replace("FILE", "broken.stl")
TABLE = 'motion = { type = "table", direction = [0, 0, -1], times = "TIMES", travel = "TRAVEL" }'


def replaced(*changes: tuple[str, str]) -> str:
    text = SCENE
    for old, new in changes:
        assert text.count(old) >= 1, old
        text = text.replace(old, new, 1)
    return text


def table_motion(times: str, travel: str) -> str:
    return replaced((STROKE, TABLE.replace("TIMES", times).replace("TRAVEL", travel)))


def edge(value: str) -> str:
    return replaced(('edge_length = "5 mm"', f"edge_length = {value}"))


# name: (text of the scene, the key that the message names, words that it contains)
WRONG = {
    # values with units
    "bare number": (edge("5"), "blank.edge_length", 'for example "5 mm"'),
    "no unit in the text": (edge('"5"'), "blank.edge_length", "has no unit"),
    "unknown unit": (edge('"5 milimeter"'), "blank.edge_length", "unknown unit"),
    "wrong dimension": (
        replaced(('"1.7 kg"', '"1.7 m"')), 'tools[1] "holder".motion.mass', "write a mass"
    ),
    "decimal comma": (edge('"2,5 mm"'), "blank.edge_length", "decimal comma"),
    "quantity as a list": (edge('["5 mm"]'), "blank.edge_length", "must be a length"),
    "angle without unit": (edge('"5 mm"\nfibre_angle = 45'), "blank.fibre_angle", '"45 deg"'),
    "angle in millimetres": (
        edge('"5 mm"\nfibre_angle = "45 mm"'), "blank.fibre_angle", "write an angle"
    ),
    "millipascal": (
        replaced((PRESET, PRESET + 'compaction.c0 = "0.1563 mPa"\n')),
        "material.compaction.c0", "megapascal",
    ),
    "too large to compute": (edge('"1e400 mm"'), "blank.edge_length", "too large"),
    "beyond any use": (replaced(('"20 ms"', '"1e302 ms"')), "process.time", "at most 1e+09 s"),
    "too small to compute": (edge('"1e-300 mm"'), "blank.edge_length", "at least 1e-10 m"),
    "unit of 100,000 characters": (
        edge(f'"5 {"m" * 100_000}"'), "blank.edge_length", "a text of 100,002 characters"
    ),
    "number of 100,000 digits": (edge(f'"{"5" * 100_000} mm"'), "blank.edge_length", "a text of"),
    "power far too high": (edge('"5 mm^99999999"'), "blank.edge_length", "unit"),
    # size and depth of the file
    "brackets nested far too deeply": (
        f"{SCENE}[x]\na = {'[' * 5000}{']' * 5000}\n", "scene.toml", "nested far too deeply"
    ),
    "tables nested too deeply": (f"{SCENE}[{'.'.join('a' * 100)}]\n", "a.a", "20 levels deep"),
    "key of 100,000 characters": (
        f"{SCENE}{'k' * 100_000} = 1\n", "scene.toml", "a key of 100,000 characters"
    ),
    "text of 300,000 characters": (
        f'title = "{"t" * 300_000}"\n' + SCENE.replace('title = "Hemisphere"', ""),
        "title", "300,000 characters",
    ),
    "megabytes": (f"{SCENE}# {'x' * 2_000_000}\n", "scene.toml", "more than 2 MB"),
    "number of 5000 digits": (
        replaced(("friction = 0.157", f"friction = {'1' * 5000}")), "scene.toml", "5000 digits"
    ),
    "number of 9000 hexadecimal digits": (
        replaced(("friction = 0.157", f"friction = 0x{'1' * 9000}")),
        "contact.friction", "too large to compute",
    ),
    "1,000 tools": (
        SCENE + "".join(f'[[tools]]\nname = "t{i}"\nshape = {{ type = "plate", side = "below" }}\n'
                        for i in range(1000)),
        "tools", "has 1,002 tables; at most 200",
    ),
    "table of 20,000 times": (
        table_motion(" ".join(map(str, range(20_000))) + " us", "0 5 mm"),
        'tools[0] "punch".motion.times', "20,000 times; at most 10,000",
    ),
    "name of 1,000 letters": (
        replaced(('"holder"', f'"{"h" * 1000}"')), "tools[1]", "1,000 characters"
    ),
    "zero byte in a file name": (
        replaced((PUNCH_SHAPE, FILE.replace("FILE", "a\\u0000b"))),
        'tools[0] "punch".shape.file', "cannot be written",
    ),
    "file name that no file can have": (
        replaced((PUNCH_SHAPE, FILE.replace("FILE", "f" * 900))),
        'tools[0] "punch".shape.file', "there is no file",
    ),
    # keys and structure
    "unknown key": (
        replaced(("edge_length", "edge_lenght")), "blank.edge_lenght", 'did you mean "edge_length"?'
    ),
    "layers": (SCENE + "[[layers]]\n", "layers", "plies that lie on each other stand in"),
    "plies of the material": (
        replaced((PRESET, PRESET + 'plies = 4\n')), "material.plies",
        "it belongs into the top level; possible here: ",
    ),
    "empty title": (replaced(('"Hemisphere"', '" "')), "title", "is empty; for example "),
    "pressure in [[pressure]]": (
        SCENE + '[[pressure]]\nname = "bag"\nface = "top"\npressure = "10 kPa"\n',
        'pressure[0] "bag".pressure', "unknown key; possible here: ",
    ),
    "holes": (
        replaced(("edge_length", "cutout = []\nedge_length")), "blank.cutout", "holes, darts and"
    ),
    "clamps": (SCENE + "[[clamps]]\n", "clamps", "[[grippers]] hold"),
    "steps": (SCENE + "[[steps]]\n", "steps", "stand in [[stages]]"),
    "diaphragms": (SCENE + "[diaphragm]\n", "diaphragm", "film = true"),
    "springs": (SCENE + "[[springs]]\n", "springs", "as a blank holder does"),
    "missing key": (replaced(('edge_length = "5 mm"\n', "")), "blank.edge_length", "is missing"),
    "unknown table": (SCENE + "[proces]\n", "proces", 'did you mean "process"?'),
    "key in the wrong table": (
        replaced((PUNCH_SHAPE, PUNCH_SHAPE + '\nradius = "30 mm"')),
        'tools[0] "punch".radius', 'belongs into "shape"',
    ),
    "missing material": (replaced((PRESET, "")), "material", 'preset = "MD600"'),
    "missing blank size": (replaced(("size =", "# size =")), "blank", "needs either size"),
    "size and outline": (
        edge('"5 mm"\noutline = ["0 0 mm", "50 0 mm", "0 50 mm"]'), "blank", "not both"
    ),
    "single table for tools": (
        SCENE.split("[[tools]]")[0] + '[tools]\nname = "punch"\n',
        "tools", "[[tools]]",
    ),
    "table as a text": (
        'material = "MD600"\n' + replaced((PRESET, "")), "material", "must be a table"
    ),
    "entry of a list that is no table": (
        'tools = ["none"]\n' + SCENE.split("[[tools]]")[0], "tools[0]", "write it as [[tools]]"
    ),
    "no TOML": (edge("5 mm"), "scene.toml", "values with units stand in quotes"),
    "no TOML at all": (SCENE + "\n[blank\n", "scene.toml", "at line"),
    "key given twice": (edge('"5 mm"\nedge_length = "6 mm"'), "scene.toml", "at line"),
    # blank
    "negative edge length": (edge('"-5 mm"'), "blank.edge_length", "must be positive"),
    "edge length larger than the blank": (
        edge('"90 mm"'), "blank.edge_length", "larger than the blank"
    ),
    "negative blank size": (
        replaced(('"100 mm", "80 mm"', '"-100 mm", "80 mm"')), "blank.size[0]", "must be positive"
    ),
    "three sizes": (
        replaced(('"80 mm"', '"80 mm", "1 mm"')), "blank.size", "needs 2 lengths"
    ),
    "outline of two points": (
        replaced(('size = ["100 mm", "80 mm"]', 'outline = ["0 0 mm", "50 0 mm"]')),
        "blank.outline", "at least 3",
    ),
    # material
    "negative thickness": (
        replaced((PRESET, PRESET + 'thickness = "-1 mm"\n')), "material.thickness", "positive"
    ),
    "zero thickness": (
        replaced((PRESET, PRESET + 'thickness = "0 mm"\n')), "material.thickness", "positive"
    ),
    "thickness in metres": (
        replaced((PRESET, PRESET + 'thickness = "1.004 m"\n')), "material.thickness", "larger than"
    ),
    "unknown preset": (
        replaced(("MD600", "MD60")), "material.preset", 'did you mean "MD600"?'
    ),
    "preset as a list": (
        replaced(('"MD600"', '["MD600"]')), "material.preset", "must be a name in quotes"
    ),
    "preset as a table": (
        replaced(('"MD600"', '{ name = "MD600" }')), "material.preset", "must be a name in quotes"
    ),
    "unknown law": (
        replaced((PRESET, STEEL.replace("isotropic", "isotropc"))),
        "material.law", 'did you mean "isotropic"?',
    ),
    "no law": (
        replaced((PRESET, STEEL.replace('law = "isotropic"\n', ""))), "material.law", "is missing"
    ),
    "preset with another law": (
        replaced((PRESET, PRESET + 'law = "isotropic"\n')), "material.law", "leave law out"
    ),
    "more fibre than space": (
        replaced((PRESET, PRESET + 'areal_mass = "6 kg/m^2"\n')),
        "material.areal_mass", "fibre volume fraction",
    ),
    "polynomial of wrong length": (
        replaced((PRESET, PRESET + 'membrane.shear_polynomial = "0.2 0.1 MPa"\n')),
        "material.membrane.shear_polynomial", "needs 5 coefficients, but has 2",
    ),
    "falling shear stress": (
        replaced((PRESET, PRESET + 'membrane.shear_polynomial = "0.2 -3 0 0 0 MPa"\n')),
        "material.membrane.shear_polynomial", "falling shear stress",
    ),
    "compaction that overflows": (
        replaced((PRESET, PRESET + "compaction.c1 = 6e4\n")), "material.compaction.c1", "exp("
    ),
    "Poisson ratio": (
        replaced((PRESET, STEEL.replace("0.3", "0.5"))), "material.poisson_ratio", "below 0.5"
    ),
    "negative modulus": (
        replaced((PRESET, STEEL.replace("210 GPa", "-210 GPa"))),
        "material.young_modulus", "must be positive",
    ),
    "Poisson ratio of a soft direction": (
        replaced((PRESET, TAPE.replace("nu12 = 0.3", "nu12 = 3.5"))),
        "material.nu12", "sqrt(E1/E2) = 3.16",
    ),
    "Poisson ratios together": (
        replaced((PRESET, TAPE.replace("nu13 = 0.3", "nu13 = 3.0").replace("0.4", "0.9"))),
        "material", "negative stiffness",
    ),
    "unsymmetric stiffness": (
        replaced((PRESET, MATRIX.replace('"2 10', '"3 10', 1))),
        "material.membrane", "not symmetric: entry [0][1] is 2 MPa, entry [1][0] is 3 MPa",
    ),
    "indefinite stiffness": (
        replaced((PRESET, MATRIX.replace('"10 2', '"10 12', 1).replace('"2 10', '"12 10', 1))),
        "material.membrane", "not positive definite",
    ),
    "short stiffness row": (
        replaced((PRESET, MATRIX.replace('"0 0 5 0 0 0 MPa"', '"0 0 5 MPa"', 1))),
        "material.membrane[2]", "needs 6 entries, but has 3",
    ),
    # element, contact, process
    "too few integration points": (
        SCENE + "[element]\nintegration_points = 1\n", "element.integration_points", "at least 2"
    ),
    "half an integration point": (
        SCENE + "[element]\nintegration_points = 3.5\n",
        "element.integration_points", "whole number",
    ),
    "cross terms at the reference thickness": (
        SCENE + '[element]\ncross_terms = true\nbending_thickness = "reference"\n',
        "element.bending_thickness", "the cross terms have none",
    ),
    "unknown compaction strain": (
        SCENE + '[element]\ncompaction_strain = "normals"\n',
        "element.compaction_strain", 'did you mean "normal"?',
    ),
    "switch as a text": (
        replaced(('time = "20 ms"', 'time = "20 ms"\ngravity = "yes"')),
        "process.gravity", "true or false",
    ),
    "misspelt friction": (
        replaced(("friction = 0.157", "fricton = 0.157")), "contact.fricton", '"friction"'
    ),
    "friction above one": (
        replaced(("friction = 0.157", "friction = 15.7")), "contact.friction", "at most 1"
    ),
    "negative friction": (
        replaced(("friction = 0.157", "friction = -0.1")), "contact.friction", "at least 0"
    ),
    "friction as a text": (
        replaced(("friction = 0.157", 'friction = "O.157"')), "contact.friction", "without quotes"
    ),
    "friction is not a number": (
        replaced(("friction = 0.157", "friction = nan")), "contact.friction", "not finite"
    ),
    "no process time": (replaced(('"20 ms"', '"0 ms"')), "process.time", "must be positive"),
    "negative process time": (replaced(('"20 ms"', '"-20 ms"')), "process.time", "positive"),
    "one frame": (
        replaced(('time = "20 ms"', 'time = "20 ms"\nframes = 1')), "process.frames", "at least 2"
    ),
    "step above the stable one": (
        replaced(('time = "20 ms"', 'time = "20 ms"\nstep_safety = 1.5')),
        "process.step_safety", "at most 1",
    ),
    # tools
    "duplicate tool names": (replaced(('"holder"', '"punch"')), "tools", '"punch" twice'),
    "name with blanks": (
        replaced(('name = "holder"', 'name = "blank holder"')), "tools[1]", "is not a name"
    ),
    "unknown shape": (
        replaced(('"sphere_capped_punch"', '"sphere_caped_punch"')),
        'tools[0] "punch".shape.type', 'did you mean "sphere_capped_punch"?',
    ),
    "shape missing": (
        replaced((PUNCH_SHAPE, "")), 'tools[0] "punch".shape', "is missing; for example shape = {"
    ),
    "shape without its radius": (
        replaced((', radius = "30 mm"', "")), 'tools[0] "punch".shape.radius', "is missing"
    ),
    "negative hole": (
        replaced(('"32 mm"', '"-32 mm"')), 'tools[1] "holder".shape.hole_radius', "positive"
    ),
    "unknown side": (
        replaced(('side = "above"', 'side = "abov"')),
        'tools[1] "holder".shape.side', 'did you mean "above"?',
    ),
    "right angle of a cone": (
        replaced((PUNCH_SHAPE, 'shape = { type = "cone", tip_radius = "5 mm",'
                               ' half_angle = "90 deg" }')),
        'tools[0] "punch".shape.half_angle', "below 90 deg",
    ),
    "cone cut off in its tip": (
        replaced((PUNCH_SHAPE, 'shape = { type = "cone", tip_radius = "5 mm", height = "2 mm",'
                               ' half_angle = "30 deg" }')),
        'tools[0] "punch".shape.height', "more height",
    ),
    "edge radius of a cylinder": (
        replaced((PUNCH_SHAPE, 'shape = { type = "cylinder", radius = "5 mm", length = "9 mm",'
                               ' edge_radius = "6 mm" }')),
        'tools[0] "punch".shape.edge_radius', "larger than the radius",
    ),
    "fillets of a profile": (
        replaced((PUNCH_SHAPE, 'shape = { type = "revolved_profile", solid = "left",'
                               ' points = ["0 0 mm", "20 0 mm", "20 50 mm"],'
                               ' fillet_radii = "0 5 mm" }')),
        'tools[0] "punch".shape.fillet_radii', "one radius per point (3), but has 2",
    ),
    "tool file absent": (
        replaced((PUNCH_SHAPE, FILE)), 'tools[0] "punch".shape.file', 'there is no file "FILE"'
    ),
    "tool file empty": (
        replaced((PUNCH_SHAPE, FILE.replace("FILE", "empty.stl"))),
        'tools[0] "punch".shape.file', "is empty",
    ),
    "tool file without unit": (
        replaced((PUNCH_SHAPE, BROKEN_FILE.replace(', length_unit = "mm"', ""))),
        'tools[0] "punch".shape.length_unit', "is missing",
    ),
    "tool file in kilograms": (
        replaced((PUNCH_SHAPE, BROKEN_FILE.replace('"mm"', '"kg"'))),
        'tools[0] "punch".shape.length_unit', "not a unit of length",
    ),
    "direction of no length": (
        replaced(("[0, 0, -1]", "[0, 0, 0]")), 'tools[0] "punch".motion.direction', "no direction"
    ),
    "direction of two numbers": (
        replaced(("[0, 0, -1]", "[0, -1]")), 'tools[0] "punch".motion.direction', "needs 3 numbers"
    ),
    "negative stroke": (
        replaced(('distance = "20 mm"', 'distance = "-20 mm"')),
        'tools[0] "punch".motion.distance', "must be positive",
    ),
    "stroke after the end": (
        replaced(('distance = "20 mm"', 'distance = "20 mm", end = "30 ms"')),
        'tools[0] "punch".motion.end', "would not finish",
    ),
    "stroke backwards in time": (
        replaced(('distance = "20 mm"', 'distance = "20 mm", start = "9 ms", end = "8 ms"')),
        'tools[0] "punch".motion.end', "not after the start",
    ),
    "table of unequal length": (
        table_motion("0 10 20 ms", "0 5 mm"), 'tools[0] "punch".motion.travel', "2 values for 3"
    ),
    "table that goes back": (
        table_motion("0 10 9 ms", "0 5 9 mm"), 'tools[0] "punch".motion.times', "do not increase"
    ),
    "table that starts elsewhere": (
        table_motion("0 10 20 ms", "1 5 9 mm"), 'tools[0] "punch".motion.travel', "start at 0 mm"
    ),
    "holder without mass": (
        replaced((', mass = "1.7 kg"', "")), 'tools[1] "holder".motion.mass', 'mass = "1.7 kg"'
    ),
    # what follows
    "mapping file absent": (
        SCENE + '[[mapping]]\nname = "part"\nmesh = "part.vtu"\nkind = "structure"\n',
        'mapping[0] "part".mesh', 'there is no file "part.vtu"',
    ),
    "unknown mapping kind": (
        SCENE + '[[mapping]]\nname = "part"\nmesh = "broken.stl"\nkind = "strukture"\n',
        'mapping[0] "part".kind', 'did you mean "structure"?',
    ),
    "permeability without fibres": (
        replaced((PRESET, STEEL)) + '[permeability]\nlaw = "gebart"\nfibre_radius = "3.5 um"\n',
        "material.fibre_density", "permeability needs",
    ),
    "unknown permeability law": (
        SCENE + '[permeability]\nlaw = "darcy"\nfibre_radius = "3.5 um"\n',
        "permeability.law", "must be one of",
    ),
}  # fmt: skip

# Found when blank and tools are built: the same promise, a little later.
WRONG_AT_THE_START = {
    "overlapping punch": (
        replaced(("0 0 1.004 mm", "0 0 0.5 mm")),
        'tools[0] "punch".position', "reaches 0.504 mm into the blank",
    ),
    "two overlapping tools": (
        replaced(('height = "0.502 mm"', 'height = "1.502 mm"')),
        "tools", "2 tools overlap the blank",
    ),
    "tool file broken": (
        replaced((PUNCH_SHAPE, BROKEN_FILE)), "broken.stl", ""
    ),
    "tool file without triangles": (
        replaced((PUNCH_SHAPE, FILE.replace("FILE", "hollow.stl"))),
        'tools[0] "punch".shape.file', "holds no triangles",
    ),
    "outline that crosses itself": (
        replaced(('size = ["100 mm", "80 mm"]',
                  'outline = ["0 0 mm", "50 50 mm", "50 0 mm", "0 50 mm"]')),
        "blank.outline", "intersects itself",
    ),
    "sliver over millions of lattice cells": (
        replaced(('size = ["100 mm", "80 mm"]',
                  'outline = ["0 0 m", "9 9 m", "9 9.01 m"]'), ('"5 mm"', '"1 mm"')),
        "blank.edge_length", "8.1e+07 cells; choose",
    ),
    "more frames than memory": (
        replaced(('time = "20 ms"', 'time = "20 ms"\nframes = 100000'), ('"5 mm"', '"1 mm"')),
        "process.frames", "GB of this machine; save",
    ),
    "millions of elements": (edge('"0.001 mm"'), "blank.edge_length", "elements"),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "empty.stl").touch()
    (tmp_path / "hollow.stl").write_text("solid x\nendsolid x\n")
    (tmp_path / "broken.stl").write_bytes(b"solid nothing that is a mesh\n" + bytes(range(256)))
    return tmp_path


def refused(capsys, folder, command: str) -> str:
    """Run a command on the scene; return its message after the checks that hold for all."""
    out = folder / "results"
    before = list(folder.rglob("*"))
    with pytest.raises(SystemExit) as stop:
        main([command, str(folder / "scene.toml"), "--out", str(out)])
    captured = capsys.readouterr()
    assert stop.value.code == 2
    left = [path for path in folder.rglob("*") if path not in before]
    drawn = [out, out / "initial.png"] if f"{out / 'initial.png'} shows" in captured.err else []
    assert sorted(left) == drawn, "nothing may be left behind but a picture that is named"
    assert captured.out == "", "nothing was done, so nothing is reported"
    assert captured.err.startswith("Error: ") and captured.err.count("Error:") == 1
    assert "Traceback" not in captured.err
    return captured.err


def test_the_scene_that_is_made_wrong_is_right(folder):
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert len(read_scene(folder / "scene.toml").tools) == 2


@pytest.mark.parametrize("name", WRONG)
def test_wrong_scene(name, folder, capsys):
    text, key, words = WRONG[name]
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    message = refused(capsys, folder, "run")
    assert key in message
    assert words in message
    assert "scene.toml" in message
    assert "errors:" not in message, "one slip is one error"


@pytest.mark.parametrize("name", WRONG_AT_THE_START)
def test_scene_that_cannot_start(name, folder, capsys):
    text, key, words = WRONG_AT_THE_START[name]
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    message = refused(capsys, folder, "check")
    assert key in message
    assert words in message
    assert ("initial.png" in message) == ("tool" in key or "stl" in key)


def test_touching_within_the_tolerance_is_no_overlap(folder):
    from lcmchain.check import require_no_initial_overlap
    from lcmchain.mesh.blank import build_blank
    from lcmchain.tools.table import build_tool_table

    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    for shift, overlaps in ((0.0, False), (-0.009, False), (-0.011, True)):
        height = f"tools.punch.position=0 0 {1.004 * (1 + shift):.6f} mm"
        scene = read_scene(folder / "scene.toml", [height])
        blank = build_blank(scene.blank, scene.material.thickness)
        table = build_tool_table(scene.tools, folder, scene.process.time)
        if overlaps:
            with pytest.raises(InputError, match='"punch"'):
                require_no_initial_overlap(scene, table, [blank])
        else:
            gap = require_no_initial_overlap(scene, table, [blank])[0].gap
            assert gap == pytest.approx(1.004e-3 * shift, abs=1e-9)


def test_files_of_a_scene_that_comes_through_a_pipe_lie_in_the_current_folder(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    pipe = tmp_path / "elsewhere" / "pipe"
    pipe.parent.mkdir()
    os.mkfifo(pipe)
    assert scene_from_text(SCENE, pipe).source.directory == tmp_path
    assert scene_from_text(SCENE, pipe.with_name("s.toml")).source.directory == pipe.parent
    with pytest.raises(InputError, match="/dev/stdin is the standard input"):
        read_scene("-")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "there is no such scene file"),
        (lambda path: path.mkdir(), "is a folder"),
        (lambda path: path.write_bytes(b'title = "\xff"'), "is not UTF-8"),
    ],
)
def test_file_that_cannot_be_read(make, words, folder, capsys):
    make(folder / "scene.toml")
    assert words in refused(capsys, folder, "run")


def test_results_that_cannot_be_written(folder, capsys):
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    (folder / "results").write_text("a file in the way")
    assert "results cannot be written here" in refused(capsys, folder, "run")
    (folder / "results").unlink()
    (folder / "results").symlink_to(folder / "broken.stl" / "below a file")
    assert "results cannot be written here" in refused(capsys, folder, "check")


def test_there_are_as_many_kinds_of_wrong_scene_as_promised():
    assert len(WRONG) + len(WRONG_AT_THE_START) >= 30


def test_a_scene_in_place_of_a_case_is_told_what_it_is(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    told = "blank: unknown key; it belongs into a scene, and this file holds its structure alone"
    with pytest.raises(InputError, match=told):
        read_structure(path)
