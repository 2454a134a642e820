"""Whether a target is as much larger or smaller than the sheet as with a wrong unit of length."""

from __future__ import annotations

import math

# Metres to one of the units that meshes come in.
UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254, "m": 1.0}

# A part larger than its sheet by this factor is none of it.
LARGEST = 3.0
# Parts smaller than their sheet by about these factors, or by far, look like another unit.
SMALLER = (0.1, 1.0 / 25.4)
SAME_SIZE = 0.3  # largest logarithm of the ratio of a part to its sheet, or the reverse
FAR_SMALLER = 0.03

# Sizes of a part, in those of its sheet, with which a unit is worth proposing.
LIKELY = (0.3, 1.2)


def length_unit_hint(target_size: float, sheet_size: float, length_unit: str) -> str | None:
    """Return a sentence that doubts the unit of a target and proposes another, if there is cause.

    Parameters
    ----------
    target_size, sheet_size : diagonals of the boxes around the two [m].
    length_unit : that the target was read with.
    """
    ratio = target_size / sheet_size
    near = any(abs(math.log(ratio / factor)) < SAME_SIZE for factor in SMALLER)
    if FAR_SMALLER <= ratio <= LARGEST and not near:
        return None
    found = f"the mesh is {ratio:.3g} times as large as the sheet: check length_unit "
    likely = [
        f'"{unit}" ({size:.2g} times)'
        for unit, size in _sizes(ratio, length_unit).items()
        if LIKELY[0] <= size <= LIKELY[1]
    ]
    proposal = f", more likely {' or '.join(likely)}" if likely else ""
    return f'{found}(now "{length_unit}"{proposal})'


def _sizes(ratio: float, length_unit: str) -> dict[str, float]:
    """Size of the part, in that of its sheet, with each other unit."""
    if length_unit not in UNITS:
        return {}
    now = UNITS[length_unit]
    return {unit: ratio * new / now for unit, new in UNITS.items() if unit != length_unit}
