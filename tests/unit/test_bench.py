"""What ``lcmchain bench`` measures, on meshes and arrays too small to say anything about speed."""

import json
import platform

import numpy as np
import pytest

from lcmchain.bench import hemisphere, machine, operations, parts, sizes, tables
from lcmchain.check.effect_cost import EffectCost
from lcmchain.effects.switches import Switchable
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(machine, "ROUNDS", 10)
    monkeypatch.setattr(machine, "STREAM", 1000)
    monkeypatch.setattr(sizes, "ELEMENT_COUNTS", (100, 225))
    monkeypatch.setattr(sizes, "ELEMENT_STEPS", 100)
    monkeypatch.setattr(sizes, "REPETITIONS", 2)
    plates = sizes.measure_plates
    monkeypatch.setattr(sizes, "measure_plates", lambda: plates((100, 225), threads=(1,)))
    monkeypatch.setattr(tables, "kernel_operations", lambda: 1000)


def test_plates_in_the_table_and_as_json(small, tmp_path):
    file = tmp_path / "speed.json"
    table = tables.run_size_bench(file)
    assert table.row_count == 2
    assert list(table.columns[0].cells) == ["100", "225"]
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert figures["machine"]["arithmetic"] > 0.0 and figures["machine"]["bandwidth"] > 0.0
    for plate, count in zip(figures["plates"], (100, 225), strict=True):
        assert plate["element_count"] == count
        assert figures["kernel_operations"] == 1000
        assert plate["bandwidth"] == pytest.approx(plate["traffic"] / plate["step"]["median"] / 1e3)
        assert plate["ratio"] == pytest.approx(plate["step"]["median"] / plate["kernel"]["median"])


def test_operations_are_those_of_single_numbers():
    code = """
        vfmadd231sd %xmm1, %xmm2, %xmm3
        vaddsd (%rax), %xmm1, %xmm1
        vmovsd %xmm1, (%rax)
        vdivsd %xmm1, %xmm2, %xmm3
        vmulpd %zmm1, %zmm2, %zmm3
    """
    assert operations.counted(code) == 4


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="counts code of x86")
def test_the_kernel_makes_about_a_thousand_operations():
    # once per element, not once per lane of a block
    assert 800 < operations.kernel_operations() < 2000


def test_the_least_traffic_of_a_plate_is_that_of_its_arrays():
    """One more element brings two nodes: place and velocity in and out, the force, the masses."""
    small, large = sizes.free_plate(64**2), sizes.free_plate(128**2)
    per_element = sizes.least_traffic(large) / large.model.element_count
    assert per_element == pytest.approx(sizes.least_traffic(small) / 64**2, rel=0.05)
    nodes = 2 * (5 * 3 + 2) * 8
    assert nodes < per_element < 1.5 * nodes  # and where neighbours lie


def test_parts_of_a_step_in_the_table_and_as_json(monkeypatch, tmp_path):
    def cup():
        coarse = scene_from_text(hemisphere.SCENE, overrides=("blank.edge_length=30 mm",))
        simulation = Simulation.from_scene(coarse)
        simulation.advance_to(2e-3)
        return simulation

    monkeypatch.setattr(parts, "at_mid_stroke", cup)
    table = tables.run_part_bench(tmp_path / "parts.json")
    figures = json.loads((tmp_path / "parts.json").read_text(encoding="utf-8"))
    *alone, whole = figures["parts"]
    assert whole["name"] == "whole step" and len(alone) == 7
    assert all(part["median"] > 0.0 and part["threads"] == 1 for part in alone)
    assert figures["between"] == pytest.approx(whole["median"] - sum(p["median"] for p in alone))
    assert list(table.columns[2].cells)[0] == "1.00"


def test_costs_of_effects_in_the_table_and_as_json(monkeypatch, tmp_path):
    kept = {}
    gravity = EffectCost(Switchable("gravity", "on", ""), 2e-6, 1.5e-6)
    monkeypatch.setattr(tables, "measure_effects", lambda scene, at: [gravity])
    monkeypatch.setattr(tables, "record_effect_parts", lambda model, parts: kept.update(parts))
    table = tables.run_effect_bench(tmp_path / "effects.json")
    assert list(table.columns[0].cells) == ["gravity"]
    assert list(table.columns[3].cells) == ["25.0%"] and kept == {"gravity": 0.25}
    figures = json.loads((tmp_path / "effects.json").read_text(encoding="utf-8"))
    assert figures["effects"] == {"gravity": {"with": 2.0, "without": 1.5}}


def test_a_plate_is_free_and_moves():
    plate = sizes.free_plate(100)
    start = plate.state.position.copy()
    plate.make_steps(10, plate.prepare_steps())
    assert not plate.state.near.any() and plate.model.nodes.free is None
    assert plate.state.tool_force.any() == 0
    assert np.abs(plate.state.position - start).max() > 0.0


def test_the_measured_operations_are_made():
    """Sixteen multiply-adds in every round: x = x/2 + 1/4 comes to rest at 1/2."""
    numbers = np.array([1.5, -0.5])
    machine.multiply_add(numbers, 0.5, 0.25, 1)
    np.testing.assert_allclose(numbers - 0.5, np.array([1.0, -1.0]) * 0.5**machine.FMAS)
    total = np.zeros(3)
    machine.add_scaled(total, np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), 0.5)
    np.testing.assert_array_equal(total, [3.0, 4.5, 6.0])
