"""Pressures that a filling tells: those of its present state, none above the gates."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.preform import Preform

from .sample_meshes import plate

HOLE = 0.018


def filling_of(mesh, gates, *, vent=0.0, **options):
    vents = [Vent("end", mesh.node_sets["right"], pressure=vent)]
    return Filling(mesh, Preform(2e-3, 0.5, 1e-10), 0.1, gates, vents, **options)


def hole_near_the_rim(columns, rows, **drive):
    """A hole 2 mm from the rim of a strip of 300 x 60 mm: its nodes, or the nearest one."""
    mesh = plate(columns, rows, 0.3, 0.06)
    away = np.linalg.norm(mesh.points - [0.15, 0.02, 0.0], axis=1)
    return mesh, Gate("hole", np.flatnonzero(away <= max(HOLE, away.min())), radius=HOLE, **drive)


def three_gates(**options):
    mesh = plate(12, 3, 0.3, 0.06)
    return filling_of(
        mesh,
        [
            Gate("edge", mesh.node_sets["left"], flow_rate=2e-7),
            Gate("hole", [25], pressure=3e5, radius=8e-3),
            Gate("point", [37], pressure=2e5),
        ],
        **options,
    )


@pytest.mark.parametrize("trapped_air", [False, True])
def test_what_is_read_after_a_time_step_is_of_the_state_that_it_has_led_to(trapped_air):
    """Of nodes that filled in it too, which its own flow knows as the front."""
    options = {"options": FillingOptions(trapped_air=trapped_air), "vent": 1e4 * trapped_air}
    filling, other, unread = (three_gates(**options) for _ in range(3))
    off = 0.0

    def check(filling):
        nonlocal off
        frame, saved = filling.frame(), filling.save()
        other.restore(saved)
        other.advance(other.time)  # no step: the flow of this state
        np.testing.assert_array_equal(frame.pressure, other.pressure)
        np.testing.assert_array_equal(frame.velocity, other.frame().velocity)
        np.testing.assert_array_equal(filling.gate_pressure, other.gate_pressure)
        np.testing.assert_array_equal(filling.gate_rate, other.gate_rate)
        off = max(off, np.abs(saved.pressure - other.state.pressure).max())

    filling.advance(8.0, check)
    assert off > 1e3
    # reading changes nothing
    unread.advance(8.0)
    for name, values in vars(unread.state).items():
        if isinstance(values, np.ndarray):
            np.testing.assert_array_equal(values, getattr(filling.state, name), err_msg=name)


@pytest.mark.parametrize("columns, rows", [(12, 3), (24, 5)])
def test_a_hole_near_a_rim_lifts_no_node_above_its_pressure(columns, rows):
    """Nodes between hole and rim stand still: they have the pressure of the hole."""
    mesh, gate = hole_near_the_rim(columns, rows, pressure=3e5)
    filling, highest = filling_of(mesh, [gate]), []
    filling.advance(8.0, lambda now: highest.append(now.pressure.max()))
    assert max(highest) <= 3e5 * (1.0 + 1e-12)
    assert filling.gate_pressure == pytest.approx([3e5], rel=1e-12)


def test_a_hole_at_a_flow_rate_needs_no_less_pressure_than_the_nodes_beside_it_have():
    mesh, gate = hole_near_the_rim(12, 3, flow_rate=1e-6)
    filling = filling_of(mesh, [gate])

    def check(filling):
        if filling.state.full[gate.nodes].all():
            assert filling.pressure.max() <= filling.gate_pressure[0] * (1.0 + 1e-12)

    filling.advance(8.0, check)
    assert filling.state.injected[0] == pytest.approx(8e-6, rel=1e-9)


class Heavy:
    density, gel_cure, initial_cure = 1100.0, np.inf, 0.0
    reacts = depends_on_temperature = False

    def viscosity(self, temperature, cure):
        return np.full(np.shape(cure), 0.1)


@pytest.mark.parametrize("gravity", [0.0, -8.0])
def test_a_hole_whose_neighbours_all_carry_resin_away_keeps_its_logarithm(gravity):
    """Its node stands above it; the weight of the resin may lift one beside it, but no flow."""
    mesh = plate(8, 8, 0.4, 0.4)
    weight = Heavy.density * -gravity * (0.4 - mesh.points[:, 1])
    hole = 1e3 + weight[40]
    filling = Filling(
        mesh, Preform(2e-3, 0.5, 1e-10), Heavy(), [Gate("hole", [40], pressure=hole, radius=0.04)],
        [Vent(f"rim {k}", [k], pressure=weight[k], closes_when_wet=False) for k in mesh.rim],
        gravity=np.array([0.0, gravity, 0.0]), wetted=np.arange(mesh.node_count),
    )  # fmt: skip
    filling.advance(10.0)
    assert filling.gate_rate[0] == pytest.approx(7.5018247e-9, rel=1e-6)
    assert filling.state.pressure[40] > 1.1 * hole
    assert filling.pressure[40] == pytest.approx(hole, rel=1e-12)
    assert (filling.state.pressure[[31, 39, 41, 49]].max() > hole) == (gravity < 0.0)
