"""The permeability of cells that are compacted follows its law, where that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.errors import SimulationError

from .conftest import GATE, HEAD, VENT

POWER = """
[permeability]
law = "power"
fibre_volume_fraction = 0.5
k1 = "4e-11 m^2"
k2 = "1e-11 m^2"
k3 = "1e-12 m^2"
exponents = [4, 4, 4]
fibre_volume_fraction_range = [0.3, 0.7]
"""
SCENE = 'material = { preset = "MD600" }\n'


def factor(part, *texts, kit, now=0.6, before=0.5):
    preform = set_up(part, kit.case(HEAD, GATE, VENT, *texts)).preform
    count = len(preform.thickness)
    return preform.factor(np.full(count, now), np.full(count, before))


def test_a_law_of_the_case_leads(kit):
    found = factor(read_formed_part(kit.forming()), POWER, kit=kit)
    np.testing.assert_allclose(found, (0.5 / 0.6) ** 4, rtol=1e-12)


def test_else_the_law_of_the_scene_that_formed_the_part(kit):
    part = read_formed_part(kit.forming())
    formed = replace(part, dataset=part.dataset.assign_attrs(scene=SCENE + POWER))
    np.testing.assert_allclose(factor(formed, kit=kit), (0.5 / 0.6) ** 4, rtol=1e-12)


def test_without_a_law_it_is_kozeny_and_carman(kit):
    found = factor(read_formed_part(kit.forming()), kit=kit)
    np.testing.assert_allclose(found, (0.4 / 0.5) ** 3 * (0.5 / 0.6) ** 2, rtol=1e-12)


def test_out_of_its_range_the_law_stops_with_the_cell(kit):
    part = read_formed_part(kit.forming())
    with pytest.raises(SimulationError, match=r"cell 1 at .* of 0.75, where the permeability law"):
        factor(part, POWER, kit=kit, now=0.75)
