"""Physical quantities and the entry types of scene tables; every room may build on them.

::

    "5 mm" of a scene ─▶ units ─▶ 0.005 ─▶ readable: as people read it
    tables of a scene ◀── entry_types: their base, their entries and the limits of these
    "force [N]" of a CSV file ─▶ csv_columns
"""
