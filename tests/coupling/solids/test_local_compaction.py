"""Local compaction: the laws over many cells, each closure on its own, saving, wrong input."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcmchain.coupling.iteration import CoupledPart
from lcmchain.coupling.iteration.interface import PORE_PRESSURE, PartFailed
from lcmchain.coupling.solids.closures import Bag, Gap, Press
from lcmchain.coupling.solids.local import LocalCompaction
from lcmchain.errors import InputError
from lcmchain.materials.law import history_count

# --- law ------------------------------------------------------------------------------------------


@given(share=st.lists(st.floats(-0.2, 1.0), min_size=4, max_size=4))
def test_thickness_bears_the_pressure_of_the_law(cells, law_name, share):
    law = cells(4, law_name, area_stretch=np.array([1.0, 0.9, 0.8, 1.1]))
    most = 0.5 * law.pressure(0.7 * law.thickness).min()
    pressure = most * np.array(share)
    thickness = law.thickness_under(pressure)
    np.testing.assert_allclose(law.pressure(thickness), pressure, rtol=1e-9, atol=1e-9 * most)
    pressed = pressure > 0.0
    stretch = (thickness / law.thickness)[pressed]
    expected = law.material.compaction_pressure(stretch) / law.area_stretch[pressed]
    np.testing.assert_allclose(expected, pressure[pressed], rtol=1e-9, atol=1e-9 * most)


def test_stiffness_is_the_derivative(cells, law_name):
    law = cells(3, law_name)
    thickness = law.thickness * np.array([0.95, 0.8, 1.05])
    step = 1e-5 * law.thickness
    difference = (law.pressure(thickness - step) - law.pressure(thickness + step)) / (2 * step)
    np.testing.assert_allclose(law.stiffness(thickness), difference, rtol=1e-4)


def test_a_law_with_memory_comes_back_thinner(cells):
    law = cells(2, "fabric-with-set")
    assert history_count(law.material.law) == 1
    pressed = law.thickness_under(np.array([1e5, 0.0]))
    law.remember(pressed)
    back = law.thickness_under(np.array([1e4, 1e4]))
    assert back[0] < 0.99 * back[1]
    assert law.free_stretch[0] < law.free_stretch[1] == 1.0
    strain = 0.5 * ((pressed[0] / law.thickness[0]) ** 2 - 1.0)
    assert law.free_stretch[0] == pytest.approx(np.sqrt(1.0 + 2.0 * 0.4 * strain), rel=1e-12)


def test_more_than_the_law_bears_is_named(cells):
    part = LocalCompaction(cells(3), Bag(lambda t: 1e5 if t == 0.0 else 1e12), np.ones(3))
    with pytest.raises(PartFailed, match="cell 0 would have to bear"):
        part.advance(1.0)


# --- closures -------------------------------------------------------------------------------------


def test_bag_each_cell_bears_total_less_pore_pressure(cells):
    part = LocalCompaction(cells(3), Bag(1e5), np.full(3, 2.0), pore_pressure=[0.0, 5e4, 1e5])
    fibres = part.get_fields(["fibre_pressure", "total_pressure"])
    np.testing.assert_allclose(fibres["fibre_pressure"], [1e5, 5e4, 0.0], atol=1e-4)
    np.testing.assert_allclose(fibres["total_pressure"], 1e5, rtol=1e-9)
    assert part.thickness[2] == pytest.approx(part.law.thickness[2])
    assert isinstance(part, CoupledPart)


@given(
    share=st.lists(st.floats(0.0, 0.9), min_size=6, max_size=6),
    offset=st.lists(st.floats(-1e-4, 1e-4), min_size=6, max_size=6),
)
def test_press_has_one_gap_and_the_whole_force(cells, share, offset):
    area = np.linspace(1e-4, 3e-4, 6)
    force = 1e5 * area.sum()
    press = Press(force, offset=np.array(offset))
    part = LocalCompaction(cells(6), press, area, pore_pressure=1e5 * np.array(share))
    gap = part.thickness - np.array(offset)
    np.testing.assert_allclose(gap, gap[0], rtol=1e-12)
    parts = part.force_parts()
    assert parts["total"] == pytest.approx(force, rel=1e-9)
    assert parts["fibres"] + parts["fluid"] == pytest.approx(parts["total"], rel=1e-12)
    assert parts["fluid"] == pytest.approx(float(np.sum(area * 1e5 * np.array(share))), rel=1e-12)


def test_gap_gives_thickness_and_rate(cells):
    part = LocalCompaction(cells(2), Gap(lambda t: 1e-3 - 1e-4 * t), np.array([1.0, 3.0]))
    part.advance(0.5)
    found = part.get_fields(["thickness", "thickness_rate", "volume_rate", "volume"])
    np.testing.assert_allclose(found["thickness"], 0.95e-3)
    np.testing.assert_allclose(found["thickness_rate"], -1e-4)
    np.testing.assert_allclose(found["volume_rate"], [-1e-4, -3e-4])
    np.testing.assert_allclose(found["volume"], 0.95e-3 * np.array([1.0, 3.0]))


@pytest.mark.parametrize("closure", [Bag(2e5), Press(6e5)])
def test_slope_is_what_the_rate_answers_to_the_pressure(cells, closure):
    part = LocalCompaction(cells(3), closure, np.ones(3))
    saved = part.save()
    rates = []
    for pressure in (1e3, -1e3):
        part.restore(saved)
        part.set_fields({PORE_PRESSURE: np.full(3, 2e4 + pressure)})
        part.advance(0.1)
        rates.append(part.get_fields(["volume_rate"])["volume_rate"])
    part.restore(saved)
    part.set_fields({PORE_PRESSURE: np.full(3, 2e4)})
    part.advance(0.1)
    slope = part.get_fields(["volume_rate_slope"])["volume_rate_slope"]
    np.testing.assert_allclose(slope, (rates[0] - rates[1]) / 2e3, rtol=1e-3)


def test_going_on_from_a_saved_state_is_bit_identical(cells, law_name):
    part = LocalCompaction(cells(4, law_name), Bag(lambda t: 3e4 + 1e4 * np.sin(t)), np.ones(4))
    rng = np.random.default_rng(0)
    pressures = rng.uniform(0.0, 2e4, (6, 4))

    def go_on(first):
        for p in pressures[first:]:
            part.set_fields({PORE_PRESSURE: p})
            part.advance(0.7)
        return part.get_fields(["thickness", "volume_rate", "fibre_pressure"])

    for p in pressures[:3]:
        part.set_fields({PORE_PRESSURE: p})
        part.advance(0.7)
    saved = part.save()
    once = go_on(3)
    part.restore(saved)
    again = go_on(3)
    assert all(np.array_equal(once[key], again[key]) for key in once)
    part.restore(saved)
    assert part.time == saved.time


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"temperature": np.zeros(3)}, "no input"),
        ({PORE_PRESSURE: np.zeros(4)}, "there are 3 cells"),
        ({PORE_PRESSURE: np.array([0.0, np.nan, 0.0])}, "cell 1"),
    ],
)
def test_wrong_fields_are_named(cells, fields, said):
    part = LocalCompaction(cells(3), Bag(1e5), np.ones(3))
    with pytest.raises(InputError, match=said):
        part.set_fields(fields)
    with pytest.raises(InputError, match="no output"):
        part.get_fields(["colour"])
    with pytest.raises(InputError, match="area of cell 1"):
        LocalCompaction(cells(3), Bag(1e5), np.array([1.0, 0.0, 1.0]))
