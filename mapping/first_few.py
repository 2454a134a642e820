"""Numbers of cells in messages."""

from __future__ import annotations

import numpy as np


def first_few(numbers: np.ndarray, count: int = 5, what: str = "cell") -> str:
    """The first few numbers of cells or of something else, for messages."""
    shown = ", ".join(str(number) for number in numbers[:count])
    return f"{what} {shown}" + (", ..." if len(numbers) > count else "")
