"""Differences of runs: exact where the fields are, at a known rate where they are not."""

import math

import numpy as np
import pytest

from lcmchain.study.comparison import (
    QUANTITIES,
    Difference,
    boundary,
    carry,
    contour_difference,
    differences,
)
from lcmchain.study.convergence import fitted, progress
from lcmchain.study.outcome import Outcome, read_outcome, write_outcome

SIZE = 0.3


def sheet(count: int, shear=None, thickness=None, shift=(0.0, 0.0, 0.0), turn=0.0) -> Outcome:
    """A square of count x count faces with fields that are means over the faces."""
    line = np.linspace(-0.5 * SIZE, 0.5 * SIZE, count + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    faces = np.column_stack([corner, corner + count + 1, corner + count + 2, corner + 1])
    values = {}
    for name, field in (("shear_angle", shear), ("thickness", thickness)):
        if field is not None:
            values[name] = mean_over(field, line)
    c, s = math.cos(turn), math.sin(turn)
    turned = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return Outcome(1.0, 1, points, turned + np.asarray(shift), faces, values)


def mean_over(field, line: np.ndarray) -> np.ndarray:
    """Means over the cells by Gauss integration, 4 points each way."""
    at, weight = np.polynomial.legendre.leggauss(4)
    middle, half = 0.5 * (line[1:] + line[:-1]), 0.5 * np.diff(line)
    places = middle[:, None] + half[:, None] * at
    values = field(places[:, None, :, None], places[None, :, None, :])
    return (np.einsum("ijab,a,b->ij", values, weight, weight) / 4.0).ravel()


def test_a_linear_field_is_carried_exactly_between_meshes_that_do_not_match():
    def linear(x, y):
        return 0.3 + 2.0 * x - y

    carried, areas = carry(sheet(7, linear), sheet(12, linear), ["shear_angle"])
    wanted = sheet(12, linear).values["shear_angle"]
    np.testing.assert_allclose(carried["shear_angle"], wanted, atol=1e-12)
    assert areas.sum() == pytest.approx(SIZE**2, rel=1e-12)


def test_the_norm_of_a_difference_is_its_root_mean_square_over_the_sheet():
    fine = sheet(40, lambda x, y: 0.0 * x * y)
    off = sheet(40, lambda x, y: x + 0.0 * y)
    found = differences(off, fine)["shear_angle"]
    # of x over a square: SIZE / sqrt(12), less what its means over 40 cells leave out
    exact = SIZE / math.sqrt(12.0) * math.sqrt(1.0 - 1.0 / 40**2)
    assert found.typical == pytest.approx(exact, rel=1e-12)
    assert found.high == pytest.approx(18.5 / 40 * SIZE, rel=1e-12)  # 19 of 20 columns a side
    assert found.largest == pytest.approx(0.5 * SIZE * (1 - 1 / 40), rel=1e-12)


def test_errors_of_thickness_are_parts_of_it_and_of_shear_angles_are_not():
    fine = sheet(9, lambda x, y: 0.5 + 0 * x * y, lambda x, y: 1e-3 + 0 * x * y)
    off = sheet(9, lambda x, y: 0.6 + 0 * x * y, lambda x, y: 1.1e-3 + 0 * x * y)
    found = differences(off, fine)
    assert found["shear_angle"].typical == pytest.approx(0.1, rel=1e-12)
    assert found["thickness"].typical == pytest.approx(0.1, rel=1e-12)
    assert math.isnan(found["fibre_volume_fraction"].typical)
    assert math.isnan(found["punch_force"].typical)


def test_numbers_differ_by_their_part_and_a_failed_run_by_nothing_known():
    one, two = (Outcome(1.0, numbers={"punch_force_max_N": f}) for f in (11.0, 10.0))
    one, two = (
        Outcome(1.0, 1, s.reference, s.formed, s.faces, {}, o.numbers)
        for o, s in ((one, sheet(3)), (two, sheet(3)))
    )
    assert differences(one, two)["punch_force"].typical == pytest.approx(0.1)
    failed = differences(Outcome(1.0, failure="folded"), two)
    assert set(failed) == {q.name for q in QUANTITIES}
    assert all(math.isnan(d.typical) for d in failed.values())


def test_the_contour_of_a_shifted_square_is_as_far_off_as_it_was_shifted():
    # along z every place is off by the shift; along x only the sides across it
    up = contour_difference(sheet(8, shift=(0, 0, 2e-3)), sheet(11))
    assert up.typical == pytest.approx(2e-3, rel=1e-9)
    aside = contour_difference(sheet(50, shift=(2e-3, 0, 0)), sheet(50))
    assert aside.typical == pytest.approx(2e-3 * math.sqrt(0.5), rel=0.01)
    assert contour_difference(sheet(8), sheet(11)).largest < 1e-12


def test_triangles_and_quadrilaterals_have_one_boundary():
    faces = np.array([[0, 1, 2, -1], [0, 2, 3, 4]])
    edges = {tuple(sorted(edge)) for edge in boundary(faces).tolist()}
    assert edges == {(0, 1), (1, 2), (2, 3), (3, 4), (0, 4)}


def test_high_errors_are_taken_over_the_area_and_not_over_faces():
    values = np.array([1.0, 2.0, 100.0])
    assert Difference.of_field(values, np.array([50.0, 48.0, 2.0])).high == 2.0
    assert Difference.of_field(values, np.array([1.0, 1.0, 98.0])).high == 100.0
    assert math.isnan(Difference.of_field(np.array([math.nan]), np.ones(1)).typical)


def distance(h: float, g: float, order: float, alike: float) -> float:
    """Distance of runs of the sizes h > g with errors of 0.7 h^order, correlated by (g/h)^alike."""
    e, f = 0.7 * h**order, 0.7 * g**order
    return math.sqrt(e**2 + f**2 - 2.0 * e * f * (g / h) ** alike)


def distances(sizes, order: float, alike: float) -> dict:
    return {
        (i, j): distance(sizes[i], sizes[j], order, alike)
        for i in range(len(sizes)) for j in range(i + 1, len(sizes))
    }  # fmt: skip


@pytest.mark.parametrize("order", [0.6, 1.0, 1.4, 1.9])
@pytest.mark.parametrize("alike", ["one field", "squares add up", "not alike"])
def test_the_order_and_the_error_of_a_known_law_are_found_on_any_sizes(order, alike):
    correlation = {"one field": 0.0, "squares add up": order, "not alike": 2.0 * order}[alike]
    sizes = (10.0, 7.0, 4.5)
    found = fitted(sizes, distances(sizes, order, correlation))
    assert found.order == pytest.approx(order, abs=0.15)
    # what is left open is taken on the safe side
    assert 0.9 < found.error(4.5) / (0.7 * 4.5**order) < 1.4
    assert found.size(found.error(3.0)) == pytest.approx(3.0, rel=1e-9)


def test_distances_of_unlike_errors_are_not_taken_for_those_of_one_field():
    """Differences of errors, as of one field, would make four times the error of such runs."""
    sizes = (10.0, 7.07, 5.0)
    known = distances(sizes, 1.0, 2.0)
    as_one_field = known[1, 2] / (sizes[1] / sizes[2] - 1.0)
    assert as_one_field > 3.0 * 0.7 * 5.0
    assert 0.9 < fitted(sizes, known).error(5.0) / (0.7 * 5.0) < 1.4


def test_two_meshes_leave_the_order_open_and_bound_the_error():
    found = fitted((10.0, 7.0), {(0, 1): 1.0})
    assert 1.0 < found.order < 1.5
    # of one field, with the order 0.8: 3.0 times the distance; not alike: 0.8 times
    assert 2.5 < found.error(7.0) < 3.5
    for unknown in (0.0, math.nan):
        assert math.isnan(fitted((10.0, 7.0), {(0, 1): unknown}).order)
    assert math.isnan(fitted((10.0,), {}).order)


def test_the_usual_order_counts_where_meshes_tell_none():
    two = (10.0, 7.0)
    low, high = (fitted(two, {(0, 1): 1.0}, usual) for usual in (0.8, 1.8))
    assert low.order < 1.1 < 1.5 < high.order
    assert low.error(7.0) > 1.2 * high.error(7.0)
    # distances that scatter lead to the bound of orders without it
    sizes = (10.0, 7.0, 5.0)
    known = distances(sizes, 1.5, 1.5)
    scattered = known | {(0, 1): 0.8 * known[0, 1], (1, 2): 1.25 * known[1, 2]}
    assert fitted(sizes, scattered).order < 0.8
    found = fitted(sizes, scattered, 1.5)
    assert 0.9 < found.order < 1.6
    assert 0.7 * 5.0**1.5 < found.error(5.0) < fitted(sizes, scattered).error(5.0)


def test_what_meshes_tell_clearly_counts_more_than_the_usual_order():
    sizes = (10.0, 7.0, 5.0, 3.5)
    found = fitted(sizes, distances(sizes, 0.7, 0.0), 1.5)
    assert found.order == pytest.approx(0.7, abs=0.2)
    assert 0.9 < found.error(3.5) / (0.7 * 3.5**0.7) < 1.4
    assert found.misfit < 0.05
    force = {pair: 0.1 * (1 + 5 * (sum(pair) % 2)) for pair in distances(sizes, 1.0, 0.0)}
    assert fitted(sizes, force, 1.5).misfit > 0.5


def test_progress_is_one_where_every_refinement_changes_as_much():
    def result(h):
        return 3.0 * math.log(h)

    h = (10.0, 7.0, 2.0)
    steps = result(h[0]) - result(h[1]), result(h[1]) - result(h[2])
    assert progress(h, steps) == pytest.approx(1.0)
    assert progress((4.0, 2.0, 1.0), (2.0, 1.0)) == pytest.approx(2.0)
    # where squares add up, two small refinements change as much as one large one, over root two
    small = progress((4.0, 2.0, math.sqrt(2.0)), (math.sqrt(2.0), 1.0), by_squares=True)
    assert small == pytest.approx(1.0)


def test_the_order_of_a_smooth_field_is_that_of_its_error():
    def field(h):
        return lambda x, y: np.sin(9.0 * x) * np.cos(7.0 * y) * (1.0 + 30.0 * h**2)

    runs = [sheet(n, field(SIZE / n)) for n in (20, 30, 45)]
    between = {
        (i, j): differences(runs[i], runs[j])["shear_angle"].typical
        for i, j in ((0, 1), (0, 2), (1, 2))
    }
    found = fitted([SIZE / n for n in (20, 30, 45)], between)
    assert found.order == pytest.approx(2.0, abs=0.15)
    assert found.error(SIZE / 45) == pytest.approx(
        differences(runs[2], sheet(45, field(0.0)))["shear_angle"].typical, rel=0.25
    )


def test_an_outcome_is_read_as_it_was_written_and_only_for_what_it_is_of(tmp_path):
    path = tmp_path / "run.nc"
    made = sheet(5, lambda x, y: x * y, lambda x, y: 1e-3 + x * y)
    made = Outcome(
        2.5, 2, made.reference, made.formed, made.faces, made.values,
        {"punch_force_max_N": 1.0 / 3.0}, np.array([[0.5, 1.0 / 7.0]]), "",
        {"At rest at the end": 2, "Damping": 3},
    )  # fmt: skip
    write_outcome(path, made, "one")
    found = read_outcome(path, "one")
    assert found.equals(made)
    assert (found.seconds, found.threads, found.numbers) == (2.5, 2, made.numbers)
    assert found.doubts == made.doubts
    assert read_outcome(path, "other") is None
    assert read_outcome(tmp_path / "absent.nc", "one") is None
    path.write_bytes(path.read_bytes()[:1000])
    assert read_outcome(path, "one") is None


def test_checks_are_worse_by_their_grade_and_those_of_the_mesh_are_left_out():
    one = Outcome(1.0, doubts={"Damping": 2, "Quasi-static": 3, "Resolution of wrinkles": 3})
    other = Outcome(1.0, doubts={"Damping": 2, "Quasi-static": 2})
    assert one.worse_than(other) == ["Quasi-static"]
    assert other.worse_than(one) == []
