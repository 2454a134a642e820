"""Sheets pressed between concentric tools: thickness and pressure against those between plates."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.model import build_model
from lcmchain.scene import scene_from_text

SCENE = """
process = { time = "1 ms" }
blank = { size = ["60 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""


def between(model, thickness, radius=None, *, follows=True):
    """Mean pressure [Pa] and thickness [m] of a strip held by its faces at a thickness.

    Straight, or bent along fibre 1 about an axis at ``radius`` from the mid-surface; ``follows``:
    elements know the curvature that they share with their neighbours.
    """
    X, count = model.node_positions, model.only_body().mesh.pair_count
    side = np.where(np.arange(len(X)) < count, -0.5, 0.5) * thickness
    position = X.copy()
    position[:, 2] = side
    if radius is not None:
        angle = X[:, 0] / radius
        position[:, 0] = (radius + side) * np.sin(angle)
        position[:, 2] = (radius + side) * np.cos(angle) - radius
    position = np.ascontiguousarray(position.T)
    history = np.zeros(model.history_size)
    if follows:
        model.renew(position, history)
    centre = X[model.only_body().mesh.elements].mean(axis=1)
    inner = (np.abs(centre[:, 0]) < 0.016) & (np.abs(centre[:, 1]) < 0.006)
    pressure = model.only_body().normal_pressure(position, history).total
    stretch = model.only_body().condition(position, history).thickness_stretch
    return pressure[inner].mean(), stretch[inner].mean() * model.only_body().mesh.thickness


@pytest.mark.parametrize("thickness", [0.9e-3, 0.8e-3, 0.7e-3])
@pytest.mark.parametrize(
    ("radius", "pressure_error", "thickness_error"),
    # at 5 mm an element turns by 57°: its chord is 4 % shorter than its arc, on which tools press
    [(20e-3, 0.005, 1e-6), (10e-3, 0.015, 1e-6), (5e-3, 0.06, 1e-3)],
)
def test_pressure_in_a_closed_bend_is_that_between_plates(
    thickness, radius, pressure_error, thickness_error
):
    model = build_model(scene_from_text(SCENE))
    plates, _ = between(model, thickness)
    bend, measured = between(model, thickness, radius)
    assert bend == pytest.approx(plates, rel=pressure_error)
    half_turn = 0.5 * 5e-3 / radius  # of an element
    chord_over_arc = np.sin(half_turn) / half_turn
    # the same force on the arc, where the tools press
    assert bend * chord_over_arc == pytest.approx(plates, rel=0.015)
    assert measured == pytest.approx(thickness, rel=thickness_error)


def test_without_the_shared_curvature_a_closed_bend_takes_too_much_pressure():
    model = build_model(scene_from_text(SCENE))
    plates, _ = between(model, 0.8e-3)
    assert between(model, 0.8e-3, 10e-3, follows=False)[0] > 1.2 * plates
