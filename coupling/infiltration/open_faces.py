"""Faces of a sheet through which air comes in where resin would be drawn apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Suction that resin bears before air comes in [Pa]: less moves no textile.
NO_SUCTION = 10.0


class OpenFaces(NamedTuple):
    """Control volumes that air reaches through a face (N,), and the pressure of the air [Pa]."""

    nodes: np.ndarray
    pressure: float

    def drawn(self, full: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Return which full control volumes (N,) are under a pressure [Pa] that lets air in."""
        return full & self.nodes & (pressure < self.pressure - NO_SUCTION)
