"""What contact between plies asks of the step."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcmchain.elements.blocks import SPAN
from lcmchain.interfaces.rows import INTERFACE, STIFFNESS, WEIGHT, row_start
from lcmchain.jit import entry


def omega2_bound(model: Any, state: Any) -> float:
    """Return what the springs between plies add to the largest ω² [1/s²], at most.

    The largest row sum of M⁻¹K, of all springs that are there and at least of plies of equal meshes
    in full contact: what comes into contact until the next look is then covered.
    """
    data, mass = model.ply_contact.data, model.nodes.mass
    return max(data.omega2, largest_row_sum(data, state.ply_facet, state.ply_rows, mass))


@entry
def largest_row_sum(data, facets, springs, mass):
    """Return the largest Σ |K| / m of all nodes [1/s²] by the springs of points over facets.

    Springs against sliding are at right angles to those of the pressure: the stiffer ones count.
    """
    rows = np.zeros(mass.size)
    for point in range(facets.size):
        facet = facets[point]
        if facet >= 0:
            at = row_start(data, point)
            total = 1.0
            for k in range(4):
                total += abs(springs[at + (WEIGHT + k) * SPAN])
            stiffness = springs[at + STIFFNESS * SPAN]
            stiffness *= data.stiffer[int(springs[at + INTERFACE * SPAN])]
            rows[point] += stiffness * total
            for k in range(4):
                weight = abs(springs[at + (WEIGHT + k) * SPAN])
                rows[data.facet_node[facet, k]] += stiffness * weight * total
    largest = 0.0
    for node in range(mass.size):
        largest = max(largest, rows[node] / mass[node])
    return largest
