"""Secant acceleration of an iteration that closes in on its end along one direction.

The tangent leaves out what elements share with their neighbours (the curvature of
``elements/solid_shell/curvature.py``). Where a sheet folds within a few elements, corrections then
change by a constant factor instead of vanishing faster and faster, along nearly the same direction;
they may even swing to and fro and grow. Two in succession show that factor, and with it the end:
Anderson acceleration of depth one (Walker, Ni: SIAM J. Numer. Anal. 49 (2011) 1715).
"""

from __future__ import annotations

import numpy as np

# Corrections closer to one direction than this (cosine) follow one another on the same line.
SAME_LINE = 0.95
# Corrections shrink more slowly than this: Newton's method no longer converges quadratically.
SLOW = 0.3
# Corrections below this part of the largest one are close to the end. Before, Newton's method finds
# its way along the path, and another move may lead it to another one: there only corrections that
# swing to and fro twice in succession are stopped.
CLOSE = 0.05


class SecantAcceleration:
    """Remembers the last correction and the move that was made instead of it."""

    def __init__(self) -> None:
        self._correction: np.ndarray | None = None
        self._move: np.ndarray | None = None
        self._largest = 0.0
        self._swings = 0
        self._is_slow = False

    def move(self, correction: np.ndarray) -> np.ndarray:
        """Return the move to make for a ``correction`` of the unknowns.

        The correction is zero at the end; between its values before and after the last move it is
        taken to be linear.
        """
        move = correction
        size = float(np.linalg.norm(correction))
        self._largest = max(self._largest, size)
        if self._correction is not None and self._move is not None:
            last_size = float(np.linalg.norm(self._correction))
            along = float(correction @ self._correction) / last_size
            self._swings = self._swings + 1 if along < -SAME_LINE * size else 0
            creeps = along > SAME_LINE * size and size < last_size
            self._is_slow = self._is_slow or size > SLOW * last_size
            is_close = size < CLOSE * self._largest
            if self._is_slow and (is_close and (creeps or self._swings) or self._swings > 1):
                change = correction - self._correction
                part = (correction @ change) / (change @ change)
                move = correction - part * (self._move + change)
        self._correction, self._move = correction, move
        return move
