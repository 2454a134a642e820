"""Settings of a run beside its mesh: inertia, fibre modulus, process time and model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from lcmchain.scene import RUNGS, Scene, rung_of
from lcmchain.scene.pace import is_driven, is_led
from lcmchain.tools.motion import TableMotion

#: Inertia of the sheet, times its own, and process times, by that of the scene, to choose from.
MASSES = (16.0, 4.0)
SHORTER, LONGER = 0.5, (2.0, 4.0)
#: Modulus of the fibres, by that of the fabric.
SOFTER_FIBRES = 0.25


@dataclass(frozen=True)
class StepSettings:
    """Settings of a run beside its mesh.

    Parameters
    ----------
    mass : inertia of the sheet over its own; damping falls by the root of it, so that it drags as
        much as before (``lcmchain docs larger-steps``).
    fibres : modulus of the fibres over that of the fabric.
    time : process time over that of the scene.
    model : rung of the model ladder; empty for that of the scene.
    """

    mass: float = 1.0
    fibres: float = 1.0
    time: float = 1.0
    model: str = ""

    def overrides(self, scene: Scene) -> tuple[str, ...]:
        """Return what they change of a scene."""
        process, changed = scene.process, []
        if scene.time_is_found and self.speed != 1.0:
            # more mass alone takes longer by its root, and as many steps
            changed.append(f"process.quasi_static={process.quasi_static / self.speed:g}")
        if self.mass != 1.0 and not scene.time_is_found:
            changed.append(f"process.mass_scaling={{factor = {self.mass:g}}}")
            damping = process.mass_damping / math.sqrt(self.mass)
            if damping > 0.0:
                changed.append(f'process.mass_damping="{damping:.9g} 1/s"')
        if self.fibres != 1.0:
            changed.append(f"process.fibre_modulus_factor={self.fibres:g}")
        if self.time != 1.0 and not scene.time_is_found:
            changed.append(f'process.time="{1e3 * self.time * process.time:.9g} ms"')
        return tuple(changed)

    @property
    def speed(self) -> float:
        """How fast the process is for the inertia of the sheet, over that of the scene.

        n times the mass acts on a sheet as a process that is shorter by the root of n.
        """
        return math.sqrt(self.mass) / self.time

    def in_words(self) -> list[str]:
        """Name what differs from the scene."""
        told = [f"the {self.model} model"] if self.model else []
        if self.mass != 1.0:
            told.append(f"{self.mass:g} times the inertia")
        if self.fibres != 1.0:
            told.append(f"{self.fibres:g} of the fibre modulus")
        if self.time != 1.0:
            told.append(f"{self.time:g} times the process time")
        return told


AS_IT_IS = StepSettings()


@dataclass(frozen=True)
class Candidate:
    """Settings with their errors on any mesh, by quantity, and their time over the scene's.

    ``errors`` are distances from a slow process with all else as it is.
    """

    settings: StepSettings
    errors: Mapping[str, float] = field(default_factory=dict)
    cost: float = 1.0


def inertia_trials(scene: Scene) -> list[StepSettings]:
    """Return settings that move the sheet faster than the scene does, the fastest first.

    A scene with added mass of its own keeps it, and its time where that is part of the physics.
    """
    if scene.time_is_found:
        return [StepSettings(time=1.0 / math.sqrt(mass)) for mass in MASSES]
    if scene.process.mass_scaling is None:
        return [StepSettings(mass=mass) for mass in MASSES]
    return [] if why_time_stays(scene) else [StepSettings(time=SHORTER)]


def slower(scene: Scene) -> list[StepSettings]:
    """Return settings that move the sheet more slowly than the scene, where the time is free."""
    if why_time_stays(scene):
        return []
    return [StepSettings(time=factor) for factor in LONGER]


def cheaper_rungs(scene: Scene, quantities: Mapping[str, float]) -> Iterator[str]:
    """Yield the rungs below that of the scene that predict these quantities, the cheapest first."""
    rungs = list(RUNGS)
    for name in rungs[: rungs.index(rung_of(scene))]:
        element = RUNGS[name]
        if not element.has_thickness and {"thickness", "fibre_volume_fraction"} & set(quantities):
            continue
        if not element.has_forces and {"punch_force", "forming_work"} & set(quantities):
            continue
        yield name


# --- where process.time is part of the physics ----------------------------------------------------


def why_time_stays(scene: Scene) -> str:
    """Say what in a scene does not follow ``process.time``; empty where everything does.

    A longer process is more accurate only where all that happens is stretched with it. Where a
    motion ends at a time of its own, or weight and forces set the pace, another process time is
    another process: the sheet is held for longer, or its way is cut off. A holder under a load does
    not matter beside a punch that sets the pace: it arrives long before the punch does. A specimen
    that clamps pull has no tools, and its clamps follow the process time.
    """
    return next(_paces(scene), "")


def _paces(scene: Scene) -> Iterator[str]:
    if scene.element.type == "kinematic":
        yield "a net is laid, which knows no time"
    if scene.wet_forming is not None:
        yield "resin flows meanwhile, which has times of its own"
    if scene.stages:
        yield "the stages have times of their own"
    if not is_led(scene) and (is_driven(scene) or scene.tools or scene.pressure or scene.grippers):
        yield "weight and forces set the pace, whatever process.time is"
    given = {key for key, _ in scene.source.given}
    moving = [("tools", tool.name, tool.motion) for tool in scene.tools]
    moving += [("grippers", gripper.name, gripper.motion) for gripper in scene.grippers]
    for kind, name, motion in moving:
        key = f"{kind}.{name}.motion"
        if isinstance(motion, TableMotion):
            yield f"the table of {key} has times of its own"
        yield from _times_given(given, key, ("start", "end"))
    for pressure in scene.pressure:
        yield from _times_given(given, f"pressure.{pressure.name}", ("times", "ramp"))


def _times_given(given: set[str], table: str, entries: tuple[str, ...]) -> Iterator[str]:
    """Yield the entries of a table that the scene file gives a time, which nothing stretches."""
    for entry in entries:
        if f"{table}.{entry}" in given:
            yield f"{table}.{entry} is a time of its own"
