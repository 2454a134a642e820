"""Pressure on and in a sheet: from the forces of tools, and from those of the elements."""

from __future__ import annotations

import numpy as np

from lcmchain.elements.family import Body


def pressure_fields(
    body: Body, positions: np.ndarray, history: np.ndarray
) -> dict[str, np.ndarray]:
    """Return what presses on every element from outside, and what comes from within.

    Parameters
    ----------
    positions : of all nodes of the model (node_count, 3) [m].
    history : what the body's law remembers, in blocks of elements.

    Returns
    -------
    ``compaction_pressure`` and ``bending_pressure`` (element_count,) [Pa]; their sum is the Cauchy
    pressure λ |S33| A0 / A. Nothing for a sheet without thickness.
    """
    found = body.normal_pressure(np.ascontiguousarray(positions.T), history)
    if found is None:
        return {}
    return {
        "compaction_pressure": found.contact,
        "bending_pressure": found.total - found.contact,
    }


def tool_pressure(body: Body, positions: np.ndarray, contact_force: np.ndarray) -> np.ndarray:
    """Return the pressure of the tools on the nodes of a body (mesh.node_count,) [Pa].

    Parameters
    ----------
    positions : of all nodes of the model (node_count, 3) [m].
    contact_force : sum of the normal forces of all tools on each of them (node_count,) [N].
    """
    own = slice(body.first_node, body.first_node + body.mesh.node_count)
    return contact_force[own] / body.present_node_area(np.ascontiguousarray(positions.T))
