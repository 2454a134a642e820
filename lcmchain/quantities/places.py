"""Places as people read them."""

from __future__ import annotations

from collections.abc import Iterable


def millimetres(place: Iterable[float], decimals: int = 2) -> str:
    """Return a place [m] in words: ``"(12.00, 0.00, -3.50) mm"``, without a minus before zero."""
    told = ", ".join(f"{round(1e3 * float(c), decimals) + 0.0:.{decimals}f}" for c in place)
    return f"({told}) mm"
