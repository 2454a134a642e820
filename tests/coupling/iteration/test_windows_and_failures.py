"""Windows that fail: what is tried again, what stops the run, and what the message says."""

import numpy as np
import pytest

from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    NotConverged,
    PartFailed,
    Tolerance,
    WindowControl,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
)
from lcmchain.coupling.iteration.attempt import judge, rms
from lcmchain.coupling.iteration.consolidation import Column, coupled_column
from lcmchain.coupling.iteration.system import Predictor, WindowSize
from lcmchain.errors import InputError, SimulationError


class Rod:
    """A part whose answer is -gain x + time; fails where ``refuses(step, x)`` says so."""

    def __init__(self, gain=0.0, refuses=lambda step, x: ""):
        self.gain, self.refuses = gain, refuses
        self.time, self.x, self.steps = 0.0, np.zeros(3), []

    def advance(self, step):
        if reason := self.refuses(step, self.x):
            raise SimulationError(reason)
        self.time += step
        self.steps.append((step, self.x.copy()))

    def save(self):
        return self.time, self.x.copy()

    def restore(self, saved):
        self.time, self.x = saved[0], saved[1].copy()

    def set_fields(self, fields):
        self.x = fields["x"].copy()

    def get_fields(self, names):
        return {name: -self.gain * self.x + self.time * np.array([1.0, 2.0, 3.0]) for name in names}

    def places(self, name):
        return np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.02, 0.0, 0.005]])


def rods(gain, scheme, *, refuses=lambda step, x: "", **options):
    parts = {"a": Rod(gain, refuses), "b": Rod()}
    parts["b"].get_fields = lambda names: {"y": parts["b"].x.copy()}
    exchanges = [Exchange("a", "b", "y", "x"), Exchange("b", "a", "y", "x")]
    return CoupledSystem(parts, exchanges, scheme, **options)


def test_a_window_that_does_not_converge_names_field_cell_place_and_excess():
    system = rods(2.0, fixed_point(most_iterations=7), window=0.5)
    with pytest.raises(NotConverged) as caught:
        system.advance(1.0)
    message = str(caught.value)
    for words in (
        "fixed point) in 7 iterations",
        "window of 0.5 s from 0 s",
        "b.y -> a.x still changes by",
        "value 2 near (20.00, 0.00, 5.00) mm",
        "Remedies",
    ):
        assert words in message
    assert (caught.value.exchange, caught.value.value) == ("b.y -> a.x", 2)
    # residual = |(-2)^k| * rms(0.5, 1, 1.5); allowed 1e-6 of the field
    changes = 2.0**6 * rms(np.array([0.5, 1.0, 1.5]))
    assert caught.value.residual == pytest.approx(changes)
    assert caught.value.limit == pytest.approx(1e-6 * changes * 43.0 / 64.0)


def test_after_an_error_the_system_stands_at_the_begin_of_the_window():
    system = rods(2.0, fixed_point(most_iterations=7), window=0.5)
    with pytest.raises(NotConverged):
        system.advance(1.0)
    assert [system.time, *(part.time for part in system.parts.values())] == [0.0, 0.0, 0.0]
    (record,) = system.history.windows
    assert (record.outcome, record.iterations) == (3, 7)
    assert record.reason.startswith("the coupling did not converge")


def test_hopeless_iterations_are_given_up():
    system = rods(1e5, fixed_point(), window=1.0)
    with pytest.raises(NotConverged, match="diverged .* in 4 iterations"):
        system.advance(1.0)


def test_a_field_that_is_not_judged_may_grow_from_rounding_to_its_size():
    """As the pressure in a dry part when a gate opens: no divergence."""
    parts = rods(0.5, fixed_point(), window=1.0).parts
    rod = parts["a"]
    answer = rod.get_fields

    def with_rounding(names):
        return answer(names) | {"echo": rod.x + 1e-14 * rod.time}

    rod.get_fields = with_rounding
    exchanges = [
        Exchange("a", "b", "y", "x"),
        Exchange("b", "a", "y", "x"),
        Exchange("a", "b", "echo", tolerance=None),
    ]
    system = CoupledSystem(parts, exchanges, fixed_point(), window=1.0, prediction=0)
    system.advance(1.0)
    grown = [step.residual[2] for step in system.history.iterations]
    assert grown[1] > 1e12 * grown[0] > 0.0
    assert system.history.windows[-1].outcome == 0


def test_going_on_is_an_option_and_is_recorded(caplog):
    system = rods(2.0, fixed_point(most_iterations=7), window=0.5, on_failure="go_on")
    system.advance(1.0)
    assert system.time == 1.0
    assert [window.outcome for window in system.history.windows][-1] == 2
    assert "did not converge" in system.history.windows[-1].reason
    assert "the run goes on" in caplog.text


def test_a_failed_part_is_named_with_time_step_and_inputs():
    def refuses(step, x):
        return "the element 7 is inverted" if x[0] > 1.0 else ""

    system = rods(0.5, fixed_point(), refuses=refuses, window=0.5, prediction=0)
    with pytest.raises(PartFailed) as caught:
        system.advance(3.0)
    failure = caught.value
    assert (failure.part, failure.step) == ("a", 0.5)
    assert failure.time == system.time > 0.0
    for words in (
        'part "a" failed at',
        "step 0.5 s",
        "element 7 is inverted",
        "Its inputs: x 1",
        " to ",
    ):
        assert words in str(failure)


def test_the_cause_is_told_also_of_a_part_that_cannot_go_back_after_it():
    system = rods(0.5, fixed_point(), refuses=lambda step, x: "it broke", window=0.5)

    def lost(_):
        raise PartFailed("its state cannot be restored", part="a")

    system.parts["a"].restore = lost
    with pytest.raises(PartFailed, match=r'part "a" failed at 0 s, step 0.5 s: it broke'):
        system.advance(0.5)


def test_what_is_no_number_is_refused_before_it_spreads():
    system = rods(0.5, fixed_point(), window=0.5)
    system.parts["a"].get_fields = lambda names: {"y": np.array([1.0, np.nan, np.inf])}
    with pytest.raises(PartFailed, match=r'"a" .*2 of 3 values of y are no numbers.*number 1'):
        system.advance(0.5)


def test_an_error_that_is_no_failure_of_the_simulation_passes_through():
    def refuses(step, x):
        raise KeyError("a programming error")

    with pytest.raises(KeyError):
        rods(0.5, fixed_point(), refuses=refuses, window=0.5).advance(0.5)


def test_a_failed_window_is_halved_restored_and_tried_again():
    def refuses(step, x):
        return "too long" if step > 0.3 else ""

    control = WindowControl(1.0, smallest=0.05, patience=99)
    system = rods(0.5, fixed_point(), refuses=refuses, window=control)
    system.advance(2.0)
    tried = [(w.window, w.attempt, w.size, w.outcome) for w in system.history.windows[:4]]
    assert tried == [(0, 0, 1.0, 3), (0, 1, 0.5, 3), (0, 2, 0.25, 0), (1, 0, 0.25, 0)]
    assert system.history.restarts == 2
    assert system.parts["a"].time == pytest.approx(2.0, rel=1e-12)
    assert system.get_fields(["b.y"])["b.y"] == pytest.approx(
        2.0 / 1.5 * np.array([1.0, 2.0, 3.0]), rel=1e-5
    )


def test_a_window_that_fails_by_its_prediction_is_repeated_without_it():
    """Extrapolated values are refused, held ones are not; the window keeps its size."""
    seen = []

    def refuses(step, x):
        seen.append(x[0])
        return "beyond 1" if len(seen) == 4 else ""

    system = rods(0.0, fixed_point(), refuses=refuses, window=0.5)
    system.parts["b"].get_fields = lambda names: {"y": np.full(3, min(system.parts["b"].time, 1.0))}
    system.advance(1.5)
    assert [window.size for window in system.history.windows] == [0.5] * 4
    assert [window.outcome for window in system.history.windows].count(3) == 1
    assert system.history.windows[-1].attempt + system.history.windows[-2].attempt >= 1


def test_windows_grow_when_they_go_easily_and_never_beyond_the_largest():
    control = WindowControl(0.1, smallest=0.01, largest=0.5, patience=2, grow=2.0)
    system = rods(0.01, fixed_point(), window=control)
    system.advance(5.0)
    sizes = [window.size for window in system.history.windows]
    assert sizes[:3] == pytest.approx([0.1, 0.1, 0.2], rel=0.03)
    assert 0.45 < max(sizes) <= 0.5 + 1e-12
    assert system.time == 5.0


def test_windows_fill_a_step_evenly_and_end_where_it_ends():
    system = rods(0.1, fixed_point(), window=0.3)
    system.advance(1.0)
    assert [w.size for w in system.history.windows] == pytest.approx([0.25] * 4)
    assert system.time == 1.0
    system.advance(0.7)
    assert system.time == 1.7


def test_differences_are_dropped_when_the_window_changes():
    """The first proposal in a window of another size is a relaxation again."""
    system = coupled_column(Column(), iqn_ils(), 1.0)
    system.advance(3.0)
    system.advance(0.5)
    first = {}
    for record in system.history.iterations:
        first.setdefault(record.window, record)
    assert [first[window].rank > 0 for window in range(4)] == [False, True, True, False]


def test_a_missed_coupling_residual_rejects_the_window():
    control = WindowControl(0.5, smallest=0.01, largest=0.5, residual=0.05)
    column = Column()
    system = coupled_column(column, iqn_ils(), control, direction="fixed_stress")
    system.advance(2.0)
    rejected = [window for window in system.history.windows if window.outcome == 4]
    assert rejected and all(window.missed > 0.1 for window in rejected)
    standing = system.history.accepted
    assert all(w.missed <= 0.1 or w.size < 0.011 for w in standing)


def test_substeps_see_inputs_in_between():
    def inputs(within):
        parts = {"a": Rod(), "b": Rod()}
        exchanges = [
            Exchange("a", "b", "y", "x", within=within),
            Exchange("b", "a", "y", "x", tolerance=None),
        ]
        system = CoupledSystem(
            parts, exchanges, gauss_seidel(), window=1.0, substeps={"b": 4}, prediction=0
        )
        system.advance(1.0)
        return [x[0] for _, x in parts["b"].steps], [step for step, _ in parts["b"].steps]

    assert inputs("linear") == ([0.25, 0.5, 0.75, 1.0], [0.25] * 4)
    assert inputs("held") == ([1.0, 1.0, 1.0, 1.0], [0.25] * 4)


def test_the_mean_of_the_source_s_substeps_is_exchanged_where_asked_for():
    parts = {"a": Rod(), "b": Rod()}
    exchanges = [Exchange("a", "b", "y", "x", of_window="mean", within="held")]
    system = CoupledSystem(parts, exchanges, gauss_seidel(), window=1.0, substeps={"a": 4})
    system.advance(1.0)
    assert parts["b"].x == pytest.approx(np.array([1.0, 2.0, 3.0]) * (0.25 + 0.5 + 0.75 + 1.0) / 4)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_prediction_is_exact_for_polynomials_of_its_order(order):
    predictor = Predictor(order)

    def field(time, degree):
        return [np.array([1.0, -2.0]) * time**degree + 3.0]

    for degree in (0, 1, 2):
        for time in (0.0, 0.5, 0.7, 1.9):  # windows of different size
            predictor.accept(time, field(time, degree))
        exact = np.allclose(predictor.at(2.5)[0], field(2.5, degree)[0], rtol=1e-12)
        assert exact == (degree <= order)


def test_tolerances_combine():
    before, now, start = np.array([1.0, 1.0]), np.array([1.0, 1.1]), np.array([0.9, 0.9])
    size, change = rms(now), 0.1 / 2.0**0.5

    def limit(scale=0.0, **given):
        judgement = judge(before, now, start, Tolerance(**given), scale)
        assert judgement.residual == pytest.approx(change)
        assert (judgement.worst, judgement.worst_residual) == (1, pytest.approx(0.1))
        return judgement.limit

    assert limit(relative=0.1) == pytest.approx(0.1 * size)
    assert limit(relative=0.1, increment=0.1) == pytest.approx(0.1 * rms(now - start))
    assert limit(relative=0.01, increment=0.9) == pytest.approx(0.01 * size)
    assert limit(relative=0.1, absolute=7.0) == 7.0
    assert limit(relative=None, absolute=7.0) == 7.0
    assert limit(relative=1e-6, floor=1e-3, scale=50.0) == pytest.approx(0.05)
    largest = judge(before, now, start, Tolerance(norm="largest"), 0.0)
    assert (largest.residual, largest.size) == (pytest.approx(0.1), 1.1)
    assert judge(before, now, start, None, 0.0).converged


def test_a_field_of_zeros_converges():
    zeros = np.zeros(4)
    assert judge(zeros, zeros, zeros, Tolerance(), 0.0).converged
    assert judge(np.zeros(0), np.zeros(0), np.zeros(0), Tolerance(), 0.0).converged


def test_rms_neither_overflows_nor_underflows():
    assert rms(np.array([3e200, 4e200])) == pytest.approx(1e200 * 12.5**0.5)
    assert rms(np.array([3e-200, 4e-200])) == pytest.approx(1e-200 * 12.5**0.5)


def test_windows_follow_the_residual_with_the_order_of_the_prediction():
    size = WindowSize(WindowControl(1.0, smallest=1e-3, largest=10.0, residual=0.01, patience=99))
    size.follow(1.0, 9, 0.04, 1)
    assert size.size == pytest.approx(0.9 * 0.5)
    size.follow(0.45, 9, 0.01 * 64.0, 2)
    assert size.size == pytest.approx(0.45 * 0.9 / 4.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"exchanges": [Exchange("a", "c", "y", "x")]}, 'no part "c"'),
        ({"exchanges": [Exchange("a", "b", "y", "x")] * 2}, "two exchanges set"),
        ({"exchanges": [Exchange("a", "b", "y", "x")]}, "closes a loop"),
        ({"substeps": {"z": 2}}, 'no part "z"'),
        ({"substeps": {"a": 0}}, "whole number"),
        ({"window": 0.0}, "must be positive"),
        ({"prediction": 3}, "0, 1 or 2"),
        ({"parts": {}}, "needs parts"),
        ({"on_failure": "ignore"}, "go_on"),
        (
            {"scheme": gauss_seidel(), "window": WindowControl(1.0, largest=2.0)},
            "coupling residual",
        ),
        (
            {
                "exchanges": [
                    Exchange("a", "b", "y", "x"),
                    Exchange("b", "a", "y", "x", iterated=False),
                ]
            },
            "must lead forward",
        ),
    ],
)
def test_a_system_that_cannot_work_is_refused(change, words):
    given = {
        "parts": {"a": Rod(), "b": Rod()},
        "exchanges": [Exchange("a", "b", "y", "x"), Exchange("b", "a", "y", "x")],
        "scheme": aitken(),
        "window": 1.0,
        **change,
    }
    with pytest.raises(InputError, match=words):
        CoupledSystem(given.pop("parts"), given.pop("exchanges"), given.pop("scheme"), **given)


def test_parts_at_different_times_are_refused():
    late = Rod()
    late.time = 1.0
    with pytest.raises(InputError, match="a 0 s, b 1 s"):
        CoupledSystem({"a": Rod(), "b": late}, [], gauss_seidel(), window=1.0)


@pytest.mark.parametrize(
    "given",
    [{"relative": 0.0}, {"relative": None}, {"absolute": -1.0}, {"floor": 1.0}, {"norm": "max"}],
)
def test_wrong_tolerances_are_refused(given):
    with pytest.raises(InputError):
        Tolerance(**given)


@pytest.mark.parametrize(
    "given",
    [
        {"scale": 0.0},
        {"relaxation": 1.5},
        {"of_window": "sum"},
        {"within": "cubic"},
        {"judged": "never"},
        {"bounds": (1.0, 1.0)},
    ],
)
def test_wrong_exchanges_are_refused(given):
    with pytest.raises(InputError, match="a.y -> b.x"):
        Exchange("a", "b", "y", "x", **given)


@pytest.mark.parametrize(
    "given",
    [{"size": 1.0, "smallest": 2.0}, {"size": 1.0, "largest": 0.5}, {"size": 1.0, "grow": 1.0}],
)
def test_wrong_window_controls_are_refused(given):
    with pytest.raises(InputError):
        WindowControl(**given)


def test_explicit_schemes_with_constant_windows_take_parts_that_cannot_save():
    def refuse(*_):
        raise NotImplementedError("no state")

    system = rods(0.5, gauss_seidel(), window=0.5)
    for part in system.parts.values():
        part.save = part.restore = refuse
    system.advance(2.0)
    assert system.time == 2.0
    system.parts["a"].refuses = lambda step, x: "broken"
    with pytest.raises(PartFailed, match="broken"):
        system.advance(1.0)
    with pytest.raises(NotImplementedError):
        implicit = rods(0.5, fixed_point(), window=0.5)
        implicit.parts["a"].save = refuse
        implicit.advance(0.5)


@pytest.mark.parametrize("end, size, count", [(20.0, 1e-3, 20_000), (7.0, 1e-4, 70_000), (1, 3, 1)])
def test_many_windows_keep_their_size_to_the_end(end, size, count):
    windows, time, sizes = WindowSize(WindowControl(size)), 0.0, []
    while time < end:
        sizes.append(windows.within(end - time))
        time = end if sizes[-1] >= end - time else time + sizes[-1]
    assert len(sizes) == count
    np.testing.assert_allclose(sizes, min(size, end), rtol=1e-8)
