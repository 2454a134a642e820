"""Quantities, the entry types of scene tables, and the fields of results; all may build on them.

::

    "5 mm" of a scene ─▶ units ─▶ 0.005 ─▶ readable: as people read it
    tables of a scene ◀── entry_types: their base, their entries and the limits of these
    fields: every field of a result, with unit and meaning
    "force [N]" of a CSV file ─▶ csv_columns
"""
