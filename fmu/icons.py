"""Icons of a unit and of its terminals, as PNG and as SVG from one drawing.

The unit shows a fabric over a cap with its name below: shaded by its shear for a unit that forms,
wet behind the front of a resin for one that fills. An importer draws it in a square from -100 to
100 (:data:`EXTENT`), the default of the standard; coordinates of a drawing have the same length,
start at the upper left corner, and y goes down, as in both formats of a picture.

Source: FMI 2.0.5, 2.3 (``model.png``); FMI 3.0.2, 2.4.9.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lcmchain.coupling.cosimulation.description import ICONS_FOLDER
from lcmchain.fmu.description import EXTENT, ICON_OF_KIND, UnitTerminal
from lcmchain.report.style import FAINT, FIBRE_COLOURS, INK

#: Where a unit of FMI 2.0 has its icon.
ICON_OF_FMI2 = "model.png"
#: Pixels of a picture along each side, and how many times finer it is drawn.
PIXELS, TERMINAL_PIXELS, FINER = 128, 48, 4
#: Sides of the drawings.
SIDE, TERMINAL_SIDE = 2.0 * EXTENT, 20.0
#: Squares of the fabric along each side, and the longest name that is written whole.
SQUARES, LONGEST_NAME = 10, 18
WET, DRY = "#56b4e9", "#f4f1ea"

Point = tuple[float, float]


class Stroke(NamedTuple):
    """A line through points, or a polygon where it is filled."""

    points: tuple[Point, ...]
    colour: str
    width: float
    fill: str | None = None


class Drawing(NamedTuple):
    """Strokes of a square drawing, from back to front, and a text centred at its lower edge."""

    side: float
    strokes: tuple[Stroke, ...]
    text: str = ""


def icon_files(
    name: str, part: str, fmi: int, terminals: Sequence[UnitTerminal] = ()
) -> dict[str, bytes]:
    """Return the pictures of a unit by their places in it.

    Parameters
    ----------
    name : of the unit. part : what it computes, ``forming`` or ``infiltration``.
    fmi : version of the standard; 2.0 has one picture. terminals : those of the unit (FMI 3.0).
    """
    drawing = unit_drawing(name, part)
    if fmi == 2:
        return {ICON_OF_FMI2: as_png(drawing, PIXELS)}
    pictures = _both(drawing, "icon", PIXELS)
    for kind in dict.fromkeys(terminal.kind for terminal in terminals):
        pictures |= _both(terminal_drawing(kind), ICON_OF_KIND[kind], TERMINAL_PIXELS)
    return pictures


def _both(drawing: Drawing, name: str, pixels: int) -> dict[str, bytes]:
    """Return both pictures of a drawing; an SVG needs a PNG beside it."""
    return {
        f"{ICONS_FOLDER}/{name}.png": as_png(drawing, pixels),
        f"{ICONS_FOLDER}/{name}.svg": as_svg(drawing),
    }


# --- what is drawn --------------------------------------------------------------------------------


def unit_drawing(name: str, part: str) -> Drawing:
    """Return the drawing of a unit: a square fabric that was formed to a cap, seen from above."""
    lines = np.linspace(-1.0, 1.0, SQUARES + 1)
    x, y = np.meshgrid(lines, lines, indexing="ij")
    height = 0.95 * np.sqrt(np.clip(1.0 - (x**2 + y**2) / 0.64, 0.0, None)) ** 1.2
    # a brim that is drawn in along the fibres, not along the diagonals
    drawn_in = 1.0 - 0.14 * np.abs(x) ** 2 * (1.0 - 0.8 * y**2)
    drawn_in_y = 1.0 - 0.14 * np.abs(y) ** 2 * (1.0 - 0.8 * x**2)
    x, y = x * drawn_in, y * drawn_in_y
    right = SIDE / 2.0 + 56.0 * (x - y) * math.cos(math.radians(30.0))
    down = 108.0 + 62.0 * ((x + y) * 0.5 - 0.9 * height)
    return Drawing(SIDE, tuple(_faces(right, down, part)), shortened_name(name))


def _faces(right: np.ndarray, down: np.ndarray, part: str) -> Iterator[Stroke]:
    """Yield the squares of the fabric, what is behind first."""
    order = sorted(((i, j) for i in range(SQUARES) for j in range(SQUARES)), key=sum)
    for i, j in order:
        corners = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
        points = tuple((float(right[corner]), float(down[corner])) for corner in corners)
        u, v = (2.0 * (k + 0.5) / SQUARES - 1.0 for k in (i, j))
        if part == "infiltration":
            fill = WET if math.hypot(u + 1.0, v - 1.0) < 1.75 else DRY
        else:  # the shear of a net on a cap: between the fibres, most at its foot
            shear = 2.0 * abs(u * v) * math.exp(-4.0 * (math.hypot(u, v) - 0.85) ** 2)
            fill = blended(DRY, FIBRE_COLOURS[0], min(1.0, shear))
        yield Stroke(points, INK, 1.0, fill)


def terminal_drawing(kind: str) -> Drawing:
    """Return the drawing of a kind of terminal: what moves, what turns, or a field."""
    low, high, middle = 2.0, TERMINAL_SIDE - 2.0, TERMINAL_SIDE / 2.0
    box = ((low, low), (high, low), (high, high), (low, high))
    icon = ICON_OF_KIND[kind]
    strokes = [Stroke(box, INK, 1.2, "#ffffff")]
    if icon == "translation":
        strokes.append(Stroke(((middle, 5.0), (middle, 15.0)), INK, 1.6))
        for tip, back in ((4.0, 7.5), (16.0, 12.5)):
            head = ((middle, tip), (middle + 3.0, back), (middle - 3.0, back))
            strokes.append(Stroke(head, INK, 0.4, INK))
    elif icon == "rotation":
        turn = np.radians(np.linspace(-150.0, 90.0, 25))
        arc = tuple((middle + 5.0 * math.sin(a), middle - 5.0 * math.cos(a)) for a in turn)
        strokes.append(Stroke(arc, INK, 1.6))
        strokes.append(Stroke(((15.0, 14.5), (17.3, 10.0), (12.7, 10.0)), INK, 0.4, INK))
    else:
        strokes[0] = Stroke(box, INK, 1.2, WET)
        for place in (low + (high - low) / 3.0, high - (high - low) / 3.0):
            strokes.append(Stroke(((place, low), (place, high)), INK, 0.8))
            strokes.append(Stroke(((low, place), (high, place)), INK, 0.8))
    return Drawing(TERMINAL_SIDE, tuple(strokes))


def shortened_name(name: str) -> str:
    """Return a name that fits below the icon."""
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 3]}..."


def blended(first: str, second: str, share: float) -> str:
    """Return a colour between two, as ``#rrggbb``."""
    parts = zip(rgb(first), rgb(second), strict=True)
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in parts)


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue of a colour, 0 to 255 each.

    >>> rgb("#1f5fa8")
    (31, 95, 168)
    """
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue


def _size_of_text(drawing: Drawing) -> float:
    """Height of the letters with which a text of usual ones stays within the drawing."""
    return min(22.0, 0.94 * drawing.side / (0.6 * max(1, len(drawing.text))))


# --- the two formats ------------------------------------------------------------------------------


def as_svg(drawing: Drawing) -> bytes:
    """Return a drawing as SVG, without a background."""
    side = f"{drawing.side:g}"
    root = Element(
        "svg",
        {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {side} {side}",
         "width": side, "height": side, "stroke-linejoin": "round", "stroke-linecap": "round"},
    )  # fmt: skip
    for stroke in drawing.strokes:
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in stroke.points)
        about = {"points": points, "stroke": stroke.colour, "stroke-width": f"{stroke.width:g}"}
        tag = "polyline" if stroke.fill is None else "polygon"
        SubElement(root, tag, {**about, "fill": stroke.fill or "none"})
    if drawing.text:
        place = {"x": f"{drawing.side / 2.0:g}", "y": f"{drawing.side - 8.0:g}"}
        look = {"text-anchor": "middle", "font-family": "sans-serif", "fill": INK}
        text = SubElement(
            root, "text", {**place, **look, "font-size": f"{_size_of_text(drawing):.2f}"}
        )
        text.text = drawing.text
    return tostring(root, "UTF-8", xml_declaration=True)


def as_png(drawing: Drawing, pixels: int) -> bytes:
    """Return a drawing as PNG of ``pixels`` along each side, without a background."""
    fine = FINER * pixels
    scale = fine / drawing.side
    # transparent in the colour of the lines, which it blends with where pixels are put together
    image = Image.new("RGBA", (fine, fine), (*rgb(FAINT), 0))
    canvas = ImageDraw.Draw(image)
    for stroke in drawing.strokes:
        points = [(scale * x, scale * y) for x, y in stroke.points]
        width = max(1, round(scale * stroke.width))
        if stroke.fill is not None:
            canvas.polygon(points, fill=stroke.fill)
            points += points[:2]  # the last corner is round too
        canvas.line(points, fill=stroke.colour, width=width, joint="curve")
    if drawing.text:
        size = int(scale * _size_of_text(drawing))
        font = ImageFont.load_default(size)
        while size > 1 and font.getlength(drawing.text) > 0.94 * fine:  # widths are rounded
            size -= 1
            font = ImageFont.load_default(size)
        place = (fine / 2.0, fine - 8.0 * scale)
        canvas.text(place, drawing.text, fill=INK, font=font, anchor="ms")
    file = io.BytesIO()
    image.resize((pixels, pixels), Image.Resampling.BOX).save(file, "PNG", optimize=True)
    return file.getvalue()
