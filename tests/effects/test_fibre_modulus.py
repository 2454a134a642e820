"""A lowered modulus of fibres: a larger step, and a strain held against what was allowed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lcmchain.check import run_effects
from lcmchain.errors import InputError
from lcmchain.judgements.fields import fibre_strain_warnings
from lcmchain.model import build_model
from lcmchain.pipeline import run
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SHEET = """
process = { time = "1 ms", frames = 2 }
blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm", height = "0.502 mm" }
material = { preset = "MD600" }
output = { pictures = false, vtu = false }
"""
STEEL = """
process = { time = "1 ms" }
blank = { size = ["40 mm", "30 mm"], edge_length = "5 mm" }
[material]
law = "isotropic"
thickness = "1 mm"
density = "7800 kg/m^3"
young_modulus = "210 GPa"
poisson_ratio = 0.3
"""
# a stretched sheet: a plate presses a strip, whose ends are drawn down by their inertia
PRESSED = """
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "20 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "3 mm" }
"""


def scene(*overrides, text=SHEET):
    return scene_from_text(text, overrides=overrides)


@pytest.mark.parametrize(
    "material", ["", ', law = "fabric-with-set", compaction.permanent_set = 0.3']
)
def test_the_moduli_of_the_membrane_and_only_they_are_lowered(material):
    text = SHEET.replace('preset = "MD600"', f'preset = "MD600"{material}')
    plain, low = (
        build_model(scene(*chosen, text=text)).only_body().material
        for chosen in ((), ("process.fibre_modulus_factor=0.25",))
    )
    changed = {
        name: (before, after)
        for name, before, after in zip(plain.law._fields, plain.law, low.law, strict=True)
        if before != after
    }
    assert set(changed) == {"C11", "C22"} and type(low.law) is type(plain.law)
    for before, after in changed.values():
        assert after == 0.25 * before
    assert low.fibre_bending == plain.fibre_bending
    E = np.random.default_rng(0).uniform(-0.1, 0.1, 6)
    ratio = low.stress_and_tangent(E)[0] / plain.stress_and_tangent(E)[0]
    np.testing.assert_allclose(ratio, [0.25, 0.25, 1, 1, 1, 1], rtol=1e-14)


@pytest.mark.parametrize("element", ["solid-shell", "membrane-shell"])
def test_the_step_grows_with_the_root(element):
    def step(*chosen):
        return Simulation(build_model(scene(f"element={element}", *chosen))).critical_step()

    # the small moduli of shear keep theirs
    assert step("process.fibre_modulus_factor=0.25") == pytest.approx(2.0 * step(), rel=5e-3)


def test_a_law_without_fibres_has_none_to_lower():
    with pytest.raises(InputError, match="process.fibre_modulus_factor.*no fibres"):
        scene("process.fibre_modulus_factor=0.5", text=STEEL)


def test_the_audit_names_it():
    low = scene("process.fibre_modulus_factor=0.25")
    told = {effect.name: effect for effect in run_effects(low, build_model(low))}
    assert told["lowered fibre modulus"].active
    assert "0.25" in told["lowered fibre modulus"].reason
    told = {effect.name: effect for effect in run_effects(scene(), build_model(scene()))}
    assert not told["lowered fibre modulus"].active


def test_a_run_holds_the_strain_against_what_was_allowed(tmp_path):
    def summary(name, *chosen):
        run(scene(*chosen, text=SHEET + PRESSED), tmp_path / name)
        return json.loads((tmp_path / name / "summary.json").read_text())

    low = summary("low", "process.fibre_modulus_factor=0.25", "process.fibre_strain_allowed=1e-5")
    assert low["fibre_strain_largest"] >= low["fibre_strain_max"] > 1e-5
    told = [warning for warning in low["warnings"] if "fibre_modulus_factor" in warning]
    assert len(told) == 1 and "leave it out" in told[0]
    allowed = summary(
        "allowed", "process.fibre_modulus_factor=0.25", "process.fibre_strain_allowed=0.1"
    )
    assert not [warning for warning in allowed["warnings"] if "fibre_modulus_factor" in warning]
    assert allowed["fibre_strain_largest"] == low["fibre_strain_largest"]
    expected = max(0.25 * low["fibre_strain_largest"] / 0.1, 0.01)
    assert expected <= allowed["fibre_modulus_factor_possible"] <= 1.1 * expected


def test_the_warning_names_the_factor_to_use():
    measures = {
        "fibre_modulus_factor": 0.1, "fibre_strain_largest": 0.0043, "fibre_strain_allowed": 0.002,
        "fibre_modulus_factor_possible": 0.22,
    }  # fmt: skip
    (warning,) = fibre_strain_warnings(measures)
    assert (
        "use 0.22" in warning and "0.43 %" in warning and "fibre_strain_allowed = 0.0043" in warning
    )
    assert fibre_strain_warnings(measures | {"fibre_modulus_factor": 1.0}) == []
    assert fibre_strain_warnings(measures | {"fibre_strain_allowed": 0.0043}) == []


def test_fibres_that_the_report_finds_too_long_are_warned_of_at_any_modulus():
    measures = {
        "fibre_modulus_factor": 1.0, "fibre_strain_largest": 0.02, "fibre_strain_allowed": 0.002,
        "fibre_modulus_factor_possible": 1.0,
    }  # fmt: skip
    for strain, told in ((0.0049, False), (0.0051, True), (0.018, True)):
        assert bool(fibre_strain_warnings(measures | {"fibre_strain_max": strain})) == told
    (warning,) = fibre_strain_warnings(measures | {"fibre_strain_max": 0.018})
    assert "up to 1.8 % (good up to 0.5 %)" in warning
