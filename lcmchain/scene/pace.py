"""What sets the pace of a process: tools and grippers on a given way, or weight and forces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lcmchain.effects.process.pace import more_quasi_static
from lcmchain.effects.switches import settings_of
from lcmchain.quantities.readable import time_entry, two_digits_up
from lcmchain.scene.tables import SceneTables
from lcmchain.thresholds import LARGEST_KINETIC_PART
from lcmchain.tools.motion import GUIDED, ToolMotion


def is_driven(scene: SceneTables) -> bool:
    """Tell whether tools, grippers that lead or weight move the sheet."""
    moves = scene.process.gravity or any(tool.motion.moves for tool in scene.tools)
    return moves or is_led(scene)


def is_led(scene: SceneTables) -> bool:
    """Tell whether a tool or gripper goes its way in a given time: else forces set the pace."""
    return bool(led_tools(scene)) or any(
        gripper.leads or any(_leads(stage.motions.get(gripper.name)) for stage in scene.stages)
        for gripper in scene.grippers
    )


def _leads(motion: ToolMotion | None) -> bool:
    return motion is not None and motion.moves and motion.kind != GUIDED


def led_tools(scene: SceneTables) -> list[str]:
    """Return the names of the tools that a stroke, a table or a turn drives."""
    return [tool.name for tool in scene.tools if _leads(tool.motion)]


def has_guided_load(scene: SceneTables) -> bool:
    """Tell whether a load moves a guided tool."""
    return any(tool.motion.moves and tool.motion.kind == GUIDED for tool in scene.tools)


def slowing_entry(scene: SceneTables) -> str:
    """Return the scene entry that says how slow a led process is."""
    if scene.time_is_found:
        return "process.quasi_static"
    return "process.time" if not scene.stages else "time of the [[stages]]"


def led_time(scene: SceneTables) -> float:
    """Return how long tools have for their ways [s]: stages in which none is led do not count."""
    if not scene.stages:
        return scene.process.time
    return math.fsum(
        stage.time or 0.0
        for stage in scene.stages
        if any(_leads(motion) for motion in stage.motions.values())
    )


def slower_process(scene: SceneTables, time: float, now: float | None = None) -> str:
    """Return the scene entry, with its value, by which a led process takes a longer time [s].

    now : what takes ``time`` then takes this time now [s]; the whole process by default.
    """
    if not scene.time_is_found:
        if scene.stages:
            factor = two_digits_up(time / (now or scene.process.time))
            return f"times of the [[stages]] that are {factor} times as long"
        return f"process.time = {time_entry(time)}"
    return more_quasi_static(scene.process.quasi_static, time / scene.process.time)


def entries_that_slow(scene: SceneTables) -> list[str]:
    """Return the scene entries that slow what weight, pressures and forces drive."""
    entries = ["tools.motion.ramp", "tools.motion.damping"] if has_guided_load(scene) else []
    for pressure in scene.pressure:
        entry = "pressure.times" if pressure.value is None else "pressure.ramp"
        entries += [entry] if entry not in entries else []
    if scene.process.gravity or scene.pressure or not entries:
        entries.append("process.mass_damping")
    return entries


def balance_remedies(measures: Mapping[str, Any], scene: SceneTables) -> list[str]:
    """Return the scene entries that close an energy balance, the likeliest first.

    Cross terms have no potential. Otherwise slower motions and smaller steps close it: a sheet that
    is thrown against the tools touches them for a few steps only.

    measures : of a summary.
    """
    entries = ["element.cross_terms"] if getattr(scene.element, "cross_terms", False) else []
    if measures.get("kinetic_to_internal_over_tenth_of_stroke", 0.0) > LARGEST_KINETIC_PART:
        entries += [slowing_entry(scene)] if is_led(scene) else entries_that_slow(scene)
    return [*entries, "process.step_safety"]


def why_time_is_needed(scene: SceneTables, led: bool) -> str | None:
    """Return why a scene cannot leave its time out, in words that follow "is missing, and"."""
    if not scene.element.has_forces:
        return None
    switched_off = [key for key, setting in settings_of(scene).items() if setting == "off"]
    if scene.wet_forming is not None:
        return "resin flows while the sheet is formed (infiltration.with_forming)"
    if "viscous_shear" not in switched_off and any(
        ply.material.resists_shear_rates for ply in scene.stack
    ):
        return "the shear of the fabric depends on its rate (material.viscous)"
    if "viscous_bending" not in switched_off and any(
        ply.material.bending_resists_rates for ply in scene.stack
    ):
        return (
            "the bending of the fabric depends on its rate (material.bending.viscous_1, viscous_2)"
        )
    if "compaction_relaxation" not in switched_off and any(
        ply.material.relaxes for ply in scene.stack
    ):
        return "the compaction of the fabric relaxes (material.viscous.compaction)"
    if not led:
        return (
            "no tool has a stroke: weight, pressures and the loads of guided tools move the sheet "
            "in a time of their own"
        )
    times: dict[str, Any] = {"output.history_interval": scene.output.history_interval}
    for index, pressure in enumerate(scene.pressure):
        key = f'pressure[{index}] "{pressure.name}"'
        times |= {f"{key}.ramp": pressure.ramp, f"{key}.times": pressure.times}
    with_times = [key for key, value in times.items() if value is not None]
    return f"{with_times[0]} is a time of the process" if with_times else None
