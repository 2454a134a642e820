"""Values as people read them: times, places, shares, and the values that remedies propose."""

from __future__ import annotations

import math
from collections.abc import Iterable


def milliseconds_text(seconds: float) -> str:
    """Return a simulated time [s] in ms, rounded to three digits: ``"1730 ms"``."""
    return f"{float(f'{1e3 * seconds:.3g}'):g} ms"


def duration_text(seconds: float) -> str:
    """Say how long something takes, in the two largest units that matter.

    Below a minute seconds with their tenths (``"12.3 s"``, below a second two digits), then
    ``"3 min 20 s"``, then ``"2 h 05 min"``. What is rounded up to a full unit reads as that unit:
    59.97 s are ``"1 min 00 s"``.

    Parameters
    ----------
    seconds : computing time [s]; a negative one (the clock was set back) counts as none, one that
        is not finite reads ``"unknown"``.
    """
    if not math.isfinite(seconds):
        return "unknown"
    seconds = max(seconds, 0.0)
    if seconds < 0.95:
        return f"{round(seconds, 3):.2g} s"
    if round(seconds, 1) < 60.0:
        return f"{seconds:.1f} s"
    whole_seconds = round(seconds)
    if whole_seconds < 3600:
        return f"{whole_seconds // 60} min {whole_seconds % 60:02d} s"
    whole_minutes = round(seconds / 60.0)
    return f"{whole_minutes // 60} h {whole_minutes % 60:02d} min"


def memory_text(size: float) -> str:
    """Return a size of memory [bytes]: ``"0.5 GB"``, below a tenth of that ``"12 MB"``."""
    in_gb = 1e-9 * size
    return f"{in_gb:.2g} GB" if in_gb >= 0.0995 else f"{1e3 * in_gb:.2g} MB"


def millimetres(point: Iterable[float], decimals: int = 2) -> str:
    """Return coordinates [m] as text: ``"(12.00, 0.00, -3.50) mm"``; zero has no minus."""
    values = ", ".join(f"{round(1e3 * float(c), decimals) + 0.0:.{decimals}f}" for c in point)
    return f"({values}) mm"


def percent(part: float) -> str:
    """Return a share in percent, with as many digits as say something."""
    return "less than 0.01 %" if 0.0 <= part < 1e-4 else f"{100.0 * part:.3g} %"


# --- values that remedies propose for a scene -----------------------------------------------------


def time_entry(time: float) -> str:
    """Return a time [s] as a scene gives it, rounded up to two digits: ``'"150 ms"'``."""
    return f'"{two_digits_up(1e3 * time)} ms"'


def two_digits(value: float) -> str:
    """Return a number rounded down to two digits (up if it is negative)."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 1)
    return f"{math.floor(value / unit + 1e-6) * unit:g}"


def two_digits_up(value: float) -> str:
    """Return a number rounded up to two digits (down if it is negative)."""
    return f"{-float(two_digits(-value)):g}"
