"""Pressure on the faces of a sheet: a vacuum bag, a diaphragm, a film of fluid.

Adds: on the bottom or top face of every element the exact virtual work of a pressure that follows
the face, f = p ∫ N g1 × g2 dξ dη over the bilinear face. Of a stack the outer faces are pressed:
the bottom of the lowest ply and the top of the uppermost; contact hands it on. An entry may name
the ply whose face it presses, and a region. Together with a pore pressure of the same size in the
elements only the edges of the sheet are loaded: the same faces bound both.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 4.9 (pressure that follows).
Stability limit: its load stiffness, about p (1/l1 + 1/l2) / (ρ h), is added to the ω² of the
elements with the largest pressure of the table.
Scene: ``[[pressure]]``.
Fields: ``energy_external`` (history) holds its work.

Where all pressures act on whole outer faces, a step needs two numbers: :class:`FacePressure`. Else
every pressure has its share of every face, :class:`RegionalPressure`: 1 inside its region, the part
of the area inside where the border cuts the face, 0 beside it. A region is of the material: it is
named on the flat sheet and moves with it. On a face that the border cuts, that share of the
pressure acts evenly over the face: resultants are exact, moments about the border to the order of
an element.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from numba import prange
from pydantic import Field, model_validator

from lcmchain.effects.effect import Effect, EffectModel, Switch, refused
from lcmchain.elements.blocks import LANES
from lcmchain.elements.family import Body
from lcmchain.elements.pressed_elements import (
    CORNERS,
    LOAD_ROWS,
    PressedElements,
    load_corner,
    pressed_elements,
    store_corner,
)
from lcmchain.elements.vectors import combination2, cross, dot, plus, scaled
from lcmchain.errors import InputError
from lcmchain.jit import equation, kernel, routine, uncounted_routine
from lcmchain.mesh.places import Where, area_shares
from lcmchain.quantities.entry_types import (
    AT_WORK,
    AbsentMeans,
    AtWork,
    Name,
    Pressure,
    Row,
    TimeOrZero,
    wrong,
)
from lcmchain.tools.motion.base import smooth_step
from lcmchain.tools.motion.prescribed import tabulated_travel

SIDES = ("bottom", "top")
# Straight pieces of a pressure that comes on smoothly: they leave 0.02 % of it.
RAMP_PIECES = 64
# Time over which a constant pressure comes on by default, relative to the process.
RAMP_PART = 0.1


class PressureOnFace(Where):
    """Pressure on a face of the sheet, positive where it presses on it, relative to the air's.

    A box, a polygon, or a point with a radius names the region that it acts on, in the coordinates
    of the flat sheet; without any it acts on the whole face.
    """

    name: Annotated[str, Name("bag")] = Field(description="Name in results and messages.")
    stages: AtWork = Field(default=None, description=AT_WORK)
    face: Literal["top", "bottom", "both"] = Field(description="Face that the pressure acts on.")
    ply: Annotated[Annotated[str, Name("film")] | None, AbsentMeans("the outer faces")] = Field(
        default=None, description="The ply of a stack whose face it acts on."
    )
    value: Annotated[Pressure | None, AbsentMeans("")] = Field(
        default=None, description="Constant pressure; give this or a table."
    )
    ramp: Annotated[TimeOrZero | None, AbsentMeans(f"{RAMP_PART:g} of process.time")] = Field(
        default=None, description="Time over which a constant pressure comes on smoothly."
    )
    times: Annotated[
        tuple[TimeOrZero, ...] | None,
        Row('"0 10 20 ms"', minimum_count=2, entries="times"),
        AbsentMeans(""),
    ] = Field(default=None, description="Times of a table, increasing.")
    values: Annotated[
        tuple[Pressure, ...] | None,
        Row('"0 0.1 0.1 MPa"', minimum_count=2, entries="pressures"),
        AbsentMeans(""),
    ] = Field(
        default=None,
        description="Pressures at these times; linear in between, constant before and after.",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.value is None) == (self.times is None and self.values is None):
            raise wrong('give either a constant value ("0.1 MPa") or times and values')
        if self.value is not None:
            return self
        if self.times is None or self.values is None:
            raise wrong("is missing: a table needs times and values", field=self._missing)
        if self.ramp is not None:
            raise wrong("belongs to a constant value; put the rise into the table", field="ramp")
        if len(self.times) != len(self.values):
            raise wrong(
                f"has {len(self.values)} values for {len(self.times)} times; give one per time",
                field="values",
            )
        for number, (earlier, later) in enumerate(zip(self.times, self.times[1:])):
            if later <= earlier:
                raise wrong(f"do not increase after entry [{number}]", field="times")
        return self

    def require_ways(self) -> None:
        """Refuse what names no area of the sheet, or more than one."""
        ways = self.ways
        for way in ("set", "loop", "rim"):
            if way in ways:
                raise wrong(
                    "names no area of the sheet; give a box, a polygon, or a point with a radius",
                    field=way,
                )
        if len(ways) > 1:
            raise wrong(f"needs one region, but has {' and '.join(ways)}")
        if self.radius is not None and self.point is None:
            raise wrong("belongs to point, which is not given", field="radius")
        if self.point is not None and self.radius is None:
            raise wrong("is missing: a pressure acts on an area around the point", field="radius")

    @property
    def acts_on_whole_outer_faces(self) -> bool:
        """Whether it names neither a ply nor a region."""
        return self.ply is None and not self.ways

    @property
    def _missing(self) -> str:
        return "times" if self.times is None else "values"

    def table(self, process_time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times [s] and pressures [Pa] of the straight pieces."""
        if self.times is not None and self.values is not None:
            return np.array(self.times, dtype=float), np.array(self.values, dtype=float)
        ramp = RAMP_PART * process_time if self.ramp is None else self.ramp
        value = float(self.value or 0.0)
        if ramp == 0.0:
            return np.zeros(1), np.array([value])
        s = np.linspace(0.0, 1.0, RAMP_PIECES + 1)
        return ramp * s, value * np.array([smooth_step(x)[0] for x in s])


class FacePressure(NamedTuple):
    """Pressures on the faces of all elements.

    elements : see :class:`PressedElements`.
    times : (K,) [s]; bottom, top : (K,) sums of all pressures on the face [Pa], linear in between.
    """

    elements: PressedElements
    times: np.ndarray
    bottom: np.ndarray
    top: np.ndarray

    @classmethod
    def of_entries(
        cls,
        elements: PressedElements,
        faces: Sequence[str],
        times: np.ndarray,
        values: np.ndarray,
    ) -> FacePressure:
        """Return the sum of pressures (L, K) [Pa] at times (K,) [s], each with its face."""
        sums = {
            side: sum(
                pressure
                for face, pressure in zip(faces, values, strict=True)
                if face in (side, "both")
            )
            + np.zeros_like(times)
            for side in SIDES
        }
        return cls(elements, times, sums["bottom"], sums["top"])

    @property
    def largest(self) -> float:
        """Largest size of a pressure on a face [Pa]."""
        return float(max(np.abs(self.bottom).max(), np.abs(self.top).max()))

    def size_at(self, time: float) -> float:
        """Return the largest size of a pressure on a face at a time [Pa]."""
        return max(
            abs(float(np.interp(time, self.times, side))) for side in (self.bottom, self.top)
        )


def build_face_pressure(
    entries: Sequence[PressureOnFace],
    bodies: Sequence[Body],
    order: Sequence[int],
    process_time: float,
) -> FacePressure | None:
    """Return the table of all pressures on faces, or None without any.

    order : numbers of the bodies as their corner forces follow each other.

    Raises
    ------
    InputError : a sheet without thickness.
    """
    if not entries:
        return None
    times, values = common_times([entry.table(process_time) for entry in entries])
    elements = pressed_elements(bodies, order, key="pressure")
    faces = tuple(entry.face for entry in entries)
    return FacePressure.of_entries(elements, faces, times, values)


def common_times(
    tables: Sequence[tuple[np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the times of all tables (K,) [s], and the pressures of each then (L, K) [Pa]."""
    times = np.unique(np.concatenate([times for times, _ in tables]))
    return times, np.array([np.interp(times, *table) for table in tables])


@equation
def face_modes_of_lane(position, nodes, lane, first):
    """Return b1 (ξ), b2 (η), b3 (ξη) of the face whose corners begin with ``first``."""
    c0 = load_corner(position, nodes, lane, first)
    c1 = load_corner(position, nodes, lane, first + 1)
    c2 = load_corner(position, nodes, lane, first + 2)
    c3 = load_corner(position, nodes, lane, first + 3)
    across, along = combination2(0.25, c2, -0.25, c0), combination2(0.25, c1, -0.25, c3)
    return (
        plus(1.0, across, along),
        plus(-1.0, along, across),
        plus(0.25, combination2(1.0, c0, -1.0, c1), combination2(0.25, c2, -0.25, c3)),
    )


@equation
def add_face_load(load, lane, first, p, b):
    """Add p ∫ N g1 × g2 dξ dη to the four corners, with g1 = b1 + η b3 and g2 = b2 + ξ b3."""
    mean = scaled(p, cross(b[0], b[1]))
    xi = scaled(p / 3.0, cross(b[0], b[2]))
    eta = scaled(p / 3.0, cross(b[2], b[1]))
    both, apart = plus(1.0, xi, eta), plus(-1.0, eta, xi)
    store_corner(load, lane, first, plus(-1.0, both, mean))
    store_corner(load, lane, first + 1, plus(1.0, apart, mean))
    store_corner(load, lane, first + 2, plus(1.0, both, mean))
    store_corner(load, lane, first + 3, plus(-1.0, apart, mean))


@uncounted_routine
def face_pressures(table, time):
    """Return the pressures on the bottom and the top face at a time [Pa]."""
    count = table.times.size
    bottom = tabulated_travel(table.times, table.bottom, 0, count, time)[0]
    return bottom, tabulated_travel(table.times, table.top, 0, count, time)[0]


@kernel
def face_forces(elements, position, bottom, top, added, load):
    """Write the forces of pressures on both faces [Pa] on the corners of all elements.

    Parameters
    ----------
    elements : :class:`PressedElements`. position : (3, node_count) [m].
    added : whether ``load`` holds other forces to which these are added, ``True`` or ``None``.
    load : (block_count * 24 * 16,) or longer [N], row ``3*corner + component``.
    """
    for block in prange(elements.mass.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        if added is None:
            own[:] = 0.0
        for lane in range(LANES):
            # outward normals: -ζ of the bottom face, ζ of the top; the pressure acts against them
            below = bottom * elements.bottom[block * LANES + lane]
            above = top * elements.top[block * LANES + lane]
            add_face_load(own, lane, 0, below, face_modes_of_lane(position, nodes, lane, 0))
            add_face_load(own, lane, 4, -above, face_modes_of_lane(position, nodes, lane, 4))


@equation
def length(a):
    return math.sqrt(dot(a, a))


@kernel
def face_frequencies(elements, position, pressure, omega2):
    """Write bounds of the size of ω² [1/s²] that a pressure [Pa] adds, by lane.

    Blocks of the load stiffness in b0 ... b3 are cross products with b1 ... b3, its mass half that
    of the element. It has no symmetry where a face ends: the larger of row and column sums counts.
    """
    for block in prange(omega2.size // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        for lane in range(LANES):
            largest = 0.0
            for side in range(2):
                b = face_modes_of_lane(position, nodes, lane, 4 * side)
                largest = max(largest, length(b[0]) + length(b[1]) + length(b[2]) / 3.0)
            mass = elements.mass[block * LANES + lane]
            bound = 8.0 * abs(pressure) * largest / mass if mass > 0.0 else 0.0
            omega2[block * LANES + lane] = bound


# --- on regions of faces, and on the faces of named plies -----------------------------------------


class RegionalPressure(NamedTuple):
    """Pressures with a share of every face.

    elements : see :class:`PressedElements`.
    times : (K,) [s]. values : (L * K,) pressures of the L entries [Pa], linear in between.
    share : (L * 2 * block_count * 16,), of the bottom and the top faces of all lanes.
    peak : (block_count * 16,) the largest size of a pressure on a face of the lane [Pa].
    """

    elements: PressedElements
    times: np.ndarray
    values: np.ndarray
    share: np.ndarray
    peak: np.ndarray

    @classmethod
    def of_shares(
        cls, elements: PressedElements, share: np.ndarray, times: np.ndarray, values: np.ndarray
    ) -> RegionalPressure:
        """Return pressures (L, K) [Pa] at times (K,) [s] with their shares (L, 2, lanes)."""
        # the pressures are linear in between: the largest stands at one of the times
        peak = np.abs(np.einsum("lk,lsn->ksn", values, share)).max(axis=(0, 1))
        return cls(elements, times, values.ravel(), share.ravel(), peak)

    @property
    def largest(self) -> float:
        """Largest size of a pressure on a face [Pa]."""
        return float(self.peak.max())

    @property
    def entry_values(self) -> np.ndarray:
        """Pressures of the entries (L, K) [Pa]."""
        return self.values.reshape(-1, self.times.size)

    @property
    def entry_shares(self) -> np.ndarray:
        """Shares of the entries in the bottom and top faces (L, 2, lanes)."""
        return self.share.reshape(-1, 2, self.peak.size)

    def size_at(self, time: float) -> float:
        """Return the largest size of a pressure on a face at a time [Pa]."""
        now = [np.interp(time, self.times, values) for values in self.entry_values]
        return float(np.abs(np.einsum("l,lsn->sn", now, self.entry_shares)).max())


def build_regional_pressure(
    entries: Sequence[PressureOnFace],
    bodies: Sequence[Body],
    order: Sequence[int],
    process_time: float,
) -> RegionalPressure:
    """Return the table of pressures of which some have a region or a ply.

    Parameters are those of :func:`build_face_pressure`.

    Raises
    ------
    InputError : a sheet without thickness, a ply that is not there, or a region beside the sheet.
    """
    elements = pressed_elements(bodies, order, key="pressure")
    times, values = common_times([entry.table(process_time) for entry in entries])
    share = regional_shares(entries, bodies, elements)
    return RegionalPressure.of_shares(elements, share, times, values)


def regional_shares(
    entries: Sequence[PressureOnFace],
    bodies: Sequence[Body],
    elements: PressedElements,
    at_work: Sequence[bool] = (),
) -> np.ndarray:
    """Return the shares of pressures in the bottom and top faces of all lanes (L, 2, lanes).

    at_work : of every entry; the others have none. All are without it.

    Raises
    ------
    InputError : as :func:`build_regional_pressure`.
    """
    share = np.zeros((len(entries), 2, elements.padded_count))
    for index, entry in enumerate(entries):
        if at_work and not at_work[index]:
            continue
        key = f'pressure[{index}] "{entry.name}"'
        shares = _shares_of(entry, bodies, key)
        lanes = elements.in_lanes(shares)
        for side, outer in zip(SIDES, (elements.bottom, elements.top), strict=True):
            if entry.face in (side, "both"):
                share[index, SIDES.index(side)] = lanes if entry.ply is not None else lanes * outer
        if not share[index].any():
            raise InputError(
                "presses on no outer face of the stack there; name the ply whose face is meant",
                key=f"{key}.ply",
            )
    return share


def _shares_of(entry: PressureOnFace, bodies: Sequence[Body], key: str) -> np.ndarray:
    """Return the share of an entry in every element of the model, whatever the face."""
    names = [body.name for body in bodies]
    if entry.ply is not None and entry.ply not in names:
        raise InputError(
            f'there is no ply "{entry.ply}"; there is {", ".join(names)}', key=f"{key}.ply"
        )
    shares, beside = [], []
    for body in bodies:
        count = body.mesh.element_count
        if entry.ply not in (None, body.name):
            shares.append(np.zeros(count))
        elif not entry.ways:
            shares.append(np.ones(count))
        else:
            corners = body.mesh.mid_surface_positions[body.mesh.faces]
            try:
                shares.append(area_shares(entry, corners, key))
            except InputError as error:  # the region may lie on another ply
                beside.append(error)
                shares.append(np.zeros(count))
    if beside and not any(share.any() for share in shares):
        raise beside[0]
    return np.concatenate(shares)


@routine
def present_pressures(table, time):
    """Return the pressures of all entries at a time (L,) [Pa]."""
    count = table.times.size
    now = np.empty(table.values.size // count)
    for entry in range(now.size):
        own = table.values[entry * count : (entry + 1) * count]
        now[entry] = tabulated_travel(table.times, own, 0, count, time)[0]
    return now


@routine
def pressure_of_lane(now, share, first, lanes):
    """Return the sum of all pressures on a face [Pa], whose shares begin at ``first``."""
    total = 0.0
    for entry in range(now.size):
        total += now[entry] * share[2 * entry * lanes + first]
    return total


@kernel
def regional_forces(elements, position, now, share, added, load):
    """Write the forces of all pressures on the corners of all elements.

    Parameters
    ----------
    elements, position, added, load : as for :func:`face_forces`.
    now : (L,) pressures of the entries [Pa]. share : as in :class:`RegionalPressure`.
    """
    lanes = elements.mass.size
    for block in prange(lanes // LANES):
        nodes = elements.corner_node[block * CORNERS * LANES : (block + 1) * CORNERS * LANES]
        own = load[block * LOAD_ROWS * LANES : (block + 1) * LOAD_ROWS * LANES]
        if added is None:
            own[:] = 0.0
        for lane in range(LANES):
            # padding repeats an element, and has no share
            below = pressure_of_lane(now, share, block * LANES + lane, lanes)
            above = pressure_of_lane(now, share, lanes + block * LANES + lane, lanes)
            add_face_load(own, lane, 0, below, face_modes_of_lane(position, nodes, lane, 0))
            add_face_load(own, lane, 4, -above, face_modes_of_lane(position, nodes, lane, 4))


# --- the effect -----------------------------------------------------------------------------------


SWITCH = Switch(
    entry="[[pressure]]",
    without="the pressures on the faces",
    called=lambda scene: bool(scene.pressure),
    off=lambda scene: {"pressure": ()},
    on=refused("no pressure is given; add [[pressure]]"),
)


def active(model: EffectModel) -> list[Effect]:
    table = model.face_pressure
    if table is None:
        return [Effect("pressure on faces", False, "no [[pressure]] entry")]
    effects = []
    if isinstance(table, FacePressure):
        for side, values in (("bottom", table.bottom), ("top", table.top)):
            if values.any():
                effects.append(Effect(f"pressure on the {side} face", True, _over_time(values)))
    else:
        pairs = zip(table.entry_values, table.entry_shares, strict=True)
        for number, (values, share) in enumerate(pairs, start=1):
            if values.any():
                faces = f"{np.count_nonzero(share)} faces"
                cut = np.count_nonzero((share > 0.0) & (share < 1.0))
                faces += f", {cut} of them in part" if cut else ""
                reason = f"{_over_time(values)}, on {faces}"
                effects.append(Effect(f"pressure {number} on a region or ply", True, reason))
    return effects or [Effect("pressure on faces", False, "all pressures are zero")]


def _over_time(values: np.ndarray) -> str:
    low, high = 1e-6 * values.min(), 1e-6 * values.max()
    return f"{low:.4g} to {high:.4g} MPa over the process"
