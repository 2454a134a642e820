"""Forming and resin at once: the sheet is formed while resin flows in it.

::

    scene ─▶ wet_forming ─┬▶ solids: forming of the sheet or stack ◀──▶ filling_part: its filling
                          └▶ sheet: what resin flows through ─▶ infiltration: set-up, filling
"""
