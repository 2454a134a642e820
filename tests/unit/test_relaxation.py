"""Compaction that relaxes: held gap, held pressure, energy books, and the compiled law."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lcmchain.coupons.compaction import compaction, relaxing_pressure
from lcmchain.errors import InputError
from lcmchain.identification.from_file import identify_compaction_file
from lcmchain.materials.features import relaxation
from lcmchain.materials.features.relaxation import CompactionRelaxation
from lcmchain.materials.features.shear_compaction import PowerCoupling
from lcmchain.materials.features.viscous_shear import Relaxation, ViscousShear
from lcmchain.materials.law import Step, evolved_history, membrane_response, stress_in_step
from lcmchain.scene import scene_from_text
from lcmchain.verification import random_elements as make

SCENE = """
title = "material"
process = {{ time = "1 s" }}
blank = {{ size = ["20 mm", "20 mm"], edge_length = "5 mm" }}
[material]
preset = "MD600"
{}
"""
TERMS = (Relaxation(0.5, 0.2), Relaxation(0.3, 3.0))
RELAXING = CompactionRelaxation(TERMS)
TABLE = """
[[material.viscous.compaction]]
share = 0.5
relaxation_time = "0.2 s"
[[material.viscous.compaction]]
share = 0.3
relaxation_time = "3 s"
"""


@pytest.fixture(scope="module")
def fabric():
    law = make.md600().law
    return make.Fabric(
        law, thickness=make.THICKNESS, areal_mass=0.6, fibre_density=1810.0, relaxation=RELAXING
    )


def voigt(E33, g=0.0):
    return np.array([0.0, 0.0, E33, g, 0.0, 0.0])


def advanced(material, past, E33, g, size):
    """Stress S33 at the end of a step of the compiled law, and its memory there."""
    E = tuple(map(float, voigt(E33, g)))
    whole = (*past, size, 0.0)
    return membrane_response(material.law, E, whole)[0], evolved_history(material.law, E, whole)


def start(material):
    return (0.0,) * len(material.law.remembers)


@pytest.mark.parametrize("E33", [-0.1, -0.28])
def test_the_pressure_on_a_held_gap_falls_as_the_sum_of_exponentials(fabric, E33):
    """Closed at once: S (1 + Σ r exp(-t/l)), to rounding, in steps of any size."""
    law = float(fabric.stress_and_tangent(voigt(E33))[0][2])
    S, past = advanced(fabric, start(fabric), E33, 0.0, 0.0)
    assert S[2] == pytest.approx(1.8 * law, rel=1e-12)
    time = 0.0
    for size in (0.01, 0.3, 0.002, 1.0, 7.0):
        time += size
        S, past = advanced(fabric, past, E33, 0.0, size)
        expected = law * (1.0 + sum(r * math.exp(-time / t) for r, t in TERMS))
        assert S[2] == pytest.approx(expected, rel=1e-12)


def test_a_gap_that_closes_steadily_follows_the_convolution(fabric):
    """S of the law grows at a constant rate: Σ r l S' (1 - exp(-t/l)) comes to it, exactly."""
    past, rate = start(fabric), -2e4
    for k in range(1, 41):
        strain = float(relaxation.strain_at(np.array(rate * 0.05 * k), fabric.law))
        S, past = advanced(fabric, past, strain, 0.0, 0.05)
    time = 2.0
    expected = rate * (time + sum(r * t * (1.0 - math.exp(-time / t)) for r, t in TERMS))
    assert S[2] == pytest.approx(expected, rel=1e-9)


def test_under_a_held_pressure_the_gap_closes_on_as_in_closed_form():
    """One element: S = σ (1 - r/(1 + r) exp(-t/((1 + r) l))), within 0.5 % at steps of l/50."""
    r, t = 0.8, 1.0
    fabric = make.Fabric(
        make.md600().law, thickness=make.THICKNESS, areal_mass=0.6, fibre_density=1810.0,
        relaxation=CompactionRelaxation((Relaxation(r, t),)),
    )  # fmt: skip
    held, size = -1e5, 0.02 * t
    law = held / (1.0 + r)
    strain = float(relaxation.strain_at(law, fabric.law))
    _, past = advanced(fabric, start(fabric), strain, 0.0, 0.0)
    for k in range(1, 201):
        # the law's stress at which law and element together bear what is held
        x = size / t
        mean = r * -math.expm1(-x) / x
        law = (held - math.exp(-x) * past[3] + mean * past[1]) / (1.0 + mean)
        strain = float(relaxation.strain_at(law, fabric.law))
        S, past = advanced(fabric, past, strain, 0.0, size)
        assert S[2] == pytest.approx(held, rel=1e-9)
        expected = held * (1.0 - r / (1.0 + r) * math.exp(-k * size / ((1.0 + r) * t)))
        assert law == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("beta", [0.0, 1.0])
def test_the_work_is_what_is_stored_and_what_is_lost(beta):
    """Closing, shear, holding, and opening again: loss never falls, the books close to 0.1 %."""
    coupling = PowerCoupling(beta) if beta else None
    material = make.Fabric(
        make.md600().law, thickness=make.THICKNESS, areal_mass=0.6, fibre_density=1810.0,
        relaxation=RELAXING, coupling=coupling,
    )  # fmt: skip
    size, work, past, lost = 1e-2, 0.0, start(material), 0.0
    before, S_before = voigt(0.0), np.zeros(6)
    for k in range(1, 601):
        time = k * size
        phase = min(time, 1.5) + max(time - 4.5, 0.0)
        E = voigt(-0.25 * math.sin(phase * math.pi / 3.0) ** 2, 0.25 * min(time, 2.0))
        S, past = advanced(material, past, E[2], E[3], size)
        work += 0.5 * float((np.array(S) + S_before) @ (E - before))
        before, S_before = E, np.array(S)
        if k % 25 == 0:
            history = np.array(past)[:, None]
            lost_before, lost = lost, float(material.viscous_energy(history)[0])
            assert lost > lost_before - 1e-3
    stored = float(material.membrane_energy(E[None], history)[0])
    assert lost > 0.1 * abs(work)
    assert work == pytest.approx(stored + lost, rel=1e-3)


def test_the_compiled_law_agrees_with_numpy():
    """Behind a table of pressures and before the rate of the shear, of any memory."""
    viscous = ViscousShear(viscosity=2e3, terms=(Relaxation(5e4, 0.1),))
    material = make.Fabric(
        make.md600().law, thickness=make.THICKNESS, areal_mass=0.6, fibre_density=1810.0,
        relaxation=RELAXING, coupling=PowerCoupling(0.8), viscous=viscous,
    )  # fmt: skip
    assert type(material.law).__name__ == "Newton1Relaxing2CompactionCoupledFabricLaw"
    names = [own.name for own in material.law.remembers]
    assert names[:3] == [own.name for own in relaxation.OWN_MEMORY] and len(names) == 9
    past = (-0.05, -1e4, 20.0, -3e3, -2e3, 0.1, 500.0, 3.0, 800.0)
    E, size = voigt(-0.2, 0.3), 0.04
    S, C = membrane_response(material.law, tuple(map(float, E)), (*past, size, 0.0))
    expected, tangent = stress_in_step(material, E[None], np.array(past)[:, None], Step(size, 0.0))
    np.testing.assert_allclose(S, expected[0], rtol=1e-10, atol=1e-6)
    assert C[2] == pytest.approx(1.8 * tangent[0, 2, 2])
    after = evolved_history(material.law, tuple(map(float, E)), (*past, size, 0.0))
    seen = np.array(material._seen(E))
    own = RELAXING.in_step(seen, material._compaction(seen)[0], np.array(past[:5]), size)
    np.testing.assert_allclose(after[:5], own, rtol=1e-10)
    np.testing.assert_allclose(after[5:], viscous.in_step(0.3, np.array(past[5:]), size), rtol=1e-9)


def test_a_scene_states_what_relaxes_and_the_temperature_shifts_it():
    material = scene_from_text(SCENE.format(TABLE)).material
    assert material.relaxes and material.resists_rates and not material.resists_shear_rates
    built = material.build()
    assert built.relaxation == RELAXING and built.viscous is None
    assert not material.without_relaxation().resists_rates
    warm = '[material.viscous]\ntemperature = "320 K"\nreference_temperature = "300 K"\n'
    warm += 'activation_energy = "50 kJ/mol"\nviscosity = "100 Pa*s"\n'
    shifted = scene_from_text(SCENE.format(warm + TABLE)).material
    factor = shifted.viscous.time_factor
    assert factor < 0.3
    times = [term.time for term in shifted.build().relaxation.terms]
    assert times == pytest.approx([0.2 * factor, 3.0 * factor])
    assert shifted.without_viscosity().relaxes and not shifted.without_relaxation().relaxes


def test_what_cannot_relax_is_refused_by_name():
    set_too = 'law = "fabric-with-set"\ncompaction.permanent_set = 0.3\n' + TABLE
    with pytest.raises(InputError, match=r"viscous\.compaction: .*leaves a set"):
        scene_from_text(SCENE.format(set_too))
    with pytest.raises(InputError, match="or relaxing compaction"):
        scene_from_text(SCENE.format("[material.viscous]\n"))


# --- identification -------------------------------------------------------------------------------


HELD = (Relaxation(0.5, 0.4), Relaxation(0.3, 6.0))


def held_test(tmp_path, noise=0.01, terms=HELD):
    """A file of MD600 that closes to 0.7 mm in 2 s and is held for 20 s."""
    rng = np.random.default_rng(4)
    time = np.concatenate([np.linspace(0.05, 2.0, 40), 2.0 + np.geomspace(0.03, 20.0, 60)])
    thickness = 1.004 - 0.304 * np.minimum(time, 2.0) / 2.0
    built = make.Fabric(
        make.md600().law, thickness=make.THICKNESS, areal_mass=0.6, fibre_density=1810.0,
        relaxation=CompactionRelaxation(terms),
    )  # fmt: skip
    times, stretch = np.append(0.0, time), np.append(1.0, thickness / 1.004)
    pressure = relaxing_pressure(built, times, stretch, 0.0)[1:]
    pressure *= 1.0 + noise * rng.standard_normal(len(time))
    rows = zip(time, thickness, 1e-6 * pressure, strict=True)
    file = tmp_path / "held.csv"
    text = "".join(f"{t:.8g},{h:.8g},{p:.8g}\n" for t, h, p in rows)
    file.write_text("time,thickness [mm],pressure [MPa]\n" + text, encoding="utf-8")
    return file


def test_shares_and_times_are_found_from_a_held_test(tmp_path):
    """Within their intervals of 1 % noise, and c0 within 8 %; the scene takes them."""
    found = identify_compaction_file(held_test(tmp_path), {})
    for name, true in (("share_1", 0.5), ("share_2", 0.3), ("relaxation_time_2", 6.0)):
        assert found[name].low < true < found[name].high
        assert found[name].value == pytest.approx(true, rel=0.15)
    assert found["relaxation_time_1"].value == pytest.approx(0.4, rel=0.15)
    assert found["c0"].value == pytest.approx(0.1563e6, rel=0.08)
    assert len(found.parameters) == 7 and not found.warnings
    entries = "\n".join(f"{key} = {text}" for key, text in found.scene_entries.items())
    own = scene_from_text(SCENE.format(entries)).material.build()
    assert own.relaxation.share_at_once == pytest.approx(0.8, rel=0.05)


def test_a_hold_too_short_for_what_relaxes_is_told(tmp_path):
    found = identify_compaction_file(held_test(tmp_path, 0.002, (Relaxation(0.5, 60.0),)), {})
    assert any("is beyond the hold of 20 s" in text for text in found.warnings)


# --- coupons --------------------------------------------------------------------------------------


def test_a_fabric_that_does_not_relax_is_not_held():
    material = scene_from_text(SCENE.format("")).material
    with pytest.raises(InputError, match=r"--hold: lets the fabric relax, but its compaction"):
        compaction(material, hold=1.0)


@pytest.mark.slow
def test_the_pressure_between_plates_that_stand_still_falls_as_the_law_says():
    """0.1 % of the law along the thickness held, 0.5 % in loading; books of the run to 0.1 %."""
    table = TABLE.replace("0.2 s", "10 ms").replace("3 s", "60 ms")
    material = scene_from_text(SCENE.format(table)).material
    result = compaction(material, size=10e-3, pressure=0.5e6, hold=0.05)
    held = [own for own in result.comparisons if "after the stop" in own.quantity]
    assert len(held) == 20 and held[-1].value < 0.9 * held[0].value
    assert max(abs(own.relative) for own in held) < 1e-3
    assert max(abs(own.relative) for own in result.comparisons) < 5e-3
    assert abs(result.figures["balance_error_to_internal"]) < 1e-3
