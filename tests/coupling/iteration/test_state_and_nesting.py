"""Save and restore of a coupled system, systems within systems, and what they offer as parts."""

import pickle

import numpy as np
import pytest

from lcmchain.coupling.iteration import (
    CoupledPart,
    CoupledSystem,
    Exchange,
    Port,
    WindowControl,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)
from lcmchain.coupling.iteration.consolidation import (
    Column,
    FluidColumn,
    SolidColumn,
    coupled_column,
)
from lcmchain.errors import InputError

COLUMN = Column(cell_count=12, hardening=4.0, load=3e5)
CONTROL = WindowControl(0.05, smallest=0.01, largest=0.2, residual=0.05)


def column(scheme, direction="pressure_from_fluid"):
    return coupled_column(
        COLUMN, scheme(), CONTROL, direction=direction, substeps={"solid": 2}, prediction=2
    )


def fields(system):
    return system.get_fields(["fluid.pore_pressure", "solid.thickness", "solid.volume_rate"])


def assert_identical(one, other):
    """Fields, times, and the convergence history bit by bit."""
    for name, values in fields(one).items():
        assert np.array_equal(values, fields(other)[name]), name
    assert one.time == other.time
    assert repr(one.history.windows) == repr(other.history.windows)
    assert repr(one.history.iterations) == repr(other.history.iterations)


@pytest.mark.parametrize("scheme", [aitken, iqn_ils, iqn_mvj, fixed_point, gauss_seidel, jacobi])
def test_going_on_from_a_saved_state_is_bit_identical(scheme):
    direction = "fixed_stress" if scheme in (fixed_point, aitken) else "pressure_from_fluid"
    whole = column(scheme, direction)
    whole.advance(0.6)
    stored = pickle.dumps(whole.save())  # as a checkpoint keeps it
    whole.advance(0.7)
    assert len(whole.history.windows) > 3
    resumed = column(scheme, direction)
    resumed.restore(pickle.loads(stored))
    resumed.advance(0.7)
    assert_identical(resumed, whole)


def test_a_run_that_was_stopped_between_two_windows_goes_on_bit_identical():
    """Where windows still change their size, and not at the end of a step."""

    class Stopped(Exception):
        pass

    kept = []

    def stop(system):
        if len(system.history.accepted) == 9:
            kept.append(pickle.dumps(system.save()))
            raise Stopped

    whole, stopped, resumed = (column(iqn_ils) for _ in range(3))
    whole.advance(1.1)
    with pytest.raises(Stopped):
        stopped.advance_to(1.1, stop)
    assert 0.0 < stopped.time < 1.1
    resumed.restore(pickle.loads(kept[0]))
    seen = []
    resumed.advance_to(1.1, lambda system: seen.append(system.time))
    assert_identical(resumed, whole)
    assert seen[-1] == 1.1 and len(seen) == len(whole.history.accepted) - 9


def test_restoring_undoes_everything_any_number_of_times():
    system = column(iqn_ils)
    system.advance(0.3)
    saved = system.save()
    before = fields(system)
    for _ in range(2):
        system.advance(0.4)
        after = fields(system)
        system.restore(saved)
        for name, values in fields(system).items():
            assert np.array_equal(values, before[name])
            assert not np.array_equal(values, after[name])
        assert system.time == 0.3


def test_a_coupled_system_is_a_part():
    assert isinstance(column(iqn_ils), CoupledPart)


class Load:
    """A press that lowers the total stress with the settlement: sigma = s0 - k settlement."""

    def __init__(self):
        self.time, self.settlement = 0.0, np.zeros(1)

    def advance(self, step):
        self.time += step

    def save(self):
        return self.time, self.settlement

    def restore(self, saved):
        self.time, self.settlement = saved

    def set_fields(self, given):
        self.settlement = given["settlement"].copy()

    def get_fields(self, names):
        return dict.fromkeys(names, 300000.0 - 200000000.0 * self.settlement)


class LoadedSolid(SolidColumn):
    """A solid that takes its load from outside."""

    def set_fields(self, given):
        given = dict(given)
        if "load" in given:
            self.column = Column(**{**COLUMN.__dict__, "load": float(given.pop("load")[0])})
        super().set_fields(given)

    def save(self):
        return super().save(), self.column

    def restore(self, saved):
        super().restore(saved[0])
        self.column = saved[1]

    def get_fields(self, names):
        known = {"settlement": np.array([COLUMN.height - self._fields["thickness"].sum()])}
        found = {name: known[name] for name in names if name in known}
        return {**found, **super().get_fields([name for name in names if name not in known])}


def pore_exchanges():
    return [
        Exchange("solid", "fluid", "volume_rate", of_window="mean", within="held"),
        Exchange("fluid", "solid", "pore_pressure"),
    ]


def test_a_system_within_a_system_agrees_with_all_parts_in_one():
    window = 0.05
    flat = CoupledSystem(
        {"press": Load(), "solid": LoadedSolid(COLUMN), "fluid": FluidColumn(COLUMN)},
        [
            *pore_exchanges(),
            Exchange("press", "solid", "load", within="held"),
            Exchange("solid", "press", "settlement"),
        ],
        iqn_ils(),
        window=window,
    )
    inner = CoupledSystem(
        {"solid": LoadedSolid(COLUMN), "fluid": FluidColumn(COLUMN)},
        pore_exchanges(),
        iqn_ils(),
        window=window,
        inputs={"load": Port("solid", "load")},
        outputs={"settlement": Port("solid", "settlement")},
    )
    nested = CoupledSystem(
        {"press": Load(), "column": inner},
        [
            Exchange("press", "column", "load", within="held"),
            Exchange("column", "press", "settlement"),
        ],
        aitken(),
        window=window,
    )
    flat.advance(0.5)
    nested.advance(0.5)
    expected = flat.get_fields(["solid.settlement"])["solid.settlement"]
    found = nested.get_fields(["column.settlement"])["column.settlement"]
    assert found == pytest.approx(expected, rel=1e-5)
    assert nested.time == flat.time == inner.time == 0.5
    assert inner.history.restarts == 0
    saved = pickle.loads(pickle.dumps(nested.save()))
    nested.advance(0.2)
    after = nested.get_fields(["column.settlement"])["column.settlement"]
    nested.restore(saved)
    nested.advance(0.2)
    assert np.array_equal(nested.get_fields(["column.settlement"])["column.settlement"], after)


def test_an_output_that_is_a_mean_conserves_what_passed_in_the_step():
    system = CoupledSystem(
        {"solid": SolidColumn(COLUMN), "fluid": FluidColumn(COLUMN)},
        pore_exchanges(),
        iqn_ils(),
        window=0.03,
        substeps={"solid": 3},
        outputs={
            "rate": Port("solid", "volume_rate", "mean"),
            "last": Port("solid", "volume_rate"),
        },
    )
    system.advance(0.1)
    before = system.get_fields(["solid.thickness"])["solid.thickness"]
    system.advance(0.4)
    after = system.get_fields(["solid.thickness"])["solid.thickness"]
    rate = system.get_fields(["rate", "last"])
    assert rate["rate"] * 0.4 == pytest.approx(after - before, rel=1e-10, abs=1e-18)
    assert not np.allclose(rate["last"], rate["rate"], rtol=0.01)


def test_unknown_and_taken_fields_are_refused():
    system = column(iqn_ils)
    with pytest.raises(InputError, match='no output "thickness".*solid.<field>'):
        system.get_fields(["thickness"])
    with pytest.raises(InputError, match="is set by an exchange"):
        system.set_fields({"solid.pore_pressure": np.zeros(12)})
    with pytest.raises(InputError, match="is no input"):
        system.set_fields({"solid.temperature": np.zeros(12)})
    for step in (0.0, -1.0, np.inf):
        with pytest.raises(InputError, match="must be positive"):
            system.advance(step)


def test_places_come_from_the_part():
    assert np.array_equal(column(iqn_ils).places("solid.pore_pressure"), COLUMN.centres())
