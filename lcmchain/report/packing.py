"""Arrays as text that a script in a page turns back into typed arrays."""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import ArrayLike


def packed(values: ArrayLike, kind: str) -> str:
    """Return the numbers as base64; ``kind`` is ``"<f4"`` or ``"<i4"``."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()
