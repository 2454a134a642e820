"""Numbers of cells in messages."""

from __future__ import annotations

import numpy as np


def first_few(numbers: np.ndarray, count: int = 5) -> str:
    """The first few cell numbers, for messages."""
    shown = ", ".join(str(number) for number in numbers[:count])
    return f"cell {shown}" + (", ..." if len(numbers) > count else "")
