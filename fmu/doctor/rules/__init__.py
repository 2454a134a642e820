"""Rules of FMI 2.0 and 3.0 that a schema cannot check: what goes with what in a description.

They are those of VDMCheck (INTO-CPS Association), told from the text of the standard, and a few
more: numbers of start values, lists that are complete, abilities that imply others. Units that
say where their fields lie are held to that standard too.

    interface: what a rule is, and a description as rules read it
        └─▶ head, variables, structure, icons, mesh_fields: rules by what they look at
"""

from lcmchain.fmu.doctor.rules import head, icons, mesh_fields, structure, variables
from lcmchain.fmu.doctor.rules.interface import RULES, Broken, Rule, broken_rules

__all__ = [
    "RULES",
    "Broken",
    "Rule",
    "broken_rules",
    "head",
    "icons",
    "mesh_fields",
    "structure",
    "variables",
]
