"""What ``lcmchain bench`` measures, on meshes and arrays too small to say anything about speed."""

import json
import platform

import numpy as np
import pytest

from lcmchain.bench import hemisphere, measure, operations, parts, sizes, tables
from lcmchain.bench.laws import LAWS, LawSpeed
from lcmchain.bench.measure import Measurement
from lcmchain.bench.stacks import StackSpeed
from lcmchain.check.effect_cost import EffectCost
from lcmchain.effects.switches import Switchable
from lcmchain.scene import scene_from_text
from lcmchain.solver.interactions.contact_forces import find_near_packs
from lcmchain.solver.simulation import Simulation

COUNTED = operations.Operations(
    kernel=1000, bending=300, frame=1, profile=0, line=0, arc=0, corner=0, gap=0, force=0
)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(measure, "ROUNDS", 10)
    monkeypatch.setattr(measure, "STREAM", 1000)
    monkeypatch.setattr(sizes, "ELEMENT_COUNTS", (100, 225))
    monkeypatch.setattr(sizes, "ELEMENT_STEPS", 100)
    monkeypatch.setattr(sizes, "REPETITIONS", 2)
    plates = sizes.measure_plates
    monkeypatch.setattr(sizes, "measure_plates", lambda: plates((100, 225), threads=(1,)))
    monkeypatch.setattr(tables, "count_operations", lambda: COUNTED)


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


counts_code = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="counts code of x86"
)


@counts_code
def test_operations_of_a_line_and_an_arc_are_counted_once_per_node():
    """Two differences and two products in the plane; root, radius, side, normal, and its bound."""
    tools = Simulation.from_scene(scene_from_text(hemisphere.SCENE)).model.tools
    assert operations.operations_of_pieces(tools)[:2] == [8, 8 + 6]


@pytest.mark.slow
@counts_code
def test_operations_of_a_step_are_counted_once_per_element_or_node():
    counted = operations.count_operations()
    assert 800 < counted.kernel < 2000
    # two differences, two scalar products in the plane
    assert counted.line == 8
    # the same, with root, radius, side, normal, and the bound of the cosine
    assert counted.arc == 8 + 6
    assert counted.gap == 2
    assert 200 < counted.bending < 400 and 100 < counted.force < 200


def test_operations_of_contact_are_those_of_the_packs_near_a_tool():
    simulation = cup()
    simulation.prepare_steps()
    arrays = simulation.arrays
    find_near_packs(arrays.near, arrays.chunk_start, arrays.near_pack, arrays.tools_near)
    near, packs = int(arrays.near_pack.sum()), -(-arrays.mass.size // 8)
    assert 0 < near < 3 * packs

    def made(**counts):
        none = dict.fromkeys(operations.Operations._fields, 0)
        return operations.contact_operations(simulation, operations.Operations(**(none | counts)))

    assert made(frame=2) == 2 * 8 * near
    assert made(frame=2, gap=3) == 5 * 8 * near
    # the sheet lies on the die and under the holder, beside their hole and away from it
    assert 0 < made(profile=1) < made(frame=1)
    arrays.near_pack[:packs] = 1
    assert made(frame=1) == 8 * 3 * packs
    assert 0 < made(force=1) < made(frame=1)
    # punch, die and holder are of a line and an arc, or of two lines and an arc
    assert made(arc=1) == made(profile=1) <= made(line=1) < 2 * made(profile=1)


def test_the_least_traffic_of_a_plate_is_that_of_its_arrays():
    """One more element brings two nodes: place and velocity in and out, the force, the masses."""
    small, large = sizes.free_plate(64**2), sizes.free_plate(128**2)
    per_element = sizes.least_traffic(large) / large.model.element_count
    assert per_element == pytest.approx(sizes.least_traffic(small) / 64**2, rel=0.05)
    nodes = 2 * (5 * 3 + 2) * 8
    assert nodes < per_element < 1.5 * nodes  # and where neighbours lie


def cup():
    coarse = scene_from_text(hemisphere.SCENE, overrides=("blank.edge_length=30 mm",))
    simulation = Simulation.from_scene(coarse)
    simulation.advance_to(2e-3)
    return simulation


def test_parts_of_a_step_in_the_table_and_as_json(small, monkeypatch, tmp_path):
    monkeypatch.setattr(parts, "at_mid_stroke", cup)
    monkeypatch.setattr(parts, "count_operations", lambda: COUNTED)
    table = tables.run_part_bench(tmp_path / "parts.json")
    figures = json.loads((tmp_path / "parts.json").read_text(encoding="utf-8"))
    *alone, whole = figures["parts"]
    assert whole["name"] == "whole step" and len(alone) == 7
    assert all(part["median"] > 0.0 and part["threads"] == 1 for part in alone)
    assert figures["between"] == pytest.approx(whole["median"] - sum(p["median"] for p in alone))
    assert list(table.columns[2].cells)[0] == "1.00"
    kernel, peak = figures["parts"][0]["median"], figures["machine"]["arithmetic"]
    assert figures["operations"]["element kernel"] == 1000
    assert list(table.columns[4].cells)[0] == f"{1.0 / kernel:.1f}"
    assert list(table.columns[5].cells)[0] == f"{1.0 / kernel / peak:.0%}"


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


def test_stacks_in_the_table_and_as_json(monkeypatch, tmp_path):
    def times(one, both):
        return Measurement("", 1, one, one, one), Measurement("", 2, both, both, both)

    speeds = [StackSpeed(1, *times(0.08, 0.05), 0.0), StackSpeed(4, *times(0.12, 0.06), 0.04)]
    monkeypatch.setattr(tables, "measure_stacks", lambda: (0.02, speeds))
    table = tables.run_stack_bench(tmp_path / "stacks.json")
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    assert rows[0][1:] == ("0.0800", "1.00", "0.0500", "1.00", "1.60", "", "")
    assert rows[1] == ("4", "0.1200", "1.50", "0.0600", "1.20", "2.00", "0.0400", "2.00")
    figures = json.loads((tmp_path / "stacks.json").read_text(encoding="utf-8"))
    assert figures["kernel"] == 0.02 and figures["stacks"][1]["interface"] == 0.04


def test_laws_in_the_table_and_as_json(monkeypatch, tmp_path):
    found = [LawSpeed("as published", 0.02, 1.0), LawSpeed("locking", 0.025, 1.25)]
    monkeypatch.setattr(tables, "measure_laws", lambda: found)
    table = tables.run_law_bench(tmp_path / "laws.json")
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    assert rows == [("as published", "0.0200", "1.00"), ("locking", "0.0250", "1.25")]
    figures = json.loads((tmp_path / "laws.json").read_text(encoding="utf-8"))
    assert figures["laws"][1] == {"name": "locking", "time": 0.025, "ratio": 1.25}


def test_every_law_that_is_measured_is_one_of_its_own():
    classes = [
        type(scene_from_text(hemisphere.SCENE, overrides=own).material.build().law)
        for own in LAWS.values()
    ]
    assert len(set(classes)) == len(LAWS)


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
    measure.multiply_add(numbers, 0.5, 0.25, 1)
    np.testing.assert_allclose(numbers - 0.5, np.array([1.0, -1.0]) * 0.5**measure.FMAS)
    total = np.zeros(3)
    measure.add_scaled(total, np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), 0.5)
    np.testing.assert_array_equal(total, [3.0, 4.5, 6.0])
