"""Grippers: what holds the sheet at a place, leads it, or pulls at it by a spring or a weight.

Adds: on the nodes that a gripper holds a pull of the size

    F = min(max(r F0 + k e, 0), Fmax)

with the force F0 at the start, which comes on by the smooth ramp r, the stiffness k, and the length
e by which the gripped place has moved away from the gripper. The pull acts in a fixed direction, or
towards an anchor: then e is the change of the distance from the anchor. A gripper only pulls. The
nodes share its force by their areas; the place is their mean by areas. A gripper that holds or
leads its nodes is a support (:mod:`lcmchain.effects.supports`).
Source: virtual work of a spring on a mean displacement, f_i = w_i F with the sum of w_i one.
Stability limit: (k + F / L) Σ w_i² / m_i is added to the ω² of the elements, with the distance L
from the anchor; of grippers that share nodes, the bound of Gershgorin on their springs.
Scene: ``[[grippers]]``.
Fields: ``history_gripper_force``, ``history_gripper_travel``; their work is in ``energy_external``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.sparse import coo_array

from lcmchain.effects.effect import Effect, EffectModel
from lcmchain.effects.supports import Support, rotation, translation
from lcmchain.elements.family import Body
from lcmchain.errors import InputError
from lcmchain.mesh.lines import outward, pieces_along
from lcmchain.mesh.places import NamedPlace, Places, place_text
from lcmchain.quantities.entry_types import (
    AT_WORK,
    AbsentMeans,
    AtWork,
    Direction,
    ForceOrZero,
    Name,
    Number,
    Position,
    PositiveForce,
    PositiveLength,
    PositiveTime,
    Range,
    SpringStiffness,
    Switch,
    Text,
    wrong,
)
from lcmchain.tools.motion import (
    FixedMotion,
    GuidedMotion,
    LeadingMotion,
    StrokeMotion,
    TableMotion,
    TurnMotion,
)
from lcmchain.tools.motion.base import ToolMotion
from lcmchain.tools.motion.prescribed import travel_along

#: Time over which the force at the start comes on, relative to the process.
RAMP_PART = 0.05
#: Nearer to its anchor than this part of the distance at the start, where its direction is lost, a
#: pull falls with the distance.
LEAST_DISTANCE = 0.05
#: Grippers along a rim, at most.
MOST_ALONG_A_RIM = 200

PULLING = ("force", "stiffness", "largest_force", "direction", "anchor", "outward")
TOWARDS = ("direction", "anchor", "outward")


class Gripper(NamedPlace):
    """A place of the blank that is held, led, or pulled at."""

    name: Annotated[str, Name("left")] = Field(description="Name in results and messages.")
    stages: AtWork = Field(default=None, description=AT_WORK)
    ply: Annotated[Annotated[str, Name("bottom")] | None, AbsentMeans("all that are there")] = (
        Field(default=None, description="The ply that is gripped.")
    )
    count: Annotated[int, Number(8, Range(1, MOST_ALONG_A_RIM), whole=True)] = Field(
        default=1, description="Of a rim or loop: so many grippers, evenly along it."
    )
    width: Annotated[PositiveLength | None, AbsentMeans("one edge of an element")] = Field(
        default=None, description="With count: the length of the rim that each of them grips."
    )
    face: Annotated[Literal["bottom", "top"] | None, AbsentMeans("both")] = Field(
        default=None,
        description="The face whose nodes are gripped. A place that is held at one face alone "
        "turns as on a hinge: so a film is clamped.",
    )
    hold: Annotated[Annotated[str, Text("xyz")] | None, AbsentMeans("")] = Field(
        default=None, description="Directions in which the place is held, of x, y and z."
    )
    motion: LeadingMotion = Field(
        default_factory=FixedMotion, description="How a place that is held in xyz is led."
    )
    force: Annotated[ForceOrZero | None, AbsentMeans("0 N")] = Field(
        default=None,
        description="Pull at the start, all of it where there is no stiffness (a dead weight); it "
        f"comes on smoothly over {RAMP_PART:g} of the process.",
    )
    stiffness: Annotated[SpringStiffness | None, AbsentMeans("0 N/m")] = Field(
        default=None, description="By which the pull grows where the place is drawn away."
    )
    largest_force: Annotated[PositiveForce | None, AbsentMeans("no limit")] = Field(
        default=None, description="Limit of the pull, as of a cylinder under pressure."
    )
    direction: Annotated[Direction | None, AbsentMeans("")] = Field(
        default=None, description="Direction of the pull."
    )
    anchor: Annotated[Position | None, AbsentMeans("")] = Field(
        default=None, description="Point that the pull goes towards: a hook, or a pulley."
    )
    outward: Switch = Field(
        default=False, description="The pull goes outward in the plane, normal to the rim."
    )
    release_time: Annotated[PositiveTime | None, AbsentMeans("never")] = Field(
        default=None, description="The gripper lets go at this time of the process."
    )
    release_force: Annotated[PositiveForce | None, AbsentMeans("never")] = Field(
        default=None, description="It lets go where its force exceeds this one."
    )
    release_travel: Annotated[PositiveLength | None, AbsentMeans("never")] = Field(
        default=None, description="It lets go where the place that it pulls at has moved so far."
    )

    @property
    def pulls(self) -> bool:
        """Whether it pulls; else it holds."""
        return self.hold is None

    @property
    def leads(self) -> bool:
        """Whether it leads its place along a given way."""
        return self.motion.moves

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.set is not None:
            raise wrong(
                "names a set, but a blank has none; name a box, a point or the rim", field="set"
            )
        if (self.count > 1 or self.width is not None) and not (self.rim or self.loop is not None):
            field = "count" if self.count > 1 else "width"
            raise wrong("belongs to grippers along a rim or loop", field=field)
        if self.hold is None:
            self._check_pull()
        else:
            self._check_hold()
        return self

    def _check_pull(self) -> None:
        if not (self.force or self.stiffness):
            raise wrong(
                'needs a force ("20 N") or a stiffness ("0.5 N/mm") that pulls, or hold = "xyz"'
            )
        given = [entry for entry in TOWARDS if getattr(self, entry) not in (None, False)]
        if len(given) != 1:
            those = " and ".join(given) or "none"
            raise wrong(
                f"needs one of {', '.join(TOWARDS[:2])} and outward = true, but has {those}"
            )
        if self.largest_force is not None and self.largest_force < (self.force or 0.0):
            raise wrong(
                f"is {self.largest_force:g} N, below the force at the start, {self.force:g} N",
                field="largest_force",
            )
        if not isinstance(self.motion, FixedMotion):
            raise wrong('leads a place that is held; give hold = "xyz" with it', field="motion")

    def _check_hold(self) -> None:
        hold = self.hold or ""
        if not hold or set(hold) - set("xyz") or len(set(hold)) < len(hold):
            raise wrong(
                f'is "{hold}"; write the directions once each, as "xyz" or "z"', field="hold"
            )
        for entry in PULLING:
            if getattr(self, entry) not in (None, False):
                raise wrong("pulls, but hold is given; leave one of them out", field=entry)
        if self.release_travel is not None:
            raise wrong(
                "belongs to a gripper that pulls; give release_time", field="release_travel"
            )
        require_leading(self.motion, "motion")
        if self.motion.moves and hold != "xyz":
            raise wrong(f'leads the place, but hold is "{hold}"; give "xyz"', field="motion")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the grippers of this entry: numbered where it has a ``count``."""
        if self.count == 1:
            return (self.name,)
        return tuple(f"{self.name}-{number}" for number in range(1, self.count + 1))

    def completed(self, process_time: float, *, key: str) -> Self:
        """Fill the entries whose default is another entry of the scene; an error names the key."""
        if self.release_time is not None and self.release_time >= process_time:
            raise wrong(
                f"is {self.release_time:g} s, not before the end of the process at "
                f"{process_time:g} s",
                field=f"{key}.release_time",
            )
        motion = self.motion.completed(process_time, key=f"{key}.motion")
        return self.model_copy(update={"motion": motion})

    def without_time(self, process_time: float, *, key: str) -> Self:
        """Fill the times in a process without one; an error names the key of one that is given."""
        if self.release_time is not None:
            raise wrong(
                "is a time of the process, but process.time is left out; give process.time, or "
                "release_force or release_travel in its place",
                field=f"{key}.release_time",
            )
        motion = self.motion.without_time(process_time, key=f"{key}.motion")
        return self.model_copy(update={"motion": motion})


@dataclass(frozen=True)
class Grip:
    """A gripper on the nodes of a model.

    Parameters
    ----------
    name : that of its entry, with a number where there are several along a rim.
    nodes : (n,) node numbers, ascending. weights : (n,) shares in its force, whose sum is 1.
    settings : its entry.
    place : (3,) mean of its nodes at the start [m].
    direction : (3,) unit vector of a pull in a fixed direction; None without.
    """

    name: str
    nodes: np.ndarray
    weights: np.ndarray
    settings: Gripper
    place: np.ndarray
    direction: np.ndarray | None

    @property
    def pull_direction(self) -> np.ndarray | None:
        """Direction (3,) of its pull at the start; None of a gripper that holds or leads."""
        if self.settings.anchor is None:
            return self.direction
        toward = np.array(self.settings.anchor) - self.place
        return toward / np.linalg.norm(toward)

    def support(self, process_time: float) -> Support:
        """Return the support of a gripper that holds."""
        return Support(
            self.name,
            self.nodes,
            self.settings.hold or "",
            motion_of_grip(self.settings.motion, process_time),
            release_time=_or_never(self.settings.release_time),
            release_force=_or_never(self.settings.release_force),
        )


def motion_of_grip(motion: ToolMotion, time: float) -> Callable[[float], np.ndarray] | None:
    """Return what a gripper leads its place by, as of :class:`Support`; None where it stays.

    time : of the process or the stage [s], in which the motion ends where it does not say when.
    """
    if isinstance(motion, TurnMotion):
        return rotation(motion.axis, motion.point, travel_along(motion, time))
    if isinstance(motion, StrokeMotion | TableMotion) and motion.moves:
        return translation(motion.direction, travel_along(motion, time))
    return None


def require_leading(motion: ToolMotion, key: str) -> None:
    """Refuse a motion by which no gripper leads; the error names the key."""
    if isinstance(motion, GuidedMotion):
        raise wrong(
            "is guided; a gripper is led by a stroke, a table or a turn", field=f"{key}.type"
        )
    if getattr(motion, "until_force", None) is not None:
        raise wrong(
            "belongs to the stroke of a tool; a gripper lets go by release_force",
            field=f"{key}.until_force",
        )


class GripperTable(NamedTuple):
    """Grippers that pull, as arrays.

    start : (G + 1,) int32, where the nodes of each begin; node : (n,) int32; owner : (n,) int32,
        the gripper; weight : (n,) shares.
    order : (n,) int32, entries in the order of their nodes; chunk_start : (chunk_count + 1,) int32,
        where those of each chunk of nodes begin in ``order``.
    place : (G, 3) means at the start [m]. toward : (G, 3) unit vectors of pulls in a fixed
        direction, else 0; anchor : (G, 3) [m]; distance : (G,) from it at the start [m], 0 without.
    force, stiffness, largest : (G,) [N], [N/m], [N]. begin, ramp : (G,) time at which the force
        begins to come on, and over which it does [s].
    release_time, release_force, release_travel : (G,) [s], [N], [m], infinite where never.
    coupling : (G, G) Σ w_gi w_hi / m_i of every two [1/kg].
    """

    start: np.ndarray
    node: np.ndarray
    owner: np.ndarray
    weight: np.ndarray
    order: np.ndarray
    chunk_start: np.ndarray
    place: np.ndarray
    toward: np.ndarray
    anchor: np.ndarray
    distance: np.ndarray
    force: np.ndarray
    stiffness: np.ndarray
    largest: np.ndarray
    begin: np.ndarray
    ramp: np.ndarray
    release_time: np.ndarray
    release_force: np.ndarray
    release_travel: np.ndarray
    coupling: np.ndarray


def grips_of(entries: Sequence[Gripper], bodies: Sequence[Body]) -> tuple[Grip, ...]:
    """Return the grippers of a scene on the nodes of its bodies.

    Parameters
    ----------
    bodies : as :class:`lcmchain.elements.family.Body`.

    Raises
    ------
    InputError : a gripper on nothing, on a ply that is not there, whose pull has no direction, or
        two of one name.
    """
    grips: list[Grip] = []
    for index, entry in enumerate(entries):
        key = f'grippers[{index}] "{entry.name}"'
        chosen = [body for body in bodies if entry.ply in (None, body.name)]
        if not chosen:
            names = ", ".join(body.name for body in bodies)
            raise InputError(f'there is no ply "{entry.ply}"; there is {names}', key=f"{key}.ply")
        taken = {grip.name for grip in grips}
        for grip in _grips_of_entry(entry, chosen, key):
            if grip.name in taken:
                raise InputError(f'makes a second gripper "{grip.name}"', key=f"{key}.name")
            grips.append(grip)
    return tuple(grips)


class _Hold(NamedTuple):
    """The nodes of one body that a gripper holds.

    nodes : (n,) of the model. areas : (n,) [m²]. positions : (n, 3) [m].
    outward : (3,) normal to the rim in the plane, as long as the rim that is gripped; 0 inside.
    """

    nodes: np.ndarray
    areas: np.ndarray
    positions: np.ndarray
    outward: np.ndarray


def _grips_of_entry(entry: Gripper, bodies: Sequence[Body], key: str) -> list[Grip]:
    """Return the grippers of an entry, with what each holds of all bodies that are there."""
    of_bodies: list[list[_Hold]] = []
    elsewhere: list[InputError] = []
    for body in bodies:
        try:
            of_bodies.append(_holds(entry, body, key))
        except InputError as error:  # the place may lie on another ply
            elsewhere.append(error)
    if not of_bodies:
        raise elsewhere[0]
    return [
        _grip(entry, name, holds, key)
        for name, holds in zip(entry.names, zip(*of_bodies, strict=True), strict=True)
    ]


def _holds(entry: Gripper, body: Body, key: str) -> list[_Hold]:
    mesh = body.mesh
    positions = mesh.node_positions
    sides = [side for name, side in mesh.sides().items() if entry.face in (None, name)]
    if not sides:  # one layer of nodes, which lies in both faces
        sides = list(mesh.sides().values())
    places = Places(mesh.mid_surface(positions), mesh.sheet_faces, {}, {})
    if entry.count > 1 or entry.width is not None:
        edges = places.edges(entry, key)
        width = places.edge_length if entry.width is None else entry.width
        chosen = pieces_along(edges, places.points, entry.count, width, key=key)
    else:
        chosen = [places.nodes(entry, key)]
    holds = []
    for middle in chosen:
        nodes = np.concatenate([np.arange(mesh.node_count)[side][middle] for side in sides])
        areas = body.node_area[nodes]
        normal = outward(places.cells, places.points, middle)
        holds.append(_Hold(nodes + body.first_node, areas, positions[nodes], normal))
    return holds


def _grip(entry: Gripper, name: str, holds: Sequence[_Hold], key: str) -> Grip:
    nodes, areas, positions = (
        np.concatenate([getattr(hold, name) for hold in holds])
        for name in ("nodes", "areas", "positions")
    )
    weights = areas / areas.sum()
    place = weights @ positions
    direction = None
    if entry.direction is not None:
        direction = np.array(entry.direction)
    elif entry.outward:
        normal = np.sum([hold.outward for hold in holds], axis=0)
        length = np.linalg.norm(normal)
        if length < 1e-9 * math.sqrt(areas.sum()):
            raise InputError(
                f"has no direction at {place_text(place)}: that lies inside the blank, or all "
                "around it; give direction or anchor, or several grippers along the rim by count",
                key=f"{key}.outward",
            )
        direction = normal / length
    if entry.anchor is not None:
        distance = float(np.linalg.norm(entry.anchor - place))
        size = float(np.linalg.norm(positions - place, axis=1).max())
        if distance <= size:
            raise InputError(
                f"lies {1e3 * distance:.3g} mm from the middle of what is gripped, which reaches "
                f"{1e3 * size:.3g} mm around it; move it away",
                key=f"{key}.anchor",
            )
    return Grip(name, nodes, weights, entry, place, direction)


def gripper_table(
    grips: Sequence[Grip],
    positions: np.ndarray,
    mass: np.ndarray,
    chunk_start: np.ndarray,
    process_time: float,
) -> GripperTable | None:
    """Return the table of grippers that pull, or None without any.

    Parameters
    ----------
    positions : (node_count, 3) [m]. mass : (node_count,) [kg].
    chunk_start : (chunk_count + 1,), the first node of each chunk. process_time : [s].
    """
    if not grips:
        return None
    node = np.concatenate([grip.nodes for grip in grips])
    owner = np.repeat(np.arange(len(grips)), [grip.nodes.size for grip in grips])
    weight = np.concatenate([grip.weights for grip in grips])
    order = np.lexsort((owner, node))
    shares = coo_array((weight / np.sqrt(mass[node]), (owner, node))).tocsr()
    entries = [grip.settings for grip in grips]
    place = np.array([grip.place for grip in grips])
    toward = np.array([np.zeros(3) if g.direction is None else g.direction for g in grips])
    anchor = np.array([np.zeros(3) if e.anchor is None else e.anchor for e in entries])
    anchored = np.array([entry.anchor is not None for entry in entries])
    return GripperTable(
        start=np.append(0, np.cumsum([grip.nodes.size for grip in grips])).astype(np.int32),
        node=node.astype(np.int32),
        owner=owner.astype(np.int32),
        weight=weight,
        order=order.astype(np.int32),
        chunk_start=np.searchsorted(node[order], chunk_start).astype(np.int32),
        place=place,
        toward=toward,
        anchor=anchor,
        distance=np.where(anchored, np.linalg.norm(anchor - place, axis=1), 0.0),
        force=np.array([entry.force or 0.0 for entry in entries]),
        stiffness=np.array([entry.stiffness or 0.0 for entry in entries]),
        largest=np.array([_or_never(entry.largest_force) for entry in entries]),
        begin=np.zeros(len(grips)),
        ramp=np.full(len(grips), RAMP_PART * process_time),
        release_time=np.array([_or_never(entry.release_time) for entry in entries]),
        release_force=np.array([_or_never(entry.release_force) for entry in entries]),
        release_travel=np.array([_or_never(entry.release_travel) for entry in entries]),
        coupling=(shares @ shares.T).toarray(),
    )


def omega2_of_grippers(table: GripperTable, travel: np.ndarray, force: np.ndarray) -> float:
    """Return a bound of the highest ω² on the springs of grippers alone [1/s²].

    Parameters
    ----------
    travel : (G, 3) of the places since the start [m]. force : (G, 3) of the pulls [N].
    """
    away = np.linalg.norm(table.anchor - table.place - travel, axis=1)
    distance = np.maximum(away, LEAST_DISTANCE * table.distance)
    across = np.zeros_like(distance)
    anchored = table.distance > 0.0
    # a pull may grow by its spring until the next look
    pull = np.linalg.norm(force, axis=1) + table.stiffness * LEAST_DISTANCE * table.distance
    across[anchored] = np.minimum(pull, table.largest)[anchored] / distance[anchored]
    root = np.sqrt(table.stiffness + across)
    return float((root[:, None] * table.coupling * root).sum(axis=1).max())


def active(model: EffectModel) -> list[Effect]:
    """Return one effect per entry of ``[[grippers]]``."""
    effects = []
    for entry in dict.fromkeys(grip.settings for grip in model.grips):
        grips = [grip for grip in model.grips if grip.settings is entry]
        nodes = f"{sum(grip.nodes.size for grip in grips)} nodes"
        reason = f"{'leads' if entry.leads else 'holds'} {nodes}"
        if entry.pulls:
            parts = [
                f"{value:.4g} {unit}"
                for value, unit in ((entry.force, "N"), (entry.stiffness, "N/m"))
                if value
            ]
            reason = f"pulls {nodes} by {' and '.join(parts)}"
        name = f"gripper {entry.name}"
        if len(grips) > 1:
            name, reason = f"{len(grips)} grippers {entry.name}", f"{reason} each"
        effects.append(Effect(name, True, reason))
    return effects


def _or_never(value: float | None) -> float:
    return math.inf if value is None else value
