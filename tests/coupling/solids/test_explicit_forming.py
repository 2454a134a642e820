"""The explicit forming as a coupled part: outputs, saving, and consolidation with a fluid."""

from __future__ import annotations

import numpy as np
import pytest
from saturated_strip import Strip

from lcmchain.coupling.iteration import CoupledPart, CoupledSystem, Exchange, iqn_ils
from lcmchain.coupling.iteration.interface import (
    PORE_PRESSURE,
    REFERENCE_PRESSURE,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
)
from lcmchain.coupling.solids.explicit import ExplicitForming
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

SCENE = """
process = { time = "20 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""
PRESS = """
contact = { friction = 0.2, depth = "free" }
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
position = "0 0 -0.502 mm"
[[tools]]
name = "plate"
shape = { type = "plate", side = "above" }
position = "0 0 0.502 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.2 mm" }
"""


def forming(text=SCENE, **options):
    return ExplicitForming.from_scene(scene_from_text(text), **options)


def go_on(part, pressures, step=5e-5):
    for pressure in pressures:
        part.set_fields({PORE_PRESSURE: pressure})
        part.advance(step)


def test_outputs_belong_together():
    part = forming()
    assert isinstance(part, CoupledPart)
    p = np.random.default_rng(0).uniform(0.0, 2e5, part.element_count)
    before = part.volume()
    thickness = np.full(part.element_count, 1.004e-3)
    np.testing.assert_allclose(part.get_fields(["thickness"])["thickness"], thickness)
    go_on(part, [p, p])
    names = ("volume", "thickness", "area")
    found = part.get_fields([*names, *(f"{name}_rate" for name in names), "pore_pressure"])
    assert part.time == pytest.approx(1e-4, rel=1e-12)
    np.testing.assert_array_equal(found["pore_pressure"], p)
    np.testing.assert_allclose(found["thickness"] * found["area"], found["volume"], rtol=1e-14)
    assert found["volume"].sum() > before.sum()
    saved = part.save()
    go_on(part, [p])
    after = part.get_fields([*names, *(f"{name}_rate" for name in names)])
    for name in names:  # rates are means: what they sum up to is exactly what has changed
        change = found[name] + 5e-5 * after[f"{name}_rate"]
        np.testing.assert_allclose(change, after[name], rtol=1e-13)
    assert np.abs(part.volume() - saved.volume).max() > 0.0


def test_thickness_agrees_with_that_of_the_law_in_a_flat_sheet():
    part = forming()
    p = np.full(part.element_count, 1e5)
    go_on(part, [p] * 4)
    inner = np.abs(part.places("")[:, :2]).max(axis=1) < 5e-3
    thickness = part.get_fields(["thickness"])["thickness"]
    assert inner.sum() == 4
    model, state = part.simulation.model, part.simulation.state
    history = model.history_of(model.only_body(), state.history)
    of_law = 1.004e-3 * model.only_body().condition(state.position, history).thickness_stretch
    np.testing.assert_allclose(thickness[inner], of_law[inner], rtol=1e-3)
    np.testing.assert_allclose(np.abs(part.normals()[:, 2]), 1.0, atol=1e-3)
    assert part.points().shape == (part.cells.max() + 1, 3)


def test_going_on_from_a_saved_state_is_bit_identical():
    part = forming(SCENE + PRESS)
    p = np.random.default_rng(1).uniform(0.0, 1e5, (6, part.element_count))
    go_on(part, p[:3])
    saved = part.save()
    go_on(part, p[3:])
    once = part.save()
    for _ in range(2):
        part.restore(saved)
        assert part.time == saved.state.time
        go_on(part, p[3:])
        again = part.save()
        for name, values in once.state.as_dict().items():
            np.testing.assert_array_equal(values, again.state.as_dict()[name], err_msg=name)
        np.testing.assert_array_equal(once.volume, again.volume)


def test_ramped_pressure_reaches_what_was_set():
    part = forming(ramped=True)
    p = np.full(part.element_count, 1e5)
    part.set_fields({PORE_PRESSURE: p})
    part.advance(1e-4)
    ramped = part.volume().sum()
    np.testing.assert_array_equal(part.present_pressure(), p)
    assert not part.simulation.state.pore_rate.any()
    held = forming()
    go_on(held, [p], step=1e-4)
    assert held.volume().sum() != ramped


def test_pressure_of_the_surroundings_loads_nothing():
    free, at_rest = forming(), forming(surroundings=1e5)
    go_on(free, [np.zeros(free.element_count)])
    go_on(at_rest, [np.full(free.element_count, 1e5)])
    np.testing.assert_allclose(at_rest.volume(), free.volume(), rtol=1e-12)


def test_wrong_models_and_fields_are_named():
    with pytest.raises(InputError, match="pore_pressure=True"):
        ExplicitForming(Simulation(build_model(scene_from_text(SCENE))))
    part = forming()
    with pytest.raises(InputError, match="there are 24 cells"):
        part.set_fields({PORE_PRESSURE: np.zeros(3)})
    with pytest.raises(InputError, match="no input"):
        part.set_fields({"thickness": np.zeros(24)})
    with pytest.raises(InputError, match="no output"):
        part.get_fields(["colour"])


def saturated_strip(load, count=10):
    """Two rows of solid-shells along x that move in z alone, under a bag and full of fluid.

    Their fabric has a constant modulus over the thickness, 1 MPa: the loop of other tests serves.
    """

    def held(mesh):
        return [Support("plane", np.arange(mesh.node_count), "xy")]

    scene = scene_from_text(f"""
        process = {{ time = "20 ms", mass_damping = "3000 1/s" }}
        blank = {{ size = ["{5 * count} mm", "10 mm"], edge_length = "5 mm" }}
        pressure = [{{ name = "bag", face = "both", value = "{load} Pa", ramp = "0 s" }}]
        [material]
        preset = "MD600"
        thickness = "1 mm"
        areal_mass = "600 g/m^2"
        compaction = {{ c0 = "1 MPa", c1 = 1e-9, c2 = 2.0 }}
        membrane.C23 = "0.5 MPa"
        membrane.C13 = "0.5 MPa"
        """)
    simulation = Simulation(build_model(scene, held, pore_pressure=True))
    pore = simulation.model.pore
    simulation.state.pore_pressure[:] = pore.in_lanes(np.full(2 * count, load))
    return ExplicitForming(simulation)


def rows_to_strip(part, count):
    """Matrix (count, elements) that sums over the elements at the same place along x."""
    column = np.round(part.places("")[:, 0] / 5e-3 - 0.5).astype(int) + count // 2
    sums = np.zeros((count, column.size))
    sums[column, np.arange(column.size)] = 1.0
    return sums


def test_strip_of_elements_consolidates_as_terzaghi_says():
    """The same as with the local compaction, in milliseconds and with inertia."""
    load, count, modulus, end = 100.0, 10, 1e6, 5e-3
    part = saturated_strip(load, count)
    sums = rows_to_strip(part, count)
    np.testing.assert_array_equal(sums.sum(axis=1), 2.0)
    time_scale = end / 0.848
    mobility = (5e-3 * count) ** 2 / (time_scale * modulus)
    start = part.volume()
    fluid = Strip(np.full(count, 1e-3), 5e-3, 10e-3, mobility, start=load)
    exchanges = [
        Exchange("solid", "fluid", VOLUME_RATE, mapping=sums, of_window="mean", within="held"),
        Exchange("fluid", "solid", PORE_PRESSURE, mapping=sums.T),
        Exchange(
            "solid",
            "fluid",
            VOLUME_RATE_SLOPE,
            mapping=sums,
            tolerance=None,
            iterated=False,
            within="held",
        ),
        Exchange(
            "solid",
            "fluid",
            REFERENCE_PRESSURE,
            mapping=0.5 * sums,
            tolerance=None,
            iterated=False,
            within="held",
        ),
    ]
    system = CoupledSystem({"solid": part, "fluid": fluid}, exchanges, iqn_ils(), window=2.5e-5)
    assert part.longest_window() > 2.5e-5
    settled = float(np.sum(start)) * load / modulus
    for T, expected in ((0.197, 0.5003), (0.848, 0.9000)):
        system.advance(T * time_scale - system.time)
        U = float(np.sum(start - part.volume())) / settled
        assert U == pytest.approx(expected, rel=0.01)
    assert system.history.mean_iterations < 5.0
    assert part.longest_window() == pytest.approx(
        np.pi * 1e-3 / np.sqrt(4.0 * modulus / 600.0), rel=1e-3
    )
