"""Grades of checks: what a verdict is, and how a number becomes one."""

from __future__ import annotations

from typing import NamedTuple

from lcmchain.quantities.readable import percent
from lcmchain.thresholds import BAD

#: The grades, worst last; what nobody can tell is not judged.
NOT_JUDGED, GOOD, DOUBTFUL, BAD_GRADE = GRADES = ("not judged", "good", "doubtful", "bad")


class Verdict(NamedTuple):
    """The verdict of a check.

    check : its name. grade : one of ``GRADES``. text : number, limit and meaning, in words.
    remedy_key : scene entries to change, where the grade is not good.
    """

    check: str
    grade: str
    text: str
    remedy_key: str = ""


def worst_grade(verdicts: list[Verdict]) -> str:
    """Return the worst of the grades."""
    return max((verdict.grade for verdict in verdicts), key=GRADES.index, default=NOT_JUDGED)


def share(
    check: str,
    part: float,
    limit: float,
    quantity: str,
    consequence: str,
    remedy: str,
    worst: float | None = None,
) -> Verdict:
    """Judge a share: doubtful above its limit, bad above ``worst``, by default BAD times it.

    quantity : what the share is, with its place as {}; consequence : of one that is too large.
    """
    grade = grade_of(part, limit, BAD * limit if worst is None else worst)
    text = f"{quantity.format(percent(part))} (good up to {percent(limit)})"
    if grade == GOOD:
        return Verdict(check, grade, text)
    return Verdict(check, grade, f"{text}: {consequence}", remedy)


def grade_of(value: float, limit: float, worst: float) -> str:
    """Return good up to a limit, doubtful up to ``worst``, and bad beyond."""
    if not value > limit:
        return GOOD
    return DOUBTFUL if value <= worst else BAD_GRADE
