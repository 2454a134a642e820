"""Whether a process is slow enough to be quasi-static: the time that the sheet needs, and a run's.

A shear wave crosses a sheet of length L at c = sqrt(G/ρ), so that its slowest shear vibration with
free edges has the period 2 L/c. G is the tangent of the shear law: at rest, and where the law is
softest, since that is where a fast process makes shear bands. The load should take at least three
to five periods.
Source: Timoshenko, Young, Weaver, "Vibration Problems in Engineering", section 5.1 (period of a bar
with free ends); Ansys LS-DYNA course "Quasi-static response of explicit analysis" (three to five
natural periods).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.loads import exceeded_over, has_histories, snaps_text
from lcmchain.judgements.grades import DOUBTFUL, GOOD, Verdict, grade_of, share
from lcmchain.materials.shear_waves import shear_wave_speeds
from lcmchain.model import Model
from lcmchain.quantities.readable import milliseconds_text, percent, time_entry, two_digits
from lcmchain.results import COMPLETE
from lcmchain.scene import Scene
from lcmchain.scene.pace import (
    balance_remedies,
    entries_that_slow,
    has_guided_load,
    is_driven,
    is_led,
    led_time,
    led_tools,
    slower_process,
    slowing_entry,
)
from lcmchain.solver import guards
from lcmchain.thresholds import (
    LARGEST_BALANCE_ERROR,
    LARGEST_DAMPING_PART,
    LARGEST_HOURGLASS_PART,
    LARGEST_KINETIC_PART,
    LARGEST_KINETIC_PART_AT_END,
    LONGEST_DYNAMIC_PART,
    balance_scale,
)
from lcmchain.tools.motion import GUIDED

if TYPE_CHECKING:
    import xarray as xr

#: Periods of the slowest shear vibration that a process takes at least, and to be safe.
PERIODS = (3, 5)
#: Strain of fibres below which a sheet counts as never strained.
IDLE_STRAIN = 1e-6


# --- the time of a process ------------------------------------------------------------------------


@dataclass(frozen=True)
class ProcessTime:
    """Times that the process time of a sheet is compared with [s].

    period, softened_period : of the slowest shear vibration at rest and at the softest shear.
    holder_periods : of each guided tool that bounces on the thickness of the sheet, by its name.
    """

    period: float
    softened_period: float
    holder_periods: Mapping[str, float]

    @property
    def least(self) -> float:
        """Below this the process is dynamic [s]: some periods of the sheet at rest."""
        return PERIODS[0] * self.period

    @property
    def sufficient(self) -> float:
        """From here on it is quasi-static also where the sheet has softened [s]."""
        return PERIODS[1] * self.softened_period

    def as_dict(self) -> dict[str, Any]:
        """Return the entries of ``summary.json``."""
        return {
            "shear_period_s": self.period,
            "shear_period_softened_s": self.softened_period,
            "least_s": self.least,
            "sufficient_s": self.sufficient,
        }


def process_time_needed(model: Model) -> ProcessTime:
    """Return the periods of the slowest sheet of a model, and of the tools that rest on it."""
    periods, softened = [], []
    for body in model.bodies:
        length = float(np.ptp(body.mesh.node_positions[:, :2], axis=0).max())
        speed, soft_speed = shear_wave_speeds(body.material)
        # added mass slows the waves down
        slower = math.sqrt(float(body.inertial_mass.sum() / body.node_mass.sum()))
        periods.append(2.0 * length / speed * slower)
        softened.append(2.0 * length / soft_speed * slower)
    return ProcessTime(max(periods), max(softened), _holder_periods(model))


def _holder_periods(model: Model) -> dict[str, float]:
    """Return 2π sqrt(m/k), with k from the stiffness of all sheets over their thickness."""
    periods = {}
    stiffness = 1.0 / sum(
        body.material.thickness
        / (body.material.wave_stiffness()[1] * float(np.sum(body.mesh.element_areas)))
        for body in model.bodies
    )
    for tool, name in enumerate(model.tool_names):
        if model.tools.motion_kind[tool] == GUIDED:
            mass = float(model.tools.mass[tool])
            periods[name] = 2.0 * math.pi * math.sqrt(mass / stiffness)
    return periods


def process_time_remarks(scene: Scene, needed: ProcessTime) -> list[str]:
    """Say where the process is faster than the sheet can follow."""
    time = led_time(scene)
    if not is_driven(scene) or scene.time_is_found or time >= needed.least or time == 0.0:
        return []
    given = f"process.time = {time_entry(time)} is"
    if scene.stages:
        taken = milliseconds_text(time)
        given = f"the stages in which the sheet is led take {taken} together, which is"
    return [
        f"{given} shorter than {PERIODS[0]} periods "
        f"of the slowest shear vibration of the sheet ({milliseconds_text(needed.period)} each): "
        "inertia will be part of forces and shape; use "
        f"{slower_process(scene, needed.least, time)} or more"
    ]


def process_time_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge the time of a process by what the sheet needs."""
    needed = summary.get("process_time_needed_s")
    if needed is None or not is_driven(scene):
        return
    time = led_time(scene)
    if scene.time_is_found:
        time = scene.process.time
        pace = summary.get("pace", {})
        text = f"left out; the process takes {milliseconds_text(time)} at the fastest"
        if pace:
            text += f", and took {milliseconds_text(pace['sheet_time_s'])}"
        yield Verdict("Process time", GOOD, text)
        return
    led = " in the stages in which the sheet is led" if scene.stages else ""
    grade = grade_of(-time, -needed["least_s"], -needed["shear_period_s"])
    text = (
        f"{1e3 * time:.4g} ms{led}; the sheet, whose slowest shear vibration takes "
        f"{milliseconds_text(needed['shear_period_s'])}, needs at least "
        f"{milliseconds_text(needed['least_s'])}"
    )
    if time >= needed["sufficient_s"]:
        text += "; nothing should change with a longer process"
    else:
        sufficient = milliseconds_text(needed["sufficient_s"])
        text += f", and from {sufficient} on nothing should change any more"
    yield Verdict("Process time", grade, text, slowing_entry(scene) if grade != GOOD else "")


# --- what inertia, damping and hourglass terms took -----------------------------------------------


def idle_energy(model: Model) -> float:
    """Return the strain energy [J] below which a sheet counts as never strained.

    It is that of a fibre strain of 1e-6 throughout: ratios to less say nothing of a process.
    """
    energy = 0.0
    for body in model.bodies:
        volume = float(np.sum(body.mesh.element_areas)) * body.material.thickness
        energy += 0.5 * body.material.wave_stiffness()[0] * volume * IDLE_STRAIN**2
    return energy


def quasi_static_measures(
    history: xr.Dataset,
    energy: Mapping[str, float],
    punch: int | None,
    idle: float = 0.0,
    touched_part: float = 0.0,
    until: float = math.inf,
) -> dict[str, float]:
    """Return what inertia, damping and hourglass terms took, under the names of ``summary.json``.

    Parameters
    ----------
    history : of the result; without histories the kinetic energy is left out.
    energy : of the frame that is judged [J], the last one without a release or opened tools.
    punch : tool whose travel is the stroke, None for a scene without tools.
    idle : :func:`idle_energy`; the kinetic energy is compared with nothing smaller.
    touched_part : of the largest internal energy, which the kinetic one is compared with at least.
    until : time of that frame [s]; what comes after it is not judged.
    """
    external, internal = abs(energy["external"]), energy["internal"]
    measures = {
        "damping_to_external": energy["damping"] / external if external else 0.0,
        "hourglass_to_internal": energy["hourglass"] / internal if internal > 0.0 else 0.0,
    }
    if has_histories(history):
        past = max(int((history["history_time"].values <= until * (1.0 + 1e-9)).sum()), 1)
        history = history.isel(history_time=slice(past))
        mass_damping = float(history["history_energy_mass_damping"].values[-1])
        measures |= {
            "mass_damping_to_external": mass_damping / external if external else 0.0,
            "kinetic_to_internal_over_tenth_of_stroke": exceeded_over(
                history, punch, LONGEST_DYNAMIC_PART, idle, touched_part
            ),
        }
    return measures


# --- energy balance -------------------------------------------------------------------------------


def balance_warning(measures: Mapping[str, Any], scene: Scene) -> list[str]:
    """Say that an energy balance is off, and which entries close it.

    measures : ``balance_error_max``, ``strained`` and those of :func:`quasi_static_measures`.
    """
    error = measures["balance_error_max"]
    if not error > LARGEST_BALANCE_ERROR:
        return []
    *slower, step = balance_remedies(measures, scene)
    first = ""
    if slower and slower[0] == "element.cross_terms":
        first = f"leave {slower.pop(0)} off, or "
    if slower:
        first += f"slow the sheet with {' or '.join(slower)}, or "
    return [
        f"the energy balance is off by {error:.1%} {balance_scale(measures)}; {first}lower {step}"
    ]


def balance_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge the error of the energy balance."""
    if "balance_error_max" in summary:
        yield share(
            "Energy balance",
            summary["balance_error_max"],
            LARGEST_BALANCE_ERROR,
            f"off by {{}} {balance_scale(summary)}",
            "energy is lost or comes from nowhere",
            ", ".join(balance_remedies(summary, scene)),
        )


# --- inertia and damping, which one entry may cure ------------------------------------------------


def quasi_static_warnings(
    measures: Mapping[str, float], scene: Scene, needed: ProcessTime
) -> list[str]:
    """Say which errors inertia, damping and hourglass terms cause, and which entry cures them.

    measures : from :func:`quasi_static_measures`; needed : from :func:`process_time_needed`.
    """
    inertia, damping = _inertia_warning(measures, scene, needed), _damping_warning(measures, scene)
    together = _too_fast(measures, scene, needed) if inertia and damping else None
    pace = [together] if together is not None else [*inertia, *damping]
    return [*pace, *_hourglass_warning(measures, scene)]


def _too_fast(measures: Mapping[str, float], scene: Scene, needed: ProcessTime) -> str | None:
    """Say in one line that a process is too fast, where one entry cures inertia and damping.

    None where it takes two: where the tools do not set the pace, or the damping is that of a tool
    or of a sheet that snaps.
    """
    ratio, part = (
        measures[name]
        for name in ("kinetic_to_internal_over_tenth_of_stroke", "damping_to_external")
    )
    by_mass = measures.get("mass_damping_to_external", part) >= 0.5 * part
    if not is_led(scene) or (
        by_mass and (scene.process.mass_damping == 0.0 or scene.time_is_found)
    ):
        return None
    time = _time_for_inertia(ratio, scene, needed)
    if by_mass:
        time = max(time, scene.process.time * _excess_of_damping(part))
    return (
        f"the process is too fast for the sheet: the kinetic energy exceeds {ratio:.0%} of the "
        f"internal energy over a tenth of the stroke (quasi-static: below "
        f"{LARGEST_KINETIC_PART:.0%}) and damping takes {part:.1%} of the external work (below "
        f"{LARGEST_DAMPING_PART:.0%}), so that inertia is part of forces and shape and the tools' "
        f"forces are too high; use {slower_process(scene, time)}"
    )


def _time_for_inertia(ratio: float, scene: Scene, needed: ProcessTime) -> float:
    """Return the process time [s] at which inertia is no part of forces and shape.

    At a given shape the kinetic energy falls with the square of the process time; a process that is
    much too fast has another shape.
    """
    return max(scene.process.time * math.sqrt(ratio / LARGEST_KINETIC_PART), needed.least)


def _excess_of_damping(part: float) -> float:
    """Return the factor of the process time that brings the work of mass damping to its limit.

    The work of mass damping grows with its rate and falls with the process time.
    """
    return part * (1.0 - LARGEST_DAMPING_PART) / (LARGEST_DAMPING_PART * (1.0 - part))


def _inertia_warning(measures: Mapping[str, float], scene: Scene, needed: ProcessTime) -> list[str]:
    ratio = measures.get("kinetic_to_internal_over_tenth_of_stroke", 0.0)
    if ratio <= LARGEST_KINETIC_PART:
        return []
    if not is_led(scene):
        return [
            f"the kinetic energy exceeds {ratio:.0%} of the internal energy over a tenth of the "
            f"stroke (quasi-static: below {LARGEST_KINETIC_PART:.0%}), so that inertia is part of "
            "the way to the shape; weight and forces set the pace here, whatever process.time is: "
            "judge the shape at rest by kinetic_to_internal_end, or slow the way with "
            f"{' or '.join(entries_that_slow(scene))}"
        ]
    time = _time_for_inertia(ratio, scene, needed)
    return [
        f"the kinetic energy exceeds {ratio:.0%} of the internal energy over a tenth of the stroke "
        f"(quasi-static: below {LARGEST_KINETIC_PART:.0%}), so that inertia is part of forces and "
        f"shape; use {slower_process(scene, time)} or more"
    ]


def inertia_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge the kinetic energy over the stroke."""
    if "kinetic_to_internal_over_tenth_of_stroke" not in summary:
        return
    consequence, worst = "inertia is part of forces and shape", None
    remedy = slowing_entry(scene)
    if not is_led(scene):
        consequence = (
            "inertia is part of the way to the shape, whose pace weight and forces set; the shape "
            "is judged by whether it is at rest at the end"
        )
        remedy, worst = ", ".join(entries_that_slow(scene)), np.inf
    yield share(
        "Quasi-static",
        summary["kinetic_to_internal_over_tenth_of_stroke"],
        LARGEST_KINETIC_PART,
        f"over {percent(LONGEST_DYNAMIC_PART)} of the stroke the kinetic energy exceeds "
        "{} of the internal energy",
        consequence,
        remedy,
        worst,
    )


def _damping_warning(measures: Mapping[str, float], scene: Scene) -> list[str]:
    part = measures["damping_to_external"]
    if part <= LARGEST_DAMPING_PART:
        return []
    if not is_led(scene):
        return [
            f"damping takes {part:.1%} of the external work (quasi-static: below "
            f"{LARGEST_DAMPING_PART:.0%}): weight and forces work until it has brought sheet and "
            "tools to rest, whatever process.time is; judge the shape at rest by "
            "kinetic_to_internal_end"
        ]
    by_mass = measures.get("mass_damping_to_external", part)
    if scene.time_is_found and by_mass >= 0.5 * part:
        return [
            f"damping takes {part:.1%} of the external work (quasi-static: below "
            f"{LARGEST_DAMPING_PART:.0%}), although it acts on vibrations alone: the sheet snaps, "
            "and what a snap gives off damping takes, however slow the process; "
            f"{slower_process(scene, 2.0 * scene.process.time)} shows what of forces and shape "
            "depends on the pace"
        ]
    text = (
        f"damping takes {part:.1%} of the external work (quasi-static: below "
        f"{LARGEST_DAMPING_PART:.0%}), which the tools' forces are too high by"
    )
    rate = scene.process.mass_damping
    if by_mass < 0.5 * part:
        return [f"{text}, most of it in contacts; use a larger {slowing_entry(scene)}, or a lower "
                "contact.damping_ratio"]  # fmt: skip
    if rate == 0.0:
        return [f"{text}, most of it in tools.motion.damping; lower it"]
    excess = _excess_of_damping(part)
    return [
        f"{text}; use {slower_process(scene, scene.process.time * excess)}, or, if the sheet "
        f'stays calm, process.mass_damping = "{two_digits(rate / excess)} 1/s"'
    ]


def damping_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge what damping takes of the external work."""
    if "damping_to_external" not in summary:
        return
    consequence = "the mean forces over the stroke are too high by it" + _of_punch(summary)
    remedy, worst = f"process.mass_damping, process.damping_average, {slowing_entry(scene)}", None
    if not is_led(scene):
        consequence = (
            "weight and forces work until it has brought sheet and tools to rest; the shape is "
            "judged by whether it is at rest at the end"
        )
        # what falls freely gives all that it does not store to the dampers, whatever they are
        remedy, worst = "tools.motion.ramp" if has_guided_load(scene) else "", np.inf
    elif scene.time_is_found:
        consequence = (
            "it acts on vibrations alone: the sheet snaps, and what a snap gives off damping "
            "takes, however slow the process" + _of_punch(summary)
        )
        remedy = slowing_entry(scene)
    yield share(
        "Damping",
        summary["damping_to_external"],
        LARGEST_DAMPING_PART,
        "damping took {} of the external work",
        consequence,
        remedy,
        worst,
    )


def _of_punch(summary: Mapping[str, Any]) -> str:
    """Say what damping and inertia take of the largest force of the punch."""
    loads = summary.get("tool_loads", {}).get(summary.get("punch", ""), {})
    parts = loads.get("parts_at_maximum")
    if parts is None:
        return ""
    if swings := motion_in_force(parts):
        return f"; largest force of {summary['punch']}: {swings}"
    return (
        f"; of the {parts['force_N']:.3g} N of {summary['punch']} around its maximum damping makes "
        f"{parts['damping_N']:.2g} N and inertia {parts['inertia_N']:.2g} N"
    )


def motion_in_force(parts: Mapping[str, float]) -> str:
    """Say that damping and inertia are no parts of a force, where that is so; else empty.

    Over a piece of the travel in which the sheet swings, one of them may exceed the force, and
    others are negative: then nothing is taken *of* the force.

    parts : from :func:`lcmchain.fields.loads.force_parts`.
    """
    force, damping, inertia = (parts[f"{name}_N"] + 0.0 for name in ("force", "damping", "inertia"))
    if max(abs(damping), abs(inertia), abs(damping + inertia)) <= abs(force):
        return ""
    return (
        f"around it the mean of {force:.4g} N is the sum of damping {damping:.3g} N, inertia "
        f"{inertia:.3g} N and all else {force - damping - inertia:.3g} N: the sheet swings there, "
        "and the force is not that of a slow process"
    )


# --- rest at the end ------------------------------------------------------------------------------


def still_moving_warning(summary: Mapping[str, Any], slowing: str = "process.time") -> list[str]:
    """Say that the sheet still moves at the end.

    slowing : scene entry that says how slow the process is.
    """
    moves = summary["kinetic_to_internal_end"] > LARGEST_KINETIC_PART_AT_END
    if not moves or _ends_at_rest(summary):
        return []
    return [
        f"the sheet still moves at the end (kinetic {summary['kinetic_to_internal_end']:.1%} "
        f"of the internal energy); use a larger {slowing} or process.mass_damping"
    ]


def _ends_at_rest(summary: Mapping[str, Any]) -> bool:
    """Tell whether the last stage was one of rest, and the sheet came to rest in it.

    What is left then has been compared with the energy that was stored before the release, since
    almost none is stored after it.
    """
    stages = summary.get("stages")
    rest = stages[-1].get("rest") if stages else None
    return rest is not None and rest["reached_s"] is not None


def rest_warnings(summary: Mapping[str, Any]) -> list[str]:
    """Say which stages ended before the sheet was at rest, and how still it was."""
    warnings = []
    for stage in summary.get("stages", ()):
        rest = stage.get("rest")
        if rest is None or rest["reached_s"] is not None or not rest["ended"]:
            continue
        part = rest["energy_part"]
        how = "its motions took all of the time"
        if part is not None and part <= rest["wanted"]:
            how = "its motions left too little time to see whether it swings"
        elif part is not None:
            how = (
                f"in its last swing the kinetic energy came to {part:.2g} of what was stored, "
                f"wanted is {rest['wanted']:g}"
            )
        warnings.append(
            f"the sheet did not come to rest in the stage {stage['name']}: {how}; use a longer "
            f"stages.{stage['name']}.time"
        )
    return warnings


def rest_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge whether the sheet is at rest in the last frame of a run that came to its end."""
    # a stopped run has not come to its end
    if "kinetic_to_internal_end" in summary and has_ended(summary):
        if _ends_at_rest(summary):
            name = summary["stages"][-1]["name"]
            yield Verdict("At rest at the end", GOOD, f"the sheet came to rest in the stage {name}")
            return
        yield share(
            "At rest at the end",
            summary["kinetic_to_internal_end"],
            LARGEST_KINETIC_PART_AT_END,
            "in the last frame the kinetic energy is {} of the internal energy",
            "the sheet still moves, and its shape is not the final one",
            f"{slowing_entry(scene)}, process.mass_damping",
        )


def has_ended(summary: Mapping[str, Any]) -> bool:
    """Tell whether the process was computed to its end, whatever came after."""
    if summary.get("state", COMPLETE) == COMPLETE:
        return True
    end = summary.get("process_time_s", np.inf)
    return bool(np.isclose(summary.get("time_reached_s", 0.0), end, rtol=1e-9))


# --- snaps ----------------------------------------------------------------------------------------


def snap_warnings(loads: Mapping[str, Any], scene: Scene) -> list[str]:
    """Say where the sheet snaps under a tool that is led; a guided one bounces by itself.

    loads : of every tool, see :func:`lcmchain.fields.loads.tool_loads`.
    """
    warnings: list[str] = []
    for name in led_tools(scene):
        if snaps := loads.get(name, {}).get("snaps"):
            slower = slower_process(scene, 2.0 * scene.process.time)
            warnings.append(
                f"the sheet snaps under {name}: {snaps_text(snaps)}, and the sheet gives off what "
                "it had stored; what it does from there on may depend on pace and mesh, which "
                f"{slower} and a smaller blank.edge_length show"
            )
    return warnings


def snap_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge a sheet that snaps under a tool that is led: doubtful."""
    loads = summary.get("tool_loads", {})
    for name in led_tools(scene):
        if snaps := loads.get(name, {}).get("snaps"):
            text = (
                f"the sheet snaps under {name}: {snaps_text(snaps)}. What it does from there on "
                "may depend on pace and mesh"
            )
            yield Verdict("Snaps", DOUBTFUL, text, f"{slowing_entry(scene)}, blank.edge_length")


# --- resolution by elements -----------------------------------------------------------------------


def _hourglass_warning(measures: Mapping[str, float], scene: Scene) -> list[str]:
    part = measures["hourglass_to_internal"]
    if part <= LARGEST_HOURGLASS_PART:
        return []
    edge = 1e3 * scene.stack.shortest_edge * math.sqrt(LARGEST_HOURGLASS_PART / part)
    return [
        f"the hourglass energy is {part:.1%} of the internal energy (resolved: below "
        f'{LARGEST_HOURGLASS_PART:.0%}); use blank.edge_length = "{two_digits(edge)} mm"'
    ]


def hourglass_verdict(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    """Judge the hourglass energy, by which elements tell that they are too coarse."""
    if "hourglass_to_internal" in summary:
        yield share(
            "Resolution by elements",
            summary["hourglass_to_internal"],
            LARGEST_HOURGLASS_PART,
            "the hourglass energy is {} of the internal energy",
            "the elements are too coarse for the radii of the tools",
            "blank.edge_length",
            worst=guards.LARGEST_HOURGLASS_PART,
        )
