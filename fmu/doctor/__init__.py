"""What a functional mock-up unit needs on this machine, and what of it is missing.

    unit ─▶ examine.py ─┬▶ description.py ─▶ rules/: the model description against the standard
                        ├▶ profiles.py: which importers know all that it needs
                        ├▶ binary.py: the binary for this machine, and what it links to
                        ├▶ python.py: its Python code, and the Python that is to run it
                        └▶ host.py: the program that is to import it
                                 every one of them ─▶ findings.py (Finding, Diagnosis)

Nothing of a unit is run.
"""

from lcmchain.fmu.doctor.examine import examine
from lcmchain.fmu.doctor.findings import Diagnosis, Finding, Level

__all__ = ["Diagnosis", "Finding", "Level", "examine"]
