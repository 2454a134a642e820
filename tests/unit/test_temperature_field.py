"""Temperature over the blank: its grid, its elements' own times, and the state that keeps them."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.coupons.compaction import compaction
from lcmchain.errors import InputError
from lcmchain.materials.features.relaxation import CompactionRelaxation
from lcmchain.materials.features.temperature_field import (
    RATE_FACTOR,
    TemperatureField,
    arrhenius_factor,
)
from lcmchain.materials.features.viscous_shear import Relaxation, ViscousShear
from lcmchain.materials.law import (
    Step,
    evolved_history,
    membrane_response,
    own_memory,
    place_in_memory,
    stress_in_step,
    viscosity,
)
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.state import State
from lcmchain.verification import random_elements as make

FIELD = TemperatureField(
    x=(-0.01, 0.0, 0.02), y=(0.0, 0.01), reference=560.0, energy=6e4,
    temperature=((550.0, 560.0, 590.0), (550.0, 570.0, 590.0)),
)  # fmt: skip
SCENE = """
title = "field"
process = {{ time = "1 ms" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
[material.viscous]
viscosity = "2000 Pa*s"
reference_temperature = "560 K"
activation_energy = "60 kJ/mol"
{}
"""
VISCOUS = ViscousShear(
    viscosity=2e3, infinite_viscosity=100.0, time_constant=0.01, exponent=0.3,
    terms=(Relaxation(5e4, 0.1),),
)  # fmt: skip


def fabric(temperature=None, factor=1.0):
    """Cross, a Maxwell element of the shear and one of the compaction, all at a temperature."""
    return make.Fabric(
        make.md600().law, thickness=make.THICKNESS, areal_mass=0.6, fibre_density=1810.0,
        viscous=VISCOUS.shifted(factor), temperature=temperature,
        relaxation=CompactionRelaxation((Relaxation(0.5, 0.2),)).shifted(factor),
    )  # fmt: skip


def test_temperatures_are_linear_between_the_points_of_the_grid_and_stay_beyond():
    points = np.array([[-0.005, 0.0, 1.0], [0.01, 0.005, 0.0], [0.5, -3.0, 0.0], [-1.0, 9.0, 0.0]])
    np.testing.assert_allclose(FIELD.at(points), [555.0, 577.5, 590.0, 550.0])
    line = TemperatureField((0.0, 1.0), (0.0,), ((300.0, 310.0),), 300.0, 5e4)
    np.testing.assert_allclose(line.at(np.array([[0.3, 7.0]])), [303.0])
    assert FIELD.slowest == pytest.approx(arrhenius_factor(550.0, 560.0, 6e4))


@pytest.mark.parametrize("kelvin", [545.0, 590.0])
def test_an_element_has_the_law_of_its_temperature(kelvin):
    """Stress, memory and bound are those of the shifted law, whatever the steps are."""
    factor = arrhenius_factor(kelvin, 560.0, 6e4)
    heated, shifted = fabric(FIELD), fabric(factor=factor)
    assert type(heated.law).__name__ == "Cross1HeatedRelaxing1CompactionFabricLaw"
    place = place_in_memory(heated.law, RATE_FACTOR)
    assert heated.law.remembers[place].name == "rate_factor"
    past = np.array(shifted_past := [0.0] * len(shifted.law.remembers))
    own = np.insert(past, place, 1.0 / factor)
    for k, size in enumerate((0.01, 0.3, 0.002)):
        E = (0.0, 0.0, -0.05 * (k + 1), 0.1 * (k + 1), 0.0, 0.0)
        S, C = membrane_response(heated.law, E, (*own, size, 0.0))
        expected, tangent = membrane_response(shifted.law, E, (*shifted_past, size, 0.0))
        np.testing.assert_allclose(S, expected, rtol=1e-11, atol=1e-6)
        np.testing.assert_allclose(C, tangent, rtol=1e-12)
        plain = stress_in_step(heated, np.array([E]), np.array(own)[:, None], Step(size, 0.0))[0][0]
        np.testing.assert_allclose(S, plain, rtol=1e-9, atol=1e-6)
        eta = viscosity(heated.law, E, (*own, size, 0.0))[3]
        limit = viscosity(shifted.law, E, (*shifted_past, size, 0.0))[3]
        assert eta == pytest.approx(limit, rel=1e-12)
        own = evolved_history(heated.law, E, (*own, size, 0.0))
        shifted_past = evolved_history(shifted.law, E, (*shifted_past, size, 0.0))
        assert own[place] == 1.0 / factor
        np.testing.assert_allclose(np.delete(own, place), shifted_past, rtol=1e-10, atol=1e-9)


def test_the_state_at_rest_holds_the_field_of_the_scene():
    text = 'temperature_field = { x = "-5 5 mm", temperature = ["550 K", "570 K"] }'
    model = build_model(scene_from_text(SCENE.format(text)))
    (body,) = model.bodies
    state = State.at_rest(model)
    own = body.element_history(model.history_of(body, state.history))
    factor = own[place_in_memory(body.material.law, RATE_FACTOR)]
    x = body.mesh.node_positions[body.mesh.elements].mean(axis=1)[:, 0]
    kelvin = np.interp(x, [-5e-3, 5e-3], [550.0, 570.0])
    expected = [1.0 / arrhenius_factor(own, 560.0, 6e4) for own in kelvin]
    np.testing.assert_allclose(factor, expected, rtol=1e-12)
    assert np.ptp(factor) > 0.3
    assert not np.delete(own, place_in_memory(body.material.law, RATE_FACTOR), axis=0).any()
    # the coldest element bounds the step
    coldest = arrhenius_factor(kelvin.min(), 560.0, 6e4)
    assert body.material.temperature.slowest == pytest.approx(coldest)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ('temperature = "280 degC"\ntemperature_field = { x = "0 1 mm", temperature = ["1 K", '
         '"2 K"] }', "cannot stand beside temperature"),
        ('temperature_field = { x = "1 0 mm", temperature = ["1 K", "2 K"] }', "x: must rise"),
        ('temperature_field = { x = "0 1 mm", temperature = ["1 K"] }', "give 2"),
    ],
)  # fmt: skip
def test_a_wrong_field_is_refused_by_name(entries, message):
    with pytest.raises(InputError, match=message):
        scene_from_text(SCENE.format(entries))


def test_a_coupon_has_one_temperature():
    text = 'temperature_field = { x = "-5 5 mm", temperature = ["550 K", "570 K"] }'
    material = scene_from_text(SCENE.format(text)).material
    with pytest.raises(InputError, match="differs over the blank, and a coupon has one"):
        compaction(material)


def test_all_that_a_fabric_remembers_stands_one_behind_the_other():
    """Relaxing compaction, a temperature, rates and friction of the shear, and of the bending."""
    fabric = scene_from_text(
        """
process = { time = "20 ms" }
blank = { size = ["20 mm", "20 mm"], edge_length = "10 mm", height = "0.502 mm" }
[material]
preset = "MD600"
compaction.shear_coupling = 0.7
membrane.friction = { stress = "5 kPa", angle = "1 deg", growth = 0.3 }
bending.friction_1 = { moment = "0.02 N", curvature = "4 1/m" }
[material.viscous]
viscosity = "2000 Pa*s"
maxwell = [{ modulus = "0.05 MPa", relaxation_time = "2 ms" }]
compaction = [{ share = 0.5, relaxation_time = "4 ms" }, { share = 0.3, relaxation_time = "1 s" }]
reference_temperature = "290 degC"
activation_energy = "60 kJ/mol"
temperature_field = { x = "-10 10 mm", temperature = ["270 degC", "310 degC"] }
"""
    ).material.build()
    law, memory = fabric.law, fabric.initial_history(np.array([[2e-3, 0.0, 0.0]]))[:, 0]
    size, factor = 1e-3, memory[place_in_memory(fabric.law, RATE_FACTOR)]
    assert factor != 1.0
    for E in ((0, 0, -0.05, 0.1, 0, 0), (0, 0, -0.1, 0.25, 0, 0), (0, 0, -0.07, 0.2, 0, 0)):
        E = np.array(E, dtype=float)
        step = Step(size, 0.0)
        found = membrane_response(law, tuple(E), (*memory, *step))[0]
        plain = (
            fabric.stress_and_tangent(E)[0] + fabric.rate_stress(E[None], memory[:, None], step)[0]
        )
        np.testing.assert_allclose(found, plain, rtol=1e-9, atol=1e-3)
        elastic = fabric._shear(E[3])[0]
        after = [
            *fabric.relaxed(E, memory[: len(fabric.relaxation.memory)], size * factor),
            factor,
            *fabric.viscous.in_step(
                E[3], own_memory(law, fabric.viscous.memory, memory), size * factor
            ),
            *fabric.shear_friction.in_step(
                E[3], own_memory(law, fabric.shear_friction.memory, memory), elastic
            ),
        ]
        kept = evolved_history(law, tuple(E), (*memory, *step))
        np.testing.assert_allclose(kept, after, rtol=1e-9, atol=1e-12)
        memory[: len(after)] = after
    assert len(memory) == len(after) + len(fabric.bending_losses.memory)
    names = [entry.name for entry in law.remembers]
    assert names[len(after)] == "curvature_before_1"
