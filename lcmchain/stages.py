"""What a model is in each stage of its process: tables of the same shapes, with other values.

The compiled loop knows nothing of stages. Its tables are made for the present one: all tools,
grippers and pressures stand in them always, and those that are not at work have no force. Nothing
is compiled anew, and the state keeps its layout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from lcmchain.effects.face_pressure import (
    FacePressure,
    PressureOnFace,
    RegionalPressure,
    common_times,
    regional_shares,
)
from lcmchain.effects.grippers import RAMP_PART, Grip, Gripper, GripperTable, motion_of_grip
from lcmchain.effects.process.pace import PaceLaw, pace_law
from lcmchain.effects.supports import TABLE_SIZE, Support, SupportTable
from lcmchain.elements.family import Body
from lcmchain.errors import InputError
from lcmchain.interfaces.surfaces import PlyContact
from lcmchain.scene.stages import StagePlan
from lcmchain.tools.motion import (
    FIXED,
    GUIDED,
    PRESCRIBED,
    StrokeMotion,
    TableMotion,
    TurnMotion,
)
from lcmchain.tools.motion.base import TABULATED
from lcmchain.tools.table import ToolTable

#: Columns of the tool table that a motion gives one number for.
MOTION_COLUMNS = (
    "motion_kind", "mass", "force", "damping", "gravity_along", "ramp", "load_start",
    "travel_start", "stop", "until_force", "stroke_profile", "stroke_distance", "stroke_start",
    "stroke_end",
)  # fmt: skip


class StageStart(Protocol):
    """What a state keeps of the time when the present stage began.

    tool_start : (T, 2) travel and overlap of the tools [m]. gripper_start : (G, 3) travel of the
        places that grippers pull at [m]. gripped_at : (3, node_count) where nodes are held [m].
    """

    @property
    def tool_start(self) -> np.ndarray: ...
    @property
    def gripper_start(self) -> np.ndarray: ...
    @property
    def gripped_at(self) -> np.ndarray: ...


class StagedModel(Protocol):
    """What is read of a model for its stages; it is above them, :class:`lcmchain.model.Model`."""

    @property
    def bodies(self) -> Sequence[Body]: ...
    @property
    def nodes(self) -> Any: ...
    @property
    def tools(self) -> ToolTable: ...
    @property
    def grips(self) -> Sequence[Grip]: ...
    @property
    def held_grip_count(self) -> int: ...
    @property
    def grippers(self) -> GripperTable | None: ...
    @property
    def supports(self) -> SupportTable | None: ...
    @property
    def face_pressure(self) -> FacePressure | RegionalPressure | None: ...
    @property
    def environment(self) -> Any: ...
    @property
    def averaging(self) -> float | None: ...


@dataclass(frozen=True)
class StageTables:
    """A stage as the loop takes it.

    name : of the stage. start, end : [s] of the process.
    tools : with the motions of the stage; where the tools are when it begins comes from the state.
    tools_at_work : (T,) whether contact with each is evaluated.
    grippers : those that pull, without force where they are not at work; None without any.
    grippers_at_work : (G,) of them: whether each is.
    supports : with the motions of the stage, or None. supports_at_work : (S,).
    absent : (node_count,) whether a node is of a ply that is laid down later; None where all are
        there from the start.
    face_pressure, ply_contact, environment, averaging, pace : as in :class:`lcmchain.model.Model`.
    rest_energy : of a stage that ends at rest (:mod:`lcmchain.solver.rest`), else None.
    settled : when the motions and loads of the stage have come to their end [s].
    """

    name: str
    start: float
    end: float
    tools: ToolTable
    tools_at_work: np.ndarray
    grippers: GripperTable | None
    grippers_at_work: np.ndarray
    supports: SupportTable | None
    supports_at_work: np.ndarray
    absent: np.ndarray | None
    face_pressure: FacePressure | RegionalPressure | None
    ply_contact: PlyContact | None
    environment: Any
    averaging: float | None
    pace: PaceLaw | None
    rest_energy: float | None
    settled: float

    def model(self, model: Any, number: int, whole: Any, state: StageStart) -> Any:
        """Return the model in this stage.

        number : of the stage. whole : the model over all stages. state : since the stage began.
        """
        travel, overlap = np.ascontiguousarray(state.tool_start.T)
        grippers, supports = self.grippers, self.supports
        if grippers is not None:
            place = grippers.place + state.gripper_start
            away = np.linalg.norm(grippers.anchor - place, axis=1)
            distance = np.where(grippers.distance > 0.0, away, 0.0)
            grippers = grippers._replace(place=place, distance=distance)
        if supports is not None:
            anchor = np.ascontiguousarray(state.gripped_at[:, supports.node])
            supports = supports._replace(anchor=anchor)
        return replace(
            model,
            tools=self.tools._replace(travel_start=travel, initial_overlap=overlap),
            grippers=grippers,
            supports=supports,
            face_pressure=self.face_pressure,
            ply_contact=self.ply_contact,
            environment=self.environment,
            averaging=self.averaging,
            pace=self.pace,
            stage=number,
            over_all_stages=whole,
        )

    def free(self, model: StagedModel, let_go: np.ndarray) -> np.ndarray:
        """Return 1 where a component of a node is free (3, node_count), 0 where it is held.

        Plies that are laid down later are held where they wait.

        let_go : (S,) when each support let go [s], infinite where it holds.
        """
        table = model.supports
        assert model.nodes.free is not None
        free = np.ones_like(model.nodes.free)
        if table is not None:
            holds = (self.supports_at_work & np.isinf(let_go))[table.group]
            held = table.node[holds]
            free[:, held] = model.nodes.free[:, held]
        if self.absent is not None:
            free[:, self.absent] = 0.0
        return free


def stage_tables(
    model: StagedModel,
    plans: Sequence[StagePlan],
    contacts: Sequence[PlyContact],
    *,
    grippers: Sequence[Gripper],
    supports: Sequence[Support],
    pressures: Sequence[PressureOnFace],
    quasi_static: float,
    depth_time: Callable[[float], float | None],
) -> tuple[StageTables, ...]:
    """Return the tables of all stages.

    Parameters
    ----------
    model : over all stages. plans : of a scene. contacts : between plies in every stage, or none.
    grippers, pressures : entries of the scene.
    supports : of the model, those of grippers that hold last.
    depth_time : returns the time in which depths in tools go to zero in a stage of a time [s].

    Raises
    ------
    InputError : a support that is no gripper has a motion, which would belong to one of the stages.
    """
    own = len(supports) - model.held_grip_count
    for support in supports[:own]:
        if support.motion is not None:
            raise InputError(
                f"the support {support.name} has a motion over the whole process, which has "
                "stages; lead it by a gripper with a motion in a stage",
                key="stages",
            )
    found = []
    for number, plan in enumerate(plans):
        tools = _tools_in_stage(model.tools, plan)
        pulling = [grip for grip in model.grips if grip.settings.pulls]
        holding = [grip for grip in model.grips if not grip.settings.pulls]
        works = np.array([plan.grippers[_entry(grip, grippers)] for grip in pulling], dtype=bool)
        begins = [plan.gripper_begins[_entry(grip, grippers)] for grip in pulling]
        begin = np.array([start for start, _ in begins], dtype=float)
        ramp = RAMP_PART * np.array([time for _, time in begins], dtype=float)
        held = [plan.grippers[_entry(grip, grippers)] for grip in holding]
        pulls = None
        if model.grippers is not None:
            pulls = _pulls_in_stage(model.grippers, works, begin, ramp)
        face, absent = None, absent_nodes(model.bodies, plans, plan)
        if model.face_pressure is not None:
            face = _pressures_in_stage(model.face_pressure, pressures, plan, model.bodies)
        _require_gripped(model, plan, grippers)
        held_nodes = _supports_in_stage(model.supports, plan, own, holding, held, grippers)
        if held_nodes is not None and absent is not None:
            held_nodes = _of_nodes(held_nodes, ~absent)
        environment = model.environment._replace(
            mass_damping=float(plan.mass_damping), depth_time=depth_time(plan.time)
        )
        found.append(
            StageTables(
                name=plan.stage.name,
                start=plan.start,
                end=plan.end,
                tools=tools,
                tools_at_work=np.array(plan.tools, dtype=bool),
                grippers=pulls,
                grippers_at_work=works,
                supports=held_nodes,
                supports_at_work=np.array([True] * own + held, dtype=bool),
                absent=absent,
                face_pressure=face,
                ply_contact=contacts[number] if contacts else None,
                environment=environment,
                averaging=None if model.averaging is None else float(plan.averaging),
                pace=pace_law(model.bodies, plan.time, quasi_static)
                if plan.stage.time_is_found
                else None,
                rest_energy=plan.stage.rest_energy if plan.stage.rest else None,
                settled=_settled(plan, tools, pulls, face),
            )
        )
    return tuple(found)


def absent_nodes(
    bodies: Sequence[Body], plans: Sequence[StagePlan], plan: StagePlan
) -> np.ndarray | None:
    """Return whether each node is of a ply that is not there in a stage (node_count,).

    None in a process in which all plies are there from the start.
    """
    if all(all(each.plies) for each in plans):
        return None
    counts = [body.mesh.node_count for body in bodies]
    return np.repeat(~np.array(plan.plies, dtype=bool), counts)


def _of_nodes(table: SupportTable, kept: np.ndarray) -> SupportTable:
    """Return supports without the nodes that are not kept (node_count,)."""
    chosen = kept[table.node]
    return table._replace(
        node=table.node[chosen],
        group=table.group[chosen],
        anchor=np.ascontiguousarray(table.anchor[:, chosen]),
    )


def _require_gripped(model: StagedModel, plan: StagePlan, grippers: Sequence[Gripper]) -> None:
    """Refuse a gripper that pulls at a ply that is not there, or has nothing to hold.

    One that holds takes up the nodes of a ply when that is laid down.
    """
    waiting = [body for body, there in zip(model.bodies, plan.plies, strict=True) if not there]
    for grip in model.grips:
        entry = _entry(grip, grippers)
        if not plan.grippers[entry]:
            continue
        key = f'grippers[{entry}] "{grip.settings.name}"'
        absent = np.zeros(grip.nodes.size, dtype=bool)
        for body in waiting:
            last = body.first_node + body.mesh.node_count
            own = (grip.nodes >= body.first_node) & (grip.nodes < last)
            absent |= own
            if own.any() and grip.settings.pulls:
                raise InputError(
                    f'pulls at "{body.name}" too, which is not there yet in the stage '
                    f'"{plan.stage.name}"; name the ply that it pulls at, or the stages from '
                    "which on that one is there",
                    key=f"{key}.ply",
                )
        if absent.all():
            raise InputError(
                f'grips no ply that is there in the stage "{plan.stage.name}"; name the stages in '
                "which it is at work",
                key=f"{key}.stages",
            )


def _entry(grip: Grip, grippers: Sequence[Gripper]) -> int:
    """Return the number of the scene entry that a gripper was made from."""
    return next(number for number, entry in enumerate(grippers) if entry is grip.settings)


def _tools_in_stage(tools: ToolTable, plan: StagePlan) -> ToolTable:
    """Return the tools with their motions in a stage; travels count along the line of each tool."""
    rows = [_motion_in_stage(tools, tool, plan) for tool in range(tools.kind.size)]
    if not rows:
        return tools
    columns = {
        name: np.array([row[name] for row in rows], dtype=getattr(tools, name).dtype)
        for name in MOTION_COLUMNS
    }
    lengths = [len(row["table_times"]) for row in rows]
    return tools._replace(
        **columns,
        direction=np.array([row["direction"] for row in rows], dtype=float),
        table_start=np.cumsum([0, *lengths], dtype=np.int64),
        table_times=np.concatenate([np.zeros(0), *(row["table_times"] for row in rows)]),
        table_travels=np.concatenate([np.zeros(0), *(row["table_travels"] for row in rows)]),
    )


def _motion_in_stage(tools: ToolTable, tool: int, plan: StagePlan) -> dict[str, Any]:
    """Return the entries of a tool's motion in a stage, with the times of the process."""
    motion, axis = plan.motions[tool], plan.axes[tool]
    local = tools.direction[tool] if axis is None else axis
    key = f"stages.{plan.stage.name}.motions"
    row = motion.table_entries(local, plan.time, key=key)
    if motion.kind == FIXED and axis is not None:
        # it stays where it has come to: a table with one place
        return motion.columns(
            axis, motion_kind=PRESCRIBED, stroke_profile=TABULATED,
            table_times=np.array([plan.start]), table_travels=np.zeros(1),
        )  # fmt: skip
    if motion.kind == FIXED or axis is None:
        return row
    sign = -1.0 if row["direction"] @ axis < 0.0 else 1.0  # a turn has no direction
    return row | {
        "direction": axis,
        "force": sign * row["force"],
        "gravity_along": sign * row["gravity_along"],
        "load_start": plan.load_starts[tool],
        "stop": sign * row["stop"],
        "stroke_distance": sign * row["stroke_distance"],
        "stroke_start": plan.start + row["stroke_start"],
        "stroke_end": plan.start + row["stroke_end"],
        "table_times": plan.start + row["table_times"],
        "table_travels": sign * row["table_travels"],
    }


def _pulls_in_stage(
    table: GripperTable, works: np.ndarray, begin: np.ndarray, ramp: np.ndarray
) -> GripperTable:
    """Return the grippers that pull, without force where they are not at work."""

    def of_those(values: np.ndarray, otherwise: float) -> np.ndarray:
        return np.where(works, values, otherwise)

    return table._replace(
        begin=begin,
        ramp=ramp,
        force=of_those(table.force, 0.0),
        stiffness=of_those(table.stiffness, 0.0),
        largest=of_those(table.largest, 0.0),
        release_time=of_those(table.release_time, np.inf),
        release_force=of_those(table.release_force, np.inf),
        release_travel=of_those(table.release_travel, np.inf),
    )


def _supports_in_stage(
    table: SupportTable | None,
    plan: StagePlan,
    first: int,
    holding: Sequence[Grip],
    works: Sequence[bool],
    grippers: Sequence[Gripper],
) -> SupportTable | None:
    """Return the supports with the motions of a stage, which count from where the nodes are then.

    first : number of the first support of a gripper. works : whether each gripper is at work.
    """
    if table is None:
        return None
    times = np.linspace(0.0, plan.time, TABLE_SIZE)
    affine, slope = np.zeros_like(table.affine), np.zeros_like(table.slope)
    affine[:] = np.eye(3, 4)
    release_time, release_force = table.release_time.copy(), table.release_force.copy()
    for group, (grip, working) in enumerate(zip(holding, works, strict=True), start=first):
        led = motion_of_grip(plan.grip_motions[_entry(grip, grippers)], plan.time)
        if led is not None:
            affine[group] = [led(time) for time in times]
            slope[group] = np.gradient(affine[group], axis=0, edge_order=2)
            slope[group, 0] = 0.0  # everything starts at rest
        if not working:
            release_time[group] = release_force[group] = np.inf
    return table._replace(
        start=plan.start,
        interval=plan.time / (TABLE_SIZE - 1),
        affine=affine,
        slope=slope,
        release_time=release_time,
        release_force=release_force,
    )


def _pressures_in_stage(
    face: FacePressure | RegionalPressure,
    pressures: Sequence[PressureOnFace],
    plan: StagePlan,
    bodies: Sequence[Body],
) -> FacePressure | RegionalPressure:
    """Return the pressures of a stage; those of an entry count from when it came to work.

    The outer faces are those of the plies that are there.
    """
    tables = []
    for entry, works, (begin, time) in zip(
        pressures, plan.pressures, plan.pressure_begins, strict=True
    ):
        if works:
            times, values = entry.table(time)
            tables.append((begin + times, values))
        else:
            tables.append((np.array([plan.start]), np.zeros(1)))
    times, values = common_times(tables)
    elements = face.elements
    if not all(plan.plies):
        there = [body for body, is_there in zip(bodies, plan.plies, strict=True) if is_there]
        elements = elements.with_outer_faces_of(there)
    if isinstance(face, RegionalPressure):
        share = face.entry_shares
        if elements is not face.elements:
            share = regional_shares(pressures, bodies, elements, plan.pressures)
        return RegionalPressure.of_shares(elements, share, times, values)
    faces = [entry.face for entry in pressures]
    return FacePressure.of_entries(elements, faces, times, values)


def _settled(
    plan: StagePlan,
    tools: ToolTable,
    pulls: GripperTable | None,
    face: FacePressure | RegionalPressure | None,
) -> float:
    """Return when all motions and loads of a stage have come to their end [s]."""
    ends = [plan.start]
    for tool, kind in enumerate(tools.motion_kind.tolist()):
        if kind == GUIDED:
            ends.append(float(tools.load_start[tool] + tools.ramp[tool]))
        elif tools.stroke_profile[tool] == TABULATED and kind == PRESCRIBED:
            ends.append(float(tools.table_times[tools.table_start[tool + 1] - 1]))
        elif kind == PRESCRIBED:
            ends.append(float(tools.stroke_end[tool]))
    for motion in plan.grip_motions:
        if isinstance(motion, TableMotion):
            ends.append(plan.start + motion.times[-1])
        elif isinstance(motion, StrokeMotion | TurnMotion) and motion.moves:
            ends.append(plan.start + (plan.time if motion.end is None else motion.end))
    if pulls is not None:
        ends.append(float((pulls.begin + pulls.ramp).max()))
    if face is not None:
        ends.append(float(face.times[-1]))
    return min(max(ends), plan.end)
