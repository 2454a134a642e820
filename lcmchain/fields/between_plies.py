"""Fields of a ply's faces against other plies: pressure, gap, shear stress, slip, state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcmchain.elements.family import Body
from lcmchain.fields.ugrid import Described
from lcmchain.interfaces.in_frames import (
    APART,
    CONTACT,
    FACED,
    GAP,
    PRESSED,
    SHEARED,
    SLID,
    SLID_PATH,
    SLIDES,
    STICKS,
)
from lcmchain.interfaces.surfaces import NONE
from lcmchain.quantities.fields import FIELDS

#: What stands for no ply in the names of ``faced_ply``.
NO_PLY = "none"

#: Fields with the rows of a frame that they are.
_LENGTHS = {"ply_gap": GAP, "slip": SLID, "slip_path": SLID_PATH}
#: And those that are forces over the present area.
_STRESSES = {"ply_pressure": PRESSED, "ply_shear_stress": SHEARED}


class ContactOfFaces:
    """What faces of plies bear at most, gathered face by face, under the names of a summary.

    ``sliding_part`` is that of the area that touches another ply in the last step.
    """

    def __init__(self) -> None:
        self._pressure: list[float] = []
        self._slip: list[float] = []
        self._path: list[float] = []
        self._touching = self._sliding = 0.0

    def add(
        self,
        pressure: np.ndarray,
        slip: np.ndarray,
        path: np.ndarray,
        state: np.ndarray,
        area: np.ndarray,
    ) -> None:
        """Add a face: of its n nodes pressure [Pa], slip (n, 3) and its path [m], state, area [m²].

        All others (n,).
        """
        self._pressure.append(float(pressure.max()))
        self._slip.append(float(np.linalg.norm(slip, axis=1).max()))
        self._path.append(float(path.max()))
        self._touching += float(area[state != APART].sum())
        self._sliding += float(area[state == SLIDES].sum())

    def measures(self) -> dict[str, float]:
        """Return the extrema and the part that slides; nothing without a face."""
        if not self._path:
            return {}
        return {
            "ply_pressure_max_Pa": max(self._pressure),
            "slip_max_m": max(self._slip),
            "slip_path_max_m": max(self._path),
            "sliding_part": self._sliding / self._touching if self._touching else 0.0,
        }


@dataclass(frozen=True)
class BetweenPlies:
    """The nodes of one ply against the others.

    rows : what the frames hold of them (F, FRAME_ROWS, node_count), see
        :mod:`lcmchain.interfaces.in_frames`.
    area : of the nodes on their face (F, node_count) [m²].
    plies : names of all plies, by their numbers.
    """

    rows: np.ndarray
    area: np.ndarray
    plies: tuple[str, ...]

    @classmethod
    def of_body(
        cls, body: Body, positions: np.ndarray, rows: np.ndarray, plies: Sequence[str]
    ) -> BetweenPlies:
        """Return the nodes of a body; positions and rows are those of all nodes of the model."""
        own = slice(body.first_node, body.first_node + body.mesh.node_count)
        area = [body.present_node_area(np.ascontiguousarray(x.T)) for x in positions]
        return cls(rows[..., own], np.stack(area), tuple(plies))

    def add_to(self, contact: ContactOfFaces, nodes: slice) -> None:
        """Add one face of the ply, as it is in the last frame."""
        rows, area = self.rows[-1][:, nodes], self.area[-1][nodes]
        slip = rows[SLID : SLID + 3].T
        contact.add(rows[PRESSED] / area, slip, rows[SLID_PATH], rows[CONTACT], area)

    def fields(self, side: str, nodes: slice) -> dict[str, Described]:
        """Return values (F, n) and attributes of every variable of one face of the ply."""
        variables: dict[str, Described] = {}
        area = self.area[:, nodes]
        for stem, row in (_STRESSES | _LENGTHS).items():
            field = FIELDS[f"{stem}_{side}"]
            for number, variable in enumerate(field.variables):
                values = self.rows[:, row + number, nodes]
                values = values / area if stem in _STRESSES else np.ascontiguousarray(values)
                variables[variable] = values, field.attributes(variable)
        states = {"apart": APART, "sticks": STICKS, "slides": SLIDES}
        numbers = {NO_PLY: NONE} | {name: number for number, name in enumerate(self.plies)}
        for stem, row, flags in (("ply_contact", CONTACT, states), ("faced_ply", FACED, numbers)):
            name = f"{stem}_{side}"
            attributes: dict[str, Any] = FIELDS[name].attributes(name)
            attributes["flag_values"] = np.array(list(flags.values()), dtype=np.int32)
            attributes["flag_meanings"] = " ".join(flags)
            variables[name] = self.rows[:, row, nodes].astype(np.int32), attributes
        return variables
