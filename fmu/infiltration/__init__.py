"""The unit of an infiltration.

    part and case ─▶ build.py: the unit with both inside, variables.py: its interface
    inputs ─▶ part.py (InfiltrationPart) ─▶ outputs, and the record that becomes NAME_filling.nc

Opened in a master as any unit (:mod:`lcmchain.fmu.instances`).
"""
