"""Hard cases of the element, the time integration, contact and forming, with their criteria.

    sheets ─▶ elements, coupons, compaction, contact_and_tools, forming, stacks, time_integration
                                                        └─▶ case: CASES ─▶ report

Every case is a function on the list :data:`CASES`; its docstring says why it is hard. The tests run
all of them, ``lcmchain verify hard-cases`` prints their table.
"""

from lcmchain.verification.hard_cases import (  # noqa: F401  they put their cases on the list
    compaction,
    contact_and_tools,
    coupons,
    elements,
    forming,
    stacks,
    time_integration,
)
from lcmchain.verification.hard_cases.case import CASES, CaseResult, HardCase
from lcmchain.verification.hard_cases.report import Report, run_cases

__all__ = ["CASES", "CaseResult", "HardCase", "Report", "run_cases"]
