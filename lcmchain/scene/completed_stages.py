"""Stages completed: times that are left out, motions with their times, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from lcmchain.effects.grippers import Gripper, require_leading
from lcmchain.quantities.entry_types import (
    no_such,
    wrong,
)
from lcmchain.scene.pace import why_time_is_needed
from lcmchain.scene.process import Stage, found_time
from lcmchain.scene.resin_stages import (
    require_no_places_of_stages,
    require_resin,
    with_places_of_stages,
)
from lcmchain.scene.stages import (
    LISTS,
    AtWorkInStages,
    at_work,
    course_of,
    damping_in,
    directions_of,
    laid_later,
    turns_of,
)
from lcmchain.scene.tables import SceneTables
from lcmchain.tools.motion import (
    StrokeMotion,
    TableMotion,
    TurnMotion,
)
from lcmchain.tools.tool import Tool

#: Directions whose unit vectors differ by less than this are one.
PARALLEL = 1e-9


def require_no_stages(scene: SceneTables) -> None:
    """Refuse entries that name stages in a scene without any."""
    require_no_places_of_stages(scene)
    for key, entry in _entries(scene):
        if entry.stages is not None:
            raise wrong(
                f'names "{entry.stages[0]}", but the scene has no [[stages]]; leave it out, or '
                "describe the stages",
                field=f"{key}.stages",
            )


def completed_stages(scene: SceneTables) -> dict[str, Any]:
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
    without_time = [stage for stage in done if stage.time_is_found]
    if not without_time and process.quasi_static != 1.0:
        raise wrong(
            f"is {process.quasi_static:g}, but the times of all stages are given; leave it out",
            field="process.quasi_static",
        )
    staged = scene.model_copy(update={"stages": done})
    damping = [damping_in(process, stage) for stage in done]
    changed: dict[str, Any] = {"time": time, "mass_damping": max(rate for rate, _ in damping)}
    averaged = [over for _, over in damping if math.isfinite(over)]
    if averaged:
        changed["damping_average"] = max(averaged)
    tools = []
    for number, tool in enumerate(scene.tools):
        key = f'tools[{number}] "{tool.name}"'
        if without_time:
            tool = tool.without_time(time, key=key)
        tool = tool.model_copy(update={"motion": course_of(staged, number)})
        tools.append(tool.completed(scene.contact.friction, time, key=key))
    grippers = []
    for number, gripper in enumerate(scene.grippers):
        key = f'grippers[{number}] "{gripper.name}"'
        if without_time:
            gripper = gripper.without_time(time, key=key)
        grippers.append(gripper.completed(time, key=key))
    return {
        "process": process.model_copy(update=changed),
        "stages": done,
        "tools": tuple(tools),
        "grippers": tuple(grippers),
        **with_places_of_stages(staged, time),
    }


def _completed(scene: SceneTables, number: int) -> Stage:
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


def _found_time(
    scene: SceneTables, stage: Stage, strokes: Sequence[StrokeMotion], key: str
) -> float:
    """Return the time of a stage that gives none, at pace 1 [s]."""
    reason: str | None = 'no tool has a stroke in it; give time = "50 ms"'
    if strokes and not stage.rest:
        loads = tuple(entry for entry in scene.pressure if at_work(entry, stage))
        of_stage = scene.model_copy(update={"pressure": loads})
        reason = why_time_is_needed(of_stage, led=True)
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


# --- what is refused ------------------------------------------------------------------------------


def _entries(scene: SceneTables) -> Iterator[tuple[str, AtWorkInStages]]:
    """Yield every entry that may be at work in some stages alone, behind its key."""
    for name in LISTS:
        for number, entry in enumerate(getattr(scene, name)):
            called = f' "{entry.name}"' if hasattr(entry, "name") else ""
            yield f"{name}[{number}]{called}", entry


def _key(scene: SceneTables, number: int) -> str:
    return f'stages[{number}] "{scene.stages[number].name}"'


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _no_such(name: str, known: Sequence[str], what: str) -> str:
    return f'names "{name}", {no_such(name, known, what)}'


def _require_names(scene: SceneTables) -> None:
    """Refuse stages, tools and grippers that are not there."""
    names = [stage.name for stage in scene.stages]
    for key, entry in _entries(scene):
        for name in entry.stages or ():
            if name not in names:
                raise wrong(_no_such(name, names, "stage"), field=f"{key}.stages")
        if entry.stages is not None and len(set(entry.stages)) < len(entry.stages):
            twice = next(name for name in entry.stages if entry.stages.count(name) > 1)
            raise wrong(f'names "{twice}" twice; name every stage once', field=f"{key}.stages")
    movable = [tool.name for tool in scene.tools] + [grip.name for grip in scene.grippers]
    for number, stage in enumerate(scene.stages):
        for name in stage.motions:
            if name not in movable:
                key = f"{_key(scene, number)}.motions.{name}"
                raise wrong(_no_such(name, movable, "tool or gripper"), field=key)


def _require_plies(scene: SceneTables) -> None:
    """Refuse plies that go again or are the first to come, and loads on one before it is there."""
    names = [stage.name for stage in scene.stages]
    for number, ply in enumerate(scene.plies):
        there = ply.stages or names
        following = names[min(names.index(name) for name in there) :]
        if missing := [name for name in following if name not in there]:
            raise wrong(
                f'leaves out "{missing[0]}", but a ply that has been laid down stays: name all '
                f"stages from its first one on, {_quoted(following)}",
                field=f'plies[{number}] "{ply.name}".stages',
            )
    later = {ply.name: ply for ply in laid_later(scene)}
    if later and len(later) == len(scene.stack):
        raise wrong(
            f'names "{(scene.stack[0].stages or names)[0]}", but no ply is there in the stage '
            f'"{names[0]}", '
            "with which the process begins; leave stages out of one that is",
            field=f"{scene.stack[0].key}.stages",
        )
    for kind in ("pressure", "grippers"):
        for number, entry in enumerate(getattr(scene, kind)):
            loaded = later.get(entry.ply)
            if loaded is None:
                continue
            before = [s for s in scene.stages if at_work(entry, s) and not at_work(loaded, s)]
            if before:
                raise wrong(
                    f'is at work in "{before[0].name}", but its ply "{loaded.name}" is laid down '
                    f"later; give stages = [{_quoted(loaded.stages or ())}], or some of them",
                    field=f'{kind}[{number}] "{entry.name}".stages',
                )


def _require_motions(scene: SceneTables) -> None:
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
    for number, stage in enumerate(scene.stages):
        _require_rest(scene, number)
        for tool in scene.tools:
            if tool.name in stage.motions and not at_work(tool, stage):
                raise wrong(
                    f'moves the tool "{tool.name}", which is not at work in this stage; add '
                    f'"{stage.name}" to its stages, or leave the motion out',
                    field=f"{_key(scene, number)}.motions.{tool.name}",
                )
        for gripper in scene.grippers:
            if gripper.name in stage.motions:
                _require_led(gripper, stage, f"{_key(scene, number)}.motions.{gripper.name}")
    for tool in scene.tools:
        _require_one_axis(scene, tool)


def _require_rest(scene: SceneTables, number: int) -> None:
    """Refuse entries of a stage that do not fit to whether it ends at rest."""
    stage, key = scene.stages[number], _key(scene, number)
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


def _require_led(gripper: Gripper, stage: Stage, key: str) -> None:
    motion = stage.motions[gripper.name]
    if not at_work(gripper, stage):
        raise wrong(
            f'leads by the gripper "{gripper.name}", which is not at work in this stage; add '
            f'"{stage.name}" to its stages, or leave the motion out',
            field=key,
        )
    require_leading(motion, key)
    if motion.moves and gripper.hold != "xyz":
        raise wrong(f'leads the gripper "{gripper.name}"; give it hold = "xyz"', field=key)


def _require_one_axis(scene: SceneTables, tool: Tool) -> None:
    _require_one_turn(scene, tool)
    directions = list(directions_of(tool, scene.stages))
    for name, direction in directions:
        if abs(abs(direction @ directions[0][1]) - 1.0) > PARALLEL:
            raise wrong(
                f'moves "{tool.name}" along another line than before: the travel of a tool counts '
                "along one line over all stages, either way; give a second tool of the same shape "
                "for another line",
                field=f"stages.{name}.motions.{tool.name}.direction",
            )


def _require_one_turn(scene: SceneTables, tool: Tool) -> None:
    """Refuse a tool that turns about several axes, or goes along a line as well."""
    turns = turns_of(tool, scene.stages)
    for name, _ in directions_of(tool, scene.stages) if turns else ():
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
