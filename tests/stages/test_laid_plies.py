"""A ply that is laid down after a first stage: it waits, finds its place, and is as any other."""

from __future__ import annotations

import io
import re
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from lcmchain.check.tables import stack_tables, stage_table
from lcmchain.check.tool_strokes import closing_tools, require_space, tools_that_close
from lcmchain.check.tools_at_start import gaps_of_stack
from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.effects.contact_depth import nominal_pressure
from lcmchain.errors import InputError, SimulationError
from lcmchain.fields.stages import stage_summary
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.forming.variables import STACK
from lcmchain.fmu.instances import open_unit
from lcmchain.interfaces.forces import REFRESHES_LEFT
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.scene.stages import stack_at
from lcmchain.solver.simulation import Simulation
from lcmchain.solver.stages import lay_down, require_clear
from lcmchain.state import STAGE, State

MS = 1e-3
PRESSURE = 0.05e6  # at its highest, in either stage [Pa]

# A bag presses on a ply over a die, and lets go; a patch is laid on it, and the bag presses again.
# The punch of the first stage stands where the patch waits.
SCENE = """
process = { frames = 7, gravity = true }
material = { preset = "MD600" }
contact = { depth = "free" }

[[plies]]
name = "base"
size = ["40 mm", "20 mm"]
edge_length = "10 mm"

[[plies]]
name = "patch"
size = ["40 mm", "20 mm"]
edge_length = "10 mm"
stages = ["lay", "press"]

[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
position = "0 0 -0.502 mm"

[[tools]]
name = "punch"
shape = { type = "plate", side = "above" }
position = "0 0 0.6 mm"
stages = ["form"]

[[pressure]]
name = "bag"
face = "top"
times = "0 2 4 6 8 10 ms"
values = "0 0.05 0.05 0 0 0.05 MPa"

[[stages]]
name = "form"
time = "6 ms"
mass_damping = "2000 1/s"

[[stages]]
name = "lay"
time = "2 ms"
mass_damping = "2000 1/s"

[[stages]]
name = "press"
time = "5 ms"
mass_damping = "2000 1/s"
"""

#: In place of the bag, for scenes without one.
NO_BAG = SCENE.partition("[[pressure]]")[0] + "[[stages]]" + SCENE.partition("[[stages]]")[2]


def scene_of(*overrides, text=SCENE):
    return scene_from_text(text, overrides=overrides)


def nodes_of(body):
    return slice(body.first_node, body.first_node + body.mesh.node_count)


def thickness(simulation, number):
    """Return the thickness of the elements of a ply that lies flat [m]."""
    body = simulation.model.bodies[number]
    z = simulation.state.position[2, nodes_of(body)]
    return (z[body.mesh.elements[:, 4:]] - z[body.mesh.elements[:, :4]]).mean(axis=1)


def pressed_thickness(model):
    """Return how thick a ply is under the pressure of the bag, by the law alone [m]."""
    material = model.bodies[0].material
    stretch = np.linspace(1.0, 0.5, 5001)
    return material.thickness * np.interp(PRESSURE, nominal_pressure(material, stretch), stretch)


@pytest.fixture(scope="module")
def laid():
    """The run over all stages: what it came to at some times."""
    scene = scene_of()
    simulation = Simulation.from_scene(scene)
    whole, found, frames = simulation.model.whole, {}, [simulation.snapshot()]
    for time in (1.0, 4.0, 6.0, 6.05, 8.0, 10.0, 13.0):
        simulation.advance_to(time * MS)
        frames.append(simulation.snapshot())
        found[time] = SimpleNamespace(
            state=simulation.state.copy(),
            energy=simulation.energy(),
            thickness=[thickness(simulation, number) for number in (0, 1)],
        )
    return SimpleNamespace(
        scene=scene, simulation=simulation, whole=whole, at=found, frames=tuple(frames)
    )


def test_a_ply_waits_without_moving_by_a_bit(laid):
    """Under gravity, in a tool at work, and on a ply that is pressed and comes back."""
    model = laid.whole
    patch, start = nodes_of(model.bodies[1]), model.node_positions.T
    for time in (1.0, 4.0, 6.0):
        state = laid.at[time].state
        assert np.array_equal(state.position[:, patch], start[:, patch]), time
        assert not state.velocity[:, patch].any() and not state.contact_force[patch].any()
        assert not state.tool_force[1].any() and not state.near[:, patch].any()
        assert (state.ply_facet == -1).all()
        assert not state.free[:, patch].any() and state.free[:, : patch.start].all()
    after = laid.at[10.0].state
    assert after.free.all() and (after.ply_facet >= 0).any()
    assert np.abs(after.position[:, patch] - start[:, patch]).max() > 1e-4


def test_a_bag_presses_the_ply_that_lies_on_top_then(laid):
    """One ply is as thick as its law says, and then a stack twice as thick as one ply."""
    model = laid.whole
    expected, initial = pressed_thickness(model), model.bodies[0].material.thickness
    assert expected < 0.9 * initial
    np.testing.assert_allclose(laid.at[4.0].thickness[0], expected, rtol=3e-3)
    np.testing.assert_allclose(laid.at[6.0].thickness[0], initial, rtol=1e-2)
    for number in (0, 1):
        np.testing.assert_allclose(laid.at[13.0].thickness[number], expected, rtol=5e-3)
    z = laid.at[13.0].state.position[2]
    (base, patch), half = (model.bodies[number] for number in (0, 1)), slice(4, 8)
    top = z[patch.mesh.elements[:, half] + patch.first_node].mean()
    bottom = z[base.mesh.elements[:, :4] + base.first_node].mean()
    assert top - bottom == pytest.approx(2.0 * expected, rel=5e-3)


def test_the_balance_is_closed_over_the_border(laid):
    work = laid.at[4.0].energy["external"]
    assert work > 1e-3
    errors = {time: found.energy["balance_error"] for time, found in laid.at.items()}
    assert abs(errors[6.05] - errors[6.0]) < 5e-5 * work
    assert max(map(abs, errors.values())) < 2e-3 * work


def test_a_run_goes_on_from_any_stage_to_the_same_bits(laid):
    states = [laid.at[time].state for time in (1.0, 6.0, 6.05, 10.0)]
    assert [int(state.counters[STAGE]) for state in states] == [0, 0, 1, 2]
    for start in states:
        simulation = Simulation(laid.whole, start.copy())
        simulation.restore(start)
        for time in (time for time in laid.at if time * MS > start.time):
            simulation.advance_to(time * MS)
        for name, array in laid.at[13.0].state.as_dict().items():
            assert np.array_equal(getattr(simulation.state, name), array), (start.time, name)


def test_results_count_the_plies_that_are_there(laid):
    datasets = forming_datasets(laid.scene, laid.simulation, laid.frames)
    sheet = datasets["/"]
    count, thick = sheet["stack_ply_count"].values, sheet["stack_thickness"].values
    own = sheet["thickness"].values
    base, patch = (sheet["body"].values == number for number in (0, 1))
    for frame, time in enumerate((0.0, *laid.at)):
        expected = 1.0 if time <= 6.0 else 2.0
        assert (count[frame] == expected).all(), time
        sum_of_plies = own[frame, base] + (own[frame, patch] if expected == 2.0 else 0.0)
        np.testing.assert_allclose(thick[frame, base], sum_of_plies, rtol=1e-12)
        np.testing.assert_allclose(thick[frame, patch], sum_of_plies, rtol=1e-12)
    mass = sheet["stack_areal_fibre_mass"].values
    np.testing.assert_allclose(mass[-1], 2.0 * mass[0].min(), rtol=1e-2)
    stages = stage_summary(laid.simulation.model, laid.simulation.state, datasets)["stages"]
    assert [stage["plies"] for stage in stages] == [["base"], *[["base", "patch"]] * 2]


# --- at the border --------------------------------------------------------------------------------

SHORT = ("stages.form.time='0.1 ms'", "stages.lay.time='0.1 ms'", "stages.press.time='0.1 ms'")


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (
            ["plies.patch.height='0.8 mm'"],
            r"the ply patch lies 0\.[12]\d* mm deep in the ply base at \(",
        ),
        (["plies.patch.height='0 mm'"], r"patch lies (1|0\.99\d) mm deep in the ply base"),
        (
            ["tools.punch.stages=['form', 'lay']"],
            r"the ply patch lies 0\.906 mm deep in punch at \(",
        ),
    ],
)
def test_a_ply_that_is_laid_into_something_is_named(overrides, told):
    simulation = Simulation.from_scene(scene_of(*SHORT, *overrides))
    with pytest.raises(SimulationError) as error:
        simulation.advance_to(0.15 * MS)
    message = str(error.value)
    assert 'the stage "lay" cannot begin at 0.1000 ms' in message
    assert re.search(told, message), message
    assert simulation.model.present_stage.name == "form"


def test_a_touch_of_a_tool_brings_its_energy_along():
    """A patch that lies 5 um in a tool that stays; without the entry the balance has it for new."""
    stays = ("tools.punch.stages=['form', 'lay']", "tools.punch.position='0 0 1.501 mm'")
    simulation = Simulation.from_scene(scene_of(*SHORT, *stays))
    simulation.advance_to(0.1 * MS)
    before, model = simulation.energy(), simulation.model
    top = model.contact_stiffness[nodes_of(model.bodies[1])].sum() / 2.0
    stored = 0.5 * top * (5e-6) ** 2
    simulation.advance_to(0.101 * MS)
    after = simulation.energy()
    assert after["external"] - before["external"] == pytest.approx(stored, rel=0.1)
    assert abs(after["balance_error"] - before["balance_error"]) < 0.05 * stored


def test_a_formed_ply_may_rise_beside_a_flat_one_and_not_through_it():
    """Looked at on the columns of its elements; nothing runs."""
    simulation = Simulation.from_scene(scene_of("plies.patch.height='3 mm'"))
    model, state = simulation.model, simulation.state
    base, patch = model.bodies
    before, now = model.stages[:2]

    def require(state):
        require_clear(model, state, before, now, [patch])

    require(state)
    own = nodes_of(base)
    x = state.position[0, own]
    tilted = state.copy()
    tilted.position[2, own] += 5e-3 * (x - x.min()) / np.ptp(x)
    with pytest.raises(SimulationError, match="patch lies .* mm deep in the ply base"):
        require(tilted)
    steep = state.copy()  # one row of nodes high above, and no place of an element inside the ply
    steep.position[2, own] += np.where(x > 15e-3, 100e-3, 0.0)
    with pytest.raises(SimulationError, match="patch lies 2.01 mm deep in the ply base"):
        require(steep)
    beside = state.copy()
    beside.position[2, own] += 5e-3
    beside.position[0, own] += 50e-3
    require(beside)


def test_a_ply_is_looked_for_at_once_and_has_no_memory_of_its_waiting():
    model = build_model(scene_of("process.damping_average='1 ms'"))
    state = State.at_rest(model)
    state.mean_velocity[:], state.ply_counters[REFRESHES_LEFT] = 1.0, 7
    before, now = model.stages[:2]
    assert lay_down(model, state, before, now, [model.bodies[1]]) == 0.0
    patch = nodes_of(model.bodies[1])
    assert not state.mean_velocity[:, patch].any() and state.mean_velocity[:, : patch.start].all()
    assert state.ply_counters[REFRESHES_LEFT] == 0


def test_a_clamp_takes_up_a_ply_when_it_is_laid_down():
    """Its table has the nodes of the plies that are there; nothing runs."""
    clamp = """
[[grippers]]
name = "clamp"
box = ["-20 -10 -2 mm", "-20 10 2 mm"]
hold = "xyz"

[[stages]]"""
    model = build_model(scene_of(text=SCENE.replace("[[stages]]", clamp, 1)))
    form, lay, _ = model.stages
    patch, held = nodes_of(model.bodies[1]), model.grips[0].nodes
    waiting = held >= patch.start
    assert waiting.any() and not waiting.all()
    assert set(form.supports.node.tolist()) == set(held[~waiting].tolist())
    assert set(lay.supports.node.tolist()) == set(held.tolist())
    never = np.array([np.inf])
    assert not form.free(model, never)[:, patch].any()
    free = lay.free(model, never)
    assert not free[:, held].any() and free.sum() == 3 * (model.node_count - held.size)


# --- before a run ---------------------------------------------------------------------------------

GRIPPER = """
[[grippers]]
name = "spring"
box = ["20 -10 -2 mm", "20 10 2 mm"]
direction = [1, 0, 0]
force = "3 N"
"""


@pytest.mark.parametrize(
    ("overrides", "more", "told"),
    [
        (["plies.patch.stages=['lay']"], "", r'plies\[1\] "patch".stages.*leaves out "press"'),
        (["plies.patch.stages=['form', 'press']"], "", 'leaves out "lay"'),
        (["plies.patch.stages=['later']"], "", "there is no stage of this name"),
        (["plies.base.stages=['press']"], "", 'no ply is there in the stage "form"'),
        (["pressure.bag.ply='patch'"], "", r'pressure\[0\] "bag".stages.*"patch" is laid down'),
        (["grippers.spring.ply='patch'"], GRIPPER, r'grippers\[0\] "spring".stages'),
        ([], GRIPPER, r'grippers\[0\] "spring".ply.*pulls at "patch" too'),
        (["grippers.spring.ply='base'"], GRIPPER, None),
        (["grippers.spring.stages=['press']"], GRIPPER, None),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_one_clear_error(overrides, more, told):
    text = SCENE.replace("[[stages]]", f"{more}\n[[stages]]", 1)
    if told is None:
        build_model(scene_of(*overrides, text=text))
        return
    with pytest.raises(InputError) as error:
        build_model(scene_of(*overrides, text=text))
    assert re.search(told, str(error.value), re.DOTALL), str(error.value)


def test_stages_of_a_ply_in_a_scene_without_any_are_an_error():
    text = NO_BAG.partition("[[stages]]")[0].replace('stages = ["form"]', "")
    with pytest.raises(InputError, match=r'plies\[1\] "patch".stages.*has no \[\[stages\]\]'):
        scene_of(text=text.replace("frames = 7", 'time = "5 ms"'))


def test_resin_that_flows_meanwhile_is_refused_by_name():
    resin = """
[permeability]
law = "gebart"
fibre_radius = "3.5 um"

[infiltration]
time = "100 s"
resin = { law = "constant", viscosity = "0.1 Pa*s" }
with_forming = {}
gates = [ { name = "inlet", point = "0 0 0 mm", pressure = "0.1 MPa" } ]
vents = [ { name = "rim", rim = true } ]

[[stages]]"""
    with pytest.raises(InputError, match='with_forming.*"patch" is laid down later, dry'):
        scene_of(text=SCENE.replace("[[stages]]", resin, 1))


def test_a_ply_of_all_stages_is_one_that_is_there_from_the_start():
    """The tables are those of a scene that says nothing."""
    every = scene_of("plies.patch.stages=['press', 'form', 'lay']", text=NO_BAG)
    assert all(all(plan.plies) for plan in every.stage_plans())
    model = build_model(every)
    assert model.nodes.free is None and all(stage.absent is None for stage in model.stages)
    assert len(stack_at(every, 0.0)) == 2 and len(stack_at(scene_of(), 6 * MS)) == 1


def told_by(tables):
    console = Console(width=200, file=io.StringIO())
    with console.capture() as found:
        for table in tables:
            console.print(table)
    return found.get()


def test_a_check_says_when_a_ply_comes_and_leaves_it_out_before():
    scene = scene_of()
    assert "laid down in lay" in told_by(stack_tables(scene, [8, 8]))
    rows = told_by(stage_table(scene)).splitlines()
    assert [row.split()[0] for row in rows if "laid down: patch" in row] == ["lay"]
    model, blanks = build_model(scene), [ply.build_blank() for ply in scene.stack]
    gaps = {gap.tool: gap.gap for gap in gaps_of_stack(scene, blanks, model.tools)}
    assert gaps["punch"] == pytest.approx(0.098e-3) and abs(gaps["die"]) < 1e-9


CLOSES = "stages.form.motions={{punch={{type='stroke', direction=[0,0,-1], distance='{} mm'}}}}"


def test_tools_are_held_against_the_plies_that_are_between_them():
    """Half a stack is room enough for one ply, and none for two; their gap stiffens no contact."""

    def of(*overrides):
        scene = scene_of("tools.punch.position='0 0 0.502 mm'", *overrides, text=NO_BAG)
        model, blanks = build_model(scene), [ply.build_blank() for ply in scene.stack]
        return scene, model, closing_tools(scene, blanks, model)

    closes = CLOSES.format(0.2)
    scene, model, closing = of(closes)
    require_space(scene, model, closing)
    assert tools_that_close(scene, model, closing) == []
    open_model = of()[1]
    alone = build_model(scene_of("tools.punch.position='0 0 9 mm'", text=NO_BAG))
    assert model.environment.penalty == alone.environment.penalty
    assert open_model.environment.penalty == alone.environment.penalty
    # with both plies there the same gap is less than half of what lies in it
    there = ("tools.punch.stages=['form', 'lay', 'press']", closes)
    scene, model, closing = of(*there)
    assert model.environment.penalty > 10.0 * alone.environment.penalty
    with pytest.raises(InputError, match=r'tools\[1\] "punch".motion'):
        require_space(*of(there[0], CLOSES.format(0.55)))
    assert len(tools_that_close(scene, model, closing)) == 1


# --- as a unit ------------------------------------------------------------------------------------

STEP = 2.5 * MS  # the border at 6 ms lies within the third step


@pytest.fixture
def unit(tmp_path):
    path = tmp_path / "patch.toml"
    path.write_text(SCENE, encoding="utf-8")
    with zipfile.ZipFile(build_fmu(path, tmp_path / "patch.fmu")) as packed:
        packed.extractall(tmp_path / "unit")
    told: list[str] = []
    resources = tmp_path / "unit" / "resources"
    opened = open_unit(str(resources), "patch", lambda _, __, text: told.append(text), arrays=False)
    opened.set_up(0.0)
    opened.enter_initialization()
    opened.exit_initialization()
    return opened


def test_a_unit_steps_over_the_border_and_goes_back_over_it(unit):
    """Bit for bit as the run does; its outputs tell the stack that is there."""
    reference = Simulation.from_scene(scene_of())
    one = reference.model.bodies[0].material.thickness

    def thickest():
        return unit.part.outputs(STACK)["stack_thickness_max"]

    def step(number):
        assert unit.step((number - 1) * STEP, STEP) is Status.OK
        return unit.part.simulation.state.copy()

    step(1), step(2)
    assert thickest() < 1.01 * one
    saved = unit.save()
    later = step(3)
    assert thickest() > 1.9 * one
    for number in (1, 2, 3):
        reference.advance_to(number * STEP, lambda _: reference.require_resolved())
    assert unit.restore(saved) is Status.OK
    assert unit.part.simulation.model.present_stage.name == "form"
    again = step(3)
    for name, array in later.as_dict().items():
        assert np.array_equal(getattr(again, name), array), name
        assert np.array_equal(getattr(reference.state, name), array), name
