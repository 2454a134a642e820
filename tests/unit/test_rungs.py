"""The model ladder: one scene on any rung, what is dropped on the way, and what a rung is."""

import json

import numpy as np
import pytest

from lcmchain.check import scene_warnings
from lcmchain.elements.membrane_shell.kernel import MembraneShellData
from lcmchain.elements.membrane_shell.membrane import MembraneData
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.scene import RUNGS, left_out_of, on_rung, rung_of, scene_from_text
from lcmchain.scene.reading.read import OVERRIDE
from lcmchain.scene.reading.single_tables import formed_permeability

PLAIN = """
title = "dome"
process = { time = "20 ms", frames = 3, mass_damping = "500 1/s" }
blank = { size = ["60 mm", "60 mm"], edge_length = "10 mm", height = "0.502 mm" }
material = { preset = "MD600" }
element = { integration_points = 2 }
contact = { friction = 0.157 }

[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "6 mm" }
"""


@pytest.mark.parametrize("model", RUNGS)
def test_one_scene_stands_on_every_rung(model):
    scene = scene_from_text(PLAIN)
    moved = on_rung(scene, model)
    assert rung_of(moved) == model and rung_of(scene) == "solid-shell"
    for name in ("process", "blank", "material", "tools", "contact", "draping"):
        assert getattr(moved, name) == getattr(scene, name)
    assert on_rung(moved, model) is moved
    assert rung_of(on_rung(moved, "solid-shell")) == "solid-shell"


def test_the_same_rung_keeps_the_options_of_its_element():
    scene = scene_from_text(PLAIN)
    assert on_rung(scene, "solid-shell") is scene
    assert on_rung(scene, "membrane").source.left_out == ("element.integration_points",)
    back = on_rung(on_rung(scene, "membrane"), "membrane-shell")
    assert back.element.bending


def test_what_needs_a_thickness_is_left_out_and_named():
    text = PLAIN + '[permeability]\nlaw = "gebart"\nfibre_radius = "3.5 um"\n'
    text += '[[pressure]]\nname = "vacuum"\nface = "top"\nvalue = "1 bar"\n'
    text += '[output]\nanimation = "gif"\nanimation_field = "thickness"\n'
    scene = scene_from_text(text)
    lost = ("element.integration_points", "permeability", "pressure", "output.animation")
    for model in ("membrane", "membrane-shell"):
        moved = on_rung(scene, model)
        assert moved.source.left_out == lost
        assert moved.permeability is None and moved.pressure == ()
        assert moved.output.animation == "none" and scene.output.animation == "gif"
        assert any("permeability, pressure" in text for text in scene_warnings(moved))
    net = on_rung(scene, "kinematic")
    assert net.permeability == scene.permeability and net.pressure == ()
    assert net.output.animation == "gif"  # constant volume gives a thickness


def test_the_text_of_a_moved_scene_reads_as_what_it_is():
    text = PLAIN + '[permeability]\nlaw = "gebart"\nfibre_radius = "3.5 um"\n'
    scene = scene_from_text(text)
    moved = on_rung(scene, "membrane")
    assert formed_permeability(scene.source.text) is not None
    assert formed_permeability(moved.source.text) is None
    assert moved.source.sha256 != scene.source.sha256
    assert ("element.integration_points", "2") not in moved.source.given


def test_every_rung_says_what_it_cannot_predict():
    scene = scene_from_text(PLAIN)
    words = {
        "kinematic": "no forces",
        "membrane": "folds at no cost",
        "membrane-shell": "thickness",
    }
    for model, word in words.items():
        assert any(word in text for text in scene_warnings(on_rung(scene, model)))


def test_wrong_rungs_and_laws_are_refused():
    scene = scene_from_text(PLAIN)
    with pytest.raises(InputError, match='"shell", but there are kinematic'):
        on_rung(scene, "shell")
    steel = scene_from_text(
        PLAIN.replace(
            'preset = "MD600"',
            'law = "isotropic", thickness = "1 mm", density = "7800 kg/m^3", '
            'young_modulus = "210 GPa", poisson_ratio = 0.3',
        )
    )
    for model in ("kinematic", "membrane", "membrane-shell"):
        with pytest.raises(InputError, match='element = "solid-shell"'):
            on_rung(steel, model)


def test_a_net_has_no_model_with_forces():
    with pytest.raises(InputError, match="lay without forces"):
        build_model(on_rung(scene_from_text(PLAIN), "kinematic"))
    with pytest.raises(InputError, match="has no forces"):
        scene_from_text(PLAIN + '[[pressure]]\nface = "top"\nvalue = "1 bar"\nname = "p"\n',
                        overrides=["element=kinematic"])  # fmt: skip


def test_without_bending_the_kernel_has_no_curvature_at_all():
    """The membrane's constants hold three corners and five numbers a triangle, not six and 20."""
    scene = scene_from_text(PLAIN)
    membrane, shell = (
        build_model(on_rung(scene, m)).only_body() for m in ("membrane", "membrane-shell")
    )
    assert isinstance(membrane.data, MembraneData) and isinstance(shell.data, MembraneShellData)
    assert not membrane.effects()["bending"][0] and shell.effects()["bending"][0]
    assert membrane.force_nodes.shape[1] == 3 and shell.force_nodes.shape[1] == 6
    assert membrane.data.element_data.size * 4 == shell.data.element_data.size
    assert membrane.geometry.curvature.size == 0


def test_the_membrane_is_the_membrane_part_of_the_shell():
    """In the plane both have the same forces, energies and bounds; out of it bending is missing."""
    scene = scene_from_text(PLAIN)
    models = [build_model(on_rung(scene, m)) for m in ("membrane", "membrane-shell")]
    rng = np.random.default_rng(3)
    flat = np.ascontiguousarray(models[0].node_positions.T)
    flat[:2] += 3e-4 * rng.standard_normal(flat[:2].shape)
    bent = flat.copy()
    bent[2] += 1e-3 * np.sin(100.0 * flat[0])
    forces, energies, bounds = ([[], []] for _ in range(3))
    for k, positions in enumerate((flat, bent)):
        for model in models:
            body = model.only_body()
            forces[k].append(nodal_forces(body, positions))
            energies[k].append(body.stored_energy(positions, body.no_history())[0])
            mass = model.nodes.mass
            bounds[k].append(body.highest_frequency(positions, body.no_history(), mass)[0])
    scale = np.abs(forces[0][0]).max()
    assert np.allclose(forces[0][0][:2], forces[0][1][:2], atol=1e-12 * scale)
    assert energies[0][0] == pytest.approx(energies[0][1], rel=1e-12)
    assert energies[1][0] < energies[1][1]
    assert not np.allclose(forces[1][0], forces[1][1], atol=1e-9 * scale)
    assert bounds[1][0] <= bounds[1][1]


def test_the_forces_of_the_membrane_are_those_of_its_energy():
    body = build_model(on_rung(scene_from_text(PLAIN), "membrane")).only_body()
    rng = np.random.default_rng(5)
    positions = np.ascontiguousarray(body.mesh.node_positions.T)
    positions += 3e-4 * rng.standard_normal(positions.shape)
    direction = rng.standard_normal(positions.shape)
    step = 1e-9
    ahead, back = (
        body.stored_energy(positions + sign * step * direction, body.no_history())[0]
        for sign in (1.0, -1.0)
    )
    work = float((nodal_forces(body, positions) * direction).sum())
    assert (ahead - back) / (2.0 * step) == pytest.approx(work, rel=1e-6)


def nodal_forces(body, positions):
    """Return the internal forces (3, node_count), by the compiled kernel."""
    from lcmchain.elements.blocks import LANES
    from lcmchain.elements.family import internal_forces

    nodes = body.force_nodes
    corners = nodes.shape[1]
    blocks = -(-len(nodes) // LANES)
    force = np.zeros(blocks * 3 * corners * LANES)
    internal_forces(body.data, positions, force, body.no_history())
    by_row = force.reshape(blocks, corners, 3, LANES).transpose(0, 3, 1, 2)
    of_corner = by_row.reshape(-1, corners, 3)[: len(nodes)]
    total = np.zeros_like(positions)
    for corner in range(corners):
        there = nodes[:, corner] >= 0
        for axis in range(3):
            np.add.at(total[axis], nodes[there, corner], of_corner[there, corner, axis])
    return total


def test_the_command_line_takes_a_rung(tmp_path, capsys):
    from lcmchain import cli

    path = tmp_path / "dome.toml"
    path.write_text(PLAIN + "[output]\npictures = false\nreport = false\n", encoding="utf-8")
    with pytest.raises(SystemExit) as stop:
        cli.main(["run", str(path), "--model", "kinematic", "--out", str(tmp_path / "net")])
    assert not stop.value.code
    summary = json.loads((tmp_path / "net" / "summary.json").read_text())
    assert summary["model"] == "kinematic"
    assert summary["left_out"] == ["element.integration_points"]
    assert "no wrinkles" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(SystemExit) as stop:
        cli.main(["check", str(path), "--model", "membrane", "--out", str(tmp_path / "check")])
    said = " ".join(capsys.readouterr().out.split())
    assert not stop.value.code and "largest shear angle" in said and "bending = false" in said
    with pytest.raises(SystemExit) as stop:
        cli.main(["check", str(path), "--model", "shell", "--out", str(tmp_path / "check")])
    assert stop.value.code == 2


def test_a_net_leaves_out_weight_and_switches_and_says_so():
    switches = ['effects.gravity="on"', 'effects.friction="off"']
    scene = scene_from_text(PLAIN, None, ["process.gravity=true", *switches])
    moved = on_rung(scene, "kinematic")
    lost = ("process.gravity", "effects.friction", "effects.gravity")
    assert moved.source.left_out == ("element.integration_points", *lost)
    assert not moved.process.gravity and moved.switched == ()
    assert not {"process.gravity", "effects.gravity"} & set(dict(moved.source.given))
    assert any(text.endswith(", ".join(lost)) for text in scene_warnings(moved))
    assert scene.tools[0].friction == 0.0 and moved.tools[0].friction == 0.157, "as written"
    written = moved.source.text.splitlines()
    added = [line.removeprefix(OVERRIDE) for line in written if line.startswith(OVERRIDE)]
    again = scene_from_text(PLAIN, None, [item for item in added if "integration" not in item])
    assert again.process == moved.process and again.effects == moved.effects


def test_a_scene_of_a_net_says_that_weight_is_left_out():
    net = PLAIN.replace("element = { integration_points = 2 }", 'element = "kinematic"')
    for override, key in (
        ("process.gravity=true", "process.gravity"), ('effects.gravity="on"', "effects.gravity"),
    ):  # fmt: skip
        scene = scene_from_text(net, None, [override])
        assert left_out_of(scene) == [key]
        told = " ".join(scene_warnings(scene))
        assert f"left out, as this model knows nothing of them: {key}" in told
        assert "adds what no other entry" not in told
    assert left_out_of(scene_from_text(net)) == []


@pytest.mark.parametrize("model", ["membrane", "membrane-shell"])
def test_switches_are_told_on_other_rungs_too(model):
    scene = scene_from_text(PLAIN, None, ['effects.friction="off"'])
    moved = on_rung(scene, model)
    assert moved.switched == scene.switched != ()
    assert moved.tools == scene.tools and scene.tools[0].friction == 0.0
