"""A flow medium on a strip against closed forms: lead of its front, sinking, draining, limits."""

import numpy as np
import pytest

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Vent
from lcmchain.coupling.infiltration.flow.flow_medium import FlowMedium, lead_length
from lcmchain.coupling.infiltration.flow.preform import Preform
from lcmchain.coupling.infiltration.resin import CastroMacoskoViscosity, KamalSourour
from lcmchain.coupling.infiltration.resin_temperature import ConstantTemperature
from lcmchain.errors import InputError

from .sample_meshes import plate

LENGTH, WIDTH, HEIGHT, POROSITY, THROUGH = 0.3, 0.02, 0.004, 0.5, 4e-12
LAYER, LAYER_POROSITY, LAYER_PERMEABILITY = 0.001, 0.8, 3e-9
VISCOSITY, PRESSURE, SPEED = 0.1, 1e5, 0.005
# Next to nothing along the preform, and through it.
NOTHING = 1e-18


class Strip:
    """A strip with a flow medium on some of its cells."""

    def __init__(self, columns, gate, along=NOTHING, through=THROUGH, cells=None, **others):
        self.mesh = mesh = plate(columns, 1, LENGTH, WIDTH)
        cells = np.arange(mesh.cell_count) if cells is None else cells
        medium = FlowMedium(cells, LAYER, LAYER_POROSITY, LAYER_PERMEABILITY)
        preform = Preform(HEIGHT, POROSITY, along, through_permeability=through)
        layered, both, self.links = medium.layered(mesh, preform)
        end = mesh.node_sets["right"]
        covered = self.links.above[np.isin(self.links.below, end)]
        gate = gate(mesh.node_sets["left"], self.links)
        nodes = np.setdiff1d(np.concatenate([end, covered]), gate.nodes)
        vent = Vent("end", nodes, closes_when_wet=not others.pop("bleeds", False))
        self.filling = Filling(
            layered, both, others.pop("resin", VISCOSITY), [gate], [vent],
            links=self.links, **others,
        )  # fmt: skip

    def run(self, until):
        return self.filling.advance(until, balanced)

    @property
    def lengths(self):
        """What the resin would fill of the layer and of the preform, from the gate on [m]."""
        volume = self.filling.state.resin_volume
        count = self.mesh.node_count
        layer = volume[count:].sum() / (WIDTH * LAYER * LAYER_POROSITY)
        return layer, volume[:count].sum() / (WIDTH * HEIGHT * POROSITY)


def balanced(filling):
    state = filling.state
    assert abs(state.balance_error) <= 1e-12 * filling.pores.sum()
    assert state.fill.min() >= 0.0
    assert (state.resin_volume <= filling.pores * (1.0 + 1e-12)).all()


def on_layer(**given):
    return lambda left, links: Gate("inlet", links.above[np.isin(links.below, left)], **given)


def at_rate():
    store = POROSITY * HEIGHT + LAYER_POROSITY * LAYER
    return on_layer(flow_rate=SPEED * WIDTH * store)


def lag(depths=20_000):
    """Mean over the thickness of the length by which the preform lags behind the layer [m]."""
    middle = (np.arange(depths) + 0.5) / depths
    below = [
        lead_length(y * HEIGHT, POROSITY, THROUGH, LAYER, LAYER_POROSITY, LAYER_PERMEABILITY)
        for y in middle
    ]
    return float(np.mean(below))


def test_lead_of_the_layer_converges_to_the_closed_form():
    errors = []
    for columns in (15, 30, 60):
        strip = Strip(columns, at_rate(), options=FillingOptions(front_step=0.1))
        leads = []
        for front in (0.16, 0.18, 0.2, 0.22):
            strip.run(front / SPEED)
            layer, preform = strip.lengths
            leads.append(layer - preform)
        errors.append(np.mean(leads) / lag() - 1.0)
        # It is the same wherever the front is.
        assert np.ptp(leads) < 0.5 / columns * leads[0]
    assert errors[0] < 0.2
    assert errors[2] < 0.03
    assert errors[0] > 1.6 * errors[1] > 2.56 * errors[2] > 0.0


def test_front_at_the_far_face_lags_by_the_lead_length():
    strip = Strip(60, at_rate())
    strip.run(0.24 / SPEED)
    layer, preform = strip.lengths
    assert layer - preform == pytest.approx(lag(), rel=0.15)  # in the program's own steps
    time, count, x = strip.filling.state.fill_time, strip.mesh.node_count, strip.mesh.points[:, 0]
    there = (x > 0.1) & (x < 0.15)
    line = np.isfinite(time[count:]) & (strip.mesh.points[:, 1] < 1e-9)
    ahead = np.interp(time[:count][there], time[count:][line], x[line]) - x[there]
    given = LAYER, LAYER_POROSITY, LAYER_PERMEABILITY
    exact = lead_length(HEIGHT, POROSITY, THROUGH, *given)
    assert ahead.mean() == pytest.approx(exact, abs=LENGTH / 60)
    assert lead_length(HEIGHT, POROSITY, 4.0 * THROUGH, *given) == pytest.approx(0.5 * exact)


def test_column_is_through_after_the_time_of_darcy():
    strip = Strip(4, lambda _, links: Gate("all", links.above, pressure=PRESSURE))
    end = POROSITY * VISCOSITY * HEIGHT**2 / (2.0 * THROUGH * PRESSURE)
    for share in (0.1, 0.5, 0.9):
        strip.run(share**2 * end)
        assert strip.lengths[1] == pytest.approx(share * LENGTH, rel=1e-3)
    outcome, _ = strip.run(10.0 * end)
    assert outcome == "filled"
    time = strip.filling.state.fill_time[: strip.mesh.node_count]
    # the last step is cut where the columns are full, of a mean flow over a longer one
    np.testing.assert_allclose(time, end, rtol=1e-2)


def test_nothing_through_the_thickness_leaves_the_layer_alone():
    strip = Strip(30, on_layer(pressure=PRESSURE), through=1e-30)
    strip.run(5.0)
    front = np.sqrt(2.0 * LAYER_PERMEABILITY * PRESSURE * 5.0 / (LAYER_POROSITY * VISCOSITY))
    layer, preform = strip.lengths
    assert layer == pytest.approx(front, rel=5e-3)
    assert preform < 1e-6 * layer


def test_everything_through_the_thickness_is_the_mean():
    along = 1e-10
    strip = Strip(60, on_layer(pressure=PRESSURE), along=along, through=1e-8)
    strip.run(20.0)
    conducts = along * HEIGHT + LAYER_PERMEABILITY * LAYER
    holds = POROSITY * HEIGHT + LAYER_POROSITY * LAYER
    front = np.sqrt(2.0 * conducts * PRESSURE * 20.0 / (holds * VISCOSITY))
    layer, preform = strip.lengths
    assert preform == pytest.approx(front, rel=0.02)
    assert layer - preform < 2.0 * LENGTH / 60


def test_saturated_layer_feeds_the_preform_as_a_fin():
    """K h p'' = 3 K₃ (p - P) / h below a layer that has the pressure P everywhere."""
    along, columns = 1e-9, 30
    strip = Strip(
        columns, lambda _, links: Gate("all", links.above, pressure=PRESSURE), along=along,
        wetted=np.ones(4 * (columns + 1)), bleeds=True, cells=np.arange(columns),
        options=FillingOptions(stop_when_idle=False, largest_step=1.0),
    )  # fmt: skip
    rate = np.sqrt(3.0 * THROUGH / along) / HEIGHT
    strip.run(1.0)
    pressure = strip.filling.pressure[: strip.mesh.node_count]
    x = strip.mesh.points[:, 0]
    exact = PRESSURE * (1.0 - np.cosh(rate * x) / np.cosh(rate * LENGTH))
    assert np.abs(pressure - exact).max() < 5e-3 * PRESSURE


def test_resin_rises_from_the_preform_into_the_layer():
    cells = np.arange(10, 20)
    strip = Strip(
        30, lambda left, _: Gate("inlet", left, pressure=PRESSURE), along=1e-9, cells=cells
    )
    outcome, _ = strip.run(1e5)
    assert outcome == "filled"
    time, links = strip.filling.state.fill_time, strip.links
    first = links.below == np.min(links.below)
    assert (time[links.above[first]] > time[links.below[first]]).all()


def test_cure_of_the_resin_that_sinks_is_that_of_its_age():
    """Of resin that cures at the rate k, V (1 - cure) in all is Q (1 - exp(-k t)) / k."""
    rate, time = 0.03, 0.2 / SPEED
    resin = CastroMacoskoViscosity(
        reference_viscosity=VISCOSITY, activation_energy=0.0, gel_cure=0.999, exponent=0.1,
        exponent_slope=0.0, kinetics=KamalSourour.nth_order(rate, 0.0, 1.0),
    )  # fmt: skip
    warm = ConstantTemperature(400.0)
    steps = FillingOptions(largest_step=0.2)  # what enters ages over the whole of its first step
    strip = Strip(20, at_rate(), resin=resin, temperature=warm, options=steps)
    strip.run(time)
    state = strip.filling.state
    fresh = float(state.resin_volume @ (1.0 - state.cure))
    exact = state.injected[0] / time * (1.0 - np.exp(-rate * time)) / rate
    assert fresh == pytest.approx(exact, rel=5e-3)
    oldest = 1.0 - np.exp(-rate * time)
    wet = state.resin_volume > 0.0
    assert (state.cure[wet] >= 0.0).all() and state.cure.max() <= oldest * (1.0 + 1e-9)
    below = state.cure[: strip.mesh.node_count][state.full[: strip.mesh.node_count]]
    assert below.max() > 0.5 * oldest  # what sinks takes its cure along


def test_going_back_to_a_saved_state_gives_the_same_bits():
    strip = Strip(20, on_layer(pressure=PRESSURE), along=1e-12)
    strip.run(2.0)
    saved = strip.filling.save()
    strip.run(9.0)
    ended = strip.filling.save()
    strip.filling.restore(saved)
    strip.filling.advance(9.0, lambda filling: filling.frame())  # looking changes nothing
    for name in ("resin_volume", "pressure", "fill_time"):
        np.testing.assert_array_equal(getattr(strip.filling.state, name), getattr(ended, name))


def test_a_preform_without_permeability_through_it_is_refused():
    mesh = plate(2, 1, LENGTH, WIDTH)
    medium = FlowMedium(np.arange(2), LAYER, LAYER_POROSITY, LAYER_PERMEABILITY)
    with pytest.raises(InputError, match="k3"):
        medium.layered(mesh, Preform(HEIGHT, POROSITY, 1e-10))
