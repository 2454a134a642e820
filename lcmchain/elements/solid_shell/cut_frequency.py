"""Upper bound of the highest frequency of the cut elements at the outline, node by node.

A halved element alone vibrates faster than a whole one, but its neighbours have mass to spare. The
elements fall into two groups, those near the cut and the others, each with the mass that its own
elements give to the nodes: ω² of the sheet is at most the larger of the two groups' (the sum of two
fractions is no larger than the larger of them). Within the group near the cut the rows of the
stiffness are shared out to the nodes by Cauchy's inequality, as in
:mod:`lcmchain.mesh.cells`, and what is not a sum of squares keeps its bound by element:

    ω² <= max over nodes n of λ_max(D_n)/m_n + max over elements of the rest
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lcmchain.elements.blocks import LANES, find_runs, from_blocks, in_blocks, own_blocks
from lcmchain.elements.solid_shell.frequency import NodalShares, frequency_bounds
from lcmchain.elements.solid_shell.geometry import ReferenceGeometry
from lcmchain.elements.solid_shell.kernel import SolidShellData
from lcmchain.mesh.cells import cut_nodes


@dataclass(frozen=True, eq=False)
class CutElements:
    """The elements near the cut of a body with a diagonal law.

    elements : their numbers in the body (count,). data : their constants.
    shares : scratch and constants of the bound. history_rows : values of an element's history.
    node : nodes of the body that they have, by corner (count, 8), numbered from 0 on.
    volume : of each (count,) [m³].
    fibre_bound : bound of ω²/c² in the reference, c the speed of the fibre wave [1/m²].
    usual_bound : the same of a whole element.
    mass_factor : inertia of the elements over their mass (count,), 1 without added mass.
    """

    elements: np.ndarray
    data: SolidShellData
    shares: NodalShares
    history_rows: int
    node: np.ndarray
    volume: np.ndarray
    fibre_bound: float
    usual_bound: float
    mass_factor: np.ndarray

    @property
    def least_mass_factor(self) -> float:
        return float(self.mass_factor.min())

    def with_mass_factor(self, factor: np.ndarray) -> CutElements:
        """Return them with the inertia that the body's elements have over their mass."""
        return replace(self, mass_factor=factor[self.elements])

    @classmethod
    def of_body(
        cls,
        corner: np.ndarray,
        geometry: ReferenceGeometry,
        data: SolidShellData,
        element_rows: np.ndarray,
        history_rows: int,
    ) -> CutElements:
        """Select the elements.

        corner : (E, 8) nodes of the elements. element_rows : (E, rows), the constants that ``data``
        has in blocks.
        """
        faces = corner[:, :4]
        in_plane = np.einsum("kn,ekd,ead->ena", SIGNS, geometry.modes[:, [0, 1, 3]], geometry.axes)
        pitch = float(np.sqrt(np.median(geometry.volume / geometry.height) / 2.0))
        near = cut_nodes(in_plane[..., :2], faces, pitch)
        elements = np.flatnonzero(near.cells)
        padded = np.resize(elements, LANES * -(-len(elements) // LANES))
        padded[len(elements) :] = elements[-1]
        weight = near.weight[faces[padded]]
        curved = data.transformation_change.shape[0] > 1
        own_corners = from_blocks(data.corner_node, 8, len(corner))[elements]
        corner_node = in_blocks(own_corners.astype(np.int32))
        own = data._replace(
            corner_node=corner_node,
            corner_run=find_runs(corner_node.reshape(-1, LANES)).ravel(),
            element_data=own_blocks(element_rows[elements]),
            quick_data=None,
            quick_options=None,
            general=True,
            transformation=data.transformation[padded],
            transformation_change=data.transformation_change[padded if curved else slice(None)],
        )
        node = np.unique(corner[elements], return_inverse=True)[1].reshape(-1, 8)
        volume = geometry.volume[elements]
        return cls(
            elements=elements,
            data=own,
            shares=NodalShares(
                weight=np.concatenate([weight, weight], axis=1),
                is_triangle=faces[padded, 2] == faces[padded, 3],
                stiffness=np.empty((len(padded), 8, 6)),
            ),
            history_rows=history_rows,
            node=node,
            volume=volume,
            fibre_bound=float((2.0 / pitch * near.ratio).max() ** 2),
            usual_bound=4.0 / pitch**2,
            mass_factor=np.ones(len(elements)),
        )

    def highest_frequency(
        self, positions: np.ndarray, history: np.ndarray, element_count: int
    ) -> tuple[float, int]:
        """Return the bound of ω² [1/s²], and an element of the body at the node that governs."""
        count = len(self.elements)
        past = history
        if history.size:
            rows = from_blocks(history, self.history_rows, element_count)
            past = in_blocks(rows[self.elements])
        padded = len(self.shares.weight)
        rest, mode = np.empty(padded), np.empty(padded, dtype=np.int64)
        frequency_bounds(self.data, positions, past, rest, mode, self.shares)
        stiffness = self.shares.stiffness[:count] * self.volume[:, None, None]
        at_nodes = [np.bincount(self.node.ravel(), stiffness[..., k].ravel()) for k in range(6)]
        bounds = np.linalg.eigvalsh(np.moveaxis(np.array(at_nodes)[MATRIX], 2, 0))[:, -1]
        bounds /= self._given_mass
        node = int(np.argmax(bounds))
        element = int(self.elements[np.flatnonzero((self.node == node).any(axis=1))[0]])
        return float(bounds[node] + (rest[:count] / self.mass_factor).max()), element

    @cached_property
    def _given_mass(self) -> np.ndarray:
        """Inertia that the elements give to their nodes [kg]."""
        share = self.data.density * self.mass_factor * self.volume / 8.0
        return np.bincount(self.node.ravel(), np.repeat(share, 8))


# Signs of ξ, η and ξη at the corners of the lower face.
SIGNS = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0]])
# Where a symmetric 3x3 matrix has the components 11, 22, 33, 12, 23, 13.
MATRIX = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
