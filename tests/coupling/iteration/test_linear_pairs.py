"""Two linear parts with a prescribed spectral radius: what diverges, and how fast the rest is."""

import numpy as np
import pytest

from lcmchain.coupling.iteration import (
    CoupledPart,
    CoupledSystem,
    Exchange,
    NotConverged,
    Tolerance,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)

SIZE = 6


class LinearPart:
    """y = M x + b (1 + t), without memory of its own but the time."""

    def __init__(self, matrix, shift):
        self.matrix, self.shift = np.asarray(matrix), np.asarray(shift)
        self.time = 0.0
        self.x = np.zeros(self.matrix.shape[1])

    def advance(self, step):
        self.time += step

    def save(self):
        return self.time, self.x.copy()

    def restore(self, saved):
        self.time, self.x = saved[0], saved[1].copy()

    def set_fields(self, fields):
        self.x = fields["x"].copy()

    def get_fields(self, names):
        assert list(names) == ["y"]
        return {"y": self.matrix @ self.x + self.shift * (1.0 + self.time)}


def pair(radius, scheme, *, tolerance=1e-10, window=0.25, **options):
    """A system whose serial sweep has the eigenvalues -radius (1 .. 0.1); and its solution."""
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.normal(size=(SIZE, SIZE)))[0]
    first = basis @ np.diag(-radius * np.linspace(1.0, 0.1, SIZE))
    second = basis.T
    parts = {
        "a": LinearPart(first, rng.normal(size=SIZE)),
        "b": LinearPart(second, rng.normal(size=SIZE)),
    }
    exchanges = [
        Exchange("a", "b", "y", "x", tolerance=Tolerance(tolerance)),
        Exchange("b", "a", "y", "x", tolerance=Tolerance(tolerance)),
    ]
    system = CoupledSystem(parts, exchanges, scheme, window=window, **options)

    def solution(time):
        shift = (1.0 + time) * (second @ parts["a"].shift + parts["b"].shift)
        return np.linalg.solve(np.eye(SIZE) - second @ first, shift)

    return system, solution


def answer(system):
    return system.get_fields(["b.y"])["b.y"]


def growth(system, solution):
    """Factor by which the error of a scheme grows from window to window, at a fixed shift."""
    for part in system.parts.values():
        part.shift = part.shift / 1e30  # errors only
    system.parts["b"].x = np.ones(SIZE)
    errors = []
    for _ in range(60):
        system.advance(0.25)
        errors.append(np.linalg.norm(answer(system) - solution(system.time)))
    return (errors[-1] / errors[-41]) ** (1.0 / 40.0)


def test_the_part_satisfies_the_protocol():
    assert isinstance(LinearPart(np.eye(2), np.zeros(2)), CoupledPart)


@pytest.mark.parametrize("radius", [0.5, 0.9, 1.1, 2.0])
def test_explicit_schemes_grow_by_their_spectral_radius(radius):
    """Gauss-Seidel by that of the product of both maps, Jacobi by its root."""
    system, solution = pair(radius, gauss_seidel(), prediction=0)
    assert growth(system, solution) == pytest.approx(radius, rel=1e-3)
    system, solution = pair(radius, jacobi(), prediction=0)
    assert growth(system, solution) == pytest.approx(radius**0.5, rel=1e-2)


def test_fixed_point_diverges_above_a_radius_of_one():
    system, solution = pair(0.9, fixed_point(most_iterations=400))
    system.advance(1.0)
    assert answer(system) == pytest.approx(solution(1.0), rel=1e-8)
    system, _ = pair(1.1, fixed_point(most_iterations=400))
    with pytest.raises(NotConverged):
        system.advance(1.0)


@pytest.mark.parametrize("radius", [0.5, 1.5, 20.0])
@pytest.mark.parametrize(
    "scheme",
    [
        lambda: fixed_point(0.05, most_iterations=1000),
        aitken,
        iqn_ils,
        lambda: iqn_ils(order="parallel"),
        lambda: iqn_ils(windows_reused=0),
        iqn_mvj,
        lambda: iqn_mvj(order="parallel"),
    ],
)
def test_implicit_schemes_agree_with_the_direct_solution(scheme, radius):
    system, solution = pair(radius, scheme())
    system.advance(1.0)
    assert answer(system) == pytest.approx(solution(1.0), rel=1e-8, abs=1e-9)


def test_aitken_in_parallel_order_needs_more_iterations():
    """The eigenvalues lie on the imaginary axis, where no single factor is good."""
    counts = []
    for order in ("serial", "parallel"):
        system, solution = pair(1.5, aitken(order=order, most_iterations=200))
        system.advance(1.0)
        assert answer(system) == pytest.approx(solution(1.0), rel=1e-8, abs=1e-9)
        counts.append(system.history.mean_iterations)
    assert counts[1] > 2.0 * counts[0]
    with pytest.raises(NotConverged, match="Aitken"):
        pair(20.0, aitken(order="parallel", most_iterations=200))[0].advance(1.0)


@pytest.mark.parametrize("order", ["serial", "parallel"])
def test_residuals_of_the_plain_fixed_point_fall_by_the_spectral_radius(order):
    system, _ = pair(0.6, fixed_point(order=order, most_iterations=200), tolerance=1e-13)
    system.advance(0.25)
    residuals = [record.residual[1] for record in system.history.iterations]
    rate = (residuals[-1] / residuals[-21]) ** (1.0 / 20.0)
    assert rate == pytest.approx(0.6 if order == "serial" else 0.6**0.5, rel=0.02)


def test_reused_windows_save_iterations_on_a_linear_problem():
    """Once all directions are known, a window takes one step and an evaluation that confirms it."""
    system, _ = pair(20.0, iqn_ils(filter_limit=1e-9), prediction=0, tolerance=1e-8)
    system.advance(2.0)
    iterations = [window.iterations for window in system.history.windows]
    assert iterations[0] >= SIZE
    assert max(iterations[2:]) <= 2


def test_linear_prediction_meets_a_linear_solution_at_once():
    system, _ = pair(0.5, iqn_ils(), prediction=1, tolerance=1e-6)
    system.advance(2.0)
    assert [window.iterations for window in system.history.windows[2:]] == [1] * 6


def test_a_field_that_leads_forward_is_judged_where_that_is_asked_for():
    def history(judged):
        system, _ = pair(0.5, fixed_point())
        exchanges = [
            Exchange("a", "b", "y", "x", judged=judged, tolerance=Tolerance(1e-9)),
            Exchange("b", "a", "y", "x", tolerance=Tolerance(1e-2)),
        ]
        system = CoupledSystem(system.parts, exchanges, fixed_point(), window=1.0)
        system.advance(1.0)
        return system.history

    lax, strict = history("unknown"), history("always")
    assert strict.windows[0].iterations > lax.windows[0].iterations + 10
    assert np.isinf(lax.iterations[-1].limit[0])
    last = strict.iterations[-1]
    assert last.residual[0] <= last.limit[0] == pytest.approx(1e-9 * last.size[0])


def test_a_mapping_between_meshes_is_applied_both_ways():
    """Part b works on twice as many values, each the half of one of part a."""
    rng = np.random.default_rng(3)
    split = np.repeat(np.eye(3), 2, axis=0) / 2.0  # (6, 3)
    parts = {
        "a": LinearPart(-2.0 * np.eye(3), rng.normal(size=3)),
        "b": LinearPart(np.eye(6), np.zeros(6)),
    }
    exchanges = [
        Exchange("a", "b", "y", "x", mapping=split),
        Exchange("b", "a", "y", "x", mapping=lambda values: split.T @ values * 2.0),
    ]
    system = CoupledSystem(parts, exchanges, iqn_ils(), window=1.0)
    system.advance(1.0)
    expected = 2.0 * parts["a"].shift / 3.0  # y = -2 y + 2 b
    assert parts["a"].get_fields(["y"])["y"] == pytest.approx(expected, rel=1e-6)


def test_relaxation_of_a_single_field_comes_on_top():
    """Both fields relaxed by a half equal the scheme with that factor."""

    def residuals(scheme, relaxation):
        system, _ = pair(0.5, scheme)
        exchanges = [
            Exchange("a", "b", "y", "x", relaxation=relaxation),
            Exchange("b", "a", "y", "x", relaxation=relaxation),
        ]
        system = CoupledSystem(system.parts, exchanges, scheme, window=1.0)
        system.advance(1.0)
        return np.array([record.residual for record in system.history.iterations])

    whole = residuals(fixed_point(0.5, order="parallel"), 1.0)
    single = residuals(fixed_point(1.0, order="parallel"), 0.5)
    assert single == pytest.approx(whole, rel=1e-9, abs=1e-14)
