"""Shell benchmarks in linear theory: value per mesh, finest mesh, thin limit, observed order."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from lcmchain.scene import Element, scene_from_text
from lcmchain.verification.benchmarks import linear
from lcmchain.verification.benchmarks.meshes import AS_PUBLISHED, NO_SHEAR_ROW
from lcmchain.verification.benchmarks.meshes import OPTIONS as OPTION_SETS
from lcmchain.verification.benchmarks.patch import patch_test
from lcmchain.verification.benchmarks.result import CurveResult
from lcmchain.verification.benchmarks.table import Report, linear_benchmarks

CURVED = (linear.scordelis_lo, linear.pinched_cylinder, linear.hemisphere)
OPTIONS = {
    "as published": AS_PUBLISHED,
    "no shear row": NO_SHEAR_ROW,
    "normal thickness": Element(),
    "normal thickness, no shear row": Element(in_plane_shear_hourglass=False),
}
SCENE_WITHOUT_ELEMENT = """
blank = { size = ["10 mm", "10 mm"], edge_length = "5 mm" }
process = { time = "1 ms" }
material = { preset = "MD600" }
"""


@pytest.fixture(scope="session")
def results():
    """Every linear benchmark of ``lcmchain verify benchmarks``."""
    return [case() for case in linear_benchmarks()]


def observed_orders(values):
    """Order of convergence from successive differences of values on halved meshes."""
    change = abs(np.diff(values))
    return np.log2(change[:-1] / change[1:])


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("kind", ["membrane", "bending"])
def test_patch_of_distorted_elements_is_in_constant_stress(kind, options):
    result = patch_test(kind, OPTIONS[options])
    assert result.normalised == pytest.approx(1.0, abs=1e-9)


def test_values_per_mesh_are_those_of_an_independent_implementation(results):
    """Within 2 %, and half of the last printed digit of the independent value."""
    known = [result for result in results if result.expected is not None]
    assert len(known) > 50
    wrong = [
        f"{r.name} {r.mesh}: {r.normalised:.4f}, expected {r.expected}"
        for r in known
        if abs(r.normalised - r.expected) > 0.02 * r.expected + 5e-4
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "case",
    [
        *(partial(problem, 32) for problem in CURVED),
        *(partial(linear.twisted_beam, thickness, load, 48) for thickness, load in linear.TWISTED),
        partial(linear.straight_cantilever, "extension", "rectangle", 48, 4),
        partial(linear.straight_cantilever, "out-of-plane", "rectangle", 48, 4),
        partial(linear.straight_cantilever, "in-plane", "rectangle", 96, 8, NO_SHEAR_ROW),
        *(partial(linear.clamped_plate, load, 1000, 32) for load in linear.COEFFICIENTS),
    ],
    ids=lambda case: " ".join(map(str, (case.func.__name__, *case.args[:4]))),
)
def test_finest_mesh_reaches_the_reference(case):
    assert 0.98 < case().normalised < 1.02


@pytest.mark.parametrize("problem", CURVED, ids=lambda problem: problem.__name__)
def test_normal_thickness_reaches_the_reference_on_the_finest_mesh(problem):
    assert 0.98 < problem(32, Element()).normalised < 1.02


@pytest.mark.parametrize("load", linear.COEFFICIENTS)
def test_a_plate_of_any_slenderness_neither_locks_nor_scatters(load):
    """From L/t = 10³ to 10⁵ the deflection is that of the Kirchhoff plate to four digits.

    With nodal unknowns a direct solution scatters by percents at 10⁴.
    """
    values = [linear.clamped_plate(load, slenderness, 16) for slenderness in (1e3, 1e4, 1e5)]
    thin = [value.normalised for value in values]
    np.testing.assert_allclose(thin, thin[1], rtol=1e-4)
    assert thin[1] == pytest.approx(1.0, abs=3e-3)


def test_clamped_plate_converges_with_second_order_to_the_series():
    """At L/t = 10⁴, where the transverse shear that the series leaves out is negligible."""
    counts = (4, 8, 16, 32)
    error = [1.0 - linear.clamped_plate("uniform", 1e4, count).normalised for count in counts]
    orders = np.log2(np.divide(error[:-1], error[1:]))
    assert np.all(orders > 1.9) and np.all(orders < 2.1)


@pytest.mark.parametrize("problem", CURVED[:2], ids=lambda problem: problem.__name__)
def test_cylindrical_shells_converge(problem):
    """Monotonically, and faster than with the first order.

    Finer meshes find what the thin shell leaves out: the boundary layer of the free edge and the
    indentation under the point force.
    """
    values = [problem(count).value for count in (8, 16, 32)]
    assert np.all(np.diff(values) > 0.0)
    assert np.all(observed_orders(values) > 1.5)


def test_dropping_the_shear_row_removes_the_in_plane_bending_locking():
    locked = linear.straight_cantilever("in-plane")
    free = linear.straight_cantilever("in-plane", element=NO_SHEAR_ROW)
    assert locked.normalised < 0.1 and free.normalised > 0.85


def test_cantilever_frequency_is_that_of_beam_theory():
    assert linear.cantilever_frequency(16).normalised == pytest.approx(1.0, abs=2e-3)
    errors = [1.0 - linear.cantilever_frequency(n).normalised for n in (4, 8, 16)]
    assert np.all(np.log2(np.divide(errors[:-1], errors[1:])) > 1.8)


# --- tables ---------------------------------------------------------------------------------------


def test_every_benchmark_runs_with_the_options_of_a_scene_and_as_published(results):
    """The default options are those of a scene that says nothing about its element."""
    assert OPTION_SETS["default"] == scene_from_text(SCENE_WITHOUT_ELEMENT).element
    meshes = {
        name: {(r.name, r.mesh) for r in results if r.options == name} for name in OPTION_SETS
    }
    assert meshes["default"] == meshes["as published"] > meshes["published without shear row"]
    assert all(meshes.values())


def test_tables_show_every_result_with_its_options(results):
    report = Report(full=False, results=list(results))
    rows = report.linear_rows()
    assert sum(cell != "" for row in rows for cell in row[3:]) == len(results)
    shown = {row[:3]: dict(zip(OPTION_SETS, row[3:], strict=True)) for row in rows}
    assert len(shown) == len(rows)
    for r in results:
        cell = shown[r.name, f"{r.reference:.5g} ({r.origin})", r.mesh][r.options]
        assert cell.split()[0] == f"{r.normalised:.3f}"
        assert ("(" in cell) == (r.expected is not None)
    page = report.markdown()
    assert all(f"| {row[0]} | {row[1]} | " in page for row in rows)


def test_a_curve_that_ends_before_the_last_load_is_told():
    values = np.array([[1.0], [2.2], [np.nan]])
    references = np.array([[1.0], [2.0], [4.0]])
    curve = CurveResult("shell", "8x8", "default", np.array([0.1, 0.2, 1.0]), ("w",), values,
                        references, "book", "no equilibrium")  # fmt: skip
    other = curve._replace(options="as published", values=references, end="")
    report = Report(full=False, curves=[curve, other])
    ((*head, default, published),) = report.large_rows()
    assert head == ["shell", "book", "8x8"]
    assert default == "w +5.00% (5.00%); no equilibrium beyond 0.2 of the load"
    assert published == "w +0.00% (0.00%)"
    assert "| problem | reference | mesh | default | as published |" in report.markdown()


def test_the_table_of_the_manual_is_that_of_these_results(results, manual_table):
    """Problems, references, meshes, and values to 0.002; it holds finer meshes as well."""
    kept = dict(linear_part(manual_table("benchmark-table")))
    for *head, default, published, no_row in Report(full=False, results=results).linear_rows():
        cells = zip((default, published, no_row), kept[tuple(head)], strict=True)
        for now, before in ((now.split(), before.split()) for now, before in cells):
            assert now[1:] == before[1:], head
            if now:
                assert float(now[0]) == pytest.approx(float(before[0]), abs=2e-3), head
    assert sum(cell != "" for cells in kept.values() for cell in cells) == len(
        linear_benchmarks(64)
    )


def linear_part(rows):
    """Yield (problem, reference, mesh) and the cells of the first table of the page."""
    assert rows[0] == ["problem", "reference", "mesh", *OPTION_SETS], (
        "run `lcmchain verify benchmarks --full --out FILE.md`"
    )
    problem = reference = ""
    for row in rows[1:]:
        if row[0] == "problem":
            return
        problem, reference = row[0] or problem, row[1] or reference
        yield (problem, reference, row[2]), row[3:]
