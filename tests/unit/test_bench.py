"""What ``lcmchain bench`` measures, on meshes and arrays too small to say anything about speed."""

import json

import numpy as np
import pytest

from lcmchain.bench import machine, sizes, tables
from lcmchain.check.effect_cost import EffectCost
from lcmchain.effects.switches import Switchable


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(machine, "ROUNDS", 10)
    monkeypatch.setattr(machine, "STREAM", 1000)
    monkeypatch.setattr(sizes, "ELEMENT_COUNTS", (100, 225))
    monkeypatch.setattr(sizes, "ELEMENT_STEPS", 100)
    monkeypatch.setattr(sizes, "REPETITIONS", 2)
    plates = sizes.measure_plates
    monkeypatch.setattr(sizes, "measure_plates", lambda: plates((100, 225), threads=(1,)))


def test_plates_in_the_table_and_as_json(small, tmp_path):
    file = tmp_path / "speed.json"
    table = tables.run_size_bench(file)
    assert table.row_count == 2
    assert list(table.columns[0].cells) == ["100", "225"]
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert figures["machine"]["arithmetic"] > 0.0 and figures["machine"]["bandwidth"] > 0.0
    for plate, count in zip(figures["plates"], (100, 225), strict=True):
        assert plate["element_count"] == count
        assert plate["ratio"] == pytest.approx(plate["step"]["median"] / plate["kernel"]["median"])


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
