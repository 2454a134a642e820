"""The rule of icons: pictures of the unit and of its terminals, and where they are drawn."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.description import ICONS_FOLDER
from lcmchain.errors import shortened
from lcmchain.fmu.doctor.rules.interface import Interface, number, rule
from lcmchain.fmu.icons import ICON_OF_FMI2

_PNG = b"\x89PNG\r\n\x1a\n"
_CORNERS = ("x1", "y1", "x2", "y2")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


@rule(
    "icons",
    "pictures that are PNG files, an SVG only beside one; in FMI 3.0 a coordinate system from "
    "lower left to upper right, corners that are numbers, and for a terminal that is drawn a "
    "picture within terminalsAndIcons and a colour of three numbers from 0 to 255",
    "FMI 2.0.5, 2.3; FMI 3.0.2, 2.4.9",
)
def icons(interface: Interface) -> Iterator[str]:
    folder = interface.folder
    if not interface.is_three:
        if folder is not None:
            yield from _picture(folder, ICON_OF_FMI2.removesuffix(".png"))
        return
    if folder is not None:
        folder = folder / ICONS_FOLDER
        yield from _picture(folder, "icon")
    if interface.terminals is not None:
        yield from _system(interface.terminals)
        for element in interface.terminals.iter("Terminal"):
            shown = element.find("TerminalGraphicalRepresentation")
            if shown is not None:
                name = shortened(element.get("name", ""))
                yield from (f"{name} {what}" for what in _terminal(shown, folder))


def _system(root: Element) -> Iterator[str]:
    """Yield what is wrong with the coordinates of the whole."""
    for tag in ("CoordinateSystem", "Icon"):
        element = root.find(f"GraphicalRepresentation/{tag}")
        if element is None:
            continue
        corners = [number(element.get(name)) for name in _CORNERS]
        if None in corners:
            yield f"{tag} has corners that are no numbers"
        elif tag == "CoordinateSystem":  # what is drawn in it may be flipped, it may not
            x1, y1, x2, y2 = (corner or 0.0 for corner in corners)
            if not (x1 < x2 and y1 < y2):
                yield f"{tag} does not go from lower left to upper right"
            if not (number(element.get("suggestedScalingFactorTo_mm")) or 0.0) > 0.0:
                yield f"{tag} has no suggestedScalingFactorTo_mm above 0"


def _terminal(element: Element, folder: Path | None) -> Iterator[str]:
    """Yield what is wrong with how a terminal is drawn."""
    if None in [number(element.get(name)) for name in _CORNERS]:
        yield "has corners that are no numbers"
    colour = element.get("defaultConnectionColor")
    if colour is not None:
        parts = colour.split()
        if len(parts) != 3 or not all(part.isdecimal() and int(part) < 256 for part in parts):
            yield f'has the colour "{shortened(colour)}"'
    name = element.get("iconBaseName", "")
    place = PurePosixPath(unquote(name))
    if not name or _SCHEME.match(name) or place.is_absolute() or ".." in place.parts:
        yield f'has the icon "{shortened(name)}", which is no place within {ICONS_FOLDER}'
    elif folder is not None:
        yield from _picture(folder, str(place), is_needed=True)


def _picture(folder: Path, name: str, *, is_needed: bool = False) -> Iterator[str]:
    """Yield what is wrong with a picture: PNG, with an SVG beside it or not."""
    shown = shortened(name)
    begin = _begin_of(folder / f"{name}.png")
    if begin is not None:
        if begin != _PNG:
            yield f"has {shown}.png, which is no PNG file"
    elif _begin_of(folder / f"{name}.svg") is not None:
        yield f"has {shown}.svg without {shown}.png"
    elif is_needed:
        yield f"has no picture {shown}.png"


def _begin_of(path: Path) -> bytes | None:
    """Return the first bytes of a file; None where there is none, or can be none of that name."""
    try:
        with path.open("rb") as stream:
            return stream.read(len(_PNG))
    except (OSError, ValueError):
        return None
