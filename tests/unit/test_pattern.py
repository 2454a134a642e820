"""Sections, draw-in, trimming line and flat pattern of sheets that are laid by hand."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
import xarray as xr

from lcmchain.cli import main
from lcmchain.errors import InputError
from lcmchain.fields import write_forming_netcdf
from lcmchain.mesh.blank import Blank, build_blank
from lcmchain.mesh.mid_surface import MidSurfaceMesh
from lcmchain.pattern import flat
from lcmchain.pattern.flat import flat_pattern, miss, sampled, trimming_line
from lcmchain.pattern.formed import FormedSheet
from lcmchain.pattern.tables import read_line, rim_table, section_table, write_line
from lcmchain.scene import scene_from_text

RADIUS = 0.1  # of the cylinder that sheets are bent around [m]


def mesh_of(**entries):
    given = {"size": (0.12, 0.08), "edge_length": 4e-3} | entries
    return MidSurfaceMesh.of_blank(build_blank(Blank(**given), 1e-3))


def result_of(mesh, formed, **fields):
    """A result of one saved frame."""
    sheet = xr.Dataset({"sheet_face_nodes": (("face", "corner"), mesh.sheet_faces)})
    sheet["time"] = ("time", [0.0])
    for k, axis in enumerate("xyz"):
        sheet[f"reference_position_{axis}"] = ("node", mesh.node_positions[:, k])
        moved = formed[:, k] - mesh.node_positions[:, k]
        sheet[f"displacement_{axis}"] = (("time", "node"), moved[None])
    for name, values in fields.items():
        sheet[name] = (("time", "face"), values[None])
    return sheet


def bent(points):
    """Points (n, 3) of a flat sheet bent about the y axis."""
    angle = points[:, 0] / RADIUS
    return np.stack([RADIUS * np.sin(angle), points[:, 1], RADIUS * np.cos(angle)], axis=1)


def test_a_section_has_the_length_of_the_sheet_and_the_fields_of_its_elements():
    mesh = mesh_of()
    centres = mesh.node_positions[mesh.elements].mean(axis=1)
    thickness = 1e-3 * (1.0 + centres[:, 0])
    sheet = result_of(mesh, bent(mesh.node_positions), thickness=thickness)
    table = section_table(sheet, np.array([0.0, 0.001, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert len(table["element"]) == 30 and (table["strip"] == 0).all()
    chord = 2.0 * RADIUS * np.sin(0.5 * 4e-3 / RADIUS)
    assert np.diff(table["length [m]"]) == pytest.approx(chord, rel=1e-9)
    assert table["length [m]"][0] == pytest.approx(0.5 * chord, rel=1e-9)
    assert table["thickness [m]"] == pytest.approx(thickness[table["element"]])
    way = np.sign(table["x [m]"][-1] - table["x [m]"][0])
    assert (np.diff(table["x [m]"]) * way > 0.0).all()
    assert "shear angle [rad]" not in table  # a field that the result does not have
    with pytest.raises(InputError, match="misses the sheet"):
        section_table(sheet, np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def test_a_section_through_a_hole_has_two_strips():
    square = ((-0.02, -0.02), (0.02, -0.02), (0.02, 0.02), (-0.02, 0.02))
    mesh = mesh_of(holes=(square,))
    table = section_table(
        result_of(mesh, mesh.node_positions), np.array([0.0, 0.001, 0.0]), np.array([0.0, 1.0, 0.0])
    )
    assert np.bincount(table["strip"]).tolist() == [10, 10]
    for strip in (0, 1):
        length = table["length [m]"][table["strip"] == strip]
        assert length[[0, -1]] == pytest.approx([2e-3, 0.038], abs=1e-9)


def test_the_draw_in_is_the_way_inward_of_the_outer_rim():
    """A sheet that shrinks by a tenth in x: its ends move in, its sides along themselves."""
    square = ((-0.02, -0.02), (0.02, -0.02), (0.02, 0.02), (-0.02, 0.02))
    mesh = mesh_of(holes=(square,))
    table = rim_table(result_of(mesh, mesh.node_positions * [0.9, 1.0, 1.0]))
    assert len(table["length [m]"]) == 2 * (30 + 20)
    assert table["length [m]"][-1] == pytest.approx(0.4 - 4e-3, rel=1e-9)
    x, y = table["flat x [m]"], table["flat y [m]"]
    sides = (np.abs(np.abs(x) - 0.06) < 1e-9) & (np.abs(y) < 0.039)
    ends = (np.abs(np.abs(y) - 0.04) < 1e-9) & (np.abs(x) < 0.059)
    assert table["draw-in [m]"][sides] == pytest.approx(0.006, rel=1e-9)
    assert table["draw-in [m]"][ends] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(table["along the rim [m]"][ends]) == pytest.approx(0.1 * np.abs(x[ends]))


def test_a_trimming_line_on_a_cylinder_is_its_development():
    mesh = mesh_of(edge_length=2e-3)
    sheet = FormedSheet.of_result(result_of(mesh, bent(mesh.node_positions)))
    net = np.array([[-0.04, -0.03], [0.04, -0.03], [0.04, 0.03], [-0.04, 0.03]])
    flat = trimming_line(sheet, net)
    x = RADIUS * np.arcsin(0.04 / RADIUS)
    expected = shapely.box(-x, -0.03, x, 0.03).exterior
    # second order in the edge length: chords lie inside the arc
    assert shapely.hausdorff_distance(shapely.LinearRing(flat), expected) < 2e-5
    assert sheet.to_formed(flat)[:, :2] == pytest.approx(sampled(net, 2e-3), abs=1e-12)
    with pytest.raises(InputError, match="does not lie on the formed sheet"):
        trimming_line(sheet, 2.0 * net)


def squeezed(factor):
    """A forming whose draw-in depends on the blank: the larger it is, the less it is drawn in."""

    def form(outline):
        points = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
        outline = points if outline is None else outline
        mesh = mesh_of(size=None, outline=tuple(map(tuple, outline)), edge_length=5e-3)
        size = np.ptp(outline, axis=0).max()
        flat = mesh.node_positions
        shrink = 1.0 - factor * (0.3 - size)
        formed = flat * [shrink, shrink * (1.0 - flat[:, :1].mean()), 1.0]
        formed[:, 0] += 0.3 * flat[:, 1] ** 2  # and bent in the plane
        return FormedSheet.of_result(result_of(mesh, formed))

    return form


def test_the_outline_of_a_flat_pattern_meets_the_wanted_rim():
    angle = 2.0 * np.pi * np.arange(90) / 90
    net = 0.06 * np.stack([np.cos(angle), 0.8 * np.sin(angle)], axis=1)
    rounds = flat_pattern(net, squeezed(1.0), tolerance=1e-6, most_rounds=12)
    misses = [one.miss for one in rounds]
    assert misses[0] > 3e-3  # the trimming line alone misses by the change of the draw-in
    assert misses[-1] < 1e-6
    assert miss(rounds[-1].rim, net) < 2e-4  # chords of the samples
    ratio = np.array(misses[1:4]) / misses[:3]
    assert (ratio < 0.35).all()  # linear convergence, by how far the draw-in follows the blank


def test_lines_are_sampled_between_their_corners():
    square = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.05], [0.0, 0.05]])
    line = sampled(square, 0.01)
    assert len(line) == 30
    assert all((np.abs(line - corner).max(axis=1) < 1e-12).any() for corner in square)


@pytest.mark.parametrize("name", ["net.csv", "net.dxf"])
def test_lines_are_written_and_read(tmp_path, name):
    line = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.05], [0.0, 0.05]])
    write_line(tmp_path / name, line)
    assert read_line(tmp_path / name, None) == pytest.approx(line)
    if name.endswith("csv"):
        assert read_line(tmp_path / name, "mm") == pytest.approx(1e-3 * line)
    (tmp_path / name).write_text("a part\n")
    with pytest.raises(InputError, match="no DXF drawing"):
        read_line(tmp_path / name, None)


def test_a_table_of_a_line_says_its_unit_and_needs_no_heading(tmp_path):
    net, line = tmp_path / "net.csv", np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.05], [0.0, 0.05]])
    rows = "0{0}0\n100{0}0\n100{0}50\n0{0}50\n"
    for heading, mark in (("x [mm],y [mm]", ","), ("x (mm);y (mm)", ";")):
        net.write_text(f"{heading}\n{rows.format(mark)}")
        assert read_line(net, None) == pytest.approx(line)
        assert read_line(net, "cm") == pytest.approx(10.0 * line)
    net.write_text(rows.format(","))  # all four corners, the first one too
    assert read_line(net, "mm") == pytest.approx(line)
    net.write_text(f"x [mn],y [mn]\n{rows.format(',')}")
    with pytest.raises(InputError, match='heading: unknown unit "mn"'):
        read_line(net, None)
    net.write_text("x [mm];y [mm]\n0,5;0,5\n1,5;0,5\n1,5;1,5\n")
    with pytest.raises(InputError, match="with a decimal point"):
        read_line(net, None)


def exit_code(arguments):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    return caught.value.code


def test_the_commands_write_tables(tmp_path, capsys):
    mesh = mesh_of()
    source = tmp_path / "forming.nc"
    sheet = result_of(mesh, bent(mesh.node_positions), thickness=np.full(mesh.element_count, 1e-3))
    write_forming_netcdf(source, {"/": sheet})
    table = tmp_path / "section.csv"
    given = ["--point", "0 1 0 mm", "--normal", "0 1 0"]
    assert exit_code(["pattern", "section", str(source), *given, "--out", str(table)]) == 0
    with open(table, newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0][:3] == ["strip", "length [m]", "x [m]"] and len(rows) == 31
    rim = tmp_path / "rim.csv"
    assert exit_code(["pattern", "draw-in", str(source), "--out", str(rim)]) == 0
    assert len(rim.read_text().splitlines()) == 101
    net = tmp_path / "net.csv"
    net.write_text("x,y\n-40,-30\n40,-30\n40,30\n-40,30\n")
    line = tmp_path / "flat.dxf"
    trim = ["pattern", "trim", str(source), "--net", str(net), "--out", str(line)]
    assert exit_code([*trim, "--length-unit", "mm"]) == 0
    assert np.ptp(read_line(line, None), axis=0)[1] == pytest.approx(0.06)
    assert exit_code(trim) == 2  # metres: far beyond the sheet
    assert "--net" in capsys.readouterr().err
    wrong = ["pattern", "section", str(source), "--normal", "up", "--out", str(table)]
    assert exit_code(wrong) == 2
    assert "--normal" in capsys.readouterr().err
    for frame in ("1", "-2"):
        late = ["pattern", "draw-in", str(source), "--frame", frame, "--out", str(rim)]
        assert exit_code(late) == 2
        assert "--frame: is" in capsys.readouterr().err


def groups_of_a_stack(mesh, formed):
    """Groups of a result whose ply "lower" has a group of its own."""
    lower = result_of(mesh, formed, thickness=np.full(mesh.element_count, 1e-3))
    root = lower.copy()
    root["body"] = ("face", np.zeros(mesh.element_count, dtype=np.int32))
    root["body"].attrs["flag_meanings"] = "lower"
    ply = lower.rename({"sheet_face_nodes": "lower_face_nodes", "face": "lower_face"})
    ply = ply.rename({"node": "lower_node"}).assign(lower=0)
    for k, axis in enumerate("xyz"):
        ply[f"lower_node_{axis}"] = ("lower_node", formed[:, k])
    return {"/": root, "/lower": ply}


def test_a_flat_pattern_is_found_of_a_ply_of_a_stack(tmp_path, monkeypatch):
    """Every round forms the stack with another outline of the ply, and reads the ply's group."""
    formed_with = []

    def form(scene, folder, progress):
        (ply,) = (one for one in scene.plies if one.name == "lower")
        formed_with.append(ply.outline)
        mesh = mesh_of() if ply.outline is None else mesh_of(size=None, outline=ply.outline)
        return SimpleNamespace(datasets=groups_of_a_stack(mesh, bent(mesh.node_positions)))

    monkeypatch.setattr(flat, "run", form)
    scene = scene_from_text("""
process = { time = "10 ms" }
material = { preset = "MD600" }
plies = [{ name = "lower", size = ["120 mm", "80 mm"], edge_length = "4 mm" },
         { name = "upper", size = ["120 mm", "80 mm"], edge_length = "4 mm" }]
""")
    net = np.array([[-0.04, -0.03], [0.04, -0.03], [0.04, 0.03], [-0.04, 0.03]])
    rounds = flat_pattern(net, flat.SceneForming(scene, tmp_path, "lower"), most_rounds=1)
    assert formed_with[0] is None and len(formed_with[1]) == len(rounds[-1].outline)
    # the sheet is bent about y: the net is as wide as the arc over it is long
    wide = np.ptp(rounds[-1].outline, axis=0)
    assert wide == pytest.approx([2.0 * RADIUS * np.arcsin(0.4), 0.06], rel=1e-3)


def test_the_commands_take_a_ply_of_a_stack(tmp_path, capsys):
    mesh = mesh_of()
    formed = bent(mesh.node_positions)
    source, table = tmp_path / "forming.nc", tmp_path / "table.csv"
    write_forming_netcdf(source, groups_of_a_stack(mesh, formed))
    out = ["--out", str(table)]
    assert exit_code(["pattern", "section", str(source), "--ply", "lower", *out]) == 0
    assert len(table.read_text().splitlines()) == 31
    assert exit_code(["pattern", "draw-in", str(source), "--ply", "lower", *out]) == 0
    assert len(table.read_text().splitlines()) == 101
    for ply in ([], ["--ply", "upper"]):
        assert exit_code(["pattern", "draw-in", str(source), *ply, *out]) == 2
        assert "lower" in capsys.readouterr().err
