"""Effects that a scene switches: out of the compiled model and its arrays, or into it."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from lcmchain.check import check_scene, run_effects
from lcmchain.effects.switches import EFFECTS, key_of, switchable_effects, switches
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.state import FRICTION, Scratch, State
from lcmchain.verification import random_elements as make

# calls for nearly everything
FULL = """
process = { time = "1 ms", gravity = true, mass_damping = "50 1/s", damping_average = "1 ms" }
blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm", height = "0.502 mm" }
contact = { friction = 0.2 }

[material]
law = "fabric-with-set"
preset = "MD600"
compaction.permanent_set = 0.3
membrane.locking_angle = "55 deg"
membrane.locking_stiffness = "50 MPa"

[[pressure]]
face = "top"
value = "1 kPa"
name = "bag"

[[tools]]
name = "die"
shape = { type = "plate", side = "below" }

[[tools]]
name = "plate"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm" }
"""
# calls for as little as it can
BARE = """
process = { time = "1 ms" }
blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm", height = "0.502 mm" }

[material]
preset = "MD600"
compaction.c1 = 0.0
bending.in_plane = 0.0
"""
OFF = (
    "compaction", "memory", "shear_locking", "fibre_bending", "friction", "contact",
    "face_pressure", "gravity", "damping",
)  # fmt: skip
NAMES = {"contact": "contact with die", "friction": "friction on die", "damping": "mass damping",
         "fibre_bending": "in-plane bending of fibres", "shear_locking": "shear locking",
         "face_pressure": "pressure bag"}  # fmt: skip


def scene(text, *overrides):
    return scene_from_text(text, overrides=overrides)


def model_size(the_scene):
    return build_model(the_scene).history_size


def told(the_scene):
    return {effect.key: effect for effect in run_effects(the_scene, build_model(the_scene))}


def test_every_effect_has_an_entry_but_those_without_one_in_a_scene():
    assert {key_of(file) for file in EFFECTS} - {""} == set(switches())
    without = [file.__name__.rsplit(".")[-1] for file in EFFECTS if not key_of(file)]
    # none is switched: plies of a scene touch, a coupon has supports, and the others are entries
    assert without == ["ply_contact", "supports", "grippers", "pace"]
    assert set(type(scene(BARE).effects).model_fields) == set(switches())


def test_an_effect_that_needs_one_that_is_off_names_that_one():
    """Not the entries that the scene has, which would be no cure."""
    with pytest.raises(InputError) as caught:
        scene(FULL, "effects.contact=off", "effects.friction=on")
    assert 'effects.friction: is "on", but effects.contact = "off"' in str(caught.value)
    assert "coefficient" not in str(caught.value)


@pytest.mark.parametrize("key", OFF)
def test_off_takes_an_effect_out_and_says_so(key):
    plain, without = scene(FULL), scene(FULL, f"effects.{key}=off")
    assert told(plain)[key].active
    effect = told(without).get(key)
    assert effect is None or not effect.active
    assert [switched.key for switched in without.switched] == [key]
    assert plain.switched == ()
    warnings = check_scene(without).warnings
    assert [w for w in warnings if w.startswith(f'effects.{key} = "off" leaves out')]


def test_all_off_is_the_scene_that_never_called_for_them():
    """The same compiled functions, by their arguments' types, and the same arrays."""
    off = scene(FULL, *(f"effects.{key}=off" for key in OFF))
    bare = scene(BARE)
    models = [build_model(one) for one in (off, bare)]
    assert models[0].history_size == models[1].history_size
    assert models[0].only_body().data.law == models[1].only_body().data.law
    assert type(models[0].only_body().data.law) is type(models[1].only_body().data.law)
    assert [type(o) for o in models[0].only_body().data.options] == [
        type(o) for o in models[1].only_body().data.options
    ]
    for arrays in (State, Scratch):
        shapes = [arrays.shapes_and_types(model) for model in models]
        # the histories have a row per sample and a column per tool
        assert shapes[0] == shapes[1]
    assert told(off).keys() == told(bare).keys()
    sims = [Simulation(model) for model in models]
    for sim in sims:
        sim.set_velocity(np.full_like(sim.state.velocity, 0.1) * np.sin(sim.state.position * 300))
        sim.advance_to(2e-4)
    np.testing.assert_array_equal(sims[0].state.position, sims[1].state.position)


def test_tools_without_friction_keep_no_springs():
    for overrides, count in (((), 1), (("effects.friction=off",), 0), (("contact.friction=0",), 0)):
        model = build_model(scene(FULL, *overrides))
        shape = State.at_rest(model).stick.shape
        assert shape == (2, 3, count * model.node_count)
    # nothing reads them: seen with no more than plates, a loop that other tests compile as well
    preset = BARE.partition("compaction.c1")[0]
    plates = FULL[FULL.index("[[tools]]") :]
    sim = Simulation(build_model(scene(preset + plates, "contact.depth=free")))
    assert sim.state.stick.size == 0
    sim.advance_to(1e-4)
    assert np.abs(sim.state.tool_force).max() > 0.0
    assert sim.state.work[FRICTION] == 0.0


def test_on_adds_what_is_known():
    with_weight = scene(BARE, "effects.gravity=on")
    assert told(with_weight)["gravity"].active
    assert told(with_weight)["gravity"].reason.startswith('effects.gravity = "on"')
    assert not told(scene(BARE))["gravity"].active
    model = build_model(scene(BARE, "effects.enhanced_strain=on"))
    assert model.only_body().data.options.enhanced is not None
    model = build_model(scene(BARE))
    assert model.only_body().data.options.enhanced is None


def test_the_enhanced_strain_of_a_coupling_law_can_be_left_out():
    steel = """
        process = { time = "1 ms" }
        blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm" }
        [material]
        law = "isotropic"
        thickness = "1 mm"
        density = "7800 kg/m^3"
        young_modulus = "210 GPa"
        poisson_ratio = 0.3
        """
    assert told(scene(steel))["enhanced_strain"].active
    without = scene(steel, "effects.enhanced_strain=off")
    assert not told(without)["enhanced_strain"].active and without.switched
    X = build_model(without).node_positions.T
    # pure bending: fibres across the thickness turn with the slope, and stretch the faces
    bent = X + 1e-3 * np.array([-2.0 * X[2] * X[0], 0.0 * X[0], X[0] ** 2])
    work = []
    for one in (scene(steel), without):
        forces = make.corner_forces(build_model(one), bent, np.zeros(model_size(one)))
        nodes = build_model(one).only_body().mesh.elements
        work.append(float((forces * (bent - X).T[nodes]).sum()))
    assert work[1] > 1.1 * work[0] > 0.0  # without it the sheet is too stiff in bending


def test_triangles_can_be_membranes_alone():
    chosen = ("element=membrane-shell",)
    plain, without = scene(BARE, *chosen), scene(BARE, *chosen, "effects.bending=off")
    assert told(plain)["bending"].active and not told(without)["bending"].active
    flat = build_model(plain).node_positions.T
    bent = flat.copy()
    bent[2] += 1e-3 * (bent[0] / 0.02) ** 2
    for one, resists in ((plain, True), (without, False)):
        model = build_model(one)
        sim = Simulation(model)
        sim.state.position[:] = bent
        membrane = build_model(without).only_body().stored_energy(bent, np.empty(0))[0]
        energy = model.only_body().stored_energy(bent, np.empty(0))[0]
        assert (energy > 1.001 * membrane) == resists
        sim.state.position[:] = flat
        sim.state.position[2] += 1e-9 * np.sin(200.0 * flat[0])  # a motion without membrane strain
        sim.make_steps(1, 1e-7)
        assert (np.abs(sim._scratch.force[2]).max() > 1e-12) == resists


@pytest.mark.parametrize(
    ("text", "key", "setting", "says"),
    [
        (FULL, "hourglass", "off", "motions that nothing else resists"),
        (FULL, "bending", "off", "membrane-shell"),
        (FULL, "transverse_shear", "off", "directors"),
        (FULL, "thickness", "off", "membrane-shell"),
        (FULL, "tool_motion", "off", "tools.motion"),
        (BARE, "friction", "on", "contact.friction"),
        (BARE, "contact", "on", r"\[\[tools\]\]"),
        (BARE, "damping", "on", "process.mass_damping"),
        (BARE, "fibre_bending", "on", "in_plane"),
        (BARE, "compaction", "on", "c1"),
        (BARE, "memory", "on", "fabric-with-set"),
        (BARE, "mass_scaling", "on", "process.mass_scaling"),
        (BARE.replace("[material]", 'element = "membrane-shell"\n[material]'), "hourglass", "on",
         "triangles"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_the_cure(text, key, setting, says):
    with pytest.raises(InputError, match=f"effects.{key}.*{says}"):
        scene(text, f"effects.{key}={setting}")


def test_contact_of_a_guided_tool_stays():
    guided = FULL.replace(
        'type = "stroke", direction = [0, 0, -1], distance = "0.1 mm"',
        'type = "guided", direction = [0, 0, -1], mass = "1 kg"',
    )
    with pytest.raises(InputError, match="effects.contact.*guided tool plate"):
        scene(guided, "effects.contact=off")


def test_a_setting_that_changes_nothing_is_silent():
    assert scene(BARE, "effects.friction=off", "effects.bending=on").switched == ()
    assert scene(FULL, "effects.friction=on", "effects.gravity=on").switched == ()


def test_what_a_study_can_switch():
    found = {one.name: one.state for one in switchable_effects(scene(FULL))}
    assert found == dict.fromkeys(OFF, "on")
    for name, state in found.items():
        other = "off" if state == "on" else "on"
        assert [s.key for s in scene(FULL, f"effects.{name}={other}").switched] == [name]
    found = {one.name: one.state for one in switchable_effects(scene(BARE))}
    assert found == {"gravity": "off"}
    settled = {one.name for one in switchable_effects(scene(FULL, "effects.friction=off"))}
    assert settled == set(OFF) - {"friction"}


def test_a_switched_scene_goes_to_other_processes():
    """As studies send it to their workers."""
    sent = pickle.loads(pickle.dumps(scene(FULL, "effects.friction=off")))
    assert [switched.key for switched in sent.switched] == ["friction"]
    assert not told(sent)["friction"].active and sent.effects.friction == "off"


def test_membranes_can_be_given_their_shell_back():
    chosen = ('element={ type = "membrane-shell", bending = false }', "effects.bending=on")
    found = told(scene(BARE, *chosen))
    assert found["bending"].active and not told(scene(BARE, chosen[0]))["bending"].active


def test_a_net_of_fibres_has_nothing_to_switch():
    assert switchable_effects(scene(BARE, "element=kinematic")) == []
    for key in ("bending", "enhanced_strain"):
        with pytest.raises(InputError, match=f"effects.{key}.*net of fibres"):
            scene(BARE, "element=kinematic", f"effects.{key}=on")
        assert scene(BARE, "element=kinematic", f"effects.{key}=off").switched == ()


def test_an_unknown_effect_names_the_nearest():
    with pytest.raises(InputError, match="effects.frictoin.*friction"):
        scene(BARE, "effects.frictoin=off")
