"""A verdict on a result for every check: good, doubtful or bad, in words, with what to change.

A check is doubtful where the summary warns of it, since both read the same threshold, and bad
where the number is :data:`lcmchain.thresholds.BAD` times as large, where a guard would stop a run,
or as the check itself says. The depth between plies is judged here alone: single nodes at the rim
of a ply exceed it for a moment, of which a run need not warn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.dataset import SHEET
from lcmchain.fields.limits import hidden_text
from lcmchain.fields.loads import snaps_text
from lcmchain.quantities.durations import milliseconds_text
from lcmchain.report.field_verdicts import field_verdicts
from lcmchain.report.grades import (
    BAD_GRADE,
    DOUBTFUL,
    GOOD,
    GRADES,
    Verdict,
    grade_of,
    percent,
    share,
)
from lcmchain.report.numbers import motion_in_force
from lcmchain.results import COMPLETE
from lcmchain.scene.pace import (
    balance_remedies,
    entries_that_slow,
    has_guided_load,
    is_driven,
    is_led,
    led_time,
    led_tools,
    slowing_entry,
)
from lcmchain.solver import guards
from lcmchain.thresholds import (
    BAD,
    LARGEST_BALANCE_ERROR,
    LARGEST_DAMPING_PART,
    LARGEST_HIDDEN_FORCE,
    LARGEST_HIDDEN_THICKNESS,
    LARGEST_HOURGLASS_PART,
    LARGEST_KINETIC_PART,
    LARGEST_KINETIC_PART_AT_END,
    LARGEST_PENETRATION,
    LARGEST_PLY_DEPTH,
    LARGEST_TARGET_DISTANCE,
    LONGEST_DYNAMIC_PART,
    balance_scale,
)

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.scene import Scene


def verdicts(
    summary: Mapping[str, Any], scene: Scene, datasets: Mapping[str, xr.Dataset]
) -> list[Verdict]:
    """Judge a result, also one that a guard has stopped; what it does not hold is left out.

    Parameters
    ----------
    summary : content of ``summary.json``, of which any entry may be missing.
    scene : of the run.
    datasets : groups of ``forming.nc``.
    """
    return [
        *_state(summary),
        *_energy_balance(summary, scene),
        *_inertia(summary, scene),
        *_rest(summary, scene),
        *_damping(summary, scene),
        *_process_time(summary, scene),
        *_snaps(summary, scene),
        *_hourglass(summary),
        *_halvings(summary),
        *_penetration(summary, scene),
        *_depth_between_plies(summary),
        *_hidden_compaction(summary),
        *field_verdicts(datasets[SHEET], scene),
        *_mappings(summary),
    ]


def _state(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    state = summary.get("state", COMPLETE)
    if state == COMPLETE:
        yield Verdict("Run", GOOD, "complete: the process was computed to its end")
    elif _has_ended(summary):
        text = f"{state}. The process was computed to its end, and its fields are whole"
        yield Verdict("Run", BAD_GRADE, text, "what the reason names")
    else:
        text = f"{state}. What follows is of the frames up to then"
        yield Verdict("Run", BAD_GRADE, text, "what the reason names")


def _has_ended(summary: Mapping[str, Any]) -> bool:
    """Tell whether the process was computed to its end, whatever came after."""
    if summary.get("state", COMPLETE) == COMPLETE:
        return True
    end = summary.get("process_time_s", np.inf)
    return bool(np.isclose(summary.get("time_reached_s", 0.0), end, rtol=1e-9))


# --- energies -------------------------------------------------------------------------------------


def _energy_balance(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    if "balance_error_max" in summary:
        yield share(
            "Energy balance",
            summary["balance_error_max"],
            LARGEST_BALANCE_ERROR,
            f"off by {{}} {balance_scale(summary)}",
            "energy is lost or comes from nowhere",
            ", ".join(balance_remedies(summary, scene)),
        )


def _inertia(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
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


def _rest(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    # a stopped run has not come to its end
    if "kinetic_to_internal_end" in summary and _has_ended(summary):
        yield share(
            "At rest at the end",
            summary["kinetic_to_internal_end"],
            LARGEST_KINETIC_PART_AT_END,
            "in the last frame the kinetic energy is {} of the internal energy",
            "the sheet still moves, and its shape is not the final one",
            f"{slowing_entry(scene)}, process.mass_damping",
        )


def _damping(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
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


def _snaps(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    loads = summary.get("tool_loads", {})
    for name in led_tools(scene):
        if snaps := loads.get(name, {}).get("snaps"):
            text = (
                f"the sheet snaps under {name}: {snaps_text(snaps)}. What it does from there on "
                "may depend on pace and mesh"
            )
            yield Verdict("Snaps", DOUBTFUL, text, f"{slowing_entry(scene)}, blank.edge_length")


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


def _hourglass(summary: Mapping[str, Any]) -> Iterator[Verdict]:
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


# --- time -----------------------------------------------------------------------------------------


def _process_time(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
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
    led = " in the stages in which tools are led" if scene.stages else ""
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


def _halvings(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    count = summary.get("step_halvings")
    if count is None:
        return
    if count == 0:
        yield Verdict("Time step", GOOD, "the stable step held all along; it was never halved")
        return
    times = "once" if count == 1 else f"{count} times"
    text = f"halved {times}, since values were no numbers; the warnings name the places"
    yield Verdict("Time step", DOUBTFUL, text, "process.step_safety")


# --- contact --------------------------------------------------------------------------------------


def _penetration(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    depths = summary.get("penetration_max_m")
    if not depths:
        return
    tool, depth = max(depths.items(), key=lambda item: item[1])
    thickness = scene.stack.least_thickness
    limit = LARGEST_PENETRATION * thickness
    grade = grade_of(depth, limit, guards.DEEPEST_PENETRATION * thickness)
    text = f"nodes reach up to {1e3 * depth:.3f} mm into {tool} (good up to {1e3 * limit:.2g} mm)"
    yield Verdict("Penetration", grade, text, "contact.penalty" if grade != GOOD else "")


def _depth_between_plies(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    deepest = summary.get("stack", {}).get("ply_depth")
    if deepest is None:
        return
    part = deepest["part"]
    yield share(
        "Depth between plies",
        part,
        LARGEST_PLY_DEPTH,
        f"nodes of {deepest['ply']} reach up to {1e3 * deepest['depth_m']:.3f} mm into "
        f"{deepest['into']}, at {milliseconds_text(deepest['time_s'])}: {{}} of the thinner one",
        "thickness and pressure are not known there; a ply whose rim dents another one does so at "
        "single nodes",
        "interfaces.penalty, edge_length",
    )


def _hidden_compaction(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    if "hidden_force_part" not in summary:
        return
    thickness, force = summary["hidden_thickness_part"], summary["hidden_force_part"]
    grades = (
        grade_of(thickness, LARGEST_HIDDEN_THICKNESS, BAD * LARGEST_HIDDEN_THICKNESS),
        grade_of(force, LARGEST_HIDDEN_FORCE, BAD * LARGEST_HIDDEN_FORCE),
    )
    grade = max(grades, key=GRADES.index)
    text = (
        f"{hidden_text(thickness, force)} (good up to {percent(LARGEST_HIDDEN_THICKNESS)} and "
        f"{percent(LARGEST_HIDDEN_FORCE)})"
    )
    remedy = "contact.depth, contact.penalty" if grade != GOOD else ""
    yield Verdict("Pressure between tools", grade, text, remedy)


# --- mapping --------------------------------------------------------------------------------------


def _mappings(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    for name, report in summary.get("mapping", {}).items():
        yield _mapping(f"Mapping to {name}", f'mapping "{name}"', report)


def _mapping(check: str, key: str, report: Mapping[str, Any]) -> Verdict:
    if "error" in report:
        return Verdict(check, BAD_GRADE, f"failed: {report['error']}", key)
    count = report["status_count"]
    unmapped, extrapolated = count.get("unmapped", 0), count.get("extrapolated", 0)
    text = (
        f"{percent(report['target_coverage'])} of the target's area covered; of "
        f"{report['cell_count']:,} cells {extrapolated:,} reach beyond the edge of the sheet and "
        f"{unmapped:,} hold no values; farthest {1e3 * report['worst_distance']:.2f} mm off"
    )
    off, where = _distance_of_target(report)
    text += where
    if unmapped:
        return Verdict(check, BAD_GRADE, text, f"{key}.mesh, {key}.maximum_distance")
    if extrapolated:
        return Verdict(check, DOUBTFUL, text, f"{key}.mesh")
    if off:
        return Verdict(check, DOUBTFUL, text, f"{key}.mesh, {key}.registration")
    return Verdict(check, GOOD, text)


def _distance_of_target(report: Mapping[str, Any]) -> tuple[bool, str]:
    """Whether the target lay too far off the sheet when it was mapped, and how far."""
    place = report.get("registration")
    if place is None:
        return False, ""
    distance = place["root_mean_square_after" if report["registered"] else "root_mean_square"]
    too_far = distance > LARGEST_TARGET_DISTANCE * place["thickness"]
    return too_far, f", {1e3 * distance:.3f} mm as root mean square"
