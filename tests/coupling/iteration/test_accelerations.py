"""Relaxation and quasi-Newton steps on vectors, without parts."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcmchain.coupling.iteration.schemes import (
    AitkenRelaxation,
    ConstantRelaxation,
    MultiVectorQuasiNewton,
    QuasiNewton,
    filtered_qr,
    triangular_factor,
)
from lcmchain.errors import InputError


def linear_map(size, radius, seed=0):
    """H(x) = M x + b, M with eigenvalues from -radius to 0; return H and its fixed point."""
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    matrix = basis @ np.diag(-radius * np.linspace(1.0, 0.01, size)) @ basis.T
    shift = rng.normal(size=size)
    return lambda x: matrix @ x + shift, np.linalg.solve(np.eye(size) - matrix, shift)


def iterate(acceleration, answer, x, most=200, tolerance=1e-10):
    """Iterate to the fixed point; return it and the number of evaluations."""
    acceleration.begin_window()
    for count in range(1, most + 1):
        found = answer(x)
        if np.linalg.norm(found - x) <= tolerance * np.linalg.norm(found):
            acceleration.end_window(x, found)
            return found, count
        x = acceleration.propose(x, found, np.ones(x.size))
    return None, most


@settings(max_examples=60, deadline=None)
@given(size=st.integers(1, 12), count=st.integers(1, 12), seed=st.integers(0, 1000), data=st.data())
def test_filter_keeps_independent_columns_and_their_factorisation(size, count, seed, data):
    rng = np.random.default_rng(seed)
    columns = [rng.normal(size=size) for _ in range(count)]
    doubled = data.draw(st.integers(0, count - 1))
    columns.insert(doubled + 1, -3.0 * columns[doubled])  # says nothing new
    basis, triangle, kept = filtered_qr(columns, 1e-8)
    assert doubled + 1 not in kept
    assert kept == [0] if size == 1 else len(kept) == min(size, count)
    assert basis.T @ basis == pytest.approx(np.eye(len(kept)), abs=1e-13)
    for number, column in enumerate(kept):
        assert basis @ triangle[:, number] == pytest.approx(columns[column], abs=1e-12)


def test_filter_gives_up_the_later_of_two_like_columns():
    new, old = np.array([1.0, 0.0]), np.array([1.0, 1e-4])
    assert filtered_qr([new, old], 1e-3)[2] == [0]
    assert filtered_qr([new, old], 1e-5)[2] == [0, 1]


@pytest.mark.parametrize(("size", "count"), [(3, 5), (50, 4), (5000, 7), (40_000, 3)])
def test_factor_by_blocks_is_that_of_the_whole(size, count):
    rng = np.random.default_rng(7)
    vectors = [rng.normal(size=size) for _ in range(count)]
    weights = rng.uniform(0.5, 2.0, size)
    found = triangular_factor(vectors, weights)
    matrix = np.stack(vectors, axis=1) * weights[:, None]
    assert found.shape == (min(size, count), count)
    assert found.T @ found == pytest.approx(matrix.T @ matrix, rel=1e-10, abs=1e-10 * size)


def test_a_step_does_not_depend_on_the_number_of_threads():
    """Of the linear algebra library, which is told it when it is loaded."""
    code = """
import hashlib, numpy as np
from lcmchain.coupling.iteration.schemes import QuasiNewton
from lcmchain.coupling.iteration.schemes import AitkenRelaxation
rng = np.random.default_rng(0)
for one in (QuasiNewton(), AitkenRelaxation()):
    one.begin_window()
    x = np.zeros(60_000)
    for _ in range(5):
        x = one.propose(x, np.roll(x, 1) * -3.0 + rng.normal(size=x.size), np.ones(x.size))
    print(hashlib.sha256(x.tobytes()).hexdigest())
"""
    found = [
        subprocess.run(
            [sys.executable, "-P", "-c", code],
            env={**os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    ]
    assert found[0] == found[1] and len(found[0].split()) == 2


def test_filter_of_columns_of_zeros_is_empty():
    basis, triangle, kept = filtered_qr([np.zeros(3), np.zeros(3)], 1e-3)
    assert (basis.shape, triangle.shape, kept) == ((3, 0), (0, 0), [])


@pytest.mark.parametrize("radius", [0.5, 3.0, 1e3])
@pytest.mark.parametrize("size", [1, 4])
def test_quasi_newton_solves_a_linear_problem_in_size_plus_two_evaluations(size, radius):
    """One relaxation, then one new direction per evaluation; the last one finds it converged."""
    answer, solution = linear_map(size, radius)
    newton = QuasiNewton(relaxation=0.5, windows_reused=0, filter_limit=1e-12)
    found, count = iterate(newton, answer, np.zeros(size), tolerance=1e-8)
    assert count <= size + 2
    assert found == pytest.approx(solution, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("make", [QuasiNewton, MultiVectorQuasiNewton])
def test_the_second_window_of_a_linear_problem_needs_two_evaluations(make):
    """The inverse Jacobian is known by then: one step, one evaluation that finds it converged."""
    answer, _ = linear_map(5, 50.0)
    newton = make(filter_limit=1e-12)
    iterate(newton, answer, np.zeros(5))
    moved = np.linspace(1.0, 2.0, 5)
    _, count = iterate(newton, lambda x: answer(x) + moved, np.zeros(5), tolerance=1e-9)
    assert count == 2
    newton.forget()
    _, count = iterate(newton, lambda x: answer(x) - moved, np.zeros(5), tolerance=1e-9)
    assert count > 5


def test_forgotten_attempt_leaves_the_earlier_windows():
    answer, _ = linear_map(3, 5.0)
    newton = QuasiNewton(filter_limit=1e-12)
    iterate(newton, answer, np.zeros(3))
    newton.begin_window()
    wrong = np.array([1.0, 2.0, 3.0])
    x = newton.propose(wrong, 7.0 * wrong, np.ones(3))
    newton.propose(x, wrong[::-1] * 1e3, np.ones(3))
    newton.drop_window()
    _, count = iterate(newton, answer, np.ones(3), tolerance=1e-9)
    assert count == 2


def test_newest_columns_come_first():
    """Of two that nearly agree the older is left out: the map may have changed since."""
    newton = QuasiNewton(filter_limit=0.1, windows_reused=0)
    newton.begin_window()
    x = np.zeros(2)
    for answer in ([1.0, 0.0], [2.0, 0.0]):
        x = newton.propose(x, np.array(answer), np.ones(2))
    following = newton.propose(x, np.array([5.0, 0.01]), np.ones(2))
    old_residual = np.array([2.0, 0.0]) - 0.01 * np.array([1.0, 0.0])
    residual = np.array([5.0, 0.01]) - x
    change = residual - old_residual
    share = -(change @ residual) / (change @ change)
    expected = np.array([5.0, 0.01]) + share * (np.array([5.0, 0.01]) - np.array([2.0, 0.0]))
    assert newton.rank == 1
    assert following == pytest.approx(expected, rel=1e-12)


def test_aitken_finds_the_factor_of_one_unknown_in_two_steps():
    answer, solution = linear_map(1, 9.0)
    aitken = AitkenRelaxation(0.5)
    found, count = iterate(aitken, answer, np.zeros(1))
    assert (count, found) == (3, pytest.approx(solution, rel=1e-12))
    assert aitken.factor == pytest.approx(1.0 / (1.0 + 9.0), rel=1e-12)


@pytest.mark.parametrize(("factor", "converges"), [(0.39, True), (0.41, False)])
def test_constant_relaxation_converges_below_its_limit(factor, converges):
    """Eigenvalue -4: |1 - factor (1 + 4)| < 1 up to a factor of 0.4."""
    answer, _ = linear_map(3, 4.0)
    found, _ = iterate(ConstantRelaxation(factor), answer, np.zeros(3), most=2000)
    assert (found is not None) == converges


@pytest.mark.parametrize("make", [AitkenRelaxation, QuasiNewton, MultiVectorQuasiNewton])
def test_memory_returns_bit_identical(make):
    answer, _ = linear_map(6, 20.0)
    one = make()
    iterate(one, answer, np.zeros(6))
    one.begin_window()
    x = one.propose(np.zeros(6), answer(np.zeros(6)), np.ones(6))
    saved = one.save()

    def go_on(acceleration, x):
        for _ in range(4):
            x = acceleration.propose(x, answer(x), np.ones(6))
        return x

    first = go_on(one, x)
    other = make()
    other.restore(saved)
    assert np.array_equal(go_on(other, x), first)
    one.restore(saved)
    assert np.array_equal(go_on(one, x), first)


def test_wrong_parameters_are_refused():
    for make in (
        lambda: ConstantRelaxation(0.0),
        lambda: AitkenRelaxation(1.5),
        lambda: QuasiNewton(relaxation=-1.0),
        lambda: QuasiNewton(windows_reused=-1),
        lambda: QuasiNewton(filter_limit=1.0),
        lambda: MultiVectorQuasiNewton(windows_reused=3),
    ):
        with pytest.raises(InputError):
            make()
    with pytest.raises(InputError, match="take IQN-ILS"):
        newton = MultiVectorQuasiNewton(most_unknowns=2)
        newton.propose(np.zeros(3), np.ones(3), np.ones(3))
