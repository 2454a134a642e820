"""Stages of a process in which a resin flows while the sheet is formed, on both clocks.

Forming is computed in less time than the process takes, and resin flows in real time: each stage
has a pace between the two. A stage that ends at rest takes a time that is none of the real process,
and so none for the resin.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from lcmchain.quantities.entry_types import no_such, wrong
from lcmchain.scene.infiltration import Gate, Infiltration, Vent
from lcmchain.scene.process import Stage
from lcmchain.scene.tables import SceneTables


class ResinStage(NamedTuple):
    """A stage on both clocks.

    name : of the stage. start, end : [s] of the process.
    resin_start, resin_end : [s] of the resin; the same where none flows.
    """

    name: str
    start: float
    end: float
    resin_start: float
    resin_end: float

    @property
    def flows(self) -> bool:
        """Whether resin flows in it."""
        return self.resin_end > self.resin_start

    @property
    def pace(self) -> float:
        """How much the clock of the resin runs faster than that of the process."""
        return (self.resin_end - self.resin_start) / (self.end - self.start)


def resin_stages(scene: SceneTables) -> tuple[ResinStage, ...]:
    """Return the stages of a process in which resin flows; none of one without stages."""
    if not scene.stages or scene.infiltration is None:
        return ()
    return _resin_stages(scene.stages, scene.infiltration, scene.process.time)


def _resin_stages(
    stages: Sequence[Stage], case: Infiltration, time: float
) -> tuple[ResinStage, ...]:
    """Return stages on both clocks.

    Parameters
    ----------
    stages : with their times. case : the infiltration. time : of the process [s].

    Raises
    ------
    PydanticCustomError : the stages' own times of the resin do not fit to that of the infiltration.
    """
    ends = list(accumulate(stage.time for stage in stages))
    resin_ends = list(accumulate(_resin_times(stages, case)))
    last = max(number for number, stage in enumerate(stages) if not stage.rest)
    ends[-1] = time
    resin_ends[last:] = [case.time] * (len(ends) - last)
    return tuple(
        ResinStage(stage.name, *times)
        for stage, *times in zip(
            stages, [0.0, *ends], ends, [0.0, *resin_ends], resin_ends, strict=False
        )
    )


def _resin_times(stages: Sequence[Stage], case: Infiltration) -> list[float]:
    """Return what every stage takes for the resin [s]; 0 where none flows."""
    taken = math.fsum(stage.resin_time or 0.0 for stage in stages)
    sharing = [stage for stage in stages if not stage.rest and stage.resin_time is None]
    left = case.time - taken
    if not sharing and abs(left) > 1e-9 * case.time:
        raise wrong(
            f"is {case.time:g} s, but the stages take {taken:g} s by their resin_time; give the "
            "same, or leave out the resin_time of one of them",
            field="infiltration.time",
        )
    if sharing and left <= 1e-9 * case.time:
        raise wrong(
            f"is {case.time:g} s, but other stages take {taken:g} s by their resin_time, and "
            f'nothing is left for the stage "{sharing[0].name}"; give a longer time, or its own '
            "resin_time",
            field="infiltration.time",
        )
    whole = math.fsum(stage.time for stage in sharing)
    return [
        0.0 if stage.rest else stage.resin_time or left * (stage.time / whole) for stage in stages
    ]


def require_resin(scene: SceneTables) -> None:
    """Refuse times of a resin that does not flow, and a process in which none can."""
    wet = scene.wet_forming is not None
    for number, stage in enumerate(scene.stages):
        if stage.resin_time is None:
            continue
        key = f'stages[{number}] "{stage.name}".resin_time'
        if not wet:
            raise wrong(
                "belongs to a resin that flows while the sheet is formed; give "
                "[infiltration.with_forming], or leave it out",
                field=key,
            )
        if stage.rest:
            raise wrong(
                "stands beside rest = true: the time until rest is none of the real process, and "
                "no resin flows in it; leave one of them out",
                field=key,
            )
    if wet and all(stage.rest for stage in scene.stages):
        raise wrong(
            "lets resin flow while the sheet is formed, but all stages end at rest, in which none "
            "flows; give a stage mass_damping instead of rest = true",
            field="infiltration.with_forming",
        )


# --- gates and vents of stages --------------------------------------------------------------------


def _openings(scene: SceneTables) -> Iterator[tuple[str, int, Gate | Vent]]:
    """Yield list, number and entry of the gates and vents that name stages."""
    for name in ("gates", "vents") if scene.infiltration is not None else ():
        for number, opening in enumerate(getattr(scene.infiltration, name)):
            if opening.stages is not None:
                yield name, number, opening


def require_no_places_of_stages(scene: SceneTables) -> None:
    """Refuse gates and vents of stages in a process without any."""
    for name, number, opening in _openings(scene):
        first = (opening.stages or ("",))[0]
        raise wrong(
            f'names "{first}", but the process has no stages; leave it out, or give [[stages]]',
            field=f'infiltration.{name}[{number}] "{opening.name}".stages',
        )


def with_places_of_stages(scene: SceneTables, time: float) -> dict[str, Any]:
    """Return the infiltration with the times of its gates and vents on the clock of the resin.

    Those that name stages count their times from when the first of them begins, and are closed
    when the last one ends.

    Parameters
    ----------
    scene : whose stages have their times. time : of the process [s].

    Raises
    ------
    PydanticCustomError : stages that are not there, or do not follow one another; times of the
        resin that do not fit together.
    """
    case = scene.wet_forming
    if case is None:
        return {}
    stages = _resin_stages(scene.stages, case, time)
    openings: dict[str, list[Gate | Vent]] = {"gates": [*case.gates], "vents": [*case.vents]}
    for name, number, opening in _openings(scene):
        key = f'infiltration.{name}[{number}] "{opening.name}".stages'
        openings[name][number] = _on_the_clock(opening, stages, key)
    changed = {name: tuple(entries) for name, entries in openings.items()}
    return {"infiltration": case.model_copy(update=changed)}


def _on_the_clock(place: Gate | Vent, stages: Sequence[ResinStage], key: str) -> Gate | Vent:
    """Return a gate or vent whose times count from the start of the infiltration."""
    names = [stage.name for stage in stages]
    named = place.stages or ()
    for name in named:
        if name not in names:
            raise wrong(f'names "{name}", {no_such(name, names, "stage")}', field=key)
    numbers = sorted(names.index(name) for name in named)
    flowing = [number for number, stage in enumerate(stages) if stage.flows]
    first, last = numbers[0], numbers[-1]
    if not any(number in flowing for number in numbers):
        raise wrong(
            f'names "{names[first]}", which ends at rest: no resin flows in it; name another stage',
            field=key,
        )
    for number in flowing:
        if first < number < last and number not in numbers:
            raise wrong(
                f'leaves out "{names[number]}", which lies between the others; name stages that '
                "follow one another, or give a second entry",
                field=key,
            )
    start, end = stages[first].resin_start, stages[last].resin_end
    closes = math.inf if place.closes is None else start + place.closes
    times = getattr(place, "times", None)
    changed: dict[str, Any] = {"opens": start + place.opens}
    if closes < end or last < flowing[-1]:
        changed["closes"] = min(closes, end)
    if times is not None:
        changed["times"] = tuple(start + time for time in times)
    if not changed["opens"] < end:
        raise wrong(
            f"ends {end - start:g} s after it begins, but it opens at {place.opens:g} s; times "
            "count from there",
            field=key,
        )
    return place.model_copy(update=changed)
