"""The filling as a coupled part: infusion under a bag, squeeze flow, a stretched sheet, saving."""

from __future__ import annotations

import numpy as np
import pytest

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.coupling.iteration import (
    CoupledPart,
    CoupledSystem,
    Exchange,
    Tolerance,
    WindowControl,
    fixed_stress_exchanges,
    iqn_ils,
)
from lcmchain.coupling.iteration.interface import POINTS, PORE_PRESSURE, VOLUME_RATE
from lcmchain.coupling.solids.closures import Bag, Gap
from lcmchain.coupling.solids.compaction_law import CellCompaction
from lcmchain.coupling.solids.local import LocalCompaction
from lcmchain.errors import InputError
from lcmchain.scene import scene_from_text

LENGTH, WIDTH, VISCOSITY = 0.3, 0.02, 0.1
SCENE = """
process = { time = "1 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""


def strip_mesh(count):
    x = np.linspace(0.0, LENGTH, count + 1)
    points = np.array([[a, b, 0.0] for b in (0.0, WIDTH) for a in x])
    i = np.arange(count)
    return FlowMesh(points, np.stack([i, i + 1, count + 2 + i, count + 1 + i], axis=1))


def cells(count):
    material = scene_from_text(SCENE).material.build()
    return CellCompaction(material, np.full(count, material.thickness))


def preform_of(law, thickness):
    v = law.material.areal_mass / (law.material.fibre_density * thickness)
    K = 2e-11 * (1.0 - v) ** 3 / v**2
    return Preform(thickness, 1.0 - v, K[:, None, None] * np.eye(3))


def ends(count):
    return np.array([0, count + 1]), np.array([count, 2 * count + 1])


def outlet(nodes):
    """A vent that lets resin out."""
    return Vent("vent", nodes, pressure=0.0, closes_when_wet=False)


def coupled(solid, fluid, window):
    exchanges = [
        Exchange("solid", "fluid", VOLUME_RATE, of_window="mean", within="held",
                 tolerance=Tolerance(1e-3)),
        Exchange("fluid", "solid", PORE_PRESSURE, tolerance=Tolerance(1e-5)),
    ]  # fmt: skip
    exchanges += fixed_stress_exchanges("solid", "fluid")
    parts = {"solid": solid, "fluid": fluid}
    # where a control volume fills within a window, or not, by a hair, a shorter one decides it
    control = WindowControl(window, smallest=min(window, 1.0), largest=window)
    return CoupledSystem(parts, exchanges, iqn_ils(relaxation=1.0), window=control, prediction=0)


def test_vacuum_infusion_keeps_mass_and_comes_where_the_similar_solution_is():
    """x_f² = C t with C = 9.026e-5 m²/s, see ``solids/test_bag_infusion.py`` for the solution."""
    count, bag, inlet = 20, 1.0e5, 0.95e5
    C = 9.026e-5
    mesh, law = strip_mesh(count), cells(count)
    solid = LocalCompaction(law, Bag(bag), mesh.areas)
    left, right = ends(count)
    fluid = FillingPart(
        Filling(
            mesh, preform_of(law, solid.thickness), VISCOSITY,
            [Gate("inlet", left, pressure=inlet)], [Vent("vent", right, pressure=0.0)],
        )
    )  # fmt: skip
    assert isinstance(fluid, CoupledPart)
    system = coupled(solid, fluid, 1e9)
    for x in np.linspace(0.0, 0.8 * LENGTH, 2 * count + 21)[1:]:
        system.advance(x**2 / C - system.time)
    state = fluid.filling.state
    front = (state.fill[: count + 1].sum() - 0.5) * LENGTH / count
    assert front == pytest.approx(0.8 * LENGTH, rel=0.01)
    assert abs(state.balance_error) < 1e-10 * state.stored
    # both sides agree on every volume, and the resin on what the fibres leave of it
    found = fluid.get_fields(["volume", "thickness"])
    np.testing.assert_allclose(found["thickness"], solid.thickness, rtol=1e-4)
    assert system.history.mean_iterations < 10.0
    assert solid.thickness[0] > 1.1 * solid.thickness[-1]
    np.testing.assert_allclose(solid.get_fields(["total_pressure"])["total_pressure"], bag)


def test_a_hole_lifts_the_bag_with_its_own_pressure():
    """Nodes in a wide hole stand for a field that rises inside it; cells take the hole's."""
    count, bag, inlet = 8, 1e5, 0.95e5
    x = 12.5e-3 * np.arange(count + 1)
    points = np.array([[a, b, 0.0] for b in x for a in x])
    i = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    corners = (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1])
    mesh, law = FlowMesh(points, np.stack([c.ravel() for c in corners], axis=1)), cells(count**2)
    solid = LocalCompaction(law, Bag(bag), mesh.areas)
    middle, rim = i[4:5, 4], np.unique(np.r_[i[0], i[-1], i[:, 0], i[:, -1]])
    filling = Filling(
        mesh, preform_of(law, solid.thickness), VISCOSITY,
        [Gate("hole", middle, pressure=inlet, radius=10e-3)], [Vent("rim", rim, pressure=0.0)],
    )  # fmt: skip
    fluid = FillingPart(filling)
    system = coupled(solid, fluid, 10.0)
    thickest = law.thickness_under(np.full(count**2, bag - inlet)).max()
    above = 0.0
    for end in (10.0, 30.0, 60.0):
        system.advance_to(end)
        above = max(above, filling.state.pressure.max())
        assert fluid.pressure().max() < inlet and fluid.present_pressure().max() < inlet
        assert solid.thickness.max() < thickest
        assert abs(filling.state.balance_error) < 1e-12 * filling.state.stored
    assert above > 1.2 * inlet


def test_squeeze_flow_between_closing_plates():
    """F/width = mu |dh/dt| L³/(3 K h) of a strip that is closed at one end."""
    count, speed = 40, 1e-6
    mesh, law = strip_mesh(count), cells(count)
    h0 = 0.9 * law.thickness[0]
    solid = LocalCompaction(law, Gap(lambda t: h0 - speed * t), mesh.areas)
    preform = preform_of(law, solid.thickness)
    _, right = ends(count)
    fluid = FillingPart(
        Filling(mesh, preform, VISCOSITY, [], [outlet(right)],
                wetted=np.arange(mesh.node_count))
    )  # fmt: skip
    for _ in range(5):
        solid.advance(2.0)
        fluid.set_fields(solid.get_fields([VOLUME_RATE]))
        fluid.advance(2.0)
        solid.set_fields(fluid.get_fields([PORE_PRESSURE]))
    solid.advance(1e-9)
    h = h0 - speed * 10.0
    K = float(preform_of(law, np.array([h])).permeability[0, 0, 0])
    expected = VISCOSITY * speed * LENGTH**3 / (3.0 * K * h)
    assert solid.force_parts()["fluid"] / WIDTH == pytest.approx(expected, rel=0.01)


def test_moved_points_keep_the_volumes():
    count = 10
    mesh, law = strip_mesh(count), cells(count)
    _, right = ends(count)
    fluid = FillingPart(
        Filling(mesh, preform_of(law, law.thickness), VISCOSITY, [],
                [outlet(right)], wetted=np.arange(mesh.node_count))
    )  # fmt: skip
    before = fluid.get_fields(["volume"])["volume"]
    stored = fluid.filling.state.stored
    points = mesh.points * np.array([1.1, 0.95, 1.0])
    fluid.set_fields({POINTS: points.ravel(), VOLUME_RATE: np.zeros(count)})
    fluid.advance(0.1)
    np.testing.assert_allclose(fluid.get_fields(["volume"])["volume"], before, rtol=1e-12)
    np.testing.assert_array_equal(fluid.filling.mesh.points, points)
    assert fluid.filling.state.stored == pytest.approx(stored, rel=1e-10)
    rate = np.full(count, -0.01 * before[0])
    fluid.set_fields({VOLUME_RATE: rate})
    saved = fluid.save()
    fluid.advance(0.5)
    once = fluid.get_fields([PORE_PRESSURE, "volume"])
    np.testing.assert_allclose(once["volume"], before + 0.5 * rate, rtol=1e-12)
    assert fluid.filling.state.stored == pytest.approx(stored + 0.5 * rate.sum(), rel=1e-10)
    fluid.restore(saved)
    fluid.advance(0.5)
    again = fluid.get_fields([PORE_PRESSURE, "volume"])
    assert all(np.array_equal(once[name], again[name]) for name in once)


def test_wrong_fields_are_named():
    mesh, law = strip_mesh(4), cells(4)
    _, right = ends(4)
    fluid = FillingPart(
        Filling(mesh, preform_of(law, law.thickness), VISCOSITY, [],
                [outlet(right)], wetted=np.arange(mesh.node_count))
    )  # fmt: skip
    with pytest.raises(InputError, match="there are 4 cells"):
        fluid.set_fields({VOLUME_RATE: np.zeros(3)})
    with pytest.raises(InputError, match="no input"):
        fluid.set_fields({"thickness": np.zeros(4)})
    with pytest.raises(InputError, match="no output"):
        fluid.get_fields(["colour"])
