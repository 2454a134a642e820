"""A model of several bodies: laws and families beside each other, ranges, and their files."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import vtk
import xarray as xr
import xugrid

from lcmchain.elements.solid_shell.reference import ElementOptions
from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.elements.solid_shell.together import kinds_of
from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, model_datasets, read_group, write_forming_netcdf
from lcmchain.mesh.blank import build_blank
from lcmchain.mesh.mid_surface import triangulate
from lcmchain.model import Sheet, assemble_bodies
from lcmchain.scene import Contact, Element, MembraneShellElement, Process, scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.statics.problem import nodal_forces
from lcmchain.tools.table import build_tool_table

SCENE = """
title = "two sheets"
process = {{ time = "1 ms", frames = 3, gravity = true }}
blank = {{ size = ["20 mm", "10 mm"], edge_length = "5 mm", height = "{height} mm" }}
contact = {{ penalty = "20 N/mm^3" }}

[material]
{material}

[[tools]]
name = "lower"
shape = {{ type = "plate", side = "below" }}

[[tools]]
name = "upper"
shape = {{ type = "plate", side = "above" }}
position = "0 0 1.004 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "0.2 mm", profile = "linear" }}
"""
FABRIC = 'preset = "MD600"'
WITH_SET = 'law = "fabric-with-set"\npreset = "MD600"\ncompaction.permanent_set = 0.4'
RUBBER = """law = "isotropic"
name = "rubber"
thickness = "1.004 mm"
density = "1100 kg/m^3"
young_modulus = "2 MPa"
poisson_ratio = 0.4"""
STEP = 1e-6


def scene(material=FABRIC, height=0.502):
    return scene_from_text(SCENE.format(material=material, height=height))


def sheet(name, material, element=None, shift=0.0):
    """A sheet of the scene's blank, moved along x."""
    the_scene = scene(material)
    mesh = build_blank(the_scene.blank, the_scene.material.thickness)
    mesh = replace(mesh, node_positions=mesh.node_positions + [shift, 0.0, 0.0])
    element = element or Element()
    if element.type == "membrane-shell":
        mesh = triangulate(mesh)
    return Sheet(name, mesh, the_scene.material.build(), element)


def simulation(*sheets):
    the_scene = scene()
    model = assemble_bodies(
        sheets,
        tools=build_tool_table(the_scene.tools, None, the_scene.process.time),
        tool_names=[tool.name for tool in the_scene.tools],
        contact=the_scene.contact,
        process=the_scene.process,
    )
    return Simulation(model)


def advanced(sim, count=400):
    """The simulation after steps of one size, so that bodies do not meet through the step."""
    for _ in range(count // 20):
        sim.prepare_steps()
        sim.make_steps(20, STEP)
    return sim


SHEETS = {
    "two laws": [sheet("fabric", FABRIC), sheet("rubber", RUBBER, shift=0.1)],
    "two families, with and without memory": [
        sheet("fabric", FABRIC),
        sheet("set", WITH_SET, shift=0.1),
        sheet("flat", FABRIC, MembraneShellElement(), shift=0.2),
    ],
    "one law twice": [sheet("left", FABRIC), sheet("right", FABRIC, shift=0.1)],
    # sheets of one kind and mesh are one for the loop, also around others
    "one kind around others": [
        sheet("first", FABRIC),
        sheet("set", WITH_SET, shift=0.1),
        sheet("flat", FABRIC, MembraneShellElement(), shift=0.2),
        sheet("second", FABRIC),
    ],
}
#: What is formed: the families have two laws too, and the last one is of their loop.
FORMED = [case for case in SHEETS if case != "two laws"]


@pytest.mark.parametrize("case", FORMED)
def test_each_body_moves_as_it_does_alone(case):
    """Bit for bit: bodies that do not touch share the arrays and nothing else."""
    together = advanced(simulation(*SHEETS[case]))
    moved = np.abs(together.state.velocity).max(axis=0)
    for body, own in zip(together.model.bodies, SHEETS[case], strict=True):
        alone = advanced(simulation(own))
        nodes = slice(body.first_node, body.first_node + body.mesh.node_count)
        assert moved[nodes].max() > 1e-3
        for name in ("position", "velocity"):
            np.testing.assert_array_equal(
                getattr(together.state, name)[:, nodes], getattr(alone.state, name), err_msg=name
            )
        np.testing.assert_array_equal(
            together.model.history_of(body, together.state.history), alone.state.history
        )


def test_the_loop_of_several_bodies_holds_no_array_after_its_steps(references):
    sim = advanced(simulation(*SHEETS["two families, with and without memory"]), 20)
    before = references(sim)
    sim.make_steps(20, STEP)
    assert references(sim) == before


def test_energies_and_tool_forces_are_those_of_all_bodies():
    sheets = SHEETS["two families, with and without memory"]
    together = advanced(simulation(*sheets))
    alone = [advanced(simulation(own)) for own in sheets]
    np.testing.assert_allclose(
        together.state.tool_force, sum(sim.state.tool_force for sim in alone), rtol=1e-12
    )
    energies = together.energy()
    for name, value in energies.items():
        total = sum(sim.energy().get(name, 0.0) for sim in alone)  # one remembers nothing
        assert value == pytest.approx(total, rel=1e-9, abs=1e-12 * energies["external"])
    assert abs(energies["balance_error"]) < 0.02 * energies["external"]


def test_the_stiffest_body_sets_the_step_and_is_named():
    sheets = SHEETS["two laws"]
    together = simulation(*sheets)
    steps = [simulation(own).critical_step() for own in sheets]
    assert together.critical_step() == min(steps) == steps[0]
    together.prepare_steps()
    assert together.model.body_of_element(together.control.element).name == "fabric"
    backwards = simulation(sheet("rubber", RUBBER), sheet("fabric", FABRIC, shift=0.1))
    backwards.prepare_steps()
    assert backwards.control.element >= backwards.model.bodies[1].first_element
    assert backwards.model.body_of_element(backwards.control.element).name == "fabric"


def test_ranges_follow_each_other_without_gaps():
    model = simulation(*SHEETS["two families, with and without memory"]).model
    first, second, third = model.bodies
    assert (first.first_node, first.first_element) == (0, 0)
    assert (second.first_node, second.first_element) == (
        first.mesh.node_count, first.mesh.element_count
    )  # fmt: skip
    assert third.first_node == second.first_node + second.mesh.node_count
    assert third.first_element == second.first_element + second.mesh.element_count
    assert model.placed[0].last_force == model.placed[1].first_force
    assert model.placed[1].last_force == model.placed[2].first_force
    # bodies of one kind and mesh are one for the loop
    fabric, rubber = SHEETS["two laws"]
    sheets = [fabric, rubber, fabric._replace(name="again")]
    left, rubber, right = simulation(*sheets).model.placed
    assert (left.last_force, right.last_force) == (right.first_force, rubber.first_force)
    assert (left.last_history, right.last_history) == (right.first_history, rubber.first_history)
    assert (left.last_chunk, rubber.last_chunk) == (rubber.first_chunk, right.first_chunk)
    assert model.corner_force_size > model.placed[2].last_force
    assert model.node_count == third.first_node + third.mesh.node_count
    assert model.element_at(second.first_node) >= second.first_element
    with pytest.raises(
        InputError, match="plies: a plate is of one sheet, .* 3 \\(fabric, set, flat\\)"
    ):
        model.only_body("a plate")
    with pytest.raises(InputError, match="the static solver is of one sheet"):
        nodal_forces(model, np.zeros((3, model.node_count)))
    with pytest.raises(InputError, match="the tangent of the elements is of one sheet"):
        linearise(model, np.zeros((3, model.node_count)))


def test_sheets_of_one_mesh_and_unlike_laws_are_of_two_kinds():
    """As are laws of one type with other numbers: the loop takes the law of the first of a kind."""
    stiffer = f'{FABRIC}\nmembrane.C13 = "0.2 MPa"'
    for other, kinds in ((FABRIC, [[0, 1]]), (stiffer, [[0], [1]])):
        placed = simulation(sheet("one", FABRIC), sheet("other", other)).model.placed
        assert kinds_of([own.data for own in placed]) == kinds


def test_an_unsound_element_names_its_body():
    from lcmchain.errors import SimulationError

    sim = simulation(*SHEETS["two laws"])
    body = sim.model.bodies[1]
    sim.state.position[2, body.first_node :] = 0.0
    with pytest.raises(SimulationError, match="element 0 is inverted .* of rubber at"):
        sim.require_sound()


# --- files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The file of three sheets after some steps, and their simulation."""
    sim = simulation(*SHEETS["two families, with and without memory"])
    snapshots = [sim.snapshot()]
    advanced(sim)
    snapshots.append(sim.snapshot())
    frames = FrameSeries.from_snapshots(snapshots, sim.model.tool_names)
    path = tmp_path_factory.mktemp("bodies") / "forming.nc"
    write_forming_netcdf(path, model_datasets(scene(), sim.model, frames))
    return path, sim


def opened(path, group="/"):
    return read_group(path, group)


def test_every_body_is_a_mesh_in_a_group_of_its_own(written):
    path, sim = written
    for body in sim.model.bodies:
        grid = xugrid.Ugrid2d.from_dataset(opened(path, body.name), body.name)
        assert grid.n_face == body.mesh.element_count
        group = opened(path, body.name)
        assert group.attrs["material"] == body.material.name
        assert group["shear_angle"].dims == ("time", f"{body.name}_face")
        assert ("thickness" in group) == (body.name != "flat")
        assert ("largest_compaction_strain" in group) == (body.name == "set")
    for name in ("fabric", "set"):
        solid = opened(path, f"{name}/solid")
        assert solid.sizes["solid_volume"] == opened(path, name).sizes[f"{name}_face"]
    with h5py.File(path) as file:
        assert "solid" in file["fabric"] and "solid" not in file["flat"]


def test_saved_states_are_selected_by_time_in_the_group_of_every_sheet(written):
    path, sim = written
    with xr.open_datatree(path) as tree:
        groups = {"/", "/fabric", "/fabric/solid", "/set", "/set/solid", "/flat", "/history"}
        assert set(tree.groups) == groups
        last = tree.sel(time=sim.time, method="nearest")
        for group in groups - {"/history"}:
            moved = tree[group]["displacement_z"]
            np.testing.assert_array_equal(last[group]["displacement_z"], moved[-1])


def test_the_root_holds_all_sheets_together(written):
    path, sim = written
    root = opened(path)
    counts = [body.mesh.element_count for body in sim.model.bodies]
    np.testing.assert_array_equal(root["body"], np.repeat([0, 1, 2], counts))
    assert root["body"].attrs["flag_meanings"] == "fabric set flat"
    start = 0
    for body, count in zip(sim.model.bodies, counts, strict=True):
        own = opened(path, body.name)
        part = root["areal_fibre_mass"][:, start : start + count]
        np.testing.assert_array_equal(part, own["areal_fibre_mass"])
        start += count
    assert np.isnan(root["thickness"][:, -counts[-1] :]).all()
    assert np.isfinite(root["thickness"][:, : -counts[-1]]).all()
    grid = xugrid.Ugrid2d.from_dataset(root, "sheet")
    area = sum(body.mesh.element_areas.sum() for body in sim.model.bodies)
    assert grid.area.sum() == pytest.approx(area, rel=0.05)


def test_vtk_reads_the_root_mesh(written):
    path, sim = written
    reader = vtk.vtkNetCDFUGRIDReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetOutput().GetNumberOfCells() == sim.model.element_count


def test_a_model_of_one_body_writes_the_file_of_one_sheet():
    sim = simulation(sheet("any name", FABRIC))
    frames = FrameSeries.from_snapshots([sim.snapshot()], sim.model.tool_names)
    assert set(model_datasets(scene(), sim.model, frames)) == {"/", "/solid", "/history"}


def test_choices_of_the_element_are_those_of_each_body():
    director = ElementOptions(compaction_strain="director")
    model = assemble_bodies(
        [sheet("a", FABRIC), sheet("b", FABRIC, director, shift=0.1)],
        tools=build_tool_table((), None, 1.0),
        tool_names=(),
        contact=Contact(),
        process=Process(time="1 s"),
    )
    options = [body.data.options.director for body in model.bodies]
    assert options == [None, True]


def test_the_example_of_two_sheets(tmp_path, capsys):
    """Both at 0.704 mm under pressure; released, one keeps its set."""
    example = Path(__file__).resolve().parents[2] / "examples" / "two_sheets" / "form.py"
    runpy.run_path(str(example))["main"](tmp_path)
    lines = capsys.readouterr().out.splitlines()
    rows = {words[0]: [float(w) for w in words[1:]] for words in map(str.split, lines[1:3])}
    pressed, released = 0.704, 1.004
    kept = released * np.sqrt(1.0 + 0.3 * ((pressed / released) ** 2 - 1.0))
    assert rows["fabric"] == pytest.approx([pressed, released], abs=2e-3)
    assert rows["with_set"] == pytest.approx([pressed, kept], abs=3e-3)
    assert set(read_group(tmp_path / "forming.nc", "with_set").data_vars) > {"thickness"}


@pytest.mark.parametrize(("names", "words"), [(("a", "a"), "two sheets"), (("a", "solid"), "use")])
def test_sheets_that_a_file_could_not_tell_apart_are_refused(names, words):
    with pytest.raises(InputError, match=words):
        simulation(*(sheet(name, FABRIC, shift=0.1 * i) for i, name in enumerate(names)))
