"""Draws part.dxf: a square of 300 mm with a hole of 40 mm in its middle.

    python examples/darts/draw.py

A drawing of a cutting system is used as it is; this one is made so that the example has a source.
"""

from __future__ import annotations

from pathlib import Path

import ezdxf

document = ezdxf.new()
document.units = ezdxf.units.MM
space = document.modelspace()
corners = [(-150, -150), (150, -150), (150, 150), (-150, 150)]
for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
    space.add_line(start, end, dxfattribs={"layer": "CUT"})
space.add_circle((0, 0), 20, dxfattribs={"layer": "CUT"})
space.add_text("0/90", height=8, dxfattribs={"layer": "TEXT"}).set_placement((-140, -140))
document.saveas(Path(__file__).parent / "part.dxf")
