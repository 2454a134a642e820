"""What was found about a unit, for the terminal and as JSON."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any


class Level(StrEnum):
    """Weight of a finding; only what is missing keeps a unit from running."""

    OK = "ok"
    NOTE = "note"
    WARNING = "warning"
    MISSING = "missing"


@dataclass(frozen=True)
class Finding:
    """One sentence about a unit: ``subject`` is what it is about, ``remedy`` what to do."""

    level: Level
    subject: str
    text: str
    remedy: str = ""


@dataclass
class Diagnosis:
    """The findings about one unit; ``facts`` are those that programs ask for, by name."""

    unit: str
    facts: dict[str, Any] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    @property
    def runs(self) -> bool:
        """Whether nothing is missing."""
        return all(finding.level is not Level.MISSING for finding in self.findings)

    def add(self, level: Level, subject: str, text: str, remedy: str = "") -> None:
        """Append a finding."""
        self.findings.append(Finding(level, subject, text, remedy))

    def extend(self, findings: Iterable[Finding]) -> None:
        """Append findings."""
        self.findings.extend(findings)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as JSON can hold it."""
        findings = [asdict(finding) | {"level": str(finding.level)} for finding in self.findings]
        return {"unit": self.unit, "runs": self.runs, **self.facts, "findings": findings}
