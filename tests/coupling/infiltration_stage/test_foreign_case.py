"""Meshes that were not formed here, permeabilities with axes of their own, and cases of RTMsim."""

from decimal import Decimal

import meshio
import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.coupling.infiltration.foreign_case import case_text, read_lcmsim, read_rtmsim
from lcmchain.coupling.infiltration.formed_part import unformed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import FillOptions, fill, map_and_fill
from lcmchain.errors import InputError
from lcmchain.scene.reading.single_tables import infiltration_from_text

from .conftest import strip

# As RTMsim's own example: a comment behind every line, the mesh in a folder beside.
INPUT = """\
1    #i_model
meshes\\strip.bdf    #meshfilename
150    #tmax
1.01325e5 1.225 1.4 0.06    #p_ref rho_ref gamma mu_resin_val
1.35e5 1.0e5    #p_a_val p_init_val
3e-3 0.7 3e-10 0.5 1 0 0    #t_val porosity_val K_val alpha_val refdir1_val refdir2_val refdir3_val
3e-3 0.7 3e-10 1 1 0 0    #t1_val ...
2e-3 0.6 1e-10 0.25 1 1 0    #t2_val ...
3e-3 0.7 3e-10 1 1 0 0    #t3_val ...
3e-3 0.7 3e-10 1 1 0 0    #t4_val ...
1 2 0 0    #patchtype1val patchtype2val patchtype3val patchtype4val
0 results.jld2    #i_restart restartfilename
0 0.01    #i_interactive r_p
16    #n_pics
"""
BY_HAND = """
time = "2.5 min"
resin = { law = "constant", viscosity = "60 mPa*s" }
vent_pressure = "1 bar"
frames = 17

[preform]
thickness = "3 mm"
fibre_volume_fraction = 0.3
permeability = { k1 = "300 um^2", ratio = 0.5 }
sets_hold = "cells"

[[gates]]
name = "set1"
set = "SET 1"
pressure = "1.35 bar"

[[regions]]
name = "set2"
set = "SET 2"
thickness = "2 mm"
fibre_volume_fraction = 0.4
own_permeability = { k1 = "1e-10 m^2", ratio = 0.25, axis = [1, 1, 0] }

[[vents]]
name = "rim"
rim = true
except_gates = true
"""
COLUMNS, ROWS, EDGE = 12, 4, 0.025
PLAIN = FillOptions(picture=False, vtu=False)


def strip_text(sets=(), parts=None, lift=0.0):
    """Write a strip of triangles as a Nastran deck, with sets of its columns of cells.

    parts : number of the part of each column, 1 by default. lift : slope of the strip, z over x.
    """
    number = np.arange((COLUMNS + 1) * (ROWS + 1)).reshape(COLUMNS + 1, ROWS + 1) + 1
    columns = np.repeat(np.arange(COLUMNS), 2 * ROWS)
    lines = []
    for k, own in enumerate(sets, start=1):
        ids = [str(i + 1) for i in np.flatnonzero(np.isin(columns, own))]
        groups = [",".join(ids[i : i + 6]) for i in range(0, len(ids), 6)]
        lines += [f"SET {k} = {groups[0]}" + ("," if len(groups) > 1 else "")]
        lines += [f"        {g}," for g in groups[1:-1]] + [f"        {g}" for g in groups[1:][-1:]]
    for i in range(COLUMNS + 1):
        for j in range(ROWS + 1):
            x, y = EDGE * i, EDGE * j
            lines.append(f"GRID    {number[i, j]:8d}        {x:8.4f}{y:8.4f}{lift * x:8.4f}")
    cell = 0
    for i in range(COLUMNS):
        for j in range(ROWS):
            a, b, c, d = number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]
            for corners in ((a, b, c), (a, c, d)):
                cell += 1
                part = 1 if parts is None else parts[i]
                lines.append(f"CTRIA3  {cell:8d}{part:8d}" + "".join(f"{n:8d}" for n in corners))
    return "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path):
    """Return a folder of RTMsim: input file and, one folder up, its meshes."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "inputs").mkdir()
    text = strip_text(([0], [6, 7, 8], [11]))
    (tmp_path / "meshes" / "strip.bdf").write_text(text, encoding="ascii")
    (tmp_path / "inputs" / "input.txt").write_text(INPUT, encoding="utf-8")
    return tmp_path


def filled(mesh, text, out):
    case = infiltration_from_text(text)
    map_and_fill(mesh, None, case, name="part", out_dir=out, options=PLAIN)
    groups = {}
    for group in (None, "history"):
        with xr.open_dataset(out / "part_filling.nc", group=group, decode_times=False) as opened:
            groups[group] = opened.load()
    return groups


# --- RTMsim ---------------------------------------------------------------------------------------


def test_a_case_of_rtmsim_fills_as_the_same_case_written_by_hand_bit_for_bit(folder, tmp_path):
    case = tmp_path / "case.toml"
    result = CliRunner().invoke(
        app, ["import", "rtmsim", str(folder / "inputs" / "input.txt"), "--out", str(case)]
    )
    assert result.exit_code == 0, result.output
    mesh = folder / "meshes" / "strip.bdf"
    said = " ".join(result.output.split())
    assert 'inlet "set1": SET 1 of strip.bdf' in said and "not taken over: p_ref" in said
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    imported = filled(mesh, case.read_text(encoding="utf-8"), tmp_path / "a")
    by_hand = filled(mesh, BY_HAND, tmp_path / "b")
    assert float(imported[None]["fill_time"].max()) > 20.0
    for group in imported:
        assert set(imported[group].variables) == set(by_hand[group].variables)
        for name, values in imported[group].variables.items():
            if values.dtype.kind in "fiu":
                np.testing.assert_array_equal(values.values, by_hand[group][name].values, name)
    # and it is not the case of another axis
    other = filled(mesh, BY_HAND.replace("axis = [1, 1, 0]", "axis = [1, -1, 0]"), tmp_path / "b")
    assert not np.array_equal(other[None]["fill_time"].values, imported[None]["fill_time"].values)


def test_what_is_wrong_in_an_input_file_is_told_by_its_line(folder):
    path = folder / "inputs" / "input.txt"

    def refused(old, new, said, text=INPUT):
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError, match=said):
            read_rtmsim(path)

    refused("16    #n_pics\n", "", "has 13 lines with entries; .* has 14")
    refused("1 2 0 0    #patch", "1 2 0 7    #patch", "line 11: patch type 4 is none of 0 to 3")
    refused("1 2 0 0    #patch", "1 2 0 2    #patch", 'no cells of "set4", number 4 of input.txt')
    refused("1 2 0 0    #patch", "0 2 0 0    #patch", "names no inlet")
    refused("3e-3 0.7 3e-10 0.5", "3e-3 1.7 3e-10 0.5", "line 6: .* a porosity lies between")
    refused("3e-3 0.7 3e-10 0.5", "3e-3 0.7 3e-1O 0.5", 'line 6: "3e-1O" is not a number')
    refused("strip.bdf", "other.bdf", 'names the mesh "meshes/other.bdf".*--mesh')
    refused("1.35e5 1.0e5", "1.35e5", "line 5 has 1 entries; 2 are needed")
    refused("16    #n_pics", "1.5    #n_pics", "line 14: 1.5 is no whole number")


def test_what_an_input_file_has_and_is_not_done_is_told_by_its_name(folder):
    path = folder / "inputs" / "input.txt"
    text = INPUT.replace("1    #i_model", "3   #i_model").replace("0 results", "1 results")
    path.write_text(text.replace("1.0e5    #p_a", "1.0e5 1.2 960    #p_a"), encoding="utf-8")
    case = read_rtmsim(path)
    words = " | ".join(case.told)
    for name in ("gamma", "i_model = 3 (porosity_1, p_1)", "i_restart = 1 of results.jld2"):
        assert name in words
    assert infiltration_from_text(case_text(case)).resin.density == 960.0


# --- LCMsim ---------------------------------------------------------------------------------------

PARTS = """\
name,type,part_id,thickness,porosity,porosity_noise,permeability,permeability_noise,alpha,refdir1,\
refdir2,refdir3,porosity_1,p_1,thickness_DM
base,base,1,3.00e-3,0.583,0.0,96.6e-12,0.0,0.400,1,0,0,0.583,0.5e5,0.0
hose,inlet,2,3.00e-3,0.583,0.0,96.6e-12,0.0,0.400,1,0,0,0.583,0.5e5,0.0
patch,patch,3,3.00e-3,0.393,0.0,1.2e-12,0.1,12.75,1,0,0,0.45,0.5e5,1e-3
end,outlet,4,3.00e-3,0.583,0.0,96.6e-12,0.0,0.400,1,0,0,0.583,0.5e5,0.0
"""
PARAMETERS = "p_ref,rho_ref,gamma,mu_resin,p_a,p_init,rho_0_air,rho_0_oil\n"
PARAMETERS += "1.01325e5,1.225,1.4,0.062,1.91e5,1.0e5,1.2,960\n"


def lcmsim(folder, parts=PARTS, mesh=None):
    (folder / "parts.csv").write_text(parts, encoding="utf-8")
    (folder / "parameters.csv").write_text(PARAMETERS, encoding="utf-8")
    text = strip_text(parts=[2, *[1] * 4, 3, 3, *[1] * 4, 4]) if mesh is None else mesh
    (folder / "strip.bdf").write_text(text, encoding="ascii")
    return read_lcmsim(
        folder / "parts.csv", folder / "parameters.csv", folder / "strip.bdf", Decimal("60")
    )


@pytest.mark.parametrize("by_sets", [False, True])
def test_a_table_of_lcmsim_gives_its_parts_their_cells_and_properties(tmp_path, by_sets):
    mesh = strip_text(([0], [5, 6], [11])) if by_sets else None
    found = lcmsim(tmp_path, mesh=mesh)
    case = infiltration_from_text(case_text(found))
    setup = set_up(unformed_part(tmp_path / "strip.bdf", case.preform), case)
    column = np.repeat(np.arange(COLUMNS), 2 * ROWS)
    patch = np.isin(column, (5, 6))
    k1 = np.where(patch, 12.75 * 1.2e-12, 96.6e-12)  # the larger one first
    assert np.array_equal(setup.part.cell("permeability_1"), k1)
    assert setup.part.cell("permeability_2") == pytest.approx(
        np.where(patch, 1.2e-12, 0.4 * 96.6e-12), rel=1e-15
    )
    across = setup.preform.permeability[patch][:, 1, 1]
    assert across == pytest.approx(12.75 * 1.2e-12, rel=1e-12)
    assert setup.preform.porosity[patch] == pytest.approx(0.393, abs=1e-15)
    assert np.unique(setup.mesh.points[setup.gates[0].nodes, 0]) == pytest.approx([0.0, EDGE])
    assert np.unique(setup.mesh.points[setup.vents[0].nodes, 0]) == pytest.approx([0.275, 0.3])
    assert setup.resin_density == 960.0 and case.gates[0].pressure == (1.91e5,)
    assert not any("stays as mapped" in warning for warning in setup.warnings)
    words = " | ".join(found.told)
    for name in ("permeability_noise of patch", "porosity_1", "thickness_DM", "rho_0_air"):
        assert name in words
    assert "of base" not in words


DM = "permeability_Z,thickness_DM,porosity_DM,permeability_DM,permeability_DM_Z"


def with_layer(on, of_layer="1e-3,0.8,3e-9,1e-9", through="2e-12"):
    """Return the table with a flow medium on the parts of these numbers."""
    head, *rows = PARTS.replace("thickness_DM", DM).splitlines()
    rows = [row.rpartition(",")[0] for row in rows]
    own = {k: of_layer if k in on else "0.0,0.8,3e-9,0.0" for k in range(1, 5)}
    return "\n".join([head, *(f"{row},{through},{own[k]}" for k, row in enumerate(rows, 1))]) + "\n"


def test_a_flow_medium_of_lcmsim_becomes_one_here(tmp_path):
    for on, covered in (((1, 2, 3, 4), 2 * COLUMNS * ROWS), ((3,), 4 * ROWS)):
        found = lcmsim(tmp_path, with_layer(on))
        case = infiltration_from_text(case_text(found))
        setup = set_up(unformed_part(tmp_path / "strip.bdf", case.preform), case)
        layer = setup.flow_medium
        assert layer is not None and len(layer.cells) == covered
        assert (layer.thickness, layer.porosity) == (1e-3, 0.8)
        assert layer.permeability[0, 0, 0] == pytest.approx(3e-9, rel=1e-12)
        assert setup.preform.through_permeability == pytest.approx(2e-12, rel=1e-12)
        assert "permeability_DM_Z" in " ".join(found.told)


def test_a_flow_medium_of_lcmsim_that_is_not_taken_over_is_told(tmp_path):
    for parts, said in (
        (with_layer((1, 2)), "on several parts but not on all"),
        (with_layer((1, 2, 3, 4)).replace("2e-12,1e-3", "4e-12,1e-3", 1), "differ from part"),
        (PARTS, "permeability_Z are needed"),
    ):
        found = lcmsim(tmp_path, parts)
        assert said in " ".join(found.told) and "flow_medium]\n" not in case_text(found)
    with pytest.raises(InputError, match="permeability_Z too"):
        lcmsim(tmp_path, with_layer((1, 2, 3, 4), through="0.0"))


def test_a_wrong_table_of_lcmsim_is_refused_by_name(tmp_path):
    for old, new, said in (
        ("base,base", "base,main", 'line 2: the type "main" is none of base'),
        ("base,base", "base,patch", "has no part of the type base"),
        ("alpha", "beta", "has no column alpha"),
        ("end,outlet,4", "end,outlet,9", 'has no cells of "end", number 9 of parts.csv'),
        ("end,outlet,4", "end,outlet,4.5", "line 5, part_id: 4.5 is no whole number"),
        ("end,outlet", "hose,outlet", 'line 5: the part has the name "hose" of another one'),
        ("1.2e-12", "x", 'line 4, permeability: "x" is not a number'),
    ):
        with pytest.raises(InputError, match=said):
            lcmsim(tmp_path, PARTS.replace(old, new))
    with pytest.raises(InputError, match="line 3 has more cells than the header"):
        lcmsim(tmp_path, PARTS.replace("hose,inlet,2,3.00e-3", "hose,inlet,2,3,00e-3"))
    lcmsim(tmp_path, PARTS.replace("0.583,0.5e5,0.0\n", "0.583,0.5e5,0.0,\n"))  # empty cells
    found = lcmsim(tmp_path, PARTS.replace("hose,", '1st "hose",'))
    assert 'name of 1st "hose": the part is "part_1st_hose" in the case' in found.told
    assert infiltration_from_text(case_text(found)).gates[0].name == "part_1st_hose"


# --- entries of the case --------------------------------------------------------------------------

CASE = """
time = "1 h"
resin = {{ law = "constant", viscosity = "0.1 Pa*s" }}
preform = {{ thickness = "2 mm", fibre_volume_fraction = 0.5, permeability = {base} }}
gates = [{{ name = "left", box = ["0 0 -1 m", "0 1 1 m"], pressure = "2 bar" }}]
vents = [{{ name = "rim", rim = true, except_gates = true }}]
regions = [{{ name = "rear", box = ["0.15 0 -1 m", "1 1 1 m"], own_permeability = {rear} }}]
"""


@pytest.mark.parametrize("lift", [0.0, 0.75])
def test_two_zones_with_axes_of_their_own_fill_in_the_closed_time(tmp_path, lift):
    mesh = tmp_path / "strip.bdf"
    mesh.write_text(strip_text(lift=lift), encoding="ascii")
    # along the strip: 2e-10 by its second axis, then 0.4e-10 by its first
    text = CASE.format(
        base='{ k1 = "4e-10 m^2", ratio = 0.5, axis = [0, 1, 0] }',
        rear='{ k1 = "0.4e-10 m^2", ratio = 3.0, axis = [1, 0, 0] }',
    )
    text = text.replace("rim = true, except_gates = true", 'box = ["0.3 0 -1 m", "1 1 1 m"]')
    case = infiltration_from_text(text)
    found = fill(unformed_part(mesh, case.preform), case)
    length = 0.15 * np.hypot(1.0, lift)
    k, rear = 2e-10, 0.4e-10
    exact = 0.1 * 0.5 / 2e5 * length**2 * (1.0 / (2.0 * k) + 1.0 / k + 1.0 / (2.0 * rear))
    end = float(np.nanmax(found.fill_time))
    # twelve columns; an axis that is turned, or a ratio left out, is off by a fifth and more
    assert end == pytest.approx(exact, rel=0.01)


def test_the_rim_vents_but_where_a_gate_lies_on_it(tmp_path):
    mesh = tmp_path / "strip.bdf"
    mesh.write_text(strip_text(), encoding="ascii")
    text = CASE.format(base='{ k1 = "4e-10 m^2" }', rear='{ k1 = "4e-10 m^2" }')
    case = infiltration_from_text(text)
    setup = set_up(unformed_part(mesh, case.preform), case)
    rim = 2 * (COLUMNS + ROWS)
    assert len(setup.gates[0].nodes) == ROWS + 1
    assert len(setup.vents[0].nodes) == rim - ROWS - 1
    assert not np.intersect1d(setup.gates[0].nodes, setup.vents[0].nodes).size
    with pytest.raises(InputError, match='shares 5 nodes with the vent "rim"'):
        other = infiltration_from_text(text.replace(", except_gates = true", ""))
        set_up(unformed_part(mesh, other.preform), other)
    with pytest.raises(InputError, match="except_gates: leaves no node"):
        both = infiltration_from_text(text.replace('"0 1 1 m"', '"1 1 1 m"'))
        set_up(unformed_part(mesh, both.preform), both)


def test_a_mesh_with_nodes_in_the_middle_of_edges_fills_as_by_its_corners(tmp_path):
    """Quadratic shells, a node of no cell before them, and a set that holds its middle nodes."""
    points, quads = strip(6, 2)
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, middle = np.unique(edges, axis=0, return_inverse=True)
    everything = np.vstack([points, points[edges].mean(axis=1)])
    shells = np.hstack([quads, len(points) + middle.reshape(-1, 4)])
    left = np.flatnonzero(everything[:, 0] == 0.0)
    rows = ["*NODE", "7, 1., 1., 1."]
    rows += [f"{n + 10}, " + ", ".join(f"{x:.17g}" for x in p) for n, p in enumerate(everything)]
    rows += ["*ELEMENT, TYPE=S8R, ELSET=ALL"]
    rows += [f"{c + 1}, " + ", ".join(str(n + 10) for n in s) for c, s in enumerate(shells)]
    rows += ["*NSET, NSET=LEFT", ", ".join(str(n + 10) for n in left), ""]
    deck, plain = tmp_path / "strip.inp", tmp_path / "strip.vtu"
    deck.write_text("\n".join(rows), encoding="ascii")
    meshio.write(plain, meshio.Mesh(points, [("quad", quads)]))
    text = CASE.format(base='{ k1 = "4e-10 m^2" }', rear='{ k1 = "1e-10 m^2" }')
    place = 'box = ["0 0 -1 m", "0 1 1 m"]'
    by_corners = filled(plain, text, tmp_path)[None]
    found = filled(deck, text.replace(place, 'set = "LEFT"'), tmp_path)[None]
    assert place in text and len(left) == 5
    assert found["fill_time"].values.tolist() == by_corners["fill_time"].values.tolist()
    assert found["gate_left"].values.tolist() == by_corners["gate_left"].values.tolist()


@pytest.mark.parametrize("axis", ["", ", axis = [0, 0, 1]"])
def test_a_wall_that_the_axis_is_normal_to_needs_none_where_all_directions_are_alike(
    tmp_path, axis
):
    """A floor, and a wall that stands on it at right angles to x, the axis of every default."""
    points, quads = strip(6, 2)
    points[:, 2] = np.maximum(points[:, 0] - 0.15, 0.0)
    points[:, 0] = np.minimum(points[:, 0], 0.15)
    bent = tmp_path / "bent.vtu"
    meshio.write(bent, meshio.Mesh(points, [("quad", quads)]))
    own = f'{{ k1 = "4e-10 m^2"{axis} }}'
    case = infiltration_from_text(CASE.format(base=own, rear=own))
    setup = set_up(unformed_part(bent, case.preform), case)
    normals = np.stack([np.eye(3)[2 if x < 0.15 else 0] for x in points[quads].mean(axis=1)[:, 0]])
    in_plane = np.eye(3) - np.einsum("ci,cj->cij", normals, normals)
    assert setup.preform.permeability == pytest.approx(4e-10 * in_plane, rel=1e-12, abs=1e-22)


def test_a_preform_is_refused_where_it_is_none(tmp_path, folder):
    mesh = tmp_path / "strip.bdf"
    mesh.write_text(strip_text(), encoding="ascii")
    text = CASE.format(
        base='{ k1 = "4e-10 m^2", ratio = 0.5, axis = [0, 0, 1] }', rear='{ k1 = "1e-10 m^2" }'
    )
    case = infiltration_from_text(text)
    with pytest.raises(
        InputError,
        match=r"^preform.permeability.axis: the axis \(0, 0, 1\) of the permeability stands on",
    ):
        unformed_part(mesh, case.preform)
    for more, said in (
        ('permeability = { law = "gebart", fibre_radius = "3 um" }', "permeability: is a law of"),
        ('closure = { type = "bag", pressure = "1 bar" }', "closure: presses by the law"),
    ):
        with pytest.raises(InputError, match=said):
            infiltration_from_text(more + text)
    result = tmp_path / "result"
    result.mkdir()
    filled(mesh, text.replace("[0, 0, 1]", "[1, 0, 0]"), result)
    good = infiltration_from_text(text.replace("[0, 0, 1]", "[1, 0, 0]"))
    with pytest.raises(InputError, match="preform: is of a mesh that was not formed, but this"):
        unformed_part(result / "part_filling.nc", good.preform)
