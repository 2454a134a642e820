"""Every hard case on the list meets its criteria; see their docstrings for why they are hard."""

from __future__ import annotations

import re

import pytest

import lcmchain.coupling.iteration.hard_cases  # noqa: F401  puts its cases on the list
from lcmchain.cli import main
from lcmchain.errors import InputError
from lcmchain.verification.hard_cases import CASES, CaseResult, Report, run_cases
from lcmchain.verification.hard_cases.case import HardCase
from lcmchain.verification.hard_cases.report import limit_text

# a case that loses its decorator, or its import, would otherwise go unnoticed
DEMANDED = {
    "slenderness", "skew", "taper", "limp_hanging", "limp_pinned", "simple_shear_and_turn",
    "sudden_load", "million_steps", "close_to_critical", "beyond_critical", "estimated_step",
    "bias_extension", "fibre_to_shear_stiffness", "compaction_between_plates",
    "step_follows_compaction", "pinched", "pinched_shut", "fillets", "release",
    "chatter_on_an_edge", "wrinkling_strip", "fast_punch", "perturbed_mesh", "coarse_mesh",
    "published_compaction", "fine_mesh", "sharp_folds", "consolidation", "staggered_coupling",
    "undrained_column", "hardening_column", "coupling_that_fails", "stick_and_slip_of_plies",
    "edge_over_a_fold", "light_between_heavy_plies", "thin_between_thick_plies",
    "release_of_a_stack", "closed_tools_on_a_stack",
}  # fmt: skip


def require_criteria(results: list[CaseResult]) -> None:
    assert results
    missed = [
        f"{r.criterion}: {r.value:.4g} {r.unit}, limit {r.limit:g} {r.text}"
        for r in results
        if not r.holds
    ]
    assert not missed, "; ".join(missed)


def test_the_list_is_complete():
    assert set(CASES) == DEMANDED


def require_kept_in_manual(name: str, results: list[CaseResult], table: list[list[str]]) -> None:
    """Every criterion stands with its limit in the manual's table of the full version.

    Numbers before the limit may differ, as they do between the fast and the full version.
    """

    def criterion(text: str) -> str:
        words, sign, limit = re.fullmatch(r"(.*?)(?: ([≤≥]) (.*))?", text).groups()
        numbers = r"[\d,.]+(?:e[+-]?\d+)?"
        return re.sub(numbers, "#", words) + (f" {sign} {limit}" if sign else "")

    kept, case = set(), ""
    for row in table[1:]:
        case = row[0].replace(" ", "_") or case
        if case == name:
            kept.add(criterion(row[1]))
    found = {criterion(f"{result.criterion} {limit_text(result)}".strip()) for result in results}
    assert found <= kept, "run `lcmchain verify hard-cases --full --out FILE.md`"


#: Cases that take kernels of their own, or long, for what default tests show on smaller models:
#: coupons in tests/study and tests/verification, thin strips there and in unit/test_static_solver,
#: sheets that shear and turn in elements/test_energy, fibres that give way in hourglass terms in
#: elements/test_kernel, folded ones in effects/test_fibre_bending; stick and slip, rims and folds
#: of plies, how fast depths between them go to zero, unlike weights and pressed plies in
#: tests/interfaces; what a stack keeps as tools open shows in the release of one sheet.
LEFT_TO_THE_SLOW_RUN = {
    "bias_extension", "fibre_to_shear_stiffness", "slenderness", "simple_shear_and_turn",
    "perturbed_mesh", "sharp_folds", "stick_and_slip_of_plies", "edge_over_a_fold",
    "light_between_heavy_plies", "thin_between_thick_plies", "release_of_a_stack",
    "closed_tools_on_a_stack",
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in CASES if name not in LEFT_TO_THE_SLOW_RUN])
def test_hard_case(name, manual_table):
    results = CASES[name].run(full=False)
    require_criteria(results)
    require_kept_in_manual(name, results, manual_table("hard-case-table"))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_hard_case_in_full(name):
    require_criteria(CASES[name].run(full=True))


def test_a_criterion_that_the_manual_does_not_know_is_seen():
    table = [["case"], ["some case", "error in 20 steps ≤ 2 %"], ["", "guard's words"]]
    known = CaseResult("some_case", "error in 10 steps", 1.0, 2.0, "%")
    guard = CaseResult("some_case", "guard's words", 1.0, 1.0, text="stopped")
    require_kept_in_manual("some_case", [known, guard], table)
    for other in (
        CaseResult("some_case", "error in 10 steps", 1.0, 3.0, "%"),
        CaseResult("some_case", "error in 10 cycles", 1.0, 2.0, "%"),
    ):
        with pytest.raises(AssertionError):
            require_kept_in_manual("some_case", [other], table)


# --- the list and its table -----------------------------------------------------------------------


def test_a_criterion_holds_on_its_side_of_the_limit_only():
    assert CaseResult("a", "", 1.0, 2.0).holds
    assert CaseResult("a", "", 1.0, 2.0).margin == 2.0
    assert not CaseResult("a", "", 2.1, 2.0).holds
    assert CaseResult("a", "", 3.0, 2.0, at_least=True).margin == 1.5
    assert not CaseResult("a", "", 1.9, 2.0, at_least=True).holds
    not_a_number = CaseResult("a", "", float("nan"), 2.0)
    assert not not_a_number.holds and not_a_number.margin == 0.0


def test_the_table_says_what_fails_and_what_was_reduced():
    results = [
        CaseResult("some_case", "error", 1.0, 2.0, "%", without="a|b"),
        CaseResult("some_case", "other", 3.0, 2.0, "%"),
    ]
    case = HardCase("some_case", "Elements", lambda name, full: results, "a part")
    report = Report(full=False, results=[(case, case.run())])
    first, second = report.rows()
    assert first == ("some case (reduced: a part)", "error ≤ 2 %", "1 %", "2 x", "a|b")
    assert second[0] == "" and "FAILS" in second[2]
    assert [result.criterion for result in report.failed] == ["other"]
    text = report.markdown()
    assert "1 of 2 criteria hold" in text and "a\\|b" in text
    assert len(report.table().rows) == 2


def test_the_command_prints_and_writes_the_table(tmp_path, capsys):
    file = tmp_path / "table.md"
    with pytest.raises(SystemExit) as stop:
        main(["verify", "hard-cases", "--only", "skew", "--out", str(file)])
    assert stop.value.code == 0
    assert "1 of 1 criteria hold" in capsys.readouterr().out
    text = file.read_text(encoding="utf-8")
    assert "1 of 1 criteria hold" in text
    assert "| skew | bending energy of a constant curvature, exact ≤ 0.1 % |" in text


def test_an_unknown_case_is_an_error():
    with pytest.raises(InputError, match="no hard case .*slenderness"):
        run_cases(["nonsense"])
