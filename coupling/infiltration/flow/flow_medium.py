"""A flow medium: a thin layer of high permeability on one face of the preform.

Resin runs ahead in the layer and sinks from there into the preform, as in vacuum infusion. The
layer has its own control volumes above the nodes that it covers, each with its fill factor and
pressure. Between a volume of the layer and the column of the preform below, resin flows through the
thickness h of the preform, with its third permeability K₃ and over the covered area A:

- Into a column with the fill factor F, from the pressure p of the full layer to p_v of the air
  below: q = A K₃ (p - p_v) / (µ h F). The front moves down, and F² grows linearly at a constant p.
- Between a column and a layer that are both full: q = 3 A K₃ (p - p̄) / (µ h), with the mean
  pressure p̄ of the column. This is exact where the column gives its resin off evenly over its
  thickness (:func:`lcmchain.coupling.infiltration.flow.film.film_conductance`).
- From a full column into a layer that is not full: in the same way, against the air of the layer.

Left out: resistance of the layer through its own thickness, and the slope of the front within a
column. A column that the flow along the preform has partly filled counts as filled from above to
the same share.

Where no resin flows along the preform itself, the front in the layer leads the one in the preform
by a constant length, as long as the layer goes on (:func:`lead_length`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.errors import InputError

#: Conductance of a full column over that of one with the front at its bottom.
FULL_COLUMN = 3.0
#: Fill factor of a dry column before its pressure is known.
FIRST_FILL = 0.05
#: Solutions in which the pressures above columns and their conductances are made to agree. Each at
#: least halves the difference, and a column that is partly filled begins close to agreement.
SOLUTIONS = 4


class Links(NamedTuple):
    """Pairs of control volumes on each other: rows of the layer and of the preform, (L,)."""

    above: np.ndarray
    below: np.ndarray


@dataclass(frozen=True)
class FlowMedium:
    """A flow medium on cells of a mesh.

    Parameters
    ----------
    cells : rows of the cells that it covers, (M,).
    thickness : [m].
    porosity : share of its volume that resin can fill.
    permeability : tensors in space of its cells, (M, 3, 3) [m²], or one number.
    """

    cells: np.ndarray
    thickness: float
    porosity: float
    permeability: np.ndarray | float

    def nodes(self, mesh: FlowMesh) -> np.ndarray:
        """Return the rows of the nodes that it covers, ascending, (L,)."""
        corners = mesh.cells[self.cells]
        return np.unique(corners[corners >= 0])

    def layered(self, mesh: FlowMesh, preform: Preform) -> tuple[FlowMesh, Preform, Links]:
        """Return mesh and preform with the layer: its nodes and cells follow those of the preform.

        Raises
        ------
        InputError : the preform has no permeability through the thickness.
        """
        count = mesh.cell_count
        preform = preform.of_cells(count)
        if preform.through_permeability is None:
            raise InputError(
                "needs the permeability of the preform through its thickness; give the k3 of its "
                "permeability, or a law that has one",
                key="flow_medium",
            )
        below = self.nodes(mesh)
        row = np.full(mesh.node_count, -1)
        row[below] = mesh.node_count + np.arange(len(below))
        corners = mesh.cells[self.cells]
        both = FlowMesh(
            np.concatenate([mesh.points, mesh.points[below]]),
            np.concatenate([mesh.cells, np.where(corners >= 0, row[corners], -1)]),
        )
        size = len(self.cells)
        tensor = np.asarray(self.permeability, dtype=float)
        layer = Preform(np.full(size, self.thickness), np.full(size, self.porosity), tensor)
        layer = layer.of_cells(size)
        # resin passes through the layer itself without resistance; the value is not used
        through = np.concatenate([preform.through_permeability, np.ones(size)])
        layered = Preform(
            np.concatenate([preform.thickness, layer.thickness]),
            np.concatenate([preform.porosity, layer.porosity]),
            np.concatenate([preform.permeability, layer.permeability]),
            through,
            preform.factor,
        )
        return both, layered, Links(row[below], below)


class Columns(NamedTuple):
    """Full control volumes that feed one above or below that is not full.

    Parameters
    ----------
    edge : number of the edge (P,).
    source, target : rows of both ends (P,).
    conductance : to the pressure of the air in the target (P,) [m³/(Pa s)].
    """

    edge: np.ndarray
    source: np.ndarray
    target: np.ndarray
    conductance: np.ndarray


class Sinking:
    """The columns that are filled through the thickness over a time step.

    Parameters
    ----------
    links : of the network.
    first : number of the first edge between layer and preform.
    flow : conductances of all links with both ends full (L,) [m³/(Pa s)].
    full : whether a control volume is full (N,).
    fill : fill factors at the start of the step (N,).
    pores : pore volumes (N,) [m³].
    air : pressure less ρ g·x of the air (N,) [Pa].
    step : [s].
    """

    def __init__(
        self,
        links: Links,
        first: int,
        flow: np.ndarray,
        full: np.ndarray,
        fill: np.ndarray,
        pores: np.ndarray,
        air: np.ndarray,
        step: float,
    ) -> None:
        down = full[links.above] & ~full[links.below]
        up = full[links.below] & ~full[links.above]
        rows = np.flatnonzero(down | up)
        self._down = down[rows]
        source = np.where(self._down, links.above[rows], links.below[rows])
        target = np.where(self._down, links.below[rows], links.above[rows])
        self._fill, self._pores, self._step = fill[target], pores[target], step
        #: Pressure less ρ g·x of the air that each column is filled against [Pa], (P,).
        self.air = air[target]
        self._through = flow[rows] / FULL_COLUMN
        begun = self._through / np.maximum(self._fill, FIRST_FILL)
        self.columns = Columns(
            first + rows, source, target, np.where(self._down, begun, flow[rows])
        )

    def flow(self, potential: np.ndarray) -> np.ndarray:
        """Flow into the columns [m3/s], (P,), under these potentials (N,) [Pa]."""
        columns = self.columns
        return columns.conductance * (potential[columns.source] - self.air)

    def agree(self, potential: np.ndarray) -> None:
        """Take the mean conductance over the step under these potentials (N,) [Pa].

        F² grows by 2 A K₃ (p - p_v) Δt / (µ h) over the pores, which gives the mean flow.
        """
        columns = self.columns
        drive = potential[columns.source] - self.air
        grown = 2.0 * self._through * np.maximum(drive, 0.0) * self._step / self._pores
        end = np.sqrt(self._fill**2 + grown)
        # in this form the difference keeps its digits where little enters
        rise = np.divide(grown, end + self._fill, out=np.zeros_like(grown), where=end > 0.0)
        mean = columns.conductance.copy()
        np.divide(rise * self._pores, drive * self._step, out=mean, where=grown > 0.0)
        conductance = np.where(self._down, mean, columns.conductance)
        self.columns = columns._replace(conductance=conductance)


def joined_parts(part: np.ndarray, links: Links) -> np.ndarray:
    """Numbers of the parts of a mesh (N,), of which the links join some."""
    size = int(part.max()) + 1
    ends = part[links.above], part[links.below]
    graph = coo_matrix((np.ones(len(links.above)), ends), shape=(size, size))
    return connected_components(graph, directed=False)[1][part]


def lead_length(
    thickness: float,
    porosity: float,
    through_permeability: float,
    medium_thickness: float,
    medium_porosity: float,
    medium_permeability: float,
) -> float:
    """Length [m] by which the front in a flow medium leads that at the far face of the preform.

    For one-dimensional flow through a long layer, under any pressure and at any speed, where the
    preform carries nothing along itself. Over the distance ξ behind the front, and with the speed U
    of both, the layer carries what is filled ahead, h_m K_m p' / µ = U (φ_m h_m + φ y), and the
    depth y grows as φ µ U y' y = K₃ p. Both hold with y'² = (K₃ / (φ h_m K_m)) (φ_m h_m + ⅔ φ y),
    which is integrated from 0 to h. After the picture of Hsiao, Mathur, Advani, Gillespie and Fink,
    J. Manuf. Sci. Eng. 122 (2000) 463.
    """
    stored, below = medium_porosity * medium_thickness, 2.0 / 3.0 * porosity * thickness
    ratio = porosity * medium_thickness * medium_permeability / through_permeability
    return float(3.0 / porosity * np.sqrt(ratio) * (np.sqrt(stored + below) - np.sqrt(stored)))
