"""A bent sheet gets thinner: bending energy falls with the thickness, which compaction resists.

The strain E11^ζ = κ h λ of a strip bent to the curvature κ (h half the thickness, λ its stretch)
has the energy ½ C11^B (κ h λ)²/3 per volume. It is balanced by the compaction stress:
S33 = -C11^B (κ h)²/3. On the die fillet of the hemisphere (10 mm) this alone takes off 13 % of
MD600. Freely bent to radii below about 14 mm, such a strip localises its bending in kinks (manual:
limits).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import brentq

from lcmchain.fields.derived import derive_fields, pressure_fields
from lcmchain.model import Model, build_model
from lcmchain.scene import scene_from_text
from lcmchain.statics import DirectorCouples, StaticProblem, solve

EDGE, COUNT = 5e-3, 6
SCENE = f"""
process = {{ time = "1 s" }}
blank = {{ size = ["{1e3 * EDGE * COUNT} mm", "{2e3 * EDGE} mm"], edge_length = "{1e3 * EDGE} mm" }}
material = {{ preset = "MD600" }}
"""


def expected_stretch(material, curvature):
    """Thickness stretch at which compaction and bending are in balance."""
    half = 0.5 * material.thickness
    pull = material.law.B11 * (curvature * half) ** 2 / 3.0

    def out_of_balance(stretch):
        strain = np.zeros(6)
        strain[2] = 0.5 * (stretch**2 - 1.0)
        return material.stress_and_tangent(strain)[0][2] + pull

    return brentq(out_of_balance, 0.5, 1.0)


class Bent(NamedTuple):
    """A strip bent to a circle by couples at its tip."""

    model: Model
    positions: np.ndarray  # (node_count, 3) [m]
    thickness: np.ndarray  # (element_count,) [m]
    turn: np.ndarray  # of the elements along the strip [rad]

    @property
    def history(self) -> np.ndarray:
        """What the elements take of their neighbours' curvature at these positions."""
        past = self.model.only_body().no_history()
        self.model.only_body().renew(np.ascontiguousarray(self.positions.T), past)
        return past

    @property
    def inside(self) -> np.ndarray:
        """Elements away from the ends, where the normals of the nodes are those of one chord."""
        middle = (
            self.model.only_body()
            .mesh.node_positions[self.model.only_body().mesh.elements]
            .mean(axis=1)
        )
        return np.abs(middle[:, 0]) < EDGE * (0.5 * COUNT - 1)


def bend(radius, load, element=""):
    """Bend a strip with ``load`` times the moment of an elastica of this radius."""
    model = build_model(scene_from_text(SCENE + element))
    X, pairs = model.only_body().mesh.node_positions, model.only_body().mesh.pair_count
    clamped = X[:, 0] < X[:, 0].min() + 1e-9
    held = np.array([clamped, clamped, clamped & (np.arange(len(X)) < pairs)])
    tip = np.flatnonzero(X[:pairs, 0] > X[:, 0].max() - 1e-9)
    on_edge = np.abs(X[tip, 1]) > 1e-9
    full = (
        model.only_body().material.law.B11
        * model.only_body().material.thickness ** 3
        / 12.0
        / radius
        * 2.0
        * EDGE
    )
    couples = DirectorCouples(tip, np.array([0.0, 1.0, 0.0]), full * np.where(on_edge, 0.25, 0.5))
    problem = StaticProblem(model=model, held=held, couples=(couples,))
    x = X + solve(problem, [load], first_step=0.1)[-1].displacement.T
    middle = 0.5 * (x[:pairs] + x[pairs:])[np.abs(X[:pairs, 1]) < 1e-9]
    middle = middle[np.argsort(X[:pairs, 0][np.abs(X[:pairs, 1]) < 1e-9])]
    turn = np.diff(np.unwrap(np.arctan2(*np.diff(middle, axis=0)[:, [2, 0]].T)))
    np.testing.assert_allclose(turn, turn.mean(), rtol=1e-6)  # a circle
    return Bent(
        model,
        x,
        derive_fields(model.only_body().mesh, model.only_body().material, x)["thickness"],
        np.abs(turn),
    )


@pytest.mark.parametrize("radius", [50e-3, 20e-3, 16e-3])
def test_thickness_of_a_strip_bent_to_a_circle(radius):
    # less than the moment of the radius by what the thinning takes: reached from below
    bent = bend(radius, 0.8)
    material, thickness = bent.model.only_body().material, bent.thickness
    curvature = 2.0 * np.sin(0.5 * bent.turn.mean()) / EDGE  # of directors over a chord
    expected = expected_stretch(material, curvature) * material.thickness
    np.testing.assert_allclose(thickness, expected, rtol=2e-3)
    assert (thickness < 0.995 * material.thickness).all() or radius > 40e-3

    # nothing presses on the strip, whatever its stress S33 is
    body, inside = bent.model.only_body(), bent.inside
    pressure = pressure_fields(body, bent.positions, bent.history)
    assert inside.sum() == 2 * (COUNT - 2)
    contact, bending = (pressure[f"{name}_pressure"][inside] for name in ("compaction", "bending"))
    pull = material.law.B11 * (0.5 * material.thickness * curvature) ** 2 / 3.0
    np.testing.assert_allclose(bending, pull * thickness[inside] / material.thickness, rtol=0.01)
    assert np.abs(contact).max() < 1e-3 * bending.min()


@pytest.mark.parametrize("radius", [50e-3, 20e-3])
def test_at_the_reference_thickness_it_stays_as_thick_and_as_stiff(radius):
    """The moment of the elastica bends to its radius; bending does not press."""
    bent = bend(radius, 1.0, 'element = { bending_thickness = "reference" }')
    # strain 2 sin(φ/2)/L of a chord; the moment works on its change with the turn φ, cos(φ/2)/L
    np.testing.assert_allclose(np.sin(bent.turn) / EDGE, 1.0 / radius, rtol=1e-3)
    np.testing.assert_allclose(bent.thickness, bent.model.only_body().material.thickness, rtol=1e-3)
    body = bent.model.only_body()
    pressure = pressure_fields(body, bent.positions, bent.history)
    pull = (
        bent.model.only_body().material.law.B11
        * (0.5 * bent.model.only_body().material.thickness / radius) ** 2
        / 3.0
    )
    for name in ("compaction_pressure", "bending_pressure"):
        assert np.abs(pressure[name][bent.inside]).max() < 0.01 * pull, name
