"""The filling of a dome against a reference that shares neither method nor code with it."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform

MU, DP = 0.1, 1e5


def dome(count):
    """A square of quadrilaterals drawn into a dome, with a fabric that shears and packs over it.

    Points (N, 3), cells (C, 4), thickness (C,), porosity (C,), permeability (C, 3, 3).
    """
    s = np.linspace(-1.0, 1.0, count + 1)
    x, y = (0.15 * part for part in np.meshgrid(s, s))
    z = 0.06 * np.exp(-(x**2 + y**2) / 0.07**2)
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    node = np.arange(x.size).reshape(x.shape)
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1)
    cells = cells.reshape(-1, 4)
    corner = points[cells]
    first = corner[:, 1] + corner[:, 2] - corner[:, 0] - corner[:, 3]
    second = corner[:, 3] + corner[:, 2] - corner[:, 0] - corner[:, 1]
    first, second = (v / np.linalg.norm(v, axis=1)[:, None] for v in (first, second))
    packed = 1.0 / np.linalg.norm(np.cross(first, second), axis=1)
    centre = corner.mean(axis=1)
    fraction = 0.45 * packed * (1.0 + 0.1 * np.sin(20.0 * centre[:, 0]))
    size = 6e-11 * (fraction / 0.5) ** -4
    tensor = np.einsum("c,ci,cj->cij", size, first, first)
    tensor += np.einsum("c,ci,cj->cij", 0.4 * size, second, second)
    thickness = 2e-3 * (1.0 + 0.2 * centre[:, 1] / 0.15)
    return points, cells, thickness, 1.0 - fraction, tensor


def both(reference, count, gate_of, vents_of):
    points, cells, thickness, porosity, tensor = dome(count)
    gate = gate_of(points)
    run = Filling(
        FlowMesh(points, cells), Preform(thickness, porosity, tensor), MU,
        [Gate("gate", gate, pressure=DP)], [Vent("vent", vents_of(points))],
    )  # fmt: skip
    cut, triangles, owner = reference.triangles_of(points, cells)
    model = reference.HeleShaw(
        cut, triangles, thickness[owner], porosity[owner], tensor[owner], MU, DP, gate
    )
    return run, model


def rim(points):
    return np.flatnonzero(np.abs(points[:, :2]).max(axis=1) > 0.15 - 1e-9)


def middle(points):
    return np.flatnonzero(np.hypot(points[:, 0], points[:, 1]) < 0.0301)


def top(points):
    return np.argmin(np.hypot(points[:, 0], points[:, 1]))[None]


def left(points):
    return np.flatnonzero(points[:, 0] < -0.15 + 1e-9)


def right(points):
    return np.flatnonzero(points[:, 0] > 0.15 - 1e-9)


@pytest.mark.parametrize(("gate", "vents"), [(left, right), (rim, top)], ids=["edge", "rim"])
def test_the_dome_fills_in_the_time_of_the_reference(reference, gate, vents):
    run, model = both(reference, 24, gate, vents)
    outcome, _ = run.advance(10.0 * model.fill_time)
    assert outcome == "filled"
    assert run.time == pytest.approx(model.fill_time, rel=0.01)


def from_a_hole(count, radius):
    """The dome filled from a round hole at its top, to the rim."""
    points, cells, thickness, porosity, tensor = dome(count)
    away = np.linalg.norm(points - points[np.argmax(points[:, 2])], axis=1)
    gate = np.flatnonzero(away <= radius)
    run = Filling(
        FlowMesh(points, cells), Preform(thickness, porosity, tensor), MU,
        [Gate("gate", gate, pressure=DP, radius=radius)], [Vent("vent", rim(points))],
    )  # fmt: skip
    assert run.advance(1e4)[0] == "filled"
    return run.time


def test_from_a_hole_the_time_is_that_of_the_reference_that_resolves_it(reference):
    """Same mesh and material; the reference cuts its cells until the hole is round."""
    radius = 0.0301
    points, cells, thickness, porosity, tensor = dome(20)
    top = points[np.argmax(points[:, 2])]
    points, triangles, owner = reference.triangles_of(points, cells)
    for _ in range(3):
        points, triangles, _ = reference.refined(points, triangles, np.empty(0, dtype=int))
        owner = np.tile(owner, 4)
    gate = np.flatnonzero(np.linalg.norm(points - top, axis=1) <= radius)
    model = reference.HeleShaw(
        points, triangles, thickness[owner], porosity[owner], tensor[owner], MU, DP, gate
    )
    assert from_a_hole(20, radius) == pytest.approx(model.nodal_fill_time, rel=0.02)


def test_the_time_from_a_hole_depends_little_on_the_mesh():
    """Nodes without a radius act as holes of the mesh's own: there the times differ by a fifth."""
    times = [from_a_hole(count, 0.0301) for count in (16, 20, 28)]
    assert max(times) / min(times) < 1.04


def test_both_references_meet_on_finer_meshes(reference):
    points, cells, thickness, porosity, tensor = dome(20)
    gate = middle(points)
    points, triangles, owner = reference.triangles_of(points, cells)
    apart = []
    for _ in range(3):
        model = reference.HeleShaw(
            points, triangles, thickness[owner], porosity[owner], tensor[owner], MU, DP, gate
        )
        apart.append(model.fill_time / model.nodal_fill_time - 1.0)
        points, triangles, gate = reference.refined(points, triangles, gate)
        owner = np.tile(owner, 4)
    assert apart[0] > apart[1] > apart[2] > 0.0
    assert apart[2] < 0.035


def test_the_wet_volume_is_that_of_the_reference_on_the_way(reference):
    run, model = both(reference, 24, left, right)
    for share in (0.1, 0.3, 0.6):
        run.advance(share * model.fill_time)
        assert run.state.stored == pytest.approx(
            model.wet_volume(share * model.fill_time), rel=0.02
        )


def test_the_places_that_are_wet_are_those_of_the_reference(reference):
    run, model = both(reference, 24, left, right)
    time = 0.4 * model.fill_time
    run.advance(time)
    fill = model.fill(time)
    inner = model.sides.max(axis=1) < run.mesh.node_count  # sides of the cells themselves
    own = run.state.fill[model.sides[inner]].mean(axis=1)
    assert np.mean(np.abs(own - fill[inner])) < 0.03
