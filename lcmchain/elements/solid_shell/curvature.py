"""The curvature that an element shares with its neighbours, for its thickness.

The normal thickness a3·n is taken on the chord of the element: where the directors of an element
turn by φ it shrinks as cos(φ/2). With b the in-plane part of a6 (change of the director along ξ)
the squared thickness of the curved element is (a3·n)² + b². But within one element a bend and an
alternating tilt of the directors are the same motion, and with b² in E33 a pressure above the
transverse shear stiffness tilts them (manual: departures). The mid-surfaces of the neighbours tell
them apart. Let c be the value of b that the change of normal over the neighbours gives; then

    b² = c² + 2 c (b - c) + (b - c)²,

and the last part, where the tilt is, is dropped; likewise for a5 along η. So

    E33 = ½((a3·n)²/h² - 1) + β11 a1·a6 + β22 a2·a5 + β12 (a1·a5 + a2·a6) - q

with four numbers per element that follow from c and stay constant between renewals. E33 is
stationary in them, ∂E33/∂c ~ b - c: forces, and the linear behaviour of a sheet that is curved at
the start, hardly depend on when they were renewed. ``lcmchain/mesh/hexahedron.py`` writes the same
in NumPy, for the fields.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.equations import curvature_compaction
from lcmchain.elements.solid_shell.kernel import (
    CURVATURE_ROWS,
    SolidShellData,
    constants_of_block,
    element_stress,
    load_component,
    load_corners,
    load_curvature,
    mode_vectors,
    natural_moments,
    resultants,
    with_centre33,
)
from lcmchain.elements.vectors import cross, dot
from lcmchain.jit import equation, kernel, routine
from lcmchain.materials.law import load_history
from lcmchain.mesh.hexahedron import LARGEST_TILT, LARGEST_TURN, RIDGE

# Changes of E33 below this put no energy in that double precision would show.
SMALLEST_CHANGE = 1e-13


def renew_curvature(
    body: SolidShellData,
    positions: np.ndarray,
    history: np.ndarray,
    counted_at: np.ndarray | None = None,
) -> np.ndarray:
    """Renew the shared curvature in ``history``; return the energy [J] that this gives elements.

    Parameters
    ----------
    body, positions, history : as for :func:`lcmchain.elements.solid_shell.kernel.internal_forces`;
        the first four rows of the history are written.
    counted_at : (3, node_count) positions at which the energy is taken, ``positions`` by default
        (:meth:`lcmchain.model.Model.renew`).
    """
    padded = body.corner_node.size // 8
    centre, normal, work = np.empty((3, padded)), np.empty((3, padded)), np.empty(padded)
    positions = np.ascontiguousarray(positions)
    counted_at = positions if counted_at is None else np.ascontiguousarray(counted_at)
    element_frames(positions, body.corner_node, body.corner_run, centre, normal)
    element_curvatures(
        positions,
        counted_at,
        body.corner_node,
        body.corner_run,
        body.element_data,
        body.neighbour,
        body.reference_curvature,
        centre,
        normal,
        history,
        body.law,
        body.options,
        work,
    )
    return work


@kernel
def element_frames(positions, corner_node, corner_run, centre, normal):
    """Write the centres and unit normals (3, block_count * 16) of the mid-surfaces."""
    for block in prange(corner_node.size // (8 * LANES)):
        corner = np.empty(24 * LANES)
        load_corners(positions, corner_node, corner_run, block, corner)
        for lane in range(LANES):
            element = block * LANES + lane
            a = mode_vectors(
                load_component(corner, lane),
                load_component(corner, lane + LANES),
                load_component(corner, lane + 2 * LANES),
            )
            c = cross(a[0], a[1])
            r = 1.0 / math.sqrt(dot(c, c))
            for d in range(3):
                total = 0.0
                for k in range(8):
                    total += corner[(3 * k + d) * LANES + lane]
                centre[d, element] = 0.125 * total
                normal[d, element] = c[d] * r


@kernel
def element_curvatures(
    positions,
    counted_at,
    corner_node,
    corner_run,
    element_data,
    neighbour,
    reference_curvature,
    centre,
    normal,
    history,
    law,
    options,
    work,
):
    """Write the shared curvature into the history, and the energy that it gives to ``work``."""
    block_count = corner_node.size // (8 * LANES)
    history_size = history.size // block_count
    for block in prange(block_count):
        data = constants_of_block(options, element_data, block)
        own = history[block * history_size : (block + 1) * history_size]
        shared, past = own[: CURVATURE_ROWS * LANES], own[CURVATURE_ROWS * LANES :]
        corner, counted = np.empty(24 * LANES), np.empty(24 * LANES)
        load_corners(positions, corner_node, corner_run, block, corner)
        load_corners(counted_at, corner_node, corner_run, block, counted)
        for lane in range(LANES):
            element = block * LANES + lane
            a = mode_vectors(
                load_component(corner, lane),
                load_component(corner, lane + LANES),
                load_component(corner, lane + 2 * LANES),
            )
            old = load_curvature(None, shared, lane)
            new = shared_curvature(
                a, element, neighbour, centre, normal, inverse_height_of(options, data, lane)
            )
            new = (new[0], new[1], new[2], new[3] + reference_curvature[element])
            a = mode_vectors(
                load_component(counted, lane),
                load_component(counted, lane + LANES),
                load_component(counted, lane + 2 * LANES),
            )
            zeta = (dot(a[0], a[5]), dot(a[1], a[4]), dot(a[0], a[4]) + dot(a[1], a[5]))
            change = curvature_compaction(new, zeta) - curvature_compaction(old, zeta)
            work[element] = 0.0
            if abs(change) > SMALLEST_CHANGE:
                lane_history = load_history(law, past, lane, LANES)
                work[element] = change * mean_stress33(
                    a, data, lane, law, lane_history, old, options, change
                )
            for k in range(CURVATURE_ROWS):
                shared[k * LANES + lane] = new[k]


@equation
def inverse_height_of(options, data, i):
    """Return 1/h of :func:`lcmchain.elements.solid_shell.equations.normal_compaction`."""
    return data[i + 13 * LANES] if options.curved is None else data[i + 36 * LANES]


@routine
def mean_stress33(a, data, i, law, history, curvature, options, change):
    """Return the volume times S33 in the middle of a change of E33 [J]."""
    _, E, _, _, volume, inverse_height = element_stress(
        a, data, i, law, history, curvature, options
    )
    middle = with_centre33(E, E.centre[2] + 0.5 * change)
    S = resultants(
        law,
        history,
        options,
        options.conservative,
        options.enhanced,
        options.coupled,
        natural_moments(options),
        inverse_height,
        middle,
    )
    return volume * S.centre[2]


@routine
def shared_curvature(a, element, neighbour, centre, normal, inverse_height):
    """Return (β11, β22, β12, q) of an element from the normals of its neighbours.

    The change of normal along ξ and η is that of least squares over the neighbours, whose distances
    are measured along a1 and a2: central differences on a regular mesh, where an alternating
    warping of the mid-surface has none.
    """
    a1, a2, a3 = a[0], a[1], a[2]
    g11, g12, g22 = dot(a1, a1), dot(a1, a2), dot(a2, a2)
    r = 1.0 / (g11 * g22 - g12 * g12)
    uu, uv, vv = 0.0, 0.0, 0.0
    u1, u2, v1, v2 = 0.0, 0.0, 0.0, 0.0
    for edge in range(4):
        other = neighbour[edge, element]
        if other < 0:
            continue
        d = (
            centre[0, other] - centre[0, element],
            centre[1, other] - centre[1, element],
            centre[2, other] - centre[2, element],
        )
        n = (
            normal[0, other] - normal[0, element],
            normal[1, other] - normal[1, element],
            normal[2, other] - normal[2, element],
        )
        d1, d2 = dot(d, a1), dot(d, a2)
        u, v = r * (g22 * d1 - g12 * d2), r * (g11 * d2 - g12 * d1)
        n1, n2 = dot(n, a1), dot(n, a2)
        uu, uv, vv = uu + u * u, uv + u * v, vv + v * v
        u1, u2, v1, v2 = u1 + u * n1, u2 + u * n2, v1 + v * n1, v2 + v * n2
    ridge = RIDGE * (uu + vv)
    if ridge == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    uu, vv = uu + ridge, vv + ridge
    s = 1.0 / (uu * vv - uv * uv)
    half = dot(a3, (normal[0, element], normal[1, element], normal[2, element]))
    w = half * inverse_height
    # covariant components of c along ξ and η, over h: w ∂n/∂ξ·a1 ...
    x1, x2 = w * s * (vv * u1 - uv * v1), w * s * (vv * u2 - uv * v2)
    y1, y2 = w * s * (uu * v1 - uv * u1), w * s * (uu * v2 - uv * u2)
    # contravariant ones
    p1, p2 = r * (g22 * x1 - g12 * x2), r * (g11 * x2 - g12 * x1)
    q1, q2 = r * (g22 * y1 - g12 * y2), r * (g11 * y2 - g12 * y1)
    square = x1 * p1 + x2 * p2 + y1 * q1 + y2 * q2
    limit = LARGEST_TURN * abs(w)
    part = limit / math.sqrt(square) if square > limit * limit else 1.0
    # where the directors tilt to and fro, b - c is large and renewals would feed energy to it
    h = inverse_height
    x1, x2 = x1 - h * dot(a[5], a1), x2 - h * dot(a[5], a2)
    y1, y2 = y1 - h * dot(a[4], a1), y2 - h * dot(a[4], a2)
    tilt = r * (g22 * (x1 * x1 + y1 * y1) - 2.0 * g12 * (x1 * x2 + y1 * y2))
    tilt += r * g11 * (x2 * x2 + y2 * y2)
    agreement = max(1.0 - tilt / (LARGEST_TILT * w) ** 2, 0.0)
    part *= agreement * agreement
    h = inverse_height * part
    return h * p1, h * q2, 0.5 * h * (p2 + q1), 0.5 * part * part * square
