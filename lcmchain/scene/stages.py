"""What the tables of a scene are in each stage of the process.

The borders of stages are known before a run: a stage that ends at rest passes what is left of its
time without steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple, Protocol

import numpy as np

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import no_such
from lcmchain.scene.process import AVERAGING_PART, DAMPING_TIMES_TIME, Process, Stage
from lcmchain.scene.stack import PlySettings, Stack
from lcmchain.scene.tables import SceneTables
from lcmchain.tools.motion import (
    GUIDED,
    FixedMotion,
    GuidedMotion,
    Motion,
    StrokeMotion,
    TableMotion,
    TurnMotion,
)
from lcmchain.tools.motion.prescribed import travel_along
from lcmchain.tools.tool import Tool

#: Straight pieces of a smooth stroke in the course over all stages, which checks and pictures use.
PIECES = 32
#: Lists of entries that may be at work in some stages alone, and what one of them is called.
LISTS = {
    "tools": "tool", "grippers": "gripper", "pressure": "pressure", "interfaces": "interface",
    "plies": "ply",
}  # fmt: skip


class AtWorkInStages(Protocol):
    """An entry of a scene that may be at work in some stages alone; None stands for all."""

    @property
    def stages(self) -> tuple[str, ...] | None: ...


def at_work(entry: AtWorkInStages, stage: Stage) -> bool:
    """Tell whether an entry of the scene is at work in a stage."""
    return entry.stages is None or stage.name in entry.stages


def laid_later(scene: SceneTables) -> tuple[PlySettings, ...]:
    """Return the plies of a scene that are not there from the start."""
    if not scene.stages:
        return ()
    return tuple(ply for ply in scene.stack if not at_work(ply, scene.stages[0]))


def stack_at(scene: SceneTables, time: float) -> Stack:
    """Return the plies of a scene that are there at a time [s] of the process."""
    if not laid_later(scene):
        return scene.stack
    stage = scene.stages[stage_at(scene, time)]
    return Stack(tuple(ply for ply in scene.stack if at_work(ply, stage)))


def first_stage(scene: SceneTables, ply: PlySettings) -> str:
    """Return the name of the stage that a ply is laid down in."""
    return next(stage.name for stage in scene.stages if at_work(ply, stage))


def plies_there(scene: SceneTables, times: Sequence[float] | np.ndarray) -> dict[str, np.ndarray]:
    """Return whether each ply that is laid down later is there at the times [s], by its name."""
    later = laid_later(scene)
    stages = [scene.stages[stage_at(scene, time)] for time in times] if later else []
    return {ply.name: np.array([at_work(ply, stage) for stage in stages]) for ply in later}


def stage_at(scene: SceneTables, time: float) -> int:
    """Return the number of the stage that a time of the process belongs to; a border to the end."""
    return number_at(list(accumulate(stage.time for stage in scene.stages)), time)


def number_at(ends: Sequence[float], time: float) -> int:
    """Return the number of the stage of a time [s]; a border belongs to the one that ends there."""
    return min(int(np.searchsorted(ends, time * (1.0 - 1e-12))), len(ends) - 1)


def number_of_stage(scene: SceneTables, name: str, *, key: str) -> int:
    """Return the number of a stage.

    Raises
    ------
    InputError : there is none of this name; names the key.
    """
    names = [stage.name for stage in scene.stages]
    if name not in names:
        raise InputError(f'names "{name}", {no_such(name, names, "stage")}', key=key)
    return names.index(name)


def frame_times(scene: SceneTables) -> np.ndarray:
    """Return the times of the saved frames [s], evenly spaced in every stage, with its borders."""
    process = scene.process
    if not scene.stages:
        return np.linspace(0.0, process.time, process.frames)
    borders = np.array([0.0, *accumulate(stage.time for stage in scene.stages)])
    borders[-1] = process.time
    left = process.frames - 1
    wanted = np.diff(borders) * (left / process.time)
    counts = np.maximum(np.floor(wanted), 1).astype(int)
    while counts.sum() < left:  # to the stage that is furthest from its part
        counts[np.argmax(wanted - counts)] += 1
    while counts.sum() > left:
        counts[np.argmax(np.where(counts > 1, counts - wanted, -np.inf))] -= 1
    parts = [
        np.linspace(begin, end, count + 1)[1:]
        for begin, end, count in zip(borders, borders[1:], counts.tolist())
    ]
    return np.concatenate([[0.0], *parts])


# --- what a model needs to know of every stage ----------------------------------------------------


class StagePlan(NamedTuple):
    """What a model needs to know of a stage.

    stage : its table. start, end : [s] of the process.
    motions : of every tool, in the order of the scene.
    load_starts : when the load of each tool begins to come on, if it is guided [s].
    axes : direction of travel of every tool, a unit vector, or None where it never moves; of one
        that turns 0.
    grip_motions : of every gripper entry.
    tools, grippers, pressures, interfaces : whether each entry of the scene is at work.
    plies : whether each ply of the stack is there.
    begins : for the grippers and pressures, when the run of stages began in which they are at work
        now [s], and how long its first stage takes [s].
    mass_damping : [1/s]. averaging : time over which the motion is averaged that damping leaves
        alone [s], infinite where all motion is damped.
    """

    stage: Stage
    start: float
    end: float
    motions: tuple[Motion, ...]
    load_starts: tuple[float, ...]
    axes: tuple[np.ndarray | None, ...]
    grip_motions: tuple[Motion, ...]
    tools: tuple[bool, ...]
    grippers: tuple[bool, ...]
    pressures: tuple[bool, ...]
    interfaces: tuple[bool, ...]
    plies: tuple[bool, ...]
    gripper_begins: tuple[tuple[float, float], ...]
    pressure_begins: tuple[tuple[float, float], ...]
    mass_damping: float
    averaging: float

    @property
    def time(self) -> float:
        """How long the stage takes [s]."""
        return self.end - self.start


def stage_plans(scene: SceneTables, written: Mapping[str, Any]) -> tuple[StagePlan, ...]:
    """Return what a model needs to know of every stage.

    written : tables of the scene as they were before :func:`completed_stages`, by their names.
    """
    tools, grippers = written["tools"], scene.grippers
    stages, plies = scene.stages, scene.stack
    starts = [0.0, *accumulate(stage.time for stage in stages)]
    starts[-1] = scene.process.time
    plans: list[StagePlan] = []
    axes = tuple(_axis(tool, stages) for tool in tools)
    for number, stage in enumerate(stages):
        start, end = starts[number], starts[number + 1]
        motions, load_starts = [], []
        for index, tool in enumerate(tools):
            of_stage = stage.motions.get(tool.name)
            works = at_work(tool, stage)
            motion = of_stage or (tool.motion if works else FixedMotion())
            before = plans[-1] if plans else None
            goes_on = (
                of_stage is None and before is not None and before.motions[index] is motion
                and before.tools[index]
            )  # fmt: skip
            motions.append(motion)
            load_starts.append(before.load_starts[index] if goes_on and before else start)
        # of the process as written: that of the scene by now has the largest rate of all stages
        rate, averaging = damping_in(written["process"], stage)
        plans.append(
            StagePlan(
                stage, start, end, tuple(motions), tuple(load_starts), axes,
                tuple(stage.motions.get(gripper.name, FixedMotion()) for gripper in grippers),
                tools=tuple(at_work(tool, stage) for tool in tools),
                grippers=tuple(at_work(gripper, stage) for gripper in grippers),
                pressures=tuple(at_work(entry, stage) for entry in scene.pressure),
                interfaces=tuple(at_work(entry, stage) for entry in scene.interfaces),
                plies=tuple(at_work(ply, stage) for ply in plies),
                gripper_begins=tuple(_begin(g, stages, starts, number) for g in grippers),
                pressure_begins=tuple(_begin(p, stages, starts, number) for p in scene.pressure),
                mass_damping=rate,
                averaging=averaging,
            )
        )  # fmt: skip
    return tuple(plans)


def _begin(
    entry: AtWorkInStages, stages: Sequence[Stage], starts: Sequence[float], number: int
) -> tuple[float, float]:
    """Return when the run of stages began in which an entry is at work, and its first stage's time.

    number : of the present stage.
    """
    first = number
    while first > 0 and at_work(entry, stages[first]) and at_work(entry, stages[first - 1]):
        first -= 1
    return starts[first], starts[first + 1] - starts[first]


def damping_in(process: Process, stage: Stage) -> tuple[float, float]:
    """Return the rate of the mass damping in a stage [1/s], and the time of its averaging [s]."""
    averaging = process.damping_average
    if averaging is None:
        averaging = AVERAGING_PART * stage.time if stage.time_is_found else math.inf
    if stage.rest:
        return 0.0, math.inf
    if stage.mass_damping is not None:
        return stage.mass_damping, averaging
    if stage.time_is_found and "mass_damping" not in process.model_fields_set:
        return DAMPING_TIMES_TIME / stage.time, averaging
    return process.mass_damping, averaging


# --- the line of a tool over all stages -----------------------------------------------------------


def directions_of(tool: Tool, stages: Sequence[Stage]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the directions of all motions of a tool, with the name of the stage; "" for its own."""
    named = [("", tool.motion), *((s.name, s.motions.get(tool.name)) for s in stages)]
    for name, motion in named:
        direction = getattr(motion, "direction", None)
        if direction is not None:
            vector = np.array(direction, dtype=float)
            yield name, vector / np.linalg.norm(vector)


def _axis(tool: Tool, stages: Sequence[Stage]) -> np.ndarray | None:
    """Return the direction along which the travel of a tool counts, None where it never moves."""
    if turns_of(tool, stages):
        return np.zeros(3)
    return next((direction for _, direction in directions_of(tool, stages)), None)


def turns_of(tool: Tool, stages: Sequence[Stage]) -> list[tuple[str, TurnMotion]]:
    """Return the turns of a tool, each behind the name of its stage."""
    named = [(stage.name, stage.motions.get(tool.name)) for stage in stages]
    return [(name, motion) for name, motion in named if isinstance(motion, TurnMotion)]


def course_of(scene: SceneTables, number: int) -> Motion:
    """Return the motion of a tool over all stages, as far as it is known: a table, or as it is."""
    tool, stages = scene.tools[number], scene.stages
    of_tool = [stage.motions.get(tool.name) for stage in stages]
    guided = [motion for motion in of_tool if isinstance(motion, GuidedMotion)]
    axis = _axis(tool, stages)
    if tool.motion.kind == GUIDED or axis is None:
        return tool.motion
    if guided:
        sign = 1.0 if np.array(guided[0].direction) @ axis > 0.0 else -1.0
        along = {"direction": tuple(axis.tolist()), "force": sign * guided[0].force}
        return guided[0].model_copy(update=along)
    start, gone = 0.0, 0.0
    times, travels = [0.0], [0.0]
    for stage, motion in zip(stages, of_tool, strict=True):
        if isinstance(motion, StrokeMotion | TableMotion | TurnMotion) and motion.moves:
            travel, sign = travel_along(motion, stage.time), 1.0
            if not isinstance(motion, TurnMotion) and np.array(motion.direction) @ axis < 0.0:
                sign = -1.0
            for time in _knots(motion, stage.time):
                times.append(start + time)
                travels.append(gone + sign * travel(time))
            gone = travels[-1]
        start += stage.time
    order = [k for k in range(len(times)) if k == 0 or times[k] > times[k - 1] + 1e-12 * start]
    turns = turns_of(tool, stages)
    course = TableMotion(
        type="table",
        direction=(0.0, 0.0, 1.0) if turns else tuple(axis.tolist()),
        times=tuple(times[k] for k in order),
        travel=tuple(travels[k] for k in order),
    )
    forces = [getattr(motion, "until_force", None) for motion in of_tool]
    if turns:
        course = course.about(turns[0][1].axis, turns[0][1].point)
    return course.at_most(min((force for force in forces if force is not None), default=math.inf))


def _knots(motion: StrokeMotion | TableMotion | TurnMotion, time: float) -> list[float]:
    """Return times of a motion between which its travel is about linear [s]."""
    if isinstance(motion, TableMotion):
        return list(motion.times)
    end = time if motion.end is None else motion.end
    pieces = PIECES if motion.profile == "smooth" else 1
    return np.linspace(motion.start, end, pieces + 1).tolist()
