"""What a functional mock-up unit needs on this machine, and what of it is missing."""

from lcmchain.fmu.doctor.examine import examine
from lcmchain.fmu.doctor.findings import Diagnosis, Finding, Level

__all__ = ["Diagnosis", "Finding", "Level", "examine"]
