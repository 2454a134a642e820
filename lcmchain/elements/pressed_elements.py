"""What pressures in and on a sheet have in common: the elements they act on, and their nodal loads.

Both pressures write their forces on the corners of the elements to one array with the layout of the
corner forces. The loop sums them up per node, adds them to the force on the node, and books their
work from step to step with the mean of the loads before and after: what central differences turn
into kinetic and strain energy, to round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lcmchain.elements.blocks import LANES
from lcmchain.elements.family import Body
from lcmchain.errors import InputError
from lcmchain.jit import equation

CORNERS = 8
LOAD_ROWS = 3 * CORNERS


class PressedElements(NamedTuple):
    """The elements of all bodies, in blocks of 16 (``elements/blocks.py``).

    corner_node : (block_count * 8 * 16,) int32, nodes of the model.
    mass : (block_count * 16,) [kg], 0 in lanes that only repeat an element.
    place : (element_count,) where an element of the model stands among the lanes.
    bottom, top : (block_count * 16,) 1 where the face is an outer one, 0 where it looks at a ply.
    """

    corner_node: np.ndarray
    mass: np.ndarray
    place: np.ndarray
    bottom: np.ndarray
    top: np.ndarray

    @property
    def padded_count(self) -> int:
        """Number of lanes."""
        return self.mass.size

    def in_lanes(self, values: np.ndarray) -> np.ndarray:
        """Return values (element_count,) by lane (padded_count,), 0 in the others."""
        lanes = np.zeros(self.padded_count)
        lanes[self.place] = values
        return lanes

    def with_outer_faces_of(self, bodies: Sequence[Body]) -> PressedElements:
        """Return the elements where these bodies alone lie on each other, the first one lowest."""
        bottom, top = np.zeros(self.padded_count), np.zeros(self.padded_count)
        for side, body in ((bottom, bodies[0]), (top, bodies[-1])):
            first = self.place[body.first_element]
            side[first : first + -(-body.mesh.element_count // LANES) * LANES] = 1.0
        return self._replace(bottom=bottom, top=top)


def pressed_elements(bodies: Sequence[Body], order: Sequence[int], *, key: str) -> PressedElements:
    """Return the elements of bodies with a thickness.

    Parameters
    ----------
    bodies : see :class:`lcmchain.elements.family.Body`; of several the first lies lowest, and its
        bottom and the top of the last are the outer faces.
    order : numbers of the bodies as their corner forces follow each other: the nodes find the loads
        in the same places.
    key : scene entry that asks for a pressure.

    Raises
    ------
    InputError : a body without thickness.
    """
    masses, bottoms, tops, first = [], [], [], 0
    places = [np.empty(0, dtype=np.int64)] * len(bodies)
    for number in order:
        body = bodies[number]
        if not body.mesh.has_thickness:
            raise InputError(
                f'needs both faces of the sheet; element = "{body.type}" has one layer of nodes; '
                'use element = "solid-shell"',
                key=key,
            )
        count = body.mesh.element_count
        mass = np.zeros(-(-count // LANES) * LANES)
        mass[:count] = body.material.density * body.geometry.volume
        places[number] = first + np.arange(count)
        masses.append(mass)
        bottoms.append(np.full(mass.size, float(body is bodies[0])))
        tops.append(np.full(mass.size, float(body is bodies[-1])))
        first += mass.size
    return PressedElements(
        corner_node=np.concatenate([bodies[number].data.corner_node for number in order]),
        mass=np.concatenate(masses),
        place=np.concatenate(places),
        bottom=np.concatenate(bottoms),
        top=np.concatenate(tops),
    )


@equation
def corner_positions(position, nodes, own):
    """Write the positions of the corners of a block (24 * 16,) from those of the nodes."""
    for corner in range(CORNERS):
        for lane in range(LANES):
            node = nodes[corner * LANES + lane]
            own[3 * corner * LANES + lane] = position[0, node]
            own[(3 * corner + 1) * LANES + lane] = position[1, node]
            own[(3 * corner + 2) * LANES + lane] = position[2, node]


@equation
def load_corner(position, nodes, lane, corner):
    """Return the position of a corner of the element in a lane."""
    node = nodes[corner * LANES + lane]
    return (position[0, node], position[1, node], position[2, node])


@equation
def store_corner(load, lane, corner, force):
    """Add a force to that on a corner of the element in a lane."""
    row = 3 * corner * LANES + lane
    load[row] += force[0]
    load[row + LANES] += force[1]
    load[row + 2 * LANES] += force[2]
