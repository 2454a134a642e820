"""The consistent tangent against differences of the reference element's forces, its symmetry.

The compiled kernel has the forces of the reference element (test_kernel.py).
"""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.elements.solid_shell.tangent import (
    PAIR_MODES,
    linearise,
    node_stiffness,
    normal_compaction,
)
from lcmchain.materials.features.shear_compaction import PowerCoupling
from lcmchain.verification.random_elements import CURVES

COUNT = 2

CASES = {
    "fabric flat": ("fabric", "flat", {}),
    "fabric curved": ("fabric", "curved", {}),
    "fabric flat, as published": (
        "fabric", "flat", {"hourglass": "published", "compaction_strain": "director"}
    ),
    "fabric curved, director": ("fabric", "curved", {"compaction_strain": "director"}),
    "fabric flat, no cross terms": ("fabric", "flat", {"cross_terms": False}),
    "fabric curved, soft fibres in hourglass": ("fabric", "curved", {"fibre_hourglass": 0.1}),
    "coupled fabric curved": ("coupled fabric", "curved", {}),
    "coupled fabric curved, no cross terms": (
        "coupled fabric", "curved", {"cross_terms": False}
    ),
    "full flat": ("full", "flat", {}),
    "full curved": ("full", "curved", {}),
    "full curved, director": ("full", "curved", {"compaction_strain": "director"}),
    "full flat, two points, no shear row": (
        "full", "flat", {"integration_points": 2, "in_plane_shear_hourglass": False}
    ),
    "full curved, no shear row": ("full", "curved", {"in_plane_shear_hourglass": False}),
    "equal curved": ("equal", "curved", {}),
    "fabric flat, reference thickness": (
        "fabric", "flat", {"cross_terms": False, "bending_thickness": "reference"}
    ),
    "fabric curved, reference thickness, director": (
        "fabric",
        "curved",
        {
            "cross_terms": False,
            "bending_thickness": "reference",
            "compaction_strain": "director",
        },
    ),
    "full curved, reference thickness": (
        "full", "curved", {"cross_terms": False, "bending_thickness": "reference"}
    ),
}  # fmt: skip
WITH_POTENTIAL = (
    "fabric flat, no cross terms",
    "coupled fabric curved, no cross terms",
    "equal curved",
    "fabric flat, reference thickness",
    "fabric curved, reference thickness, director",
)


@pytest.fixture
def elements(make):
    """Nodes (E, 8, 3), fibres (E, 3) and deformed nodes of random elements, law, and options."""

    def build(kind, shape, options):
        rng = np.random.default_rng(3)
        if "fabric" in kind:
            whole = {"coupling": PowerCoupling(0.8), "bending_curves": CURVES}
            material = make.md600(**whole if "coupled" in kind else {})
        else:
            material = make.coupled(rng, equal=kind == "equal")
        reference = make.flat_reference if shape == "flat" else make.curved_reference
        X, fibres = map(np.array, zip(*(reference(rng) for _ in range(COUNT))))
        x = np.array([make.deformed(rng, *element) for element in zip(X, fibres)])
        return X, fibres, x, material, ElementOptions(**{"cross_terms": True} | options)

    return build


@pytest.fixture
def batch(make, elements):
    """A model of deformed elements that share no node, and their displacement (3, 8 E)."""

    def build(*case):
        X, fibres, x, material, options = elements(*case)
        model = make.separate_elements(X, fibres, material, options)
        return model, (x - X).reshape(-1, 3).T

    return build


def tangent(model, displacement, resultants=None):
    """The linearisation of elements that have no neighbours, with which they share no curvature."""
    return linearise(model, displacement, resultants, np.zeros(model.history_size))


def difference_tangents(X, fibres, x, material, options):
    """Tangents (E, 24, 24) by central differences of fourth order of the reference element."""
    K = np.empty((COUNT, 24, 24))
    for nodes, fibre, here, own in zip(X, fibres, x, K, strict=True):
        element = ReferenceElement(nodes, fibre, material, options)
        step = 1e-3 * element.height
        for i, move in enumerate(step * np.eye(24).reshape(24, 8, 3)):
            near, far = (
                element.evaluate(here + k * move).force - element.evaluate(here - k * move).force
                for k in (1, 2)
            )
            own[:, i] = (8 * near - far).ravel() / (12 * step)
    return K


@pytest.mark.parametrize("case", CASES)
def test_tangent_is_the_derivative_of_the_forces(elements, batch, case):
    model, displacement = batch(*CASES[case])
    expected = difference_tangents(*elements(*CASES[case]))
    K = node_stiffness(tangent(model, displacement).stiffness)
    scale = abs(expected).max(axis=(1, 2))[:, None, None]
    np.testing.assert_allclose(K / scale, expected / scale, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("case", CASES)
def test_tangent_is_symmetric_where_the_element_has_a_potential(batch, case):
    model, displacement = batch(*CASES[case])
    K = node_stiffness(tangent(model, displacement).stiffness)
    asymmetry = abs(K - K.transpose(0, 2, 1)).max() / abs(K).max()
    if case in WITH_POTENTIAL:
        assert asymmetry < 1e-13
    else:
        assert asymmetry > 1e-9


def test_resultant_gradient_predicts_the_change_of_the_resultants(batch):
    model, displacement = batch("fabric", "curved", {})
    rng = np.random.default_rng(5)
    state = tangent(model, displacement)
    move = 1e-4 * model.only_body().geometry.height.min() * rng.normal(size=displacement.shape)
    there = tangent(model, displacement + move)
    back = tangent(model, displacement - move)
    corner = move.T[model.only_body().mesh.elements]
    modes = np.einsum("kn,end->ekd", PAIR_MODES, _pairs(corner)).reshape(-1, 21)
    predicted = np.einsum("eij,ej->ei", state.resultant_gradient, modes)
    change = 0.5 * (there.resultants - back.resultants)
    np.testing.assert_allclose(predicted, change, rtol=0.0, atol=1e-6 * abs(change).max())


def _pairs(corner):
    """Means and half differences (E, 8, 3) over the thickness of corner vectors (E, 8, 3)."""
    bottom, top = corner[:, :4], corner[:, 4:]
    return np.concatenate([0.5 * (top + bottom), 0.5 * (top - bottom)], axis=1)


def test_given_resultants_replace_those_of_the_geometric_stiffness_only(batch):
    model, displacement = batch("full", "curved", {})
    state = tangent(model, displacement)
    same = tangent(model, displacement, state.resultants)
    np.testing.assert_allclose(same.stiffness, state.stiffness, rtol=1e-14)
    none = tangent(model, displacement, np.zeros_like(state.resultants))
    twice = tangent(model, displacement, 2.0 * state.resultants)
    np.testing.assert_allclose(
        none.stiffness + twice.stiffness,
        2.0 * state.stiffness,
        rtol=0.0,
        atol=1e-12 * abs(state.stiffness).max(),
    )
    assert abs(none.stiffness - state.stiffness).max() > 1e-3 * abs(state.stiffness).max()


def test_pair_basis_separates_means_and_half_differences():
    assert np.count_nonzero(PAIR_MODES[[0, 1, 3], 4:]) == 0
    assert np.count_nonzero(PAIR_MODES[[2, 4, 5, 6], :4]) == 0


def test_normal_compaction_derivatives(make):
    rng = np.random.default_rng(11)
    a = rng.normal(size=(20, 3, 3)) + np.eye(3)
    height = rng.uniform(0.5, 2.0, 20)
    _, gradient, hessian = normal_compaction(a, height)
    step = 1e-5
    for i in range(9):
        move = np.zeros(9)
        move[i] = step
        move = move.reshape(3, 3)
        ahead, back = normal_compaction(a + move, height), normal_compaction(a - move, height)
        for order, exact in ((0, gradient[:, i]), (1, hessian[:, i])):
            slope = (ahead[order] - back[order]) / (2 * step)
            np.testing.assert_allclose(slope, exact, rtol=1e-6, atol=1e-6 * abs(exact).max())
