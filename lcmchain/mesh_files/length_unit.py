"""Whether a mesh is as much larger or smaller than a sheet as with a wrong unit of length."""

from __future__ import annotations

import math
from typing import NamedTuple

from lcmchain.quantities.units import length_factor

# Metres to one of the units that meshes come in.
UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254, "m": 1.0}
SAME_SIZE = 0.3  # largest logarithm of the ratio of two sizes that are about the same
INCH = 25.4  # inches read as millimetres, or the reverse


class Compared(NamedTuple):
    """What a mesh is to the sheet, and which sizes of it, in those of the sheet, are usual.

    Parameters
    ----------
    mesh, sheet : what the two are called.
    smallest, largest : sizes beyond which the unit is doubted. unlike : sizes about which it is.
    likely : sizes with which another unit is worth proposing.
    """

    mesh: str
    sheet: str
    smallest: float
    largest: float
    unlike: tuple[float, ...]
    likely: tuple[float, float]


#: A part larger than its sheet is none of it, and one that is far smaller was not formed alone.
TARGET = Compared("mesh", "sheet", 0.03, 3.0, (0.1, 1.0 / INCH), (0.3, 1.2))
#: A tool may be a small pin or a large table: a tenth of the blank is nothing unusual.
TOOL = Compared("surface", "blank", 1.0 / 30.0, 30.0, (1.0 / INCH, INCH), (0.3, 3.0))


def length_unit_hint(
    size: float, sheet_size: float, length_unit: str, kind: Compared = TARGET
) -> str | None:
    """Return a sentence that doubts the unit of a mesh and proposes another, if there is cause.

    Parameters
    ----------
    size, sheet_size : of the mesh and of the sheet, measured in the same way [m].
    length_unit : that the mesh was read with.
    """
    ratio = size / sheet_size
    near = any(abs(math.log(ratio / factor)) < SAME_SIZE for factor in kind.unlike)
    if kind.smallest <= ratio <= kind.largest and not near:
        return None
    doubt = f"the {kind.mesh} is {ratio:.3g} times as large as the {kind.sheet}: check length_unit "
    likely = [
        f'"{unit}" ({other:.2g} times)'
        for unit, other in _sizes(ratio, length_unit).items()
        if kind.likely[0] <= other <= kind.likely[1]
    ]
    proposal = f", more likely {' or '.join(likely)}" if likely else ""
    return f'{doubt}(now "{length_unit}"{proposal})'


def stated_unit_hint(stated: float | None, length_unit: str) -> str | None:
    """Return a sentence about a file that states another unit than it is read with.

    ``length_unit`` counts: programs write metres into files that they leave in millimetres.

    Parameters
    ----------
    stated : metres to the unit that the file states, None where it states none.
    length_unit : that the mesh is read with.
    """
    if stated is None:
        return None
    now = UNITS[length_unit] if length_unit in UNITS else length_factor(length_unit)
    if math.isclose(stated, now, rel_tol=1e-3):
        return None
    named = [unit for unit, size in UNITS.items() if math.isclose(stated, size, rel_tol=1e-3)]
    unit = f'"{named[0]}"' if named else f"{stated:g} m"
    return (
        f'the file states its unit of length as {unit}, but length_unit is "{length_unit}", which '
        "counts; check which of the two is right"
    )


def _sizes(ratio: float, length_unit: str) -> dict[str, float]:
    """Size of the mesh, in that of its sheet, with each other unit."""
    # Imported where a unit is doubted: the table of units takes long to set up.
    now = UNITS[length_unit] if length_unit in UNITS else length_factor(length_unit)
    return {
        unit: ratio * new / now
        for unit, new in UNITS.items()
        if not math.isclose(new, now, rel_tol=1e-6)
    }
