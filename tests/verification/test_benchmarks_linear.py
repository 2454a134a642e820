"""Shell benchmarks in linear theory: value per mesh, finest mesh, thin limit, observed order."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from lcmchain.scene import Element
from lcmchain.verification.benchmarks import beams, plates, shells
from lcmchain.verification.benchmarks.meshes import AS_PUBLISHED, NO_SHEAR_ROW
from lcmchain.verification.benchmarks.patch import patch_test
from lcmchain.verification.benchmarks.table import Report, linear_benchmarks

CURVED = (shells.scordelis_lo, shells.pinched_cylinder, shells.hemisphere)
OPTIONS = {
    "as published": AS_PUBLISHED,
    "no shear row": NO_SHEAR_ROW,
    "normal thickness": Element(),
    "normal thickness, no shear row": Element(in_plane_shear_hourglass=False),
}


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
        *(partial(beams.twisted_beam, thickness, load, 48) for thickness, load in beams.TWISTED),
        partial(beams.straight_cantilever, "extension", "rectangle", 48, 4),
        partial(beams.straight_cantilever, "out-of-plane", "rectangle", 48, 4),
        partial(beams.straight_cantilever, "in-plane", "rectangle", 96, 8, NO_SHEAR_ROW),
        *(partial(plates.clamped_plate, load, 1000, 32) for load in plates.COEFFICIENTS),
    ],
    ids=lambda case: " ".join(map(str, (case.func.__name__, *case.args[:4]))),
)
def test_finest_mesh_reaches_the_reference(case):
    assert 0.98 < case().normalised < 1.02


@pytest.mark.parametrize("problem", CURVED, ids=lambda problem: problem.__name__)
def test_normal_thickness_reaches_the_reference_on_the_finest_mesh(problem):
    assert 0.98 < problem(32, Element()).normalised < 1.02


@pytest.mark.parametrize("load", plates.COEFFICIENTS)
def test_a_plate_of_any_slenderness_neither_locks_nor_scatters(load):
    """From L/t = 10³ to 10⁵ the deflection is that of the Kirchhoff plate to four digits.

    With nodal unknowns a direct solution scatters by percents at 10⁴.
    """
    values = [plates.clamped_plate(load, slenderness, 16) for slenderness in (1e3, 1e4, 1e5)]
    thin = [value.normalised for value in values]
    np.testing.assert_allclose(thin, thin[1], rtol=1e-4)
    assert thin[1] == pytest.approx(1.0, abs=3e-3)


def test_clamped_plate_converges_with_second_order_to_the_series():
    """At L/t = 10⁴, where the transverse shear that the series leaves out is negligible."""
    counts = (4, 8, 16, 32)
    error = [1.0 - plates.clamped_plate("uniform", 1e4, count).normalised for count in counts]
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
    locked = beams.straight_cantilever("in-plane")
    free = beams.straight_cantilever("in-plane", element=NO_SHEAR_ROW)
    assert locked.normalised < 0.1 and free.normalised > 0.85


def test_cantilever_frequency_is_that_of_beam_theory():
    assert beams.cantilever_frequency(16).normalised == pytest.approx(1.0, abs=2e-3)
    errors = [1.0 - beams.cantilever_frequency(n).normalised for n in (4, 8, 16)]
    assert np.all(np.log2(np.divide(errors[:-1], errors[1:])) > 1.8)


def test_tables_show_every_result(results):
    report = Report(full=False, results=list(results))
    shown = "\n".join(row[-1] for row in report.linear_rows())
    assert shown.count(": ") == len(results)
    assert all(f"{r.mesh}: {r.normalised:.3f}" in shown for r in results)
    assert all(row[0] in report.markdown() for row in report.linear_rows())


def test_the_table_of_the_manual_is_that_of_these_results(results, manual_table):
    """Problems, references, meshes, and values to 0.002; it holds finer meshes as well."""
    kept = {(row[0], row[1]): row[2].split(", ") for row in manual_table("benchmark-table")}
    for name, reference, by_mesh in Report(full=False, results=results).linear_rows():
        cells = dict(cell.split(": ") for cell in kept[name, reference])
        for entry in by_mesh.split(", "):
            mesh, value = entry.split(": ")
            now, before = value.split(), cells[mesh].split()
            assert now[1:] == before[1:], f"{name}, {mesh}"
            assert float(now[0]) == pytest.approx(float(before[0]), abs=2e-3), f"{name}, {mesh}"
    full = linear_benchmarks(64)
    assert sum(len(kept[row[0], row[1]]) for row in _linear_rows(manual_table)) == len(full)


def _linear_rows(manual_table):
    rows = manual_table("benchmark-table")
    return [row for row in rows if len(row) == 3 and row[0] != "problem"]
