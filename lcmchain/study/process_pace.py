"""Where ``process.time`` is part of the physics, and no study may stretch it for accuracy.

A longer process is a more accurate one only where all that happens is stretched with it. Where a
motion ends at a time of its own, or weight and forces set the pace, another process time is another
process: the sheet is held for longer, or its way is cut off. A holder that a load presses while
a punch sets the pace is there long before the punch has done its way, however fast.
"""

from __future__ import annotations

from collections.abc import Iterator

from lcmchain.scene import Scene
from lcmchain.scene.pace import is_driven, is_led
from lcmchain.tools.motion import TableMotion


def why_time_stays(scene: Scene) -> str:
    """Say what happens in a scene at a pace other than that of ``process.time``; empty if nothing.

    A specimen that clamps pull has no tools: its clamps go with the process time.
    """
    return next(_paces(scene), "")


def _paces(scene: Scene) -> Iterator[str]:
    if scene.element.type == "kinematic":
        yield "a net is laid, which knows no time"
    if scene.wet_forming is not None:
        yield "resin flows meanwhile, which has times of its own"
    if scene.stages:
        yield "the stages have times of their own"
    if not is_led(scene) and (is_driven(scene) or scene.tools or scene.pressure):
        yield "weight and forces set the pace, whatever process.time is"
    given = {key for key, _ in scene.source.given}
    for tool in scene.tools:
        key = f"tools.{tool.name}.motion"
        if isinstance(tool.motion, TableMotion):
            yield f"the table of {key} has times of its own"
        yield from _times_given(given, key, ("start", "end"))
    for pressure in scene.pressure:
        yield from _times_given(given, f"pressure.{pressure.name}", ("times", "ramp"))


def _times_given(given: set[str], table: str, entries: tuple[str, ...]) -> Iterator[str]:
    """Yield the entries of a table that the scene file gives a time, which nothing stretches."""
    for entry in entries:
        if f"{table}.{entry}" in given:
            yield f"{table}.{entry} is a time of its own"
