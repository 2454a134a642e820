"""Values in as many digits as say something: of remedies for a scene, and shares in percent."""

from __future__ import annotations

import math


def milliseconds(time: float) -> str:
    """Return a time as an entry of a scene, rounded up to two digits."""
    return f'"{two_digits_up(1e3 * time)} ms"'


def two_digits(value: float) -> str:
    """Return a number rounded down to two digits (up if it is negative)."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 1)
    return f"{math.floor(value / unit + 1e-6) * unit:g}"


def two_digits_up(value: float) -> str:
    """Return a number rounded up to two digits (down if it is negative)."""
    return f"{-float(two_digits(-value)):g}"


def percent(part: float) -> str:
    """Return a share in percent, with as many digits as say something."""
    return "less than 0.01 %" if 0.0 <= part < 1e-4 else f"{100.0 * part:.3g} %"
