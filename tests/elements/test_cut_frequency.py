"""Elements at a cut outline: the bound of their frequency is safe, and they hardly cost time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import eigsh

from lcmchain.check.expected_cost import estimate_run
from lcmchain.elements.solid_shell.tangent import linearise
from lcmchain.mesh.hexahedron import MODES
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SCENE = """
process = { time = "1 ms" }
blank = { OUTLINE, edge_length = "5 mm", fibre_angle = "ANGLE deg" }
material = { preset = "MD600" }
element = "ELEMENT"
"""
KITE = 'outline = [["0 mm", "0 mm"], ["40 mm", "-15 mm"], ["70 mm", "0 mm"], ["35 mm", "30 mm"]]'
SQUARE = 'size = ["40 mm", "30 mm"]'


def model_of(outline, angle, element="solid-shell"):
    text = SCENE.replace("OUTLINE", outline).replace("ANGLE", str(angle))
    return build_model(scene_from_text(text.replace("ELEMENT", element)))


def bound_at(model, position):
    """The bound of ω² [1/s²] at node positions (node_count, 3)."""
    body, history = model.only_body(), model.only_body().no_history()
    x = np.ascontiguousarray(position.T)
    body.renew(x, history)
    return body.highest_frequency(x, history, model.nodes.mass)


def true_frequency(model, position):
    """Highest ω² [1/s²] of the whole sheet, from its exact tangent."""
    displacement = (position - model.node_positions).T
    stiffness = linearise(model, displacement).stiffness
    corner = np.einsum("ka,ekdlf,lb->eadbf", MODES, stiffness, MODES)
    corner = corner.reshape(model.element_count, 24, 24)
    place = (3 * model.only_body().mesh.elements[:, :, None] + np.arange(3)).reshape(-1, 24)
    rows, columns = np.repeat(place, 24, axis=1).ravel(), np.tile(place, (1, 24)).ravel()
    K = coo_array((corner.ravel(), (rows, columns)), shape=(3 * model.node_count,) * 2).tocsr()
    scale = diags_array(np.repeat(model.nodes.mass, 3) ** -0.5)
    start = np.random.default_rng(0).normal(size=K.shape[0])
    return eigsh(scale @ K @ scale, k=1, which="LA", v0=start, return_eigenvectors=False)[0]


def deformed(model, *, shear, compaction, warp, seed):
    """Positions of a sheet that is sheared along the fibres, compacted, and disturbed."""
    rng = np.random.default_rng(seed)
    X, body = model.node_positions, model.only_body()
    e1, e2 = body.mesh.fibre_direction_1[0], body.mesh.fibre_direction_2[0]
    half = 0.5 * math.radians(shear)
    a, b = X @ e1, X @ e2
    x = np.outer(a, math.cos(half) * e1 + math.sin(half) * e2)
    x += np.outer(b, math.sin(half) * e1 + math.cos(half) * e2)
    x[:, 2] = compaction * X[:, 2]
    return x + warp * body.material.thickness * rng.normal(size=x.shape)


@pytest.mark.parametrize("outline, angle", [(SQUARE, 30.0), (SQUARE, 45.0), (KITE, -17.0)])
def test_bound_lies_above_the_highest_frequency_of_the_sheet(outline, angle):
    model = model_of(outline, angle)
    assert model.only_body().mesh.is_triangle.any()
    # and how much shorter than that of the highest frequency the step may be at most
    states = [
        (1.15, {"shear": 0.0, "compaction": 1.0, "warp": 0.0}),
        (1.35, {"shear": 40.0, "compaction": 1.0, "warp": 0.0}),
        (2.0, {"shear": -60.0, "compaction": 0.8, "warp": 0.01}),
        (2.0, {"shear": 20.0, "compaction": 0.6, "warp": 0.03}),
    ]
    for seed, (shorter, state) in enumerate(states):
        position = deformed(model, seed=seed, **state)
        bound, true = bound_at(model, position)[0], true_frequency(model, position)
        assert bound >= true * (1.0 - 1e-9)
        assert bound < true * shorter**2


@pytest.mark.parametrize("element", ["solid-shell", "membrane-shell"])
@pytest.mark.parametrize("outline, angle", [(SQUARE, 10.0), (SQUARE, 45.0), (KITE, -17.0)])
def test_cut_blanks_keep_the_step_of_whole_elements(outline, angle, element):
    model = model_of(outline, angle, element)
    # the edges of inner elements are those along the fibres
    faces = model.only_body().mesh.sheet_faces
    corner = model.only_body().mesh.mid_surface(model.node_positions)[faces[:, :3]]
    along = np.abs((corner[:, 1] - corner[:, 0]) @ model.only_body().mesh.fibre_direction_1[0])
    whole = np.median(along)
    speed = math.sqrt(
        model.only_body().material.wave_stiffness()[0] / model.only_body().material.density
    )
    assert Simulation(model).critical_step() > whole / speed / 1.2


@pytest.mark.parametrize("element", ["solid-shell", "membrane-shell"])
@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0])
def test_estimated_step_is_that_of_the_solver(element, angle):
    model = model_of(SQUARE, angle, element)
    estimate = estimate_run(model)
    assert estimate.critical_step == pytest.approx(Simulation(model).critical_step(), rel=0.03)


@pytest.mark.parametrize("element", ["solid-shell", "membrane-shell"])
def test_the_bound_at_usual_nodes_grows_with_shear_as_expected(element):
    """By 1 + sin γ, which ``check`` takes for its estimate, and from where whole elements are."""
    model = model_of(SQUARE, 30.0, element)
    found = model.only_body().reference_frequencies()
    shear = 45.0
    position = deformed(model, shear=shear, compaction=1.0, warp=0.0, seed=0)
    bound = bound_at(model, position)[0]
    grown = found.at_nodes * (1.0 + math.sin(math.radians(shear)))
    assert 0.95 * grown < bound < 1.25 * grown
