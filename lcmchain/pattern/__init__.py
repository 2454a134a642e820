"""Lines on a formed sheet and in its flat pattern: sections, draw-in, trimming line, outline.

    forming.nc ─▶ formed: FormedSheet (flat ◀─▶ part) ─▶ flat: trimming line, flat pattern
               └▶ tables: section, rim ─▶ CSV                  (forms the scene anew each round)
    draped ply ─▶ draped: tables of its courses and joints ─▶ CSV, outlines as DXF

``tables.py`` also reads and writes the lines.
"""

from __future__ import annotations
