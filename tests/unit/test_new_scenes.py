"""``lcmchain new``: every case is a commented scene that checks and runs as it is written."""

from __future__ import annotations

import math
import re
import shlex
import struct
import tomllib
from pathlib import Path

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.check import check_scene
from lcmchain.errors import InputError
from lcmchain.manual.contents import read_page
from lcmchain.pipeline import run
from lcmchain.scene import read_scene
from lcmchain.scene.cases.moulds import close_moulds
from lcmchain.scene.cases.sheet import round_edge_length
from lcmchain.tools.shapes import shape_names
from lcmchain.tools.surfaces.reading import read_surface

THICKNESS = 1.004  # of MD600 [mm]
CASES = {
    "punch": [],
    "punch small": ["--punch-radius", "20 mm", "--preset", "carbon-twill-200"]
    + ["--fibre-angle", "45 deg"],
    "punch free": ["--no-holder", "--stroke", "2 cm", "--blank-size", "320 260 mm"],
    "moulds": ["--upper", "upper.stl", "--lower", "lower.stl"],
    "moulds glass": ["--upper", "upper.stl", "--lower", "lower.stl", "--preset", "glass-plain-600"],
    "drape": [],
    "drape pillar": ["--shape", "pillar", "--radius", "50 mm"],
    "drape ridge": ["--shape", "ridge"],
    "drape file": ["--form", "lower.stl", "--edge-length", "10 mm"],
    "coupon": [],
    "coupon glass": ["--preset", "glass-plain-600"],
}  # fmt: skip


def exit_code(*arguments) -> int:
    with pytest.raises(SystemExit) as stop:
        cli.main([str(argument) for argument in arguments])
    return stop.value.code or 0


def pan(x, y):
    """Height of a rectangular pan with rounded walls of at most 31 degrees [mm]."""
    beyond = np.hypot(np.maximum(abs(x) - 30.0, 0.0), np.maximum(abs(y) - 15.0, 0.0)) - 10.0
    s = np.clip(beyond / 25.0, 0.0, 1.0)
    return -8.0 * (1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def write_stl(path: Path, points: np.ndarray, *, turned: bool = False) -> None:
    """Write a grid of points (n, m, 3) as an open skin whose normals point up, or down."""
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    pairs = [(a, b, c), (a, c, d)]
    triangles = np.concatenate([np.stack(pair, axis=2).reshape(-1, 3, 3) for pair in pairs])
    if turned:
        triangles = triangles[:, ::-1]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    with path.open("wb") as file:
        file.write(b"skin".ljust(80) + struct.pack("<I", len(triangles)))
        for n, corners in zip(normal, triangles):
            file.write(struct.pack("<12fH", *n, *corners.ravel(), 0))


def grid(height, half=(60.0, 45.0), count=(61, 46), offset=(0.0, 0.0, 0.0)) -> np.ndarray:
    x, y = np.meshgrid(*(np.linspace(-h, h, n) for h, n in zip(half, count)), indexing="ij")
    return np.stack([x, y, height(x, y)], axis=-1) + np.array(offset)


@pytest.fixture
def moulds(tmp_path, monkeypatch) -> Path:
    """Two pans of the same shape away from the origin, the upper one 40 mm higher, in mm."""
    monkeypatch.chdir(tmp_path)
    write_stl(tmp_path / "lower.stl", grid(pan, offset=(200.0, -30.0, 5.0)))
    write_stl(tmp_path / "upper.stl", grid(pan, offset=(200.0, -30.0, 45.0)), turned=True)
    return tmp_path


def new(name: str, *more) -> Path:
    """Write the scene of a case and return its file."""
    file = Path(f"{name.replace(' ', '_')}.toml")
    assert exit_code("new", name.split()[0], *CASES[name], *more, "--out", file) == 0
    return file


# --- every case -----------------------------------------------------------------------------------


#: What no other case shows of moulds are their files, whatever the fabric between them.
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name == "moulds glass")) for name in CASES],
)
def test_check_accepts_a_written_scene_and_warns_of_nothing_but_carried_over_values(moulds, name):
    report = check_scene(read_scene(new(name)))
    other_fabric = any("--preset" in option for option in CASES[name])
    # the coupon spells the values out, so that they are the scene's own
    expected = 1 if other_fabric and "coupon" not in name else 0
    assert len(report.warnings) == expected, report.warnings
    assert all("carried over" in warning for warning in report.warnings)
    assert min(gap.gap for gap in report.gaps) > -1e-6
    assert all(gap.gap < 0.2e-3 for gap in report.gaps)  # every tool is at the sheet
    assert report.element_count >= 16


@pytest.mark.parametrize("name", ["punch", "moulds", "drape", "coupon"])
def test_a_comment_stands_above_every_entry_when_it_first_occurs(moulds, name):
    lines = new(name).read_text("utf-8").splitlines()
    explained = set()
    for before, line in zip(lines, lines[1:]):
        match = re.match(r"([a-z]\w*) = ", line, flags=re.IGNORECASE)
        if match is None:
            continue
        key = match[1]
        if before.startswith("#"):
            explained.add(key)
        assert key in explained or key in ("law", "gravity", "direction", "type"), line
    assert max(map(len, lines)) <= 120


@pytest.mark.parametrize("name", ["punch", "drape"])
def test_comments_name_every_shape_of_a_tool(moulds, name):
    text = new(name).read_text("utf-8")
    assert len(shape_names()) > 5
    assert [shape for shape in shape_names() if f"{shape}," not in text] == ["surface_mesh"]
    assert '# shape = { type = "surface_mesh"' in text


@pytest.mark.parametrize("name", ["punch", "coupon"])
def test_the_tables_that_stand_as_comments_are_right(moulds, name):
    text = new(name).read_text("utf-8")
    head, mark, rest = text.partition("# --- More tables")
    assert mark
    tables = "\n".join(line.removeprefix("# ") for line in rest.splitlines()[1:])
    assert set(tomllib.loads(tables)) == {"element", "output", "permeability", "mapping"}
    Path("part.vtk").write_text("not empty")
    Path("all.toml").write_text(head + tables, "utf-8")
    scene = read_scene("all.toml")
    assert scene.permeability is not None and scene.mapping[0].kind == "structure"


@pytest.mark.parametrize("name", ["coupon", "moulds"])
def test_a_written_scene_runs_as_it_is(moulds, name):
    coarse = ["--edge-length", "5 mm", "--time", "80 ms"]
    file = new(name, *(coarse if name == "moulds" else []))
    summary = run(read_scene(file), Path("out"), threads=1).summary
    # the moulds close faster than the scene proposes
    assert all("kinetic" in warning for warning in summary["warnings"]), summary["warnings"]
    if name == "coupon":  # between plates at 0.7 of the thickness, which yield a little
        assert 0.7 * THICKNESS < 1e3 * summary["thickness_min_m"] < 0.75 * THICKNESS
    else:
        assert summary["shear_angle_max_rad"] < math.radians(30.0)
        # closed to the thickness at the steepest wall, wider elsewhere
        assert summary["thickness_min_m"] > 0.93 * THICKNESS * 1e-3
        assert summary["tool_loads"]["upper"]["force_max_N"] > 0.0


def test_the_cases_are_listed_with_a_line_each(capsys):
    assert exit_code("new") == 0
    shown = capsys.readouterr().out
    for name in ("punch", "moulds", "drape", "coupon"):
        assert re.search(rf"^ *{name} +[A-Z].*\. *$", shown, flags=re.MULTILINE), name


def test_a_file_that_exists_is_never_overwritten(moulds, capsys):
    assert exit_code("new", "coupon") == 0
    file = Path("coupon/scene.toml")
    file.write_text("mine")
    for out in ([], ["--out", "coupon"], ["--out", "coupon/scene.toml"]):
        assert exit_code("new", "coupon", *out) == 2
        assert "coupon/scene.toml: exists already" in capsys.readouterr().err.replace("\\", "/")
    assert file.read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["punch", "--preset", "MD60"], "--preset: there is no preset"),
        (["punch", "--gap", "1 mm"], "--gap: is 1 mm, but the fabric"),
        (["punch", "--blank-size", "150 mm"], "--blank-size: is 150 mm, but the hole"),
        (["punch", "--punch-radius", "75"], "--punch-radius: "),
        (["coupon", "--blank-size", "1 2 3 mm"], "more than two sides"),
        (["coupon", "--fibre-angle", "45 mm"], "--fibre-angle: "),
        (["coupon", "--edge-length", "50 mm"], "blank.edge_length: is 50 mm, larger"),
        (["drape", "--shape", "cube"], '--shape: "cube" must be one of sphere'),
        (["drape", "--form", "no.stl"], "no.stl: there is no such file"),
        (["moulds", "--upper", "no.stl", "--lower", "lower.stl"], "no.stl: there is no such file"),
        (["moulds", *CASES["moulds"], "--length-unit", "kg"], "--length-unit: "),
    ],
)  # fmt: skip
def test_wrong_options_are_told_and_nothing_is_written(moulds, capsys, arguments, told):
    before = sorted(moulds.rglob("*"))
    assert exit_code("new", *arguments) == 2
    assert told in capsys.readouterr().err
    assert sorted(moulds.rglob("*")) == before


# --- moulds ---------------------------------------------------------------------------------------


def test_files_are_named_relative_to_the_scene_whatever_their_name(moulds):
    folder = moulds / 'a "strange" name é'
    folder.mkdir()
    (moulds / "lower.stl").rename(folder / "lower.stl")
    arguments = ["--upper", "upper.stl", "--lower", folder / "lower.stl", "--out", "deep/er/s.toml"]
    assert exit_code("new", "moulds", *arguments) == 0
    scene = read_scene("deep/er/s.toml")
    assert [tool.shape.file for tool in scene.tools] == [
        '../../a "strange" name é/lower.stl',
        "../../upper.stl",
    ]


def test_the_blank_covers_the_moulds_and_the_stroke_closes_them(moulds):
    scene = read_scene(new("moulds"))
    lower, upper = scene.tools
    # two thicknesses off the rim at each side, in whole millimetres
    assert scene.blank.size == (0.115, 0.085)
    assert lower.position == (-0.2, 0.03, 0.0)
    top = 5.0 + 0.1 + THICKNESS + 0.1
    assert scene.blank.height == pytest.approx(1e-3 * (5.1 + 0.5 * THICKNESS))
    # the lowest point of the upper mould, the bottom of its pan, starts above the blank
    assert upper.position == pytest.approx((-0.2, 0.03, 1e-3 * (top - (45.0 - 8.0))), abs=1e-6)
    closed = upper.position[2] - upper.motion.distance
    # equal shapes: the vertical distance at the steepest wall is the thickness over its cosine
    steepest = math.atan(8.0 * 1.875 / 25.0)
    assert 40.0 + 1e3 * closed == pytest.approx(THICKNESS / math.cos(steepest), rel=0.01)


def surface(path: Path, points: np.ndarray):
    write_stl(path, points)
    return read_surface(path, "mm")


@pytest.mark.parametrize("slope", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("gap", [0.2, 1.0, 5.0])
def test_roofs_close_to_the_gap_over_the_cosine_of_their_slope(tmp_path, slope, gap):
    rise = math.tan(math.radians(slope))
    lower = surface(tmp_path / "l.stl", grid(lambda x, y: -rise * abs(x) + 0 * y, count=(3, 2)))
    raised = grid(lambda x, y: 17.0 - rise * abs(x) + 0 * y, count=(3, 2))
    closing = close_moulds(surface(tmp_path / "u.stl", raised), lower, 1e-3 * gap)
    assert 1e3 * closing.lift + 17.0 == pytest.approx(gap / math.cos(math.radians(slope)), rel=2e-3)
    assert math.degrees(closing.slope) == pytest.approx(slope, abs=1e-3)


def test_moulds_that_are_apart_by_the_gap_already_stay_where_they_are(tmp_path):
    lower = surface(tmp_path / "l.stl", grid(lambda x, y: 0.0 * x))
    upper = surface(tmp_path / "u.stl", grid(lambda x, y: 1.5 + 0.0 * x))
    assert close_moulds(upper, lower, 1.5e-3).lift == pytest.approx(0.0, abs=2e-6)


def test_walls_that_are_too_near_are_told(moulds, capsys):
    def trough(x, y):  # walls of 84 degrees, 20 mm deep
        return -20.0 * np.clip((32.0 - abs(x)) / 2.0, 0.0, 1.0) + 0.0 * y

    def write(lift):
        write_stl(moulds / "lower.stl", grid(trough, count=(121, 3)))
        upper = grid(lambda x, y: lift + trough(x, y), count=(121, 3))
        write_stl(moulds / "upper.stl", upper, turned=True)

    write(5.0)
    assert exit_code("new", "moulds", *CASES["moulds"]) == 0
    told = capsys.readouterr().out
    assert "meet first at a wall of 84 deg" in told and "walls are nearer than 1.004 mm" in told


@pytest.mark.slow  # manual/test_texts.py reads the page, others run moulds
def test_the_moulds_of_the_manual_make_the_scene_that_it_tells_of(tmp_path, monkeypatch, capsys):
    text = read_page("new").text
    (script,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (line,) = re.findall(r"^lcmchain (new moulds .* --out box/scene.toml)$", text, re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    exec(script, {})
    assert exit_code(*shlex.split(line)) == 0
    (stroke,) = re.findall(r"Closed after ([\d.]+ mm)", capsys.readouterr().out)
    report = check_scene(read_scene("box/scene.toml"))
    assert f"closed after {stroke}" in text and report.warnings == []
    x, y = report.scene.blank.size
    assert f"{1e3 * x:g} mm x {1e3 * y:g} mm" in text
    assert f"The {report.element_count:,} elements" in text


def test_moulds_that_pass_each_other_are_refused(tmp_path):
    lower = surface(tmp_path / "l.stl", grid(pan))
    beside = surface(tmp_path / "u.stl", grid(pan, offset=(500.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="passes the lower mould without coming nearer"):
        close_moulds(beside, lower, 1e-3)


def test_edge_lengths_are_round_numbers():
    lengths = [round_edge_length(length) for length in (7.5e-3, 4e-3, 1e-3, 9.9e-2, 2.4e-4)]
    assert lengths == pytest.approx([5e-3, 2.5e-3, 1e-3, 5e-2, 2e-4])
