"""The table of schemes: its cells are true, and the manual holds the present one."""

import math

import pytest

from lcmchain.coupling.iteration import fixed_point, gauss_seidel, iqn_ils
from lcmchain.coupling.iteration.consolidation import Column
from lcmchain.coupling.iteration.study import (
    ENTRIES,
    MODULI,
    PERMEABILITIES,
    Entry,
    gain,
    run_case,
    solved_tightly,
    study_schemes,
)
from lcmchain.errors import InputError


def test_gain_is_that_of_the_slowest_mode():
    """Residuals of the plain fixed point grow by it."""
    column = Column(permeability=1e-12, modulus=1e6)
    assert gain(column, 1.0) == pytest.approx(4.0 / math.pi**2 * 10.0)
    outcome = run_case(column, Entry("", "pressure_from_fluid", fixed_point))
    assert (outcome.window, outcome.converged) == (1, False)


@pytest.mark.parametrize(
    ("entry", "permeability", "text"),
    [
        (Entry("", "pressure_from_fluid", gauss_seidel), 1e-14, "diverges"),
        (Entry("", "pressure_from_fluid", fixed_point), 1e-14, "diverges"),
        (Entry("", "fixed_stress", fixed_point), 1e-14, "2.0"),
        (Entry("", "pressure_from_solid", iqn_ils), 1e-18, "1.1"),
    ],
)
def test_cells_of_the_table(entry, permeability, text):
    column = Column(permeability=permeability)
    assert run_case(column, entry, solved_tightly(column)[0]).text == text


def test_an_explicit_scheme_shows_its_error():
    column = Column(modulus=1e7, permeability=1e-12)
    entry = Entry("", "pressure_from_fluid", gauss_seidel)
    outcome = run_case(column, entry, solved_tightly(column)[0])
    assert outcome.text.startswith("off by ") and 0.0 < outcome.error < 0.1


def kept_rows(manual_table):
    """Rows of the kept page by direction (in their order), stiffness and permeability."""
    tables, number = {}, -1
    for row in manual_table("coupling-table"):
        if row[0] == "M [MPa]":
            number += 1
        else:
            tables[number, row[0], row[1]] = row[2:]
    return tables


def same(kept, found):
    """Words agree; numbers within an iteration or a quarter (round-off steers a hardening law)."""
    lost = ("fails", "diverges")
    if kept in lost or found in lost:
        return kept in lost and found in lost
    try:
        return abs(float(kept) - float(found)) <= max(1.0, 0.25 * float(kept))
    except ValueError:
        pass
    if "off by" in kept and "off by" in found and "<" not in kept + found:
        one, other = (float(text.split()[2]) for text in (kept, found))
        return abs(one - other) <= 0.1 * other
    return kept == found


def test_the_manual_keeps_the_table_of_these_schemes(manual_table):
    kept = kept_rows(manual_table)
    assert len(kept) == 3 * 2 * len(MODULI) * len(PERMEABILITIES)
    study = study_schemes([1e6], [1e-12, 1e-14], hardening=[0.0, 8.0])
    directions = list(dict.fromkeys(entry.direction for entry in ENTRIES))
    for column, share, outcomes in study.rows:
        modulus = "1, hardens" if column.hardening else "1"
        for number, direction in enumerate(directions):
            found = [
                outcome.text
                for entry, outcome in zip(ENTRIES, outcomes)
                if entry.direction == direction
            ]
            row = kept[number, modulus, f"{column.permeability:.0e}"]
            assert row[1] == f"{share:.3g}"
            wrong = [pair for pair in zip(row[2:], found) if not same(*pair)]
            assert not wrong, "run `lcmchain verify coupling --out FILE.md`"
            assert len(row[2:]) == len(found)


def test_where_staggered_coupling_diverges_iqn_ils_needs_few_iterations(manual_table):
    """Over all linear cases of the kept table: at most 8 a window, 5 in fact."""
    rows = [row for (n, m, _), row in kept_rows(manual_table).items() if n == 0 and "," not in m]
    labels = [entry.label for entry in ENTRIES if entry.direction == "pressure_from_fluid"]
    diverged = [row for row in rows if row[2 + labels.index("Gauss-Seidel")] == "diverges"]
    assert len(diverged) == 8
    assert all(float(row[2 + labels.index("IQN-ILS")]) <= 5.0 for row in diverged)


def test_the_fixed_stress_split_converges_in_every_case_of_the_table(manual_table):
    rows = [row for (n, _, _), row in kept_rows(manual_table).items() if n == 1]
    assert len(rows) == 24
    assert all(float(cell) <= 8.0 for row in rows for cell in row[3:])


def test_a_wrong_case_is_refused():
    with pytest.raises(InputError, match="modulus"):
        study_schemes([-1.0], [1e-12])
