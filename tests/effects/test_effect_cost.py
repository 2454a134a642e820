"""What effects cost: kept per machine, told by a check, and nothing where a scene has none."""

from __future__ import annotations

import re
from inspect import signature
from io import StringIO

import numpy as np
import pytest
from numba import njit, typeof
from rich.console import Console

from lcmchain.check import check_scene
from lcmchain.check.effect_cost import (
    Runner,
    effect_parts,
    measurable_effects,
    measure_effects,
    record_effect_parts,
)
from lcmchain.effects.switches import Switchable
from lcmchain.elements.membrane_shell.kernel import patch_force_loop
from lcmchain.elements.membrane_shell.membrane import membrane_force_loop
from lcmchain.elements.solid_shell.kernel import element_forces
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SHEET = """
process = { time = "0.2 ms", frames = 2, mass_damping = "50 1/s", gravity = true }
blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A folder of numbers of its own."""
    monkeypatch.setattr("lcmchain.check.expected_cost.user_cache_path", lambda *_, **__: tmp_path)
    return tmp_path


def scene(*overrides):
    return scene_from_text(SHEET, overrides=overrides)


def instructions(kernel, *arguments):
    """Instructions of a kernel that is compiled for these arguments."""
    options = {k: v for k, v in kernel.targetoptions.items() if k not in ("nopython", "parallel")}
    fresh = njit(**options)(kernel.py_func)  # code from the disk cache cannot be inspected
    fresh.compile(tuple(map(typeof, arguments)))
    (assembly,) = fresh.inspect_asm().values()
    return len(re.findall(r"^\s+[a-z]\w+\s", assembly, re.M))


def test_a_kernel_without_stiffening_holds_no_code_of_it():
    def count(*overrides):
        model = build_model(scene(*overrides))
        data = model.only_body().data
        return instructions(
            element_forces, model.node_positions.T.copy(), data.corner_node, data.corner_run,
            data.element_data, np.zeros(model.corner_force_size), np.zeros(model.history_size),
            data.law, data.options, data.quick_data, data.quick_options, data.general, 0.0, 0.0,
        )  # fmt: skip

    plain, without = count(), count("effects.compaction=off")
    # an exponential and a logarithm, once for the stress and once for its slope
    assert without < 0.95 * plain
    # a scene that never called for it gets the very same
    assert count("material.compaction.c1=0.0") == without


FOLDING = 'element={ type = "membrane-shell", bending = false }'


def test_a_membrane_holds_no_code_of_moments():
    def count(kernel, *overrides):
        model = build_model(scene("element=membrane-shell", *overrides))
        data = model.only_body().data
        named = data._asdict() | {
            "positions": model.node_positions.T.copy(),
            "patch_node": data.corner_node,
            "node_force": np.zeros(model.corner_force_size),
        }
        return instructions(kernel, *(named[name] for name in signature(kernel.py_func).parameters))

    without = count(membrane_force_loop, "effects.bending=off")
    assert without < 0.8 * count(patch_force_loop)
    assert without == count(membrane_force_loop, FOLDING)


def test_costs_are_measured_in_turn():
    found = measure_effects(scene(), [Switchable("fibre_bending", "on", "")], at=0.5)
    (cost,) = found
    assert cost.with_it > 0.0 and cost.without_it > 0.0
    assert cost.part == 1.0 - cost.without_it / cost.with_it


def test_contact_is_measured_by_looking_for_none():
    bed = 'tools=[{ name = "bed", shape = { type = "plate", side = "below" }, motion = MOTION }]'
    guided = '{ type = "guided", direction = [0, 0, 1], mass = "1 kg" }'
    held = scene(bed.replace("MOTION", guided))
    (contact,) = [one for one in measurable_effects(held) if one.name == "contact"]
    (cost,) = measure_effects(held, [contact])
    assert cost.without_it > 0.0 and cost.with_it > 0.0
    pressed = Simulation(build_model(held))
    pressed.state.position[2] -= 1e-5
    forces = []
    for searches in (True, False):
        runner = Runner(pressed, pressed.state.copy(), searches)
        runner.prepare()
        runner.make_steps(1e-9)
        forces.append(pressed.state.contact_force.max())
        pressed.restore(runner.state)
    assert forces[0] > 0.0 and forces[1] == 0.0
    assert "contact" not in [one.name for one in measurable_effects(scene())]


def test_what_changes_the_number_of_steps_has_no_part_of_one():
    names = [one.name for one in measurable_effects(scene("process.mass_scaling.factor=2"))]
    assert names == ["compaction", "fibre_bending", "gravity", "damping"]


def shown(report):
    console = Console(file=StringIO(), width=160)
    for table in report.tables():
        console.print(table)
    return console.file.getvalue()


def line(text, start):
    (found,) = [one for one in text.splitlines() if one.strip().startswith(start)]
    return found


def test_a_check_tells_measured_parts_and_says_where_there_are_none():
    text = shown(check_scene(scene()))
    assert "not measured" in line(text, "gravity")
    assert "not measured" not in line(text, "hourglass control")  # it is part of the element
    assert "lcmchain study effects" in text
    for part in (0.121, 0.124, 0.2):
        record_effect_parts(build_model(scene()), {"gravity": part, "fibre_bending": -0.01})
    assert effect_parts(build_model(scene()))["gravity"] == 0.124
    text = shown(check_scene(scene()))
    assert "12 %" in line(text, "gravity")
    assert "below 1 %" in line(text, "in-plane bending of fibres")
    assert "12 %" not in line(shown(check_scene(scene("effects.gravity=off"))), "gravity")


def test_parts_belong_to_a_kind_of_elements():
    record_effect_parts(build_model(scene()), {"gravity": 0.1})
    assert effect_parts(build_model(scene("element=membrane-shell"))) == {}
