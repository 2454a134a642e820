"""Plies on each other under one pressure: their thicknesses and compliances add up."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from lcmchain.coupling.iteration.interface import PORE_PRESSURE, PartFailed
from lcmchain.coupling.solids.closures import Bag, Gap, Press
from lcmchain.coupling.solids.compaction_law import CellCompaction
from lcmchain.coupling.solids.local import LocalCompaction
from lcmchain.coupling.solids.stack_compaction import PressedPly, StackCompaction
from lcmchain.errors import SimulationError

ALL = np.arange(4)
#: Stretches from what a bag does to what a fluid lifts, with one at which nothing presses.
STRETCH = np.array([0.7, 0.9, 1.0, 1.05])


@pytest.fixture
def twice(cells):
    """Maker of a stack of two equal plies, and of a sheet that is twice as thick."""

    def make(name):
        stretch = np.array([1.0, 0.9, 0.8, 1.1])
        plies = [PressedPly(k, cells(4, name, area_stretch=stretch), ALL) for k in ("one", "two")]
        one = cells(4, name, area_stretch=stretch)
        double = CellCompaction(one.material, 2.0 * one.thickness, one.area_stretch)
        return StackCompaction(plies, 4), double

    return make


@pytest.fixture
def unlike(cells):
    """Two fabrics and a rubber; the second ply lacks a cell, the third one lacks two."""

    def make(*names):
        rows = (ALL, np.array([0, 1, 3]), np.array([1, 3]))
        areas = (0.9, 1.0, 0.8)
        plies = [
            PressedPly(name, cells(len(own), name, area_stretch=area), own)
            for name, own, area in zip(names, rows, areas, strict=True)
        ]
        return StackCompaction(plies, 4)

    return lambda: make("fabric", "fabric-with-set", "isotropic")


def exact_pressure(stack, cell, thickness):
    """The pressure of a cell by bisection, from what its plies bear at their own thickness."""
    own = [
        (ply.law, int(np.flatnonzero(ply.cells == cell)[0]))
        for ply in stack.plies
        if cell in ply.cells
    ]

    def under(law, row, pressure):
        def excess(stretch):
            return law.pressure(stretch * law.thickness)[row] - pressure

        return law.thickness[row] * brentq(excess, 0.5999, 3.0, xtol=1e-15, rtol=1e-14)

    def lacking(pressure):
        return sum(under(law, row, pressure) for law, row in own) - thickness

    return brentq(lacking, -1e5, 1e5, xtol=1e-9, rtol=1e-14)


def test_two_equal_plies_are_one_sheet_of_twice_the_thickness(twice, law_name):
    stack, double = twice(law_name)
    thickness = STRETCH * double.thickness
    np.testing.assert_array_equal(stack.thickness, double.thickness)
    pressure = double.pressure(thickness)
    assert (np.abs(pressure[[0, 1, 3]]) > 1e3).all()
    np.testing.assert_allclose(stack.pressure(thickness), pressure, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(stack.stiffness(thickness), double.stiffness(thickness), rtol=1e-7)
    np.testing.assert_allclose(stack.thickness_under(pressure), thickness, rtol=1e-12)


def test_unlike_plies_share_a_pressure(unlike):
    stack = unlike()
    thickness = np.array([0.93, 0.9, 0.85, 1.05]) * stack.thickness
    pressure = stack.pressure(thickness)
    expected = [exact_pressure(stack, cell, thickness[cell]) for cell in range(4)]
    np.testing.assert_allclose(pressure, expected, rtol=1e-9)
    assert (pressure[:3] > 1e3).all() and pressure[3] < -1e3
    each = stack.of_plies(thickness)
    np.testing.assert_allclose(each.sum(axis=0), thickness, rtol=1e-14)
    assert (each[1, 2], each[2, 0], each[2, 2]) == (0.0, 0.0, 0.0)
    for ply, own in zip(stack.plies, each, strict=True):
        np.testing.assert_allclose(ply.law.pressure(own[ply.cells]), pressure[ply.cells], rtol=1e-9)
    # the plies give way unlike: none of them by the part of the whole stack
    assert np.ptp(each[:, 1] / [ply.law.thickness[-1] for ply in stack.plies]) > 0.03


def test_the_compliance_is_the_sum_of_those_of_the_plies(unlike):
    stack = unlike()
    thickness = np.array([0.93, 0.9, 0.85, 1.05]) * stack.thickness
    each = zip(stack.plies, stack.of_plies(thickness), strict=True)
    total = np.zeros(4)
    for ply, own in each:
        total[ply.cells] += 1.0 / ply.law.stiffness(own[ply.cells])
    np.testing.assert_allclose(1.0 / stack.stiffness(thickness), total, rtol=1e-9)
    step = 1e-5 * stack.thickness
    slope = (stack.pressure(thickness - step) - stack.pressure(thickness + step)) / (2.0 * step)
    np.testing.assert_allclose(stack.stiffness(thickness), slope, rtol=1e-4)


def test_every_ply_remembers_its_own_way(unlike):
    stack = unlike()
    pressed = stack.thickness_under(np.full(4, 5e4))
    stack.remember(pressed)
    (with_set,) = (ply for ply in stack.plies if ply.name == "fabric-with-set")
    alone = CellCompaction(with_set.law.material, with_set.law.thickness, with_set.law.area_stretch)
    alone.remember(alone.thickness_under(np.full(3, 5e4)))
    assert np.abs(alone.history).min() > 0.01
    np.testing.assert_allclose(with_set.law.history, alone.history, rtol=1e-9)
    back = stack.thickness_under(np.full(4, 1e3))
    first = unlike().thickness_under(np.full(4, 1e3))
    assert (back[[0, 1, 3]] < 0.99 * first[[0, 1, 3]]).all() and back[2] == first[2]
    other = unlike()
    other.history = stack.history.copy()
    np.testing.assert_array_equal(other.thickness_under(np.full(4, 1e3)), back)


def test_what_no_ply_bears_is_named_with_the_ply(unlike):
    stack = unlike()
    with pytest.raises(SimulationError, match='cell 1 .* law of the ply "isotropic" gives at any'):
        stack.thickness_under(np.full(4, 1e6))
    with pytest.raises(SimulationError, match='cell 3 .* law of the ply "isotropic" gives no more'):
        stack.pressure(stack.thickness * np.array([0.7, 0.8, 0.7, 0.4]))
    part = LocalCompaction(stack, Bag(lambda t: 1e5 if t == 0.0 else 1e9), np.ones(4))
    with pytest.raises(PartFailed, match="would have to bear"):
        part.advance(1.0)


def test_a_press_finds_one_gap_for_columns_of_unlike_plies(unlike):
    stack, area = unlike(), np.array([1.0, 2.0, 1.5, 0.5])
    part = LocalCompaction(stack, Press(3e5), area, pore_pressure=1e3)
    (gap,) = np.unique(part.thickness)
    assert float(area @ (stack.pressure(part.thickness) + 1e3)) == pytest.approx(3e5, rel=1e-9)
    assert gap >= stack.thinnest.max()
    alone = stack.pressure(part.thickness)
    assert alone[1] > alone[0] > alone[2]  # three plies, two, and one
    before = part.get_fields(["thickness"])["thickness"]
    pore = 1e3 + 10.0
    part.set_fields({PORE_PRESSURE: np.full(4, pore)})
    part.advance(1.0)
    slope = part.get_fields(["volume_rate_slope"])["volume_rate_slope"] / area
    np.testing.assert_allclose((part.thickness - before) / 10.0, slope, rtol=1e-2)
    with pytest.raises(SimulationError, match='law of the ply "isotropic" gives no more'):
        LocalCompaction(unlike(), Press(6e5), area)


@pytest.mark.parametrize("closure", [Bag(lambda t: 3e4 + 1e4 * np.sin(t)), Gap(2.5e-3)])
def test_saved_and_restored_is_bit_identical(unlike, closure):
    part = LocalCompaction(unlike(), closure, np.ones(4))
    part.advance(1.0)
    saved = part.save()
    names = ["thickness", "fibre_pressure", "volume_rate_slope"]

    def on():
        part.set_fields({PORE_PRESSURE: np.full(4, 2e3)})
        part.advance(1.0)
        return part.get_fields(names)

    first = on()
    part.restore(saved)
    again = on()
    for name in names:
        np.testing.assert_array_equal(first[name], again[name])
