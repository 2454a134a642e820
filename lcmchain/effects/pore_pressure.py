"""Pore pressure: the part of the pressure in a saturated sheet that its fluid bears.

Adds: Terzaghi's pore pressure, S = S_eff - p J C^-1, with one pressure p per element. Its virtual
work is p times the variation of the element's volume V, so that the force on a node is p ∂V/∂x and
what the fluid does to the sheet is p dV, exactly. V is the volume of the trilinear hexahedron
between the nodes: neighbours share their faces, so that a pressure that is the same everywhere
loads no node within the sheet, and the rate of V is what the fluid must give or take. With the
mode vectors a1 ... a7 of the deformed element and [a, b, c] = (a × b)·c

    V = 8 ([a1, a2, a3] + ([a1, a4, a6] + [a4, a2, a5] + [a6, a5, a3]) / 3).

The element's own measure of compaction, its normal thickness a3·n, agrees with V over the area of
the mid-surface where the directors of an element are parallel; else they differ by products of a4
to a6. The pressure is relative to that of the surroundings, which press on all faces. The mass of
the fluid is not part of the sheet's inertia.

With a resistance Z the pressure is p - Z dV/dt, as a fluid answers that must flow off: a coupling
gives p so that their sum has the mean that the fluid has found (:mod:`lcmchain.coupling.solids`).
Source: Terzaghi's principle for finite strains, e.g. Coussy, "Poromechanics", section 3.
Stability limit: a given pressure has no stiffness of its own but that of the geometry, p ∂²V/∂x∂x;
its ω², bounded by row sums of the mode vectors' blocks and about p (1/l1 + 1/l2) / (ρ h), is added
to that of the elements. A resistance damps with the velocity of half a step before, at the rate
r = Z |∂V/∂a|²/m; stable for ω²dt²/4 + r dt/2 <= 1. How the pressure answers to the volume is the
coupling's concern.
Scene: ``[infiltration.with_forming]``; or coupling sets the pressures
(:mod:`lcmchain.coupling.solids`).
Fields: ``pore_pressure``; ``energy_external`` (history) holds its work.

**In a stack of plies** there is one pressure in each column through all of them. The fluid of a
column presses on what bounds the column from outside: the bottom of the lowest ply, the top of the
uppermost, and the sides. It is in the pores of the plies and in gaps between them alike. On a face
that looks at another ply it therefore acts from both sides: there the fibres alone press, and what
the contact of plies carries is the effective stress (Terzaghi). With the faces f that look at plies
the force on a node is

    p (∂V/∂x - Σ_f ∂V_f/∂x),

where ∂V_f/∂x is the exact load of a unit pressure on the face (:mod:`.face_pressure`). A pressure
that is the same everywhere loads no node of an inner face, to round-off and in any shape. The
springs of the contact, whose normals lag behind the faces, could not hand it on like that.

The pressure of an element is that of the columns that it lies over, p_e = Σ_c W_ec p_c, with the
share W_ec of its area. What it does to the column is then Σ_e W_ec dU_e/dt, the rate of the whole
column, gaps included. The resistance of the fluid acts against that rate: it does not resist plies
that become thinner and thicker in turn, or a stack that moves as a whole. A resistance Z_c damps at
the rate Z_c Σ_e W_ec |∂U_e/∂a|²/m_e at most; else the stability limit is that of a pore pressure
and of pressures on faces together.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from scipy.sparse import csr_array

from lcmchain.effects.effect import Effect, EffectModel, Switch, refused
from lcmchain.effects.face_pressure import add_face_load, face_modes_of_lane
from lcmchain.elements.blocks import LANES
from lcmchain.elements.pressed_elements import (
    CORNERS,
    LOAD_ROWS,
    PressedElements,
    corner_positions,
    load_corner,
)
from lcmchain.elements.solid_shell.equations import EIGHTH, mode_components, scaled7
from lcmchain.elements.solid_shell.kernel import load_component, store_component
from lcmchain.elements.vectors import combination2, cross, dot, plus, scaled
from lcmchain.jit import equation, kernel, routine

THIRD = 1.0 / 3.0


@equation
def modes_of_lane(position, nodes, lane):
    """Return the mode vectors a1 ... a6 of the element in a lane; V does not hold a7."""
    c0 = load_corner(position, nodes, lane, 0)
    c1 = load_corner(position, nodes, lane, 1)
    c2 = load_corner(position, nodes, lane, 2)
    c3 = load_corner(position, nodes, lane, 3)
    c4 = load_corner(position, nodes, lane, 4)
    c5 = load_corner(position, nodes, lane, 5)
    c6 = load_corner(position, nodes, lane, 6)
    c7 = load_corner(position, nodes, lane, 7)
    x = mode_components(c0[0], c1[0], c2[0], c3[0], c4[0], c5[0], c6[0], c7[0])
    y = mode_components(c0[1], c1[1], c2[1], c3[1], c4[1], c5[1], c6[1], c7[1])
    z = mode_components(c0[2], c1[2], c2[2], c3[2], c4[2], c5[2], c6[2], c7[2])
    return (
        (x[0], y[0], z[0]),
        (x[1], y[1], z[1]),
        (x[2], y[2], z[2]),
        (x[3], y[3], z[3]),
        (x[4], y[4], z[4]),
        (x[5], y[5], z[5]),
    )


@equation
def volume_of_modes(a):
    a1, a2, a3, a4, a5, a6 = a
    own = dot(cross(a1, a2), a3)
    bent = dot(cross(a1, a4), a6) + dot(cross(a4, a2), a5) + dot(cross(a6, a5), a3)
    return 8.0 * (own + THIRD * bent)


@equation
def volume_gradient(a):
    """Return ∂V/∂a1 ... ∂V/∂a6."""
    a1, a2, a3, a4, a5, a6 = a
    third = 8.0 * THIRD
    return (
        scaled(8.0, plus(THIRD, cross(a4, a6), cross(a2, a3))),
        scaled(8.0, plus(THIRD, cross(a5, a4), cross(a3, a1))),
        scaled(8.0, plus(THIRD, cross(a6, a5), cross(a1, a2))),
        combination2(third, cross(a6, a1), third, cross(a2, a5)),
        combination2(third, cross(a4, a2), third, cross(a3, a6)),
        combination2(third, cross(a1, a4), third, cross(a5, a3)),
    )


@equation
def push_in_lane(corner, lane, pressure, resistance, velocity, nodes):
    """Replace the corner positions ``corner[row*16 + lane]`` by the forces on them.

    They are (p - Z dV/dt) ∂V/∂x with the pressure p and the resistance Z.
    """
    x = load_component(corner, lane)
    y = load_component(corner, lane + LANES)
    z = load_component(corner, lane + 2 * LANES)
    g = volume_gradient(
        (
            (x[0], y[0], z[0]),
            (x[1], y[1], z[1]),
            (x[2], y[2], z[2]),
            (x[3], y[3], z[3]),
            (x[4], y[4], z[4]),
            (x[5], y[5], z[5]),
        )
    )
    p = pressure - resistance * volume_rate(g, modes_of_lane(velocity, nodes, lane))
    store_component(corner, lane, scaled7(EIGHTH, pushed(p, g, 0)))
    store_component(corner, lane + LANES, scaled7(EIGHTH, pushed(p, g, 1)))
    store_component(corner, lane + 2 * LANES, scaled7(EIGHTH, pushed(p, g, 2)))


@equation
def pushed(p, g, d):
    return (p * g[0][d], p * g[1][d], p * g[2][d], p * g[3][d], p * g[4][d], p * g[5][d], 0.0)


@equation
def volume_rate(g, b):
    """Return dV/dt of the gradient ∂V/∂a1 ... ∂V/∂a6 and the rates of the mode vectors."""
    total = dot(g[0], b[0]) + dot(g[1], b[1]) + dot(g[2], b[2])
    return total + dot(g[3], b[3]) + dot(g[4], b[4]) + dot(g[5], b[5])


@kernel
def pore_forces(elements, position, velocity, pressure, rate, resistance, dt, load):
    """Write (p - Z dV/dt) ∂V/∂x on the corners of all elements, then move the pressures on.

    Parameters
    ----------
    elements : :class:`PressedElements`. position, velocity : (3, node_count) [m, m/s].
    pressure, rate, resistance : p, its rate and Z (padded_count,) [Pa, Pa/s, Pa s/m³].
    dt : the step [s].
    load : (block_count * 24 * 16,) or longer [N], row ``3*corner + component``, written.
    """
    for block in prange(pressure.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        p = pressure[block * LANES : (block + 1) * LANES]
        resisting = resistance[block * LANES : (block + 1) * LANES]
        corner_positions(position, nodes, own)
        for lane in range(LANES):
            push_in_lane(own, lane, p[lane], resisting[lane], velocity, nodes)
        for lane in range(LANES):
            p[lane] += dt * rate[block * LANES + lane]


@kernel
def volumes_and_rates(elements, position, velocity, volume, rate):
    """Write the volumes [m³] of the elements and their rates [m³/s], by lane (padded_count,)."""
    for block in prange(volume.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        for lane in range(LANES):
            a = modes_of_lane(position, nodes, lane)
            g = volume_gradient(a)
            volume[block * LANES + lane] = volume_of_modes(a)
            rate[block * LANES + lane] = volume_rate(g, modes_of_lane(velocity, nodes, lane))


@equation
def length(a):
    return math.sqrt(dot(a, a))


@kernel
def pore_frequencies(elements, position, pressure, omega2):
    """Write bounds of the ω² [1/s²] that given pressures (padded_count,) [Pa] add, by lane.

    Blocks of ∂²V/∂a∂a are cross products with mode vectors, whose norm is their length; every mode
    has the mass of the element. The largest row sum of norms bounds the largest eigenvalue.
    """
    for block in prange(omega2.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        for lane in range(LANES):
            a = modes_of_lane(position, nodes, lane)
            l1, l2, l3 = length(a[0]), length(a[1]), length(a[2])
            l4, l5, l6 = length(a[3]), length(a[4]), length(a[5])
            rows = max(
                l2 + l3 + THIRD * (l4 + l6),
                l1 + l3 + THIRD * (l4 + l5),
                l1 + l2 + THIRD * (l5 + l6),
            )
            rows = max(
                rows,
                THIRD * (l1 + l2 + l5 + l6),
                THIRD * (l2 + l3 + l4 + l6),
                THIRD * (l1 + l3 + l4 + l5),
            )
            i = block * LANES + lane
            mass = elements.mass[i]
            omega2[i] = 8.0 * abs(pressure[i]) * rows / mass if mass > 0.0 else 0.0


@kernel
def resistance_mobilities(elements, position, mobility):
    """Write |∂V/∂a|²/m, by lane [m⁴/kg]: a resistance Z damps the volume at the rate Z times it.

    Every mode vector has the mass m of the element.
    """
    for block in prange(mobility.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        for lane in range(LANES):
            g = volume_gradient(modes_of_lane(position, nodes, lane))
            total = dot(g[0], g[0]) + dot(g[1], g[1]) + dot(g[2], g[2])
            total += dot(g[3], g[3]) + dot(g[4], g[4]) + dot(g[5], g[5])
            i = block * LANES + lane
            mass = elements.mass[i]
            mobility[i] = total / mass if mass > 0.0 else 0.0


# --- in the columns of a stack --------------------------------------------------------------------


class PoreColumns(NamedTuple):
    """Which columns of fluid the elements of a stack lie over, C columns.

    lane : (C,) int64, lanes that hold the resistance of the columns.
    first, last : (padded_count,) int64, range of the columns of each lane in the next two.
    column, share : numbers of the columns, and share of the element over each.
    first_of, last_of : (C,) int64, range of the elements of each column in the next two.
    element, share_of : their lanes, and share of each element in the column.
    rate : (padded_count,) of the volumes [m³/s]; drop : (C,) of the pressures by the resistance
        [Pa]; both are written in every step.
    """

    lane: np.ndarray
    first: np.ndarray
    last: np.ndarray
    column: np.ndarray
    share: np.ndarray
    first_of: np.ndarray
    last_of: np.ndarray
    element: np.ndarray
    share_of: np.ndarray
    rate: np.ndarray
    drop: np.ndarray

    @classmethod
    def of_shares(cls, pore: PressedElements, shares: csr_array, first_element: int) -> PoreColumns:
        """Return the columns of a stack.

        Parameters
        ----------
        shares : of the area of each element of the model over each column (element_count, C).
        first_element : of the ply whose elements are the columns, in their order.
        """
        by_column = shares.tocsc()
        first, last = np.zeros((2, pore.padded_count), dtype=np.int64)
        first[pore.place], last[pore.place] = shares.indptr[:-1], shares.indptr[1:]
        count = shares.shape[1]
        return cls(
            lane=pore.place[first_element : first_element + count].astype(np.int64),
            first=first,
            last=last,
            column=shares.indices.astype(np.int64),
            share=shares.data.astype(float),
            first_of=by_column.indptr[:-1].astype(np.int64),
            last_of=by_column.indptr[1:].astype(np.int64),
            element=pore.place[by_column.indices].astype(np.int64),
            share_of=by_column.data.astype(float),
            rate=np.zeros(pore.padded_count),
            drop=np.zeros(count),
        )


@kernel
def unit_loads(elements, position, velocity, rate, load):
    """Write the forces of a unit pressure on the corners of all elements, and their rates dU/dt.

    Parameters
    ----------
    elements : :class:`PressedElements`. position, velocity : (3, node_count) [m, m/s].
    rate : (padded_count,) [m³/s], written.
    load : (block_count * 24 * 16,) or longer [m²], row ``3*corner + component``, written.
    """
    for block in prange(rate.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        corner_positions(position, nodes, own)
        for lane in range(LANES):
            push_in_lane(own, lane, 1.0, 0.0, velocity, nodes)
        for lane in range(LANES):
            # the fluid between the plies presses on the faces that look at one
            below = 1.0 - elements.bottom[block * LANES + lane]
            above = 1.0 - elements.top[block * LANES + lane]
            add_face_load(own, lane, 0, below, face_modes_of_lane(position, nodes, lane, 0))
            add_face_load(own, lane, 4, -above, face_modes_of_lane(position, nodes, lane, 4))
        for lane in range(LANES):
            total = 0.0
            for corner in range(CORNERS):
                node = nodes[corner * LANES + lane]
                total += own[3 * corner * LANES + lane] * velocity[0, node]
                total += own[(3 * corner + 1) * LANES + lane] * velocity[1, node]
                total += own[(3 * corner + 2) * LANES + lane] * velocity[2, node]
            rate[block * LANES + lane] = total


@kernel
def column_drops(columns, resistance, drop):
    """Write by how much the pressures of the columns fall with the rates of their volumes.

    Parameters
    ----------
    resistance : (padded_count,) [Pa s/m³], of the columns at their lanes.
    drop : (C,) [Pa], written.
    """
    for c in prange(drop.size):
        drop[c] = resistance[columns.lane[c]] * rate_of_column(columns, c)


@routine
def rate_of_column(columns, c):
    # in a routine of its own: summed up within the parallel loop, the sum was silently lost
    total = 0.0
    for k in range(columns.first_of[c], columns.last_of[c]):
        total += columns.share_of[k] * columns.rate[columns.element[k]]
    return total


@kernel
def scale_loads(columns, drop, pressure, rate, dt, load):
    """Multiply the loads of unit pressures by the pressures, and move these on.

    Parameters
    ----------
    drop : of the pressures of the columns (C,) [Pa].
    pressure, rate : of the elements at rest, and its rate (padded_count,) [Pa, Pa/s].
    dt : the step [s]. load : as of :func:`unit_loads`; afterwards [N].
    """
    for block in prange(pressure.size // LANES):
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        for lane in range(LANES):
            i = block * LANES + lane
            p = pressure[i] - drop_of_element(columns, drop, i)
            for row in range(LOAD_ROWS):
                own[row * LANES + lane] *= p
            pressure[i] += dt * rate[i]


@routine
def drop_of_element(columns, drop, i):
    total = 0.0
    for k in range(columns.first[i], columns.last[i]):
        total += columns.share[k] * drop[columns.column[k]]
    return total


def mobilities(elements: PressedElements, position: np.ndarray) -> np.ndarray:
    """Return |∂U/∂a|²/m of the elements by lane (padded_count,) [m⁴/kg].

    Every corner has an eighth of the element's mass m.
    """
    still = np.zeros_like(position)
    rate = np.empty(elements.padded_count)
    load = np.empty(elements.padded_count * LOAD_ROWS)
    unit_loads(elements, np.ascontiguousarray(position), still, rate, load)
    squared = (load.reshape(-1, LOAD_ROWS, LANES) ** 2).sum(axis=1).ravel()
    mass = elements.mass
    return CORNERS * np.divide(squared, mass, out=np.zeros_like(mass), where=mass > 0.0)


def of_columns(columns: PoreColumns, values: np.ndarray) -> np.ndarray:
    """Return the sums over the elements of each column (C,) of values by lane (padded_count,)."""
    number = np.repeat(np.arange(columns.lane.size), columns.last_of - columns.first_of)
    weighed = columns.share_of * values[columns.element]
    return np.bincount(number, weighed, minlength=columns.lane.size)


# --- the effect -----------------------------------------------------------------------------------


SWITCH = Switch(
    entry="infiltration.with_forming",
    without="the part of the pressure that the fluid bears",
    called=lambda scene: scene.wet_forming is not None,
    off=refused(
        "the fluid and the sheet are solved together; leave [infiltration.with_forming] out, and "
        "the formed sheet is infiltrated afterwards"
    ),
    on=refused("no fluid flows while the sheet is formed; give [infiltration.with_forming]"),
)


def active(model: EffectModel) -> list[Effect]:
    elements: PressedElements | None = model.pore
    if elements is None:
        return [Effect("pore pressure", False, "no fluid is coupled")]
    if len(model.bodies) > 1:
        reason = f"one pressure in each column through {len(model.bodies)} plies"
        return [Effect("pore pressure", True, reason)]
    count = elements.place.size
    return [Effect("pore pressure", True, f"one pressure in each of {count} elements")]
