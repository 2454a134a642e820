"""Step control that load steps and arcs share: a converged state, and how large the next step is.

Steps are halved where an iteration fails and grow where it succeeds quickly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# An iteration that needs at most this many corrections lets the next step grow.
QUICK_ITERATIONS = 6
GROWTH = 1.5
SMALLEST_STEP = 1e-4  # relative to the first one


class StaticStep(NamedTuple):
    """A converged state.

    load_factor : displacement : (3, node_count) [m]; iterations : corrections it took.
    residual : out-of-balance force over loads and reactions.
    """

    load_factor: float
    displacement: np.ndarray
    iterations: int
    residual: float
