"""Scene table of the stages of a process, and what the other tables are in each of them.

A stage is a time with motions of its own, and with the tools, grippers, pressures and interfaces
that are at work in it. The borders of stages are known before a run: a stage that ends at rest
passes what is left of its time without steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, PrivateAttr
from pydantic_core import PydanticCustomError

from lcmchain.effects.grippers import require_leading
from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Name,
    Number,
    PositiveTime,
    Range,
    Rate,
    SceneModel,
    Switch,
    no_such,
    wrong,
)
from lcmchain.scene.plies import PlySettings, Stack
from lcmchain.scene.process import (
    AVERAGING_PART,
    DAMPING_TIMES_TIME,
    FOUND_TIME,
    found_time,
    why_time_is_needed,
)
from lcmchain.scene.resin_stages import (
    require_no_places_of_stages,
    require_resin,
    with_places_of_stages,
)
from lcmchain.tools.motion import (
    GUIDED,
    FixedMotion,
    Motion,
    StrokeMotion,
    TableMotion,
    TurnMotion,
)
from lcmchain.tools.motion.travel import travel_along

#: Straight pieces of a smooth stroke in the course over all stages, which checks and pictures use.
PIECES = 32
#: Directions whose unit vectors differ by less than this are one.
PARALLEL = 1e-9
#: Lists of entries that may be at work in some stages alone, and what one of them is called.
LISTS = {
    "tools": "tool", "grippers": "gripper", "pressure": "pressure", "interfaces": "interface",
    "plies": "ply",
}  # fmt: skip


class Stage(SceneModel):
    """A stage of the process: its time, and what moves in it."""

    name: Annotated[str, Name("close")] = Field(description="Name in results and messages.")
    time: Annotated[PositiveTime, AbsentMeans(FOUND_TIME)] = Field(
        default=None,  # type: ignore[assignment]  # filled in before anybody reads it
        validate_default=False,
        description="How long it takes. Left out where a stroke leads the sheet, it is found as "
        "process.time is.",
    )
    motions: Annotated[dict[Annotated[str, Name("punch")], Motion], AbsentMeans("")] = Field(
        default_factory=dict,
        description="By the name of a tool or of a gripper that holds: how it moves, from where it "
        "is when the stage begins; times count from there too.",
    )
    mass_damping: Annotated[Rate | None, AbsentMeans("process.mass_damping")] = Field(
        default=None, description="Mass-proportional damping in this stage."
    )
    rest: Switch = Field(
        default=False,
        description="Whether the sheet comes to rest here: it is stopped wherever its kinetic "
        "energy has a peak, and the stage ends when it is at rest, at the latest after its time.",
    )
    rest_energy: Annotated[float, Number(1e-4, Range(0.0, 0.1, (0.0,)))] = Field(
        default=1e-4,
        description="A sheet is at rest whose kinetic energy stays below this part of the energy "
        "that was stored when the motions of the stage had ended.",
    )
    resin_time: Annotated[PositiveTime | None, AbsentMeans("part of infiltration.time")] = Field(
        default=None,
        description="What it takes for a resin that flows while the sheet is formed "
        "(infiltration.with_forming). Stages without it share what is left of infiltration.time "
        "by their times.",
    )
    springback_from: Annotated[
        Annotated[str, Name("close")] | None, AbsentMeans("the stage before")
    ] = Field(
        default=None,
        description="Of a stage that ends at rest: the stage at whose end the part has the shape "
        "that the springback is measured from.",
    )

    _found: bool = PrivateAttr(default=False)

    @property
    def time_is_found(self) -> bool:
        """Whether the scene gives no time for it."""
        return self._found


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
    motions: tuple[Any, ...]
    load_starts: tuple[float, ...]
    axes: tuple[Any, ...]
    grip_motions: tuple[Any, ...]
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


def at_work(entry: Any, stage: Stage) -> bool:
    """Tell whether an entry of the scene is at work in a stage."""
    return entry.stages is None or stage.name in entry.stages


def laid_later(scene: Any) -> tuple[PlySettings, ...]:
    """Return the plies of a scene that are not there from the start."""
    if not scene.stages:
        return ()
    return tuple(ply for ply in scene.stack if not at_work(ply, scene.stages[0]))


def stack_at(scene: Any, time: float) -> Stack:
    """Return the plies of a scene that are there at a time [s] of the process."""
    if not laid_later(scene):
        return scene.stack
    stage = scene.stages[stage_at(scene, time)]
    return Stack(tuple(ply for ply in scene.stack if at_work(ply, stage)))


def first_stage(scene: Any, ply: PlySettings) -> str:
    """Return the name of the stage that a ply is laid down in."""
    return next(stage.name for stage in scene.stages if at_work(ply, stage))


def plies_there(scene: Any, times: Sequence[float] | np.ndarray) -> dict[str, np.ndarray]:
    """Return whether each ply that is laid down later is there at the times [s], by its name."""
    later = laid_later(scene)
    stages = [scene.stages[stage_at(scene, time)] for time in times] if later else []
    return {ply.name: np.array([at_work(ply, stage) for stage in stages]) for ply in later}


def stage_at(scene: Any, time: float) -> int:
    """Return the number of the stage that a time of the process belongs to; a border to the end."""
    return number_at(list(accumulate(stage.time for stage in scene.stages)), time)


def number_at(ends: Sequence[float], time: float) -> int:
    """Return the number of the stage of a time [s]; a border belongs to the one that ends there."""
    return min(int(np.searchsorted(ends, time * (1.0 - 1e-12))), len(ends) - 1)


def number_of_stage(scene: Any, name: str, *, key: str) -> int:
    """Return the number of a stage.

    Raises
    ------
    InputError : there is none of this name; names the key.
    """
    names = [stage.name for stage in scene.stages]
    if name not in names:
        raise InputError(_no_such(name, names, "stage"), key=key)
    return names.index(name)


def frame_times(scene: Any) -> np.ndarray:
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


# --- checks and completion ------------------------------------------------------------------------


def require_no_stages(scene: Any) -> None:
    """Refuse entries that name stages in a scene without any."""
    require_no_places_of_stages(scene)
    for key, entry in _entries(scene):
        if entry.stages is not None:
            raise wrong(
                f'names "{entry.stages[0]}", but the scene has no [[stages]]; leave it out, or '
                "describe the stages",
                field=f"{key}.stages",
            )


def completed_stages(scene: Any) -> dict[str, Any]:
    """Return the tables of a scene with stages, with what the stages say filled in.

    Times are found where they are left out. Tools have their course over all stages as a table of
    travel over time, which checks and pictures read: what a run does is in :func:`stage_plans`.

    Raises
    ------
    PydanticCustomError : entries that contradict each other; names the key.
    """
    process, stages = scene.process, scene.stages
    if process.time is not None:
        raise wrong(
            f"is {process.time:g} s, but [[stages]] have times of their own; leave it out",
            field="process.time",
        )
    if process.frames <= len(stages):
        raise wrong(
            f"is {process.frames}, but the start and the end of each of {len(stages)} stages are "
            f"frames; give at least {len(stages) + 1}",
            field="process.frames",
        )
    _require_names(scene)
    _require_plies(scene)
    _require_motions(scene)
    require_resin(scene)
    done = tuple(_completed(scene, number) for number in range(len(stages)))
    time = math.fsum(stage.time for stage in done)
    found = [stage for stage in done if stage.time_is_found]
    if not found and process.quasi_static != 1.0:
        raise wrong(
            f"is {process.quasi_static:g}, but the times of all stages are given; leave it out",
            field="process.quasi_static",
        )
    staged = scene.model_copy(update={"stages": done})
    damping = [_damping(process, stage) for stage in done]
    changed: dict[str, Any] = {"time": time, "mass_damping": max(rate for rate, _ in damping)}
    averaged = [over for _, over in damping if math.isfinite(over)]
    if averaged:
        changed["damping_average"] = max(averaged)
    tools = []
    for number, tool in enumerate(scene.tools):
        key = f'tools[{number}] "{tool.name}"'
        if found:
            tool = tool.without_time(time, key=key)
        tool = tool.model_copy(update={"motion": _course(staged, number)})
        tools.append(tool.completed(scene.contact.friction, time, key=key))
    grippers = []
    for number, gripper in enumerate(scene.grippers):
        key = f'grippers[{number}] "{gripper.name}"'
        if found:
            gripper = gripper.without_time(time, key=key)
        grippers.append(gripper.completed(time, key=key))
    return {
        "process": process.model_copy(update=changed),
        "stages": done,
        "tools": tuple(tools),
        "grippers": tuple(grippers),
        **with_places_of_stages(staged, time),
    }


def stage_plans(scene: Any, written: Any) -> tuple[StagePlan, ...]:
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
            own = stage.motions.get(tool.name)
            works = at_work(tool, stage)
            motion = own or (tool.motion if works else FixedMotion())
            before = plans[-1] if plans else None
            goes_on = (
                own is None and before is not None and before.motions[index] is motion
                and before.tools[index]
            )  # fmt: skip
            motions.append(motion)
            load_starts.append(before.load_starts[index] if goes_on and before else start)
        # of the process as written: that of the scene by now has the largest rate of all stages
        rate, averaging = _damping(written["process"], stage)
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
    entry: Any, stages: Sequence[Stage], starts: Sequence[float], number: int
) -> tuple[float, float]:
    """Return when the run of stages began in which an entry is at work, and its first stage's time.

    number : of the present stage.
    """
    first = number
    while first > 0 and at_work(entry, stages[first]) and at_work(entry, stages[first - 1]):
        first -= 1
    return starts[first], starts[first + 1] - starts[first]


def _damping(process: Any, stage: Stage) -> tuple[float, float]:
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


def _entries(scene: Any) -> Iterator[tuple[str, Any]]:
    """Yield every entry that may be at work in some stages alone, behind its key."""
    for name in LISTS:
        for number, entry in enumerate(getattr(scene, name)):
            called = f' "{entry.name}"' if hasattr(entry, "name") else ""
            yield f"{name}[{number}]{called}", entry


def _key(scene: Any, number: int) -> str:
    return f'stages[{number}] "{scene.stages[number].name}"'


def _require_names(scene: Any) -> None:
    """Refuse stages, tools and grippers that are not there."""
    names = [stage.name for stage in scene.stages]
    for key, entry in _entries(scene):
        for name in entry.stages or ():
            if name not in names:
                raise wrong(_no_such(name, names, "stage"), field=f"{key}.stages")
        if entry.stages is not None and len(set(entry.stages)) < len(entry.stages):
            twice = next(name for name in entry.stages if entry.stages.count(name) > 1)
            raise wrong(f'names "{twice}" twice; name every stage once', field=f"{key}.stages")
    movable = [entry.name for entry in (*scene.tools, *scene.grippers)]
    for number, stage in enumerate(scene.stages):
        for name in stage.motions:
            if name not in movable:
                key = f"{_key(scene, number)}.motions.{name}"
                raise wrong(_no_such(name, movable, "tool or gripper"), field=key)


def _require_plies(scene: Any) -> None:
    """Refuse plies that go again or are the first to come, and loads on one before it is there."""
    names = [stage.name for stage in scene.stages]
    for number, ply in enumerate(scene.plies):
        own = ply.stages or names
        following = names[min(names.index(name) for name in own) :]
        if missing := [name for name in following if name not in own]:
            raise wrong(
                f'leaves out "{missing[0]}", but a ply that has been laid down stays: name all '
                f"stages from its first one on, {_quoted(following)}",
                field=f'plies[{number}] "{ply.name}".stages',
            )
    later = {ply.name: ply for ply in laid_later(scene)}
    if later and len(later) == len(scene.stack):
        raise wrong(
            f'names "{scene.stack[0].stages[0]}", but no ply is there in the stage "{names[0]}", '
            "with which the process begins; leave stages out of one that is",
            field=f"{scene.stack[0].key}.stages",
        )
    for kind in ("pressure", "grippers"):
        for number, entry in enumerate(getattr(scene, kind)):
            ply = later.get(entry.ply)
            before = [s for s in scene.stages if ply and at_work(entry, s) and not at_work(ply, s)]
            if ply is not None and before:
                raise wrong(
                    f'is at work in "{before[0].name}", but its ply "{ply.name}" is laid down '
                    f"later; give stages = [{_quoted(ply.stages or ())}], or some of them",
                    field=f'{kind}[{number}] "{entry.name}".stages',
                )


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _no_such(name: str, known: Sequence[str], what: str) -> str:
    return f'names "{name}", {no_such(name, known, what)}'


def _require_motions(scene: Any) -> None:
    """Refuse motions that stand in the wrong place, or that their tool cannot make."""
    first = scene.stages[0].name
    for kind in ("tools", "grippers"):
        for number, entry in enumerate(getattr(scene, kind)):
            key = f'{kind}[{number}] "{entry.name}"'
            if isinstance(entry.motion, StrokeMotion | TableMotion | TurnMotion):
                raise wrong(
                    f"is a {entry.motion.type}, but the scene has stages: write it in the stage in "
                    f"which it happens, as stages.{first}.motions.{entry.name}",
                    field=f"{key}.motion",
                )
    holding = {gripper.name: gripper for gripper in scene.grippers}
    for number, stage in enumerate(scene.stages):
        key = _key(scene, number)
        if stage.rest and stage.mass_damping is not None:
            raise wrong(
                "stands beside rest = true, which stops the sheet wherever its kinetic energy has "
                "a peak; leave one of them out",
                field=f"{key}.mass_damping",
            )
        for entry in ("rest_energy", "springback_from"):
            if entry in stage.model_fields_set and not stage.rest:
                raise wrong("belongs to rest = true", field=f"{key}.{entry}")
        before = [earlier.name for earlier in scene.stages[:number]]
        if stage.springback_from is not None and stage.springback_from not in before:
            raise wrong(
                _no_such(stage.springback_from, before, "stage before this one"),
                field=f"{key}.springback_from",
            )
        for entry in (*scene.tools, *scene.grippers):
            if entry.name not in stage.motions:
                continue
            of_it = f"{key}.motions.{entry.name}"
            if not at_work(entry, stage) and entry.name not in holding:
                raise wrong(
                    f'moves the tool "{entry.name}", which is not at work in this stage; add '
                    f'"{stage.name}" to its stages, or leave the motion out',
                    field=of_it,
                )
            if entry.name in holding:
                _require_led(entry, stage, of_it)
    for number, tool in enumerate(scene.tools):
        _require_one_axis(scene, number, tool)


def _require_led(gripper: Any, stage: Stage, key: str) -> None:
    motion = stage.motions[gripper.name]
    if not at_work(gripper, stage):
        raise wrong(
            f'leads by the gripper "{gripper.name}", which is not at work in this stage; add '
            f'"{stage.name}" to its stages, or leave the motion out',
            field=key,
        )
    if motion.kind == GUIDED:
        raise wrong("is guided; a gripper is led by a stroke or a table", field=f"{key}.type")
    require_leading(motion, key)
    if motion.moves and gripper.hold != "xyz":
        raise wrong(f'leads the gripper "{gripper.name}"; give it hold = "xyz"', field=key)


def _directions(tool: Any, stages: Sequence[Stage]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the directions of all motions of a tool, with the name of the stage; "" for its own."""
    named = [("", tool.motion), *((s.name, s.motions.get(tool.name)) for s in stages)]
    for name, motion in named:
        direction = getattr(motion, "direction", None)
        if direction is not None:
            vector = np.array(direction, dtype=float)
            yield name, vector / np.linalg.norm(vector)


def _axis(tool: Any, stages: Sequence[Stage]) -> np.ndarray | None:
    """Return the direction along which the travel of a tool counts, None where it never moves."""
    if _turns(tool, stages):
        return np.zeros(3)
    return next((direction for _, direction in _directions(tool, stages)), None)


def _turns(tool: Any, stages: Sequence[Stage]) -> list[tuple[str, TurnMotion]]:
    """Return the turns of a tool, each behind the name of its stage."""
    named = [(stage.name, stage.motions.get(tool.name)) for stage in stages]
    return [(name, motion) for name, motion in named if isinstance(motion, TurnMotion)]


def _require_one_turn(scene: Any, tool: Any) -> None:
    """Refuse a tool that turns about several axes, or goes along a line as well."""
    turns = _turns(tool, scene.stages)
    for name, _ in _directions(tool, scene.stages) if turns else ():
        key = f"stages.{name}.motions.{tool.name}" if name else f"tools.{tool.name}.motion"
        raise wrong(
            f'moves "{tool.name}" along a line, but in stages.{turns[0][0]} it turns; give a '
            "second tool of the same shape for one of them",
            field=f"{key}.type",
        )
    for name, turn in turns:
        first = turns[0][1]
        axes = [np.array(motion.axis) / np.linalg.norm(motion.axis) for motion in (first, turn)]
        if np.abs(axes[0] - axes[1]).max() > PARALLEL or turn.point != first.point:
            raise wrong(
                f'turns "{tool.name}" about another axis than before; give the axis and point of '
                f"stages.{turns[0][0]} (a negative angle turns back), or a second tool of the same "
                "shape",
                field=f"stages.{name}.motions.{tool.name}.axis",
            )


def _require_one_axis(scene: Any, number: int, tool: Any) -> None:
    _require_one_turn(scene, tool)
    found = list(_directions(tool, scene.stages))
    for name, direction in found:
        if abs(abs(direction @ found[0][1]) - 1.0) > PARALLEL:
            raise wrong(
                f'moves "{tool.name}" along another line than before: the travel of a tool counts '
                "along one line over all stages, either way; give a second tool of the same shape "
                "for another line",
                field=f"stages.{name}.motions.{tool.name}.direction",
            )


def _completed(scene: Any, number: int) -> Stage:
    """Return a stage with its time, and its motions with their times."""
    stage, key = scene.stages[number], _key(scene, number)
    time = stage.time
    strokes = [m for m in stage.motions.values() if isinstance(m, StrokeMotion)]
    if time is None:
        time = _found_time(scene, stage, strokes, key)
    motions = {}
    for name, motion in stage.motions.items():
        of_it = f"{key}.motions.{name}"
        try:
            timed = motion if stage.time is not None else motion.without_time(time, key=of_it)
            motions[name] = timed.completed(time, key=of_it)
        except PydanticCustomError as error:
            context = error.context or {}
            text = str(context.get("message", error))
            text = text.replace("process.time", f"stages.{stage.name}.time")
            raise wrong(
                text.replace("the process", "the stage"), field=context.get("field", of_it)
            ) from None
        if isinstance(motion, TableMotion) and motion.times[-1] > time * (1.0 + 1e-12):
            raise wrong(
                f"go on to {motion.times[-1]:g} s, after the end of the stage at {time:g} s; give "
                f"a longer stages.{stage.name}.time, or divide the table",
                field=f"{of_it}.times",
            )
    done = stage.model_copy(update={"time": time, "motions": motions})
    done._found = stage.time is None
    return done


def _found_time(scene: Any, stage: Stage, strokes: Sequence[StrokeMotion], key: str) -> float:
    """Return the time of a stage that gives none, at pace 1 [s]."""
    reason: str | None = 'no tool has a stroke in it; give time = "50 ms"'
    if strokes and not stage.rest:
        loads = tuple(entry for entry in scene.pressure if at_work(entry, stage))
        of_stage = scene.model_copy(update={"pressure": loads})
        reason = why_time_is_needed(of_stage, is_led=True)
        reason = None if reason is None else f'{reason}; give time = "200 ms"'
    elif strokes:
        reason = 'it ends at rest; give the time that this takes at most, time = "200 ms"'
    if reason is not None:
        raise wrong(f"is missing, and {reason}", field=f"{key}.time")
    stroke = max(motion.distance for motion in strokes)
    return max(
        found_time(scene.process, ply.blank.extent, ply.material.build(), stroke)
        for ply in scene.stack
    )


def _course(scene: Any, number: int) -> Any:
    """Return the motion of a tool over all stages, as far as it is known: a table, or as it is."""
    tool, stages = scene.tools[number], scene.stages
    guided = [m for s in stages if (m := s.motions.get(tool.name)) and m.kind == GUIDED]
    axis = _axis(tool, stages)
    if tool.motion.kind == GUIDED or axis is None:
        return tool.motion
    if guided:
        sign = 1.0 if np.array(guided[0].direction) @ axis > 0.0 else -1.0
        along = {"direction": tuple(axis.tolist()), "force": sign * guided[0].force}
        return guided[0].model_copy(update=along)
    start, gone = 0.0, 0.0
    times, travels = [0.0], [0.0]
    for stage in stages:
        motion = stage.motions.get(tool.name)
        if motion is not None and motion.moves:
            travel, sign = travel_along(motion, stage.time), 1.0
            if not isinstance(motion, TurnMotion) and np.array(motion.direction) @ axis < 0.0:
                sign = -1.0
            for time in _knots(motion, stage.time):
                times.append(start + time)
                travels.append(gone + sign * travel(time))
            gone = travels[-1]
        start += stage.time
    order = [k for k in range(len(times)) if k == 0 or times[k] > times[k - 1] + 1e-12 * start]
    turns = _turns(tool, stages)
    course = TableMotion(
        type="table",
        direction=(0.0, 0.0, 1.0) if turns else tuple(axis.tolist()),
        times=tuple(times[k] for k in order),
        travel=tuple(travels[k] for k in order),
    )
    own = [getattr(stage.motions.get(tool.name), "until_force", None) for stage in stages]
    if turns:
        course = course.about(turns[0][1].axis, turns[0][1].point)
    return course.at_most(min((force for force in own if force is not None), default=math.inf))


def _knots(motion: Any, time: float) -> list[float]:
    """Return times of a motion between which its travel is about linear [s]."""
    if isinstance(motion, TableMotion):
        return list(motion.times)
    end = time if motion.end is None else motion.end
    pieces = PIECES if motion.profile == "smooth" else 1
    return np.linspace(motion.start, end, pieces + 1).tolist()
