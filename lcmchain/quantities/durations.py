"""Computing times as people read them."""

from __future__ import annotations

import math


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
